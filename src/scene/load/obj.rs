//! Wavefront OBJ and MTL: positions in double precision, polygons of any shape, every surface two-sided.
//!
//! Read here rather than by a crate, so that an error names its line, a material keeps its name where its library is
//! missing, and no file can panic.

use super::{
    count_up,
    draft::{Draft, Face},
    error::{Problem, SceneError, SourceText},
    files::Files,
    image::{Content, TextureSource},
    list,
    polygon::{Cut, MAX_CORNERS, MAX_WORK, cut},
};
use crate::scene::model::{Glossy, Maps, Material, Reading, Tint, srgb_to_linear};
use glam::{DVec3, Vec2, Vec3};
use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    path::{Path, PathBuf},
};

/// Reflectance of faces whose material the files do not describe.
const PLAIN: f32 = 0.7;
/// The name of the material of faces that name none.
const UNNAMED: &str = "default";

/// Words of material libraries that change how a surface looks, and are not read.
const UNREAD: [&str; 16] =
    ["bump", "map_Bump", "disp", "decal", "refl", "map_d", "map_Tr", "map_Ks", "map_Ns", "map_Pr", "map_Pm", "map_Ps", "Ps", "Pc", "aniso", "Tf"];
/// Those of them that say nothing with a value of 0, and with one of 1.
const NEUTRAL: ([&str; 3], [&str; 1]) = (["Ps", "Pc", "aniso"], ["Tf"]);
const TRANSPARENCY: &str = "transparency (`d` or `Tr`)";

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
    /// With their colours.
    positions: Vec<(DVec3, Tint)>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    object: &'a str,
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
        match cut {
            Cut::Triangles(triangles) => triangles.into_iter().try_for_each(|corners| self.push_triangle(corners, material)),
            Cut::Fan | Cut::Unclear => (1..self.corners.len() - 1).try_for_each(|i| self.push_triangle([0, i, i + 1], material)),
        }
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
        let Self { source, draft, libraries, materials, slivers, unclear, mut unread, .. } = self;
        let file = source.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if slivers > 0 {
            draft.notes.push(format!("{file}: {slivers} faces have fewer than three corners and were left out"));
        }
        if unclear > 0 {
            draft.notes.push(format!(
                "{file}: {unclear} polygons are twisted, cross themselves, have more than {MAX_CORNERS} corners, or are too many of thousands of corners: \
                 they were filled as fans, which may cover more than the polygon"
            ));
        }
        let described = read_libraries(source.path, files, &libraries, &file, draft)?;
        let mut plain = Vec::new();
        let mut textures = HashMap::new();
        let mut ordered: Vec<(&str, u32)> = materials.into_iter().collect();
        ordered.sort_unstable_by_key(|&(_, number)| number);
        for (name, number) in ordered {
            match described.get(name) {
                Some(found) => {
                    let mut texture = |path: &Option<PathBuf>, is_linear: bool| {
                        let reading = Reading { is_linear, ..Reading::default() };
                        path.as_ref().filter(|_| wanted(name)).map(|path| texture_number(draft, &mut textures, path, reading))
                    };
                    let [base, normal, emission] =
                        [(&found.texture, false), (&found.normals, true), (&found.emissive, false)].map(|(path, is_linear)| texture(path, is_linear));
                    let maps = Maps { facets: None, normal, normal_scale: if normal.is_some() { 1.0 } else { 0.0 }, emission };
                    let met = found.unread.iter().filter(|_| wanted(name));
                    met.for_each(|what| *unread.entry(what.clone()).or_default() += 1);
                    draft.materials[number as usize] = Material { texture: base, maps, ..found.material.clone() };
                }
                None if wanted(name) => plain.push(name.to_owned()),
                None => {}
            }
        }
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
    let is_name = matches!(word, "usemtl" | "newmtl" | "mtllib" | "o" | "g") || word.starts_with("map_");
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

fn texture_number(draft: &mut Draft, known: &mut HashMap<(PathBuf, Reading), u32>, path: &Path, reading: Reading) -> u32 {
    *known.entry((path.to_owned(), reading)).or_insert_with(|| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        draft.textures.push(TextureSource { name, content: Content::File(path.to_owned()), reading });
        draft.textures.len() as u32 - 1
    })
}

/// A material as its library describes it.
struct Described {
    material: Material,
    texture: Option<PathBuf>,
    normals: Option<PathBuf>,
    emissive: Option<PathBuf>,
    specular: Vec3,
    exponent: f32,
    emission: Option<Vec3>,
    roughness: Option<f32>,
    metallic: Option<f32>,
    illumination: i32,
    opacity: Option<f32>,
    transparency: f32,
    /// What it says that is left out.
    unread: BTreeSet<String>,
}

/// All materials of the libraries that are there. The one beside the OBJ file steps in for one that is not.
fn read_libraries(path: &Path, files: &Files, names: &[&str], file: &str, draft: &mut Draft) -> Result<HashMap<String, Described>, SceneError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let beside = path.with_extension("mtl");
    let mut described = HashMap::new();
    for name in names.iter().flat_map(|names| library_names(folder, names)) {
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

/// A statement names one library, with blanks or without, or several.
fn library_names<'n>(folder: &Path, names: &'n str) -> Vec<&'n str> {
    let is_there = |name: &&str| folder.join(name.replace('\\', "/")).is_file();
    let parts: Vec<&str> = names.split_ascii_whitespace().collect();
    if is_there(&names) || !parts.iter().any(is_there) { vec![names] } else { parts }
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
        let (word, rest) = statement(line);
        if word == "newmtl" {
            store(current.replace(Described::new(rest)));
        } else if let Some(entry) = &mut current
            && !entry.set(word, rest, folder)
        {
            odd.push(format!("`{word} {rest}`"));
        }
    }
    store(current);
    if !odd.is_empty() {
        notes.push(format!("lines of the material library that were not understood or are out of range: {}", list(&odd)));
    }
}

impl Described {
    fn new(name: &str) -> Self {
        Self {
            material: Material::diffuse(name, Vec3::splat(PLAIN)),
            texture: None,
            normals: None,
            emissive: None,
            specular: Vec3::ZERO,
            exponent: 0.0,
            emission: None,
            roughness: None,
            metallic: None,
            illumination: 2,
            opacity: None,
            transparency: 0.0,
            unread: BTreeSet::new(),
        }
    }

    /// Takes in one line; false where its value makes no sense.
    fn set(&mut self, word: &str, rest: &str, folder: &Path) -> bool {
        let in_unit = |c: &Vec3| c.cmple(Vec3::ONE).all();
        match word.to_ascii_lowercase().as_str() {
            "kd" => colour(rest).filter(in_unit).map(|c| self.material.reflectance = c).is_some(),
            "ks" => colour(rest).filter(in_unit).map(|c| self.specular = c).is_some(),
            "ke" => colour(rest).map(|c| self.emission = Some(c)).is_some(),
            "ns" => rest.parse().ok().filter(|n: &f32| n.is_finite() && *n >= 0.0).map(|n| self.exponent = n).is_some(),
            "illum" => rest.parse().map(|model| self.illumination = model).is_ok(),
            // An option may stand before the number.
            "d" => last_word(rest).parse().map(|opacity| self.opacity = Some(opacity)).is_ok(),
            "tr" => rest.parse().map(|transparency| self.transparency = transparency).is_ok(),
            "pr" => share(rest).map(|roughness| self.roughness = Some(roughness)).is_some(),
            "pm" => share(rest).map(|metallic| self.metallic = Some(metallic)).is_some(),
            "map_ke" => {
                self.emissive = self.file("map_Ke", rest, folder);
                true
            }
            "norm" => {
                self.normals = self.file("norm", rest, folder);
                true
            }
            "map_kd" => {
                self.texture = self.file("map_Kd", rest, folder);
                true
            }
            _ => {
                self.unread.extend(unread_word(word, rest));
                true
            }
        }
    }

    /// The file of a map. Options stand before its name; without any, the name may hold blanks.
    fn file(&mut self, word: &str, rest: &str, folder: &Path) -> Option<PathBuf> {
        let has_options = rest.starts_with('-');
        let name = if has_options { last_word(rest) } else { rest };
        self.unread.extend(has_options.then(|| format!("options of `{word}`")));
        (!name.is_empty()).then(|| folder.join(name.replace('\\', "/")))
    }

    /// Where roughness or metallic are given, they make the lobe. A highlight counts where the illumination model has one.
    fn settled(mut self) -> Self {
        if self.roughness.is_some() || self.metallic.is_some_and(|metallic| metallic > 0.0) {
            self.material.glossy = Glossy::metallic_roughness(self.metallic.unwrap_or(0.0), self.roughness.unwrap_or(1.0));
        } else if self.illumination >= 2 && self.specular != Vec3::ZERO {
            self.material.glossy = Some(Glossy::Phong { reflectance: self.specular, exponent: self.exponent });
        }
        // A map says how much by itself.
        let by_map = if self.emissive.is_some() { Vec3::ONE } else { Vec3::ZERO };
        self.material.emission = self.emission.unwrap_or(by_map);
        if self.opacity.map_or(self.transparency > 0.0, |opacity| opacity < 1.0) {
            self.unread.insert(TRANSPARENCY.to_owned());
        }
        self
    }
}

/// A word of a library that is not read, unless its value means that there is nothing to read.
fn unread_word(word: &str, rest: &str) -> Option<String> {
    let name = UNREAD.into_iter().find(|name| name.eq_ignore_ascii_case(word))?;
    let is_all = |value: f32| rest.split_ascii_whitespace().all(|word| word.parse() == Ok(value));
    let says_nothing = NEUTRAL.0.contains(&name) && is_all(0.0) || NEUTRAL.1.contains(&name) && is_all(1.0);
    (!says_nothing).then(|| format!("`{name}`"))
}

/// A number of 0 to 1.
fn share(rest: &str) -> Option<f32> {
    rest.parse().ok().filter(|share| (0.0..=1.0).contains(share))
}

fn last_word(text: &str) -> &str {
    text.split_ascii_whitespace().last().unwrap_or_default()
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
