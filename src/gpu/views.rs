//! From where pictures are seen and where the movers stand in them: of this one, and of the one before.

use crate::scene::{Camera, stage::Pose};

/// Of one picture.
#[derive(Debug, Clone)]
pub(super) struct View {
    pub camera: Camera,
    /// Of the stage's movers, in their order.
    pub poses: Vec<Pose>,
}

/// Those of this picture and of the one before it, which for the first is the same.
#[derive(Debug, Clone, Default)]
pub(super) struct Views {
    now: Option<View>,
    before: Option<View>,
    /// Whether the device was told last that a mover has moved.
    has_moved: bool,
    /// Where the movers stood in the frame that ran last, which may have been no picture.
    stood: Option<Vec<Pose>>,
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
        let moves = before.poses != now.poses;
        (before, std::mem::replace(&mut self.has_moved, moves) || moves)
    }

    /// As a frame begins whose movers stand so: where they stood in the frame that ran before, which for the first is the same.
    pub fn pass(&mut self, poses: Vec<Pose>) -> Vec<Pose> {
        self.stood.replace(poses.clone()).unwrap_or(poses)
    }

    /// After a frame that was run ahead: the picture before is the one that it was.
    pub fn back_to(&mut self, pictures: Self) {
        *self = Self { stood: self.stood.take(), has_moved: true, ..pictures };
    }

    /// As if the picture before had been a view of this.
    pub fn see(&mut self, before: View) {
        let stood = Some(before.poses.clone());
        *self = Self { now: Some(before), before: None, has_moved: true, stood };
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
    use glam::{DAffine3, DVec3, Vec3};

    fn place(x: f64) -> Pose {
        Pose::Place(DAffine3::from_translation(x * DVec3::X))
    }

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
        View { camera, poses: vec![place(mover)] }
    }

    #[test]
    fn the_view_before_is_that_of_the_picture_before() {
        let mut views = Views::default();
        let mut begin = |now: View| {
            let (before, told) = views.begin(now);
            (before.camera.eye.x, before.poses == [place(5.0)], told)
        };
        assert_eq!(begin(view(1.0, 5.0, 0)), (1.0, true, false));
        assert_eq!(begin(view(2.0, 5.0, 0)), (1.0, true, false));
        assert_eq!(begin(view(3.0, 6.0, 0)), (2.0, true, true));
        assert_eq!(begin(view(3.0, 6.0, 1)), (2.0, true, true), "another sample");
        assert_eq!(begin(view(3.0, 6.0, 0)), (3.0, false, true), "the movement is taken back");
        assert_eq!(begin(view(3.0, 6.0, 0)), (3.0, false, false));
    }
}
