//! `hemisplat explain`

use super::console::Console;
use super::failure::Failure;
use super::pipeline::{load_pipeline, note_idle, note_names, plan_view};
use super::scene::SceneOptions;
use crate::gpu::{expected_device, spirv};
use clap::Args;

/// Print the plan of a pipeline for a scene: what is dropped, sizes of shaders, resources, commands
#[derive(Args)]
#[command(after_help = "Example: hemisplat explain irradiance --scene cornell --set tiles.resolution=32

Needs no GPU.")]
pub struct Options {
    /// The pipeline: a file, or the name of one that ships
    pipeline: String,
    #[command(flatten)]
    scene: SceneOptions,
    /// Change a parameter of a node; may be repeated
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    sets: Vec<String>,
}

pub fn run(options: &Options, console: &Console) -> Result<(), Failure> {
    let pipeline = load_pipeline(&options.pipeline, &options.sets)?;
    note_names([&pipeline], console);
    let view = options.scene.load(console)?;
    let plan = plan_view(&pipeline, &view, expected_device(), &[]).map_err(Failure::input)?;
    note_idle(&plan, &options.sets, console);
    let sizes = spirv::sizes(&plan.schedule).map_err(Failure::work)?;
    console.print(&(plan.explain() + &spirv::to_text(&sizes)))
}
