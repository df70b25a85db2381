//! How large the shaders of a schedule are when a driver gets them. Needs no device.

use super::device::GpuError;
use super::shaders::shader_of;
use crate::schedule::{Command, Program, Schedule};
use naga::ShaderStage;
use naga::back::{PipelineConstants, pipeline_constants::process_overrides, spv};
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use std::collections::BTreeSet;
use std::fmt::Write;

/// An entry point, specialised.
#[derive(Debug, Clone, PartialEq)]
pub struct Size {
    /// The first node that runs it.
    pub node: String,
    pub shader: &'static str,
    pub entry: &'static str,
    /// Of its SPIR-V, after its constants are set and what it does not reach is dropped.
    pub bytes: u64,
}

/// Every entry point that a schedule runs, each specialisation once, in the order of their first use.
///
/// # Errors
/// A shader that is not valid, or a constant that it does not know.
pub fn sizes(schedule: &Schedule) -> Result<Vec<Size>, GpuError> {
    let mut seen = BTreeSet::new();
    let mut sizes = Vec::new();
    for node in schedule.nodes() {
        for (program, stage, entry) in node.commands.iter().flat_map(entries) {
            if seen.insert(program.specialisation(entry)) {
                sizes.push(Size { node: node.name.clone(), shader: program.shader, entry, bytes: bytes(program, stage, entry)? });
            }
        }
    }
    Ok(sizes)
}

/// The sum, then a line each.
pub fn to_text(sizes: &[Size]) -> String {
    let mut text = format!("shaders {} bytes of SPIR-V\n", sizes.iter().map(|size| size.bytes).sum::<u64>());
    for size in sizes {
        let _ = writeln!(text, "  {:<28} {:<34} {:>12} bytes", size.node, format!("{}:{}", size.shader, size.entry), size.bytes);
    }
    text
}

fn entries(command: &Command) -> Vec<(&Program, ShaderStage, &'static str)> {
    match command {
        Command::Raster(raster) => {
            let fragment = raster.fragment.map(|entry| (&raster.program, ShaderStage::Fragment, entry));
            std::iter::once((&raster.program, ShaderStage::Vertex, raster.vertex)).chain(fragment).collect()
        }
        _ => command.computes().iter().map(|compute| (&compute.program, ShaderStage::Compute, compute.entry)).collect(),
    }
}

fn bytes(program: &Program, stage: ShaderStage, entry: &str) -> Result<u64, GpuError> {
    let invalid = |reason: String| GpuError::Shader { shader: program.shader.into(), reason };
    let shader = shader_of(program)?;
    let constants: PipelineConstants = program.constants.iter().map(|(name, value)| (name.to_string(), *value)).collect();
    let (module, info) = process_overrides(&shader.module, &shader.info, Some((stage, entry)), &constants).map_err(|e| invalid(e.to_string()))?;
    let pipeline = spv::PipelineOptions { shader_stage: stage, entry_point: entry.into() };
    let words = spv::write_vec(&module, &info, &options(), Some(&pipeline)).map_err(|e| invalid(e.to_string()))?;
    Ok(size_of_val(&words[..]) as u64)
}

/// As wgpu sets them for Vulkan 1.3 where the device checks bounds of buffers and images; without names, whatever this program's build.
fn options() -> spv::Options<'static> {
    spv::Options {
        lang_version: (1, 6),
        flags: spv::WriterFlags::empty(),
        bounds_check_policies: BoundsCheckPolicies { index: BoundsCheckPolicy::Restrict, ..Default::default() },
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::Native,
        ..Default::default()
    }
}
