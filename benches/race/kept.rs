//! What was measured is kept as soon as it is known, each run in a file of its own, named by the checksum of all that it depends on: a race that was
//! stopped goes on where it was.

use crate::Failure;
use hemisplat::measure::{Errors, cache::Checksum};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::Value;
use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

/// One run of one setting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Run {
    pub command: String,
    pub seconds: f64,
    /// The share of the processors' time that other processes had; None where the system does not tell it.
    pub others: Option<f64>,
    /// At every k-th pixel.
    pub errors: Errors,
    /// At every pixel of windows.
    pub in_windows: Errors,
    /// What else its program tells.
    pub facts: Value,
}

#[derive(Serialize, Deserialize)]
struct Entry<T> {
    /// Everything that it depends on.
    key: String,
    #[serde(flatten)]
    found: T,
}

/// A folder of results, and within it one for work in progress.
pub struct Folder {
    path: PathBuf,
}

pub fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()).into())
}

/// Writes a file whole or not at all.
pub fn write(path: &Path, text: &str) -> Result<(), Failure> {
    try_write(path, text).map_err(|error| format!("cannot write {}: {error}", path.display()).into())
}

fn try_write(path: &Path, text: &str) -> std::io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    let mut file = tempfile::Builder::new().prefix(".race-").tempfile_in(folder)?;
    file.write_all(text.as_bytes())?;
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}

impl Folder {
    pub fn new(path: &Path) -> Result<Self, Failure> {
        let made = fs::create_dir_all(path).and_then(|()| fs::canonicalize(path));
        Ok(Self { path: made.map_err(|error| format!("cannot use the folder {}: {error}", path.display()))? })
    }

    /// A folder for what belongs to `key` and is too large for its record.
    pub fn beside(&self, name: &str, key: &str) -> PathBuf {
        self.path.join(format!("{name}-{}", Checksum::of(key.as_bytes())))
    }

    /// What is kept under `key`; None where there is nothing, or it is damaged or of another key.
    pub fn find<T: DeserializeOwned>(&self, name: &str, key: &str) -> Option<T> {
        let entry: Entry<T> = serde_json::from_slice(&fs::read(self.file(name, key)).ok()?).ok()?;
        (entry.key == key).then_some(entry.found)
    }

    pub fn keep<T: Serialize>(&self, name: &str, key: &str, found: &T) -> Result<(), Failure> {
        write(&self.file(name, key), &(serde_json::to_string_pretty(&Entry { key: key.to_owned(), found })? + "\n"))
    }

    pub fn file(&self, name: &str, key: &str) -> PathBuf {
        self.beside(name, key).with_extension("json")
    }

    /// An empty folder for the next run: whatever an earlier one left there is gone.
    pub fn workplace(&self) -> Result<PathBuf, Failure> {
        let path = self.path.join("work");
        let cleared = if path.exists() { fs::remove_dir_all(&path) } else { Ok(()) };
        cleared.and_then(|()| fs::create_dir(&path)).map_err(|error| format!("cannot clear {}: {error}", path.display()))?;
        Ok(path)
    }
}
