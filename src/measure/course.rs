//! How a sequence of pictures differs from the truth in time: flicker, and what is left of light that has changed.
//!
//! All of it is measured over blocks, as `block_p50` is: what the truth's own noise adds to a block is small beside what people see flicker.

use super::layers::Layers;
use super::metrics::{Block, Errors, MetricsError, Selected, blocks};
use super::statistics::quantile;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A block has jumped where the truth changes by more than this share of its light, before or after, within a frame.
const JUMP: f64 = 0.5;
/// What a block has jumped to is there where its error is less than this share of the larger of its light before and after.
const SETTLED: f64 = 0.05;
/// Blocks darker than this share of the frame's mean, before and after, do not jump.
const DARK: f64 = 0.02;
/// Frames after a jump by which what is left of it counts as a ghost.
const GHOST_AFTER: usize = 5;

/// What a frame of a sequence was, of one layer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FrameErrors {
    /// See [`Errors`]; null of a frame without light.
    pub rmse_over_mean: Option<f64>,
    /// See [`Errors`].
    pub bias_over_mean: Option<f64>,
    /// See [`Errors`].
    pub block_p50: Option<f64>,
    /// See [`Errors`].
    pub block_p99: Option<f64>,
    /// As [`Course::flicker`], of this frame and the one before; null of the first.
    pub flicker: Option<f64>,
}

/// How one layer of a sequence differs from the truth in time. Keys in JSON are the fields' names.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Course {
    /// In their order.
    pub frames: Vec<FrameErrors>,
    /// Means over all frames.
    pub mean: FrameErrors,
    /// sqrt(mean(((x − x') − (r − r'))²)) over blocks and frames, over the mean of r: x is what a block has, r what it should have, x' and r' in the frame before.
    /// Null of one frame.
    pub flicker: Option<f64>,
    /// How often a block's true light has jumped.
    pub jumps: usize,
    /// Frames after a jump until a block is as bright as it should be, within 5 %: 0 where it is so at once. The median, where half of the blocks that have jumped came so
    /// far before the end.
    pub lag_p50: Option<f64>,
    /// The same of 99 %.
    pub lag_p99: Option<f64>,
    /// The 99th percentile of |x − r| over the frame's mean of r, five frames after a jump, where there was none meanwhile.
    pub ghost_p99: Option<f64>,
}

impl Course {
    /// What it tells of time, to be put behind an error.
    pub fn told(&self) -> String {
        let share = |name: &str, share: Option<f64>| share.map_or(String::new(), |share| format!(", {name} {:.2} %", 100.0 * share));
        let lag = self.lag_p99.map(|lag| lag.to_string()).filter(|_| self.jumps > 0);
        let lag = lag.map_or(String::new(), |lag| format!(", lag_p99 {lag}"));
        [share("flicker", self.flicker), lag, share("ghost_p99", self.ghost_p99)].concat()
    }
}

/// Frames as they come.
#[derive(Default)]
pub struct Watch {
    frames: Vec<FrameErrors>,
    before: BTreeMap<usize, Block>,
    changes: Changes,
    jumps: Jumps,
}

/// Sums over blocks that two frames share.
#[derive(Default, Clone, Copy)]
struct Changes {
    squares: f64,
    light: f64,
    count: f64,
}

impl Changes {
    fn between(before: &BTreeMap<usize, Block>, now: &BTreeMap<usize, Block>) -> Self {
        now.iter().filter_map(|(at, now)| Some((before.get(at)?, now))).fold(Self::default(), |sum, (before, now)| Self {
            squares: sum.squares + ((now.x - before.x) - (now.r - before.r)).powi(2),
            light: sum.light + now.r,
            count: sum.count + 1.0,
        })
    }

    fn and(self, other: Self) -> Self {
        Self { squares: self.squares + other.squares, light: self.light + other.light, count: self.count + other.count }
    }

    /// The root of the mean square, over the mean of the light.
    fn root(&self) -> Option<f64> {
        (self.light > 0.0).then(|| (self.squares * self.count).sqrt() / self.light)
    }
}

/// A block's last jump.
struct Jump {
    /// In which it jumped.
    frame: usize,
    /// Of its light before and after.
    larger: f64,
    /// Whether it is not there yet.
    is_open: bool,
}

/// Blocks that have jumped.
#[derive(Default)]
struct Jumps {
    /// Of each of them: one that jumps again has another aim.
    last: BTreeMap<usize, Jump>,
    /// Frames that each jump took whose block came there.
    lags: Vec<f64>,
    ghosts: Vec<f64>,
    count: usize,
}

impl Jumps {
    fn see(&mut self, frame: usize, before: &BTreeMap<usize, Block>, now: &BTreeMap<usize, Block>) {
        let mean = now.values().map(|block| block.r).sum::<f64>() / now.len().max(1) as f64;
        for (at, block) in now {
            let Some(before) = before.get(at).map(|before| before.r) else { continue };
            let larger = before.max(block.r);
            if (block.r - before).abs() > JUMP * larger && larger > DARK * mean {
                self.last.insert(*at, Jump { frame, larger, is_open: true });
                self.count += 1;
            }
        }
        for (at, jump) in &mut self.last {
            let Some(error) = now.get(at).map(|block| (block.x - block.r).abs()) else { continue };
            if jump.is_open && error <= SETTLED * jump.larger {
                self.lags.push((frame - jump.frame) as f64);
                jump.is_open = false;
            }
            if frame - jump.frame == GHOST_AFTER && mean > 0.0 {
                self.ghosts.push(error / mean);
            }
        }
    }

    /// A quantile of the lags, those that are open taken for longer than any.
    fn lag(&self, share: f64) -> Option<f64> {
        let mut all: Vec<f64> = self.lags.iter().copied().chain(self.last.values().filter(|jump| jump.is_open).map(|_| f64::INFINITY)).collect();
        all.sort_by(f64::total_cmp);
        // No value between two is asked for: frames are whole.
        all.get(((share * all.len() as f64).ceil() as usize).clamp(1, all.len().max(1)) - 1).copied().filter(|lag| lag.is_finite())
    }

    fn ghost(&self, share: f64) -> Option<f64> {
        let mut all = self.ghosts.clone();
        all.sort_by(f64::total_cmp);
        quantile(&all, share)
    }
}

impl Watch {
    /// Takes the next frame: its errors, if it has light to tell them by, and its layer beside the true one.
    ///
    /// # Errors
    /// As [`compare`](super::metrics::compare), but for what is dark.
    pub fn see(&mut self, layer: &str, picture: &Layers, truth: &Layers, errors: Option<&Errors>) -> Result<(), MetricsError> {
        let now = blocks(Selected { picture, layer }, Selected { picture: truth, layer })?;
        self.take(now.into_iter().map(|block| (block.at, block)).collect(), errors);
        Ok(())
    }

    fn take(&mut self, now: BTreeMap<usize, Block>, errors: Option<&Errors>) {
        let frame = self.frames.len();
        let changes = Changes::between(&self.before, &now);
        if frame > 0 {
            self.changes = self.changes.and(changes);
            self.jumps.see(frame, &self.before, &now);
        }
        self.frames.push(FrameErrors {
            rmse_over_mean: errors.map(|errors| errors.rmse_over_mean),
            bias_over_mean: errors.map(|errors| errors.bias_over_mean),
            block_p50: errors.and_then(|errors| errors.block_p50),
            block_p99: errors.and_then(|errors| errors.block_p99),
            flicker: changes.root(),
        });
        self.before = now;
    }

    /// What it has seen; None before the first frame.
    pub fn course(self) -> Option<Course> {
        let Self { frames, changes, jumps, .. } = self;
        frames.first()?;
        let mean = |value: &dyn Fn(&FrameErrors) -> Option<f64>| {
            let all: Vec<f64> = frames.iter().filter_map(value).collect();
            (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
        };
        Some(Course {
            mean: FrameErrors {
                rmse_over_mean: mean(&|frame| frame.rmse_over_mean),
                bias_over_mean: mean(&|frame| frame.bias_over_mean),
                block_p50: mean(&|frame| frame.block_p50),
                block_p99: mean(&|frame| frame.block_p99),
                flicker: mean(&|frame| frame.flicker),
            },
            flicker: changes.root(),
            jumps: jumps.count,
            lag_p50: jumps.lag(0.5),
            lag_p99: jumps.lag(0.99),
            ghost_p99: jumps.ghost(0.99),
            frames,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::layers::{IRRADIANCE, Layer};
    use super::super::metrics::compare;
    use super::*;

    const SIZE: [u32; 2] = [64, 64];

    fn picture(light: impl Fn(usize) -> f32) -> Layers {
        Layers::new(SIZE[0], SIZE[1]).with(IRRADIANCE, Layer::value((0..64 * 64).map(light).collect()))
    }

    /// Of so many frames, each a picture and its truth by the frame's number.
    fn course(frames: usize, x: impl Fn(usize, usize) -> f32, r: impl Fn(usize, usize) -> f32) -> Course {
        let mut watch = Watch::default();
        for frame in 0..frames {
            let (picture, truth) = (picture(|at| x(frame, at)), picture(|at| r(frame, at)));
            let errors = compare(&picture, &truth, IRRADIANCE, None).ok();
            watch.see(IRRADIANCE, &picture, &truth, errors.as_ref()).unwrap();
        }
        watch.course().unwrap()
    }

    #[test]
    fn what_is_wrong_alike_in_each_frame_does_not_flicker() {
        let swell = |frame: usize, _: usize| 1.0 + 0.1 * (frame % 3) as f32;
        let still = course(6, |frame, at| swell(frame, at) + 0.2, swell);
        assert!(still.flicker.unwrap() < 1e-6 && (still.mean.bias_over_mean.unwrap() - 0.2 / 1.1).abs() < 1e-2, "{still:?}");
        assert_eq!((still.jumps, still.lag_p50, still.ghost_p99), (0, None, None));
    }

    /// Up and down by a tenth: a change of a fifth in each frame after the first, which the truth does not have.
    #[test]
    fn what_goes_up_and_down_flickers() {
        let shaken = course(5, |frame, _| if frame % 2 == 0 { 0.9 } else { 1.1 }, |_, _| 1.0);
        assert!((shaken.flicker.unwrap() - 0.2).abs() < 1e-6);
        assert_eq!((shaken.frames[0].flicker, shaken.frames.len()), (None, 5));
        assert!((shaken.mean.flicker.unwrap() - 0.2).abs() < 1e-6);
    }

    /// A lamp goes on in frame 2; the left half of the picture shows it three frames later, the right half never does.
    #[test]
    fn light_that_comes_late_is_told() {
        let truth = |frame: usize, _: usize| if frame < 2 { 1.0 } else { 4.0 };
        let late = |frame: usize, at: usize| if frame < 5 || at % 64 >= 32 { 1.0 } else { 4.0 };
        let late = course(12, late, truth);
        assert_eq!((late.jumps, late.lag_p50, late.lag_p99), (32 * 32, Some(3.0), None));
        assert!((late.ghost_p99.unwrap() - 0.75).abs() < 1e-6);
        let prompt = course(12, truth, truth);
        assert_eq!((prompt.lag_p50, prompt.lag_p99, prompt.ghost_p99), (Some(0.0), Some(0.0), Some(0.0)));
    }

    /// A frame in which no light is has no errors, and light that comes after it has jumped.
    #[test]
    fn dark_frames_are_no_end() {
        let truth = |frame: usize, _: usize| if (2..4).contains(&frame) { 0.0 } else { 2.0 };
        let seen = |frame: usize, at: usize| if frame == 4 { 1.0 } else { truth(frame, at) };
        let through = |layers: fn(Layers) -> Layers| {
            let mut watch = Watch::default();
            for frame in 0..12 {
                let (picture, truth) = (layers(picture(|at| seen(frame, at))), layers(picture(|at| truth(frame, at))));
                let errors = compare(&picture, &truth, IRRADIANCE, None).ok();
                watch.see(IRRADIANCE, &picture, &truth, errors.as_ref()).unwrap();
            }
            watch.course().unwrap()
        };
        let course = through(|picture| {
            let depth = vec![1.0; 64 * 64];
            picture.with("depth", Layer::value(depth))
        });
        let known: Vec<_> = course.frames.iter().map(|frame| frame.rmse_over_mean.is_some()).collect();
        assert_eq!(known, [true, true, false, false, true, true, true, true, true, true, true, true]);
        assert_eq!((course.jumps, course.lag_p50), (2 * 32 * 32, Some(0.0)));
        assert_eq!((course.lag_p99, course.ghost_p99), (Some(1.0), Some(0.0)));
        assert!(course.mean.rmse_over_mean.is_some() && course.flicker.is_some());
        // Where nothing tells surfaces from the sky, dark ones are none, and nothing jumps.
        let course = through(|picture| picture);
        assert_eq!((course.jumps, course.frames.len(), course.flicker.is_some()), (0, 12, true));
    }

    /// A block that jumps back before it was there has jumped twice, and no more than once late.
    #[test]
    fn blocks_that_jump_again_have_another_aim() {
        let flash = |frame: usize, _: usize| if frame == 2 { 4.0 } else { 1.0 };
        let blind = course(10, |_, _| 1.0, flash);
        assert_eq!((blind.jumps, blind.lag_p99), (2 * 32 * 32, Some(0.0)));
    }
}
