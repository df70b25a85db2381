//! Neighbouring records together: what one got wrong by chance, others have not.

use super::colour::REC_709;
use super::record_index::{Cells, LEVEL_BIT, Layout, Lists, cell, exponent};
use super::weight::{EXTRAPOLATION, FRONT_TOLERANCE, Reaching, Record, Rule};
use glam::Vec3;
use std::collections::HashMap;

/// What a standard error counts as at least, so that records that are sure divide by a number [W/m²].
const LEAST_ERROR: f32 = 1e-30;

/// Edge of the cells whose records are taken for one where they crowd, as a share of how far these reach, and how many steps their normals are told apart by.
const TOGETHER: f32 = 1.0 / 16.0;
const FACING: f32 = 16.0;

/// Most records of a cell that are asked each for itself.
const CROWD: usize = 16;

/// A record, or a crowd of them that stand nearly at one place: however many a cache has, the work grows with the places.
pub struct Group {
    /// Their mean; how far it reaches is the first one's.
    record: Record,
    count: f32,
}

#[derive(Default)]
struct Cell {
    records: usize,
    /// The last one of its records, or all of them.
    group: Option<usize>,
}

/// Records to be asked, and who stands beside whom.
pub struct RecordFilter<'a> {
    groups: &'a [Group],
    reaching: Vec<Reaching<'a>>,
    lists: Lists,
    tolerance: f32,
}

impl Group {
    /// Of records that reach as far as a rule says.
    pub fn all(records: &[Record], rule: &Rule) -> Vec<Self> {
        let mut cells: HashMap<_, Cell> = HashMap::with_capacity(records.len());
        let of = |record: &Record| {
            let edge = exponent(TOGETHER * rule.longest_validity_radius(record));
            (edge, cell(record.position, edge), (record.normal * FACING).round().as_ivec3())
        };
        records.iter().for_each(|record| cells.entry(of(record)).or_default().records += 1);
        let mut groups: Vec<Self> = Vec::with_capacity(records.len());
        for record in records {
            let cell = cells.entry(of(record)).or_default();
            match cell.group {
                Some(group) if cell.records > CROWD => groups[group].join(record),
                _ => {
                    cell.group = Some(groups.len());
                    groups.push(Self { record: *record, count: 1.0 });
                }
            }
        }
        groups
    }

    fn join(&mut self, other: &Record) {
        self.count += 1.0;
        let (mean, share) = (&mut self.record, 1.0 / self.count);
        let toward = |mean: Vec3, other: Vec3| mean + (other - mean) * share;
        mean.position = toward(mean.position, other.position);
        mean.normal = toward(mean.normal, other.normal).normalize_or(other.normal);
        mean.irradiance = toward(mean.irradiance, other.irradiance);
        // As if all were wrong in the same way.
        mean.error = toward(mean.error, other.error);
        let gradients = mean.rotation.iter_mut().chain(&mut mean.translation).zip(other.rotation.iter().chain(&other.translation));
        gradients.for_each(|(mean, other)| *mean = toward(*mean, *other));
    }
}

impl<'a> RecordFilter<'a> {
    /// Records count as `rule` says, which reaches farther than the one that they are splatted by. `tolerance`: how far what two records say of a place may lie
    /// apart [standard errors].
    pub fn new(groups: &'a [Group], rule: &Rule, tolerance: f32) -> Self {
        let reaching: Vec<_> = groups.iter().map(|group| rule.reaching(&group.record)).collect();
        let lists = Lists::of(&reaching, Cells::Far, Layout::of(groups.len()).hashes);
        Self { groups, reaching, lists, tolerance }
    }

    /// The mean of what a record and those beside it say of its place, with the standard error that it then has, and the mean of their gradients.
    ///
    /// What another says is followed halfway by its own gradient and halfway by this one's, `E_j + ½(∇_j + ∇_k)·(p_k − p_j)`: so a curvature cancels, which a
    /// gradient alone would leave in all of them alike. It counts less by `exp(−δ²/2t²)` where it is δ standard errors of the two away from what this one
    /// has seen: shadows and edges stay where they are, and noise does not.
    pub fn filtered(&self, record: &Record) -> Record {
        let mut sums = Sums::default();
        for (level, entries) in self.lists.at(record.position) {
            for entry in entries.iter().filter(|entry| *entry >> LEVEL_BIT == level) {
                self.add(&mut sums, (entry & ((1 << LEVEL_BIT) - 1)) as usize, record);
            }
        }
        sums.mean(record)
    }

    fn add(&self, sums: &mut Sums, near: usize, at: &Record) {
        let (other, weight) = (self.reaching[near].record(), self.weight(near, at));
        if weight > 0.0 {
            let told = told(other, at);
            sums.add(other, told, weight * self.groups[near].count * self.likeness(other, at, told));
        }
    }

    /// Of a record at the place of another: that of the rule, if they are level.
    fn weight(&self, near: usize, at: &Record) -> f32 {
        let other = &self.reaching[near];
        let offset = at.position - other.record().position;
        let behind = offset.dot(at.normal + other.record().normal) * 0.5;
        if behind > FRONT_TOLERANCE * offset.length() { 0.0 } else { other.weight(at.position, at.normal) }
    }

    /// 1 where two records say the same of a place, as far as they know; 0 where they certainly do not.
    fn likeness(&self, other: &Record, at: &Record, told: Vec3) -> f32 {
        let luminance = |colour: Vec3| colour.dot(REC_709.as_vec3());
        let error = luminance(other.error).hypot(luminance(at.error));
        let apart = luminance(told - at.irradiance) / (self.tolerance * error).max(LEAST_ERROR);
        (-0.5 * apart * apart).exp()
    }
}

/// What a record says of the irradiance at the place of another.
fn told(other: &Record, at: &Record) -> Vec3 {
    let (step, turn) = (at.position - other.position, other.normal.cross(at.normal));
    let change = |channel: usize| {
        let [moved, turned] = [other.translation[channel] + at.translation[channel], other.rotation[channel] + at.rotation[channel]];
        0.5 * (step.dot(moved) + turn.dot(turned))
    };
    let [least, most] = EXTRAPOLATION.map(|factor| other.irradiance * factor);
    (other.irradiance + Vec3::new(change(0), change(1), change(2))).max(least).min(most)
}

#[derive(Default)]
struct Sums {
    weight: f32,
    irradiance: Vec3,
    /// Squares of weighted standard errors.
    squares: Vec3,
    rotation: [Vec3; 3],
    translation: [Vec3; 3],
}

impl Sums {
    /// Nothing where the weight is 0 or not a number, as of light that is none.
    fn add(&mut self, other: &Record, told: Vec3, weight: f32) {
        if weight.is_nan() || weight <= 0.0 {
            return;
        }
        self.weight += weight;
        self.irradiance += told * weight;
        self.squares += (other.error * weight) * (other.error * weight);
        let gradients = self.rotation.iter_mut().chain(&mut self.translation).zip(other.rotation.iter().chain(&other.translation));
        gradients.for_each(|(sum, gradient)| *sum += *gradient * weight);
    }

    /// The record with the mean in place of its own light.
    fn mean(self, record: &Record) -> Record {
        if self.weight <= 0.0 {
            return *record;
        }
        let share = 1.0 / self.weight;
        Record {
            irradiance: self.irradiance * share,
            error: self.squares.map(f32::sqrt) * share,
            rotation: self.rotation.map(|sum| sum * share),
            translation: self.translation.map(|sum| sum * share),
            ..*record
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash, unit};
    use crate::math::weight::Weighting;

    const EDGE: usize = 24;

    fn rule() -> Rule {
        let spacing = [4.0, 4.0];
        Rule { weighting: Weighting::Compact, accuracy: 0.4, spacing, nearest: 1e6, change: 1e6, overlap: 0.1, contrast: 1e6, finest_spacing: 1.0 }
    }

    /// A grid of records, one apart, of light that is wrong by chance; `[light, slope along x]` at a place.
    fn grid(light: impl Fn(f32) -> [f32; 2], noise: f32) -> Vec<Record> {
        let chance = |at: usize| 2.0 * 3f32.sqrt() * (unit(hash(at as u32)) - 0.5);
        let record = |at: usize| {
            let position = Vec3::new((at % EDGE) as f32, (at / EDGE) as f32, 0.0);
            let [level, slope] = light(position.x);
            let wrong = noise * chance(at);
            Record {
                position,
                irradiance: Vec3::splat(level + wrong),
                error: Vec3::splat(noise),
                translation: [Vec3::X * slope; 3],
                radius: 10.0,
                normal: Vec3::Z,
                minimum_distance: 1.0,
                footprint: 1.0,
                rotation: [Vec3::ZERO; 3],
                stretch: Vec3::ZERO,
                relative_gradient: 0.0,
                fineness: 1.0,
                confinement: 0.0,
            }
        };
        (0..EDGE * EDGE).map(record).collect()
    }

    /// Of the records that stand away from the grid's border what they are wrong by, before and after: the mean, and the root of the mean square.
    fn wrong(light: impl Fn(f32) -> [f32; 2], noise: f32) -> [[f32; 2]; 2] {
        let records = grid(&light, noise);
        let groups = Group::all(&records, &rule());
        let filter = RecordFilter::new(&groups, &rule(), 2.0);
        let inside: Vec<usize> = (0..records.len()).filter(|at| [at % EDGE, at / EDGE].iter().all(|c| (5..EDGE - 5).contains(c))).collect();
        let of = |record: &dyn Fn(usize) -> Record| {
            let errors: Vec<f32> = inside.iter().map(|at| record(*at).irradiance.x - light(records[*at].position.x)[0]).collect();
            let mean = |values: &mut dyn Iterator<Item = f32>| values.sum::<f32>() / errors.len() as f32;
            [mean(&mut errors.iter().copied()), mean(&mut errors.iter().map(|error| error * error)).sqrt()]
        };
        [of(&|at| records[at]), of(&|at| filter.filtered(&records[at]))]
    }

    /// One of some records, filtered.
    fn filtered(records: &[Record], at: usize) -> Record {
        RecordFilter::new(&Group::all(records, &rule()), &rule(), 2.0).filtered(&records[at])
    }

    #[test]
    fn chance_averages_out() {
        let [before, after] = wrong(|_| [10.0, 0.0], 0.1);
        assert!((before[1] / 0.1 - 1.0).abs() < 0.1 && after[1] < 0.03 && after[0].abs() < 0.01, "{before:?} {after:?}");
    }

    #[test]
    fn what_is_left_is_told() {
        let records = grid(|_| [10.0, 0.0], 0.1);
        let told = filtered(&records, EDGE * EDGE / 2 + EDGE / 2).error.x;
        let left = wrong(|_| [10.0, 0.0], 0.1)[1][1];
        assert!((0.6..1.6).contains(&(told / left)), "{told} is told of {left}");
    }

    /// A parabola: each gradient alone would be wrong by half its second derivative times the square of the way, all on the same side.
    #[test]
    fn curvature_stays() {
        let [_, after] = wrong(|x| [10.0 + 0.05 * (x - 12.0).powi(2), 0.1 * (x - 12.0)], 0.1);
        assert!(after[0].abs() < 0.012 && after[1] < 0.035, "{after:?}");
    }

    #[test]
    fn edges_stay() {
        let [_, after] = wrong(|x| [if x < 11.5 { 10.0 } else { 12.0 }, 0.0], 0.1);
        assert!(after[1] < 0.04, "{after:?}");
    }

    #[test]
    fn records_of_other_surfaces_do_not_count() {
        let mut records = grid(|_| [10.0, 0.0], 0.1);
        let own = EDGE * 12 + 12;
        // One that faces elsewhere, one that is behind, one in front.
        records[own + 1].normal = Vec3::X;
        records[own - 1].position.z = 0.5;
        records[own + EDGE].position.z = -0.5;
        let told = |records: &[Record]| filtered(records, own).irradiance.x;
        let before = told(&records);
        for at in [own + 1, own - 1, own + EDGE] {
            records[at].irradiance += Vec3::splat(0.2);
        }
        assert_eq!(told(&records), before);
    }

    /// However many there are, they cost and say what those at the same places do.
    #[test]
    fn copies_change_nothing() {
        let records = grid(|x| [10.0 + 0.2 * x, 0.2], 0.1);
        let copies: Vec<Record> = (0..40 * records.len()).map(|at| records[at % records.len()]).collect();
        assert_eq!(Group::all(&copies, &rule()).len(), records.len());
        for at in [0, 77, 300] {
            let (one, crowded) = (filtered(&records, at), filtered(&copies, at));
            assert!((one.irradiance - crowded.irradiance).abs().max_element() < 1e-4 && (one.error - crowded.error).abs().max_element() < 1e-5, "{at}");
        }
    }

    /// In any unit of light.
    #[test]
    fn faint_edges_stay() {
        for unit in [1e-20, 1e12] {
            let [_, after] = wrong(|x| [if x < 11.5 { 10.0 * unit } else { 12.0 * unit }, 0.0], 0.1 * unit);
            assert!(after[1] < 0.04 * unit, "{unit}: {after:?}");
        }
    }

    #[test]
    fn light_that_is_none_stays_where_it_is() {
        let mut records = grid(|_| [10.0, 0.0], 0.1);
        let own = EDGE * 12 + 12;
        records[own].irradiance = Vec3::splat(f32::NAN);
        assert!(filtered(&records, own).irradiance.is_nan());
        assert!([own - 1, own + 1, own + EDGE].iter().all(|at| filtered(&records, *at).irradiance.is_finite()));
    }

    #[test]
    fn the_dark_and_what_is_sure_stay() {
        assert_eq!(wrong(|_| [0.0, 0.0], 0.0)[1], [0.0; 2]);
        let sure = grid(|_| [3.0, 0.0], 0.0);
        let found = filtered(&sure, 300);
        assert!((found.irradiance.x - 3.0).abs() < 1e-5 && found.error == Vec3::ZERO);
    }
}
