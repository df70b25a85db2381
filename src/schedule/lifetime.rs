//! Which resources can share memory.

use super::{Lifetime, Resource, ResourceKind, Schedule, Step};

/// First and last step, in the order of nodes, at which each resource is touched.
pub struct Lifetimes(Vec<Option<[u32; 2]>>);

/// Which allocation each transient resource lives in.
#[derive(Debug, PartialEq)]
pub struct Placement {
    /// Allocation by resource; None for what is not transient or never used.
    pub slots: Vec<Option<u32>>,
    /// The resource kind that each allocation must hold: buffers have the size of their largest user.
    pub allocations: Vec<ResourceKind>,
}

impl Lifetimes {
    /// What a loop touches lives as long as the whole loop: its next round may read what this one wrote.
    /// `kept` are needed after the last step: outputs and dumps.
    pub fn of(schedule: &Schedule, kept: &[Resource]) -> Self {
        let mut spans = vec![None; schedule.resources.len()];
        let mut clock = 0;
        visit(&schedule.steps, &mut clock, &mut spans);
        for resource in kept {
            if let Some([_, last]) = &mut spans[resource.0 as usize] {
                *last = clock;
            }
        }
        Self(spans)
    }

    pub fn span(&self, resource: Resource) -> Option<[u32; 2]> {
        self.0[resource.0 as usize]
    }
}

fn visit(steps: &[Step], clock: &mut u32, spans: &mut [Option<[u32; 2]>]) {
    for step in steps {
        match step {
            Step::Node(node) => {
                for resource in node.commands.iter().flat_map(|c| c.resources()) {
                    touch(&mut spans[resource.0 as usize], [*clock, *clock]);
                }
                *clock += 1;
            }
            Step::Repeat(repeat) => {
                let start = *clock;
                let mut inner = vec![None; spans.len()];
                visit(&repeat.steps, clock, &mut inner);
                let end = clock.saturating_sub(1).max(start);
                for (span, inner) in spans.iter_mut().zip(inner) {
                    if inner.is_some() {
                        touch(span, [start, end]);
                    }
                }
            }
        }
    }
}

fn touch(span: &mut Option<[u32; 2]>, at: [u32; 2]) {
    *span = Some(span.map_or(at, |[first, last]| [first.min(at[0]), last.max(at[1])]));
}

impl Placement {
    /// Greedy by first use: a resource takes over the first allocation of its kind that is free again.
    pub fn of(schedule: &Schedule, lifetimes: &Lifetimes) -> Self {
        let mut order: Vec<_> = (0..schedule.resources.len() as u32).map(Resource).filter(|r| is_transient(schedule, *r)).collect();
        order.retain(|r| lifetimes.span(*r).is_some());
        order.sort_by_key(|r| (lifetimes.span(*r).map(|s| s[0]), r.0));
        let mut slots = vec![None; schedule.resources.len()];
        let mut allocations: Vec<(ResourceKind, u32)> = Vec::new();
        for resource in order {
            let Some([first, last]) = lifetimes.span(resource) else { continue };
            let kind = &schedule.resource(resource).kind;
            let free = allocations.iter().position(|(held, until)| *until < first && can_share(held, kind));
            let slot = free.unwrap_or_else(|| {
                allocations.push((kind.clone(), last));
                allocations.len() - 1
            });
            let (held, until) = &mut allocations[slot];
            *until = last;
            if kind.bytes() > held.bytes() {
                *held = kind.clone();
            }
            slots[resource.0 as usize] = Some(slot as u32);
        }
        Self { slots, allocations: allocations.into_iter().map(|a| a.0).collect() }
    }
}

fn is_transient(schedule: &Schedule, resource: Resource) -> bool {
    let description = schedule.resource(resource);
    matches!(description.lifetime, Lifetime::Transient) && description.kind.bytes() > 0
}

fn can_share(held: &ResourceKind, wanted: &ResourceKind) -> bool {
    match (held, wanted) {
        (ResourceKind::Buffer { .. }, ResourceKind::Buffer { .. }) => true,
        (ResourceKind::Texture { .. }, ResourceKind::Texture { .. }) => held == wanted,
        _ => false,
    }
}
