//! Parameters that change between frames: `NODE.PARAM=VALUE,VALUE,…`.

use super::diagnostics::{Problem, Problems};
use super::syntax::{self, ValueKind};

/// A parameter with a value for each of the first frames.
#[derive(Debug, Clone, PartialEq)]
pub struct PerFrame {
    /// `node.parameter`
    key: String,
    /// As written, never empty.
    values: Vec<String>,
}

impl PerFrame {
    /// Reads `NODE.PARAM=VALUE,VALUE,…`; whether node, parameter and values are right is for [`super::load`] to tell.
    ///
    /// # Errors
    /// Where no `=` or no value stands, or what follows is not RON.
    pub fn parse(text: &str) -> Result<Self, Problems> {
        let nothing = || {
            let problem = Problem::new("pipeline::syntax", format!("`--set-frames {text}` sets nothing"));
            Problems(vec![problem.help("write --set-frames NODE.PARAMETER=VALUE,VALUE,…")])
        };
        let (key, values) = text.split_once('=').ok_or_else(nothing)?;
        let source = syntax::source("--set-frames", format!("[{values}]"));
        let list = syntax::parse(&source, 0..source.inner().len()).map_err(|problem| Problems(vec![problem]))?;
        match list.kind {
            ValueKind::List(items) if !items.is_empty() => {
                Ok(Self { key: key.trim().into(), values: items.iter().map(|item| source.inner()[item.place.span.clone()].to_owned()).collect() })
            }
            _ => Err(nothing()),
        }
    }

    /// How many frames have a value of their own.
    pub fn frames(&self) -> usize {
        self.values.len()
    }

    /// `NODE.PARAM=VALUE` for a frame: its own value, or the last.
    pub fn set(&self, frame: u32) -> String {
        format!("{}={}", self.key, self.values[(frame as usize).min(self.values.len() - 1)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_cut_at_their_commas_only_and_the_last_one_lasts() {
        let per_frame = PerFrame::parse("tiles.shape=Plane(fov: 90, x: [1, 2]) , Cosine,").unwrap();
        assert_eq!([0, 1, 2].map(|frame| per_frame.set(frame)), ["tiles.shape=Plane(fov: 90, x: [1, 2])", "tiles.shape=Cosine", "tiles.shape=Cosine"]);
    }

    #[test]
    fn what_sets_nothing_is_refused() {
        for text in ["cache.accuracy", "cache.accuracy=", "cache.accuracy=,", "cache.accuracy=0.3 0.2", "cache.accuracy=1],[2"] {
            assert_eq!(PerFrame::parse(text).unwrap_err().0[0].code, "pipeline::syntax", "{text}");
        }
    }
}
