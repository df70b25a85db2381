//! Pipelines without a device: what is refused and how it reads, what is kept, how plans come out.

use hemisplat::contract::encoder::Setting;
use hemisplat::contract::*;
use hemisplat::passes::REGISTRY;
use hemisplat::pipeline::{Format, Loop, Pipeline, Plan, Problems, embedded, embedded::EMBEDDED, export, load, plan};
use hemisplat::scene::{Camera, FieldOfView, Light, LightKind, Material, Scene, Triangle, load as scenes, needs::Needs};
use hemisplat::schedule::*;
use miette::{GraphicalReportHandler, GraphicalTheme};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

// Passes that only have what these tests need.

struct Mock {
    description: Description,
    needs_shadows: bool,
}

const fn parameter(name: &'static str, about: &'static str, unit: &'static str, kind: ParameterKind) -> Parameter {
    Parameter { name, about, unit, kind }
}

const fn input(name: &'static str, accepts: PortKind, required: bool) -> Input {
    let takes = if required { Takes::One } else { Takes::AtMostOne };
    Input { name, about: accepts_about(accepts), accepts, takes, changes: false }
}

const fn accepts_about(kind: PortKind) -> &'static str {
    match kind {
        PortKind::Image => "a picture",
        PortKind::Requests => "where records are wanted",
        _ => "what it works on",
    }
}

const fn output(name: &'static str, kind: PortKind) -> Output {
    Output { name, about: "what it makes", kind }
}

const fn mock(name: &'static str, parameters: &'static [Parameter], inputs: &'static [Input], outputs: &'static [Output]) -> Mock {
    Mock { description: Description { name, about: "a pass of the tests", source: "none", parameters, inputs, outputs }, needs_shadows: false }
}

static SURFACES: Mock = mock("Surfaces", &[], &[], &[output("image", PortKind::Image), output("normal", PortKind::Image)]);
static SHADOWS: Mock = Mock {
    needs_shadows: true,
    ..mock(
        "Shadows",
        &[parameter("taps", "lookups a pixel", "", ParameterKind::Integer { default: 16, min: 1, max: 25 })],
        &[],
        &[output("maps", PortKind::ShadowMaps)],
    )
};
static LIT: Mock =
    mock("Lit", &[], &[input("surfaces", PortKind::Image, true), input("shadow", PortKind::ShadowMaps, false)], &[output("image", PortKind::Image)]);
static SHADOW_VIEW: Mock = mock("ShadowView", &[], &[input("of", PortKind::ShadowMaps, true)], &[output("image", PortKind::Image)]);
static SEEK: Mock = mock(
    "Seek",
    &[],
    &[input("in", PortKind::Image, true), input("before", PortKind::Image, false)],
    &[output("requests", PortKind::Requests), output("none", PortKind::Flag)],
);
static GATHER: Mock = mock(
    "Gather",
    &[
        parameter(
            "shape",
            "how directions are laid out",
            "",
            ParameterKind::Choice {
                choices: &[
                    Choice {
                        name: "Plane",
                        about: "one raster",
                        parameters: &[parameter("fov", "opening angle", "degrees", ParameterKind::Float { default: 126.87, min: 10.0, max: 175.0 })],
                    },
                    Choice { name: "Hemicube", about: "five rasters", parameters: &[] },
                ],
            },
        ),
        parameter("resolution", "edge of a tile", "samples", ParameterKind::Integer { default: 64, min: 4, max: 512 }),
        parameter("gradients", "also the gradients", "", ParameterKind::Bool { default: true }),
    ],
    &[input("at", PortKind::Requests, true)],
    &[output("image", PortKind::Image)],
);
static SUM: Mock = mock("Sum", &[], &[input("a", PortKind::Image, true), input("b", PortKind::Image, false)], &[output("image", PortKind::Image)]);

/// Makes its first output only.
static RELAY: Mock = mock("Relay", &[], &[input("at", PortKind::Requests, true)], &[output("requests", PortKind::Requests), output("extra", PortKind::Image)]);
/// Makes an image twice as wide as the one it gets.
static GROW: Mock = mock("Grow", &[], &[input("of", PortKind::Image, true)], &[output("image", PortKind::Image)]);

/// Changes the image that it gets.
static CHANGE: Mock = mock(
    "Change",
    &[],
    &[Input { changes: true, ..input("of", PortKind::Image, true) }, input("by", PortKind::Image, false)],
    &[output("image", PortKind::Image)],
);

static MOCKS: &Registry = &[&SURFACES, &SHADOWS, &LIT, &SHADOW_VIEW, &SEEK, &GATHER, &SUM, &RELAY, &GROW, &CHANGE];

impl Pass for Mock {
    fn description(&self) -> &'static Description {
        // Mocks are statics: what they hold lives as long as the registry that lists them.
        let all: [&'static Mock; 10] = [&SURFACES, &SHADOWS, &LIT, &SHADOW_VIEW, &SEEK, &GATHER, &SUM, &RELAY, &GROW, &CHANGE];
        &all.into_iter().find(|mock| mock.description.name == self.description.name).unwrap().description
    }

    fn need(&self, _: &Arguments, needs: &Needs) -> Need {
        if self.needs_shadows && needs.shadowed_lights == 0 { Need::Dropped("no light casts shadows") } else { Need::Kept }
    }

    fn encode(&self, r: &mut Encoder<'_>) -> Result<(), Refusal> {
        if self.description.name == "Shadows" && r.arguments.integer("taps") == 2 {
            return Err(Refusal::of_parameter("taps", "plan::taps", "2 taps do not make a square", "give 1, 4, 9, 16 or 25"));
        }
        if self.description.name == "Gather" && r.batch.is_none() {
            return Err(Refusal::new("plan::not_in_a_loop", "there is no batch to gather", "put it into a Fill"));
        }
        let reads: Vec<Read> = self.description.inputs.iter().filter_map(|input| r.input(input.name)).flat_map(Port::resources).map(Read::whole).collect();
        for output in self.description.outputs.iter().filter(|output| output.name != "extra") {
            let variable = r.variable(output.name, false);
            let memory = match r.image_port("of").map(|of| r.kind(of.texture)) {
                Some(ResourceKind::Texture { size: [w, h], format, .. }) => r.texture(output.name, [2 * w, *h], 1, *format),
                _ => r.image(output.name, r.setting.size, hemisplat::schedule::Format::Rgba32Float),
            };
            let port = match output.kind {
                PortKind::Image => Port::Image(port::Image { texture: memory, channels: port::Channels::Colour }),
                PortKind::Requests => Port::Requests(port::Requests {
                    places: memory,
                    count: variable,
                    capacity: r.batch.unwrap_or(1),
                    made: variable,
                    at_most: u32::MAX,
                    slots: None,
                }),
                PortKind::ShadowMaps => Port::ShadowMaps(port::ShadowMaps { depth: memory, pitch: None, resolution: 1, taps: 1 }),
                PortKind::Flag => Port::Flag(variable),
                other => unreachable!("no mock makes {other:?}"),
            };
            r.host("work", &reads, &[memory], |_| Ok(()));
            r.output(output.name, port);
        }
        if r.batch.is_some() {
            r.remark(format!("{} at once, sequential: {}", r.batch.unwrap_or(0), r.sequential));
        }
        Ok(())
    }
}

// Reading.

fn load_files(name: &str, files: &[(&str, &str)], sets: &[&str], registry: &Registry) -> Result<Pipeline, Problems> {
    let sets: Vec<String> = sets.iter().map(|set| set.to_string()).collect();
    let mut read = |path: &Path| {
        let found = files.iter().find(|(file, _)| Path::new(file) == path);
        found.map(|(_, text)| text.to_string()).ok_or_else(|| io::Error::from(io::ErrorKind::NotFound))
    };
    load(name, &sets, registry, &mut read)
}

fn load_text(text: &str) -> Result<Pipeline, Problems> {
    load_files("test.ron", &[("test.ron", text)], &[], MOCKS)
}

fn rendered(problems: &Problems) -> String {
    let mut text = String::new();
    let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor()).with_links(false).with_width(110);
    problems.0.iter().for_each(|problem| handler.render_report(&mut text, problem).unwrap());
    text
}

fn problems(result: Result<Pipeline, Problems>) -> Problems {
    result.err().expect("the pipeline is wrong")
}

/// A pipeline of these nodes with one output.
fn nodes(nodes: &str, output: &str) -> String {
    format!("Pipeline(\n    version: 1,\n    about: \"test\",\n    nodes: [\n{nodes}\n    ],\n    outputs: {{ \"picture\": \"{output}\" }},\n)\n")
}

const FILL: &str = r#"        (name: "surfaces", pass: Surfaces()),
        (name: "shadow", pass: Shadows()),
        (name: "lit", pass: Lit(surfaces: "surfaces", shadow: "shadow")),
        (name: "fill", repeat: Fill(order: Batched(at_most: 8), until: "seek.none", nodes: [
            (name: "seek", pass: Seek(in: "lit")),
            (name: "gather", pass: Gather(at: "seek", shape: Plane(fov: 100))),
        ])),
        (name: "sum", pass: Sum(a: "gather", b: "lit")),"#;

// Errors: the code is part of the contract, the text is reviewed as a snapshot.

/// Bad nodes, the one they are asked for, and the codes expected.
#[rustfmt::skip]
const BAD: &[(&str, &str, &str, &[&str])] = &[
    ("unknown_pass", r#"        (name: "a", pass: Surface()),
        (name: "b", pass: Sum(a: "a.nothing_is_known_of_it")),"#, "b", &["pipeline::unknown_pass"]),
    ("unknown_node", r#"        (name: "surfaces", pass: Surfaces()),
        (name: "b", pass: Sum(a: "surface")),"#, "b", &["pipeline::unknown_node"]),
    ("unknown_output", r#"        (name: "a", pass: Surfaces()),
        (name: "b", pass: Sum(a: "a.normals")),"#, "b", &["pipeline::unknown_output"]),
    ("unknown_parameter", r#"        (name: "a", pass: Shadows(resolution: 16)),
        (name: "b", pass: ShadowView(of: "a")),"#, "b", &["pipeline::unknown_parameter"]),
    ("unknown_choice", r#"        (name: "a", pass: Surfaces()),
        (name: "f", repeat: Fill(until: "s.none", nodes: [
            (name: "s", pass: Seek(in: "a")),
            (name: "g", pass: Gather(at: "s", shape: Hemicub)),
        ])),"#, "g", &["pipeline::unknown_choice"]),
    ("unknown_key", r#"        (name: "a", pass: Surfaces(), comment: "no"),"#, "a", &["document::unknown_key"]),
    ("unknown_loop", r#"        (name: "a", repeat: Fil(nodes: [])),"#, "a", &["pipeline::unknown_loop"]),
    ("missing_key", r#"        (pass: Surfaces()),"#, "a", &["document::missing_key"]),
    ("duplicate_key", r#"        (name: "a", name: "b", pass: Shadows(taps: 4, taps: 9)),"#, "a", &["document::duplicate_key", "document::duplicate_key", "pipeline::kind_mismatch"]),
    ("missing_input", r#"        (name: "a", pass: Surfaces()),
        (name: "b", pass: Sum(b: "a")),"#, "b", &["pipeline::missing_input"]),
    ("duplicate_name", r#"        (name: "a", pass: Surfaces()),
        (name: "a", pass: Sum(a: "a")),"#, "a", &["pipeline::duplicate_name"]),
    ("invalid_name", r#"        (name: "a.b", pass: Surfaces()),
        (name: "c", pass: Surfaces()),"#, "c", &["pipeline::invalid_name"]),
    ("kind_mismatch", r#"        (name: "a", pass: Surfaces()),
        (name: "b", pass: Surfaces()),
        (name: "s", pass: Shadows()),
        (name: "c", pass: Sum(a: "s")),"#, "c", &["pipeline::kind_mismatch"]),
    ("kind_mismatch_of_an_output", r#"        (name: "s", pass: Shadows()),"#, "s", &["pipeline::kind_mismatch"]),
    ("wrong_type", r#"        (name: "a", pass: Shadows(taps: 4.5)),
        (name: "v", pass: ShadowView(of: "a")),
        (name: "w", pass: ShadowView(of: 4)),"#, "v", &["document::wrong_type", "document::wrong_type"]),
    ("out_of_range", r#"        (name: "a", pass: Surfaces()),
        (name: "f", repeat: Fill(order: Batched(at_most: 0), until: "s.none", nodes: [
            (name: "s", pass: Seek(in: "a")),
            (name: "g", pass: Gather(at: "s", shape: Plane(fov: 200), resolution: 99999999999999999999)),
            (name: "h", pass: Gather(at: "s", shape: Plane(fov: NaN))),
        ])),"#, "g", &["pipeline::out_of_range"; 4]),
    ("cycle", r#"        (name: "a", pass: Sum(a: "c")),
        (name: "b", pass: Sum(a: "a")),
        (name: "c", pass: Sum(a: "b")),
        (name: "self", pass: Sum(a: "self")),"#, "c", &["pipeline::cycle", "pipeline::cycle"]),
    ("cycle_through_a_loop", r#"        (name: "a", pass: Sum(a: "g")),
        (name: "f", repeat: Fill(until: "s.none", nodes: [
            (name: "s", pass: Seek(in: "a")),
            (name: "g", pass: Gather(at: "s")),
        ])),"#, "a", &["pipeline::cycle"]),
    ("changed_twice", r#"        (name: "a", pass: Surfaces()),
        (name: "b", pass: Change(of: "a")),
        (name: "c", pass: Change(of: "a")),"#, "c", &["pipeline::changed_twice"]),
    ("cycle_of_versions", r#"        (name: "a", pass: Surfaces()),
        (name: "b", pass: Change(of: "a", by: "d")),
        (name: "c", pass: Change(of: "b")),
        (name: "d", pass: Sum(a: "a")),
        (name: "e", pass: Sum(a: "b", b: "c")),"#, "e", &["pipeline::cycle"]),
    ("other_round", r#"        (name: "a", pass: Surfaces()),
        (name: "b", pass: Sum(a: PreviousRound("a"))),"#, "b", &["pipeline::other_round"]),
    ("previous_of_an_output", r#"        (name: "a", pass: Surfaces()),"#, "a\", \"last\": PreviousFrame(\"a\"), \"b\": \"a", &["pipeline::other_round"]),
    ("iterate", r#"        (name: "a", pass: Surfaces()),
        (name: "i", repeat: Iterate(rounds: 0, order: "b", nodes: [(name: "b", pass: Sum(a: "a"))])),
        (name: "j", repeat: Iterate(rounds: 2)),"#, "a", &["document::missing_key", "pipeline::out_of_range", "pipeline::unknown_parameter"]),
    ("until_outside", r#"        (name: "a", pass: Surfaces()),
        (name: "s", pass: Seek(in: "a")),
        (name: "f", repeat: Fill(until: "s.none", nodes: [
            (name: "g", pass: Gather(at: "s")),
        ])),"#, "g", &["pipeline::until_outside"]),
    ("until_is_no_flag", r#"        (name: "a", pass: Surfaces()),
        (name: "f", repeat: Fill(until: "s", nodes: [
            (name: "s", pass: Seek(in: "a")),
            (name: "g", pass: Gather(at: "s")),
        ])),"#, "g", &["pipeline::kind_mismatch"]),
    ("a_loop_is_no_source", r#"        (name: "a", pass: Surfaces()),
        (name: "f", repeat: Fill(until: "s.none", nodes: [
            (name: "s", pass: Seek(in: "a")),
            (name: "g", pass: Gather(at: "s")),
        ])),"#, "f", &["pipeline::unknown_output"]),
];

#[test]
fn each_error_has_its_code_and_underlines_its_cause() {
    for (name, bad, output, codes) in BAD {
        let problems = problems(load_text(&nodes(bad, output)));
        let found: Vec<_> = problems.0.iter().map(|problem| problem.code).collect();
        assert_eq!(found, *codes, "{name}\n{}", rendered(&problems));
        insta::assert_snapshot!(*name, rendered(&problems));
    }
}

/// Variants of the pipeline that ships, in each of which no round of the fill can cover what the one before left.
#[rustfmt::skip]
const STANDSTILLS: [(&str, &str); 6] = [
    ("nothing_is_added", r#"remove: ["added"], set: { "error_splats.records": "cache" }"#),
    ("another_cache_grows", r#"add: { "cache": [(name: "other", pass: RecordCache())] }, set: { "added.to": "other" }"#),
    ("records_from_outside", r#"add: { "cache": [
        (name: "first_splats", pass: Splat(records: "cache", gbuffer: "gbuffer")),
        (name: "first_misses", pass: FindMisses(gbuffer: "gbuffer", splats: "first_splats")),
        (name: "first_tiles", pass: HemisphereTiles(at: "first_misses")),
        (name: "first_closed", pass: Compensation(of: "first_tiles")),
        (name: "first", pass: IrradianceSum(of: "first_closed")),
    ] }, set: { "added.records": "first" }"#),
    ("requests_from_outside", r#"add: { "cache": [
        (name: "first_splats", pass: Splat(records: "cache", gbuffer: "gbuffer")),
        (name: "first_misses", pass: FindMisses(gbuffer: "gbuffer", splats: "first_splats")),
    ] }, set: { "tiles.at": "first_misses" }"#),
    ("splats_from_outside", r#"add: { "cache": [(name: "first", pass: Splat(records: "cache", gbuffer: "gbuffer"))] }, set: { "misses.splats": "first" }"#),
    ("records_of_the_frame_before", r#"set: { "splats.records": PreviousFrame("added") }"#),
];

fn variant(changes: &str) -> Result<Pipeline, Problems> {
    let text = format!("Variant(\n    version: 1,\n    about: \"test\",\n    of: \"irradiance-one-rate.ron\",\n    {changes},\n)\n");
    load_files("test.ron", &[("test.ron", &text)], &[], REGISTRY)
}

#[test]
fn a_fill_in_which_nothing_changes_is_refused() {
    for (name, changes) in STANDSTILLS {
        let problems = problems(variant(changes));
        let found: Vec<_> = problems.0.iter().map(|problem| problem.code).collect();
        assert_eq!(found, ["pipeline::no_progress"], "{name}\n{}", rendered(&problems));
        insta::assert_snapshot!(format!("no_progress_{name}"), rendered(&problems));
    }
}

#[test]
fn a_fill_that_goes_on_is_accepted() {
    let accepted = [
        // The cache under its name after the records joined it.
        r#"add: { "cache": [(name: "old", pass: AddRecords(to: "cache", records: PreviousFrame("records")))] }, set: { "splats.records": "old", "added.to": "old" }"#,
        r#"set: { "misses.splats": PreviousRound("splats") }"#,
        r#"set: { "added.records": PreviousRound("records") }"#,
        // A second cache besides.
        r#"add: { "cache": [(name: "other", pass: RecordCache())], "added": [(name: "also", pass: AddRecords(to: "other", records: "records"))] }"#,
        // One loop in the other.
        r#"replace: { "fill": Fill(until: "misses.none", nodes: [
            (name: "splats",  pass: Splat(records: "cache", gbuffer: "gbuffer")),
            (name: "misses",  pass: FindMisses(gbuffer: "gbuffer", splats: "splats")),
            (name: "once", repeat: Iterate(rounds: 1, nodes: [
                (name: "tiles",   pass: HemisphereTiles(at: "misses")),
                (name: "closed",  pass: Compensation(of: "tiles")),
                (name: "records", pass: IrradianceSum(of: "closed")),
                (name: "added",   pass: AddRecords(to: "cache", records: "records")),
            ])),
        ]) }"#,
    ];
    for changes in accepted {
        variant(changes).unwrap_or_else(|e| panic!("{changes}\n{}", rendered(&e)));
    }
}

/// Names and texts.
type Files = &'static [(&'static str, &'static str)];

/// Whole files that are wrong.
#[rustfmt::skip]
const BAD_FILES: &[(&str, Files, &str)] = &[
    ("syntax", &[("test.ron", "Pipeline(\n    version: 1,\n    nodes: [1 2],\n)")], "document::syntax"),
    ("syntax_of_another_kind", &[("test.ron", "Pipeline(version: 'a')")], "document::syntax"),
    ("not_a_pipeline", &[("test.ron", "Scene(version: 1)")], "pipeline::not_a_pipeline"),
    ("version", &[("test.ron", "Pipeline(version: 2, tables: [])")], "document::version"),
    ("no_outputs", &[("test.ron", "Pipeline(version: 1, about: \"\", nodes: [], outputs: {})")], "pipeline::no_outputs"),
    ("duplicate_output", &[("test.ron", "Pipeline(version: 1, about: \"\", nodes: [(name: \"a\", pass: Surfaces)], outputs: {\"x\": \"a\", \"x\": \"a.normal\"})")], "pipeline::duplicate_output"),
    ("not_found", &[], "pipeline::not_found"),
    ("base_not_found", &[("test.ron", "Variant(version: 1, about: \"\", of: \"iradiance.ron\")")], "pipeline::not_found"),
    ("extends_itself", &[("test.ron", "Variant(version: 1, about: \"\", of: \"./b/other.ron\")"), ("b/other.ron", "Variant(version: 1, about: \"\", of: \"../test.ron\")")], "pipeline::extends_itself"),
];

#[test]
fn each_bad_file_is_one_clear_error() {
    for (name, files, code) in BAD_FILES {
        let problems = problems(load_files("test.ron", files, &[], MOCKS));
        assert_eq!(problems.0.iter().map(|problem| problem.code).collect::<Vec<_>>(), [*code], "{name}\n{}", rendered(&problems));
        insta::assert_snapshot!(*name, rendered(&problems));
    }
}

#[test]
fn a_chain_of_variants_has_an_end() {
    let mut asked = 0;
    let mut read = |_: &Path| {
        asked += 1;
        Ok(format!("Variant(version: 1, about: \"\", of: \"{asked}.ron\")"))
    };
    let problems = problems(load("0.ron", &[], MOCKS, &mut read));
    assert_eq!(problems.0.iter().map(|problem| problem.code).collect::<Vec<_>>(), ["pipeline::too_many_variants"]);
    insta::assert_snapshot!("too_many_variants", rendered(&problems));
}

#[test]
fn what_is_nested_too_deeply_is_told_in_those_words() {
    let text = format!("Pipeline(version: 1, nodes: {}{})", "[".repeat(1000), "]".repeat(1000));
    let problems = problems(load_text(&text));
    assert_eq!(problems.0.iter().map(|problem| problem.message.as_str()).collect::<Vec<_>>(), ["this is nested too deeply"]);
}

#[test]
fn a_mark_of_the_byte_order_is_no_part_of_a_file() {
    let text = format!("\u{feff}{}", nodes(r#"(name: "a", pass: Surfaces()),"#, "a"));
    assert!(load_text(&text).is_ok());
}

#[test]
fn a_file_that_cannot_be_read_says_why() {
    let mut read = |_: &Path| Err(io::Error::new(io::ErrorKind::InvalidData, "stream did not contain valid UTF-8"));
    let problems = problems(load("test.ron", &[], MOCKS, &mut read));
    assert_eq!(problems.0[0].code, "pipeline::unreadable");
    insta::assert_snapshot!("unreadable", rendered(&problems));
}

#[test]
fn sets_are_checked_like_the_document() {
    let text = nodes(FILL, "sum");
    let sets = [
        "gather.shape.fov=5",
        "gather.shap=Hemicube",
        "gater.shape=Hemicube",
        "gather",
        "gather=1",
        "gather.resolution=",
        "shadow.taps.x=1",
        "gather.at=\"lit\"",
    ];
    let problems = problems(load_files("test.ron", &[("test.ron", &text)], &sets, MOCKS));
    insta::assert_snapshot!("sets", rendered(&problems));
    assert_eq!(problems.0.len(), sets.len());
}

#[test]
fn all_root_causes_come_at_once_and_nothing_that_follows_from_them() {
    let bad = r#"        (name: "a", pass: Surfaces(x: 1)),
        (name: "b", pass: Lot(surfaces: "a")),
        (name: "c", pass: Sum(a: "b", b: "bb")),
        (name: "d", pass: Sum(a: "c.image", b: "a.nothing")),"#;
    let problems = problems(load_text(&nodes(bad, "d")));
    let codes: Vec<_> = problems.0.iter().map(|problem| problem.code).collect();
    assert_eq!(codes, ["pipeline::unknown_pass", "pipeline::unknown_parameter", "pipeline::unknown_node", "pipeline::unknown_output"]);
}

// Variants.

#[test]
fn variants_remove_replace_add_and_set() {
    let base = nodes(FILL, "sum");
    let middle = r#"Variant(version: 1, about: "middle", of: "base.ron", set: {"gather.shape": Hemicube, "fill.order": Sequential})"#;
    let top = r#"Variant(version: 1, about: "top", of: "x/middle.ron", remove: ["shadow"],
        replace: {"lit": Sum(a: "surfaces")}, add: {"seek": [(name: "second", pass: Gather(at: "seek"))]},
        set: {"second.shape.fov": 90, "sum.b": "second"}, outputs: {"all": "sum", "normal": "surfaces.normal"})"#;
    let files = [("x/base.ron", base.as_str()), ("x/middle.ron", middle), ("top.ron", top)];
    let pipeline = load_files("top.ron", &files, &["gather.resolution=8", "second.gradients = false"], MOCKS).unwrap_or_else(|e| panic!("{}", rendered(&e)));
    assert_eq!(pipeline.about, "top");
    assert_eq!(pipeline.nodes.iter().map(|n| n.name.as_str()).collect::<Vec<_>>(), ["surfaces", "lit", "fill", "sum"]);
    let fill = &pipeline.nodes[2];
    assert_eq!(fill.arguments.choice("order").0, "Sequential");
    let inner: BTreeMap<&str, &Arguments> = fill.inner().iter().map(|n| (n.name.as_str(), &n.arguments)).collect();
    assert_eq!(inner["gather"].choice("shape").0, "Hemicube");
    assert_eq!(inner["gather"].integer("resolution"), 8);
    assert_eq!(inner["second"].choice("shape").1.float("fov"), 90.0);
    assert!(!inner["second"].bool("gradients"));
    assert_eq!(pipeline.nodes[3].inputs[1].from.to_string(), "second.image");
    assert_eq!(pipeline.outputs.iter().map(|o| o.name.as_str()).collect::<Vec<_>>(), ["all", "normal"]);
}

#[test]
fn nodes_run_after_their_sources_and_otherwise_in_the_documents_order() {
    let text = nodes(
        r#"(name: "z", pass: Sum(a: "y", b: "b")), (name: "b", pass: Surfaces), (name: "y", pass: Surfaces), (name: "a", pass: Surfaces), (name: "c", pass: Sum(a: "a"))"#,
        "z",
    );
    let pipeline = load_text(&text).unwrap_or_else(|e| panic!("{}", rendered(&e)));
    assert_eq!(pipeline.nodes.iter().map(|n| n.name.as_str()).collect::<String>(), "byzac");
}

// Plans.

/// One triangle, lit by one point light.
fn scene(shadows: bool) -> Scene {
    use glam::{Vec2, Vec3};
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let light = Light { name: "lamp".into(), kind: LightKind::Point { position: Vec3::Z, intensity: Vec3::ONE }, shadows };
    let camera = Camera {
        name: "camera".into(),
        eye: Vec3::Z * 3.0,
        direction: -Vec3::Z,
        up: Vec3::Y,
        field_of_view: FieldOfView::Horizontal(1.0),
        size: None,
        sample: Default::default(),
    };
    Scene {
        name: "triangle".into(),
        triangles: vec![Triangle { positions, normals: [Vec3::Z; 3], uvs: [Vec2::ZERO; 3], tints: Default::default(), material: 0 }],
        materials: vec![Material::diffuse("grey", Vec3::splat(0.5))],
        lights: vec![light],
        cameras: vec![camera],
        ..Scene::default()
    }
}

fn plan_for(pipeline: &Pipeline, scene: &Scene, dumps: &[&str]) -> Result<Arc<Plan>, Problems> {
    plan_on(Device::ABLE, pipeline, scene, dumps)
}

fn plan_on(device: Device, pipeline: &Pipeline, scene: &Scene, dumps: &[&str]) -> Result<Arc<Plan>, Problems> {
    let needs = Needs::of(scene);
    let dumps: Vec<String> = dumps.iter().map(|dump| dump.to_string()).collect();
    plan(pipeline, Setting { scene, needs: &needs, device, size: [64, 48], tables: None }, &dumps, &|_, _| ResourceKind::Buffer { bytes: 1024 })
}

fn planned(text: &str, shadows: bool) -> Arc<Plan> {
    let pipeline = load_text(text).unwrap_or_else(|e| panic!("{}", rendered(&e)));
    plan_for(&pipeline, &scene(shadows), &[]).unwrap_or_else(|e| panic!("{}", rendered(&e)))
}

#[test]
fn a_plan_explains_itself_and_comes_out_the_same_twice() {
    let text = nodes(FILL, "sum");
    let explained = planned(&text, true).explain();
    assert_eq!(explained, planned(&text, true).explain());
    insta::assert_snapshot!("explain", explained);
}

#[test]
fn what_a_scene_does_not_need_is_dropped_with_all_that_hangs_on_it() {
    let text = nodes(&format!("{FILL}\n        (name: \"view\", pass: ShadowView(of: \"shadow\")), (name: \"idle\", pass: Surfaces),"), "sum")
        .replace("outputs: {", "outputs: { \"shadows\": \"view\",");
    let plan = planned(&text, false);
    let dropped: Vec<_> = plan.dropped.iter().map(|d| format!("{}: {}", d.node, d.because)).collect();
    assert_eq!(dropped, ["shadow: no light casts shadows", "view: its input `of` comes from `shadow`, which is dropped", "idle: nothing uses it"]);
    assert_eq!(plan.absent[0].layer, "shadows");
    assert!(plan.schedule.resources.iter().all(|r| !r.name.starts_with("shadow.") && !r.name.starts_with("idle.")));
    assert!(plan.explain().contains("dropped shadow because no light casts shadows"));
}

#[test]
fn a_loop_that_nothing_reads_is_dropped_whole() {
    let plan = planned(&nodes(FILL, "lit"), true);
    assert_eq!(plan.dropped.iter().map(|d| d.node.as_str()).collect::<Vec<_>>(), ["fill", "seek", "gather", "sum"]);
    assert!(plan.schedule.steps.iter().all(|step| matches!(step, Step::Node(_))));
}

#[test]
fn a_loop_tells_its_passes_the_batch() {
    let remarks = |order: &str| planned(&nodes(&FILL.replace("Batched(at_most: 8)", order), "sum"), true).remarks[1].1.clone();
    assert_eq!(remarks("Batched(at_most: 8)"), "8 at once, sequential: false");
    assert_eq!(remarks("Sequential"), "1 at once, sequential: true");
}

#[test]
fn a_loop_is_bounded_by_the_pixels_or_by_its_parameter() {
    let bound = |text: &str| {
        let plan = planned(text, true);
        let repeat = plan.schedule.steps.iter().find_map(|step| if let Step::Repeat(repeat) = step { Some(repeat.at_most) } else { None });
        repeat.unwrap()
    };
    let text = nodes(FILL, "sum");
    assert_eq!(bound(&text), 64 * 48 + 64);
    assert_eq!(bound(&text.replace("order:", "max_rounds: 7, order:")), 7);
}

#[test]
fn what_passes_refuse_is_underlined() {
    let text = nodes(&format!("{}\n        (name: \"alone\", pass: Gather(at: \"seek\")),", FILL.replace("Shadows()", "Shadows(taps: 2)")), "sum")
        .replace("outputs: {", "outputs: { \"alone\": \"alone\",");
    let pipeline = load_text(&text).unwrap_or_else(|e| panic!("{}", rendered(&e)));
    let problems = plan_for(&pipeline, &scene(true), &[]).err().expect("refused");
    insta::assert_snapshot!("refusal", rendered(&problems));
    assert_eq!(problems.0.iter().map(|p| p.code).collect::<Vec<_>>(), ["plan::taps"], "what waits for the shadows is not refused as well");
}

#[test]
fn a_scene_that_leaves_nothing_is_an_error() {
    let text = nodes(r#"        (name: "s", pass: Shadows()), (name: "v", pass: ShadowView(of: "s")),"#, "v");
    let pipeline = load_text(&text).unwrap_or_else(|e| panic!("{}", rendered(&e)));
    let problems = plan_for(&pipeline, &scene(false), &[]).err().expect("nothing is left");
    insta::assert_snapshot!("nothing_left", rendered(&problems));
}

// Loops through time.

/// What the plan refuses.
fn refused(text: &str) -> String {
    let pipeline = load_text(text).unwrap_or_else(|e| panic!("{}", rendered(&e)));
    rendered(&plan_for(&pipeline, &scene(true), &[]).err().expect("refused"))
}

#[test]
fn edges_to_earlier_rounds_and_frames_read_memory_of_their_own() {
    let text = FILL.replace("Seek(in: \"lit\")", "Seek(in: \"lit\", before: PreviousRound(\"gather\"))").replace("b: \"lit\"", "b: PreviousFrame(\"sum\")");
    let plan = planned(&nodes(&text, "sum"), true);
    insta::assert_snapshot!("previous", plan.explain());
    let histories: Vec<_> = plan.schedule.resources.iter().zip(&plan.placement.slots).filter(|(r, _)| r.name.contains(" before, ")).collect();
    assert_eq!(histories.len(), 2);
    assert!(histories.iter().all(|(resource, slot)| matches!(resource.lifetime, Lifetime::History) && slot.is_none()));
}

#[test]
fn only_edges_to_earlier_rounds_close_a_loop() {
    let ring = |first: &str| {
        let ring = format!("(name: \"i\", repeat: Iterate(rounds: 3, nodes: [(name: \"a\", pass: Sum(a: {first})), (name: \"b\", pass: Sum(a: \"a\"))]))");
        nodes(&ring, "b")
    };
    assert_eq!(problems(load_text(&ring("\"b\""))).0[0].code, "pipeline::cycle");
    for when in ["PreviousRound", "PreviousFrame"] {
        let plan = planned(&ring(&format!("{when}(\"b\")")), true);
        let bound = plan.schedule.steps.iter().find_map(|step| if let Step::Repeat(repeat) = step { Some((repeat.at_most, repeat.until)) } else { None });
        assert_eq!(bound, Some((3, None)));
    }
}

#[test]
fn a_loop_inside_a_loop_starts_anew_each_time() {
    let fill =
        FILL.replace("(name: \"fill\"", "(name: \"outer\", repeat: Iterate(rounds: 2, nodes: [(name: \"fill\"").replace("        ])),", "        ])),])),");
    insta::assert_snapshot!("nested", planned(&nodes(&fill, "sum"), true).explain());
}

#[test]
fn an_earlier_round_is_one_of_the_innermost_loop_that_holds_both_ends() {
    let text = r#"(name: "a", pass: Surfaces()),
        (name: "outer", repeat: Iterate(rounds: 2, nodes: [
            (name: "inner", repeat: Iterate(nodes: [(name: "c", pass: Sum(a: "a", b: PreviousRound("c"))), (name: "d", pass: Sum(a: "c", b: PreviousRound("e")))])),
            (name: "e", pass: Sum(a: "d", b: PreviousRound("d"))),
        ])),"#;
    let plan = planned(&nodes(text, "e"), true);
    let histories: Vec<_> = plan.schedule.resources.iter().map(|r| r.name.as_str()).filter(|name| name.contains(" before, ")).collect();
    assert_eq!(histories, ["c.image round of inner before, 0", "d.image round of outer before, 0", "e.image round of outer before, 0"]);
}

#[test]
fn an_earlier_value_of_what_the_scene_drops_is_absent() {
    let text = |input: &str| {
        nodes(
            &format!(
                r#"(name: "a", pass: Surfaces()), (name: "s", pass: Shadows()), (name: "v", pass: ShadowView(of: "s")), (name: "sum", pass: Sum({input}))"#
            ),
            "sum",
        )
        .replace("outputs: {", "outputs: { \"surfaces\": \"a\",")
    };
    let optional = planned(&text("a: \"a\", b: PreviousFrame(\"v\")"), false);
    assert_eq!(optional.outputs.len(), 2);
    assert!(!optional.explain().contains("frame before"));
    let required = planned(&text("a: PreviousFrame(\"v\")"), false);
    let because = required.dropped.iter().find(|dropped| dropped.node == "sum").map(|dropped| dropped.because.as_str());
    assert_eq!(because, Some("its input `a` comes from `v`, which is dropped"));
}

#[test]
fn what_a_loop_through_time_cannot_know_is_refused() {
    let waiting = r#"        (name: "a", pass: Surfaces()),
        (name: "x", pass: Relay(at: PreviousFrame("y"))),
        (name: "y", pass: Relay(at: "x")),
        (name: "f", repeat: Fill(until: "s.none", nodes: [
            (name: "s", pass: Seek(in: "a")),
            (name: "g", pass: Gather(at: "y")),
        ])),"#;
    insta::assert_snapshot!("previous_unknown", refused(&nodes(waiting, "g")));
    insta::assert_snapshot!("previous_grows", refused(&nodes(r#"        (name: "g", pass: Grow(of: PreviousFrame("g"))),"#, "g")));
    let absent = r#"        (name: "a", pass: Surfaces()),
        (name: "f", repeat: Fill(until: "s.none", nodes: [
            (name: "s", pass: Seek(in: "a")),
            (name: "r", pass: Relay(at: "s")),
            (name: "sum", pass: Sum(a: PreviousRound("r.extra"))),
        ])),"#;
    insta::assert_snapshot!("previous_absent", refused(&nodes(absent, "sum")));
}

#[test]
fn dumps_stay_whole_and_unknown_ones_are_refused() {
    let pipeline = load_text(&nodes(FILL, "sum")).unwrap_or_else(|e| panic!("{}", rendered(&e)));
    let scene_without = scene(false);
    let plan = plan_for(&pipeline, &scene_without, &["surfaces.normal"]).unwrap_or_else(|e| panic!("{}", rendered(&e)));
    let [normal] = plan.ports["surfaces.normal"].resources()[..] else { panic!("one texture") };
    let last = plan.schedule.nodes().len() as u32;
    assert_eq!(plan.lifetimes.span(normal).map(|[_, end]| end), Some(last));
    let problems = plan_for(&pipeline, &scene_without, &["lot", "shadow", "fill", "sum.x"]).err().expect("refused");
    insta::assert_snapshot!("dumps", rendered(&problems));
}

#[test]
fn drawings_show_every_node_and_output() {
    let pipeline = load_text(&nodes(FILL, "sum")).unwrap_or_else(|e| panic!("{}", rendered(&e)));
    insta::assert_snapshot!("graph_dot", export(&pipeline, Format::Dot));
    insta::assert_snapshot!("graph_mermaid", export(&pipeline, Format::Mermaid));
    let svg = export(&pipeline, Format::Svg);
    for name in [">surfaces<", ">Surfaces<", ">fill<", ">Fill, Batched(at_most: 8)<", ">until seek.none<", ">picture<"] {
        assert!(svg.contains(name), "{name}");
    }
    assert_eq!(svg.matches("<path fill=").count(), 7, "an arrow's head an edge");
}

// Pipelines that ship.

#[test]
fn every_shipped_pipeline_plans_the_same_twice() {
    for (file, text) in EMBEDDED {
        let explain = |shadows| {
            let pipeline = load_files(file, &[], &[], REGISTRY).unwrap_or_else(|e| panic!("{}", rendered(&e)));
            plan_for(&pipeline, &scene(shadows), &[]).unwrap_or_else(|e| panic!("{}", rendered(&e))).explain()
        };
        assert_eq!(explain(true), explain(true), "{file}");
        // A pipeline that has maps drops them, unless it is to hold for every scene.
        let drops = explain(true).contains("ShadowMap") && !text.contains("specialise: false");
        assert_eq!(explain(false).contains("dropped shadow because"), drops, "{file}");
        assert!(text.contains("about: "), "{file}");
    }
}

#[test]
fn caches_share_the_time_and_loops_of_one_cache_do_not() {
    let shares = |file| {
        let mut pipeline = load_files(file, &[], &[], REGISTRY).unwrap_or_else(|e| panic!("{}", rendered(&e)));
        pipeline.specialise = false;
        let plan = plan_for(&pipeline, &scene(true), &[]).unwrap_or_else(|e| panic!("{}", rendered(&e)));
        let share =
            |step: &Step| if let Step::Repeat(repeat) = step { Some((repeat.name.clone(), repeat.time.caches, repeat.time.at_least > 0)) } else { None };
        plan.schedule.steps.iter().filter_map(share).collect::<Vec<_>>()
    };
    assert_eq!(shares("radiance.ron"), [("fill".into(), 2, true), ("details".into(), 2, false), ("glossy_fill".into(), 1, true)]);
    assert_eq!(shares("irradiance.ron"), [("fill".into(), 1, true), ("details".into(), 1, false)]);
}

fn called(device: Device) -> &'static str {
    if device.is_software { "Software" } else { "Hardware" }
}

fn shipped(scene: &str) -> Scene {
    scenes::load(Path::new(scene), &scenes::LoadOptions::default()).unwrap()
}

fn planned_for(file: &str, scene: &Scene, device: Device) -> Arc<Plan> {
    let pipeline = load_files(file, &[], &[], REGISTRY).unwrap_or_else(|e| panic!("{}", rendered(&e)));
    plan_on(device, &pipeline, scene, &[]).unwrap_or_else(|e| panic!("{}", rendered(&e)))
}

/// Where passes run, what they are given and how much memory they take: as kept, for a plan of each way that a pass has.
#[test]
fn plans_of_each_way_stay_as_they_are() {
    let plans = [
        ("irradiance.ron", "hall", Device::SOFTWARE),
        ("irradiance-device.ron", "hall", Device::ABLE),
        ("irradiance-mipmap.ron", "hall", Device::ABLE),
        ("irradiance-ping-pong.ron", "furnace", Device::ABLE),
        ("irradiance-compute-splat.ron", "hall", Device::SOFTWARE),
        ("radiance.ron", "cornell-glossy", Device::SOFTWARE),
        ("radiance-device.ron", "balls", Device::ABLE),
        ("environment.ron", "teapot-overcast", Device::SOFTWARE),
        ("environment.ron", "teapot-overcast", Device::ABLE),
    ];
    for (file, scene, device) in plans {
        let explained = planned_for(file, &shipped(scene), device).explain();
        insta::assert_snapshot!(format!("plan_{}_{scene}_{}", file.trim_end_matches(".ron"), called(device)), explained);
    }
}

/// What is dropped, what has no effect, and which of its ways a pass takes.
#[test]
fn what_suits_a_scene_and_a_device_stays_as_it_is() {
    let mut text = String::new();
    for name in ["cornell", "hall", "corner", "furnace", "teapot-overcast", "cornell-glossy"] {
        let scene = shipped(name);
        for file in ["irradiance.ron", "environment.ron", "radiance.ron", "radiance-rotated.ron"] {
            for device in [Device::ABLE, Device::SOFTWARE] {
                let explained = planned_for(file, &scene, device).explain();
                let told = |line: &&str| ["no output", "dropped", "approximated", "remark", "no effect", "memory"].iter().any(|start| line.starts_with(start));
                let lines: String = explained.lines().filter(told).map(|line| format!("    {line}\n")).collect();
                text += &format!("{file} {name} {}\n{lines}", called(device));
            }
        }
    }
    insta::assert_snapshot!("what_suits", text);
}

// The program.

/// Exit status, stdout and stderr, run in an empty folder.
fn program(arguments: &[&str]) -> (i32, String, String) {
    let folder = tempfile::tempdir().unwrap();
    let output = assert_cmd::Command::new(env!("CARGO_BIN_EXE_hemisplat")).current_dir(folder.path()).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

#[test]
fn all_shipped_pipelines_pass_the_check_in_a_second() {
    let start = Instant::now();
    let (status, stdout, stderr) = program(&["check"]);
    assert_eq!((status, stderr.as_str()), (0, ""));
    assert_eq!(stdout.lines().count(), EMBEDDED.len());
    assert!(start.elapsed().as_secs_f64() < 1.0);
}

#[test]
fn an_error_that_variants_share_is_told_once_with_status_2() {
    let (status, _, stderr) = program(&["check", "irradiance", "irradiance-ward", "--set", "cache.accuracy=77"]);
    assert_eq!(status, 2);
    assert_eq!(stderr.matches("pipeline::out_of_range").count(), 1, "{stderr}");
    assert_eq!(program(&["check", "no-such-pipeline"]).0, 2);
    assert_eq!(program(&["check", "--camera", "left"]).0, 2, "a camera without a scene");
}

#[test]
fn the_plan_says_where_rays_are_cast() {
    let says_host = |file, device| {
        let pipeline = load_files(file, &[], &[], REGISTRY).unwrap_or_else(|e| panic!("{}", rendered(&e)));
        plan_on(device, &pipeline, &scene(true), &[]).unwrap_or_else(|e| panic!("{}", rendered(&e))).explain().contains("remark tiles: done by the host")
    };
    assert!(says_host("irradiance.ron", Device::SOFTWARE));
    assert!(!says_host("irradiance.ron", Device::ABLE));
    assert!(!says_host("irradiance-device-rays.ron", Device::SOFTWARE));
}

#[test]
fn a_plan_can_be_read_without_a_gpu() {
    let (status, stdout, stderr) = program(&["explain", "irradiance", "--scene", "cornell", "--size", "32x16", "--set", "tiles.resolution=8"]);
    assert_eq!(status, 0, "{stderr}");
    for line in ["dropped shadow because", "repeat fill until misses.none, at most 576 rounds", "Rgba32Float 32×16"] {
        assert!(stdout.contains(line), "{line}\n{stdout}");
    }
    assert_eq!(program(&["explain", "irradiance-cosine", "--scene", "cornell", "--set", "tiles.by=Raster"]).0, 2, "a shape that cannot be rasterised");
}

#[test]
fn every_pass_tells_all_about_itself() {
    let (_, list, _) = program(&["passes"]);
    let names: Vec<&str> = list.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert_eq!(names.len(), REGISTRY.len() + Loop::ALL.len(), "the passes and the loops");
    for name in names {
        let (status, stdout, _) = program(&["passes", name]);
        assert_eq!(status, 0);
        let all = REGISTRY.iter().map(|pass| pass.description()).chain(Loop::ALL.map(Loop::description));
        let description = all.into_iter().find(|d| d.name == name).unwrap();
        assert!(description.parameters.iter().all(|p| stdout.contains(&format!("  {}: ", p.name)) && stdout.contains(p.about)), "{stdout}");
    }
    assert_eq!(program(&["passes", "Splatt"]).0, 2);
}

#[test]
fn a_graph_goes_to_stdout_in_each_format() {
    for (format, beginning) in [("dot", "digraph"), ("mermaid", "flowchart"), ("svg", "<svg")] {
        let (status, stdout, _) = program(&["graph", "irradiance", "--format", format]);
        assert!(status == 0 && stdout.starts_with(beginning), "{format}");
    }
}

// What no one writes on purpose.

/// SplitMix64 (Steele and others 2014).
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % limit.max(1) as u64) as usize
    }
}

fn mutate(text: &str, other: &str, random: &mut Random) -> String {
    let mut characters: Vec<char> = text.chars().collect();
    for _ in 0..=random.below(3) {
        let at = random.below(characters.len());
        let end = (at + random.below(30)).min(characters.len());
        match random.below(5) {
            0 => drop(characters.drain(at..end)),
            1 => characters.insert(at, ['(', ')', '"', ',', ':', '{', ']', '\'', '\\', 'é', '\0', '-', '9', '.', '/', '*', '#', 'r'][random.below(18)]),
            2 => {
                let piece: Vec<char> = characters[at..end].to_vec();
                let to = random.below(characters.len());
                drop(characters.splice(to..to, piece));
            }
            3 => {
                let words: Vec<&str> = other.split_whitespace().collect();
                drop(characters.splice(at..end, words[random.below(words.len())].chars()));
            }
            _ if at + 1 < characters.len() => characters.swap(at, at + 1),
            _ => {}
        }
        if characters.is_empty() {
            break;
        }
    }
    characters.into_iter().collect()
}

/// Where a mutated pipeline ended: at its document, at its plan, or with a plan.
#[derive(Clone, Copy)]
enum End {
    Document,
    Plan,
    Planned,
}

fn end_of(files: &[(&str, &str)], registry: &Registry, scene: &Scene) -> End {
    let start = Instant::now();
    let end = match load_files("test.ron", files, &[], registry) {
        Err(problems) => {
            assert!(!problems.0.is_empty() && !rendered(&problems).is_empty());
            End::Document
        }
        Ok(pipeline) => match plan_for(&pipeline, scene, &[]) {
            Err(problems) => {
                assert!(!rendered(&problems).is_empty());
                End::Plan
            }
            Ok(plan) => {
                assert!(!plan.outputs.is_empty());
                End::Planned
            }
        },
    };
    assert!(start.elapsed().as_secs() < 10, "{:?} took {:?}", files[0], start.elapsed());
    end
}

/// Runs many tries; each ending has to come about, or the mutations are too tame or too wild.
fn expect_all_ends(tries: u64, end: impl Fn(u64) -> End + Sync) {
    let ends: Vec<End> = (0..tries).into_par_iter().map(&end).collect();
    let counts = [0, 1, 2].map(|kind| ends.iter().filter(|end| **end as usize == kind).count());
    assert!(counts.iter().all(|count| *count > 10), "all ways are walked: {counts:?}");
}

#[test]
fn mutated_pipelines_never_panic() {
    let pipeline = nodes(FILL, "sum");
    let variant = r#"Variant(version: 1, about: "v", of: "base.ron", remove: ["shadow"], set: {"gather.shape.fov": 9e1, "sum.b": PreviousFrame("gather")}, replace: {"lit": Sum(a: "surfaces")}, add: {"seek": [(name: "x", pass: Gather(at: "seek"))]}, outputs: {"a": "sum"})"#;
    let refused = pipeline.replace("Shadows()", "Shadows(taps: 2)");
    let scene = scene(true);
    expect_all_ends(10_000, |attempt| {
        let (text, other) = [(pipeline.as_str(), variant), (variant, pipeline.as_str()), (refused.as_str(), variant)][attempt as usize % 3];
        let text = mutate(text, other, &mut Random(attempt));
        end_of(&[("test.ron", &text), ("base.ron", &pipeline)], MOCKS, &scene)
    });
}

/// The text with the value of a random key exchanged.
fn exchange(text: &str, random: &mut Random) -> String {
    // Some are allowed somewhere, some nowhere.
    const VALUES: [&str; 20] = [
        "512",
        "4",
        "5",
        "3",
        "800000",
        "1000000",
        "1e6",
        "4294967295",
        "18446744073709551615",
        "1e-9",
        "-1",
        "0.5",
        "175",
        "10",
        "NaN",
        "inf",
        "Plane",
        "Hemicube",
        "Raster",
        "MipmapChain",
    ];
    let keys: Vec<usize> = text.match_indices(": ").map(|(at, _)| at + 2).collect();
    let start = keys[random.below(keys.len())];
    let length = text[start..].find([',', ')', '}', '\n']).unwrap_or(0);
    format!("{}{}{}", &text[..start], VALUES[random.below(VALUES.len())], &text[start + length..])
}

/// The same of what ships, with the passes that ship: no number in a pipeline may make planning endless or huge.
#[test]
fn mutated_shipped_pipelines_never_panic() {
    let scene = scene(true);
    let (_, base) = embedded::find("irradiance").expect("it ships");
    expect_all_ends(10_000, |attempt| {
        let mut random = Random(attempt);
        let (_, other) = EMBEDDED[attempt as usize % EMBEDDED.len()];
        let text = if attempt % 2 == 0 { exchange(base, &mut random) } else { mutate(other, base, &mut random) };
        end_of(&[("test.ron", &text)], REGISTRY, &scene)
    });
}

// Memory.

/// A schedule of nodes and loops that touch random resources.
fn random_recording(random: &mut Random) -> Schedule {
    let mut schedule = Schedule::default();
    for index in 0..2 + random.below(12) {
        let kind = match random.below(3) {
            0 => ResourceKind::Buffer { bytes: 16 * (1 + random.below(8) as u64) },
            1 => ResourceKind::Texture { size: [8, 8], layers: 1, format: hemisplat::schedule::Format::R32Float },
            _ => ResourceKind::Texture { size: [8, 8], layers: 1, format: hemisplat::schedule::Format::Rgba32Float },
        };
        let lifetime = if random.below(5) == 0 { Lifetime::History } else { Lifetime::Transient };
        schedule.resources.push(ResourceDescription { name: format!("r{index}"), kind, lifetime });
    }
    schedule.variables.push(VariableDescription { name: "done".into(), history: false });
    schedule.steps = random_steps(random, schedule.resources.len(), 2);
    schedule
}

fn random_steps(random: &mut Random, resources: usize, depth: usize) -> Vec<Step> {
    let step = |random: &mut Random| {
        if depth > 0 && random.below(4) == 0 {
            let steps = random_steps(random, resources, depth - 1);
            return Step::Repeat(Repeat {
                name: "loop".into(),
                until: Some(Variable(0)),
                round: Variable(0),
                at_most: 3,
                steps,
                time: TimeShare { at_least: 0, records: None, caches: 1 },
                driver: Driver::Host,
            });
        }
        let commands = (0..random.below(3)).map(|_| Command::Clear(Resource(random.below(resources) as u32))).collect();
        Step::Node(Node { name: "node".into(), pass: "Pass", commands, keys: Keys::default() })
    };
    (0..1 + random.below(6)).map(|_| step(random)).collect()
}

/// What runs, in order, with every loop run twice: the resources that each node touches.
fn trace(steps: &[Step], into: &mut Vec<Vec<Resource>>) {
    for step in steps {
        match step {
            Step::Node(node) => into.push(node.commands.iter().flat_map(Command::resources).collect()),
            Step::Repeat(repeat) => (0..2).for_each(|_| trace(&repeat.steps, into)),
        }
    }
}

#[test]
fn resources_that_are_alive_at_once_never_share_memory_and_histories_never_do() {
    let mut shared = 0;
    for seed in 0..3000 {
        let schedule = random_recording(&mut Random(seed));
        let kept = [Resource(0)];
        let placement = Placement::of(&schedule, &Lifetimes::of(&schedule, &kept));
        let mut steps = Vec::new();
        trace(&schedule.steps, &mut steps);
        let touched = |resource: u32| steps.iter().enumerate().filter(move |(_, all)| all.contains(&Resource(resource))).map(|(at, _)| at);
        let alive = |resource: u32| Some((touched(resource).min()?, if resource == 0 { usize::MAX } else { touched(resource).max()? }));
        for a in 0..schedule.resources.len() as u32 {
            let slot = placement.slots[a as usize];
            let description = &schedule.resources[a as usize];
            assert!(slot.is_none() || matches!(description.lifetime, Lifetime::Transient), "seed {seed}");
            if let Some(slot) = slot {
                assert!(placement.allocations[slot as usize].bytes() >= description.kind.bytes(), "seed {seed}");
            }
            for b in (0..a).filter(|b| slot.is_some() && placement.slots[*b as usize] == slot) {
                let (Some(a), Some(b)) = (alive(a), alive(b)) else { continue };
                assert!(a.1 < b.0 || b.1 < a.0, "seed {seed}");
                shared += 1;
            }
        }
    }
    assert!(shared > 100, "sharing happens: {shared}");
}

/// A pipeline with dials.
fn dialled(dials: &str) -> String {
    nodes(FILL, "sum").trim_end().trim_end_matches(')').to_owned() + &format!("    dials: {{ {dials} }},\n)\n")
}

const DIAL: &str = r#""quality": Dial(about: "how wrong", written: 0.02, turns: { "gather.resolution": { 0.01: 128, 0.04: 32 }, "gather.shape": { 0.01: Hemicube, 0.02: Plane(fov: 90) } })"#;

#[test]
fn a_dial_turns_all_its_parameters() {
    let text = dialled(DIAL);
    let variant = r#"Variant(version: 1, about: "", of: "test.ron", set: { "quality": 0.04 })"#;
    let bare = r#"Variant(version: 1, about: "", of: "test.ron", replace: { "gather": Gather(at: "seek") })"#;
    let removed = r#"Variant(version: 1, about: "", of: "test.ron", remove: ["quality"])"#;
    let more = r#"Variant(version: 1, about: "", of: "test.ron", dials: { "quality": Dial(turns: { "gather.resolution": { 0.01: 100, 0.04: 50 } }) })"#;
    let files = [("test.ron", text.as_str()), ("variant.ron", variant), ("bare.ron", bare), ("removed.ron", removed), ("more.ron", more)];
    let gather = |name: &str, sets: &[&str]| {
        let pipeline = load_files(name, &files, sets, MOCKS).unwrap_or_else(|problems| panic!("{}", rendered(&problems)));
        let plan = plan_for(&pipeline, &scene(true), &[]).unwrap_or_else(|problems| panic!("{}", rendered(&problems)));
        let text = pipeline.to_ron();
        let back = load_files("back.ron", &[("back.ron", &text)], &[], MOCKS).unwrap_or_else(|problems| panic!("{}", rendered(&problems)));
        assert_eq!(back.to_ron(), text);
        let gather = &plan.resolved.iter().find(|(node, _)| node == "gather").expect("a node").1;
        (gather[1..].join(" "), pipeline.dials.len())
    };
    let found = |name: &str, sets: &[&str]| gather(name, sets).0;
    assert_eq!(found("test.ron", &[]), "resolution: 64 shape: Plane(fov: 100)");
    assert_eq!(found("test.ron", &["quality=0.01"]), "resolution: 128 shape: Hemicube");
    assert_eq!(found("test.ron", &["quality=0.02"]), "resolution: 64 shape: Plane(fov: 90)");
    assert_eq!(found("variant.ron", &[]), "resolution: 32 shape: Plane(fov: 90)");
    // The last one counts.
    assert_eq!(found("test.ron", &["gather.resolution=16", "quality=0.01"]), "resolution: 128 shape: Hemicube");
    assert_eq!(found("test.ron", &["quality=0.01", "gather.resolution=16"]), "resolution: 16 shape: Hemicube");
    // A node that is replaced is turned no longer, and a dial that turns nothing is none.
    assert_eq!(gather("bare.ron", &[]).1, 0);
    assert_eq!(gather("removed.ron", &[]).1, 0);
    // A variant may have it turn more, or otherwise.
    assert_eq!(found("more.ron", &["quality=0.01"]), "resolution: 100 shape: Hemicube");
}

/// Where a dial stands as written, it says what stands in the nodes.
#[test]
fn dials_that_ship_stand_where_they_say() {
    let mut turned = 0;
    for (name, _) in EMBEDDED {
        let written = load_files(name, &[], &[], REGISTRY).unwrap();
        for dial in &written.dials {
            let at = |at: f64| {
                load_files(name, &[], &[&format!("{}={at}", dial.name.text)], REGISTRY).unwrap_or_else(|problems| panic!("{}", rendered(&problems))).to_ron()
            };
            assert!(at(dial.written) == written.to_ron(), "{name}: {}", dial.name.text);
            let (least, most) = dial.range().into_inner();
            assert!(at(least) != written.to_ron() && at(most) != written.to_ron());
            turned += 1;
        }
    }
    assert!(turned > 5, "{turned}");
}

#[test]
fn dials_are_refused_with_the_place() {
    for (dials, set, codes) in [
        (DIAL, "quality=0.1", &["pipeline::out_of_range"][..]),
        (DIAL, "quality=fine", &["document::wrong_type"]),
        (DIAL, "qualty=0.02", &["document::missing_key"]),
        (r#""q": Dial(about: "", written: 0.1, turns: { "gather.resolution": { 0.01: 128, 0.04: 32 } })"#, "q=0.02", &["pipeline::out_of_range"]),
        (r#""q": Dial(about: "", written: 0.01, turns: { "gather.resolution": { 0.01: 128, 0.010: 32 } })"#, "", &["document::duplicate_key"]),
        (r#""q": Dial(about: "", written: 0.01, turns: { "gather.resolution": {} })"#, "", &["document::wrong_type"]),
        (
            r#""q": Dial(about: "", written: 0.01, turns: { "gather.resolution": { 0.01: 1, 1: 1.5 }, "gathr.shape": { 1: Hemicube } })"#,
            "",
            &["pipeline::out_of_range", "document::wrong_type", "pipeline::unknown_node"],
        ),
        (
            r#""q": Dial(about: "", written: 0.01, turns: { "gather.rays": { 0.01: 1 } }), "q": Dial(about: "", written: 1, turns: {})"#,
            "",
            &["document::duplicate_key", "pipeline::unknown_parameter"],
        ),
        (
            r#""q": (written: 1), "r.s": Dial(about: "")"#,
            "",
            &["document::wrong_type", "pipeline::invalid_name", "document::missing_key", "document::missing_key"],
        ),
    ] {
        let text = dialled(dials);
        let sets: Vec<&str> = (!set.is_empty()).then_some(set).into_iter().collect();
        let problems = problems(load_files("test.ron", &[("test.ron", &text)], &sets, MOCKS));
        assert_eq!(problems.0.iter().map(|problem| problem.code).collect::<Vec<_>>(), codes, "{}", rendered(&problems));
    }
    let problems = problems(load_files("test.ron", &[("test.ron", &dialled(DIAL))], &["quality=0.1", "qualty=0.02"], MOCKS));
    insta::assert_snapshot!("dials", rendered(&problems));
}

#[test]
fn a_written_pipeline_reads_back_as_the_same() {
    let reads_back = |pipeline: &Pipeline, registry: &Registry| {
        let text = pipeline.to_ron();
        let back = load_files("back.ron", &[("back.ron", &text)], &[], registry).unwrap_or_else(|problems| panic!("{}\n{text}", rendered(&problems)));
        assert_eq!(back.to_ron(), text);
        assert_eq!(export(&back, Format::Mermaid), export(pipeline, Format::Mermaid), "{}", pipeline.name);
    };
    for (name, _) in EMBEDDED {
        reads_back(&load_files(name, &[], &[], REGISTRY).unwrap(), REGISTRY);
    }
    let earlier = FILL.replace("Seek(in: \"lit\")", "Seek(in: \"lit\", before: PreviousRound(\"gather\"))").replace("b: \"lit\"", "b: PreviousFrame(\"sum\")");
    reads_back(&load_text(&nodes(&earlier, "sum")).unwrap(), MOCKS);
}

/// A picture of these images of indirect light.
fn combined(indirect: &str) -> String {
    let combine = format!("(name: \"image\", pass: Composite(gbuffer: \"gbuffer\", indirect: {indirect})),");
    nodes(&format!("(name: \"gbuffer\", pass: GBuffer()), {combine}"), "image")
}

#[test]
fn an_input_for_a_list_takes_any_number() {
    let sums = |indirect: &str| {
        let pipeline = load_files("list.ron", &[("list.ron", &combined(indirect))], &[], REGISTRY).unwrap_or_else(|e| panic!("{}", rendered(&e)));
        let planned = plan_for(&pipeline, &scene(true), &[]).unwrap_or_else(|e| panic!("{}", rendered(&e)));
        let image = planned.schedule.nodes().into_iter().find(|node| node.name == "image").expect("the node");
        let entries = image.commands.iter().flat_map(|command| command.computes()).map(|compute| compute.entry);
        entries.filter(|entry| *entry == "add").count()
    };
    let [normal, two] = ["\"gbuffer.normal\"", "\"gbuffer.normal\", \"gbuffer.depth\""];
    assert_eq!([normal, "[]", &format!("[{normal}]"), &format!("[{two}]"), &format!("[{two}, {normal}]")].map(sums), [0, 0, 0, 1, 2]);
}

#[test]
fn what_is_wrong_in_a_list_is_told_item_by_item() {
    let told =
        |text: &str| problems(load_files("list.ron", &[("list.ron", text)], &[], REGISTRY)).0.into_iter().map(|p| (p.code, p.message)).collect::<Vec<_>>();
    let both = told(&combined("[\"nobody\", \"gbuffer\", \"gbuffer.normal\"]"));
    assert_eq!(both.iter().map(|(code, _)| *code).collect::<Vec<_>>(), ["pipeline::unknown_node", "pipeline::kind_mismatch"]);
    let text = nodes("(name: \"gbuffer\", pass: GBuffer()), (name: \"direct\", pass: DirectLight(gbuffer: [\"gbuffer\", \"gbuffer\"])),", "direct");
    assert_eq!(told(&text), [("document::wrong_type", "direct.gbuffer expects the name of a node, got a list".to_owned())]);
}
