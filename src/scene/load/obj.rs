//! Wavefront OBJ and MTL: positions in double precision, polygons of any shape, every surface two-sided.
//!
//! Read here rather than by a crate, so that an error names its line, a material keeps its name where its library is
//! missing, and no file can panic.

mod library;

use super::{
    PLAIN,
    compose::Composition,
    count_up,
    draft::{Draft, Face},
    error::{Problem, SceneError, SourceText},
    files::{Files, file_name},
    image::{Content, TextureSource},
    list,
    polygon::{Cut, MAX_WORK, cut},
};
use crate::scene::model::{Charts, Maps, Material, Reading, Tint, srgb_to_linear};
use glam::{DVec3, Vec2, Vec3};
use library::{Described, Place, Textured, read_libraries};
use std::{
    collections::{BTreeMap, HashMap},
    path::Path,
};

/// The name of the material of faces that name none.
const UNNAMED: &str = "default";

/// Reads an OBJ file and the material libraries that it names.
pub(super) fn read(path: &Path, files: &Files, draft: &mut Draft, wanted: &dyn Fn(&str) -> bool) -> Result<(), SceneError> {
    let mut text = files.read_text(path)?;
    if text.contains("\\\n") || text.contains("\\\r\n") {
        // A backslash joins two lines; blanks in its place keep every offset.
        text = text.replace("\\\r\n", "   ").replace("\\\n", "  ");
    }
    let mut reader = Reader::new(SourceText::new(path, &text), draft);
    for line in text.lines() {
        reader.read_line(line)?;
    }
    reader.end_object();
    reader.finish(files, wanted)
}

struct Reader<'a, 'd> {
    source: SourceText<'a>,
    draft: &'d mut Draft,
    first_face: usize,
    /// With their colours.
    positions: Vec<(DVec3, Tint)>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    object: &'a str,
    /// Its first face.
    object_start: usize,
    libraries: Vec<&'a str>,
    /// Numbers of the materials in the order of their first use.
    materials: HashMap<&'a str, u32>,
    material: Option<u32>,
    corners: Vec<Corner>,
    /// Whether the faces that follow are meant to look smooth.
    is_smooth: bool,
    /// Faces of one or two corners.
    slivers: usize,
    /// Polygons whose inside is not clear.
    unclear: usize,
    /// What may still be spent on cutting polygons.
    work: u64,
    /// What was met and left out, and how often.
    unread: BTreeMap<String, usize>,
}

#[derive(Clone, Copy)]
struct Corner {
    position: DVec3,
    tint: Tint,
    uv: Vec2,
    normal: Vec3,
}

impl<'a, 'd> Reader<'a, 'd> {
    fn new(source: SourceText<'a>, draft: &'d mut Draft) -> Self {
        Self {
            source,
            first_face: draft.faces.len(),
            object_start: draft.faces.len(),
            draft,
            positions: Vec::new(),
            uvs: Vec::new(),
            normals: Vec::new(),
            object: "",
            libraries: Vec::new(),
            materials: HashMap::new(),
            material: None,
            corners: Vec::new(),
            is_smooth: false,
            slivers: 0,
            unclear: 0,
            work: MAX_WORK,
            unread: BTreeMap::new(),
        }
    }

    fn read_line(&mut self, line: &'a str) -> Result<(), SceneError> {
        let (word, rest) = statement(line);
        match word {
            "v" => {
                let position = self.read_numbers::<3>(line, rest)?;
                self.positions.push((position.into(), tint(rest)));
                Ok(())
            }
            "vn" => self.read_numbers::<3>(line, rest).map(|n| self.normals.push(DVec3::from(n).as_vec3())),
            // Rows of OBJ images run from the bottom.
            "vt" => self.read_numbers::<1>(line, rest).map(|[u]| {
                let v = rest.split_ascii_whitespace().nth(1).and_then(|v| v.parse().ok()).unwrap_or(0.0);
                self.uvs.push(finite_uv(u as f32, 1.0 - v));
            }),
            "f" => self.read_face(rest),
            "o" | "g" => {
                self.end_object();
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
            "s" => {
                self.is_smooth = !matches!(rest, "off" | "0");
                Ok(())
            }
            _ => {
                unread_statement(word).into_iter().for_each(|what| self.leave_out(what));
                Ok(())
            }
        }
    }

    /// Those without a name are of no object.
    fn end_object(&mut self) {
        if !self.object.is_empty() {
            self.draft.end_object(self.object, self.object_start);
        }
        self.object_start = self.draft.faces.len();
    }

    fn leave_out(&mut self, what: &str) {
        *self.unread.entry(what.to_owned()).or_default() += 1;
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
        if self.is_smooth && self.corners.iter().all(|corner| corner.normal == Vec3::ZERO) {
            self.leave_out("smoothing of faces without normals");
        }
        let cut = cut(self.corners.len(), |i| self.corners[i].position, &mut self.work);
        self.unclear += usize::from(cut == Cut::Unclear);
        cut.triangles(self.corners.len()).try_for_each(|corners| self.push_triangle(corners, material))
    }

    fn push_triangle(&mut self, corners: [usize; 3], material: u32) -> Result<(), SceneError> {
        let corners = corners.map(|corner| self.corners[corner]);
        let face = Face {
            positions: corners.map(|c| c.position),
            normals: corners.map(|c| c.normal),
            uvs: corners.map(|c| c.uv),
            tints: corners.map(|c| c.tint),
            material,
        };
        let (object, path) = (self.object, self.source.path);
        self.draft.push(face, || format!("object `{object}` of `{}`", path.display()))
    }

    /// `position`, `position/uv`, `position//normal` or `position/uv/normal`.
    fn read_corner(&self, word: &str) -> Result<Corner, SceneError> {
        let mut parts = word.split('/');
        let (position, tint) = self.look_up(&self.positions, parts.next().unwrap_or_default(), "positions")?;
        let uv = match parts.next() {
            None | Some("") => Vec2::ZERO,
            Some(index) => self.look_up(&self.uvs, index, "texture coordinates")?,
        };
        let normal = match parts.next() {
            None | Some("") => Vec3::ZERO,
            Some(index) => self.look_up(&self.normals, index, "normals")?,
        };
        Ok(Corner { position, tint, uv, normal })
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
        let Self { source, draft, first_face, libraries, materials, slivers, unclear, mut unread, .. } = self;
        let file = file_name(source.path);
        if slivers > 0 {
            draft.notes.push(format!("{file}: {slivers} faces have fewer than three corners and were left out"));
        }
        if unclear > 0 {
            draft.notes.push(format!("{file}: {unclear} {}", Cut::UNCLEAR));
        }
        let described = read_libraries(source.path, files, &libraries, &file, draft)?;
        let mut plain = Vec::new();
        let (mut textures, mut places) = (HashMap::new(), HashMap::new());
        let mut ordered: Vec<(&str, u32)> = materials.into_iter().collect();
        ordered.sort_unstable_by_key(|&(_, number)| number);
        for (name, number) in ordered {
            match described.get(name) {
                Some(found) => {
                    draft.materials[number as usize] = if wanted(name) {
                        found.unread.iter().for_each(|what| *unread.entry(what.clone()).or_default() += 1);
                        let (material, of_material) = with_textures(found, |texture| texture_number(draft, &mut textures, texture));
                        places.extend(of_material.iter().any(|place| *place != Place::default()).then_some((number, of_material)));
                        material
                    } else {
                        found.material.clone()
                    };
                }
                None if wanted(name) => plain.push(name.to_owned()),
                None => {}
            }
        }
        place_on_textures(draft, first_face, &places);
        if !unread.is_empty() {
            draft.notes.push(format!("not read from {file} and its libraries: {}", count_up(&unread)));
        }
        if !plain.is_empty() && !draft.faces.is_empty() {
            draft.notes.push(format!("{file}: materials that no library describes reflect {PLAIN}: {}", list(&plain)));
        }
        Ok(())
    }
}

/// What a statement that is not read would have added to the scene; None where it would not be seen.
fn unread_statement(word: &str) -> Option<&'static str> {
    match word {
        "l" | "p" => Some("lines and points"),
        "curv" | "curv2" | "surf" => Some("curves and surfaces"),
        "" | "vp" | "cstype" | "deg" | "bmat" | "step" | "parm" | "trim" | "hole" | "scrv" | "sp" | "end" | "con" | "mg" => None,
        _ => Some("other statements"),
    }
}

/// The word that begins a line and what follows it, without a comment. Names may hold a `#`: in them a comment has blanks around its sign.
fn statement(line: &str) -> (&str, &str) {
    let (word, rest) = split_word(line.trim());
    let is_name = matches!(word, "usemtl" | "newmtl" | "mtllib" | "o" | "g") || library::names_file(word);
    let comment = if is_name { rest.find(" # ") } else { rest.find('#') };
    if word.starts_with('#') { ("", "") } else { (word, rest[..comment.unwrap_or(rest.len())].trim()) }
}

fn split_word(line: &str) -> (&str, &str) {
    let (word, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
    (word, rest.trim())
}

/// The colour that follows a position, in sRGB as programs that scan write it; white where there is none.
fn tint(rest: &str) -> Tint {
    let numbers: Vec<f32> = rest.split_ascii_whitespace().skip(3).map_while(|word| word.parse().ok()).collect();
    let [r, g, b] = numbers[..] else { return Tint::default() };
    let linear = |value: f32| if value.is_finite() { srgb_to_linear(value.clamp(0.0, 1.0)) } else { 1.0 };
    Tint::new(Vec3::new(linear(r), linear(g), linear(b)))
}

fn finite_uv(u: f32, v: f32) -> Vec2 {
    let uv = Vec2::new(u, v);
    if uv.is_finite() { uv } else { Vec2::ZERO }
}

/// A material as its library describes it, with the numbers of its textures; and where its surfaces lie on them, by their own coordinates and by charts.
fn with_textures(found: &Described, mut number: impl FnMut(Textured) -> u32) -> (Material, Vec<Place>) {
    let mut places: Vec<Place> = Vec::new();
    let mut placed = |texture: Textured| {
        let known = places.iter().position(|place| *place == texture.place);
        let chart = known.unwrap_or_else(|| {
            places.push(texture.place);
            places.len() - 1
        });
        (number(texture), chart as u32)
    };
    let [base, facets, normal, emission] = found.textures().map(|texture| texture.map(&mut placed));
    let [facets_chart, normal_chart, emission_chart] = [facets, normal, emission].map(|map| map.map_or(0, |(_, chart)| chart));
    let [texture, facets, normal, emission] = [base, facets, normal, emission].map(|map| map.map(|(number, _)| number));
    let normal_scale = if normal.is_some() { found.normal_scale() } else { 0.0 };
    let charts = Charts { facets: facets_chart, normal: normal_chart, emission: emission_chart };
    (Material { texture, maps: Maps { facets, normal, normal_scale, emission, charts }, ..found.material.clone() }, places)
}

/// Moves the texture coordinates of faces to where their materials say that textures are.
fn place_on_textures(draft: &mut Draft, first_face: usize, places: &HashMap<u32, Vec<Place>>) {
    if places.is_empty() {
        return;
    }
    for number in first_face..draft.faces.len() {
        let face = &mut draft.faces[number];
        let Some([own, charts @ ..]) = places.get(&face.material).map(Vec::as_slice) else { continue };
        let uvs = face.uvs;
        face.uvs = uvs.map(|uv| own.of(uv));
        for (chart, place) in charts.iter().enumerate() {
            draft.place_on_chart(chart, number, uvs.map(|uv| place.of(uv)));
        }
    }
}

fn texture_number(draft: &mut Draft, known: &mut HashMap<(Composition, Reading), u32>, Textured { made_of, reading, .. }: Textured) -> u32 {
    *known.entry((made_of.clone(), reading)).or_insert_with(|| {
        draft.textures.push(TextureSource { name: made_of.name(), content: Content::Files(made_of), reading });
        draft.textures.len() as u32 - 1
    })
}
