//! One workgroup sums four tiles, each lane two rows of all four.

use super::Work;
use crate::contract::Encoder;
use crate::host_struct;
use crate::math::hemisphere::{Edge, Table};
use crate::passes::record::{TileEdge, edge_bytes};
use crate::schedule::*;

/// Tiles of a workgroup.
const TILES: u32 = 4;

host_struct! {
    /// What a sample stands for, and its walls to the samples on its left and above.
    pub struct Cell {
        /// Cosine weight, turn of the normal, 1 over the cosine to the raster's axis; that is 0 for an unused sample.
        weights: [f32; 4],
        /// Gradient, and xx of the second derivatives.
        left: [f32; 4],
        above: [f32; 4],
        /// xy and yy of the second derivatives, left and above.
        bends: [f32; 4],
        /// Of the block of four whose last sample this is, the weight as the first number; 0 where there is none.
        block: [f32; 4],
    }
}

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work<'_>) {
    let tiles = &work.weighted.tiles;
    let (cells, seams) = cells(&work.weighted.table);
    let cells = e.constant_buffer("cells", bytemuck::cast_slice(&cells));
    // A binding holds one element at least.
    let mut seam_bytes = edge_bytes(&seams);
    seam_bytes.resize(seam_bytes.len().max(size_of::<TileEdge>()), 0);
    let program = work
        .layout(Program::new("irradiance_sum/workgroup_tree"))
        .constant("SEAMS", seams.len() as u32)
        .bind("requests", tiles.requests.places)
        .bind("cells", cells)
        .bind("seams", e.constant_buffer("seams", &seam_bytes))
        .bind("radiance", tiles.samples)
        .bind("records", work.records);
    e.compute(program, "sum", Groups::Counted { count: tiles.requests.count, divisor: TILES, per: 1 });
}

/// The samples with the walls to their neighbours in the picture, and all other walls.
fn cells(table: &Table) -> (Vec<Cell>, Vec<Edge>) {
    let mut cells: Vec<Cell> = table
        .samples
        .iter()
        .map(|sample| Cell {
            weights: [
                sample.cosine_weight as f32,
                sample.rotation[0] as f32,
                sample.rotation[1] as f32,
                if sample.plain_weight > 0.0 { (1.0 / sample.depth_cosine) as f32 } else { 0.0 },
            ],
            ..bytemuck::Zeroable::zeroed()
        })
        .collect();
    // Lanes take rows in pairs: below an odd number of them stands one that adds nothing.
    cells.resize((table.width * table.height.next_multiple_of(2)) as usize, bytemuck::Zeroable::zeroed());
    for last in table.blocks.iter().map(|last| *last as usize) {
        cells[last].block[0] = table.samples[last].cosine_weight as f32;
    }
    let mut seams = Vec::new();
    for edge in &table.edges {
        let cell = &mut cells[edge.b as usize];
        let ([x, y, z], [xx, xy, yy]) = (edge.gradient.map(|x| x as f32), edge.hessian.map(|x| x as f32));
        if edge.b == edge.a + 1 && edge.b % table.width != 0 {
            cell.left = [x, y, z, xx];
            [cell.bends[0], cell.bends[1]] = [xy, yy];
        } else if edge.b == edge.a + table.width {
            cell.above = [x, y, z, xx];
            [cell.bends[2], cell.bends[3]] = [xy, yy];
        } else {
            seams.push(*edge);
        }
    }
    (cells, seams)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hemisphere::{Method, Shape};

    #[test]
    fn each_wall_stands_in_one_place() {
        for shape in [Shape::Hemicube, Shape::Cosine, Shape::Hemispherical, Shape::Plane { fov_degrees: 90.0 }] {
            let table = Table::new(shape, 10, Method::None).unwrap();
            let (cells, seams) = cells(&table);
            assert_eq!(cells.len() as u32, table.width * table.height.next_multiple_of(2));
            let of_seam = |edge: &Edge| seams.iter().any(|seam| seam == edge);
            let [mut left, mut above] = [0, 0];
            for edge in &table.edges {
                let (cell, wall) = (&cells[edge.b as usize], edge.gradient.map(|x| x as f32));
                let bends = edge.hessian.map(|x| x as f32);
                let is = |found: [f32; 4], [xy, yy]: [f32; 2]| found == [wall[0], wall[1], wall[2], bends[0]] && [xy, yy] == [bends[1], bends[2]];
                let column = edge.b % table.width;
                if edge.a + 1 == edge.b && column > 0 {
                    assert!(is(cell.left, [cell.bends[0], cell.bends[1]]) && !of_seam(edge));
                    left += 1;
                } else if edge.a + table.width == edge.b {
                    assert!(is(cell.above, [cell.bends[2], cell.bends[3]]) && !of_seam(edge));
                    above += 1;
                } else {
                    assert!(of_seam(edge));
                }
            }
            assert_eq!(left + above + seams.len(), table.edges.len());
            assert!(left > 0 && above > 0);
            for (cell, sample) in cells.iter().zip(&table.samples) {
                let inverse = if sample.plain_weight > 0.0 { 1.0 / sample.depth_cosine } else { 0.0 };
                assert_eq!(cell.weights, [sample.cosine_weight, sample.rotation[0], sample.rotation[1], inverse].map(|x| x as f32));
            }
            assert!(cells[table.samples.len()..].iter().all(|cell| bytemuck::bytes_of(cell).iter().all(|byte| *byte == 0)));
        }
    }
}
