//! What one adapter makes of it: each pass beside what the hardware could move, frames a second, device time of few records, and pictures of all bounces.
//!
//! `./bench device` builds and runs it on the adapter that `hemisplat adapters` names first, or that `WGPU_ADAPTER_NAME` asks for;
//! docs/device.md tells what came of it.

#[allow(dead_code, reason = "only parts of the race's modules are of use here")]
#[path = "../race/kept.rs"]
mod kept;
#[allow(dead_code, reason = "as above")]
#[path = "../race/machine.rs"]
mod machine;
mod peak;

use clap::Parser;
use hemisplat::{
    block_on,
    contract::encoder::Setting,
    gpu::{Gpu, Pace, scene::kind},
    measure::{
        run::{FrameReport, Run},
        statistics::Spread,
        traffic::{tiles, traffic},
    },
    passes::REGISTRY,
    pipeline::{Plan, load as load_pipeline, plan},
    scene::{
        load::{LoadOptions, load},
        needs::Needs,
        stage,
    },
    schedule::{Command, Draws, Schedule},
};
use kept::write;
use peak::Peak;
use serde::Serialize;
use std::{
    collections::BTreeSet,
    fmt::Write,
    path::{Path, PathBuf},
    process::ExitCode,
    sync::Arc,
};

type Failure = Box<dyn std::error::Error>;

/// Measure what one adapter makes of Sibenik: each pass beside the hardware's limits, frames a second, and pictures of all bounces
#[derive(Parser)]
#[command(name = "./bench device")]
struct Options {
    /// Runs of which the median counts
    #[arg(long, default_value = "3", value_parser = clap::value_parser!(u32).range(1..))]
    runs: u32,
    /// Where results go
    #[arg(short, long, default_value = "benches/results")]
    out: PathBuf,
    /// Write the tables here too
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// The other benchmarks time a program of its own; this one is one
    #[arg(long, hide = true)]
    program: Option<PathBuf>,
    /// What `cargo bench` says
    #[arg(long, hide = true)]
    bench: bool,
}

/// Keys in JSON are the fields' names.
#[derive(Debug, Serialize)]
struct Report {
    /// Version of this record: 2, which has `pictures` and `interactive.moving`.
    schema: u32,
    date: String,
    commit: String,
    /// Those of benches/changes.ron that this program has.
    changes: Vec<String>,
    /// Name, kind, backend and driver.
    adapter: hemisplat::gpu::device::Adapter,
    cores: usize,
    peak: Peak,
    scene: String,
    triangles: usize,
    still: Work,
    few: Work,
    passes: Vec<Pass>,
    interactive: Interactive,
    /// Of all bounces.
    pictures: Vec<Picture>,
}

#[derive(Debug, Serialize)]
struct Picture {
    scene: &'static str,
    pipeline: &'static str,
    /// In words, as tables have it.
    setting: &'static str,
    #[serde(flatten)]
    work: Work,
}

/// A picture from an empty cache: medians over the runs.
#[derive(Debug, Serialize)]
struct Work {
    size: [u32; 2],
    set: Vec<String>,
    records: u32,
    seconds: f64,
    /// Of all passes; None where the adapter has no timestamps.
    device_seconds: Option<f64>,
}

/// A node of the still picture.
#[derive(Debug, Serialize)]
struct Pass {
    node: String,
    runs: u32,
    device_ms: Option<f64>,
    host_ms: f64,
    /// At most: what the commands bind, each byte once a command; None for rasters.
    moved_bytes: Option<f64>,
    /// Drawn by rasters, before anything is clipped or culled.
    triangles: Option<f64>,
    /// Of the bytes that the device could have copied in this time; None where the bound says nothing.
    share_of_bandwidth: Option<f64>,
    bound_by: &'static str,
}

#[derive(Debug, Serialize)]
struct Interactive {
    size: [u32; 2],
    set: Vec<String>,
    /// Frames a second of one view, all records being there.
    full: f64,
    /// Frames a second that add this many records each.
    adding: f64,
    added: u32,
    /// Frames a second while the camera moves forward, records being kept and made where new surfaces come into view.
    moving: f64,
}

struct Stage(Arc<stage::Stage>);

const PIPELINE: &str = "irradiance";
const STILL: u32 = 1000;
const SMALL: u32 = 512;
/// Some 4,000 records: details and contacts, which ask for more, are passed over.
const FEW: [&str; 6] =
    ["cache.accuracy=0.5", "cache.contrast=1e6", "cache.nearest=1e6", "cache.change=1e6", "cache.minimum_spacing=26", "cache.maximum_spacing=80"];
const INTERACTIVE: [&str; 1] = ["cache.accuracy=0.5"];
const ADDED: u32 = 100;
/// Frames of one view that are timed.
const FRAMES: usize = 10;
/// How far the camera moves from a frame to the next [extents of the scene].
const STEP: f32 = 0.002;

/// Pictures of all bounces: scenes, pipeline, setting in words, size, parameters. Those of the halls are settings of the race (benches/race-bounces.ron), by which
/// their errors are known.
type Pictured = (&'static [&'static str], &'static str, &'static str, u32, &'static [&'static str]);
const HALLS: &[&str] = &["sibenik", "sponza"];
const PICTURES: [Pictured; 9] = [
    (HALLS, "irradiance-bounces", "as it ships", STILL, &[]),
    (HALLS, "irradiance-bounces", "24×24 and 12×12 rays", STILL, &["tiles.resolution=24", "detail_tiles.resolution=12"]),
    (
        HALLS,
        "irradiance-bounces",
        "16×16 and 8×8, spacings from 8 pixels",
        STILL,
        &["tiles.resolution=16", "detail_tiles.resolution=8", "cache.minimum_spacing=8", "cache.finest_spacing=2"],
    ),
    (
        HALLS,
        "irradiance-bounces",
        "12×12 and 6×6, spacings from 8 to 20 pixels, 6,144 deep records",
        STILL,
        &[
            "tiles.resolution=12",
            "detail_tiles.resolution=6",
            "cache.minimum_spacing=8",
            "cache.maximum_spacing=20",
            "cache.finest_spacing=2",
            "deep_places.records=6144",
            "deep_places.paths=32768",
        ],
    ),
    (
        HALLS,
        "irradiance-bounces",
        "10×10 and 6×6, spacings from 32 pixels, 4,096 deep records",
        STILL,
        &[
            "tiles.resolution=10",
            "detail_tiles.resolution=6",
            "cache.minimum_spacing=32",
            "cache.maximum_spacing=48",
            "cache.finest_spacing=8",
            "cache.contrast=2",
            "deep_places.records=4096",
            "deep_places.paths=32768",
        ],
    ),
    (HALLS, "photon-gather", "as it ships", STILL, &[]),
    (&["cornell"], "irradiance-bounces", "as it ships", SMALL, &[]),
    (&["balls", "ring"], "radiance-bounces", "as it ships", SMALL, &[]),
    (&["castle"], "radiance-bounces", "as it ships", STILL, &[]),
];

impl Stage {
    fn open(name: &str) -> Result<Self, Failure> {
        let scene = load(&machine::root().join(format!("scenes/{name}.ron")), &LoadOptions::default().with_environment()).map_err(|e| e.to_string())?;
        Ok(Self(Arc::new(stage::Stage::new(scene))))
    }

    fn plan(&self, sets: &[String], edge: u32) -> Result<Arc<Plan>, Failure> {
        self.plan_of(PIPELINE, sets, edge)
    }

    fn plan_of(&self, pipeline: &str, sets: &[String], edge: u32) -> Result<Arc<Plan>, Failure> {
        let pipeline = load_pipeline(pipeline, sets, REGISTRY, &mut |path| std::fs::read_to_string(path)).map_err(|e| e.to_string())?;
        let needs = Needs::of(&self.0.scene);
        let setting = Setting { scene: &self.0.scene, needs: &needs, device: hemisplat::gpu::expected_device(), size: [edge, edge], tables: None };
        Ok(plan(&pipeline, setting, &[], &kind).map_err(|e| e.to_string())?)
    }

    fn run(&self, gpu: &Arc<Gpu>, plan: &Arc<Plan>, edge: u32) -> Result<Run, Failure> {
        Ok(block_on(Run::new(gpu, &self.0, plan, &self.0.scene.cameras[0], [edge, edge]))?)
    }

    /// Pictures from empty caches; the first one compiles and does not count.
    fn pictures(&self, gpu: &Arc<Gpu>, plan: &Arc<Plan>, edge: u32, runs: u32) -> Result<Vec<FrameReport>, Failure> {
        let mut run = self.run(gpu, plan, edge)?;
        let mut reports = Vec::new();
        for _ in 0..=runs {
            block_on(run.reset())?;
            reports.push(block_on(run.frame(&|| Pace::GoOn))?);
        }
        reports.remove(0);
        Ok(reports)
    }

    fn interactive(&self, gpu: &Arc<Gpu>) -> Result<Interactive, Failure> {
        let set: Vec<String> = INTERACTIVE.map(String::from).into();
        let bounded: Vec<String> = set.iter().cloned().chain([format!("misses.at_most={ADDED}")]).collect();
        let (whole, bounded) = (self.plan(&set, SMALL)?, self.plan(&bounded, SMALL)?);
        let full = self.frames(gpu, &whole)?;
        let mut adding = self.frames(gpu, &bounded)?;
        adding.retain(|frame| frame.new_records == Some(ADDED));
        let moving = self.moving_frames(gpu, &whole)?;
        Ok(Interactive { size: [SMALL; 2], set, full: rate(&full), adding: rate(&adding), added: ADDED, moving: rate(&moving) })
    }

    /// Frames while the camera moves; those of the first view do not count.
    fn moving_frames(&self, gpu: &Arc<Gpu>, plan: &Arc<Plan>) -> Result<Vec<FrameReport>, Failure> {
        let mut run = self.run(gpu, plan, SMALL)?;
        (0..2).try_for_each(|_| block_on(run.frame(&|| Pace::GoOn)).map(drop))?;
        let mut camera = self.0.scene.cameras[0].clone();
        let step = STEP * self.0.scene.extent() * camera.direction;
        let mut frame = |_| {
            camera.eye += step;
            run.set_camera(&camera);
            Ok(block_on(run.frame(&|| Pace::GoOn))?)
        };
        (0..FRAMES).map(&mut frame).collect()
    }

    /// Frames of one view, one after another; the first one compiles and does not count.
    fn frames(&self, gpu: &Arc<Gpu>, plan: &Arc<Plan>) -> Result<Vec<FrameReport>, Failure> {
        let mut run = self.run(gpu, plan, SMALL)?;
        block_on(run.frame(&|| Pace::GoOn))?;
        (0..FRAMES).map(|_| Ok(block_on(run.frame(&|| Pace::GoOn))?)).collect()
    }
}

/// Each scene is loaded once.
fn pictures(gpu: &Arc<Gpu>, runs: u32) -> Result<Vec<Picture>, Failure> {
    let scenes: BTreeSet<&str> = PICTURES.iter().flat_map(|(scenes, ..)| scenes.iter().copied()).collect();
    let mut made = Vec::new();
    for scene in scenes {
        let stage = Stage::open(scene)?;
        for (_, pipeline, setting, edge, sets) in PICTURES.iter().filter(|(scenes, ..)| scenes.contains(&scene)) {
            let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
            let plan = stage.plan_of(pipeline, &sets, *edge)?;
            let reports = stage.pictures(gpu, &plan, *edge, runs)?;
            made.push(Picture { scene, pipeline, setting, work: work(&reports, *edge, &sets) });
        }
    }
    Ok(made)
}

/// Frames a second, by the median of their seconds.
fn rate(frames: &[FrameReport]) -> f64 {
    1.0 / median(frames.iter().map(|frame| frame.seconds))
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    Spread::of(&values.collect::<Vec<_>>()).map_or(f64::NAN, |spread| spread.median)
}

fn work(reports: &[FrameReport], edge: u32, set: &[String]) -> Work {
    let on_device = |report: &FrameReport| report.passes.iter().map(|pass| pass.gpu_ms).sum::<Option<f64>>();
    let device: Option<Vec<f64>> = reports.iter().map(on_device).collect();
    Work {
        size: [edge; 2],
        set: set.to_vec(),
        records: reports.first().and_then(|report| report.records.irradiance).unwrap_or(0),
        seconds: median(reports.iter().map(|report| report.seconds)),
        device_seconds: device.map(|all| median(all.into_iter().map(|ms| ms * 1e-3))),
    }
}

/// Triangles that a run of a node draws.
fn triangles(schedule: &Schedule, node: &str) -> Option<f64> {
    let commands = schedule.nodes().into_iter().filter(|found| found.name == node).flat_map(|found| &found.commands);
    let drawn: Vec<f64> = commands
        .filter_map(|command| match command {
            Command::Raster(raster) => match &raster.draws {
                Draws::Fixed(draws) => Some(draws.iter().map(|d| f64::from((d.vertices[1] - d.vertices[0]) / 3 * (d.instances[1] - d.instances[0]))).sum()),
                _ => None,
            },
            _ => None,
        })
        .collect();
    (!drawn.is_empty()).then(|| drawn.iter().sum())
}

fn pass(reports: &[FrameReport], index: usize, plan: &Plan, peak: &Peak) -> Result<Pass, Failure> {
    let all = || reports.iter().map(|report| &report.passes[index]);
    let first = &reports[0].passes[index];
    let device_ms = all().map(|pass| pass.gpu_ms).collect::<Option<Vec<_>>>().map(|all| median(all.into_iter()));
    let host_ms = median(all().map(|pass| pass.cpu_ms));
    let moved = traffic(plan, &[first.node.as_str()])?.zip(tiles(plan));
    let moved_bytes = moved.map(|(traffic, tiles)| (traffic.read_bytes + traffic.written_bytes) * tiles * f64::from(first.runs));
    let share = moved_bytes.zip(device_ms).map(|(bytes, ms)| bytes / (ms * 1e-3).max(1e-9) / peak.bytes_per_second);
    // More than the device can move: the node touches a part of what it binds.
    let share_of_bandwidth = share.filter(|share| *share <= 1.0);
    let bound_by = match (device_ms, share_of_bandwidth) {
        (Some(ms), _) if host_ms > ms => "host",
        (_, Some(share)) if share > 0.5 => "memory",
        _ if first.pass == "HemisphereTiles" => "rays or triangles",
        _ => "instructions or waiting",
    };
    let drawn = triangles(&plan.schedule, &first.node).map(|triangles| triangles * f64::from(first.runs));
    Ok(Pass { node: first.node.clone(), runs: first.runs, device_ms, host_ms, moved_bytes, triangles: drawn, share_of_bandwidth, bound_by })
}

fn measure(options: &Options) -> Result<Report, Failure> {
    let (commit, changes) = (machine::clean_commit()?, machine::changes()?);
    let gpu = block_on(Gpu::open())?;
    let stage = Stage::open("sibenik")?;
    let peak = Peak::measure(&gpu)?;
    let still = stage.plan(&[], STILL)?;
    let stills = stage.pictures(&gpu, &still, STILL, options.runs)?;
    let passes = (0..stills[0].passes.len()).map(|index| pass(&stills, index, &still, &peak)).collect::<Result<_, _>>()?;
    let set: Vec<String> = FEW.map(String::from).into();
    let few = stage.plan(&set, STILL)?;
    let fews = stage.pictures(&gpu, &few, STILL, options.runs)?;
    Ok(Report {
        schema: 2,
        date: machine::date()?,
        commit,
        changes,
        adapter: gpu.adapter.clone(),
        cores: std::thread::available_parallelism().map_or(1, |count| count.get()),
        peak,
        scene: stage.0.scene.name.clone(),
        triangles: stage.0.scene.triangles.len(),
        still: work(&stills, STILL, &[]),
        few: work(&fews, STILL, &set),
        passes,
        interactive: stage.interactive(&gpu)?,
        pictures: pictures(&gpu, options.runs)?,
    })
}

/// As people read it, in Markdown.
fn tables(report: &Report) -> Result<String, Failure> {
    let mut text = String::new();
    let adapter = &report.adapter;
    writeln!(
        text,
        "{}: {} ({}, {}, {}), {} cores; copies {:.1} GB/s, multiplies and adds {:.0} Gflop/s.\n",
        report.date,
        adapter.name,
        adapter.kind,
        adapter.backend,
        adapter.driver,
        report.cores,
        report.peak.bytes_per_second * 1e-9,
        report.peak.flops * 1e-9
    )?;
    writeln!(text, "| picture | records | seconds | on the device |\n|---|---|---|---|")?;
    for (name, work) in [("as it ships", &report.still), ("few records", &report.few)] {
        writeln!(text, "| {name}, {0}×{0} | {1} | {2:.3} | {3} |", work.size[0], work.records, work.seconds, told(work.device_seconds, |s| format!("{s:.3}")))?;
    }
    let interactive = &report.interactive;
    writeln!(
        text,
        "\nFrames a second at {0}×{0}: {1:.1} of one view, {2:.1} with {3} new records each, {4:.1} while the camera moves.\n",
        interactive.size[0], interactive.full, interactive.adding, interactive.added, interactive.moving
    )?;
    writeln!(text, "| scene | pipeline | setting | records | seconds | on the device |\n|---|---|---|---|---|---|")?;
    for Picture { scene, pipeline, setting, work } in &report.pictures {
        let on_device = told(work.device_seconds, |s| format!("{s:.3}"));
        writeln!(text, "| {scene}, {0}×{0} | `{pipeline}` | {setting} | {1} | {2:.3} | {on_device} |", work.size[0], work.records, work.seconds)?;
    }
    writeln!(text)?;
    writeln!(text, "| node | runs | device ms | host ms | GB moved, at most | triangles | of the bandwidth | bound by |\n|---|---|---|---|---|---|---|---|")?;
    for pass in &report.passes {
        writeln!(
            text,
            "| {} | {} | {} | {:.1} | {} | {} | {} | {} |",
            pass.node,
            pass.runs,
            told(pass.device_ms, |ms| format!("{ms:.1}")),
            pass.host_ms,
            told(pass.moved_bytes, |bytes| format!("{:.2}", bytes * 1e-9)),
            told(pass.triangles, |count| format!("{count:.0}")),
            told(pass.share_of_bandwidth, |share| format!("{:.0} %", share * 100.0)),
            pass.bound_by
        )?;
    }
    Ok(text)
}

fn told(value: Option<f64>, write: impl Fn(f64) -> String) -> String {
    value.map_or("–".into(), write)
}

fn run(options: &Options) -> Result<(), Failure> {
    let report = measure(options)?;
    let tables = tables(&report)?;
    println!("{tables}");
    let slug: String = report.adapter.name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect();
    let name = slug.split('-').filter(|part| !part.is_empty()).take(4).collect::<Vec<_>>().join("-");
    write(&options.out.join(format!("{}-device-{name}.json", report.date)), &serde_json::to_string_pretty(&report)?)?;
    options.markdown.as_deref().map_or(Ok(()), |file: &Path| write(file, &tables))
}

fn main() -> ExitCode {
    machine::ended(run(&Options::parse()))
}
