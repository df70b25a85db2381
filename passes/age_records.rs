//! Records of earlier frames come to this one: moved with what they sit on, a frame older, and dropped where nobody has seen them for long.

use super::lives::{first, needed_where_it_moves, off, surface_under, word};
use super::living_radiance::{self, Expansions};
use super::record::{RECORD_BYTES, Record, pinhole, texels};
use crate::contract::{Arguments, Description, Encoder, Input, Need, Output, Parameter, ParameterKind, Pass, Port, PortKind, Refusal, Takes, port};
use crate::math::{
    life::{Life, Word, heard},
    projection::Pinhole,
    random::hash,
    weight,
};
use crate::scene::{Bounds, Object, Scene, bvh::Bvh, needs::Needs, shape::frame, stage::Motion};
use crate::schedule::*;
use glam::{DMat3, DMat4, Vec3, Vec4, Vec4Swizzles};
use rayon::prelude::*;
use std::ops::Range;

pub struct AgeRecords;

static DESCRIPTION: Description = Description {
    name: "AgeRecords",
    about: "Brings the records of earlier frames to this one, in a scene that moves: moves them with what they sit on, and drops those that nobody has seen for long; by the host",
    source: "THESIS 5.2 to 5.4; lifespans that neighbours tell of: our own",
    parameters: &[
        Parameter {
            name: "lifespan",
            about: "frames that a record lives at most until it is sampled anew, or dropped where nobody sees it",
            unit: "frames",
            kind: ParameterKind::Integer { default: 16, min: 1, max: 10_000 },
        },
        Parameter {
            name: "window",
            about: "most frames that records are sampled ahead: in the pictures until then their light goes over evenly to that; fewer where it turns faster; 1 is never",
            unit: "frames",
            kind: ParameterKind::Integer { default: 1, min: 1, max: 256 },
        },
    ],
    inputs: &[
        Input { name: "of", about: "the records of earlier frames", accepts: PortKind::RecordCache, takes: Takes::One, changes: true },
        Input { name: "gbuffer", about: "the visible surfaces", accepts: PortKind::GBuffer, takes: Takes::One, changes: false },
    ],
    outputs: &[Output { name: "cache", about: "the records where they are now", kind: PortKind::RecordCache }],
};

impl Pass for AgeRecords {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn need(&self, _: &Arguments, needs: &Needs) -> Need {
        needed_where_it_moves(needs)
    }

    fn stands_for(&self) -> Option<[&'static str; 2]> {
        Some(["of", "cache"])
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let (Some(cache), Some(gbuffer)) = (e.record_cache("of").copied(), e.g_buffer("gbuffer").copied()) else { return Ok(()) };
        let Some(lives) = cache.lives else {
            return Err(Refusal::new(
                "plan::lives",
                "records that end with the frame, or with a change of the scene, do not age",
                "give their RecordCache the parameter `lasts: Changes`",
            ));
        };
        let (most, rule) = (e.arguments.integer("lifespan") as f32, cache.rule);
        let longest = e.arguments.integer("window") as u32;
        let expansions = living_radiance::Buffers::of(&cache)?;
        if expansions.is_some() && longest > 1 {
            return Err(Refusal::of_parameter(
                "window",
                "plan::radiance_ahead",
                "records of radiance are not sampled ahead",
                "leave `window` away where records keep coefficients of lobes",
            ));
        }
        let foresight = (longest > 1).then(|| Foresight::declare(e, longest, cache.capacity, lives.known));
        let goals = foresight.map(|foresight| foresight.ahead.goals);
        let (dropped, frames) = (e.variable("dropped", false), e.variable("frames", true));
        let places = e.history_buffer("places", (e.setting.scene.objects.len().max(1) * size_of::<[Vec4; 2]>()) as u64);
        e.survives(&[places], &[frames]);
        // Frames since the scene has changed: it begins anew with each change.
        let still = e.variable("still", true);
        let own = [cache.records, lives.items, places];
        let mut reads =
            vec![Read::counted(cache.records, RECORD_BYTES, cache.count), Read::whole(lives.items), Read::whole(gbuffer.position), Read::whole(places)];
        reads.extend(goals.map(|goals| Read::counted(goals, RECORD_BYTES, lives.known)));
        reads.extend(expansions.iter().flat_map(|buffers| buffers.reads(&cache, &lives)));
        let writes: Vec<Resource> = own.into_iter().chain(goals).chain(expansions.iter().flat_map(|buffers| buffers.resources())).collect();
        e.host("age", &reads, &writes, move |host| {
            // Further samples of a picture are of the same time.
            if host.camera().0.sample.number > 0 {
                return Ok(());
            }
            let count = host.variable(cache.count) as usize;
            let known = (host.variable(lives.known) as usize).min(count);
            let kept = Kept {
                records: first(host, cache.records, count),
                lives: first(host, lives.items, count),
                goals: goals.map(|goals| first(host, goals, known)),
                expansions: expansions.map(|buffers| Expansions::of(buffers, host, count, known)),
            };
            let ground = Ground::of(host);
            let now = ground.bounds();
            let mut kept =
                ground.aged(kept, known, (most, &rule, &now), &Seen { pinhole: pinhole(host), position: texels(host, gbuffer.position) }, host.variable(still));
            if host.variable(frames) == 0 {
                // Records that a run was given, or that had to go to other memory, are of a scene that may have been otherwise.
                kept.lives.iter_mut().for_each(|life| life.left = 0.0);
            } else {
                see_leaps(&kept.records, &mut kept.lives, &leaps(&bounds_in(host.read(places)), &now, ground.lapse.frames as f32));
            }
            kept.drop_unless(|life| life.unseen as f32 <= most);
            let left = kept.records.len();
            host.set(dropped, (count - left) as u32);
            host.set(cache.count, left as u32);
            host.set(lives.known, left as u32);
            host.set(frames, 1);
            foresight.iter().for_each(|foresight| foresight.adapt(host));
            host.set(still, host.variable(still) + 1);
            host.write(cache.records, 0, bytemuck::cast_slice(&kept.records));
            host.write(lives.items, 0, bytemuck::cast_slice(&kept.lives));
            goals.iter().zip(&kept.goals).for_each(|(buffer, goals)| host.write(*buffer, 0, bytemuck::cast_slice(goals)));
            kept.expansions.iter().for_each(|expansions| expansions.write(host));
            let now: Vec<[Vec4; 2]> = now.iter().map(|bounds| [bounds.min.extend(0.0), bounds.max.extend(0.0)]).collect();
            host.write(places, 0, bytemuck::cast_slice(&now));
            Ok(())
        });
        e.report_variable("dropped_records", dropped);
        let lives = port::Lives { ahead: foresight.map(|foresight| foresight.ahead), ..lives };
        e.output("cache", Port::RecordCache(port::RecordCache { lives: Some(lives), ..cache }));
        Ok(())
    }
}

/// How far ahead records are sampled.
#[derive(Clone, Copy)]
struct Foresight {
    window: Window,
    /// Most frames of a window.
    longest: u32,
    ahead: port::Ahead,
}

/// Frames of the first window: nobody knows yet how fast light turns.
const FIRST_WINDOW: u32 = 2;
/// Of the records that were judged, the share that may turn too fast.
const FEW: f32 = 0.1;

impl Foresight {
    fn declare(e: &mut Encoder<'_>, longest: u32, capacity: u32, known: Variable) -> Self {
        let goals = e.history_items("goals", capacity, RECORD_BYTES, known);
        let judged = ["judged", "turned", "turned_in_twice"].map(|name| e.variable(name, true));
        let window = Window { frames: e.variable("window", true), open: e.variable("open", true) };
        e.survives(&[goals], &judged);
        e.survives(&[], &[window.frames, window.open]);
        e.looks_ahead(window);
        e.report_variable("window", window.frames);
        Self { window, longest, ahead: port::Ahead { goals, judged } }
    }

    /// In each frame; after one that was run ahead the window is shorter if light turned too fast in it, and longer if it would not in twice as long.
    fn adapt(&self, host: &mut dyn HostContext) {
        let (Window { frames, open }, lapse) = (self.window, host.lapse());
        host.set(open, if lapse.is_ahead { lapse.frames as u32 } else { host.variable(open).saturating_sub(1) });
        let [judged, turned, turned_in_twice] = self.ahead.judged.map(|variable| host.variable(variable));
        let (now, many) = (host.variable(frames).max(FIRST_WINDOW), |count: u32| count as f32 > FEW * judged as f32);
        let next = match judged {
            0 => now,
            _ if many(turned) => now / 2,
            _ if many(turned_in_twice) => now,
            _ => 2 * now,
        };
        host.set(frames, next.clamp(FIRST_WINDOW, self.longest));
        self.ahead.judged.iter().for_each(|variable| host.set(*variable, 0));
    }
}

/// What is there of earlier frames, each in the same order.
struct Kept {
    records: Vec<Record>,
    lives: Vec<Life>,
    /// What those go over to that were sampled ahead, if any ever are.
    goals: Option<Vec<Record>>,
    /// Of records of radiance.
    expansions: Option<Expansions>,
}

impl Kept {
    fn drop_unless(&mut self, is_kept: impl Fn(&Life) -> bool) {
        let kept: Vec<bool> = self.lives.iter().map(is_kept).collect();
        fn retain<T>(items: &mut Vec<T>, kept: &[bool]) {
            let mut kept = kept.iter();
            items.retain(|_| kept.next().is_none_or(|kept| *kept));
        }
        retain(&mut self.records, &kept);
        retain(&mut self.lives, &kept);
        self.goals.iter_mut().for_each(|goals| retain(goals, &kept));
        self.expansions.iter_mut().for_each(|expansions| expansions.retain(&kept));
    }
}

/// Records that were sampled anew in the frame before tell those beside them how long they live.
fn hear(records: &[Record], all: &mut [Life], rule: &weight::Rule) {
    let words: Vec<Word> =
        records.iter().zip(&*all).filter(|(_, life)| life.samplings > 0 && life.age == 0.0).map(|(record, life)| word(record, life, rule)).collect();
    let heard = heard(&words);
    all.par_iter_mut().zip(records).for_each(|(life, record)| life.left = life.left.min(heard(record.place())));
}

/// A mover leaps that in a frame comes farther than this share of its size, or appears, or vanishes.
const LEAP: f32 = 0.5;
/// Sizes of a mover within which it is much of what is seen.
const NEARBY: f32 = 3.0;

/// Where movers were and where they are.
fn bounds_in(places: &[u8]) -> Vec<Bounds> {
    bytemuck::cast_slice::<_, [Vec4; 2]>(places).iter().map(|[min, max]| Bounds { min: min.xyz(), max: max.xyz() }).collect()
}

/// Around what has leapt, where it was and where it is: how light changes there nobody could tell before.
fn leaps(before: &[Bounds], now: &[Bounds], frames: f32) -> Vec<Bounds> {
    let of_mover = |(before, now): (&Bounds, &Bounds)| {
        let size = 0.5 * before.diagonal().max(now.diagonal());
        let come = before.min.distance(now.min).max(before.max.distance(now.max));
        (come > LEAP * size * frames.abs()).then(|| [before, now].map(|bounds| bounds.grown(NEARBY * size)))
    };
    before.iter().zip(now).filter_map(of_mover).flatten().collect()
}

/// What is near a leap is to be sampled anew at once.
fn see_leaps(records: &[Record], all: &mut [Life], leaps: &[Bounds]) {
    if leaps.is_empty() {
        return;
    }
    all.par_iter_mut().zip(records).for_each(|(life, record)| {
        if leaps.iter().any(|around| around.distance(record.place()[0]) == 0.0) {
            life.left = 0.0;
        }
    });
}

/// The map of what carries a record; None where that stays.
fn map_of(motions: &[Motion], carrier: Option<usize>) -> Option<&DMat4> {
    motions.get(carrier?).map(|motion| &motion.map).filter(|map| **map != DMat4::IDENTITY)
}

/// A place and normal where a map brings them; None where they are nowhere.
fn carried(map: Option<&DMat4>, [position, normal]: [Vec3; 2]) -> Option<[Vec3; 2]> {
    let Some(map) = map else { return Some([position, normal]) };
    let normal = (DMat3::from_mat4(*map).inverse().transpose() * normal.as_dvec3()).try_normalize()?.as_vec3();
    Some([map.transform_point3(position.as_dvec3()).as_vec3(), normal]).filter(|[position, normal]| position.is_finite() && normal.is_finite())
}

/// Brings a record to where a map brings what it sits on; whether it is anywhere.
fn carry(record: &mut Record, map: Option<&DMat4>) -> bool {
    let Some(map) = map else { return true };
    let mut moved = weight::Record::from(&*record);
    let Some([position, normal]) = carried(Some(map), [moved.position, moved.normal]) else { return false };
    (moved.position, moved.normal) = (position, normal);
    // What is scaled, too, changes its light by more than its place: it will be sampled anew.
    let turned = |vector: Vec3| map.transform_vector3(vector.as_dvec3()).normalize_or_zero().as_vec3() * vector.length();
    moved.rotation = moved.rotation.map(turned);
    moved.translation = moved.translation.map(turned);
    moved.stretch = turned(moved.stretch);
    *record = Record::from(&moved);
    true
}

/// What records stand on.
struct Ground<'a> {
    scene: &'a Scene,
    bvh: &'a Bvh,
    extent: f32,
    motions: &'a [Motion],
    lapse: Lapse,
}

/// As many triangles of what deforms as are looked at together.
const CHUNK: usize = 64;

/// A mover, and which of the motions carry it: one, or one for each triangle of what deforms.
struct Carried {
    motions: Range<usize>,
    /// Where it was, chunk by chunk: of what deforms.
    before: Vec<Bounds>,
}

impl<'a> Ground<'a> {
    fn of(host: &'a dyn HostContext) -> Self {
        Self { scene: host.scene(), bvh: host.bvh(), extent: host.extent(), motions: host.motions(), lapse: host.lapse() }
    }

    /// Brings all of it to this frame; it was unchanged for so many frames before. Movers stand within `bounds`.
    fn aged(&self, mut kept: Kept, known: usize, (most, rule, bounds): (f32, &weight::Rule, &[Bounds]), seen: &Seen<'_>, still: u32) -> Kept {
        self.bear(&kept.records, &mut kept.lives, known, (most, bounds));
        kept.goals.iter_mut().for_each(|goals| goals.extend_from_slice(&kept.records[known..]));
        hear(&kept.records, &mut kept.lives, rule);
        self.age(&mut kept, seen, still);
        kept
    }

    /// Gives a life to those that have none yet; movers stand within `bounds`.
    fn bear(&self, records: &[Record], all: &mut [Life], known: usize, (most, bounds): (f32, &[Bounds])) {
        if known == records.len() {
            return;
        }
        let movers = self.movers();
        let numbered = records[known..].par_iter().zip(all[known..].par_iter_mut()).enumerate();
        numbered.for_each(|(number, (record, life))| {
            *life = Life::new(record.irradiance(), hash((known + number) as u32), self.carrier_of(record, &movers, bounds), most);
        });
    }

    fn movers(&self) -> Vec<Carried> {
        let number = |triangle: usize| self.motions.partition_point(|motion| motion.triangles.start < triangle);
        let carried = |object: &Object| {
            let motions = number(object.triangles.start)..number(object.triangles.end);
            let before =
                if motions.len() > 1 { self.motions[motions.clone()].par_chunks(CHUNK).map(|chunk| self.bounds_before(chunk)).collect() } else { Vec::new() };
            Carried { motions, before }
        };
        self.scene.objects.iter().map(carried).collect()
    }

    fn bounds_before(&self, motions: &[Motion]) -> Bounds {
        let corners = motions.iter().flat_map(|Motion { triangles, map }| {
            let backward = map.inverse();
            self.scene.triangles[triangles.start].positions.map(|corner| backward.transform_point3(corner.as_dvec3()).as_vec3())
        });
        corners.fold(Bounds::EMPTY, Bounds::with)
    }

    /// Of the movers, as they stand.
    fn bounds(&self) -> Vec<Bounds> {
        self.scene.objects.par_iter().map(|object| Bounds::of(&self.scene.triangles[object.triangles.clone()])).collect()
    }

    /// What carries a record that was made in the picture before.
    fn carrier_of(&self, record: &Record, movers: &[Carried], bounds: &[Bounds]) -> Option<usize> {
        movers.iter().zip(bounds).find_map(|(mover, bounds)| match mover.motions.len() {
            0 => None,
            1 => Some(mover.motions.start).filter(|motion| self.is_on(record, &self.motions[*motion], bounds)),
            _ => self.triangle_of(record, mover),
        })
    }

    /// Whether a record sits on a mover: where that has brought it, it is on its surface.
    fn is_on(&self, record: &Record, motion: &Motion, bounds: &Bounds) -> bool {
        let place = carried(Some(&motion.map), record.place()).filter(|[at, _]| bounds.distance(*at) <= record.footprint());
        let triangle = place.and_then(|place| surface_under((self.scene, self.bvh, self.extent), place, record.footprint()));
        triangle.is_some_and(|triangle| motion.triangles.contains(&(triangle as usize)))
    }

    /// The triangle of what deforms that a record sat on, nearer than any other.
    fn triangle_of(&self, record: &Record, mover: &Carried) -> Option<usize> {
        let [position, _] = record.place();
        let off = off(self.extent, position, record.footprint());
        let near = mover.before.iter().enumerate().filter(|(_, bounds)| bounds.distance(position) <= off);
        let triangles = near.flat_map(|(chunk, _)| mover.motions.clone().skip(CHUNK * chunk).take(CHUNK));
        let heights = triangles.filter_map(|motion| Some((self.height(position, &self.motions[motion])?, motion)));
        let nearest = heights.min_by(|(a, _), (b, _)| a.total_cmp(b))?;
        Some(nearest.1).filter(|_| nearest.0 <= f64::from(off))
    }

    /// How far a place was from the plane of a triangle which it was over or under.
    fn height(&self, position: Vec3, motion: &Motion) -> Option<f64> {
        /// Edges are no gaps.
        const ROUNDING: f64 = 1e-4;
        // What has moved with the triangle has the same coordinates in it.
        let local = frame(self.scene.triangles[motion.triangles.start].positions).inverse().transform_point3(motion.map.transform_point3(position.as_dvec3()));
        let is_over = local.x >= -ROUNDING && local.y >= -ROUNDING && local.x + local.y <= 1.0 + ROUNDING;
        Some(local.z.abs()).filter(|height| is_over && height.is_finite())
    }

    /// Time passes, after so many frames in which the scene has not changed.
    fn age(&self, kept: &mut Kept, seen: &Seen<'_>, still: u32) {
        let (passed, ages) = (self.lapse.frames as f32, kept.lives.iter().map(|life| life.age).collect::<Vec<_>>());
        let has_expansions = kept.expansions.is_some();
        let turned = kept.lives.par_iter_mut().zip(&mut kept.records).map(|(life, record)| {
            let (map, before) = (map_of(self.motions, life.mover()), record.place()[1]);
            let is_there = carry(record, map);
            let changed = life.changes();
            *life = life.aged(passed, life.age >= 0.0 && life.age < still as f32);
            if changed || life.changes() {
                record.set_irradiance(life.light());
            }
            life.unseen = if is_there && seen.shows(record.place()[0], record.footprint()) { 0 } else { life.unseen + 1 };
            map.filter(|_| is_there && has_expansions).map_or(0.0, |map| living_radiance::turn(map, before, record.place()[1]))
        });
        let angles: Vec<f64> = turned.collect();
        kept.expansions.iter_mut().for_each(|expansions| expansions.age(&kept.lives, &ages, &angles));
        if let Some(goals) = &mut kept.goals {
            let all = goals.par_iter_mut().zip(&mut kept.records).zip(kept.lives.par_iter().zip(&ages));
            all.for_each(|((goal, record), (life, before))| self.approach(record, goal, life, *before));
        }
    }

    /// A record that was sampled ahead goes over to that in as many steps as there are frames until then.
    fn approach(&self, record: &mut Record, goal: &mut Record, life: &Life, age_before: f32) {
        carry(goal, map_of(self.motions, life.mover()));
        if !self.lapse.is_ahead && (age_before < 0.0 || life.age < 0.0) {
            record.approach(goal, (1.0 - life.age).max(1.0).recip());
        }
    }
}

/// What the picture shows.
struct Seen<'a> {
    pinhole: Pinhole,
    /// Of each pixel, and its width there; 0 where it sees nothing.
    position: &'a [[f32; 4]],
}

/// Widths of its pixel by which a record may be hidden, or lie beside the picture, and still count for what is seen.
const MARGIN: f32 = 24.0;

impl Seen<'_> {
    fn shows(&self, position: Vec3, footprint: f32) -> bool {
        let reach = MARGIN * footprint;
        let Some(bounds) = self.pinhole.bounds(position, reach) else { return false };
        let near = |x: u32, y: u32| {
            let there = Vec4::from(self.position[(y * self.pinhole.size[0] + x) as usize]);
            there.w > 0.0 && there.xyz().distance(position) < reach
        };
        // A few pixels of those that it may reach tell.
        let some = |axis: usize| (0..=4).map(move |step| bounds.min[axis] + (bounds.max[axis] - 1 - bounds.min[axis]) * step / 4);
        some(1).any(|y| some(0).any(|x| near(x, y)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::passes::mock::{self, MockHost};
    use crate::scene::{Material, Object, Triangle};
    use glam::{DQuat, DVec3};

    fn floor(height: f32) -> Triangle {
        Triangle {
            positions: [Vec3::new(-9.0, -9.0, height), Vec3::new(9.0, -9.0, height), Vec3::new(0.0, 9.0, height)],
            normals: [Vec3::Z; 3],
            uvs: Default::default(),
            tints: Default::default(),
            material: 0,
        }
    }

    /// A floor that stays, and one above it that has risen by 2.
    fn host() -> MockHost {
        let mut host = MockHost::new(vec![floor(0.0), floor(3.0)], [8, 8]);
        host.scene.materials = vec![Material::diffuse("", Vec3::ONE)];
        let upper = host.scene.triangles.iter().position(|triangle| triangle.positions[0].z == 3.0).unwrap();
        host.scene.objects = vec![Object { name: String::new(), triangles: upper..upper + 1 }];
        host.motions = vec![Motion { triangles: upper..upper + 1, map: DMat4::from_translation(DVec3::new(0.0, 0.0, 2.0)) }];
        host
    }

    fn record(height: f32) -> Record {
        Record::from(&crate::math::weight::Record { position: Vec3::new(0.1, 0.2, height), footprint: 0.01, ..mock::record() })
    }

    /// What goes on its way is no leap; what jumps, appears or vanishes is one, where it was and where it is.
    #[test]
    fn what_leaps_is_looked_at_around_it() {
        let cube = |centre: f32, half: f32| Bounds { min: Vec3::splat(centre - half), max: Vec3::splat(centre + half) };
        assert!(leaps(&[cube(0.0, 1.0)], &[cube(0.2, 1.0)], 1.0).is_empty());
        for (before, now) in [(cube(0.0, 1.0), cube(20.0, 1.0)), (cube(0.0, 1.0), cube(0.0, 0.0)), (cube(0.0, 0.0), cube(0.0, 1.0))] {
            let mut all = [Life::new(Vec3::ONE, 1, None, 9.0); 3];
            let at = |place: f32| Record::from(&weight::Record { position: Vec3::splat(place), ..mock::record() });
            see_leaps(&[at(3.0), at(22.0), at(12.0)], &mut all, &leaps(&[before, cube(12.0, 0.1)], &[now, cube(12.0, 0.1)], 1.0));
            assert_eq!(all.map(|life| life.left == 0.0), [true, now.min.x > 10.0, false]);
        }
    }

    /// A record was made where its surface was in the picture before.
    #[test]
    fn records_know_what_they_sit_on() {
        let host = host();
        let ground = Ground::of(&host);
        assert_eq!([0.0, 1.0, 3.0].map(|height| ground.carrier_of(&record(height), &ground.movers(), &ground.bounds())), [None, Some(0), None]);
        let mut all = [Life::new(Vec3::ONE, 1, None, 9.0); 2];
        ground.bear(&[record(0.0), record(1.0)], &mut all, 0, (16.0, &ground.bounds()));
        assert_eq!(all.map(|life| life.mover()), [None, Some(0)]);
    }

    /// A floor of two triangles that meet at x = 0, of which one has been folded up: what sits on it goes up, and only that.
    #[test]
    fn records_go_with_the_triangle_that_they_sit_on() {
        let corner = |x: f32| Vec3::new(9.0 * x, 0.0, 0.0);
        let (side, top) = (Vec3::new(0.0, -9.0, 0.0), Vec3::new(0.0, 9.0, 0.0));
        let of = |positions| Triangle { positions, ..floor(0.0) };
        let mut host = MockHost::new(vec![of([side, top, corner(-1.0)]), of([side, Vec3::new(0.0, 0.0, 9.0), top])], [8, 8]);
        let folded = host.scene.triangles.iter().position(|triangle| triangle.positions[1].z == 9.0).unwrap();
        host.scene.objects = vec![Object { name: String::new(), triangles: 0..2 }];
        let fold = DMat4::from_rotation_y(-std::f64::consts::FRAC_PI_2);
        host.motions = [0, 1].map(|at| Motion { triangles: at..at + 1, map: if at == folded { fold } else { DMat4::IDENTITY } }).into();
        let ground = Ground::of(&host);
        let record = |x: f32, z: f32| Record::from(&weight::Record { position: Vec3::new(x, 1.0, z), normal: Vec3::Z, footprint: 0.01, ..mock::record() });
        let carrier = |record: &Record| ground.carrier_of(record, &ground.movers(), &ground.bounds());
        let found = [record(-3.0, 0.0), record(3.0, 0.0), record(3.0, 0.5), record(30.0, 0.0)].map(|record| carrier(&record));
        assert_eq!(found, [Some(1 - folded), Some(folded), None, None]);
        let mut lifted = record(3.0, 0.0);
        assert!(carry(&mut lifted, map_of(&host.motions, Some(folded))));
        let [position, normal] = lifted.place();
        assert!(position.distance(Vec3::new(0.0, 1.0, 3.0)) < 1e-5 && normal.distance(Vec3::NEG_X) < 1e-5, "{position} {normal}");
    }

    /// What a record foretells of a point is the same before and after both have moved with what they are on.
    #[test]
    fn records_go_where_their_mover_goes() {
        let before = weight::Record {
            position: Vec3::new(1.0, 2.0, 3.0),
            rotation: [Vec3::new(0.0, 0.1, 0.2), Vec3::X, Vec3::Y],
            translation: [Vec3::new(0.2, -0.1, 0.0), Vec3::Y, Vec3::X],
            stretch: 0.5 * Vec3::X,
            ..mock::record()
        };
        let map = DMat4::from_rotation_translation(DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 1.1), DVec3::new(4.0, -5.0, 6.0));
        let motions = [DMat4::IDENTITY, map].map(|map| Motion { triangles: 0..1, map });
        let (moved, turned) = (|at: Vec3| map.transform_point3(at.as_dvec3()).as_vec3(), |way: Vec3| map.transform_vector3(way.as_dvec3()).as_vec3());
        let mut after = Record::from(&before);
        assert!(carry(&mut after, map_of(&motions, Some(1))));
        let after = weight::Record::from(&after);
        let (point, normal) = (Vec3::new(1.3, 2.1, 3.0), Vec3::new(0.1, 0.0, 1.0).normalize());
        let rule = mock::rule();
        let (was, is) = (rule.reaching(&before), rule.reaching(&after));
        assert!(was.estimate(point, normal).distance(is.estimate(moved(point), turned(normal))) < 1e-5);
        assert!((was.weight(point, normal) - is.weight(moved(point), turned(normal))).abs() < 1e-4);
        let mut still = Record::from(&before);
        assert!(carry(&mut still, map_of(&motions, Some(0))) && carry(&mut still, map_of(&motions, None)));
        assert_eq!(weight::Record::from(&still), before);
        assert!(!carry(&mut still, Some(&DMat4::from_scale(DVec3::new(0.0, 0.0, 0.0)))), "what has vanished is nowhere");
    }

    /// Gradients and reach go over to what was sampled ahead in as many equal steps as there are frames until then, and stay as they are in the frame ahead and after.
    #[test]
    fn records_go_over_evenly() {
        let mut host = host();
        let of = |slope: f32| Record::from(&weight::Record { translation: [slope * Vec3::X; 3], radius: 1.0 + slope, ..mock::record() });
        let life = Life { left: 9.0, ..Life::new(Vec3::ONE, 1, None, 9.0) };
        let mut kept = Kept { records: vec![of(0.0)], lives: vec![life], goals: Some(vec![of(8.0)]), expansions: None };
        let mut shown = Vec::new();
        for (frames, is_ahead) in [(4, true), (-3, false), (1, false), (1, false), (1, false), (1, false)] {
            host.lapse = Lapse { frames, is_ahead };
            Ground::of(&host).age(&mut kept, &Seen { pinhole: pinhole(&host), position: &[[0.0; 4]; 64] }, 0);
            if is_ahead {
                kept.lives[0].age = 0.0;
            }
            let record = weight::Record::from(&kept.records[0]);
            shown.push([record.translation[1].x, record.radius]);
        }
        let due = [0.0, 2.0, 4.0, 6.0, 8.0, 8.0].map(|slope| [slope, 1.0 + slope]);
        assert!(shown.iter().flatten().zip(due.as_flattened()).all(|(shown, due)| (shown - due).abs() < 1e-5), "{shown:?}");
    }

    /// A window doubles where few records turn too fast for one twice as long, and halves where many do for it; it is open for as many pictures as it has.
    #[test]
    fn windows_are_as_long_as_light_turns_slowly() {
        let mut host = host();
        let ahead = port::Ahead { goals: Resource(0), judged: [2, 3, 4].map(Variable) };
        let foresight = Foresight { window: Window { frames: Variable(0), open: Variable(1) }, longest: 8, ahead };
        let mut adapt = |judged: [u32; 3], frames: i32, is_ahead: bool| {
            host.lapse = Lapse { frames, is_ahead };
            ahead.judged.iter().zip(judged).for_each(|(variable, count)| host.set(*variable, count));
            foresight.adapt(&mut host);
            [0, 1].map(|variable| host.variable(Variable(variable)))
        };
        assert_eq!(adapt([0; 3], 1, false), [2, 0]);
        assert_eq!(adapt([0; 3], 2, true), [2, 2]);
        assert_eq!([adapt([100, 0, 5], -1, false), adapt([0; 3], 1, false), adapt([0; 3], 1, false)], [[4, 1], [4, 0], [4, 0]]);
        assert_eq!([[100, 0, 5], [100, 0, 5], [100, 9, 50], [100, 20, 90]].map(|judged| adapt(judged, 1, false)[0]), [8, 8, 8, 4]);
        assert_eq!([[9, 9, 9], [9, 9, 9]].map(|judged| adapt(judged, 1, false)[0]), [2, 2]);
    }

    #[test]
    fn what_the_picture_shows_is_seen() {
        let pinhole = pinhole(&host());
        // Every pixel sees a wall four units ahead.
        let position: Vec<[f32; 4]> = (0..64).map(|pixel| [(pixel % 8) as f32 - 3.5, 3.5 - (pixel / 8) as f32, -4.0, 1.0]).collect();
        let seen = Seen { pinhole, position: &position };
        let shows = |at: Vec3| seen.shows(at, 0.05);
        assert!(shows(Vec3::new(0.5, 0.5, -4.0)));
        assert!(!shows(Vec3::new(0.5, 0.5, -9.0)), "behind the wall");
        assert!(!shows(Vec3::new(30.0, 0.0, -4.0)), "beside the picture");
        assert!(!shows(Vec3::new(0.0, 0.0, 4.0)), "behind the eye");
    }
}
