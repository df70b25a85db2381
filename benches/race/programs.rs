//! The programs that race: where they are, how each is run once, what its picture is worth.

use crate::{
    Failure,
    kept::{Run, read},
    machine::{self, Done, Machine, checksum, finish, root},
    peers::Peers,
    settings::{Case, Denoised, Hemisplat, Mitsuba, Race, Radiance, Setting, Start},
};
use hemisplat::measure::Errors;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::{
    env,
    ffi::OsStr,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

/// What would keep a driver from remembering its shaders.
const NO_SHADER_CACHE: [&str; 2] = ["MESA_SHADER_CACHE_DISABLE", "MESA_GLSL_CACHE_DISABLE"];
/// Where drivers and libraries keep them.
const SHADER_CACHES: [&str; 2] = ["MESA_SHADER_CACHE_DIR", "XDG_CACHE_HOME"];

/// What a point belongs to, beside its settings: another version makes other points.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Versions {
    /// With a checksum of the program, in which shaders and pipelines stand.
    pub hemisplat: String,
    /// pyradiance, with a checksum of the script that runs it.
    pub radiance: String,
    /// With a checksum of the scripts that run it.
    pub mitsuba: String,
    /// pyoidn, with a checksum of the script that runs it.
    pub denoiser: String,
}

pub struct Programs {
    hemisplat: PathBuf,
    peers: Peers,
    scenes: PathBuf,
    pub versions: Versions,
    pub machine: Machine,
}

/// The references of a scene: of every k-th pixel, with its variance, and of windows.
pub struct Truth {
    pub indirect: PathBuf,
    pub variance: PathBuf,
    pub windows: PathBuf,
}

/// What a peer's script prints of its own seconds.
#[derive(Deserialize)]
struct Printed {
    seconds: f64,
    #[serde(flatten)]
    facts: Value,
}

fn scenes() -> Result<PathBuf, Failure> {
    let folder = env::var_os("HEMISPLAT_SCENES").map(PathBuf::from);
    folder.ok_or_else(|| "HEMISPLAT_SCENES names no folder: it is to hold sibenik/sibenik.obj and sponza/sponza.obj (docs/scenes.md)".into())
}

impl Programs {
    /// Finds them, or says what is missing and how to get it.
    pub fn find(hemisplat: &Path) -> Result<Self, Failure> {
        let (hemisplat, version) = machine::hemisplat(hemisplat)?;
        let peers = Peers::find()?;
        let versions = Versions {
            hemisplat: version,
            radiance: peers.radiance(&["radiance.py"])?,
            mitsuba: peers.mitsuba(&["mitsuba_reference.py", "windows.py", "mitsuba_cast.py"])?,
            denoiser: peers.denoiser(&["mitsuba_denoised.py"])?,
        };
        let machine = Machine::find(&hemisplat)?;
        Ok(Self { hemisplat, peers, scenes: scenes()?, versions, machine })
    }

    /// Stands for all that is drawn: geometry, light, camera.
    pub fn scene_checksum(&self, case: &Case) -> Result<String, Failure> {
        let obj = self.scenes.join(&case.name).join(format!("{}.obj", case.name));
        checksum(&[&obj, &root().join("benches/peers/cases.json"), &root().join(scene_file(case))])
    }

    /// The scene's truths into a folder.
    pub fn trace(&self, race: &Race, case: &Case, folder: &Path) -> Result<Value, Failure> {
        let truth = race.truth;
        let trace = |what: &str, number: u32| -> Result<Value, Failure> {
            let numbers = [("--size", race.size), (what, number), ("--samples", truth.samples), ("--bounces", race.bounces)];
            let done = finish(self.script("mitsuba_reference.py", case, &numbers.map(|(name, value)| (name, value.to_string()))).arg("-o").arg(folder))?;
            Ok(serde_json::from_slice(&done.stdout)?)
        };
        Ok(json!({ "stride": trace("--stride", truth.stride)?, "windows": trace("--windows", truth.windows)? }))
    }

    /// Runs a setting once, in an empty folder of its own, and judges its picture.
    pub fn run(&self, race: &Race, case: &Case, setting: &Setting, truth: &Truth, folder: &Path) -> Result<Run, Failure> {
        let bounces = ("--bounces", race.bounces.to_string());
        match setting {
            Setting::Radiance(Radiance { accuracy, samples, resolution }) => {
                let numbers = [("--accuracy", accuracy.to_string()), ("--samples", samples.to_string()), ("--resolution", resolution.to_string())];
                let rest = [("--size", race.size.to_string()), bounces, ("--processes", self.machine.cores.to_string())];
                self.run_peer(case, truth, folder, self.script("radiance.py", case, &[&numbers[..], &rest].concat()))
            }
            Setting::Mitsuba(Mitsuba { strata }) => {
                let numbers = [("--size", race.size.to_string()), bounces, ("--strata", strata.to_string())];
                self.run_peer(case, truth, folder, self.script("mitsuba_cast.py", case, &numbers))
            }
            Setting::Denoised(Denoised { rays, quality }) => {
                let numbers = [("--size", race.size.to_string()), bounces, ("--rays", rays.to_string()), ("--quality", quality.name().to_owned())];
                self.run_peer(case, truth, folder, self.script("mitsuba_denoised.py", case, &numbers))
            }
            Setting::Hemisplat(ours) => self.run_ours(race, case, ours, truth, folder),
        }
    }

    /// Fills the driver's cache with the shaders of a setting.
    pub fn warm_up(&self, race: &Race, case: &Case, ours: &Hemisplat, folder: &Path) -> Result<(), Failure> {
        finish(&mut self.render(race, case, ours, &race.warm_up, folder)).map(drop)
    }

    fn script(&self, name: &str, case: &Case, numbers: &[(&str, String)]) -> Command {
        let mut command = self.peers.script(name);
        command.arg(&case.name);
        command.args(numbers.iter().flat_map(|(name, value)| [*name, value]));
        command
    }

    /// The script's own seconds count: they leave out what belongs to the script, not to the program.
    fn run_peer(&self, case: &Case, truth: &Truth, folder: &Path, mut command: Command) -> Result<Run, Failure> {
        let done = finish(command.arg("-o").arg(folder))?;
        let Printed { seconds, facts } = serde_json::from_slice(&done.stdout)?;
        let [errors, in_windows] = self.judge(&folder.join(format!("{}.indirect.exr", case.name)), truth)?;
        Ok(Run { command: machine::shown(&command, &self.hemisplat, folder), seconds, others: done.others, errors, in_windows, facts })
    }

    /// The whole command counts, from its start to the files written.
    fn run_ours(&self, race: &Race, case: &Case, ours: &Hemisplat, truth: &Truth, folder: &Path) -> Result<Run, Failure> {
        let mut command = self.render(race, case, ours, &[], folder);
        if ours.start == Start::Cold {
            let empty = folder.join("no-shaders");
            fs::create_dir(&empty)?;
            command.envs(SHADER_CACHES.map(|name| (name, &empty)));
        }
        let Done { seconds, others, .. } = finish(&mut command)?;
        let stats: Value = serde_json::from_slice(&read(&folder.join("out.json"))?)?;
        let facts = json!({ "records": stats["frames"][0]["records"]["irradiance"], "start_up": stats["start_up"] });
        let [errors, in_windows] = self.judge(&folder.join("out.exr"), truth)?;
        Ok(Run { command: machine::shown(&command, &self.hemisplat, folder), seconds, others, errors, in_windows, facts })
    }

    fn render(&self, race: &Race, case: &Case, ours: &Hemisplat, also: &[String], folder: &Path) -> Command {
        let mut command = Command::new(&self.hemisplat);
        command.args(["render", &ours.pipeline, "--scene", &scene_file(case), "--size", &format!("{0}x{0}", race.size), "--strict"]);
        command.args(ours.set.iter().chain(also).flat_map(|set| ["--set", set]));
        command.arg("-o").arg(folder.join("out.exr")).arg("--stats").arg(folder.join("out.json"));
        for name in NO_SHADER_CACHE {
            command.env_remove(name);
        }
        command
    }

    /// The errors at every k-th pixel, and those in windows.
    fn judge(&self, picture: &Path, truth: &Truth) -> Result<[Errors; 2], Failure> {
        let diff = |reference: &Path, more: &[&OsStr]| -> Result<Errors, Failure> {
            let json = picture.with_extension("diff.json");
            let mut command = Command::new(&self.hemisplat);
            command.args(["diff", &format!("{}:irradiance", picture.display())]).arg(reference);
            finish(command.args(more).arg("--json").arg(&json))?;
            Ok(serde_json::from_slice(&read(&json)?)?)
        };
        Ok([diff(&truth.indirect, &["--variance".as_ref(), truth.variance.as_os_str()])?, diff(&truth.windows, &[])?])
    }
}

fn scene_file(case: &Case) -> String {
    format!("scenes/{}.ron", case.name)
}
