//! What a pass promises: its parameters, its ports, whether a scene needs it, and what it records.

pub mod arguments;
pub mod encoder;
pub mod place;
pub mod port;
pub mod tables;

pub use arguments::{Arguments, Value};
pub use encoder::{Encoder, Refusal};
pub use place::{Bodies, PLACE, Place};
pub use port::{Port, PortKind};

/// What passes declare and run.
pub use crate::schedule::{Command, Compute, Format, Groups, HostContext, Program, Read, Resource, ResourceKind, Variable};

use crate::math::bounces::Bounces;
use crate::scene::needs::Needs;

/// Most bytes of one buffer: the least that adapters must bind.
pub const MOST_BYTES: u64 = 128 << 20;

/// A kind of work. One value of a unit struct per pass, listed in the registry.
pub trait Pass: Send + Sync {
    /// Name, parameters and ports: stands once, in the pass's own file.
    fn description(&self) -> &'static Description;

    /// Whether a scene with these needs keeps a node of this pass, or why not.
    fn need(&self, _arguments: &Arguments, _needs: &Needs) -> Need {
        Need::Kept
    }

    /// An input and an output, of a pass that changes what it is given in place: where a plan leaves the node out, whoever takes the output gets what the input gets.
    fn stands_for(&self) -> Option<[&'static str; 2]> {
        None
    }

    /// Parameters by which it only goes on for longer: what is kept between runs is as good for others.
    fn only_longer(&self) -> &'static [&'static str] {
        &[]
    }

    /// The input for images of indirect light, of a pass that makes the picture of them. Where none of these has what lobes reflect, the whole plan takes
    /// surfaces by their albedo.
    fn indirect_light(&self) -> Option<&'static str> {
        None
    }

    /// How often the light has been reflected that a pass brings from sources by itself; None where others tell.
    fn reflections(&self, _arguments: &Arguments) -> Option<Bounces> {
        None
    }

    /// Most items of a batch that its buffers can hold on any adapter.
    fn most_of_batch(&self, _arguments: &Arguments) -> u32 {
        u32::MAX
    }

    /// Declares the node's resources and commands. Called once per plan, needs no device.
    fn encode(&self, encoder: &mut Encoder<'_>) -> Result<(), Refusal>;
}

/// The passes that pipelines may use, by name.
pub type Registry = [&'static dyn Pass];

/// Finds a pass by its name.
pub fn find<'r>(registry: &'r Registry, name: &str) -> Option<&'r &'static dyn Pass> {
    registry.iter().find(|pass| pass.description().name == name)
}

/// Whether a scene requires a node.
#[derive(Debug, Clone, PartialEq)]
pub enum Need {
    /// The plan has it.
    Kept,
    /// Left out of the plan; the reason completes the sentence "dropped because …".
    Dropped(&'static str),
}

/// What a pass is, for checking pipelines, for messages and for the documentation.
#[derive(Debug)]
pub struct Description {
    /// As pipelines write it: `GBuffer`.
    pub name: &'static str,
    /// What it does, for the documentation.
    pub about: &'static str,
    /// Paper and section.
    pub source: &'static str,
    /// What pipelines can set.
    pub parameters: &'static [Parameter],
    /// What edges lead to.
    pub inputs: &'static [Input],
    /// The first is what an edge gets that names the node alone; the others are written `node.output`.
    pub outputs: &'static [Output],
}

/// What pipelines can set of a pass.
#[derive(Debug)]
pub struct Parameter {
    /// As pipelines write it.
    pub name: &'static str,
    /// What it changes, for the documentation.
    pub about: &'static str,
    /// Such as "pixels" or "degrees"; empty for numbers without a unit.
    pub unit: &'static str,
    /// Its type, range and default.
    pub kind: ParameterKind,
}

/// What values a parameter has.
#[derive(Debug)]
pub enum ParameterKind {
    /// Yes or no.
    Bool {
        /// Where a document does not say it.
        default: bool,
    },
    /// Inclusive range.
    Integer {
        /// Where a document does not say it.
        default: i64,
        /// The least.
        min: i64,
        /// The most.
        max: i64,
    },
    /// Inclusive range; NaN and infinity are never accepted.
    Float {
        /// Where a document does not say it.
        default: f64,
        /// The least.
        min: f64,
        /// The most.
        max: f64,
    },
    /// One of several ways; the first is the default.
    Choice {
        /// All that there are.
        choices: &'static [Choice],
    },
}

/// One value of a [`ParameterKind::Choice`], with parameters of its own: `Plane(fov: 126.87)`.
#[derive(Debug)]
pub struct Choice {
    /// As pipelines write it.
    pub name: &'static str,
    /// What it does, for the documentation.
    pub about: &'static str,
    /// What pipelines can set of it.
    pub parameters: &'static [Parameter],
}

/// What edges of a pipeline lead to.
#[derive(Debug)]
pub struct Input {
    /// As pipelines write it.
    pub name: &'static str,
    /// What it is, for the documentation.
    pub about: &'static str,
    /// What an edge may bring.
    pub accepts: PortKind,
    /// How many edges may lead there.
    pub takes: Takes,
    /// Whether the pass changes what it is given, in place. Its output is a newer version then: all others that name the older one run before it.
    pub changes: bool,
}

/// How many edges lead to an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Takes {
    /// One, which must be there.
    One,
    /// It may be left out of the pipeline, or its source dropped from the plan.
    AtMostOne,
    /// A list of any length: `["a", "b"]`. Each source may be dropped from the plan.
    Any,
    /// The same, and where all of them are dropped, so is the node.
    Some,
}

impl Takes {
    /// Whether pipelines write a list.
    pub fn is_list(self) -> bool {
        matches!(self, Self::Any | Self::Some)
    }
}

/// What a pass hands on.
#[derive(Debug)]
pub struct Output {
    /// As pipelines write it behind the node's name.
    pub name: &'static str,
    /// What it is, for the documentation.
    pub about: &'static str,
    /// What inputs it fits.
    pub kind: PortKind,
}
