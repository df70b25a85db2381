//! Frames of a still picture: where nothing has changed since a frame whose loops came to their ends, the host takes it for granted that they find nothing to
//! do, encodes all of the frame without a look, and makes sure at its end.

use super::ahead::{BEGIN, CLOSE, OPEN, Words};
use super::device::GpuError;
use super::encode::Pending;
use super::frame::{AskPace, Frame, Pace};
use super::session::Session;
use super::shaders::Shaders;
use crate::schedule::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What host steps do with variables while the device is ahead of the host. What they read then they have to have set themselves, or else it must turn out that
/// no loop has changed it.
#[derive(Default)]
pub(super) struct Speculation {
    /// Whether the device has run a loop that the host has not looked at.
    is_ahead: bool,
    notes: Mutex<Notes>,
}

#[derive(Default)]
struct Notes {
    /// Variables that the host has set since, which the device does not know.
    set: BTreeSet<u32>,
    /// What the host took others for.
    read: BTreeMap<u32, u32>,
}

impl Speculation {
    pub fn note_set(&self, variable: Variable) {
        if self.is_ahead {
            self.notes().set.insert(variable.0);
        }
    }

    pub fn note_read(&self, variable: Variable, value: u32) {
        if self.is_ahead {
            let mut notes = self.notes();
            if !notes.set.contains(&variable.0) {
                notes.read.insert(variable.0, value);
            }
        }
    }

    /// Steps run one after the other: a lock because a frame may go on on another thread.
    fn notes(&self) -> MutexGuard<'_, Notes> {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Whether frames of a schedule may be drawn twice, should the first be wrong: the device drives each loop, and after the first of them no step looks at
/// what the device has made or changes what the next frame starts from.
pub(super) fn is_possible(schedule: &Schedule, shaders: &Shaders) -> bool {
    let is_driven = |step: &Step| matches!(step, Step::Repeat(repeat) if repeat.driver != Driver::Host);
    let Some(first) = schedule.steps.iter().position(is_driven) else { return false };
    schedule.steps.iter().enumerate().all(|(index, step)| match step {
        Step::Repeat(_) => is_driven(step),
        Step::Node(node) => node.commands.iter().enumerate().all(|(place, command)| {
            // It has run, and runs no more while nothing changes.
            let is_kept = node.keys.0.contains_key(&place);
            let looks = matches!(command, Command::Host(host) if index > first && !host.reads.is_empty());
            is_kept || !looks && !changes_history(command, schedule, shaders)
        }),
    })
}

fn changes_history(command: &Command, schedule: &Schedule, shaders: &Shaders) -> bool {
    let is_history = |resource: &Resource| matches!(schedule.resource(*resource).lifetime, Lifetime::History);
    let by_shader = |program: &Program, entries: &[&str]| {
        let uses = entries.iter().flat_map(|entry| shaders.of(program).uses(entry)).filter(|used| used.writes);
        uses.filter_map(|used| schedule.bound(program, &used.name)).any(|resource| is_history(&resource))
    };
    match command {
        Command::Late(_) => false,
        Command::Clear(to) | Command::Copy { to, .. } | Command::CopyToBuffer { to, .. } | Command::CopyLayer { to, .. } => is_history(to),
        Command::Host(host) => !host.runs_once && host.writes.iter().any(is_history),
        Command::Compute(compute) => by_shader(&compute.program, &[compute.entry]),
        Command::Raster(raster) => {
            let targets = raster.colours.iter().map(|target| target.texture).chain(raster.depth.map(|depth| depth.texture));
            targets.into_iter().any(|target| is_history(&target)) || by_shader(&raster.program, &raster.entries())
        }
    }
}

impl Session {
    /// A frame of which the host looks at no loop before it ends; none where it may not be like the one before, or turns out not to be.
    pub(super) async fn speculative_frame(&mut self, pace: AskPace<'_>) -> Result<Option<Frame>, GpuError> {
        if !self.may_speculate || !self.is_still || pace() != Pace::GoOn {
            return Ok(None);
        }
        let before = self.variables.clone();
        self.speculation = Some(Speculation::default());
        let (result, mut pending) = self.encode_frame(pace).await;
        let look = self.ask_for_variables(&mut pending);
        let words = self.see_variables(look).await;
        let speculation = self.speculation.take().unwrap_or_default();
        match result.and_then(|frame| Ok((frame, words?))) {
            Ok((frame, words)) if !words.is_held && self.take_over(&words, &speculation) => Ok(Some(frame)),
            found => {
                // What the device has added beyond these counts is as if it were not there. A guess that is wrong once might be wrong each time.
                self.variables = before;
                self.may_speculate &= found.is_err();
                found.map(|_| None)
            }
        }
    }

    /// Encodes one round of a loop whose first node has the index `first`, and that it must be the last.
    pub(super) async fn run_unseen(&mut self, repeat: &Repeat, sizes: Resource, first: usize, pending: &mut Pending) -> Result<u32, GpuError> {
        self.bring_set_variables(pending);
        self.encode_own(repeat, first, OPEN, pending);
        self.encode_round(repeat, sizes, first, pending).await?;
        [BEGIN, CLOSE].into_iter().for_each(|own| self.encode_own(repeat, first, own, pending));
        self.nodes[first + 1..first + repeat.steps.len()].iter_mut().for_each(|node| node.runs += 1);
        if let Some(until) = repeat.until {
            self.variables[until.0 as usize] = 1;
        }
        Ok(1)
    }

    /// Brings to the device what it does not know: before the first loop all variables, later those that the host has set.
    fn bring_set_variables(&mut self, pending: &mut Pending) {
        let Some(speculation) = &mut self.speculation else { return };
        if !std::mem::replace(&mut speculation.is_ahead, true) {
            return self.bring_variables();
        }
        let set = std::mem::take(&mut speculation.notes().set);
        // Behind the loops before.
        self.submit(pending);
        let (count, buffer) = (self.variables.len() as u32, self.buffer(self.variables_on_device()));
        let write = |word: u32, value: u32| self.gpu.queue.write_buffer(buffer, 4 * u64::from(VARIABLES_BEFORE + word), &value.to_le_bytes());
        for variable in set {
            let value = self.variables[variable as usize];
            write(variable, value);
            if value != 0 {
                write(count + variable, value);
            }
        }
    }

    /// Takes the variables over from the device but for those that the host has set since; whether the host took none for another.
    fn take_over(&mut self, words: &Words, speculation: &Speculation) -> bool {
        let Notes { set, read } = &*speculation.notes();
        for (variable, (value, latest)) in words.values.iter().zip(&words.latest).enumerate().filter(|(variable, _)| !set.contains(&(*variable as u32))) {
            (self.variables[variable], self.latest[variable]) = (*value, *latest);
        }
        read.iter().all(|(variable, value)| words.values[*variable as usize] == *value)
    }
}
