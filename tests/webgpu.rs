//! What ships runs on every adapter that WebGPU admits, and on lavapipe: each pipeline is encoded for scenes of all kinds and held against the limits that are
//! granted everywhere, without a device.

use hemisplat::{
    contract::{encoder::Setting, tables::Remembered},
    gpu::{GpuError, limits, scene as scene_data},
    passes::REGISTRY,
    pipeline::{embedded::EMBEDDED, load, plan},
    scene::{Scene, bvh::Bvh, load as scenes, needs::Needs},
    schedule::Device,
};
use rayon::prelude::*;
use std::path::Path;

/// Between them: punctual lights of all kinds, lamps, skies, lobes that depend on the azimuth, smooth normals, textures; and all of it in one.
const SCENES: [&str; 5] = ["scenes/cornell", "scenes/balls", "scenes/hall", "scenes/castle", "tests/places/kinds"];

/// WebGPU grants more, but where a branch looks at the fourth the lavapipe of Mesa 22 writes past its tables and dies.
const MOST_UNIFORMS: u32 = 3;

/// Pipelines whose point is a feature that WebGPU leaves to the adapter: they splat by blending.
const BLENDING: [&str; 1] = ["radiance-blend.ron"];

#[test]
fn what_ships_asks_no_more_than_webgpu_grants() {
    let complaints: Vec<String> = SCENES.par_iter().flat_map(|scene| complaints(scene)).collect();
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

/// A limit that is lowered, and what the error speaks of.
type Lowered = (fn(&mut wgpu::Limits), &'static str);

#[test]
fn what_is_too_much_is_named_with_its_node() {
    let lowered: [Lowered; 9] = [
        (|limits| limits.max_storage_buffers_per_shader_stage = 2, "storage buffers; the adapter's limit is 2"),
        (|limits| limits.max_uniform_buffers_per_shader_stage = 1, "uniform buffers"),
        (|limits| limits.max_sampled_textures_per_shader_stage = 0, "textures"),
        (|limits| limits.max_storage_buffer_binding_size = 64, "binds` needs"),
        (|limits| limits.max_compute_invocations_per_workgroup = 32, "invocations a workgroup"),
        (|limits| limits.max_compute_workgroup_storage_size = 0, "bytes that a workgroup shares"),
        (|limits| limits.max_compute_workgroups_per_dimension = 3, "workgroups along an edge of a dispatch"),
        (|limits| limits.max_texture_dimension_2d = 32, "texels along an edge"),
        (|limits| limits.max_color_attachment_bytes_per_sample = 0, "bytes a sample of its colour attachments"),
    ];
    let (scene, needs) = scene("scenes/corner");
    let pipeline = load("irradiance-device", &[], REGISTRY, &mut |_| Err(std::io::ErrorKind::NotFound.into())).unwrap();
    let setting = Setting { scene: &scene, needs: &needs, device: Device::ABLE, size: [64, 64], tables: None };
    let plan = plan(&pipeline, setting, &[], &scene_data::kind).unwrap();
    for (lower, said) in lowered {
        let mut limits = wgpu::Limits::default();
        lower(&mut limits);
        let error = limits::hold(&plan.schedule, &limits, wgpu::Features::FLOAT32_BLENDABLE, "any").expect_err(said).to_string();
        assert!(error.starts_with('`') && error.contains(said), "{error}");
    }
}

fn scene(name: &str) -> (Scene, Needs) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("{name}.ron"));
    let mut scene = scenes::load(&path, &scenes::LoadOptions::default()).unwrap();
    Bvh::build(&mut scene);
    let needs = Needs::of(&scene);
    (scene, needs)
}

fn complaints(name: &str) -> Vec<String> {
    let (scene, needs) = scene(name);
    let granted = wgpu::Limits { max_uniform_buffers_per_shader_stage: MOST_UNIFORMS, ..Default::default() };
    let tables = Remembered::default();
    let mut complaints = Vec::new();
    for ((file, _), device) in EMBEDDED.iter().flat_map(|ships| [Device::ABLE, Device::SOFTWARE].map(|device| (ships, Device { blends: false, ..device }))) {
        let pipeline = load(file, &[], REGISTRY, &mut |_| Err(std::io::ErrorKind::NotFound.into())).unwrap_or_else(|_| panic!("{file}"));
        let setting = Setting { scene: &scene, needs: &needs, device, size: [256, 256], tables: Some(&tables) };
        let plan = plan(&pipeline, setting, &[], &scene_data::kind).unwrap_or_else(|_| panic!("{file} on {name}"));
        let Err(error) = limits::hold(&plan.schedule, &granted, wgpu::Features::empty(), "the least of all") else { continue };
        if !BLENDING.contains(file) || !matches!(error, GpuError::MissingFeature { .. }) {
            complaints.push(format!("{file}, {name}, {device:?}: {error}"));
        }
    }
    complaints
}
