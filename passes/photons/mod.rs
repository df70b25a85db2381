//! Photons in memory, as `shaders/lib/photon_map.wgsl` reads them.

use crate::contract::{Encoder, Input, Parameter, ParameterKind, PortKind, Refusal, Takes};
use crate::host_struct;
use crate::math::morton::Cube;
use glam::Vec3;
use rayon::prelude::*;

pub mod lookup;

host_struct! {
    /// Light that arrives at a surface.
    pub struct Photon {
        position: [f32; 3],
        /// Length of the way from the last surface [scene units].
        leg: f32,
        /// [W]
        flux: [f32; 3],
        /// See [`ways`].
        ways: u32,
    }
}

host_struct! {
    /// What stands first in the map: then come, of each cell of a table, the number of its first photon, and the photons, sorted by their cells.
    pub struct MapHead {
        corner: [f32; 3],
        cells_per_unit: f32,
        count: u32,
        /// Of the cells that lookups begin with.
        level: u32,
        padding_a: u32,
        padding_b: u32,
    }
}

pub const PHOTON_BYTES: u64 = size_of::<Photon>() as u64;
pub const HEAD_BYTES: u64 = size_of::<MapHead>() as u64;

/// Photons that there would be room for in what stands before them.
pub const SLOTS_BEFORE: u64 = (HEAD_BYTES + 4 * lookup::STARTS as u64).div_ceil(PHOTON_BYTES);

// As shaders/lib/photon_map.wgsl has it.
const _: () = assert!(SLOTS_BEFORE == 32_770);

/// The parameter of estimates from photons that bounds them.
pub const SEARCH_RADIUS: Parameter = Parameter {
    name: "search_radius",
    about: "how far away photons may be, as a share of the scene's extent",
    unit: "",
    kind: ParameterKind::Float { default: 0.05, min: 1e-6, max: 1.0 },
};

/// The input by which estimates from photons learn what else lights surfaces.
pub const DIRECT: Input = Input {
    name: "direct",
    about: "the direct pass, which has to light surfaces from their sources: photons are kept after a reflection",
    accepts: PortKind::DirectLight,
    takes: Takes::AtMostOne,
    changes: false,
};

/// Refuses to leave light out that neither the direct pass nor photons bring.
pub fn expect_direct_light(e: &Encoder<'_>) -> Result<(), Refusal> {
    let needs = e.setting.needs;
    let is_lost = e.direct_light(DIRECT.name).is_some_and(|direct| !direct.lights_from_emitters) && (needs.emissive_triangles > 0 || needs.environment);
    let help = "set `emitters` of the DirectLight to Sampled";
    let refusal = || {
        Refusal::new("plan::light_of_sources", "the direct pass leaves emitters and the sky to others, and photons bring only what they have reflected", help)
    };
    if is_lost { Err(refusal()) } else { Ok(()) }
}

/// Photons by the cells that they are in, each with its share of the light.
pub fn sorted(photons: Vec<Photon>, cube: Cube, emitted: u32) -> Vec<(u32, Photon)> {
    let share = 1.0 / emitted.max(1) as f32;
    let shared = |photon: Photon| Photon { flux: photon.flux.map(|flux| flux * share), ..photon };
    let mut coded: Vec<(u32, Photon)> = photons.into_par_iter().map(|photon| (cube.code(photon.position.into()), shared(photon))).collect();
    coded.par_sort_by_key(|(code, _)| *code);
    coded
}

/// Two unit vectors in four bytes: the normal of the surface, on the side that the photon came from, in the lower two, and the way to where it came from. Each is
/// projected on an octahedron, whose two coordinates have 255 steps.
pub fn ways(normal: Vec3, from: Vec3) -> u32 {
    packed(normal) | packed(from) << 16
}

/// The two of [`ways`].
pub fn unpacked_ways(ways: u32) -> [Vec3; 2] {
    [unpacked(ways), unpacked(ways >> 16)]
}

fn packed(way: Vec3) -> u32 {
    let flat = way / (way.x.abs() + way.y.abs() + way.z.abs()).max(f32::MIN_POSITIVE);
    let folded = if flat.z < 0.0 { [fold(flat.x, flat.y), fold(flat.y, flat.x)] } else { [flat.x, flat.y] };
    let [x, y] = folded.map(|side| (side * 127.0 + 127.5).clamp(0.0, 254.0) as u32);
    x | y << 8
}

fn unpacked(bits: u32) -> Vec3 {
    let [x, y] = [bits, bits >> 8].map(|byte| (byte & 255) as f32 / 127.0 - 1.0);
    let z = 1.0 - x.abs() - y.abs();
    let way = if z < 0.0 { Vec3::new(fold(x, y), fold(y, x), z) } else { Vec3::new(x, y, z) };
    way.normalize()
}

fn fold(own: f32, other: f32) -> f32 {
    (1.0 - other.abs()) * if own < 0.0 { -1.0 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash, unit};

    #[test]
    fn ways_come_back_nearly_as_they_were() {
        for at in 0..10_000 {
            let number = |key: u32| 2.0 * unit(hash(6 * at + key)) - 1.0;
            let [a, b] = [0, 3].map(|first| Vec3::new(number(first), number(first + 1), number(first + 2)).normalize());
            let [c, d] = unpacked_ways(ways(a, b));
            assert!(a.distance(c) < 0.02 && b.distance(d) < 0.02, "{a} {c}, {b} {d}");
        }
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            assert_eq!(unpacked_ways(ways(axis, -axis)), [axis, -axis]);
        }
    }
}
