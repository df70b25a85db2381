//! The photon map asked for the irradiance anywhere.

use super::photons::{DIRECT, REACH, expect_direct_light};
use crate::contract::{Description, Input, Output, Parameter, ParameterKind, Pass, Port, PortKind, Recorder, Refusal, Takes, port};

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
        REACH,
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

    fn record(&self, r: &mut Recorder<'_>) -> Result<(), Refusal> {
        let Some(map) = r.photon_map("map").copied() else { return Ok(()) };
        expect_direct_light(r)?;
        let density = port::PhotonDensity {
            map,
            wanted: r.arguments.integer("photons") as u32,
            reach: r.arguments.float("reach") as f32 * r.setting.needs.extent,
            edges: r.arguments.bool("edges"),
        };
        r.output("field", Port::IrradianceField(port::IrradianceField::Photons(density)));
        Ok(())
    }
}
