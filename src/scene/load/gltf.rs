//! glTF 2.0, as text or binary: what light transport needs of it, and notes about the rest.

mod animation;
mod compressed;
mod deform;
mod document;
mod instances;
mod material;

use super::{
    MAX_TRIANGLES, count_up,
    draft::{Draft, Face, mirrors, normal_map},
    error::{Problem, SceneError},
    files::{Bytes, Files},
    guard,
    image::Content,
    list,
};
use crate::scene::{
    animation::{CameraTrack, LightTrack, Post},
    model::*,
    shape::{Joint, Vertex},
};
use ::gltf::{
    Accessor, Document, Node, Primitive, Semantic,
    accessor::{DataType, Dimensions, sparse::IndexType},
    buffer, khr_lights_punctual as punctual,
    mesh::Mode,
};
use animation::{Track, Weights};
use base64::{
    Engine, alphabet,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};
use compressed::{MESHOPT, Unpacked};
use deform::{Part, Skins};
use document::{EXTENSIONS, Opened};
use glam::{DMat4, DQuat, DVec3, Vec2, Vec3};
use instances::is_instanced;
use material::Coordinates;
use std::{
    collections::{BTreeMap, HashMap},
    path::{Path, PathBuf},
};

/// What is missing from a scene without an extension, where its name does not say it.
const SUPPLIES: [(&str, &str); 1] = [("MSFT_texture_dds", "textures")];

/// The most elements of an accessor without a buffer: a few bytes of text must not become gigabytes.
const MAX_ZEROS: usize = 1 << 20;

/// Reads the default scene of a glTF file.
pub(super) fn read(path: &Path, files: &Files, draft: &mut Draft, wanted: &dyn Fn(&str) -> bool) -> Result<(), SceneError> {
    let bytes = files.read(path)?;
    // The crate checks a document before use; should a check be missing, its panic ends here.
    guard(|| read_document(path, files, &bytes, draft, wanted)).unwrap_or_else(|| Err(broken(path, "its structure is inconsistent")))
}

fn broken(path: &Path, why: &str) -> SceneError {
    SceneError::new(Problem::Format, format!("`{}` breaks the rules of glTF: {why}", path.display()))
        .help("export it again, or see what Khronos' glTF-Validator says")
}

fn read_document(path: &Path, files: &Files, bytes: &Bytes, draft: &mut Draft, wanted: &dyn Fn(&str) -> bool) -> Result<(), SceneError> {
    let Opened { document, blob, animations, skins } = document::open(path, bytes)?;
    let buffers = read_buffers(path, files, &document, blob)?;
    let unpacked = Unpacked::of(&document, &buffers, path)?;
    let mut reader = Reader {
        path,
        buffers,
        unpacked,
        draft,
        wanted,
        materials: HashMap::new(),
        textures: HashMap::new(),
        skins,
        weights: HashMap::new(),
        kept: 0,
        ignored: BTreeMap::new(),
    };
    let tracks = reader.tracks(&document, animations);
    document.extensions_used().filter(|name| !EXTENSIONS.contains(name)).for_each(|name| reader.ignore(unread(name)));
    reader.walk(&document, tracks)?;
    (0..reader.weights.len()).for_each(|_| reader.ignore("animations of morph targets that are not there"));
    let ignored = count_up(&reader.ignored);
    if !ignored.is_empty() {
        draft.notes.push(format!("not read from the glTF file: {ignored}"));
    }
    Ok(())
}

fn unread(extension: &str) -> String {
    match SUPPLIES.iter().find(|(name, _)| *name == extension) {
        Some((_, what)) => format!("extension {extension}, which supplies {what}"),
        None => format!("extension {extension}"),
    }
}

fn read_buffers(path: &Path, files: &Files, document: &Document, mut blob: Option<Bytes>) -> Result<Vec<Bytes>, SceneError> {
    let read = |buffer: buffer::Buffer| {
        let bytes = match buffer.source() {
            // Room for what is compressed elsewhere, for readers that know nothing of that.
            buffer::Source::Bin if buffer.extension_value(MESHOPT).is_some() => return Ok(Bytes::from(Vec::new())),
            buffer::Source::Bin => blob.take().ok_or_else(|| without_bytes(path, &buffer))?,
            buffer::Source::Uri(uri) => read_uri(path, files, uri)?,
        };
        let (there, stated) = (bytes.len(), buffer.length());
        if there < stated {
            return Err(broken(path, &format!("buffer {} holds {there} of its {stated} bytes", buffer.index())));
        }
        Ok(bytes)
    };
    document.buffers().map(read).collect()
}

fn without_bytes(path: &Path, buffer: &buffer::Buffer) -> SceneError {
    match names(buffer.extensions()) {
        Some(names) => {
            SceneError::new(Problem::Unsupported, format!("buffer {} of `{}` is supplied by {names}, which is not read", buffer.index(), path.display()))
                .help("export the file without this extension")
        }
        None => broken(path, &format!("buffer {} names no file, and there is no binary chunk for it", buffer.index())),
    }
}

/// The names of the extensions of a part of the file; None where there are none.
fn names(extensions: Option<&serde_json::Map<String, serde_json::Value>>) -> Option<String> {
    let names: Vec<&str> = extensions?.keys().map(String::as_str).collect();
    (!names.is_empty()).then(|| names.join(", "))
}

/// The bytes behind a data URI or a relative path.
fn read_uri(path: &Path, files: &Files, uri: &str) -> Result<Bytes, SceneError> {
    match uri.strip_prefix("data:") {
        Some(data) => decode_data(data).map(Bytes::from).ok_or_else(|| broken(path, "a data URI cannot be decoded")),
        None => files.read(&beside(path, uri)),
    }
}

/// What a data URI holds: base64, with its padding or without, or else text with escapes.
fn decode_data(uri: &str) -> Option<Vec<u8>> {
    const CONFIG: GeneralPurposeConfig = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    let (kind, data) = uri.split_once(',')?;
    if kind.ends_with(";base64") { GeneralPurpose::new(&alphabet::STANDARD, CONFIG).decode(data).ok() } else { Some(percent_decoded(data)) }
}

fn data_content(data: &str) -> Content {
    decode_data(data).map_or_else(|| Content::Missing("its data URI cannot be decoded".to_owned()), |bytes| Content::Bytes(bytes.into()))
}

/// The file that a URI names, relative to the one that says it.
fn beside(path: &Path, uri: &str) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).join(String::from_utf8_lossy(&percent_decoded(uri)).as_ref())
}

fn percent_decoded(uri: &str) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        let escaped = tail.get(..2).filter(|_| *first == b'%').and_then(|hex| std::str::from_utf8(hex).ok()).and_then(|hex| u8::from_str_radix(hex, 16).ok());
        bytes.push(escaped.unwrap_or(*first));
        rest = if escaped.is_some() { &tail[2..] } else { tail };
    }
    bytes
}

struct Reader<'a> {
    path: &'a Path,
    buffers: Vec<Bytes>,
    unpacked: Unpacked,
    draft: &'a mut Draft,
    wanted: &'a dyn Fn(&str) -> bool,
    /// Numbers by glTF index; `None` is the default material.
    materials: HashMap<Option<usize>, u32>,
    /// Likewise, by image and how it is read.
    textures: HashMap<(usize, Reading), u32>,
    skins: Skins,
    /// How far meshes go toward their morph targets where that changes, by the numbers of nodes.
    weights: HashMap<usize, Weights>,
    /// Numbers that shapes keep for each time.
    kept: usize,
    /// What was met and left out, and how often.
    ignored: BTreeMap<String, usize>,
}

/// The vertices of a primitive.
struct Vertices {
    all: Vec<Vertex>,
    has_normals: bool,
    /// Of normal maps; none where the material has no such map.
    has_tangents: bool,
    /// Texture coordinates: their own, then by the charts of the material.
    uvs: Vec<Vec<Vec2>>,
    tints: Vec<Tint>,
}

impl Reader<'_> {
    fn ignore(&mut self, what: impl Into<String>) {
        *self.ignored.entry(what.into()).or_default() += 1;
    }

    /// Visits the nodes of the default scene, or all of a file without scenes, depth first; then, where all joints are, the meshes with skins.
    fn walk(&mut self, document: &Document, mut tracks: HashMap<usize, Track>) -> Result<(), SceneError> {
        let roots: Vec<Node> = match document.default_scene().or_else(|| document.scenes().next()) {
            Some(scene) => scene.nodes().collect(),
            None => {
                let mut is_child = vec![false; document.nodes().len()];
                document.nodes().flat_map(|node| node.children()).for_each(|child| is_child[child.index()] = true);
                document.nodes().filter(|node| !is_child[node.index()]).collect()
            }
        };
        // Each with where its parent is, and what that moves with.
        let mut stack: Vec<(Node, DMat4, Option<usize>)> = roots.into_iter().rev().map(|node| (node, DMat4::IDENTITY, None)).collect();
        let mut posts: Vec<Option<Post>> = vec![None; document.nodes().len()];
        let mut skinned = Vec::new();
        while let Some((node, parent, moving)) = stack.pop() {
            if posts[node.index()].is_some() {
                return Err(broken(self.path, &format!("node {} hangs in the scene twice", node.index())));
            }
            self.draft.move_with(moving);
            let map = self.place_node(&node, &parent, tracks.remove(&node.index()));
            let moving = self.draft.moving_with();
            posts[node.index()] = Some(self.draft.post(&map));
            self.add_node(document, &node, &map)?;
            if self.skins.is_on(&node) && node.mesh().is_some() {
                skinned.push(node.clone());
            }
            let children: Vec<Node> = node.children().collect();
            stack.extend(children.into_iter().rev().map(|child| (child, map, moving)));
        }
        self.draft.move_with(None);
        for node in skinned {
            let joints = self.joints(document, &node, &posts)?;
            // Where the node itself is counts for nothing.
            self.add_mesh(document, &node, Some(joints), &DMat4::IDENTITY)?;
        }
        Ok(())
    }

    fn add_node(&mut self, document: &Document, node: &Node, map: &DMat4) -> Result<(), SceneError> {
        if !self.skins.is_on(node) {
            self.add_mesh(document, node, None, map)?;
        }
        if let Some(light) = node.light() {
            self.add_light(&light, node, map)?;
        }
        if let Some(camera) = node.camera() {
            self.add_camera(&camera, node, map)?;
        }
        Ok(())
    }

    /// The mesh of a node, if it has one, carried by joints or at each of its places.
    fn add_mesh(&mut self, document: &Document, node: &Node, joints: Option<Vec<Joint>>, map: &DMat4) -> Result<(), SceneError> {
        let Some(mesh) = node.mesh() else { return Ok(()) };
        let told = node.name().or(mesh.name()).map_or(format!("mesh {}", mesh.index()), |name| format!("mesh `{name}`"));
        let name = node.name().or(mesh.name()).unwrap_or(&told);
        let first = self.draft.faces.len();
        let targets = self.count_targets(&mesh, &told)?;
        let weights = self.target_weights(node, &mesh, targets, &told)?;
        let is_bent = weights.iter().any(|weight| !weight.is_constant());
        if joints.is_some() && is_instanced(node) {
            self.ignore("instances of meshes with skins");
        }
        let (places, count) = (self.places(document, node, map)?, joints.as_ref().map(Vec::len));
        let mut parts = Vec::new();
        for primitive in mesh.primitives() {
            let Some(mut part) = self.read_primitive(&primitive, count, &told)? else { continue };
            if is_bent || joints.is_some() {
                parts.push(part);
                continue;
            }
            part.bend(&weights);
            for map in &places {
                self.add_faces((&part.vertices.all, &part.vertices), &part.triangles, part.material, map, &told)?;
            }
        }
        match joints {
            _ if parts.is_empty() => {}
            Some(joints) => self.add_shape(&parts, joints, weights, name, &told)?,
            None => {
                for map in &places {
                    let joint = Joint { post: self.draft.post(map), bind: DMat4::IDENTITY };
                    self.add_shape(&parts, vec![joint], weights.clone(), name, &told)?;
                }
            }
        }
        self.draft.end_object(name, first);
        Ok(())
    }

    /// A primitive of a mesh with as many joints, or without a skin; None where there is nothing to see of it.
    fn read_primitive(&mut self, primitive: &Primitive, joints: Option<usize>, name: &str) -> Result<Option<Part>, SceneError> {
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.ignore("points and lines");
            return Ok(None);
        }
        let Some(positions) = self.positions(primitive) else { return Ok(None) };
        let Some(material) = self.material(&primitive.material())? else { return Ok(None) };
        let vertices = self.read_vertices(primitive, &positions, self.draft.materials[material as usize].maps)?;
        let (mode, indices) = match (self.unpacked.triangles.get(&positions.index()), primitive.indices()) {
            (Some(triangles), _) => (Mode::Triangles, triangles.clone()),
            (None, Some(accessor)) => (primitive.mode(), self.read_indices(&accessor)?),
            (None, None) => (primitive.mode(), (0..vertices.all.len() as u32).collect()),
        };
        if let Some(&index) = indices.iter().find(|&&index| index as usize >= vertices.all.len()) {
            return Err(broken(self.path, &format!("{name} refers to vertex {index} of {}", vertices.all.len())));
        }
        let shares = joints.map(|joints| self.read_shares(primitive, vertices.all.len(), joints, name)).transpose()?.unwrap_or_default();
        let targets = self.read_targets(primitive, &vertices, name)?;
        Ok(Some(Part { triangles: triangles(mode, &indices), vertices, material, targets, shares }))
    }

    /// Triangles of vertices where these are, under a map.
    fn add_faces(&mut self, (all, vertices): (&[Vertex], &Vertices), triangles: &[[u32; 3]], material: u32, map: &DMat4, name: &str) -> Result<(), SceneError> {
        let normal_map = normal_map(map);
        for corners in triangles {
            let corners = corners.map(|index| index as usize);
            let normals = corners.map(|i| all[i].normal);
            let mut uvs = vertices.uvs.iter().map(|uvs| corners.map(|i| uvs.get(i).copied().unwrap_or(Vec2::ZERO)));
            let tints = corners.map(|i| vertices.tints.get(i).copied().unwrap_or_default());
            let positions = corners.map(|i| all[i].position);
            let face = Face { positions, normals, uvs: uvs.next().unwrap_or_default(), tints, material };
            for (chart, [a, b, c]) in uvs.enumerate() {
                self.draft.place_on_chart(chart, self.draft.faces.len(), if mirrors(map) { [a, c, b] } else { [a, b, c] });
            }
            if vertices.has_tangents {
                self.draft.place_tangents(self.draft.faces.len(), corners.map(|i| all[i].tangent), map);
            }
            self.draft.push(face.transformed(map, &normal_map), || format!("{name} of `{}`", self.path.display()))?;
        }
        Ok(())
    }

    /// Where a primitive's positions are; None where the file has none.
    fn positions<'d>(&mut self, primitive: &Primitive<'d>) -> Option<Accessor<'d>> {
        let positions = primitive.get(&Semantic::Positions);
        if positions.as_ref().is_some_and(|accessor| self.has_bytes(accessor)) {
            return positions;
        }
        self.ignore("meshes without positions");
        None
    }

    /// Whether anything of an accessor is in the file: the rest is zeros.
    fn has_bytes(&self, accessor: &Accessor) -> bool {
        accessor.view().is_some() || accessor.sparse().is_some() || self.unpacked.numbers.contains_key(&accessor.index())
    }

    fn read_vertices(&self, primitive: &Primitive, positions: &Accessor, maps: Maps) -> Result<Vertices, SceneError> {
        let positions = self.read_vectors::<3>(positions)?;
        let normals = primitive.get(&Semantic::Normals).map(|accessor| self.read_vectors::<3>(&accessor)).transpose()?.unwrap_or_default();
        let coordinates = material::coordinates(&primitive.material());
        // Without a texture they still say how lobes lie that a document gives the surface.
        let (own, others) = coordinates.split_first().map_or((Coordinates::default(), &[][..]), |(own, others)| (*own, others));
        let coordinates = std::iter::once(&own).chain(others.iter().take(maps.last_chart() as usize));
        // Their handedness is that of the texture coordinates. Without normals they count for nothing.
        let tangents = primitive.get(&Semantic::Tangents).filter(|_| maps.normal.is_some() && !normals.is_empty());
        let tangents: Vec<[f32; 3]> =
            tangents.map(|accessor| self.read_vectors::<4>(&accessor)).transpose()?.unwrap_or_default().into_iter().map(|[x, y, z, _]| [x, y, z]).collect();
        let tints = primitive.get(&Semantic::Colors(0)).map(|accessor| self.read_tints(&accessor)).transpose()?.unwrap_or_default();
        // What is missing, or no number, counts as if the file had none.
        let way = |all: &[[f32; 3]], at: usize| all.get(at).map(|way| Vec3::from(*way)).filter(|way| way.is_finite()).unwrap_or_default();
        let vertex =
            |(at, position): (usize, [f32; 3])| Vertex { position: Vec3::from(position).as_dvec3(), normal: way(&normals, at), tangent: way(&tangents, at) };
        Ok(Vertices {
            all: positions.into_iter().enumerate().map(vertex).collect(),
            has_normals: !normals.is_empty(),
            has_tangents: !tangents.is_empty(),
            uvs: coordinates.map(|coordinates| self.read_uvs(primitive, coordinates)).collect::<Result<_, _>>()?,
            tints,
        })
    }

    fn read_uvs(&self, primitive: &Primitive, coordinates: &Coordinates) -> Result<Vec<Vec2>, SceneError> {
        let uvs = primitive.get(&Semantic::TexCoords(coordinates.set)).map(|accessor| self.read_vectors::<2>(&accessor)).transpose()?.unwrap_or_default();
        let placed = uvs.into_iter().map(|uv| coordinates.place(uv.into()));
        Ok(placed.map(|uv| if uv.is_finite() { uv } else { Vec2::ZERO }).collect())
    }

    /// Colours of vertices, with or without an alpha.
    fn read_tints(&self, accessor: &Accessor) -> Result<Vec<Tint>, SceneError> {
        let tint = |[r, g, b]: [f32; 3]| Tint::new(Vec3::new(r, g, b));
        if accessor.dimensions() == Dimensions::Vec4 {
            return Ok(self.read_vectors::<4>(accessor)?.into_iter().map(|[r, g, b, _]| tint([r, g, b])).collect());
        }
        Ok(self.read_vectors::<3>(accessor)?.into_iter().map(tint).collect())
    }

    fn out_of_range(&self, what: &str, range: &str) -> SceneError {
        SceneError::new(Problem::Range, format!("{what} in `{}` is out of range", self.path.display())).help(format!("the range is {range}"))
    }

    fn view_content(&self, view: &buffer::View) -> Content {
        if let Some(bytes) = self.unpacked.views.get(&view.index()) {
            return Content::Bytes(bytes.clone());
        }
        let part = view.offset().checked_add(view.length()).and_then(|end| self.buffers.get(view.buffer().index())?.part(view.offset()..end));
        part.map_or_else(|| Content::Missing("it reaches past its buffer".to_owned()), Content::Bytes)
    }

    fn add_light(&mut self, light: &punctual::Light, node: &Node, map: &DMat4) -> Result<(), SceneError> {
        let name = node.name().or(light.name()).map_or(format!("light {}", self.draft.lights.len() + 1), str::to_owned);
        let strength = Vec3::from(light.color()) * light.intensity();
        if !(strength.is_finite() && strength.cmpge(Vec3::ZERO).all()) {
            return Err(self.out_of_range(&format!("the intensity of light `{name}`"), "0 or more"));
        }
        if light.range().is_some() {
            self.ignore("ranges of lights");
        }
        let position = Vec3::ZERO;
        let kind = match light.kind() {
            punctual::Kind::Point => LightKind::Point { position, intensity: strength },
            punctual::Kind::Directional => LightKind::Directional { direction: self.axis(map, DVec3::NEG_Z, &name)?.as_vec3(), irradiance: strength },
            punctual::Kind::Spot { inner_cone_angle: inner, outer_cone_angle: outer } => {
                if !(inner >= 0.0 && inner < outer && outer <= std::f32::consts::FRAC_PI_2 + 1e-6) {
                    return Err(self.out_of_range(&format!("a cone angle of light `{name}`"), "0 ≤ inner < outer ≤ π/2"));
                }
                LightKind::Spot { position, direction: self.axis(map, DVec3::NEG_Z, &name)?.as_vec3(), intensity: strength, inner, outer }
            }
        };
        if let Some(stand) = self.draft.stand(map) {
            self.draft.animation.lights.push(LightTrack { light: self.draft.lights.len(), stand, strength: None });
        }
        self.draft.lights.push((Light { name, kind, shadows: true }, map.transform_point3(DVec3::ZERO)));
        Ok(())
    }

    fn add_camera(&mut self, camera: &::gltf::Camera, node: &Node, map: &DMat4) -> Result<(), SceneError> {
        let ::gltf::camera::Projection::Perspective(lens) = camera.projection() else {
            self.ignore("orthographic cameras");
            return Ok(());
        };
        let number = self.draft.cameras.len() + 1;
        let stated = node.name().or(camera.name()).unwrap_or("camera");
        let name = if self.draft.has_camera(stated) { format!("{stated} {number}") } else { stated.to_owned() };
        if !(lens.yfov() > 0.0 && lens.yfov() < std::f32::consts::PI) {
            return Err(self.out_of_range(&format!("the field of view of camera `{name}`"), "greater than 0 and less than π"));
        }
        let direction = self.axis(map, DVec3::NEG_Z, &name)?;
        let up = self.axis(map, DVec3::Y, &name)?.reject_from_normalized(direction).try_normalize();
        let up = up.ok_or_else(|| broken(self.path, &format!("the transform of `{name}` is flat")))?;
        let camera = Camera {
            name,
            eye: Vec3::ZERO,
            direction: direction.as_vec3(),
            up: up.as_vec3(),
            field_of_view: FieldOfView::Vertical(lens.yfov()),
            size: None,
            sample: Default::default(),
        };
        if let Some(stand) = self.draft.stand(map) {
            self.draft.animation.cameras.push(CameraTrack { camera: self.draft.cameras.len(), stand, angle: None });
        }
        self.draft.add_camera(camera, map.transform_point3(DVec3::ZERO));
        Ok(())
    }

    /// A unit vector of a node's own axes in the world.
    fn axis(&self, map: &DMat4, axis: DVec3, name: &str) -> Result<DVec3, SceneError> {
        map.transform_vector3(axis).try_normalize().ok_or_else(|| broken(self.path, &format!("the transform of `{name}` is flat")))
    }

    fn view_bytes(&self, view: &buffer::View) -> Option<&[u8]> {
        if let Some(bytes) = self.unpacked.views.get(&view.index()) {
            return Some(bytes);
        }
        let end = view.offset().checked_add(view.length())?;
        self.buffers.get(view.buffer().index())?.get(view.offset()..end)
    }

    /// The elements of an accessor as byte strings of its size, each checked to lie inside its buffer.
    fn elements<'s>(&'s self, accessor: &Accessor, view: &buffer::View, offset: usize, size: usize, count: usize) -> Result<Vec<&'s [u8]>, SceneError> {
        let outside = || broken(self.path, &format!("accessor {} reaches past its buffer", accessor.index()));
        let bytes = self.view_bytes(view).and_then(|bytes| bytes.get(offset..)).ok_or_else(outside)?;
        let stride = view.stride().unwrap_or(size).max(1);
        let needed = count.saturating_sub(1).checked_mul(stride).and_then(|start| start.checked_add(size));
        if count > 0 && needed.is_none_or(|needed| needed > bytes.len()) {
            return Err(outside());
        }
        Ok((0..count).map(|index| &bytes[index * stride..index * stride + size]).collect())
    }

    /// Vectors of floats or (normalised) integers, sparse replacements included.
    fn read_vectors<const N: usize>(&self, accessor: &Accessor) -> Result<Vec<[f32; N]>, SceneError> {
        let dimensions = match N {
            1 => Dimensions::Scalar,
            2 => Dimensions::Vec2,
            3 => Dimensions::Vec3,
            4 => Dimensions::Vec4,
            _ => Dimensions::Mat4,
        };
        if accessor.dimensions() != dimensions {
            return Err(broken(self.path, &format!("accessor {} has to hold vectors of {N} numbers", accessor.index())));
        }
        self.expect_count(accessor)?;
        let (size, kind, normalised) = (accessor.size(), accessor.data_type(), accessor.normalized());
        let decode = |bytes: &[u8]| std::array::from_fn(|axis| number(&bytes[axis * kind.size()..], kind, normalised));
        let mut vectors: Vec<[f32; N]> = match accessor.view() {
            Some(view) => self.elements(accessor, &view, accessor.offset(), size, accessor.count())?.into_iter().map(decode).collect(),
            None => match self.unpacked.numbers.get(&accessor.index()) {
                Some(numbers) => numbers.as_chunks().0.to_vec(),
                None => self.zeros(accessor, [0.0; N])?,
            },
        };
        if let Some(sparse) = accessor.sparse() {
            let (indices, values) = (sparse.indices(), sparse.values());
            let index_kind = match indices.index_type() {
                IndexType::U8 => DataType::U8,
                IndexType::U16 => DataType::U16,
                IndexType::U32 => DataType::U32,
            };
            let at = self.elements(accessor, &indices.view(), indices.offset(), index_kind.size(), sparse.count())?;
            let with = self.elements(accessor, &values.view(), values.offset(), size, sparse.count())?;
            for (at, with) in at.into_iter().zip(with) {
                let outside = || broken(self.path, &format!("a sparse index of accessor {} is out of range", accessor.index()));
                *vectors.get_mut(whole_number(at, index_kind) as usize).ok_or_else(outside)? = decode(with);
            }
        }
        Ok(vectors)
    }

    /// The elements of an accessor that no bytes of the file stand for.
    fn zeros<T: Clone>(&self, accessor: &Accessor, zero: T) -> Result<Vec<T>, SceneError> {
        if accessor.count() <= MAX_ZEROS {
            return Ok(vec![zero; accessor.count()]);
        }
        let (index, count, path) = (accessor.index(), accessor.count(), self.path.display());
        Err(SceneError::new(Problem::TooLarge, format!("accessor {index} of `{path}` has {count} elements without a buffer; the limit is {MAX_ZEROS}"))
            .help("store its elements in a buffer"))
    }

    fn read_indices(&self, accessor: &Accessor) -> Result<Vec<u32>, SceneError> {
        let kind = accessor.data_type();
        if accessor.dimensions() != Dimensions::Scalar || !matches!(kind, DataType::U8 | DataType::U16 | DataType::U32) {
            return Err(broken(self.path, &format!("accessor {} has to hold indices", accessor.index())));
        }
        self.expect_count(accessor)?;
        let Some(view) = accessor.view() else { return self.zeros(accessor, 0) };
        let elements = self.elements(accessor, &view, accessor.offset(), kind.size(), accessor.count())?;
        Ok(elements.into_iter().map(|bytes| whole_number(bytes, kind)).collect())
    }

    /// Refuses counts that no scene within the limits can have, before anything is allocated for them.
    fn expect_count(&self, accessor: &Accessor) -> Result<(), SceneError> {
        if accessor.count() <= 3 * MAX_TRIANGLES {
            return Ok(());
        }
        let message =
            format!("accessor {} of `{}` has {} elements; the limit is {}", accessor.index(), self.path.display(), accessor.count(), 3 * MAX_TRIANGLES);
        Err(SceneError::new(Problem::TooLarge, message).help("simplify the geometry or load a part of it"))
    }
}

/// A node's own transform, composed in double precision.
fn node_map(node: &Node) -> DMat4 {
    match node.transform() {
        ::gltf::scene::Transform::Matrix { matrix } => DMat4::from_cols_array_2d(&matrix.map(|column| column.map(f64::from))),
        ::gltf::scene::Transform::Decomposed { translation, rotation, scale } => composed(translation, rotation, scale),
    }
}

fn composed(translation: [f32; 3], rotation: [f32; 4], scale: [f32; 3]) -> DMat4 {
    let rotation = DQuat::from_array(rotation.map(f64::from));
    // A quaternion of no length turns nothing.
    let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    DMat4::from_scale_rotation_translation(scale.map(f64::from).into(), rotation, translation.map(f64::from).into())
}

/// Corners of the triangles of a list, strip or fan. Every other triangle of a strip is turned round.
fn triangles(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => indices.windows(3).enumerate().map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] }).collect(),
        Mode::TriangleFan => indices.get(1..).unwrap_or_default().windows(2).map(|t| [indices[0], t[0], t[1]]).collect(),
        _ => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    }
}

/// One little-endian number; normalised integers map to 0..1 or −1..1.
fn number(bytes: &[u8], kind: DataType, normalised: bool) -> f32 {
    let (value, most) = match (kind, bytes) {
        (DataType::F32, [a, b, c, d, ..]) => return f32::from_le_bytes([*a, *b, *c, *d]),
        (DataType::U8, [a, ..]) => (f32::from(*a), 255.0),
        (DataType::I8, [a, ..]) => (f32::from(*a as i8), 127.0),
        (DataType::U16, [a, b, ..]) => (f32::from(u16::from_le_bytes([*a, *b])), 65535.0),
        (DataType::I16, [a, b, ..]) => (f32::from(i16::from_le_bytes([*a, *b])), 32767.0),
        (DataType::U32, _) => (whole_number(bytes, kind) as f32, 4294967295.0),
        _ => (0.0, 1.0),
    };
    if normalised { (value / most).max(-1.0) } else { value }
}

/// One little-endian unsigned integer.
fn whole_number(bytes: &[u8], kind: DataType) -> u32 {
    match (kind, bytes) {
        (DataType::U8, [a, ..]) => u32::from(*a),
        (DataType::U16, [a, b, ..]) => u32::from(u16::from_le_bytes([*a, *b])),
        (DataType::U32, [a, b, c, d, ..]) => u32::from_le_bytes([*a, *b, *c, *d]),
        _ => 0,
    }
}
