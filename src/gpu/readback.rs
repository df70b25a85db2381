//! From the device's memory to the host's.

use super::device::{Gpu, GpuError};
use crate::schedule::Format;
use futures_channel::oneshot;
use std::sync::atomic::Ordering;

/// A look at the first bytes of a staging buffer, which the device will be done with some time.
pub struct Look {
    staging: wgpu::Buffer,
    bytes: u64,
    mapped: oneshot::Receiver<Result<(), wgpu::BufferAsyncError>>,
}

/// Bytes of a staging buffer that the host may look at.
pub struct Arrived {
    pub staging: wgpu::Buffer,
    bytes: u64,
}

impl Look {
    /// Asks for it. What fills the buffer must have been submitted.
    pub fn ask(staging: wgpu::Buffer, bytes: u64) -> Self {
        let (sender, mapped) = oneshot::channel();
        staging.map_async(wgpu::MapMode::Read, 0..bytes, move |result| {
            let _ = sender.send(result);
        });
        Self { staging, bytes, mapped }
    }

    /// Once the device is done with what was submitted last or, where one is given, up to a submission.
    pub async fn arrive(self, gpu: &Gpu, submission: Option<wgpu::SubmissionIndex>) -> Result<Arrived, GpuError> {
        gpu.poll(READING, submission)?;
        self.mapped.await.map_err(failed)?.map_err(failed)?;
        Ok(Arrived { staging: self.staging, bytes: self.bytes })
    }
}

impl Arrived {
    /// Looks once; the buffer is the device's again.
    pub fn see<T>(&self, gpu: &Gpu, look: impl FnOnce(&[u8]) -> T) -> Result<T, GpuError> {
        let view = self.staging.get_mapped_range(0..self.bytes).map_err(failed)?;
        gpu.to_host.fetch_add(self.bytes, Ordering::Relaxed);
        let seen = look(&view);
        drop(view);
        self.staging.unmap();
        Ok(seen)
    }
}

const READING: &str = "reading back";

fn failed(reason: impl ToString) -> GpuError {
    GpuError::Driver { doing: READING.into(), reason: reason.to_string() }
}

/// The first bytes of a staging buffer, once the device is done with all that was submitted.
pub async fn arrive(gpu: &Gpu, staging: &wgpu::Buffer, bytes: u64) -> Result<Arrived, GpuError> {
    Look::ask(staging.clone(), bytes).arrive(gpu, None).await
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
