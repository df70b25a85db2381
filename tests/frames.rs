//! Frames and rounds on the device: sums that must have closed forms, and what earlier frames, views and files leave.
//!
//! Needs a GPU adapter, a software one will do; without one each case is named as skipped, which
//! `HEMISPLAT_REQUIRE=gpu` makes a failure.

mod bar;
mod skips;

use assert_cmd::Command;
use hemisplat::{
    block_on,
    contract::encoder::Setting,
    gpu::{AskPace, Gpu, Pace, scene::kind},
    measure::{
        Layers,
        run::{FrameReport, Run},
    },
    passes::REGISTRY,
    pipeline,
    scene::{Camera, load, needs::Needs, stage::Stage},
};
use image::AnimationDecoder;
use libtest_mimic::{Arguments, Failed};
use serde_json::Value;
use skips::Missing;
use std::{
    ffi::OsStr,
    fs, io,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
    time::Duration,
};
use tempfile::TempDir;

type Outcome = Result<(), Failed>;
type Case = fn() -> Outcome;

/// What not every system has the means to try.
const ON_A_TERMINAL: &str = "work_that_takes_long_is_shown_on_a_terminal_only";
const WITH_A_FULL_DISK: &str = "a_frame_that_fails_keeps_records_and_statistics_of_those_before_it";
const WITH_SIGNALS: &str = "an_interrupted_sequence_keeps_what_is_whole";

const INTERRUPTED_AND_RESUMED: &str = "an_interrupted_sequence_that_goes_on_has_the_bits_of_one_in_one_piece";
const FAILED_AND_RESUMED: &str = "a_sequence_whose_frame_failed_goes_on_with_that_frame";

const CASES: &[(&str, Case)] = &[
    ("a_sum_over_rounds_has_its_closed_form_in_every_frame", sum_over_rounds),
    ("a_sum_over_frames_has_its_closed_form_and_starts_empty", sum_over_frames),
    ("a_fill_inside_a_loop_starts_anew_each_time", fill_in_a_loop),
    ("an_earlier_cache_and_earlier_shadow_maps_are_whole", earlier_memory),
    ("shadow_maps_are_drawn_in_the_first_frame_and_hold_in_all", shadow_maps_once),
    ("shadow_maps_are_drawn_anew_where_they_show_something_else", shadow_maps_follow),
    ("a_second_frame_of_the_same_view_adds_nothing_and_looks_the_same", same_view),
    ("a_second_view_reuses_records", second_view),
    ("saved_records_give_the_same_picture_bit_by_bit", || saved_records("irradiance-one-rate")),
    ("saved_records_of_two_loops_give_the_same_picture_bit_by_bit", || saved_records("irradiance")),
    ("a_lightmap_that_is_saved_goes_on_in_any_frame", kept_lightmap),
    ("a_file_of_records_that_does_not_fit_is_refused_and_kept", bad_records),
    ("a_file_of_records_that_another_loop_made_otherwise_is_refused", records_of_other_loops),
    ("a_fill_that_ends_at_its_bound_splats_what_it_has_made", bounded_fill),
    (WITH_A_FULL_DISK, failing_frame),
    (ON_A_TERMINAL, progress),
    ("a_gap_is_a_warning_or_a_failure_and_the_picture_is_written", gaps),
    ("frames_share_out_a_bounded_number_of_new_records", || bounded_frames("irradiance-one-rate")),
    ("two_loops_share_out_one_number_of_new_records", || bounded_frames("irradiance")),
    ("a_scene_that_moves_is_in_each_frame_as_it_is_then", moving),
    ("a_mesh_that_deforms_is_in_each_frame_as_it_is_then", bending),
    ("records_live_on_where_a_mesh_deforms", living_on_a_bar),
    ("a_sequence_is_one_animated_picture", movie),
    ("records_live_on_where_the_scene_moves", living),
    ("a_sequence_in_parts_has_the_bits_of_one_in_one_piece", in_parts),
    ("records_of_radiance_live_on", shining),
    ("frames_that_do_not_follow_are_told_and_sample_all_records_anew", out_of_order),
    ("a_sequence_goes_on_after_the_frames_that_are_there", resumed),
    (INTERRUPTED_AND_RESUMED, interrupted_and_resumed),
    (FAILED_AND_RESUMED, failed_and_resumed),
    ("what_moves_in_extremes_is_a_picture_or_an_error", extremes),
    ("an_accuracy_changes_between_frames_and_records_stay", accuracy_per_frame),
    ("what_cannot_change_between_frames_is_refused", refused_per_frame),
    ("a_frame_ends_when_its_time_is_up", time_is_up),
    ("a_frame_without_time_has_irradiance_everywhere", || no_time("irradiance", "cornell", "irradiance", 0.5)),
    ("a_frame_without_time_has_reflections_everywhere", || no_time("radiance", "cornell-glossy", "glossy", 0.8)),
    ("every_way_of_filling_covers_the_picture_without_time", ways_without_time),
    ("an_error_shrinks_as_rounds_are_added", rounds_in_time),
    ("a_full_cache_ends_the_fill", full_cache),
    ("each_end_of_a_fill_with_work_left_tells_its_reason", reasons),
    ("a_fill_whose_records_cover_nothing_ends_soon", no_progress),
    ("photons_that_are_given_up_are_told", photons_cut_off),
    (WITH_SIGNALS, interrupted),
    ("a_run_that_fails_leaves_earlier_files_as_they_are", failing_runs),
    ("every_kind_of_resource_can_be_dumped", dumps),
];

fn main() {
    let gpu = Missing::gpu();
    let trials = CASES.iter().map(|(name, case)| skips::trial(*name, gpu.clone().or_else(|| tools(name)).as_ref(), case)).collect();
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

/// What this system lacks for a case.
fn tools(case: &str) -> Option<Missing> {
    let runs = |program: &str| std::process::Command::new(program).arg("--version").output().is_ok();
    let why = match case {
        ON_A_TERMINAL if !runs("script") => "the program `script`, which makes a terminal, is missing",
        WITH_A_FULL_DISK | FAILED_AND_RESUMED if !cfg!(target_os = "linux") => "no /dev/full",
        WITH_SIGNALS | INTERRUPTED_AND_RESUMED if !cfg!(unix) => "no signals",
        _ => return None,
    };
    Some(Missing::new("tools", why))
}

fn check(holds: bool, what: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(what().into()) }
}

fn failed(error: impl std::fmt::Display) -> Failed {
    error.to_string().into()
}

/// Each frame of a sequence is, bit for bit, the picture of its moment, with what is needed to make it again; a scene that stands still says so.
fn moving() -> Outcome {
    let place = Place::new()?;
    let render = |scene: &str, arguments: &[&str]| {
        let (status, stderr) = place.render_by("irradiance", scene, arguments)?;
        check(status == 0, || format!("{arguments:?}: {stderr}"))?;
        Ok::<_, Failed>(stderr)
    };
    fs::write(place.path("moving.ron"), MOVING).map_err(failed)?;
    render("moving.ron", &["--moment", "0.25", "--frames", "0..3", "--fps", "2", "-o", "out.exr"])?;
    for (frame, moment) in ["0.25", "0.75", "1.25"].into_iter().enumerate() {
        render("moving.ron", &["--moment", moment, "-o", "still.exr"])?;
        let (still, frame) = (place.picture("still.exr")?, place.picture(&format!("out.{frame:04}.exr"))?);
        check(still.layers == frame.layers, || format!("the frame at {moment} s is another picture"))?;
        for name in ["moment", "scene-checksum"] {
            check(still.attributes.get(name) == frame.attributes.get(name) && still.attributes.contains_key(name), || format!("{name} at {moment} s"))?;
        }
    }
    check(place.picture("out.0000.exr")?.layers != place.picture("out.0002.exr")?.layers, || "nothing has moved".into())?;
    let notes = render("corner", &["--moment", "1", "-o", "still.exr"])?;
    check(notes.contains("nothing in the scene moves"), || notes)
}

/// Each frame is the picture of its moment bit for bit, shadow maps are drawn anew as long as the mesh bends, and it casts its shadow where it is.
fn bending() -> Outcome {
    let place = Place::new()?;
    bar::write(place.0.path())?;
    fs::write(place.path("bar.ron"), BENDING).map_err(failed)?;
    let render = |more: &[&str]| {
        let (status, stderr) = place.render_by("irradiance-one-rate", "bar.ron", &[&["--set", "tiles.resolution=8", "--fps", "4"], more].concat())?;
        check(status == 0, || stderr)
    };
    render(&["--frames", "0..7", "-o", "all.exr"])?;
    let runs = maps_drawn(&place.stats()?);
    check(runs == [1, 1, 1, 1, 1, 0, 0], || format!("maps are drawn {runs:?} times"))?;
    for (frame, moment) in ["0", "0.25", "0.5", "0.75", "1", "1.25", "1.5"].into_iter().enumerate() {
        render(&["--moment", moment, "-o", "one.exr"])?;
        place.same(&format!("all.{frame:04}.exr"), "one.exr")?;
    }
    // Under the lamp: what is behind the bar while it is straight is before it in the end.
    let direct = |name: &str| Ok::<_, Failed>(place.picture(name)?.rgb("direct").map_err(failed)?.concat());
    let dark = |light: Vec<f32>| light.iter().filter(|value| **value == 0.0).count();
    let [first, last] = [dark(direct("all.0000.exr")?), dark(direct("all.0004.exr")?)];
    check(first != last, || format!("{first} values are dark, and {last} in the end"))
}

/// A bar whose halves stay flat shows the same as two squares that are turned as a whole: records follow its triangles as they follow those.
fn living_on_a_bar() -> Outcome {
    let place = Place::new()?;
    bar::write(place.0.path())?;
    let square = "Quad(corners: ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)))";
    let turns = "rotate: (axis: (1, 0, 0), degrees: Linear([(0, 0), (1, 90)]))";
    let squares = format!("{square}, Place(of: [{square}], {turns}, translate: (0, 1, 0))");
    let irradiance = |name: &str, text: &str| {
        fs::write(place.path(&format!("{name}.ron")), text).map_err(failed)?;
        let picture = format!("{name}.exr");
        let (status, stderr) = place.render_by("irradiance-temporal", &format!("{name}.ron"), &["--frames", "0..9", "--fps", "8", "-o", &picture])?;
        check(status == 0, || stderr)?;
        let layer = |frame: u32| place.picture(&format!("{name}.{frame:04}.exr"))?.rgb("irradiance").map(|all| all.concat()).map_err(failed);
        [3, 6, 8].into_iter().map(layer).collect::<Result<Vec<_>, Failed>>()
    };
    let (bends, turns) = (irradiance("bends", BENDING)?, irradiance("turns", &BENDING.replace("File(\"bar.gltf\")", &squares))?);
    for (bends, turns) in bends.iter().zip(&turns) {
        let mean = turns.iter().map(|value| f64::from(*value)).sum::<f64>() / turns.len() as f64;
        let error = (bends.iter().zip(turns).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / turns.len() as f64).sqrt();
        check(mean > 0.0 && error < 1e-3 * mean, || format!("apart by {error}, of {mean}"))?;
    }
    Ok(())
}

/// An animated picture has all frames, as they are each; one that is not whole does not appear.
fn movie() -> Outcome {
    let place = Place::new()?;
    fs::write(place.path("moving.ron"), MOVING).map_err(failed)?;
    let render = |arguments: &[&str]| place.render_by("irradiance", "moving.ron", arguments);
    let (status, stderr) = render(&["--frames", "2..5", "--fps", "2", "-o", "all.apng", "-o", "one.png"])?;
    check(status == 0 && !place.path("all.0002.apng").exists(), || stderr)?;
    let decoder = image::codecs::png::PngDecoder::new(std::io::BufReader::new(fs::File::open(place.path("all.apng"))?)).map_err(failed)?;
    let frames = decoder.apng().map_err(failed)?.into_frames().collect_frames().map_err(failed)?;
    check(frames.len() == 3, || format!("{} frames", frames.len()))?;
    for (frame, number) in frames.iter().zip(2..) {
        let one = image::open(place.path(&format!("one.{number:04}.png"))).map_err(failed)?.to_rgba8();
        check(frame.delay().numer_denom_ms() == (500, 1) && *frame.buffer() == one, || format!("frame {number} is another picture"))?;
    }
    check(frames[0].buffer() != frames[2].buffer(), || "nothing has moved".into())?;
    for (arguments, told) in
        [(&["-o", "still.apng"][..], "there is one frame"), (&["--frames", "0..2", "-o", "still.apng", "--dump", "cache"], "--dump writes beside a picture")]
    {
        let (status, stderr) = render(arguments)?;
        check(status == 2 && stderr.contains(told) && !place.path("still.apng").exists(), || format!("{arguments:?}: {status} {stderr}"))?;
    }
    Ok(())
}

/// Records that live on take a part of the tiles; when a lamp goes on, they are as bright as records made anew at once. Where nothing moves, nothing differs.
fn living() -> Outcome {
    let place = Place::new()?;
    fs::write(place.path("moving.ron"), MOVING).map_err(failed)?;
    let render = |pipeline: &str, scene: &str, arguments: &[&str]| {
        let (status, stderr) = place.render_by(pipeline, scene, arguments)?;
        check(status == 0, || format!("{pipeline} {arguments:?}: {stderr}"))
    };
    let frames = |stats: &Value| stats["frames"].as_array().cloned().unwrap_or_default();
    let tiles = |frame: &Value| frame["new_records"].as_u64().unwrap_or(0) + due(frame);
    let made = |pipeline: &str, set: &str| {
        render(pipeline, "cube.ron", &["--set", set, "--frames", "0..9", "-o", "cube.exr"])?;
        Ok::<_, Failed>(frames(&place.stats()?).iter().skip(1).map(tiles).sum::<u64>())
    };
    let (lived, anew) = (made("irradiance-temporal", "due_tiles.resolution=8")?, made("irradiance-unguided", "tiles.resolution=8")?);
    check(2 * lived < anew, || format!("{lived} of {anew} tiles"))?;
    for pipeline in ["irradiance-temporal", "irradiance-temporal-interpolated", "irradiance-unguided"] {
        render(pipeline, "moving.ron", &["--frames", "0..16", "-o", &format!("{pipeline}.exr")])?;
    }
    let mean =
        |name: String| Ok::<_, Failed>(place.picture(&name)?.rgb("irradiance").map_err(failed)?.concat().iter().map(|value| f64::from(*value)).sum::<f64>());
    for frame in [11, 12, 15] {
        let anew = mean(format!("irradiance-unguided.{frame:04}.exr"))?;
        for pipeline in ["irradiance-temporal", "irradiance-temporal-interpolated"] {
            let lives = mean(format!("{pipeline}.{frame:04}.exr"))?;
            check((lives / anew - 1.0).abs() < 0.1, || format!("{pipeline}, frame {frame}: {lives} in place of {anew}"))?;
        }
    }
    for pipeline in ["irradiance-temporal", "irradiance-temporal-interpolated", "irradiance-unguided"] {
        render(pipeline, "cornell.ron", &["-o", &format!("{pipeline}.exr")])?;
    }
    place.same("irradiance-temporal.exr", "irradiance-unguided.exr")?;
    place.same("irradiance-temporal-interpolated.exr", "irradiance-unguided.exr")?;
    // Where only the camera moves nothing ages: what is due in any case is all that is sampled.
    fs::write(
        place.path("walk.ron"),
        MOVING
            .replace("Linear([(0, (0.5, 0.5, 1)), (2, (3.5, 0.5, 1))])", "Step([(0, (0.5, 0.5, 1)), (9, (3.5, 0.5, 1))])")
            .replace("Step([(0, (0, 0, 0)), (1, (1, 1, 1))])", "(1, 1, 1)")
            .replace("Step([(0, (0, 0, 0)), (0.5, (9, 8, 7))])", "(9, 8, 7)")
            .replace("Linear([(0, (1, 2, 3)), (2, (3, 2, 3))])", "(1, 2, 3)"),
    )
    .map_err(failed)?;
    render("irradiance-temporal", "walk.ron", &["--frames", "0..24", "-o", "walk.exr"])?;
    let walked: Vec<u64> = frames(&place.stats()?).iter().skip(1).map(due).collect();
    check(walked.iter().all(|due| *due <= 4), || format!("{walked:?} are sampled while nothing changes"))
}

/// Light that is not there, or there in every other frame; things that leap, vanish, or fill the world; a camera that is elsewhere in each frame.
fn extremes() -> Outcome {
    let place = Place::new()?;
    let (stays, lit, looks) = ("translate: (1, 0.5, 1)", "(9, 9, 9)", "(2, 1.6, 5)");
    let cases = [
        ("dark", stays, "Linear([(0, (0, 0, 0)), (5, (0, 0, 0))])", "Linear([(0, (2, 1.6, 5)), (5, (2.5, 1.6, 5))])"),
        ("flashes", stays, "Step([(0, (0, 0, 0)), (1, (9, 9, 9)), (2, (0, 0, 0)), (3, (9, 9, 9)), (4, (0, 0, 0))])", looks),
        ("leaps", "translate: Step([(0, (1, 0.5, 1)), (1, (10000000, 0.5, 1)), (2, (1, 0.5, 1)), (3, (1, -10000, 1)), (4, (3, 1, 1))])", lit, looks),
        ("grows", "scale: Linear([(0, (1, 1, 1)), (3, (1000000, 1000000, 1000000))])", lit, looks),
        ("vanishes", "scale: Step([(0, (1, 1, 1)), (1, (0, 0, 0)), (2, (1, 1, 1)), (3, (0, 0, 1)), (4, (1, 1, 1))])", lit, looks),
        ("cuts", stays, lit, "Step([(0, (2, 1.6, 5)), (1, (0.2, 2.5, 0.5)), (2, (3.9, 0.1, 3)), (3, (2, 400, 5)), (4, (2, 1.6, 5))])"),
    ];
    for (name, mover, intensity, eye) in cases {
        let scene = format!(
            r#"Scene(version: 1, geometry: [
                Quad(corners: ((0, 0, 4), (4, 0, 4), (4, 0, 0), (0, 0, 0))), Quad(corners: ((0, 0, 0), (4, 0, 0), (4, 3, 0), (0, 3, 0))),
                Place({mover}, of: [Box(min: (-0.3, -0.3, -0.3), max: (0.3, 0.3, 0.3))]),
            ], materials: {{ "*": Diffuse(reflectance: (0.7, 0.6, 0.5)) }}, lights: [Point(position: (2, 2.5, 2), intensity: {intensity})], cameras: {{ "c": (eye: {eye}, target: (2, 1.3, 0), fov: 60) }})"#
        );
        fs::write(place.path("extreme.ron"), scene).map_err(failed)?;
        let sets = ["--set", "due_tiles.resolution=8", "--set", "renewed.fade=3", "--frames", "0..6", "--fps", "1", "-o"];
        let file = format!("{name}.exr");
        for pipeline in ["irradiance-temporal-extrapolated", "irradiance-temporal-interpolated"] {
            let (status, stderr) = place.render_by(pipeline, "extreme.ron", &[&sets[..], &[&file]].concat())?;
            check(status == 0 || status == 2 && stderr.contains("stage::"), || format!("{pipeline}, {name}: {status} {stderr}"))?;
            for frame in (0..6).filter(|_| status == 0) {
                let picture = place.picture(&format!("{name}.{frame:04}.exr"))?;
                let planes = picture.layers.values().flat_map(|layer| layer.channels.values());
                check(planes.flatten().all(|value| value.is_finite()), || format!("{pipeline}, {name}: frame {frame} is not finite"))?;
            }
        }
    }
    Ok(())
}

/// A place with the scene that moves, of which parts of sequences are rendered; all comes to rest after 2 s.
struct Film(Place);

impl Film {
    fn new() -> Result<Self, Failed> {
        Self::of(MOVING)
    }

    fn of(scene: &str) -> Result<Self, Failed> {
        let place = Place::new()?;
        fs::write(place.path("moving.ron"), scene).map_err(failed)?;
        Ok(Self(place))
    }

    fn arguments<'a>(frames: &'a str, output: &'a str, more: &[&'a str]) -> Vec<&'a str> {
        ["--fps", "6", "--frames", frames, "-o", output].iter().chain(more).copied().collect()
    }

    fn try_render(&self, pipeline: &str, frames: &str, output: &str, more: &[&str]) -> Result<Ended, Failed> {
        self.0.render_by(pipeline, "moving.ron", &Self::arguments(frames, output, more))
    }

    /// Renders frames that succeed; what is said meanwhile.
    fn render(&self, pipeline: &str, frames: &str, output: &str, more: &[&str]) -> Result<String, Failed> {
        let (status, stderr) = self.try_render(pipeline, frames, output, more)?;
        check(status == 0, || format!("{pipeline} {frames} {more:?}: {stderr}"))?;
        Ok(unwrapped((0, stderr)).1)
    }

    /// The frames of two sequences are the same, file by file, but for what says where records were kept.
    fn same(&self, a: &str, b: &str, frames: std::ops::Range<u32>) -> Outcome {
        frames.into_iter().try_for_each(|frame| {
            let [mut first, mut second] = [self.0.picture(&format!("{a}.{frame:04}.exr"))?, self.0.picture(&format!("{b}.{frame:04}.exr"))?];
            [&mut first, &mut second].into_iter().for_each(|picture| drop(picture.attributes.remove("cache")));
            check(first.layers == second.layers && first.attributes == second.attributes, || format!("frame {frame} of {a} and of {b} differ"))
        })
    }

    /// A sequence is rendered whole, and up to each of these frames in turn: layers and exposed pictures are the same.
    fn same_in_parts(&self, pipeline: &str, ends: &[u32], more: &[&str]) -> Outcome {
        let (whole, parts) = (format!("{pipeline}-whole"), format!("{pipeline}-parts"));
        let last = ends.last().copied().unwrap_or(0);
        let render = |range: String, name: &str, own: &[&str]| {
            let [exr, png] = [format!("{name}.exr"), format!("{name}.png")];
            self.render(pipeline, &range, &exr, &[more, own, &["-o", &png]].concat())
        };
        render(format!("0..{last}"), &whole, &[])?;
        for ends in ends.windows(2) {
            let notes = render(format!("{}..{}", ends[0], ends[1]), &parts, &["--cache", &format!("{pipeline}.cache")])?;
            check(!notes.contains("anew"), || format!("{pipeline}, frames {ends:?}: {notes}"))?;
        }
        self.same(&whole, &parts, 0..last)?;
        for frame in 0..last {
            let [a, b] = [&whole, &parts].map(|name| fs::read(self.0.path(&format!("{name}.{frame:04}.png"))));
            check(a? == b?, || format!("frame {frame} of {pipeline} is exposed otherwise"))?;
        }
        Ok(())
    }

    /// The numbers of the frames that were rendered last.
    fn rendered(&self) -> Result<Vec<u64>, Failed> {
        let stats = self.0.stats()?;
        Ok(stats["frames"].as_array().into_iter().flatten().filter_map(|frame| frame["frame"].as_u64()).collect())
    }
}

/// While a lamp goes on, while all moves and when it rests, with several samples and by the exposure of the first picture; records that live on, and those that are made
/// anew.
fn in_parts() -> Outcome {
    let film = Film::new()?;
    for (pipeline, ends, more) in [
        ("irradiance-temporal", &[0, 1, 3, 5, 7, 12, 13, 15, 16][..], &["--set", "due_tiles.resolution=8"][..]),
        ("irradiance-temporal-extrapolated", &[0, 2, 9, 11], &["--samples", "2"]),
        // Between frames that were run ahead, and right before and after them.
        ("irradiance-temporal-interpolated", &[0, 1, 2, 3, 4, 7, 10, 12], &["--set", "aged.window=4", "--set", "due_tiles.resolution=8"]),
        ("irradiance-unguided", &[0, 2, 4], &[]),
    ] {
        film.same_in_parts(pipeline, ends, more)?;
    }
    Ok(())
}

/// Records of radiance live on with what they sit on, turned with it, too: what lobes reflect is as it would be made anew, by a part of the tiles; and in parts it has the same bits.
fn shining() -> Outcome {
    let rests = [
        ("\"*\": Diffuse(reflectance: (0.7, 0.6, 0.5))", SHINING),
        (
            "translate: Linear([(0, (0.5, 0.5, 1)), (2, (3.5, 0.5, 1))])",
            "rotate: (axis: (0, 1, 0), degrees: Linear([(0, 0), (2, 30)])), translate: (1, 0.5, 1)",
        ),
        ("Step([(0, (0, 0, 0)), (1, (1, 1, 1))])", "(1, 1, 1)"),
        ("Step([(0, (0, 0, 0)), (0.5, (9, 8, 7))])", "(9, 8, 7)"),
        ("Linear([(0, (1, 2, 3)), (2, (3, 2, 3))])", "(2, 2, 3)"),
    ];
    let film = Film::of(&rests.iter().fold(MOVING.to_owned(), |scene, (from, to)| scene.replace(from, to)))?;
    let size = ["--set", "glossy_due_tiles.resolution=32", "--set", "glossy_tiles.resolution=32"];
    let mut tiles = Vec::new();
    for pipeline in ["radiance", "radiance-temporal"] {
        film.render(pipeline, "0..9", &format!("{pipeline}.exr"), &size[if pipeline == "radiance" { 2 } else { 0 }..])?;
        let stats = film.0.stats()?;
        let made = |frame: &Value| Some(numbers(frame, "glossy_misses", "new_records")? + numbers(frame, "glossy_due", "due_records").unwrap_or(0));
        tiles.push(stats["frames"].as_array().into_iter().flatten().skip(1).filter_map(made).sum::<u64>());
    }
    check(tiles[1] > 0 && 2 * tiles[1] < tiles[0], || format!("{tiles:?} tiles"))?;
    for frame in 0..9 {
        let [anew, lived] = ["radiance", "radiance-temporal"].map(|pipeline| film.0.picture(&format!("{pipeline}.{frame:04}.exr")));
        let [anew, lived] = [anew?.rgb("glossy").map_err(failed)?.concat(), lived?.rgb("glossy").map_err(failed)?.concat()];
        let apart = anew.iter().zip(&lived).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / anew.iter().map(|a| f64::from(*a)).sum::<f64>();
        check(apart < 0.1, || format!("frame {frame}: what lobes reflect is {:.1} % apart", 100.0 * apart))?;
    }
    film.same_in_parts("radiance-temporal", &[0, 2, 5, 6], &size)
}

/// What all but the lamp is made of, in place of diffuse surfaces.
const SHINING: &str = r#""*": Phong(reflectance: (0.4, 0.35, 0.3), specular: (0.5, 0.5, 0.5), exponent: 8)"#;

fn numbers(frame: &Value, node: &str, name: &str) -> Option<u64> {
    frame["passes"].as_array()?.iter().find(|pass| pass["node"] == node)?["numbers"][name].as_u64()
}

/// Of frames that are left out, of another rate, of a file without a whole frame and of another pipeline.
fn out_of_order() -> Outcome {
    let (film, pipeline) = (Film::new()?, "irradiance-temporal");
    film.render(pipeline, "0..15", "first.exr", &["--cache", "good"])?;
    let restart = |from: &str, pipeline: &str, frames: &str, more: &[&str]| {
        fs::copy(film.0.path(from), film.0.path("cache"))?;
        let notes = film.render(pipeline, frames, "second.exr", &[&["--cache", "cache"], more].concat())?;
        Ok::<_, Failed>((notes, due(&film.0.stats()?["frames"][0])))
    };
    let (notes, some) = restart("good", pipeline, "15..16", &[])?;
    check(!notes.contains("anew"), || notes)?;
    for (frames, more) in [("9..10", &[][..]), ("0..1", &[]), ("14..15", &[]), ("15..16", &["--moment", "0.1"])] {
        let (notes, all) = restart("good", pipeline, frames, more)?;
        check(notes.contains("all records of cache are sampled anew: frame 14 at 2.333"), || notes)?;
        check(all > 2 * some, || format!("{frames}: {all} records are due, where the sequence goes on {some}"))?;
    }
    // At the same moment of a scene that moves, records made anew are those that there are.
    film.render("irradiance-unguided", "4..5", "third.exr", &["--cache", "third"])?;
    film.render("irradiance-unguided", "4..5", "fourth.exr", &["--cache", "third"])?;
    check(new_records(&film.0.stats()?, 0)? == 0, || "records were made again".into())?;
    film.same("third", "fourth", 4..5)
}

/// After a process that was killed, as far as the file of records goes; where that or the pictures are others, all is rendered.
fn resumed() -> Outcome {
    let (film, pipeline) = (Film::new()?, "irradiance-temporal");
    film.render(pipeline, "0..8", "whole.exr", &[])?;
    let go_on = |more: &[&str]| film.render(pipeline, "0..8", "out.exr", &[&["--cache", "cache", "--resume"], more].concat());
    check(go_on(&["--set", "renewed.change=0.03"])?.is_empty() && film.rendered()?.len() == 8, || "there was nothing".into())?;
    let notes = go_on(&[])?;
    check(notes.contains("the sequence is begun anew: `set` of out.0000.exr is") && film.rendered()?.len() == 8, || notes)?;
    film.same("whole", "out", 0..8)?;
    // Killed in the sixth frame, after the file was saved in the third.
    film.render(pipeline, "0..3", "out.exr", &["--cache", "early"])?;
    fs::copy(film.0.path("early"), film.0.path("cache"))?;
    ["out.0005.exr", "out.0006.exr", "out.0007.exr"].iter().try_for_each(|name| fs::remove_file(film.0.path(name)))?;
    let notes = go_on(&[])?;
    check(notes.contains("3 of 8 frames are there") && film.rendered()? == [3, 4, 5, 6, 7], || notes)?;
    film.same("whole", "out", 0..8)?;
    let (saved, notes) = (fs::read(film.0.path("cache"))?, go_on(&[])?);
    check(notes.contains("8 of 8 frames are there") && film.rendered()?.is_empty(), || notes)?;
    check(fs::read(film.0.path("cache"))? == saved, || "nothing was rendered, and the file is another".into())?;
    // Longer than it was.
    film.render(pipeline, "0..9", "out.exr", &["--cache", "cache", "--resume"])?;
    check(film.rendered()? == [8], || "one is missing".into())?;
    fs::remove_file(film.0.path("out.0002.exr"))?;
    let notes = go_on(&[])?;
    check(notes.contains("begun anew: cache was not saved after one of its frames") && film.rendered()?.len() == 8, || notes)?;
    fs::write(film.0.path("out.0002.exr"), "no picture")?;
    let notes = go_on(&[])?;
    check(notes.contains("begun anew: out.0002.exr cannot be read") && film.rendered()?.len() == 8, || notes)?;
    film.same("whole", "out", 0..8)?;
    is(&film.try_render(pipeline, "0..8", "out.exr", &["--cache", "cache", "--resume", "-o", "out.apng"])?, 2, "render::resumed_movie")?;
    is(&film.try_render(pipeline, "0..8", "out.exr", &["--resume"])?, 2, "--cache")
}

/// By Ctrl-C, wherever it is then.
#[cfg(unix)]
fn interrupted_and_resumed() -> Outcome {
    let (film, pipeline, frames) = (Film::new()?, "irradiance-temporal", "0..40");
    film.render(pipeline, frames, "whole.exr", &[])?;
    let more = Film::arguments(frames, "out.exr", &["--cache", "cache", "--resume"]);
    let mut rendered = 0;
    for end in [3, 11] {
        let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_hemisplat"))
            .current_dir(film.0.0.path())
            .args(Place::arguments(pipeline, "moving.ron", &more))
            .stdout(std::process::Stdio::null())
            .stderr(std::process::Stdio::null())
            .spawn()
            .map_err(failed)?;
        let start = std::time::Instant::now();
        while !film.0.path(&format!("out.{end:04}.exr")).exists() && start.elapsed().as_secs() < 120 {
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().map_err(failed)?;
        check(child.wait().map_err(failed)?.code() == Some(130), || "it was not interrupted".into())?;
        rendered += film.rendered()?.len();
    }
    film.render(pipeline, frames, "out.exr", &["--cache", "cache", "--resume"])?;
    rendered += film.rendered()?.len();
    check(rendered == 40, || format!("{rendered} frames were rendered for 40"))?;
    film.same("whole", "out", 0..40)
}

#[cfg(not(unix))]
fn interrupted_and_resumed() -> Outcome {
    Err("there are no signals".into())
}

/// The disk is full as the third of six pictures is written.
#[cfg(target_os = "linux")]
fn failed_and_resumed() -> Outcome {
    let (film, pipeline) = (Film::new()?, "irradiance-temporal");
    film.render(pipeline, "0..6", "whole.exr", &[])?;
    std::os::unix::fs::symlink("/dev/full", film.0.path("out.0002.exr")).map_err(failed)?;
    let more = ["--cache", "cache", "--resume"];
    is(&film.try_render(pipeline, "0..6", "out.exr", &more)?, 1, "cannot write out.0002.exr")?;
    fs::remove_file(film.0.path("out.0002.exr"))?;
    let notes = film.render(pipeline, "0..6", "out.exr", &more)?;
    check(notes.contains("2 of 6 frames are there") && film.rendered()? == [2, 3, 4, 5], || notes)?;
    film.same("whole", "out", 0..6)
}

#[cfg(not(target_os = "linux"))]
fn failed_and_resumed() -> Outcome {
    Err("there is no /dev/full".into())
}

/// A box that moves, a ball that appears, a lamp that goes on, a light and a camera that wander.
const MOVING: &str = r#"Scene(version: 1, geometry: [
    Quad(corners: ((0, 0, 4), (4, 0, 4), (4, 0, 0), (0, 0, 0))),
    Quad(corners: ((0, 0, 0), (4, 0, 0), (4, 3, 0), (0, 3, 0))),
    Quad(corners: ((1, 2.9, 1), (1, 2.9, 2), (2, 2.9, 2), (2, 2.9, 1)), material: "lamp"),
    Place(translate: Linear([(0, (0.5, 0.5, 1)), (2, (3.5, 0.5, 1))]), of: [
        Box(min: (-0.3, -0.3, -0.3), max: (0.3, 0.3, 0.3)),
        Place(scale: Step([(0, (0, 0, 0)), (1, (1, 1, 1))]), translate: (0.8, 0, 0), of: [Sphere(centre: (0, 0, 0), radius: 0.3)]),
    ]),
], materials: { "lamp": Emitter(radiance: Step([(0, (0, 0, 0)), (0.5, (9, 8, 7))])), "*": Diffuse(reflectance: (0.7, 0.6, 0.5)) },
lights: [Spot(position: Linear([(0, (1, 2, 3)), (2, (3, 2, 3))]), direction: (0, -0.5, -1), intensity: (5, 5, 5), outer: 40)],
cameras: { "c": (eye: Smooth([(0, (2, 1.6, 5)), (2, (3, 1.6, 5))]), target: (2, 1.3, 0), fov: 60) })"#;

/// A bar that bends toward the camera under a lamp.
const BENDING: &str = r#"Scene(version: 1, geometry: [
    Quad(corners: ((0, 0, 4), (4, 0, 4), (4, 0, 0), (0, 0, 0))),
    Quad(corners: ((0, 0, 0), (4, 0, 0), (4, 3, 0), (0, 3, 0))),
    Place(of: [File("bar.gltf")], translate: (1.5, 0.1, 1)),
], materials: { "*": Diffuse(reflectance: (0.7, 0.6, 0.5)) }, lights: [Point(position: (2.2, 2.8, 2.5), intensity: (5, 5, 5))],
cameras: { "c": (eye: (2.5, 1.6, 5), target: (2, 1, 0), fov: 60) })"#;

// Pipelines of the tests.

const SIZE: [u32; 2] = [32, 24];

/// A pipeline of these nodes that shows one of them.
fn document(nodes: &str, output: &str) -> String {
    format!("Pipeline(version: 1, about: \"test\", nodes: [{nodes}], outputs: {{ \"picture\": \"{output}\" }})")
}

/// The layer `picture` of each of so many frames of a pipeline on a scene that ships.
fn frames(scene: &str, text: &str, count: u32) -> Result<Vec<Vec<f32>>, Failed> {
    made_ready(scene, text, |run, _| (0..count).map(|_| Ok(frame(run, &|| Pace::GoOn)?.1)).collect())
}

/// What a frame reports, and its layer `picture`.
fn frame(run: &mut Run, pace: AskPace) -> Result<(FrameReport, Vec<f32>), Failed> {
    let report = block_on(run.frame(pace)).map_err(failed)?;
    Ok((report, block_on(run.picture()).map_err(failed)?.rgb("picture").map_err(failed)?.concat()))
}

/// Works with a pipeline on a scene that ships.
fn made_ready<T>(scene: &str, text: &str, work: impl FnOnce(&mut Run, &Camera) -> Result<T, Failed>) -> Result<T, Failed> {
    let mut read = |path: &Path| if path == Path::new("test.ron") { Ok(text.to_owned()) } else { Err(io::Error::from(io::ErrorKind::NotFound)) };
    let pipeline = pipeline::load("test.ron", &[], REGISTRY, &mut read).map_err(failed)?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(scene);
    let overrides = if scene == "hall.ron" { vec![("triangles".into(), "1000".into())] } else { Vec::new() };
    let stage = Arc::new(Stage::new(load::load(&path, &load::LoadOptions { overrides, ..Default::default() }).map_err(failed)?));
    let scene = &stage.scene;
    let needs = Needs::of(scene);
    let setting = Setting { scene, needs: &needs, device: hemisplat::gpu::expected_device(), size: SIZE, tables: None };
    let plan = pipeline::plan(&pipeline, setting, &[], &kind).map_err(failed)?;
    let gpu = block_on(Gpu::open()).map_err(failed)?;
    let camera = &scene.cameras[0];
    work(&mut block_on(Run::new(&gpu, &stage, &plan, camera, SIZE)).map_err(failed)?, camera)
}

/// The light that the sums add up: every pixel of the furnace emits 1.
const FURNACE: &str = r#"(name: "gbuffer", pass: GBuffer()),"#;

fn all_are(picture: &[f32], value: f32, what: &str) -> Outcome {
    let other = picture.iter().find(|v| **v != value);
    check(!picture.is_empty() && other.is_none(), || format!("{what}: a pixel is {other:?}, not {value}"))
}

fn sum_over_rounds() -> Outcome {
    let nodes = format!(
        "{FURNACE} (name: \"loop\", repeat: Iterate(rounds: 5, nodes: [(name: \"sum\", pass: Composite(gbuffer: \"gbuffer\", indirect: PreviousRound(\"sum\")))]))"
    );
    for (frame, picture) in frames("furnace.ron", &document(&nodes, "sum"), 3)?.iter().enumerate() {
        all_are(picture, 5.0, &format!("frame {frame}"))?;
    }
    Ok(())
}

/// A sum over frames; a second node lags behind it, and a sum over two rounds takes both in.
fn sum_over_frames() -> Outcome {
    let nodes = format!(
        "{FURNACE} (name: \"sum\", pass: Composite(gbuffer: \"gbuffer\", indirect: PreviousFrame(\"sum\"))),
        (name: \"late\", pass: Composite(gbuffer: \"gbuffer\", indirect: PreviousFrame(\"loop_sum\"))),
        (name: \"loop\", repeat: Iterate(rounds: 2, nodes: [
            (name: \"loop_sum\", pass: Composite(gbuffer: \"gbuffer\", indirect: PreviousFrame(\"sum\"))),
            (name: \"both\", pass: Composite(gbuffer: \"gbuffer\", indirect: PreviousRound(\"loop_sum\"))),
        ]))"
    );
    // Frame n (from 0): sum = n + 1; loop_sum = 1 + what sum was = n + 1; late = 1 + what loop_sum was; both = 1 + loop_sum of the first round.
    for (output, expected) in [("sum", [1.0, 2.0, 3.0, 4.0]), ("late", [1.0, 2.0, 3.0, 4.0]), ("both", [2.0, 3.0, 4.0, 5.0])] {
        for (picture, value) in frames("furnace.ron", &document(&nodes, output), 4)?.iter().zip(expected) {
            all_are(picture, value, output)?;
        }
    }
    Ok(())
}

/// A fill that covers everything, with other loops and nodes around it; shows `output`.
fn filled(fill: &str, more: &str, output: &str) -> String {
    let nodes = format!(
        r#"(name: "gbuffer", pass: GBuffer()), (name: "direct", pass: DirectLight(gbuffer: "gbuffer")), (name: "cache", pass: RecordCache(accuracy: 0.3)),
        {fill}, (name: "indirect", pass: Normalize(splats: "splats", gbuffer: "gbuffer")), {more}"#
    );
    document(&nodes, output)
}

const FILL: &str = r#"(name: "fill", repeat: Fill(order: Batched(at_most: 64), until: "misses.none", nodes: [
        (name: "splats", pass: Splat(records: "cache", gbuffer: "gbuffer")),
        (name: "misses", pass: FindMisses(gbuffer: "gbuffer", splats: "splats")),
        (name: "tiles", pass: HemisphereTiles(at: "misses", direct: "direct", resolution: 8)),
        (name: "closed", pass: Compensation(of: "tiles")),
        (name: "records", pass: IrradianceSum(of: "closed")),
        (name: "added", pass: AddRecords(to: "cache", records: "records")),
    ]))"#;

/// What depends on the scene alone is there in each frame, and made in the first.
fn shadow_maps_once() -> Outcome {
    let nodes = "(name: \"gbuffer\", pass: GBuffer()), (name: \"shadow\", pass: ShadowMap(resolution: 64)),
        (name: \"direct\", pass: DirectLight(gbuffer: \"gbuffer\", shadow: \"shadow\")),
        (name: \"image\", pass: Composite(gbuffer: \"gbuffer\", direct: \"direct\"))";
    made_ready("hall.ron", &document(nodes, "image"), |run, camera| {
        let drawn = |run: &mut Run| {
            let (report, picture) = frame(run, &|| Pace::GoOn)?;
            let runs = report.passes.iter().find(|pass| pass.node == "shadow").map(|pass| pass.runs);
            Ok::<_, Failed>((runs, picture))
        };
        let first = drawn(run)?;
        run.set_camera(&Camera { eye: camera.eye + 0.2, ..camera.clone() });
        let (later, still) = (drawn(run)?, drawn(run)?);
        block_on(run.reset()).map_err(failed)?;
        let anew = drawn(run)?;
        check([first.0, later.0, still.0, anew.0] == [1, 0, 0, 1].map(Some), || format!("{:?}", [first.0, later.0, still.0, anew.0]))?;
        check(first.1 != later.1 && later.1 == still.1 && later.1 == anew.1, || "frames differ".into())
    })
}

/// A light that dims leaves its maps as they are, what moves does not; each frame is that of its moment, bit for bit.
fn shadow_maps_follow() -> Outcome {
    let place = Place::new()?;
    let (dims, moves) = ("Step([(0, (5, 5, 5)), (1, (2, 2, 2))])", "Step([(0, (1, 0.5, 1)), (2, (3, 0.5, 2))])");
    let scene = format!(
        r#"Scene(version: 1, geometry: [
            Quad(corners: ((0, 0, 4), (4, 0, 4), (4, 0, 0), (0, 0, 0))), Quad(corners: ((0, 0, 0), (4, 0, 0), (4, 3, 0), (0, 3, 0))),
            Place(translate: {moves}, of: [Box(min: (-0.3, -0.3, -0.3), max: (0.3, 0.3, 0.3))]),
        ], materials: {{ "*": Diffuse(reflectance: (0.7, 0.6, 0.5)) }}, lights: [Point(position: (2, 2.5, 2), intensity: {dims})],
        cameras: {{ "c": (eye: (2, 1.6, 5), target: (2, 1.3, 0), fov: 60) }})"#
    );
    fs::write(place.path("moving.ron"), scene).map_err(failed)?;
    let render = |more: &[&str]| {
        let (status, stderr) = place.render_by("irradiance-one-rate", "moving.ron", &[&["--set", "tiles.resolution=8", "--fps", "1"], more].concat())?;
        check(status == 0, || stderr)
    };
    render(&["--frames", "0..4", "-o", "all.exr"])?;
    let runs = maps_drawn(&place.stats()?);
    check(runs == [1, 0, 1, 0], || format!("maps are drawn {runs:?} times"))?;
    for frame in 0..4 {
        render(&["--moment", &frame.to_string(), "-o", "one.exr"])?;
        place.same(&format!("all.{frame:04}.exr"), "one.exr")?;
    }
    Ok(())
}

/// Twice in a loop: the second time everything is covered already.
fn fill_in_a_loop() -> Outcome {
    let once = frames("cornell.ron", &filled(FILL, "", "indirect.irradiance"), 1)?;
    check(once[0].iter().any(|v| *v > 0.0), || "no light".into())?;
    let twice = format!("(name: \"twice\", repeat: Iterate(rounds: 2, nodes: [{FILL}]))");
    check(frames("cornell.ron", &filled(&twice, "", "indirect.irradiance"), 1)? == once, || "a fill that runs twice draws another picture".into())?;
    // A splat outside of fills adds all records each time.
    let again = r#"(name: "again", repeat: Iterate(rounds: 3, nodes: [(name: "resplats", pass: Splat(records: "added", gbuffer: "gbuffer"))])),
        (name: "same", pass: Normalize(splats: "resplats", gbuffer: "gbuffer"))"#;
    let resplatted = frames("cornell.ron", &filled(FILL, again, "same.irradiance"), 2)?;
    check(resplatted == [once.clone(), once].concat(), || "a splat in a loop forgets records".into())
}

/// Buffers, numbers and depth textures, not images alone.
fn earlier_memory() -> Outcome {
    let late = r#"(name: "late_splats", pass: Splat(records: PreviousFrame("added"), gbuffer: "gbuffer")),
        (name: "late", pass: Normalize(splats: "late_splats", gbuffer: "gbuffer"))"#;
    let [now, late] = ["indirect.irradiance", "late.irradiance"].map(|output| frames("cornell.ron", &filled(FILL, late, output), 2));
    let (now, late) = (now?, late?);
    all_are(&late[0], 0.0, "records before the first frame")?;
    check(late[1] == now[0], || "the records of the frame before draw another picture".into())?;

    let lit = |rounds: u32, shadow: &str| {
        let nodes = format!(
            "(name: \"gbuffer\", pass: GBuffer()), (name: \"loop\", repeat: Iterate(rounds: {rounds}, nodes: [
                (name: \"shadow\", pass: ShadowMap(resolution: 64)), (name: \"direct\", pass: DirectLight(gbuffer: \"gbuffer\", shadow: {shadow}))]))"
        );
        frames("hall.ron", &document(&nodes, "direct"), 2)
    };
    let (shadowed, first, second) = (lit(1, "\"shadow\"")?, lit(1, "PreviousRound(\"shadow\")")?, lit(2, "PreviousRound(\"shadow\")")?);
    check(first[0] != shadowed[0] && first[0] == first[1], || "the first round of each frame sees empty maps".into())?;
    check(second == shadowed, || "the second round sees the maps of the first".into())
}

// The program.

/// An empty folder to run in.
struct Place(TempDir);

/// Small and quick: few rays a record, few records.
const SMALL: [&str; 10] =
    ["--size", "40x30", "--set", "tiles.resolution=8", "--set", "cache.accuracy=0.4", "--set", "cache.minimum_spacing=4", "--stats", "stats.json"];

/// Exit status and stderr.
type Ended = (i32, String);

impl Place {
    fn new() -> Result<Self, Failed> {
        Ok(Self(tempfile::tempdir().map_err(failed)?))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn names(&self) -> Result<Vec<String>, Failed> {
        let entries = fs::read_dir(self.0.path()).map_err(failed)?;
        let mut names: Vec<String> = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        Ok(names)
    }

    fn arguments(pipeline: &str, scene: &str, more: &[&str]) -> Vec<String> {
        ["render", pipeline, "--scene", scene].iter().chain(&SMALL).chain(more).map(|argument| argument.to_string()).collect()
    }

    fn render_by(&self, pipeline: &str, scene: &str, more: &[&str]) -> Result<Ended, Failed> {
        self.run(Self::arguments(pipeline, scene, more))
    }

    fn run(&self, arguments: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Result<Ended, Failed> {
        let output = Command::new(env!("CARGO_BIN_EXE_hemisplat")).current_dir(self.0.path()).args(arguments).output().map_err(failed)?;
        Ok((output.status.code().ok_or("no exit status")?, String::from_utf8_lossy(&output.stderr).into_owned()))
    }

    fn render_scene(&self, scene: &str, more: &[&str]) -> Result<Ended, Failed> {
        self.render_by("irradiance-one-rate", scene, more)
    }

    /// Renders the Cornell box, in one loop.
    fn render(&self, more: &[&str]) -> Result<Ended, Failed> {
        self.render_scene("cornell.ron", more)
    }

    /// The statistics of a run that succeeds.
    fn rendered(&self, more: &[&str]) -> Result<Value, Failed> {
        self.rendered_by("irradiance-one-rate", more)
    }

    fn rendered_by(&self, pipeline: &str, more: &[&str]) -> Result<Value, Failed> {
        let (status, stderr) = self.render_by(pipeline, "cornell.ron", more)?;
        check(status == 0, || format!("status {status}: {stderr}"))?;
        self.stats()
    }

    fn stats(&self) -> Result<Value, Failed> {
        serde_json::from_slice(&fs::read(self.path("stats.json")).map_err(failed)?).map_err(failed)
    }

    fn picture(&self, name: &str) -> Result<Layers, Failed> {
        Layers::read(&fs::read(self.path(name)).map_err(|error| format!("{name}: {error}"))?).map_err(failed)
    }

    /// Every layer of two pictures has the same bits.
    fn same(&self, a: &str, b: &str) -> Outcome {
        let [first, second] = [self.picture(a)?, self.picture(b)?];
        check(first.layers == second.layers, || format!("{a} and {b} differ"))
    }

    /// A Cornell box with a second camera, and with this lamp.
    fn with_two_cameras(self, lamp: &str) -> Result<Self, Failed> {
        let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.ron")).map_err(failed)?;
        let text = text.replace("cameras: {", "cameras: {\n\"side\": (eye: (400, 300, -700), target: (200, 200, 300), fov: 37.6),").replace("27.6", lamp);
        fs::write(self.path("two.ron"), text).map_err(failed)?;
        Ok(self)
    }
}

/// How often the shadow maps of each frame were drawn.
fn maps_drawn(stats: &Value) -> Vec<u64> {
    let runs = |frame: &Value| frame["passes"].as_array()?.iter().find(|pass| pass["node"] == "shadow")?["runs"].as_u64();
    stats["frames"].as_array().into_iter().flatten().filter_map(runs).collect()
}

/// How many records of a frame were sampled anew.
fn due(frame: &Value) -> u64 {
    let passes = frame["passes"].as_array().into_iter().flatten();
    passes.filter_map(|pass| pass["numbers"]["due_records"].as_u64()).sum()
}

fn number(stats: &Value, frame: usize, name: &str) -> Result<u64, Failed> {
    stats["frames"][frame].pointer(name).and_then(Value::as_u64).ok_or_else(|| format!("frame {frame} tells no {name}").into())
}

fn new_records(stats: &Value, frame: usize) -> Result<u64, Failed> {
    number(stats, frame, "/new_records")
}

fn is(found: &Ended, status: i32, text: &str) -> Outcome {
    check(found.0 == status && found.1.contains(text), || format!("expected status {status} and `{text}`, got {}: {}", found.0, found.1))
}

fn same_view() -> Outcome {
    let place = Place::new()?;
    let stats = place.rendered(&["--frames", "0..2", "-o", "out.exr", "-o", "out.png"])?;
    check(new_records(&stats, 0)? > 0 && new_records(&stats, 1)? == 0, || format!("{stats}"))?;
    check(place.names()? == ["out.0000.exr", "out.0000.png", "out.0001.exr", "out.0001.png", "stats.json"], || format!("{:?}", place.names()))?;
    place.same("out.0000.exr", "out.0001.exr")
}

fn second_view() -> Outcome {
    let place = Place::new()?.with_two_cameras("27.6")?;
    let render = |more: &[&str]| {
        let ended = place.render_scene("two.ron", more)?;
        is(&ended, 0, "").and_then(|()| place.stats())
    };
    let cold = new_records(&render(&["--camera", "side", "-o", "cold.exr"])?, 0)?;
    let stats = render(&["--camera", "main", "--camera", "side", "-o", "out.exr"])?;
    let warm = new_records(&stats, 1)?;
    check(warm > 0 && warm < cold, || format!("{cold} records from cold, {warm} after another view"))?;
    check(stats["frames"][1]["camera"] == "side" && stats["complete"] == true, || format!("{stats}"))?;
    // The scene's own cameras are a timeline as well.
    render(&["--frames", "0..2", "-o", "own.exr"])?;
    let cameras = ["own.0000.exr", "own.0001.exr"].map(|name| place.picture(name).map(|picture| picture.attributes["camera"].clone()));
    check(matches!(&cameras, [Ok(first), Ok(second)] if first == "side" && second == "main"), || format!("{cameras:?}"))?;
    let explained = Command::new(env!("CARGO_BIN_EXE_hemisplat"))
        .current_dir(place.0.path())
        .args(["explain", "irradiance", "--scene", "two.ron", "--camera", "main", "--camera", "side"])
        .output()
        .map_err(failed)?;
    check(explained.status.code() == Some(2), || "one command, one camera".into())
}

fn saved_records(pipeline: &str) -> Outcome {
    let place = Place::new()?;
    let first = place.rendered_by(pipeline, &["--cache", "new/records", "-o", "first.exr"])?;
    let saved = fs::read(place.path("new/records")).map_err(failed)?;
    let second = place.rendered_by(pipeline, &["--cache", "new/records", "-o", "second.exr"])?;
    check(new_records(&second, 0)? == 0, || format!("{second}"))?;
    check(number(&first, 0, "/records/irradiance")? == number(&second, 0, "/records/irradiance")?, || format!("{second}"))?;
    place.same("first.exr", "second.exr")?;
    check(fs::read(place.path("new/records")).map_err(failed)? == saved, || "saved again, the file is another".into())
}

/// Runs that begin with the same frame go on with a lightmap as frames of one run do, or with more iterations; a lightmap of another size is no use.
fn kept_lightmap() -> Outcome {
    let place = Place::new()?;
    let render = |more: &[&str]| -> Result<Ended, Failed> {
        let small = ["--size", "40x30", "--set", "shooters.shooters=16", "--stats", "stats.json"];
        place.run(["render", "radiosity", "--scene", "cornell"].iter().chain(&small).chain(more))
    };
    let iterations = || Ok::<_, Failed>(numbers(&place.stats()?["frames"][0], "lightmap", "iterations"));
    let five = ["--set", "lightmap.resolution=32", "--set", "lightmap.iterations=5"];
    let kept = ["--cache", "map", "-o", "part.exr"];
    is(&render(&[&five[..], &["--frames", "0..3", "-o", "whole.exr"]].concat())?, 0, "")?;
    for made in 5..8 {
        is(&render(&[&five[..], &kept].concat())?, 0, "")?;
        check(iterations()? == Some(made), || format!("{:?} instead of {made} iterations", iterations()))?;
    }
    place.same("whole.0002.exr", "part.exr")?;
    is(&render(&[&["--set", "lightmap.resolution=32", "--set", "lightmap.iterations=12"], &kept[..]].concat())?, 0, "")?;
    check(iterations()? == Some(12), || format!("{:?} instead of 12 iterations", iterations()))?;
    is(&render(&[&["--set", "lightmap.resolution=64"], &kept[..]].concat())?, 2, "`texels` were made by Lightmap(")
}

fn bad_records() -> Outcome {
    let place = Place::new()?.with_two_cameras("27.5")?;
    place.rendered(&["--cache", "records", "-o", "first.exr"])?;
    let good = fs::read(place.path("records")).map_err(failed)?;
    let start = good.iter().position(|b| *b == b'\n').ok_or("no header")? + 1;
    let header = String::from_utf8_lossy(&good[..start]).into_owned();
    let with_header = |header: String| [header.as_bytes(), &good[start..]].concat();
    let flipped = |at: usize| good.iter().enumerate().map(|(i, b)| if i == at { b ^ 1 } else { *b }).collect::<Vec<u8>>();
    let bad: [(&str, Vec<u8>, &str); 8] = [
        ("empty", Vec::new(), "it has no header"),
        ("text", b"not records\n".to_vec(), "its header cannot be read"),
        ("cut in the header", good[..40].to_vec(), "it has no header"),
        ("cut", good[..good.len() - 7].to_vec(), "its header tells of"),
        ("longer", [good.as_slice(), b"more"].concat(), "its header tells of"),
        ("a bit flipped", flipped(start + 100), "it is damaged"),
        ("an older version", with_header(header.replace("hemisplat records 5", "hemisplat records 4")), "`hemisplat records 5` is known"),
        ("another header", with_header(header.replacen("\"name\":\"records\"", "\"name\":\"photons\"", 1)), "it is damaged"),
    ];
    for (name, contents, message) in bad {
        fs::write(place.path("bad"), &contents).map_err(failed)?;
        is(&place.render(&["--cache", "bad", "-o", "out.exr"])?, 2, message).map_err(|error| format!("{name}: {:?}", error.message()))?;
        check(fs::read(place.path("bad")).map_err(failed)? == contents, || format!("{name}: the file is lost"))?;
    }
    // The same triangles under another lamp.
    is(&place.render_scene("two.ron", &["--cache", "records", "-o", "out.exr"])?, 2, "another state of the scene")?;
    is(&place.render(&["--cache", "records", "--set", "cache.capacity=1", "-o", "out.exr"])?, 2, "has room for 1")?;
    // Records that other nodes made: what differs is told.
    for (set, theirs) in [
        ("tiles.resolution=16", "were made by HemisphereTiles("),
        ("tiles.taps=9", "were made by HemisphereTiles("),
        ("records.gradients=false", "were made by IrradianceSum("),
        ("closed.method=None", "were made by Compensation("),
        ("direct.emitters=Records", "were made by direct: lights from emitters: true"),
    ] {
        is(&place.render(&["--cache", "records", "--set", set, "-o", "out.exr"])?, 2, theirs)?;
    }
    check(fs::read(place.path("records")).map_err(failed)? == good, || "a file that is refused stays as it is".into())?;
    // Those that only say where records stand, or how they count, do not matter.
    for set in ["misses.by=Scan", "cache.accuracy=0.5", "fill.order=Batched(at_most: 32)", "direct.emitters.area_samples=4"] {
        place.rendered(&["--cache", "records", "--set", set, "-o", "fits.exr"])?;
    }
    check(!place.path("out.exr").exists(), || "a picture was written".into())
}

/// Of two loops that add to one cache, each is told from others.
fn records_of_other_loops() -> Outcome {
    let place = Place::new()?;
    place.rendered_by("irradiance", &["--cache", "records", "-o", "first.exr"])?;
    for (set, theirs) in [
        ("tiles.resolution=16", "were made by HemisphereTiles("),
        ("closed.method=None", "were made by Compensation("),
        ("detail_tiles.resolution=16", "were made by HemisphereTiles("),
        ("detail_closed.method=None", "were made by Compensation("),
        ("detail_records.gradients=false", "were made by IrradianceSum("),
    ] {
        is(&place.render_by("irradiance", "cornell.ron", &["--cache", "records", "--set", set, "-o", "out.exr"])?, 2, theirs)?;
    }
    is(&place.render_by("irradiance-one-rate", "cornell.ron", &["--cache", "records", "-o", "out.exr"])?, 2, "were made by")?;
    place.rendered_by("irradiance", &["--cache", "records", "--set", "cache.accuracy=0.5", "-o", "fits.exr"]).map(drop)
}

/// What a bounded fill leaves covers what the same records cover when they are splatted again.
fn bounded_fill() -> Outcome {
    let place = Place::new()?;
    let bounded = place.rendered(&["--set", "fill.max_rounds=6", "--cache", "records", "-o", "bounded.exr"])?;
    // A first round is the last one, too, and adds nothing.
    let again = place.rendered(&["--set", "fill.max_rounds=1", "--cache", "records", "-o", "again.exr"])?;
    check(number(&bounded, 0, "/fill_rounds")? == 6 && new_records(&bounded, 0)? > 0 && new_records(&again, 0)? == 0, || format!("{bounded} {again}"))?;
    check(number(&bounded, 0, "/uncovered_pixels")? == number(&again, 0, "/uncovered_pixels")?, || format!("{bounded} {again}"))?;
    place.same("bounded.exr", "again.exr")
}

/// The disk is full as the second of three pictures is written.
#[cfg(target_os = "linux")]
fn failing_frame() -> Outcome {
    let place = Place::new()?;
    std::os::unix::fs::symlink("/dev/full", place.path("out.0001.exr")).map_err(failed)?;
    is(&place.render(&["--frames", "0..3", "--cache", "records", "-o", "out.exr"])?, 1, "cannot write out.0001.exr")?;
    let stats = place.stats()?;
    check(stats["frames"].as_array().map_or(0, Vec::len) == 1 && stats["complete"] == false, || format!("{stats}"))?;
    let after = place.rendered(&["--cache", "records", "-o", "after.exr"])?;
    check(new_records(&after, 0)? == 0, || format!("{after}"))?;
    place.same("out.0000.exr", "after.exr")
}

#[cfg(not(target_os = "linux"))]
fn failing_frame() -> Outcome {
    Err("there is no /dev/full".into())
}

/// A fill of one record a round takes longer than a second.
fn progress() -> Outcome {
    let place = Place::new()?;
    // More records than any machine makes one by one in the time it has: the bar waits for a second of work.
    let slow = ["--size", "640x480", "--set", "fill.order=Batched(at_most: 1)", "--set", "cache.accuracy=0.05", "--time", "3", "-o", "out.exr"];
    let arguments: Vec<String> = ["render", "irradiance", "--scene", "cornell"].iter().chain(&slow).map(|a| a.to_string()).collect();
    let quoted: Vec<String> = arguments.iter().map(|argument| format!("'{argument}'")).collect();
    let command = format!("'{}' {}", env!("CARGO_BIN_EXE_hemisplat"), quoted.join(" "));
    let plain = Command::new(env!("CARGO_BIN_EXE_hemisplat")).current_dir(place.0.path()).args(&arguments).output().map_err(failed)?;
    let shows = |bytes: &[u8]| String::from_utf8_lossy(bytes).contains("frame 0, round");
    check(!shows(&plain.stderr) && !shows(&plain.stdout), || "a bar where no terminal is".into())?;
    let terminal = std::process::Command::new("script").current_dir(place.0.path()).args(["-qec", &command, "/dev/null"]).output().map_err(failed)?;
    check(shows(&terminal.stdout), || String::from_utf8_lossy(&terminal.stdout).into_owned())
}

fn gaps() -> Outcome {
    let place = Place::new()?;
    let short = ["--set", "fill.max_rounds=2", "-o"];
    let ended = place.render(&[&short[..], &["lax.exr"]].concat())?;
    is(&ended, 0, "pixels see a surface that no record covers")?;
    check(place.stats()?["complete"] == false, || "a gap is no complete picture".into())?;
    fs::remove_file(place.path("stats.json")).map_err(failed)?;
    is(&place.render(&[&short[..], &["strict.exr", "--strict"]].concat())?, 1, "render::incomplete")?;
    check(place.stats()?["frames"][0]["complete"] == false, || "strict or not, it is told".into())?;
    place.same("lax.exr", "strict.exr")?;
    let both = place.render(&["--strict", "--set", "misses.at_most=2", "--frames", "0..2", "-o", "two.exr"])?;
    is(&both, 1, "frame 0:").and_then(|()| is(&both, 1, "frame 1:"))?;
    is(&place.render(&["--strict", "-o", "whole.exr"])?, 0, "")?;
    check(place.stats()?["complete"] == true, || "no gap is a complete picture".into())
}

fn bounded_frames(pipeline: &str) -> Outcome {
    let place = Place::new()?;
    let whole = new_records(&place.rendered_by(pipeline, &["-o", "whole.exr"])?, 0)?;
    let frames = whole.div_ceil(20) as usize * 2;
    let stats = place.rendered_by(pipeline, &["--set", "misses.at_most=20", "--frames", &format!("0..{frames}"), "-o", "out.exr"])?;
    let mut all = 0;
    for frame in 0..frames {
        let new = new_records(&stats, frame)?;
        all += new;
        check(new <= 20 && number(&stats, frame, "/records/irradiance")? == all, || format!("frame {frame}: {stats}"))?;
        // What a frame adds is in its picture: the frame after it starts with as few gaps.
        let uncovered = number(&stats, frame, "/uncovered_pixels")?;
        check(frame == 0 || uncovered <= number(&stats, frame - 1, "/uncovered_pixels")?, || format!("frame {frame}: {stats}"))?;
    }
    check(stats["frames"][0]["complete"] == false && stats["frames"][frames - 1]["complete"] == true, || format!("{stats}"))
}

fn accuracy_per_frame() -> Outcome {
    let place = Place::new()?;
    let stats = place.rendered(&["--set-frames", "cache.accuracy=0.6,0.3", "--frames", "0..3", "-o", "out.exr"])?;
    let [first, second, third] = [new_records(&stats, 0)?, new_records(&stats, 1)?, new_records(&stats, 2)?];
    check(first > 0 && second > 0 && third == 0, || format!("{stats}"))?;
    check(stats["frames"][1]["set"].to_string().contains("cache.accuracy=0.3"), || format!("{stats}"))?;
    place.same("out.0001.exr", "out.0002.exr")?;
    // Two runs that hand the records on in a file draw the same.
    place.rendered(&["--set", "cache.accuracy=0.6", "--cache", "records", "-o", "coarse.exr"])?;
    place.rendered(&["--set", "cache.accuracy=0.3", "--cache", "records", "-o", "fine.exr"])?;
    place.same("out.0000.exr", "coarse.exr")?;
    place.same("out.0001.exr", "fine.exr")
}

fn refused_per_frame() -> Outcome {
    let place = Place::new()?;
    let refusal = |set: &str, message: &str| is(&place.render(&["--set", "tiles.place=Device", "--set-frames", set, "-o", "out.exr"])?, 2, message);
    for (set, what) in [
        ("tiles.resolution=8,16", "`tiles.directions` needs other memory"),
        ("splats.by=RasterBlend,ComputeTiles", "`splats.masks` is there in one only"),
        ("records.gradients=true,false", "`records` does other work"),
    ] {
        refusal(set, &format!("frame 1 cannot share memory and shaders with the frames before it: {what}"))?;
    }
    refusal("cache.accuracy=0.3,77", "pipeline::out_of_range")?;
    refusal("cache.accuracy=", "sets nothing")?;
    check(!place.path("out.0000.exr").exists(), || "refused before any frame".into())
}

fn time_is_up() -> Outcome {
    let place = Place::new()?;
    is(&place.render(&["--time", "0", "-o", "none.exr"])?, 0, "time was up")?;
    is(&place.render(&["--time", "0", "-o", "none.exr", "--strict"])?, 1, "render::incomplete")?;
    check(place.picture("none.exr")?.attributes["time"] == "0", || "the time is not told".into())?;
    let stats = place.rendered(&["--time", "1e4", "-o", "all.exr"])?;
    check(stats["complete"] == true, || format!("{stats}"))?;
    place.rendered(&["-o", "untimed.exr"])?;
    place.same("all.exr", "untimed.exr")?;
    for wrong in ["-1", "soon", "inf"] {
        is(&place.render(&[&format!("--time={wrong}"), "-o", "x.exr"])?, 2, "seconds")?;
    }
    Ok(())
}

/// Pixels that see a surface and have no light in a layer.
fn dark_pixels(picture: &Layers, layer: &str, is_lit: impl Fn(usize) -> bool) -> Result<usize, Failed> {
    let light = picture.luminance(layer).map_err(failed)?;
    Ok((0..light.len()).filter(|pixel| is_lit(*pixel) && light[*pixel] <= 0.0).count())
}

/// A picture of the few records that are made whatever the time is near the whole one, in a layer.
fn no_time(pipeline: &str, scene: &str, layer: &str, most: f64) -> Outcome {
    let place = Place::new()?;
    let scene = format!("{scene}.ron");
    is(&place.render_by(pipeline, &scene, &["-o", "whole.exr"])?, 0, "")?;
    is(&place.render_by(pipeline, &scene, &["--time", "0", "-o", "none.exr"])?, 0, "time was up")?;
    let stats = place.stats()?;
    let [frame, told] = [&stats["frames"][0], &stats["frames"][0]["coarse_pixels"]];
    let told = told.as_u64().is_some_and(|pixels| pixels > 0) && frame["coarsest"].as_u64().is_some_and(|times| times > 1);
    check(stats["complete"] == false && frame["complete"] == false && frame["uncovered_pixels"] == 0 && told, || format!("{stats}"))?;
    let [whole, none] = [place.picture("whole.exr")?, place.picture("none.exr")?];
    let [truth, found] = [whole.luminance(layer).map_err(failed)?, none.luminance(layer).map_err(failed)?];
    check(dark_pixels(&none, layer, |pixel| truth[pixel] > 0.0)? == 0, || format!("{layer} is dark where it is lit with time"))?;
    let squares: f64 = truth.iter().zip(&found).map(|(a, b)| (a - b).powi(2)).sum();
    let error = (squares * truth.len() as f64).sqrt() / truth.iter().sum::<f64>();
    println!("{pipeline}, {layer}: {error} of the mean");
    check(error < most, || format!("{error} of the mean apart"))
}

/// By host and device, in batches and one by one, in two loops, with other weights.
fn ways_without_time() -> Outcome {
    let place = Place::new()?;
    let fills = ["irradiance", "irradiance-device", "irradiance-compute-splat", "irradiance-host-scan", "irradiance-sequential", "irradiance-ward"];
    for pipeline in fills.into_iter().chain(["radiance-blend", "radiance-half"]) {
        let stats = place.rendered_by(pipeline, &["--time", "0", "-o", "none.exr"])?;
        let picture = place.picture("none.exr")?;
        let depth = picture.luminance("depth").map_err(failed)?;
        let dark = dark_pixels(&picture, "irradiance", |pixel| depth[pixel] > 0.0)?;
        check(dark == 0 && number(&stats, 0, "/uncovered_pixels")? == 0, || format!("{pipeline}: {dark} pixels are dark: {stats}"))?;
        check(number(&stats, 0, "/coarse_pixels")? > 0 && stats["complete"] == false, || format!("{pipeline}: {stats}"))?;
    }
    Ok(())
}

/// Time that ends after one more round and one more: the pixels that miss a record become fewer, and the picture comes nearer to the whole one.
fn rounds_in_time() -> Outcome {
    let errors: Vec<(u32, f32)> = made_ready("cornell.ron", &filled(&FILL.replace("at_most: 64", "at_most: 4"), "", "indirect.irradiance"), |run, _| {
        let whole = frame(run, &|| Pace::GoOn)?.1;
        let mean = whole.iter().sum::<f32>() / whole.len() as f32;
        let error = |found: &[f32]| (found.iter().zip(&whole).map(|(a, b)| (a - b).powi(2)).sum::<f32>() / whole.len() as f32).sqrt() / mean;
        let with_rounds = |rounds: u32| {
            block_on(run.reset()).map_err(failed)?;
            let asked = AtomicU32::new(0);
            let pace = || Pace::Within(Duration::from_secs(if asked.fetch_add(1, Ordering::Relaxed) < rounds { 3600 } else { 0 }));
            let (report, found) = frame(run, &pace)?;
            Ok((report.coarse_pixels.ok_or("no number of pixels")?, error(&found)))
        };
        [0, 30, 1000].into_iter().map(with_rounds).collect()
    })?;
    println!("pixels without a record near enough, and error: {errors:?}");
    check(errors.windows(2).all(|pair| pair[0].0 > pair[1].0 && pair[0].1 > pair[1].1) && errors[2] == (0, 0.0), || format!("{errors:?}"))
}

fn full_cache() -> Outcome {
    let place = Place::new()?;
    for misses in ["misses.place=Device", "misses.by=Scan"] {
        let stats = place.rendered(&["--set", "cache.capacity=30", "--set", misses, "-o", "out.exr"])?;
        check(number(&stats, 0, "/records/irradiance")? == 30 && stats["complete"] == false, || format!("{misses}: {stats}"))?;
    }
    Ok(())
}

/// With its messages in one line.
fn unwrapped((status, text): Ended) -> Ended {
    (status, text.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" "))
}

/// What stops a fill, in the warning and in the statistics.
fn reasons() -> Outcome {
    let place = Place::new()?;
    let cases = [
        (["--set", "cache.capacity=30"], "cache_full", "`fill` ended because the cache is full", "`capacity`"),
        (["--set", "misses.at_most=20"], "frame_limit", "`fill` ended because a frame may add no more records", "`at_most`"),
        (["--set", "fill.max_rounds=3"], "rounds", "`fill` ended because it had no round left", "`max_rounds`"),
        (["--time", "0"], "time", "`fill` ended because the time was up", "--time"),
    ];
    for (more, because, sentence, help) in cases {
        let ended = place.render(&[&more[..], &["-o", "out.exr"]].concat())?;
        let ended = unwrapped(ended);
        is(&ended, 0, sentence)?;
        is(&ended, 0, help)?;
        let told = &place.stats()?["frames"][0]["unfinished"];
        check(*told == serde_json::json!([{ "loop": "fill", "because": because }]), || format!("{because}: {told}"))?;
    }
    let whole = place.rendered(&["-o", "out.exr"])?;
    check(whole["frames"][0]["unfinished"] == serde_json::json!([]), || format!("{whole}"))?;
    // What no round brings: light of more bounces.
    let [share, low, high] =
        ["share", "interval/0", "interval/1"].map(|key| whole.pointer(&format!("/frames/0/left_out/{key}")).and_then(serde_json::Value::as_f64));
    check(whole["frames"][0]["left_out"]["bounces"] == 1 && low < share && share < high && high < Some(0.9), || format!("{whole}"))
}

/// Records are made where another search asks for them, and that search asks for one.
fn no_progress() -> Outcome {
    let place = Place::new()?;
    for (order, key, way) in [
        ("Batched(at_most: 8)", "place", "Host"),
        ("Batched(at_most: 8)", "place", "Device"),
        ("Batched(at_most: 8)", "by", "Scan"),
        ("Sequential", "by", "Scan"),
    ] {
        let variant = format!(
            r#"Variant(version: 1, about: "test", of: "irradiance-one-rate.ron",
                add: {{ "misses": [(name: "others", pass: FindMisses(gbuffer: "gbuffer", splats: "splats", at_most: 1))] }},
                set: {{ "fill.order": {order}, "misses.{key}": {way}, "tiles.at": "others" }})"#
        );
        fs::write(place.path("stuck.ron"), variant).map_err(failed)?;
        let ended = place.render_by("stuck.ron", "cornell.ron", &["--strict", "-o", "out.exr"])?;
        is(&unwrapped(ended), 1, "new records did not cover the pixels that they were made for")?;
        let stats = place.stats()?;
        let told = &stats["frames"][0]["unfinished"];
        check(*told == serde_json::json!([{ "loop": "fill", "because": "no_progress" }]), || format!("{way}: {told}"))?;
        check(number(&stats, 0, "/fill_rounds")? < 100 && number(&stats, 0, "/records/irradiance")? == 1, || format!("{way}: {stats}"))?;
    }
    Ok(())
}

#[cfg(unix)]
fn interrupted() -> Outcome {
    let place = Place::new()?;
    // Each frame adds a few records, so that the work goes on and on.
    let more = ["--frames", "0..100000", "--set", "misses.at_most=2", "--cache", "records", "-o", "out.exr"];
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_hemisplat"))
        .current_dir(place.0.path())
        .args(Place::arguments("irradiance-one-rate", "cornell.ron", &more))
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .map_err(failed)?;
    let start = std::time::Instant::now();
    while !place.path("out.0003.exr").exists() && start.elapsed().as_secs() < 120 {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().map_err(failed)?;
    let status = child.wait().map_err(failed)?.code();
    let stderr = io::read_to_string(child.stderr.take().ok_or("no stderr")?).map_err(failed)?;
    check(status == Some(130) && stderr.contains("what was whole is in out.0000.exr"), || format!("{status:?}: {stderr}"))?;
    let names = place.names()?;
    for name in names.iter().filter(|name| name.ends_with(".exr")) {
        place.picture(name)?;
    }
    check(names.iter().all(|name| !name.starts_with('.')), || format!("{names:?}"))?;
    let frames = place.stats()?["frames"].as_array().map_or(0, Vec::len);
    check(frames >= 4 && place.stats()?["complete"] == false, || format!("{frames} frames are told of"))?;
    let stats = place.rendered(&["--cache", "records", "-o", "after.exr"])?;
    check(number(&stats, 0, "/records/irradiance")? >= 2 * frames as u64, || format!("{stats}"))
}

#[cfg(not(unix))]
fn interrupted() -> Outcome {
    Err("there are no signals".into())
}

fn failing_runs() -> Outcome {
    let place = Place::new()?;
    for name in ["out.exr", "file", "records"] {
        fs::write(place.path(name), "older").map_err(failed)?;
    }
    for (more, status, message) in [
        (&["--set", "tiles.shape=Cosine", "--set", "tiles.by=Raster", "-o", "out.exr"][..], 2, "plan::"),
        (&["--dump", "nothing", "-o", "out.exr"], 2, "plan::unknown_dump"),
        (&["--cache", "records", "-o", "out.exr"], 2, "render::cache"),
        (&["--cache", "file/records", "-o", "out.exr"], 1, "cannot write file/records"),
        (&["-o", "out.exr", "-o", "file/out.exr"], 1, "cannot write file/out.exr"),
        (&["-o", "out.exr", "-o", "out.jpg"], 2, "cannot tell the format of out.jpg"),
        (&["--frames", "2..2", "-o", "out.exr"], 2, "expected A..B"),
        (&["--camera", "none", "-o", "out.exr"], 2, "cli::unknown_camera"),
    ] {
        is(&place.render(more)?, status, message)?;
    }
    for name in ["out.exr", "file", "records"] {
        check(fs::read(place.path(name)).map_err(failed)? == b"older", || format!("{name} is not what it was"))?;
    }
    check(place.names()? == ["file", "out.exr", "records"], || format!("{:?}", place.names()))
}

/// Where surfaces reflect all light, photons never end, which is told; not so if they are to meet no more than two. And where they arrive is dumped.
fn photons_cut_off() -> Outcome {
    let place = Place::new()?;
    let white = r#"Scene(version: 1, geometry: [Box(min: (0, 0, 0), max: (2, 2, 2))], materials: { "*": Diffuse(reflectance: (1, 1, 1)) },
        lights: [Point(position: (1, 1.5, 1), intensity: (1, 1, 1))], cameras: { "main": (eye: (1, 1, 0.1), target: (1, 1, 2), fov: 60, size: (16, 16)) })"#;
    fs::write(place.path("white.ron"), white).map_err(failed)?;
    let render =
        |scene: &str, set: &str| place.render_by("photon-gather", scene, &["--set", "map.photons=5000", "--set", set, "--dump", "map", "-o", "out.exr"]);
    let (status, told) = render("white.ron", "map.legs=64")?;
    check(status == 0 && told.contains("photons of `map` were still on their way"), || told)?;
    for (scene, set) in [("white.ron", "map.legs=2"), ("cornell", "map.legs=64")] {
        let (status, told) = render(scene, set)?;
        check(status == 0 && !told.contains("on their way"), || told)?;
    }
    let dumped = fs::read_to_string(place.path("out.map.map.csv")).or_else(|_| fs::read_to_string(place.path("out.map.csv"))).map_err(failed)?;
    let stats = place.stats()?;
    let passes = stats["frames"][0]["passes"].as_array().cloned().unwrap_or_default();
    let count = passes.iter().find(|pass| pass["node"] == "map").and_then(|map| map["numbers"]["photons"].as_u64());
    check(count.is_some_and(|count| count > 1000 && count as usize + 1 == dumped.lines().count()), || format!("{count:?} of {}", dumped.lines().count()))
}

fn dumps() -> Outcome {
    let place = Place::new()?;
    let nodes = ["gbuffer", "splats", "misses", "tiles", "closed", "records", "cache", "indirect.weight"];
    let dumps: Vec<&str> = nodes.iter().flat_map(|node| ["--dump", node]).collect();
    // Of a fill the last batch that held anything.
    let stats = place.rendered(&[&["-o", "out.exr"], &dumps[..]].concat())?;
    let records = number(&stats, 0, "/records/irradiance")? as usize;
    for (name, size) in [
        ("gbuffer.gbuffer", [40, 30]),
        ("gbuffer.depth", [40, 30]),
        ("splats.sums", [40, 30]),
        ("indirect.weight", [40, 30]),
        ("tiles.tiles", [0, 0]),
        ("closed.tiles", [0, 0]),
    ] {
        let picture = place.picture(&format!("out.{name}.exr"))?;
        check(!picture.layers.is_empty() && (size == [0, 0] || [picture.width, picture.height] == size), || {
            format!("{name}: {}x{}", picture.width, picture.height)
        })?;
        check(picture.layers.values().any(|layer| layer.channels.values().flatten().any(|v| *v != 0.0)), || format!("{name} is black"))?;
    }
    let mut lines = Vec::new();
    for name in ["misses.requests", "records.records", "cache.cache"] {
        let text = fs::read_to_string(place.path(&format!("out.{name}.csv"))).map_err(|error| format!("{name}: {error}"))?;
        let columns: Vec<usize> = text.lines().map(|line| line.split(',').count()).collect();
        check(columns.iter().all(|c| *c == columns[0]), || format!("{name}: {columns:?}"))?;
        lines.push(columns.len() - 1);
    }
    let [requests, new, all] = lines[..] else { return Err("three tables".into()) };
    check(requests == new && 0 < new && new < all && all == records, || format!("{requests} requests, {new} new records of {all}, {records} are told of"))?;
    for (name, records) in [("records.records", new), ("cache.cache", all)] {
        let text = fs::read_to_string(place.path(&format!("out.{name}.ply"))).map_err(failed)?;
        let body = text.lines().skip_while(|line| *line != "end_header").count() - 1;
        check(text.starts_with("ply\n") && text.contains(&format!("element vertex {records}\n")) && body == records, || name.to_owned())?;
    }
    let flag = fs::read_to_string(place.path("out.misses.none.csv")).map_err(failed)?;
    check(flag == "value\n1\n", || flag.clone())?;
    let lit = ["--scene-set", "triangles=1000", "--set", "shadow.resolution=64", "--set", "fill.max_rounds=1", "--dump", "shadow", "-o", "lit.exr"];
    is(&place.render_scene("hall.ron", &lit)?, 0, "")?;
    let depth = place.picture("lit.shadow.maps.exr")?;
    check(depth.width == 64 && depth.height % 64 == 0, || format!("{}x{}", depth.width, depth.height))
}
