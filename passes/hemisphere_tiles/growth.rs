//! Tiles that are finer where coarse ones are not sure of their sum.
//!
//! A tile's own samples may not tell how fine it is to be: where chance shows much light, the sum would be mended, and where it shows none, not; the mean would be
//! too dark (Kirk and Arvo 1991). So tiles tell others beside them.

use super::cells::Cells;
use crate::math::{
    colour::REC_709,
    hemisphere::{Method, Shape, Table},
    uncertainty::Uncertainty,
};
use crate::passes::record::Request;
use crate::scene::packets::RayBundle;
use glam::Vec4;
use std::collections::HashSet;

/// How sure tiles are to be.
pub(super) struct Growth {
    /// Largest standard error of a tile's sum, as a share of it.
    quality: f32,
    /// Samples along an edge.
    resolution: u32,
    /// The rays of finer tiles: of those twice as fine along an edge, of those twice as fine as these, and so on. Never empty.
    finer: Vec<RayBundle>,
}

/// What tiles have told.
pub(super) struct Told {
    /// Of each size, the smallest first.
    cells: [Cells<Errors>; CELLS.len()],
    /// How many of the tiles were finer.
    pub finer: u32,
}

/// Edges of cells, as shares of the scene's extent.
const CELLS: [f32; 3] = [0.025, 0.1, 0.4];

/// Of some tiles.
#[derive(Default)]
struct Errors {
    tiles: f32,
    /// Sum of what they would be wrong by in the square, were they no finer.
    squares: f32,
    /// Sum of [`Uncertainty::power`].
    powers: f32,
}

impl Growth {
    /// Of tiles of so many samples along an edge, which may be up to `finest` times as fine; None where tiles may not be twice as fine.
    pub fn new(quality: f32, resolution: u32, finest: u32) -> Option<Self> {
        let times = (1..).map(|level| 1 << level).take_while(|times| *times <= finest);
        let tables = times.map_while(|times| Table::new(Shape::Concentric, times * resolution, Method::None).ok());
        let finer: Vec<RayBundle> = tables.map(|table| RayBundle::new(&table)).collect();
        (!finer.is_empty()).then_some(Self { quality, resolution, finer })
    }

    /// How many times as fine the tile of a place is to be: as fine as makes it sure enough.
    pub fn times(&self, told: &Told, place: &Request) -> u32 {
        let Some(errors) = told.cells.iter().find_map(|cells| cells.at(place)) else { return 1 };
        let all = Uncertainty { error: (errors.squares / errors.tiles).sqrt(), power: errors.powers / errors.tiles };
        let finest = 1 << self.finer.len();
        (0..self.finer.len()).map(|level| 1u32 << level).find(|times| all.refined(*times as f32) <= self.quality).unwrap_or(finest)
    }

    /// The rays of a tile so many times as fine; `plain` are those of one that is not.
    pub fn bundle<'b>(&'b self, times: u32, plain: &'b RayBundle) -> &'b RayBundle {
        times.ilog2().checked_sub(1).map_or(plain, |level| &self.finer[level as usize])
    }

    /// What a tile so many times as fine saw, in the strata of one as fine as others: the mean radiance of each, and the harmonic mean distance.
    pub fn joined(&self, times: u32, fine: Vec<Vec4>) -> Vec<Vec4> {
        if times == 1 {
            return fine;
        }
        let (edge, times) = (self.resolution as usize, times as usize);
        let mut sums = vec![Vec4::ZERO; edge * edge];
        for (row, samples) in fine.chunks_exact(edge * times).enumerate() {
            for (column, samples) in samples.chunks_exact(times).enumerate() {
                sums[row / times * edge + column] += samples.iter().map(|seen| seen.truncate().extend(seen.w.recip())).sum::<Vec4>();
            }
        }
        let rays = (times * times) as f32;
        sums.into_iter().map(|sum| (sum.truncate() / rays).extend(rays / sum.w)).collect()
    }

    /// How sure a tile is that saw this so many times as fine. `more` tells how many rays besides one each stratum is worth, or is empty.
    pub fn uncertainty(&self, times: u32, fine: &[Vec4], more: &[u32]) -> Uncertainty {
        let light: Vec<f32> = fine.iter().map(|seen| seen.truncate().dot(REC_709.as_vec3())).collect();
        let (edge, rows) = (self.resolution as usize, times as usize);
        let share = |more: &u32| ((times * times) as f32 / (1 + more) as f32).min(1.0);
        let of_row = |row: usize| more[row / rows * edge..][..edge].iter().flat_map(|more| std::iter::repeat_n(share(more), rows));
        let shares: Vec<f32> = if more.is_empty() { Vec::new() } else { (0..edge * rows).flat_map(of_row).collect() };
        Uncertainty::of(edge * rows, &light, &shares)
    }
}

impl Told {
    /// In a scene of such an extent [scene units].
    pub fn nothing(extent: f32) -> Self {
        Self { cells: CELLS.map(|edge| Cells::new(edge * extent)), finer: 0 }
    }

    /// In which order places are looked at, by their numbers: first one in each of the largest cells that nothing is known of, then one in each of the next
    /// smaller, so that nearly all are told something, then the rest.
    pub fn waves(&self, places: &[Request]) -> Vec<Vec<usize>> {
        let mut rest: Vec<usize> = (0..places.len()).collect();
        let mut waves = Vec::new();
        for cells in self.cells[1..].iter().rev() {
            let mut seen: HashSet<_> = waves.iter().flatten().map(|number: &usize| cells.of(&places[*number])).collect();
            let (first, others) = rest.into_iter().partition(|number| cells.is_first(&places[*number], &mut seen));
            waves.push(first);
            rest = others;
        }
        waves.push(rest);
        waves
    }

    /// How sure the tile of a place was, so many times as fine.
    pub fn learn(&mut self, place: &Request, times: u32, uncertainty: Uncertainty) {
        // What sees no light may be wrong by all of what there is.
        let square = uncertainty.refined(1.0 / times as f32).min(1.0).powi(2);
        self.finer += u32::from(times > 1);
        for cells in &mut self.cells {
            let errors = cells.entry(place).or_default();
            errors.tiles += 1.0;
            errors.squares += square;
            errors.powers += uncertainty.power;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash, unit};
    use glam::Vec3;

    fn growth(quality: f32, resolution: u32) -> Growth {
        Growth::new(quality, resolution, 2).expect("small enough")
    }

    #[test]
    fn tiles_as_fine_as_may_be_do_not_grow() {
        assert!(Growth::new(0.1, 256, 8).is_some_and(|growth| growth.finer.len() == 1) && Growth::new(0.1, 257, 8).is_none());
    }

    #[test]
    fn tiles_are_as_fine_as_makes_them_sure() {
        for (finest, expected) in [(2, [1, 2, 2, 2, 2]), (4, [1, 2, 4, 4, 4]), (7, [1, 2, 4, 4, 4]), (8, [1, 2, 4, 8, 8])] {
            let growth = Growth::new(0.1, 8, finest).expect("small enough");
            let times = [0.1, 0.19, 0.39, 0.41, 0.9].map(|error| {
                let mut told = Told::nothing(100.0);
                told.learn(&place(0.0, Vec3::Z), 1, wrong_by(error));
                growth.times(&told, &place(0.1, Vec3::Z))
            });
            assert_eq!(times, expected, "{finest}");
            let plain = RayBundle::new(&Table::new(Shape::Concentric, 8, Method::None).expect("a table"));
            assert_eq!(times.map(|times| growth.bundle(times, &plain).samples), times.map(|times| 64 * (times * times) as usize));
        }
    }

    /// A place along x, in a scene whose extent is 100.
    fn place(x: f32, normal: Vec3) -> Request {
        Request::new(Vec3::new(x, 0.0, 0.0), 1.0, normal, 0.0)
    }

    fn wrong_by(error: f32) -> Uncertainty {
        Uncertainty { error, power: 1.0 }
    }

    #[test]
    fn strata_hold_the_mean_of_their_finer_samples() {
        let (edge, times) = (5, 2);
        let stratum = |at: usize| at / (edge * times) / times * edge + at % (edge * times) / times;
        let sample = |at: usize| {
            let light = stratum(at) as f32 + [0.5, -0.5][at % 2];
            Vec3::new(light, 2.0 * light, 7.0).extend(if at.is_multiple_of(2) { 1.0 } else { 3.0 })
        };
        let fine: Vec<Vec4> = (0..(edge * times).pow(2)).map(sample).collect();
        let joined = growth(0.1, edge as u32).joined(times as u32, fine);
        assert_eq!(joined.len(), edge * edge);
        for (at, seen) in joined.into_iter().enumerate() {
            let light = at as f32;
            assert!((seen - Vec4::new(light, 2.0 * light, 7.0, 1.5)).abs().max_element() < 1e-5, "{at}: {seen}");
        }
    }

    #[test]
    fn strata_with_more_rays_are_surer() {
        let growth = growth(0.1, 6);
        let bright = 3 * 6 + 2;
        let light = |times: usize| {
            let edge = 6 * times;
            let is_bright = |at: usize| at / edge / times * 6 + at % edge / times == bright;
            (0..edge * edge).map(move |at| Vec4::splat(if is_bright(at) { 1.0 + (at % 2) as f32 } else { 0.01 })).collect::<Vec<Vec4>>()
        };
        let near = |at: usize| (at % 6).abs_diff(bright % 6) <= 2 && (at / 6).abs_diff(bright / 6) <= 2;
        let more: Vec<u32> = (0..36).map(|at| if near(at) { 15 } else { 0 }).collect();
        for (times, expected) in [(1, 0.25), (2, 0.5)] {
            let error = |more: &[u32]| growth.uncertainty(times as u32, &light(times), more).error;
            assert!((error(&more) / error(&[]) - expected).abs() < 1e-4, "{times}");
        }
    }

    #[test]
    fn tiles_are_as_fine_as_those_beside_them_say() {
        let (growth, mut told) = (growth(0.1, 8), Told::nothing(100.0));
        assert_eq!(growth.times(&told, &place(0.0, Vec3::Z)), 1);
        told.learn(&place(0.0, Vec3::Z), 1, wrong_by(0.3));
        // Those in the largest cell know nothing nearer; those that face elsewhere know nothing at all.
        let times = |told: &Told, x: f32, normal: Vec3| growth.times(told, &place(x, normal));
        assert_eq!([0.5, 3.0, 15.0, 30.0].map(|x| times(&told, x, Vec3::Z)), [2, 2, 2, 1]);
        assert_eq!(times(&told, 0.0, Vec3::X), 1);
        // What is nearer counts.
        told.learn(&place(3.0, Vec3::Z), 1, wrong_by(0.05));
        assert_eq!([0.0, 3.0].map(|x| times(&told, x, Vec3::Z)), [2, 1]);
        // A tile that is finer has told of tiles that are not.
        told.learn(&place(-12.0, Vec3::Z), 2, wrong_by(0.06));
        assert_eq!(times(&told, -12.0, Vec3::Z), 2);
        told.learn(&place(12.0, Vec3::Z), 2, wrong_by(0.04));
        assert_eq!((times(&told, 12.0, Vec3::Z), told.finer), (1, 2));
        // Nobody knows what is in the dark.
        told.learn(&place(100.0, Vec3::Z), 1, Uncertainty::UNKNOWN);
        assert_eq!(times(&told, 100.0, Vec3::Z), 2);
    }

    #[test]
    fn the_first_places_of_large_cells_come_first() {
        let mut told = Told::nothing(100.0);
        let places: Vec<Request> = [0.0, 1.0, 9.0, 45.0, 46.0, 200.0, 9.5, 0.1].map(|x| place(x, Vec3::Z)).into();
        assert_eq!(told.waves(&places), [vec![0, 3, 5], vec![2], vec![1, 4, 6, 7]]);
        told.learn(&places[3], 1, wrong_by(0.1));
        assert_eq!(told.waves(&places), [vec![0, 5], vec![2], vec![1, 3, 4, 6, 7]]);
    }

    /// Were a tile to say how fine it is itself to be, the mean would lack some of the light.
    #[test]
    fn finer_tiles_change_no_mean() {
        let growth = growth(0.3, 6);
        let mut drawn = 0;
        let mut tile = |times: u32| {
            let mut sample = || {
                drawn += 1;
                Vec4::splat(if unit(hash(drawn)) < 0.03 { 1.0 / 0.03 } else { 0.0 })
            };
            (0..36 * times * times).map(|_| sample()).collect::<Vec<Vec4>>()
        };
        let (mut sums, mut finer) = ([0.0, 0.0], 0);
        const CELLS: u32 = 6000;
        for cell in 0..CELLS {
            let mut told = Told::nothing(100.0);
            for number in 0..3 {
                let here = place(100.0 * cell as f32 + 0.1 * number as f32, Vec3::Z);
                let times = growth.times(&told, &here);
                let seen = tile(times);
                told.learn(&here, times, growth.uncertainty(times, &seen, &[]));
                let mean = growth.joined(times, seen).iter().map(|seen| f64::from(seen.x)).sum::<f64>() / 36.0;
                sums = [sums[0] + mean, sums[1] + mean * mean];
                finer += u32::from(times > 1);
            }
        }
        let tiles = f64::from(3 * CELLS);
        let (mean, squares) = (sums[0] / tiles, sums[1] / tiles);
        let deviation = ((squares - mean * mean) / tiles).sqrt();
        assert!((mean - 1.0).abs() < 4.0 * deviation && deviation < 0.01, "{mean} ± {deviation}");
        assert!((CELLS / 4..3 * CELLS - CELLS / 4).contains(&finer), "{finer}");
    }
}
