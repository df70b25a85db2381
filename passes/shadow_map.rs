//! Shadow maps of the punctual lights.

use crate::contract::encoder::shadow_taps;
use crate::contract::{Arguments, Description, Encoder, MOST_BYTES, Need, Output, Parameter, ParameterKind, Pass, Port, PortKind, Refusal, port};
use crate::math::frame::Frame;
use crate::scene::{Bounds, Light, LightKind, Object, Scene, Triangle, needs::Needs, place_in_grid, shadow_grid, shadow_half, shadow_layers, surface_offset};
use crate::schedule::*;
use glam::{Vec2, Vec3};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::mem::discriminant;

pub struct ShadowMap;

static DESCRIPTION: Description = Description {
    name: "ShadowMap",
    about: "Depth of the scene from every punctual light: six maps a point light, one a spot, up to sixteen side by side a directional light",
    source: "THESIS section 4.6 (1024² with 16-tap percentage-closer filtering)",
    parameters: &[
        Parameter { name: "resolution", about: "edge of a map", unit: "texels", kind: ParameterKind::Integer { default: 1024, min: 16, max: 8192 } },
        Parameter {
            name: "taps",
            about: "percentage-closer taps of a lookup: 4, 9, 16 or 25",
            unit: "",
            kind: ParameterKind::Integer { default: 16, min: 4, max: 25 },
        },
    ],
    inputs: &[],
    outputs: &[Output { name: "maps", about: "the maps", kind: PortKind::ShadowMaps }],
};

/// Instances of a light: as the shader takes them apart.
const MAPS: u32 = 16;

impl Pass for ShadowMap {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn need(&self, _: &Arguments, needs: &Needs) -> Need {
        if needs.shadowed_lights == 0 { Need::Dropped("no punctual light casts shadows") } else { Need::Kept }
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let resolution = e.arguments.integer("resolution") as u32;
        let taps = shadow_taps(e.arguments)?;
        let lights = &e.setting.scene.lights;
        let grid = shadow_grid(lights);
        // Lights with the sides of their cubes, in the order of the layers.
        let views: Vec<[u32; 2]> = (0..).zip(lights).flat_map(|(light, about)| (0..shadow_layers(about, grid)).map(move |map| [light, map])).collect();
        let chunks = Chunks::new(&e.setting.scene.triangles, &e.setting.scene.objects);
        let maps = Maps::new(e, resolution, views.len().max(1) as u32, chunks.are_mixed());
        if views.is_empty() {
            // Kept for a scene without shadows: a map that no light looks up.
            e.clear(maps.depth);
        }
        let vertices = e.scene_data(SceneData::Positions);
        let masks = e.setting.needs.alpha_masks;
        let holes = masks.then(|| holes(e.setting.scene));
        for (layer, [light, map]) in (0..).zip(views) {
            let instance = light * MAPS + map;
            let draw = |vertices| Draw { rectangle: None, vertices, is_indexed: false, instances: [instance, instance + 1] };
            let view = View { light: &lights[light as usize], map, grid };
            let drawn = |what: Part, depth: DepthTarget| {
                Command::Raster(Raster {
                    program: Program::new("shadow_map").constant("SHADOW_RESOLUTION", resolution),
                    vertex: "vertex",
                    fragment: masks.then_some("fragment"),
                    colours: Vec::new(),
                    depth: Some(depth),
                    vertices: Some(vertices),
                    instances: None,
                    indices: None,
                    topology: Topology::Triangles,
                    draws: Draws::Fixed(chunks.ranges(&view, what).into_iter().map(|triangles| draw(triangles.map(|triangle| 3 * triangle))).collect()),
                })
            };
            maps.draw(e, layer, |part| of((chunks.key(&view, part), holes)), drawn);
        }
        e.output("maps", Port::ShadowMaps(port::ShadowMaps { depth: maps.depth, pitch: maps.pitch, resolution, taps }));
        Ok(())
    }
}

/// One of a light's maps.
struct View<'l> {
    light: &'l Light,
    map: u32,
    /// Maps along an edge of the grid of those of a directional light.
    grid: u32,
}

/// What of the scene is drawn.
#[derive(Clone, Copy, PartialEq)]
enum Part {
    All,
    Standing,
    Moving,
}

/// Where the maps are drawn, and where they are looked up.
struct Maps {
    drawn: Resource,
    /// The maps without what moves, which is drawn over them; None where all stands or all moves.
    standing: Option<Resource>,
    depth: Resource,
    pitch: Option<u32>,
    map_bytes: u64,
}

impl Maps {
    fn new(e: &mut Encoder<'_>, resolution: u32, layers: u32, keeps_standing: bool) -> Self {
        let (size, format) = ([resolution; 2], Format::Depth32Float);
        let row = format.row_bytes(resolution);
        let map_bytes = row * resolution as u64;
        if map_bytes * layers as u64 > MOST_BYTES {
            let depth = e.texture("depth", size, layers, format);
            return Self { drawn: depth, standing: None, depth, pitch: None, map_bytes };
        }
        let standing = keeps_standing.then(|| e.history_texture("standing", size, layers, format));
        let (drawn, depth) = (e.texture("map", size, 1, format), e.history_buffer("depth", map_bytes * layers as u64));
        let kept: Vec<Resource> = [depth].into_iter().chain(standing).collect();
        e.survives(&kept, &[]);
        e.remakes(&kept, &[]);
        Self { drawn, standing, depth, pitch: Some((row / format.bytes()) as u32), map_bytes }
    }

    /// Draws a map: where they are kept, if it would show something else than it does. `key` is a number of all that a part is drawn from.
    fn draw(&self, e: &mut Encoder<'_>, layer: u32, key: impl Fn(Part) -> u64, drawn: impl Fn(Part, DepthTarget) -> Command) {
        let target = |texture, layer| DepthTarget { texture, layer, clears: true };
        if self.pitch.is_none() {
            return e.command(drawn(Part::All, target(self.drawn, layer)));
        }
        let all = key(Part::All);
        if let Some(standing) = self.standing {
            e.kept(key(Part::Standing), drawn(Part::Standing, target(standing, layer)));
            e.kept(all, Command::CopyLayer { from: standing, layer, to: self.drawn });
            e.kept(all, drawn(Part::Moving, DepthTarget { clears: false, ..target(self.drawn, 0) }));
        } else {
            e.kept(all, drawn(Part::All, target(self.drawn, 0)));
        }
        e.kept(all, Command::CopyToBuffer { from: self.drawn, to: self.depth, offset: layer as u64 * self.map_bytes });
    }
}

/// A number of what is told.
fn of(what: impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    what.hash(&mut hasher);
    hasher.finish()
}

fn bits(of: Vec3) -> [u32; 3] {
    of.to_array().map(f32::to_bits)
}

/// A number of what leaves holes.
fn holes(scene: &Scene) -> u64 {
    of(scene.materials.iter().map(|material| (material.texture, material.alpha_cutoff.map(f32::to_bits))).collect::<Vec<_>>())
}

/// As many triangles as a map sees or leaves out together.
const CHUNK: u32 = 64;

/// Triangles that lie side by side, of one mover or of none.
struct Chunk {
    triangles: [u32; 2],
    bounds: Bounds,
    /// Where they lie, as a number; 0 of what cannot move.
    place: u64,
}

impl Chunk {
    fn moves(&self) -> bool {
        self.place != 0
    }
}

/// What maps leave out triangles by.
struct Chunks {
    all: Bounds,
    chunks: Vec<Chunk>,
}

impl Chunks {
    fn new(triangles: &[Triangle], movers: &[Object]) -> Self {
        let moves = |at: usize| movers.iter().any(|mover| mover.triangles.contains(&at));
        let mut ends: Vec<usize> = movers.iter().flat_map(|mover| [mover.triangles.start, mover.triangles.end]).chain([triangles.len()]).collect();
        ends.sort_unstable();
        let mut chunks = Vec::new();
        let mut start = 0;
        for end in ends {
            let is_moving = moves(start);
            for first in (start..end).step_by(CHUNK as usize) {
                let last = end.min(first + CHUNK as usize);
                let here = &triangles[first..last];
                let place = if is_moving { of(here.iter().flat_map(|triangle| triangle.positions.map(bits)).collect::<Vec<_>>()) } else { 0 };
                chunks.push(Chunk { triangles: [first as u32, last as u32], bounds: Bounds::of(here), place });
            }
            start = end;
        }
        Self { all: Bounds::of(triangles), chunks }
    }

    /// Whether some stand and some move: to copy a map of the former and draw the latter over it costs less than to draw all.
    fn are_mixed(&self) -> bool {
        self.chunks.iter().any(Chunk::moves) && !self.chunks.iter().all(Chunk::moves)
    }

    /// A number of all that a part of a map is drawn from, but for holes. How strong the light is changes nothing there.
    fn key(&self, view: &View<'_>, part: Part) -> u64 {
        let View { light, map, grid } = *view;
        let (position, direction) = match light.kind {
            LightKind::Point { position, .. } => (position, Vec3::ZERO),
            LightKind::Spot { position, direction, .. } => (position, direction),
            LightKind::Directional { direction, .. } => (Vec3::ZERO, direction),
        };
        let half = shadow_half(light, &self.all, grid).extend(0.0);
        let lie = [position, direction, half, self.all.min, self.all.max].map(bits);
        let moving = self.seen(view, part).filter(|chunk| chunk.moves());
        of((discriminant(&light.kind), map, grid, lie, moving.map(|chunk| (chunk.triangles, chunk.place)).collect::<Vec<_>>()))
    }

    /// What a light's map may see of a part: what reaches into the quarter turn of a cube's side or stands before a place of a grid, or all.
    fn seen<'c>(&'c self, view: &View<'_>, part: Part) -> impl Iterator<Item = &'c Chunk> {
        let View { light, map, grid } = *view;
        let (kind, layers, half) = (light.kind, shadow_layers(light, grid), shadow_half(light, &self.all, grid));
        let of_part = move |chunk: &&Chunk| part == Part::All || chunk.moves() == (part == Part::Moving);
        self.chunks.iter().filter(of_part).filter(move |Chunk { bounds, .. }| match (kind, layers) {
            (LightKind::Point { position, .. } | LightKind::Spot { position, .. }, 6) => self.is_on_side(bounds, position, map),
            (LightKind::Directional { direction, .. }, _) => self.is_in_grid(bounds, direction, place_in_grid(map, half, grid), half),
            _ => true,
        })
    }

    /// The triangles of what is seen, those that lie side by side as one range.
    fn ranges(&self, view: &View<'_>, part: Part) -> Vec<[u32; 2]> {
        let mut ranges: Vec<[u32; 2]> = Vec::new();
        for Chunk { triangles: [first, end], .. } in self.seen(view, part) {
            match ranges.last_mut() {
                Some(last) if last[1] == *first => last[1] = *end,
                _ => ranges.push([*first, *end]),
            }
        }
        ranges
    }

    fn is_on_side(&self, bounds: &Bounds, position: Vec3, side: u32) -> bool {
        let axis = (side / 2) as usize;
        let (low, high) = (bounds.min - position, bounds.max - position);
        let depth = if side.is_multiple_of(2) { high[axis] } else { -low[axis] };
        // Rounding loses nothing at the edges.
        Vec3::ZERO.clamp(low, high).abs().max_element() <= depth * 1.001 + surface_offset(self.all.diagonal(), position)
    }

    fn is_in_grid(&self, bounds: &Bounds, direction: Vec3, centre: Vec2, half: Vec2) -> bool {
        let frame = Frame::new(direction);
        let (middle, size) = (bounds.centre() - self.all.centre(), 0.5 * (bounds.max - bounds.min));
        let along = |axis: Vec3| (axis.dot(middle), axis.abs().dot(size));
        let [across, up] = [along(frame.bitangent), along(frame.tangent)];
        let is_near = |(at, reach): (f32, f32), centre: f32, half: f32| (at - centre).abs() <= (reach + half) * 1.001;
        is_near(across, centre.x, half.x) && is_near(up, centre.y, half.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;
    use proptest::prelude::*;

    /// The side of a light's cube that a direction falls on, as shadows are looked up.
    fn side(d: Vec3) -> u32 {
        let axis = d.abs().max_position() as u32;
        2 * axis + u32::from(d[axis as usize] < 0.0)
    }

    fn sun_direction(light: &Light) -> Vec3 {
        let LightKind::Directional { direction, .. } = light.kind else { return Vec3::X };
        direction
    }

    proptest! {
        #[test]
        fn a_map_sees_all_that_is_on_its_side(
            corners in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-1f32..1.0)), 300),
            place in prop::array::uniform3(-1.5f32..1.5),
            offset in prop_oneof![Just(0f32), Just(1000.0)],
        ) {
            let mut triangles: Vec<_> = corners.iter().map(|[centre, a, b]| {
                let centre = Vec3::from(*centre) + offset;
                let positions = [centre, centre + 0.1 * Vec3::from(*a), centre + 0.1 * Vec3::from(*b)];
                Triangle { positions, normals: [Vec3::Z; 3], uvs: [Vec2::ZERO; 3], tints: Default::default(), material: 0 }
            }).collect();
            triangles.sort_by(|a, b| a.positions[0].x.total_cmp(&b.positions[0].x));
            let position = Vec3::from(place) + offset;
            let light = Light { name: "light".into(), kind: LightKind::Point { position, intensity: Vec3::ONE }, shadows: true };
            let chunks = Chunks::new(&triangles, &[]);
            let sides: Vec<_> = (0..6).map(|face| chunks.ranges(&View { light: &light, map: face, grid: 4 }, Part::All)).collect();
            for (index, triangle) in (0..).zip(&triangles) {
                let [a, b, c] = triangle.positions;
                for point in [a, b, c, (a + b) / 2.0, (b + c) / 2.0, (a + b + c) / 3.0] {
                    let face = side(point - position);
                    prop_assert!(sides[face as usize].iter().any(|[first, end]| (*first..*end).contains(&index)), "{point} is not on side {face} of {position}");
                }
            }
            let sun = Light { kind: LightKind::Directional { direction: Vec3::from(place).normalize_or(Vec3::X), irradiance: Vec3::ONE }, ..light.clone() };
            let places: Vec<_> = (0..16).map(|map| chunks.ranges(&View { light: &sun, map, grid: 4 }, Part::All)).collect();
            let (half, frame) = (shadow_half(&sun, &chunks.all, 4), Frame::new(sun_direction(&sun)));
            for (index, triangle) in (0..).zip(&triangles) {
                for point in triangle.positions {
                    let beside = Vec2::new(frame.bitangent.dot(point - chunks.all.centre()), frame.tangent.dot(point - chunks.all.centre())) / half;
                    let at = ((beside + 4.0) / 2.0).floor().clamp(Vec2::ZERO, Vec2::splat(3.0));
                    let map = (4.0 * at.y + at.x) as usize;
                    prop_assert!(places[map].iter().any(|[first, end]| (*first..*end).contains(&index)), "{point} is not on map {map}");
                }
            }
            let drawn: u32 = sides.iter().flatten().map(|[first, end]| end - first).sum();
            prop_assert!(drawn < 6 * triangles.len() as u32, "all is drawn on all sides");
        }
    }
}

#[cfg(test)]
mod ranges {
    use super::*;
    use glam::Vec2;

    /// A chunk of small triangles around each place.
    fn around(places: &[Vec3]) -> Vec<Triangle> {
        let triangle = |place: Vec3| {
            let positions = [place, place + Vec3::splat(0.01), place - Vec3::new(0.01, 0.0, 0.01)];
            Triangle { positions, normals: [Vec3::Z; 3], uvs: [Vec2::ZERO; 3], tints: Default::default(), material: 0 }
        };
        places.iter().flat_map(|place| vec![triangle(*place); CHUNK as usize]).collect()
    }

    fn chunks(places: &[Vec3]) -> Chunks {
        Chunks::new(&around(places), &[])
    }

    /// What a map of a light is drawn from.
    fn seen(chunks: &Chunks, light: &Light, map: u32, grid: u32) -> Vec<[u32; 2]> {
        chunks.ranges(&View { light, map, grid }, Part::All)
    }

    fn point(position: Vec3) -> Light {
        Light { name: String::new(), kind: LightKind::Point { position, intensity: Vec3::ONE }, shadows: true }
    }

    #[test]
    fn what_lies_along_an_axis_is_on_one_side() {
        let ways = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
        let position = Vec3::new(0.5, -0.25, 2.0);
        let chunks = chunks(&ways.map(|way| position + 3.0 * way));
        for face in 0..6 {
            assert_eq!(seen(&chunks, &point(position), face, 4), [[face * CHUNK, (face + 1) * CHUNK]]);
        }
    }

    #[test]
    fn chunks_side_by_side_are_drawn_as_one() {
        let [right, left] = [Vec3::X, Vec3::NEG_X];
        let chunks = chunks(&[right, right, left, right, left, left]);
        assert_eq!(seen(&chunks, &point(Vec3::ZERO), 0, 4), [[0, 2 * CHUNK], [3 * CHUNK, 4 * CHUNK]]);
        assert_eq!(seen(&chunks, &point(Vec3::ZERO), 1, 4), [[2 * CHUNK, 3 * CHUNK], [4 * CHUNK, 6 * CHUNK]]);
        // What the light is in is on all sides.
        let chunks = self::chunks(&[Vec3::ZERO]);
        assert!((0..6).all(|face| seen(&chunks, &point(Vec3::splat(0.001)), face, 4) == [[0, CHUNK]]));
    }

    /// A mover's chunks hold nothing else: its few triangles would be seen wherever those beside them are.
    #[test]
    fn chunks_end_where_movers_do() {
        let triangles = around(&[Vec3::X, Vec3::Y, Vec3::Z]);
        let mover = |triangles| Object { name: String::new(), triangles };
        let chunks = Chunks::new(&triangles, &[mover(100..110), mover(10..12)]);
        let ranges: Vec<_> = chunks.chunks.iter().map(|chunk| (chunk.triangles, chunk.place != 0)).collect();
        let expected =
            [([0, 10], false), ([10, 12], true), ([12, 76], false), ([76, 100], false), ([100, 110], true), ([110, 174], false), ([174, 192], false)];
        assert_eq!(ranges, expected);
        assert!(Chunks::new(&[], &[]).chunks.is_empty());
    }

    /// A map is drawn anew for what changes in what it sees, and for nothing else.
    #[test]
    fn keys_are_of_what_maps_see() {
        let far = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z].map(|way| 9.0 * way);
        // The last chunk can move: it stands on the side of −z of a light in the middle.
        let scene = |mover: Vec3| {
            let triangles = around(&[&far[..], &[mover]].concat());
            let last = Object { name: String::new(), triangles: triangles.len() - CHUNK as usize..triangles.len() };
            Chunks::new(&triangles, &[last])
        };
        let keys = |chunks: &Chunks, light: &Light| (0..6).map(|map| chunks.key(&View { light, map, grid: 4 }, Part::All)).collect::<Vec<_>>();
        let (light, before) = (point(Vec3::ZERO), scene(Vec3::new(0.1, 0.2, -3.0)));
        let first = keys(&before, &light);
        let differ = |others: Vec<u64>| (0..6).filter(|map| others[*map] != first[*map]).collect::<Vec<_>>();
        assert!(differ(keys(&before, &light)).is_empty());
        assert_eq!(differ(keys(&scene(Vec3::new(0.1, 0.3, -3.0)), &light)), [5]);
        assert_eq!(differ(keys(&scene(Vec3::new(3.0, 0.3, 0.1)), &light)), [0, 5], "the mover leaves a side for another");
        assert_eq!(differ(keys(&scene(Vec3::new(0.1, 0.2, -12.0)), &light)), [0, 1, 2, 3, 4, 5], "the scene is larger");
        let brighter = Light { kind: LightKind::Point { position: Vec3::ZERO, intensity: Vec3::splat(7.0) }, ..light.clone() };
        assert!(differ(keys(&before, &brighter)).is_empty());
        assert_eq!(differ(keys(&before, &point(Vec3::splat(1e-3)))), [0, 1, 2, 3, 4, 5]);
    }

    /// What stands is told apart from what moves over it, and a mover changes the number of neither but of itself.
    #[test]
    fn movers_are_drawn_over_what_stands() {
        let scene = |mover: Vec3| {
            let triangles = around(&[Vec3::NEG_Z, mover, 3.0 * Vec3::NEG_Z]);
            Chunks::new(&triangles, &[Object { name: String::new(), triangles: CHUNK as usize..2 * CHUNK as usize }])
        };
        let (light, chunks) = (point(Vec3::ZERO), scene(2.0 * Vec3::NEG_Z));
        let ranges = |chunks: &Chunks, part| chunks.ranges(&View { light: &light, map: 5, grid: 4 }, part);
        assert_eq!(ranges(&chunks, Part::All), [[0, 3 * CHUNK]]);
        assert_eq!(ranges(&chunks, Part::Standing), [[0, CHUNK], [2 * CHUNK, 3 * CHUNK]]);
        assert_eq!(ranges(&chunks, Part::Moving), [[CHUNK, 2 * CHUNK]]);
        let keys = |chunks: &Chunks| [Part::All, Part::Standing, Part::Moving].map(|part| chunks.key(&View { light: &light, map: 5, grid: 4 }, part));
        let ([all, standing, moving], later) = (keys(&chunks), keys(&scene(2.5 * Vec3::NEG_Z)));
        assert!(later[0] != all && later[1] == standing && later[2] != moving);
        assert!(chunks.are_mixed() && !self::chunks(&[Vec3::X]).are_mixed());
    }

    #[test]
    fn the_last_chunk_ends_with_the_triangles() {
        let triangles = around(&[Vec3::X, Vec3::X]);
        let chunks = Chunks::new(&triangles[..triangles.len() - 3], &[]);
        assert_eq!(seen(&chunks, &point(Vec3::ZERO), 0, 4), [[0, 2 * CHUNK - 3]]);
    }

    #[test]
    fn maps_of_one_side_see_all() {
        let chunks = chunks(&[Vec3::X, Vec3::NEG_X]);
        let directional = Light { kind: LightKind::Directional { direction: Vec3::X, irradiance: Vec3::ONE }, ..point(Vec3::ZERO) };
        assert_eq!(seen(&chunks, &directional, 0, 1), [[0, 2 * CHUNK]]);
        let spot = |outer: f32| Light {
            kind: LightKind::Spot { position: Vec3::ZERO, direction: Vec3::X, intensity: Vec3::ONE, inner: 0.1, outer },
            ..point(Vec3::ZERO)
        };
        assert_eq!(seen(&chunks, &spot(0.3), 0, 4), [[0, 2 * CHUNK]]);
        assert_eq!(seen(&chunks, &spot(1.5), 0, 4), [[0, CHUNK]]);
    }
}
