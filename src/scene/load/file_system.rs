//! Where files are: on a disk, or wherever a program has them instead.

use std::{
    collections::BTreeMap,
    fmt, io,
    path::{Path, PathBuf},
    time::SystemTime,
};

/// A file's length [bytes] and when it was written, if that is known; None where there is no regular file.
pub type Stamp = Option<(u64, Option<SystemTime>)>;

/// What scenes are loaded from. Nothing else is read for one.
pub trait FileSystem: fmt::Debug + Send + Sync {
    /// How a file stands, without reading it.
    fn stamp(&self, path: &Path) -> Stamp;

    /// The one name of a file, or of a folder, by whatever path it is reached: by it a file that several parts of a scene name is read once.
    ///
    /// # Errors
    /// What is not there ([`io::ErrorKind::NotFound`]), and what cannot be reached.
    fn canonical(&self, path: &Path) -> io::Result<PathBuf>;

    /// Reads a whole file of at most so many bytes.
    ///
    /// # Errors
    /// What is not there ([`io::ErrorKind::NotFound`]), is no regular file ([`io::ErrorKind::InvalidInput`]), is longer ([`io::ErrorKind::FileTooLarge`]), or
    /// cannot be read.
    fn read(&self, path: &Path, most: u64) -> io::Result<Vec<u8>>;
}

pub(super) fn too_large(most: u64) -> io::Error {
    io::Error::new(io::ErrorKind::FileTooLarge, format!("it is longer than the limit of {most} bytes"))
}

/// Files that a program has in memory, as of an archive or of a download, by the paths that scenes name them with.
#[derive(Clone, Default)]
pub struct Memory(BTreeMap<PathBuf, Vec<u8>>);

impl Memory {
    /// Paths are compared part by part, after `.` and `..` are taken out.
    pub fn new<P: Into<PathBuf>>(files: impl IntoIterator<Item = (P, Vec<u8>)>) -> Self {
        Self(files.into_iter().map(|(path, bytes)| (plain(&path.into()), bytes)).collect())
    }

    fn find(&self, path: &Path) -> io::Result<(PathBuf, &[u8])> {
        let path = plain(path);
        let bytes = self.0.get(&path).ok_or(io::ErrorKind::NotFound)?;
        Ok((path, bytes))
    }
}

impl fmt::Debug for Memory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_map().entries(self.0.iter().map(|(path, bytes)| (path, bytes.len()))).finish()
    }
}

impl FileSystem for Memory {
    fn stamp(&self, path: &Path) -> Stamp {
        self.find(path).ok().map(|(_, bytes)| (bytes.len() as u64, None))
    }

    fn canonical(&self, path: &Path) -> io::Result<PathBuf> {
        self.find(path).map(|(path, _)| path)
    }

    fn read(&self, path: &Path, most: u64) -> io::Result<Vec<u8>> {
        let (_, bytes) = self.find(path)?;
        if bytes.len() as u64 <= most { Ok(bytes.to_vec()) } else { Err(too_large(most)) }
    }
}

/// A path without `.`, and without `..` behind a folder.
fn plain(path: &Path) -> PathBuf {
    use std::path::Component::{CurDir, Normal, ParentDir};
    path.components().fold(PathBuf::new(), |mut plain, part| {
        match part {
            CurDir => {}
            ParentDir if matches!(plain.components().next_back(), Some(Normal(_))) => _ = plain.pop(),
            other => plain.push(other),
        }
        plain
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_in_memory_are_found_by_any_path_to_them() {
        let memory = Memory::new([("a/b.obj", b"four".to_vec()), ("../c", vec![])]);
        for path in ["a/b.obj", "./a/b.obj", "a/x/../b.obj", "x/../a/./b.obj"] {
            assert_eq!(memory.canonical(Path::new(path)).unwrap(), Path::new("a/b.obj"));
        }
        assert_eq!(memory.stamp(Path::new("x/../../c")), Some((0, None)));
        assert_eq!(memory.read(Path::new("a/b.obj"), 4).unwrap(), b"four");
        assert_eq!(memory.read(Path::new("a/b.obj"), 3).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        for missing in ["b.obj", "a", "../a/b.obj", ""] {
            assert_eq!(memory.read(Path::new(missing), 4).unwrap_err().kind(), io::ErrorKind::NotFound, "{missing}");
        }
    }
}
