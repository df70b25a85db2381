//! What edges to earlier rounds and frames read: memory of its own that a source's port is copied to.
//!
//! A consumer may be encoded before its source, so what the port looks like is guessed first, and everything is encoded
//! again until the guess is right.

use super::{Edge, Node, When};
use crate::contract::port::{Channels, DirectLight, GBuffer, Image, Memory, Port, PortKind};
use crate::schedule::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A source ("node.output") and which of its values is read.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key {
    pub from: String,
    pub when: When,
    /// See [`Edge::round_of`].
    pub round_of: Option<String>,
}

/// What is known of each source's port.
pub type Shapes = BTreeMap<Key, Shape>;

/// A port without its memory.
#[derive(Clone, PartialEq)]
pub struct Shape {
    /// Resources and variables count from 0 in the order of [`Port::over`].
    port: Port,
    resources: Vec<(ResourceKind, Lifetime)>,
    variables: usize,
}

impl Key {
    /// None for an edge of this round.
    pub fn of(edge: &Edge) -> Option<Self> {
        (edge.when != When::Now).then(|| Self { from: edge.from.to_string(), when: edge.when, round_of: edge.round_of.clone() })
    }
}

/// Edges to earlier rounds and frames between nodes that are kept.
pub fn edges<'p>(nodes: impl Iterator<Item = &'p Node>, is_kept: impl Fn(&str) -> bool) -> Vec<(&'p Node, &'p Edge)> {
    let edges = nodes.filter(|node| is_kept(&node.name)).flat_map(|node| node.inputs.iter().map(move |edge| (node, edge)));
    edges.filter(|(_, edge)| edge.when != When::Now && is_kept(&edge.from.node)).collect()
}

/// What ports look like that their kind alone describes: enough to close a loop by them.
pub fn guesses(edges: &[(&Node, &Edge)], size: [u32; 2]) -> Shapes {
    edges.iter().filter_map(|(node, edge)| Some((Key::of(edge)?, Shape::guess(node.accepts(edge)?, size)?))).collect()
}

impl Shape {
    fn guess(kind: PortKind, size: [u32; 2]) -> Option<Self> {
        let port = match kind {
            PortKind::Image => Port::Image(Image { texture: Resource(0), channels: Channels::Colour }),
            PortKind::DirectLight => Port::DirectLight(DirectLight { radiance: Resource(0), lights_from_emitters: false }),
            PortKind::GBuffer => Port::GBuffer(GBuffer { size, position: Resource(0), normal: Resource(1), reflectance: Resource(2), triangles: Resource(3) }),
            PortKind::Flag => Port::Flag(Variable(0)),
            _ => return None,
        };
        let formats: &[Format] = match kind {
            PortKind::GBuffer => &[Format::Rgba32Float, Format::Rgba32Float, Format::Rgba16Float, Format::R32Uint],
            PortKind::Flag => &[],
            _ => &[Format::Rgba32Float],
        };
        let texture = |format: &Format| (ResourceKind::Texture { size, layers: 1, format: *format }, Lifetime::History);
        Some(Self { port, resources: formats.iter().map(texture).collect(), variables: usize::from(kind == PortKind::Flag) })
    }

    pub fn of(port: &Port, schedule: &Schedule) -> Self {
        let mut members = Members::default();
        let port = port.over(&mut members);
        let resource = |resource: &Resource| {
            let description = schedule.resource(*resource);
            let lifetime = match &description.lifetime {
                Lifetime::Transient | Lifetime::History => Lifetime::History,
                written_once => written_once.clone(),
            };
            (description.kind.clone(), lifetime)
        };
        Self { port, resources: members.resources.iter().map(resource).collect(), variables: members.variables.len() }
    }

    /// Declares memory for what `key` reads.
    pub fn declare(&self, key: &Key, schedule: &mut Schedule) -> Port {
        let when = key.round_of.as_ref().map_or("frame before".into(), |name| format!("round of {name} before"));
        let mut declared = Declared { resources: Vec::new(), variables: Vec::new() };
        for (index, (kind, lifetime)) in self.resources.iter().enumerate() {
            let name = format!("{} {when}, {index}", key.from);
            declared.resources.push(Resource(schedule.resources.len() as u32));
            schedule.resources.push(ResourceDescription { name, kind: kind.clone(), lifetime: lifetime.clone() });
        }
        for index in 0..self.variables {
            let name = format!("{} {when}, {index}", key.from);
            declared.variables.push(Variable(schedule.variables.len() as u32));
            schedule.variables.push(VariableDescription { name, history: key.when == When::PreviousFrame });
        }
        self.port.over(&mut declared)
    }
}

/// Commands that make what a port holds the content of another of the same shape.
pub fn copy(from: &Port, to: &Port, schedule: &Schedule) -> Vec<Command> {
    let (from, to) = (members(from), members(to));
    let is_kept = |resource: &Resource| matches!(schedule.resource(*resource).lifetime, Lifetime::History);
    let pairs = from.resources.iter().zip(&to.resources).filter(|(_, to)| is_kept(to));
    let mut commands: Vec<_> = pairs.map(|(from, to)| Command::Copy { from: *from, to: *to }).collect();
    if !to.variables.is_empty() {
        let pairs: Vec<_> = from.variables.into_iter().zip(to.variables).collect();
        commands.push(on_host("keep", move |host| pairs.iter().for_each(|(from, to)| host.set(*to, host.variable(*from)))));
    }
    commands
}

/// Commands that empty a port's memory.
pub fn clear(port: &Port, schedule: &Schedule) -> Vec<Command> {
    let members = members(port);
    let is_kept = |resource: &Resource| matches!(schedule.resource(*resource).lifetime, Lifetime::History);
    let mut commands: Vec<_> = members.resources.into_iter().filter(is_kept).map(Command::Clear).collect();
    commands.extend(reset(members.variables));
    commands
}

/// A command that sets variables to 0, if there are any.
pub fn reset(variables: Vec<Variable>) -> Option<Command> {
    (!variables.is_empty()).then(|| on_host("reset", move |host| variables.iter().for_each(|variable| host.set(*variable, 0))))
}

fn on_host(name: &'static str, run: impl Fn(&mut dyn HostContext) + Send + Sync + 'static) -> Command {
    let run = Arc::new(move |host: &mut dyn HostContext| {
        run(host);
        Ok(())
    });
    Command::Host(Host { name, reads: Vec::new(), writes: Vec::new(), run, twin: None, runs_once: false })
}

fn members(port: &Port) -> Members {
    let mut members = Members::default();
    port.over(&mut members);
    members
}

/// What a port stands on, each once; numbers it from 0.
#[derive(Default)]
struct Members {
    resources: Vec<Resource>,
    variables: Vec<Variable>,
}

fn number<T: PartialEq>(all: &mut Vec<T>, item: T) -> u32 {
    let index = all.iter().position(|other| *other == item).unwrap_or_else(|| {
        all.push(item);
        all.len() - 1
    });
    index as u32
}

impl Memory for Members {
    fn resource(&mut self, resource: Resource) -> Resource {
        Resource(number(&mut self.resources, resource))
    }

    fn variable(&mut self, variable: Variable) -> Variable {
        Variable(number(&mut self.variables, variable))
    }
}

/// Memory by the numbers that [`Members`] gave.
struct Declared {
    resources: Vec<Resource>,
    variables: Vec<Variable>,
}

impl Memory for Declared {
    fn resource(&mut self, resource: Resource) -> Resource {
        self.resources[resource.0 as usize]
    }

    fn variable(&mut self, variable: Variable) -> Variable {
        self.variables[variable.0 as usize]
    }
}
