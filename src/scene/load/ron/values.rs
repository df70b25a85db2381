//! Values of scene documents: numbers in their ranges, colours, vectors. What is wrong with one underlines it.

use super::document::{Keys, NormalsChoice, Raw, Triple};
use crate::math::curve::{Between, Components, Curve};
use crate::scene::load::{
    Normals,
    error::{Problem, SceneError, SourceText, Together, all, suggestion},
};
use crate::scene::model::{MAX_SIDE, Rgb};
use ::ron::{Options, error::SpannedError, extensions::Extensions};
use glam::DVec3;
use serde::Deserialize;
use std::ops::{Range, RangeInclusive};

/// The document's text, and how to read values out of it.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    pub text: &'a SourceText<'a>,
}

impl<'a> Source<'a> {
    pub fn parse<T: Deserialize<'a>>(&self, part: &'a str) -> Result<T, SceneError> {
        Options::default().with_default_extension(Extensions::IMPLICIT_SOME).from_str(part).map_err(|error| self.syntax_error(part, error))
    }

    pub fn get<T: Deserialize<'a>>(&self, raw: Raw<'a, T>) -> Result<T, SceneError> {
        self.parse(raw.text)
    }

    /// Where a slice of the text lies in it.
    pub fn span(&self, part: &str) -> Range<usize> {
        let start = (part.as_ptr() as usize).saturating_sub(self.text.text.as_ptr() as usize);
        start..start + part.len()
    }

    pub fn error<T>(&self, problem: Problem, place: Raw<'a, T>, message: impl Into<String>, label: impl Into<String>) -> SceneError {
        SceneError::new(problem, message).at(self.text, self.span(place.text), label)
    }

    fn syntax_error(&self, part: &str, error: SpannedError) -> SceneError {
        let start = self.span(part).start;
        let (from, to) = (start + offset(part, error.span.start), start + offset(part, error.span.end));
        let place = trim_span(self.text.text, from..to.max(from));
        use ::ron::Error::*;
        let (problem, message, label, help) = match &error.code {
            NoSuchStructField { expected, found, outer } => {
                let of = outer.as_ref().map_or(String::new(), |outer| format!(" of `{outer}`"));
                (Problem::UnknownKey, format!("`{found}` is no key{of}"), "unknown key", suggestion(found, expected.iter().copied()))
            }
            NoSuchEnumVariant { expected, found, .. } => {
                (Problem::UnknownKey, format!("`{found}` is not known here"), "unknown", suggestion(found, expected.iter().copied()))
            }
            MissingStructField { field, outer } => {
                let of = outer.as_ref().map_or(String::new(), |outer| format!(" in `{outer}`"));
                (Problem::Format, format!("the key `{field}` is missing{of}"), "it has to stand before this", format!("add `{field}: …`"))
            }
            ExceededRecursionLimit => (Problem::Format, "the document is nested too deeply".to_owned(), "here", "place geometry in fewer steps".to_owned()),
            other => (Problem::Format, format!("the document cannot be read: {other}"), "here", "see the scenes that ship for examples".to_owned()),
        };
        SceneError::new(problem, message).help(help).at(self.text, place, label)
    }

    /// A number that single precision holds.
    pub fn number(&self, raw: Raw<'a, f64>) -> Result<f64, SceneError> {
        let value = self.get(raw)?;
        self.expect_finite(raw, [value])?;
        Ok(value)
    }

    pub fn vector(&self, raw: Raw<'a, Triple>) -> Result<DVec3, SceneError> {
        let value = self.get(raw)?;
        self.expect_finite(raw, value)?;
        Ok(value.into())
    }

    fn expect_finite<T, const N: usize>(&self, raw: Raw<'a, T>, values: [f64; N]) -> Result<(), SceneError> {
        if values.iter().all(|&value| (value as f32).is_finite()) {
            return Ok(());
        }
        Err(self.error(Problem::NonFinite, raw, "a value is no finite number in single precision", "not finite").help("use numbers between -3.4e38 and 3.4e38"))
    }

    /// What a value is at all times: what `read` makes of it, or of each of its keys.
    pub fn curve<T, V: Components>(&self, raw: Raw<'a, T>, read: impl Fn(Raw<'a, T>) -> Result<V, SceneError>) -> Result<Curve<V>, SceneError> {
        if !(raw.text.starts_with(char::is_alphabetic) && raw.text.contains('(')) {
            return read(raw).map(Curve::constant);
        }
        let (kind, keys) = match self.parse(raw.text)? {
            Keys::Step(keys) => (Kind::Step, keys),
            Keys::Linear(keys) => (Kind::Linear, keys),
            Keys::Smooth(keys) => (Kind::Smooth, keys),
        };
        if keys.is_empty() {
            return Err(self
                .error(Problem::Format, raw, "there is no key", "needs one at least")
                .help("write a time in seconds and a value: Linear([(0, VALUE), (2.5, VALUE)])"));
        }
        let times = all(keys.iter().map(|(time, _)| self.number(*time)));
        let (times, values) = (times, all(keys.iter().map(|(_, value)| read(*value)))).together()?;
        if let Some(late) = (1..times.len()).find(|&key| times[key] <= times[key - 1]) {
            return Err(self.out_of_range(keys[late].0, "later than the key before it"));
        }
        let between = match kind {
            Kind::Step => Between::Step,
            Kind::Linear => Between::Linear,
            Kind::Smooth => Between::smooth(&times, &values),
        };
        Curve::new(times, values, between).ok_or_else(|| self.error(Problem::Format, raw, "these keys make no curve", "here"))
    }

    /// A number in a range; `range` says it in words.
    pub fn number_in(&self, raw: Raw<'a, f64>, range: &str, holds: impl Fn(f64) -> bool) -> Result<f64, SceneError> {
        let value = self.number(raw)?;
        if holds(value) { Ok(value) } else { Err(self.out_of_range(raw, range)) }
    }

    pub fn count_in(&self, raw: Raw<'a, u32>, range: RangeInclusive<u32>) -> Result<u32, SceneError> {
        let value = self.get(raw)?;
        if range.contains(&value) { Ok(value) } else { Err(self.out_of_range(raw, &format!("{} to {}", range.start(), range.end()))) }
    }

    pub fn out_of_range<T>(&self, raw: Raw<'a, T>, range: &str) -> SceneError {
        self.error(Problem::Range, raw, format!("{} is out of range", raw.text), format!("has to be {range}")).help(format!("the range is {range}"))
    }

    fn colour(&self, raw: Raw<'a, Triple>, most: f64, range: &str) -> Result<Rgb, SceneError> {
        let value = self.vector(raw)?;
        if value.to_array().iter().all(|channel| (0.0..=most).contains(channel)) { Ok(value.as_vec3()) } else { Err(self.out_of_range(raw, range)) }
    }

    pub fn reflectance(&self, raw: Raw<'a, Triple>) -> Result<Rgb, SceneError> {
        self.colour(raw, 1.0, "0 to 1 in each channel")
    }

    pub fn radiance(&self, raw: Raw<'a, Triple>) -> Result<Rgb, SceneError> {
        self.colour(raw, f64::from(f32::MAX), "0 or more in each channel")
    }

    /// A vector with a direction, as a unit vector.
    pub fn unit(&self, raw: Raw<'a, Triple>) -> Result<DVec3, SceneError> {
        self.vector(raw)?.try_normalize().ok_or_else(|| self.out_of_range(raw, "a vector with a length"))
    }

    pub fn normals(&self, raw: Raw<'a, NormalsChoice<'a>>) -> Result<Normals, SceneError> {
        Ok(match self.get(raw)? {
            NormalsChoice::File => Normals::File,
            NormalsChoice::Face => Normals::Face,
            NormalsChoice::Smooth { degrees } => Normals::Smooth(self.number_in(degrees, "0 to 180 degrees", |d| (0.0..=180.0).contains(&d))?.to_radians()),
        })
    }

    pub fn picture_size(&self, raw: Raw<'a, [u32; 2]>) -> Result<[u32; 2], SceneError> {
        let size = self.get(raw)?;
        let holds = size.iter().all(|side| (1..=MAX_SIDE).contains(side));
        if holds { Ok(size) } else { Err(self.out_of_range(raw, &format!("1 to {MAX_SIDE} pixels a side"))) }
    }
}

/// How keys are joined.
enum Kind {
    Step,
    Linear,
    Smooth,
}

/// Byte offset of a line and column, both from 1, columns in characters.
fn offset(text: &str, position: ::ron::error::Position) -> usize {
    let line_start = text.split_inclusive('\n').take(position.line.saturating_sub(1)).map(str::len).sum::<usize>();
    let line = text.get(line_start..).unwrap_or_default();
    line_start + line.char_indices().nth(position.col.saturating_sub(1)).map_or(line.len(), |(at, _)| at)
}

/// A span without the blanks at its ends.
fn trim_span(text: &str, span: Range<usize>) -> Range<usize> {
    let Some(part) = text.get(span.clone()) else { return span };
    let start = span.start + part.len() - part.trim_start().len();
    start..(start + part.trim().len())
}
