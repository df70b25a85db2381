//! What a viewer sees: ꟻLIP of the pictures that two files name so.

use super::found::Found;
use super::interval::Interval;
use super::resampling::{Resampling, Stream};
use super::samples::{mean, own_variances};
use super::{MetricsError, Selected};
use crate::math::colour::luminance;
use crate::measure::flip::{flip_map, hdr_flip_map};
use crate::measure::layers::{Layers, PICTURE, PictureError};
use crate::measure::tone::{light_shown_as, tone_map};
use glam::{DVec3, Vec3};

/// The linear value, on the screen, of the reference's mean luminance when pictures are tone-mapped for `flip`.
const MIDDLE_GREY: f64 = 0.18;

/// ꟻLIP and HDR-ꟻLIP of the layer [`PICTURE`]; none where a file does not name one, or the reference does not hold every pixel.
pub(super) fn flips(test: &Layers, reference: &Layers) -> Result<[Found; 2], MetricsError> {
    let none = || Found { value: None, interval: None, draws: Vec::new() };
    // A strided reference of a strided picture has no neighbours to look at.
    let is_strided = [test, reference].iter().any(|picture| picture.attributes.get("stride").is_some_and(|stride| stride != "1"));
    if is_strided || [test.width, test.height] != [reference.width, reference.height] || ![test, reference].into_iter().all(Layers::names_picture) {
        return Ok([none(), none()]);
    }
    let (light, truth) = (colours(test, "tested picture")?, colours(reference, "reference")?);
    let Some(exposure) = exposure_for(&truth) else { return Ok([none(), none()]) };
    let noisy = noisy(reference, &truth)?;
    let size = [reference.width, reference.height];
    let resampling = Resampling::of(0..truth.len(), size);
    let width = size[0] as usize;
    let shown = |colours: &[DVec3]| -> Vec<DVec3> { colours.iter().map(|colour| shown(*colour, exposure)).collect() };
    let screen = |test: &[DVec3]| Some(flip_map(&shown(test), &shown(&truth), width));
    let range = |test: &[DVec3]| hdr_flip_map(test, &truth, width);
    let found = |map: &dyn Fn(&[DVec3]) -> Option<Vec<f64>>| {
        map(&light).map_or_else(none, |errors| of_map(&errors, noisy.as_deref().and_then(map), resampling.as_ref()))
    };
    Ok([found(&screen), found(&range)])
}

/// The mean of a map of errors; `noise` is the map of a picture that differs from the reference by its noise alone.
fn of_map(errors: &[f64], noise: Option<Vec<f64>>, resampling: Option<&Resampling>) -> Found {
    let draws = resampling.map_or(Vec::new(), |resampling| {
        resampling.of_sums(errors.iter().enumerate().map(|(at, error)| (at, [*error, 1.0])), |[errors, count]| errors / count)
    });
    let noise_floor = noise.and_then(|noise| mean(noise.into_iter()));
    let interval = resampling.and_then(|resampling| resampling.middle(&draws)).map(|[low, high]| Interval {
        low: low.max(0.0),
        high,
        noise_floor,
        below_noise: noise_floor.is_some_and(|floor| floor > 0.0 && low <= floor),
    });
    Found { value: mean(errors.iter().copied()), interval, draws }
}

/// The reference's picture with as much noise again, its own in each pixel; none where its variance is not known.
fn noisy(reference: &Layers, truth: &[DVec3]) -> Result<Option<Vec<DVec3>>, MetricsError> {
    let Some(variance) = own_variances(Selected { picture: reference, layer: PICTURE })? else { return Ok(None) };
    let mut stream = Stream(2);
    // Only luminance's is known: the noise of a pixel leaves its hue.
    let mut scale = |light: f64, variance: f64| (1.0 + stream.normal() * variance.sqrt() / light.max(f64::MIN_POSITIVE)).max(0.0);
    Ok(Some(
        truth.iter().zip(variance).map(|(colour, variance)| if variance > 0.0 { *colour * scale(luminance(*colour), variance) } else { *colour }).collect(),
    ))
}

fn colours(picture: &Layers, which: &'static str) -> Result<Vec<DVec3>, MetricsError> {
    let [r, g, b] = picture.rgb(PICTURE).map_err(|error| MetricsError::Picture { which, error })?;
    Ok((0..r.len()).map(|i| Vec3::new(r[i], g[i], b[i]).as_dvec3()).collect())
}

fn shown(colour: DVec3, exposure: f32) -> DVec3 {
    DVec3::from_array(tone_map(colour.as_vec3().to_array(), exposure).map(f64::from))
}

/// None for a black picture.
fn exposure_for(colours: &[DVec3]) -> Option<f32> {
    mean(colours.iter().map(|colour| luminance(*colour))).filter(|&mean| mean > 0.0).map(exposure_of)
}

/// The exposure that brings a mean luminance to middle grey [stops].
fn exposure_of(mean: f64) -> f32 {
    (light_shown_as(MIDDLE_GREY) / mean).log2() as f32
}

/// The exposure that shows a layer well [stops]: its mean luminance on middle grey, as for `flip`; 0 for a black one.
pub fn fair_exposure(picture: &Layers, layer: &str) -> Result<f32, PictureError> {
    picture.validate()?;
    let mean = mean(picture.luminance(layer)?.into_iter()).filter(|&mean| mean > 0.0);
    Ok(mean.map_or(0.0, exposure_of))
}
