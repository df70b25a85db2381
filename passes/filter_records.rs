//! Neighbouring records together.

use super::record::{RECORD_BYTES, Record, Weighting};
use super::record_lists::RecordLists;
use crate::contract::{Description, Encoder, Input, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes, port};
use crate::math::{
    record_filter::{Group, RecordFilter},
    weight,
};
use crate::schedule::*;
use rayon::prelude::*;

pub struct FilterRecords;

static DESCRIPTION: Description = Description {
    name: "FilterRecords",
    about: "Each record with the mean of what those beside it say of its place, as far as they do not differ by more than chance explains",
    source: "weights by what is told: Tomasi and Manduchi 1998; gradients of both, so that curvatures cancel, and standard errors: our own",
    parameters: &[
        Parameter {
            name: "reach",
            about: "how far records are asked, over how far they reach in the picture",
            unit: "",
            kind: ParameterKind::Float { default: 2.5, min: 0.1, max: 100.0 },
        },
        Parameter {
            name: "tolerance",
            about: "how far apart two records may be for chance to explain it: less keeps more of shadows and of noise",
            unit: "standard errors",
            kind: ParameterKind::Float { default: 2.0, min: 0.01, max: 1e6 },
        },
        PLACE,
    ],
    inputs: &[Input { name: "records", about: "the records of irradiance", accepts: PortKind::RecordCache, takes: Takes::One, changes: false }],
    outputs: &[Output { name: "cache", about: "as many records, for a splat; none joins them", kind: PortKind::RecordCache }],
};

impl Pass for FilterRecords {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(cache) = e.record_cache("records").copied() else { return Ok(()) };
        if cache.coefficients.is_some() {
            return Err(Refusal::new(
                "plan::filtered_radiance",
                "records of radiance cannot be filtered",
                "join FilterRecords to a cache of irradiance, whose RecordCache has no input `lobes`",
            ));
        }
        let filtered = e.buffer("filtered", u64::from(cache.capacity) * RECORD_BYTES);
        let rule = cache.rule.farther(e.arguments.float("reach") as f32);
        let tolerance = e.arguments.float("tolerance") as f32;
        let bodies = e.over_pixels(e.setting.size);
        match e.place(bodies)? {
            Place::Host => encode_on_host(e, cache, (rule, tolerance), filtered),
            Place::Device => encode_on_device(e, cache, (rule, tolerance), filtered),
        }
        e.output("cache", Port::RecordCache(port::RecordCache { records: filtered, ..cache }));
        Ok(())
    }
}

fn encode_on_host(e: &mut Encoder<'_>, cache: port::RecordCache, (rule, tolerance): (port::Rule, f32), filtered: Resource) {
    e.host("filter", &[Read::counted(cache.records, RECORD_BYTES, cache.count)], &[filtered], move |host| {
        let records: Vec<weight::Record> = bytemuck::cast_slice::<_, Record>(host.read(cache.records)).iter().map(weight::Record::from).collect();
        let groups = Group::all(&records, &rule);
        let filter = RecordFilter::new(&groups, &rule, tolerance);
        let all: Vec<Record> = records.par_iter().map(|record| Record::from(&filter.filtered(record))).collect();
        host.write(filtered, 0, bytemuck::cast_slice(&all));
        Ok(())
    });
}

fn encode_on_device(e: &mut Encoder<'_>, cache: port::RecordCache, (rule, tolerance): (port::Rule, f32), filtered: Resource) {
    let weighting = e.constant_buffer("weighting", bytemuck::bytes_of(&Weighting::from(&rule)));
    let lists = RecordLists::encode(e, cache.records, weighting, cache.count, cache.capacity);
    let program = lists.bind(Program::new("filter_records")).constant("TOLERANCE", tolerance);
    let program = program.bind("weighting", weighting).bind("records", cache.records).bind("filtered", filtered);
    e.compute(program, "filter_record", Groups::Counted { count: cache.count, divisor: 64, per: 1 });
}
