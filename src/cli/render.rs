//! `hemisplat render`

use super::console::Console;
use super::dump;
use super::failure::{CommandError, Failure};
use super::interrupt;
use super::output::{PictureTarget, Target};
use super::pipeline::{load_pipeline, plan_view};
use super::scene::{SceneOptions, View};
use crate::gpu::{Gpu, GpuError, Pace};
use crate::measure::run::{FrameReport, Run, RunError, peak_host_bytes};
use crate::pipeline::Plan;
use clap::Args;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Render a scene with a pipeline
#[derive(Args)]
#[command(after_help = "Example: hemisplat render irradiance --scene cornell -o out/cornell.exr -o out/cornell.png --stats out/cornell.json

The report goes to stdout: records, time of each node, uncovered pixels.")]
pub struct Options {
    /// The pipeline: a file, or the name of one that ships
    pipeline: String,
    #[command(flatten)]
    scene: SceneOptions,
    /// Frames to render, half-open; frame N looks through the scene's camera N, or the last, unless --camera names one
    #[arg(long, value_name = "A..B", value_parser = frames)]
    frames: Option<Range<u32>>,
    /// Changes a parameter of a node; may be repeated
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    sets: Vec<String>,
    /// Loads records from this file where it exists, and saves them to it
    #[arg(long, value_name = "FILE")]
    cache: Option<PathBuf>,
    /// Fail, with status 1, when a pixel is left without a record
    #[arg(long)]
    strict: bool,
    /// Brightens PNG files by 2^EV
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_negative_numbers = true)]
    exposure: f32,
    /// Where to write: .exr, .png or .hdr; may be repeated
    #[arg(long, short, value_name = "FILE", required = true)]
    output: Vec<PathBuf>,
    /// Where to write what was measured
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
    /// Writes what this node, or node.output, made, beside the first output; may be repeated
    #[arg(long, value_name = "NODE")]
    dump: Vec<String>,
}

/// Seconds from the command to the first frame, and of what they are made.
struct StartUp {
    load: f64,
    plan: f64,
    device: f64,
    shaders: f64,
}

pub fn run(options: &Options, console: &Console) -> Result<(), Failure> {
    let sequence = options.frames.is_some();
    let frames = options.frames.clone().unwrap_or(0..1);
    let targets = frames.clone().map(|frame| Targets::new(options, sequence.then_some(frame))).collect::<Result<Vec<_>, _>>()?;
    let stats = options.stats.as_deref().map(Target::new).transpose()?;
    let pipeline = load_pipeline(&options.pipeline, &options.sets)?;

    let mut clock = Instant::now();
    let mut lap = || std::mem::replace(&mut clock, Instant::now()).elapsed().as_secs_f64();
    let view = options.scene.load(console)?;
    let load = lap();
    let plan = plan_view(&pipeline, &view, &options.dump).map_err(Failure::input)?;
    let planned = lap();
    let gpu = Gpu::open().map_err(Failure::work)?;
    let device = lap();
    let mut run = Run::new(&gpu, &view.scene, &view.bvh, &plan, &view.camera, view.size).map_err(Failure::work)?;
    if let Some(file) = options.cache.as_deref().filter(|file| file.exists()) {
        let bytes = std::fs::read(file).map_err(|error| Failure::read(file, error))?;
        run.load_cache(&view.scene, &bytes).map_err(Failure::input)?;
    }
    let start_up = StartUp { load, plan: planned, device, shaders: lap() };

    let mut reports = Vec::new();
    for (frame, targets) in frames.zip(&targets) {
        run.set_camera(options.scene.camera_of_frame(&view, frame));
        let report = run.frame(&|| if interrupt::requested() { Pace::Stop } else { Pace::GoOn }).map_err(failure)?;
        targets.write(options, &view, &plan, &run, frame)?;
        console.print(&text(options, frame, &report))?;
        warn_of_gaps(options, &report, console)?;
        reports.push(report);
    }
    if let Some(file) = &options.cache {
        Target::new(file)?.write(&run.save_cache(&view.scene).map_err(Failure::work)?)?;
    }
    if let Some(stats) = stats {
        let value = statistics(options, &view, &plan, &gpu, &run, &reports, &start_up);
        let bytes = serde_json::to_vec_pretty(&value).map_err(|e| Failure::work(CommandError::Json { reason: e.to_string() }))?;
        stats.write(&bytes)?;
    }
    Ok(())
}

fn failure(error: RunError) -> Failure {
    match error {
        RunError::Gpu(GpuError::Interrupted) => Failure::interrupted(None),
        other => Failure::work(other),
    }
}

/// Where a frame's pictures go.
struct Targets(Vec<PictureTarget>);

impl Targets {
    fn new(options: &Options, frame: Option<u32>) -> Result<Self, Failure> {
        options.output.iter().map(|path| PictureTarget::new(&numbered(path, frame))).collect::<Result<_, _>>().map(Self)
    }

    fn write(&self, options: &Options, view: &View, plan: &Plan, run: &Run<'_>, frame: u32) -> Result<(), Failure> {
        let mut picture = run.picture().map_err(Failure::work)?;
        picture.attributes = attributes(options, view, plan, frame);
        self.0.iter().try_for_each(|target| target.write(&picture, options.exposure))?;
        let Some(first) = self.0.first() else { return Ok(()) };
        options.dump.iter().try_for_each(|name| dump::write(name, plan, run, first.path()))
    }
}

/// `out.exr` as `out.0007.exr`.
fn numbered(path: &Path, frame: Option<u32>) -> PathBuf {
    match (frame, path.extension()) {
        (Some(frame), Some(ending)) => path.with_extension(format!("{frame:04}.{}", ending.to_string_lossy())),
        _ => path.to_owned(),
    }
}

/// Enough to make the picture again.
fn attributes(options: &Options, view: &View, plan: &Plan, frame: u32) -> BTreeMap<String, String> {
    let mut attributes = options.scene.attributes(view);
    let own = [
        ("command", "render".to_owned()),
        ("pipeline", plan.pipeline.clone()),
        ("set", options.sets.join(" ")),
        ("frame", frame.to_string()),
        ("bounces", "1".to_owned()),
        ("stride", "1".to_owned()),
    ];
    attributes.extend(own.map(|(name, value)| (name.to_owned(), value)));
    attributes
}

fn warn_of_gaps(options: &Options, report: &FrameReport, console: &Console) -> Result<(), Failure> {
    let uncovered = report.uncovered_pixels.unwrap_or(0);
    if report.non_finite_pixels.unwrap_or(0) > 0 {
        return Err(Failure::work(RunError::NonFinite { layer: "splats".into(), pixels: report.non_finite_pixels.unwrap_or(0) }));
    }
    if uncovered == 0 && report.complete {
        return Ok(());
    }
    let gap = CommandError::Incomplete { pixels: uncovered };
    if options.strict {
        return Err(Failure::work(gap));
    }
    console.report(&gap);
    Ok(())
}

/// The report of a frame for people.
fn text(options: &Options, frame: u32, report: &FrameReport) -> String {
    let mut text = format!("{} frame {frame}: {:.3} s", options.pipeline, report.seconds);
    let numbers = [
        ("records", report.records.irradiance),
        ("new", report.new_records),
        ("surplus", report.surplus_records),
        ("rounds", report.fill_rounds),
        ("uncovered pixels", report.uncovered_pixels),
    ];
    for (name, number) in numbers {
        if let Some(number) = number {
            text += &format!(", {number} {name}");
        }
    }
    text += &format!("\n  {:<14} {:<16} {:>10} {:>10} {:>6}\n", "node", "pass", "device ms", "host ms", "runs");
    for pass in &report.passes {
        let gpu = pass.gpu_ms.map_or("-".to_owned(), |ms| format!("{ms:.1}"));
        text += &format!("  {:<14} {:<16} {:>10} {:>10.1} {:>6}\n", pass.node, pass.pass, gpu, pass.cpu_ms, pass.runs);
    }
    text
}

fn statistics(options: &Options, view: &View, plan: &Plan, gpu: &Gpu, run: &Run<'_>, frames: &[FrameReport], start_up: &StartUp) -> Value {
    let complete = frames.iter().all(|f| f.complete && f.uncovered_pixels.unwrap_or(0) == 0);
    let dropped: Vec<Value> = plan.dropped.iter().map(|d| json!({ "node": d.node, "because": d.because })).collect();
    let peak_host_bytes = std::fs::read_to_string("/proc/self/status").ok().and_then(|status| peak_host_bytes(&status));
    json!({
        "schema": 1,
        "pipeline": plan.pipeline,
        "set": options.sets,
        "scene": view.scene.name,
        "triangles": view.scene.triangles.len(),
        "adapter": { "name": gpu.adapter.name, "backend": gpu.adapter.backend, "driver": gpu.adapter.driver },
        "size": view.size,
        "complete": complete,
        "frames": frames,
        "start_up": {
            "load_seconds": start_up.load,
            "plan_seconds": start_up.plan,
            "device_seconds": start_up.device,
            "shaders_seconds": start_up.shaders,
        },
        "peak_gpu_bytes": run.gpu_bytes(),
        "peak_host_bytes": peak_host_bytes,
        "plan": { "dropped": dropped },
    })
}

fn frames(text: &str) -> Result<Range<u32>, String> {
    let range = text.split_once("..").and_then(|(a, b)| Some(a.parse().ok()?..b.parse().ok()?));
    range.filter(|r: &Range<u32>| r.start < r.end && r.end - r.start <= 100_000).ok_or_else(|| "expected A..B with A < B, such as 0..4".to_owned())
}
