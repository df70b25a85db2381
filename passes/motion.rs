//! How far the picture has moved.

use crate::contract::{Description, Encoder, Input, Output, Pass, Port, PortKind, Refusal, Takes, port};
use crate::schedule::*;

pub struct Motion;

static DESCRIPTION: Description = Description {
    name: "Motion",
    about: "How far what each pixel sees has come since the picture before, as the camera and objects move",
    source: "THESIS 5.3",
    parameters: &[],
    inputs: &[Input { name: "gbuffer", about: "the visible surfaces", accepts: PortKind::GBuffer, takes: Takes::One, changes: false }],
    outputs: &[Output {
        name: "motion",
        about: "pixels to the right, pixels down, and scene units away from the camera, along its axis; 0 in a first picture",
        kind: PortKind::Image,
    }],
};

impl Pass for Motion {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(gbuffer) = e.g_buffer("gbuffer").copied() else { return Ok(()) };
        let motion = e.image("motion", gbuffer.size, Format::Rgba32Float);
        let program = Program::new("motion").bind("triangles", gbuffer.triangles).bind("position", gbuffer.position).bind("motion", motion);
        e.compute_pixels(program, "move_back", gbuffer.size);
        e.output("motion", Port::Image(port::Image { texture: motion, channels: port::Channels::Vector }));
        Ok(())
    }
}
