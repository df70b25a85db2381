//! Images of scenes: base colour textures and latitude-longitude skies.

use super::{
    compose::{Composed, Composition},
    error::{Problem, SceneError},
    files::{Bytes, Files},
    guard, list,
};
use crate::scene::model::{Environment, Material, Reading, Rgb, Texture};
use ::image::{DynamicImage, ImageReader, RgbaImage};
use basisu::{DecodeFlags, TargetFormat, Transcoder};
use glam::Vec3;
use rayon::prelude::*;
use std::{borrow::Cow, io::Cursor, path::Path};

/// The longest side of an image [pixels].
const MAX_SIDE: u32 = 16384;
/// What all textures of a scene may take [bytes].
const MAX_BYTES: u64 = 1 << 30;

/// The most pixels of a sky: 8192×8192, 1 GiB on the device.
const MAX_TEXELS: u64 = 1 << 26;

/// A texture that is decoded only if a surface uses it.
#[derive(Debug, Clone)]
pub(super) struct TextureSource {
    pub name: String,
    pub content: Content,
    pub reading: Reading,
}

#[derive(Debug, Clone)]
pub(super) enum Content {
    Files(Composition),
    Bytes(Bytes),
    /// Known to be out of reach, and why.
    Missing(String),
}

/// Decodes the textures; a material whose texture is missing or broken goes on without it, and a note says so.
///
/// # Errors
/// Images beyond the limits, found before their pixels are allocated.
pub(super) fn decode_all(sources: &[TextureSource], files: &Files, materials: &mut [Material], notes: &mut Vec<String>) -> Result<Vec<Texture>, SceneError> {
    let mut decoder = Decoder { files, budget: MAX_BYTES, failures: Vec::new(), normals: Vec::new() };
    let mut textures = Vec::new();
    // The number of each texture, and what multiplies how far its normals lean.
    let mut decoded = vec![None; sources.len()];
    for (source, decoded) in sources.iter().zip(&mut decoded) {
        if let Some(Composed { image, lean }) = decoder.decode(source)? {
            *decoded = Some((textures.len() as u32, lean));
            let texels = image.pixels().map(|pixel| pixel.0).collect();
            textures.push(Texture {
                name: source.name.clone(),
                width: image.width(),
                height: image.height(),
                texels,
                coarser: Vec::new(),
                reading: source.reading,
            });
        }
    }
    for material in &mut *materials {
        let emits_by_map = material.maps.emission.is_some();
        material.maps.normal_scale *= material.maps.normal.and_then(|map| decoded[map as usize]).map_or(1.0, |(_, lean)| lean);
        for texture in material.textures_mut() {
            *texture = texture.and_then(|texture| decoded[texture as usize]).map(|(number, _)| number);
        }
        if emits_by_map && material.maps.emission.is_none() {
            // Which parts shine is not known: all of them would be a lamp.
            material.emission = Vec3::ZERO;
        }
        material.alpha_cutoff = material.alpha_cutoff.filter(|_| material.texture.is_some());
    }
    let textures = with_mipmaps(textures, materials);
    if !decoder.failures.is_empty() {
        notes.push(format!("textures that could not be read, their surfaces go without: {}", list(&decoder.failures)));
    }
    if !decoder.normals.is_empty() {
        notes.push(format!("maps of heights that have the colours of normals were taken as normals: {}", list(&decoder.normals)));
    }
    Ok(textures)
}

/// With coarser levels, of all that are not read at full size alone. Where an image is a mask, too, what it cuts out does not count for its colours.
fn with_mipmaps(textures: Vec<Texture>, materials: &[Material]) -> Vec<Texture> {
    let mut cutoffs = vec![None; textures.len()];
    materials.iter().filter_map(|material| material.texture.zip(material.alpha_cutoff)).for_each(|(texture, cutoff)| cutoffs[texture as usize] = Some(cutoff));
    let mipmapped = |(texture, cutoff): (Texture, Option<f32>)| if texture.reading.is_fine { texture } else { texture.with_levels(cutoff) };
    textures.into_par_iter().zip(cutoffs).map(mipmapped).collect()
}

/// Opens images as long as there is room for them.
pub(super) struct Decoder<'a> {
    files: &'a Files<'a>,
    /// What textures may still take [bytes].
    budget: u64,
    /// Images that could not be read, and why.
    failures: Vec<String>,
    /// Those that were taken as maps of normals, and not of heights.
    pub normals: Vec<String>,
}

impl Decoder<'_> {
    /// None for one that cannot be read, or that says nothing.
    fn decode(&mut self, source: &TextureSource) -> Result<Option<Composed>, SceneError> {
        let composed = match &source.content {
            Content::Files(composition) => composition.compose(&source.name, source.reading.wrap, self)?,
            Content::Bytes(bytes) => self.open_bytes(&source.name, bytes)?.map(Composed::plain),
            Content::Missing(why) => {
                self.fail(&source.name, why);
                None
            }
        };
        if let Some(Composed { image, .. }) = &composed {
            self.budget -= self.expect_room(&source.name, image.width(), image.height())?;
        }
        Ok(composed)
    }

    fn fail(&mut self, name: &str, why: &str) {
        let failure = format!("{name} ({why})");
        if !self.failures.contains(&failure) {
            self.failures.push(failure);
        }
    }

    /// The image of a file, which messages call by a name; none where it cannot be read.
    ///
    /// # Errors
    /// One beyond the limits.
    pub fn open(&mut self, name: &str, path: &Path) -> Result<Option<DynamicImage>, SceneError> {
        match self.files.read(path) {
            Ok(bytes) => return self.open_bytes(name, &bytes),
            Err(error) => match error.problem() {
                Problem::TooLarge => return Err(error),
                Problem::NotFound => self.fail(name, "missing"),
                _ => self.fail(name, &error.to_string()),
            },
        }
        Ok(None)
    }

    fn open_bytes(&mut self, name: &str, bytes: &[u8]) -> Result<Option<DynamicImage>, SceneError> {
        let Some((width, height)) = dimensions(bytes) else {
            self.fail(name, "not an image of a known format");
            return Ok(None);
        };
        expect_side(name, width, height)?;
        self.expect_room(name, width, height)?;
        let image = decode_pixels(bytes);
        if image.is_none() {
            self.fail(name, "its pixels are broken");
        }
        Ok(image)
    }

    /// What a texture of so many pixels takes [bytes].
    pub fn expect_room(&self, name: &str, width: u32, height: u32) -> Result<u64, SceneError> {
        let bytes = 4 * u64::from(width) * u64::from(height);
        if bytes <= self.budget {
            return Ok(bytes);
        }
        Err(SceneError::new(Problem::TooLarge, format!("the scene's textures take more than 1 GiB; `{name}` was one too many")).help("use smaller textures"))
    }
}

fn dimensions(bytes: &[u8]) -> Option<(u32, u32)> {
    let stated = || if is_ktx2(bytes) { Some(Transcoder::new(bytes).ok()?.base_dimensions()) } else { reader(bytes)?.into_dimensions().ok() };
    guard(stated).flatten().filter(|&(width, height)| width > 0 && height > 0)
}

fn decode_pixels(bytes: &[u8]) -> Option<DynamicImage> {
    guard(|| if is_ktx2(bytes) { decode_ktx2(bytes) } else { reader(bytes)?.decode().ok() }).flatten()
}

fn is_ktx2(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\xabKTX 20\xbb\r\n\x1a\n")
}

/// The largest level of a file of KHR_texture_basisu.
fn decode_ktx2(bytes: &[u8]) -> Option<DynamicImage> {
    let transcoder = Transcoder::new(bytes).ok()?;
    let (width, height) = transcoder.base_dimensions();
    let pixels = transcoder.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).ok()?;
    RgbaImage::from_raw(width, height, pixels).map(DynamicImage::ImageRgba8)
}

fn reader(bytes: &[u8]) -> Option<ImageReader<Cursor<&[u8]>>> {
    ImageReader::new(Cursor::new(bytes)).with_guessed_format().ok()
}

fn expect_side(name: &str, width: u32, height: u32) -> Result<(), SceneError> {
    if width.max(height) <= MAX_SIDE {
        return Ok(());
    }
    Err(SceneError::new(Problem::TooLarge, format!("image `{name}` is {width}×{height}; the limit is {MAX_SIDE} pixels a side")).help("scale the image down"))
}

/// Refuses a sky before memory is taken for it: a small file may state any size.
fn expect_sky(name: &str, width: u32, height: u32) -> Result<(), SceneError> {
    expect_side(name, width, height)?;
    if u64::from(width) * u64::from(height) <= MAX_TEXELS {
        return Ok(());
    }
    Err(SceneError::new(Problem::TooLarge, format!("sky `{name}` is {width}×{height}; the limit is {MAX_TEXELS} pixels")).help("scale the image down"))
}

/// Reads a latitude-longitude sky from EXR or Radiance HDR, turns it by `rotation` [radians] from −z towards +x and
/// multiplies it by `scale`.
///
/// # Errors
/// A file that is unreadable, too large, or holds a negative or non-finite radiance.
pub(super) fn load_sky(path: &Path, files: &Files, scale: f32, rotation: f64) -> Result<Environment, SceneError> {
    let name = path.display().to_string();
    let is_exr = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"));
    let bytes = files.read(path)?;
    let (width, height, texels) = if is_exr { decode_exr(&bytes, &name)? } else { decode_hdr(&bytes, &name)? };
    if texels.is_empty() {
        return Err(undecodable(&name));
    }
    let texels: Vec<Rgb> = texels.into_iter().map(|texel| texel * scale).collect();
    if !texels.iter().all(|texel| texel.is_finite() && texel.cmpge(Vec3::ZERO).all()) {
        return Err(SceneError::new(Problem::Range, format!("sky `{name}` holds a radiance that is negative or no finite number")).help("mend the image"));
    }
    Ok(Environment::LatLong { width, height, texels: turn(&texels, width as usize, rotation) })
}

type Radiance = (u32, u32, Vec<Rgb>);

fn decode_hdr(bytes: &[u8], name: &str) -> Result<Radiance, SceneError> {
    let bytes = &signed(bytes);
    let (width, height) = dimensions(bytes).ok_or_else(|| undecodable(name))?;
    expect_sky(name, width, height)?;
    let image = decode_pixels(bytes).ok_or_else(|| undecodable(name))?.into_rgb32f();
    Ok((width, height, image.pixels().map(|pixel| Vec3::from(pixel.0)).collect()))
}

/// A Radiance file under the name that its decoder knows: each program may sign with its own, such as `#?RGBE`.
fn signed(bytes: &[u8]) -> Cow<'_, [u8]> {
    const KNOWN: &[u8] = b"#?RADIANCE";
    match bytes.iter().position(|&byte| byte == b'\n') {
        Some(end) if bytes.starts_with(b"#?") && !bytes.starts_with(KNOWN) => Cow::Owned([KNOWN, &bytes[end..]].concat()),
        _ => Cow::Borrowed(bytes),
    }
}

fn decode_exr(bytes: &[u8], name: &str) -> Result<Radiance, SceneError> {
    use exr::prelude::*;
    let meta = guard(|| MetaData::read_from_buffered(Cursor::new(bytes), false).ok()).flatten().ok_or_else(|| undecodable(name))?;
    for header in &meta.headers {
        let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
        expect_sky(name, side(header.layer_size.width()), side(header.layer_size.height()))?;
    }
    let decode = || {
        let reader = read().no_deep_data().largest_resolution_level().rgb_channels(
            |size, _| (size.width(), vec![Vec3::ZERO; size.area()]),
            |(width, texels): &mut (usize, Vec<Rgb>), at, (r, g, b): (f32, f32, f32)| texels[at.y() * *width + at.x()] = Vec3::new(r, g, b),
        );
        reader.first_valid_layer().all_attributes().from_buffered(Cursor::new(bytes)).ok()
    };
    let image = guard(decode).flatten().ok_or_else(|| undecodable(name))?;
    let size = image.layer_data.size;
    Ok((size.width() as u32, size.height() as u32, image.layer_data.channel_data.pixels.1))
}

fn undecodable(name: &str) -> SceneError {
    SceneError::new(Problem::Format, format!("sky `{name}` cannot be decoded"))
        .help("latitude-longitude skies are read from OpenEXR (.exr) and Radiance (.hdr) files")
}

/// Moves the columns of every row; between whole columns the two nearest are mixed.
fn turn(texels: &[Rgb], width: usize, rotation: f64) -> Vec<Rgb> {
    let shift = (rotation / std::f64::consts::TAU).rem_euclid(1.0) * width as f64;
    let (whole, part) = (shift.floor() as usize % width, shift.fract() as f32);
    let row = |row: &[Rgb]| -> Vec<Rgb> {
        let column = |x: usize| row[(x + 2 * width - whole) % width];
        (0..width).map(|x| column(x).lerp(column(x + width - 1), part)).collect()
    };
    texels.chunks_exact(width).flat_map(row).collect()
}
