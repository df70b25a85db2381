//! What was measured of a point is kept in a file of its own, and its picture beside it, both named by the checksum of everything that they depend
//! on. The picture comes first, each appears whole or not at all, and who finds both does not measure the point again.

use super::console::Console;
use super::failure::Failure;
use super::input::read_file;
use super::output::Target;
use super::sealed::{self, Unusable};
use crate::measure::cache::Checksum;
use crate::measure::compare::{VariantErrors, judged};
use crate::measure::sweep::{Measured, Outcome, Point};
use crate::measure::{Errors, Layer, Layers};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The longest file of a point that is read.
const MOST_POINT_BYTES: u64 = 16 << 20;

/// Since 2 with draws.
const SCHEMA: u32 = 2;

/// What the file of a point holds.
#[derive(Serialize, Deserialize)]
struct Kept {
    /// Version of this record.
    schema: u32,
    /// Everything that the numbers depend on.
    key: String,
    /// For readers: `NODE.PARAM=VALUE`.
    set: Vec<String>,
    measured: Measured,
    /// The errors in each draw of the picture's blocks, by layer and metric, for comparisons with other points: 32-bit floats as base64, the lowest byte first.
    draws: BTreeMap<String, BTreeMap<String, String>>,
}

impl Kept {
    /// What was measured, with its draws; None where these are damaged.
    fn whole(mut self) -> Option<Measured> {
        for (layer, errors) in self.measured.errors.layers_mut() {
            let (Some(errors), Some(draws)) = (errors, self.draws.get(layer)) else { continue };
            errors.resampled.metrics = draws.iter().map(|(metric, text)| Some((metric.clone(), unpacked(text)?))).collect::<Option<_>>()?;
        }
        Some(self.measured)
    }
}

fn packed(errors: &VariantErrors) -> BTreeMap<String, BTreeMap<String, String>> {
    let text = |draws: &Vec<f32>| BASE64_STANDARD.encode(draws.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>());
    let of = |errors: &Errors| errors.resampled.metrics.iter().map(|(metric, draws)| (metric.clone(), text(draws))).collect();
    errors.layers().into_iter().filter_map(|(layer, errors)| Some((layer.to_owned(), of(errors?)))).collect()
}

fn unpacked(text: &str) -> Option<Vec<f32>> {
    let bytes = BASE64_STANDARD.decode(text).ok()?;
    let values = bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    bytes.len().is_multiple_of(4).then_some(values)
}

/// Where the points are kept.
pub(super) struct Folder {
    pub(super) path: PathBuf,
}

impl Folder {
    /// Creates the folder, and tries whether it takes files.
    pub(super) fn new(path: &Path) -> Result<Self, Failure> {
        let folder = Self { path: path.to_owned() };
        Target::new(&folder.file("new", "json"))?;
        Ok(folder)
    }

    fn file(&self, key: &str, ending: &str) -> PathBuf {
        self.path.join(format!("point-{}.{ending}", Checksum::of(key.as_bytes())))
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

    /// None where a point is not whole: a picture alone is what an interruption left, numbers without one need it.
    fn kept(&self, key: &str, console: &Console) -> Option<Measured> {
        let measured = self.numbers(key);
        let picture = measured.as_ref().map_err(|unusable| *unusable).and_then(|_| self.picture(key));
        let path = self.file(key, if measured.is_ok() { "exr" } else { "json" });
        match (&measured, picture.as_ref().err()) {
            (_, Some(Unusable::Damaged)) => console.note(&format!("{} is damaged: its point is measured anew", path.display())),
            (Ok(_), Some(Unusable::Absent)) => console.note(&format!("{} is missing: its point is measured anew", path.display())),
            _ => {}
        }
        measured.ok().filter(|_| picture.is_ok())
    }

    fn numbers(&self, key: &str) -> Result<Measured, Unusable> {
        let file = read_file(&self.file(key, "json"), MOST_POINT_BYTES).map_err(|_| Unusable::Absent)?;
        let kept = serde_json::from_slice::<Kept>(&file).ok().filter(|kept| kept.schema == SCHEMA && kept.key == key);
        kept.and_then(Kept::whole).ok_or(Unusable::Damaged)
    }

    pub(super) fn picture(&self, key: &str) -> Result<Layers, Unusable> {
        sealed::read(&self.file(key, "exr"), key)
    }

    pub(super) fn keep(&self, key: &str, point: &Point, measured: &Measured, picture: Layers) -> Result<(), Failure> {
        sealed::write(&Target::new(&self.file(key, "exr"))?, picture, key)?;
        let kept = Kept { schema: SCHEMA, key: key.to_owned(), set: point.set.clone(), measured: measured.clone(), draws: packed(&measured.errors) };
        Target::new(&self.file(key, "json"))?.write_json(&kept)
    }
}

/// What a page shows of a picture, in half floats; all of it where it holds nothing of that.
pub(super) fn shown(picture: &Layers) -> Layers {
    let named = |name: &'static str| Some((name.to_owned(), picture.layers.get(name)?.clone().as_half()));
    let layers: BTreeMap<String, Layer> = judged(picture).filter_map(named).collect();
    if layers.is_empty() { picture.clone() } else { Layers { layers, ..picture.clone() } }
}
