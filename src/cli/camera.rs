//! A camera from the command line, and any camera as a document has it.

use super::failure::{CommandError, Failure};
use crate::scene::{Camera, FieldOfView, Scene};
use clap::Args;
use glam::{DVec3, Vec3};

#[derive(Args, Clone, Default)]
pub struct CameraOptions {
    /// Where to look from, in the scene's own coordinates
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    eye: Option<DVec3>,
    /// What to look at; with --eye alone, the middle of the scene
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    target: Option<DVec3>,
    /// What is up in the picture; +y if neither this nor the camera says
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    up: Option<DVec3>,
    /// The horizontal angle that the picture shows [degrees]
    #[arg(long, value_name = "DEGREES", value_parser = angle)]
    fov: Option<f64>,
    /// Print the camera that was chosen, as a scene document has it
    #[arg(long)]
    pub print_camera: bool,
}

impl CameraOptions {
    /// Whether the options say anything of the camera.
    pub fn is_given(&self) -> bool {
        self.fov.is_some() || [self.eye, self.target, self.up].iter().any(Option::is_some)
    }

    /// The camera with what the options say of it, under a name that says the same.
    ///
    /// # Errors
    /// A target in the eye, an up along the view.
    pub fn apply(&self, scene: &Scene, camera: &Camera) -> Result<Camera, Failure> {
        let mut camera = camera.clone();
        let eye = self.eye.map_or(camera.eye.as_dvec3(), |eye| eye - scene.origin);
        let target = self.target.map(|target| target - scene.origin).or(self.eye.map(|_| scene.bounds().centre().as_dvec3()));
        let direction = match target {
            Some(target) => (target - eye).try_normalize().ok_or_else(|| Failure::input(CommandError::TargetInEye))?,
            None => camera.direction.as_dvec3(),
        };
        (camera.eye, camera.direction) = (eye.as_vec3(), direction.as_vec3());
        camera.up = self.upright(direction, camera.up.as_dvec3())?;
        if let Some(fov) = self.fov {
            camera.field_of_view = FieldOfView::Horizontal(fov.to_radians() as f32);
        }
        camera.name += &self.words();
        Ok(camera)
    }

    /// The up of the picture: what the user says, else that of the camera, else any that is not along the view.
    fn upright(&self, direction: DVec3, of_camera: DVec3) -> Result<Vec3, Failure> {
        let is_moved = self.eye.is_some() || self.target.is_some();
        let candidates = match (self.up, is_moved) {
            (Some(up), _) => vec![up],
            (None, true) => vec![DVec3::Y, DVec3::NEG_Z],
            (None, false) => vec![of_camera],
        };
        let found = candidates.into_iter().find_map(|up| Camera::upright(direction, up));
        found.map(DVec3::as_vec3).ok_or_else(|| Failure::input(CommandError::UpAlongView))
    }

    /// The options as they were written, each after a blank.
    fn words(&self) -> String {
        let places = [("eye", self.eye), ("target", self.target), ("up", self.up)];
        let places = places.into_iter().filter_map(|(name, place)| place.map(|place| format!(" --{name} {},{},{}", place.x, place.y, place.z)));
        places.chain(self.fov.map(|fov| format!(" --fov {fov}"))).collect()
    }
}

/// A camera as an entry of a scene document's `cameras`, for a picture of `size` pixels.
pub fn to_ron(scene: &Scene, camera: &Camera, [width, height]: [u32; 2]) -> String {
    let triple = |v: DVec3| format!("({}, {}, {})", v.x, v.y, v.z);
    // Single precision has seven digits.
    let short = |v: Vec3| triple(v.as_dvec3().map(|x| (x * 1e7).round() / 1e7));
    let fov = 2.0 * f64::from(camera.half_extent([width, height]).x).atan().to_degrees();
    let fov = (fov * 1e4).round() / 1e4;
    let eye = triple((camera.eye.as_dvec3() + scene.origin).map(|x| format!("{}", x as f32).parse().unwrap_or(x)));
    let (direction, up) = (short(camera.direction), short(camera.up));
    // Without the options that made it.
    let name = camera.name.split(" --").next().unwrap_or_default();
    format!("{name:?}: (eye: {eye}, direction: {direction}, up: {up}, fov: {fov}, size: ({width}, {height})),\n")
}

/// The farthest place, as for scenes [scene units].
const FARTHEST: f64 = 4e9;

fn triple(text: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok().filter(|x: &f64| x.abs() <= FARTHEST)).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        _ => Err("expected three numbers from -4e9 to 4e9, such as 0,1.6,4".to_owned()),
    }
}

fn angle(text: &str) -> Result<f64, String> {
    let degrees = text.parse().ok().filter(|degrees: &f64| (0.001..=179.9).contains(degrees));
    degrees.ok_or_else(|| "expected an angle of 0.001 to 179.9 degrees, such as 60".to_owned())
}
