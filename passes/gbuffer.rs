//! The visible surfaces.

use crate::contract::{Description, Output, Pass, Port, PortKind, Recorder, Refusal, port, recorder::scene_constants};
use crate::recording::*;

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

    fn record(&self, r: &mut Recorder<'_>) -> Result<(), Refusal> {
        let size = r.setting.size;
        let triangles = r.image("triangles", size, Format::R32Uint);
        let depth = r.image("depth", size, Format::Depth32Float);
        let position = r.image("position", size, Format::Rgba32Float);
        let normal = r.image("normal", size, Format::Rgba32Float);
        let reflectance = r.image("reflectance", size, Format::Rgba16Float);
        let vertices = r.scene_data(SceneData::Positions);
        r.command(Command::Raster(Raster {
            program: scene_constants(Program::new("gbuffer"), r.setting.needs),
            vertex: "vertex",
            fragment: Some("fragment"),
            colours: vec![Target { texture: triangles, clear: Some([0.0; 4]), blend: Blend::Replace }],
            depth: Some(DepthTarget { texture: depth, layer: 0 }),
            vertices: Some(vertices),
            instances: None,
            indices: None,
            topology: Topology::Triangles,
            draws: Draws::Fixed(vec![Draw { rectangle: None, vertices: [0, 3 * r.setting.needs.triangles], is_indexed: false, instances: [0, 1] }]),
        }));
        let resolve = scene_constants(Program::new("gbuffer"), r.setting.needs)
            .bind("triangles", triangles)
            .bind("position", position)
            .bind("normal", normal)
            .bind("reflectance", reflectance);
        r.compute_pixels(resolve, "resolve", size);
        r.output("gbuffer", Port::GBuffer(port::GBuffer { size, position, normal, reflectance, triangles }));
        r.output("normal", Port::Image(port::Image { texture: normal, channels: port::Channels::Vector }));
        r.output("depth", Port::Image(port::Image { texture: normal, channels: port::Channels::Fourth }));
        r.output("position", Port::Image(port::Image { texture: position, channels: port::Channels::Vector }));
        r.output("reflectance", Port::Image(port::Image { texture: reflectance, channels: port::Channels::Colour }));
        Ok(())
    }
}
