//! What ships, on real halls and under light that is hard to cache: how far the default is from the truth, and of halls what it takes. The truth was traced by
//! `hemisplat reference --scene SCENE --size 250x250 --windows 6 --spp 2048`, of hard light by `--stride 2 --spp 16384` (of globes 4096); limits are a tenth above
//! what was seen when they were set.
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
            ("direct", "rmse_over_mean", 0.0159),
            ("direct", "bias_over_mean", 0.000018),
            ("direct", "rms_of_relative", 0.0108),
            ("direct", "block_p50", 0.000012),
            ("direct", "block_p99", 0.00592),
            ("direct", "band_error", 0.000060),
            ("direct", "rmse_edges", 0.0212),
            ("direct", "rmse_interior", 0.00176),
            ("direct", "relmse", 0.000075),
            ("direct", "flip", 0.0183),
            ("direct", "hdr_flip", 0.0288),
            ("picture", "rmse_over_mean", 0.022),
            ("picture", "bias_over_mean", 0.00144),
            ("picture", "rms_of_relative", 0.0505),
            ("picture", "block_p50", 0.0045),
            ("picture", "block_p99", 0.0391),
            ("picture", "band_error", 0.00569),
            ("picture", "rmse_edges", 0.0261),
            ("picture", "rmse_interior", 0.0114),
            ("picture", "relmse", 0.00168),
            ("picture", "flip", 0.0183),
            ("picture", "hdr_flip", 0.0288),
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
            ("direct", "rmse_over_mean", 0.0424),
            ("direct", "bias_over_mean", 0.000282),
            ("direct", "rms_of_relative", 0.0188),
            ("direct", "block_p50", 0.000017),
            ("direct", "block_p99", 0.0112),
            ("direct", "band_error", 0.000010),
            ("direct", "rmse_edges", 0.0741),
            ("direct", "rmse_interior", 0.000112),
            ("direct", "relmse", 0.00216),
            ("direct", "flip", 0.0173),
            ("direct", "hdr_flip", 0.0281),
            ("picture", "rmse_over_mean", 0.0254),
            ("picture", "bias_over_mean", 0.000421),
            ("picture", "rms_of_relative", 0.0518),
            ("picture", "block_p50", 0.00396),
            ("picture", "block_p99", 0.0471),
            ("picture", "band_error", 0.00587),
            ("picture", "rmse_edges", 0.0421),
            ("picture", "rmse_interior", 0.00882),
            ("picture", "relmse", 0.00152),
            ("picture", "flip", 0.0173),
            ("picture", "hdr_flip", 0.0281),
        ],
        records: 7_448,
        rounds: 28,
        bytes: [172_575_940, 223_749_920],
    },
];

/// Scenes whose light is hard to cache.
const HARD: [(&str, Limits); 5] = [
    (
        "arcade",
        &[
            ("irradiance", "rmse_over_mean", 0.0718),
            ("irradiance", "bias_over_mean", 0.009),
            ("irradiance", "rms_of_relative", 0.264),
            ("irradiance", "block_p50", 0.0254),
            ("irradiance", "block_p99", 1.15),
            ("irradiance", "rmse_edges", 0.063),
            ("irradiance", "rmse_interior", 0.0741),
            ("irradiance", "relmse", 0.0365),
            ("direct", "rmse_over_mean", 0.0494),
            ("direct", "bias_over_mean", 0.00103),
            ("direct", "rms_of_relative", 0.00246),
            ("direct", "block_p50", 0.00162),
            ("direct", "block_p99", 0.00417),
            ("direct", "rmse_edges", 0.0742),
            ("direct", "rmse_interior", 0.0397),
            ("direct", "relmse", 0.000010),
            ("picture", "rmse_over_mean", 0.0548),
            ("picture", "bias_over_mean", 0.00693),
            ("picture", "rms_of_relative", 0.242),
            ("picture", "block_p50", 0.0251),
            ("picture", "block_p99", 1.15),
            ("picture", "rmse_edges", 0.0578),
            ("picture", "rmse_interior", 0.054),
            ("picture", "relmse", 0.0291),
        ],
    ),
    (
        "wall-lamp",
        &[
            ("irradiance", "rmse_over_mean", 0.0773),
            ("irradiance", "bias_over_mean", 0.00215),
            ("irradiance", "rms_of_relative", 0.21),
            ("irradiance", "block_p50", 0.0262),
            ("irradiance", "block_p99", 0.241),
            ("irradiance", "rmse_edges", 0.132),
            ("irradiance", "rmse_interior", 0.0523),
            ("irradiance", "relmse", 0.0337),
            ("direct", "rmse_over_mean", 0.00564),
            ("direct", "bias_over_mean", 0.000019),
            ("direct", "rms_of_relative", 0.000098),
            ("direct", "block_p50", 0.000024),
            ("direct", "block_p99", 0.000272),
            ("direct", "rmse_edges", 0.000058),
            ("direct", "rmse_interior", 0.00638),
            ("direct", "relmse", 0.000010),
            ("picture", "rmse_over_mean", 0.0187),
            ("picture", "bias_over_mean", 0.000176),
            ("picture", "rms_of_relative", 0.162),
            ("picture", "block_p50", 0.0182),
            ("picture", "block_p99", 0.162),
            ("picture", "rmse_edges", 0.0308),
            ("picture", "rmse_interior", 0.0135),
            ("picture", "relmse", 0.0092),
        ],
    ),
    (
        "low-sun",
        &[
            ("irradiance", "rmse_over_mean", 0.0655),
            ("irradiance", "bias_over_mean", 0.00319),
            ("irradiance", "rms_of_relative", 0.335),
            ("irradiance", "block_p50", 0.0192),
            ("irradiance", "block_p99", 0.142),
            ("irradiance", "rmse_edges", 0.0905),
            ("irradiance", "rmse_interior", 0.0561),
            ("irradiance", "relmse", 0.0132),
            ("direct", "rmse_over_mean", 0.00906),
            ("direct", "bias_over_mean", 0.000038),
            ("direct", "rms_of_relative", 0.333),
            ("direct", "block_p50", 0.119),
            ("direct", "block_p99", 1.33),
            ("direct", "rmse_edges", 0.0094),
            ("direct", "rmse_interior", 0.00896),
            ("direct", "relmse", 0.00531),
            ("picture", "rmse_over_mean", 0.0186),
            ("picture", "bias_over_mean", 0.0012),
            ("picture", "rms_of_relative", 0.112),
            ("picture", "block_p50", 0.0143),
            ("picture", "block_p99", 0.14),
            ("picture", "rmse_edges", 0.0277),
            ("picture", "rmse_interior", 0.0149),
            ("picture", "relmse", 0.00469),
        ],
    ),
    (
        "globes",
        &[
            ("irradiance", "rmse_over_mean", 0.0369),
            ("irradiance", "bias_over_mean", 0.000918),
            ("irradiance", "rms_of_relative", 0.0483),
            ("irradiance", "block_p50", 0.0132),
            ("irradiance", "block_p99", 0.0633),
            ("irradiance", "rmse_edges", 0.0515),
            ("irradiance", "rmse_interior", 0.0311),
            ("irradiance", "relmse", 0.00202),
            ("direct", "rmse_over_mean", 0.12),
            ("direct", "bias_over_mean", 0.000184),
            ("direct", "rms_of_relative", 0.116),
            ("direct", "block_p50", 0.0186),
            ("direct", "block_p99", 0.083),
            ("direct", "rmse_edges", 0.116),
            ("direct", "rmse_interior", 0.121),
            ("direct", "relmse", 0.0444),
            ("picture", "rmse_over_mean", 0.752),
            ("picture", "bias_over_mean", 0.0059),
            ("picture", "rms_of_relative", 0.0708),
            ("picture", "block_p50", 0.0125),
            ("picture", "block_p99", 0.0528),
            ("picture", "rmse_edges", 1.56),
            ("picture", "rmse_interior", 0.0267),
            ("picture", "relmse", 0.00413),
        ],
    ),
    (
        "door",
        &[
            ("irradiance", "rmse_over_mean", 0.291),
            ("irradiance", "bias_over_mean", 0.0219),
            ("irradiance", "rms_of_relative", 0.249),
            ("irradiance", "block_p50", 0.0504),
            ("irradiance", "block_p99", 0.39),
            ("irradiance", "rmse_edges", 0.885),
            ("irradiance", "rmse_interior", 0.141),
            ("irradiance", "relmse", 0.0376),
            ("direct", "rmse_over_mean", 0.000191),
            ("direct", "bias_over_mean", 0.000010),
            ("direct", "rms_of_relative", 0.000010),
            ("direct", "block_p50", 0.000010),
            ("direct", "block_p99", 0.000016),
            ("direct", "rmse_edges", 0.000655),
            ("direct", "rmse_interior", 0.000010),
            ("direct", "relmse", 0.000010),
            ("picture", "rmse_over_mean", 0.184),
            ("picture", "bias_over_mean", 0.0155),
            ("picture", "rms_of_relative", 0.234),
            ("picture", "block_p50", 0.0504),
            ("picture", "block_p99", 0.387),
            ("picture", "rmse_edges", 0.55),
            ("picture", "rmse_interior", 0.0939),
            ("picture", "relmse", 0.0183),
        ],
    ),
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
            trials.push(skips::trial(format!("{}_{}", hall.name, way.0), missing.as_ref(), move || of_hall(&*gpu?, hall, way)));
        }
    }
    let no_gpu = gpu.as_ref().err().map(|reason| Missing::new("gpu", reason));
    for (name, limits) in HARD {
        let gpu = gpu.clone();
        trials.push(skips::trial(name.to_owned(), no_gpu.as_ref(), move || under_hard_light(&*gpu?, name, limits)));
    }
    libtest_mimic::run(&Arguments::from_args(), trials).exit()
}

fn of_hall(gpu: &Gpu, hall: &Hall, (way, pipeline, device, one_core): (&str, &str, Option<Device>, bool)) -> Outcome {
    let (picture, report, bytes) = drawn(gpu, hall.name, pipeline, device, one_core)?;
    let by_device = device == Some(Device::ABLE) || pipeline == "irradiance-device";
    let mut wrong = costs(hall, &report, bytes, by_device);
    wrong.extend(errors(hall.name, hall.limits, &picture)?);
    if wrong.is_empty() { Ok(()) } else { Err(format!("{} {way}: {}", hall.name, wrong.join("; ")).into()) }
}

fn under_hard_light(gpu: &Gpu, name: &str, limits: Limits) -> Outcome {
    let (picture, report, _) = drawn(gpu, name, "irradiance", None, false)?;
    let mut wrong = errors(name, limits, &picture)?;
    wrong.extend((!report.complete).then(|| "it is not complete".to_owned()));
    if wrong.is_empty() { Ok(()) } else { Err(format!("{name}: {}", wrong.join("; ")).into()) }
}

/// A picture, how it was made, and the bytes that it took on the device.
fn drawn(gpu: &Gpu, name: &str, pipeline: &str, device: Option<Device>, one_core: bool) -> Result<(Layers, FrameReport, u64), Failed> {
    let told = |error: hemisplat::measure::run::RunError| error.to_string();
    let options = LoadOptions::default().with_environment();
    let mut scene = load_scene(Path::new(name), &options).map_err(|error| format!("{:?}", miette::Report::new(error)))?;
    let bvh = Bvh::build(&mut scene);
    let plan = planned(pipeline, &scene, device.unwrap_or(gpu.adapter.device()))?;
    let mut run = Run::new(gpu, &scene, &bvh, &plan, &scene.cameras[0], SIZE).map_err(told)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(usize::from(one_core)).build().map_err(|error| error.to_string())?;
    let report = pool.install(|| run.frame(&|| Pace::GoOn)).map_err(told)?;
    let picture = run.picture().map_err(told)?.with_attribute("bounces", 1);
    Ok((picture, report, run.gpu_bytes()))
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
fn errors(name: &str, limits: Limits, picture: &Layers) -> Result<Vec<String>, Failed> {
    let truth = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/halls/{name}.exr")))?;
    let truth = Layers::read(&truth).map_err(|error| error.to_string())?;
    let mut wrong = Vec::new();
    for layer in ["irradiance", "direct", "picture"] {
        let errors = compare(picture, &truth, layer, None).map_err(|error| error.to_string())?;
        for metric in Errors::METRICS.into_iter().filter(|metric| *metric != "largest") {
            let Some(found) = errors.metric(metric).flatten().map(f64::abs) else { continue };
            tell(&format!("{name}: (\"{layer}\", \"{metric}\", {:.3e}),", 1.1 * found));
            let limit = limits.iter().find(|(of, name, _)| *of == layer && *name == metric).map(|(.., limit)| *limit);
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
