//! A parameter and the values that it takes in turn: `NODE.PARAM=VALUE,VALUE,…`.

use super::diagnostics::{Problem, Problems};
use super::syntax::{self, ValueKind};

/// What an option says of a parameter that takes several values.
#[derive(Debug, Clone, PartialEq)]
pub struct Values {
    /// `node.parameter`
    pub parameter: String,
    /// As written, cut at the commas that stand in no parentheses; never empty.
    pub values: Vec<String>,
}

impl Values {
    /// Reads what stands behind `option`; whether node, parameter and values are right is for [`super::load`] to tell.
    ///
    /// # Errors
    /// Where no `=` or no value stands, or what follows is not RON.
    pub fn parse(option: &str, text: &str) -> Result<Self, Problems> {
        let nothing = || {
            let problem = Problem::new("document::syntax", format!("`{option} {text}` sets nothing"));
            Problems(vec![problem.help(format!("write {option} NODE.PARAMETER=VALUE,VALUE,…"))])
        };
        let (parameter, values) = text.split_once('=').ok_or_else(nothing)?;
        let source = syntax::source(option, format!("[{values}]"));
        let list = syntax::parse(&source, 0..source.inner().len()).map_err(|problem| Problems(vec![problem]))?;
        match list.kind {
            ValueKind::List(items) if !items.is_empty() => {
                let values = items.iter().map(|item| source.inner()[item.place.span.clone()].to_owned()).collect();
                Ok(Self { parameter: parameter.trim().into(), values })
            }
            _ => Err(nothing()),
        }
    }

    /// `NODE.PARAM=VALUE` with one of the values, or the last.
    pub fn set(&self, index: usize) -> String {
        format!("{}={}", self.parameter, self.values[index.min(self.values.len() - 1)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn values_are_cut_at_their_commas_only_and_the_last_one_lasts() {
        let values = Values::parse("--over", "tiles.shape=Plane(fov: 90, x: [1, 2]) , Cosine,").unwrap();
        assert_eq!([0, 1, 2].map(|index| values.set(index)), ["tiles.shape=Plane(fov: 90, x: [1, 2])", "tiles.shape=Cosine", "tiles.shape=Cosine"]);
    }

    #[test]
    fn what_sets_nothing_is_refused() {
        for text in ["cache.accuracy", "cache.accuracy=", "cache.accuracy=,", "cache.accuracy=1,,2", "cache.accuracy=0.3 0.2", "cache.accuracy=1],[2"] {
            assert_eq!(Values::parse("--over", text).unwrap_err().0[0].code, "document::syntax", "{text}");
        }
    }

    /// A value as RON has it, with commas inside.
    fn value() -> impl Strategy<Value = String> {
        let plain = prop_oneof![
            any::<i32>().prop_map(|number| number.to_string()),
            (-1e6..1e6).prop_map(|number: f64| format!("{number:?}")),
            "[A-Z][a-z]{0,6}",
            "\"[a-z,()= ]{0,6}\"",
            Just("true".to_owned()),
        ];
        plain.prop_recursive(3, 12, 3, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 1..4).prop_map(|values| format!("[{}]", values.join(", "))),
                ("[A-Z][a-z]{0,6}", inner.clone(), inner).prop_map(|(name, a, b)| format!("{name}(a: {a}, b: {b})")),
            ]
        })
    }

    proptest! {
        #[test]
        fn whatever_is_joined_by_commas_is_cut_there(values in prop::collection::vec(value(), 1..6), gap in "[ ]{0,2}") {
            let text = format!("node.parameter={}", values.join(&format!("{gap},{gap}")));
            prop_assert_eq!(Values::parse("--over", &text).unwrap(), Values { parameter: "node.parameter".into(), values });
        }
    }
}
