//! `hemisplat check`

use super::console::Console;
use super::failure::Failure;
use super::pipeline::{check_pipeline, expect_exact, note_idle, note_names, plan_view};
use super::scene::{SceneOptions, View, ViewOptions};
use crate::gpu::expected_device;
use crate::pipeline::embedded::EMBEDDED;
use crate::pipeline::{Node, Pipeline, Problem, Problems};
use clap::Args;
use std::path::PathBuf;

/// Check pipelines; with a scene, also whether they can be planned for it
#[derive(Args)]
#[command(after_help = "Example: hemisplat check pipelines/*.ron --scene cornell

Without a pipeline, all that ship are checked. Needs no GPU. Status 2 if anything is wrong.")]
pub struct Options {
    /// Pipelines: files, or names of those that ship
    #[arg(value_name = "PIPELINE")]
    pipelines: Vec<String>,
    /// Change a parameter of a node in all of them; may be repeated
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    sets: Vec<String>,
    /// A scene to plan them for: a file .gltf, .glb, .obj, .ply or .ron, or the name of one that ships
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    view: ViewOptions,
    /// Refuse a pipeline that would show the scene otherwise than it is, such as glossy materials as diffuse
    #[arg(long, requires = "scene")]
    strict: bool,
}

pub fn run(options: &Options, console: &Console) -> Result<(), Failure> {
    let scene = options.scene.as_ref().map(|scene| SceneOptions::new(scene.clone(), options.view.clone()));
    let view = scene.map(|scene| scene.load(console)).transpose()?;
    let shipped = || EMBEDDED.iter().map(|(file, _)| format!("pipelines/{file}")).collect();
    let names: Vec<String> = if options.pipelines.is_empty() { shipped() } else { options.pipelines.clone() };
    let mut problems = Vec::new();
    for name in &names {
        match check(name, options, view.as_ref(), console) {
            Ok(summary) => console.print(&format!("{name}: {summary}\n"))?,
            Err(found) => problems.extend(found.0),
        }
    }
    if problems.is_empty() { Ok(()) } else { Err(Failure::input(Problems(unique(problems)))) }
}

fn check(name: &str, options: &Options, view: Option<&View>, console: &Console) -> Result<String, Problems> {
    let pipeline = check_pipeline(name, &options.sets)?;
    note_names([&pipeline], console);
    let Some(view) = view else { return Ok(summary(&pipeline)) };
    let plan = plan_view(&pipeline, view, expected_device(), &[], console)?;
    note_idle(&plan, &options.sets, console);
    if options.strict {
        expect_exact(&plan)?;
    }
    let dropped: Vec<String> = plan.dropped.iter().map(|dropped| format!(", drops {}: {}", dropped.node, dropped.because)).collect();
    let approximated: Vec<String> = plan.approximated().into_iter().map(|what| format!("; {what}")).collect();
    Ok(format!("{}{}{}", summary(&pipeline), dropped.concat(), approximated.concat()))
}

fn summary(pipeline: &Pipeline) -> String {
    format!("{} nodes, {} outputs", count(&pipeline.nodes), pipeline.outputs.len())
}

fn count(nodes: &[Node]) -> usize {
    nodes.iter().map(|node| 1 + count(node.inner())).sum()
}

/// Variants of one pipeline share its errors: each is told once.
pub(super) fn unique(problems: Vec<Problem>) -> Vec<Problem> {
    let mut kept: Vec<Problem> = Vec::new();
    for problem in problems {
        if !kept.iter().any(|other| other.same(&problem)) {
            kept.push(problem);
        }
    }
    kept
}
