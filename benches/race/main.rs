//! How much faster is hemisplat than denoised path tracing, than Mitsuba's ray casting alone, and than Radiance's irradiance cache, at equal error, on this
//! machine?
//!
//! `./bench` builds and runs it; docs/bench.md tells what it measures. `cargo test --test race` tests its arithmetic and its lists.

mod curve;
mod kept;
mod machine;
mod peers;
mod programs;
mod report;
mod settings;
mod tell;

use clap::Parser;
use hemisplat::measure::{
    cache::Checksum,
    plot::{Paper, svg},
};
use kept::{Folder, Run, read, write};
use programs::{Programs, Truth};
use report::{Point, Report, Scene};
use serde::{Deserialize, Serialize};
use settings::{Case, Program, Race, Runs, Setting, interleaved};
use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

type Failure = Box<dyn std::error::Error>;

/// Race hemisplat against denoised path tracing, ray casting and Radiance to equal error
#[derive(Parser)]
#[command(name = "./bench")]
struct Options {
    /// Small pictures and few settings, to see whether all runs: results stay in the folder of --out
    #[arg(long)]
    quick: bool,
    /// All bounces in place of one: results have names of their own
    #[arg(long, conflicts_with = "quick")]
    bounces: bool,
    /// Denoised path tracing above all, and of the others a point each: a quarter of an hour
    #[arg(long, conflicts_with_all = ["quick", "bounces"])]
    denoised: bool,
    /// One scene of the list alone
    #[arg(long)]
    scene: Option<String>,
    /// Where what was measured is kept, and taken over from
    #[arg(short, long, default_value = "out/bench")]
    out: PathBuf,
    /// Runs of each setting, in place of those of the list
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    runs: Option<u32>,
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

impl Options {
    /// What the race's files are called.
    fn name(&self) -> &'static str {
        match (self.quick, self.bounces, self.denoised) {
            (true, ..) => "race-quick",
            (_, true, _) => "race-bounces",
            (.., true) => "race-denoised",
            _ => "race",
        }
    }
}

fn main() -> ExitCode {
    machine::ended(race(&Options::parse()))
}

fn race(options: &Options) -> Result<(), Failure> {
    let file = format!("benches/{}.ron", options.name());
    let text = String::from_utf8(read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(&file))?)?;
    let mut race = Race::read(&text).and_then(|race| race.only(options.scene.as_deref())).map_err(|error| format!("{file}: {error}"))?;
    if let Some(runs) = options.runs {
        race.runs = Runs { radiance: runs, mitsuba: runs, denoised: runs, hemisplat: runs };
    }
    let commit = if options.quick { machine::commit() } else { Some(machine::clean_commit()?) };
    let programs = Programs::find(&options.program)?;
    let folder = Folder::new(&options.out)?;
    // Truths before times: what is timed should have the machine in one state.
    let tracks = race.scenes.iter().map(|case| Track::new(&race, &programs, &folder, case)).collect::<Result<Vec<_>, _>>()?;
    let scenes = tracks.iter().map(|track| Scene::of(&track.case.name, track.points()?)).collect::<Result<Vec<_>, _>>()?;
    drop(tracks);
    let (size, truth, bounces, others_at_most) = (race.size, race.truth, race.bounces, race.others_at_most);
    let Programs { versions, machine, .. } = programs;
    let (date, changes) = (machine::date()?, machine::changes()?);
    publish(options, &Report { schema: 2, date, commit, changes, machine, versions, size, truth, bounces, others_at_most, scenes })
}

/// Tables on the terminal, everything else into files.
fn publish(options: &Options, report: &Report) -> Result<(), Failure> {
    let folder = if options.quick { options.out.clone() } else { "benches/results".into() };
    let race = if options.quick { "race" } else { options.name() };
    let name = |scene: Option<&str>| folder.join(format!("{}-{race}{}", report.date, scene.map_or(String::new(), |scene| format!("-{scene}"))));
    let json = name(options.scene.as_deref()).with_extension("json");
    let tables = tell::markdown(report);
    write(&json, &(serde_json::to_string_pretty(report)? + "\n"))?;
    println!("{tables}\nwritten: {}", json.display());
    for scene in &report.scenes {
        let figure = name(Some(&scene.scene)).with_extension("svg");
        write(&figure, &svg(&tell::plot(report, scene), Paper::Wide))?;
        println!("written: {}", figure.display());
    }
    options.markdown.iter().try_for_each(|file| write(file, &tables))
}

/// One scene, and all that runs on it.
struct Track<'a> {
    race: &'a Race,
    programs: &'a Programs,
    folder: &'a Folder,
    case: &'a Case,
    /// What all times and errors of the scene depend on.
    ground: String,
    truth: Truth,
}

/// A setting's run of this number.
#[derive(Clone, Copy)]
struct Job<'a> {
    setting: &'a Setting,
    run: u32,
}

/// Shows that the files of a truth are whole.
#[derive(Serialize, Deserialize)]
struct Sealed {
    checksums: [String; 3],
    printed: serde_json::Value,
}

impl<'a> Track<'a> {
    fn new(race: &'a Race, programs: &'a Programs, folder: &'a Folder, case: &'a Case) -> Result<Self, Failure> {
        let (scene, mitsuba) = (programs.scene_checksum(case)?, &programs.versions.mitsuba);
        let key = format!("scene {scene}, size {}, {:?}, {} bounces, Mitsuba {mitsuba}", race.size, race.truth, race.bounces);
        let truth = truth(race, programs, folder, case, &key)?;
        Ok(Self { race, programs, folder, case, ground: format!("{key}, {} cores, {:?}", programs.machine.cores, programs.machine.cpu), truth })
    }

    /// All programs' runs, spread between each other.
    fn points(&self) -> Result<Vec<Point>, Failure> {
        let settings = self.race.settings(self.case);
        let jobs = jobs(&settings, &self.race.runs);
        self.warm_up(&jobs)?;
        let mut found: Vec<Vec<Run>> = settings.iter().map(|_| Vec::new()).collect();
        for (number, job) in jobs.iter().enumerate() {
            eprint!("{} {}/{}: {} {} … ", self.case.name, number + 1, jobs.len(), job.setting.program().name(), job.setting.name());
            let (run, is_kept) = self.run(job)?;
            eprintln!("{:.1} s, {:.2} %{}", run.seconds, run.errors.rmse_over_mean * 100.0, if is_kept { ", kept" } else { "" });
            found.iter_mut().zip(&settings).filter(|(_, setting)| *setting == job.setting).for_each(|(found, _)| found.push(run.clone()));
        }
        settings.iter().zip(found).map(|(setting, runs)| Point::of(setting, runs)).collect()
    }

    /// Shaders of what is still to be measured, so that no run but a cold one compiles any.
    fn warm_up(&self, jobs: &[Job]) -> Result<(), Failure> {
        for Job { setting, .. } in jobs.iter().filter(|job| job.run == 0 && job.setting.is_on_curve()) {
            if let Setting::Hemisplat(ours) = setting
                && jobs.iter().any(|job| job.setting == *setting && self.kept(job).is_none())
            {
                eprintln!("{}: hemisplat {} is warmed up", self.case.name, setting.name());
                self.programs.warm_up(self.race, self.case, ours, &self.folder.workplace()?)?;
            }
        }
        Ok(())
    }

    fn run(&self, job: &Job) -> Result<(Run, bool), Failure> {
        if let Some(run) = self.kept(job) {
            return Ok((run, true));
        }
        let run = self.undisturbed(job.setting)?;
        self.folder.keep(&self.name(job), &self.key(job), &run)?;
        Ok((run, false))
    }

    fn undisturbed(&self, setting: &Setting) -> Result<Run, Failure> {
        let run = || self.programs.run(self.race, self.case, setting, &self.truth, &self.folder.workplace()?);
        let run = machine::undisturbed(&setting.name(), self.race.others_at_most, run, |run| run.others);
        run.map_err(|error| format!("{error}. All other runs are kept").into())
    }

    fn kept(&self, job: &Job) -> Option<Run> {
        let kept: Option<Run> = self.folder.find(&self.name(job), &self.key(job));
        kept.filter(|run| run.others.is_none_or(|others| others <= self.race.others_at_most))
    }

    fn name(&self, job: &Job) -> String {
        format!("{}-{}", self.case.name, job.setting.program().name().to_lowercase().replace(' ', "-"))
    }

    fn key(&self, job: &Job) -> String {
        let Programs { versions, machine, .. } = self.programs;
        let version = match job.setting.program() {
            Program::Radiance => versions.radiance.clone(),
            Program::Mitsuba => versions.mitsuba.clone(),
            Program::Denoised => format!("{} and {}", versions.mitsuba, versions.denoiser),
            Program::Hemisplat => format!("{} on {}", versions.hemisplat, machine.adapter),
        };
        format!("{}, {} {version}, {}, run {}", self.ground, job.setting.program().name(), job.setting.name(), job.run)
    }
}

/// Every other round of a program's goes backwards.
fn jobs<'a>(settings: &'a [Setting], runs: &Runs) -> Vec<Job<'a>> {
    let round = |program: Program, run: u32| {
        let mut round: Vec<Job> = settings.iter().filter(|setting| setting.program() == program).map(|setting| Job { setting, run }).collect();
        if !run.is_multiple_of(2) {
            round.reverse();
        }
        round
    };
    interleaved(Program::ALL.map(|program| (0..runs.of(program)).flat_map(|run| round(program, run)).collect()).into())
}

/// The kept truth of a scene if it is whole, else a new one.
fn truth(race: &Race, programs: &Programs, folder: &Folder, case: &Case, key: &str) -> Result<Truth, Failure> {
    let name = format!("{}-truth", case.name);
    let place = folder.beside(&name, key);
    let file = |layer: &str| place.join(format!("{}.reference-{layer}.exr", case.name));
    let truth = Truth { indirect: file("indirect"), variance: file("variance"), windows: file("windows") };
    let checksum = |path: &Path| -> Result<String, Failure> { Ok(Checksum::of(&read(path)?)) };
    let checksums = || -> Result<[String; 3], Failure> { Ok([checksum(&truth.indirect)?, checksum(&truth.variance)?, checksum(&truth.windows)?]) };
    let sealed: Option<Sealed> = folder.find(&name, key);
    if sealed.is_none_or(|sealed| checksums().ok() != Some(sealed.checksums)) {
        eprintln!("{}: Mitsuba traces the truth …", case.name);
        let printed = programs.trace(race, case, &place)?;
        folder.keep(&name, key, &Sealed { checksums: checksums()?, printed })?;
    }
    Ok(truth)
}
