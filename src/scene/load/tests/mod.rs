//! Tests of loading, by kind.

mod animation;
mod cleaning;
mod compressed;
mod deform;
mod errors;
mod files;
mod fuzz;
mod gltf;
mod library;
mod maps;
mod materials;
mod obj;
mod ply;
mod sky;

use super::{Disk, Files, LoadOptions, Scene, SceneError, load, load_document};
use std::path::Path;

/// Loads a document that has no folder of its own.
fn load_text(text: &str) -> Result<Scene, SceneError> {
    load_document(Path::new("scene.ron"), text, None, &Files::of(&Disk), &LoadOptions::default())
}

/// Writes files into a new folder and loads the first.
fn load_files(files: &[(&str, &[u8])]) -> Result<Scene, (SceneError, String)> {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    load(&folder.path().join(files[0].0), &LoadOptions::default()).map_err(|error| (error, folder.path().display().to_string()))
}

/// What every scene promises to those who render it.
fn expect_sound(scene: &Scene) {
    assert!(!scene.triangles.is_empty() && !scene.cameras.is_empty());
    for triangle in &scene.triangles {
        assert!(triangle.positions.iter().all(|p| p.is_finite()) && triangle.uvs.iter().all(|uv| uv.is_finite()));
        let front = triangle.face_normal();
        assert!(triangle.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-4 && n.dot(front) > 0.0), "{triangle:?}");
        assert!((triangle.material as usize) < scene.materials.len());
    }
    assert!(scene.charts.iter().all(|chart| chart.len() == scene.triangles.len() && chart.as_flattened().iter().all(|uv| uv.is_finite())));
    assert!(scene.materials.iter().all(|material| material.maps.last_chart() as usize <= scene.charts.len()));
    for material in &scene.materials {
        assert!(material.reflectance.cmpge(glam::Vec3::ZERO).all() && material.reflectance.cmple(glam::Vec3::ONE).all());
        let named = material.clone().textures_mut().map(|texture| texture.unwrap_or_default() as usize);
        assert!(material.emission.is_finite() && (scene.textures.is_empty() || named.iter().all(|texture| *texture < scene.textures.len())));
        assert!(material.maps.normal_scale.is_finite());
    }
    for lamp in scene.emitters() {
        assert!(scene.mean_emission(lamp).is_finite());
    }
    for camera in &scene.cameras {
        assert!(camera.eye.is_finite() && (camera.direction.length() - 1.0).abs() < 1e-4 && camera.direction.dot(camera.up).abs() < 1e-4);
    }
}
