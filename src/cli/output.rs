//! Files out. A written file appears whole or not at all.

use super::console::{Console, write_stdout};
use super::failure::{CommandError, Failure};
use super::interrupt::Shelter;
use crate::measure::page::{Gallery, Report, page};
use crate::measure::{Layers, PICTURE, PictureError};
use serde::Serialize;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long nobody has to have written to a temporary file before it may be one that a killed run left.
const ABANDONED: Duration = Duration::from_secs(60);

/// How the names of temporary files begin and end, with so many letters and digits between.
const TEMPORARY: (&str, usize, &str) = (".hemisplat-", 6, ".tmp");

/// The name that stands for standard output.
pub const STDOUT: &str = "-";

/// A file to be written later, checked now, so that no work is done for a place that cannot hold its result.
pub struct Target {
    path: PathBuf,
}

impl Target {
    /// Creates the folder that the file will stand in, clears it of what killed runs left, and tries whether it takes files.
    pub fn new(path: &Path) -> Result<Self, Failure> {
        Self::probed(path).map_err(|error| Failure::write(path, error))
    }

    /// The same, and what the system says where it does not.
    pub fn probed(path: &Path) -> io::Result<Self> {
        let target = Self { path: path.to_owned() };
        target.probe()?;
        Ok(target)
    }

    fn probe(&self) -> io::Result<()> {
        if self.is_stdout() {
            return Ok(());
        }
        if self.path.is_dir() {
            return Err(io::Error::from(io::ErrorKind::IsADirectory));
        }
        let path = self.resolved();
        fs::create_dir_all(folder(&path))?;
        clear_abandoned(folder(&path));
        if is_special(&path) { Ok(()) } else { temporary(folder(&path)).map(drop) }
    }

    /// A link keeps being one: what it leads to is replaced.
    fn resolved(&self) -> PathBuf {
        fs::canonicalize(&self.path).unwrap_or_else(|_| self.path.clone())
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    fn is_stdout(&self) -> bool {
        self.path == Path::new(STDOUT)
    }

    /// Writes all bytes to a temporary file in the same folder, then gives it its name. Devices and pipes are written to directly.
    pub fn write(&self, bytes: &[u8]) -> Result<(), Failure> {
        self.try_write(bytes).map_err(|error| Failure::write(&self.path, error))
    }

    /// Writes a picture as EXR, as [`Target::write`] does, without holding the file in memory.
    fn write_exr(&self, picture: &Layers) -> Result<(), Failure> {
        let bad = |error| match error {
            PictureError::Unwritable(error) => Failure::write(&self.path, error),
            error => Failure::work(CommandError::BadPicture { path: self.path.clone(), error }),
        };
        if is_special(&self.resolved()) {
            // What cannot be sought gets the file in one piece.
            return self.write(&picture.to_exr().map_err(bad)?);
        }
        self.replace(|file| picture.write_exr(file)).map_err(bad)
    }

    /// Writes a record as JSON, as [`Target::write`] does.
    pub fn write_json(&self, record: &impl Serialize) -> Result<(), Failure> {
        let mut text = serde_json::to_vec_pretty(record).map_err(|error| Failure::work(CommandError::Json { reason: error.to_string() }))?;
        text.push(b'\n');
        self.write(&text)
    }

    /// Writes a report and its pictures as a page.
    pub fn write_page(&self, report: &Report, gallery: &Gallery) -> Result<(), Failure> {
        let page = page(report, gallery).map_err(|error| Failure::work(CommandError::BadPicture { path: self.path.clone(), error }))?;
        self.write(page.as_bytes())
    }

    fn try_write(&self, bytes: &[u8]) -> io::Result<()> {
        if self.is_stdout() {
            return write_stdout(bytes);
        }
        let path = self.resolved();
        if is_special(&path) {
            return fs::OpenOptions::new().write(true).open(&path)?.write_all(bytes);
        }
        self.replace(|file| file.write_all(bytes))
    }

    /// A temporary file in the same folder, for what is written piece by piece.
    pub fn begin(&self) -> io::Result<tempfile::NamedTempFile> {
        temporary(folder(&self.resolved()))
    }

    /// Gives it its name.
    pub fn end(&self, file: tempfile::NamedTempFile) -> io::Result<()> {
        file.persist(self.resolved()).map(drop).map_err(|error| error.error)
    }

    /// Fills a temporary file in the same folder, then gives it its name.
    fn replace<E: From<io::Error>>(&self, fill: impl FnOnce(&mut fs::File) -> Result<(), E>) -> Result<(), E> {
        let _shelter = Shelter::new();
        let mut file = self.begin()?;
        fill(file.as_file_mut())?;
        Ok(self.end(file)?)
    }
}

/// A picture to be written later, in the format that its name's ending says.
pub struct PictureTarget {
    target: Target,
    format: Format,
}

#[derive(Clone, Copy)]
enum Format {
    Exr,
    Png,
    Hdr,
}

impl PictureTarget {
    /// Refuses endings other than `.exr`, `.png`, `.hdr`.
    pub fn new(path: &Path) -> Result<Self, Failure> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        let format = match ending.as_deref() {
            Some("exr") => Format::Exr,
            Some("png") => Format::Png,
            Some("hdr") => Format::Hdr,
            _ => return Err(Failure::input(CommandError::UnknownFormat { path: path.to_owned() })),
        };
        Ok(Self { target: Target::new(path)?, format })
    }

    pub fn path(&self) -> &Path {
        self.target.path()
    }

    /// Whether its picture depends on an exposure.
    pub fn is_exposed(&self) -> bool {
        matches!(self.format, Format::Png)
    }

    /// Writes all layers as EXR, or the picture as PNG (tone-mapped after a factor of 2^`exposure`) or HDR.
    pub fn write(&self, picture: &Layers, exposure: f32) -> Result<(), Failure> {
        let bytes = match self.format {
            Format::Exr => return self.target.write_exr(picture),
            Format::Png => picture.to_png(PICTURE, exposure),
            Format::Hdr => picture.to_hdr(PICTURE),
        };
        self.target.write(&bytes.map_err(|error| Failure::work(CommandError::BadPicture { path: self.path().to_owned(), error }))?)
    }
}

/// The first file whose picture depends on an exposure.
pub fn exposed(targets: &[PictureTarget]) -> Option<&Path> {
    targets.iter().find(|target| target.is_exposed()).map(PictureTarget::path)
}

/// Says why a picture may show nothing.
pub fn warn_of_nothing(picture: &Layers, console: &Console) {
    let is_zero = |channel: &[f32]| channel.iter().all(|value| *value == 0.0);
    if picture.layers.get("depth").is_some_and(|depth| depth.channels.values().all(|channel| is_zero(channel))) {
        console
            .note("warning: the camera sees no surface: is it inside of something that it sees from behind, or does it look away? --eye and --target move it");
    } else if picture.rgb(PICTURE).is_ok_and(|colour| colour.iter().all(|channel| is_zero(channel))) {
        console.note("warning: the picture is black: no light reaches what the camera sees; is it in a closed room? --eye and --target move it, --sky and --sun light the scene");
    }
}

/// Refuses to write one file twice, or over what is read. Devices and pipes can take both.
pub fn expect_distinct(written: &[&Path], read: &[&Path]) -> Result<(), Failure> {
    let place = |path: &&Path| fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let mut taken: Vec<PathBuf> = read.iter().map(place).collect();
    for path in written.iter().filter(|path| !is_special(path)) {
        if taken.contains(&place(path)) {
            return Err(Failure::input(CommandError::SameFile { path: path.to_path_buf() }));
        }
        taken.push(place(path));
    }
    Ok(())
}

/// Whether something stands there that is no plain file, such as a device.
fn is_special(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|metadata| !metadata.is_file())
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A new file that vanishes unless it is given a name. While it is open it is locked, where the file system has locks: no other run clears it.
fn temporary(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let (begin, letters, end) = TEMPORARY;
    let mut builder = tempfile::Builder::new();
    builder.prefix(begin).rand_bytes(letters).suffix(end);
    for_all(&mut builder);
    let file = builder.tempfile_in(folder)?;
    file.as_file().try_lock().ok();
    Ok(file)
}

/// As any new file: what the user's mask leaves of read and write for all.
#[cfg(unix)]
fn for_all(builder: &mut tempfile::Builder<'_, '_>) {
    use std::os::unix::fs::PermissionsExt;
    builder.permissions(fs::Permissions::from_mode(0o666));
}

#[cfg(not(unix))]
fn for_all(_: &mut tempfile::Builder<'_, '_>) {}

/// Removes temporary files that killed runs left in a folder.
fn clear_abandoned(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let paths = entries.flatten().filter(|entry| entry.file_name().to_str().is_some_and(is_temporary)).map(|entry| entry.path());
    // What cannot be removed disturbs nobody.
    paths.filter(|path| is_abandoned(path)).for_each(|path| drop(fs::remove_file(path)));
}

fn is_temporary(name: &str) -> bool {
    let (begin, letters, end) = TEMPORARY;
    let middle = name.strip_prefix(begin).and_then(|name| name.strip_suffix(end));
    middle.is_some_and(|middle| middle.len() == letters && middle.bytes().all(|byte| byte.is_ascii_alphanumeric()))
}

/// Whether nobody has written to a file for a while, and nobody holds its lock.
fn is_abandoned(path: &Path) -> bool {
    let is_old = |metadata: fs::Metadata| metadata.is_file() && metadata.modified().is_ok_and(|at| at.elapsed().is_ok_and(|age| age > ABANDONED));
    fs::symlink_metadata(path).is_ok_and(is_old) && fs::OpenOptions::new().append(true).open(path).is_ok_and(|file| file.try_lock().is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_appears_whole_in_a_new_folder_and_replaces_an_older_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b/c.json");
        for text in ["first", "second"] {
            Target::new(&path).ok().unwrap().write(text.as_bytes()).ok().unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(names(path.parent().unwrap()), ["c.json"]);
    }

    #[test]
    fn a_picture_that_cannot_be_encoded_leaves_the_older_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        fs::write(&path, "older").unwrap();
        let bad = Layers::new(1, 1).with("weight", crate::measure::Layer::value(vec![f32::NAN]));
        let failure = PictureTarget::new(&path).ok().unwrap().write(&bad, 0.0).err().unwrap();
        assert_eq!((failure.status, fs::read_to_string(&path).unwrap()), (1, "older".to_owned()));
        assert_eq!(names(folder.path()), ["a.exr"]);
    }

    #[test]
    fn what_killed_runs_left_is_cleared_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let place = |name: &str| folder.path().join(name);
        let long_ago = std::time::SystemTime::now() - 2 * ABANDONED;
        let old = |name: &str| {
            let file = fs::File::create(place(name)).unwrap();
            file.set_modified(long_ago).unwrap();
            file
        };
        old(".hemisplat-Killed.tmp");
        // A run that takes long over its file, one that has just begun, and files of the user's.
        let busy = old(".hemisplat-busy01.tmp");
        busy.try_lock().unwrap();
        fs::write(place(".hemisplat-young1.tmp"), "").unwrap();
        let others = [".hemisplat-config", ".hemisplat-of me.tmp", ".hemisplat-longer1.tmp", "old.exr"];
        others.iter().for_each(|name| drop(old(name)));
        fs::create_dir(place(".hemisplat-folder.tmp")).unwrap();
        Target::new(&place("a.json")).ok().unwrap();
        let kept = [
            ".hemisplat-busy01.tmp",
            ".hemisplat-config",
            ".hemisplat-folder.tmp",
            ".hemisplat-longer1.tmp",
            ".hemisplat-of me.tmp",
            ".hemisplat-young1.tmp",
            "old.exr",
        ];
        assert_eq!(names(folder.path()), kept);
        // What this program writes is of that kind, and held.
        let own = temporary(folder.path()).unwrap();
        assert!(is_temporary(own.path().file_name().unwrap().to_str().unwrap()));
        own.as_file().set_modified(long_ago).unwrap();
        assert!(!is_abandoned(own.path()));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_reported() {
        let picture = Layers::new(1, 1).with("weight", crate::measure::Layer::value(vec![1.0]));
        let failure = Target::new(Path::new("/dev/full")).ok().unwrap().write_exr(&picture).err().unwrap();
        assert!(failure.report.to_string().contains("/dev/full"), "{}", failure.report);
        let failure = Target::new(Path::new("/dev/full")).ok().unwrap().write(b"x").err().unwrap();
        assert_eq!(failure.status, 1);
        assert!(failure.report.to_string().contains("/dev/full"), "{}", failure.report);
    }

    #[test]
    fn folders_and_unknown_endings_are_refused_before_work() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Target::new(folder.path()).err().unwrap().status, 1);
        assert_eq!(PictureTarget::new(Path::new("a.jpg")).err().unwrap().status, 2);
    }
}
