//! What was measured of a point is kept in a file of its own, named by the checksum of everything that the numbers depend on. It appears whole or
//! not at all, and who finds it does not measure the point again.

use super::console::Console;
use super::failure::Failure;
use super::input::read_file;
use super::output::Target;
use crate::measure::cache::Checksum;
use crate::measure::sweep::{Measured, Outcome, Point};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The longest file of a point that is read.
const MOST_POINT_BYTES: u64 = 16 << 20;

/// What the file of a point holds.
#[derive(Serialize, Deserialize)]
struct Kept {
    /// Version of this record: 1.
    schema: u32,
    /// Everything that the numbers depend on.
    key: String,
    /// For readers: `NODE.PARAM=VALUE`.
    set: Vec<String>,
    measured: Measured,
}

/// Where the points are kept.
pub(super) struct Folder {
    pub(super) path: PathBuf,
}

impl Folder {
    /// Creates the folder, and tries whether it takes files.
    pub(super) fn new(path: &Path) -> Result<Self, Failure> {
        let folder = Self { path: path.to_owned() };
        Target::new(&folder.file("new"))?;
        Ok(folder)
    }

    fn file(&self, key: &str) -> PathBuf {
        self.path.join(format!("point-{}.json", Checksum::of(key.as_bytes())))
    }

    /// Takes over the points that are there; how many those are.
    pub(super) fn find(&self, points: &mut [Point], keys: &[String], console: &Console) -> usize {
        let mut found = 0;
        for (point, key) in points.iter_mut().zip(keys).filter(|(point, _)| point.outcome == Outcome::Open) {
            if let Some(measured) = self.kept(key, console) {
                point.outcome = Outcome::Measured(Box::new(measured));
                found += 1;
            }
        }
        found
    }

    /// None where there is no such file, or one that is damaged.
    fn kept(&self, key: &str, console: &Console) -> Option<Measured> {
        let path = self.file(key);
        let file = read_file(&path, MOST_POINT_BYTES).ok()?;
        let kept = serde_json::from_slice::<Kept>(&file).ok().filter(|kept| kept.schema == 1 && kept.key == key);
        if kept.is_none() {
            console.note(&format!("{} is damaged: its point is measured anew", path.display()));
        }
        kept.map(|kept| kept.measured)
    }

    pub(super) fn keep(&self, key: &str, point: &Point, measured: &Measured) -> Result<(), Failure> {
        let kept = Kept { schema: 1, key: key.to_owned(), set: point.set.clone(), measured: measured.clone() };
        Target::new(&self.file(key))?.write_json(&kept)
    }
}
