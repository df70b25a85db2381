//! The project's own scene documents.
//!
//! Values stay as slices of the source until they are asked for ([`Raw`]), so that every error, also one about
//! meaning, can underline the place that it is about.

use super::{
    LoadOptions, Normals,
    draft::{Draft, Face, mirrors, normal_map},
    error::{Problem, SceneError, SourceText, suggestion},
    files::Files,
    generate, image, list, load_geometry, primitives, refuse_overrides,
    sky::{self, Clear},
    teapot,
};
use crate::scene::model::*;
use ::ron::{Options, error::SpannedError, extensions::Extensions, value::RawValue};
use glam::{DMat4, DQuat, DVec3, Vec2, Vec3};
use serde::{
    Deserialize, Deserializer,
    de::{MapAccess, Visitor},
};
use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    fmt,
    marker::PhantomData,
    ops::{Range, RangeInclusive},
    path::{Path, PathBuf},
};

/// The version of documents that this program reads.
const VERSION: u32 = 1;
/// The name that stands for every material without an entry of its own.
const ANY: &str = "*";
/// A value as it stands in the source, parsed when it is asked for.
struct Raw<'a, T> {
    text: &'a str,
    parsed: PhantomData<fn() -> T>,
}

impl<T> Clone for Raw<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Raw<'_, T> {}

impl<'de: 'a, 'a, T> Deserialize<'de> for Raw<'a, T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        <&'a RawValue>::deserialize(deserializer).map(|raw| Self { text: raw.get_ron().trim(), parsed: PhantomData })
    }
}

/// A map in the order of the file.
struct Entries<'a, T>(Vec<(Raw<'a, String>, Raw<'a, T>)>);

impl<T> Default for Entries<'_, T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<'de: 'a, 'a, T> Deserialize<'de> for Entries<'a, T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct InOrder<'a, T>(PhantomData<fn() -> Entries<'a, T>>);
        impl<'de: 'a, 'a, T> Visitor<'de> for InOrder<'a, T> {
            type Value = Entries<'a, T>;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a map from names to values")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(Entries(entries))
            }
        }
        deserializer.deserialize_map(InOrder(PhantomData))
    }
}

type Triple = [f64; 3];

/// The whole document.
#[derive(Deserialize)]
#[serde(rename = "Scene", deny_unknown_fields)]
struct Document<'a> {
    #[serde(borrow)]
    version: Raw<'a, u32>,
    /// What the scene is for; for readers of the file and of the list of scenes.
    #[serde(default)]
    about: Option<String>,
    /// Who made it, and its licence; for readers of the file.
    #[serde(default, rename = "source")]
    _source: Option<String>,
    #[serde(borrow)]
    geometry: Vec<Raw<'a, Geometry<'a>>>,
    #[serde(borrow, default)]
    materials: Entries<'a, Surface<'a>>,
    #[serde(borrow, default)]
    normals: Option<Raw<'a, NormalsChoice<'a>>>,
    #[serde(borrow, default)]
    lights: Vec<Raw<'a, LightEntry<'a>>>,
    #[serde(borrow, default)]
    environment: Option<Raw<'a, Sky<'a>>>,
    #[serde(borrow, default)]
    cameras: Entries<'a, CameraEntry<'a>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
enum Geometry<'a> {
    /// A geometry file, relative to the document or to a search folder.
    File(#[serde(borrow)] Raw<'a, String>),
    Generate(#[serde(borrow)] Raw<'a, Generator<'a>>),
    Box {
        #[serde(borrow)]
        min: Raw<'a, Triple>,
        #[serde(borrow)]
        max: Raw<'a, Triple>,
        #[serde(borrow, default)]
        material: Option<Raw<'a, String>>,
    },
    /// Four corners, counter-clockwise seen from the front.
    Quad {
        #[serde(borrow)]
        corners: [Raw<'a, Triple>; 4],
        #[serde(borrow, default)]
        material: Option<Raw<'a, String>>,
    },
    /// 20 · 4ⁿ triangles for n subdivisions; smooth where `normals` is `File`.
    Sphere {
        #[serde(borrow)]
        centre: Raw<'a, Triple>,
        #[serde(borrow)]
        radius: Raw<'a, f64>,
        #[serde(borrow, default)]
        subdivisions: Option<Raw<'a, u32>>,
        #[serde(borrow, default)]
        material: Option<Raw<'a, String>>,
    },
    /// An upright tube whose lower end has its middle at `centre`; smooth where `normals` is `File`.
    Tube {
        #[serde(borrow)]
        centre: Raw<'a, Triple>,
        #[serde(borrow)]
        radius: Raw<'a, f64>,
        #[serde(borrow)]
        thickness: Raw<'a, f64>,
        #[serde(borrow)]
        height: Raw<'a, f64>,
        #[serde(borrow, default)]
        sides: Option<Raw<'a, u32>>,
        #[serde(borrow, default)]
        material: Option<Raw<'a, String>>,
    },
    /// Newell's teapot, standing on `centre`, its spout towards +x; smooth where `normals` is `File`.
    Teapot {
        #[serde(borrow)]
        centre: Raw<'a, Triple>,
        #[serde(borrow, default)]
        scale: Option<Raw<'a, f64>>,
        #[serde(borrow, default)]
        detail: Option<Raw<'a, u32>>,
        #[serde(borrow, default)]
        material: Option<Raw<'a, String>>,
    },
    Triangles {
        #[serde(borrow)]
        positions: Raw<'a, Vec<Triple>>,
        #[serde(borrow)]
        indices: Raw<'a, Vec<[u32; 3]>>,
        #[serde(borrow, default)]
        material: Option<Raw<'a, String>>,
    },
    /// Other geometry, scaled, then turned, then moved.
    Place {
        #[serde(borrow)]
        of: Vec<Raw<'a, Geometry<'a>>>,
        #[serde(borrow, default)]
        scale: Option<Raw<'a, Triple>>,
        #[serde(borrow, default)]
        rotate: Option<Turn<'a>>,
        #[serde(borrow, default)]
        translate: Option<Raw<'a, Triple>>,
    },
}

#[derive(Deserialize)]
#[serde(rename = "Rotate", deny_unknown_fields)]
struct Turn<'a> {
    #[serde(borrow)]
    axis: Raw<'a, Triple>,
    #[serde(borrow)]
    degrees: Raw<'a, f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
enum Generator<'a> {
    Castle {
        #[serde(borrow, default)]
        triangles: Option<Raw<'a, u32>>,
    },
    Hall {
        #[serde(borrow, default)]
        triangles: Option<Raw<'a, u32>>,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
enum Surface<'a> {
    Diffuse {
        #[serde(borrow)]
        reflectance: Raw<'a, Triple>,
    },
    Emitter {
        #[serde(borrow)]
        radiance: Raw<'a, Triple>,
        #[serde(borrow, default)]
        reflectance: Option<Raw<'a, Triple>>,
    },
    /// Modified Phong: diffuse and specular reflectance, exponent.
    Phong {
        #[serde(borrow)]
        reflectance: Raw<'a, Triple>,
        #[serde(borrow)]
        specular: Raw<'a, Triple>,
        #[serde(borrow)]
        exponent: Raw<'a, f64>,
    },
    /// Anisotropic Ward: diffuse and specular reflectance, slopes along the two tangents.
    Ward {
        #[serde(borrow)]
        reflectance: Raw<'a, Triple>,
        #[serde(borrow)]
        specular: Raw<'a, Triple>,
        #[serde(borrow)]
        alpha: [Raw<'a, f64>; 2],
    },
    /// As glTF has it: base colour, metallic, roughness.
    MetallicRoughness {
        #[serde(borrow)]
        base: Raw<'a, Triple>,
        #[serde(borrow)]
        metallic: Raw<'a, f64>,
        #[serde(borrow)]
        roughness: Raw<'a, f64>,
    },
    /// What differs from a file's material; all else of it stays, textures included.
    Change {
        /// The factor of the texture, where there is one.
        #[serde(borrow, default)]
        reflectance: Option<Raw<'a, Triple>>,
        #[serde(borrow, default)]
        radiance: Option<Raw<'a, Triple>>,
        #[serde(borrow, default)]
        specular: Option<Raw<'a, Triple>>,
        #[serde(borrow, default)]
        exponent: Option<Raw<'a, f64>>,
        #[serde(borrow, default)]
        metallic: Option<Raw<'a, f64>>,
        #[serde(borrow, default)]
        roughness: Option<Raw<'a, f64>>,
        #[serde(borrow, default)]
        two_sided: Option<Raw<'a, bool>>,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
enum NormalsChoice<'a> {
    File,
    Face,
    Smooth {
        #[serde(borrow)]
        degrees: Raw<'a, f64>,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
enum LightEntry<'a> {
    Point {
        #[serde(borrow)]
        position: Raw<'a, Triple>,
        #[serde(borrow)]
        intensity: Raw<'a, Triple>,
        #[serde(default = "yes")]
        shadows: bool,
    },
    /// Half-angles in degrees.
    Spot {
        #[serde(borrow)]
        position: Raw<'a, Triple>,
        #[serde(borrow)]
        direction: Raw<'a, Triple>,
        #[serde(borrow)]
        intensity: Raw<'a, Triple>,
        #[serde(borrow, default)]
        inner: Option<Raw<'a, f64>>,
        #[serde(borrow)]
        outer: Raw<'a, f64>,
        #[serde(default = "yes")]
        shadows: bool,
    },
    Directional {
        #[serde(borrow)]
        direction: Raw<'a, Triple>,
        #[serde(borrow)]
        irradiance: Raw<'a, Triple>,
        #[serde(default = "yes")]
        shadows: bool,
    },
}

fn yes() -> bool {
    true
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
enum Sky<'a> {
    Constant(#[serde(borrow)] Raw<'a, Triple>),
    /// A sky without clouds, by where the sun stands and how hazy the air is.
    Clear {
        #[serde(borrow)]
        sun: Sun<'a>,
        #[serde(borrow, default)]
        turbidity: Option<Raw<'a, f64>>,
        /// Radiance for each kcd/m².
        #[serde(borrow, default)]
        scale: Option<Raw<'a, f64>>,
        /// Reflectance of what lies below the horizon.
        #[serde(borrow, default)]
        ground: Option<Raw<'a, Triple>>,
    },
    Overcast {
        /// Radiance from straight above.
        #[serde(borrow)]
        zenith: Raw<'a, Triple>,
        #[serde(borrow, default)]
        ground: Option<Raw<'a, Triple>>,
    },
    LatLong {
        #[serde(borrow)]
        file: Raw<'a, String>,
        #[serde(borrow, default)]
        scale: Option<Raw<'a, f64>>,
        /// Degrees from −z towards +x.
        #[serde(borrow, default)]
        rotation: Option<Raw<'a, f64>>,
    },
}

/// Degrees, the azimuth from −z towards +x.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sun<'a> {
    #[serde(borrow)]
    azimuth: Raw<'a, f64>,
    #[serde(borrow)]
    elevation: Raw<'a, f64>,
}

#[derive(Deserialize)]
#[serde(rename = "Camera", deny_unknown_fields)]
struct CameraEntry<'a> {
    #[serde(borrow)]
    eye: Raw<'a, Triple>,
    #[serde(borrow, default)]
    direction: Option<Raw<'a, Triple>>,
    #[serde(borrow, default)]
    target: Option<Raw<'a, Triple>>,
    #[serde(borrow, default)]
    up: Option<Raw<'a, Triple>>,
    /// Horizontal field of view in degrees.
    #[serde(borrow)]
    fov: Raw<'a, f64>,
    #[serde(borrow, default)]
    size: Option<Raw<'a, [u32; 2]>>,
}

/// What a scene document says about itself.
pub fn about(text: &str) -> Option<String> {
    let source = Source { text: SourceText { path: Path::new(""), text } };
    source.parse::<Document>(text).ok()?.about
}

/// Reads a document; `folder` is what its files are relative to, besides the search folders.
pub(super) fn read(path: &Path, text: &str, folder: Option<&Path>, files: &Files, options: &LoadOptions) -> Result<(Draft, Normals), SceneError> {
    let source = Source { text: SourceText { path, text } };
    let document: Document = source.parse(text)?;
    let version = source.get(document.version)?;
    if version != VERSION {
        return Err(source
            .error(Problem::Version, document.version, format!("scene documents of version {version} are not known"), "this program reads version 1")
            .help("write `version: 1`, or use a program as new as the document"));
    }
    let mut reader =
        Reader { source, folder, files, options, draft: Draft::default(), palette: Vec::new(), entries: HashMap::new(), parameters: BTreeSet::new() };
    reader.read_materials(&document.materials)?;
    for &geometry in &document.geometry {
        reader.add_geometry(geometry, &DMat4::IDENTITY)?;
    }
    reader.expect_all_used()?;
    for &light in &document.lights {
        reader.add_light(light)?;
    }
    for &(name, camera) in &document.cameras.0 {
        reader.add_camera(name, camera)?;
    }
    reader.draft.environment = document.environment.map(|sky| reader.read_sky(sky)).transpose()?;
    let normals = document.normals.map_or(Ok(Normals::File), |choice| source.normals(choice))?;
    Ok((reader.draft, normals))
}

/// The document's text, and how to read values out of it.
#[derive(Clone, Copy)]
struct Source<'a> {
    text: SourceText<'a>,
}

impl<'a> Source<'a> {
    fn parse<T: Deserialize<'a>>(&self, part: &'a str) -> Result<T, SceneError> {
        Options::default().with_default_extension(Extensions::IMPLICIT_SOME).from_str(part).map_err(|error| self.syntax_error(part, error))
    }

    fn get<T: Deserialize<'a>>(&self, raw: Raw<'a, T>) -> Result<T, SceneError> {
        self.parse(raw.text)
    }

    /// Where a slice of the text lies in it.
    fn span(&self, part: &str) -> Range<usize> {
        let start = (part.as_ptr() as usize).saturating_sub(self.text.text.as_ptr() as usize);
        start..start + part.len()
    }

    fn error<T>(&self, problem: Problem, place: Raw<'a, T>, message: impl Into<String>, label: impl Into<String>) -> SceneError {
        SceneError::new(problem, message).at(&self.text, self.span(place.text), label)
    }

    fn syntax_error(&self, part: &str, error: SpannedError) -> SceneError {
        let start = self.span(part).start;
        let (from, to) = (start + offset(part, error.span.start), start + offset(part, error.span.end));
        let place = trim_span(self.text.text, from..to.max(from));
        use ::ron::Error::*;
        let (problem, message, label, help) = match &error.code {
            NoSuchStructField { expected, found, outer } => {
                let of = outer.as_ref().map_or(String::new(), |outer| format!(" of `{outer}`"));
                (Problem::UnknownKey, format!("`{found}` is no key{of}"), "unknown key", suggestion(found, expected.iter().copied()))
            }
            NoSuchEnumVariant { expected, found, .. } => {
                (Problem::UnknownKey, format!("`{found}` is not known here"), "unknown", suggestion(found, expected.iter().copied()))
            }
            MissingStructField { field, outer } => {
                let of = outer.as_ref().map_or(String::new(), |outer| format!(" in `{outer}`"));
                (Problem::Format, format!("the key `{field}` is missing{of}"), "it has to stand before this", format!("add `{field}: …`"))
            }
            ExceededRecursionLimit => (Problem::Format, "the document is nested too deeply".to_owned(), "here", "place geometry in fewer steps".to_owned()),
            other => (Problem::Format, format!("the document cannot be read: {other}"), "here", "see the scenes that ship for examples".to_owned()),
        };
        SceneError::new(problem, message).help(help).at(&self.text, place, label)
    }

    /// A number that single precision holds.
    fn number(&self, raw: Raw<'a, f64>) -> Result<f64, SceneError> {
        let value = self.get(raw)?;
        self.expect_finite(raw, [value])?;
        Ok(value)
    }

    fn vector(&self, raw: Raw<'a, Triple>) -> Result<DVec3, SceneError> {
        let value = self.get(raw)?;
        self.expect_finite(raw, value)?;
        Ok(value.into())
    }

    fn expect_finite<T, const N: usize>(&self, raw: Raw<'a, T>, values: [f64; N]) -> Result<(), SceneError> {
        if values.iter().all(|&value| (value as f32).is_finite()) {
            return Ok(());
        }
        Err(self.error(Problem::NonFinite, raw, "a value is no finite number in single precision", "not finite").help("use numbers between -3.4e38 and 3.4e38"))
    }

    /// A number in a range; `range` says it in words.
    fn number_in(&self, raw: Raw<'a, f64>, range: &str, holds: impl Fn(f64) -> bool) -> Result<f64, SceneError> {
        let value = self.number(raw)?;
        if holds(value) { Ok(value) } else { Err(self.out_of_range(raw, range)) }
    }

    fn count_in(&self, raw: Raw<'a, u32>, range: RangeInclusive<u32>) -> Result<u32, SceneError> {
        let value = self.get(raw)?;
        if range.contains(&value) { Ok(value) } else { Err(self.out_of_range(raw, &format!("{} to {}", range.start(), range.end()))) }
    }

    fn out_of_range<T>(&self, raw: Raw<'a, T>, range: &str) -> SceneError {
        self.error(Problem::Range, raw, format!("{} is out of range", raw.text), format!("has to be {range}")).help(format!("the range is {range}"))
    }

    fn colour(&self, raw: Raw<'a, Triple>, most: f64, range: &str) -> Result<Rgb, SceneError> {
        let value = self.vector(raw)?;
        if value.to_array().iter().all(|channel| (0.0..=most).contains(channel)) { Ok(value.as_vec3()) } else { Err(self.out_of_range(raw, range)) }
    }

    fn reflectance(&self, raw: Raw<'a, Triple>) -> Result<Rgb, SceneError> {
        self.colour(raw, 1.0, "0 to 1 in each channel")
    }

    fn radiance(&self, raw: Raw<'a, Triple>) -> Result<Rgb, SceneError> {
        self.colour(raw, f64::from(f32::MAX), "0 or more in each channel")
    }

    /// A vector with a direction, as a unit vector.
    fn unit(&self, raw: Raw<'a, Triple>) -> Result<DVec3, SceneError> {
        self.vector(raw)?.try_normalize().ok_or_else(|| self.out_of_range(raw, "a vector with a length"))
    }

    fn normals(&self, raw: Raw<'a, NormalsChoice<'a>>) -> Result<Normals, SceneError> {
        Ok(match self.get(raw)? {
            NormalsChoice::File => Normals::File,
            NormalsChoice::Face => Normals::Face,
            NormalsChoice::Smooth { degrees } => Normals::Smooth(self.number_in(degrees, "0 to 180 degrees", |d| (0.0..=180.0).contains(&d))?.to_radians()),
        })
    }

    /// The whole material that an entry describes; None where it changes those of files.
    fn surface(&self, name: &str, raw: Raw<'a, Surface<'a>>) -> Result<Option<Material>, SceneError> {
        let diffuse = |reflectance| Ok::<_, SceneError>(Material::diffuse(name, self.reflectance(reflectance)?));
        Ok(Some(match self.get(raw)? {
            Surface::Diffuse { reflectance } => diffuse(reflectance)?,
            Surface::Emitter { radiance, reflectance } => {
                let reflectance = reflectance.map_or(Ok(Vec3::ZERO), |raw| self.reflectance(raw))?;
                Material { emission: self.radiance(radiance)?, ..Material::diffuse(name, reflectance) }
            }
            Surface::Phong { reflectance, specular, exponent } => {
                let exponent = self.number_in(exponent, "0 or more", |n| n >= 0.0)? as f32;
                let glossy = Glossy::Phong { reflectance: self.reflectance(specular)?, exponent };
                Material { glossy: Some(glossy), ..diffuse(reflectance)? }
            }
            Surface::Ward { reflectance, specular, alpha } => {
                let slope = |raw| Ok::<_, SceneError>(self.number_in(raw, "greater than 0 and at most 1", |a| a > 0.0 && a <= 1.0)? as f32);
                let alpha = Vec2::new(slope(alpha[0])?, slope(alpha[1])?);
                Material { glossy: Some(Glossy::Ward { reflectance: self.reflectance(specular)?, alpha }), ..diffuse(reflectance)? }
            }
            Surface::MetallicRoughness { base, metallic, roughness } => {
                let dielectric = Vec3::splat(DIELECTRIC);
                let glossy = Glossy::MetallicRoughness { metallic: self.share(metallic)?, roughness: self.share(roughness)?, dielectric };
                Material { glossy: Some(glossy), ..diffuse(base)? }
            }
            Surface::Change { .. } => return Ok(None),
        }))
    }

    fn share(&self, raw: Raw<'a, f64>) -> Result<f32, SceneError> {
        Ok(self.number_in(raw, "0 to 1", |n| (0.0..=1.0).contains(&n))? as f32)
    }

    /// A file's material with what a `Change` says.
    fn changed(&self, file: Material, raw: Raw<'a, Surface<'a>>) -> Result<Material, SceneError> {
        let Surface::Change { reflectance, radiance, specular, exponent, metallic, roughness, two_sided } = self.get(raw)? else { return Ok(file) };
        let metals = if metallic.is_some() || roughness.is_some() { Some([metallic, roughness]) } else { None };
        let phong = if specular.is_some() || exponent.is_some() { Some((specular, exponent)) } else { None };
        let glossy = match (metals, phong) {
            (None, None) => file.glossy,
            (Some(metals), None) => self.changed_metal(&file, metals, raw)?,
            (None, Some((specular, exponent))) => self.changed_phong(&file, specular, exponent, raw)?,
            (Some(_), Some(_)) => {
                return Err(self.other_model(&file.name, raw, "a material has either `metallic` and `roughness` or `specular` and `exponent`"));
            }
        };
        Ok(Material {
            reflectance: reflectance.map_or(Ok(file.reflectance), |raw| self.reflectance(raw))?,
            emission: radiance.map_or(Ok(file.emission), |raw| self.radiance(raw))?,
            two_sided: two_sided.map_or(Ok(file.two_sided), |raw| self.get(raw))?,
            glossy,
            ..file
        })
    }

    /// A surface without a lobe is no metal and as rough as can be.
    fn changed_metal(
        &self,
        file: &Material,
        [metallic, roughness]: [Option<Raw<'a, f64>>; 2],
        raw: Raw<'a, Surface<'a>>,
    ) -> Result<Option<Glossy>, SceneError> {
        let ([mut metal, mut rough], dielectric) = match file.glossy {
            None => ([0.0, 1.0], Vec3::splat(DIELECTRIC)),
            Some(Glossy::MetallicRoughness { metallic, roughness, dielectric }) => ([metallic, roughness], dielectric),
            Some(Glossy::Phong { .. } | Glossy::Ward { .. }) => {
                return Err(self.other_model(&file.name, raw, "the file's lobe has `specular`, not `metallic` and `roughness`"));
            }
        };
        for (value, raw) in [(&mut metal, metallic), (&mut rough, roughness)] {
            *value = raw.map_or(Ok(*value), |raw| self.share(raw))?;
        }
        let glossy = Glossy::MetallicRoughness { metallic: metal, roughness: rough, dielectric };
        Ok(Some(glossy).filter(|glossy| file.maps.facets.is_some() || !glossy.is_plain()))
    }

    fn changed_phong(
        &self,
        file: &Material,
        specular: Option<Raw<'a, Triple>>,
        exponent: Option<Raw<'a, f64>>,
        raw: Raw<'a, Surface<'a>>,
    ) -> Result<Option<Glossy>, SceneError> {
        let specular = specular.map(|raw| self.reflectance(raw)).transpose()?;
        let exponent = exponent.map(|raw| self.number_in(raw, "0 or more", |n| n >= 0.0)).transpose()?.map(|n| n as f32);
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

/// Byte offset of a line and column, both from 1, columns in characters.
fn offset(text: &str, position: ::ron::error::Position) -> usize {
    let line_start = text.split_inclusive('\n').take(position.line.saturating_sub(1)).map(str::len).sum::<usize>();
    let line = text.get(line_start..).unwrap_or_default();
    line_start + line.char_indices().nth(position.col.saturating_sub(1)).map_or(line.len(), |(at, _)| at)
}

/// A span without the blanks at its ends.
fn trim_span(text: &str, span: Range<usize>) -> Range<usize> {
    let Some(part) = text.get(span.clone()) else { return span };
    let start = span.start + part.len() - part.trim_start().len();
    start..(start + part.trim().len())
}

/// An entry of `materials`.
struct PaletteEntry<'a> {
    name: String,
    place: Raw<'a, String>,
    surface: Raw<'a, Surface<'a>>,
    /// None for one that changes materials of files.
    material: Option<u32>,
    used: bool,
}

struct Reader<'a> {
    source: Source<'a>,
    folder: Option<&'a Path>,
    files: &'a Files,
    options: &'a LoadOptions,
    draft: Draft,
    palette: Vec<PaletteEntry<'a>>,
    /// Where in the palette each name stands.
    entries: HashMap<String, usize>,
    /// The parameters of all generators met.
    parameters: BTreeSet<&'static str>,
}

impl<'a> Reader<'a> {
    fn read_materials(&mut self, entries: &Entries<'a, Surface<'a>>) -> Result<(), SceneError> {
        for &(place, surface) in &entries.0 {
            let name = self.source.get(place)?;
            if self.entries.insert(name.clone(), self.palette.len()).is_some() {
                return Err(self.twice(place, "material"));
            }
            let material = self.source.surface(&name, surface)?.map(|whole| self.add_material(whole));
            self.palette.push(PaletteEntry { name, place, surface, material, used: false });
        }
        Ok(())
    }

    fn twice(&self, place: Raw<'a, String>, what: &str) -> SceneError {
        self.source.error(Problem::Format, place, format!("the {what} {} is given twice", place.text), "the second one").help("give it another name")
    }

    fn add_material(&mut self, material: Material) -> u32 {
        self.draft.materials.push(material);
        self.draft.materials.len() as u32 - 1
    }

    /// The entry of a name, or that of all others.
    fn find_entry(&mut self, name: &str) -> Option<&PaletteEntry<'a>> {
        let entry = &mut self.palette[*self.entries.get(name).or_else(|| self.entries.get(ANY))?];
        entry.used = true;
        Some(entry)
    }

    /// The whole material of a name.
    fn find_material(&mut self, name: &str) -> Option<u32> {
        self.find_entry(name)?.material
    }

    /// What stands for a file's material: the entry's, the file's own with its changes, or the file's own.
    fn material_of_file(&mut self, material: Material) -> Result<u32, SceneError> {
        let material = match self.find_entry(&material.name) {
            Some(PaletteEntry { material: Some(whole), .. }) => return Ok(*whole),
            Some(&PaletteEntry { surface, .. }) => self.source.changed(material, surface)?,
            None => material,
        };
        Ok(self.add_material(material))
    }

    /// The material that a primitive names; without a name, the one for all that are not named.
    fn primitive_material<T>(&mut self, raw: Option<Raw<'a, String>>, primitive: Raw<'a, T>) -> Result<u32, SceneError> {
        let name = raw.map_or(Ok(ANY.to_owned()), |raw| self.source.get(raw))?;
        let known = self.entries.contains_key(&name);
        if let (true, Some(material)) = (known, self.find_material(&name)) {
            return Ok(material);
        }
        let help = suggestion(&name, self.palette.iter().map(|entry| entry.name.as_str()));
        if known {
            let message = format!("the entry `{name}` changes materials of files: a shape of the document needs a whole one");
            let place = raw.map_or(primitive.text, |raw| raw.text);
            let error = SceneError::new(Problem::UnknownMaterial, message).at(&self.source.text, self.source.span(place), "has no file");
            return Err(error.help("give the shape a material of its own, such as Diffuse(reflectance: (0.7, 0.7, 0.7))"));
        }
        Err(match raw {
            Some(raw) => self.source.error(Problem::UnknownMaterial, raw, format!("there is no material `{name}`"), "not among `materials`").help(help),
            None => self
                .source
                .error(Problem::UnknownMaterial, primitive, "this shape names no material, and there is none for all", "needs a `material`")
                .help("add `material: …` here, or an entry `\"*\"` to `materials`"),
        })
    }

    /// Refuses names in `materials` that nothing in the scene has: most likely they are misspelt.
    fn expect_all_used(&self) -> Result<(), SceneError> {
        refuse_overrides(self.options, &self.parameters.iter().copied().collect::<Vec<_>>())?;
        let Some(unused) = self.palette.iter().find(|entry| !entry.used && entry.name != ANY) else { return Ok(()) };
        let names = self.draft.materials.iter().map(|material| material.name.as_str()).filter(|&name| name != unused.name && name != ANY);
        Err(self
            .source
            .error(Problem::UnknownMaterial, unused.place, format!("nothing in the scene has the material `{}`", unused.name), "not used")
            .help(suggestion(&unused.name, names)))
    }

    fn add_geometry(&mut self, raw: Raw<'a, Geometry<'a>>, map: &DMat4) -> Result<(), SceneError> {
        match self.source.get(raw)? {
            Geometry::File(path) => self.add_file(path, map),
            Geometry::Generate(generator) => self.add_generated(generator, map),
            Geometry::Box { min, max, material } => {
                let (low, high) = (self.source.vector(min)?, self.source.vector(max)?);
                if !low.cmplt(high).all() {
                    return Err(self.source.out_of_range(max, "greater than `min` in each coordinate"));
                }
                let material = self.primitive_material(material, raw)?;
                self.add_faces(&primitives::cuboid(low, high, material), map, "a box")
            }
            Geometry::Quad { corners: [a, b, c, d], material } => {
                let corner = |raw| self.source.vector(raw);
                let corners = [corner(a)?, corner(b)?, corner(c)?, corner(d)?];
                let material = self.primitive_material(material, raw)?;
                self.add_faces(&primitives::quad(corners, material), map, "a quad")
            }
            Geometry::Sphere { centre, radius, subdivisions, material } => {
                let (centre, radius) = (self.source.vector(centre)?, self.source.number_in(radius, "greater than 0", |r| r > 0.0)?);
                let level = subdivisions.map_or(Ok(3), |raw| self.source.count_in(raw, 0..=primitives::MAX_SUBDIVISIONS))?;
                self.draft.expect_room(20 << (2 * level))?;
                let material = self.primitive_material(material, raw)?;
                self.add_faces(&primitives::sphere(centre, radius, level, material), map, "a sphere")
            }
            Geometry::Tube { centre, radius, thickness, height, sides, material } => {
                let above = |raw| self.source.number_in(raw, "greater than 0", |number| number > 0.0);
                let (centre, radius, height) = (self.source.vector(centre)?, above(radius)?, above(height)?);
                let thickness = self.source.number_in(thickness, "greater than 0, and less than `radius`", |number| number > 0.0 && number < radius)?;
                let sides = sides.map_or(Ok(primitives::SIDES), |raw| self.source.count_in(raw, primitives::SIDES_IN))?;
                self.draft.expect_room(8 * sides as usize)?;
                let material = self.primitive_material(material, raw)?;
                self.add_faces(&primitives::tube(primitives::Tube { centre, radius, thickness, height, sides }, material), map, "a tube")
            }
            Geometry::Teapot { centre, scale, detail, material } => {
                let centre = self.source.vector(centre)?;
                let scale = scale.map_or(Ok(1.0), |raw| self.source.number_in(raw, "greater than 0", |s| s > 0.0))?;
                let detail = detail.map_or(Ok(teapot::DETAIL), |raw| self.source.count_in(raw, teapot::DETAILS))?;
                self.draft.expect_room(teapot::triangles(detail))?;
                let material = self.primitive_material(material, raw)?;
                self.add_faces(&teapot::teapot(centre, scale, detail, material), map, "a teapot")
            }
            Geometry::Triangles { positions, indices, material } => self.add_triangles(raw, positions, indices, material, map),
            Geometry::Place { of, scale, rotate, translate } => {
                let map = *map * self.placement(scale, rotate, translate)?;
                of.into_iter().try_for_each(|inner| self.add_geometry(inner, &map))
            }
        }
    }

    fn placement(&self, scale: Option<Raw<'a, Triple>>, rotate: Option<Turn<'a>>, translate: Option<Raw<'a, Triple>>) -> Result<DMat4, SceneError> {
        let factor = scale.map_or(Ok(DVec3::ONE), |raw| self.source.vector(raw))?;
        if let (true, Some(raw)) = (factor.cmpeq(DVec3::ZERO).any(), scale) {
            return Err(self.source.out_of_range(raw, "different from 0 in each coordinate"));
        }
        let rotation = match rotate {
            Some(turn) => DQuat::from_axis_angle(self.source.unit(turn.axis)?, self.source.number(turn.degrees)?.to_radians()),
            None => DQuat::IDENTITY,
        };
        let translation = translate.map_or(Ok(DVec3::ZERO), |raw| self.source.vector(raw))?;
        Ok(DMat4::from_scale_rotation_translation(factor, rotation, translation))
    }

    fn add_faces(&mut self, faces: &[Face], map: &DMat4, name: &str) -> Result<(), SceneError> {
        let normal_map = normal_map(map);
        faces.iter().try_for_each(|face| self.draft.push(face.transformed(map, &normal_map), || name.to_owned()))
    }

    fn add_triangles<T>(
        &mut self,
        raw: Raw<'a, T>,
        positions: Raw<'a, Vec<Triple>>,
        indices: Raw<'a, Vec<[u32; 3]>>,
        material: Option<Raw<'a, String>>,
        map: &DMat4,
    ) -> Result<(), SceneError> {
        let points = self.source.get(positions)?;
        let material = self.primitive_material(material, raw)?;
        let point = |index: u32| points.get(index as usize).map(|&p| DVec3::from(p));
        let face = |[a, b, c]: [u32; 3]| Some(Face::flat([point(a)?, point(b)?, point(c)?], material));
        let faces: Option<Vec<Face>> = self.source.get(indices)?.into_iter().map(face).collect();
        let faces = faces.ok_or_else(|| {
            let message = format!("an index points past the {} positions", points.len());
            self.source.error(Problem::Range, indices, message, "out of range").help("indices count from 0")
        })?;
        self.add_faces(&faces, map, "a mesh of the document")
    }

    fn add_generated(&mut self, raw: Raw<'a, Generator<'a>>, map: &DMat4) -> Result<(), SceneError> {
        match self.source.get(raw)? {
            Generator::Castle { triangles } => {
                let count = self.generated_triangles(raw, "castle", triangles, 58_000, generate::MIN_CASTLE)?;
                let materials = self.generated_materials(raw, "castle", generate::CASTLE_MATERIALS)?;
                self.add_faces(&generate::castle(count, materials), map, "the castle")
            }
            Generator::Hall { triangles } => {
                let count = self.generated_triangles(raw, "hall", triangles, 10_000, generate::MIN_HALL)?;
                let materials = self.generated_materials(raw, "hall", generate::HALL_MATERIALS)?;
                self.add_faces(&generate::hall(count, materials), map, "the hall")
            }
        }
    }

    /// How many triangles a generator is to make; room for them is sure.
    fn generated_triangles<T>(&mut self, raw: Raw<'a, T>, name: &str, stated: Option<Raw<'a, u32>>, usual: u32, least: usize) -> Result<usize, SceneError> {
        let stated = stated.map_or(Ok(usual), |raw| self.source.get(raw))?;
        let count = self.overridden("triangles", stated)? as usize;
        let limits = least..=super::MAX_TRIANGLES / 16 * 15;
        if !limits.contains(&count) {
            let range = format!("{} to {}", limits.start(), limits.end());
            let message = format!("a {name} of {count} triangles is out of range");
            return Err(self.source.error(Problem::Range, raw, message, "made here").help(format!("the range of `triangles` is {range}")));
        }
        self.draft.expect_room(count)?;
        Ok(count)
    }

    fn generated_materials<T, const N: usize>(&mut self, raw: Raw<'a, T>, name: &str, names: [&str; N]) -> Result<[u32; N], SceneError> {
        let found: Option<Vec<u32>> = names.iter().map(|name| self.find_material(name)).collect();
        found.and_then(|numbers| numbers.try_into().ok()).ok_or_else(|| {
            let message = format!("the {name} has surfaces without a material");
            let help = format!("add {} or `\"*\"` to `materials`", names.join(", "));
            self.source.error(Problem::UnknownMaterial, raw, message, "made here").help(help)
        })
    }

    /// A generator's parameter: the stated value, unless the options set another.
    fn overridden(&mut self, key: &'static str, stated: u32) -> Result<u32, SceneError> {
        self.parameters.insert(key);
        let Some((_, value)) = self.options.overrides.iter().rev().find(|(name, _)| name == key) else { return Ok(stated) };
        value.trim().parse().map_err(|_| {
            SceneError::new(Problem::Range, format!("`{key}` cannot be set to `{value}`")).help(format!("`{key}` is a whole number, such as {stated}"))
        })
    }

    fn add_file(&mut self, raw: Raw<'a, String>, map: &DMat4) -> Result<(), SceneError> {
        let path = self.find_file(raw)?;
        // Of materials that the document replaces, textures are not even looked for.
        let replaced: BTreeMap<String, bool> = self.palette.iter().map(|entry| (entry.name.clone(), entry.material.is_some())).collect();
        let wanted = |name: &str| !replaced.get(name).or(replaced.get(ANY)).copied().unwrap_or(false);
        let mut file = Draft::default();
        load_geometry(&path, self.files, &mut file, &wanted)?;
        self.absorb(file, map)
    }

    /// Takes over a file's triangles, and those of its materials that the document does not replace.
    fn absorb(&mut self, file: Draft, map: &DMat4) -> Result<(), SceneError> {
        let first_texture = self.draft.textures.len() as u32;
        let renumbered = |mut material: Material| {
            material.textures_mut().into_iter().flatten().for_each(|texture| *texture += first_texture);
            material
        };
        let numbers: Vec<u32> = file.materials.into_iter().map(|material| self.material_of_file(renumbered(material))).collect::<Result<_, _>>()?;
        self.draft.textures.extend(file.textures);
        self.draft.notes.extend(file.notes);
        if !file.lights.is_empty() || !file.cameras.is_empty() {
            let (lights, cameras) = (file.lights.len(), file.cameras.len());
            self.draft.notes.push(format!("not taken from a file of a document: {lights} lights and {cameras} cameras; the document has its own"));
        }
        let normal_map = normal_map(map);
        self.draft.expect_room(file.faces.len())?;
        self.draft.faces.reserve(file.faces.len());
        let first_face = self.draft.faces.len();
        for (number, chart) in file.charts.into_iter().enumerate() {
            for (face, [a, b, c]) in chart.into_iter().enumerate() {
                self.draft.place_on_chart(number, first_face + face, if mirrors(map) { [a, c, b] } else { [a, b, c] });
            }
        }
        for (face, tangents) in file.tangents.into_iter().enumerate() {
            self.draft.place_tangents(first_face + face, tangents, map);
        }
        file.faces.into_iter().try_for_each(|face| {
            let face = Face { material: numbers[face.material as usize], ..face.transformed(map, &normal_map) };
            self.draft.push(face, || "a file, moved to its place,".to_owned())
        })
    }

    /// Looks for a file beside the document, then in the search folders.
    fn find_file(&self, raw: Raw<'a, String>) -> Result<PathBuf, SceneError> {
        let path = self.source.get(raw)?;
        let folders: Vec<&Path> = self.folder.into_iter().chain(self.options.search.iter().map(PathBuf::as_path)).collect();
        if let Some(found) = folders.iter().map(|folder| folder.join(&path)).find(|candidate| candidate.is_file()) {
            return Ok(found);
        }
        let tried: Vec<String> =
            folders.iter().map(|folder| if folder.as_os_str().is_empty() { ".".to_owned() } else { folder.display().to_string() }).collect();
        let label = if tried.is_empty() { "no folder to look in".to_owned() } else { format!("looked in {}", list(&tried)) };
        Err(self
            .source
            .error(Problem::NotFound, raw, format!("there is no file `{path}`"), label)
            .help("name the folder that holds it with --scenes DIR, or in the variable HEMISPLAT_SCENES"))
    }

    fn add_light(&mut self, raw: Raw<'a, LightEntry<'a>>) -> Result<(), SceneError> {
        let source = self.source;
        let (kind, shadows, at) = match source.get(raw)? {
            LightEntry::Point { position, intensity, shadows } => {
                (LightKind::Point { position: Vec3::ZERO, intensity: source.radiance(intensity)? }, shadows, source.vector(position)?)
            }
            LightEntry::Spot { position, direction, intensity, inner, outer, shadows } => {
                let outer_angle = source.number_in(outer, "greater than 0 and at most 90 degrees", |d| d > 0.0 && d <= 90.0)?;
                let inner_angle = inner.map_or(Ok(0.0), |raw| source.number_in(raw, "0 or more and less than `outer`", |d| (0.0..outer_angle).contains(&d)))?;
                let kind = LightKind::Spot {
                    position: Vec3::ZERO,
                    direction: source.unit(direction)?.as_vec3(),
                    intensity: source.radiance(intensity)?,
                    inner: inner_angle.to_radians() as f32,
                    outer: outer_angle.to_radians() as f32,
                };
                (kind, shadows, source.vector(position)?)
            }
            LightEntry::Directional { direction, irradiance, shadows } => {
                let kind = LightKind::Directional { direction: source.unit(direction)?.as_vec3(), irradiance: source.radiance(irradiance)? };
                (kind, shadows, DVec3::ZERO)
            }
        };
        let name = format!("light {}", self.draft.lights.len() + 1);
        self.draft.lights.push((Light { name, kind, shadows }, at));
        Ok(())
    }

    fn add_camera(&mut self, place: Raw<'a, String>, raw: Raw<'a, CameraEntry<'a>>) -> Result<(), SceneError> {
        let source = self.source;
        let name = source.get(place)?;
        if self.draft.has_camera(&name) {
            return Err(self.twice(place, "camera"));
        }
        let entry = source.get(raw)?;
        let eye = source.vector(entry.eye)?;
        let direction = match (entry.direction, entry.target) {
            (Some(direction), None) => source.unit(direction)?,
            (None, Some(target)) => (source.vector(target)? - eye).try_normalize().ok_or_else(|| source.out_of_range(target, "away from the eye"))?,
            _ => {
                let message = format!("camera `{name}` needs either a `direction` or a `target`");
                return Err(source.error(Problem::Format, raw, message, "one of the two").help("say where it looks, once"));
            }
        };
        let up = entry.up.map_or(Ok(DVec3::Y), |raw| source.unit(raw))?;
        let upright = up.reject_from_normalized(direction);
        if upright.length() < 1e-6 {
            let message = format!("camera `{name}` looks along its own `up`");
            return Err(source.error(Problem::Range, raw, message, "no way up").help("give it an `up` that is not parallel to its direction"));
        }
        let angle = source.number_in(entry.fov, "greater than 0 and less than 180 degrees", |d| d > 0.0 && d < 180.0)?;
        let size = entry.size.map(|raw| source.picture_size(raw)).transpose()?;
        let camera = Camera {
            name,
            eye: Vec3::ZERO,
            direction: direction.as_vec3(),
            up: upright.normalize().as_vec3(),
            field_of_view: FieldOfView::Horizontal(angle.to_radians() as f32),
            size,
            sample: Default::default(),
        };
        self.draft.add_camera(camera, eye);
        Ok(())
    }

    fn read_sky(&self, raw: Raw<'a, Sky<'a>>) -> Result<Environment, SceneError> {
        Ok(match self.source.get(raw)? {
            Sky::Constant(radiance) => Environment::Constant(self.source.radiance(radiance)?),
            Sky::Clear { sun, turbidity, scale, ground } => {
                let scale = scale.map_or(Ok(sky::PER_KCD), |raw| self.source.number_in(raw, "0 to 1e30", |s| (0.0..=1e30).contains(&s)))?;
                let clear = self.source.clear_sky(&sun, turbidity)?;
                sky::bake(self.source.ground(ground)?, |direction| scale * clear.radiance(direction))
            }
            Sky::Overcast { zenith, ground } => {
                let zenith = self.source.radiance(zenith)?.as_dvec3();
                sky::bake(self.source.ground(ground)?, |direction| sky::overcast(zenith, direction))
            }
            Sky::LatLong { file, scale, rotation } => {
                let scale = scale.map_or(Ok(1.0), |raw| self.source.number_in(raw, "0 or more", |s| s >= 0.0))?;
                let rotation = rotation.map_or(Ok(0.0), |raw| self.source.number(raw))?;
                image::load_sky(&self.find_file(file)?, self.files, scale as f32, rotation.to_radians())?
            }
        })
    }
}

impl<'a> Source<'a> {
    fn clear_sky(&self, sun: &Sun<'a>, turbidity: Option<Raw<'a, f64>>) -> Result<Clear, SceneError> {
        let azimuth = self.number(sun.azimuth)?.to_radians();
        let elevation = self.number_in(sun.elevation, "0 to 90 degrees", |d| (0.0..=90.0).contains(&d))?.to_radians();
        let (least, most) = (sky::TURBIDITY.start(), sky::TURBIDITY.end());
        let holds = |t: f64| sky::TURBIDITY.contains(&t);
        let turbidity = turbidity.map_or(Ok(sky::USUAL_TURBIDITY), |raw| self.number_in(raw, &format!("{least} to {most}"), holds))?;
        Ok(Clear::new(azimuth, elevation, turbidity))
    }

    fn ground(&self, raw: Option<Raw<'a, Triple>>) -> Result<DVec3, SceneError> {
        raw.map_or(Ok(sky::GROUND), |raw| Ok(self.reflectance(raw)?.as_dvec3()))
    }

    fn picture_size(&self, raw: Raw<'a, [u32; 2]>) -> Result<[u32; 2], SceneError> {
        let size = self.get(raw)?;
        let holds = size.iter().all(|side| (1..=MAX_SIDE).contains(side));
        if holds { Ok(size) } else { Err(self.out_of_range(raw, &format!("1 to {MAX_SIDE} pixels a side"))) }
    }
}
