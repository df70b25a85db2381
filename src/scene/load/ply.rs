//! PLY: vertices with normals, colours and texture coordinates, and polygons of any shape; as text or binary, of either order of bytes.
//!
//! Read here rather than by a crate: the format is small, and of a scan of millions of faces nothing is kept but the triangles.

use super::{
    MAX_TRIANGLES, PLAIN, count_up,
    draft::{Draft, Face},
    error::{Problem, SceneError},
    files::{Files, file_name},
    polygon::{Cut, MAX_WORK, cut},
};
use crate::scene::model::{Material, Tint, srgb_to_linear};
use glam::{DVec3, Vec2, Vec3};
use std::{collections::BTreeMap, path::Path};

/// The name of the only material.
const MATERIAL: &str = "default";

/// Elements that hold what other readers draw.
const DRAWN: [&str; 2] = ["tristrips", "edge"];

/// Reads a PLY file.
pub(super) fn read(path: &Path, files: &Files, draft: &mut Draft) -> Result<(), SceneError> {
    let bytes = files.read(path)?;
    let broken = |why: String| SceneError::new(Problem::Format, format!("`{}` is no sound PLY file: {why}", path.display())).help("export the file again");
    let (header, body) = Header::read(&bytes).map_err(broken)?;
    let mut body = Body { bytes: body, encoding: header.encoding };
    let first = draft.faces.len();
    let material = draft.materials.len() as u32;
    draft.materials.push(Material::diffuse(MATERIAL, Vec3::splat(PLAIN)));
    let mut mesh = Mesh { vertices: Vec::new(), material, work: MAX_WORK, slivers: 0, unclear: 0 };
    let mut unread: BTreeMap<String, usize> = header.images.iter().map(|image| (format!("texture `{image}`"), 1)).collect();
    for element in &header.elements {
        if element.name == "vertex" && element.count > 3 * MAX_TRIANGLES as u64 {
            let message = format!("`{}` has {} vertices; the limit is {}", path.display(), element.count, 3 * MAX_TRIANGLES);
            return Err(SceneError::new(Problem::TooLarge, message).help("simplify the geometry or load a part of it"));
        }
        match element.name.as_str() {
            "vertex" => mesh.read_vertices(element, &mut body).map_err(broken)?,
            "face" => mesh.read_faces(element, &mut body, draft, path)?.map_err(broken)?,
            name => {
                unread.extend(DRAWN.contains(&name).then(|| (format!("`{name}`"), element.count as usize)));
                body.skip(element).map_err(broken)?;
            }
        }
    }
    draft.end_object(path.file_stem().map_or(String::new(), |stem| stem.to_string_lossy().into_owned()), first);
    mesh.tell(&mut draft.notes, &file_name(path));
    if !unread.is_empty() {
        draft.notes.push(format!("not read from the PLY file: {}", count_up(&unread)));
    }
    Ok(())
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Number {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Of bytes from the least on, as many as it has.
    fn value(self, bytes: [u8; 8]) -> f64 {
        let [a, b, c, d, ..] = bytes;
        match self {
            Self::I8 => f64::from(a as i8),
            Self::U8 => f64::from(a),
            Self::I16 => f64::from(i16::from_le_bytes([a, b])),
            Self::U16 => f64::from(u16::from_le_bytes([a, b])),
            Self::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Self::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Self::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Self::F64 => f64::from_le_bytes(bytes),
        }
    }

    /// What stands for all of a colour.
    fn most(self) -> f64 {
        match self {
            Self::I8 | Self::U8 => 255.0,
            Self::I16 | Self::U16 => 65535.0,
            Self::I32 | Self::U32 => 4_294_967_295.0,
            Self::F32 | Self::F64 => 1.0,
        }
    }
}

struct Property {
    name: String,
    number: Number,
    /// Of a list, what tells its length.
    length: Option<Number>,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
    /// The textures that comments of MeshLab name.
    images: Vec<String>,
}

impl Header {
    /// The header, and what follows it.
    fn read(bytes: &[u8]) -> Result<(Self, &[u8]), String> {
        let mut rest = bytes;
        let mut header = Self { encoding: Encoding::Text, elements: Vec::new(), images: Vec::new() };
        if next_line(&mut rest).as_deref() != Some("ply") {
            return Err("it does not begin with `ply`".to_owned());
        }
        while let Some(line) = next_line(&mut rest) {
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            match words[..] {
                ["end_header"] => return Ok((header, rest)),
                ["format", encoding, _] => {
                    header.encoding = match encoding {
                        "ascii" => Encoding::Text,
                        "binary_little_endian" => Encoding::LittleEndian,
                        "binary_big_endian" => Encoding::BigEndian,
                        _ => return Err(format!("the format `{encoding}` is not known")),
                    };
                }
                ["comment", "TextureFile", ref name @ ..] => header.images.push(name.join(" ")),
                [] | ["comment" | "obj_info", ..] => {}
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| format!("`{count}` is no number of elements"))?;
                    header.elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
                }
                ["property", ref words @ ..] => {
                    let property = property(words).ok_or_else(|| format!("the property `{}` is not understood", words.join(" ")))?;
                    header.elements.last_mut().ok_or("a property stands before the first element")?.properties.push(property);
                }
                _ => return Err(format!("the line `{line}` of its header is not understood")),
            }
        }
        Err("its header has no end".to_owned())
    }
}

/// The next line of a header, however it ends; none where none is left, or it is no text.
fn next_line(rest: &mut &[u8]) -> Option<String> {
    let end = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r'))?;
    let line = std::str::from_utf8(&rest[..end]).ok()?.trim().to_owned();
    let ends_in_two = rest[end..].starts_with(b"\r\n");
    *rest = &rest[end + 1 + usize::from(ends_in_two)..];
    Some(line)
}

fn property(words: &[&str]) -> Option<Property> {
    match *words {
        ["list", length, number, name] => Some(Property { name: name.to_owned(), number: Number::named(number)?, length: Some(Number::named(length)?) }),
        [number, name] => Some(Property { name: name.to_owned(), number: Number::named(number)?, length: None }),
        _ => None,
    }
}

impl Element {
    /// Where among its properties the first of some names stands.
    fn find(&self, names: &[&str]) -> Option<usize> {
        names.iter().find_map(|name| self.properties.iter().position(|property| property.name == *name))
    }
}

/// What follows the header, as far as it is not read yet.
struct Body<'a> {
    bytes: &'a [u8],
    encoding: Encoding,
}

impl Body<'_> {
    fn number(&mut self, number: Number) -> Result<f64, String> {
        let size = number.size();
        let mut bytes = [0; 8];
        match self.encoding {
            Encoding::Text => return self.word(),
            Encoding::LittleEndian => bytes[..size].copy_from_slice(self.bytes.get(..size).ok_or_else(cut_off)?),
            Encoding::BigEndian => self.bytes.get(..size).ok_or_else(cut_off)?.iter().rev().zip(&mut bytes).for_each(|(byte, place)| *place = *byte),
        }
        self.bytes = &self.bytes[size..];
        Ok(number.value(bytes))
    }

    fn word(&mut self) -> Result<f64, String> {
        let start = self.bytes.iter().position(|byte| !byte.is_ascii_whitespace()).ok_or_else(cut_off)?;
        let rest = &self.bytes[start..];
        let (word, rest) = rest.split_at(rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len()));
        self.bytes = rest;
        let word = String::from_utf8_lossy(word);
        word.parse().map_err(|_| format!("`{word}` is no number"))
    }

    /// Reads one of an element: a number each of its properties, and the numbers of the list among them that is asked for.
    fn record(&mut self, element: &Element, list: Option<usize>, (values, listed): (&mut Vec<f64>, &mut Vec<f64>)) -> Result<(), String> {
        values.clear();
        listed.clear();
        for (at, property) in element.properties.iter().enumerate() {
            let Some(length) = property.length else {
                values.push(self.number(property.number)?);
                continue;
            };
            let count = self.number(length)?;
            values.push(count);
            for _ in 0..count as u64 {
                let value = self.number(property.number)?;
                listed.extend((list == Some(at)).then_some(value));
            }
        }
        Ok(())
    }

    fn skip(&mut self, element: &Element) -> Result<(), String> {
        let (mut values, mut listed) = (Vec::new(), Vec::new());
        // Without properties there is nothing to read, however many there are.
        (0..if element.properties.is_empty() { 0 } else { element.count }).try_for_each(|_| self.record(element, None, (&mut values, &mut listed)))
    }
}

fn cut_off() -> String {
    "it ends too early".to_owned()
}

#[derive(Clone, Copy)]
struct Vertex {
    position: DVec3,
    normal: Vec3,
    uv: Vec2,
    tint: Tint,
}

struct Mesh {
    vertices: Vec<Vertex>,
    material: u32,
    /// What may still be spent on cutting polygons.
    work: u64,
    /// Faces of one or two corners.
    slivers: usize,
    /// Polygons whose inside is not clear.
    unclear: usize,
}

impl Mesh {
    fn read_vertices(&mut self, element: &Element, body: &mut Body) -> Result<(), String> {
        let find = |names: &[&str]| element.find(names);
        let [Some(x), Some(y), Some(z)] = ["x", "y", "z"].map(|name| find(&[name])) else {
            return Err("its vertices have no x, y and z".to_owned());
        };
        let normal = ["nx", "ny", "nz"].map(|name| find(&[name]));
        let uv = [find(&["s", "u", "texture_u", "texture_s"]), find(&["t", "v", "texture_v", "texture_t"])];
        let colour = [find(&["red", "r", "diffuse_red"]), find(&["green", "g", "diffuse_green"]), find(&["blue", "b", "diffuse_blue"])];
        let (mut values, mut listed) = (Vec::new(), Vec::new());
        for _ in 0..element.count {
            body.record(element, None, (&mut values, &mut listed))?;
            let at = |place: usize| values[place];
            let vector = |places: [Option<usize>; 3]| match places {
                [Some(x), Some(y), Some(z)] => Some(Vec3::new(at(x) as f32, at(y) as f32, at(z) as f32)).filter(|vector| vector.is_finite()),
                _ => None,
            };
            let share = |place: usize| srgb_to_linear((at(place) / element.properties[place].number.most()).clamp(0.0, 1.0) as f32);
            let tint = match colour {
                [Some(r), Some(g), Some(b)] => Some(Vec3::new(share(r), share(g), share(b))).filter(|colour| colour.is_finite()).map(Tint::new),
                _ => None,
            };
            // Rows of images run from the bottom.
            let uv = uv[0].zip(uv[1]).map(|(u, v)| Vec2::new(at(u) as f32, 1.0 - at(v) as f32)).filter(|uv| uv.is_finite());
            self.vertices.push(Vertex {
                position: DVec3::new(at(x), at(y), at(z)),
                normal: vector(normal).unwrap_or(Vec3::ZERO),
                uv: uv.unwrap_or(Vec2::ZERO),
                tint: tint.unwrap_or_default(),
            });
        }
        Ok(())
    }

    /// Outer error: over the limits. Inner error: the file is broken.
    fn read_faces(&mut self, element: &Element, body: &mut Body, draft: &mut Draft, path: &Path) -> Result<Result<(), String>, SceneError> {
        let Some(list) = element.find(&["vertex_indices", "vertex_index"]).filter(|at| element.properties[*at].length.is_some()) else {
            return Ok(Err("its faces have no list `vertex_indices`".to_owned()));
        };
        let (mut values, mut listed, mut corners) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..element.count {
            if let Err(why) = body.record(element, Some(list), (&mut values, &mut listed)) {
                return Ok(Err(why));
            }
            corners.clear();
            for &index in &listed {
                let Some(vertex) = self.vertices.get(index as usize).filter(|_| index >= 0.0) else {
                    return Ok(Err(format!("a face names vertex {index} of {}", self.vertices.len())));
                };
                corners.push(*vertex);
            }
            self.push_face(&corners, draft, path)?;
        }
        Ok(Ok(()))
    }

    fn push_face(&mut self, corners: &[Vertex], draft: &mut Draft, path: &Path) -> Result<(), SceneError> {
        if corners.len() < 3 {
            self.slivers += 1;
            return Ok(());
        }
        let cut = cut(corners.len(), |at| corners[at].position, &mut self.work);
        self.unclear += usize::from(cut == Cut::Unclear);
        cut.triangles(corners.len()).try_for_each(|triangle| {
            let corners = triangle.map(|at| corners[at]);
            let face = Face {
                positions: corners.map(|c| c.position),
                normals: corners.map(|c| c.normal),
                uvs: corners.map(|c| c.uv),
                tints: corners.map(|c| c.tint),
                material: self.material,
            };
            draft.push(face, || format!("`{}`", path.display()))
        })
    }

    fn tell(&self, notes: &mut Vec<String>, file: &str) {
        if self.slivers > 0 {
            notes.push(format!("{file}: {} faces have fewer than three corners and were left out", self.slivers));
        }
        if self.unclear > 0 {
            notes.push(format!("{file}: {} {}", self.unclear, Cut::UNCLEAR));
        }
    }
}
