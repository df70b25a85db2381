//! Meshes that deform: where their vertices are at which time, by hand.

use super::{animation::*, gltf::Builder, *};
use crate::scene::{
    Triangle,
    load::Problem,
    stage::{Change, Pose, Stage, Unchangeable},
};
use glam::{DAffine3, Vec3};
use serde_json::{Value, json};
use std::f32::consts::FRAC_1_SQRT_2;

impl Builder {
    fn bytes<const N: usize>(&mut self, vectors: &[[u8; N]], more: Value) -> usize {
        let view = self.view(vectors.as_flattened());
        let mut accessor = json!({"bufferView": view, "componentType": 5121, "count": vectors.len(), "type": format!("VEC{N}")});
        accessor.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        self.accessor(accessor)
    }

    fn matrices(&mut self, matrices: &[[f32; 16]]) -> usize {
        let number = self.floats(matrices);
        self.root["accessors"][number]["type"] = json!("MAT4");
        number
    }
}

const IDENTITY: [f32; 16] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

/// A bar of two squares, one over the other, that faces +z. Its lower edge is carried by the root, its upper one by the elbow halfway, the edge between by both alike.
/// The elbow turns by 90 degrees around x from 0 to 1 s. The node that has the mesh stands far away.
pub(super) fn bar() -> Builder {
    let mut builder = Builder::new(json!({
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [
            {"name": "bar", "mesh": 0, "skin": 0, "translation": [70, 0, 0], "scale": [3, 3, 3]},
            {"name": "armature", "children": [2]},
            {"name": "root", "children": [3]},
            {"name": "elbow", "translation": [0, 1, 0]},
        ],
    }));
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 2.0, 0.0], [1.0, 2.0, 0.0]];
    let (positions, normals) = (builder.floats(&corners), builder.floats(&[[0.0, 0.0, 1.0]; 6]));
    let joints = builder.bytes(&[[0, 0, 0, 0], [0, 9, 0, 0], [0, 1, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]], json!({}));
    // Sums of weights are other than 1.
    let weights =
        builder.floats(&[[2.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0], [2.0, 2.0, 0.0, 0.0], [0.1, 0.1, 0.0, 0.0], [3.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]);
    let indices = builder.indices(&[0, 1, 3, 0, 3, 2, 2, 3, 5, 2, 5, 4]);
    let attributes = json!({"POSITION": positions, "NORMAL": normals, "JOINTS_0": joints, "WEIGHTS_0": weights});
    builder.root["meshes"] = json!([{"primitives": [{"attributes": attributes, "indices": indices}]}]);
    let mut down = IDENTITY;
    down[13] = -1.0;
    let binds = builder.matrices(&[IDENTITY, down]);
    builder.root["skins"] = json!([{"joints": [2, 3], "inverseBindMatrices": binds}]);
    let (times, turns) = (builder.scalars(&[0.0, 1.0]), builder.floats(&[[0.0, 0.0, 0.0, 1.0], [FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2]]));
    builder.root["animations"] = json!([{
        "channels": [{"sampler": 0, "target": {"node": 3, "path": "rotation"}}],
        "samplers": [{"input": times, "output": turns}],
    }]);
    builder
}

/// A square that faces +z, with two morph targets: one raises its corner (1, 1, 0) by 2 and leans the normal there, the other shifts all of it along +x by 1. Their
/// weights go by cubic curves, of the first from 0 to 8, of the second from 0 to 0 by a rate of 4 a second at first.
pub(super) fn quad() -> Builder {
    let mut builder = Builder::new(json!({
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "quad", "mesh": 0, "translation": [0, 0, 5], "scale": [2, 2, 2]}],
    }));
    let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let (positions, normals, indices) = (builder.floats(&square), builder.floats(&[[0.0, 0.0, 1.0]; 4]), builder.indices(&[0, 1, 2, 0, 2, 3]));
    let mut only_third = |vector: [f32; 3]| {
        let (at, with) = (builder.view(&[2]), builder.view(&vector.map(f32::to_le_bytes).concat()));
        let sparse = json!({"count": 1, "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": with}});
        builder.accessor(json!({"componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse}))
    };
    let (raised, leant) = (only_third([0.0, 0.0, 2.0]), only_third([0.1, 0.0, 0.0]));
    let shifted = builder.floats(&[[1.0, 0.0, 0.0]; 4]);
    let targets = json!([{"POSITION": raised, "NORMAL": leant}, {"POSITION": shifted}]);
    let attributes = json!({"POSITION": positions, "NORMAL": normals});
    builder.root["meshes"] = json!([{"weights": [0.25, 0], "primitives": [{"attributes": attributes, "indices": indices, "targets": targets}]}]);
    // Of each key the rates before it, its values, the rates after it, of both targets each.
    let keys = builder.scalars(&[9.0, 9.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 8.0, 0.0, 9.0, 9.0]);
    let times = builder.scalars(&[0.0, 2.0]);
    builder.root["animations"] = json!([{
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
        "samplers": [{"input": times, "output": keys, "interpolation": "CUBICSPLINE"}],
    }]);
    builder
}

/// The corners of a scene's triangles in the file's coordinates, each with its normal.
fn vertices(stage: &Stage) -> Vec<[Vec3; 2]> {
    let origin = stage.scene.origin.as_vec3();
    let corners = |triangle: &Triangle| [0, 1, 2].map(|corner| [triangle.positions[corner] + origin, triangle.normals[corner]]);
    stage.scene.triangles.iter().flat_map(corners).collect()
}

/// All of a list are corners with these normals, and nothing else is.
fn expect_vertices(stage: &Stage, expected: &[[[f32; 3]; 2]], what: &str) {
    let found = vertices(stage);
    let is =
        |[position, normal]: &[Vec3; 2], expected: &[[f32; 3]; 2]| position.distance(expected[0].into()) < 1e-5 && normal.distance(expected[1].into()) < 1e-5;
    assert!(expected.iter().all(|expected| found.iter().any(|found| is(found, expected))), "{what}: {expected:?}, not {found:?}");
    assert!(found.iter().all(|found| expected.iter().any(|expected| is(found, expected))), "{what}: {found:?}, not {expected:?}");
}

/// The bar at rest, and with its elbow turned by 90 degrees.
const STRAIGHT: [[[f32; 3]; 2]; 6] = [
    [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    [[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    [[0.0, 2.0, 0.0], [0.0, 0.0, 1.0]],
    [[1.0, 2.0, 0.0], [0.0, 0.0, 1.0]],
];
const BENT: [[[f32; 3]; 2]; 6] = [
    [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    [[0.0, 1.0, 0.0], [0.0, -FRAC_1_SQRT_2, FRAC_1_SQRT_2]],
    [[1.0, 1.0, 0.0], [0.0, -FRAC_1_SQRT_2, FRAC_1_SQRT_2]],
    [[0.0, 1.0, 1.0], [0.0, -1.0, 0.0]],
    [[1.0, 1.0, 1.0], [0.0, -1.0, 0.0]],
];

/// The same, with positions mapped.
fn with(vertices: [[[f32; 3]; 2]; 6], map: impl Fn([f32; 3]) -> [f32; 3]) -> [[[f32; 3]; 2]; 6] {
    vertices.map(|[position, normal]| [map(position), normal])
}

#[test]
fn a_bar_of_two_joints_bends() {
    let scene = load_glb(&bar()).unwrap();
    expect_sound(&scene);
    assert!(scene.notes.iter().all(|note| note.contains("camera")), "{:?}", scene.notes);
    let (mut stage, animation) = animated(scene);
    assert_eq!((animation.length(), stage.scene.objects.len(), stage.scene.objects[0].name.as_str()), (1.0, 1, "bar"));
    expect_vertices(&stage, &STRAIGHT, "at the beginning");
    at(&mut stage, &animation, 1.0).unwrap();
    expect_vertices(&stage, &BENT, "at the end");
    assert!(stage.changes_to(&animation.at(2.0)).is_empty(), "nothing changes after the last key");
    // Rays meet it where it is.
    let hit = |height: f32, depth: f32| {
        let from = Vec3::new(0.4, height, depth) - stage.scene.origin.as_vec3();
        stage.bvh.closest_hit(&stage.scene, from, if depth > 2.0 { Vec3::NEG_Z } else { Vec3::Y }, 9.0).is_some()
    };
    assert!(hit(0.5, 5.0) && !hit(1.5, 5.0) && hit(-1.0, 0.5));
    // Whatever was seen before.
    let bent = stage.scene.triangles.clone();
    for time in [0.3, 0.0, 1.0] {
        at(&mut stage, &animation, time).unwrap();
    }
    assert_eq!(stage.scene.triangles, bent);
}

/// The node that has the mesh counts for nothing, those above the joints count.
#[test]
fn joints_stand_on_nodes_that_are_scaled() {
    let mut builder = bar();
    builder.root["nodes"][1]["scale"] = json!([2, 2, 2]);
    builder.root["nodes"][1]["translation"] = json!([0, 0, 7]);
    let (mut stage, animation) = animated(load_glb(&builder).unwrap());
    at(&mut stage, &animation, 1.0).unwrap();
    expect_vertices(&stage, &with(BENT, |[x, y, z]| [2.0 * x, 2.0 * y, 2.0 * z + 7.0]), "larger");
    // Scaled along one axis, normals are those of the surface.
    builder.root["nodes"][1]["scale"] = json!([1, 1, 2]);
    let (mut stage, animation) = animated(load_glb(&builder).unwrap());
    at(&mut stage, &animation, 1.0).unwrap();
    let mut expected = with(BENT, |[x, y, z]| [x, y, 2.0 * z + 7.0]);
    (expected[2][1], expected[3][1]) = ([0.0, -0.894_427_2, 0.447_213_6], [0.0, -0.894_427_2, 0.447_213_6]);
    expect_vertices(&stage, &expected, "deeper");
}

/// Without an animation it is posed once, without matrices joints have those of rest.
#[test]
fn a_skin_that_rests_is_posed() {
    let mut builder = bar();
    builder.root["animations"] = json!([]);
    builder.root["nodes"][3]["rotation"] = json!([FRAC_1_SQRT_2, 0, 0, FRAC_1_SQRT_2]);
    let scene = load_glb(&builder).unwrap();
    assert!(scene.animation.is_empty());
    expect_vertices(&Stage::new(scene), &BENT, "posed");
    builder.root["skins"][0].as_object_mut().unwrap().remove("inverseBindMatrices");
    builder.root["nodes"][3]["rotation"] = json!([0, 0, 0, 1]);
    let expected = with(STRAIGHT, |[x, y, z]| [x, y + 0.5 * y, z]);
    expect_vertices(&Stage::new(load_glb(&builder).unwrap()), &expected, "by identities");
}

/// Further sets, and other types of numbers.
#[test]
fn vertices_may_have_more_than_four_joints() {
    let mut builder = bar();
    let none = builder.bytes(&[[0; 4]; 6], json!({}));
    let joints: Vec<u8> =
        [[0u16; 4], [0; 4], [1, 0, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 1]].iter().flatten().flat_map(|joint| joint.to_le_bytes()).collect();
    let view = builder.view(&joints);
    let second = builder.accessor(json!({"bufferView": view, "componentType": 5123, "count": 6, "type": "VEC4"}));
    let normalised = json!({"normalized": true});
    let first_weights = builder.bytes(&[[255, 0, 0, 0], [1, 0, 0, 0], [0, 0, 0, 200], [0, 10, 0, 0], [0; 4], [0; 4]], normalised.clone());
    let second_weights = builder.bytes(&[[0; 4], [0; 4], [200, 0, 0, 0], [0, 0, 10, 0], [255, 0, 0, 0], [0, 0, 0, 9]], normalised);
    let attributes = builder.root["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap();
    attributes.extend(json!({"JOINTS_0": none, "WEIGHTS_0": first_weights, "JOINTS_1": second, "WEIGHTS_1": second_weights}).as_object().unwrap().clone());
    let (mut stage, animation) = animated(load_glb(&builder).unwrap());
    at(&mut stage, &animation, 1.0).unwrap();
    expect_vertices(&stage, &BENT, "by two sets");
}

/// A document may place such a file, mirror and move it. Fronts stay the fronts.
#[test]
fn documents_place_what_deforms() {
    let document = br#"Scene(version: 1, geometry: [Place(of: [File("thing.glb")], scale: (2, 2, -2), translate: Linear([(0, (0, 0, 0)), (1, (0, 0, 3))]))])"#;
    let scene = load_files(&[("scene.ron", document), ("thing.glb", &bar().finish())]).map_err(|(error, _)| error).unwrap();
    expect_sound(&scene);
    let (mut stage, animation) = animated(scene);
    at(&mut stage, &animation, 1.0).unwrap();
    let expected = BENT.map(|[[x, y, z], [nx, ny, nz]]| [[2.0 * x, 2.0 * y, 3.0 - 2.0 * z], [nx, ny, -nz]]);
    expect_vertices(&stage, &expected, "mirrored");
    expect_sound(&stage.scene);
    let flat = br#"Scene(version: 1, geometry: [File("thing.glb")], normals: Face)"#;
    let (mut stage, animation) = animated(load_files(&[("scene.ron", flat), ("thing.glb", &bar().finish())]).map_err(|(error, _)| error).unwrap());
    at(&mut stage, &animation, 1.0).unwrap();
    assert!(stage.scene.triangles.iter().all(|triangle| triangle.normals == [triangle.face_normal(); 3]));
    // The squares stand at right angles: where they meet, both are smoothed together.
    let smooth = br#"Scene(version: 1, geometry: [File("thing.glb")], normals: Smooth(degrees: 100))"#;
    let (mut stage, animation) = animated(load_files(&[("scene.ron", smooth), ("thing.glb", &bar().finish())]).map_err(|(error, _)| error).unwrap());
    at(&mut stage, &animation, 1.0).unwrap();
    expect_vertices(&stage, &BENT, "smooth");
}

/// By hand: a quarter of the way the first weight is 8 · 5/32, the second 2 · 9/64 · 4.
#[test]
fn a_square_goes_toward_its_targets() {
    let (mut stage, animation) = animated(load_glb(&quad()).unwrap());
    assert_eq!(animation.length(), 2.0);
    at(&mut stage, &animation, 0.5).unwrap();
    let (first, second) = (1.25_f32, 1.125);
    let leant = Vec3::new(0.1 * first, 0.0, 1.0).normalize().to_array();
    let place = |x: f32, y: f32, z: f32| [2.0 * (x + second), 2.0 * y, 2.0 * z + 5.0];
    let up = [0.0, 0.0, 1.0];
    let expected = [[place(0.0, 0.0, 0.0), up], [place(1.0, 0.0, 0.0), up], [place(1.0, 1.0, 2.0 * first), leant], [place(0.0, 1.0, 0.0), up]];
    expect_vertices(&stage, &expected, "on its way");
    at(&mut stage, &animation, 2.0).unwrap();
    assert!(vertices(&stage).iter().any(|[position, _]| position.distance(Vec3::new(2.0, 2.0, 37.0)) < 1e-4));
}

#[test]
fn weights_may_be_stepped_and_linear() {
    for (interpolation, expected) in [("STEP", 5.0), ("LINEAR", 6.0)] {
        let mut builder = quad();
        builder.root["animations"][0]["samplers"][0]["output"] = json!(builder.scalars(&[0.0, 0.0, 1.0, 0.0]));
        builder.root["animations"][0]["samplers"][0]["interpolation"] = json!(interpolation);
        let (mut stage, animation) = animated(load_glb(&builder).unwrap());
        at(&mut stage, &animation, 0.5).unwrap();
        let highest = vertices(&stage).iter().map(|[position, _]| position.z).fold(0.0, f32::max);
        assert!((highest - expected).abs() < 1e-5, "{interpolation}: {highest}");
    }
}

/// The mesh has weights, and the node may have others.
#[test]
fn weights_that_rest_are_those_of_the_node_or_the_mesh() {
    let mut builder = quad();
    builder.root["animations"] = json!([]);
    let highest = |builder: &Builder| {
        let scene = load_glb(builder).unwrap();
        assert!(scene.animation.is_empty() && scene.notes.iter().all(|note| note.contains("camera")), "{:?}", scene.notes);
        vertices(&Stage::new(scene)).iter().map(|[position, _]| position.z).fold(0.0, f32::max)
    };
    assert_eq!(highest(&builder), 6.0);
    builder.root["nodes"][0]["weights"] = json!([0.5, 1]);
    assert_eq!(highest(&builder), 7.0);
    builder.root["nodes"][0].as_object_mut().unwrap().remove("weights");
    builder.root["meshes"][0].as_object_mut().unwrap().remove("weights");
    assert_eq!(highest(&builder), 5.0);
}

/// Morph targets go before the skin, and move with a node that moves.
#[test]
fn targets_bend_what_joints_carry() {
    let mut builder = bar();
    let raised = builder.floats(&[[0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    builder.root["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": raised}]);
    builder.root["meshes"][0]["weights"] = json!([1]);
    let (mut stage, animation) = animated(load_glb(&builder).unwrap());
    at(&mut stage, &animation, 1.0).unwrap();
    expect_vertices(&stage, &with(BENT, |[x, y, z]| [x, y, 2.0 * z]), "longer");

    let mut builder = quad();
    let moves = builder.floats(&[[0.0, 0.0, 5.0], [0.0, 4.0, 5.0]]);
    let animation = &mut builder.root["animations"][0];
    let times = animation["samplers"][0]["input"].clone();
    animation["channels"].as_array_mut().unwrap().push(json!({"sampler": 1, "target": {"node": 0, "path": "translation"}}));
    animation["samplers"].as_array_mut().unwrap().push(json!({"input": times, "output": moves}));
    let (mut stage, animation) = animated(load_glb(&builder).unwrap());
    assert_eq!(stage.scene.objects.len(), 1);
    at(&mut stage, &animation, 2.0).unwrap();
    assert!(vertices(&stage).iter().any(|[position, _]| position.distance(Vec3::new(2.0, 6.0, 37.0)) < 1e-4));
}

/// What shrinks to nothing is not seen, and comes back.
#[test]
fn what_is_flattened_comes_back() {
    let mut builder = bar();
    let scales = builder.floats(&[[0.0; 3], [1.0; 3]]);
    builder.root["animations"][0]["channels"][0]["target"] = json!({"node": 2, "path": "scale"});
    builder.root["animations"][0]["samplers"][0]["output"] = json!(scales);
    // All of a scene that is nothing would be no scene.
    builder.root["nodes"].as_array_mut().unwrap().push(json!({"mesh": 1, "translation": [0, 0, -9]}));
    builder.root["scenes"][0]["nodes"] = json!([0, 1, 4]);
    let mut still = builder.root["meshes"][0].clone();
    still["primitives"][0]["attributes"].as_object_mut().unwrap().retain(|key, _| key == "POSITION");
    builder.root["meshes"].as_array_mut().unwrap().push(still);
    let scene = load_glb(&builder).unwrap();
    expect_sound(&scene);
    assert_eq!(scene.triangles.len(), 8);
    let (mut stage, animation) = animated(scene);
    let area = |stage: &Stage| stage.triangles_of(0).map(|at| stage.scene.triangles[at].cross().length()).sum::<f32>();
    assert!(area(&stage) > 0.0 && area(&stage) < 1e-9, "{}", area(&stage));
    at(&mut stage, &animation, 1.0).unwrap();
    assert_eq!(area(&stage), 4.0);
    at(&mut stage, &animation, 0.0).unwrap();
    assert!(area(&stage) < 1e-9);
}

#[test]
fn what_makes_no_sense_is_refused() {
    let broken = |builder: &Builder, expected: &str| {
        let error = load_glb(builder).unwrap_err();
        assert!(error.problem() == Problem::Format && error.to_string().contains(expected), "{expected}: {error}");
    };
    let cases: [(&str, Value, &str); 9] = [
        ("/nodes/0/skin", json!(3), "node 0 has a skin that is not there"),
        ("/skins/0/joints", json!([]), "skin 0 has no joints"),
        ("/skins/0/joints", json!([2, 9]), "skin 0 has a joint, node 9, that is no part of the scene"),
        ("/skins/0/joints", json!([2]), "vertex 2 is carried by joint 1 of 1"),
        ("/skins/0/joints", json!([2, 3, 1]), "skin 0 has 2 matrices for its 3 joints"),
        ("/skins/0/inverseBindMatrices", json!(99), "skin 0 names an accessor for its matrices that is not there"),
        ("/skins/0/inverseBindMatrices", json!(0), "has to hold matrices"),
        ("/meshes/0/primitives/0/attributes/JOINTS_0", json!(0), "whose JOINTS_0 are no unsigned bytes or shorts"),
        ("/nodes/3/children", json!([1]), "hangs in the scene twice"),
    ];
    for (pointer, value, expected) in cases {
        let mut builder = bar();
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        builder.root.pointer_mut(parent).unwrap()[key] = value;
        broken(&builder, expected);
    }
    let mut builder = bar();
    builder.root["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("WEIGHTS_0");
    broken(&builder, "mesh `bar` has a skin, but not both of JOINTS_0 and WEIGHTS_0");
    for weight in [-1.0, f32::NAN, f32::INFINITY] {
        let mut builder = bar();
        let weights = builder.floats(&[[weight, 0.0, 0.0, 0.0]; 6]);
        builder.root["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(weights);
        broken(&builder, "vertex 0 has a weight that is no finite number of 0 or more");
    }
    let mut builder = bar();
    let matrices = builder.matrices(&[IDENTITY, [f32::NAN; 16]]);
    builder.root["skins"][0]["inverseBindMatrices"] = json!(matrices);
    broken(&builder, "a matrix with a number that is not finite, that of joint 1");

    let mut builder = quad();
    let three = builder.floats(&[[0.0; 3]; 3]);
    builder.root["meshes"][0]["primitives"][0]["targets"][1] = json!({"POSITION": three});
    broken(&builder, "mesh `quad` has 4 vertices, and a morph target of 3");
    let mut builder = quad();
    builder.root["meshes"][0]["primitives"][0]["targets"].as_array_mut().unwrap().pop();
    broken(&builder, "the animation of the weights of mesh `quad` has 12 numbers, not 6 for each of its 1 morph targets");
    builder.root["animations"] = json!([]);
    broken(&builder, "mesh `quad` has 2 weights for 1 morph targets");
    let mut builder = quad();
    let mut other = builder.root["meshes"][0]["primitives"][0].clone();
    other["targets"] = json!([]);
    builder.root["meshes"][0]["primitives"].as_array_mut().unwrap().push(other);
    broken(&builder, "mesh `quad` has primitives of 2 morph targets and of 0");
}

/// What a file has for others is no fault of what is seen.
#[test]
fn skins_that_nothing_has_break_no_file() {
    let mut builder = bar();
    builder.root["skins"].as_array_mut().unwrap().push(json!({"joints": "none"}));
    builder.root["nodes"][2]["skin"] = json!(1);
    assert!(load_glb(&builder).is_ok());
}

#[test]
fn a_time_that_brings_vertices_nowhere_is_refused() {
    let mut builder = bar();
    let scales = builder.floats(&[[1.0; 3], [3e38; 3]]);
    builder.root["animations"][0]["channels"][0]["target"]["path"] = json!("scale");
    builder.root["animations"][0]["samplers"][0]["output"] = json!(scales);
    let (mut stage, animation) = animated(load_glb(&builder).unwrap());
    let before = stage.scene.triangles.clone();
    let refused = at(&mut stage, &animation, 1.0).unwrap_err();
    assert!(matches!(&refused, Unchangeable::Shape { name, .. } if name == "bar"), "{refused}");
    assert_eq!(stage.scene.triangles, before);
    // What deforms cannot be placed, nor what is placed be bent.
    let place = Change::Place { mover: 0, map: DAffine3::IDENTITY };
    assert!(matches!(stage.change(&[place]), Err(Unchangeable::Place { .. })));
    let Pose::Shape(corners) = stage.poses().remove(0) else { panic!("the bar deforms") };
    assert!(matches!(stage.change(&[Change::Shape { mover: 0, corners: corners[1..].into() }]), Err(Unchangeable::Shape { .. })));
    let rigid = Stage::animated(load_glb(&moving_file()).unwrap()).unwrap();
    assert!(matches!(rigid.clone().change(&[Change::Shape { mover: 0, corners }]), Err(Unchangeable::Shape { .. })));
}

/// A point of a triangle is brought to where that has gone, and back.
#[test]
fn points_of_triangles_go_with_them() {
    let (mut stage, animation) = animated(load_glb(&bar()).unwrap());
    let (before, poses) = (stage.scene.triangles.clone(), stage.poses());
    assert!(stage.motions(&poses).iter().all(|motion| motion.map == glam::DMat4::IDENTITY));
    at(&mut stage, &animation, 0.7).unwrap();
    let (forward, backward) = (stage.motions(&poses), stage.backward(&poses));
    assert_eq!((forward.len(), backward.len()), (4, 4));
    for (forward, backward) in forward.iter().zip(&backward) {
        let at = forward.triangles.start;
        let (was, is) = (&before[at], &stage.scene.triangles[at]);
        let point = |triangle: &Triangle| triangle.position(glam::Vec2::new(0.2, 0.3)) + 0.01 * triangle.face_normal();
        let [went, came] = [(forward, was), (backward, is)].map(|(motion, from)| motion.map.transform_point3(point(from).as_dvec3()).as_vec3());
        assert!(went.distance(point(is)) < 1e-5 && came.distance(point(was)) < 1e-5, "{went} {came}");
    }
}
