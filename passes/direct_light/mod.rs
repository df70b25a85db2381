//! Direct light on the visible surfaces.

mod host;
mod sky;

use super::seen_light::SHADOW;
use crate::contract::{
    Bodies, Choice, Description, Encoder, Input, MOST_BYTES, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes,
    encoder::{bind_visibility, light_constants},
    port,
};
use crate::scene::needs::Needs;
use crate::schedule::*;
use host::By;

pub struct DirectLight;

static DESCRIPTION: Description = Description {
    name: "DirectLight",
    about: "Light that reaches the visible surfaces without touching another: punctual lights, area lights, sky; what takes shadow rays can be added up by the host",
    source: "RCS section 4, step 5",
    parameters: &[
        Parameter {
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
                            Parameter {
                                name: "tolerance",
                                about: "how far what two pixels beside each other see of the broad sky may lie apart, and count together; 0 for each pixel alone",
                                unit: "standard errors",
                                kind: ParameterKind::Float { default: 1.0, min: 0.0, max: 100.0 },
                            },
                        ],
                    },
                    Choice { name: "Records", about: "the records see emitters and sky; this pass leaves them out", parameters: &[] },
                ],
            },
        },
        PLACE,
    ],
    inputs: &[
        Input { name: "gbuffer", about: "the visible surfaces", accepts: PortKind::GBuffer, takes: Takes::One, changes: false },
        Input {
            name: "sky",
            about: "light of the sky that another pass computed; without it rays are traced",
            accepts: PortKind::Image,
            takes: Takes::AtMostOne,
            changes: false,
        },
        SHADOW,
    ],
    outputs: &[Output { name: "radiance", about: "reflected direct radiance toward the camera", kind: PortKind::DirectLight }],
};

impl Pass for DirectLight {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(gbuffer) = e.g_buffer("gbuffer").copied() else { return Ok(()) };
        let (emitters, arguments) = e.arguments.choice("emitters");
        let sampled = emitters == "Sampled";
        let sky = e.image_port("sky").map(|sky| sky.texture);
        let samples = if sampled { [arguments.integer("area_samples"), arguments.integer("sky_samples")] } else { [0, 0] };
        let radiance = e.image("radiance", gbuffer.size, Format::Rgba32Float);
        let [area, rays] = samples.map(|s| s as u32);
        let samples = [area, if sky.is_some() { 0 } else { rays }];
        tell_idle(e, sampled, sky.is_some());
        let tolerance = if sampled { arguments.float("tolerance") as f32 } else { 0.0 };
        let by_host = by_host(e, (samples, tolerance), gbuffer.size)?;
        let is_sky_apart = by_host.is_none() && samples[1] > 0 && e.setting.needs.environment;
        let all = e.setting.needs;
        let without_lights = by_host.filter(|by| by.punctual).map(|_| Needs { punctual_lights: Some(0), light_kinds: 0, ..all.clone() });
        let program = light_constants(Program::new("direct_light"), without_lights.as_ref().unwrap_or(all), samples);
        let program = match by_host {
            Some(by) => program.import("EMITTERS", "lib/emitters/given").bind("given", host::encode(e, &gbuffer, by)),
            None => program.import("EMITTERS", "lib/emitters/traced").constant("SKY_APART", is_sky_apart as u8),
        };
        let rest = if is_sky_apart { e.image("rest", gbuffer.size, Format::Rgba32Float) } else { radiance };
        // A sky that is absent is bound to any image and never read.
        let program = bind_visibility(program, e.shadow_maps("shadow"))
            .constant("HAS_SKY", sky.is_some() as u8)
            .bind("triangles", gbuffer.triangles)
            .bind("sky", sky.unwrap_or(gbuffer.position))
            .bind("radiance", rest);
        e.compute_pixels(program, "shade", gbuffer.size);
        if is_sky_apart {
            sky::encode(e, &gbuffer, (rest, radiance), (samples[1], tolerance));
        }
        e.output("radiance", Port::DirectLight(port::DirectLight { radiance, lights_from_emitters: sampled }));
        Ok(())
    }
}

/// Tells what has no effect where there is no such light.
fn tell_idle(e: &mut Encoder<'_>, sampled: bool, has_sky: bool) {
    let needs = e.setting.needs;
    let (emits, shines) = (needs.emissive_triangles > 0, needs.environment);
    let idle = [
        (!emits && !shines, "emitters", "no surface emits light and the sky is black"),
        (sampled && shines && !emits, "emitters.area_samples", "no surface emits light"),
        (sampled && emits && !shines, "emitters.sky_samples", "the sky is black"),
        (sampled && shines && has_sky, "emitters.sky_samples", "another pass computes the light of the sky"),
        (sampled && emits && !shines, "emitters.tolerance", "the sky is black"),
        (sampled && shines && has_sky, "emitters.tolerance", "another pass computes the light of the sky"),
    ];
    idle.into_iter().filter(|(holds, ..)| *holds).for_each(|(_, parameter, because)| e.idle(parameter, because));
}

/// What the host is to light surfaces by, if it is to: of `samples` to area lights and to the sky those that there is light for, and punctual lights without maps.
fn by_host(e: &mut Encoder<'_>, ([area, sky], tolerance): ([u32; 2], f32), size: [u32; 2]) -> Result<Option<By>, Refusal> {
    let punctual = e.setting.needs.punctual_lights != Some(0) && e.shadow_maps("shadow").is_none();
    let needs = e.setting.needs;
    let samples = [if needs.emissive_triangles > 0 { area } else { 0 }, if needs.environment { sky } else { 0 }];
    if samples == [0; 2] && !punctual {
        e.idle(PLACE.name, "the device does it where no shadow rays go to lights, emitters or the sky");
        return Ok(None);
    }
    let is_too_large = host::bytes(size) > MOST_BYTES;
    let obstacle = format!("the light of so many pixels does not fit into {} MiB", MOST_BYTES >> 20);
    let place = e.place(Bodies::BOTH.unless(is_too_large, obstacle))?;
    Ok((place == Place::Host).then_some(By { punctual, samples, tolerance }))
}
