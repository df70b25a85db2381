//! Files in, none longer than memory is meant to hold.

use super::failure::{CommandError, Failure};
use crate::measure::{Layers, MAX_SAMPLES};
use crate::scene::load::{Disk, FileSystem};
use std::io;
use std::path::{Path, PathBuf};

/// The longest picture file that is read: as many floats as a picture may have, and a header.
pub const MOST_PICTURE_BYTES: u64 = 4 * MAX_SAMPLES as u64 + (1 << 20);

/// Reads a whole regular file of at most so many bytes.
///
/// # Errors
/// As those of [`FileSystem::read`].
pub fn read_file(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    Disk.read(path, most)
}

/// Reads a picture file of any kind.
pub fn read_picture(path: &Path) -> Result<Layers, Failure> {
    let bytes = read_file(path, MOST_PICTURE_BYTES).map_err(|error| Failure::read(path, error))?;
    Layers::read(&bytes).map_err(|error| Failure::input(CommandError::BadPicture { path: path.to_owned(), error }))
}

/// Most bytes that this process has held in memory; None where the system does not tell.
pub fn peak_host_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib * 1024)
}

/// `FILE` or `FILE:LAYER`, as the user wrote it.
#[derive(Debug, Clone)]
pub struct NamedFile {
    pub path: PathBuf,
    pub layer: Option<String>,
}

impl NamedFile {
    /// A file whose name holds the colon comes first.
    pub fn parse(argument: &str) -> Self {
        match argument.rsplit_once(':') {
            Some((path, layer)) if !Path::new(argument).exists() && !layer.contains(['/', '\\']) => Self { path: path.into(), layer: Some(layer.to_owned()) },
            _ => Self { path: argument.into(), layer: None },
        }
    }

    /// The picture. Where the file has one layer without a name, it has the one that is said; where it has others, the one that is said must be there.
    pub fn read(&self) -> Result<Layers, Failure> {
        let mut picture = read_picture(&self.path)?;
        if let Some(layer) = &self.layer {
            picture.rgb(layer).map_err(|error| Failure::input(CommandError::BadPicture { path: self.path.clone(), error }))?;
            if picture.is_nameless {
                picture.layers = picture.layers.into_values().map(|only| (layer.clone(), only)).collect();
            }
        }
        Ok(picture)
    }

    /// Refuses a picture of one layer that nobody says the meaning of.
    pub fn expect_meaning(&self, picture: &Layers) -> Result<(), Failure> {
        let is_open = picture.is_nameless && self.layer.is_none();
        if is_open { Err(Failure::input(CommandError::NamelessLayer { path: self.path.clone() })) } else { Ok(()) }
    }
}
