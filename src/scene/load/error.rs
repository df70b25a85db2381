//! What can be wrong with a scene: one code per case, a sentence, the way out, and the place in the file.

use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};
use std::{fmt, ops::Range, path::Path};

/// The kinds of fault that loading a scene can meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Problem {
    /// A scene, or a file that it needs, is nowhere to be found.
    NotFound,
    /// A file is there but cannot be read.
    Unreadable,
    /// A file breaks the rules of its format.
    Format,
    /// A scene document or a glTF file of a version that this program does not read.
    Version,
    /// A key, variant, parameter or name that does not exist.
    UnknownKey,
    /// A material that does not exist, or that nothing uses.
    UnknownMaterial,
    /// A feature that a file requires and this program lacks.
    Unsupported,
    /// A position or value that is not a finite number.
    NonFinite,
    /// A value outside its range.
    Range,
    /// A scene with nothing in it.
    NoTriangles,
    /// More than the stated limits allow.
    TooLarge,
}

impl Problem {
    /// The stable code that scripts and tests can rely on.
    pub fn code(self) -> &'static str {
        match self {
            Self::NotFound => "scene::not_found",
            Self::Unreadable => "scene::unreadable",
            Self::Format => "scene::format",
            Self::Version => "scene::version",
            Self::UnknownKey => "scene::unknown_key",
            Self::UnknownMaterial => "scene::unknown_material",
            Self::Unsupported => "scene::unsupported",
            Self::NonFinite => "scene::non_finite",
            Self::Range => "scene::range",
            Self::NoTriangles => "scene::no_triangles",
            Self::TooLarge => "scene::too_large",
        }
    }
}

/// Why a scene could not be loaded, ready to be shown by miette.
#[derive(Debug)]
pub struct SceneError(Box<Report>);

#[derive(Debug)]
struct Report {
    problem: Problem,
    message: String,
    help: Option<String>,
    place: Option<Place>,
}

#[derive(Debug)]
struct Place {
    source: NamedSource<String>,
    span: Range<usize>,
    label: String,
}

impl SceneError {
    pub(crate) fn new(problem: Problem, message: impl Into<String>) -> Self {
        Self(Box::new(Report { problem, message: message.into(), help: None, place: None }))
    }

    pub(crate) fn help(mut self, help: impl Into<String>) -> Self {
        self.0.help = Some(help.into());
        self
    }

    /// Names the bytes of a source text that are at fault.
    pub(crate) fn at(mut self, source: &SourceText, span: Range<usize>, label: impl Into<String>) -> Self {
        let (start, end) = (floor_boundary(source.text, span.start), floor_boundary(source.text, span.end));
        let named = NamedSource::new(source.path.display().to_string(), source.text.to_owned());
        self.0.place = Some(Place { source: named, span: start..end.max(start), label: label.into() });
        self
    }

    /// What kind of fault this is.
    pub fn problem(&self) -> Problem {
        self.0.problem
    }
}

/// A text file and what to call it in messages.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SourceText<'a> {
    pub path: &'a Path,
    pub text: &'a str,
}

fn floor_boundary(text: &str, at: usize) -> usize {
    (0..=at.min(text.len())).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0)
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.message)
    }
}

impl std::error::Error for SceneError {}

impl Diagnostic for SceneError {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(self.0.problem.code()))
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.0.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.0.place.as_ref().map(|place| &place.source as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let place = self.0.place.as_ref()?;
        Some(Box::new(std::iter::once(LabeledSpan::new_with_span(Some(place.label.clone()), place.span.clone()))))
    }
}

/// "did you mean `x`?", or what there is to choose from.
pub(crate) fn suggestion<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    let likeness = |name: &str| strsim::jaro_winkler(&found.to_lowercase(), &name.to_lowercase());
    match known.iter().copied().max_by(|a, b| likeness(a).total_cmp(&likeness(b))) {
        Some(best) if likeness(best) > 0.75 => format!("did you mean `{best}`?"),
        Some(_) => format!("known here: {}", known.join(", ")),
        None => "there is none here to choose from".to_owned(),
    }
}
