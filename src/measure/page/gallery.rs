//! The pictures of a page as linear light, and maps of their errors. However many there are, their pixels and bytes are bounded.

use super::planes::{ALL_BITS, Packed, Planes, means};
use super::records::{MOST_RECORDS, Overlay, RecordSet};
use crate::measure::compare::judged;
use crate::measure::layers::{DIRECT, GLOSSY, IRRADIANCE, Layers, PICTURE, PictureError};
use crate::measure::metrics::{ErrorMap, MetricsError, error_map, fair_exposure, hdr_flips};
use crate::measure::statistics::quantile;
use serde::Serialize;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// The layers that are shown and whose errors are mapped, where the variant is judged by them.
const SHOWN: [&str; 4] = [PICTURE, IRRADIANCE, GLOSSY, DIRECT];

/// Longest side of a map of errors [pixels]: finer ones show little but the reference's noise, and would be most of a page's weight.
const MAP_SIDE: u32 = 192;

/// Most pixels of all pictures of a layer together: what many large ones have beyond it is shown as means of blocks.
const MOST_PIXELS: u64 = 1 << 24;

/// The same of all maps of a layer.
const MOST_MAP_PIXELS: u64 = 1 << 21;

/// Most bytes of all pictures together, with the records over them: where there would be more, each number has fewer bits, then pixels are merged.
const MOST_BYTES: usize = 25 << 19;

/// Bits of the mantissa that each number of a picture keeps in any case: right to 0.8 %, less than what 8 bits of a screen show.
const LEAST_BITS: u32 = 6;

/// The same of maps.
const MAP_BITS: u32 = 6;

/// What a bit of each number weighs in a page, where none foretells another [bytes].
const BYTES_PER_BIT: f64 = 4.0 / 3.0 / 8.0;

/// The share of all pixels' errors that a map's scale holds; what lies beyond has the scale's last colour.
const WITHIN_SCALE: f64 = 0.99;

/// The smallest scale of a map [share of the reference's mean].
const LEAST_SCALE: f64 = 1e-4;

/// Pictures as they are shown, and maps of their errors: of one frame, or of each frame of a sequence.
pub struct Gallery {
    /// Of the pictures [pixels].
    size: [u32; 2],
    /// How many pictures share a page, the references with them.
    pictures: u64,
    /// Of each layer: that of the first reference or picture that has it [stops].
    exposures: BTreeMap<&'static str, f32>,
    frames: Vec<Frame>,
    /// Of the frame that is not whole yet.
    shots: Vec<Shot>,
}

/// What variants and reference show of one moment.
struct Frame {
    moment: Option<Moment>,
    shots: Vec<Shot>,
    /// By layer.
    reference: BTreeMap<&'static str, Planes>,
}

/// A frame's place in a sequence.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Moment {
    /// Its number.
    pub frame: u32,
    /// When it is.
    pub seconds: f64,
}

#[derive(Default)]
struct Shot {
    /// By layer.
    pictures: BTreeMap<&'static str, Planes>,
    errors: BTreeMap<&'static str, Map>,
    flip: Option<Map>,
    /// By cache.
    records: Vec<Overlay>,
}

/// A map of errors as means of blocks.
struct Map {
    /// Pixels of the reference along a side of a block.
    block: u32,
    planes: Planes,
}

/// The gallery as the page's script reads it: each frame has the same sets.
#[derive(Serialize)]
pub(super) struct Exhibition {
    frames: Vec<FrameSet>,
}

#[derive(Serialize)]
struct FrameSet {
    /// Null of one picture.
    moment: Option<Moment>,
    shown: Vec<PictureSet>,
    maps: Vec<MapSet>,
    /// HDR-ꟻLIP of the pictures.
    flip: Option<MapSet>,
    /// For each variant those of its caches.
    records: Vec<Vec<RecordSet>>,
}

/// The pictures of one layer.
#[derive(Serialize)]
struct PictureSet {
    layer: &'static str,
    /// At which all of them are shown well, and what their numbers are scaled by [stops].
    exposure: f32,
    /// One a variant; null where it has no such layer.
    images: Vec<Option<Packed>>,
    reference: Option<Packed>,
}

/// The maps of one layer's errors, all on one scale.
#[derive(Serialize)]
struct MapSet {
    layer: &'static str,
    /// The error of the scale's last colour [share of the reference's mean; of 1].
    scale: f64,
    /// Pixels of the reference along a side of a map's pixel, which shows their mean.
    block: u32,
    /// One a variant.
    images: Vec<Option<Packed>>,
}

impl Gallery {
    /// An empty gallery, to take in so many pictures of this size, with the references and of all frames.
    pub fn new(size: [u32; 2], pictures: usize) -> Self {
        Self { size, pictures: pictures as u64, exposures: BTreeMap::new(), frames: Vec::new(), shots: Vec::new() }
    }

    /// Takes the next variant's picture in, and maps where it differs from `judge`.
    pub fn add(&mut self, picture: &Layers, judge: Option<&Layers>) -> Result<(), MetricsError> {
        let shown = |error| MetricsError::Picture { which: "picture", error };
        let mut shot = Shot::default();
        for layer in judged(picture).filter(|layer| SHOWN.contains(layer)) {
            let exposure = self.exposure_for(&[judge, Some(picture)], layer).map_err(shown)?;
            shot.pictures.insert(layer, self.planes(picture, layer, exposure).map_err(shown)?);
            let Some(judge) = judge.filter(|judge| judge.layers.contains_key(layer)) else { continue };
            match error_map(picture, judge, layer) {
                // A frame without light has no errors.
                Err(error) if error.is_dark() => continue,
                map => shot.errors.insert(layer, self.map(map?)),
            };
            if layer == PICTURE {
                shot.flip = hdr_flips(picture, judge)?.map(|map| self.map(map));
            }
        }
        self.shots.push(shot);
        Ok(())
    }

    /// Lays records over the picture that was taken in last.
    pub fn overlay(&mut self, records: Vec<Overlay>) {
        if let Some(shot) = self.shots.last_mut() {
            shot.records = records;
        }
    }

    /// Tells that the next variant has no picture.
    pub fn skip(&mut self) {
        self.shots.push(Shot::default());
    }

    /// Ends a frame, of which every variant's picture is there; `reference` is shown beside them.
    pub fn end_frame(&mut self, moment: Option<Moment>, reference: Option<&Layers>) -> Result<(), PictureError> {
        let mut planes = BTreeMap::new();
        for layer in SHOWN.into_iter().filter(|layer| reference.is_some_and(|reference| reference.layers.contains_key(*layer))) {
            let exposure = self.exposure_for(&[reference], layer)?;
            planes.extend(reference.map(|reference| self.planes(reference, layer, exposure)).transpose()?.map(|planes| (layer, planes)));
        }
        self.frames.push(Frame { moment, shots: std::mem::take(&mut self.shots), reference: planes });
        Ok(())
    }

    /// That of the layer, as the first of the candidates that has it is shown well. Parts of the picture's light are shown as it is.
    fn exposure_for(&mut self, candidates: &[Option<&Layers>], layer: &'static str) -> Result<f32, PictureError> {
        if let Some(exposure) = self.exposures.get(layer) {
            return Ok(*exposure);
        }
        let whole = |layers: &&Layers| layer != IRRADIANCE && layers.layers.contains_key(PICTURE);
        let candidates = || candidates.iter().copied().flatten();
        let exposure = match candidates().find(whole) {
            Some(shown) => fair_exposure(shown, PICTURE)?,
            None => candidates().find(|layers| layers.layers.contains_key(layer)).map_or(Ok(0.0), |shown| fair_exposure(shown, layer))?,
        };
        // What is black says nothing of what comes.
        if exposure != 0.0 {
            self.exposures.insert(layer, exposure);
        }
        Ok(exposure)
    }

    fn map(&self, map: ErrorMap) -> Map {
        let block = block(map.size, MAP_SIDE, MOST_MAP_PIXELS / self.pictures.max(1));
        let means = means(map.size, block, |at| map.errors[at]);
        let stride = self.size[0].div_ceil(map.size[0].max(1));
        Map { block, planes: Planes::new(map.size.map(|side| side.div_ceil(block)), block * stride, vec![means], 0.0) }
    }

    fn planes(&self, picture: &Layers, layer: &str, exposure: f32) -> Result<Planes, PictureError> {
        let whole = [picture.width, picture.height];
        let block = block(whole, u32::MAX, MOST_PIXELS / self.pictures.max(1));
        let channels = picture.rgb(layer)?.map(|plane| means(whole, block, |at| Some(plane[at])));
        Ok(Planes::new(whole.map(|side| side.div_ceil(block)), block * self.size[0].div_ceil(whole[0].max(1)), channels.into(), exposure))
    }

    /// Packs all that was taken in.
    pub(super) fn show(&self) -> Exhibition {
        let shots = || self.frames.iter().flat_map(|frame| &frame.shots);
        let caches = shots().map(|shot| shot.records.len()).sum::<usize>().max(1);
        let pack = |shot: &Shot| shot.records.iter().map(|overlay| overlay.pack(MOST_RECORDS / caches)).collect();
        let records: Vec<Vec<Vec<RecordSet>>> = self.frames.iter().map(|frame| frame.shots.iter().map(pack).collect()).collect();
        let weight = records.iter().flatten().flatten().map(RecordSet::weight).sum::<usize>();
        let shown = self.picture_sets(MOST_BYTES.saturating_sub(weight));
        let mut maps: Vec<_> = SHOWN.into_iter().filter_map(|layer| self.map_sets(layer, |shot| shot.errors.get(layer))).map(Vec::into_iter).collect();
        let mut flips = self.map_sets(PICTURE, |shot| shot.flip.as_ref()).map(Vec::into_iter);
        let frames = self.frames.iter().zip(shown).zip(records).map(|((frame, shown), records)| FrameSet {
            moment: frame.moment,
            shown,
            maps: maps.iter_mut().filter_map(Iterator::next).collect(),
            flip: flips.as_mut().and_then(Iterator::next),
            records,
        });
        Exhibition { frames: frames.collect() }
    }

    /// Of each frame, all on one scale; None where no variant has such a map.
    fn map_sets<'g>(&'g self, layer: &'static str, map: impl Fn(&'g Shot) -> Option<&'g Map>) -> Option<Vec<MapSet>> {
        let maps = || self.frames.iter().flat_map(|frame| frame.shots.iter().filter_map(&map));
        let block = maps().next()?.block;
        let scale = scale(maps().flat_map(|map| map.planes.values()));
        let images = |frame: &'g Frame| frame.shots.iter().map(|shot| map(shot).map(|map| map.planes.pack(MAP_BITS, None))).collect();
        Some(self.frames.iter().map(|frame| MapSet { layer, scale, block, images: images(frame) }).collect())
    }

    /// Of each frame, at as many bits as fit; where even the fewest do not, of pixels twice as wide and high.
    fn picture_sets(&self, most_bytes: usize) -> Vec<Vec<PictureSet>> {
        let mut hung: Vec<Hung<'_>> = SHOWN.into_iter().filter_map(|layer| self.hung(layer)).collect();
        let mut bits = ALL_BITS;
        loop {
            let sets: Vec<Vec<PictureSet>> = (0..self.frames.len()).map(|frame| hung.iter().map(|hung| hung.pack(frame, bits)).collect()).collect();
            let packed = || sets.iter().flatten().flat_map(|set| set.images.iter().chain([&set.reference]).flatten());
            let (weight, numbers) = packed().fold((0, 0), |(weight, numbers), packed| (weight + packed.weight(), numbers + packed.numbers()));
            if weight <= most_bytes {
                return sets;
            }
            if bits > LEAST_BITS {
                let too_many = ((weight - most_bytes) as f64 / (numbers as f64 * BYTES_PER_BIT)).ceil() as u32;
                bits = bits.saturating_sub(too_many.max(1)).max(LEAST_BITS);
            } else {
                hung.iter_mut().for_each(Hung::merge);
                bits = ALL_BITS;
            }
        }
    }

    /// None of a layer that no variant has; of the picture in any case.
    fn hung(&self, layer: &'static str) -> Option<Hung<'_>> {
        let of_frame = |frame: &'_ Frame| frame.shots.iter().any(|shot| shot.pictures.contains_key(layer));
        if layer != PICTURE && !self.frames.iter().any(of_frame) {
            return None;
        }
        let frames = self.frames.iter().map(|frame| Wall {
            pictures: frame.shots.iter().map(|shot| shot.pictures.get(layer).map(Cow::Borrowed)).collect(),
            reference: frame.reference.get(layer).map(Cow::Borrowed),
        });
        Some(Hung { layer, exposure: self.exposures.get(layer).copied().unwrap_or(0.0), frames: frames.collect() })
    }
}

/// The pictures of one layer, to be packed.
struct Hung<'g> {
    layer: &'static str,
    exposure: f32,
    frames: Vec<Wall<'g>>,
}

/// Those of one frame.
struct Wall<'g> {
    pictures: Vec<Option<Cow<'g, Planes>>>,
    reference: Option<Cow<'g, Planes>>,
}

impl Wall<'_> {
    fn first(&self) -> Option<&Planes> {
        self.pictures.first().and_then(Option::as_deref)
    }
}

impl Hung<'_> {
    /// A frame's: its first picture is told from the first frame's, the others from its first.
    fn pack(&self, frame: usize, bits: u32) -> PictureSet {
        let wall = &self.frames[frame];
        let before = self.frames.first().and_then(Wall::first).filter(|_| frame > 0);
        let from = |index: usize| if index > 0 { wall.first() } else { before };
        let pack = |(index, picture): (usize, &Option<Cow<'_, Planes>>)| picture.as_ref().map(|picture| picture.pack(bits, from(index)));
        PictureSet {
            layer: self.layer,
            exposure: self.exposure,
            images: wall.pictures.iter().enumerate().map(pack).collect(),
            reference: wall.reference.as_ref().map(|planes| planes.pack(bits, wall.first())),
        }
    }

    /// Of pixels twice as wide and high.
    fn merge(&mut self) {
        let planes = self.frames.iter_mut().flat_map(|wall| wall.pictures.iter_mut().chain([&mut wall.reference]).flatten());
        planes.for_each(|planes| *planes = Cow::Owned(planes.merged(2)));
    }
}

/// The least side of square blocks of which a picture has no more than so many, nor more along a side.
fn block(size: [u32; 2], most_side: u32, most: u64) -> u32 {
    let blocks = |block: u32| size.map(|side| u64::from(side.div_ceil(block)));
    let fits = |[width, height]: [u64; 2]| width.max(height) <= u64::from(most_side) && width * height <= most.max(1);
    (1..size[0].max(size[1])).find(|block| fits(blocks(*block))).unwrap_or(size[0].max(size[1]).max(1))
}

/// A round number, 1, 2 or 5 times a power of ten, that holds nearly all errors.
fn scale(errors: impl Iterator<Item = f32>) -> f64 {
    let mut sizes: Vec<f64> = errors.map(|error| f64::from(error.abs())).collect();
    sizes.sort_by(f64::total_cmp);
    let size = quantile(&sizes, WITHIN_SCALE).unwrap_or(0.0).max(LEAST_SCALE);
    let power = 10f64.powf(size.log10().floor());
    // A tenth of a percent above a round number is that number.
    [1.0, 2.0, 5.0].into_iter().map(|step| step * power).find(|round| size <= round * 1.001).unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::super::planes::tests::{noise, unpack};
    use super::*;
    use crate::measure::layers::Layer;

    fn grey(size: u32, value: impl Fn(u32) -> f32) -> Layers {
        let plane = || Layer::value((0..size * size).map(&value).collect());
        Layers::new(size, size).with(PICTURE, plane()).with("irradiance", plane())
    }

    /// The light of a picture's channels.
    fn light(set: &PictureSet, image: Option<&Packed>) -> Vec<Vec<f32>> {
        let values = unpack(image.unwrap(), set.images[0].as_ref());
        values.into_iter().map(|plane| plane.into_iter().map(|value| value / set.exposure.exp2()).collect()).collect()
    }

    #[test]
    fn pictures_come_back() {
        // Noise, so that the difference of the like ones is the smaller file.
        let pictures = [grey(64, |at| 1e9 * noise(at)), grey(64, |at| 1.02e9 * noise(at)), grey(64, |_| 0.5e9)];
        let mut gallery = Gallery::new([64; 2], 4);
        pictures.iter().for_each(|picture| gallery.add(picture, None).unwrap());
        gallery.end_frame(None, Some(&pictures[1])).unwrap();
        let shown = gallery.show().frames.remove(0);
        assert!(shown.maps.is_empty() && shown.flip.is_none());
        assert_eq!(shown.shown.iter().map(|set| set.layer).collect::<Vec<_>>(), [PICTURE, IRRADIANCE]);
        for set in &shown.shown {
            for (image, picture) in set.images.iter().chain([&set.reference]).zip(pictures.iter().chain([&pictures[1]])) {
                for plane in light(set, image.as_ref()) {
                    let held = picture.rgb(set.layer).unwrap()[0];
                    assert!(plane.iter().zip(held).all(|(found, held)| (found - held).abs() <= 0.001 * held.abs() + 1e4), "{}", set.layer);
                }
            }
        }
    }

    #[test]
    fn many_pictures_have_fewer_bits() {
        let coloured = |seed: u32| {
            let pixels: Vec<f32> = (0..3 * 512 * 512).map(|at| noise(at + (seed << 20))).collect();
            Layers::new(512, 512).with(PICTURE, Layer::interleaved(&["R", "G", "B"], &pixels, 3))
        };
        let kept = |pictures: u32| {
            let mut gallery = Gallery::new([512; 2], pictures as usize);
            (0..pictures).for_each(|seed| gallery.add(&coloured(seed), None).unwrap());
            gallery.end_frame(None, None).unwrap();
            let set = gallery.show().frames.remove(0).shown.remove(0);
            let images = || set.images.iter().flatten();
            (images().map(Packed::weight).sum::<usize>(), images().next().unwrap().bits())
        };
        let (one, many) = (kept(1), kept(8));
        assert_eq!(one.1, ALL_BITS);
        assert!(many.1 < ALL_BITS && many.0 <= MOST_BYTES && many.0 > MOST_BYTES / 2, "{many:?}");
    }

    /// All frames are shown at one exposure, that of the first that is not black, and their maps are on one scale.
    #[test]
    fn frames_of_a_sequence_are_shown_alike() {
        let truth = |frame: u32| grey(64, move |at| if frame == 0 { 0.0 } else { 3.0 + noise(at) + if at < 64 { frame as f32 } else { 0.0 } });
        let own = |frame: u32| grey(64, move |at| 1.02f32.powi(frame as i32) * truth(frame).rgb(PICTURE).unwrap()[0][at as usize]);
        let mut gallery = Gallery::new([64; 2], 8);
        for frame in 0..4 {
            gallery.add(&own(frame), Some(&truth(frame))).unwrap();
            gallery.end_frame(Some(Moment { frame, seconds: f64::from(frame) / 24.0 }), Some(&truth(frame))).unwrap();
        }
        let frames = gallery.show().frames;
        let shown = |frame: usize| &frames[frame].shown[0];
        let exposure = fair_exposure(&truth(1), PICTURE).unwrap();
        for frame in 0..4 {
            assert_eq!((shown(frame).exposure, frames[frame].maps[0].scale), (exposure, frames[0].maps[0].scale));
            assert_eq!(frames[frame].moment.unwrap().frame, frame as u32);
        }
        assert!((frames[0].maps[0].scale - 0.1).abs() < 1e-9, "the error of the last frame, 6 %, is within the scale");
        let third = unpack(shown(2).images[0].as_ref().unwrap(), shown(0).images[0].as_ref());
        let held = own(2).rgb(PICTURE).unwrap()[0].to_vec();
        assert!(third[0].iter().zip(&held).all(|(found, held)| (found / exposure.exp2() / held - 1.0).abs() < 1e-3));
    }

    #[test]
    fn one_exposure_brings_the_reference_to_middle_grey() {
        let (reference, dark) = (grey(4, |_| 8.0), grey(4, |_| 2.0));
        let mut gallery = Gallery::new([4; 2], 2);
        gallery.add(&dark, Some(&reference)).unwrap();
        gallery.end_frame(None, Some(&reference)).unwrap();
        let shown = gallery.show().frames.remove(0);
        for set in &shown.shown {
            assert_eq!(reference.to_srgb(PICTURE, set.exposure).unwrap()[0], 118);
            assert!((light(set, set.images[0].as_ref())[0][0] - 2.0).abs() < 0.002);
        }
    }

    #[test]
    fn maps_hold_signed_errors_on_one_round_scale() {
        // A quarter without a surface; errors of -10, +10 and +5 percent elsewhere.
        let reference = grey(4, |at| if at < 4 { 0.0 } else { 2.0 });
        let mut gallery = Gallery::new([4; 2], 4);
        gallery.add(&grey(4, |at| if at < 8 { 1.8 } else { 2.2 }), Some(&reference)).unwrap();
        gallery.skip();
        gallery.add(&grey(4, |_| 2.1), Some(&reference)).unwrap();
        gallery.end_frame(None, Some(&reference)).unwrap();
        let shown = gallery.show().frames.remove(0);
        let set = shown.maps.iter().find(|set| set.layer == IRRADIANCE).unwrap();
        assert!((set.scale - 0.1).abs() < 1e-12 && set.block == 1, "{}", set.scale);
        let hold = |index: usize, expected: [Option<f32>; 4]| {
            let found = unpack(set.images[index].as_ref().unwrap(), None).remove(0);
            let rows = expected.iter().flat_map(|error| [*error; 4]);
            assert!(found.iter().zip(rows).all(|(found, error)| error.map_or(found.is_nan(), |error| (found - error).abs() < 0.001)), "{found:?}");
        };
        hold(0, [None, Some(-0.1), Some(0.1), Some(0.1)]);
        assert!(set.images[1].is_none() && shown.shown[0].images[1].is_none());
        hold(2, [None, Some(0.05), Some(0.05), Some(0.05)]);
        let flip = unpack(shown.flip.unwrap().images[0].as_ref().unwrap(), None).remove(0);
        assert!(flip.iter().all(|error| (0.0..=1.0).contains(error)) && flip[12] > 0.01, "{flip:?}");
    }

    #[test]
    fn only_layers_that_a_variant_is_judged_by_are_shown() {
        let layer = |value: f32| Layer::value(vec![value; 16]);
        let reference = grey(4, |_| 2.0).with(GLOSSY, layer(2.0)).with(DIRECT, layer(1.0));
        let layers = |picture: &Layers| {
            let mut gallery = Gallery::new([4; 2], 2);
            gallery.add(picture, Some(&reference)).unwrap();
            gallery.end_frame(None, Some(&reference)).unwrap();
            let shown = gallery.show().frames.remove(0);
            assert!(shown.shown.iter().all(|set| set.images[0].is_some() && set.reference.is_some()));
            assert!(shown.maps.iter().all(|set| set.images[0].is_some()));
            let layers: Vec<_> = shown.shown.iter().map(|set| set.layer).collect();
            assert_eq!(layers, shown.maps.iter().map(|set| set.layer).collect::<Vec<_>>());
            layers
        };
        let diffuse = grey(4, |_| 1.0).with(DIRECT, layer(1.0));
        assert_eq!(layers(&diffuse), vec![PICTURE, IRRADIANCE]);
        assert_eq!(layers(&diffuse.with(GLOSSY, layer(1.5))), vec![PICTURE, IRRADIANCE, GLOSSY]);
        let direct = Layers::new(4, 4).with(PICTURE, layer(1.0)).with(DIRECT, layer(1.0));
        assert_eq!(layers(&direct), vec![PICTURE, DIRECT]);
        assert_eq!(layers(&direct.with("indirect", layer(1.0))), vec![PICTURE]);
    }

    #[test]
    fn large_maps_show_means_of_blocks() {
        // Columns 0, 1, 2 of each block; a last block of one column that sees no surface.
        let map = ErrorMap { size: [574, 2], errors: (0..1148).map(|at| (at % 574 < 573).then_some((at % 574 % 3) as f32)).collect() };
        let coarse = Gallery::new([1148, 4], 1).map(map);
        assert_eq!((coarse.planes.size, coarse.block, coarse.planes.block), ([192, 1], 3, 6));
        assert_eq!(coarse.planes.values().collect::<Vec<_>>(), [1.0; 191]);
    }

    #[test]
    fn so_many_large_pictures_become_means_of_blocks() {
        assert_eq!([[1000, 1000], [1920, 1080], [3, 70]].map(|size| block(size, u32::MAX, MOST_PIXELS / 11)), [1, 2, 1]);
        assert_eq!(block([u32::MAX, 1], u32::MAX, 0), u32::MAX);
        // Of 16384 pictures each may have 1024 pixels: 36 by 36 are 18 by 18 blocks, whose columns are 0 and 1, 2 and 3 and so on.
        let mut gallery = Gallery::new([36; 2], 1 << 14);
        gallery.add(&grey(36, |at| (at % 36) as f32), None).unwrap();
        let planes = &gallery.shots[0].pictures[PICTURE];
        assert_eq!((planes.size, planes.block), ([18, 18], 2));
        gallery.end_frame(None, None).unwrap();
        let set = &gallery.show().frames[0].shown[0];
        let means = light(set, set.images[0].as_ref()).remove(0);
        assert!(means.iter().enumerate().all(|(at, mean)| (mean / ((at % 18 * 2) as f32 + 0.5) - 1.0).abs() < 1e-3), "{means:?}");
    }

    #[test]
    fn scales_are_round() {
        for (error, expected) in [(0.0, 1e-4), (0.011, 0.02), (0.05, 0.05), (0.051, 0.1), (3.0, 5.0)] {
            assert!((scale([error].into_iter()) / expected - 1.0).abs() < 1e-9, "{error}");
        }
    }
}
