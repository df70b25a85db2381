//! What the adapter can do at best: bytes copied and numbers multiplied a second, by kernels that do nothing else.

use crate::{Failure, median};
use hemisplat::block_on;
use hemisplat::gpu::Gpu;
use serde::Serialize;
use std::time::Instant;

#[derive(Debug, Serialize)]
pub struct Peak {
    /// Read and written by a kernel that copies.
    pub bytes_per_second: f64,
    /// Multiplications and additions of 32-bit floats, fused ones as two.
    pub flops: f64,
}

/// Vectors of 16 bytes that are copied: beyond any cache.
const VECTORS: u32 = 1 << 22;
/// Invocations of the kernel that multiplies, and its rounds of four vectors each.
const INVOCATIONS: u32 = 1 << 18;
const ROUNDS: u32 = 256;
const REPEATS: usize = 5;

const KERNELS: &str = "
@group(0) @binding(0) var<storage, read> given: array<vec4f>;
@group(0) @binding(1) var<storage, read_write> made: array<vec4f>;

@compute @workgroup_size(64)
fn copy(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = (group.x + group.y * groups.x) * 64u + lane;
    made[index] = given[index];
}

@compute @workgroup_size(64)
fn multiply(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = (group.x + group.y * groups.x) * 64u + lane;
    let by = given[index % 64u];
    var a = by + 1.0;
    var b = by + 2.0;
    var c = by + 3.0;
    var d = by + 4.0;
    for (var i = 0u; i < 256u; i++) {
        a = fma(a, by, by);
        b = fma(b, by, by);
        c = fma(c, by, by);
        d = fma(d, by, by);
    }
    made[index] = a + b + c + d;
}
";

impl Peak {
    pub fn measure(gpu: &Gpu) -> Result<Self, Failure> {
        let buffer = || {
            let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
            gpu.device.create_buffer(&wgpu::BufferDescriptor { label: Some("peak"), size: u64::from(VECTORS) * 16, usage, mapped_at_creation: false })
        };
        let (from, to) = (buffer(), buffer());
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some("peak"), source: wgpu::ShaderSource::Wgsl(KERNELS.into()) });
        let seconds = |entry: &str, invocations: u32| -> Result<f64, Failure> {
            let descriptor = wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: None,
                module: &module,
                entry_point: Some(entry),
                compilation_options: Default::default(),
                cache: None,
            };
            let pipeline = gpu.device.create_compute_pipeline(&descriptor);
            let entries =
                [&from, &to].into_iter().enumerate().map(|(i, buffer)| wgpu::BindGroupEntry { binding: i as u32, resource: buffer.as_entire_binding() });
            let layout = pipeline.get_bind_group_layout(0);
            let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries.collect::<Vec<_>>() });
            let once = || -> Result<f64, Failure> {
                let start = Instant::now();
                let mut encoder = gpu.device.create_command_encoder(&Default::default());
                let mut pass = encoder.begin_compute_pass(&Default::default());
                pass.set_pipeline(&pipeline);
                pass.set_bind_group(0, &group, &[]);
                pass.dispatch_workgroups(invocations / 64 / 64, 64, 1);
                drop(pass);
                gpu.queue.submit([encoder.finish()]);
                block_on(gpu.wait("measuring the device"))?;
                Ok(start.elapsed().as_secs_f64())
            };
            once()?;
            Ok(median((0..REPEATS).map(|_| once()).collect::<Result<Vec<_>, _>>()?.into_iter()))
        };
        let bytes = f64::from(VECTORS) * 32.0;
        let flops = f64::from(INVOCATIONS) * f64::from(ROUNDS) * 32.0;
        Ok(Self { bytes_per_second: bytes / seconds("copy", VECTORS)?, flops: flops / seconds("multiply", INVOCATIONS)? })
    }
}
