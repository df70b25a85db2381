//! What of a scene is otherwise at other times: where its objects, lights and cameras are, and how strong its lights and emitters shine.

use super::{
    Camera, FieldOfView, Light, LightKind, Material, Object, Scene, Triangle,
    shape::{Shape, Vertex},
    stage::{Change, Pose},
};
use crate::math::curve::{Curve, Value};
use glam::{DAffine3, DMat4, DQuat, DVec3};
use std::{ops::Range, sync::Arc};

/// A place that moves, on another that may move, too.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    pub name: String,
    /// From its coordinates to the world's, as its geometry is read.
    pub rest: DMat4,
    /// The one that it stands on, which comes before it.
    pub parent: Option<usize>,
    /// From that one's coordinates, or else the world's, to those in which it moves.
    pub stand: DMat4,
    pub placement: Placement,
}

/// How a place lies on what it stands on, at all times: scaled, then turned, then moved.
#[derive(Debug, Clone)]
pub(crate) struct Placement {
    pub scale: Curve<DVec3>,
    pub rotation: Rotation,
    pub translation: Curve<DVec3>,
}

/// How a place turns.
#[derive(Debug, Clone)]
pub(crate) enum Rotation {
    Free(Curve<DQuat>),
    /// Around an axis of unit length [radians].
    Around(DVec3, Curve<f64>),
}

impl Rotation {
    pub fn at(&self, time: f64) -> DQuat {
        match self {
            Self::Free(curve) => curve.at(time),
            Self::Around(axis, angle) => DQuat::from_axis_angle(*axis, angle.at(time)),
        }
    }

    pub fn moves(&self) -> bool {
        match self {
            Self::Free(curve) => !curve.is_constant(),
            Self::Around(_, angle) => !angle.is_constant(),
        }
    }

    fn end(&self) -> f64 {
        match self {
            Self::Free(curve) => curve.end(),
            Self::Around(_, angle) => angle.end(),
        }
    }
}

impl Placement {
    /// Whether it is otherwise at other times.
    pub fn moves(&self) -> bool {
        moves(&[&self.scale, &self.translation]) || self.rotation.moves()
    }

    fn at(&self, time: f64) -> DMat4 {
        self.scaled(self.scale.at(time), time)
    }

    /// As geometry is read: as it is at the beginning, but what is small then keeps its digits.
    pub fn at_rest(&self) -> DMat4 {
        let larger = |a: DVec3, b: DVec3| DVec3::select(a.abs().cmplt(b.abs()), b, a);
        let (scale, largest) = (self.scale.at(0.0), self.scale.values().iter().copied().fold(DVec3::ZERO, larger));
        self.scaled(DVec3::select(scale.abs().cmplt(0.1 * largest.abs()), largest, scale), 0.0)
    }

    fn scaled(&self, scale: DVec3, time: f64) -> DMat4 {
        DMat4::from_scale_rotation_translation(scale, self.rotation.at(time), self.translation.at(time))
    }

    fn end(&self) -> f64 {
        self.translation.end().max(self.rotation.end()).max(self.scale.end())
    }
}

/// A place on a node, or in the world where there is none, whose coordinates this map brings its own to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Post {
    pub on: Option<usize>,
    pub map: DMat4,
}

impl Post {
    /// From its coordinates to the world's, when nodes stand so.
    pub fn map_in(&self, worlds: &[DMat4]) -> DMat4 {
        self.on.map_or(self.map, |node| worlds[node] * self.map)
    }
}

/// Where a light or a camera is, and where it looks.
#[derive(Debug, Clone)]
pub(crate) enum Stand {
    /// In its own coordinates it looks along −z, +y is up.
    On(Post),
    Free {
        at: Curve<DVec3>,
        look: Look,
        up: Curve<DVec3>,
    },
}

#[derive(Debug, Clone)]
pub(crate) enum Look {
    Along(Curve<DVec3>),
    At(Curve<DVec3>),
}

impl Look {
    /// Which way it looks from an eye; of no length where it looks at the eye.
    pub fn from(&self, eye: DVec3, time: f64) -> DVec3 {
        match self {
            Self::Along(direction) => direction.at(time),
            Self::At(target) => target.at(time) - eye,
        }
    }

    pub fn curve(&self) -> &Curve<DVec3> {
        match self {
            Self::Along(curve) | Self::At(curve) => curve,
        }
    }
}

/// A light of a scene by its number.
#[derive(Debug, Clone)]
pub(crate) struct LightTrack {
    pub light: usize,
    pub stand: Stand,
    /// Intensity, or irradiance of a directional one; None where it stays.
    pub strength: Option<Curve<DVec3>>,
}

/// A camera of a scene by its number.
#[derive(Debug, Clone)]
pub(crate) struct CameraTrack {
    pub camera: usize,
    pub stand: Stand,
    /// Of its horizontal field of view [radians]; None where it stays.
    pub angle: Option<Curve<f64>>,
}

/// Radiance of a material by its number.
#[derive(Debug, Clone)]
pub(crate) struct EmissionTrack {
    pub material: u32,
    pub radiance: Curve<DVec3>,
}

/// Triangles that move together.
#[derive(Debug, Clone)]
pub(crate) struct Moving {
    /// Of the scene, in its order.
    pub triangles: Range<usize>,
    pub motion: Motion,
}

/// How triangles move.
#[derive(Debug, Clone)]
pub(crate) enum Motion {
    /// With a node.
    With(usize),
    /// Each vertex for itself.
    Bends(Arc<Shape>),
}

impl Moving {
    pub fn shape(&self) -> Option<&Shape> {
        if let Motion::Bends(shape) = &self.motion { Some(shape) } else { None }
    }

    pub fn shape_mut(&mut self) -> Option<&mut Shape> {
        if let Motion::Bends(shape) = &mut self.motion { Some(Arc::make_mut(shape)) } else { None }
    }
}

/// All that moves in a scene, and when. Times count from 0 [s]; before its first key a thing is as there, after its last as there.
#[derive(Debug, Clone, Default)]
pub struct Animation {
    pub(crate) nodes: Vec<Node>,
    pub(crate) moving: Vec<Moving>,
    pub(crate) lights: Vec<LightTrack>,
    pub(crate) cameras: Vec<CameraTrack>,
    pub(crate) emissions: Vec<EmissionTrack>,
    /// The scene's own.
    pub(crate) origin: DVec3,
}

/// Where a thing is and how it is turned; directions have the length that they have.
struct Aim {
    at: DVec3,
    direction: DVec3,
    up: DVec3,
}

impl Animation {
    /// Whether nothing moves.
    pub fn is_empty(&self) -> bool {
        self.cameras.is_empty() && !self.changes_light()
    }

    /// Whether anything but a camera moves.
    pub(crate) fn changes_light(&self) -> bool {
        !(self.moving.is_empty() && self.lights.is_empty() && self.emissions.is_empty())
    }

    /// Whether a light or a surface whose strength changes ever shines.
    pub(crate) fn shines(&self) -> bool {
        let strengths = self.lights.iter().filter_map(|track| track.strength.as_ref()).chain(self.emissions.iter().map(|track| &track.radiance));
        strengths.flat_map(Curve::values).any(|strength| *strength != DVec3::ZERO)
    }

    /// When all has come to its end [s].
    pub fn length(&self) -> f64 {
        let stand = |stand: &Stand| match stand {
            Stand::On(_) => 0.0,
            Stand::Free { at, look, up } => at.end().max(look.curve().end()).max(up.end()),
        };
        let nodes = self.nodes.iter().map(|node| node.placement.end());
        let lights = self.lights.iter().map(|track| stand(&track.stand).max(track.strength.as_ref().map_or(0.0, Curve::end)));
        let cameras = self.cameras.iter().map(|track| stand(&track.stand).max(track.angle.as_ref().map_or(0.0, Curve::end)));
        nodes
            .chain(lights)
            .chain(cameras)
            .chain(self.shapes().map(Shape::end))
            .chain(self.emissions.iter().map(|track| track.radiance.end()))
            .fold(0.0, f64::max)
    }

    /// As it is at a time [s].
    pub fn at(&self, time: f64) -> Moment<'_> {
        let mut worlds: Vec<DMat4> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            worlds.push(node.parent.map_or(DMat4::IDENTITY, |parent| worlds[parent]) * node.stand * node.placement.at(time));
        }
        Moment { animation: self, time, worlds }
    }

    /// What moves, as objects of the scene.
    pub(crate) fn objects(&self) -> Vec<Object> {
        let name = |moving: &Moving| match &moving.motion {
            Motion::With(node) => self.nodes[*node].name.clone(),
            Motion::Bends(shape) => shape.name.clone(),
        };
        self.moving.iter().map(|moving| Object { name: name(moving), triangles: moving.triangles.clone() }).collect()
    }

    /// What of it deforms.
    pub(crate) fn shapes(&self) -> impl Iterator<Item = &Shape> {
        self.moving.iter().filter_map(Moving::shape)
    }

    /// Whether one of the things that move deforms, by its number.
    pub(crate) fn deforms(&self, moving: usize) -> bool {
        self.moving.get(moving).is_some_and(|moving| moving.shape().is_some())
    }

    /// Follows triangles that were put in another order: of each the place that it had, and of each of the things that move where they are now.
    pub(crate) fn sort(&mut self, order: &[u32], places: &[Range<usize>]) {
        for (moving, place) in self.moving.iter_mut().zip(places) {
            let first = moving.triangles.start;
            if let Some(shape) = moving.shape_mut() {
                shape.corners = order[place.clone()].iter().map(|at| shape.corners[*at as usize - first]).collect();
            }
            moving.triangles = place.clone();
        }
    }

    /// Adds a place on another, or in the world, whose geometry is read as a map says; its number.
    pub(crate) fn add(&mut self, name: String, parent: Option<usize>, map: &DMat4, placement: Placement) -> usize {
        let on = parent.map_or(DMat4::IDENTITY, |parent| self.nodes[parent].rest);
        let stand = on.inverse() * *map;
        self.nodes.push(Node { name, rest: on * stand * placement.at_rest(), parent, stand, placement });
        self.nodes.len() - 1
    }

    /// A place whose map to the world, as geometry is read, is known, on a node.
    pub(crate) fn post(&self, on: Option<usize>, map: &DMat4) -> Post {
        Post { on, map: on.map_or(*map, |node| self.nodes[node].rest.inverse() * *map) }
    }

    /// Takes over the nodes of another file, whose geometry is brought to the world by a map and moves with a node of this one; the number of their first.
    pub(crate) fn absorb(&mut self, others: Vec<Node>, onto: Option<usize>, map: &DMat4) -> usize {
        let first = self.nodes.len();
        let to_node = onto.map_or(DMat4::IDENTITY, |node| self.nodes[node].rest.inverse());
        self.nodes.extend(others.into_iter().map(|node| {
            let rest = *map * node.rest;
            match node.parent {
                Some(parent) => Node { parent: Some(first + parent), rest, ..node },
                None => Node { parent: onto, stand: to_node * *map * node.stand, rest, ..node },
            }
        }));
        first
    }
}

/// A scene's animation at a time.
pub struct Moment<'a> {
    animation: &'a Animation,
    /// [s]
    time: f64,
    /// From the coordinates of each node to the world's.
    worlds: Vec<DMat4>,
}

impl Moment<'_> {
    fn aim(&self, stand: &Stand) -> Aim {
        match stand {
            Stand::On(post) => {
                let map = post.map_in(&self.worlds);
                let axis = |axis| map.transform_vector3(axis);
                Aim { at: map.transform_point3(DVec3::ZERO), direction: axis(DVec3::NEG_Z), up: axis(DVec3::Y) }
            }
            Stand::Free { at, look, up } => {
                let at = at.at(self.time);
                Aim { at, direction: look.from(at, self.time), up: up.at(self.time) }
            }
        }
    }

    /// How the objects that move are, in their order.
    pub(crate) fn poses(&self) -> impl Iterator<Item = Pose> {
        self.animation.moving.iter().map(|moving| match &moving.motion {
            Motion::With(node) => {
                let (rest, world) = (self.animation.nodes[*node].rest, self.worlds[*node]);
                Pose::Place(if rest == world { DAffine3::IDENTITY } else { DAffine3::from_mat4(world * rest.inverse()) })
            }
            Motion::Bends(shape) => Pose::Shape(shape.corners(&self.worlds, self.time, self.animation.origin).into()),
        })
    }

    /// Brings triangles that deform, in the order in which the animation has them, to their places.
    pub(crate) fn bend(&self, triangles: &mut [Triangle]) {
        for (range, shape) in self.animation.moving.iter().filter_map(|moving| Some((moving.triangles.clone(), moving.shape()?))) {
            let corners = shape.corners(&self.worlds, self.time, self.animation.origin);
            triangles[range].iter_mut().zip(&corners).for_each(|(triangle, corners)| corners.put(triangle));
        }
    }

    /// The vertices of a shape.
    pub(crate) fn vertices(&self, shape: &Shape) -> Vec<Vertex> {
        shape.vertices(&self.worlds, self.time)
    }

    /// From the coordinates of each node to the world's.
    pub(crate) fn worlds(&self) -> &[DMat4] {
        &self.worlds
    }

    /// How a scene's lights and materials have to change to be as they are now.
    pub(crate) fn changes(&self, scene: &Scene) -> impl Iterator<Item = Change> {
        let lights = self.animation.lights.iter().filter_map(|track| {
            let was = scene.lights.get(track.light)?;
            let light = self.light(was, track);
            (light != *was).then_some(Change::Light { number: track.light, light })
        });
        let materials = self.animation.emissions.iter().filter_map(|track| {
            let (number, emission) = (track.material as usize, track.radiance.at(self.time).as_vec3());
            let was = scene.materials.get(number).filter(|was| was.emission != emission)?;
            Some(Change::Material { number, material: Material { emission, ..was.clone() } })
        });
        lights.chain(materials)
    }

    fn light(&self, was: &Light, track: &LightTrack) -> Light {
        let (aim, strength) = (self.aim(&track.stand), track.strength.as_ref().map(|curve| curve.at(self.time).as_vec3()));
        let (place, turned) = ((aim.at - self.animation.origin).as_vec3(), aim.direction.try_normalize().map(|direction| direction.as_vec3()));
        let mut light = was.clone();
        match &mut light.kind {
            LightKind::Point { position, intensity } => (*position, *intensity) = (place, strength.unwrap_or(*intensity)),
            LightKind::Spot { position, direction, intensity, .. } => {
                (*position, *direction, *intensity) = (place, turned.unwrap_or(*direction), strength.unwrap_or(*intensity));
            }
            LightKind::Directional { direction, irradiance } => (*direction, *irradiance) = (turned.unwrap_or(*direction), strength.unwrap_or(*irradiance)),
        }
        light
    }

    /// A camera of the scene as it is now; one that the scene does not have stays.
    pub fn camera(&self, scene: &Scene, was: &Camera) -> Camera {
        let is_its = |track: &&CameraTrack| scene.cameras.get(track.camera).is_some_and(|camera| camera.name == was.name);
        let Some(track) = self.animation.cameras.iter().find(is_its) else { return was.clone() };
        let aim = self.aim(&track.stand);
        let direction = aim.direction.try_normalize().unwrap_or(was.direction.as_dvec3());
        let upright = |up| Camera::upright(direction, up);
        let up = upright(aim.up).or_else(|| upright(was.up.as_dvec3())).unwrap_or_else(|| direction.any_orthonormal_vector());
        let field_of_view = track.angle.as_ref().map_or(was.field_of_view, |angle| FieldOfView::Horizontal(angle.at(self.time) as f32));
        Camera { eye: (aim.at - self.animation.origin).as_vec3(), direction: direction.as_vec3(), up: up.as_vec3(), field_of_view, ..was.clone() }
    }
}

/// Whether any of these curves has more than one value.
pub(crate) fn moves<V: Value>(curves: &[&Curve<V>]) -> bool {
    curves.iter().any(|curve| !curve.is_constant())
}
