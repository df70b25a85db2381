//! Every shipped pipeline at the extremes of `hemisplat stability`, and mistakes on purpose that its cases must see.
//!
//! Needs a GPU adapter, a software one will do; without one each trial is named as skipped, which `HEMISPLAT_REQUIRE=gpu`
//! makes a failure. The long cases of variants, and seven variants of eight, run with `--ignored` or `--include-ignored`.

mod skips;

use hemisplat::{
    block_on,
    gpu::Gpu,
    measure::stability::{Bench, CASES, Case, Verdict},
    passes::REGISTRY,
    pipeline::{Pipeline, Problems, embedded::EMBEDDED, load},
};
use libtest_mimic::{Arguments, Failed};
use skips::Missing;
use std::{io, sync::Arc};

type Outcome = Result<(), Failed>;

type Test = Box<dyn FnOnce(&Arc<Gpu>) -> Outcome + Send>;

fn main() {
    let gpu = block_on(Gpu::open()).map_err(|e| e.to_string());
    let missing = gpu.as_ref().err().map(|reason| Missing::new("gpu", reason));
    let drawn = |name: String, is_long: bool, test: Test| {
        let gpu = gpu.clone();
        let run = move || test(&gpu?);
        skips::short_or_long(name, is_long, missing.as_ref(), run)
    };
    let mut trials = vec![
        drawn("mistakes_are_seen".into(), false, Box::new(mistakes_are_seen)),
        drawn("the_program_tells_what_fails".into(), false, Box::new(|_| program_tells())),
    ];
    for (number, (file, _)) in EMBEDDED.iter().enumerate() {
        let name = file.trim_end_matches(".ron");
        // Where nothing is glossy, of the variants of radiance.ron is left what is left of itself.
        let only = if file.starts_with("radiance-") { "lobes" } else { "" };
        // A variant shares nearly all of its way with the method that it varies: every eighth is enough for a run.
        let is_variant = name.contains('-');
        trials.push(drawn(name.into(), is_variant && number % 8 != 3, Box::new(move |gpu| all_hold(gpu, name, only, false))));
        if only.is_empty() {
            trials.push(drawn(format!("{name} at length"), is_variant, Box::new(move |gpu| all_hold(gpu, name, only, true))));
        }
    }
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

fn loaded(name: &str, sets: &[String]) -> Result<Pipeline, Problems> {
    load(name, sets, REGISTRY, &mut |_| Err(io::ErrorKind::NotFound.into()))
}

fn told(problems: Problems) -> Failed {
    format!("{:?}", miette::Report::new(problems)).into()
}

/// No case whose name starts so may fail.
fn all_hold(gpu: &Arc<Gpu>, name: &str, only: &str, at_length: bool) -> Outcome {
    let load = |sets: &[String]| loaded(name, sets);
    let bench = Bench::new(gpu, &load).map_err(told)?;
    let outcomes = CASES.iter().filter(|case| case.is_long == at_length && case.name.starts_with(only)).map(|case| case.run(&bench));
    let failed: Vec<String> =
        outcomes.filter(|outcome| outcome.verdict == Verdict::Fail).map(|o| format!("{}: must hold: {}; seen: {}", o.case, o.must_hold, o.seen)).collect();
    if failed.is_empty() { Ok(()) } else { Err(failed.join("\n").into()) }
}

fn case(name: &str) -> Result<&'static Case, Failed> {
    CASES.iter().find(|case| case.name == name).ok_or_else(|| format!("no case is called {name}").into())
}

/// Pipelines that are wrong, each with a case that must fail: one that let them pass would prove nothing.
fn mistakes_are_seen(gpu: &Arc<Gpu>) -> Outcome {
    let mistakes = [
        // A loop that ends before every pixel is covered.
        ("furnace", "details.max_rounds=1"),
        // Too few records fit.
        ("no-lights", "cache.capacity=3"),
    ];
    for (name, mistake) in mistakes {
        let load = |sets: &[String]| loaded("irradiance", &[sets, &[mistake.to_owned()]].concat());
        let bench = Bench::new(gpu, &load).map_err(told)?;
        let outcome = case(name)?.run(&bench);
        if outcome.verdict != Verdict::Fail {
            return Err(format!("{mistake} passes {name}: {}", outcome.seen).into());
        }
    }
    // What the plane leaves out counts as black: the brightness that is due to a whole hemisphere is not there.
    let load = |sets: &[String]| loaded(if sets.is_empty() { "irradiance" } else { "irradiance-plane-open" }, sets);
    let outcome = case("furnace")?.run(&Bench::new(gpu, &load).map_err(told)?);
    if outcome.verdict == Verdict::Fail { Ok(()) } else { Err(format!("a sixth of the light is not missed: {}", outcome.seen).into()) }
}

/// The program's status, table and file, of a pipeline that holds a case and of one that does not.
fn program_tells() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    for (set, status, verdict, word) in [("fill.max_rounds=0", 0, "pass", "pass"), ("details.max_rounds=1", 1, "fail", "FAIL")] {
        let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_hemisplat"));
        let arguments = ["stability", "irradiance", "--set", set, "--only", "furnace", "--json", "out/stability.json"];
        let output = command.current_dir(folder.path()).args(arguments).output().map_err(|e| e.to_string())?;
        let stdout = String::from_utf8_lossy(&output.stdout);
        let json = std::fs::read(folder.path().join("out/stability.json")).map_err(|e| e.to_string())?;
        let json: serde_json::Value = serde_json::from_slice(&json).map_err(|e| e.to_string())?;
        let told = &json["pipelines"][0]["cases"][0];
        let is_told = json["schema"] == 1 && told["case"] == "furnace" && told["verdict"] == verdict && stdout.contains(&format!("{word} furnace"));
        if output.status.code() != Some(status) || !is_told {
            return Err(format!("{set}: {:?}\n{stdout}\n{json}", output.status).into());
        }
        if status == 1 {
            insta::assert_snapshot!("unstable", String::from_utf8_lossy(&output.stderr));
        }
    }
    Ok(())
}
