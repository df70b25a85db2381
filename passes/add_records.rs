//! New records join the cache.

use super::record::{RECORD_BYTES, Record, level};
use crate::contract::{Description, Encoder, Input, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes, port};
use crate::host_struct;
use crate::math::weight;
use crate::schedule::*;
use glam::Vec3;
use rayon::prelude::*;

pub struct AddRecords;

static DESCRIPTION: Description = Description {
    name: "AddRecords",
    about: "Appends the new records to the cache and counts those that their own batch already covered",
    source: "RCS section 4, step 4; neighbour clamping: Křivánek and others 2006",
    parameters: &[
        Parameter {
            name: "neighbour_clamping",
            about: "a radius is at most a neighbour's plus the distance to it",
            unit: "",
            kind: ParameterKind::Bool { default: false },
        },
        PLACE,
    ],
    inputs: &[
        Input { name: "to", about: "the cache", accepts: PortKind::RecordCache, takes: Takes::One, changes: true },
        Input { name: "records", about: "the new records", accepts: PortKind::Records, takes: Takes::One, changes: false },
    ],
    outputs: &[Output { name: "cache", about: "the cache with the new records", kind: PortKind::RecordCache }],
};

host_struct! {
    /// Records before the batch, and in it.
    pub struct Batch {
        first: u32,
        count: u32,
        padding_a: u32,
        padding_b: u32,
    }
}

impl Pass for AddRecords {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let (Some(cache), Some(new)) = (e.record_cache("to").copied(), e.records("records").copied()) else { return Ok(()) };
        let coefficients = new.coefficients_for(cache.coefficients)?.zip(cache.coefficients);
        let bodies = e.over_pixels(e.setting.size).unless(coefficients.is_some(), "records hold radiance");
        match e.place(bodies)? {
            Place::Host => encode_on_host(e, &new, &cache),
            Place::Device => encode_on_device(e, &new, &cache, coefficients),
        }
        e.report_variable(if cache.coefficients.is_some() { "radiance_records" } else { "records" }, cache.count);
        e.persist("records", cache.records, RECORD_BYTES, cache.count);
        e.output("cache", Port::RecordCache(cache));
        Ok(())
    }
}

fn encode_on_device(e: &mut Encoder<'_>, new: &port::Records, cache: &port::RecordCache, coefficients: Option<(port::Coefficients, port::Coefficients)>) {
    let batch = e.buffer("batch", size_of::<Batch>() as u64);
    let surplus = e.buffer("surplus", 16);
    let level = e.buffer("level", 16);
    let (added, counts) = (e.variable("added", false), e.batch.is_some());
    e.before_loop(Command::Clear(surplus));
    let (new, cache) = (*new, *cache);
    let program = Program::new("add_records");
    let twin = program.clone().constant("CAPACITY", cache.capacity).variable("NEW", new.count).variable("RECORDS", cache.count).variable("ADDED", added);
    let twin = Compute { program: twin.bind("reserved", batch), entry: "reserve", groups: Groups::ONE };
    let run = move |host: &mut dyn HostContext| {
        let [first, count] = reserve(host, &new, &cache)?;
        host.write(batch, 0, bytemuck::bytes_of(&Batch { first, count, padding_a: 0, padding_b: 0 }));
        host.set(added, count);
        Ok(())
    };
    e.twin("reserve", &[], &[batch], run, vec![twin]);
    let program = program
        .constant("NEIGHBOUR_CLAMPING", e.arguments.bool("neighbour_clamping") as u8)
        .constant("COUNTS_SURPLUS", counts as u8)
        .bind("batch", batch)
        .bind("weighting", cache.weighting)
        .bind("records", new.records)
        .bind("cache", cache.records)
        .bind("surplus", surplus)
        .bind("level", level);
    e.compute(program.clone(), "measure", Groups::ONE);
    e.compute(program.clone(), "append", Groups::Counted { count: added, divisor: 1, per: 1 });
    if let Some((from, to)) = coefficients {
        let fours = port::Coefficients::fours(to.order) as u32;
        let program = program
            .constant("COEFFICIENTS", fours)
            .constant("HALF", (to.precision == port::Precision::Half) as u8)
            .bind("new_coefficients", from.values)
            .bind("coefficients", to.values);
        e.compute(program, "append_coefficients", Groups::Counted { count: added, divisor: 1, per: fours.div_ceil(64) });
        e.persist("coefficients", to.values, port::Coefficients::bytes(to.order, to.precision), cache.count);
    }
    if counts {
        e.report("surplus_records", surplus, 0);
    }
}

/// Makes room for a batch at the cache's end: records before it, and in it.
fn reserve(host: &mut dyn HostContext, new: &port::Records, cache: &port::RecordCache) -> Result<[u32; 2], String> {
    let (first, count) = (host.variable(cache.count), host.variable(new.count));
    if count > cache.capacity - first {
        return Err(format!("the record cache is full: {} records do not suffice; raise its capacity or the accuracy", cache.capacity));
    }
    host.set(cache.count, first + count);
    Ok([first, count])
}

/// As shaders/add_records.wgsl does it.
fn encode_on_host(e: &mut Encoder<'_>, new: &port::Records, cache: &port::RecordCache) {
    let surplus = e.variable("surplus", false);
    let (clamps, counts) = (e.arguments.bool("neighbour_clamping"), e.batch.is_some());
    let (new, cache) = (*new, *cache);
    let reads = [Read::counted(new.records, RECORD_BYTES, new.count), Read::counted(cache.records, RECORD_BYTES, cache.count)];
    e.host("append", &reads, &[cache.records], move |host| {
        let [first, _] = reserve(host, &new, &cache)?;
        let before: &[Record] = bytemuck::cast_slice(host.read(cache.records));
        let batch: &[Record] = bytemuck::cast_slice(host.read(new.records));
        let level = level(before.iter().chain(batch));
        let refined = |record: &Record| {
            let mut record = *record;
            record.refine(&cache.rule, level);
            record
        };
        let mut joined: Vec<Record> = batch.iter().map(refined).collect();
        let unclamped: Vec<weight::Record> = joined.iter().map(weight::Record::from).collect();
        if clamps {
            joined.par_iter_mut().for_each(|record| record.radius = clamped_radius(record, before));
        }
        let is_surplus = |index: &usize| {
            let place = &unclamped[*index];
            unclamped[..*index].iter().any(|other| cache.rule.weight(other, place.position, place.normal) > cache.rule.overlap)
        };
        let covered = if counts { (0..batch.len()).into_par_iter().filter(is_surplus).count() as u32 } else { 0 };
        host.write(cache.records, u64::from(first) * RECORD_BYTES, bytemuck::cast_slice(&joined));
        host.set(surplus, host.variable(surplus) + covered);
        Ok(())
    });
    if counts {
        e.report_variable("surplus_records", surplus);
    }
}

/// The radius may not jump over what a neighbour has seen (Křivánek 2006).
fn clamped_radius(record: &Record, others: &[Record]) -> f32 {
    let (position, normal) = (Vec3::from(record.position), Vec3::from(record.normal));
    let facing_alike = others.iter().filter(|other| Vec3::from(other.normal).dot(normal) > 0.7);
    facing_alike.map(|other| other.radius + position.distance(other.position.into())).fold(record.radius, f32::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contract::{Arguments, Value, encoder::Setting};
    use crate::passes::mock::{self, MockHost};
    use crate::passes::record::FIRST;
    use crate::scene::needs::Needs;
    use std::collections::BTreeMap;

    fn cache(capacity: u32) -> port::RecordCache {
        let rule = port::Rule { spacing: [1.0, 1e6], finest_spacing: 0.01, ..mock::rule() };
        port::RecordCache { rule, ..mock::cache(capacity) }
    }

    fn batch() -> port::Records {
        port::Records { records: Resource(2), coefficients: None, count: Variable(1), capacity: 300, is_steady: false, sees_emission: true }
    }

    fn record(x: f32, normal: Vec3, light: f32) -> weight::Record {
        weight::Record {
            position: Vec3::new(x, 0.0, 0.0),
            radius: 4.0,
            normal,
            irradiance: Vec3::splat(light),
            footprint: 0.1,
            relative_gradient: 40.0,
            fineness: 7.0,
            ..mock::record()
        }
    }

    /// Joins records on the host: all of the cache, and how many of them were surplus.
    fn joined(before: &[weight::Record], new: &[weight::Record], clamps: bool) -> (Vec<weight::Record>, u32) {
        let (mut host, needs, inputs, mut schedule) = (MockHost::new(Vec::new(), [4, 4]), Needs::default(), BTreeMap::new(), Schedule::default());
        schedule.variables.extend((0..8).map(|_| VariableDescription { name: String::new(), history: false }));
        let mut arguments = Arguments::defaults(DESCRIPTION.parameters);
        arguments.set("neighbour_clamping", Value::Bool(clamps));
        let encoded = {
            let setting = Setting { scene: host.scene(), needs: &needs, device: Device::SOFTWARE, size: [4, 4], tables: None };
            let mut e = Encoder::new("add", &arguments, setting, &inputs, &mut schedule).in_loop(300, false);
            encode_on_host(&mut e, &batch(), &cache(900));
            e.finish()
        };
        let [Command::Host(step)] = &encoded.commands[..] else { panic!("a step of the host") };
        let [(_, crate::contract::encoder::Reported::Variable(surplus))] = encoded.reports[..] else { panic!("the surplus records") };
        for (records, count, resource) in [(before, Variable(0), Resource(0)), (new, Variable(1), Resource(2))] {
            let records: Vec<Record> = records.iter().map(Record::from).collect();
            host.write(resource, 0, bytemuck::cast_slice(&records));
            host.set(count, records.len() as u32);
        }
        host.set(surplus, 5);
        (step.run)(&mut host).unwrap();
        assert_eq!(host.variable(Variable(0)) as usize, before.len() + new.len());
        (bytemuck::cast_slice::<_, Record>(host.read(Resource(0))).iter().map(weight::Record::from).collect(), host.variable(surplus) - 5)
    }

    #[test]
    fn a_batch_joins_while_the_cache_has_room() {
        let mut host = MockHost::new(Vec::new(), [4, 4]);
        host.variables.extend([(Variable(0), 90), (Variable(1), 10)]);
        assert_eq!(reserve(&mut host, &batch(), &cache(100)), Ok([90, 10]));
        assert_eq!(host.variable(Variable(0)), 100);
        host.set(Variable(1), 1);
        assert!(reserve(&mut host, &batch(), &cache(100)).unwrap_err().contains("100 records do not suffice"));
        assert_eq!(host.variable(Variable(0)), 100);
        host.set(Variable(1), 0);
        assert_eq!(reserve(&mut host, &batch(), &cache(100)), Ok([100, 0]));
    }

    #[test]
    fn records_join_behind_those_before_and_what_others_of_their_batch_cover_is_surplus() {
        let before = [record(0.0, Vec3::Z, 1.0), record(50.0, Vec3::Z, 3.0)];
        // Records reach 2, and weigh the overlap or more up to 1.5. Those before the batch make none surplus, nor do later ones.
        let new = [0.0, 10.0, 11.4, 12.9, 30.0, 10.0].map(|x| record(x, Vec3::Z, 2.0));
        let (all, surplus) = joined(&before, &new, false);
        assert_eq!(all[..2], before);
        let fineness = cache(900).rule.fineness(&new[0], 2.0);
        assert!(fineness < 1.0);
        assert_eq!(all[2..], new.map(|record| weight::Record { fineness, ..record }));
        let expected = (0..new.len())
            .filter(|at| new[..*at].iter().any(|other| cache(900).rule.weight(&weight::Record { fineness, ..*other }, new[*at].position, Vec3::Z) > 0.25));
        assert_eq!(surplus as usize, expected.count());
        assert!(surplus > 1);
    }

    #[test]
    fn the_first_records_tell_what_the_pictures_light_is() {
        let level = |before: usize| {
            let before: Vec<_> = (0..before).map(|at| record(at as f32 * 9.0, Vec3::Z, 1.0)).collect();
            let (all, _) = joined(&before, &[record(-50.0, Vec3::Z, 5.0)], false);
            all.last().unwrap().fineness
        };
        let expected = |level: f32| cache(900).rule.fineness(&record(-50.0, Vec3::Z, 5.0), level);
        assert_eq!(level(0), expected(5.0));
        assert_eq!(level(1), expected(3.0));
        assert_eq!([level(FIRST), level(FIRST + 3)], [expected(1.0); 2]);
    }

    #[test]
    fn radii_are_clamped_by_neighbours_that_face_alike() {
        let tilted = |cosine: f32| Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        let small = |x: f32, normal: Vec3| Record { radius: 0.5, ..Record::from(&record(x, normal, 1.0)) };
        let new = Record::from(&record(0.0, Vec3::Z, 1.0));
        assert_eq!(clamped_radius(&new, &[small(2.0, Vec3::Z)]), 2.5);
        assert_eq!(clamped_radius(&new, &[small(3.0, Vec3::Z), small(-1.0, tilted(0.71)), small(2.0, Vec3::Z)]), 1.5);
        assert_eq!(clamped_radius(&new, &[small(1.0, tilted(0.69)), small(3.6, Vec3::Z)]), 4.0);
        // Those before the batch clamp where they are to.
        let before = [weight::Record { radius: 0.5, ..record(1.0, Vec3::Z, 1.0) }];
        let radius = |clamps: bool| joined(&before, &[record(0.0, Vec3::Z, 1.0)], clamps).0[1].radius;
        assert_eq!([radius(true), radius(false)], [1.5, 4.0]);
    }
}
