//! New records join the cache.

use super::record::RECORD_BYTES;
use crate::contract::{Description, Input, Output, Parameter, ParameterKind, Pass, Port, PortKind, Recorder, Refusal, port};
use crate::host_struct;
use crate::recording::*;

pub struct AddRecords;

static DESCRIPTION: Description = Description {
    name: "AddRecords",
    about: "Appends the new records to the cache and counts those that their own batch already covered",
    source: "RCS section 4, step 4; neighbour clamping: Krivanek and others 2006",
    parameters: &[Parameter {
        name: "neighbour_clamping",
        about: "a radius is at most a neighbour's plus the distance to it",
        unit: "",
        kind: ParameterKind::Bool { default: false },
    }],
    inputs: &[
        Input { name: "to", about: "the cache", accepts: PortKind::RecordCache, required: true },
        Input { name: "records", about: "the new records", accepts: PortKind::Records, required: true },
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
        let batch = r.buffer("batch", size_of::<Batch>() as u64);
        let surplus = r.buffer("surplus", 16);
        let level = r.buffer("level", 16);
        let added = r.variable("added", false);
        r.before_loop(Command::Clear(surplus));
        r.host("reserve", &[], &[batch], move |host| {
            let first = host.variable(cache.count);
            let room = cache.capacity - first;
            let count = host.variable(new.count);
            if count > room {
                return Err(format!("the record cache is full: {} records do not suffice; raise its capacity or the accuracy", cache.capacity));
            }
            let uniform = Batch { first, count, padding_a: 0, padding_b: 0 };
            host.write(batch, 0, bytemuck::bytes_of(&uniform));
            host.set(added, count);
            host.set(cache.count, first + count);
            Ok(())
        });
        let program = Program::new("add_records")
            .constant("NEIGHBOUR_CLAMPING", r.arguments.bool("neighbour_clamping") as u8)
            .bind("batch", batch)
            .bind("weighting", cache.weighting)
            .bind("records", new.records)
            .bind("cache", cache.records)
            .bind("surplus", surplus)
            .bind("level", level);
        r.compute(program.clone(), "measure", Groups::Fixed([1, 1, 1]));
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
        r.report_variable(if cache.coefficients.is_some() { "radiance_records" } else { "records" }, cache.count);
        r.persist("records", cache.records, RECORD_BYTES, cache.count);
        r.output("cache", Port::RecordCache(cache));
        Ok(())
    }
}
