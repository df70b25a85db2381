//! What texels see that send their light out.

use super::see;
use crate::contract::{Bodies, Choice, Description, Encoder, Input, MOST_BYTES, Output, PLACE, Parameter, ParameterKind, Pass, Port, PortKind, Refusal, Takes};
use crate::math::hemisphere::Shape;

pub struct ShooterView;

static DESCRIPTION: Description = Description {
    name: "ShooterView",
    about: "Which triangles are seen from texels that shoot: what most shadow rays need not be cast for",
    source: "STOCH section 3.2; numbers of triangles in place of depths: our own",
    parameters: &[
        Parameter {
            name: "shape",
            about: "how directions are laid out",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Hemispherical", about: "x and y of the unit direction", parameters: &[] },
                    Choice { name: "Hemicube", about: "five squares", parameters: &[] },
                ],
            },
        },
        Parameter {
            name: "by",
            about: "how a sample finds what it sees",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Rays", about: "one ray a sample through the hierarchy", parameters: &[] },
                    Choice { name: "Raster", about: "the device rasterises the scene from each texel", parameters: &[] },
                ],
            },
        },
        Parameter { name: "resolution", about: "samples along an edge", unit: "samples", kind: ParameterKind::Integer { default: 128, min: 16, max: 512 } },
        PLACE,
    ],
    inputs: &[Input { name: "from", about: "where it is seen from", accepts: PortKind::Shooters, takes: Takes::One, changes: false }],
    outputs: &[Output { name: "views", about: "the triangles", kind: PortKind::ShooterViews }],
};

impl Pass for ShooterView {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(from) = e.shooters("from").copied() else { return Ok(()) };
        let shape = if e.arguments.choice("shape").0 == "Hemicube" { Shape::Hemicube } else { Shape::Hemispherical };
        let resolution = e.arguments.integer("resolution") as u32;
        let samples: u64 = shape.size(resolution).into_iter().map(u64::from).product();
        if 4 * samples * u64::from(from.requests.capacity) > MOST_BYTES {
            return Err(Refusal::of_parameter(
                "resolution",
                "plan::views",
                format!("{} views of {samples} samples do not fit into {} MiB", from.requests.capacity, MOST_BYTES >> 20),
                "lower resolution, or `shooters` of the ChooseTexel",
            ));
        }
        let is_raster = e.arguments.choice("by").0 == "Raster";
        let cast = e.place(Bodies::BOTH.unless(is_raster, "the scene is rasterised"))?;
        let views = see(e, from.requests, (shape, resolution), (cast, is_raster))?;
        e.output("views", Port::ShooterViews(views));
        Ok(())
    }
}
