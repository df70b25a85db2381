//! What ships runs on every adapter that WebGPU admits: each pipeline is recorded for scenes of all kinds and held against the limits that are
//! granted everywhere, without a device.

use hemisplat::{
    contract::{recorder::Setting, tables::Remembered},
    gpu::{GpuError, limits, scene as scene_data},
    passes::REGISTRY,
    pipeline::{embedded::EMBEDDED, load, plan},
    recording::Device,
    scene::{bvh::Bvh, load as scenes, needs::Needs},
};
use rayon::prelude::*;
use std::path::Path;

/// Between them: punctual lights of all kinds, lamps, skies, lobes that depend on the azimuth, smooth normals, textures.
const SCENES: [&str; 4] = ["cornell", "balls", "hall", "castle"];

/// Pipelines whose point is a feature that WebGPU leaves to the adapter: they splat by blending.
const BLENDING: [&str; 2] = ["irradiance-device.ron", "radiance-blend.ron"];

#[test]
fn what_ships_asks_no_more_than_webgpu_grants() {
    let complaints: Vec<String> = SCENES.par_iter().flat_map(|scene| complaints(scene)).collect();
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

fn complaints(name: &str) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{name}.ron"));
    let mut scene = scenes::load(&path, &scenes::LoadOptions::default()).unwrap();
    Bvh::build(&mut scene);
    let needs = Needs::of(&scene);
    let (granted, tables) = (wgpu::Limits::default(), Remembered::default());
    let mut complaints = Vec::new();
    for ((file, _), device) in EMBEDDED.iter().flat_map(|ships| [Device::Hardware { blends: false }, Device::Software].map(|device| (ships, device))) {
        let pipeline = load(file, &[], REGISTRY, &mut |_| Err(std::io::ErrorKind::NotFound.into())).unwrap_or_else(|_| panic!("{file}"));
        let setting = Setting { scene: &scene, needs: &needs, device, size: [256, 256], tables: Some(&tables) };
        let plan = plan(&pipeline, setting, &[], &|data| scene_data::kind(&scene, data)).unwrap_or_else(|_| panic!("{file} on {name}"));
        let Err(error) = limits::hold(&plan.recording, &granted, wgpu::Features::empty(), "the least of all") else { continue };
        if !BLENDING.contains(file) || !matches!(error, GpuError::MissingFeature { .. }) {
            complaints.push(format!("{file}, {name}, {device:?}: {error}"));
        }
    }
    complaints
}
