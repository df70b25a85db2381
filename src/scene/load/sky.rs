//! Skies made by rule, baked to latitude-longitude images when a scene is loaded.

use crate::scene::model::Environment;
use glam::{DMat3, DVec3, dvec3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Texels of a baked sky: 0.7° a side. The number of rows is even, so that the horizon falls between two of them.
const SIZE: [u32; 2] = [512, 256];

/// Radiance that stands for 1 kcd/m² where a document does not say: a clear sky by day is then about 1, and 10 klx are an irradiance of 1.
pub(super) const PER_KCD: f64 = 0.1;

/// How much the ground below the horizon reflects where a document does not say.
pub(super) const GROUND: DVec3 = DVec3::splat(0.2);

/// The turbidities for which the daylight model was fitted: from very clear air to haze.
pub(super) const TURBIDITY: std::ops::RangeInclusive<f64> = 2.0..=10.0;

/// The turbidity where nobody says: clear air.
pub(super) const USUAL_TURBIDITY: f64 = 3.0;

/// Illuminance of the sun outside of the atmosphere [klx], and its chromaticities x and y.
const SUN: [f64; 3] = [133.0, 0.3233, 0.3326];

/// Wavelengths that stand for red, green and blue light on its way through the air [µm].
const WAVELENGTHS: DVec3 = dvec3(0.610, 0.550, 0.465);

/// Five coefficients of Perez' distribution, A to E.
type Perez = [f64; 5];

// Preetham, Shirley and Smits 1999, "A practical analytic model for daylight", appendix A.2.
/// Coefficients as lines in turbidity, slope and value at 0: of luminance Y and of the chromaticities x and y.
const DISTRIBUTION: [[[f64; 2]; 5]; 3] = [
    [[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]],
    [[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]],
    [[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]],
];

/// Chromaticities x and y of the zenith: rows by falling powers of turbidity, columns by falling powers of the sun's angle from the zenith.
const ZENITH_CHROMATICITY: [[[f64; 4]; 3]; 2] = [
    [[0.00166, -0.00375, 0.00209, 0.0], [-0.02903, 0.06377, -0.03202, 0.00394], [0.11693, -0.21196, 0.06052, 0.25886]],
    [[0.00275, -0.00610, 0.00317, 0.0], [-0.04214, 0.08970, -0.04153, 0.00516], [0.15346, -0.26756, 0.06670, 0.26688]],
];

/// From CIE XYZ to linear Rec. 709, by columns.
const TO_RGB: DMat3 =
    DMat3::from_cols(dvec3(3.240_454, -0.969_266, 0.055_643), dvec3(-1.537_139, 1.876_011, -0.204_026), dvec3(-0.498_531, 0.041_556, 1.057_225));

/// A clear sky without the sun's disc, after Preetham, Shirley and Smits 1999.
#[derive(Debug, Clone, Copy)]
pub(super) struct Clear {
    /// Unit vector to the sun.
    sun: DVec3,
    /// The sun's angle from the zenith [radians].
    sun_angle: f64,
    distributions: [Perez; 3],
    /// Luminance [kcd/m²] and chromaticities of the zenith.
    zenith: [f64; 3],
}

impl Clear {
    /// The sun stands `azimuth` from −z towards +x and `elevation`, 0 to π/2, over the horizon [radians]; turbidity is in [`TURBIDITY`].
    pub fn new(azimuth: f64, elevation: f64, turbidity: f64) -> Self {
        let sun = toward_sun(azimuth, elevation);
        let sun_angle = FRAC_PI_2 - elevation;
        let distributions = DISTRIBUTION.map(|lines| lines.map(|[slope, constant]| slope * turbidity + constant));
        let [x, y] = ZENITH_CHROMATICITY.map(|rows| polynomial(&rows.map(|row| polynomial(&row, sun_angle)), turbidity));
        Self { sun, sun_angle, distributions, zenith: [zenith_luminance(turbidity, sun_angle), x, y] }
    }

    /// Luminance [kcd/m²] as linear Rec. 709, from a unit direction above the horizon; colours outside of it are moved to its edge.
    pub fn radiance(&self, direction: DVec3) -> DVec3 {
        let around_sun = direction.dot(self.sun).clamp(-1.0, 1.0).acos();
        let value = |i: usize| {
            let distribution = &self.distributions[i];
            self.zenith[i] * perez(distribution, direction.y, around_sun) / perez(distribution, 1.0, self.sun_angle)
        };
        to_rgb(value(0), value(1), value(2)).max(DVec3::ZERO)
    }
}

/// Unit vector to a sun that stands `azimuth` from −z towards +x and `elevation` over the horizon [radians].
pub(super) fn toward_sun(azimuth: f64, elevation: f64) -> DVec3 {
    dvec3(elevation.cos() * azimuth.sin(), elevation.sin(), -elevation.cos() * azimuth.cos())
}

/// Illuminance of a plane that faces the sun [klx], as linear Rec. 709: what is left of it after the scattering by air and by haze. `elevation` is 0 to π/2
/// [radians]. Preetham, Shirley and Smits 1999, appendix A.1, without absorption by gases.
pub(super) fn sun(elevation: f64, turbidity: f64) -> DVec3 {
    let angle = FRAC_PI_2 - elevation;
    // Thickness of the air along the way, of that straight up: Kasten's formula.
    let mass = 1.0 / (angle.cos() + 0.15 * (93.885 - angle.to_degrees()).powf(-1.253));
    let haze = 0.046_08 * turbidity - 0.045_86;
    let left = |wavelength: f64| (-mass * (0.008_735 * wavelength.powf(-4.08) + haze * wavelength.powf(-1.3))).exp();
    to_rgb(SUN[0], SUN[1], SUN[2]) * dvec3(left(WAVELENGTHS.x), left(WAVELENGTHS.y), left(WAVELENGTHS.z))
}

/// Luminance of the zenith [kcd/m²].
fn zenith_luminance(turbidity: f64, sun_angle: f64) -> f64 {
    let chi = (4.0 / 9.0 - turbidity / 120.0) * (PI - 2.0 * sun_angle);
    (4.0453 * turbidity - 4.9710) * chi.tan() - 0.2155 * turbidity + 2.4192
}

/// Perez' distribution by the cosine of the angle from the zenith, above 0, and the angle from the sun [radians].
fn perez(&[a, b, c, d, e]: &Perez, cosine: f64, around_sun: f64) -> f64 {
    (1.0 + a * (b / cosine).exp()) * (1.0 + c * (d * around_sun).exp() + e * around_sun.cos().powi(2))
}

/// Coefficients by falling powers.
fn polynomial(coefficients: &[f64], at: f64) -> f64 {
    coefficients.iter().fold(0.0, |sum, coefficient| sum * at + coefficient)
}

fn to_rgb(luminance: f64, x: f64, y: f64) -> DVec3 {
    TO_RGB * dvec3(x, y, 1.0 - x - y) * (luminance / y)
}

/// The CIE standard overcast sky by its radiance at the zenith: three times as bright there as at the horizon.
pub(super) fn overcast(zenith: DVec3, direction: DVec3) -> DVec3 {
    zenith * (1.0 + 2.0 * direction.y) / 3.0
}

/// The image of a sky over a ground that reflects `ground` of the sky's irradiance, evenly in all directions.
pub(super) fn bake(ground: DVec3, sky: impl Fn(DVec3) -> DVec3) -> Environment {
    bake_with_sun(ground, DVec3::ZERO, sky)
}

/// The same over a ground that gets `sun` besides: the irradiance of the level ground by a sun that is not in the image.
pub(super) fn bake_with_sun(ground: DVec3, sun: DVec3, sky: impl Fn(DVec3) -> DVec3) -> Environment {
    let [width, height] = SIZE;
    let rows: Vec<Vec<DVec3>> = (0..height / 2).map(|row| (0..width).map(|column| sky(direction(column, row))).collect()).collect();
    let below = ground * (horizontal_irradiance(&rows) + sun) / PI;
    let above = rows.iter().flatten().map(|radiance| radiance.as_vec3());
    let texels = above.chain(std::iter::repeat_n(below.as_vec3(), (width * (height - height / 2)) as usize)).collect();
    Environment::LatLong { width, height, texels }
}

/// Unit direction of a texel's centre.
fn direction(column: u32, row: u32) -> DVec3 {
    let azimuth = TAU * ((f64::from(column) + 0.5) / f64::from(SIZE[0]) - 0.5);
    let angle = PI * (f64::from(row) + 0.5) / f64::from(SIZE[1]);
    dvec3(angle.sin() * azimuth.sin(), angle.cos(), -angle.sin() * azimuth.cos())
}

/// What the upper rows of an image send to a plane that faces up: the cosine integrated over each row, the radiance taken as constant there.
fn horizontal_irradiance(rows: &[Vec<DVec3>]) -> DVec3 {
    let step = PI / f64::from(SIZE[1]);
    let squared_sine = |row: usize| (step * row as f64).sin().powi(2);
    let mean = |row: &[DVec3]| row.iter().sum::<DVec3>() / row.len() as f64;
    rows.iter().enumerate().map(|(i, row)| mean(row) * PI * (squared_sine(i + 1) - squared_sine(i))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    const ELEVATIONS: [f64; 6] = [0.0, 1.0, 10.0, 45.0, 80.0, 90.0];
    const TURBIDITIES: [f64; 4] = [2.0, 3.0, 6.0, 10.0];

    fn texels(environment: &Environment) -> &[Vec3] {
        let Environment::LatLong { width: 512, height: 256, texels } = environment else { panic!("{environment:?}") };
        texels
    }

    fn luminance(rgb: DVec3) -> f64 {
        rgb.dot(dvec3(0.212_67, 0.715_15, 0.072_17))
    }

    #[test]
    fn overcast_skies_send_seven_ninths_of_what_the_zenith_would() {
        let zenith = dvec3(3.0, 2.0, 1.0);
        let baked = bake(DVec3::splat(0.5), |direction| overcast(zenith, direction));
        let expected = (zenith * 7.0 / 9.0 * 0.5).as_vec3();
        // Half of the irradiance (7/9) π Lz, over π.
        assert!((texels(&baked)[200 * 512 + 7] / expected - 1.0).abs().max_element() < 1e-4);
        assert!((baked.radiance(Vec3::Y) / zenith.as_vec3() - 1.0).abs().max_element() < 1e-4);
        let slanted = Vec3::new(0.0, 0.5, 0.75_f32.sqrt());
        assert!((baked.radiance(slanted) / (zenith.as_vec3() * 2.0 / 3.0) - 1.0).abs().max_element() < 1e-4);
    }

    #[test]
    fn clear_skies_are_finite_and_not_negative_whatever_the_air() {
        for (elevation, turbidity) in ELEVATIONS.iter().flat_map(|&e| TURBIDITIES.map(|t| (e, t))) {
            let clear = Clear::new(0.3, f64::to_radians(elevation), turbidity);
            let baked = bake(GROUND, |direction| clear.radiance(direction));
            assert!(texels(&baked).iter().all(|texel| texel.is_finite() && texel.cmpge(Vec3::ZERO).all()), "{elevation}°, turbidity {turbidity}");
            assert!(texels(&baked).iter().all(|texel| texel.max_element() > 0.0), "{elevation}°, turbidity {turbidity}");
        }
    }

    #[test]
    fn the_zenith_is_as_bright_as_its_formula_says() {
        // The tangent of 0 vanishes for a sun on the horizon.
        assert!((zenith_luminance(2.0, FRAC_PI_2) - (2.4192 - 0.431)).abs() < 1e-12);
        for (elevation, turbidity) in [(0.0, 2.0), (30.0, 3.0), (60.0, 6.0), (90.0, 10.0)] {
            let clear = Clear::new(1.0, f64::to_radians(elevation), turbidity);
            let expected = zenith_luminance(turbidity, FRAC_PI_2 - f64::to_radians(elevation));
            let made = luminance(clear.radiance(DVec3::Y));
            assert!((made / expected - 1.0).abs() < 1e-4, "{elevation}°, turbidity {turbidity}: {made} is not {expected}");
        }
    }

    #[test]
    fn skies_are_brightest_next_to_the_sun_and_blue_away_from_it() {
        for (azimuth, elevation) in [(0.0, 30.0), (90.0, 45.0), (-120.0, 70.0), (200.0, 20.0)] {
            let clear = Clear::new(f64::to_radians(azimuth), f64::to_radians(elevation), 3.0);
            let baked = bake(GROUND, |direction| clear.radiance(direction));
            let brightest = (0..256 * 512_u32).max_by(|&a, &b| {
                let value = |i: u32| luminance(texels(&baked)[i as usize].as_dvec3());
                value(a).total_cmp(&value(b))
            });
            let seen = brightest.map(|i| direction(i % 512, i / 512));
            assert!(seen.is_some_and(|seen| seen.dot(clear.sun) > 0.9999), "{azimuth}°, {elevation}°: {seen:?}");
            let away = clear.radiance(dvec3(-clear.sun.x, clear.sun.y.max(0.3), -clear.sun.z).normalize());
            assert!(away.z > 1.2 * away.x, "{azimuth}°, {elevation}°: {away}");
        }
    }

    #[test]
    fn the_sun_is_as_bright_as_it_is_measured() {
        // 100 klx at noon, some 20 klx five degrees over the horizon, and redder there.
        let [high, low] = [60.0, 5.0].map(|elevation: f64| sun(elevation.to_radians(), 2.5));
        assert!((90.0..110.0).contains(&luminance(high)), "{high}");
        assert!((8.0..30.0).contains(&luminance(low)), "{low}");
        assert!(low.x / low.z > 2.0 * high.x / high.z, "{low}, {high}");
        assert!(sun(0.0, 10.0).is_finite() && sun(0.0, 10.0).cmpge(DVec3::ZERO).all());
    }

    #[test]
    fn the_ground_fades_into_the_sky_over_a_texel() {
        let baked = bake(DVec3::ZERO, |_| DVec3::ONE);
        let texel = PI as f32 / 256.0;
        let seen = |texels: f32| baked.radiance(Vec3::new(0.0, (texels * texel).sin(), -(texels * texel).cos()));
        assert_eq!((seen(0.51), seen(-0.51)), (Vec3::ONE, Vec3::ZERO));
    }
}
