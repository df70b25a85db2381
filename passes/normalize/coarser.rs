//! Light for pixels that miss a record as the time of a frame is up, or as no record covers them. No record depends on the accuracy, so the same ones are splatted there by coarser and
//! coarser ones, each twice the one before, until every pixel is covered.
//!
//! Each accuracy hands over to the next as its weights fade out, so that no rim of a record shows. Pixels that miss nothing keep their light.

use crate::contract::{Recorder, port};
use crate::math::{
    harmonics::{
        Harmonics,
        reflection::{LobeTable, table_fours},
    },
    projection::{Pinhole, PixelRectangle},
    weight::{Reaching, Record, Rule},
};
use crate::passes::contribution::{
    bands::{self, Contribution},
    irradiance::Seen,
    radiance::{Placed, Reflection, fours},
};
use crate::passes::record::{RECORD_BYTES, Record as HostRecord, pinhole};
use crate::recording::*;
use bytemuck::cast_slice;
use glam::{Vec3, Vec4, Vec4Swizzles};
use rayon::prelude::*;
use std::sync::Arc;

/// Weights of a coarser accuracy that add up to so much leave nothing to the next one.
const ENOUGH: f32 = 0.2;

/// A pixel is done when no more than this share of its light is open.
const LITTLE: f32 = 0.01;

/// The coarsest accuracy over the stated one: far beyond what covers any scene.
const MOST_TIMES: f32 = 1e12;

pub(super) fn record(r: &mut Recorder<'_>, splats: &port::Splats, gbuffer: &port::GBuffer) {
    let [pixels, coarsest] = ["coarse_pixels", "coarsest"].map(|name| r.variable(name, false));
    r.report_variable("coarse_pixels", pixels);
    r.report_variable("coarsest", coarsest);
    let (size, sums, gbuffer, cache) = (r.setting.size, splats.sums, *gbuffer, splats.cache);
    let lobes = splats.lobes.clone().zip(cache.coefficients);
    let mut reads = vec![Read::whole(gbuffer.position), Read::whole(gbuffer.normal), Read::whole(sums)];
    reads.push(Read::counted(cache.records, RECORD_BYTES, cache.count));
    if let Some((visible, of_record)) = &lobes {
        reads.extend([Read::whole(visible.seen), Read::whole(visible.lobes.values)]);
        reads.push(Read::counted(of_record.values, port::Coefficients::bytes(of_record.order, of_record.precision), cache.count));
    }
    let run = move |host: &mut dyn HostContext| {
        let records: Vec<Record> = cast_slice::<_, HostRecord>(host.read(cache.records)).iter().map(Record::from).collect();
        let scene = Scene {
            camera: pinhole(host),
            rule: &cache.rule,
            records: &records,
            positions: cast_slice(host.read(gbuffer.position)),
            normals: cast_slice(host.read(gbuffer.normal)),
        };
        let mut closed: Vec<Vec4> = cast_slice(host.read(sums)).to_vec();
        let mut gaps = Gaps::find(size, scene.positions, &closed, cache.rule.overlap);
        let all = gaps.open.len();
        if all == 0 || records.is_empty() {
            return Ok(());
        }
        let times = match &lobes {
            None => gaps.close(&mut closed, |gaps, times| scene.irradiance(gaps, times)),
            Some((visible, of_record)) => {
                let values = fours(host.read(of_record.values), of_record.precision, &records);
                let glossy = Glossy {
                    seen: cast_slice(host.read(visible.seen)),
                    lobes: tables(&visible.lobes, cast_slice(host.read(visible.lobes.values))),
                    planes: values.chunks_exact(port::Coefficients::fours(of_record.order) as usize).collect(),
                };
                gaps.close(&mut closed, |gaps, times| scene.radiance(gaps, times, &glossy))
            }
        };
        host.put(sums, closed, u64::MAX);
        host.set(pixels, (all - gaps.open.len()) as u32);
        host.set(coarsest, times as u32);
        Ok(())
    };
    r.command(Command::Late(Host { name: "splat_coarser", reads, writes: vec![sums], run: Arc::new(run) }));
}

/// The lobes' tables, from one after the other.
fn tables(lobes: &port::Lobes, mut values: &[Vec4]) -> Vec<LobeTable> {
    let table = |order: &u32| {
        let (own, others) = values.split_at_checked(table_fours(*order as usize, lobes.edge as usize))?;
        values = others;
        Some(LobeTable { harmonics: Harmonics::Hemispherical, order: *order as usize, edge: lobes.edge as usize, values: own.to_vec() })
    };
    lobes.orders.iter().map_while(table).collect()
}

/// What the pixels see, and the records.
struct Scene<'a> {
    camera: Pinhole,
    rule: &'a Rule,
    records: &'a [Record],
    positions: &'a [Vec4],
    normals: &'a [Vec4],
}

/// What turns records into radiance.
struct Glossy<'a> {
    seen: &'a [Vec4],
    lobes: Vec<LobeTable>,
    /// Coefficients of each record.
    planes: Vec<&'a [Vec4]>,
}

impl Scene<'_> {
    /// Weighted sums of irradiance at the gaps, by an accuracy so many times the stated one.
    fn irradiance(&self, gaps: &Gaps, times: f32) -> Vec<Vec4> {
        let [positions, normals] = [self.positions, self.normals].map(|of_all| gaps.of(of_all));
        gaps.sums(&self.placed(times, |_, record| record), &Seen { positions: &positions, normals: &normals })
    }

    /// The same of radiance toward the camera.
    fn radiance(&self, gaps: &Gaps, times: f32, glossy: &Glossy<'_>) -> Vec<Vec4> {
        let [positions, normals, seen] = [self.positions, self.normals, glossy.seen].map(|of_all| gaps.of(of_all));
        let placed = self.placed(times, |number, record| Placed { record, planes: glossy.planes[number] });
        let reflection = Reflection { positions: &positions, normals: &normals, seen: &seen, eye: self.camera.eye, lobes: &glossy.lobes, tilting: None };
        gaps.sums(&placed, &reflection)
    }

    /// The records that reach into the picture, and the pixels that they may reach.
    fn placed<'r, R>(&'r self, times: f32, with: impl Fn(usize, Reaching<'r>) -> R) -> Vec<(PixelRectangle, R)> {
        let place = |(number, record): (usize, &'r Record)| {
            let reaching = self.rule.coarsely(record, times);
            Some((self.camera.bounds(record.position, reaching.longest_reach() * 1.0001)?, with(number, reaching)))
        };
        self.records.iter().enumerate().filter_map(place).collect()
    }
}

/// Pixels that miss a record.
struct Gaps {
    /// Of the picture.
    size: [u32; 2],
    /// In the order of pixels.
    open: Vec<Gap>,
}

#[derive(Clone, Copy)]
struct Gap {
    pixel: usize,
    /// Of the accuracies so far, as far as it is not open.
    light: Vec3,
    /// The share that is left to coarser accuracies.
    open: f32,
    /// Σ w, of coarser accuracies in proportion less.
    weight: f32,
}

impl Gaps {
    /// Pixels that see something, and whose weights add up to `overlap` or less.
    fn find(size: [u32; 2], positions: &[Vec4], sums: &[Vec4], overlap: f32) -> Self {
        let gap = |(pixel, (place, sum)): (usize, (&Vec4, &Vec4))| {
            let misses = place.w > 0.0 && sum.w <= overlap && sum.is_finite();
            misses.then(|| Gap { pixel, light: Vec3::ZERO, open: 1.0, weight: 0.0 }.with(*sum, overlap, 1.0))
        };
        Self { size, open: positions.iter().zip(sums).enumerate().filter_map(gap).collect() }
    }

    /// Closes the gaps in the sums by what coarser accuracies have for them; how many times the stated one the last one was.
    fn close(&mut self, sums: &mut [Vec4], estimate: impl Fn(&Self, f32) -> Vec<Vec4>) -> f32 {
        let mut times = 1.0;
        while !self.open.is_empty() && times < MOST_TIMES {
            times *= 2.0;
            let coarser = estimate(self, times);
            self.open.par_iter_mut().zip(coarser).for_each(|(gap, sum)| *gap = gap.with(sum, ENOUGH, times));
            self.open.extract_if(.., |gap| gap.open <= LITTLE).for_each(|gap| sums[gap.pixel] = gap.sum());
        }
        times
    }

    /// Of the values of all pixels those of the gaps.
    fn of(&self, all: &[Vec4]) -> Vec<Vec4> {
        self.open.par_iter().map(|gap| all[gap.pixel]).collect()
    }

    /// What records add up to at the gaps; the contribution knows pixels by their number among these.
    fn sums<C: Contribution>(&self, placed: &[(PixelRectangle, C::Record)], contribution: &C) -> Vec<Vec4> {
        let [width, height] = self.size;
        let mut before = vec![0_u32; (width * height) as usize + 1];
        self.open.iter().for_each(|gap| before[gap.pixel + 1] = 1);
        (1..before.len()).for_each(|pixel| before[pixel] += before[pixel - 1]);
        let mut images = [vec![Vec4::ZERO; self.open.len()]];
        bands::add_some(self.size, placed, &mut images, contribution, &|pixel| before[pixel] as usize);
        let [sums] = images;
        sums
    }
}

impl Gap {
    /// With the sum of an accuracy so many times the stated one, of which a weight of `enough` leaves nothing open.
    fn with(self, sum: Vec4, enough: f32, times: f32) -> Self {
        if sum.w <= 0.0 {
            return self;
        }
        let share = self.open * (sum.w / enough).min(1.0);
        Self { light: self.light + sum.xyz() / sum.w * share, open: self.open - share, weight: self.weight + sum.w / times, ..self }
    }

    /// Its light as a sum of splats.
    fn sum(&self) -> Vec4 {
        (self.light / (1.0 - self.open)).extend(1.0) * self.weight
    }
}
