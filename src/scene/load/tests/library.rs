//! Maps of MTL: masks, lobes, heights, and their options.

use super::{maps::seen_at, *};
use crate::scene::{Glossy, Wrap};
use glam::Vec3;
use image::{DynamicImage, GrayImage, ImageFormat, Luma, Rgb, RgbImage, Rgba, RgbaImage};

fn png(image: impl Into<DynamicImage>) -> Vec<u8> {
    let mut png = std::io::Cursor::new(Vec::new());
    image.into().write_to(&mut png, ImageFormat::Png).unwrap();
    png.into_inner()
}

fn grey(width: u32, height: u32, value: impl Fn(u32, u32) -> u8) -> Vec<u8> {
    png(GrayImage::from_fn(width, height, |x, y| Luma([value(x, y)])))
}

/// A square from (0, 0) to (1, 1) with all of an image on it, of a material of these lines.
pub(super) const SQUARE: &[u8] = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3 4/4\n";

fn with_material(lines: &str, images: &[(&str, Vec<u8>)]) -> Scene {
    let library = format!("newmtl a\n{lines}");
    let files = [("a.obj", SQUARE), ("a.mtl", library.as_bytes())];
    let images: Vec<(&str, &[u8])> = images.iter().map(|(name, bytes)| (*name, &bytes[..])).collect();
    let scene = load_files(&[&files[..], &images].concat()).map_err(|(error, _)| error).unwrap();
    expect_sound(&scene);
    scene
}

/// Whether a place of the square is a hole.
fn is_hole(scene: &Scene, x: f32, y: f32) -> bool {
    let [triangle, material] = [if x > y { 0 } else { 1 }, 0];
    let t = &scene.triangles[triangle];
    let ray = crate::scene::surface::Ray::new(Vec3::new(x, y, 1.0), -Vec3::Z);
    crate::scene::bvh::is_hole(t, &scene.materials[material], &scene.textures, t.barycentric(ray))
}

#[test]
fn masks_leave_holes_below_a_half() {
    let colours = png(RgbImage::from_pixel(1, 1, Rgb([200, 100, 50])));
    // Clear on the left, and opaque on the right; in the alpha of an image that has one.
    let mask = grey(8, 2, |x, _| if x < 4 { 100 } else { 200 });
    let leaf = png(RgbaImage::from_fn(8, 2, |x, _| Rgba([200, 100, 50, if x < 4 { 100 } else { 200 }])));
    let images = [("c.png", colours), ("m.png", mask), ("leaf.png", leaf)];
    for lines in
        ["map_Kd c.png\nmap_d m.png\n", "map_d -imfchan l m.png\n", "map_Kd leaf.png\nmap_d leaf.png\n", "d 0\nmap_Kd gone.png\nmap_d m.png -imfchan r\n"]
    {
        let scene = with_material(lines, &images);
        assert_eq!([0.2, 0.4, 0.6, 0.8].map(|x| is_hole(&scene, x, 0.5)), [true, true, false, false], "{lines}");
        assert!(scene.notes[0].contains("alpha blending (`map_d`): what hides less than half is a hole"), "{:?}", scene.notes);
        if lines.starts_with("map_Kd") {
            let texture = &scene.textures[0];
            assert_eq!((texture.width, texture.height, texture.texels[0], texture.texels[7]), (8, 2, [200, 100, 50, 100], [200, 100, 50, 200]));
        }
    }
    // What is left of 200 by 0.6 is less than half, and by 0.7 more.
    assert!(is_hole(&with_material("d 0.6\nmap_d m.png\n", &images), 0.8, 0.5));
    assert!(!is_hole(&with_material("d 0.7\nmap_d m.png\n", &images), 0.8, 0.5));
    let scene = with_material("map_Kd c.png\nmap_d gone.png\n", &images);
    assert!(!is_hole(&scene, 0.2, 0.5) && scene.notes.iter().any(|note| note.contains("gone.png (missing)")), "{:?}", scene.notes);
}

#[test]
fn roughness_and_metal_become_one_image() {
    let images = [("r.png", grey(2, 1, |x, _| [51, 102][x as usize])), ("m.png", grey(2, 2, |_, y| [0, 255][y as usize]))];
    let scene = with_material("Kd 1 1 1\nPr 0\nPm 0.5\nmap_Pr r.png\nmap_Pm m.png\n", &images);
    let texture = &scene.textures[scene.materials[0].maps.facets.unwrap() as usize];
    assert!(texture.reading.is_linear && (texture.width, texture.height) == (2, 2));
    assert_eq!(texture.texels, [[255, 51, 0, 255], [255, 102, 0, 255], [255, 51, 255, 255], [255, 102, 255, 255]]);
    assert_eq!(scene.materials[0].glossy, Glossy::metallic_roughness(0.5, 1.0));
    // An alpha is that of a mask alone.
    let clear = with_material("map_Pr c.png\n", &[("c.png", png(RgbaImage::from_pixel(1, 1, Rgba([51, 51, 51, 9]))))]);
    assert_eq!(clear.textures[0].texels, [[255, 51, 255, 255]]);
    let plain = with_material("Pr 1\nmap_Pr r.png\n", &images);
    let lobe = seen_at(&plain, 0.25, 0.5, true).glossy.unwrap().lobe;
    assert_eq!(lobe.shape, crate::math::lobe::Shape::Microfacets { alpha: 0.2 * 0.2 });
    assert_eq!(plain.textures[0].texels[0], [255, 51, 255, 255]);
}

#[test]
fn a_map_of_highlights_multiplies_them() {
    let images = [("s.png", png(RgbImage::from_fn(2, 1, |x, _| Rgb([255, 0, 255 * x as u8]))))];
    let scene = with_material("Kd 0.1 0.1 0.1\nKs 0.5 0.4 0.3\nNs 10\nmap_Ks s.png\n", &images);
    assert_eq!(seen_at(&scene, 0.25, 0.5, true).glossy.unwrap().lobe.reflectance, Vec3::new(0.5, 0.0, 0.0));
    assert!(seen_at(&scene, 0.75, 0.5, true).glossy.unwrap().lobe.reflectance.distance(Vec3::new(0.5, 0.0, 0.3)) < 1e-6);
    let by_map = with_material("Kd 0.25 0.5 0\nmap_Ks s.png\n", &images);
    assert_eq!(by_map.materials[0].glossy, Some(Glossy::Phong { reflectance: Vec3::new(0.75, 0.5, 1.0), exponent: 0.0 }));
    let unread = with_material("Pr 0.5\nmap_Ks s.png\n", &images);
    assert!(unread.textures.is_empty() && unread.notes[0].contains("`map_Ks` of surfaces without a highlight"), "{:?}", unread.notes);
}

/// A ramp is a tilted plane: a byte a texel rises 10 of 255 over a texel, times `-bm`, in the units of a texel.
#[test]
fn heights_tilt_a_surface_as_they_rise() {
    type Ramp = fn(u32, u32) -> u8;
    let ramps: [(Ramp, Vec3); 4] = [
        (|x, _| 10 * x as u8, -Vec3::X),
        (|x, _| 200 - 10 * x as u8, Vec3::X),
        (|_, y| 10 * y as u8, Vec3::Y),
        (|x, y| (10 * x + 10 * y) as u8, Vec3::Y - Vec3::X),
    ];
    for (ramp, leaning) in ramps {
        for strength in [1.0, 25.5, -3.0] {
            let scene = with_material(&format!("bump -clamp on -bm {strength} h.png\n"), &[("h.png", grey(12, 12, ramp))]);
            assert_eq!(scene.textures[0].reading.wrap, [Wrap::Clamp; 2]);
            let expected = (Vec3::Z + leaning * strength * 10.0 / 255.0).normalize();
            // Half a step of a byte, of the steepest slope, where there is none.
            let step = 0.5 * strength.abs() * 10.0 / 255.0 / 127.5 + 1e-5;
            for [x, y] in [[0.3, 0.3], [0.5, 0.2], [0.2, 0.7], [0.8, 0.8]] {
                let normal = seen_at(&scene, x, y, false).normal;
                assert!(normal.distance(expected) < step, "{strength}: {normal} instead of {expected}");
            }
        }
    }
}

/// Between the last texel and the first of what repeats, there is a slope as between any others.
#[test]
fn heights_go_on_beyond_their_edges() {
    let images = [("h.png", grey(4, 1, |x, _| [0, 100, 200, 100][x as usize]))];
    let slopes = |option: &str| {
        let scene = with_material(&format!("bump {option} h.png\n"), &images);
        [0, 1, 2, 3].map(|at| {
            let normal = seen_at(&scene, (at as f32 + 0.5) / 4.0, 0.5, false).normal;
            (-normal.x / normal.z * 255.0).round()
        })
    };
    assert_eq!(slopes(""), [0.0, 100.0, 0.0, -100.0]);
    assert_eq!(slopes("-clamp on"), [50.0, 100.0, 0.0, -50.0]);
    assert!(with_material("bump flat.png\n", &[("flat.png", grey(4, 4, |_, _| 77))]).materials[0].maps.normal.is_none());
}

#[test]
fn normals_go_before_heights() {
    let normals = png(RgbImage::from_pixel(2, 2, Rgb([150, 128, 250])));
    let tilted = Vec3::new(45.0, 0.0, 245.0).normalize();
    let images = [("n.png", normals), ("h.png", grey(4, 4, |x, _| 10 * x as u8))];
    for lines in ["norm n.png\nbump h.png\n", "map_Bump h.png\nnorm n.png\n", "map_Bump -bm 1.0 n.png\n"] {
        let scene = with_material(lines, &images);
        let normal = seen_at(&scene, 0.6, 0.3, false).normal;
        assert!(scene.textures.len() == 1 && normal.distance(tilted) < 0.01, "{lines}: {normal}");
        let told = scene.notes.iter().any(|note| note.contains("have the colours of normals were taken as normals: n.png"));
        assert_eq!(told, lines.starts_with("map_Bump -bm"), "{:?}", scene.notes);
    }
}

#[test]
fn options_are_no_names() {
    let images = [("my map.png", grey(2, 2, |_, _| 255))];
    let told = |line: &str| {
        let scene = with_material(&format!("{line}\n"), &images);
        assert!(!scene.textures.is_empty(), "{line}: {:?}", scene.notes);
        scene.notes.into_iter().filter(|note| note.starts_with("not read")).collect::<Vec<_>>().join("\n")
    };
    for line in [
        "map_Kd my map.png",
        "map_Kd -o 0.5 0.1 -s 2 my map.png",
        "map_Kd -blendu on -blendv on -cc off -boost 0 -mm 0 1 -o 0 0 0 -s 1 1 1 -t 0 0 0 -texres 256 -clamp off my map.png",
        "map_Kd my map.png -s 1.0 1 -clamp on",
        "map_Kd -S 1 my map.png",
    ] {
        assert_eq!(told(line), "", "{line}");
    }
    for (line, option) in [
        ("map_Kd -cc on my map.png", "-cc"),
        ("map_Kd my map.png -mm 0.1 2", "-mm"),
        ("map_Kd -t 1 my map.png", "-t"),
        ("map_Kd -bm 2 my map.png", "-bm"),
        ("map_Kd -imfchan m my map.png", "-imfchan"),
        ("map_d -imfchan q my map.png", "-imfchan"),
        ("map_Kd -bm 1e7 my map.png", "-bm"),
    ] {
        assert!(told(line).contains(&format!("option `{option}` of `{}`", &line[..line.find(' ').unwrap()])), "{line}: {}", told(line));
    }
    let scene = with_material("map_Kd -unheard 3 of.png\n", &[("of.png", grey(1, 1, |_, _| 9))]);
    assert!(scene.textures.len() == 1 && scene.notes[0].contains("option `-unheard` of `map_Kd`"), "{:?}", scene.notes);
    for line in ["map_Kd", "map_Kd -s", "map_Kd -s 1 1 1", "bump -bm", "bump -bm -bm"] {
        assert!(with_material(&format!("{line}\n"), &[]).textures.is_empty(), "{line}");
    }
}

/// `-s` and `-o` are about coordinates whose second points up. Of a triangle without an area, and of a repeated one, nothing is left over.
#[test]
fn maps_are_scaled_and_moved() {
    let images = [("c.png", grey(4, 4, |x, y| (60 * x + 9 * y) as u8)), ("e.png", grey(4, 4, |x, y| (60 * y + 9 * x) as u8))];
    let object = String::from_utf8_lossy(SQUARE).replace("usemtl a", "usemtl a\nf 1/1 2/2 2/2\nf 1/1 2/2 3/3");
    let load_one = |options: [&str; 2]| {
        let library = format!("newmtl a\nKd 1 1 1\nmap_Kd {} c.png\nmap_Ke {} e.png\n", options[0], options[1]);
        let files: [(&str, &[u8]); 4] = [("a.obj", object.as_bytes()), ("a.mtl", library.as_bytes()), ("c.png", &images[0].1), ("e.png", &images[1].1)];
        load_files(&files).map_err(|(error, _)| error).unwrap()
    };
    let seen = |scene: &Scene, x: f32, y: f32| (seen_at(scene, x, y, false).reflectance.x, seen_at(scene, x, y, false).emission.x);
    let plain = load_one(["", ""]);
    assert!(plain.charts.is_empty());
    for (options, charts) in [(["-s 2 2 1 -o 0.25 0.5", ""], 1), (["", "-s 2 2 -o 0.25 0.5"], 1), (["-s 2 2 -o 0.25 0.5"; 2], 0)] {
        let scene = load_one(options);
        assert_eq!(scene.charts.len(), charts, "{options:?}");
        assert!(scene.charts.iter().all(|chart| chart.len() == scene.triangles.len()));
        // (0.15, 0.05) lies where (0.55, 0.6) lies without, (0.3, 0.2) where (0.85, 0.9) does.
        for ([x, y], there) in [([0.15, 0.05], [0.55, 0.6]), ([0.3, 0.2], [0.85, 0.9])] {
            let (here, moved, found) = (seen(&plain, x, y), seen(&plain, there[0], there[1]), seen(&scene, x, y));
            let expected = (if options[0].is_empty() { here.0 } else { moved.0 }, if options[1].is_empty() { here.1 } else { moved.1 });
            assert!((found.0 - expected.0).abs() < 1e-5 && (found.1 - expected.1).abs() < 1e-5, "{options:?}: {found:?} instead of {expected:?}");
        }
    }
}
