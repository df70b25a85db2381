//! The frames of a sequence, as `compare` has every variant render them; a picture is a sequence of one.

use super::console::Console;
use super::failure::Failure;
use super::pipeline::plan_stage;
use super::scene::View;
use super::timeline::{Ahead, RateOptions, frames};
use super::truth::Truth;
use crate::gpu::{AskPace, block_on, expected_device};
use crate::measure::Layers;
use crate::measure::compare::{Script, VariantErrors, judged};
use crate::measure::course::{Course, Watch};
use crate::measure::page::Moment;
use crate::measure::run::{ChangeError, Run};
use crate::pipeline::Pipeline;
use crate::scene::Camera;
use clap::Args;
use std::collections::BTreeMap;
use std::ops::Range;

#[derive(Args)]
pub struct SequenceOptions {
    /// Measure sequences of an animated scene, half-open: a run is all of their frames, from empty caches. Errors are told over all frames, and in time
    #[arg(long, value_name = "A..B", value_parser = frames)]
    frames: Option<Range<u32>>,
    #[command(flatten)]
    rate: RateOptions,
}

/// The frames of a run.
pub struct Sequence {
    /// Of files and tables; none of one picture.
    pub numbers: Vec<u32>,
    /// When each of them is [s]; never empty.
    pub moments: Vec<f64>,
    rate: RateOptions,
    /// When frame 0 is [s].
    beginning: f64,
}

impl SequenceOptions {
    /// One picture.
    pub fn none() -> Self {
        Self { frames: None, rate: RateOptions::default() }
    }

    pub fn of(&self, view: &View, console: &Console) -> Sequence {
        let (rate, beginning) = (self.rate, view.moment);
        let Some(range) = &self.frames else { return Sequence { numbers: Vec::new(), moments: vec![beginning], rate, beginning } };
        if view.animation().is_empty() {
            console.note("note: nothing in the scene moves: all frames show the same");
        }
        let moments = range.clone().map(|frame| rate.time(beginning, frame)).collect();
        Sequence { numbers: range.clone().collect(), moments, rate, beginning }
    }
}

impl Sequence {
    /// Whether it is one, and not a picture.
    pub fn is_sequence(&self) -> bool {
        !self.numbers.is_empty()
    }

    pub fn last(&self) -> usize {
        self.moments.len() - 1
    }

    /// What is run ahead before a frame, counted from the first, by a run with such a window.
    fn ahead(&self, frame: usize, window: Option<u32>) -> Option<Ahead> {
        self.rate.ahead(self.beginning, *self.numbers.get(frame)?, window)
    }

    /// Of a frame, counted from the first; None of one picture.
    pub fn moment(&self, frame: usize) -> Option<Moment> {
        Some(Moment { frame: *self.numbers.get(frame)?, seconds: self.moments[frame] })
    }
}

/// A pipeline as it is led through a sequence.
pub struct Reel<'s> {
    sequence: &'s Sequence,
    pipeline: &'s Pipeline,
    /// At any moment.
    camera: Camera,
    size: [u32; 2],
    console: &'s Console,
}

impl<'s> Reel<'s> {
    pub fn new(sequence: &'s Sequence, pipeline: &'s Pipeline, view: &View, console: &'s Console) -> Self {
        Self { sequence, pipeline, camera: view.camera.clone(), size: view.size, console }
    }
}

impl Script for Reel<'_> {
    type Error = ChangeError;

    fn frames(&self) -> usize {
        self.sequence.moments.len()
    }

    fn bring(&mut self, frame: usize, run: &mut Run, pace: AskPace<'_>) -> Result<(), ChangeError> {
        if let Some(ahead) = self.sequence.ahead(frame, run.window())
            && self.go(ahead.time, run)?
        {
            block_on(run.look_ahead(ahead.frames, pace))?;
        }
        self.go(self.sequence.moments[frame], run)?;
        Ok(())
    }
}

impl Reel<'_> {
    /// Brings the scene and the camera to a time [s]; whether that changed the scene.
    fn go(&self, time: f64, run: &mut Run) -> Result<bool, ChangeError> {
        let (changes, camera) = {
            let stage = run.stage();
            let now = stage.scene.animation.at(time);
            (stage.changes_to(&now), now.camera(&stage.scene, &self.camera))
        };
        if !changes.is_empty() {
            block_on(run.renew(&changes, |run| plan_stage(self.pipeline, run.stage(), self.size, expected_device(), &[], self.console)))?;
        }
        run.set_camera(&camera);
        Ok(!changes.is_empty())
    }
}

/// What is seen of a variant in time, by layer.
#[derive(Default)]
pub struct Watches(BTreeMap<&'static str, Watch>);

impl Watches {
    /// Takes the next frame, with its errors.
    pub fn see(&mut self, picture: &Layers, truth: &Truth, errors: &VariantErrors) -> Result<(), Failure> {
        let both = |layer: &str| judged(picture).any(|judged| judged == layer) && truth.picture().layers.contains_key(layer);
        for (layer, errors) in errors.layers().into_iter().filter(|(layer, _)| both(layer)) {
            self.0.entry(layer).or_default().see(layer, picture, truth.picture(), errors).map_err(|error| truth.refuse(error))?;
        }
        Ok(())
    }

    pub fn courses(self) -> BTreeMap<String, Course> {
        self.0.into_iter().filter_map(|(layer, watch)| Some((layer.to_owned(), watch.course()?))).collect()
    }
}
