//! What stands on the surface around a place, such as a thin wall on a floor: light that a record finds in front of it is not that behind it.

use super::photons::lookup::FLATNESS;
use crate::math::{frame::Frame, radius::Reach, record_index::COARSER, thinning::Vertex};
use crate::scene::{
    Scene,
    bvh::{Bvh, Hit},
    surface_offset,
};
use crate::schedule::HostContext;
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::TAU;

/// Rays that look for what stands around a place, and how steeply they rise.
const RAYS: u32 = 12;
const RISE: f32 = 0.05;

/// An obstacle's normal has less than this cosine with that of the place.
const STEEP: f32 = 0.7;

/// Where it is looked for what a record could light behind an obstacle, as shares of the way on.
const BEYOND: [f32; 3] = [0.1, 0.5, 1.0];

/// How much nearer than a ray finds them obstacles may stand beside it.
const BESIDE: f32 = 0.95;

/// How far a place reaches at least, however near they are: a share of how far it stands for others.
const LEAST: f32 = 1.0 / 16.0;

/// A scene, as it is looked at around places.
#[derive(Clone, Copy)]
pub struct Surroundings<'a> {
    scene: &'a Scene,
    bvh: &'a Bvh,
    /// Of the scene [scene units].
    pub extent: f32,
}

impl<'a> Surroundings<'a> {
    pub fn of(host: &'a dyn HostContext) -> Self {
        Self { scene: host.scene(), bvh: host.bvh(), extent: host.extent() }
    }

    /// Places that reach no farther than what stands on their surface; each knows how near that is.
    pub fn kept_apart(&self, places: Vec<(Vertex, Reach)>) -> Vec<(Vertex, Reach)> {
        let before = |(place, Reach { radius, .. })| (place, self.reach(&place, [radius, COARSER * radius], BESIDE, LEAST * radius));
        places.into_par_iter().map(before).collect()
    }

    /// How far a place reaches that would as far as `radius`: no farther than this share of the way to what stands within the radius `seen`, and no less far than
    /// `least`.
    pub fn reach(&self, place: &Vertex, [radius, seen]: [f32; 2], share: f32, least: f32) -> Reach {
        let obstacles: Vec<Vec3> = self.obstacles(place, seen).map(|way| way * share).collect();
        Reach::before(&obstacles, place.normal, radius, least)
    }

    /// What stands on the surface of a place, which goes on behind it, as ways from there no longer than `radius`.
    fn obstacles(&self, place: &Vertex, radius: f32) -> impl Iterator<Item = Vec3> {
        let frame = Frame::new(place.normal);
        let origin = place.position + place.normal * surface_offset(self.extent, place.position);
        (0..RAYS).filter_map(move |ray| {
            let (sine, cosine) = (TAU * ray as f32 / RAYS as f32).sin_cos();
            let direction = (frame.tangent * cosine + frame.bitangent * sine + frame.normal * RISE).normalize();
            let hit = self.bvh.closest_blocker(self.scene, origin, direction).filter(|hit| hit.distance < radius && self.stands_up(hit, place.normal))?;
            let along = direction - frame.normal * direction.dot(frame.normal);
            let is_there = |distance: f32| surface_beside(self.scene, self.bvh, [place.position, place.normal], along * distance, radius).is_some();
            let goes_on = BEYOND.iter().any(|share| is_there(hit.distance + share * (radius - hit.distance)));
            goes_on.then_some(direction * hit.distance)
        })
    }

    /// Whether what a ray has met is no part of the same surface, which may bend.
    fn stands_up(&self, hit: &Hit, normal: Vec3) -> bool {
        self.scene.triangles[hit.triangle as usize].face_normal().dot(normal).abs() < STEEP
    }
}

/// Where there is a surface beside a place, in its plane or as near to that as photons that count: what is met from above. `place` is a position and its normal,
/// `aside` a way along the plane.
pub fn surface_beside(scene: &Scene, bvh: &Bvh, [position, normal]: [Vec3; 2], aside: Vec3, radius: f32) -> Option<(Hit, Vec3)> {
    let height = FLATNESS * radius;
    let from = position + aside + normal * height;
    let hit = bvh.closest_blocker(scene, from, -normal).filter(|hit| hit.distance <= 2.0 * height)?;
    Some((hit, from - normal * hit.distance))
}
