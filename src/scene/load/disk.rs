//! The files of the system.

use super::file_system::{FileSystem, Stamp, too_large};
use std::{
    fs::{File, metadata},
    io::{self, ErrorKind, Read},
    path::{Path, PathBuf},
};

/// The files of the system, relative ones from the working folder. A device, a pipe or a folder is never read: those may never end, or wait for somebody to
/// write into them.
#[derive(Debug, Clone, Copy, Default)]
pub struct Disk;

impl FileSystem for Disk {
    fn stamp(&self, path: &Path) -> Stamp {
        let found = metadata(path).ok().filter(|found| found.is_file())?;
        Some((found.len(), found.modified().ok()))
    }

    fn canonical(&self, path: &Path) -> io::Result<PathBuf> {
        path.canonicalize()
    }

    fn read(&self, path: &Path, most: u64) -> io::Result<Vec<u8>> {
        // To open a pipe is to wait for its other end: what it is has to be known before.
        let stated = metadata(path)?;
        if !stated.is_file() {
            return Err(io::Error::new(ErrorKind::InvalidInput, "it is not a regular file"));
        }
        if stated.len() > most {
            return Err(too_large(most));
        }
        let mut bytes = Vec::new();
        bytes.try_reserve_exact(usize::try_from(stated.len()).map_err(|_| too_large(most))?).map_err(|_| ErrorKind::OutOfMemory)?;
        // A file may grow while it is read.
        File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 <= most { Ok(bytes) } else { Err(too_large(most)) }
    }
}
