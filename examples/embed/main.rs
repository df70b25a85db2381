//! hemisplat inside a program that has a device of its own: frames are rendered on it, and the picture stays in a texture of the program's, from which a shader of
//! the program's goes on. Only the shader's result, 16 bytes, crosses to the host.
//!
//! `cargo run --release --example embed`

use hemisplat::{
    Camera, Engine, Pace, Stage, block_on,
    scene::load::{LoadOptions, load},
    wgpu,
};
use std::{error::Error, io, path::Path, sync::Arc, sync::mpsc};

const SIZE: [u32; 2] = [512, 512];

fn main() -> Result<(), Box<dyn Error>> {
    block_on(draw())
}

async fn draw() -> Result<(), Box<dyn Error>> {
    // Whatever the program does to open its device; WebGPU's limits are enough, and the engine is faster with some features.
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = instance.request_adapter(&wgpu::RequestAdapterOptions::default()).await?;
    let descriptor = wgpu::DeviceDescriptor { required_features: Engine::features(&adapter), ..Default::default() };
    let (device, queue) = adapter.request_device(&descriptor).await?;

    let engine = Engine::on(&adapter, device.clone(), queue.clone())?;
    let stage = Arc::new(Stage::new(load(Path::new("cornell"), &LoadOptions::default())?));
    let pipeline = engine.pipeline("irradiance", &[], &mut |_| Err(io::ErrorKind::NotFound.into()))?;
    let plan = engine.plan(&pipeline, &stage, SIZE)?;
    let mut camera: Camera = stage.scene.cameras[0].clone();
    let mut run = engine.run(&stage, &plan, &camera, SIZE).await?;

    let picture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("picture"),
        size: wgpu::Extent3d { width: SIZE[0], height: SIZE[1], depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Float,
        usage: wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    let mean = Mean::new(&device, &picture);
    let step = 0.01 * stage.scene.extent() * camera.direction.normalize();
    for frame in 0..4 {
        camera.eye += step;
        run.set_camera(&camera);
        let report = run.frame(&|| Pace::GoOn).await?;
        let before = engine.gpu().bytes_to_host();
        run.copy_to("picture", &picture).await?;
        let crossed = engine.gpu().bytes_to_host() - before;
        let [red, green, blue] = mean.of_picture(&device, &queue)?;
        let records = report.new_records.unwrap_or(0);
        println!("frame {frame}: {records} new records, {crossed} bytes of the picture read back; mean {red:.3} {green:.3} {blue:.3} W/(m²·sr)");
    }
    Ok(())
}

/// The program's own work on the picture.
struct Mean {
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    sum: wgpu::Buffer,
    staging: wgpu::Buffer,
}

impl Mean {
    fn new(device: &wgpu::Device, picture: &wgpu::Texture) -> Self {
        let module = device.create_shader_module(wgpu::include_wgsl!("mean.wgsl"));
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("mean"),
            layout: None,
            module: &module,
            entry_point: Some("add_up"),
            compilation_options: Default::default(),
            cache: None,
        });
        let buffer = |usage| device.create_buffer(&wgpu::BufferDescriptor { label: None, size: 16, usage, mapped_at_creation: false });
        let sum = buffer(wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let staging = buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
        let view = picture.create_view(&Default::default());
        let entries = [
            wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) },
            wgpu::BindGroupEntry { binding: 1, resource: sum.as_entire_binding() },
        ];
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &pipeline.get_bind_group_layout(0), entries: &entries });
        Self { pipeline, bindings, sum, staging }
    }

    fn of_picture(&self, device: &wgpu::Device, queue: &wgpu::Queue) -> Result<[f32; 3], Box<dyn Error>> {
        let mut encoder = device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.bindings, &[]);
            pass.dispatch_workgroups(1, 1, 1);
        }
        encoder.copy_buffer_to_buffer(&self.sum, 0, &self.staging, 0, 16);
        queue.submit([encoder.finish()]);
        let (sender, receiver) = mpsc::channel();
        self.staging.map_async(wgpu::MapMode::Read, .., move |result| drop(sender.send(result)));
        device.poll(wgpu::PollType::wait_indefinitely())?;
        receiver.recv()??;
        let [red, green, blue, _] = bytemuck::pod_read_unaligned::<[f32; 4]>(&self.staging.get_mapped_range(..)?);
        self.staging.unmap();
        Ok([red, green, blue])
    }
}
