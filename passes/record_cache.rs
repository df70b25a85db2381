//! The records that earlier rounds and frames left.

use super::record::{RECORD_BYTES, Weighting};
use crate::contract::{Choice, Description, Encoder, Input, MOST_BYTES, Output, Parameter, ParameterKind, Pass, Port, PortKind, Refusal, Takes, port};
use crate::math::life::Life;

pub struct RecordCache;

static DESCRIPTION: Description = Description {
    name: "RecordCache",
    about: "The irradiance records so far, kept between rounds, frames and views, and the rule by which they count",
    source: "RCS sections 2 and 4; limits in pixels, weights that end at a rim: Tabellion and Lamorlette 2004",
    parameters: &[
        Parameter {
            name: "accuracy",
            about: "a: a record reaches a times its harmonic mean distance; smaller is more accurate",
            unit: "",
            kind: ParameterKind::Float { default: 0.15, min: 0.001, max: 10.0 },
        },
        Parameter {
            name: "minimum_spacing",
            about: "least validity radius of a record",
            unit: "pixels",
            kind: ParameterKind::Float { default: 8.0, min: 0.1, max: 1000.0 },
        },
        Parameter {
            name: "contrast",
            about: "most change that a gradient may foretell within the least validity radius, as a share of the picture's irradiance; where it is more, that validity radius shrinks",
            unit: "",
            kind: ParameterKind::Float { default: 0.3, min: 0.001, max: 1e6 },
        },
        Parameter {
            name: "finest_spacing",
            about: "how small the least validity radius may become for the contrast",
            unit: "pixels",
            kind: ParameterKind::Float { default: 1.5, min: 0.1, max: 1000.0 },
        },
        Parameter {
            name: "maximum_spacing",
            about: "greatest validity radius of a record",
            unit: "pixels",
            kind: ParameterKind::Float { default: 1000.0, min: 0.1, max: 1e6 },
        },
        Parameter {
            name: "nearest",
            about: "most of the validity radius over the distance of the nearest surface seen: a record stops before that surface's corner",
            unit: "",
            kind: ParameterKind::Float { default: 0.7, min: 0.01, max: 1e6 },
        },
        Parameter {
            name: "change",
            about: "most change within the validity radius that the gradient may foretell, as a share of the irradiance; 1e6 sets no limit",
            unit: "",
            kind: ParameterKind::Float { default: 1e6, min: 0.01, max: 1e6 },
        },
        Parameter {
            name: "overlap",
            about: "weights that add up to this or less are a miss: above 0 there is always another record where one ends, so that no rim shows",
            unit: "",
            kind: ParameterKind::Float { default: 0.2, min: 0.0, max: 0.9 },
        },
        Parameter {
            name: "weights",
            about: "how much a record counts at a point",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Compact", about: "reaches as far as Ward's, falls to 0 at the rim", parameters: &[] },
                    Choice { name: "Ward", about: "1 / (distance / R + sqrt(1 - n·n_k)), counts from 1/a on (RCS 2, 3)", parameters: &[] },
                    Choice {
                        name: "TabellionLamorlette",
                        about: "1 - max(distance / (a · nearest distance), sqrt(1 - n·n_k) / sqrt(1 - cos 10°))",
                        parameters: &[],
                    },
                ],
            },
        },
        Parameter {
            name: "coefficients",
            about: "what the coefficients of records of radiance are kept in",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Single", about: "32 bits", parameters: &[] },
                    Choice { name: "Half", about: "16 bits: half the memory, eleven bits of precision, in units of the record's own light", parameters: &[] },
                ],
            },
        },
        Parameter {
            name: "capacity",
            about: "most records; a fill that needs more stops",
            unit: "records",
            kind: ParameterKind::Integer { default: 131_072, min: 1, max: 800_000 },
        },
        Parameter {
            name: "lasts",
            about: "how long records are kept",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Always", about: "for all frames to come, until the scene changes", parameters: &[] },
                    Choice { name: "Frame", about: "until the frame ends: for light that changes from frame to frame", parameters: &[] },
                    Choice {
                        name: "Changes",
                        about: "for all frames to come while the scene changes, if RenewRecords brings them to each; otherwise as Always",
                        parameters: &[],
                    },
                ],
            },
        },
    ],
    inputs: &[Input {
        name: "lobes",
        about: "what records of radiance keep coefficients for; without it records hold irradiance alone",
        accepts: PortKind::Lobes,
        takes: Takes::AtMostOne,
        changes: false,
    }],
    outputs: &[Output { name: "cache", about: "the records", kind: PortKind::RecordCache }],
};

impl Pass for RecordCache {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let [minimum, maximum] = [e.arguments.float("minimum_spacing"), e.arguments.float("maximum_spacing")];
        if minimum > maximum {
            return Err(Refusal::of_parameter(
                "minimum_spacing",
                "plan::spacing",
                format!("the least validity radius, {minimum} pixels, is more than the greatest, {maximum} pixels"),
                "make minimum_spacing the smaller of the two",
            ));
        }
        let weighting = match e.arguments.choice("weights").0 {
            "Ward" => port::Weighting::Ward,
            "TabellionLamorlette" => port::Weighting::TabellionLamorlette,
            _ => port::Weighting::Compact,
        };
        let number = |name| e.arguments.float(name) as f32;
        let rule = port::Rule {
            weighting,
            accuracy: number("accuracy"),
            spacing: [minimum as f32, maximum as f32],
            nearest: number("nearest"),
            change: number("change"),
            overlap: number("overlap"),
            contrast: number("contrast"),
            finest_spacing: number("finest_spacing"),
        };
        let (lasts, lives) = (e.arguments.choice("lasts").0 != "Frame", e.arguments.choice("lasts").0 == "Changes" && e.setting.needs.moves);
        let buffer = |e: &mut Encoder<'_>, member: &str, bytes: u64| if lasts { e.history_buffer(member, bytes) } else { e.buffer(member, bytes) };
        let precision = if e.arguments.choice("coefficients").0 == "Half" { port::Precision::Half } else { port::Precision::Single };
        let mut capacity = e.arguments.integer("capacity") as u32;
        let coefficients = e.lobes("lobes").map(port::Lobes::order).map(|order| {
            let bytes = port::Coefficients::bytes(order, precision);
            let fits = (MOST_BYTES / bytes) as u32;
            if fits < capacity {
                e.remark(format!("room for {fits} records: the coefficients of order {order} of more do not fit into {} MiB", MOST_BYTES >> 20));
                capacity = fits;
            }
            port::Coefficients { values: buffer(e, "coefficients", u64::from(capacity) * bytes), order, precision }
        });
        if coefficients.is_none() {
            e.idle("coefficients", "records hold irradiance alone");
        }
        let cache = port::RecordCache {
            records: buffer(e, "records", capacity as u64 * RECORD_BYTES),
            coefficients,
            count: e.variable("count", lasts),
            capacity,
            weighting: e.constant_buffer("weighting", bytemuck::bytes_of(&Weighting::from(&rule))),
            rule,
            lasts,
            lives: lives.then(|| {
                let known = e.variable("known", true);
                let items = e.history_items("lives", capacity, size_of::<Life>() as u64, known);
                let bytes = |kept: port::Coefficients| port::Coefficients::bytes(kept.order, kept.precision);
                let expansions = coefficients.map(|kept| e.history_items("goals", capacity, bytes(kept), known));
                port::Lives { items, known, ahead: None, expansions }
            }),
        };
        if let Some(lives) = cache.lives {
            let expansions = cache.coefficients.map(|kept| kept.values).into_iter().chain(lives.expansions);
            e.survives(&[cache.records, lives.items].into_iter().chain(expansions).collect::<Vec<_>>(), &[cache.count, lives.known]);
        }
        e.output("cache", Port::RecordCache(cache));
        Ok(())
    }
}
