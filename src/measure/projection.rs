//! What other programs need to know of a picture: where points of the scene are in it, and where it shows nothing.

use super::layers::{ALPHA, Layers, PICTURE};
use crate::scene::{Camera, Scene};
use glam::{DMat4, DVec3, DVec4, Mat4};

/// How points come into a picture. The points are in the coordinates of the scene's file, and are columns: `matrix * point.extend(1.0)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// Into the space of the camera, which is left-handed: x to the right, y up, z along the view [scene units].
    pub world_to_camera: Mat4,
    /// After division by the fourth coordinate: x and y from (0, 0) at the upper left corner of the picture to (1, 1) at the lower right one, z as 1 / depth.
    pub world_to_ndc: Mat4,
    /// Width of the picture at distance 1.
    pub width: f32,
}

impl Projection {
    /// That of a camera for a picture of `size` pixels.
    pub fn of(camera: &Camera, origin: DVec3, size: [u32; 2]) -> Self {
        let [right, up, forward, eye] = [camera.right(), camera.up, camera.direction, camera.eye].map(|vector| vector.as_dvec3());
        let eye = origin + eye;
        let row = |axis: DVec3| axis.extend(-axis.dot(eye));
        let world_to_camera = DMat4::from_cols(row(right), row(up), row(forward), DVec4::W).transpose();
        let half = camera.half_extent(size).as_dvec2();
        let to_ndc = DMat4::from_cols(
            DVec4::new(0.5 / half.x, 0.0, 0.0, 0.0),
            DVec4::new(0.0, -0.5 / half.y, 0.0, 0.0),
            DVec4::new(0.5, 0.5, 0.0, 1.0),
            DVec4::new(0.0, 0.0, 1.0, 0.0),
        );
        Self { world_to_camera: world_to_camera.as_mat4(), world_to_ndc: (to_ndc * world_to_camera).as_mat4(), width: 2.0 * half.x as f32 }
    }
}

impl Layers {
    /// The same with the camera that it was made through, and with alpha where that is known: 1 where the picture shows a surface, and everywhere under a
    /// sky that is not black; 0 elsewhere. `size` is that of the whole picture, also where this holds every k-th pixel.
    pub fn seen_through(mut self, camera: &Camera, scene: &Scene, size: [u32; 2]) -> Self {
        self.projection = Some(Projection::of(camera, scene.origin, size));
        let alpha = if scene.environment.is_black() { self.coverage() } else { Some(vec![1.0; self.width as usize * self.height as usize]) };
        if let (Some(alpha), Some(picture)) = (alpha, self.layers.get_mut(PICTURE)) {
            picture.channels.insert(ALPHA.to_owned(), alpha);
        }
        self
    }

    /// 1 where a surface is seen; None without the layer `depth`.
    fn coverage(&self) -> Option<Vec<f32>> {
        let depth = self.layers.get("depth")?.channels.values().next()?;
        Some(depth.iter().map(|&depth| if depth > 0.0 { 1.0 } else { 0.0 }).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::Layer;
    use crate::scene::load::load_text;

    /// A scene far from its file's origin, which is stored relative to another.
    fn far() -> Scene {
        let text = r#"Scene(version: 1, geometry: [Box(min: (5000, 20, -7000), max: (5004, 24, -6996))], materials: { "*": Diffuse(reflectance: (0.5, 0.5, 0.5)) },
            cameras: { "main": (eye: (5010, 30, -6990), target: (5002, 22, -6998), up: (0, 1, 0), fov: 50) })"#;
        load_text("far.ron", text).unwrap()
    }

    #[test]
    fn a_point_lands_on_the_pixel_whose_ray_meets_it() {
        let (scene, size) = (far(), [640, 480]);
        assert!(scene.origin.x > 1000.0, "{}", scene.origin);
        let camera = &scene.cameras[0];
        let projection = Projection::of(camera, scene.origin, size);
        for pixel in [[0, 0], [639, 479], [100, 300], [320, 240]] {
            for distance in [0.5, 12.0] {
                let ray = camera.pixel_ray(size, pixel);
                let point = (scene.origin + (camera.eye + ray * distance).as_dvec3()).as_vec3().extend(1.0);
                let ndc = projection.world_to_ndc * point;
                let [x, y] = [ndc.x / ndc.w * 640.0, ndc.y / ndc.w * 480.0];
                // Half a pixel off to its centre; the rest is what single precision makes of 7000 units.
                let off = (x - pixel[0] as f32 - 0.5).abs().max((y - pixel[1] as f32 - 0.5).abs());
                assert!(off < if distance > 1.0 { 0.2 } else { 3.0 }, "{pixel:?} at {distance}: ({x}, {y})");
                let seen = projection.world_to_camera * point;
                assert!((seen.z - distance).abs() < 0.005 && seen.w == 1.0, "{seen} instead of {distance}");
            }
        }
        let above = projection.world_to_camera * (scene.origin.as_vec3() + camera.eye + camera.up).extend(1.0);
        assert!(above.y > 0.99 && above.x.abs() < 0.01, "{above}");
    }

    #[test]
    fn alpha_is_one_on_surfaces_and_under_a_sky() {
        let mut scene = far();
        let picture = || Layers::new(2, 1).with(PICTURE, Layer::interleaved(&["R", "G", "B"], &[1.0; 6], 3)).with("depth", Layer::value(vec![3.0, 0.0]));
        let alpha = |scene: &Scene, picture: Layers| picture.seen_through(&scene.cameras[0], scene, [2, 1]).layers[PICTURE].channels.get(ALPHA).cloned();
        assert_eq!(alpha(&scene, picture()), Some(vec![1.0, 0.0]));
        let mut unknown = picture();
        unknown.layers.remove("depth");
        assert_eq!(alpha(&scene, unknown), None);
        scene.environment = crate::scene::Environment::Constant(glam::Vec3::ONE);
        assert_eq!(alpha(&scene, picture()), Some(vec![1.0, 1.0]));
    }
}
