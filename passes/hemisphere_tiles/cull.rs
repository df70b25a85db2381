//! What of the scene lies outside of the records' views, found on the host.

use super::Work;
use crate::contract::Encoder;
use crate::math::frame::Frame;
use crate::math::hemisphere::View;
use crate::passes::record::{REQUEST_BYTES, Request};
use crate::scene::{Triangle, bvh::Node};
use crate::schedule::{Draw, HostContext, Read, Resource};
use glam::{DVec3, Vec3};
use std::{cmp::Reverse, ops::Range};

/// Ranges with gaps up to this many triangles are drawn as one: a draw costs about as much.
pub(super) const GAP: u32 = 16;
/// A subtree of at most this many triangles is drawn whole.
const CLUSTER: u32 = 32;
/// Finest subdivision of a triangle for the hemispherical projection: 4^5 parts.
const FINEST: u32 = 5;
/// The level of a triangle that even so would bend too much: it is drawn over the whole tile, which its samples' rays test.
const WHOLE: u32 = 15;
/// Angle that an edge of a part spans at most, where the subdivision allows [radians].
const PART_ANGLE: f32 = 0.15;

/// What the views of a batch may see.
pub(super) struct Culled {
    tree: Tree,
    pub draws: Vec<Draw>,
    /// Of each view of each request, its part of the draws.
    pub views: Vec<Range<usize>>,
}

impl Culled {
    /// Does a host step's work on what the last batch left in `state`.
    pub fn with(host: &mut dyn HostContext, state: Resource, step: impl FnOnce(&mut Self, &mut dyn HostContext)) {
        let left = host.state(state).take().and_then(|left| left.downcast::<Self>().ok());
        let mut culled = left.unwrap_or_else(|| Box::new(Self { tree: Tree::new(host), draws: Vec::new(), views: Vec::new() }));
        step(&mut culled, host);
        *host.state(state) = Some(culled);
    }

    /// Starts anew with these requests.
    pub fn refill(&mut self, places: &[Request], views: &[View], corner: impl Fn(u32) -> [u32; 2]) {
        self.draws.clear();
        self.views.clear();
        for (tile, place) in places.iter().enumerate() {
            for view in views {
                let first = self.draws.len();
                let instance = self.views.len() as u32;
                let [x, y, w, h] = view.rectangle;
                let [left, top] = corner(tile as u32);
                self.tree.draw(place, view, instance, [left + x, top + y, w, h], &mut self.draws);
                self.views.push(first..self.draws.len());
            }
        }
    }
}

/// A host step that finds what each view of each request may see, for `then` to write; the [`Culled`] is what it returns.
pub(super) fn cull(e: &mut Encoder<'_>, work: &Work, writes: &[Resource], then: impl Fn(&Culled, &mut dyn HostContext) + Send + Sync + 'static) -> Resource {
    let requests = work.requests;
    let views = work.table.views.clone();
    let corners: Vec<_> = (0..requests.capacity).map(|tile| work.corner(tile)).collect();
    let culled = e.state("culled");
    e.host("cull", &[Read::counted(requests.places, REQUEST_BYTES, requests.count)], writes, move |host| {
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        Culled::with(host, culled, |found, host| {
            found.refill(&places, &views, |tile| corners[tile as usize]);
            then(found, host);
        });
        Ok(())
    });
    culled
}

/// The scene's hierarchy with the range of triangles below each node.
struct Tree {
    nodes: Vec<Node>,
    /// Those of the last triangles first: views look at them in the triangles' order, by which ranges join.
    roots: Vec<usize>,
    ranges: Vec<[u32; 2]>,
    /// Longest edge of a triangle below each node.
    longest: Vec<f32>,
}

impl Tree {
    fn new(host: &dyn HostContext) -> Self {
        let (nodes, mut roots, ranges) = (host.bvh().nodes().to_vec(), host.bvh().roots(), host.bvh().ranges());
        roots.sort_unstable_by_key(|root| Reverse(ranges[*root][0]));
        let edge = |t: &Triangle| (0..3).map(|i| t.positions[i].distance(t.positions[(i + 1) % 3])).fold(0.0f32, f32::max);
        let longest =
            ranges.iter().map(|[a, b]| host.scene().triangles[*a as usize..*b as usize].iter().take(CLUSTER as usize).map(edge).fold(0.0, f32::max)).collect();
        Self { nodes, roots, ranges, longest }
    }

    fn draw(&self, place: &Request, view: &View, instance: u32, rectangle: [u32; 4], list: &mut Vec<Draw>) {
        let frame = Frame::new(Vec3::from(place.normal)).turned(place.turn);
        let planes = planes(&frame, view);
        let origin = Vec3::from(place.position);
        let mut ranges = Ranges { first: list.len(), list, instance, rectangle, clipped: None };
        let mut stack = self.roots.clone();
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index];
            let part = part(node, origin, &planes);
            let [a, b] = self.ranges[index];
            match part {
                Part::Outside => {}
                Part::Inside if view.linear => ranges.add([a, b], 0, false),
                _ if node.count > 0 || b - a <= CLUSTER => {
                    let level = if view.linear { 0 } else { level(node, self.longest[index], origin) };
                    ranges.add([a, b], level, view.linear);
                }
                _ => stack.extend([node.first as usize + 1, node.first as usize]),
            }
        }
    }
}

/// Where a box lies to the planes that bound a view.
enum Part {
    Outside,
    Crossing,
    Inside,
}

/// Normals of the planes through the record that bound a view, pointing inwards: the tangent plane and the four sides.
fn planes(frame: &Frame, view: &View) -> Vec<Vec3> {
    let world = |v: DVec3| frame.to_world(v.as_vec3());
    let mut planes = vec![frame.normal];
    if view.linear {
        let (right, up, forward) = (world(view.right), world(view.up), world(view.forward));
        planes.extend([
            right - forward * view.minimum.x as f32,
            forward * view.maximum.x as f32 - right,
            up - forward * view.minimum.y as f32,
            forward * view.maximum.y as f32 - up,
        ]);
    }
    planes
}

fn part(node: &Node, origin: Vec3, planes: &[Vec3]) -> Part {
    let (low, high) = (Vec3::from(node.min) - origin, Vec3::from(node.max) - origin);
    let mut part = Part::Inside;
    for plane in planes {
        let forward = plane.cmpge(Vec3::ZERO);
        if plane.dot(Vec3::select(forward, high, low)) < 0.0 {
            return Part::Outside;
        }
        if plane.dot(Vec3::select(forward, low, high)) <= 0.0 {
            part = Part::Crossing;
        }
    }
    part
}

/// Halvings of an edge after which its parts span a small angle seen from the record, or [`WHOLE`] where none suffice.
fn level(node: &Node, longest: f32, origin: Vec3) -> u32 {
    let nearest = origin.clamp(Vec3::from(node.min), Vec3::from(node.max)).distance(origin);
    let spans = longest / (nearest.max(1e-6 * longest) * PART_ANGLE);
    let halvings = spans.max(1.0).log2().ceil() as u32;
    if halvings > FINEST { WHOLE } else { halvings }
}

/// The draws of one view.
struct Ranges<'l> {
    list: &'l mut Vec<Draw>,
    /// The view's first draw.
    first: usize,
    instance: u32,
    rectangle: [u32; 4],
    /// Whether triangles of the last range may cross the view's bounds. Drivers that clip on the CPU take a slower path
    /// for all of a draw where any of it needs clipping.
    clipped: Option<bool>,
}

impl Ranges<'_> {
    /// Adds a range of triangles, joined with the one before it where only a small gap lies between.
    fn add(&mut self, [a, b]: [u32; 2], level: u32, clipped: bool) {
        let per_triangle = if level == WHOLE { 6 } else { 3 << (2 * level) };
        let tagged = self.instance | level << 24;
        let same = self.clipped.replace(clipped) == Some(clipped);
        match self.list[self.first..].last_mut() {
            Some(last) if same && last.instances[0] == tagged && a * per_triangle <= last.vertices[1] + GAP * per_triangle => {
                last.vertices[1] = b * per_triangle;
            }
            _ => self.list.push(Draw {
                rectangle: Some(self.rectangle),
                vertices: [a * per_triangle, b * per_triangle],
                is_indexed: false,
                instances: [tagged, tagged + 1],
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Node = Node { min: [-1.0; 3], max: [1.0; 3], count: 1, first: 0 };

    /// Triangles, level and whether it is clipped.
    type Added = ([u32; 2], u32, bool);
    /// Vertices and instance of a draw.
    type Drawn = ([u32; 2], u32);

    #[test]
    fn ranges_join_across_small_gaps_of_their_own_kind() {
        let whole = |first: u32, end: u32, level: u32| ([first, end].map(|triangle| triangle * (3 << (2 * level))), 7 | level << 24);
        let cases: [(&[Added], &[Drawn]); 5] = [
            (&[([2, 10], 0, false), ([10 + GAP, 40], 0, false)], &[whole(2, 40, 0)]),
            (&[([2, 10], 0, false), ([11 + GAP, 40], 0, false)], &[whole(2, 10, 0), whole(11 + GAP, 40, 0)]),
            (&[([2, 10], 2, true), ([12, 14], 2, true), ([14, 15], 2, true)], &[whole(2, 15, 2)]),
            (&[([2, 10], 1, true), ([10, 14], 2, true)], &[whole(2, 10, 1), whole(10, 14, 2)]),
            (&[([2, 10], 0, true), ([10, 14], 0, false), ([14, 20], 0, false)], &[whole(2, 10, 0), whole(10, 20, 0)]),
        ];
        for (added, expected) in cases {
            let before = Draw { rectangle: None, vertices: [0, 6], is_indexed: false, instances: [7, 8] };
            let mut list = vec![before];
            let mut ranges = Ranges { first: 1, list: &mut list, instance: 7, rectangle: [1, 2, 3, 4], clipped: None };
            added.iter().for_each(|(range, level, clipped)| ranges.add(*range, *level, *clipped));
            let draw =
                |(vertices, tagged): &Drawn| Draw { rectangle: Some([1, 2, 3, 4]), vertices: *vertices, is_indexed: false, instances: [*tagged, tagged + 1] };
            assert_eq!(list, std::iter::once(before).chain(expected.iter().map(draw)).collect::<Vec<_>>());
        }
        // What covers the whole tile is two triangles.
        let mut list = Vec::new();
        Ranges { first: 0, list: &mut list, instance: 0, rectangle: [0; 4], clipped: None }.add([3, 5], WHOLE, false);
        assert_eq!(list[0].vertices, [18, 30]);
    }

    #[test]
    fn boxes_are_where_their_nearest_and_farthest_corners_are() {
        let told = |x: f32, planes: &[Vec3]| match part(&UNIT, Vec3::new(x, 0.0, 0.0), planes) {
            Part::Outside => "outside",
            Part::Crossing => "crossing",
            Part::Inside => "inside",
        };
        for (x, of_x) in [(-2.0, "inside"), (-1.0, "crossing"), (0.0, "crossing"), (1.0, "crossing"), (1.1, "outside")] {
            assert_eq!(told(x, &[Vec3::X]), of_x);
            assert_eq!(told(-x, &[Vec3::NEG_X]), of_x);
            assert_eq!(told(x, &[Vec3::X, Vec3::Z]), if of_x == "outside" { of_x } else { "crossing" });
        }
    }

    #[test]
    fn edges_are_halved_until_their_parts_span_little() {
        let at = |distance: f32, longest: f32| level(&UNIT, longest, Vec3::new(0.0, 1.0 + distance, 0.0));
        for halvings in 0..=FINEST {
            // The angle that an edge spans, in angles that a part may.
            let spans = (1 << halvings) as f32;
            assert_eq!(at(1.0, 0.99 * spans * PART_ANGLE), halvings);
            assert_eq!(at(3.0, 3.0 * 0.99 * spans * PART_ANGLE), halvings);
        }
        assert_eq!([at(1.0, 1.01 * 32.0 * PART_ANGLE), at(0.0, 1.0)], [WHOLE; 2]);
        assert_eq!(at(1e9, 1.0), 0);
    }
}

#[cfg(test)]
mod views {
    use super::*;
    use crate::math::hemisphere::{Method, Shape, Table};
    use crate::passes::mock::MockHost;
    use glam::Vec2;

    /// Small triangles all around, on no grid.
    fn triangles() -> Vec<Triangle> {
        let number = |at: u32| crate::math::random::unit(crate::math::random::hash(at)) * 2.0 - 1.0;
        let place = |at: u32| 3.0 * Vec3::new(number(3 * at), number(3 * at + 1), number(3 * at + 2));
        let corners = (0..3000).map(place).map(|at| [at, at + Vec3::new(0.01, 0.0, 0.0), at + Vec3::new(0.0, 0.01, 0.01)]);
        corners.map(|positions| Triangle { positions, normals: [Vec3::Z; 3], uvs: [Vec2::ZERO; 3], tints: Default::default(), material: 0 }).collect()
    }

    /// Whether a view sees a place, given from where its request is.
    fn sees(view: &View, frame: &Frame, way: Vec3) -> bool {
        let local = frame.to_local(way).as_dvec3();
        let [right, up, forward] = [view.right, view.up, view.forward].map(|axis| axis.dot(local));
        let at = glam::DVec2::new(right, up) / if view.linear { forward } else { way.length().into() };
        let inside = at.cmpge(view.minimum).all() && at.cmple(view.maximum).all();
        local.z > 0.0 && forward > 0.0 && inside
    }

    #[test]
    fn views_draw_all_that_they_see_and_little_more() {
        let request = |position: [f32; 3], normal: Vec3| Request::new(position.into(), 1.0, normal.normalize(), 0.7);
        let places = [request([0.1, 0.2, 0.3], Vec3::new(1.0, 2.0, 3.0)), request([-1.0, 0.5, 1.0], Vec3::NEG_Z)];
        for (shape, most) in [(Shape::Hemicube, 0.6), (Shape::Plane { fov_degrees: 60.0 }, 0.4), (Shape::Hemispherical, 0.8)] {
            let table = Table::new(shape, 16, Method::None).unwrap();
            let mut host = MockHost::new(triangles(), [4, 4]);
            Culled::with(&mut host, Resource(0), |found, host| {
                // What was found before counts no more.
                found.refill(&places[1..], &table.views, |_| [0, 0]);
                found.refill(&places, &table.views, |tile| [100 * tile + 7, 9]);
                assert_eq!(found.views.len(), 2 * table.views.len());
                assert!(found.views.windows(2).all(|pair| pair[0].end == pair[1].start) && found.views.last().unwrap().end == found.draws.len());
                for (index, part) in found.views.iter().enumerate() {
                    let (tile, view) = (index / table.views.len(), &table.views[index % table.views.len()]);
                    let [x, y, width, height] = view.rectangle;
                    let mut drawn = vec![false; host.scene().triangles.len()];
                    for draw in &found.draws[part.clone()] {
                        assert_eq!(draw.rectangle, Some([100 * tile as u32 + 7 + x, 9 + y, width, height]));
                        assert_eq!((draw.instances[0] & 0xff_ffff, draw.instances[1] - draw.instances[0]), (index as u32, 1));
                        let level = draw.instances[0] >> 24;
                        assert!(level == 0 || !view.linear);
                        let per_triangle = if level == WHOLE { 6 } else { 3 * 4u32.pow(level) };
                        drawn[(draw.vertices[0] / per_triangle) as usize..(draw.vertices[1] / per_triangle) as usize].fill(true);
                    }
                    let place = &places[tile];
                    let frame = Frame::new(place.normal.into()).turned(place.turn);
                    let seen = |triangle: &Triangle| sees(view, &frame, triangle.positions[0] - Vec3::from(place.position));
                    assert!(host.scene().triangles.iter().zip(&drawn).all(|(triangle, drawn)| *drawn || !seen(triangle)), "{shape:?} {index}");
                    let share = drawn.iter().filter(|drawn| **drawn).count() as f32 / drawn.len() as f32;
                    assert!(share < most, "{share} in {shape:?} {index}");
                }
            });
            assert!(host.states[&Resource(0)].is_some());
        }
    }

    #[test]
    fn planes_bound_what_a_view_sees() {
        let table = Table::new(Shape::Plane { fov_degrees: 60.0 }, 8, Method::None).unwrap();
        let (view, frame) = (&table.views[0], Frame::new(Vec3::new(1.0, 2.0, 2.0) / 3.0));
        let planes = planes(&frame, view);
        for at in 0..2000u32 {
            let number = |axis: u32| crate::math::random::unit(crate::math::random::hash(3 * at + axis)) * 2.0 - 1.0;
            let way = Vec3::new(number(0), number(1), number(2));
            assert_eq!(planes.iter().all(|plane| plane.dot(way) >= 0.0), sees(view, &frame, way), "{way}");
        }
    }
}
