//! The reference against Mitsuba 3, pixel by pixel: two programs that share no code must agree within their noise.
//!
//! Runs where the peers are installed (`benches/peers/setup.sh`) and the scenes are given (`HEMISPLAT_SCENES`); else each
//! case is named as skipped, which `HEMISPLAT_REQUIRE=peers` makes a failure.

use glam::{DVec3, Vec3};
use hemisplat::{
    reference::{Bounces, Pixels, Reference, Settings, Stop, render},
    scene::{
        bvh::Bvh,
        load::{LoadOptions, load},
        model::*,
    },
};
use libtest_mimic::{Arguments, Failed, Trial};
use serde::Deserialize;
use std::{
    collections::BTreeMap,
    env,
    path::{Path, PathBuf},
    process::Command,
};

/// The cases and what both programs spend on each: the picture's side [pixels], stride, samples a pixel.
const CASES: [&str; 2] = ["sibenik", "sponza"];
const SIDE: u32 = 192;
const STRIDE: u32 = 4;
const SAMPLES: u32 = 4096;

fn main() {
    let required = env::var("HEMISPLAT_REQUIRE").is_ok_and(|list| list.split(',').any(|item| item.trim() == "peers"));
    let trials = CASES.map(|case| {
        let missing = missing(case);
        match &missing {
            Some(what) if !required => println!("SKIPPED: {case} against Mitsuba: {what}"),
            _ => {}
        }
        let skip = missing.is_some() && !required;
        Trial::test(format!("{case}_agrees_with_mitsuba"), move || missing.map_or_else(|| compare(case), |what| Err(what.into()))).with_ignored_flag(skip)
    });
    libtest_mimic::run(&Arguments::from_args(), trials.into()).exit();
}

fn python() -> PathBuf {
    let home = env::var_os("PEERS_HOME").map(PathBuf::from);
    let default = || PathBuf::from(env::var_os("HOME").unwrap_or_default()).join(".cache/hemisplat-peers");
    home.unwrap_or_else(default).join("bin/python")
}

fn peers() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers")
}

fn scenes() -> PathBuf {
    PathBuf::from(env::var_os("HEMISPLAT_SCENES").unwrap_or_default())
}

/// What a case lacks to run.
fn missing(case: &str) -> Option<String> {
    let obj = scenes().join(case).join(format!("{case}.obj"));
    if env::var_os("HEMISPLAT_SCENES").is_none() {
        return Some("HEMISPLAT_SCENES does not name the folder of the scenes".into());
    }
    if !obj.is_file() {
        return Some(format!("{} is not there", obj.display()));
    }
    (!python().is_file()).then(|| "Mitsuba is not installed (benches/peers/setup.sh)".into())
}

#[derive(Deserialize)]
struct Case {
    obj: String,
    reflectance: f32,
    lights: Vec<CaseLight>,
    camera: CaseCamera,
}

#[derive(Deserialize)]
struct CaseLight {
    position: [f32; 3],
    intensity: [f32; 3],
}

#[derive(Deserialize)]
struct CaseCamera {
    eye: [f32; 3],
    direction: [f32; 3],
    up: [f32; 3],
    /// Horizontal [degrees].
    fov: f32,
}

/// The scene of a case: its geometry as loaded, all else as the case says, for the comparison is about light alone.
fn scene(case: &Case) -> Result<Scene, Failed> {
    let loaded = load(&scenes().join(&case.obj), &LoadOptions::default())?;
    let triangles = loaded.triangles.into_iter().map(|triangle| Triangle { normals: [triangle.face_normal(); 3], material: 0, ..triangle });
    let light = |light: &CaseLight| Light {
        name: "lamp".into(),
        kind: LightKind::Point { position: light.position.into(), intensity: light.intensity.into() },
        shadows: true,
    };
    Ok(Scene {
        name: case.obj.clone(),
        triangles: triangles.collect(),
        materials: vec![Material::diffuse("grey", Vec3::splat(case.reflectance))],
        textures: vec![],
        lights: case.lights.iter().map(light).collect(),
        environment: Environment::Constant(Vec3::ZERO),
        cameras: vec![camera(&case.camera)],
        origin: DVec3::ZERO,
        notes: vec![],
    })
}

fn camera(camera: &CaseCamera) -> Camera {
    let direction = Vec3::from(camera.direction).normalize();
    let up = direction.cross(camera.up.into()).cross(direction).normalize();
    Camera { name: "case".into(), eye: camera.eye.into(), direction, up, field_of_view: FieldOfView::Horizontal(camera.fov.to_radians()), size: None }
}

fn ours(case: &Case) -> Result<Reference, Failed> {
    let mut scene = scene(case)?;
    let bvh = Bvh::build(&mut scene);
    let settings = Settings { size: [SIDE; 2], pixels: Pixels::Every(STRIDE), bounces: Bounces::Count(1), stop: Stop::Samples(SAMPLES), seed: 11 };
    Ok(render(&scene, &bvh, &scene.cameras[0], &settings, &|_| true)?)
}

/// Mitsuba's layers: indirect irradiance, its variance, direct irradiance.
fn mitsuba(name: &str) -> Result<[Vec<DVec3>; 3], Failed> {
    let out = tempfile::tempdir()?;
    let done = Command::new(python())
        .arg(peers().join("mitsuba_reference.py"))
        .args([name, "--size", &SIDE.to_string(), "--stride", &STRIDE.to_string(), "--samples", &SAMPLES.to_string(), "-o"])
        .arg(out.path())
        .output()?;
    if !done.status.success() {
        return Err(format!("mitsuba_reference.py failed:\n{}", String::from_utf8_lossy(&done.stderr)).into());
    }
    let read = |layer: &str| read_exr(&out.path().join(format!("{name}.reference-{layer}.exr")));
    Ok([read("indirect")?, read("variance")?, read("direct")?])
}

fn read_exr(path: &Path) -> Result<Vec<DVec3>, Failed> {
    let image = exr::prelude::read_first_rgba_layer_from_file(
        path,
        |size, _| (size.width(), vec![DVec3::ZERO; size.width() * size.height()]),
        |(width, pixels), at, (r, g, b, _): (f32, f32, f32, f32)| pixels[at.y() * *width + at.x()] = DVec3::new(r as f64, g as f64, b as f64),
    )?;
    Ok(image.layer_data.channel_data.pixels.1)
}

fn compare(name: &str) -> Result<(), Failed> {
    let mut cases: BTreeMap<String, Case> = serde_json::from_str(&std::fs::read_to_string(peers().join("cases.json"))?)?;
    let case = cases.remove(name).ok_or("not among the cases")?;
    let ours = ours(&case)?;
    let [indirect, variance, direct] = mitsuba(name)?;
    if indirect.len() != ours.irradiance.len() {
        return Err(format!("{} pixels against {}", ours.irradiance.len(), indirect.len()).into());
    }
    let mean = |layer: &[Vec3]| layer.iter().map(|p| p.as_dvec3().y).sum::<f64>();
    let theirs = |layer: &[DVec3]| layer.iter().map(|p| p.y).sum::<f64>();
    // z of every pixel under both noises; few rounds make each pixel's own variance rough, so the tails are wide.
    let z: Vec<f64> = (0..indirect.len())
        .filter(|&i| ours.depth[i] > 0.0)
        .map(|i| (ours.irradiance[i].y as f64 - indirect[i].y) / (ours.variance[i].y as f64 + variance[i].y).max(1e-18).sqrt())
        .collect();
    let bias = mean(&ours.irradiance) / theirs(&indirect) - 1.0;
    let direct_bias = mean(&ours.direct_irradiance) / theirs(&direct) - 1.0;
    let z_square = z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64;
    let beyond = z.iter().filter(|z| z.abs() > 4.0).count() as f64 / z.len() as f64;
    let apart = |i: &usize| (ours.direct_irradiance[*i].y as f64 - direct[*i].y).abs() > 1e-3 * direct[*i].y + 1e-6;
    let direct_apart = (0..direct.len()).filter(apart).count() as f64 / direct.len() as f64;
    let figures = format!(
        "indirect {:+.3} %, z² {z_square:.3}, |z| > 4 at {:.2} % of {} pixels; direct {:+.3} %, apart at {:.2} %; {:.1} s",
        bias * 100.0,
        beyond * 100.0,
        z.len(),
        direct_bias * 100.0,
        direct_apart * 100.0,
        ours.seconds
    );
    println!("{name}: {figures}");
    let agrees = bias.abs() < 0.005 && z_square < 1.5 && beyond < 0.005 && direct_bias.abs() < 0.005 && direct_apart < 0.01;
    if agrees { Ok(()) } else { Err(figures.into()) }
}
