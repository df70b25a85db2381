//! New records join the cache.

use super::record::{RECORD_BYTES, Record};
use crate::contract::{Choice, Description, Input, Output, Parameter, ParameterKind, Pass, Port, PortKind, Recorder, Refusal, port};
use crate::host_struct;
use crate::math::{colour::luminance, weight};
use crate::recording::*;
use glam::Vec3;
use rayon::prelude::*;

pub struct AddRecords;

static DESCRIPTION: Description = Description {
    name: "AddRecords",
    about: "Appends the new records to the cache and counts those that their own batch already covered",
    source: "RCS section 4, step 4; neighbour clamping: Křivánek and others 2006",
    parameters: &[
        Parameter {
            name: "by",
            about: "where they join",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice {
                        name: "Auto",
                        about: "on the host where the device is a driver on its cores and records hold no radiance, on the device elsewhere",
                        parameters: &[],
                    },
                    Choice { name: "Device", about: "by a shader", parameters: &[] },
                ],
            },
        },
        Parameter {
            name: "neighbour_clamping",
            about: "a radius is at most a neighbour's plus the distance to it",
            unit: "",
            kind: ParameterKind::Bool { default: false },
        },
    ],
    inputs: &[
        Input { name: "to", about: "the cache", accepts: PortKind::RecordCache, required: true, changes: true },
        Input { name: "records", about: "the new records", accepts: PortKind::Records, required: true, changes: false },
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

    fn record(&self, r: &mut Recorder<'_>) -> Result<(), Refusal> {
        let (Some(cache), Some(new)) = (r.record_cache("to").copied(), r.records("records").copied()) else { return Ok(()) };
        let coefficients = match (new.coefficients, cache.coefficients) {
            (Some(from), Some(to)) if from.order == to.order => Some((from, to)),
            (_, None) => None,
            _ => {
                return Err(Refusal::new(
                    "plan::coefficients",
                    "the cache keeps coefficients of radiance that the new records do not have",
                    "project the tiles with a RadianceProjection of the same lobes before the records join this cache",
                ));
            }
        };
        if coefficients.is_none() && r.arguments.choice("by").0 == "Auto" && r.setting.fills_on_host() {
            r.remark("records join on the host, as the device is a driver on the same cores");
            record_on_host(r, &new, &cache);
        } else {
            record_on_device(r, &new, &cache, coefficients);
        }
        r.report_variable(if cache.coefficients.is_some() { "radiance_records" } else { "records" }, cache.count);
        r.persist("records", cache.records, RECORD_BYTES, cache.count);
        r.output("cache", Port::RecordCache(cache));
        Ok(())
    }
}

fn record_on_device(r: &mut Recorder<'_>, new: &port::Records, cache: &port::RecordCache, coefficients: Option<(port::Coefficients, port::Coefficients)>) {
    let batch = r.buffer("batch", size_of::<Batch>() as u64);
    let surplus = r.buffer("surplus", 16);
    let level = r.buffer("level", 16);
    let added = r.variable("added", false);
    r.before_loop(Command::Clear(surplus));
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
    r.twin("reserve", &[], &[batch], run, vec![twin]);
    let program = program
        .constant("NEIGHBOUR_CLAMPING", r.arguments.bool("neighbour_clamping") as u8)
        .bind("batch", batch)
        .bind("weighting", cache.weighting)
        .bind("records", new.records)
        .bind("cache", cache.records)
        .bind("surplus", surplus)
        .bind("level", level);
    r.compute(program.clone(), "measure", Groups::ONE);
    r.compute(program.clone(), "append", Groups::Counted { count: added, divisor: 64, per: 1 });
    if let Some((from, to)) = coefficients {
        let fours = port::Coefficients::fours(to.order) as u32;
        let program = program
            .constant("COEFFICIENTS", fours)
            .constant("HALF", (to.precision == port::Precision::Half) as u8)
            .bind("new_coefficients", from.values)
            .bind("coefficients", to.values);
        r.compute(program, "append_coefficients", Groups::Counted { count: added, divisor: 1, per: fours.div_ceil(64) });
        r.persist("coefficients", to.values, port::Coefficients::bytes(to.order, to.precision), cache.count);
    }
    r.report("surplus_records", surplus, 0);
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

/// The first records tell what the picture's irradiance is: they stand far apart.
const FIRST: usize = 256;

/// As shaders/add_records.wgsl does it.
fn record_on_host(r: &mut Recorder<'_>, new: &port::Records, cache: &port::RecordCache) {
    let surplus = r.variable("surplus", false);
    let clamps = r.arguments.bool("neighbour_clamping");
    let (new, cache) = (*new, *cache);
    let reads = [Read::counted(new.records, RECORD_BYTES, new.count), Read::counted(cache.records, RECORD_BYTES, cache.count)];
    r.host("append", &reads, &[cache.records], move |host| {
        let [first, _] = reserve(host, &new, &cache)?;
        let before: &[Record] = bytemuck::cast_slice(host.read(cache.records));
        let batch: &[Record] = bytemuck::cast_slice(host.read(new.records));
        let known = || before.iter().chain(batch).take(FIRST);
        let level = known().map(|record| luminance(Vec3::from(record.irradiance).as_dvec3())).sum::<f64>() / known().count().max(1) as f64;
        let refined = |record: &Record| {
            let mut record = *record;
            record.translation[1][3] = cache.rule.fineness(&weight::Record::from(&record), level as f32);
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
        let covered = (0..batch.len()).into_par_iter().filter(is_surplus).count() as u32;
        host.write(cache.records, u64::from(first) * RECORD_BYTES, bytemuck::cast_slice(&joined));
        host.set(surplus, host.variable(surplus) + covered);
        Ok(())
    });
    r.report_variable("surplus_records", surplus);
}

/// The radius may not jump over what a neighbour has seen (Křivánek 2006).
fn clamped_radius(record: &Record, others: &[Record]) -> f32 {
    let (position, normal) = (Vec3::from(record.position), Vec3::from(record.normal));
    let facing_alike = others.iter().filter(|other| Vec3::from(other.normal).dot(normal) > 0.7);
    facing_alike.map(|other| other.radius + position.distance(other.position.into())).fold(record.radius, f32::min)
}
