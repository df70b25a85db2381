//! What was measured and is kept: which program it is of, on which machine it was found, and which changes it knows.

use crate::Failure;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

/// Where the lists, the templates and the results lie, from the root of the project.
pub const MEASUREMENTS: &str = "benches/figures/measurements.ron";
pub const CHANGES: &str = "benches/changes.ron";
pub const RESULTS: &str = "benches/results";

/// What pages may quote of a measurement, and what a change of the program may alter. Times need a machine of one's own, the others do not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kind {
    Errors,
    Counts,
    Times,
}

/// One measurement of the list.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measurement {
    /// What templates and the command line call it.
    pub name: String,
    pub tells: Vec<Kind>,
    /// Files and folders of the program whose change may alter it.
    pub measures: Vec<String>,
    /// What a shell runs, from the root of the project.
    pub commands: Vec<String>,
    pub keeps: Keeps,
}

/// Where a measurement is kept.
#[derive(Debug, Clone, Deserialize)]
pub enum Keeps {
    /// `NAME.json`, with these files that the commands write.
    Files(BTreeMap<String, PathBuf>),
    /// `DATE-…` of this ending, which the commands write themselves; the newest counts.
    Dated(String),
}

/// A change of the program that makes older figures of what it touches old.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Change {
    /// In words, as pages tell it.
    pub change: String,
    /// Files and folders.
    #[serde(default)]
    pub touches: Vec<String>,
    #[serde(default)]
    pub alters: Vec<Kind>,
    /// New names of pipelines by their old ones, which older figures still have.
    #[serde(default)]
    pub renames: BTreeMap<String, String>,
    /// What stands in commands today for what older figures were measured by, in the order in which it is replaced.
    #[serde(default)]
    pub respells: Vec<(String, String)>,
}

/// A measurement with what was found.
#[derive(Debug, Clone)]
pub struct Kept {
    pub measurement: Measurement,
    pub json: Value,
}

/// The measurements and the changes that are listed.
pub struct Lists {
    pub measurements: Vec<Measurement>,
    pub changes: Vec<Change>,
}

/// Reads a list; `path` is from the folder `root`.
pub fn read_list<T: for<'de> Deserialize<'de>>(root: &Path, path: &str) -> Result<T, Failure> {
    let text = fs::read_to_string(root.join(path)).map_err(|error| format!("cannot read {path}: {error}"))?;
    ron::from_str(&text).map_err(|error| format!("{path}: {error}").into())
}

impl Lists {
    pub fn read(root: &Path) -> Result<Self, Failure> {
        Ok(Self { measurements: read_list(root, MEASUREMENTS)?, changes: read_list(root, CHANGES)? })
    }

    pub fn measurement(&self, name: &str) -> Result<&Measurement, Failure> {
        let known = || self.measurements.iter().map(|measurement| measurement.name.as_str()).collect::<Vec<_>>().join(", ");
        let found = self.measurements.iter().find(|measurement| measurement.name == name);
        found.ok_or_else(|| format!("{MEASUREMENTS} lists no `{name}`, but {}", known()).into())
    }

    /// None where nothing is kept yet.
    pub fn kept(&self, root: &Path, name: &str) -> Result<Option<Kept>, Failure> {
        let measurement = self.measurement(name)?.clone();
        let Some(path) = measurement.file(root)? else { return Ok(None) };
        let text = fs::read(&path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
        let json = serde_json::from_slice(&text).map_err(|error| format!("{}: {error}", path.display()))?;
        let mut kept = Kept { measurement, json };
        let known: Vec<String> = kept.changes().into_iter().map(str::to_owned).collect();
        for change in self.changes.iter().filter(|change| !known.contains(&change.change)) {
            rename(&mut kept.json, &change.renames);
            kept.json.get_mut("commands").into_iter().for_each(|commands| respell(commands, &change.respells));
        }
        Ok(Some(kept))
    }

    /// The changes that may alter a measurement.
    pub fn all_that_alter(&self, measurement: &Measurement) -> Vec<&str> {
        let alters = |change: &Change| change.alters.iter().any(|kind| measurement.tells.contains(kind));
        let touches = |change: &Change| change.touches.iter().any(|path| measurement.measures.iter().any(|measured| overlap(path, measured)));
        self.changes.iter().filter(|change| alters(change) && touches(change)).map(|change| change.change.as_str()).collect()
    }

    /// Those of them that `kept` does not know.
    pub fn since(&self, kept: &Kept) -> Vec<&str> {
        let known = kept.changes();
        self.all_that_alter(&kept.measurement).into_iter().filter(|change| !known.contains(change)).collect()
    }
}

/// Gives what is called by an old name its new one.
fn rename(value: &mut Value, names: &BTreeMap<String, String>) {
    match value {
        Value::Object(object) => object.iter_mut().for_each(|(key, value)| match value {
            Value::String(name) if ["name", "row", "pipeline"].contains(&key.as_str()) => {
                let (first, rest) = name.split_at(name.find([' ', '@']).unwrap_or(name.len()));
                *name = names.get(first).map_or_else(|| name.clone(), |new| format!("{new}{rest}"));
            }
            value => rename(value, names),
        }),
        Value::Array(list) => list.iter_mut().for_each(|value| rename(value, names)),
        _ => {}
    }
}

fn respell(commands: &mut Value, spellings: &[(String, String)]) {
    for command in commands.as_array_mut().into_iter().flatten() {
        let text = command.as_str().map(|text| spellings.iter().fold(text.to_owned(), |text, (old, new)| text.replace(old, new)));
        text.into_iter().for_each(|text| *command = text.into());
    }
}

/// Whether one of two paths is the other or lies in it.
fn overlap(first: &str, second: &str) -> bool {
    Path::new(first).starts_with(second) || Path::new(second).starts_with(first)
}

impl Measurement {
    /// The file that it is kept in, if there is one.
    pub fn file(&self, root: &Path) -> Result<Option<PathBuf>, Failure> {
        let folder = root.join(RESULTS);
        match &self.keeps {
            Keeps::Files(_) => Ok(Some(folder.join(format!("{}.json", self.name))).filter(|path| path.exists())),
            Keeps::Dated(ending) => newest(&folder, ending),
        }
    }
}

/// The last `YYYY-MM-DD-ENDING.json` of a folder.
fn newest(folder: &Path, ending: &str) -> Result<Option<PathBuf>, Failure> {
    let is_date = |text: &str| text.len() == 11 && text.ends_with('-') && text.chars().all(|letter| letter.is_ascii_digit() || letter == '-');
    let name = |path: &PathBuf| path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let is_wanted = |path: &PathBuf| name(path).strip_suffix(&format!("{ending}.json")).is_some_and(is_date);
    let entries = fs::read_dir(folder).map_err(|error| format!("cannot read {}: {error}", folder.display()))?;
    Ok(entries.filter_map(|entry| Some(entry.ok()?.path())).filter(is_wanted).max())
}

impl Kept {
    fn text(&self, pointer: &str) -> Option<&str> {
        self.json.pointer(pointer)?.as_str()
    }

    pub fn date(&self) -> Result<&str, Failure> {
        self.text("/date").ok_or_else(|| format!("`{}` does not tell its date", self.measurement.name).into())
    }

    /// The commit of the program, eight digits of it.
    pub fn commit(&self) -> Result<String, Failure> {
        let commit = self.text("/commit").ok_or_else(|| format!("`{}` does not tell its commit", self.measurement.name))?;
        let (digits, dirt) = commit.split_at(commit.find('-').unwrap_or(commit.len()));
        Ok(digits.chars().take(8).chain(dirt.chars()).collect())
    }

    /// In words; None where nothing of a machine is in the figures.
    pub fn machine(&self) -> Option<String> {
        let cores = self.json.pointer("/machine/cores").or_else(|| self.json.pointer("/cores"))?;
        let cpu = self.text("/machine/cpu").map(|cpu| format!(" ({cpu})")).unwrap_or_default();
        let adapter = self.text("/machine/adapter").or_else(|| self.text("/adapter/name"))?;
        // Its kind, backend and driver follow the name, and the driver's name is the adapter's once more.
        let driver = self.text("/adapter/driver").or_else(|| adapter.rsplit_once(", ").map(|(_, driver)| driver.trim_end_matches(')')));
        Some(format!("{cores} cores{cpu}, {}", driver.unwrap_or(adapter).split(" (").next().unwrap_or(adapter)))
    }

    /// The changes that its program had.
    pub fn changes(&self) -> Vec<&str> {
        self.json.get("changes").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str).collect()
    }

    pub fn commands(&self) -> &[String] {
        &self.measurement.commands
    }
}
