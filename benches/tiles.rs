//! What tiles and splats cost: tiles a second for each shape, way and size of scene, shading included, and seconds for
//! splatting a number of records onto 1000×1000 pixels.
//!
//! `cargo bench --bench tiles -- --json FILE`. Cases take turns and the median of their repeats counts, so that what
//! else the machine does falls on all of them. The largest scene is Sibenik, which `HEMISPLAT_SCENES` has to lead to;
//! without it the case is named as skipped.

use clap::Parser;
use hemisplat::{
    block_on,
    contract::encoder::Setting,
    gpu::{Gpu, Pace, scene::kind},
    measure::run::{FrameReport, Run},
    passes::REGISTRY,
    pipeline::{Plan, load as load_pipeline, plan},
    scene::{
        load::{LoadOptions, load},
        needs::Needs,
        stage,
    },
};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Shape and way of every kind of tile.
const TILES: [(&str, &str); 8] = [
    ("Cosine", "Device"),
    ("Concentric", "Device"),
    ("Plane", "Device"),
    ("Plane", "Raster"),
    ("Hemicube", "Device"),
    ("Hemicube", "Raster"),
    ("Hemispherical", "Device"),
    ("Hemispherical", "Raster"),
];
/// Scenes by the triangles asked of their generator, and Sibenik's file.
const SCENES: [(&str, Option<u32>); 3] = [("hall", Some(1000)), ("hall", Some(8640)), ("sibenik", None)];
/// Edge of the picture whose records the tiles are of [pixels].
const SMALL: u32 = 64;
/// Edge of the picture that is splatted onto [pixels].
const LARGE: u32 = 1000;
/// Numbers of records, and the accuracy and least spacing with which about so many cover the picture.
const SPLATS: [(u32, &str, &str); 4] = [(100, "3", "2"), (1000, "1", "2"), (4000, "0.4", "2"), (100_000, "0.05", "0.5")];

type Failure = Box<dyn std::error::Error>;
type Measure<'s> = Box<dyn Fn(&Arc<Gpu>) -> Result<f64, Failure> + 's>;

#[derive(Parser)]
struct Options {
    /// Runs of every case
    #[arg(long, default_value_t = 3)]
    repeats: usize,
    /// Only cases whose names hold this
    #[arg(long, default_value = "")]
    only: String,
    /// Where to write what was measured
    #[arg(long)]
    json: Option<PathBuf>,
    /// What `cargo bench` says
    #[arg(long, hide = true)]
    bench: bool,
}

struct Stage(Arc<stage::Stage>);

impl Stage {
    fn open(name: &str, triangles: Option<u32>) -> Result<Self, Failure> {
        let overrides = triangles.map(|count| ("triangles".to_owned(), count.to_string())).into_iter().collect();
        let options = LoadOptions { overrides, ..Default::default() }.with_environment();
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{name}.ron"));
        let scene = load(&path, &options).map_err(|e| e.to_string())?;
        Ok(Self(Arc::new(stage::Stage::new(scene))))
    }

    fn plan(&self, sets: &[String], edge: u32) -> Result<Arc<Plan>, Failure> {
        let pipeline = load_pipeline("irradiance", sets, REGISTRY, &mut |path| std::fs::read_to_string(path)).map_err(|e| e.to_string())?;
        let needs = Needs::of(&self.0.scene);
        let setting = Setting { scene: &self.0.scene, needs: &needs, device: hemisplat::gpu::expected_device(), size: [edge, edge], tables: None };
        Ok(plan(&pipeline, setting, &[], &kind).map_err(|e| e.to_string())?)
    }

    /// Reports of this many frames of one run, each after what the one before it left.
    fn frames(&self, gpu: &Arc<Gpu>, plan: &Arc<Plan>, edge: u32, count: usize) -> Result<Vec<FrameReport>, Failure> {
        let mut run = block_on(Run::new(gpu, &self.0, plan, &self.0.scene.cameras[0], [edge, edge]))?;
        (0..count).map(|_| Ok(block_on(run.frame(&|| Pace::GoOn))?)).collect()
    }
}

/// One row of the result and how to measure it once.
struct Case<'s> {
    name: String,
    facts: Value,
    /// What the number is called, its unit included.
    unit: &'static str,
    measure: Measure<'s>,
}

/// Seconds that a node took on the device and on the host.
fn seconds(report: &FrameReport, node: &str) -> f64 {
    report.passes.iter().filter(|pass| pass.node == node).map(|pass| (pass.gpu_ms.unwrap_or(0.0) + pass.cpu_ms) * 1e-3).sum()
}

/// What makes a node work this way: the side that does it, or an algorithm.
fn way(node: &str, way: &str) -> String {
    let parameter = if ["Host", "Device"].contains(&way) { "place" } else { "by" };
    format!("{node}.{parameter}={way}")
}

fn tile_case<'s>(stage: &'s Stage, (shape, by): (&str, &str)) -> Result<Case<'s>, Failure> {
    let shaped = if shape == "Plane" { "Plane(fov: 126.87)" } else { shape };
    let plan = stage.plan(&[format!("tiles.shape={shaped}"), way("tiles", by)], SMALL)?;
    let triangles = stage.0.scene.triangles.len();
    let measure = move |gpu: &Arc<Gpu>| {
        let report = stage.frames(gpu, &plan, SMALL, 1)?.remove(0);
        Ok(f64::from(report.records.irradiance.unwrap_or(0)) / seconds(&report, "tiles"))
    };
    Ok(Case {
        name: format!("tiles {shape} {by} {triangles}"),
        facts: json!({ "shape": shape, "by": by, "triangles": triangles, "resolution": 64 }),
        unit: "tiles_per_second",
        measure: Box::new(measure),
    })
}

/// The first frame finds the records, with small tiles; the second splats them all at once.
fn splat_case<'s>(stage: &'s Stage, by: &str, (records, accuracy, spacing): (u32, &str, &str)) -> Result<Case<'s>, Failure> {
    let sets = [
        way("splats", by),
        "tiles.resolution=4".into(),
        format!("cache.capacity={records}"),
        format!("cache.accuracy={accuracy}"),
        format!("cache.minimum_spacing={spacing}"),
    ];
    let plan = stage.plan(&sets, LARGE)?;
    let measure = move |gpu: &Arc<Gpu>| Ok(stage.frames(gpu, &plan, LARGE, 2)?.last().map_or(0.0, |report| seconds(report, "splats")));
    Ok(Case {
        name: format!("splats {by} {records}"),
        facts: json!({ "by": by, "records": records, "triangles": stage.0.scene.triangles.len(), "size": [LARGE, LARGE] }),
        unit: "seconds",
        measure: Box::new(measure),
    })
}

fn cases<'s>(stages: &'s [Stage], only: &str) -> Result<Vec<Case<'s>>, Failure> {
    let mut cases = Vec::new();
    for stage in stages {
        for tile in TILES {
            cases.push(tile_case(stage, tile)?);
        }
    }
    if let Some(largest) = stages.last() {
        for splat in SPLATS {
            for by in ["RasterBlend", "ComputeTiles"] {
                cases.push(splat_case(largest, by, splat)?);
            }
        }
    }
    cases.retain(|case| case.name.contains(only));
    Ok(cases)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() -> Result<(), Failure> {
    let options = Options::parse();
    let gpu = block_on(Gpu::open())?;
    let mut stages = Vec::new();
    for (name, triangles) in SCENES {
        match Stage::open(name, triangles) {
            Ok(stage) => stages.push(stage),
            Err(reason) => println!("SKIPPED: {name}: {reason}"),
        }
    }
    let cases = cases(&stages, &options.only)?;
    let mut measured = vec![Vec::new(); cases.len()];
    for _ in 0..options.repeats.max(1) {
        for (case, values) in cases.iter().zip(&mut measured) {
            values.push((case.measure)(&gpu)?);
        }
    }
    let mut rows = Vec::new();
    for (case, values) in cases.iter().zip(measured) {
        let value = median(values);
        println!("{:<40} {value:>10.3} {}", case.name, case.unit.replace('_', " "));
        let mut row = case.facts.clone();
        row[case.unit] = json!(value);
        rows.push(row);
    }
    if let Some(file) = options.json {
        let adapter = json!({ "name": gpu.adapter.name, "driver": gpu.adapter.driver });
        let cores = std::thread::available_parallelism().map_or(1, |count| count.get());
        let result = json!({ "schema": 1, "adapter": adapter, "cores": cores, "repeats": options.repeats, "cases": rows });
        std::fs::write(file, serde_json::to_vec_pretty(&result)?)?;
    }
    Ok(())
}
