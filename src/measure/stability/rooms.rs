//! Scenes of the extremes, as documents: what a user could write, read by the loader that reads them.

use super::Trouble;
use crate::scene::{load::load_text, needs::Needs, stage::Stage};
use glam::DVec3;
use std::sync::Arc;

/// A scene at some scale, place and brightness.
#[derive(Clone)]
pub(super) struct Room {
    /// Geometry, an entry of a document each.
    geometry: Vec<String>,
    materials: Vec<(&'static str, Surface)>,
    lamp: Option<Lamp>,
    /// Radiance from everywhere beyond the surfaces.
    sky: f64,
    camera: View,
    scale: f64,
    offset: DVec3,
    brightness: f64,
}

#[derive(Clone, Copy)]
enum Surface {
    Reflects(f64),
    /// Radiance of red, green and blue.
    Emits([f64; 3]),
    /// As a document has it.
    Written(&'static str),
}

/// A point light.
#[derive(Clone, Copy)]
struct Lamp {
    position: DVec3,
    intensity: f64,
}

/// Where the camera stands, what it looks at, and its horizontal field of view [degrees].
#[derive(Clone, Copy)]
pub(super) struct View {
    pub eye: DVec3,
    pub target: DVec3,
    pub field_of_view: f64,
}

/// A scene that is ready to be planned and rendered.
pub(super) struct Built {
    pub stage: Arc<Stage>,
    pub needs: Needs,
}

impl Room {
    fn new(geometry: &[&str], materials: &[(&'static str, Surface)], camera: View) -> Self {
        Self {
            geometry: geometry.iter().map(ToString::to_string).collect(),
            materials: materials.to_vec(),
            lamp: None,
            sky: 0.0,
            camera,
            scale: 1.0,
            offset: DVec3::ZERO,
            brightness: 1.0,
        }
    }

    /// Three walls that meet in a corner, 4 units wide, and a point light.
    pub fn corner() -> Self {
        let walls = [
            r#"Quad(corners: ((0, 0, 0), (0, 0, 4), (4, 0, 4), (4, 0, 0)), material: "floor")"#,
            r#"Quad(corners: ((0, 0, 0), (0, 4, 0), (0, 4, 4), (0, 0, 4)), material: "left")"#,
            r#"Quad(corners: ((0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0)), material: "right")"#,
        ];
        let materials = [("floor", Surface::Reflects(0.7)), ("left", Surface::Reflects(0.5)), ("right", Surface::Reflects(0.3))];
        let camera = View { eye: DVec3::new(3.6, 2.9, 3.3), target: DVec3::new(0.9, 0.8, 1.0), field_of_view: 55.0 };
        Self { lamp: Some(Lamp { position: DVec3::new(2.2, 2.6, 2.0), intensity: 20.0 }), ..Self::new(&walls, &materials, camera) }
    }

    /// A closed box, 2 units wide, whose walls emit 1 and reflect nothing: the irradiance is π everywhere.
    pub fn furnace() -> Self {
        let camera = View { eye: DVec3::new(-0.6, 0.3, 0.9), target: DVec3::new(0.2, -0.2, -0.4), field_of_view: 75.0 };
        Self::new(&["Box(min: (-1, -1, -1), max: (1, 1, 1))"], &[("*", Surface::Emits([1.0; 3]))], camera)
    }

    /// The same box, three walls of which emit `most` of red and `least` of green, the others the other way round; all emit 1 of blue.
    /// Red and green add up to a furnace's light, whatever each is alone.
    pub fn two_colours(least: f64, most: f64) -> Self {
        let walls = [
            r#"Quad(corners: ((-1, -1, -1), (1, -1, -1), (1, -1, 1), (-1, -1, 1)), material: "red")"#,
            r#"Quad(corners: ((-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1)), material: "red")"#,
            r#"Quad(corners: ((-1, -1, -1), (-1, -1, 1), (-1, 1, 1), (-1, 1, -1)), material: "red")"#,
            r#"Quad(corners: ((-1, 1, -1), (1, 1, -1), (1, 1, 1), (-1, 1, 1)), material: "green")"#,
            r#"Quad(corners: ((-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)), material: "green")"#,
            r#"Quad(corners: ((1, -1, -1), (1, -1, 1), (1, 1, 1), (1, 1, -1)), material: "green")"#,
        ];
        let materials = [("red", Surface::Emits([most, least, 1.0])), ("green", Surface::Emits([least, most, 1.0]))];
        Self::new(&walls, &materials, Self::furnace().camera)
    }

    /// A square of 2 units under an even sky of radiance 1, which fills the picture: the irradiance is π everywhere.
    pub fn open() -> Self {
        let square = r#"Quad(corners: ((-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)), material: "floor")"#;
        let camera = View { eye: DVec3::new(0.2, 0.8, 0.3), target: DVec3::ZERO, field_of_view: 40.0 };
        Self { sky: 1.0, ..Self::new(&[square], &[("floor", Surface::Reflects(0.5))], camera) }
    }

    pub fn scaled(self, scale: f64) -> Self {
        Self { scale, ..self }
    }

    /// Moves everything, after it was scaled.
    pub fn moved(self, offset: DVec3) -> Self {
        Self { offset, ..self }
    }

    /// Multiplies all light.
    pub fn brightened(self, brightness: f64) -> Self {
        Self { brightness, ..self }
    }

    pub fn seen_from(self, camera: View) -> Self {
        Self { camera, ..self }
    }

    pub fn with_field_of_view(mut self, degrees: f64) -> Self {
        self.camera.field_of_view = degrees;
        self
    }

    /// Makes all of one material, as a document has it.
    pub fn of(mut self, material: &'static str) -> Self {
        self.materials.iter_mut().for_each(|(_, surface)| *surface = Surface::Written(material));
        self
    }

    pub fn without_light(self) -> Self {
        Self { lamp: None, sky: 0.0, ..self }
    }

    /// Adds geometry, as a document lists it.
    pub fn with(mut self, geometry: &str) -> Self {
        self.geometry.push(geometry.to_owned());
        self
    }

    /// Loads the document and builds the hierarchy.
    pub fn built(&self) -> Result<Built, Trouble> {
        let stage = Stage::new(load_text("room", &self.document())?);
        let needs = Needs::of(&stage.scene);
        Ok(Built { stage: Arc::new(stage), needs })
    }

    fn document(&self) -> String {
        let Self { geometry, materials, lamp, sky, camera, scale, offset, brightness } = self;
        let materials: String = materials.iter().map(|(name, surface)| format!("\"{name}\": {}, ", surface.written(*brightness))).collect();
        // The square of the distance grows with the square of the scale: the irradiance stays.
        let lamp = lamp.map(|lamp| {
            let [position, intensity] = [self.placed(lamp.position), DVec3::splat(lamp.intensity * scale * scale * brightness)].map(written);
            format!("Point(position: {position}, intensity: {intensity})")
        });
        format!(
            "Scene(version: 1, geometry: [Place(of: [{}], scale: {}, translate: {})], materials: {{ {materials} }}, normals: Face, lights: [{}],
            environment: Constant({}), cameras: {{ \"main\": (eye: {}, target: {}, fov: {:e}) }})",
            geometry.join(", "),
            written(DVec3::splat(*scale)),
            written(*offset),
            lamp.unwrap_or_default(),
            written(DVec3::splat(sky * brightness)),
            written(self.placed(camera.eye)),
            written(self.placed(camera.target)),
            camera.field_of_view,
        )
    }

    fn placed(&self, point: DVec3) -> DVec3 {
        point * self.scale + self.offset
    }
}

impl Surface {
    fn written(self, brightness: f64) -> String {
        match self {
            Self::Reflects(reflectance) => format!("Diffuse(reflectance: {})", written(DVec3::splat(reflectance))),
            Self::Written(material) => material.to_owned(),
            Self::Emits(radiance) => format!("Emitter(radiance: {})", written(DVec3::from(radiance) * brightness)),
        }
    }
}

fn written(vector: DVec3) -> String {
    format!("({:e}, {:e}, {:e})", vector.x, vector.y, vector.z)
}
