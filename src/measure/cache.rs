//! Records as a file: what `--cache` saves and loads. A file that was left after a whole frame has all that the next one finds of those before it, so that a
//! sequence goes on as if it had not been interrupted.

use super::run::{Run, RunError};
use crate::contract::encoder::Persistent;
use crate::gpu::State;
use crate::gpu::scene::contents;
use crate::pipeline::plan::Saved;
use crate::scene::Scene;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

const FORMAT: &str = "hemisplat records 5";

/// The longest file that is worth reading: records of several caches as large as they may be.
pub const MOST_BYTES: u64 = 1 << 30;

/// What a run keeps for later ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Cache {
    header: Header,
    /// Items of the histories in their order, then what else the next frame finds.
    contents: Vec<u8>,
}

/// First line of the file; then the contents as they stand in memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Header {
    format: String,
    /// For messages: what counts is the fingerprint.
    scene: String,
    triangles: usize,
    /// Of everything about the scene that shaders read.
    fingerprint: String,
    /// When the scene was so [s].
    moment: f64,
    /// None where the last frame was not ended.
    after: Option<After>,
    histories: Vec<History>,
    /// None where nothing but the items can be kept.
    state: Option<KeptState>,
    /// Of the header without it, and of the contents.
    checksum: String,
}

/// The first thing of any header, whatever its version.
#[derive(Deserialize)]
struct Version {
    format: String,
}

/// The frame that was rendered last.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct After {
    /// Its number.
    pub frame: u32,
    /// When the one that follows is [s].
    pub next: f64,
    /// Of the sequence, where it was chosen from a picture [stops].
    pub exposure: Option<f32>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct History {
    name: String,
    item_bytes: u64,
    items: u32,
    /// The nodes that made the items.
    made_by: Vec<String>,
}

impl History {
    fn bytes(&self) -> u64 {
        self.item_bytes.saturating_mul(u64::from(self.items))
    }
}

/// A [`State`] whose resources stand among the contents.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct KeptState {
    /// The version of the program whose it is.
    program: String,
    frames: u32,
    variables: BTreeMap<String, u32>,
    /// Lengths [bytes].
    resources: BTreeMap<String, u64>,
}

impl Cache {
    /// All that a run has and a later one may go on with; of the scene as it is, which has this fingerprint, and was so at a moment [s]. `after` is the frame
    /// that it has rendered last, if that is whole.
    ///
    /// # Errors
    /// Where it cannot be read back.
    pub async fn of(run: &Run, (fingerprint, moment): (String, f64), after: Option<After>) -> Result<Self, RunError> {
        let (mut histories, mut contents) = (Vec::new(), Vec::new());
        for Saved { history, made_by, .. } in &run.plan().persistent {
            let (bytes, items) = run.items(history).await?;
            contents.extend_from_slice(&bytes);
            histories.push(History { name: history.name.into(), item_bytes: history.item_bytes, items, made_by: made_by.clone() });
        }
        // What is added to is whole after any iteration.
        let is_worth_it = after.is_some() || accumulates(run);
        let state = if is_worth_it { run.state().await? } else { None };
        let state = state.map(|State { frames, variables, resources }| {
            let lengths = resources.iter().map(|(name, bytes)| (name.clone(), bytes.len() as u64)).collect();
            resources.into_values().for_each(|bytes| contents.extend(bytes));
            KeptState { program: PROGRAM.into(), frames, variables, resources: lengths }
        });
        let scene = &run.stage().scene;
        let (format, checksum) = (FORMAT.into(), String::new());
        let header = Header { format, scene: scene.name.clone(), triangles: scene.triangles.len(), fingerprint, moment, after, histories, state, checksum };
        Ok(Self { header, contents })
    }

    /// As a file.
    ///
    /// # Errors
    /// None of finite numbers.
    pub fn to_file(&self) -> Result<Vec<u8>, RunError> {
        let sealed = Header { checksum: self.checksum()?, ..self.header.clone() };
        let mut file = line(&sealed)?;
        file.extend_from_slice(&self.contents);
        Ok(file)
    }

    /// What [`Cache::to_file`] has made.
    ///
    /// # Errors
    /// Where it is damaged or of another version.
    pub fn of_file(file: &[u8]) -> Result<Self, RunError> {
        let end = file.iter().position(|b| *b == b'\n').ok_or_else(|| wrong("it has no header".into()))?;
        let mut header = header(&file[..end])?;
        let is_as_written = line(&header)? == file[..=end];
        let rest = &file[end + 1..];
        let parts = header.histories.iter().map(History::bytes).chain(header.state.iter().flat_map(|state| state.resources.values().copied()));
        let expected = parts.fold(0, u64::saturating_add);
        if expected != rest.len() as u64 {
            return Err(wrong(format!("it holds {} bytes of records, its header tells of {expected}", rest.len())));
        }
        let checksum = std::mem::take(&mut header.checksum);
        let cache = Self { header, contents: rest.to_vec() };
        if !is_as_written || cache.checksum()? != checksum {
            return Err(wrong("it is damaged: its checksum is another one".into()));
        }
        Ok(cache)
    }

    fn checksum(&self) -> Result<String, RunError> {
        let mut checksum = Checksum::default();
        checksum.add(&line(&Header { checksum: String::new(), ..self.header.clone() })?);
        checksum.add(&self.contents);
        Ok(checksum.finish())
    }

    /// When the scene was as it is to be [s].
    pub fn moment(&self) -> f64 {
        self.header.moment
    }

    /// The frame that was rendered last; None where it was not ended.
    pub fn after(&self) -> Option<&After> {
        self.header.after.as_ref()
    }

    /// Hands over the records to a run whose scene is at [its moment](Self::moment); where the run `goes_on` with the next frame, also all else that this finds
    /// of those before it.
    ///
    /// # Errors
    /// Records of another scene, or others than the run keeps, or such that other nodes made.
    pub fn give(&self, run: &mut Run, goes_on: bool) -> Result<Given, RunError> {
        let Header { scene, triangles, histories: saved, .. } = &self.header;
        if self.header.fingerprint != fingerprint(&run.stage().scene) {
            return Err(wrong(format!("it was made for another state of the scene: `{scene}` with {triangles} triangles")));
        }
        let plan = run.plan().clone();
        let histories: &[Saved] = &plan.persistent;
        if histories.len() != saved.len() {
            return Err(wrong(format!("it holds {} histories, the pipeline keeps {}", saved.len(), histories.len())));
        }
        // All are looked at before the first is taken over.
        for (history, saved) in histories.iter().zip(saved) {
            fits(run, &history.history, saved)?;
            expect_same_makers(history, saved)?;
        }
        let mut rest = &self.contents[..];
        for (history, saved) in histories.iter().zip(saved) {
            let (items, after) = rest.split_at(saved.bytes() as usize);
            run.restore(&history.history, items, saved.items);
            rest = after;
        }
        let Some(state) = self.state(rest) else { return Ok(Given::Items) };
        Ok(match () {
            () if goes_on && run.go_on_from(&state) => Given::All,
            () if accumulates(run) && run.add_to(&state) => Given::Accumulated,
            () => Given::Items,
        })
    }

    /// What the next frame finds, whose memory stands behind the items; None of another version of the program.
    fn state(&self, mut rest: &[u8]) -> Option<State> {
        let KeptState { frames, variables, resources, .. } = self.header.state.as_ref().filter(|state| state.program == PROGRAM)?;
        let mut part = |(name, bytes): (&String, &u64)| {
            let (contents, after) = rest.split_at_checked(usize::try_from(*bytes).ok()?)?;
            rest = after;
            Some((name.clone(), contents.to_vec()))
        };
        let resources = resources.iter().map(&mut part).collect::<Option<_>>()?;
        Some(State { frames: *frames, variables: variables.clone(), resources })
    }
}

/// What a run has taken over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Given {
    /// Whatever the frame before has left.
    All,
    /// Records, and what is added to in any frame.
    Accumulated,
    /// Records alone.
    Items,
}

/// Whether a run has what is added to in any frame.
pub fn accumulates(run: &Run) -> bool {
    !run.plan().schedule.accumulated.resources.is_empty()
}

const PROGRAM: &str = env!("CARGO_PKG_VERSION");

/// A header as it stands in the file.
fn line(header: &Header) -> Result<Vec<u8>, RunError> {
    let mut line = serde_json::to_vec(header).map_err(|error| wrong(error.to_string()))?;
    line.push(b'\n');
    Ok(line)
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
    use proptest::prelude::*;

    /// Of two histories and a state.
    fn cache() -> Cache {
        let history = |name: &str, items| History { name: name.into(), item_bytes: 4, items, made_by: vec!["tiles \"a\"".into()] };
        let variables = [("aged.still".to_owned(), 3), ("cache.known".to_owned(), 2)].into();
        let resources = [("aged.places".to_owned(), 32), ("cache.lives".to_owned(), 7)].into();
        let header = Header {
            format: FORMAT.into(),
            scene: "a scene\n".into(),
            triangles: 12,
            fingerprint: "0".into(),
            moment: 1.0 / 3.0,
            after: Some(After { frame: 7, next: 0.1 + 0.2, exposure: Some(-0.37) }),
            histories: vec![history("records", 3), history("coefficients", 5)],
            state: Some(KeptState { program: PROGRAM.into(), frames: 2, variables, resources }),
            checksum: String::new(),
        };
        Cache { header, contents: (0..12 + 20 + 32 + 7).collect() }
    }

    #[test]
    fn a_file_comes_back_to_the_bit_and_each_part_is_where_it_was() {
        let cache = cache();
        let again = Cache::of_file(&cache.to_file().unwrap()).unwrap();
        assert_eq!(again, cache);
        let state = again.state(&again.contents[32..]).unwrap();
        assert_eq!((state.frames, state.variables["cache.known"]), (2, 2));
        assert_eq!((state.resources["aged.places"].as_slice(), state.resources["cache.lives"].as_slice()), (&cache.contents[32..64], &cache.contents[64..]));
    }

    /// Of each byte that is another, of each that is missing, of each that is too many.
    #[test]
    fn a_file_that_is_not_whole_is_refused() {
        let file = cache().to_file().unwrap();
        let is_refused = |file: &[u8], what: &str| {
            let told = Cache::of_file(file).err().map(|error| error.to_string());
            assert!(told.as_ref().is_some_and(|told| told.starts_with("the file of records does not fit: it")), "{what}: {told:?}");
        };
        for at in 0..file.len() {
            is_refused(&file[..at], &format!("{at} bytes"));
            for bit in 0..8 {
                let mut other = file.clone();
                other[at] ^= 1 << bit;
                is_refused(&other, &format!("bit {bit} of byte {at}"));
            }
        }
        is_refused(&[&file[..], b"x"].concat(), "a byte more");
    }

    proptest! {
        /// Whatever stands in a file, it is told in words.
        #[test]
        fn no_file_brings_the_program_down(noise in prop::collection::vec(any::<u8>(), 0..300), at in 0usize..2000, cut in 0usize..2000, whole in any::<bool>()) {
            let mut file = cache().to_file().unwrap();
            let at = at.min(file.len());
            file.splice(at..(at + cut).min(file.len()), noise.iter().copied());
            let file = if whole { file } else { noise };
            if file != cache().to_file().unwrap() {
                prop_assert!(Cache::of_file(&file).is_err());
            }
        }
    }

    /// Numbers of a header that nobody has written: nothing is split off that is not there.
    #[test]
    fn a_header_that_tells_of_more_than_there_is_is_refused() {
        for (items, length) in [(u32::MAX, 7), (3, u64::MAX)] {
            let mut cache = cache();
            cache.header.histories[0].items = items;
            cache.header.state.iter_mut().for_each(|state| {
                state.resources.insert("cache.lives".into(), length);
            });
            assert!(Cache::of_file(&cache.to_file().unwrap()).is_err());
            assert!(length == 7 || cache.state(&cache.contents[32..]).is_none());
        }
    }

    #[test]
    fn what_another_version_of_the_program_left_is_not_gone_on_with() {
        let mut cache = cache();
        cache.header.state.iter_mut().for_each(|state| state.program = "0.0.9".into());
        assert!(cache.state(&cache.contents[32..]).is_none());
    }

    #[test]
    fn the_checksum_is_that_of_the_published_vectors() {
        assert_eq!([&b""[..], b"a", b"foobar"].map(Checksum::of), ["cbf29ce484222325", "af63dc4c8601ec8c", "85944171f73967e8"]);
    }
}
