//! What records of radiance keep while they live: expansions go with what they sit on, and over to what was sampled anew.

use super::lives::first;
use crate::contract::{Refusal, port};
use crate::math::{frame::Frame, life::Life, radiance::Projected};
use crate::schedule::{HostContext, Read, Resource};
use glam::{DMat4, Vec3, Vec4};
use rayon::prelude::*;

/// Where the expansions of a cache are kept, and what each of them goes over to.
#[derive(Debug, Clone, Copy)]
pub struct Buffers {
    shown: Resource,
    goals: Resource,
    order: u32,
}

/// The expansions of records, in their order.
pub struct Expansions {
    buffers: Buffers,
    shown: Vec<Vec4>,
    goals: Vec<Vec4>,
}

impl Buffers {
    /// Of a cache whose records live; None of one of irradiance.
    ///
    /// # Errors
    /// Expansions in half floats.
    pub fn of(cache: &port::RecordCache) -> Result<Option<Self>, Refusal> {
        let (Some(kept), Some(goals)) = (cache.coefficients, cache.lives.and_then(|lives| lives.expansions)) else { return Ok(None) };
        if kept.precision == port::Precision::Half {
            return Err(Refusal::new(
                "plan::halves_that_live",
                "records that live on keep their coefficients in single precision",
                "leave `coefficients: Half` of their RecordCache away",
            ));
        }
        Ok(Some(Self { shown: kept.values, goals, order: kept.order }))
    }

    /// Fours of numbers of a record.
    pub fn fours(&self) -> usize {
        port::Coefficients::fours(self.order) as usize
    }

    /// Both of them.
    pub fn resources(&self) -> [Resource; 2] {
        [self.shown, self.goals]
    }

    /// What a step looks at: of all records what they show, and of those that have a life what they go over to.
    pub fn reads(&self, cache: &port::RecordCache, lives: &port::Lives) -> [Read; 2] {
        let bytes = port::Coefficients::bytes(self.order, port::Precision::Single);
        [Read::counted(self.shown, bytes, cache.count), Read::counted(self.goals, bytes, lives.known)]
    }

    /// The shares by which what was sampled anew differs from what a record was sampled as last, and from what it shows.
    pub fn changes(&self, host: &dyn HostContext, slot: usize, sampled: &[Vec4]) -> [f32; 2] {
        [self.goals, self.shown].map(|resource| change(self.expansion(host, resource, slot), sampled))
    }

    /// Puts what was sampled anew in the place of what a record goes over to, and shows such a part of that at once.
    pub fn renew(&self, host: &mut dyn HostContext, slot: usize, sampled: &[Vec4], part: f32) {
        let shown: Vec<Vec4> = self.expansion(host, self.shown, slot).iter().zip(sampled).map(|(shown, sampled)| shown.lerp(*sampled, part)).collect();
        let offset = (slot * size_of_val(sampled)) as u64;
        host.write(self.shown, offset, bytemuck::cast_slice(&shown));
        host.write(self.goals, offset, bytemuck::cast_slice(sampled));
    }

    fn expansion<'h>(&self, host: &'h dyn HostContext, resource: Resource, slot: usize) -> &'h [Vec4] {
        &bytemuck::cast_slice(host.read(resource))[slot * self.fours()..][..self.fours()]
    }
}

/// The share by which radiance differs; of what changes along the surface nothing counts.
fn change(before: &[Vec4], after: &[Vec4]) -> f32 {
    let radiance = before.len() / 3;
    let (apart, whole) = before[..radiance].iter().zip(&after[..radiance]).fold((0.0, 0.0), |(apart, whole), (before, after)| {
        (apart + before.distance_squared(*after), whole + before.length_squared().max(after.length_squared()))
    });
    if whole > 0.0 { (apart / whole).sqrt() } else { 0.0 }
}

/// By which angle a map turns the frame of a record around its normal, which was one and is another now [radians].
pub fn turn(map: &DMat4, before: Vec3, now: Vec3) -> f64 {
    let carried = map.transform_vector3(Frame::new(before).tangent.as_dvec3()).as_vec3();
    let local = Frame::new(now).to_local(carried);
    f64::from(local.y.atan2(local.x))
}

impl Expansions {
    /// All of a cache, in a step that reads them. What was added since shows what it goes over to.
    pub fn of(buffers: Buffers, host: &dyn HostContext, count: usize, known: usize) -> Self {
        let fours = buffers.fours();
        let (shown, mut goals): (Vec<Vec4>, Vec<Vec4>) = (first(host, buffers.shown, count * fours), first(host, buffers.goals, known * fours));
        goals.extend_from_slice(&shown[known * fours..]);
        Self { buffers, shown, goals }
    }

    pub fn retain(&mut self, kept: &[bool]) {
        let fours = self.buffers.fours();
        for items in [&mut self.shown, &mut self.goals] {
            let left = items.chunks_exact(fours).zip(kept).filter(|(_, kept)| **kept).flat_map(|(chunk, _)| chunk.iter().copied());
            *items = left.collect();
        }
    }

    /// Time passes: each is turned by an angle, and goes over to its goal as its life has come on from an age.
    pub fn age(&mut self, lives: &[Life], before: &[f32], angles: &[f64]) {
        let (fours, order) = (self.buffers.fours(), self.buffers.order as usize);
        let all = self.shown.par_chunks_exact_mut(fours).zip(self.goals.par_chunks_exact_mut(fours)).zip(lives.par_iter().zip(before)).zip(angles);
        all.for_each(|(((shown, goal), (life, before)), angle)| {
            if *angle != 0.0 {
                for expansion in [&mut *shown, &mut *goal] {
                    let turned = Projected::of_fours(expansion, order).turned(*angle).in_fours();
                    expansion.copy_from_slice(&turned);
                }
            }
            let part = life.come_since(*before);
            if part > 0.0 {
                shown.iter_mut().zip(&*goal).for_each(|(shown, goal)| *shown = shown.lerp(*goal, part));
            }
        });
    }

    pub fn write(&self, host: &mut dyn HostContext) {
        host.write(self.buffers.shown, 0, bytemuck::cast_slice(&self.shown));
        host.write(self.buffers.goals, 0, bytemuck::cast_slice(&self.goals));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::radiance::PLANES;
    use glam::{DQuat, DVec3};

    const ORDER: u32 = 3;

    fn expansions(records: usize) -> Expansions {
        let buffers = Buffers { shown: Resource(0), goals: Resource(1), order: ORDER };
        let numbers: Vec<Vec4> = (0..records * buffers.fours()).map(|at| Vec4::new(at as f32, 1.0, (at % 5) as f32, 0.5)).collect();
        // Four of each three numbers are in use: 9 of 12.
        let numbers: Vec<Vec4> = numbers.chunks_exact(3).flat_map(|plane| [plane[0], plane[1], Vec4::new(plane[2].x, 0.0, 0.0, 0.0)]).collect();
        Expansions { buffers, goals: numbers.iter().map(|four| 2.0 * *four).collect(), shown: numbers }
    }

    /// What was sampled takes the place of what was shown as the light of its record does, and what is not kept leaves no gap.
    #[test]
    fn expansions_go_with_their_records() {
        let mut all = expansions(3);
        let (fours, before) = (all.buffers.fours(), all.shown.clone());
        assert_eq!(fours, PLANES * 3);
        let life = |age: f32, fade: f32| Life { age, fade, samplings: 1, ..Life::new(Vec3::ONE, 1, None, 9.0) };
        all.age(&[life(1.0, 4.0), life(3.0, 4.0), life(9.0, 4.0)], &[0.0, 2.0, 8.0], &[0.0; 3]);
        for (record, part) in [1.0 / 3.0, 1.0, 0.0].into_iter().enumerate() {
            let places = record * fours..(record + 1) * fours;
            assert!(all.shown[places.clone()].iter().zip(&before[places]).all(|(now, before)| now.abs_diff_eq((1.0 + part) * *before, 1e-3)));
        }
        let last = all.shown[2 * fours..].to_vec();
        all.retain(&[false, false, true]);
        assert_eq!((&all.shown, all.goals.len()), (&last, fours));
    }

    /// A lobe stays where it is in the world as its record is turned with what it sits on, whatever frame that gives it.
    #[test]
    fn expansions_turn_with_what_they_sit_on() {
        let normal = Vec3::new(0.3, -0.5, 0.8).normalize();
        for axis in [DVec3::Z, DVec3::new(1.0, 2.0, -0.5).normalize(), normal.as_dvec3()] {
            let map = DMat4::from_quat(DQuat::from_axis_angle(axis, 1.1));
            let now = map.transform_vector3(normal.as_dvec3()).as_vec3();
            // A direction in the frame that has come along, and the same one in the frame that the record has.
            let local = Vec3::new(0.6, 0.0, 0.8);
            let world = map.transform_vector3(Frame::new(normal).to_world(local).as_dvec3()).as_vec3();
            let found = Frame::new(now).to_local(world);
            let angle = turn(&map, normal, now) as f32;
            assert!(found.abs_diff_eq(Vec3::new(0.6 * angle.cos(), 0.6 * angle.sin(), 0.8), 1e-5), "{axis}");
        }
        // As the frame turns, so do the numbers: those of a lobe along x become those of one along y.
        let mut all = expansions(1);
        let planes = |expansion: &[Vec4]| Projected::of_fours(expansion, ORDER as usize);
        let before = planes(&all.shown);
        all.age(&[Life::new(Vec3::ONE, 1, None, 9.0)], &[0.0], &[std::f64::consts::FRAC_PI_2]);
        let (Projected(now), Projected(expected)) = (planes(&all.shown), before.turned(std::f64::consts::FRAC_PI_2));
        assert!(now.iter().flatten().zip(expected.iter().flatten()).all(|(now, expected)| (now - expected).abs() < 1e-3));
    }

    #[test]
    fn only_radiance_counts_for_changes() {
        let all = expansions(1);
        let mut other = all.shown.clone();
        let radiance = other.len() / 3;
        other[radiance..].iter_mut().for_each(|four| *four *= 7.0);
        assert_eq!(change(&all.shown, &other), 0.0);
        other[..radiance].iter_mut().for_each(|four| *four *= 0.5);
        assert!((change(&all.shown, &other) - 0.5).abs() < 1e-6 && (change(&other, &all.shown) - 0.5).abs() < 1e-6);
        assert_eq!(change(&[Vec4::ZERO; 9], &[Vec4::ZERO; 9]), 0.0);
    }
}
