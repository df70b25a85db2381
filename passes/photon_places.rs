//! Where records made of photons stand: where photons are.

use super::photon_map::{PHOTON_BYTES, lookup::Lookup, unpacked_ways};
use super::record::{hand_on, requests};
use crate::contract::{Description, Input, Output, Parameter, ParameterKind, Pass, Port, PortKind, Recorder, Refusal};
use crate::math::thinning::{Vertex, thinned};
use crate::recording::*;

pub struct PhotonPlaces;

static DESCRIPTION: Description = Description {
    name: "PhotonPlaces",
    about: "Places for records among photons, thinned to one for each group of neighbours: dense where light is, whatever the camera sees; by the host",
    source: "THESIS 6.3; the order of places: our own",
    parameters: &[
        Parameter { name: "records", about: "most places", unit: "records", kind: ParameterKind::Integer { default: 4096, min: 1, max: 1 << 20 } },
        Parameter {
            name: "of",
            about: "photons that are looked at for each place, where there are so many",
            unit: "photons",
            kind: ParameterKind::Integer { default: 32, min: 4, max: 4096 },
        },
    ],
    inputs: &[Input { name: "map", about: "the photons", accepts: PortKind::PhotonMap, required: true, changes: false }],
    outputs: &[Output { name: "requests", about: "places for records", kind: PortKind::Requests }],
};

impl Pass for PhotonPlaces {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn record(&self, r: &mut Recorder<'_>) -> Result<(), Refusal> {
        let Some(map) = r.photon_map("map").copied() else { return Ok(()) };
        let [capacity, of] = ["records", "of"].map(|name| r.arguments.integer(name) as u32);
        let requests = requests(r, capacity);
        let reads = [Read::whole(map.codes), Read::counted(map.photons, PHOTON_BYTES, map.count)];
        r.host("thin", &reads, &[requests.places], move |host| {
            let photons = Lookup::of(&map, host).photons();
            let step = (photons.len() / (capacity as usize * of as usize)).max(1);
            let vertices = photons.iter().step_by(step).map(|photon| Vertex { position: photon.position.into(), normal: unpacked_ways(photon.ways)[0] });
            let vertices: Vec<Vertex> = vertices.collect();
            hand_on(host, &requests, thinned(vertices, capacity as usize));
            Ok(())
        });
        r.report_variable("photon_records", requests.made);
        r.output("requests", Port::Requests(requests));
        Ok(())
    }
}
