//! The pictures of a comparison as a page shows them: all with one exposure, and where each is too bright or too dark.

use crate::measure::layers::{Layers, PICTURE, PictureError};
use crate::measure::metrics::{ErrorMap, MetricsError, error_map, fair_exposure};
use crate::measure::statistics::quantile;
use base64::{Engine, engine::general_purpose::STANDARD};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use serde::Serialize;
use std::collections::BTreeMap;

/// The layers whose errors are mapped, where both the variant and the reference hold them.
const MAPPED: [&str; 2] = ["irradiance", PICTURE];

/// Longest side of a map of errors [pixels]: finer ones show little but the reference's noise, and would be most of a page's weight.
const MAP_SIDE: u32 = 256;

/// Levels of a map on either side of 0.
const LEVELS: u8 = 50;

/// The share of all pixels' errors that a map's scale holds; what lies beyond has the scale's last colour.
const WITHIN_SCALE: f64 = 0.99;

/// The smallest scale of a map [share of the reference's mean].
const LEAST_SCALE: f64 = 1e-4;

/// Pictures as they are shown, and maps of their errors.
pub struct Gallery<'r> {
    reference: Option<&'r Layers>,
    /// That of the first picture, or of the reference where it has one [stops].
    exposure: Option<f32>,
    shots: Vec<Shot>,
}

/// Red, green, blue, 8 bits each, rows from the top.
struct Bitmap {
    size: [u32; 2],
    pixels: Vec<u8>,
}

struct Shot {
    /// None where the variant has no picture.
    picture: Option<Bitmap>,
    maps: BTreeMap<&'static str, ErrorMap>,
}

/// The gallery as the page's script reads it.
#[derive(Serialize)]
pub(super) struct Exhibition {
    /// Of all pictures [stops].
    exposure: f32,
    /// One a variant; null where it has no picture.
    pictures: Vec<Option<Image>>,
    reference: Option<Image>,
    maps: Vec<MapSet>,
}

/// A PNG file as a data URI.
#[derive(Serialize)]
struct Image {
    width: u32,
    height: u32,
    /// Whether each byte is a difference, modulo 256, from that of the first variant's picture.
    from_first: bool,
    source: String,
}

/// The maps of one layer's errors, all on one scale.
#[derive(Serialize)]
struct MapSet {
    layer: &'static str,
    /// The error of the last level [share of the reference's mean].
    scale: f64,
    /// Levels on either side of 0: a pixel is 0 where there is no surface, else 1 + `levels` + its error's level.
    levels: u8,
    /// Pixels of the reference along a side of a map's pixel, which shows their mean.
    block: u32,
    /// One a variant.
    images: Vec<Option<Image>>,
}

impl<'r> Gallery<'r> {
    /// An empty gallery, whose pictures are judged by `reference`.
    pub fn new(reference: Option<&'r Layers>) -> Self {
        Self { reference, exposure: None, shots: Vec::new() }
    }

    /// Takes the next variant's picture in.
    pub fn add(&mut self, picture: &Layers) -> Result<(), MetricsError> {
        let shown = |error| MetricsError::Picture { which: "picture", error };
        let exposure = self.exposure_for(picture).map_err(shown)?;
        let maps = MAPPED.into_iter().filter_map(|layer| Some((layer, self.map(picture, layer)?)));
        let maps = maps.map(|(layer, map)| map.map(|map| (layer, map))).collect::<Result<_, _>>()?;
        self.shots.push(Shot { picture: bitmap(picture, exposure).map_err(shown)?, maps });
        Ok(())
    }

    fn exposure_for(&mut self, picture: &Layers) -> Result<f32, PictureError> {
        if let Some(exposure) = self.exposure {
            return Ok(exposure);
        }
        let Some(shown) = self.reference.into_iter().chain([picture]).find(|layers| layers.layers.contains_key(PICTURE)) else { return Ok(0.0) };
        let exposure = fair_exposure(shown, PICTURE)?;
        self.exposure = Some(exposure);
        Ok(exposure)
    }

    fn map(&self, picture: &Layers, layer: &str) -> Option<Result<ErrorMap, MetricsError>> {
        let reference = self.reference?;
        let both = [picture, reference].iter().all(|layers| layers.layers.contains_key(layer));
        both.then(|| error_map(picture, reference, layer).map(ErrorMap::coarse))
    }

    /// Encodes all that was taken in.
    pub(super) fn show(&self) -> Result<Exhibition, PictureError> {
        let exposure = self.exposure.unwrap_or(0.0);
        let first = self.shots.first().and_then(|shot| shot.picture.as_ref());
        let picture = |(index, shot): (usize, &Shot)| shot.picture.as_ref().map(|picture| picture.encode(first.filter(|_| index > 0))).transpose();
        let reference = self.reference.map_or(Ok(None), |reference| bitmap(reference, exposure))?;
        Ok(Exhibition {
            exposure,
            pictures: self.shots.iter().enumerate().map(picture).collect::<Result<_, _>>()?,
            reference: reference.map(|reference| reference.encode(None)).transpose()?,
            maps: MAPPED.into_iter().filter_map(|layer| self.map_set(layer)).collect::<Result<_, _>>()?,
        })
    }

    fn map_set(&self, layer: &'static str) -> Option<Result<MapSet, PictureError>> {
        let maps: Vec<Option<&ErrorMap>> = self.shots.iter().map(|shot| shot.maps.get(layer)).collect();
        let any = maps.iter().flatten().next()?;
        let reference = self.reference?;
        let block = reference.width.div_ceil(any.size[0]).max(1);
        let scale = scale(maps.iter().flatten().flat_map(|map| map.over_mean.iter().flatten()));
        let images = maps.iter().map(|map| map.map(|map| encode_map(map, scale)).transpose()).collect::<Result<_, _>>();
        Some(images.map(|images| MapSet { layer, scale, levels: LEVELS, block, images }))
    }
}

fn bitmap(picture: &Layers, exposure: f32) -> Result<Option<Bitmap>, PictureError> {
    let held = picture.layers.contains_key(PICTURE);
    let bitmap = || Ok(Bitmap { size: [picture.width, picture.height], pixels: picture.to_srgb(PICTURE, exposure)? });
    held.then(bitmap).transpose()
}

impl Bitmap {
    /// As it is, or as its difference from `first` where that is smaller. Pictures of one view differ little: nothing is lost, most of the bytes are.
    fn encode(&self, first: Option<&Self>) -> Result<Image, PictureError> {
        let whole = png(self.size, &self.pixels, ExtendedColorType::Rgb8)?;
        let difference = first.filter(|first| first.size == self.size).map(|first| {
            let bytes: Vec<u8> = self.pixels.iter().zip(&first.pixels).map(|(own, first)| own.wrapping_sub(*first)).collect();
            png(self.size, &bytes, ExtendedColorType::Rgb8)
        });
        let difference = difference.transpose()?.filter(|difference| difference.len() < whole.len());
        let from_first = difference.is_some();
        Ok(Image::new(self.size, from_first, &difference.unwrap_or(whole)))
    }
}

impl Image {
    fn new([width, height]: [u32; 2], from_first: bool, png: &[u8]) -> Self {
        Self { width, height, from_first, source: format!("data:image/png;base64,{}", STANDARD.encode(png)) }
    }
}

impl ErrorMap {
    /// The means of square blocks, so large that the map fits a page.
    fn coarse(self) -> Self {
        let [width, height] = self.size;
        let block = width.max(height).div_ceil(MAP_SIDE).max(1);
        let size = self.size.map(|side| side.div_ceil(block));
        let mean = |at: u32| {
            let (x, y) = (at % size[0] * block, at / size[0] * block);
            let rows = (y..(y + block).min(height)).map(|row| (row * width) as usize);
            let seen = rows.flat_map(|row| &self.over_mean[row + x as usize..row + (x + block).min(width) as usize]).flatten();
            let (count, sum) = seen.fold((0u32, 0.0f32), |(count, sum), error| (count + 1, sum + error));
            (count > 0).then(|| sum / count as f32)
        };
        Self { size, over_mean: (0..size[0] * size[1]).map(mean).collect() }
    }
}

/// A round number, 1, 2 or 5 times a power of ten, that holds nearly all errors.
fn scale<'e>(errors: impl Iterator<Item = &'e f32>) -> f64 {
    let mut sizes: Vec<f64> = errors.map(|error| f64::from(error.abs())).collect();
    sizes.sort_by(f64::total_cmp);
    let size = quantile(&sizes, WITHIN_SCALE).unwrap_or(0.0).max(LEAST_SCALE);
    let power = 10f64.powf(size.log10().floor());
    // A tenth of a percent above a round number is that number.
    [1.0, 2.0, 5.0].into_iter().map(|step| step * power).find(|round| size <= round * 1.001).unwrap_or(10.0 * power)
}

fn encode_map(map: &ErrorMap, scale: f64) -> Result<Image, PictureError> {
    let level = |error: f32| ((f64::from(error) / scale).clamp(-1.0, 1.0) * f64::from(LEVELS)).round() as i16;
    let byte = |error: Option<f32>| error.map_or(0, |error| (level(error) + i16::from(LEVELS) + 1) as u8);
    let bytes: Vec<u8> = map.over_mean.iter().map(|error| byte(*error)).collect();
    Ok(Image::new(map.size, false, &png(map.size, &bytes, ExtendedColorType::L8)?))
}

fn png([width, height]: [u32; 2], pixels: &[u8], colour: ExtendedColorType) -> Result<Vec<u8>, PictureError> {
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive);
    encoder.write_image(pixels, width, height, colour).map_err(|error| PictureError::Encoding { reason: error.to_string() })?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::layers::Layer;

    fn grey(size: u32, value: impl Fn(u32) -> f32) -> Layers {
        let plane = || Layer::value((0..size * size).map(&value).collect());
        Layers::new(size, size).with(PICTURE, plane()).with("irradiance", plane())
    }

    fn decode(image: &Image) -> image::DynamicImage {
        let bytes = STANDARD.decode(image.source.strip_prefix("data:image/png;base64,").unwrap()).unwrap();
        image::load_from_memory(&bytes).unwrap()
    }

    #[test]
    fn pictures_come_back_to_the_bit() {
        // Noise, so that the difference of the like ones is the smaller file.
        let noise = |at: u32| (at.wrapping_mul(0x9e37_79b9) >> 8) as f32 / (1 << 24) as f32;
        let pictures = [grey(64, noise), grey(64, |at| noise(at) * 1.02), grey(64, |_| 0.5)];
        let mut gallery = Gallery::new(None);
        pictures.iter().for_each(|picture| gallery.add(picture).unwrap());
        let shown = gallery.show().unwrap();
        let images: Vec<&Image> = shown.pictures.iter().flatten().collect();
        assert_eq!(images.iter().map(|image| image.from_first).collect::<Vec<_>>(), [false, true, false]);
        let first = decode(images[0]).into_rgb8().into_raw();
        for (image, picture) in images.iter().zip(&pictures) {
            let mut bytes = decode(image).into_rgb8().into_raw();
            if image.from_first {
                bytes.iter_mut().zip(&first).for_each(|(byte, first)| *byte = byte.wrapping_add(*first));
            }
            assert_eq!(bytes, picture.to_srgb(PICTURE, shown.exposure).unwrap());
        }
        assert!(shown.maps.is_empty() && shown.reference.is_none());
    }

    #[test]
    fn one_exposure_brings_the_reference_to_middle_grey() {
        let (reference, dark) = (grey(4, |_| 8.0), grey(4, |_| 2.0));
        let mut gallery = Gallery::new(Some(&reference));
        gallery.add(&dark).unwrap();
        let shown = gallery.show().unwrap();
        assert_eq!(decode(shown.reference.as_ref().unwrap()).into_rgb8().get_pixel(0, 0).0, [118; 3]);
        assert!(decode(shown.pictures[0].as_ref().unwrap()).into_rgb8().get_pixel(0, 0).0[0] < 70);
    }

    #[test]
    fn maps_hold_signed_errors_on_one_round_scale() {
        // A quarter without a surface; errors of -10, +10 and +5 percent elsewhere.
        let reference = grey(4, |at| if at < 4 { 0.0 } else { 2.0 });
        let mut gallery = Gallery::new(Some(&reference));
        gallery.add(&grey(4, |at| if at < 8 { 1.8 } else { 2.2 })).unwrap();
        gallery.add(&grey(4, |_| 2.1)).unwrap();
        let shown = gallery.show().unwrap();
        let set = &shown.maps[0];
        assert!(set.layer == "irradiance" && (set.scale - 0.1).abs() < 1e-12 && set.block == 1, "{}", set.scale);
        let bytes = |index: usize| decode(set.images[index].as_ref().unwrap()).into_luma8().into_raw();
        assert_eq!(bytes(0), [[0; 4], [1; 4], [101; 4], [101; 4]].concat());
        assert_eq!(bytes(1), [[0; 4], [76; 4], [76; 4], [76; 4]].concat());
    }

    #[test]
    fn large_maps_show_means_of_blocks() {
        // Columns 0, 1, 2 of each block; a last block of one column that sees no surface.
        let map = ErrorMap { size: [766, 2], over_mean: (0..1532).map(|at| (at % 766 < 765).then_some((at % 766 % 3) as f32)).collect() };
        let coarse = map.coarse();
        assert_eq!(coarse.size, [256, 1]);
        assert!(coarse.over_mean[..255].iter().all(|mean| *mean == Some(1.0)) && coarse.over_mean[255].is_none());
    }

    #[test]
    fn scales_are_round() {
        for (error, expected) in [(0.0, 1e-4), (0.011, 0.02), (0.05, 0.05), (0.051, 0.1), (3.0, 5.0)] {
            assert!((scale([error].iter()) / expected - 1.0).abs() < 1e-9, "{error}");
        }
    }
}
