//! The machine that is measured on, and commands that run on it.

use crate::{Failure, kept::read};
use hemisplat::measure::cache::Checksum;
use serde::{Deserialize, Serialize};
use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, ExitCode},
    time::Instant,
};

/// What times depend on beside the programs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Machine {
    pub cores: usize,
    /// None where the system does not tell it.
    pub cpu: Option<String>,
    /// Its caches, the nearest first; none where the system does not tell them.
    pub caches: Vec<String>,
    /// The one that hemisplat runs on: its name, kind, backend and driver.
    pub adapter: String,
}

/// A finished command: how long it took from start to end, and what it printed.
pub struct Done {
    pub seconds: f64,
    /// The share of the processors' time that went to others meanwhile; None where the system does not tell it.
    pub others: Option<f64>,
    pub stdout: Vec<u8>,
}

/// The folder of this checkout, in which commands run.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Of the contents of files.
pub fn checksum(files: &[&Path]) -> Result<String, Failure> {
    let mut checksum = Checksum::default();
    for file in files {
        checksum.add(&read(file)?);
    }
    Ok(checksum.finish())
}

/// Where a program is, and its version with a checksum of it, in which shaders and pipelines stand.
pub fn hemisplat(program: &Path) -> Result<(PathBuf, String), Failure> {
    let program = fs::canonicalize(program).map_err(|error| format!("no program {}: {error}", program.display()))?;
    let version = format!("{} ({})", env!("CARGO_PKG_VERSION"), checksum(&[&program])?);
    Ok((program, version))
}

/// How a measurement ends: with what went wrong, if anything did.
pub fn ended(measured: Result<(), Failure>) -> ExitCode {
    match measured {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::FAILURE
        }
    }
}

/// Runs a command to its end.
pub fn finish(command: &mut Command) -> Result<Done, Failure> {
    let name = command.get_program().to_string_lossy().into_owned();
    let (before, start) = (Usage::now(), Instant::now());
    let output = command.current_dir(root()).output().map_err(|error| format!("cannot run {name}: {error}"))?;
    let seconds = start.elapsed().as_secs_f64();
    if output.status.success() {
        let others = before.zip(Usage::now()).and_then(|(before, after)| after.others_since(&before));
        return Ok(Done { seconds, others, stdout: output.stdout });
    }
    let arguments = command.get_args().map(|argument| argument.to_string_lossy()).collect::<Vec<_>>().join(" ");
    Err(format!("{name} {arguments}\nended with {}:\n{}", output.status, String::from_utf8_lossy(&output.stderr)).into())
}

/// Of a run that others disturb.
const TRIES: u32 = 4;

/// Runs until no other process has more than such a share of the processors' time meanwhile, as `others` tells of a run.
pub fn undisturbed<T>(name: &str, most: f64, run: impl Fn() -> Result<T, Failure>, others: impl Fn(&T) -> Option<f64>) -> Result<T, Failure> {
    for _ in 0..TRIES {
        let run = run()?;
        match others(&run).filter(|others| *others > most) {
            None => return Ok(run),
            Some(others) => eprint!("others had {:.1} %, once more … ", others * 100.0),
        }
    }
    let most = most * 100.0;
    Err(format!("{name}: in {TRIES} runs others had more than {most} % of the processors' time: end what else runs here").into())
}

/// A command as anyone would type it, wherever hemisplat and files are here.
pub fn shown(command: &Command, hemisplat: &Path, folder: &Path) -> String {
    let program = if command.get_program() == hemisplat { "hemisplat" } else { "python" };
    let folder = folder.display().to_string();
    let arguments = command.get_args().map(|argument| argument.to_string_lossy().replace(&folder, "OUT"));
    std::iter::once(program.to_owned()).chain(arguments).collect::<Vec<_>>().join(" ")
}

impl Machine {
    pub fn find(hemisplat: &Path) -> Result<Self, Failure> {
        let adapters = String::from_utf8(finish(Command::new(hemisplat).arg("adapters"))?.stdout)?;
        // Behind that its limits are told.
        let usable = adapters.lines().next().and_then(|first| first.split_once(": usable"));
        let adapter = usable.map(|(adapter, _)| adapter.to_owned()).ok_or("hemisplat names no usable adapter")?;
        let cpus = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let cpu = cpus.lines().find(|line| line.starts_with("model name")).and_then(|line| line.split_once(": "));
        let cores = std::thread::available_parallelism().map_or(1, |count| count.get());
        Ok(Self { cores, cpu: cpu.map(|(_, name)| name.trim().to_owned()), caches: caches(), adapter })
    }
}

/// Those of the first core, as the kernel lists them.
fn caches() -> Vec<String> {
    let told = |index: u32, file: &str| {
        let text = fs::read_to_string(format!("/sys/devices/system/cpu/cpu0/cache/index{index}/{file}")).ok()?;
        Some(text.trim().to_owned())
    };
    let cache = |index| Some(format!("L{} {} {}", told(index, "level")?, told(index, "type")?.to_lowercase(), told(index, "size")?));
    (0..8).map_while(cache).collect()
}

/// How much of the processors' time was spent, in the kernel's ticks, and how much of it by this process and by children that have ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Usage {
    all: u64,
    idle: u64,
    own: u64,
}

impl Usage {
    fn now() -> Option<Self> {
        Self::read(&fs::read_to_string("/proc/stat").ok()?, &fs::read_to_string("/proc/self/stat").ok()?)
    }

    /// From the texts of `/proc/stat` and `/proc/self/stat`.
    pub fn read(system: &str, own: &str) -> Option<Self> {
        let numbers = |text: &str| text.split_whitespace().map(|word| word.parse().unwrap_or(0)).collect::<Vec<u64>>();
        // User, nice, system, idle, waiting for files, interrupts twice, stolen; guests, which follow, are among the users.
        let ticks = numbers(system.lines().next()?.strip_prefix("cpu ")?);
        let ticks = ticks.get(..8)?;
        // After the name, which may hold spaces, this process and its children: user and system of each.
        let own = numbers(own.rsplit_once(')')?.1).get(11..15)?.iter().sum();
        Some(Self { all: ticks.iter().sum(), idle: ticks[3] + ticks[4], own })
    }

    /// The share of all that went to other processes, to the kernel for them, and to other machines on the same processors.
    pub fn others_since(&self, before: &Self) -> Option<f64> {
        let all = self.all.checked_sub(before.all)?;
        let spent = all.saturating_sub(self.idle.saturating_sub(before.idle));
        (all > 0).then(|| spent.saturating_sub(self.own.saturating_sub(before.own)) as f64 / all as f64)
    }
}

/// What a system's own program prints; None where it cannot.
fn told(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).current_dir(root()).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// The commit of this checkout, marked where files differ from it.
pub fn commit() -> Option<String> {
    told("git", &["describe", "--always", "--dirty", "--abbrev=40", "--exclude", "*"])
}

/// What the program is made of: files that differ from the commit here make figures those of no commit.
const PROGRAM: [&str; 10] = ["Cargo.toml", "Cargo.lock", "src", "passes", "pipelines", "scenes", "shaders", "studies", "benches/peers", "benches/race"];

/// The commit of this checkout; refused where the program differs from it.
pub fn clean_commit() -> Result<String, Failure> {
    let commit = told("git", &["rev-parse", "HEAD"]).ok_or("`git rev-parse HEAD` does not tell the commit, by which figures are known")?;
    let differing = told("git", &[&["status", "--porcelain", "--"][..], &PROGRAM].concat()).unwrap_or_default();
    if differing.is_empty() {
        return Ok(commit);
    }
    Err(format!("figures are kept of a commit: commit these first, or put them away\n{differing}").into())
}

/// Of an entry of benches/changes.ron what a result keeps.
#[derive(Deserialize)]
struct Change {
    change: String,
}

/// The changes that this program has, by which its figures are known to be of before or after each.
pub fn changes() -> Result<Vec<String>, Failure> {
    let path = "benches/changes.ron";
    let list: Vec<Change> = ron::from_str(&String::from_utf8(read(&root().join(path))?)?).map_err(|error| format!("{path}: {error}"))?;
    Ok(list.into_iter().map(|change| change.change).collect())
}

/// Today, as YYYY-MM-DD in universal time.
pub fn date() -> Result<String, Failure> {
    told("date", &["-u", "+%F"]).ok_or_else(|| "`date -u +%F` does not tell the day".into())
}
