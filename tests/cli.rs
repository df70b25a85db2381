//! The program from outside: its help, its exit statuses, its exact messages.

use assert_cmd::Command;
use hemisplat::measure::{Layer, Layers, PICTURE};
use std::fs;
use tempfile::TempDir;

/// An empty folder to run in, so that messages hold no path of the machine.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn with(self, name: &str, picture: Layers) -> Self {
        fs::write(self.0.path().join(name), picture.to_exr().unwrap()).unwrap();
        self
    }

    /// Runs the program; its exit status, stdout and stderr. What it keeps for later stands in the folder.
    fn run(&self, arguments: &[&str]) -> (i32, String, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hemisplat"));
        command.current_dir(self.0.path()).env("XDG_CACHE_HOME", self.0.path().join("kept")).env_remove("NO_COLOR");
        let output = command.args(arguments).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
    }

    /// The message of a run that fails with bad usage or input and prints no result.
    #[track_caller]
    fn refusal(&self, arguments: &[&str]) -> String {
        let (status, stdout, stderr) = self.run(arguments);
        assert_eq!((status, stdout.as_str()), (2, ""), "{stderr}");
        stderr
    }
}

fn irradiance(values: [f32; 4]) -> Layers {
    Layers::new(2, 2).with("irradiance", Layer::value(values.to_vec()))
}

fn two_pictures() -> Place {
    Place::new().with("a.exr", irradiance([1.5, 2.0, 3.0, 1.0])).with("b.exr", irradiance([1.0, 2.0, 4.0, 1.0]))
}

#[test]
fn help_is_a_result() {
    let (status, stdout, stderr) = Place::new().run(&["--help"]);
    assert_eq!((status, stderr.as_str()), (0, ""));
    assert!(stdout.contains("Exit status"));
}

#[test]
fn each_command_has_help_with_an_example() {
    let (_, help, _) = Place::new().run(&["--help"]);
    let commands = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    // A line that goes on with what the one before says is indented farther.
    let commands = commands.filter_map(|line| line.strip_prefix("  ")).filter(|line| !line.starts_with(' '));
    let commands: Vec<&str> = commands.filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help").collect();
    assert!(commands.contains(&"diff"), "{commands:?}");
    for command in commands {
        let (status, stdout, _) = Place::new().run(&[command, "--help"]);
        assert_eq!(status, 0, "{command}");
        assert!(stdout.contains(&format!("Example: hemisplat {command} ")), "{command}: {stdout}");
    }
}

#[test]
fn bad_usage_has_status_2() {
    for arguments in [&[][..], &["nothing"], &["diff"], &["diff", "a.exr", "b.exr", "--color", "pink"]] {
        Place::new().refusal(arguments);
    }
}

#[test]
fn completions_are_printed() {
    let (status, stdout, _) = Place::new().run(&["completions", "bash"]);
    assert_eq!(status, 0);
    assert!(stdout.contains("_hemisplat"));
}

#[test]
fn diff_prints_a_table() {
    let (status, stdout, stderr) = two_pictures().run(&["diff", "a.exr", "b.exr"]);
    assert_eq!((status, stderr.as_str()), (0, ""));
    insta::assert_snapshot!(stdout);
}

#[test]
fn diff_writes_json_without_nan() {
    let place = two_pictures();
    let (status, _, _) = place.run(&["diff", "a.exr", "b.exr:irradiance", "--json", "new/folder/diff.json"]);
    assert_eq!(status, 0);
    insta::assert_snapshot!(fs::read_to_string(place.0.path().join("new/folder/diff.json")).unwrap());
}

#[test]
fn diff_fails_above_a_threshold_with_status_1() {
    let place = two_pictures();
    let judged = |limit: &str| place.run(&["diff", "a.exr", "b.exr", "--fail-above", limit]);
    assert_eq!(judged("rmse_over_mean=0.28").0, 0);
    let (status, stdout, stderr) = judged("rmse_over_mean=0.27");
    assert_eq!(status, 1);
    assert!(stdout.contains("rmse_over_mean"), "the table is printed all the same");
    insta::assert_snapshot!(stderr);
    assert_eq!(judged("bias_over_mean=0.06").0, 1, "a signed metric fails by its size");
}

#[test]
fn diff_takes_the_noise_of_the_reference_off() {
    let place = two_pictures().with("variance.exr", irradiance([0.3125; 4]));
    let judged = |limit: &str| place.run(&["diff", "a.exr", "b.exr", "--variance", "variance.exr", "--fail-above", limit]);
    let (status, stdout, _) = judged("rmse_over_mean=0.34");
    assert!(status == 0 && stdout.contains("< 32."), "{stdout}");
    let (status, _, stderr) = judged("rmse_over_mean=0.1");
    assert!(status == 1 && stderr.contains("may be as large as 0.32"), "what noise hides is no proof: {stderr}");
}

#[test]
fn diff_refuses_a_metric_that_it_does_not_know() {
    insta::assert_snapshot!(two_pictures().refusal(&["diff", "a.exr", "b.exr", "--fail-above", "rsme=1"]));
}

#[test]
fn diff_names_a_missing_file() {
    insta::assert_snapshot!(two_pictures().refusal(&["diff", "a.exr", "c.exr"]));
}

#[test]
fn diff_names_a_missing_layer() {
    let place = Place::new().with("a.exr", irradiance([1.0; 4]).with("weight", Layer::value(vec![1.0; 4])));
    insta::assert_snapshot!(place.refusal(&["diff", "a.exr:irradianse", "a.exr"]));
}

#[test]
fn diff_refuses_pictures_without_a_common_layer() {
    let place = Place::new().with("a.exr", irradiance([1.0; 4])).with("b.exr", Layers::new(2, 2).with(PICTURE, Layer::value(vec![1.0; 4])));
    insta::assert_snapshot!(place.refusal(&["diff", "a.exr", "b.exr"]));
    assert!(place.refusal(&["diff", "a.exr:irradiance", "b.exr"]).contains("measure::unknown_layer"), "a picture is no irradiance");
}

#[test]
fn a_layer_without_a_name_is_what_the_other_file_is_asked_for() {
    let place = two_pictures();
    image::Rgb32FImage::from_pixel(2, 2, image::Rgb([1.0; 3])).save(place.0.path().join("nameless.hdr")).unwrap();
    assert!(place.refusal(&["diff", "a.exr", "nameless.hdr"]).contains("cli::nameless_layer"));
    assert_eq!(place.run(&["diff", "a.exr:irradiance", "nameless.hdr"]).0, 0);
    assert_eq!(place.run(&["diff", "a.exr", "nameless.hdr:irradiance"]).0, 0);
}

#[test]
fn diff_refuses_other_bounces() {
    let place =
        Place::new().with("a.exr", irradiance([1.0; 4]).with_attribute("bounces", 1)).with("b.exr", irradiance([1.0; 4]).with_attribute("bounces", "all"));
    insta::assert_snapshot!(place.refusal(&["diff", "a.exr", "b.exr"]));
    // What the reference has is said: what the picture leaves out is its error.
    assert_eq!(place.run(&["diff", "a.exr", "b.exr", "--bounces", "all"]).0, 0);
    assert!(place.refusal(&["diff", "a.exr", "b.exr", "--bounces", "2"]).contains("measure::bounces_differ"));
}

#[test]
fn diff_refuses_a_picture_that_is_damaged() {
    let place = two_pictures();
    let bytes = fs::read(place.0.path().join("a.exr")).unwrap();
    fs::write(place.0.path().join("cut.exr"), &bytes[..bytes.len() / 2]).unwrap();
    fs::write(place.0.path().join("text.exr"), "not a picture").unwrap();
    assert!(place.refusal(&["diff", "cut.exr", "a.exr"]).contains("measure::corrupt_exr"));
    insta::assert_snapshot!(place.refusal(&["diff", "text.exr", "a.exr"]));
}

#[test]
fn diff_refuses_sizes_that_do_not_fit() {
    let place = two_pictures().with("wide.exr", Layers::new(3, 2).with("irradiance", Layer::value(vec![1.0; 6])));
    insta::assert_snapshot!(place.refusal(&["diff", "wide.exr", "a.exr"]));
}

#[test]
fn a_file_is_not_written_twice_or_over_what_is_read() {
    let place = two_pictures();
    insta::assert_snapshot!(place.refusal(&["diff", "a.exr", "b.exr", "--json", "./a.exr"]));
    assert!(place.refusal(&[&FURNACE[..], &["-o", "x.exr", "-o", "x.exr"]].concat()).contains("cli::same_file"));
    assert!(Layers::read(&fs::read(place.0.path().join("a.exr")).unwrap()).is_ok(), "what is read is left alone");
    assert_eq!(place.run(&[&FURNACE[..], &["--spp", "4", "-o", "y.exr", "-o", "y.png"]].concat()).0, 0);
}

#[test]
fn many_errors_in_a_line_without_end_are_a_short_report() {
    let place = Place::new();
    let nodes: String = (0..5000).map(|i| format!("(name: \"n{i}\", pass: Nope()), ")).collect();
    fs::write(place.0.path().join("wide.ron"), format!("Pipeline(version: 1, about: \"\", nodes: [{nodes}], outputs: {{\"picture\": \"n0\"}})")).unwrap();
    let message = place.refusal(&["check", "wide.ron"]);
    assert!(message.len() < 20_000, "{} bytes", message.len());
    assert!(message.contains("5000 errors, of which the first 20 are shown") && message.contains("wide.ron:1:"), "{message}");
    fs::write(place.0.path().join("scene.ron"), format!("Scene(version: 1, geometry: [{}])", "Sphere(centre: (0, 0, 0), radius: 1), ".repeat(2000))).unwrap();
    let message = place.refusal(&["reference", "--scene", "scene.ron", "-o", "x.exr"]);
    assert!(message.len() < 1000 && message.contains("scene.ron:1:"), "{message}");
}

#[test]
#[cfg(unix)]
fn what_never_ends_is_not_read_to_its_end() {
    let place = Place::new();
    assert!(std::process::Command::new("mkfifo").arg(place.0.path().join("pipe")).status().unwrap().success());
    for endless in ["/dev/zero", "pipe"] {
        for arguments in [&["diff", endless, endless][..], &["check", endless], &["explain", "irradiance", "--scene", endless]] {
            let message = place.refusal(arguments);
            assert!(message.contains("not a regular file"), "{message}");
        }
    }
}

/// Names in files, and those of files, may hold what a terminal obeys: none of it gets there.
#[test]
#[cfg(unix)]
fn escape_sequences_reach_no_terminal() {
    let place = Place::new();
    let write = |name: &str, text: &str| fs::write(place.0.path().join(name), text).unwrap();
    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
    write("named.obj", &format!("usemtl \u{1b}]0;title\u{7}red\u{9b}31m\n{SQUARE}"));
    write("\u{1b}[2Jfile.obj", "v 0 0\u{1b}[31m\n");
    write("scene.ron", r#"Scene(version: 1, geometry: [Box(min: (0, 0, 0), max: (1, 1, 1), material: "a\u{1b}[31m\rb")])"#);
    write("raw.ron", "Scene(version: 1, geometry: [Box(min: (0, 0, 0), max: (1, 1, 1), \u{1b}[31m \r material: \"a\")])");
    write("nodes.ron", r#"Pipeline(version: 1, about: "", nodes: [(name: "a\u{1b}[31mb", pass: GBuffer())], outputs: {"picture": "a\u{1b}[31mb"})"#);
    let explained: [&[&str]; 8] = [
        &["explain", "irradiance", "--scene", "named.obj"],
        &["explain", "irradiance", "--scene", "\u{1b}[2Jfile.obj"],
        &["explain", "irradiance", "--scene", "scene.ron"],
        &["explain", "irradiance", "--scene", "raw.ron"],
        &["explain", "irradiance", "--scene", "furnace", "--camera", "a\u{1b}[31m\rb"],
        &["explain", "irradiance", "--scene", "furnace", "--size", "a\u{1b}[31m\rb"],
        &["graph", "nodes.ron"],
        &["check", "nodes.ron"],
    ];
    for arguments in explained {
        let (_, stdout, stderr) = place.run(arguments);
        for text in [stdout, stderr] {
            assert!(!text.contains(|letter: char| letter.is_control() && letter != '\n'), "{arguments:?}: {text:?}");
        }
    }
    let (_, _, notes) = place.run(explained[0]);
    assert!(notes.contains(r"reflect 0.7: \u{1b}]0;title\u{7}red\u{9b}31m"), "{notes}");
    let message = place.refusal(explained[1]);
    assert!(message.contains(r"\u{1b}[2Jfile.obj:1:") && message.contains("v 0 0?[31m"), "{message}");
}

#[test]
fn sizes_and_exposures_have_limits() {
    let place = Place::new();
    for size in ["16385x1", "4294967295x4294967295", "0x1"] {
        assert!(place.refusal(&["explain", "irradiance", "--scene", "furnace", "--size", size]).contains("1 to 16384 pixels"));
    }
    for exposure in ["NaN", "inf", "-1e9"] {
        assert!(place.refusal(&[&FURNACE[..], &["-o", "x.png", "--exposure", exposure]].concat()).contains("-100 to 100"));
    }
}

#[test]
fn colours_are_a_choice() {
    let place = Place::new();
    let escapes = |when: &str| place.run(&["--color", when, "diff", "a.exr", "b.exr"]).2.contains('\u{1b}');
    assert!(escapes("always") && !escapes("never") && !escapes("auto"));
}

/// A box whose walls emit 1 and reflect nothing: the direct irradiance is π, the indirect none.
const FURNACE: [&str; 5] = ["reference", "--scene", "furnace.ron", "--size", "16x12"];

#[test]
fn reference_writes_layers_that_can_be_compared_and_attributes_to_run_it_again() {
    let place = Place::new();
    let (status, stdout, stderr) = place.run(&[&FURNACE[..], &["--spp", "256", "-o", "out/f.exr", "-o", "out/f.png", "--quiet"]].concat());
    assert_eq!((status, stdout.as_str(), stderr.as_str()), (0, "", ""));
    let picture = Layers::read(&fs::read(place.0.path().join("out/f.exr")).unwrap()).unwrap();
    let names: Vec<&str> = picture.layers.keys().map(String::as_str).collect();
    assert_eq!(
        names,
        [
            "depth",
            "direct",
            "direct_irradiance",
            "direct_luminance_variance",
            "indirect",
            "indirect_luminance_variance",
            "irradiance",
            "irradiance_luminance_variance",
            "normal",
            "picture",
            "picture_luminance_variance",
            "variance"
        ]
    );
    let [direct, indirect] = ["direct_irradiance", "irradiance"].map(|layer| picture.rgb(layer).unwrap()[1].to_vec());
    let mean = direct.iter().sum::<f32>() / direct.len() as f32;
    assert!((mean - std::f32::consts::PI).abs() < 0.02, "{mean}");
    assert!(indirect.iter().all(|value| *value == 0.0));
    assert!(picture.layers[PICTURE].channels["A"].iter().all(|alpha| *alpha == 1.0), "the box is closed");
    assert!(picture.projection.is_some());
    for (name, value) in
        [("bounces", "1"), ("stride", "1"), ("spp", "256"), ("seed", "0"), ("size", "16x12"), ("scene", "furnace.ron"), ("command", "reference")]
    {
        assert_eq!(picture.attributes.get(name).map(String::as_str), Some(value), "{name}");
    }
    assert_eq!(place.run(&["diff", "out/f.exr:direct_irradiance", "out/f.exr", "--fail-above", "largest=0"]).0, 0);
}

#[test]
fn reference_is_repeatable_and_a_stride_holds_the_same_pixels() {
    let place = Place::new();
    let written = |name: &str, more: &[&str]| {
        assert_eq!(place.run(&[&FURNACE[..], &["--spp", "8", "-o", name], more].concat()).0, 0);
        fs::read(place.0.path().join(name)).unwrap()
    };
    assert_eq!(written("a.exr", &[]), written("b.exr", &[]));
    let strided = Layers::read(&written("c.exr", &["--stride", "4"])).unwrap();
    assert_eq!((strided.width, strided.height), (4, 3));
    assert_eq!(place.run(&["diff", "a.exr:direct_irradiance", "c.exr", "--fail-above", "largest=0"]).0, 0);
}

#[test]
fn windows_of_a_reference_hold_the_same_pixels_and_tell_their_places() {
    let place = Place::new();
    let size = ["--size", "200x100", "--spp", "4"];
    let written = |name: &str, more: &[&str]| {
        assert_eq!(place.run(&[&FURNACE[..3], &size, &["-o", name], more].concat()).0, 0);
        Layers::read(&fs::read(place.0.path().join(name)).unwrap()).unwrap()
    };
    written("whole.exr", &[]);
    let windows = written("windows.exr", &["--windows", "2"]);
    assert_eq!([windows.width, windows.height], [200, 100]);
    assert_eq!(windows.windows().unwrap(), hemisplat::math::windows::Windows::spread([200, 100], 2));
    let (status, stdout, _) = place.run(&["diff", "whole.exr:direct_irradiance", "windows.exr", "--fail-above", "largest=0", "--fail-above", "band_error=0"]);
    assert!(status == 0 && stdout.contains("8192 pixels of surface in 2 windows"), "{stdout}");
    let (status, stdout, _) = place.run(&["diff", "whole.exr:picture", "windows.exr", "--fail-above", "flip=0", "--fail-above", "hdr_flip=0"]);
    assert!(status == 0 && !stdout.contains("flip          not measurable"), "{stdout}");
}

#[test]
fn reference_refuses_what_it_cannot_use_before_it_works() {
    let place = Place::new();
    let refusal = |more: &[&str]| place.refusal(&[&FURNACE[..], more].concat());
    insta::assert_snapshot!(refusal(&["-o", "f.jpg"]));
    insta::assert_snapshot!(refusal(&["-o", "f.exr", "--camera", "none"]));
    insta::assert_snapshot!(refusal(&["-o", "f.exr", "--stride", "13"]));
    insta::assert_snapshot!(refusal(&["-o", "f.exr", "--bounces", "some"]));
    insta::assert_snapshot!(refusal(&["-o", "f.exr", "--windows", "1"]));
    assert!(refusal(&["-o", "f.exr", "--windows", "1", "--stride", "2"]).contains("cannot be used with"));
    assert!(refusal(&["-o", "f.exr", "--spp", "8", "--error", "0.1"]).contains("cannot be used with"));
    assert!(place.refusal(&["reference", "--scene", "missing.obj", "-o", "f.exr"]).contains("missing.obj"));
    assert!(place.refusal(&["reference", "--scene", "furnace.ron", "--size", "0x5", "-o", "f.exr"]).contains("640x480"));
}

#[test]
#[cfg(unix)]
fn work_that_leaves_nothing_is_interrupted_at_once() {
    let arguments = ["check", "irradiance", "--scene", "hall", "--scene-set", "triangles=8000000"];
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_hemisplat")).args(arguments).stderr(std::process::Stdio::piped()).spawn().unwrap();
    std::thread::sleep(std::time::Duration::from_millis(700));
    let sent = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let start = std::time::Instant::now();
    assert!(sent.success());
    let status = child.wait().unwrap().code();
    let message = std::io::read_to_string(child.stderr.take().unwrap()).unwrap();
    assert_eq!((status, message.as_str()), (Some(130), "interrupted; nothing was written\n"));
    assert!(start.elapsed().as_secs() < 5, "{:?}", start.elapsed());
}

#[test]
#[cfg(unix)]
fn an_interrupted_reference_ends_with_130_and_keeps_what_is_whole() {
    let place = Place::new();
    let arguments = [&FURNACE[..], &["--spp", "1000000", "-o", "f.exr"]].concat();
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_hemisplat"))
        .current_dir(place.0.path())
        .args(arguments)
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    let sent = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let names: Vec<_> = fs::read_dir(place.0.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(names.is_empty() || names == ["f.exr"], "{names:?}");
    if names == ["f.exr"] {
        assert!(Layers::read(&fs::read(place.0.path().join("f.exr")).unwrap()).is_ok());
    }
}

#[test]
fn stability_refuses_pipelines_and_cases_that_do_not_exist() {
    let place = Place::new();
    let refusal = place.refusal(&["stability", "irradiance", "--only", "nothing"]);
    assert!(refusal.contains("furnace") && refusal.contains("most-records"), "{refusal}");
    assert!(place.refusal(&["stability", "irradiance", "irradianse"]).contains("pipeline::not_found"));
}

#[test]
#[cfg(target_os = "linux")]
fn tables_are_kept_and_made_anew_where_damaged() {
    let place = Place::new();
    let plan = ["explain", "radiance-rotated", "--scene", "cornell-glossy", "--set", "lobes.order=Fixed(order:3)"];
    let (status, first, stderr) = place.run(&plan);
    assert_eq!(status, 0, "{stderr}");
    let kept: Vec<_> = fs::read_dir(place.0.path().join("kept/hemisplat")).unwrap().map(|entry| entry.unwrap().path()).collect();
    let [table] = &kept[..] else { panic!("{kept:?}") };
    let whole = fs::read(table).unwrap();
    for damaged in [b"another thing".to_vec(), whole[..whole.len() / 2].to_vec(), vec![]] {
        fs::write(table, damaged).unwrap();
        let (status, again, stderr) = place.run(&plan);
        assert_eq!((status, &again), (0, &first), "{stderr}");
        assert!(fs::read(table).unwrap() == whole);
    }
    // Where nothing can be kept, a file in place of the folder, all goes on as before.
    fs::remove_dir_all(place.0.path().join("kept")).unwrap();
    fs::write(place.0.path().join("kept"), "").unwrap();
    assert_eq!(place.run(&plan).1, first);
}

/// The first words of the lines.
fn names(lines: &str) -> Vec<&str> {
    lines.lines().filter_map(|line| line.split_whitespace().next()).collect()
}

#[test]
fn what_ships_is_listed_and_printed_to_start_from() {
    let place = Place::new();
    let (status, pipelines, stderr) = place.run(&["pipelines"]);
    assert_eq!((status, stderr.as_str()), (0, ""));
    let ward = pipelines.lines().find(|line| line.starts_with("irradiance-ward ")).unwrap();
    assert!(ward.ends_with("Ward's weights of 1988 and 1992 instead of compact ones (a variant of irradiance-one-rate)"), "{ward}");
    assert_eq!(names(&pipelines).len(), hemisplat::pipeline::embedded::EMBEDDED.len());
    let (_, scenes, _) = place.run(&["scenes"]);
    assert!(scenes.lines().any(|line| line.starts_with("furnace ") && line.contains(" A white furnace: ")), "{scenes}");
    assert_eq!(names(&scenes).len(), hemisplat::scene::load::embedded_scenes().count());
    for list in [&pipelines, &scenes] {
        assert!(list.lines().all(|line| line.split_once("  ").is_some_and(|(_, about)| !about.trim().is_empty())), "{list}");
    }
    for (kind, name) in names(&pipelines).iter().map(|name| ("pipelines", name)).chain(names(&scenes).iter().map(|name| ("scenes", name))) {
        let shipped = fs::read_to_string(format!("{}/{kind}/{name}.ron", env!("CARGO_MANIFEST_DIR"))).unwrap();
        assert_eq!(place.run(&[kind, name]), (0, shipped, String::new()));
    }
    fs::write(place.0.path().join("mine.ron"), place.run(&["pipelines", "irradiance-ward"]).1).unwrap();
    assert_eq!(place.run(&["check", "mine.ron"]).0, 0, "a variant finds the pipeline that it changes");
    assert!(place.refusal(&["scenes", "cornel"]).contains("cornell"));
}

#[test]
fn starts_are_whole_and_written_once() {
    let place = Place::new();
    let new = |kind: &str, name: &str| place.run(&["new", kind, name]);
    for (kind, name, file) in [("scene", "rooms/attic", "rooms/attic.ron"), ("pipeline", "quick.ron", "quick.ron")] {
        let (status, stdout, stderr) = new(kind, name);
        assert_eq!((status, stderr.as_str()), (0, ""));
        assert!(stdout.starts_with(&format!("{file}\n")), "{stdout}");
    }
    let (status, _, stderr) = place.run(&["check", "quick.ron", "--scene", "rooms/attic.ron", "--strict"]);
    assert_eq!((status, stderr.as_str()), (0, ""));
    fs::write(place.0.path().join("quick.ron"), "mine").unwrap();
    assert!(place.refusal(&["new", "pipeline", "quick"]).contains("quick.ron is there already"));
    assert_eq!(fs::read_to_string(place.0.path().join("quick.ron")).unwrap(), "mine");
    assert!(place.refusal(&["new", "scene", "../"]).contains("`../` does not name a file"));
}

#[test]
fn passes_start_in_a_checkout() {
    let place = Place::new();
    assert!(place.refusal(&["new", "pass", "BlurAlong"]).contains("no passes/mod.rs here"));
    fs::create_dir_all(place.0.path().join("passes/splat")).unwrap();
    fs::write(place.0.path().join("passes/mod.rs"), "").unwrap();
    assert!(place.refusal(&["new", "pass", "Splat"]).contains("passes/splat is there already"));
    assert!(place.refusal(&["new", "pass", "blur"]).contains("`blur` does not name a pass"));
    let (status, stdout, _) = place.run(&["new", "pass", "BlurAlong"]);
    assert_eq!(status, 0);
    assert!(stdout.contains("`&blur_along::BlurAlong,`"), "{stdout}");
    for (file, word) in
        [("passes/blur_along.rs", "pub struct BlurAlong;"), ("shaders/blur_along.wgsl", "fn multiply("), ("pipelines/blur_along.ron", "pass: BlurAlong(")]
    {
        let text = fs::read_to_string(place.0.path().join(file)).unwrap();
        assert!(text.contains(word) && !text.to_lowercase().contains("brighten"), "{file}: {text}");
    }
}

#[test]
fn passes_are_written_as_markdown() {
    let place = Place::new();
    let (status, one, stderr) = place.run(&["passes", "Splat", "--markdown"]);
    assert_eq!((status, stderr.as_str()), (0, ""));
    assert!(one.starts_with("## Splat\n\n") && one.contains("\n### Parameters\n\n- `"), "{one}");
    let (_, all, _) = place.run(&["passes", "--markdown"]);
    assert!(all.contains(&one));
    let chapters: Vec<&str> = all.lines().filter_map(|line| line.strip_prefix("## ")).collect();
    assert_eq!(chapters, names(&place.run(&["passes"]).1));
}

#[test]
fn options_of_other_renderers_are_answered_with_what_there_is() {
    let place = Place::new();
    let refusal = |more: [&str; 2]| place.refusal(&[&["render", "irradiance", "--scene", "furnace", "-o", "x.exr"], &more[..]].concat());
    assert!(refusal(["--spp", "64"]).contains("--set tiles.resolution=N"));
    assert!(refusal(["--bounces", "3"]).contains("hemisplat reference --bounces N"));
    assert!(!place.run(&["render", "--help"]).1.contains("--spp <"), "they are not offered");
}

#[test]
fn a_file_called_minus_is_standard_output() {
    let place = two_pictures();
    let (status, stdout, stderr) = place.run(&["diff", "a.exr", "b.exr", "--json", "-"]);
    assert_eq!(status, 0);
    let json: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(json["layer"], "irradiance");
    assert!(stderr.contains("rmse_over_mean"), "the table goes to stderr");
    assert_eq!(place.run(&["diff", "a.exr", "b.exr", "--json", "-", "--quiet"]), (0, stdout, String::new()));
    assert!(!place.0.path().join("-").exists());
}

#[test]
fn the_environment_is_told_by_the_help() {
    let (_, help, _) = Place::new().run(&["--help"]);
    for variable in ["HEMISPLAT_SCENES", "WGPU_ADAPTER_NAME", "VK_DRIVER_FILES", "RAYON_NUM_THREADS", "XDG_CACHE_HOME", "NO_COLOR"] {
        assert!(help.contains(&format!("\n  {variable} ")), "{variable}");
    }
}
