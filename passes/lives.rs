//! What passes share whose records live on while the scene changes.

use super::record::Record;
use crate::contract::Need;
use crate::math::{
    life::{Life, Word},
    weight,
};
use crate::scene::{Scene, bvh::Bvh, needs::Needs, surface_offset};
use crate::schedule::{HostContext, Resource};
use bytemuck::Pod;
use glam::Vec3;

/// Why passes for scenes that move are left out of others.
pub fn needed_where_it_moves(needs: &Needs) -> Need {
    if needs.moves { Need::Kept } else { Need::Dropped("nothing in the scene moves") }
}

/// The first items of a buffer that a step reads.
pub fn first<T: Pod>(host: &dyn HostContext, buffer: Resource, count: usize) -> Vec<T> {
    bytemuck::pod_collect_to_vec(&host.read(buffer)[..count * size_of::<T>()])
}

/// How far off its surface a record is looked for, in footprints.
const OFF: f32 = 0.25;

/// The same of a place in a scene of such an extent [scene units].
pub fn off(extent: f32, position: Vec3, footprint: f32) -> f32 {
    (OFF * footprint).max(4.0 * surface_offset(extent, position))
}

/// The surface of a scene that a place and normal lie on, or almost.
pub fn surface_under((scene, bvh, extent): (&Scene, &Bvh, f32), [position, normal]: [Vec3; 2], footprint: f32) -> Option<u32> {
    let off = off(extent, position, footprint);
    bvh.closest_hit(scene, position + off * normal, -normal, 2.0 * off).map(|hit| hit.triangle)
}

/// What a record tells those beside it that it has been sampled anew.
pub fn word(record: &Record, life: &Life, rule: &weight::Rule) -> Word {
    let reach = 2.0 * rule.longest_validity_radius(&weight::Record::from(record));
    Word { position: record.place()[0], normal: record.place()[1], reach, left: life.left }
}
