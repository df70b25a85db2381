//! Samples and steps at walls times tables of the basis, on the device.

use super::Work;
use crate::contract::Encoder;
use crate::contract::port::{Coefficients, Precision};
use crate::host_struct;
use crate::math::harmonics::reflection::{fours, quads};
use crate::schedule::*;
use glam::Vec4;

/// Tiles of a workgroup, and fours of coefficients: `TILES` and `COLUMNS` of the shader.
const TILES: u32 = 2;
const COLUMNS: u32 = 32;

host_struct! {
    /// A wall between two samples.
    pub struct TileWall {
        a: u32,
        b: u32,
        /// 1 over the cosines to the raster's axis.
        depth_a: f32,
        depth_b: f32,
        gradient: [f32; 2],
        padding: [u32; 2],
    }
}

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work<'_>) {
    let (tiles, table, expansion) = (&work.weighted.tiles, &work.weighted.table, &work.expansion);
    let quads = quads(work.order as usize);
    let places: Vec<u32> = expansion.samples.iter().map(|(at, _)| *at).collect();
    let basis: Vec<Vec4> = expansion.samples.iter().flat_map(|(_, basis)| fours(basis)).collect();
    let wall_basis: Vec<Vec4> = expansion.walls.iter().flat_map(|wall| fours(&wall.basis)).collect();
    let depth = |at: u32| (1.0 / table.samples[at as usize].depth_cosine) as f32;
    let walls: Vec<TileWall> = expansion
        .walls
        .iter()
        .map(|w| TileWall { a: w.a, b: w.b, depth_a: depth(w.a), depth_b: depth(w.b), gradient: w.gradient.as_vec2().into(), padding: [0; 2] })
        .collect();
    let requests = tiles.requests;
    let steps = e.buffer("steps", u64::from(requests.capacity) * walls.len() as u64 * 16);
    let raw = e.buffer("raw", u64::from(requests.capacity) * Coefficients::bytes(work.order, Precision::Single));
    let mut wall_bytes = bytemuck::cast_slice(&walls).to_vec();
    wall_bytes.resize(wall_bytes.len().max(size_of::<TileWall>()), 0);
    let walls_bound = e.constant_buffer("walls", &wall_bytes);
    let program = Program::new("radiance_projection")
        .constant("TILE_WIDTH", table.width)
        .constant("TILE_HEIGHT", table.height)
        .constant("TILE_CAPACITY", requests.capacity)
        .constant("QUADS", quads as u32)
        .constant("ORDER", work.order)
        .constant("SAMPLES", places.len() as u32)
        .constant("WALLS", walls.len() as u32)
        .bind("requests", requests.places)
        .bind("walls", walls_bound)
        .bind("radiance", tiles.samples)
        .bind("steps", steps)
        .bind("places", e.constant_buffer("places", bytemuck::cast_slice(&places)))
        .bind("basis", e.constant_buffer("basis", bytemuck::cast_slice(&basis)))
        .bind("wall_basis", e.constant_buffer("wall_basis", bytemuck::cast_slice(&wall_basis)))
        .bind("raw", raw)
        .bind("values", work.values)
        .bind("records", work.records);
    if !walls.is_empty() {
        e.compute(program.clone(), "step", Groups::Counted { count: requests.count, divisor: 1, per: (walls.len() as u32).div_ceil(64) });
    }
    e.compute(program.clone(), "project", Groups::Counted { count: requests.count, divisor: TILES, per: (quads as u32).div_ceil(COLUMNS) });
    if !walls.is_empty() {
        e.compute(program.clone(), "bound", Groups::Counted { count: requests.count, divisor: 1, per: 1 });
    }
    e.compute(program, "turn", Groups::Counted { count: requests.count, divisor: 1, per: (4 * quads as u32).div_ceil(64) });
}
