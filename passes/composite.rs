//! The picture.

use super::image_sum;
use crate::contract::{Description, Encoder, Input, Output, Pass, Port, PortKind, Refusal, Takes, port};
use crate::schedule::*;

pub struct Composite;

static DESCRIPTION: Description = Description {
    name: "Composite",
    about: "Adds direct light, indirect light and what surfaces and sky emit toward the camera",
    source: "RCS section 4, step 5",
    parameters: &[],
    inputs: &[
        Input { name: "gbuffer", about: "the visible surfaces", accepts: PortKind::GBuffer, takes: Takes::One, changes: false },
        Input { name: "direct", about: "reflected direct light", accepts: PortKind::DirectLight, takes: Takes::AtMostOne, changes: false },
        Input { name: "indirect", about: "images of indirect radiance, which are added", accepts: PortKind::Image, takes: Takes::Any, changes: false },
    ],
    outputs: &[
        Output { name: "picture", about: "radiance toward the camera", kind: PortKind::Image },
        Output { name: "indirect", about: "the sum of the images of indirect light", kind: PortKind::Image },
    ],
};

impl Pass for Composite {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn indirect_light(&self) -> Option<&'static str> {
        Some("indirect")
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(gbuffer) = e.g_buffer("gbuffer").copied() else { return Ok(()) };
        let direct = e.direct_light("direct").map(|d| d.radiance);
        let parts: Vec<Resource> = e.images("indirect").iter().map(|image| image.texture).collect();
        let indirect = image_sum::sum(e, "indirect", &parts, gbuffer.size);
        let picture = e.image("picture", gbuffer.size, Format::Rgba32Float);
        // Direct light that is absent is bound to any image and never read.
        let program = Program::new("composite")
            .constant("TEXTURES", e.setting.needs.textures as u8)
            .constant("MIPMAPS", e.setting.needs.mipmaps as u8)
            .constant("GLOSSY", e.setting.needs.lobes as u8)
            .constant("SKY_IMAGE", e.setting.needs.sky_image as u8)
            .constant("HAS_DIRECT", direct.is_some() as u8)
            .bind("triangles", gbuffer.triangles)
            .bind("direct", direct.unwrap_or(gbuffer.position))
            .bind("indirect", indirect)
            .bind("picture", picture);
        e.compute_pixels(program, "composite", gbuffer.size);
        let image = |texture| Port::Image(port::Image { texture, channels: port::Channels::Colour });
        e.output("picture", image(picture));
        e.output("indirect", image(indirect));
        Ok(())
    }
}
