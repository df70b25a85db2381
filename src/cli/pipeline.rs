//! What the commands that take a pipeline share.

use super::console::Console;
use super::failure::Failure;
use super::input::read_file;
use super::lookups::Lookups;
use super::scene::View;
use super::stored::Stored;
use super::truth::cache_folder;
use crate::contract::encoder::Setting;
use crate::gpu::scene::kinds;
use crate::math::bounces::Bounces;
use crate::passes::REGISTRY;
use crate::pipeline::syntax::Place;
use crate::pipeline::{Pipeline, Plan, Problem, Problems, Set, load, load_with, plan};
use crate::scene::stage::Stage;
use crate::schedule::Device;
use std::collections::BTreeSet;
use std::io;
use std::path::Path;
use std::sync::Arc;

/// The longest pipeline file that is read.
const MOST_PIPELINE_BYTES: u64 = 16 << 20;

/// Reads and checks a pipeline: a path, or one that ships; `sets` are `NODE.PARAM=VALUE`.
pub fn load_pipeline(name: &str, sets: &[String]) -> Result<Pipeline, Failure> {
    check_pipeline(name, sets).map_err(Failure::input)
}

/// The same; every file that is looked for is noted.
pub fn load_noting(name: &str, sets: &[String], lookups: &Lookups) -> Result<Pipeline, Failure> {
    let mut read = |path: &Path| {
        lookups.note(path);
        read_pipeline(path)
    };
    load(name, sets, REGISTRY, &mut read).map_err(Failure::input)
}

/// The same, for those who collect problems.
pub fn check_pipeline(name: &str, sets: &[String]) -> Result<Pipeline, Problems> {
    load(name, sets, REGISTRY, &mut read_pipeline)
}

/// The same with what is set already read; `place` is where the pipeline is named.
pub fn check_with(name: &str, place: Option<&Place>, sets: &[Set]) -> Result<Pipeline, Problems> {
    let placed = |problem: Problem| place.map_or(problem.clone(), |place| problem.or_at(place, "named here"));
    load_with(name, sets, REGISTRY, &mut read_pipeline).map_err(|problems| Problems(problems.0.into_iter().map(placed).collect()))
}

fn read_pipeline(path: &Path) -> io::Result<String> {
    let bytes = read_file(path, MOST_PIPELINE_BYTES)?;
    String::from_utf8(bytes).map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is no text in UTF-8"))
}

/// The bounces of the truth that a plan's pictures are held against: what has no records lacks the first bounce.
pub fn judged_bounces(plan: &Plan) -> Bounces {
    plan.bounces.max(Bounces::Count(1))
}

/// Says what whoever named these pipelines should know.
pub fn note_names<'p>(pipelines: impl IntoIterator<Item = &'p Pipeline>, console: &Console) {
    let notes: BTreeSet<&String> = pipelines.into_iter().flat_map(|pipeline| &pipeline.notes).collect();
    notes.into_iter().for_each(|note| console.note(&format!("note: {note}")));
}

/// Says what a plan shows otherwise than the scene has it.
pub fn note_approximations(plan: &Plan, console: &Console) {
    plan.approximated().iter().for_each(|what| console.note(&format!("note: {what}")));
}

/// Says which of the parameters that were set, `NODE.PARAM=VALUE`, change nothing.
pub fn note_idle(plan: &Plan, sets: &[String], console: &Console) {
    let keys: BTreeSet<&str> = sets.iter().filter_map(|set| Some(set.split_once('=')?.0.trim())).collect();
    for (key, because) in keys.into_iter().filter_map(|key| Some((key, plan.why_idle(key)?))) {
        console.note(&format!("note: {key} has no effect here, as {because}"));
    }
}

/// Refuses a plan that shows something otherwise than the scene has it.
pub fn expect_exact(plan: &Plan) -> Result<(), Problems> {
    let problem = |what| Problem::new("plan::glossy", what).help("use a pipeline for glossy light, such as radiance, or leave --strict away");
    let problems: Vec<Problem> = plan.approximated().into_iter().map(problem).collect();
    if problems.is_empty() { Ok(()) } else { Err(Problems(problems)) }
}

/// Plans a pipeline for a view of a scene and a device; `dumps` stay whole after the frame.
pub fn plan_view(pipeline: &Pipeline, view: &View, device: Device, dumps: &[String], console: &Console) -> Result<Arc<Plan>, Problems> {
    plan_stage(pipeline, &view.stage, view.size, device, dumps, console)
}

/// The same of a scene as it is now.
pub fn plan_stage(pipeline: &Pipeline, stage: &Stage, size: [u32; 2], device: Device, dumps: &[String], console: &Console) -> Result<Arc<Plan>, Problems> {
    let stored = Stored::new(cache_folder(), console);
    let setting = Setting { scene: &stage.scene, needs: stage.needs(), device, size, tables: Some(&stored) };
    plan(pipeline, setting, dumps, &kinds(stage))
}
