//! What a ray sees of a surface.

use super::{Camera, LightKind, Material, Rgb, Scene, Triangle, at_weights, surface_offset};
use crate::math::{frame::Frame, lobe::Lobe};
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Where a ray starts, and where it goes; of any length.
#[derive(Clone, Copy)]
pub struct Ray {
    pub origin: Vec3,
    pub direction: Vec3,
    /// Of a ray through a pixel, what the direction changes by to the next, to the right and down; zero of one that stands for itself alone.
    pub sides: [Vec3; 2],
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy)]
pub struct Spot {
    /// Barycentric weights of corners 1 and 2.
    pub barycentric: Vec2,
    /// What they change by over a pixel, to the right and down; zero of a single point.
    sides: [Vec2; 2],
}

impl From<Vec2> for Spot {
    fn from(barycentric: Vec2) -> Self {
        Self { barycentric, sides: [Vec2::ZERO; 2] }
    }
}

impl Camera {
    /// The ray through the sample of a pixel.
    pub fn ray(&self, size: [u32; 2], pixel: [u32; 2]) -> Ray {
        Ray { origin: self.eye, direction: self.pixel_ray(size, pixel), sides: self.pixel_sides(size) }
    }
}

impl Ray {
    /// One that stands for itself alone.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, sides: [Vec3::ZERO; 2] }
    }

    /// The nearest point on the ray's line.
    fn nearest(&self, point: Vec3) -> Vec3 {
        self.origin + self.along(point - self.origin)
    }

    /// The part of a way along the ray.
    fn along(&self, way: Vec3) -> Vec3 {
        self.direction * (way.dot(self.direction) / self.direction.length_squared())
    }
}

/// A place on a surface, from the side that a ray saw.
#[derive(Clone, Copy)]
pub struct Surface {
    pub position: Vec3,
    /// Unit normal of the plane, on the side seen.
    pub face: Vec3,
    /// Unit shading normal, on the side seen.
    pub normal: Vec3,
    /// Of the diffuse part, toward where the ray came from.
    pub reflectance: Rgb,
    pub emission: Rgb,
    pub glossy: Option<Gloss>,
}

/// The lobe of a place, and the way to where the ray came from.
#[derive(Clone, Copy)]
pub struct Gloss {
    pub lobe: Lobe,
    pub frame: Frame,
    /// In the frame.
    pub outgoing: Vec3,
}

/// How far beside its ray a point may be by rounding alone: so much of its distance, and of its largest coordinate.
const BESIDE_RAY: [f32; 2] = [5e-7, 2.5e-7];

/// A triangle whose area is less than this share of its longest edge squared, doubled, is an edge: rounding turns its plane around it.
const SLIVER: f32 = 1e-4;

/// The sine between a plane and a ray below which rounding decides where they meet.
const GRAZING: f32 = 1e-5;

impl Surface {
    /// Where rays that leave it start; `extent` is the scene's.
    #[inline(always)]
    pub fn start(&self, extent: f32) -> Vec3 {
        self.position + self.face * surface_offset(extent, self.position)
    }

    /// What is reflected toward where the ray came from of light from a unit direction [1/sr].
    #[inline(always)]
    pub fn response(&self, toward: Vec3) -> Vec3 {
        self.reflectance * FRAC_1_PI + self.glossy.map_or(Vec3::ZERO, |gloss| gloss.value(toward))
    }

    /// The way to a light from a point of the surface, how far it is, and what is reflected of it if nothing stands between [W m⁻² sr⁻¹]; none where nothing is.
    pub fn reflected(&self, light: &LightKind, from: Vec3) -> Option<(Vec3, f32, Vec3)> {
        let (toward, distance, irradiance) = light.toward(from)?;
        let cosine = self.normal.dot(toward);
        if cosine <= 0.0 || self.face.dot(toward) <= 0.0 {
            return None;
        }
        let reflected = irradiance.as_vec3() * cosine * self.response(toward);
        (reflected.max_element() > 0.0).then_some((toward, distance, reflected))
    }
}

impl Gloss {
    /// What the lobe reflects of light from a unit direction [1/sr].
    #[inline(always)]
    pub fn value(&self, toward: Vec3) -> Vec3 {
        self.lobe.value(self.outgoing, self.frame.to_local(toward))
    }

    /// How densely the lobe draws a unit direction [1/sr].
    #[inline(always)]
    pub fn density(&self, toward: Vec3) -> f32 {
        self.lobe.density(self.outgoing, self.frame.to_local(toward))
    }
}

/// Cosine to a normal that is turned away from who sees it, as at the outline of a smooth ball.
const TURNED_AWAY: f32 = 0.01;

/// A direction in a frame, on the side of its normal.
fn facing(direction: Vec3) -> Vec3 {
    if direction.z > 0.0 { direction } else { direction.truncate().extend(TURNED_AWAY).normalize() }
}

impl Scene {
    /// What a ray sees where it meets a triangle.
    pub fn surface(&self, triangle: u32, barycentric: Vec2, ray: Ray) -> Surface {
        let lit = self.lit_surface(triangle, barycentric, ray);
        Surface { reflectance: lit.glossy.map_or(lit.reflectance, |gloss| lit.reflectance * gloss.lobe.leaves(gloss.outgoing.z)), ..lit }
    }

    /// The same for light that arrives along the ray: the lobe takes its share of the diffuse part by where light leaves to, [`Lobe::leaves`], which is left to do.
    pub fn lit_surface(&self, triangle: u32, barycentric: Vec2, ray: Ray) -> Surface {
        let (plain, base, spot) = self.without_lobe(triangle, barycentric, ray, true);
        let (number, triangle) = (triangle, &self.triangles[triangle as usize]);
        let material = &self.materials[triangle.material as usize];
        let facets = self.colour(material.maps.facets, (number, material.maps.charts.facets), spot);
        let reflection = material.reflection_with(material.reflectance * base, facets);
        let glossy = reflection.lobe.map(|lobe| {
            let frame = if lobe.shape.is_anisotropic() { triangle.tangent_frame(plain.normal) } else { Frame::new(plain.normal) };
            Gloss { lobe, frame, outgoing: facing(frame.to_local(-ray.direction.normalize())) }
        });
        Surface { reflectance: reflection.diffuse, glossy, ..plain }
    }

    /// What a ray that meets a triangle sees, with its lobe or with what stands for that.
    pub fn seen(&self, triangle: u32, ray: Ray, lobes: bool) -> Surface {
        let barycentric = self.triangles[triangle as usize].barycentric(ray);
        if lobes { self.surface(triangle, barycentric, ray) } else { self.diffuse_surface(triangle, barycentric, ray) }
    }

    /// The same where nothing renders lobes: [`Material::albedo`](super::Material::albedo) stands for them.
    pub fn diffuse_surface(&self, triangle: u32, barycentric: Vec2, ray: Ray) -> Surface {
        self.without_lobe(triangle, barycentric, ray, false).0
    }

    /// The surface by its albedo, what multiplies its base colour there, and where that is; whether its lobe is to follow.
    fn without_lobe(&self, triangle: u32, barycentric: Vec2, ray: Ray, lobes: bool) -> (Surface, Rgb, Spot) {
        let (number, triangle) = (triangle, &self.triangles[triangle as usize]);
        let material = &self.materials[triangle.material as usize];
        let face = triangle.face_normal();
        let side = if face.dot(ray.direction) > 0.0 { -1.0 } else { 1.0 };
        let position = triangle.place(barycentric, ray);
        let spot = triangle.spot(barycentric, position, ray);
        let base = self.colour(material.texture, (number, 0), spot) * triangle.tint(barycentric);
        let (albedo, is_base) = material.albedo();
        let surface = Surface {
            position,
            face: face * side,
            normal: self.normal(number, spot, (-side * ray.direction, lobes)) * side,
            reflectance: if is_base { albedo * base } else { albedo },
            emission: self.emission(number, spot),
            glossy: None,
        };
        (surface, base, spot)
    }

    /// What a texture has at a place of a triangle by one of its charts; white where there is none.
    fn colour(&self, texture: Option<u32>, (triangle, chart): (u32, u32), spot: Spot) -> Rgb {
        let Some(texture) = texture.map(|texture| &self.textures[texture as usize]) else { return Vec3::ONE };
        let [a, b, c] = self.uvs(triangle, chart);
        let uv = at_weights([a, b, c], spot.barycentric);
        if spot.sides == [Vec2::ZERO; 2] {
            return texture.sample(uv).truncate();
        }
        texture.sample_over(uv, spot.sides.map(|side| (b - a) * side.x + (c - a) * side.y))
    }

    /// Unit shading normal at a place of a triangle, on the front side, as its normal map bends it. Of what has a lobe, if lobes are rendered, not so far from the
    /// way to where it is seen from, of any length, that its mirror image would be below the surface.
    pub fn normal(&self, triangle: u32, spot: impl Into<Spot>, (toward, lobes): (Vec3, bool)) -> Vec3 {
        let spot @ Spot { barycentric, .. } = spot.into();
        let (number, triangle) = (triangle, &self.triangles[triangle as usize]);
        let Material { maps, glossy, .. } = &self.materials[triangle.material as usize];
        let toward = if lobes && glossy.is_some() { Some(toward.normalize_or_zero()) } else { None };
        let reflecting = |normal: Vec3, plain: Vec3| toward.map_or(normal, |toward| reflecting(normal, plain, toward));
        let smooth = reflecting(triangle.normal(barycentric), triangle.face_normal());
        if maps.normal.is_none() {
            return smooth;
        }
        let texel = self.colour(maps.normal, (number, maps.charts.normal), spot);
        reflecting(Triangle::bent(self.map_frame(number, maps.charts.normal, barycentric, smooth), smooth, texel, maps.normal_scale), smooth)
    }

    /// The frame of a map of normals at a place of a triangle: along the file's tangents, where it has any.
    fn map_frame(&self, number: u32, chart: u32, barycentric: Vec2, normal: Vec3) -> Option<(Frame, f32)> {
        let (triangle, uvs) = (&self.triangles[number as usize], self.uvs(number, chart));
        let Some(&[a, b, c]) = self.tangents.get(number as usize) else { return triangle.texture_frame(uvs, normal) };
        triangle.frame_along(a + (b - a) * barycentric.x + (c - a) * barycentric.y, uvs, normal)
    }

    /// Radiance that leaves a place of a triangle [W m⁻² sr⁻¹].
    pub fn emission(&self, triangle: u32, spot: impl Into<Spot>) -> Rgb {
        let material = &self.materials[self.triangles[triangle as usize].material as usize];
        material.emission * self.colour(material.maps.emission, (triangle, material.maps.charts.emission), spot.into())
    }

    /// The mean over a triangle, of an emission map by samples about as far apart as its texels.
    pub fn mean_emission(&self, triangle: u32) -> Rgb {
        let material = &self.materials[self.triangles[triangle as usize].material as usize];
        let Some(map) = material.maps.emission else { return material.emission };
        let texture = &self.textures[map as usize];
        let uvs = self.uvs(triangle, material.maps.charts.emission);
        let [s, t] = [1, 2].map(|corner| (uvs[corner] - uvs[0]) * Vec2::new(texture.width as f32, texture.height as f32));
        let texels = 0.5 * s.perp_dot(t).abs();
        // Coordinates may be so large that their area is no number.
        let samples = if texels.is_nan() { MOST_SAMPLES } else { (4.0 * texels).clamp(LEAST_SAMPLES, MOST_SAMPLES) } as u32;
        let place = |at: u32| {
            let at = at as f32 + 0.5;
            let [u, v] = [at / samples as f32, (at * 0.618_034).fract()];
            let root = u.sqrt();
            Vec2::new(root * (1.0 - v), root * v)
        };
        (0..samples).map(|at| self.emission(triangle, place(at))).sum::<Vec3>() / samples as f32
    }
}

/// A normal that is bent away from a plain one, turned back as far as it takes: bent by half of the angle that the way to the eye has to the surface, it mirrors that way along
/// the surface.
fn reflecting(bent: Vec3, plain: Vec3, toward: Vec3) -> Vec3 {
    let [cosine, of_plain] = [bent, plain].map(|normal| normal.dot(toward));
    if of_plain <= 0.0 {
        return plain;
    }
    let least = 0.5 * of_plain;
    if cosine >= least { bent } else { bent.lerp(plain, (least - cosine) / (of_plain - cosine)).normalize_or(plain) }
}

/// Of a triangle's mean emission.
const LEAST_SAMPLES: f32 = 64.0;
const MOST_SAMPLES: f32 = 65_536.0;

impl Triangle {
    /// Barycentric weights of corners 1 and 2 where a ray, known to meet the triangle, meets it. What rounding puts outside is moved to the edge.
    pub fn barycentric(&self, ray: Ray) -> Vec2 {
        let [a, b, c] = self.positions;
        let (e1, e2, s) = (b - a, c - a, ray.origin - a);
        let p = ray.direction.cross(e2);
        let determinant = e1.dot(p);
        let inverse = if determinant == 0.0 { 0.0 } else { 1.0 / determinant };
        let weights = (Vec2::new(s.dot(p), ray.direction.dot(s.cross(e1))) * inverse).clamp(Vec2::ZERO, Vec2::ONE);
        weights / weights.element_sum().max(1.0)
    }

    /// Where a ray meets the triangle, at these weights and this position: how they change is Möller and Trumbore's way to them, derived by the direction.
    fn spot(&self, barycentric: Vec2, position: Vec3, ray: Ray) -> Spot {
        if ray.sides == [Vec3::ZERO; 2] {
            return barycentric.into();
        }
        let [a, b, c] = self.positions;
        let [p, q] = [ray.direction.cross(c - a), (b - a).cross(ray.direction)];
        let determinant = (b - a).dot(p);
        let distance = position.distance(ray.origin) / ray.direction.length();
        let scale = if determinant == 0.0 { 0.0 } else { distance / determinant };
        Spot { barycentric, sides: ray.sides.map(|side| Vec2::new(side.dot(p), side.dot(q)) * scale) }
    }

    /// The point at these weights, as the ray meets it. Weights of slivers, and of triangles far larger than the way to them, are rounded so that their point is
    /// beside the ray, by pixels; such a point moves onto the ray.
    pub fn place(&self, barycentric: Vec2, ray: Ray) -> Vec3 {
        // From the corners rather than along the ray: the error stays in the plane.
        let position = self.position(barycentric);
        let rounding = BESIDE_RAY[0] * position.distance(ray.origin) + BESIDE_RAY[1] * position.abs().max_element();
        let foot = ray.nearest(position);
        if position.distance(foot) <= rounding { position } else { self.on_plane(position, foot, ray).unwrap_or_else(|| self.beside_edge(ray)) }
    }

    /// Where the ray meets the plane through a point of it, whose foot on the ray is known. None where the triangle is too thin to have a plane, or seen along it.
    fn on_plane(&self, point: Vec3, foot: Vec3, ray: Ray) -> Option<Vec3> {
        let [a, b, c] = self.positions;
        let (plane, longest) = ((b - a).cross(c - a), a.distance(b).max(b.distance(c)).max(c.distance(a)));
        let facing = plane.dot(ray.direction);
        let has_plane = plane.length() > SLIVER * longest * longest && facing.abs() > GRAZING * plane.length() * ray.direction.length();
        let way = ray.direction * (plane.dot(point - foot) / facing);
        (has_plane && way.length() <= longest).then(|| foot + way)
    }

    /// Where the ray is nearest to one of the edges.
    fn beside_edge(&self, ray: Ray) -> Vec3 {
        let [a, b, c] = self.positions;
        let nearest = |[from, to]: [Vec3; 2]| {
            let aside = |way: Vec3| way - ray.along(way);
            let (start, edge) = (aside(from - ray.origin), aside(to - from));
            let share = (-start.dot(edge) / edge.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
            ((start + edge * share).length_squared(), from + (to - from) * share)
        };
        let [first, second, third] = [[a, b], [b, c], [c, a]].map(nearest);
        let (_, point) = [second, third].into_iter().fold(first, |best, next| if next.0 < best.0 { next } else { best });
        ray.nearest(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec2, DVec3};
    use proptest::prelude::*;

    /// A hundredth of a pixel of a picture that is 1,000 pixels and 60 degrees wide [radians].
    const HUNDREDTH: f64 = 0.01 * 1.05 / 1000.0;

    /// How a triangle lies and from where it is seen.
    #[derive(Debug, Clone, Copy)]
    struct Setting {
        /// Along its longest edge, across that in its plane, and toward the eye; unit vectors.
        along: DVec3,
        across: DVec3,
        toward: DVec3,
        /// Of the point that is seen.
        weights: DVec2,
    }

    /// Seen at a sine of `least` or more from its plane.
    fn setting(least: f64) -> impl Strategy<Value = Setting> {
        let turn = || 0.0..std::f64::consts::TAU;
        (turn(), turn(), -1.0..1.0f64, least..1.0, turn(), [0.0..1.0, 0.0..1.0f64]).prop_map(|(about, roll, height, facing, from, weights)| {
            let flat = (1.0 - height * height).sqrt();
            let normal = DVec3::new(flat * about.cos(), flat * about.sin(), height);
            let (x, y) = normal.any_orthonormal_pair();
            let around = |turn: f64| x * turn.cos() + y * turn.sin();
            let weights = DVec2::from_array(weights);
            let weights = if weights.element_sum() > 1.0 { 1.0 - weights } else { weights };
            let toward = normal * facing + around(from) * (1.0 - facing * facing).sqrt();
            Setting { along: around(roll), across: normal.cross(around(roll)), toward, weights }
        })
    }

    /// Barycentric weights where a ray meets the plane of a triangle, inside or not.
    fn weights_on_plane(triangle: &Triangle, ray: Ray) -> Vec2 {
        let [a, b, c] = triangle.positions.map(|corner| (corner - ray.origin).as_dvec3());
        // The ray by the corners: what each has of their sum.
        let shares = glam::DMat3::from_cols(a, b, c).inverse() * ray.direction.as_dvec3();
        DVec2::new(shares.y, shares.z).as_vec2() / shares.element_sum() as f32
    }

    impl Setting {
        /// A triangle of a length and a width, the ray from an eye so far away to a point of it, and that point.
        fn seen(self, length: f64, width: f64, away: f64) -> (Triangle, Ray, DVec3) {
            let corners = [DVec3::ZERO, self.along * length, self.along * (0.4 * length) + self.across * width].map(|corner| corner.as_vec3());
            let [a, b, c] = corners.map(|corner| corner.as_dvec3());
            let point = a + (b - a) * self.weights.x + (c - a) * self.weights.y;
            let origin = (point + self.toward * away).as_vec3();
            let triangle = Triangle { positions: corners, normals: [Vec3::ZERO; 3], uvs: [Vec2::ZERO; 3], tints: Default::default(), material: 0 };
            (triangle, Ray::new(origin, (point - origin.as_dvec3()).as_vec3()), point)
        }
    }

    proptest! {
        /// Slivers down to nothing, triangles far larger than the way to them, and far smaller: what a pixel sees is on its ray.
        #[test]
        fn places_are_on_their_ray(length in -4.0..6.0f64, thin in -9.0..0.0f64, away in -4.0..4.0f64, setting in setting(0.0)) {
            let length = 10f64.powf(length);
            let (triangle, ray, _) = setting.seen(length, length * 10f64.powf(thin), length * 10f64.powf(away));
            let place = triangle.place(triangle.barycentric(ray), ray);
            let [way, direction] = [place.as_dvec3() - ray.origin.as_dvec3(), ray.direction.as_dvec3()];
            let beside = way.cross(direction).length() / direction.length();
            // Nothing is nearer than its coordinates can say.
            let rounding = 5e-7 * f64::from(place.abs().max_element().max(ray.origin.abs().max_element()));
            prop_assert!(beside <= HUNDREDTH * way.length() + rounding, "{beside} beside at {}", way.length());
        }

        /// How far a pixel reaches on a triangle, by where the rays beside it meet its plane.
        #[test]
        fn sides_are_what_weights_change_by(turn in -1.0..1.0f32, setting in setting(0.2)) {
            let (triangle, ray, _) = setting.seen(1.0, 0.5, 3.0);
            let aside = ray.direction.any_orthogonal_vector().normalize() * 1e-2;
            let sides = [aside, ray.direction.cross(aside) + ray.direction * (1e-3 * turn)];
            let barycentric = triangle.barycentric(ray);
            let spot = triangle.spot(barycentric, triangle.place(barycentric, ray), Ray { sides, ..ray });
            for (side, found) in sides.into_iter().zip(spot.sides) {
                let [before, after] = [-0.5, 0.5].map(|share| weights_on_plane(&triangle, Ray::new(ray.origin, ray.direction + side * share)));
                prop_assert!(found.distance(after - before) < 0.01 * found.length() + 1e-4, "{found}, not {}", after - before);
            }
        }

        /// Where the plane is sound and is not seen along it, the place is also at the right distance.
        #[test]
        fn places_are_on_their_triangle(thin in -3.0..0.0f64, away in -2.0..2.0f64, setting in setting(0.1)) {
            let (triangle, ray, point) = setting.seen(1.0, 10f64.powf(thin), 10f64.powf(away));
            let distance = triangle.place(triangle.barycentric(ray), ray).as_dvec3().distance(point);
            prop_assert!(distance < 3e-6 * 10f64.powf(away).max(1.0) / 10f64.powf(thin), "{distance} apart");
        }
    }

    /// A sliver whose weights, clamped, are those of another place of it: seen in Sibenik, where such a pixel asked for records without end.
    #[test]
    fn a_sliver_is_seen_where_it_is() {
        let triangle = |width: f32| {
            let positions = [Vec3::new(-3.0, 0.37, 11.0), Vec3::new(4.0, 0.61, 9.0), Vec3::new(0.5, 0.49 + width, 10.0)];
            Triangle { positions, normals: [Vec3::ZERO; 3], uvs: [Vec2::ZERO; 3], tints: Default::default(), material: 0 }
        };
        for width in [0.0, 1e-7, 1e-6, 1e-5, 1e-4] {
            let triangle = triangle(width);
            for share in [0.1, 0.3, 0.5, 0.7, 0.9] {
                let point = triangle.positions[0].lerp(triangle.positions[1], share);
                let ray = Ray::new(Vec3::new(0.3, 0.2, 0.1), point - Vec3::new(0.3, 0.2, 0.1));
                let place = triangle.place(triangle.barycentric(ray), ray);
                assert!(place.distance(point) < 1e-3 + 2.0 * width, "{width}, {share}: {place} instead of {point}");
            }
        }
    }
}
