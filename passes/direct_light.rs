//! Direct light on the visible surfaces.

use crate::contract::{
    Choice, Description, Input, Output, Parameter, ParameterKind, Pass, Port, PortKind, Recorder, Refusal, port,
    recorder::{bind_visibility, light_constants},
};
use crate::recording::*;

pub struct DirectLight;

static DESCRIPTION: Description = Description {
    name: "DirectLight",
    about: "Light that reaches the visible surfaces without touching another: punctual lights, area lights, sky",
    source: "RCS section 4, step 5",
    parameters: &[Parameter {
        name: "emitters",
        about: "who lights surfaces from emissive surfaces and the sky",
        unit: "",
        kind: ParameterKind::Choice {
            choices: &[
                Choice {
                    name: "Sampled",
                    about: "this pass, by shadow rays; records leave emission out",
                    parameters: &[
                        Parameter {
                            name: "area_samples",
                            about: "shadow rays a pixel to area lights",
                            unit: "rays",
                            kind: ParameterKind::Integer { default: 64, min: 1, max: 4096 },
                        },
                        Parameter {
                            name: "sky_samples",
                            about: "shadow rays a pixel to the sky",
                            unit: "rays",
                            kind: ParameterKind::Integer { default: 64, min: 1, max: 4096 },
                        },
                    ],
                },
                Choice { name: "Records", about: "the records see emitters and sky; this pass leaves them out", parameters: &[] },
            ],
        },
    }],
    inputs: &[
        Input { name: "gbuffer", about: "the visible surfaces", accepts: PortKind::GBuffer, required: true },
        Input { name: "sky", about: "light of the sky that another pass computed; without it rays are traced", accepts: PortKind::Image, required: false },
        Input { name: "shadow", about: "maps of the punctual lights; without them shadows are traced by rays", accepts: PortKind::ShadowMaps, required: false },
    ],
    outputs: &[Output { name: "radiance", about: "reflected direct radiance toward the camera", kind: PortKind::DirectLight }],
};

impl Pass for DirectLight {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn record(&self, r: &mut Recorder<'_>) -> Result<(), Refusal> {
        let Some(gbuffer) = r.g_buffer("gbuffer").copied() else { return Ok(()) };
        let (emitters, arguments) = r.arguments.choice("emitters");
        let sampled = emitters == "Sampled";
        let sky = r.image_port("sky").map(|sky| sky.texture);
        let samples = if sampled { [arguments.integer("area_samples"), arguments.integer("sky_samples")] } else { [0, 0] };
        let radiance = r.image("radiance", Format::Rgba32Float);
        let [area, rays] = samples.map(|s| s as u32);
        let program = light_constants(Program::new("direct_light"), r.setting.needs, [area, if sky.is_some() { 0 } else { rays }]);
        // A sky that is absent is bound to any image and never read.
        let program = bind_visibility(program, r.shadow_maps("shadow"))
            .constant("HAS_SKY", sky.is_some() as u8)
            .bind("triangles", gbuffer.triangles)
            .bind("sky", sky.unwrap_or(gbuffer.position))
            .bind("radiance", radiance);
        r.compute_pixels(program, "shade");
        r.output("radiance", Port::DirectLight(port::DirectLight { radiance, lights_from_emitters: sampled }));
        Ok(())
    }
}
