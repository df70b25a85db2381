//! Scenes with fewer triangles.

use super::{Object, Scene, Triangle, animation::Animation, load::draft::has_area};
use glam::Vec2;
use meshoptimizer_rs::{Positions, SimplifyOptions, SimplifySettings, Workspace, simplify};
use std::collections::HashMap;

/// A scene with fewer triangles than it was made from.
#[derive(Debug, Clone)]
pub struct Simplified {
    /// Textures, materials, lights and cameras are as they were.
    pub scene: Scene,
    /// About how far surfaces lie from where they were, at most [scene units].
    pub error: f32,
}

/// A corner of a triangle, with what lies beside it in a scene.
struct Corner {
    triangle: usize,
    corner: usize,
}

impl Scene {
    /// With about so large a share of its triangles, 0 to 1: edges are collapsed, those first that move surfaces least (Garland and Heckbert 1997). Corners that are
    /// left have their normals, texture coordinates and colours; borders between materials and between objects stay closed. What shines is left as it is.
    ///
    /// None for a share that is no number, or a scene too large for 32 bits.
    pub fn simplified(&self, share: f64) -> Option<Simplified> {
        if !(0.0..=1.0).contains(&share) {
            return None;
        }
        let shines = |triangle: &Triangle| self.materials[triangle.material as usize].emits();
        let (kept, others): (Vec<usize>, Vec<usize>) = (0..self.triangles.len()).partition(|at| shines(&self.triangles[*at]));
        let objects = self.objects_of_triangles();
        let (corners, indices) = self.joined(&others, &objects);
        let positions: Vec<[f32; 3]> = corners.iter().map(|Corner { triangle, corner }| self.triangles[*triangle].positions[*corner].into()).collect();
        let scale = meshoptimizer_rs::simplify_scale(Positions::from_packed(&positions)).ok()?;
        let target = (share * others.len() as f64).round() as usize * 3;
        let settings = SimplifySettings { target_index_count: target, target_error: 1.0, options: SimplifyOptions::EMPTY };
        let found = simplify(&indices, Positions::from_packed(&positions), settings, &mut Workspace::default()).ok()?;
        let left = found.indices.chunks_exact(3).map(|corner| [0, 1, 2].map(|k| &corners[corner[k] as usize]));
        let whole = |at: usize| [0, 1, 2].map(|corner| Corner { triangle: at, corner });
        let kept: Vec<_> = kept.into_iter().map(whole).collect();
        let mut all: Vec<[&Corner; 3]> = left.chain(kept.iter().map(|corners| corners.each_ref())).collect();
        all.retain(|corners| has_area(&self.triangle_of(corners)));
        // Those of an object stay together.
        all.sort_by_key(|corners| objects[corners[0].triangle]);
        Some(Simplified { scene: self.of_corners(&all, &objects), error: found.error * scale })
    }

    /// Of each triangle the number of its object, one past the last where it has none.
    fn objects_of_triangles(&self) -> Vec<usize> {
        let mut objects = vec![self.objects.len(); self.triangles.len()];
        for (number, object) in self.objects.iter().enumerate() {
            objects[object.triangles.clone()].fill(number);
        }
        objects
    }

    /// The different corners of some triangles, and which ones each triangle has.
    fn joined(&self, triangles: &[usize], objects: &[usize]) -> (Vec<Corner>, Vec<u32>) {
        let (mut places, mut corners, mut indices) = (HashMap::new(), Vec::new(), Vec::with_capacity(3 * triangles.len()));
        for &triangle in triangles {
            for corner in 0..3 {
                let place = *places.entry(self.what_is_at(triangle, corner, objects[triangle])).or_insert(corners.len() as u32);
                if place as usize == corners.len() {
                    corners.push(Corner { triangle, corner });
                }
                indices.push(place);
            }
        }
        (corners, indices)
    }

    /// All that tells a corner from others, bit by bit.
    fn what_is_at(&self, triangle: usize, corner: usize, object: usize) -> Vec<u32> {
        let of = &self.triangles[triangle];
        let vectors = [of.positions[corner], of.normals[corner]].into_iter().chain(self.tangents.get(triangle).map(|tangents| tangents[corner]));
        let coordinates = std::iter::once(of.uvs[corner]).chain(self.charts.iter().map(|chart| chart[triangle][corner]));
        let floats = vectors.flat_map(|vector| vector.to_array()).chain(coordinates.flat_map(|at| at.to_array()));
        floats.map(f32::to_bits).chain([of.tints[corner].0, of.material, object as u32]).collect()
    }

    fn triangle_of(&self, corners: &[&Corner; 3]) -> Triangle {
        let of = |corner: &Corner| &self.triangles[corner.triangle];
        Triangle {
            positions: corners.map(|corner| of(corner).positions[corner.corner]),
            normals: corners.map(|corner| of(corner).normals[corner.corner]),
            uvs: corners.map(|corner| of(corner).uvs[corner.corner]),
            tints: corners.map(|corner| of(corner).tints[corner.corner]),
            material: of(corners[0]).material,
        }
    }

    /// With triangles of these corners, sorted by their objects.
    fn of_corners(&self, all: &[[&Corner; 3]], objects: &[usize]) -> Self {
        let chart = |chart: &Vec<[Vec2; 3]>| all.iter().map(|corners| corners.map(|corner| chart[corner.triangle][corner.corner])).collect();
        let tangents = |corners: &[&Corner; 3]| corners.map(|corner| self.tangents[corner.triangle][corner.corner]);
        let object = |(number, object): (usize, &Object)| {
            let first = |number| all.partition_point(|corners| objects[corners[0].triangle] < number);
            Object { name: object.name.clone(), triangles: first(number)..first(number + 1) }
        };
        Self {
            triangles: all.iter().map(|corners| self.triangle_of(corners)).collect(),
            charts: self.charts.iter().map(chart).collect(),
            tangents: if self.tangents.is_empty() { Vec::new() } else { all.iter().map(tangents).collect() },
            objects: self.objects.iter().enumerate().map(object).collect(),
            animation: Animation::default(),
            parts: Vec::new(),
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::load::{LoadOptions, load};
    use std::path::Path;

    fn loaded(file: &str) -> Scene {
        load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(file), &LoadOptions::default()).unwrap()
    }

    fn area(scene: &Scene, of: impl Fn(&Triangle) -> bool) -> f64 {
        scene.triangles.iter().filter(|triangle| of(triangle)).map(|triangle| 0.5 * f64::from(triangle.cross().length())).sum()
    }

    #[test]
    fn surfaces_stay_where_they_are() {
        let scene = loaded("scenes/balls.ron");
        for share in [0.5, 0.1] {
            let Simplified { scene: simple, error } = scene.simplified(share).unwrap();
            let left = simple.triangles.len() as f64 / scene.triangles.len() as f64;
            assert!((left / share - 1.0).abs() < 0.1, "{left} of the triangles for {share}");
            assert!(error < 0.01 * scene.extent(), "{error}");
            let [was, is] = [&scene, &simple].map(|scene| area(scene, |_| true));
            assert!((is / was - 1.0).abs() < 0.03, "{is} of {was} m²");
        }
    }

    #[test]
    fn what_shines_and_what_is_flat_is_as_it_was() {
        let scene = loaded("scenes/cornell.ron");
        let simple = scene.simplified(0.1).unwrap().scene;
        let shines = |triangle: &Triangle| scene.materials[triangle.material as usize].emits();
        assert_eq!(area(&simple, shines), area(&scene, shines));
        let Simplified { scene: all, error } = scene.simplified(1.0).unwrap();
        assert_eq!((all.triangles.len(), error), (scene.triangles.len(), 0.0));
        assert!(scene.simplified(f64::NAN).is_none() && scene.simplified(1.5).is_none());
    }

    #[test]
    fn objects_keep_their_triangles() {
        let mut scene = loaded("scenes/balls.ron");
        let half = scene.triangles.len() / 2;
        scene.objects = vec![Object { name: "first".into(), triangles: 0..half }, Object { name: "second".into(), triangles: half..scene.triangles.len() - 5 }];
        let simple = scene.simplified(0.3).unwrap().scene;
        let [first, second] = [0, 1].map(|number: usize| simple.objects[number].triangles.clone());
        assert!(first.start == 0 && first.end == second.start && second.end < simple.triangles.len(), "{first:?} {second:?}");
        let corners = |triangles: &[Triangle]| {
            triangles.iter().flat_map(|t| t.positions.map(|p| p.to_array().map(f32::to_bits))).collect::<std::collections::BTreeSet<_>>()
        };
        assert!(corners(&simple.triangles[first]).is_subset(&corners(&scene.triangles[..half])));
    }
}
