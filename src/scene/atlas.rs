//! A scene's surfaces laid out in a square: what a lightmap keeps light by.
//!
//! Triangles that go on into each other without an edge make a chart, which is flattened on the plane of its first triangle. All charts have the same scale, and none has a
//! part of another's texel. Where several triangles of a chart meet in a texel, it stands for any of them by chance, at the middle of its part, with the area of all: the areas of
//! the texels add up to that of the surfaces. Things that move are laid out as they are at rest. Charts of less than half a texel are crumbs: those that lie close together and face a similar way share a texel.
//! A cell of the square that a wall stands on is a texel for each part that the wall leaves of it.

use super::{Scene, Triangle};
use crate::math::random::{combine, hash, unit};
use crate::math::{frame::Frame, morton::Cube};
use glam::{DVec2, Vec2, Vec3};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};
use walls::{PARTS, POINTS, Place, Walls};

pub mod walls;

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
    /// Cells along an edge.
    pub edge: u32,
    /// Of each triangle [cells]; all the same where it has no area.
    pub corners: Vec<[Vec2; 3]>,
    /// Of each triangle, from 1 on; 0 where it has no area.
    pub chart_of: Vec<u32>,
    /// Row by row.
    pub cells: Vec<Cell>,
    /// Neighbours in space after each other, those of a cell too.
    pub texels: Vec<Texel>,
    /// Other points that the same texels stand for, any of their surface by chance, as often as was asked for.
    pub draws: Vec<Vec<Spot>>,
    /// Of each texel and side, which texel of each of the eight [neighbours](walls::NEIGHBOURS) of its cell goes on from it: two bits each, 0 for none, otherwise its number in that cell + 1; then a bit for
    /// each neighbour of the same chart.
    pub links: Vec<u32>,
    /// How many charts there are.
    pub charts: usize,
    /// Cells that walls go through, of which each part is a texel, but for what is within something solid.
    pub cut: usize,
    /// Cells that are within something solid as a whole.
    pub buried: usize,
    /// Cells that walls go through, and for whose parts there is no room.
    pub uncut: usize,
    /// Triangles with an area that no texel stands for: what is kept for them is that of others beside them.
    pub crowded: usize,
}

/// A square of the texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Cell {
    /// The number of its first texel + 1; 0 where it has none.
    pub first: u32,
    /// Where the parts of a cell of several texels are: of each the middle and its reach, 8 bits each; 0 where there is none.
    pub parts: [u32; PARTS],
}

impl Cell {
    /// Texels.
    pub fn count(&self) -> usize {
        let parts = self.parts.iter().filter(|part| **part != 0).count();
        if self.first == 0 { 0 } else { parts.max(1) }
    }
}

/// What a texel stands for.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Texel {
    /// In the middle of one of its triangles' parts.
    pub spot: Spot,
    /// Of all surfaces in it, at rest, but for what is within something solid: 0 where that is all [scene units²].
    pub area: f32,
    /// Row by row.
    pub cell: u32,
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
/// Points by which it is found whether a wall goes through a cell.
const FEWEST_DRAWS: u32 = 4;
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

/// What is asked of an atlas.
#[derive(Debug, Clone, Copy)]
pub struct Wanted {
    /// Cells along an edge.
    pub edge: u32,
    /// Which triangles lie together.
    pub charts: Charts,
    /// Points of each texel by chance, beside the one in its middle.
    pub draws: u32,
    /// 2 where surfaces are seen from both sides, otherwise 1.
    pub sides: u32,
}

impl Atlas {
    /// Of all triangles that have an area.
    pub fn new(scene: &Scene, wanted: Wanted) -> Self {
        let groups = match wanted.charts {
            Charts::Smooth => smooth_groups(scene),
            Charts::Each => {
                (0..scene.triangles.len() as u32).filter(|number| scene.at_rest(*number).face_normal() != Vec3::ZERO).map(|number| vec![number]).collect()
            }
        };
        let (laid, folded) = Laid::new(scene, wanted.edge, &groups);
        if folded.iter().all(|folded| !folded) {
            return laid.atlas(scene, wanted);
        }
        let alone = |group: Vec<u32>| group.into_iter().map(|number| vec![number]).collect();
        let apart = groups.into_iter().zip(folded).flat_map(|(group, folded)| if folded { alone(group) } else { vec![group] });
        Laid::new(scene, wanted.edge, &apart.collect::<Vec<_>>()).0.atlas(scene, wanted)
    }
}

/// Where triangles lie.
struct Laid {
    edge: u32,
    /// Cells a scene unit.
    scale: f32,
    charts: usize,
    corners: Vec<[Vec2; 3]>,
    /// Of each triangle, from 1 on; 0 where it has no area.
    chart_of: Vec<u32>,
    /// With the cell of those that lie wholly in one.
    triangles: Vec<(u32, Option<[u32; 2]>)>,
}

impl Laid {
    /// With which groups lie on themselves.
    fn new(scene: &Scene, edge: u32, groups: &[Vec<u32>]) -> (Self, Vec<bool>) {
        let charts: Vec<Chart> = groups.iter().map(|group| Chart::new(scene, group)).collect();
        let Layout { scale, pieces } = Layout::new(&charts, edge);
        let mut laid = Self {
            edge,
            scale,
            charts: charts.len(),
            corners: vec![[Vec2::ZERO; 3]; scene.triangles.len()],
            chart_of: vec![0; scene.triangles.len()],
            triangles: Vec::new(),
        };
        let mut group_of = vec![0; scene.triangles.len()];
        for (number, piece) in (1..).zip(&pieces) {
            let origin = Vec2::new(piece.place[0] as f32, piece.place[1] as f32);
            for &at in &piece.charts {
                for (&triangle, flat) in charts[at].triangles.iter().zip(&charts[at].corners) {
                    laid.chart_of[triangle as usize] = number;
                    group_of[triangle as usize] = at;
                    laid.corners[triangle as usize] = if piece.is_of_crumbs { [origin + 0.5; 3] } else { flat.map(|corner| origin + INSET + corner * scale) };
                    laid.triangles.push((triangle, piece.is_of_crumbs.then_some(piece.place)));
                }
            }
        }
        let mut folded = vec![false; charts.len()];
        let mut covered = vec![0.0; (edge * edge) as usize];
        let is_alone = |triangle: &u32| groups[group_of[*triangle as usize]].len() == 1;
        for (triangle, _) in laid.triangles.iter().filter(|(triangle, crumb)| crumb.is_none() && !is_alone(triangle)) {
            let corners = &laid.corners[*triangle as usize];
            let group = &mut folded[group_of[*triangle as usize]];
            for (at, cell) in touched(corners, edge) {
                let covered: &mut f32 = &mut covered[at as usize];
                *covered += part_within(corners.map(Vec2::as_dvec2), cell).measured().map_or(0.0, |(part, _)| part as f32);
                *group |= *covered > MOST_COVERED;
            }
        }
        (laid, folded)
    }

    fn fill(&self, scene: &Scene, mut filled: Filled) -> Filled {
        for (triangle, crumb) in &self.triangles {
            let area = 0.5 * scene.at_rest(*triangle).cross().length();
            match crumb {
                Some(cell) => filled.add_crumb(*triangle, *cell, area),
                None => filled.add(*triangle, &self.corners[*triangle as usize], area),
            }
        }
        filled
    }

    fn atlas(self, scene: &Scene, wanted: Wanted) -> Atlas {
        let all: Vec<u32> = (0..self.edge * self.edge).collect();
        let filled = self.fill(scene, Filled::new(self.edge, wanted.draws.max(FEWEST_DRAWS), &all));
        let crowded = self.triangles.iter().filter(|(number, _)| !filled.stands_for(*number, &self.corners)).count();
        let charts = self.charts_of_cells(&filled);
        let walls = Walls::new(scene, 1.0 / self.scale.max(f32::MIN_POSITIVE));
        let (cut, uncut) = self.cut(scene, (&filled, &charts), &walls, wanted.sides);
        let mut cells = vec![Cell::default(); all.len()];
        let mut parts: Vec<Part> = Vec::with_capacity(all.len());
        for at in self.in_space(scene, &filled) {
            let cell = &mut cells[at as usize];
            cell.first = parts.len() as u32 + 1;
            let area = filled.areas[at as usize];
            match cut.get(&at) {
                Some(Cut { parts: own, share }) => {
                    cell.parts = self.packed(at, own);
                    let count: usize = own.iter().map(Vec::len).sum();
                    let area = |points: &Vec<Place>| (area * share * points.len() as f64 / count as f64) as f32;
                    parts.extend(own.iter().map(|points| Part { cell: at, area: area(points), points: points.clone() }));
                }
                None => parts.push(Part { cell: at, area: area as f32, points: vec![self.place(scene, filled.spots[at as usize])] }),
            }
        }
        let draw = |number: usize| {
            let of_part = |part: &Part| match cut.contains_key(&part.cell) {
                true => part.points[number % part.points.len()].spot,
                false => filled.draws[number][part.cell as usize],
            };
            parts.iter().map(of_part).collect()
        };
        let links = walls.links(&parts, (&cells, &charts), [self.edge, wanted.sides]);
        Atlas {
            edge: self.edge,
            cells,
            draws: (0..wanted.draws as usize).map(draw).collect(),
            links,
            texels: parts.iter().map(|part| Texel { spot: part.points[0].spot, area: part.area, cell: part.cell }).collect(),
            corners: self.corners,
            chart_of: self.chart_of,
            charts: self.charts,
            cut: cut.values().filter(|cut| cut.share > 0.0).count(),
            buried: cut.values().filter(|cut| cut.share == 0.0).count(),
            uncut,
            crowded,
        }
    }

    /// Of each cell, [`NONE`] where there is none or crumbs share it, which have nothing in common.
    fn charts_of_cells(&self, filled: &Filled) -> Vec<u32> {
        let mut charts: Vec<u32> =
            filled.spots.iter().map(|spot| spot.triangle.checked_sub(1).map_or(NONE, |triangle| self.chart_of[triangle as usize])).collect();
        for [x, y] in self.triangles.iter().filter_map(|(_, crumb)| *crumb) {
            charts[(y * self.edge + x) as usize] = NONE;
        }
        charts
    }

    /// The cells that walls go through, and of those the ones for which there is no room.
    fn cut(&self, scene: &Scene, (filled, charts): (&Filled, &[u32]), walls: &Walls, sides: u32) -> (HashMap<u32, Cut>, usize) {
        let is_crossed = |cell: &u32| {
            let mut within = filled.draws.iter().map(|draw| draw[*cell as usize]).filter(|spot| spot.triangle != 0).map(|spot| self.place(scene, spot));
            let chart = charts[*cell as usize];
            if chart == NONE {
                return within.any(|place| walls.is_buried(&place, sides as usize));
            }
            let beside = neighbours(*cell, self.edge).flatten().filter(|other| charts[*other as usize] == chart).map(|other| filled.spots[other as usize]);
            walls.is_between(&self.place(scene, filled.spots[*cell as usize]), within.chain(beside.map(|spot| self.place(scene, spot))), sides as usize)
        };
        let mut crossed: Vec<u32> = (0..self.edge * self.edge).into_par_iter().filter(is_crossed).collect();
        // There are no more texels than an atlas without walls may have.
        let free = filled.spots.iter().filter(|spot| spot.triangle == 0).count();
        let too_many = crossed.len().saturating_sub(free / (PARTS - 1));
        crossed.truncate(crossed.len() - too_many);
        let points = self.fill(scene, Filled::new(self.edge, POINTS as u32, &crossed));
        let parts = |(slot, cell): (usize, &u32)| {
            let points: Vec<Place> = points.draws.iter().map(|draw| self.place(scene, draw[slot])).collect();
            Cut::of(&points, charts[*cell as usize] == NONE, walls, sides as usize).map(|cut| (*cell, cut))
        };
        let mut cut: HashMap<u32, Cut> = crossed.par_iter().enumerate().filter_map(parts).collect();
        let middle = |cell: u32| Some(filled.spots[cell as usize]).filter(|spot| spot.triangle != 0).map(|spot| self.place(scene, spot));
        let is_open = |cell: &u32| charts[*cell as usize] != NONE && crossed.binary_search(cell).is_err();
        let buried = |cell: u32| Some((cell, middle(cell).filter(|place| walls.is_buried(place, sides as usize))?));
        let whole: Vec<(u32, Place)> = (0..self.edge * self.edge).into_par_iter().filter(is_open).filter_map(buried).collect();
        cut.extend(whole.into_iter().map(|(cell, place)| (cell, Cut { parts: vec![vec![place]], share: 0.0 })));
        (cut, too_many)
    }

    /// Where the parts of a cell are within it.
    fn packed(&self, cell: u32, parts: &[Vec<Place>]) -> [u32; PARTS] {
        let corner = Vec2::new((cell % self.edge) as f32, (cell / self.edge) as f32);
        let within = |part: &[Place]| part.iter().map(|place| place.at - corner).collect::<Vec<_>>();
        std::array::from_fn(|number| {
            let Some(own) = parts.get(number) else { return 0 };
            let others: Vec<Vec2> = (0..).zip(parts).filter(|(other, _)| *other != number).flat_map(|(_, part)| within(part)).collect();
            walls::packed(&within(own), &others)
        })
    }

    /// The cells that stand for something, neighbours in space after each other.
    fn in_space(&self, scene: &Scene, filled: &Filled) -> Vec<u32> {
        let taken = || (0u32..).zip(&filled.spots).filter(|(_, spot)| spot.triangle != 0).map(|(cell, spot)| (self.place(scene, *spot).position, cell));
        let low = taken().fold(Vec3::INFINITY, |low, (position, _)| low.min(position));
        let high = taken().fold(Vec3::NEG_INFINITY, |high, (position, _)| high.max(position));
        let cube = Cube::around(low, high);
        let mut cells: Vec<(u32, u32)> = taken().map(|(position, cell)| (cube.code(position), cell)).collect();
        cells.sort_unstable();
        cells.into_iter().map(|(_, cell)| cell).collect()
    }

    fn place(&self, scene: &Scene, spot: Spot) -> Place {
        let [a, b, c] = self.corners[spot.triangle as usize - 1];
        let triangle = scene.at_rest(spot.triangle - 1);
        let at = a + (b - a) * spot.barycentric.x + (c - a) * spot.barycentric.y;
        Place { spot, at, position: triangle.position(spot.barycentric), normal: triangle.face_normal() }
    }
}

/// The eight cells around one, none beyond an edge.
fn neighbours(cell: u32, edge: u32) -> impl Iterator<Item = Option<u32>> {
    walls::NEIGHBOURS.into_iter().map(move |[x, y]| {
        let at = [(cell % edge) as i32 + x, (cell / edge) as i32 + y];
        at.iter().all(|at| (0..edge as i32).contains(at)).then(|| at[1] as u32 * edge + at[0] as u32)
    })
}

/// What walls leave of a cell.
struct Cut {
    /// Points of each part, the largest first.
    parts: Vec<Vec<Place>>,
    /// Of the cell's area, what is seen: 0 where all of it is within something solid.
    share: f64,
}

impl Cut {
    /// None where the cell is whole. Crumbs share a cell whatever is between them.
    fn of(points: &[Place], are_crumbs: bool, walls: &Walls, sides: usize) -> Option<Self> {
        let is_buried = |point: &Place| walls.is_buried(point, sides);
        let all: Vec<Vec<Place>> = if are_crumbs {
            let (buried, seen): (Vec<Place>, Vec<Place>) = points.iter().partition(|point| is_buried(point));
            [seen, buried].into_iter().filter(|part| !part.is_empty()).collect()
        } else {
            walls.parts(points, sides).iter().map(|part| part.iter().map(|point| points[*point]).collect()).collect()
        };
        // Points of a part see each other: what most of them tell is so for all.
        let is_seen = |part: &&Vec<Place>| 2 * part.iter().filter(|point| is_buried(point)).count() <= part.len();
        let mut parts: Vec<Vec<Place>> = all.iter().filter(is_seen).cloned().collect();
        let share = parts.iter().map(Vec::len).sum::<usize>() as f64 / points.len() as f64;
        if parts.is_empty() {
            parts.extend(all.first().cloned());
        }
        parts.truncate(PARTS);
        (all.len() > 1 || share < 1.0).then_some(Self { parts, share })
    }
}

/// What becomes a texel.
struct Part {
    cell: u32,
    area: f32,
    points: Vec<Place>,
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

/// What some of the cells have found so far.
struct Filled {
    edge: u32,
    /// Of each cell, where it is in what follows; [`NONE`] of others.
    slots: Vec<u32>,
    /// In the middle of one of a cell's parts.
    spots: Vec<Spot>,
    draws: Vec<Vec<Spot>>,
    areas: Vec<f64>,
}

impl Filled {
    fn new(edge: u32, draws: u32, cells: &[u32]) -> Self {
        let mut slots = vec![NONE; (edge * edge) as usize];
        (0..).zip(cells).for_each(|(slot, cell)| slots[*cell as usize] = slot);
        let draws = vec![vec![Spot::default(); cells.len()]; draws as usize];
        Self { edge, slots, spots: vec![Spot::default(); cells.len()], draws, areas: vec![0.0; cells.len()] }
    }

    fn add(&mut self, triangle: u32, corners: &[Vec2; 3], area: f32) {
        let flat @ [a, b, c] = corners.map(Vec2::as_dvec2);
        let doubled = (b - a).perp_dot(c - a);
        if doubled == 0.0 {
            return;
        }
        let area_of_texel = f64::from(area) / (0.5 * doubled.abs());
        for (at, cell) in touched(corners, self.edge) {
            if self.slots[at as usize] == NONE {
                continue;
            }
            let polygon = part_within(flat, cell);
            let Some((part, middle)) = polygon.measured() else { continue };
            let spot = |place: DVec2| {
                let from = place + DVec2::from(cell.map(f64::from)) - a;
                let weights = DVec2::new(from.perp_dot(c - a), (b - a).perp_dot(from)) / doubled;
                let weights = weights.as_vec2().clamp(Vec2::ZERO, Vec2::ONE);
                Spot { triangle: triangle + 1, barycentric: weights / weights.element_sum().max(1.0) }
            };
            self.stand_for(triangle, at, part * area_of_texel, spot(middle), |[first, second, third]| spot(polygon.point(first, [second, third])));
        }
    }

    /// Adds one that lies wholly in a cell.
    fn add_crumb(&mut self, triangle: u32, [x, y]: [u32; 2], area: f32) {
        let spot = |barycentric| Spot { triangle: triangle + 1, barycentric };
        let anywhere = |[_, u, v]: [f32; 3]| if u + v > 1.0 { Vec2::new(1.0 - u, 1.0 - v) } else { Vec2::new(u, v) };
        self.stand_for(triangle, y * self.edge + x, f64::from(area), spot(Vec2::splat(1.0 / 3.0)), |by| spot(anywhere(by)));
    }

    /// Adds a triangle's part of a cell. Of all parts any stands for the cell by chance, the larger the more likely, in the middle and at `any` point: those that have most see more
    /// than others, and all would be too bright.
    fn stand_for(&mut self, triangle: u32, cell: u32, area: f64, middle: Spot, any: impl Fn([f32; 3]) -> Spot) {
        let Some(areas) = self.areas.get_mut(self.slots[cell as usize] as usize) else { return };
        *areas += area;
        let (at, all) = (self.slots[cell as usize] as usize, *areas);
        let seed = combine(cell, triangle);
        let stands = |seed: u32| f64::from(unit(hash(seed))) * all < area;
        if stands(seed) {
            self.spots[at] = middle;
        }
        for (number, draw) in (1..).zip(&mut self.draws) {
            let seed = combine(seed, number);
            if stands(seed) {
                draw[at] = any([1, 2, 3].map(|number| unit(combine(seed, number))));
            }
        }
    }

    fn stands_for(&self, triangle: u32, corners: &[[Vec2; 3]]) -> bool {
        touched(&corners[triangle as usize], self.edge).any(|(at, _)| self.spots[at as usize].triangle == triangle + 1)
    }
}

/// The cells that a triangle may touch, and their columns and rows.
fn touched(corners: &[Vec2; 3], edge: u32) -> impl Iterator<Item = (u32, [u32; 2])> + use<> {
    let [left, right, top, bottom] = bounds(corners, edge);
    (top..=bottom).flat_map(move |y| (left..=right).map(move |x| (y * edge + x, [x, y])))
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
    use crate::scene::{Light, LightKind};

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

    fn wanted(edge: u32, charts: Charts, draws: u32) -> Wanted {
        Wanted { edge, charts, draws, sides: 1 }
    }

    fn texel_at(atlas: &Atlas, at: Vec2) -> &Texel {
        &atlas.texels[atlas.cells[(at.y as u32 * atlas.edge + at.x as u32) as usize].first as usize - 1]
    }

    #[test]
    fn texels_have_the_area_of_the_surfaces() {
        for (scene, by) in [(corner(), Charts::Smooth), (corner(), Charts::Each), (spiral(), Charts::Smooth)] {
            let atlas = Atlas::new(&scene, wanted(EDGE, by, 0));
            let sum: f64 = atlas.texels.iter().map(|texel| f64::from(texel.area)).sum();
            assert!((sum - area(&scene)).abs() < 1e-4 * area(&scene), "{sum}");
        }
    }

    #[test]
    fn surfaces_without_an_edge_are_one_chart() {
        assert_eq!(Atlas::new(&corner(), wanted(EDGE, Charts::Smooth, 0)).charts, 2);
        assert_eq!(Atlas::new(&corner(), wanted(EDGE, Charts::Each, 0)).charts, 4);
    }

    #[test]
    fn a_texel_stands_for_points_within_itself() {
        for scene in [corner(), spiral()] {
            let atlas = Atlas::new(&scene, wanted(EDGE, Charts::Smooth, 3));
            assert_eq!(atlas.crowded, 0);
            for (number, texel) in atlas.texels.iter().enumerate() {
                for spot in atlas.draws.iter().map(|draw| draw[number]).chain([texel.spot]) {
                    let [a, b, c] = atlas.corners[spot.triangle as usize - 1];
                    let at = a + (b - a) * spot.barycentric.x + (c - a) * spot.barycentric.y;
                    let [x, y] = [texel.cell % EDGE, texel.cell / EDGE].map(|side| side as f32);
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
        let atlas = Atlas::new(&scene, wanted(8, Charts::Smooth, draws));
        let (mut sum, mut moment, mut area) = (Vec3::ZERO, Vec3::ZERO, 0.0);
        for (place, texel) in atlas.texels.iter().enumerate() {
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
        let atlas = Atlas::new(&scene, wanted(EDGE, Charts::Smooth, 0));
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
        let atlas = Atlas::new(&spiral(), wanted(EDGE, Charts::Smooth, 0));
        assert_eq!(atlas.charts, 200);
    }

    #[test]
    fn crumbs_share_texels_so_that_all_find_room() {
        let many =
            of((0..500).flat_map(|at| quad([Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y].map(|corner| 0.1 * corner + Vec3::Z * at as f32))).collect());
        let atlas = Atlas::new(&many, wanted(16, Charts::Each, 0));
        assert_eq!(atlas.charts, 1000);
        let taken = atlas.texels.len();
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
        let atlas = Atlas::new(&scene, wanted(16, Charts::Smooth, 0));
        assert!(atlas.texels.iter().all(|texel| texel.spot.triangle != 1));
        let empty = Atlas::new(&of(Vec::new()), wanted(16, Charts::Smooth, 0));
        assert!(empty.texels.is_empty() && empty.cells.iter().all(|cell| cell.count() == 0));
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
        let atlas = Atlas::new(&scene, wanted(16, Charts::Smooth, 0));
        assert_eq!(atlas.charts, 1);
        assert!(atlas.crowded > 2000 && atlas.crowded < 3200);
    }

    /// A floor, and a wall through it that is as wide as told.
    fn divided(width: f32) -> Scene {
        let floor = quad([Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y]);
        let wall = |x: f32| quad([[-0.1, -0.1], [1.1, -0.1], [1.1, 0.5], [-0.1, 0.5]].map(|[y, z]| Vec3::new(x, y, z)));
        of([floor, wall(WALL), wall(WALL + width)].concat())
    }

    const WALL: f32 = 0.531;

    #[test]
    fn a_wall_cuts_texels() {
        for width in [0.0, 0.02, 0.2] {
            let scene = divided(width);
            let atlas = Atlas::new(&scene, wanted(32, Charts::Smooth, 4));
            let rooms = |number: usize| {
                let of_spot = |spot: &Spot| {
                    let at = scene.at_rest(spot.triangle - 1).position(spot.barycentric);
                    (at.z == 0.0).then(|| u32::from(at.x > WALL) + u32::from(at.x > WALL + width))
                };
                let spots = atlas.draws.iter().map(|draw| draw[number]).chain([atlas.texels[number].spot]);
                spots.map(|spot| of_spot(&spot)).collect::<Vec<_>>()
            };
            assert!(atlas.cut >= 8, "{}", atlas.cut);
            for (number, texel) in atlas.texels.iter().enumerate().filter(|(number, _)| rooms(*number)[0].is_some()) {
                let own = rooms(number);
                assert!(own.iter().all(|room| *room == own[0]), "{own:?}");
                for (bit, cell) in (0..).zip(neighbours(texel.cell, atlas.edge)) {
                    let Some(part) = (atlas.links[number] >> (walls::LINK_BITS * bit) & 3).checked_sub(1) else { continue };
                    let other = atlas.cells[cell.expect("links are within the texture") as usize].first - 1 + part;
                    assert_eq!(rooms(other as usize)[0], own[0], "{width}");
                }
            }
            let floor = (0..).zip(&atlas.texels).filter(|(number, _)| rooms(*number)[0].is_some());
            let sum: f64 = floor.map(|(_, texel)| f64::from(texel.area)).sum();
            assert!((sum - 1.0).abs() < 1e-4, "{sum}");
        }
    }

    /// A column through a floor, on texels that it covers wholly and in part.
    fn pierced() -> Scene {
        let [low, high] = [0.203, 0.531];
        let at = |x: f32, y: f32| [Vec3::new(x, y, -0.1), Vec3::new(x, y, 1.0)];
        let corners = [at(low, low), at(high, low), at(high, high), at(low, high)];
        let side = |number: usize| {
            let ([a, d], [b, c]) = (corners[number], corners[(number + 1) % 4]);
            quad([a, b, c, d])
        };
        let top = quad(corners.map(|[_, top]| top));
        let floor = quad([Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y]);
        of([floor.to_vec(), (0..4).flat_map(side).collect(), top.to_vec()].concat())
    }

    #[test]
    fn what_is_within_something_solid_counts_nothing() {
        let lamp = |position: Vec3| Light { name: "lamp".into(), kind: LightKind::Point { position, intensity: Vec3::ONE }, shadows: true };
        let seen = 1.0 - (0.531f32 - 0.203).powi(2);
        for (position, is_told) in [(Vec3::splat(0.9), true), (Vec3::splat(0.4), false)] {
            let scene = Scene { lights: vec![lamp(position)], ..pierced() };
            let atlas = Atlas::new(&scene, wanted(64, Charts::Smooth, 4));
            // How many points of a texel the column covers; none of what is no floor.
            let beneath = |number: usize| {
                let on_floor = scene.at_rest(atlas.texels[number].spot.triangle - 1).positions.iter().all(|corner| corner.z == 0.0);
                let spots = atlas.draws.iter().map(|draw| draw[number]);
                let within = spots.map(|spot| scene.at_rest(spot.triangle - 1).position(spot.barycentric).truncate());
                on_floor.then(|| within.filter(|at| at.min_element() > 0.203 && at.max_element() < 0.531).count())
            };
            let area: f32 = (0..).zip(&atlas.texels).filter(|(number, _)| beneath(*number) == Some(0)).map(|(_, texel)| texel.area).sum();
            assert!((area - seen).abs() < 2e-3, "{area} instead of {seen}");
            let is_shared = |cell: &&Cell| {
                let counts: Vec<usize> = (0..cell.count()).filter_map(|part| beneath(cell.first as usize - 1 + part)).collect();
                counts.contains(&0) && counts.iter().any(|count| *count > 0)
            };
            assert_eq!(atlas.cells.iter().filter(is_shared).count() == 0, is_told);
        }
    }

    #[test]
    fn where_nothing_is_between_texels_go_on_into_each_other() {
        // A smooth column, which bulges between texels.
        let at = |step: u32, z: f32| {
            let turn = std::f32::consts::TAU * step as f32 / 48.0;
            Vec3::new(turn.cos(), turn.sin(), z)
        };
        let side = |step: u32| {
            let corners = [at(step, 0.0), at(step + 1, 0.0), at(step + 1, 3.0), at(step, 3.0)];
            let out = |triangle: Triangle| Triangle { normals: triangle.positions.map(|corner| corner.with_z(0.0).normalize()), ..triangle };
            quad(corners).map(out)
        };
        let scene = of((0..48).flat_map(side).collect());
        let atlas = Atlas::new(&scene, wanted(32, Charts::Smooth, 4));
        assert_eq!(atlas.cut, 0);
        for (number, texel) in atlas.texels.iter().enumerate() {
            let beside = neighbours(texel.cell, atlas.edge).flatten().filter(|cell| {
                let first = atlas.cells[*cell as usize].first.checked_sub(1);
                first.is_some_and(|first| {
                    let chart = |number: usize| atlas.chart_of[atlas.texels[number].spot.triangle as usize - 1];
                    chart(first as usize) == chart(number)
                })
            });
            assert_eq!((0..8).filter(|bit| atlas.links[number] >> (2 * bit) & 3 != 0).count(), beside.count());
        }
    }
}
