//! A scene while it is being read: double precision, the file's own coordinates, textures not yet decoded.

use super::{
    error::{Problem, SceneError},
    files::Files,
    image::{self, TextureSource},
};
use crate::scene::{
    animation::{Animation, Motion, Moving, Placement, Post, Stand},
    model::*,
    shape::Shape,
};
use glam::{BVec3, DMat3, DMat4, DVec3, Vec2, Vec3};
use std::{
    collections::{HashMap, HashSet},
    ops::Range,
    sync::Arc,
};

/// The most triangles that a scene may have.
pub const MAX_TRIANGLES: usize = 16_000_000;

/// The extents that single precision serves: beyond them the squares of areas overflow or vanish [scene units].
pub(in crate::scene) const EXTENT_RANGE: std::ops::RangeInclusive<f64> = 1e-4..=4e9;

/// Alpha below which there is a hole, where nothing else is said.
pub(super) const HALF: f32 = 0.5;

/// Where shading normals come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::scene) enum Normals {
    /// The file's, and the face's where the file has none.
    File,
    /// Every triangle is flat.
    Face,
    /// The mean over the faces around a corner whose planes differ by at most this angle [radians], weighted by their angle there.
    Smooth(f64),
}

/// A triangle in the file's coordinates.
#[derive(Debug, Clone, Copy)]
pub(in crate::scene) struct Face {
    pub positions: [DVec3; 3],
    /// Zero where the file has none.
    pub normals: [Vec3; 3],
    pub uvs: [Vec2; 3],
    pub tints: [Tint; 3],
    pub material: u32,
}

/// All that the loaders gather, in the file's coordinates.
#[derive(Default)]
pub(super) struct Draft {
    pub faces: Vec<Face>,
    pub materials: Vec<Material>,
    /// Texture coordinates beside the faces' own, as [`Scene::charts`]; where one is shorter than the faces, the rest have none.
    pub charts: Vec<Vec<[Vec2; 3]>>,
    /// Likewise, as [`Scene::tangents`].
    pub tangents: Vec<[Vec3; 3]>,
    /// Of the faces, in their order.
    pub objects: Vec<Object>,
    pub textures: Vec<TextureSource>,
    /// Lights and where they stand; the position inside the light is filled in at the end.
    pub lights: Vec<(Light, DVec3)>,
    /// Cameras and where they stand, likewise.
    pub cameras: Vec<(Camera, DVec3)>,
    camera_names: HashSet<String>,
    /// What moves, by numbers of the lists above.
    pub animation: Animation,
    /// What the faces to come move with, and the first that does.
    run: (Option<usize>, usize),
    pub environment: Option<Environment>,
    pub notes: Vec<String>,
}

impl Normals {
    /// Those of faces as the file has them, zero where they are the plane's own.
    pub fn of(self, faces: &[Face]) -> Vec<[Vec3; 3]> {
        match self {
            Self::File => faces.iter().map(|face| face.normals).collect(),
            Self::Face => vec![[Vec3::ZERO; 3]; faces.len()],
            Self::Smooth(angle) => smooth_normals(faces, angle),
        }
    }
}

impl Face {
    /// A flat triangle without texture coordinates.
    pub fn flat(positions: [DVec3; 3], material: u32) -> Self {
        Self { positions, normals: [Vec3::ZERO; 3], uvs: [Vec2::ZERO; 3], tints: Default::default(), material }
    }

    /// The triangle under an affine map; mirroring swaps two corners so that the front stays the front.
    pub fn transformed(&self, map: &DMat4, normal_map: &DMat3) -> Self {
        let mut face = *self;
        face.positions = self.positions.map(|p| map.transform_point3(p));
        face.normals = self.normals.map(|n| (*normal_map * n.as_dvec3()).normalize_or_zero().as_vec3());
        if mirrors(map) {
            face.positions.swap(1, 2);
            face.normals.swap(1, 2);
            face.uvs.swap(1, 2);
            face.tints.swap(1, 2);
        }
        face
    }

    fn cross(&self) -> DVec3 {
        let [a, b, c] = self.positions;
        (b - a).cross(c - a)
    }
}

/// Puts what corners have in its place; what was left out before has none.
fn put<T: Copy + Default>(all: &mut Vec<[T; 3]>, at: usize, corners: [T; 3]) {
    if all.len() <= at {
        all.resize(at + 1, Default::default());
    }
    all[at] = corners;
}

/// Whether an affine map turns the front of triangles to their back, so that two corners are swapped.
pub(in crate::scene) fn mirrors(map: &DMat4) -> bool {
    map.determinant() < 0.0
}

/// The map of normals that belongs to an affine map of positions: the inverse transpose, up to a positive factor.
pub(in crate::scene) fn normal_map(map: &DMat4) -> DMat3 {
    let linear = DMat3::from_mat4(*map);
    // The matrix of cofactors: it exists for flattening maps too, and its sign follows the mirroring.
    let cofactors = DMat3::from_cols(linear.y_axis.cross(linear.z_axis), linear.z_axis.cross(linear.x_axis), linear.x_axis.cross(linear.y_axis));
    if linear.determinant() < 0.0 { -cofactors } else { cofactors }
}

impl Draft {
    /// Adds a triangle; `object` names it in errors.
    ///
    /// # Errors
    /// A position that is no finite number, or one triangle too many.
    pub fn push(&mut self, face: Face, object: impl Fn() -> String) -> Result<(), SceneError> {
        if !face.positions.iter().all(|p| p.is_finite()) {
            return Err(SceneError::new(Problem::NonFinite, format!("{} has a corner that is no finite number", object()))
                .help("export the object again, or take it out of the file"));
        }
        self.expect_room(1)?;
        self.faces.push(face);
        Ok(())
    }

    /// Says that the faces from one on are an object; those that were said to be others are parts of it.
    pub fn end_object(&mut self, name: impl Into<String>, first: usize) {
        while self.objects.pop_if(|object| object.triangles.start >= first).is_some() {}
        if first < self.faces.len() {
            self.objects.push(Object { name: name.into(), triangles: first..self.faces.len() });
        }
    }

    /// Says with which node of the animation the faces to come move; tells with which those before did.
    pub fn move_with(&mut self, node: Option<usize>) -> Option<usize> {
        if node == self.run.0 {
            return node;
        }
        self.end_run(self.faces.len());
        std::mem::replace(&mut self.run, (node, self.faces.len())).0
    }

    /// Where a place is, on what a map says. If it moves, so do the faces to come.
    pub fn place(&mut self, name: impl FnOnce() -> String, map: &DMat4, placement: Placement) -> DMat4 {
        let still = *map * placement.at_rest();
        // What is flat whenever it is seen has no way back from the world to its own coordinates, and nothing to show.
        if !placement.moves() || still.determinant() == 0.0 || !still.is_finite() {
            return still;
        }
        let number = self.animation.add(name(), self.run.0, map, placement);
        self.move_with(Some(number));
        self.animation.nodes[number].rest
    }

    fn end_run(&mut self, end: usize) {
        if let (Some(node), first) = self.run
            && first < end
        {
            self.animation.moving.push(Moving { triangles: first..end, motion: Motion::With(node) });
        }
    }

    /// What the faces to come move with.
    pub fn moving_with(&self) -> Option<usize> {
        self.run.0
    }

    /// How a light or a camera stands that moves with the faces to come; None where these stay.
    pub fn stand(&self, map: &DMat4) -> Option<Stand> {
        self.run.0.map(|node| Stand::On(self.animation.post(Some(node), map)))
    }

    /// A place that moves with the faces to come.
    pub fn post(&self, map: &DMat4) -> Post {
        self.animation.post(self.run.0, map)
    }

    /// Says that the faces from one on, which move with no node, are those of a shape.
    pub fn end_shape(&mut self, first: usize, shape: Shape) {
        self.animation.moving.push(Moving { triangles: first..self.faces.len(), motion: Motion::Bends(Arc::new(shape)) });
        self.run.1 = self.faces.len();
    }

    /// Takes over what moves in a file whose faces come next, which a map brings to the world.
    pub fn absorb_animation(&mut self, file: Animation, map: &DMat4) {
        let (onto, first_face) = (self.post(map), self.faces.len());
        let first_node = self.animation.absorb(file.nodes, self.run.0, map);
        for Moving { triangles, motion } in file.moving {
            let triangles = first_face + triangles.start..first_face + triangles.end;
            self.end_run(triangles.start);
            self.run.1 = triangles.end;
            let motion = match motion {
                Motion::With(node) => Motion::With(first_node + node),
                Motion::Bends(shape) => Motion::Bends(Arc::new(Arc::unwrap_or_clone(shape).absorbed(first_node, &onto, mirrors(map)))),
            };
            self.animation.moving.push(Moving { triangles, motion });
        }
    }

    /// Adds a camera that stands at a place.
    pub fn add_camera(&mut self, camera: Camera, at: DVec3) {
        self.camera_names.insert(camera.name.clone());
        self.cameras.push((camera, at));
    }

    pub fn has_camera(&self, name: &str) -> bool {
        self.camera_names.contains(name)
    }

    /// Says how a face lies by a chart, counted from 0.
    pub fn place_on_chart(&mut self, chart: usize, face: usize, uvs: [Vec2; 3]) {
        if self.charts.len() <= chart {
            self.charts.resize_with(chart + 1, Vec::new);
        }
        put(&mut self.charts[chart], face, uvs);
    }

    /// Says how the frame of the normal map lies at the corners of a face, under an affine map.
    pub fn place_tangents(&mut self, face: usize, tangents: [Vec3; 3], map: &DMat4) {
        let [a, b, c] = tangents.map(|tangent| map.transform_vector3(tangent.as_dvec3()).normalize_or_zero().as_vec3());
        put(&mut self.tangents, face, if mirrors(map) { [a, c, b] } else { [a, b, c] });
    }

    /// Refuses `more` triangles before they are made when they would be too many.
    pub fn expect_room(&self, more: usize) -> Result<(), SceneError> {
        let count = self.faces.len().saturating_add(more);
        if count <= MAX_TRIANGLES {
            return Ok(());
        }
        Err(SceneError::new(Problem::TooLarge, format!("the scene has {count} triangles or more; the limit is {MAX_TRIANGLES}"))
            .help("simplify the geometry or load a part of it"))
    }

    /// The finished scene: recentred, cleaned, in single precision.
    ///
    /// # Errors
    /// Nothing to show, an extent that single precision cannot hold, textures beyond the limits.
    pub fn finish(mut self, name: &str, normals: Normals, files: &Files) -> Result<Scene, SceneError> {
        self.move_with(None);
        let (low, high) = self.bounds(name)?;
        let origin = choose_origin(low, high);
        self.keep_used_materials();
        for material in &mut self.materials {
            if material.conserve_energy() {
                self.notes.push(format!("the material `{}` reflected more light than it gets: both of its parts were scaled down", material.name));
            }
        }
        self.animation.moving.iter_mut().filter_map(Moving::shape_mut).for_each(|shape| shape.normals = normals);
        let normals = normals.of(&self.faces);
        let mut triangles: Vec<Triangle> = self.faces.iter().zip(normals).map(|(face, normals)| to_triangle(face, normals, origin)).collect();
        let mut charts = std::mem::take(&mut self.charts);
        charts.iter_mut().for_each(|chart| chart.resize(triangles.len(), [Vec2::ZERO; 3]));
        let mut tangents = std::mem::take(&mut self.tangents);
        if !tangents.is_empty() {
            tangents.resize(triangles.len(), [Vec3::ZERO; 3]);
        }
        let mut animation = Animation { origin, ..self.animation };
        clean(&mut triangles, (&mut charts, &mut tangents), (&mut self.objects, &mut animation.moving), &self.materials, &mut self.notes);
        animation.at(0.0).bend(&mut triangles);
        if !triangles.iter().flat_map(|triangle| triangle.positions).all(|corner| corner.is_finite()) {
            return Err(SceneError::new(Problem::NonFinite, format!("`{name}` has a corner that is no finite number where its joints bring it"))
                .help("see how far the file's joints and morph targets move it"));
        }
        if triangles.is_empty() {
            return Err(no_triangles(name, &self.notes));
        }
        let textures = image::decode_all(&self.textures, files, &mut self.materials, &mut self.notes)?;
        charts.truncate(self.materials.iter().map(|material| material.maps.last_chart() as usize).max().unwrap_or(0));
        let lights = self.lights.into_iter().map(|(light, at)| place_light(light, at - origin)).collect::<Result<_, _>>()?;
        let mut cameras = self.cameras.into_iter().map(|(camera, at)| place_camera(camera, at - origin)).collect::<Result<Vec<_>, _>>()?;
        if cameras.is_empty() {
            cameras.push(framing_camera(Bounds::of(&triangles)));
            self.notes.push("the file has no camera: one that sees the whole scene was made".to_owned());
        }
        let environment = self.environment.unwrap_or(Environment::Constant(Vec3::ZERO));
        let mut scene = Scene {
            name: name.to_owned(),
            triangles,
            materials: self.materials,
            textures,
            charts,
            tangents,
            objects: self.objects,
            lights,
            environment,
            cameras,
            animation,
            origin,
            notes: self.notes,
            ..Scene::default()
        };
        put_out(&mut scene);
        Ok(scene)
    }

    fn bounds(&self, name: &str) -> Result<(DVec3, DVec3), SceneError> {
        let corners = self.faces.iter().flat_map(|face| face.positions);
        let (low, high) = corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        if self.faces.is_empty() {
            return Err(no_triangles(name, &self.notes));
        }
        let extent = low.distance(high);
        if extent == 0.0 {
            return Err(no_triangles(name, &self.notes));
        }
        if !EXTENT_RANGE.contains(&extent) {
            let (least, most) = (EXTENT_RANGE.start(), EXTENT_RANGE.end());
            return Err(SceneError::new(Problem::Range, format!("`{name}` is {extent:e} units across; single precision serves {least:e} to {most:e}"))
                .help("scale the scene; no result depends on the unit of length"));
        }
        Ok((low, high))
    }

    /// Forgets materials and textures that no triangle uses.
    fn keep_used_materials(&mut self) {
        let mut used = vec![false; self.materials.len()];
        self.faces.iter().for_each(|face| used[face.material as usize] = true);
        let material_map = renumber(&used);
        retain_marked(&mut self.materials, &used);
        self.faces.iter_mut().for_each(|face| face.material = material_map[face.material as usize]);
        self.animation.emissions.retain_mut(|track| {
            let number = track.material as usize;
            track.material = material_map[number];
            used[number]
        });

        let mut used = vec![false; self.textures.len()];
        let mut named: Vec<&mut u32> = self.materials.iter_mut().flat_map(Material::textures_mut).filter_map(Option::as_mut).collect();
        named.iter().for_each(|texture| used[**texture as usize] = true);
        let texture_map = renumber(&used);
        retain_marked(&mut self.textures, &used);
        named.iter_mut().for_each(|texture| **texture = texture_map[**texture as usize]);
    }
}

/// Gives triangles whose emission map is black all over a material that does not emit: they are no lamps.
fn put_out(scene: &mut Scene) {
    let is_dark =
        |(number, triangle): (u32, &Triangle)| scene.materials[triangle.material as usize].maps.emission.is_some() && scene.mean_emission(number) == Vec3::ZERO;
    let dark: Vec<usize> = (0..scene.triangles.len()).filter(|at| is_dark((*at as u32, &scene.triangles[*at]))).collect();
    let mut copies: HashMap<u32, u32> = HashMap::new();
    for at in dark {
        let number = scene.triangles[at].material;
        scene.triangles[at].material = *copies.entry(number).or_insert_with(|| {
            let shining = &scene.materials[number as usize];
            let copy = Material { emission: Vec3::ZERO, maps: Maps { emission: None, ..shining.maps }, ..shining.clone() };
            scene.materials.push(copy);
            scene.materials.len() as u32 - 1
        });
    }
}

/// What the file had in place of triangles stands in the notes.
fn no_triangles(name: &str, notes: &[String]) -> SceneError {
    let help = std::iter::once("a scene needs at least one surface").chain(notes.iter().map(String::as_str)).collect::<Vec<_>>().join("\n");
    SceneError::new(Problem::NoTriangles, format!("`{name}` has no triangle with an area")).help(help)
}

fn renumber(used: &[bool]) -> Vec<u32> {
    used.iter()
        .scan(0, |next, &used| {
            let number = *next;
            *next += u32::from(used);
            Some(number)
        })
        .collect()
}

/// Of faces that stay where they are marked, the objects that are left.
fn retain_objects<T>(objects: &mut Vec<T>, triangles: impl Fn(&mut T) -> &mut Range<usize>, marks: &[bool]) {
    let (mut seen, mut kept) = (0, 0);
    let mut kept_before = |end: usize| {
        kept += marks[seen..end].iter().filter(|mark| **mark).count();
        seen = end;
        kept
    };
    objects.retain_mut(|object| {
        let range = triangles(object);
        *range = kept_before(range.start)..kept_before(range.end);
        range.start < range.end
    });
}

fn retain_marked<T>(items: &mut Vec<T>, marks: &[bool]) {
    let mut marks = marks.iter();
    items.retain(|_| *marks.next().unwrap_or(&false));
}

/// Zero for geometry near the file's origin, so that ordinary scenes keep their coordinates; otherwise the middle of
/// the bounds, rounded to a power of two so that the shift itself is exact.
fn choose_origin(low: DVec3, high: DVec3) -> DVec3 {
    let extent = low.distance(high);
    if low.abs().max(high.abs()).max_element() <= 4.0 * extent {
        return DVec3::ZERO;
    }
    let grid = extent.log2().floor().exp2();
    ((low + high) / 2.0 / grid).round() * grid
}

pub(in crate::scene) fn to_triangle(face: &Face, normals: [Vec3; 3], origin: DVec3) -> Triangle {
    // Adding zero turns a negative zero into a positive one, so that equal corners have equal bits.
    let positions = face.positions.map(|p| (p - origin).as_vec3() + 0.0);
    let mut triangle = Triangle { positions, normals, uvs: face.uvs, tints: face.tints, material: face.material };
    triangle.normals = on_front_side(normals, triangle.face_normal());
    triangle
}

/// Shading normals that agree with the plane: turned round together where most point backwards, the plane's own where
/// one is missing or still points backwards.
fn on_front_side(normals: [Vec3; 3], front: Vec3) -> [Vec3; 3] {
    let units = normals.map(|n| n.normalize_or_zero());
    let sign = if units.iter().sum::<Vec3>().dot(front) < 0.0 { -1.0 } else { 1.0 };
    units.map(|n| if (sign * n).dot(front) > 0.0 { sign * n } else { front })
}

/// Leaves out triangles without an area and repetitions of the same triangle, in their charts and tangents, too.
fn clean(
    triangles: &mut Vec<Triangle>,
    (charts, tangents): (&mut [Vec<[Vec2; 3]>], &mut Vec<[Vec3; 3]>),
    (objects, moving): (&mut Vec<Object>, &mut Vec<Moving>),
    materials: &[Material],
    notes: &mut Vec<String>,
) {
    let before = triangles.len();
    let mut retain = |triangles: &mut Vec<Triangle>, moving: &mut Vec<Moving>, marks: &[bool]| {
        for moving in moving.iter_mut() {
            let marks = &marks[moving.triangles.clone()];
            if let Some(shape) = moving.shape_mut() {
                retain_marked(&mut shape.corners, marks);
            }
        }
        retain_objects(objects, |object| &mut object.triangles, marks);
        retain_objects(moving, |moving| &mut moving.triangles, marks);
        retain_marked(triangles, marks);
        charts.iter_mut().for_each(|chart| retain_marked(chart, marks));
        retain_marked(tangents, marks);
        marks.len() - triangles.len()
    };
    let mut with_area: Vec<bool> = triangles.iter().map(has_area).collect();
    for (triangles, shape) in moving.iter().filter_map(|moving| Some((moving.triangles.clone(), moving.shape()?))) {
        // At other times they may have one.
        with_area[triangles].iter_mut().zip(&shape.corners).for_each(|(mark, [a, b, c])| *mark |= a != b && b != c && c != a);
    }
    let without_area = retain(triangles, moving, &with_area);
    let mut keep = first_of_each(triangles, materials, moving);
    // What lies together at first may part.
    moving.iter().filter(|moving| moving.shape().is_some()).for_each(|moving| keep[moving.triangles.clone()].fill(true));
    let repeated = retain(triangles, moving, &keep);
    if without_area > 0 {
        notes.push(format!("{without_area} of {before} triangles have no area and were left out"));
    }
    if repeated > 0 {
        notes.push(format!("{repeated} of {before} triangles repeat another and were left out"));
    }
}

/// Whether a triangle's plane is more than rounding: thinner than 1e-7 of its length it is not, in single precision.
pub(crate) fn has_area(triangle: &Triangle) -> bool {
    let [a, b, c] = triangle.positions.map(|p| p.as_dvec3());
    let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    (b - a).cross(c - a).length() > 1e-7 * longest && triangle.face_normal() != Vec3::ZERO
}

/// Marks the first of all triangles that have the same corners and material and move together; on two-sided surfaces either winding is the same.
fn first_of_each(triangles: &[Triangle], materials: &[Material], moving: &[Moving]) -> Vec<bool> {
    let mut keys: Vec<[u32; 11]> = triangles.iter().map(|t| identity(t, materials[t.material as usize].two_sided)).collect();
    for (number, moving) in (1..).zip(moving) {
        keys[moving.triangles.clone()].iter_mut().for_each(|key| key[10] = number);
    }
    let mut order: Vec<(u64, u32)> = keys.iter().zip(0..).map(|(key, index)| (hash(key), index)).collect();
    order.sort_unstable();
    let mut keep = vec![true; triangles.len()];
    for run in order.chunk_by(|a, b| a.0 == b.0) {
        // Runs are single triangles but for repetitions: different keys of one hash are as rare as they are harmless.
        for pair in run.windows(2) {
            keep[pair[1].1 as usize] = keys[pair[0].1 as usize] != keys[pair[1].1 as usize];
        }
    }
    keep
}

/// Corners in an order that does not depend on where the file starts, the material, and room for what it moves with.
fn identity(triangle: &Triangle, two_sided: bool) -> [u32; 11] {
    let mut corners = triangle.positions.map(|p| p.to_array().map(f32::to_bits));
    if two_sided {
        corners.sort_unstable();
    } else {
        let first = (0..3).min_by_key(|&i| corners[i]).unwrap_or(0);
        corners.rotate_left(first);
    }
    let mut key = [0; 11];
    key[9] = triangle.material;
    key.iter_mut().zip(corners.as_flattened()).for_each(|(slot, &bits)| *slot = bits);
    key
}

/// FNV-1a over words with a final mix: fast, and the same everywhere.
fn hash(words: &[u32]) -> u64 {
    let hash = words.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, &word| (hash ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3).rotate_left(23));
    (hash ^ (hash >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9)
}

/// Mean normals around each corner over the faces within `angle` of the corner's own, weighted by the angle there.
fn smooth_normals(faces: &[Face], angle: f64) -> Vec<[Vec3; 3]> {
    let fronts: Vec<DVec3> = faces.iter().map(|face| face.cross().normalize_or_zero()).collect();
    let mut around: HashMap<[u64; 3], Vec<(u32, f64)>> = HashMap::new();
    for (face, index) in faces.iter().zip(0..) {
        for corner in 0..3 {
            around.entry(position_key(face.positions[corner])).or_default().push((index, corner_angle(&face.positions, corner)));
        }
    }
    let limit = angle.cos() - 1e-9;
    let mean = |index: usize, corner: usize| {
        let neighbours = &around[&position_key(faces[index].positions[corner])];
        let within = neighbours.iter().filter(|(other, _)| fronts[*other as usize].dot(fronts[index]) >= limit);
        within.map(|&(other, weight)| fronts[other as usize] * weight).sum::<DVec3>().normalize_or_zero().as_vec3()
    };
    (0..faces.len()).map(|index| [mean(index, 0), mean(index, 1), mean(index, 2)]).collect()
}

fn position_key(position: DVec3) -> [u64; 3] {
    (position + 0.0).to_array().map(f64::to_bits)
}

fn corner_angle(positions: &[DVec3; 3], corner: usize) -> f64 {
    let at = positions[corner];
    let (a, b) = (positions[(corner + 1) % 3] - at, positions[(corner + 2) % 3] - at);
    a.cross(b).length().atan2(a.dot(b))
}

fn place_light(mut light: Light, at: DVec3) -> Result<Light, SceneError> {
    match &mut light.kind {
        LightKind::Point { position, .. } | LightKind::Spot { position, .. } => *position = at.as_vec3(),
        LightKind::Directional { .. } => return Ok(light),
    }
    if at.as_vec3().is_finite() { Ok(light) } else { Err(too_far(&format!("light `{}`", light.name))) }
}

fn place_camera(mut camera: Camera, at: DVec3) -> Result<Camera, SceneError> {
    camera.eye = at.as_vec3();
    if camera.eye.is_finite() { Ok(camera) } else { Err(too_far(&format!("camera `{}`", camera.name))) }
}

fn too_far(what: &str) -> SceneError {
    SceneError::new(Problem::NonFinite, format!("the position of {what} is no finite number")).help("give it a place near the geometry")
}

/// A camera outside the bounds that holds all of them, in pictures of any shape.
fn framing_camera(bounds: Bounds) -> Camera {
    /// How much of the picture's height and width the bounds may take.
    const FILLED: f32 = 0.9;
    let angle = 50_f32.to_radians();
    let direction = Vec3::new(-0.5, -0.35, -1.0).normalize();
    let up = Vec3::Y.reject_from_normalized(direction).normalize();
    let (right, slope) = (direction.cross(up), FILLED * (angle / 2.0).tan());
    // Each corner of the bounds has to lie within the slopes of the view.
    let corners = (0..8).map(|corner| Vec3::select(BVec3::new(corner & 1 != 0, corner & 2 != 0, corner & 4 != 0), bounds.max, bounds.min) - bounds.centre());
    let distances = corners.map(|corner| corner.dot(right).abs().max(corner.dot(up).abs()) / slope - corner.dot(direction));
    Camera {
        name: "whole scene".to_owned(),
        eye: bounds.centre() - direction * distances.fold(0.0, f32::max),
        direction,
        up,
        field_of_view: FieldOfView::Shorter(angle),
        size: None,
        sample: Default::default(),
    }
}
