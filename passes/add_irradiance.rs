//! Irradiance of a field, added to that of records.

use super::irradiance_field::{self, Asked, Point};
use super::record::{RECORD_BYTES, REQUEST_BYTES, Record, Request};
use crate::contract::{Bodies, Description, Encoder, Input, Output, PLACE, Pass, Place, Port, PortKind, Refusal, Takes, port};
use crate::schedule::*;
use fearless_simd::{Level, dispatch};
use glam::Vec3;
use rayon::prelude::*;

pub struct AddIrradiance;

static DESCRIPTION: Description = Description {
    name: "AddIrradiance",
    about: "Adds what a field tells to the irradiance of records; where places and field stay as they are while a loop runs the field is asked as the loop starts",
    source: "our own",
    parameters: &[PLACE],
    inputs: &[
        Input { name: "to", about: "records of those places, without gradients", accepts: PortKind::Records, takes: Takes::One, changes: false },
        Input { name: "at", about: "the places", accepts: PortKind::Requests, takes: Takes::One, changes: false },
        Input {
            name: "field",
            about: "what is asked; without it the records stay as they are",
            accepts: PortKind::IrradianceField,
            takes: Takes::AtMostOne,
            changes: false,
        },
    ],
    outputs: &[Output { name: "records", about: "the records with the light of both", kind: PortKind::Records }],
};

impl Pass for AddIrradiance {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let (Some(records), Some(requests)) = (e.records("to").copied(), e.requests("at").copied()) else { return Ok(()) };
        let Some(field) = e.irradiance_field("field").copied() else {
            e.output("records", Port::Records(records));
            return Ok(());
        };
        if matches!(field, port::IrradianceField::Lightmap(_)) {
            return Err(Refusal::new(
                "plan::lightmap_places",
                "places of records do not know the triangle that they are on, by which a lightmap is asked",
                "join the input `field` to a RecordIndex or a PhotonDensity, or ask the lightmap by the `indirect` of the HemisphereTiles",
            ));
        }
        let sum = e.buffer("records", u64::from(records.capacity) * RECORD_BYTES);
        match e.place(Bodies::BOTH)? {
            Place::Host => encode_on_host(e, &records, requests, sum),
            Place::Device => encode_on_device(e, &records, requests, &field, sum),
        }
        e.output("records", Port::Records(port::Records { records: sum, ..records }));
        Ok(())
    }
}

/// Adds commands that ask the field: as the loop starts if that is enough.
fn ask<T>(e: &mut Encoder<'_>, encode: impl FnOnce(&mut Encoder<'_>) -> T) -> T {
    if e.is_steady("at") && e.is_steady("field") { e.all_before_loop(encode) } else { encode(e) }
}

fn encode_on_device(e: &mut Encoder<'_>, records: &port::Records, requests: port::Requests, field: &port::IrradianceField, sum: Resource) {
    let asked = e.buffer("asked", 16 * u64::from(requests.capacity));
    let program = irradiance_field::bind(Program::new("add_irradiance"), field)
        .bind("requests", requests.places)
        .bind("asked", asked)
        .bind("records", records.records)
        .bind("sum", sum)
        .constant("CAPACITY", requests.capacity);
    let each = |count| Groups::Counted { count, divisor: 64, per: 1 };
    ask(e, |e| e.compute(program.clone(), "ask", each(requests.count)));
    e.compute(program, "add", each(records.count));
}

/// What a field told at the places.
type Kept = Vec<Vec3>;

fn encode_on_host(e: &mut Encoder<'_>, records: &port::Records, requests: port::Requests, sum: Resource) {
    let (memory, field) = (e.state("asked"), Asked::of(e, "field"));
    let places = Read::counted(requests.places, REQUEST_BYTES, requests.count);
    let reads: Vec<Read> = field.iter().flat_map(Asked::reads).chain([places]).collect();
    let told = move |host: &mut dyn HostContext| {
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        let index = field.and_then(|field| field.index(host));
        let field = field.and_then(|field| field.on_host(host, index.as_deref())).ok_or("the field has no index")?;
        let level = Level::new();
        let at = |place: &Request| dispatch!(level, simd => field.irradiance(simd, Point { position: place.position.into(), normal: place.normal.into(), triangle: 0 }));
        let kept: Kept = places.par_iter().map(at).collect();
        *host.state(memory) = Some(Box::new(kept));
        Ok(())
    };
    ask(e, |e| e.host("ask", &reads, &[], told));
    let records = *records;
    e.host("add", &[Read::counted(records.records, RECORD_BYTES, records.count)], &[sum], move |host| {
        let mut all: Vec<Record> = bytemuck::pod_collect_to_vec(host.read(records.records));
        let kept = host.state(memory).as_ref().and_then(|kept| kept.downcast_ref::<Kept>()).ok_or("the field was not asked")?;
        for (record, light) in all.iter_mut().zip(kept) {
            record.irradiance = (Vec3::from(record.irradiance) + *light).into();
        }
        host.write(sum, 0, bytemuck::cast_slice(&all));
        Ok(())
    });
}
