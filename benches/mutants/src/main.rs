//! Changes hemisplat line by line, and tells which changes no test notices.
//!
//! ```
//! cargo install cargo-mutants --locked
//! cargo run --release --manifest-path benches/mutants/Cargo.toml -- build passes 'src/../passes/**' lib,ways,golden 5
//! cargo run --release --manifest-path benches/mutants/Cargo.toml -- run passes 60 90
//! ```
//!
//! `build` takes the changes that cargo-mutants lists for the files and puts all of them into a copy of the project, each behind a number that the environment
//! names, so that one build serves all. Then it runs each of the tests once, to see which changes it reaches, and leaves out those that take longer than the
//! seconds given; `lib=passes::` in place of `lib` takes those tests alone whose names hold that. `run` makes the changes one by one, in an order drawn by lot,
//! and runs the tests that reach each, until one fails, or the seconds for one change or the minutes for all are over. `again` does so with those that passed
//! so far. Minutes are those of the clock. Seconds are those that processors work for a test, so that it is the same whatever else they do; a test that waits
//! is stopped after far more of the clock.
//!
//! The first word after them names the set of changes, which is kept in a folder of `out/mutants`: `state.json` has changes and tests, `results.jsonl`
//! one line a change, the last of each holds. A change is known by its place, so that results outlive tests that are added at the end of a file.

mod copy;
mod place;
mod trial;

use serde::{Deserialize, Serialize};
use std::{
    collections::{BTreeMap, HashMap},
    hash::{DefaultHasher, Hash, Hasher},
    io::Write,
    path::PathBuf,
    process::Command,
    sync::Mutex,
    time::{Duration, Instant},
};
use trial::{Ended, Test};

/// How many tests run at a time.
const WORKERS: usize = 2;

/// As cargo-mutants lists it.
#[derive(Serialize, Deserialize)]
struct Change {
    name: String,
    file: String,
    span: Span,
    genre: String,
    replacement: String,
    /// Why it cannot be made.
    #[serde(default)]
    left_out: Option<String>,
}

#[derive(Serialize, Deserialize)]
struct Span {
    start: Point,
    end: Point,
}

#[derive(Serialize, Deserialize)]
struct Point {
    line: usize,
    column: usize,
}

#[derive(Serialize, Deserialize)]
struct State {
    changes: Vec<Change>,
    /// Of each number: the change, and the first number of its place.
    numbers: Vec<(usize, usize)>,
    tests: Vec<Test>,
}

#[derive(Serialize, Deserialize)]
struct Outcome {
    name: String,
    /// `noticed`, `endless`, `hung`, `passed`, `unfinished`, `unreached`
    outcome: String,
    /// The test that ended it.
    by: Option<String>,
    seconds: f64,
    /// Tests that reach it and were not run.
    left: usize,
}

/// Where all is.
struct Work {
    project: PathBuf,
    folder: PathBuf,
}

impl Work {
    fn of(set: &str) -> Self {
        let project = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().expect("the project");
        let work = Self { folder: project.join("out/mutants").join(set), project };
        std::fs::create_dir_all(work.folder.join("tmp")).expect("a folder for the work");
        work
    }

    fn copy(&self) -> PathBuf {
        self.folder.join("copy")
    }

    /// At little optimisation: the changes cost more than it gains. Tests of one set run the program of that set, so that each builds into its own folder.
    fn cargo(&self, what: &str) -> Command {
        let mut cargo = Command::new("cargo");
        cargo.args([what, "--locked", "-j2", "--target-dir"]).arg(self.folder.join("target")).current_dir(self.copy()).env("CARGO_PROFILE_DEV_OPT_LEVEL", "1");
        cargo
    }

    /// What all tests are run with: the same samples each time, and nothing kept of failures.
    fn tests<'a>(&self, command: &'a mut Command) -> &'a mut Command {
        let kept = [("PROPTEST_CASES", "24"), ("PROPTEST_RNG_SEED", "1"), ("PROPTEST_DISABLE_FAILURE_PERSISTENCE", "1"), ("INSTA_UPDATE", "no")];
        command.current_dir(self.copy()).envs(kept).env("TMPDIR", self.folder.join("tmp"))
    }

    /// A few at a time, in order.
    fn each<T: Send, R: Send>(&self, items: &mut [T], job: impl Fn(usize, &mut T) -> R + Sync) -> Vec<R> {
        let (queue, done) = (Mutex::new(items.iter_mut().enumerate()), Mutex::new(BTreeMap::new()));
        std::thread::scope(|scope| {
            for _ in 0..WORKERS {
                scope.spawn(|| {
                    loop {
                        let next = queue.lock().expect("no panic").next();
                        let Some((index, item)) = next else { return };
                        let result = job(index, item);
                        done.lock().expect("no panic").insert(index, result);
                    }
                });
            }
        });
        done.into_inner().expect("no panic").into_values().collect()
    }

    /// What `build` kept.
    fn state(&self) -> Option<State> {
        serde_json::from_slice(&std::fs::read(self.folder.join("state.json")).ok()?).ok()
    }

    fn keep(&self, state: &State) {
        let state = serde_json::to_vec(state).expect("plain values");
        std::fs::write(self.folder.join("state.json"), state).expect("room for the state");
    }

    fn outcomes(&self) -> HashMap<String, Outcome> {
        let text = std::fs::read_to_string(self.folder.join("results.jsonl")).unwrap_or_default();
        text.lines().filter_map(|line| serde_json::from_str::<Outcome>(line).ok()).map(|outcome| (outcome.name.clone(), outcome)).collect()
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |text: &str| text.parse::<f64>().expect("a number");
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["build", set, files, tests, longest] => build(&Work::of(set), files, tests, number(longest)),
        ["run", set, seconds, minutes] => run(&Work::of(set), number(seconds), number(minutes), &[]),
        ["again", set, seconds, minutes] => run(&Work::of(set), number(seconds), number(minutes), &["hung", "passed", "unfinished", "unreached"]),
        _ => eprintln!("build SET FILES,... TESTS,... LONGEST_TEST_SECONDS | run SET SECONDS_EACH MINUTES | again SET SECONDS_EACH MINUTES"),
    }
}

fn build(work: &Work, files: &str, tests: &str, longest: f64) {
    let mut list = Command::new("cargo");
    list.args(["mutants", "--list", "--json"]).current_dir(&work.project);
    for file in files.split(',') {
        list.args(["-f", file]);
    }
    let listed = list.output().expect("cargo-mutants");
    let mut changes: Vec<Change> = serde_json::from_slice(&listed.stdout).expect("a list of changes");
    // What did not compile before is not tried again: each try builds the library anew.
    let left_out: HashMap<String, String> = work.state().into_iter().flat_map(|state| state.changes).filter_map(|c| Some((c.name, c.left_out?))).collect();
    changes.iter_mut().for_each(|change| change.left_out = left_out.get(&change.name).cloned());
    let numbers = copy::make(work, &mut changes);
    let mut state = State { changes, numbers, tests: Vec::new() };
    work.keep(&state);
    println!("{} changes, {} of them can be made", state.changes.len(), state.numbers.len());
    state.tests = trial::measured(work, &tests.split(',').map(str::to_owned).collect::<Vec<_>>(), longest);
    println!("{} tests, {:.0} s", state.tests.len(), state.tests.iter().map(|test| test.seconds).sum::<f64>());
    work.keep(&state);
}

fn run(work: &Work, seconds: f64, minutes: f64, anew: &[&str]) {
    let state = work.state().expect("`build` first");
    let before = work.outcomes();
    let is_open = |name: &str| before.get(name).is_none_or(|outcome| anew.contains(&outcome.outcome.as_str()));
    let mut open: Vec<usize> = (0..state.numbers.len()).filter(|number| is_open(&state.changes[state.numbers[*number].0].name)).collect();
    open.sort_by_key(|number| {
        let mut hasher = DefaultHasher::new();
        state.changes[state.numbers[*number].0].name.hash(&mut hasher);
        hasher.finish()
    });
    let until = Instant::now() + Duration::from_secs_f64(minutes * 60.0);
    let file = std::fs::File::options().create(true).append(true).open(work.folder.join("results.jsonl"));
    let file = Mutex::new(file.expect("room for the results"));
    let worth = Mutex::new(Worth::of(&before, &state.tests));
    let all = open.len();
    work.each(&mut open, |index, number| {
        if Instant::now() < until {
            let outcome = make(work, &state, *number, seconds, &worth);
            println!("{index}/{all} {} {} {:.1} s {}", outcome.outcome, outcome.name, outcome.seconds, outcome.by.as_deref().unwrap_or_default());
            let line = serde_json::to_string(&outcome).expect("plain values") + "\n";
            file.lock().expect("no panic").write_all(line.as_bytes()).expect("room for a result");
        }
    });
    let mut counts = BTreeMap::<_, usize>::new();
    work.outcomes().into_values().for_each(|outcome| *counts.entry(outcome.outcome).or_default() += 1);
    println!("{counts:?}");
}

/// How often each test was run against changes of a file, and how often it noticed one; each counts as one more.
#[derive(Default)]
struct Worth(HashMap<(String, usize), [f64; 2]>);

impl Worth {
    /// As far as outcomes before tell.
    fn of(before: &HashMap<String, Outcome>, tests: &[Test]) -> Self {
        let mut worth = Self::default();
        for outcome in before.values() {
            let by = tests.iter().position(|test| outcome.by.as_deref() == Some(&test.title()));
            by.into_iter().for_each(|test| worth.add(file(&outcome.name), test, true));
        }
        worth
    }

    fn add(&mut self, file: &str, test: usize, noticed: bool) {
        let [tries, finds] = self.0.entry((file.into(), test)).or_insert([1.0; 2]);
        (*tries, *finds) = (*tries + 1.0, *finds + f64::from(u8::from(noticed)));
    }

    /// Seconds until a test finds one.
    fn cost(&self, file: &str, test: usize, seconds: f64) -> f64 {
        self.0.get(&(file.into(), test)).map_or(seconds, |[tries, finds]| seconds * tries / finds.powi(2))
    }
}

/// Of a change's name.
fn file(name: &str) -> &str {
    name.split(".rs:").next().unwrap_or(name)
}

/// Runs the tests that reach a change: first those that notice most of its file's changes for their seconds.
fn make(work: &Work, state: &State, number: usize, limit: f64, worth: &Mutex<Worth>) -> Outcome {
    let (change, first) = state.numbers[number];
    let name = &state.changes[change].name;
    let mut reaching: Vec<usize> = (0..state.tests.len()).filter(|test| state.tests[*test].reached.contains(&first)).collect();
    let known = worth.lock().expect("no panic");
    let cost: Vec<f64> = state.tests.iter().enumerate().map(|(index, test)| known.cost(file(name), index, test.seconds)).collect();
    drop(known);
    reaching.sort_by(|a, b| cost[*a].total_cmp(&cost[*b]));
    let mut outcome = Outcome { name: name.clone(), outcome: String::new(), by: None, seconds: 0.0, left: 0 };
    for index in &reaching {
        let test = &state.tests[*index];
        if outcome.seconds + test.seconds > limit {
            outcome.left += 1;
            continue;
        }
        let (ended, seconds) = test.run(work, ("MUTANT", &number.to_string()), 3.0 * test.seconds + 3.0);
        outcome.seconds += seconds;
        worth.lock().expect("no panic").add(file(name), *index, ended != Ended::Passed);
        if ended != Ended::Passed {
            outcome.by = Some(test.title());
            outcome.outcome = ended.word().into();
            return outcome;
        }
    }
    outcome.outcome = if reaching.is_empty() {
        "unreached"
    } else if outcome.left > 0 {
        "unfinished"
    } else {
        "passed"
    }
    .into();
    outcome
}
