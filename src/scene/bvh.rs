//! The bounding volume hierarchy that the reference walks on the CPU and the ray-casting passes on the GPU.

use super::{
    clusters::cluster,
    model::{Bounds, Material, Scene, Texture, Triangle},
    packets::{self, Packets},
    parts::Parts,
    wide::{Candidate, Wide},
};
use glam::{Vec2, Vec3};
use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, leaf_collapser::collapse, node::Bvh2Node, reinsertion::ReinsertionOptimizer},
};
use std::{ops::Range, sync::OnceLock};

/// The share of the nodes that are taken out and put where they cost less; twice that once leaves are joined.
const REINSERTED: f32 = 0.05;
/// Triangles of a leaf, at most, and what a node costs a ray, in tests of a triangle.
const LEAF_TRIANGLES: u32 = 8;
const NODE_COST: f32 = 3.0;

/// A binary hierarchy over a scene's triangles, in whose order it has sorted them; where parts of a scene can move, one over each part and one over all parts.
#[derive(Clone)]
pub struct Bvh {
    nodes: Vec<Node>,
    parts: Option<Parts>,
    /// As single rays walk it, and as packets do: made where they are asked for.
    wide: OnceLock<Wide>,
    packets: OnceLock<Packets>,
}

/// A node: an inner node's children stand at `first` and `first + 1`; a leaf holds the triangles
/// `first .. first + count`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    pub min: [f32; 3],
    /// Triangles of a leaf, 0 for an inner node.
    pub count: u32,
    pub max: [f32; 3],
    pub first: u32,
}

/// Where a ray met a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    pub triangle: u32,
    /// Distance in units of the ray's direction.
    pub distance: f32,
    /// Barycentric weights of corners 1 and 2.
    pub barycentric: Vec2,
}

impl Bvh {
    /// Builds the hierarchy and sorts `scene.triangles` so that every leaf's triangles are neighbours.
    /// The result depends on the triangles alone.
    pub fn build(scene: &mut Scene) -> Self {
        let (nodes, order) = tree(&boxes(&scene.triangles));
        sort(scene, &order);
        Self { nodes, parts: None, wide: OnceLock::new(), packets: OnceLock::new() }
    }

    /// The same in two levels: each of `movers` is some triangles that can be moved together. They become the last of the scene, in the order of the list; where
    /// each stands is returned.
    pub fn build_in_parts(scene: &mut Scene, movers: &[Range<usize>]) -> (Self, Vec<Range<usize>>) {
        let (nodes, parts, order) = Parts::build(&boxes(&scene.triangles), movers);
        sort(scene, &order);
        let places: Vec<_> = parts.movers.iter().map(|mover| mover.triangles.clone()).collect();
        scene.animation.sort(&order, &places);
        (Self { nodes, parts: Some(parts), wide: OnceLock::new(), packets: OnceLock::new() }, places)
    }

    /// Follows triangles of movers that stand elsewhere now: the boxes of each, and the level over all.
    pub fn follow(&mut self, scene: &Scene, movers: &[usize]) {
        let Some(parts) = &mut self.parts else { return };
        movers.iter().for_each(|mover| refit(&mut self.nodes, &parts.movers[*mover].nodes, &scene.triangles));
        parts.join(&self.nodes);
        if let Some(wide) = self.wide.get_mut() {
            wide.follow(&self.nodes, parts, movers, &scene.triangles);
        }
        let bounds = self.bounds();
        if let Some(packets) = self.packets.take()
            && let Some(parts) = &self.parts
            && let Some(packets) = packets.follow(&self.nodes, parts, movers, scene, &bounds)
        {
            self.packets = packets.into();
        }
    }

    /// Follows materials that are seen from other sides, or have other holes.
    pub fn follow_materials(&mut self) {
        self.packets.take();
    }

    /// Of the triangles; the same as the scene's.
    pub fn bounds(&self) -> Bounds {
        let root = self.parts.as_ref().map_or(&self.nodes, |parts| &parts.upper).first();
        root.map_or(Bounds::EMPTY, Node::bounds)
    }

    /// For each node the triangles below it, first and one past the last: a subtree's triangles are neighbours.
    pub fn ranges(&self) -> Vec<[u32; 2]> {
        let nodes = &self.nodes;
        let mut ranges = vec![[0, 0]; nodes.len()];
        for index in self.roots().into_iter().flat_map(|root| depth_first(nodes, root)).rev() {
            let node = &nodes[index];
            let first = node.first as usize;
            ranges[index] = if node.count > 0 { [node.first, node.first + node.count] } else { [ranges[first][0], ranges[first + 1][1]] };
        }
        ranges
    }

    /// The nodes; empty for an empty scene.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Which of the nodes hold all triangles together: the first, or one for each part.
    pub fn roots(&self) -> Vec<usize> {
        let first = || if self.nodes.is_empty() { Vec::new() } else { vec![0] };
        self.parts.as_ref().map_or_else(first, |parts| parts.roots.iter().map(|root| *root as usize).collect())
    }

    pub fn parts(&self) -> Option<&Parts> {
        self.parts.as_ref()
    }

    fn wide(&self, scene: &Scene) -> &Wide {
        self.wide.get_or_init(|| Wide::new(&self.nodes, self.parts.as_ref(), &scene.triangles))
    }

    /// The hierarchy for many rays from one point.
    pub fn packets(&self, scene: &Scene) -> &Packets {
        self.packets.get_or_init(|| Packets::new(&self.with_leaves_of(packets::BLOCK), self.parts.as_ref(), scene, &self.bounds()))
    }

    /// The nodes with every subtree of so few triangles as one leaf.
    fn with_leaves_of(&self, most: usize) -> Vec<Node> {
        let mut nodes = self.nodes.clone();
        for (node, [first, end]) in nodes.iter_mut().zip(self.ranges()) {
            if end - first <= most as u32 && end > first {
                (node.first, node.count) = (first, end - first);
            }
        }
        nodes
    }

    /// The nearest surface that a viewer would see along `origin + t·direction`, 0 < t < `limit`: one-sided surfaces
    /// are seen from their front only, holes of alpha-masked textures not at all.
    pub fn closest_hit(&self, scene: &Scene, origin: Vec3, direction: Vec3, limit: f32) -> Option<Hit> {
        let seen = |candidate: &Candidate| is_seen(scene, candidate);
        let found = self.wide(scene).closest(origin, direction, limit, seen)?;
        Some(Hit { triangle: found.triangle as u32, distance: found.distance, barycentric: found.barycentric })
    }

    /// The nearest surface that stops light along `origin + t·direction`: from both of its sides, whatever its sidedness; not at holes of alpha-masked textures.
    pub fn closest_blocker(&self, scene: &Scene, origin: Vec3, direction: Vec3) -> Option<Hit> {
        let found = self.wide(scene).closest(origin, direction, f32::INFINITY, |candidate| stops(scene, candidate))?;
        Some(Hit { triangle: found.triangle as u32, distance: found.distance, barycentric: found.barycentric })
    }

    /// Whether anything blocks light between 0 and `limit` along the ray. A surface blocks from both of its sides,
    /// whatever its sidedness; holes of alpha-masked textures let light through.
    pub fn occluded(&self, scene: &Scene, origin: Vec3, direction: Vec3, limit: f32) -> bool {
        self.wide(scene).any(origin, direction, limit, |candidate| stops(scene, candidate))
    }
}

fn boxes(triangles: &[Triangle]) -> Vec<Aabb> {
    triangles.iter().map(bounds).collect()
}

fn bounds(triangle: &Triangle) -> Aabb {
    let [v0, v1, v2] = triangle.positions.map(Into::into);
    obvhs::triangle::Triangle { v0, v1, v2 }.aabb()
}

/// Puts triangles, and what lies beside them, in an order.
fn sort(scene: &mut Scene, order: &[u32]) {
    scene.triangles = order.iter().map(|&i| scene.triangles[i as usize]).collect();
    for chart in &mut scene.charts {
        *chart = order.iter().map(|&i| chart[i as usize]).collect();
    }
    if !scene.tangents.is_empty() {
        scene.tangents = order.iter().map(|&i| scene.tangents[i as usize]).collect();
    }
}

/// A tree over boxes, the root first, and their order in it.
pub(super) fn tree(boxes: &[Aabb]) -> (Vec<Node>, Vec<u32>) {
    let mut inner = hierarchy(boxes);
    let order = sort_depth_first(&mut inner);
    (inner.nodes.iter().map(node).collect(), order)
}

/// As `obvhs` builds it at medium quality.
fn hierarchy(boxes: &[Aabb]) -> Bvh2 {
    let mut tree = cluster(boxes);
    let mut optimizer = ReinsertionOptimizer::default();
    optimizer.run(&mut tree, REINSERTED, None);
    collapse(&mut tree, LEAF_TRIANGLES, NODE_COST);
    optimizer.run(&mut tree, 2.0 * REINSERTED, None);
    tree
}

pub(super) fn node(node: &Bvh2Node) -> Node {
    Node { min: node.aabb().min.into(), count: node.prim_count, max: node.aabb().max.into(), first: node.first_index }
}

/// Boxes of nodes whose children stand behind them, anew.
fn refit(nodes: &mut [Node], part: &Range<usize>, triangles: &[Triangle]) {
    for index in part.clone().rev() {
        let Node { first, count, .. } = nodes[index];
        let (first, count) = (first as usize, count as usize);
        let all = if count > 0 { Bounds::of(&triangles[first..first + count]) } else { nodes[first].bounds().joined(&nodes[first + 1].bounds()) };
        (nodes[index].min, nodes[index].max) = (all.min.into(), all.max.into());
    }
}

impl Node {
    pub fn bounds(&self) -> Bounds {
        Bounds { min: self.min.into(), max: self.max.into() }
    }
}

/// Node indices below one, parents before children, left before right.
pub(super) fn depth_first(nodes: &[Node], root: usize) -> Vec<usize> {
    let mut order = Vec::new();
    let mut stack = vec![root];
    while let Some(index) = stack.pop() {
        order.push(index);
        if nodes[index].count == 0 {
            let first = nodes[index].first as usize;
            stack.extend([first + 1, first]);
        }
    }
    order
}

/// Renumbers the primitives so that every subtree holds a contiguous range; returns the original index of each.
fn sort_depth_first(bvh: &mut Bvh2) -> Vec<u32> {
    let mut order: Vec<u32> = Vec::with_capacity(bvh.primitive_indices.len());
    let mut stack = if bvh.nodes.is_empty() { Vec::new() } else { vec![0] };
    while let Some(index) = stack.pop() {
        let node = &mut bvh.nodes[index];
        if node.is_leaf() {
            let range = node.first_index as usize..(node.first_index + node.prim_count) as usize;
            node.first_index = order.len() as u32;
            order.extend(&bvh.primitive_indices[range]);
        } else {
            let first = node.first_index as usize;
            stack.extend([first + 1, first]);
        }
    }
    bvh.primitive_indices = (0..order.len() as u32).collect();
    order
}

/// Whether a viewer sees a triangle that a ray meets.
pub(super) fn is_seen(scene: &Scene, candidate: &Candidate) -> bool {
    let triangle = &scene.triangles[candidate.triangle];
    let material = &scene.materials[triangle.material as usize];
    (candidate.front || material.two_sided) && !is_hole(triangle, material, &scene.textures, candidate.barycentric)
}

/// Whether a triangle that light meets is in its way.
fn stops(scene: &Scene, candidate: &Candidate) -> bool {
    let triangle = &scene.triangles[candidate.triangle];
    !is_hole(triangle, &scene.materials[triangle.material as usize], &scene.textures, candidate.barycentric)
}

/// Whether an alpha-masked texture leaves a hole at the barycentric weights of corners 1 and 2.
pub fn is_hole(triangle: &Triangle, material: &Material, textures: &[Texture], barycentric: Vec2) -> bool {
    let (Some(cutoff), Some(texture)) = (material.alpha_cutoff, material.texture) else { return false };
    textures[texture as usize].sample(triangle.uv(barycentric)).w < cutoff
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::scene::{
        load::{LoadOptions, embedded_scenes, load},
        model::Scene,
    };
    use obvhs::{BvhBuildParams, bvh2::builder::build_bvh2};
    use std::{
        path::Path,
        time::{Duration, Instant},
    };

    /// Numbers in −1..1 of no particular order (a linear congruential generator).
    fn numbers() -> impl FnMut() -> f32 {
        let mut state = 1u64;
        move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f32 / (1 << 23) as f32 - 1.0
        }
    }

    /// Triangles small, huge, needle-thin, flat along an axis, doubled and without area; half of them one-sided.
    pub(in crate::scene) fn clutter(scale: f32) -> Scene {
        let mut number = numbers();
        let mut point = move || Vec3::new(number(), number(), number());
        let mut triangles = Vec::new();
        for k in 0..600u32 {
            let (centre, spread) = (point(), [0.05, 0.05, 0.4, 2.0][k as usize % 4]);
            let mut positions = [point(), point(), point()].map(|p| centre + p * spread);
            match k % 7 {
                0 => positions[2] = positions[0].lerp(positions[1], 0.3) + point() * 1e-4,
                1 => positions = positions.map(|p| Vec3::new(p.x, centre.y, p.z)),
                2 if k % 5 == 0 => positions[2] = positions[1],
                _ => {}
            }
            let triangle =
                Triangle { positions: positions.map(|p| p * scale), normals: [Vec3::Y; 3], uvs: [Vec2::ZERO; 3], tints: Default::default(), material: k % 2 };
            triangles.extend(vec![triangle; 1 + (k % 11 == 0) as usize]);
        }
        let materials = [true, false].map(|two_sided| Material { two_sided, ..Material::diffuse("grey", Vec3::ONE) }).into();
        Scene { triangles, materials, ..Scene::default() }
    }

    /// Distance to a triangle and whether its front is met, in double precision; none near its edges counts for sure.
    fn met(triangle: &Triangle, origin: Vec3, direction: Vec3, margin: f64) -> Option<(f64, bool)> {
        let [a, b, c] = triangle.positions.map(|p| p.as_dvec3());
        let (d, e1, e2) = (direction.as_dvec3(), b - a, c - a);
        let p = d.cross(e2);
        let determinant = e1.dot(p);
        let s = origin.as_dvec3() - a;
        let (u, v, t) = (s.dot(p) / determinant, d.dot(s.cross(e1)) / determinant, e2.dot(s.cross(e1)) / determinant);
        (u >= -margin && v >= -margin && u + v <= 1.0 + margin && t > 0.0).then_some((t, determinant > 0.0))
    }

    #[test]
    fn charts_are_sorted_with_their_triangles() {
        let mut scene = clutter(1.0);
        let mut number = numbers();
        scene.triangles.iter_mut().for_each(|triangle| triangle.uvs[0].x = number());
        scene.charts = vec![scene.triangles.iter().map(|triangle| triangle.uvs).collect()];
        scene.tangents = scene.triangles.iter().map(|triangle| triangle.positions).collect();
        Bvh::build(&mut scene);
        assert!(scene.triangles.iter().zip(&scene.charts[0]).all(|(triangle, uvs)| triangle.uvs == *uvs));
        assert!(scene.triangles.iter().zip(&scene.tangents).all(|(triangle, tangents)| triangle.positions == *tangents));
    }

    #[test]
    fn rays_meet_what_a_search_of_all_triangles_finds() {
        for scale in [1.0, 1e-3, 1e6] {
            let mut scene = clutter(scale);
            let bvh = Bvh::build(&mut scene);
            let mut number = numbers();
            let mut unsure = 0;
            for k in 0..2000 {
                let origin = Vec3::new(number(), number(), number()) * scale;
                let mut direction = Vec3::new(number(), number(), number());
                // Along an axis and nearly so, too.
                direction[k % 3] *= [1.0, 0.0, 1e-9][k / 3 % 3];
                let direction = direction.normalize_or(Vec3::X);
                let search = |margin: f64, two_sided_only: bool| {
                    let seen = |t: &&Triangle| met(t, origin, direction, margin).filter(|(_, front)| !two_sided_only || *front || t.material == 0);
                    scene.triangles.iter().filter_map(|t| seen(&t)).map(|(t, _)| t).fold(f64::INFINITY, f64::min)
                };
                let found = bvh.closest_hit(&scene, origin, direction, f32::INFINITY).map_or(f64::INFINITY, |hit| hit.distance as f64);
                // Where the answer hangs on the rounding at an edge, either is right.
                let (least, most) = (search(1e-4, true), search(-1e-4, true));
                unsure += (least != most) as u32;
                assert!(found >= least * (1.0 - 1e-3) && found <= most * (1.0 + 1e-3), "ray {k} at scale {scale}: {found}, not {least} to {most}");
                let (least, most) = (search(1e-4, false), search(-1e-4, false));
                let limit = 0.8 * scale;
                let blocked = bvh.occluded(&scene, origin, direction, limit);
                assert!(if blocked { least <= limit as f64 * 1.001 } else { most >= limit as f64 * 0.999 }, "ray {k} at scale {scale}: {blocked}");
            }
            assert!(unsure < 100, "{unsure} rays test nothing");
        }
    }

    /// Rays through a hierarchy in two levels meet what they meet in one level, wherever the movers are, and packets see what single rays do.
    #[test]
    fn movers_are_met_where_they_stand() {
        let mut scene = clutter(1.0);
        let count = scene.triangles.len();
        let (mut bvh, places) = Bvh::build_in_parts(&mut scene, &[10..60, 100..101, count - 40..count]);
        assert_eq!(places.iter().map(Range::len).collect::<Vec<_>>(), [50, 1, 40]);
        assert_eq!(scene.triangles.len(), count);
        let mut number = numbers();
        for step in 0..6 {
            let movers: Vec<usize> = (0..3).filter(|mover| (step + mover) % 2 == 0).collect();
            // Out of the scene, too.
            let shift = Vec3::new(number(), number(), number()) * if step == 4 { 8.0 } else { 0.5 };
            movers.iter().flat_map(|mover| places[*mover].clone()).for_each(|at| scene.triangles[at].positions.iter_mut().for_each(|p| *p += shift));
            bvh.follow(&scene, &movers);
            let mut anew = scene.clone();
            let other = Bvh::build(&mut anew);
            assert_eq!(bvh.bounds(), anew.bounds());
            let mut seen = 0;
            for _ in 0..500 {
                let origin = Vec3::new(number(), number(), number());
                let direction = Vec3::new(number(), number(), number()).normalize_or(Vec3::X);
                let [found, expected] = [(&bvh, &scene), (&other, &anew)].map(|(bvh, scene)| bvh.closest_hit(scene, origin, direction, f32::INFINITY));
                assert_eq!(found.map(|hit| hit.distance), expected.map(|hit| hit.distance), "step {step}");
                seen += u32::from(found.is_some());
                let rays = packets::ShadowRays { directions: [direction; packets::RAYS], all: 0b111 };
                let [hidden, single] = [
                    bvh.packets(&scene).hidden(&scene, origin, &rays, packets::Until::Forever, &mut packets::ToDo::default()) != 0,
                    bvh.occluded(&scene, origin, direction, f32::INFINITY),
                ];
                assert_eq!(hidden, single, "step {step}");
            }
            assert!(seen > 100);
        }
    }

    #[test]
    fn scenes_that_ship_have_the_hierarchy_that_the_crate_builds() {
        // Two need files that do not ship.
        let options = LoadOptions::default().with_environment();
        let scenes: Vec<Scene> = embedded_scenes().filter_map(|name| load(Path::new(name), &options).ok()).collect();
        assert!(scenes.len() >= 10);
        for scene in scenes {
            let boxes: Vec<Aabb> = scene.triangles.iter().map(bounds).collect();
            let (ours, theirs) = (hierarchy(&boxes), build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Duration::default()));
            assert_eq!(bytemuck::cast_slice::<_, u32>(&ours.nodes), bytemuck::cast_slice::<_, u32>(&theirs.nodes), "{}", scene.name);
            assert_eq!(ours.primitive_indices, theirs.primitive_indices, "{}", scene.name);
        }
    }

    /// Triangles whose boxes are all the same, in 20,000 planes.
    #[test]
    fn coincident_triangles_are_sorted_and_walked_at_once() {
        let mut scene = clutter(1.0);
        let triangle = Triangle { positions: [Vec3::ZERO, Vec3::ONE, Vec3::X], ..scene.triangles[0] };
        let plane = |k: u32| Triangle { positions: [Vec3::ZERO, Vec3::ONE, Vec3::new(0.5, k as f32 / 20_000.0, 0.5)], ..triangle };
        scene.triangles = (0..20_000).map(plane).collect();
        let start = Instant::now();
        let bvh = Bvh::build(&mut scene);
        // A hundredth of a second; it was ten.
        assert!(start.elapsed() < Duration::from_secs(3), "{:?}", start.elapsed());
        for k in 1..20 {
            let (origin, direction) = (Vec3::new(k as f32 / 20.0, 2.0, 0.45), Vec3::new(0.0, -1.0, 0.02));
            let search = |margin: f64| scene.triangles.iter().filter_map(|t| met(t, origin, direction, margin)).map(|(t, _)| t).fold(f64::INFINITY, f64::min);
            let found = bvh.closest_hit(&scene, origin, direction, f32::INFINITY).map_or(f64::INFINITY, |hit| hit.distance as f64);
            assert!(found >= search(1e-3) * (1.0 - 1e-3) && found <= search(-1e-3) * (1.0 + 1e-3), "ray {k}: {found}");
        }
    }

    #[test]
    fn small_and_empty_scenes_are_walked() {
        for count in [0, 1, 2, 3, 5] {
            let mut scene = clutter(1.0);
            scene.triangles.truncate(count);
            let bvh = Bvh::build(&mut scene);
            for target in scene.triangles.clone() {
                let centre = target.positions.iter().sum::<Vec3>() / 3.0;
                assert!(bvh.occluded(&scene, centre + target.face_normal(), -target.face_normal(), 2.0));
            }
            assert!(bvh.closest_hit(&scene, Vec3::splat(9.0), Vec3::ONE.normalize(), f32::INFINITY).is_none());
        }
    }
}
