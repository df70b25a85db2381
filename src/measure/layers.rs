//! Layered pictures in linear light, to and from files.
//!
//! A picture is a set of named layers of equal size, each a few named planes of floats, rows from the top. In an EXR file the
//! layer [`PICTURE`] is stored as `R`, `G`, `B`; [`DEPTH`] as `depth.Z`; any other layer of one nameless plane, such as `weight`, under its name; all
//! others as `layer.channel`, such as `irradiance.R` or `normal.X`. Attributes tell the primaries, the units and the camera.

use super::blocks::{self, Plane};
use super::projection::Projection;
use crate::math::colour::luminance;
use crate::math::windows::Windows;
use exr::meta::BlockDescription;
use exr::meta::header::Header;
use exr::prelude::*;
use glam::{Mat4, Vec3};
use miette::Diagnostic;
use std::collections::BTreeMap;
use std::io::{BufWriter, Cursor, Read, Seek, Write};
use thiserror::Error;

/// The layer that is stored without a prefix: radiance toward the camera [W m⁻² sr⁻¹, linear Rec. 709].
pub const PICTURE: &str = "picture";
/// The layer of indirect irradiance.
pub const IRRADIANCE: &str = "irradiance";
/// Indirect light toward the camera.
pub const INDIRECT: &str = "indirect";
/// The layer of what lobes reflect of indirect light.
pub const GLOSSY: &str = "glossy";
/// The layer of direct light.
pub const DIRECT: &str = "direct";

/// The layer of distances along the camera's axis, one nameless plane [units of the scene].
pub const DEPTH: &str = "depth";
/// What programs that show pictures look for depth under, within its layer.
const Z: &str = "Z";

/// The attribute that tells the corners of windows, where a picture holds nothing else.
pub const WINDOWS: &str = "windows";

/// The channel of a layer that has but one, such as `weight`.
pub const VALUE: &str = "";
/// The channel that says where a picture shows something.
pub const ALPHA: &str = "A";

/// The most samples, over all channels, that are read from one file: 4 GiB of floats.
pub const MAX_SAMPLES: usize = 1 << 30;

/// The attribute of an EXR file that holds [`Layers::attributes`] as one JSON object.
const ATTRIBUTES: &str = "hemisplat";

/// The attribute that tells the units of the layers in words.
const UNITS: &str = "units";

/// Primaries and white of Rec. 709.
const REC_709: attribute::Chromaticities =
    attribute::Chromaticities { red: Vec2(0.64, 0.33), green: Vec2(0.3, 0.6), blue: Vec2(0.15, 0.06), white: Vec2(0.3127, 0.329) };

/// A picture of several layers, and what made it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layers {
    /// Columns [pixels].
    pub width: u32,
    /// Rows [pixels].
    pub height: u32,
    /// By name. Each plane has `width · height` values.
    pub layers: BTreeMap<String, Layer>,
    /// Text by name: enough to make the picture again.
    pub attributes: BTreeMap<String, String>,
    /// Where points of the scene are in the picture, where that is known.
    pub projection: Option<Projection>,
    /// Whether its only layer came from a file that does not say of what it is; the layer is then called [`PICTURE`].
    pub is_nameless: bool,
}

/// Planes of one meaning.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layer {
    /// By channel: `R`, `G`, `B`; `X`, `Y`, `Z`; or [`VALUE`] alone. Rows from the top.
    pub channels: BTreeMap<String, Vec<f32>>,
    /// Whether a file may store half floats. Values beyond their range are stored as floats all the same.
    pub half: bool,
}

/// Why a picture cannot be read, written or taken apart.
#[derive(Debug, Error, Diagnostic)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum PictureError {
    #[error("the EXR file cannot be read: {reason}")]
    #[diagnostic(code(measure::corrupt_exr), help("single part files of scan lines or tiles are read, deep data and subsampled channels are not"))]
    CorruptExr { reason: String },
    #[error("the picture cannot be read: {reason}")]
    #[diagnostic(code(measure::corrupt_picture), help("EXR, Radiance HDR, PNG, JPEG, TGA and BMP files are read"))]
    CorruptPicture { reason: String },
    #[error("the EXR file holds {parts} parts")]
    #[diagnostic(code(measure::several_parts), help("only files of one part are read"))]
    SeveralParts { parts: usize },
    #[error("the picture of {width}×{height} pixels and {channels} channels is larger than the limit of {MAX_SAMPLES} samples")]
    #[diagnostic(code(measure::too_large))]
    TooLarge { width: usize, height: usize, channels: usize },
    #[error("channel `{channel}` of layer `{layer}` has {found} values, a picture of {width}×{height} pixels needs {}", *width as usize * *height as usize)]
    #[diagnostic(code(measure::wrong_size))]
    WrongSize { layer: String, channel: String, found: usize, width: u32, height: u32 },
    #[error("no layer `{name}`")]
    #[diagnostic(code(measure::unknown_layer), help("the file holds: {held}"))]
    UnknownLayer { name: String, held: String },
    #[error("layer `{name}` has the channels {held}, expected R, G, B or one alone")]
    #[diagnostic(code(measure::not_a_picture))]
    NotAPicture { name: String, held: String },
    #[error("{value} in channel `{channel}` of layer `{layer}` at pixel ({x}, {y})")]
    #[diagnostic(code(measure::non_finite), help("no picture with NaN or infinity is written or compared"))]
    NonFinite { layer: String, channel: String, x: u32, y: u32, value: f32 },
    #[error("the attribute `{WINDOWS}` is `{text}`")]
    #[diagnostic(code(measure::windows), help("it lists the corners of windows within the picture, each once: `0,64 128,0`"))]
    Windows { text: String },
    #[error("the picture cannot be written: {0}")]
    #[diagnostic(code(measure::unwritable))]
    Unwritable(#[from] std::io::Error),
    #[error("the picture cannot be encoded: {reason}")]
    #[diagnostic(code(measure::encoding))]
    Encoding { reason: String },
}

impl Layer {
    /// A layer of one plane.
    pub fn value(plane: Vec<f32>) -> Self {
        Self { channels: BTreeMap::from([(VALUE.to_owned(), plane)]), half: false }
    }

    /// The first `names.len()` of every `stride` values of `data` as planes of these names: `&["R", "G", "B"]` with a stride
    /// of 4 takes apart what a GPU's four-channel image reads back as. An incomplete last pixel is left out.
    ///
    /// # Panics
    /// Where there are more names than values in a stride.
    pub fn interleaved(names: &[&str], data: &[f32], stride: usize) -> Self {
        let plane = |channel: usize| data.chunks_exact(stride).map(|pixel| pixel[channel]).collect();
        Self { channels: names.iter().enumerate().map(|(channel, name)| (name.to_string(), plane(channel))).collect(), half: false }
    }

    /// The same with half floats in files.
    pub fn as_half(self) -> Self {
        Self { half: true, ..self }
    }

    /// The planes red, green, blue; a single plane stands for all three. Alpha beside them is left out. `None` for any other set of channels.
    pub fn rgb(&self) -> Option<[&[f32]; 3]> {
        if let Some(plane) = self.single() {
            return Some([plane; 3]);
        }
        let plane = |name| self.channels.get(name).map(Vec::as_slice);
        Some([plane("R")?, plane("G")?, plane("B")?])
    }

    /// Rec. 709 luminance of each pixel, or the values of a single plane. `None` for any other set of channels.
    pub fn luminance(&self) -> Option<Vec<f64>> {
        if let Some(plane) = self.single() {
            return Some(plane.iter().map(|&value| value.into()).collect());
        }
        let [r, g, b] = self.rgb()?;
        Some((0..r.len()).map(|i| luminance(Vec3::new(r[i], g[i], b[i]).as_dvec3())).collect())
    }

    /// The only plane, apart from alpha.
    fn single(&self) -> Option<&[f32]> {
        let mut planes = self.channels.iter().filter(|(name, _)| *name != ALPHA || self.channels.len() == 1).map(|(_, plane)| plane.as_slice());
        planes.next().filter(|_| planes.next().is_none())
    }

    fn channel_names(&self) -> String {
        self.channels.keys().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
    }
}

impl Layers {
    /// An empty picture of `width × height` pixels.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, ..Self::default() }
    }

    /// The same with one layer more.
    pub fn with(mut self, name: &str, layer: Layer) -> Self {
        self.layers.insert(name.to_owned(), layer);
        self
    }

    /// The same with one attribute more.
    pub fn with_attribute(mut self, name: &str, value: impl ToString) -> Self {
        self.attributes.insert(name.to_owned(), value.to_string());
        self
    }

    /// Whether it has a picture that it calls so.
    pub fn names_picture(&self) -> bool {
        !self.is_nameless && self.layers.contains_key(PICTURE)
    }

    /// The layer of that name. Where a file has one layer and does not name it, that layer answers to every name.
    pub fn layer(&self, name: &str) -> std::result::Result<&Layer, PictureError> {
        match self.layers.get(name) {
            Some(layer) => Ok(layer),
            None if self.is_nameless => self.layers.values().next().ok_or_else(|| self.unknown(name)),
            None => Err(self.unknown(name)),
        }
    }

    /// The planes red, green, blue of a layer, as [`Layer::rgb`].
    pub fn rgb(&self, name: &str) -> std::result::Result<[&[f32]; 3], PictureError> {
        let layer = self.layer(name)?;
        layer.rgb().ok_or_else(|| PictureError::NotAPicture { name: name.to_owned(), held: layer.channel_names() })
    }

    /// The luminance of a layer, as [`Layer::luminance`].
    pub fn luminance(&self, name: &str) -> std::result::Result<Vec<f64>, PictureError> {
        let layer = self.layer(name)?;
        layer.luminance().ok_or_else(|| PictureError::NotAPicture { name: name.to_owned(), held: layer.channel_names() })
    }

    /// Whether pixels that are neighbours here were neighbours in the full picture: not in one of every k-th pixel.
    pub fn is_dense(&self) -> bool {
        self.attributes.get("stride").is_none_or(|stride| stride == "1")
    }

    /// The windows that the picture holds; None where it holds all pixels.
    ///
    /// # Errors
    /// The attribute `windows` tells no windows of this picture.
    pub fn windows(&self) -> std::result::Result<Option<Windows>, PictureError> {
        let Some(text) = self.attributes.get(WINDOWS) else { return Ok(None) };
        let windows = text.parse().ok().filter(|windows: &Windows| windows.fit([self.width, self.height]));
        windows.map(Some).ok_or_else(|| PictureError::Windows { text: text.clone() })
    }

    /// Checks what every writer and every comparison relies on: planes of the picture's size, finite values.
    pub fn validate(&self) -> std::result::Result<(), PictureError> {
        let pixels = self.width as usize * self.height as usize;
        for (name, layer) in &self.layers {
            for (channel, plane) in &layer.channels {
                let (layer, channel) = (name.clone(), channel.clone());
                if plane.len() != pixels {
                    return Err(PictureError::WrongSize { layer, channel, found: plane.len(), width: self.width, height: self.height });
                }
                if let Some(at) = plane.iter().position(|value| !value.is_finite()) {
                    let (x, y) = (at as u32 % self.width, at as u32 / self.width);
                    return Err(PictureError::NonFinite { layer, channel, x, y, value: plane[at] });
                }
            }
        }
        Ok(())
    }

    /// Reads a picture: EXR with all its layers, or Radiance HDR, PNG, JPEG, TGA, BMP as layer [`PICTURE`]; the 8- and 16-bit
    /// formats are taken as sRGB and made linear. Values may be NaN or infinite: [`Layers::validate`] tells.
    pub fn read(bytes: &[u8]) -> std::result::Result<Self, PictureError> {
        if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) { Self::from_exr(bytes) } else { Self::from_other(bytes) }
    }

    /// Reads an EXR file of one part, whatever its compression, and whoever wrote it.
    pub fn from_exr(bytes: &[u8]) -> std::result::Result<Self, PictureError> {
        check_exr_size(bytes)?;
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(Cursor::new(bytes))
            .map_err(corrupt)?;
        let Vec2(width, height) = image.layer_data.size;
        let mut picture = Self::new(width as u32, height as u32);
        for channel in image.layer_data.channel_data.list {
            let (layer, name) = split_name(&channel.name.to_string());
            let half = matches!(channel.sample_data, FlatSamples::F16(_));
            let plane: Vec<f32> = channel.sample_data.values_as_f32().collect();
            if plane.len() != width * height {
                return Err(PictureError::WrongSize { layer, channel: name, found: plane.len(), width: width as u32, height: height as u32 });
            }
            let entry = picture.layers.entry(layer).or_default();
            entry.half = half;
            entry.channels.insert(name, plane);
        }
        picture.part_lone_alpha();
        picture.projection = read_projection(&image.layer_data.attributes);
        picture.is_nameless = picture.layers.len() == 1 && picture.layers.contains_key(PICTURE);
        let attributes = image.attributes.other.into_iter().chain(image.layer_data.attributes.other);
        for (name, value) in attributes {
            let AttributeValue::Text(text) = value else { continue };
            if name == *UNITS {
                // What this program writes tells what its layers are.
                picture.is_nameless &= !text.to_string().starts_with(PICTURE);
            } else {
                picture.add_attribute(name.to_string(), text.to_string());
            }
        }
        Ok(picture)
    }

    /// The attributes of an EXR file of one part, which stand before its pixels.
    ///
    /// # Errors
    /// What is no such file.
    pub fn attributes_of_exr(from: impl Read) -> std::result::Result<BTreeMap<String, String>, PictureError> {
        let meta = MetaData::read_from_unbuffered(from, false).map_err(corrupt)?;
        let mut picture = Self::new(0, 0);
        let all = meta.headers.into_iter().take(1).flat_map(|header| header.shared_attributes.other.into_iter().chain(header.own_attributes.other));
        for (name, value) in all {
            if let AttributeValue::Text(text) = value {
                picture.add_attribute(name.to_string(), text.to_string());
            }
        }
        Ok(picture.attributes)
    }

    /// The picture as an EXR file, as [`Layers::write_exr`] writes it.
    pub fn to_exr(&self) -> std::result::Result<Vec<u8>, PictureError> {
        let mut bytes = Cursor::new(Vec::new());
        self.write_exr(&mut bytes)?;
        Ok(bytes.into_inner())
    }

    /// Writes the picture as an EXR file: scan lines, the same bytes for the same picture, compressed without loss. Takes little memory beside the planes.
    pub fn write_exr(&self, to: impl Write + Seek) -> std::result::Result<(), PictureError> {
        self.validate()?;
        if self.layers.is_empty() || self.width == 0 || self.height == 0 {
            return Err(PictureError::Encoding { reason: "the picture is empty".to_owned() });
        }
        let mut planes = Vec::new();
        for (layer, content) in &self.layers {
            for (channel, plane) in &content.channels {
                planes.push((text(&join_name(layer, channel))?, Plane::of(plane, content.half)));
            }
        }
        planes.sort_by(|(a, _), (b, _)| a.cmp(b));
        let channels = planes.iter().map(|(name, plane)| ChannelDescription::named(name.clone(), plane.sample_type())).collect();
        let (header, planes) = (self.header(channels)?, planes.into_iter().map(|(_, plane)| plane).collect::<Vec<_>>());
        let size = [self.width as usize, self.height as usize];
        let mut to = BufWriter::new(to);
        exr::block::write(&mut to, smallvec::smallvec![header], true, |_, writer| blocks::write(&planes, size, writer)).map_err(|error| match error {
            exr::error::Error::Io(error) => PictureError::Unwritable(error),
            error => PictureError::Encoding { reason: error.to_string() },
        })?;
        Ok(to.flush()?)
    }

    fn header(&self, channels: SmallVec<[ChannelDescription; 5]>) -> std::result::Result<Header, PictureError> {
        let size = (self.width as usize, self.height as usize);
        let mut image = ImageAttributes::with_size(size);
        image.chromaticities = Some(REC_709);
        let mut part = LayerAttributes::default();
        if let Some(projection) = &self.projection {
            // Columns of what multiplies columns are the rows of what multiplies rows, as the format has it.
            part.world_to_camera = Some(projection.world_to_camera.to_cols_array());
            part.world_to_normalized_device = Some(projection.world_to_ndc.to_cols_array());
            part.screen_window_width = projection.width;
        }
        // One of this project's attributes to each set: the order of several would differ from run to run.
        image.other.insert(text(ATTRIBUTES)?, AttributeValue::Text(text(&ascii_json(&self.attributes)?)?));
        part.other.insert(text(UNITS)?, AttributeValue::Text(text(&self.units())?));
        let header = Header::new(text("")?, size, channels).with_shared_attributes(image).with_attributes(part);
        Ok(header.with_encoding(Compression::ZIP16, BlockDescription::ScanLines, LineOrder::Increasing))
    }

    /// Of the layers whose meaning is fixed, in words.
    fn units(&self) -> String {
        let told = |name: &String| Some(format!("{name}: {}", unit(name)?));
        self.layers.keys().filter_map(told).collect::<Vec<_>>().join("; ")
    }

    fn from_other(bytes: &[u8]) -> std::result::Result<Self, PictureError> {
        let image = image::load_from_memory(bytes).map_err(|error| PictureError::CorruptPicture { reason: error.to_string() })?;
        let linear = matches!(image, image::DynamicImage::ImageRgb32F(_) | image::DynamicImage::ImageRgba32F(_));
        let image = image.into_rgb32f();
        let (width, height) = image.dimensions();
        let mut data = image.into_raw();
        if !linear {
            data.iter_mut().for_each(|value| *value = super::tone::srgb_decode(*value));
        }
        Ok(Self { is_nameless: true, ..Self::new(width, height).with(PICTURE, Layer::interleaved(&["R", "G", "B"], &data, 3)) })
    }

    fn add_attribute(&mut self, name: String, value: String) {
        match serde_json::from_str::<BTreeMap<String, String>>(&value) {
            Ok(map) if name == ATTRIBUTES => self.attributes.extend(map),
            _ => drop(self.attributes.insert(name, value)),
        }
    }

    /// Alpha without colours is a layer like any other, not a picture.
    fn part_lone_alpha(&mut self) {
        let is_lone = |layer: &Layer| layer.channels.len() == 1 && layer.channels.contains_key(ALPHA);
        if self.layers.get(PICTURE).is_some_and(is_lone)
            && let Some(layer) = self.layers.remove(PICTURE)
        {
            let channels = layer.channels.into_values().map(|plane| (VALUE.to_owned(), plane)).collect();
            self.layers.insert(ALPHA.to_owned(), Layer { channels, ..layer });
        }
    }

    fn unknown(&self, name: &str) -> PictureError {
        let held = self.layers.keys().cloned().collect::<Vec<_>>().join(", ");
        PictureError::UnknownLayer { name: name.to_owned(), held }
    }
}

/// Refuses what the header alone tells to be unreadable or too large, before memory is taken for it.
fn check_exr_size(bytes: &[u8]) -> std::result::Result<(), PictureError> {
    let meta = MetaData::read_from_buffered(bytes, false).map_err(corrupt)?;
    let [header] = meta.headers.as_slice() else {
        return Err(PictureError::SeveralParts { parts: meta.headers.len() });
    };
    let (Vec2(width, height), channels) = (header.layer_size, header.channels.list.len());
    let samples = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(channels));
    if samples.is_none_or(|samples| samples > MAX_SAMPLES) {
        return Err(PictureError::TooLarge { width, height, channels });
    }
    if header.channels.list.iter().any(|channel| channel.sampling != Vec2(1, 1)) {
        return Err(PictureError::CorruptExr { reason: "a channel is subsampled".to_owned() });
    }
    Ok(())
}

fn corrupt(error: exr::error::Error) -> PictureError {
    PictureError::CorruptExr { reason: error.to_string() }
}

/// The unit of a layer; None where this project gives the name no meaning.
fn unit(layer: &str) -> Option<&'static str> {
    Some(match layer {
        PICTURE | DIRECT | INDIRECT | GLOSSY => "radiance, W m^-2 sr^-1",
        IRRADIANCE | "direct_irradiance" => "irradiance, W m^-2",
        "variance" => "variance of irradiance, W^2 m^-4",
        "glossy_variance" => "variance of radiance, W^2 m^-4 sr^-2",
        DEPTH => "distance along the camera's axis, units of the scene",
        "normal" => "unit vector in the scene's axes",
        "weight" => "sum of the records' weights, no unit",
        _ => return None,
    })
}

fn read_projection(part: &LayerAttributes) -> Option<Projection> {
    let matrix = |columns: Option<[f32; 16]>| columns.map(|columns| Mat4::from_cols_array(&columns));
    let (world_to_camera, world_to_ndc) = (matrix(part.world_to_camera)?, matrix(part.world_to_normalized_device)?);
    Some(Projection { world_to_camera, world_to_ndc, width: part.screen_window_width })
}

fn text(value: &str) -> std::result::Result<Text, PictureError> {
    Text::new_or_none(value).ok_or_else(|| PictureError::Encoding { reason: format!("`{value}` has letters that EXR cannot hold") })
}

/// EXR texts are Latin-1: everything beyond ASCII is escaped.
fn ascii_json(attributes: &BTreeMap<String, String>) -> std::result::Result<String, PictureError> {
    let json = serde_json::to_string(attributes).map_err(|error| PictureError::Encoding { reason: error.to_string() })?;
    let escape = |letter: char| letter.encode_utf16(&mut [0; 2]).iter().map(|unit| format!("\\u{unit:04x}")).collect::<String>();
    Ok(json.chars().map(|letter| if letter.is_ascii() { letter.to_string() } else { escape(letter) }).collect())
}

/// A file's channel name as layer and channel.
fn split_name(name: &str) -> (String, String) {
    match name.rsplit_once('.') {
        // Older files have it without `Z`.
        Some((DEPTH, Z)) => (DEPTH.to_owned(), VALUE.to_owned()),
        Some((layer, channel)) => (layer.to_owned(), channel.to_owned()),
        None if matches!(name, "R" | "G" | "B" | ALPHA) => (PICTURE.to_owned(), name.to_owned()),
        None => (name.to_owned(), VALUE.to_owned()),
    }
}

fn join_name(layer: &str, channel: &str) -> String {
    match (layer, channel) {
        (DEPTH, VALUE) => format!("{DEPTH}.{Z}"),
        (layer, VALUE) => layer.to_owned(),
        (PICTURE, channel) => channel.to_owned(),
        (layer, channel) => format!("{layer}.{channel}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn picture() -> Layers {
        let rgb: Vec<f32> = (0..36).map(|i| i as f32 * 0.37 - 1.0).collect();
        Layers::new(4, 3)
            .with(PICTURE, Layer::interleaved(&["R", "G", "B"], &rgb, 3))
            .with("irradiance", Layer::interleaved(&["R", "G", "B"], &rgb, 3))
            .with("normal", Layer::interleaved(&["X", "Y", "Z"], &rgb, 3))
            .with("weight", Layer::value(vec![0.5; 12]).as_half())
            .with_attribute("pipeline", "irradiance.ron")
            .with_attribute("scene", "Höhle \u{1f40c}.ron")
    }

    /// The names of a file's channels, in its order.
    fn channels(exr: &[u8]) -> Vec<String> {
        MetaData::read_from_buffered(exr, false).unwrap().headers[0].channels.list.iter().map(|channel| channel.name.to_string()).collect()
    }

    #[test]
    fn depth_is_where_other_programs_look_for_it_and_where_older_files_have_it() {
        let depth = Layers::new(2, 1).with(DEPTH, Layer::value(vec![1.0, 2.0]));
        let new = depth.to_exr().unwrap();
        assert_eq!(channels(&new), ["depth.Z"]);
        assert_eq!(Layers::read(&new).unwrap().layers, depth.layers);
        let plane = |_| (1.0f32,);
        let old = SpecificChannels::build().with_channel("depth").with_pixel_fn(plane);
        let mut bytes = Cursor::new(Vec::new());
        Image::from_channels((2, 1), old).write().to_buffered(&mut bytes).unwrap();
        let read = Layers::read(bytes.get_ref()).unwrap();
        assert_eq!((channels(bytes.get_ref()), &read.layers[DEPTH].channels[VALUE]), (vec!["depth".to_owned()], &vec![1.0, 1.0]));
    }

    /// As a renderer writes it: with alpha, and the camera.
    fn seen() -> Layers {
        let mut picture = picture();
        picture.layers.get_mut(PICTURE).unwrap().channels.insert(ALPHA.to_owned(), vec![1.0; 12]);
        let matrix = |scale: f32| Mat4::from_cols_array(&std::array::from_fn(|at| at as f32 * scale));
        Layers { projection: Some(Projection { world_to_camera: matrix(1.0), world_to_ndc: matrix(2.0), width: 1.5 }), ..picture }
    }

    #[test]
    fn exr_returns_what_was_written() {
        let picture = picture();
        let bytes = picture.to_exr().unwrap();
        assert_eq!(Layers::read(&bytes).unwrap(), picture);
        assert_eq!(Layers::read(&seen().to_exr().unwrap()).unwrap(), seen());
    }

    #[test]
    fn every_bit_of_every_float_returns_from_several_blocks() {
        let floats = |seed: u32| {
            let mut state = seed;
            let mut next = || {
                state = state.wrapping_mul(1664525).wrapping_add(1013904223);
                f32::from_bits(state ^ state >> 15)
            };
            std::iter::from_fn(move || Some(next())).filter(|value| value.is_finite()).take(37 * 53).collect::<Vec<f32>>()
        };
        let zero = vec![0.0; 37 * 53];
        let noise = Layers::new(37, 53).with("noise", Layer::value(floats(1))).with("more", Layer::value(floats(2)));
        for picture in [noise.clone(), noise.with("zero", Layer::value(zero)), Layers::new(37, 53).with("half", Layer::value(vec![0.5; 37 * 53]).as_half())] {
            let back = Layers::read(&picture.to_exr().unwrap()).unwrap();
            let bits = |picture: &Layers| -> Vec<u32> {
                picture.layers.values().flat_map(|layer| layer.channels[VALUE].iter().map(|value| value.to_bits())).collect()
            };
            assert!(bits(&back) == bits(&picture));
        }
    }

    #[test]
    fn what_does_not_change_takes_no_room() {
        let grey = Layers::new(200, 200).with(PICTURE, Layer::interleaved(&["R", "G", "B"], &[0.25; 120_000], 3)).with("zero", Layer::value(vec![0.0; 40_000]));
        let bytes = grey.to_exr().unwrap().len();
        assert!(bytes < 10_000, "{bytes}");
    }

    /// Pictures of other programs: of each compression without loss, with alpha, with lone alpha.
    #[test]
    fn other_programs_files_are_read_bit_by_bit() {
        use Compression::*;
        let value = |x: usize, y: usize| (x * 31 + y * 17) as f32 * 0.1234567;
        for compression in [Uncompressed, RLE, ZIP1, ZIP16, PIZ] {
            let encoding = Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
            let channels = SpecificChannels::rgba(|Vec2(x, y)| (value(x, y), 2.0, 3.0, 0.5_f32));
            let mut bytes = Cursor::new(Vec::new());
            let part = exr::prelude::Layer::new((19, 23), LayerAttributes::default(), encoding, channels);
            Image::from_layer(part).write().to_buffered(&mut bytes).unwrap();
            let back = Layers::read(bytes.get_ref()).unwrap();
            let [red, green, _] = back.rgb(PICTURE).unwrap();
            assert!((0..19 * 23).all(|at| red[at] == value(at % 19, at / 19) && green[at] == 2.0), "{compression}");
            assert_eq!(back.layers[PICTURE].channels[ALPHA], [0.5; 19 * 23]);
        }
    }

    #[test]
    fn alpha_is_neither_a_colour_nor_a_picture() {
        let grey = Layer { channels: [(ALPHA, 0.5), ("Y", 2.0)].map(|(name, value)| (name.to_owned(), vec![value])).into(), half: false };
        assert_eq!((grey.rgb().unwrap()[0][0], grey.luminance().unwrap()[0]), (2.0, 2.0));
        assert_eq!(seen().luminance(PICTURE).unwrap(), picture().luminance(PICTURE).unwrap());
        let matte = Layers::new(1, 1)
            .with(PICTURE, Layer { channels: [(ALPHA.to_owned(), vec![0.5])].into(), half: false })
            .with("irradiance", Layer::value(vec![2.0]));
        let back = Layers::read(&matte.to_exr().unwrap()).unwrap();
        assert_eq!(back.layers.keys().collect::<Vec<_>>(), [ALPHA, "irradiance"]);
    }

    #[test]
    fn a_file_tells_its_primaries_units_and_camera() {
        let bytes = seen().to_exr().unwrap();
        let header = MetaData::read_from_buffered(bytes.as_slice(), false).unwrap().headers.remove(0);
        assert_eq!(header.shared_attributes.chromaticities, Some(REC_709));
        assert_eq!(header.shared_attributes.pixel_aspect, 1.0);
        let part = &header.own_attributes;
        assert_eq!((part.screen_window_width, part.screen_window_center), (1.5, Vec2(0.0, 0.0)));
        assert_eq!(part.world_to_camera, Some(std::array::from_fn(|at| at as f32)));
        let units = part.other[&text(UNITS).unwrap()].to_text().unwrap().to_string();
        assert_eq!(
            units,
            "irradiance: irradiance, W m^-2; normal: unit vector in the scene's axes; picture: radiance, W m^-2 sr^-1; weight: sum of the records' weights, no unit"
        );
    }

    #[test]
    fn a_disk_that_is_full_is_not_a_fault_of_the_picture() {
        let mut room = [0; 600];
        let written = picture().write_exr(Cursor::new(&mut room[..]));
        assert!(matches!(written, Err(PictureError::Unwritable(_))), "{written:?}");
    }

    #[test]
    fn the_same_picture_gives_the_same_bytes() {
        assert_eq!(seen().to_exr().unwrap(), seen().to_exr().unwrap());
    }

    #[test]
    fn channels_have_the_names_that_other_programs_expect() {
        let bytes = picture().to_exr().unwrap();
        let meta = MetaData::read_from_buffered(bytes.as_slice(), false).unwrap();
        let names: Vec<String> = meta.headers[0].channels.list.iter().map(|channel| channel.name.to_string()).collect();
        assert_eq!(names, ["B", "G", "R", "irradiance.B", "irradiance.G", "irradiance.R", "normal.X", "normal.Y", "normal.Z", "weight"]);
        assert_eq!(meta.headers[0].compression, Compression::ZIP16);
    }

    #[test]
    fn half_layers_keep_half_precision_and_large_values() {
        let written = Layers::new(2, 1).with("a", Layer::value(vec![1.0 / 3.0, 2.0]).as_half()).with("b", Layer::value(vec![1.0, 1e6]).as_half());
        let back = Layers::from_exr(&written.to_exr().unwrap()).unwrap();
        let third = back.layers["a"].channels[VALUE][0];
        assert!(third != 1.0 / 3.0 && (third - 1.0 / 3.0).abs() < 2e-4, "{third}");
        assert_eq!(back.layers["b"].channels[VALUE], [1.0, 1e6]);
    }

    #[test]
    fn a_four_channel_readback_is_taken_apart() {
        let layer = Layer::interleaved(&["R", "G", "B"], &[1.0, 2.0, 3.0, 9.0, 4.0, 5.0, 6.0, 9.0], 4);
        assert_eq!(layer.rgb().unwrap(), [&[1.0, 4.0][..], &[2.0, 5.0], &[3.0, 6.0]]);
    }

    #[test]
    fn a_nameless_layer_answers_to_every_name() {
        let named = Layers::new(1, 1).with(PICTURE, Layer::value(vec![1.0]));
        assert!(named.layer("irradiance").is_err());
        assert!(Layers { is_nameless: true, ..named }.layer("irradiance").is_ok());
        assert_eq!(picture().layer("nothing").unwrap_err().to_string(), "no layer `nothing`");
    }

    #[test]
    fn a_value_that_is_no_number_is_found_and_refused() {
        let mut bad = picture();
        bad.layers.get_mut("irradiance").unwrap().channels.get_mut("G").unwrap()[6] = f32::NAN;
        let error = bad.to_exr().unwrap_err().to_string();
        assert_eq!(error, "NaN in channel `G` of layer `irradiance` at pixel (2, 1)");
    }

    #[test]
    fn a_plane_of_the_wrong_size_is_refused() {
        let bad = Layers::new(2, 2).with("weight", Layer::value(vec![0.0; 3]));
        assert!(matches!(bad.to_exr(), Err(PictureError::WrongSize { found: 3, .. })));
    }

    #[test]
    fn png_is_made_linear() {
        let mut png = Cursor::new(Vec::new());
        image::RgbImage::from_pixel(1, 1, image::Rgb([255, 188, 0])).write_to(&mut png, image::ImageFormat::Png).unwrap();
        let back = Layers::read(png.get_ref()).unwrap();
        let [r, g, b] = back.rgb(PICTURE).unwrap().map(|plane| plane[0]);
        assert!(r == 1.0 && (g - 0.5028865).abs() < 1e-5 && b == 0.0, "{r} {g} {b}");
    }

    #[test]
    fn a_header_that_lies_about_its_size_takes_no_memory() {
        let mut bytes = Layers::new(2, 2).with("w", Layer::value(vec![0.0; 4])).to_exr().unwrap();
        let window = [0i32, 0, 1, 1].map(i32::to_le_bytes).concat();
        let lie = [0i32, 0, 40_000, 40_000].map(i32::to_le_bytes).concat();
        for at in 0..bytes.len() - 16 {
            if bytes[at..at + 16] == window {
                bytes[at..at + 16].copy_from_slice(&lie);
            }
        }
        assert!(matches!(Layers::read(&bytes), Err(PictureError::TooLarge { width: 40_001, .. })));
    }

    proptest! {
        #[test]
        fn damaged_files_are_errors_or_pictures(at in 0usize..2000, value: u8, keep in 0usize..2000) {
            let mut bytes = picture().to_exr().unwrap();
            let (at, keep) = (at % bytes.len(), keep % bytes.len());
            bytes[at] = value;
            if let Ok(read) = Layers::read(&bytes) {
                prop_assert!(read.layers.values().flat_map(|layer| layer.channels.values()).all(|plane| plane.len() == (read.width * read.height) as usize));
            }
            prop_assert!(Layers::read(&bytes[..keep]).is_err());
        }
    }
}
