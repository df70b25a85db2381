//! glTF files made here, feature by feature.

use super::*;
use crate::scene::{FieldOfView, Glossy, LightKind, load::Problem};
use glam::{Vec2, Vec3};
use serde_json::{Value, json};

/// A binary glTF file: buffer views and accessors are added as data arrives.
pub(super) struct Builder {
    pub root: Value,
    bytes: Vec<u8>,
    /// A second buffer, which has no bytes.
    pub fallback: Option<Value>,
}

impl Builder {
    pub fn new(root: Value) -> Self {
        let mut root = root;
        root["asset"] = json!({"version": "2.0"});
        root["accessors"] = json!([]);
        root["bufferViews"] = json!([]);
        Self { root, bytes: Vec::new(), fallback: None }
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        let views = self.root["bufferViews"].as_array_mut().unwrap();
        views.push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()}));
        self.bytes.extend_from_slice(bytes);
        views.len() - 1
    }

    pub fn accessor(&mut self, accessor: Value) -> usize {
        let accessors = self.root["accessors"].as_array_mut().unwrap();
        accessors.push(accessor);
        accessors.len() - 1
    }

    pub fn floats<const N: usize>(&mut self, vectors: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = vectors.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        let view = self.view(&bytes);
        let (low, high) = (vec![-1e9; N], vec![1e9; N]);
        self.accessor(json!({"bufferView": view, "componentType": 5126, "count": vectors.len(), "type": format!("VEC{N}"), "min": low, "max": high}))
    }

    pub fn scalars(&mut self, numbers: &[f32]) -> usize {
        let view = self.view(&numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>());
        self.accessor(json!({"bufferView": view, "componentType": 5126, "count": numbers.len(), "type": "SCALAR"}))
    }

    pub fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let view = self.view(&bytes);
        self.accessor(json!({"bufferView": view, "componentType": 5123, "count": indices.len(), "type": "SCALAR"}))
    }

    /// As a text file, and the buffer beside it.
    pub fn finish_as_text(&self, uri: &str) -> (String, Vec<u8>) {
        let mut root = self.root.clone();
        root["buffers"] = json!([{"byteLength": self.bytes.len(), "uri": uri}]);
        (root.to_string(), self.bytes.clone())
    }

    pub fn finish(&self) -> Vec<u8> {
        let mut root = self.root.clone();
        root["buffers"] = std::iter::once(json!({"byteLength": self.bytes.len()})).chain(self.fallback.clone()).collect();
        let (mut text, mut bytes) = (root.to_string().into_bytes(), self.bytes.clone());
        text.resize(text.len().next_multiple_of(4), b' ');
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        let word = |value: usize| (value as u32).to_le_bytes();
        let mut file = b"glTF".to_vec();
        file.extend([word(2), word(28 + text.len() + bytes.len()), word(text.len())].concat());
        file.extend(b"JSON");
        file.extend(text);
        file.extend(word(bytes.len()));
        file.extend(b"BIN\0");
        file.extend(bytes);
        file
    }
}

const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

fn checkerboard() -> Vec<u8> {
    let image = image::RgbaImage::from_fn(2, 2, |x, y| image::Rgba([200, 100, 50, if x == y { 255 } else { 0 }]));
    let mut png = std::io::Cursor::new(Vec::new());
    image.write_to(&mut png, image::ImageFormat::Png).unwrap();
    png.into_inner()
}

/// A textured square below two nodes, a spot light and a camera.
pub(super) fn complete() -> Builder {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let mut builder = Builder::new(json!({
        "scene": 0,
        "scenes": [{"nodes": [0, 2, 3]}],
        "nodes": [
            {"translation": [10, 0, 0], "scale": [-2, 2, 4], "children": [1]},
            {"name": "panel", "mesh": 0, "rotation": [0, half, 0, half]},
            {"name": "torch", "translation": [0, 3, 0], "rotation": [-half, 0, 0, half], "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"name": "eye", "camera": 0, "translation": [1, 2, 3], "rotation": [0, half, 0, half]}
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}],
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_texture_transform", "EXT_unheard_of"],
        "extensionsRequired": ["KHR_texture_transform"],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "spot", "color": [1, 0.5, 0.25], "intensity": 8, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.6}}
        ]}},
        "materials": [{
            "name": "leaf",
            "doubleSided": true,
            "alphaMode": "MASK",
            "alphaCutoff": 0.4,
            "emissiveFactor": [1, 0.5, 0],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 3}},
            "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 0.8], "metallicFactor": 0, "roughnessFactor": 1, "baseColorTexture": {
                "index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform": {"offset": [0.5, 0], "rotation": std::f32::consts::FRAC_PI_2, "scale": [2, 1], "texCoord": 1}}
            }}
        }],
        "textures": [{"source": 0}],
    }));
    let picture = builder.view(&checkerboard());
    builder.root["images"] = json!([{"bufferView": picture, "mimeType": "image/png"}]);
    let (positions, uvs, colours) = (builder.floats(&SQUARE), builder.floats(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), builder.floats(&SQUARE));
    let indices = builder.indices(&[0, 1, 2, 0, 2, 3]);
    let attributes = json!({"POSITION": positions, "TEXCOORD_1": uvs, "COLOR_0": colours});
    builder.root["meshes"] = json!([{"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}]);
    builder
}

fn load_glb(builder: &Builder) -> Result<Scene, SceneError> {
    load_files(&[("thing.glb", &builder.finish())]).map_err(|(error, _)| error)
}

#[test]
fn nodes_materials_lights_and_cameras_are_read() {
    let scene = load_glb(&complete()).unwrap();
    expect_sound(&scene);
    assert_eq!(scene.triangles.len(), 2);
    // The inner node turns +z to +x and +x to −z, the outer one mirrors x and scales.
    for triangle in &scene.triangles {
        assert!(triangle.face_normal().distance(-Vec3::X) < 1e-6, "{triangle:?}");
    }
    let corners: Vec<Vec3> = scene.triangles.iter().flat_map(|t| t.positions).collect();
    for expected in [Vec3::new(10.0, 0.0, 0.0), Vec3::new(10.0, 0.0, -4.0), Vec3::new(10.0, 2.0, -4.0), Vec3::new(10.0, 2.0, 0.0)] {
        assert!(corners.iter().any(|p| p.distance(expected) < 1e-5), "{expected} is not among {corners:?}");
    }

    let material = &scene.materials[0];
    assert_eq!((material.name.as_str(), material.reflectance, material.emission), ("leaf", Vec3::new(0.5, 0.25, 1.0), Vec3::new(3.0, 1.5, 0.0)));
    assert_eq!((material.two_sided, material.glossy, material.alpha_cutoff), (true, None, Some(0.5)));
    let texture = &scene.textures[material.texture.unwrap() as usize];
    assert_eq!((texture.width, texture.height, texture.texels[0], texture.texels[1]), (2, 2, [200, 100, 50, 255], [200, 100, 50, 0]));
    // (1, 0) doubled, turned up by a quarter (v points down), moved by a half.
    assert!(scene.triangles.iter().any(|t| t.tint(Vec2::X).distance(Vec3::new(0.0, 1.0, 0.0)) < 1e-6 || t.tint(Vec2::X) == Vec3::X), "{:?}", scene.triangles);
    let uv = scene.triangles.iter().flat_map(|t| t.positions.into_iter().zip(t.uvs)).find(|(p, _)| p.distance(Vec3::new(10.0, 0.0, -4.0)) < 1e-5);
    assert!(uv.unwrap().1.distance(Vec2::new(0.5, -2.0)) < 1e-5, "{uv:?}");

    let LightKind::Spot { position, direction, intensity, inner, outer } = scene.lights[0].kind else { panic!("not a spot light") };
    assert!(position == Vec3::new(0.0, 3.0, 0.0) && direction.distance(-Vec3::Y) < 1e-6);
    assert_eq!((intensity, inner, outer, scene.lights[0].name.as_str()), (Vec3::new(8.0, 4.0, 2.0), 0.2, 0.6, "torch"));
    let camera = &scene.cameras[0];
    assert!(camera.eye == Vec3::new(1.0, 2.0, 3.0) && camera.direction.distance(-Vec3::X) < 1e-6 && camera.up.distance(Vec3::Y) < 1e-6);
    assert_eq!((camera.field_of_view, camera.name.as_str()), (FieldOfView::Vertical(0.8), "eye"));
    assert_eq!(scene.notes, ["not read from the glTF file: extension EXT_unheard_of"]);
}

/// A document has lights and cameras of its own: that a file's are left out is told.
#[test]
fn a_document_leaves_out_the_lights_and_cameras_of_its_files() {
    let document = r#"Scene(version: 1, geometry: [File("thing.glb")])"#;
    let scene = load_files(&[("scene.ron", document.as_bytes()), ("thing.glb", &complete().finish())]).unwrap();
    assert_eq!((scene.lights.len(), scene.cameras[0].name.as_str()), (0, "whole scene"));
    assert!(scene.notes.iter().any(|note| note.contains("1 lights and 1 cameras")), "{:?}", scene.notes);
}

#[test]
fn strips_fans_quantised_and_sparse_vertices_are_read() {
    let mut builder =
        Builder::new(json!({"nodes": [{"mesh": 0}], "extensionsRequired": ["KHR_mesh_quantization"], "extensionsUsed": ["KHR_mesh_quantization"]}));
    let strip = builder.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]);
    let fan = builder.floats(&SQUARE.map(|[x, y, _]| [x + 2.0, y, 0.0]));
    let bytes: Vec<u8> = [[4_i16, 0, 0, 0], [5, 0, 0, 0], [5, 1, 0, 0]].as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    let view = builder.view(&bytes);
    builder.root["bufferViews"][view]["byteStride"] = json!(8);
    let quantised = builder.accessor(json!({"bufferView": view, "componentType": 5122, "count": 3, "type": "VEC3", "min": [4, 0, 0], "max": [5, 1, 0]}));
    let at = builder.view(&[1, 2]);
    let with: Vec<u8> = [7.0_f32, 0.0, 0.0, 7.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let with = builder.view(&with);
    let sparse = json!({"count": 2, "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": with}});
    let sparse = builder.accessor(json!({"componentType": 5126, "count": 3, "type": "VEC3", "sparse": sparse, "min": [0, 0, 0], "max": [7, 1, 0]}));
    let primitive = |accessor: usize, mode: u32| json!({"attributes": {"POSITION": accessor}, "mode": mode});
    builder.root["meshes"] =
        json!([{"primitives": [primitive(strip, 5), primitive(fan, 6), primitive(quantised, 4), primitive(sparse, 4), primitive(fan, 1)]}]);
    let scene = load_glb(&builder).unwrap();
    expect_sound(&scene);
    assert_eq!(scene.triangles.len(), 6);
    let area: f32 = scene.triangles.iter().map(|t| t.cross().z / 2.0).sum();
    assert_eq!(area, 1.0 + 1.0 + 0.5 + 3.5);
    // The default material is a rough metal, one-sided.
    assert_eq!(scene.materials[0].glossy, Glossy::metallic_roughness(1.0, 1.0));
    assert!(!scene.materials[0].two_sided);
    assert!(scene.notes[0].contains("points and lines"), "{:?}", scene.notes);
}

#[test]
fn a_texture_that_is_missing_leaves_the_colour() {
    let mut builder = complete();
    builder.root["images"] = json!([{"uri": "no%20where.png"}]);
    let scene = load_glb(&builder).unwrap();
    assert_eq!((scene.materials[0].texture, scene.materials[0].alpha_cutoff, scene.textures.len()), (None, None, 0));
    assert!(scene.notes.iter().any(|note| note.contains("no%20where.png")), "{:?}", scene.notes);
}

#[test]
fn text_files_read_their_buffers_beside_them() {
    let (text, bytes) = complete().finish_as_text("the%20data.bin");
    let scene = load_files(&[("thing.gltf", text.as_bytes()), ("the data.bin", &bytes)]).unwrap();
    assert_eq!(scene.triangles, load_glb(&complete()).unwrap().triangles);
}

#[test]
fn ranges_outside_buffers_are_refused() {
    let changes: [(&str, Value); 8] = [
        ("/accessors/0/count", json!(5)),
        ("/accessors/0/count", json!(u64::MAX)),
        ("/accessors/0/byteOffset", json!(u64::MAX)),
        ("/accessors/3/count", json!(1_000_000_000)),
        ("/bufferViews/1/byteLength", json!(u64::MAX)),
        ("/bufferViews/1/byteOffset", json!(u64::MAX - 3)),
        ("/accessors/3/type", json!("VEC4")),
        ("/nodes/1/children", json!([0])),
    ];
    for (pointer, value) in changes {
        let mut builder = complete();
        match builder.root.pointer_mut(pointer) {
            Some(slot) => *slot = value.clone(),
            None => {
                let (parent, key) = pointer.rsplit_once('/').unwrap();
                builder.root.pointer_mut(parent).unwrap()[key] = value.clone();
            }
        }
        assert!(load_glb(&builder).is_err(), "{pointer} = {value} was accepted");
    }
}

#[test]
fn counts_without_bytes_are_refused() {
    let mut builder = Builder::new(json!({"nodes": [{"mesh": 0}]}));
    let (at, with) = (builder.view(&[1]), builder.view(&[0; 12]));
    let sparse = json!({"count": 1, "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": with}});
    let zeros = json!({"componentType": 5126, "count": 30_000_000, "type": "VEC3", "sparse": sparse, "min": [0, 0, 0], "max": [0, 0, 0]});
    let positions = builder.accessor(zeros);
    builder.root["meshes"] = json!([{"primitives": [{"attributes": {"POSITION": positions}}]}]);
    let error = load_glb(&builder).unwrap_err();
    assert_eq!(error.problem(), Problem::TooLarge, "{error}");
}

/// The square in a scene, and what stands in place of a part of its file.
fn changed(pointer: &str, value: Value) -> Builder {
    let mut builder = complete();
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    builder.root.pointer_mut(parent).unwrap()[key] = value;
    builder
}

#[test]
fn what_is_not_read_breaks_no_file() {
    let whole = load_glb(&complete()).unwrap().triangles;
    let target = json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": "/nodes/0/scale"}}});
    let changes = [
        ("/animations", json!([{"channels": [{"sampler": 0, "target": target}], "samplers": [{"input": 99, "output": 99}]}])),
        ("/extensionsRequired", json!(["KHR_animation_pointer", "KHR_materials_variants"])),
        ("/skins", json!([{"joints": [99]}])),
        ("/samplers", json!([{"minFilter": 1}])),
        ("/accessors/0/min", json!([0])),
        ("/accessors/0/max", Value::Null),
        ("/meshes/0/extras", json!({"any": [1, {"thing": null}]})),
        ("/images/0/mimeType", json!("image/unheard-of")),
    ];
    for (pointer, value) in changes {
        let scene = load_glb(&changed(pointer, value)).unwrap_or_else(|error| panic!("{pointer}: {error}"));
        assert_eq!((scene.triangles, scene.textures.len()), (whole.clone(), 1), "{pointer}");
    }
    let (text, bytes) = complete().finish_as_text("a.bin");
    let scene = load_files(&[("thing.gltf", format!("\u{feff}{text}").as_bytes()), ("a.bin", &bytes)]).unwrap();
    assert_eq!(scene.triangles, whole);
}

/// Such a scene shows nothing, but its file is in order.
#[test]
fn a_scene_without_nodes_or_positions_has_no_triangles() {
    for (pointer, value) in [("/scenes", json!([{"name": "empty"}])), ("/meshes/0/primitives/0/attributes", json!({}))] {
        let error = load_glb(&changed(pointer, value)).unwrap_err();
        assert_eq!(error.problem(), Problem::NoTriangles, "{error}");
    }
}

#[test]
fn what_an_extension_would_supply_is_named() {
    let notes = |builder: &Builder| load_glb(builder).unwrap().notes.join("\n");
    let dds = json!([{"name": "bark", "extensions": {"MSFT_texture_dds": {"source": 0}}}]);
    let scene = load_glb(&changed("/textures", dds)).unwrap();
    assert_eq!((scene.materials[0].texture, scene.materials[0].reflectance), (None, Vec3::new(0.5, 0.25, 1.0)));
    let expected = "their surfaces go without: bark (its image is supplied by MSFT_texture_dds, which is not read)";
    assert!(scene.notes.iter().any(|note| note.contains(expected)), "{:?}", scene.notes);
    assert!(notes(&changed("/textures", json!([{}]))).contains("texture 0 (it names no image)"));
    assert!(notes(&changed("/images", json!([{}]))).contains("texture 0 (it names no image)"));
    assert!(notes(&changed("/extensionsUsed", json!(["MSFT_texture_dds"]))).contains("MSFT_texture_dds, which supplies textures"));

    let fallback = br#"{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 9, "extensions": {"KHR_meshopt_compression": {"fallback": true}}}]}"#;
    let (error, _) = load_files(&[("thing.gltf", fallback)]).unwrap_err();
    assert_eq!(error.problem(), Problem::Unsupported);
    assert!(error.to_string().contains("buffer 0") && error.to_string().contains("KHR_meshopt_compression"), "{error}");
}

#[test]
fn data_uris_need_no_padding() {
    let (text, bytes) = complete().finish_as_text("URI");
    let encode = |engine: base64::engine::GeneralPurpose| base64::Engine::encode(&engine, &bytes);
    let escaped: String = bytes.iter().map(|byte| format!("%{byte:02x}")).collect();
    let (padded, bare) = (encode(base64::engine::general_purpose::STANDARD), encode(base64::engine::general_purpose::STANDARD_NO_PAD));
    for uri in [format!("data:application/octet-stream;base64,{padded}"), format!("data:;base64,{bare}"), format!("data:,{escaped}")] {
        let scene = load_files(&[("thing.gltf", text.replace("URI", &uri).as_bytes())]).unwrap();
        assert_eq!(scene.triangles, load_glb(&complete()).unwrap().triangles);
    }
}

/// A square before a turned node, which has it at three places.
pub(super) fn instanced() -> Builder {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let mut builder = Builder::new(json!({
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "grove", "mesh": 0, "translation": [10, 0, 0], "rotation": [0, half, 0, half]}],
        "extensionsUsed": ["EXT_mesh_gpu_instancing"],
        "extensionsRequired": ["EXT_mesh_gpu_instancing"],
    }));
    let (positions, indices) = (builder.floats(&SQUARE), builder.indices(&[0, 1, 2, 0, 2, 3]));
    let translations = builder.floats(&[[0.0, 0.0, 0.0], [0.0, 0.0, 5.0], [1.0, 2.0, 3.0]]);
    let rotations = builder.floats(&[[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, half, half], [0.0, 0.0, 0.0, 0.0]]);
    let scales = builder.floats(&[[1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [-1.0, 3.0, 1.0]]);
    builder.root["meshes"] = json!([{"primitives": [{"attributes": {"POSITION": positions}, "indices": indices}]}]);
    let attributes = json!({"TRANSLATION": translations, "ROTATION": rotations, "SCALE": scales, "_ID": 99});
    builder.root["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    builder
}

#[test]
fn a_mesh_stands_at_each_place_of_its_node() {
    let scene = load_glb(&instanced()).unwrap();
    expect_sound(&scene);
    assert_eq!((scene.triangles.len(), scene.objects.len(), &scene.objects[0].triangles), (6, 1, &(0..6)));
    // The corner that the square has at (1, 0, 0), by each place; the node turns +x to −z and +z to +x.
    let origin = scene.origin.as_vec3();
    for (instance, expected) in [Vec3::new(10.0, 0.0, -1.0), Vec3::new(15.0, 2.0, 0.0), Vec3::new(13.0, 2.0, 0.0)].into_iter().enumerate() {
        let corners = scene.triangles[2 * instance..2 * instance + 2].iter().flat_map(|triangle| triangle.positions);
        let corners: Vec<Vec3> = corners.map(|position| position + origin).collect();
        assert!(corners.iter().any(|corner| corner.distance(expected) < 1e-5), "{instance}: {expected} is not among {corners:?}");
    }
    // Where all of its attributes are missing, it stands once.
    let mut bare = instanced();
    bare.root["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {}});
    assert_eq!(load_glb(&bare).unwrap().triangles.len(), 2);
    let broken = |key: &str, accessor: Value| {
        let mut builder = instanced();
        builder.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"][key] = accessor;
        load_glb(&builder).unwrap_err().to_string()
    };
    assert!(broken("SCALE", json!(0)).contains("EXT_mesh_gpu_instancing of node 0 has attributes of different lengths"));
    assert!(broken("ROTATION", json!(99)).contains("EXT_mesh_gpu_instancing of node 0 names an accessor for ROTATION that is not there"));
    assert!(broken("TRANSLATION", json!("x")).contains("names an accessor for TRANSLATION that is not there"));
    assert!(broken("TRANSLATION", json!(3)).contains("has to hold vectors of 3 numbers"));
}
