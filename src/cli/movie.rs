//! A sequence as one animated PNG, for a look: browsers play it. It appears whole or not at all.

use super::failure::{CommandError, Failure};
use super::output::Target;
use super::timeline::RateOptions;
use crate::measure::{Layers, PICTURE};
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;
use tempfile::NamedTempFile;

/// Whether a name is that of an animated picture.
pub fn is_movie(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("apng"))
}

/// An animated picture as its frames come.
pub struct Movie<'t> {
    target: &'t Target,
    file: NamedTempFile,
    writer: png::Writer<BufWriter<File>>,
}

impl<'t> Movie<'t> {
    /// Of so many frames of this width and height.
    pub fn begin(target: &'t Target, frames: usize, [width, height]: [u32; 2], rate: RateOptions) -> Result<Self, Failure> {
        let unwritable = |error: io::Error| Failure::write(target.path(), error);
        let file = target.begin().map_err(unwritable)?;
        let opened = || -> io::Result<_> {
            let mut encoder = png::Encoder::new(BufWriter::new(file.as_file().try_clone()?), width, height);
            encoder.set_color(png::ColorType::Rgb);
            encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
            // Played for ever.
            encoder.set_animated(frames as u32, 0)?;
            let [numerator, denominator] = rate.delay();
            encoder.set_frame_delay(numerator, denominator)?;
            Ok(encoder.write_header()?)
        };
        let writer = opened().map_err(unwritable)?;
        Ok(Self { target, file, writer })
    }

    pub fn path(&self) -> &'t Path {
        self.target.path()
    }

    /// Adds a frame, tone-mapped after a factor of 2^`exposure`.
    pub fn add(&mut self, picture: &Layers, exposure: f32) -> Result<(), Failure> {
        let bytes = picture.to_srgb(PICTURE, exposure);
        let bytes = bytes.map_err(|error| Failure::work(CommandError::BadPicture { path: self.path().to_owned(), error }))?;
        self.writer.write_image_data(&bytes).map_err(|error| Failure::write(self.path(), error.into()))
    }

    /// Gives it its name, once all frames are there.
    pub fn end(self) -> Result<&'t Path, Failure> {
        let Self { target, file, writer } = self;
        writer.finish().map_err(io::Error::from).and_then(|()| target.end(file)).map_err(|error| Failure::write(target.path(), error))?;
        Ok(target.path())
    }
}
