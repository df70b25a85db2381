//! Animations: how nodes move, and how far meshes go toward their morph targets. All of a file play at once, as far as they move different things; of those that do not, the first.

use super::{Reader, node_map};
use crate::{
    math::curve::{Between, Curve, Value},
    scene::animation::{Placement, Rotation},
};
use ::gltf::{Accessor, Document};
use glam::{DMat4, DQuat, DVec3};
use serde_json::Value as Json;
use std::collections::HashMap;

/// What is told of those that are.
pub(super) const BROKEN: &str = "animations that break the rules of glTF";

/// What of a node an animation moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Path {
    Translation,
    Rotation,
    Scale,
    Weights,
}

/// How one thing of a node moves.
#[derive(Debug)]
struct Channel {
    node: usize,
    path: Path,
    /// Numbers of accessors.
    times: usize,
    values: usize,
    interpolation: Interpolation,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Interpolation {
    Step,
    Linear,
    Cubic,
}

/// What a file says of how its nodes move.
#[derive(Debug, Default)]
pub(super) struct Animations {
    channels: Vec<Channel>,
    /// What is met and left out, and how often.
    unread: Vec<&'static str>,
}

impl Animations {
    /// Takes them as far as they say anything of nodes.
    pub fn of(animations: &Json) -> Self {
        let mut all = Self::default();
        for animation in animations.as_array().into_iter().flatten() {
            let before = all.channels.len();
            for channel in animation["channels"].as_array().into_iter().flatten() {
                match Channel::of(channel, &animation["samplers"]) {
                    Ok(channel) if all.channels[..before].iter().any(|other| (other.node, other.path) == (channel.node, channel.path)) => {
                        all.unread.push("animations of what another moves");
                    }
                    Ok(channel) => all.channels.push(channel),
                    Err(what) => all.unread.push(what),
                }
            }
        }
        all
    }
}

impl Channel {
    fn of(channel: &Json, samplers: &Json) -> Result<Self, &'static str> {
        let number = |value: &Json| value.as_u64().and_then(|number| usize::try_from(number).ok()).ok_or(BROKEN);
        let path = match channel["target"]["path"].as_str() {
            Some("translation") => Path::Translation,
            Some("rotation") => Path::Rotation,
            Some("scale") => Path::Scale,
            Some("weights") => Path::Weights,
            Some("pointer") => return Err("animations of what is no node"),
            _ => return Err(BROKEN),
        };
        let sampler = samplers.get(number(&channel["sampler"])?).ok_or(BROKEN)?;
        let interpolation = match sampler["interpolation"].as_str().unwrap_or("LINEAR") {
            "STEP" => Interpolation::Step,
            "LINEAR" => Interpolation::Linear,
            "CUBICSPLINE" => Interpolation::Cubic,
            _ => return Err(BROKEN),
        };
        Ok(Self { node: number(&channel["target"]["node"])?, path, times: number(&sampler["input"])?, values: number(&sampler["output"])?, interpolation })
    }
}

/// How a node moves, as far as it does.
#[derive(Default)]
pub(super) struct Track {
    translation: Option<Curve<DVec3>>,
    rotation: Option<Curve<DQuat>>,
    scale: Option<Curve<DVec3>>,
}

/// How far a mesh goes toward its targets, all of them key by key.
pub(super) struct Weights {
    times: Vec<f64>,
    pub values: Vec<f64>,
    interpolation: Interpolation,
}

impl Weights {
    /// Numbers of each target: a key of a cubic curve has three.
    pub fn numbers_each(&self) -> usize {
        if self.interpolation == Interpolation::Cubic { 3 * self.times.len() } else { self.times.len() }
    }

    /// Those of each of so many targets. None of another number, and none inside where the keys make no sense.
    pub fn curves(&self, targets: usize) -> Option<Option<Vec<Curve<f64>>>> {
        if Some(self.values.len()) != self.numbers_each().checked_mul(targets) {
            return None;
        }
        let of_target = |target: usize| self.values.iter().skip(target).step_by(targets).copied().collect();
        Some((0..targets).map(|target| curve(self.times.clone(), of_target(target), self.interpolation)).collect())
    }
}

/// A curve of what a file has for its keys; None where that makes no sense.
fn curve<V: Value + Finite>(times: Vec<f64>, values: Vec<V>, interpolation: Interpolation) -> Option<Curve<V>> {
    if !values.iter().all(Finite::is_finite) {
        return None;
    }
    if interpolation != Interpolation::Cubic {
        let between = if interpolation == Interpolation::Step { Between::Step } else { Between::Linear };
        return Curve::new(times, values.into_iter().map(Finite::unit).collect(), between);
    }
    // Each key has three: the rate before it, its own value, the rate after it.
    let keys = values.as_chunks::<3>().0;
    Curve::new(times, keys.iter().map(|key| key[1].unit()).collect(), Between::Cubic(keys.iter().map(|key| [key[0], key[2]]).collect()))
}

impl Reader<'_> {
    /// How nodes move, by their numbers. Channels that cannot be read are left out, and noted.
    pub(super) fn tracks(&mut self, document: &Document, animations: Animations) -> HashMap<usize, Track> {
        animations.unread.into_iter().for_each(|what| self.ignore(what));
        let accessors: Vec<Accessor> = document.accessors().collect();
        let mut tracks: HashMap<usize, Track> = HashMap::new();
        for channel in animations.channels {
            let mut unmoved = Track::default();
            let track = if channel.path == Path::Weights { &mut unmoved } else { tracks.entry(channel.node).or_default() };
            let vector = |[x, y, z]: [f32; 3]| DVec3::new(x.into(), y.into(), z.into());
            let read = match channel.path {
                Path::Translation => self.curve(&accessors, &channel, vector).map(|curve| track.translation = Some(curve)),
                Path::Scale => self.curve(&accessors, &channel, vector).map(|curve| track.scale = Some(curve)),
                Path::Weights => self.read_weights(&accessors, &channel).map(|weights| drop(self.weights.insert(channel.node, weights))),
                Path::Rotation => {
                    self.curve(&accessors, &channel, |turn: [f32; 4]| DQuat::from_array(turn.map(f64::from))).map(|curve| track.rotation = Some(curve))
                }
            };
            if read.is_none() {
                self.ignore(BROKEN);
            }
        }
        tracks
    }

    fn curve<const N: usize, V: Value + Finite>(&self, accessors: &[Accessor], channel: &Channel, value: impl Fn([f32; N]) -> V) -> Option<Curve<V>> {
        let values = self.read_vectors::<N>(accessors.get(channel.values)?).ok()?.into_iter().map(value).collect();
        curve(self.numbers(accessors, channel.times)?, values, channel.interpolation)
    }

    fn read_weights(&self, accessors: &[Accessor], channel: &Channel) -> Option<Weights> {
        let (times, values) = (self.numbers(accessors, channel.times)?, self.numbers(accessors, channel.values)?);
        Some(Weights { times, values, interpolation: channel.interpolation })
    }

    fn numbers(&self, accessors: &[Accessor], accessor: usize) -> Option<Vec<f64>> {
        Some(self.read_vectors::<1>(accessors.get(accessor)?).ok()?.into_iter().map(|[number]| f64::from(number)).collect())
    }

    /// Where a node is, under where its parent is; what moves from here on moves with it, if it moves.
    pub(super) fn place_node(&mut self, node: &::gltf::Node, parent: &DMat4, track: Option<Track>) -> DMat4 {
        let Some(track) = track else { return *parent * node_map(node) };
        let (scale, turn, translation) = node_map(node).to_scale_rotation_translation();
        let placement = Placement {
            scale: track.scale.unwrap_or(Curve::constant(scale)),
            rotation: Rotation::Free(track.rotation.unwrap_or(Curve::constant(turn))),
            translation: track.translation.unwrap_or(Curve::constant(translation)),
        };
        self.draft.place(|| node.name().map_or_else(|| format!("node {}", node.index()), str::to_owned), parent, placement)
    }
}

/// Values that files have.
trait Finite: Copy {
    fn is_finite(&self) -> bool;
    /// As a key has it: turns are of unit length.
    fn unit(self) -> Self;
}

impl Finite for f64 {
    fn is_finite(&self) -> bool {
        f64::is_finite(*self)
    }

    fn unit(self) -> Self {
        self
    }
}

impl Finite for DVec3 {
    fn is_finite(&self) -> bool {
        DVec3::is_finite(*self)
    }

    fn unit(self) -> Self {
        self
    }
}

impl Finite for DQuat {
    fn is_finite(&self) -> bool {
        DQuat::is_finite(*self)
    }

    /// A quaternion of no length turns nothing.
    fn unit(self) -> Self {
        if self.length_squared() > 0.0 { self.normalize() } else { Self::IDENTITY }
    }
}
