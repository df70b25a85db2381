//! The pictures of a page: all with one exposure, and where each is too bright or too dark. However many there are, their pixels are bounded.

use crate::measure::compare::judged;
use crate::measure::layers::{DIRECT, GLOSSY, IRRADIANCE, Layer, Layers, PICTURE, PictureError};
use crate::measure::metrics::{ErrorMap, MetricsError, error_map, fair_exposure};
use crate::measure::statistics::quantile;
use base64::{Engine, engine::general_purpose::STANDARD};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use serde::Serialize;
use std::collections::BTreeMap;

/// The layers that are shown, where the variant is judged by them.
const SHOWN: [&str; 3] = [PICTURE, GLOSSY, DIRECT];

/// The layers whose errors are mapped, where the reference holds them too.
const MAPPED: [&str; 4] = [IRRADIANCE, PICTURE, GLOSSY, DIRECT];

/// Longest side of a map of errors [pixels]: finer ones show little but the reference's noise, and would be most of a page's weight.
const MAP_SIDE: u32 = 256;

/// Most pixels of all pictures of a layer together: what many large ones have beyond it is shown as means of blocks.
const MOST_PIXELS: u64 = 1 << 24;

/// The same of all maps of a layer.
const MOST_MAP_PIXELS: u64 = 1 << 21;

/// Levels of a map on either side of 0.
const LEVELS: u8 = 50;

/// The share of all pixels' errors that a map's scale holds; what lies beyond has the scale's last colour.
const WITHIN_SCALE: f64 = 0.99;

/// The smallest scale of a map [share of the reference's mean].
const LEAST_SCALE: f64 = 1e-4;

/// Pictures as they are shown, and maps of their errors.
pub struct Gallery<'r> {
    /// Of the pictures [pixels].
    size: [u32; 2],
    /// How many pictures share a page, the reference with them.
    pictures: u64,
    reference: Option<&'r Layers>,
    /// That of the first picture, or of the reference where it has one [stops].
    exposure: Option<f32>,
    shots: Vec<Shot>,
}

/// Red, green, blue, 8 bits each, rows from the top.
struct Bitmap {
    size: [u32; 2],
    /// Pixels of the whole picture along a side of one of these.
    block: u32,
    pixels: Vec<u8>,
}

#[derive(Default)]
struct Shot {
    /// By layer.
    pictures: BTreeMap<&'static str, Bitmap>,
    maps: BTreeMap<&'static str, CoarseMap>,
}

/// A map of errors as means of blocks.
struct CoarseMap {
    size: [u32; 2],
    /// Pixels of the reference along a side of a block.
    block: u32,
    /// Every how many pixels of the picture the reference holds one.
    stride: u32,
    over_mean: Vec<Option<f32>>,
}

/// The gallery as the page's script reads it.
#[derive(Serialize)]
pub(super) struct Exhibition {
    /// Of all pictures [stops].
    exposure: f32,
    shown: Vec<PictureSet>,
    maps: Vec<MapSet>,
}

/// The pictures of one layer.
#[derive(Serialize)]
struct PictureSet {
    layer: &'static str,
    /// One a variant; null where it has no such layer.
    images: Vec<Option<Image>>,
    reference: Option<Image>,
}

/// A PNG file as a data URI.
#[derive(Serialize)]
struct Image {
    width: u32,
    height: u32,
    /// Pixels of the whole picture along a side of one of these, which is their mean.
    block: u32,
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
    /// An empty gallery, to take in so many pictures of this size; `reference` is shown beside them.
    pub fn new(size: [u32; 2], pictures: usize, reference: Option<&'r Layers>) -> Self {
        Self { size, pictures: pictures as u64 + u64::from(reference.is_some()), reference, exposure: None, shots: Vec::new() }
    }

    /// Takes the next variant's picture in, and maps where it differs from `judge`.
    pub fn add(&mut self, picture: &Layers, judge: Option<&Layers>) -> Result<(), MetricsError> {
        let shown = |error| MetricsError::Picture { which: "picture", error };
        let exposure = self.exposure_for(picture).map_err(shown)?;
        let pictures = judged(picture).filter(|layer| SHOWN.contains(layer));
        let pictures = pictures.map(|layer| Ok((layer, self.bitmap(picture, layer, exposure)?))).collect::<Result<_, _>>().map_err(shown)?;
        let maps = judged(picture).filter_map(|layer| Some((layer, self.map(picture, judge?, layer)?)));
        let maps = maps.map(|(layer, map)| map.map(|map| (layer, map))).collect::<Result<_, _>>()?;
        self.shots.push(Shot { pictures, maps });
        Ok(())
    }

    /// Tells that the next variant has no picture.
    pub fn skip(&mut self) {
        self.shots.push(Shot::default());
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

    fn map(&self, picture: &Layers, judge: &Layers, layer: &str) -> Option<Result<CoarseMap, MetricsError>> {
        judge.layers.contains_key(layer).then(|| error_map(picture, judge, layer).map(|map| self.coarse(map)))
    }

    fn coarse(&self, map: ErrorMap) -> CoarseMap {
        let block = block(map.size, MAP_SIDE, MOST_MAP_PIXELS / self.pictures.max(1));
        let over_mean = means(map.size, block, |at| map.over_mean[at]);
        CoarseMap { size: map.size.map(|side| side.div_ceil(block)), block, stride: self.size[0].div_ceil(map.size[0].max(1)), over_mean }
    }

    fn bitmap(&self, picture: &Layers, layer: &str, exposure: f32) -> Result<Bitmap, PictureError> {
        let whole = [picture.width, picture.height];
        let block = block(whole, u32::MAX, MOST_PIXELS / self.pictures.max(1));
        let [width, height] = whole.map(|side| side.div_ceil(block));
        let pixels = match block {
            1 => picture.to_srgb(layer, exposure)?,
            _ => {
                let plane = |plane: &[f32]| means(whole, block, |at| Some(plane[at])).into_iter().map(Option::unwrap_or_default).collect();
                let planes = picture.rgb(layer)?.map(plane);
                let channels = ["R", "G", "B"].map(str::to_owned).into_iter().zip(planes).collect();
                Layers::new(width, height).with(PICTURE, Layer { channels, half: false }).to_srgb(PICTURE, exposure)?
            }
        };
        Ok(Bitmap { size: [width, height], block: block * self.size[0].div_ceil(whole[0].max(1)), pixels })
    }

    /// Encodes all that was taken in.
    pub(super) fn show(&self) -> Result<Exhibition, PictureError> {
        let exposure = self.exposure.unwrap_or(0.0);
        let is_shown = |layer: &&str| *layer == PICTURE || self.shots.iter().any(|shot| shot.pictures.contains_key(layer));
        Ok(Exhibition {
            exposure,
            shown: SHOWN.into_iter().filter(is_shown).map(|layer| self.picture_set(layer, exposure)).collect::<Result<_, _>>()?,
            maps: MAPPED.into_iter().filter_map(|layer| self.map_set(layer)).collect::<Result<_, _>>()?,
        })
    }

    fn picture_set(&self, layer: &'static str, exposure: f32) -> Result<PictureSet, PictureError> {
        let first = self.shots.first().and_then(|shot| shot.pictures.get(layer));
        let image = |(index, shot): (usize, &Shot)| shot.pictures.get(layer).map(|picture| picture.encode(first.filter(|_| index > 0))).transpose();
        let reference = self.reference.filter(|reference| reference.layers.contains_key(layer));
        Ok(PictureSet {
            layer,
            images: self.shots.iter().enumerate().map(image).collect::<Result<_, _>>()?,
            reference: reference.map(|reference| self.bitmap(reference, layer, exposure)?.encode(None)).transpose()?,
        })
    }

    fn map_set(&self, layer: &'static str) -> Option<Result<MapSet, PictureError>> {
        let maps: Vec<Option<&CoarseMap>> = self.shots.iter().map(|shot| shot.maps.get(layer)).collect();
        let block = maps.iter().flatten().next()?.block;
        let scale = scale(maps.iter().flatten().flat_map(|map| map.over_mean.iter().flatten()));
        let images = maps.iter().map(|map| map.map(|map| encode_map(map, scale)).transpose()).collect::<Result<_, _>>();
        Some(images.map(|images| MapSet { layer, scale, levels: LEVELS, block, images }))
    }
}

/// The least side of square blocks of which a picture has no more than so many, nor more along a side.
fn block(size: [u32; 2], most_side: u32, most: u64) -> u32 {
    let blocks = |block: u32| size.map(|side| u64::from(side.div_ceil(block)));
    let fits = |[width, height]: [u64; 2]| width.max(height) <= u64::from(most_side) && width * height <= most.max(1);
    (1..size[0].max(size[1])).find(|block| fits(blocks(*block))).unwrap_or(size[0].max(size[1]).max(1))
}

/// The means of square blocks, each of the values that are known.
fn means([width, height]: [u32; 2], block: u32, value: impl Fn(usize) -> Option<f32>) -> Vec<Option<f32>> {
    let columns = width.div_ceil(block);
    let mean = |at: u32| {
        let (x, y) = (at % columns * block, at / columns * block);
        let rows = y..(y + block).min(height);
        let places = rows.flat_map(|row| (x..(x + block).min(width)).map(move |column| row as usize * width as usize + column as usize));
        let (count, sum) = places.filter_map(&value).fold((0u32, 0.0f32), |(count, sum), value| (count + 1, sum + value));
        (count > 0).then(|| sum / count as f32)
    };
    (0..columns * height.div_ceil(block)).map(mean).collect()
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
        Ok(Image::new(self.size, self.block, from_first, &difference.unwrap_or(whole)))
    }
}

impl Image {
    fn new([width, height]: [u32; 2], block: u32, from_first: bool, png: &[u8]) -> Self {
        Self { width, height, block, from_first, source: format!("data:image/png;base64,{}", STANDARD.encode(png)) }
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

fn encode_map(map: &CoarseMap, scale: f64) -> Result<Image, PictureError> {
    let level = |error: f32| ((f64::from(error) / scale).clamp(-1.0, 1.0) * f64::from(LEVELS)).round() as i16;
    let byte = |error: Option<f32>| error.map_or(0, |error| (level(error) + i16::from(LEVELS) + 1) as u8);
    let bytes: Vec<u8> = map.over_mean.iter().map(|error| byte(*error)).collect();
    Ok(Image::new(map.size, map.block * map.stride, false, &png(map.size, &bytes, ExtendedColorType::L8)?))
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
        let mut gallery = Gallery::new([64; 2], 3, None);
        pictures.iter().for_each(|picture| gallery.add(picture, None).unwrap());
        let shown = gallery.show().unwrap();
        let images: Vec<&Image> = shown.shown[0].images.iter().flatten().collect();
        assert_eq!(images.iter().map(|image| image.from_first).collect::<Vec<_>>(), [false, true, false]);
        let first = decode(images[0]).into_rgb8().into_raw();
        for (image, picture) in images.iter().zip(&pictures) {
            let mut bytes = decode(image).into_rgb8().into_raw();
            if image.from_first {
                bytes.iter_mut().zip(&first).for_each(|(byte, first)| *byte = byte.wrapping_add(*first));
            }
            assert_eq!(bytes, picture.to_srgb(PICTURE, shown.exposure).unwrap());
        }
        assert!(shown.maps.is_empty() && shown.shown.len() == 1 && shown.shown[0].reference.is_none());
    }

    #[test]
    fn one_exposure_brings_the_reference_to_middle_grey() {
        let (reference, dark) = (grey(4, |_| 8.0), grey(4, |_| 2.0));
        let mut gallery = Gallery::new([4; 2], 1, Some(&reference));
        gallery.add(&dark, None).unwrap();
        let shown = &gallery.show().unwrap().shown[0];
        assert_eq!(decode(shown.reference.as_ref().unwrap()).into_rgb8().get_pixel(0, 0).0, [118; 3]);
        assert!(decode(shown.images[0].as_ref().unwrap()).into_rgb8().get_pixel(0, 0).0[0] < 70);
    }

    #[test]
    fn maps_hold_signed_errors_on_one_round_scale() {
        // A quarter without a surface; errors of -10, +10 and +5 percent elsewhere.
        let reference = grey(4, |at| if at < 4 { 0.0 } else { 2.0 });
        let mut gallery = Gallery::new([4; 2], 3, Some(&reference));
        gallery.add(&grey(4, |at| if at < 8 { 1.8 } else { 2.2 }), Some(&reference)).unwrap();
        gallery.skip();
        gallery.add(&grey(4, |_| 2.1), Some(&reference)).unwrap();
        let shown = gallery.show().unwrap();
        let set = &shown.maps[0];
        assert!(set.layer == "irradiance" && (set.scale - 0.1).abs() < 1e-12 && set.block == 1, "{}", set.scale);
        let bytes = |index: usize| decode(set.images[index].as_ref().unwrap()).into_luma8().into_raw();
        assert_eq!(bytes(0), [[0; 4], [1; 4], [101; 4], [101; 4]].concat());
        assert!(set.images[1].is_none() && shown.shown[0].images[1].is_none());
        assert_eq!(bytes(2), [[0; 4], [76; 4], [76; 4], [76; 4]].concat());
    }

    #[test]
    fn only_layers_that_a_variant_is_judged_by_are_shown() {
        let layer = |value: f32| Layer::value(vec![value; 16]);
        let reference = grey(4, |_| 2.0).with(GLOSSY, layer(2.0)).with(DIRECT, layer(1.0));
        let layers = |picture: &Layers| {
            let mut gallery = Gallery::new([4; 2], 1, Some(&reference));
            gallery.add(picture, Some(&reference)).unwrap();
            let shown = gallery.show().unwrap();
            assert!(shown.shown.iter().all(|set| set.images[0].is_some() && set.reference.is_some()));
            assert!(shown.maps.iter().all(|set| set.images[0].is_some()));
            (shown.shown.iter().map(|set| set.layer).collect::<Vec<_>>(), shown.maps.iter().map(|set| set.layer).collect::<Vec<_>>())
        };
        let diffuse = grey(4, |_| 1.0).with(DIRECT, layer(1.0));
        assert_eq!(layers(&diffuse), (vec![PICTURE], vec![IRRADIANCE, PICTURE]));
        assert_eq!(layers(&diffuse.with(GLOSSY, layer(1.5))), (vec![PICTURE, GLOSSY], vec![IRRADIANCE, PICTURE, GLOSSY]));
        let direct = Layers::new(4, 4).with(PICTURE, layer(1.0)).with(DIRECT, layer(1.0));
        assert_eq!(layers(&direct), (vec![PICTURE, DIRECT], vec![PICTURE, DIRECT]));
        assert_eq!(layers(&direct.with("indirect", layer(1.0))), (vec![PICTURE], vec![PICTURE]));
    }

    #[test]
    fn large_maps_show_means_of_blocks() {
        // Columns 0, 1, 2 of each block; a last block of one column that sees no surface.
        let map = ErrorMap { size: [766, 2], over_mean: (0..1532).map(|at| (at % 766 < 765).then_some((at % 766 % 3) as f32)).collect() };
        let coarse = Gallery::new([1532, 4], 1, None).coarse(map);
        assert_eq!((coarse.size, coarse.block, coarse.stride), ([256, 1], 3, 2));
        assert!(coarse.over_mean[..255].iter().all(|mean| *mean == Some(1.0)) && coarse.over_mean[255].is_none());
    }

    #[test]
    fn so_many_large_pictures_become_means_of_blocks() {
        assert_eq!([[1000, 1000], [1920, 1080], [3, 70]].map(|size| block(size, u32::MAX, MOST_PIXELS / 11)), [1, 2, 1]);
        assert_eq!(block([u32::MAX, 1], u32::MAX, 0), u32::MAX);
        // Of 16384 pictures each may have 1024 pixels: 36 by 36 are 18 by 18 blocks, whose columns are 0 and 1, 2 and 3 and so on.
        let mut gallery = Gallery::new([36; 2], 1 << 14, None);
        gallery.add(&grey(36, |at| (at % 36) as f32), None).unwrap();
        let image = &gallery.show().unwrap().shown[0].images[0];
        let image = image.as_ref().unwrap();
        assert_eq!((image.width, image.height, image.block), (18, 18, 2));
        let means = grey(18, |at| (at % 18 * 2) as f32 + 0.5);
        assert_eq!(decode(image).into_rgb8().into_raw(), means.to_srgb(PICTURE, gallery.exposure.unwrap()).unwrap());
    }

    #[test]
    fn scales_are_round() {
        for (error, expected) in [(0.0, 1e-4), (0.011, 0.02), (0.05, 0.05), (0.051, 0.1), (3.0, 5.0)] {
            assert!((scale([error].iter()) / expected - 1.0).abs() < 1e-9, "{error}");
        }
    }
}
