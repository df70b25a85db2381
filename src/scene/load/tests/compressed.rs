//! glTF files that the encoders of meshoptimizer, Draco and Basis Universal have made parts of, by way of Python (`almeshopt` 0.1.12, `DracoPy` 2.2.0, `alktx2` 0.1.7):
//! the grid and the image below, by meshopt's version 0, Draco's default of 14 bits of positions, 10 of normals and 12 of texture coordinates.

use super::{gltf::Builder, *};
use crate::scene::{Scene, load::Problem};
use glam::{Vec2, Vec3};
use serde_json::{Value, json};

const SIZE: [u16; 2] = [6, 5];

/// Positions, normals and texture coordinates.
type Vertices = (Vec<[f32; 3]>, Vec<[f32; 3]>, Vec<[f32; 2]>);

fn vertices() -> Vertices {
    let [width, height] = SIZE;
    let places = || (0..width * height).map(|at| [at % width, at / width]);
    let positions = places().map(|[x, y]| [f32::from(x), f32::from(y), 0.25 * f32::from(x * y % 3)]).collect();
    let normals = places().map(|[x, _]| if x % 2 == 1 { [0.6, 0.0, 0.8] } else { [0.0, 0.0, 1.0] }).collect();
    let uvs = places().map(|[x, y]| [f32::from(x) / 5.0, f32::from(y) / 4.0]).collect();
    (positions, normals, uvs)
}

fn indices() -> Vec<u16> {
    let cell = |[x, y]: [u16; 2]| {
        let at = y * SIZE[0] + x;
        [at, at + 1, at + SIZE[0] + 1, at, at + SIZE[0] + 1, at + SIZE[0]]
    };
    (0..SIZE[1] - 1).flat_map(|y| (0..SIZE[0] - 1).flat_map(move |x| cell([x, y]))).collect()
}

fn builder(extension: &str) -> Builder {
    Builder::new(json!({"nodes": [{"mesh": 0}], "extensionsUsed": [extension], "extensionsRequired": [extension]}))
}

fn loaded(builder: &Builder) -> Scene {
    load_files(&[("thing.glb", &builder.finish())]).map_err(|(error, _)| error).unwrap()
}

/// Corner by corner position, normal and texture coordinate of all triangles, in an order that does not depend on the file's.
fn corners(scene: &Scene) -> Vec<[(Vec3, Vec3, Vec2); 3]> {
    let key = |p: Vec3| (100.0 * p).round().to_array().map(|x| x as i32);
    let mut all: Vec<_> = scene.triangles.iter().map(|t| [0, 1, 2].map(|at| (t.positions[at], t.normals[at], t.uvs[at]))).collect();
    for corners in &mut all {
        let first = (0..3).min_by_key(|at| key(corners[*at].0)).unwrap();
        corners.rotate_left(first);
    }
    all.sort_by_key(|corners| corners.map(|(position, ..)| key(position)));
    all
}

/// As the same grid, uncompressed.
fn expect_grid(scene: &Scene, has_uvs: bool) {
    expect_sound(scene);
    let (positions, normals, uvs) = vertices();
    let mut plain = Builder::new(json!({"nodes": [{"mesh": 0}]}));
    let attributes = json!({"POSITION": plain.floats(&positions), "NORMAL": plain.floats(&normals), "TEXCOORD_0": plain.floats(&uvs)});
    plain.root["meshes"] = json!([{"primitives": [{"attributes": attributes, "indices": plain.indices(&indices())}]}]);
    let (found, expected) = (corners(scene), corners(&loaded(&plain)));
    assert_eq!(found.len(), 40);
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
        let near = found.0.distance(expected.0) < 1e-3 && found.1.distance(expected.1) < 0.02 && (!has_uvs || found.2.distance(expected.2) < 1e-3);
        assert!(near, "{found:?}, not {expected:?}");
    }
    assert!(!scene.notes.iter().any(|note| note.contains("not read")), "{:?}", scene.notes);
}

fn draco(stream: &[u8]) -> Builder {
    let mut builder = builder("KHR_draco_mesh_compression");
    let view = builder.view(stream);
    let vectors = |builder: &mut Builder, kind: &str| builder.accessor(json!({"componentType": 5126, "count": 30, "type": kind}));
    let [positions, normals, uvs] = ["VEC3", "VEC3", "VEC2"].map(|kind| vectors(&mut builder, kind));
    let indices = builder.accessor(json!({"componentType": 5123, "count": 120, "type": "SCALAR"}));
    builder.root["meshes"] = json!([{"primitives": [{
        "attributes": {"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs},
        "indices": indices,
        "extensions": {"KHR_draco_mesh_compression": {"bufferView": view, "attributes": {"POSITION": 2, "NORMAL": 1, "TEXCOORD_0": 0}}},
    }]}]);
    builder
}

#[test]
fn draco_meshes_are_read() {
    for stream in [&include_bytes!("compressed/edgebreaker.drc")[..], include_bytes!("compressed/valence.drc"), include_bytes!("compressed/sequential.drc")] {
        expect_grid(&loaded(&draco(stream)), true);
    }
}

/// Positions and normals of EXT_meshopt_compression, the normals by its octahedral filter, with a buffer for readers that know nothing of it.
fn meshopt(positions: &[u8]) -> Builder {
    let mut builder = builder("EXT_meshopt_compression");
    let parts: [(&[u8], Value); 3] = [
        (positions, json!({"byteStride": 12, "mode": "ATTRIBUTES", "count": 30})),
        (include_bytes!("compressed/normals.meshopt"), json!({"byteStride": 4, "mode": "ATTRIBUTES", "filter": "OCTAHEDRAL", "count": 30})),
        (include_bytes!("compressed/triangles.meshopt"), json!({"byteStride": 4, "mode": "TRIANGLES", "count": 120})),
    ];
    for (stream, mut extension) in parts {
        let view = builder.view(stream);
        let view = &mut builder.root["bufferViews"][view];
        let bytes = extension["byteStride"].as_u64().unwrap() * extension["count"].as_u64().unwrap();
        extension["buffer"] = json!(0);
        (extension["byteOffset"], extension["byteLength"]) = (view["byteOffset"].clone(), view["byteLength"].clone());
        *view = json!({"buffer": 1, "byteLength": bytes, "extensions": {"EXT_meshopt_compression": extension}});
    }
    let vectors = json!({"bufferView": 0, "componentType": 5126, "count": 30, "type": "VEC3"});
    let positions = builder.accessor(vectors);
    builder.root["bufferViews"][1]["byteStride"] = json!(4);
    let normals = builder.accessor(json!({"bufferView": 1, "componentType": 5120, "normalized": true, "count": 30, "type": "VEC3"}));
    let indices = builder.accessor(json!({"bufferView": 2, "componentType": 5125, "count": 120, "type": "SCALAR"}));
    builder.root["meshes"] = json!([{"primitives": [{"attributes": {"POSITION": positions, "NORMAL": normals}, "indices": indices}]}]);
    builder.fallback = Some(json!({"byteLength": 1000, "extensions": {"EXT_meshopt_compression": {"fallback": true}}}));
    builder
}

#[test]
fn meshopt_buffers_are_read() {
    expect_grid(&loaded(&meshopt(include_bytes!("compressed/positions.meshopt"))), false);
}

/// Streams that end early, or begin otherwise, or are anything else.
#[test]
fn broken_streams_are_errors() {
    let (drc, positions) = (&include_bytes!("compressed/edgebreaker.drc")[..], &include_bytes!("compressed/positions.meshopt")[..]);
    for broken in [draco(&drc[..200]), draco(&[0; 64]), draco(b"DRACO"), meshopt(&positions[..40]), meshopt(&[0; 64]), meshopt(&[0xa0])] {
        let Err((error, _)) = load_files(&[("thing.glb", &broken.finish())]) else { panic!("a broken stream was read") };
        assert_eq!(error.problem(), Problem::Format, "{error}");
        assert!(error.to_string().contains("cannot be decoded by"), "{error}");
    }
}

#[test]
fn basis_textures_are_read() {
    for image in [&include_bytes!("compressed/etc1s.ktx2")[..], include_bytes!("compressed/uastc.ktx2")] {
        let mut builder = builder("KHR_texture_basisu");
        let view = builder.view(image);
        let (positions, _, uvs) = vertices();
        let attributes = json!({"POSITION": builder.floats(&positions), "TEXCOORD_0": builder.floats(&uvs)});
        builder.root["images"] = json!([{"bufferView": view, "mimeType": "image/ktx2"}]);
        builder.root["textures"] = json!([{"extensions": {"KHR_texture_basisu": {"source": 0}}}]);
        builder.root["materials"] = json!([{"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
        builder.root["meshes"] = json!([{"primitives": [{"attributes": attributes, "indices": builder.indices(&indices()), "material": 0}]}]);
        let scene = loaded(&builder);
        let texture = &scene.textures[scene.materials[0].texture.unwrap() as usize];
        assert_eq!([texture.width, texture.height], [16, 16]);
        let off = |at: usize, expected: [u8; 4]| (0..4).map(|channel| texture.texels[at][channel].abs_diff(expected[channel])).max().unwrap();
        assert!(off(16 * 3 + 2, [200, 100, 50, 255]) < 12, "{:?}", texture.texels[16 * 3 + 2]);
        assert!(texture.texels[16 * 3 + 13][3] < 12, "{:?}", texture.texels[16 * 3 + 13]);

        let broken = builder.view(&image[..image.len() / 3]);
        builder.root["images"][0]["bufferView"] = json!(broken);
        let scene = loaded(&builder);
        assert!(scene.textures.is_empty() && scene.notes.iter().any(|note| note.contains("could not be read")), "{:?}", scene.notes);
    }
}
