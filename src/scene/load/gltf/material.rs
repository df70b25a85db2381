//! Materials of glTF: metallic-roughness with its textures, and what extensions make of it.

use super::{Reader, beside, data_content, names};
use crate::scene::load::{
    compose::Composition,
    draft::HALF,
    error::SceneError,
    image::{Content, TextureSource},
};
use crate::scene::model::*;
use ::gltf::{
    image,
    material::{AlphaMode, NormalTexture, PbrSpecularGlossiness},
    texture::{Info, MinFilter, WrappingMode},
};
use glam::{Vec2, Vec3};
use serde_json::Value;

/// Where the vertices lie on a texture: KHR_texture_transform of one of their sets of coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Coordinates {
    pub set: u32,
    offset: Vec2,
    rotation: f32,
    scale: Vec2,
}

impl Default for Coordinates {
    fn default() -> Self {
        Self::new(0)
    }
}

impl Coordinates {
    fn new(set: u32) -> Self {
        Self { set, offset: Vec2::ZERO, rotation: 0.0, scale: Vec2::ONE }
    }

    fn of(info: &Info) -> Self {
        let plain = Self::new(info.tex_coord());
        info.texture_transform().map_or(plain, |transform| Self {
            set: transform.tex_coord().unwrap_or(plain.set),
            offset: transform.offset().into(),
            rotation: transform.rotation(),
            scale: transform.scale().into(),
        })
    }

    /// The crate has no transforms of normal maps.
    fn of_normals(info: &NormalTexture) -> Self {
        let plain = Self::new(info.tex_coord());
        let Some(transform) = info.extension_value("KHR_texture_transform") else { return plain };
        let number = |value: &Value| value.as_f64().map(|number| number as f32);
        let pair = |key: &str| transform.get(key).and_then(|pair| Some(Vec2::new(number(pair.get(0)?)?, number(pair.get(1)?)?)));
        Self {
            set: transform.get("texCoord").and_then(Value::as_u64).map_or(plain.set, |set| set as u32),
            offset: pair("offset").unwrap_or(plain.offset),
            rotation: transform.get("rotation").and_then(number).unwrap_or(plain.rotation),
            scale: pair("scale").unwrap_or(plain.scale),
        }
    }

    /// Scaled, turned counter-clockwise as seen (v points down), moved.
    pub fn place(&self, uv: Vec2) -> Vec2 {
        if *self == Self::new(self.set) {
            return uv;
        }
        let (sine, cosine) = self.rotation.sin_cos();
        let uv = uv * self.scale;
        self.offset + Vec2::new(cosine * uv.x + sine * uv.y, cosine * uv.y - sine * uv.x)
    }
}

/// What a material's textures are for.
#[derive(Clone, Copy, PartialEq)]
enum Role {
    Base,
    Facets,
    Normal,
    Emission,
}

impl Role {
    /// The first that is there says how vertices lie by their own coordinates.
    const ALL: [Self; 4] = [Self::Base, Self::Facets, Self::Normal, Self::Emission];

    /// The texture that a material has for it, and where vertices lie on that.
    fn texture<'a>(self, material: &::gltf::Material<'a>) -> Option<(::gltf::Texture<'a>, Coordinates)> {
        let surface = material.pbr_metallic_roughness();
        let info = match self {
            Self::Base => match material.pbr_specular_glossiness() {
                Some(glossiness) => glossiness.diffuse_texture(),
                None => surface.base_color_texture(),
            },
            Self::Facets if material.pbr_specular_glossiness().is_some() => None,
            Self::Facets => surface.metallic_roughness_texture(),
            Self::Normal => return material.normal_texture().map(|info| (info.texture(), Coordinates::of_normals(&info))),
            Self::Emission => material.emissive_texture(),
        }?;
        Some((info.texture(), Coordinates::of(&info)))
    }
}

/// Where the vertices lie on the textures of a material: by their own coordinates, then by one chart after the other.
pub(super) fn coordinates(material: &::gltf::Material) -> Vec<Coordinates> {
    let mut all = Vec::new();
    for (_, there) in Role::ALL.iter().filter_map(|role| role.texture(material)) {
        if !all.contains(&there) {
            all.push(there);
        }
    }
    all
}

/// The chart by which vertices lie so.
fn chart_of(coordinates: &[Coordinates], there: Coordinates) -> u32 {
    coordinates.iter().position(|coordinates| *coordinates == there).unwrap_or(0) as u32
}

/// The numbers of a material, which its textures multiply.
struct Factors {
    base: [f32; 4],
    glossy: Option<Glossy>,
}

impl Reader<'_> {
    /// The number of a material; `None` for one that is a hole all over.
    pub(super) fn material(&mut self, material: &::gltf::Material) -> Result<Option<u32>, SceneError> {
        const HOLE: u32 = u32::MAX;
        if let Some(&number) = self.materials.get(&material.index()) {
            return Ok((number != HOLE).then_some(number));
        }
        let made = self.make_material(material)?;
        let number = match made {
            Some(made) => {
                self.draft.materials.push(made);
                self.draft.materials.len() as u32 - 1
            }
            None => HOLE,
        };
        self.materials.insert(material.index(), number);
        Ok((number != HOLE).then_some(number))
    }

    fn make_material(&mut self, material: &::gltf::Material) -> Result<Option<Material>, SceneError> {
        let name = material.name().map_or_else(|| material.index().map_or("default".to_owned(), |index| format!("material {index}")), str::to_owned);
        let Factors { base: [r, g, b, alpha], glossy } = match material.pbr_specular_glossiness() {
            Some(glossiness) => self.specular_factors(&name, &glossiness)?,
            None => self.metallic_factors(&name, material)?,
        };
        let emission = Vec3::from(material.emissive_factor()) * material.emissive_strength().unwrap_or(1.0);
        if !(emission.is_finite() && emission.cmpge(Vec3::ZERO).all()) {
            return Err(self.out_of_range(&format!("the emission of material `{name}`"), "0 or more"));
        }
        if material.unlit() {
            self.ignore("unlit materials: they are lit");
        }
        let wanted = (self.wanted)(&name);
        let coordinates = coordinates(material);
        let mut map = |role: Role| {
            role.texture(material)
                .filter(|_| wanted)
                .map(|(texture, there)| (self.texture(&texture, matches!(role, Role::Facets | Role::Normal)), chart_of(&coordinates, there)))
        };
        let [(texture, _), (facets, facets_chart), (normal, normal_chart), (emissive, emission_chart)] = Role::ALL.map(|role| map(role).unzip());
        let [facets_chart, normal_chart, emission_chart] = [facets_chart, normal_chart, emission_chart].map(Option::unwrap_or_default);
        let charts = Charts { facets: facets_chart, normal: normal_chart, emission: emission_chart };
        let alpha_cutoff = self.alpha_cutoff(material, alpha);
        if self.is_clear(material) {
            return Ok(None);
        }
        if texture.is_none() && alpha_cutoff.is_some_and(|cutoff| cutoff > 1.0) {
            return Ok(None);
        }
        let is_lamp = emissive.is_some() || material.emissive_texture().is_none();
        if !material.normal_texture().is_none_or(|info| info.scale().is_finite()) {
            return Err(self.out_of_range(&format!("the scale of the normal map of material `{name}`"), "a finite number"));
        }
        let normal_scale = normal.and(material.normal_texture()).map_or(0.0, |info| info.scale());
        let glossy = glossy.filter(|glossy| facets.is_some() || !glossy.is_plain());
        Ok(Some(Material {
            texture,
            maps: Maps { facets, normal, normal_scale, emission: emissive.filter(|_| emission != Vec3::ZERO), charts },
            // A factor alone, where a texture says which parts shine, would make the whole surface a lamp.
            emission: if is_lamp { emission } else { Vec3::ZERO },
            two_sided: material.double_sided(),
            alpha_cutoff,
            glossy,
            ..Material::diffuse(name, Vec3::new(r, g, b))
        }))
    }

    fn metallic_factors(&self, name: &str, material: &::gltf::Material) -> Result<Factors, SceneError> {
        let surface = material.pbr_metallic_roughness();
        let base = surface.base_color_factor();
        let (metallic, roughness) = (surface.metallic_factor(), surface.roughness_factor());
        self.expect_in_unit(name, "base colour, metallic or roughness factor", &[base.as_slice(), &[metallic, roughness]].concat())?;
        let mut dielectric = Vec3::splat(material.ior().map_or(DIELECTRIC, reflected_along_normal));
        let mut is_lit = true;
        if let Some(specular) = material.specular() {
            let (factor, colour) = (specular.specular_factor(), Vec3::from(specular.specular_color_factor()));
            if !(colour.is_finite() && colour.cmpge(Vec3::ZERO).all()) {
                return Err(self.out_of_range(&format!("the specular colour of material `{name}`"), "0 or more"));
            }
            self.expect_in_unit(name, "specular factor", &[factor])?;
            dielectric = (dielectric * colour).min(Vec3::ONE) * factor;
            // Without it nothing is left of the lobe but what rises at grazing angles, which goes with the factor, too.
            is_lit = factor > 0.0 || metallic > 0.0;
        }
        Ok(Factors { base, glossy: Some(Glossy::MetallicRoughness { metallic, roughness, dielectric }).filter(|_| is_lit) })
    }

    /// Of a material that has a specular colour in place of metallic.
    fn specular_factors(&mut self, name: &str, surface: &PbrSpecularGlossiness) -> Result<Factors, SceneError> {
        let (base, specular, glossiness) = (surface.diffuse_factor(), surface.specular_factor(), surface.glossiness_factor());
        self.expect_in_unit(name, "diffuse, specular or glossiness factor", &[base.as_slice(), &specular, &[glossiness]].concat())?;
        if surface.specular_glossiness_texture().is_some() {
            self.ignore("specular-glossiness textures");
        }
        let glossy = Glossy::MetallicRoughness { metallic: 0.0, roughness: 1.0 - glossiness, dielectric: specular.into() };
        Ok(Factors { base, glossy: Some(glossy).filter(|_| specular != [0.0; 3]) })
    }

    /// Alpha below which there are holes; what is blended counts as there where it hides half or more.
    fn alpha_cutoff(&mut self, material: &::gltf::Material, alpha: f32) -> Option<f32> {
        let cutoff = match material.alpha_mode() {
            AlphaMode::Opaque => return None,
            AlphaMode::Blend => {
                self.ignore("alpha blending: what hides less than half is a hole");
                HALF
            }
            AlphaMode::Mask => material.alpha_cutoff().unwrap_or(HALF),
        };
        // The factor multiplies the texture's alpha, so it divides the cutoff; 2 is above any alpha.
        Some((cutoff / alpha.max(1e-6)).min(2.0)).filter(|cutoff| *cutoff > 0.0)
    }

    /// Whether what lets light through lets half of it or more, and so is taken as a hole.
    fn is_clear(&mut self, material: &::gltf::Material) -> bool {
        let Some(transmission) = material.transmission().filter(|transmission| transmission.transmission_factor() > 0.0) else { return false };
        let is_clear = transmission.transmission_factor() >= HALF;
        self.ignore(if is_clear { "surfaces that let most light through: they are holes" } else { "surfaces that let some light through: they are opaque" });
        is_clear
    }

    fn expect_in_unit(&self, material: &str, what: &str, values: &[f32]) -> Result<(), SceneError> {
        if values.iter().all(|value| (0.0..=1.0).contains(value)) {
            Ok(())
        } else {
            Err(self.out_of_range(&format!("a {what} of material `{material}`"), "0 to 1"))
        }
    }

    fn texture(&mut self, texture: &::gltf::Texture, is_linear: bool) -> u32 {
        let wrap = [texture.sampler().wrap_s(), texture.sampler().wrap_t()].map(|mode| match mode {
            WrappingMode::ClampToEdge => Wrap::Clamp,
            WrappingMode::MirroredRepeat => Wrap::Mirror,
            WrappingMode::Repeat => Wrap::Repeat,
        });
        let is_fine = matches!(texture.sampler().min_filter(), Some(MinFilter::Nearest | MinFilter::Linear));
        let reading = Reading { is_linear, is_fine, wrap };
        let Some(image) = texture.source() else { return self.absent_texture(texture, reading) };
        if let Some(&number) = self.textures.get(&(image.index(), reading)) {
            return number;
        }
        let (name, content) = match image.source() {
            image::Source::Uri { uri, .. } if uri.starts_with("data:") => (format!("image {}", image.index()), data_content(&uri["data:".len()..])),
            image::Source::Uri { uri, .. } => (uri.to_owned(), Content::Files(Composition::Image(beside(self.path, uri)))),
            image::Source::View { view, .. } => (format!("image {}", image.index()), self.view_content(&view)),
        };
        let number = self.add_texture(image.name().map_or(name, str::to_owned), content, reading);
        self.textures.insert((image.index(), reading), number);
        number
    }

    /// A texture that names no image, or one that only an extension describes.
    fn absent_texture(&mut self, texture: &::gltf::Texture, reading: Reading) -> u32 {
        let name = texture.name().map_or_else(|| format!("texture {}", texture.index()), str::to_owned);
        let why = names(texture.extensions()).map_or("it names no image".to_owned(), |names| format!("its image is supplied by {names}, which is not read"));
        self.add_texture(name, Content::Missing(why), reading)
    }

    fn add_texture(&mut self, name: String, content: Content, reading: Reading) -> u32 {
        self.draft.textures.push(TextureSource { name, content, reading });
        self.draft.textures.len() as u32 - 1
    }
}

/// What a surface of an index of refraction reflects of light along its normal; 0 stands for all of it (KHR_materials_ior).
fn reflected_along_normal(index: f32) -> f32 {
    if index == 0.0 { 1.0 } else { ((index - 1.0) / (index + 1.0)).powi(2).min(1.0) }
}
