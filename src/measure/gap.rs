//! What a frame left undone, for people.

use crate::gpu::Unfinished;
use crate::schedule::Shortfall;
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
    /// Of pixels without a record, of those with the light of farther ones and how coarse it is, and of loops that ended before they were done.
    pub fn of(uncovered_pixels: Option<u32>, coarse: Option<(u32, u32)>, unfinished: &[Unfinished]) -> Self {
        let pixels = match uncovered_pixels.unwrap_or(0) {
            0 => coarse.filter(|(pixels, _)| *pixels > 0).map(|(pixels, times)| {
                format!("{pixels} pixels are interpolated from farther records, with an accuracy of up to {times} times the stated one")
            }),
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
        let gap = Gap::of(Some(1), None, &[ended("a", Shortfall::CacheFull), ended("b", Shortfall::Time), ended("c", Shortfall::CacheFull)]);
        assert_eq!(gap.what, "1 pixel sees a surface that no record covers: `b` ended because the time was up; `a` and `c` ended because the cache is full");
        assert_eq!(gap.help.matches(';').count(), 1, "{}", gap.help);
        assert_eq!(Gap::of(None, None, &[ended("a", Shortfall::Rounds)]).what, "`a` ended because it had no round left");
    }

    #[test]
    fn a_gap_that_no_loop_explains_has_a_help() {
        assert!(Gap::of(Some(2), None, &[]).help.contains("finest: 1"));
    }
}
