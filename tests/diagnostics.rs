//! Every diagnostic code has a case whose whole message is a reviewed snapshot, here or in another test, or a reason why
//! no input brings it about.

mod skips;

use assert_cmd::Command;
use hemisplat::measure::{Layer, Layers, PICTURE};
use libtest_mimic::Arguments;
use skips::{Missing, holds};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Codes that no input brings about on every machine.
const BEYOND_INPUT: [(&str, &str); 38] = [
    ("cli::fault", "a fault of the program"),
    ("cli::few_threads", "needs a limit of the system; tests/limits.rs sets one"),
    ("cli::interrupted", "needs Ctrl-C at the right moment"),
    ("cli::json", "results hold nothing that JSON cannot"),
    ("cli::little_memory", "needs a limit of the system; tests/limits.rs sets one"),
    ("cli::no_threads", "threads are granted and then refused"),
    ("cli::signal", "the system refuses a handler"),
    ("compare::no_cache", "needs a system that knows no home folder"),
    ("compare::not_kept", "needs a full disk; tests/limits.rs sets a limit for one"),
    ("compare::unusable_cache", "the system says why in its own words; tests/limits.rs brings it about"),
    ("gpu::driver", "a fault of the driver or of a shader"),
    ("gpu::host_step", "a fault of a pass: fills stop before a cache is full"),
    ("gpu::interrupted", "needs Ctrl-C at the right moment"),
    ("gpu::limit", "depends on the adapter"),
    ("gpu::lost", "the device goes away"),
    ("gpu::missing_feature", "depends on the adapter"),
    ("gpu::no_device", "the driver refuses its own adapter"),
    ("gpu::other_recording", "frames are compared before the session is asked"),
    ("gpu::out_of_memory", "depends on the machine"),
    ("gpu::shader", "shaders ship with the program, and tests validate them"),
    ("gpu::unknown_adapter", "lists the machine's adapters"),
    ("run::output", "no command copies pictures to textures; tests/engine.rs brings it about"),
    ("study::unexpected", "what is measured decides it; tests/study.rs brings it about"),
    ("measure::encoding", "what is written was made here"),
    ("measure::unwritable", "the disk decides it; a command names the file as for every other write"),
    ("measure::wrong_size", "files cannot hold layers of several sizes"),
    ("plan::scene_part", "no pass that ships asks for a part; tests/engine.rs brings it about"),
    ("reference::camera", "loaders refuse such cameras first"),
    ("reference::stopped", "needs Ctrl-C at the right moment"),
    ("render::non_finite", "a fault of a pass"),
    ("render::unknown_dump", "plans refuse it first"),
    ("stage::overlap", "no command moves objects"),
    ("stage::part", "no command makes parts; tests/engine.rs brings it about"),
    ("stage::place", "no command moves objects; tests/changes.rs brings it about"),
    ("stage::shape", "no file that ships deforms; src/scene/load/tests/deform.rs brings it about"),
    ("stage::unknown", "no command changes a scene; tests/changes.rs brings it about"),
    ("stage::value", "no command changes a scene; tests/changes.rs brings it about"),
    ("scene::unreadable", "a file that is there but cannot be read; as the super-user all can"),
];

/// A camera and a box of this material, under a white sky.
fn scene(material: &str) -> String {
    let camera = "(eye: (3, 3, 3), target: (0, 0, 0), fov: 40, size: (8, 8))";
    format!(
        "Scene(version: 1, geometry: [Box(min: (0, 0, 0), max: (1, 1, 1))], materials: {{ \"*\": {material} }}, environment: Constant((1, 1, 1)), \
         cameras: {{ \"a\": {camera}, \"b\": {camera} }})"
    )
}

fn picture(layer: Layer) -> Layers {
    Layers::new(2, 1).with("irradiance", layer).with("depth", Layer::value(vec![1.0, 1.0]))
}

/// Two windows side by side, of which a picture holds one.
fn window(corner: &str) -> Layers {
    Layers::new(128, 64).with("irradiance", Layer::value(vec![1.0; 128 * 64])).with_attribute("windows", corner)
}

/// Parts of two pixels of this grey, as other programs may write them.
fn parts(names: &[&str], grey: f32) -> Vec<u8> {
    use exr::prelude::*;
    let colours = || SpecificChannels::rgb(move |_| (grey, grey, grey));
    let layers: Vec<_> = names.iter().map(|name| Layer::new((2, 1), LayerAttributes::named(*name), Encoding::UNCOMPRESSED, colours())).collect();
    let mut bytes = std::io::Cursor::new(Vec::new());
    Image::from_layers(ImageAttributes::new(IntegerBounds::from_dimensions((2, 1))), layers).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

/// The picture with a header that states other pixels than it holds.
fn stating(mut exr: Vec<u8>, width: i32, height: i32) -> Vec<u8> {
    let name = b"dataWindow\0box2i\0";
    let window = exr.windows(name.len()).position(|bytes| bytes == name).unwrap() + name.len() + 4;
    exr[window..window + 16].copy_from_slice(&[0, 0, width - 1, height - 1].map(i32::to_le_bytes).concat());
    exr
}

/// Quads of as many different lobes.
fn lobes(count: usize) -> Vec<u8> {
    let names = || (0..count).map(|i| format!("m{i}"));
    let quads: String = names().map(|name| format!("Quad(corners: ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)), material: \"{name}\"), ")).collect();
    let materials: String =
        names().enumerate().map(|(i, name)| format!("\"{name}\": Phong(reflectance: (0, 0, 0), specular: (0.5, 0.5, 0.5), exponent: {}), ", i + 2)).collect();
    format!("Scene(version: 1, geometry: [{quads}], materials: {{ {materials} }}, environment: Constant((1, 1, 1)), cameras: {{ \"main\": (eye: (0, 0, 3), direction: (0, 0, -1), up: (0, 1, 0), fov: 40, size: (8, 8)) }})").into_bytes()
}

/// Glossy surfaces without their lobes.
const SURFACES: &str = r#"Pipeline(
    version: 1,
    about: "",
    nodes: [
        (name: "gbuffer", pass: GBuffer()),
        (name: "glossy", pass: Classify(of: "gbuffer", which: Glossy)),
        (name: "cache", pass: RecordCache()),
        (name: "splats", pass: Splat(records: "cache", gbuffer: "glossy")),
        (name: "light", pass: Normalize(splats: "splats", gbuffer: "glossy")),
    ],
    outputs: { "picture": "light" },
)"#;

/// A pipeline without records.
const DIRECT: &str = r#"Pipeline(version: 1, about: "direct light", nodes: [(name: "gbuffer", pass: GBuffer()), (name: "direct", pass: DirectLight(gbuffer: "gbuffer"))],
    outputs: { "picture": "direct" })"#;

/// A study, with these words instead of others.
fn study(from: &str, to: &str) -> Vec<u8> {
    let text = "Study(version: 1, about: \"a study\", scene: \"white.ron\", reference: Traced(spp: 4), runs: 1,\n    metric: \"relmse\",\n    cost: PerRecord([\"tiles\"]),\n    rows: [\n        (name: \"rays\", pipeline: \"irradiance\"),\n    ],\n    over: { \"tiles.resolution\": [4, 8] },\n)";
    assert!(text.contains(from), "{from}");
    text.replace(from, to).into_bytes()
}

/// What the cases work on.
fn files() -> BTreeMap<&'static str, Vec<u8>> {
    let exr = |picture: Layers| picture.to_exr().unwrap();
    let grey = || exr(picture(Layer::value(vec![1.0, 2.0])));
    let colour = || Layer::interleaved(&["R", "G", "B"], &[1.0; 6], 3);
    BTreeMap::from([
        ("white.ron", scene("Diffuse(reflectance: (0.5, 0.5, 0.5))").into_bytes()),
        ("glossy.ron", scene("Phong(reflectance: (0.5, 0.5, 0.5), specular: (0.1, 0.1, 0.1), exponent: 10)").into_bytes()),
        ("moving.ron", MOVING.as_bytes().to_vec()),
        ("elsewhere.ron", ELSEWHERE.as_bytes().to_vec()),
        ("lobes.ron", lobes(4)),
        ("grey.exr", grey()),
        ("whole.exr", exr(picture(Layer::value(vec![1.0, 2.0])).with(PICTURE, colour()))),
        ("nameless.exr", parts(&[""], 1.0)),
        ("black.exr", exr(picture(Layer::value(vec![0.0, 0.0])))),
        ("nothing.exr", exr(picture(Layer::value(vec![1.0, 2.0])).with("depth", Layer::value(vec![0.0, 0.0])))),
        ("vectors.exr", exr(picture(Layer::interleaved(&["X", "Y", "Z"], &[1.0; 6], 3)))),
        ("small.exr", exr(Layers::new(1, 1).with("variance", Layer::value(vec![1.0])))),
        ("parts.exr", parts(&["a", "b"], 1.0)),
        ("huge.exr", stating(grey(), 1 << 20, 1 << 20)),
        ("broken.exr", vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0, 9]),
        ("nan.exr", parts(&["only"], f32::NAN)),
        ("side.exr", exr(picture(Layer::value(vec![1.0, 2.0])).with_attribute("camera", "side"))),
        ("windows.exr", exr(picture(Layer::value(vec![1.0, 2.0])).with_attribute("windows", "0,0"))),
        ("left.exr", exr(window("0,0"))),
        ("right.exr", exr(window("64,0"))),
        ("records", b"no header".to_vec()),
        ("direct.ron", DIRECT.as_bytes().to_vec()),
        ("surfaces.ron", SURFACES.as_bytes().to_vec()),
        ("mapped.ron", MAPPED.as_bytes().to_vec()),
        ("runs.ron", study("runs: 1", "runs: 501")),
        ("row.ron", study("Traced(spp: 4)", "Row(\"ray\")")),
        ("both.ron", study("Traced(spp: 4)", "Traced(spp: 4, stride: 2, windows: 1)")),
        ("twice.ron", study("    ],", "        (name: \"rays\", pipeline: \"irradiance-plane\"),\n    ],")),
        ("empty.ron", study("[4, 8]", "[]")),
        ("nowhere.ron", study("[4, 8] },", "[4, 8] },\n    expect: [(row: \"rays\", at: { \"tiles.resolution\": 5 }, within: (0, 1))],")),
        ("metric.ron", study("relmse", "rmse")),
        ("cost.ron", study("PerRecord([\"tiles\"])", "Second")),
        ("node.ron", study("[\"tiles\"]", "[\"tile\", \"records\"]")),
    ])
}

/// A glossy quad under a light that moves.
const MOVING: &str = r#"Scene(version: 1, geometry: [Quad(corners: ((0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0)))],
    materials: { "*": Phong(reflectance: (0.5, 0.5, 0.5), specular: (0.1, 0.1, 0.1), exponent: 10) },
    lights: [Point(position: Linear([(0, (0, 1, 0)), (1, (1, 1, 1))]), intensity: (1, 1, 1))],
    cameras: { "a": (eye: (3, 3, 3), target: (0, 0, 0), fov: 40, size: (8, 8)) })"#;

/// A lightmap is to be asked at places of records.
const MAPPED: &str = r#"Variant(version: 1, about: "a", of: "radiosity-gather.ron",
    add: { "records": [(name: "sum", pass: AddIrradiance(to: "records", at: "misses", field: "field"))] },
    set: { "added.records": "sum" })"#;

/// Records are to be replaced by some of other places.
const ELSEWHERE: &str = r#"Variant(version: 1, about: "a", of: "irradiance-temporal.ron",
    add: { "renew": [(name: "spots", pass: PathVertices(gbuffer: "gbuffer", paths: 64, legs: 1, records: 16))] },
    set: { "renewed.due": "spots" })"#;

/// Code and arguments, one case each, and whether a GPU is needed.
#[rustfmt::skip]
const CASES: [(&str, &str, bool); 87] = [
    ("plan::coarsest", "check irradiance --scene white.ron --set misses.by=Grid(coarsest:3)", false),
    ("plan::finest", "check irradiance --scene white.ron --set misses.by=Grid(finest:3)", false),
    ("plan::light_of_sources", "check photon --scene white.ron --set direct.emitters=Records", false),
    ("plan::emission_twice", "check irradiance-bounces --scene white.ron --set deep_tiles.emission=Auto", false),
    ("plan::curvature", "check irradiance-curvature --scene white.ron --set records.gradients=false", false),
    ("plan::mipmap", "check irradiance-mipmap --scene white.ron --set tiles.resolution=22", false),
    ("plan::raster_shape", "check irradiance-cosine --scene white.ron --set tiles.by=Raster", false),
    ("plan::spacing", "check irradiance --scene white.ron --set cache.minimum_spacing=9 --set cache.maximum_spacing=1", false),
    ("plan::tile", "check irradiance-hemicube --scene white.ron --set tiles.resolution=5", false),
    ("plan::lives", "check irradiance-temporal --scene cube --set cache.lasts=Always", false),
    ("plan::radiance_ahead", "check radiance-temporal --scene moving.ron --set glossy_aged.window=4", false),
    ("plan::slopes_of_radiance", "check radiance-temporal --scene moving.ron --set glossy_renewed.extrapolates=true", false),
    ("plan::halves_that_live", "check radiance-temporal --scene moving.ron --set glossy_cache.coefficients=Half", false),
    ("plan::slots", "check elsewhere.ron --scene cube", false),
    ("plan::taps", "check irradiance --scene corner --set shadow.taps=5", false),
    ("plan::glossy", "check irradiance --scene glossy.ron --strict", false),
    ("plan::lobes", "check surfaces.ron --scene glossy.ron", false),
    ("plan::harmonics", "check radiance --scene glossy.ron --set lobes.harmonics=Spherical", false),
    ("plan::lobes_on_device", "check environment --scene teapot-overcast --set lobes.place=Device", false),
    ("plan::lobe_tables", "check radiance --scene lobes.ron --set lobes.grid=128 --set lobes.order=Fixed(order:20)", false),
    ("plan::place", "check irradiance-plane --scene cornell --set tiles.place=Host", false),
    ("plan::too_sharp", "check radiance --scene glossy.ron --set lobes.order=Fixed(order:2) --set lobes.too_sharp=Refuse", false),
    ("plan::lobes_left", "check radiance --scene glossy.ron --set glossy.which=Glossy", false),
    ("plan::coefficients", "check radiance --scene glossy.ron --set glossy_added.records=\"glossy_sums\"", false),
    ("plan::filtered_radiance", "check radiance --scene glossy.ron --set filtered.records=\"glossy_added\"", false),
    ("plan::errors", "check irradiance --scene white.ron --set filtered_splats.of=StandardError", false),
    ("plan::errors_of_radiance", "check radiance --scene glossy.ron --set reflections.of=StandardError", false),
    ("plan::lightmap_bytes", "check radiosity --scene white.ron --set lightmap.resolution=2048", false),
    ("plan::lightmap_places", "check mapped.ron --scene white.ron", false),
    ("plan::near_rays", "check radiosity --scene white.ron --set near.rays=50", false),
    ("plan::views", "check radiosity-hemicube --scene white.ron --set shooters.shooters=256 --set views.resolution=256", false),
    ("cli::unknown_pass", "passes Splatt", false),
    ("cli::not_shipped", "pipelines iradiance", false),
    ("cli::exists", "new scene white", false),
    ("cli::bad_name", "new scene rooms/a*b", false),
    ("cli::no_checkout", "new pass Tint", false),
    ("cli::unknown_camera", "explain irradiance --scene white.ron --camera c", false),
    ("cli::target_in_eye", "explain irradiance --scene white.ron --eye 1,2,3 --target 1,2,3", false),
    ("cli::up_along_view", "explain irradiance --scene white.ron --eye 0,3,0 --target 0,0,0 --up 0,2,0", false),
    ("cli::nameless_layer", "diff whole.exr nameless.exr", false),
    ("cli::several_bounces", "compare irradiance irradiance-bounces --scene white.ron", false),
    ("cli::other_view", "compare irradiance --scene white.ron --reference side.exr", false),
    ("cli::several_cameras", "explain irradiance --scene white.ron --camera a --camera b", false),
    ("cli::write", "reference --scene white.ron --spp 4 --quiet -o white.ron/out.exr", false),
    ("cli::unknown_format", "reference --scene white.ron -o picture.gif", false),
    ("cli::no_sequence", "render irradiance --scene cornell -o film.apng", false),
    ("cli::no_picture", "render irradiance --scene cornell --frames 0..2 -o film.apng --dump cache", false),
    ("reference::size", "reference --scene white.ron --size 16384x16384 -o out.exr", false),
    ("reference::samples", "reference --scene white.ron --spp 0 -o out.exr", false),
    ("reference::windows", "reference --scene white.ron --size 130x70 --windows 3 -o out.exr", false),
    ("measure::windows", "diff grey.exr windows.exr", false),
    ("measure::no_common_window", "diff left.exr right.exr", false),
    ("study::stride_and_windows", "study both.ron --dry-run", false),
    ("reference::error", "reference --scene white.ron --error 0 -o out.exr", false),
    ("measure::black_reference", "diff grey.exr black.exr", false),
    ("measure::no_surface", "diff grey.exr nothing.exr", false),
    ("measure::not_a_picture", "diff vectors.exr grey.exr", false),
    ("measure::corrupt_exr", "diff broken.exr grey.exr", false),
    ("measure::several_parts", "diff parts.exr grey.exr", false),
    ("measure::non_finite", "diff nan.exr:picture grey.exr:irradiance", false),
    ("measure::corrupt_picture", "diff white.ron grey.exr", false),
    ("measure::too_large", "diff huge.exr grey.exr", false),
    ("measure::variance_size", "diff grey.exr grey.exr --variance small.exr", false),
    ("compare::not_judged", "compare irradiance --scene white.ron --picture a=nothing.exr:depth", false),
    ("compare::no_pipeline", "compare irradiance @tiles.resolution=8 --scene white.ron", false),
    ("study::not_swept", "study weights --over tiles.resolution=8 -o out", false),
    ("sweep::same_parameter", "sweep irradiance --scene white.ron --over cache.accuracy=0.1 --over cache.accuracy=0.2 --dry-run", false),
    ("sweep::same_pipeline", "sweep irradiance --scene white.ron --over cache.accuracy=0.1,0.10 --dry-run", false),
    ("sweep::too_many", "sweep irradiance --scene white.ron --over a.a=1,2,3,4,5,6,7,8,9,10,11 --over b.b=1,2,3,4,5,6,7,8,9,10 --over c.c=1,2,3,4,5,6,7,8,9,10 --dry-run", false),
    ("sweep::refused", "sweep irradiance --scene white.ron --set tiles.shape=Hemicube --over tiles.resolution=8,9 --dry-run", false),
    ("study::not_found", "study weihgts --dry-run", false),
    ("study::not_a_study", "study white.ron --dry-run", false),
    ("study::out_of_range", "study runs.ron --dry-run", false),
    ("study::unknown_row", "study row.ron --dry-run", false),
    ("study::duplicate_row", "study twice.ron --dry-run", false),
    ("study::empty", "study empty.ron --dry-run", false),
    ("study::no_point", "study nowhere.ron --dry-run", false),
    ("study::unknown_metric", "study metric.ron --dry-run", false),
    ("study::cost", "study cost.ron --dry-run", false),
    ("study::unknown_node", "study node.ron --dry-run", false),
    ("gpu::no_adapter", "render irradiance --scene white.ron --quiet -o out.exr", false),
    ("render::cache", "render irradiance --scene white.ron --quiet -o out.exr --cache records", true),
    ("render::no_records", "render direct.ron --scene white.ron --quiet -o out.exr --cache new", true),
    ("render::resumed_movie", "render irradiance --scene cornell --frames 0..2 --cache new --resume -o film.apng", false),
    ("render::incomplete", "render irradiance --scene white.ron --quiet -o out.exr --strict --set misses.at_most=1", true),
    ("cli::nothing_to_watch", "render irradiance --scene cornell --watch --quiet -o out.exr", false),
    ("render::other_plan", "render irradiance --scene white.ron --quiet -o out.exr --set-frames tiles.resolution=8,16", false),
];

fn run(folder: &Path, code: &str, arguments: &str) -> (i32, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hemisplat"));
    command.current_dir(folder).args(arguments.split(' ')).env_remove("NO_COLOR").env_remove("HEMISPLAT_SCENES");
    if code == "gpu::no_adapter" {
        command.env("WGPU_BACKEND", "gl");
    }
    let output = command.output().unwrap();
    (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
}

fn main() {
    let gpu = Missing::gpu();
    let mut trials = vec![
        holds("each_case_has_its_code_and_its_words", None, || each_has_its_code_and_its_words(|_, needs_gpu| !needs_gpu)),
        holds("every_code_has_a_snapshot_or_a_reason", None, every_code_has_a_snapshot_or_a_reason),
        holds("codes_are_found_where_they_stand", None, codes_are_found_where_they_stand),
    ];
    trials.extend(CASES.into_iter().filter(|(.., needs_gpu)| *needs_gpu).map(|(code, ..)| {
        let name = format!("{code} has its words");
        holds(name, gpu.as_ref(), move || each_has_its_code_and_its_words(|other, needs_gpu| needs_gpu && other == code))
    }));
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

fn each_has_its_code_and_its_words(wanted: impl Fn(&str, bool) -> bool) {
    let folder = tempfile::tempdir().unwrap();
    for (name, contents) in files() {
        fs::write(folder.path().join(name), contents).unwrap();
    }
    for (code, arguments, _) in CASES.into_iter().filter(|(code, _, needs_gpu)| wanted(code, *needs_gpu)) {
        let (status, message) = run(folder.path(), code, arguments);
        assert!(status > 0 && message.starts_with(code), "{arguments}: status {status}\n{message}");
        insta::assert_snapshot!(code.replace("::", "__"), format!("status {status}\n{message}"));
    }
}

/// All text files below a folder with this ending.
fn texts(folder: &str, ending: &str) -> Vec<String> {
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join(folder)];
    let mut texts = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|found| found == ending) {
                texts.push(fs::read_to_string(path).unwrap());
            }
        }
    }
    texts
}

/// The code that a text begins with: two words joined by colons, with `end` after them.
fn code_before(text: &str, end: char) -> Option<String> {
    let (code, _) = text.split_once(end)?;
    let (family, name) = code.split_once("::")?;
    let is_word = |word: &str| !word.is_empty() && word.chars().all(|c| c.is_ascii_lowercase() || c == '_');
    (is_word(family) && is_word(name)).then(|| code.to_owned())
}

/// Every code that the sources name, in an attribute or as a text.
fn codes(source: &str) -> Vec<String> {
    let after = |opening: &'static str, end: char| source.match_indices(opening).filter_map(move |(at, _)| code_before(&source[at + opening.len()..], end));
    after("code(", ')').chain(after("\"", '"')).collect()
}

fn every_code_has_a_snapshot_or_a_reason() {
    let codes: BTreeSet<String> = ["src", "passes"].iter().flat_map(|folder| texts(folder, "rs")).flat_map(|source| codes(&source)).collect();
    assert!(codes.len() > 80, "{codes:?}");
    let snapshots = [texts("tests", "snap"), texts("src", "snap")].concat();
    let shown: BTreeSet<String> = snapshots.iter().flat_map(|text| text.lines()).filter_map(|line| code_before(&format!("{} ", line.trim()), ' ')).collect();
    let excused: BTreeSet<String> = BEYOND_INPUT.iter().map(|(code, _)| code.to_string()).collect();
    let missing: Vec<_> = codes.iter().filter(|code| !shown.contains(*code) && !excused.contains(*code)).collect();
    assert!(missing.is_empty(), "no case brings about {missing:?}");
    let idle: Vec<_> = excused.iter().filter(|code| !codes.contains(*code) || shown.contains(*code)).collect();
    assert!(idle.is_empty(), "no excuse is needed for {idle:?}");
}

fn codes_are_found_where_they_stand() {
    let source = "#[diagnostic(code(cli::read), help(\"x\"))] Problem::new(\"plan::tile\", y); \"a text: b::c d\"; f(\"std::Fs\")";
    assert_eq!(codes(source), ["cli::read", "plan::tile"]);
}
