//! The scene rasterised from each record, less what lies outside of its views.

use super::Work;
use crate::contract::{Recorder, recorder::scene_constants};
use crate::host_struct;
use crate::math::frame::Frame;
use crate::math::hemisphere::{Shape, View};
use crate::passes::record::{REQUEST_BYTES, Request};
use crate::recording::*;
use crate::scene::bvh::Node;
use glam::{DVec3, Vec3};

host_struct! {
    /// A camera at the record, in its frame.
    pub struct TileView {
        right: [f32; 3],
        minimum_x: f32,
        up: [f32; 3],
        minimum_y: f32,
        forward: [f32; 3],
        maximum_x: f32,
        maximum_y: f32,
        padding_a: f32,
        padding_b: f32,
        padding_c: f32,
    }
}

host_struct! {
    /// A camera where a request stands: an inner product of a point relative to `origin` with each axis is a clip coordinate.
    pub struct TileCamera {
        right: [f32; 3],
        /// Distance of the near plane.
        near: f32,
        up: [f32; 3],
        padding_a: f32,
        forward: [f32; 3],
        padding_b: f32,
        origin: [f32; 3],
        padding_c: f32,
    }
}

/// Ranges with gaps up to this many triangles are drawn as one: a draw costs about as much.
const GAP: u32 = 16;
/// A subtree of at most this many triangles is drawn whole.
const CLUSTER: u32 = 32;
/// Finest subdivision of a triangle for the hemispherical projection: 4^5 parts.
const FINEST: u32 = 5;
/// The level of a triangle that even so would bend too much: it is drawn over the whole tile, which its samples' rays test.
const WHOLE: u32 = 15;
/// Angle that an edge of a part spans at most, where the subdivision allows [radians].
const PART_ANGLE: f32 = 0.15;

pub(super) fn record(r: &mut Recorder<'_>, work: &Work) {
    let draws = r.draws("draws");
    let views: Vec<_> = work.table.views.iter().map(tile_view).collect();
    let buffer = r.constant_buffer("views", bytemuck::cast_slice(&views));
    cull(r, work, draws);
    let needs = r.setting.needs;
    let tested = needs.one_sided || needs.alpha_masks;
    let hemispherical = matches!(work.shape, Shape::Hemispherical);
    let depth = match *r.kind(work.seen) {
        ResourceKind::Texture { size, .. } => r.texture("depth", size, 1, Format::Depth32Float),
        _ => return,
    };
    let vertices = (!hemispherical).then(|| r.scene_data(SceneData::Positions));
    let program = program(r, work, buffer);
    let instances = (!hemispherical).then(|| aim(r, work, program.clone()));
    r.command(Command::Raster(Raster {
        program,
        vertex: if hemispherical { "vertex_hemispherical" } else { "vertex" },
        fragment: Some(match (hemispherical, tested) {
            (true, _) => "fragment_hemispherical",
            (false, true) => "fragment_tested",
            (false, false) => "fragment",
        }),
        colours: vec![Target { texture: work.seen, clear: Some([0.0; 4]), blend: Blend::Replace }],
        depth: Some(DepthTarget { texture: depth, layer: 0 }),
        vertices,
        instances,
        topology: Topology::Triangles,
        draws: Draws::Listed(draws),
    }));
}

fn program(r: &Recorder<'_>, work: &Work, views: Resource) -> Program {
    work.layout(scene_constants(Program::new("hemisphere_tiles/raster"), r.setting.needs))
        .constant("VIEWS", work.table.views.len() as u32)
        .bind("requests", work.requests.places)
        .bind("views", views)
        .bind("samples", work.samples)
}

/// Turns the views of every request to where they stand, once for all vertices.
fn aim(r: &mut Recorder<'_>, work: &Work, program: Program) -> Resource {
    let views = work.table.views.len() as u32;
    let cameras = r.buffer("cameras", (work.requests.capacity * views) as u64 * size_of::<TileCamera>() as u64);
    r.compute(program.bind("cameras", cameras), "aim", Groups::Counted { count: work.requests.count, divisor: 64, per: views });
    cameras
}

fn tile_view(view: &View) -> TileView {
    let single = |v: DVec3| v.as_vec3().to_array();
    TileView {
        right: single(view.right),
        minimum_x: view.minimum.x as f32,
        up: single(view.up),
        minimum_y: view.minimum.y as f32,
        forward: single(view.forward),
        maximum_x: view.maximum.x as f32,
        maximum_y: view.maximum.y as f32,
        padding_a: 0.0,
        padding_b: 0.0,
        padding_c: 0.0,
    }
}

/// Lists, for every request and view, the ranges of triangles that the view can see.
fn cull(r: &mut Recorder<'_>, work: &Work, draws: Resource) {
    let requests = work.requests;
    let views = work.table.views.clone();
    let corners: Vec<_> = (0..requests.capacity).map(|tile| work.corner(tile)).collect();
    let tree = r.state("tree");
    r.host("cull", &[Read::counted(requests.places, REQUEST_BYTES, requests.count)], &[], move |host| {
        let places: Vec<Request> = bytemuck::pod_collect_to_vec(host.read(requests.places));
        let made = match host.state(tree).take().and_then(|t| t.downcast::<Tree>().ok()) {
            Some(tree) => tree,
            None => Box::new(Tree::new(host)),
        };
        let list = host.draws(draws);
        list.clear();
        for (tile, place) in places.iter().enumerate() {
            for (index, view) in views.iter().enumerate() {
                let instance = (tile * views.len() + index) as u32;
                let [x, y, w, h] = view.rectangle;
                let rectangle = Some([corners[tile][0] + x, corners[tile][1] + y, w, h]);
                made.draw(place, view, instance, rectangle, list);
            }
        }
        *host.state(tree) = Some(made);
        Ok(())
    });
}

/// The scene's hierarchy with the range of triangles below each node.
struct Tree {
    nodes: Vec<Node>,
    ranges: Vec<[u32; 2]>,
    /// Longest edge of a triangle below each node.
    longest: Vec<f32>,
}

impl Tree {
    fn new(host: &dyn HostContext) -> Self {
        let (nodes, ranges) = (host.bvh().nodes(), host.bvh().ranges());
        let edge = |t: &crate::scene::Triangle| (0..3).map(|i| t.positions[i].distance(t.positions[(i + 1) % 3])).fold(0.0f32, f32::max);
        let longest =
            ranges.iter().map(|[a, b]| host.scene().triangles[*a as usize..*b as usize].iter().take(CLUSTER as usize).map(edge).fold(0.0, f32::max)).collect();
        Self { nodes, ranges, longest }
    }

    fn draw(&self, place: &Request, view: &View, instance: u32, rectangle: Option<[u32; 4]>, list: &mut Vec<Draw>) {
        let frame = Frame::new(Vec3::from(place.normal)).turned(place.turn);
        let planes = planes(&frame, view);
        let origin = Vec3::from(place.position);
        let mut ranges = Ranges { first: list.len(), list, instance, rectangle, clipped: None };
        let mut stack = if self.nodes.is_empty() { Vec::new() } else { vec![0usize] };
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
    rectangle: Option<[u32; 4]>,
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
            _ => self.list.push(Draw { rectangle: self.rectangle, vertices: [a * per_triangle, b * per_triangle], instances: [tagged, tagged + 1] }),
        }
    }
}
