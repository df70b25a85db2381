//! Lights, cameras and the sky of scene documents.

use super::Reader;
use super::document::{CameraEntry, LightEntry, Raw, Sky, Sun, Triple};
use super::values::Source;
use crate::scene::load::{
    error::{Problem, SceneError, Together},
    image,
    sky::{self, Clear},
};
use crate::scene::model::{Camera, Environment, FieldOfView, Light, LightKind};
use glam::{DVec3, Vec3};

impl<'a> Reader<'a> {
    pub fn add_light(&mut self, raw: Raw<'a, LightEntry<'a>>) -> Result<(), SceneError> {
        let source = self.source;
        let (kind, shadows, at) = match source.get(raw)? {
            LightEntry::Point { position, intensity, shadows } => {
                let (at, intensity) = (source.vector(position), source.radiance(intensity)).together()?;
                (LightKind::Point { position: Vec3::ZERO, intensity }, shadows, at)
            }
            LightEntry::Spot { position, direction, intensity, inner, outer, shadows } => {
                let outer = source.number_in(outer, "greater than 0 and at most 90 degrees", |d| d > 0.0 && d <= 90.0);
                // Beside an outer angle that is wrong, any inner one will do.
                let widest = outer.as_ref().map_or(f64::INFINITY, |outer| *outer);
                let inner = inner.map_or(Ok(0.0), |raw| source.number_in(raw, "0 or more and less than `outer`", |d| (0.0..widest).contains(&d)));
                let (at, direction, intensity, angles) =
                    (source.vector(position), source.unit(direction), source.radiance(intensity), (inner, outer).together()).together()?;
                let [inner, outer] = [angles.0, angles.1].map(|degrees| degrees.to_radians() as f32);
                (LightKind::Spot { position: Vec3::ZERO, direction: direction.as_vec3(), intensity, inner, outer }, shadows, at)
            }
            LightEntry::Directional { direction, irradiance, shadows } => {
                let (direction, irradiance) = (source.unit(direction), source.radiance(irradiance)).together()?;
                (LightKind::Directional { direction: direction.as_vec3(), irradiance }, shadows, DVec3::ZERO)
            }
        };
        let name = format!("light {}", self.draft.lights.len() + 1);
        self.draft.lights.push((Light { name, kind, shadows }, at));
        Ok(())
    }

    pub fn add_camera(&mut self, place: Raw<'a, String>, raw: Raw<'a, CameraEntry<'a>>) -> Result<(), SceneError> {
        let source = self.source;
        let name = source.get(place)?;
        if self.draft.has_camera(&name) {
            return Err(self.twice(place, "camera"));
        }
        let entry = source.get(raw)?;
        let eye = source.vector(entry.eye);
        let direction = self.direction(&name, raw, &entry, eye.as_ref().ok());
        let up = entry.up.map_or(Ok(DVec3::Y), |raw| source.unit(raw));
        let angle = source.number_in(entry.fov, "greater than 0 and less than 180 degrees", |d| d > 0.0 && d < 180.0);
        let size = entry.size.map(|raw| source.picture_size(raw)).transpose();
        let (eye, direction, up, angle, size) = (eye, direction, up, angle, size).together()?;
        let upright = up.reject_from_normalized(direction);
        if upright.length() < 1e-6 {
            let message = format!("camera `{name}` looks along its own `up`");
            return Err(source.error(Problem::Range, raw, message, "no way up").help("give it an `up` that is not parallel to its direction"));
        }
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

    /// Where a camera looks. From an eye that is wrong, anywhere will do.
    fn direction(&self, name: &str, raw: Raw<'a, CameraEntry<'a>>, entry: &CameraEntry<'a>, eye: Option<&DVec3>) -> Result<DVec3, SceneError> {
        let source = self.source;
        match (entry.direction, entry.target) {
            (Some(direction), None) => source.unit(direction),
            (None, Some(target)) => {
                let (at, Some(eye)) = (source.vector(target)?, eye) else { return Ok(DVec3::Z) };
                (at - eye).try_normalize().ok_or_else(|| source.out_of_range(target, "away from the eye"))
            }
            _ => {
                let message = format!("camera `{name}` needs either a `direction` or a `target`");
                Err(source.error(Problem::Format, raw, message, "one of the two").help("say where it looks, once"))
            }
        }
    }

    pub fn read_sky(&self, raw: Raw<'a, Sky<'a>>) -> Result<Environment, SceneError> {
        let source = self.source;
        Ok(match source.get(raw)? {
            Sky::Constant(radiance) => Environment::Constant(source.radiance(radiance)?),
            Sky::Clear { sun, turbidity, scale, ground } => {
                let scale = scale.map_or(Ok(sky::PER_KCD), |raw| source.number_in(raw, "0 to 1e30", |s| (0.0..=1e30).contains(&s)));
                let (scale, clear, ground) = (scale, source.clear_sky(&sun, turbidity), source.ground(ground)).together()?;
                sky::bake(ground, |direction| scale * clear.radiance(direction))
            }
            Sky::Overcast { zenith, ground } => {
                let (zenith, ground) = (source.radiance(zenith), source.ground(ground)).together()?;
                sky::bake(ground, |direction| sky::overcast(zenith.as_dvec3(), direction))
            }
            Sky::LatLong { file, scale, rotation } => {
                let scale = scale.map_or(Ok(1.0), |raw| source.number_in(raw, "0 or more", |s| s >= 0.0));
                let rotation = rotation.map_or(Ok(0.0), |raw| source.number(raw));
                let (file, scale, rotation) = (self.find_file(file), scale, rotation).together()?;
                image::load_sky(&file, self.files, scale as f32, rotation.to_radians())?
            }
        })
    }
}

impl<'a> Source<'a> {
    fn clear_sky(&self, sun: &Sun<'a>, turbidity: Option<Raw<'a, f64>>) -> Result<Clear, SceneError> {
        let elevation = self.number_in(sun.elevation, "0 to 90 degrees", |d| (0.0..=90.0).contains(&d));
        let (least, most) = (sky::TURBIDITY.start(), sky::TURBIDITY.end());
        let holds = |t: f64| sky::TURBIDITY.contains(&t);
        let turbidity = turbidity.map_or(Ok(sky::USUAL_TURBIDITY), |raw| self.number_in(raw, &format!("{least} to {most}"), holds));
        let (azimuth, elevation, turbidity) = (self.number(sun.azimuth), elevation, turbidity).together()?;
        Ok(Clear::new(azimuth.to_radians(), elevation.to_radians(), turbidity))
    }

    fn ground(&self, raw: Option<Raw<'a, Triple>>) -> Result<DVec3, SceneError> {
        raw.map_or(Ok(sky::GROUND), |raw| Ok(self.reflectance(raw)?.as_dvec3()))
    }
}
