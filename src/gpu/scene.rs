//! The scene as shaders read it: `shaders/lib/scene.wgsl` and `lib/camera.wgsl` have the same structs.

use super::hierarchy::{self, Packing};
use crate::host_struct;
use crate::scene::{
    Bounds, Camera, Charts, DIELECTRIC, Environment, Glossy, LightKind, Material, Object, Scene, Texture, Triangle, Wrap,
    emitters::{
        Emission,
        tree::{Group, Next, most_groups},
    },
    shadow_grid, shadow_half, shadow_layers,
    sky::Suns,
    stage::{Changed, Motion, Pose, Stage},
};
use crate::schedule::{Format, HostLayout, ResourceKind, SceneData};
use bytemuck::{bytes_of, cast_slice};
use glam::{Vec2, Vec3};
use std::{ops::Range, ptr};

host_struct! {
    /// Facts of the whole scene.
    pub struct SceneParameters {
        environment: [f32; 3],
        extent: f32,
        /// Luminance of the broad sky at most [W m⁻² sr⁻¹].
        sky_limit: f32,
        lights: u32,
        emitters: u32,
        /// Of suns, luminance × solid angle in texels at the horizon; 0 where there are none.
        sun_weight: f32,
        /// 0 × 0 where the environment is constant.
        environment_size: [u32; 2],
        /// Where the lights, the emitters and the materials start among the tables.
        first_light: u32,
        first_emitter: u32,
        centre: [f32; 3],
        first_material: u32,
    }
}

host_struct! {
    pub struct SceneMaterial {
        reflectance: [f32; 3],
        /// `TWO_SIDED`, `HOLES`, `TEXTURED`.
        flags: u32,
        emission: [f32; 3],
        alpha_cutoff: f32,
        /// First texel, width, height.
        texture_start: u32,
        texture_width: u32,
        texture_height: u32,
        /// 0 for none, 1 Phong, 2 Ward, 3 microfacets.
        lobe: u32,
        /// Of Phong's and Ward's lobe; of microfacets what a surface that is no metal has more than `DIELECTRIC`.
        specular: [f32; 3],
        metallic: f32,
        /// Exponent, slopes along both tangents, or the slope of microfacets.
        lobe_shape: [f32; 2],
        /// Where its `MAPS` start among the tables; 0 where it has none.
        maps: u32,
        normal_scale: f32,
    }
}

host_struct! {
    pub struct SceneLight {
        position: [f32; 3],
        /// 0 point, 1 spot, 2 directional.
        kind: u32,
        direction: [f32; 3],
        /// First layer of its shadow maps, or `u32::MAX` where it casts no shadows.
        shadow_layer: u32,
        /// Intensity [W/sr], or irradiance [W/m²] of a directional light.
        intensity: [f32; 3],
        cos_inner: f32,
        cos_outer: f32,
        /// Maps it takes: six for a cube, a grid of a directional light.
        shadow_layers: u32,
        /// Half a map's width: at distance 1 where it is perspective, in scene units where it is not.
        shadow_half: [f32; 2],
    }
}

host_struct! {
    /// Some emissive triangles: a group of [`LightTree`](crate::scene::emitters::tree::LightTree).
    pub struct SceneLamps {
        centre: [f32; 3],
        radius: f32,
        axis: [f32; 3],
        spread: f32,
        power: f32,
        /// `LAMP` and its triangle, or the first of the groups that it holds; `BOTH_SIDES` where a lamp has two.
        next: u32,
        count: u32,
        padding: u32,
    }
}

host_struct! {
    /// How far an object, or a triangle of one that deforms, has come since the picture before.
    pub struct SceneMover {
        /// Its first triangle, and one past its last.
        first: u32,
        end: u32,
        padding: [u32; 2],
        /// Rows of what brings its points to where they were.
        backward_x: [f32; 4],
        backward_y: [f32; 4],
        backward_z: [f32; 4],
    }
}

host_struct! {
    /// The camera of the frame, and that of the picture before.
    pub struct FrameCamera {
        eye: [f32; 3],
        /// Distance of the near plane [scene units].
        near: f32,
        /// Unit axis, and half the width of the picture at distance 1.
        right: [f32; 3],
        half_width: f32,
        up: [f32; 3],
        half_height: f32,
        forward: [f32; 3],
        /// Counts from 0.
        frame: u32,
        size: [u32; 2],
        /// See [`Sample`](crate::scene::Sample).
        shift: [f32; 2],
        sample: u32,
        width: f32,
        /// Of `SceneMover`.
        movers: u32,
        padding: u32,
        eye_before: [f32; 3],
        half_width_before: f32,
        right_before: [f32; 3],
        half_height_before: f32,
        up_before: [f32; 3],
        padding_a: f32,
        forward_before: [f32; 3],
        padding_b: f32,
    }
}

pub const LAYOUTS: &[HostLayout] =
    &[SceneParameters::LAYOUT, SceneMaterial::LAYOUT, SceneLight::LAYOUT, SceneLamps::LAYOUT, SceneMover::LAYOUT, FrameCamera::LAYOUT];

/// Lights in the uniform of the first of them.
const FIRST_LIGHTS: usize = 4;

pub const TWO_SIDED: u32 = 1;
pub const HOLES: u32 = 2;
pub const TEXTURED: u32 = 4;
pub const NO_BASE: u32 = 8;
/// From this bit on, how the texture is read.
const READING: u32 = 8;

/// Elements of the maps of a material that has any: of facets, of normals, of emission, and where the charts of these and the tangents start among
/// the tables.
const MAPS: usize = 4;

/// Elements of a triangle's texture coordinates in a chart.
const CHART: u64 = 2;

/// Elements of a triangle's tangents.
const TANGENTS: u64 = 3;

/// Of [`SceneLamps`].
pub const LAMP: u32 = 1 << 31;
pub const BOTH_SIDES: u32 = 1 << 30;

/// Bytes of an element of the tables.
const ELEMENT: usize = 16;

/// Bytes of a triangle's corners and of its attributes.
pub(super) const CORNERS_BYTES: u64 = 48;
pub(super) const ATTRIBUTES_BYTES: u64 = 64;

/// Least size of a part of the scene as a buffer [bytes]: shaders bind at least one element, attributes are the largest.
const LEAST_BYTES: usize = 64;

/// Widest row of the textures' texels: what every adapter takes.
const MOST_TEXELS: u64 = 8192;

/// What a part of the scene is on the device.
pub fn kind(scene: &Scene, data: SceneData) -> ResourceKind {
    kind_with(scene, scene.emitters().len(), data)
}

/// The same for a stage, whose emitters are counted already, and its parts.
pub fn kinds(stage: &Stage) -> impl Fn(&Scene, SceneData) -> ResourceKind + '_ {
    let (scene, emitters) = (&stage.scene, stage.needs().emissive_triangles as usize);
    move |of, data| if ptr::eq(of, scene) { kind_with(scene, emitters, data) } else { kind(of, data) }
}

/// The same of a scene with so many [emitters](Scene::emitters).
pub fn kind_with(scene: &Scene, emitters: usize, data: SceneData) -> ResourceKind {
    let triangles = scene.triangles.len() as u64;
    let buffer = |bytes: u64| ResourceKind::Buffer { bytes: bytes.next_multiple_of(ELEMENT as u64).max(LEAST_BYTES as u64) };
    match data {
        SceneData::Parameters => buffer(size_of::<SceneParameters>() as u64),
        SceneData::Positions => buffer(triangles * 36),
        SceneData::Corners => buffer(triangles * CORNERS_BYTES),
        SceneData::Attributes => buffer(triangles * ATTRIBUTES_BYTES),
        SceneData::Tables | SceneData::AlbedoTables => buffer(Places::of(scene, emitters).end * ELEMENT as u64),
        SceneData::FirstLights => buffer((FIRST_LIGHTS * size_of::<SceneLight>()) as u64),
        SceneData::Movers => buffer((count_movers(scene) * size_of::<SceneMover>()) as u64),
        SceneData::Texels => {
            let texels = scene.textures.iter().map(|texture| texture.all_texels() as u64).sum::<u64>().max(1);
            let width = texels.next_power_of_two().min(MOST_TEXELS);
            ResourceKind::Texture { size: [width as u32, texels.div_ceil(width) as u32], layers: 1, format: Format::R32Uint }
        }
        SceneData::Environment => {
            let size = match &scene.environment {
                Environment::Constant(_) => [1, 1],
                Environment::LatLong { width, height, .. } => [*width, *height],
            };
            ResourceKind::Texture { size, layers: 1, format: Format::Rgba32Float }
        }
    }
}

/// A scene as it is brought to the device, and what of it was brought there.
pub struct Upload {
    emission: Emission,
    bounds: Bounds,
    /// Of a scene of which parts can move.
    packing: Option<Packing>,
}

/// Bytes of a part of the scene, from a place on.
pub type Patch = (u64, Vec<u8>);

impl Upload {
    pub fn new(stage: &Stage) -> Self {
        Self { emission: Emission::of(&stage.scene), bounds: stage.bounds(), packing: Packing::new(&stage.bvh) }
    }

    pub fn emission(&self) -> &Emission {
        &self.emission
    }

    /// The bytes of a part of the scene, as many as its [`kind`] has, of an image row by row.
    pub fn bytes(&self, stage: &Stage, data: SceneData) -> Vec<u8> {
        let scene = &stage.scene;
        let mut bytes = match data {
            SceneData::Parameters => bytes_of(&self.parameters(stage)).to_vec(),
            SceneData::Positions => positions(&scene.triangles),
            SceneData::Corners => all_corners(&scene.triangles),
            SceneData::Attributes => all_attributes(&scene.triangles),
            SceneData::Tables => self.tables(stage, materials),
            SceneData::AlbedoTables => self.tables(stage, albedos),
            SceneData::FirstLights => first_lights(scene, &self.bounds),
            SceneData::Texels => texels(scene),
            SceneData::Environment => match &scene.environment {
                Environment::Constant(radiance) => bytes_of(&radiance.extend(0.0)).to_vec(),
                Environment::LatLong { .. } => environment(scene, &self.emission.suns),
            },
            SceneData::Movers => movers(stage, &stage.poses()),
        };
        bytes.resize(kind_with(scene, self.emission.lamps(), data).bytes() as usize, 0);
        bytes
    }

    /// What the device is to be told of a part of the scene, after a change that leaves its kind as it is.
    pub fn patches(&self, stage: &Stage, changed: &Changed, data: SceneData) -> Vec<Patch> {
        let triangles = &stage.scene.triangles;
        let moved = |bytes_each: u64, bytes: fn(&[Triangle]) -> Vec<u8>| {
            let patch = |range: Range<usize>| (range.start as u64 * bytes_each, bytes(&triangles[range]));
            changed.movers.iter().map(|mover| patch(stage.triangles_of(*mover))).collect()
        };
        match data {
            SceneData::Positions => moved(36, positions),
            SceneData::Corners => moved(CORNERS_BYTES, all_corners),
            SceneData::Attributes => moved(ATTRIBUTES_BYTES, all_attributes),
            SceneData::Tables => self.table_patches(stage, changed, materials),
            SceneData::AlbedoTables => self.table_patches(stage, changed, albedos),
            SceneData::Environment if changed.environment => vec![(0, self.bytes(stage, data))],
            // Movers are told as frames start.
            SceneData::Texels | SceneData::Environment | SceneData::Movers => Vec::new(),
            SceneData::Parameters | SceneData::FirstLights => vec![(0, self.bytes(stage, data))],
        }
    }

    /// Follows a change; whether all of the hierarchy has to be packed anew.
    pub fn follow(&mut self, stage: &Stage, changed: &Changed) -> bool {
        self.bounds = stage.bounds();
        if changed.emission {
            self.emission = Emission::of(&stage.scene);
        }
        let leaves = self.packing.as_ref().is_some_and(|packing| !packing.holds(&self.bounds));
        if leaves {
            self.packing = Packing::new(&stage.bvh);
        }
        leaves
    }

    fn parameters(&self, stage: &Stage) -> SceneParameters {
        parameters(&stage.scene, &self.bounds, self.emission.lamps(), &self.emission.suns)
    }

    /// `materials` are described with their maps from an element on.
    fn tables(&self, stage: &Stage, materials: impl Fn(&Scene, u32) -> Vec<SceneMaterial>) -> Vec<u8> {
        let scene = &stage.scene;
        let places = Places::of(scene, self.emission.lamps());
        let mut bytes = match &self.packing {
            Some(packing) => cast_slice(&packing.whole(&stage.bvh, &scene.triangles)).to_vec(),
            None => cast_slice(&hierarchy::packed(stage.bvh.nodes(), &stage.bvh.ranges(), &scene.triangles)).to_vec(),
        };
        let small = self.small_tables(scene, &places, materials);
        let (charts, tangents) = (charts(scene), tangents(&scene.tangents));
        for (place, table) in small.into_iter().chain([(places.charts, cast_slice(&charts).to_vec()), (places.tangents, cast_slice(&tangents).to_vec())]) {
            bytes.resize(place as usize * ELEMENT, 0);
            bytes.extend_from_slice(&table);
        }
        bytes
    }

    /// Lights, lamps, materials and their maps, each from an element on.
    fn small_tables(&self, scene: &Scene, places: &Places, materials: impl Fn(&Scene, u32) -> Vec<SceneMaterial>) -> [(u64, Vec<u8>); 4] {
        [
            (places.lights, cast_slice(&lights(scene, &self.bounds)).to_vec()),
            (places.emitters, cast_slice(&lamps(&self.emission)).to_vec()),
            (places.materials, cast_slice(&materials(scene, places.maps as u32)).to_vec()),
            (places.maps, cast_slice(&maps(scene, [places.charts, places.tangents].map(|place| place as u32))).to_vec()),
        ]
    }

    fn table_patches(&self, stage: &Stage, changed: &Changed, materials: impl Fn(&Scene, u32) -> Vec<SceneMaterial>) -> Vec<Patch> {
        let scene = &stage.scene;
        let places = Places::of(scene, self.emission.lamps());
        let tangents_of = |range: Range<usize>| {
            let tangents = scene.tangents.get(range.clone()).unwrap_or_default();
            (places.tangents + TANGENTS * range.start as u64, cast_slice(&self::tangents(tangents)).to_vec())
        };
        let moved = changed.movers.iter().map(|mover| tangents_of(stage.triangles_of(*mover)));
        let hierarchy = self.packing.iter().flat_map(|packing| packing.patches(stage, &changed.movers));
        let hierarchy = hierarchy.map(|(element, elements)| (u64::from(element), cast_slice(&elements).to_vec()));
        let all = hierarchy.chain(moved).chain(self.small_tables(scene, &places, materials));
        all.filter(|(_, bytes)| !bytes.is_empty()).map(|(element, bytes): (u64, Vec<u8>)| (element * ELEMENT as u64, bytes)).collect()
    }
}

/// Where tables start among all of them [elements]; the hierarchy is the first.
struct Places {
    lights: u64,
    emitters: u64,
    materials: u64,
    maps: u64,
    charts: u64,
    tangents: u64,
    end: u64,
}

impl Places {
    fn of(scene: &Scene, emitters: usize) -> Self {
        let elements = |count: usize, bytes: usize| (count * bytes).div_ceil(ELEMENT) as u64;
        let lights = hierarchy::most_elements(scene.triangles.len() as u64);
        let first_emitter = lights + elements(scene.lights.len(), size_of::<SceneLight>());
        let materials = first_emitter + elements(most_groups(emitters), size_of::<SceneLamps>());
        let maps = materials + elements(scene.materials.len(), size_of::<SceneMaterial>());
        let mapped = scene.materials.iter().filter(|material| !material.maps.is_empty()).count();
        let charts = maps + (MAPS * mapped) as u64;
        let tangents = charts + CHART * (scene.charts.len() * scene.triangles.len()) as u64;
        let end = tangents + TANGENTS * scene.tangents.len() as u64;
        Self { lights, emitters: first_emitter, materials, maps, charts, tangents, end }
    }
}

fn positions(triangles: &[Triangle]) -> Vec<u8> {
    triangles.iter().flat_map(|t| bytes_of(&t.positions.map(|p| p.to_array())).to_vec()).collect()
}

fn all_corners(triangles: &[Triangle]) -> Vec<u8> {
    triangles.iter().flat_map(|t| bytes_of(&corners(t)).to_vec()).collect()
}

fn all_attributes(triangles: &[Triangle]) -> Vec<u8> {
    triangles.iter().flat_map(|t| bytes_of(&attributes(t)).to_vec()).collect()
}

fn texels(scene: &Scene) -> Vec<u8> {
    scene.textures.iter().flat_map(|t| [cast_slice(&t.texels), cast_slice::<_, u8>(&t.coarser)]).flatten().copied().collect()
}

/// Texels, with the running sum of what suns have up to and including each in the spare place.
/// Texels of a sky that is an image.
fn environment(scene: &Scene, suns: &Suns) -> Vec<u8> {
    let Environment::LatLong { texels, .. } = &scene.environment else { return Vec::new() };
    let (mut bright, mut sum) = (suns.texels().iter().peekable(), 0.0);
    let with_sum = |(number, texel): (u32, &Vec3)| {
        sum = bright.next_if(|(at, _)| *at == number).map_or(sum, |(_, until)| *until);
        texel.extend(sum).to_array()
    };
    let texels: Vec<[f32; 4]> = (0..).zip(texels).map(with_sum).collect();
    cast_slice(&texels).to_vec()
}

/// What a picture of the scene depends on, one part after the other: geometry, materials, textures, lights. Where tables stand and the
/// hierarchy follow from these.
pub fn contents(scene: &Scene) -> impl Iterator<Item = Vec<u8>> {
    let bounds = scene.bounds();
    let parameters = parameters(scene, &bounds, scene.emitters().len(), &Suns::default());
    let parameters = SceneParameters { first_light: 0, first_emitter: 0, first_material: 0, ..parameters };
    let part = move |number: usize| {
        let mut bytes = match number {
            0 => bytes_of(&parameters).to_vec(),
            1 => positions(&scene.triangles),
            2 => all_corners(&scene.triangles),
            3 => all_attributes(&scene.triangles),
            4 => cast_slice(&materials(scene, 1)).to_vec(),
            5 => texels(scene),
            6 => cast_slice(&lights(scene, &bounds)).to_vec(),
            7 => first_lights(scene, &bounds),
            8 => environment(scene, &Suns::default()),
            9 => cast_slice(&maps(scene, [1, 1])).to_vec(),
            _ => [cast_slice(&charts(scene)), cast_slice::<_, u8>(&tangents(&scene.tangents))].concat(),
        };
        bytes.resize(bytes.len().next_multiple_of(ELEMENT).max(LEAST_BYTES), 0);
        bytes
    };
    // Scenes without maps are known by the parts that they had before there were any.
    (0..9 + usize::from(!maps(scene, [1, 1]).is_empty()) + usize::from(!(scene.charts.is_empty() && scene.tangents.is_empty()))).map(part)
}

fn parameters(scene: &Scene, bounds: &Bounds, emitters: usize, suns: &Suns) -> SceneParameters {
    let places = Places::of(scene, emitters);
    let (environment, environment_size) = match &scene.environment {
        Environment::Constant(radiance) => (*radiance, [0, 0]),
        Environment::LatLong { width, height, .. } => (Vec3::ZERO, [*width, *height]),
    };
    SceneParameters {
        environment: environment.into(),
        extent: bounds.diagonal(),
        sky_limit: suns.limit,
        lights: scene.lights.len() as u32,
        emitters: emitters as u32,
        sun_weight: suns.weight(),
        environment_size,
        first_light: places.lights as u32,
        first_emitter: places.emitters as u32,
        centre: bounds.centre().into(),
        first_material: places.materials as u32,
    }
}

/// Corner 0 and the material, edges to corners 1 and 2 with the tints of corners 0 and 1.
fn corners(triangle: &Triangle) -> [[f32; 4]; 3] {
    let [a, b, c] = triangle.positions;
    let [first, second, _] = triangle.tints.map(|tint| f32::from_bits(tint.0));
    [a.extend(f32::from_bits(triangle.material)).into(), (b - a).extend(first).into(), (c - a).extend(second).into()]
}

/// Three normals, with the texture coordinates and the tint of corner 2 in the spare places.
fn attributes(triangle: &Triangle) -> [[f32; 4]; 4] {
    let [n0, n1, n2] = triangle.normals;
    let [t0, t1, t2]: [Vec2; 3] = triangle.uvs;
    [n0.extend(t0.x).into(), n1.extend(t0.y).into(), n2.extend(t1.x).into(), [t1.y, t2.x, t2.y, f32::from_bits(triangle.tints[2].0)]]
}

/// The first texel of each texture.
fn texel_starts(scene: &Scene) -> Vec<u32> {
    let starts = scene.textures.iter().scan(0, |next, texture| {
        let start = *next;
        *next += texture.all_texels() as u32;
        Some(start)
    });
    starts.collect()
}

/// Of the materials that have any, one after the other: first texel, width, height and reading of each map, zeros where one is missing; then where the chart of
/// each starts, 0 for the triangles' own coordinates; and where the tangents start, 0 where there are none.
fn maps(scene: &Scene, [first_chart, first_tangents]: [u32; 2]) -> Vec<[u32; 4]> {
    let starts = texel_starts(scene);
    let map = |map: Option<u32>| {
        let Some(map) = map else { return [0; 4] };
        let texture = &scene.textures[map as usize];
        [starts[map as usize], texture.width, texture.height, reading(texture)]
    };
    let mapped = scene.materials.iter().filter(|material| !material.maps.is_empty());
    let chart = |chart: u32| chart.checked_sub(1).map_or(0, |before| first_chart + before * CHART as u32 * scene.triangles.len() as u32);
    let tangents = if scene.tangents.is_empty() { 0 } else { first_tangents };
    let rows = |Material { maps, .. }: &Material| {
        let Charts { facets, normal, emission } = maps.charts;
        let [facets_chart, normal_chart, emission_chart] = [facets, normal, emission].map(chart);
        [map(maps.facets), map(maps.normal), map(maps.emission), [facets_chart, normal_chart, emission_chart, tangents]]
    };
    mapped.flat_map(rows).collect()
}

fn tangents(tangents: &[[Vec3; 3]]) -> Vec<[[f32; 4]; TANGENTS as usize]> {
    tangents.iter().map(|tangents| tangents.map(|tangent| tangent.extend(0.0).into())).collect()
}

/// Chart by chart the texture coordinates of all triangles.
fn charts(scene: &Scene) -> Vec<[Vec2; 2 * CHART as usize]> {
    scene.charts.iter().flatten().map(|&[a, b, c]| [a, b, c, Vec2::ZERO]).collect()
}

/// A bit for numbers as they stand, then two each for what lies beyond the edges, across and down, and one for coarser levels.
fn reading(texture: &Texture) -> u32 {
    let wrap = texture.reading.wrap.map(|wrap| match wrap {
        Wrap::Repeat => 0,
        Wrap::Mirror => 1,
        Wrap::Clamp => 2,
    });
    u32::from(texture.reading.is_linear) | wrap[0] << 1 | wrap[1] << 3 | u32::from(!texture.coarser.is_empty()) << 5
}

/// Their maps are among the tables from an element on.
fn materials(scene: &Scene, first_map: u32) -> Vec<SceneMaterial> {
    let starts = texel_starts(scene);
    let mut next_map = first_map;
    scene
        .materials
        .iter()
        .map(|m| {
            let texture = m.texture.map(|t| (starts[t as usize], &scene.textures[t as usize]));
            let flag = |on: bool, bit: u32| if on { bit } else { 0 };
            let maps = if m.maps.is_empty() { 0 } else { next_map };
            next_map += if m.maps.is_empty() { 0 } else { MAPS as u32 };
            let (lobe, specular, lobe_shape, metallic) = match m.glossy {
                None => (0, Vec3::ZERO, [0.0; 2], 0.0),
                Some(Glossy::Phong { reflectance, exponent }) => (1, reflectance, [exponent, 0.0], 0.0),
                Some(Glossy::Ward { reflectance, alpha }) => (2, reflectance, alpha.into(), 0.0),
                Some(Glossy::MetallicRoughness { metallic, roughness, dielectric }) => (3, dielectric - DIELECTRIC, [roughness * roughness, 0.0], metallic),
            };
            SceneMaterial {
                reflectance: m.reflectance.into(),
                flags: flag(m.two_sided, TWO_SIDED)
                    | flag(texture.is_some() && m.alpha_cutoff.is_some(), HOLES)
                    | flag(texture.is_some(), TEXTURED)
                    | texture.map_or(0, |(_, texture)| reading(texture) << READING),
                emission: m.emission.into(),
                alpha_cutoff: m.alpha_cutoff.unwrap_or(0.0),
                texture_start: texture.map_or(0, |t| t.0),
                texture_width: texture.map_or(0, |t| t.1.width),
                texture_height: texture.map_or(0, |t| t.1.height),
                lobe,
                specular: specular.into(),
                metallic,
                lobe_shape,
                maps,
                normal_scale: m.maps.normal_scale,
            }
        })
        .collect()
}

/// Materials by [`Material::albedo`], without lobes.
fn albedos(scene: &Scene, first_map: u32) -> Vec<SceneMaterial> {
    let diffuse = |(glossy, material): (SceneMaterial, &Material)| {
        let (reflectance, is_base) = material.albedo();
        let flags = if is_base { glossy.flags } else { glossy.flags & !TEXTURED | NO_BASE };
        SceneMaterial { reflectance: reflectance.into(), flags, lobe: 0, ..glossy }
    };
    materials(scene, first_map).into_iter().zip(&scene.materials).map(diffuse).collect()
}

fn lights(scene: &Scene, bounds: &Bounds) -> Vec<SceneLight> {
    let (mut layer, grid) = (0, shadow_grid(&scene.lights));
    scene
        .lights
        .iter()
        .map(|light| {
            let layers = shadow_layers(light, grid);
            let (position, direction, intensity, angles) = match light.kind {
                LightKind::Point { position, intensity } => (position, Vec3::ZERO, intensity, [0.0, 0.0]),
                LightKind::Spot { position, direction, intensity, inner, outer } => (position, direction, intensity, [inner.cos(), outer.cos()]),
                LightKind::Directional { direction, irradiance } => (Vec3::ZERO, direction, irradiance, [0.0, 0.0]),
            };
            layer += layers;
            SceneLight {
                position: position.into(),
                kind: light.kind.number(),
                direction: direction.into(),
                shadow_layer: if layers == 0 { u32::MAX } else { layer - layers },
                intensity: intensity.into(),
                cos_inner: angles[0],
                cos_outer: angles[1],
                shadow_layers: layers,
                shadow_half: shadow_half(light, bounds, grid).into(),
            }
        })
        .collect()
}

/// As many as the shaders have places for, the rest of them empty.
fn first_lights(scene: &Scene, bounds: &Bounds) -> Vec<u8> {
    let mut bytes = cast_slice(&lights(scene, bounds)).to_vec();
    bytes.resize(FIRST_LIGHTS * size_of::<SceneLight>(), 0);
    bytes
}

fn lamps(emission: &Emission) -> Vec<SceneLamps> {
    let lamps = |group: Group| {
        let (next, count) = match group.next {
            Next::Lamp(lamp) => (LAMP | emission.triangle(lamp), 0),
            Next::Groups { first, count } => (first, count),
        };
        SceneLamps {
            centre: group.centre.into(),
            radius: group.radius,
            axis: group.axis.into(),
            spread: group.spread,
            power: group.power,
            next: next | if group.two_sided { BOTH_SIDES } else { 0 },
            count,
            padding: 0,
        }
    };
    emission.tree.groups().into_iter().map(lamps).collect()
}

/// Objects that can be moved, each triangle of one that deforms for itself.
fn count_movers(scene: &Scene) -> usize {
    let parts = |(number, object): (usize, &Object)| if scene.animation.deforms(number) { object.triangles.len() } else { 1 };
    scene.objects.iter().enumerate().map(parts).sum()
}

/// The same in the order of their triangles, which were elsewhere before.
pub fn movers(stage: &Stage, before: &[Pose]) -> Vec<u8> {
    let mover = |Motion { triangles, map }: Motion| {
        let backward = map.as_mat4().transpose();
        let [backward_x, backward_y, backward_z] = [backward.x_axis, backward.y_axis, backward.z_axis].map(Into::into);
        SceneMover { first: triangles.start as u32, end: triangles.end as u32, padding: [0; 2], backward_x, backward_y, backward_z }
    };
    let movers: Vec<SceneMover> = stage.backward(before).into_iter().map(mover).collect();
    cast_slice(&movers).to_vec()
}

/// Of the uniform what is of this picture alone.
pub const OF_PICTURE: usize = std::mem::offset_of!(FrameCamera, eye_before);

/// The uniform of a frame, with the camera of the picture before.
pub fn camera((camera, before): (&Camera, &Camera), size: [u32; 2], stage: &Stage, frame: u32) -> FrameCamera {
    let (half, half_before) = (camera.half_extent(size), before.half_extent(size));
    let extent = stage.extent();
    FrameCamera {
        eye: camera.eye.into(),
        near: extent.max(f32::MIN_POSITIVE) * 1e-5,
        right: camera.right().into(),
        half_width: half.x,
        up: camera.up.into(),
        half_height: half.y,
        forward: camera.direction.into(),
        frame,
        size,
        shift: camera.sample.shift.into(),
        sample: camera.sample.number,
        width: camera.sample.width,
        movers: count_movers(&stage.scene) as u32,
        padding: 0,
        eye_before: before.eye.into(),
        half_width_before: half_before.x,
        right_before: before.right().into(),
        half_height_before: half_before.y,
        up_before: before.up.into(),
        padding_a: 0.0,
        forward_before: before.direction.into(),
        padding_b: 0.0,
    }
}
