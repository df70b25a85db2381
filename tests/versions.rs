//! The order in which a document lists its nodes means nothing: what a node changes is a new version, and who names the older one runs before.
//!
//! Pictures need a GPU adapter, a software one will do.

mod skips;

use hemisplat::{
    block_on,
    contract::{Port, encoder::Setting},
    gpu::{Gpu, Pace, scene::kind, shader::Shader},
    measure::{layers::Layers, run::Run},
    passes::REGISTRY,
    pipeline::{Edge, Node, Plan, Problems, embedded::EMBEDDED, load, plan},
    scene::{Scene, load as scenes, needs::Needs, stage::Stage},
    schedule::{Command, Device, Resource},
};
use libtest_mimic::{Arguments, Failed};
use skips::Missing;
use std::{
    collections::{BTreeMap, BTreeSet},
    io,
    path::Path,
    sync::Arc,
};

type Outcome = Result<(), Failed>;

const SIZE: [u32; 2] = [40, 30];

fn main() {
    let gpu = block_on(Gpu::open()).map_err(|error| error.to_string());
    let missing = gpu.as_ref().err().map(|reason| Missing::new("gpu", reason));
    let mut trials = vec![
        skips::trial("plans_are_the_same_in_any_order", None, plans_are_the_same),
        skips::trial("nodes_that_read_the_older_version_run_before", None, older_versions_come_first),
        skips::trial("nodes_change_nothing_else_than_they_say", None, nodes_change_what_they_say),
    ];
    for (file, text) in written_out() {
        let gpu = gpu.clone();
        trials.push(skips::trial(format!("pictures_of_{}", file.trim_end_matches(".ron")), missing.as_ref(), move || pictures_are_the_same(&gpu?, text)));
    }
    libtest_mimic::run(&Arguments::from_args(), trials).exit()
}

/// The pipelines that list their nodes themselves; variants take theirs over.
fn written_out() -> impl Iterator<Item = (&'static str, &'static str)> {
    EMBEDDED.iter().copied().filter(|(_, text)| text.starts_with("Pipeline("))
}

fn plans_are_the_same() -> Outcome {
    let scene = scene()?;
    for (file, text) in written_out() {
        for device in [Device::ABLE, Device::SOFTWARE] {
            let kept = told(&*planned(text, &scene, device)?);
            for seed in 1..9 {
                let shuffled = shuffled(text, &mut Numbers(seed));
                let other = told(&*planned(&shuffled, &scene, device)?);
                check(kept == other, || format!("{file} is another plan as\n{shuffled}\n{:?}", kept.symmetric_difference(&other).collect::<Vec<_>>()))?;
            }
        }
    }
    Ok(())
}

/// By what its shaders write, as naga tells, and its host steps.
fn nodes_change_what_they_say() -> Outcome {
    let scene = scene()?;
    for (file, _) in EMBEDDED {
        let pipeline = load(file, &[], REGISTRY, &mut |_| Err(io::ErrorKind::NotFound.into())).map_err(|problems| format!("{problems:?}"))?;
        let inputs: BTreeMap<&str, &[Edge]> = all(&pipeline.nodes).into_iter().map(|node| (&node.name[..], &node.inputs[..])).collect();
        for device in [Device::ABLE, Device { blends: false, ..Device::ABLE }, Device::SOFTWARE] {
            let needs = Needs::of(&scene);
            let setting = Setting { scene: &scene, needs: &needs, device, size: SIZE, tables: None };
            let Ok(plan) = plan(&pipeline, setting, &[], &kind) else { continue };
            for node in plan.schedule.nodes() {
                // A loop keeps what its last round left, and the end of a frame what that left.
                let own = format!("{}.", node.name);
                let kept = if node.name == "end of frame" { " frame before".to_owned() } else { format!(" round of {} before", node.name) };
                let edges = inputs.get(&node.name[..]).copied().unwrap_or_default();
                let may: BTreeSet<Resource> =
                    edges.iter().filter(|edge| edge.changes).filter_map(|edge| plan.ports.get(&edge.from.to_string())).flat_map(Port::resources).collect();
                for written in node.commands.iter().map(written).collect::<Result<Vec<_>, _>>()?.concat() {
                    let name = &plan.schedule.resource(written).name;
                    check(name.starts_with(&own) || name.contains(&kept) || may.contains(&written), || {
                        format!("{file}: {} changes {name} and does not say so", node.name)
                    })?;
                }
            }
        }
    }
    Ok(())
}

fn all(nodes: &[Node]) -> Vec<&Node> {
    nodes.iter().flat_map(|node| std::iter::once(node).chain(all(node.inner()))).collect()
}

fn written(command: &Command) -> Result<Vec<Resource>, Failed> {
    let mut written = match command {
        Command::Clear(to) | Command::Copy { to, .. } | Command::CopyToBuffer { to, .. } | Command::CopyLayer { to, .. } => vec![*to],
        Command::Raster(raster) => raster.colours.iter().map(|target| target.texture).chain(raster.depth.map(|depth| depth.texture)).collect(),
        Command::Host(host) | Command::Late(host) => host.writes.clone(),
        Command::Compute(_) => Vec::new(),
    };
    for compute in command.computes() {
        let uses = Shader::load(compute.program.shader, &compute.program.imports).map_err(|error| error.to_string())?.uses(compute.entry);
        let writes = |name: &str| uses.iter().any(|used| used.name == name && used.writes);
        written.extend(compute.program.bindings.iter().filter(|(name, _)| writes(name)).map(|(_, resource)| *resource));
    }
    Ok(written)
}

fn pictures_are_the_same(gpu: &Arc<Gpu>, text: &str) -> Outcome {
    let stage = Arc::new(Stage::new(scene()?));
    let scene = &stage.scene;
    let drawn = |text: &str| -> Result<Layers, Failed> {
        let plan = planned(text, scene, gpu.adapter.device())?;
        let told = |error: hemisplat::measure::run::RunError| error.to_string();
        let mut run = block_on(Run::new(gpu, &stage, &plan, &scene.cameras[0], SIZE)).map_err(told)?;
        block_on(run.frame(&|| Pace::GoOn)).map_err(told)?;
        Ok(block_on(run.picture()).map_err(told)?)
    };
    let kept = drawn(text)?;
    for seed in [3, 4] {
        let other = drawn(&shuffled(text, &mut Numbers(seed)))?;
        check(kept.layers.len() == other.layers.len(), || "it has other layers".into())?;
        for (name, layer) in &kept.layers {
            check(other.layers.get(name) == Some(layer), || format!("`{name}` is another, seed {seed}"))?;
        }
    }
    Ok(())
}

/// The weights of records that were there before the fill are nothing in the first frame, wherever the node stands that looks at them.
fn older_versions_come_first() -> Outcome {
    let scene = scene()?;
    let (_, text) = written_out().find(|(file, _)| *file == "irradiance.ron").ok_or("irradiance ships")?;
    let [late, light] =
        [r#"(name: "late", pass: Splat(records: "cache", gbuffer: "gbuffer")), "#, r#"(name: "light", pass: Normalize(splats: "late", gbuffer: "gbuffer")),"#];
    let outputs = text.replace("outputs: {", r#"outputs: { "early": "light.weight","#);
    for place in ["(name: \"gbuffer\"", "(name: \"fill\"", "(name: \"image\""] {
        let plan = planned(&outputs.replacen(place, &format!("{late}{light} {place}"), 1), &scene, Device::ABLE)?;
        let names: Vec<&str> = plan.schedule.steps.iter().map(hemisplat::schedule::Step::name).collect();
        let at = |name: &str| names.iter().position(|found| *found == name);
        check(at("late").is_some() && at("late") < at("fill"), || format!("{names:?}"))?;
    }
    let other = outputs.replace("(name: \"image\"", &format!("{}{light} (name: \"image\"", late.replace("gbuffer: \"gbuffer\"", "gbuffer: \"mine\"")));
    let other = other.replace("(name: \"image\"", r#"(name: "mine", pass: Classify(of: "gbuffer", which: Diffuse)), (name: "image""#);
    planned(&other, &scene, Device::ABLE).map(drop)
}

fn scene() -> Result<Scene, Failed> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-glossy.ron");
    Ok(scenes::load(&path, &scenes::LoadOptions::default()).map_err(|error| error.to_string())?)
}

fn planned(text: &str, scene: &Scene, device: Device) -> Result<Arc<Plan>, Failed> {
    let told = |problems: Problems| format!("{problems:?}");
    let pipeline = load("shuffled.ron", &[], REGISTRY, &mut |_| Ok(text.to_owned())).map_err(told)?;
    let needs = Needs::of(scene);
    let setting = Setting { scene, needs: &needs, device, size: SIZE, tables: None };
    Ok(plan(&pipeline, setting, &[], &kind).map_err(told)?)
}

/// All that a plan says but for the order of what does not depend on each other: each resource, and each node with its commands.
fn told(plan: &Plan) -> BTreeSet<String> {
    let text = plan.schedule.to_text(&plan.lifetimes, &plan.placement);
    let (resources, steps) = text.split_once("steps\n").unwrap_or((&text, ""));
    // Where memory lies and when it is used goes with the order.
    let resources = resources.lines().map(|line| line.split("  steps ").next().unwrap_or(line).to_owned());
    let mut nodes: Vec<String> = Vec::new();
    for line in steps.lines() {
        let line = line.trim_start();
        let numbered = line.split_once(' ').filter(|(number, _)| number.parse::<u32>().is_ok()).map(|(_, node)| node);
        match (numbered, nodes.last_mut()) {
            (None, Some(node)) if !line.starts_with("repeat") => *node += &format!("; {line}"),
            (numbered, _) => nodes.push(numbered.unwrap_or(line).to_owned()),
        }
    }
    resources.chain(nodes).chain(plan.resolved.iter().map(|(node, values)| format!("{node}: {values:?}"))).collect()
}

/// The same document with the nodes of each level in another order.
fn shuffled(text: &str, numbers: &mut Numbers) -> String {
    let Some(start) = text.find("nodes: [").map(|at| at + "nodes: [".len()) else { return text.to_owned() };
    let end = start + closing(&text[start..]);
    let mut items: Vec<String> = items(&text[start..end]).into_iter().map(|item| shuffled(item, numbers)).collect();
    for last in (1..items.len()).rev() {
        items.swap(last, numbers.next() as usize % (last + 1));
    }
    format!("{}{}{}", &text[..start], items.join(","), &text[end..])
}

/// Where the bracket that is open ends.
fn closing(text: &str) -> usize {
    let mut depth = 1;
    for (at, letter) in text.char_indices() {
        depth += match letter {
            '(' | '[' | '{' => 1,
            ')' | ']' | '}' => -1,
            _ => 0,
        };
        if depth == 0 {
            return at;
        }
    }
    text.len()
}

/// What commas part that stand in no bracket.
fn items(text: &str) -> Vec<&str> {
    let (mut items, mut depth, mut start) = (Vec::new(), 0, 0);
    for (at, letter) in text.char_indices() {
        match letter {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth -= 1,
            ',' if depth == 0 => {
                items.push(text[start..at].trim());
                start = at + 1;
            }
            _ => {}
        }
    }
    items.push(text[start..].trim());
    items.retain(|item| !item.is_empty());
    items
}

/// Numbers that are the same on every machine.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as u32
    }
}

fn check(holds: bool, what: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(what().into()) }
}
