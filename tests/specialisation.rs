//! What a scene does not need is not planned, unless the pipeline says so. Needs no device; that pictures stay the same, the golden ones tell.

use hemisplat::{
    contract::encoder::Setting,
    gpu::{scene::kind, spirv},
    passes::REGISTRY,
    pipeline::{Pipeline, Plan, Problems, load, plan},
    scene::{load as scenes, needs::Needs},
    schedule::Command,
};
use std::collections::BTreeSet;
use std::io;
use std::path::Path;

/// Reads `test.ron` with this text, and what ships.
fn loaded(name: &str, text: &str) -> Result<Pipeline, Problems> {
    load(name, &[], REGISTRY, &mut |path| if path == Path::new("test.ron") { Ok(text.to_owned()) } else { Err(io::ErrorKind::NotFound.into()) })
}

fn planned(pipeline: &str, scene: &str) -> std::sync::Arc<Plan> {
    let scene = scenes::load(Path::new(scene), &scenes::LoadOptions::default()).unwrap();
    let needs = Needs::of(&scene);
    let setting = Setting { scene: &scene, needs: &needs, device: hemisplat::schedule::Device::ABLE, size: [64, 48], tables: None };
    plan(&loaded(pipeline, "").unwrap(), setting, &[], &kind).unwrap()
}

/// Shader, imports and constants of every program but those that draw shadow maps, of which there are as many as lights have faces.
fn programs(plan: &Plan) -> BTreeSet<String> {
    let commands = plan.schedule.nodes().into_iter().flat_map(|node| &node.commands);
    let programs = commands.filter_map(|command| match command {
        Command::Compute(compute) => Some(&compute.program),
        Command::Raster(raster) => Some(&raster.program),
        _ => None,
    });
    let programs = programs.filter(|program| program.shader != "shadow_map");
    programs.map(|program| format!("{} {:?} {:?}", program.shader, program.imports, program.constants)).collect()
}

/// A lamp and no light that casts shadows; all surfaces emit; a point light; two of them.
const SCENES: [&str; 4] = ["cornell", "furnace", "corner", "hall"];

#[test]
fn nothing_is_left_out_for_a_scene() {
    for scene in SCENES {
        let plan = planned("irradiance-general", scene);
        assert!(plan.dropped.is_empty() && !plan.specialised, "{scene}: {:?}", plan.dropped);
    }
}

/// What a scene's needs decide, as shaders call it. The scenes above lack some of it.
const DECIDED: [&str; 13] = [
    "TEXTURES",
    "MIPMAPS",
    "NORMAL_MAPS",
    "TINTS",
    "ALPHA_MASKS",
    "ONE_SIDED",
    "SMOOTH",
    "GLOSSY",
    "ANISOTROPIC",
    "LIGHTS",
    "AREA_SAMPLES",
    "SKY_SAMPLES",
    "SKY_IMAGE",
];

#[test]
fn programs_are_the_same_for_every_scene() {
    let of_scenes = |pipeline: &str| SCENES.map(|scene| programs(&planned(pipeline, scene)));
    let (general, special) = (of_scenes("irradiance-general"), of_scenes("irradiance"));
    assert!(!general[0].is_empty() && general.iter().all(|other| *other == general[0]), "{general:#?}");
    let is_off = |programs: &BTreeSet<String>, name: &str| programs.iter().any(|program| program.contains(&format!("(\"{name}\", 0.0)")));
    assert!(DECIDED.iter().all(|name| !is_off(&general[0], name) && special.iter().any(|programs| is_off(programs, name))), "{special:#?}");
    assert!(special[1..].iter().any(|other| *other != special[0]), "{special:#?}");
}

#[test]
fn a_scene_that_needs_little_has_less_to_hold() {
    let sizes = |pipeline: &str| {
        let plan = planned(pipeline, "cornell");
        let shaders: u64 = spirv::sizes(&plan.schedule).unwrap().iter().map(|size| size.bytes).sum();
        [plan.memory().total(), shaders]
    };
    let (special, general) = (sizes("irradiance"), sizes("irradiance-general"));
    assert!(special[0] < general[0] && special[1] < general[1], "{special:?} {general:?}");
}

#[test]
fn explain_tells_the_sizes_of_shaders() {
    let sets = ["tiles.place=Device", "splats.place=Device", "misses.place=Device", "added.place=Device"];
    let arguments: Vec<&str> =
        ["explain", "irradiance-general", "--scene", "cornell"].into_iter().chain(sets.into_iter().flat_map(|set| ["--set", set])).collect();
    let output = assert_cmd::Command::new(env!("CARGO_BIN_EXE_hemisplat")).args(arguments).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("not specialised: ") && !text.contains("\ndropped "), "{text}");
    let lines = text.lines().skip_while(|line| !line.starts_with("shaders "));
    let sizes: Vec<u64> = lines.filter_map(|line| line.split_whitespace().find_map(|word| word.parse().ok())).collect();
    let [total, each @ ..] = &sizes[..] else { panic!("{text}") };
    assert!(each.len() > 10 && *total == each.iter().sum::<u64>() && each.iter().all(|bytes| *bytes > 500), "{text}");
    assert!(text.contains("hemisphere_tiles/ray_cast:trace_") && text.contains("gbuffer:fragment"), "{text}");
}

fn variant(of: &str, key: &str) -> String {
    format!("Variant(version: 1, about: \"a variant\", of: \"{of}\", {key})")
}

#[test]
fn a_variant_inherits_it_and_can_change_it() {
    let cases = [
        ("irradiance", "", true),
        ("irradiance", "specialise: false", false),
        ("irradiance-general", "", false),
        ("irradiance-general", "specialise: true", true),
    ];
    for (of, key, expected) in cases {
        let pipeline = loaded("test.ron", &variant(of, key)).unwrap();
        let again = loaded("test.ron", &pipeline.to_ron()).unwrap();
        assert_eq!([pipeline.specialise, again.specialise], [expected; 2], "{of} {key}");
    }
}

#[test]
fn anything_but_true_or_false_is_refused() {
    let Err(Problems(problems)) = loaded("test.ron", &variant("irradiance", "specialise: 0")) else { panic!("0 is taken") };
    assert_eq!(problems.len(), 1);
    assert_eq!((problems[0].code, problems[0].to_string().as_str()), ("document::wrong_type", "expected true or false, got the number 0"));
}
