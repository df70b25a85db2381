//! Records over the pictures of a page: where each is, how far it reaches, what ended its reach, how sure it is.

use crate::math::colour::luminance;
use crate::math::frame::Frame;
use crate::math::weight::{Record, Rule};
use crate::scene::Camera;
use base64::{Engine, engine::general_purpose::STANDARD};
use glam::{DVec2, DVec3, Vec3};
use half::{bf16, f16};
use miniz_oxide::deflate::compress_to_vec_zlib;
use serde::Serialize;

/// Most records of a page: what more there are of is shown in part.
pub(super) const MOST_RECORDS: usize = 1 << 16;

const COMPRESSION: u8 = 6;

/// The records of one cache that a camera sees.
#[derive(Debug, Clone)]
pub struct Overlay {
    /// The node that keeps them.
    cache: String,
    outlines: Vec<Outline>,
}

/// A record as it lies in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Outline {
    /// As a share of the picture's width and height, from its upper left corner.
    centre: DVec2,
    /// From the centre to the rim, two half diameters that make the ellipse [pixels].
    half_diameters: [DVec2; 2],
    /// Along the shorter axis [scene units].
    reach: f32,
    /// Luminance [W/m²].
    irradiance: f32,
    /// Standard error of that luminance, as a share of it.
    error: f32,
    limited_by: &'static str,
}

/// The records of a cache as the page's script reads them.
#[derive(Serialize)]
pub(super) struct RecordSet {
    cache: String,
    /// Of the cache, in view.
    count: usize,
    /// Every so many-th of them is there.
    every: usize,
    /// What ends the reach of any; records name them by their places here.
    limits: Vec<&'static str>,
    /// zlib in base64, column by column: centre x and y as shares of the picture in 65535ths (unsigned), the four numbers of the half diameters (half floats), reach,
    /// irradiance and error (the upper half of single floats), limit (a byte). Numbers of two bytes have the low one first.
    source: String,
}

impl RecordSet {
    /// Its share of the page [bytes].
    pub(super) fn weight(&self) -> usize {
        self.source.len()
    }
}

impl Overlay {
    /// Those records of a cache that this camera may see; what hides them is not asked.
    pub fn new(cache: String, rule: &Rule, records: &[Record], camera: &Camera, size: [u32; 2]) -> Self {
        let view = View::new(camera, size);
        Self { cache, outlines: records.iter().filter_map(|record| outline(record, rule, &view)).collect() }
    }

    /// As many as are allowed, evenly out of all.
    pub(super) fn pack(&self, most: usize) -> RecordSet {
        let every = self.outlines.len().div_ceil(most.max(1)).max(1);
        let kept: Vec<&Outline> = self.outlines.iter().step_by(every).collect();
        let mut limits: Vec<&'static str> = kept.iter().map(|outline| outline.limited_by).collect();
        limits.sort_unstable();
        limits.dedup();
        let source = STANDARD.encode(compress_to_vec_zlib(&columns(&kept, &limits), COMPRESSION));
        RecordSet { cache: self.cache.clone(), count: self.outlines.len(), every, limits, source }
    }
}

impl Outline {
    /// As columns have it.
    fn numbers(&self) -> [u16; 9] {
        let share = |value: f64| (value * 65535.0).round() as u16;
        let short = |value: f64| f16::from_f64(value.clamp(-65504.0, 65504.0)).to_bits();
        let upper = |value: f32| bf16::from_f32(value).to_bits();
        let [[a, b], [c, d]] = self.half_diameters.map(|half| half.to_array().map(short));
        [share(self.centre.x), share(self.centre.y), a, b, c, d, upper(self.reach), upper(self.irradiance), upper(self.error)]
    }
}

fn columns(outlines: &[&Outline], limits: &[&str]) -> Vec<u8> {
    let rows: Vec<[u16; 9]> = outlines.iter().map(|outline| outline.numbers()).collect();
    let numbers = (0..9).flat_map(|column| rows.iter().flat_map(move |row| row[column].to_le_bytes()));
    let place = |outline: &&Outline| limits.iter().position(|limit| *limit == outline.limited_by).unwrap_or(0) as u8;
    numbers.chain(outlines.iter().map(place)).collect()
}

/// None of a record that is out of view. A disc far away is an ellipse; one that is close is drawn as the ellipse that it is about its middle.
fn outline(record: &Record, rule: &Rule, view: &View) -> Option<Outline> {
    let (position, normal) = (record.position.as_dvec3(), record.normal);
    let centre = view.share(position).filter(|centre| centre.cmpge(DVec2::ZERO).all() && centre.cmple(DVec2::ONE).all())?;
    let [reach, longest] = [rule.validity_radius(record), rule.longest_validity_radius(record)];
    let along = record.stretch.try_normalize().unwrap_or_else(|| Frame::new(normal).to_world(Vec3::X));
    let half_diameters = [(along, longest), (normal.cross(along), reach)].map(|(axis, length)| view.step(position, axis.as_dvec3() * f64::from(length)));
    let irradiance = luminance(record.irradiance.as_dvec3());
    let error = luminance(record.error.as_dvec3()) / irradiance;
    Some(Outline {
        centre,
        half_diameters,
        reach,
        irradiance: irradiance as f32,
        error: if error.is_finite() { error as f32 } else { 0.0 },
        limited_by: rule.limited_by(record),
    })
}

/// A camera's picture plane.
struct View {
    eye: DVec3,
    /// To the right and down, as long as one over the half extents.
    axes: [DVec3; 2],
    forward: DVec3,
    size: DVec2,
}

impl View {
    fn new(camera: &Camera, size: [u32; 2]) -> Self {
        let extent = camera.half_extent(size).as_dvec2();
        let axes = [camera.right().as_dvec3() / extent.x, -camera.up.as_dvec3() / extent.y];
        Self { eye: camera.eye.as_dvec3(), axes, forward: camera.direction.as_dvec3(), size: DVec2::new(f64::from(size[0]), f64::from(size[1])) }
    }

    /// Where a point is in the picture, as shares of its width and height; None of one behind the eye.
    fn share(&self, point: DVec3) -> Option<DVec2> {
        let offset = point - self.eye;
        let depth = offset.dot(self.forward);
        (depth > 0.0).then(|| (DVec2::new(offset.dot(self.axes[0]), offset.dot(self.axes[1])) / depth + 1.0) / 2.0)
    }

    /// How far a small step from a point is seen to lead [pixels].
    fn step(&self, point: DVec3, step: DVec3) -> DVec2 {
        let offset = point - self.eye;
        let depth = offset.dot(self.forward);
        let change = |axis: DVec3| (step.dot(axis) - offset.dot(axis) / depth * step.dot(self.forward)) / depth;
        self.size / 2.0 * DVec2::new(change(self.axes[0]), change(self.axes[1]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::weight::Weighting;
    use crate::scene::model::{FieldOfView, Sample};
    use miniz_oxide::inflate::decompress_to_vec_zlib;

    const SIZE: [u32; 2] = [200, 100];

    /// Looks along x; at distance 1 the picture is 2 high and 4 wide.
    fn camera() -> Camera {
        let field_of_view = FieldOfView::Vertical(std::f32::consts::FRAC_PI_2);
        Camera { name: "side".into(), eye: Vec3::ZERO, direction: Vec3::X, up: Vec3::Z, field_of_view, size: None, sample: Sample::default() }
    }

    fn view() -> View {
        View::new(&camera(), SIZE)
    }

    fn rule() -> Rule {
        Rule { weighting: Weighting::Compact, accuracy: 0.2, spacing: [1.0, 8.0], nearest: 1e9, change: 1e9, overlap: 0.0, contrast: 1e9, finest_spacing: 0.0 }
    }

    fn record(position: Vec3) -> Record {
        Record {
            position,
            radius: 2.0,
            normal: -Vec3::X,
            minimum_distance: 1.0,
            irradiance: Vec3::splat(4.0),
            footprint: 0.1,
            error: Vec3::splat(0.1),
            rotation: [Vec3::ZERO; 3],
            translation: [Vec3::ZERO; 3],
            stretch: Vec3::ZERO,
            relative_gradient: 0.0,
            fineness: 1.0,
            confinement: 0.0,
        }
    }

    #[test]
    fn a_disc_that_faces_the_eye_is_a_circle_of_its_reach() {
        // 4 ahead, 1 to the left (y), 1 up: 50 / 4 pixels a unit, and it reaches 0.2 · 2.
        let found = outline(&record(Vec3::new(4.0, 1.0, 1.0)), &rule(), &view()).unwrap();
        assert!(found.centre.distance(DVec2::new(0.5 - 12.5 / 200.0, 0.5 - 12.5 / 100.0)) < 1e-6, "{found:?}");
        assert!(
            found.half_diameters.iter().all(|half| (half.length() - 0.4 * 12.5).abs() < 1e-4)
                && found.half_diameters[0].dot(found.half_diameters[1]).abs() < 1e-4
        );
        assert_eq!((found.limited_by, found.irradiance, found.reach), ("accuracy", 4.0, 0.4));
        assert!((found.error - 0.025).abs() < 1e-6);
    }

    #[test]
    fn a_stretched_one_reaches_farther_along_its_axis() {
        // √(1 − (1/2)²) upwards: twice as far.
        let stretched = Record { stretch: Vec3::Z * 0.75f32.sqrt(), ..record(Vec3::new(4.0, 0.0, 0.0)) };
        let [long, short] = outline(&stretched, &rule(), &view()).unwrap().half_diameters;
        assert!((long.y.abs() - 10.0).abs() < 1e-3 && long.x.abs() < 1e-3 && (short.x.abs() - 5.0).abs() < 1e-3, "{long} {short}");
    }

    #[test]
    fn a_floor_is_seen_shorter_than_it_is_wide() {
        // Down and ahead by 4: ∂y/∂x = 50 · 4 / 4².
        let floor = Record { normal: Vec3::Z, stretch: Vec3::X * 1e-3, ..record(Vec3::new(4.0, 0.0, -3.9)) };
        let [ahead, across] = outline(&floor, &rule(), &view()).unwrap().half_diameters;
        assert!((ahead.length() - 0.4 * 50.0 * 3.9 / 16.0).abs() < 1e-3 && (across.length() - 5.0).abs() < 1e-3, "{ahead} {across}");
    }

    #[test]
    fn what_is_behind_or_beside_is_left_out() {
        let places = [Vec3::new(-1.0, 0.0, 0.0), Vec3::ZERO, Vec3::new(1.0, 2.1, 0.0), Vec3::new(1.0, 0.0, -1.1)];
        assert!(places.iter().all(|place| outline(&record(*place), &rule(), &view()).is_none()));
    }

    #[test]
    fn columns_hold_every_so_many_th_record() {
        let places = |at: u32| Vec3::new(4.0, 0.0, at as f32 * 0.5);
        let near = Record { footprint: 0.01, ..record(places(1)) };
        let records: Vec<Record> = [record(places(0)), near, record(places(2)), near, record(places(3))].into();
        let overlay = Overlay::new("cache".into(), &rule(), &records, &camera(), SIZE);
        let all = overlay.pack(5);
        assert_eq!((all.count, all.every, &all.limits[..]), (5, 1, &["accuracy", "maximum_spacing"][..]));
        let few = overlay.pack(4);
        assert_eq!((few.count, few.every, &few.limits[..]), (5, 2, &["accuracy"][..]));
        let bytes = decompress_to_vec_zlib(&STANDARD.decode(&few.source).unwrap()).unwrap();
        assert_eq!(bytes.len(), 3 * (9 * 2 + 1));
        let rows: Vec<u16> = bytes[6..12].chunks(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
        let expected = [0.5, 0.5 - 12.5 / 100.0, 0.5 - 1.5 * 12.5 / 100.0].map(|share| (share * 65535.0f64).round() as u16);
        assert_eq!(rows, expected);
        assert!(overlay.pack(0).every == 5);
    }
}
