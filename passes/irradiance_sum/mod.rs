//! From tiles to records.

use super::record::{RECORD_BYTES, Radius};
use crate::contract::{
    Bodies, Choice, Description, Encoder, Input, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes, port,
};
use crate::schedule::*;

mod cpu_readback;
mod host;
mod mipmap_chain;
mod ping_pong;
mod reduce;
pub mod workgroup_tree;

pub struct IrradianceSum;

static DESCRIPTION: Description = Description {
    name: "IrradianceSum",
    about: "Irradiance, rotation and translation gradients and harmonic mean distance of every tile",
    source: "RCS sections 2 and 5.2; THESIS 4.4.2; MESH 5; curvature: Schwarzhaupt and others 2012",
    parameters: &[
        Parameter {
            name: "by",
            about: "how a tile is summed",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice {
                        name: "WorkgroupTree",
                        about: "one workgroup a tile, a tree in its memory; by the host, eight samples side by side",
                        parameters: &[],
                    },
                    Choice {
                        name: "MipmapChain",
                        about: "averages of 2×2 texels down to one a tile, in seven images (RCS); tiles of a power of two, or of little more",
                        parameters: &[reduce::STORAGE],
                    },
                    Choice {
                        name: "PingPong",
                        about: "two images take turns down to 16×16 texels a tile, which the host adds (MESH)",
                        parameters: &[reduce::STORAGE],
                    },
                    Choice { name: "CpuReadback", about: "the tiles are read back and added on the host in double precision", parameters: &[] },
                ],
            },
        },
        Parameter {
            name: "radius",
            about: "what a record's validity radius is in proportion to",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice {
                        name: "HarmonicMean",
                        about: "the harmonic mean distance of what the tile sees: it changes as fast at most (RCS 2)",
                        parameters: &[],
                    },
                    Choice {
                        name: "Curvature",
                        about: "how far extrapolation along the gradient holds, by the second derivatives: an ellipse; needs gradients",
                        parameters: &[],
                    },
                ],
            },
        },
        Parameter { name: "gradients", about: "rotation and translation gradients, or none", unit: "", kind: ParameterKind::Bool { default: true } },
        PLACE,
    ],
    inputs: &[Input { name: "of", about: "tiles with weights", accepts: PortKind::WeightedTiles, takes: Takes::One, changes: false }],
    outputs: &[Output { name: "records", about: "one record a tile", kind: PortKind::Records }],
};

/// What the ways of summing share.
struct Work<'a> {
    weighted: &'a port::WeightedTiles,
    records: Resource,
    gradients: bool,
    radius: Radius,
}

impl Work<'_> {
    fn layout(&self, program: Program) -> Program {
        let tiles = &self.weighted.tiles;
        program
            .constant("TILE_WIDTH", tiles.table.width)
            .constant("TILE_HEIGHT", tiles.table.height)
            .constant("TILES_PER_ROW", tiles.tiles_per_row)
            .constant("TILE_CAPACITY", tiles.requests.capacity)
            .constant("GRADIENTS", self.gradients as u8)
            .constant("BLOCK_SHARE", self.weighted.table.block_share() as f32)
            .constant("RADIUS", self.radius as u32)
    }
}

impl Pass for IrradianceSum {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(weighted) = e.weighted_tiles("of") else { return Ok(()) };
        let requests = weighted.tiles.requests;
        let records = e.buffer("records", requests.capacity as u64 * RECORD_BYTES);
        let gradients = e.arguments.bool("gradients");
        let radius = if e.arguments.choice("radius").0 == "Curvature" { Radius::Curvature } else { Radius::HarmonicMean };
        if radius == Radius::Curvature && !gradients {
            return Err(Refusal::of_parameter(
                "radius",
                "plan::curvature",
                "Curvature bounds the error of an extrapolation along gradients, which are off",
                "set gradients to true, or radius to HarmonicMean",
            ));
        }
        let work = Work { weighted, records, gradients, radius };
        let (by, arguments) = e.arguments.choice("by");
        let bodies = Bodies::BOTH
            .better_at(work.weighted.tiles.place, "the tiles were shaded there")
            .unless(matches!(by, "MipmapChain" | "PingPong"), format!("{by} is a way of the device"))
            .unless_on_device(by == "CpuReadback", "CpuReadback reads the tiles back");
        match (e.place(bodies)?, by) {
            (_, "MipmapChain") => mipmap_chain::encode(e, &work, arguments)?,
            (_, "PingPong") => ping_pong::encode(e, &work, arguments),
            (_, "CpuReadback") => cpu_readback::encode(e, &work),
            (Place::Host, _) => host::encode(e, &work),
            (Place::Device, _) => workgroup_tree::encode(e, &work),
        }
        let port::Tiles { sees_emission, is_steady, .. } = weighted.tiles;
        let (count, capacity) = (requests.count, requests.capacity);
        e.output("records", Port::Records(port::Records { records, coefficients: None, count, capacity, is_steady, sees_emission }));
        Ok(())
    }
}
