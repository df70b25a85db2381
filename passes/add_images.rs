//! The sum of images.

use super::image_sum::sum;
use crate::contract::{Description, Encoder, Input, Output, Pass, Port, PortKind, Refusal, Takes, port};
use crate::schedule::*;

pub struct AddImages;

static DESCRIPTION: Description = Description {
    name: "AddImages",
    about: "Adds images, such as irradiance of two origins",
    source: "our own",
    parameters: &[],
    inputs: &[
        Input { name: "gbuffer", about: "the visible surfaces, which tell the size", accepts: PortKind::GBuffer, takes: Takes::One, changes: false },
        Input { name: "of", about: "images of colours", accepts: PortKind::Image, takes: Takes::Some, changes: false },
    ],
    outputs: &[Output { name: "sum", about: "their sum, pixel by pixel", kind: PortKind::Image }],
};

impl Pass for AddImages {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(gbuffer) = e.g_buffer("gbuffer").copied() else { return Ok(()) };
        let images: Vec<Resource> = e.images("of").iter().map(|image| image.texture).collect();
        let texture = sum(e, "sum", &images, gbuffer.size);
        e.output("sum", Port::Image(port::Image { texture, channels: port::Channels::Colour }));
        Ok(())
    }
}
