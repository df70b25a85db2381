//! Entries of `materials` that change one factor of a file's material.

use super::*;
use crate::scene::{Glossy, load::Problem};
use glam::Vec3;

const OBJ: &[u8] = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl plain\nf 1/1 2/2 3/3\nusemtl shiny\nf 1/1 2/2 4/3\n";
const MTL: &[u8] = b"newmtl plain\nKd 0.5 0.5 0.5\nmap_Kd a.png\nnewmtl shiny\nKd 0.2 0.2 0.2\nKs 0.1 0.2 0.3\nNs 40\nillum 2\nmap_Kd a.png\n";

/// The scene of an OBJ file with a texture on both of its materials, `plain` and `shiny`.
fn changed(entries: &str) -> Result<Scene, SceneError> {
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_pixel(2, 2, image::Rgba([10, 20, 30, 255])).write_to(&mut png, image::ImageFormat::Png).unwrap();
    let document = format!("Scene(version: 1, geometry: [File(\"a.obj\")], materials: {{ {entries} }})");
    let files: [(&str, &[u8]); 4] = [("a.ron", document.as_bytes()), ("a.obj", OBJ), ("a.mtl", MTL), ("a.png", png.get_ref())];
    load_files(&files).map_err(|(error, _)| error)
}

#[test]
fn a_change_keeps_all_that_it_does_not_name() {
    let scene = changed("\"plain\": Change(reflectance: (0.9, 0.8, 0.7)), \"shiny\": Change(exponent: 5, radiance: (1, 2, 3), two_sided: false)").unwrap();
    let [plain, shiny] = &scene.materials[..] else { panic!("{:?}", scene.materials) };
    assert_eq!((plain.reflectance, plain.texture, plain.glossy), (Vec3::new(0.9, 0.8, 0.7), Some(0), None));
    assert_eq!((shiny.reflectance, shiny.texture, shiny.emission, shiny.two_sided), (Vec3::splat(0.2), Some(0), Vec3::new(1.0, 2.0, 3.0), false));
    assert_eq!(shiny.glossy, Some(Glossy::Phong { reflectance: Vec3::new(0.1, 0.2, 0.3), exponent: 5.0 }));
}

#[test]
fn a_change_for_all_others_leaves_each_its_own_colour() {
    let scene = changed("\"shiny\": Diffuse(reflectance: (0.3, 0.3, 0.3)), \"*\": Change(metallic: 1, roughness: 0.4)").unwrap();
    let of = |name: &str| scene.materials.iter().find(|material| material.name == name).unwrap();
    assert_eq!(of("plain").glossy, Glossy::metallic_roughness(1.0, 0.4));
    assert_eq!((of("plain").reflectance, of("plain").texture, of("shiny").texture), (Vec3::splat(0.5), Some(0), None));
    let scene = changed("\"plain\": Change(metallic: 0)").unwrap();
    assert_eq!(scene.materials[0].glossy, None, "no metal, as rough as can be: diffuse");
}

#[test]
fn what_does_not_fit_the_files_material_is_refused() {
    for (entries, expected) in [
        ("\"shiny\": Change(roughness: 0.5)", "the file's lobe has `specular`, not `metallic` and `roughness`"),
        ("\"plain\": Change(exponent: 9)", "a new one needs both `specular` and `exponent`"),
        ("\"plain\": Change(exponent: 9, roughness: 1)", "a material has either `metallic` and `roughness` or `specular` and `exponent`"),
        ("\"plain\": Change(roughness: 2)", "2 is out of range"),
        ("\"plan\": Change(roughness: 1)", "nothing in the scene has the material `plan`"),
    ] {
        let error = changed(entries).unwrap_err();
        assert!(error.to_string().contains(expected), "{entries}: {error}");
    }
    let shape = "Scene(version: 1, geometry: [Box(min: (0, 0, 0), max: (1, 1, 1))], materials: { \"*\": Change(roughness: 1) })";
    let error = load_text(shape).unwrap_err();
    assert!(error.problem() == Problem::UnknownMaterial && error.to_string().contains("a shape of the document needs a whole one"), "{error}");
}
