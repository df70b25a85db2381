//! A scene made ready for rays, and what can be otherwise in it later.

use super::{
    Bounds, Environment, Light, LightKind, Material, Object, Part, Resting, Scene, Triangle,
    animation::{Animation, Moment},
    bvh::Bvh,
    load::draft::{EXTENT_RANGE, mirrors, normal_map},
    needs::{Needs, is_smooth},
    shape::{Corners, frame, speck},
};
use crate::math::lobe::Lobe;
use glam::{DAffine3, DMat3, DMat4, DVec3, Vec3};
use miette::Diagnostic;
use rayon::prelude::*;
use std::{
    ops::Range,
    sync::{Arc, OnceLock},
};
use thiserror::Error;

/// A scene, and the hierarchy over its triangles, by which they are sorted.
#[derive(Clone)]
pub struct Stage {
    /// Its triangles are sorted.
    pub scene: Scene,
    /// The hierarchy over them.
    pub bvh: Bvh,
    movers: Vec<Mover>,
    needs: OnceLock<Needs>,
}

/// An object that can be moved.
#[derive(Clone)]
struct Mover {
    name: String,
    /// Of the scene, as the hierarchy has sorted them.
    triangles: Range<usize>,
    /// These as the file has them, and along normal maps.
    at_rest: Arc<[(Triangle, [Vec3; 3])]>,
    pose: Pose,
}

/// How a mover is.
#[derive(Debug, Clone)]
pub enum Pose {
    /// As the file has it, but where this map brings it, in the file's coordinates.
    Place(DAffine3),
    /// Each of its triangles for itself, in the order of [`Stage::triangles_of`].
    Shape(Arc<[Corners]>),
}

/// What triangles have done in the time between two poses.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Of the scene: all of a mover's, or one of a mover that deforms.
    pub triangles: Range<usize>,
    /// Of their points.
    pub map: DMat4,
}

/// Something of a scene that is otherwise from now on.
#[derive(Debug, Clone)]
pub enum Change {
    /// A mover, counted in the order in which [`Stage::moving`] was told them, stands where this map brings it from where the file has it, in the file's coordinates.
    /// One that it scales to nothing, by less than 1/10,000 along any axis, is not seen.
    Place {
        /// Its place in that order.
        mover: usize,
        /// From the file's coordinates to the world's.
        map: DAffine3,
    },
    /// A mover that deforms, which only an [animation](Scene::animation) has, is so: [`Stage::changes_to`] makes such changes.
    Shape {
        /// Its place in the order of [`Stage::triangles_of`].
        mover: usize,
        /// Of its triangles, in their order.
        corners: Arc<[Corners]>,
    },
    /// One of [`Scene::materials`].
    Material {
        /// Which one.
        number: usize,
        /// What it is from now on.
        material: Material,
    },
    /// One of [`Scene::lights`].
    Light {
        /// Which one.
        number: usize,
        /// What it is from now on.
        light: Light,
    },
    /// What rays see that leave the scene.
    Environment(Environment),
}

/// What a device has to be told.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Changed {
    /// Those that stand elsewhere.
    pub movers: Vec<usize>,
    /// Whether the sky is another.
    pub environment: bool,
    /// Whether lamps or the sky shine otherwise.
    pub emission: bool,
}

/// Why a scene cannot change so. It is as it was.
#[derive(Debug, Error, Diagnostic, PartialEq)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum Unchangeable {
    #[error("the scene has no {what} {number}; it has {count}")]
    #[diagnostic(code(stage::unknown), help("they count from 0"))]
    Unknown { what: &'static str, number: usize, count: usize },
    #[error("`{name}` cannot stand there: {why}")]
    #[diagnostic(code(stage::place), help("a map turns, moves and scales an object; it keeps its volume's sign"))]
    Place { name: String, why: &'static str },
    #[error("`{name}` cannot be bent so: {why}")]
    #[diagnostic(code(stage::shape), help("its joints, or the weights of its morph targets, bring it there at that time: see how the file moves them"))]
    Shape { name: String, why: &'static str },
    #[error("{what} cannot be so: {why}")]
    #[diagnostic(code(stage::value))]
    Value { what: String, why: &'static str },
    #[error("`{name}` is no part of the scene: it has {why}")]
    #[diagnostic(code(stage::part), help("a part is made of a copy of the scene: what differs are its triangles"))]
    Part { name: String, why: &'static str },
    #[error("`{a}` and `{b}` have triangles in common")]
    #[diagnostic(code(stage::overlap), help("name one of them"))]
    Overlap { a: String, b: String },
}

impl Stage {
    /// Of a scene whose geometry stays where it is.
    pub fn new(mut scene: Scene) -> Self {
        scene.animation = Animation::default();
        Self::without_movers(scene)
    }

    fn without_movers(mut scene: Scene) -> Self {
        scene.objects.clear();
        let bvh = Bvh::build(&mut scene);
        Self { scene, bvh, movers: Vec::new(), needs: OnceLock::new() }
    }

    /// Of a scene some of whose [objects](Scene::objects) can be moved, each by its number. Rays cost a little more than in one that stays where it is, as the
    /// hierarchy keeps the movers apart.
    ///
    /// # Errors
    /// An object that is not there, or is part of another.
    pub fn moving(mut scene: Scene, objects: &[usize]) -> Result<Self, Unchangeable> {
        let all = std::mem::take(&mut scene.objects);
        let object = |number: &usize| all.get(*number).ok_or(Unchangeable::Unknown { what: "object", number: *number, count: all.len() });
        let objects = objects.iter().map(object).collect::<Result<_, _>>()?;
        scene.animation = Animation::default();
        Self::with_movers(scene, objects)
    }

    /// Of an animated scene as it is at its beginning; how it goes on is told by [`Scene::animation`]. Its movers are what moves.
    ///
    /// # Errors
    /// A place that it cannot have.
    pub fn animated(scene: Scene) -> Result<Self, Unchangeable> {
        let objects = scene.animation.objects();
        let mut stage = if objects.is_empty() { Self::without_movers(scene) } else { Self::with_movers(scene, objects.iter().collect())? };
        stage.change(&stage.changes_to(&stage.scene.animation.at(0.0)))?;
        Ok(stage)
    }

    /// What has to change of it to be as its [animation](Scene::animation) has it then.
    pub fn changes_to(&self, moment: &Moment<'_>) -> Vec<Change> {
        let poses = moment.poses().zip(&self.movers).enumerate();
        let moved = poses.filter(|(_, (pose, mover))| *pose != mover.pose).map(|(mover, (pose, _))| pose.change(mover));
        moved.chain(moment.changes(&self.scene)).collect()
    }

    fn with_movers(mut scene: Scene, objects: Vec<&Object>) -> Result<Self, Unchangeable> {
        let mut sorted = objects.clone();
        sorted.sort_by_key(|object| object.triangles.start);
        if let Some((a, b)) = sorted.iter().zip(sorted.iter().skip(1)).find(|(a, b)| a.triangles.end > b.triangles.start) {
            return Err(Unchangeable::Overlap { a: a.name.clone(), b: b.name.clone() });
        }
        let (bvh, places) = Bvh::build_in_parts(&mut scene, &objects.iter().map(|object| object.triangles.clone()).collect::<Vec<_>>());
        let tangents = |at: usize| scene.tangents.get(at).copied().unwrap_or_default();
        let mover = |(number, (object, triangles)): (usize, (&Object, Range<usize>))| {
            let at_rest: Arc<[_]> = triangles.clone().map(|at| (scene.triangles[at], tangents(at))).collect();
            let corners = || at_rest.iter().map(|(triangle, tangents)| Corners::of(triangle, *tangents)).collect();
            let pose = if scene.animation.deforms(number) { Pose::Shape(corners()) } else { Pose::Place(DAffine3::IDENTITY) };
            Mover { name: object.name.clone(), at_rest, triangles, pose }
        };
        let movers: Vec<_> = objects.into_iter().zip(places).enumerate().map(mover).collect();
        let resting = |mover: &Mover| Resting { triangles: mover.triangles.clone(), shapes: mover.at_rest.clone() };
        let mut resting: Vec<Resting> = movers.iter().map(resting).collect();
        resting.sort_by_key(|resting| resting.triangles.start);
        scene.resting = resting.into();
        scene.objects = movers.iter().map(|mover| Object { name: mover.name.clone(), triangles: mover.triangles.clone() }).collect();
        Ok(Self { movers, scene, bvh, needs: OnceLock::new() })
    }

    /// With other geometry beside the scene's own, for passes that name it: [`Program::of_part`](crate::schedule::Program::of_part). It has the scene's materials,
    /// textures, lights and environment, and its movers, by number; changes are made to both.
    ///
    /// # Errors
    /// Where it has others, or its name is taken.
    pub fn with_part(mut self, name: &str, part: Self) -> Result<Self, Unchangeable> {
        let poses = |stage: &Self| stage.movers.iter().map(|mover| (mover.name.clone(), mover.pose.clone())).collect::<Vec<_>>();
        let deforms = |stage: &Self| stage.movers.iter().any(|mover| matches!(mover.pose, Pose::Shape(_)));
        let (own, of_part) = (&self.scene, &part.scene);
        let is_so = [
            ("no triangles", own.triangles.is_empty() == of_part.triangles.is_empty()),
            ("other materials", own.materials == of_part.materials),
            ("other textures", own.textures.len() == of_part.textures.len()),
            ("other lights", own.lights == of_part.lights),
            ("another environment", own.environment == of_part.environment),
            ("another origin", own.origin == of_part.origin),
            ("movers that deform, or is to follow such", !deforms(&self) && !deforms(&part)),
            ("other movers, or in other places", poses(&self) == poses(&part)),
            ("the name of another", own.parts.iter().all(|other| other.name != name)),
        ];
        if let Some((why, _)) = is_so.into_iter().find(|(_, is_so)| !is_so) {
            return Err(Unchangeable::Part { name: name.into(), why });
        }
        self.scene.parts.push(Part { name: name.into(), stage: part.into() });
        Ok(self)
    }

    /// What the scene requires of a pipeline.
    pub fn needs(&self) -> &Needs {
        self.needs.get_or_init(|| Needs::of(&self.scene))
    }

    /// Of the triangles, without a look at them.
    pub fn bounds(&self) -> Bounds {
        self.bvh.bounds()
    }

    /// See [`Scene::extent`].
    pub fn extent(&self) -> f32 {
        self.bounds().diagonal()
    }

    /// The triangles of a mover.
    pub fn triangles_of(&self, mover: usize) -> Range<usize> {
        self.movers[mover].triangles.clone()
    }

    /// How each mover is.
    pub fn poses(&self) -> Vec<Pose> {
        self.movers.iter().map(|mover| mover.pose.clone()).collect()
    }

    /// What brings the points of movers to where they were in earlier poses. What is not seen stays.
    pub fn backward(&self, before: &[Pose]) -> Vec<Motion> {
        let is_hidden = |mover: &Mover| matches!(&mover.pose, Pose::Place(map) if hides(map));
        let motions = self.movers.iter().zip(before).map(|(mover, before)| (mover, &mover.pose, if is_hidden(mover) { &mover.pose } else { before }));
        motions.flat_map(|(mover, from, to)| self.motion(mover, [from, to])).collect()
    }

    /// What movers have done since they were in earlier poses: maps of points as they were to where they are.
    pub fn motions(&self, before: &[Pose]) -> Vec<Motion> {
        self.movers.iter().zip(before).flat_map(|(mover, before)| self.motion(mover, [before, &mover.pose])).collect()
    }

    fn motion(&self, mover: &Mover, poses: [&Pose; 2]) -> Vec<Motion> {
        match poses {
            [Pose::Shape(from), Pose::Shape(to)] => {
                let of_triangle = |(triangle, (from, to)): (usize, (&Corners, &Corners))| {
                    let is_still = from.positions == to.positions;
                    let map = if is_still { DMat4::IDENTITY } else { frame(to.positions) * frame(from.positions).inverse() };
                    Motion { triangles: triangle..triangle + 1, map }
                };
                mover.triangles.clone().into_par_iter().zip(from.par_iter().zip(&to[..])).map(of_triangle).collect()
            }
            [Pose::Place(from), Pose::Place(to)] if from != to => {
                vec![Motion { triangles: mover.triangles.clone(), map: maps(*to * from.inverse(), self.scene.origin).0 }]
            }
            _ => vec![Motion { triangles: mover.triangles.clone(), map: DMat4::IDENTITY }],
        }
    }

    /// What undoes changes that the stage would take.
    pub(crate) fn undoing(&self, changes: &[Change]) -> Vec<Change> {
        let undoing = |change: &Change| match *change {
            Change::Place { mover, .. } | Change::Shape { mover, .. } => self.movers.get(mover).map(|was| was.pose.change(mover)),
            Change::Material { number, .. } => self.scene.materials.get(number).map(|material| Change::Material { number, material: material.clone() }),
            Change::Light { number, .. } => self.scene.lights.get(number).map(|light| Change::Light { number, light: light.clone() }),
            Change::Environment(_) => Some(Change::Environment(self.scene.environment.clone())),
        };
        changes.iter().rev().filter_map(undoing).collect()
    }

    /// Changes the scene. Places and lights cost as much as they are large; what a scene requires is looked up anew after other materials and another sky.
    ///
    /// # Errors
    /// The first change that is not possible; then there is none.
    pub fn change(&mut self, changes: &[Change]) -> Result<Changed, Unchangeable> {
        changes.iter().try_for_each(|change| self.check(change))?;
        self.scene.parts.iter().try_for_each(|part| changes.iter().try_for_each(|change| part.stage.check(change)))?;
        let mut changed = Changed::default();
        for change in changes {
            match change {
                Change::Place { mover, map } => {
                    let was = std::mem::replace(&mut self.movers[*mover].pose, Pose::Place(*map));
                    if !matches!(was, Pose::Place(was) if hides(&was) == hides(map)) {
                        // What is not seen has no shape of its own.
                        self.needs.take();
                    }
                    changed.movers.push(*mover);
                }
                Change::Shape { mover, corners } => {
                    self.movers[*mover].pose = Pose::Shape(corners.clone());
                    changed.movers.push(*mover);
                }
                Change::Material { number, material } => {
                    let was = std::mem::replace(&mut self.scene.materials[*number], material.clone());
                    changed.emission |= was.emits() || material.emits();
                    if (was.two_sided, was.alpha_cutoff) != (material.two_sided, material.alpha_cutoff) {
                        self.bvh.follow_materials();
                    }
                    self.needs.take();
                }
                Change::Light { number, light } => self.scene.lights[*number] = light.clone(),
                Change::Environment(environment) => {
                    (changed.environment, changed.emission) = (true, true);
                    self.scene.environment = environment.clone();
                    self.needs.take();
                }
            }
        }
        changed.movers.sort_unstable();
        changed.movers.dedup();
        changed.emission |= self.place(&changed.movers);
        if let Some(needs) = self.needs.get_mut() {
            needs.extent = self.bvh.bounds().diagonal();
            needs.follow_lights(&self.scene.lights);
        }
        for part in &mut self.scene.parts {
            changed.emission |= Arc::make_mut(&mut part.stage).change(changes)?.emission;
        }
        Ok(changed)
    }

    fn check(&self, change: &Change) -> Result<(), Unchangeable> {
        match change {
            Change::Place { mover, map } => self.mover(*mover)?.check_place(*map, self.scene.origin),
            Change::Shape { mover, corners } => self.mover(*mover)?.check_shape(corners),
            Change::Material { number, material } => {
                let count = self.scene.materials.len();
                let was = self.scene.materials.get(*number).ok_or(Unchangeable::Unknown { what: "material", number: *number, count })?;
                check_material(was, material, &self.scene)
            }
            Change::Light { number, light } => {
                let count = self.scene.lights.len();
                if *number >= count {
                    return Err(Unchangeable::Unknown { what: "light", number: *number, count });
                }
                check_light(light)
            }
            Change::Environment(environment) => check_environment(environment),
        }
    }

    fn mover(&self, number: usize) -> Result<&Mover, Unchangeable> {
        self.movers.get(number).ok_or(Unchangeable::Unknown { what: "mover", number, count: self.movers.len() })
    }

    /// Brings movers to their poses; whether any of them shines.
    fn place(&mut self, movers: &[usize]) -> bool {
        let mut shines = false;
        for mover in movers.iter().map(|mover| &self.movers[*mover]) {
            let corners = mover.corners(self.scene.origin);
            for ((at, (triangle, _)), corners) in mover.triangles.clone().zip(&*mover.at_rest).zip(&*corners) {
                corners.put(&mut self.scene.triangles[at]);
                if let Some(tangents) = self.scene.tangents.get_mut(at) {
                    *tangents = corners.tangents;
                }
                shines |= self.scene.materials[triangle.material as usize].emits();
            }
        }
        if !movers.is_empty() {
            self.bvh.follow(&self.scene, movers);
        }
        shines
    }
}

impl PartialEq for Pose {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Place(a), Self::Place(b)) => a == b,
            // Mostly it is the same one, which needs no look at all of it.
            (Self::Shape(a), Self::Shape(b)) => Arc::ptr_eq(a, b) || a == b,
            _ => false,
        }
    }
}

impl Pose {
    fn change(&self, mover: usize) -> Change {
        match self {
            Self::Place(map) => Change::Place { mover, map: *map },
            Self::Shape(corners) => Change::Shape { mover, corners: corners.clone() },
        }
    }
}

/// Whether a corner is where single precision serves.
fn is_near(corner: &Vec3) -> bool {
    f64::from(corner.length()) < *EXTENT_RANGE.end()
}

impl Mover {
    /// Where the corners of its triangles are.
    fn corners(&self, origin: DVec3) -> Arc<[Corners]> {
        let map = match &self.pose {
            Pose::Shape(corners) => return corners.clone(),
            Pose::Place(map) => *map,
        };
        let (hides, (map, normals)) = (hides(&map), maps(map, origin));
        let speck = hides.then(|| self.speck(&map));
        let moved = |(triangle, tangents): &(Triangle, [Vec3; 3])| {
            let turned = |tangent: Vec3| if tangent == Vec3::ZERO { tangent } else { map.transform_vector3(tangent.as_dvec3()).normalize_or_zero().as_vec3() };
            let tangents = tangents.map(turned);
            speck.map_or_else(|| Corners::of(&moved(triangle, &map, &normals), tangents), |speck| Corners { tangents, ..speck })
        };
        self.at_rest.iter().map(moved).collect()
    }

    /// What stands for each triangle of a mover that is not seen.
    fn speck(&self, map: &DMat4) -> Corners {
        let (first, tangents) = &self.at_rest[0];
        let corner = map.transform_point3(first.positions[0].as_dvec3()).as_vec3();
        let [positions, normals] = speck(corner, 1e-7 * first.positions[0].distance(first.positions[1]));
        Corners { positions, normals, tangents: *tangents }
    }

    fn check_shape(&self, corners: &[Corners]) -> Result<(), Unchangeable> {
        let refused = |why| Err(Unchangeable::Shape { name: self.name.clone(), why });
        if !matches!(self.pose, Pose::Shape(_)) {
            return refused("it does not deform");
        }
        if corners.len() != self.at_rest.len() {
            return refused("it has another number of triangles");
        }
        let vectors = || corners.iter().flat_map(|corners| [corners.positions, corners.normals, corners.tangents]).flatten();
        if !vectors().all(|vector| vector.is_finite()) {
            return refused("one of its vertices is nowhere: a number is not finite");
        }
        if !corners.iter().flat_map(|corners| &corners.positions).all(is_near) {
            return refused("one of its vertices would be farther away than single precision serves");
        }
        if corners.iter().any(|corners| corners.cross() == Vec3::ZERO) {
            return refused("one of its triangles has no area");
        }
        Ok(())
    }

    fn check_place(&self, map: DAffine3, origin: DVec3) -> Result<(), Unchangeable> {
        let refused = |why| Err(Unchangeable::Place { name: self.name.clone(), why });
        if matches!(self.pose, Pose::Shape(_)) {
            return refused("it deforms, so that its animation alone moves it");
        }
        if !map.is_finite() {
            return refused("the map has a number that is not finite");
        }
        if hides(&map) {
            return Ok(());
        }
        if mirrors(&DMat4::from(map)) {
            return refused("the map mirrors it");
        }
        let (map, normals) = maps(map, origin);
        let moved = self.at_rest.iter().map(|(triangle, _)| moved(triangle, &map, &normals));
        for triangle in moved {
            if !triangle.positions.iter().all(is_near) {
                return refused("it would be farther away than single precision serves");
            }
            if triangle.cross() == Vec3::ZERO {
                return refused("the map leaves some of its triangles without an area");
            }
        }
        Ok(())
    }
}

/// Whether a map leaves nothing of what it is given.
fn hides(map: &DAffine3) -> bool {
    const LEAST: f64 = 1e-4;
    [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis].iter().any(|axis| axis.length() < LEAST)
}

/// A map of the file's coordinates as one of positions relative to an origin, and of normals.
fn maps(map: DAffine3, origin: DVec3) -> (DMat4, DMat3) {
    if map == DAffine3::IDENTITY {
        return (DMat4::IDENTITY, DMat3::IDENTITY);
    }
    let map = DMat4::from_translation(-origin) * DMat4::from(map) * DMat4::from_translation(origin);
    (map, normal_map(&map))
}

fn moved(triangle: &Triangle, map: &DMat4, normals: &DMat3) -> Triangle {
    if *map == DMat4::IDENTITY {
        return *triangle;
    }
    let moved = Triangle {
        // Adding zero turns a negative zero into a positive one, so that equal corners have equal bits.
        positions: triangle.positions.map(|p| map.transform_point3(p.as_dvec3()).as_vec3() + 0.0),
        normals: triangle.normals.map(|n| (*normals * n.as_dvec3()).normalize_or_zero().as_vec3()),
        ..*triangle
    };
    // What is flat stays so, though rounding may turn its plane.
    if is_smooth(triangle) { moved } else { Triangle { normals: [moved.face_normal(); 3], ..moved } }
}

fn is_light(light: Vec3) -> bool {
    light.is_finite() && light.cmpge(Vec3::ZERO).all()
}

/// Textures stay those that it has.
fn check_material(was: &Material, material: &Material, scene: &Scene) -> Result<(), Unchangeable> {
    let refused = |why| Err(Unchangeable::Value { what: format!("the material `{}`", was.name), why });
    if (material.texture, material.maps) != (was.texture, was.maps) {
        return refused("its textures stay as they are");
    }
    if !(is_light(material.reflectance) && material.reflectance.max_element() <= 1.0) {
        return refused("it reflects a share of light, 0 to 1");
    }
    if !is_light(material.emission) {
        return refused("it emits a finite radiance, 0 or more");
    }
    let is_sound = |lobe: Lobe| is_light(lobe.reflectance) && lobe.reflectance.max_element() <= 1.0 + 1e-5;
    if !scene.lobes(material).all(is_sound) || material.clone().conserve_energy() {
        return refused("it reflects more light than it gets");
    }
    Ok(())
}

fn check_light(light: &Light) -> Result<(), Unchangeable> {
    let refused = |why| Err(Unchangeable::Value { what: format!("the light `{}`", light.name), why });
    let is_unit = |direction: Vec3| (direction.length() - 1.0).abs() < 1e-3;
    if !is_light(light.kind.intensity()) {
        return refused("its strength is finite, 0 or more");
    }
    match light.kind {
        LightKind::Point { position, .. } | LightKind::Spot { position, .. } if !position.is_finite() => refused("its place is finite"),
        LightKind::Spot { direction, .. } | LightKind::Directional { direction, .. } if !is_unit(direction) => refused("its direction is a unit vector"),
        LightKind::Spot { inner, outer, .. } if !(0.0 <= inner && inner < outer && outer <= std::f32::consts::FRAC_PI_2 + 1e-6) => {
            refused("its angles are 0 ≤ inner < outer ≤ 90 degrees")
        }
        _ => Ok(()),
    }
}

fn check_environment(environment: &Environment) -> Result<(), Unchangeable> {
    let refused = |why| Err(Unchangeable::Value { what: "the environment".into(), why });
    match environment {
        Environment::Constant(radiance) if !is_light(*radiance) => refused("its radiance is finite, 0 or more"),
        Environment::LatLong { width, height, texels } if texels.len() as u64 != u64::from(*width) * u64::from(*height) || texels.is_empty() => {
            refused("it has a texel for each place of its image")
        }
        Environment::LatLong { texels, .. } if !texels.iter().all(|texel| is_light(*texel)) => refused("its radiance is finite, 0 or more"),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::frame::Frame;
    use crate::scene::{
        bvh::tests::clutter,
        packets::{Numbers, RayBundle, View},
    };

    /// What a packet of rays from the middle of a scene sees.
    fn seen(stage: &Stage) -> Vec<u32> {
        let directions: Vec<Vec3> = (0..64).map(|k| Vec3::new((k % 8) as f32 - 3.5, 4.0, (k / 8) as f32 - 3.5).normalize()).collect();
        let (bundle, view) = (RayBundle::of(&directions), View { position: Vec3::splat(0.1), frame: Frame::new(Vec3::Y) });
        let mut seen = vec![0; bundle.samples];
        stage.bvh.packets(&stage.scene).trace(&stage.scene, &[view], &bundle, &Numbers, &mut seen);
        seen
    }

    #[test]
    fn packets_see_sides_that_change() {
        let mut stage = Stage::new(clutter(1.0));
        let before = seen(&stage);
        let changes = [0, 1].map(|number| {
            let was = stage.scene.materials[number].clone();
            Change::Material { number, material: Material { two_sided: !was.two_sided, ..was } }
        });
        stage.change(&changes).unwrap();
        let mut scene = clutter(1.0);
        scene.materials.iter_mut().for_each(|material| material.two_sided = !material.two_sided);
        assert_eq!(seen(&stage), seen(&Stage::new(scene)));
        assert_ne!(seen(&stage), before);
    }

    #[test]
    fn needs_follow_what_changes() {
        let mut stage = Stage::new(Scene { materials: vec![Material::diffuse("", Vec3::ONE); 2], ..clutter(1.0) });
        stage.scene.lights = vec![Light { name: String::new(), kind: LightKind::Point { position: Vec3::ZERO, intensity: Vec3::ONE }, shadows: true }];
        stage.needs();
        let sun = Light { name: String::new(), kind: LightKind::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE }, shadows: false };
        stage.change(&[Change::Light { number: 0, light: sun }]).unwrap();
        assert_eq!(*stage.needs(), Needs::of(&stage.scene));
        let lamp = Material { emission: Vec3::ONE, ..stage.scene.materials[0].clone() };
        stage.change(&[Change::Material { number: 0, material: lamp }, Change::Environment(Environment::Constant(Vec3::ONE))]).unwrap();
        assert_eq!(*stage.needs(), Needs::of(&stage.scene));
    }
}
