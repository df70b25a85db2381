//! `render --watch` from outside: files are written as editors write them, and pictures have to follow.
//!
//! Needs a GPU adapter, a software one will do; without one each case is named as skipped, which
//! `HEMISPLAT_REQUIRE=gpu` makes a failure.

mod skips;

use assert_cmd::Command;
use hemisplat::measure::Layers;
use libtest_mimic::{Arguments, Failed, Trial};
use skips::Missing;
use std::{
    fs,
    process::{Child, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};
use tempfile::TempDir;

type Outcome = Result<(), Failed>;
type Case = fn() -> Outcome;

const CASES: &[(&str, Case)] = &[
    ("a_picture_follows_its_scene_and_stays_while_that_is_broken", broken_and_mended),
    ("files_that_documents_name_are_watched_missing_ones_too", named_files),
    ("a_pipeline_changes_and_the_scene_stays_loaded", pipelines),
    ("what_ships_is_not_waited_for", shipped),
];

/// How long a round may take, on a machine that does other things too.
const PATIENCE: Duration = Duration::from_secs(60);

fn main() {
    let gpu = Missing::gpu();
    let signals = (!cfg!(unix)).then(|| Missing::new("tools", "no signals"));
    let trials: Vec<Trial> = CASES.iter().map(|(name, case)| skips::trial(*name, gpu.clone().or(signals.clone()).as_ref(), case)).collect();
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

fn check(holds: bool, what: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(what().into()) }
}

/// A box on a floor of this material, under a white sky, and the geometry of a file where one is named.
fn scene(material: &str, file: &str) -> String {
    format!(
        "Scene(version: 1, geometry: [Box(min: (0, 0, 0), max: (1, 1, 1), material: \"floor\"), \
         Box(min: (-3, -1, -3), max: (3, 0, 3), material: \"floor\"), {file}], environment: Constant((1, 1, 1)), \
         materials: {{ \"floor\": {material} }}, cameras: {{ \"main\": (eye: (3, 3, 3), target: (0, 0, 0), fov: 40, size: (16, 16)) }})"
    )
}

const GREY: &str = "Diffuse(reflectance: (0.5, 0.5, 0.5))";

/// A run of the program in a folder of its own.
struct Watched {
    folder: TempDir,
    child: Child,
    /// Rounds that were told so far.
    rounds: usize,
}

impl Watched {
    /// Starts it on `scene.ron`, among these files, and waits for the first round.
    fn start(pipeline: &str, files: &[(&str, &str)]) -> Result<Self, Failed> {
        let folder = tempfile::tempdir()?;
        files.iter().try_for_each(|(name, text)| fs::write(folder.path().join(name), text))?;
        let child = std::process::Command::new(env!("CARGO_BIN_EXE_hemisplat"))
            .current_dir(folder.path())
            .args(["render", pipeline, "--scene", "scene.ron", "--watch", "-o", "out.exr"])
            .stdout(Stdio::null())
            .stderr(fs::File::create(folder.path().join("told"))?)
            .spawn()?;
        let mut watched = Self { folder, child, rounds: 0 };
        watched.next_round()?;
        Ok(watched)
    }

    fn told(&self) -> String {
        fs::read_to_string(self.folder.path().join("told")).unwrap_or_default()
    }

    /// What is told of the next round, its last line.
    fn next_round(&mut self) -> Result<String, Failed> {
        let start = Instant::now();
        loop {
            let told = self.told();
            if let Some(line) = told.lines().filter(|line| line.contains("; watching ")).nth(self.rounds) {
                self.rounds += 1;
                return Ok(line.to_owned());
            }
            check(start.elapsed() < PATIENCE && self.child.try_wait()?.is_none(), || format!("no round {}: {told}", self.rounds))?;
            sleep(Duration::from_millis(20));
        }
    }

    /// Replaces a file as editors do: what is new gets its name after the old one is gone.
    fn replace(&mut self, name: &str, text: &str) -> Result<String, Failed> {
        let (old, new) = (self.folder.path().join(name), self.folder.path().join("new"));
        fs::write(&new, text)?;
        fs::remove_file(&old).ok();
        sleep(Duration::from_millis(300));
        fs::rename(new, old)?;
        self.next_round()
    }

    fn picture(&self) -> Result<Vec<f32>, Failed> {
        let picture = Layers::read(&fs::read(self.folder.path().join("out.exr"))?).map_err(|error| error.to_string())?;
        Ok(picture.rgb("picture").map_err(|error| error.to_string())?.concat())
    }

    /// Interrupts it; what it says at the end.
    fn interrupt(mut self) -> Result<String, Failed> {
        std::process::Command::new("kill").args(["-INT", &self.child.id().to_string()]).status()?;
        let status = self.child.wait()?.code();
        check(status == Some(130), || format!("status {status:?}: {}", self.told()))?;
        Ok(self.told())
    }
}

/// One that a failed case leaves must not wait for ever.
impl Drop for Watched {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

fn broken_and_mended() -> Outcome {
    let mut watched = Watched::start("irradiance", &[("scene.ron", &scene(GREY, ""))])?;
    let first = watched.picture()?;
    let line = watched.replace("scene.ron", &scene("Diffuse(reflectance: (0.25, 0.5, 0.5))", ""))?;
    check(line.starts_with("scene.ron changed: rendered in ") && line.ends_with("watching 1 file, Ctrl-C ends"), || line)?;
    let second = watched.picture()?;
    check(first != second, || "the picture is the old one".into())?;
    let line = watched.replace("scene.ron", &scene("Diffuse(reflectance: (7, 0, 0))", ""))?;
    check(line.starts_with("scene.ron changed: not rendered, what there is stays") && watched.told().contains("scene::range"), || watched.told())?;
    check(watched.picture()? == second, || "the picture of before is gone".into())?;
    watched.replace("scene.ron", &scene(GREY, ""))?;
    check(watched.picture()? == first, || "the picture is not that of the mended scene".into())?;
    let told = watched.interrupt()?;
    check(told.contains("what was whole is in out.exr"), || told.clone())
}

fn named_files() -> Outcome {
    let triangle = |height: f32| format!("v 0 {height} 0\nv 3 {height} 0\nv 0 {height} 3\nusemtl wall\nf 1 2 3\n");
    let mut watched = Watched::start("irradiance", &[("scene.ron", &scene(GREY, "File(\"wall.obj\")"))])?;
    check(watched.told().contains("scene::not_found"), || watched.told())?;
    let line = watched.replace("wall.obj", &("mtllib wall.mtl\n".to_owned() + &triangle(1.5)))?;
    check(line.starts_with("wall.obj changed: rendered in "), || line)?;
    let without_library = watched.picture()?;
    let line = watched.replace("wall.mtl", "newmtl wall\nKd 0.9 0 0\n")?;
    check(line.starts_with("wall.mtl changed: rendered in ") && line.contains("watching 3 files"), || line)?;
    check(watched.picture()? != without_library, || "the library makes no difference".into())?;
    watched.interrupt().map(drop)
}

fn pipelines() -> Outcome {
    let variant = |accuracy: f32| format!("Variant(version: 1, about: \"\", of: \"irradiance.ron\", set: {{ \"cache.accuracy\": {accuracy} }})");
    // A scene of which something is told when it is loaded.
    let scene = scene(GREY, "")
        .replace("cameras:", "lights: [], cameras:")
        .replace("Box(", "Quad(corners: ((0, 0, 0), (0, 0, 0), (1, 1, 0), (0, 1, 0)), material: \"floor\"), Box(");
    let mut watched = Watched::start("mine.ron", &[("scene.ron", &scene), ("mine.ron", &variant(0.2))])?;
    let (first, notes) = (watched.picture()?, watched.told().matches("have no area").count());
    check(notes == 1, || watched.told())?;
    let line = watched.replace("mine.ron", &variant(0.9))?;
    check(line.starts_with("mine.ron changed: rendered in "), || line)?;
    check(watched.picture()? != first, || "the picture is the old one".into())?;
    check(watched.told().matches("have no area").count() == 1, || "the scene was loaded again".into())?;
    watched.replace("scene.ron", &(scene + " "))?;
    check(watched.told().matches("have no area").count() == 2, || "the scene was not loaded again".into())?;
    watched.interrupt().map(drop)
}

fn shipped() -> Outcome {
    let folder = tempfile::tempdir()?;
    let arguments = ["render", "irradiance", "--scene", "cornell", "--size", "8x8", "--watch", "-o", "out.exr"];
    let output = Command::new(env!("CARGO_BIN_EXE_hemisplat")).current_dir(folder.path()).args(arguments).output()?;
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    check(output.status.code() == Some(2) && told.contains("cli::nothing_to_watch"), || told)
}
