//! How long records live whose light changes in time (THESIS 5): each is sampled anew when it may have changed by more than is allowed, as far as two
//! samplings tell how fast it changes.

use super::random::{hash, unit};
use bytemuck::{Pod, Zeroable};
use glam::{IVec3, Vec3};
use std::collections::{BTreeMap, HashMap};

/// What is known of a record beside its light.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Life {
    /// What its light was when it was sampled last [W/m²].
    pub sampled: [f32; 3],
    /// Frames since; less than 0 where it was sampled ahead, for a moment that is yet to come.
    pub age: f32,
    /// By how much its light is taken to change a frame [W/m²]: until it was sampled, or since.
    pub rate: [f32; 3],
    /// Frames until it is to be sampled anew; 0 or less where it should have been.
    pub left: f32,
    /// By how much it changed a frame between the last two samplings [W/m²].
    pub measured: [f32; 3],
    /// How often it has been sampled.
    pub samplings: u32,
    /// Turn of its hemisphere [radians]: the same each time, so that chance takes no part in what changes.
    pub turn: f32,
    /// Frames since it was last seen.
    pub unseen: u32,
    /// One more than what carries it, by its number among the motions of movers; 0 for what stays.
    pub mover: u32,
    /// 1 where its light was quite another when it was sampled last than before.
    pub jumped: u32,
    /// By how much what was sampled last was more than what was shown until then [W/m²]: it is taken in bit by bit.
    pub step: [f32; 3],
    /// Frames that this takes.
    pub fade: f32,
}

/// How far the light of records may be wrong in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lifespan {
    /// The share of the light by which a record may have changed: `a` of equation (5.5).
    pub change: f32,
    /// Frames that a record lives at most.
    pub most: f32,
    /// Whether records go on changing as they did between their last two samplings.
    pub extrapolates: bool,
    /// Frames in which what was sampled takes the place of what was shown, as far as `change` allows; 1 where it does at once.
    pub fade: f32,
}

/// A change by more than this share is no slope to go on with: a lamp went on, or something came between.
const JUMP: f32 = 0.5;

/// Light that is wrong by so many times what is allowed does not go over evenly to what was sampled ahead: so do those beside it.
const ASTRAY: f32 = 4.0;

/// A record lives no longer than twice as long as it has: where light turns, its slope tells nothing of what comes.
const GROWTH: f32 = 1.0;

/// Light is calm that has changed by so small a part of what is allowed.
const CALM: f32 = 8.0;

/// The larger change of a channel, as a share of the light; what is darker than `floor` counts as that.
fn share(a: Vec3, b: Vec3, floor: f32) -> f32 {
    (a - b).abs().max_element() / a.max_element().max(b.max_element()).max(floor)
}

/// Of each component the smaller, and 0 where they have different signs: what two slopes agree on.
fn agreed(a: Vec3, b: Vec3) -> Vec3 {
    let smaller = |a: f32, b: f32| if a * b <= 0.0 { 0.0 } else { a.abs().min(b.abs()).copysign(a) };
    Vec3::new(smaller(a.x, b.x), smaller(a.y, b.y), smaller(a.z, b.z))
}

impl Life {
    /// Of a record that is new, of so much light. Nobody knows yet how fast it changes: of `most` frames that it may live, some live few, and tell the others.
    pub fn new(irradiance: Vec3, number: u32, mover: Option<usize>, most: f32) -> Self {
        let chance = unit(hash(number.wrapping_add(1)));
        Self {
            sampled: irradiance.into(),
            left: 1.0 + (most - 1.0) * chance,
            turn: std::f32::consts::TAU * unit(hash(number ^ 0x5bd1_e995)),
            mover: mover.map_or(0, |mover| mover as u32 + 1),
            ..Self::zeroed()
        }
    }

    /// What carries it.
    pub fn mover(&self) -> Option<usize> {
        self.mover.checked_sub(1).map(|mover| mover as usize)
    }

    /// Whether it is to be sampled anew, and is seen. In a frame that is run so many frames ahead those are, whose time would be over before the next one ahead.
    pub fn is_due(&self, ahead: Option<f32>) -> bool {
        let until = ahead.map_or(0.0, |frames| frames - 1.0);
        (self.left <= until || self.is_of_later()) && self.unseen == 0
    }

    /// Whether it was made ahead, so that nobody knows what it is until then.
    fn is_of_later(&self) -> bool {
        self.samplings == 0 && self.age < 0.0
    }

    /// Whether its light is another than in the frame before.
    pub fn changes(&self) -> bool {
        self.has_slope() || self.step != [0.0; 3] && self.age < self.fade
    }

    fn has_slope(&self) -> bool {
        self.rate != [0.0; 3]
    }

    /// So many frames later. Where nothing has changed since it was sampled it is as good as new, and only goes on to take the place of what was shown before.
    pub fn aged(self, frames: f32, is_current: bool) -> Self {
        if is_current {
            let age = if self.age < self.fade { self.age + 1.0 } else { self.age };
            return Self { age, rate: [0.0; 3], ..self };
        }
        let age = self.age + frames;
        // What it went over to it has come to.
        let rate = if self.age < 0.0 && age >= 0.0 { [0.0; 3] } else { self.rate };
        Self { age, left: self.left - frames, rate, ..self }
    }

    /// What its light is taken to be now.
    fn expected(&self) -> Vec3 {
        (Vec3::from(self.sampled) + self.age * Vec3::from(self.rate)).max(Vec3::ZERO)
    }

    /// The light that it shows: what it is taken to be, as far as that has taken the place of what it showed before.
    pub fn light(&self) -> Vec3 {
        (self.expected() - self.open(self.age) * Vec3::from(self.step)).max(Vec3::ZERO)
    }

    /// The part of a step that is not shown yet at an age. What goes over to what was sampled ahead shows that alone.
    fn open(&self, age: f32) -> f32 {
        if age < 0.0 { 0.0 } else { (1.0 - (age + 1.0) / self.fade).max(0.0) }
    }

    /// The part of the way to what was sampled that it has come since an age.
    pub fn come_since(&self, age: f32) -> f32 {
        let (before, now) = (self.open(age), self.open(self.age));
        if before > now { 1.0 - now / before } else { 0.0 }
    }

    /// The part that is seen at once, as it is sampled, of a step by such a share: the rest fades in, as far as that is allowed.
    pub fn seen_at_once(&self, share: f32, lifespan: &Lifespan) -> f32 {
        if self.jumped != 0 { 1.0 } else { 1.0 - (lifespan.change / share.max(1e-6)).min(1.0) * self.open(0.0) }
    }

    /// No longer than a share by which something else of it has changed, since it was as `before`, allows. The first time that is chance: it was made by other directions.
    pub fn judged_by(self, share: f32, before: &Self, lifespan: &Lifespan) -> Self {
        if before.samplings == 0 {
            return self;
        }
        if share > JUMP {
            return Self { left: 1.0, jumped: 1, ..self };
        }
        let left = before.age.max(1.0) * lifespan.change / share.max(1e-6);
        Self { left: self.left.min(left.clamp(1.0, lifespan.most)), ..self }
    }

    /// After it has been sampled anew: now, or so many frames ahead of the last picture.
    pub fn sampled(self, light: Vec3, noise: [f32; 2], lifespan: &Lifespan, ahead: Option<f32>) -> Self {
        match ahead {
            Some(frames) => self.foreseen(light, noise, lifespan, frames),
            None if self.age < 0.0 => self.corrected(light, noise[0], lifespan),
            None => self.renewed(light, noise, lifespan, 1.0),
        }
    }

    /// From what it showed in the last picture its light goes over to what it is then. Nobody knows yet when a jump comes: it is looked for in each picture until then.
    fn foreseen(self, light: Vec3, noise: [f32; 2], lifespan: &Lifespan, frames: f32) -> Self {
        let shown = self.light();
        if share(light, shown, noise[0]) > JUMP {
            return Self { left: -frames, jumped: 1, ..self };
        }
        let rate = (light - shown) / frames;
        Self { rate: rate.into(), step: [0.0; 3], jumped: 0, ..self.renewed(light, noise, lifespan, frames) }
    }

    /// Sampled before the moment that it was sampled for: it goes over to that from here. Where that would be a jump it is what it is here until it is sampled again.
    fn corrected(self, light: Vec3, floor: f32, lifespan: &Lifespan) -> Self {
        let (later, samplings) = (Vec3::from(self.sampled), self.samplings + 1);
        let is_astray = self.samplings > 0 && share(light, self.expected(), floor) > ASTRAY * lifespan.change;
        let now = Self { jumped: is_astray.into(), samplings, ..self };
        if share(light, later, floor) > JUMP {
            return Self { sampled: light.into(), age: 0.0, rate: [0.0; 3], left: 1.0, ..now };
        }
        Self { rate: ((later - light) / -self.age).into(), ..now }
    }

    /// After it has been sampled anew, by the same directions as last time; but the first time after it was made by others, so that two samplings of the same light
    /// differ by chance: by a share of `noise`. No more of that is forgiven than a change that is allowed. Frames in which it may be
    /// sampled come `every` so many: in calm light it may miss one.
    fn renewed(self, light: Vec3, [floor, noise]: [f32; 2], lifespan: &Lifespan, every: f32) -> Self {
        let (age, before) = (self.age.max(1.0), Vec3::from(self.sampled));
        let (measured, wrong) = ((light - before) / age, share(light, self.expected(), floor));
        let is_jump = share(light, before, floor) > JUMP;
        // What a slope foretells is wrong with the square of time, what stays with time itself.
        let by_chance = if self.samplings == 0 { noise.min(lifespan.change) } else { 0.0 };
        let slack = lifespan.change / (wrong - by_chance).max(1e-6);
        let slack = if self.has_slope() { slack.sqrt() } else { slack };
        // Where light turns, two samplings may see the same of it; three do not.
        let is_calm = |rate: Vec3| share(light, light + age * rate, floor) < lifespan.change / CALM;
        let longer = if is_calm(measured) && is_calm(self.measured.into()) { every } else { 1.0 };
        let left = if is_jump { 1.0 } else { (age * slack).min(GROWTH * age + longer).clamp(1.0, lifespan.most) };
        let goes_on = lifespan.extrapolates && !is_jump && self.samplings > 0;
        let rate = if goes_on { agreed(measured, self.measured.into()) } else { Vec3::ZERO };
        // What fades is wrong by no more than a record may be anyhow; the rest of a step is seen at once.
        let allowed = (lifespan.change / share(light, self.light(), floor).max(1e-6)).min(1.0);
        let step = if is_jump { Vec3::ZERO } else { allowed * (light - self.light()) };
        Self {
            sampled: light.into(),
            step: step.into(),
            fade: lifespan.fade,
            age: 0.0,
            rate: rate.into(),
            left,
            measured: measured.into(),
            samplings: self.samplings + 1,
            jumped: is_jump.into(),
            ..self
        }
    }
}

/// By which share of its light a record is wrong halfway between two samplings, as it goes over evenly from one to the other while its light turns: an eighth of what the
/// slopes of two such windows differ in, over the frames of one. None where it was sampled too seldom to tell.
pub fn turn(before: &Life, after: &Life, frames: f32, floor: f32) -> Option<f32> {
    let (a, b) = (Vec3::from(before.measured), Vec3::from(after.measured));
    let light = Vec3::from(after.sampled).max_element().max(floor);
    (before.samplings > 0).then(|| (b - a).abs().max_element() * frames / (8.0 * light))
}

/// A record that was sampled anew, as its neighbours hear of it.
#[derive(Debug, Clone, Copy)]
pub struct Word {
    pub position: Vec3,
    pub normal: Vec3,
    /// How far it is heard [scene units].
    pub reach: f32,
    /// Frames that it lives from now on.
    pub left: f32,
}

/// Least cosine between the normals of a record and of one that it tells how fast light changes.
const ALIKE: f32 = 0.5;

/// Tells how long a record at a place and normal has left, by those that were sampled anew; infinity where none is heard. Who lives for long far away may live longer
/// than who lives so long nearby.
pub fn heard(words: &[Word]) -> impl Fn([Vec3; 2]) -> f32 + Sync {
    // Cells of a power of two that is no less than the reach, so that who is heard is in a cell beside.
    let level = |word: &Word| word.reach.max(f32::MIN_POSITIVE).log2().ceil() as i32;
    let key = |level: i32, place: Vec3| (place / (level as f32).exp2()).floor().as_ivec3();
    let mut levels: BTreeMap<i32, HashMap<IVec3, Vec<&Word>>> = BTreeMap::new();
    words.iter().for_each(|word| levels.entry(level(word)).or_default().entry(key(level(word), word.position)).or_default().push(word));
    move |[place, normal]| {
        let mut left = f32::INFINITY;
        for (level, cells) in &levels {
            let here = key(*level, place);
            let around = (-1..=1).flat_map(|x| (-1..=1).flat_map(move |y| (-1..=1).map(move |z| here + IVec3::new(x, y, z))));
            for word in around.filter_map(|cell| cells.get(&cell)).flatten().filter(|word| word.normal.dot(normal) > ALIKE) {
                let far = word.position.distance(place) / word.reach;
                if far < 1.0 {
                    left = left.min(word.left * (1.0 + far));
                }
            }
        }
        left
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: Lifespan = Lifespan { change: 0.05, most: 20.0, extrapolates: true, fade: 1.0 };

    /// A record of light that is a function of time, sampled when it is due; the largest share by which it was wrong, and how often it was sampled.
    fn lived(light: impl Fn(f32) -> f32, frames: usize, rule: &Lifespan) -> (f32, u32) {
        let mut life = Life { left: 1.0, ..Life::new(Vec3::splat(light(0.0)), 7, None, rule.most) };
        let mut worst: f32 = 0.0;
        for frame in 1..=frames {
            let now = Vec3::splat(light(frame as f32));
            life = life.aged(1.0, false);
            if life.is_due(None) {
                life = life.renewed(now, [0.01, 0.0], rule, 1.0);
            }
            worst = worst.max(share(life.light(), now, 0.01));
        }
        (worst, life.samplings)
    }

    #[test]
    fn light_that_stays_is_seldom_sampled() {
        assert_eq!(lived(|_| 3.0, 1000, &RULE), (0.0, 59));
    }

    #[test]
    fn light_that_turns_is_hardly_more_wrong_than_allowed() {
        let swell = |t: f32| 2.0 + (0.05 * t).sin();
        let (without, often) = lived(swell, 1000, &Lifespan { extrapolates: false, ..RULE });
        let (with, seldom) = lived(swell, 1000, &RULE);
        assert!(without < 2.0 * RULE.change && with < 2.5 * RULE.change, "{without} {with}");
        assert!(often < 320 && seldom < 180, "{often} {seldom}");
    }

    /// A lamp that goes on is no slope: no record shoots beyond it.
    #[test]
    fn jumps_are_not_gone_on_with() {
        let (worst, samplings) = lived(|t| if t < 100.0 { 1.0 } else { 9.0 }, 200, &RULE);
        assert!(worst < 0.9 && samplings < 40, "{worst} {samplings}");
        let life = Life { age: 4.0, samplings: 3, ..Life::new(Vec3::ONE, 1, None, RULE.most) }.renewed(Vec3::splat(9.0), [0.01, 0.0], &RULE, 1.0);
        assert_eq!((life.rate, life.left), ([0.0; 3], 1.0));
    }

    /// A small step of the light is taken in equal parts, the first at once, and it is the same light in the end; of a large one no more fades than may be wrong.
    #[test]
    fn what_was_sampled_takes_the_place_of_what_was_shown_bit_by_bit() {
        let rule = Lifespan { extrapolates: false, fade: 4.0, ..RULE };
        let aged = Life { age: 5.0, ..Life::new(Vec3::ONE, 7, None, rule.most) };
        let mut life = aged.renewed(Vec3::splat(1.04), [0.01, 0.0], &rule, 1.0);
        let mut shown = Vec::new();
        for _ in 0..6 {
            shown.push(life.light().x);
            let before = life.light();
            life = life.aged(1.0, false);
            assert_eq!(life.changes(), shown.len() < 4, "{life:?}");
            assert!(life.changes() || life.light() == before);
        }
        assert!(shown.iter().zip([1.01, 1.02, 1.03, 1.04, 1.04, 1.04]).all(|(shown, due)| (shown - due).abs() < 1e-6), "{shown:?}");
        // Sampled again meanwhile, it goes on from what it shows, and is judged by what it was taken to be.
        let again = aged.renewed(Vec3::splat(1.04), [0.01, 0.0], &rule, 1.0).aged(1.0, false).renewed(Vec3::splat(1.04), [0.01, 0.0], &rule, 1.0);
        assert!((again.light().x - 1.025).abs() < 1e-6 && again.left > 1.0, "{again:?}");
        let large = aged.renewed(Vec3::splat(1.5), [0.01, 0.0], &rule, 1.0);
        assert!((large.light().x - (1.5 - 0.75 * 0.05 * 1.5)).abs() < 1e-5, "{large:?}");
        assert_eq!(life.renewed(Vec3::splat(9.0), [0.01, 0.0], &rule, 1.0).light(), Vec3::splat(9.0));
    }

    /// In a scene that rests nothing is due, what fades comes to its end, and nothing goes on by a slope; when it moves again, time goes on.
    #[test]
    fn what_rests_does_not_age() {
        let moved = Life { age: 2.0, samplings: 3, measured: [0.1; 3], ..Life::new(Vec3::ONE, 1, None, RULE.most) };
        let mut life = moved.renewed(Vec3::splat(1.04), [0.01, 0.0], &Lifespan { fade: 4.0, ..RULE }, 1.0);
        let left = life.left;
        (0..100).for_each(|_| life = life.aged(1.0, true));
        assert_eq!((life.left, life.age, life.light()), (left, 4.0, Vec3::splat(1.04)));
        assert!(!life.changes());
        assert_eq!((life.aged(1.0, false).left, life.aged(1.0, false).age), (left - 1.0, 5.0));
    }

    /// What else a record knows fades in as its light does, and lets it live no longer than that allows.
    #[test]
    fn what_goes_with_the_light_is_judged_like_it() {
        let rule = Lifespan { extrapolates: false, fade: 4.0, ..RULE };
        let before = Life { age: 5.0, samplings: 1, ..Life::new(Vec3::ONE, 7, None, rule.most) };
        let life = before.renewed(Vec3::splat(1.04), [0.01, 0.0], &rule, 1.0);
        let mut shown = life.seen_at_once(0.04, &rule);
        let mut life_now = life;
        for expected in [0.25, 0.5, 0.75, 1.0, 1.0] {
            assert!((shown - expected).abs() < 1e-6 && (life_now.light().x - 1.0 - 0.04 * expected).abs() < 1e-6, "{shown} {life_now:?}");
            let aged = life_now.aged(1.0, false);
            shown += aged.come_since(life_now.age) * (1.0 - shown);
            life_now = aged;
        }
        assert!((life.seen_at_once(0.5, &rule) - (1.0 - 0.1 * 0.75)).abs() < 1e-6);
        assert_eq!(life.judged_by(0.01, &before, &rule).left, life.left);
        assert!((life.judged_by(0.2, &before, &rule).left - 1.25).abs() < 1e-6);
        let jump = life.judged_by(0.9, &before, &rule);
        assert_eq!((jump.left, jump.jumped, jump.seen_at_once(0.9, &rule)), (1.0, 1, 1.0));
        assert_eq!(life.judged_by(0.9, &Life { samplings: 0, ..before }, &rule).left, life.left);
    }

    /// What was made by other directions differs by chance, which is no change; the second time there is no chance.
    #[test]
    fn chance_is_no_change() {
        let young = Life { age: 6.0, ..Life::new(Vec3::ONE, 1, None, RULE.most) };
        let left = |life: Life, noise| life.renewed(Vec3::splat(1.1), [0.01, noise], &RULE, 1.0).left;
        assert!(left(young, 0.0) < 4.0 && left(young, 0.04) > 5.0);
        assert!(left(young, 9.0) == left(young, 0.05) && left(young, 9.0) <= 7.0);
        let known = Life { samplings: 1, ..young };
        assert_eq!(left(known, 0.05), left(known, 0.0));
    }

    /// As [`lived`], with every fourth frame run ahead, as pictures of all frames but the first show it.
    fn foreseen(light: impl Fn(f32) -> f32, frames: u32, rule: &Lifespan) -> (f32, u32) {
        const WINDOW: u32 = 4;
        let mut life = Life { left: 1.0, ..Life::new(Vec3::splat(light(0.0)), 7, None, rule.most) };
        let at = |frame: u32| Vec3::splat(light(frame as f32));
        let mut worst: f32 = 0.0;
        for frame in 1..=frames {
            let mut passed = 1.0;
            if frame % WINDOW == 1 {
                life = life.aged(WINDOW as f32, false);
                let ahead = Some(WINDOW as f32);
                if life.is_due(ahead) {
                    life = life.sampled(at(frame - 1 + WINDOW), [0.01, 0.0], rule, ahead);
                }
                passed = 1.0 - WINDOW as f32;
            }
            life = life.aged(passed, false);
            if life.is_due(None) {
                life = life.sampled(at(frame), [0.01, 0.0], rule, None);
            }
            worst = worst.max(share(life.light(), at(frame), 0.01));
        }
        (worst, life.samplings)
    }

    /// Even light is exact between two samplings; light that turns is wrong with the square of the time between them, and no more often sampled than each fourth frame.
    #[test]
    fn light_goes_over_to_what_was_sampled_ahead() {
        let rule = Lifespan { change: 0.01, extrapolates: false, ..RULE };
        let (worst, often) = foreseen(|t| 1.0 + 0.1 * t, 200, &rule);
        assert!(worst < 1e-5 && often <= 50, "{worst} {often}");
        let swell = |t: f32| 2.0 + (0.2 * t).sin();
        let (worst, often) = foreseen(swell, 400, &rule);
        // The chord of an arc of length 4 frames, and what a record may change by that is not sampled ahead.
        assert!(worst < 0.2 * 0.2 * 4.0 * 4.0 / 8.0 + rule.change && often <= 100, "{worst} {often}");
        assert!(lived(swell, 400, &rule).1 > 2 * often, "as it is without");
        assert_eq!(foreseen(|_| 3.0, 1000, &RULE).0, 0.0);
    }

    /// What will be a jump is looked for in each picture until it comes, and nothing of it is shown before.
    #[test]
    fn jumps_are_not_gone_over_to() {
        let rule = Lifespan { change: 0.02, extrapolates: false, most: 4.0, ..RULE };
        for (before, after) in [(1.0, 9.0), (9.0, 1.0), (0.0, 1.0), (1.0, 0.0)] {
            let (worst, often) = foreseen(|t| if t < 103.0 { before } else { after }, 200, &rule);
            assert!(worst == 0.0 && often < 60, "{before} {after}: {worst} {often}");
        }
    }

    /// A record that was made ahead is sampled in the first picture that shows it: nobody knew what it was until then.
    #[test]
    fn what_was_made_ahead_is_sampled_when_it_is_seen() {
        let rule = Lifespan { extrapolates: false, ..RULE };
        let made = Life::new(Vec3::splat(1.4), 7, None, rule.most).aged(-3.0, false);
        assert!(made.is_due(None) && !Life { unseen: 1, ..made }.is_due(None));
        let mut life = made.sampled(Vec3::splat(1.1), [0.01, 0.0], &rule, None);
        assert!(!life.is_due(None) && life.jumped == 0);
        let mut shown = Vec::new();
        for _ in 0..5 {
            shown.push(life.light().x);
            life = life.aged(1.0, false);
        }
        assert!(shown.iter().zip([1.1, 1.2, 1.3, 1.4, 1.4]).all(|(shown, due)| (shown - due).abs() < 1e-5), "{shown:?}");
        // Quite other light, as a lamp goes on meanwhile, is shown as it is.
        let dark = made.sampled(Vec3::splat(0.1), [0.01, 0.0], &rule, None);
        assert_eq!((dark.light(), dark.age, dark.left, dark.jumped), (Vec3::splat(0.1), 0.0, 1.0, 0));
    }

    /// A sampling that finds light far from where it is taken to be says so to those beside it, and it goes on from there.
    #[test]
    fn light_that_goes_astray_is_told() {
        let rule = Lifespan { change: 0.02, extrapolates: false, ..RULE };
        let life = Life { samplings: 3, age: -2.0, sampled: [1.4; 3], rate: [0.1; 3], ..Life::new(Vec3::ONE, 7, None, rule.most) };
        let told = |light: f32| life.sampled(Vec3::splat(light), [0.01, 0.0], &rule, None);
        assert_eq!((told(1.21).jumped, told(1.0).jumped), (0, 1));
        assert!((told(1.0).light().x - 1.0).abs() < 1e-6 && (told(1.0).aged(1.0, false).light().x - 1.2).abs() < 1e-6);
    }

    /// Of light that turns evenly the slopes of two windows tell how far it is from the straight way between two samplings, halfway.
    #[test]
    fn two_windows_tell_how_fast_light_turns() {
        let (window, light) = (4.0, |t: f32| 3.0 + 0.01 * t * t);
        let slope = |from: f32| (light(from + window) - light(from)) / window;
        let before = Life { samplings: 1, measured: [slope(0.0); 3], ..Life::new(Vec3::ONE, 1, None, 9.0) };
        let after = Life { measured: [slope(window); 3], sampled: [light(2.0 * window); 3], ..before };
        let off = 0.5 * (light(4.0) + light(8.0)) - light(6.0);
        let told = turn(&before, &after, window, 0.01).unwrap();
        assert!((told * light(8.0) - off).abs() < 1e-5, "{told} {off}");
        assert_eq!(turn(&Life { samplings: 0, ..before }, &after, window, 0.01), None);
    }

    #[test]
    fn light_that_fades_never_turns_negative() {
        let life = Life { age: 50.0, rate: [-1.0; 3], ..Life::new(Vec3::ONE, 1, None, RULE.most) };
        assert_eq!(life.light(), Vec3::ZERO);
        let dark = Life::new(Vec3::ZERO, 1, None, RULE.most).aged(1.0, false).renewed(Vec3::ZERO, [0.0, 0.0], &RULE, 1.0);
        assert!(dark.left.is_finite() && dark.left >= 1.0);
    }

    #[test]
    fn neighbours_hear_of_changes() {
        let word = |x: f32, left| Word { position: x * Vec3::X, normal: Vec3::Z, reach: 2.0, left };
        let places = [[Vec3::X, Vec3::Z], [Vec3::X, Vec3::NEG_Z], [9.0 * Vec3::X, Vec3::Z], [4.5 * Vec3::X, Vec3::Z]];
        assert_eq!(places.map(heard(&[word(0.0, 4.0), word(5.0, 8.0)])), [6.0, f32::INFINITY, f32::INFINITY, 10.0]);
        assert_eq!(places.map(heard(&[])), [f32::INFINITY; 4]);
    }
}
