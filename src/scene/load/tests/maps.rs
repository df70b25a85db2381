//! Textures beside the base colour, how they are read, and colours of vertices.

use super::{gltf::Builder, *};
use crate::scene::{
    DIELECTRIC, Glossy, Reading, Tint, Triangle, Wrap,
    surface::{Ray, Surface},
};
use glam::{Vec2, Vec3};
use serde_json::{Value, json};

pub(super) fn png(width: u32, height: u32, colour: impl Fn(u32, u32) -> [u8; 3]) -> Vec<u8> {
    let image = image::RgbImage::from_fn(width, height, |x, y| image::Rgb(colour(x, y)));
    let mut png = std::io::Cursor::new(Vec::new());
    image.write_to(&mut png, image::ImageFormat::Png).unwrap();
    png.into_inner()
}

/// A square of two triangles, its corners (0, 0) to (1, 1) of the texture from its top left on, with the images as textures.
fn square(material: Value, images: &[Vec<u8>]) -> Builder {
    let mut builder = Builder::new(json!({
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648}],
        "textures": (0..images.len()).map(|at| json!({"source": at, "sampler": 0})).collect::<Vec<_>>(),
        "materials": [material],
    }));
    let images: Vec<Value> = images.iter().map(|image| json!({"bufferView": builder.view(image), "mimeType": "image/png"})).collect();
    builder.root["images"] = Value::from(images);
    let positions = builder.floats(&[[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]);
    let uvs = builder.floats(&[[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]);
    let colours = builder.floats(&[[1.0, 0.0, 0.0, 1.0], [1.0; 4], [0.25, 0.5, 2.0, 0.0], [1.0; 4]]);
    let indices = builder.indices(&[0, 1, 2, 0, 2, 3]);
    let attributes = json!({"POSITION": positions, "TEXCOORD_0": uvs, "COLOR_0": colours});
    builder.root["meshes"] = json!([{"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}]);
    builder
}

fn loaded(material: Value, images: &[Vec<u8>]) -> Scene {
    load_files(&[("thing.glb", &square(material, images).finish())]).map_err(|(error, _)| error).unwrap()
}

/// Metallic-roughness, normals and emission, each by an image of its own.
fn all_maps() -> Scene {
    load_files(&[("thing.glb", &mapped().finish())]).map_err(|(error, _)| error).unwrap()
}

/// The file of that.
pub(super) fn mapped() -> Builder {
    let images = [png(2, 2, |_, _| [0, 51, 255]), png(2, 2, |_, _| [255, 128, 128]), png(4, 1, |x, _| if x < 2 { [0, 0, 0] } else { [255, 255, 255] })];
    square(
        json!({
            "emissiveFactor": [1, 0.5, 0.25],
            "emissiveTexture": {"index": 2},
            "normalTexture": {"index": 1, "scale": 0.5},
            "pbrMetallicRoughness": {"metallicFactor": 0.5, "roughnessFactor": 0.8, "metallicRoughnessTexture": {"index": 0}},
        }),
        &images,
    )
}

/// What is seen from straight above of the place (x, y) of a square on z = 0.
pub(super) fn seen_at(scene: &Scene, x: f32, y: f32, lobes: bool) -> Surface {
    let ray = Ray::new(Vec3::new(x, y, 1.0), -Vec3::Z);
    let meets = |t: &Triangle| t.position(t.barycentric(ray)).truncate().distance(ray.origin.truncate()) < 1e-5;
    let at = scene.triangles.iter().position(meets).unwrap();
    scene.seen(at as u32, ray, lobes)
}

#[test]
fn all_maps_of_a_gltf_material_are_read() {
    let scene = all_maps();
    expect_sound(&scene);
    let maps = scene.materials[0].maps;
    let reading = |map: Option<u32>| scene.textures[map.unwrap() as usize].reading;
    let wrap = [Wrap::Clamp, Wrap::Mirror];
    assert_eq!([maps.facets, maps.normal, maps.emission].map(reading), [true, true, false].map(|is_linear| Reading { is_linear, is_fine: false, wrap }));
    assert_eq!(maps.normal_scale, 0.5);
    assert!(!scene.notes.iter().any(|note| note.contains("not read")), "{:?}", scene.notes);

    let seen = |x: f32, y: f32| [true, false].map(|lobes| seen_at(&scene, x, y, lobes));
    // On the left the map is black, on the right white.
    assert_eq!(seen(0.2, 0.5)[0].emission, Vec3::ZERO);
    assert!(seen(0.9, 0.5)[0].emission.distance(Vec3::new(1.0, 0.5, 0.25)) < 1e-5);
    // Half as far along the surface as the map has it; with a lobe no farther than what mirrors the eye's way along the surface.
    let [with_lobe, plain] = seen(0.5, 0.25).map(|surface| surface.normal);
    assert!(plain.distance(Vec3::new(0.5, 0.0, 1.0 / 255.0).normalize()) < 0.02, "{plain}");
    assert!(with_lobe.x > 0.0 && (2.0 * with_lobe.z * with_lobe.z - 1.0).abs() < 0.02, "{with_lobe}");
    let lobe = seen(0.9, 0.9)[0].glossy.unwrap().lobe;
    let crate::math::lobe::Shape::Microfacets { alpha } = lobe.shape else { panic!("{lobe:?}") };
    assert!((alpha - (0.8f32 * 0.2).powi(2)).abs() < 1e-6, "{alpha}");
    // Half metal: half of the base colour, and of what is reflected by what is no metal. The corner there is white.
    assert!((lobe.reflectance.x - (0.5 * DIELECTRIC + 0.5)).abs() < 0.1, "{lobe:?}");
}

/// A sampler that names no mipmaps has none; any other has, and so have images that nothing is said of.
#[test]
fn samplers_say_whether_there_are_mipmaps() {
    let [nearest, linear, mipmapped] = [9728, 9729, 9987].map(Some);
    for (filter, has_levels) in [(None, true), (nearest, false), (linear, false), (mipmapped, true)] {
        let mut builder = mapped();
        if let Some(filter) = filter {
            builder.root["samplers"][0]["minFilter"] = json!(filter);
        }
        let scene = load_files(&[("thing.glb", &builder.finish())]).map_err(|(error, _)| error).unwrap();
        assert!(scene.textures.iter().all(|texture| texture.coarser.is_empty() != has_levels), "{filter:?}");
    }
}

#[test]
fn triangles_are_lamps_where_their_emission_map_shines() {
    // The first triangle has the lower left, the second the upper right corner: half of all that shines, at the right, is three quarters in the second.
    let scene = all_maps();
    let mean: Vec<f32> = (0..2).map(|triangle| scene.mean_emission(triangle).x).collect();
    assert!((mean.iter().sum::<f32>() - 1.0).abs() < 0.02 && (mean[0].min(mean[1]) - 0.25).abs() < 0.02, "{mean:?}");

    let only_below = png(1, 8, |_, y| if y < 7 { [0; 3] } else { [255; 3] });
    let mut builder = square(json!({"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}), &[only_below]);
    // A second square that lies in the black part.
    let uvs = builder.floats(&[[0.1, 0.1], [0.1, 0.2], [0.2, 0.2], [0.2, 0.1]]);
    let positions = builder.floats(&[[3.0, 1.0, 0.0], [3.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 1.0, 0.0]]);
    let indices = builder.indices(&[0, 1, 2, 0, 2, 3]);
    let primitives = builder.root["meshes"][0]["primitives"].as_array_mut().unwrap();
    primitives.push(json!({"attributes": {"POSITION": positions, "TEXCOORD_0": uvs}, "indices": indices, "material": 0}));
    let scene = load_files(&[("thing.glb", &builder.finish())]).map_err(|(error, _)| error).unwrap();
    assert!(scene.triangles.len() == 4 && scene.emitters().len() <= 2, "{:?}", scene.emitters());
    assert!(scene.emitters().iter().all(|lamp| scene.triangles[*lamp as usize].positions[0].x < 2.0));
}

#[test]
fn a_map_of_emission_that_is_missing_makes_no_lamp() {
    let scene = loaded(json!({"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}), &[b"no image".to_vec()]);
    assert!(!scene.materials[0].emits() && scene.notes.iter().any(|note| note.contains("their surfaces go without")), "{:?}", scene.notes);
}

#[test]
fn colours_of_vertices_multiply_the_base_colour() {
    let scene = loaded(json!({"pbrMetallicRoughness": {"metallicFactor": 0}}), &[]);
    let of = |at: Vec3| {
        let corner = |t: &Triangle| t.positions.iter().position(|p| p.distance(at) < 1e-6).map(|corner| t.tints[corner].colour());
        scene.triangles.iter().find_map(corner).unwrap()
    };
    assert_eq!((of(Vec3::ZERO), of(Vec3::Y)), (Vec3::ONE, Vec3::X));
    assert!(scene.triangles.iter().any(|triangle| triangle.uvs.contains(&Vec2::ONE)), "coordinates are read without a texture, too");
    // Ten bits for the root; more than all of the light is not reflected.
    assert!(of(Vec3::X).distance(Vec3::new(0.25, 0.5, 1.0)) < 2e-3, "{}", of(Vec3::X));
    let obj = b"v 0 0 0 1 1 1\nv 1 0 0 0.5 0 0\nv 0 1 0\nf 1 2 3\n";
    let scene = load_files(&[("a.obj", &obj[..])]).map_err(|(error, _)| error).unwrap();
    assert!(scene.triangles[0].tints[1].colour().distance(Vec3::new(0.214, 0.0, 0.0)) < 2e-3, "{:?}", scene.triangles[0]);
    assert_eq!(scene.triangles[0].tints[2], Tint::default());
}

#[test]
fn extensions_say_what_is_reflected_along_the_normal() {
    let lobe = |material: Value| loaded(material, &[]).materials[0].glossy;
    let facets = |dielectric: Vec3| Some(Glossy::MetallicRoughness { metallic: 0.0, roughness: 0.5, dielectric });
    let with = |extensions: Value| json!({"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.5}, "extensions": extensions});
    assert_eq!(lobe(with(json!({}))), facets(Vec3::splat(DIELECTRIC)));
    assert_eq!(lobe(with(json!({"KHR_materials_ior": {"ior": 3.0}}))), facets(Vec3::splat(0.25)));
    let specular = json!({"KHR_materials_ior": {"ior": 3.0}, "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 0.5, 8]}});
    assert_eq!(lobe(with(specular)), facets(Vec3::new(0.125, 0.0625, 0.5)));
    assert_eq!(lobe(with(json!({"KHR_materials_specular": {"specularFactor": 0}}))), None);
    let glossiness =
        json!({"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0.1, 0.2, 0.3, 1], "specularFactor": [0.5, 0.6, 0.7], "glossinessFactor": 0.5}});
    assert_eq!(lobe(json!({"extensions": glossiness})), facets(Vec3::new(0.5, 0.6, 0.7)));
}

/// A square of which every texture repeats, with a second set of coordinates that swaps the first.
fn square_of_two_sets(material: Value, images: &[Vec<u8>]) -> Builder {
    let mut builder = square(material, images);
    builder.root["samplers"] = json!([{}]);
    let swapped = builder.floats(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    builder.root["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(swapped);
    builder
}

/// Maps that lie otherwise than the base colour, and tangents.
pub(super) fn charted() -> Builder {
    let material = json!({
        "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 1, "texCoord": 1},
        "normalTexture": {"index": 1, "extensions": {"KHR_texture_transform": {"scale": [2, 1], "offset": [0.5, 0], "rotation": 0.3, "texCoord": 0}}},
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
    });
    let mut builder = square_of_two_sets(material, &[png(2, 2, |x, y| [90 * x as u8, 90 * y as u8, 9]), png(1, 2, |_, y| [99, 128, 200 + 9 * y as u8])]);
    let (normals, tangents) = (builder.floats(&[[0.0, 0.0, 1.0]; 4]), builder.floats(&[[1.0, 0.0, 0.0, 1.0]; 4]));
    let attributes = &mut builder.root["meshes"][0]["primitives"][0]["attributes"];
    (attributes["NORMAL"], attributes["TANGENT"]) = (json!(normals), json!(tangents));
    builder
}

/// What differs in coordinates is seen as if its image had been made for those of the base colour.
#[test]
fn maps_may_have_coordinates_of_their_own() {
    let colours = |x: u32, y: u32| [40 + 50 * x as u8, 60 + 70 * y as u8, 128 + 30 * ((x + y) % 2) as u8];
    let base = png(2, 2, |x, y| [200 - 90 * x as u8, 200 - 80 * y as u8, 9]);
    let material = |own: Value| {
        let with =
            |index: u32| [json!({"index": index}).as_object().unwrap().clone(), own.as_object().unwrap().clone()].into_iter().flatten().collect::<Value>();
        json!({
            "emissiveFactor": [1, 1, 1], "emissiveTexture": with(1), "normalTexture": with(1),
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": with(1)},
        })
    };
    let load_one = |own: Value, image: Vec<u8>| {
        let builder = square_of_two_sets(material(own), &[base.clone(), image]);
        // As it is, and mirrored by a document.
        let document = r#"Scene(version: 1, geometry: [File("a.glb"), Place(of: [File("a.glb")], scale: (-1, 1, 1))])"#;
        let scene = load_files(&[("a.ron", document.as_bytes()), ("a.glb", &builder.finish())]).map_err(|(error, _)| error).unwrap();
        assert!(!scene.notes.iter().any(|note| note.contains("not read")), "{:?}", scene.notes);
        expect_sound(&scene);
        scene
    };
    let image = png(3, 2, colours);
    let half = json!({"extensions": {"KHR_texture_transform": {"scale": [2, 1]}}});
    let both = json!({"texCoord": 0, "extensions": {"KHR_texture_transform": {"scale": [1, 2], "texCoord": 1}}});
    for (own, resampled) in
        [(half, png(6, 2, |x, y| colours(x % 3, y))), (json!({"texCoord": 1}), png(2, 3, |x, y| colours(y, x))), (both, png(4, 3, |x, y| colours(y, x % 2)))]
    {
        let (by_chart, expected) = (load_one(own.clone(), image.clone()), load_one(json!({}), resampled));
        assert_eq!((by_chart.charts.len(), expected.charts.len()), (1, 0), "{own}");
        for at in 0..100 {
            let [x, y] = [(at as f32 * 0.618_034).fract() * 2.0 - 1.0, (at as f32 + 0.5) / 100.0];
            let [found, expected] = [&by_chart, &expected].map(|scene| seen_at(scene, x, y, true));
            let lobes = [found, expected].map(|surface| surface.glossy.unwrap().lobe);
            assert!(found.reflectance.distance(expected.reflectance) < 1e-5 && found.emission.distance(expected.emission) < 1e-5, "{own} at {x} {y}");
            assert!(lobes[0].reflectance.distance(lobes[1].reflectance) < 1e-5, "{own} at {x} {y}: {lobes:?}");
            // A frame that is turned along with the image turns the normal along: red leans along the second coordinate where that is swapped.
            if own.get("texCoord").is_none() {
                assert!(found.normal.distance(expected.normal) < 1e-5, "{own} at {x} {y}: {} {}", found.normal, expected.normal);
            }
        }
    }
    // The same coordinates, however they are said, are one set.
    let alike = json!({"extensions": {"KHR_texture_transform": {"scale": [1, 1], "texCoord": 0}}});
    assert!(load_one(alike, image).charts.is_empty());
}

/// Red leans along the first coordinate of a map's own set, which here runs down the square.
#[test]
fn normals_lean_along_their_own_coordinates() {
    let images = [png(2, 2, |_, _| [9, 9, 9]), png(2, 2, |_, _| [218, 128, 218])];
    let material = json!({"normalTexture": {"index": 1, "texCoord": 1}, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
    let scene = load_files(&[("a.glb", &square_of_two_sets(material, &images).finish())]).map_err(|(error, _)| error).unwrap();
    let normal = seen_at(&scene, 0.4, 0.3, false).normal;
    assert!(normal.distance(Vec3::new(0.0, -1.0, 1.0).normalize()) < 0.01, "{normal}");
}

/// Tangents of a file turn the frame, as they are spread between corners; mirroring mirrors them, and what has none keeps that of its triangle.
#[test]
fn normals_lean_along_the_tangents_of_a_file() {
    let material = json!({"normalTexture": {"index": 0}, "pbrMetallicRoughness": {"metallicFactor": 0}});
    let tilted = png(1, 1, |_, _| [218, 128, 218]);
    let load_one = |tangents: Option<[[f32; 4]; 4]>, place: &str| {
        let mut builder = square(material.clone(), std::slice::from_ref(&tilted));
        let normals = builder.floats(&[[0.0, 0.0, 1.0]; 4]);
        let tangents = tangents.map(|tangents| builder.floats(&tangents));
        let attributes = &mut builder.root["meshes"][0]["primitives"][0]["attributes"];
        attributes["NORMAL"] = json!(normals);
        attributes["TANGENT"] = json!(tangents);
        tangents.is_none().then(|| attributes.as_object_mut().unwrap().remove("TANGENT"));
        let document = format!("Scene(version: 1, geometry: [Place(of: [File(\"a.glb\")]{place})])");
        let scene = load_files(&[("a.ron", document.as_bytes()), ("a.glb", &builder.finish())]).map_err(|(error, _)| error).unwrap();
        expect_sound(&scene);
        scene
    };
    let leans = |scene: &Scene, x: f32, y: f32, way: Vec3| {
        let normal = seen_at(scene, x, y, false).normal;
        assert!(normal.distance((way.normalize() + Vec3::Z).normalize()) < 0.01, "{normal} at {x} {y} instead of {way}");
    };
    let plain = load_one(None, "");
    assert!(plain.tangents.is_empty());
    leans(&plain, 0.3, 0.6, Vec3::X);
    // Turned by an eighth of a circle, and as long as may be.
    let turned = [[2.0, 2.0, 0.0, 1.0]; 4];
    for (place, way, x) in
        [("", Vec3::new(1.0, 1.0, 0.0), 0.3), (", scale: (-1, 1, 1)", Vec3::new(-1.0, 1.0, 0.0), -0.3), (", scale: (1, 2, 1)", Vec3::new(1.0, 2.0, 0.0), 0.3)]
    {
        leans(&load_one(Some(turned), place), x, 0.6, way);
    }
    // From the upper corners' along x to the lower corners' along y.
    let spread = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]];
    for y in [0.1, 0.5, 0.8] {
        leans(&load_one(Some(spread), ""), 0.3, y, Vec3::new(y, 1.0 - y, 0.0));
    }
    // Along the normal, or none.
    for useless in [[0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]] {
        leans(&load_one(Some([useless; 4]), ""), 0.3, 0.6, Vec3::X);
    }
}

#[test]
fn each_file_of_a_document_has_its_own_textures() {
    let image = |red: u8| png(1, 1, |_, _| [red, 0, 0]);
    let file = |red: u8| {
        let images = [image(255), image(red)];
        let material = json!({"name": format!("m{red}"), "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 1}, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
        square(material, &images).finish()
    };
    let document = r#"Scene(version: 1, geometry: [File("a.glb"), Place(of: [File("b.glb")], translate: (2, 0, 0))])"#;
    let scene = load_files(&[("a.ron", document.as_bytes()), ("a.glb", &file(255)), ("b.glb", &file(0))]).map_err(|(error, _)| error).unwrap();
    assert_eq!([0.5, 2.5].map(|x| seen_at(&scene, x, 0.4, false).emission.x), [1.0, 0.0]);
}

#[test]
fn windows_are_open() {
    let glass = |factor: f32| square(json!({"extensions": {"KHR_materials_transmission": {"transmissionFactor": factor}}}), &[]).finish();
    let scene = load_files(&[("thing.glb", &glass(0.4))]).map_err(|(error, _)| error).unwrap();
    assert!(scene.triangles.len() == 2 && scene.notes[0].contains("let some light through: they are opaque"), "{:?}", scene.notes);
    let (error, _) = load_files(&[("thing.glb", &glass(0.9))]).unwrap_err();
    assert!(error.to_string().contains("no triangle"), "{error}");
}

#[test]
fn what_blends_hides_all_or_nothing() {
    let with_alpha = |alpha: f32| json!({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, alpha]}});
    let builder = |alpha| square(with_alpha(alpha), &[]).finish();
    assert_eq!(load_files(&[("thing.glb", &builder(0.6))]).map_err(|(error, _)| error).unwrap().triangles.len(), 2);
    let (error, _) = load_files(&[("thing.glb", &builder(0.4))]).unwrap_err();
    assert!(error.to_string().contains("no triangle"), "{error}");
}
