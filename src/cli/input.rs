//! Files in, none longer than memory is meant to hold.

pub use crate::scene::load::read_file;

use super::failure::{CommandError, Failure};
use crate::measure::{Layers, MAX_SAMPLES};
use std::path::Path;

/// The longest picture file that is read: as many floats as a picture may have, and a header.
pub const MOST_PICTURE_BYTES: u64 = 4 * MAX_SAMPLES as u64 + (1 << 20);

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
