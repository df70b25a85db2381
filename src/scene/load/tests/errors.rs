//! Every code once, as the user sees it.

use super::*;
use crate::scene::load::{
    Problem,
    error::{Faults, SourceText, Together},
};
use miette::{GraphicalReportHandler, GraphicalTheme};
use std::path::Path;

fn rendered(error: &SceneError) -> String {
    let mut text = String::new();
    GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor()).with_width(120).render_report(&mut text, error).unwrap();
    text
}

/// The message about a document that is right but for one part.
fn message(problem: Problem, right: &str, wrong: &str) -> String {
    const DOCUMENT: &str = r#"Scene(
    version: 1,
    geometry: [
        Box(min: (0, 0, 0), max: (1, 1, 1), material: "white"),
    ],
    materials: {
        "white": Diffuse(reflectance: (0.7, 0.7, 0.7)),
    },
    cameras: { "main": (eye: (3, 3, 3), target: (0, 0, 0), fov: 60) },
)"#;
    load_text(DOCUMENT).unwrap();
    let text = DOCUMENT.replacen(right, wrong, 1);
    assert_ne!(text, DOCUMENT);
    let error = load_text(&text).unwrap_err();
    assert_eq!(error.problem(), problem, "{}", rendered(&error));
    rendered(&error)
}

#[test]
fn faults_in_documents_are_underlined() {
    let cases = [
        ("version", Problem::Version, "version: 1", "version: 2"),
        ("syntax", Problem::Format, "max: (1, 1, 1)", "max: (1, 1; 1)"),
        ("missing_key", Problem::Format, ", fov: 60", ""),
        ("two_directions", Problem::Format, "target:", "direction: (0, 0, 1), target:"),
        ("unknown_key", Problem::UnknownKey, "materials:", "material:"),
        ("unknown_key_inside", Problem::UnknownKey, "reflectance", "reflectence"),
        ("unknown_shape", Problem::UnknownKey, "Box(", "Cube("),
        ("unknown_material", Problem::UnknownMaterial, "material: \"white\"", "material: \"whte\""),
        ("unused_material", Problem::UnknownMaterial, "\"white\": Diffuse", "\"wite\": Diffuse(reflectance: (0, 0, 0)), \"white\": Diffuse"),
        ("unnamed_material", Problem::UnknownMaterial, ", material: \"white\"", ""),
        ("not_finite", Problem::NonFinite, "(3, 3, 3)", "(3, NaN, 3)"),
        ("beyond_single_precision", Problem::NonFinite, "max: (1,", "max: (1e39,"),
        ("reflectance", Problem::Range, "(0.7, 0.7, 0.7)", "(0.7, 1.7, 0.7)"),
        ("field_of_view", Problem::Range, "fov: 60", "fov: 180"),
        ("extent", Problem::Range, "max: (1, 1, 1)", "max: (1e30, 1, 1)"),
        ("file", Problem::NotFound, "Box(", "File(\"sibenik/sibenik.obj\"), Box("),
        ("no_triangles", Problem::NoTriangles, "Box(min: (0, 0, 0), max: (1, 1, 1),", "Quad(corners: ((0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)),"),
    ];
    for (name, problem, right, wrong) in cases {
        insta::assert_snapshot!(name, message(problem, right, wrong));
    }
}

/// Each mistake is told, and nothing that only follows from one: `door` is used, though its shape is wrong, and the shapes of `glass` have a material that is.
const MANY: &str = r#"Scene(
    version: 1,
    geometry: [
        File("missing.obj"),
        Box(min: (0, 0, 0), max: (1, -1, 1), material: "door"),
        Sphere(centre: (0, 0, inf), radius: -1, material: "wal"),
        Sphere(centre: (0, 0, 0), radius: 1, material: "wal"),
        Sphere(centre: (0, 0, 0), radius: 1, material: "glass"),
        Sphere(centre: (0, 0, 0), radius: 1),
        Sphere(centre: (0, 0, 0), radius: 1),
        Place(of: [Cube()], scale: (0, 1, 1)),
    ],
    materials: {
        "wall": Diffuse(reflectance: (0.7, 0.7, 0.7)),
        "glass": Phong(reflectance: (0, 2, 0), specular: (3, 0, 0), exponent: -1),
        "door": Diffuse(reflectance: (0.7, 0.7, 0.7)),
        "door": Diffuse(reflectance: (0.1, 0.7, 0.7)),
    },
    normals: Smooth(degrees: 200),
    lights: [Spot(position: (0, 0, 0), direction: (0, 0, 0), intensity: (-1, 0, 0), inner: 5, outer: 100)],
    environment: LatLong(file: "sky.exr", scale: -1),
    cameras: {
        "main": (target: (0, 0, 0), fov: 60),
        "side": (eye: (3, NaN, 3), target: (0, 0, 0), fov: 200),
    },
)"#;

#[test]
fn all_that_is_wrong_with_a_document_is_told_at_once() {
    let error = load_text(MANY).unwrap_err();
    assert_eq!(error.to_string(), "21 errors");
    insta::assert_snapshot!("many", rendered(&error));
}

#[test]
fn of_each_limit_and_of_each_place_one_fault_is_told() {
    let source = SourceText::new(Path::new("a.ron"), "(1, 2)");
    let at = |start: usize| Err::<(), _>(SceneError::new(Problem::Range, "out of range").at(&source, start..start + 1, ""));
    let large = || Err::<(), _>(SceneError::new(Problem::TooLarge, "one too many"));
    let mut faults = Faults::default();
    for fault in [at(1), large(), at(4), at(1), large()] {
        assert_eq!(faults.take(fault), None);
    }
    assert_eq!(faults.take((at(4), Ok(())).together()), None);
    assert_eq!(faults.expect_none().unwrap_err().to_string(), "3 errors");
}

#[test]
fn faults_outside_documents_are_told() {
    let problem_of = |name: &str, expected: Problem, files: &[(&str, &[u8])]| {
        let (error, folder) = load_files(files).unwrap_err();
        assert_eq!(error.problem(), expected, "{}", rendered(&error));
        insta::assert_snapshot!(name, rendered(&error).replace(&folder, "DIR"));
    };
    problem_of("obj_line", Problem::Format, &[("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n")]);
    problem_of("obj_number", Problem::Format, &[("a.obj", b"v 0 zero 0\n")]);
    problem_of("obj_not_finite", Problem::NonFinite, &[("a.obj", b"o roof\nv 0 0 inf\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")]);
    problem_of("obj_empty", Problem::NoTriangles, &[("a.obj", b"")]);
    problem_of("extension", Problem::Format, &[("a.stl", b"")]);
    let nested = br#"Scene(version: 1, geometry: [File("a.ron")])"#;
    problem_of("nested_document", Problem::Format, &[("a.ron", nested)]);
    problem_of("gltf_broken", Problem::Format, &[("a.gltf", b"{}")]);
    problem_of(
        "gltf_extension",
        Problem::Unsupported,
        &[("a.gltf", br#"{"asset": {"version": "2.0"}, "extensionsUsed": ["MSFT_texture_dds"], "extensionsRequired": ["MSFT_texture_dds"]}"#)],
    );
    problem_of("gltf_old", Problem::Version, &[("a.gltf", br#"{"asset": {"version": "1.0"}, "meshes": {}}"#)]);
    problem_of("gltf_old_binary", Problem::Version, &[("a.glb", b"glTF\x01\0\0\0\x20\0\0\0")]);
    problem_of("gltf_part", Problem::Format, &[("a.gltf", br#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [7]}], "meshes": [{"primitives": [{}]}]}"#)]);
    problem_of("gltf_index", Problem::Format, &[("a.gltf", br#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [7]}]}"#)]);
    let line = br#"{"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"mode": 1, "attributes": {}}]}]}"#;
    problem_of("gltf_lines", Problem::NoTriangles, &[("a.gltf", line)]);
    problem_of("gltf_buffer", Problem::NotFound, &[("a.gltf", br#"{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 4, "uri": "gone.bin"}]}"#)]);
}

#[test]
fn absurd_counts_are_refused_before_they_are_made() {
    let text = r#"Scene(version: 1, materials: { "*": Diffuse(reflectance: (0, 0, 0)) }, geometry: [
        Sphere(centre: (0, 0, 0), radius: 1, subdivisions: 8), Generate(Hall(triangles: 15000000))])"#;
    let error = load_text(text).unwrap_err();
    assert_eq!(error.problem(), Problem::TooLarge);
    insta::assert_snapshot!("too_large", rendered(&error));
}

#[test]
fn scenes_and_parameters_that_do_not_exist_are_told() {
    let missing = load(Path::new("cornel.ron"), &LoadOptions::default()).unwrap_err();
    assert_eq!(missing.problem(), Problem::NotFound);
    insta::assert_snapshot!("no_such_scene", rendered(&missing));

    let set = |key: &str, value: &str| {
        let options = LoadOptions { overrides: vec![(key.into(), value.into())], ..LoadOptions::default() };
        load(Path::new("hall"), &options).unwrap_err()
    };
    let (key, value, range) = (set("triangels", "2000"), set("triangles", "many"), set("triangles", "12"));
    assert_eq!([&key, &value, &range].map(SceneError::problem), [Problem::UnknownKey, Problem::Range, Problem::Range]);
    insta::assert_snapshot!("parameters", [&key, &value, &range].map(rendered).join("\n"));

    let folder = tempfile::tempdir().unwrap();
    let unreadable = load(&folder.path().join("a.obj"), &LoadOptions::default()).unwrap_err();
    assert_eq!(unreadable.problem(), Problem::NotFound);
    std::fs::create_dir(folder.path().join("b.obj")).unwrap();
    let unreadable = Files::of(&Disk).read(&folder.path().join("b.obj")).err().unwrap();
    assert_eq!(unreadable.problem(), Problem::Unreadable);
}
