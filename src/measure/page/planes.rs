//! Numbers of pixels as a page keeps them: half floats, fewer bits of each where many pictures share the page, packed so that what is alike takes little.
//!
//! A half float without its sign, read as an integer, rises with its value: nearly as its logarithm. Differences of such integers are small where light
//! changes by a small share, however bright it is.

use base64::{Engine, engine::general_purpose::STANDARD};
use half::f16;
use miniz_oxide::deflate::{CompressionLevel, compress_to_vec_zlib};
use serde::Serialize;

/// Bits of a half float's mantissa.
pub(super) const ALL_BITS: u32 = 10;

/// The integer of what has no number.
const NOTHING: i16 = i16::MIN;

/// Light in red, green and blue, or one error, of each pixel.
#[derive(Clone)]
pub(super) struct Planes {
    pub(super) size: [u32; 2],
    /// Pixels of the whole picture along a side of one of these.
    pub(super) block: u32,
    /// One plane a channel, rows from the top; not a number where there is none.
    channels: Vec<Vec<f16>>,
}

/// Planes in a page.
#[derive(Serialize)]
pub(super) struct Packed {
    width: u32,
    height: u32,
    /// Pixels of the whole picture along a side of one of these, which is their mean.
    block: u32,
    channels: usize,
    /// Bits of the mantissa that are kept: a value is right to one part in 2^(bits + 1).
    bits: u32,
    /// Whether each integer is a difference from that of the first variant's picture; else from what its neighbours above and on the left foretell.
    from_first: bool,
    /// zlib in base64: of each plane the low bytes, then the high ones.
    source: String,
}

impl Packed {
    pub(super) fn numbers(&self) -> usize {
        self.channels * self.width as usize * self.height as usize
    }

    /// Its share of the page [bytes].
    pub(super) fn weight(&self) -> usize {
        self.source.len()
    }
}

impl Planes {
    /// Values by channel, each times 2^`stops`; None where there is no number. What exceeds a half float becomes its largest.
    pub(super) fn new(size: [u32; 2], block: u32, channels: Vec<Vec<Option<f32>>>, stops: f32) -> Self {
        let scale = f64::from(stops).exp2();
        let most = f64::from(f16::MAX);
        let scaled = |value: Option<f32>| half_of(value.map(|value| (f64::from(value) * scale).clamp(-most, most) as f32));
        Self { size, block, channels: channels.into_iter().map(|plane| plane.into_iter().map(scaled).collect()).collect() }
    }

    /// All numbers.
    pub(super) fn values(&self) -> impl Iterator<Item = f32> {
        self.channels.iter().flatten().filter(|value| !value.is_nan()).map(|value| value.to_f32())
    }

    /// Each pixel the mean of square blocks of these.
    pub(super) fn merged(&self, block: u32) -> Self {
        let known = |value: f16| if value.is_nan() { None } else { Some(value.to_f32()) };
        let plane = |plane: &Vec<f16>| means(self.size, block, |at| known(plane[at])).into_iter().map(half_of).collect();
        Self { size: self.size.map(|side| side.div_ceil(block)), block: self.block * block, channels: self.channels.iter().map(plane).collect() }
    }

    /// To that many bits of the mantissa: as they are, or as differences from `first` where that is smaller.
    pub(super) fn pack(&self, bits: u32, first: Option<&Self>) -> Packed {
        let planes = self.integers(bits);
        let alone = squeeze(planes.iter().map(|plane| foretold(plane, self.size[0] as usize)));
        let from_first = first.filter(|first| first.size == self.size).map(|first| {
            let differences =
                planes.iter().zip(first.integers(bits)).map(|(own, first)| own.iter().zip(first).map(|(own, first)| own.wrapping_sub(first)).collect());
            squeeze(differences)
        });
        let from_first = from_first.filter(|difference| difference.len() < alone.len());
        let [width, height] = self.size;
        let (block, channels, is_from_first) = (self.block, self.channels.len(), from_first.is_some());
        Packed { width, height, block, channels, bits, from_first: is_from_first, source: STANDARD.encode(from_first.unwrap_or(alone)) }
    }

    /// An integer for each number. Of a colour the first plane is green, red and blue are told by their differences from it: a change of brightness is in one plane.
    fn integers(&self, bits: u32) -> Vec<Vec<i16>> {
        let planes: Vec<Vec<i16>> = self.channels.iter().map(|plane| plane.iter().map(|value| integer(*value, bits)).collect()).collect();
        let [red, green, blue] = &planes[..] else { return planes };
        let from_green = |plane: &[i16]| plane.iter().zip(green).map(|(own, green)| own.wrapping_sub(*green)).collect();
        vec![green.clone(), from_green(red), from_green(blue)]
    }
}

/// The means of square blocks, each of the values that are known.
pub(super) fn means([width, height]: [u32; 2], block: u32, value: impl Fn(usize) -> Option<f32>) -> Vec<Option<f32>> {
    let columns = width.div_ceil(block);
    let mean = |at: u32| {
        let (x, y) = (at % columns * block, at / columns * block);
        let rows = y..(y + block).min(height);
        let places = rows.flat_map(|row| (x..(x + block).min(width)).map(move |column| row as usize * width as usize + column as usize));
        let (count, sum) = places.filter_map(&value).fold((0u32, 0.0f64), |(count, sum), value| (count + 1, sum + f64::from(value)));
        (count > 0).then(|| (sum / f64::from(count)) as f32)
    };
    (0..columns * height.div_ceil(block)).map(mean).collect()
}

fn half_of(value: Option<f32>) -> f16 {
    value.map_or(f16::NAN, f16::from_f32)
}

fn integer(value: f16, bits: u32) -> i16 {
    if value.is_nan() {
        return NOTHING;
    }
    let dropped = ALL_BITS - bits;
    let most = f16::MAX.to_bits() >> dropped;
    let size = value.to_bits() & 0x7fff;
    let rounded = (((size + ((1 << dropped) >> 1)) >> dropped).min(most)) as i16;
    if value.is_sign_negative() { -rounded } else { rounded }
}

/// How far each number is from what its neighbours tell: the left one plus the upper one less the one between, held between the two (Weinberger and others 2000).
fn foretold(plane: &[i16], width: usize) -> Vec<i16> {
    let at = |index: usize, is_there: bool, back: usize| if is_there { plane[index - back] } else { 0 };
    let difference = |index: usize| {
        let (has_left, has_above) = (!index.is_multiple_of(width), index >= width);
        let [left, above, between] = [at(index, has_left, 1), at(index, has_above, width), at(index, has_left && has_above, width + 1)];
        plane[index].wrapping_sub(foretell(left, above, between))
    };
    (0..plane.len()).map(difference).collect()
}

fn foretell(left: i16, above: i16, between: i16) -> i16 {
    let (low, high) = (left.min(above), left.max(above));
    (i32::from(left) + i32::from(above) - i32::from(between)).clamp(i32::from(low), i32::from(high)) as i16
}

/// The bytes of small numbers of either sign, as zlib.
fn squeeze(planes: impl Iterator<Item = Vec<i16>>) -> Vec<u8> {
    let sign_last = |number: i16| ((number << 1) ^ (number >> 15)) as u16;
    let bytes: Vec<u8> = planes
        .flat_map(|plane| {
            let numbers: Vec<u16> = plane.into_iter().map(sign_last).collect();
            let low: Vec<u8> = numbers.iter().map(|number| *number as u8).collect();
            low.into_iter().chain(numbers.into_iter().map(|number| (number >> 8) as u8))
        })
        .collect();
    compress_to_vec_zlib(&bytes, CompressionLevel::DefaultLevel as u8)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use miniz_oxide::inflate::decompress_to_vec_zlib;

    impl Packed {
        pub(in super::super) fn bits(&self) -> u32 {
            self.bits
        }
    }

    /// The values of each channel as the page's script reads them, in what they were scaled to; not a number where there is none.
    pub(in super::super) fn unpack(packed: &Packed, first: Option<&Packed>) -> Vec<Vec<f32>> {
        let planes = integers(packed, first);
        let dropped = ALL_BITS - packed.bits;
        let value =
            |number: i16| if number == NOTHING { f32::NAN } else { f16::from_bits(number.unsigned_abs() << dropped).to_f32() * f32::from(number.signum()) };
        let values = |plane: Vec<i16>| plane.into_iter().map(value).collect();
        let [green, red, blue] = &planes[..] else { return planes.into_iter().map(values).collect() };
        let sum = |plane: &[i16]| plane.iter().zip(green).map(|(own, green)| own.wrapping_add(*green)).collect();
        [sum(red), green.clone(), sum(blue)].map(values).into()
    }

    fn integers(packed: &Packed, first: Option<&Packed>) -> Vec<Vec<i16>> {
        let bytes = decompress_to_vec_zlib(&STANDARD.decode(&packed.source).unwrap()).unwrap();
        let (width, pixels) = (packed.width as usize, (packed.width * packed.height) as usize);
        let of_first = if packed.from_first { first.map(|first| integers(first, None)) } else { None };
        let plane = |(index, bytes): (usize, &[u8])| {
            let number = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + pixels]]);
            let mut plane: Vec<i16> = (0..pixels).map(|at| ((number(at) >> 1) as i16) ^ -((number(at) & 1) as i16)).collect();
            for at in 0..pixels {
                let known = |is_there: bool, back: usize| if is_there { plane[at - back] } else { 0 };
                let (has_left, has_above) = (at % width > 0, at >= width);
                let told = || foretell(known(has_left, 1), known(has_above, width), known(has_left && has_above, width + 1));
                plane[at] = plane[at].wrapping_add(of_first.as_ref().map_or_else(told, |first| first[index][at]));
            }
            plane
        };
        bytes.chunks(2 * pixels).enumerate().map(plane).collect()
    }

    /// Of 0 to 1; neighbours have nothing in common.
    pub(in super::super) fn noise(at: u32) -> f32 {
        let mixed = (at ^ 0x5bd1_e995).wrapping_mul(0x9e37_79b9);
        ((mixed ^ (mixed >> 15)).wrapping_mul(0x85eb_ca6b) >> 8) as f32 / (1 << 24) as f32
    }

    fn planes(value: impl Fn(u32, u32) -> Option<f32>) -> Planes {
        Planes::new([7, 5], 1, (0..3).map(|channel| (0..35).map(|at| value(channel, at)).collect()).collect(), 0.0)
    }

    #[test]
    fn numbers_come_back_to_the_bits_that_are_kept() {
        let value = |channel: u32, at: u32| (at != 11).then(|| (noise(at + 100 * channel) - 0.1) * (at as f32 - 20.0).exp2());
        for bits in [10, 7, 4] {
            let first = planes(|channel, at| value(channel, at).map(|value| value * 1.01));
            let (packed, first_packed) = (planes(value).pack(bits, Some(&first)), first.pack(bits, None));
            assert!(packed.from_first && !first_packed.from_first);
            for (channel, plane) in unpack(&packed, Some(&first_packed)).iter().enumerate() {
                for (at, found) in plane.iter().enumerate() {
                    let Some(value) = value(channel as u32, at as u32) else {
                        assert!(found.is_nan());
                        continue;
                    };
                    // Half a step of the bits, and half of one of the half float before it; below its smallest normal number, steps are even.
                    let step = 0.5 * (-(bits as f32)).exp2() + 0.5 * (-10.0f32).exp2();
                    assert!((found - value).abs() <= step * value.abs().max((-14.0f32).exp2()), "{bits} {value} {found}");
                }
            }
        }
    }

    #[test]
    fn any_number_is_kept_within_what_a_half_float_holds() {
        let ends = [f32::MAX, -f32::MAX, 65504.0, -0.0, 1e-30];
        for bits in [10, 6] {
            let packed = planes(|_, at| Some(ends[at as usize % 5])).pack(bits, None);
            let dropped = ALL_BITS - bits;
            let most = f16::from_bits(f16::MAX.to_bits() >> dropped << dropped).to_f32();
            assert_eq!(&unpack(&packed, None)[0][..5], [most, -most, most, 0.0, 0.0]);
        }
        // A scale brings any unit into that range.
        let bright = Planes::new([1, 1], 1, vec![vec![Some(3e36)]], -120.0);
        assert!((unpack(&bright.pack(10, None), None)[0][0] / (3e36f64 * (-120f64).exp2()) as f32 - 1.0).abs() < 1e-3);
    }

    #[test]
    fn light_that_changes_little_weighs_little() {
        let size = [256, 256];
        let of =
            |value: &dyn Fn(u32) -> f32| Planes::new(size, 1, vec![(0..size[0] * size[1]).map(|at| Some(value(at))).collect(); 3], 0.0).pack(7, None).weight();
        let (flat, ramp, noisy) = (of(&|_| 0.4), of(&|at| 1.0 + (at % 256) as f32 / 256.0), of(&noise));
        assert!(flat < 2000 && ramp < 4000 && noisy > 60_000, "{flat} {ramp} {noisy}");
    }
}
