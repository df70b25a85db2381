//! OBJ and MTL.

use super::*;
use crate::scene::Glossy;
use glam::{Vec2, Vec3};

const LIBRARY: &str = "newmtl lamp\r\nKd 0.5 0.5 0.5\r\nKe 17 12 4\r\nillum 2\r\nKs 0 0 0\r\n\r\nnewmtl shiny\r\nKd 0.2\r\nKs 0.1 0.1 0.1\r\nNs 20\r\nmap_Kd -s 1 1 1 nowhere\\wood.png\r\n\
    newmtl odd\r\nKd 2 0 x\r\n";

#[test]
fn faces_materials_and_faults_are_taken_as_they_are() {
    let object = "mtllib gone.mtl\r\nv 0 0 0\r\nv 1 0 0 # a comment\r\nv 1 1 0\r\nv 0 1 \\\r\n0\r\nvt 0 0\r\nvt 1 0.25\r\nvn 0 0 -1\r\nvn 0 0 0\r\n\
        o square\r\nusemtl lamp\r\nf 1/1/1 2/2/1 3//1 4//1\r\nusemtl shiny\r\nf -4 -3 -1\r\nusemtl odd\r\nf 1//2 3//2 4//2\r\nusemtl gone\r\nf 1 2 4\r\nf 1 2\r\n";
    let scene = load_files(&[("thing.obj", object.as_bytes()), ("thing.mtl", LIBRARY.as_bytes())]).unwrap();
    expect_sound(&scene);
    let names: Vec<&str> = scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["lamp", "shiny", "odd", "gone"]);
    assert!(scene.materials.iter().all(|m| m.two_sided));
    assert_eq!(scene.materials[0].emission, Vec3::new(17.0, 12.0, 4.0));
    assert_eq!(scene.materials[0].glossy, None);
    assert_eq!(scene.materials[1].glossy, Some(Glossy::Phong { reflectance: Vec3::splat(0.1), exponent: 20.0 }));
    assert_eq!(scene.materials[1].reflectance, Vec3::splat(0.2));
    assert_eq!(scene.triangles.len(), 5);
    // The file's normal points backwards here and is turned to the front.
    assert_eq!(scene.triangles[0].normals[0], Vec3::Z);
    assert_eq!(scene.triangles[0].uvs[1], Vec2::new(1.0, 0.75));
    insta::assert_snapshot!("notes_of_an_obj", scene.notes.join("\n"));
}

/// Classic Mac OS ended lines so, and Windows has editors that write UTF-16.
#[test]
fn files_of_other_systems_are_read() {
    const SQUARE: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl red\nf 1 2 3 4\n";
    const RED: &str = "newmtl red\nKd 0.5 0 0\n";
    let wide = |text: &str| text.encode_utf16().flat_map(u16::to_be_bytes).collect::<Vec<u8>>();
    let returns = |text: &str| text.replace('\n', "\r").into_bytes();
    for (object, library) in [
        (returns(SQUARE), returns(RED)),
        (returns(SQUARE), RED.replace('\n', "\r\n").into_bytes()),
        ([b"\xfe\xff".to_vec(), wide(SQUARE)].concat(), RED.into()),
    ] {
        let scene = load_files(&[("a.obj", &object), ("a.mtl", &library)]).unwrap();
        assert_eq!((scene.triangles.len(), scene.materials[0].reflectance), (2, Vec3::new(0.5, 0.0, 0.0)));
    }
}

#[test]
fn concave_polygons_cover_what_is_inside_them() {
    let corners = [[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]];
    let positions: String = corners.iter().map(|[x, y]| format!("v {x} {y} 5\nvt {x} {y}\n")).collect();
    let object = format!("{positions}f 1/1 2/2 3/3 4/4 5/5 6/6 7/7 8/8\n");
    let document = r#"Scene(version: 1, geometry: [File("a.obj")])"#;
    for files in [&[("a.obj", object.as_bytes())][..], &[("a.ron", document.as_bytes()), ("a.obj", object.as_bytes())]] {
        let scene = load_files(files).unwrap();
        expect_sound(&scene);
        let area: f32 = scene.triangles.iter().map(|t| t.cross().length() / 2.0).sum();
        assert!((area - 7.0).abs() < 1e-5, "{area}");
        let kept = scene.triangles.iter().flat_map(|t| t.positions.into_iter().zip(t.uvs)).all(|(at, uv)| uv == Vec2::new(at.x, 1.0 - at.y));
        assert!(kept, "{:?}", scene.triangles);
    }
    let bow = load_files(&[("a.obj", b"v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 4\n")]).unwrap();
    assert!(bow.notes[0].contains("1 polygons are twisted, cross themselves"), "{:?}", bow.notes);
}

#[test]
fn what_is_left_out_is_counted_in_one_note() {
    let library = "newmtl glass\nd 0.5\nTr 0.5\nmap_d a.png\nbump -bm 2 b.png\nPr 0.2\nPm 0\nTf 1 1 1\n\
        newmtl lit\nKe 1 1 1\nmap_ke lit.png\nmap_BUMP b.png\nPm 1.0\nd 1\nmap_Kd -s 2 2 2 c.png\n\
        newmtl unused\nTr 1\ndisp d.png\n";
    let object = "mtllib a.mtl b.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0\ns 1\nusemtl glass\nf 1 2 3\ns off\nusemtl lit\nf 3 2 1\n\
        l 1 2\np 1\ncurv 0 1 1 2\nlod 3\n";
    let files: [(&str, &[u8]); 3] = [("a.obj", object.as_bytes()), ("a.mtl", library.as_bytes()), ("b.mtl", b"newmtl other\n")];
    let scene = load_files(&files).unwrap();
    assert_eq!(scene.materials[1].emission, Vec3::ZERO);
    insta::assert_snapshot!("unread_parts_of_an_obj", scene.notes.join("\n"));
    // A document that describes a material in place of the file has nothing to leave out of it.
    let document = br#"Scene(version: 1, geometry: [File("a.obj")], materials: { "*": Diffuse(reflectance: (0.5, 0.5, 0.5)) })"#;
    let scene = load_files(&[&[("a.ron", &document[..])], &files[..]].concat()).unwrap();
    assert!(!scene.notes[0].contains("glass") && !scene.notes[0].contains("map_d") && scene.notes[0].contains("lines and points"), "{:?}", scene.notes);
}

/// 3ds Max numbers its materials so.
#[test]
fn names_may_hold_number_signs() {
    let library = b"newmtl Material #1\nKd 0.1 0.1 0.1 # dark\nnewmtl Material #2 # a comment\nKd 0.2 0.2 0.2\n";
    let object = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl Material #1\nf 1 2 3 #first\nusemtl Material #2\nf 3 2 1\n# end\n";
    let scene = load_files(&[("a.obj", object), ("a.mtl", library)]).unwrap();
    assert_eq!(scene.materials.iter().map(|m| m.reflectance.x).collect::<Vec<_>>(), [0.1, 0.2]);
}
