//! What the command line says of a scene: its light, its camera, how bright it is shown, and what a pipeline makes of lobes that it cannot render.

mod place;

use glam::DVec3;
use hemisplat::measure::{IRRADIANCE, Layers, PICTURE};
use libtest_mimic::{Arguments, Failed};
use place::{Case, Outcome, Place, check};
use std::f64::consts::TAU;
use std::fs;

fn main() {
    place::run(&Arguments::from_args(), DRAWN, TRACED);
}

const DRAWN: &[(&str, Case)] = &[
    ("lobes_are_taken_by_their_albedo_where_nothing_renders_them", lobes_by_albedo),
    ("a_png_is_exposed_by_itself", exposed),
    ("samples_cover_what_a_pixel_sees", samples),
    ("the_outline_of_a_ball_does_not_show_its_far_side", outlines),
];

const TRACED: &[(&str, Case)] = &[
    ("a_scene_without_light_gets_a_sky_and_a_note", dark),
    ("a_sky_and_a_sun_light_a_scene", skies),
    ("a_camera_comes_from_the_command_line_and_is_printed", camera),
    ("options_of_a_view_are_checked", refused),
];

/// A floor and a box: materials of both, and what else the scene has.
fn scene(materials: &str, more: &str) -> String {
    format!(
        "Scene(version: 1, geometry: [
            Quad(corners: ((-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2)), material: \"floor\"),
            Box(min: (-0.5, 0, -0.5), max: (0.5, 1, 0.5), material: \"box\"),
        ], materials: {{ {materials} }}, {more}
        cameras: {{ \"main\": (eye: (2, 2, 3), target: (0, 0.4, 0), fov: 50, size: (32, 24)) }})"
    )
}

const DIFFUSE: &str = "\"floor\": Diffuse(reflectance: (0.6, 0.5, 0.4)), \"box\": Diffuse(reflectance: (0.2, 0.4, 0.7))";

/// A shining half of the picture: its edge rises by two pixels in five. Each pixel has as much light as the edge leaves of it, of sixteen samples within a
/// sixteenth; a filter blurs across the pixel's borders; nothing moves; and depth is that of one sample.
fn samples() -> Outcome {
    // The camera is 1 away, and the picture 20×20 pixels of 0.1.
    let text = "Scene(version: 1, geometry: [Quad(corners: ((-9, -9, 0), (9, -9, 0), (9, 3.6, 0), (-9, -3.6, 0)), material: \"lamp\")],
        materials: { \"lamp\": Emitter(radiance: (1, 1, 1)) },
        cameras: { \"main\": (eye: (0, 0, 1), direction: (0, 0, -1), up: (0, 1, 0), fov: 90, size: (20, 20)) })";
    let place = place(&[("edge.ron", text.to_owned())])?;
    let direct = "Pipeline(version: 1, about: \"what surfaces emit\", nodes: [(name: \"gbuffer\", pass: GBuffer()), (name: \"image\", pass: Composite(gbuffer: \"gbuffer\"))],
        outputs: { \"picture\": \"image\", \"depth\": \"gbuffer.depth\" })";
    fs::write(place.0.path().join("seen.ron"), direct)?;
    let drawn = |more: &str| -> Result<[Vec<f32>; 3], Failed> {
        place.succeed(&format!("render seen.ron --scene edge.ron -o seen.exr --stats seen.json{more}"))?;
        let picture = layers(&place, "seen.exr")?;
        let plane = |layer: &str, name: &str| picture.layers[layer].channels[name].clone();
        Ok([plane(PICTURE, "R"), plane(PICTURE, "A"), picture.layers["depth"].channels.values().next().expect("a plane").clone()])
    };
    // How much of a pixel is below the edge y = 0.4 x.
    let below = |pixel: usize| {
        let [left, top] = [(pixel % 20) as f64 * 0.1 - 1.0, 1.0 - (pixel / 20) as f64 * 0.1];
        let column = |at: u32| (((0.4 * (left + (f64::from(at) + 0.5) / 1e4)) - (top - 0.1)) / 0.1).clamp(0.0, 1.0);
        (0..1000).map(column).sum::<f64>() / 1000.0
    };
    let wrong = |light: &[f32]| light.iter().enumerate().map(|(pixel, light)| (f64::from(*light) - below(pixel)).abs()).fold(0.0, f64::max);
    let [one, _, _] = drawn("")?;
    check(one.iter().all(|light| [0.0, 1.0].contains(light)) && wrong(&one) > 0.4, || format!("{one:?}"))?;
    let [light, alpha, depth] = drawn(" --samples 16")?;
    check(wrong(&light) < 0.08, || format!("{} {light:?}", wrong(&light)))?;
    check(light == alpha && depth.iter().all(|depth| *depth == 0.0 || (depth - 1.0).abs() < 1e-5), || format!("{alpha:?} {depth:?}"))?;
    check(place.json("seen.json")?["samples"] == 16, || "not in the statistics".into())?;
    for filter in ["tent", "blackman-harris"] {
        let [blurred, _, _] = drawn(&format!(" --samples 64 --filter {filter}"))?;
        let sums = [&blurred, &light].map(|light| light.iter().sum::<f32>());
        check((sums[0] - sums[1]).abs() < 0.3 && wrong(&blurred) > 0.03 && wrong(&blurred) < 0.3, || format!("{filter}: {sums:?} {}", wrong(&blurred)))?;
    }
    place.succeed("render seen.ron --scene edge.ron -o one.exr")?;
    let (_, said) = place.succeed("diff seen.exr:picture one.exr:picture")?;
    check(said.contains("note: one picture has 64 samples a pixel (blackman-harris), the other one sample a pixel"), || said)?;
    // The rays of a reference are through one point of each pixel.
    place.succeed("reference --scene edge.ron --spp 4 -o truth.exr")?;
    let (_, said) = place.succeed("diff one.exr:picture truth.exr:picture")?;
    check(!said.contains("samples a pixel"), || said)?;
    let (status, _, said) = place.run("render seen.ron --scene edge.ron -o seen.exr --samples 0")?;
    check(status == 2 && said.contains("1..=1024"), || said)
}

/// A metal, and a lobe without a diffuse part.
const GLOSSY: &str = "\"floor\": MetallicRoughness(base: (0.6, 0.5, 0.4), metallic: 0.8, roughness: 0.3), \
                      \"box\": Phong(reflectance: (0, 0, 0), specular: (0.2, 0.4, 0.7), exponent: 30)";

const LAMP: &str = "lights: [Point(position: (1, 3, 1), intensity: (20, 20, 20))], environment: Constant((0.3, 0.4, 0.5)),";

/// Along its outline a ball's normals lead away from its middle. In this view the rasteriser alone has a pixel that shows the far side from within.
fn outlines() -> Outcome {
    let angle = TAU * 21.0 / 24.0 + 0.1;
    let eye = DVec3::new(5.0 * angle.sin(), 0.3 * 21.0 / 24.0, 5.0 * angle.cos());
    let DVec3 { x, y, z } = eye;
    let scene = format!(
        "Scene(version: 1, geometry: [Sphere(centre: (0, 0, 0), radius: 1, subdivisions: 3, material: \"ball\")],
        materials: {{ \"ball\": Diffuse(reflectance: (0.6, 0.6, 0.6)) }}, environment: Constant((1, 1, 1)),
        cameras: {{ \"main\": (eye: ({x:.6}, {y:.6}, {z:.6}), target: (0, 0, 0), fov: 26, size: (500, 500)) }})"
    );
    let seen =
        "Pipeline(version: 1, about: \"what is seen\", nodes: [(name: \"gbuffer\", pass: GBuffer()), (name: \"image\", pass: Composite(gbuffer: \"gbuffer\"))],
        outputs: { \"picture\": \"image\", \"normal\": \"gbuffer.normal\" })";
    let place = place(&[("ball.ron", scene), ("seen.ron", seen.to_owned())])?;
    place.succeed("render seen.ron --scene ball.ron -o seen.exr")?;
    let forward = -eye.normalize();
    let right = forward.cross(DVec3::Y).normalize();
    let up = right.cross(forward);
    let picture = layers(&place, "seen.exr")?;
    let normals = &picture.layers["normal"].channels;
    let leads_inwards = |pixel: &u32| {
        let way = (f64::from(pixel % 500) - 249.5) * right + (249.5 - f64::from(pixel / 500)) * up;
        let normal = DVec3::from(["X", "Y", "Z"].map(|axis| f64::from(normals[axis][*pixel as usize])));
        way.length() > 190.0 && normal.dot(way) < 0.0
    };
    let inwards: Vec<u32> = (0..250_000).filter(leads_inwards).collect();
    check(inwards.is_empty(), || format!("the far side at {inwards:?}"))
}

fn place(files: &[(&str, String)]) -> Result<Place, Failed> {
    let place = Place::new()?;
    files.iter().try_for_each(|(name, text)| fs::write(place.0.path().join(name), text))?;
    Ok(place)
}

fn layers(place: &Place, name: &str) -> Result<Layers, Failed> {
    Ok(Layers::read(&fs::read(place.0.path().join(name))?)?)
}

/// The mean luminance of the picture.
fn mean(place: &Place, name: &str) -> Result<f64, Failed> {
    let luminance = layers(place, name)?.luminance(PICTURE)?;
    Ok(luminance.iter().sum::<f64>() / luminance.len() as f64)
}

/// Device, host and the shaders for any scene take the glossy scene as the diffuse one of the same albedo, to the bit.
fn lobes_by_albedo() -> Outcome {
    let place = place(&[("glossy.ron", scene(GLOSSY, LAMP)), ("diffuse.ron", scene(DIFFUSE, LAMP))])?;
    let photons = r#"Variant(version: 1, about: "for any scene", of: "photon-density.ron", specialise: false, set: { "map.photons": 20000 })"#;
    fs::write(place.0.path().join("photons.ron"), photons)?;
    for pipeline in ["irradiance", "irradiance-device", "irradiance-general", "photons.ron"] {
        let render = |scene: &str| place.succeed(&format!("render {pipeline} --scene {scene}.ron -o {scene}.exr --stats {scene}.json"));
        let ((_, said), (_, silent)) = (render("glossy")?, render("diffuse")?);
        let note = "takes glossy materials as diffuse, by their albedo (`floor`, `box`); `radiance` renders their lobes";
        check(said.matches(note).count() == 1 && !silent.contains("glossy"), || format!("{said}\n{silent}"))?;
        check(place.json("glossy.json")?["plan"]["approximated"][0].as_str().is_some_and(|what| what.contains(note)), || "not in the statistics".into())?;
        for layer in [PICTURE, IRRADIANCE, "direct"] {
            let [glossy, diffuse] = ["glossy.exr", "diffuse.exr"].map(|name| layers(&place, name).map(|picture| picture.layers[layer].clone()));
            check(glossy? == diffuse?, || format!("{pipeline}: {layer} differs"))?;
        }
    }
    // Against the truth of metals alone, which has no irradiance, pictures are judged.
    fs::write(place.0.path().join("metal.ron"), scene(&GLOSSY.replace("metallic: 0.8", "metallic: 1"), LAMP))?;
    let arguments = "compare irradiance radiance --scene metal.ron --runs 1 --reference-spp 4 --reference-cache kept --json compared.json";
    place.succeed(arguments)?;
    let compared = &place.json("compared.json")?["variants"];
    check(compared[0]["errors"]["irradiance"].is_null() && compared[0]["errors"]["picture"]["rmse_over_mean"].is_f64(), || compared.to_string())?;
    check(compared[0]["approximated"][0].is_string() && compared[1]["approximated"] == serde_json::json!([]), || compared.to_string())?;
    let (status, _, message) = place.run("render irradiance --scene glossy.ron --strict -o strict.exr")?;
    check(status == 2 && message.contains("plan::glossy"), || message)?;
    let (_, said) = place.succeed("render radiance --scene glossy.ron --quiet -o lobes.exr")?;
    check(said.is_empty() && layers(&place, "lobes.exr")?.layers.contains_key("glossy"), || said)
}

/// The same room under a thousandth of the light looks the same, unless told otherwise.
fn exposed() -> Outcome {
    let dim = LAMP.replace("20, 20, 20", "0.02, 0.02, 0.02").replace("0.3, 0.4, 0.5", "0.0003, 0.0004, 0.0005");
    let place = place(&[("bright.ron", scene(DIFFUSE, LAMP)), ("dim.ron", scene(DIFFUSE, &dim))])?;
    let shown = |scene: &str, more: &str| -> Result<(f64, String), Failed> {
        let (_, said) = place.succeed(&format!("render irradiance --scene {scene}.ron -o {scene}.png{more}"))?;
        let bytes = image::open(place.0.path().join(format!("{scene}.png")))?.into_luma8().into_raw();
        Ok((bytes.iter().map(|byte| f64::from(*byte)).sum::<f64>() / bytes.len() as f64, said))
    };
    let ((bright, said), (dim, _), (dark, silent)) = (shown("bright", "")?, shown("dim", "")?, shown("dim", " --exposure 0")?);
    check((bright - dim).abs() < 2.0 && (70.0..180.0).contains(&bright) && dark < 10.0, || format!("{bright}, {dim}, {dark}"))?;
    check(said.contains("bright.png is exposed by ") && !silent.contains("exposed by"), || format!("{said}\n{silent}"))
}

fn trace(place: &Place, arguments: &str) -> Result<String, Failed> {
    Ok(place.succeed(&format!("reference --spp 4 -o out.exr --scene {arguments}"))?.1)
}

fn dark() -> Outcome {
    let place = place(&[("dark.ron", scene(DIFFUSE, "")), ("lit.ron", scene(DIFFUSE, LAMP))])?;
    let said = trace(&place, "dark.ron")?;
    check(said.contains("the scene has no light: it gets a white overcast sky") && mean(&place, "out.exr")? > 0.1, || said)?;
    let said = trace(&place, "lit.ron")?;
    check(!said.contains("no light"), || said)?;
    let glowing = Place::new()?;
    fs::write(
        glowing.0.path().join("glow.ron"),
        scene(&DIFFUSE.replacen("Diffuse(reflectance", "Emitter(radiance", 1).replace("(0.6, 0.5, 0.4)", "(0.01, 0.01, 0.01)"), ""),
    )?;
    for (more, told) in [("", true), (" --sky white", false), (" --sky none", false)] {
        let said = trace(&glowing, &format!("glow.ron{more}"))?;
        check(said.contains("that is little: --sky overcast or --sun AZIMUTH,ELEVATION") == told, || said)?;
    }
    let said = trace(&place, "dark.ron --sky none")?;
    check(said.contains("the picture is black") && mean(&place, "out.exr")? == 0.0, || said)
}

fn skies() -> Outcome {
    let place = place(&[("dark.ron", scene(DIFFUSE, "")), ("lit.ron", scene(DIFFUSE, LAMP))])?;
    for sky in ["clear", "overcast", "white"] {
        let said = trace(&place, &format!("dark.ron --sky {sky}"))?;
        check(!said.contains("no light") && mean(&place, "out.exr")? > 0.1, || format!("{sky}: {said}"))?;
        let stated = layers(&place, "out.exr")?.attributes.get("sky").cloned();
        check(stated.as_deref() == Some(sky), || format!("{stated:?}"))?;
    }
    // A sun on top of the lights that are there.
    trace(&place, "lit.ron")?;
    let before = mean(&place, "out.exr")?;
    trace(&place, "lit.ron --sun -135,40")?;
    check(mean(&place, "out.exr")? > 1.5 * before, || "the sun adds no light".into())?;
    // What a program wrote as a sky lights the scene.
    trace(&place, "dark.ron --sky white")?;
    let white = mean(&place, "out.exr")?;
    let image = image::Rgb32FImage::from_pixel(8, 4, image::Rgb([1.0, 1.0, 1.0]));
    image::DynamicImage::from(image).save(place.0.path().join("sky.hdr"))?;
    trace(&place, "dark.ron --sky sky.hdr")?;
    let found = mean(&place, "out.exr")?;
    check((found / white - 1.0).abs() < 0.02, || format!("{found} is not {white}"))
}

/// What is printed can be pasted into the scene, and shows the same.
fn camera() -> Outcome {
    let place = place(&[("a.ron", scene(DIFFUSE, LAMP))])?;
    let options = "--eye 1.5,0.7,-2.25 --target 0.1,0.2,0.3 --fov 35";
    let (printed, _) = place.succeed(&format!("reference --spp 4 -o moved.exr --scene a.ron --print-camera {options}"))?;
    check(printed.starts_with("\"main\": (eye: (1.5, 0.7, -2.25), "), || printed.clone())?;
    let pasted = scene(DIFFUSE, LAMP).replace("\"main\":", &format!("{printed} \"other\":"));
    fs::write(place.0.path().join("pasted.ron"), pasted)?;
    trace(&place, "pasted.ron")?;
    let depth = |name: &str| -> Result<Vec<f32>, Failed> { Ok(layers(&place, name)?.layers["depth"].channels.values().next().cloned().unwrap_or_default()) };
    let (moved, pasted) = (depth("moved.exr")?, depth("out.exr")?);
    check(moved.iter().any(|depth| *depth > 0.0), || "it sees nothing".into())?;
    check(moved.iter().zip(&pasted).all(|(a, b)| (a - b).abs() < 1e-3), || "the pasted camera sees something else".into())?;
    // The camera of a scene without one holds all of it, whatever the picture's shape: no pixel of its border sees a surface.
    fs::write(place.0.path().join("b.ron"), scene(DIFFUSE, LAMP).split("cameras:").next().unwrap_or_default().to_owned() + ")")?;
    for [width, height] in [[40, 40], [60, 20], [20, 60]] {
        trace(&place, &format!("b.ron --size {width}x{height}"))?;
        let seen: Vec<bool> = depth("out.exr")?.into_iter().map(|depth| depth > 0.0).collect();
        let is_border = |at: usize| at < width || at >= width * (height - 1) || at.is_multiple_of(width) || (at + 1).is_multiple_of(width);
        check((0..seen.len()).all(|at| !(seen[at] && is_border(at))), || format!("{width}×{height}: cut off"))?;
        check(seen.iter().filter(|seen| **seen).count() > width.min(height).pow(2) / 8, || format!("{width}×{height}: small"))?;
    }
    // An eye alone looks at the middle of the scene, whatever is up there.
    let (printed, _) = place.succeed("reference --spp 4 -o out.exr --scene a.ron --print-camera --eye 0,9,0")?;
    check(printed.contains("direction: (0, -1, 0), up: (0, 0, -1)"), || printed)
}

fn refused() -> Outcome {
    let place = place(&[("a.ron", scene(DIFFUSE, LAMP))])?;
    for (arguments, expected) in [
        ("--eye 1,2", "expected three numbers from -4e9 to 4e9, such as 0,1.6,4"),
        ("--eye 1,2,inf", "expected three numbers from -4e9 to 4e9, such as 0,1.6,4"),
        ("--eye 1,2,3e38", "expected three numbers from -4e9 to 4e9, such as 0,1.6,4"),
        ("--fov 179.99999999", "expected an angle of 0.001 to 179.9 degrees, such as 60"),
        ("--fov 1e-44", "expected an angle of 0.001 to 179.9 degrees, such as 60"),
        ("--sun 90,91", "expected two angles in degrees, such as 135,40"),
        ("--sky blue", "expected clear, overcast, white, none, or an image that ends in .exr or .hdr"),
        ("--sky missing.hdr", "`missing.hdr` cannot be read"),
    ] {
        let (status, _, message) = place.run(&format!("reference --scene a.ron -o out.exr {arguments}"))?;
        let said = message.split_whitespace().collect::<Vec<_>>().join(" ");
        check(status == 2 && said.contains(expected), || format!("{arguments}: status {status}\n{message}"))?;
    }
    Ok(())
}
