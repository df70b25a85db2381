//! A schedule as text: what `explain` shows and what tests compare.

use super::{Command, Draws, Driver, Groups, Host, Lifetime, Lifetimes, Placement, ResourceKind, Schedule, Step};
use std::fmt::Write;

impl Schedule {
    /// Every resource with its kind, size and lifetime, then every command in order.
    pub fn to_text(&self, lifetimes: &Lifetimes, placement: &Placement) -> String {
        let mut text = String::from("resources\n");
        for (index, resource) in self.resources.iter().enumerate() {
            let lifetime = match &resource.lifetime {
                Lifetime::History => "history".into(),
                Lifetime::Constant(_) => "constant".into(),
                Lifetime::Scene(..) => "scene".into(),
                Lifetime::Frame | Lifetime::Variables => "frame".into(),
                Lifetime::Transient => match (lifetimes.span(super::Resource(index as u32)), placement.slots[index]) {
                    (Some([a, b]), Some(slot)) => format!("steps {a}..={b}, allocation {slot}"),
                    (Some([a, b]), None) => format!("steps {a}..={b}, on the host"),
                    (None, _) => "unused".into(),
                },
            };
            let _ = writeln!(text, "  {:<28} {:<34} {:>12} bytes  {lifetime}", resource.name, kind(&resource.kind), resource.kind.bytes());
        }
        text.push_str("steps\n");
        self.steps_to_text(&self.steps, 1, &mut 0, &mut text);
        text
    }

    fn steps_to_text(&self, steps: &[Step], depth: usize, clock: &mut u32, text: &mut String) {
        let indent = "  ".repeat(depth);
        for step in steps {
            match step {
                Step::Node(node) => {
                    let _ = writeln!(text, "{indent}{clock:>2} {} ({})", node.name, node.pass);
                    *clock += 1;
                    for command in &node.commands {
                        let _ = writeln!(text, "{indent}     {}", self.command_to_text(command));
                    }
                }
                Step::Repeat(repeat) => {
                    let ahead = if repeat.driver == Driver::Host { "" } else { ", driven by the device" };
                    let _ = match repeat.until {
                        Some(until) => {
                            let until = &self.variables[until.0 as usize].name;
                            writeln!(text, "{indent}repeat {} until {until}, at most {} rounds{ahead}", repeat.name, repeat.at_most)
                        }
                        None => writeln!(text, "{indent}repeat {}, {} rounds", repeat.name, repeat.at_most),
                    };
                    self.steps_to_text(&repeat.steps, depth + 1, clock, text);
                }
            }
        }
    }

    fn command_to_text(&self, command: &Command) -> String {
        match command {
            Command::Clear(resource) => format!("clear {}", self.resource(*resource).name),
            Command::Copy { from, to } | Command::CopyToBuffer { from, to, .. } | Command::CopyLayer { from, to, .. } => {
                format!("copy {} to {}", self.resource(*from).name, self.resource(*to).name)
            }
            Command::Compute(c) => format!("compute {}:{} {}", c.program.shader, c.entry, self.groups_to_text(&c.groups)),
            Command::Raster(r) => {
                let targets: Vec<_> = r.colours.iter().map(|t| self.resource(t.texture).name.clone()).collect();
                let draws = match &r.draws {
                    Draws::Fixed(draws) => format!("{} draws", draws.len()),
                    Draws::Listed(list) => format!("draws of {}", self.resource(*list).name),
                    Draws::Instances { count, .. } => format!("instances of {}", self.variables[count.0 as usize].name),
                };
                let depth = r.depth.map(|d| format!(" and {} layer {}", self.resource(d.texture).name, d.layer)).unwrap_or_default();
                format!("raster {}:{} to [{}]{depth}, {draws}", r.program.shader, r.vertex, targets.join(", "))
            }
            Command::Host(host) => self.host_to_text(host),
            Command::Late(host) => format!("if a loop ends early: {}", self.host_to_text(host)),
        }
    }

    fn host_to_text(&self, host: &Host) -> String {
        let reads: Vec<_> = host.reads.iter().map(|r| self.resource(r.resource).name.clone()).collect();
        format!("host {} reads [{}]", host.name, reads.join(", "))
    }

    fn groups_to_text(&self, groups: &Groups) -> String {
        match groups {
            Groups::Fixed([x, y, z]) => format!("{x}×{y}×{z}"),
            Groups::Counted { count, divisor, per } => format!("⌈{}/{divisor}⌉×{per}", self.variables[count.0 as usize].name),
        }
    }
}

fn kind(kind: &ResourceKind) -> String {
    match kind {
        ResourceKind::Buffer { .. } => "buffer".into(),
        ResourceKind::Texture { size: [w, h], layers: 1, format } => format!("{format:?} {w}×{h}"),
        ResourceKind::Texture { size: [w, h], layers, format } => format!("{format:?} {w}×{h}×{layers}"),
        ResourceKind::Draws => "list of draws".into(),
        ResourceKind::State => "host state".into(),
    }
}
