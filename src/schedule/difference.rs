//! Whether one schedule can take another's place on the device.

use super::{Draws, Host, Keys, Lifetime, ResourceDescription, Schedule, Step};

impl Schedule {
    /// What of `other` would need other memory or other programs, for a message; None where one device session can run both.
    ///
    /// Contents of constants, what host steps do, which triangles are drawn, and bounds of loops may differ.
    pub fn difference(&self, other: &Self) -> Option<String> {
        let resource = first(&self.resources, &other.resources, same_memory, |resource| format!("`{}` needs other memory", resource.name));
        let variable = || first(&self.variables, &other.variables, |a, b| a == b, |variable| format!("`{}` is counted in one only", variable.name));
        lonely(&self.resources, &other.resources).or(resource).or_else(variable).or_else(|| steps(&self.steps, &other.steps))
    }
}

/// A resource that one of the two does without.
fn lonely(mine: &[ResourceDescription], others: &[ResourceDescription]) -> Option<String> {
    let missing = |from: &[ResourceDescription], name: &str| from.iter().all(|resource| resource.name != name);
    let found = others.iter().find(|resource| missing(mine, &resource.name)).or_else(|| mine.iter().find(|resource| missing(others, &resource.name)));
    found.map(|resource| format!("`{}` is there in one only", resource.name))
}

fn first<T>(mine: &[T], others: &[T], same: impl Fn(&T, &T) -> bool, tell: impl Fn(&T) -> String) -> Option<String> {
    let pair = mine.iter().zip(others).find(|(a, b)| !same(a, b)).map(|(a, _)| a);
    let longer = if mine.len() > others.len() { mine.get(others.len()) } else { others.get(mine.len()) };
    pair.or(longer).map(tell)
}

fn same_memory(a: &ResourceDescription, b: &ResourceDescription) -> bool {
    let same_lifetime = match (&a.lifetime, &b.lifetime) {
        (Lifetime::Constant(_), Lifetime::Constant(_)) => true,
        (a, b) => a == b,
    };
    a.name == b.name && a.kind == b.kind && same_lifetime
}

fn steps(mine: &[Step], others: &[Step]) -> Option<String> {
    let name = |step: &Step| match step {
        Step::Node(node) => format!("`{}` does other work", node.name),
        Step::Repeat(repeat) => format!("`{}` repeats other work", repeat.name),
    };
    let inner = mine.iter().zip(others).find_map(|pair| match pair {
        (Step::Repeat(a), Step::Repeat(b)) => steps(&a.steps, &b.steps),
        _ => None,
    });
    inner.or_else(|| first(mine, others, same_step, name))
}

fn same_step(a: &Step, b: &Step) -> bool {
    match (a, b) {
        (Step::Node(a), Step::Node(b)) => a == b,
        // Their steps are compared one by one.
        (Step::Repeat(a), Step::Repeat(b)) => (&a.name, a.until, a.round) == (&b.name, b.until, b.round),
        _ => false,
    }
}

/// What is drawn is looked up as it is drawn.
impl PartialEq for Draws {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Fixed(_), Self::Fixed(_)) => true,
            (Self::Listed(a), Self::Listed(b)) => a == b,
            (Self::Instances { vertices: a, count: b }, Self::Instances { vertices: c, count: d }) => (a, b) == (c, d),
            _ => false,
        }
    }
}

/// Commands of other keys run again.
impl PartialEq for Keys {
    fn eq(&self, other: &Self) -> bool {
        self.0.keys().eq(other.0.keys())
    }
}

/// What a host step does cannot be compared; what it reads and writes can.
impl PartialEq for Host {
    fn eq(&self, other: &Self) -> bool {
        (self.name, &self.reads, &self.writes) == (other.name, &other.reads, &other.writes)
    }
}
