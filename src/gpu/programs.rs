//! Shader pipelines and bind groups of a session's commands.

use super::device::GpuError;
use super::execution::{Session, texture_format};
use super::shader::{Shader, Slot, SlotKind};
use crate::recording::*;
use std::collections::{BTreeMap, HashMap};

/// A command with everything that encoding it needs.
pub(super) enum Ready {
    Compute {
        pipeline: wgpu::ComputePipeline,
        groups: Vec<(u32, wgpu::BindGroup)>,
    },
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

/// Shaders that several commands share, by their text.
#[derive(Default)]
pub(super) struct Modules(HashMap<String, wgpu::ShaderModule>);

/// Pipelines that several commands share, by everything that makes them differ.
#[derive(Default)]
pub(super) struct Pipelines {
    compute: HashMap<String, wgpu::ComputePipeline>,
    raster: HashMap<String, wgpu::RenderPipeline>,
}

impl Session<'_> {
    pub(super) fn prepare(&self, command: &Command, modules: &mut Modules, pipelines: &mut Pipelines) -> Result<Ready, GpuError> {
        match command {
            Command::Clear(resource) => Ok(self.prepare_clear(*resource)),
            Command::Copy { .. } | Command::Host(_) => Ok(Ready::Plain),
            Command::Compute(compute) => self.prepare_compute(compute, modules, pipelines),
            Command::Raster(raster) => self.prepare_raster(raster, modules, pipelines),
        }
    }

    fn prepare_clear(&self, resource: Resource) -> Ready {
        match self.recording.resource(resource).kind {
            ResourceKind::Texture { format, .. } => Ready::Clear { layers: layer_views(self.texture(resource).0), format },
            _ => Ready::Plain,
        }
    }

    fn prepare_compute(&self, compute: &Compute, modules: &mut Modules, pipelines: &mut Pipelines) -> Result<Ready, GpuError> {
        let (module, slots) = self.module(&compute.program, &[compute.entry], modules)?;
        let layouts = self.layouts(&slots, wgpu::ShaderStages::COMPUTE);
        let key = compute.program.specialisation(compute.entry);
        let pipeline = pipelines.compute.entry(key).or_insert_with(|| {
            self.gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(compute.program.shader),
                layout: Some(&self.pipeline_layout(&layouts)),
                module: &module,
                entry_point: Some(compute.entry),
                compilation_options: options(&compute.program),
                cache: None,
            })
        });
        let groups = self.bind(&compute.program, &slots, &layouts)?;
        self.gpu.check(&format!("building the shader {}", compute.program.shader))?;
        Ok(Ready::Compute { pipeline: pipeline.clone(), groups })
    }

    fn prepare_raster(&self, raster: &Raster, modules: &mut Modules, pipelines: &mut Pipelines) -> Result<Ready, GpuError> {
        let entries: Vec<_> = [Some(raster.vertex), raster.fragment].into_iter().flatten().collect();
        let (module, slots) = self.module(&raster.program, &entries, modules)?;
        self.require_blending(raster)?;
        let layouts = self.layouts(&slots, wgpu::ShaderStages::VERTEX_FRAGMENT);
        let formats: Vec<_> = raster.colours.iter().map(|t| (self.texture(t.texture).1, t.blend)).collect();
        let key = format!(
            "{} {:?} {formats:?} {:?} {:?} {:?} {:?}",
            raster.program.specialisation(raster.vertex),
            raster.fragment,
            raster.vertices.is_some(),
            raster.depth.is_some(),
            raster.topology,
            raster.instances.is_some()
        );
        let pipeline = pipelines.raster.entry(key).or_insert_with(|| self.raster_pipeline(raster, &module, &layouts, &formats));
        let groups = self.bind(&raster.program, &slots, &layouts)?;
        let view = |texture: Resource, layer: u32| layer_view(self.texture(texture).0, layer);
        self.gpu.check(&format!("building the shader {}", raster.program.shader))?;
        Ok(Ready::Raster {
            pipeline: pipeline.clone(),
            groups,
            colours: raster.colours.iter().map(|t| view(t.texture, 0)).collect(),
            depth: raster.depth.map(|d| view(d.texture, d.layer)),
        })
    }

    fn require_blending(&self, raster: &Raster) -> Result<(), GpuError> {
        let blends = raster.colours.iter().any(|t| t.blend == Blend::Add && self.texture(t.texture).1 == Format::Rgba32Float);
        if blends && !self.gpu.features.contains(wgpu::Features::FLOAT32_BLENDABLE) {
            return Err(GpuError::MissingFeature {
                adapter: self.gpu.adapter.name.clone(),
                feature: "blending into 32-bit float images (FLOAT32_BLENDABLE)".into(),
                way: "splat in compute: --set splats.by=ComputeTiles".into(),
            });
        }
        Ok(())
    }

    fn raster_pipeline(&self, raster: &Raster, module: &wgpu::ShaderModule, layouts: &Layouts, formats: &[(Format, Blend)]) -> wgpu::RenderPipeline {
        let add = wgpu::BlendComponent { src_factor: wgpu::BlendFactor::One, dst_factor: wgpu::BlendFactor::One, operation: wgpu::BlendOperation::Add };
        let targets: Vec<_> = formats
            .iter()
            .map(|(format, blend)| {
                let blend = (*blend == Blend::Add).then_some(wgpu::BlendState { color: add, alpha: add });
                Some(wgpu::ColorTargetState { format: texture_format(*format), blend, write_mask: wgpu::ColorWrites::ALL })
            })
            .collect();
        let attributes = wgpu::vertex_attr_array![0 => Float32x3];
        let position = wgpu::VertexBufferLayout { array_stride: 12, step_mode: wgpu::VertexStepMode::Vertex, attributes: &attributes };
        let vectors = wgpu::vertex_attr_array![1 => Float32x4, 2 => Float32x4, 3 => Float32x4, 4 => Float32x4];
        let instance = wgpu::VertexBufferLayout { array_stride: 64, step_mode: wgpu::VertexStepMode::Instance, attributes: &vectors };
        let buffers = [raster.vertices.map(|_| position), raster.instances.map(|_| instance)];
        let used = buffers.iter().rposition(Option::is_some).map_or(0, |last| last + 1);
        let topology = match raster.topology {
            Topology::Triangles => wgpu::PrimitiveTopology::TriangleList,
            Topology::TriangleStrip => wgpu::PrimitiveTopology::TriangleStrip,
        };
        self.gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(raster.program.shader),
            layout: Some(&self.pipeline_layout(layouts)),
            vertex: wgpu::VertexState { module, entry_point: Some(raster.vertex), compilation_options: options(&raster.program), buffers: &buffers[..used] },
            primitive: wgpu::PrimitiveState { topology, ..Default::default() },
            depth_stencil: raster.depth.map(|_| wgpu::DepthStencilState {
                format: wgpu::TextureFormat::Depth32Float,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Greater),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment: raster.fragment.map(|entry| wgpu::FragmentState {
                module,
                entry_point: Some(entry),
                compilation_options: options(&raster.program),
                targets: &targets,
            }),
            multiview_mask: None,
            cache: None,
        })
    }

    fn module(&self, program: &Program, entries: &[&str], modules: &mut Modules) -> Result<(wgpu::ShaderModule, Vec<Slot>), GpuError> {
        let shader = Shader::load(program.shader, &program.imports)?;
        let slots = shader.slots(entries).map_err(|reason| GpuError::Shader { shader: program.shader.into(), reason })?;
        let module = modules.0.entry(shader.text.clone()).or_insert_with(|| {
            let source = wgpu::ShaderSource::Wgsl(shader.text.into());
            self.gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(program.shader), source })
        });
        Ok((module.clone(), slots))
    }

    fn layouts(&self, slots: &[Slot], visibility: wgpu::ShaderStages) -> Layouts {
        let mut entries: BTreeMap<u32, Vec<wgpu::BindGroupLayoutEntry>> = BTreeMap::new();
        for slot in slots {
            let entry = wgpu::BindGroupLayoutEntry { binding: slot.binding, visibility, ty: binding_type(slot.kind), count: None };
            entries.entry(slot.group).or_default().push(entry);
        }
        let make = |entries: &Vec<_>| self.gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries });
        Layouts(entries.iter().map(|(group, entries)| (*group, make(entries))).collect())
    }

    fn pipeline_layout(&self, layouts: &Layouts) -> wgpu::PipelineLayout {
        let last = layouts.0.keys().next_back().map_or(0, |g| g + 1);
        let groups: Vec<_> = (0..last).map(|g| layouts.0.get(&g)).collect();
        self.gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor { label: None, bind_group_layouts: &groups, immediate_size: 0 })
    }

    fn bind(&self, program: &Program, slots: &[Slot], layouts: &Layouts) -> Result<Vec<(u32, wgpu::BindGroup)>, GpuError> {
        let mut groups = Vec::new();
        for (group, layout) in &layouts.0 {
            let slots: Vec<_> = slots.iter().filter(|s| s.group == *group).collect();
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
                        None => self.buffer(*resource).as_entire_binding(),
                    },
                })
                .collect();
            groups.push((*group, self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(program.shader), layout, entries: &entries })));
        }
        Ok(groups)
    }

    /// The resource of a binding: listed by the program, or a part of the scene or the camera by its name.
    fn bound(&self, program: &Program, name: &str) -> Result<Resource, GpuError> {
        let listed = program.bindings.iter().find(|b| b.0 == name).map(|b| b.1);
        let shared = || self.recording.resources.iter().position(|r| r.name == name).map(|i| Resource(i as u32));
        listed.or_else(shared).ok_or_else(|| GpuError::Shader { shader: program.shader.into(), reason: format!("nothing is bound to {name}") })
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

/// Layouts by group.
struct Layouts(BTreeMap<u32, wgpu::BindGroupLayout>);

fn options(program: &Program) -> wgpu::PipelineCompilationOptions<'_> {
    wgpu::PipelineCompilationOptions { constants: &program.constants, ..Default::default() }
}

fn binding_type(kind: SlotKind) -> wgpu::BindingType {
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    match kind {
        SlotKind::Uniform => buffer(wgpu::BufferBindingType::Uniform),
        SlotKind::Storage { writable } => buffer(wgpu::BufferBindingType::Storage { read_only: !writable }),
        SlotKind::Texture { sample, dimension } => wgpu::BindingType::Texture { sample_type: sample, view_dimension: dimension, multisampled: false },
        SlotKind::StorageTexture { format, access, dimension } => wgpu::BindingType::StorageTexture { access, format, view_dimension: dimension },
    }
}
