//! Radiance of what rays see, on the host: `shaders/hemisphere_tiles/shade.wgsl` and `lib/reflected.wgsl` have the twins. Where the device
//! is a driver on the same cores, each of its lanes loads a triangle number by number; here eight samples are computed side by side as their rays end.

mod lobe_walk;

use super::{
    irradiance_field::{Field, Point},
    record::Request,
};
use crate::contract::{Encoder, Input, PLACE, Parameter, ParameterKind, Place, PortKind, Refusal, Takes, place::refuse, port};
use crate::math::{
    random::{combinations, combine},
    vectors::{LANES, Vectors},
};
use crate::scene::{
    LightKind, Material, Rgb, Scene, Triangle,
    bvh::Bvh,
    emitters::{Emission, Emitters},
    needs::Needs,
    packets::{HitShader, Hits, RAYS, ShadowRays, ToDo},
    shadow_maps::{Lookups, Receivers, ShadowCameras, ShadowMaps},
    surface::{Gloss, Ray, Surface},
    surface_offset,
};
use crate::schedule::*;
use fearless_simd::{Select, Simd, f32x8, mask32x8, prelude::*, u32x8};
use glam::{Vec2, Vec3, Vec4};
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

/// Of nodes whose light casts shadows.
pub const SHADOW: Input = Input {
    name: "shadow",
    about: "maps of the punctual lights; without them shadows are traced by rays",
    accepts: PortKind::ShadowMaps,
    takes: Takes::AtMostOne,
    changes: false,
};

/// Of nodes that see surfaces.
pub const INDIRECT: Input = Input {
    name: "indirect",
    about: "what lights surfaces by way of others; without it they are lit by direct light alone",
    accepts: PortKind::IrradianceField,
    takes: Takes::AtMostOne,
    changes: false,
};

/// Of nodes that see surfaces by many rays.
pub const TAPS: Parameter = Parameter {
    name: "taps",
    about: "percentage-closer taps of a lookup into the shadow maps: 4, 9, 16 or 25, or 1 of 4 drawn by its weight, which a sum over thousands of samples evens out",
    unit: "",
    kind: ParameterKind::Integer { default: 1, min: 1, max: 25 },
};

/// Shadow rays from what a sample sees, to area lights and to the sky: there are many samples.
pub const SAMPLES_OF_EMITTERS: [u32; 2] = [1, 1];

/// What samples see besides diffusely reflected light.
#[derive(Clone, Copy)]
pub struct Sees {
    /// Emitters and the sky themselves; otherwise the direct pass lights from them.
    pub emission: bool,
    pub highlights: Highlights,
}

/// Lobes of the surfaces seen that reflect direct light.
#[derive(Clone, Copy, PartialEq)]
pub enum Highlights {
    All,
    /// All but narrow ones.
    Wide,
    /// All; narrow ones as wider ones of the same light, which few rays do not miss.
    Soft,
}

impl Highlights {
    fn lit(self, gloss: Gloss) -> Option<Gloss> {
        match self {
            Self::All => Some(gloss),
            Self::Wide => (!gloss.lobe.shape.is_narrow()).then_some(gloss),
            Self::Soft => Some(Gloss { lobe: gloss.lobe.softened(), ..gloss }),
        }
    }
}

/// Whether the direct pass, at an input of that name, leaves emitters and the sky to what samples see.
pub fn direct_leaves_emission(e: &Encoder<'_>) -> bool {
    e.direct_light("direct").is_none_or(|direct| !direct.lights_from_emitters)
}

/// Who shades what rays see: whoever casts them, if it can look up the shadow maps.
pub fn shading_place(e: &mut Encoder<'_>, cast: Place, maps: Option<&port::ShadowMaps>) -> Result<Place, Refusal> {
    let has_maps = e.setting.needs.shadowed_lights == 0 || maps.is_some_and(|maps| maps.pitch.is_some());
    if cast == Place::Device || has_maps {
        return Ok(cast);
    }
    let obstacle = "there are no shadow maps in a buffer";
    if e.arguments.choice(PLACE.name).0 == "Host" {
        return Err(refuse(Place::Host, obstacle, Place::Device));
    }
    e.remark(format!("what rays see is shaded by the device, as {obstacle}"));
    Ok(Place::Device)
}

/// What surfaces are lit by, as it stands when a loop starts.
pub struct Lighting {
    lights: Vec<(LightKind, ShadowCameras)>,
    /// Of each material: a short table, as each sample looks into it.
    albedos: Vec<Albedo>,
    /// Whether a triangle's normals differ from its plane's.
    smooth: bool,
    /// Whether any material bends them.
    normal_maps: bool,
    /// Whether any surface has a lobe that is to be rendered.
    lobes: bool,
    /// Shadow rays from what a sample sees to the emitters and to the sky.
    samples: [u32; 2],
    sees: Sees,
}

/// What a material reflects where nothing renders its lobe.
struct Albedo {
    colour: Rgb,
    /// What multiplies it.
    texture: Option<u32>,
    is_tinted: bool,
}

impl Lighting {
    fn of(scene: &Scene, needs: &Needs, samples: [u32; 2], sees: Sees) -> Self {
        let albedo = |material: &Material| {
            let (colour, is_base) = material.albedo();
            Albedo { colour, texture: material.texture.filter(|_| is_base), is_tinted: needs.tints && is_base }
        };
        Self {
            lights: scene.lights.iter().map(|light| light.kind).zip(ShadowCameras::all(scene)).collect(),
            albedos: scene.materials.iter().map(albedo).collect(),
            smooth: needs.smooth,
            normal_maps: needs.normal_maps,
            lobes: needs.renders_lobes(),
            samples,
            sees,
        }
    }

    /// `extent` is the scene's, which takes a look at all of it.
    pub fn emitters<'a>(&self, scene: &'a Scene, bvh: &'a Bvh, extent: f32, emission: &'a Emission) -> Emitters<'a> {
        Emitters::new(scene, bvh, extent, emission, self.samples)
    }
}

/// Adds a step before the loop that prepares the lights; where it leaves them.
pub fn encode(e: &mut Encoder<'_>, sees: Sees) -> Resource {
    let memory = e.state("lighting");
    let needs = e.setting.needs.clone();
    let run = move |host: &mut dyn HostContext| {
        let lighting = Lighting::of(host.scene(), &needs, SAMPLES_OF_EMITTERS, sees);
        *host.state(memory) = Some(Box::new(Arc::new(lighting)));
        Ok(())
    };
    e.before_loop(Command::Host(Host::new("light", Vec::new(), Vec::new(), run)));
    memory
}

/// The maps, in a host step that reads them.
fn shadow_maps<'a>(maps: &port::ShadowMaps, host: &'a dyn HostContext) -> ShadowMaps<'a> {
    ShadowMaps {
        depth: bytemuck::cast_slice(host.read(maps.depth)),
        resolution: maps.resolution,
        pitch: maps.pitch.unwrap_or(maps.resolution),
        taps: maps.taps.isqrt() as i32,
    }
}

/// What [`encode`] left.
pub fn lighting(host: &mut dyn HostContext, memory: Resource) -> Result<Arc<Lighting>, String> {
    let kept = host.state(memory).as_ref().and_then(|kept| kept.downcast_ref::<Arc<Lighting>>());
    kept.cloned().ok_or_else(|| "the lights were not read before the loop".into())
}

/// Sees radiance and distance.
pub struct Shading<'a> {
    pub lighting: &'a Lighting,
    pub maps: ShadowMaps<'a>,
    pub scene: &'a Scene,
    pub emitters: Emitters<'a>,
    pub bvh: &'a Bvh,
    /// Of the scene [scene units].
    pub extent: f32,
    pub places: &'a [Request],
    /// What lights surfaces besides, by way of others.
    pub indirect: Option<&'a Field<'a>>,
}

impl<'a> Shading<'a> {
    /// In a host step that reads the maps, by direct light alone.
    pub fn of(host: &'a dyn HostContext, lighting: &'a Lighting, maps: Option<port::ShadowMaps>, places: &'a [Request]) -> Self {
        let (scene, bvh, extent) = (host.scene(), host.bvh(), host.extent());
        let maps = maps.map_or_else(ShadowMaps::default, |maps| shadow_maps(&maps, host));
        Self { lighting, maps, scene, emitters: lighting.emitters(scene, bvh, extent, host.emission()), bvh, extent, places, indirect: None }
    }
}

/// Eight samples each, which are computed side by side.
const GROUPS: usize = RAYS / LANES;

/// Distance of the sky [scene units].
const FAR_AWAY: f32 = 1e30;

/// Triangles side by side, and the rays that meet them.
struct Gathered<'a, S: Simd> {
    numbers: [u32; LANES],
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
        self.shade_packet::<S, false>(simd, hits, |sample, seen, _| tile[sample] = seen);
    }
}

/// A sample of a tile that is lit again and again: what it sees by direct light, and where.
#[derive(Clone, Copy)]
pub struct Sight {
    /// Radiance and distance.
    pub seen: Vec4,
    pub hit: Hit,
}

/// A place that indirect light is asked for.
#[derive(Clone, Copy)]
pub struct Hit {
    pub at: Point,
    /// Of all parts, over π; black where nothing is met.
    pub reflectance: Rgb,
}

impl Hit {
    pub const NONE: Self = Self { at: Point { position: Vec3::ZERO, normal: Vec3::ZERO, triangle: 0 }, reflectance: Rgb::ZERO };
}

/// Sees what [`Shading`] does, and keeps where it is.
pub struct Keeping<'a>(pub Shading<'a>);

impl HitShader for Keeping<'_> {
    type Seen = Sight;
    const NOTHING: Sight = Sight { seen: Shading::NOTHING, hit: Hit::NONE };

    #[inline(always)]
    fn shade<S: Simd>(&self, simd: S, hits: &Hits<'_>, tile: &mut [Sight]) {
        self.0.shade_packet::<S, true>(simd, hits, |sample, seen, hit| tile[sample] = Sight { seen, hit: hit.unwrap_or(Hit::NONE) });
    }
}

/// What a sample sees besides diffusely reflected light of punctual lights, one sample after the other.
#[derive(Clone, Copy)]
struct Other {
    /// Of emitters and the sky, and what the lobe reflects of punctual lights [W m⁻² sr⁻¹].
    light: Vec3,
    /// Of the diffuse part, over π, with what the lobe leaves to it.
    reflectance: Rgb,
    /// The lobe, if it reflects direct light.
    gloss: Option<Gloss>,
    /// Where indirect light is asked for in place of the surface itself, if that has a lobe.
    asked: Option<Hit>,
}

impl Other {
    const NONE: Self = Self { light: Vec3::ZERO, reflectance: Rgb::ZERO, gloss: None, asked: None };
}

// All that runs within `dispatch!` is inlined into it: what is not would not have its instructions.
impl Shading<'_> {
    /// Hands over each sample with what it sees, and where, if it meets anything and that is kept.
    #[inline(always)]
    fn shade_packet<S: Simd, const KEEPS: bool>(&self, simd: S, hits: &Hits<'_>, mut see: impl FnMut(usize, Vec4, Option<Hit>)) {
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
        let mut to_do = ToDo::default();
        let mut others = if self.is_plain() { None } else { Some(self.others(simd, hits, KEEPS || self.indirect.is_some(), &mut to_do)) };
        let mut light = [Vectors::splat(simd, Vec3::ZERO); GROUPS];
        for (index, (kind, cameras)) in (0..).zip(&self.lighting.lights) {
            self.add_light(simd, (index, kind, cameras), hits, &surfaces, (&mut light, others.as_deref_mut()), &mut to_do);
        }
        if let Some(field) = self.indirect {
            add_indirect(simd, field, hits, &surfaces, (&mut light, others.as_deref_mut()));
        }
        let face = self.places[hits.view].face();
        let is_below = |direction: Vec3| face.is_some_and(|face| face.dot(direction) <= 0.0);
        for group in 0..GROUPS {
            let Some(surfaces) = &surfaces[group] else { continue };
            let reflectance = others.as_ref().filter(|_| self.lighting.lobes).map(|others| reflectances(simd, &others[group * LANES..]));
            let reflectance = reflectance.unwrap_or(surfaces.reflectance);
            let light = light[group].times(reflectance);
            let [light, position, normal, reflectance] = [light, surfaces.position, surfaces.normal, reflectance].map(Vectors::lanes);
            let distance = surfaces.distance.to_array();
            for lane in 0..LANES {
                let ray = group * LANES + lane;
                if hits.triangles[ray] != 0 && hits.samples[ray] != u32::MAX && !is_below(hits.directions[ray]) {
                    let other = others.as_ref().map_or(Other::NONE, |others| others[ray]);
                    let at = Point { position: position[lane], normal: normal[lane], triangle: hits.triangles[ray] };
                    let hit = || other.asked.unwrap_or(Hit { at, reflectance: reflectance[lane] });
                    see(hits.samples[ray] as usize, (light[lane] + other.light).extend(distance[lane]), KEEPS.then(hit));
                }
            }
        }
        if self.lighting.sees.emission {
            for (index, sample) in hits.samples.iter().enumerate().filter(|(index, sample)| hits.triangles[*index] == 0 && **sample != u32::MAX) {
                if is_below(hits.directions[index]) {
                    continue;
                }
                see(*sample as usize, self.scene.environment.radiance(hits.directions[index]).extend(FAR_AWAY), None);
            }
        }
    }

    /// Whether there is nothing but diffusely reflected light of punctual lights.
    fn is_plain(&self) -> bool {
        !(self.lighting.lobes || self.lighting.sees.emission || self.emitters.shine())
    }

    /// For each ray that meets something, light of emitters and the sky, and its lobe; what that reflects of other surfaces, if the ray is to go on.
    #[inline(always)]
    fn others<S: Simd>(&self, simd: S, hits: &Hits<'_>, walks: bool, to_do: &mut ToDo) -> Box<[Other; RAYS]> {
        let mut others = Box::new([Other::NONE; RAYS]);
        for (index, other) in others.iter_mut().enumerate() {
            let Some(number) = hits.triangles[index].checked_sub(1).filter(|_| hits.samples[index] != u32::MAX) else { continue };
            let ray = Ray::new(hits.origin, hits.directions[index]);
            let surface = self.scene.seen(number, ray, self.lighting.lobes);
            let seed = combine(self.places[hits.view].turn.to_bits(), hits.samples[index]);
            let emitted = if self.lighting.sees.emission { self.emitted(number, &surface, ray.direction) } else { Vec3::ZERO };
            let lit = self.lit(&surface);
            other.light = emitted + self.emitters.light(simd, &lit, seed, to_do);
            other.reflectance = surface.reflectance * FRAC_1_PI;
            other.gloss = lit.glossy;
            if walks && surface.glossy.is_some() {
                let walked = self.walk(simd, (&surface, number), seed, to_do);
                other.light += walked.light;
                other.asked = Some(walked.hit);
            }
        }
        others
    }

    /// The surface as direct light is reflected.
    pub fn lit(&self, surface: &Surface) -> Surface {
        Surface { glossy: surface.glossy.and_then(|gloss| self.lighting.sees.highlights.lit(gloss)), ..*surface }
    }

    /// Radiance that a surface, a place of a triangle, sends back along a ray.
    fn emitted(&self, triangle: u32, surface: &Surface, direction: Vec3) -> Rgb {
        let triangle = &self.scene.triangles[triangle as usize];
        let material = &self.scene.materials[triangle.material as usize];
        if material.two_sided || triangle.cross().dot(direction) <= 0.0 { surface.emission } else { Rgb::ZERO }
    }

    /// What rays from the `first` on meet. Lanes that met nothing do as the first triangle's would.
    #[inline(always)]
    fn gathered<S: Simd>(&self, simd: S, hits: &Hits<'_>, first: usize) -> Gathered<'_, S> {
        let [mut corner, mut first_edge, mut second_edge, mut directions] = [[[0.0; LANES]; 3]; 4];
        let (mut numbers, mut triangles, mut materials) = ([0; LANES], [&self.scene.triangles[0]; LANES], [0; LANES]);
        for lane in 0..LANES {
            numbers[lane] = hits.triangles[first + lane].saturating_sub(1);
            let triangle = &self.scene.triangles[numbers[lane] as usize];
            (triangles[lane], materials[lane]) = (triangle, triangle.material);
            let [a, b, c] = triangle.positions;
            for (into, vector) in [(&mut corner, a), (&mut first_edge, b - a), (&mut second_edge, c - a), (&mut directions, hits.directions[first + lane])] {
                (into[0][lane], into[1][lane], into[2][lane]) = (vector.x, vector.y, vector.z);
            }
        }
        let edges = [Vectors::load(simd, &first_edge), Vectors::load(simd, &second_edge)];
        Gathered { numbers, triangles, materials, corner: Vectors::load(simd, &corner), edges, directions: Vectors::load(simd, &directions) }
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
        let weights = [u.to_array(), v.to_array()];
        let normal = match self.lighting.normal_maps || self.lighting.smooth && self.lighting.lobes {
            true => Vectors::load(simd, &self.bent(&fetched.numbers, weights, (side.to_array(), directions.lanes()), normal.lanes())),
            false => normal,
        };
        let way = position.minus(origin);
        let reflectance = self.reflectance(fetched, weights);
        Surfaces { position, face, normal, reflectance: Vectors::load(simd, &reflectance), distance: way.dot(way).sqrt() }
    }

    /// Normals on the sides that rays came from, where normal maps bend them, or lobes turn them back.
    #[cold]
    fn bent(
        &self,
        numbers: &[u32; LANES],
        [u, v]: [[f32; LANES]; 2],
        (side, directions): ([f32; LANES], [Vec3; LANES]),
        plain: [Vec3; LANES],
    ) -> [[f32; LANES]; 3] {
        let mut bent = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let material = &self.scene.materials[self.scene.triangles[numbers[lane] as usize].material as usize];
            let is_other = material.maps.normal.is_some() || self.lighting.lobes && material.glossy.is_some();
            let seen = (-side[lane] * directions[lane], self.lighting.lobes);
            let normal = if is_other { self.scene.normal(numbers[lane], Vec2::new(u[lane], v[lane]), seen) * side[lane] } else { plain[lane] };
            (bent[0][lane], bent[1][lane], bent[2][lane]) = normal.into();
        }
        bent
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
        to_do: &mut ToDo,
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
            let points = Receivers { position: surfaces.position, normal: surfaces.face, distance: surfaces.distance, seeds, first };
            self.maps.look_up(simd, cameras, &points, is_lit.to_bitmask() as u32 & met_any, &mut lookups, &mut visibility);
        }
        self.maps.finish(&mut lookups, &mut visibility);
        self.cast_rays(kind, lookups.near, surfaces, &mut visibility, to_do);
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

    /// Whether a light arrives at surfaces that have a bit in `near`.
    fn cast_rays<S: Simd>(&self, light: &LightKind, near: u64, surfaces: &[Option<Surfaces<S>>; GROUPS], visibility: &mut [f32; RAYS], to_do: &mut ToDo) {
        if near == 0 {
            return;
        }
        let mut rays = ShadowRays { directions: [Vec3::ZERO; RAYS], all: near };
        for (group, surfaces) in surfaces.iter().enumerate() {
            let Some(surfaces) = surfaces else { continue };
            let [positions, faces] = [surfaces.position, surfaces.face].map(Vectors::lanes);
            for lane in 0..LANES {
                rays.directions[group * LANES + lane] = positions[lane] + surface_offset(self.extent, positions[lane]) * faces[lane];
            }
        }
        let hidden = self.bvh.hidden_from(self.scene, self.extent, light, &mut rays, to_do);
        for (ray, visibility) in visibility.iter_mut().enumerate().filter(|(ray, _)| near & 1 << ray != 0) {
            *visibility = if hidden & 1 << ray == 0 { 1.0 } else { 0.0 };
        }
    }

    /// Red, green and blue, over π.
    #[inline(always)]
    fn reflectance<S: Simd>(&self, fetched: &Gathered<'_, S>, [u, v]: [[f32; LANES]; 2]) -> [[f32; LANES]; 3] {
        let mut reflectance = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let triangle = fetched.triangles[lane];
            let Albedo { mut colour, texture, is_tinted } = self.lighting.albedos[fetched.materials[lane] as usize];
            let barycentric = Vec2::new(u[lane], v[lane]);
            if let Some(texture) = texture {
                colour *= self.scene.textures[texture as usize].sample(triangle.uv(barycentric)).truncate();
            }
            if is_tinted {
                colour *= triangle.tint(barycentric);
            }
            colour *= FRAC_1_PI;
            for channel in 0..3 {
                reflectance[channel][lane] = colour[channel];
            }
        }
        reflectance
    }
}

/// Adds indirect light at surfaces, or where their lobes have led.
#[inline(always)]
fn add_indirect<S: Simd>(
    simd: S,
    field: &Field<'_>,
    hits: &Hits<'_>,
    surfaces: &[Option<Surfaces<S>>; GROUPS],
    (light, mut others): (&mut [Vectors<S>; GROUPS], Option<&mut [Other; RAYS]>),
) {
    let asked = |ray: usize| others.as_deref().and_then(|others| others[ray].asked);
    let mut points = [None; RAYS];
    for (group, surfaces) in surfaces.iter().enumerate() {
        let Some(surfaces) = surfaces else { continue };
        let [position, normal] = [surfaces.position, surfaces.normal].map(Vectors::lanes);
        for lane in 0..LANES {
            let ray = group * LANES + lane;
            if hits.triangles[ray] == 0 || hits.samples[ray] == u32::MAX {
                continue;
            }
            points[ray] = match asked(ray) {
                Some(asked) => (asked.reflectance != Vec3::ZERO).then_some(asked.at),
                None => Some(Point { position: position[lane], normal: normal[lane], triangle: hits.triangles[ray] }),
            };
        }
    }
    let irradiances = field.irradiances(simd, &points);
    for (group, light) in light.iter_mut().enumerate() {
        let mut received = [[0.0; LANES]; 3];
        for (lane, irradiance) in irradiances[group * LANES..][..LANES].iter().enumerate() {
            let other = others.as_deref_mut().map(|others| &mut others[group * LANES + lane]);
            match other.and_then(|other| other.asked.map(|asked| (asked, other))) {
                Some((asked, other)) => other.light += asked.reflectance * *irradiance,
                None => (0..3).for_each(|channel| received[channel][lane] = irradiance[channel]),
            }
        }
        *light = light.plus(Vectors::load(simd, &received));
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
        if let Some(gloss) = other.gloss {
            other.light += intensity * received[lane] * gloss.value(Vec3::new(x[lane], y[lane], z[lane]));
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

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    /// Of a surface at the origin: the way to a light, what arrives, and whether anything does.
    #[inline(always)]
    fn received<S: Simd>(simd: S, kind: &LightKind, face: Vec3, normal: Vec3) -> (Vec3, f32, bool) {
        let [position, face, normal, reflectance] = [Vec3::ZERO, face, normal, Vec3::ONE].map(|vector| Vectors::splat(simd, vector));
        let surfaces = Surfaces { position, face, normal, reflectance, distance: f32x8::splat(simd, 1.0) };
        let (way, light, is_lit) = arriving(simd, kind, &surfaces);
        (Vec3::new(way.x.to_array()[3], way.y.to_array()[3], way.z.to_array()[3]), light.to_array()[3], is_lit.to_bitmask() & 8 != 0)
    }

    fn expect(kind: LightKind, [face, normal]: [Vec3; 2], way: Vec3, light: f32) {
        let found = dispatch!(Level::new(), simd => received(simd, &kind, face, normal));
        assert!((found.0 - way).length() < 1e-6 && (found.1 - light).abs() <= 1e-5 * light, "{found:?} is not {way} {light}");
        assert_eq!(found.2, light > 0.0);
    }

    #[test]
    fn surfaces_receive_what_reaches_both_of_their_normals() {
        let up = [Vec3::Z; 2];
        let tilted = Vec3::new(0.6, 0.0, 0.8);
        let point = |position: Vec3| LightKind::Point { position, intensity: Vec3::ONE };
        expect(point(Vec3::new(0.0, 0.0, 3.0)), up, Vec3::Z, 1.0 / 9.0);
        expect(point(Vec3::new(0.0, 0.0, 3.0)), [Vec3::Z, tilted], Vec3::Z, 0.8 / 9.0);
        expect(point(Vec3::new(3.0, 0.0, 4.0)), up, tilted, 0.8 / 25.0);
        // From behind the plane, or behind what the normal is shaded as.
        expect(point(Vec3::new(4.0, 0.0, -1.0)), [Vec3::Z, tilted], Vec3::new(4.0, 0.0, -1.0).normalize(), 0.0);
        expect(point(Vec3::new(-4.0, 0.0, 1.0)), [Vec3::Z, tilted], Vec3::new(-4.0, 0.0, 1.0).normalize(), 0.0);
        let directional = LightKind::Directional { direction: -tilted, irradiance: Vec3::ONE };
        expect(directional, up, tilted, 0.8);
        expect(directional, [Vec3::NEG_Z; 2], tilted, 0.0);
    }

    #[test]
    fn spots_fade_from_their_inner_angle_to_their_outer() {
        let (inner, outer) = (0.2f32, 0.6f32);
        let up = [Vec3::Z; 2];
        for angle in [0.0f32, 0.15, 0.25, 0.4, 0.55, 0.65] {
            let position = 2.0 * Vec3::new(angle.sin(), 0.0, angle.cos());
            let spot = LightKind::Spot { position, direction: Vec3::NEG_Z, intensity: Vec3::ONE, inner, outer };
            let ramp = ((angle.cos() - outer.cos()) / (inner.cos() - outer.cos())).clamp(0.0, 1.0);
            expect(spot, up, position / 2.0, ramp * ramp * angle.cos() / 4.0);
        }
    }
}

#[cfg(test)]
mod tiles {
    use super::*;
    use crate::math::frame::Frame;
    use crate::math::hemisphere::{Method, Shape, Table};
    use crate::math::random::{hash, unit};
    use crate::passes::mock::MockHost;
    use crate::scene::{
        Charts, Environment, Glossy, Light, Maps, Material, Reading, Texture, Tint, Wrap,
        packets::{Numbers, RayBundle, View},
        surface_offset,
    };
    use fearless_simd::{Level, dispatch};

    fn number(at: u32) -> f32 {
        2.0 * unit(hash(at)) - 1.0
    }

    fn point(at: u32) -> Vec3 {
        Vec3::new(number(3 * at), number(3 * at + 1), number(3 * at + 2))
    }

    /// Triangles all around, plain, emissive from one side and from both, glossy, textured, and with maps of all kinds; smooth, and every seventh tinted.
    fn surroundings() -> MockHost {
        let triangle = |at: u32| {
            let centre = point(at).normalize() * (2.0 + unit(hash(at)));
            let positions = [1, 2, 3].map(|corner| centre + 0.6 * point(1000 + 3 * at + corner));
            let face = (positions[1] - positions[0]).cross(positions[2] - positions[0]).normalize();
            let normals = [1, 2, 3].map(|corner| (face + 0.3 * point(5000 + 3 * at + corner)).normalize());
            let tints = if at.is_multiple_of(7) { [Vec3::X, Vec3::Y, Vec3::new(0.2, 0.4, 0.9)].map(Tint::new) } else { Default::default() };
            Triangle { positions, normals, uvs: [Vec2::ZERO, 3.0 * Vec2::X, -2.0 * Vec2::Y], tints, material: at % 6 }
        };
        let mut host = MockHost::new((0..120).map(triangle).collect(), [4, 4]);
        let grey = |name: &str| Material::diffuse(name, Vec3::new(0.5, 0.4, 0.3));
        host.scene.materials = vec![
            grey("plain"),
            Material { emission: Vec3::new(3.0, 2.0, 1.0), ..grey("lamp") },
            Material { emission: Vec3::new(1.0, 2.0, 3.0), two_sided: true, ..grey("lamp of two sides") },
            Material { glossy: Some(Glossy::Phong { reflectance: Vec3::new(0.2, 0.3, 0.4), exponent: 5.0 }), ..grey("glossy") },
            Material { texture: Some(0), ..grey("textured") },
            Material {
                maps: Maps { facets: Some(1), normal: Some(1), normal_scale: 0.7, emission: Some(0), charts: Charts { facets: 0, normal: 1, emission: 1 } },
                emission: Vec3::new(2.0, 1.0, 0.5),
                glossy: Glossy::metallic_roughness(0.8, 0.9),
                ..grey("mapped")
            },
        ];
        let texels = vec![[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [200, 100, 50, 255]];
        let normals = vec![[128, 128, 255, 255], [200, 90, 220, 255], [60, 180, 200, 255], [100, 255, 130, 255]];
        let texture = |texels, reading| Texture { width: 2, height: 2, texels, reading, ..Default::default() };
        let reading = Reading { is_linear: true, wrap: [Wrap::Mirror, Wrap::Clamp], ..Default::default() };
        host.scene.textures = vec![texture(texels, Reading::default()), texture(normals, reading)];
        host.scene.charts = vec![host.scene.triangles.iter().map(|triangle| triangle.uvs.map(|uv| Vec2::new(1.0 - 2.0 * uv.y, uv.x))).collect()];
        let kinds = [
            LightKind::Point { position: Vec3::new(0.5, 0.2, -0.3), intensity: Vec3::new(4.0, 5.0, 6.0) },
            LightKind::Spot { position: Vec3::new(-0.4, 0.1, 0.2), direction: Vec3::Y, intensity: Vec3::splat(9.0), inner: 0.3, outer: 1.2 },
            LightKind::Directional { direction: Vec3::new(0.6, 0.0, 0.8), irradiance: Vec3::new(1.0, 0.5, 0.2) },
        ];
        host.scene.lights = kinds.map(|kind| Light { name: String::new(), kind, shadows: false }).into();
        host.scene.environment = Environment::Constant(Vec3::new(0.1, 0.2, 0.3));
        host
    }

    fn lighting(scene: &Scene, lobes: bool, sees_emission: bool, samples: [u32; 2]) -> Lighting {
        let needs = Needs::of(scene);
        let needs = if lobes { needs } else { needs.without_lobes() };
        Lighting::of(scene, &needs, samples, Sees { emission: sees_emission, highlights: Highlights::All })
    }

    /// What a surface receives of a light's unit intensity.
    fn arriving(kind: &LightKind, position: Vec3, [face, normal]: [Vec3; 2]) -> (Vec3, f32) {
        let (way, falloff) = match *kind {
            LightKind::Directional { direction, .. } => (-direction, 1.0),
            LightKind::Point { position: from, .. } => ((from - position).normalize(), 1.0 / from.distance_squared(position)),
            LightKind::Spot { position: from, direction, inner, outer, .. } => {
                let way = (from - position).normalize();
                let ramp = ((-way.dot(direction) - outer.cos()) / (inner.cos() - outer.cos())).clamp(0.0, 1.0);
                (way, ramp * ramp / from.distance_squared(position))
            }
        };
        (way, if face.dot(way) > 0.0 { falloff * normal.dot(way).max(0.0) } else { 0.0 })
    }

    /// Radiance and distance along a ray that meets a triangle, computed alone.
    fn seen(host: &MockHost, lighting: &Lighting, (ray, triangle, seed): (Ray, u32, u32)) -> Vec4 {
        let scene = &host.scene;
        let barycentric = scene.triangles[triangle as usize].barycentric(ray);
        let surface = if lighting.lobes { scene.surface(triangle, barycentric, ray) } else { scene.diffuse_surface(triangle, barycentric, ray) };
        let mut light = Vec3::ZERO;
        for ((kind, _), light_of_scene) in lighting.lights.iter().zip(&scene.lights) {
            let (way, received) = arriving(kind, surface.position, [surface.face, surface.normal]);
            let distance = if let LightKind::Point { position, .. } = *kind { position.distance(surface.position) } else { f32::INFINITY };
            if light_of_scene.shadows && host.bvh.occluded(scene, surface.start(scene.extent()), way, 0.9999 * distance) {
                continue;
            }
            let lobe = surface.glossy.map_or(Vec3::ZERO, |gloss| gloss.lobe.value(gloss.outgoing, gloss.frame.to_local(way)));
            light += kind.intensity() * received * (surface.reflectance * FRAC_1_PI + lobe);
        }
        let material = &scene.materials[scene.triangles[triangle as usize].material as usize];
        let front = scene.triangles[triangle as usize].face_normal().dot(ray.direction) <= 0.0;
        if lighting.sees.emission && (front || material.two_sided) {
            light += surface.emission;
        }
        let emitters = lighting.emitters(scene, &host.bvh, scene.extent(), host.emission());
        light += dispatch!(Level::new(), simd => emitters.light(simd, &surface, seed, &mut ToDo::default()));
        light.extend(surface.position.distance(ray.origin))
    }

    /// How many samples of two tiles meet anything, and how many of those are lit otherwise than alone.
    fn shaded_otherwise(host: &MockHost, lighting: &Lighting, maps: ShadowMaps<'_>) -> [u32; 2] {
        let table = Table::new(Shape::Cosine, 18, Method::None).unwrap();
        let fan = RayBundle::new(&table);
        let places = [0.3, 0.9].map(|turn| Request::new(Vec3::new(0.1, turn, 0.2), 1.0, Vec3::new(0.0, 0.6, 0.8), turn));
        let views = places.each_ref().map(|place| View { position: place.position.into(), frame: Frame::new(place.normal.into()).turned(place.turn) });
        let packets = host.bvh.packets(&host.scene);
        let mut numbers = vec![0; 2 * fan.samples];
        packets.trace(&host.scene, &views, &fan, &Numbers, &mut numbers);
        let extent = host.scene.extent();
        let emitters = lighting.emitters(&host.scene, &host.bvh, extent, host.emission());
        let eye = Shading { lighting, maps, scene: &host.scene, emitters, bvh: &host.bvh, extent, places: &places, indirect: None };
        let mut found = vec![Vec4::ZERO; 2 * fan.samples];
        packets.trace(&host.scene, &views, &fan, &eye, &mut found);
        let [mut met, mut others] = [0, 0];
        for (index, found) in found.into_iter().enumerate() {
            let (view, sample) = (&views[index / fan.samples], index % fan.samples);
            let direction = view.frame.to_world(Vec3::from(table.samples[sample].direction.map(|d| d as f32)));
            let Some(triangle) = numbers[index].checked_sub(1) else {
                let sky = if lighting.sees.emission { Vec3::new(0.1, 0.2, 0.3) } else { Vec3::ZERO };
                assert_eq!(found, sky.extend(FAR_AWAY));
                continue;
            };
            let origin = view.position + view.frame.normal * surface_offset(extent, view.position);
            let seed = combine(places[index / fan.samples].turn.to_bits(), sample as u32);
            let expected = seen(host, lighting, (Ray::new(origin, direction), triangle, seed));
            met += 1;
            others += u32::from((found - expected).abs().max_element() > 2e-3 * expected.max_element());
        }
        [met, others]
    }

    #[test]
    fn eight_samples_side_by_side_are_shaded_as_each_alone() {
        let host = surroundings();
        for (lobes, sees_emission, samples) in [(false, false, [0, 0]), (true, true, [0, 0]), (true, false, [2, 3]), (false, true, [2, 0])] {
            let lighting = lighting(&host.scene, lobes, sees_emission, samples);
            let [met, others] = shaded_otherwise(&host, &lighting, ShadowMaps::default());
            // Shadow rays that graze an edge may tell otherwise.
            assert!(met > 100 && others <= if samples == [0, 0] { 0 } else { 3 }, "{others} of {met} differ with {lobes} {sees_emission} {samples:?}");
        }
    }

    /// All that is seen is nearer than eight texels of maps that have one each, in which nothing casts a shadow.
    #[test]
    fn what_is_seen_from_nearby_is_lit_by_shadow_rays() {
        let mut host = surroundings();
        host.scene.lights.retain(|light| !matches!(light.kind, LightKind::Spot { .. }));
        let lit_without = {
            let lighting = lighting(&host.scene, false, false, [0, 0]);
            host.scene.lights.iter_mut().for_each(|light| light.shadows = true);
            shaded_otherwise(&host, &lighting, ShadowMaps::default())[1]
        };
        let lighting = lighting(&host.scene, false, false, [0, 0]);
        let depth = vec![0.0; 64];
        let [met, others] = shaded_otherwise(&host, &lighting, ShadowMaps { depth: &depth, resolution: 1, pitch: 1, taps: 1 });
        assert!(lit_without > met / 10 && others <= 3, "{others} of {met} differ, and {lit_without} without shadows");
    }
}
