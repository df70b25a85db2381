//! Which frames are rendered, through which cameras and with which parameters.

use super::console::Console;
use super::failure::{CommandError, Failure};
use super::pipeline::{load_pipeline, plan_stage, plan_view};
use super::scene::View;
use crate::pipeline::{PerFrame, Pipeline, Plan, Problems};
use crate::scene::{Camera, Scene, animation::Moment, stage::Stage};
use crate::schedule::Device;
use clap::Args;
use std::ops::Range;
use std::sync::Arc;

#[derive(Args)]
pub struct TimelineOptions {
    /// Frames to render, half-open; frame N looks through camera N, or the last: of those that --camera names, or else of the scene's. Where the scene is
    /// animated and --camera names none, all look through its first
    #[arg(long, value_name = "A..B", value_parser = frames)]
    frames: Option<Range<u32>>,
    #[command(flatten)]
    rate: RateOptions,
    /// Changes a parameter of a node; may be repeated
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    sets: Vec<String>,
    /// Changes a parameter between frames, records stay: frame N has value N, or the last; as many frames as values, unless --frames says
    /// otherwise; may be repeated
    #[arg(long = "set-frames", value_name = "NODE.PARAM=VALUE,VALUE,…")]
    per_frame: Vec<String>,
}

#[derive(Args, Clone, Copy)]
pub struct RateOptions {
    /// How many frames of an animated scene there are in a second
    #[arg(long, value_name = "N", value_parser = rate, default_value_t = FPS)]
    fps: f64,
}

const FPS: f64 = 24.0;

impl Default for RateOptions {
    fn default() -> Self {
        Self { fps: FPS }
    }
}

impl RateOptions {
    /// When a frame is, from a beginning on [s].
    pub fn time(&self, beginning: f64, frame: u32) -> f64 {
        beginning + f64::from(frame) / self.fps
    }

    /// What is run ahead of a frame by a run with such a [window](crate::measure::run::Run::window).
    pub fn ahead(&self, beginning: f64, frame: u32, window: Option<u32>) -> Option<Ahead> {
        let frames = window?;
        let number = frame.checked_sub(1)?.checked_add(frames)?;
        Some(Ahead { number, frames, time: self.time(beginning, number) })
    }

    /// The seconds that a frame is to be seen, as numerator and denominator.
    pub fn delay(&self) -> [u16; 2] {
        let is_whole = self.fps.fract() == 0.0 && self.fps <= f64::from(u16::MAX);
        if is_whole { [1, self.fps as u16] } else { [(1000.0 / self.fps).round().clamp(1.0, f64::from(u16::MAX)) as u16, 1000] }
    }
}

/// A frame that is run for the records alone, before the pictures until then.
pub struct Ahead {
    pub number: u32,
    /// How many frames it is later than the last picture.
    pub frames: u32,
    /// [s]
    pub time: f64,
}

/// Frames in their order.
pub struct Timeline {
    pub frames: Vec<Frame>,
    /// Whether files are numbered.
    pub is_sequence: bool,
    pub rate: RateOptions,
}

impl Timeline {
    /// When a frame of a view is [s].
    pub fn time(&self, view: &View, frame: u32) -> f64 {
        self.rate.time(view.moment, frame)
    }
}

pub struct Frame {
    pub number: u32,
    /// `NODE.PARAM=VALUE`
    pub sets: Vec<String>,
}

impl TimelineOptions {
    /// The frames that the options ask for; `cameras` were named, of which several are a timeline.
    pub fn timeline(&self, cameras: usize) -> Result<Timeline, Failure> {
        let per_frame = self.per_frame.iter().map(|text| PerFrame::parse(text)).collect::<Result<Vec<_>, _>>().map_err(Failure::input)?;
        // One camera is a view; one value is a sequence of one frame.
        let most = per_frame.iter().map(PerFrame::frames).chain((cameras > 1).then_some(cameras)).max();
        let range = self.frames.clone().or(most.map(|most| 0..most as u32));
        let is_sequence = range.is_some();
        let frame = |number| Frame { number, sets: self.sets.iter().cloned().chain(per_frame.iter().map(|p| p.set(number))).collect() };
        Ok(Timeline { frames: range.unwrap_or(0..1).map(frame).collect(), is_sequence, rate: self.rate })
    }
}

/// The plans of a timeline, for the scene as it is: one for all frames whose parameters are the same.
pub struct Plans<'o> {
    plans: Vec<Planned>,
    device: Device,
    dumps: &'o [String],
    console: &'o Console,
}

struct Planned {
    sets: Vec<String>,
    pipeline: Pipeline,
    /// None where the scene has changed since.
    plan: Option<Arc<Plan>>,
}

impl<'o> Plans<'o> {
    /// Plans every frame; all must be able to share memory and shaders, so that the records of one are there for the next.
    pub fn of(pipeline: &str, timeline: &Timeline, view: &View, device: Device, dumps: &'o [String], console: &'o Console) -> Result<Self, Failure> {
        let mut plans: Vec<Planned> = Vec::new();
        for frame in &timeline.frames {
            if plans.iter().any(|planned| planned.sets == frame.sets) {
                continue;
            }
            let pipeline = load_pipeline(pipeline, &frame.sets)?;
            let plan = plan_view(&pipeline, view, device, dumps, console).map_err(Failure::input)?;
            let first = plans.first().and_then(|planned| planned.plan.as_ref());
            if let Some(what) = first.and_then(|first| first.schedule.difference(&plan.schedule)) {
                return Err(Failure::input(CommandError::OtherPlan { frame: frame.number, sets: frame.sets.join(" "), what }));
            }
            plans.push(Planned { sets: frame.sets.clone(), pipeline, plan: Some(plan) });
        }
        Ok(Self { plans, device, dumps, console })
    }

    /// The scene is another from now on.
    pub fn forget(&mut self) {
        self.plans.iter_mut().for_each(|planned| planned.plan = None);
    }

    /// The plan of a frame of the timeline for a scene as it is now.
    pub fn of_frame(&mut self, frame: &Frame, stage: &Stage, size: [u32; 2]) -> Result<Arc<Plan>, Problems> {
        let number = self.plans.iter().position(|planned| planned.sets == frame.sets).unwrap_or(0);
        let Planned { pipeline, plan, .. } = &mut self.plans[number];
        if let Some(plan) = plan {
            return Ok(plan.clone());
        }
        Ok(plan.insert(plan_stage(pipeline, stage, size, self.device, self.dumps, self.console)?).clone())
    }
}

/// The camera of a frame as it is then: its own, or the last; of an animated scene, the first unless some were named.
pub fn camera_of_frame(view: &View, (frame, moment): (&Frame, &Moment<'_>), scene: &Scene) -> Camera {
    moment.camera(scene, still_camera(view, frame))
}

/// The same as it is at the view's own moment.
pub fn still_camera<'v>(view: &'v View, frame: &Frame) -> &'v Camera {
    let is_cut = view.animation().is_empty() || view.are_named;
    let number = if is_cut { frame.number as usize } else { 0 };
    view.cameras.get(number).or(view.cameras.last()).unwrap_or(&view.camera)
}

fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate: &f64| rate.is_finite() && *rate > 0.0);
    rate.ok_or_else(|| "expected a number of frames above 0, such as 25".to_owned())
}

pub fn frames(text: &str) -> Result<Range<u32>, String> {
    let range = text.split_once("..").and_then(|(a, b)| Some(a.parse().ok()?..b.parse().ok()?));
    range.filter(|r: &Range<u32>| r.start < r.end && r.end - r.start <= 100_000).ok_or_else(|| "expected A..B with A < B, such as 0..4".to_owned())
}
