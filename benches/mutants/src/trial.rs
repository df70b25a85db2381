//! Tests, one at a time, each in a process of its own.

use crate::Work;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::{
    collections::{BTreeSet, HashMap},
    os::unix::process::CommandExt,
    path::PathBuf,
    process::{Command, Stdio},
    time::{Duration, Instant},
};

/// How many seconds of the clock a test may take for each of processors that it may.
const PATIENCE: f64 = 20.0;

/// One of the copy's tests.
#[derive(Serialize, Deserialize)]
pub struct Test {
    /// `lib`, or its file.
    pub of: String,
    program: PathBuf,
    pub name: String,
    /// Of processors, without a change, while places are encoded.
    pub seconds: f64,
    /// First numbers of the places.
    pub reached: BTreeSet<usize>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    Passed,
    Failed,
    /// Not in its seconds of processors.
    Stopped,
    /// Not in far more seconds of the clock, so that it waits for something, or other work holds the processors.
    Hung,
}

impl Ended {
    /// What it says of a change.
    pub fn word(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed => "noticed",
            Self::Stopped => "endless",
            Self::Hung => "hung",
        }
    }
}

impl Test {
    pub fn title(&self) -> String {
        format!("{}: {}", self.of, self.name)
    }

    /// With a setting of the switch. Seconds are those of processors, which other work on the machine leaves as they are.
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
            let Used { ended, seconds } = Used::by(child.id());
            let overdue = if seconds > limit { Some(Ended::Stopped) } else { (started.elapsed().as_secs_f64() > PATIENCE * limit).then_some(Ended::Hung) };
            if ended {
                let passed = child.wait().expect("a child").success();
                return (if passed { Ended::Passed } else { Ended::Failed }, seconds);
            }
            if let Some(overdue) = overdue {
                let _ = Command::new("kill").args(["-KILL", "--", &format!("-{}", child.id())]).status();
                let _ = child.wait();
                return (overdue, seconds);
            }
            std::thread::sleep(Duration::from_millis(3));
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

/// What a child has used so far.
struct Used {
    /// A child that ended tells its seconds until it is waited for.
    ended: bool,
    /// Of processors: its own, of all threads, and those of its children that it waited for.
    seconds: f64,
}

impl Used {
    /// As Linux tells: `PID (NAME) STATE ...`, where times are in hundredths of a second. Names may hold anything.
    fn by(child: u32) -> Self {
        let text = std::fs::read_to_string(format!("/proc/{child}/stat")).expect("Linux");
        let fields: Vec<&str> = text.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
        let ticks = fields[11..15].iter().map(|field| field.parse::<f64>().expect("a time"));
        Self { ended: fields[0] == "Z", seconds: ticks.sum::<f64>() / 100.0 }
    }
}

/// Builds tests of the copy and measures each that passes in time: of `lib` or a file, or `FILE=PART` those whose names hold a part.
pub fn measured(work: &Work, of: &[String], longest: f64) -> Vec<Test> {
    let parts: HashMap<&str, &str> = of.iter().map(|of| of.split_once('=').unwrap_or((of, ""))).collect();
    let targets = parts.keys().flat_map(|of| if *of == "lib" { vec!["--lib"] } else { vec!["--test", of] });
    let built = work.cargo("test").args(["--no-run", "--message-format=json"]).args(targets).stderr(Stdio::inherit()).output().expect("cargo");
    assert!(built.status.success(), "the tests do not build");
    let messages = String::from_utf8_lossy(&built.stdout).lines().filter_map(|line| serde_json::from_str::<Value>(line).ok()).collect::<Vec<_>>();
    let mut tests: Vec<Test> = messages
        .iter()
        .filter(|message| message["profile"]["test"] == true)
        .filter_map(|message| {
            let of = if message["target"]["kind"][0] == "test" { message["target"]["name"].as_str()? } else { "lib" };
            Some(list(work, of, parts.get(of)?, message["executable"].as_str()?))
        })
        .flatten()
        .collect();
    let passes = work.each(&mut tests, |index, test| test.measure(work, index, longest));
    let mut passes = passes.into_iter();
    tests.retain(|_| passes.next() == Some(true));
    tests
}

fn list(work: &Work, of: &str, part: &str, program: &str) -> Vec<Test> {
    let names = |more: &[&str]| {
        let listed = work.tests(&mut Command::new(program)).args(["--list", "--format", "terse"]).args(more).output().expect("a test");
        let listed = String::from_utf8_lossy(&listed.stdout).into_owned();
        listed.lines().filter_map(|line| line.strip_suffix(": test").map(str::to_owned)).collect::<BTreeSet<_>>()
    };
    let long = names(&["--ignored"]);
    let test = |name| Test { of: of.into(), program: program.into(), name, seconds: 0.0, reached: BTreeSet::new() };
    names(&[]).into_iter().filter(|name| name.contains(part) && !long.contains(name)).map(test).collect()
}
