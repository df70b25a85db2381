//! Images: skies and textures, and their limits.

use super::*;
use crate::scene::{Environment, load::Problem};
use glam::Vec3;
use std::io::Cursor;

pub(super) const DOCUMENT: &str = r#"Scene(version: 1, geometry: [Box(min: (0, 0, 0), max: (1, 1, 1))], materials: { "*": Diffuse(reflectance: (0, 0, 0)) },
    environment: LatLong(file: "sky.exr", scale: 2))"#;

/// An OpenEXR file of linear red, green, blue.
pub(super) fn exr(width: usize, height: usize, texel: impl Fn(usize, usize) -> [f32; 3] + Sync) -> Vec<u8> {
    use exr::prelude::*;
    let channels = SpecificChannels::rgb(|at: Vec2<usize>| {
        let [r, g, b] = texel(at.x(), at.y());
        (r, g, b)
    });
    let mut bytes = Cursor::new(Vec::new());
    Image::from_channels((width, height), channels).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

fn load_sky(document: &str, name: &str, sky: &[u8]) -> Result<Environment, SceneError> {
    load_files(&[("scene.ron", document.as_bytes()), (name, sky)]).map(|scene| scene.environment).map_err(|(error, _)| error)
}

#[test]
fn skies_are_scaled_and_turned() {
    let sky = exr(4, 2, |x, y| [1.0 + x as f32, y as f32, 0.25]);
    let plain = load_sky(DOCUMENT, "sky.exr", &sky).unwrap();
    let Environment::LatLong { width: 4, height: 2, texels } = &plain else { panic!("{plain:?}") };
    assert_eq!((texels[1], texels[6]), (Vec3::new(4.0, 0.0, 0.5), Vec3::new(6.0, 2.0, 0.5)));
    for (degrees, seen) in [("90", Vec3::X), ("-90", -Vec3::X), ("180", Vec3::Z), ("360", -Vec3::Z)] {
        let turned = load_sky(&DOCUMENT.replace("scale: 2", &format!("scale: 2, rotation: {degrees}")), "sky.exr", &sky).unwrap();
        assert!(turned.radiance(seen).distance(plain.radiance(-Vec3::Z)) < 1e-5, "{degrees}");
    }
}

fn made_sky(environment: &str) -> Result<Environment, SceneError> {
    load_text(&DOCUMENT.replace(r#"LatLong(file: "sky.exr", scale: 2)"#, environment)).map(|scene| scene.environment)
}

#[test]
fn skies_made_by_rule_take_their_parameters() {
    let plain = made_sky("Clear(sun: (azimuth: 90, elevation: 30))").unwrap();
    assert!(made_sky("Clear(sun: (azimuth: 90, elevation: 30), turbidity: 3, scale: 0.1)").unwrap() == plain);
    let towards_sun = Vec3::new(0.75_f32.sqrt(), 0.5, 0.0);
    assert!(plain.radiance(towards_sun).cmpgt(2.0 * plain.radiance(towards_sun.with_x(-towards_sun.x))).all());
    let brighter = made_sky("Clear(sun: (azimuth: 90, elevation: 30), scale: 0.4)").unwrap();
    assert!((brighter.radiance(Vec3::X) / plain.radiance(Vec3::X) - 4.0).abs().max_element() < 1e-4);
    let overcast = made_sky("Overcast(zenith: (9, 9, 9), ground: (0, 0.5, 1))").unwrap();
    assert!((overcast.radiance(-Vec3::Y) - Vec3::new(0.0, 3.5, 7.0)).abs().max_element() < 1e-3);
}

#[test]
fn skies_that_cannot_be_are_refused() {
    let wrong = [
        ("Clear(sun: (azimuth: 0, elevation: -1))", Problem::Range),
        ("Clear(sun: (azimuth: 0, elevation: 91))", Problem::Range),
        ("Clear(sun: (azimuth: NaN, elevation: 9))", Problem::NonFinite),
        ("Clear(sun: (azimuth: 0, elevation: 9), turbidity: 1.9)", Problem::Range),
        ("Clear(sun: (azimuth: 0, elevation: 9), turbidity: 10.1)", Problem::Range),
        ("Clear(sun: (azimuth: 0, elevation: 9), scale: -1)", Problem::Range),
        ("Clear(sun: (azimuth: 0, elevation: 9), scale: 1e38)", Problem::Range),
        ("Clear(sun: (azimuth: 0, elevation: 9), ground: (0, 0, 1.1))", Problem::Range),
        ("Clear(sun: (azimuth: 0))", Problem::Format),
        ("Clear(sun: (azimuth: 0, elevation: 9), haze: 3)", Problem::UnknownKey),
        ("Overcast(zenith: (-1, 0, 0))", Problem::Range),
        ("Overcast()", Problem::Format),
    ];
    for (environment, problem) in wrong {
        assert_eq!(made_sky(environment).unwrap_err().problem(), problem, "{environment}");
    }
}

#[test]
fn radiance_files_are_read() {
    let mut bytes = Vec::new();
    image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&[image::Rgb([1.0, 2.0, 4.0]); 8], 4, 2).unwrap();
    // Mitsuba signs such files as `RGBE`, others in other ways.
    let signed = |name: &[u8]| [b"#?", name, bytes.strip_prefix(b"#?RADIANCE").unwrap()].concat();
    for bytes in [signed(b"RADIANCE"), signed(b"RGBE"), signed(b"AUTOPANO")] {
        let sky = load_sky(&DOCUMENT.replace("sky.exr", "sky.hdr"), "sky.hdr", &bytes).unwrap();
        assert_eq!(sky.radiance(Vec3::X), Vec3::new(2.0, 4.0, 8.0));
    }
}

/// The file with another size in its header, and no more pixels than before.
fn stating(mut exr: Vec<u8>, width: i32, height: i32) -> Vec<u8> {
    let name = b"dataWindow\0box2i\0";
    let window = exr.windows(name.len()).position(|bytes| bytes == name).unwrap() + name.len() + 4;
    exr[window..window + 16].copy_from_slice(&[0, 0, width - 1, height - 1].map(i32::to_le_bytes).concat());
    exr
}

#[test]
fn broken_skies_are_refused() {
    let problem = |sky: &[u8]| load_sky(DOCUMENT, "sky.exr", sky).unwrap_err().problem();
    assert_eq!(problem(b"no image"), Problem::Format);
    assert_eq!(problem(&exr(2, 1, |_, _| [-1.0, 0.0, 0.0])), Problem::Range);
    assert_eq!(problem(&exr(2, 1, |_, _| [f32::NAN, 0.0, 0.0])), Problem::Range);
    assert_eq!(problem(&exr(16385, 1, |_, _| [0.0; 3])), Problem::TooLarge);
    assert_eq!(problem(&stating(exr(4, 2, |_, _| [0.0; 3]), 16384, 8192)), Problem::TooLarge);
    assert_eq!(load_sky(DOCUMENT, "sky.png", &[]).unwrap_err().problem(), Problem::NotFound);
}

#[test]
fn textures_beyond_the_limits_are_refused_by_their_header() {
    let library = b"newmtl a\nmap_Kd a.bmp\n";
    let object = b"mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let load_bitmap = |width: u32, height: u32| {
        let mut bitmap = b"BM\0\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0".to_vec();
        bitmap.extend([width.to_le_bytes(), height.to_le_bytes(), [1, 0, 24, 0]].concat());
        bitmap.extend([0; 24]);
        load_files(&[("a.obj", object), ("a.mtl", library), ("a.bmp", &bitmap)])
    };
    assert_eq!(load_bitmap(20000, 10).unwrap_err().0.problem(), Problem::TooLarge);
    assert_eq!(load_bitmap(16384, 16385).unwrap_err().0.problem(), Problem::TooLarge);
    // Within the limits, but without its pixels.
    let notes = load_bitmap(10, 10).unwrap().notes;
    assert!(notes.iter().any(|note| note.contains("a.bmp (its pixels are broken)")), "{notes:?}");
}
