//! Host steps: what they see, and that they touch nothing else.

use super::coherence::Contents;
use super::copies::Copies;
use super::device::GpuError;
use super::encode::Pending;
use super::session::Session;
use crate::scene::{Camera, Scene, bvh::Bvh, emitters::Emission, stage::Motion};
use crate::schedule::*;
use glam::Vec4;
use std::any::Any;
use std::cell::Cell;
use std::collections::{HashMap, HashSet};
use std::panic::{AssertUnwindSafe, catch_unwind};

impl Session {
    pub(super) async fn run_host(&mut self, host: &Host, node: &Node, pending: &mut Pending) -> Result<(), GpuError> {
        let failed = |reason: String| GpuError::HostStep { node: node.name.clone(), reason };
        let contents = self.read_back(host, pending).await?;
        // What is written must reach the device after the commands before this step and before those after it.
        if !host.writes.is_empty() && !pending.empty {
            self.submit(pending);
        }
        let (mut lists, mut states, mut variables) = (std::mem::take(&mut self.lists), std::mem::take(&mut self.states), std::mem::take(&mut self.variables));
        let (mut latest, mut copies) = (std::mem::take(&mut self.latest), std::mem::take(&mut self.copies));
        let mut cut_short = std::mem::take(&mut self.cut_short);
        let mut view = HostView {
            session: self,
            host,
            undeclared: Cell::new(None),
            contents,
            copies: &mut copies,
            lists: &mut lists,
            states: &mut states,
            variables: &mut variables,
            latest: &mut latest,
            cut_short: &mut cut_short,
        };
        // A pass may be another program's: what it leaves half done is not looked at again.
        let result = catch_unwind(AssertUnwindSafe(|| (host.run)(&mut view)))
            .unwrap_or_else(|panic| Err(format!("`{}` panicked: {}", host.name, panic_message(&*panic))));
        let undeclared = view.undeclared.take();
        (self.lists, self.states, self.variables) = (lists, states, variables);
        (self.latest, self.copies, self.cut_short) = (latest, copies, cut_short);
        match undeclared {
            Some(resource) => Err(failed(format!("`{}` touches {}, which it does not declare", host.name, self.schedule.resource(resource).name))),
            None => result.map_err(failed),
        }
    }
}

/// What a panic says.
pub fn panic_message(panic: &(dyn Any + Send)) -> &str {
    panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("without a message")
}

/// What a host step sees.
struct HostView<'s> {
    session: &'s Session,
    host: &'s Host,
    /// The first resource that the step has touched without having said so.
    undeclared: Cell<Option<Resource>>,
    contents: HashMap<Resource, Contents>,
    copies: &'s mut Copies,
    lists: &'s mut HashMap<Resource, Vec<Draw>>,
    states: &'s mut HashMap<Resource, Option<Box<dyn Any + Send + Sync>>>,
    variables: &'s mut Vec<u32>,
    latest: &'s mut Vec<u32>,
    cut_short: &'s mut HashMap<Variable, Shortfall>,
}

impl HostView<'_> {
    /// Whether the step has said that it writes a resource.
    fn may_write(&self, resource: Resource) -> bool {
        let may = self.host.writes.contains(&resource);
        if !may {
            self.refuse(resource);
        }
        may
    }

    fn refuse(&self, resource: Resource) {
        self.undeclared.set(self.undeclared.get().or(Some(resource)));
    }
}

impl HostContext for HostView<'_> {
    fn read(&self, resource: Resource) -> &[u8] {
        let nothing: &[Vec4] = &[];
        let Some(contents) = self.contents.get(&resource) else {
            self.refuse(resource);
            return bytemuck::cast_slice(nothing);
        };
        let copy = contents.own.as_ref().or_else(|| self.copies.get(resource));
        copy.and_then(|copy| copy.known(contents.bytes)).unwrap_or(bytemuck::cast_slice(nothing))
    }

    fn write(&mut self, resource: Resource, offset: u64, bytes: &[u8]) {
        if !self.may_write(resource) {
            return;
        }
        let is_kept = self.session.shared.contains(&resource) || self.copies.get(resource).is_some();
        if !is_kept || !self.copies.entry(resource).write(offset as usize, bytes) {
            self.session.gpu.queue.write_buffer(self.session.buffer(resource), offset, bytes);
        }
    }

    fn take(&mut self, resource: Resource) -> Vec<Vec4> {
        self.may_write(resource);
        self.copies.entry(resource).take(self.session.unpadded_bytes(resource))
    }

    fn put(&mut self, resource: Resource, contents: Vec<Vec4>, bytes: u64) {
        self.copies.entry(resource).put(contents, (bytes as usize).min(self.session.unpadded_bytes(resource)));
    }

    fn variable(&self, variable: Variable) -> u32 {
        let value = self.variables[variable.0 as usize];
        self.session.speculation.iter().for_each(|speculation| speculation.note_read(variable, value));
        value
    }

    fn set(&mut self, variable: Variable, value: u32) {
        self.variables[variable.0 as usize] = value;
        self.session.speculation.iter().for_each(|speculation| speculation.note_set(variable));
        if value != 0 {
            self.latest[variable.0 as usize] = value;
        }
    }

    fn draws(&mut self, resource: Resource) -> &mut Vec<Draw> {
        self.lists.entry(resource).or_default()
    }

    fn state(&mut self, resource: Resource) -> &mut Option<Box<dyn Any + Send + Sync>> {
        self.states.entry(resource).or_default()
    }

    fn is_last_round(&self) -> bool {
        self.session.is_last_round
    }

    fn is_timed(&self) -> bool {
        self.session.is_timed
    }

    fn cut_short(&mut self, until: Variable, because: Shortfall) {
        self.cut_short.insert(until, because);
    }

    fn scene(&self) -> &Scene {
        &self.session.stage.scene
    }

    fn bvh(&self) -> &Bvh {
        &self.session.stage.bvh
    }

    fn emission(&self) -> &Emission {
        self.session.uploads[0].emission()
    }

    fn extent(&self) -> f32 {
        self.session.stage.extent()
    }

    fn motions(&self) -> &[Motion] {
        self.session.motions()
    }

    fn lapse(&self) -> Lapse {
        self.session.lapse
    }

    fn camera(&self) -> (&Camera, [u32; 2]) {
        (&self.session.camera.0, self.session.camera.1)
    }
}

/// What host steps hand to each other or to their next round: what more than one of them touches, one in a loop, or one that changes it in place.
pub(super) fn shared(schedule: &Schedule) -> HashSet<Resource> {
    let (mut once, mut shared) = (HashSet::new(), HashSet::new());
    share(&schedule.steps, false, &mut once, &mut shared);
    shared
}

fn share(steps: &[Step], in_loop: bool, once: &mut HashSet<Resource>, shared: &mut HashSet<Resource>) {
    for step in steps {
        let node = match step {
            Step::Repeat(repeat) => {
                share(&repeat.steps, true, once, shared);
                continue;
            }
            Step::Node(node) => node,
        };
        for command in &node.commands {
            if let Command::Host(host) = command {
                let touched = host.reads.iter().map(|read| read.resource).chain(host.writes.iter().copied());
                shared.extend(touched.filter(|resource| !once.insert(*resource) || in_loop));
            }
        }
    }
}
