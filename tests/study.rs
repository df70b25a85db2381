//! `hemisplat study` from outside: what a study's file says is measured, told and kept; options change it; mistakes are told at their place.
//!
//! Needs a GPU adapter, a software one will do; without one each case is named as skipped, which
//! `HEMISPLAT_REQUIRE=gpu` makes a failure.

mod place;

use hemisplat::contract::encoder::Setting;
use hemisplat::gpu::scene::kind;
use hemisplat::measure::study::embedded::EMBEDDED;
use hemisplat::measure::traffic::{Traffic, traffic};
use hemisplat::passes::REGISTRY;
use hemisplat::pipeline;
use hemisplat::scene::{load, needs::Needs};
use libtest_mimic::{Arguments, Failed};
use place::{Case, Outcome, Place, check};
use serde_json::Value;
use std::path::Path;
use std::{fs, io};

const DRAWN: &[(&str, Case)] = &[
    ("a_study_is_measured_and_told_as_its_file_says", told),
    ("options_change_a_study_and_costs_need_no_new_runs", changed),
    ("rows_and_values_can_be_chosen", chosen),
    ("a_row_judges_the_others_also_after_a_stop", judged),
    ("pipelines_and_scenes_stand_beside_a_study", beside),
    ("small_versions_of_studies_find_what_they_expect", small),
    ("what_a_study_expects_is_told_and_what_it_misses_fails", expected),
];

const REFUSED: &[(&str, Case)] =
    &[("studies_that_ship_can_be_planned", shipped), ("sums_move_the_bytes_that_their_ways_say", moved), ("mistakes_are_told_before_work_starts", mistakes)];

fn main() {
    place::run(&Arguments::from_args(), DRAWN, REFUSED);
}

/// A study of two rows and two values.
const SMALL: &str = r#"Study(
    version: 1,
    about: "Raster against rays",
    scene: "cornell",
    size: (24, 18),
    reference: Traced(spp: 16),
    runs: 2,
    metric: "rms_of_relative",
    cost: PerRecord(["tiles", "records"]),
    set: { "cache.accuracy": 0.4 },
    rows: [
        (name: "a plane | raster", pipeline: "irradiance-plane"),
        (name: "rays", pipeline: "irradiance", set: { "cache.accuracy": 0.5 }),
    ],
    over: { "tiles.resolution": [4, 8] },
)"#;

impl Place {
    fn with(files: &[(&str, &str)]) -> Result<Self, Failed> {
        let place = Self::new()?;
        files.iter().try_for_each(|(name, text)| fs::write(place.0.path().join(name), text))?;
        Ok(place)
    }

    fn text(&self, name: &str) -> Result<String, Failed> {
        Ok(fs::read_to_string(self.0.path().join(name))?)
    }
}

/// Each of the studies in tests/studies. `HEMISPLAT_TOLD=1 cargo test --test study small -- --nocapture` prints what is found, for new expectations.
fn small() -> Outcome {
    let place = Place::new()?;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/studies");
    let mut found = 0;
    for entry in fs::read_dir(&folder)? {
        let path = entry?.path();
        let (status, text, told) = place.run(&format!("study {} -o kept-{found} --quiet", path.display()))?;
        if std::env::var_os("HEMISPLAT_TOLD").is_some() {
            println!("{text}");
        }
        check(status == 0, || format!("{}: {told}{text}", path.display()))?;
        found += 1;
    }
    check(found == 5, || format!("{found} studies"))
}

/// A study with what it expects: one thing that comes, one quotient, one cost, one thing that does not come.
fn expected() -> Outcome {
    let expectations = r#"    expect: [
        (row: "rays", at: { "tiles.resolution": 8 }, within: (0.001, 10), paper: 100),
        (row: "rays", at: { "tiles.resolution": 8 }, of: "irradiance.relmse", over: "a plane | raster", within: (0.01, 100), paper: Below(1000)),
        (row: "rays", at: { "tiles.resolution": 4 }, of: Cost, within: (0, 1e9)),
        (row: "rays", at: { "tiles.resolution": 4 }, within: (50, 60), paper: 1e-6),
    ],
)"#;
    let text = SMALL.strip_suffix(')').unwrap_or(SMALL).to_owned() + expectations;
    let place = Place::with(&[("study.ron", &text)])?;
    let arguments = "study study.ron -o kept --json out.json --markdown out.md --html out.html";
    let (status, _, told) = place.run(arguments)?;
    check(status == 1 && told.contains("study::unexpected") && told.contains("of rays tiles.resolution=4 is") && told.contains("not 5000 %"), || told.clone())?;
    let found = place.json("out.json")?["expected"].clone();
    let came: Vec<Option<bool>> = found.as_array().into_iter().flatten().map(|found| found["as_expected"].as_bool()).collect();
    check(came == [Some(true), Some(true), Some(true), Some(false)], || found.to_string())?;
    check(found[0]["verdict"] == "better" && found[3]["verdict"] == "differs" && found[1]["verdict"] == "agrees" && found[2]["verdict"].is_null(), || {
        found.to_string()
    })?;
    check(found[0]["value"].as_f64() == Some(error(&points(&place.json("out.json")?)?[3])), || found.to_string())?;
    let table = place.text("out.md")?;
    check(table.contains("the source says |") && table.contains(" better |") && table.contains(" NO |") && table.contains(" less than 1000 |"), || {
        table.clone()
    })?;
    let page = &place.page("out.html")?["report"];
    let rows: Vec<Vec<String>> = serde_json::from_value(page["expectations"].clone())?;
    let told: Vec<&str> = rows.iter().filter_map(|row| row.get(3)).map(String::as_str).collect();
    check(told == ["", "yes", "yes", "yes", "NO"] && page["sweep"]["expected"] == found, || page["expectations"].to_string())?;
    check(rows.iter().flatten().all(|cell| table.contains(&cell.replace('|', "\\|"))), || format!("the page and the table differ: {rows:?}"))?;
    // Of another view nothing is expected; of values that are left out nothing is known.
    let (status, _, told) = place.run("study study.ron -o other --size 20x15")?;
    check(status == 0 && told.contains("it is not checked here"), || told.clone())?;
    let (status, _, told) = place.run("study study.ron -o kept --over tiles.resolution=8 --json less.json")?;
    check(status == 0 && place.json("less.json")?["expected"][3]["as_expected"].is_null(), || told)
}

fn points(json: &Value) -> Result<&Vec<Value>, Failed> {
    Ok(json["points"].as_array().ok_or("no points")?)
}

fn error(point: &Value) -> f64 {
    point["errors"]["irradiance"]["rms_of_relative"].as_f64().unwrap_or(f64::NAN)
}

/// Milliseconds a record in `tiles` and `records`.
fn cost(point: &Value) -> f64 {
    let passes = point["passes"].as_array().into_iter().flatten();
    let counted = passes.filter(|pass| pass["node"] == "tiles" || pass["node"] == "records");
    let ms: f64 = counted.map(|pass| pass["gpu_ms"].as_f64().unwrap_or(f64::NAN) + pass["cpu_ms"].as_f64().unwrap_or(f64::NAN)).sum();
    ms / point["records"]["irradiance"].as_f64().unwrap_or(f64::NAN)
}

/// The number at the beginning of a cell, which an interval may follow.
fn number(cell: &str) -> Option<f64> {
    cell.split(' ').next()?.parse().ok()
}

/// The cells of the row with this name, of each table that has one.
fn cells(markdown: &str, name: &str) -> Vec<Vec<f64>> {
    let rows = markdown.lines().map(|line| line.replace("\\|", "/").split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>());
    let named = rows.filter(|cells| cells.get(1).is_some_and(|first| first == name));
    named.map(|cells| cells[2..cells.len() - 1].iter().map(|cell| number(cell).unwrap_or(f64::NAN)).collect()).collect()
}

/// Without the adapter, what was measured and the widths of columns. What is best depends on the machine: one row stands for all of the front.
fn masked(markdown: &str, adapter: &str) -> String {
    let told = |cell: &str| if number(cell.trim_matches([' ', '|'])).is_some() { "#".to_owned() } else { cell.to_owned() };
    let cells = |line: &str| line.split(" | ").map(str::trim).map(told).collect::<Vec<_>>();
    let line = |line: &str| match line {
        rule if rule.starts_with("| -") => "|-|".to_owned(),
        head if head.contains(" \\ ") => head.split_whitespace().collect::<Vec<_>>().join(" "),
        _ => cells(line).join(" | "),
    };
    let mut lines: Vec<String> = markdown.lines().map(|text| line(&text.replace(adapter, "ADAPTER"))).collect();
    let front = lines.iter().position(|line| line.starts_with("| nothing beats")).map_or(lines.len(), |at| at + 2);
    lines.truncate(front);
    lines.join("\n")
}

fn near(told: &[f64], values: &[f64]) -> bool {
    told.len() == values.len() && told.iter().zip(values).all(|(told, value)| (told - value).abs() <= 0.006 * value.abs())
}

fn told() -> Outcome {
    let place = Place::with(&[("small.ron", SMALL)])?;
    let (text, stderr) = place.succeed("study small.ron -o out --json a.json --csv a.csv --svg a.svg --markdown a.md --html a.html")?;
    check(stderr.contains("4 points: 0 found in out, 0 refused, 4 to measure"), || stderr.clone())?;
    let (json, markdown) = (place.json("a.json")?, place.text("a.md")?);
    let points = points(&json)?;
    check(json["size"] == serde_json::json!([24, 18]) && json["runs"] == 2 && json["complete"] == true && points.len() == 4, || json.to_string())?;
    check(points[2]["row"] == "rays" && points[2]["set"] == serde_json::json!(["cache.accuracy=0.4", "cache.accuracy=0.5", "tiles.resolution=4"]), || {
        points[2].to_string()
    })?;
    for (name, pair) in ["a plane / raster", "rays"].into_iter().zip(points.chunks(2)) {
        let tables = cells(&markdown, name);
        let [errors, costs] = &tables[..] else { return Err(format!("{name} stands in {} tables\n{markdown}", tables.len()).into()) };
        let expected = |of: fn(&Value) -> f64, factor: f64| pair.iter().map(|point| factor * of(point)).collect::<Vec<_>>();
        check(near(errors, &expected(error, 100.0)) && near(costs, &expected(cost, 1.0)), || format!("{errors:?} {costs:?}\n{markdown}"))?;
    }
    fronts(points, &markdown)?;
    insta::assert_snapshot!("markdown", masked(&markdown, json["adapter"]["name"].as_str().ok_or("no adapter")?));
    check(text.ends_with(&markdown) && text.contains("rays tiles.resolution=8"), || text.clone())?;
    let csv = place.text("a.csv")?;
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let at = reader.headers()?.iter().position(|name| name == "ms_per_record").ok_or("no ms_per_record")?;
    let told: Vec<f64> = reader.records().map(|row| Ok(row?[at].parse()?)).collect::<Result<_, Failed>>()?;
    check(near(&told, &points.iter().map(cost).collect::<Vec<_>>()), || csv.clone())?;
    let page = &place.page("a.html")?["report"];
    let costs: Vec<f64> = page["costs"].as_array().ok_or("no costs")?.iter().filter_map(Value::as_f64).collect();
    check(page["sweep"] == json && near(&costs, &points.iter().map(cost).collect::<Vec<_>>()), || page["costs"].to_string())?;
    check(page["charts"][0]["wide"] == place.text("a.svg")?, || "the page has another plot".into())?;
    check(place.text("a.svg")?.contains("ms a record in tiles, records"), || "the plot's axis is another cost".into())
}

/// What the last table lists is what no other point beats in cost and error.
fn fronts(points: &[Value], markdown: &str) -> Outcome {
    let end = |point: &Value, end: &str| point["errors"]["irradiance"]["intervals"]["rms_of_relative"][end].as_f64().unwrap_or(f64::NAN);
    let clearly_beaten = |point: &Value| points.iter().any(|other| cost(other) < cost(point) && end(other, "high") < end(point, "low"));
    check(points.iter().any(|point| point["pareto"] == true), || markdown.to_owned())?;
    for point in points {
        let name = format!(
            "{} tiles.resolution={}",
            point["row"].as_str().unwrap_or("?").replace('|', "/"),
            point["values"]["tiles.resolution"].as_str().unwrap_or("?")
        );
        let listed = cells(markdown, &name);
        check(listed.is_empty() == (point["pareto"] == false) && !(clearly_beaten(point) && point["pareto"] == true), || format!("{point}\n{markdown}"))?;
        check(listed.iter().all(|cells| near(cells, &[cost(point), 100.0 * error(point)])), || markdown.to_owned())?;
    }
    Ok(())
}

fn changed() -> Outcome {
    let place = Place::with(&[("small.ron", SMALL)])?;
    let changes = "--size 12x12 --runs 1 --reference-spp 4";
    place.succeed(&format!("study small.ron {changes} -o out --json a.json"))?;
    let json = place.json("a.json")?;
    check(json["size"] == serde_json::json!([12, 12]) && json["runs"] == 1 && json["reference"]["samples"] == "4", || json.to_string())?;
    let (_, stderr) =
        place.succeed(&format!("study small.ron {changes} --cost Records --metric rmse_over_mean -o out --svg b.svg --markdown b.md --html b.html"))?;
    check(stderr.contains("4 found"), || stderr)?;
    let records: Vec<f64> = points(&json)?[..2].iter().map(|point| point["records"]["irradiance"].as_f64().unwrap_or(f64::NAN)).collect();
    let (markdown, svg) = (place.text("b.md")?, place.text("b.svg")?);
    check(near(&cells(&markdown, "a plane / raster")[1], &records) && svg.contains(">records<") && svg.contains("rmse_over_mean"), || markdown)?;
    check(place.page("b.html")?["report"]["costs"].as_array().is_some_and(Vec::is_empty), || "records are told twice".into())?;
    let (_, stderr) = place.succeed(&format!("study small.ron --scene corner {changes} -o out --json c.json"))?;
    check(stderr.contains("0 found") && place.json("c.json")?["scene"] == "corner", || stderr)
}

/// Some of the rows, at other values; the row that judges stays.
fn chosen() -> Outcome {
    let small = SMALL.replace("a plane | raster", "raster");
    let place = Place::with(&[("small.ron", &small), ("judged.ron", &small.replace("Traced(spp: 16)", "Row(\"rays\")"))])?;
    for (study, rows) in [("small", &["raster"][..]), ("judged", &["raster", "rays"])] {
        place.succeed(&format!("study {study}.ron --row raster --over tiles.resolution=6 -o {study} --json a.json"))?;
        let json = place.json("a.json")?;
        let found: Vec<_> = points(&json)?.iter().map(|point| [&point["row"], &point["values"]["tiles.resolution"]]).collect();
        check(found == rows.iter().map(|row| [*row, "6"]).collect::<Vec<_>>(), || format!("{found:?}"))?;
        check(error(&points(&json)?[0]) > 0.0, || json.to_string())?;
    }
    let (status, _, stderr) = place.run("study small.ron --row ray -o out")?;
    check(status == 2 && stderr.contains("study::unknown_row") && stderr.contains("did you mean `rays`"), || stderr)?;
    let (status, _, stderr) = place.run("study small.ron --over tiles.shape=Cosine -o out")?;
    check(status == 2 && stderr.contains("study::not_swept") && stderr.contains("tiles.resolution"), || stderr)
}

fn judged() -> Outcome {
    let by_row = SMALL.replace("Traced(spp: 16)", "Row(\"rays\")");
    let place = Place::with(&[("judged.ron", &by_row)])?;
    let study = |name: &str| place.succeed(&format!("study judged.ron -o out --json {name}.json --html {name}.html"));
    study("a")?;
    let first = place.json("a.json")?;
    let errors: Vec<f64> = points(&first)?.iter().map(error).collect();
    let judges = &points(&first)?[2..];
    check(
        errors[..2].iter().all(|error| *error > 0.0)
            && judges.iter().all(|point| point["errors"]["irradiance"].is_null())
            && first["reference"]["row"] == "rays",
        || first.to_string(),
    )?;
    for (resolution, expected) in [(4, errors[0]), (8, errors[1])] {
        let render = |pipeline: &str, accuracy: f64| {
            place.succeed(&format!(
                "render {pipeline} --scene cornell --size 24x18 --set cache.accuracy={accuracy} --set tiles.resolution={resolution} -o {pipeline}.exr"
            ))
        };
        render("irradiance-plane", 0.4)?;
        render("irradiance", 0.5)?;
        place.succeed("diff irradiance-plane.exr:irradiance irradiance.exr:irradiance --json diff.json")?;
        let found = place.json("diff.json")?["rms_of_relative"].as_f64();
        check(found == Some(expected), || format!("{resolution}: {found:?} by diff, {expected} by the study"))?;
    }
    // One point is lost: its row is measured against pictures that have to be made again.
    let lost = fs::read_dir(place.0.path().join("out"))?.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>, Failed>>()?;
    let lost = lost.iter().find(|path| fs::read_to_string(path).is_ok_and(|text| text.contains("cache.accuracy=0.4\",\n    \"tiles.resolution=4\"")));
    fs::remove_file(lost.ok_or("no file of the first point")?)?;
    let gallery = &place.page("a.html")?["gallery"]["frames"][0];
    let (_, stderr) = study("b")?;
    check(stderr.contains("3 found"), || stderr)?;
    check(gallery == &place.page("b.html")?["gallery"]["frames"][0], || "the pictures of a study that went on differ".into())?;
    // Each picture is mapped against that of the judging row at the same value, which has no map itself.
    let maps = &gallery["maps"][0]["images"];
    check(maps[0].is_object() && maps[1].is_object() && maps[0] != maps[1] && maps[2].is_null() && maps[3].is_null(), || maps.to_string())?;
    let shown = &gallery["shown"][0];
    check(shown["reference"].is_null() && shown["images"].as_array().is_some_and(|pictures| pictures.iter().all(Value::is_object)), || shown.to_string())?;
    let again = place.json("b.json")?;
    check(points(&again)?.iter().map(error).take(2).collect::<Vec<_>>() == errors[..2], || again.to_string())
}

fn beside() -> Outcome {
    let place = Place::with(&[])?;
    let folder = place.0.path().join("lab");
    fs::create_dir(&folder)?;
    let study = SMALL.replace("\"irradiance-plane\"", "\"mine.ron\"").replace("\"cornell\"", "\"box.ron\"");
    let variant = r#"Variant(version: 1, about: "mine", of: "irradiance.ron", set: { "records.gradients": false })"#;
    let scene = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.ron"))?;
    for (name, text) in [("study.ron", study.as_str()), ("mine.ron", variant), ("box.ron", scene.as_str())] {
        fs::write(folder.join(name), text)?;
    }
    place.succeed("study lab/study.ron --runs 1 -o out --json a.json")?;
    let json = place.json("a.json")?;
    check(json["scene"] == "box" && json["points"][0]["pipeline"] == "lab/mine.ron" && json["points"][2]["pipeline"] == "irradiance", || json.to_string())
}

/// Without geometry that does not ship, and small.
fn shipped() -> Outcome {
    let place = Place::new()?;
    for (file, _) in EMBEDDED {
        let (text, stderr) = place.succeed(&format!("study {file} --scene corner --size 101x101 --dry-run"))?;
        check(text.lines().count() > 5 && !text.contains("refused"), || format!("{file}\n{text}{stderr}"))?;
    }
    Ok(())
}

/// What the node `records` moves for each tile of this many samples along an edge.
fn traffic_of(pipeline: &str, resolution: u32, set: &str) -> Result<Traffic, Failed> {
    let sets: Vec<String> = [format!("tiles.resolution={resolution}"), "fill.order=Batched(at_most: 32)".into()]
        .into_iter()
        .chain((!set.is_empty()).then(|| set.to_owned()))
        .collect();
    let told = |problems: pipeline::Problems| format!("{:?}", problems.0);
    let pipeline = pipeline::load(pipeline, &sets, REGISTRY, &mut |_| Err(io::ErrorKind::NotFound.into())).map_err(told)?;
    let scene = load::load(Path::new("corner"), &load::LoadOptions::default()).map_err(|error| error.to_string())?;
    let needs = Needs::of(&scene);
    let setting = Setting { scene: &scene, needs: &needs, device: hemisplat::schedule::Device::ABLE, size: [32, 24], tables: None };
    let plan = pipeline::plan(&pipeline, setting, &[], &kind).map_err(told)?;
    Ok(traffic(&plan, &["records"]).map_err(|error| error.to_string())?.ok_or("no tiles")?)
}

/// A sample is 16 bytes, seven parts of it 112 or as halves 56, a request 48 and a record 160.
fn moved() -> Outcome {
    let [request, record] = [48.0, 160.0];
    let pyramid = |of: f64| (0..4).map(|level| of * 64.0 / f64::from(1 << (2 * level))).collect::<Vec<_>>();
    let sum = |levels: &[f64]| levels.iter().sum::<f64>();
    let [single, half] = [112.0, 56.0].map(pyramid);
    let cases = [
        ("irradiance-one-rate", 8, "", [1024.0 + request, record, 0.0]),
        ("irradiance-readback", 8, "", [0.0, record, 1024.0 + request]),
        ("irradiance-mipmap", 8, "", [1024.0 + request + sum(&single) + request, sum(&single) + record, 0.0]),
        // Each tile's exposure is found in a look at all samples, and read by the first step and the last.
        ("irradiance-mipmap", 8, "records.by.storage=F16", [2048.0 + request + sum(&half) + request + 8.0, 4.0 + sum(&half) + record, 0.0]),
        ("irradiance-ping-pong", 8, "", [1024.0 + request + single[0], 2.0 * single[0] + record, single[0] + request]),
        // Halved once, what is left is 16×16: the larger image is written to in full, the smaller one is read twice.
        ("irradiance-ping-pong", 32, "", [16384.0 + request + 114688.0 + 28672.0, 114688.0 + 2.0 * 28672.0 + record, 28672.0 + request]),
        ("irradiance-ping-pong", 64, "", [65536.0 + request + 458752.0 + 114688.0 + 28672.0, 458752.0 + 114688.0 + 2.0 * 28672.0 + record, 28672.0 + request]),
    ];
    for (pipeline, resolution, set, expected) in cases {
        let Traffic { read_bytes, written_bytes, read_back_bytes } = traffic_of(pipeline, resolution, set)?;
        let found = [read_bytes, written_bytes, read_back_bytes];
        check(found == expected, || format!("{pipeline} {resolution} {set}: {found:?}, expected {expected:?}"))?;
    }
    Ok(())
}

fn mistakes() -> Outcome {
    let cases = [
        ("rows: [", "rwos: [", "document::unknown_key", "did you mean `rows`"),
        ("version: 1", "version: 2", "document::version", "version 1 is known"),
        ("Study(", "Pipeline(", "study::not_a_study", "expected a study"),
        ("runs: 2", "runs: 0", "study::out_of_range", "from 1 to 500"),
        ("size: (24, 18)", "size: 24", "document::wrong_type", "(640, 480)"),
        ("spp: 16", "stride: 2", "document::missing_key", "`spp` is missing"),
        ("rms_of_relative", "rms_of_relativ", "study::unknown_metric", "rms_of_relative"),
        ("PerRecord", "PerRecrod", "study::cost", "did you mean `PerRecord`"),
        ("\"tiles\", \"records\"", "\"tilse\"", "study::unknown_node", "did you mean `tiles`"),
        ("\"rays\"", "\"a plane | raster\"", "study::duplicate_row", "first here"),
        ("Traced(spp: 16)", "Row(\"ray\")", "study::unknown_row", "did you mean `rays`"),
        ("[4, 8]", "[]", "study::empty", "nothing is here"),
        ("{ \"tiles.resolution\": [4, 8] }", "{}", "study::empty", "nothing is here"),
        ("[4, 8]", "[4, 4]", "sweep::same_pipeline", "tiles.resolution=4"),
        ("[4, 8]", "[4], \"tiles.resolution\": [8]", "sweep::same_parameter", "again here"),
        ("[4, 8]", "[4, 1000]", "pipeline::out_of_range", "[4, 1000]"),
        ("\"tiles.resolution\":", "\"tiles.resolutoin\":", "pipeline::unknown_parameter", "did you mean `resolution`"),
        ("\"irradiance-plane\"", "\"irradiance-plain\"", "pipeline::not_found", "named here"),
        ("\"cache.accuracy\": 0.5", "\"cahce.accuracy\": 0.5", "pipeline::unknown_node", "did you mean `cache`"),
    ];
    let place = Place::new()?;
    for (from, to, code, words) in cases {
        check(SMALL.contains(from), || from.to_owned())?;
        fs::write(place.0.path().join("wrong.ron"), SMALL.replacen(from, to, 1))?;
        let (status, stdout, stderr) = place.run("study wrong.ron -o out")?;
        check(status == 2 && stdout.is_empty(), || format!("{to}: status {status}\n{stdout}{stderr}"))?;
        check(stderr.contains(code) && stderr.contains(words), || format!("{to}: {code}, {words}\n{stderr}"))?;
        check(code == "sweep::same_pipeline" || stderr.contains("wrong.ron:"), || format!("{to}: no place\n{stderr}"))?;
    }
    let (status, _, stderr) = place.run("study compensatoin -o out")?;
    check(status == 2 && stderr.contains("study::not_found") && stderr.contains("did you mean `compensation.ron`"), || stderr)?;
    check(!place.0.path().join("out").exists(), || "a mistake leaves a folder".into())
}
