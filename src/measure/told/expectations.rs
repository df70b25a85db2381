//! What a study expected, as the rows of a table, and what of it did not come.

use super::comparison::significant;
use crate::measure::expectation::{Claim, Found, Verdict};

/// A row for each expectation below that of the names, with what the source says and who was closer.
pub fn rows(found: &[Found]) -> Vec<Vec<String>> {
    let head = ["what", "measured", "expected", "", "the source says", "verdict"].map(str::to_owned).to_vec();
    let row = |found: &Found| {
        let told = |value: f64| told(found, value);
        let measured = match (found.value, found.interval) {
            (None, _) => "-".to_owned(),
            (Some(value), None) => told(value),
            (Some(value), Some([low, high])) => format!("{} ({} … {})", told(value), told(low), told(high)),
        };
        let came = found.as_expected.map_or("not measured", |came| if came { "yes" } else { "NO" });
        let [low, high] = found.within.map(told);
        vec![
            what(found),
            measured,
            format!("{low} … {high}"),
            came.to_owned(),
            found.paper.map_or("-".to_owned(), |claim| claimed(found, claim)),
            found.verdict.map_or("-", Verdict::words).to_owned(),
        ]
    };
    std::iter::once(head).chain(found.iter().map(row)).collect()
}

/// What did not come, a sentence each.
pub fn missed(found: &[Found]) -> Vec<String> {
    let sentence = |found: &Found| {
        let [low, high] = found.within.map(|end| told(found, end));
        format!("{} is {}, not {low} … {high}", what(found), found.value.map_or("-".to_owned(), |value| told(found, value)))
    };
    found.iter().filter(|found| found.as_expected == Some(false)).map(sentence).collect()
}

fn what(found: &Found) -> String {
    let at: String = found.at.iter().map(|(parameter, value)| format!(" {parameter}={value}")).collect();
    let over = found.over.as_ref().map_or(String::new(), |over| format!(", over that of {over}"));
    format!("{} of {}{at}{over}", found.of, found.row)
}

fn claimed(found: &Found, claim: Claim) -> String {
    match claim {
        Claim::Value(value) => told(found, value),
        Claim::Below { below } => format!("less than {}", told(found, below)),
    }
}

fn told(found: &Found, value: f64) -> String {
    if found.is_share { format!("{} %", significant(100.0 * value)) } else { significant(value) }
}
