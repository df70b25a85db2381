//! Which records are to be sampled anew, as their light may have changed.

use super::lives::{needed_where_it_moves, surface_under, word};
use super::record::{RECORD_BYTES, REQUEST_BYTES, Record, Request};
use crate::contract::{Arguments, Description, Encoder, Input, Need, Output, Pass, Port, PortKind, Refusal, Takes, port};
use crate::math::{
    life::{Life, Word, heard},
    random::{combine, unit},
    weight,
};
use crate::scene::{Scene, bvh::Bvh, needs::Needs};
use crate::schedule::*;
use rayon::prelude::*;

pub struct DueRecords;

static DESCRIPTION: Description = Description {
    name: "DueRecords",
    about: "The places of those records that are to be sampled anew, in a scene that moves, a batch a round; by the host",
    source: "THESIS 5.2",
    parameters: &[],
    inputs: &[Input {
        name: "of",
        about: "the records of earlier frames, where they are now",
        accepts: PortKind::RecordCache,
        takes: Takes::One,
        changes: false,
    }],
    outputs: &[
        Output { name: "requests", about: "their places", kind: PortKind::Requests },
        Output { name: "none", about: "set when all have been told", kind: PortKind::Flag },
    ],
};

impl Pass for DueRecords {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn need(&self, _: &Arguments, needs: &Needs) -> Need {
        needed_where_it_moves(needs)
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(cache) = e.record_cache("of").copied() else { return Ok(()) };
        let Some(lives) = cache.lives else {
            return Err(Refusal::new("plan::lives", "these records are never due", "take those of an AgeRecords"));
        };
        let capacity = e.batch.unwrap_or(1);
        let [count, made, none] = ["count", "made", "none"].map(|name| e.variable(name, false));
        let [places, slots] = [("requests", REQUEST_BYTES), ("slots", 4)].map(|(name, bytes)| e.buffer(name, u64::from(capacity) * bytes));
        let requests = port::Requests { places, count, capacity, made, at_most: u32::MAX, slots: Some(slots) };
        let list = e.state("due");
        let rule = cache.rule;
        let reads = [Read::counted(cache.records, RECORD_BYTES, cache.count), Read::whole(lives.items)];
        e.host("choose", &reads, &[places, slots], move |host| {
            let before = host.state(list).take().and_then(|due| due.downcast::<Due>().ok());
            let known = host.variable(lives.known) as usize;
            let records: &[Record] = &bytemuck::cast_slice(host.read(cache.records))[..known];
            let all: &[Life] = &bytemuck::cast_slice(host.read(lives.items))[..known];
            let mut due = before.unwrap_or_else(|| Box::new(Due::of(host, all)));
            due.hear(records, all, &rule);
            let batch = due.next(capacity as usize);
            let surface = (host.scene(), host.bvh(), host.extent());
            let requests: Vec<Request> = batch.par_iter().map(|slot| request(&records[*slot as usize], &all[*slot as usize], surface)).collect();
            host.write(places, 0, bytemuck::cast_slice(&requests));
            host.write(slots, 0, bytemuck::cast_slice(&batch));
            host.set(count, batch.len() as u32);
            host.set(made, due.told as u32);
            host.set(none, u32::from(batch.is_empty()));
            *host.state(list) = Some(due);
            Ok(())
        });
        e.report_variable("due_records", made);
        e.output("requests", Port::Requests(requests));
        e.output("none", Port::Flag(none));
        Ok(())
    }
}

/// Which records are due in a frame, and how many of them have been told.
struct Due {
    /// By their slots, in the order in which they are told.
    slots: Vec<u32>,
    told: usize,
    /// Of the round before.
    last: usize,
    /// Of all records, whether they are among them.
    is_due: Vec<bool>,
}

/// Where more than this share of those that a frame has sampled anew have jumped, all that is seen is due: a lamp went on.
const FLASH: f32 = 0.5;
/// So many are sampled in each frame in any case: fewer could not tell that a lamp went on.
const TELLING: usize = 4;
/// And one in so many of those that were sampled ahead: else what nobody foresaw is not seen until then.
const ONE_IN: usize = 100;

impl Due {
    /// Those whose time is over and that are seen; those that have waited longest first. A further sample of a picture is of the same time, and has none.
    fn of(host: &dyn HostContext, all: &[Life]) -> Self {
        let is_another = host.camera().0.sample.number > 0;
        let seen = (0..all.len() as u32).filter(|slot| !is_another && all[*slot as usize].unseen == 0);
        let ahead = host.lapse().ahead();
        let (mut slots, mut others): (Vec<u32>, Vec<u32>) = seen.partition(|slot| all[*slot as usize].is_due(ahead));
        let by = |key: fn(u32, &Life) -> f32| move |a: &u32, b: &u32| key(*a, &all[*a as usize]).total_cmp(&key(*b, &all[*b as usize])).then(a.cmp(b));
        let foreseen = others.iter().filter(|slot| all[**slot as usize].age < 0.0).count();
        let more = TELLING.max(foreseen / ONE_IN).saturating_sub(slots.len()).min(others.len());
        if more > 0 {
            // Of very many, which are not sorted.
            others.select_nth_unstable_by(more - 1, by(turn_to_tell));
        }
        slots.extend(&others[..more]);
        slots.sort_by(by(|_, life| life.left));
        let mut is_due = vec![false; all.len()];
        slots.iter().for_each(|slot| is_due[*slot as usize] = true);
        Self { slots, told: 0, last: 0, is_due }
    }

    /// The next of them.
    fn next(&mut self, most: usize) -> Vec<u32> {
        let batch: Vec<u32> = self.slots[self.told..].iter().copied().take(most).collect();
        (self.last, self.told) = (self.told, self.told + batch.len());
        batch
    }

    /// Beside those that the round before has found quite otherwise, others will be, too.
    fn hear(&mut self, records: &[Record], all: &[Life], rule: &weight::Rule) {
        let jumped = |slot: &&u32| all[**slot as usize].jumped != 0;
        let in_all = self.slots[..self.told].iter().filter(jumped).count();
        if in_all == 0 {
            return;
        }
        let is_flash = in_all as f32 > FLASH * self.told as f32;
        let words: Vec<Word> =
            self.slots[self.last..self.told].iter().filter(jumped).map(|slot| word(&records[*slot as usize], &all[*slot as usize], rule)).collect();
        let heard = heard(&words);
        let joins = |slot: usize| !self.is_due[slot] && all[slot].unseen == 0 && (is_flash || heard(records[slot].place()).is_finite());
        let more: Vec<u32> = (0..all.len()).into_par_iter().filter(|slot| joins(*slot)).map(|slot| slot as u32).collect();
        more.iter().for_each(|slot| self.is_due[*slot as usize] = true);
        self.slots.extend(more);
    }
}

/// Which of those that are not due are sampled first: the next to be due, and of those that were sampled ahead others in each frame, by chance.
fn turn_to_tell(slot: u32, life: &Life) -> f32 {
    if life.age < 0.0 { unit(combine(slot, life.age.to_bits())) } else { life.left }
}

fn request(record: &Record, life: &Life, (scene, bvh, extent): (&Scene, &Bvh, f32)) -> Request {
    let place = record.place();
    let request = Request::new(place[0], record.footprint(), place[1], life.turn);
    let face = surface_under((scene, bvh, extent), place, record.footprint()).map(|triangle| scene.triangles[triangle as usize].face_normal());
    // The plane of a two-sided surface may face the other way.
    let face = face.map(|face| if face.dot(place[1]) < 0.0 { -face } else { face }).filter(|face| face.dot(place[1]) < 0.9999);
    face.map_or(request, |face| request.on(face))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::passes::mock::{self, MockHost};
    use glam::Vec3;

    fn life(left: f32) -> Life {
        Life { left, ..Life::new(Vec3::ONE, 1, None, 9.0) }
    }

    fn due(all: &[Life]) -> Due {
        Due::of(&MockHost::new(Vec::new(), [4, 4]), all)
    }

    /// So many records in a row, each a reach apart.
    fn row(count: usize) -> Vec<Record> {
        (0..count).map(|at| Record::from(&weight::Record { position: 0.5 * at as f32 * Vec3::X, ..mock::record() })).collect()
    }

    #[test]
    fn those_that_wait_longest_come_first_and_what_nobody_sees_waits() {
        let all = [life(0.0), life(-3.0), Life { unseen: 1, ..life(-9.0) }, life(-0.5), life(-1.0), life(0.5)];
        let mut due = due(&all);
        assert_eq!((due.next(2), due.next(2), due.next(2)), (vec![1, 4], vec![3, 0], vec![]));
    }

    /// A frame in which few are due samples those that would be next, too.
    #[test]
    fn some_are_sampled_in_each_frame() {
        let all = [life(7.0), life(-3.0), Life { unseen: 1, ..life(2.0) }, life(5.0), life(3.0), life(6.0)];
        assert_eq!(due(&all).next(9), [1, 4, 3, 5]);
        assert_eq!(due(&all[..3]).next(9), [1, 0]);
        let mut host = MockHost::new(Vec::new(), [4, 4]);
        host.scene.cameras[0].sample.number = 1;
        assert!(Due::of(&host, &all).next(9).is_empty(), "another sample of a picture has none");
    }

    /// Until what they were sampled for one in a hundred tells whether it is so, others in each frame.
    #[test]
    fn some_of_those_that_were_sampled_ahead_tell() {
        let told = |age: f32| due(&[Life { age, samplings: 1, ..life(9.0) }; 1000]).next(99);
        let [first, next] = [-3.0, -2.0].map(told);
        assert_eq!((first.len(), next.len(), told(1.0).len()), (10, 10, 4));
        assert!(first.iter().filter(|slot| next.contains(slot)).count() < 3, "{first:?} {next:?}");
    }

    /// What has jumped is looked for around it, round by round, in the same frame.
    #[test]
    fn jumps_spread_as_far_as_they_reach() {
        let mut all = [life(5.0); 20];
        [0, 10, 13, 16].iter().for_each(|slot| all[*slot] = life(0.0));
        let (records, rule) = (row(20), mock::rule());
        let mut due = due(&all);
        assert_eq!(due.next(20), [0, 10, 13, 16]);
        due.hear(&records, &all, &rule);
        assert!(due.next(20).is_empty(), "nothing has jumped");
        all[0].jumped = 1;
        due.last = 0;
        due.hear(&records, &all, &rule);
        assert_eq!(due.next(20), [1]);
        due.hear(&records, &all, &rule);
        assert!(due.next(20).is_empty(), "the neighbour has not jumped");
    }

    /// Where most have jumped, a lamp went on: all that is seen is due.
    #[test]
    fn a_flash_is_for_all() {
        let mut all = [life(5.0); 40];
        all[0] = life(0.0);
        all[30].unseen = 3;
        let mut due = due(&all);
        assert_eq!(due.next(9), [0, 1, 2, 3]);
        (0..3).for_each(|slot| all[slot].jumped = 1);
        due.hear(&row(40), &all, &mock::rule());
        assert_eq!(due.next(99).len(), 35);
    }
}
