//! Loops that the device drives: rounds are recorded ahead of the host's knowing whether they are needed, and it looks every so many of them.

use super::device::GpuError;
use super::encode::Pending;
use super::frame::{AskPace, Frame, Pace};
use super::programs::Ready;
use super::readback;
use super::session::Session;
use super::timing::Timing;
use crate::recording::*;

/// Rounds that are recorded before the first look, where no frame has told how many it takes.
const FIRST: u32 = 8;
/// Most rounds between two looks.
const MOST: u32 = 64;

/// Words before the variables, as `shaders/lib/variables.wgsl` names them.
struct Progress {
    rounds: u32,
    is_over: bool,
    is_last_round: bool,
    shortfall: Option<Shortfall>,
}

impl Session<'_> {
    /// Runs a loop whose first node has the index `first`; returns the index after the last.
    pub(super) fn run_ahead(
        &mut self,
        repeat: &Repeat,
        sizes: Resource,
        first: usize,
        pending: &mut Pending,
        frame: &mut Frame,
        pace: AskPace,
    ) -> Result<usize, GpuError> {
        let outer = self.is_last_round;
        self.start_ahead(repeat);
        // As many as the last time, and one that finds the end.
        let mut ahead = self.rounds_before.get(&repeat.round).map_or(FIRST, |rounds| rounds + 1).min(MOST);
        let progress = loop {
            for _ in 0..ahead {
                self.encode_round(repeat, sizes, first, pending)?;
            }
            let progress = self.look_at_variables(pending)?;
            let is_done = self.is_done(repeat);
            if is_done || progress.is_over || progress.rounds == repeat.at_most {
                self.is_last_round = progress.is_last_round;
                self.cut_short.extend(repeat.until.zip(progress.shortfall));
                self.end_loop(repeat, progress.rounds, is_done, frame);
                break progress;
            }
            if pace() == Pace::Stop {
                return Err(GpuError::Interrupted);
            }
            ahead = (2 * ahead).min(MOST);
        };
        self.rounds_before.insert(repeat.round, progress.rounds);
        self.is_last_round = outer;
        let end = first + repeat.steps.len();
        self.nodes[first + 1..end].iter_mut().for_each(|node| node.runs += progress.rounds);
        Ok(end)
    }

    fn is_done(&self, repeat: &Repeat) -> bool {
        repeat.until.is_some_and(|until| self.variable(until) != 0)
    }

    /// Brings the variables to the device, as a loop starts.
    fn start_ahead(&mut self, repeat: &Repeat) {
        if let Some(until) = repeat.until {
            self.set_variable(until, 0);
            self.cut_short.remove(&until);
        }
        let words: Vec<u32> = [0; VARIABLES_BEFORE as usize].iter().chain(&self.variables).chain(&self.latest).copied().collect();
        if let Some(variables) = self.on_device() {
            self.write(variables, bytemuck::cast_slice(&words));
        }
    }

    fn on_device(&self) -> Option<Resource> {
        self.recording.resources.iter().position(|resource| resource.lifetime == Lifetime::Variables).map(|index| Resource(index as u32))
    }

    fn encode_round(&mut self, repeat: &Repeat, sizes: Resource, first: usize, pending: &mut Pending) -> Result<(), GpuError> {
        self.encode_sizing(first, 0, pending);
        self.encode_sizing(first, 1, pending);
        let mut next_size = 0;
        for (step, index) in repeat.steps[1..].iter().zip(first + 1..) {
            let Step::Node(node) = step else { unreachable!("such loops hold no others") };
            let mut open = false;
            for (position, command) in node.commands.iter().enumerate() {
                self.catch_up_all(command, pending);
                if !self.timing.as_ref().is_some_and(Timing::waits) {
                    self.begin_timing(&mut open, index, pending)?;
                }
                next_size += self.encode_sized(command, &self.programs[index][position], (sizes, next_size), pending);
                // What a host step's twin has counted changes the sizes of what follows.
                if matches!(command, Command::Host(_)) {
                    self.encode_sizing(first, 1, pending);
                }
            }
            self.end_timing(&mut open, pending)?;
        }
        pending.empty = false;
        Ok(())
    }

    /// One of the two commands that begin a round and size it.
    fn encode_sizing(&self, first: usize, position: usize, pending: &mut Pending) {
        if let Ready::Compute(dispatches) = &self.programs[first][position] {
            dispatches.iter().for_each(|dispatch| dispatch.begin(&mut pending.encoder).dispatch_workgroups(1, 1, 1));
        }
    }

    /// Encodes a command with sizes from a place of theirs on; how many it takes.
    fn encode_sized(&self, command: &Command, ready: &Ready, (sizes, place): (Resource, u64), pending: &mut Pending) -> u64 {
        let (sizes, offset) = (self.buffer(sizes), |nth: u64| 16 * (place + nth));
        match (command, ready) {
            (Command::Raster(raster), ready) => {
                self.encode_raster(raster, ready, Some((sizes, offset(0))), &mut pending.encoder);
                1
            }
            (_, Ready::Compute(dispatches)) => {
                for (dispatch, nth) in dispatches.iter().zip(0..) {
                    dispatch.begin(&mut pending.encoder).dispatch_workgroups_indirect(sizes, offset(nth));
                }
                dispatches.len() as u64
            }
            _ => unreachable!("such loops hold what the device can size"),
        }
    }

    /// Waits for all that was recorded, and takes the variables over.
    fn look_at_variables(&mut self, pending: &mut Pending) -> Result<Progress, GpuError> {
        let Some(variables) = self.on_device() else { unreachable!("such loops have variables on the device") };
        let staging = self.kept_staging(variables);
        let bytes = self.copy_out(pending, Read::whole(variables), &staging);
        self.submit(pending);
        self.waits += 1;
        let words: Vec<u32> = readback::look(self.gpu, &staging, bytes, bytemuck::pod_collect_to_vec)?;
        let (before, numbers) = words.split_at(VARIABLES_BEFORE as usize);
        let count = self.variables.len();
        self.variables.copy_from_slice(&numbers[..count]);
        self.latest.copy_from_slice(&numbers[count..2 * count]);
        Ok(Progress { rounds: before[0], is_over: before[1] != 0, is_last_round: before[2] != 0, shortfall: Shortfall::of_code(before[3]) })
    }
}
