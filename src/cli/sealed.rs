//! Pictures that are kept between runs: an EXR file with a line after its end that holds its checksum; other programs read it as they read any.
//! Everything that the picture depends on stands in it as the attribute `key`.

use super::failure::{CommandError, Failure};
use super::input::{MOST_PICTURE_BYTES, read_file};
use super::output::Target;
use crate::measure::Layers;
use crate::measure::cache::Checksum;
use std::path::Path;

/// Begins the line after the picture's end.
const TRAILER: &[u8] = b"\nhemisplat checksum ";

/// Why there is no picture to be had.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Unusable {
    Absent,
    /// Or it is another picture.
    Damaged,
}

pub(super) fn write(target: &Target, picture: Layers, key: &str) -> Result<(), Failure> {
    let exr = picture.with_attribute("key", key).to_exr();
    let exr = exr.map_err(|error| Failure::work(CommandError::BadPicture { path: target.path().to_owned(), error }))?;
    target.write(&seal(exr))
}

pub(super) fn read(path: &Path, key: &str) -> Result<Layers, Unusable> {
    let file = read_file(path, MOST_PICTURE_BYTES).map_err(|_| Unusable::Absent)?;
    open(&file).filter(|picture| picture.attributes.get("key").is_some_and(|found| found == key)).ok_or(Unusable::Damaged)
}

/// The file with its checksum after its end.
fn seal(mut exr: Vec<u8>) -> Vec<u8> {
    let checksum = Checksum::of(&exr);
    exr.extend_from_slice(TRAILER);
    exr.extend_from_slice(checksum.as_bytes());
    exr
}

/// The picture of a sealed file; None where a bit of it is another one.
fn open(file: &[u8]) -> Option<Layers> {
    let (exr, checksum) = file.split_at_checked(file.len().checked_sub(TRAILER.len() + 16)?)?;
    let checksum = checksum.strip_prefix(TRAILER)?;
    (Checksum::of(exr).as_bytes() == checksum).then(|| Layers::from_exr(exr).ok())?
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::Layer;

    #[test]
    fn a_picture_comes_back_unless_a_byte_or_its_key_differs() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        assert_eq!(read(&path, "key"), Err(Unusable::Absent));
        let picture = Layers::new(2, 1).with("weight", Layer::value(vec![1.0, 2.0]));
        write(&Target::new(&path).ok().unwrap(), picture.clone(), "key").ok().unwrap();
        assert_eq!(read(&path, "key"), Ok(picture.with_attribute("key", "key")));
        assert_eq!(read(&path, "other"), Err(Unusable::Damaged));
        let whole = std::fs::read(&path).unwrap();
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 1;
            std::fs::write(&path, &damaged).unwrap();
            assert_eq!(read(&path, "key"), Err(Unusable::Damaged), "{at}");
        }
    }
}
