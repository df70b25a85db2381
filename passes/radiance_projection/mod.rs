//! From tiles to what arrives from where.

use super::record::{Record, Request};
use crate::contract::{
    Bodies, Choice, Description, Encoder, Input, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes, port,
};
use crate::math::radiance::{Expansion, Projected};
use crate::schedule::*;
use glam::Vec4;
use std::sync::Arc;

mod cpu_readback;
mod host;
pub mod matrix_product;

pub struct RadianceProjection;

static DESCRIPTION: Description = Description {
    name: "RadianceProjection",
    about: "Projects every tile on hemispherical harmonics: its record then knows the radiance that arrives from each direction, and how that changes along the surface",
    source: "THESIS 3.5 and 4.5; RCS section 4.1",
    parameters: &[
        Parameter {
            name: "by",
            about: "how a tile is projected",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "MatrixProduct", about: "samples times a table of the basis, in single precision", parameters: &[] },
                    Choice { name: "CpuReadback", about: "the tiles are read back and projected on the host in double precision (THESIS)", parameters: &[] },
                ],
            },
        },
        Parameter { name: "gradients", about: "translation gradients of every coefficient, or none", unit: "", kind: ParameterKind::Bool { default: true } },
        PLACE,
    ],
    inputs: &[
        Input { name: "of", about: "tiles with weights", accepts: PortKind::WeightedTiles, takes: Takes::One, changes: false },
        Input { name: "records", about: "the records of the same tiles", accepts: PortKind::Records, takes: Takes::One, changes: true },
        Input { name: "lobes", about: "what the coefficients are for: they have its order", accepts: PortKind::Lobes, takes: Takes::One, changes: false },
    ],
    outputs: &[Output { name: "records", about: "the records with their coefficients", kind: PortKind::Records }],
};

/// What the ways of projecting share.
struct Work<'a> {
    weighted: &'a port::WeightedTiles,
    expansion: Arc<Expansion>,
    order: u32,
    records: Resource,
    /// The records' coefficients.
    values: Resource,
}

/// Writes what a tile projects to behind the coefficients so far, and into its record how fast that changes where there are gradients.
fn keep(projected: Projected, has_gradients: bool, place: &Request, head: &mut Record, values: &mut Vec<Vec4>) {
    if has_gradients {
        head.translation[0][3] = projected.relative_gradient().min(1e30) as f32;
    }
    values.extend(projected.turned(f64::from(place.turn)).in_fours());
}

impl Pass for RadianceProjection {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let (Some(weighted), Some(records), Some(lobes)) = (e.weighted_tiles("of"), e.records("records").copied(), e.lobes("lobes")) else { return Ok(()) };
        lobes.expect_hemispherical()?;
        let order = lobes.order();
        let mut expansion = Expansion::new(&weighted.table, order as usize);
        if !e.arguments.bool("gradients") {
            expansion.walls.clear();
        }
        let values = e.buffer("values", u64::from(records.capacity) * port::Coefficients::bytes(order, port::Precision::Single));
        let work = Work { weighted, expansion: Arc::new(expansion), order, records: records.records, values };
        let by = e.arguments.choice("by").0;
        match (e.place(Bodies::BOTH.unless_on_device(by == "CpuReadback", "CpuReadback reads the tiles back"))?, by) {
            (_, "CpuReadback") => cpu_readback::encode(e, &work),
            (Place::Host, _) => host::encode(e, &work),
            (Place::Device, _) => matrix_product::encode(e, &work),
        }
        e.output(
            "records",
            Port::Records(port::Records { coefficients: Some(port::Coefficients { values, order, precision: port::Precision::Single }), ..records }),
        );
        Ok(())
    }
}
