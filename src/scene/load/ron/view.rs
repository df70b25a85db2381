//! Lights, cameras and the sky of scene documents.

use super::Reader;
use super::document::{CameraEntry, LightEntry, Raw, Sky, Sun, Triple};
use super::values::Source;
use crate::scene::load::{
    error::{Problem, SceneError, Together},
    image,
    sky::{self, Clear},
};
use crate::{
    math::curve::Curve,
    scene::{
        animation::{CameraTrack, LightTrack, Look, Stand, moves},
        model::{Camera, Environment, FieldOfView, Light, LightKind},
    },
};
use glam::{DVec3, Vec3};

impl<'a> Reader<'a> {
    pub fn add_light(&mut self, raw: Raw<'a, LightEntry<'a>>) -> Result<(), SceneError> {
        let source = self.source;
        let (strength_of, place_of) =
            (|raw| source.curve(raw, |raw| source.radiance(raw).map(|light| light.as_dvec3())), |raw| source.curve(raw, |raw| source.vector(raw)));
        let direction_of = |raw| source.curve(raw, |raw| source.unit(raw));
        let (first, down) = (|curve: &Curve<DVec3>| curve.at(0.0).as_vec3(), || Curve::constant(DVec3::NEG_Y));
        let toward = |curve: &Curve<DVec3>| first_direction(curve).as_vec3();
        let (kind, shadows, at, direction, strength) = match source.get(raw)? {
            LightEntry::Point { position, intensity, shadows } => {
                let (at, strength) = (place_of(position), strength_of(intensity)).together()?;
                (LightKind::Point { position: Vec3::ZERO, intensity: first(&strength) }, shadows, at, down(), strength)
            }
            LightEntry::Spot { position, direction, intensity, inner, outer, shadows } => {
                let outer = source.number_in(outer, "greater than 0 and at most 90 degrees", |d| d > 0.0 && d <= 90.0);
                // Beside an outer angle that is wrong, any inner one will do.
                let widest = outer.as_ref().map_or(f64::INFINITY, |outer| *outer);
                let inner = inner.map_or(Ok(0.0), |raw| source.number_in(raw, "0 or more and less than `outer`", |d| (0.0..widest).contains(&d)));
                let (at, direction, strength, angles) =
                    (place_of(position), direction_of(direction), strength_of(intensity), (inner, outer).together()).together()?;
                let [inner, outer] = [angles.0, angles.1].map(|degrees| degrees.to_radians() as f32);
                let kind = LightKind::Spot { position: Vec3::ZERO, direction: toward(&direction), intensity: first(&strength), inner, outer };
                (kind, shadows, at, direction, strength)
            }
            LightEntry::Directional { direction, irradiance, shadows } => {
                let (direction, strength) = (direction_of(direction), strength_of(irradiance)).together()?;
                let kind = LightKind::Directional { direction: toward(&direction), irradiance: first(&strength) };
                (kind, shadows, Curve::constant(DVec3::ZERO), direction, strength)
            }
        };
        let (name, place) = (format!("light {}", self.draft.lights.len() + 1), at.at(0.0));
        if moves(&[&at, &direction, &strength]) {
            let stand = Stand::Free { at, look: Look::Along(direction), up: Curve::constant(DVec3::Y) };
            self.draft.animation.lights.push(LightTrack { light: self.draft.lights.len(), stand, strength: Some(strength) });
        }
        self.draft.lights.push((Light { name, kind, shadows }, place));
        Ok(())
    }

    pub fn add_camera(&mut self, place: Raw<'a, String>, raw: Raw<'a, CameraEntry<'a>>) -> Result<(), SceneError> {
        let source = self.source;
        let name = source.get(place)?;
        if self.draft.has_camera(&name) {
            return Err(self.twice(place, "camera"));
        }
        let entry = source.get(raw)?;
        let eye = source.curve(entry.eye, |raw| source.vector(raw));
        let look = self.look(&name, raw, &entry, eye.as_ref().ok());
        let up = entry.up.map_or_else(|| Ok(Curve::constant(DVec3::Y)), |raw| source.curve(raw, |raw| source.unit(raw)));
        let in_range = |raw| source.number_in(raw, "greater than 0 and less than 180 degrees", |d| d > 0.0 && d < 180.0).map(f64::to_radians);
        let size = entry.size.map(|raw| source.picture_size(raw)).transpose();
        let (at, look, up, angle, size) = (eye, look, up, source.curve(entry.fov, in_range), size).together()?;
        let eye = at.at(0.0);
        let direction = match &look {
            Look::Along(direction) => first_direction(direction),
            Look::At(_) => look.from(eye, 0.0).normalize_or(DVec3::NEG_Z),
        };
        let upright = first_direction(&up).reject_from_normalized(direction);
        if upright.length() < 1e-6 {
            let message = format!("camera `{name}` looks along its own `up`");
            return Err(source.error(Problem::Range, raw, message, "no way up").help("give it an `up` that is not parallel to its direction"));
        }
        let camera = Camera {
            name,
            eye: Vec3::ZERO,
            direction: direction.as_vec3(),
            up: upright.normalize().as_vec3(),
            field_of_view: FieldOfView::Horizontal(angle.at(0.0) as f32),
            size,
            sample: Default::default(),
        };
        if moves(&[&at, look.curve(), &up]) || !angle.is_constant() {
            let camera = self.draft.cameras.len();
            self.draft.animation.cameras.push(CameraTrack { camera, stand: Stand::Free { at, look, up }, angle: Some(angle) });
        }
        self.draft.add_camera(camera, eye);
        Ok(())
    }

    /// Where a camera looks. From an eye that is wrong, anywhere will do.
    fn look(&self, name: &str, raw: Raw<'a, CameraEntry<'a>>, entry: &CameraEntry<'a>, eye: Option<&Curve<DVec3>>) -> Result<Look, SceneError> {
        let source = self.source;
        match (entry.direction, entry.target) {
            (Some(direction), None) => source.curve(direction, |raw| source.unit(raw)).map(Look::Along),
            (None, Some(target)) => {
                let look = source.curve(target, |raw| source.vector(raw)).map(Look::At)?;
                let is_blind = eye.is_some_and(|eye| look.from(eye.at(0.0), 0.0) == DVec3::ZERO);
                if is_blind { Err(source.out_of_range(target, "away from the eye")) } else { Ok(look) }
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

/// A direction at the beginning, whose keys are of unit length.
fn first_direction(curve: &Curve<DVec3>) -> DVec3 {
    let direction = curve.at(0.0);
    if curve.is_constant() { direction } else { direction.normalize_or(curve.values()[0]) }
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
