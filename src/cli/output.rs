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

/// The name that stands for standard output.
pub const STDOUT: &str = "-";

/// A file to be written later, checked now, so that no work is done for a place that cannot hold its result.
pub struct Target {
    path: PathBuf,
}

impl Target {
    /// Creates the folder that the file will stand in, and tries whether it takes files.
    pub fn new(path: &Path) -> Result<Self, Failure> {
        let target = Self { path: path.to_owned() };
        target.probe().map_err(|error| Failure::write(path, error))?;
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

    /// Fills a temporary file in the same folder, then gives it its name.
    fn replace<E: From<io::Error>>(&self, fill: impl FnOnce(&mut fs::File) -> Result<(), E>) -> Result<(), E> {
        let _shelter = Shelter::new();
        let path = self.resolved();
        let mut file = temporary(folder(&path))?;
        fill(file.as_file_mut())?;
        file.persist(&path).map_err(|error| error.error)?;
        Ok(())
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

#[cfg(unix)]
fn temporary(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    use std::os::unix::fs::PermissionsExt;
    // As any new file: what the user's mask leaves of read and write for all.
    tempfile::Builder::new().prefix(".hemisplat-").permissions(fs::Permissions::from_mode(0o666)).tempfile_in(folder)
}

#[cfg(not(unix))]
fn temporary(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    tempfile::Builder::new().prefix(".hemisplat-").tempfile_in(folder)
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
