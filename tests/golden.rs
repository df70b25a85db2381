//! One golden picture a pipeline file: the Cornell box, small. A change of the light that a viewer would not see passes; a wrong
//! weight, sign or bias does not. `HEMISPLAT_UPDATE_GOLDEN=1 cargo test --test golden` draws the pictures anew and prints how far
//! old and new are from the truth; a picture that is farther from it than the old one also needs `HEMISPLAT_ACCEPT_WORSE=1`.

use hemisplat::measure::{Layers, compare};
use libtest_mimic::{Arguments, Failed, Trial};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Edge of the pictures [pixels].
const SIZE: &str = "48x48";
/// Limits on the irradiance: over all pixels, and of the worst percent of blocks. Adapters round differently, and so place other records.
const GLOBAL: f64 = 0.03;
const LOCAL: f64 = 0.08;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn pipelines() -> Vec<PathBuf> {
    let mut files: Vec<_> = std::fs::read_dir(root().join("pipelines")).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|ending| ending == "ron"));
    files.sort();
    files
}

fn hemisplat(arguments: &[&str]) -> Result<(), Failed> {
    let done = Command::new(env!("CARGO_BIN_EXE_hemisplat")).current_dir(root()).args(arguments).output().map_err(|e| e.to_string())?;
    if done.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&done.stderr).into_owned().into()) }
}

fn picture(path: &Path) -> Result<Layers, Failed> {
    let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    Layers::read(&bytes).map_err(|e| e.to_string().into())
}

fn errors(test: &Layers, reference: &Layers) -> Result<[f64; 2], Failed> {
    let errors = compare(test, reference, "irradiance", None).map_err(|e| e.to_string())?;
    Ok(["rmse_over_mean", "block_p99"].map(|name| errors.metric(name).flatten().unwrap_or(f64::INFINITY)))
}

fn check(pipeline: &Path) -> Result<(), Failed> {
    let name = pipeline.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let made = folder.path().join("made.exr");
    // Named from the project's root, so that the file keeps no path of the machine.
    hemisplat(&["render", &format!("pipelines/{name}.ron"), "--scene", "cornell", "--size", SIZE, "--quiet", "-o", &made.to_string_lossy()])?;
    let golden = root().join("tests/golden").join(&name).join("cornell.exr");
    if std::env::var_os("HEMISPLAT_UPDATE_GOLDEN").is_some() {
        return update(&made, &golden, folder.path());
    }
    let [global, local] = errors(&picture(&made)?, &picture(&golden)?)?;
    if global > GLOBAL || local > LOCAL {
        return Err(format!(
            "{name} is {:.2} % off in all and {:.2} % in its worst blocks; {:.0} % and {:.0} % are allowed",
            100.0 * global,
            100.0 * local,
            100.0 * GLOBAL,
            100.0 * LOCAL
        )
        .into());
    }
    Ok(())
}

fn update(made: &Path, golden: &Path, folder: &Path) -> Result<(), Failed> {
    let truth = folder.join("truth.exr");
    hemisplat(&["reference", "--scene", "cornell", "--size", SIZE, "--spp", "1024", "--quiet", "-o", &truth.to_string_lossy()])?;
    let truth = picture(&truth)?;
    let [after, _] = errors(&picture(made)?, &truth)?;
    let before = if golden.exists() { Some(errors(&picture(golden)?, &truth)?[0]) } else { None };
    println!("{}: rmse_over_mean against the truth {before:?} -> {after:.4}", golden.display());
    if before.is_some_and(|before| after > before * 1.02) && std::env::var_os("HEMISPLAT_ACCEPT_WORSE").is_none() {
        return Err("the new picture is farther from the truth; HEMISPLAT_ACCEPT_WORSE=1 takes it all the same".into());
    }
    std::fs::create_dir_all(golden.parent().unwrap_or(golden)).map_err(|e| e.to_string())?;
    std::fs::copy(made, golden).map(|_| ()).map_err(|e| e.to_string().into())
}

fn main() {
    let arguments = Arguments::from_args();
    let has_gpu = hemisplat::gpu::device::adapters().iter().any(|adapter| adapter.lacks.is_empty());
    let required = std::env::var("HEMISPLAT_REQUIRE").is_ok_and(|list| list.split(',').any(|item| item == "gpu"));
    let trials = pipelines()
        .into_iter()
        .map(|pipeline| {
            let name = pipeline.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            if !has_gpu && !required {
                println!("SKIPPED: {name}: no GPU adapter");
            }
            Trial::test(name, move || check(&pipeline)).with_ignored_flag(!has_gpu && !required)
        })
        .collect();
    libtest_mimic::run(&arguments, trials).exit();
}
