//! Text as a terminal can hold it: no control characters, of many causes a few, and no lines of source that are too wide to underline
//! anything in.

use miette::{Diagnostic, LabeledSpan, NamedSource, Severity, SourceCode, SourceSpan};
use std::borrow::Cow;
use std::fmt;

/// Columns of the widest line of source that is shown.
const WIDEST: usize = 1000;

/// How many of the causes are shown.
const CAUSES: usize = 20;

/// The text with what a terminal might obey, or that would turn the order of letters round, spelled out: names in files may hold anything.
pub fn clean(text: &str) -> Cow<'_, str> {
    if !text.contains(is_obeyed) {
        return Cow::Borrowed(text);
    }
    Cow::Owned(text.chars().map(|letter| if is_obeyed(letter) { letter.escape_default().to_string() } else { letter.to_string() }).collect())
}

/// Whether a terminal does something else with a letter than to show it. Ends of lines and tabs are meant.
fn is_obeyed(letter: char) -> bool {
    letter.is_control() && !matches!(letter, '\n' | '\t') || matches!(letter, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// A source that holds what a terminal might obey, with as long a replacement for it; None where there is no need.
fn clean_source(source: &dyn SourceCode) -> Option<NamedSource<String>> {
    let whole = source.read_span(&SourceSpan::from((0, 0)), 0, usize::MAX).ok()?;
    let text = std::str::from_utf8(whole.data()).ok()?.replace("\r\n", " \n");
    let name = clean(whole.name().unwrap_or_default());
    if !text.contains(is_obeyed) && matches!(name, Cow::Borrowed(_)) {
        return None;
    }
    let replaced = |letter: char| match letter {
        letter if !is_obeyed(letter) => letter,
        '\r' => '\n',
        letter => ['?', '¿', char::REPLACEMENT_CHARACTER][letter.len_utf8() - 1],
    };
    Some(NamedSource::new(name, text.chars().map(replaced).collect::<String>()))
}

/// One of the errors behind an error.
#[derive(Debug)]
struct Cause {
    text: String,
    next: Option<Box<Cause>>,
}

impl Cause {
    fn of(error: Option<&dyn std::error::Error>) -> Option<Box<Self>> {
        error.map(|error| Box::new(Self { text: clean(&error.to_string()).into_owned(), next: Self::of(error.source()) }))
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl std::error::Error for Cause {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.next.as_deref().map(|next| next as &dyn std::error::Error)
    }
}

/// A diagnostic that shows its source where it can be read, and names the place where it cannot.
pub struct Legible<'d> {
    inner: &'d dyn Diagnostic,
    /// Where the source is too wide to be shown.
    place: Option<String>,
    /// The source, where it cannot be shown as it is.
    source: Option<NamedSource<String>>,
    cause: Option<Box<Cause>>,
    causes: Vec<Legible<'d>>,
    more: usize,
    severity: Option<Severity>,
}

impl<'d> Legible<'d> {
    pub fn new(inner: &'d dyn Diagnostic) -> Self {
        let mut all = inner.related().into_iter().flatten();
        let causes = all.by_ref().take(CAUSES).map(Self::new).collect();
        let place = place_of_wide_source(inner);
        let source = inner.source_code().filter(|_| place.is_none()).and_then(clean_source);
        Self { inner, place, source, cause: Cause::of(inner.source()), causes, more: all.count(), severity: inner.severity() }
    }

    /// The same as something that the user should know, and that ends nothing.
    pub fn into_warning(self) -> Self {
        Self { severity: Some(Severity::Warning), ..self }
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
        self.place.iter().try_for_each(|place| write!(f, "{}: ", clean(place)))?;
        f.write_str(&clean(&self.inner.to_string()))?;
        if self.more > 0 { write!(f, ", of which the first {} are shown", self.causes.len()) } else { Ok(()) }
    }
}

impl std::error::Error for Legible<'_> {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.cause.as_deref().map(|cause| cause as &dyn std::error::Error)
    }
}

impl Diagnostic for Legible<'_> {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.inner.code()
    }

    fn severity(&self) -> Option<Severity> {
        self.severity
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.inner.help().map(|help| Box::new(clean(&help.to_string()).into_owned()) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        let own = self.source.as_ref().map(|source| source as &dyn SourceCode);
        own.or_else(|| self.inner.source_code().filter(|_| self.place.is_none()))
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let labels = self.inner.labels().filter(|_| self.place.is_none())?;
        Some(Box::new(labels.map(|mut label| {
            label.set_label(label.label().map(|text| clean(text).into_owned()));
            label
        })))
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        (!self.causes.is_empty()).then(|| Box::new(self.causes.iter().map(|cause| cause as &dyn Diagnostic)) as Box<dyn Iterator<Item = &dyn Diagnostic>>)
    }
}
