//! Records that were sampled anew take the place of the old ones.

use super::lives::{first, needed_where_it_moves};
use super::living_radiance;
use super::record::{RECORD_BYTES, Record, level};
use crate::contract::{Arguments, Description, Encoder, Input, Need, Output, Parameter, ParameterKind, Pass, Port, PortKind, Refusal, Takes, port};
use crate::math::{
    life::{Life, Lifespan, turn},
    weight,
};
use crate::scene::needs::Needs;
use crate::schedule::*;
use glam::Vec4;

pub struct RenewRecords;

static DESCRIPTION: Description = Description {
    name: "RenewRecords",
    about: "Puts records that were sampled anew in the place of the old ones; how much their light has changed tells how long they live; by the host",
    source: "THESIS 5.2 to 5.4; the change over two samplings in the place of (5.5)'s quotient, slopes as far as two of them agree: our own",
    parameters: &[
        Parameter {
            name: "change",
            about: "the share of its light by which a record may have changed before it is sampled anew",
            unit: "",
            kind: ParameterKind::Float { default: 0.05, min: 0.001, max: 10.0 },
        },
        Parameter {
            name: "lifespan",
            about: "frames that a record lives at most",
            unit: "frames",
            kind: ParameterKind::Integer { default: 16, min: 1, max: 10_000 },
        },
        Parameter {
            name: "extrapolates",
            about: "whether records go on changing as they did between their last two samplings",
            unit: "",
            kind: ParameterKind::Bool { default: false },
        },
        Parameter {
            name: "fade",
            about: "frames in which what was sampled takes the place of what was shown, as far as `change` allows; 1 is at once",
            unit: "frames",
            kind: ParameterKind::Integer { default: 1, min: 1, max: 1000 },
        },
    ],
    inputs: &[
        Input { name: "of", about: "the records", accepts: PortKind::RecordCache, takes: Takes::One, changes: true },
        Input { name: "due", about: "the places of those that were due", accepts: PortKind::Requests, takes: Takes::One, changes: false },
        Input { name: "records", about: "those, sampled anew", accepts: PortKind::Records, takes: Takes::One, changes: false },
    ],
    outputs: &[Output { name: "cache", about: "the records as they are now", kind: PortKind::RecordCache }],
};

impl Pass for RenewRecords {
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
        let (Some(cache), Some(due), Some(new)) = (e.record_cache("of").copied(), e.requests("due").copied(), e.records("records").copied()) else {
            return Ok(());
        };
        let (Some(slots), Some(lives)) = (due.slots, cache.lives) else {
            return Err(Refusal::new(
                "plan::slots",
                "these are not the places of records that are there already",
                "take those of a DueRecords, of the same records",
            ));
        };
        let expansions = match living_radiance::Buffers::of(&cache)?.zip(new.coefficients_for(cache.coefficients)?) {
            Some(_) if e.arguments.bool("extrapolates") => {
                return Err(Refusal::of_parameter(
                    "extrapolates",
                    "plan::slopes_of_radiance",
                    "records of radiance do not go on changing between their samplings",
                    "leave `extrapolates` away where records keep coefficients of lobes",
                ));
            }
            expansions => expansions,
        };
        encode_on_host(e, (cache, lives), (new, slots), expansions);
        e.output("cache", Port::RecordCache(cache));
        Ok(())
    }
}

fn encode_on_host(
    e: &mut Encoder<'_>,
    (cache, lives): (port::RecordCache, port::Lives),
    (new, slots): (port::Records, Resource),
    expansions: Option<(living_radiance::Buffers, port::Coefficients)>,
) {
    let [most, fade] = ["lifespan", "fade"].map(|name| e.arguments.integer(name) as f32);
    let lifespan = Lifespan { change: e.arguments.float("change") as f32, most, extrapolates: e.arguments.bool("extrapolates"), fade };
    let mut reads = vec![
        Read::counted(cache.records, RECORD_BYTES, cache.count),
        Read::whole(lives.items),
        Read::counted(new.records, RECORD_BYTES, new.count),
        Read::counted(slots, 4, new.count),
    ];
    let mut writes: Vec<Resource> = [cache.records, lives.items].into_iter().chain(lives.ahead.map(|ahead| ahead.goals)).collect();
    if let Some((buffers, sampled)) = &expansions {
        reads.extend(buffers.reads(&cache, &lives));
        reads.push(Read::counted(sampled.values, port::Coefficients::bytes(sampled.order, sampled.precision), new.count));
        writes.extend(buffers.resources());
    }
    e.host("renew", &reads, &writes, move |host| {
        let renewed = host.variable(new.count) as usize;
        let (fresh, slots): (Vec<Record>, Vec<u32>) = (first(host, new.records, renewed), first(host, slots, renewed));
        let known: &[Record] = &bytemuck::cast_slice(host.read(cache.records))[..host.variable(lives.known) as usize];
        let (level, ahead) = (level(known.iter()), host.lapse().ahead());
        let mut judged = ahead.map(|frames| Judged { frames, counts: [0; 3] });
        let expansions = expansions.map(|(buffers, sampled)| (buffers, first::<Vec4>(host, sampled.values, renewed * buffers.fours())));
        for (number, (record, slot)) in fresh.into_iter().zip(slots.into_iter().map(|slot| slot as usize)).enumerate() {
            let at = slot * size_of::<Life>();
            let before: Life = bytemuck::pod_read_unaligned(&host.read(lives.items)[at..at + size_of::<Life>()]);
            let (record, mut life) = renewed_record(record, before, (&cache.rule, &lifespan, level), ahead);
            if let Some((buffers, sampled)) = &expansions {
                let sampled = &sampled[number * buffers.fours()..][..buffers.fours()];
                let [since_sampled, from_shown] = buffers.changes(host, slot, sampled);
                life = life.judged_by(since_sampled, &before, &lifespan);
                buffers.renew(host, slot, sampled, life.seen_at_once(from_shown, &lifespan));
            }
            judged.iter_mut().for_each(|judged| judged.judge([&before, &life], FLOOR * level, &lifespan));
            // What jumps until then stays as it is.
            let place = if ahead.is_none() { Some(cache.records) } else { lives.ahead.map(|ahead| ahead.goals).filter(|_| life.jumped == 0) };
            if let Some(place) = place {
                host.write(place, (slot * size_of::<Record>()) as u64, bytemuck::bytes_of(&record));
            }
            host.write(lives.items, at as u64, bytemuck::bytes_of(&life));
        }
        if let Some((ahead, judged)) = lives.ahead.zip(judged) {
            ahead.judged.iter().zip(judged.counts).for_each(|(variable, count)| host.set(*variable, host.variable(*variable) + count));
        }
        Ok(())
    });
}

/// How many of those that were sampled ahead turn too fast; see [`port::Ahead`].
struct Judged {
    /// Of the window.
    frames: f32,
    counts: [u32; 3],
}

impl Judged {
    fn judge(&mut self, [before, after]: [&Life; 2], floor: f32, lifespan: &Lifespan) {
        let Some(wrong) = turn(before, after, self.frames, floor).filter(|_| after.jumped == 0) else { return };
        // In twice the time it is four times as wrong.
        let counts = [true, wrong > lifespan.change, 4.0 * wrong > lifespan.change].map(u32::from);
        self.counts.iter_mut().zip(counts).for_each(|(all, count)| *all += count);
    }
}

/// What is darker than this share of the picture's irradiance changes by shares of that.
const FLOOR: f32 = 0.02;

/// A record that was sampled anew as AddRecords would have added it, and its life from now on.
fn renewed_record(mut record: Record, life: Life, (rule, lifespan, level): (&weight::Rule, &Lifespan, f32), ahead: Option<f32>) -> (Record, Life) {
    record.refine(rule, level);
    let told = weight::Record::from(&record);
    let noise = told.error.max_element() / told.irradiance.max_element().max(FLOOR * level).max(f32::MIN_POSITIVE);
    let life = life.sampled(told.irradiance, [FLOOR * level, noise], lifespan, ahead);
    record.set_irradiance(life.light());
    (record, life)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::passes::mock;
    use glam::Vec3;

    /// It lives by how much has changed, and reaches as one that is added would.
    #[test]
    fn records_are_replaced_where_they_were_due() {
        let lifespan = Lifespan { change: 0.05, most: 16.0, extrapolates: false, fade: 1.0 };
        let life = Life { age: 4.0, left: 0.0, ..Life::new(Vec3::ONE, 3, None, lifespan.most) };
        let sampled = |light: f32| Record::from(&weight::Record { irradiance: Vec3::splat(light), fineness: 7.0, ..mock::record() });
        let (record, changed) = renewed_record(sampled(1.1), life, (&mock::rule(), &lifespan, 1.0), None);
        // Wrong by 1/11 in four frames where 1/20 is allowed.
        assert!((changed.left - 2.2).abs() < 1e-3 && changed.samplings == 1 && changed.age == 0.0, "{changed:?}");
        assert_eq!(weight::Record::from(&record).fineness, mock::rule().fineness(&weight::Record::from(&sampled(1.1)), 1.0));
        let (_, same) = renewed_record(sampled(1.0), life, (&mock::rule(), &lifespan, 1.0), None);
        assert_eq!(same.left, 5.0);
    }
}
