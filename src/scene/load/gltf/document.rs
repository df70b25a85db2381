//! The JSON of a glTF file: its version and extensions judged, and mended where the crate that reads it asks for more than glTF does.

use super::{animation::Animations, broken, deform::Skins, list};
use crate::scene::load::{
    error::{Problem, SceneError},
    files::Bytes,
};
use ::gltf::{
    Document,
    binary::Glb,
    json::{
        self, Index, Root,
        mesh::Semantic,
        validation::{Checked, Error as Fault, Validate},
    },
};
use serde_json::{Value, json};
use std::{ops::Range, path::Path};

/// The extensions that are read here. Quantised meshes need nothing but integer attributes.
pub(super) const EXTENSIONS: [&str; 14] = [
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_mesh_quantization",
];

/// Extensions that may be required though they are not read: they change nothing of what a file shows at first.
const HARMLESS: [&str; 3] = ["KHR_animation_pointer", "KHR_materials_variants", "KHR_xmp_json_ld"];

/// Of samplers: at full size alone, then by mipmaps.
const MIN_FILTERS: [u64; 6] = [9728, 9729, 9984, 9985, 9986, 9987];

/// A file whose JSON can be relied on, and what was taken out of it because the crate does not read it, or asks too much of it.
pub(super) struct Opened {
    pub document: Document,
    pub blob: Option<Bytes>,
    pub animations: Animations,
    pub skins: Skins,
}

/// Reads the JSON of a `.gltf` or `.glb` file.
pub(super) fn open(path: &Path, bytes: &Bytes) -> Result<Opened, SceneError> {
    let (text, blob) = if bytes.starts_with(b"glTF") { chunks(path, bytes)? } else { (0..bytes.len(), None) };
    let text = &bytes[text];
    let text = text.strip_prefix("\u{feff}".as_bytes()).unwrap_or(text);
    let mut root: Value = serde_json::from_slice(text).map_err(|error| broken(path, &error.to_string()))?;
    expect_version(path, &root)?;
    expect_known_extensions(path, &root)?;
    let (animations, skins) = mend(&mut root);
    let root: Root = serde_path_to_error::deserialize(root).map_err(|error| broken(path, &error.to_string()))?;
    expect_valid(path, &root)?;
    Ok(Opened { document: Document::from_json_without_validation(root), blob: blob.and_then(|range| bytes.part(range)), animations, skins })
}

/// Where the JSON text and the binary chunk of a binary file are.
fn chunks(path: &Path, bytes: &[u8]) -> Result<(Range<usize>, Option<Range<usize>>), SceneError> {
    /// Of the file: its kind, version and length.
    const HEADER: usize = 12;
    /// Of a chunk: its length and kind.
    const CHUNK: usize = 8;
    let word = |at: usize| bytes.get(at..at + 4).and_then(|word| word.try_into().ok()).map(u32::from_le_bytes);
    if word(4) == Some(1) {
        return Err(old(path));
    }
    if word(8).is_none_or(|stated| !(HEADER..=bytes.len()).contains(&(stated as usize))) {
        return Err(broken(path, "the file is not as long as its header says"));
    }
    let glb = Glb::from_slice(bytes).map_err(|error| broken(path, &error.to_string()))?;
    let text = HEADER + CHUNK..HEADER + CHUNK + glb.json.len();
    let binary = glb.bin.map(|binary| text.end + CHUNK..text.end + CHUNK + binary.len());
    Ok((text, binary))
}

fn old(path: &Path) -> SceneError {
    SceneError::new(Problem::Version, format!("`{}` is glTF 1.0; only glTF 2.0 is read", path.display()))
        .help("convert it to glTF 2.0, for example with gltf-pipeline")
}

fn expect_version(path: &Path, root: &Value) -> Result<(), SceneError> {
    let asset = &root["asset"];
    let stated = |key: &str| asset[key].as_str().map(str::to_owned).or_else(|| asset[key].as_f64().map(|version| format!("{version:?}")));
    let major = |version: &str| version.split('.').next().and_then(|major| major.parse::<u32>().ok());
    match stated("minVersion").or_else(|| stated("version")).as_deref().map(|version| (version, major(version))) {
        Some((_, Some(0 | 1))) => Err(old(path)),
        Some((version, Some(3..))) => {
            Err(SceneError::new(Problem::Version, format!("`{}` is glTF {version}; only glTF 2.0 is read", path.display())).help("export it as glTF 2.0"))
        }
        // The first version had maps where the second one has lists, and often no version.
        None if ["accessors", "meshes", "nodes"].iter().any(|key| root[key].is_object()) => Err(old(path)),
        _ => Ok(()),
    }
}

fn expect_known_extensions(path: &Path, root: &Value) -> Result<(), SceneError> {
    let required = root["extensionsRequired"].as_array().into_iter().flatten().filter_map(Value::as_str);
    let unknown: Vec<String> = required.filter(|name| !EXTENSIONS.contains(name) && !HARMLESS.contains(name)).map(str::to_owned).collect();
    if unknown.is_empty() {
        return Ok(());
    }
    Err(SceneError::new(Problem::Unsupported, format!("`{}` requires glTF extensions that are not supported: {}", path.display(), list(&unknown)))
        .help(format!("export it without them; supported are {}", EXTENSIONS.join(", "))))
}

/// Takes out what is not read by the crate, so that no fault in it matters, and adds what glTF lets files leave out but the crate does not. Tells what
/// animations and skins there are.
fn mend(root: &mut Value) -> (Animations, Skins) {
    let Some(root) = root.as_object_mut() else { return Default::default() };
    root.remove("extensionsRequired");
    let animations = root.remove("animations").map(|animations| Animations::of(&animations)).unwrap_or_default();
    let mut of_nodes = Vec::new();
    for_each(root.get_mut("nodes"), |node| of_nodes.push(node.remove("skin").filter(|skin| !skin.is_null())));
    let skins = Skins::new(root.remove("skins"), of_nodes);
    for_each(root.get_mut("scenes"), |scene| {
        scene.entry("nodes").or_insert_with(|| json!([]));
    });
    for_each(root.get_mut("samplers"), |sampler| {
        sampler.remove("magFilter");
        // One that does not exist says as little as none.
        if !sampler.get("minFilter").and_then(Value::as_u64).is_some_and(|filter| MIN_FILTERS.contains(&filter)) {
            sampler.remove("minFilter");
        }
    });
    let mut is_empty = Vec::new();
    for_each(root.get_mut("images"), |image| {
        is_empty.push(!image.contains_key("uri") && !image.contains_key("bufferView"));
        // What kind of image it is shows in its bytes.
        image.entry("mimeType").or_insert_with(|| json!(""));
    });
    for_each(root.get_mut("textures"), |texture| {
        for extension in ["EXT_texture_webp", "KHR_texture_basisu"] {
            if let Some(source) = texture.get("extensions").and_then(|extensions| extensions.get(extension)?.get("source")).cloned() {
                texture.entry("source").or_insert(source);
            }
        }
        if texture.get("source").and_then(Value::as_u64).and_then(|source| is_empty.get(source as usize)) == Some(&true) {
            texture.remove("source");
        }
    });
    (animations, skins)
}

fn for_each(list: Option<&mut Value>, change: impl FnMut(&mut serde_json::Map<String, Value>)) {
    list.and_then(Value::as_array_mut).into_iter().flatten().filter_map(Value::as_object_mut).for_each(change);
}

/// The crate's own checks, without those that only matter to what is not read.
fn expect_valid(path: &Path, root: &Root) -> Result<(), SceneError> {
    let is_outside = |index: &&Index<json::Accessor>| index.value() >= root.accessors.len();
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    // The crate looks up positions before it checks where they are.
    if let Some(index) = primitives.filter_map(|primitive| primitive.attributes.get(&Checked::Valid(Semantic::Positions))).find(is_outside) {
        return Err(broken(path, &format!("positions are in accessor {index} of {}", root.accessors.len())));
    }
    let mut faults = Vec::new();
    root.validate(root, json::Path::new, &mut |place, fault| {
        let place = place();
        if !is_tolerated(place.as_str(), fault) {
            faults.push(format!("{} {}", place.as_str(), in_words(fault)));
        }
    });
    if faults.is_empty() { Ok(()) } else { Err(broken(path, &list(&faults))) }
}

/// Bounds of positions are not used; positions may be missing, and an accessor without a buffer is full of zeros.
fn is_tolerated(place: &str, fault: Fault) -> bool {
    let is_bound = place.ends_with("[\"POSITION\"].min") || place.ends_with("[\"POSITION\"].max");
    let is_optional = place.ends_with("[\"POSITION\"]") || place.starts_with("accessors[") && place.ends_with("].bufferView");
    is_bound || is_optional && fault == Fault::Missing
}

fn in_words(fault: Fault) -> &'static str {
    match fault {
        Fault::IndexOutOfBounds => "is an index of nothing",
        Fault::Invalid => "has a value that is not allowed",
        Fault::Missing => "is missing",
        Fault::Oversize => "is too large",
        Fault::Unsupported => "is not supported",
    }
}
