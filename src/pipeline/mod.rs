//! Pipelines: the RON document, its checks against the passes that there are, the order of its nodes, and the plan for one scene.
//!
//! Nothing here reads files or touches a device: texts come through a function that the caller gives, plans are values.

#[doc(hidden)]
pub mod ahead;
mod check;
pub mod diagnostics;
#[doc(hidden)]
pub mod dial;
#[doc(hidden)]
pub mod document;
#[doc(hidden)]
pub mod embedded;
#[doc(hidden)]
pub mod export;
#[doc(hidden)]
pub mod grammar;
mod graph;
mod history;
mod loops;
#[doc(hidden)]
pub mod per_frame;
pub mod plan;
mod progress;
#[doc(hidden)]
pub mod set;
#[doc(hidden)]
pub mod syntax;
#[doc(hidden)]
pub mod values;
mod written;

pub use check::expected;
pub use diagnostics::{Problem, Problems};
pub use dial::Dial;
pub use document::ReadFile;
pub use export::{Format, export};
pub use loops::Loop;
pub use per_frame::PerFrame;
pub use plan::{Plan, plan};
pub use set::Set;
pub use values::Values;

use crate::contract::{Arguments, Description, Pass, PortKind, Registry};
use std::collections::BTreeMap;
use syntax::Place;

/// A pipeline whose every name, type, range and edge is right, in the order in which it runs.
pub struct Pipeline {
    /// The file's path, or `pipelines/…` for one that ships.
    pub name: String,
    /// What the method is, one sentence.
    pub about: String,
    /// Paper and section.
    pub reference: String,
    /// In the order in which they run.
    pub nodes: Vec<Node>,
    /// What pictures hold.
    pub outputs: Vec<Layer>,
    /// Numbers that turn several parameters together; those that are turned stand in the nodes already.
    pub dials: Vec<Dial>,
    /// Whether plans leave out what a scene does not need; if not, they take it as if it needed everything.
    pub specialise: bool,
    /// Where the document begins.
    pub place: Place,
    /// What whoever names it should know, in words.
    pub notes: Vec<String>,
}

/// An output: the name of a layer and what it shows.
#[derive(Clone)]
pub struct Layer {
    /// As the picture's file has it.
    pub name: String,
    /// Where it comes from.
    pub from: Origin,
}

/// One use of a pass, or a loop.
pub struct Node {
    /// As the document calls it.
    pub name: String,
    /// What it does.
    pub work: Work,
    /// The values of its parameters.
    pub arguments: Arguments,
    /// What its inputs are joined to.
    pub inputs: Vec<Edge>,
    /// The node's name in the document.
    pub place: Place,
    /// Where the document gives values to parameters.
    pub places: BTreeMap<&'static str, Place>,
}

/// What a node does.
pub enum Work {
    /// A pass that is registered.
    Pass(&'static dyn Pass),
    /// A loop, whose arguments and inputs are those that [`Loop::description`] tells.
    Loop(Loop, Vec<Node>),
}

/// What an input is joined to.
#[derive(Clone)]
pub struct Edge {
    /// The input's name.
    pub input: &'static str,
    /// Whether the input must have an edge.
    pub required: bool,
    /// See [`crate::contract::Input::changes`].
    pub changes: bool,
    /// Which value is meant.
    pub when: When,
    /// The loop whose round before is meant: the innermost that holds both ends. None for other edges.
    pub round_of: Option<String>,
    /// Where it begins.
    pub from: Origin,
}

/// An output of a node, and where the document names it.
#[derive(Clone)]
pub struct Origin {
    /// The node's name.
    pub node: String,
    /// The output's name.
    pub output: &'static str,
    /// Where the document names it.
    pub place: Place,
}

/// Which of its values an edge takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum When {
    /// What this frame, and this round of the loop, has made.
    Now,
    /// What the round before left; empty in the first round, each time that the loop starts.
    PreviousRound,
    /// What the frame before left; empty in the first frame.
    PreviousFrame,
}

/// Reads and checks a pipeline: `name` is a path or one that ships, each of `sets` is `NODE.PARAM=VALUE`.
///
/// # Errors
/// All root causes at once.
pub fn load(name: &str, sets: &[String], registry: &Registry, read_file: &mut ReadFile<'_>) -> Result<Pipeline, Problems> {
    let (mut read, mut unreadable) = (Vec::new(), Vec::new());
    for set in sets {
        Set::parse("--set", set).map_or_else(|problem| unreadable.push(problem), |set| read.push(set));
    }
    load_all(name, &read, unreadable, registry, read_file)
}

/// The same with what is set already read.
///
/// # Errors
/// All root causes at once.
pub fn load_with(name: &str, sets: &[Set], registry: &Registry, read_file: &mut ReadFile<'_>) -> Result<Pipeline, Problems> {
    load_all(name, sets, Vec::new(), registry, read_file)
}

fn load_all(name: &str, sets: &[Set], unreadable: Vec<Problem>, registry: &Registry, read_file: &mut ReadFile<'_>) -> Result<Pipeline, Problems> {
    let (document, mut problems) = document::read(name, sets, read_file);
    problems.extend(unreadable);
    let pipeline = document.and_then(|document| check::check(&document, registry, &mut problems));
    match pipeline {
        Some(pipeline) if problems.is_empty() => Ok(pipeline),
        _ => Err(Problems(problems)),
    }
}

impl Pipeline {
    /// Names of all nodes, those inside loops too.
    pub fn names(&self) -> Vec<&str> {
        names(&self.nodes)
    }
}

fn names(nodes: &[Node]) -> Vec<&str> {
    nodes.iter().flat_map(|node| std::iter::once(node.name.as_str()).chain(names(node.inner()))).collect()
}

impl Node {
    /// What its pass or its loop is.
    pub fn description(&self) -> &'static Description {
        match &self.work {
            Work::Pass(pass) => pass.description(),
            Work::Loop(kind, _) => kind.description(),
        }
    }

    /// What the input that an edge leads to accepts.
    pub fn accepts(&self, edge: &Edge) -> Option<PortKind> {
        self.description().inputs.iter().find(|input| input.name == edge.input).map(|input| input.accepts)
    }

    /// The nodes of a loop.
    pub fn inner(&self) -> &[Node] {
        match &self.work {
            Work::Pass(_) => &[],
            Work::Loop(_, nodes) => nodes,
        }
    }
}

impl Edge {
    /// As pipelines write it: `node.output` or `PreviousRound("node.output")`.
    pub fn written(&self) -> String {
        match self.when {
            When::Now => self.from.to_string(),
            earlier => format!("{earlier:?}(\"{}\")", self.from),
        }
    }
}

impl std::fmt::Display for Origin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}", self.node, self.output)
    }
}
