//! What a scene requires of a pipeline.

use super::{Environment, Light, Material, Scene, Tint, Triangle, shadow_grid, shadow_layers, shape, sky::Suns};
use crate::math::lobe::Shape;

/// The facts that decide which passes and which parts of shaders stay.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Needs {
    /// How many there are.
    pub triangles: u32,
    /// None where shaders are to look it up.
    pub punctual_lights: Option<u32>,
    /// Of each of the first eight, from the lowest on, four bits: [`super::LightKind::number`], and 0 to 3 for no shadow map, one, a cube or a grid of them.
    pub light_kinds: u32,
    /// Punctual lights that cast shadows.
    pub shadowed_lights: u32,
    /// How many triangles shine.
    pub emissive_triangles: u32,
    /// Whether rays that leave the scene see anything.
    pub environment: bool,
    /// Whether it is an image.
    pub sky_image: bool,
    /// Whether some of it is so bright that rays are sent there.
    pub suns: bool,
    /// Whether any surface has a texture of any kind.
    pub textures: bool,
    /// Whether any has coarser levels.
    pub mipmaps: bool,
    /// Whether any surface has a normal map.
    pub normal_maps: bool,
    /// Whether any map lies on triangles by coordinates of its own.
    pub charts: bool,
    /// Whether the file says how the frames of normal maps lie.
    pub tangents: bool,
    /// Whether corners have colours.
    pub tints: bool,
    /// Whether any texture leaves holes.
    pub alpha_masks: bool,
    /// Whether any surface is seen from its front alone.
    pub one_sided: bool,
    /// Whether any surface is seen from both sides.
    pub two_sides: bool,
    /// Whether any triangle's normals differ from its plane's.
    pub smooth: bool,
    /// Names of the materials with a glossy lobe.
    pub glossy: Vec<String>,
    /// Whether any surface has one.
    pub lobes: bool,
    /// Whether [`Material::albedo`] stands for every lobe.
    pub by_albedo: bool,
    /// Whether any is narrow.
    pub narrow_lobes: bool,
    /// Whether any is sharp, and whether any is not.
    pub sharp_lobes: bool,
    /// Whether any is wide.
    pub wide_lobes: bool,
    /// Whether any lobe depends on the azimuth around the normal.
    pub anisotropic: bool,
    /// Whether any surface has a diffuse part, or emits and nothing else.
    pub diffuse: bool,
    /// Whether anything in it but cameras can be otherwise at another time.
    pub moves: bool,
    /// Diagonal of the bounds [scene units].
    pub extent: f32,
}

impl Needs {
    /// Those of a scene.
    pub fn of(scene: &Scene) -> Self {
        let used = used_materials(scene);
        let materials = || scene.materials.iter().zip(&used).filter(|(_, used)| **used).map(|(m, _)| m);
        let shapes = || materials().flat_map(|m| scene.lobes(m)).map(|lobe| lobe.shape);
        let mut needs = Self {
            triangles: scene.triangles.len() as u32,
            emissive_triangles: scene.triangles.iter().filter(|t| scene.materials[t.material as usize].emits()).count() as u32,
            environment: !scene.environment.is_black(),
            sky_image: matches!(scene.environment, Environment::LatLong { .. }),
            suns: Suns::new(&scene.environment).shine(),
            textures: materials().any(|m| m.texture.is_some() || !m.maps.is_empty()),
            mipmaps: scene.textures.iter().any(|texture| !texture.coarser.is_empty()),
            normal_maps: materials().any(|m| m.maps.normal.is_some()),
            charts: !scene.charts.is_empty(),
            tangents: !scene.tangents.is_empty(),
            tints: scene.triangles.iter().any(|triangle| triangle.tints != <[Tint; 3]>::default()),
            alpha_masks: materials().any(|m| m.texture.is_some() && m.alpha_cutoff.is_some()),
            one_sided: materials().any(|m| !m.two_sided),
            two_sides: materials().any(|m| m.two_sided),
            smooth: scene.triangles.iter().any(is_smooth) || scene.animation.shapes().any(shape::Shape::is_smooth),
            glossy: materials().filter(|m| has_lobe(m)).map(|m| m.name.clone()).collect(),
            lobes: materials().any(has_lobe),
            by_albedo: false,
            narrow_lobes: shapes().any(Shape::is_narrow),
            sharp_lobes: shapes().any(Shape::is_sharp),
            wide_lobes: shapes().any(|shape| !shape.is_sharp()),
            anisotropic: shapes().any(Shape::is_anisotropic),
            diffuse: materials().any(|m| !has_lobe(m) || scene.reflections(m).iter().any(|reflection| reflection.diffuse != glam::Vec3::ZERO)),
            moves: !scene.objects.is_empty() || scene.animation.changes_light(),
            extent: scene.extent(),
            ..Self::default()
        };
        needs.follow_lights(&scene.lights);
        needs
    }

    /// Takes over what lights require.
    pub fn follow_lights(&mut self, lights: &[Light]) {
        let grid = shadow_grid(lights);
        let kind = |light: &Light| light.kind.number() | shadows(light, grid) << 2;
        self.punctual_lights = Some(lights.len() as u32);
        self.light_kinds = (0..8).zip(lights).map(|(index, light)| kind(light) << (4 * index)).sum();
        self.shadowed_lights = lights.iter().filter(|light| light.shadows).count() as u32;
    }

    /// Whether lobes are rendered. Shaders of a plan that leaves nothing out for its scene may know of lobes where albedos stand for them.
    pub fn renders_lobes(&self) -> bool {
        self.lobes && !self.by_albedo
    }

    /// Of the same scene, with [`Material::albedo`] in place of every lobe.
    pub fn without_lobes(&self) -> Self {
        Self {
            glossy: Vec::new(),
            lobes: false,
            by_albedo: true,
            narrow_lobes: false,
            sharp_lobes: false,
            wide_lobes: false,
            anisotropic: false,
            diffuse: true,
            ..self.clone()
        }
    }

    /// Of the same scene, taken as if it had all that a scene can have: nothing is left out for its sake.
    pub fn unspecialised(&self) -> Self {
        Self {
            punctual_lights: None,
            light_kinds: 0,
            shadowed_lights: self.shadowed_lights.max(1),
            emissive_triangles: self.emissive_triangles.max(1),
            environment: true,
            sky_image: true,
            suns: true,
            textures: true,
            mipmaps: true,
            normal_maps: true,
            charts: true,
            tangents: true,
            tints: true,
            alpha_masks: true,
            one_sided: true,
            two_sides: true,
            smooth: true,
            lobes: true,
            narrow_lobes: true,
            sharp_lobes: true,
            wide_lobes: true,
            anisotropic: true,
            moves: true,
            ..self.clone()
        }
    }
}

fn shadows(light: &Light, grid: u32) -> u32 {
    match shadow_layers(light, grid) {
        0 => 0,
        1 => 1,
        6 => 2,
        _ => 3,
    }
}

fn has_lobe(material: &Material) -> bool {
    material.reflection(material.reflectance).lobe.is_some()
}

/// Whether it is shaded otherwise than its plane.
pub(super) fn is_smooth(triangle: &Triangle) -> bool {
    let flat = triangle.cross().normalize_or_zero();
    triangle.normals.iter().any(|normal| !normal.abs_diff_eq(flat, 1e-5))
}

/// Of each material whether a triangle has it.
pub fn used_materials(scene: &Scene) -> Vec<bool> {
    let mut used = vec![false; scene.materials.len()];
    for triangle in &scene.triangles {
        used[triangle.material as usize] = true;
    }
    used
}
