//! What ships, on real halls: how far the default is from the truth, in every layer that it computes, and what it takes. The truth was traced by
//! `hemisplat reference --scene SCENE --size 250x250 --windows 6 --spp 2048`; limits are a tenth above what was seen when they were set.
//!
//! `HEMISPLAT_TOLD=1 cargo test --test halls -- --nocapture --test-threads 1` prints what is seen, for new limits. A limit is raised only with a reason in the
//! commit. The halls are looked for in `HEMISPLAT_SCENES`; without them, or without an adapter, the cases are named as skipped, which
//! `HEMISPLAT_REQUIRE=scenes` and `HEMISPLAT_REQUIRE=gpu` make a failure.

mod skips;

use hemisplat::{
    contract::encoder::Setting,
    gpu::{Gpu, Pace, scene::kind},
    measure::{
        Errors, Layers, compare,
        run::{FrameReport, Run},
    },
    passes::REGISTRY,
    pipeline::{Plan, load, plan},
    scene::{
        Scene,
        bvh::Bvh,
        load::{LoadOptions, load as load_scene},
        needs::Needs,
    },
    schedule::Device,
};
use libtest_mimic::{Arguments, Failed};
use skips::Missing;
use std::{env, fs, io, path::Path, sync::Arc};

type Outcome = Result<(), Failed>;

const SIZE: [u32; 2] = [250, 250];

/// What a metric of a layer may be at most, by its size.
type Limits = &'static [(&'static str, &'static str, f64)];

/// A hall, and what the default makes of it.
struct Hall {
    name: &'static str,
    limits: Limits,
    /// Records, rounds of all fills, and bytes on the device where the host fills caches and where the device does.
    records: u32,
    rounds: u32,
    bytes: [u64; 2],
}

const HALLS: [Hall; 2] = [
    Hall {
        name: "sibenik",
        limits: &[
            ("irradiance", "rmse_over_mean", 0.047),
            ("irradiance", "bias_over_mean", 0.00413),
            ("irradiance", "rms_of_relative", 0.0679),
            ("irradiance", "block_p50", 0.00939),
            ("irradiance", "block_p99", 0.0453),
            ("irradiance", "band_error", 0.0133),
            ("irradiance", "rmse_edges", 0.0541),
            ("irradiance", "rmse_interior", 0.0269),
            ("irradiance", "relmse", 0.00393),
            ("irradiance", "flip", 0.0241),
            ("irradiance", "hdr_flip", 0.0394),
            ("direct", "rmse_over_mean", 0.0826),
            ("direct", "bias_over_mean", 0.00514),
            ("direct", "rms_of_relative", 0.46),
            ("direct", "block_p50", 0.00452),
            ("direct", "block_p99", 0.195),
            ("direct", "band_error", 0.00777),
            ("direct", "rmse_edges", 0.0915),
            ("direct", "rmse_interior", 0.0391),
            ("direct", "relmse", 0.125),
            ("direct", "flip", 0.0241),
            ("direct", "hdr_flip", 0.0394),
            ("picture", "rmse_over_mean", 0.051),
            ("picture", "bias_over_mean", 0.00144),
            ("picture", "rms_of_relative", 0.113),
            ("picture", "block_p50", 0.0058),
            ("picture", "block_p99", 0.0401),
            ("picture", "band_error", 0.00746),
            ("picture", "rmse_edges", 0.0563),
            ("picture", "rmse_interior", 0.0252),
            ("picture", "relmse", 0.00858),
            ("picture", "flip", 0.0241),
            ("picture", "hdr_flip", 0.0394),
        ],
        records: 11_182,
        rounds: 32,
        bytes: [174_051_668, 225_225_648],
    },
    Hall {
        name: "sponza",
        limits: &[
            ("irradiance", "rmse_over_mean", 0.0394),
            ("irradiance", "bias_over_mean", 0.00204),
            ("irradiance", "rms_of_relative", 0.0682),
            ("irradiance", "block_p50", 0.00995),
            ("irradiance", "block_p99", 0.0669),
            ("irradiance", "band_error", 0.0173),
            ("irradiance", "rmse_edges", 0.0543),
            ("irradiance", "rmse_interior", 0.0261),
            ("irradiance", "relmse", 0.00354),
            ("irradiance", "flip", 0.0221),
            ("irradiance", "hdr_flip", 0.037),
            ("direct", "rmse_over_mean", 0.0839),
            ("direct", "bias_over_mean", 0.0028),
            ("direct", "rms_of_relative", 0.0963),
            ("direct", "block_p50", 0.0002),
            ("direct", "block_p99", 0.253),
            ("direct", "band_error", 0.0124),
            ("direct", "rmse_edges", 0.136),
            ("direct", "rmse_interior", 0.0336),
            ("direct", "relmse", 0.0537),
            ("direct", "flip", 0.0221),
            ("direct", "hdr_flip", 0.037),
            ("picture", "rmse_over_mean", 0.0538),
            ("picture", "bias_over_mean", 0.00136),
            ("picture", "rms_of_relative", 0.0963),
            ("picture", "block_p50", 0.0053),
            ("picture", "block_p99", 0.0555),
            ("picture", "band_error", 0.0101),
            ("picture", "rmse_edges", 0.0856),
            ("picture", "rmse_interior", 0.0238),
            ("picture", "relmse", 0.00525),
            ("picture", "flip", 0.0221),
            ("picture", "hdr_flip", 0.037),
        ],
        records: 7_448,
        rounds: 28,
        bytes: [172_575_940, 223_749_920],
    },
];

/// Ways to the same picture: name, pipeline, what the plan is made for, whether one core has to do.
const WAYS: [(&str, &str, Option<Device>, bool); 4] = [
    ("as_it_ships", "irradiance", None, false),
    ("on_one_core", "irradiance", None, true),
    ("as_planned_for_a_gpu", "irradiance", Some(Device::ABLE), false),
    ("with_every_step_on_the_device", "irradiance-device", None, false),
];

fn main() {
    let gpu = Gpu::open().map(Arc::new).map_err(|error| error.to_string());
    let missing = gpu.as_ref().err().map(|reason| Missing::new("gpu", reason)).or_else(Missing::scenes);
    let mut trials = Vec::new();
    for hall in &HALLS {
        for way in WAYS {
            let gpu = gpu.clone();
            trials.push(skips::trial(format!("{}_{}", hall.name, way.0), missing.as_ref(), move || drawn(&*gpu?, hall, way)));
        }
    }
    libtest_mimic::run(&Arguments::from_args(), trials).exit()
}

fn drawn(gpu: &Gpu, hall: &Hall, (way, pipeline, device, one_core): (&str, &str, Option<Device>, bool)) -> Outcome {
    let told = |error: hemisplat::measure::run::RunError| error.to_string();
    let options = LoadOptions::default().with_environment();
    let mut scene = load_scene(Path::new(hall.name), &options).map_err(|error| format!("{:?}", miette::Report::new(error)))?;
    let bvh = Bvh::build(&mut scene);
    let plan = planned(pipeline, &scene, device.unwrap_or(gpu.adapter.device()))?;
    let mut run = Run::new(gpu, &scene, &bvh, &plan, &scene.cameras[0], SIZE).map_err(told)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(usize::from(one_core)).build().map_err(|error| error.to_string())?;
    let report = pool.install(|| run.frame(&|| Pace::GoOn)).map_err(told)?;
    let picture = run.picture().map_err(told)?.with_attribute("bounces", 1);
    let by_device = device == Some(Device::ABLE) || pipeline == "irradiance-device";
    let mut wrong = costs(hall, &report, run.gpu_bytes(), by_device);
    wrong.extend(errors(hall, &picture)?);
    if wrong.is_empty() { Ok(()) } else { Err(format!("{} {way}: {}", hall.name, wrong.join("; ")).into()) }
}

fn planned(pipeline: &str, scene: &Scene, device: Device) -> Result<Plan, Failed> {
    let pipeline = load(pipeline, &[], REGISTRY, &mut |_| Err(io::ErrorKind::NotFound.into())).map_err(|problems| format!("{problems:?}"))?;
    let needs = Needs::of(scene);
    let setting = Setting { scene, needs: &needs, device, size: SIZE, tables: None };
    Ok(plan(&pipeline, setting, &[], &|data| kind(scene, data)).map_err(|problems| format!("{problems:?}"))?)
}

/// What a frame takes beyond a tenth more than it took.
fn costs(hall: &Hall, report: &FrameReport, bytes: u64, by_device: bool) -> Vec<String> {
    let number = |number: Option<u32>| u64::from(number.unwrap_or(0));
    let costs = [
        ("records", number(report.records.irradiance), u64::from(hall.records)),
        ("rounds", number(report.fill_rounds), u64::from(hall.rounds)),
        ("bytes", bytes, hall.bytes[usize::from(by_device)]),
    ];
    tell(&format!("{}: {costs:?}", hall.name));
    let over = costs.into_iter().filter(|(_, now, kept)| 10 * now > 11 * kept || 10 * now < 9 * kept);
    let mut wrong: Vec<String> = over.map(|(what, now, kept)| format!("{now} {what} instead of {kept}")).collect();
    if by_device {
        tell(&format!("{} waits", report.waits));
    }
    wrong.extend((!report.complete).then(|| "it is not complete".to_owned()));
    wrong
}

/// What is farther from the truth than its limit.
fn errors(hall: &Hall, picture: &Layers) -> Result<Vec<String>, Failed> {
    let truth = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/halls/{}.exr", hall.name)))?;
    let truth = Layers::read(&truth).map_err(|error| error.to_string())?;
    let mut wrong = Vec::new();
    for layer in ["irradiance", "direct", "picture"] {
        let errors = compare(picture, &truth, layer, None).map_err(|error| error.to_string())?;
        for metric in Errors::METRICS.into_iter().filter(|metric| *metric != "largest") {
            let Some(found) = errors.metric(metric).flatten().map(f64::abs) else { continue };
            tell(&format!("(\"{layer}\", \"{metric}\", {found:.6}),"));
            let limit = hall.limits.iter().find(|(of, name, _)| *of == layer && *name == metric).map(|(.., limit)| *limit);
            wrong.extend(limit.is_none_or(|limit| found > limit).then(|| format!("{metric} of {layer} is {found:.5}, at most {limit:?}")));
        }
    }
    Ok(wrong)
}

fn tell(what: &str) {
    if env::var_os("HEMISPLAT_TOLD").is_some() {
        println!("{what}");
    }
}
