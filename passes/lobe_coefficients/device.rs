//! The same projections by a shader.

use super::does_not_fit;
use crate::contract::{Encoder, MOST_BYTES, Refusal};
use crate::host_struct;
use crate::math::{
    harmonics::{
        Basis, Harmonics,
        reflection::{PARTS, STEPS, Series, Window, direction_at, even_points, height_direction, quads, table_fours},
    },
    lobe,
};
use crate::passes::record::TablePlace;
use crate::schedule::*;
use glam::{Vec2, Vec4};

host_struct! {
    /// A lobe, its first outgoing direction in the list of all, its points in that of theirs, none where directions are drawn, where its table begins
    /// and the order that this holds.
    pub struct Shape {
        kind: u32,
        first: u32,
        alpha: [f32; 2],
        first_point: u32,
        points: u32,
        table: u32,
        order: u32,
    }
}

/// Rounds of a shader's loops: llvmpipe ends an invocation's loops after 2¹⁶ of them.
const MOST_ROUNDS: usize = 50_000;

/// Directions that the shader draws for a narrow lobe.
const DRAWN: u32 = 64 * 64;

/// Adds the commands that project each lobe to the order of its place, `series` having the highest; the buffer of all tables.
pub(super) fn encode(e: &mut Encoder<'_>, lobes: &[lobe::Shape], places: &[TablePlace], series: Series, edge: usize) -> Result<Resource, Refusal> {
    let Series { harmonics, order, window } = series;
    let mut shapes = Vec::new();
    let [mut outgoing, mut points]: [Vec<Vec4>; 2] = Default::default();
    for (at, (lobe, place)) in lobes.iter().zip(places).enumerate() {
        let (kind, alpha) = lobe.numbers();
        let even = even_points(*lobe, place.order as usize);
        let [first, first_point] = [&outgoing, &points].map(|list| list.len() as u32);
        shapes.push(Shape { kind, first, alpha: alpha.into(), first_point, points: even.len() as u32, table: place.first, order: place.order });
        points.extend(even.into_iter().map(|(direction, solid_angle)| direction.extend(solid_angle as f32)));
        let place = |cell: usize| Vec2::new((cell % edge) as f32 + 0.5, (cell / edge) as f32 + 0.5) / edge as f32;
        if lobe.is_anisotropic() {
            outgoing.extend((0..edge * edge).map(|cell| direction_at(place(cell)).extend(at as f32)));
        } else {
            outgoing.extend((0..=STEPS).map(|step| height_direction(step).extend(at as f32)));
        }
    }
    let (sectoral, steps) = Basis::<f32>::new(order).recurrence();
    let room = PARTS * quads(order);
    let visited = shapes.iter().map(|shape: &Shape| if shape.points == 0 { DRAWN } else { shape.points }).max().unwrap_or(0);
    let slices = (visited as usize * order).div_ceil(MOST_ROUNDS);
    let bytes = (outgoing.len() * slices * room * size_of::<Vec4>()) as u64;
    if bytes > MOST_BYTES {
        return Err(does_not_fit(lobes.len(), edge));
    }
    let projected = e.buffer("projected", bytes);
    let fours: usize = places.iter().map(|place| table_fours(place.order as usize, edge)).sum();
    let values = e.buffer("values", (fours * size_of::<Vec4>()) as u64);
    let program = Program::new("lobe_coefficients")
        .constant("ORDER", order as u32)
        .constant("QUADS", quads(order) as u32)
        .constant("HANN", (window == Window::Hann) as u8)
        .constant("GRID", edge as u32)
        .constant("HEIGHTS", STEPS as u32)
        .constant("SLICES", slices as u32)
        .constant("SPHERICAL", (harmonics == Harmonics::Spherical) as u8)
        .bind("shapes", e.constant_buffer("shapes", bytemuck::cast_slice(&shapes)))
        .bind("outgoing", e.constant_buffer("outgoing", bytemuck::cast_slice(&outgoing)))
        .bind("points", e.constant_buffer("points", bytemuck::cast_slice(&points)))
        .bind("steps", e.constant_buffer("steps", bytemuck::cast_slice(&steps)))
        .bind("starts", e.constant_buffer("starts", bytemuck::cast_slice(&sectoral)))
        .bind("projected", projected)
        .bind("values", values);
    e.compute(program.clone(), "project", Groups::linear((outgoing.len() * slices) as u32));
    e.compute(program, "lay_out", Groups::linear((lobes.len() * edge * edge * room).div_ceil(64) as u32));
    Ok(values)
}
