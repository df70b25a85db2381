//! Loops that the device drives: rounds are encoded ahead of the host's knowing whether they are needed. While the device works on some, the host encodes the
//! next, and then looks at what became of those before. Rounds behind the end do nothing.

use super::device::GpuError;
use super::encode::Pending;
use super::frame::{AskPace, Pace};
use super::programs::Ready;
use super::readback::{self, Look};
use super::session::Session;
use super::timing::Timing;
use crate::schedule::*;

/// Rounds that are submitted first, where no frame has told how many it takes; then twice as many each time.
const FIRST: u32 = 2;
/// Most rounds that are submitted together: as many again are encoded meanwhile, and may be behind the end.
const MOST: u32 = 8;

/// Where a loop's own dispatches stand among the commands of its first node, as [`crate::pipeline::ahead`] lists them.
pub(super) const BEGIN: usize = 0;
const SIZE: usize = 1;
pub(super) const OPEN: usize = 2;
pub(super) const CLOSE: usize = 3;

/// The variables on the device, as `shaders/lib/variables.wgsl` has them.
pub(super) struct Words {
    progress: Progress,
    pub is_held: bool,
    pub values: Vec<u32>,
    /// What each was before it became 0, or is.
    pub latest: Vec<u32>,
}

/// A look at them as they are when the device has done what was submitted before.
pub(super) struct LookAtVariables {
    look: Look,
    submission: wgpu::SubmissionIndex,
}

/// Of the loop that ran last.
struct Progress {
    rounds: u32,
    is_over: bool,
    is_last_round: bool,
    shortfall: Option<Shortfall>,
}

impl Session {
    /// Runs a loop whose first node has the index `first`; how many rounds there were.
    pub(super) async fn run_ahead(
        &mut self,
        repeat: &Repeat,
        sizes: Resource,
        first: usize,
        pending: &mut Pending,
        pace: AskPace<'_>,
    ) -> Result<u32, GpuError> {
        if self.speculation.is_some() {
            return self.run_unseen(repeat, sizes, first, pending).await;
        }
        self.bring_variables();
        // As many as the last time, and one that finds the end.
        let mut together = self.rounds_before.get(&repeat.round).map_or(FIRST, |rounds| rounds + 1).min(MOST);
        let mut under_way = self.submit_rounds(together, repeat, sizes, first, pending).await?;
        let rounds = loop {
            if pace() == Pace::Stop {
                return Err(GpuError::Interrupted);
            }
            together = (2 * together).min(MOST);
            let next = self.submit_rounds(together, repeat, sizes, first, pending).await?;
            let progress = self.see_progress(std::mem::replace(&mut under_way, next)).await?;
            if progress.is_over || self.is_done(repeat, progress.rounds) || progress.rounds == repeat.at_most {
                break self.end_of_loop(repeat, under_way).await?;
            }
        };
        self.rounds_before.insert(repeat.round, rounds);
        self.nodes[first + 1..first + repeat.steps.len()].iter_mut().for_each(|node| node.runs += rounds);
        Ok(rounds)
    }

    async fn submit_rounds(
        &mut self,
        together: u32,
        repeat: &Repeat,
        sizes: Resource,
        first: usize,
        pending: &mut Pending,
    ) -> Result<LookAtVariables, GpuError> {
        for _ in 0..together {
            self.encode_round(repeat, sizes, first, pending).await?;
        }
        Ok(self.ask_for_variables(pending))
    }

    /// Brings the variables to the device, as a loop starts.
    pub(super) fn bring_variables(&mut self) {
        let words: Vec<u32> = [0; VARIABLES_BEFORE as usize].iter().chain(&self.variables).chain(&self.latest).copied().collect();
        self.overwrite(self.variables_on_device(), bytemuck::cast_slice(&words));
    }

    pub(super) fn variables_on_device(&self) -> Resource {
        let found = self.schedule.resources.iter().position(|resource| resource.lifetime == Lifetime::Variables);
        found.map_or_else(|| unreachable!("such loops have variables on the device"), |index| Resource(index as u32))
    }

    pub(super) async fn encode_round(&mut self, repeat: &Repeat, sizes: Resource, first: usize, pending: &mut Pending) -> Result<(), GpuError> {
        [BEGIN, SIZE].into_iter().for_each(|own| self.encode_own(repeat, first, own, pending));
        let nodes = repeat.steps.iter().filter_map(|step| if let Step::Node(node) = step { Some(node) } else { None });
        let mut next_size = 0;
        for (node, index) in nodes.zip(first..).skip(1) {
            let mut open = false;
            for (position, command) in node.commands.iter().enumerate() {
                self.catch_up_all(command, pending);
                if !self.timing.as_ref().is_some_and(Timing::waits) {
                    self.begin_timing(&mut open, index, pending).await?;
                }
                next_size += self.encode_sized(command, &self.programs[index][position], (sizes, next_size), pending);
                // What a host step's twin has counted changes the sizes of what follows.
                if matches!(command, Command::Host(_)) {
                    self.encode_own(repeat, first, SIZE, pending);
                }
            }
            self.end_timing(&mut open, pending).await?;
        }
        pending.empty = false;
        Ok(())
    }

    /// Encodes one of the loop's own dispatches.
    pub(super) fn encode_own(&self, repeat: &Repeat, first: usize, position: usize, pending: &mut Pending) {
        let Some(Step::Node(own)) = repeat.steps.first() else { unreachable!("such loops have a node that begins their rounds") };
        self.encode(&own.commands[position], first, position, pending);
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

    /// What the rounds behind a loop's end leave as it was; how many there were before it.
    async fn end_of_loop(&mut self, repeat: &Repeat, under_way: LookAtVariables) -> Result<u32, GpuError> {
        self.waits += 1;
        let progress = self.see_progress(under_way).await?;
        self.is_last_round = progress.is_last_round;
        self.cut_short.extend(repeat.until.zip(progress.shortfall));
        Ok(progress.rounds)
    }

    /// Waits for what was encoded before the look, and takes the variables over.
    async fn see_progress(&mut self, look: LookAtVariables) -> Result<Progress, GpuError> {
        let Words { progress, values, latest, .. } = self.see_variables(look).await?;
        (self.variables, self.latest) = (values, latest);
        Ok(progress)
    }

    /// Submits all that was encoded, and asks what the variables are then.
    pub(super) fn ask_for_variables(&mut self, pending: &mut Pending) -> LookAtVariables {
        let variables = self.variables_on_device();
        let staging = self.idle_staging.pop().unwrap_or_else(|| readback::staging(&self.gpu, self.schedule.resource(variables).kind.bytes()));
        let bytes = self.copy_first(pending, variables, u64::MAX, &staging);
        let submission = self.submit(pending);
        LookAtVariables { look: Look::ask(staging, bytes), submission }
    }

    /// Waits for what was encoded before the look.
    pub(super) async fn see_variables(&mut self, LookAtVariables { look, submission }: LookAtVariables) -> Result<Words, GpuError> {
        let arrived = look.arrive(&self.gpu, Some(submission)).await?;
        let words: Vec<u32> = arrived.see(&self.gpu, bytemuck::pod_collect_to_vec)?;
        self.idle_staging.push(arrived.staging);
        let (before, numbers) = words.split_at(VARIABLES_BEFORE as usize);
        let count = self.variables.len();
        let progress = Progress { rounds: before[0], is_over: before[1] != 0, is_last_round: before[2] != 0, shortfall: Shortfall::of_code(before[3]) };
        Ok(Words { progress, is_held: before[4] != 0, values: numbers[..count].to_vec(), latest: numbers[count..2 * count].to_vec() })
    }
}
