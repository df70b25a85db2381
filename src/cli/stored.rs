//! Tables kept between runs in the user's cache folder, each in a file of its own: a line that says what it is, a line of all that it depends on, a
//! checksum of the rest. Several processes may write the same one at once: it appears whole. One that is damaged is made anew.

use super::console::Console;
use super::input::read_file;
use super::output::Target;
use crate::contract::tables::TableStore;
use crate::measure::cache::Checksum;
use std::path::{Path, PathBuf};

const FORMAT: &str = "hemisplat table 1";

/// The largest table that is worth reading.
const MOST_BYTES: u64 = 1 << 28;

/// A folder of tables.
pub struct Stored<'c> {
    /// None where the system has no place for caches.
    folder: Option<PathBuf>,
    /// Where it says what cannot be kept.
    console: &'c Console,
}

impl<'c> Stored<'c> {
    pub fn new(folder: Option<PathBuf>, console: &'c Console) -> Self {
        Self { folder, console }
    }

    fn path(&self, key: &str) -> Option<PathBuf> {
        Some(self.folder.as_ref()?.join(format!("table-{}", Checksum::of(key.as_bytes()))))
    }
}

fn header(key: &str, table: &[u8]) -> String {
    format!("{FORMAT}\n{key}\n{}\n", Checksum::of(table))
}

fn read(path: &Path, key: &str) -> Option<Vec<u8>> {
    let file = read_file(path, MOST_BYTES).ok()?;
    let (found, table) = file.split_at_checked(header(key, &[]).len())?;
    (found == header(key, table).as_bytes()).then(|| table.to_vec())
}

impl TableStore for Stored<'_> {
    fn load(&self, key: &str) -> Option<Vec<u8>> {
        read(&self.path(key)?, key)
    }

    fn save(&self, key: &str, table: &[u8]) {
        let Some(path) = self.path(key) else { return };
        let saved = Target::new(&path).and_then(|target| target.write(&[header(key, table).as_bytes(), table].concat()));
        if let Err(failure) = saved {
            let (path, cause) = (path.display(), failure.cause());
            self.console.note(&format!("note: a table could not be kept in {path}, and is made anew by the next run: {cause}"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_comes_back_unless_a_byte_or_its_key_differs() {
        let (folder, console) = (tempfile::tempdir().unwrap(), Console::silent());
        let stored = Stored::new(Some(folder.path().join("new")), &console);
        assert_eq!(stored.load("key"), None);
        stored.save("key", &[1, 2, 3]);
        assert_eq!(stored.load("key"), Some(vec![1, 2, 3]));
        assert_eq!(stored.load("other"), None);
        let path = stored.path("key").unwrap();
        let whole = std::fs::read(&path).unwrap();
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 1;
            std::fs::write(&path, &damaged).unwrap();
            assert_eq!(stored.load("key"), None, "{at}");
            std::fs::write(&path, &whole[..at]).unwrap();
            assert_eq!(stored.load("key"), None, "{at} bytes");
        }
        stored.save("key", &[4]);
        assert_eq!(stored.load("key"), Some(vec![4]));
        assert_eq!(Stored::new(None, &console).load("key"), None);
    }
}
