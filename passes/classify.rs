//! Some of the visible surfaces.

use crate::contract::{
    Arguments, Choice, Description, Encoder, Input, Need, Output, Parameter, ParameterKind, Pass, Port, PortKind, Refusal, Takes, encoder::scene_constants,
    port,
};
use crate::scene::needs::Needs;
use crate::schedule::*;

pub struct Classify;

static DESCRIPTION: Description = Description {
    name: "Classify",
    about: "The visible surfaces of one kind: what comes after sees nothing at the other pixels",
    source: "RCS section 4.1: irradiance records for diffuse surfaces, radiance records for glossy ones",
    parameters: &[Parameter {
        name: "which",
        about: "the surfaces that stay; those with a diffuse part and a lobe are of both kinds",
        unit: "",
        kind: ParameterKind::Choice {
            choices: &[
                Choice { name: "Diffuse", about: "with a diffuse part", parameters: &[] },
                Choice { name: "Glossy", about: "with a lobe", parameters: &[] },
            ],
        },
    }],
    inputs: &[
        Input { name: "of", about: "the visible surfaces", accepts: PortKind::GBuffer, takes: Takes::One, changes: false },
        Input { name: "lobes", about: "their lobes; glossy surfaces need them", accepts: PortKind::Lobes, takes: Takes::AtMostOne, changes: false },
    ],
    outputs: &[
        Output { name: "gbuffer", about: "the surfaces that stay", kind: PortKind::GBuffer },
        Output { name: "lobes", about: "of glossy ones the lobe at each pixel", kind: PortKind::VisibleLobes },
    ],
};

fn is_glossy(arguments: &Arguments) -> bool {
    arguments.choice("which").0 == "Glossy"
}

impl Pass for Classify {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn need(&self, arguments: &Arguments, needs: &Needs) -> Need {
        match is_glossy(arguments) {
            true if !needs.lobes => Need::Dropped("no material is glossy"),
            false if !needs.diffuse => Need::Dropped("no material has a diffuse part"),
            _ => Need::Kept,
        }
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(gbuffer) = e.g_buffer("of").copied() else { return Ok(()) };
        let glossy = is_glossy(e.arguments);
        if !glossy && !e.setting.needs.lobes {
            // All of them.
            e.output("gbuffer", Port::GBuffer(gbuffer));
            return Ok(());
        }
        let position = e.image("position", gbuffer.size, Format::Rgba32Float);
        let program = scene_constants(Program::new("classify"), e.setting.needs)
            .bind("position", gbuffer.position)
            .bind("reflectance", gbuffer.reflectance)
            .bind("triangles", gbuffer.triangles)
            .bind("kept", position);
        if glossy {
            let Some(lobes) = e.lobes("lobes").cloned() else {
                return Err(port::Lobes::missing());
            };
            let seen = e.image("seen", gbuffer.size, Format::Rgba32Float);
            e.compute_pixels(program.bind("tables", lobes.of_material).bind("seen", seen), "keep_glossy", gbuffer.size);
            e.output("lobes", Port::VisibleLobes(port::VisibleLobes { lobes, seen }));
        } else {
            e.compute_pixels(program, "keep_diffuse", gbuffer.size);
        }
        e.output("gbuffer", Port::GBuffer(port::GBuffer { position, ..gbuffer }));
        Ok(())
    }
}
