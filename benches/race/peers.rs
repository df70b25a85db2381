//! The independent renderers: where they are, and which versions.

use crate::{
    Failure,
    machine::{checksum, finish, root},
};
use std::{
    env,
    path::{Path, PathBuf},
    process::Command,
};

/// Where the peers' scripts lie, from the root.
const SCRIPTS: &str = "benches/peers";

/// What `./bench peers` installs.
pub struct Peers {
    python: PathBuf,
    pyradiance: String,
    mitsuba: String,
    pyoidn: String,
}

fn home() -> PathBuf {
    let default = || PathBuf::from(env::var_os("HOME").unwrap_or_default()).join(".cache/hemisplat-peers");
    env::var_os("PEERS_HOME").map_or_else(default, PathBuf::from)
}

impl Peers {
    /// Finds them, or says what is missing and how to get it.
    pub fn find() -> Result<Self, Failure> {
        let python = home().join("bin/python");
        if !python.is_file() {
            return Err(format!("Radiance, Mitsuba and Open Image Denoise are not in {}: `./bench peers` installs them there", home().display()).into());
        }
        let ask = "from importlib.metadata import version; print(version('pyradiance'), version('mitsuba'), version('pyoidn'))";
        let missing = |why: String| format!("the peers do not tell their versions: run `./bench peers`\n{why}");
        let printed = finish(Command::new(&python).args(["-c", ask])).map_err(|error| missing(error.to_string()))?;
        let printed = String::from_utf8(printed.stdout)?;
        let [pyradiance, mitsuba, pyoidn] = printed.split_whitespace().map(str::to_owned).collect::<Vec<_>>().try_into().map_err(|_| missing(printed))?;
        Ok(Self { python, pyradiance, mitsuba, pyoidn })
    }

    /// Runs a script.
    pub fn script(&self, name: &str) -> Command {
        let mut command = Command::new(&self.python);
        command.arg(Path::new(SCRIPTS).join(name));
        command
    }

    /// pyradiance, with a checksum of the scripts that run it.
    pub fn radiance(&self, scripts: &[&str]) -> Result<String, Failure> {
        with_scripts(&format!("pyradiance {}", self.pyradiance), scripts)
    }

    /// Mitsuba, with a checksum of the scripts that run it.
    pub fn mitsuba(&self, scripts: &[&str]) -> Result<String, Failure> {
        with_scripts(&self.mitsuba, scripts)
    }

    /// pyoidn, with a checksum of the scripts that run it.
    pub fn denoiser(&self, scripts: &[&str]) -> Result<String, Failure> {
        with_scripts(&format!("pyoidn {}", self.pyoidn), scripts)
    }
}

fn with_scripts(version: &str, names: &[&str]) -> Result<String, Failure> {
    let scripts: Vec<PathBuf> = names.iter().map(|name| root().join(SCRIPTS).join(name)).collect();
    Ok(format!("{version} ({})", checksum(&scripts.iter().map(PathBuf::as_path).collect::<Vec<_>>())?))
}
