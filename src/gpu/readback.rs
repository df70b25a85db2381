//! From the device's memory to the host's.

use super::device::{Gpu, GpuError};
use crate::schedule::Format;
use std::sync::mpsc::Receiver;

/// A look at the first bytes of a staging buffer, which the device will be done with some time.
pub struct Look {
    pub staging: wgpu::Buffer,
    bytes: u64,
    mapped: Receiver<Result<(), wgpu::BufferAsyncError>>,
}

impl Look {
    /// Asks for it. What fills the buffer must have been submitted.
    pub fn ask(staging: wgpu::Buffer, bytes: u64) -> Self {
        let (sender, mapped) = std::sync::mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, 0..bytes, move |result| {
            let _ = sender.send(result);
        });
        Self { staging, bytes, mapped }
    }

    /// Looks, once the device is done with what was submitted last or, where one is given, up to a submission.
    pub fn see<T>(&self, gpu: &Gpu, submission: Option<wgpu::SubmissionIndex>, look: impl FnOnce(&[u8]) -> T) -> Result<T, GpuError> {
        gpu.wait_for("reading back", submission)?;
        let failed = |reason: String| GpuError::Driver { doing: "reading back".into(), reason };
        self.mapped.recv().map_err(|e| failed(e.to_string()))?.map_err(|e| failed(e.to_string()))?;
        let view = self.staging.get_mapped_range(0..self.bytes).map_err(|e| failed(e.to_string()))?;
        let seen = look(&view);
        drop(view);
        self.staging.unmap();
        Ok(seen)
    }
}

/// Looks at the first bytes of a staging buffer, once the device is done with all that was submitted.
pub fn look<T>(gpu: &Gpu, staging: &wgpu::Buffer, bytes: u64, look: impl FnOnce(&[u8]) -> T) -> Result<T, GpuError> {
    Look::ask(staging.clone(), bytes).see(gpu, None, look)
}

pub fn staging(gpu: &Gpu, bytes: u64) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("staging"),
        size: bytes,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// Rows without their padding.
pub fn unpad(rows: &[u8], width: u32, format: Format, into: &mut [u8]) {
    let (row, stride) = ((width as u64 * format.bytes()) as usize, format.row_bytes(width) as usize);
    into.chunks_exact_mut(row).zip(rows.chunks_exact(stride)).for_each(|(row, padded)| row.copy_from_slice(&padded[..row.len()]));
}

/// Encodes the copy of a texture, all layers, into `row_bytes · height · layers` bytes of a buffer.
pub fn copy_texture(encoder: &mut wgpu::CommandEncoder, texture: &wgpu::Texture, format: Format, buffer: &wgpu::Buffer, offset: u64) {
    let aspect = if format == Format::Depth32Float { wgpu::TextureAspect::DepthOnly } else { wgpu::TextureAspect::All };
    encoder.copy_texture_to_buffer(
        wgpu::TexelCopyTextureInfo { texture, mip_level: 0, origin: wgpu::Origin3d::ZERO, aspect },
        wgpu::TexelCopyBufferInfo {
            buffer,
            layout: wgpu::TexelCopyBufferLayout {
                offset,
                bytes_per_row: Some(format.row_bytes(texture.width()) as u32),
                rows_per_image: Some(texture.height()),
            },
        },
        texture.size(),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_lose_their_padding() {
        let (width, format) = (5, Format::R32Float);
        let padded: Vec<u8> = (0..3 * 256).map(|at| if at % 256 < 20 { (at / 256 * 20 + at % 256) as u8 } else { 255 }).collect();
        let mut rows = [0; 60];
        unpad(&padded, width, format, &mut rows);
        assert_eq!(rows.to_vec(), (0..60).collect::<Vec<u8>>());
        let mut rows = [0; 512];
        unpad(&[7; 512], 64, format, &mut rows);
        assert_eq!(rows, [7; 512]);
    }
}
