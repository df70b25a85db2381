//! The picture.

use crate::contract::{Description, Input, Output, Pass, Port, PortKind, Recorder, Refusal, Takes, port};
use crate::recording::*;

pub struct Combine;

static DESCRIPTION: Description = Description {
    name: "Combine",
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

impl Pass for Combine {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn indirect_light(&self) -> Option<&'static str> {
        Some("indirect")
    }

    fn record(&self, r: &mut Recorder<'_>) -> Result<(), Refusal> {
        let Some(gbuffer) = r.g_buffer("gbuffer").copied() else { return Ok(()) };
        let direct = r.direct_light("direct").map(|d| d.radiance);
        let parts: Vec<Resource> = r.images("indirect").iter().map(|image| image.texture).collect();
        let indirect = sum(r, &parts, gbuffer.size);
        let picture = r.image("picture", gbuffer.size, Format::Rgba32Float);
        // Direct light that is absent is bound to any image and never read.
        let program = Program::new("combine")
            .constant("TEXTURES", r.setting.needs.textures as u8)
            .constant("GLOSSY", r.setting.needs.lobes as u8)
            .constant("HAS_DIRECT", direct.is_some() as u8)
            .bind("triangles", gbuffer.triangles)
            .bind("direct", direct.unwrap_or(gbuffer.position))
            .bind("indirect", indirect)
            .bind("picture", picture);
        r.compute_pixels(program, "combine_parts", gbuffer.size);
        let image = |texture| Port::Image(port::Image { texture, channels: port::Channels::Colour });
        r.output("picture", image(picture));
        r.output("indirect", image(indirect));
        Ok(())
    }
}

/// Adds images two by two; one alone is its own sum, and that of none is black.
fn sum(r: &mut Recorder<'_>, images: &[Resource], size: [u32; 2]) -> Resource {
    let [first, others @ ..] = images else {
        let black = r.image("indirect", size, Format::Rgba32Float);
        r.clear(black);
        return black;
    };
    others.iter().fold(*first, |left, right| {
        let sum = r.image("indirect", size, Format::Rgba32Float);
        r.compute_pixels(Program::new("add_images").bind("left", left).bind("right", *right).bind("sum", sum), "add", size);
        sum
    })
}
