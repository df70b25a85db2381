//! The keys of what each command writes as JSON, and what stands at them: a reader may rely on both while `schema` stays what it is.
//!
//! `HEMISPLAT_UPDATE_GOLDEN=1 cargo test --test schemas` writes them anew. A key that goes, or holds another kind of value, needs another number of
//! `schema`; one that is added does not. Needs a GPU adapter, a software one will do.

mod place;

use libtest_mimic::Arguments;
use place::{Case, Outcome, Place, check};
use serde_json::Value;
use std::collections::BTreeMap;
use std::{env, fs};

const DRAWN: &[(&str, Case)] = &[
    ("render", || keeps("render", "render irradiance --scene cornell-glossy --size 16x12 -o a.exr --stats out.json")),
    ("compare", || keeps("compare", "compare environment irradiance --scene cornell --size 32x24 --runs 2 --reference-spp 4 --bounces all --json out.json")),
    ("compare_frames", || {
        keeps("compare_frames", "compare irradiance-temporal --scene cube --size 32x24 --frames 0..7 --fps 1 --runs 2 --reference-spp 4 --json out.json")
    }),
    ("sweep", || {
        keeps("sweep", "sweep irradiance --over tiles.resolution=4,8 --scene cornell --size 32x24 --reference-spp 4 --runs 2 -o kept --json out.json")
    }),
    ("sweep_frames", || {
        keeps(
            "sweep_frames",
            "sweep irradiance-temporal --over renewed.change=0.02,0.1 --scene cube --size 32x24 --frames 0..7 --fps 1 --reference-spp 4 --runs 2 -o kept --json out.json",
        )
    }),
    ("study", || keeps("study", "study small.ron -o kept --json out.json")),
    ("stability", || keeps("stability", "stability irradiance --only furnace --json out.json")),
];
const DRAWN_BY_HOST: &[(&str, Case)] = &[("diff", diff)];

const STUDY: &str = r#"Study(
    version: 1, about: "small", scene: "cornell", size: (32, 24), reference: Traced(spp: 4), runs: 2, metric: "rmse_over_mean",
    rows: [(name: "all", pipeline: "irradiance"), (name: "none", pipeline: "irradiance", set: { "records.gradients": false })],
    over: { "tiles.resolution": [4, 8] },
    expect: [(row: "all", at: { "tiles.resolution": 8 }, within: (0, 10), paper: 0.1)],
)"#;

fn main() {
    place::run(&Arguments::from_args(), DRAWN, DRAWN_BY_HOST);
}

fn diff() -> Outcome {
    let place = Place::new()?;
    place.succeed("reference --scene cornell --size 32x24 --spp 4 -o a.exr")?;
    place.succeed("reference --scene cornell --size 32x24 --spp 4 --seed 1 -o b.exr")?;
    place.succeed("diff a.exr b.exr --json out.json")?;
    expect("diff", &place.json("out.json")?)
}

fn keeps(name: &str, arguments: &str) -> Outcome {
    let place = Place::new()?;
    fs::write(place.0.path().join("small.ron"), STUDY)?;
    place.succeed(arguments)?;
    expect(name, &place.json("out.json")?)
}

/// Holds a file's keys against those that are kept.
fn expect(name: &str, json: &Value) -> Outcome {
    let mut found = BTreeMap::new();
    collect(json, "", &mut found);
    let path = format!("{}/tests/schemas/{name}.txt", env!("CARGO_MANIFEST_DIR"));
    if env::var_os("HEMISPLAT_UPDATE_GOLDEN").is_some() {
        let lines: String = found.iter().map(|(key, kind)| format!("{key} {kind}\n")).collect();
        fs::create_dir_all(format!("{}/tests/schemas", env!("CARGO_MANIFEST_DIR")))?;
        return Ok(fs::write(&path, lines)?);
    }
    let text = fs::read_to_string(&path)?;
    let kept: BTreeMap<String, String> = text.lines().filter_map(|line| line.rsplit_once(' ')).map(|(key, kind)| (key.to_owned(), kind.to_owned())).collect();
    let differences = differences(&kept, &found);
    check(differences.is_empty(), || format!("{path}:\n{}", differences.join("\n")))
}

/// The kind of value at each key: of all elements of a list at one, null only where nothing else stands there.
fn collect(value: &Value, key: &str, kinds: &mut BTreeMap<String, String>) {
    let kind = match value {
        Value::Null => "null",
        Value::Bool(_) => "bool",
        Value::Number(_) => "number",
        Value::String(_) => "string",
        Value::Array(_) => "list",
        Value::Object(_) => "object",
    };
    let known = kinds.entry(if key.is_empty() { ".".to_owned() } else { key.to_owned() }).or_insert_with(|| kind.to_owned());
    if known == "null" {
        *known = kind.to_owned();
    } else if known != kind && kind != "null" {
        *known = format!("{known}|{kind}");
    }
    match value {
        Value::Array(items) => items.iter().for_each(|item| collect(item, &format!("{key}[]"), kinds)),
        Value::Object(items) => items.iter().for_each(|(name, item)| collect(item, &format!("{key}.{}", name.replace(' ', "_")), kinds)),
        _ => {}
    }
}

/// What went, came or changed. What a machine cannot measure is null on it, with nothing below; chance decides what a list of few runs can tell.
fn differences(kept: &BTreeMap<String, String>, found: &BTreeMap<String, String>) -> Vec<String> {
    let is_open = |all: &BTreeMap<String, String>, key: &str| {
        let above = key.char_indices().filter(|(at, sign)| *at > 0 && matches!(sign, '.' | '[')).map(|(at, _)| &key[..at]);
        above.into_iter().any(|above| all.get(above).is_some_and(|kind| kind == "null" || kind == "list" && !all.contains_key(&format!("{above}[]"))))
    };
    let gone = kept.iter().filter(|(key, _)| !found.contains_key(*key) && !is_open(found, key)).map(|(key, kind)| format!("gone: {key} {kind}"));
    let new = found.iter().filter(|(key, _)| !kept.contains_key(*key) && !is_open(kept, key)).map(|(key, kind)| format!("new: {key} {kind}"));
    let changed = found.iter().filter_map(|(key, kind)| {
        let before = kept.get(key).filter(|before| *before != kind && *before != "null" && kind != "null")?;
        Some(format!("changed: {key} from {before} to {kind}"))
    });
    gone.chain(new).chain(changed).collect()
}
