//! The loops of the grammar, described as passes are.

use crate::contract::{Choice, Description, Input, Parameter, ParameterKind, PortKind, Takes};

/// How nodes are repeated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Loop {
    /// Until nothing is left to do.
    Fill,
    /// A number of times.
    Iterate,
}

impl Loop {
    /// All kinds.
    pub const ALL: [Self; 2] = [Self::Fill, Self::Iterate];

    /// The loop that pipelines write with this name.
    pub fn find(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.description().name == name)
    }

    /// Its name, parameters and inputs, as those of a pass.
    pub fn description(self) -> &'static Description {
        match self {
            Self::Fill => &FILL,
            Self::Iterate => &ITERATE,
        }
    }
}

static FILL: Description = Description {
    name: "Fill",
    about: "Repeats its nodes until a flag is set; a loop of the graph, not a pass",
    source: "RCS section 4",
    parameters: &[
        Parameter {
            name: "order",
            about: "how many records a round adds",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice {
                        name: "Batched",
                        about: "as many as the device can work on at once",
                        parameters: &[Parameter {
                            name: "at_most",
                            about: "most records of a round",
                            unit: "records",
                            kind: ParameterKind::Integer { default: 64, min: 1, max: 65_536 },
                        }],
                    },
                    Choice { name: "Sequential", about: "one record at a time in the order of pixels, as the papers do", parameters: &[] },
                ],
            },
        },
        Parameter {
            name: "max_rounds",
            about: "rounds after which the loop ends in any case, the last of which adds nothing; 0: as many as the picture has pixels",
            unit: "rounds",
            kind: ParameterKind::Integer { default: 0, min: 0, max: u32::MAX as i64 },
        },
    ],
    inputs: &[Input { name: "until", about: "ends the loop when set; from a node inside", accepts: PortKind::Flag, takes: Takes::One, changes: false }],
    outputs: &[],
};

static ITERATE: Description = Description {
    name: "Iterate",
    about: "Repeats its nodes a number of times, or until a flag is set; a loop of the graph, not a pass",
    source: "for bounces, relaxation and other sums over rounds",
    parameters: &[Parameter {
        name: "rounds",
        about: "how often the nodes run each time that the loop starts, at most",
        unit: "rounds",
        kind: ParameterKind::Integer { default: 1, min: 1, max: 65_536 },
    }],
    inputs: &[Input {
        name: "until",
        about: "ends the loop earlier when set; from a node inside",
        accepts: PortKind::Flag,
        takes: Takes::AtMostOne,
        changes: false,
    }],
    outputs: &[],
};
