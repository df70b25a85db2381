//! Records as a file: what `--cache` saves and loads.

use super::run::{Run, RunError};
use crate::contract::encoder::Persistent;
use crate::gpu::scene::contents;
use crate::pipeline::plan::Saved;
use crate::scene::Scene;
use serde::{Deserialize, Serialize};

const FORMAT: &str = "hemisplat records 4";

/// The longest file that is worth reading: records of several caches as large as they may be.
pub const MOST_BYTES: u64 = 1 << 30;

/// First line of the file; then the records as they stand in memory.
#[derive(Serialize, Deserialize)]
struct Header {
    format: String,
    /// For messages: what counts is the fingerprint.
    scene: String,
    triangles: usize,
    /// Of everything about the scene that shaders read.
    fingerprint: String,
    histories: Vec<History>,
    /// Of the records.
    checksum: String,
}

/// The first thing of any header, whatever its version.
#[derive(Deserialize)]
struct Version {
    format: String,
}

#[derive(Serialize, Deserialize)]
struct History {
    name: String,
    item_bytes: u64,
    items: u32,
    /// The nodes that made the items.
    made_by: Vec<String>,
}

/// All histories of a run that can be saved, as one file.
///
/// # Errors
/// Where they cannot be read back.
pub async fn save(run: &Run, scene: &Scene) -> Result<Vec<u8>, RunError> {
    let mut histories = Vec::new();
    let mut records = Vec::new();
    for Saved { history, made_by, .. } in &run.plan().persistent {
        let items = run.variable(history.count);
        let contents = run.bytes(history.items).await?;
        records.extend_from_slice(&contents[..contents.len().min((history.item_bytes * u64::from(items)) as usize)]);
        histories.push(History { name: history.name.into(), item_bytes: history.item_bytes, items, made_by: made_by.clone() });
    }
    let header = Header {
        format: FORMAT.into(),
        scene: scene.name.clone(),
        triangles: scene.triangles.len(),
        fingerprint: fingerprint(scene),
        histories,
        checksum: Checksum::of(&records),
    };
    let mut file = serde_json::to_vec(&header).map_err(|error| wrong(error.to_string()))?;
    file.push(b'\n');
    file.extend_from_slice(&records);
    Ok(file)
}

/// Takes over what [`save`] wrote.
///
/// # Errors
/// Where the file is damaged, of another version, of another scene, or holds other histories than the run keeps, or such that other
/// nodes made.
pub fn load(run: &mut Run, scene: &Scene, file: &[u8]) -> Result<(), RunError> {
    let end = file.iter().position(|b| *b == b'\n').ok_or_else(|| wrong("it has no header".into()))?;
    let header = header(&file[..end])?;
    if header.fingerprint != fingerprint(scene) {
        let made_for = format!("it was made for another state of the scene: `{}` with {} triangles", header.scene, header.triangles);
        return Err(wrong(made_for));
    }
    let mut rest = &file[end + 1..];
    let expected = header.histories.iter().map(|h| h.item_bytes.saturating_mul(u64::from(h.items))).fold(0, u64::saturating_add);
    if expected != rest.len() as u64 {
        return Err(wrong(format!("it holds {} bytes of records, its header tells of {expected}", rest.len())));
    }
    if Checksum::of(rest) != header.checksum {
        return Err(wrong("its records are damaged: their checksum is another one".into()));
    }
    let plan = run.plan().clone();
    let histories: &[Saved] = &plan.persistent;
    if histories.len() != header.histories.len() {
        return Err(wrong(format!("it holds {} histories, the pipeline keeps {}", header.histories.len(), histories.len())));
    }
    // All are looked at before the first is taken over.
    for (history, saved) in histories.iter().zip(&header.histories) {
        fits(run, &history.history, saved)?;
        expect_same_makers(history, saved)?;
    }
    for (history, saved) in histories.iter().zip(&header.histories) {
        let (items, after) = rest.split_at((saved.item_bytes * u64::from(saved.items)) as usize);
        run.restore(&history.history, items, saved.items);
        rest = after;
    }
    Ok(())
}

fn header(line: &[u8]) -> Result<Header, RunError> {
    let unreadable = |error: serde_json::Error| wrong(format!("its header cannot be read: {error}"));
    let version: Version = serde_json::from_slice(line).map_err(unreadable)?;
    if version.format != FORMAT {
        return Err(wrong(format!("it is of the format `{}`, `{FORMAT}` is known", version.format)));
    }
    serde_json::from_slice(line).map_err(unreadable)
}

/// Records of a coarser tile, of another shape or with other light are no worse to read, but make a picture that nothing states.
fn expect_same_makers(history: &Saved, saved: &History) -> Result<(), RunError> {
    let longest = saved.made_by.len().max(history.made_by.len());
    let maker = |all: &[String], index: usize| all.get(index).map_or("nothing more", String::as_str).to_owned();
    let mut pairs = (0..longest).map(|index| [&saved.made_by, &history.made_by].map(|all| maker(all, index)));
    match pairs.find(|[theirs, ours]| theirs != ours) {
        Some([theirs, ours]) => Err(wrong(format!("its `{}` were made by {theirs}, the pipeline makes them by {ours}", saved.name))),
        None => Ok(()),
    }
}

fn fits(run: &Run, history: &Persistent, saved: &History) -> Result<(), RunError> {
    if saved.name != history.name || saved.item_bytes != history.item_bytes {
        let [theirs, ours] =
            [(saved.name.as_str(), saved.item_bytes), (history.name, history.item_bytes)].map(|(name, bytes)| format!("`{name}` of {bytes} bytes each"));
        return Err(wrong(format!("it holds {theirs}, the pipeline keeps {ours}")));
    }
    let capacity = run.plan().schedule.resource(history.items).kind.bytes() / history.item_bytes;
    if u64::from(saved.items) > capacity {
        return Err(wrong(format!("it holds {} `{}`, the pipeline has room for {capacity}", saved.items, saved.name)));
    }
    Ok(())
}

fn wrong(reason: String) -> RunError {
    RunError::Cache { reason }
}

/// Of geometry, materials, textures and lights: what records and references depend on. 16 hexadecimal digits.
pub fn fingerprint(scene: &Scene) -> String {
    let mut checksum = Checksum::default();
    contents(scene).for_each(|part| checksum.add(&part));
    checksum.finish()
}

/// FNV-1a of 64 bits (Fowler, Noll and Vo).
pub struct Checksum(u64);

impl Default for Checksum {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Checksum {
    /// 16 hexadecimal digits.
    pub fn of(bytes: &[u8]) -> String {
        let mut checksum = Self::default();
        checksum.add(bytes);
        checksum.finish()
    }

    /// Goes on with these bytes.
    pub fn add(&mut self, bytes: &[u8]) {
        self.0 = bytes.iter().fold(self.0, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3));
    }

    /// 16 hexadecimal digits of all that was added.
    pub fn finish(&self) -> String {
        format!("{:016x}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_the_published_vectors() {
        assert_eq!([&b""[..], b"a", b"foobar"].map(Checksum::of), ["cbf29ce484222325", "af63dc4c8601ec8c", "85944171f73967e8"]);
    }
}
