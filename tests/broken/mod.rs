//! Mistakes that are made on purpose, each in one line of the program, and the test that has to notice it, most often a golden picture: tests/broken.ron lists them, and
//! docs/guards.md shows the list.
//!
//! A mistake in a shader needs no build: a debug build reads shaders from the folder that `HEMISPLAT_SHADERS` names. One in Rust is made in a copy of the
//! project, which is built beside.

use libtest_mimic::Failed;
use serde::Deserialize;
use std::{
    collections::HashSet,
    fs, io,
    path::{Path, PathBuf},
    process::Command,
    sync::Mutex,
};
use tempfile::TempDir;

const LIST: &str = "tests/broken.ron";

/// One mistake.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Broken {
    /// What is wrong with it, in words.
    pub what: String,
    /// From the project's root.
    pub file: PathBuf,
    /// What stands there, once.
    from: String,
    to: String,
    /// The golden picture that notices, by the name of its test, or another test as `FILE: NAME`; `lib` is the file of the library's own.
    pub falls: String,
    /// Whether each run of the tests makes sure of it.
    #[serde(default)]
    pub always: bool,
}

pub fn list(root: &Path) -> Result<Vec<Broken>, Failed> {
    Ok(ron::from_str(&fs::read_to_string(root.join(LIST))?).map_err(|error| format!("{LIST}: {error}"))?)
}

impl Broken {
    pub fn is_shader(&self) -> bool {
        self.file.starts_with("shaders")
    }

    /// The file with the mistake.
    pub fn text(&self, root: &Path) -> Result<String, Failed> {
        let text = fs::read_to_string(root.join(&self.file)).map_err(|error| format!("{}: {error}", self.file.display()))?;
        match text.matches(&self.from).count() {
            1 => Ok(text.replace(&self.from, &self.to)),
            count => Err(format!("{}: {} holds this {count} times, not once: {}", self.what, self.file.display(), self.from).into()),
        }
    }

    /// A folder of shaders of which one has the mistake.
    pub fn shaders(&self, root: &Path) -> Result<TempDir, Failed> {
        let folder = tempfile::tempdir()?;
        let inside = self.file.strip_prefix("shaders").map_err(|error| error.to_string())?;
        let path = folder.path().join(inside);
        fs::create_dir_all(path.parent().unwrap_or(folder.path()))?;
        fs::write(path, self.text(root)?)?;
        Ok(folder)
    }

    /// The file of tests, and the test in it.
    fn test(&self) -> (&str, &str) {
        self.falls.split_once(": ").unwrap_or(("golden", &self.falls))
    }

    /// Whether a golden picture notices it.
    pub fn falls_to_a_picture(&self) -> bool {
        !self.falls.contains(": ")
    }

    /// Expects a test to fall with the shader.
    pub fn falls_with_shaders(&self, root: &Path) -> Result<(), Failed> {
        let shaders = self.shaders(root)?;
        self.falls(Command::new(env!("CARGO")).current_dir(root).env("HEMISPLAT_SHADERS", shaders.path()))
    }

    /// Makes the mistake in a copy of the project, builds that, and expects a test to fall.
    pub fn falls_in_a_copy(&self, root: &Path) -> Result<(), Failed> {
        static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
        let _guard = ONE_AT_A_TIME.lock().map_err(|error| error.to_string())?;
        let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join("broken");
        renew(root, &copy)?;
        fs::write(copy.join(&self.file), self.text(root)?)?;
        self.falls(Command::new(env!("CARGO")).current_dir(&copy).env("CARGO_TARGET_DIR", copy.join("target")))
    }

    fn falls(&self, cargo: &mut Command) -> Result<(), Failed> {
        let (test, name) = self.test();
        cargo.args(["test", "--locked"]);
        let cargo = if test == "lib" { cargo.arg("--lib") } else { cargo.args(["--test", test]) };
        let done = cargo.args(["--", "--exact", name, "--include-ignored"]).output()?;
        let told = String::from_utf8_lossy(&done.stdout);
        match () {
            () if told.contains("test result: FAILED. 0 passed; 1 failed;") => Ok(()),
            () if told.contains("test result: ok. 1 passed;") => Err(format!("{} does not notice", self.falls).into()),
            () => Err(format!("the test did not run: {told}{}", String::from_utf8_lossy(&done.stderr)).into()),
        }
    }
}

/// Makes a folder hold the project's files as they are now; those that did not change keep their times, so that a build goes on from the last one.
fn renew(root: &Path, copy: &Path) -> Result<(), Failed> {
    let listed = Command::new("git").args(["ls-files", "-z", "--cached", "--others", "--exclude-standard"]).current_dir(root).output()?;
    if !listed.status.success() {
        return Err("the project is copied by what git lists: it has to be a checkout".into());
    }
    let listed = String::from_utf8(listed.stdout)?;
    let mut files = HashSet::new();
    for file in listed.split_terminator('\0') {
        let (from, to) = (root.join(file), copy.join(file));
        let text = match fs::read(&from) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
            read => read?,
        };
        if fs::read(&to).ok().as_ref() != Some(&text) {
            fs::create_dir_all(to.parent().unwrap_or(copy))?;
            fs::write(&to, text)?;
        }
        files.insert(to);
    }
    remove_others(copy, &files, &copy.join("target"))
}

/// Removes what is in a folder and is none of these files, but for one folder: a module that was moved would be there twice.
fn remove_others(folder: &Path, files: &HashSet<PathBuf>, but_for: &Path) -> Result<(), Failed> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() && path != but_for {
            remove_others(&path, files, but_for)?;
        } else if path.is_file() && !files.contains(&path) {
            fs::remove_file(path)?;
        }
    }
    Ok(())
}

/// The list as docs/guards.md shows it.
pub fn table(list: &[Broken]) -> String {
    let row =
        |broken: &Broken| format!("| {} | `{}` | {}{} |\n", broken.what, broken.file.display(), broken.falls, if broken.always { ", in each run" } else { "" });
    "| broken | in | noticed by |\n|---|---|---|\n".to_owned() + &list.iter().map(row).collect::<String>()
}
