//! A pipeline made ready for one scene: what stays, every resource and command, and the memory they share. Needs no device.

use super::ahead;
use super::history::{self, Key, Shape, Shapes};
use super::{Dial, Edge, Layer, Loop, Node, Pipeline, Problem, Problems, When, Work, graph::family};
use crate::contract::encoder::{Encoded, Encoder, Joined, Persistent, Reported, Setting};
use crate::contract::{Input, Need, Port, PortKind, Refusal, Takes};
use crate::math::bounces::Bounces;
use crate::scene::{Scene, needs::Needs};
use crate::schedule::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::sync::Arc;

/// Most times that a pipeline is encoded to learn what histories look like: one finds out, one uses it, one makes sure.
const TRIES: usize = 4;

/// Rounds of a fill that may find no pixel without a record: those of a search from coarse cells to single pixels, and the last.
pub const IDLE_ROUNDS: u64 = 64;

/// The step that keeps what the next picture reads of this one.
const END_OF_FRAME: &str = "end of frame";

/// Bytes of the camera's buffer.
pub const CAMERA_BYTES: u64 = 256;

/// What one frame of a pipeline does on one scene.
pub struct Plan {
    /// The name of the pipeline.
    pub pipeline: String,
    /// What the method is, one sentence.
    pub about: String,
    /// See [`Pipeline::specialise`].
    pub specialised: bool,
    /// See [`Pipeline::dials`].
    pub dials: Vec<Dial>,
    /// Resources and commands.
    pub schedule: Arc<Schedule>,
    /// From where to where each resource is needed.
    pub lifetimes: Lifetimes,
    /// Which resources share memory.
    pub placement: Placement,
    /// Layer, what it shows, and the port.
    pub outputs: Vec<(Layer, Port)>,
    /// Layers that this scene leaves without a source, and why.
    pub absent: Vec<Absent>,
    /// Every port by "node.output".
    pub ports: BTreeMap<String, Port>,
    /// In the order in which they would have run.
    pub dropped: Vec<Dropped>,
    /// How often the light of its records is reflected on its way to visible surfaces.
    pub bounces: Bounces,
    /// Materials with a lobe that the pipeline takes by their [albedo](crate::scene::Material::albedo), as it cannot render lobes.
    pub by_albedo: Vec<String>,
    /// Node and what was adapted.
    pub remarks: Vec<(String, String)>,
    /// Every node that is not dropped, with its parameters as they were resolved, `name: value`.
    pub resolved: Vec<(String, Vec<String>)>,
    /// Parameters, `node.parameter`, that change nothing with this scene, and why.
    pub idle: Vec<(String, &'static str)>,
    /// Node, name and place of the numbers that a run reports.
    pub reports: Vec<(String, &'static str, Reported)>,
    /// Histories that can be saved.
    pub persistent: Vec<Saved>,
}

/// A history that can be saved and loaded.
#[derive(Debug, Clone, PartialEq)]
pub struct Saved {
    /// The node whose it is.
    pub node: String,
    /// What is saved.
    pub history: Persistent,
    /// The nodes that make its items and what they are set to, the last of them first. Items that others made do not mix with these.
    pub made_by: Vec<String>,
}

/// A node that the scene does not require.
#[derive(Debug, Clone, PartialEq)]
pub struct Dropped {
    /// The node's name.
    pub node: String,
    /// Completes "dropped because …".
    pub because: String,
}

/// A layer that is not there.
#[derive(Debug, Clone, PartialEq)]
pub struct Absent {
    /// The layer's name.
    pub layer: String,
    /// Completes "… has no source, as …".
    pub because: String,
}

/// Plans a pipeline for a scene, of which it takes no notice where the pipeline is not specialised. `dumps` are nodes ("node" or "node.output") whose memory must be whole after the frame;
/// `scene_kind` tells what memory a part of the scene takes.
///
/// # Errors
/// What passes refuse, each underlined in the document.
pub fn plan(
    pipeline: &Pipeline,
    setting: Setting<'_>,
    dumps: &[String],
    scene_kind: &dyn Fn(&Scene, SceneData) -> ResourceKind,
) -> Result<Arc<Plan>, Problems> {
    let members = members(pipeline);
    let needs = needs(pipeline, &members, setting.needs);
    let by_albedo = if needs.by_albedo { setting.needs.glossy.clone() } else { Vec::new() };
    let setting = Setting { needs: &needs, ..setting };
    let mut problems = Vec::new();
    let dump_nodes: Vec<&str> = dumps.iter().filter_map(|dump| find_dump(&members, dump, &mut problems)).collect();
    let mut dropped = drop_unneeded(&members, setting);
    drop_unused(pipeline, &members, &dump_nodes, &mut dropped);
    problems.extend(dump_nodes.iter().filter_map(|node| Some(refuse_dump(node, dropped.get(node)?))));
    if !problems.is_empty() {
        return Err(Problems(problems));
    }
    let earlier = history::edges(members.iter().map(|member| member.node), |node| !dropped.contains_key(node));
    let mut shapes = history::guesses(&earlier, setting.size);
    for _ in 0..TRIES {
        let mut planner = Planner::of(pipeline, setting, &dropped, &shapes, scene_kind);
        let found = planner.shapes(&earlier);
        if found == shapes {
            if planner.schedule.window.is_some() {
                planner.schedule.of_pictures = planner.of_pictures(&members);
            }
            return planner.finish(pipeline, &members, &earlier, dumps, by_albedo).map(Arc::new);
        }
        shapes = found;
    }
    Err(Problems(earlier.iter().map(|(node, edge)| refuse_growth(node, edge)).collect()))
}

/// What the scene requires of this pipeline.
fn needs(pipeline: &Pipeline, members: &[Member<'_>], of_scene: &Needs) -> Needs {
    let needs = if members.iter().any(|member| lacks_lobes(member.node, members)) { of_scene.without_lobes() } else { of_scene.clone() };
    if pipeline.specialise { needs } else { needs.unspecialised() }
}

/// Whether a node makes its picture of indirect light of which none is reflected by lobes.
fn lacks_lobes(node: &Node, members: &[Member<'_>]) -> bool {
    let Work::Pass(pass) = node.work else { return false };
    let images = pass.indirect_light().map(|input| node.inputs.iter().filter(|edge| edge.input == input).collect::<Vec<_>>()).unwrap_or_default();
    let (mut waiting, mut seen): (Vec<&str>, BTreeSet<&str>) = (images.iter().map(|edge| edge.from.node.as_str()).collect(), BTreeSet::new());
    while let Some(name) = waiting.pop() {
        if !seen.insert(name) {
            continue;
        }
        let Some(source) = members.iter().map(|member| member.node).find(|node| node.name == name) else { continue };
        let kinds = || source.inputs.iter().map(|edge| (source.accepts(edge), edge));
        if kinds().any(|(kind, _)| kind == Some(PortKind::VisibleLobes)) {
            return false;
        }
        let sums = kinds().filter(|(kind, _)| matches!(kind, Some(PortKind::Image | PortKind::Splats)));
        waiting.extend(sums.map(|(_, edge)| edge.from.node.as_str()));
    }
    !images.is_empty()
}

fn refuse_growth(node: &Node, edge: &Edge) -> Problem {
    let message = format!("{}.{} → {}: what it reads looks different each time that it is made from itself", node.name, edge.input, edge.written());
    Problem::new("plan::history", message).at(&edge.from.place, "an earlier value").help("a loop through time needs memory of one size and format")
}

/// How often light is reflected on its way to visible surfaces at most: once by way of records, as often as photons are that are shown or made into records, and
/// once more where records see what a field lights. Without any there is direct light alone.
fn bounces(members: &[Member<'_>], dropped: &BTreeMap<&str, String>) -> Bounces {
    let kept = || members.iter().filter(|member| !dropped.contains_key(member.node.name.as_str()));
    let edges = |kind| {
        let own = move |member: &'_ Member<'_>, edge: &&Edge| member.node.accepts(edge) == Some(kind) && edge.when == When::Now;
        kept().flat_map(move |member| member.node.inputs.iter().filter(move |edge| own(member, edge)).map(move |edge| (member.node, edge)))
    };
    let makes = |node: &Node, kind| node.description().outputs.iter().any(|output| output.kind == kind);
    let source = |edge: &Edge| kept().find(|member| member.node.name == edge.from.node);
    let once_more = |node: &Node| Bounces::Count(u32::from(makes(node, PortKind::Tiles)));
    let of_fields = edges(PortKind::IrradianceField).filter_map(|(node, edge)| Some(of_field(source(edge)?, members).and(once_more(node))));
    let of_photons = edges(PortKind::PhotonMap).filter(|(node, _)| makes(node, PortKind::Tiles)).filter_map(|(_, edge)| of_map(source(edge)?.node));
    let of_records = Bounces::Count(u32::from(edges(PortKind::RecordCache).next().is_some()));
    of_fields.chain(of_photons).fold(of_records, Bounces::max)
}

fn of_map(node: &Node) -> Option<Bounces> {
    let Work::Pass(pass) = &node.work else { return None };
    pass.reflections(&node.arguments)
}

/// How often the light of a field has been reflected: as that of the photons that it is made of, or once in each round of its loop.
fn of_field(field: &Member<'_>, members: &[Member<'_>]) -> Bounces {
    let (mut waiting, mut seen) = (vec![field.node.name.as_str()], BTreeSet::new());
    while let Some(name) = waiting.pop() {
        let Some(member) = members.iter().find(|member| member.node.name == name).filter(|_| seen.insert(name)) else { continue };
        match of_map(member.node) {
            Some(reflections) => return reflections,
            // Photons that light what records see are not what these are made of.
            None => waiting.extend(
                member.node.inputs.iter().filter(|edge| member.node.accepts(edge) != Some(PortKind::IrradianceField)).map(|edge| edge.from.node.as_str()),
            ),
        }
    }
    rounds_of(field)
}

/// Rounds of the loop around an index in which its records light those of the next.
fn rounds_of(index: &Member<'_>) -> Bounces {
    let Some((within, Work::Loop(Loop::Iterate, inner))) = index.within.map(|within| (within, &within.work)) else { return Bounces::Count(1) };
    let is_fed_back = inner.iter().flat_map(|node| &node.inputs).any(|edge| edge.when == When::PreviousRound && edge.from.node == index.node.name);
    match (is_fed_back, within.inputs.is_empty()) {
        (false, _) => Bounces::Count(1),
        (true, true) => Bounces::Count(u32::try_from(within.arguments.integer("rounds")).unwrap_or(u32::MAX)),
        (true, false) => Bounces::All,
    }
}

/// Schedule the source waits for the edge, and the edge for what the source looks like.
fn refuse_unknown(node: &Node, edge: &Edge) -> Problem {
    let message = format!("{}.{} → {}: what `{}` makes is not known before `{}` is", node.name, edge.input, edge.written(), edge.from, node.name);
    let help = "close a loop by an image, direct light, a G-buffer or a flag, whose kind tells all, or by an optional input";
    Problem::new("plan::history", message).at(&edge.from.place, "an earlier value").help(help)
}

fn refuse_absent(edge: &Edge, subject: &str) -> Problem {
    Problem::new("plan::absent_output", format!("{subject} → {}: not made with these parameters", edge.written())).at(&edge.from.place, "not there")
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
            if let Some(because) = reason_to_drop(node, members, setting, &dropped) {
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

/// The edge that an edge stands for where its source is dropped; None where nothing stands for that.
fn stand_in<'p>(edge: &'p Edge, members: &[Member<'p>], dropped: &BTreeMap<&str, String>) -> Option<&'p Edge> {
    if !dropped.contains_key(edge.from.node.as_str()) {
        return Some(edge);
    }
    let source = members.iter().map(|member| member.node).find(|node| node.name == edge.from.node)?;
    stand_in(passed_on(source, edge.from.output)?, members, dropped)
}

/// The edge to the input that an output of a node hands on where the node is dropped.
fn passed_on<'p>(node: &'p Node, output: &str) -> Option<&'p Edge> {
    let Work::Pass(pass) = node.work else { return None };
    let [input, _] = pass.stands_for().filter(|[_, own]| *own == output)?;
    node.inputs.iter().find(|edge| edge.input == input && edge.when == When::Now)
}

fn reason_to_drop(node: &Node, members: &[Member<'_>], setting: Setting<'_>, dropped: &BTreeMap<&str, String>) -> Option<String> {
    if let Work::Pass(pass) = &node.work
        && let Need::Dropped(because) = pass.need(&node.arguments, setting.needs)
    {
        return Some(because.into());
    }
    let is_lost = |edge: &&Edge| stand_in(edge, members, dropped).is_none();
    let list = |input: &&Input| input.takes == Takes::Some && node.inputs.iter().filter(|edge| edge.input == input.name).all(|edge| is_lost(&edge));
    if let Some(input) = node.description().inputs.iter().find(list) {
        return Some(format!("all that its input `{}` comes from is dropped", input.name));
    }
    let lost = node.inputs.iter().find(|edge| edge.required && is_lost(edge))?;
    Some(format!("its input `{}` comes from `{}`, which is dropped", lost.input, lost.from.node))
}

/// Nodes that no output depends on. A loop is used as a whole: its nodes work on each other's memory.
fn drop_unused<'p>(pipeline: &'p Pipeline, members: &[Member<'p>], dumps: &[&'p str], dropped: &mut BTreeMap<&'p str, String>) {
    let shown = pipeline.outputs.iter().map(|layer| layer.from.node.as_str()).chain(dumps.iter().copied()).collect();
    let used = used_by(shown, members, dropped, |_, _| true);
    for member in members {
        if !used.contains(member.node.name.as_str()) {
            dropped.entry(&member.node.name).or_insert_with(|| "nothing uses it".into());
        }
    }
}

/// Those nodes, and all that they depend on by edges that count.
fn used_by<'p>(
    mut waiting: Vec<&'p str>,
    members: &[Member<'p>],
    dropped: &BTreeMap<&'p str, String>,
    counts: impl Fn(&Node, &Edge) -> bool,
) -> BTreeSet<&'p str> {
    let by_name: BTreeMap<&str, &Member<'p>> = members.iter().map(|member| (member.node.name.as_str(), member)).collect();
    let mut used: BTreeSet<&str> = BTreeSet::new();
    while let Some(name) = waiting.pop() {
        let Some(member) = by_name.get(name).filter(|_| !dropped.contains_key(name)) else { continue };
        if !used.insert(name) {
            continue;
        }
        let edges = member.node.inputs.iter().filter(|edge| counts(member.node, edge));
        waiting.extend(edges.filter_map(|edge| Some(stand_in(edge, members, dropped)?.from.node.as_str())));
        if let Some(within) = member.within {
            family(within, &mut |inner| waiting.push(&inner.name));
        }
    }
    used
}

/// What a fill tells its nodes.
#[derive(Clone, Copy)]
struct Batch {
    at_most: u32,
    sequential: bool,
}

/// The loops around a node.
#[derive(Clone, Copy, Default)]
struct Within<'p> {
    loops: u32,
    /// Nodes of the innermost loop.
    nodes: &'p [Node],
    /// Of the innermost fill.
    batch: Option<Batch>,
}

impl Within<'_> {
    /// The inputs of a node of the innermost loop whose sources are all outside of it. A cache is never steady: nodes of the loop may add to it.
    fn steady(&self, node: &Node) -> BTreeSet<&'static str> {
        let has = |name: &str| {
            let mut found = false;
            self.nodes.iter().for_each(|inner| family(inner, &mut |member| found |= member.name == name));
            found
        };
        let comes_from_outside = |edge: &Edge| edge.when == When::Now && !has(&edge.from.node);
        let inputs = node.description().inputs.iter().filter(|input| self.loops > 0 && input.accepts != PortKind::RecordCache);
        inputs.map(|input| input.name).filter(|input| node.inputs.iter().filter(|edge| edge.input == *input).all(comes_from_outside)).collect()
    }
}

/// What the nodes of one level do: once as the level's loop starts, and in each round.
#[derive(Default)]
struct Level {
    prologue: Vec<Step>,
    steps: Vec<Step>,
    /// Rounds that the level's loop must run whatever the time.
    at_least: u32,
}

struct Planner<'a> {
    setting: Setting<'a>,
    dropped: &'a BTreeMap<&'a str, String>,
    schedule: Schedule,
    ports: BTreeMap<String, Port>,
    /// What edges to earlier rounds and frames read.
    earlier: BTreeMap<Key, Port>,
    remarks: Vec<(String, String)>,
    idle: Vec<(String, &'static str)>,
    reports: Vec<(String, &'static str, Reported)>,
    persistent: Vec<Saved>,
    /// Nodes that could not be encoded, and those that wait for them.
    failed: BTreeSet<String>,
    problems: Vec<Problem>,
}

impl<'a> Planner<'a> {
    /// Records everything; histories have these shapes.
    fn of(
        pipeline: &Pipeline,
        setting: Setting<'a>,
        dropped: &'a BTreeMap<&'a str, String>,
        shapes: &Shapes,
        scene_kind: &dyn Fn(&Scene, SceneData) -> ResourceKind,
    ) -> Self {
        let mut planner = Self::new(setting, dropped, scene_kind);
        planner.earlier = shapes.iter().map(|(key, shape)| (key.clone(), shape.declare(key, &mut planner.schedule))).collect();
        let level = planner.record_level(&pipeline.nodes, Within::default());
        planner.schedule.steps = level.prologue.into_iter().chain(level.steps).collect();
        share_time(&mut planner.schedule.steps, &mut Vec::new());
        let keep = planner.keep_earlier(|key| key.when == When::PreviousFrame);
        planner.schedule.steps.extend(step(END_OF_FRAME, "PreviousFrame", keep));
        let remarks = ahead::drive(&mut planner.schedule, setting.device);
        planner.remarks.extend(remarks);
        planner
    }

    fn new(setting: Setting<'a>, dropped: &'a BTreeMap<&'a str, String>, scene_kind: &dyn Fn(&Scene, SceneData) -> ResourceKind) -> Self {
        let mut schedule = Schedule::default();
        for data in SceneData::ALL.map(|data| if data == SceneData::Tables && setting.needs.by_albedo { SceneData::AlbedoTables } else { data }) {
            let mut declare = |scene: &Scene, name: String, part| {
                schedule.resources.push(ResourceDescription { name, kind: scene_kind(scene, data), lifetime: Lifetime::Scene(part, data) });
            };
            declare(setting.scene, data.name().into(), ScenePart::Main);
            for (number, part) in setting.scene.parts.iter().enumerate().filter(|_| !data.is_of_all_parts()) {
                declare(&part.stage.scene, of_part(&part.name, data.name()), ScenePart::Other(number));
            }
        }
        let kind = ResourceKind::Buffer { bytes: CAMERA_BYTES };
        schedule.resources.push(ResourceDescription { name: "camera".into(), kind, lifetime: Lifetime::Frame });
        Self {
            setting,
            dropped,
            schedule,
            ports: BTreeMap::new(),
            earlier: BTreeMap::new(),
            remarks: Vec::new(),
            idle: Vec::new(),
            reports: Vec::new(),
            persistent: Vec::new(),
            failed: BTreeSet::new(),
            problems: Vec::new(),
        }
    }

    /// What the sources of these edges look like, as far as they could be encoded.
    fn shapes(&self, edges: &[(&Node, &Edge)]) -> Shapes {
        let keys = edges.iter().filter_map(|(_, edge)| Key::of(edge));
        keys.filter_map(|key| Some((key.clone(), Shape::of(self.ports.get(&key.from)?, &self.schedule)))).collect()
    }

    /// Nodes that no record depends on: what changes a cache, and all that it looks at, leaves them out.
    fn of_pictures(&self, members: &[Member<'_>]) -> BTreeSet<String> {
        let adds = |input: &Input| input.changes && input.accepts == PortKind::RecordCache;
        let changes = |node: &Node| matches!(node.work, Work::Pass(_)) && node.description().inputs.iter().any(adds);
        let living = members.iter().map(|member| member.node).filter(|node| changes(node)).map(|node| node.name.as_str()).collect();
        let touched = self.schedule.resources_of_nodes();
        let looks_at = |node: &Node, edge: &Edge| {
            let brought = self.ports.get(&edge.from.to_string()).map_or_else(Vec::new, Port::resources);
            // A port may tell no more than how something was made.
            brought.is_empty() || brought.iter().any(|resource| touched.get(node.name.as_str()).is_some_and(|touched| touched.contains(resource)))
        };
        let used = used_by(living, members, self.dropped, looks_at);
        members.iter().map(|member| member.node.name.as_str()).filter(|name| !used.contains(name)).chain([END_OF_FRAME]).map(str::to_owned).collect()
    }

    /// Commands that keep what the sources of some keys hold now.
    fn keep_earlier(&self, is_meant: impl Fn(&Key) -> bool) -> Vec<Command> {
        let pairs = self.earlier.iter().filter(|(key, _)| is_meant(key)).filter_map(|(key, to)| Some((self.ports.get(&key.from)?, to)));
        pairs.flat_map(|(from, to)| history::copy(from, to, &self.schedule)).collect()
    }

    fn record_level(&mut self, nodes: &[Node], within: Within<'_>) -> Level {
        let mut level = Level::default();
        for node in nodes {
            if self.dropped.contains_key(node.name.as_str()) {
                self.pass_on(node);
                continue;
            }
            match &node.work {
                Work::Pass(_) => self.encode(node, within, &mut level),
                Work::Loop(kind, inner) => self.encode_loop(node, *kind, inner, within, &mut level.steps),
            }
        }
        level
    }

    /// Hands on what a dropped node would have changed.
    fn pass_on(&mut self, dropped: &Node) {
        family(dropped, &mut |node| {
            let Work::Pass(pass) = node.work else { return };
            let Some([_, output]) = pass.stands_for() else { return };
            if let Some(port) = passed_on(node, output).and_then(|edge| self.ports.get(&edge.from.to_string()).cloned()) {
                self.ports.insert(format!("{}.{output}", node.name), port);
            }
        });
    }

    fn encode_loop(&mut self, node: &Node, kind: Loop, inner: &[Node], within: Within<'_>, steps: &mut Vec<Step>) {
        let first_variable = self.schedule.variables.len();
        let batch = if kind == Loop::Fill { Some(self.batch_of(node, inner)) } else { within.batch };
        let mut level = self.record_level(inner, Within { loops: within.loops + 1, nodes: inner, batch });
        let is_mine = |key: &Key| key.round_of.as_ref() == Some(&node.name);
        let mut start: Vec<Command> = self.earlier.iter().filter(|(key, _)| is_mine(key)).flat_map(|(_, port)| history::clear(port, &self.schedule)).collect();
        if within.loops > 0 {
            // The frame has reset them for a loop that starts once.
            let fresh = first_variable..self.schedule.variables.len();
            start.extend(history::reset(fresh.filter(|v| !self.schedule.variables[*v].history).map(|v| Variable(v as u32)).collect()));
        }
        let pass = kind.description().name;
        level.steps.extend(step(&node.name, pass, self.keep_earlier(is_mine)));
        let time = TimeShare { at_least: level.at_least, records: self.filled_cache(inner), caches: 1 };
        if let Some(repeat) = self.repeat(node, kind, level.steps, time) {
            steps.extend(step(&node.name, pass, start));
            steps.append(&mut level.prologue);
            steps.push(Step::Repeat(repeat));
        }
    }

    /// As the fill says, or as many items as its nodes have room for.
    fn batch_of(&mut self, fill: &Node, inner: &[Node]) -> Batch {
        let ("Batched", arguments) = fill.arguments.choice("order") else { return Batch { at_most: 1, sequential: true } };
        let wanted = u32::try_from(arguments.integer("at_most")).unwrap_or(1);
        let kept = inner.iter().filter(|node| !self.dropped.contains_key(node.name.as_str()));
        let most = |node: &Node| if let Work::Pass(pass) = node.work { pass.most_of_batch(&node.arguments) } else { u32::MAX };
        let at_most = kept.map(most).fold(wanted, u32::min);
        if at_most < wanted {
            self.remarks.push((fill.name.clone(), format!("batches of {at_most} in place of {wanted}, which its nodes have no room for")));
        }
        Batch { at_most, sequential: false }
    }

    /// The number of records of the cache that these nodes add to.
    fn filled_cache(&self, nodes: &[Node]) -> Option<Variable> {
        nodes.iter().find_map(|node| match self.ports.get(&format!("{}.cache", node.name)) {
            Some(Port::RecordCache(cache)) => Some(cache.count),
            _ => None,
        })
    }

    fn repeat(&mut self, node: &Node, kind: Loop, steps: Vec<Step>, time: TimeShare) -> Option<Repeat> {
        let until = node.inputs.iter().find_map(|edge| match self.ports.get(&edge.from.to_string()) {
            Some(Port::Flag(variable)) => Some(*variable),
            _ => None,
        });
        if kind == Loop::Fill && until.is_none() {
            return None;
        }
        let round = Variable(self.schedule.variables.len() as u32);
        self.schedule.variables.push(VariableDescription { name: format!("{}.round", node.name), history: false });
        let pixels = u64::from(self.setting.size[0]) * u64::from(self.setting.size[1]);
        let bound = match kind {
            Loop::Fill => node.arguments.integer("max_rounds"),
            Loop::Iterate => node.arguments.integer("rounds"),
        };
        let at_most = match bound {
            // Every round serves at least one pixel, but for those in which a search that starts coarse finds nothing yet.
            0 => u32::try_from(pixels + IDLE_ROUNDS).unwrap_or(u32::MAX),
            rounds => u32::try_from(rounds).unwrap_or(u32::MAX),
        };
        Some(Repeat { name: node.name.clone(), until, round, at_most, steps, time, driver: Driver::Host })
    }

    fn encode(&mut self, node: &Node, within: Within<'_>, level: &mut Level) {
        let Work::Pass(pass) = node.work else { return };
        let Some(inputs) = self.inputs(node) else {
            self.failed.insert(node.name.clone());
            return;
        };
        let encoder = Encoder::new(&node.name, &node.arguments, self.setting, &inputs, &mut self.schedule).with_steady(within.steady(node));
        let mut encoder = match within.batch {
            Some(batch) => encoder.in_loop(batch.at_most, batch.sequential),
            None => encoder,
        };
        match pass.encode(&mut encoder) {
            Ok(()) => {
                let encoded = encoder.finish();
                self.keep(node, encoded, within.loops > 0, level);
            }
            Err(refusal) => {
                self.failed.insert(node.name.clone());
                self.problems.push(refused(node, refusal));
            }
        }
    }

    fn keep(&mut self, node: &Node, encoded: Encoded, in_loop: bool, level: &mut Level) {
        let prologue = if in_loop { &mut level.prologue } else { &mut level.steps };
        let pass = node.description().name;
        prologue.extend(step(&node.name, pass, encoded.prologue));
        let keys = if in_loop { Keys::default() } else { encoded.keys };
        level.steps.extend(step_of(&node.name, pass, encoded.commands, keys));
        level.at_least = level.at_least.max(encoded.at_least);
        self.ports.extend(encoded.outputs.into_iter().map(|(output, port)| (format!("{}.{output}", node.name), port)));
        self.remarks.extend(encoded.remarks.into_iter().map(|remark| (node.name.clone(), remark)));
        self.idle.extend(encoded.idle.into_iter().map(|(parameter, because)| (format!("{}.{parameter}", node.name), because)));
        self.reports.extend(encoded.reports.into_iter().map(|(name, from)| (node.name.clone(), name, from)));
        for history in encoded.persistent {
            // The last node that adds to a history has all that do among those before it.
            self.persistent.retain(|saved| saved.history.items != history.items);
            self.persistent.push(Saved { node: node.name.clone(), history, made_by: Vec::new() });
        }
    }

    /// The ports of a node's inputs; None if one is missing that must be there.
    fn inputs(&mut self, node: &Node) -> Option<Joined> {
        let mut inputs = Joined::new();
        for edge in &node.inputs {
            let port = match Key::of(edge) {
                None if self.failed.contains(&edge.from.node) => return None,
                None => self.ports.get(&edge.from.to_string()),
                // What of these is missing is told once all nodes are encoded.
                Some(key) => self.earlier.get(&key),
            };
            match port {
                Some(port) => inputs.entry(edge.input).or_default().push(port.clone()),
                None if edge.required => {
                    if edge.when == When::Now {
                        self.problems.push(refuse_absent(edge, &format!("{}.{}", node.name, edge.input)));
                    }
                    return None;
                }
                None => {}
            }
        }
        Some(inputs)
    }

    /// Edges to earlier rounds and frames that must be there and are not.
    fn refuse_missing_earlier(&mut self, edges: &[(&Node, &Edge)]) {
        let missing = |edge: &Edge| edge.required && Key::of(edge).is_some_and(|key| !self.earlier.contains_key(&key));
        let (waiting, absent): (Vec<_>, Vec<_>) = edges.iter().filter(|(_, edge)| missing(edge)).partition(|(_, edge)| self.failed.contains(&edge.from.node));
        self.problems.extend(absent.into_iter().map(|(node, edge)| refuse_absent(edge, &format!("{}.{}", node.name, edge.input))));
        // Where a pass has refused, that is why its consumers wait.
        if self.problems.is_empty() {
            self.problems.extend(waiting.into_iter().map(|(node, edge)| refuse_unknown(node, edge)));
        }
    }

    fn finish(
        mut self,
        pipeline: &Pipeline,
        members: &[Member<'_>],
        earlier: &[(&Node, &Edge)],
        dumps: &[String],
        by_albedo: Vec<String>,
    ) -> Result<Plan, Problems> {
        self.refuse_missing_earlier(earlier);
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
        let lifetimes = Lifetimes::of(&self.schedule, &kept);
        let placement = Placement::of(&self.schedule, &lifetimes);
        for saved in &mut self.persistent {
            let node = members.iter().find(|member| member.node.name == saved.node).map(|member| member.node);
            let mut provenance = Provenance { members, ports: &self.ports, followed: BTreeSet::new(), made_by: Vec::new() };
            node.into_iter().for_each(|node| provenance.follow(node));
            saved.made_by = provenance.made_by;
            saved.made_by.extend((!by_albedo.is_empty()).then(|| "glossy surfaces by their albedo".to_owned()));
        }
        let because = |node: &Node| Some(Dropped { node: node.name.clone(), because: self.dropped.get(node.name.as_str())?.clone() });
        Ok(Plan {
            pipeline: pipeline.name.clone(),
            about: pipeline.about.clone(),
            specialised: pipeline.specialise,
            dials: pipeline.dials.clone(),
            dropped: members.iter().filter_map(|member| because(member.node)).collect(),
            bounces: bounces(members, self.dropped),
            by_albedo,
            schedule: Arc::new(self.schedule),
            lifetimes,
            placement,
            outputs,
            absent,
            ports: self.ports,
            remarks: self.remarks,
            resolved: members.iter().filter(|member| !self.dropped.contains_key(member.node.name.as_str())).map(resolved).collect(),
            idle: self.idle,
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

/// A node and its parameters, `name: value`.
fn resolved(member: &Member<'_>) -> (String, Vec<String>) {
    (member.node.name.clone(), member.node.arguments.iter().map(|(name, value)| format!("{name}: {value}")).collect())
}

/// What a node's items depend on: its own parameters, and those of the nodes before it. Where items are wanted, and how they count, decides which are made,
/// not how.
struct Provenance<'a> {
    members: &'a [Member<'a>],
    ports: &'a BTreeMap<String, Port>,
    /// Names of the nodes that are told already.
    followed: BTreeSet<String>,
    made_by: Vec<String>,
}

impl Provenance<'_> {
    fn follow(&mut self, node: &Node) {
        if !self.followed.insert(node.name.clone()) {
            return;
        }
        let longer = if let Work::Pass(pass) = node.work { pass.only_longer() } else { &[] };
        let told = node.arguments.iter().filter(|(name, _)| !longer.contains(name));
        let parameters: Vec<String> = told.map(|(name, value)| format!("{name}: {value}")).collect();
        self.made_by.push(format!("{}({})", node.description().name, parameters.join(", ")));
        for edge in &node.inputs {
            let source = self.members.iter().map(|member| member.node).find(|node| node.name == edge.from.node);
            match self.ports.get(&edge.from.to_string()) {
                None | Some(Port::Requests(_) | Port::Splats(_) | Port::GBuffer(_) | Port::Flag(_)) => {}
                // What another loop has added is in the cache, too.
                Some(Port::RecordCache(_)) => source.filter(|node| self.adds_to_cache(node)).into_iter().for_each(|node| self.follow(node)),
                Some(Port::DirectLight(direct)) => self.made_by.push(format!("{}: lights from emitters: {}", edge.input, direct.lights_from_emitters)),
                Some(Port::ShadowMaps(maps)) => self.made_by.push(format!("{}: maps of {} texels", edge.input, maps.resolution)),
                Some(_) => source.into_iter().for_each(|node| self.follow(node)),
            }
        }
    }

    /// Whether a node takes a cache, which it hands on.
    fn adds_to_cache(&self, node: &Node) -> bool {
        node.inputs.iter().any(|edge| matches!(self.ports.get(&edge.from.to_string()), Some(Port::RecordCache(_))))
    }
}

/// Tells each loop among how many caches the time that is left is shared out, from the last loop to the first; `later` are the caches after these steps.
fn share_time(steps: &mut [Step], later: &mut Vec<Variable>) {
    for step in steps.iter_mut().rev() {
        let Step::Repeat(repeat) = step else { continue };
        share_time(&mut repeat.steps, later);
        later.extend(repeat.time.records.filter(|cache| !later.contains(cache)));
        repeat.time.caches = later.len().max(1) as u32;
    }
}

/// A step of these commands, if there are any.
fn step(name: &str, pass: &'static str, commands: Vec<Command>) -> Option<Step> {
    step_of(name, pass, commands, Keys::default())
}

fn step_of(name: &str, pass: &'static str, commands: Vec<Command>, keys: Keys) -> Option<Step> {
    (!commands.is_empty()).then(|| Step::Node(crate::schedule::Node { name: name.into(), pass, commands, keys }))
}

fn refused(node: &Node, refusal: Refusal) -> Problem {
    let place = refusal.parameter.and_then(|parameter| node.places.get(parameter)).unwrap_or(&node.place);
    let subject = refusal.parameter.map_or_else(|| node.name.clone(), |parameter| format!("{}.{parameter}", node.name));
    Problem::new(refusal.code, format!("{subject}: {}", refusal.message)).at(place, format!("{} refuses this", node.description().name)).help(refusal.help)
}

impl Plan {
    /// The ports of a node, each with its whole name.
    pub fn ports_of<'p>(&'p self, node: &'p str) -> impl Iterator<Item = (&'p String, &'p Port)> {
        self.ports.iter().filter(move |(port, _)| port.split_once('.').is_some_and(|(owner, _)| owner == node))
    }

    /// What was kept, dropped and why, where memory goes, and every resource and command.
    pub fn explain(&self) -> String {
        let mut text = format!("pipeline {}: {}\n", self.pipeline, self.about);
        if !self.specialised {
            text.push_str("not specialised: planned as if the scene needed everything\n");
        }
        for (layer, _) in &self.outputs {
            let _ = writeln!(text, "output {} from {}", layer.name, layer.from);
        }
        for dial in &self.dials {
            let _ = writeln!(text, "dial {dial}");
        }
        if self.bounces.max(Bounces::Count(1)) != Bounces::Count(1) {
            let _ = writeln!(text, "bounces {}", self.bounces);
        }
        for absent in &self.absent {
            let _ = writeln!(text, "no output {}: {}", absent.layer, absent.because);
        }
        for dropped in &self.dropped {
            let _ = writeln!(text, "dropped {} because {}", dropped.node, dropped.because);
        }
        for approximation in self.approximated() {
            let _ = writeln!(text, "approximated: {approximation}");
        }
        for (node, remark) in &self.remarks {
            let _ = writeln!(text, "remark {node}: {remark}");
        }
        for (node, parameters) in self.resolved.iter().filter(|(_, parameters)| !parameters.is_empty()) {
            let _ = writeln!(text, "parameters {node}: {}", parameters.join(", "));
        }
        for (parameter, because) in &self.idle {
            let _ = writeln!(text, "no effect of {parameter}, as {because}");
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
        text.push_str(&self.schedule.to_text(&self.lifetimes, &self.placement));
        text
    }

    /// Why a parameter, `node.parameter` or deeper, changes nothing in this plan, if that is known.
    pub fn why_idle(&self, parameter: &str) -> Option<String> {
        let node = parameter.split('.').next().unwrap_or(parameter);
        let dropped = self.dropped.iter().find(|dropped| dropped.node == node).map(|dropped| format!("`{node}` is dropped: {}", dropped.because));
        let holds = |idle: &str| parameter.strip_prefix(idle).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
        dropped.or_else(|| self.idle.iter().find(|(idle, _)| holds(idle)).map(|(_, because)| (*because).to_owned()))
    }

    /// What the plan shows otherwise than the scene has it, a sentence each.
    pub fn approximated(&self) -> Vec<String> {
        const SHOWN: usize = 4;
        let names: Vec<String> = self.by_albedo.iter().take(SHOWN).map(|name| format!("`{name}`")).collect();
        let more = self.by_albedo.len().saturating_sub(SHOWN);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let of_lobes =
            format!("{} takes glossy materials as diffuse, by their albedo ({}{more}); `radiance` renders their lobes", self.pipeline, names.join(", "));
        (!self.by_albedo.is_empty()).then_some(of_lobes).into_iter().collect()
    }

    /// Bytes on the device by lifetime.
    pub fn memory(&self) -> Memory {
        let mut memory = Memory { transient: self.placement.allocations.iter().map(ResourceKind::bytes).sum(), ..Memory::default() };
        for (resource, slot) in self.schedule.resources.iter().zip(&self.placement.slots) {
            let bytes = resource.kind.bytes();
            match &resource.lifetime {
                Lifetime::Transient if slot.is_some() => memory.unshared += bytes,
                Lifetime::Transient => {}
                Lifetime::History => memory.history += bytes,
                Lifetime::Constant(_) => memory.constants += bytes,
                Lifetime::Scene(..) | Lifetime::Frame | Lifetime::Variables => memory.scene += bytes,
            }
        }
        memory
    }
}

/// Bytes that a plan holds on the device.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Memory {
    /// What lives within a frame.
    pub transient: u64,
    /// What transient resources would take if none shared memory.
    pub unshared: u64,
    /// What lives on into the next frame.
    pub history: u64,
    /// Tables and other contents that plans know.
    pub constants: u64,
    /// The scene and the camera.
    pub scene: u64,
}

impl Memory {
    /// All of it.
    pub fn total(&self) -> u64 {
        self.transient + self.history + self.constants + self.scene
    }
}
