//! Radiance of what rays see, on the host: `shaders/hemisphere_tiles/shade.wgsl` and `lib/light.wgsl` have the twins. Where the device
//! is a driver on the same cores, each of its lanes loads a triangle number by number; here eight samples are computed side by side as their rays end.

use crate::contract::{Recorder, port};
use crate::math::{
    random::{combinations, combine},
    vectors::{LANES, Vectors},
};
use crate::passes::record::Request;
use crate::recording::*;
use crate::scene::{
    LightKind, Rgb, Scene, Triangle,
    bvh::Bvh,
    emitters::{Emitters, Lamp},
    packets::{HitShader, Hits, RAYS, ToDo},
    shadow_maps::{Lookups, Receivers, ShadowCameras, ShadowMaps},
    surface::{Gloss, Ray},
};
use fearless_simd::{Select, Simd, f32x8, mask32x8, prelude::*, u32x8};
use glam::{Vec2, Vec3, Vec4};
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

/// What surfaces are lit by, as it stands when a loop starts.
pub(super) struct Lighting {
    lights: Vec<(LightKind, ShadowCameras)>,
    /// Of each material the albedo and the texture that multiplies it: a short table, as each sample looks into it.
    albedos: Vec<(Rgb, Option<u32>)>,
    /// Whether a triangle's normals differ from its plane's.
    smooth: bool,
    /// Whether any surface has a lobe that is to be rendered.
    lobes: bool,
    lamps: Vec<Lamp>,
    /// Shadow rays from what a sample sees to the lamps and to the sky.
    samples: [u32; 2],
    /// Whether records see lamps and the sky themselves.
    sees_emission: bool,
}

impl Lighting {
    pub fn emitters<'a>(&'a self, scene: &'a Scene, bvh: &'a Bvh) -> Emitters<'a> {
        Emitters::new(scene, bvh, &self.lamps, self.samples)
    }
}

/// Adds a step before the loop that prepares the lights; where it leaves them.
pub(super) fn record(r: &mut Recorder<'_>, samples: [u32; 2], sees_emission: bool) -> Resource {
    let memory = r.state("lighting");
    let needs = r.setting.needs;
    let (smooth, textures, lobes) = (needs.smooth, needs.textures, needs.lobes && !needs.by_albedo);
    let run = move |host: &mut dyn HostContext| {
        let scene = host.scene();
        let untextured = |(albedo, texture): (Rgb, Option<u32>)| (albedo, texture.filter(|_| textures));
        let albedos = scene.materials.iter().map(|material| untextured(material.albedo())).collect();
        let lights = scene.lights.iter().map(|light| light.kind).zip(ShadowCameras::all(scene)).collect();
        let lamps = Lamp::all(scene);
        *host.state(memory) = Some(Box::new(Arc::new(Lighting { lights, albedos, smooth, lobes, lamps, samples, sees_emission })));
        Ok(())
    };
    r.before_loop(Command::Host(Host::new("light", Vec::new(), Vec::new(), run)));
    memory
}

/// The maps, in a host step that reads them.
pub(super) fn shadow_maps<'a>(maps: &port::ShadowMaps, host: &'a dyn HostContext) -> ShadowMaps<'a> {
    ShadowMaps {
        depth: bytemuck::cast_slice(host.read(maps.depth)),
        resolution: maps.resolution,
        pitch: maps.pitch.unwrap_or(maps.resolution),
        taps: maps.taps.isqrt() as i32,
    }
}

/// What [`record`] left.
pub(super) fn lighting(host: &mut dyn HostContext, memory: Resource) -> Result<Arc<Lighting>, String> {
    let kept = host.state(memory).as_ref().and_then(|kept| kept.downcast_ref::<Arc<Lighting>>());
    kept.cloned().ok_or_else(|| "the lights were not read before the loop".into())
}

/// Sees radiance and distance.
pub(super) struct Shading<'a> {
    pub lighting: &'a Lighting,
    pub maps: ShadowMaps<'a>,
    pub scene: &'a Scene,
    pub emitters: Emitters<'a>,
    pub places: &'a [Request],
}

/// Eight samples each, which are computed side by side.
const GROUPS: usize = RAYS / LANES;

/// Distance of the sky [scene units].
const FAR_AWAY: f32 = 1e30;

/// Triangles side by side, and the rays that meet them.
struct Gathered<'a, S: Simd> {
    triangles: [&'a Triangle; LANES],
    materials: [u32; LANES],
    corner: Vectors<S>,
    edges: [Vectors<S>; 2],
    directions: Vectors<S>,
}

/// Surfaces side by side.
struct Surfaces<S: Simd> {
    position: Vectors<S>,
    /// Unit normals of the planes, and those of the shading, on the side that rays came from.
    face: Vectors<S>,
    normal: Vectors<S>,
    /// Red, green and blue, over π.
    reflectance: Vectors<S>,
    distance: f32x8<S>,
}

impl HitShader for Shading<'_> {
    type Seen = Vec4;
    const NOTHING: Vec4 = Vec4::new(0.0, 0.0, 0.0, FAR_AWAY);

    #[inline(always)]
    fn shade<S: Simd>(&self, simd: S, hits: &Hits<'_>, tile: &mut [Vec4]) {
        // All of a packet's triangles are fetched before any is worked on, so that memory is waited for once.
        let mut fetched = [const { None }; GROUPS];
        for (group, fetched) in fetched.iter_mut().enumerate() {
            let first = group * LANES;
            if hits.triangles[first..first + LANES] != [0; LANES] {
                *fetched = Some(self.gathered(simd, hits, first));
            }
        }
        let mut surfaces = [const { None }; GROUPS];
        for (surfaces, fetched) in surfaces.iter_mut().zip(&fetched) {
            if let Some(fetched) = fetched {
                *surfaces = Some(self.surfaces(simd, hits.origin, fetched));
            }
        }
        let mut others = if self.is_plain() { None } else { Some(self.others(simd, hits)) };
        let mut light = [Vectors::splat(simd, Vec3::ZERO); GROUPS];
        for (index, (kind, cameras)) in (0..).zip(&self.lighting.lights) {
            self.add_light(simd, (index, kind, cameras), hits, &surfaces, (&mut light, others.as_deref_mut()));
        }
        for group in 0..GROUPS {
            let Some(surfaces) = &surfaces[group] else { continue };
            let reflectance = others.as_ref().filter(|_| self.lighting.lobes).map(|others| reflectances(simd, &others[group * LANES..]));
            let light = light[group].times(reflectance.unwrap_or(surfaces.reflectance));
            let (red, green, blue, distance) = (light.x.to_array(), light.y.to_array(), light.z.to_array(), surfaces.distance.to_array());
            for lane in 0..LANES {
                let ray = group * LANES + lane;
                if hits.triangles[ray] != 0 && hits.samples[ray] != u32::MAX {
                    let diffuse = Vec3::new(red[lane], green[lane], blue[lane]);
                    let other = others.as_ref().map_or(Vec3::ZERO, |others| others[ray].light);
                    tile[hits.samples[ray] as usize] = (diffuse + other).extend(distance[lane]);
                }
            }
        }
        if self.lighting.sees_emission {
            self.see_sky(hits, tile);
        }
    }
}

/// What a sample sees besides diffusely reflected light of punctual lights, one sample after the other.
#[derive(Clone, Copy)]
struct Other {
    /// Of lamps and the sky, and what the lobe reflects of punctual lights [W m⁻² sr⁻¹].
    light: Vec3,
    /// Of the diffuse part, over π, with what the lobe leaves to it.
    reflectance: Rgb,
    gloss: Option<Gloss>,
}

impl Other {
    const NONE: Self = Self { light: Vec3::ZERO, reflectance: Rgb::ZERO, gloss: None };
}

// All that runs within `dispatch!` is inlined into it: what is not would not have its instructions.
impl Shading<'_> {
    /// Whether there is nothing but diffusely reflected light of punctual lights.
    fn is_plain(&self) -> bool {
        !(self.lighting.lobes || self.lighting.sees_emission || self.emitters.shine())
    }

    /// For each ray that meets something, light of lamps and the sky, and its lobe.
    #[inline(always)]
    fn others<S: Simd>(&self, simd: S, hits: &Hits<'_>) -> Box<[Other; RAYS]> {
        let mut others = Box::new([Other::NONE; RAYS]);
        let mut to_do = ToDo::default();
        for (index, other) in others.iter_mut().enumerate() {
            let Some(number) = hits.triangles[index].checked_sub(1).filter(|_| hits.samples[index] != u32::MAX) else { continue };
            let ray = Ray { origin: hits.origin, direction: hits.directions[index] };
            let barycentric = self.scene.triangles[number as usize].barycentric(ray);
            let surface = if self.lighting.lobes { self.scene.surface(number, barycentric, ray) } else { self.scene.diffuse_surface(number, barycentric, ray) };
            let seed = combine(self.places[hits.view].turn.to_bits(), hits.samples[index]);
            let emitted = if self.lighting.sees_emission { self.emitted(number, ray.direction) } else { Vec3::ZERO };
            other.light = emitted + self.emitters.light(simd, &surface, seed, &mut to_do);
            other.reflectance = surface.reflectance * FRAC_1_PI;
            other.gloss = surface.glossy;
        }
        others
    }

    /// Radiance that a triangle sends back along a ray.
    fn emitted(&self, triangle: u32, direction: Vec3) -> Rgb {
        let triangle = &self.scene.triangles[triangle as usize];
        let material = &self.scene.materials[triangle.material as usize];
        if material.two_sided || triangle.cross().dot(direction) <= 0.0 { material.emission } else { Rgb::ZERO }
    }

    /// What rays that meet nothing see.
    fn see_sky(&self, hits: &Hits<'_>, tile: &mut [Vec4]) {
        for (index, sample) in hits.samples.iter().enumerate().filter(|(index, sample)| hits.triangles[*index] == 0 && **sample != u32::MAX) {
            tile[*sample as usize] = self.scene.environment.radiance(hits.directions[index]).extend(FAR_AWAY);
        }
    }

    /// What rays from the `first` on meet. Lanes that met nothing do as the first triangle's would.
    #[inline(always)]
    fn gathered<S: Simd>(&self, simd: S, hits: &Hits<'_>, first: usize) -> Gathered<'_, S> {
        let [mut corner, mut first_edge, mut second_edge, mut directions] = [[[0.0; LANES]; 3]; 4];
        let (mut triangles, mut materials) = ([&self.scene.triangles[0]; LANES], [0; LANES]);
        for lane in 0..LANES {
            let triangle = &self.scene.triangles[hits.triangles[first + lane].saturating_sub(1) as usize];
            (triangles[lane], materials[lane]) = (triangle, triangle.material);
            let [a, b, c] = triangle.positions;
            for (into, vector) in [(&mut corner, a), (&mut first_edge, b - a), (&mut second_edge, c - a), (&mut directions, hits.directions[first + lane])] {
                (into[0][lane], into[1][lane], into[2][lane]) = (vector.x, vector.y, vector.z);
            }
        }
        let edges = [Vectors::load(simd, &first_edge), Vectors::load(simd, &second_edge)];
        Gathered { triangles, materials, corner: Vectors::load(simd, &corner), edges, directions: Vectors::load(simd, &directions) }
    }

    /// As `surface_seen` of shaders/lib/scene.wgsl.
    #[inline(always)]
    fn surfaces<S: Simd>(&self, simd: S, origin: Vec3, fetched: &Gathered<'_, S>) -> Surfaces<S> {
        let Gathered { corner, edges: [e1, e2], directions, .. } = *fetched;
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let origin = Vectors::splat(simd, origin);
        let p = directions.cross(e2);
        let determinant = e1.dot(p);
        let inverse = determinant.simd_eq(zero).select(zero, one / determinant);
        let s = origin.minus(corner);
        let u = (s.dot(p) * inverse).max(zero).min(one);
        let v = (directions.dot(s.cross(e1)) * inverse).max(zero).min(one);
        let inside = one / (u + v).max(one);
        let (u, v) = (u * inside, v * inside);
        let position = corner.plus(e1.scaled(u)).plus(e2.scaled(v));
        let plane = e1.cross(e2);
        let side = plane.dot(directions).simd_le(zero).select(one, f32x8::splat(simd, -1.0));
        let face = plane.scaled(side / plane.dot(plane).sqrt().max(f32::MIN_POSITIVE));
        let normal = if self.lighting.smooth { shading_normals(simd, &fetched.triangles, [u, v], side, face) } else { face };
        let way = position.minus(origin);
        let reflectance = self.reflectance(fetched, [u.to_array(), v.to_array()]);
        Surfaces { position, face, normal, reflectance: Vectors::load(simd, &reflectance), distance: way.dot(way).sqrt() }
    }

    /// Adds what surfaces receive of a light.
    #[inline(always)]
    fn add_light<S: Simd>(
        &self,
        simd: S,
        (index, kind, cameras): (u32, &LightKind, &ShadowCameras),
        hits: &Hits<'_>,
        surfaces: &[Option<Surfaces<S>>; GROUPS],
        (light, others): (&mut [Vectors<S>; GROUPS], Option<&mut [Other; RAYS]>),
    ) {
        let turn = u32x8::splat(simd, self.places[hits.view].turn.to_bits());
        let (mut lookups, mut visibility, mut received) = (Lookups::NONE, [0.0; RAYS], [f32x8::splat(simd, 0.0); GROUPS]);
        let mut ways = [Vectors::splat(simd, Vec3::ZERO); GROUPS];
        for group in 0..GROUPS {
            let Some(surfaces) = &surfaces[group] else { continue };
            let (to_light, arriving, is_lit) = arriving(simd, kind, surfaces);
            (ways[group], received[group]) = (to_light, arriving);
            let first = group * LANES;
            let (mut samples, mut met_any) = ([0; LANES], 0);
            samples.copy_from_slice(&hits.samples[first..first + LANES]);
            for lane in 0..LANES {
                met_any |= u32::from(hits.triangles[first + lane] != 0) << lane;
            }
            let seeds = combinations(turn, u32x8::load_array(simd, samples)) + (5 + 2 * index);
            let points = Receivers { position: surfaces.position, normal: surfaces.face, seeds, first };
            self.maps.look_up(simd, cameras, &points, is_lit.to_bitmask() as u32 & met_any, &mut lookups, &mut visibility);
        }
        self.maps.finish(&mut lookups, &mut visibility);
        let intensity = kind.intensity();
        for group in 0..GROUPS {
            let mut visible = [0.0; LANES];
            visible.copy_from_slice(&visibility[group * LANES..(group + 1) * LANES]);
            received[group] *= f32x8::load_array(simd, visible);
            light[group] = light[group].plus(Vectors::splat(simd, intensity).scaled(received[group]));
        }
        if let Some(others) = others.filter(|_| self.lighting.lobes) {
            for (group, others) in others.chunks_exact_mut(LANES).enumerate() {
                reflect_by_lobes(others, ways[group], received[group], intensity);
            }
        }
    }

    /// Red, green and blue, over π.
    #[inline(always)]
    fn reflectance<S: Simd>(&self, fetched: &Gathered<'_, S>, [u, v]: [[f32; LANES]; 2]) -> [[f32; LANES]; 3] {
        let mut reflectance = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let triangle = fetched.triangles[lane];
            let (mut colour, texture) = self.lighting.albedos[fetched.materials[lane] as usize];
            if let Some(texture) = texture {
                colour *= self.scene.textures[texture as usize].sample(triangle.uv(Vec2::new(u[lane], v[lane]))).truncate();
            }
            colour *= FRAC_1_PI;
            for channel in 0..3 {
                reflectance[channel][lane] = colour[channel];
            }
        }
        reflectance
    }
}

/// Between the corners' normals; those of the planes where these cancel.
#[inline(always)]
fn shading_normals<S: Simd>(simd: S, triangles: &[&Triangle; LANES], [u, v]: [f32x8<S>; 2], side: f32x8<S>, face: Vectors<S>) -> Vectors<S> {
    let mut corners = [[[0.0; LANES]; 3]; 3];
    for lane in 0..LANES {
        for (into, normal) in corners.iter_mut().zip(triangles[lane].normals) {
            (into[0][lane], into[1][lane], into[2][lane]) = (normal.x, normal.y, normal.z);
        }
    }
    let [n0, n1, n2] = [Vectors::load(simd, &corners[0]), Vectors::load(simd, &corners[1]), Vectors::load(simd, &corners[2])];
    let normal = n0.plus(n1.minus(n0).scaled(u)).plus(n2.minus(n0).scaled(v));
    let length = normal.dot(normal).sqrt();
    let is_there = length.simd_gt(f32x8::splat(simd, 1e-6));
    let unit = normal.scaled(side / length.max(f32::MIN_POSITIVE));
    Vectors { x: is_there.select(unit.x, face.x), y: is_there.select(unit.y, face.y), z: is_there.select(unit.z, face.z) }
}

/// Of the first eight.
#[inline(always)]
fn reflectances<S: Simd>(simd: S, others: &[Other]) -> Vectors<S> {
    let mut reflectance = [[0.0; LANES]; 3];
    for (lane, other) in others[..LANES].iter().enumerate() {
        (0..3).for_each(|channel| reflectance[channel][lane] = other.reflectance[channel]);
    }
    Vectors::load(simd, &reflectance)
}

/// Adds what lobes reflect of a light: unit directions to it, and what is received of its unit intensity.
#[inline(always)]
fn reflect_by_lobes<S: Simd>(others: &mut [Other], ways: Vectors<S>, received: f32x8<S>, intensity: Rgb) {
    let (x, y, z, received) = (ways.x.to_array(), ways.y.to_array(), ways.z.to_array(), received.to_array());
    for (lane, other) in others.iter_mut().enumerate().filter(|(lane, _)| received[*lane] > 0.0) {
        if let Some(Gloss { lobe, frame, outgoing }) = other.gloss {
            other.light += intensity * received[lane] * lobe.value(outgoing, frame.to_local(Vec3::new(x[lane], y[lane], z[lane])));
        }
    }
}

/// Unit directions to a light, what surfaces receive of its unit intensity were nothing in the way, and where that is anything.
#[inline(always)]
fn arriving<S: Simd>(simd: S, kind: &LightKind, surfaces: &Surfaces<S>) -> (Vectors<S>, f32x8<S>, mask32x8<S>) {
    let zero = f32x8::splat(simd, 0.0);
    let (to_light, falloff) = match *kind {
        LightKind::Point { position, .. } => from_point(simd, position, surfaces),
        LightKind::Spot { position, direction, inner, outer, .. } => {
            let (to_light, falloff) = from_point(simd, position, surfaces);
            let ramp = (-to_light.product(direction) - outer.cos()) * (1.0 / (inner.cos() - outer.cos()).max(1e-4));
            let ramp = ramp.max(zero).min(f32x8::splat(simd, 1.0));
            (to_light, falloff * ramp * ramp)
        }
        LightKind::Directional { direction, .. } => (Vectors::splat(simd, -direction), f32x8::splat(simd, 1.0)),
    };
    let arriving = falloff * surfaces.normal.dot(to_light);
    let is_lit = arriving.simd_gt(zero) & surfaces.face.dot(to_light).simd_gt(zero);
    // What is next to a light may receive more than there are numbers for; times no visibility it has to be nothing.
    (to_light, is_lit.select(arriving.min(f32::MAX), zero), is_lit)
}

/// Unit directions to a point, and one over the squared distances.
#[inline(always)]
fn from_point<S: Simd>(simd: S, point: Vec3, surfaces: &Surfaces<S>) -> (Vectors<S>, f32x8<S>) {
    let d = Vectors::splat(simd, point).minus(surfaces.position);
    let distance = d.dot(d).sqrt().max(1e-30);
    let inverse = f32x8::splat(simd, 1.0) / distance;
    (d.scaled(inverse), inverse * inverse)
}
