//! What sequences of scenes that move cost by records that live, by records made anew, and by a few rays a pixel with a denoiser, and how they err and flicker.
//!
//! `./bench frames` builds and runs it; docs/temporal.md tells what came of it. `cargo test --test race` tests its list.

mod film;
#[allow(dead_code, reason = "only parts of the race's modules are of use here")]
#[path = "../race/kept.rs"]
mod kept;
mod list;
#[allow(dead_code, reason = "as above")]
#[path = "../race/machine.rs"]
mod machine;
#[allow(dead_code, reason = "as above")]
#[path = "../race/peers.rs"]
mod peers;

use clap::Parser;
use film::{Film, Judged};
use hemisplat::measure::{IRRADIANCE, Layers, statistics::Spread};
use kept::{Folder, read, write};
use list::{Case, Denoised, List};
use machine::{Machine, finish, root};
use peers::Peers;
use serde::Serialize;
use serde_json::Value;
use std::{
    fmt::Write,
    fs,
    path::{Path, PathBuf},
    process::{Command, ExitCode},
};

type Failure = Box<dyn std::error::Error>;

/// Measure sequences of scenes that move: seconds, errors and flicker of ours, and of denoised path tracing frame by frame
#[derive(Parser)]
#[command(name = "./bench frames")]
struct Options {
    /// One scene of the list alone
    #[arg(long)]
    scene: Option<String>,
    /// Runs of each, in place of those of the list
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    runs: Option<u32>,
    /// Where results go
    #[arg(short, long, default_value = "benches/results")]
    out: PathBuf,
    /// Another build of hemisplat than the one beside
    #[arg(long, value_name = "FILE", default_value = env!("CARGO_BIN_EXE_hemisplat"), hide_default_value = true)]
    program: PathBuf,
    /// Write the tables here too
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// What `cargo bench` says
    #[arg(long, hide = true)]
    bench: bool,
}

/// Keys in JSON are the fields' names.
#[derive(Debug, Serialize)]
struct Report {
    /// Version of this record: 1.
    schema: u32,
    date: String,
    commit: String,
    /// Those of benches/changes.ron that this program has.
    changes: Vec<String>,
    machine: Machine,
    /// With a checksum of the program.
    hemisplat: String,
    mitsuba: String,
    denoiser: String,
    size: [u32; 2],
    truth: u32,
    scenes: Vec<Told>,
}

#[derive(Debug, Serialize)]
struct Told {
    scene: Case,
    rows: Vec<Row>,
}

/// What was found of one way to render a sequence.
#[derive(Debug, Serialize)]
struct Row {
    name: String,
    command: String,
    /// Of a frame, the mean over the sequence, over runs.
    seconds: Spread,
    #[serde(flatten)]
    judged: Judged,
}

/// A way to render a sequence.
enum Way<'l> {
    Ours(&'l str),
    Denoised(&'l Denoised),
}

fn main() -> ExitCode {
    machine::ended(measure(&Options::parse()))
}

fn measure(options: &Options) -> Result<(), Failure> {
    let file = "benches/frames.ron";
    let text = String::from_utf8(read(&root().join(file))?)?;
    let mut list = List::read(&text).and_then(|list| list.only(options.scene.as_deref())).map_err(|error| format!("{file}: {error}"))?;
    list.runs = options.runs.unwrap_or(list.runs);
    let commit = machine::clean_commit()?;
    let (program, hemisplat) = machine::hemisplat(&options.program)?;
    let (peers, machine) = (Peers::find()?, Machine::find(&program)?);
    let bench = Bench { list: &list, program: &program, peers: &peers, folder: Folder::new(Path::new("out/bench-frames"))? };
    let mut report = Report {
        schema: 1,
        date: machine::date()?,
        commit,
        changes: machine::changes()?,
        machine,
        hemisplat,
        mitsuba: peers.mitsuba(&["mitsuba_reference.py", "mitsuba_frames.py"])?,
        denoiser: peers.denoiser(&["mitsuba_denoised.py"])?,
        size: list.size,
        truth: list.truth,
        scenes: Vec::new(),
    };
    let scene = options.scene.as_ref().map_or(String::new(), |scene| format!("-{scene}"));
    let json = options.out.join(format!("{}-frames{scene}.json", report.date));
    for case in &list.scenes {
        report.scenes.push(bench.scene(case)?);
        // A run that is stopped keeps the scenes that it has measured.
        write(&json, &(serde_json::to_string_pretty(&report)? + "\n"))?;
    }
    let tables = markdown(&report);
    println!("{tables}\nwritten: {}", json.display());
    options.markdown.iter().try_for_each(|file| write(file, &tables))
}

struct Bench<'a> {
    list: &'a List,
    program: &'a Path,
    peers: &'a Peers,
    folder: Folder,
}

impl Bench<'_> {
    fn scene(&self, case: &Case) -> Result<Told, Failure> {
        eprintln!("{}: tracing the truth of {} frames", case.name, case.frames);
        let folder = self.folder.workplace()?;
        let film = Film::new(case, self.list.size, self.list.truth, &folder)?;
        let ours = self.list.pipelines.iter().map(|pipeline| Way::Ours(pipeline));
        let ways: Vec<Way> = ours.chain(self.list.denoised.iter().map(Way::Denoised)).collect();
        // The driver's cache of shaders is filled before anything is timed.
        for way in ways.iter().filter(|way| matches!(way, Way::Ours(_))) {
            self.run(case, way, &folder)?;
        }
        let mut seconds: Vec<Vec<f64>> = ways.iter().map(|_| Vec::new()).collect();
        for run in 0..self.list.runs {
            for (way, seconds) in ways.iter().zip(&mut seconds) {
                let (taken, _) = machine::undisturbed(&way.name(), self.list.others_at_most, || self.run(case, way, &folder), |(_, others)| *others)?;
                eprintln!("{} {}/{}: {} {:.3} s a frame", case.name, run + 1, self.list.runs, way.name(), taken);
                seconds.push(taken);
            }
        }
        let row = |(way, seconds): (&Way, Vec<f64>)| {
            let judged = film.judge(|frame| way.picture(&folder, frame))?;
            let command = machine::shown(&self.command(case, way, &folder), self.program, &folder);
            let seconds = Spread::of(&seconds).ok_or("nothing was run")?;
            Ok::<_, Failure>(Row { name: way.name(), command, seconds, judged })
        };
        Ok(Told { scene: case.clone(), rows: ways.iter().zip(seconds).map(row).collect::<Result<_, _>>()? })
    }

    /// Renders the sequence: the mean seconds of its frames, and what others had of the processors meanwhile.
    fn run(&self, case: &Case, way: &Way, folder: &Path) -> Result<(f64, Option<f64>), Failure> {
        let out = folder.join(way.name());
        if out.exists() {
            fs::remove_dir_all(&out)?;
        }
        fs::create_dir(&out)?;
        let done = finish(&mut self.command(case, way, folder))?;
        let seconds: Vec<f64> = match way {
            Way::Ours(_) => {
                let stats: Value = serde_json::from_slice(&read(&out.join("stats.json"))?)?;
                stats["frames"].as_array().into_iter().flatten().filter_map(|frame| frame["seconds"].as_f64()).collect()
            }
            Way::Denoised(_) => serde_json::from_value(serde_json::from_slice::<Value>(&done.stdout)?["seconds"].take())?,
        };
        if seconds.len() != case.frames as usize {
            return Err(format!("{} told the seconds of {} frames, not of {}", way.name(), seconds.len(), case.frames).into());
        }
        Ok((seconds.iter().sum::<f64>() / seconds.len() as f64, done.others))
    }

    fn command(&self, case: &Case, way: &Way, folder: &Path) -> Command {
        let (out, [w, h]) = (folder.join(way.name()), self.list.size);
        match way {
            Way::Ours(pipeline) => {
                let mut command = Command::new(self.program);
                command.args(["render", pipeline, "--scene", &case.name, "--size", &format!("{w}x{h}"), "--strict"]);
                command.args(["--frames", &format!("0..{}", case.frames), "--fps", &case.fps.to_string()]);
                command.arg("--stats").arg(out.join("stats.json")).arg("-o").arg(out.join("frame.exr"));
                command
            }
            Way::Denoised(Denoised { rays, quality }) => {
                let mut command = self.peers.script("mitsuba_frames.py");
                command.arg(folder.join("frames.json")).args(["--rays", &rays.to_string(), "--quality", quality]).arg("-o").arg(out);
                command
            }
        }
    }
}

impl Way<'_> {
    fn name(&self) -> String {
        match self {
            Self::Ours(pipeline) => (*pipeline).to_owned(),
            Self::Denoised(Denoised { rays, quality }) => format!("{rays} rays, OIDN {quality}"),
        }
    }

    /// A frame that it has rendered, as the one layer that is judged. Others write no other layer, under no name.
    fn picture(&self, folder: &Path, frame: usize) -> Result<Layers, Failure> {
        let Layers { width, height, mut layers, .. } = Layers::read(&read(&folder.join(self.name()).join(format!("frame.{frame:04}.exr")))?)?;
        let irradiance = match self {
            Self::Ours(_) => layers.remove(IRRADIANCE),
            Self::Denoised(_) => layers.into_values().next(),
        };
        let irradiance = irradiance.ok_or_else(|| format!("{}: frame {frame} has no irradiance", self.name()))?;
        Ok(Layers::new(width, height).with(IRRADIANCE, irradiance))
    }
}

fn markdown(report: &Report) -> String {
    let Report { date, machine, size: [w, h], truth, hemisplat, mitsuba, denoiser, .. } = report;
    let mut text = format!(
        "{date}, commit {}: {w}×{h} pixels, one bounce, errors against {truth} rays a pixel; {} cores ({}), {}; hemisplat {hemisplat}, Mitsuba {mitsuba}, Open Image Denoise by {denoiser}.\n\n",
        report.commit,
        machine.cores,
        machine.cpu.as_deref().unwrap_or("processor unknown"),
        machine.adapter
    );
    text += "| scene, frames | by | seconds a frame | `rmse_over_mean` | `bias_over_mean` | `block_p50` | `block_p99` | `flicker` |\n|---|---|---|---|---|---|---|---|\n";
    for Told { scene, rows } in &report.scenes {
        let mut first = format!("`{}`, {} at {} a second", scene.name, scene.frames, scene.fps);
        for Row { name, seconds, judged, .. } in rows {
            let percent = |share: Option<f64>| share.map_or_else(|| "-".to_owned(), |share| format!("{:.2} %", 100.0 * share));
            let shares = [Some(judged.rmse_over_mean), Some(judged.bias_over_mean), judged.block_p50, judged.block_p99, judged.flicker].map(percent);
            let _ = writeln!(
                text,
                "| {} | {name} | {:.3} ({:.3} to {:.3}) | {} |",
                std::mem::take(&mut first),
                seconds.median,
                seconds.least,
                seconds.most,
                shares.join(" | ")
            );
        }
    }
    text
}
