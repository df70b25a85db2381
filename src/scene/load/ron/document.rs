//! The grammar of scene documents. Values stay slices of the text until they are asked for.

use ::ron::value::RawValue;
use serde::{
    Deserialize, Deserializer,
    de::{MapAccess, Visitor},
};
use std::{fmt, marker::PhantomData};

/// A value as it stands in the source, parsed when it is asked for.
pub struct Raw<'a, T> {
    pub text: &'a str,
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
pub struct Entries<'a, T>(pub Vec<(Raw<'a, String>, Raw<'a, T>)>);

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

pub type Triple = [f64; 3];

/// Values at times in seconds, in the place of a value.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(bound(deserialize = "'de: 'a"))]
pub enum Keys<'a, T> {
    /// Each holds until the next.
    Step(#[serde(borrow)] Vec<(Raw<'a, f64>, Raw<'a, T>)>),
    /// In even steps from one to the next.
    Linear(#[serde(borrow)] Vec<(Raw<'a, f64>, Raw<'a, T>)>),
    /// Slower toward its turning points.
    Smooth(#[serde(borrow)] Vec<(Raw<'a, f64>, Raw<'a, T>)>),
}

/// The whole document.
#[derive(Deserialize)]
#[serde(rename = "Scene", deny_unknown_fields)]
pub struct Document<'a> {
    #[serde(borrow)]
    pub version: Raw<'a, u32>,
    /// What the scene is for; for readers of the file and of the list of scenes.
    #[serde(default)]
    pub about: Option<String>,
    /// Who made it, and its licence; for readers of the file.
    #[serde(default, rename = "source")]
    _source: Option<String>,
    #[serde(borrow)]
    pub geometry: Vec<Raw<'a, Geometry<'a>>>,
    #[serde(borrow, default)]
    pub materials: Entries<'a, Surface<'a>>,
    #[serde(borrow, default)]
    pub normals: Option<Raw<'a, NormalsChoice<'a>>>,
    #[serde(borrow, default)]
    pub lights: Vec<Raw<'a, LightEntry<'a>>>,
    #[serde(borrow, default)]
    pub environment: Option<Raw<'a, Sky<'a>>>,
    #[serde(borrow, default)]
    pub cameras: Entries<'a, CameraEntry<'a>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Geometry<'a> {
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
    /// Other geometry, scaled, then turned, then moved. By its name a program can move it.
    Place {
        #[serde(borrow, default)]
        name: Option<Raw<'a, String>>,
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
pub struct Turn<'a> {
    #[serde(borrow)]
    pub axis: Raw<'a, Triple>,
    #[serde(borrow)]
    pub degrees: Raw<'a, f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Generator<'a> {
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
pub enum Surface<'a> {
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
pub enum NormalsChoice<'a> {
    File,
    Face,
    Smooth {
        #[serde(borrow)]
        degrees: Raw<'a, f64>,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub enum LightEntry<'a> {
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
pub enum Sky<'a> {
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
pub struct Sun<'a> {
    #[serde(borrow)]
    pub azimuth: Raw<'a, f64>,
    #[serde(borrow)]
    pub elevation: Raw<'a, f64>,
}

#[derive(Deserialize)]
#[serde(rename = "Camera", deny_unknown_fields)]
pub struct CameraEntry<'a> {
    #[serde(borrow)]
    pub eye: Raw<'a, Triple>,
    #[serde(borrow, default)]
    pub direction: Option<Raw<'a, Triple>>,
    #[serde(borrow, default)]
    pub target: Option<Raw<'a, Triple>>,
    #[serde(borrow, default)]
    pub up: Option<Raw<'a, Triple>>,
    /// Horizontal field of view in degrees.
    #[serde(borrow)]
    pub fov: Raw<'a, f64>,
    #[serde(borrow, default)]
    pub size: Option<Raw<'a, [u32; 2]>>,
}
