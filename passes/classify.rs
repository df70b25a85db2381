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
                Choice { name: "Wide", about: "with a lobe that ten degrees of harmonics hold", parameters: &[] },
                Choice { name: "Sharp", about: "with a lobe that they do not hold, for LobeRays", parameters: &[] },
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

/// The surfaces that stay.
#[derive(Clone, Copy, PartialEq)]
enum Which {
    Diffuse,
    Glossy,
    Wide,
    Sharp,
}

impl Which {
    fn of(arguments: &Arguments) -> Self {
        match arguments.choice("which").0 {
            "Glossy" => Self::Glossy,
            "Wide" => Self::Wide,
            "Sharp" => Self::Sharp,
            _ => Self::Diffuse,
        }
    }
}

impl Pass for Classify {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn need(&self, arguments: &Arguments, needs: &Needs) -> Need {
        match Which::of(arguments) {
            Which::Diffuse if !needs.diffuse => Need::Dropped("no material has a diffuse part"),
            Which::Glossy if !needs.lobes => Need::Dropped("no material is glossy"),
            Which::Wide if !needs.wide_lobes => Need::Dropped("no material has a wide lobe"),
            Which::Sharp if !needs.sharp_lobes => Need::Dropped("no material has a sharp lobe"),
            _ => Need::Kept,
        }
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(gbuffer) = e.g_buffer("of").copied() else { return Ok(()) };
        let which = Which::of(e.arguments);
        if which == Which::Diffuse && !e.setting.needs.lobes {
            // All of them.
            e.output("gbuffer", Port::GBuffer(gbuffer));
            return Ok(());
        }
        let position = e.image("position", gbuffer.size, Format::Rgba32Float);
        let program = scene_constants(Program::new("classify"), e.setting.needs)
            .bind("position", gbuffer.position)
            .bind("triangles", gbuffer.triangles)
            .bind("kept", position);
        match which {
            Which::Diffuse => e.compute_pixels(program.bind("reflectance", gbuffer.reflectance), "keep_diffuse", gbuffer.size),
            Which::Sharp => e.compute_pixels(program, "keep_sharp", gbuffer.size),
            Which::Glossy | Which::Wide => {
                let lobes = e.lobes("lobes").cloned().ok_or_else(port::Lobes::missing)?;
                if which == Which::Glossy && lobes.leaves_sharp {
                    return Err(Refusal::of_parameter(
                        "which",
                        "plan::lobes_left",
                        "sharp lobes are asked for, and LobeCoefficients leaves them to another pass",
                        "choose Wide here, and Sharp for LobeRays; or set `too_sharp` of LobeCoefficients to Blur",
                    ));
                }
                let seen = e.image("seen", gbuffer.size, Format::Rgba32Float);
                let program = program.constant("SHARP_TOO", (which == Which::Glossy) as u8).bind("tables", lobes.of_material).bind("seen", seen);
                e.compute_pixels(program, "keep_glossy", gbuffer.size);
                e.output("lobes", Port::VisibleLobes(port::VisibleLobes { lobes, seen }));
            }
        }
        e.output("gbuffer", Port::GBuffer(port::GBuffer { position, ..gbuffer }));
        Ok(())
    }
}
