//! Which frames are rendered, through which cameras and with which parameters.

use super::console::Console;
use super::failure::{CommandError, Failure};
use super::pipeline::{load_pipeline, plan_view};
use super::scene::View;
use crate::pipeline::{PerFrame, Plan};
use crate::scene::Camera;
use crate::schedule::Device;
use clap::Args;
use std::ops::Range;
use std::sync::Arc;

#[derive(Args)]
pub struct TimelineOptions {
    /// Frames to render, half-open; frame N looks through camera N, or the last: of those that --camera names, or else of the scene's
    #[arg(long, value_name = "A..B", value_parser = frames)]
    frames: Option<Range<u32>>,
    /// Changes a parameter of a node; may be repeated
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    sets: Vec<String>,
    /// Changes a parameter between frames, records stay: frame N has value N, or the last; as many frames as values, unless --frames says
    /// otherwise; may be repeated
    #[arg(long = "set-frames", value_name = "NODE.PARAM=VALUE,VALUE,…")]
    per_frame: Vec<String>,
}

/// Frames in their order.
pub struct Timeline {
    pub frames: Vec<Frame>,
    /// Whether files are numbered.
    pub is_sequence: bool,
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
        Ok(Timeline { frames: range.unwrap_or(0..1).map(frame).collect(), is_sequence })
    }
}

/// The plans of a timeline: one for all frames whose parameters are the same.
pub struct Plans {
    plans: Vec<(Vec<String>, Arc<Plan>)>,
}

impl Plans {
    /// Plans every frame; all must be able to share memory and shaders, so that the records of one are there for the next.
    pub fn of(pipeline: &str, timeline: &Timeline, view: &View, device: Device, dumps: &[String], console: &Console) -> Result<Self, Failure> {
        let mut plans: Vec<(Vec<String>, Arc<Plan>)> = Vec::new();
        for frame in &timeline.frames {
            if plans.iter().any(|(sets, _)| *sets == frame.sets) {
                continue;
            }
            let plan = plan_view(&load_pipeline(pipeline, &frame.sets)?, view, device, dumps, console).map_err(Failure::input)?;
            if let Some(what) = plans.first().and_then(|(_, first)| first.schedule.difference(&plan.schedule)) {
                return Err(Failure::input(CommandError::OtherPlan { frame: frame.number, sets: frame.sets.join(" "), what }));
            }
            plans.push((frame.sets.clone(), plan));
        }
        Ok(Self { plans })
    }

    /// The plan of the first frame.
    pub fn first(&self) -> &Arc<Plan> {
        &self.plans[0].1
    }

    /// The plan of a frame of the timeline.
    pub fn of_frame(&self, frame: &Frame) -> &Arc<Plan> {
        self.plans.iter().find(|(sets, _)| *sets == frame.sets).map_or(self.first(), |(_, plan)| plan)
    }
}

/// The camera of a frame: its own, or the last.
pub fn camera_of_frame<'v>(view: &'v View, frame: &Frame) -> &'v Camera {
    view.cameras.get(frame.number as usize).or(view.cameras.last()).unwrap_or(&view.camera)
}

fn frames(text: &str) -> Result<Range<u32>, String> {
    let range = text.split_once("..").and_then(|(a, b)| Some(a.parse().ok()?..b.parse().ok()?));
    range.filter(|r: &Range<u32>| r.start < r.end && r.end - r.start <= 100_000).ok_or_else(|| "expected A..B with A < B, such as 0..4".to_owned())
}
