//! A pipeline made ready for one scene: what stays, every resource and command, and the memory they share. Needs no device.

use super::{Edge, Layer, Node, Pipeline, Problem, Problems, When, Work, graph::family};
use crate::contract::recorder::{Persistent, Recorded, Recorder, Reported, Setting};
use crate::contract::{Need, Port, Refusal};
use crate::recording::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// Bytes of the camera's buffer.
pub const CAMERA_BYTES: u64 = 256;

/// What one frame of a pipeline does on one scene.
pub struct Plan {
    pub pipeline: String,
    pub about: String,
    pub recording: Recording,
    pub lifetimes: Lifetimes,
    pub placement: Placement,
    /// Layer, what it shows, and the port.
    pub outputs: Vec<(Layer, Port)>,
    /// Layers that this scene leaves without a source, and why.
    pub absent: Vec<Absent>,
    /// Every port by "node.output".
    pub ports: BTreeMap<String, Port>,
    /// In the order in which they would have run.
    pub dropped: Vec<Dropped>,
    /// Node and what was adapted.
    pub remarks: Vec<(String, String)>,
    /// Node, name and place of the numbers that a run reports.
    pub reports: Vec<(String, &'static str, Reported)>,
    /// Node and history that can be saved.
    pub persistent: Vec<(String, Persistent)>,
}

/// A node that the scene does not require.
#[derive(Debug, Clone, PartialEq)]
pub struct Dropped {
    pub node: String,
    /// Completes "dropped because …".
    pub because: String,
}

/// A layer that is not there.
#[derive(Debug, Clone, PartialEq)]
pub struct Absent {
    pub layer: String,
    pub because: String,
}

/// Plans a pipeline for a scene. `dumps` are nodes ("node" or "node.output") whose memory must be whole after the frame;
/// `scene_bytes` tells the size of a part of the scene.
///
/// # Errors
/// What passes refuse, each underlined in the document.
pub fn plan(pipeline: &Pipeline, setting: Setting<'_>, dumps: &[String], scene_bytes: &dyn Fn(SceneData) -> u64) -> Result<Plan, Problems> {
    let members = members(pipeline);
    let mut problems = refuse_previous(&members);
    let dump_nodes: Vec<&str> = dumps.iter().filter_map(|dump| find_dump(&members, dump, &mut problems)).collect();
    let mut dropped = drop_unneeded(&members, setting);
    drop_unused(pipeline, &members, &dump_nodes, &mut dropped);
    problems.extend(dump_nodes.iter().filter_map(|node| Some(refuse_dump(node, dropped.get(node)?))));
    if !problems.is_empty() {
        return Err(Problems(problems));
    }
    let mut planner = Planner::new(setting, &dropped, scene_bytes);
    let (mut steps, mut prologue) = (Vec::new(), Vec::new());
    planner.record_level(&pipeline.nodes, None, &mut prologue, &mut steps);
    planner.recording.steps = steps;
    planner.finish(pipeline, &members, dumps)
}

/// A node and the outermost loop around it.
struct Member<'p> {
    node: &'p Node,
    within: Option<&'p Node>,
}

/// All nodes in the order of execution, loops before their nodes.
fn members(pipeline: &Pipeline) -> Vec<Member<'_>> {
    let mut members = Vec::new();
    for node in &pipeline.nodes {
        family(node, &mut |member| members.push(Member { node: member, within: (!std::ptr::eq(member, node)).then_some(node) }));
    }
    members
}

/// Passes keep histories of their own; edges to earlier rounds and frames have no memory to read from.
fn refuse_previous(members: &[Member<'_>]) -> Vec<Problem> {
    let edges = members.iter().flat_map(|member| member.node.inputs.iter().map(|edge| (member.node, edge))).filter(|(_, edge)| edge.when != When::Now);
    let refuse = |(node, edge): (&Node, &Edge)| {
        Problem::new("plan::previous", format!("{}.{} reads what `{}` left: ports do not outlive their round", node.name, edge.input, edge.from))
            .at(&edge.from.place, "an earlier value")
            .help("passes such as RecordCache keep a history; join the node to one of those")
    };
    edges.map(refuse).collect()
}

fn find_dump<'p>(members: &[Member<'p>], dump: &str, problems: &mut Vec<Problem>) -> Option<&'p str> {
    let (name, output) = dump.split_once('.').map_or((dump, None), |(name, output)| (name, Some(output)));
    let member = members.iter().find(|member| member.node.name == name);
    let has_output = |node: &Node| output.is_none_or(|output| node.description().outputs.iter().any(|o| o.name == output));
    let found = member.map(|member| member.node).filter(|node| has_output(node) && !node.description().outputs.is_empty());
    if found.is_none() {
        let names = members.iter().filter(|member| !member.node.description().outputs.is_empty()).map(|member| member.node.name.as_str());
        let help = super::diagnostics::known(name, names, "what can be dumped");
        problems.push(Problem::new("plan::unknown_dump", format!("there is no `{dump}` to dump")).help(help));
    }
    found.map(|node| node.name.as_str())
}

fn refuse_dump(node: &str, because: &str) -> Problem {
    Problem::new("plan::dropped_dump", format!("`{node}` cannot be dumped: this scene leaves it out")).help(format!("left out because {because}"))
}

/// Nodes whose pass the scene does not require, and those that cannot work without them.
fn drop_unneeded<'p>(members: &[Member<'p>], setting: Setting<'_>) -> BTreeMap<&'p str, String> {
    let mut dropped: BTreeMap<&str, String> = BTreeMap::new();
    loop {
        let before = dropped.len();
        for member in members {
            let node = member.node;
            if dropped.contains_key(node.name.as_str()) {
                continue;
            }
            if let Some(because) = reason_to_drop(node, setting, &dropped) {
                family(node, &mut |inner| {
                    dropped.entry(&inner.name).or_insert_with(|| format!("its loop `{}` is dropped", node.name));
                });
                dropped.insert(&node.name, because);
            }
        }
        // An edge may lead to a node that is dropped later in the order; with the last pass nothing changes any more.
        if dropped.len() == before {
            return dropped;
        }
    }
}

fn reason_to_drop(node: &Node, setting: Setting<'_>, dropped: &BTreeMap<&str, String>) -> Option<String> {
    if let Work::Pass(pass) = &node.work
        && let Need::Dropped(because) = pass.need(&node.arguments, setting.needs)
    {
        return Some(because.into());
    }
    let lost = node.inputs.iter().find(|edge| edge.required && dropped.contains_key(edge.from.node.as_str()))?;
    Some(format!("its input `{}` comes from `{}`, which is dropped", lost.input, lost.from.node))
}

/// Nodes that no output depends on. A loop is used as a whole: its nodes work on each other's memory.
fn drop_unused<'p>(pipeline: &'p Pipeline, members: &[Member<'p>], dumps: &[&'p str], dropped: &mut BTreeMap<&'p str, String>) {
    let by_name: BTreeMap<&str, &Member<'p>> = members.iter().map(|member| (member.node.name.as_str(), member)).collect();
    let mut used: BTreeSet<&str> = BTreeSet::new();
    let mut waiting: Vec<&str> = pipeline.outputs.iter().map(|layer| layer.from.node.as_str()).chain(dumps.iter().copied()).collect();
    while let Some(name) = waiting.pop() {
        let Some(member) = by_name.get(name).filter(|_| !dropped.contains_key(name)) else { continue };
        if !used.insert(name) {
            continue;
        }
        waiting.extend(member.node.inputs.iter().map(|edge| edge.from.node.as_str()));
        if let Some(within) = member.within {
            family(within, &mut |inner| waiting.push(&inner.name));
        }
    }
    for member in members {
        if !used.contains(member.node.name.as_str()) {
            dropped.entry(&member.node.name).or_insert_with(|| "nothing uses it".into());
        }
    }
}

/// What a loop tells its nodes.
#[derive(Clone, Copy)]
struct Batch {
    at_most: u32,
    sequential: bool,
}

struct Planner<'a> {
    setting: Setting<'a>,
    dropped: &'a BTreeMap<&'a str, String>,
    recording: Recording,
    ports: BTreeMap<String, Port>,
    remarks: Vec<(String, String)>,
    reports: Vec<(String, &'static str, Reported)>,
    persistent: Vec<(String, Persistent)>,
    /// Nodes that could not be recorded, and those that wait for them.
    failed: BTreeSet<String>,
    problems: Vec<Problem>,
}

impl<'a> Planner<'a> {
    fn new(setting: Setting<'a>, dropped: &'a BTreeMap<&'a str, String>, scene_bytes: &dyn Fn(SceneData) -> u64) -> Self {
        let mut recording = Recording::default();
        for data in SceneData::ALL {
            let kind = ResourceKind::Buffer { bytes: scene_bytes(data) };
            recording.resources.push(ResourceDescription { name: data.name().into(), kind, lifetime: Lifetime::Scene(data) });
        }
        let kind = ResourceKind::Buffer { bytes: CAMERA_BYTES };
        recording.resources.push(ResourceDescription { name: "camera".into(), kind, lifetime: Lifetime::Frame });
        Self {
            setting,
            dropped,
            recording,
            ports: BTreeMap::new(),
            remarks: Vec::new(),
            reports: Vec::new(),
            persistent: Vec::new(),
            failed: BTreeSet::new(),
            problems: Vec::new(),
        }
    }

    /// `prologue` takes what runs once a frame before the outermost loop.
    fn record_level(&mut self, nodes: &[Node], batch: Option<Batch>, prologue: &mut Vec<Step>, steps: &mut Vec<Step>) {
        for node in nodes.iter().filter(|node| !self.dropped.contains_key(node.name.as_str())) {
            match &node.work {
                Work::Pass(_) => self.record(node, batch, prologue, steps),
                Work::Fill(inner) => {
                    let mut rounds = Vec::new();
                    self.record_level(inner, Some(batch_of(node)), prologue, &mut rounds);
                    if batch.is_none() {
                        steps.append(prologue);
                    }
                    steps.extend(self.repeat(node, rounds).map(Step::Repeat));
                }
            }
        }
    }

    fn repeat(&mut self, node: &Node, steps: Vec<Step>) -> Option<Repeat> {
        let until = node.inputs.iter().find_map(|edge| match self.ports.get(&edge.from.to_string()) {
            Some(Port::Flag(variable)) => Some(*variable),
            _ => None,
        })?;
        let round = Variable(self.recording.variables.len() as u32);
        self.recording.variables.push(VariableDescription { name: format!("{}.round", node.name), history: false });
        let pixels = u64::from(self.setting.size[0]) * u64::from(self.setting.size[1]);
        let at_most = match node.arguments.integer("max_rounds") {
            // Every round serves at least one pixel; the last one finds that none is left.
            0 => u32::try_from(pixels + 1).unwrap_or(u32::MAX),
            rounds => u32::try_from(rounds).unwrap_or(u32::MAX),
        };
        Some(Repeat { name: node.name.clone(), until, round, at_most, steps })
    }

    fn record(&mut self, node: &Node, batch: Option<Batch>, prologue: &mut Vec<Step>, steps: &mut Vec<Step>) {
        let Work::Pass(pass) = node.work else { return };
        let Some(inputs) = self.inputs(node) else {
            self.failed.insert(node.name.clone());
            return;
        };
        let recorder = Recorder::new(&node.name, &node.arguments, self.setting, &inputs, &mut self.recording);
        let mut recorder = match batch {
            Some(batch) => recorder.in_loop(batch.at_most, batch.sequential),
            None => recorder,
        };
        match pass.record(&mut recorder) {
            Ok(()) => {
                let recorded = recorder.finish();
                self.keep(node, recorded, batch.is_some(), prologue, steps);
            }
            Err(refusal) => {
                self.failed.insert(node.name.clone());
                self.problems.push(refused(node, refusal));
            }
        }
    }

    fn keep(&mut self, node: &Node, recorded: Recorded, in_loop: bool, prologue: &mut Vec<Step>, steps: &mut Vec<Step>) {
        let step = |commands: Vec<Command>, to: &mut Vec<Step>| {
            if !commands.is_empty() {
                to.push(Step::Node(crate::recording::Node { name: node.name.clone(), pass: node.description().name, commands }));
            }
        };
        if in_loop {
            step(recorded.prologue, prologue);
            step(recorded.commands, steps);
        } else {
            step(recorded.prologue.into_iter().chain(recorded.commands).collect(), steps);
        }
        self.ports.extend(recorded.outputs.into_iter().map(|(output, port)| (format!("{}.{output}", node.name), port)));
        self.remarks.extend(recorded.remarks.into_iter().map(|remark| (node.name.clone(), remark)));
        self.reports.extend(recorded.reports.into_iter().map(|(name, from)| (node.name.clone(), name, from)));
        self.persistent.extend(recorded.persistent.into_iter().map(|history| (node.name.clone(), history)));
    }

    /// The ports of a node's inputs; None if one is missing that must be there.
    fn inputs(&mut self, node: &Node) -> Option<BTreeMap<&'static str, Port>> {
        let mut inputs = BTreeMap::new();
        for edge in &node.inputs {
            if self.failed.contains(&edge.from.node) {
                return None;
            }
            match self.ports.get(&edge.from.to_string()) {
                Some(port) => drop(inputs.insert(edge.input, port.clone())),
                None if edge.required => {
                    let message = format!("{}.{} → {}: not made with these parameters", node.name, edge.input, edge.from);
                    self.problems.push(Problem::new("plan::absent_output", message).at(&edge.from.place, "not there"));
                    return None;
                }
                None => {}
            }
        }
        Some(inputs)
    }

    fn finish(mut self, pipeline: &Pipeline, members: &[Member<'_>], dumps: &[String]) -> Result<Plan, Problems> {
        let (outputs, absent) = self.outputs(pipeline);
        if self.problems.is_empty() && outputs.is_empty() {
            let reasons: Vec<String> = absent.iter().map(|a| format!("`{}` is absent because {}", a.layer, a.because)).collect();
            let problem = Problem::new("plan::nothing_left", format!("nothing is left of the pipeline for the scene `{}`", self.setting.scene.name));
            self.problems.push(problem.at(&pipeline.place, "no output remains").help(reasons.join("; ")));
        }
        if !self.problems.is_empty() {
            return Err(Problems(self.problems));
        }
        let mut kept: Vec<Resource> = outputs.iter().flat_map(|(_, port)| port.resources()).collect();
        kept.extend(self.reports.iter().filter_map(|(_, _, from)| if let Reported::Buffer(buffer, _) = from { Some(*buffer) } else { None }));
        let is_dumped = |port: &str| dumps.iter().any(|dump| port == dump || port.strip_prefix(dump.as_str()).is_some_and(|rest| rest.starts_with('.')));
        kept.extend(self.ports.iter().filter(|(name, _)| is_dumped(name)).flat_map(|(_, port)| port.resources()));
        let lifetimes = Lifetimes::of(&self.recording, &kept);
        let placement = Placement::of(&self.recording, &lifetimes);
        let because = |node: &Node| Some(Dropped { node: node.name.clone(), because: self.dropped.get(node.name.as_str())?.clone() });
        Ok(Plan {
            pipeline: pipeline.name.clone(),
            about: pipeline.about.clone(),
            dropped: members.iter().filter_map(|member| because(member.node)).collect(),
            recording: self.recording,
            lifetimes,
            placement,
            outputs,
            absent,
            ports: self.ports,
            remarks: self.remarks,
            reports: self.reports,
            persistent: self.persistent,
        })
    }

    fn outputs(&mut self, pipeline: &Pipeline) -> (Vec<(Layer, Port)>, Vec<Absent>) {
        let (mut outputs, mut absent) = (Vec::new(), Vec::new());
        for layer in &pipeline.outputs {
            if let Some(because) = self.dropped.get(layer.from.node.as_str()) {
                absent.push(Absent { layer: layer.name.clone(), because: format!("`{}` is dropped: {because}", layer.from.node) });
            } else if let Some(port) = self.ports.get(&layer.from.to_string()) {
                outputs.push((layer.clone(), port.clone()));
            } else if !self.failed.contains(&layer.from.node) {
                let message = format!("the output `{}` → {}: not made with these parameters", layer.name, layer.from);
                self.problems.push(Problem::new("plan::absent_output", message).at(&layer.from.place, "not there"));
            }
        }
        (outputs, absent)
    }
}

fn batch_of(fill: &Node) -> Batch {
    match fill.arguments.choice("order") {
        ("Batched", arguments) => Batch { at_most: u32::try_from(arguments.integer("at_most")).unwrap_or(1), sequential: false },
        _ => Batch { at_most: 1, sequential: true },
    }
}

fn refused(node: &Node, refusal: Refusal) -> Problem {
    let place = refusal.parameter.and_then(|parameter| node.places.get(parameter)).unwrap_or(&node.place);
    let subject = refusal.parameter.map_or_else(|| node.name.clone(), |parameter| format!("{}.{parameter}", node.name));
    Problem::new(refusal.code, format!("{subject}: {}", refusal.message)).at(place, format!("{} refuses this", node.description().name)).help(refusal.help)
}

impl Plan {
    /// What was kept, dropped and why, where memory goes, and every resource and command.
    pub fn explain(&self) -> String {
        let mut text = format!("pipeline {}: {}\n", self.pipeline, self.about);
        for (layer, _) in &self.outputs {
            let _ = writeln!(text, "output {} from {}", layer.name, layer.from);
        }
        for absent in &self.absent {
            let _ = writeln!(text, "no output {}: {}", absent.layer, absent.because);
        }
        for dropped in &self.dropped {
            let _ = writeln!(text, "dropped {} because {}", dropped.node, dropped.because);
        }
        for (node, remark) in &self.remarks {
            let _ = writeln!(text, "remark {node}: {remark}");
        }
        let memory = self.memory();
        let _ = writeln!(
            text,
            "memory {} bytes: transient {} (of {} unshared) in {} allocations, history {}, constants {}, scene {}",
            memory.total(),
            memory.transient,
            memory.unshared,
            self.placement.allocations.len(),
            memory.history,
            memory.constants,
            memory.scene
        );
        text.push_str(&self.recording.to_text(&self.lifetimes, &self.placement));
        text
    }

    /// Bytes on the device by lifetime.
    pub fn memory(&self) -> Memory {
        let mut memory = Memory { transient: self.placement.allocations.iter().map(ResourceKind::bytes).sum(), ..Memory::default() };
        for (resource, slot) in self.recording.resources.iter().zip(&self.placement.slots) {
            let bytes = resource.kind.bytes();
            match &resource.lifetime {
                Lifetime::Transient if slot.is_some() => memory.unshared += bytes,
                Lifetime::Transient => {}
                Lifetime::History => memory.history += bytes,
                Lifetime::Constant(_) => memory.constants += bytes,
                Lifetime::Scene(_) | Lifetime::Frame => memory.scene += bytes,
            }
        }
        memory
    }
}

/// Bytes that a plan holds on the device.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Memory {
    pub transient: u64,
    /// What transient resources would take if none shared memory.
    pub unshared: u64,
    pub history: u64,
    pub constants: u64,
    /// The scene and the camera.
    pub scene: u64,
}

impl Memory {
    pub fn total(&self) -> u64 {
        self.transient + self.history + self.constants + self.scene
    }
}
