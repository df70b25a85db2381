//! From weighted sums to irradiance and radiance.

use crate::contract::{Description, Encoder, Input, Output, Pass, Port, PortKind, Refusal, Takes, port};
use crate::schedule::*;

mod coarser;

pub struct Normalize;

static DESCRIPTION: Description = Description {
    name: "Normalize",
    about: "Divides the sums of the splat by their weight; counts uncovered and non-finite pixels. Where a loop ended early, records reach farther for pixels that miss one",
    source: "RCS 1 and section 4, step 5",
    parameters: &[],
    inputs: &[
        Input { name: "splats", about: "the sums", accepts: PortKind::Splats, takes: Takes::One, changes: true },
        Input { name: "errors", about: "sums of standard errors", accepts: PortKind::Splats, takes: Takes::AtMostOne, changes: false },
        Input { name: "gbuffer", about: "the visible surfaces", accepts: PortKind::GBuffer, takes: Takes::One, changes: false },
    ],
    outputs: &[
        Output {
            name: "radiance",
            about: "indirect radiance toward the camera: what the diffuse part reflects, or of sums of radiance what the lobe does",
            kind: PortKind::Image,
        },
        Output { name: "irradiance", about: "indirect irradiance [W/m²]", kind: PortKind::Image },
        Output { name: "uncertainty", about: "standard error of the irradiance, of sums of errors [W/m²]", kind: PortKind::Image },
        Output { name: "weight", about: "sums; the fourth channel is Σ w", kind: PortKind::Image },
        Output { name: "count", about: "records that count at each pixel", kind: PortKind::Image },
    ],
};

impl Pass for Normalize {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let (Some(splats), Some(gbuffer)) = (e.splats("splats").cloned(), e.g_buffer("gbuffer").copied()) else { return Ok(()) };
        let errors = e.splats("errors").cloned();
        for (input, found, wanted) in [("splats", splats.of_errors, false), ("errors", errors.as_ref().is_none_or(|errors| errors.of_errors), true)] {
            if found != wanted {
                return Err(Refusal::new(
                    "plan::errors",
                    format!("the input `{input}` takes sums of {}", if wanted { "standard errors" } else { "estimates" }),
                    "see the parameter `of` of the Splat that it is joined to",
                ));
            }
        }
        let irradiance = e.image("irradiance", gbuffer.size, Format::Rgba32Float);
        let radiance = e.image("radiance", gbuffer.size, Format::Rgba32Float);
        let faults = e.buffer("faults", 16);
        e.clear(faults);
        let of_radiance = splats.lobes.is_some();
        coarser::encode(e, &splats, &gbuffer);
        let program = Program::new("normalize")
            .constant("OF_RADIANCE", of_radiance as u8)
            .bind("sums", splats.sums)
            .bind("position", gbuffer.position)
            .bind("reflectance", gbuffer.reflectance)
            .bind("irradiance", irradiance)
            .bind("radiance", radiance)
            .bind("faults", faults);
        e.compute_pixels(program, "divide", gbuffer.size);
        e.report("uncovered_pixels", faults, 0);
        e.report("non_finite_pixels", faults, 1);
        if let Some(errors) = errors {
            let uncertainty = e.image("uncertainty", gbuffer.size, Format::Rgba32Float);
            let program = Program::new("normalize").bind("sums", errors.sums).bind("position", gbuffer.position).bind("uncertainty", uncertainty);
            e.compute_pixels(program, "divide_errors", gbuffer.size);
            e.output("uncertainty", Port::Image(port::Image { texture: uncertainty, channels: port::Channels::Colour }));
        }
        let image = |texture, channels| Port::Image(port::Image { texture, channels });
        e.output("radiance", image(radiance, port::Channels::Colour));
        if of_radiance {
            e.report("negative_pixels", faults, 2);
        } else {
            e.output("irradiance", image(irradiance, port::Channels::Colour));
        }
        e.output("weight", image(splats.sums, port::Channels::Fourth));
        if let Some(counts) = splats.counts {
            e.output("count", image(counts, port::Channels::Single));
        }
        Ok(())
    }
}
