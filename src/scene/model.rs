//! The scene in memory: world-space triangles, materials, lights, cameras.
//!
//! Positions are stored in single precision relative to [`Scene::origin`], which loading moves to the middle of
//! the geometry, so that a scene far away from its file's origin keeps its digits.

use super::{animation::Animation, stage::Stage};
use crate::math::frame::Frame;
use crate::math::lobe::{Lobe, Shape};
use glam::{DVec3, UVec2, Vec2, Vec3, Vec4};
use std::{
    fmt,
    ops::Range,
    sync::{Arc, LazyLock},
};

/// The longest side of a picture [pixels].
pub const MAX_SIDE: u32 = 16384;

/// Linear Rec. 709 colour or spectrum: red, green, blue.
pub type Rgb = Vec3;

/// Everything that light transport needs to know about a place. The default is empty and black, for scenes that are made in code.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// Name for reports: the file's stem.
    pub name: String,
    /// World-space triangles, in the file's order until [`super::bvh::Bvh::build`] sorts them.
    pub triangles: Vec<Triangle>,
    /// How surfaces reflect and emit.
    pub materials: Vec<Material>,
    /// Images of materials.
    pub textures: Vec<Texture>,
    /// Texture coordinates beside the triangles' own, for maps that lie otherwise than the base colour: each of all triangles, in their order. Mostly none.
    pub charts: Vec<Vec<[Vec2; 3]>>,
    /// Along the first coordinate of normal maps at the corners of all triangles, in their order, zero where it is that of the triangle; empty where it is everywhere.
    pub tangents: Vec<[Vec3; 3]>,
    /// What the file has names or places of its own for, in the triangles' order; of a [`Stage`], what can be moved.
    pub objects: Vec<Object>,
    /// Lights without a surface.
    pub lights: Vec<Light>,
    /// What rays see that leave the scene.
    pub environment: Environment,
    /// Never empty: a file without a camera gets one that looks at the whole scene, and a note.
    pub cameras: Vec<Camera>,
    /// Of a [`Stage`], the triangles that move as they are at rest, in their order.
    pub resting: Arc<[Resting]>,
    /// What of it is otherwise at other times: [`Stage::animated`].
    pub animation: Animation,
    /// The point of the file's coordinates that is (0, 0, 0) here [scene units].
    pub origin: DVec3,
    /// What loading had to mend or leave out, one sentence each, for the user.
    pub notes: Vec<String>,
    /// Other geometry of the same place, such as a simpler mesh, which passes may read beside the scene's own: [`Stage::with_part`].
    pub parts: Vec<Part>,
}

/// Other geometry of a scene.
#[derive(Clone)]
pub struct Part {
    /// Which shaders bind it by: [`crate::schedule::Program::of_part`].
    pub name: String,
    /// Its triangles; materials and lights are the scene's.
    pub stage: Arc<Stage>,
}

impl fmt::Debug for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} triangles", self.name, self.stage.scene.triangles.len())
    }
}

/// Triangles that belong together: an instance of a mesh, an object of a file, a `Place` with a name.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// As the file has it.
    pub name: String,
    /// Its own, of [`Scene::triangles`].
    pub triangles: Range<usize>,
}

/// What moves, as the file has it.
#[derive(Debug, Clone)]
pub struct Resting {
    /// Its own, of [`Scene::triangles`].
    pub triangles: Range<usize>,
    /// These, and the tangents along normal maps at their corners.
    pub shapes: Arc<[(Triangle, [Vec3; 3])]>,
}

/// A triangle in world space, counter-clockwise seen from its front.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle {
    /// Corners, relative to the scene's origin [scene units].
    pub positions: [Vec3; 3],
    /// Unit shading normals at the corners, on the front side.
    pub normals: [Vec3; 3],
    /// Texture coordinates at the corners, (0, 0) at the image's top left as in glTF.
    pub uvs: [Vec2; 3],
    /// What multiplies the base colour at the corners.
    pub tints: [Tint; 3],
    /// Index into [`Scene::materials`].
    pub material: u32,
}

/// How a surface emits and reflects.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// As the file has it.
    pub name: String,
    /// Diffuse reflectance, 0..1 per channel; multiplied by `texture` where there is one.
    pub reflectance: Rgb,
    /// Index into [`Scene::textures`] of the base colour.
    pub texture: Option<u32>,
    /// Textures of its other numbers.
    pub maps: Maps,
    /// Emitted radiance [W m⁻² sr⁻¹].
    pub emission: Rgb,
    /// Whether the emitter also radiates from its back; implied by `two_sided`.
    pub two_sided: bool,
    /// Alpha below which the base colour texture leaves a hole.
    pub alpha_cutoff: Option<f32>,
    /// A lobe beside the diffuse part, or in its place.
    pub glossy: Option<Glossy>,
}

/// What textures change beside the base colour: indices into [`Scene::textures`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Maps {
    /// What multiplies the lobe: of [`Glossy::MetallicRoughness`] roughness by green and metallic by blue, of others the reflectance.
    pub facets: Option<u32>,
    /// Normals in the frame of the texture coordinates, red along the first, green against the second.
    pub normal: Option<u32>,
    /// What multiplies a normal's part along the surface.
    pub normal_scale: f32,
    /// What multiplies the emission.
    pub emission: Option<u32>,
    /// By which coordinates they lie.
    pub charts: Charts,
}

/// By which coordinates maps lie on triangles: 0 for the triangle's own, n for the n-th of [`Scene::charts`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Charts {
    /// Of [`Maps::facets`].
    pub facets: u32,
    /// Of [`Maps::normal`].
    pub normal: u32,
    /// Of [`Maps::emission`].
    pub emission: u32,
}

impl Maps {
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        [self.facets, self.normal, self.emission] == [None; 3]
    }

    /// The last of the charts that they lie by.
    pub fn last_chart(&self) -> u32 {
        let Charts { facets, normal, emission } = self.charts;
        let charts = [(self.facets, facets), (self.normal, normal), (self.emission, emission)];
        charts.into_iter().filter(|(map, _)| map.is_some()).map(|(_, chart)| chart).max().unwrap_or(0)
    }
}

/// A colour of a corner, linear, 0..1, by ten bits a channel: the root of what it takes away. None takes nothing away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tint(pub u32);

impl Tint {
    const MOST: f32 = 1023.0;

    /// The nearest to a colour.
    pub fn new(colour: Rgb) -> Self {
        let bits = |share: f32| ((1.0 - share.clamp(0.0, 1.0).sqrt()) * Self::MOST).round() as u32;
        Self(bits(colour.x) | bits(colour.y) << 10 | bits(colour.z) << 20)
    }

    /// What the base colour is multiplied by.
    pub fn colour(self) -> Rgb {
        let share = Vec3::new((self.0 & 1023) as f32, (self.0 >> 10 & 1023) as f32, (self.0 >> 20 & 1023) as f32);
        let root = 1.0 - share / Self::MOST;
        root * root
    }
}

/// A glossy lobe as read from a file; pipelines that cannot render it say so.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Glossy {
    /// Modified Phong.
    Phong {
        /// Of the lobe, 0..1 per channel.
        reflectance: Rgb,
        /// Of the cosine to the mirrored direction.
        exponent: f32,
    },
    /// glTF metallic-roughness (GGX).
    MetallicRoughness {
        /// How much of it is metal, 0..1.
        metallic: f32,
        /// The root of GGX's α, 0..1.
        roughness: f32,
        /// What is reflected along the normal where there is no metal.
        dielectric: Rgb,
    },
    /// Anisotropic Ward.
    Ward {
        /// Of the lobe, 0..1 per channel.
        reflectance: Rgb,
        /// The slopes along both axes.
        alpha: Vec2,
    },
}

impl Glossy {
    /// The lobe of a glTF material; none where that is plain.
    pub fn metallic_roughness(metallic: f32, roughness: f32) -> Option<Self> {
        Some(Self::MetallicRoughness { metallic, roughness, dielectric: Vec3::splat(DIELECTRIC) }).filter(|glossy| !glossy.is_plain())
    }

    /// Whether it stands for a diffuse surface: no metal, as rough as can be.
    pub fn is_plain(&self) -> bool {
        *self == Self::MetallicRoughness { metallic: 0.0, roughness: 1.0, dielectric: Vec3::splat(DIELECTRIC) }
    }
}

/// An image of 8 bits a channel, rows from the top.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Texture {
    /// The file's name, or that in the file.
    pub name: String,
    /// [texels]
    pub width: u32,
    /// [texels]
    pub height: u32,
    /// `width · height` texels: red, green, blue, alpha; alpha is linear.
    pub texels: Vec<[u8; 4]>,
    /// Those of its coarser levels, one after the other, as [`Texture::with_levels`] makes them; none where it is read at full size alone.
    pub coarser: Vec<u32>,
    /// What its texels mean.
    pub reading: Reading,
}

/// How a texture is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Reading {
    /// Whether its colours are numbers as they stand, not sRGB.
    pub is_linear: bool,
    /// Whether it is read at full size alone.
    pub is_fine: bool,
    /// Beyond its left and right, and its upper and lower edge.
    pub wrap: [Wrap; 2],
}

/// What lies beyond an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Wrap {
    /// The same image again.
    #[default]
    Repeat,
    /// The image in a mirror.
    Mirror,
    /// The texel at the edge.
    Clamp,
}

/// A light without a surface. Emissive triangles are area lights and are not listed here.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// As the file has it.
    pub name: String,
    /// Where it stands, how strong it is, and where it shines.
    pub kind: LightKind,
    /// Whether what stands before it casts a shadow.
    pub shadows: bool,
}

/// A light that has no extent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// Shines alike everywhere.
    Point {
        /// Relative to the scene's origin [scene units].
        position: Vec3,
        /// [W/sr]
        intensity: Rgb,
    },
    /// Shines in a cone; between both angles with glTF's falloff: the square of a clamped linear ramp in the cosine.
    Spot {
        /// Relative to the scene's origin [scene units].
        position: Vec3,
        /// Unit vector, along the axis.
        direction: Vec3,
        /// On the axis [W/sr].
        intensity: Rgb,
        /// The half-angle within which it is as bright as there [radians].
        inner: f32,
        /// The half-angle beyond which there is none [radians].
        outer: f32,
    },
    /// Shines from so far away that it arrives alike everywhere.
    Directional {
        /// Unit vector, the way the light travels.
        direction: Vec3,
        /// On a surface that faces it [W/m²].
        irradiance: Rgb,
    },
}

impl LightKind {
    /// Intensity [W/sr], or irradiance of a directional light [W/m²].
    pub fn intensity(&self) -> Rgb {
        match *self {
            Self::Point { intensity, .. } | Self::Spot { intensity, .. } => intensity,
            Self::Directional { irradiance, .. } => irradiance,
        }
    }

    /// Way to the light from `receiver`, its distance (infinite for a directional one), and the irradiance that it gives a surface that faces it [W/m²]; none at
    /// the light's own place.
    pub fn toward(&self, receiver: Vec3) -> Option<(Vec3, f32, DVec3)> {
        let from_point = |position: Vec3, intensity: Rgb| {
            let to = position - receiver;
            let distance = to.length();
            (distance > 0.0).then(|| (to / distance, distance, intensity.as_dvec3() / f64::from(distance).powi(2)))
        };
        match *self {
            Self::Directional { direction, irradiance } => Some((-direction, f32::INFINITY, irradiance.as_dvec3())),
            Self::Point { position, intensity } => from_point(position, intensity),
            Self::Spot { position, direction, intensity, inner, outer } => {
                let (to, distance, irradiance) = from_point(position, intensity)?;
                // The falloff of KHR_lights_punctual, its least width small enough for a spot of one degree.
                let (inner, outer) = (inner.cos(), outer.cos());
                let ramp = ((-to.dot(direction) - outer) / (inner - outer).max(1e-4)).clamp(0.0, 1.0);
                Some((to, distance, irradiance * f64::from(ramp).powi(2)))
            }
        }
    }

    /// The shaders' name for it.
    pub fn number(&self) -> u32 {
        match self {
            Self::Point { .. } => 0,
            Self::Spot { .. } => 1,
            Self::Directional { .. } => 2,
        }
    }
}

/// What rays see that leave the scene.
#[derive(Debug, Clone, PartialEq)]
pub enum Environment {
    /// The same radiance from everywhere; black where the scene has no sky.
    Constant(Rgb),
    /// Latitude-longitude radiance: rows from +y down to −y; columns by azimuth φ = atan2(x, −z) with the middle
    /// column at −z, turning towards +x; linear texels, bilinear lookup.
    LatLong {
        /// [texels]
        width: u32,
        /// [texels]
        height: u32,
        /// Row by row [W m⁻² sr⁻¹].
        texels: Vec<Rgb>,
    },
}

impl Default for Environment {
    fn default() -> Self {
        Self::Constant(Vec3::ZERO)
    }
}

/// A pinhole camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// As the file has it.
    pub name: String,
    /// Relative to the scene's origin [scene units].
    pub eye: Vec3,
    /// Unit view direction.
    pub direction: Vec3,
    /// Unit vector, perpendicular to `direction`, that points up in the picture.
    pub up: Vec3,
    /// How much it sees.
    pub field_of_view: FieldOfView,
    /// The size that the file suggests [pixels].
    pub size: Option<[u32; 2]>,
    /// Which of a picture's samples it takes; where a picture has one, it is the centre of each pixel.
    pub sample: Sample,
}

/// One of the samples of each pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// How many came before it.
    pub number: u32,
    /// How far it is from the pixel's centre, to the right and down [pixels].
    pub shift: Vec2,
    /// How wide the part of the pixel is that it stands for [pixels].
    pub width: f32,
}

impl Default for Sample {
    fn default() -> Self {
        Self { number: 0, shift: Vec2::ZERO, width: 1.0 }
    }
}

/// The angle that the camera's file states; the other follows from the picture's aspect [radians].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FieldOfView {
    /// Between the left and the right edge.
    Horizontal(f32),
    /// Between the upper and the lower edge.
    Vertical(f32),
    /// That of the shorter side of the picture.
    Shorter(f32),
}

impl Camera {
    /// What is up in a picture that looks along a unit vector, for something that is to be up there; None for what lies along the view.
    pub(crate) fn upright(direction: DVec3, up: DVec3) -> Option<DVec3> {
        Some(up.try_normalize()?.reject_from_normalized(direction)).filter(|up| up.length() > 1e-6)?.try_normalize()
    }

    /// Half width and half height of the picture plane at distance 1, for a picture of `size` pixels.
    pub fn half_extent(&self, size: [u32; 2]) -> Vec2 {
        let aspect = size[0] as f32 / size[1] as f32;
        let is_horizontal = match self.field_of_view {
            FieldOfView::Horizontal(_) => true,
            FieldOfView::Vertical(_) => false,
            FieldOfView::Shorter(_) => aspect < 1.0,
        };
        let (FieldOfView::Horizontal(angle) | FieldOfView::Vertical(angle) | FieldOfView::Shorter(angle)) = self.field_of_view;
        let half = (angle / 2.0).tan();
        if is_horizontal { Vec2::new(half, half / aspect) } else { Vec2::new(half * aspect, half) }
    }

    /// Unit vector to the right of the picture.
    pub fn right(&self) -> Vec3 {
        self.direction.cross(self.up).normalize_or_zero()
    }

    /// Direction through the sample of a pixel, not normalised: its component along `direction` is 1.
    pub fn pixel_ray(&self, size: [u32; 2], pixel: [u32; 2]) -> Vec3 {
        let half = self.half_extent(size);
        let x = ((pixel[0] as f32 + 0.5 + self.sample.shift.x) / size[0] as f32 * 2.0 - 1.0) * half.x;
        let y = (1.0 - (pixel[1] as f32 + 0.5 + self.sample.shift.y) / size[1] as f32 * 2.0) * half.y;
        self.direction + self.right() * x + self.up * y
    }

    /// What that changes by over what a sample stands for, to the right and down.
    pub fn pixel_sides(&self, size: [u32; 2]) -> [Vec3; 2] {
        let sides = self.half_extent(size) * (2.0 * self.sample.width) / Vec2::new(size[0] as f32, size[1] as f32);
        [self.right() * sides.x, -self.up * sides.y]
    }
}

/// What a point of a surface does with light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reflection {
    /// Diffuse reflectance, 0..1 per channel.
    pub diffuse: Rgb,
    /// What it reflects in some directions more than in others.
    pub lobe: Option<Lobe>,
}

/// What a surface that is no metal reflects of light along its normal (glTF 2.0, appendix B).
pub const DIELECTRIC: f32 = 0.04;

impl Material {
    /// What a point does with light whose base colour, the material's times its texture's, is `base`.
    pub fn reflection(&self, base: Rgb) -> Reflection {
        self.reflection_with(base, Vec3::ONE)
    }

    /// The same where a map multiplies the lobe by `facets`.
    pub fn reflection_with(&self, base: Rgb, facets: Vec3) -> Reflection {
        let (diffuse, lobe) = match self.glossy {
            None => return Reflection { diffuse: base, lobe: None },
            Some(Glossy::Phong { reflectance, exponent }) => (base, Lobe { shape: Shape::Phong { exponent }, reflectance: reflectance * facets }),
            Some(Glossy::Ward { reflectance, alpha }) => (base, Lobe { shape: Shape::Ward { alpha }, reflectance: reflectance * facets }),
            Some(Glossy::MetallicRoughness { metallic, roughness, dielectric }) => {
                let (roughness, metallic) = (roughness * facets.y, metallic * facets.z);
                let reflectance = dielectric.lerp(base, metallic);
                (base * (1.0 - metallic), Lobe { shape: Shape::Microfacets { alpha: roughness * roughness }, reflectance })
            }
        };
        Reflection { diffuse, lobe: Some(lobe).filter(|lobe| lobe.reflectance != Vec3::ZERO) }
    }

    /// What stands for the material where nothing renders lobes, and whether that is the base colour, which textures and tints multiply: the diffuse reflectance,
    /// which is the base colour of metals; the colour of the lobe where there is nothing else.
    pub fn albedo(&self) -> (Rgb, bool) {
        match self.glossy {
            Some(Glossy::Phong { reflectance, .. } | Glossy::Ward { reflectance, .. }) if self.reflectance == Vec3::ZERO => (reflectance, false),
            _ => (self.reflectance, true),
        }
    }

    /// Scales a diffuse part and a lobe down that together would reflect more than arrives; says whether they did.
    pub fn conserve_energy(&mut self) -> bool {
        let Some(Glossy::Phong { reflectance, .. } | Glossy::Ward { reflectance, .. }) = &mut self.glossy else { return false };
        let most = (self.reflectance + *reflectance).max_element();
        let exceeds = most > 1.0 + 1e-5;
        if exceeds {
            self.reflectance /= most;
            *reflectance /= most;
        }
        exceeds
    }

    /// A two-sided diffuse surface.
    pub fn diffuse(name: impl Into<String>, reflectance: Rgb) -> Self {
        Self { name: name.into(), reflectance, texture: None, maps: Maps::default(), emission: Vec3::ZERO, two_sided: true, alpha_cutoff: None, glossy: None }
    }

    /// Whether light leaves it that did not arrive there.
    pub fn emits(&self) -> bool {
        self.emission != Vec3::ZERO
    }

    /// All textures that it names.
    pub fn textures_mut(&mut self) -> [&mut Option<u32>; 4] {
        [&mut self.texture, &mut self.maps.facets, &mut self.maps.normal, &mut self.maps.emission]
    }
}

impl Triangle {
    /// Cross product of two edges: twice the area, along the front normal.
    pub fn cross(&self) -> Vec3 {
        let [a, b, c] = self.positions;
        (b - a).cross(c - a)
    }

    /// Unit normal of the plane, zero for a triangle without area.
    pub fn face_normal(&self) -> Vec3 {
        self.cross().normalize_or_zero()
    }
}

impl Triangle {
    /// Point at the barycentric weights of corners 1 and 2.
    pub fn position(&self, barycentric: Vec2) -> Vec3 {
        let [a, b, c] = self.positions;
        a + (b - a) * barycentric.x + (c - a) * barycentric.y
    }

    /// Texture coordinate at the barycentric weights of corners 1 and 2.
    pub fn uv(&self, barycentric: Vec2) -> Vec2 {
        at_weights(self.uvs, barycentric)
    }

    /// A frame around a unit normal whose tangent runs along the texture's first coordinate; any where there is no texture coordinate.
    pub fn tangent_frame(&self, normal: Vec3) -> Frame {
        self.texture_frame(self.uvs, normal).map_or_else(|| Frame::new(normal), |(frame, _)| frame)
    }

    /// The same by any coordinates, and the sign of the second along the bitangent; none where there are none.
    pub fn texture_frame(&self, uvs: [Vec2; 3], normal: Vec3) -> Option<(Frame, f32)> {
        let [a, b, c] = self.positions;
        let [s, t] = [uvs[1] - uvs[0], uvs[2] - uvs[0]];
        let sign = s.perp_dot(t).signum();
        let along = ((b - a) * t.y - (c - a) * s.y) * sign;
        let tangent = along - normal * normal.dot(along);
        if !(s.perp_dot(t) != 0.0 && tangent.length_squared() > 1e-12 * along.length_squared()) {
            return None;
        }
        let tangent = tangent.normalize();
        Some((Frame { tangent, bitangent: normal.cross(tangent), normal }, sign))
    }

    /// The same with a first axis that runs along a tangent of any length instead, if that is not along the normal.
    pub fn frame_along(&self, tangent: Vec3, uvs: [Vec2; 3], normal: Vec3) -> Option<(Frame, f32)> {
        let (frame, sign) = self.texture_frame(uvs, normal)?;
        let along = tangent - normal * normal.dot(tangent);
        if along.length_squared() <= 1e-6 {
            return Some((frame, sign));
        }
        let tangent = along.normalize();
        Some((Frame { tangent, bitangent: normal.cross(tangent), normal }, sign))
    }

    /// A unit normal of the front, bent as a texel of a normal map says in a frame around it; unbent without one.
    pub fn bent(frame: Option<(Frame, f32)>, normal: Vec3, texel: Vec3, scale: f32) -> Vec3 {
        let Some((frame, sign)) = frame else { return normal };
        let local = (2.0 * texel - 1.0) * Vec3::new(scale, -sign * scale, 1.0);
        frame.to_world(local).normalize_or(normal)
    }

    /// What multiplies the base colour at the barycentric weights of corners 1 and 2.
    pub fn tint(&self, barycentric: Vec2) -> Rgb {
        if self.tints == [Tint::default(); 3] {
            return Vec3::ONE;
        }
        let [a, b, c] = self.tints.map(Tint::colour);
        a + (b - a) * barycentric.x + (c - a) * barycentric.y
    }

    /// Unit shading normal at the barycentric weights of corners 1 and 2, on the front side.
    pub fn normal(&self, barycentric: Vec2) -> Vec3 {
        let [a, b, c] = self.normals;
        (a + (b - a) * barycentric.x + (c - a) * barycentric.y).normalize_or(self.face_normal())
    }
}

/// What corners have, at the barycentric weights of corners 1 and 2.
pub fn at_weights([a, b, c]: [Vec2; 3], barycentric: Vec2) -> Vec2 {
    a + (b - a) * barycentric.x + (c - a) * barycentric.y
}

impl Texture {
    /// Bilinear lookup: linear red, green, blue and alpha. The shaders do the same arithmetic.
    pub fn sample(&self, uv: Vec2) -> Vec4 {
        let ([left, right], [upper, lower], share) = self.nearest(uv, [self.width, self.height]);
        let texel = |column: u32, row: u32| self.colour(row as usize * self.width as usize + column as usize);
        texel(left, upper).lerp(texel(right, upper), share.x).lerp(texel(left, lower).lerp(texel(right, lower), share.x), share.y)
    }

    /// The columns and the rows around a texture coordinate, of an image of so many, and how far it is from the first of each to the second.
    pub(super) fn nearest(&self, uv: Vec2, [width, height]: [u32; 2]) -> ([u32; 2], [u32; 2], Vec2) {
        let [across, down] = self.reading.wrap;
        let ((columns, x), (rows, y)) = (across.nearest(uv.x, width), down.nearest(uv.y, height));
        (columns, rows, Vec2::new(x, y))
    }

    /// What one of its texels stands for.
    pub(super) fn colour(&self, texel: usize) -> Vec4 {
        let (values, [r, g, b, a]) = (self.reading.values(), self.texels[texel]);
        Vec4::new(values[r as usize], values[g as usize], values[b as usize], f32::from(a) / 255.0)
    }
}

impl Reading {
    /// What a channel's byte stands for.
    fn values(self) -> &'static [f32; 256] {
        if self.is_linear { &AS_THEY_STAND } else { &LINEAR }
    }
}

impl Wrap {
    /// The two texels of a line around a texture coordinate, and how far it is from the first to the second.
    fn nearest(self, coordinate: f32, size: u32) -> ([u32; 2], f32) {
        let within = match self {
            Self::Repeat => coordinate - coordinate.floor(),
            Self::Mirror => coordinate - 2.0 * (coordinate * 0.5).floor(),
            Self::Clamp => coordinate.clamp(0.0, 1.0),
        };
        let at = within * size as f32 - 0.5;
        let base = at.floor();
        ([base as i32, base as i32 + 1].map(|at| self.texel(at, size as i32)), at - base)
    }

    /// The texel at a place of a line of so many, which may be beyond its ends.
    pub fn texel(self, at: i32, size: i32) -> u32 {
        let within = match self {
            Self::Repeat => at.rem_euclid(size),
            Self::Mirror => {
                let at = at.rem_euclid(2 * size);
                at.min(2 * size - 1 - at)
            }
            Self::Clamp => at.clamp(0, size - 1),
        };
        within as u32
    }
}

impl Environment {
    /// Radiance from a unit direction [W m⁻² sr⁻¹].
    pub fn radiance(&self, direction: Vec3) -> Rgb {
        match self {
            Self::Constant(radiance) => *radiance,
            Self::LatLong { width, height, texels } => {
                let ([[a, b], [c, d]], across, down) = lookup([*width, *height], direction);
                texels[a].lerp(texels[b], across).lerp(texels[c].lerp(texels[d], across), down)
            }
        }
    }

    /// Whether no light comes from it.
    pub fn is_black(&self) -> bool {
        match self {
            Self::Constant(radiance) => *radiance == Vec3::ZERO,
            Self::LatLong { .. } => false,
        }
    }
}

/// The four texels of a latitude-longitude image around a unit direction, two of a row and two of the next, and how far it is from the first to the second and from
/// row to row.
pub fn lookup([width, height]: [u32; 2], direction: Vec3) -> ([[usize; 2]; 2], f32, f32) {
    let u = 0.5 + direction.x.atan2(-direction.z) / std::f32::consts::TAU;
    let v = direction.y.clamp(-1.0, 1.0).acos() / std::f32::consts::PI;
    let at = Vec2::new(u * width as f32, v * height as f32) - 0.5;
    let base = at.floor();
    let columns = [0, 1].map(|aside| (base.x as i32 + aside).rem_euclid(width as i32) as usize);
    let rows = [0, 1].map(|below| (base.y as i32 + below).clamp(0, height as i32 - 1) as usize);
    (rows.map(|row| columns.map(|column| row * width as usize + column)), at.x - base.x, at.y - base.y)
}

/// Of all 8-bit channels: a power takes longer than all else of a lookup.
static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|value| srgb_to_linear(value as f32 / 255.0)));

static AS_THEY_STAND: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|value| value as f32 / 255.0));

/// Linear value of an sRGB channel in 0..1 (IEC 61966-2-1).
pub fn srgb_to_linear(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// Axis-aligned bounds [scene units].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// The least of each coordinate.
    pub min: Vec3,
    /// The largest of each coordinate.
    pub max: Vec3,
}

impl Bounds {
    /// Of nothing.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// Of triangles.
    pub fn of(triangles: &[Triangle]) -> Self {
        triangles.iter().flat_map(|t| t.positions).fold(Self::EMPTY, Self::with)
    }

    /// With another point.
    pub fn with(self, point: Vec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// Wider by so much on every side.
    pub fn grown(self, by: f32) -> Self {
        Self { min: self.min - by, max: self.max + by }
    }

    /// Of both.
    pub fn joined(self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Its length; 0 of nothing [scene units].
    pub fn diagonal(&self) -> f32 {
        if self.min.cmpgt(self.max).any() { 0.0 } else { self.min.distance(self.max) }
    }

    /// How far a point is outside of them [scene units].
    pub fn distance(&self, point: Vec3) -> f32 {
        point.distance(point.max(self.min).min(self.max))
    }

    /// Halfway from corner to corner; the origin of nothing.
    pub fn centre(&self) -> Vec3 {
        if self.min.cmpgt(self.max).any() { Vec3::ZERO } else { (self.min + self.max) / 2.0 }
    }
}

impl Scene {
    /// A triangle as it is at rest: of what does not move, as it is.
    pub fn at_rest(&self, number: u32) -> &Triangle {
        let number = number as usize;
        let behind = self.resting.partition_point(|resting| resting.triangles.start <= number);
        let moves = behind.checked_sub(1).map(|at| &self.resting[at]).filter(|resting| resting.triangles.contains(&number));
        moves.map_or(&self.triangles[number], |resting| &resting.shapes[number - resting.triangles.start].0)
    }

    /// Of all triangles.
    pub fn bounds(&self) -> Bounds {
        Bounds::of(&self.triangles)
    }

    /// The length that every bias and limit is tied to: the diagonal of the bounds [scene units].
    pub fn extent(&self) -> f32 {
        self.bounds().diagonal()
    }

    /// What the places of a material do with light, from one extreme of what a map makes of it to the other; twice the same without a map.
    pub fn reflections(&self, material: &Material) -> [Reflection; 2] {
        self.facets(material).map(|facets| material.reflection_with(material.reflectance, facets))
    }

    /// The lobes among them.
    pub fn lobes(&self, material: &Material) -> impl Iterator<Item = Lobe> + use<> {
        self.reflections(material).into_iter().filter_map(|reflection| reflection.lobe)
    }

    /// The least and the most that the lobe of a material is multiplied by.
    pub fn facets(&self, material: &Material) -> [Vec3; 2] {
        let Some(map) = material.maps.facets else { return [Vec3::ONE; 2] };
        let texture = &self.textures[map as usize];
        let [low, high] = texture.texels.iter().fold([[u8::MAX; 3], [0; 3]], |[low, high], &[r, g, b, _]| {
            [[low[0].min(r), low[1].min(g), low[2].min(b)], [high[0].max(r), high[1].max(g), high[2].max(b)]]
        });
        let values = texture.reading.values();
        [low, high].map(|texel| Vec3::from(texel.map(|channel| values[channel as usize])))
    }

    /// Texture coordinates of a triangle's corners by a chart of [`Charts`].
    pub fn uvs(&self, triangle: u32, chart: u32) -> [Vec2; 3] {
        match chart.checked_sub(1) {
            None => self.triangles[triangle as usize].uvs,
            Some(chart) => self.charts[chart as usize][triangle as usize],
        }
    }

    /// Emissive triangles, in their order.
    pub fn emitters(&self) -> Vec<u32> {
        let emits = |triangle: &Triangle| self.materials[triangle.material as usize].emits();
        (0..).zip(&self.triangles).filter(|(_, triangle)| emits(triangle)).map(|(number, _)| number).collect()
    }

    /// The camera of a name, or the first.
    pub fn camera(&self, name: Option<&str>) -> Option<&Camera> {
        match name {
            None => self.cameras.first(),
            Some(name) => self.cameras.iter().find(|c| c.name == name),
        }
    }
}

/// How far rays start off a surface at `point` [scene units]: a share of the scene's extent, and enough to step
/// over the rounding of the point's own coordinates. The shaders use the same rule.
pub fn surface_offset(extent: f32, point: Vec3) -> f32 {
    OFFSET_OF_EXTENT * extent + OFFSET_OF_SIZE * point.abs().max_element()
}

/// How far rays start off a surface, as shares of the scene's extent and of the largest coordinate.
pub const OFFSET_OF_EXTENT: f32 = 2e-6;
/// The share of the largest coordinate.
pub const OFFSET_OF_SIZE: f32 = 4e-7;

/// Layers of the shadow maps that a light takes: six for a point light or a wide spot, one for another spot, a [`shadow_grid`] of them for a directional light; none
/// without shadows.
pub fn shadow_layers(light: &Light, grid: u32) -> u32 {
    match light.kind {
        _ if !light.shadows => 0,
        LightKind::Point { .. } => 6,
        LightKind::Spot { outer, .. } if outer > WIDE_SPOT => 6,
        LightKind::Spot { .. } => 1,
        LightKind::Directional { .. } => grid * grid,
    }
}

/// Maps along an edge of the grid of each directional light, which has all of the scene on it: as many as leave room for those of all lights.
pub fn shadow_grid(lights: &[Light]) -> u32 {
    let layers = |grid: u32| lights.iter().map(|light| shadow_layers(light, grid)).sum::<u32>();
    (2..=FINEST_GRID).rev().find(|grid| layers(*grid) <= MOST_LAYERS).unwrap_or(1)
}

const FINEST_GRID: u32 = 4;

/// Of 1024² texels: what a buffer holds on every device.
const MOST_LAYERS: u32 = 32;

/// Half the width and height of each of a light's shadow maps: at distance 1 where it is perspective, in scene units where it is not.
pub fn shadow_half(light: &Light, bounds: &Bounds, grid: u32) -> Vec2 {
    match light.kind {
        LightKind::Directional { direction, .. } => {
            let (frame, size) = (Frame::new(direction), 0.505 * (bounds.max - bounds.min).max(Vec3::ZERO));
            let across = Vec2::new(frame.bitangent.abs().dot(size), frame.tangent.abs().dot(size));
            across.max(Vec2::splat(1e-3 * bounds.diagonal())) / grid as f32
        }
        LightKind::Spot { outer, .. } if shadow_layers(light, grid) == 1 => Vec2::splat(outer.tan() * 1.01),
        _ => Vec2::ONE,
    }
}

/// The middle of one of the maps of a directional light's grid, from the scene's, along the width and the height of all [scene units].
pub fn place_in_grid(map: u32, half: Vec2, grid: u32) -> Vec2 {
    (2.0 * UVec2::new(map % grid, map / grid).as_vec2() + 1.0 - grid as f32) * half
}

/// Depth that a directional light's maps span, around the middle of a scene of so large an extent [scene units].
pub fn shadow_range(extent: f32) -> f32 {
    1.01 * extent
}

/// Half-angle from which on a spot light's shadow takes a cube: 60°.
const WIDE_SPOT: f32 = std::f32::consts::PI / 3.0;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Texels beyond an image's edges.
    #[test]
    fn images_go_on_as_their_reading_says() {
        let row = |wrap| {
            let texels = [0, 85, 170, 255].map(|grey| [grey; 4]).to_vec();
            let reading = Reading { is_linear: true, wrap: [wrap, Wrap::Repeat], ..Default::default() };
            let texture = Texture { width: 4, height: 1, texels, reading, ..Default::default() };
            [-5, -2, -1, 0, 3, 4, 5, 8, 9].map(|at| (3.0 * texture.sample(Vec2::new((at as f32 + 0.5) / 4.0, 0.5)).x).round() as i32)
        };
        assert_eq!(row(Wrap::Repeat), [3, 2, 3, 0, 3, 0, 1, 0, 1]);
        assert_eq!(row(Wrap::Mirror), [3, 1, 0, 0, 3, 3, 2, 0, 1]);
        assert_eq!(row(Wrap::Clamp), [0, 0, 0, 0, 3, 3, 3, 3, 3]);
    }

    proptest! {
        /// A quad as glTF lays it out, v pointing down: red bends to the right of the image, green up, whichever way that is turned or mirrored.
        #[test]
        fn normal_maps_bend_along_the_image(turn in 0.0..std::f32::consts::TAU, mirrored: bool, red in 0.0..1.0f32, green in 0.0..1.0f32, [x, y, z] in [-1.0..1.0f32, -1.0..1.0f32, 0.2..1.0f32]) {
            let (right, up) = (Vec2::from_angle(turn), Vec2::from_angle(turn).perp() * if mirrored { -1.0 } else { 1.0 });
            let positions = [Vec3::ZERO, Vec3::X, Vec3::new(0.3, 0.8, 0.0)];
            let uvs = positions.map(|p| Vec2::new(p.truncate().dot(right), -p.truncate().dot(up)) + 3.0);
            let triangle = Triangle { positions, normals: [Vec3::Z; 3], uvs, tints: Default::default(), material: 0 };
            let texel = Vec3::new(red, green, 0.9);
            let expected = (right.extend(0.0) * (2.0 * red - 1.0) + up.extend(0.0) * (2.0 * green - 1.0) + Vec3::Z * 0.8).normalize();
            prop_assert!(Triangle::bent(triangle.texture_frame(uvs, Vec3::Z), Vec3::Z, texel, 1.0).distance(expected) < 1e-4);
            // A straight texel bends nothing, whatever the shading normal.
            let normal = Vec3::new(x, y, z).normalize();
            prop_assert!(Triangle::bent(triangle.texture_frame(uvs, normal), normal, Vec3::new(0.5, 0.5, 1.0), 2.0).distance(normal) < 1e-5);
        }

        #[test]
        fn tints_keep_what_ten_bits_hold(r in 0.0..1.0f32, g in 0.0..1.0f32, b in 0.0..1.0f32) {
            let colour = Vec3::new(r, g, b);
            prop_assert!((Tint::new(colour).colour() - colour).abs().max_element() < 1.0 / 1000.0);
            prop_assert_eq!(Tint::new(Vec3::ONE), Tint::default());
        }
    }
}
