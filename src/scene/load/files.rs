//! Every byte that loading takes from files: regular ones only, each shared while it is in use, all of them within a limit.

use super::{
    error::{Problem, SceneError},
    file_system::FileSystem,
};
use std::{
    cell::{Cell, RefCell},
    collections::HashMap,
    io::{self, ErrorKind},
    ops::{Deref, Range},
    path::{Path, PathBuf},
    sync::{Arc, Weak},
};

/// The largest file that is read [bytes].
const MAX_FILE: u64 = 4 << 30;
/// What all files of a scene may take [bytes].
const MAX_TOTAL: u64 = 8 << 30;

/// What messages call a file.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// A part of a file, shared by all that look at it.
#[derive(Debug, Clone)]
pub(super) struct Bytes {
    all: Arc<Vec<u8>>,
    range: Range<usize>,
}

impl Bytes {
    /// A part of these; None where it reaches past them.
    pub fn part(&self, range: Range<usize>) -> Option<Self> {
        self.get(range.clone())?;
        Some(Self { all: self.all.clone(), range: self.range.start + range.start..self.range.start + range.end })
    }
}

impl From<Arc<Vec<u8>>> for Bytes {
    fn from(all: Arc<Vec<u8>>) -> Self {
        Self { range: 0..all.len(), all }
    }
}

impl From<Vec<u8>> for Bytes {
    fn from(bytes: Vec<u8>) -> Self {
        Arc::new(bytes).into()
    }
}

impl Deref for Bytes {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        &self.all[self.range.clone()]
    }
}

/// The files of one scene.
pub(super) struct Files<'a> {
    system: &'a dyn FileSystem,
    /// What all of them may still take [bytes].
    left: Cell<u64>,
    /// Those in use, so that a file which many parts name is read once and held once.
    open: RefCell<HashMap<PathBuf, Weak<Vec<u8>>>>,
}

impl<'a> Files<'a> {
    pub fn of(system: &'a dyn FileSystem) -> Self {
        Self::within(MAX_TOTAL, system)
    }

    /// Files that take at most so many bytes in all.
    pub fn within(total: u64, system: &'a dyn FileSystem) -> Self {
        Self { system, left: Cell::new(total), open: RefCell::default() }
    }

    /// Whether a file is there.
    pub fn is_there(&self, path: &Path) -> bool {
        self.system.stamp(path).is_some()
    }

    /// Reads a whole file.
    ///
    /// # Errors
    /// One that is missing, unreadable, no regular file, or too large by itself or together with those before it.
    pub fn read(&self, path: &Path) -> Result<Bytes, SceneError> {
        let unreadable = |error| unreadable(path, &error);
        let canonical = self.system.canonical(path).map_err(unreadable)?;
        if let Some(known) = self.open.borrow().get(&canonical).and_then(Weak::upgrade) {
            return Ok(known.into());
        }
        let left = self.left.get();
        let bytes = self.system.read(&canonical, MAX_FILE.min(left)).map_err(|error| match error.kind() {
            ErrorKind::FileTooLarge if left < MAX_FILE => beyond_total(path),
            _ => unreadable(error),
        })?;
        self.left.set(left - bytes.len() as u64);
        let bytes = Arc::new(bytes);
        self.open.borrow_mut().insert(canonical, Arc::downgrade(&bytes));
        Ok(bytes.into())
    }

    /// Reads a text file.
    ///
    /// # Errors
    /// As those of [`Self::read`].
    pub fn read_text(&self, path: &Path) -> Result<String, SceneError> {
        let text = decode_text(&self.read(path)?);
        let is_lone = |pair: &[u8]| pair[0] == b'\r' && pair[1] != b'\n';
        let ends_lines_with_returns = text.as_bytes().windows(2).any(is_lone);
        Ok(if ends_lines_with_returns { text.replace("\r\n", "\n").replace('\r', "\n") } else { text })
    }
}

/// UTF-8, or UTF-16 behind a mark of the byte order; a mark is left out. What is neither, as in old names, becomes replacement characters.
fn decode_text(bytes: &[u8]) -> String {
    let decode_wide = |bytes: &[u8], word: fn([u8; 2]) -> u16| {
        let words: Vec<u16> = bytes.chunks_exact(2).map(|pair| word([pair[0], pair[1]])).collect();
        String::from_utf16_lossy(&words)
    };
    match bytes {
        [0xff, 0xfe, rest @ ..] => decode_wide(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => decode_wide(rest, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] | rest => String::from_utf8_lossy(rest).into_owned(),
    }
}

/// Why the file at a path cannot be read.
pub(super) fn unreadable(path: &Path, error: &io::Error) -> SceneError {
    let path = path.display();
    match error.kind() {
        ErrorKind::FileTooLarge => SceneError::new(Problem::TooLarge, format!("`{path}` is larger than 4 GiB, the limit for one file")).help("split the file"),
        ErrorKind::InvalidInput => {
            SceneError::new(Problem::Unreadable, format!("`{path}` is not a regular file")).help("name a file; devices, pipes and folders are not read")
        }
        ErrorKind::NotFound => {
            SceneError::new(Problem::NotFound, format!("`{path}` cannot be read: {}", error.kind())).help("check the path and its permissions")
        }
        other => SceneError::new(Problem::Unreadable, format!("`{path}` cannot be read: {other}")).help("check the path and its permissions"),
    }
}

fn beyond_total(path: &Path) -> SceneError {
    SceneError::new(Problem::TooLarge, format!("the scene's files take more than 8 GiB; `{}` is one too many", path.display()))
        .help("leave files out, or use smaller ones")
}
