//! Geometry of scene documents: shapes, generators, files, each in its place.

use super::document::{Generator, Geometry, Raw, Triple, Turn};
use super::{ANY, Reader};
use crate::scene::load::{
    MAX_TRIANGLES,
    draft::{Draft, Face, mirrors, normal_map},
    error::{Problem, SceneError, Together, all},
    generate, list, load_geometry, primitives, teapot,
};
use crate::{
    math::curve::Curve,
    scene::{
        animation::{Placement, Rotation},
        model::{Material, Object},
    },
};
use glam::{BVec3, DMat4, DVec3};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

impl<'a> Reader<'a> {
    pub fn add_geometry(&mut self, raw: Raw<'a, Geometry<'a>>, map: &DMat4) -> Result<(), SceneError> {
        let source = self.source;
        let above = |raw| source.number_in(raw, "greater than 0", |number| number > 0.0);
        match source.get(raw)? {
            Geometry::File(path) => self.add_file(path, map),
            Geometry::Generate(generator) => self.add_generated(generator, map),
            Geometry::Box { min, max, material } => {
                let (low, high, material) = (source.vector(min), source.vector(max), self.primitive_material(material, raw)).together()?;
                if !low.cmplt(high).all() {
                    return Err(source.out_of_range(max, "greater than `min` in each coordinate"));
                }
                self.add_faces(&primitives::cuboid(low, high, material), map, "a box")
            }
            Geometry::Quad { corners, material } => {
                let [a, b, c, d] = corners.map(|raw| source.vector(raw));
                let ((a, b, c, d), material) = ((a, b, c, d).together(), self.primitive_material(material, raw)).together()?;
                self.add_faces(&primitives::quad([a, b, c, d], material), map, "a quad")
            }
            Geometry::Sphere { centre, radius, subdivisions, material } => {
                let level = subdivisions.map_or(Ok(3), |raw| source.count_in(raw, 0..=primitives::MAX_SUBDIVISIONS));
                let (centre, radius, level, material) = (source.vector(centre), above(radius), level, self.primitive_material(material, raw)).together()?;
                self.draft.expect_room(20 << (2 * level))?;
                self.add_faces(&primitives::sphere(centre, radius, level, material), map, "a sphere")
            }
            Geometry::Tube { centre, radius, thickness, height, sides, material } => {
                let radius = above(radius);
                // Beside a radius that is wrong, any thickness will do.
                let widest = radius.as_ref().map_or(f64::INFINITY, |radius| *radius);
                let thickness = source.number_in(thickness, "greater than 0, and less than `radius`", |number| number > 0.0 && number < widest);
                let sides = sides.map_or(Ok(primitives::SIDES), |raw| source.count_in(raw, primitives::SIDES_IN));
                let lengths = (radius, thickness, above(height)).together();
                let (centre, (radius, thickness, height), sides, material) =
                    (source.vector(centre), lengths, sides, self.primitive_material(material, raw)).together()?;
                self.draft.expect_room(8 * sides as usize)?;
                self.add_faces(&primitives::tube(primitives::Tube { centre, radius, thickness, height, sides }, material), map, "a tube")
            }
            Geometry::Teapot { centre, scale, detail, material } => {
                let scale = scale.map_or(Ok(1.0), above);
                let detail = detail.map_or(Ok(teapot::DETAIL), |raw| source.count_in(raw, teapot::DETAILS));
                let (centre, scale, detail, material) = (source.vector(centre), scale, detail, self.primitive_material(material, raw)).together()?;
                self.draft.expect_room(teapot::triangles(detail))?;
                self.add_faces(&teapot::teapot(centre, scale, detail, material), map, "a teapot")
            }
            Geometry::Triangles { positions, indices, material } => self.add_triangles(raw, positions, indices, material, map),
            Geometry::Place { name, of, scale, rotate, translate } => {
                let (first, name) = (self.draft.faces.len(), name.map(|name| source.get(name)).transpose());
                let before = self.draft.moving_with();
                let stated = || name.as_ref().ok().cloned().flatten().unwrap_or_else(|| "a place that moves".to_owned());
                let place = self.placement(scale, rotate, translate).map(|placement| self.draft.place(stated, map, placement));
                let inner_map = place.as_ref().map_or(*map, |place| *place);
                let inner = all(of.into_iter().map(|inner| self.add_geometry(inner, &inner_map)));
                self.draft.move_with(before);
                let (name, _, _) = (name, place, inner).together()?;
                if let Some(name) = name {
                    self.draft.end_object(name, first);
                }
                Ok(())
            }
        }
    }

    fn placement(&self, scale: Option<Raw<'a, Triple>>, rotate: Option<Turn<'a>>, translate: Option<Raw<'a, Triple>>) -> Result<Placement, SceneError> {
        let source = self.source;
        let factors = |raw: Raw<'a, Triple>| {
            let factors = source.curve(raw, |raw| source.vector(raw))?;
            let signs = |sign: f64| factors.values().iter().fold(BVec3::FALSE, |any, factor| any | (sign * *factor).cmpgt(DVec3::ZERO));
            let (up, down) = (signs(1.0), signs(-1.0));
            if (up & down).any() {
                return Err(source.out_of_range(raw, "of one sign in each coordinate, at all times"));
            }
            if (up | down).all() { Ok(factors) } else { Err(source.out_of_range(raw, "different from 0 in each coordinate")) }
        };
        let turn = |turn: Turn<'a>| {
            let (axis, degrees) = (source.unit(turn.axis), source.curve(turn.degrees, |raw| source.number(raw).map(f64::to_radians))).together()?;
            Ok(Rotation::Around(axis, degrees))
        };
        let still = || Curve::constant(DVec3::ZERO);
        let translation = translate.map_or_else(|| Ok(still()), |raw| source.curve(raw, |raw| source.vector(raw)));
        let rotation = rotate.map_or_else(|| Ok(Rotation::Around(DVec3::Y, Curve::constant(0.0))), turn);
        let (scale, rotation, translation) = (scale.map_or_else(|| Ok(Curve::constant(DVec3::ONE)), factors), rotation, translation).together()?;
        Ok(Placement { scale, rotation, translation })
    }

    fn add_faces(&mut self, faces: &[Face], map: &DMat4, name: &str) -> Result<(), SceneError> {
        let normal_map = normal_map(map);
        faces.iter().try_for_each(|face| self.draft.push(face.transformed(map, &normal_map), || name.to_owned()))
    }

    fn add_triangles<T>(
        &mut self,
        raw: Raw<'a, T>,
        positions: Raw<'a, Vec<Triple>>,
        indices: Raw<'a, Vec<[u32; 3]>>,
        material: Option<Raw<'a, String>>,
        map: &DMat4,
    ) -> Result<(), SceneError> {
        let material = self.primitive_material(material, raw);
        let (points, corners, material) = (self.source.get(positions), self.source.get(indices), material).together()?;
        let point = |index: u32| points.get(index as usize).map(|&p| DVec3::from(p));
        let face = |[a, b, c]: [u32; 3]| Some(Face::flat([point(a)?, point(b)?, point(c)?], material));
        let faces: Option<Vec<Face>> = corners.into_iter().map(face).collect();
        let faces = faces.ok_or_else(|| {
            let message = format!("an index points past the {} positions", points.len());
            self.source.error(Problem::Range, indices, message, "out of range").help("indices count from 0")
        })?;
        self.add_faces(&faces, map, "a mesh of the document")
    }

    fn add_generated(&mut self, raw: Raw<'a, Generator<'a>>, map: &DMat4) -> Result<(), SceneError> {
        match self.source.get(raw)? {
            Generator::Castle { triangles } => {
                let count = self.generated_triangles(raw, "castle", triangles, 58_000, generate::MIN_CASTLE);
                let (count, materials) = (count, self.generated_materials(raw, "castle", generate::CASTLE_MATERIALS)).together()?;
                self.add_faces(&generate::castle(count, materials), map, "the castle")
            }
            Generator::Hall { triangles } => {
                let count = self.generated_triangles(raw, "hall", triangles, 10_000, generate::MIN_HALL);
                let (count, materials) = (count, self.generated_materials(raw, "hall", generate::HALL_MATERIALS)).together()?;
                self.add_faces(&generate::hall(count, materials), map, "the hall")
            }
        }
    }

    /// How many triangles a generator is to make; room for them is sure.
    fn generated_triangles<T>(&mut self, raw: Raw<'a, T>, name: &str, stated: Option<Raw<'a, u32>>, usual: u32, least: usize) -> Result<usize, SceneError> {
        let stated = stated.map_or(Ok(usual), |raw| self.source.get(raw))?;
        let count = self.overridden("triangles", stated)? as usize;
        let limits = least..=MAX_TRIANGLES / 16 * 15;
        if !limits.contains(&count) {
            let range = format!("{} to {}", limits.start(), limits.end());
            let message = format!("a {name} of {count} triangles is out of range");
            return Err(self.source.error(Problem::Range, raw, message, "made here").help(format!("the range of `triangles` is {range}")));
        }
        self.draft.expect_room(count)?;
        Ok(count)
    }

    fn generated_materials<T, const N: usize>(&mut self, raw: Raw<'a, T>, name: &str, names: [&str; N]) -> Result<[u32; N], SceneError> {
        let found: Option<Vec<u32>> = names.iter().map(|name| self.find_material(name)).collect();
        found.and_then(|numbers| numbers.try_into().ok()).ok_or_else(|| {
            let message = format!("the {name} has surfaces without a material");
            let help = format!("add {} or `\"*\"` to `materials`", names.join(", "));
            self.source.error(Problem::UnknownMaterial, raw, message, "made here").help(help)
        })
    }

    /// A generator's parameter: the stated value, unless the options set another.
    fn overridden(&mut self, key: &'static str, stated: u32) -> Result<u32, SceneError> {
        self.parameters.insert(key);
        let Some((_, value)) = self.options.overrides.iter().rev().find(|(name, _)| name == key) else { return Ok(stated) };
        value.trim().parse().map_err(|_| {
            SceneError::new(Problem::Range, format!("`{key}` cannot be set to `{value}`")).help(format!("`{key}` is a whole number, such as {stated}"))
        })
    }

    fn add_file(&mut self, raw: Raw<'a, String>, map: &DMat4) -> Result<(), SceneError> {
        let path = self.find_file(raw)?;
        // Of materials that the document replaces, textures are not even looked for.
        let replaced: BTreeMap<String, bool> = self.palette.iter().map(|entry| (entry.name.clone(), entry.material.is_some())).collect();
        let wanted = |name: &str| !replaced.get(name).or(replaced.get(ANY)).copied().unwrap_or(false);
        let mut file = Draft::default();
        load_geometry(&path, self.files, &mut file, &wanted)?;
        self.absorb(file, map)
    }

    /// Takes over a file's triangles, and those of its materials that the document does not replace.
    fn absorb(&mut self, mut file: Draft, map: &DMat4) -> Result<(), SceneError> {
        file.move_with(None);
        let first_texture = self.draft.textures.len() as u32;
        let renumbered = |mut material: Material| {
            material.textures_mut().into_iter().flatten().for_each(|texture| *texture += first_texture);
            material
        };
        let numbers = all(file.materials.into_iter().map(|material| self.material_of_file(renumbered(material))))?;
        self.draft.textures.extend(file.textures);
        self.draft.notes.extend(file.notes);
        if !file.lights.is_empty() || !file.cameras.is_empty() {
            let (lights, cameras) = (file.lights.len(), file.cameras.len());
            self.draft.notes.push(format!("not taken from a file of a document: {lights} lights and {cameras} cameras; the document has its own"));
        }
        let normal_map = normal_map(map);
        self.draft.expect_room(file.faces.len())?;
        self.draft.faces.reserve(file.faces.len());
        let first_face = self.draft.faces.len();
        for (number, chart) in file.charts.into_iter().enumerate() {
            for (face, [a, b, c]) in chart.into_iter().enumerate() {
                self.draft.place_on_chart(number, first_face + face, if mirrors(map) { [a, c, b] } else { [a, b, c] });
            }
        }
        for (face, tangents) in file.tangents.into_iter().enumerate() {
            self.draft.place_tangents(first_face + face, tangents, map);
        }
        let objects =
            file.objects.into_iter().map(|Object { name, triangles }| Object { name, triangles: triangles.start + first_face..triangles.end + first_face });
        self.draft.objects.extend(objects);
        self.draft.absorb_animation(file.animation, map);
        file.faces.into_iter().try_for_each(|face| {
            let face = Face { material: numbers[face.material as usize], ..face.transformed(map, &normal_map) };
            self.draft.push(face, || "a file, moved to its place,".to_owned())
        })
    }

    /// Looks for a file beside the document, then in the search folders.
    pub fn find_file(&self, raw: Raw<'a, String>) -> Result<PathBuf, SceneError> {
        let path = self.source.get(raw)?;
        let folders: Vec<&Path> = self.folder.into_iter().chain(self.options.search.iter().map(PathBuf::as_path)).collect();
        if let Some(found) = folders.iter().map(|folder| folder.join(&path)).find(|candidate| self.files.is_there(candidate)) {
            return Ok(found);
        }
        let tried: Vec<String> =
            folders.iter().map(|folder| if folder.as_os_str().is_empty() { ".".to_owned() } else { folder.display().to_string() }).collect();
        let label = if tried.is_empty() { "no folder to look in".to_owned() } else { format!("looked in {}", list(&tried)) };
        Err(self
            .source
            .error(Problem::NotFound, raw, format!("there is no file `{path}`"), label)
            .help("name the folder that holds it with --scenes DIR, or in the variable HEMISPLAT_SCENES"))
    }
}
