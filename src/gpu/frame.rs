//! A frame: steps in order, loops until they are done or the time is up.

use super::clock::{Clock, Rounds};
use super::device::GpuError;
use super::encode::Pending;
use super::session::Session;
use super::timing::Timing;
use crate::schedule::*;
use serde::Serialize;
use web_time::{Duration, Instant};

/// What a frame took.
#[derive(Debug, Clone)]
pub struct Frame {
    /// From its start to its end [s].
    pub seconds: f64,
    /// In the order in which they ran first.
    pub nodes: Vec<NodeTimes>,
    /// Rounds of the loops that run until they are done.
    pub fill_rounds: Option<u32>,
    /// How often the host waited, before the frame's end, for what the device made.
    pub waits: u32,
    /// Loops that ended before they were done.
    pub unfinished: Vec<Unfinished>,
}

/// A loop that ended before it was done.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unfinished {
    /// The node that it is.
    #[serde(rename = "loop")]
    pub name: String,
    /// Why.
    pub because: Shortfall,
    /// Whether work is left for sure. If not, the loop could do no more and did not look whether it had to.
    #[serde(skip)]
    pub is_certain: bool,
}

/// What a node took in a frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NodeTimes {
    /// Its name.
    pub node: String,
    /// That of its pass.
    pub pass: &'static str,
    /// None where the adapter has no timestamps.
    pub gpu_ms: Option<f64>,
    /// Time in host steps, waiting for what they read included.
    pub cpu_ms: f64,
    /// How often it ran.
    pub runs: u32,
}

/// What becomes of a frame that is under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// There is no hurry.
    GoOn,
    /// So much time is left to the frame: its loops end in time for what comes after them.
    Within(Duration),
    /// The frame is given up.
    Stop,
}

/// Asked as each round of a loop starts.
pub type AskPace<'k> = &'k (dyn Fn() -> Pace + Sync);

impl Session {
    /// Runs the schedule once.
    pub async fn frame(&mut self, pace: AskPace<'_>) -> Result<Frame, GpuError> {
        let gpu = self.gpu.clone();
        let whole = async {
            if std::mem::replace(&mut self.is_under_way, true) {
                self.start_over().await?;
            }
            let frame = self.whole_frame(pace).await;
            self.is_under_way = false;
            self.lapse = Lapse::NEXT;
            frame
        };
        gpu.told("rendering a frame", whole).await
    }

    /// Runs the schedule once for what lives on, so many frames later than the one that ran last. The next is a picture again, that of the frame after that one.
    pub async fn frame_ahead(&mut self, frames: u32, pace: AskPace<'_>) -> Result<Frame, GpuError> {
        let (pictures, frames) = (self.views.clone(), frames as i32);
        self.lapse = Lapse { frames, is_ahead: true };
        let frame = self.frame(pace).await;
        self.views.back_to(pictures);
        self.lapse = Lapse { frames: 1 - frames, is_ahead: false };
        self.is_still = false;
        frame
    }

    /// After a frame that was dropped before its end: what it had encoded is lost, so that counts and contents of histories do not go together, and
    /// what was on its way to the host stays there.
    async fn start_over(&mut self) -> Result<(), GpuError> {
        self.staging.clear();
        self.timing = Timing::new(&self.gpu, self.nodes.len());
        self.speculation = None;
        self.reset().await
    }

    async fn whole_frame(&mut self, pace: AskPace<'_>) -> Result<Frame, GpuError> {
        let start = Instant::now();
        // Once, as a guess that fails has the frame run again.
        self.tell_views();
        let mut frame = match self.speculative_frame(pace).await? {
            Some(frame) => frame,
            None => self.seen_frame(pace).await?,
        };
        self.collect_times(&mut frame).await?;
        frame.seconds = start.elapsed().as_secs_f64();
        frame.waits = self.waits;
        self.is_still = frame.unfinished.is_empty();
        self.frames += 1;
        Ok(frame)
    }

    /// A frame of which the host looks at each loop.
    async fn seen_frame(&mut self, pace: AskPace<'_>) -> Result<Frame, GpuError> {
        let (result, mut pending) = self.encode_frame(pace).await;
        // Also of a frame that is given up: what its variables count must be there.
        self.submit(&mut pending);
        let frame = result?;
        self.gpu.wait("finishing the frame").await?;
        Ok(frame)
    }

    /// Runs or encodes all of a frame, but for what is pending.
    pub(super) async fn encode_frame(&mut self, pace: AskPace<'_>) -> (Result<Frame, GpuError>, Pending) {
        self.start_frame();
        let (schedule, mut pending) = (self.schedule.clone(), self.pending());
        let mut frame = Frame { seconds: 0.0, nodes: Vec::new(), fill_rounds: None, waits: 0, unfinished: Vec::new() };
        let result = self.run(&schedule.steps, 0, &mut pending, &mut frame, pace).await;
        (result.map(|_| frame), pending)
    }

    fn start_frame(&mut self) {
        for (variable, description) in self.variables.iter_mut().zip(&self.schedule.variables) {
            if !description.history {
                *variable = 0;
            }
        }
        (self.clock, self.is_timed, self.waits) = (Clock::new(), false, 0);
        (self.is_cut, self.is_last_round) = (false, false);
        self.latest.clone_from(&self.variables);
        self.lists.clear();
        self.states.clear();
        let schedule = self.schedule.clone();
        self.copies.invalidate(|resource| matches!(schedule.resource(resource).lifetime, Lifetime::Transient));
        for node in &mut self.nodes {
            (node.gpu_ms, node.cpu_ms, node.runs) = (None, 0.0, 0);
        }
    }

    async fn collect_times(&mut self, frame: &mut Frame) -> Result<(), GpuError> {
        frame.nodes = self.nodes.clone();
        if let Some(timing) = &mut self.timing {
            timing.collect(&self.gpu).await?;
            for (node, ms) in frame.nodes.iter_mut().zip(timing.take()) {
                node.gpu_ms = Some(ms);
            }
        }
        frame.nodes = merge(std::mem::take(&mut frame.nodes));
        Ok(())
    }

    /// Runs steps whose first node has the index `first`; returns the index after the last.
    async fn run(&mut self, steps: &[Step], first: usize, pending: &mut Pending, frame: &mut Frame, pace: AskPace<'_>) -> Result<usize, GpuError> {
        let mut index = first;
        for step in steps {
            match step {
                step if self.is_left_out(step) => index += count(std::slice::from_ref(step)),
                Step::Node(node) => {
                    self.run_node(node, index, pending).await?;
                    index += 1;
                }
                Step::Repeat(repeat) => index = self.run_loop(repeat, index, pending, frame, pace).await?,
            }
        }
        Ok(index)
    }

    /// Whether a step is of no use to a frame that is run ahead.
    fn is_left_out(&self, step: &Step) -> bool {
        let (Step::Node(Node { name, .. }) | Step::Repeat(Repeat { name, .. })) = step;
        self.lapse.is_ahead && self.schedule.of_pictures.contains(name)
    }

    async fn run_loop(&mut self, repeat: &Repeat, first: usize, pending: &mut Pending, frame: &mut Frame, pace: AskPace<'_>) -> Result<usize, GpuError> {
        let outer = self.is_last_round;
        if let Some(until) = repeat.until {
            self.assign(until, 0);
            self.cut_short.remove(&until);
        }
        let rounds = match repeat.driver {
            Driver::Device { sizes } if pace() == Pace::GoOn => self.run_ahead(repeat, sizes, first, pending, pace).await?,
            // Rounds may hold loops.
            _ => Box::pin(self.run_rounds(repeat, first, pending, frame, pace)).await?,
        };
        let shortfall = self.shortfall(repeat, rounds);
        self.is_cut |= shortfall.as_ref().is_some_and(|short| short.because == Shortfall::NoProgress);
        frame.unfinished.extend(shortfall);
        self.is_last_round = outer;
        if repeat.until.is_some() {
            *frame.fill_rounds.get_or_insert(0) += rounds;
        }
        Ok(first + count(&repeat.steps))
    }

    /// Runs a loop whose first node has the index `first`, deciding on each round; how many there were.
    async fn run_rounds(&mut self, repeat: &Repeat, first: usize, pending: &mut Pending, frame: &mut Frame, pace: AskPace<'_>) -> Result<u32, GpuError> {
        // A node for the device alone.
        let skipped = usize::from(repeat.driver != Driver::Host);
        let (mut rounds, mut pacing) = (0, Rounds::default());
        while !self.is_done(repeat, rounds) && rounds < repeat.at_most {
            let is_over = match pace() {
                Pace::GoOn => false,
                Pace::Within(left) => {
                    self.is_timed = true;
                    pacing.are_over(&mut self.clock, left, &repeat.time) && self.may_end(&repeat.time, rounds)
                }
                Pace::Stop => return Err(GpuError::Interrupted),
            };
            self.is_cut |= is_over;
            self.assign(repeat.round, rounds);
            // A loop of so many rounds has nothing to leave for later ones; one with an end to reach must not.
            self.is_last_round = is_over || (repeat.until.is_some() && rounds + 1 == repeat.at_most);
            self.run(&repeat.steps[skipped..], first + skipped, pending, frame, pace).await?;
            rounds += 1;
            if is_over {
                break;
            }
        }
        Ok(rounds)
    }

    /// Whether a loop has reached its end, after so many rounds.
    pub(super) fn is_done(&self, repeat: &Repeat, rounds: u32) -> bool {
        repeat.until.map_or(rounds == repeat.at_most, |until| self.variable(until) != 0)
    }

    /// Whether a loop has made enough for the picture to be made of it, after so many rounds.
    fn may_end(&self, time: &TimeShare, rounds: u32) -> bool {
        rounds >= time.at_least && time.records.is_none_or(|records| self.variable(records) > 0)
    }

    /// Why a loop ended that was not done after so many rounds, or may not have been.
    fn shortfall(&self, repeat: &Repeat, rounds: u32) -> Option<Unfinished> {
        let is_done = self.is_done(repeat, rounds);
        let bound = if rounds < repeat.at_most { Shortfall::Time } else { Shortfall::Rounds };
        let told = repeat.until.and_then(|until| self.cut_short.get(&until).copied());
        let because = told.or_else(|| (!is_done || self.is_last_round).then_some(bound))?;
        Some(Unfinished { name: repeat.name.clone(), because, is_certain: !is_done || because == Shortfall::NoProgress })
    }

    async fn run_node(&mut self, node: &Node, index: usize, pending: &mut Pending) -> Result<(), GpuError> {
        let mut open = false;
        let mut is_idle = !node.commands.is_empty();
        for (position, command) in node.commands.iter().enumerate() {
            if self.is_made(node, index, position) {
                continue;
            }
            is_idle = false;
            if matches!(command, Command::Late(_)) && !self.is_cut {
                continue;
            }
            if let Command::Host(host) | Command::Late(host) = command {
                self.end_timing(&mut open, pending).await?;
                let start = Instant::now();
                self.run_host(host, node, pending).await?;
                self.nodes[index].cpu_ms += start.elapsed().as_secs_f64() * 1e3;
            } else {
                self.catch_up_all(command, pending);
                self.begin_timing(&mut open, index, pending).await?;
                self.encode(command, index, position, pending);
                pending.empty = false;
            }
        }
        self.nodes[index].runs += u32::from(!is_idle);
        self.end_timing(&mut open, pending).await?;
        Ok(())
    }

    /// Whether what a command makes is there as it would make it; if not, it will be.
    fn is_made(&mut self, node: &Node, index: usize, position: usize) -> bool {
        node.keys.0.get(&position).is_some_and(|key| self.made.insert((index, position), *key) == Some(*key))
    }

    pub(super) async fn begin_timing(&mut self, open: &mut bool, index: usize, pending: &mut Pending) -> Result<(), GpuError> {
        if *open {
            return Ok(());
        }
        if self.timing.as_ref().is_some_and(Timing::is_full) {
            self.submit(pending);
        }
        if let Some(timing) = &mut self.timing {
            if timing.is_full() {
                timing.collect(&self.gpu).await?;
            }
            timing.begin(&mut pending.encoder, index);
            *open = true;
        }
        Ok(())
    }

    pub(super) async fn end_timing(&mut self, open: &mut bool, pending: &mut Pending) -> Result<(), GpuError> {
        if !std::mem::replace(open, false) {
            return Ok(());
        }
        if self.timing.as_ref().is_some_and(Timing::waits) {
            self.submit(pending);
            self.gpu.wait("running a node").await?;
        }
        if let Some(timing) = &mut self.timing {
            timing.end(&mut pending.encoder);
        }
        Ok(())
    }
}

/// Nodes, those inside loops too.
fn count(steps: &[Step]) -> usize {
    steps.iter().map(|step| if let Step::Repeat(repeat) = step { count(&repeat.steps) } else { 1 }).sum()
}

/// A node in a loop may have a part before the loop: one entry for both.
fn merge(nodes: Vec<NodeTimes>) -> Vec<NodeTimes> {
    let mut merged: Vec<NodeTimes> = Vec::new();
    for node in nodes {
        match merged.iter_mut().find(|m| m.node == node.node) {
            Some(into) => {
                into.gpu_ms = into.gpu_ms.zip(node.gpu_ms).map(|(a, b)| a + b);
                into.cpu_ms += node.cpu_ms;
                into.runs = into.runs.max(node.runs);
            }
            None => merged.push(node),
        }
    }
    merged
}
