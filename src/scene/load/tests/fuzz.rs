//! Damaged files: loading answers with a sound scene or an error, and never panics.

use super::*;
use crate::scene::stage::Stage;
use rayon::prelude::*;
use std::{panic::catch_unwind, time::Instant};

/// Every feature of a document, small.
const DOCUMENT: &str = r#"Scene(version: 1, about: "all of it", source: "here", geometry: [
    Generate(Hall(triangles: 2000)), Box(min: (0, 0, 0), max: (1, 1, 1), material: "red"),
    Place(of: [Sphere(centre: (0, 0, 0), radius: 1, subdivisions: 1)], scale: (1, 2, -1), rotate: (axis: (0, 1, 0), degrees: 20), translate: (5, 0, 0)),
    Place(of: [Box(min: (0, 0, 0), max: (1, 1, 1), material: "red")], rotate: (axis: (0, 1, 0), degrees: Smooth([(0, 0), (1, 90), (2, 30)])), translate: Linear([(0, (0, 0, 0)), (1, (1, 2, 0))])),
    Quad(corners: ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)), material: "lamp"), Teapot(centre: (3, 0, 0), scale: 0.5, detail: 2, material: "red"),
    Triangles(positions: [(0, 0, 0), (1, 0, 0), (0, 1, 0)], indices: [(0, 1, 2)], material: "shiny"),
    ], materials: { "*": Diffuse(reflectance: (0.7, 0.7, 0.7)), "red": Ward(reflectance: (0.5, 0, 0), specular: (0.1, 0.1, 0.1), alpha: (0.1, 0.2)),
    "lamp": Emitter(radiance: (5, 5, 5)), "shiny": Phong(reflectance: (0.2, 0.2, 0.2), specular: (0.3, 0.3, 0.3), exponent: 20) },
    normals: Smooth(degrees: 40), environment: Constant((0.1, 0.2, 0.3)),
    lights: [Point(position: (2, 2, 2), intensity: (9, 9, 9)), Spot(position: (2, 3, 2), direction: (0, -1, 0), intensity: (9, 9, 9), inner: 10, outer: 20, shadows: false),
    Directional(direction: (0, -1, 0.1), irradiance: (1, 1, 1))],
    cameras: { "main": (eye: (3, 3, 3), direction: (-1, -1, -1), up: (0, 1, 0), fov: 60, size: (64, 64)) })"#;

const OBJECT: &str = "mtllib a.mtl\no a\nv 0 0 0\nv 1 0 0 0.5 0.2 1\nv 1 1 0\nv 0 1 0.5\nvt 0 1\nvt 0.5 0.25\nvn 0 0 1\nusemtl red\nf 1/1/1 2/2/1 3//1 -1\nf 1 2 4\ns 1\nf 1 2 4 3\nl 1 2\nusemtl blue\nf 1/1 2/2 4/1\nusemtl metal\nf 1/1 2/2 3/1\n";
const LIBRARY: &str = "newmtl red\nKd 0.5 0.1 0.1\nKs 0.1 0.1 0.1\nNs 20\nillum 2\nKe 1 1 1\nmap_Kd gone.png\nd 0.5\nbump b.png\nPr 0.4\nPm 0.5\nmap_Ke a.png\nnorm -bm 2 b.png\n\
    newmtl blue\nKd 0.1 0.1 0.5\nKs 0.2 0.2 0.2\nmap_Kd -o 0.5 0.1 a.png\nmap_d -imfchan m b.png -s 2 2 1\nmap_Ks a.png\nmap_bump -bm 3 -clamp on a.png\n\
    newmtl metal\nmap_Pr -mm 0 1 b.png\nmap_Pm a.png\nd 0.7\nmap_d b.png\n";

/// A linear congruential generator: the same tries on every machine.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % limit.max(1)
    }

    /// A few random changes: flipped bits, tokens dropped, doubled or swapped for numbers that break things, and cuts.
    fn damaged(&mut self, bytes: &[u8]) -> Vec<u8> {
        const NUMBERS: [&str; 8] = ["NaN", "1e39", "-1", "0", "1e-40", "4294967296", "-inf", "18446744073709551615"];
        let mut bytes = bytes.to_vec();
        for _ in 0..=self.below(3) {
            let at = self.below(bytes.len());
            let token = token_at(&bytes, at);
            match self.below(6) {
                0 if !bytes.is_empty() => bytes[at] ^= 1 << self.below(8),
                1 => drop(bytes.drain(token)),
                2 => {
                    let copy = bytes[token.clone()].to_vec();
                    drop(bytes.splice(token.start..token.start, copy));
                }
                3 | 4 => drop(bytes.splice(token, NUMBERS[self.below(NUMBERS.len())].bytes())),
                _ if self.below(8) == 0 => bytes.truncate(at),
                _ => {}
            }
        }
        bytes
    }
}

/// The run of letters and digits around a place, or the single byte there.
fn token_at(bytes: &[u8], at: usize) -> std::ops::Range<usize> {
    let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || b"._-+".contains(byte);
    let start = at - bytes[..at].iter().rev().take_while(|byte| is_word(byte)).count();
    let length = bytes[at..].iter().take_while(|byte| is_word(byte)).count();
    start..(at + length.max(1)).min(bytes.len())
}

/// Loads one damaged file; whether a scene came of it.
fn survive(name: &str, files: &[(&str, &[u8])]) -> bool {
    let start = Instant::now();
    let told = || String::from_utf8_lossy(files[0].1).into_owned();
    let outcome = catch_unwind(|| match load_files(files) {
        Ok(scene) => {
            expect_sound(&scene);
            // Of millions of triangles a hierarchy takes long.
            if !scene.animation.is_empty() && scene.triangles.len() < 10_000 {
                expect_to_move(scene);
            }
            true
        }
        Err((error, _)) => {
            assert!(!error.to_string().is_empty());
            false
        }
    });
    // Damage may ask for millions of triangles with smooth normals.
    assert!(start.elapsed().as_secs() < 60, "{name} took {:?}:\n{}", start.elapsed(), told());
    outcome.unwrap_or_else(|_| panic!("{name} broke the loader:\n{}", told()))
}

/// Whenever it is looked at, it is finite, or the change is refused.
fn expect_to_move(scene: Scene) {
    let Ok(mut stage) = Stage::animated(scene) else { return };
    let animation = stage.scene.animation.clone();
    for time in [0.3, 1.0, 1e9, -5.0] {
        let moment = animation.at(time);
        let _ = stage.change(&stage.changes_to(&moment));
        assert!(stage.scene.triangles.iter().all(|triangle| triangle.positions.iter().chain(&triangle.normals).all(|vector| vector.is_finite())));
        assert!(stage.scene.materials.iter().all(|material| material.emission.is_finite()));
        assert!(stage.scene.lights.iter().all(|light| light.kind.intensity().is_finite()));
        for camera in &stage.scene.cameras {
            let camera = moment.camera(&stage.scene, camera);
            assert!((camera.direction.length() - 1.0).abs() < 1e-4 && camera.direction.dot(camera.up).abs() < 1e-4, "{camera:?}");
        }
    }
}

/// Most bytes that the process has held, where the system tells.
fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib << 10)
}

/// Tries of each kind of file, where `HEMISPLAT_TRIES` does not say how many.
const TRIES: u64 = 2_000;

fn tries() -> u64 {
    std::env::var("HEMISPLAT_TRIES").map_or(TRIES, |tries| tries.parse().expect("HEMISPLAT_TRIES is a number"))
}

/// Each kind has to load at times and to fail at times, or the damage is total or harmless.
fn expect_survival(name: &str, try_one: impl Fn(&mut Random) -> bool + Sync) {
    let tries = tries();
    let loaded = (0..tries).into_par_iter().filter(|&seed| try_one(&mut Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15)))).count() as u64;
    assert!((tries / 50..tries * 19 / 20).contains(&loaded), "{loaded} of {tries} tries of {name} were loaded");
    // The files are small: a count read from one must not become memory.
    assert!(peak_bytes().is_none_or(|peak| peak < 3 << 30), "{name}: {:?} bytes", peak_bytes());
}

#[test]
fn damaged_documents_never_panic() {
    expect_survival("a document", |random| survive("a document", &[("a.ron", &random.damaged(DOCUMENT.as_bytes()))]));
}

#[test]
fn damaged_objects_never_panic() {
    let [small, large] = [super::maps::png(2, 2, |x, y| [200, 90 * x as u8, 99 * y as u8]), super::maps::png(3, 1, |x, _| [80 * x as u8; 3])];
    expect_survival("an object", |random| {
        let (object, library) = (random.damaged(OBJECT.as_bytes()), random.damaged(LIBRARY.as_bytes()));
        survive("an object", &[("a.obj", &object), ("a.mtl", &library), ("a.png", &small), ("b.png", &large)])
    });
}

#[test]
fn damaged_gltf_never_panics() {
    let binary = super::gltf::complete().finish();
    // Mostly the text part, whose numbers are those that can lead astray.
    expect_survival("a glTF text", |random| survive("a glTF text", &[("a.glb", &[&binary[..20], &random.damaged(&binary[20..])].concat())]));
    expect_survival("a glTF file", |random| survive("a glTF file", &[("a.glb", &random.damaged(&binary))]));
    for (what, file) in [
        ("maps", super::maps::mapped()),
        ("charts", super::maps::charted()),
        ("instances", super::gltf::instanced()),
        ("animations", super::animation::moving_file()),
        ("skins", super::deform::bar()),
        ("morph targets", super::deform::quad()),
    ] {
        let (what, file) = (format!("a glTF text with {what}"), file.finish());
        expect_survival(&what, |random| survive(&what, &[("a.glb", &[&file[..20], &random.damaged(&file[20..])].concat())]));
    }
    let (text, buffer) = super::gltf::complete().finish_as_text("b.bin");
    expect_survival("a glTF document", |random| survive("a glTF document", &[("a.gltf", &random.damaged(text.as_bytes())), ("b.bin", &buffer)]));
}

#[test]
fn damaged_scans_never_panic() {
    for file in super::ply::all_encodings() {
        expect_survival("a scan", |random| survive("a scan", &[("a.ply", &random.damaged(&file))]));
    }
}

#[test]
fn damaged_skies_never_panic() {
    let sky = super::sky::exr(4, 2, |x, y| [x as f32, y as f32, 0.5]);
    expect_survival("a sky", |random| survive("a sky", &[("a.ron", super::sky::DOCUMENT.as_bytes()), ("sky.exr", &random.damaged(&sky))]));
}
