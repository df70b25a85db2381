//! Photons followed and sorted by the device: `shaders/photon_map/trace.wgsl`, `shaders/photon_map/sort.wgsl`.

use super::{Reflects, Work, guide, trace::Tracer};
use crate::contract::{Encoder, encoder::scene_constants};
use crate::math::morton::{BITS, Cube};
use crate::passes::photons::{PHOTON_BYTES, lookup::STARTS};
use crate::passes::{prefix_sum, radix_sort};
use crate::scene::sources::Sources;
use crate::schedule::*;

/// Words of the shader's `Totals`, and where it has the number of photons.
const TOTALS: u64 = 4;
const COUNT: u32 = 1;

pub(super) fn encode(e: &mut Encoder<'_>, work: Work) {
    let sources = e.constant_buffer("sources", bytemuck::cast_slice(&Sources::new(e.setting.scene).words()));
    // Words of the sources stand in where nothing is guided.
    let guide = if work.reflects == Reflects::NarrowLobes { guide(e, &work) } else { sources };
    let counts = e.buffer("counts", 4 * (u64::from(work.most) + 1));
    let totals = e.buffer("totals", 4 * TOTALS);
    let photons = e.buffer("photons", PHOTON_BYTES * u64::from(work.capacity));
    let trace = scene_constants(Program::new("photon_map/trace"), e.setting.needs)
        .constant("PATHS", work.most)
        .constant("CAPACITY", work.capacity)
        .constant("LEGS", work.legs)
        .constant("CAUSTICS", (work.reflects == Reflects::NarrowLobes) as u8)
        .bind("counts", counts)
        .bind("totals", totals)
        .bind("photons", photons)
        .bind("sources", sources)
        .bind("guide", guide);
    let each_path = Groups::linear(work.most / 64 + 1);
    e.compute(trace.clone(), "count", each_path);
    prefix_sum::encode(e, counts, 0, work.most + 1, None);
    e.compute(trace.clone(), "tell", Groups::ONE);
    e.compute(trace, "keep", each_path);
    e.host("look", &[Read::whole(totals)], &[], move |host| {
        let numbers: Vec<u32> = bytemuck::pod_collect_to_vec(host.read(totals));
        let [emitted, count, cut_off, ..] = numbers[..] else { return Err("photons were counted too little".into()) };
        work.tell(host, [emitted, count, cut_off]);
        Ok(())
    });
    sort(e, &work, photons, totals);
}

/// The host looks where photons start that meet lobes.
fn guide(e: &mut Encoder<'_>, work: &Work) -> Resource {
    let (words, reflects, legs) = (e.buffer("guide", 4 * guide::WORDS as u64), work.reflects, work.legs);
    e.host("look_for_lobes", &[], &[words], move |host| {
        let tracer = Tracer::of(host, reflects, legs).guided();
        let guide = tracer.guide.map_or_else(Vec::new, |guide| guide.words().to_vec());
        host.write(words, 0, bytemuck::cast_slice(&guide));
        Ok(())
    });
    words
}

/// Puts the photons into the map.
fn sort(e: &mut Encoder<'_>, work: &Work, photons: Resource, totals: Resource) {
    let bounds = e.setting.scene.bounds();
    let cube = Cube::around(bounds.min, bounds.max);
    let pairs = ["pairs", "sorted_pairs"].map(|member| e.buffer(member, 8 * u64::from(work.capacity)));
    let entered = e.buffer("entered", 64);
    let program = |pairs: Resource| {
        Program::new("photon_map/sort")
            .constant("CORNER_X", cube.corner.x)
            .constant("CORNER_Y", cube.corner.y)
            .constant("CORNER_Z", cube.corner.z)
            .constant("CELLS_PER_UNIT", cube.cells_per_unit)
            .bind("photons", photons)
            .bind("pairs", pairs)
            .bind("totals", totals)
            .bind("words", work.data)
            .bind("entered", entered)
    };
    let each_photon = Groups::Counted { count: work.count, divisor: 64, per: 1 };
    e.clear(entered);
    e.compute(program(pairs[0]), "code", each_photon);
    let sorted = radix_sort::encode(e, pairs, radix_sort::Keys { bits: 3 * BITS, capacity: work.capacity, count: work.count, counted: (totals, COUNT) });
    e.compute(program(sorted), "gather", each_photon);
    e.compute(program(sorted), "tabulate", Groups::linear((STARTS as u32).div_ceil(64)));
    e.compute(program(sorted), "tell_head", Groups::ONE);
}
