//! Photons: light that sources send out, followed from surface to surface, and kept where it arrives.

use super::photons::{HEAD_BYTES, MapHead, PHOTON_BYTES, Photon, SLOTS_BEFORE, lookup, sorted};
use crate::contract::{Description, Encoder, Output, Parameter, ParameterKind, Pass, Port, PortKind, Refusal, port};
use crate::math::morton::Cube;
use crate::scene::sources::Sources;
use rayon::prelude::*;

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
            kind: ParameterKind::Integer { default: 1 << 20, min: 1 << 10, max: (1 << 22) - (1 << 16) },
        },
        Parameter { name: "legs", about: "most surfaces that a photon meets", unit: "", kind: ParameterKind::Integer { default: 64, min: 2, max: 1024 } },
    ],
    inputs: &[],
    outputs: &[Output { name: "map", about: "the photons, sorted by where they are", kind: PortKind::PhotonMap }],
};

/// Photons that are followed before it is asked whether there is room for more.
const BATCH: u32 = 1 << 15;

impl Pass for PhotonMap {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let [most, capacity, legs] = ["photons", "kept", "legs"].map(|name| e.arguments.integer(name) as u32);
        let data = e.buffer("data", PHOTON_BYTES * (SLOTS_BEFORE + u64::from(capacity)));
        let [emitted, count, slots, cut_off] = ["emitted", "count", "slots", "cut_off"].map(|name| e.variable(name, false));
        let lobes = e.setting.needs.lobes && !e.setting.needs.by_albedo;
        e.host("trace", &[], &[data], move |host| {
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
            let (codes, photons): (Vec<u32>, Vec<Photon>) = sorted.into_iter().unzip();
            host.write(data, 0, bytemuck::bytes_of(&head));
            host.write(data, HEAD_BYTES, bytemuck::cast_slice(&lookup::starts(&codes)));
            host.write(data, SLOTS_BEFORE * PHOTON_BYTES, bytemuck::cast_slice(&photons));
            host.set(emitted, traced.emitted);
            host.set(count, photons.len() as u32);
            host.set(slots, SLOTS_BEFORE as u32 + photons.len() as u32);
            host.set(cut_off, traced.cut_off);
            Ok(())
        });
        e.report_variable("photons_emitted", emitted);
        e.report_variable("photons", count);
        e.report_variable("photons_cut_off", cut_off);
        e.output("map", Port::PhotonMap(port::PhotonMap { data, slots }));
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
    while all.emitted < most {
        let numbers = all.emitted..most.min(all.emitted.saturating_add(BATCH));
        let paths: Vec<Path> = numbers.into_par_iter().map(|number| tracer.path(number)).collect();
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
