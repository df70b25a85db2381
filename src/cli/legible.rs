//! A report as a terminal can hold it: a few of many causes, and no lines of source that are too wide to underline anything in.

use miette::{Diagnostic, LabeledSpan, SourceCode};
use std::fmt;

/// Columns of the widest line of source that is shown.
const WIDEST: usize = 1000;

/// How many of the causes are shown.
const CAUSES: usize = 20;

/// A diagnostic that shows its source where it can be read, and names the place where it cannot.
pub struct Legible<'d> {
    inner: &'d dyn Diagnostic,
    /// Where the source is too wide to be shown.
    place: Option<String>,
    causes: Vec<Legible<'d>>,
    more: usize,
}

impl<'d> Legible<'d> {
    pub fn new(inner: &'d dyn Diagnostic) -> Self {
        let mut all = inner.related().into_iter().flatten();
        let causes = all.by_ref().take(CAUSES).map(Self::new).collect();
        Self { inner, place: place_of_wide_source(inner), causes, more: all.count() }
    }
}

/// The place of the first label, if a line around it is too wide.
fn place_of_wide_source(diagnostic: &dyn Diagnostic) -> Option<String> {
    let (source, label) = (diagnostic.source_code()?, diagnostic.labels()?.next()?);
    let lines = source.read_span(label.inner(), 1, 1).ok()?;
    let is_wide = lines.data().split(|byte| *byte == b'\n').any(|line| line.len() > WIDEST);
    let at = source.read_span(label.inner(), 0, 0).ok()?;
    is_wide.then(|| format!("{}:{}:{}", at.name().unwrap_or("the source"), at.line() + 1, at.column() + 1))
}

impl fmt::Debug for Legible<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.inner, f)
    }
}

impl fmt::Display for Legible<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.place.iter().try_for_each(|place| write!(f, "{place}: "))?;
        fmt::Display::fmt(self.inner, f)?;
        if self.more > 0 { write!(f, ", of which the first {} are shown", self.causes.len()) } else { Ok(()) }
    }
}

impl std::error::Error for Legible<'_> {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.inner.source()
    }
}

impl Diagnostic for Legible<'_> {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.inner.code()
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.inner.help()
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.inner.source_code().filter(|_| self.place.is_none())
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.inner.labels().filter(|_| self.place.is_none())
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        (!self.causes.is_empty()).then(|| Box::new(self.causes.iter().map(|cause| cause as &dyn Diagnostic)) as Box<dyn Iterator<Item = &dyn Diagnostic>>)
    }
}
