//! Scenes as files: those that ship, and the large ones that are looked for in `HEMISPLAT_SCENES`.

mod skips;

use hemisplat::scene::{
    LightKind, Scene,
    load::{LoadOptions, embedded_scenes, load},
    needs::Needs,
};
use libtest_mimic::Arguments;
use skips::{Missing, holds};
use std::{path::Path, process::Command, time::Instant};

/// Scenes whose geometry is not part of the project.
const FOREIGN: [&str; 2] = ["sibenik.ron", "sponza.ron"];

fn main() {
    let trials = vec![
        holds("scenes_that_ship_load_without_notes", None, scenes_that_ship_load_without_notes),
        holds("shipped_scenes_are_found_by_three_names", None, shipped_scenes_are_found_by_three_names),
        holds("hall_and_castle_grow_on_request", None, hall_and_castle_grow_on_request),
        holds("suns_stand_where_their_skies_have_them", None, suns_stand_where_their_skies_have_them),
        holds(FOREIGN_LOAD, Missing::scenes().as_ref(), foreign_scenes_load_as_they_are),
        holds("what_is_missing_is_counted_named_and_may_be_required", None, what_is_missing_is_counted_named_and_may_be_required),
    ];
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

const FOREIGN_LOAD: &str = "foreign_scenes_load_as_they_are";

/// This very test, where no scenes are to be found.
fn what_is_missing_is_counted_named_and_may_be_required() {
    let run = |required: &str| {
        let mut again = Command::new(std::env::current_exe().unwrap());
        again.args(["--exact", FOREIGN_LOAD]).env_remove("HEMISPLAT_SCENES").env("HEMISPLAT_REQUIRE", required);
        let output = again.output().unwrap();
        (output.status.success(), String::from_utf8(output.stdout).unwrap())
    };
    let (passes, told) = run("gpu");
    assert!(passes && told.contains(" 0 passed; 0 failed; 1 ignored;"), "{told}");
    assert!(told.contains(&format!("SKIPPED: {FOREIGN_LOAD}: HEMISPLAT_SCENES is not set [scenes]\n")), "{told}");
    let (passes, told) = run("gpu, scenes");
    assert!(!passes && told.contains(" 0 passed; 1 failed; 0 ignored;") && !told.contains("SKIPPED"), "{told}");
}

fn load_with(name: &str, options: &LoadOptions) -> Scene {
    load(Path::new(name), options).unwrap_or_else(|error| panic!("{:?}", miette::Report::new(error)))
}

fn scenes_that_ship_load_without_notes() {
    for name in embedded_scenes().filter(|name| !FOREIGN.contains(name)) {
        let scene = load_with(name, &LoadOptions::default());
        assert!(scene.notes.is_empty(), "{name}: {:?}", scene.notes);
        assert_eq!(scene.cameras[0].name, "main", "{name}");
    }
}

fn shipped_scenes_are_found_by_three_names() {
    for name in ["cornell", "cornell.ron", "scenes/cornell.ron"] {
        let scene = load_with(name, &LoadOptions::default());
        assert_eq!((scene.name.as_str(), scene.triangles.len()), ("cornell", 38), "{name}");
        let needs = Needs::of(&scene);
        assert_eq!((needs.emissive_triangles, needs.punctual_lights, needs.one_sided), (2, Some(0), false));
    }
}

fn hall_and_castle_grow_on_request() {
    for (name, asked) in [("hall", 1000_u32), ("hall", 30_000), ("hall", 1_000_000), ("castle", 10_000), ("castle", 200_000), ("castle", 1_000_000)] {
        let options = LoadOptions { overrides: vec![("triangles".into(), asked.to_string())], ..LoadOptions::default() };
        let scene = load_with(name, &options);
        let off = scene.triangles.len() as f64 / f64::from(asked) - 1.0;
        assert!(off.abs() < 0.05, "{name}: asked for {asked}, got {}", scene.triangles.len());
        assert!(scene.notes.is_empty(), "{name}: {:?}", scene.notes);
    }
}

fn suns_stand_where_their_skies_have_them() {
    let scene = load_with("castle", &LoadOptions::default());
    let LightKind::Directional { direction, .. } = scene.lights[0].kind else { panic!("{:?}", scene.lights) };
    let next_to_it = scene.environment.radiance(-direction);
    for aside in [glam::Vec3::X, glam::Vec3::Z] {
        assert!(scene.environment.radiance((-direction + 0.2 * aside).normalize()).cmplt(next_to_it).all());
        assert!(scene.environment.radiance((-direction - 0.2 * aside).normalize()).cmplt(next_to_it).all());
    }
}

fn foreign_scenes_load_as_they_are() {
    let options = LoadOptions::default().with_environment();
    // File, triangles in it, triangles left: the files hold some without area and some twice.
    let files = [
        ("sibenik.ron", 73_564, 73_404),
        ("sponza.ron", 66_454, 66_443),
        ("cornell-mcguire/CornellBox-Original.obj", 36, 32),
        ("cornell-mcguire/CornellBox-Sphere.obj", 2188, 2188),
    ];
    for (name, in_file, left) in files {
        let start = Instant::now();
        let scene = load_with(name, &options);
        eprintln!("{name}: {} of {in_file} triangles in {:?}; {:?}", scene.triangles.len(), start.elapsed(), scene.notes);
        assert_eq!(scene.triangles.len(), left, "{name}");
    }
}
