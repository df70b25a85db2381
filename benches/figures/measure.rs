//! Runs the commands of a measurement, and keeps what they found.

use crate::{
    Failure,
    data::{Keeps, Kind, Measurement, RESULTS},
    machine::{self, Machine},
    template::TIMES,
};
use serde::Serialize;
use serde_json::{Map, Value};
use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

/// What is kept. Keys in JSON are the fields' names.
#[derive(Serialize)]
struct Report<'m> {
    /// Version of this record: 1.
    schema: u32,
    date: String,
    commit: String,
    machine: Machine,
    hemisplat: String,
    /// What may be quoted of it; where that is no times, those that the commands found are left out.
    tells: &'m [Kind],
    /// The parts of the program whose change may alter it.
    measures: &'m [String],
    /// The changes that this program has.
    changes: Vec<String>,
    commands: &'m [String],
    #[serde(flatten)]
    found: Map<String, Value>,
}

/// Measures one entry of the list by the program `hemisplat`.
pub fn measure(root: &Path, measurement: &Measurement, hemisplat: &Path) -> Result<(), Failure> {
    let commit = machine::clean_commit()?;
    let changes = machine::changes()?;
    let (program, version) = machine::hemisplat(hemisplat)?;
    let machine = Machine::find(&program)?;
    // Shells find the program by its name.
    let folder = tempfile::tempdir()?;
    fs::copy(&program, folder.path().join("hemisplat"))?;
    let path = env::join_paths([folder.path().to_owned()].into_iter().chain(env::split_paths(&env::var_os("PATH").unwrap_or_default())))?;
    fs::create_dir_all(root.join("out/figures"))?;
    for command in &measurement.commands {
        eprintln!("{command}");
        let status = Command::new("bash").args(["-c", command]).current_dir(root).env("PATH", &path).status()?;
        if !status.success() {
            return Err(format!("{command}\nended with {status}").into());
        }
    }
    let Keeps::Files(files) = &measurement.keeps else { return Ok(()) };
    let mut found = Map::new();
    for (name, file) in files {
        let mut value = serde_json::from_slice(&fs::read(root.join(file)).map_err(|error| format!("cannot read {}: {error}", file.display()))?)?;
        bare(&mut value, measurement.tells.contains(&Kind::Times));
        found.insert(name.clone(), value);
    }
    let report = Report {
        schema: 1,
        date: machine::date()?,
        commit,
        machine,
        hemisplat: version,
        tells: &measurement.tells,
        measures: &measurement.measures,
        changes,
        commands: &measurement.commands,
        found,
    };
    let kept: PathBuf = root.join(RESULTS).join(format!("{}.json", measurement.name));
    crate::kept::write(&kept, &(serde_json::to_string_pretty(&report)? + "\n"))
}

/// Without names of files, which are one machine's, and without times unless they are to be told.
fn bare(value: &mut Value, with_times: bool) {
    match value {
        Value::Object(object) => {
            object.retain(|key, _| key != "file" && (with_times || !TIMES.contains(&key.as_str())));
            object.values_mut().for_each(|value| bare(value, with_times));
        }
        Value::Array(list) => list.iter_mut().for_each(|value| bare(value, with_times)),
        _ => {}
    }
}
