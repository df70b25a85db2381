//! Photons near a point: as `shaders/lib/photon_map.wgsl`.

use super::{HEAD_BYTES, MapHead, PHOTON_BYTES, Photon, SLOTS_BEFORE, unpacked_ways};
use crate::contract::port;
use crate::math::morton::{BITS, Cube, code};
use crate::schedule::HostContext;
use glam::{IVec3, Vec3};

/// A map in a host step that reads it.
#[derive(Clone, Copy)]
pub struct Lookup<'a> {
    cube: Cube,
    /// Size of the cells that lookups begin with.
    level: u32,
    /// Of the first photon in each cell of the table's size, and one past the last of all.
    starts: &'a [u32],
    photons: &'a [Photon],
}

/// The photons in each of the eight cells next to a point: the first, and one past the last.
type Cells = [[u32; 2]; 8];

/// The photons that count at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Zone {
    /// [scene units]
    pub radius: f32,
    /// Size of the cells in which they are, by its logarithm: those next to the point hold all of them.
    level: u32,
    cells: Cells,
    /// Whether it ends where there are as many as are wanted.
    is_filled: bool,
}

impl Zone {
    /// The share of so many photons that are as dense as others around them: a zone that is made as large as it must be for a number of photons ends at one more
    /// often than chance would have it.
    pub fn fair_share(&self, count: usize) -> f32 {
        if self.is_filled && count > 1 { 1.0 - 1.0 / count as f32 } else { 1.0 }
    }
}

/// Photons in the cells next to a point for each that is wanted: some are on other surfaces, and a disc fills a part of the cells.
const CROWD: usize = 6;

/// So few of the photons that are wanted do, where larger cells would have to be looked through.
const DETAIL: u32 = 4;

/// Sizes of cells by which a zone is widened at most, where few of the photons near are on the surface.
const WIDENED: u32 = 1;

/// What rounding may take away.
const LONGER: f32 = 1.0001;

/// Rings of equal area in which photons are counted to find the radius.
const RINGS: usize = 16;

/// A photon counts on a surface whose normal differs by less than this cosine, and that is no farther above or below than this share of the radius.
pub const LEAST_COSINE: f32 = 0.8;
pub const FLATNESS: f32 = 0.25;

impl<'a> Lookup<'a> {
    pub fn of(map: &port::PhotonMap, host: &'a dyn HostContext) -> Self {
        let (before, photons) = host.read(map.data).split_at((SLOTS_BEFORE * PHOTON_BYTES) as usize);
        let (head, starts) = before.split_at(HEAD_BYTES as usize);
        let head: MapHead = bytemuck::pod_read_unaligned(head);
        let cube = Cube { corner: head.corner.into(), cells_per_unit: head.cells_per_unit };
        Self { cube, level: head.level, starts: bytemuck::cast_slice(starts), photons: &bytemuck::cast_slice(photons)[..head.count as usize] }
    }

    pub fn photons(&self) -> &'a [Photon] {
        self.photons
    }

    /// Half the edge of a cell [scene units]: the cells next to a point hold all that is so near.
    fn half_edge(&self, level: u32) -> f32 {
        0.5 * (1 << level) as f32 / self.cube.cells_per_unit
    }

    /// The cells next to a point, each by its place among those of its size; below 0 or too large outside of the cube.
    fn cells(&self, position: Vec3, level: u32) -> [IVec3; 8] {
        let base = (self.cube.place(position) / (1 << level) as f32 - 0.5).floor().as_ivec3();
        std::array::from_fn(|number| base + IVec3::new(number as i32 & 1, number as i32 >> 1 & 1, number as i32 >> 2))
    }

    fn block(&self, position: Vec3, level: u32) -> Cells {
        let last = (1i32 << (BITS - level)) - 1;
        self.cells(position, level).map(|cell| {
            if cell.min_element() < 0 || cell.max_element() > last {
                return [0; 2];
            }
            let first = code(cell.as_uvec3()) << (3 * level);
            let begin = self.first_from(first, 0);
            [begin, self.first_from(first + (1 << (3 * level)), begin)]
        })
    }

    /// The first photon whose code is no less; none before `least` is.
    fn first_from(&self, code: u32, least: u32) -> u32 {
        let cell = (code >> TABLE_BITS) as usize;
        let start = self.starts[cell];
        if code & ((1 << TABLE_BITS) - 1) == 0 {
            return start;
        }
        let start = start.max(least);
        let photons = &self.photons[start as usize..self.starts[cell + 1].max(start) as usize];
        start + photons.partition_point(|photon| self.cube.code(photon.position.into()) < code) as u32
    }

    /// The zone around a point that holds so many photons of its surface; fewer in details and within `most` [scene units].
    pub fn zone(&self, position: Vec3, normal: Vec3, wanted: u32, most: f32) -> Zone {
        let crowd = CROWD * wanted as usize;
        let count = |cells: &Cells| cells.iter().map(|[first, end]| (end - first) as usize).sum::<usize>();
        let mut level = self.level;
        let mut cells = self.block(position, level);
        if count(&cells) >= crowd {
            while level > 0 {
                let finer = self.block(position, level - 1);
                if count(&finer) < crowd {
                    break;
                }
                (level, cells) = (level - 1, finer);
            }
        } else {
            while level < BITS && self.half_edge(level) < most && count(&cells) < crowd {
                level += 1;
                cells = self.block(position, level);
            }
        }
        let last = level + WIDENED;
        loop {
            let radius = self.half_edge(level).min(most);
            let rings = self.rings(position, normal, Zone { radius, level, cells, is_filled: false });
            let enough = rings.iter().position(|within| *within >= wanted);
            if let Some(ring) = enough {
                return Zone { radius: radius * ((ring + 1) as f32 / RINGS as f32).sqrt(), level, cells, is_filled: true };
            }
            // In details there are never as many on one surface.
            if level == BITS.min(last) || self.half_edge(level) >= most || rings[RINGS - 1] * DETAIL >= wanted {
                return Zone { radius, level, cells, is_filled: false };
            }
            level += 1;
            cells = self.block(position, level);
        }
    }

    /// How many photons each ring holds together with those within it.
    fn rings(&self, position: Vec3, normal: Vec3, zone: Zone) -> [u32; RINGS] {
        let mut rings = [0; RINGS];
        let scale = RINGS as f32 / (zone.radius * zone.radius);
        self.for_each(position, normal, zone, |_, squared| rings[((squared * scale) as usize).min(RINGS - 1)] += 1);
        let mut sum = 0;
        rings.map(|count| {
            sum += count;
            sum
        })
    }

    /// The photons of a zone that are on the surface, and their squared distances.
    pub fn for_each(&self, position: Vec3, normal: Vec3, zone: Zone, mut see: impl FnMut(&'a Photon, f32)) {
        let most = zone.radius * zone.radius;
        // A cell that the surface's slab does not cross has none.
        let slab = FLATNESS * zone.radius + self.half_edge(zone.level) * normal.abs().element_sum() * LONGER;
        let edge = (1 << zone.level) as f32 / self.cube.cells_per_unit;
        for (cell, [first, end]) in self.cells(position, zone.level).into_iter().zip(zone.cells) {
            let middle = self.cube.corner + (cell.as_vec3() + 0.5) * edge;
            if first == end || (middle - position).dot(normal).abs() > slab {
                continue;
            }
            for photon in &self.photons[first as usize..end as usize] {
                let way = Vec3::from(photon.position) - position;
                let squared = way.length_squared();
                let counts = squared <= most && way.dot(normal).abs() <= FLATNESS * zone.radius && unpacked_ways(photon.ways)[0].dot(normal) >= LEAST_COSINE;
                if counts {
                    see(photon, squared);
                }
            }
        }
    }
}

/// Bits of a code below those that the table tells: its cells are 16 least cells wide.
const TABLE_BITS: u32 = 3 * 4;

/// Entries of the table.
pub const STARTS: usize = (1 << (3 * BITS - TABLE_BITS)) + 1;

/// The table for sorted codes.
pub fn starts(codes: &[u32]) -> Vec<u32> {
    let mut starts = vec![0; STARTS];
    codes.iter().for_each(|code| starts[(code >> TABLE_BITS) as usize + 1] += 1);
    let mut sum = 0;
    starts.iter_mut().for_each(|start| {
        sum += *start;
        *start = sum;
    });
    starts
}

/// Photons that lookups mostly ask for.
const USUAL: usize = 64;

/// The size of cells, by its logarithm, at which the cells next to a photon mostly hold what lookups ask for: four of the eight have some. `codes` are sorted.
pub fn usual_level(codes: impl Iterator<Item = u32> + Clone) -> u32 {
    let is_crowded = |level: &u32| {
        let (mut count, mut cells, mut last) = (0usize, 0usize, None);
        for code in codes.clone() {
            count += 1;
            let cell = Some(code >> (3 * level));
            cells += usize::from(cell != last);
            last = cell;
        }
        4 * count >= CROWD * USUAL * cells
    };
    (0..BITS).find(is_crowded).unwrap_or(BITS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash, unit};
    use crate::passes::photons::{sorted, ways};

    /// On the floor of a room, dense at one side, and on its ceiling.
    fn photons(count: u32) -> Vec<Photon> {
        let number = |at: u32| unit(hash(at));
        let photon = |at: u32| {
            let up = !at.is_multiple_of(4);
            let position = [10.0 * number(2 * at).powi(2), 10.0 * number(2 * at + 1), if up { 0.0 } else { 3.0 }];
            let normal = if up { Vec3::Z } else { Vec3::NEG_Z };
            Photon { position, leg: 1.0, flux: [1.0; 3], ways: ways(normal, normal) }
        };
        (0..count).map(photon).collect()
    }

    #[test]
    fn zones_hold_what_a_search_of_all_photons_finds() {
        let all = photons(20_000);
        let cube = Cube::around(Vec3::ZERO, Vec3::new(10.0, 10.0, 3.0));
        let (codes, kept): (Vec<u32>, Vec<Photon>) = sorted(all, cube, 1).into_iter().unzip();
        let level = usual_level(codes.iter().copied());
        let table = starts(&codes);
        let lookup = Lookup { cube, level, starts: &table, photons: &kept };
        for at in 0..200 {
            let position = Vec3::new(10.0 * unit(hash(7 * at + 70_001)), 10.0 * unit(hash(7 * at + 70_002)), 0.0);
            for (wanted, most) in [(1, f32::INFINITY), (64, f32::INFINITY), (64, 0.3), (100_000, f32::INFINITY)] {
                let zone = lookup.zone(position, Vec3::Z, wanted, most);
                let mut found = 0;
                lookup.for_each(position, Vec3::Z, zone, |_, _| found += 1);
                let on_floor = |photon: &&Photon| photon.position[2] == 0.0;
                let within = |radius: f32| kept.iter().filter(on_floor).filter(|p| Vec3::from(p.position).distance(position) <= radius).count();
                assert_eq!(found, within(zone.radius), "{wanted} within {most} at {position}: {zone:?}");
                assert!(zone.radius <= most);
                let is_all = found == within(f32::INFINITY) || zone.radius == most || !zone.is_filled;
                // A ring more than is needed at most.
                assert!(is_all || found * DETAIL as usize >= wanted as usize && found <= 3 * wanted as usize + 40, "{found} for {wanted} at {position}");
            }
        }
        let nothing = Lookup { cube, level: usual_level(std::iter::empty()), starts: &starts(&[]), photons: &[] };
        assert!(nothing.zone(Vec3::ONE, Vec3::Z, 64, 2.0).radius <= 2.0);
    }
}
