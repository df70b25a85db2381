//! PLY: as text and in both orders of bytes.

use super::*;
use crate::scene::load::Problem;
use glam::{Vec2, Vec3};

/// An L of six corners and a triangle, with what a scanner and MeshLab write beside them.
const HEADER: &str = "comment made here\nobj_info nothing\nelement vertex 7\nproperty float x\nproperty double y\nproperty float z\nproperty uchar red\n\
    property uchar green\nproperty uchar blue\nproperty uchar alpha\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float s\nproperty float t\n\
    element range_grid 2\nproperty list uchar short numbers\nelement face 2\nproperty list uchar int vertex_indices\nproperty ushort flags\nend_header\n";

/// Numbers of the vertices, with the type of each by a letter.
const VERTEX: &str = "fdfbbbbfffff";
const CORNERS: [[f64; 2]; 7] = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0], [3.0, 3.0]];

/// The body, number by number: a letter for the type, and the value.
fn body() -> Vec<(char, f64)> {
    let vertex = |[x, y]: [f64; 2]| [x, y, 5.0, 255.0, 0.0, 188.0, 9.0, 0.0, 0.0, 2.0, x, y];
    let vertices = CORNERS.into_iter().flat_map(|corner| VERTEX.chars().zip(vertex(corner)));
    let list = |kind: char, values: &[f64]| [vec![('b', values.len() as f64)], values.iter().map(|value| (kind, *value)).collect()].concat();
    let grids = [list('h', &[-7.0, 300.0]), list('h', &[])].concat();
    let faces = [list('i', &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]), vec![('H', 65535.0)], list('i', &[1.0, 6.0, 2.0]), vec![('H', 0.0)]].concat();
    vertices.chain(grids).chain(faces).collect()
}

fn little(kind: char, value: f64) -> Vec<u8> {
    match kind {
        'f' => (value as f32).to_le_bytes().to_vec(),
        'd' => value.to_le_bytes().to_vec(),
        'b' => vec![value as u8],
        'h' => (value as i16).to_le_bytes().to_vec(),
        'H' => (value as u16).to_le_bytes().to_vec(),
        _ => (value as i32).to_le_bytes().to_vec(),
    }
}

/// The same file as text, and in both orders of bytes.
pub(super) fn all_encodings() -> [Vec<u8>; 3] {
    let header = |format: &str| format!("ply\nformat {format} 1.0\n{HEADER}").into_bytes();
    let text: String = body().iter().map(|(_, value)| format!("{value} ")).collect();
    let bytes = |turn: fn(Vec<u8>) -> Vec<u8>| body().into_iter().flat_map(|(kind, value)| turn(little(kind, value))).collect::<Vec<u8>>();
    [
        [header("ascii"), text.into_bytes()].concat(),
        [header("binary_little_endian"), bytes(|bytes| bytes)].concat(),
        [header("binary_big_endian"), bytes(|bytes| bytes.into_iter().rev().collect())].concat(),
    ]
}

fn load_one(file: &[u8]) -> Result<Scene, SceneError> {
    load_files(&[("a.ply", file)]).map_err(|(error, _)| error)
}

#[test]
fn every_encoding_is_read_alike() {
    for file in all_encodings() {
        let scene = load_one(&file).unwrap();
        expect_sound(&scene);
        let area: f32 = scene.triangles.iter().map(|t| t.cross().length() / 2.0).sum();
        assert!(scene.triangles.len() == 5 && (area - 3.5).abs() < 1e-5, "{area}: {:?}", scene.triangles);
        for triangle in &scene.triangles {
            assert_eq!(triangle.normals, [Vec3::Z; 3]);
            assert!(triangle.positions.iter().zip(triangle.uvs).all(|(at, uv)| uv == Vec2::new(at.x, 1.0 - at.y)), "{triangle:?}");
            // sRGB 188 is half of all light.
            assert!(triangle.tints[1].colour().distance(Vec3::new(1.0, 0.0, 0.503)) < 2e-3, "{}", triangle.tints[1].colour());
        }
        assert_eq!((scene.materials.len(), scene.materials[0].reflectance, scene.materials[0].two_sided), (1, Vec3::splat(0.7), true));
        assert_eq!(scene.notes, ["the file has no camera: one that sees the whole scene was made"]);
    }
}

#[test]
fn a_document_gives_it_a_material() {
    let document = r#"Scene(version: 1, geometry: [File("a.ply")], materials: { "default": Diffuse(reflectance: (0.1, 0.2, 0.3)) })"#;
    let scene = load_files(&[("a.ron", document.as_bytes()), ("a.ply", &all_encodings()[1])]).map_err(|(error, _)| error).unwrap();
    assert_eq!(scene.materials[0].reflectance, Vec3::new(0.1, 0.2, 0.3));
}

#[test]
fn what_is_left_out_of_a_ply_is_told() {
    let header = "ply\r\nformat ascii 1.0\r\ncomment TextureFile my skin.png\r\nelement vertex 3\r\nproperty float x\r\nproperty float y\r\nproperty float z\r\n\
        element face 2\r\nproperty list uchar uint vertex_index\r\nelement tristrips 1\r\nproperty list int int vertex_indices\r\nend_header\r\n";
    let scene = load_one(format!("{header}0 0 0\r\n1 0 0\r\n0 1 0\r\n3 0 1 2\r\n2 0 1\r\n3 0 1 2\r\n").as_bytes()).unwrap();
    assert_eq!(scene.triangles.len(), 1);
    assert_eq!(scene.notes[0], "a.ply: 1 faces have fewer than three corners and were left out");
    assert_eq!(scene.notes[1], "not read from the PLY file: `tristrips`, texture `my skin.png`");
}

#[test]
fn broken_ply_files_are_refused() {
    let [text, binary, _] = all_encodings();
    let text = String::from_utf8(text).unwrap();
    for (from, to, told) in [
        ("ply\n", "play\n", "does not begin with `ply`"),
        ("ascii", "base64", "the format `base64` is not known"),
        ("end_header\n", "", "its header has no end"),
        ("element vertex 7", "element vertex -7", "`-7` is no number of elements"),
        ("element vertex 7", "element vertex 9", "it ends too early"),
        ("property float z\n", "", "no x, y and z"),
        ("vertex_indices", "corners", "no list `vertex_indices`"),
        ("property float x", "property complex x", "the property `complex x` is not understood"),
        ("6 0 1", "6 0 -1", "a face names vertex -1 of 7"),
        ("6 0 1", "6 0 x", "`x` is no number"),
        ("6 0 1", "6 7 1", "a face names vertex 7 of 7"),
    ] {
        let error = load_one(text.replacen(from, to, 1).as_bytes()).unwrap_err();
        assert!(error.problem() == Problem::Format && error.to_string().contains(told), "{from} → {to}: {error}");
    }
    assert!(load_one(&binary[..binary.len() - 1]).unwrap_err().to_string().contains("it ends too early"));
    let many = text.replace("element vertex 7", "element vertex 99999999999");
    assert_eq!(load_one(many.as_bytes()).unwrap_err().problem(), Problem::TooLarge);
    // Nothing to read of what has no properties, however many there are.
    let endless = text.replace("element face", "element nothing 99999999999\nelement face");
    assert_eq!(load_one(endless.as_bytes()).unwrap().triangles.len(), 5);
}
