//! What a viewer sees: ꟻLIP of the pictures that two files name so.

use super::found::Found;
use super::interval::{Interval, middle};
use super::resampling::{Resampling, Stream};
use super::samples::{mean, own_variances};
use super::{ErrorMap, MetricsError, Selected};
use crate::math::colour::luminance;
use crate::math::windows::{SIDE, Windows};
use crate::measure::flip::{REACH, exposures, flip_map, hdr_flip_map};
use crate::measure::layers::{Layers, PICTURE, PictureError};
use crate::measure::tone::{light_shown_as, tone_map};
use glam::{DVec3, Vec3};

/// The linear value, on the screen, of the reference's mean luminance when pictures are tone-mapped for `flip`.
const MIDDLE_GREY: f64 = 0.18;

/// ꟻLIP and HDR-ꟻLIP of the layer [`PICTURE`], in the whole or in windows; none where [`Viewed::of`] is.
pub(super) fn flips(test: &Layers, reference: &Layers, windows: Option<&Windows>) -> Result<[Found; 2], MetricsError> {
    let Some(viewed) = Viewed::of(test, reference, windows)? else { return Ok([(); 2].map(|()| Found { value: None, interval: None, draws: Vec::new() })) };
    let noisy = noisy(reference, &viewed.truth)?;
    let places: Vec<usize> = viewed.places().collect();
    let resampling = Resampling::of(places.iter().copied(), viewed.size);
    let shown = |colours: &[DVec3]| -> Vec<DVec3> { colours.iter().map(|colour| shown(*colour, viewed.exposure)).collect() };
    let screen = |test: &[DVec3], truth: &[DVec3], width: usize| flip_map(&shown(test), &shown(truth), width);
    let range = |test: &[DVec3], truth: &[DVec3], width: usize| hdr_flip_map(test, truth, width, &viewed.stops);
    let found = |map: &Map<'_>| {
        let noise = noisy.as_deref().map(|noisy| viewed.errors(noisy, map));
        of_map(&places, &viewed.errors(&viewed.light, map), noise, resampling.as_ref())
    };
    Ok([found(&screen), found(&range)])
}

/// HDR-ꟻLIP of each pixel of the layer [`PICTURE`]; none where `Viewed::of` is.
pub fn hdr_flips(test: &Layers, reference: &Layers) -> Result<Option<ErrorMap>, MetricsError> {
    let windows = reference.windows().map_err(|error| MetricsError::Picture { which: "reference", error })?;
    let Some(viewed) = Viewed::of(test, reference, windows.as_ref())? else { return Ok(None) };
    let errors = viewed.errors(&viewed.light, &|test, truth, width| hdr_flip_map(test, truth, width, &viewed.stops));
    let mut map = ErrorMap { size: viewed.size, errors: vec![None; viewed.truth.len()] };
    viewed.places().zip(errors).for_each(|(at, error)| map.errors[at] = Some(error as f32));
    Ok(Some(map))
}

/// Two pictures as a viewer flips between them.
struct Viewed {
    size: [u32; 2],
    light: Vec<DVec3>,
    truth: Vec<DVec3>,
    looks: Vec<Look>,
    /// For ꟻLIP [stops].
    exposure: f32,
    /// All that HDR-ꟻLIP looks at.
    stops: Vec<f64>,
}

impl Viewed {
    /// None where a file does not name a picture, the reference does not hold every pixel or is black.
    fn of(test: &Layers, reference: &Layers, windows: Option<&Windows>) -> Result<Option<Self>, MetricsError> {
        let size = [reference.width, reference.height];
        // A strided reference of a strided picture has no neighbours to look at.
        let is_strided = [test, reference].iter().any(|picture| !picture.is_dense());
        if is_strided || [test.width, test.height] != size || ![test, reference].into_iter().all(Layers::names_picture) {
            return Ok(None);
        }
        let (light, truth) = (colours(test, "tested picture")?, colours(reference, "reference")?);
        let looks = Look::all(size, windows);
        let seen: Vec<DVec3> = looks.iter().flat_map(|look| look.part(&truth, size[0])).collect();
        let exposed = exposure_for(&seen).zip(exposures(&seen));
        Ok(exposed.map(|(exposure, stops)| Self { size, light, truth, looks, exposure, stops }))
    }

    /// The pixels that count.
    fn places(&self) -> impl Iterator<Item = usize> {
        self.looks.iter().flat_map(|look| look.pixels(look.margin, self.size[0]))
    }

    /// The error of each of [`Self::places`].
    fn errors(&self, light: &[DVec3], map: &Map<'_>) -> Vec<f64> {
        let width = self.size[0];
        let of = |look: &Look| look.inner(&map(&look.part(light, width), &look.part(&self.truth, width), look.size[0] as usize));
        self.looks.iter().flat_map(of).collect()
    }
}

/// Errors of pixels, from two pictures of a width.
type Map<'m> = dyn Fn(&[DVec3], &[DVec3], usize) -> Vec<f64> + 'm;

/// A part of a picture that is looked at by itself. What lies within `margin` of its border does not count: filters reach beyond.
struct Look {
    corner: [u32; 2],
    size: [u32; 2],
    margin: u32,
}

impl Look {
    /// The whole picture, at whose border filters repeat it; or each window.
    fn all(size: [u32; 2], windows: Option<&Windows>) -> Vec<Self> {
        match windows {
            None => vec![Self { corner: [0, 0], size, margin: 0 }],
            Some(windows) => windows.corners().iter().map(|corner| Self { corner: *corner, size: [SIDE; 2], margin: REACH }).collect(),
        }
    }

    /// Its pixels `margin` or more off the border, by their places in a picture of that width.
    fn pixels(&self, margin: u32, width: u32) -> impl Iterator<Item = usize> + use<> {
        let ([x, y], [columns, rows]) = (self.corner, self.size);
        (y + margin..y + rows - margin).flat_map(move |row| (x + margin..x + columns - margin).map(move |column| (row * width + column) as usize))
    }

    /// Its pixels out of a picture of that width.
    fn part(&self, picture: &[DVec3], width: u32) -> Vec<DVec3> {
        self.pixels(0, width).map(|at| picture[at]).collect()
    }

    /// What counts of a map of it.
    fn inner(&self, map: &[f64]) -> Vec<f64> {
        Self { corner: [0, 0], ..*self }.pixels(self.margin, self.size[0]).map(|at| map[at]).collect()
    }
}

/// The mean of a map of errors at some places; `noise` is the map of a picture that differs from the reference by its noise alone.
fn of_map(places: &[usize], errors: &[f64], noise: Option<Vec<f64>>, resampling: Option<&Resampling>) -> Found {
    let draws = resampling.map_or(Vec::new(), |resampling| {
        resampling.of_sums(places.iter().zip(errors).map(|(at, error)| (*at, [*error, 1.0])), |[errors, count]| errors / count)
    });
    let noise_floor = noise.and_then(|noise| mean(noise.into_iter()));
    let interval = middle(&draws).map(|[low, high]| Interval {
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
    let held = picture.windows()?.map(|windows| windows.mask([picture.width, picture.height], 0));
    let luminance = picture.luminance(layer)?.into_iter().enumerate();
    let luminance: Vec<f64> = luminance.filter(|(at, _)| held.as_ref().is_none_or(|held| held[*at])).map(|(_, luminance)| luminance).collect();
    let mean = mean(luminance.into_iter()).filter(|&mean| mean > 0.0);
    Ok(mean.map_or(0.0, exposure_of))
}
