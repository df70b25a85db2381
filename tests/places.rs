//! Every node that both the host and the device can do, done by both: in the renders of all pipelines that ship, round by round, from the same inputs.
//!
//! The device draws a picture, and what each node hands on is noted. Then the host draws it, as far as it can; what each of its nodes hands on is compared
//! with what was noted and replaced by it, so that the next node starts from the same. A pass with two bodies is in this test by having them.
//! Those few pipelines that do most of what there is run every time; the others are long cases, which `--include-ignored` runs too.
//!
//! Needs a GPU adapter, a software one will do.

mod skips;

use glam::Vec3;
use hemisplat::{
    block_on,
    contract::{PLACE, Port, encoder::Setting, port, tables::Remembered},
    gpu::{Gpu, Pace, Session, scene::kind},
    math::morton::Cube,
    passes::{
        REGISTRY,
        photons::{HEAD_BYTES, MapHead, PHOTON_BYTES, Photon, SLOTS_BEFORE},
        record::{RECORD_BYTES, REQUEST_BYTES, Request},
    },
    pipeline::{self, Pipeline, Plan, Problems, embedded::EMBEDDED, load, plan},
    scene::{load as scenes, needs::Needs, stage},
    schedule::{self, *},
};
use libtest_mimic::{Arguments, Failed};
use skips::Missing;
use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet, VecDeque},
    io,
    path::Path,
    sync::{Arc, Mutex, PoisonError},
};

type Outcome = Result<(), Failed>;

/// Lamps, a sky, lights with maps and lobes together; lights with maps and nothing else.
const KINDS: (&str, &str) = ("kinds", "tests/places/kinds.ron");
const HALL: (&str, &str) = ("hall", "scenes/hall.ron");
const SIZE: [u32; 2] = [32, 24];

/// Two numbers are alike that differ by less than this share of the larger, or of the root mean square of the same field of all items.
const ALIKE: f32 = 2e-3;
/// Most of the numbers of a resource that may not be alike: rays that pass by an edge, pixels at the rim of a record.
const APART: f64 = 0.01;

fn main() {
    let gpu = block_on(Gpu::open()).map_err(|error| error.to_string());
    let missing = gpu.as_ref().err().map(|reason| Missing::new("gpu", reason));
    let cases = EMBEDDED.iter().map(|(file, _)| (*file, KINDS)).chain([("irradiance.ron", HALL)]);
    let enough = enough(EMBEDDED.iter().map(|(file, _)| *file));
    let trials = cases.map(|(file, (name, scene))| {
        let (gpu, title) = (gpu.clone(), format!("{} of {name}", file.trim_end_matches(".ron")));
        let test = move || agree(&gpu?, file, scene);
        let is_short = name == HALL.0 || enough.contains(file);
        skips::short_or_long(title, !is_short, missing.as_ref(), test)
    });
    libtest_mimic::run(&Arguments::from_args(), trials.collect()).exit()
}

/// Pipelines that run every time. Drivers on the processor compile for a minute or two for each, unless they remember.
const SHORT: usize = 5;

/// Files that together hold most of what is done by nodes of both, those with the most of it first.
fn enough(files: impl Iterator<Item = &'static str>) -> BTreeSet<&'static str> {
    let mut left: BTreeMap<&str, BTreeSet<String>> = files.map(|file| (file, done_by(file))).collect();
    let mut enough = BTreeSet::new();
    while enough.len() < SHORT
        && let Some((file, done)) = left.iter().max_by_key(|(file, done)| (done.len(), Reverse(**file))).filter(|(_, done)| !done.is_empty())
    {
        let (file, done) = (*file, done.clone());
        enough.insert(file);
        left.values_mut().for_each(|others| others.retain(|work| !done.contains(work)));
    }
    enough
}

/// What a pipeline's nodes of both do: the pass, its parameters, and what it works on.
fn done_by(file: &str) -> BTreeSet<String> {
    let pipeline = load(file, &[], REGISTRY, &mut |_| Err(io::ErrorKind::NotFound.into())).unwrap_or_else(|problems| panic!("{problems:?}"));
    let nodes = all(&pipeline.nodes);
    let passes: BTreeMap<&str, &str> = nodes.iter().map(|node| (&*node.name, node.description().name)).collect();
    let works = nodes.iter().filter(|node| is_of_both(node)).map(|node| {
        let inputs: Vec<_> = node.inputs.iter().map(|edge| (edge.input, passes.get(&*edge.from.node), edge.from.output)).collect();
        format!("{} {:?} {inputs:?}", node.description().name, node.arguments)
    });
    works.collect()
}

/// All nodes, those inside loops too.
fn all(nodes: &[pipeline::Node]) -> Vec<&pipeline::Node> {
    nodes.iter().flat_map(|node| [node].into_iter().chain(all(node.inner()))).collect()
}

/// Whether the pass of a node says that the host and the device can do it.
fn is_of_both(node: &pipeline::Node) -> bool {
    node.description().parameters.iter().any(|parameter| parameter.name == PLACE.name)
}

/// A pipeline that ships, and a scene.
struct Stage {
    file: &'static str,
    ready: Arc<stage::Stage>,
    tables: Remembered,
    /// A driver on the cores of the host, that blends what the adapter blends.
    device: Device,
}

impl Stage {
    fn pipeline(&self, sets: &[String]) -> Result<Pipeline, Problems> {
        load(self.file, sets, REGISTRY, &mut |_| Err(io::ErrorKind::NotFound.into()))
    }

    /// A plan in which these nodes are done at this place.
    fn plan(&self, nodes_there: &BTreeSet<String>, place: &str) -> Result<Arc<Plan>, Problems> {
        let unset = self.pipeline(&[])?;
        // A driver on the processor takes half a minute for finer tables.
        let lobes = all(&unset.nodes).into_iter().filter(|node| node.description().name == "LobeCoefficients");
        let coarse = lobes.flat_map(|node| [format!("{}.grid=8", node.name), format!("{}.order=Fixed(order:4)", node.name)]);
        // It also ends loops early, in which more photons are looked at.
        let photons = all(&unset.nodes).into_iter().filter(|node| node.description().name == "PhotonTiles");
        let few = photons.map(|node| format!("{}.photons=16", node.name));
        // As many rays for all: the host alone makes tiles finer.
        let tiles = all(&unset.nodes).into_iter().filter(|node| node.description().name == "HemisphereTiles");
        let even = tiles.map(|node| format!("{}.quality=1e6", node.name));
        let lightmaps = all(&unset.nodes).into_iter().filter(|node| node.description().name == "Lightmap");
        let short = lightmaps.flat_map(|node| [format!("{}.resolution=32", node.name), format!("{}.iterations=6", node.name)]);
        let there = nodes_there.iter().map(|node| format!("{node}.place={place}"));
        let sets: Vec<String> = there.chain(coarse).chain(few).chain(even).chain(short).collect();
        let needs = Needs::of(&self.ready.scene);
        let setting = Setting { scene: &self.ready.scene, needs: &needs, device: self.device, size: SIZE, tables: Some(&self.tables) };
        plan(&self.pipeline(&sets)?, setting, &[], &kind)
    }

    /// A plan in which as many of the nodes as can are done at a place, and their names.
    fn plan_of_most(&self, nodes: &[String], place: &str) -> Result<(Arc<Plan>, BTreeSet<String>), Failed> {
        let mut there: BTreeSet<String> = nodes.iter().cloned().collect();
        loop {
            let problems = match self.plan(&there, place) {
                Ok(plan) => return Ok((plan, there)),
                Err(problems) => problems,
            };
            // "node.place: the host cannot do this, as …"; or where another hands on what this place cannot use, that one.
            let named = problems.0.iter().filter_map(|problem| there.get(problem.message.split('.').next()?)).cloned().collect::<Vec<_>>();
            let without = |node: &String| self.plan(&there.iter().filter(|other| *other != node).cloned().collect(), place);
            let other = || there.iter().find(|node| without(node).is_ok()).cloned();
            let refused = if named.is_empty() { Vec::from_iter(other()) } else { named };
            check(!refused.is_empty(), || format!("{problems:?}"))?;
            refused.iter().for_each(|node| _ = there.remove(node));
        }
    }

    fn draw(&self, gpu: &Arc<Gpu>, plan: &Plan) -> Outcome {
        let placement = Placement::of(&plan.schedule, &Lifetimes::of(&plan.schedule, &[]));
        let camera = &self.ready.scene.cameras[0];
        let mut session = block_on(Session::new(gpu, &self.ready, &plan.schedule, &placement, camera, SIZE)).map_err(|error| error.to_string())?;
        block_on(session.frame(&|| Pace::GoOn)).map_err(|error| error.to_string())?;
        Ok(())
    }
}

fn agree(gpu: &Arc<Gpu>, file: &'static str, scene: &str) -> Outcome {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(scene);
    let scene = scenes::load(&path, &scenes::LoadOptions::default()).map_err(|error| error.to_string())?;
    let ready = Arc::new(stage::Stage::new(scene));
    let stage = Stage { file, ready, tables: Remembered::default(), device: Device { is_software: true, ..gpu.adapter.device() } };
    let pipeline = stage.pipeline(&[]).map_err(|problems| format!("{problems:?}"))?;
    let nodes: Vec<String> = all(&pipeline.nodes).into_iter().filter(|node| is_of_both(node)).map(|node| node.name.clone()).collect();
    let log = Arc::new(Mutex::new(Log::default()));
    let drawn = |place: &str, step: Step| {
        let (mut plan, there) = stage.plan_of_most(&nodes, place)?;
        watch(Arc::get_mut(&mut plan).ok_or("someone else has the plan")?, &log, step);
        stage.draw(gpu, &plan).map(|()| (plan, there))
    };
    let (_, on_device) = drawn("Device", note)?;
    let (plan, on_host) = drawn("Host", compare)?;
    let mut log = log.lock().unwrap_or_else(PoisonError::into_inner);
    log.judge_constants(&plan);
    log.tell();
    let kept: BTreeSet<&str> = plan.ports.keys().filter_map(|port| port.split('.').next()).collect();
    let of_both = on_device.intersection(&on_host).filter(|node| kept.contains(&node[..]));
    let is_compared = |node: &str| log.compared.keys().any(|port| port.split('.').next() == Some(node));
    let missed: Vec<&String> = of_both.filter(|node| !is_compared(node)).collect();
    check(missed.is_empty() && log.noted.is_empty(), || format!("{missed:?} and {:?} were not compared", log.noted.keys()))?;
    check(log.apart.is_empty(), || log.apart.join("\n"))
}

/// A resource of a port.
struct Part {
    resource: Resource,
    kind: ResourceKind,
    counted: Counted,
    /// Numbers that mean different things, after which the meanings repeat.
    fields: usize,
    /// Known as the plan is made: compared, and left as it is.
    is_constant: bool,
    content: Content,
}

/// What is compared otherwise than number by number.
#[derive(PartialEq)]
enum Content {
    Numbers,
    /// They come in another order where one of them is on the other side of a cell's edge.
    Photons,
    /// Groups are divided otherwise where one of their members is on the other side of their middle.
    Places,
}

impl Part {
    /// The share that is not alike.
    fn apart(&self, found: &[u8], expected: &[u8]) -> f64 {
        let by_number = || apart(&self.kind, self.fields, found, expected);
        match self.content {
            Content::Numbers => by_number(),
            Content::Photons => photons_apart(found, expected),
            Content::Places => by_number().min(places_apart(found, expected)),
        }
    }

    fn read(&self) -> Read {
        self.counted.map_or(Read::whole(self.resource), |(stride, count)| Read::counted(self.resource, stride, count))
    }
}

/// What counts a resource's items: how many bytes each has, and the variable. None where all of it is meant.
type Counted = Option<(u64, Variable)>;

fn fields(kind: &ResourceKind, counted: Counted) -> usize {
    match (kind, counted) {
        (ResourceKind::Texture { format: Format::R32Uint | Format::R32Float | Format::Depth32Float, .. }, _) => 1,
        // Requests, records and photons; tiles and coefficients are vectors of four.
        (_, Some((stride, _))) if [REQUEST_BYTES, RECORD_BYTES, PHOTON_BYTES].contains(&stride) => stride as usize / 4,
        _ => 4,
    }
}

/// What a port holds that its node made.
fn parts(port: &Port) -> (Vec<(Resource, Counted)>, Vec<Variable>) {
    let coefficients = |of: Option<port::Coefficients>, count| of.map(|c| (c.values, Some((port::Coefficients::bytes(c.order, c.precision), count))));
    match port {
        Port::Requests(p) => (vec![(p.places, Some((REQUEST_BYTES, p.count)))], vec![p.count, p.made]),
        Port::Tiles(p) => (vec![(p.samples, Some((16 * p.table.samples.len() as u64, p.requests.count)))], Vec::new()),
        Port::WeightedTiles(_) => Default::default(),
        Port::Records(p) => ([(p.records, Some((RECORD_BYTES, p.count)))].into_iter().chain(coefficients(p.coefficients, p.count)).collect(), Vec::new()),
        Port::RecordCache(p) => {
            ([(p.records, Some((RECORD_BYTES, p.count)))].into_iter().chain(coefficients(p.coefficients, p.count)).collect(), vec![p.count])
        }
        Port::Splats(p) => ([p.sums].into_iter().chain(p.counts).map(|image| (image, None)).collect(), Vec::new()),
        Port::Flag(flag) => (Vec::new(), vec![*flag]),
        Port::PhotonMap(p) => (vec![(p.data, Some((PHOTON_BYTES, p.slots)))], Vec::new()),
        Port::Shooters(p) => (vec![(p.requests.places, Some((REQUEST_BYTES, p.requests.count))), (p.shots, None)], vec![p.requests.count]),
        // Which places of the texture are whose is known as the plan is made. What is near is told by the mean that it joins: of a texel's few rays one passes an edge on its
        // other side.
        Port::Lightmap(p) => ([p.surfaces, p.direct, p.fresh, p.mean].map(|resource| (resource, None)).into(), vec![p.iterations]),
        // Maps are drawn by the device alone.
        Port::ShadowMaps(_) => Default::default(),
        other => (other.resources().into_iter().map(|resource| (resource, None)).collect(), Vec::new()),
    }
}

/// What the device handed on, by port in order.
#[derive(Default)]
struct Log {
    noted: BTreeMap<String, VecDeque<Noted>>,
    /// By port the largest share of numbers that were not alike.
    compared: BTreeMap<String, f64>,
    apart: Vec<String>,
}

struct Noted {
    contents: Vec<Vec<u8>>,
    variables: Vec<u32>,
}

impl Log {
    fn judge(&mut self, port: &str, share: f64) {
        let largest = self.compared.entry(port.into()).or_default();
        *largest = largest.max(share);
        if share > APART {
            self.apart.push(format!("{port}: {:.2} % of the numbers are not alike", 100.0 * share));
        }
    }

    /// What the host has known as it made the plan no step of it hands on.
    fn judge_constants(&mut self, plan: &Plan) {
        let mut noted = std::mem::take(&mut self.noted);
        noted.retain(|_, rest| !rest.is_empty());
        noted.retain(|port, rest| {
            let of_port = plan.ports.get(port).map(|port| parts(port).0).unwrap_or_default();
            let constants = of_port.iter().filter_map(|(resource, _)| match &plan.schedule.resource(*resource).lifetime {
                Lifetime::Constant(contents) => Some((&plan.schedule.resource(*resource).kind, contents)),
                _ => None,
            });
            let constants: Vec<_> = constants.collect();
            constants.iter().zip(&rest[0].contents).for_each(|((kind, found), expected)| self.judge(port, apart(kind, fields(kind, None), found, expected)));
            constants.is_empty()
        });
        self.noted = noted;
    }

    fn tell(&self) {
        if std::env::var_os("HEMISPLAT_TOLD").is_some() {
            self.compared.iter().for_each(|(port, share)| println!("{port}: {:.3} %", 100.0 * share));
        }
    }
}

type Step = fn(&mut Log, &str, &[Part], &[Variable], &mut dyn HostContext);

/// Has a step after each node look at each of its ports.
fn watch(plan: &mut Plan, log: &Arc<Mutex<Log>>, step: Step) {
    let last: BTreeMap<String, usize> = plan.schedule.nodes().iter().enumerate().map(|(at, node)| (node.name.clone(), at)).collect();
    let mut steps = std::mem::take(&mut Arc::get_mut(&mut plan.schedule).expect("no session runs it").steps);
    let mut at = 0;
    for_nodes(&mut steps, &mut |node| {
        if last.get(&node.name) == Some(&at) {
            let of_node = plan.ports.iter().filter(|(port, _)| port.split('.').next() == Some(&node.name[..]));
            let watched: Vec<Command> = of_node.filter_map(|(name, port)| watcher(&plan.schedule, name, port, log, step)).collect();
            node.commands.extend(watched);
        }
        at += 1;
    });
    Arc::get_mut(&mut plan.schedule).expect("no session runs it").steps = steps;
}

fn for_nodes(steps: &mut [schedule::Step], see: &mut dyn FnMut(&mut Node)) {
    for step in steps {
        match step {
            schedule::Step::Node(node) => see(node),
            schedule::Step::Repeat(repeat) => for_nodes(&mut repeat.steps, see),
        }
    }
}

fn watcher(schedule: &Schedule, name: &str, port: &Port, log: &Arc<Mutex<Log>>, step: Step) -> Option<Command> {
    let (parts, variables) = parts(port);
    let is_constant = |resource| matches!(schedule.resource(resource).lifetime, Lifetime::Constant(_));
    let described = |(resource, counted)| {
        let kind = schedule.resource(resource).kind.clone();
        let content = match port {
            Port::PhotonMap(_) => Content::Photons,
            Port::Requests(_) => Content::Places,
            _ => Content::Numbers,
        };
        Part { resource, fields: fields(&kind, counted), kind, counted, is_constant: is_constant(resource), content }
    };
    let made = |part: &Part| !matches!(schedule.resource(part.resource).lifetime, Lifetime::Scene(..) | Lifetime::Frame);
    let parts: Vec<Part> = parts.into_iter().map(described).filter(made).collect();
    if parts.is_empty() && variables.is_empty() {
        return None;
    }
    let (reads, writes) = (parts.iter().map(Part::read).collect(), parts.iter().filter(|part| !part.is_constant).map(|part| part.resource).collect());
    let (name, log) = (name.to_owned(), log.clone());
    let run = move |host: &mut dyn HostContext| {
        step(&mut log.lock().unwrap_or_else(PoisonError::into_inner), &name, &parts, &variables, host);
        Ok(())
    };
    Some(Command::Host(Host::new("watch", reads, writes, run)))
}

fn note(log: &mut Log, port: &str, parts: &[Part], variables: &[Variable], host: &mut dyn HostContext) {
    let contents = parts.iter().map(|part| host.read(part.resource).to_vec()).collect();
    let variables = variables.iter().map(|variable| host.variable(*variable)).collect();
    log.noted.entry(port.into()).or_default().push_back(Noted { contents, variables });
}

/// Compares, and goes on from what was noted.
fn compare(log: &mut Log, port: &str, parts: &[Part], variables: &[Variable], host: &mut dyn HostContext) {
    let Some(noted) = log.noted.get_mut(port).and_then(VecDeque::pop_front) else {
        return log.apart.push(format!("{port}: the host does more than the device"));
    };
    for (part, expected) in parts.iter().zip(&noted.contents) {
        let found = host.read(part.resource);
        log.judge(port, part.apart(found, expected));
        if part.is_constant {
            continue;
        }
        let mut contents = host.take(part.resource);
        bytemuck::cast_slice_mut(&mut contents)[..expected.len()].copy_from_slice(expected);
        host.put(part.resource, contents, expected.len() as u64);
    }
    for (variable, expected) in variables.iter().zip(&noted.variables) {
        let found = host.variable(*variable);
        // So many places more or fewer there may be as photons or paths more or fewer.
        let few = if parts.iter().any(|part| part.content == Content::Places) { expected / 1000 } else { 0 };
        if found.abs_diff(*expected) > few {
            log.apart.push(format!("{port}: a variable is {found}, not {expected}"));
        }
        host.set(*variable, *expected);
    }
    for (part, expected) in parts.iter().zip(&noted.contents) {
        part.counted.iter().for_each(|(stride, count)| host.set(*count, (expected.len() as u64 / stride) as u32));
    }
}

/// The share of places of either side that no place of the other is near to, as far as both stand for others.
fn places_apart(found: &[u8], expected: &[u8]) -> f64 {
    let by_x = |bytes| {
        let mut requests: Vec<Request> = bytemuck::pod_collect_to_vec(bytes);
        requests.sort_by(|a, b| a.position[0].total_cmp(&b.position[0]));
        requests
    };
    let [found, expected] = [by_x(found), by_x(expected)];
    let farthest = found.iter().chain(&expected).map(|request| request.footprint).fold(0.0, f32::max);
    let is_near = |a: &Request, b: &Request| {
        let apart = Vec3::from(a.position).distance(b.position.into());
        apart <= a.footprint + b.footprint && Vec3::from(a.normal).dot(b.normal.into()) > 0.9
    };
    let lonely = |some: &[Request], others: &[Request]| {
        let is_lonely = |a: &&Request| {
            let from = others.partition_point(|b| b.position[0] < a.position[0] - a.footprint - farthest);
            let within = others[from..].iter().take_while(|b| b.position[0] <= a.position[0] + a.footprint + farthest);
            !within.into_iter().any(|b| is_near(a, b))
        };
        some.iter().filter(is_lonely).count() as f64 / some.len().max(1) as f64
    };
    lonely(&found, &expected).max(lonely(&expected, &found))
}

/// The share of photons of either map that have none like them in the other; all where their heads differ, the tables do by many photons, or one is not sorted.
fn photons_apart(found: &[u8], expected: &[u8]) -> f64 {
    let [found, expected] = [found, expected].map(Map::of);
    let [few, many] = [found.photons.len(), expected.photons.len()].map(|count| count as f64);
    let is_near = |(a, b): (&u32, &u32)| f64::from(a.abs_diff(*b)) <= APART * many;
    let is_built = found.is_sorted() && expected.is_sorted() && found.level == expected.level && found.cube == expected.cube;
    if !is_built || !found.table.iter().zip(&expected.table).all(is_near) {
        return 1.0;
    }
    let lonely = without_partner(&found.photons, &expected.photons).max(without_partner(&expected.photons, &found.photons));
    lonely.max((few - many).abs() / many.max(1.0))
}

/// A photon map.
struct Map {
    cube: Cube,
    level: u32,
    table: Vec<u32>,
    photons: Vec<Photon>,
}

impl Map {
    fn of(bytes: &[u8]) -> Self {
        let (before, photons) = bytes.split_at((SLOTS_BEFORE * PHOTON_BYTES) as usize);
        let (head, table) = before.split_at(HEAD_BYTES as usize);
        let head: MapHead = bytemuck::pod_read_unaligned(head);
        let cube = Cube { corner: head.corner.into(), cells_per_unit: head.cells_per_unit };
        let photons = bytemuck::pod_collect_to_vec::<u8, Photon>(photons)[..head.count as usize].to_vec();
        Self { cube, level: head.level, table: bytemuck::pod_collect_to_vec(table), photons }
    }

    fn is_sorted(&self) -> bool {
        self.photons.is_sorted_by_key(|photon| self.cube.code(photon.position.into()))
    }
}

/// The share of photons that have no partner among others: at the same place [scene units, of scenes some units wide], as bright and as far from where it came.
fn without_partner(photons: &[Photon], others: &[Photon]) -> f64 {
    const NEAR: f32 = 2e-3;
    let cell = |photon: &Photon, step: [i32; 3]| std::array::from_fn::<i32, 3, _>(|axis| (photon.position[axis] / NEAR).floor() as i32 + step[axis]);
    let mut cells: BTreeMap<[i32; 3], Vec<&Photon>> = BTreeMap::new();
    others.iter().for_each(|other| cells.entry(cell(other, [0; 3])).or_default().push(other));
    let is_alike = |a: f32, b: f32| (a - b).abs() <= 5.0 * ALIKE * a.abs().max(b.abs());
    let are_partners = |a: &Photon, b: &Photon| is_alike(a.leg, b.leg) && (0..3).all(|channel| is_alike(a.flux[channel], b.flux[channel]));
    let steps = || (0..27).map(|at| [at % 3 - 1, at / 3 % 3 - 1, at / 9 - 1]);
    let has_partner = |photon: &&Photon| steps().filter_map(|step| cells.get(&cell(photon, step))).flatten().any(|other| are_partners(photon, other));
    photons.iter().filter(|photon| !has_partner(photon)).count() as f64 / photons.len().max(1) as f64
}

/// The share of numbers that are not alike.
fn apart(kind: &ResourceKind, fields: usize, found: &[u8], expected: &[u8]) -> f64 {
    let [found, expected] = [found, expected].map(|bytes| numbers(kind, bytes));
    if found.len() != expected.len() {
        return 1.0;
    }
    let mut squares = vec![(0.0, 0.0); fields];
    // The sky is at a distance of 1e30.
    for (at, x) in expected.iter().enumerate().filter(|(_, x)| x.abs() < 1e20) {
        let (sum, count) = &mut squares[at % fields];
        (*sum, *count) = (*sum + f64::from(*x).powi(2), *count + 1.0);
    }
    let scales: Vec<f32> = squares.iter().map(|(sum, count)| (sum / f64::max(*count, 1.0)).sqrt() as f32).collect();
    // An unlike NaN is not alike to anything.
    let is_alike = |(a, b): (f32, f32), scale: f32| a.to_bits() == b.to_bits() || (a - b).abs() <= ALIKE * scale.max(a.abs()).max(b.abs());
    let unlike = found.iter().zip(&expected).enumerate().filter(|(at, (a, b))| !is_alike((**a, **b), scales[at % fields])).count();
    unlike as f64 / expected.len().max(1) as f64
}

fn numbers(kind: &ResourceKind, bytes: &[u8]) -> Vec<f32> {
    match kind {
        ResourceKind::Texture { format: Format::Rgba16Float, .. } => bytemuck::pod_collect_to_vec::<u8, half::f16>(bytes).into_iter().map(f32::from).collect(),
        ResourceKind::Texture { format: Format::R32Uint, .. } => bytemuck::pod_collect_to_vec::<u8, u32>(bytes).into_iter().map(|x| x as f32).collect(),
        _ => bytemuck::pod_collect_to_vec(bytes),
    }
}

fn check(holds: bool, what: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(what().into()) }
}
