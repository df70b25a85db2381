//! `hemisplat adapters`

use super::console::Console;
use super::failure::Failure;
use crate::gpu::{GpuError, device};
use clap::Args;

/// List the GPU adapters, the one that would be used first
#[derive(Args)]
#[command(after_help = "Example: hemisplat adapters --quiet

The environment variable WGPU_ADAPTER_NAME picks another by a part of its name. Status 1 where none is usable.")]
pub struct Options {}

pub fn run(_: &Options, console: &Console) -> Result<(), Failure> {
    let adapters = device::adapters();
    let mut text = String::new();
    for adapter in &adapters {
        let lacks = if adapter.lacks.is_empty() { "usable".into() } else { format!("lacks {}", adapter.lacks.join(", ")) };
        text += &format!("{} ({}, {}, {}): {lacks}\n", adapter.name, adapter.kind, adapter.backend, adapter.driver);
    }
    console.print(&text)?;
    if adapters.iter().any(|a| a.lacks.is_empty()) { Ok(()) } else { Err(Failure::work(GpuError::NoAdapter)) }
}
