//! Photons followed and sorted by the host.

use super::Work;
use super::trace::{Path, Tracer};
use crate::contract::Encoder;
use crate::math::{morton::Cube, random::combine};
use crate::passes::photons::{HEAD_BYTES, MapHead, PHOTON_BYTES, Photon, SLOTS_BEFORE, lookup, sorted};
use crate::schedule::*;
use rayon::prelude::*;

/// Photons that are followed before it is asked whether there is room for more.
const BATCH: u32 = 1 << 15;

/// A scene that stands still is lit by the photons of the first frame.
pub(super) fn encode(e: &mut Encoder<'_>, work: Work) {
    let traced = e.variable("traced", true);
    e.remakes(&[], &[traced]);
    let wanted = [work.most, work.capacity, work.legs, work.reflects as u32].into_iter().fold(1, combine) | 1;
    let trace = move |host: &mut dyn HostContext| {
        if host.variable(traced) == wanted {
            return Ok(());
        }
        let scene = host.scene();
        let tracer = Tracer::of(host, work.reflects, work.legs).guided();
        let found = followed(&tracer, work.most, work.capacity);
        let bounds = scene.bounds();
        let cube = Cube::around(bounds.min, bounds.max);
        let sorted = sorted(found.photons, cube, found.emitted);
        let head = MapHead {
            corner: cube.corner.into(),
            cells_per_unit: cube.cells_per_unit,
            count: sorted.len() as u32,
            level: lookup::usual_level(sorted.iter().map(|(code, _)| *code)),
            padding_a: 0,
            padding_b: 0,
        };
        let (codes, photons): (Vec<u32>, Vec<Photon>) = sorted.into_iter().unzip();
        host.write(work.data, 0, bytemuck::bytes_of(&head));
        host.write(work.data, HEAD_BYTES, bytemuck::cast_slice(&lookup::starts(&codes)));
        host.write(work.data, SLOTS_BEFORE * PHOTON_BYTES, bytemuck::cast_slice(&photons));
        work.tell(host, [found.emitted, photons.len() as u32, found.cut_off]);
        host.set(traced, wanted);
        Ok(())
    };
    e.command(Command::Host(Host::new("trace", Vec::new(), vec![work.data], trace).once()));
}

/// Photons of all paths, in the order of the paths.
#[derive(Default)]
struct Traced {
    photons: Vec<Photon>,
    emitted: u32,
    cut_off: u32,
}

/// As many paths as `most`, and as `capacity` photons can be kept of.
fn followed(tracer: &Tracer<'_>, most: u32, capacity: u32) -> Traced {
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
