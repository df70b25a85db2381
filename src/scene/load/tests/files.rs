//! Files that scenes name: shared, within a limit, and none that never ends.

use super::*;
use crate::scene::load::{Draft, FileSystem, Memory, Problem, load_geometry};
use std::sync::Arc;

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

#[test]
fn a_document_that_is_no_document_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.ron");
    std::fs::File::create(&path).unwrap().set_len(1 << 32).unwrap();
    let error = load(&path, &LoadOptions::default()).unwrap_err();
    assert!(error.problem() == Problem::TooLarge && error.to_string().contains("larger than 256 MiB"), "{error}");
}

#[test]
fn a_file_is_read_up_to_its_limit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    std::fs::write(&path, "four").unwrap();
    assert_eq!(Disk.read(&path, 4).unwrap(), b"four");
    assert_eq!(Disk.read(&path, 3).unwrap_err().kind(), std::io::ErrorKind::FileTooLarge);
}

#[test]
fn a_file_is_held_once_and_all_are_limited() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::create_dir(path("b")).unwrap();
    std::fs::write(path("one"), "sixsix").unwrap();
    std::fs::write(path("two"), "sixsix").unwrap();
    let files = Files::within(10, &Disk);
    let first = files.read(&path("one")).unwrap();
    let again = files.read(&path("b/../one")).unwrap();
    assert_eq!(first.as_ptr(), again.as_ptr());
    assert_eq!((first.part(1..3).as_deref(), first.part(1..7).is_none()), (Some(&b"ix"[..]), true));
    let error = files.read(&path("two")).err().unwrap();
    assert_eq!(error.problem(), Problem::TooLarge, "{error}");
    assert!(error.to_string().contains("two"), "{error}");
}

#[test]
fn buffers_of_one_file_take_its_memory_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let buffer = r#"{"byteLength": 1000, "uri": "a.bin"}"#;
    std::fs::write(&path, format!(r#"{{"asset": {{"version": "2.0"}}, "buffers": [{}]}}"#, [buffer; 200].join(","))).unwrap();
    std::fs::write(folder.path().join("a.bin"), [0; 1000]).unwrap();
    load_geometry(&path, &Files::within(20_000, &Disk), &mut Draft::default(), &|_| true).unwrap();
}

/// A scene whose document, geometry and materials are nowhere on a disk.
#[test]
fn a_scene_is_loaded_from_memory() {
    let document = br#"Scene(version: 1, geometry: [File("../models/a.obj")], lights: [Point(position: (0.2, 0.2, 1.0), intensity: (1.0, 1.0, 1.0))])"#;
    let library = b"newmtl red\nKd 0.5 0 0\n";
    let object = format!("mtllib sub/a.mtl\nusemtl red\n{TRIANGLE}");
    let files = |library_name: &'static str| {
        let named: [(&str, Vec<u8>); 3] =
            [("scenes/a.ron", document.to_vec()), ("models/a.obj", object.clone().into_bytes()), (library_name, library.to_vec())];
        LoadOptions { files: Arc::new(Memory::new(named)), ..LoadOptions::default() }
    };
    let scene = load(Path::new("scenes/a.ron"), &files("models/sub/a.mtl")).unwrap();
    assert!(scene.triangles.len() == 1 && !scene.notes.iter().any(|note| note.contains("a.mtl")), "{:?}", scene.notes);
    assert_eq!(scene.materials[scene.triangles[0].material as usize].reflectance, glam::Vec3::new(0.5, 0.0, 0.0));
    let lacking = load(Path::new("scenes/a.ron"), &files("elsewhere.mtl")).unwrap();
    assert!(lacking.notes.iter().any(|note| note.contains("a.mtl")), "{:?}", lacking.notes);
    let on_disk = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/hall.ron");
    assert!(Path::new(on_disk).is_file());
    assert_eq!(load(Path::new(on_disk), &files("a.mtl")).unwrap_err().problem(), Problem::NotFound);
}

/// A pipe that nobody writes into blocks whoever opens it, and the device has no end.
#[test]
#[cfg(unix)]
fn what_never_ends_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.obj");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let load_path = |path: &Path| load(path, &LoadOptions::default());
    let scene = |name: &str, text: String| {
        std::fs::write(folder.path().join(name), text).unwrap();
        load_path(&folder.path().join(name))
    };
    for endless in [pipe.as_path(), Path::new("/dev/zero")] {
        let named = endless.display();
        let error = load_path(endless).unwrap_err();
        assert_eq!(error.problem(), Problem::Unreadable, "{error}");
        let buffer = scene("a.gltf", format!(r#"{{"asset": {{"version": "2.0"}}, "buffers": [{{"byteLength": 1, "uri": "{named}"}}]}}"#)).unwrap_err();
        assert_eq!(buffer.to_string(), format!("`{named}` is not a regular file"));
        std::fs::write(folder.path().join("a.mtl"), format!("newmtl a\nmap_Kd {named}\n")).unwrap();
        let textured = scene("a.obj", format!("mtllib a.mtl\nusemtl a\n{TRIANGLE}")).unwrap();
        assert!(textured.notes.iter().any(|note| note.contains("is not a regular file")), "{:?}", textured.notes);
        let described = scene("b.obj", format!("mtllib {named}\n{TRIANGLE}")).unwrap();
        assert!(described.notes.iter().any(|note| note.contains(&format!("`{named}` is missing"))), "{:?}", described.notes);
        let sky = super::sky::DOCUMENT.replace("sky.exr", &named.to_string());
        assert_eq!(scene("a.ron", sky).unwrap_err().problem(), Problem::NotFound);
    }
}
