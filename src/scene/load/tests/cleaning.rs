//! What all formats share: recentring, normals, triangles left out.

use super::*;
use glam::{DVec3, Vec3};

fn document(geometry: &str, rest: &str) -> String {
    format!(r#"Scene(version: 1, geometry: [{geometry}], materials: {{ "*": Diffuse(reflectance: (0.5, 0.5, 0.5)) }}, {rest})"#)
}

const SHAPES: &str = "Box(min: (0, 0, 0), max: (1, 2, 3)), Sphere(centre: (0.1, 0.7, 5.3), radius: 0.7)";

#[test]
fn scenes_far_away_keep_their_shape() {
    let near = load_text(&document(SHAPES, "")).unwrap();
    assert_eq!(near.origin, DVec3::ZERO);
    for distance in [1e6, -3e7] {
        let place = format!("Place(of: [{SHAPES}], translate: ({distance}, 0, {distance}))");
        let light = format!("lights: [Point(position: ({distance}, 5, {distance}), intensity: (1, 1, 1))], normals: File");
        let far = load_text(&document(&place, &light)).unwrap();
        expect_sound(&far);
        assert_eq!(far.triangles.len(), near.triangles.len());
        let shift = (DVec3::new(distance, 0.0, distance) - far.origin).as_vec3();
        let corners = near.triangles.iter().zip(&far.triangles).flat_map(|(a, b)| a.positions.into_iter().zip(b.positions));
        let worst = corners.map(|(a, b)| (a + shift).distance(b)).fold(0.0, f32::max);
        assert!(worst < 2e-6 * near.extent(), "moved by {distance}, off by {worst}");
        let crate::scene::LightKind::Point { position, .. } = far.lights[0].kind else { panic!("not a point light") };
        assert_eq!(position, shift + Vec3::new(0.0, 5.0, 0.0));
    }
}

#[test]
fn the_unit_of_length_does_not_matter() {
    let unit = load_text(&document(SHAPES, "")).unwrap();
    for scale in [1e-3_f32, 1e6] {
        let scaled = load_text(&document(&format!("Place(of: [{SHAPES}], scale: ({scale}, {scale}, {scale}))"), "")).unwrap();
        assert_eq!(scaled.triangles.len(), unit.triangles.len());
        assert_eq!(scaled.notes, unit.notes);
        let corners = unit.triangles.iter().zip(&scaled.triangles).flat_map(|(a, b)| a.positions.into_iter().zip(b.positions));
        assert!(corners.map(|(a, b)| a.distance(b / scale)).fold(0.0, f32::max) < 1e-6 * unit.extent());
        let normals = unit.triangles.iter().zip(&scaled.triangles).flat_map(|(a, b)| a.normals.into_iter().zip(b.normals));
        assert!(normals.map(|(a, b)| a.distance(b)).fold(0.0, f32::max) < 1e-5);
    }
}

#[test]
fn mirrored_geometry_keeps_its_front_outside() {
    let place = "Place(of: [Sphere(centre: (0, 0, 0), radius: 1)], scale: (-1, 2, 0.5), rotate: (axis: (1, 1, 0), degrees: 30))";
    for normals in ["File", "Face", "Smooth(degrees: 60)"] {
        let scene = load_text(&document(place, &format!("normals: {normals}"))).unwrap();
        expect_sound(&scene);
        for triangle in &scene.triangles {
            let middle: Vec3 = triangle.positions.iter().sum::<Vec3>() / 3.0;
            assert!(triangle.face_normal().dot(middle) > 0.0 && triangle.normals.iter().all(|n| n.dot(middle) > 0.0), "{normals}");
        }
    }
}

#[test]
fn smooth_normals_stop_at_their_angle() {
    let corner = |degrees: &str| load_text(&document("Box(min: (0, 0, 0), max: (1, 1, 1))", &format!("normals: Smooth(degrees: {degrees})"))).unwrap();
    for triangle in &corner("89").triangles {
        assert!(triangle.normals.iter().all(|n| n.distance(triangle.face_normal()) < 1e-6));
    }
    // Three right angles meet in every corner of a cube.
    for triangle in &corner("91").triangles {
        for (normal, position) in triangle.normals.iter().zip(triangle.positions) {
            assert!(normal.distance((position - 0.5).normalize()) < 1e-6);
        }
    }
    let ball = load_text(&document("Sphere(centre: (0, 0, 0), radius: 2, subdivisions: 4)", "normals: Smooth(degrees: 40)")).unwrap();
    let off = ball.triangles.iter().flat_map(|t| t.normals.into_iter().zip(t.positions)).map(|(n, p)| n.distance(p / 2.0)).fold(0.0, f32::max);
    assert!(off < 4e-3, "{off}");
}

#[test]
fn triangles_without_area_and_repetitions_are_left_out() {
    let triangles = "Triangles(positions: [(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0), (0, 0, 1)],
        indices: [(0, 1, 2), (0, 1, 3), (1, 1, 2), (1, 2, 0), (2, 1, 0), (0, 1, 4)])";
    let scene = load_text(&document(triangles, "")).unwrap();
    assert_eq!(scene.triangles.len(), 2);
    let expected = ["2 of 6 triangles have no area and were left out", "2 of 6 triangles repeat another and were left out"];
    assert_eq!(scene.notes[..2], expected);
}

#[test]
fn the_camera_that_is_made_sees_everything() {
    let scene = load_text(&document(SHAPES, "")).unwrap();
    let camera = &scene.cameras[0];
    let half = camera.half_extent([100, 100]);
    for position in scene.triangles.iter().flat_map(|t| t.positions) {
        let ray = position - camera.eye;
        let depth = ray.dot(camera.direction);
        assert!(depth > 0.0 && ray.dot(camera.right()).abs() < half.x * depth && ray.dot(camera.up).abs() < half.y * depth);
    }
}
