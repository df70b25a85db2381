//! The same product on the host, in single precision: where the device is a driver on the same cores, this takes a fraction of its time.

use super::{Work, keep};
use crate::contract::Encoder;
use crate::math::{
    harmonics::reflection::{fours, quads},
    radiance::{Expansion, PLANES, Projected},
};
use crate::passes::record::{RECORD_BYTES, REQUEST_BYTES, Record, Request};
use crate::scene::model::surface_offset;
use crate::schedule::*;
use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// Tiles that share one reading of the tables: their sums fit into registers.
const TILES: usize = 2;

/// The tables, four coefficients after the other, in each of them sample by sample and wall by wall.
struct Tables {
    order: usize,
    places: Vec<u32>,
    basis: Vec<Vec4>,
    walls: Vec<HostWall>,
    wall_basis: Vec<Vec4>,
}

struct HostWall {
    ends: [u32; 2],
    /// 1 over the cosines to the raster's axis.
    depths: [f32; 2],
    gradient: [f32; 2],
}

/// What a tile's samples and walls multiply the tables by.
struct Factors {
    samples: Vec<Vec3>,
    steps: Vec<Vec3>,
}

impl Tables {
    fn new(expansion: &Expansion, depth_cosine: impl Fn(u32) -> f64) -> Self {
        let columns = |rows: &mut dyn Iterator<Item = &Vec<f64>>| {
            let rows: Vec<Vec<Vec4>> = rows.map(|row| fours(row)).collect();
            (0..quads(expansion.order)).flat_map(|quad| rows.iter().map(move |row| row[quad])).collect::<Vec<_>>()
        };
        let wall = |w: &crate::math::radiance::Wall| HostWall {
            ends: [w.a, w.b],
            depths: [w.a, w.b].map(|at| (1.0 / depth_cosine(at)) as f32),
            gradient: w.gradient.as_vec2().into(),
        };
        Self {
            order: expansion.order,
            places: expansion.samples.iter().map(|(at, _)| *at).collect(),
            basis: columns(&mut expansion.samples.iter().map(|(_, basis)| basis)),
            walls: expansion.walls.iter().map(wall).collect(),
            wall_basis: columns(&mut expansion.walls.iter().map(|wall| &wall.basis)),
        }
    }

    fn factors(&self, tile: &[Vec4], nearest: f32) -> Factors {
        let step = |wall: &HostWall| {
            let [a, b] = wall.ends.map(|at| tile[at as usize]);
            (b - a).truncate() * (wall.depths[0] / a.w.max(nearest)).max(wall.depths[1] / b.w.max(nearest))
        };
        Factors { samples: self.places.iter().map(|at| tile[*at as usize].truncate()).collect(), steps: self.walls.iter().map(step).collect() }
    }

    /// Plane by plane, of each tile.
    fn project(&self, tiles: &[Factors; TILES]) -> [Vec<Vec4>; TILES] {
        let quads = quads(self.order);
        let mut planes: [Vec<Vec4>; TILES] = std::array::from_fn(|_| vec![Vec4::ZERO; PLANES * quads]);
        for quad in 0..quads {
            let (samples, walls) = (self.places.len(), self.walls.len());
            let mut sums = [[Vec4::ZERO; 3]; TILES];
            for (i, weight) in self.basis[quad * samples..][..samples].iter().enumerate() {
                for (sums, tile) in sums.iter_mut().zip(tiles) {
                    let seen = tile.samples[i];
                    *sums = [sums[0] + *weight * seen.x, sums[1] + *weight * seen.y, sums[2] + *weight * seen.z];
                }
            }
            let mut changes = [[Vec4::ZERO; 6]; TILES];
            for (i, weight) in self.wall_basis[quad * walls..][..walls].iter().enumerate() {
                let [x, y] = self.walls[i].gradient.map(|along| *weight * along);
                for (c, tile) in changes.iter_mut().zip(tiles) {
                    let step = tile.steps[i];
                    *c = [c[0] + x * step.x, c[1] + x * step.y, c[2] + x * step.z, c[3] + y * step.x, c[4] + y * step.y, c[5] + y * step.z];
                }
            }
            for ((planes, sums), changes) in planes.iter_mut().zip(&sums).zip(&changes) {
                sums.iter().chain(changes).enumerate().for_each(|(plane, sum)| planes[plane * quads + quad] = *sum);
            }
        }
        planes
    }
}

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work<'_>) {
    let tiles = &work.weighted.tiles;
    let (samples, requests, values, records) = (tiles.samples, tiles.requests, work.values, work.records);
    let tables = Tables::new(&work.expansion, |at| work.weighted.table.samples[at as usize].depth_cosine);
    let length = work.weighted.table.samples.len();
    let reads = [
        Read::counted(samples, length as u64 * 16, requests.count),
        Read::counted(requests.places, REQUEST_BYTES, requests.count),
        Read::counted(records, RECORD_BYTES, requests.count),
    ];
    e.host("project", &reads, &[values, records], move |host| {
        let extent = host.extent();
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        let mut heads: Vec<Record> = bytemuck::pod_collect_to_vec(host.read(records));
        let radiance: Vec<Vec4> = bytemuck::pod_collect_to_vec(host.read(samples));
        let tile = |at: usize| {
            let at = at.min(places.len() - 1);
            tables.factors(&radiance[at * length..][..length], surface_offset(extent, Vec3::from(places[at].position)).max(1e-30))
        };
        let firsts: Vec<usize> = (0..places.len()).step_by(TILES).collect();
        let projected: Vec<_> = firsts.par_iter().map(|first| tables.project(&std::array::from_fn(|i| tile(first + i)))).collect();
        let mut all: Vec<Vec4> = Vec::new();
        for ((place, head), planes) in places.iter().zip(&mut heads).zip(projected.iter().flatten()) {
            keep(Projected::of_fours(planes, tables.order), !tables.walls.is_empty(), place, head, &mut all);
        }
        host.write(values, 0, bytemuck::cast_slice(&all));
        host.write(records, 0, bytemuck::cast_slice(&heads));
        Ok(())
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hemisphere::{Method, Shape, Table};

    #[test]
    fn single_precision_projects_as_double_does() {
        for shape in [Shape::Hemicube, Shape::Cosine] {
            let (table, order, nearest) = (Table::new(shape, 8, Method::None).unwrap(), 3, 0.5);
            let expansion = Expansion::new(&table, order);
            let tables = Tables::new(&expansion, |at| table.samples[at as usize].depth_cosine);
            // Some of what is seen is nearer than the nearest that counts.
            let tiles = [0, 1].map(|tile| {
                let seen = |at: usize| Vec4::new(((at * 7 + tile) % 5) as f32, ((at * 3) % 4) as f32, (at % 3) as f32, 0.25 + ((at * 5 + tile) % 7) as f32);
                (0..table.samples.len()).map(seen).collect::<Vec<Vec4>>()
            });
            let projected = tables.project(&[0, 1].map(|tile| tables.factors(&tiles[tile], nearest)));
            for (tile, planes) in tiles.iter().zip(&projected) {
                let radiance: Vec<[f32; 4]> = tile.iter().map(|seen| seen.to_array()).collect();
                let Projected(expected) = expansion.project(&table, &radiance, nearest.into()).unwrap();
                let Projected(found) = Projected::of_fours(planes, order);
                assert_eq!(planes.len(), PLANES * quads(order));
                for (expected, found) in expected.iter().zip(&found) {
                    let scale = expected.iter().fold(0.0f64, |most, value| most.max(value.abs()));
                    assert!(scale > 0.1 && expected.iter().zip(found).all(|(a, b)| (a - b).abs() < 1e-4 * scale), "{expected:?} is not {found:?}");
                }
            }
        }
    }
}
