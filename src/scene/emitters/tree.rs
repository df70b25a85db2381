//! A hierarchy of lamps: which of many matters to a place is found on a way from the root down.
//!
//! After A. Conty Estevez and C. Kulla, Importance sampling of many lights with adaptive tree splitting, 2018, with eight children a node;
//! `shaders/lib/light.wgsl` has the twin.

use crate::math::{
    colour::luminance,
    vectors::{LANES, Vectors},
};
use crate::scene::{Bounds, Scene, Triangle, packets::RAYS};
use fearless_simd::{Select, Simd, f32x8, prelude::*};
use glam::{Quat, Vec3};
use std::f32::consts::PI;

/// Lamps, each with a share of the samples of a place that follows from how large, how bright and how near it is and which way it faces.
#[derive(Default)]
pub struct LightTree {
    /// The root comes first; empty where there is no lamp.
    nodes: Vec<Node>,
    /// Of each lamp, in the order of [`Scene::emitters`], where it stands.
    places: Vec<Place>,
}

/// One of the groups of a node.
#[derive(Debug, Clone, Copy, Default)]
struct Place {
    node: u32,
    group: u32,
}

/// Up to eight groups of lamps side by side.
struct Node {
    above: Option<Place>,
    /// As many as there are come first.
    next: [Option<Next>; LANES],
    centre: [[f32; LANES]; 3],
    /// Of the sphere around the centre, squared [scene units²].
    radius: [f32; LANES],
    power: [f32; LANES],
    axis: [[f32; LANES]; 3],
    /// Cosine and sine of the angle that no normal is farther from the axis than.
    spread: [[f32; LANES]; 2],
    /// 1 where a lamp has two sides, or 0.
    sides: [f32; LANES],
}

/// What a group of lamps is, as devices have it.
#[derive(Debug, Clone, Copy)]
pub struct Group {
    pub centre: Vec3,
    /// Of the sphere that holds them, squared [scene units²].
    pub radius: f32,
    /// Area × luminance.
    pub power: f32,
    /// Normals of all lamps are no farther from the axis than an angle of this cosine; of lamps with two sides, theirs or what is opposite.
    pub axis: Vec3,
    pub spread: f32,
    pub two_sided: bool,
    pub next: Next,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Next {
    /// A lamp, by its number in the order of [`Scene::emitters`].
    Lamp(u32),
    /// So many groups from one on; of the tree's own nodes, one of them.
    Groups { first: u32, count: u32 },
}

/// A lamp that was chosen.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Choice {
    pub lamp: u32,
    /// What a point spread evenly over its area stands for: its power over the probability of the choice, or 0 where no lamp can matter.
    pub weight: f32,
}

/// Samples on their way down.
#[derive(Clone, Copy)]
struct Way {
    node: u32,
    /// The part of 0..1 that leads here.
    begin: f32,
    width: f32,
    probability: f32,
    /// The first of the samples, and the one after the last.
    samples: [u8; 2],
}

// All that runs within `dispatch!` is inlined into it: what is not would not have its instructions.
impl LightTree {
    pub fn new(scene: &Scene) -> Self {
        let emitters = scene.emitters();
        let mut tree = Self { nodes: Vec::new(), places: vec![Place::default(); emitters.len()] };
        let mut lamps: Vec<(u32, Outline)> = (0..).zip(&emitters).map(|(lamp, triangle)| (lamp, Outline::of(scene, *triangle))).collect();
        if !lamps.is_empty() {
            tree.add(None, &Part::of(&mut lamps, 0));
        }
        tree
    }

    /// Adds a node for the lamps of a part, and those below it.
    fn add(&mut self, above: Option<Place>, part: &Part) -> u32 {
        let (number, parts) = (self.nodes.len() as u32, part.opened());
        self.nodes.push(Node::of(above, &parts));
        for (group, part) in parts.iter().enumerate() {
            let place = Place { node: number, group: group as u32 };
            let next = match &part.lamps {
                Lamps::One(lamp) => {
                    self.places[*lamp as usize] = place;
                    Next::Lamp(*lamp)
                }
                Lamps::More(_) => Next::Groups { first: self.add(Some(place), part), count: 1 },
            };
            self.nodes[number as usize].next[group] = Some(next);
        }
        number
    }

    /// A lamp for each of the `samples` of a surface at `origin`, 64 at most; sample i stands at `at(i)` of 0..1, and they rise.
    #[inline(always)]
    pub fn choose<S: Simd>(&self, simd: S, place: [Vec3; 2], at: impl Fn(u32) -> f32, samples: u32, chosen: &mut [Choice]) {
        chosen[..samples as usize].fill(Choice::default());
        let all = Way { node: 0, begin: 0.0, width: 1.0, probability: 1.0, samples: [0, samples as u8] };
        if self.nodes.is_empty() {
            return;
        }
        if samples == 1 {
            // Nothing waits where there is one way.
            let mut way = Some(all);
            while let Some(at_node) = way.take() {
                self.part(simd, place, at_node, &at, chosen, |next| way = Some(next));
            }
            return;
        }
        let mut ways = [all; RAYS];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            self.part(simd, place, ways[waiting], &at, chosen, |way| {
                ways[waiting] = way;
                waiting += 1;
            });
        }
    }

    /// Parts samples at a node: those of lamps have one, for the others `go_on` is told the way.
    #[inline(always)]
    fn part<S: Simd>(&self, simd: S, [origin, normal]: [Vec3; 2], way: Way, at: &impl Fn(u32) -> f32, chosen: &mut [Choice], mut go_on: impl FnMut(Way)) {
        let Way { node, begin, width, probability, samples } = way;
        let [mut first, last] = samples.map(u32::from);
        let node = &self.nodes[node as usize];
        let importances = node.importances(simd, origin, normal);
        let all: f32 = importances.iter().sum();
        if all <= 0.0 {
            return;
        }
        let mut below = 0.0;
        for (group, next) in node.next.iter().enumerate() {
            let Some(next) = next else { break };
            let share = importances[group] / all;
            let (from, to) = (begin + width * below, begin + width * (below + share));
            below += share;
            let mut border = first;
            while border < last && at(border) < to {
                border += 1;
            }
            if border == first || share <= 0.0 {
                continue;
            }
            let probability = probability * share;
            match *next {
                Next::Lamp(lamp) => chosen[first as usize..border as usize].fill(Choice { lamp, weight: node.power[group] / probability }),
                Next::Groups { first: node, .. } => go_on(Way { node, begin: from, width: to - from, probability, samples: [first as u8, border as u8] }),
            }
            first = border;
            if first == last {
                break;
            }
        }
    }

    /// The lamp at a number of 0..1, and how far into its share that lies, 0..1 again, to be used once more.
    #[inline(always)]
    pub fn pick<S: Simd>(&self, simd: S, [origin, normal]: [Vec3; 2], mut number: f64) -> Option<(u32, f64)> {
        let mut node = self.nodes.first()?;
        loop {
            let importances = node.importances(simd, origin, normal).map(f64::from);
            let mut at = number * importances.iter().sum::<f64>();
            let (mut found, mut last) = (None, 0.0);
            for (group, importance) in importances.into_iter().enumerate().filter(|(_, importance)| *importance > 0.0) {
                (found, last) = (Some(group), importance);
                if at < importance {
                    break;
                }
                at -= importance;
            }
            number = (at / last).clamp(0.0, 1.0 - f64::EPSILON);
            match node.next[found?]? {
                Next::Lamp(lamp) => return Some((lamp, number)),
                Next::Groups { first, .. } => node = &self.nodes[first as usize],
            }
        }
    }

    /// With which a lamp is chosen for a surface.
    #[inline(always)]
    pub fn probability<S: Simd>(&self, simd: S, [origin, normal]: [Vec3; 2], lamp: u32) -> f32 {
        let (mut at, mut probability) = (Some(self.places[lamp as usize]), 1.0);
        while let Some(Place { node, group }) = at {
            let node = &self.nodes[node as usize];
            let importances = node.importances(simd, origin, normal);
            let all: f32 = importances.iter().sum();
            probability *= if all > 0.0 { importances[group as usize] / all } else { 0.0 };
            at = node.above;
        }
        probability
    }

    /// All groups, one that holds every lamp first, those of a node side by side; as many as [`most_groups`] at most.
    pub fn groups(&self) -> Vec<Group> {
        let firsts: Vec<u32> = self.nodes.iter().scan(1, |first, node| Some(std::mem::replace(first, *first + node.count()))).collect();
        let below = |node: u32| Next::Groups { first: firsts[node as usize], count: self.nodes[node as usize].count() };
        let root = self.nodes.first().map(|node| Group { next: below(0), ..node.group(0) });
        let groups = self.nodes.iter().flat_map(|node| (0..node.count() as usize).map(|at| node.group(at)));
        let told = groups.map(|group| match group.next {
            Next::Groups { first: node, .. } => Group { next: below(node), ..group },
            Next::Lamp(_) => group,
        });
        root.into_iter().chain(told).collect()
    }
}

/// Groups of a tree of so many lamps at most.
pub fn most_groups(lamps: usize) -> usize {
    2 * lamps
}

impl Node {
    fn of(above: Option<Place>, parts: &[&Part]) -> Self {
        let number = |of: &dyn Fn(&Outline) -> f32| std::array::from_fn(|group| parts.get(group).map_or(0.0, |part| of(&part.outline)));
        let vector = |of: &dyn Fn(&Outline) -> Vec3| [0, 1, 2].map(|axis| number(&|lamps| of(lamps)[axis]));
        Self {
            above,
            next: [None; LANES],
            centre: vector(&|lamps| lamps.bounds.centre()),
            radius: number(&|lamps| 0.25 * lamps.bounds.diagonal().powi(2)),
            power: number(&|lamps| lamps.power),
            axis: vector(&|lamps| lamps.axis),
            spread: [number(&|lamps| lamps.spread), number(&|lamps| (1.0 - lamps.spread.powi(2)).max(0.0).sqrt())],
            sides: number(&|lamps| f32::from(u8::from(lamps.two_sided))),
        }
    }

    fn count(&self) -> u32 {
        self.next.iter().flatten().count() as u32
    }

    fn group(&self, at: usize) -> Group {
        let vector = |of: &[[f32; LANES]; 3]| Vec3::new(of[0][at], of[1][at], of[2][at]);
        Group {
            centre: vector(&self.centre),
            radius: self.radius[at],
            power: self.power[at],
            axis: vector(&self.axis),
            spread: self.spread[0][at],
            two_sided: self.sides[at] > 0.0,
            next: self.next[at].unwrap_or(Next::Lamp(0)),
        }
    }

    /// Of each group, at least in proportion to what a surface may receive of its lamps, were nothing between; 0 only where that is 0, or there is no group.
    #[inline(always)]
    fn importances<S: Simd>(&self, simd: S, origin: Vec3, normal: Vec3) -> [f32; LANES] {
        let [zero, one] = [0.0, 1.0].map(|number| f32x8::splat(simd, number));
        let [radius, power, sides] = [self.radius, self.power, self.sides].map(|numbers| f32x8::load_array(simd, numbers));
        let way = Vectors::load(simd, &self.centre).minus(Vectors::splat(simd, origin));
        let squared = way.dot(way);
        let inside = squared.simd_le(radius);
        let inverse = 1.0 / squared.max(f32::MIN_POSITIVE).sqrt();
        let seen = (radius * inverse * inverse).min(one);
        let [by_cosine, by_sine] = [(one - seen).sqrt(), seen.sqrt()];
        let arriving = lessened(simd, way.product(normal) * inverse, by_cosine, by_sine).max(zero);
        let cosine = -Vectors::load(simd, &self.axis).dot(way) * inverse;
        let cosine = cosine.max(cosine.abs() * sides);
        let [spread_cosine, spread_sine] = self.spread.map(|numbers| f32x8::load_array(simd, numbers));
        let leaving = lessened(simd, cosine, spread_cosine, spread_sine);
        let leaving = lessened(simd, leaving, by_cosine, by_sine).max(zero);
        let facing = inside.select(one, arriving * leaving);
        ((power / squared.max(radius).max(1e-30)).min(MOST) * facing).to_array()
    }
}

/// Of an importance: eight of them have a sum.
const MOST: f32 = 1e37;

/// The cosines of angles, less other ones, but not below 0.
#[inline(always)]
fn lessened<S: Simd>(simd: S, cosine: f32x8<S>, by_cosine: f32x8<S>, by_sine: f32x8<S>) -> f32x8<S> {
    let [zero, one] = [0.0, 1.0].map(|number| f32x8::splat(simd, number));
    cosine.simd_ge(by_cosine).select(one, cosine * by_cosine + (one - cosine * cosine).max(zero).sqrt() * by_sine)
}

/// What is known of lamps without telling them apart.
#[derive(Debug, Clone, Copy)]
struct Outline {
    bounds: Bounds,
    power: f32,
    axis: Vec3,
    spread: f32,
    two_sided: bool,
}

/// Some lamps while the tree is made.
struct Part {
    outline: Outline,
    lamps: Lamps,
}

enum Lamps {
    One(u32),
    More(Box<[Part; 2]>),
}

/// Lamps below so many levels are halved: the tree has an end.
const MOST_UNEVEN: u32 = 24;

/// Places at which lamps may be divided along an axis.
const BINS: usize = 12;

impl Outline {
    fn of(scene: &Scene, triangle: u32) -> Self {
        let mean = scene.mean_emission(triangle);
        let triangle = &scene.triangles[triangle as usize];
        let material = &scene.materials[triangle.material as usize];
        Self {
            bounds: Bounds::of(std::slice::from_ref(triangle)),
            power: power(triangle, mean),
            axis: triangle.face_normal(),
            spread: 1.0,
            two_sided: material.two_sided,
        }
    }

    fn with(self, other: Self) -> Self {
        let two_sided = self.two_sided || other.two_sided;
        let opposite = two_sided && self.axis.dot(other.axis) < 0.0;
        let (axis, spread) = cone([(self.axis, self.spread), (if opposite { -other.axis } else { other.axis }, other.spread)]);
        let bounds = self.bounds.with(other.bounds.min).with(other.bounds.max);
        Self { bounds, power: self.power + other.power, axis, spread, two_sided }
    }

    fn cost(&self) -> f32 {
        self.power * self.bounds.diagonal().powi(2) * (2.0 - self.spread)
    }
}

/// Area × luminance of a triangle: above 0 for any that emits.
fn power(triangle: &Triangle, emission: Vec3) -> f32 {
    (0.5 * triangle.cross().length() * luminance(emission.as_dvec3()) as f32).max(f32::MIN_POSITIVE)
}

impl Part {
    /// Of at least one lamp.
    fn of(lamps: &mut [(u32, Outline)], level: u32) -> Self {
        if let [(lamp, outline)] = lamps {
            return Self { outline: *outline, lamps: Lamps::One(*lamp) };
        }
        let middle = division(lamps, level);
        let (first, second) = lamps.split_at_mut(middle);
        let parts = [first, second].map(|lamps| Self::of(lamps, level + 1));
        Self { outline: parts[0].outline.with(parts[1].outline), lamps: Lamps::More(Box::new(parts)) }
    }

    /// Up to eight parts of it: that of the highest cost is opened each time.
    fn opened(&self) -> Vec<&Self> {
        let mut parts = vec![self];
        while parts.len() < LANES {
            let costs = parts.iter().enumerate().filter(|(_, part)| matches!(part.lamps, Lamps::More(_)));
            let Some((at, _)) = costs.max_by(|(_, a), (_, b)| a.outline.cost().total_cmp(&b.outline.cost())) else { break };
            if let Lamps::More(two) = &parts[at].lamps {
                parts.splice(at..=at, two.iter());
            }
        }
        parts
    }
}

/// How many of the lamps, put in order for it, go to the first part: where power × size² × spread of normals of both parts is least.
fn division(lamps: &mut [(u32, Outline)], level: u32) -> usize {
    let centres = lamps.iter().fold(Bounds::EMPTY, |bounds, (_, lamp)| bounds.with(lamp.bounds.centre()));
    let size = centres.max - centres.min;
    let bin = |lamp: &Outline, axis: usize| {
        let share = (lamp.bounds.centre()[axis] - centres.min[axis]) / size[axis];
        ((share * BINS as f32) as usize).min(BINS - 1)
    };
    let together = |bins: &[Option<Outline>]| bins.iter().flatten().copied().reduce(Outline::with).map(|lamps| lamps.cost());
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|axis| size[*axis] > 0.0 && level < MOST_UNEVEN) {
        let mut bins: [Option<Outline>; BINS] = [None; BINS];
        for (_, lamp) in lamps.iter() {
            let into = &mut bins[bin(lamp, axis)];
            *into = Some(into.map_or(*lamp, |there| there.with(*lamp)));
        }
        let borders = (1..BINS).filter_map(|border| Some((together(&bins[..border])? + together(&bins[border..])?, axis, border)));
        best = best.into_iter().chain(borders).min_by(|(a, ..), (b, ..)| a.total_cmp(b));
    }
    if let Some((_, axis, border)) = best {
        lamps.sort_by_key(|(_, lamp)| bin(lamp, axis) >= border);
        return lamps.partition_point(|(_, lamp)| bin(lamp, axis) < border);
    }
    let (half, longest) = (lamps.len() / 2, size.max_position());
    lamps.select_nth_unstable_by(half, |(_, a), (_, b)| a.bounds.centre()[longest].total_cmp(&b.bounds.centre()[longest]));
    half
}

/// A cone that holds two, each an axis and the cosine of its angle.
fn cone([first, second]: [(Vec3, f32); 2]) -> (Vec3, f32) {
    let (wide, narrow) = if first.1 <= second.1 { (first, second) } else { (second, first) };
    let [of_wide, of_narrow] = [wide, narrow].map(|(_, cosine)| cosine.clamp(-1.0, 1.0).acos());
    let between = wide.0.dot(narrow.0).clamp(-1.0, 1.0).acos();
    if between + of_narrow <= of_wide {
        return wide;
    }
    let angle = 0.5 * (of_wide + between + of_narrow);
    match wide.0.cross(narrow.0).try_normalize() {
        Some(axis) if angle < PI => (Quat::from_axis_angle(axis, angle - of_wide) * wide.0, angle.cos()),
        _ => (wide.0, -1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash, unit};
    use crate::scene::Material;
    use fearless_simd::{Level, dispatch};
    use glam::Vec2;

    fn number(at: u32) -> f32 {
        2.0 * unit(hash(at)) - 1.0
    }

    fn point(at: u32) -> Vec3 {
        Vec3::new(number(3 * at), number(3 * at + 1), number(3 * at + 2))
    }

    /// Lamps here and there, of one side and of two.
    fn lamps(count: u32) -> Scene {
        let triangle = |at: u32| {
            let corner = 4.0 * point(at);
            let positions = [corner, corner + 0.3 * point(1000 + at), corner + 0.3 * point(2000 + at)];
            Triangle { positions, normals: [Vec3::Z; 3], uvs: [Vec2::ZERO; 3], tints: Default::default(), material: at % 2 }
        };
        let lamp = |two_sided| Material { emission: Vec3::new(3.0, 2.0, 1.0), two_sided, ..Material::diffuse("lamp", Vec3::ONE) };
        Scene { triangles: (0..count).map(triangle).collect(), materials: vec![lamp(false), lamp(true)], ..Scene::default() }
    }

    /// What a point of a lamp gives to a surface.
    fn given(scene: &Scene, lamp: usize, [origin, normal]: [Vec3; 2], barycentric: Vec2) -> f32 {
        let triangle = &scene.triangles[lamp];
        let way = triangle.position(barycentric) - origin;
        let cosine = -triangle.face_normal().dot(way.normalize());
        let leaving = if scene.materials[triangle.material as usize].two_sided { cosine.abs() } else { cosine.max(0.0) };
        leaving * normal.dot(way.normalize()).max(0.0) / way.length_squared()
    }

    /// Lamps for so many samples, spread evenly.
    fn chosen(tree: &LightTree, place: [Vec3; 2], samples: u32) -> Vec<Choice> {
        let mut chosen = vec![Choice::default(); samples as usize];
        for (first, some) in (0..).step_by(RAYS).zip(chosen.chunks_mut(RAYS)) {
            let at = |i: u32| ((first + i) as f32 + 0.5) / samples as f32;
            dispatch!(Level::new(), simd => tree.choose(simd, place, at, some.len() as u32, some));
        }
        chosen
    }

    #[test]
    fn every_lamp_that_lights_a_place_is_chosen_as_often_as_is_told() {
        let scene = lamps(100);
        let tree = LightTree::new(&scene);
        const SAMPLES: u32 = 20_032;
        for number in 0..50 {
            let place = [3.0 * point(7000 + number), point(8000 + number).normalize()];
            let mut counts = [0; 100];
            let choices = chosen(&tree, place, SAMPLES);
            choices.iter().filter(|choice| choice.weight > 0.0).for_each(|choice| counts[choice.lamp as usize] += 1);
            for (lamp, count) in (0..).zip(counts) {
                let told = dispatch!(Level::new(), simd => tree.probability(simd, place, lamp as u32));
                let expected = told * SAMPLES as f32;
                assert!((expected - count as f32).abs() < 0.01 * expected + 3.0, "lamp {lamp}: {count} times, {expected} told");
                let shines = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::splat(0.3)].map(|at| given(&scene, lamp, place, at)).iter().any(|light| *light > 1e-4);
                assert!(!shines || told > 0.0, "lamp {lamp} has no share at {number}");
                let power = power(&scene.triangles[lamp], scene.materials[0].emission);
                let weights = choices.iter().filter(|choice| choice.lamp == lamp as u32 && choice.weight > 0.0);
                weights.for_each(|choice| assert!((choice.weight * told / power - 1.0).abs() < 1e-3, "{choice:?} where {told} was told"));
            }
        }
    }

    /// The sum over samples is what all lamps give, and at most places varies far less than were they chosen by power.
    #[test]
    fn lamps_that_are_near_have_most_of_the_samples() {
        const SAMPLES: u32 = 4096;
        let scene = lamps(400);
        let tree = LightTree::new(&scene);
        let middle = Vec2::splat(1.0 / 3.0);
        let power_of = |lamp: usize| f64::from(power(&scene.triangles[lamp], scene.materials[0].emission));
        let mut ratios = Vec::new();
        for number in 0..200 {
            let place = [3.0 * point(7000 + number), point(8000 + number).normalize()];
            let light = |lamp: usize| f64::from(given(&scene, lamp, place, middle));
            let sum: f64 = (0..400).map(|lamp| power_of(lamp) * light(lamp)).sum();
            let values: Vec<f64> = chosen(&tree, place, SAMPLES).iter().map(|choice| f64::from(choice.weight) * light(choice.lamp as usize)).collect();
            let mean = values.iter().sum::<f64>() / f64::from(SAMPLES);
            assert!((mean - sum).abs() < 0.03 * sum, "{mean} is not {sum}");
            let by_tree = values.iter().map(|value| value.powi(2)).sum::<f64>() / f64::from(SAMPLES) - sum.powi(2);
            let total: f64 = (0..400).map(power_of).sum();
            let by_power = (0..400).map(|lamp| total * power_of(lamp) * light(lamp).powi(2)).sum::<f64>() - sum.powi(2);
            ratios.push(by_tree / by_power);
        }
        ratios.sort_by(f64::total_cmp);
        assert!(ratios[100] < 0.15, "{} of the variance", ratios[100]);
    }

    #[test]
    fn lamps_in_one_place_are_told_apart() {
        let mut scene = lamps(1);
        scene.triangles = vec![scene.triangles[0]; 1000];
        let tree = LightTree::new(&scene);
        let toward = scene.triangles[0].positions[0] + 2.0 * scene.triangles[0].face_normal();
        let choices = chosen(&tree, [toward, -scene.triangles[0].face_normal()], 4000);
        let mut counts = [0; 1000];
        choices.iter().for_each(|choice| counts[choice.lamp as usize] += 1);
        assert!(counts.iter().all(|count| (3..=5).contains(count)), "{counts:?}");
    }

    #[test]
    fn few_lamps_are_chosen_too() {
        let place = [Vec3::splat(9.0), Vec3::NEG_ONE.normalize()];
        assert_eq!(chosen(&LightTree::new(&lamps(0)), place, 4), [Choice::default(); 4]);
        assert!(LightTree::new(&lamps(0)).groups().is_empty());
        let mut one = lamps(2);
        one.triangles.remove(0);
        let tree = LightTree::new(&one);
        let light = power(&one.triangles[0], one.materials[0].emission);
        assert!(chosen(&tree, place, 4).iter().all(|choice| (choice.weight / light - 1.0).abs() < 1e-6 || choice.weight == 0.0));
    }

    /// Groups of devices hold every lamp once, each group within the ones above it.
    #[test]
    fn groups_hold_every_lamp() {
        let tree = LightTree::new(&lamps(100));
        let groups = tree.groups();
        assert!(groups.len() <= most_groups(100), "{} groups", groups.len());
        let (mut waiting, mut seen) = (vec![0u32], Vec::new());
        while let Some(at) = waiting.pop() {
            match groups[at as usize].next {
                Next::Lamp(lamp) => seen.push(lamp),
                Next::Groups { first, count } => {
                    assert!((1..=8).contains(&count) && first > at, "{first} and {count} at {at}");
                    waiting.extend(first..first + count);
                }
            }
        }
        seen.sort_unstable();
        assert_eq!(seen, Vec::from_iter(0..100));
    }
}
