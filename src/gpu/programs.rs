//! A session's commands, ready to be encoded: their pipelines and bind groups.

use super::device::GpuError;
use super::pipelines::{Built, Pipelines};
use super::session::Session;
use super::shader::{Slot, SlotKind};
use super::shaders::Shaders;
use crate::schedule::*;
use std::num::NonZeroU64;

/// A command with everything that encoding it needs.
pub(super) enum Ready {
    /// One, or those that do what a host step does.
    Compute(Vec<Dispatch>),
    Raster {
        pipeline: wgpu::RenderPipeline,
        groups: Vec<(u32, wgpu::BindGroup)>,
        colours: Vec<wgpu::TextureView>,
        depth: Option<wgpu::TextureView>,
    },
    /// The layers of a texture to clear.
    Clear {
        layers: Vec<wgpu::TextureView>,
        format: Format,
    },
    /// Nothing to prepare.
    Plain,
}

/// A dispatch but for its size.
pub(super) struct Dispatch {
    pub pipeline: wgpu::ComputePipeline,
    pub groups: Vec<(u32, wgpu::BindGroup)>,
}

impl Dispatch {
    /// A pass that has all but the number of workgroups.
    pub fn begin<'e>(&self, encoder: &'e mut wgpu::CommandEncoder) -> wgpu::ComputePass<'e> {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&self.pipeline);
        self.groups.iter().for_each(|(group, bound)| pass.set_bind_group(*group, bound, &[]));
        pass
    }
}

impl Session {
    /// The commands of a schedule, each with its shader built and what it touches bound, by node.
    pub(super) fn prepare_all(&self, shaders: &Shaders) -> Result<Vec<Vec<Ready>>, GpuError> {
        let pipelines = Pipelines::build(&self.gpu, &self.schedule, shaders)?;
        let nodes = self.schedule.nodes();
        let ready = nodes.iter().map(|node| node.commands.iter().map(|command| self.prepare(command, &pipelines)).collect()).collect();
        self.gpu.check("binding what shaders touch")?;
        ready
    }

    fn prepare(&self, command: &Command, pipelines: &Pipelines) -> Result<Ready, GpuError> {
        match command {
            Command::Clear(resource) => Ok(self.prepare_clear(*resource)),
            Command::Copy { .. } | Command::CopyToBuffer { .. } | Command::CopyLayer { .. } | Command::Late(_) => Ok(Ready::Plain),
            Command::Compute(_) | Command::Host(_) => {
                command.computes().iter().map(|compute| self.prepare_dispatch(compute, pipelines)).collect::<Result<_, _>>().map(Ready::Compute)
            }
            Command::Raster(raster) => {
                let built = pipelines.of_raster(&self.schedule, raster);
                let view = |texture: Resource, layer: u32| layer_view(self.texture(texture).0, layer);
                Ok(Ready::Raster {
                    pipeline: built.pipeline.clone(),
                    groups: self.bind(&raster.program, built)?,
                    colours: raster.colours.iter().map(|t| view(t.texture, 0)).collect(),
                    depth: raster.depth.map(|d| view(d.texture, d.layer)),
                })
            }
        }
    }

    fn prepare_dispatch(&self, compute: &Compute, pipelines: &Pipelines) -> Result<Dispatch, GpuError> {
        let built = pipelines.of_compute(compute);
        Ok(Dispatch { pipeline: built.pipeline.clone(), groups: self.bind(&compute.program, built)? })
    }

    fn prepare_clear(&self, resource: Resource) -> Ready {
        match self.schedule.resource(resource).kind {
            ResourceKind::Texture { format, .. } => Ready::Clear { layers: layer_views(self.texture(resource).0), format },
            _ => Ready::Plain,
        }
    }

    fn bind<P>(&self, program: &Program, built: &Built<P>) -> Result<Vec<(u32, wgpu::BindGroup)>, GpuError> {
        let mut groups = Vec::new();
        for (group, layout) in &built.layouts {
            let slots: Vec<_> = built.slots.iter().filter(|s| s.group == *group).collect();
            let resources = slots.iter().map(|s| self.bound(program, &s.name)).collect::<Result<Vec<_>, _>>()?;
            let views: Vec<_> = slots.iter().zip(&resources).map(|(slot, resource)| self.view(slot, *resource)).collect();
            let entries: Vec<_> = slots
                .iter()
                .zip(&resources)
                .zip(&views)
                .map(|((slot, resource), view)| wgpu::BindGroupEntry {
                    binding: slot.binding,
                    resource: match view {
                        Some(view) => wgpu::BindingResource::TextureView(view),
                        None => wgpu::BindingResource::Buffer(self.part(*resource)),
                    },
                })
                .collect();
            groups.push((*group, self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(program.shader), layout, entries: &entries })));
        }
        Ok(groups)
    }

    /// A buffer as far as it is the resource's: memory that it shares may be larger than a uniform can be.
    fn part(&self, resource: Resource) -> wgpu::BufferBinding<'_> {
        let buffer = self.buffer(resource);
        let description = self.schedule.resource(resource);
        let size = matches!(description.lifetime, Lifetime::Transient).then(|| NonZeroU64::new(description.kind.bytes())).flatten();
        wgpu::BufferBinding { buffer, offset: 0, size }
    }

    fn bound(&self, program: &Program, name: &str) -> Result<Resource, GpuError> {
        self.schedule.bound(program, name).ok_or_else(|| GpuError::Shader { shader: program.shader.into(), reason: format!("nothing is bound to {name}") })
    }

    fn view(&self, slot: &Slot, resource: Resource) -> Option<wgpu::TextureView> {
        let dimension = match slot.kind {
            SlotKind::Texture { dimension, .. } | SlotKind::StorageTexture { dimension, .. } => dimension,
            SlotKind::Uniform | SlotKind::Storage { .. } => return None,
        };
        Some(self.texture(resource).0.create_view(&wgpu::TextureViewDescriptor { dimension: Some(dimension), ..Default::default() }))
    }
}

pub(super) fn layer_views(texture: &wgpu::Texture) -> Vec<wgpu::TextureView> {
    (0..texture.depth_or_array_layers()).map(|layer| layer_view(texture, layer)).collect()
}

fn layer_view(texture: &wgpu::Texture, layer: u32) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2),
        base_array_layer: layer,
        array_layer_count: Some(1),
        ..Default::default()
    })
}
