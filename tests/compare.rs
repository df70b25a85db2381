//! `hemisplat compare` from outside: what it finds, what it keeps, what it refuses.
//!
//! Needs a GPU adapter, a software one will do; without one each case is named as skipped, which
//! `HEMISPLAT_REQUIRE=gpu` makes a failure.

mod place;

use hemisplat::measure::{Layer, Layers, PICTURE};
use libtest_mimic::{Arguments, Failed};
use place::{Case, Outcome, Place, check};
use serde_json::{Value, json};
use std::fs;
use std::process::{Child, Command};
use std::time::Duration;

const DRAWN: &[(&str, Case)] = &[
    ("times_differ_where_samples_do_and_not_where_nothing_does", times),
    ("errors_are_those_of_diff_and_pictures_repeat_under_interleaving", errors),
    ("a_reference_is_kept_and_a_damaged_one_traced_anew", kept_reference),
    ("a_reference_of_windows_measures_all_that_a_whole_one_does", windows),
    ("errors_against_more_bounces_have_two_parts", two_parts),
    ("several_at_once_keep_one_reference", concurrent),
    ("a_pipeline_without_irradiance_is_judged_by_its_picture", without_irradiance),
    ("pipelines_of_direct_light_alone_are_judged_by_it", direct_alone),
    ("a_picture_from_outside_is_judged_as_the_pipeline_that_made_it", outside),
    ("a_page_holds_what_was_found", html),
    ("a_page_shows_glossy_light", glossy),
    ("an_unfinished_variant_is_named", unfinished),
    ("runs_that_are_ended_early_are_judged", cuts),
    ("an_interrupted_comparison_keeps_whole_rounds", interrupted),
    ("sequences_are_judged_in_time", sequences),
    ("frames_without_light_are_no_end", dark_frames),
    ("what_vanishes_leaves_no_ghost", no_ghosts),
];

const REFUSED: &[(&str, Case)] = &[("mistakes_are_told_before_work_starts", mistakes)];

fn main() {
    // Times are measured: one after the other.
    place::run(&Arguments { test_threads: Some(1), ..Arguments::from_args() }, DRAWN, REFUSED);
}

impl Place {
    fn with(self, name: &str, contents: impl AsRef<[u8]>) -> Result<Self, Failed> {
        fs::write(self.0.path().join(name), contents)?;
        Ok(self)
    }

    /// References kept in the cache.
    fn kept(&self) -> Result<Vec<std::path::PathBuf>, Failed> {
        Ok(fs::read_dir(self.0.path().join("cache/hemisplat"))?.map(|entry| entry.map(|entry| entry.path())).collect::<Result<_, _>>()?)
    }
}

const SMALL: &str = "--scene cornell --size 32x24 --set tiles.resolution=8 --reference-spp 16";

/// The variants' second and third pair of letters, and whether they differ.
fn significant(json: &Value, first: &str, second: &str) -> Option<bool> {
    json["pairs"].as_array()?.iter().find(|pair| pair["first"] == first && pair["second"] == second)?["significant"].as_bool()
}

/// About a third more work for the third: rays a record.
const THREE: &str = "compare irradiance-one-rate irradiance-one-rate irradiance-one-rate@tiles.resolution=38 --scene cornell --size 48x48 --set tiles.resolution=32 --no-reference --json out.json --csv out.csv";

/// As many runs as the program takes by itself; where that leaves a difference open, as many as it then recommends, within the minute of a test.
fn times() -> Outcome {
    let place = Place::new()?;
    let (text, _) = place.succeed(THREE)?;
    let json = place.json("out.json")?;
    check(text.contains("10 runs of each") && json["variants"][0]["errors"]["irradiance"].is_null() && json["reference"].is_null(), || text.clone())?;
    whole_csv(&fs::read_to_string(place.0.path().join("out.csv"))?)?;
    let Err(first) = told_apart(&text, &json) else { return Ok(()) };
    // The same two differ by chance once in 60 comparisons, twice running once in thousands.
    let recommended = json["pairs"].as_array().into_iter().flatten().filter_map(|pair| pair["runs_to_find_5_percent"].as_u64()).max();
    let (text, _) = place.succeed(&format!("{THREE} --runs {}", recommended.unwrap_or(10).clamp(10, 40)))?;
    told_apart(&text, &place.json("out.json")?).map_err(|second| format!("{first:?}\n{second:?}").into())
}

/// Whether the slower one is found, as slower, and the same two are not told apart.
fn told_apart(text: &str, json: &Value) -> Outcome {
    let differ = ["B", "C"].map(|second| significant(json, "A", second));
    check(differ == [Some(false), Some(true)], || text.to_owned())?;
    check(text.contains("B and A: no difference larger than the noise") && text.contains("slower than A"), || text.to_owned())
}

fn whole_csv(csv: &str) -> Outcome {
    // The adapter's name may hold a comma; it stands in quotes then.
    let cells = |line: &str| line.split('"').step_by(2).map(|part| part.matches(',').count()).sum::<usize>();
    let lines: Vec<&str> = csv.lines().collect();
    check(lines.len() == 4 && lines.iter().all(|line| cells(line) == cells(lines[0])), || csv.to_owned())
}

fn errors() -> Outcome {
    let place = Place::new()?;
    place.succeed(&format!("compare irradiance irradiance-readback irradiance@cache.accuracy=0.5 {SMALL} --runs 3 --json out.json --quiet"))?;
    let json = place.json("out.json")?;
    check(json["schema"] == 1 && json["complete"] == true && json["runs"] == 3, || json.to_string())?;
    let truth = &place.kept()?[0];
    for (index, (name, sets)) in [("irradiance", ""), ("irradiance-readback", ""), ("irradiance", " --set cache.accuracy=0.5")].into_iter().enumerate() {
        let variant = &json["variants"][index];
        check(variant["pictures_repeat"] == true, || format!("{name}{sets}: the pictures differ"))?;
        check(variant["seconds_of_runs"].as_array().is_some_and(|seconds| seconds.len() == 3), || variant.to_string())?;
        place.succeed(&format!("render {name} --scene cornell --size 32x24 --set tiles.resolution=8{sets} -o out.exr --stats stats.json"))?;
        for layer in ["irradiance", PICTURE] {
            place.succeed(&format!("diff out.exr:{layer} {}:{layer} --json diff.json", truth.display()))?;
            let diff = place.json("diff.json")?;
            let judged = variant["errors"][layer].as_object().ok_or("no errors")?;
            check(judged.iter().all(|(metric, value)| diff[metric] == *value), || format!("{name}{sets}: {judged:?}\n{diff}"))?;
        }
        let frame = &place.json("stats.json")?["frames"][0];
        check(frame["records"] == variant["records"] && frame["fill_rounds"] == variant["fill_rounds"], || format!("{frame}\n{variant}"))?;
    }
    Ok(())
}

fn kept_reference() -> Outcome {
    let place = Place::new()?;
    let compare = || -> Result<(bool, Value), Failed> {
        let (_, stderr) = place.succeed(&format!("compare irradiance {SMALL} --runs 1 --json out.json"))?;
        Ok((stderr.contains("tracing the reference"), place.json("out.json")?["variants"][0]["errors"].clone()))
    };
    let (traced, first) = compare()?;
    check(traced && compare()? == (false, first.clone()), || "the reference is not kept".into())?;
    let [kept] = &place.kept()?[..] else { return Err("one reference is expected".into()) };
    let whole = fs::read(kept)?;
    let flipped = |at: usize| whole.iter().enumerate().map(|(i, byte)| if i == at { byte ^ 1 } else { *byte }).collect::<Vec<u8>>();
    for damaged in [flipped(whole.len() / 2), flipped(whole.len() - 1), whole[..whole.len() / 2].to_vec(), whole[..8].to_vec(), Vec::new()] {
        fs::write(kept, &damaged)?;
        check(compare()? == (true, first.clone()), || format!("a damaged reference of {} bytes is used", damaged.len()))?;
        check(fs::read(kept)? == whole, || "a damaged reference is not replaced".into())?;
    }
    // What it depends on makes another one.
    for other in ["--reference-spp 32", "--reference-spp 16 --reference-stride 2"] {
        let arguments = SMALL.replace("--reference-spp 16", other);
        place.succeed(&format!("compare irradiance {arguments} --runs 1"))?;
    }
    check(place.kept()?.len() == 3, || format!("{:?}", place.kept()))
}

/// Every frame of a sequence has a truth of its own; where nothing moves there is nothing to flicker but noise, and a lamp that is switched is a jump.
fn sequences() -> Outcome {
    let place = Place::new()?.with("switched.ron", SWITCHED)?;
    let options = "--size 48x36 --frames 0..6 --fps 1 --reference-spp 256 --runs 2";
    let (text, stderr) = place.succeed(&format!("compare irradiance-temporal --scene switched.ron {options} --json out.json --html out.html"))?;
    check(stderr.matches("tracing the reference").count() == 1, || stderr.clone())?;
    check(text.contains("frames 0 to 5") && text.contains("over 6 frames") && text.contains("; of frame 5;"), || text.clone())?;
    check(place.kept()?.len() == 2, || format!("frames that show the same share a reference: {:?}", place.kept()))?;
    let variant = &place.json("out.json")?["variants"][0];
    let course = &variant["courses"]["irradiance"];
    let frames = course["frames"].as_array().ok_or("no frames")?;
    // The lamp goes on in frame 3: all that is seen has jumped, and is there at once.
    check(frames.len() == 6 && course["jumps"].as_u64() > Some(20) && course["lag_p50"] == 0.0, || course.to_string())?;
    let flicker: Vec<f64> = frames.iter().filter_map(|frame| frame["flicker"].as_f64()).collect();
    check(flicker.len() == 5 && flicker[3] < 0.02 && flicker[4] < 0.02, || course.to_string())?;
    // The last frame's errors are those of its picture alone.
    place.succeed("render irradiance-temporal --scene switched.ron --size 48x36 --frames 0..6 --fps 1 -o a.exr")?;
    let truths = place.kept()?;
    let rmse = |truth: &std::path::PathBuf| -> Result<Value, Failed> {
        place.succeed(&format!("diff a.0005.exr:irradiance {}:irradiance --json diff.json --anyway", truth.display()))?;
        Ok(place.json("diff.json")?["rmse_over_mean"].clone())
    };
    let last = &variant["errors"]["irradiance"]["rmse_over_mean"];
    check(rmse(&truths[0])? == *last || rmse(&truths[1])? == *last, || format!("{last}"))?;
    check(variant["frames"].as_array().is_some_and(|frames| frames.len() == 6 && frames[5]["seconds"]["median"].as_f64() > Some(0.0)), || variant.to_string())?;
    let frames = place.page("out.html")?["gallery"]["frames"].clone();
    let moment = json!({"frame": 5, "seconds": 5.0});
    check(frames.as_array().is_some_and(|frames| frames.len() == 6 && frames[5]["moment"] == moment), || frames.to_string())?;
    (0..6).try_for_each(|frame| images_of(&frames[frame], 1))?;
    let (_, stderr) = place.succeed("compare irradiance --scene cornell --size 16x12 --frames 0..2 --runs 1 --no-reference")?;
    check(stderr.contains("nothing in the scene moves"), || stderr)
}

/// A frame in which no light is has no errors, and is no end; its picture is as black as the true one.
fn dark_frames() -> Outcome {
    let place = Place::new()?.with("switched.ron", SWITCHED.replace("(0, (1, 1, 1))", "(0, (0, 0, 0))"))?;
    let options = "--size 32x24 --frames 1..5 --fps 1 --reference-spp 64 --runs 1";
    place.succeed(&format!("compare irradiance-temporal --scene switched.ron {options} --json out.json --html out.html"))?;
    let course = place.json("out.json")?["variants"][0]["courses"]["irradiance"].clone();
    let known: Vec<bool> = course["frames"].as_array().into_iter().flatten().map(|frame| !frame["rmse_over_mean"].is_null()).collect();
    check(known == [false, false, true, true] && course["jumps"].as_u64() > Some(20), || course.to_string())?;
    // Seventeen records are few, but some are sampled in each frame: that the lamp is on is seen at once.
    check(course["frames"][2]["rmse_over_mean"].as_f64() < Some(0.2), || course.to_string())?;
    let frames = place.page("out.html")?["gallery"]["frames"].clone();
    check(layers(&frames[0], "shown") == layers(&frames[3], "shown"), || frames.to_string())
}

/// A box vanishes in frame 3, when most records have been sampled once, a lamp goes on in frame 6: records that live are hardly more wrong than those made anew.
fn no_ghosts() -> Outcome {
    let place = Place::new()?;
    let options = "--scene switch --size 80x60 --frames 0..12 --fps 3 --reference-spp 256 --runs 1";
    place.succeed(&format!("compare irradiance-unguided irradiance-temporal {options} --json out.json"))?;
    let json = place.json("out.json")?;
    let course = |variant: usize| json["variants"][variant]["courses"]["irradiance"].clone();
    let (anew, lives) = (course(0), course(1));
    check(lives["jumps"].as_u64() > Some(20), || lives.to_string())?;
    for frame in 0..12 {
        let [anew, lives] = [&anew, &lives].map(|course| course["frames"][frame]["rmse_over_mean"].as_f64().unwrap_or(f64::NAN));
        check(lives < 1.3 * anew + 0.03, || format!("frame {frame}: {lives} in place of {anew}"))?;
    }
    Ok(())
}

/// A box whose lamp is dim for three seconds, and then bright.
const SWITCHED: &str = r#"Scene(
    version: 1,
    geometry: [
        Quad(corners: ((0, 0, 4), (4, 0, 4), (4, 0, 0), (0, 0, 0)), material: "grey"),
        Quad(corners: ((0, 3, 0), (4, 3, 0), (4, 3, 4), (0, 3, 4)), material: "grey"),
        Quad(corners: ((0, 0, 0), (4, 0, 0), (4, 3, 0), (0, 3, 0)), material: "grey"),
    ],
    materials: { "grey": Diffuse(reflectance: (0.7, 0.7, 0.7)) },
    lights: [Point(position: (2, 1.5, 2), intensity: Step([(0, (1, 1, 1)), (3, (6, 6, 6))]))],
    cameras: { "main": (eye: (2, 1.6, 3.9), target: (2, 1.3, 0), fov: 75) },
)"#;

/// What a pipeline leaves out is told apart from what its method does: the first is the difference of two truths, the second the error against its own.
fn two_parts() -> Outcome {
    let place = Place::new()?;
    let variant = |options: &str, index: usize| -> Result<Value, Failed> {
        place.succeed(&format!("compare irradiance irradiance-bounces {SMALL} --runs 1 {options} --json out.json"))?;
        Ok(place.json("out.json")?["variants"][index].clone())
    };
    let one = variant("--bounces all", 0)?;
    let all = variant("--bounces all", 1)?;
    check(all.get("error_parts").is_none(), || "a pipeline of all bounces leaves some out".into())?;
    place.succeed(&format!("compare irradiance {SMALL} --runs 1 --json own.json"))?;
    let own = &place.json("own.json")?["variants"][0]["errors"];
    let parts = &one["error_parts"];
    check(parts["bounces"] == "1" && &parts["method"] == own, || format!("{} is not {own}", parts["method"]))?;
    let bias = |errors: &Value| errors["irradiance"]["bias_over_mean"]["value"].as_f64().or(errors["irradiance"]["bias_over_mean"].as_f64()).ok_or("no bias");
    let [whole, left_out] = [bias(&one["errors"])?, bias(&parts["left_out"])?];
    check(left_out < -0.2 && (whole - left_out).abs() < 0.05, || format!("{left_out} of {whole} is left out"))
}

/// With windows everything can be measured that a stride leaves out.
fn windows() -> Outcome {
    let place = Place::new()?;
    let judged = |pixels: &str| -> Result<[Value; 3], Failed> {
        let arguments = SMALL.replace("32x24", "150x80");
        place.succeed(&format!("compare irradiance {arguments} {pixels} --runs 1 --json out.json --csv out.csv"))?;
        let json = place.json("out.json")?;
        let errors = &json["variants"][0]["errors"];
        Ok([errors["irradiance"].clone(), errors["picture"].clone(), json["reference"]["windows"].clone()])
    };
    let [irradiance, picture, count] = judged("--reference-windows 2")?;
    check(count == 2 && irradiance["windows"] == 2 && irradiance["stride"] == 1, || irradiance.to_string())?;
    check(["band_error", "rmse_edges", "rmse_interior", "block_p99"].iter().all(|metric| irradiance[metric].is_f64()), || irradiance.to_string())?;
    check(picture["flip"].is_f64() && picture["hdr_flip"].is_f64(), || picture.to_string())?;
    let csv = fs::read_to_string(place.0.path().join("out.csv"))?;
    check(["irradiance_band_error", "irradiance_rmse_edges", "picture_rmse_interior"].iter().all(|column| csv.contains(column)), || csv)?;
    let [irradiance, picture, count] = judged("--reference-stride 2")?;
    check(count.is_null() && irradiance["windows"].is_null() && irradiance["stride"] == 2, || irradiance.to_string())?;
    check(irradiance["band_error"].is_null() && picture["flip"].is_null(), || irradiance.to_string())?;
    check(place.kept()?.len() == 2, || format!("{:?}", place.kept()))
}

fn concurrent() -> Outcome {
    let place = Place::new()?;
    let start = |name: &str| place.start(&format!("compare irradiance {SMALL} --runs 1 --json {name}"));
    let children: Vec<Child> = ["a.json", "b.json", "c.json"].iter().map(|name| start(name)).collect::<Result<_, _>>()?;
    for mut child in children {
        let status = child.wait()?;
        check(status.success(), || status.to_string())?;
    }
    check(place.kept()?.len() == 1, || format!("{:?}", place.kept()))?;
    let errors = |name: &str| place.json(name).map(|json| json["variants"][0]["errors"].clone());
    check(errors("a.json")? == errors("b.json")? && errors("b.json")? == errors("c.json")?, || "they differ".into())
}

/// A pipeline of direct light alone.
const DIRECT: &str = r#"Pipeline(version: 1, about: "direct light", nodes: [(name: "gbuffer", pass: GBuffer()), (name: "direct", pass: DirectLight(gbuffer: "gbuffer"))],
    outputs: { "picture": "direct" })"#;

fn without_irradiance() -> Outcome {
    let place = Place::new()?.with("direct@light.ron", DIRECT)?;
    place.succeed("compare direct@light.ron --scene cornell --size 32x24 --reference-spp 16 --runs 2 --json out.json")?;
    let json = place.json("out.json")?;
    let errors = &json["variants"][0]["errors"];
    check(errors["irradiance"].is_null() && errors["picture"]["rmse_over_mean"].is_f64(), || errors.to_string())?;
    check(json["pairs"] == Value::Array(Vec::new()) && json["variants"][0]["records"]["irradiance"].is_null(), || json.to_string())
}

/// Runs with half of the time and a quarter are judged, too.
fn cuts() -> Outcome {
    let place = Place::new()?;
    let (text, _) = place.succeed(&format!("compare irradiance {SMALL} --runs 3 --cuts 2 --json out.json"))?;
    let variant = place.json("out.json")?["variants"][0].clone();
    let median = variant["seconds"]["median"].as_f64().unwrap_or(0.0);
    let given: Vec<f64> = variant["cuts"].as_array().into_iter().flatten().filter_map(|cut| cut["within_seconds"].as_f64()).collect();
    let are_halves = given.len() == 2 && given.iter().zip([4.0, 2.0]).all(|(given, part)| (given * part / median - 1.0).abs() < 1e-6);
    let are_judged = (0..2).all(|cut| variant["cuts"][cut]["errors"]["irradiance"]["rmse_over_mean"].is_f64() && variant["cuts"][cut]["seconds"].is_f64());
    check(are_halves && are_judged && variant["pictures_repeat"] == true, || variant.to_string())?;
    check(text.contains("within ") && text.contains("whole"), || text)
}

fn unfinished() -> Outcome {
    let place = Place::new()?;
    let (text, stderr) = place.succeed(
        &format!("compare irradiance irradiance@misses.at_most=1 {SMALL} --no-reference --runs 2 --json out.json").replace("--reference-spp 16 ", ""),
    )?;
    let json = place.json("out.json")?;
    check(json["complete"] == false && json["variants"][0]["complete"] == true && json["variants"][1]["complete"] == false, || json.to_string())?;
    check(stderr.contains("warning: B") && !stderr.contains("warning: A"), || stderr.clone())?;
    check(stderr.contains("2 variants need at least --runs 6") && text.contains("too few runs"), || format!("{stderr}{text}"))
}

#[cfg(unix)]
fn interrupted() -> Outcome {
    let place = Place::new()?;
    // Large enough that no machine is through with all runs when it is interrupted.
    let arguments = "compare irradiance irradiance --scene cornell --size 160x120 --reference-spp 16 --runs 256 --json out.json --csv out.csv";
    let mut child = place.start(arguments)?;
    std::thread::sleep(Duration::from_secs(8));
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status()?;
    let status = child.wait()?;
    check(sent.success() && status.code() == Some(130), || status.to_string())?;
    let kept = ["out.json", "out.csv"].map(|name| place.0.path().join(name).exists());
    if kept == [false, false] {
        return Ok(());
    }
    let json = place.json("out.json")?;
    let runs = json["runs"].as_u64().unwrap_or(0);
    let of_variants = |index: usize| json["variants"][index]["seconds_of_runs"].as_array().map_or(0, Vec::len) as u64;
    check(json["complete"] == false && (1..256).contains(&runs) && of_variants(0) == runs && of_variants(1) == runs, || json.to_string())
}

#[cfg(not(unix))]
fn interrupted() -> Outcome {
    Ok(())
}

fn html() -> Outcome {
    let place = Place::new()?;
    place.succeed(&format!("compare irradiance irradiance@cache.accuracy=0.5 {SMALL} --runs 2 --json out.json --html out.html --quiet"))?;
    let data = place.page("out.html")?;
    let (json, report) = (place.json("out.json")?, &data["report"]);
    let same = ["scene", "triangles", "camera", "size", "adapter", "runs", "complete", "reference"].iter().all(|key| report["sweep"][key] == json[key]);
    check(same, || "the page tells of another comparison".into())?;
    for (point, variant) in [0, 1].map(|index| (&report["sweep"]["points"][index], &json["variants"][index])) {
        let keys = ["id", "pipeline", "set", "seconds", "seconds_of_runs", "records", "uncovered_pixels", "peak_gpu_bytes", "errors"];
        check(point["row"] == variant["name"] && keys.iter().all(|key| point[key] == variant[key]), || format!("{point}\n{variant}"))?;
    }
    check(report["differences"]["pairs"][0]["ratio"] == json["pairs"][0]["ratio"], || report["differences"].to_string())?;
    let gallery = &data["gallery"]["frames"][0];
    check(layers(gallery, "shown") == [PICTURE, "irradiance"] && layers(gallery, "maps") == [PICTURE, "irradiance"], || gallery.to_string())?;
    images_of(gallery, 2)?;
    let records = |index: usize| (gallery["records"][index][0]["cache"].clone(), gallery["records"][index][0]["count"].as_u64().unwrap_or(0));
    let few = records(1);
    check(few.0 == "cache" && few.1 > 0 && records(0).1 > few.1, || gallery["records"].to_string())?;
    let text = report["beside"][1]["text"].as_str().unwrap_or_default();
    check(text.contains("accuracy: 0.5,") && text.contains("resolution: 8,"), || text.to_owned())
}

fn layers<'g>(gallery: &'g Value, sets: &str) -> Vec<&'g str> {
    gallery[sets].as_array().into_iter().flatten().filter_map(|set| set["layer"].as_str()).collect()
}

/// Every layer has a picture of the reference and one of each variant, and so has every map but for the reference.
fn images_of(gallery: &Value, variants: usize) -> Outcome {
    let is_image = |image: &Value| image["source"].as_str().is_some_and(|source| !source.is_empty());
    let is_whole = |set: &Value| set["images"].as_array().is_some_and(|images| images.len() == variants && images.iter().all(is_image));
    let sets = |name: &str| gallery[name].as_array().cloned().unwrap_or_default();
    let whole = sets("shown").iter().all(|set| is_whole(set) && is_image(&set["reference"])) && sets("maps").iter().all(is_whole);
    check(whole, || gallery.to_string())
}

fn glossy() -> Outcome {
    let place = Place::new()?;
    let quick = "--set direct.emitters=Sampled(area_samples:4) --set tiles.resolution=8 --set glossy_tiles.resolution=16 --reference-spp 16";
    place.succeed(&format!(
        "compare radiance radiance@lobes.order=Fixed(order:4) --scene cornell-glossy --size 32x32 {quick} --runs 1 --json out.json --html out.html"
    ))?;
    let (data, json) = (place.page("out.html")?, place.json("out.json")?);
    let gallery = &data["gallery"]["frames"][0];
    check(["shown", "maps"].iter().all(|sets| layers(gallery, sets) == [PICTURE, "irradiance", "glossy"]), || gallery.to_string())?;
    images_of(gallery, 2)?;
    let images = &gallery["shown"][2]["images"];
    check(images[0]["source"] != images[1]["source"], || images.to_string())?;
    check(json["variants"].as_array().is_some_and(|variants| variants.iter().all(|variant| variant["errors"]["direct"].is_null())), || json.to_string())
}

/// A ball under a sky.
const SKY: &str = r#"Scene(version: 1, about: "under a sky", geometry: [
        Quad(corners: ((-6, 0, -6), (-6, 0, 6), (6, 0, 6), (6, 0, -6)), material: "floor"),
        Sphere(centre: (0, 1, 0), radius: 1, subdivisions: 3, material: "ball"),
    ],
    materials: { "floor": Diffuse(reflectance: (0.6, 0.6, 0.6)), "ball": Phong(reflectance: (0.2, 0.2, 0.2), specular: (0.7, 0.7, 0.7), exponent: 20) },
    environment: Constant((1, 0.9, 0.8)),
    cameras: { "main": (eye: (0, 3, 9), direction: (0, -0.22, -1), fov: 56) })"#;

fn direct_alone() -> Outcome {
    let place = Place::new()?.with("sky.ron", SKY)?;
    let (text, _) = place.succeed(
        "compare environment environment-spherical --scene ./sky.ron --size 48x36 --reference-spp 16 --runs 1 --json out.json --csv out.csv --html out.html",
    )?;
    check(text.contains("\ndirect rmse_over_mean ") && !text.contains("\nirradiance "), || text)?;
    let (data, json) = (place.page("out.html")?, place.json("out.json")?);
    for errors in [0, 1].map(|index| &json["variants"][index]["errors"]) {
        let direct = errors["direct"]["rmse_over_mean"].as_f64().unwrap_or(1.0);
        check(errors["irradiance"].is_null() && errors["glossy"].is_null() && direct < 0.5, || errors.to_string())?;
    }
    let (gallery, report) = (&data["gallery"]["frames"][0], &data["report"]);
    check(layers(gallery, "shown") == [PICTURE, "direct"] && layers(gallery, "maps") == [PICTURE, "direct"], || gallery.to_string())?;
    images_of(gallery, 2)?;
    check(report["sweep"]["metric"] == "direct.rmse_over_mean" && report["charts"][0]["label"] == "Direct, rmse over mean", || report.to_string())?;
    let csv = fs::read_to_string(place.0.path().join("out.csv"))?;
    check(csv.contains(",direct_rmse_over_mean,"), || csv)
}

fn outside() -> Outcome {
    let place = Place::new()?;
    place.succeed("render irradiance-plane --scene cornell --size 32x24 --set tiles.resolution=8 -o made.exr")?;
    // As other programs write: one layer without a name, and nothing said of what it shows.
    let made = Layers::read(&fs::read(place.0.path().join("made.exr"))?)?;
    let place = place.with("bare.exr", Layers { attributes: Default::default(), projection: None, ..only(made, PICTURE) }.to_exr()?)?;
    let pictures = "--picture all=made.exr --picture lit=made.exr:irradiance --picture other=bare.exr:picture,seconds=0.5";
    let (text, noted) =
        place.succeed(&format!("compare irradiance irradiance-plane {SMALL} {pictures} --runs 2 --json out.json --csv out.csv --html out.html"))?;
    let json = place.json("out.json")?;
    let (plane, pictures) = (&json["variants"][1]["errors"], &json["pictures"]);
    check(pictures[0]["errors"] == *plane, || json.to_string())?;
    let rmse = |errors: &Value, layer: &str| errors[layer]["rmse_over_mean"].clone();
    check(rmse(&pictures[1]["errors"], "irradiance") == rmse(plane, "irradiance") && pictures[1]["errors"]["picture"].is_null(), || json.to_string())?;
    check(rmse(&pictures[2]["errors"], PICTURE) == rmse(plane, PICTURE) && pictures[2]["errors"]["irradiance"].is_null(), || json.to_string())?;
    check(pictures[2]["seconds"] == 0.5 && pictures[2]["id"] == "E" && pictures[2]["bounces"].is_null(), || json.to_string())?;
    check(json["pairs"].as_array().map(Vec::len) == Some(1) && json["error_pairs"].as_array().map(Vec::len) == Some(2 + 3 + 3), || json.to_string())?;
    check(
        text.contains("\nE   other") && text.contains("0.500             as stated") && text.contains("\nC and A: irradiance.rmse_over_mean does not differ"),
        || text.clone(),
    )?;
    check(noted.contains("E other: its time is as stated") && noted.contains("bare.exr does not say of how many bounces"), || noted.clone())?;
    let csv = fs::read_to_string(place.0.path().join("out.csv"))?;
    check(csv.lines().count() == 6 && csv.lines().nth(5).is_some_and(|line| line.starts_with("E,other,,,")), || csv)?;
    let page = place.page("out.html")?;
    check(page["report"]["sweep"]["points"][4]["state"] == "given" && page["report"]["title"] == "cornell: 2 pipelines and 3 pictures compared", || {
        page["report"].to_string()
    })?;
    // What was given of D is no picture.
    let shown: Vec<bool> = page["gallery"]["frames"][0]["shown"][0]["images"].as_array().into_iter().flatten().map(Value::is_object).collect();
    check(shown == [true, true, true, false, true], || format!("{shown:?}"))
}

/// The picture with this layer alone.
fn only(mut picture: Layers, layer: &str) -> Layers {
    picture.layers.retain(|name, _| name == layer);
    picture
}

fn mistakes() -> Outcome {
    let exr = |picture: Layers| picture.to_exr().map_err(|error| Failed::from(error.to_string()));
    let flat = |size: [u32; 2], value: f32| {
        let plane = || Layer::value(vec![value; (size[0] * size[1]) as usize]);
        Layers::new(size[0], size[1]).with("irradiance", plane()).with(PICTURE, plane())
    };
    let place = Place::new()?
        .with("two.exr", exr(flat([32, 24], 1.0).with_attribute("bounces", 2))?)?
        .with("side.exr", exr(flat([32, 24], 1.0).with_attribute("camera", "side"))?)?
        .with("large.exr", exr(flat([33, 24], 1.0))?)?
        .with("black.exr", exr(flat([32, 24], 0.0).with("depth", Layer::value(vec![1.0; 768])))?)?
        .with("good.exr", exr(flat([32, 24], 1.0))?)?
        .with("weight.exr", exr(Layers::new(32, 24).with("weight", Layer::value(vec![1.0; 768])))?)?;
    image::Rgb32FImage::from_pixel(32, 24, image::Rgb([1.0; 3])).save(place.0.path().join("bare.hdr"))?;
    let cases = [
        ("irradiance --reference two.exr", "measure::bounces_differ", "`bounces` 1, the reference 2"),
        ("irradiance --reference side.exr", "cli::other_view", "`side` in the other"),
        ("irradiance --reference large.exr", "measure::sizes_differ", "33×24"),
        ("irradiance --reference black.exr", "measure::black_reference", "black.exr"),
        ("irradiance --reference weight.exr", "measure::unknown_layer", "the file holds: weight"),
        ("irradiance --reference missing.exr", "cli::read", "missing.exr"),
        ("irradiance --reference good.exr --reference-variance large.exr", "measure::variance_size", "33×24"),
        ("irradiance --no-reference --cuts 2", "", "'--cuts <N>'"),
        ("irradiance --frames 0..3 --cuts 2", "", "'--cuts <N>'"),
        ("irradiance --frames 0..3 --reference good.exr", "", "cannot be used with"),
        ("irradiance --frames 3..3", "", "expected A..B"),
        ("irradiance --reference-variance good.exr", "", "--reference <FILE.exr[:LAYER]>"),
        ("irradiance --reference good.exr --no-reference", "", "cannot be used with"),
        ("irradiance --reference good.exr --reference-spp 3", "", "cannot be used with"),
        ("irradiance --picture a=two.exr --reference good.exr", "measure::bounces_differ", "two.exr cannot be judged"),
        ("irradiance --picture a=side.exr", "cli::other_view", "`side` in the other"),
        ("irradiance --picture a=large.exr", "measure::sizes_differ", "large.exr cannot be judged"),
        ("irradiance --picture a=good.exr:weight", "measure::unknown_layer", "the file holds: irradiance, picture"),
        ("irradiance --picture a=weight.exr --reference good.exr", "cli::no_common_layer", "one holds weight"),
        ("irradiance --picture a=weight.exr:weight", "compare::not_judged", "irradiance, picture, glossy, direct"),
        ("irradiance --picture a=bare.hdr", "cli::nameless_layer", "bare.hdr:picture"),
        ("irradiance --picture a=missing.exr", "cli::read", "missing.exr"),
        ("irradiance --picture good.exr", "", "LABEL=FILE.exr:LAYER"),
        ("irradiance --picture a=good.exr,seconds=0", "", "above 0"),
        ("irradiance --picture a=good.exr --no-reference", "", "cannot be used with"),
        ("irradiance --picture a=good.exr --json good.exr", "cli::same_file", "good.exr"),
        ("irradiance --anyway", "", "required"),
        ("irradiance --reference-spp 0", "reference::samples", "too few"),
        ("irradiance --reference-stride 100", "reference::stride", "32×24"),
        ("irradiance --reference-windows 1", "reference::windows", "32×24"),
        ("irradiance --reference-windows 1 --reference-stride 2", "", "cannot be used with"),
        ("irradiance --runs 0", "", "1..=500"),
        ("irradiance --runs 501", "", "1..=500"),
        ("", "compare::no_pipeline", "names no pipeline"),
        ("@tiles.resolution=8", "compare::no_pipeline", "irradiance@tiles.resolution=32"),
        ("iradiance.ron irradiance", "pipeline::not_found", "did you mean"),
        ("irradiance@tiles.resolutoin=8", "pipeline::unknown_parameter", "resolution"),
        ("irradiance@tiles.resolution", "document::syntax", "sets nothing"),
        ("irradiance@", "document::syntax", "sets nothing"),
        ("irradiance@tiles.resolution=0 irradiance@tiles.resolution=x", "", "2 errors"),
        ("irradiance-cosine@tiles.by=Raster", "plan::raster_shape", "tiles"),
        ("irradiance --camera other", "cli::unknown_camera", "main"),
        ("irradiance --camera main --camera main", "cli::several_cameras", "main"),
    ];
    for (arguments, code, words) in cases {
        let (status, stdout, stderr) = place.run(&format!("compare {arguments} --scene cornell --size 32x24"))?;
        check(status == 2 && stdout.is_empty(), || format!("{arguments}: status {status}\n{stdout}{stderr}"))?;
        check(stderr.contains(code) && stderr.contains(words), || format!("{arguments}: {code}, {words}\n{stderr}"))?;
    }
    for same in ["--json a --csv a", "--csv a --html a", "--reference good.exr --json good.exr"] {
        let (status, _, stderr) = place.run(&format!("compare irradiance --scene cornell --size 32x24 {same}"))?;
        check(status == 2 && stderr.contains("cli::same_file"), || stderr)?;
    }
    check(place.run("compare --scene cornell")?.0 == 2, || "no pipeline is accepted".into())?;
    let (status, _, stderr) = place.run("compare irradiance --scene cornell --json good.exr/out.json")?;
    check(status == 1 && stderr.contains("cli::write"), || stderr)
}
