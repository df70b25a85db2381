//! Two passes, the shader that they share, and what flows between them.

use hemisplat::contract::{Description, Encoder, Format, Input, Output, Parameter, ParameterKind, Pass, Port, PortKind, Program, Refusal, Takes, port};

/// Of each pixel the share of those around it that show another surface: a buffer of floats, row by row.
const EDGES: &str = "a map of edges";

fn shader() -> Program {
    Program::own("ink", include_str!("ink.wgsl"))
}

const GBUFFER: Input = Input { name: "gbuffer", about: "the visible surfaces", accepts: PortKind::GBuffer, takes: Takes::One, changes: false };

pub struct Edges;

static OF_EDGES: Description = Description {
    name: "Edges",
    about: "Where surfaces end or bend",
    source: "our own",
    parameters: &[Parameter {
        name: "reach",
        about: "how far around a pixel others are looked at",
        unit: "pixels",
        kind: ParameterKind::Integer { default: 1, min: 1, max: 8 },
    }],
    inputs: &[GBUFFER],
    outputs: &[Output { name: "edges", about: "the share of pixels around each that show another surface", kind: PortKind::Own(EDGES) }],
};

impl Pass for Edges {
    fn description(&self) -> &'static Description {
        &OF_EDGES
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(gbuffer) = e.g_buffer("gbuffer").copied() else { return Ok(()) };
        let edges = e.buffer("edges", 4 * u64::from(gbuffer.size[0]) * u64::from(gbuffer.size[1]));
        let program = shader().constant("REACH", e.arguments.integer("reach") as i32);
        let program = program.bind("position", gbuffer.position).bind("normal", gbuffer.normal).bind("edges", edges);
        e.compute_pixels(program, "find", gbuffer.size);
        e.output("edges", Port::Own(port::Own { kind: EDGES, resources: vec![edges], variables: Vec::new() }));
        Ok(())
    }
}

pub struct Ink;

static OF_INK: Description = Description {
    name: "Ink",
    about: "A picture with its edges drawn in",
    source: "our own",
    parameters: &[Parameter {
        name: "strength",
        about: "how dark a pixel is all of whose neighbours show another surface; 1 is black",
        unit: "",
        kind: ParameterKind::Float { default: 1.0, min: 0.0, max: 10.0 },
    }],
    inputs: &[
        GBUFFER,
        Input { name: "of", about: "the picture", accepts: PortKind::Image, takes: Takes::One, changes: false },
        Input { name: "edges", about: "where the lines are", accepts: PortKind::Own(EDGES), takes: Takes::One, changes: false },
    ],
    outputs: &[Output { name: "picture", about: "the picture with lines", kind: PortKind::Image }],
};

impl Pass for Ink {
    fn description(&self) -> &'static Description {
        &OF_INK
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let (Some(gbuffer), Some(edges)) = (e.g_buffer("gbuffer").copied(), e.own("edges").cloned()) else { return Ok(()) };
        let Some(picture) = e.images("of").first().map(|image| image.texture) else { return Ok(()) };
        let inked = e.image("inked", gbuffer.size, Format::Rgba32Float);
        let program = shader().constant("STRENGTH", e.arguments.float("strength")).bind("picture", picture).bind("inked", inked);
        e.compute_pixels(program.bind("edges", edges.resources[0]), "draw", gbuffer.size);
        e.output("picture", Port::Image(port::Image { texture: inked, channels: port::Channels::Colour }));
        Ok(())
    }
}
