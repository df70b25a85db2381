//! The program in a folder of its own, and cases of which some need a device.

#[path = "../skips/mod.rs"]
mod skips;

use libtest_mimic::{Arguments, Failed};
use serde_json::Value;
use skips::Missing;
use std::fs;
use std::process::{Child, Command, Stdio};
use tempfile::TempDir;

pub type Outcome = Result<(), Failed>;
pub type Case = fn() -> Outcome;

/// Runs all cases and ends the process. Without a GPU adapter the `drawn` ones are named as skipped, which `HEMISPLAT_REQUIRE=gpu` makes a failure.
pub fn run(arguments: &Arguments, drawn: &'static [(&'static str, Case)], refused: &'static [(&'static str, Case)]) -> ! {
    let gpu = Missing::gpu();
    let drawn = drawn.iter().map(|(name, case)| skips::trial(*name, gpu.as_ref(), case));
    let refused = refused.iter().map(|(name, case)| skips::trial(*name, None, case));
    libtest_mimic::run(arguments, drawn.chain(refused).collect()).exit()
}

pub fn check(holds: bool, what: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(what().into()) }
}

/// A folder of its own, with a cache of its own.
pub struct Place(pub TempDir);

impl Place {
    pub fn new() -> Result<Self, Failed> {
        Ok(Self(tempfile::tempdir()?))
    }

    pub fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hemisplat"));
        command.current_dir(self.0.path()).args(arguments.split(' ')).env_remove("NO_COLOR").env("XDG_CACHE_HOME", self.0.path().join("cache"));
        command
    }

    /// Status, stdout and stderr.
    pub fn run(&self, arguments: &str) -> Result<(i32, String, String), Failed> {
        let output = self.command(arguments).output()?;
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        Ok((output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr)))
    }

    pub fn succeed(&self, arguments: &str) -> Result<(String, String), Failed> {
        let (status, stdout, stderr) = self.run(arguments)?;
        check(status == 0, || format!("{arguments}: status {status}\n{stderr}"))?;
        Ok((stdout, stderr))
    }

    /// Starts the program without waiting for it.
    #[allow(dead_code, reason = "not all tests stop the program")]
    pub fn start(&self, arguments: &str) -> Result<Child, Failed> {
        Ok(self.command(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn()?)
    }

    pub fn json(&self, name: &str) -> Result<Value, Failed> {
        Ok(serde_json::from_slice(&fs::read(self.0.path().join(name))?)?)
    }

    /// What the page of this name holds.
    #[allow(dead_code, reason = "not all tests make a page")]
    pub fn page(&self, name: &str) -> Result<Value, Failed> {
        let page = fs::read_to_string(self.0.path().join(name))?;
        let data = page.split_once("id=\"data\">").and_then(|(_, rest)| rest.split_once("</script>")).ok_or("no data")?.0;
        Ok(serde_json::from_str(data)?)
    }
}
