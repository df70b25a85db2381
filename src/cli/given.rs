//! Pictures that other programs made, which `hemisplat compare` judges beside those of pipelines.

use super::failure::{CommandError, Failure};
use super::input::NamedFile;
use super::scene::View;
use super::truth::{Truth, expect_shown};
use crate::measure::compare::{Given, GivenPicture, letters};
use crate::measure::{DIRECT, GLOSSY, IRRADIANCE, Layers, MetricsError, PICTURE};
use std::path::Path;

/// `LABEL=FILE:LAYER[,seconds=S]` as the user wrote it.
#[derive(Debug, Clone)]
pub struct PictureOption {
    label: String,
    file: NamedFile,
    seconds: Option<f64>,
}

impl PictureOption {
    pub fn parse(text: &str) -> Result<Self, String> {
        let (label, rest) = text.split_once('=').filter(|(label, file)| !label.is_empty() && !file.is_empty()).ok_or("expected LABEL=FILE.exr:LAYER")?;
        let (file, seconds) = match rest.rsplit_once(",seconds=") {
            Some((file, seconds)) => (file, Some(positive(seconds)?)),
            None => (rest, None),
        };
        Ok(Self { label: label.to_owned(), file: NamedFile::parse(file), seconds })
    }

    pub fn path(&self) -> &Path {
        &self.file.path
    }

    /// Reads the picture, and refuses one of another size, or one that says that it shows something else, unless it is taken `anyway`.
    pub fn read(&self, view: &View, anyway: bool) -> Result<Layers, Failure> {
        let picture = self.file.read()?;
        self.file.expect_meaning(&picture)?;
        if let Some(layer) = self.file.layer.as_ref().filter(|layer| !JUDGED.contains(&layer.as_str())) {
            return Err(Failure::input(CommandError::NotJudged { path: self.path().to_owned(), layer: layer.clone(), judged: JUDGED.join(", ") }));
        }
        let found = [picture.width, picture.height];
        if found != view.size {
            let error = MetricsError::SizesDiffer { test: found, reference: view.size };
            return Err(Failure::input(CommandError::BadGiven { path: self.path().to_owned(), error }));
        }
        if !anyway {
            expect_shown(view, &picture, self.path())?;
        }
        Ok(only(picture, self.file.layer.as_deref()))
    }

    /// The picture's errors, as the row of this place.
    pub fn judge(&self, place: usize, picture: &Layers, truth: &Truth) -> Result<GivenPicture, Failure> {
        Ok(GivenPicture {
            id: letters(place),
            name: self.label.clone(),
            given: Given {
                file: self.path().display().to_string(),
                layer: self.file.layer.clone(),
                bounces: picture.attributes.get("bounces").cloned(),
                seconds: self.seconds,
                errors: truth.judge_given(picture, self.path())?,
            },
        })
    }
}

/// The layers that pictures are judged by.
pub const JUDGED: [&str; 4] = [IRRADIANCE, PICTURE, GLOSSY, DIRECT];

/// The picture without the layers that are judged but this one; with all of them where none is named.
pub fn only(mut picture: Layers, layer: Option<&str>) -> Layers {
    let is_left = |name: &str| layer.is_none_or(|layer| layer == name) || !JUDGED.contains(&name);
    picture.layers.retain(|name, _| is_left(name));
    picture
}

fn positive(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds: &f64| *seconds > 0.0 && seconds.is_finite());
    seconds.ok_or_else(|| format!("`seconds` is a number above 0, not `{text}`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_named_with_their_layer_and_time() {
        let told = |text: &str| PictureOption::parse(text).map(|given| (given.label, given.file.path.display().to_string(), given.file.layer, given.seconds));
        let picture = || "picture".to_owned();
        assert_eq!(told("a b=out/x.exr:picture,seconds=1.5"), Ok(("a b".into(), "out/x.exr".into(), Some(picture()), Some(1.5))));
        assert_eq!(told("a=x=y,z.exr:picture"), Ok(("a".into(), "x=y,z.exr".into(), Some(picture()), None)));
        assert_eq!(told("a=x.exr"), Ok(("a".into(), "x.exr".into(), None, None)));
        for text in ["x.exr", "=x.exr", "a=", "a=x.exr,seconds=0", "a=x.exr,seconds=", "a=x.exr,seconds=inf", "a=x.exr,seconds=-1"] {
            assert!(told(text).is_err(), "{text}");
        }
    }
}
