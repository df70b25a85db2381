//! What a schedule asks of an adapter, held against what the adapter grants before anything is built.

use super::device::GpuError;
use super::pipelines::formats;
use super::scene::{ATTRIBUTES_BYTES, CORNERS_BYTES};
use super::shader::{Slot, SlotKind};
use super::shaders::Shaders;
use crate::scene::{MAX_SIDE, Scene, load::MAX_TRIANGLES};
use crate::schedule::*;

/// Holds a schedule against the limits and features of an adapter; `wgpu::Limits::default()` is what every adapter of WebGPU grants.
///
/// # Errors
/// The first thing that is too large or too many, with the node that asks for it; a shader that is not valid.
pub fn hold(schedule: &Schedule, limits: &wgpu::Limits, features: wgpu::Features, adapter: &str) -> Result<(), GpuError> {
    hold_shaders(schedule, &Shaders::load(schedule)?, &Granted { limits, features, adapter })
}

/// What can be told of an adapter's limits before anything is loaded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Most {
    /// Triangles of any scene: each pipeline reads their corners.
    pub triangles: u64,
    /// Where shaders read attributes, too: normals, textures, colours of vertices.
    pub shaded_triangles: u64,
    /// Of a picture [pixels].
    pub side: u32,
    /// Of a buffer that a shader reads.
    pub bytes: u64,
}

impl Most {
    pub fn of(limits: &wgpu::Limits) -> Self {
        let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let triangles = |each: u64| (bytes / each).min(MAX_TRIANGLES as u64);
        let side = limits.max_texture_dimension_2d.min(MAX_SIDE);
        Self { triangles: triangles(CORNERS_BYTES), shaded_triangles: triangles(ATTRIBUTES_BYTES), side, bytes }
    }

    /// What every adapter of WebGPU takes.
    pub fn everywhere() -> Self {
        Self::of(&wgpu::Limits::default())
    }

    /// Refuses a scene that no pipeline can have on the adapter.
    ///
    /// # Errors
    /// Where it has too many triangles.
    pub fn hold(&self, scene: &Scene) -> Result<(), GpuError> {
        within(&scene.name, scene.triangles.len() as u64, self.triangles, "triangles")
    }
}

/// What an adapter grants.
pub(super) struct Granted<'a> {
    pub limits: &'a wgpu::Limits,
    pub features: wgpu::Features,
    /// Its name.
    pub adapter: &'a str,
}

/// The same with the schedule's shaders at hand.
pub(super) fn hold_shaders<'r>(schedule: &'r Schedule, shaders: &'r Shaders, granted: &Granted<'_>) -> Result<(), GpuError> {
    schedule.resources.iter().try_for_each(|resource| hold_resource(resource, granted.limits))?;
    for node in schedule.nodes() {
        for command in &node.commands {
            let asked = |program: &'r Program| Asked { schedule, name: format!("{}: {}", node.name, program.shader), program, shaders };
            command.computes().iter().try_for_each(|compute| asked(&compute.program).hold_compute(compute, granted.limits))?;
            if let Command::Raster(raster) = command {
                asked(&raster.program).hold_raster(raster, granted)?;
            }
        }
    }
    Ok(())
}

fn within(what: &str, wanted: u64, limit: impl Into<u64>, unit: &'static str) -> Result<(), GpuError> {
    let limit = limit.into();
    if wanted <= limit { Ok(()) } else { Err(GpuError::Limit { what: what.into(), unit, wanted, limit }) }
}

fn hold_resource(resource: &ResourceDescription, limits: &wgpu::Limits) -> Result<(), GpuError> {
    match resource.kind {
        ResourceKind::Buffer { bytes } => within(&resource.name, bytes, limits.max_buffer_size, "bytes"),
        ResourceKind::Texture { size: [width, height], layers, .. } => {
            within(&resource.name, width.max(height).into(), limits.max_texture_dimension_2d, "texels along an edge")?;
            within(&resource.name, layers.into(), limits.max_texture_array_layers, "layers")
        }
        ResourceKind::Draws | ResourceKind::State => Ok(()),
    }
}

/// A command's shader, and what is bound to it.
struct Asked<'a> {
    schedule: &'a Schedule,
    /// Node and shader, for messages.
    name: String,
    program: &'a Program,
    shaders: &'a Shaders,
}

impl Asked<'_> {
    fn hold_compute(&self, compute: &Compute, limits: &wgpu::Limits) -> Result<(), GpuError> {
        self.hold_slots(&[compute.entry], limits)?;
        let Some(group) = self.shaders.of(self.program).workgroup(compute.entry) else { return Ok(()) };
        let most = [limits.max_compute_workgroup_size_x, limits.max_compute_workgroup_size_y, limits.max_compute_workgroup_size_z];
        group.size.iter().zip(most).try_for_each(|(&size, most)| within(&self.name, size.into(), most, "invocations along an edge of a workgroup"))?;
        within(&self.name, group.size.iter().map(|&size| u64::from(size)).product(), limits.max_compute_invocations_per_workgroup, "invocations a workgroup")?;
        within(&self.name, group.bytes, limits.max_compute_workgroup_storage_size, "bytes that a workgroup shares")?;
        match compute.groups {
            Groups::Fixed(groups) => within(
                &self.name,
                groups.into_iter().max().unwrap_or(0).into(),
                limits.max_compute_workgroups_per_dimension,
                "workgroups along an edge of a dispatch",
            ),
            Groups::Counted { .. } => Ok(()),
        }
    }

    fn hold_raster(&self, raster: &Raster, granted: &Granted<'_>) -> Result<(), GpuError> {
        self.hold_slots(&raster.entries(), granted.limits)?;
        let (mut count, mut bytes) = (0, 0);
        for (format, blend) in formats(self.schedule, raster) {
            (count, bytes) = (count + 1, bytes + format.bytes());
            if (format, blend) == (Format::Rgba32Float, Blend::Add) && !granted.features.contains(wgpu::Features::FLOAT32_BLENDABLE) {
                return Err(self.lacks_blending(granted.adapter));
            }
        }
        within(&self.name, count, granted.limits.max_color_attachments, "colour attachments")?;
        within(&self.name, bytes, granted.limits.max_color_attachment_bytes_per_sample, "bytes a sample of its colour attachments")
    }

    fn lacks_blending(&self, adapter: &str) -> GpuError {
        GpuError::MissingFeature {
            adapter: adapter.into(),
            feature: format!("blending into 32-bit float images (FLOAT32_BLENDABLE), which `{}` needs", self.name),
            way: "splat in compute: --set splats.by=ComputeTiles".into(),
        }
    }

    /// A binding counts in every stage of the command.
    fn hold_slots(&self, entries: &[&str], limits: &wgpu::Limits) -> Result<(), GpuError> {
        let slots = self.shaders.slots(self.program, entries)?;
        let count = |kind: fn(SlotKind) -> bool| slots.iter().filter(|slot| kind(slot.kind)).count() as u64;
        let counts = [
            (count(|kind| matches!(kind, SlotKind::Storage { .. })), limits.max_storage_buffers_per_shader_stage, "storage buffers"),
            (count(|kind| matches!(kind, SlotKind::Uniform)), limits.max_uniform_buffers_per_shader_stage, "uniform buffers"),
            (count(|kind| matches!(kind, SlotKind::Texture { .. })), limits.max_sampled_textures_per_shader_stage, "textures"),
            (count(|kind| matches!(kind, SlotKind::StorageTexture { .. })), limits.max_storage_textures_per_shader_stage, "storage textures"),
        ];
        counts.into_iter().try_for_each(|(wanted, limit, unit)| within(&self.name, wanted, limit, unit))?;
        slots.iter().try_for_each(|slot| self.hold_binding(slot, limits))
    }

    fn hold_binding(&self, slot: &Slot, limits: &wgpu::Limits) -> Result<(), GpuError> {
        let limit = match slot.kind {
            SlotKind::Storage { .. } => limits.max_storage_buffer_binding_size,
            SlotKind::Uniform => limits.max_uniform_buffer_binding_size,
            SlotKind::Texture { .. } | SlotKind::StorageTexture { .. } => return Ok(()),
        };
        let Some(resource) = self.schedule.bound(self.program, &slot.name) else { return Ok(()) };
        let resource = self.schedule.resource(resource);
        within(&format!("{}, which {} binds", resource.name, self.name), resource.kind.bytes(), limit, "bytes")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::load::load_text;

    #[test]
    fn what_is_told_is_what_fits() {
        let most = Most::everywhere();
        assert_eq!((most.triangles, most.shaded_triangles, most.side), (2_796_202, 2_097_152, 8192));
        let text = "Scene(version: 1, geometry: [Box(min: (0, 0, 0), max: (1, 1, 1))], materials: {\"*\": Diffuse(reflectance: (0.5, 0.5, 0.5))})";
        let scene = load_text("box.ron", text).unwrap();
        let granted = |triangles: u64| {
            let bytes = CORNERS_BYTES * triangles;
            Most::of(&wgpu::Limits { max_storage_buffer_binding_size: bytes, max_buffer_size: bytes, ..Default::default() })
        };
        assert!(granted(12).hold(&scene).is_ok());
        let told = granted(11).hold(&scene).unwrap_err().to_string();
        assert_eq!(told, "`box` needs 12 triangles; the adapter's limit is 11");
        // No adapter takes more than loaders do.
        assert_eq!(granted(1 << 40).triangles, MAX_TRIANGLES as u64);
    }
}
