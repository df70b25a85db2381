//! What a frame left undone, for people.

use crate::gpu::Unfinished;
use crate::recording::Shortfall;
use std::collections::BTreeMap;

/// A frame that is not complete.
#[derive(Debug, Clone, PartialEq)]
pub struct Gap {
    /// What is missing, and why the loops ended.
    pub what: String,
    /// What to do about it.
    pub help: String,
}

impl Gap {
    /// Of pixels without a record and loops that ended before they were done.
    pub fn of(uncovered_pixels: Option<u32>, unfinished: &[Unfinished]) -> Self {
        let pixels = match uncovered_pixels.unwrap_or(0) {
            0 => None,
            1 => Some("1 pixel sees a surface that no record covers".to_owned()),
            pixels => Some(format!("{pixels} pixels see a surface that no record covers")),
        };
        let mut loops: BTreeMap<Shortfall, Vec<String>> = BTreeMap::new();
        for ended in unfinished {
            loops.entry(ended.because).or_default().push(format!("`{}`", ended.name));
        }
        let ends = loops.iter().map(|(because, names)| format!("{} ended because {}", names.join(" and "), because.phrase())).collect::<Vec<_>>().join("; ");
        let what = pixels.into_iter().chain((!ends.is_empty()).then_some(ends)).collect::<Vec<_>>().join(": ");
        let help = loops.keys().map(|because| because.help()).collect::<Vec<_>>().join("; ");
        // A search that ends with cells of several pixels is done with pixels left.
        let help = if help.is_empty() { "let the last FindMisses look at single pixels: `finest: 1`".into() } else { help };
        Self { what, help }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ended(name: &str, because: Shortfall) -> Unfinished {
        Unfinished { name: name.into(), because, is_certain: true }
    }

    #[test]
    fn loops_that_ended_for_one_reason_share_a_sentence() {
        let gap = Gap::of(Some(1), &[ended("a", Shortfall::CacheFull), ended("b", Shortfall::Time), ended("c", Shortfall::CacheFull)]);
        assert_eq!(gap.what, "1 pixel sees a surface that no record covers: `b` ended because the time was up; `a` and `c` ended because the cache is full");
        assert_eq!(gap.help.matches(';').count(), 1, "{}", gap.help);
        assert_eq!(Gap::of(None, &[ended("a", Shortfall::Rounds)]).what, "`a` ended because it had no round left");
    }

    #[test]
    fn a_gap_that_no_loop_explains_has_a_help() {
        assert!(Gap::of(Some(2), &[]).help.contains("finest: 1"));
    }
}
