//! RON with places: every value knows where it stands in which text, so that errors found later can underline it.
//!
//! `ron` decides what is RON; the parser here only cuts text that `ron` has accepted into values.

use super::diagnostics::Problem;
use miette::NamedSource;
use ron::value::RawValue;
use std::ops::Range;
use std::sync::Arc;

/// A text with the name that messages give it.
pub type Source = Arc<NamedSource<String>>;

/// A piece of a source.
#[derive(Debug, Clone)]
pub struct Place {
    pub source: Source,
    /// Bytes.
    pub span: Range<usize>,
}

/// A name or string and where it stands.
#[derive(Debug, Clone)]
pub struct Word {
    pub text: String,
    pub place: Place,
}

#[derive(Debug, Clone)]
pub struct Value {
    pub place: Place,
    pub kind: ValueKind,
}

#[derive(Debug, Clone)]
pub enum ValueKind {
    Bool(bool),
    /// As written.
    Number(String),
    Text(String),
    List(Vec<Value>),
    Map(Vec<(Value, Value)>),
    /// `Name`, `Name(…)` or `(…)`.
    Compound {
        name: Option<Word>,
        body: Body,
    },
}

#[derive(Debug, Clone)]
pub enum Body {
    /// No parentheses, or nothing between them.
    Empty,
    Named(Vec<Field>),
    Positional(Vec<Value>),
}

/// `name: value`
#[derive(Debug, Clone)]
pub struct Field {
    pub name: Word,
    pub value: Value,
}

impl Value {
    /// With its article, for messages: "a number".
    pub fn phrase(&self) -> String {
        match &self.kind {
            ValueKind::Bool(value) => format!("`{value}`"),
            ValueKind::Number(number) => format!("the number {number}"),
            ValueKind::Text(text) => format!("the string \"{text}\""),
            ValueKind::List(_) => "a list".into(),
            ValueKind::Map(_) => "a map".into(),
            ValueKind::Compound { name: None, .. } => "a group `(…)`".into(),
            ValueKind::Compound { name: Some(name), .. } => format!("`{}`", name.text),
        }
    }

    /// Its first letter: what is wrong with a whole document is shown there.
    pub fn start(&self) -> Place {
        let Range { start, end } = self.place.span;
        Place { span: start..end.min(start + 1), ..self.place.clone() }
    }

    /// As it stands in its source.
    pub fn written(&self) -> &str {
        &self.place.source.inner()[self.place.span.clone()]
    }

    /// The word of a string.
    pub fn word(&self) -> Option<Word> {
        match &self.kind {
            ValueKind::Text(text) => Some(Word { text: text.clone(), place: self.place.clone() }),
            _ => None,
        }
    }
}

/// Makes a source of a file's text.
pub fn source(name: &str, text: impl Into<String>) -> Source {
    Arc::new(NamedSource::new(name, text.into()))
}

/// Reads the RON value that `span` of the source holds.
pub fn parse(source: &Source, span: Range<usize>) -> Result<Value, Problem> {
    let text = &source.inner()[span.clone()];
    if let Err(error) = ron::from_str::<Box<RawValue>>(text) {
        let at = span.start + offset(text, error.span.start.line, error.span.start.col);
        let end = span.start + offset(text, error.span.end.line, error.span.end.col);
        let place = Place { source: source.clone(), span: at..end.max(at) };
        let message = match error.code {
            ron::Error::ExceededRecursionLimit => "this is nested too deeply".into(),
            code => format!("this is not RON: {code}"),
        };
        return Err(Problem::new("document::syntax", message).at(&place, "here"));
    }
    let mut parser = Parser { source, at: span.start, end: span.end };
    let value = parser.value()?;
    parser.skip_space();
    // ron has accepted the whole: what is left is a kind of value that is cut differently, such as b"bytes".
    if parser.rest().is_empty() { Ok(value) } else { parser.refuse() }
}

/// Byte offset of a line and column that count characters from 1.
fn offset(text: &str, line: usize, column: usize) -> usize {
    let start = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum::<usize>();
    let rest = &text[start.min(text.len())..];
    start + rest.char_indices().nth(column.saturating_sub(1)).map_or(rest.len(), |(at, _)| at)
}

struct Parser<'s> {
    source: &'s Source,
    at: usize,
    end: usize,
}

impl<'s> Parser<'s> {
    fn rest(&self) -> &'s str {
        &self.source.inner()[self.at..self.end]
    }

    fn place(&self, start: usize) -> Place {
        Place { source: self.source.clone(), span: start..self.at }
    }

    /// What RON allows and pipelines do not use: characters, byte strings, extensions.
    fn refuse<T>(&self) -> Result<T, Problem> {
        let length = self.rest().chars().next().map_or(0, char::len_utf8);
        let place = Place { source: self.source.clone(), span: self.at..self.at + length };
        Err(Problem::new("document::syntax", "pipelines have no such value").at(&place, "here").help("values are names, numbers, strings, lists and maps"))
    }

    fn skip_space(&mut self) {
        loop {
            let rest = self.rest();
            let trimmed = rest.trim_start();
            self.at += rest.len() - trimmed.len();
            let comment = if trimmed.starts_with("//") {
                trimmed.find('\n').unwrap_or(trimmed.len())
            } else if trimmed.starts_with("/*") {
                block_comment(trimmed)
            } else {
                return;
            };
            self.at += comment;
        }
    }

    /// Skips space and takes the character if it comes next.
    fn take(&mut self, wanted: char) -> bool {
        self.skip_space();
        let found = self.rest().starts_with(wanted);
        if found {
            self.at += wanted.len_utf8();
        }
        found
    }

    fn value(&mut self) -> Result<Value, Problem> {
        self.skip_space();
        let start = self.at;
        let kind = match self.rest().chars().next() {
            Some('[') => ValueKind::List(self.sequence('[', ']', Self::value)?),
            Some('{') => ValueKind::Map(self.sequence('{', '}', Self::entry)?),
            Some('(') => ValueKind::Compound { name: None, body: self.body()? },
            Some('"') => ValueKind::Text(self.string(0)?),
            Some('r') if self.raw_hashes().is_some() => ValueKind::Text(self.string(self.raw_hashes().unwrap_or(0))?),
            Some(c) if c.is_ascii_digit() || "+-.".contains(c) => ValueKind::Number(self.number()),
            Some(c) if c.is_alphabetic() || c == '_' => self.named()?,
            _ => return self.refuse(),
        };
        Ok(Value { place: self.place(start), kind })
    }

    fn sequence<T>(&mut self, open: char, close: char, item: fn(&mut Self) -> Result<T, Problem>) -> Result<Vec<T>, Problem> {
        let mut items = Vec::new();
        self.take(open);
        while !self.take(close) {
            items.push(item(self)?);
            // ron has seen to it that only the last comma can be missing.
            if !self.take(',') && !self.peek(close) {
                return self.refuse();
            }
        }
        Ok(items)
    }

    fn peek(&mut self, wanted: char) -> bool {
        self.skip_space();
        self.rest().starts_with(wanted)
    }

    fn entry(&mut self) -> Result<(Value, Value), Problem> {
        let key = self.value()?;
        if !self.take(':') {
            return self.refuse();
        }
        Ok((key, self.value()?))
    }

    fn field(&mut self) -> Result<Field, Problem> {
        let Some(name) = self.identifier() else { return self.refuse() };
        if !self.take(':') {
            return self.refuse();
        }
        Ok(Field { name, value: self.value()? })
    }

    /// What stands between parentheses, with them.
    fn body(&mut self) -> Result<Body, Problem> {
        let start = self.at;
        self.take('(');
        if self.take(')') {
            return Ok(Body::Empty);
        }
        let is_named = self.identifier().is_some() && self.peek(':') && !self.rest().starts_with("::");
        self.at = start;
        if is_named { self.sequence('(', ')', Self::field).map(Body::Named) } else { self.sequence('(', ')', Self::value).map(Body::Positional) }
    }

    fn named(&mut self) -> Result<ValueKind, Problem> {
        let Some(name) = self.identifier() else { return self.refuse() };
        match name.text.as_str() {
            "true" => return Ok(ValueKind::Bool(true)),
            "false" => return Ok(ValueKind::Bool(false)),
            "inf" | "NaN" => return Ok(ValueKind::Number(name.text)),
            _ => {}
        }
        let after_name = self.at;
        let body = if self.peek('(') {
            self.body()?
        } else {
            self.at = after_name;
            Body::Empty
        };
        Ok(ValueKind::Compound { name: Some(name), body })
    }

    fn identifier(&mut self) -> Option<Word> {
        self.skip_space();
        let start = self.at;
        let rest = self.rest();
        let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
        self.at += end;
        let text = rest[..end].to_owned();
        (!text.is_empty() && !text.starts_with(|c: char| c.is_ascii_digit())).then(|| Word { text, place: self.place(start) })
    }

    fn number(&mut self) -> String {
        let rest = self.rest();
        let is_part =
            |(at, c): (usize, char)| c.is_ascii_alphanumeric() || "._".contains(c) || ("+-".contains(c) && (at == 0 || rest[..at].ends_with(['e', 'E'])));
        let end = rest.char_indices().find(|part| !is_part(*part)).map_or(rest.len(), |(at, _)| at);
        self.at += end;
        rest[..end].to_owned()
    }

    /// Number of `#` before the quote of a raw string.
    fn raw_hashes(&self) -> Option<usize> {
        let after = self.rest().strip_prefix('r')?;
        let hashes = after.len() - after.trim_start_matches('#').len();
        after[hashes..].starts_with('"').then_some(hashes)
    }

    /// A string, raw if it begins with an r; `ron` resolves the escapes.
    fn string(&mut self, hashes: usize) -> Result<String, Problem> {
        let rest = self.rest();
        let length = if rest.starts_with('r') { raw_string(rest, hashes) } else { quoted_string(rest) };
        match ron::from_str::<String>(&rest[..length]) {
            Ok(text) => {
                self.at += length;
                Ok(text)
            }
            Err(_) => self.refuse(),
        }
    }
}

/// Length of the block comment, others nested inside it, that the text begins with.
fn block_comment(text: &str) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < text.len() {
        let rest = &text[at..];
        if rest.starts_with("/*") {
            depth += 1;
            at += 2;
        } else if rest.starts_with("*/") {
            depth -= 1;
            at += 2;
        } else {
            at += rest.chars().next().map_or(1, char::len_utf8);
        }
        if depth == 0 {
            return at;
        }
    }
    text.len()
}

fn raw_string(text: &str, hashes: usize) -> usize {
    let close = format!("\"{}", "#".repeat(hashes));
    let inside = hashes + 2;
    text[inside..].find(&close).map_or(text.len(), |at| inside + at + close.len())
}

fn quoted_string(text: &str) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => return at + 1,
            _ => {}
        }
    }
    text.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Value, Problem> {
        parse(&source("test.ron", text), 0..text.len())
    }

    #[test]
    fn values_know_their_places() {
        let text = "/* a /* nested */ comment */ Pipeline(list: [1, -2.5e-3, \"é\\n\",], map: { \"a\": r#\"raw \" text\"# }, // end\n flag: true)";
        let value = read(text).unwrap();
        let ValueKind::Compound { name: Some(name), body: Body::Named(fields) } = value.kind else { panic!() };
        assert_eq!(name.text, "Pipeline");
        let spans: Vec<_> = fields.iter().map(|f| &text[f.value.place.span.clone()]).collect();
        assert_eq!(spans, ["[1, -2.5e-3, \"é\\n\",]", "{ \"a\": r#\"raw \" text\"# }", "true"]);
        let ValueKind::List(items) = &fields[0].value.kind else { panic!() };
        assert!(matches!(&items[2].kind, ValueKind::Text(text) if text == "é\n"));
    }

    #[test]
    fn what_is_not_ron_is_refused() {
        for text in ["", "(", "Pipeline(a: )", "[1 2]", "\"open", "a b", "(a: 1))"] {
            assert_eq!(read(text).unwrap_err().code, "document::syntax", "{text}");
        }
    }

    #[test]
    fn what_pipelines_do_not_use_is_refused() {
        for text in ["'c'", "b\"bytes\"", "#![enable(implicit_some)] 1"] {
            assert_eq!(read(text).unwrap_err().code, "document::syntax", "{text}");
        }
    }
}
