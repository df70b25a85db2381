//! Whether the rounds of a fill can differ. Where every round finds the same, the loop has no end of its own.

use super::{Edge, Loop, Node, Problem, When, Work, graph::family};
use crate::contract::PortKind;
use std::collections::{BTreeMap, BTreeSet};

/// A problem for each fill whose end depends on a cache that nothing in the loop adds new records to.
pub fn refuse_standstills(nodes: &[Node]) -> Vec<Problem> {
    let mut all = BTreeMap::new();
    for node in nodes {
        family(node, &mut |member| {
            all.insert(member.name.as_str(), member);
        });
    }
    let fills = all.values().filter(|node| matches!(node.work, Work::Loop(Loop::Fill, _)));
    fills.filter_map(|fill| Rounds::of(fill, &all)?.refuse_standstill()).collect()
}

/// A fill and what its end depends on.
struct Rounds<'n> {
    all: &'n BTreeMap<&'n str, &'n Node>,
    fill: &'n Node,
    until: &'n Edge,
    /// Nodes of the loop and of the loops in it.
    inside: BTreeSet<&'n str>,
    /// The nodes that the end depends on, inside the loop and before it.
    behind: BTreeSet<&'n str>,
}

impl<'n> Rounds<'n> {
    fn of(fill: &'n Node, all: &'n BTreeMap<&'n str, &'n Node>) -> Option<Self> {
        let until = fill.inputs.first()?;
        let mut inside = BTreeSet::new();
        for node in fill.inner() {
            family(node, &mut |member| {
                inside.insert(member.name.as_str());
            });
        }
        let rounds = Self { all, fill, until, inside, behind: BTreeSet::new() };
        let behind = rounds.behind(&until.from.node);
        Some(Self { behind, ..rounds })
    }

    /// The node and all that it depends on.
    fn behind(&self, name: &'n str) -> BTreeSet<&'n str> {
        let (mut behind, mut waiting) = (BTreeSet::new(), vec![name]);
        while let Some(name) = waiting.pop() {
            if let Some(node) = self.all.get(name)
                && behind.insert(name)
            {
                waiting.extend(node.inputs.iter().map(|edge| edge.from.node.as_str()));
            }
        }
        behind
    }

    /// The node that a cache was made by, before others added to it.
    fn root(&self, cache: &'n Edge) -> &'n str {
        let (mut name, mut seen) = (cache.from.node.as_str(), BTreeSet::new());
        while let Some(into) = self.all.get(name).and_then(|node| adds_to(node)).filter(|_| seen.insert(name)) {
            name = &into.from.node;
        }
        name
    }

    /// Caches that the end depends on.
    fn caches(&self) -> BTreeSet<&'n str> {
        let nodes = self.behind.iter().filter_map(|name| self.all.get(name)).filter(|node| adds_to(node).is_none());
        nodes.flat_map(|node| node.inputs.iter().filter(|edge| is_cache(node, edge))).map(|edge| self.root(edge)).collect()
    }

    /// Nodes of the loop that add to a cache, and the cache.
    fn adders(&self) -> impl Iterator<Item = (&'n Node, &'n Edge)> {
        self.inside.iter().filter_map(|name| self.all.get(name)).filter_map(|node| Some((*node, adds_to(node)?)))
    }

    /// Nodes of the loop that may do something else in the next round: what they read changes, by an edge from another such node or in a
    /// cache that such a node adds to. `caches_change` takes every cache for one that changes.
    fn varying(&self, caches_change: bool) -> BTreeSet<&'n str> {
        let mut varying = self.inside.clone();
        loop {
            let changes = |cache| caches_change || self.adders().any(|(adder, into)| varying.contains(adder.name.as_str()) && self.root(into) == cache);
            let varies = |node: &'n Node, edge: &'n Edge| match edge.when {
                When::PreviousFrame => false,
                // The same records again are no other records.
                When::Now if is_cache(node, edge) => adds_to(node).is_none() && changes(self.root(edge)),
                When::Now | When::PreviousRound => varying.contains(edge.from.node.as_str()),
            };
            let still = |name: &&str| self.all.get(name).is_some_and(|node| node.inputs.iter().any(|edge| varies(node, edge)));
            let next: BTreeSet<&str> = varying.iter().copied().filter(still).collect();
            if next.len() == varying.len() {
                return next;
            }
            varying = next;
        }
    }

    fn refuse_standstill(&self) -> Option<Problem> {
        let caches = self.caches();
        let end = self.until.from.node.as_str();
        if caches.is_empty() || self.varying(false).contains(end) {
            return None;
        }
        let adder = self.adders().find(|(_, into)| caches.contains(self.root(into)));
        let (causes, help) = match (adder, self.adders().next()) {
            _ if !self.varying(true).contains(end) => self.explain_same_cache(),
            (Some((adder, _)), _) => self.explain_same_records(adder),
            (None, Some((adder, into))) => {
                let help = format!("let `{}` add to {}, which `{}` depends on", adder.name, quoted(&caches), self.until.from);
                (vec![(into, format!("`{}` adds to another cache", adder.name))], help)
            }
            (None, None) => (Vec::new(), self.explain_missing(&caches)),
        };
        let message =
            format!("`{}` would never end: each round finds the same, as nothing in the loop changes what `{}` depends on", self.fill.name, self.until.from);
        let problem = Problem::new("pipeline::no_progress", message);
        let problem = causes.into_iter().fold(problem, |problem, (edge, label)| problem.at(&edge.from.place, label));
        Some(problem.at(&self.until.from.place, "the same in each round").help(help))
    }

    /// No node of the loop that the end depends on looks at the cache as it is: the edges by which they look, and what to do.
    fn explain_same_cache(&self) -> (Vec<(&'n Edge, String)>, String) {
        let nodes = self.behind.iter().filter(|name| self.inside.contains(*name)).filter_map(|name| self.all.get(name));
        let looks = |name: &'n str| self.behind(name).iter().filter_map(|name| self.all.get(name)).any(|node| node.inputs.iter().any(|e| is_cache(node, e)));
        let enters = |edge: &&Edge| edge.when == When::PreviousFrame || !self.inside.contains(edge.from.node.as_str());
        let edges: Vec<&Edge> = nodes.flat_map(|node| &node.inputs).filter(enters).filter(|edge| looks(&edge.from.node)).collect();
        let (old, outside): (Vec<_>, Vec<_>) = edges.into_iter().partition(|edge| edge.when == When::PreviousFrame);
        if outside.is_empty() {
            let help = "look at the cache itself, so that each round sees the records that the round before added";
            return (old.into_iter().map(|edge| (edge, "left by the frame before".into())).collect(), help.into());
        }
        let names: BTreeSet<&str> = outside.iter().map(|edge| edge.from.node.as_str()).collect();
        let help = format!("put {} into the loop, so that each round sees the records that the round before added", quoted(&names));
        (outside.into_iter().map(|edge| (edge, "made outside the loop".into())).collect(), help)
    }

    /// The loop adds records to the right cache, but the same in each round.
    fn explain_same_records(&self, adder: &'n Node) -> (Vec<(&'n Edge, String)>, String) {
        let new = adder.inputs.iter().filter(|edge| !is_cache(adder, edge));
        let causes = new.map(|edge| (edge, format!("`{}` adds the same records in each round", adder.name))).collect();
        (causes, format!("make the new records in the loop, at the requests of `{}`", self.until.from.node))
    }

    /// Nothing in the loop adds records to any cache.
    fn explain_missing(&self, caches: &BTreeSet<&str>) -> String {
        let makes = |node: &&&Node| node.description().outputs.iter().any(|output| output.kind == PortKind::Records);
        let records = self.inside.iter().filter_map(|name| self.all.get(name)).rfind(makes).map_or("…", |node| node.name.as_str());
        let cache = caches.first().copied().unwrap_or("…");
        format!("add the new records to the cache in the loop: (name: \"added\", pass: AddRecords(to: \"{cache}\", records: \"{records}\"))")
    }
}

fn is_cache(node: &Node, edge: &Edge) -> bool {
    node.accepts(edge) == Some(PortKind::RecordCache)
}

/// The cache that a node adds to: it takes one and hands it on.
fn adds_to(node: &Node) -> Option<&Edge> {
    let hands_on = node.description().outputs.iter().any(|output| output.kind == PortKind::RecordCache);
    node.inputs.iter().find(|edge| hands_on && is_cache(node, edge))
}

fn quoted(names: &BTreeSet<&str>) -> String {
    let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    names.join(" or ")
}
