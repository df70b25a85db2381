//! Photons: light that sources send out, followed from surface to surface, and kept where it arrives.

use crate::contract::{Description, Output, Parameter, ParameterKind, Pass, Port, PortKind, Recorder, Refusal, port};
use crate::host_struct;
use crate::math::morton::Cube;
use crate::scene::sources::Sources;
use glam::Vec3;
use rayon::prelude::*;

pub mod lookup;
mod trace;

use trace::{Path, Tracer};

pub struct PhotonMap;

static DESCRIPTION: Description = Description {
    name: "PhotonMap",
    about: "Photons from all sources of light, followed through any number of reflections and kept where they arrive after the first, in a grid; by the host",
    source: "THESIS 6.2; Jensen 1996",
    parameters: &[
        Parameter {
            name: "photons",
            about: "photons that the sources send out",
            unit: "photons",
            kind: ParameterKind::Integer { default: 500_000, min: 0, max: 10_000_000 },
        },
        Parameter {
            name: "kept",
            about: "most places of photons that are kept; when there are so many, no more are sent out",
            unit: "photons",
            kind: ParameterKind::Integer { default: 1 << 20, min: 1 << 10, max: 1 << 22 },
        },
        Parameter { name: "legs", about: "most surfaces that a photon meets", unit: "", kind: ParameterKind::Integer { default: 64, min: 2, max: 1024 } },
    ],
    inputs: &[],
    outputs: &[Output { name: "map", about: "the photons, sorted by where they are", kind: PortKind::PhotonMap }],
};

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
    /// What stands before the codes.
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

/// Where the codes stand, behind the head and the table of cells.
const CODES_AT: u64 = HEAD_BYTES + 4 * lookup::STARTS as u64;

/// Photons that one core follows before it is given others.
const BATCH: u32 = 4096;

impl Pass for PhotonMap {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn record(&self, r: &mut Recorder<'_>) -> Result<(), Refusal> {
        let [most, capacity, legs] = ["photons", "kept", "legs"].map(|name| r.arguments.integer(name) as u32);
        let codes = r.buffer("codes", CODES_AT + 4 * u64::from(capacity));
        let photons = r.buffer("photons", PHOTON_BYTES * u64::from(capacity));
        let [emitted, count, cut_off] = ["emitted", "count", "cut_off"].map(|name| r.variable(name, false));
        let lobes = r.setting.needs.lobes && !r.setting.needs.by_albedo;
        r.host("trace", &[], &[codes, photons], move |host| {
            let scene = host.scene();
            let tracer = Tracer { scene, bvh: host.bvh(), sources: Sources::new(scene), extent: host.extent(), lobes, legs };
            let traced = traced(&tracer, most, capacity);
            let bounds = scene.bounds();
            let cube = Cube::around(bounds.min, bounds.max);
            let sorted = sorted(traced.photons, cube, traced.emitted);
            let head = MapHead {
                corner: cube.corner.into(),
                cells_per_unit: cube.cells_per_unit,
                count: sorted.len() as u32,
                level: lookup::usual_level(sorted.iter().map(|(code, _)| *code)),
                padding_a: 0,
                padding_b: 0,
            };
            let (own_codes, own_photons): (Vec<u32>, Vec<Photon>) = sorted.into_iter().unzip();
            host.write(codes, 0, bytemuck::bytes_of(&head));
            host.write(codes, HEAD_BYTES, bytemuck::cast_slice(&lookup::starts(&own_codes)));
            host.write(codes, CODES_AT, bytemuck::cast_slice(&own_codes));
            host.write(photons, 0, bytemuck::cast_slice(&own_photons));
            host.set(emitted, traced.emitted);
            host.set(count, own_photons.len() as u32);
            host.set(cut_off, traced.cut_off);
            Ok(())
        });
        r.report_variable("photons_emitted", emitted);
        r.report_variable("photons", count);
        r.report_variable("photons_cut_off", cut_off);
        r.output("map", Port::PhotonMap(port::PhotonMap { codes, photons, count, capacity }));
        Ok(())
    }
}

/// Photons of all paths, in the order of the paths.
#[derive(Default)]
struct Traced {
    photons: Vec<Photon>,
    emitted: u32,
    cut_off: u32,
}

/// As many paths as `most`, and as `capacity` photons can be kept of.
fn traced(tracer: &Tracer<'_>, most: u32, capacity: u32) -> Traced {
    let mut all = Traced::default();
    let many = BATCH * 4 * rayon::current_num_threads() as u32;
    while all.emitted < most {
        let numbers = all.emitted..most.min(all.emitted.saturating_add(many));
        let paths: Vec<Path> = numbers.into_par_iter().with_min_len(256).map(|number| tracer.path(number)).collect();
        for path in paths {
            if all.photons.len() + path.photons.len() > capacity as usize {
                return all;
            }
            all.photons.extend(path.photons);
            all.emitted += 1;
            all.cut_off += u32::from(path.is_cut_off);
        }
    }
    all
}

/// Photons by the cells that they are in, each with its share of the light.
fn sorted(photons: Vec<Photon>, cube: Cube, emitted: u32) -> Vec<(u32, Photon)> {
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
            assert!(a.distance(c) < 0.012 && b.distance(d) < 0.012, "{a} {c}, {b} {d}");
        }
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            assert_eq!(unpacked_ways(ways(axis, -axis)), [axis, -axis]);
        }
    }
}
