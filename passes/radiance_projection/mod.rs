//! From tiles to what arrives from where.

use super::record::{Record, Request};
use crate::contract::{Choice, Description, Input, Output, Parameter, ParameterKind, Pass, Port, PortKind, Recorder, Refusal, port};
use crate::math::radiance::{Expansion, Projected};
use crate::recording::*;
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
                    Choice { name: "Auto", about: "`Host` where the device is a driver on the cores of the host, `MatrixProduct` elsewhere", parameters: &[] },
                    Choice { name: "Host", about: "the same product on the host, in single precision", parameters: &[] },
                    Choice { name: "MatrixProduct", about: "on the device: samples times a table of the basis", parameters: &[] },
                    Choice { name: "CpuReadback", about: "the tiles are read back and projected on the host in double precision (THESIS)", parameters: &[] },
                ],
            },
        },
        Parameter { name: "gradients", about: "translation gradients of every coefficient, or none", unit: "", kind: ParameterKind::Bool { default: true } },
    ],
    inputs: &[
        Input { name: "of", about: "tiles with weights", accepts: PortKind::WeightedTiles, required: true, changes: false },
        Input { name: "records", about: "the records of the same tiles", accepts: PortKind::Records, required: true, changes: true },
        Input { name: "lobes", about: "what the coefficients are for: they have its order", accepts: PortKind::Lobes, required: true, changes: false },
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

    fn record(&self, r: &mut Recorder<'_>) -> Result<(), Refusal> {
        let (Some(weighted), Some(records), Some(lobes)) = (r.weighted_tiles("of"), r.records("records").copied(), r.lobes("lobes")) else { return Ok(()) };
        lobes.expect_hemispherical()?;
        let order = lobes.order();
        let mut expansion = Expansion::new(&weighted.table, order as usize);
        if !r.arguments.bool("gradients") {
            expansion.walls.clear();
        }
        let values = r.buffer("values", u64::from(records.capacity) * port::Coefficients::bytes(order, port::Precision::Single));
        let work = Work { weighted, expansion: Arc::new(expansion), order, records: records.records, values };
        match (r.arguments.choice("by").0, r.setting.device) {
            ("CpuReadback", _) => cpu_readback::record(r, &work),
            ("Host", _) => host::record(r, &work),
            ("Auto", Device::Software) => {
                r.remark("tiles are projected on the host, as the device is a driver on the same cores");
                host::record(r, &work);
            }
            _ => matrix_product::record(r, &work),
        }
        r.output(
            "records",
            Port::Records(port::Records { coefficients: Some(port::Coefficients { values, order, precision: port::Precision::Single }), ..records }),
        );
        Ok(())
    }
}
