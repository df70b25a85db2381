//! What can be wrong with a scene: one code per case, a sentence, the way out, and the place in the file.

use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};
use std::{cell::OnceCell, collections::HashSet, fmt, ops::Range, path::Path, sync::Arc};

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

/// Why a scene could not be loaded: all root causes, ready to be shown by miette.
#[derive(Debug)]
pub struct SceneError {
    first: Box<Cause>,
    others: Vec<Cause>,
}

/// One root cause.
#[derive(Debug)]
struct Cause {
    problem: Problem,
    message: String,
    help: Option<String>,
    place: Option<Place>,
}

#[derive(Debug)]
struct Place {
    source: Arc<NamedSource<String>>,
    span: Range<usize>,
    label: String,
}

impl SceneError {
    pub(crate) fn new(problem: Problem, message: impl Into<String>) -> Self {
        Self { first: Box::new(Cause { problem, message: message.into(), help: None, place: None }), others: Vec::new() }
    }

    pub(crate) fn help(mut self, help: impl Into<String>) -> Self {
        self.first.help = Some(help.into());
        self
    }

    /// Names the bytes of a source text that are at fault.
    pub(crate) fn at(mut self, source: &SourceText, span: Range<usize>, label: impl Into<String>) -> Self {
        let (start, end) = (floor_boundary(source.text, span.start), floor_boundary(source.text, span.end));
        self.first.place = Some(Place { source: source.named(), span: start..end.max(start), label: label.into() });
        self
    }

    /// What kind of fault this is; of several, the first.
    pub fn problem(&self) -> Problem {
        self.first.problem
    }

    fn and(mut self, other: Self) -> Self {
        self.others.push(*other.first);
        self.others.extend(other.others);
        self
    }

    /// With those before it, if there are any.
    fn after(self, before: Option<Self>) -> Self {
        match before {
            Some(before) => before.and(self),
            None => self,
        }
    }

    /// One that stands for itself; several are related to a headline.
    fn only(&self) -> Option<&Cause> {
        self.others.is_empty().then_some(&*self.first)
    }

    fn causes(&self) -> impl Iterator<Item = &Cause> {
        std::iter::once(&*self.first).chain(&self.others)
    }
}

/// Results that are wanted together: what is wrong with any of them is told.
pub(super) trait Together {
    type Values;
    fn together(self) -> Result<Self::Values, SceneError>;
}

impl<A, B> Together for (Result<A, SceneError>, Result<B, SceneError>) {
    type Values = (A, B);
    fn together(self) -> Result<Self::Values, SceneError> {
        match self {
            (Ok(a), Ok(b)) => Ok((a, b)),
            (Err(a), Err(b)) => Err(a.and(b)),
            (Err(error), _) | (_, Err(error)) => Err(error),
        }
    }
}

impl<A, B, C> Together for (Result<A, SceneError>, Result<B, SceneError>, Result<C, SceneError>) {
    type Values = (A, B, C);
    fn together(self) -> Result<Self::Values, SceneError> {
        let ((a, b), c) = ((self.0, self.1).together(), self.2).together()?;
        Ok((a, b, c))
    }
}

impl<A, B, C, D> Together for (Result<A, SceneError>, Result<B, SceneError>, Result<C, SceneError>, Result<D, SceneError>) {
    type Values = (A, B, C, D);
    fn together(self) -> Result<Self::Values, SceneError> {
        let ((a, b, c), d) = ((self.0, self.1, self.2).together(), self.3).together()?;
        Ok((a, b, c, d))
    }
}

impl<A, B, C, D, E> Together for (Result<A, SceneError>, Result<B, SceneError>, Result<C, SceneError>, Result<D, SceneError>, Result<E, SceneError>) {
    type Values = (A, B, C, D, E);
    fn together(self) -> Result<Self::Values, SceneError> {
        let ((a, b, c, d), e) = ((self.0, self.1, self.2, self.3).together(), self.4).together()?;
        Ok((a, b, c, d, e))
    }
}

/// The same of any number of results of one kind.
pub(super) fn all<T>(results: impl IntoIterator<Item = Result<T, SceneError>>) -> Result<Vec<T>, SceneError> {
    let (mut values, mut faults) = (Vec::new(), None::<SceneError>);
    for result in results {
        match result {
            Ok(value) => values.push(value),
            Err(fault) => faults = Some(fault.after(faults)),
        }
    }
    faults.map_or(Ok(values), Err)
}

/// All that is wrong with a scene: of each place one cause, and of limits the first that is met.
#[derive(Default)]
pub(super) struct Faults {
    found: Option<SceneError>,
    places: HashSet<(String, usize)>,
    is_too_large: bool,
}

impl Faults {
    pub fn add(&mut self, error: SceneError) {
        for cause in std::iter::once(*error.first).chain(error.others) {
            if self.is_new(&cause) {
                let error = SceneError { first: Box::new(cause), others: Vec::new() };
                self.found = Some(error.after(self.found.take()));
            }
        }
    }

    /// The value of a result that is none.
    pub fn take<T>(&mut self, result: Result<T, SceneError>) -> Option<T> {
        result.map_err(|error| self.add(error)).ok()
    }

    pub fn expect_none(self) -> Result<(), SceneError> {
        self.found.map_or(Ok(()), Err)
    }

    fn is_new(&mut self, cause: &Cause) -> bool {
        match &cause.place {
            Some(place) => self.places.insert((place.source.name().to_owned(), place.span.start)),
            None if cause.problem == Problem::TooLarge => !std::mem::replace(&mut self.is_too_large, true),
            None => true,
        }
    }
}

/// A text file and what to call it in messages.
#[derive(Debug)]
pub(crate) struct SourceText<'a> {
    pub path: &'a Path,
    pub text: &'a str,
    /// What messages show of it: one for all, made for the first.
    named: OnceCell<Arc<NamedSource<String>>>,
}

impl<'a> SourceText<'a> {
    pub fn new(path: &'a Path, text: &'a str) -> Self {
        Self { path, text, named: OnceCell::new() }
    }

    fn named(&self) -> Arc<NamedSource<String>> {
        self.named.get_or_init(|| Arc::new(NamedSource::new(self.path.display().to_string(), self.text.to_owned()))).clone()
    }
}

fn floor_boundary(text: &str, at: usize) -> usize {
    (0..=at.min(text.len())).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0)
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Cause {}

impl Diagnostic for Cause {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(self.problem.code()))
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.place.as_ref().map(|place| &*place.source as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let place = self.place.as_ref()?;
        Some(Box::new(std::iter::once(LabeledSpan::new_with_span(Some(place.label.clone()), place.span.clone()))))
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.only() {
            Some(only) => only.fmt(f),
            None => write!(f, "{} errors", 1 + self.others.len()),
        }
    }
}

impl std::error::Error for SceneError {}

impl Diagnostic for SceneError {
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
        self.only().is_none().then(|| Box::new(self.causes().map(|cause| cause as &dyn Diagnostic)) as Box<dyn Iterator<Item = &dyn Diagnostic>>)
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
