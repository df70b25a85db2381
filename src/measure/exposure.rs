//! How bright to show a picture.

use super::layers::{Layers, PICTURE, PictureError};
use super::tone::light_shown_as;

/// What the middle of a picture's brightness is shown as: linear, 0..1.
const MIDDLE: f64 = 0.25;

/// The brightest that counts is shown at most so bright: linear, 0..1.
const BRIGHTEST: f64 = 0.7;

/// A sky behind the surfaces is shown at most so bright in its middle: linear, 0..1.
const BRIGHTEST_SKY: f64 = 0.9;

/// Shares of the picture from which on surfaces decide how bright it is shown, and a sky how bright at most. Less of a sky is a window: it may be white.
const SURFACES: f64 = 0.02;
const SKY: f64 = 0.25;

/// Shares of the pixels, the darkest and the brightest, that do not count: holes without light, and lamps.
const LEFT_OUT: [f64; 2] = [0.05, 0.1];

/// The exposure that shows the picture well [stops]: the geometric mean of the luminance of its surfaces, without the darkest and the brightest, comes out as a
/// quarter on [the curve](super::tone::tone_map). The mean of logarithms is that of photographic tone reproduction (Reinhard and others 2002): a lamp or a window
/// in the picture does not make the rest dark. It is less where much is far brighter than that mean, or where the sky behind dark surfaces would turn white.
/// 0 for a black picture.
pub fn automatic_exposure(picture: &Layers) -> Result<f32, PictureError> {
    picture.validate()?;
    let (surfaces, sky) = parts(picture)?;
    let pixels = (surfaces.len() + sky.len()) as f64;
    let is_sky_alone = (surfaces.len() as f64) < SURFACES * pixels;
    let Some([middle, brightest]) = brightness(if is_sky_alone { [surfaces, sky.clone()].concat() } else { surfaces }) else { return Ok(0.0) };
    let shown_as = |grey: f64| light_shown_as(grey).log2();
    let stops = (shown_as(MIDDLE) - middle).min(shown_as(BRIGHTEST) - brightest);
    let of_sky = if sky.len() as f64 >= SKY * pixels { brightness(sky) } else { None };
    Ok(of_sky.map_or(stops, |[middle, _]| stops.min(shown_as(BRIGHTEST_SKY) - middle)) as f32)
}

/// Geometric mean and maximum of what counts, as binary logarithms; None where all is black.
fn brightness(mut luminances: Vec<f64>) -> Option<[f64; 2]> {
    luminances.retain(|luminance| *luminance > 0.0);
    luminances.sort_by(f64::total_cmp);
    let [dark, bright] = LEFT_OUT.map(|share| (share * luminances.len() as f64) as usize);
    let counted = &luminances[dark..luminances.len() - bright];
    let brightest = counted.last()?.log2();
    Some([counted.iter().map(|luminance| luminance.log2()).sum::<f64>() / counted.len() as f64, brightest])
}

/// The luminance of the pixels that see a surface, and of all others; without depths all are taken as surfaces.
fn parts(picture: &Layers) -> Result<(Vec<f64>, Vec<f64>), PictureError> {
    let luminances = picture.luminance(PICTURE)?;
    let Some(depths) = picture.layers.get("depth").and_then(|depth| depth.channels.values().next()) else { return Ok((luminances, Vec::new())) };
    let (surfaces, sky): (Vec<_>, Vec<_>) = luminances.into_iter().zip(depths).partition(|(_, depth)| **depth > 0.0);
    let light = |part: Vec<(f64, &f32)>| part.into_iter().map(|(luminance, _)| luminance).collect();
    Ok((light(surfaces), light(sky)))
}

#[cfg(test)]
mod tests {
    use super::super::layers::Layer;
    use super::*;

    /// Pixels of grey light, and their depths.
    fn picture(pixels: &[(f32, f32)]) -> Layers {
        let light: Vec<f32> = pixels.iter().flat_map(|(light, _)| [*light; 3]).collect();
        let depth = pixels.iter().map(|(_, depth)| *depth).collect();
        Layers::new(pixels.len() as u32, 1).with(PICTURE, Layer::interleaved(&["R", "G", "B"], &light, 3)).with("depth", Layer::value(depth))
    }

    #[test]
    fn one_grey_becomes_middle_grey_whatever_its_unit() {
        for light in [1e-6_f32, 0.3, 7.0, 1e9] {
            let stops = automatic_exposure(&picture(&[(light, 1.0); 50])).unwrap();
            let [shown, ..] = super::super::tone::tone_map([light; 3], stops);
            assert!((f64::from(shown) - MIDDLE).abs() < 1e-4, "{light}: {shown}");
        }
    }

    #[test]
    fn neither_a_lamp_nor_a_window_nor_a_hole_makes_the_room_darker_or_brighter() {
        let room = vec![(0.5, 1.0); 100];
        let plain = automatic_exposure(&picture(&room)).unwrap();
        let mut seen = room.clone();
        seen.extend([(1000.0, 2.0); 8]);
        seen.extend([(50.0, 0.0); 30]);
        seen.extend([(0.0, 1.0); 30]);
        assert!((automatic_exposure(&picture(&seen)).unwrap() - plain).abs() < 1e-3);
    }

    #[test]
    fn what_is_dark_before_a_bright_sky_stays_dark() {
        let mut seen = vec![(0.01, 1.0); 100];
        seen.extend([(1.0, 0.0); 100]);
        let stops = automatic_exposure(&picture(&seen)).unwrap();
        let [sky, ..] = super::super::tone::tone_map([1.0; 3], stops);
        assert!((f64::from(sky) - BRIGHTEST_SKY).abs() < 1e-4, "{sky}");
    }

    #[test]
    fn a_black_picture_is_shown_as_it_is_and_one_of_sky_by_the_sky() {
        assert_eq!(automatic_exposure(&picture(&[(0.0, 1.0); 9])).unwrap(), 0.0);
        assert!(automatic_exposure(&picture(&[(100.0, 0.0); 9])).unwrap() < -6.0);
    }
}
