//! Records and requests in memory, as `shaders/lib/record.wgsl` and `lib/tile.wgsl` read them.

use crate::host_struct;
use crate::math::hemisphere::Table;
use crate::recording::HostLayout;
use bytemuck::cast_slice;

host_struct! {
    /// One irradiance record; lengths in scene units, irradiance in W/m².
    pub struct Record {
        position: [f32; 3],
        /// Harmonic mean distance.
        radius: f32,
        normal: [f32; 3],
        minimum_distance: f32,
        irradiance: [f32; 3],
        /// Width of the pixel that asked for the record.
        footprint: f32,
        /// Gradients of red, green and blue per radian; the fourth numbers are spare.
        rotation: [[f32; 4]; 3],
        /// Gradients per scene unit.
        translation: [[f32; 4]; 3],
    }
}

host_struct! {
    /// A place that needs a record.
    pub struct Request {
        position: [f32; 3],
        footprint: f32,
        normal: [f32; 3],
        /// Turn of the hemisphere's frame around the normal [radians].
        turn: f32,
    }
}

host_struct! {
    /// Which records count where, and how much.
    pub struct Weighting {
        accuracy: f32,
        /// Least and most reach in widths of the pixel that asked for the record.
        minimum_spacing: f32,
        maximum_spacing: f32,
        /// 0 Ward, 1 Tabellion and Lamorlette, 2 compact.
        kind: u32,
    }
}

host_struct! {
    pub struct TileSample {
        direction: [f32; 3],
        cosine_weight: f32,
        plain_weight: f32,
        rotation_x: f32,
        rotation_y: f32,
        depth_cosine: f32,
    }
}

host_struct! {
    pub struct TileEdge {
        gradient: [f32; 3],
        a: u32,
        b: u32,
        padding_a: u32,
        padding_b: u32,
        padding_c: u32,
    }
}

pub const LAYOUTS: &[HostLayout] = &[Record::LAYOUT, Request::LAYOUT, Weighting::LAYOUT, TileSample::LAYOUT, TileEdge::LAYOUT];

pub const RECORD_BYTES: u64 = size_of::<Record>() as u64;
pub const REQUEST_BYTES: u64 = size_of::<Request>() as u64;

/// A table's samples in single precision.
pub fn sample_bytes(table: &Table) -> Vec<u8> {
    let single = |v: [f64; 3]| v.map(|x| x as f32);
    let samples: Vec<_> = table
        .samples
        .iter()
        .map(|s| TileSample {
            direction: single(s.direction),
            cosine_weight: s.cosine_weight as f32,
            plain_weight: s.plain_weight as f32,
            rotation_x: s.rotation[0] as f32,
            rotation_y: s.rotation[1] as f32,
            depth_cosine: s.depth_cosine as f32,
        })
        .collect();
    cast_slice(&samples).to_vec()
}

/// A table's edges in single precision.
pub fn edge_bytes(table: &Table) -> Vec<u8> {
    let edges: Vec<_> =
        table.edges.iter().map(|e| TileEdge { gradient: e.gradient.map(|x| x as f32), a: e.a, b: e.b, padding_a: 0, padding_b: 0, padding_c: 0 }).collect();
    cast_slice(&edges).to_vec()
}
