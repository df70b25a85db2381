//! The photon map asked for the irradiance anywhere.

use super::photons::{DIRECT, SEARCH_RADIUS, expect_direct_light};
use crate::contract::{Description, Encoder, Input, Output, Parameter, ParameterKind, Pass, Port, PortKind, Refusal, Takes, port};

pub struct PhotonDensity;

static DESCRIPTION: Description = Description {
    name: "PhotonDensity",
    about: "Estimates the irradiance at any point from the photons that arrive near it: their flux over the area that they stand for",
    source: "Jensen 1996; the area: THESIS 6.3",
    parameters: &[
        Parameter {
            name: "photons",
            about: "photons of a point, where there are so many near",
            unit: "photons",
            kind: ParameterKind::Integer { default: 64, min: 1, max: 4096 },
        },
        SEARCH_RADIUS,
        Parameter {
            name: "edges",
            about: "find the area that photons stand for by their outline, where an edge cuts their disc; otherwise it is all of the disc",
            unit: "",
            kind: ParameterKind::Bool { default: true },
        },
    ],
    inputs: &[Input { name: "map", about: "the photons", accepts: PortKind::PhotonMap, takes: Takes::One, changes: false }, DIRECT],
    outputs: &[Output { name: "field", about: "the irradiance at any point", kind: PortKind::IrradianceField }],
};

impl Pass for PhotonDensity {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(map) = e.photon_map("map").copied() else { return Ok(()) };
        expect_direct_light(e)?;
        let density = port::PhotonDensity {
            map,
            wanted: e.arguments.integer("photons") as u32,
            search_radius: e.arguments.float("search_radius") as f32 * e.setting.needs.extent,
            edges: e.arguments.bool("edges"),
        };
        e.output("field", Port::IrradianceField(port::IrradianceField::Photons(density)));
        Ok(())
    }
}
