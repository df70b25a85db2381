//! Tests, one at a time, each in a process of its own.

use crate::Work;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::{
    collections::BTreeSet,
    os::unix::process::CommandExt,
    path::PathBuf,
    process::{Command, Stdio},
    time::{Duration, Instant},
};

/// One of the copy's tests.
#[derive(Serialize, Deserialize)]
pub struct Test {
    /// `lib`, or its file.
    pub of: String,
    program: PathBuf,
    pub name: String,
    /// Without a change, while places are recorded.
    pub seconds: f64,
    /// First numbers of the places.
    pub reached: BTreeSet<usize>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    Passed,
    Failed,
    /// Not in its time.
    Stopped,
}

impl Test {
    pub fn title(&self) -> String {
        format!("{}: {}", self.of, self.name)
    }

    /// With a setting of the switch.
    pub fn run(&self, work: &Work, switch: (&str, &str), limit: f64) -> (Ended, f64) {
        let started = Instant::now();
        // What a change asks for may have no bounds: 16 GiB of memory and 2 of a file are those. A group of processes ends together.
        let mut child = work
            .tests(Command::new("sh").args(["-c", "ulimit -v 16777216 -f 4194304; exec \"$@\"", "sh"]).arg(&self.program))
            .args(["--exact", &self.name, "--test-threads=1"])
            .env(switch.0, switch.1)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .process_group(0)
            .spawn()
            .expect("a shell");
        loop {
            let seconds = started.elapsed().as_secs_f64();
            match child.try_wait().expect("a child") {
                Some(status) => return (if status.success() { Ended::Passed } else { Ended::Failed }, seconds),
                None if seconds > limit => {
                    let _ = Command::new("kill").args(["-KILL", "--", &format!("-{}", child.id())]).status();
                    let _ = child.wait();
                    return (Ended::Stopped, seconds);
                }
                None => std::thread::sleep(Duration::from_millis(3)),
            }
        }
    }

    /// Without a change; whether it passes in its time.
    fn measure(&mut self, work: &Work, index: usize, longest: f64) -> bool {
        let folder = work.folder.join(format!("reached/{index}"));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).expect("room for what is reached");
        let (ended, seconds) = self.run(work, ("MUTANTS_REACHED", &folder.to_string_lossy()), longest);
        self.seconds = seconds;
        let files = std::fs::read_dir(&folder).into_iter().flatten().flatten().filter_map(|file| std::fs::read_to_string(file.path()).ok());
        self.reached = files.flat_map(|text| text.lines().filter_map(|line| line.parse().ok()).collect::<Vec<_>>()).collect();
        if ended != Ended::Passed {
            eprintln!("left out: {} {} {}", self.of, self.name, if ended == Ended::Failed { "fails" } else { "takes longer" });
        }
        ended == Ended::Passed
    }
}

/// Builds tests of the copy and measures each that passes in time.
pub fn measured(work: &Work, of: &[String], longest: f64) -> Vec<Test> {
    let targets = of.iter().flat_map(|of| if of == "lib" { vec!["--lib"] } else { vec!["--test", of] });
    let built = work.cargo("test").args(["--no-run", "--message-format=json"]).args(targets).stderr(Stdio::inherit()).output().expect("cargo");
    assert!(built.status.success(), "the tests do not build");
    let messages = String::from_utf8_lossy(&built.stdout).lines().filter_map(|line| serde_json::from_str::<Value>(line).ok()).collect::<Vec<_>>();
    let mut tests: Vec<Test> = messages
        .iter()
        .filter(|message| message["profile"]["test"] == true)
        .filter_map(|message| {
            let of = if message["target"]["kind"][0] == "test" { message["target"]["name"].as_str()? } else { "lib" };
            Some(list(work, of, message["executable"].as_str()?))
        })
        .flatten()
        .collect();
    let passes = work.each(&mut tests, |index, test| test.measure(work, index, longest));
    let mut passes = passes.into_iter();
    tests.retain(|_| passes.next() == Some(true));
    tests
}

fn list(work: &Work, of: &str, program: &str) -> Vec<Test> {
    let names = |more: &[&str]| {
        let listed = work.tests(&mut Command::new(program)).args(["--list", "--format", "terse"]).args(more).output().expect("a test");
        let listed = String::from_utf8_lossy(&listed.stdout).into_owned();
        listed.lines().filter_map(|line| line.strip_suffix(": test").map(str::to_owned)).collect::<BTreeSet<_>>()
    };
    let long = names(&["--ignored"]);
    let test = |name| Test { of: of.into(), program: program.into(), name, seconds: 0.0, reached: BTreeSet::new() };
    names(&[]).into_iter().filter(|name| !long.contains(name)).map(test).collect()
}
