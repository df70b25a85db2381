//! `hemisplat adapters`

use super::console::Console;
use super::failure::Failure;
use crate::gpu::limits::Most;
use crate::gpu::{GpuError, block_on, device};
use crate::passes::record::RECORD_BYTES;
use clap::Args;

/// Bytes of a colour in a buffer.
const COLOUR_BYTES: u64 = 16;

/// List the GPU adapters, the one that would be used first
#[derive(Args)]
#[command(after_help = "Example: hemisplat adapters --quiet

The environment variable WGPU_ADAPTER_NAME picks another by a part of its name. Status 1 where none is usable.")]
pub struct Options {}

pub fn run(_: &Options, console: &Console) -> Result<(), Failure> {
    let adapters = block_on(device::adapters());
    let mut text = String::new();
    for adapter in &adapters {
        let lacks = if adapter.lacks.is_empty() { "usable".into() } else { format!("lacks {}", adapter.lacks.join(", ")) };
        text += &format!("{} ({}, {}, {}): {lacks}; {}\n", adapter.name, adapter.kind, adapter.backend, adapter.driver, told(Most::of(&adapter.limits)));
    }
    console.print(&text)?;
    if adapters.iter().any(|a| a.lacks.is_empty()) { Ok(()) } else { Err(Failure::work(GpuError::NoAdapter)) }
}

/// What an adapter takes at most, in words.
pub(super) fn told(most: Most) -> String {
    let Most { triangles, shaded_triangles, side, bytes } = most;
    format!(
        "at most {triangles} triangles ({shaded_triangles} where shaders read their attributes), pictures of {side}×{side} pixels ({} pixels where a buffer \
         holds a colour of each), {} records in a cache",
        bytes / COLOUR_BYTES,
        bytes / RECORD_BYTES
    )
}
