//! What stands for the directions that a shape leaves out.

use crate::contract::{Choice, Description, Encoder, Input, Output, Parameter, ParameterKind, Pass, Port, PortKind, Refusal, Takes, port};
use crate::math::hemisphere::{Method, Table};
use std::sync::Arc;

pub struct Compensation;

static DESCRIPTION: Description = Description {
    name: "Compensation",
    about: "The weight of every sample, so that an incomplete shape stands for the whole hemisphere; complete shapes need none",
    source: "RCS section 5.2, Table 1; SLIDES 28-33; Larsen and Christensen 2004",
    parameters: &[Parameter {
        name: "method",
        about: "how the rest of the hemisphere is made up for",
        unit: "",
        kind: ParameterKind::Choice {
            choices: &[
                Choice { name: "BorderExtension", about: "a border sample also stands for the band between it and the horizon", parameters: &[] },
                Choice { name: "CoverageRatio", about: "the sum is divided by the share of the hemisphere that is covered", parameters: &[] },
                Choice {
                    name: "ConfusedMeasure",
                    about: "border extension by solid angle times the sample's cosine: 1.17 times too much of uniform light",
                    parameters: &[],
                },
                Choice { name: "None", about: "what is not seen counts as black", parameters: &[] },
            ],
        },
    }],
    inputs: &[Input { name: "of", about: "the tiles", accepts: PortKind::Tiles, takes: Takes::One, changes: false }],
    outputs: &[Output { name: "tiles", about: "the tiles with their weights", kind: PortKind::WeightedTiles }],
};

impl Pass for Compensation {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(tiles) = e.tiles("of").cloned() else { return Ok(()) };
        let method = match e.arguments.choice("method").0 {
            "CoverageRatio" => Method::CoverageRatio,
            "ConfusedMeasure" => Method::ConfusedMeasure,
            "None" => Method::None,
            _ => Method::BorderExtension,
        };
        if !tiles.shape.is_incomplete() {
            e.idle("method", "the tiles leave nothing out");
        }
        let table = Arc::new(
            Table::new(tiles.shape, tiles.resolution, method).map_err(|e| Refusal::new("plan::tile", e.to_string(), "choose another shape or resolution"))?,
        );
        e.output("tiles", Port::WeightedTiles(port::WeightedTiles { tiles, table }));
        Ok(())
    }
}
