//! The arithmetic, the lists and the tables of `./bench`, which is a program without tests of its own.

// Only parts of the program's modules are tested.
#![allow(dead_code)]

type Failure = Box<dyn std::error::Error>;

#[path = "../benches/race/curve.rs"]
mod curve;
#[path = "../benches/frames/list.rs"]
mod frames;
#[path = "../benches/race/kept.rs"]
mod kept;
#[path = "../benches/race/machine.rs"]
mod machine;
#[path = "../benches/race/peers.rs"]
mod peers;
#[path = "../benches/race/programs.rs"]
mod programs;
#[path = "../benches/race/report.rs"]
mod report;
#[path = "../benches/scaling/series.rs"]
mod series;
#[path = "../benches/race/settings.rs"]
mod settings;
#[path = "../benches/race/tell.rs"]
mod tell;

mod the_curve {
    use crate::curve::*;

    const RMSE: Metric = Metric::RmseOverMean;

    fn sample(seconds: f64, error: f64) -> Sample {
        let seconds = Seconds { median: seconds, least: seconds * 0.9, most: seconds * 1.2 };
        Sample { seconds, errors: [error, error / 10.0, error * 2.0, error / 4.0, error / 2.0, error * 3.0] }
    }

    #[test]
    fn a_curve_is_what_nothing_beats_the_most_exact_first() {
        let samples = [sample(1.0, 0.08), sample(4.0, 0.04), sample(5.0, 0.04), sample(3.0, 0.09), sample(16.0, 0.02), sample(4.0, 0.04), sample(0.5, 0.0)];
        let curve = Curve::of(&samples, RMSE).unwrap();
        assert_eq!(curve.samples(), [sample(16.0, 0.02), sample(4.0, 0.04), sample(1.0, 0.08)]);
        assert_eq!(curve.levels(), [0.02, 0.04, 0.08]);
        assert_eq!(Curve::of(&[], RMSE), None);
        assert_eq!(Curve::of(&[sample(1.0, 0.0)], RMSE), None);
        assert_eq!(Curve::of(&samples[..1], RMSE).unwrap().levels(), [0.08]);
        assert_eq!(Curve::of(&samples[..2], RMSE).unwrap().levels(), [0.04, 0.08]);
    }

    #[test]
    fn each_error_has_a_curve_of_its_own() {
        let splotched = Sample { errors: [0.02, 0.08, 0.1, 0.1, 0.1, 0.1], ..sample(2.0, 0.02) };
        let samples = [sample(4.0, 0.04), splotched];
        assert_eq!(Curve::of(&samples, RMSE).unwrap().samples(), [splotched]);
        let blocks = Curve::of(&samples, Metric::BlockP50).unwrap();
        assert_eq!(blocks.samples(), [sample(4.0, 0.04), splotched]);
        assert_eq!(blocks.levels(), [0.004, 0.08]);
        let read = blocks.at(0.02).sample().unwrap();
        assert!(read.error(Metric::BlockP50) == 0.02 && read.error(RMSE) < 0.04 && read.error(RMSE) > 0.02, "{read:?}");
    }

    #[test]
    fn every_error_is_told_by_its_name() {
        let json = serde_json::to_value(sample(2.0, 0.04)).unwrap();
        assert_eq!(json["seconds"], serde_json::json!({ "median": 2.0, "least": 1.8, "most": 2.4 }));
        for metric in Metric::ALL {
            assert_eq!(json[metric.name()], serde_json::json!(sample(2.0, 0.04).error(metric)));
            assert_eq!(serde_json::to_value(metric).unwrap(), metric.name());
        }
    }

    /// Time over the square of the error, as ray casting has it, is straight on logarithmic axes: read anywhere, it is exact.
    #[test]
    fn a_power_law_is_read_exactly_between_its_samples() {
        let law = |error: f64| sample(0.02 / error.powi(2), error);
        let curve = Curve::of(&[law(0.01), law(0.03), law(0.2)], RMSE).unwrap();
        for error in [0.01, 0.015, 0.03, 0.07, 0.2] {
            let (read, exact) = (curve.at(error).sample().unwrap(), law(error));
            for (read, exact) in
                [(read.seconds.median, exact.seconds.median), (read.seconds.least, exact.seconds.least), (read.seconds.most, exact.seconds.most)]
            {
                assert!((read / exact - 1.0).abs() < 1e-12, "{error}: {read} {exact}");
            }
            assert_eq!(read.error(RMSE), error);
        }
        // Half way between 0.01 and 0.03 by logarithm, the other errors are half way too.
        let middle = curve.at(0.03f64.sqrt() * 0.1).sample().unwrap();
        let expected = [0.002, 0.04, 0.005, 0.01, 0.06];
        assert!(middle.errors[1..].iter().zip(expected).all(|(error, expected)| (error - expected).abs() < 1e-12), "{middle:?}");
    }

    #[test]
    fn nothing_is_read_beyond_the_ends() {
        let curve = Curve::of(&[sample(9.0, 0.02), sample(3.0, 0.05)], RMSE).unwrap();
        assert_eq!(curve.at(0.019), Reading::NotReached(sample(9.0, 0.02)));
        assert_eq!(curve.at(0.051), Reading::Exceeded(sample(3.0, 0.05)));
        assert_eq!([curve.at(0.02), curve.at(0.05)], [Reading::At(sample(9.0, 0.02)), Reading::At(sample(3.0, 0.05))]);
    }

    #[test]
    fn a_factor_needs_both_and_holds_all_that_their_runs_give() {
        let [slow, fast] = [40.0, 8.0].map(|seconds| Reading::At(sample(seconds, 0.03)));
        let Factor::Is(Ratio { median, least, most }) = slow.over(&fast) else { panic!() };
        assert_eq!(median, 5.0);
        assert!((least - 5.0 * 0.9 / 1.2).abs() < 1e-12 && (most - 5.0 * 1.2 / 0.9).abs() < 1e-12, "{least} {most}");
        let bound = |factor| match factor {
            Factor::MoreThan(bound) => format!("> {bound:.2}"),
            Factor::LessThan(bound) => format!("< {bound:.2}"),
            other => format!("{other:?}"),
        };
        // A program that does not get there takes longer than for its best; one that is never as coarse would take less than its fastest.
        let (best, fastest) = (Reading::NotReached(sample(12.0, 0.04)), Reading::Exceeded(sample(1.0, 0.01)));
        assert_eq!(bound(best.over(&fast)), "> 1.13", "12 · 0.9 over 8 · 1.2");
        assert_eq!(bound(slow.over(&fastest)), "> 30.00");
        assert_eq!(bound(best.over(&fastest)), "> 9.00");
        assert_eq!(bound(fast.over(&best)), "< 0.89");
        assert_eq!(bound(fastest.over(&slow)), "< 0.03");
        assert_eq!([best.over(&best), fastest.over(&fastest)], [Factor::Unknown, Factor::Unknown]);
        let told = |factor: Factor| serde_json::to_value(factor).unwrap();
        assert_eq!([told(best.over(&fast)), told(Factor::Unknown)], [serde_json::json!("> 1.1"), serde_json::Value::Null]);
        assert_eq!(told(slow.over(&fast))["median"], 5.0);
    }
}

mod the_machine {
    use crate::machine::{Machine, Usage, finish};
    use std::{path::Path, process::Command};

    const SYSTEM: &str = "cpu  1000 10 200 5000 90 0 10 40 0 0\ncpu0 500 5 100 2500 45 0 5 20 0 0\n";

    #[test]
    fn what_others_had_is_all_that_was_spent_but_what_is_ones_own() {
        let own = |ticks: u64| format!("42 (a (name) of) S 1 42 42 0 -1 4194560 100 200 0 0 30 20 {ticks} 0 20 0 5 0 77 1 2 3");
        let before = Usage::read(SYSTEM, &own(100)).unwrap();
        // A thousand ticks: 300 idle, 50 waiting, 650 spent, 640 of them by a child.
        let after = Usage::read("cpu  1600 10 230 5300 140 0 20 50 600 0\n", &own(740)).unwrap();
        assert_eq!(after.others_since(&before), Some(0.01));
        assert_eq!(before.others_since(&before), None, "no time has passed");
        assert_eq!(after.others_since(&after), None);
        assert_eq!([Usage::read("cpu0 1 2", ""), Usage::read("cpu  1 2 3", &own(1)), Usage::read(SYSTEM, "")], [None; 3]);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_command_is_timed_with_what_others_had() {
        let done = finish(Command::new("sh").args(["-c", "sleep 0.2; echo done"])).unwrap();
        assert!(done.seconds >= 0.2 && done.others.is_some_and(|others| (0.0..=1.0).contains(&others)), "{} {:?}", done.seconds, done.others);
    }

    /// As the program names it today.
    #[test]
    fn adapters_are_found_by_name() {
        let program = Path::new(env!("CARGO_BIN_EXE_hemisplat"));
        let is_usable = Command::new(program).arg("adapters").status().is_ok_and(|status| status.success());
        let found = Machine::find(program);
        assert!(!is_usable || found.as_ref().is_ok_and(|machine| !machine.adapter.is_empty() && !machine.adapter.contains(": ")), "{:?}", found.err());
    }
}

mod the_settings {
    use crate::settings::*;

    const FILES: [&str; 4] = ["race.ron", "race-denoised.ron", "race-bounces.ron", "race-quick.ron"];

    fn text(name: &str) -> String {
        std::fs::read_to_string(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("benches").join(name)).unwrap()
    }

    #[test]
    fn the_lists_that_ship_are_read_and_name_cases_of_the_peers() {
        let cases: serde_json::Value = serde_json::from_str(&text("peers/cases.json")).unwrap();
        for race in FILES.map(|name| Race::read(&text(name)).unwrap()) {
            assert!(race.scenes.iter().all(|case| cases[&case.name].is_object()));
            assert_eq!(race.settings(&race.scenes[0]).len(), race.scenes[0].radiance.len() + race.mitsuba.len() + race.denoised.len() + race.hemisplat.len());
            assert!(race.hemisplat.iter().any(|ours| ours.start == Start::Cold));
        }
    }

    #[test]
    fn the_full_list_has_what_ships_without_any_change() {
        let race = Race::read(&text("race.ron")).unwrap();
        let shipped = |start| Hemisplat { pipeline: "irradiance".into(), set: vec![], start };
        assert!([Start::Warm, Start::Cold].iter().all(|start| race.hemisplat.contains(&shipped(*start))));
    }

    #[test]
    fn a_mistake_is_told_by_what_it_is() {
        let mistakes = [
            ("size: 128", "size: 127", "multiple of the stride"),
            ("size: 128", "size: 64", "33 times"),
            ("samples: 512", "samples: 300", "rounds of 256"),
            ("stride: 2", "stride: 2, more: 1", "more"),
            ("windows: 2", "windows: 5", "room for 1 to 4"),
            ("strata: 8", "strata: 0", "strata"),
            ("strata: 8", "strata: 4", "Mitsuba 16 rays a pixel stands there twice"),
            ("mitsuba: [(strata: 4), (strata: 8)]", "mitsuba: []", "no setting of Mitsuba"),
            ("rays: 1", "rays: 3", "denoised.rays: 1, 2, 4"),
            ("denoised: 2", "denoised: 0", "runs: one at least"),
            ("others_at_most: 1.0", "others_at_most: 1.1", "others_at_most 1.1"),
            ("tiles.resolution=32", "tiles.resolutions=32", "tiles.resolutions"),
            ("cache.accuracy=10", "cache.accuracy=11", "accuracy"),
            ("name: \"sponza\"", "name: \"sibenik\"", "scene sibenik stands there twice"),
        ];
        let whole = text("race-quick.ron");
        for (right, wrong, told) in mistakes {
            assert!(whole.contains(right), "{right}");
            let error = Race::read(&whole.replace(right, wrong)).unwrap_err();
            assert!(error.contains(told), "{wrong}: {error}");
        }
        let error = Race::read(&whole).unwrap().only(Some("cornell")).unwrap_err();
        assert_eq!(error, "no scene cornell; the list has sibenik, sponza");
    }

    #[test]
    fn lists_are_spread_over_each_other() {
        assert_eq!(interleaved(vec![vec!["A", "B"], vec!["1", "2", "3", "4"]]), ["1", "A", "2", "3", "B", "4"]);
        assert_eq!(interleaved(vec![vec!["A"], vec![], vec!["1"]]), ["A", "1"]);
    }
}

mod the_kept {
    use crate::kept::*;
    use serde::{Deserialize, Serialize};
    use std::fs;

    #[test]
    fn what_is_kept_is_found_by_its_whole_key_only() {
        let place = tempfile::tempdir().unwrap();
        let folder = Folder::new(&place.path().join("a/b")).unwrap();
        #[derive(Debug, PartialEq, Serialize, Deserialize)]
        struct Found {
            seconds: f64,
        }
        let find = |key| folder.find::<Found>("case", key);
        assert_eq!(find("a"), None);
        folder.keep("case", "a", &Found { seconds: 0.1 }).unwrap();
        assert_eq!([find("a"), find("b")], [Some(Found { seconds: 0.1 }), None]);
        let text = fs::read_to_string(folder.file("case", "a")).unwrap();
        fs::write(folder.file("case", "a"), text.replace("\"a\"", "\"b\"")).unwrap();
        assert_eq!(find("a"), None, "of another key");
        fs::write(folder.file("case", "a"), &text[..text.len() / 2]).unwrap();
        assert_eq!(find("a"), None, "damaged");
    }

    #[test]
    fn the_workplace_is_empty_each_time() {
        let place = tempfile::tempdir().unwrap();
        let folder = Folder::new(place.path()).unwrap();
        fs::write(folder.workplace().unwrap().join("left"), "x").unwrap();
        assert_eq!(fs::read_dir(folder.workplace().unwrap()).unwrap().count(), 0);
    }
}

mod the_report {
    use crate::{
        curve::{Factor, Metric, Ratio, Reading},
        kept::Run,
        machine::Machine,
        programs::Versions,
        report::*,
        settings::*,
        tell,
    };
    use hemisplat::measure::{
        Errors, LargestError,
        plot::{Paper, svg},
    };

    fn run(seconds: f64, error: f64, block_p99: f64) -> Run {
        let errors = Errors {
            schema: 1,
            layer: "irradiance".into(),
            pixels: 1,
            stride: 4,
            windows: None,
            reference_mean: 1.0,
            reference_noise_over_mean: None,
            rmse_over_mean: error,
            bias_over_mean: -0.01,
            rms_of_relative: None,
            block_p50: Some(0.01),
            block_p99: Some(block_p99),
            edge_share: None,
            rmse_edges: None,
            rmse_interior: None,
            band_error: None,
            relmse: 0.0,
            flip: None,
            hdr_flip: None,
            largest: LargestError { x: 0, y: 0, test: 1.0, reference: 1.0, over_mean: 0.0 },
            intervals: Default::default(),
            resampled: Default::default(),
        };
        let in_windows = Errors {
            stride: 1,
            windows: Some(16),
            band_error: Some(error / 2.0),
            rmse_interior: Some(error / 2.0),
            rmse_edges: Some(error * 2.0),
            ..errors.clone()
        };
        Run { command: "run".into(), seconds, others: Some(0.004), errors, in_windows, facts: serde_json::Value::Null }
    }

    fn radiance(accuracy: f64, seconds: f64, error: f64) -> Point {
        Point::of(&Setting::Radiance(Radiance { accuracy, samples: 512, resolution: 16 }), vec![run(seconds, error, 0.05)]).unwrap()
    }

    fn mitsuba(strata: u32, seconds: f64, error: f64) -> Point {
        Point::of(&Setting::Mitsuba(Mitsuba { strata }), vec![run(seconds, error, 0.05)]).unwrap()
    }

    fn denoised(rays: u32, seconds: f64, error: f64) -> Point {
        let setting = Setting::Denoised(Denoised { rays, quality: Quality::Fast });
        Point::of(&setting, vec![run(seconds, error, 0.05), run(seconds * 1.1, error, 0.05)]).unwrap()
    }

    fn shipped(seconds: f64, error: f64) -> Point {
        let setting = Setting::Hemisplat(Hemisplat { pipeline: "irradiance".into(), set: vec![], start: Start::Warm });
        Point::of(&setting, vec![run(seconds, error, 0.04)]).unwrap()
    }

    fn ours(set: &str, start: Start, runs: Vec<Run>) -> Result<Point, String> {
        let setting = Setting::Hemisplat(Hemisplat { pipeline: "irradiance".into(), set: vec![set.into()], start });
        Point::of(&setting, runs).map_err(|error| error.to_string())
    }

    /// hemisplat is told at 4 %: half way, by logarithm, between 2 % in 40 s and 8 % in 10 s. A cold start and a beaten point are off its curve.
    fn scene() -> Scene {
        let points = vec![
            radiance(0.1, 100.0, 0.04),
            radiance(0.2, 80.0, 0.05),
            radiance(0.3, 60.0, 0.1),
            mitsuba(8, 50.0, 0.06),
            mitsuba(16, 200.0, 0.03),
            denoised(1, 10.0, 0.12),
            denoised(64, 90.0, 0.04),
            ours("a", Start::Warm, vec![run(39.0, 0.02, 0.04), run(70.0, 0.02, 0.04), run(40.0, 0.02, 0.04)]).unwrap(),
            ours("b", Start::Warm, vec![run(10.0, 0.08, 0.08)]).unwrap(),
            ours("c", Start::Warm, vec![run(12.0, 0.09, 0.01)]).unwrap(),
            ours("b", Start::Cold, vec![run(9.0, 0.08, 0.08)]).unwrap(),
            // Off the curve, where "a" is as exact in less time.
            shipped(45.0, 0.02),
        ];
        Scene::of("sibenik", points).unwrap()
    }

    fn known(factor: Factor) -> Ratio {
        let Factor::Is(ratio) = factor else { panic!("{factor:?}") };
        ratio
    }

    #[test]
    fn programs_are_compared_where_their_curves_meet_one_error() {
        let scene = scene();
        let on_curve: Vec<bool> = scene.points.iter().map(|point| point.is_on_curve).collect();
        assert_eq!(on_curve, [true, true, true, true, true, true, true, true, true, false, false, false]);
        let [exact, middle, coarse, denoised_exact, denoised_coarse] = &scene.equal_error[..] else { panic!("{:?}", scene.equal_error) };
        assert_eq!([exact, middle, coarse, denoised_exact, denoised_coarse].map(|level| level.error), [0.04, 0.05, 0.1, 0.04, 0.12]);
        // The median of hemisplat's runs counts, and the least and the most are told: 20 s, of 39 to 70 s and 10 s, is between 19.7 and 26.5.
        let ratio = known(exact.over_hemisplat.radiance);
        assert!((ratio.median - 5.0).abs() < 1e-9 && (ratio.least - 100.0 / 700f64.sqrt()).abs() < 1e-9, "{ratio:?}");
        assert!((ratio.most - 100.0 / 390f64.sqrt()).abs() < 1e-9, "{ratio:?}");
        assert!((known(exact.over_hemisplat.mitsuba).median - 112.5 / 20.0).abs() < 1e-9, "{exact:?}");
        assert!((known(exact.over_hemisplat.denoised).median - 94.5 / 20.0).abs() < 1e-9, "{exact:?}");
        assert_eq!(
            exact.hemisplat_is_worse_in.as_deref(),
            Some(&["block_p99", "band_error", "rmse_interior", "rmse_edges"][..]),
            "6 % against 5 %, 2.5 % against 2 %, 10 % against 8 %"
        );
        let readings = coarse.readings;
        assert!(matches!((readings.radiance, readings.mitsuba, readings.hemisplat), (Reading::At(_), Reading::Exceeded(_), Reading::Exceeded(_))));
        assert_eq!((coarse.over_hemisplat.radiance, coarse.over_hemisplat.mitsuba), (Factor::MoreThan(6.0), Factor::Unknown));
        assert_eq!(coarse.hemisplat_is_worse_in, None);
    }

    #[test]
    fn what_ships_is_compared_at_each_of_its_errors() {
        let scene = scene();
        assert_eq!(scene.as_shipped.iter().map(|level| level.metric).collect::<Vec<_>>(), Metric::ALL);
        let [rmse, _, blocks, ..] = &scene.as_shipped[..] else { panic!() };
        assert!((rmse.of, rmse.error, blocks.error) == (Program::Hemisplat, 0.02, 0.04));
        assert!(matches!(rmse.readings.denoised, Reading::NotReached(_)), "its best is 4 %");
        assert_eq!(rmse.hemisplat_is_worse_in, None);
    }

    #[test]
    fn equal_runs_with_other_pictures_are_refused() {
        let error = ours("a", Start::Warm, vec![run(1.0, 0.02, 0.04), run(1.0, 0.03, 0.04)]).unwrap_err();
        assert_eq!(error, "hemisplat irradiance a: pictures of equal runs differ");
    }

    #[test]
    fn a_curve_without_an_error_is_refused() {
        let error = Scene::of("sibenik", vec![radiance(0.1, 1.0, 0.0)]).unwrap_err().to_string();
        assert!(error.contains("no rmse_over_mean of Radiance is above the truth's noise"), "{error}");
    }

    #[test]
    fn tables_and_figure_tell_it() {
        let text = |text: &str| text.to_owned();
        let report = Report {
            schema: 2,
            date: text("2026-01-02"),
            commit: None,
            changes: Vec::new(),
            machine: Machine { cores: 2, cpu: None, caches: vec![text("L2 unified 1M")], adapter: text("adapter") },
            versions: Versions { hemisplat: text("1"), radiance: text("2"), mitsuba: text("3"), denoiser: text("4") },
            size: 1000,
            truth: Truth { samples: 4096, stride: 4, windows: 16 },
            bounces: 1,
            others_at_most: 0.02,
            scenes: vec![scene()],
        };
        let tables = tell::markdown(&report);
        for row in [
            "4096 rays at one pixel of 4×4 and in 16 windows of 64×64 pixels",
            "2 cores (processor unknown, L2 unified 1M)",
            "others had more than 2.00 % of the processors' time",
            "| Radiance | `-aa 0.1 -ad 512 -ar 16` | 100 | 0.4 % | 4.00 % | -1.00 % | 1.00 % | 5.00 % | 2.00 % | 2.00 % | 8.00 % | yes |",
            "| Mitsuba and OIDN | `64 rays a pixel, fast` | 94.5 (90.0…99.0) | 0.4 % | 4.00 % |",
            "| hemisplat | `irradiance a` | 40.0 (39.0…70.0) | 0.4 % | 2.00 % |",
            "| hemisplat | `irradiance b (cold start)` | 9.00 | 0.4 % | 8.00 % | -1.00 % | 1.00 % | 8.00 % | 4.00 % | 4.00 % | 16.00 % |  |",
            "| Radiance | `rmse_over_mean` 4.00 % | 100 s | 112 s | 94.5 s | 20.0 s | 5.00 (3.78…5.06) | 5.62 (4.25…5.70) | 4.72 (3.40…5.01) | **block_p99, band_error, rmse_interior, rmse_edges** |",
            "| Radiance | `rmse_over_mean` 10.00 % | 60.0 s | out of range (its fastest: 6.00 % in 50.0 s) |",
            "| hemisplat | `rmse_over_mean` 2.00 % | out of range (its best: 4.00 % in 100 s) |",
        ] {
            assert!(
                tables.contains(row),
                "{row}
{tables}"
            );
        }
        let plot = tell::plot(&report, &report.scenes[0]);
        let marks: Vec<usize> = plot.lines.iter().map(|line| line.marks.len()).collect();
        assert_eq!(marks, [3, 2, 2, 2]);
        assert_eq!((plot.lines[3].marks[1].x_spread, plot.lines[3].marks[1].y), ([39.0, 70.0], 2.0));
        let svg = svg(&plot, Paper::Wide);
        assert!(svg.contains("sibenik: 1000×1000 pixels") && svg.contains("Mitsuba and OIDN") && !svg.contains("Pareto"), "no mark stands for all programs");
    }
}

mod the_series {
    use crate::series::*;

    #[test]
    fn the_list_is_read_and_its_renders_are_planned() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/scaling.ron");
        let scaling = Scaling::read(&std::fs::read_to_string(path).unwrap()).unwrap();
        let names: Vec<&str> = scaling.series.iter().map(|series| series.name.as_str()).collect();
        assert_eq!(names, ["triangles", "records", "pixels", "samples"]);
        for series in &scaling.series {
            for (row, point) in series.rows.iter().flat_map(|row| series.points.iter().map(move |point| (row, point))) {
                let sets: Vec<String> = series.set.iter().chain(&point.set).chain(&row.set).cloned().collect();
                let loaded = hemisplat::pipeline::load(&row.pipeline, &sets, hemisplat::passes::REGISTRY, &mut |_| Err(std::io::ErrorKind::NotFound.into()));
                assert!(loaded.is_ok(), "{} {}", series.name, row.pipeline);
            }
        }
        assert!(scaling.only(Some("colours")).unwrap_err().contains("triangles, records"));
    }

    #[test]
    fn a_list_that_tells_nothing_is_refused() {
        let text = |points: &str| {
            format!(
                "Scaling(series: [(name: \"a\", x: Pixels, scene: \"cornell\", points: [{points}], rows: [(name: \"b\", pipeline: \"irradiance\", lines: [])])])"
            )
        };
        assert!(Scaling::read(&text("(size: 8), (size: 16)")).is_ok());
        assert!(Scaling::read(&text("(size: 8)")).unwrap_err().contains("two points"));
        assert!(Scaling::read(&text("(size: 8), ()")).unwrap_err().contains("no size"));
        assert!(Scaling::read(&text("(edge: 8), (size: 8)")).unwrap_err().contains("edge"));
    }

    #[test]
    fn a_line_has_the_nodes_that_it_names_or_all_others() {
        let costs = |nodes: &[&str], except: &[&str]| {
            let [nodes, except] = [nodes, except].map(|names| names.iter().map(|name| name.to_string()).collect());
            Costs { name: "line".into(), nodes, except, per: Per::Frame }
        };
        assert!(costs(&["tiles"], &[]).holds("tiles") && !costs(&["tiles"], &[]).holds("splats"));
        assert!(!costs(&[], &["tiles"]).holds("tiles") && costs(&[], &["tiles"]).holds("splats"));
    }
}

mod the_frames {
    use crate::frames::List;
    use hemisplat::{
        passes::REGISTRY,
        pipeline::load,
        scene::load::{LoadOptions, load as scene},
    };
    use std::path::Path;

    #[test]
    fn the_list_is_read_and_its_scenes_move() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(root.join("benches/frames.ron")).unwrap();
        let list = List::read(&text).unwrap();
        for case in &list.scenes {
            let scene = scene(&root.join(format!("scenes/{}.ron", case.name)), &LoadOptions::default()).unwrap();
            assert!(!scene.animation.is_empty() && scene.animation.length() > f64::from(case.frames) / case.fps / 2.0, "{}", case.name);
        }
        for pipeline in &list.pipelines {
            assert!(load(pipeline, &[], REGISTRY, &mut |_| Err(std::io::ErrorKind::NotFound.into())).is_ok(), "{pipeline}");
        }
        assert!(!list.denoised.is_empty() && list.only(Some("hall")).unwrap_err().contains("cube"));
        assert!(List::read(&text.replace("runs: 3", "runs: 0")).is_err() && List::read(&text.replace("fps: 8", "fps: -8")).is_err());
    }
}
