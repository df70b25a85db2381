//! Materials of scene documents: whole ones, and those that change what a file says.

use super::document::{Raw, Surface, Triple};
use super::values::Source;
use crate::math::curve::Curve;
use crate::scene::load::error::{Problem, SceneError, Together};
use crate::scene::model::{DIELECTRIC, Glossy, Material, Rgb};
use glam::{DVec3, Vec2, Vec3};

impl<'a> Source<'a> {
    /// The whole material that an entry describes; None where it changes those of files.
    pub fn surface(&self, name: &str, raw: Raw<'a, Surface<'a>>) -> Result<Option<Material>, SceneError> {
        let diffuse = |reflectance| Ok::<_, SceneError>(Material::diffuse(name, self.reflectance(reflectance)?));
        Ok(Some(match self.get(raw)? {
            Surface::Diffuse { reflectance } => diffuse(reflectance)?,
            Surface::Emitter { radiance, reflectance } => {
                let reflectance = reflectance.map_or(Ok(Vec3::ZERO), |raw| self.reflectance(raw));
                let (glow, reflectance) = (self.glow(radiance), reflectance).together()?;
                Material { emission: glow.at(0.0).as_vec3(), ..Material::diffuse(name, reflectance) }
            }
            Surface::Phong { reflectance, specular, exponent } => {
                let (base, reflectance, exponent) = (diffuse(reflectance), self.reflectance(specular), self.exponent(exponent)).together()?;
                Material { glossy: Some(Glossy::Phong { reflectance, exponent }), ..base }
            }
            Surface::Ward { reflectance, specular, alpha: [x, y] } => {
                let slope = |raw| Ok::<_, SceneError>(self.number_in(raw, "greater than 0 and at most 1", |a| a > 0.0 && a <= 1.0)? as f32);
                let (base, reflectance, x, y) = (diffuse(reflectance), self.reflectance(specular), slope(x), slope(y)).together()?;
                Material { glossy: Some(Glossy::Ward { reflectance, alpha: Vec2::new(x, y) }), ..base }
            }
            Surface::MetallicRoughness { base, metallic, roughness } => {
                let (base, metallic, roughness) = (diffuse(base), self.share(metallic), self.share(roughness)).together()?;
                Material { glossy: Some(Glossy::MetallicRoughness { metallic, roughness, dielectric: Vec3::splat(DIELECTRIC) }), ..base }
            }
            Surface::Change { .. } => return Ok(None),
        }))
    }

    fn glow(&self, raw: Raw<'a, Triple>) -> Result<Curve<DVec3>, SceneError> {
        self.curve(raw, |raw| Ok(self.radiance(raw)?.as_dvec3()))
    }

    /// How the radiance of an entry changes in time, if it does.
    pub fn changing_glow(&self, raw: Raw<'a, Surface<'a>>) -> Result<Option<Curve<DVec3>>, SceneError> {
        match self.get(raw)? {
            Surface::Emitter { radiance, .. } | Surface::Change { radiance: Some(radiance), .. } => {
                self.glow(radiance).map(|glow| Some(glow).filter(|glow| !glow.is_constant()))
            }
            _ => Ok(None),
        }
    }

    fn share(&self, raw: Raw<'a, f64>) -> Result<f32, SceneError> {
        Ok(self.number_in(raw, "0 to 1", |n| (0.0..=1.0).contains(&n))? as f32)
    }

    fn exponent(&self, raw: Raw<'a, f64>) -> Result<f32, SceneError> {
        Ok(self.number_in(raw, "0 or more", |n| n >= 0.0)? as f32)
    }

    /// A file's material with what a `Change` says.
    pub fn changed(&self, file: Material, raw: Raw<'a, Surface<'a>>) -> Result<Material, SceneError> {
        let Surface::Change { reflectance, radiance, specular, exponent, metallic, roughness, two_sided } = self.get(raw)? else { return Ok(file) };
        let metals = if metallic.is_some() || roughness.is_some() { Some([metallic, roughness]) } else { None };
        let phong = if specular.is_some() || exponent.is_some() { Some((specular, exponent)) } else { None };
        let glossy = match (metals, phong) {
            (None, None) => Ok(file.glossy),
            (Some(metals), None) => self.changed_metal(&file, metals, raw),
            (None, Some((specular, exponent))) => self.changed_phong(&file, specular, exponent, raw),
            (Some(_), Some(_)) => Err(self.other_model(&file.name, raw, "a material has either `metallic` and `roughness` or `specular` and `exponent`")),
        };
        let reflectance = reflectance.map_or(Ok(file.reflectance), |raw| self.reflectance(raw));
        let emission = radiance.map_or(Ok(file.emission), |raw| self.glow(raw).map(|glow| glow.at(0.0).as_vec3()));
        let two_sided = two_sided.map_or(Ok(file.two_sided), |raw| self.get(raw));
        let (reflectance, emission, two_sided, glossy) = (reflectance, emission, two_sided, glossy).together()?;
        Ok(Material { reflectance, emission, two_sided, glossy, ..file })
    }

    /// A surface without a lobe is no metal and as rough as can be.
    fn changed_metal(
        &self,
        file: &Material,
        [metallic, roughness]: [Option<Raw<'a, f64>>; 2],
        raw: Raw<'a, Surface<'a>>,
    ) -> Result<Option<Glossy>, SceneError> {
        let ([metal, rough], dielectric) = match file.glossy {
            None => ([0.0, 1.0], Vec3::splat(DIELECTRIC)),
            Some(Glossy::MetallicRoughness { metallic, roughness, dielectric }) => ([metallic, roughness], dielectric),
            Some(Glossy::Phong { .. } | Glossy::Ward { .. }) => {
                return Err(self.other_model(&file.name, raw, "the file's lobe has `specular`, not `metallic` and `roughness`"));
            }
        };
        let or = |raw: Option<_>, usual| raw.map_or(Ok(usual), |raw| self.share(raw));
        let (metallic, roughness) = (or(metallic, metal), or(roughness, rough)).together()?;
        let glossy = Glossy::MetallicRoughness { metallic, roughness, dielectric };
        Ok(Some(glossy).filter(|glossy| file.maps.facets.is_some() || !glossy.is_plain()))
    }

    fn changed_phong(
        &self,
        file: &Material,
        specular: Option<Raw<'a, Triple>>,
        exponent: Option<Raw<'a, f64>>,
        raw: Raw<'a, Surface<'a>>,
    ) -> Result<Option<Glossy>, SceneError> {
        let specular: Result<Option<Rgb>, _> = specular.map(|raw| self.reflectance(raw)).transpose();
        let (specular, exponent) = (specular, exponent.map(|raw| self.exponent(raw)).transpose()).together()?;
        match (file.glossy, specular, exponent) {
            (Some(Glossy::Phong { reflectance, exponent: of_file }), ..) => {
                Ok(Some(Glossy::Phong { reflectance: specular.unwrap_or(reflectance), exponent: exponent.unwrap_or(of_file) }))
            }
            (Some(Glossy::Ward { alpha, .. }), Some(reflectance), None) => Ok(Some(Glossy::Ward { reflectance, alpha })),
            (None, Some(reflectance), Some(exponent)) => Ok(Some(Glossy::Phong { reflectance, exponent })),
            (None, ..) => Err(self.other_model(&file.name, raw, "the file's material has no lobe: a new one needs both `specular` and `exponent`")),
            _ => Err(self.other_model(&file.name, raw, "the file's lobe has `metallic` and `roughness`, not `specular` and `exponent`")),
        }
    }

    fn other_model(&self, name: &str, raw: Raw<'a, Surface<'a>>, why: &str) -> SceneError {
        let message = format!("the material `{name}` cannot be changed so: {why}");
        self.error(Problem::Format, raw, message, "does not fit the file's material").help("change what the file's material has, or describe all of it")
    }
}
