//! A tile projected on hemispherical harmonics: the coefficients of the radiance that arrives, and how each changes along the surface.
//!
//! With the harmonic `H_i` in place of the cosine, the coefficient is summed as the irradiance is, and its translation gradient is that of
//! [`super::sum`]: a wall between two samples moves over the hemisphere as the point moves, whatever is integrated there.

use super::{
    frame::Frame,
    harmonics::{
        Basis, MOST, count,
        reflection::{LobeTable, fours, numbers, quads},
        tilt::{Tilting, turn},
    },
    hemisphere::{Edge, Sample, Table},
    sum::SizeError,
    weight::EXTRAPOLATION,
};
use glam::{DVec2, DVec3, Vec3, Vec4};
use std::f32::consts::TAU;

/// Expansions of a record: red, green, blue, then their derivatives along the first and the second tangent.
pub const PLANES: usize = 9;

/// The basis at a table's samples and walls.
#[derive(Debug, Clone)]
pub struct Expansion {
    pub order: usize,
    /// Index of each sample with a weight, and its solid angle times the harmonics there.
    pub samples: Vec<(u32, Vec<f64>)>,
    pub walls: Vec<Wall>,
}

/// A wall between two samples, see [`Edge`].
#[derive(Debug, Clone)]
pub struct Wall {
    pub a: u32,
    pub b: u32,
    /// Along both tangents; the irradiance's, over the cosine there.
    pub gradient: DVec2,
    /// The harmonics in the wall's direction.
    pub basis: Vec<f64>,
}

/// What a tile projects to, in the frame of its record.
#[derive(Debug, Clone, PartialEq)]
pub struct Projected(pub [Vec<f64>; PLANES]);

impl Expansion {
    pub fn new(table: &Table, order: usize) -> Self {
        let basis = Basis::<f64>::new(order);
        let used = table.samples.iter().zip(0..).filter(|(sample, _)| sample.plain_weight > 0.0);
        let samples = used.map(|(s, at)| (at, basis.hemispherical(mean_direction(s)).into_iter().map(|h| h * s.plain_weight).collect())).collect();
        Self { order, samples, walls: table.edges.iter().filter_map(|edge| wall(table, edge, &basis)).collect() }
    }

    /// Projects a tile as [`super::sum::sum`] sums it.
    ///
    /// # Errors
    /// When the tile has another number of samples than the table.
    pub fn project(&self, table: &Table, radiance: &[[f32; 4]], nearest: f64) -> Result<Projected, SizeError> {
        if radiance.len() != table.samples.len() {
            return Err(SizeError { found: radiance.len(), expected: table.samples.len() });
        }
        let colour = |at: u32| DVec3::from_array([0, 1, 2].map(|i| f64::from(radiance[at as usize][i])));
        let inverse_depth = |at: u32| 1.0 / (f64::from(radiance[at as usize][3]).max(nearest) * table.samples[at as usize].depth_cosine);
        let mut planes: [Vec<f64>; PLANES] = std::array::from_fn(|_| vec![0.0; count(self.order)]);
        for (at, basis) in &self.samples {
            (0..3).for_each(|channel| add(&mut planes[channel], basis, colour(*at)[channel]));
        }
        for wall in &self.walls {
            let step = (colour(wall.b) - colour(wall.a)) * inverse_depth(wall.a).max(inverse_depth(wall.b));
            for channel in 0..3 {
                add(&mut planes[3 + channel], &wall.basis, step[channel] * wall.gradient.x);
                add(&mut planes[6 + channel], &wall.basis, step[channel] * wall.gradient.y);
            }
        }
        Ok(Projected(planes))
    }
}

/// The direction that stands for all that a sample does: its height is the mean height, so that the irradiance, which two harmonics hold, is exact.
/// Near the horizon a sample's own direction may be far from it.
fn mean_direction(sample: &Sample) -> [f64; 3] {
    let z = (sample.cosine_weight / sample.plain_weight).clamp(0.0, 1.0);
    let along = DVec2::new(sample.rotation[1], -sample.rotation[0]).normalize_or_zero() * (1.0 - z * z).sqrt();
    [along.x, along.y, z]
}

fn add(sum: &mut [f64], basis: &[f64], factor: f64) {
    sum.iter_mut().zip(basis).for_each(|(sum, basis)| *sum += basis * factor);
}

fn wall(table: &Table, edge: &Edge, basis: &Basis<f64>) -> Option<Wall> {
    let between: DVec3 = [edge.a, edge.b].map(|at| DVec3::from(table.samples[at as usize].direction)).into_iter().sum();
    let direction = between.normalize_or_zero();
    let along = DVec3::from(edge.gradient).truncate();
    // Walls on the horizon itself move nothing that a surface sees.
    (direction.z > 1e-6).then(|| Wall { a: edge.a, b: edge.b, gradient: along / direction.z, basis: basis.hemispherical(direction.to_array()) })
}

impl Projected {
    /// The same in a frame that the record's is `angle` ahead of, around the normal [radians].
    pub fn turned(mut self, angle: f64) -> Self {
        self.0.iter_mut().for_each(|plane| turn(plane, angle));
        let (sine, cosine) = angle.sin_cos();
        let (x, y) = self.0[3..].split_at_mut(3);
        for (x, y) in x.iter_mut().flatten().zip(y.iter_mut().flatten()) {
            (*x, *y) = (*x * cosine - *y * sine, *x * sine + *y * cosine);
        }
        self
    }

    /// How fast what arrives changes along the surface: the derivatives' norm over the expansion's [1 / scene unit].
    pub fn relative_gradient(&self) -> f64 {
        let energy = |planes: &[Vec<f64>]| planes.iter().flatten().map(|v| v * v).sum::<f64>();
        (energy(&self.0[3..]) / energy(&self.0[..3]).max(1e-30)).sqrt()
    }

    /// The inverse of [`Self::in_fours`].
    pub fn of_fours(planes: &[Vec4], order: usize) -> Self {
        let mut planes = planes.chunks_exact(quads(order)).map(|plane| numbers(plane, order));
        Self(std::array::from_fn(|_| planes.next().unwrap_or_default()))
    }

    /// Plane by plane, [`quads`] each, as records keep them.
    pub fn in_fours(&self) -> Vec<Vec4> {
        self.0.iter().flat_map(|plane| fours(plane)).collect()
    }
}

/// A viewer of a place of a glossy surface, seen from a record near it.
#[derive(Debug, Clone, Copy)]
pub struct Viewed {
    /// Unit direction to the viewer.
    pub toward: Vec3,
    /// Unit normal of the place, and of the record.
    pub normal: Vec3,
    pub record_normal: Vec3,
    /// From the record to the place, as far as the gradients are followed [scene units].
    pub offset: Vec3,
    /// Of the lobe, along the normal.
    pub reflectance: Vec3,
    /// Of the lobe's first axis in [`Frame::new`] of the normal [turns].
    pub azimuth: f32,
}

/// Radiance that a lobe reflects toward the viewer of what arrives at a record ([`PLANES`] expansions of the same length, which may hold a higher order
/// than the lobe's).
///
/// Neither expansion is rotated. The viewer is moved to where the record's own plane would mirror what the place's mirrors, so that a lobe around
/// the mirrored direction stays where it is; what the place's plane then reflects more or less is made up for by the albedo of both.
pub fn reflected(planes: &[Vec4], table: &LobeTable, viewed: &Viewed) -> Vec3 {
    let (quads, stride) = (quads(table.order), planes.len() / PLANES);
    let (own, frame) = (Frame::new(viewed.normal), Frame::new(viewed.record_normal));
    let turned = viewed.azimuth != 0.0;
    let (angle, own_angle) = if turned { (azimuth_in(&frame, &own, viewed.azimuth), viewed.azimuth * TAU) } else { (0.0, 0.0) };
    let mirror = |direction: Vec3, normal: Vec3| 2.0 * direction.dot(normal) * normal - direction;
    let moved = about(frame.to_local(mirror(mirror(viewed.toward, viewed.normal), viewed.record_normal)), -angle);
    let [mut flat, mut rise] = [[Vec4::ZERO; MOST_QUADS]; 2];
    let (flat, rise) = (&mut flat[..quads], &mut rise[..quads]);
    table.lookup(moved, [&mut *flat, &mut *rise]);
    let albedo = |flat: &[Vec4], rise: &[Vec4]| viewed.reflectance * flat[0].x + rise[0].x;
    let lookup = albedo(flat, rise);
    let [mut own_flat, mut own_rise] = [[Vec4::ZERO; 1]; 2];
    table.lookup(about(own.to_local(viewed.toward), -own_angle), [&mut own_flat, &mut own_rise]);
    let scale = albedo(&own_flat, &own_rise) / lookup.max(Vec3::splat(1e-12));
    if turned {
        for part in [&mut *flat, &mut *rise] {
            let mut values = numbers(part, table.order);
            turn(&mut values, f64::from(angle));
            part.copy_from_slice(&fours(&values));
        }
    }
    let (x, y) = (viewed.offset.dot(frame.tangent), viewed.offset.dot(frame.bitangent));
    let has_rise = rise.iter().any(|four| *four != Vec4::ZERO);
    let mut estimate = Vec3::ZERO;
    for channel in 0..3 {
        let plane = |of: usize| &planes[(of * 3 + channel) * stride..][..quads];
        let (arriving, along_x, along_y) = (plane(0), plane(1), plane(2));
        let dot = |lobe: &[Vec4]| {
            let (mut here, mut there) = (Vec4::ZERO, Vec4::ZERO);
            for i in 0..quads {
                here += lobe[i] * arriving[i];
                there += lobe[i] * (along_x[i] * x + along_y[i] * y);
            }
            [here.element_sum(), there.element_sum()]
        };
        let [mut base, mut change] = dot(flat).map(|sum| sum * viewed.reflectance[channel]);
        if has_rise {
            let [here, there] = dot(rise);
            (base, change) = (base + here, change + there);
        }
        let [least, most] = EXTRAPOLATION;
        estimate[channel] = if base > 0.0 { (base + change).clamp(base * least, base * most) } else { base };
    }
    estimate * scale.clamp(Vec3::splat(0.25), Vec3::splat(4.0))
}

/// The same by rotating the record's expansion into the frame of the place, as the thesis does (4.5), for comparison: it takes some hundred times as long.
pub fn reflected_rotated(planes: &[Vec4], table: &LobeTable, tilting: &Tilting, viewed: &Viewed) -> Vec3 {
    let (quads, stride) = (quads(table.order), planes.len() / PLANES);
    let (own, frame) = (Frame::new(viewed.normal), Frame::new(viewed.record_normal));
    let [mut flat, mut rise] = [[Vec4::ZERO; MOST_QUADS]; 2];
    let (flat, rise) = (&mut flat[..quads], &mut rise[..quads]);
    let angle = viewed.azimuth * TAU;
    table.lookup(about(own.to_local(viewed.toward), -angle), [&mut *flat, &mut *rise]);
    let lobe = |part: &[Vec4]| {
        let mut values = numbers(part, table.order);
        turn(&mut values, f64::from(angle));
        values
    };
    let (flat, rise) = (lobe(flat), lobe(rise));
    let (x, y) = (viewed.offset.dot(frame.tangent), viewed.offset.dot(frame.bitangent));
    let axes = [own.tangent, own.bitangent, own.normal];
    let matrix = axes.map(|axis| frame.to_local(axis).as_dvec3().to_array());
    let mut sum = Vec3::ZERO;
    for channel in 0..3 {
        let plane = |of: usize| &planes[(of * 3 + channel) * stride..][..stride];
        let arriving = plane(0).iter().zip(plane(1)).zip(plane(2)).flat_map(|((here, along_x), along_y)| (*here + *along_x * x + *along_y * y).to_array());
        let arriving: Vec<f64> = arriving.map(f64::from).take(count(tilting.order())).collect();
        let seen = if viewed.normal == viewed.record_normal { arriving } else { tilting.rotate(&arriving, matrix) };
        let dot = |lobe: &[f64]| lobe.iter().zip(&seen).map(|(a, b)| a * b).sum::<f64>() as f32;
        sum[channel] = viewed.reflectance[channel] * dot(&flat) + dot(&rise);
    }
    sum
}

/// Fours of the highest order.
const MOST_QUADS: usize = quads(MOST);

/// Azimuth in a frame of an axis that has another azimuth [turns] in the place's own frame [radians].
fn azimuth_in(frame: &Frame, own: &Frame, azimuth: f32) -> f32 {
    let axis = frame.to_local(own.turned(azimuth * TAU).tangent);
    axis.y.atan2(axis.x)
}

fn about(direction: Vec3, angle: f32) -> Vec3 {
    if angle == 0.0 {
        return direction;
    }
    let (sine, cosine) = angle.sin_cos();
    Vec3::new(direction.x * cosine - direction.y * sine, direction.x * sine + direction.y * cosine, direction.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{
        harmonics::{
            Harmonics,
            reflection::{Series, Window},
            tilt::Method,
        },
        hemisphere::{Method as Compensation, Shape},
        oracle::{Objects, place, tile, trace},
    };

    const ORDER: usize = 6;
    const OBJECTS: Objects = Objects { occluder: true, wall: false };

    fn projected(table: &Table, expansion: &Expansion, point: DVec3, turn: f64) -> Projected {
        let (sine, cosine) = turn.sin_cos();
        let to_world = |v: DVec3| DVec3::new(v.x * cosine - v.y * sine, v.x * sine + v.y * cosine, v.z);
        let tile = tile(table, |direction| trace(point, to_world(direction), OBJECTS));
        expansion.project(table, &tile, 1e-9).expect("a tile of the table's size").turned(turn)
    }

    #[test]
    fn the_first_coefficients_hold_the_irradiance() {
        let table = Table::new(Shape::Hemispherical, 96, Compensation::None).expect("a table");
        let expansion = Expansion::new(&table, 2);
        let tile = tile(&table, |direction| (1.0 + direction.x, 1.0));
        let found = expansion.project(&table, &tile, 1e-9).expect("a tile");
        let irradiance = crate::math::sum::sum(&table, &tile, 1e-9).expect("a tile").irradiance.x;
        // cosθ = (1 + (2 cosθ − 1)) / 2 in terms of the first two zonal harmonics.
        let tau = std::f64::consts::TAU;
        let sum = 0.5 * tau.sqrt() * (found.0[0][0] + found.0[0][2] / 3f64.sqrt());
        assert!((sum - irradiance).abs() < 1e-6 * irradiance, "{sum}, not {irradiance}");
    }

    /// And their gradients the irradiance's along the surface: the harmonics at a wall add up to the cosine that its gradient was divided by.
    #[test]
    fn the_first_gradients_hold_the_irradiances() {
        for shape in [Shape::Hemicube, Shape::Plane { fov_degrees: 126.87 }, Shape::Hemispherical, Shape::Cosine, Shape::Concentric] {
            let table = Table::new(shape, 12, Compensation::BorderExtension).expect("a table");
            let expansion = Expansion::new(&table, 2);
            let mut tile = tile(&table, |direction| (1.0 + direction.x, 1.5 + direction.y - 0.5 * direction.x));
            tile.iter_mut().for_each(|texel| (texel[1], texel[2]) = (2.0 * texel[0], texel[3]));
            // One sample is nearer than counts.
            tile[7 * 12 + 5][3] = 0.01;
            let found = expansion.project(&table, &tile, 0.2).expect("a tile");
            let summed = crate::math::sum::sum(&table, &tile, 0.2).expect("a tile");
            for channel in 0..3 {
                let along = |plane: &[f64]| 0.5 * std::f64::consts::TAU.sqrt() * (plane[0] + plane[2] / 3f64.sqrt());
                let gradient = DVec2::new(along(&found.0[3 + channel]), along(&found.0[6 + channel]));
                let known = summed.translation[channel].truncate();
                assert!(known.length() > 0.1 && gradient.abs_diff_eq(known, 1e-6), "{shape:?} {channel}: {gradient}, not {known}");
            }
        }
    }

    #[test]
    fn frames_that_are_turned_agree() {
        let table = Table::new(Shape::Hemispherical, 64, Compensation::None).expect("a table");
        let expansion = Expansion::new(&table, ORDER);
        let (point, _) = place(3);
        let [straight, turned] = [0.0, 1.1].map(|turn| projected(&table, &expansion, point, turn));
        for plane in 0..PLANES {
            let size = straight.0[plane].iter().map(|v| v * v).sum::<f64>().sqrt();
            let apart = straight.0[plane].iter().zip(&turned.0[plane]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
            assert!(apart < 0.12 * size, "{plane}: {apart} of {size}");
        }
    }

    /// Terms that a lobe's table does not hold reflect nothing: the same as of a record of the table's own order.
    #[test]
    fn records_may_hold_more_than_a_lobe() {
        let wave = |k: usize| (k as f32 * 0.7).sin();
        for shape in [crate::math::lobe::Shape::Phong { exponent: 6.0 }, crate::math::lobe::Shape::Ward { alpha: glam::Vec2::new(0.4, 0.7) }] {
            for (own, highest) in [(1, 2), (3, 4), (4, ORDER)] {
                let series = Series { harmonics: Harmonics::Hemispherical, order: own, window: Window::None };
                let table = LobeTable::new(shape, series, 8);
                let plane = |of: usize, order: usize| fours(&(0..count(order)).map(|k| f64::from(wave(k + 31 * of))).collect::<Vec<_>>());
                let [short, long] = [own, highest].map(|order| (0..PLANES).flat_map(|of| plane(of, order)).collect::<Vec<_>>());
                let normal = Vec3::new(0.1, 0.2, 1.0).normalize();
                let viewed = Viewed {
                    toward: Vec3::new(0.48, -0.36, 0.8),
                    normal,
                    record_normal: normal,
                    offset: Vec3::new(0.2, 0.1, 0.0),
                    reflectance: Vec3::new(0.9, 0.5, 0.1),
                    azimuth: 0.2,
                };
                let tilting = |order: usize| Tilting::new(order, Method::Precomputed, 1);
                let [moved, moved_long] = [&short, &long].map(|planes| reflected(planes, &table, &viewed));
                let [rotated, rotated_long] =
                    [(&short, own), (&long, highest)].map(|(planes, order)| reflected_rotated(planes, &table, &tilting(order), &viewed));
                assert!(moved != Vec3::ZERO && moved == moved_long, "{shape:?} {own}: {moved_long}, not {moved}");
                assert!(rotated.abs_diff_eq(rotated_long, 1e-5), "{shape:?} {own}: {rotated_long}, not {rotated}");
            }
        }
    }

    #[test]
    fn gradients_in_proportion_and_in_fours() {
        let plane = |value: f64| (0..count(2)).map(|k| if k == 1 { value } else { 0.0 }).collect::<Vec<_>>();
        let projected = Projected([3.0, 3.0, 3.0, 6.0, 6.0, 6.0, 8.0, 8.0, 8.0].map(plane));
        assert!((projected.relative_gradient() - 10.0 / 3.0).abs() < 1e-12);
        let fours = projected.in_fours();
        assert!(fours.len() == PLANES * quads(2) && Projected::of_fours(&fours, 2).0 == projected.0);
    }

    /// Under a sky of one radiance a place shines by its albedo, wherever the record's plane is. And what a place mirrors is what the record's plane mirrors
    /// to a viewer who stands accordingly, but for the two albedos.
    #[test]
    fn viewers_are_moved_to_where_the_record_mirrors_the_same() {
        let series = Series { harmonics: Harmonics::Hemispherical, order: 4, window: Window::None };
        let mirror = |direction: Vec3, normal: Vec3| direction - 2.0 * (direction - normal * direction.dot(normal));
        for shape in [crate::math::lobe::Shape::Phong { exponent: 6.0 }, crate::math::lobe::Shape::Microfacets { alpha: 0.5 }] {
            let table = LobeTable::new(shape, series, 32);
            let plane = |of: usize| fours(&(0..count(4)).map(|k| if k == 0 { 4.0 } else { (k as f64 * 0.7 + of as f64).sin() }).collect::<Vec<_>>());
            let constant = fours(&(0..count(4)).map(|k| f64::from(u8::from(k == 0))).collect::<Vec<_>>());
            let dark = vec![Vec4::ZERO; quads(4)];
            let [light, sky]: [Vec<Vec4>; 2] = [
                (0..PLANES).flat_map(|of| if of < 3 { plane(of) } else { dark.clone() }).collect(),
                (0..PLANES).flat_map(|of| if of < 3 { constant.clone() } else { dark.clone() }).collect(),
            ];
            let (normal, record_normal) = (Vec3::new(0.1, 0.2, 1.0).normalize(), Vec3::new(-0.1, 0.1, 1.0).normalize());
            let toward = Vec3::new(0.48, -0.36, 0.8);
            let viewed = Viewed { toward, normal, record_normal, offset: Vec3::ZERO, reflectance: Vec3::new(0.9, 0.5, 0.1), azimuth: 0.0 };
            let moved = Viewed { toward: mirror(mirror(toward, normal), record_normal), normal: record_normal, ..viewed };
            let lookup = |of: &Viewed| {
                let [mut flat, mut rise] = [vec![Vec4::ZERO; quads(4)], vec![Vec4::ZERO; quads(4)]];
                table.lookup(Frame::new(of.normal).to_local(of.toward), [&mut flat, &mut rise]);
                let times = |lobe: &[Vec4], plane: &[Vec4]| lobe.iter().zip(plane).map(|(a, b)| a.dot(*b)).sum::<f32>();
                let reflects = |planes: &[Vec4]| {
                    Vec3::from_array(std::array::from_fn(|c| {
                        let plane = &planes[c * quads(4)..][..quads(4)];
                        of.reflectance[c] * times(&flat, plane) + times(&rise, plane)
                    }))
                };
                [reflects(&sky), reflects(&light)]
            };
            let [[albedo, _], [moved_albedo, reflects]] = [lookup(&viewed), lookup(&moved)];
            let near = |found: Vec3, expected: Vec3| assert!(found.abs_diff_eq(expected, 1e-4 * expected.max_element()), "{shape:?}: {found}, not {expected}");
            near(reflected(&sky, &table, &viewed), albedo);
            near(reflected(&light, &table, &moved), reflects);
            near(reflected(&light, &table, &viewed), reflects * albedo / moved_albedo);
        }
    }

    /// On the record's own plane there is nothing to rotate: both ways reflect the same, around every axis of a brushed lobe, also where gradients foretell more
    /// than counts.
    #[test]
    fn where_planes_are_the_same_both_ways_reflect_the_same() {
        let series = Series { harmonics: Harmonics::Hemispherical, order: 4, window: Window::None };
        let planes: Vec<Vec4> = (0..PLANES)
            .flat_map(|of| fours(&(0..count(4)).map(|k| if k == 0 && of < 3 { 4.0 } else { 0.4 * (k as f64 * 0.7 + of as f64).sin() }).collect::<Vec<_>>()))
            .collect();
        let tilting = Tilting::new(4, Method::Precomputed, 1);
        let normal = Vec3::new(0.1, 0.2, 1.0).normalize();
        let frame = Frame::new(normal);
        for shape in [crate::math::lobe::Shape::Ward { alpha: glam::Vec2::new(0.4, 0.7) }, crate::math::lobe::Shape::Microfacets { alpha: 0.5 }] {
            let table = LobeTable::new(shape, series, 32);
            let mut seen = Vec::new();
            for (azimuth, offset) in [(0.0, 0.0), (0.0, 0.3), (0.2, 0.3), (-0.15, 0.2), (0.4, -0.3)] {
                let offset = offset * (frame.tangent - 0.6 * frame.bitangent);
                let viewed =
                    Viewed { toward: Vec3::new(0.48, -0.36, 0.8), normal, record_normal: normal, offset, reflectance: Vec3::new(0.9, 0.5, 0.1), azimuth };
                let [moved, rotated] = [reflected(&planes, &table, &viewed), reflected_rotated(&planes, &table, &tilting, &viewed)];
                assert!(moved.min_element() > 0.0 && moved.abs_diff_eq(rotated, 1e-3 * moved.max_element()), "{shape:?} {azimuth}: {moved}, not {rotated}");
                seen.push(moved);
            }
            let differ = |a: usize, b: usize| !seen[a].abs_diff_eq(seen[b], 1e-3 * seen[a].max_element());
            assert!(differ(0, 1) && differ(1, 2) == shape.is_anisotropic(), "{seen:?}");
        }
        for angle in [0.0, 0.3, -2.0] {
            let direction = Vec3::new(0.48, -0.36, 0.8);
            assert!(about(direction, angle).abs_diff_eq(glam::Quat::from_rotation_z(angle) * direction, 1e-6));
            assert!((azimuth_in(&frame, &frame, angle / TAU) - angle).abs() < 1e-5);
        }
    }

    /// Gradients that foretell more, or less, than counts change what is reflected by as much as counts.
    #[test]
    fn what_is_foretold_is_bounded() {
        let table = LobeTable::new(
            crate::math::lobe::Shape::Phong { exponent: 6.0 },
            Series { harmonics: Harmonics::Hemispherical, order: 2, window: Window::None },
            8,
        );
        let frame = Frame::new(Vec3::Z);
        let seen = |change: f64| {
            let plane = |of: usize| fours(&[[3.0, change, 0.0][of / 3], 0.0, 0.0, 0.0]);
            let planes: Vec<Vec4> = (0..PLANES).flat_map(plane).collect();
            let viewed = Viewed {
                toward: Vec3::new(0.48, -0.36, 0.8),
                normal: Vec3::Z,
                record_normal: Vec3::Z,
                offset: frame.tangent,
                reflectance: Vec3::ONE,
                azimuth: 0.0,
            };
            reflected(&planes, &table, &viewed)
        };
        let [least, most] = EXTRAPOLATION;
        let still = seen(0.0);
        for (change, share) in [(1.5, 1.5), (-0.9, 0.7), (1e3, most), (-1e3, least)] {
            assert!(still.min_element() > 0.0 && seen(change).abs_diff_eq(still * share, 1e-5 * still.max_element()), "{change}: {}, {still}", seen(change));
        }
    }

    /// Against central differences of coefficients that a fine tile projects to.
    #[test]
    fn gradients_are_finite_differences() {
        for (shape, limit) in [(Shape::Hemispherical, 0.10), (Shape::Plane { fov_degrees: 126.87 }, 0.15), (Shape::Cosine, 0.10), (Shape::Concentric, 0.10)] {
            let table = Table::new(shape, 96, Compensation::BorderExtension).expect("a table");
            let fine = Table::new(Shape::Hemispherical, 320, Compensation::None).expect("a table");
            let (expansion, truth) = (Expansion::new(&table, ORDER), Expansion::new(&fine, ORDER));
            let (mut error, mut size) = (0.0, 0.0);
            for (point, _) in (0..4).map(place) {
                let found = projected(&table, &expansion, point, 0.0);
                for (axis, step) in [DVec3::X, DVec3::Y].into_iter().zip([3, 6]) {
                    let h = 0.03;
                    let [before, after] = [-h, h].map(|h| projected(&fine, &truth, point + axis * h, 0.0));
                    for (i, gradient) in found.0[step].iter().enumerate() {
                        let known = (after.0[0][i] - before.0[0][i]) / (2.0 * h);
                        error += (gradient - known).powi(2);
                        size += known * known;
                    }
                }
            }
            let relative = (error / size).sqrt();
            assert!(relative < limit, "{shape:?}: {relative}");
        }
    }
}
