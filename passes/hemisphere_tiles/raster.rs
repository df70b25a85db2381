//! The scene rasterised from each record, less what lies outside of its views and what no sample can see.

use super::cull::cull;
use super::{Work, sift};
use crate::contract::{Encoder, encoder::scene_constants};
use crate::host_struct;
use crate::math::hemisphere::{Shape, View};
use crate::schedule::*;
use glam::DVec3;

host_struct! {
    /// A camera at the record, in its frame.
    pub struct TileView {
        right: [f32; 3],
        minimum_x: f32,
        up: [f32; 3],
        minimum_y: f32,
        forward: [f32; 3],
        maximum_x: f32,
        maximum_y: f32,
        /// Samples along the edges.
        width: f32,
        height: f32,
        padding: f32,
    }
}

host_struct! {
    /// A camera where a request stands: an inner product of a point relative to `origin` with each axis is a clip coordinate.
    pub struct TileCamera {
        right: [f32; 3],
        /// Distance of the near plane.
        near: f32,
        up: [f32; 3],
        padding_a: f32,
        forward: [f32; 3],
        padding_b: f32,
        origin: [f32; 3],
        padding_c: f32,
    }
}

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work, sift: bool) {
    let views: Vec<_> = work.table.views.iter().map(tile_view).collect();
    let buffer = e.constant_buffer("views", bytemuck::cast_slice(&views));
    let needs = e.setting.needs;
    let tested = needs.one_sided || needs.alpha_masks;
    let hemispherical = matches!(work.shape, Shape::Hemispherical);
    let atlas = e.texture("atlas", work.size, 1, Format::R32Uint);
    let depth = e.texture("depth", work.size, 1, Format::Depth32Float);
    let vertices = (!hemispherical).then(|| e.scene_data(SceneData::Positions));
    let program = program(e, work, buffer);
    let cameras = (!hemispherical).then(|| aim(e, work, &program));
    let (draws, indices) = match cameras {
        Some(cameras) if sift && sift::pays(work, needs.triangles) => sift::encode(e, work, &program.clone().bind("cameras", cameras)),
        _ => (draw_all(e, work), None),
    };
    e.command(Command::Raster(Raster {
        program,
        vertex: if hemispherical { "vertex_hemispherical" } else { "vertex" },
        fragment: Some(match (hemispherical, tested) {
            (true, _) => "fragment_hemispherical",
            (false, true) => "fragment_tested",
            (false, false) => "fragment",
        }),
        colours: vec![Target { texture: atlas, clear: Some([0.0; 4]), blend: Blend::Replace }],
        depth: Some(DepthTarget { texture: depth, layer: 0, clears: true }),
        vertices,
        instances: cameras,
        indices,
        topology: Topology::Triangles,
        draws: Draws::Listed(draws),
    }));
    e.command(Command::CopyToBuffer { from: atlas, to: work.seen, offset: 0 });
}

fn program(e: &Encoder<'_>, work: &Work, views: Resource) -> Program {
    work.layout(scene_constants(Program::new("hemisphere_tiles/raster"), e.setting.needs))
        .constant("VIEWS", work.table.views.len() as u32)
        .bind("requests", work.requests.places)
        .bind("views", views)
        .bind("samples", work.samples)
}

/// Turns the views of every request to where they stand, once for all vertices.
fn aim(e: &mut Encoder<'_>, work: &Work, program: &Program) -> Resource {
    let views = work.table.views.len() as u32;
    let cameras = e.buffer("cameras", (work.requests.capacity * views) as u64 * size_of::<TileCamera>() as u64);
    e.compute(program.clone().bind("cameras", cameras), "aim", Groups::Counted { count: work.requests.count, divisor: 64, per: views });
    cameras
}

fn tile_view(view: &View) -> TileView {
    let single = |v: DVec3| v.as_vec3().to_array();
    TileView {
        right: single(view.right),
        minimum_x: view.minimum.x as f32,
        up: single(view.up),
        minimum_y: view.minimum.y as f32,
        forward: single(view.forward),
        maximum_x: view.maximum.x as f32,
        maximum_y: view.maximum.y as f32,
        width: view.rectangle[2] as f32,
        height: view.rectangle[3] as f32,
        padding: 0.0,
    }
}

/// Draws all that a view may see.
fn draw_all(e: &mut Encoder<'_>, work: &Work) -> Resource {
    let draws = e.draws("draws");
    cull(e, work, &[], move |found, host| host.draws(draws).clone_from(&found.draws));
    draws
}
