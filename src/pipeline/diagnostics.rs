//! What is wrong with a pipeline, shown as compilers do: a code, the place underlined, what would be accepted.

use super::syntax::{Place, Source};
use miette::{Diagnostic, LabeledSpan, SourceCode};
use std::fmt;

/// One root cause.
#[derive(Debug, Clone)]
pub struct Problem {
    /// `pipeline::…` for the document alone, `plan::…` for the document with a scene; stable.
    pub code: &'static str,
    /// What is wrong, one sentence.
    pub message: String,
    /// What to do about it.
    pub help: Option<String>,
    source: Option<Source>,
    labels: Vec<LabeledSpan>,
}

/// Everything that is wrong, never empty.
#[derive(Debug, Clone)]
pub struct Problems(pub Vec<Problem>);

impl Problem {
    /// With a code and a message.
    pub fn new(code: &'static str, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), help: None, source: None, labels: Vec::new() }
    }

    /// Underlines a place; of several, only those in the source of the first can be shown.
    pub fn at(mut self, place: &Place, label: impl Into<String>) -> Self {
        let source = self.source.get_or_insert_with(|| place.source.clone());
        if std::sync::Arc::ptr_eq(source, &place.source) {
            let length = place.span.len();
            self.labels.push(LabeledSpan::new(Some(label.into()), place.span.start, length));
        }
        self
    }

    /// Underlines this place where no other is known.
    pub fn or_at(self, place: &Place, label: &str) -> Self {
        if self.source.is_none() { self.at(place, label) } else { self }
    }

    /// With what to do about it.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Whether the other says the same of the same place.
    pub fn same(&self, other: &Self) -> bool {
        let name = |problem: &Self| problem.source.as_ref().map(|source| source.name().to_owned());
        self.message == other.message && self.labels == other.labels && name(self) == name(other)
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Problem {}

impl Diagnostic for Problem {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(self.code))
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.source.as_ref().map(|source| &**source as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        (!self.labels.is_empty()).then(|| Box::new(self.labels.iter().cloned()) as Box<dyn Iterator<Item = LabeledSpan>>)
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.as_slice() {
            [only] => only.fmt(f),
            several => write!(f, "{} errors", several.len()),
        }
    }
}

impl std::error::Error for Problems {}

/// A single problem stands for itself; several are related to a headline.
impl Diagnostic for Problems {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.only()?.code()
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Diagnostic::help(self.only()?)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.only()?.source_code()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.only()?.labels()
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        self.only().is_none().then(|| Box::new(self.0.iter().map(|p| p as &dyn Diagnostic)) as Box<dyn Iterator<Item = &dyn Diagnostic>>)
    }
}

impl Problems {
    fn only(&self) -> Option<&Problem> {
        match self.0.as_slice() {
            [only] => Some(only),
            _ => None,
        }
    }
}

/// The nearest of the known names first, if one is near, then all of them: the help of an unknown name.
pub fn known<'a>(unknown: &str, names: impl IntoIterator<Item = &'a str>, what: &str) -> String {
    let names: Vec<&str> = names.into_iter().collect();
    let distance = |name: &str| strsim::damerau_levenshtein(&unknown.to_lowercase(), &name.to_lowercase());
    let nearest = names.iter().map(|name| (distance(name), *name)).min().filter(|(distance, name)| *distance <= (name.len() / 3).max(1));
    match (nearest, names.is_empty()) {
        (Some((_, name)), _) => format!("did you mean `{name}`?"),
        (None, true) => format!("{what}: none"),
        (None, false) => format!("{what}: {}", names.join(", ")),
    }
}
