//! The visible surfaces.

use crate::contract::{Description, Encoder, Output, Pass, Port, PortKind, Refusal, encoder::scene_constants, port};
use crate::schedule::*;

pub struct GBuffer;

static DESCRIPTION: Description = Description {
    name: "GBuffer",
    about: "What each pixel's centre sees: position, normal, reflectance, depth, the width of a pixel there",
    source: "RCS section 4, step 1",
    parameters: &[],
    inputs: &[],
    outputs: &[
        Output { name: "gbuffer", about: "all of it", kind: PortKind::GBuffer },
        Output { name: "normal", about: "unit shading normal, facing the viewer", kind: PortKind::Image },
        Output { name: "depth", about: "depth along the camera's axis", kind: PortKind::Image },
        Output { name: "position", about: "position, and the width of a pixel in the fourth channel", kind: PortKind::Image },
        Output { name: "reflectance", about: "diffuse reflectance", kind: PortKind::Image },
    ],
};

impl Pass for GBuffer {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let size = e.setting.size;
        let drawn = e.image("drawn", size, Format::R32Uint);
        let depth = e.image("depth", size, Format::Depth32Float);
        let position = e.image("position", size, Format::Rgba32Float);
        let normal = e.image("normal", size, Format::Rgba32Float);
        let reflectance = e.image("reflectance", size, Format::Rgba16Float);
        let vertices = e.scene_data(SceneData::Positions);
        e.command(Command::Raster(Raster {
            program: scene_constants(Program::new("gbuffer"), e.setting.needs),
            vertex: "vertex",
            fragment: Some("fragment"),
            colours: vec![Target { texture: drawn, clear: Some([0.0; 4]), blend: Blend::Replace }],
            depth: Some(DepthTarget { texture: depth, layer: 0, clears: true }),
            vertices: Some(vertices),
            instances: None,
            indices: None,
            topology: Topology::Triangles,
            draws: Draws::Fixed(vec![Draw { rectangle: None, vertices: [0, 3 * e.setting.needs.triangles], is_indexed: false, instances: [0, 1] }]),
        }));
        let triangles = if e.setting.needs.two_sides { settle(e, drawn) } else { drawn };
        let resolve = scene_constants(Program::new("gbuffer"), e.setting.needs)
            .bind("triangles", triangles)
            .bind("position", position)
            .bind("normal", normal)
            .bind("reflectance", reflectance);
        e.compute_pixels(resolve, "resolve", size);
        e.output("gbuffer", Port::GBuffer(port::GBuffer { size, position, normal, reflectance, triangles }));
        e.output("normal", Port::Image(port::Image { texture: normal, channels: port::Channels::Vector }));
        e.output("depth", Port::Image(port::Image { texture: normal, channels: port::Channels::Fourth }));
        e.output("position", Port::Image(port::Image { texture: position, channels: port::Channels::Vector }));
        e.output("reflectance", Port::Image(port::Image { texture: reflectance, channels: port::Channels::Colour }));
        Ok(())
    }
}

/// What is seen along the outlines of surfaces with two sides, as rays tell it.
fn settle(e: &mut Encoder<'_>, drawn: Resource) -> Resource {
    let size = e.setting.size;
    let triangles = e.image("triangles", size, Format::R32Uint);
    let program = scene_constants(Program::new("outlines"), e.setting.needs).bind("drawn", drawn).bind("triangles", triangles);
    e.compute_pixels(program, "settle", size);
    triangles
}
