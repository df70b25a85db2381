//! Fills end: views from anywhere in scenes of many kinds, at several sizes. Every pixel sees what is on its ray, every pixel is covered, and rounds, records
//! and seconds stay within what the pixels are worth.
//!
//! Forty views by default, each scene at each size; `cargo test --test fills -- --ignored` looks at a thousand. `HEMISPLAT_VIEW="scene number"` looks at one of them alone.
//! Scenes that are no part of the project are looked for in `HEMISPLAT_SCENES`; without it they are named as skipped, which `HEMISPLAT_REQUIRE=scenes` makes
//! a failure, as `HEMISPLAT_REQUIRE=gpu` does without an adapter.

mod skips;

use glam::{DVec3, Vec3};
use hemisplat::{
    block_on,
    contract::encoder::Setting,
    gpu::{Gpu, Pace, scene::kind},
    measure::{
        Layers,
        run::{FrameReport, Run},
    },
    passes::REGISTRY,
    pipeline::{Plan, load, plan},
    scene::{
        Camera, FieldOfView, Scene,
        load::{LoadOptions, load as load_scene},
        needs::Needs,
        stage::Stage,
    },
};
use libtest_mimic::{Arguments, Failed};
use skips::Missing;
use std::{env, io, path::Path, sync::Arc, time::Instant};

type Outcome = Result<(), Failed>;

/// Scenes of many kinds: closed and open, of large triangles and of small ones, lit by lamps, suns and skies. The last ones are no part of the project.
const OWN: [&str; 8] = ["cornell", "corner", "hall", "balls", "teapot-noon", "teapot-evening", "castle", "slivers"];
const FOREIGN: [&str; 3] = ["sibenik", "sponza", "cornell-mcguire/CornellBox-Sphere.obj"];

/// Pixels of the views, in turn.
const SIZES: [[u32; 2]; 4] = [[64, 64], [97, 61], [192, 128], [384, 384]];

/// What ships, and where its pixels are.
const PIPELINE: &str = r#"Variant(
    version: 1,
    about: "What ships, and where its pixels are",
    of: "irradiance.ron",
    outputs: {
        "picture": "image", "irradiance": "indirect.irradiance", "weight": "indirect.weight", "depth": "gbuffer.depth", "position": "gbuffer.position",
    },
)"#;

/// Most records over pixels: leaves and needles need one for every second pixel of a small picture.
const MOST_RECORDS: f64 = 0.75;

/// As many as a fill has that looks at all cells in batches; those of one pixel at a time are thousands.
const MOST_ROUNDS: u32 = 400;

/// Of a view, many times what the slowest takes on two free cores: a fill without end takes minutes.
const MOST_SECONDS: f64 = 120.0;

/// How far a place may be from its pixel's centre [pixels].
const BESIDE: f64 = 0.01;

fn main() {
    let arguments = Arguments::from_args();
    let gpu = block_on(Gpu::open()).map_err(|error| error.to_string());
    let mut trials = Vec::new();
    for (name, geometry) in OWN.map(|name| (name, None)).into_iter().chain(FOREIGN.map(|name| (name, Missing::scenes()))) {
        let missing = gpu.as_ref().err().map(|reason| Missing::new("gpu", reason)).or(geometry);
        for (views, is_long) in [(4, false), (100, true)] {
            let test = format!("{views}_views_of_{}", name.split('/').next_back().unwrap_or(name).trim_end_matches(".obj"));
            let gpu = gpu.clone();
            let run = move || look_around(&gpu?, name, views);
            trials.push(skips::short_or_long(test, is_long, missing.as_ref(), run));
        }
    }
    libtest_mimic::run(&arguments, trials).exit()
}

/// Numbers from 0 to 1 that look random.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) >> 40) as f32 / (1 << 24) as f32
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }
}

/// A camera anywhere within the scene's bounds.
fn camera(scene: &Scene, number: usize) -> Camera {
    let mut random = Random(number as u64 + 1);
    let bounds = scene.bounds();
    let position = bounds.min + (bounds.max - bounds.min) * (0.03 + 0.94 * random.vector());
    let direction = (random.vector() * 2.0 - 1.0).try_normalize().unwrap_or(Vec3::X);
    let up = if direction.y.abs() > 0.99 { Vec3::X } else { Vec3::Y };
    let up = (up - direction * up.dot(direction)).normalize();
    let fov = (20.0 + 80.0 * random.next()).to_radians();
    Camera { name: format!("view {number}"), eye: position, direction, up, field_of_view: FieldOfView::Shorter(fov), size: None, sample: Default::default() }
}

/// A fan of slivers from needles to nothing over a floor of two huge triangles, lit from above.
fn slivers() -> String {
    let mut obj = String::from("v -1e4 0 -1e4\nv 1e4 0 -1e4\nv 1e4 0 1e4\nv -1e4 0 1e4\nf 1 4 3\nf 1 3 2\n");
    let mut count = 4;
    for blade in 0..400 {
        let (turn, width) = (blade as f64 * 0.1571, 10f64.powf(-0.02 * blade as f64));
        let (x, z) = (turn.cos(), turn.sin());
        let height = 0.1 + 0.01 * blade as f64;
        obj += &format!("v {} {} {}\n", 0.3 * x, height, 0.3 * z);
        obj += &format!("v {} {} {}\n", 9.0 * x, height + 0.7, 9.0 * z);
        obj += &format!("v {} {} {}\n", 5.0 * x - z * width, height + 0.4, 5.0 * z + x * width);
        obj += &format!("f {} {} {}\n", count + 1, count + 2, count + 3);
        count += 3;
    }
    obj
}

fn scene(name: &str) -> Result<Scene, Failed> {
    let shown = |error| format!("{name}: {:?}", miette::Report::new(error));
    let options = LoadOptions::default().with_environment();
    if name != "slivers" {
        let overrides = if name == "castle" { vec![("triangles".into(), "20000".into())] } else { Vec::new() };
        return Ok(load_scene(Path::new(name), &LoadOptions { overrides, ..options }).map_err(shown)?);
    }
    let folder = tempfile::tempdir()?;
    std::fs::write(folder.path().join("slivers.obj"), slivers())?;
    let document = r#"Scene(version: 1, geometry: [File("slivers.obj")], environment: Overcast(zenith: (1, 1, 1)), cameras: {"main": (eye: (0, 2, 12), direction: (0, -0.1, -1), up: (0, 1, 0), fov: 60)})"#;
    let path = folder.path().join("slivers.ron");
    std::fs::write(&path, document)?;
    Ok(load_scene(&path, &options).map_err(shown)?)
}

fn planned(gpu: &Arc<Gpu>, scene: &Scene, size: [u32; 2]) -> Result<Arc<Plan>, Failed> {
    let own = "fills.ron";
    let mut read = |path: &Path| if path == Path::new(own) { Ok(PIPELINE.to_owned()) } else { Err(io::ErrorKind::NotFound.into()) };
    let pipeline = load(own, &[], REGISTRY, &mut read).map_err(|problems| format!("{problems:?}"))?;
    let needs = Needs::of(scene);
    let setting = Setting { scene, needs: &needs, device: gpu.adapter.device(), size, tables: None };
    Ok(plan(&pipeline, setting, &[], &kind).map_err(|problems| format!("{problems:?}"))?)
}

/// Looks at the views of one size after the other.
fn look_around(gpu: &Arc<Gpu>, name: &str, views: usize) -> Outcome {
    let stage = Arc::new(Stage::new(scene(name)?));
    let scene = &stage.scene;
    let alone = env::var("HEMISPLAT_VIEW").ok();
    let chosen = |number: usize| alone.as_ref().is_none_or(|alone| *alone == format!("{name} {number}"));
    let mut wrong = Vec::new();
    for (index, size) in SIZES.into_iter().enumerate() {
        let plan = planned(gpu, scene, size)?;
        let mut run = block_on(Run::new(gpu, &stage, &plan, &scene.cameras[0], size)).map_err(|error| error.to_string())?;
        for number in (index..views).step_by(SIZES.len()).filter(|number| chosen(*number)) {
            let camera = camera(scene, number);
            block_on(run.reset()).map_err(|error| error.to_string())?;
            run.set_camera(&camera);
            let start = Instant::now();
            let report = block_on(run.frame(&|| Pace::GoOn)).map_err(|error| format!("{name} {number}: {error}"))?;
            let seconds = start.elapsed().as_secs_f64();
            let picture = block_on(run.picture()).map_err(|error| error.to_string())?;
            let found = faults(&report, seconds, &picture).into_iter().chain(beside(&picture, &camera)?);
            wrong.extend(found.map(|fault| format!("{name} {number}, {}x{}: {fault}", size[0], size[1])));
        }
    }
    if wrong.is_empty() { Ok(()) } else { Err(wrong.join("\n").into()) }
}

/// What is wrong with a frame.
fn faults(report: &FrameReport, seconds: f64, picture: &Layers) -> Vec<String> {
    let pixels = picture.width * picture.height;
    let records = report.records.irradiance.unwrap_or(0);
    let rounds = report.fill_rounds.unwrap_or(0);
    let plane = |layer: &str| picture.layers[layer].channels.values().next().cloned().unwrap_or_default();
    let black = plane("depth").iter().zip(plane("weight")).filter(|(depth, weight)| **depth > 0.0 && *weight <= 0.0).count();
    let checks = [
        (!report.complete, format!("unfinished: {:?}, {:?} uncovered", report.unfinished.len(), report.uncovered_pixels)),
        (black > 0, format!("{black} pixels without light")),
        (f64::from(records) > MOST_RECORDS * f64::from(pixels), format!("{records} records")),
        (rounds > MOST_ROUNDS, format!("{rounds} rounds")),
        (seconds > MOST_SECONDS, format!("{seconds:.1} s")),
    ];
    if env::var_os("HEMISPLAT_VIEWS_TOLD").is_some() {
        println!("{pixels} pixels: {records} records, {rounds} rounds, {seconds:.2} s");
    }
    checks.into_iter().filter(|(is_wrong, _)| *is_wrong).map(|(_, what)| what).collect()
}

/// Tells where pixels see what is beside their rays.
fn beside(picture: &Layers, camera: &Camera) -> Result<Option<String>, Failed> {
    let size = [picture.width, picture.height];
    let channels = &picture.layers["position"].channels;
    let depth = &picture.layers["depth"].channels.values().next().ok_or("no depth")?;
    let pixel = 2.0 * f64::from(camera.half_extent(size).x) / f64::from(size[0]);
    let (mut worst, mut count) = ((0.0, 0), 0);
    for at in (0..depth.len()).filter(|at| depth[*at] > 0.0) {
        let place = Vec3::new(channels["X"][at], channels["Y"][at], channels["Z"][at]);
        let ray = camera.pixel_ray(size, [at as u32 % size[0], at as u32 / size[0]]).as_dvec3();
        let way = place.as_dvec3() - camera.eye.as_dvec3();
        // What the numbers of a place cannot tell, in single precision.
        let rounding = 5e-7 * f64::from(place.abs().max_element().max(camera.eye.abs().max_element()));
        let off = (beside_ray(way, ray) - rounding).max(0.0) / (pixel * way.length() / ray.length());
        count += usize::from(off > BESIDE);
        worst = if off > worst.0 { (off, at) } else { worst };
    }
    let [x, y] = [worst.1 as u32 % size[0], worst.1 as u32 / size[0]];
    Ok((count > 0).then(|| format!("{count} pixels see what is beside their ray, ({x}, {y}) by {:.3} pixels", worst.0)))
}

fn beside_ray(way: DVec3, ray: DVec3) -> f64 {
    way.cross(ray).length() / ray.length()
}
