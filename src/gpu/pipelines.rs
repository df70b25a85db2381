//! Shader pipelines of a schedule: what its commands run, before anything is bound.

use super::cores;
use super::device::{Gpu, GpuError};
use super::memory::texture_format;
use super::shader::{Slot, SlotKind, may_change};
use super::shaders::{Shaders, Source, source};
use crate::schedule::*;
use lru::LruCache;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, PoisonError};

/// Every pipeline of a schedule, once, by everything that makes it differ from others.
pub(super) struct Pipelines {
    compute: HashMap<String, Arc<Built<wgpu::ComputePipeline>>>,
    raster: HashMap<String, Arc<Built<wgpu::RenderPipeline>>>,
}

/// Pipelines of earlier schedules on a device: drivers take long over large shaders, and a plan that is made anew for a change of the scene has most of them.
pub(super) struct Earlier {
    compute: Mutex<LruCache<String, Arc<Built<wgpu::ComputePipeline>>>>,
    raster: Mutex<LruCache<String, Arc<Built<wgpu::RenderPipeline>>>>,
}

/// How many of each kind are kept: more than the largest schedule has.
const KEPT: NonZeroUsize = NonZeroUsize::new(128).unwrap();

impl Default for Earlier {
    fn default() -> Self {
        Self { compute: Mutex::new(LruCache::new(KEPT)), raster: Mutex::new(LruCache::new(KEPT)) }
    }
}

/// A pipeline and what it wants to be bound.
pub(super) struct Built<P> {
    pub pipeline: P,
    pub slots: Vec<Slot>,
    /// By group.
    pub layouts: BTreeMap<u32, wgpu::BindGroupLayout>,
}

/// What the driver has of the shaders, which pipelines share.
type Modules = BTreeMap<Source, wgpu::ShaderModule>;

/// What a driver does that refuses a shader.
const BUILDING: &str = "building the shaders";

impl Pipelines {
    /// Builds on all cores what no earlier schedule has left.
    ///
    /// # Errors
    /// A shader that the driver refuses.
    pub fn build(gpu: &Gpu, schedule: &Schedule, shaders: &Shaders) -> Result<Self, GpuError> {
        let (mut computes, mut rasters) = (BTreeMap::new(), BTreeMap::new());
        for command in schedule.nodes().into_iter().flat_map(|node| &node.commands) {
            computes.extend(command.computes().iter().map(|compute| (key_of_compute(compute), compute)));
            if let Command::Raster(raster) = command {
                rasters.insert(key_of_raster(schedule, raster), raster);
            }
        }
        let (compute, raster) = (take(&gpu.earlier.compute, &mut computes), take(&gpu.earlier.raster, &mut rasters));
        let programs = computes.values().map(|compute| &compute.program).chain(rasters.values().map(|raster| &raster.program));
        let sources: BTreeSet<Source> = programs.map(source).collect();
        let modules = cores::each(gpu, BUILDING, sources, |source| {
            let module = module(gpu, source.0, &shaders.all()[&source].text);
            Ok((source, module))
        })?;
        let builder = Builder { gpu, shaders, modules };
        let (new_compute, new_raster) = cores::join(
            || cores::each(gpu, BUILDING, computes, |(key, compute)| Ok((key, Arc::new(builder.compute(compute)?)))),
            || cores::each(gpu, BUILDING, rasters, |(key, raster)| Ok((key, Arc::new(builder.raster(raster, &formats(schedule, raster))?)))),
        );
        let (new_compute, new_raster): (Vec<_>, Vec<_>) = (new_compute?, new_raster?);
        gpu.check(BUILDING)?;
        keep(&gpu.earlier.compute, &new_compute);
        keep(&gpu.earlier.raster, &new_raster);
        Ok(Self { compute: compute.into_iter().chain(new_compute).collect(), raster: raster.into_iter().chain(new_raster).collect() })
    }

    pub fn of_compute(&self, compute: &Compute) -> &Built<wgpu::ComputePipeline> {
        &self.compute[&key_of_compute(compute)]
    }

    pub fn of_raster(&self, schedule: &Schedule, raster: &Raster) -> &Built<wgpu::RenderPipeline> {
        &self.raster[&key_of_raster(schedule, raster)]
    }
}

/// Takes those of the wanted that there are.
fn take<P, C>(earlier: &Mutex<LruCache<String, Arc<Built<P>>>>, wanted: &mut BTreeMap<String, C>) -> Vec<(String, Arc<Built<P>>)> {
    if may_change() {
        return Vec::new();
    }
    let mut earlier = earlier.lock().unwrap_or_else(PoisonError::into_inner);
    let found: Vec<_> = wanted.keys().filter_map(|key| earlier.get(key).map(|built| (key.clone(), built.clone()))).collect();
    found.iter().for_each(|(key, _)| drop(wanted.remove(key)));
    found
}

fn keep<P>(earlier: &Mutex<LruCache<String, Arc<Built<P>>>>, new: &[(String, Arc<Built<P>>)]) {
    let mut earlier = earlier.lock().unwrap_or_else(PoisonError::into_inner);
    new.iter().for_each(|(key, built)| drop(earlier.put(key.clone(), built.clone())));
}

fn key_of_compute(compute: &Compute) -> String {
    compute.program.specialisation(compute.entry)
}

fn key_of_raster(schedule: &Schedule, raster: &Raster) -> String {
    let formats = formats(schedule, raster);
    let slots = [raster.depth.is_some(), raster.vertices.is_some(), raster.instances.is_some()];
    format!("{} {:?} {formats:?} {slots:?} {:?}", raster.program.specialisation(raster.vertex), raster.fragment, raster.topology)
}

/// Of the images that a command draws into, and how it does.
pub(super) fn formats(schedule: &Schedule, raster: &Raster) -> Vec<(Format, Blend)> {
    let format = |target: &Target| match schedule.resource(target.texture).kind {
        ResourceKind::Texture { format, .. } => Some((format, target.blend)),
        _ => None,
    };
    raster.colours.iter().filter_map(format).collect()
}

fn module(gpu: &Gpu, name: &str, text: &str) -> wgpu::ShaderModule {
    gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(name), source: wgpu::ShaderSource::Wgsl(text.into()) })
}

/// What building needs.
struct Builder<'a> {
    gpu: &'a Gpu,
    shaders: &'a Shaders,
    modules: Modules,
}

impl Builder<'_> {
    fn compute(&self, compute: &Compute) -> Result<Built<wgpu::ComputePipeline>, GpuError> {
        let program = &compute.program;
        let (gpu, module) = (self.gpu, &self.modules[&source(program)]);
        let slots = self.shaders.slots(program, &[compute.entry])?;
        let layouts = layouts(gpu, &slots, wgpu::ShaderStages::COMPUTE);
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(program.shader),
            layout: Some(&pipeline_layout(gpu, &layouts)),
            module,
            entry_point: Some(compute.entry),
            compilation_options: options(program),
            cache: None,
        });
        Ok(Built { pipeline, slots, layouts })
    }

    fn raster(&self, raster: &Raster, formats: &[(Format, Blend)]) -> Result<Built<wgpu::RenderPipeline>, GpuError> {
        let program = &raster.program;
        let (gpu, module) = (self.gpu, &self.modules[&source(program)]);
        let slots = self.shaders.slots(program, &raster.entries())?;
        let layouts = layouts(gpu, &slots, wgpu::ShaderStages::VERTEX_FRAGMENT);
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
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(program.shader),
            layout: Some(&pipeline_layout(gpu, &layouts)),
            vertex: wgpu::VertexState { module, entry_point: Some(raster.vertex), compilation_options: options(program), buffers: &buffers[..used] },
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
                compilation_options: options(program),
                targets: &targets,
            }),
            multiview_mask: None,
            cache: None,
        });
        Ok(Built { pipeline, slots, layouts })
    }
}

fn layouts(gpu: &Gpu, slots: &[Slot], visibility: wgpu::ShaderStages) -> BTreeMap<u32, wgpu::BindGroupLayout> {
    let mut entries: BTreeMap<u32, Vec<wgpu::BindGroupLayoutEntry>> = BTreeMap::new();
    for slot in slots {
        let entry = wgpu::BindGroupLayoutEntry { binding: slot.binding, visibility, ty: binding_type(slot.kind), count: None };
        entries.entry(slot.group).or_default().push(entry);
    }
    let make = |entries: &Vec<_>| gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries });
    entries.iter().map(|(group, entries)| (*group, make(entries))).collect()
}

fn pipeline_layout(gpu: &Gpu, layouts: &BTreeMap<u32, wgpu::BindGroupLayout>) -> wgpu::PipelineLayout {
    let last = layouts.keys().next_back().map_or(0, |g| g + 1);
    let groups: Vec<_> = (0..last).map(|g| layouts.get(&g)).collect();
    gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor { label: None, bind_group_layouts: &groups, immediate_size: 0 })
}

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
