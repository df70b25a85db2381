//! What moves in files: where it is at which time.

use super::{gltf::Builder, *};
use crate::scene::{
    Camera, LightKind,
    animation::Animation,
    load::Problem,
    stage::{Stage, Unchangeable},
};
use glam::{Vec2, Vec3};
use serde_json::{Value, json};
use std::f32::consts::FRAC_1_SQRT_2;

/// A triangle of a document, at the origin, in a place; all else as `more` says.
fn document(place: &str, more: &str) -> String {
    format!(
        r#"Scene(version: 1, geometry: [
            Triangles(positions: [(-9, -9, -9), (9, -9, -9), (0, 9, -9)], indices: [(0, 1, 2)]),
            Place(name: "it", of: [Triangles(positions: [(0, 0, 0), (1, 0, 0), (0, 1, 0)], indices: [(0, 1, 2)])], {place}),
        ], materials: {{ "*": Diffuse(reflectance: (0.5, 0.5, 0.5)) }}, {more})"#
    )
}

pub(super) fn animated(scene: Scene) -> (Stage, Animation) {
    let stage = Stage::animated(scene).unwrap();
    let animation = stage.scene.animation.clone();
    (stage, animation)
}

pub(super) fn at(stage: &mut Stage, animation: &Animation, time: f64) -> Result<(), Unchangeable> {
    stage.change(&stage.changes_to(&animation.at(time))).map(|_| ())
}

/// The corners of the triangles of the first thing that moves, in the file's coordinates.
fn corners(stage: &Stage) -> Vec<[Vec3; 3]> {
    let triangles = &stage.scene.triangles[stage.triangles_of(0)];
    triangles.iter().map(|triangle| triangle.positions.map(|corner| corner + stage.scene.origin.as_vec3())).collect()
}

fn expect_corners(stage: &Stage, expected: [[f32; 3]; 3], what: &str) {
    let is_it = |found: &[Vec3; 3]| found.iter().zip(expected).all(|(found, expected)| found.distance(expected.into()) < 1e-5);
    assert!(corners(stage).iter().any(is_it), "{what}: {expected:?} is not among {:?}", corners(stage));
}

#[test]
fn places_of_documents_move_turn_and_grow() {
    let cases = [
        ("translate: Linear([(1, (0, 0, 0)), (3, (4, 0, 2))])", 1.5, [[1.0, 0.0, 0.5], [2.0, 0.0, 0.5], [1.0, 1.0, 0.5]]),
        ("translate: Step([(1, (0, 0, 0)), (3, (4, 0, 2))])", 2.9, [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
        ("translate: Smooth([(0, (0, 0, 0)), (2, (8, 0, 0))])", 0.5, [[1.25, 0.0, 0.0], [2.25, 0.0, 0.0], [1.25, 1.0, 0.0]]),
        ("rotate: (axis: (0, 0, 1), degrees: Linear([(0, 0), (4, 720)]))", 0.5, [[0.0; 3], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
        ("scale: Linear([(0, (1, 1, 1)), (2, (3, 1, 1))]), translate: (0, 0, 5)", 1.0, [[0.0, 0.0, 5.0], [2.0, 0.0, 5.0], [0.0, 1.0, 5.0]]),
    ];
    for (place, time, expected) in cases {
        let (mut stage, animation) = animated(load_text(&document(place, "")).unwrap());
        let before = corners(&stage);
        at(&mut stage, &animation, time).unwrap();
        expect_corners(&stage, expected, place);
        at(&mut stage, &animation, 0.0).unwrap();
        assert_eq!(corners(&stage), before, "{place}, back at the beginning");
        at(&mut stage, &animation, 1e6).unwrap();
        let last = corners(&stage);
        at(&mut stage, &animation, animation.length()).unwrap();
        assert_eq!(corners(&stage), last, "{place}, after its last key");
    }
}

/// What stands on a place that moves moves with it, and by itself; both are told apart though they are one object of the file.
#[test]
fn places_move_on_places_that_move() {
    let inner =
        "Place(translate: Linear([(0, (0, 0, 0)), (1, (0, 3, 0))]), of: [Triangles(positions: [(0, 0, 1), (1, 0, 1), (0, 1, 1)], indices: [(0, 1, 2)])])";
    let text = document("translate: Linear([(0, (2, 0, 0)), (1, (5, 0, 0))])", "")
        .replace("indices: [(0, 1, 2)])], t", &format!("indices: [(0, 1, 2)]), {inner}], t"));
    let scene = load_text(&text).unwrap();
    assert_eq!(scene.objects.len(), 1);
    let (mut stage, animation) = animated(scene);
    assert_eq!(stage.scene.objects.len(), 2);
    at(&mut stage, &animation, 1.0).unwrap();
    expect_corners(&stage, [[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.0]], "the outer one");
    let inner = stage.scene.triangles[stage.triangles_of(1).start].positions[0] + stage.scene.origin.as_vec3();
    assert!(inner.distance(Vec3::new(5.0, 3.0, 1.0)) < 1e-5, "{inner}");
}

/// Equal triangles that move apart are no repetitions, and a beginning that is empty keeps its shape.
#[test]
fn what_is_not_seen_at_first_appears() {
    let twice = document("scale: Step([(0, (0, 0, 0)), (1, (2, 2, 2))])", "").replace("Place(name", "Place(translate: Step([(0, (0, 0, 0)), (1, (3, 0, 0))]), of: [Triangles(positions: [(0, 0, 0), (2, 0, 0), (0, 2, 0)], indices: [(0, 1, 2)])]), Place(name");
    let (mut stage, animation) = animated(load_text(&twice).unwrap());
    assert_eq!(stage.scene.triangles.len(), 3);
    let size = |stage: &Stage| stage.scene.triangles[stage.triangles_of(1).start].cross().length();
    assert!(size(&stage) > 0.0 && size(&stage) < 1e-9, "{}", size(&stage));
    at(&mut stage, &animation, 1.0).unwrap();
    assert_eq!(size(&stage), 4.0);
}

#[test]
fn lights_emitters_and_cameras_of_documents_move() {
    let more = r#"lights: [
            Point(position: Linear([(0, (0, 0, 0)), (2, (2, 4, 0))]), intensity: Linear([(0, (0, 0, 0)), (2, (4, 2, 0))])),
            Directional(direction: Linear([(0, (1, 0, 0)), (2, (0, -1, 0))]), irradiance: (1, 1, 1)),
        ], cameras: {
            "still": (eye: (0, 0, 9), target: (0, 0, 0), fov: 50),
            "c": (eye: Linear([(0, (0, 0, 9)), (2, (9, 0, 0))]), target: (0, 0, 0), fov: Linear([(0, 40), (2, 60)])),
        }"#;
    let text = document("", more)
        .replace("\"*\": D", "\"lamp\": Emitter(radiance: Step([(0, (0, 0, 0)), (1, (7, 7, 7))])), \"*\": D")
        .replace("indices: [(0, 1, 2)])],", "indices: [(0, 1, 2)], material: \"lamp\")],");
    let scene = load_text(&text).unwrap();
    assert!(!scene.is_dark(), "a light that is out at first will shine");
    let (mut stage, animation) = animated(scene);
    assert_eq!(animation.length(), 2.0);
    at(&mut stage, &animation, 1.0).unwrap();
    let LightKind::Point { position, intensity } = stage.scene.lights[0].kind else { panic!("{:?}", stage.scene.lights) };
    assert_eq!((position + stage.scene.origin.as_vec3(), intensity), (Vec3::new(1.0, 2.0, 0.0), Vec3::new(2.0, 1.0, 0.0)));
    let LightKind::Directional { direction, .. } = stage.scene.lights[1].kind else { panic!("{:?}", stage.scene.lights) };
    assert!(direction.distance(Vec3::new(FRAC_1_SQRT_2, -FRAC_1_SQRT_2, 0.0)) < 1e-6);
    assert!(stage.scene.materials.iter().any(|material| material.emission == Vec3::splat(7.0)));
    let camera = |number: usize| animation.at(1.0).camera(&stage.scene, &stage.scene.cameras[number]);
    assert_eq!(camera(0), stage.scene.cameras[0]);
    let Camera { eye, direction, up, .. } = camera(1);
    assert_eq!((eye + stage.scene.origin.as_vec3(), up), (Vec3::new(4.5, 0.0, 4.5), Vec3::Y));
    assert!(direction.distance(Vec3::new(-FRAC_1_SQRT_2, 0.0, -FRAC_1_SQRT_2)) < 1e-6);
    assert!((camera(1).half_extent([100, 100]).x - 25_f32.to_radians().tan()).abs() < 1e-6);
}

/// Records need not be sampled anew for a camera that moves.
#[test]
fn what_moves_decides_what_a_scene_needs() {
    let camera = |eye: &str| format!(r#"cameras: {{ "c": (eye: {eye}, target: (0, 0, 0), fov: 40) }}"#);
    let moves = |place: &str, more: &str| animated(load_text(&document(place, more)).unwrap()).0.needs().moves;
    assert!(!moves("", &camera("(0, 0, 9)")) && !moves("", &camera("Linear([(0, (0, 0, 9)), (2, (9, 0, 0))])")));
    assert!(moves("translate: Linear([(0, (0, 0, 0)), (2, (9, 0, 0))])", &camera("(0, 0, 9)")));
    assert!(moves("", "lights: [Point(position: (0, 0, 0), intensity: Linear([(0, (1, 1, 1)), (1, (2, 2, 2))]))]"));
}

#[test]
fn keys_that_make_no_sense_are_underlined() {
    let cases = [
        ("translate: Linear([])", "there is no key"),
        ("translate: Linear([(1, (0, 0, 0)), (1, (1, 0, 0))])", "later than the key before it"),
        ("translate: Linear([(1, (0, 0, 0)), (inf, (1, 0, 0))])", "no finite number"),
        ("translate: Linear([(1, (0, 0, 1e39))])", "no finite number"),
        ("translate: Bezier([(1, (0, 0, 0))])", "`Bezier` is not known here"),
        ("scale: Linear([(0, (1, 1, 1)), (1, (-1, 1, 1))])", "of one sign"),
        ("scale: Linear([(0, (1, 0, 1)), (1, (2, 0, 1))])", "different from 0"),
    ];
    for (place, expected) in cases {
        let error = load_text(&document(place, "")).unwrap_err();
        assert!(format!("{:?}", miette::Report::new(error)).contains(expected), "{place}");
    }
    let error = load_text(&document("", "lights: [Point(position: (0, 0, 0), intensity: Linear([(0, (1, 1, 1)), (1, (-1, 0, 0))]))]")).unwrap_err();
    assert_eq!(error.problem(), Problem::Range);
}

/// A square on a node that turns and rises, with a camera, a light and a still square on it.
pub(super) fn moving_file() -> Builder {
    let mut builder = Builder::new(json!({
        "scene": 0,
        "scenes": [{"nodes": [0, 2]}],
        "nodes": [
            {"name": "arm", "mesh": 0, "translation": [0, 0, 0], "children": [1]},
            {"name": "hand", "mesh": 0, "translation": [5, 0, 0], "camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"name": "wall", "mesh": 0, "scale": [9, 9, 9], "translation": [-4, -4, -9]},
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}],
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 5, "spot": {}}]}},
    }));
    let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let (positions, indices) = (builder.floats(&square), builder.indices(&[0, 1, 2, 0, 2, 3]));
    builder.root["meshes"] = json!([{"primitives": [{"attributes": {"POSITION": positions}, "indices": indices}]}]);
    let turns = builder.floats(&[[0.0, 0.0, 0.0, 1.0], [0.0, FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2]]);
    // Rates of 0 at both ends.
    let rises = builder.floats(&[[0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3], [0.0, 8.0, 0.0], [0.0; 3]]);
    let times = builder.scalars(&[0.0, 2.0]);
    builder.root["animations"] = json!([{
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}, {"sampler": 1, "target": {"node": 0, "path": "translation"}}],
        "samplers": [{"input": times, "output": turns, "interpolation": "LINEAR"}, {"input": times, "output": rises, "interpolation": "CUBICSPLINE"}],
    }]);
    builder
}

pub(super) fn load_glb(builder: &Builder) -> Result<Scene, SceneError> {
    load_files(&[("thing.glb", &builder.finish())]).map_err(|(error, _)| error)
}

#[test]
fn nodes_of_gltf_files_move_with_all_that_hangs_on_them() {
    let scene = load_glb(&moving_file()).unwrap();
    assert!(scene.notes.iter().all(|note| !note.contains("animation")), "{:?}", scene.notes);
    let (mut stage, animation) = animated(scene);
    assert_eq!(stage.scene.objects.iter().map(|object| object.name.as_str()).collect::<Vec<_>>(), ["arm"]);
    assert_eq!(stage.triangles_of(0).len(), 4, "with the hand's");
    at(&mut stage, &animation, 1.0).unwrap();
    // By 45 degrees around y, halfway up.
    expect_corners(&stage, [[0.0, 4.0, 0.0], [FRAC_1_SQRT_2, 4.0, -FRAC_1_SQRT_2], [FRAC_1_SQRT_2, 5.0, -FRAC_1_SQRT_2]], "the arm");
    let LightKind::Spot { position, direction, .. } = stage.scene.lights[0].kind else { panic!("{:?}", stage.scene.lights) };
    let (hand, ahead) = (Vec3::new(5.0 * FRAC_1_SQRT_2, 4.0, -5.0 * FRAC_1_SQRT_2), Vec3::new(-FRAC_1_SQRT_2, 0.0, -FRAC_1_SQRT_2));
    let camera = animation.at(1.0).camera(&stage.scene, &stage.scene.cameras[0]);
    for (place, way) in [(position, direction), (camera.eye, camera.direction)] {
        assert!((place + stage.scene.origin.as_vec3()).distance(hand) < 1e-5 && way.distance(ahead) < 1e-5, "{place} {way}");
    }
    assert_eq!(camera.half_extent([10, 10]), Vec2::splat(0.4_f32.tan()));
}

/// A file that a document places moves where the document has it.
#[test]
fn files_of_documents_move() {
    let document = br#"Scene(version: 1, geometry: [Place(of: [File("thing.glb")], scale: (2, 2, 2), translate: Linear([(0, (0, 0, 0)), (1, (0, 0, 3))]))])"#;
    let scene = load_files(&[("scene.ron", document), ("thing.glb", &moving_file().finish())]).map_err(|(error, _)| error).unwrap();
    let (mut stage, animation) = animated(scene);
    assert_eq!(stage.scene.objects.iter().map(|object| object.name.as_str()).collect::<Vec<_>>(), ["arm", "a place that moves"]);
    at(&mut stage, &animation, 1.0).unwrap();
    let side = 2.0 * FRAC_1_SQRT_2;
    expect_corners(&stage, [[0.0, 8.0, 3.0], [side, 8.0, 3.0 - side], [side, 10.0, 3.0 - side]], "the arm");
}

#[test]
fn animations_that_are_broken_are_left_out_with_a_note() {
    let notes_of = |pointer: &str, value: Value| {
        let mut builder = moving_file();
        *builder.root.pointer_mut(pointer).unwrap() = value;
        let scene = load_glb(&builder).unwrap_or_else(|error| panic!("{pointer}: {error}"));
        (scene.animation.nodes.len(), scene.notes.join("\n"))
    };
    const BROKEN: &str = "animations that break the rules of glTF";
    let cases = [
        ("/animations/0/channels/0/target/path", json!("weights"), BROKEN),
        ("/animations/0/channels/0/target/path", json!("pointer"), "animations of what is no node"),
        ("/animations/0/channels/0/target/path", json!("colour"), BROKEN),
        ("/animations/0/channels/0/sampler", json!(9), BROKEN),
        ("/animations/0/samplers/0/input", json!(999), BROKEN),
        ("/animations/0/samplers/0/output", json!(0), BROKEN),
        ("/animations/0/samplers/0/interpolation", json!("CUBICSPLINE"), BROKEN),
    ];
    for (pointer, value, expected) in cases {
        let (nodes, notes) = notes_of(pointer, value.clone());
        assert!(nodes == 1 && notes.contains(expected), "{pointer} {value}: {nodes} nodes, {notes}");
    }
    let mut twice = moving_file();
    let walk = twice.root["animations"][0].clone();
    twice.root["animations"] = json!([walk.clone(), walk]);
    assert!(load_glb(&twice).unwrap().notes.join("\n").contains("animations of what another moves (2)"));
}
