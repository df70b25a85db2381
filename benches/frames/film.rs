//! A scene that moves, frame by frame: its truth, and its geometry as others take it.

use crate::{Failure, kept::write, list::Case};
use glam::Vec3;
use hemisplat::{
    measure::{Errors, IRRADIANCE, Layer, Layers, compare, course::Watch},
    reference::{Bounces, Pixels, Settings, Stop, render},
    scene::{Camera, Light, LightKind, Material, Scene, load, stage::Stage},
};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::{fs, path::Path};

/// The frames of a scene.
pub struct Film {
    truths: Vec<Layers>,
}

/// How the pictures of a sequence differ from its truth: means over frames, and in time.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Judged {
    pub rmse_over_mean: f64,
    pub bias_over_mean: f64,
    pub block_p50: Option<f64>,
    pub block_p99: Option<f64>,
    pub flicker: Option<f64>,
}

impl Film {
    /// Traces the truths, so many rays a pixel, and writes each frame's triangles and `frames.json` to a folder.
    pub fn new(case: &Case, size: [u32; 2], rays: u32, folder: &Path) -> Result<Self, Failure> {
        let mut stage = Stage::animated(load::load(Path::new(&format!("scenes/{}.ron", case.name)), &load::LoadOptions::default())?)?;
        let camera = stage.scene.cameras.first().cloned().ok_or("the scene has no camera")?;
        let (mut truths, mut frames) = (Vec::new(), Vec::new());
        for frame in 0..case.frames {
            let moment = stage.scene.animation.at(f64::from(frame) / case.fps);
            let (changes, camera) = (stage.changes_to(&moment), moment.camera(&stage.scene, &camera));
            stage.change(&changes)?;
            let mesh = format!("mesh.{frame:04}");
            fs::write(folder.join(&mesh), bytemuck::cast_slice(&triangles(&stage.scene)?))?;
            frames.push(json!({ "mesh": mesh, "lights": lights(&stage.scene.lights)?, "camera": told(&camera, size) }));
            truths.push(truth(&stage, &camera, size, rays)?);
        }
        write(&folder.join("frames.json"), &json!({ "size": size, "frames": frames }).to_string())?;
        Ok(Self { truths })
    }

    /// Judges a sequence of pictures, each read as it is wanted.
    pub fn judge(&self, picture: impl Fn(usize) -> Result<Layers, Failure>) -> Result<Judged, Failure> {
        let (mut watch, mut all) = (Watch::default(), Vec::new());
        for (frame, truth) in self.truths.iter().enumerate() {
            let picture = picture(frame)?;
            let errors = compare(&picture, truth, IRRADIANCE, None)?;
            watch.see(IRRADIANCE, &picture, truth, Some(&errors))?;
            all.push(errors);
        }
        let mean = Errors::over_frames(&all.iter().collect::<Vec<_>>()).ok_or("a sequence of no frames")?;
        let flicker = watch.course().and_then(|course| course.flicker);
        let Errors { rmse_over_mean, bias_over_mean, block_p50, block_p99, .. } = mean;
        Ok(Judged { rmse_over_mean, bias_over_mean, block_p50, block_p99, flicker })
    }
}

fn truth(stage: &Stage, camera: &Camera, size: [u32; 2], rays: u32) -> Result<Layers, Failure> {
    let settings = Settings { size, pixels: Pixels::Every(1), bounces: Bounces::Count(1), stop: Stop::Samples(rays), seed: 0 };
    let traced = render(&stage.scene, &stage.bvh, camera, &settings, &|_| true)?;
    let planes = |names: &[&str], data: &[Vec3]| Layer::interleaved(names, bytemuck::cast_slice(data), 3);
    Ok(Layers::new(size[0], size[1])
        .with(IRRADIANCE, planes(&["R", "G", "B"], &traced.irradiance))
        .with("irradiance_luminance_variance", Layer::value(traced.luminance_variance.irradiance))
        .with("depth", Layer::value(traced.depth)))
}

/// Corners and reflectance of each: twelve floats.
fn triangles(scene: &Scene) -> Result<Vec<[f32; 12]>, Failure> {
    let reflectance = |material: &Material| match material {
        Material { texture: None, glossy: None, alpha_cutoff: None, emission: Vec3::ZERO, reflectance, .. } => Ok(*reflectance),
        other => Err(format!("`{}` is no plain diffuse surface, the only kind that is written for others", other.name)),
    };
    let reflectances = scene.materials.iter().map(reflectance).collect::<Result<Vec<_>, _>>()?;
    let row = |corners: &[Vec3; 3], reflectance: Vec3| {
        let mut row = [0.0; 12];
        row.chunks_exact_mut(3).zip(corners.iter().chain([&reflectance])).for_each(|(to, from)| to.copy_from_slice(&from.to_array()));
        row
    };
    Ok(scene.triangles.iter().map(|triangle| row(&triangle.positions, reflectances[triangle.material as usize])).collect())
}

fn lights(lights: &[Light]) -> Result<Vec<Value>, Failure> {
    let told = |light: &Light| match light.kind {
        LightKind::Point { position, intensity } => Ok(json!({ "position": position.to_array(), "intensity": intensity.to_array() })),
        _ => Err(format!("`{}` is no point light, the only kind that is written for others", light.name).into()),
    };
    lights.iter().map(told).collect()
}

fn told(camera: &Camera, size: [u32; 2]) -> Value {
    let fov = 2.0 * camera.half_extent(size).x.atan().to_degrees();
    json!({ "eye": camera.eye.to_array(), "direction": camera.direction.to_array(), "up": camera.up.to_array(), "fov": fov })
}
