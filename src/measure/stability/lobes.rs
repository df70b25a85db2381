//! The extremes of glossy light: lobes that no order holds, and expansions that ring.

use super::Trouble;
use super::bench::{Bench, Change, Light, RECORDS_SEE_LIGHT, SIZE};
use super::cases::{Seen, expect, expect_refused, told};
use super::rooms::Room;
use crate::math::lobe::Lobe;
use glam::Vec3;

/// Lobes as materials, none of them with a diffuse part: broad ones and those that are sharper than any order.
const MATERIALS: [&str; 4] = [
    "Phong(reflectance: (0, 0, 0), specular: (1, 1, 1), exponent: 0)",
    "Phong(reflectance: (0, 0, 0), specular: (0.8, 0.5, 0.2), exponent: 10000)",
    "Ward(reflectance: (0, 0, 0), specular: (0.5, 0.5, 0.5), alpha: (0.001, 0.001))",
    "MetallicRoughness(base: (1, 0.8, 0.4), metallic: 1, roughness: 0)",
];

/// What ten degrees do not quite hold, and no pass but that of records reflects.
const TOO_SHARP: &str = "Phong(reflectance: (0.2, 0.2, 0.2), specular: (0.7, 0.7, 0.7), exponent: 40)";

/// As many as the highest order takes: fewer see harmonics in what is even.
const SAMPLES: [Change; 1] = [("HemisphereTiles", "resolution", "64")];

/// A tile's samples know the harmonics at their middle alone: of the highest order 64² of them see some in what is even, which sharp lobes make much of.
const ALBEDO: f64 = 0.08;
/// A lobe of a few harmonics in place of all: what it puts elsewhere, it takes from where it was.
const RINGING: f64 = 0.25;

fn fixed(order: usize) -> String {
    format!("Fixed(order: {order})")
}

fn orders(order: &str) -> [Change<'_>; 1] {
    [("LobeCoefficients", "order", order)]
}

/// Records of photons hold what surfaces have reflected, by groups of a few hundred.
fn expect_no_photons(bench: &Bench<'_>) -> Result<(), Trouble> {
    bench.expect_no_pass("PhotonTiles", "a lone lobe under a sky gets no photons but those that come straight from it")
}

/// An even sky is one harmonic, so that what a lobe reflects of it is its albedo, whatever else the order cuts off.
pub(super) fn albedos(bench: &Bench<'_>) -> Seen {
    expect_no_photons(bench)?;
    bench.expect_pass("LobeCoefficients")?;
    let mut farthest = (0.0, String::new());
    for (material, order) in MATERIALS.into_iter().zip([20, 20, 20, 1]) {
        let order = fixed(order);
        let light = bench.light(&Room::open().of(material), &[&RECORDS_SEE_LIGHT, &SAMPLES, &orders(&order)[..]].concat())?;
        let off = light.mean_distance(|cosine| albedo(&light, cosine));
        if off > farthest.0 {
            farthest = (off, format!("{material}, {order}"));
        }
    }
    let (off, worst) = farthest;
    expect(off <= ALBEDO, format!("{off:.1e} off at most: {worst}"))
}

/// Points along both axes of the numbers that directions are drawn by.
const DRAWN: usize = 64;

/// What a lobe reflects of a radiance of 1, by directions drawn from it.
fn albedo(light: &Light, cosine: f32) -> Vec3 {
    let Some(lobe): Option<Lobe> = light.lobe else { return Vec3::ZERO };
    let outgoing = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
    let number = |i: usize| (i as f32 + 0.5) / DRAWN as f32;
    let drawn = (0..DRAWN * DRAWN).map(|i| lobe.sample(outgoing, [number(i / DRAWN), number(i % DRAWN)]));
    let values = drawn.map(|incoming| (incoming, lobe.density(outgoing, incoming))).filter(|(incoming, density)| incoming.z > 0.0 && *density > 0.0);
    values.map(|(incoming, density)| lobe.value(outgoing, incoming) * (incoming.z / density)).sum::<Vec3>() / (DRAWN * DRAWN) as f32
}

/// What cannot be expanded.
pub(super) fn beyond(bench: &Bench<'_>) -> Seen {
    bench.expect_pass("LobeCoefficients")?;
    let room = |material| Room::open().of(material);
    let accepts = |room: &Room, parameter: &str, value: &str| bench.accepts(room, &[("LobeCoefficients", parameter, value)]);
    let dull = room(MATERIALS[0]);
    expect_refused([
        ("an exponent of −1", bench.accepts(&room("Phong(reflectance: (0, 0, 0), specular: (1, 1, 1), exponent: -1)"), &[])),
        ("a slope of 0", bench.accepts(&room("Ward(reflectance: (0, 0, 0), specular: (1, 1, 1), alpha: (0, 0.5))"), &[])),
        ("order 0", accepts(&dull, "order", "Fixed(order: 0)")),
        ("order 21", accepts(&dull, "order", "Fixed(order: 21)")),
        ("an exponent of 40 with too_sharp: Refuse", accepts(&room(TOO_SHARP), "too_sharp", "Refuse")),
    ])
}

/// A bright light beside the dark: what cut off expansions make of it is bounded.
pub(super) fn ringing(bench: &Bench<'_>) -> Seen {
    expect_no_photons(bench)?;
    bench.expect_pass("RadianceProjection")?;
    let room = Room::corner().of(TOO_SHARP);
    let mean = |order: &str| Ok::<_, Trouble>(bench.light(&room, &orders(order))?.mean());
    let (truth, coarse) = (mean(&fixed(20))?, mean(&fixed(4))?);
    let off = (coarse / truth - 1.0).abs();
    expect(off <= RINGING, format!("order 4 is {} off order 20 in the mean, no pixel is negative", told(off)))
}

/// Powers of two change no digit, here as little as in irradiance.
pub(super) fn scales(bench: &Bench<'_>) -> Seen {
    bench.expect_pass("RadianceProjection")?;
    let room = || Room::corner().of("Ward(reflectance: (0.2, 0.2, 0.2), specular: (0.7, 0.7, 0.7), alpha: (0.3, 0.5))");
    let unit = bench.light(&room(), &[])?;
    let [small, large] = [2f64.powi(-20), 2f64.powi(20)];
    for (what, room, factor) in [("lengths of 2²⁰", room().scaled(large), 1.0), ("light of 2⁻²⁰", room().brightened(small), small)] {
        let found = bench.light(&room, &[])?;
        let is_same = found.values.iter().zip(&unit.values).all(|(found, unit)| f64::from(*found) == factor * f64::from(*unit));
        if !is_same {
            return Err(Trouble::Failed(format!("{what} change the picture by {}", told(found.distance(&unit, factor)))));
        }
    }
    Ok(format!("the same bits in {} pixels", SIZE[0] * SIZE[1]))
}
