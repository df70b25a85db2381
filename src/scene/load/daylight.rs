//! Light from outside of a scene's file: a sky in place of its own, and the sun.

use super::{error::SceneError, file_system::FileSystem, files::Files, image, sky};
use crate::math::colour::luminance;
use crate::scene::model::{Environment, Light, LightKind, Scene};
use glam::{DVec3, Vec3};
use std::path::PathBuf;

/// A sky that takes the place of the scene's own.
#[derive(Debug, Clone, PartialEq)]
pub enum Sky {
    /// A latitude-longitude image, `.exr` or `.hdr`.
    File(PathBuf),
    /// After Preetham, Shirley and Smits 1999, with the sun.
    Clear,
    /// The CIE standard overcast sky, white, of radiance 1 at the zenith [W m⁻² sr⁻¹].
    Overcast,
    /// Radiance 1 from everywhere [W m⁻² sr⁻¹].
    White,
    /// Black.
    None,
}

/// Where the sun stands [degrees].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sun {
    /// From −z towards +x.
    pub azimuth: f64,
    /// Over the horizon, 0 to 90.
    pub elevation: f64,
}

impl Default for Sun {
    /// Behind the left shoulder of the camera that a scene without one gets.
    fn default() -> Self {
        Self { azimuth: 110.0, elevation: 50.0 }
    }
}

/// What lights a scene besides its own lights.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Daylight {
    /// None leaves the scene's own sky.
    pub sky: Option<Sky>,
    /// None leaves the scene's own lights.
    pub sun: Option<Sun>,
}

impl Daylight {
    /// What lights a scene that has no light at all.
    pub const OF_DARK_SCENES: Self = Self { sky: Some(Sky::Overcast), sun: None };

    /// Lights a scene; an image of the sky is one of these files. A sun stands in a clear sky where the scene has none.
    ///
    /// # Errors
    /// An image of the sky that cannot be read.
    pub fn light(&self, scene: &mut Scene, files: &dyn FileSystem) -> Result<(), SceneError> {
        let around_sun = self.sun.filter(|_| scene.environment.is_black()).map(|_| Sky::Clear);
        let sky = self.sky.clone().or(around_sun);
        let sun = self.sun.or((sky == Some(Sky::Clear)).then(Sun::default));
        if let Some(sky) = &sky {
            scene.environment = environment(sky, sun.unwrap_or_default(), files)?;
        }
        scene.lights.extend(sun.map(sunlight));
        Ok(())
    }
}

fn environment(sky: &Sky, sun: Sun, files: &dyn FileSystem) -> Result<Environment, SceneError> {
    Ok(match sky {
        Sky::File(path) => image::load_sky(path, &Files::of(files), 1.0, 0.0)?,
        Sky::Clear => {
            let clear = sky::Clear::new(sun.azimuth.to_radians(), sun.elevation.to_radians(), sky::USUAL_TURBIDITY);
            let of_sun = sun_irradiance(sun) * sun.elevation.to_radians().sin();
            sky::bake_with_sun(sky::GROUND, of_sun, |direction| sky::PER_KCD * clear.radiance(direction))
        }
        Sky::Overcast => sky::bake(sky::GROUND, |direction| sky::overcast(DVec3::ONE, direction)),
        Sky::White => Environment::Constant(Vec3::ONE),
        Sky::None => Environment::Constant(Vec3::ZERO),
    })
}

/// Of a surface that faces the sun [W/m²].
fn sun_irradiance(sun: Sun) -> DVec3 {
    sky::PER_KCD * sky::sun(sun.elevation.to_radians(), sky::USUAL_TURBIDITY)
}

fn sunlight(sun: Sun) -> Light {
    let (azimuth, elevation) = (sun.azimuth.to_radians(), sun.elevation.to_radians());
    let irradiance = sun_irradiance(sun).as_vec3();
    Light { name: "sun".to_owned(), kind: LightKind::Directional { direction: -sky::toward_sun(azimuth, elevation).as_vec3(), irradiance }, shadows: true }
}

/// Radiance of white surfaces, had each its share of all light, below which a scene is dim [W m⁻² sr⁻¹].
const DIM: f64 = 0.05;

impl Scene {
    /// Whether nothing in the scene shines: no surface, no light, no sky.
    pub fn is_dark(&self) -> bool {
        self.has_lamps_alone() && self.materials.iter().all(|material| !material.emits())
    }

    /// Whether nothing shines but surfaces, and these so little that the rest of the scene will hardly be seen beside them.
    pub fn is_dim(&self) -> bool {
        if !self.has_lamps_alone() {
            return false;
        }
        let area = |triangle: u32| 0.5 * f64::from(self.triangles[triangle as usize].cross().length());
        let emitted: f64 = self.emitters().into_iter().map(|lamp| area(lamp) * luminance(self.mean_emission(lamp).as_dvec3())).sum();
        emitted < DIM * (0..self.triangles.len() as u32).map(area).sum::<f64>()
    }

    /// Whether neither a light nor the sky shines, ever.
    fn has_lamps_alone(&self) -> bool {
        let black = match &self.environment {
            Environment::Constant(radiance) => *radiance == Vec3::ZERO,
            Environment::LatLong { texels, .. } => texels.iter().all(|texel| *texel == Vec3::ZERO),
        };
        black && !self.animation.shines() && self.lights.iter().all(|light| light.kind.intensity() == Vec3::ZERO)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Memory, load_text};
    use super::*;

    fn room(more: &str) -> Scene {
        let text = format!(
            "Scene(version: 1, geometry: [Quad(corners: ((0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0)), material: \"a\")], \
             materials: {{\"a\": Diffuse(reflectance: (0.5, 0.5, 0.5))}}, {more})"
        );
        load_text("room.ron", &text).unwrap()
    }

    fn lit(daylight: Daylight, more: &str) -> Scene {
        let mut scene = room(more);
        daylight.light(&mut scene, &Memory::default()).unwrap();
        scene
    }

    #[test]
    fn a_scene_is_dark_without_any_light() {
        assert!(room("").is_dark());
        assert!(room("lights: [Point(position: (0, 1, 0), intensity: (0, 0, 0))]").is_dark());
        assert!(!room("lights: [Point(position: (0, 1, 0), intensity: (1, 1, 1))]").is_dark());
        assert!(!room("environment: Constant((0, 0, 0.1))").is_dark());
        assert!(!lit(Daylight::OF_DARK_SCENES, "").is_dark());
    }

    /// A lamp as large as a quarter of all surfaces: the radiance that all would have is a quarter of its own.
    #[test]
    fn a_scene_is_dim_where_little_but_its_surfaces_shines() {
        let with_lamp = |radiance: f32, more: &str| {
            let lamp = "geometry: [Quad(corners: ((0, 1, 0), (0, 1, 1), (3, 1, 1), (3, 1, 0)), material: \"a\"), Quad(corners: ((0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0)), material: \"b\")]";
            let materials = format!("materials: {{\"a\": Diffuse(reflectance: (0, 0, 0)), \"b\": Emitter(radiance: ({radiance}, {radiance}, {radiance}))}}");
            load_text("room.ron", &format!("Scene(version: 1, {lamp}, {materials}, {more})")).unwrap()
        };
        assert!(with_lamp(0.19, "").is_dim() && !with_lamp(0.21, "").is_dim());
        assert!(!with_lamp(0.19, "environment: Constant((0, 0, 0.1))").is_dim());
        assert!(!with_lamp(0.19, "lights: [Point(position: (0, 1, 0), intensity: (1, 1, 1))]").is_dim());
    }

    #[test]
    fn a_sun_stands_in_a_clear_sky_unless_the_scene_has_one() {
        let sun = Some(Sun { azimuth: 90.0, elevation: 30.0 });
        let scene = lit(Daylight { sky: None, sun }, "");
        assert!(matches!(scene.environment, Environment::LatLong { .. }));
        // From the side of +x, falling.
        let LightKind::Directional { direction, irradiance } = scene.lights[0].kind else { panic!("{:?}", scene.lights) };
        assert!(direction.abs_diff_eq(Vec3::new(-0.75_f32.sqrt(), -0.5, 0.0), 1e-6), "{direction}");
        assert!(irradiance.x > irradiance.y && irradiance.y > irradiance.z, "{irradiance}: low suns are reddish");
        let own = lit(Daylight { sky: None, sun }, "environment: Constant((1, 2, 3))");
        assert_eq!((own.environment, own.lights.len()), (Environment::Constant(Vec3::new(1.0, 2.0, 3.0)), 1));
    }

    #[test]
    fn a_sky_takes_the_place_of_the_scenes_own() {
        let of = |sky| lit(Daylight { sky: Some(sky), sun: None }, "environment: Constant((1, 2, 3))");
        assert_eq!(of(Sky::White).environment, Environment::Constant(Vec3::ONE));
        assert_eq!(of(Sky::None).environment, Environment::Constant(Vec3::ZERO));
        assert_eq!((of(Sky::Overcast).lights.len(), of(Sky::Clear).lights.len()), (0, 1));
    }
}
