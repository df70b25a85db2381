//! `hemisplat sweep` from outside: what it finds, what it keeps, where it goes on, what it refuses.
//!
//! Needs a GPU adapter, a software one will do; without one each case is named as skipped, which
//! `HEMISPLAT_REQUIRE=gpu` makes a failure.

mod place;

use libtest_mimic::{Arguments, Failed};
use place::{Case, Outcome, Place, check};
use serde_json::Value;
use std::path::PathBuf;
use std::process::{Child, Command};
use std::time::{Duration, Instant};
use std::{fs, thread};

const DRAWN: &[(&str, Case)] = &[
    ("a_grid_is_measured_and_told_as_json_csv_and_svg", grid),
    ("errors_are_those_of_compare_and_a_sweep_done_is_not_measured_again", repeated),
    ("a_point_of_a_sequence_has_the_errors_of_its_frames_in_the_mean", sequences),
    ("what_the_numbers_depend_on_makes_other_points", keys),
    ("what_the_reference_hides_is_told_as_a_limit", hidden),
    ("a_killed_sweep_goes_on_with_whole_points", killed),
    ("an_interrupted_sweep_tells_what_it_has", interrupted),
    ("a_refused_point_does_not_stop_the_others", refused),
    ("a_damaged_point_is_measured_anew", damaged),
    ("a_page_holds_every_point_and_is_the_same_when_made_again", page),
];

const REFUSED: &[(&str, Case)] = &[("mistakes_are_told_before_work_starts", mistakes), ("a_dry_run_lists_the_points", dry_run)];

fn main() {
    place::run(&Arguments::from_args(), DRAWN, REFUSED);
}

impl Place {
    fn text(&self, name: &str) -> Result<String, Failed> {
        Ok(fs::read_to_string(self.0.path().join(name))?)
    }

    /// Files of points in `out`, each of them whole, its picture beside it.
    fn kept(&self) -> Result<Vec<PathBuf>, Failed> {
        let Ok(entries) = fs::read_dir(self.0.path().join("out")) else { return Ok(Vec::new()) };
        let paths = entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<Vec<_>, _>>()?;
        let is_point = |path: &PathBuf| {
            path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("point-")) && path.extension().is_some_and(|ending| ending == "json")
        };
        let mut points: Vec<PathBuf> = paths.into_iter().filter(is_point).collect();
        points.sort();
        for point in &points {
            let json: Value = serde_json::from_slice(&fs::read(point)?)?;
            check(json["measured"]["seconds_of_runs"].is_array() && json["key"].is_string(), || format!("{}: {json}", point.display()))?;
            check(point.with_extension("exr").exists(), || format!("{} has no picture", point.display()))?;
        }
        Ok(points)
    }

    /// Waits until so many points are kept; false where the sweep was faster to its end.
    fn wait_for(&self, points: usize, child: &mut Child) -> Result<bool, Failed> {
        let start = Instant::now();
        while self.kept()?.len() < points {
            if child.try_wait()?.is_some() {
                return Ok(false);
            }
            check(start.elapsed() < Duration::from_secs(300), || format!("{points} points take forever"))?;
            thread::sleep(Duration::from_millis(5));
        }
        Ok(true)
    }
}

const SMALL: &str = "--scene cornell --size 32x24 --reference-spp 16 -o out";

fn measured(json: &Value) -> Result<Vec<&Value>, Failed> {
    Ok(json["points"].as_array().ok_or("no points")?.iter().filter(|point| point["state"] == "measured").collect())
}

fn costs(point: &Value) -> Option<[f64; 2]> {
    Some([point["seconds"]["median"].as_f64()?, point["errors"]["irradiance"]["rmse_over_mean"].as_f64()?])
}

/// Quartiles of the time, ends of the error.
fn ends(point: &Value) -> Option<[f64; 4]> {
    let (seconds, error) = (&point["seconds"], &point["errors"]["irradiance"]["intervals"]["rmse_over_mean"]);
    Some([seconds["lower_quartile"].as_f64()?, seconds["upper_quartile"].as_f64()?, error["low"].as_f64()?, error["high"].as_f64()?])
}

/// Of few rays, the noise of the reference hides what a cache of many rays is off.
fn hidden() -> Outcome {
    let place = Place::new()?;
    let arguments = "--scene corner --size 48x48 --reference-spp 16 --runs 1 -o out --json a.json --csv a.csv --svg a.svg --html a.html --markdown a.md";
    let (text, _) = place.succeed(&format!("sweep irradiance --over tiles.resolution=8,16 {arguments}"))?;
    check(text.contains("< ") && !text.contains(" 0.00 % "), || text.clone())?;
    let json = place.json("a.json")?;
    for point in measured(&json)? {
        let errors = &point["errors"]["irradiance"];
        check(errors["intervals"]["rmse_over_mean"]["below_noise"] == true, || errors.to_string())?;
    }
    for (name, words) in [("a.csv", ",true"), ("a.svg", "class=\"hollow\""), ("a.html", "\"hidden\":[true,true]"), ("a.md", "| < ")] {
        check(place.text(name)?.contains(words), || format!("{name} does not tell"))?;
    }
    Ok(())
}

fn grid() -> Outcome {
    let place = Place::new()?;
    let over = "--over cache.accuracy=0.2,0.5 --over tiles.shape=Cosine,Plane(fov:90)";
    let (text, stderr) = place
        .succeed(&format!("sweep irradiance@tiles.resolution=4 irradiance@tiles.resolution=8 {over} {SMALL} --runs 3 --json a.json --csv a.csv --svg a.svg"))?;
    check(stderr.contains("8 points: 0 found in out, 0 refused, 8 to measure"), || stderr.clone())?;
    let json = place.json("a.json")?;
    let points = measured(&json)?;
    check(json["schema"] == 1 && json["complete"] == true && points.len() == 8 && place.kept()?.len() == 8, || json.to_string())?;
    let values = |index: usize| ["cache.accuracy", "tiles.shape"].map(|name| points[index]["values"][name].as_str().unwrap_or_default().to_owned());
    check(values(1) == ["0.2", "Plane(fov:90)"] && values(6) == ["0.5", "Cosine"], || format!("{:?} {:?}", values(1), values(6)))?;
    for point in &points {
        let own = ends(point).ok_or("no costs")?;
        let clearly_beaten = points.iter().filter_map(|other| ends(other)).any(|other| other[1] < own[0] && other[3] < own[2]);
        check(point["pareto"] == false || !clearly_beaten, || point.to_string())?;
        check(point["pictures_repeat"] == true && text.contains(&format!("\n{} ", point["id"].as_str().unwrap_or("?"))), || text.clone())?;
    }
    let on_front = points.iter().filter(|point| point["pareto"] == true).count();
    check((1..8).contains(&on_front), || text.clone())?;
    rows(&place.text("a.csv")?, &points)?;
    figure(&place.text("a.svg")?, &points)
}

/// The CSV has a row a point, with the numbers of the JSON.
fn rows(csv: &str, points: &[&Value]) -> Outcome {
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let head = reader.headers()?.clone();
    let rows = reader.records().collect::<Result<Vec<_>, _>>()?;
    check(rows.len() == points.len() && head.iter().collect::<std::collections::BTreeSet<_>>().len() == head.len(), || csv.to_owned())?;
    for (row, point) in rows.iter().zip(points) {
        let cell = |name: &str| head.iter().position(|title| title == name).and_then(|at| row.get(at)).unwrap_or("missing").to_owned();
        let number = |name: &str| cell(name).parse::<f64>().ok();
        check(Some([number("seconds_median"), number("irradiance_rmse_over_mean")]) == costs(point).map(|costs| costs.map(Some)), || csv.to_owned())?;
        check(cell("tiles.shape") == point["values"]["tiles.shape"] && cell("pareto").parse().ok() == point["pareto"].as_bool(), || csv.to_owned())?;
        check(number("tiles_cpu_ms").is_some() && cell("state") == "measured" && cell("because").is_empty(), || csv.to_owned())?;
    }
    Ok(())
}

/// The SVG has a mark a point, rings for the front, and a line for each pipeline and shape.
fn figure(svg: &str, points: &[&Value]) -> Outcome {
    let document = roxmltree::Document::parse(svg).map_err(|error| error.to_string())?;
    let of_class = |class: &'static str| document.descendants().filter(move |node| node.attribute("class") == Some(class));
    let mut ids: Vec<&str> = of_class("mark").filter_map(|mark| mark.attribute("data-id")).collect();
    ids.sort_unstable();
    check(ids == points.iter().filter_map(|point| point["id"].as_str()).collect::<Vec<_>>(), || format!("{ids:?}"))?;
    let ringed = of_class("mark").filter(|mark| mark.descendants().any(|node| node.attribute("class") == Some("ring"))).count();
    check(ringed == points.iter().filter(|point| point["pareto"] == true).count(), || svg.to_owned())?;
    let lines = document.descendants().filter(|node| node.has_tag_name(("http://www.w3.org/2000/svg", "polyline"))).count();
    let texts: String = document.descendants().filter_map(|node| node.text()).collect();
    check(lines == 4 && texts.contains("irradiance.rmse_over_mean [%]") && texts.contains("seconds"), || svg.to_owned())
}

/// As `compare` finds them, with what is told in time beside them; found again, and not where frames are at other times.
fn sequences() -> Outcome {
    let place = Place::new()?;
    let common = "--scene cube --size 32x24 --set tiles.resolution=8 --reference-spp 4 --reference-cache references --frames 0..4";
    let (ways, files) = ("irradiance-temporal --over renewed.change=0.02,0.5", "--csv a.csv --svg a.svg --markdown a.md");
    let sweep = |more: &str| place.succeed(&format!("sweep {ways} {common} --runs 1 -o out {more}"));
    let (text, _) = sweep(&format!("--fps 4 --json a.json {files}"))?;
    check(text.contains(", frames 0 to 3, ") && text.contains("lag_p99") && text.contains("irradiance.flicker [%]"), || text.clone())?;
    let each = "irradiance-temporal@renewed.change=0.02 irradiance-temporal@renewed.change=0.5";
    place.succeed(&format!("compare {each} {common} --fps 4 --runs 1 --json c.json --quiet"))?;
    let (swept, compared) = (place.json("a.json")?, place.json("c.json")?);
    let points = measured(&swept)?;
    for (point, variant) in points.iter().zip(compared["variants"].as_array().ok_or("no variants")?) {
        check(point["courses"] == variant["courses"] && point["frames"].as_array().map_or(0, Vec::len) == 4, || format!("{point}\n{variant}"))?;
        for (layer, metric) in [("irradiance", "rmse_over_mean"), ("irradiance", "block_p99"), ("picture", "bias_over_mean")] {
            let (own, mean) = (&point["errors"][layer][metric], &variant["courses"][layer]["mean"][metric]);
            let apart = own.as_f64().zip(mean.as_f64()).map(|(own, mean)| (own - mean).abs());
            check(apart.is_some_and(|apart| apart < 1e-9), || format!("{layer}.{metric}: {own}, not {mean}"))?;
        }
    }
    check(points.len() == 2 && points[0]["errors"] != points[1]["errors"], || "what is swept changes nothing".into())?;
    for (name, words) in [("a.csv", "irradiance_flicker,irradiance_jumps"), ("a.svg", ", flicker "), ("a.md", "irradiance.flicker [%]")] {
        check(place.text(name)?.contains(words), || format!("{name} does not tell"))?;
    }
    let (_, stderr) = sweep("--fps 4 --json b.json")?;
    check(stderr.contains("2 found in out") && place.text("a.json")? == place.text("b.json")?, || stderr)?;
    let (_, stderr) = sweep("--fps 8 --json b.json")?;
    check(stderr.contains("0 found in out"), || stderr)
}

fn repeated() -> Outcome {
    let place = Place::new()?;
    let sweep = |json: &str| place.succeed(&format!("sweep irradiance --over tiles.resolution=4,8 {SMALL} --runs 2 --json {json}"));
    sweep("a.json")?;
    let files = || -> Result<Vec<Vec<u8>>, Failed> { Ok(place.kept()?.iter().map(fs::read).collect::<Result<_, _>>()?) };
    let before = files()?;
    let (_, stderr) = sweep("b.json")?;
    check(stderr.contains("2 points: 2 found in out, 0 refused, 0 to measure") && before == files()?, || stderr)?;
    check(place.text("a.json")? == place.text("b.json")?, || "what is found is told differently".into())?;
    let compared = SMALL.replace(" -o out", "");
    place.succeed(&format!("compare irradiance@tiles.resolution=4 irradiance@tiles.resolution=8 {compared} --runs 1 --json c.json --quiet"))?;
    let (swept, compared) = (place.json("a.json")?, place.json("c.json")?);
    for index in 0..2 {
        let (point, variant) = (&swept["points"][index], &compared["variants"][index]);
        check(point["errors"] == variant["errors"] && point["records"] == variant["records"], || format!("{point}\n{variant}"))?;
    }
    Ok(())
}

fn keys() -> Outcome {
    let place = Place::new()?;
    let sweep = |arguments: &str| place.succeed(&format!("sweep {arguments} -o out"));
    sweep("irradiance --over tiles.resolution=4 --scene cornell --size 32x24 --no-reference --runs 1")?;
    // The same work in other words.
    let (_, stderr) =
        sweep("irradiance.ron@tiles.resolution=8 --over tiles.resolution=4 --set cache.accuracy=0.200 --scene cornell --size 32x24 --no-reference --runs 1")?;
    check(stderr.contains("1 found"), || stderr)?;
    for other in [
        "irradiance --over tiles.resolution=4 --scene cornell --size 32x24 --no-reference --runs 2",
        "irradiance --over tiles.resolution=5 --scene cornell --size 32x24 --no-reference --runs 1",
        "irradiance --over tiles.resolution=4 --scene cornell --size 24x32 --no-reference --runs 1",
        "irradiance --over tiles.resolution=4 --scene cornell --size 32x24 --reference-spp 4 --runs 1",
        "irradiance --over tiles.resolution=4 --scene corner --size 32x24 --no-reference --runs 1",
    ] {
        let (_, stderr) = sweep(other)?;
        check(stderr.contains("0 found"), || format!("{other}: {stderr}"))?;
    }
    check(place.kept()?.len() == 6, || format!("{:?}", place.kept()))
}

/// A sweep of ten points, one after the other.
fn ten() -> String {
    format!("sweep irradiance --over tiles.resolution=4,5,6,7,8,9,10,11,12,13 {SMALL} --runs 3 --together 1 --json a.json")
}

fn killed() -> Outcome {
    let place = Place::new()?;
    let mut child = place.start(&ten())?;
    check(place.wait_for(3, &mut child)?, || "the sweep ended before it was killed".into())?;
    child.kill()?;
    child.wait()?;
    let kept = place.kept()?;
    let before = kept.iter().map(fs::read).collect::<Result<Vec<_>, _>>()?;
    check((3..10).contains(&kept.len()) && !place.0.path().join("a.json").exists(), || format!("{kept:?}"))?;
    let (_, stderr) = place.succeed(&ten())?;
    let tells = format!("10 points: {} found in out, 0 refused, {} to measure", kept.len(), 10 - kept.len());
    check(stderr.contains(&tells), || format!("{tells}\n{stderr}"))?;
    check(kept.iter().map(fs::read).collect::<Result<Vec<_>, _>>()? == before, || "a whole point was written again".into())?;
    check(measured(&place.json("a.json")?)?.len() == 10 && place.kept()?.len() == 10, || format!("{:?}", place.kept()))
}

#[cfg(unix)]
fn interrupted() -> Outcome {
    let place = Place::new()?;
    let mut child = place.start(&ten())?;
    check(place.wait_for(2, &mut child)?, || "the sweep ended before it was interrupted".into())?;
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status()?;
    let status = child.wait()?;
    check(sent.success() && status.code() == Some(130), || status.to_string())?;
    let json = place.json("a.json")?;
    let (whole, kept) = (measured(&json)?.len(), place.kept()?.len());
    let open = json["points"].as_array().map_or(0, |points| points.iter().filter(|point| point["state"] == "open").count());
    check(json["complete"] == false && whole == kept && (2..10).contains(&whole) && open == 10 - whole, || json.to_string())?;
    let (_, stderr) = place.succeed(&ten())?;
    check(stderr.contains(&format!("{kept} found")) && place.json("a.json")?["complete"] == true, || stderr)
}

#[cfg(not(unix))]
fn interrupted() -> Outcome {
    Ok(())
}

fn refused() -> Outcome {
    let place = Place::new()?;
    let (status, text, stderr) = place.run(&format!(
        "sweep irradiance --set tiles.shape=Hemicube --over tiles.resolution=9,8 {SMALL} --runs 1 --json a.json --csv a.csv --svg a.svg --html a.html"
    ))?;
    check(status == 1 && stderr.contains("sweep::refused") && stderr.contains("1 of 2 points"), || format!("{status}\n{stderr}"))?;
    check(text.contains("refused: plan::tile"), || text)?;
    let json = place.json("a.json")?;
    let [first, second] = [&json["points"][0], &json["points"][1]];
    check(first["state"] == "refused" && first["because"].as_str().is_some_and(|why| why.contains("plan::tile")), || first.to_string())?;
    check(first["pareto"] == false && second["pareto"] == true && second["state"] == "measured" && json["complete"] == false, || json.to_string())?;
    let page = place.page("a.html")?;
    let pictures = &page["gallery"]["frames"][0]["shown"][0]["images"];
    check(page["report"]["sweep"] == json && pictures[0].is_null() && pictures[1].is_object(), || pictures.to_string())?;
    let csv = place.text("a.csv")?;
    let rows = csv::Reader::from_reader(csv.as_bytes()).records().collect::<Result<Vec<_>, _>>()?;
    check(rows.len() == 2 && place.text("a.svg")?.matches("class=\"mark\"").count() == 1, || csv)
}

fn damaged() -> Outcome {
    let place = Place::new()?;
    let sweep = || place.succeed(&format!("sweep irradiance --over tiles.resolution=4 {SMALL} --runs 1"));
    sweep()?;
    let [kept] = &place.kept()?[..] else { return Err("one point is expected".into()) };
    let whole = fs::read(kept)?;
    let other_key = String::from_utf8_lossy(&whole).replace("runs 1", "runs 2").into_bytes();
    for damaged in [whole[..whole.len() / 2].to_vec(), b"{}".to_vec(), Vec::new(), other_key] {
        fs::write(kept, &damaged)?;
        let (_, stderr) = sweep()?;
        check(stderr.contains("is damaged") && stderr.contains("0 found"), || stderr)?;
        check(place.kept()?.len() == 1 && fs::read(kept)? != damaged, || "a damaged point is kept".into())?;
    }
    let picture = kept.with_extension("exr");
    let whole = fs::read(&picture)?;
    fs::write(&picture, &whole[..whole.len() - 1])?;
    let (_, stderr) = sweep()?;
    check(stderr.contains(".exr is damaged: its point is measured anew") && fs::read(&picture)? == whole, || stderr)?;
    fs::remove_file(&picture)?;
    let (_, stderr) = sweep()?;
    check(stderr.contains(".exr is missing: its point is measured anew") && fs::read(&picture)? == whole, || stderr)
}

fn page() -> Outcome {
    let place = Place::new()?;
    let over = "--over tiles.resolution=4,8 --over cache.accuracy=0.2,0.5";
    place.succeed(&format!("sweep irradiance {over} {SMALL} --runs 2 --metric picture.relmse --json a.json --html a.html"))?;
    let (json, page) = (place.json("a.json")?, place.page("a.html")?);
    let (report, gallery) = (&page["report"], &page["gallery"]["frames"][0]);
    check(report["sweep"] == json && report["title"] == "cornell: 4 points measured", || "the page holds other numbers".into())?;
    let sets = [&gallery["shown"][0]["images"], &gallery["maps"][0]["images"], &gallery["maps"][1]["images"]].map(|set| set.as_array());
    let source = |image: &Value| image["source"].as_str().unwrap_or_default().to_owned();
    for images in sets {
        let mut sources: Vec<String> = images.ok_or("no images")?.iter().map(source).collect();
        sources.sort();
        sources.dedup();
        check(sources.len() == 4 && sources.iter().all(|source| source.len() > 100), || format!("{sources:?}"))?;
    }
    check(source(&gallery["shown"][0]["reference"]).len() > 100, || "no reference".into())?;
    check(gallery["flip"]["images"].as_array().is_some_and(|images| images.iter().all(|image| image["channels"] == 1)), || "no maps of what is seen".into())?;
    // The first plot is that of the metric asked for, with the front of the JSON.
    let chart = &report["charts"][0];
    check(chart["label"] == "picture.relmse" && chart["errors"][3] == json["points"][3]["errors"]["picture"]["relmse"], || chart["label"].to_string())?;
    let svg = chart["wide"].as_str().ok_or("no plot")?;
    let ringed = json["points"].as_array().map_or(0, |points| points.iter().filter(|point| point["pareto"] == true).count());
    check(svg.matches("class=\"mark\"").count() == 4 && svg.matches("<circle class=\"ring\" r=\"9\"/><text x=\"24").count() == 1, || svg.to_owned())?;
    check(svg.matches("class=\"ring\"").count() == ringed + 1 && svg.matches("<polyline").count() == 2, || svg.to_owned())?;
    check(report["beside"][3]["text"].as_str().is_some_and(|text| text.contains("accuracy: 0.5,")), || report["beside"][3].to_string())?;
    place.succeed(&format!("sweep irradiance {over} {SMALL} --runs 2 --metric picture.relmse --html b.html"))?;
    check(place.text("a.html")? == place.text("b.html")?, || "what is found is shown differently".into())
}

fn mistakes() -> Outcome {
    let place = Place::new()?;
    let many = (1..=32).map(|value| format!("0.{value:02}")).collect::<Vec<_>>().join(",");
    let many = format!("irradiance --over cache.accuracy={many} --over direct.area_samples={many}");
    let picture = || hemisplat::measure::Layers::new(33, 24).with("irradiance", hemisplat::measure::Layer::value(vec![1.0; 792]));
    fs::write(place.0.path().join("large.exr"), picture().to_exr().map_err(|error| error.to_string())?)?;
    let cases = [
        ("irradiance", "", "--over"),
        ("irradiance --over tiles.resolution", "document::syntax", "sets nothing"),
        ("irradiance --over tiles.resolution=", "document::syntax", "sets nothing"),
        ("irradiance --over tiles.resolution=4,,8", "document::syntax", "--over"),
        ("irradiance --over tiles.resolutoin=4,8", "pipeline::unknown_parameter", "resolution"),
        ("irradiance --over tilse.resolution=4,8", "pipeline::unknown_node", "did you mean `tiles`"),
        ("irradiance --over tiles.resolution=4,0", "pipeline::out_of_range", "tiles.resolution"),
        ("irradiance --over tiles.resolution=4,8 --over tiles.resolution=16", "sweep::same_parameter", "swept twice"),
        ("irradiance --over tiles.resolution=8,8", "sweep::same_pipeline", "tiles.resolution=8"),
        ("irradiance --over cache.accuracy=0.1,0.10", "sweep::same_pipeline", "0.10"),
        ("irradiance irradiance --over tiles.resolution=8", "sweep::same_pipeline", "irradiance"),
        ("@tiles.resolution=8 --over cache.accuracy=0.1", "compare::no_pipeline", "names no pipeline"),
        ("iradiance.ron --over cache.accuracy=0.1", "pipeline::not_found", "did you mean"),
        (many.as_str(), "sweep::too_many", "1024 points; 1000"),
        ("irradiance --over cache.accuracy=0.1 --reference large.exr", "measure::sizes_differ", "33×24"),
        ("irradiance --over cache.accuracy=0.1 --metric rsme", "", "rmse_over_mean"),
        ("irradiance --over cache.accuracy=0.1 --no-reference --svg a.svg", "", "cannot be used with"),
        ("irradiance --over cache.accuracy=0.1 --runs 0", "", "1..=500"),
        ("irradiance --over cache.accuracy=0.1 --together 0", "", "1..=64"),
        ("irradiance --over cache.accuracy=0.1 --json a --csv a", "cli::same_file", "a "),
    ];
    for (arguments, code, words) in cases {
        let (status, stdout, stderr) = place.run(&format!("sweep {arguments} --scene cornell --size 32x24 -o out"))?;
        check(status == 2 && stdout.is_empty(), || format!("{arguments}: status {status}\n{stdout}{stderr}"))?;
        check(stderr.contains(code) && stderr.contains(words), || format!("{arguments}: {code}, {words}\n{stderr}"))?;
    }
    let (status, _, stderr) = place.run("sweep irradiance --over cache.accuracy=0.1 --scene cornell")?;
    check(status == 2 && stderr.contains("--out"), || stderr)?;
    let (status, _, stderr) = place.run("sweep irradiance --over cache.accuracy=0.1 --scene cornell -o large.exr")?;
    check(status == 1 && stderr.contains("cli::write"), || stderr)?;
    let (status, _, stderr) = place.run("sweep irradiance --over cache.accuracy=0.1 --scene cornell --size 32x24 -o out --html large.exr/a.html")?;
    check(status == 1 && stderr.contains("cli::write") && stderr.contains("large.exr/a.html"), || stderr)?;
    check(place.kept()?.is_empty(), || "points are measured for a page that cannot be written".into())
}

fn dry_run() -> Outcome {
    let place = Place::new()?;
    let (text, _) = place.succeed("sweep irradiance --over cache.accuracy=0.1,0.2 --over tiles.resolution=4,8 --scene cornell --size 32x24 --dry-run")?;
    let lines: Vec<&str> = text.lines().collect();
    check(lines.len() == 4 && lines[1].starts_with("B irradiance cache.accuracy=0.1 tiles.resolution=8, "), || text.clone())?;
    let (status, text, _) = place.run("sweep irradiance --set tiles.shape=Hemicube --over tiles.resolution=8,9 --scene cornell --size 32x24 --dry-run")?;
    check(status == 1 && text.contains("refused: plan::tile"), || text)?;
    check(fs::read_dir(place.0.path())?.next().is_none(), || "a dry run writes files".into())
}
