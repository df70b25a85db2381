//! Files in, none longer than memory is meant to hold: what is read may be a device that never ends.

use super::failure::{CommandError, Failure};
use crate::measure::{Layers, MAX_SAMPLES};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// The longest picture file that is read: as many floats as a picture may have, and a header.
pub const MOST_PICTURE_BYTES: u64 = 4 * MAX_SAMPLES as u64 + (1 << 20);

/// Reads a whole file of at most so many bytes.
pub fn read_file(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let mut bytes = Vec::new();
    file.take(most + 1).read_to_end(&mut bytes)?;
    let is_whole = bytes.len() as u64 <= most;
    is_whole.then_some(bytes).ok_or_else(|| io::Error::new(io::ErrorKind::FileTooLarge, format!("it is longer than the limit of {most} bytes")))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_up_to_its_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "four").unwrap();
        assert_eq!(read_file(&path, 4).unwrap(), b"four");
        assert_eq!(read_file(&path, 3).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
    }

    #[test]
    #[cfg(unix)]
    fn a_device_that_never_ends_is_refused() {
        assert_eq!(read_file(Path::new("/dev/zero"), 1000).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
    }
}
