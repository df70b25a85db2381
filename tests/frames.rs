//! Frames and rounds on the device: sums that must have closed forms, and what earlier frames, views and files leave.
//!
//! Needs a GPU adapter, a software one will do; without one each case is named as skipped, which
//! `HEMISPLAT_REQUIRE=gpu` makes a failure.

use hemisplat::{
    contract::recorder::Setting,
    gpu::{Gpu, Pace, scene::byte_size},
    measure::run::Run,
    passes::REGISTRY,
    pipeline,
    scene::{bvh::Bvh, load, needs::Needs},
};
use libtest_mimic::{Arguments, Failed, Trial};
use std::{env, io, path::Path};

type Outcome = Result<(), Failed>;
type Case = fn() -> Outcome;

const CASES: &[(&str, Case)] = &[
    ("a_sum_over_rounds_has_its_closed_form_in_every_frame", sum_over_rounds),
    ("a_sum_over_frames_has_its_closed_form_and_starts_empty", sum_over_frames),
    ("a_fill_inside_a_loop_starts_anew_each_time", fill_in_a_loop),
];

fn main() {
    let required = env::var("HEMISPLAT_REQUIRE").is_ok_and(|list| list.split(',').any(|item| item.trim() == "gpu"));
    let has_gpu = hemisplat::gpu::device::adapters().iter().any(|adapter| adapter.lacks.is_empty());
    if !has_gpu && !required {
        CASES.iter().for_each(|(name, _)| println!("SKIPPED: {name}: no GPU adapter"));
    }
    let trials = CASES.iter().map(|(name, case)| Trial::test(*name, case).with_ignored_flag(!has_gpu && !required)).collect();
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

fn check(holds: bool, what: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(what().into()) }
}

fn failed(error: impl std::fmt::Display) -> Failed {
    error.to_string().into()
}

// Pipelines of the tests.

const SIZE: [u32; 2] = [32, 24];

/// A pipeline of these nodes that shows one of them.
fn document(nodes: &str, output: &str) -> String {
    format!("Pipeline(version: 1, about: \"test\", nodes: [{nodes}], outputs: {{ \"picture\": \"{output}\" }})")
}

/// The layer `picture` of each of so many frames of a pipeline on a scene that ships.
fn frames(scene: &str, text: &str, count: u32) -> Result<Vec<Vec<f32>>, Failed> {
    let mut read = |path: &Path| if path == Path::new("test.ron") { Ok(text.to_owned()) } else { Err(io::Error::from(io::ErrorKind::NotFound)) };
    let pipeline = pipeline::load("test.ron", &[], REGISTRY, &mut read).map_err(failed)?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(scene);
    let mut scene = load::load(&path, &Default::default()).map_err(failed)?;
    let bvh = Bvh::build(&mut scene);
    let needs = Needs::of(&scene);
    let setting = Setting { scene: &scene, needs: &needs, size: SIZE };
    let plan = pipeline::plan(&pipeline, setting, &[], &|data| byte_size(&scene, data)).map_err(failed)?;
    let gpu = Gpu::open().map_err(failed)?;
    let mut run = Run::new(&gpu, &scene, &bvh, &plan, &scene.cameras[0], SIZE).map_err(failed)?;
    let mut frame = || {
        run.frame(&|| Pace::GoOn)?;
        run.picture()
    };
    (0..count).map(|_| Ok(frame().map_err(failed)?.rgb("picture").map_err(failed)?.concat())).collect()
}

/// The light that the sums add up: every pixel of the furnace emits 1.
const FURNACE: &str = r#"(name: "gbuffer", pass: GBuffer()),"#;

fn all_are(picture: &[f32], value: f32, what: &str) -> Outcome {
    let other = picture.iter().find(|v| **v != value);
    check(!picture.is_empty() && other.is_none(), || format!("{what}: a pixel is {other:?}, not {value}"))
}

fn sum_over_rounds() -> Outcome {
    let nodes = format!(
        "{FURNACE} (name: \"loop\", repeat: Iterate(rounds: 5, nodes: [(name: \"sum\", pass: Combine(gbuffer: \"gbuffer\", indirect: PreviousRound(\"sum\")))]))"
    );
    for (frame, picture) in frames("furnace.ron", &document(&nodes, "sum"), 3)?.iter().enumerate() {
        all_are(picture, 5.0, &format!("frame {frame}"))?;
    }
    Ok(())
}

/// A sum over frames; a second node lags behind it, and a sum over two rounds takes both in.
fn sum_over_frames() -> Outcome {
    let nodes = format!(
        "{FURNACE} (name: \"sum\", pass: Combine(gbuffer: \"gbuffer\", indirect: PreviousFrame(\"sum\"))),
        (name: \"late\", pass: Combine(gbuffer: \"gbuffer\", indirect: PreviousFrame(\"loop_sum\"))),
        (name: \"loop\", repeat: Iterate(rounds: 2, nodes: [
            (name: \"loop_sum\", pass: Combine(gbuffer: \"gbuffer\", indirect: PreviousFrame(\"sum\"))),
            (name: \"both\", pass: Combine(gbuffer: \"gbuffer\", indirect: PreviousRound(\"loop_sum\"))),
        ]))"
    );
    // Frame n (from 0): sum = n + 1; loop_sum = 1 + what sum was = n + 1; late = 1 + what loop_sum was; both = 1 + loop_sum of the first round.
    for (output, expected) in [("sum", [1.0, 2.0, 3.0, 4.0]), ("late", [1.0, 2.0, 3.0, 4.0]), ("both", [2.0, 3.0, 4.0, 5.0])] {
        for (picture, value) in frames("furnace.ron", &document(&nodes, output), 4)?.iter().zip(expected) {
            all_are(picture, value, output)?;
        }
    }
    Ok(())
}

/// The shipped fill, alone and twice in a loop: the second time everything is covered already.
fn fill_in_a_loop() -> Outcome {
    let fill = r#"(name: "fill", repeat: Fill(order: Batched(at_most: 64), until: "misses.none", nodes: [
            (name: "splats", pass: Splat(records: "cache", gbuffer: "gbuffer")),
            (name: "misses", pass: FindMisses(gbuffer: "gbuffer", splats: "splats")),
            (name: "tiles", pass: HemisphereTiles(at: "misses", direct: "direct", resolution: 8)),
            (name: "closed", pass: Compensation(of: "tiles")),
            (name: "records", pass: IrradianceSum(of: "closed")),
            (name: "added", pass: AddRecords(to: "cache", records: "records")),
        ]))"#;
    let document = |fill: &str, more: &str| {
        let nodes = format!(
            r#"(name: "gbuffer", pass: GBuffer()), (name: "direct", pass: DirectLight(gbuffer: "gbuffer")), (name: "cache", pass: RecordCache(accuracy: 0.3)),
            {fill}, {more} (name: "indirect", pass: Normalize(splats: "splats", gbuffer: "gbuffer"))"#
        );
        document(&nodes, "indirect.irradiance")
    };
    let once = frames("cornell.ron", &document(fill, ""), 1)?;
    check(once[0].iter().any(|v| *v > 0.0), || "no light".into())?;
    let twice = format!("(name: \"twice\", repeat: Iterate(rounds: 2, nodes: [{fill}]))");
    check(frames("cornell.ron", &document(&twice, ""), 1)? == once, || "a fill that runs twice draws another picture".into())?;
    // A splat outside of fills adds all records each time.
    let again = r#"(name: "again", repeat: Iterate(rounds: 3, nodes: [(name: "resplats", pass: Splat(records: "added", gbuffer: "gbuffer"))])),"#;
    let resplatted = document(fill, again).replace("Normalize(splats: \"splats\"", "Normalize(splats: \"resplats\"");
    check(frames("cornell.ron", &resplatted, 2)? == [once.clone(), once].concat(), || "a splat in a loop forgets records".into())
}
