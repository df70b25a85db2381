//! The memory of a session: what the placement says is allocated, what is known is uploaded.

use super::device::GpuError;
use super::session::Session;
use crate::schedule::*;

/// What stands behind a resource.
pub(super) enum Physical {
    Buffer(wgpu::Buffer),
    Texture {
        texture: wgpu::Texture,
        format: Format,
    },
    Host,
    /// Declared but touched by no command.
    Unused,
}

impl Session {
    pub(super) fn allocate(&mut self, placement: &Placement) -> Result<(), GpuError> {
        let schedule = self.schedule.clone();
        let name = |slot: usize| placement.slots.iter().zip(&schedule.resources).find(|(of, _)| **of == Some(slot as u32)).map_or("", |(_, r)| &r.name);
        let names: Vec<&str> = (0..placement.allocations.len()).map(name).collect();
        let shared = placement.allocations.iter().zip(names).map(|(kind, name)| self.create(name, kind)).collect::<Result<Vec<_>, _>>()?;
        for (index, description) in schedule.resources.iter().enumerate() {
            let physical = match (&description.lifetime, &description.kind) {
                (_, ResourceKind::Draws | ResourceKind::State) => Physical::Host,
                (Lifetime::Scene(part, data), kind) => self.upload(&description.name, kind, &self.scene_bytes(*part, *data))?,
                (Lifetime::Constant(contents), kind) => self.upload(&description.name, kind, contents)?,
                (Lifetime::History | Lifetime::Frame | Lifetime::Variables, kind) => self.create(&description.name, kind)?,
                (Lifetime::Transient, _) => match placement.slots[index] {
                    Some(slot) => shared[slot as usize].share(),
                    None => Physical::Unused,
                },
            };
            self.physical.push(physical);
        }
        self.gpu.check("uploading the scene")
    }

    fn create(&mut self, label: &str, kind: &ResourceKind) -> Result<Physical, GpuError> {
        self.gpu_bytes += kind.bytes();
        let physical = match kind {
            ResourceKind::Buffer { bytes } => {
                let usage = wgpu::BufferUsages::STORAGE
                    | wgpu::BufferUsages::UNIFORM
                    | wgpu::BufferUsages::VERTEX
                    | wgpu::BufferUsages::INDEX
                    | wgpu::BufferUsages::INDIRECT
                    | wgpu::BufferUsages::COPY_DST
                    | wgpu::BufferUsages::COPY_SRC;
                Physical::Buffer(self.gpu.device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size: *bytes, usage, mapped_at_creation: false }))
            }
            ResourceKind::Texture { size, layers, format } => {
                Physical::Texture { texture: self.create_texture(label, *size, *layers, *format), format: *format }
            }
            ResourceKind::Draws | ResourceKind::State => Physical::Host,
        };
        self.gpu.check(&format!("allocating `{label}`"))?;
        Ok(physical)
    }

    fn create_texture(&self, label: &str, size: [u32; 2], layers: u32, format: Format) -> wgpu::Texture {
        let mut usage =
            wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::COPY_DST;
        if format != Format::Depth32Float {
            usage |= wgpu::TextureUsages::STORAGE_BINDING;
        }
        self.gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: texture_format(format),
            usage,
            view_formats: &[],
        })
    }

    fn upload(&mut self, label: &str, kind: &ResourceKind, bytes: &[u8]) -> Result<Physical, GpuError> {
        let physical = self.create(label, kind)?;
        self.put(&physical, 0, bytes);
        Ok(physical)
    }

    /// Writes to a buffer from a place on, or a whole texture.
    pub(super) fn put(&self, physical: &Physical, offset: u64, bytes: &[u8]) {
        match physical {
            Physical::Buffer(buffer) => self.gpu.queue.write_buffer(buffer, offset, bytes),
            Physical::Texture { texture, format } => self.write_texture(texture, *format, bytes),
            Physical::Host | Physical::Unused => {}
        }
    }

    pub(super) fn buffer(&self, resource: Resource) -> &wgpu::Buffer {
        match &self.physical[resource.0 as usize] {
            Physical::Buffer(buffer) => buffer,
            _ => unreachable!("{} is not a buffer", self.schedule.resource(resource).name),
        }
    }

    pub(super) fn texture(&self, resource: Resource) -> (&wgpu::Texture, Format) {
        match &self.physical[resource.0 as usize] {
            Physical::Texture { texture, format } => (texture, *format),
            _ => unreachable!("{} is not a texture", self.schedule.resource(resource).name),
        }
    }
}

impl Physical {
    fn share(&self) -> Self {
        match self {
            Self::Buffer(buffer) => Self::Buffer(buffer.clone()),
            Self::Texture { texture, format } => Self::Texture { texture: texture.clone(), format: *format },
            Self::Host => Self::Host,
            Self::Unused => Self::Unused,
        }
    }
}

pub(super) fn texture_format(format: Format) -> wgpu::TextureFormat {
    match format {
        Format::R32Float => wgpu::TextureFormat::R32Float,
        Format::R32Uint => wgpu::TextureFormat::R32Uint,
        Format::Rgba16Float => wgpu::TextureFormat::Rgba16Float,
        Format::Rgba32Float => wgpu::TextureFormat::Rgba32Float,
        Format::Depth32Float => wgpu::TextureFormat::Depth32Float,
    }
}
