//! Light for pixels that miss a record as the time of a frame is up, or as no record covers them. No record depends on the accuracy, so the same ones are splatted there by coarser and
//! coarser ones, each twice the one before, until every pixel is covered.
//!
//! Each accuracy hands over to the next as its weights fade out, so that no rim of a record shows. Pixels that miss nothing keep their light.

use crate::contract::{Encoder, port};
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
use crate::schedule::*;
use bytemuck::cast_slice;
use glam::{Vec3, Vec4, Vec4Swizzles};
use rayon::prelude::*;

/// Weights of a coarser accuracy that add up to so much leave nothing to the next one.
const ENOUGH: f32 = 0.2;

/// A pixel is done when no more than this share of its light is open.
const LITTLE: f32 = 0.01;

/// The coarsest accuracy over the stated one: far beyond what covers any scene.
const MOST_TIMES: f32 = 1e12;

pub(super) fn encode(e: &mut Encoder<'_>, splats: &port::Splats, gbuffer: &port::GBuffer) {
    let [pixels, coarsest] = ["coarse_pixels", "coarsest"].map(|name| e.variable(name, false));
    e.report_variable("coarse_pixels", pixels);
    e.report_variable("coarsest", coarsest);
    let (size, sums, gbuffer, cache) = (gbuffer.size, splats.sums, *gbuffer, splats.cache);
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
    e.command(Command::Late(Host::new("splat_coarser", reads, vec![sums], run)));
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
            Some((self.camera.bounds(record.position, reaching.longest_validity_radius() * 1.0001)?, with(number, reaching)))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::passes::mock;

    const OVERLAP: f32 = 0.5;

    /// A sum of splats of this light and weight.
    fn sum(light: Vec3, weight: f32) -> Vec4 {
        light.extend(1.0) * weight
    }

    fn gap(pixel: usize) -> Gap {
        Gap { pixel, light: Vec3::ZERO, open: 1.0, weight: 0.0 }
    }

    fn close_to(found: Vec4, expected: Vec4) {
        assert!((found - expected).abs().max_element() < 1e-5, "{found} is not {expected}");
    }

    #[test]
    fn gaps_are_where_something_is_seen_and_little_weight() {
        let light = Vec3::new(4.0, 6.0, 8.0);
        let (seen, unseen) = (Vec4::ONE, Vec4::new(1.0, 1.0, 1.0, 0.0));
        let cases = [
            (seen, sum(light, 0.2), true),
            (unseen, sum(light, 0.2), false),
            (seen, sum(light, OVERLAP), true),
            (seen, sum(light, 0.6), false),
            (seen, Vec4::ZERO, true),
            (unseen, sum(light, 0.6), false),
            (seen, Vec4::new(f32::NAN, 0.0, 0.0, 0.2), false),
        ];
        let (positions, sums): (Vec<_>, Vec<_>) = cases.iter().map(|(place, sum, _)| (*place, *sum)).unzip();
        let gaps = Gaps::find([7, 1], &positions, &sums, OVERLAP);
        assert!(gaps.open.iter().map(|gap| gap.pixel).eq(cases.iter().enumerate().filter(|(_, case)| case.2).map(|(pixel, _)| pixel)));
        // What a sum lacks of the weight stays open.
        let [some, all, none] = gaps.open[..] else { panic!("three gaps") };
        assert_eq!([some.open, all.open, none.open], [0.6, 0.0, 1.0]);
        close_to(some.light.extend(some.weight), (light * 0.4).extend(0.2));
        close_to(none.light.extend(none.weight), Vec4::ZERO);
        assert_eq!(gaps.of(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0].map(Vec4::splat)), [1.0, 3.0, 5.0].map(Vec4::splat));
    }

    #[test]
    fn each_accuracy_takes_its_share_of_what_is_open() {
        let before = Gap { pixel: 3, light: Vec3::new(1.0, 2.0, 3.0), open: 0.8, weight: 0.1 };
        let after = before.with(sum(Vec3::new(5.0, 4.0, 1.0), 0.05), 0.2, 4.0);
        close_to(after.light.extend(after.open), Vec4::new(2.0, 2.8, 3.2, 0.6));
        assert!((after.weight - 0.1125).abs() < 1e-6 && after.pixel == 3);
        // More than enough is enough, and nothing changes nothing.
        let full = before.with(sum(Vec3::ONE, 3.0), 0.2, 2.0);
        close_to(full.light.extend(full.open), Vec4::new(1.8, 2.8, 3.8, 0.0));
        let same = before.with(sum(Vec3::ONE, 0.0), 0.2, 2.0);
        close_to(same.light.extend(same.open), before.light.extend(before.open));
        // The light of the share that is closed, with its weight.
        close_to(after.sum(), sum(Vec3::new(2.0, 2.8, 3.2) / 0.4, 0.1125));
    }

    #[test]
    fn gaps_close_at_the_accuracy_that_covers_them() {
        let light = Vec3::new(0.5, 0.25, 2.0);
        let mut gaps = Gaps { size: [4, 1], open: vec![gap(1), gap(2)] };
        let mut sums = vec![Vec4::ONE; 4];
        let times = gaps.close(&mut sums, |gaps, times| {
            assert!(times > 1.0);
            gaps.open.iter().map(|gap| if times >= [0.0, 2.0, 8.0][gap.pixel] { sum(light, ENOUGH) } else { Vec4::ZERO }).collect()
        });
        assert_eq!(times, 8.0);
        assert!(gaps.open.is_empty());
        close_to(sums[1], sum(light, ENOUGH / 2.0));
        close_to(sums[2], sum(light, ENOUGH / 8.0));
        assert_eq!([sums[0], sums[3]], [Vec4::ONE; 2]);
    }

    #[test]
    fn what_nothing_covers_stays_as_it_was() {
        let mut gaps = Gaps { size: [2, 1], open: vec![gap(0)] };
        let mut sums = vec![Vec4::ONE; 2];
        let times = gaps.close(&mut sums, |gaps, times| {
            assert!(times > 1.0);
            vec![Vec4::ZERO; gaps.open.len()]
        });
        assert!((MOST_TIMES..2.0 * MOST_TIMES).contains(&times));
        assert_eq!((sums, gaps.open.len()), (vec![Vec4::ONE; 2], 1));
    }

    #[test]
    fn sums_at_gaps_are_those_of_the_whole_picture() {
        let rule = Rule { accuracy: 0.2, overlap: OVERLAP, ..mock::rule() };
        let record = |x: f32, light: f32| Record { position: Vec3::new(x, 0.0, -4.0), irradiance: Vec3::new(light, 2.0 * light, 3.0), ..mock::record() };
        let (size, records) = ([5, 20], [record(-2.0, 1.0), record(2.0, 4.0)]);
        let camera = Pinhole { eye: Vec3::ZERO, right: Vec3::X, up: Vec3::Y, forward: Vec3::NEG_Z, half_extent: glam::Vec2::ONE, size };
        let across = |part: u32, parts: u32| (2.0 * (part as f32 + 0.5) / parts as f32 - 1.0) * 4.0;
        let positions: Vec<_> = (0..100).map(|pixel| Vec4::new(across(pixel % 5, 5), -across(pixel / 5, 20), -4.0, 1.0)).collect();
        let normals = vec![Vec4::Z; 100];
        let scene = Scene { camera, rule: &rule, records: &records, positions: &positions, normals: &normals };
        let gaps = Gaps { size, open: (0..100).filter(|pixel| pixel % 3 != 1).map(gap).collect() };
        for times in [4.0, 10.0, 40.0] {
            let placed = scene.placed(times, |_, record| record);
            assert_eq!(placed.len(), 2);
            let mut whole = [vec![Vec4::ZERO; 100]];
            bands::add(size[0], &placed, &mut whole, &Seen { positions: &positions, normals: &normals });
            let found = scene.irradiance(&gaps, times);
            assert!(found.iter().any(|sum| sum.w > 0.0) && found.iter().zip(&gaps.open).all(|(sum, gap)| *sum == whole[0][gap.pixel]));
            let reached = |column: usize, light: f32| {
                let sum = whole[0][10 * 5 + column];
                close_to(sum / sum.w, Vec3::new(light, 2.0 * light, 3.0).extend(1.0));
            };
            // So far they do not reach each other.
            if times < 20.0 {
                reached(1, 1.0);
                reached(3, 4.0);
            }
        }
    }
}

#[cfg(test)]
mod steps {
    use super::*;
    use crate::contract::{Arguments, encoder::Reported, encoder::Setting};
    use crate::passes::mock::{self, MockHost};
    use crate::scene::needs::Needs;
    use std::collections::BTreeMap;

    const SIZE: [u32; 2] = [8, 8];

    /// Closes the gaps of a picture of a wall 4 away, which these records light: the sums, pixels that were closed and the coarsest accuracy.
    fn closed(sums: &[Vec4], records: &[Record]) -> (Vec<Vec4>, u32, u32) {
        let (mut host, needs, inputs, arguments) = (MockHost::new(Vec::new(), SIZE), Needs::default(), BTreeMap::new(), Arguments::defaults(&[]));
        let mut schedule = Schedule::default();
        schedule.variables.push(VariableDescription { name: String::new(), history: false });
        let [position, normal, reflectance, triangles, of_sums] = [2, 3, 4, 5, 6].map(Resource);
        let encoded = {
            let setting = Setting { scene: host.scene(), needs: &needs, device: Device::SOFTWARE, size: SIZE, tables: None };
            let mut e = Encoder::new("normalize", &arguments, setting, &inputs, &mut schedule);
            let splats = port::Splats { sums: of_sums, counts: None, lobes: None, of_errors: false, cache: mock::cache(100) };
            super::encode(&mut e, &splats, &port::GBuffer { size: SIZE, position, normal, reflectance, triangles });
            e.finish()
        };
        let records: Vec<HostRecord> = records.iter().map(HostRecord::from).collect();
        host.write(Resource(0), 0, cast_slice(&records));
        let place = |pixel: u32| Vec4::new((pixel % 8) as f32 - 3.5, 3.5 - (pixel / 8) as f32, -4.0, 1.0);
        host.contents.extend([(position, (0..64).map(place).collect()), (normal, vec![Vec4::Z; 64]), (of_sums, sums.to_vec())]);
        let [Command::Late(step)] = &encoded.commands[..] else { panic!("a late step") };
        (step.run)(&mut host).unwrap();
        let [pixels, coarsest] = ["coarse_pixels", "coarsest"].map(|name| {
            let found = encoded.reports.iter().find(|(told, _)| *told == name);
            let Some((_, Reported::Variable(variable))) = found else { panic!("{name}") };
            host.variable(*variable)
        });
        (host.contents.remove(&of_sums).unwrap(), pixels, coarsest)
    }

    fn lit() -> Record {
        Record { position: Vec3::new(0.0, 0.0, -4.0), irradiance: Vec3::new(1.0, 2.0, 3.0), ..mock::record() }
    }

    #[test]
    fn gaps_have_the_light_of_coarser_records_and_other_pixels_keep_theirs() {
        let light = Vec3::new(9.0, 8.0, 7.0).extend(1.0);
        let sums: Vec<Vec4> = (0..64).map(|pixel| if pixel % 4 == 0 { Vec4::ZERO } else { light }).collect();
        let (closed, pixels, coarsest) = closed(&sums, &[lit()]);
        assert_eq!(pixels, 16);
        // A record reaches half a unit; its weight is a fifth or more up to most of its reach, and the farthest gap is 5 away.
        assert!(coarsest == 16 || coarsest == 32, "{coarsest}");
        for (pixel, sum) in closed.iter().enumerate() {
            if pixel % 4 == 0 {
                assert!((*sum / sum.w - Vec4::new(1.0, 2.0, 3.0, 1.0)).abs().max_element() < 1e-4 && sum.w > 0.0, "{pixel} {sum}");
            } else {
                assert_eq!(*sum, light);
            }
        }
    }

    #[test]
    fn a_picture_without_gaps_or_records_stays_as_it_is() {
        let light = vec![Vec4::ONE; 64];
        assert_eq!(closed(&light, &[lit()]), (light.clone(), 0, 0));
        let gaps = vec![Vec4::ZERO; 64];
        assert_eq!(closed(&gaps, &[]), (gaps.clone(), 0, 0));
    }
}
