//! Loops that the device drives against the same loops where the host decides on each round: the same pictures, records and rounds, and few waits.
//!
//! Needs a GPU adapter, a software one will do: the plans are made as for hardware.

mod skips;

use hemisplat::{
    block_on,
    contract::encoder::Setting,
    gpu::{Gpu, Pace, scene::kind},
    measure::{
        layers::Layers,
        run::{FrameReport, Run},
    },
    passes::REGISTRY,
    pipeline::{Plan, load, plan},
    scene::{Camera, Scene, load as scenes, needs::Needs, stage::Stage},
    schedule::{Device, Driver, Step},
};
use libtest_mimic::{Arguments, Failed};
use skips::Missing;
use std::{fs, path::Path, sync::Arc, time::Duration};

type Outcome = Result<(), Failed>;

/// Of a picture that stands still, but for the last: where one comes to its end, the next is taken to need nothing.
const FRAMES: usize = 4;

/// Pipeline, scene, size, whether the device blends, parameters that are set, and most waits of each frame.
struct Case {
    name: &'static str,
    pipeline: &'static str,
    scene: &'static str,
    size: [u32; 2],
    blends: bool,
    set: &'static [&'static str],
    waits: [u32; FRAMES],
}

const CASES: [Case; 7] = [
    Case { name: "hall", pipeline: "irradiance", scene: "hall", size: [160, 120], blends: true, set: &[], waits: [2, 0, 0, 2] },
    Case { name: "hall_without_blending", pipeline: "irradiance", scene: "hall", size: [96, 64], blends: false, set: &[], waits: [2, 0, 0, 2] },
    Case { name: "one_rate", pipeline: "irradiance-device", scene: "cornell", size: [64, 64], blends: true, set: &[], waits: [2, 0, 0, 2] },
    Case { name: "glossy", pipeline: "radiance", scene: "cornell-glossy", size: [48, 48], blends: true, set: &[], waits: [3, 0, 0, 3] },
    Case { name: "few_rounds", pipeline: "irradiance", scene: "hall", size: [64, 48], blends: true, set: &["fill.max_rounds=9"], waits: [2, 2, 0, 2] },
    Case { name: "full_cache", pipeline: "irradiance", scene: "hall", size: [64, 48], blends: true, set: &["cache.capacity=70"], waits: [2, 2, 2, 2] },
    // Records are made where another search asks for them, which asks for one: the loop ends as that does not cover what its own search asks for.
    Case { name: "two_searches", pipeline: "tests/ahead/two_searches.ron", scene: "cornell", size: [64, 48], blends: true, set: &[], waits: [2, 2, 2, 2] },
];

fn main() {
    let gpu = block_on(Gpu::open()).map_err(|error| error.to_string());
    let missing = gpu.as_ref().err().map(|reason| Missing::new("gpu", reason));
    let trial = |case: &'static Case| {
        let gpu = gpu.clone();
        skips::trial(case.name, missing.as_ref(), move || agrees(&gpu?, case))
    };
    libtest_mimic::run(&Arguments::from_args(), CASES.iter().map(trial).collect()).exit()
}

fn agrees(gpu: &Arc<Gpu>, case: &Case) -> Outcome {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{}.ron", case.scene));
    let stage = Arc::new(Stage::new(scenes::load(&path, &scenes::LoadOptions::default()).map_err(|error| error.to_string())?));
    let scene = &stage.scene;
    let plan = planned(case, scene)?;
    let loops = plan.schedule.steps.iter().filter_map(|step| if let Step::Repeat(repeat) = step { Some(repeat) } else { None });
    let by_host: Vec<&str> = loops.filter(|repeat| repeat.driver == Driver::Host).map(|repeat| &repeat.name[..]).collect();
    check(by_host.is_empty(), || format!("the host drives {by_host:?}: {:?}", plan.remarks))?;
    let frames = |pace: Pace| -> Result<Vec<(FrameReport, Layers)>, Failed> {
        let mut run = block_on(Run::new(gpu, &stage, &plan, &scene.cameras[0], case.size)).map_err(|error| error.to_string())?;
        let mut moved = scene.cameras[0].clone();
        moved.eye += 0.05 * moved.direction;
        let mut frame = |number: usize| {
            if number + 1 == FRAMES {
                run.set_camera(&moved);
            }
            let report = block_on(run.frame(&|| pace))?;
            Ok((report, block_on(run.picture())?))
        };
        let frames = (0..FRAMES).map(|number| frame(number).map_err(|error: hemisplat::measure::run::RunError| error.to_string().into())).collect();
        if pace == Pace::GoOn {
            notices_a_change(&mut run, scene)?;
        }
        frames
    };
    // A time that is never up leaves each round to the host.
    let (ahead, by_host) = (frames(Pace::GoOn)?, frames(Pace::Within(Duration::from_secs(1 << 20)))?);
    for ((one, a), (other, b)) in ahead.iter().zip(&by_host) {
        let told =
            |report: &FrameReport| format!("{:?}", (&report.records, report.new_records, report.surplus_records, report.fill_rounds, &report.unfinished));
        check(told(one) == told(other), || format!("{} is not {}", told(one), told(other)))?;
        let runs = |report: &FrameReport| {
            report.passes.iter().map(|pass| (pass.node.clone(), pass.runs)).filter(|(name, _)| name.contains("tiles")).collect::<Vec<_>>()
        };
        check(runs(one) == runs(other), || format!("{:?} is not {:?}", runs(one), runs(other)))?;
        for (name, layer) in &a.layers {
            check(b.layers.get(name) == Some(layer), || format!("`{name}` differs"))?;
        }
        check(other.waits >= other.fill_rounds.unwrap_or(0), || format!("{} waits, {:?} rounds", other.waits, other.fill_rounds))?;
    }
    let waits: Vec<u32> = ahead.iter().map(|(report, _)| report.waits).collect();
    if std::env::var_os("HEMISPLAT_TOLD").is_some() {
        println!("{}: {waits:?} waits", case.name);
    }
    check(waits.iter().zip(case.waits).all(|(waits, most)| *waits <= most), || {
        format!("{waits:?} waits, rounds {:?}", ahead.iter().map(|(report, _)| report.fill_rounds).collect::<Vec<_>>())
    })
}

/// A frame that takes a picture for still that is not is drawn all the same, or tells why it is not whole.
fn notices_a_change(run: &mut Run, scene: &Scene) -> Outcome {
    let camera = &scene.cameras[0];
    run.set_camera(&Camera { eye: camera.eye + 0.1 * scene.extent() * camera.direction, ..camera.clone() });
    run.assume_still();
    let report = block_on(run.frame(&|| Pace::GoOn)).map_err(|error| error.to_string())?;
    check(report.waits > 0 && (report.complete || !report.unfinished.is_empty()), || format!("{report:?}"))
}

fn planned(case: &Case, scene: &Scene) -> Result<Arc<Plan>, Failed> {
    let set: Vec<String> = case.set.iter().map(|set| (*set).to_owned()).collect();
    let pipeline = load(case.pipeline, &set, REGISTRY, &mut |path| fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)))
        .map_err(|problems| format!("{problems:?}"))?;
    let needs = Needs::of(scene);
    let setting = Setting { scene, needs: &needs, device: Device { blends: case.blends, ..Device::ABLE }, size: case.size, tables: None };
    Ok(plan(&pipeline, setting, &[], &kind).map_err(|problems| format!("{problems:?}"))?)
}

fn check(holds: bool, what: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(what().into()) }
}
