//! A parameter of a node and the value that it is given from outside of the pipeline's own file.

use super::diagnostics::Problem;
use super::syntax::{self, Place, Value, Word};
use std::fmt;

/// `NODE.PARAM=VALUE`, and where each is written.
#[derive(Debug, Clone)]
pub struct Set {
    pub key: Word,
    pub value: Value,
}

impl Set {
    /// Reads what stands behind `option`; whether node, parameter and value are right is for [`super::load`] to tell.
    ///
    /// # Errors
    /// Where there is no `=`, or what follows is not RON.
    pub fn parse(option: &str, text: &str) -> Result<Self, Problem> {
        let source = syntax::source(option, text);
        let place = |span| Place { source: source.clone(), span };
        let equals = text.find('=').ok_or_else(|| {
            let problem = Problem::new("document::syntax", format!("`{option} {text}` sets nothing"));
            problem.at(&place(0..text.len()), "no `=`").help(format!("write {option} NODE.PARAMETER=VALUE"))
        })?;
        let key = Word { text: text[..equals].trim().into(), place: place(0..equals) };
        Ok(Self { key, value: syntax::parse(&source, equals + 1..text.len())? })
    }
}

impl fmt::Display for Set {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.key.text, self.value.written())
    }
}
