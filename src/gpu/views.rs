//! From where pictures are seen and where the movers stand in them: of this one, and of the one before.

use crate::scene::Camera;
use glam::DAffine3;

/// Of one picture.
#[derive(Debug, Clone)]
pub(super) struct View {
    pub camera: Camera,
    /// Of the stage's movers, in their order.
    pub places: Vec<DAffine3>,
}

/// Those of this picture and of the one before it, which for the first is the same.
#[derive(Debug, Clone, Default)]
pub(super) struct Views {
    now: Option<View>,
    before: Option<View>,
    /// Whether the device was told last that a mover has moved.
    has_moved: bool,
}

impl Views {
    /// As a frame begins: the view of the picture before, and whether the device has other movements to be told. Further samples of a picture have the same
    /// one before.
    pub fn begin(&mut self, now: View) -> (View, bool) {
        let is_another = now.camera.sample.number == 0;
        let last = self.now.replace(now.clone());
        if is_another || self.before.is_none() {
            self.before = last;
        }
        let before = self.before.get_or_insert_with(|| now.clone()).clone();
        let moves = before.places != now.places;
        (before, std::mem::replace(&mut self.has_moved, moves) || moves)
    }

    /// As if the picture before had been a view of this.
    pub fn see(&mut self, before: View) {
        *self = Self { now: Some(before), before: None, has_moved: true };
    }

    /// The same for another device memory, which was told nothing yet.
    pub fn untold(&self) -> Self {
        Self { has_moved: true, ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{FieldOfView, Sample};
    use glam::{DVec3, Vec3};

    fn view(x: f32, mover: f64, sample: u32) -> View {
        let camera = Camera {
            name: String::new(),
            eye: x * Vec3::X,
            direction: Vec3::Z,
            up: Vec3::Y,
            field_of_view: FieldOfView::Shorter(1.0),
            size: None,
            sample: Sample { number: sample, ..Default::default() },
        };
        View { camera, places: vec![DAffine3::from_translation(mover * DVec3::X)] }
    }

    #[test]
    fn the_view_before_is_that_of_the_picture_before() {
        let mut views = Views::default();
        let mut begin = |now: View| {
            let (before, told) = views.begin(now);
            (before.camera.eye.x, before.places[0].translation.x, told)
        };
        assert_eq!(begin(view(1.0, 5.0, 0)), (1.0, 5.0, false));
        assert_eq!(begin(view(2.0, 5.0, 0)), (1.0, 5.0, false));
        assert_eq!(begin(view(3.0, 6.0, 0)), (2.0, 5.0, true));
        assert_eq!(begin(view(3.0, 6.0, 1)), (2.0, 5.0, true), "another sample");
        assert_eq!(begin(view(3.0, 6.0, 0)), (3.0, 6.0, true), "the movement is taken back");
        assert_eq!(begin(view(3.0, 6.0, 0)), (3.0, 6.0, false));
    }
}
