//! Brighten: an image, times a number. A start for a pass: say here what yours does.

use crate::contract::{Description, Encoder, Input, Output, Parameter, ParameterKind, Pass, Port, PortKind, Refusal, Takes, port};
use crate::schedule::*;

pub struct Brighten;

/// All that pipelines may write, and what `hemisplat passes Brighten` tells.
static DESCRIPTION: Description = Description {
    name: "Brighten",
    about: "An image, times a number",
    source: "our own",
    parameters: &[Parameter {
        name: "factor",
        about: "what each colour is multiplied by",
        unit: "",
        kind: ParameterKind::Float { default: 1.0, min: 0.0, max: 1e6 },
    }],
    inputs: &[
        Input { name: "gbuffer", about: "the visible surfaces, which tell the size", accepts: PortKind::GBuffer, takes: Takes::One, changes: false },
        Input { name: "of", about: "the image", accepts: PortKind::Image, takes: Takes::One, changes: false },
    ],
    outputs: &[Output { name: "image", about: "the product, pixel by pixel", kind: PortKind::Image }],
};

impl Pass for Brighten {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    /// Declares memory and encodes what a node is to do; nothing runs yet.
    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(gbuffer) = e.g_buffer("gbuffer").copied() else { return Ok(()) };
        let Some(image) = e.images("of").first().map(|image| image.texture) else { return Ok(()) };
        let product = e.image("product", gbuffer.size, Format::Rgba32Float);
        // Constants of the shader are its `override`s, resources are bound to its variables by name.
        let program = Program::new("brighten").constant("FACTOR", e.arguments.float("factor")).bind("image", image).bind("product", product);
        e.compute_pixels(program, "multiply", gbuffer.size);
        e.output("image", Port::Image(port::Image { texture: product, channels: port::Channels::Colour }));
        Ok(())
    }
}
