//! What two files say of what they show. A picture of one scene tells nothing of another's error.

use crate::measure::layers::Layers;
use std::path::Path;

/// The checksum of geometry, materials, textures and lights, as an attribute.
pub const SCENE_CHECKSUM: &str = "scene-checksum";

/// Most that cameras may differ in an entry of their matrices, as a share of its column: they went through text or single precision.
const SAME: f32 = 1e-4;

/// Each thing that both files state and state differently, in words; empty where nothing speaks against a comparison.
pub fn other_view(test: &Layers, reference: &Layers) -> Vec<String> {
    [other_scene(test, reference), other_light(test, reference), other_camera(test, reference)].into_iter().flatten().collect()
}

/// What both state of one thing, where it differs.
fn differing<'l>(test: &'l Layers, reference: &'l Layers, name: &str) -> Option<[&'l str; 2]> {
    let [a, b] = [test, reference].map(|picture| picture.attributes.get(name).map(String::as_str));
    Some([a?, b?]).filter(|[a, b]| a != b)
}

fn other_scene(test: &Layers, reference: &Layers) -> Option<String> {
    let named = differing(test, reference, "scene").filter(|names| stem(names[0]) != stem(names[1]));
    let named = named.map(|[a, b]| format!("the scene is `{a}` in one and `{b}` in the other"));
    if let [Some(a), Some(b)] = [test, reference].map(|picture| picture.attributes.get(SCENE_CHECKSUM)) {
        let content = || "the scene has other geometry, materials or light".to_owned();
        return (a != b).then(|| named.unwrap_or_else(content));
    }
    let set = || differing(test, reference, "scene-set").map(|[a, b]| format!("the scene is generated with `{a}` in one and `{b}` in the other"));
    named.or_else(set)
}

/// The name of a scene without folders and ending: files and the names of those that ship mean the same.
fn stem(scene: &str) -> &str {
    Path::new(scene).file_stem().and_then(|stem| stem.to_str()).unwrap_or(scene)
}

/// Light from the command line: what one of them is lit by and the other is not counts too, where both were made by this program.
fn other_light(test: &Layers, reference: &Layers) -> Option<String> {
    let both_have = |name: &str| [test, reference].iter().all(|picture| picture.attributes.contains_key(name));
    let same_content = both_have(SCENE_CHECKSUM) && differing(test, reference, SCENE_CHECKSUM).is_none();
    if same_content || !both_have("program") {
        return None;
    }
    let told = |name: &str| {
        let [a, b] = [test, reference].map(|picture| picture.attributes.get(name).map_or("none", String::as_str));
        (a != b).then(|| format!("the {name} is {a} in one and {b} in the other"))
    };
    told("sky").or_else(|| told("sun"))
}

fn other_camera(test: &Layers, reference: &Layers) -> Option<String> {
    let names = || differing(test, reference, "camera").map(|[a, b]| format!("the camera is `{a}` in one and `{b}` in the other"));
    let (Some(a), Some(b)) = (&test.projection, &reference.projection) else { return names() };
    let [a, b] = [a, b].map(|projection| projection.world_to_ndc);
    let same = |column: usize| {
        let [a, b] = [a.col(column), b.col(column)];
        (a - b).abs().max_element() <= SAME * a.abs().max(b.abs()).max_element()
    };
    (!(0..4).all(same)).then(|| names().unwrap_or_else(|| "the camera stands or looks elsewhere".to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::projection::Projection;
    use crate::scene::load::load_text;
    use glam::DVec3;

    fn picture(attributes: &[(&str, &str)]) -> Layers {
        attributes.iter().fold(Layers::new(1, 1), |picture, (name, value)| picture.with_attribute(name, value))
    }

    #[test]
    fn what_both_state_must_agree() {
        let says = |a: &[(&str, &str)], b: &[(&str, &str)]| other_view(&picture(a), &picture(b)).join("; ");
        assert_eq!(says(&[("scene", "corner")], &[]), "");
        assert_eq!(says(&[("scene", "scenes/cornell.ron")], &[("scene", "cornell")]), "");
        assert_eq!(says(&[("scene", "corner")], &[("scene", "cornell")]), "the scene is `corner` in one and `cornell` in the other");
        // Two names of one scene, and one name of two.
        assert_eq!(says(&[("scene", "a"), (SCENE_CHECKSUM, "1")], &[("scene", "b"), (SCENE_CHECKSUM, "1")]), "");
        assert_eq!(
            says(&[("scene", "a"), (SCENE_CHECKSUM, "1")], &[("scene", "a"), (SCENE_CHECKSUM, "2")]),
            "the scene has other geometry, materials or light"
        );
        assert!(says(&[("scene", "a"), ("scene-set", "n=1")], &[("scene", "a"), ("scene-set", "n=2")]).contains("`n=1`"));
        assert_eq!(says(&[("camera", "nave")], &[("camera", "choir")]), "the camera is `nave` in one and `choir` in the other");
        let own = ("program", "hemisplat");
        assert_eq!(says(&[own, ("sun", "1,2")], &[own]), "the sun is 1,2 in one and none in the other");
        assert_eq!(says(&[own, ("sun", "1,2")], &[]), "");
    }

    #[test]
    fn cameras_are_compared_by_what_they_see() {
        let scene = load_text(
            "a.ron",
            r#"Scene(version: 1, geometry: [Box(min: (0, 0, 0), max: (1, 1, 1))], materials: { "*": Diffuse(reflectance: (0.5, 0.5, 0.5)) },
            cameras: { "main": (eye: (5, 3, 2), target: (0, 0, 0), fov: 50), "other": (eye: (5, 3.1, 2), target: (0, 0, 0), fov: 50) })"#,
        )
        .unwrap();
        let seen = |camera: usize, name: &str, size| Layers {
            projection: Some(Projection::of(&scene.cameras[camera], DVec3::ZERO, size)),
            ..picture(&[("camera", name)])
        };
        assert_eq!(other_view(&seen(0, "main", [64, 48]), &seen(0, "that", [640, 480])), Vec::<String>::new());
        assert_eq!(other_view(&seen(0, "main", [64, 48]), &seen(1, "main", [64, 48])), ["the camera stands or looks elsewhere"]);
    }
}
