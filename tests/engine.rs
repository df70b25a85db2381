//! The engine inside another program: on a device that is lent to it, with passes of that program, and after what goes wrong there.

use hemisplat::{
    Change, Engine, GpuError, Pace, Pipeline, Plan, Run, RunError, Stage, block_on,
    contract::{Description, Encoder, Output, Pass, Port, PortKind, Refusal, encoder::scene_constants, port},
    gpu::Gpu,
    measure::Layers,
    scene::{
        Simplified,
        load::{LoadOptions, load},
    },
    schedule::{Format, Program, SceneData},
    wgpu,
};
use libtest_mimic::Arguments;
use skips::Missing;
use std::{
    env,
    error::Error,
    io,
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    path::Path,
    process::Command,
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
};

#[path = "../examples/own_pass/ink.rs"]
mod ink;
mod skips;

type Test = fn() -> Result<(), Box<dyn Error>>;

const SIZE: [u32; 2] = [48, 32];

fn main() {
    let missing = block_on(Gpu::open()).err().map(|error| Missing::new("gpu", error.to_string()));
    let tests: [(&str, Test); 10] = [
        ("a_device_that_is_lent_shows_the_same_picture", lent_device),
        ("pictures_stay_on_the_device", picture_stays),
        ("passes_of_another_program_take_part", own_passes),
        ("a_pass_that_panics_is_an_error", panic_of_a_pass),
        ("a_shader_that_the_driver_refuses_is_an_error", refused_shader),
        ("a_device_that_is_lost_is_an_error", lost_device),
        ("what_finds_no_memory_is_an_error", no_memory),
        ("after_a_frame_that_was_dropped_the_next_begins_anew", dropped_frame),
        ("a_pass_reads_a_simpler_mesh_beside_the_scene", part),
        ("handles_outlive_what_they_were_made_from", handles),
    ];
    let mut trials: Vec<_> = tests.map(|(name, test)| skips::fallible(name, missing.as_ref(), test)).into();
    // In a process of its own, with little memory.
    if env::var_os(LITTLE).is_some() {
        trials = vec![skips::fallible("too_large", None, too_large)];
    }
    // Of a release build on a quiet machine: `cargo test --release --test engine -- --ignored --nocapture`.
    trials.push(skips::fallible("a_frame_costs_no_more_in_another_program", missing.as_ref(), costs).with_ignored_flag(true));
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

fn check(holds: bool, otherwise: impl FnOnce() -> String) -> Result<(), Box<dyn Error>> {
    if holds { Ok(()) } else { Err(otherwise().into()) }
}

struct Lent {
    engine: Engine,
    device: wgpu::Device,
}

/// A device as a program opens it that knows nothing of the engine: with what WebGPU promises and no more.
fn lent() -> Result<Lent, Box<dyn Error>> {
    lent_with(|_| wgpu::Features::empty())
}

fn lent_with(features: fn(&wgpu::Adapter) -> wgpu::Features) -> Result<Lent, Box<dyn Error>> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let descriptor = wgpu::DeviceDescriptor { required_features: features(&adapter), ..Default::default() };
    let (device, queue) = block_on(adapter.request_device(&descriptor))?;
    // Instances and what they loaded stay to the end: threads that have used a driver crash as they end after it.
    std::mem::forget(instance);
    Ok(Lent { engine: Engine::on(&adapter, device.clone(), queue)?, device })
}

fn cornell() -> Result<Arc<Stage>, Box<dyn Error>> {
    Ok(Arc::new(Stage::new(load(Path::new("cornell"), &LoadOptions::default())?)))
}

fn told(problems: hemisplat::Problems) -> String {
    format!("{:?}", miette::Report::new(problems))
}

fn pipeline(engine: &Engine, text: &str) -> Result<Pipeline, Box<dyn Error>> {
    let mut read = |path: &Path| if path == Path::new("own.ron") { Ok(text.to_owned()) } else { Err(io::ErrorKind::NotFound.into()) };
    Ok(engine.pipeline("own.ron", &[], &mut read).map_err(told)?)
}

fn planned(engine: &Engine, stage: &Stage, text: &str) -> Result<Arc<Plan>, Box<dyn Error>> {
    Ok(engine.plan(&pipeline(engine, text)?, stage, SIZE).map_err(told)?)
}

fn ready(engine: &Engine, text: &str) -> Result<Run, Box<dyn Error>> {
    let stage = cornell()?;
    Ok(block_on(engine.run(&stage, &planned(engine, &stage, text)?, &stage.scene.cameras[0], SIZE))?)
}

/// A frame may be awaited on any thread.
fn may_move<T: Send>(future: T) -> T {
    future
}

fn drawn(run: &mut Run) -> Result<Layers, RunError> {
    block_on(may_move(run.frame(&|| Pace::GoOn)))?;
    block_on(run.picture())
}

const IRRADIANCE: &str = r#"Variant(version: 1, about: "as it ships", source: "", of: "irradiance.ron")"#;

fn lent_device() -> Result<(), Box<dyn Error>> {
    let (lent, own) = (lent()?, block_on(Engine::open())?);
    let pictures = [drawn(&mut ready(&lent.engine, IRRADIANCE)?)?, drawn(&mut ready(&own, IRRADIANCE)?)?];
    check(pictures[0].layers == pictures[1].layers, || "another picture on a device that is lent".into())
}

const COPIED: wgpu::TextureUsages = wgpu::TextureUsages::COPY_DST.union(wgpu::TextureUsages::COPY_SRC);

fn texture(device: &wgpu::Device, size: [u32; 2], format: wgpu::TextureFormat, usage: wgpu::TextureUsages) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}

/// What a texture holds, read back by means of this program alone.
fn contents(engine: &Engine, texture: &wgpu::Texture) -> Result<Vec<f32>, Box<dyn Error>> {
    let (gpu, [width, height]) = (engine.gpu(), SIZE);
    let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
    let row = 16 * width;
    let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor { label: None, size: u64::from(row * height), usage, mapped_at_creation: false });
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), wgpu::TexelCopyBufferInfo { buffer: &staging, layout }, texture.size());
    gpu.queue.submit([encoder.finish()]);
    staging.map_async(wgpu::MapMode::Read, .., |_| ());
    gpu.device.poll(wgpu::PollType::wait_indefinitely())?;
    let values = bytemuck::pod_collect_to_vec(&staging.get_mapped_range(..)?);
    Ok(values)
}

fn picture_stays() -> Result<(), Box<dyn Error>> {
    let Lent { engine, device } = lent()?;
    let mut run = ready(&engine, IRRADIANCE)?;
    block_on(run.frame(&|| Pace::GoOn))?;
    let mine = texture(&device, SIZE, wgpu::TextureFormat::Rgba32Float, COPIED);
    let before = engine.gpu().bytes_to_host();
    let mut held = Vec::new();
    for output in ["picture", "irradiance"] {
        block_on(run.copy_to(output, &mine))?;
        held.push((output, contents(&engine, &mine)?));
    }
    check(engine.gpu().bytes_to_host() == before, || "a picture crossed to the host".into())?;
    let picture = block_on(run.picture())?;
    check(engine.gpu().bytes_to_host() > before, || "bytes that are read back are not counted".into())?;
    for (output, held) in held {
        let held: Vec<f32> = held.chunks_exact(4).map(|pixel| pixel[0]).collect();
        check(held == picture.rgb(output)?[0] && held.iter().any(|value| *value > 0.0), || format!("the texture holds something other than `{output}`"))?;
    }
    refused(&mut run, &device)
}

fn refused(run: &mut Run, device: &wgpu::Device) -> Result<(), Box<dyn Error>> {
    let small = texture(device, [16, 16], wgpu::TextureFormat::Rgba32Float, COPIED);
    let half = texture(device, SIZE, wgpu::TextureFormat::Rgba16Float, COPIED);
    for (output, texture) in [("picture", &small), ("picture", &half), ("pictures", &half)] {
        let refused = block_on(run.copy_to(output, texture));
        check(matches!(refused, Err(RunError::Output { .. })), || format!("{refused:?}"))?;
    }
    // Nothing may be copied to it.
    let sealed = texture(device, SIZE, wgpu::TextureFormat::Rgba32Float, wgpu::TextureUsages::TEXTURE_BINDING);
    let refused = block_on(run.copy_to("picture", &sealed));
    check(matches!(refused, Err(RunError::Gpu(GpuError::Driver { .. }))), || format!("{refused:?}"))
}

fn own_passes() -> Result<(), Box<dyn Error>> {
    let engine = block_on(Engine::open())?.with(&ink::Edges).with(&ink::Ink);
    let text = include_str!("../examples/own_pass/ink.ron");
    let green = |text: &str| Ok::<_, Box<dyn Error>>(drawn(&mut ready(&engine, text)?)?.rgb("picture")?[1].to_vec());
    let pixels: Vec<[f32; 2]> = green(text)?.into_iter().zip(green(IRRADIANCE)?).map(|(inked, plain)| [inked, plain]).collect();
    let darker = pixels.iter().filter(|[inked, plain]| inked < plain).count();
    let same = pixels.iter().filter(|[inked, plain]| inked == plain).count();
    let all = pixels.len();
    check(darker + same == all && darker > all / 50 && same > all / 2, || format!("{darker} of {all} are darker, {same} the same"))?;
    // What ships knows neither pass.
    let refused = planned(&block_on(Engine::open())?, &*cornell()?, text);
    check(refused.is_err_and(|error| error.to_string().contains("Edges")), || "a pass that nobody has registered".into())
}

/// A pass whose host step panics in the second frame.
struct Panicking;

static PANICKING: Description = made_of_nothing("Panicking", "Panics");

/// Of a pass that makes an image.
const fn made_of_nothing(name: &'static str, about: &'static str) -> Description {
    Description { name, about, source: "", parameters: &[], inputs: &[], outputs: &[Output { name: "image", about: "", kind: PortKind::Image }] }
}

impl Pass for Panicking {
    fn description(&self) -> &'static Description {
        &PANICKING
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let image = e.image("image", SIZE, Format::Rgba32Float);
        let frames = e.variable("frames", true);
        e.host("panic", &[], &[image], move |host| {
            host.set(frames, host.variable(frames) + 1);
            assert!(host.variable(frames) != 2, "in the second frame");
            let mut pixels = host.take(image);
            pixels.fill(glam::Vec4::ONE);
            host.put(image, pixels, u64::MAX);
            Ok(())
        });
        e.output("image", Port::Image(port::Image { texture: image, channels: port::Channels::Colour }));
        Ok(())
    }
}

fn panic_of_a_pass() -> Result<(), Box<dyn Error>> {
    let engine = block_on(Engine::open())?.with(&Panicking);
    let text = r#"Pipeline(version: 1, about: "panics", source: "", nodes: [(name: "it", pass: Panicking())], outputs: { "picture": "it" })"#;
    let mut run = ready(&engine, text)?;
    let told = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| ()));
    let found: Vec<Result<Layers, RunError>> = (0..3).map(|_| drawn(&mut run)).collect();
    std::panic::set_hook(told);
    check(found[0].is_ok() && found[2].is_ok(), || format!("{:?} and {:?} around it", found[0].as_ref().err(), found[2].as_ref().err()))?;
    let error = found[1].as_ref().err().map(ToString::to_string).unwrap_or_default();
    check(error.contains("panicked") && error.contains("in the second frame"), || error.clone())?;
    drawn(&mut ready(&engine, IRRADIANCE)?)?;
    Ok(())
}

/// A pass that leaves a constant of its shader without a value, which nobody sees before the driver does.
struct Valueless;

static VALUELESS: Description = made_of_nothing("Valueless", "Lacks a value");

impl Pass for Valueless {
    fn description(&self) -> &'static Description {
        &VALUELESS
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let image = e.image("image", SIZE, Format::Rgba32Float);
        let text = "override VALUE: f32;
            @group(0) @binding(0) var image: texture_storage_2d<rgba32float, write>;
            @compute @workgroup_size(8, 8) fn fill(@builtin(global_invocation_id) id: vec3u) { textureStore(image, id.xy, vec4f(VALUE)); }";
        e.compute_pixels(Program::own("valueless", text).bind("image", image), "fill", SIZE);
        e.output("image", Port::Image(port::Image { texture: image, channels: port::Channels::Colour }));
        Ok(())
    }
}

/// Pipelines are built on all threads, each of which has to tell.
fn refused_shader() -> Result<(), Box<dyn Error>> {
    let text = r#"Pipeline(version: 1, about: "lacks a value", source: "", nodes: [(name: "it", pass: Valueless())], outputs: { "picture": "it" })"#;
    for engine in [lent()?.engine, block_on(Engine::open())?] {
        let engine = engine.with(&Valueless);
        let stage = cornell()?;
        let plan = planned(&engine, &stage, text)?;
        let error = block_on(engine.run(&stage, &plan, &stage.scene.cameras[0], SIZE)).err();
        check(matches!(error, Some(RunError::Gpu(GpuError::Driver { .. }))), || format!("{error:?}"))?;
    }
    Ok(())
}

/// How far away surfaces are, by rays: of the scene, or of a part of it.
struct Depths;

static DEPTHS: Description = Description {
    name: "Depths",
    about: "How far away surfaces are",
    source: "",
    parameters: &[],
    inputs: &[],
    outputs: &[
        Output { name: "whole", about: "of the scene", kind: PortKind::Image },
        Output { name: "simple", about: "of its part `simple`", kind: PortKind::Image },
    ],
};

impl Pass for Depths {
    fn description(&self) -> &'static Description {
        &DEPTHS
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let text = "#import lib/closest_hit\n#import lib/pixel\n
            @group(0) @binding(0) var depth: texture_storage_2d<rgba32float, write>;
            @compute @workgroup_size(8, 8) fn measure(@builtin(global_invocation_id) id: vec3u) {
                if any(id.xy >= camera.size) { return; }
                let hit = nearest_hit(camera.eye, normalize(pixel_ray(id.xy)), FAR_AWAY, false);
                if hit.triangle == NO_TRIANGLE { textureStore(depth, id.xy, vec4f(0.0)); return; }
                textureStore(depth, id.xy, vec4f(distance(surface_in_pixel(hit.triangle, id.xy).position, camera.eye)));
            }";
        // A part that is not there is refused in words.
        e.data_of_part("simple", SceneData::Corners)?;
        for (name, part) in [("whole", None), ("simple", Some("simple"))] {
            let image = e.image(name, SIZE, Format::Rgba32Float);
            let program = scene_constants(Program::own("depths", text), e.setting.needs).bind("depth", image);
            e.compute_pixels(part.into_iter().fold(program, Program::of_part), "measure", SIZE);
            e.output(name, Port::Image(port::Image { texture: image, channels: port::Channels::Single }));
        }
        Ok(())
    }
}

const BOTH_DEPTHS: &str = r#"Pipeline(version: 1, about: "two depths", source: "", nodes: [(name: "it", pass: Depths()), (name: "gbuffer", pass: GBuffer()),
    (name: "image", pass: Composite(gbuffer: "gbuffer"))], outputs: { "picture": "image", "whole": "it.whole", "simple": "it.simple" })"#;

/// A ball of 20,480 triangles beside one of a tenth of them, which both are moved, over a floor that stays.
fn part() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("ball.ron");
    let text = r#"Scene(version: 1, geometry: [Quad(corners: ((-9, -1, 9), (9, -1, 9), (9, -1, -9), (-9, -1, -9)), material: "grey"),
        Place(name: "ball", of: [Sphere(centre: (0, 0, 0), radius: 1, subdivisions: 5, material: "grey")])],
        materials: { "grey": Diffuse(reflectance: (0.5, 0.5, 0.5)) }, environment: Constant((1, 1, 1)),
        cameras: { "main": (eye: (0, 1, 4), target: (0, 0, 0), fov: 60) })"#;
    std::fs::write(&file, text)?;
    let scene = load(&file, &LoadOptions::default())?;
    let Simplified { scene: simple, error } = scene.simplified(0.1).ok_or("it is not simplified")?;
    check(simple.triangles.len() * 9 < scene.triangles.len() && error > 0.0, || format!("{} triangles, error {error}", simple.triangles.len()))?;
    let engine = block_on(Engine::open())?.with(&Depths);
    let pipeline = pipeline(&engine, BOTH_DEPTHS)?;
    let alone = Stage::moving(scene.clone(), &[0])?;
    let refused = engine.plan(&pipeline, &alone, SIZE).err().map(|error| error.to_string()).unwrap_or_default();
    check(refused.contains("the scene has no part `simple`"), || refused.clone())?;
    let other = Stage::moving(
        hemisplat::Scene { lights: vec![], environment: hemisplat::scene::Environment::Constant(glam::Vec3::ONE * 2.0), ..simple.clone() },
        &[0],
    )?;
    let refused = alone.clone().with_part("simple", other).err().map(|error| error.to_string()).unwrap_or_default();
    check(refused == "`simple` is no part of the scene: it has another environment", || refused)?;

    let stage = Arc::new(alone.with_part("simple", Stage::moving(simple, &[0])?)?);
    let plan = engine.plan(&pipeline, &stage, SIZE)?;
    let mut run = block_on(engine.run(&stage, &plan, &stage.scene.cameras[0], SIZE))?;
    let mut seen = Vec::new();
    for to in [0.0, 0.8] {
        let map = glam::DAffine3::from_translation(glam::DVec3::X * to);
        block_on(engine.change(&mut run, &pipeline, &[Change::Place { mover: 0, map }]))?;
        let layers = drawn(&mut run)?;
        let depths = |name: &str| layers.layers[name].channels.values().next().cloned().ok_or("no depth");
        let (whole, simple) = (depths("whole")?, depths("simple")?);
        // But for outlines, where one of them sees the floor.
        let apart: Vec<f32> = whole.iter().zip(&simple).map(|(a, b)| (a - b).abs()).collect();
        let far = apart.iter().filter(|apart| **apart > 4.0 * error).count();
        let differ = apart.iter().filter(|apart| **apart > 0.0).count();
        check(differ > 100 && far < 20, || format!("{differ} of {} depths differ, {far} of them far", apart.len()))?;
        seen.push(simple);
    }
    check(seen[0] != seen[1], || "the part has not moved".into())
}

fn lost_device() -> Result<(), Box<dyn Error>> {
    let Lent { engine, device } = lent()?;
    let mut run = ready(&engine, IRRADIANCE)?;
    drawn(&mut run)?;
    device.destroy();
    let error = drawn(&mut run).err();
    check(matches!(error, Some(RunError::Gpu(GpuError::Lost { .. } | GpuError::Driver { .. }))), || format!("{error:?}"))?;
    // Another device goes on from the same scene and plan.
    let stage = cornell()?;
    let engine = block_on(Engine::open())?;
    let plan = planned(&engine, &stage, IRRADIANCE)?;
    drawn(&mut block_on(engine.run(&stage, &plan, &stage.scene.cameras[0], SIZE))?)?;
    Ok(())
}

/// As a program drops the future of a frame: here somewhere in its loops, where its pace is asked for.
/// Set where a process has little memory on purpose.
const LITTLE: &str = "HEMISPLAT_TEST_LITTLE_MEMORY";

/// A pass that keeps 16 GiB.
struct Hoarder;

static HOARDER: Description = made_of_nothing("Hoarder", "Needs a lot of memory");

impl Pass for Hoarder {
    fn description(&self) -> &'static Description {
        &HOARDER
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let image = e.image("image", SIZE, Format::Rgba32Float);
        for name in ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l", "m", "n", "o", "p"] {
            let hoard = e.history_buffer(name, 1 << 30);
            e.clear(hoard);
        }
        e.clear(image);
        e.output("image", Port::Image(port::Image { texture: image, channels: port::Channels::Colour }));
        Ok(())
    }
}

/// Where there are 8 GiB for all of a process, whose device is this machine's memory.
fn no_memory() -> Result<(), Box<dyn Error>> {
    if block_on(Gpu::open())?.adapter.kind != "software" {
        println!("a device of its own has more memory than a test can take");
        return Ok(());
    }
    let limited = "ulimit -v 8388608 && exec \"$0\" too_large";
    let output = Command::new("sh").args(["-c", limited]).arg(env::current_exe()?).env(LITTLE, "").output()?;
    let told = String::from_utf8_lossy(&output.stdout);
    check(told.contains("1 passed"), || format!("{told}{}", String::from_utf8_lossy(&output.stderr)))
}

fn too_large() -> Result<(), Box<dyn Error>> {
    let engine = block_on(Engine::open())?.with(&Hoarder);
    drawn(&mut ready(&engine, IRRADIANCE)?)?;
    let text = r#"Pipeline(version: 1, about: "hoards", source: "", nodes: [(name: "it", pass: Hoarder())], outputs: { "picture": "it" })"#;
    let stage = cornell()?;
    let plan = planned(&engine, &stage, text)?;
    let told = match block_on(engine.run(&stage, &plan, &stage.scene.cameras[0], SIZE)) {
        Err(error) => error,
        Ok(mut run) => drawn(&mut run).err().ok_or("there is room for all of it")?,
    };
    check(matches!(told, RunError::Gpu(GpuError::OutOfMemory { .. })), || format!("{told:?}"))?;
    drawn(&mut ready(&engine, IRRADIANCE)?)?;
    Ok(())
}

fn dropped_frame() -> Result<(), Box<dyn Error>> {
    for engine in [lent()?.engine, block_on(Engine::open())?] {
        let mut run = ready(&engine, IRRADIANCE)?;
        let first = drawn(&mut run)?;
        block_on(run.reset())?;
        let asked = AtomicU32::new(0);
        let pace = || if asked.fetch_add(1, Ordering::Relaxed) < 2 { Pace::GoOn } else { resume_unwind(Box::new("dropped")) };
        let dropped = catch_unwind(AssertUnwindSafe(|| block_on(run.frame(&pace))));
        check(dropped.is_err(), || "the frame was not dropped".into())?;
        check(drawn(&mut run)?.layers == first.layers, || "another picture after a frame that was dropped".into())?;
    }
    Ok(())
}

/// Frames with a full cache at 512×512: on a device that the engine opened, as the command line does, and on one that is lent to it with the features that it asks for, with
/// the picture copied to a texture there. Taken in turns.
fn costs() -> Result<(), Box<dyn Error>> {
    const LARGE: [u32; 2] = [512, 512];
    let Lent { engine: guest, device } = lent_with(Engine::features)?;
    let target = texture(&device, LARGE, wgpu::TextureFormat::Rgba32Float, wgpu::TextureUsages::COPY_DST);
    let engines = [block_on(Engine::open())?, guest];
    for (scene, name) in [("cornell", "irradiance"), ("cornell", "irradiance-device")] {
        let stage = Arc::new(Stage::new(load(Path::new(scene), &LoadOptions::default())?));
        let runs = engines.iter().map(|engine| {
            let pipeline = engine.pipeline(name, &[], &mut |_| Err(io::ErrorKind::NotFound.into()))?;
            let plan = engine.plan(&pipeline, &stage, LARGE)?;
            Ok(block_on(engine.run(&stage, &plan, &stage.scene.cameras[0], LARGE))?)
        });
        let mut runs: Vec<Run> = runs.collect::<Result<_, Box<dyn Error>>>()?;
        let mut ratios: Vec<(f64, f64)> = Vec::new();
        for turn in 0..13 {
            let mut seconds = [0.0; 2];
            // Which is first changes.
            for which in [turn % 2, 1 - turn % 2] {
                let start = std::time::Instant::now();
                block_on(runs[which].frame(&|| Pace::GoOn))?;
                if which == 1 {
                    block_on(runs[which].copy_to("picture", &target))?;
                }
                seconds[which] = start.elapsed().as_secs_f64();
            }
            // The cache fills in the first, shaders warm up in the next.
            if turn >= 4 {
                ratios.push((seconds[1] / seconds[0], seconds[0]));
            }
        }
        ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
        let at = |share: f64| ratios[(share * ratios.len() as f64) as usize].0;
        println!("{scene} by {name}: {:.3} times ({:.3} to {:.3}, the middle half) of {:.1} ms", at(0.5), at(0.25), at(0.75), 1e3 * ratios[ratios.len() / 2].1);
        check(at(0.5) < 1.05, || format!("{scene} by {name}: {:.3} times", at(0.5)))?;
    }
    Ok(())
}

fn handles() -> Result<(), Box<dyn Error>> {
    let mut run = ready(&block_on(Engine::open())?, IRRADIANCE)?;
    let first = drawn(&mut run)?;
    block_on(run.reset())?;
    let moved = std::thread::spawn(move || drawn(&mut run).map(|picture| picture.layers)).join().map_err(|_| "the thread panicked")??;
    check(moved == first.layers, || "another picture on another thread".into())
}
