//! A scene's surfaces laid out in a square: what a lightmap keeps light by.
//!
//! Triangles that go on into each other without an edge make a chart, which is flattened on the plane of its first triangle. All charts have the same scale, and none has a
//! part of another's texel. Where several triangles of a chart meet in a texel, it stands for any of them by chance, at the middle of its part, with the area of all: the areas of
//! the texels add up to that of the surfaces. Things that move are laid out as they are at rest. Charts of less than half a texel are crumbs: those that lie close together and face a similar way share a texel.

use super::{Scene, Triangle};
use crate::math::random::{combine, hash, unit};
use crate::math::{frame::Frame, morton::Cube};
use glam::{DVec2, Vec2, Vec3};
use std::collections::{BTreeMap, HashMap};

/// How triangles are put together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Charts {
    /// Those that go on into each other without an edge, and do not turn much.
    Smooth,
    /// Each alone.
    Each,
}

/// Which triangle lies where.
#[derive(Debug, Clone, PartialEq)]
pub struct Atlas {
    /// Texels along an edge.
    pub edge: u32,
    /// Of each triangle [texels]; all the same where it has no area.
    pub corners: Vec<[Vec2; 3]>,
    /// Of each triangle, from 1 on; 0 where it has no area.
    pub chart_of: Vec<u32>,
    /// Row by row.
    pub texels: Vec<Texel>,
    /// Other points that the same texels stand for, any of their surface by chance, as often as was asked for.
    pub draws: Vec<Vec<Spot>>,
    /// How many charts there are.
    pub charts: usize,
    /// Triangles with an area that no texel stands for: what is kept for them is that of others beside them.
    pub crowded: usize,
}

/// What a texel stands for.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Texel {
    /// In the middle of one of its triangles' parts.
    pub spot: Spot,
    /// Of all surfaces in it, at rest [scene units²].
    pub area: f32,
}

/// A point of a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Spot {
    /// Its number + 1; 0 where there is none.
    pub triangle: u32,
    /// Weights of its corners 1 and 2.
    pub barycentric: Vec2,
}

/// How far a triangle of a chart may be turned from the first, as a cosine.
const TURNED: f32 = 0.8;
/// How far the normals of two triangles may be apart at a corner that they share, as a cosine: otherwise there is an edge between them.
const SMOOTH: f32 = 0.97;
/// Of a crumb, along its longer side [texels].
const CRUMB: f32 = 0.5;
/// Between a chart's bounds and the texels' edges [texels].
const INSET: f32 = 0.02;
/// Halvings of the scale that is looked for.
const TRIES: u32 = 24;
/// How much of a texel several triangles may take in all: more is a chart that lies on itself.
const MOST_COVERED: f32 = 1.05;

/// Triangles on a plane.
struct Chart {
    triangles: Vec<u32>,
    /// Of each triangle, from the lower left of all [scene units].
    corners: Vec<[Vec2; 3]>,
    size: Vec2,
    /// Any point of it, and which of six axes it faces most.
    place: Vec3,
    axis: u8,
}

impl Atlas {
    /// Of all triangles that have an area, with so many other points of each texel.
    pub fn new(scene: &Scene, edge: u32, by: Charts, draws: u32) -> Self {
        let groups = match by {
            Charts::Smooth => smooth_groups(scene),
            Charts::Each => {
                (0..scene.triangles.len() as u32).filter(|number| scene.at_rest(*number).face_normal() != Vec3::ZERO).map(|number| vec![number]).collect()
            }
        };
        let (atlas, folded) = Self::of_groups(scene, [edge, draws], &groups);
        if folded.iter().all(|folded| !folded) {
            return atlas;
        }
        let alone = |group: Vec<u32>| group.into_iter().map(|number| vec![number]).collect();
        let apart = groups.into_iter().zip(folded).flat_map(|(group, folded)| if folded { alone(group) } else { vec![group] });
        Self::of_groups(scene, [edge, draws], &apart.collect::<Vec<_>>()).0
    }

    /// The atlas, and which groups lie on themselves.
    fn of_groups(scene: &Scene, [edge, draws]: [u32; 2], groups: &[Vec<u32>]) -> (Self, Vec<bool>) {
        let charts: Vec<Chart> = groups.iter().map(|group| Chart::new(scene, group)).collect();
        let Layout { scale, pieces } = Layout::new(&charts, edge);
        let mut corners = vec![[Vec2::ZERO; 3]; scene.triangles.len()];
        let mut chart_of = vec![0; scene.triangles.len()];
        let mut filled = Filled::new(edge, draws);
        let mut folded = vec![false; charts.len()];
        let area = |triangle: u32| 0.5 * scene.at_rest(triangle).cross().length();
        for (number, piece) in (1..).zip(&pieces) {
            let origin = Vec2::new(piece.place[0] as f32, piece.place[1] as f32);
            for &at in &piece.charts {
                let chart = &charts[at];
                for (&triangle, flat) in chart.triangles.iter().zip(&chart.corners) {
                    chart_of[triangle as usize] = number;
                    let own = &mut corners[triangle as usize];
                    if piece.is_of_crumbs {
                        *own = [origin + 0.5; 3];
                        filled.add_crumb(triangle, piece.place, area(triangle));
                    } else {
                        *own = flat.map(|corner| origin + INSET + corner * scale);
                        folded[at] |= filled.add(triangle, own, area(triangle));
                    }
                }
            }
        }
        let crowded = charts.iter().flat_map(|chart| &chart.triangles).filter(|number| !filled.stands_for(**number, &corners)).count();
        let (texels, draws) = filled.finish();
        (Self { edge, corners, chart_of, texels, draws, charts: charts.len(), crowded }, folded)
    }

    /// Where the texels are that stand for something, neighbours in space after each other.
    pub fn in_space(&self, scene: &Scene) -> Vec<u32> {
        let position = |Texel { spot, .. }: &Texel| scene.at_rest(spot.triangle - 1).position(spot.barycentric);
        let taken = || (0u32..).zip(&self.texels).filter(|(_, texel)| texel.spot.triangle != 0);
        let low = taken().fold(Vec3::INFINITY, |low, (_, texel)| low.min(position(texel)));
        let high = taken().fold(Vec3::NEG_INFINITY, |high, (_, texel)| high.max(position(texel)));
        let cube = Cube::around(low, high);
        let mut places: Vec<(u32, u32)> = taken().map(|(place, texel)| (cube.code(position(texel)), place)).collect();
        places.sort_unstable();
        places.into_iter().map(|(_, place)| place).collect()
    }
}

impl Chart {
    fn new(scene: &Scene, triangles: &[u32]) -> Self {
        let first = scene.at_rest(triangles[0]);
        let [a, b, c] = first.positions;
        let normal = first.face_normal();
        let along = |edge: Vec3| {
            let tangent = (edge - normal * normal.dot(edge)).try_normalize().unwrap_or(Frame::new(normal).tangent);
            let bitangent = normal.cross(tangent);
            let flat = |number: &u32| scene.at_rest(*number).positions.map(|corner| Vec2::new((corner - a).dot(tangent), (corner - a).dot(bitangent)));
            let corners: Vec<[Vec2; 3]> = triangles.iter().map(flat).collect();
            let low = corners.iter().flatten().fold(Vec2::INFINITY, |low, corner| low.min(*corner));
            let high = corners.iter().flatten().fold(Vec2::NEG_INFINITY, |high, corner| high.max(*corner));
            (low, high - low, corners)
        };
        let flattened = [b - a, c - b, a - c].map(along);
        let least = flattened.into_iter().min_by(|(_, a, _), (_, b, _)| a.element_product().total_cmp(&b.element_product()));
        let (low, size, corners) = least.unwrap_or_else(|| along(b - a));
        // Lying charts make low shelves.
        let lying = |at: Vec2| if size.y > size.x { Vec2::new(at.y, at.x) } else { at };
        let corners = corners.into_iter().map(|corners| corners.map(|corner| lying(corner - low))).collect();
        let longest = normal.abs().max_position();
        let axis = 2 * longest as u8 + u8::from(normal[longest] < 0.0);
        Self { triangles: triangles.to_vec(), corners, size: lying(size), place: a, axis }
    }

    /// The texels that it takes.
    fn cells(&self, scale: f32) -> [u32; 2] {
        (self.size * scale + 2.0 * INSET).ceil().to_array().map(|side| (side as u32).max(1))
    }
}

/// A chart, or crumbs that share a texel.
struct Piece {
    charts: Vec<usize>,
    is_of_crumbs: bool,
    /// Along both sides [texels].
    cells: [u32; 2],
    /// Of its first texel.
    place: [u32; 2],
}

/// Where all pieces are.
struct Layout {
    /// Texels a scene unit.
    scale: f32,
    pieces: Vec<Piece>,
}

impl Layout {
    /// The greatest scale at which all find room. There is one: small enough, all are crumbs in a few texels.
    fn new(charts: &[Chart], edge: u32) -> Self {
        let area: f32 = charts.iter().map(|chart| chart.size.element_product()).sum();
        let longest = charts.iter().map(|chart| chart.size.x).fold(f32::MIN_POSITIVE, f32::max);
        let mut high = (edge as f32 / longest).min(edge as f32 / area.max(f32::MIN_POSITIVE).sqrt() * 1.5);
        let (mut low, mut found) = (0.0, Self { scale: 0.0, pieces: shelved(pieces(charts, 0.0), charts, edge).unwrap_or_default() });
        for _ in 0..TRIES {
            let scale = 0.5 * (low + high);
            match shelved(pieces(charts, scale), charts, edge) {
                Some(pieces) => (low, found) = (scale, Self { scale, pieces }),
                None => high = scale,
            }
        }
        found
    }
}

/// Charts as they are at a scale, crumbs put together that fall into the same texel of space and face the same axis.
fn pieces(charts: &[Chart], scale: f32) -> Vec<Piece> {
    let mut crumbs: BTreeMap<([i32; 3], u8), Vec<usize>> = BTreeMap::new();
    let mut pieces = Vec::new();
    for (at, chart) in charts.iter().enumerate() {
        if chart.size.x * scale < CRUMB {
            let texel = (chart.place * scale).floor().as_ivec3().to_array();
            crumbs.entry((texel, chart.axis)).or_default().push(at);
        } else {
            pieces.push(Piece { charts: vec![at], is_of_crumbs: false, cells: chart.cells(scale), place: [0; 2] });
        }
    }
    pieces.extend(crumbs.into_values().map(|charts| Piece { charts, is_of_crumbs: true, cells: [1; 2], place: [0; 2] }));
    pieces
}

/// On shelves, the highest first, of those that are as high neighbours in space side by side; none where they do not fit.
fn shelved(mut pieces: Vec<Piece>, charts: &[Chart], edge: u32) -> Option<Vec<Piece>> {
    let bounds = |of: fn(Vec3, Vec3) -> Vec3, from: Vec3| charts.iter().fold(from, |bound, chart| of(bound, chart.place));
    let cube = Cube::around(bounds(Vec3::min, Vec3::INFINITY), bounds(Vec3::max, Vec3::NEG_INFINITY));
    pieces.sort_by_cached_key(|piece| (u32::MAX - piece.cells[1], cube.code(charts[piece.charts[0]].place), piece.charts[0]));
    let (mut x, mut y, mut height) = (0, 0, 0);
    for piece in &mut pieces {
        let [wide, high] = piece.cells;
        if x + wide > edge {
            (x, y, height) = (0, y + height, 0);
        }
        if wide > edge || y + high > edge {
            return None;
        }
        piece.place = [x, y];
        (x, height) = (x + wide, height.max(high));
    }
    Some(pieces)
}

/// What the texels have found so far.
struct Filled {
    edge: u32,
    texels: Vec<Texel>,
    draws: Vec<Vec<Spot>>,
    /// How much of a texel the triangles of a chart have.
    covered: Vec<f32>,
    areas: Vec<f64>,
}

impl Filled {
    fn new(edge: u32, draws: u32) -> Self {
        let count = edge as usize * edge as usize;
        let draws = vec![vec![Spot::default(); count]; draws as usize];
        Self { edge, texels: vec![Texel::default(); count], draws, covered: vec![0.0; count], areas: vec![0.0; count] }
    }

    /// Whether another triangle lies where this one does.
    fn add(&mut self, triangle: u32, corners: &[Vec2; 3], area: f32) -> bool {
        let [a, b, c] = corners.map(Vec2::as_dvec2);
        let doubled = (b - a).perp_dot(c - a);
        if doubled == 0.0 {
            return false;
        }
        let area_of_texel = f64::from(area) / (0.5 * doubled.abs());
        let mut is_taken = false;
        let [left, right, top, bottom] = bounds(corners, self.edge);
        for y in top..=bottom {
            for x in left..=right {
                let polygon = part_within([a, b, c], [x, y]);
                let Some((part, middle)) = polygon.measured() else { continue };
                let at = (y * self.edge + x) as usize;
                self.covered[at] += part as f32;
                is_taken |= self.covered[at] > MOST_COVERED;
                let spot = |place: DVec2| {
                    let from = place + DVec2::new(f64::from(x), f64::from(y)) - a;
                    let weights = DVec2::new(from.perp_dot(c - a), (b - a).perp_dot(from)) / doubled;
                    let weights = weights.as_vec2().clamp(Vec2::ZERO, Vec2::ONE);
                    Spot { triangle: triangle + 1, barycentric: weights / weights.element_sum().max(1.0) }
                };
                self.stand_for(triangle, at, part * area_of_texel, spot(middle), |[first, second, third]| spot(polygon.point(first, [second, third])));
            }
        }
        is_taken
    }

    /// Adds one that lies wholly in a texel.
    fn add_crumb(&mut self, triangle: u32, [x, y]: [u32; 2], area: f32) {
        let spot = |barycentric| Spot { triangle: triangle + 1, barycentric };
        let anywhere = |[_, u, v]: [f32; 3]| if u + v > 1.0 { Vec2::new(1.0 - u, 1.0 - v) } else { Vec2::new(u, v) };
        self.stand_for(triangle, (y * self.edge + x) as usize, f64::from(area), spot(Vec2::splat(1.0 / 3.0)), |by| spot(anywhere(by)));
    }

    /// Adds a triangle's part of a texel. Of all parts any stands for the texel by chance, the larger the more likely, in the middle and at `any` point: those that have most see more
    /// than others, and all would be too bright.
    fn stand_for(&mut self, triangle: u32, at: usize, area: f64, middle: Spot, any: impl Fn([f32; 3]) -> Spot) {
        self.areas[at] += area;
        let seed = combine(at as u32, triangle);
        let stands = |seed: u32| f64::from(unit(hash(seed))) * self.areas[at] < area;
        if stands(seed) {
            self.texels[at].spot = middle;
        }
        for (number, draw) in (1..).zip(&mut self.draws) {
            let seed = combine(seed, number);
            if stands(seed) {
                draw[at] = any([1, 2, 3].map(|number| unit(combine(seed, number))));
            }
        }
    }

    fn stands_for(&self, triangle: u32, corners: &[[Vec2; 3]]) -> bool {
        let [left, right, top, bottom] = bounds(&corners[triangle as usize], self.edge);
        (top..=bottom).any(|y| (left..=right).any(|x| self.texels[(y * self.edge + x) as usize].spot.triangle == triangle + 1))
    }

    fn finish(self) -> (Vec<Texel>, Vec<Vec<Spot>>) {
        (self.texels.into_iter().zip(self.areas).map(|(texel, area)| Texel { area: area as f32, ..texel }).collect(), self.draws)
    }
}

/// The first and the last column and row that a triangle touches.
fn bounds(corners: &[Vec2; 3], edge: u32) -> [u32; 4] {
    let low = corners[0].min(corners[1]).min(corners[2]);
    let high = corners[0].max(corners[1]).max(corners[2]);
    [low.x, high.x, low.y, high.y].map(|side| (side.floor().max(0.0) as u32).min(edge - 1))
}

/// What a triangle has of a texel, from its lower left.
fn part_within(triangle: [DVec2; 3], [x, y]: [u32; 2]) -> Polygon {
    let corner = DVec2::new(f64::from(x), f64::from(y));
    let mut polygon = Polygon { corners: [DVec2::ZERO; MOST_CORNERS], count: 3 };
    polygon.corners[..3].copy_from_slice(&triangle.map(|at| at - corner));
    for axis in 0..2 {
        polygon = polygon.cut(|at| at[axis]).cut(|at| 1.0 - at[axis]);
    }
    polygon
}

/// Of a triangle that four lines have cut.
const MOST_CORNERS: usize = 8;

struct Polygon {
    corners: [DVec2; MOST_CORNERS],
    count: usize,
}

impl Polygon {
    /// What is left of it where a linear function is not below 0.
    fn cut(&self, inside: impl Fn(DVec2) -> f64) -> Self {
        let mut left = Self { corners: [DVec2::ZERO; MOST_CORNERS], count: 0 };
        let mut push = |corner| {
            if left.count < MOST_CORNERS {
                left.corners[left.count] = corner;
                left.count += 1;
            }
        };
        for at in 0..self.count {
            let (from, to) = (self.corners[at], self.corners[(at + 1) % self.count]);
            let (of_from, of_to) = (inside(from), inside(to));
            if of_from >= 0.0 {
                push(from);
            }
            if (of_from >= 0.0) != (of_to >= 0.0) {
                push(from + (to - from) * (of_from / (of_from - of_to)));
            }
        }
        left
    }

    /// Any point of it by three numbers up to 1: one finds which of the triangles it is made of, two the point there.
    fn point(&self, first: f32, [u, v]: [f32; 2]) -> DVec2 {
        let doubled = |at: usize| (self.corners[at - 1] - self.corners[0]).perp_dot(self.corners[at] - self.corners[0]).abs();
        let mut rest = f64::from(first) * (2..self.count).map(doubled).sum::<f64>();
        let found = (2..self.count).find(|at| {
            rest -= doubled(*at);
            rest < 0.0
        });
        let at = found.unwrap_or(self.count - 1);
        let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] }.map(f64::from);
        self.corners[0] + (self.corners[at - 1] - self.corners[0]) * u + (self.corners[at] - self.corners[0]) * v
    }

    /// Its area and its middle; none where it has no area.
    fn measured(&self) -> Option<(f64, DVec2)> {
        let (mut doubled, mut moment) = (0.0, DVec2::ZERO);
        for at in 2..self.count {
            let [a, b, c] = [self.corners[0], self.corners[at - 1], self.corners[at]];
            let part = (b - a).perp_dot(c - a);
            doubled += part;
            moment += part * (a + b + c) / 3.0;
        }
        (doubled.abs() > 1e-9).then(|| (0.5 * doubled.abs(), moment / doubled))
    }
}

/// Triangles that go on into each other.
fn smooth_groups(scene: &Scene) -> Vec<Vec<u32>> {
    let mesh = Mesh::new(scene);
    let mut seeds: Vec<u32> = (0..scene.triangles.len() as u32).collect();
    let doubled: Vec<f32> = seeds.iter().map(|number| scene.at_rest(*number).cross().length()).collect();
    seeds.sort_by(|a, b| doubled[*b as usize].total_cmp(&doubled[*a as usize]).then(a.cmp(b)));
    let mut taken = vec![false; scene.triangles.len()];
    let mut groups = Vec::new();
    for seed in seeds {
        let axis = scene.at_rest(seed).face_normal();
        if axis == Vec3::ZERO || std::mem::replace(&mut taken[seed as usize], true) {
            continue;
        }
        let mut group = vec![seed];
        let mut next = 0;
        while let Some(&from) = group.get(next) {
            next += 1;
            for to in mesh.neighbours[from as usize].into_iter().filter(|to| *to != NONE) {
                if !taken[to as usize] && scene.at_rest(to).face_normal().dot(axis) > TURNED && mesh.goes_on(from, to) {
                    taken[to as usize] = true;
                    group.push(to);
                }
            }
        }
        groups.push(group);
    }
    groups
}

const NONE: u32 = u32::MAX;

/// Which triangles share an edge.
struct Mesh<'a> {
    scene: &'a Scene,
    /// Numbers of the corners: those at the same place have the same.
    corners: Vec<[u32; 3]>,
    /// Along each edge, from the one between corners 0 and 1 on.
    neighbours: Vec<[u32; 3]>,
    /// What moves by itself.
    objects: Vec<usize>,
}

impl<'a> Mesh<'a> {
    fn new(scene: &'a Scene) -> Self {
        let mut numbers = HashMap::new();
        let mut number = |at: Vec3| {
            // 0 and −0 are the same place.
            let next = numbers.len() as u32;
            *numbers.entry((at + 0.0).to_array().map(f32::to_bits)).or_insert(next)
        };
        let corners: Vec<[u32; 3]> = (0..scene.triangles.len() as u32).map(|triangle| scene.at_rest(triangle).positions.map(&mut number)).collect();
        let sides = |(triangle, corners): (u32, &[u32; 3])| {
            let corners = *corners;
            (0..3).map(move |side| {
                let [a, b] = [corners[side], corners[(side + 1) % 3]];
                (a.min(b), a.max(b), triangle, side)
            })
        };
        let mut edges: Vec<(u32, u32, u32, usize)> = (0..).zip(&corners).flat_map(sides).collect();
        edges.sort_unstable();
        let mut neighbours = vec![[NONE; 3]; corners.len()];
        for shared in edges.chunk_by(|one, other| (one.0, one.1) == (other.0, other.1)) {
            if let [(.., a, side_a), (.., b, side_b)] = *shared {
                neighbours[a as usize][side_a] = b;
                neighbours[b as usize][side_b] = a;
            }
        }
        let mut objects = vec![usize::MAX; corners.len()];
        for (number, object) in scene.objects.iter().enumerate() {
            objects[object.triangles.clone()].fill(number);
        }
        Self { scene, corners, neighbours, objects }
    }

    /// Whether there is no edge between two triangles that share two corners.
    fn goes_on(&self, from: u32, to: u32) -> bool {
        let [from, to] = [from, to].map(|number| number as usize);
        let normal = |number: usize, corner: u32| {
            let at = self.corners[number].iter().position(|own| *own == corner)?;
            let triangle: &Triangle = self.scene.at_rest(number as u32);
            Some(triangle.normals[at])
        };
        let shared = self.corners[from].iter().filter_map(|corner| Some((normal(from, *corner)?, normal(to, *corner)?)));
        self.objects[from] == self.objects[to] && shared.fold(true, |smooth, (one, other)| smooth && one.dot(other) > SMOOTH)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EDGE: u32 = 128;

    fn triangle(positions: [Vec3; 3]) -> Triangle {
        let normal = (positions[1] - positions[0]).cross(positions[2] - positions[0]).normalize_or_zero();
        Triangle { positions, normals: [normal; 3], uvs: [Vec2::ZERO; 3], tints: Default::default(), material: 0 }
    }

    fn quad([a, b, c, d]: [Vec3; 4]) -> [Triangle; 2] {
        [[a, b, c], [a, c, d]].map(triangle)
    }

    fn of(triangles: Vec<Triangle>) -> Scene {
        Scene { triangles, ..Scene::default() }
    }

    /// A floor, and a wall of the same size on its edge.
    fn corner() -> Scene {
        let [o, x, y, z] = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        of([quad([o, x, x + y, y]), quad([o, z, z + x, x])].concat())
    }

    /// A wall that winds around a pole, far enough to lie over itself as it is flattened.
    fn spiral() -> Scene {
        let at = |step: usize| {
            let turn = 0.1 * step as f32;
            (Vec3::new(turn.cos(), turn.sin(), 0.002 * step as f32), Vec3::new(2.0 * turn.cos(), 2.0 * turn.sin(), 0.002 * step as f32))
        };
        of((0..100)
            .flat_map(|step| {
                let ((a, b), (d, c)) = (at(step), at(step + 1));
                quad([a, b, c, d]).map(|triangle| Triangle { normals: [Vec3::Z; 3], ..triangle })
            })
            .collect())
    }

    fn area(scene: &Scene) -> f64 {
        scene.triangles.iter().map(|triangle| 0.5 * f64::from(triangle.cross().length())).sum()
    }

    fn texel_at(atlas: &Atlas, at: Vec2) -> &Texel {
        &atlas.texels[(at.y as u32 * atlas.edge + at.x as u32) as usize]
    }

    #[test]
    fn texels_have_the_area_of_the_surfaces() {
        for (scene, by) in [(corner(), Charts::Smooth), (corner(), Charts::Each), (spiral(), Charts::Smooth)] {
            let atlas = Atlas::new(&scene, EDGE, by, 0);
            let sum: f64 = atlas.texels.iter().map(|texel| f64::from(texel.area)).sum();
            assert!((sum - area(&scene)).abs() < 1e-4 * area(&scene), "{sum}");
        }
    }

    #[test]
    fn surfaces_without_an_edge_are_one_chart() {
        assert_eq!(Atlas::new(&corner(), EDGE, Charts::Smooth, 0).charts, 2);
        assert_eq!(Atlas::new(&corner(), EDGE, Charts::Each, 0).charts, 4);
    }

    #[test]
    fn a_texel_stands_for_points_within_itself() {
        for scene in [corner(), spiral()] {
            let atlas = Atlas::new(&scene, EDGE, Charts::Smooth, 3);
            assert_eq!(atlas.crowded, 0);
            for (place, texel) in (0..).zip(&atlas.texels) {
                for spot in atlas.draws.iter().map(|draw| draw[place as usize]).chain([texel.spot]) {
                    let Some(triangle) = spot.triangle.checked_sub(1) else { continue };
                    let [a, b, c] = atlas.corners[triangle as usize];
                    let at = a + (b - a) * spot.barycentric.x + (c - a) * spot.barycentric.y;
                    let [x, y] = [place % EDGE, place / EDGE].map(|side| side as f32);
                    assert!((at - Vec2::new(x, y)).min_element() > -1e-3 && (at - Vec2::new(x, y)).max_element() < 1.001, "{at} in {x}, {y}");
                }
            }
        }
    }

    #[test]
    fn draws_are_anywhere_on_the_surface() {
        // A wall of two triangles, whose texels are of either as much as they have of it.
        let draws = 400;
        let scene = of(quad([Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y]).to_vec());
        let atlas = Atlas::new(&scene, 8, Charts::Smooth, draws);
        let (mut sum, mut moment, mut area) = (Vec3::ZERO, Vec3::ZERO, 0.0);
        for (place, texel) in atlas.texels.iter().enumerate().filter(|(_, texel)| texel.area > 0.0) {
            for draw in &atlas.draws {
                let at = scene.at_rest(draw[place].triangle - 1).position(draw[place].barycentric);
                (sum, moment, area) = (sum + at * texel.area, moment + at * at * texel.area, area + texel.area);
            }
        }
        let (mean, square) = (sum / area, moment / area);
        assert!((mean.truncate() - 0.5).abs().max_element() < 2e-3, "{mean}");
        assert!((square.truncate() - 1.0 / 3.0).abs().max_element() < 2e-3, "{square}");
    }

    #[test]
    fn every_point_has_a_texel_of_its_chart() {
        let scene = corner();
        let atlas = Atlas::new(&scene, EDGE, Charts::Smooth, 0);
        for (number, [a, b, c]) in (0u32..).zip(&atlas.corners) {
            for step in 0..400 {
                let [u, v] = [step % 20, step / 20].map(|step| step as f32 / 20.0);
                if u + v > 1.0 {
                    continue;
                }
                let at = a + (b - a) * u + (c - a) * v;
                let there = texel_at(&atlas, at).spot.triangle;
                assert_eq!(atlas.chart_of[there as usize - 1], atlas.chart_of[number as usize], "{at}");
            }
        }
    }

    #[test]
    fn what_would_lie_on_itself_is_taken_apart() {
        let atlas = Atlas::new(&spiral(), EDGE, Charts::Smooth, 0);
        assert_eq!(atlas.charts, 200);
    }

    #[test]
    fn crumbs_share_texels_so_that_all_find_room() {
        let many =
            of((0..500).flat_map(|at| quad([Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y].map(|corner| 0.1 * corner + Vec3::Z * at as f32))).collect());
        let atlas = Atlas::new(&many, 16, Charts::Each, 0);
        assert_eq!(atlas.charts, 1000);
        let taken = atlas.texels.iter().filter(|texel| texel.spot.triangle != 0).count();
        assert!(taken <= 256 && atlas.crowded >= 1000 - taken, "{taken}");
        let sum: f64 = atlas.texels.iter().map(|texel| f64::from(texel.area)).sum();
        assert!((sum - area(&many)).abs() < 1e-4 * area(&many));
        assert!(atlas.corners.iter().zip(&atlas.chart_of).all(|([corner, ..], chart)| {
            let there = texel_at(&atlas, *corner).spot.triangle;
            there != 0 && atlas.chart_of[there as usize - 1] == *chart
        }));
    }

    #[test]
    fn surfaces_without_area_have_no_texel() {
        let scene = of(vec![triangle([Vec3::ZERO; 3]), quad([Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y])[0]]);
        let atlas = Atlas::new(&scene, 16, Charts::Smooth, 0);
        assert!(atlas.texels.iter().all(|texel| texel.spot.triangle != 1));
        let empty = Atlas::new(&of(Vec::new()), 16, Charts::Smooth, 0);
        assert!(empty.texels.iter().all(|texel| *texel == Texel::default()));
    }

    #[test]
    fn more_triangles_than_texels_are_told() {
        let fine = 40;
        let at = |x: i32, y: i32| Vec3::new(x as f32, y as f32, 0.0);
        let scene = of((0..fine * fine)
            .flat_map(|cell| {
                let [x, y] = [cell % fine, cell / fine];
                quad([at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)])
            })
            .collect());
        let atlas = Atlas::new(&scene, 16, Charts::Smooth, 0);
        assert_eq!(atlas.charts, 1);
        assert!(atlas.crowded > 2000 && atlas.crowded < 3200);
    }
}
