//! The records of a run, as a page lays them over its picture.

use super::dump::items;
use super::failure::Failure;
use super::scene::View;
use crate::contract::{Port, port};
use crate::math::weight;
use crate::measure::page::Overlay;
use crate::measure::run::Run;
use crate::passes::record::Record;

/// One for each cache that pixels are lit from, with its records as they were made: before any filter.
pub(super) fn overlays(run: &Run, view: &View) -> Result<Vec<Overlay>, Failure> {
    let overlay = |(node, cache): (&str, port::RecordCache)| {
        let records: Vec<weight::Record> = items::<Record>(run, cache.records, run.variable(cache.count))?.iter().map(weight::Record::from).collect();
        Ok(Overlay::new(node.to_owned(), &cache.rule, &records, &view.camera, view.size))
    };
    caches(run).into_iter().map(overlay).collect()
}

/// Each cache with the node that keeps it: the first that hands it on.
fn caches(run: &Run) -> Vec<(&str, port::RecordCache)> {
    let plan = run.plan();
    let mut found: Vec<(&str, port::RecordCache)> = Vec::new();
    for (node, _) in &plan.resolved {
        for (_, port) in plan.ports_of(node) {
            if let Port::RecordCache(cache) = port
                && found.iter().all(|(_, other)| other.count != cache.count)
            {
                found.push((node, *cache));
            }
        }
    }
    found
}
