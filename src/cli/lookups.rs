//! Which files were looked for, and how they stood just before: enough to tell when one of them is another, is gone, or has come.

use crate::scene::load::{Disk, FileSystem, Stamp};
use std::{
    collections::BTreeMap,
    io,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

/// The files of the system, where all that is looked for is noted, there or not. Clones share one list.
#[derive(Debug, Clone, Default)]
pub struct Lookups(Arc<Mutex<BTreeMap<PathBuf, Stamp>>>);

impl Lookups {
    /// Takes down how a file stands before it is read, so that a change while it is read is not missed. The first look counts.
    pub fn note(&self, path: &Path) {
        self.list().entry(path.to_owned()).or_insert_with(|| Disk.stamp(path));
    }

    /// Those that are not as they were when they were looked for, and how they are now.
    pub fn changes(&self) -> BTreeMap<PathBuf, Stamp> {
        let change = |(path, before): (&PathBuf, &Stamp)| Some((path.clone(), Disk.stamp(path))).filter(|(_, now)| now != before);
        self.list().iter().filter_map(change).collect()
    }

    /// How many of them there were.
    pub fn files(&self) -> usize {
        self.list().values().flatten().count()
    }

    fn list(&self) -> MutexGuard<'_, BTreeMap<PathBuf, Stamp>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl FileSystem for Lookups {
    fn stamp(&self, path: &Path) -> Stamp {
        self.note(path);
        Disk.stamp(path)
    }

    fn canonical(&self, path: &Path) -> io::Result<PathBuf> {
        self.note(path);
        Disk.canonical(path)
    }

    fn read(&self, path: &Path, most: u64) -> io::Result<Vec<u8>> {
        Disk.read(path, most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{fs, time::SystemTime};

    #[test]
    fn what_is_written_removed_or_made_has_changed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let place = |name: &str| folder.path().join(name);
        for name in ["same", "longer", "later", "gone"] {
            fs::write(place(name), "1").unwrap();
        }
        let lookups = Lookups::default();
        ["same", "longer", "later", "gone", "new", "never"].iter().for_each(|name| lookups.note(&place(name)));
        assert_eq!((lookups.changes().len(), lookups.files()), (0, 4));
        fs::write(place("longer"), "12").unwrap();
        fs::File::options().append(true).open(place("later")).unwrap().set_modified(SystemTime::UNIX_EPOCH).unwrap();
        fs::remove_file(place("gone")).unwrap();
        fs::write(place("new"), "1").unwrap();
        lookups.note(&place("longer"));
        let names: Vec<PathBuf> = lookups.changes().into_keys().collect();
        assert_eq!(names, ["gone", "later", "longer", "new"].map(place));
    }
}
