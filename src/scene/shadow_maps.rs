//! Shadow maps as the host looks them up: `shaders/lib/visibility/shadow_maps.wgsl` has the twin.

use super::{Bounds, Light, LightKind, OFFSET_OF_EXTENT, OFFSET_OF_SIZE, Scene, place_in_grid, shadow_grid, shadow_half, shadow_layers, shadow_range};
use crate::math::{
    frame::Frame,
    random::{hashes, units},
    vectors::{LANES, Vectors},
};
use fearless_simd::{Select, Simd, f32x8, prelude::*, u32x8};
use glam::{Vec2, Vec3};

/// The maps of all lights, layer by layer.
#[derive(Default)]
pub struct ShadowMaps<'a> {
    /// Reverse Z.
    pub depth: &'a [f32],
    /// Edge of a map [texels].
    pub resolution: u32,
    /// From a row to the next [texels].
    pub pitch: u32,
    /// Along each axis: 4 × 4 is 16-tap filtering. 1: one of the 4-tap filter's, drawn by its weight.
    pub taps: i32,
}

/// The cameras of a light's maps: six for a cube, one, a grid of them, or none where it casts no shadow.
pub struct ShadowCameras {
    cameras: Vec<ShadowCamera>,
    first_layer: u32,
    which: Which,
    extent: f32,
}

/// How it is told which of the cameras sees a point.
#[derive(Clone, Copy)]
enum Which {
    TheOne,
    /// By the side of a cube around a place.
    Side(Vec3),
    /// By where it is along two axes from a middle, each as long as half a map.
    InGrid {
        middle: Vec3,
        axes: [Vec3; 2],
        grid: u32,
    },
}

struct ShadowCamera {
    origin: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    /// Half the map's width and height, at distance 1 where it is perspective.
    half: Vec2,
    projection: Projection,
}

#[derive(Clone, Copy)]
enum Projection {
    Perspective { near: f32 },
    Orthographic { range: f32 },
}

/// Surface points with unit normals on the light's side, and what draws their taps.
#[derive(Clone, Copy)]
pub struct Receivers<S: Simd> {
    pub position: Vectors<S>,
    pub normal: Vectors<S>,
    /// From where they are seen.
    pub distance: f32x8<S>,
    pub seeds: u32x8<S>,
    /// Whose visibility the first is.
    pub first: usize,
}

impl ShadowCameras {
    /// Of each light of a scene.
    pub fn all(scene: &Scene) -> Vec<Self> {
        let (bounds, grid) = (scene.bounds(), shadow_grid(&scene.lights));
        let mut layer = 0;
        let cameras = scene.lights.iter().map(|light| {
            let layers = shadow_layers(light, grid);
            layer += layers;
            Self::of(light, &bounds, grid, layer - layers)
        });
        cameras.collect()
    }

    fn of(light: &Light, bounds: &Bounds, grid: u32, first_layer: u32) -> Self {
        let cameras: Vec<_> = (0..shadow_layers(light, grid)).map(|map| ShadowCamera::new(light, map, bounds, grid)).collect();
        let which = match (light.kind, cameras.first()) {
            (LightKind::Directional { .. }, Some(first)) => {
                Which::InGrid { middle: bounds.centre(), axes: [first.right / first.half.x, first.up / first.half.y], grid }
            }
            (LightKind::Point { position, .. } | LightKind::Spot { position, .. }, Some(_)) if cameras.len() == 6 => Which::Side(position),
            _ => Which::TheOne,
        };
        Self { cameras, first_layer, which, extent: bounds.diagonal() }
    }

    /// Which of the cameras sees each point.
    #[inline(always)]
    fn maps<S: Simd>(&self, simd: S, points: Vectors<S>) -> [f32; LANES] {
        match self.which {
            Which::TheOne => [0.0; LANES],
            Which::Side(position) => sides(simd, points.minus(Vectors::splat(simd, position))),
            Which::InGrid { middle, axes, grid } => {
                let d = points.minus(Vectors::splat(simd, middle));
                let (zero, last) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, (grid - 1) as f32));
                let [column, row] = axes.map(|axis| ((d.product(axis) + grid as f32) * 0.5).floor().max(zero).min(last));
                (row * grid as f32 + column).to_array()
            }
        }
    }
}

/// By the side of the cube, +x, −x, +y, −y, +z, −z.
#[inline(always)]
fn sides<S: Simd>(simd: S, d: Vectors<S>) -> [f32; LANES] {
    let number = |value: f32| f32x8::splat(simd, value);
    let a = d.magnitude();
    let is_x = a.x.simd_ge(a.y) & a.x.simd_ge(a.z);
    let is_y = a.y.simd_ge(a.z);
    let along = is_x.select(d.x, is_y.select(d.y, d.z));
    let axis = is_x.select(number(0.0), is_y.select(number(2.0), number(4.0)));
    (axis + along.simd_le(number(0.0)).select(number(1.0), number(0.0))).to_array()
}

fn cube_axis(face: u32) -> Vec3 {
    Vec3::AXES[(face / 2) as usize] * if face % 2 == 1 { -1.0 } else { 1.0 }
}

impl ShadowCamera {
    /// Of one of a light's maps.
    fn new(light: &Light, map: u32, bounds: &Bounds, grid: u32) -> Self {
        let (half, extent) = (shadow_half(light, bounds, grid), bounds.diagonal());
        let (near, range) = (1e-5 * extent, shadow_range(extent));
        let (origin, forward, projection) = match light.kind {
            LightKind::Directional { direction, .. } => (bounds.centre() - direction * (0.5 * range), direction, Projection::Orthographic { range }),
            LightKind::Point { position, .. } => (position, Vec3::ZERO, Projection::Perspective { near }),
            LightKind::Spot { position, direction, .. } => (position, direction, Projection::Perspective { near }),
        };
        let frame = Frame::new(if shadow_layers(light, grid) == 6 { cube_axis(map) } else { forward });
        let beside = match projection {
            Projection::Perspective { .. } => Vec2::ZERO,
            Projection::Orthographic { .. } => place_in_grid(map, half, grid),
        };
        let origin = origin + frame.bitangent * beside.x + frame.tangent * beside.y;
        Self { origin, right: frame.bitangent, up: frame.tangent, forward: frame.normal, half, projection }
    }
}

/// Texels that are still to be looked at. A map is too large for caches: what is looked up one by one waits for memory one by one, what is looked up
/// in a row waits once.
pub struct Lookups {
    count: usize,
    /// Whose visibility it is.
    of: [u32; AT_ONCE],
    texels: [u32; AT_ONCE],
    /// Values up to this let light through.
    limits: [f32; AT_ONCE],
    weights: [f32; AT_ONCE],
    /// A bit for each point that is seen from too near for a map, whose visibility is left to a ray.
    pub near: u64,
}

/// What is nearer than so many widths of a texel to where it is seen from is too near for a map: what leaks along the edges of things, a texel wide,
/// would be much of what is seen.
const NEAR: f32 = 8.0;
const AT_ONCE: usize = 128;

impl Lookups {
    pub const NONE: Self = Self { count: 0, of: [0; AT_ONCE], texels: [0; AT_ONCE], limits: [0.0; AT_ONCE], weights: [0.0; AT_ONCE], near: 0 };
}

impl ShadowMaps<'_> {
    /// How much of a light arrives at those of eight surface points that have a bit in `lanes`, by percentage-closer filtering against the surfaces' own
    /// planes: it is added to their visibility at once, or when the lookups are finished.
    #[inline(always)]
    pub fn look_up<S: Simd>(&self, simd: S, cameras: &ShadowCameras, points: &Receivers<S>, lanes: u32, lookups: &mut Lookups, visibility: &mut [f32]) {
        let maps = cameras.maps(simd, points.position);
        let mut left = lanes;
        while left != 0 {
            // Neighbours mostly fall on one map.
            let map = maps[left.trailing_zeros() as usize % LANES];
            let mut on_map = 0;
            for (lane, other) in maps.iter().enumerate() {
                on_map |= u32::from(*other == map) << lane;
            }
            let here = left & on_map;
            left &= !on_map;
            match cameras.cameras.get(map as usize) {
                Some(camera) => {
                    let first = (cameras.first_layer + map as u32) * self.resolution * self.pitch;
                    self.look_up_in(simd, camera, first, cameras.extent, points, here, lookups, visibility);
                }
                None => bits(here).for_each(|lane| visibility[points.first + lane] += 1.0),
            }
        }
    }

    /// In one map, from its `first` texel on.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "what runs within `dispatch!` is no closure over them")]
    fn look_up_in<S: Simd>(
        &self,
        simd: S,
        camera: &ShadowCamera,
        first: u32,
        extent: f32,
        points: &Receivers<S>,
        lanes: u32,
        lookups: &mut Lookups,
        visibility: &mut [f32],
    ) {
        let (edge, zero, one) = (self.resolution as f32, f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let d = points.position.minus(Vectors::splat(simd, camera.origin));
        let depth = d.product(camera.forward);
        let is_perspective = matches!(camera.projection, Projection::Perspective { .. });
        let scale = if is_perspective { depth } else { one };
        let before = scale.simd_gt(zero).to_bitmask() as u32;
        bits(lanes & !before).for_each(|lane| visibility[points.first + lane] += 1.0);
        let to_texels = f32x8::splat(simd, 0.5 * edge) / scale;
        let [x, y] = [camera.right / camera.half.x, -camera.up / camera.half.y].map(|axis| d.product(axis) * to_texels + 0.5 * edge);
        // A texel's width where the receiver is: what is nearer than that to the receiver does not shadow it.
        let size = points.position.magnitude();
        let slack =
            scale * (2.0 * camera.half.max_element() / edge) + (size.x.max(size.y).max(size.z) * (2.0 * OFFSET_OF_SIZE) + 2.0 * OFFSET_OF_EXTENT * extent);
        let near = lanes & before & points.distance.simd_lt(slack * NEAR).to_bitmask() as u32;
        lookups.near |= u64::from(near) << points.first;
        let lanes = lanes & before & !near;
        let slopes =
            [points.normal.product(camera.forward), points.normal.product(camera.right * camera.half.x), points.normal.product(camera.up * camera.half.y)];
        let receiver = Receiver { depth, facing: d.dot(points.normal), slopes, slack, projection: camera.projection };
        let (last, step) = (self.taps - 1, 2.0 / edge);
        let shift = if self.taps == 1 {
            [units(hashes(points.seeds)) - 0.5, units(hashes(points.seeds + 1)) - 0.5]
        } else {
            [f32x8::splat(simd, -0.5 * last as f32); 2]
        };
        let ([x, y], largest) = ([x + shift[0], y + shift[1]], f32x8::splat(simd, edge - 1.0));
        let base = [x.floor(), y.floor()];
        // The first tap and the last are one together.
        let each = 1.0 / (last * last).max(1) as f32;
        for tap in 0..self.taps * self.taps {
            let (i, j) = (tap % self.taps, tap / self.taps);
            let weight = self.weight(simd, i, x - base[0]) * self.weight(simd, j, y - base[1]) * each;
            let (column, row) = ((base[0] + i as f32).max(zero).min(largest), (base[1] + j as f32).max(zero).min(largest));
            let limit = receiver.limit(simd, (column + 0.5) * step - 1.0, (row + 0.5) * step - 1.0);
            let texels = u32x8::truncate_from(row) * self.pitch + u32x8::truncate_from(column) + first;
            self.add(lookups, points.first, lanes, texels.to_array(), limit.to_array(), weight.to_array(), visibility);
        }
    }

    #[inline(always)]
    fn weight<S: Simd>(&self, simd: S, tap: i32, beside: f32x8<S>) -> f32x8<S> {
        if tap == 0 && self.taps > 1 {
            1.0 - beside
        } else if tap == self.taps - 1 && self.taps > 1 {
            beside
        } else {
            f32x8::splat(simd, 1.0)
        }
    }

    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "what runs within `dispatch!` is no closure over them")]
    fn add(&self, lookups: &mut Lookups, first: usize, lanes: u32, texels: [u32; LANES], limits: [f32; LANES], weights: [f32; LANES], visibility: &mut [f32]) {
        if lookups.count + LANES > AT_ONCE {
            self.finish(lookups, visibility);
        }
        for lane in bits(lanes) {
            let at = lookups.count % AT_ONCE;
            lookups.of[at] = (first + lane) as u32;
            lookups.texels[at] = texels[lane];
            lookups.limits[at] = limits[lane];
            lookups.weights[at] = weights[lane];
            lookups.count += 1;
        }
    }

    /// Adds what is still to be looked at.
    #[inline(always)]
    pub fn finish(&self, lookups: &mut Lookups, visibility: &mut [f32]) {
        for i in 0..lookups.count.min(AT_ONCE) {
            // No branch, which would wait for memory if it were guessed wrong.
            let is_lit = u32::from(self.depth[lookups.texels[i] as usize] <= lookups.limits[i]);
            visibility[lookups.of[i] as usize] += f32::from_bits(lookups.weights[i].to_bits() & is_lit.wrapping_neg());
        }
        lookups.count = 0;
    }
}

/// The places of a mask's bits.
#[inline(always)]
fn bits(mask: u32) -> impl Iterator<Item = usize> {
    (0..LANES).filter(move |lane| mask >> lane & 1 != 0)
}

/// Surface points before a map.
struct Receiver<S: Simd> {
    depth: f32x8<S>,
    /// Height of the light's side of the surface: the origin's distance behind its plane.
    facing: f32x8<S>,
    /// Of the normal: along the axis, across to the right and up, by half the map.
    slopes: [f32x8<S>; 3],
    slack: f32x8<S>,
    projection: Projection,
}

impl<S: Simd> Receiver<S> {
    /// The largest value of a texel that lets light through to the receiver; its place is in −1..1, from the upper left.
    #[inline(always)]
    fn limit(&self, simd: S, x: f32x8<S>, y: f32x8<S>) -> f32x8<S> {
        let (zero, [ahead, right, up]) = (f32x8::splat(simd, 0.0), self.slopes);
        let across = right * x - up * y;
        // Depth of the receiver's plane behind the texel.
        let (slope, facing) = match self.projection {
            Projection::Perspective { .. } => (ahead + across, self.facing),
            Projection::Orthographic { .. } => (ahead, self.facing - across),
        };
        let plane = (slope * self.facing).simd_gt(zero).select(facing / slope, self.depth);
        let least = plane.min(self.depth) - self.slack;
        match self.projection {
            Projection::Perspective { near } => least.simd_gt(zero).select(f32x8::splat(simd, near) / least, f32x8::splat(simd, f32::INFINITY)),
            Projection::Orthographic { range } => 1.0 - least * (1.0 / range),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    const EDGE: u32 = 64;
    const EXTENT: f32 = 10.0;

    /// Visibility of eight points at `distance` below a light, which face it, where every texel of its maps holds a surface that is nearer to the light by so
    /// many widths of a texel; which of them are left to rays, where they are seen from so many widths away.
    fn visible(kind: LightKind, taps: i32, distance: f32, widths: f32, from_widths: f32) -> ([f32; LANES], u64) {
        let light = Light { name: "light".into(), kind, shadows: true };
        let layers = shadow_layers(&light, 4);
        let bounds = Bounds { min: Vec3::splat(-EXTENT), max: Vec3::splat(EXTENT) };
        let cameras = ShadowCameras::of(&light, &bounds, 4, 0);
        // The side below, or the place beside the middle of the grid.
        let camera = &cameras.cameras[match layers {
            6 => 3,
            1 => 0,
            _ => 5,
        }];
        let (is_perspective, from) = (matches!(camera.projection, Projection::Perspective { .. }), camera.origin);
        let texel = 2.0 * camera.half.max_element() / EDGE as f32 * if is_perspective { distance } else { 1.0 };
        let seen = distance - widths * texel;
        let value = match camera.projection {
            Projection::Perspective { near } => near / seen,
            Projection::Orthographic { range } => 1.0 - seen / range,
        };
        let depth = vec![value; (layers * EDGE * EDGE) as usize];
        let maps = ShadowMaps { depth: &depth, resolution: EDGE, pitch: EDGE, taps };
        let (mut visibility, mut near) = ([0.0; LANES], 0);
        dispatch!(Level::new(), simd => {
            let place = |lane: usize| from + Vec3::new(0.1 * lane as f32 - 0.3, -distance, 0.2 - 0.05 * lane as f32);
            let axes = std::array::from_fn(|axis| std::array::from_fn(|lane| place(lane)[axis]));
            let (position, normal) = (Vectors::load(simd, &axes), Vectors::splat(simd, Vec3::Y));
            let seen_from = f32x8::splat(simd, from_widths * texel);
            let receivers = Receivers { position, normal, distance: seen_from, seeds: u32x8::splat(simd, 7), first: 0 };
            let mut lookups = Lookups::NONE;
            maps.look_up(simd, &cameras, &receivers, 0xff, &mut lookups, &mut visibility);
            maps.finish(&mut lookups, &mut visibility);
            near = lookups.near;
        });
        (visibility, near)
    }

    #[test]
    fn what_is_nearer_than_a_texel_casts_no_shadow_and_the_next_does() {
        let lights = [
            LightKind::Point { position: Vec3::new(0.5, 3.0, 0.2), intensity: Vec3::ONE },
            LightKind::Spot { position: Vec3::new(0.0, 2.0, 0.0), direction: Vec3::NEG_Y, intensity: Vec3::ONE, inner: 0.2, outer: 0.7 },
            LightKind::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE },
        ];
        for kind in lights {
            for (taps, distance) in [(1, 2.5), (2, 1.5), (4, 4.0)] {
                for (widths, expected) in [(-1.0, 1.0), (0.0, 1.0), (0.9, 1.0), (1.1, 0.0), (3.0, 0.0)] {
                    let (found, _) = visible(kind, taps, distance, widths, 2.0 * NEAR);
                    assert!(found.iter().all(|found| (found - expected).abs() < 1e-5), "{kind:?} by {taps} taps, {widths} texels away: {found:?}");
                }
            }
        }
    }

    #[test]
    fn what_is_seen_from_within_eight_texels_is_left_to_rays() {
        let point = LightKind::Point { position: Vec3::new(0.5, 3.0, 0.2), intensity: Vec3::ONE };
        let sun = LightKind::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE };
        for kind in [point, sun] {
            for taps in [1, 4] {
                assert_eq!(visible(kind, taps, 2.5, 0.0, 0.9 * NEAR), ([0.0; LANES], 0xff), "{kind:?} by {taps} taps");
                assert_eq!(visible(kind, taps, 2.5, 0.0, 1.1 * NEAR).1, 0, "{kind:?} by {taps} taps");
            }
        }
    }

    /// Maps of all lights have room, those of directional lights as fine as it allows.
    #[test]
    fn grids_leave_room_for_all_lights() {
        let light = |kind| Light { name: String::new(), kind, shadows: true };
        let sun = || light(LightKind::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE });
        let point = || light(LightKind::Point { position: Vec3::ZERO, intensity: Vec3::ONE });
        for (suns, points, grid) in [(0, 2, 4), (1, 0, 4), (2, 0, 4), (1, 2, 4), (1, 3, 3), (3, 0, 3), (4, 0, 2), (8, 0, 2), (9, 0, 1), (1, 9, 1)] {
            let lights: Vec<Light> = (0..suns).map(|_| sun()).chain((0..points).map(|_| point())).collect();
            assert_eq!(shadow_grid(&lights), grid, "{suns} suns and {points} points");
        }
    }
}
