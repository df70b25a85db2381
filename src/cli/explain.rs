//! `hemisplat explain`

use super::adapters::told;
use super::console::Console;
use super::failure::Failure;
use super::pipeline::{load_pipeline, note_idle, note_names, plan_view};
use super::scene::SceneOptions;
use crate::gpu::limits::{Most, hold};
use crate::gpu::{expected_adapter, expected_device, spirv};
use clap::Args;

/// Print what the adapter takes at most, then the plan of a pipeline for a scene: what is dropped, sizes of shaders, resources, commands
#[derive(Args)]
#[command(after_help = "Example: hemisplat explain irradiance --scene cornell --set tiles.resolution=32

Needs no GPU. Status 1 where the adapter cannot hold what the plan needs.")]
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
    let adapter = expected_adapter();
    let view = options.scene.load(console)?;
    let plan = plan_view(&pipeline, &view, expected_device(), &[], console).map_err(Failure::input)?;
    note_idle(&plan, &options.sets, console);
    let sizes = spirv::sizes(&plan.schedule).map_err(Failure::work)?;
    let limits = match adapter {
        Some(adapter) => format!("adapter {}: {}\n", adapter.name, told(Most::of(&adapter.limits))),
        None => format!("no adapter; every one of WebGPU: {}\n", told(Most::everywhere())),
    };
    console.print(&(limits + &plan.explain() + &spirv::to_text(&sizes)))?;
    let fits = adapter.map_or(Ok(()), |adapter| hold(&plan.schedule, &adapter.limits, adapter.features, &adapter.name));
    fits.map_err(Failure::work)
}
