//! The sum of one tile in single precision, eight samples of a row side by side: [`super::sum::sum`] is what it must agree with.

use super::{
    colour::REC_709,
    hemisphere::{Edge, Table},
    sum::{Beside, Summed, Total},
    vectors::{LANES, Vectors, apart},
};
use fearless_simd::{Level, Select, Simd, dispatch, f32x8, prelude::*};
use glam::{DVec3, Vec4};

/// Groups that are added in single precision before their sum goes on in double: of more, all alike, each addition would round the same way, and
/// 512×512 samples of a furnace add up to 1e-4 too little.
const TOGETHER: usize = 512;

/// A table as it is summed with.
pub struct Cells {
    width: usize,
    height: usize,
    groups: Vec<Group>,
    /// [`Table::block_share`].
    block_share: f64,
    /// Walls between samples that are no neighbours in the picture, with their depths over their distances.
    seams: Vec<(Edge, [f64; 2])>,
}

/// What eight samples of a row stand for.
struct Group {
    row: usize,
    /// The first of its columns.
    column: usize,
    cosine_weight: [f32; LANES],
    plain_weight: [f32; LANES],
    rotation: [[f32; LANES]; 2],
    /// 1 over the cosine to the raster's axis; 0 for an unused sample.
    steepness: [f32; LANES],
    /// Of the blocks of four whose last sample each is, the weight; 0 where there is none.
    block_weight: [f32; LANES],
    /// Walls to the samples on the left and above.
    walls: [Walls; 2],
}

#[derive(Default)]
struct Walls {
    gradient: [[f32; LANES]; 3],
    /// xx, xy and yy.
    hessian: [[f32; LANES]; 3],
}

/// What of a tile is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wanted {
    /// Rotation and translation gradients.
    pub gradients: bool,
    /// Second derivatives; needs gradients.
    pub hessian: bool,
}

/// Room for one tile, by component, with a column of nothing on its left and a row above.
#[derive(Default)]
pub struct Room {
    red: Vec<f32>,
    green: Vec<f32>,
    blue: Vec<f32>,
    /// Of the depth.
    inverse: Vec<f32>,
}

impl Cells {
    pub fn new(table: &Table) -> Self {
        let (width, height) = (table.width as usize, table.height as usize);
        let rows = (0..height).flat_map(|row| (0..width).step_by(LANES).map(move |column| (row, column)));
        let groups = rows.map(|(row, column)| Group::new(table, row, column)).collect();
        let mut cells = Self { width, height, groups, block_share: table.block_share(), seams: Vec::new() };
        let of_sample = |at: usize| (at / width * width.div_ceil(LANES) + at % width / LANES, at % width % LANES);
        for last in table.blocks.iter().map(|last| *last as usize) {
            let (group, lane) = of_sample(last);
            cells.groups[group].block_weight[lane] = table.samples[last].cosine_weight as f32;
        }
        for edge in &table.edges {
            let at = edge.b as usize;
            let is_left = edge.b == edge.a + 1 && !at.is_multiple_of(width);
            if is_left || edge.b == edge.a + table.width {
                let (group, lane) = of_sample(at);
                cells.groups[group].walls[usize::from(!is_left)].put(lane, edge);
            } else {
                cells.seams.push((*edge, [edge.a, edge.b].map(|sample| table.samples[sample as usize].depth_cosine)));
            }
        }
        // The corners of a tile whose samples lie in a disc.
        cells.groups.retain(|group| group.steepness != [0.0; LANES]);
        cells
    }

    /// From a row to the next [places].
    fn pitch(&self) -> usize {
        self.width.next_multiple_of(LANES) + LANES
    }

    fn place(&self, row: usize, column: usize) -> usize {
        (row + 1) * self.pitch() + LANES + column
    }

    /// Sums a tile, as [`super::sum::sum`] does: red, green, blue and distance of each of the table's samples, `nearest` the least that a distance
    /// counts as. What is not wanted is 0.
    ///
    /// # Panics
    /// Where the tile has fewer samples than the table.
    pub fn sum(&self, tile: &[Vec4], nearest: f32, wanted: Wanted, room: &mut Room) -> Summed {
        let mut total = dispatch!(Level::new(), simd => self.add(simd, tile, nearest, wanted, room));
        for (seam, cosines) in self.seams.iter().filter(|_| wanted.gradients) {
            let beside = |sample: u32, cosine| Beside::new(tile[sample as usize].to_array(), cosine, f64::from(nearest));
            total.add_wall(seam, &beside(seam.a, cosines[0]), &beside(seam.b, cosines[1]));
        }
        total.finish(self.block_share)
    }

    #[inline(always)]
    fn add<S: Simd>(&self, simd: S, tile: &[Vec4], nearest: f32, wanted: Wanted, room: &mut Room) -> Total {
        room.fit((self.height + 1) * self.pitch() + LANES);
        let mut total = Total::default();
        for groups in self.groups.chunks(TOGETHER) {
            let mut sums = Sums::zero(simd);
            for group in groups {
                let at = self.place(group.row, group.column);
                let samples = &tile[group.row * self.width + group.column..][..LANES.min(self.width - group.column)];
                let seen = sums.add_samples(simd, group, samples, nearest, wanted);
                room.store(at, &seen);
                let [above, before, corner] = [at - self.pitch(), at - 1, at - self.pitch() - 1];
                sums.add_blocks(group, [room.radiance(simd, corner), room.radiance(simd, above), room.radiance(simd, before)], &seen.radiance);
                if wanted.gradients {
                    for (walls, neighbour) in group.walls.iter().zip([before, above]) {
                        sums.add_walls(walls, &room.load(simd, neighbour), &seen, wanted.hessian);
                    }
                }
            }
            total.join(&sums.total());
        }
        total
    }
}

impl Group {
    fn new(table: &Table, row: usize, column: usize) -> Self {
        let mut group = Self {
            row,
            column,
            cosine_weight: [0.0; LANES],
            plain_weight: [0.0; LANES],
            rotation: Default::default(),
            block_weight: [0.0; LANES],
            steepness: [0.0; LANES],
            walls: Default::default(),
        };
        let samples = &table.samples[row * table.width as usize..][column..(column + LANES).min(table.width as usize)];
        for (lane, sample) in samples.iter().enumerate().filter(|(_, sample)| sample.plain_weight > 0.0) {
            group.cosine_weight[lane] = sample.cosine_weight as f32;
            group.plain_weight[lane] = sample.plain_weight as f32;
            group.rotation[0][lane] = sample.rotation[0] as f32;
            group.rotation[1][lane] = sample.rotation[1] as f32;
            group.steepness[lane] = (1.0 / sample.depth_cosine) as f32;
        }
        group
    }
}

impl Walls {
    fn put(&mut self, lane: usize, edge: &Edge) {
        for axis in 0..3 {
            self.gradient[axis][lane] = edge.gradient[axis] as f32;
            self.hessian[axis][lane] = edge.hessian[axis] as f32;
        }
    }
}

/// Radiance and inverse depth of eight samples.
struct Seen<S: Simd> {
    radiance: Vectors<S>,
    inverse: f32x8<S>,
}

impl Room {
    /// What no group is stored to stays 0: the column on the left, the row above, and the corners.
    #[inline(always)]
    fn fit(&mut self, places: usize) {
        if self.red.len() != places {
            for plane in [&mut self.red, &mut self.green, &mut self.blue, &mut self.inverse] {
                *plane = vec![0.0; places];
            }
        }
    }

    #[inline(always)]
    fn store<S: Simd>(&mut self, at: usize, seen: &Seen<S>) {
        seen.radiance.x.store_slice(&mut self.red[at..at + LANES]);
        seen.radiance.y.store_slice(&mut self.green[at..at + LANES]);
        seen.radiance.z.store_slice(&mut self.blue[at..at + LANES]);
        seen.inverse.store_slice(&mut self.inverse[at..at + LANES]);
    }

    #[inline(always)]
    fn load<S: Simd>(&self, simd: S, at: usize) -> Seen<S> {
        Seen { radiance: self.radiance(simd, at), inverse: f32x8::from_slice(simd, &self.inverse[at..at + LANES]) }
    }

    #[inline(always)]
    fn radiance<S: Simd>(&self, simd: S, at: usize) -> Vectors<S> {
        let load = |plane: &[f32]| f32x8::from_slice(simd, &plane[at..at + LANES]);
        Vectors { x: load(&self.red), y: load(&self.green), z: load(&self.blue) }
    }
}

/// Eight sums side by side of all that a tile adds up to.
struct Sums<S: Simd> {
    irradiance: Vectors<S>,
    /// Of the blocks' mixed differences times their weights.
    squares: Vectors<S>,
    /// x and y of each channel.
    rotation: [[f32x8<S>; 2]; 3],
    /// Of each channel.
    translation: [Vectors<S>; 3],
    hessian: Vectors<S>,
    /// Weight and weight over distance, in the cosine and in the plain measure.
    cosine: [f32x8<S>; 2],
    plain: [f32x8<S>; 2],
    largest_inverse: f32x8<S>,
}

// All that runs within `dispatch!` is inlined into it.
impl<S: Simd> Sums<S> {
    #[inline(always)]
    fn zero(simd: S) -> Self {
        let zero = f32x8::splat(simd, 0.0);
        let none = Vectors { x: zero, y: zero, z: zero };
        Self {
            irradiance: none,
            squares: none,
            rotation: [[zero; 2]; 3],
            translation: [none; 3],
            hessian: none,
            cosine: [zero; 2],
            plain: [zero; 2],
            largest_inverse: zero,
        }
    }

    #[inline(always)]
    fn add_samples(&mut self, simd: S, group: &Group, samples: &[Vec4], nearest: f32, wanted: Wanted) -> Seen<S> {
        let [red, green, blue, distance] = apart(simd, samples, 0);
        let [zero, steepness] = [f32x8::splat(simd, 0.0), f32x8::load_array_ref(simd, &group.steepness)];
        let is_used = steepness.simd_gt(zero);
        let inverse = is_used.select(1.0 / distance.max(nearest), zero);
        let radiance = Vectors { x: is_used.select(red, zero), y: is_used.select(green, zero), z: is_used.select(blue, zero) };
        let [cosine, plain] = [f32x8::load_array_ref(simd, &group.cosine_weight), f32x8::load_array_ref(simd, &group.plain_weight)];
        self.irradiance = self.irradiance.plus(radiance.scaled(cosine));
        self.cosine = [self.cosine[0] + cosine, inverse.mul_add(cosine, self.cosine[1])];
        self.plain = [self.plain[0] + plain, inverse.mul_add(plain, self.plain[1])];
        self.largest_inverse = self.largest_inverse.max(inverse);
        if wanted.gradients {
            let turns = [f32x8::load_array_ref(simd, &group.rotation[0]), f32x8::load_array_ref(simd, &group.rotation[1])];
            for (sums, channel) in self.rotation.iter_mut().zip([radiance.x, radiance.y, radiance.z]) {
                *sums = [turns[0].mul_add(channel, sums[0]), turns[1].mul_add(channel, sums[1])];
            }
        }
        Seen { radiance, inverse: inverse * steepness }
    }

    /// Blocks of four samples: the corner's, those above, those before, and their last ones.
    #[inline(always)]
    fn add_blocks(&mut self, group: &Group, [corner, above, before]: [Vectors<S>; 3], last: &Vectors<S>) {
        let mixed = corner.minus(above).minus(before.minus(*last)).scaled(f32x8::load_array_ref(corner.x.simd, &group.block_weight));
        self.squares =
            Vectors { x: mixed.x.mul_add(mixed.x, self.squares.x), y: mixed.y.mul_add(mixed.y, self.squares.y), z: mixed.z.mul_add(mixed.z, self.squares.z) };
    }

    #[inline(always)]
    fn add_walls(&mut self, walls: &Walls, a: &Seen<S>, b: &Seen<S>, bends: bool) {
        let inverse = a.inverse.max(b.inverse);
        let step = b.radiance.minus(a.radiance).scaled(inverse);
        let gradient = Vectors::load(inverse.simd, &walls.gradient);
        for (sum, channel) in self.translation.iter_mut().zip([step.x, step.y, step.z]) {
            *sum = Vectors { x: gradient.x.mul_add(channel, sum.x), y: gradient.y.mul_add(channel, sum.y), z: gradient.z.mul_add(channel, sum.z) };
        }
        if bends {
            let change = step.product(REC_709.as_vec3()) * inverse;
            self.hessian = self.hessian.plus(Vectors::load(inverse.simd, &walls.hessian).scaled(change));
        }
    }

    #[inline(always)]
    fn total(self) -> Total {
        let all = |v: f32x8<S>| v.to_array().iter().map(|x| f64::from(*x)).sum::<f64>();
        let vector = |v: Vectors<S>| DVec3::new(all(v.x), all(v.y), all(v.z));
        Total {
            irradiance: vector(self.irradiance),
            squares: vector(self.squares),
            rotation: self.rotation.map(|[x, y]| DVec3::new(all(x), all(y), 0.0)),
            translation: self.translation.map(vector),
            hessian: vector(self.hessian),
            cosine: self.cosine.map(all),
            plain: self.plain.map(all),
            largest_inverse: self.largest_inverse.to_array().into_iter().fold(0.0, f32::max).into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{
        hemisphere::{Method, Shape},
        oracle::{Objects, place, tile, trace},
        sum::sum,
    };

    /// All that is summed, as numbers.
    fn numbers(s: &Summed) -> Vec<DVec3> {
        let means = DVec3::new(s.harmonic_mean_cosine, s.harmonic_mean_plain, s.min_distance).map(|distance| distance.min(1e20));
        [vec![s.irradiance, s.error, means, s.hessian], s.rotation.to_vec(), s.translation.to_vec()].concat()
    }

    /// As many as a tile may have, all alike: each addition to a large sum rounds the same way.
    #[test]
    fn many_samples_alike_add_up() {
        let table = Table::new(Shape::Concentric, 512, Method::None).expect("a table");
        let tile = vec![Vec4::ONE; table.samples.len()];
        let found = Cells::new(&table).sum(&tile, 0.05, Wanted { gradients: false, hessian: false }, &mut Room::default()).irradiance.x;
        assert!((found - std::f64::consts::PI).abs() < 2e-5, "{found}");
    }

    #[test]
    fn sums_agree_with_those_in_double_precision() {
        let shapes = [
            (Shape::Hemispherical, 40),
            (Shape::Hemispherical, 13),
            (Shape::Cosine, 24),
            (Shape::Hemicube, 10),
            (Shape::Plane { fov_degrees: 126.87 }, 20),
            (Shape::Cosine, 4),
            (Shape::Concentric, 16),
            (Shape::Concentric, 13),
        ];
        let wanted = Wanted { gradients: true, hessian: true };
        for (shape, resolution) in shapes {
            let table = Table::new(shape, resolution, Method::BorderExtension).expect("a table");
            let (cells, mut room) = (Cells::new(&table), Room::default());
            for i in 0..20 {
                let (point, frame) = place(i);
                let objects = Objects { occluder: true, wall: true };
                let mut texels = tile(&table, |direction| trace(point, frame.to_world(direction.as_vec3()).as_dvec3(), objects));
                for (texel, sample) in texels.iter_mut().zip(&table.samples) {
                    if sample.plain_weight == 0.0 {
                        *texel = [f32::NAN; 4];
                    }
                    texel[1] *= 0.3;
                    texel[2] = 1.0 - texel[2];
                }
                let expected = numbers(&sum(&table, &texels, 0.05).expect("fits"));
                let texels: Vec<Vec4> = texels.into_iter().map(Vec4::from).collect();
                let found = cells.sum(&texels, 0.05, wanted, &mut room);
                for (found, expected) in numbers(&found).into_iter().zip(&expected) {
                    let scale = expected.length().max(1e-3);
                    assert!((found - *expected).length() < 1e-4 * scale, "{shape:?} {resolution} {i}: {found}, not {expected}");
                }
                let plain = cells.sum(&texels, 0.05, Wanted { gradients: false, hessian: false }, &mut room);
                assert_eq!(numbers(&plain)[4..], [DVec3::ZERO; 6]);
                assert!((plain.irradiance - expected[0]).length() < 1e-4 * expected[0].length());
            }
        }
    }
}
