//! The order in which nodes run: sources before consumers, otherwise the document's.

use super::diagnostics::Problem;
use super::{Edge, Node, When, Work};
use petgraph::algo::tarjan_scc;
use petgraph::graph::{DiGraph, NodeIndex};
use petgraph::visit::EdgeRef;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// The nodes of one level and, for every edge between them, the document's edge behind it.
type Level<'n> = DiGraph<usize, (&'n Node, &'n Edge)>;

/// Sorts the nodes, those inside loops too. A loop is one node of the level that holds it.
///
/// # Errors
/// A problem for each cycle, with its path spelled out.
pub fn order(nodes: Vec<Node>) -> Result<Vec<Node>, Vec<Problem>> {
    let mut problems = Vec::new();
    let sorted = order_level(nodes, &mut problems);
    if problems.is_empty() { Ok(sorted) } else { Err(problems) }
}

fn order_level(nodes: Vec<Node>, problems: &mut Vec<Problem>) -> Vec<Node> {
    let order = {
        let graph = level(&nodes);
        let sorted = sort(&graph);
        if sorted.len() < nodes.len() {
            problems.extend(tarjan_scc(&graph).iter().filter_map(|component| cycle(&graph, component)));
        }
        sorted
    };
    let mut nodes: Vec<Option<Node>> = nodes.into_iter().map(Some).collect();
    let sorted = order.into_iter().filter_map(|index| nodes[index].take()).collect::<Vec<_>>();
    // Nodes of a cycle come last: only their loops are still looked at.
    sorted.into_iter().chain(nodes.into_iter().flatten()).map(|node| order_inside(node, problems)).collect()
}

fn order_inside(node: Node, problems: &mut Vec<Problem>) -> Node {
    match node.work {
        Work::Loop(kind, inner) => Node { work: Work::Loop(kind, order_level(inner, problems)), ..node },
        Work::Pass(_) => node,
    }
}

fn level(nodes: &[Node]) -> Level<'_> {
    let mut graph = DiGraph::new();
    let mut holders: BTreeMap<&str, NodeIndex> = BTreeMap::new();
    for (index, node) in nodes.iter().enumerate() {
        let at = graph.add_node(index);
        family(node, &mut |member| {
            holders.insert(&member.name, at);
        });
    }
    for node in nodes {
        family(node, &mut |member| {
            for edge in member.inputs.iter().filter(|edge| edge.when == When::Now) {
                let ends = holders.get(edge.from.node.as_str()).zip(holders.get(member.name.as_str()));
                // Inside a loop the edge belongs to the loop's own level; a node that reads itself is a cycle of its level.
                if let Some((from, to)) = ends.filter(|(from, to)| from != to || edge.from.node == node.name) {
                    graph.add_edge(*from, *to, (member, edge));
                }
            }
        });
    }
    graph
}

/// The node and all inside it.
pub fn family<'n>(node: &'n Node, visit: &mut dyn FnMut(&'n Node)) {
    visit(node);
    for inner in node.inner() {
        family(inner, visit);
    }
}

/// Of the nodes whose sources are done, the first in the document is next (Kahn 1962). Nodes of cycles are left out.
fn sort(graph: &Level<'_>) -> Vec<usize> {
    let mut waits: Vec<usize> = graph.node_indices().map(|node| graph.edges_directed(node, petgraph::Incoming).count()).collect();
    let mut ready: BTreeSet<NodeIndex> = graph.node_indices().filter(|node| waits[node.index()] == 0).collect();
    let mut order = Vec::new();
    while let Some(node) = ready.pop_first() {
        order.push(graph[node]);
        for edge in graph.edges(node) {
            let target = edge.target();
            waits[target.index()] -= 1;
            if waits[target.index()] == 0 {
                ready.insert(target);
            }
        }
    }
    order
}

/// The shortest cycle through the component's first node, if it is one.
fn cycle(graph: &Level<'_>, component: &[NodeIndex]) -> Option<Problem> {
    let start = *component.iter().min()?;
    let mut came: BTreeMap<NodeIndex, (&Node, &Edge, NodeIndex)> = BTreeMap::new();
    let mut queue = VecDeque::from([start]);
    while let Some(node) = queue.pop_front() {
        for edge in graph.edges(node).filter(|edge| component.contains(&edge.target())) {
            let (consumer, written) = *edge.weight();
            came.entry(edge.target()).or_insert_with(|| {
                queue.push_back(edge.target());
                (consumer, written, node)
            });
        }
    }
    let mut path = Vec::new();
    let mut at = start;
    loop {
        let (consumer, edge, before) = came.get(&at)?;
        path.push((*consumer, *edge));
        at = *before;
        if at == start {
            break;
        }
    }
    let spelled: Vec<String> = path.iter().map(|(consumer, edge)| format!("{}.{} → {}", consumer.name, edge.input, edge.from.node)).collect();
    let problem = Problem::new("pipeline::cycle", format!("these edges go in a circle: {}", spelled.join(", ")));
    let labelled =
        path.iter().fold(problem, |problem, (consumer, edge)| problem.at(&edge.from.place, format!("`{}` waits for `{}`", consumer.name, edge.from.node)));
    Some(labelled.help("only PreviousRound(\"…\") and PreviousFrame(\"…\") can close a loop"))
}
