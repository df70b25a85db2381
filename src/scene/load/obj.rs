//! Wavefront OBJ and MTL: positions in double precision, polygons as fans, every surface two-sided.
//!
//! Read here rather than by a crate, so that an error names its line, a material keeps its name where its library is
//! missing, and no file can panic.

use super::{
    draft::{Draft, Face},
    error::{Problem, SceneError, SourceText},
    files::Files,
    image::{Content, TextureSource},
    list,
};
use crate::scene::model::{Glossy, Material};
use glam::{DVec3, Vec2, Vec3};
use std::{
    collections::HashMap,
    path::{Path, PathBuf},
};

/// Reflectance of faces whose material the files do not describe.
const PLAIN: f32 = 0.7;
/// The name of the material of faces that name none.
const UNNAMED: &str = "default";

/// Reads an OBJ file and the material libraries that it names.
pub(super) fn read(path: &Path, files: &Files, draft: &mut Draft, wanted: &dyn Fn(&str) -> bool) -> Result<(), SceneError> {
    let mut text = files.read_text(path)?;
    if text.contains("\\\n") || text.contains("\\\r\n") {
        // A backslash joins two lines; blanks in its place keep every offset.
        text = text.replace("\\\r\n", "   ").replace("\\\n", "  ");
    }
    let mut reader = Reader::new(SourceText { path, text: &text }, draft);
    for line in text.lines() {
        reader.read_line(line)?;
    }
    reader.finish(files, wanted)
}

struct Reader<'a, 'd> {
    source: SourceText<'a>,
    draft: &'d mut Draft,
    positions: Vec<DVec3>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    object: &'a str,
    libraries: Vec<&'a str>,
    /// Numbers of the materials in the order of their first use.
    materials: HashMap<&'a str, u32>,
    material: Option<u32>,
    corners: Vec<Corner>,
    /// Faces of one or two corners.
    slivers: usize,
}

#[derive(Clone, Copy)]
struct Corner {
    position: DVec3,
    uv: Vec2,
    normal: Vec3,
}

impl<'a, 'd> Reader<'a, 'd> {
    fn new(source: SourceText<'a>, draft: &'d mut Draft) -> Self {
        Self {
            source,
            draft,
            positions: Vec::new(),
            uvs: Vec::new(),
            normals: Vec::new(),
            object: "",
            libraries: Vec::new(),
            materials: HashMap::new(),
            material: None,
            corners: Vec::new(),
            slivers: 0,
        }
    }

    fn read_line(&mut self, line: &'a str) -> Result<(), SceneError> {
        let line = line.split('#').next().unwrap_or_default().trim();
        let (word, rest) = split_word(line);
        match word {
            "v" => self.read_numbers::<3>(line, rest).map(|p| self.positions.push(p.into())),
            "vn" => self.read_numbers::<3>(line, rest).map(|n| self.normals.push(DVec3::from(n).as_vec3())),
            // Rows of OBJ images run from the bottom.
            "vt" => self.read_numbers::<1>(line, rest).map(|[u]| {
                let v = rest.split_ascii_whitespace().nth(1).and_then(|v| v.parse().ok()).unwrap_or(0.0);
                self.uvs.push(finite_uv(u as f32, 1.0 - v));
            }),
            "f" => self.read_face(rest),
            "o" | "g" => {
                self.object = rest;
                Ok(())
            }
            "usemtl" => {
                self.material = Some(self.material_number(rest));
                Ok(())
            }
            "mtllib" => {
                self.libraries.push(rest);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// The first `N` numbers of a line; more may follow.
    fn read_numbers<const N: usize>(&self, line: &str, rest: &str) -> Result<[f64; N], SceneError> {
        let mut words = rest.split_ascii_whitespace();
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            let word = words.next().ok_or_else(|| self.error(line, format!("this line needs {N} numbers"), "too few"))?;
            *number = word.parse().map_err(|_| self.error(word, format!("`{word}` is no number"), "expected a number"))?;
        }
        Ok(numbers)
    }

    fn read_face(&mut self, rest: &'a str) -> Result<(), SceneError> {
        self.corners.clear();
        for word in rest.split_ascii_whitespace() {
            let corner = self.read_corner(word)?;
            self.corners.push(corner);
        }
        if self.corners.len() < 3 {
            self.slivers += 1;
            return Ok(());
        }
        let material = match self.material {
            Some(material) => material,
            None => self.material_number(UNNAMED),
        };
        let first = self.corners[0];
        for pair in self.corners[1..].windows(2) {
            let corners = [first, pair[0], pair[1]];
            let face = Face { positions: corners.map(|c| c.position), normals: corners.map(|c| c.normal), uvs: corners.map(|c| c.uv), material };
            let (object, path) = (self.object, self.source.path);
            self.draft.push(face, || format!("object `{object}` of `{}`", path.display()))?;
        }
        Ok(())
    }

    /// `position`, `position/uv`, `position//normal` or `position/uv/normal`.
    fn read_corner(&self, word: &str) -> Result<Corner, SceneError> {
        let mut parts = word.split('/');
        let position = self.look_up(&self.positions, parts.next().unwrap_or_default(), "positions")?;
        let uv = match parts.next() {
            None | Some("") => Vec2::ZERO,
            Some(index) => self.look_up(&self.uvs, index, "texture coordinates")?,
        };
        let normal = match parts.next() {
            None | Some("") => Vec3::ZERO,
            Some(index) => self.look_up(&self.normals, index, "normals")?,
        };
        Ok(Corner { position, uv, normal })
    }

    /// Indices count from 1, or backwards from −1.
    fn look_up<T: Copy>(&self, items: &[T], word: &str, what: &str) -> Result<T, SceneError> {
        let index: i64 = word.parse().map_err(|_| self.error(word, format!("`{word}` is no index"), "expected a whole number"))?;
        let at = if index < 0 { index.checked_add(items.len() as i64) } else { index.checked_sub(1) };
        at.and_then(|at| usize::try_from(at).ok())
            .and_then(|at| items.get(at).copied())
            .ok_or_else(|| self.error(word, format!("index {index} is not among the {} {what} so far", items.len()), "out of range"))
    }

    fn error(&self, part: &str, message: String, label: &str) -> SceneError {
        let start = (part.as_ptr() as usize).saturating_sub(self.source.text.as_ptr() as usize);
        SceneError::new(Problem::Format, message).help("export the file again").at(&self.source, start..start + part.len(), label)
    }

    fn material_number(&mut self, name: &'a str) -> u32 {
        *self.materials.entry(name).or_insert_with(|| {
            self.draft.materials.push(Material::diffuse(name, Vec3::splat(PLAIN)));
            self.draft.materials.len() as u32 - 1
        })
    }

    /// Fills in the materials from their libraries, and says what was missing.
    fn finish(self, files: &Files, wanted: &dyn Fn(&str) -> bool) -> Result<(), SceneError> {
        let Self { source, draft, libraries, materials, slivers, .. } = self;
        let file = source.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if slivers > 0 {
            draft.notes.push(format!("{file}: {slivers} faces have fewer than three corners and were left out"));
        }
        let described = read_libraries(source.path, files, &libraries, &file, draft)?;
        let mut plain = Vec::new();
        let mut textures = HashMap::new();
        let mut ordered: Vec<(&str, u32)> = materials.into_iter().collect();
        ordered.sort_unstable_by_key(|&(_, number)| number);
        for (name, number) in ordered {
            match described.get(name) {
                Some(found) => {
                    let texture = found.texture.as_ref().filter(|_| wanted(name)).map(|path| texture_number(draft, &mut textures, path));
                    draft.materials[number as usize] = Material { texture, ..found.material.clone() };
                }
                None if wanted(name) => plain.push(name.to_owned()),
                None => {}
            }
        }
        if !plain.is_empty() {
            draft.notes.push(format!("{file}: materials that no library describes reflect {PLAIN}: {}", list(&plain)));
        }
        Ok(())
    }
}

fn split_word(line: &str) -> (&str, &str) {
    let (word, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
    (word, rest.trim())
}

fn finite_uv(u: f32, v: f32) -> Vec2 {
    let uv = Vec2::new(u, v);
    if uv.is_finite() { uv } else { Vec2::ZERO }
}

fn texture_number(draft: &mut Draft, known: &mut HashMap<PathBuf, u32>, path: &Path) -> u32 {
    *known.entry(path.to_owned()).or_insert_with(|| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        draft.textures.push(TextureSource { name, content: Content::File(path.to_owned()) });
        draft.textures.len() as u32 - 1
    })
}

/// A material as its library describes it.
struct Described {
    material: Material,
    texture: Option<PathBuf>,
    specular: Vec3,
    exponent: f32,
    illumination: i32,
}

/// All materials of the libraries that are there. The one beside the OBJ file steps in for one that is not.
fn read_libraries(path: &Path, files: &Files, names: &[&str], file: &str, draft: &mut Draft) -> Result<HashMap<String, Described>, SceneError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let beside = path.with_extension("mtl");
    let mut described = HashMap::new();
    for name in names {
        let named = folder.join(name.replace('\\', "/"));
        let found = if named.is_file() {
            named
        } else if beside.is_file() {
            draft.notes.push(format!("{file}: material library `{name}` is missing; the one beside the file was used"));
            beside.clone()
        } else {
            draft.notes.push(format!("{file}: material library `{name}` is missing"));
            continue;
        };
        match files.read_text(&found) {
            Ok(text) => read_library(&text, found.parent().unwrap_or(folder), &mut described, &mut draft.notes),
            Err(error) if error.problem() == Problem::TooLarge => return Err(error),
            Err(error) => draft.notes.push(format!("{file}: {error}")),
        }
    }
    Ok(described)
}

fn read_library(text: &str, folder: &Path, described: &mut HashMap<String, Described>, notes: &mut Vec<String>) {
    let mut current: Option<Described> = None;
    let mut odd = Vec::new();
    let mut store = |entry: Option<Described>| {
        if let Some(entry) = entry {
            described.insert(entry.material.name.clone(), entry.settled());
        }
    };
    for line in text.lines() {
        let line = line.split('#').next().unwrap_or_default().trim();
        let (word, rest) = split_word(line);
        if word == "newmtl" {
            store(current.replace(Described::new(rest)));
        } else if let Some(entry) = &mut current
            && !entry.set(word, rest, folder)
        {
            odd.push(format!("`{line}`"));
        }
    }
    store(current);
    if !odd.is_empty() {
        notes.push(format!("lines of the material library that were not understood or are out of range: {}", list(&odd)));
    }
}

impl Described {
    fn new(name: &str) -> Self {
        let material = Material::diffuse(name, Vec3::splat(PLAIN));
        Self { material, texture: None, specular: Vec3::ZERO, exponent: 0.0, illumination: 2 }
    }

    /// Takes in one line; false where its value makes no sense.
    fn set(&mut self, word: &str, rest: &str, folder: &Path) -> bool {
        let in_unit = |c: &Vec3| c.cmple(Vec3::ONE).all();
        match word {
            "Kd" => colour(rest).filter(in_unit).map(|c| self.material.reflectance = c).is_some(),
            "Ks" => colour(rest).filter(in_unit).map(|c| self.specular = c).is_some(),
            "Ke" => colour(rest).map(|c| self.material.emission = c).is_some(),
            "Ns" => rest.parse().ok().filter(|n: &f32| n.is_finite() && *n >= 0.0).map(|n| self.exponent = n).is_some(),
            "illum" => rest.parse().map(|model| self.illumination = model).is_ok(),
            "map_Kd" => {
                // Options stand before the name; without any, the name may hold blanks.
                let name = if rest.starts_with('-') { rest.split_ascii_whitespace().last().unwrap_or_default() } else { rest };
                self.texture = (!name.is_empty()).then(|| folder.join(name.replace('\\', "/")));
                true
            }
            _ => true,
        }
    }

    /// A highlight counts where the illumination model has one.
    fn settled(mut self) -> Self {
        if self.illumination >= 2 && self.specular != Vec3::ZERO {
            self.material.glossy = Some(Glossy::Phong { reflectance: self.specular, exponent: self.exponent });
        }
        self
    }
}

/// Three numbers, or one for all channels; none negative.
fn colour(rest: &str) -> Option<Vec3> {
    let numbers: Vec<f32> = rest.split_ascii_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    let colour = match numbers[..] {
        [grey] => Vec3::splat(grey),
        [r, g, b, ..] => Vec3::new(r, g, b),
        _ => return None,
    };
    (colour.is_finite() && colour.cmpge(Vec3::ZERO).all()).then_some(colour)
}
