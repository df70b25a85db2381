//! How bright to show a picture.

use super::layers::{Layers, PICTURE, PictureError};

/// What the middle of a picture's brightness is shown as: linear, 0..1.
const MIDDLE: f64 = 0.25;

/// The brightest that counts is shown at most so bright: linear, 0..1.
const BRIGHTEST: f64 = 0.7;

/// Surfaces decide how bright a picture is shown where they fill at least this share of it; else all of it does.
const SURFACES: f64 = 0.02;

/// Shares of the pixels, the darkest and the brightest, that do not count: holes without light, and lamps.
const LEFT_OUT: [f64; 2] = [0.05, 0.1];

/// The exposure that shows the picture well [stops]: the geometric mean of the luminance of its surfaces, without the darkest and the brightest, comes out as middle
/// grey on [the curve](super::tone::tone_map). The mean of logarithms is that of photographic tone reproduction (Reinhard and others 2002): a lamp or a bright sky
/// in the picture does not make the rest dark. Where much is far brighter than that mean it is less, so that it keeps its colours. 0 for a black picture.
pub fn automatic_exposure(picture: &Layers) -> Result<f32, PictureError> {
    picture.validate()?;
    let luminances = picture.luminance(PICTURE)?;
    let of_surfaces = surfaces(picture, &luminances).filter(|found| found.len() as f64 >= SURFACES * luminances.len() as f64);
    let mut counted = of_surfaces.unwrap_or(luminances);
    counted.retain(|luminance| *luminance > 0.0);
    counted.sort_by(f64::total_cmp);
    let [dark, bright] = LEFT_OUT.map(|share| (share * counted.len() as f64) as usize);
    let counted = &counted[dark..counted.len() - bright];
    if counted.is_empty() {
        return Ok(0.0);
    }
    let mean = counted.iter().map(|luminance| luminance.log2()).sum::<f64>() / counted.len() as f64;
    let brightest = counted[counted.len() - 1].log2();
    // −ln(1 − g) is what the curve maps to g.
    let shown_as = |grey: f64| (-(-grey).ln_1p()).log2();
    Ok((shown_as(MIDDLE) - mean).min(shown_as(BRIGHTEST) - brightest) as f32)
}

/// The luminance of the pixels that see a surface, where the picture tells which do.
fn surfaces(picture: &Layers, luminances: &[f64]) -> Option<Vec<f64>> {
    let depth = picture.layers.get("depth")?.channels.values().next()?;
    Some(luminances.iter().zip(depth).filter(|(_, depth)| **depth > 0.0).map(|(luminance, _)| *luminance).collect())
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
    fn neither_a_lamp_nor_the_sky_nor_a_hole_makes_the_room_darker_or_brighter() {
        let room = vec![(0.5, 1.0); 100];
        let plain = automatic_exposure(&picture(&room)).unwrap();
        let mut seen = room.clone();
        seen.extend([(1000.0, 2.0); 8]);
        seen.extend([(50.0, 0.0); 100]);
        seen.extend([(0.0, 1.0); 30]);
        assert!((automatic_exposure(&picture(&seen)).unwrap() - plain).abs() < 1e-3);
    }

    #[test]
    fn a_black_picture_is_shown_as_it_is_and_one_of_sky_by_the_sky() {
        assert_eq!(automatic_exposure(&picture(&[(0.0, 1.0); 9])).unwrap(), 0.0);
        assert!(automatic_exposure(&picture(&[(100.0, 0.0); 9])).unwrap() < -6.0);
    }
}
