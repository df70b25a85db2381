//! The reference against Mitsuba 3, pixel by pixel: two programs that share no code must agree within their noise.
//!
//! Runs where the peers are installed (`benches/peers/setup.sh`) and the scenes are given (`HEMISPLAT_SCENES`); else each
//! case is named as skipped, which `HEMISPLAT_REQUIRE=peers` makes a failure.

mod skips;

use glam::{DVec3, Vec3};
use hemisplat::{
    math::windows::Windows,
    measure::{Layer, Layers, compare as compare_pictures},
    reference::{Bounces, Pixels, Reference, Settings, Stop, render},
    scene::{
        bvh::Bvh,
        load::{LoadOptions, load},
        model::*,
    },
};
use libtest_mimic::{Arguments, Failed};
use serde::Deserialize;
use skips::Missing;
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
    let trials = CASES.map(|case| {
        let missing = missing(case).map(|why| Missing::new("peers", why));
        skips::trial(format!("{case}_agrees_with_mitsuba"), missing.as_ref(), move || compare(case))
    });
    let missing = missing(CASES[0]).map(|why| Missing::new("peers", why));
    let in_windows = skips::trial("windows_agree_with_mitsuba", missing.as_ref(), compare_in_windows);
    let has_python = Command::new(PYTHON).arg("--version").output().is_ok_and(|done| done.status.success());
    let missing = (!has_python).then(|| Missing::new("tools", format!("there is no {PYTHON}")));
    let rule = skips::trial("windows_are_those_of_the_peers", missing.as_ref(), same_windows);
    libtest_mimic::run(&Arguments::from_args(), trials.into_iter().chain([in_windows, rule]).collect()).exit();
}

/// Any one: the rule needs no package.
const PYTHON: &str = "python3";

/// The rule that places windows, in Rust and in Python.
fn same_windows() -> Result<(), Failed> {
    for (size, count) in [([64, 64], 1), ([130, 70], 2), ([1000, 1000], 16), ([1920, 1080], 100), ([333, 2000], 155), ([4096, 4096], 4096)] {
        let numbers = [size[0], size[1], count].map(|number: u32| number.to_string());
        let done = Command::new(PYTHON).arg(peers().join("windows.py")).args(numbers).output()?;
        let ours = Windows::spread(size, count).ok_or("they do not fit")?.to_string();
        let theirs = String::from_utf8(done.stdout)?;
        if theirs.trim() != ours {
            return Err(format!("{size:?}, {count}: {theirs} in place of {ours}").into());
        }
    }
    let refused = Command::new(PYTHON).arg(peers().join("windows.py")).args(["130", "70", "3"]).output()?;
    if refused.status.success() { Err("three windows in 130×70 pixels".into()) } else { Ok(()) }
}

/// Both truths in windows: the same pixels see the same, and their light differs by no more than noise.
fn compare_in_windows() -> Result<(), Failed> {
    let name = CASES[0];
    let out = tempfile::tempdir()?;
    let numbers = ["--size", "192", "--windows", "2", "--samples", "1024"];
    let done = Command::new(python()).arg(peers().join("mitsuba_reference.py")).arg(name).args(numbers).arg("-o").arg(out.path()).output()?;
    if !done.status.success() {
        return Err(format!("mitsuba_reference.py failed:\n{}", String::from_utf8_lossy(&done.stderr)).into());
    }
    let theirs = Layers::read(&std::fs::read(out.path().join(format!("{name}.reference-windows.exr")))?)?;
    let mut cases: BTreeMap<String, Case> = serde_json::from_str(&std::fs::read_to_string(peers().join("cases.json"))?)?;
    let mut scene = scene(&cases.remove(name).ok_or("not among the cases")?)?;
    let bvh = Bvh::build(&mut scene);
    let settings = Settings { size: [SIDE; 2], pixels: Pixels::Windows(2), bounces: Bounces::Count(1), stop: Stop::Samples(1024), seed: 11 };
    let ours = render(&scene, &bvh, &scene.cameras[0], &settings, &|_| true)?;
    let layer = |planes: &[Vec3], names: &[&str]| Layer::interleaved(names, &planes.iter().flat_map(|value| value.to_array()).collect::<Vec<_>>(), 3);
    let picture = Layers::new(SIDE, SIDE).with("irradiance", layer(&ours.irradiance, &["R", "G", "B"])).with("normal", layer(&ours.normal, &["X", "Y", "Z"]));
    let picture = picture.with("depth", Layer::value(ours.depth.clone()));
    let by_theirs = compare_pictures(&picture, &theirs, "irradiance", None)?;
    let by_ours = compare_pictures(&theirs, &picture, "irradiance", None)?;
    let noise = by_theirs.reference_noise_over_mean.unwrap_or(0.0);
    let figures = format!(
        "{} windows, bias {:+.3} %, rmse {:.2} % beside a noise of {:.2} %, edges {:?} and {:?}",
        by_theirs.windows.unwrap_or(0),
        by_theirs.bias_over_mean * 100.0,
        by_theirs.rmse_over_mean * 100.0,
        noise * 100.0,
        by_theirs.edge_share,
        by_ours.edge_share
    );
    println!("{name} in windows: {figures}");
    let same = theirs.windows()? == ours.windows && by_theirs.windows == Some(2);
    let edges = by_theirs.edge_share.zip(by_ours.edge_share).is_some_and(|(a, b)| (a / b - 1.0).abs() < 0.1);
    // Our own noise is as large as theirs.
    if same && edges && by_theirs.bias_over_mean.abs() < 0.01 && by_theirs.rmse_over_mean < 1.5 * noise { Ok(()) } else { Err(figures.into()) }
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
        lights: case.lights.iter().map(light).collect(),
        cameras: vec![camera(&case.camera)],
        ..Scene::default()
    })
}

fn camera(camera: &CaseCamera) -> Camera {
    let direction = Vec3::from(camera.direction).normalize();
    let up = direction.cross(camera.up.into()).cross(direction).normalize();
    Camera {
        name: "case".into(),
        eye: camera.eye.into(),
        direction,
        up,
        field_of_view: FieldOfView::Horizontal(camera.fov.to_radians()),
        size: None,
        sample: Default::default(),
    }
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
