//! From linear light to what a screen shows: one fixed curve for all pictures.
//!
//! A colour c, scaled by 2^exposure, becomes `c · (1 − e^(−m)) / m` with m its largest channel: near 0 it is left as it is,
//! bright light runs gently into white paper's 1 and never over it. As all channels are scaled alike, hue and saturation stay; as
//! `1 − e^(−m)` rises, more light never looks darker. The result is encoded as sRGB (IEC 61966-2-1).

use super::layers::{Layers, PictureError};
use std::io::Cursor;

/// The tone-mapped colour, each channel 0..1, linear; negative light counts as none.
pub fn tone_map(colour: [f32; 3], exposure: f32) -> [f32; 3] {
    let colour = colour.map(|channel| (channel * exposure.exp2()).clamp(0.0, f32::MAX));
    let largest = colour[0].max(colour[1]).max(colour[2]);
    if largest == 0.0 { [0.0; 3] } else { colour.map(|channel| channel / largest * -(-largest).exp_m1()) }
}

/// The light that the curve shows as a grey of 0..1.
pub fn light_shown_as(grey: f64) -> f64 {
    -(-grey).ln_1p()
}

/// The sRGB encoding of a linear value in 0..1.
pub fn srgb_encode(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The linear value of an sRGB one in 0..1.
pub fn srgb_decode(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

impl Layers {
    /// A layer as PNG bytes: tone-mapped after a factor of 2^`exposure`, 8 bits a channel, sRGB.
    pub fn to_png(&self, layer: &str, exposure: f32) -> Result<Vec<u8>, PictureError> {
        let image = image::RgbImage::from_raw(self.width, self.height, self.to_srgb(layer, exposure)?).map(image::DynamicImage::from);
        encode(image, image::ImageFormat::Png)
    }

    /// Red, green, blue of each pixel as the PNG file has them, rows from the top.
    pub fn to_srgb(&self, layer: &str, exposure: f32) -> Result<Vec<u8>, PictureError> {
        let byte = |linear: f32| (srgb_encode(linear) * 255.0 + 0.5) as u8;
        Ok(self.pixels(layer)?.flat_map(|colour| tone_map(colour, exposure).map(byte)).collect())
    }

    /// A layer as Radiance HDR bytes: linear, a shared exponent for each pixel, not tone-mapped.
    pub fn to_hdr(&self, layer: &str) -> Result<Vec<u8>, PictureError> {
        let pixels: Vec<f32> = self.pixels(layer)?.flat_map(|colour| colour.map(|channel| channel.max(0.0))).collect();
        let image = image::Rgb32FImage::from_raw(self.width, self.height, pixels).map(image::DynamicImage::from);
        encode(image, image::ImageFormat::Hdr)
    }

    fn pixels(&self, layer: &str) -> Result<impl Iterator<Item = [f32; 3]>, PictureError> {
        self.validate()?;
        let [r, g, b] = self.rgb(layer)?;
        Ok(r.iter().zip(g).zip(b).map(|((&r, &g), &b)| [r, g, b]))
    }
}

fn encode(image: Option<image::DynamicImage>, format: image::ImageFormat) -> Result<Vec<u8>, PictureError> {
    let failed = |reason: String| PictureError::Encoding { reason };
    let image = image.ok_or_else(|| failed("the picture is too large".to_owned()))?;
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).map_err(|error| failed(error.to_string()))?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::super::layers::{Layer, PICTURE};
    use super::*;
    use proptest::prelude::*;

    fn one(colour: [f32; 3]) -> Layers {
        Layers::new(1, 1).with(PICTURE, Layer::interleaved(&["R", "G", "B"], &colour, 3))
    }

    #[test]
    fn the_curve_has_its_closed_values() {
        assert_eq!(tone_map([0.0; 3], 0.0), [0.0; 3]);
        let [one, half, zero] = tone_map([1.0, 0.5, -3.0], 0.0);
        assert!((one - 0.632_120_56).abs() < 1e-6 && (half - one / 2.0).abs() < 1e-6 && zero == 0.0);
        assert_eq!(tone_map([4.0; 3], 0.0), tone_map([1.0; 3], 2.0));
        assert_eq!(tone_map([f32::MAX; 3], 20.0), [1.0; 3]);
    }

    #[test]
    fn srgb_has_its_published_values() {
        assert!((srgb_encode(0.214_041_14) - 0.5).abs() < 1e-6);
        assert!((srgb_decode(0.5) - 0.214_041_14).abs() < 1e-6);
        assert!((srgb_encode(1.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn png_holds_the_curve() {
        let png = image::load_from_memory(&one([1.0, 0.5, 0.0]).to_png(PICTURE, 0.0).unwrap()).unwrap().into_rgb8();
        assert_eq!(png.get_pixel(0, 0).0, [208, 152, 0]);
    }

    #[test]
    fn hdr_keeps_linear_light_to_its_shared_exponent() {
        let back = Layers::read(&one([1000.0, 250.0, 0.5]).to_hdr(PICTURE).unwrap()).unwrap();
        let [r, g, b] = back.rgb(PICTURE).unwrap().map(|plane| plane[0]);
        assert!((r - 1000.0).abs() <= 4.0 && (g - 250.0).abs() <= 4.0 && b.abs() <= 4.0, "{r} {g} {b}");
    }

    proptest! {
        #[test]
        fn the_curve_rises_stays_below_one_and_keeps_hue(colour in prop::array::uniform3(0.0f32..50.0), exposure in -4.0f32..4.0) {
            let less = tone_map(colour, exposure);
            let more = tone_map(colour, exposure + 0.1);
            prop_assert!(less.iter().zip(more).all(|(a, b)| *a <= b + 1e-6 && b <= 1.0));
            prop_assert!((less[0] * colour[1] - less[1] * colour[0]).abs() <= 1e-5 * colour[0].max(colour[1]));
        }
    }
}
