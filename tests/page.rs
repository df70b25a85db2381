//! The page of a comparison and that of a sweep in a real browser: what its controls do, what it shows, how heavy it is.
//!
//! Needs Chromium; without one each case is named as skipped, which `HEMISPLAT_REQUIRE=browser` makes a failure. The pictures are made here, so
//! that no GPU is needed. `HEMISPLAT_UPDATE_GOLDEN=1 cargo test --test page` draws the tracked picture of the page anew.

mod browser;
mod skips;

use base64::{Engine, engine::general_purpose::STANDARD};
use browser::Browser;
use browser::made::{COLOURS, Made, SIZE, made, open, picture, swept, swept_report, textured, with};
use glam::Vec3;
use hemisplat::math::weight::{Record, Rule, Weighting};
use hemisplat::measure::compare::{Cut, FrameOfRuns, VariantReport};
use hemisplat::measure::course::{Course, FrameErrors};
use hemisplat::measure::criteria::Cost;
use hemisplat::measure::expectation::{Found, Verdict};
use hemisplat::measure::page::{Gallery, Moment, Overlay, page};
use hemisplat::measure::statistics::Spread;
use hemisplat::measure::sweep::{Outcome as State, mark_front};
use hemisplat::measure::{GLOSSY, Layer, Layers, PICTURE};
use hemisplat::scene::Camera;
use hemisplat::scene::model::{FieldOfView, Sample};
use image::RgbImage;
use libtest_mimic::{Arguments, Failed};
use skips::Missing;
use std::collections::BTreeMap;
use std::env;
use std::f32::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

type Outcome = Result<(), Failed>;
type Case = fn(&mut Browser) -> Outcome;

const CASES: &[(&str, Case)] = &[
    ("the_slider_parts_the_pictures", slider),
    ("keys_flip_swap_and_step", keys),
    ("zoom_keeps_both_sides_in_step", zoom),
    ("maps_of_errors_have_a_scale", maps),
    ("exposure_and_curve_show_light_beyond_the_screen", exposure),
    ("differences_are_of_what_is_left_and_right", difference),
    ("insets_show_a_part_of_every_picture", insets),
    ("records_lie_over_the_picture", records),
    ("frames_play_in_step_over_the_course_of_errors", film),
    ("a_link_holds_the_view", link),
    ("a_saved_picture_holds_its_light", saved),
    ("a_table_that_goes_on_fades", overflow),
    ("glossy_light_is_shown_as_pictures_and_as_maps", glossy),
    ("without_a_reference_the_page_says_so", no_reference),
    ("a_point_opens_its_picture", plot),
    ("runs_that_were_ended_early_lead_to_the_whole_one", cuts),
    ("marks_that_cover_each_other_open_by_their_letters", covered),
    ("columns_sort", table),
    ("texts_show_their_difference", texts),
    ("what_a_study_expected_is_shown_and_what_it_missed_stands_out", expectations),
    ("names_are_text", hostile_names),
    ("a_sweep_has_lines_a_front_and_points_that_open", sweep),
    ("a_point_without_a_picture_says_why", refused),
    ("pictures_as_means_of_blocks_stay_in_step", blocks),
    ("fingers_move_the_slider_and_zoom", fingers),
    ("it_fits_phones_light_and_dark_one_two_and_twenty", sizes),
    ("a_sweep_fits_phones", narrow),
    ("ten_large_pictures_open_in_two_seconds", heavy),
    ("forty_large_pictures_weigh_no_more", many),
    ("it_looks_as_it_did", looks),
];

fn main() {
    let missing = browser::find().is_none().then(|| Missing::new("browser", "no browser (chromium)"));
    let trials = CASES.iter().map(|(name, case)| skips::trial(*name, missing.as_ref(), move || run(*case)));
    // Opening is timed: one after the other.
    let arguments = Arguments { test_threads: Some(1), ..Arguments::from_args() };
    libtest_mimic::run(&arguments, trials.collect()).exit();
}

/// A case, after which nothing may have complained.
fn run(case: Case) -> Outcome {
    let mut browser = Browser::start()?;
    browser.resize(WINDOW, false)?;
    case(&mut browser)?;
    let complaints = browser.complaints()?;
    check(complaints.is_empty(), || complaints.join("\n"))
}

fn check(holds: bool, what: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(what().into()) }
}

const WINDOW: [u32; 2] = [1000, 900];
/// Whether what is to be shown is drawn.
const DRAWN: &str = "document.querySelector('#stage').ariaBusy === 'false'";

/// The colour that the window shows at a share of the stage's width, in the middle of its height, once it is drawn.
fn colour_at(browser: &mut Browser, share: f64) -> Result<[u8; 3], Failed> {
    browser.until(DRAWN)?;
    let [x, y] = on_stage(browser, share)?;
    // Away from the slider's grip.
    Ok(browser.screenshot()?.get_pixel(x as u32, y as u32 + 40).0)
}

fn on_stage(browser: &mut Browser, share: f64) -> Result<[f64; 2], Failed> {
    let [x, y] = browser.middle("#stage")?;
    let width = browser.evaluate("document.querySelector('#stage').clientWidth")?.as_f64().unwrap_or(0.0);
    Ok([x + (share - 0.5) * width, y])
}

/// Whether the stage shows one of [`COLOURS`] there.
fn shows(browser: &mut Browser, share: f64, channel: usize) -> Outcome {
    let colour = colour_at(browser, share)?;
    let others = (0..3).filter(|other| *other != channel).map(|other| colour[other]).max().unwrap_or(0);
    check(colour[channel] > others.saturating_add(60), || format!("at {share} channel {channel} is to be seen, not {colour:?}"))
}

/// What the page does after a key or a click is drawn with its next frame, and on a busy machine that is a while.
fn equals(browser: &mut Browser, expression: &str, expected: impl Into<serde_json::Value>) -> Outcome {
    let expected = expected.into();
    let end = Instant::now() + Duration::from_secs(10);
    loop {
        let found = browser.evaluate(expression)?;
        if found == expected {
            return Ok(());
        }
        check(Instant::now() < end, || format!("{expression} is {found}, not {expected}"))?;
        thread::sleep(Duration::from_millis(20));
    }
}

fn slider(browser: &mut Browser) -> Outcome {
    let _page = made(3).open(browser)?;
    shows(browser, 0.25, 0)?;
    shows(browser, 0.75, 1)?;
    let (from, to) = (on_stage(browser, 0.5)?, on_stage(browser, 0.9)?);
    browser.drag(from, to)?;
    shows(browser, 0.75, 0)?;
    equals(browser, "document.querySelector('#slider').ariaValueNow", "90")?;
    browser.evaluate("document.querySelector('#slider').focus()")?;
    browser.key("Home")?;
    shows(browser, 0.25, 1)?;
    browser.key("End")?;
    browser.key("ArrowLeft")?;
    shows(browser, 0.75, 0)?;
    equals(browser, "document.querySelector('#slider').ariaValueNow", "99")
}

fn keys(browser: &mut Browser) -> Outcome {
    let _page = made(3).open(browser)?;
    browser.key("f")?;
    shows(browser, 0.25, 1)?;
    browser.key("f")?;
    shows(browser, 0.75, 0)?;
    browser.key("v")?;
    browser.key("]")?;
    shows(browser, 0.75, 2)?;
    browser.key("x")?;
    shows(browser, 0.25, 2)?;
    browser.key("v")?;
    equals(browser, "document.querySelector('#view input:checked').value", "side")?;
    // Each of the panes shows its whole picture.
    shows(browser, 0.1, 2)?;
    shows(browser, 0.9, 0)?;
    browser.key("?")?;
    equals(browser, "document.querySelector('#keys').open", true)
}

fn zoom(browser: &mut Browser) -> Outcome {
    // The left half is of another colour than the right.
    let halves = |left: usize, right: usize| picture(SIZE, move |x, _| COLOURS[if x < SIZE[0] / 2 { left } else { right }], 1.0);
    let _page = with(vec![halves(0, 1), halves(2, 0)], None).open(browser)?;
    let scale = "document.querySelector('#zoom').value";
    let whole = browser.evaluate(scale)?;
    shows(browser, 0.25, 0)?;
    shows(browser, 0.75, 0)?;
    (0..4).try_for_each(|_| browser.key("+"))?;
    check(browser.evaluate(scale)? != whole, || "nothing is zoomed".into())?;
    // Moved to the left end, both sides show what is left.
    (0..12).try_for_each(|_| browser.key("h"))?;
    shows(browser, 0.25, 0)?;
    shows(browser, 0.75, 2)?;
    (0..24).try_for_each(|_| browser.key("l"))?;
    shows(browser, 0.25, 1)?;
    shows(browser, 0.75, 0)?;
    browser.key("0")?;
    equals(browser, scale, whole)?;
    browser.key("1")?;
    equals(browser, scale, "100 %")
}

fn maps(browser: &mut Browser) -> Outcome {
    let mut made = made(2);
    made.pictures[0] = picture(SIZE, |_, _| COLOURS[0], 0.9);
    let _page = made.open(browser)?;
    equals(browser, "document.querySelector('#scale').hidden", true)?;
    browser.key("e")?;
    equals(browser, "document.querySelector('#layer').value", "error picture")?;
    show(browser, "error irradiance")?;
    equals(browser, "document.querySelector('#scale-ticks').textContent", "−10.0 %−5.00 %0 %+5.00 %+10.0 %")?;
    // The left is too dark, which is blue, the right too bright.
    let cold = |[r, _, b]: [u8; 3]| i32::from(b) - i32::from(r);
    let found = [colour_at(browser, 0.25)?, colour_at(browser, 0.75)?];
    check(cold(found[0]) > 60 && cold(found[1]) < -60, || format!("{found:?}"))?;
    let [x, y] = on_stage(browser, 0.75)?;
    browser.drag([x, y + 60.0], [x, y + 60.0])?;
    let text = browser.evaluate("document.querySelector('#readout').textContent")?;
    check(text.as_str().is_some_and(|text| text.contains("A −9.96 %") && text.contains("B +9.96 %")), || text.to_string())?;
    // Half as much is shown as if it were all, and twice as much.
    browser.key(".")?;
    equals(browser, "document.querySelector('#scale-ticks').textContent", "−5.00 %−2.50 %0 %+2.50 %+5.00 %")?;
    browser.key(",")?;
    browser.key(",")?;
    equals(browser, "document.querySelector('#scale-ticks').textContent", "−20.0 %−10.0 %0 %+10.0 %+20.0 %")?;
    let found = [colour_at(browser, 0.25)?, colour_at(browser, 0.9)?];
    check(cold(found[0]) > 60 && cold(found[1]) < -60, || format!("{found:?}"))?;
    show(browser, "flip picture")?;
    equals(browser, "document.querySelector('#scale-ticks').textContent.startsWith('0')", true)?;
    let text = readout(browser, 0.75)?;
    let share = text.split_whitespace().last().and_then(|share| share.parse::<f64>().ok());
    check(share.is_some_and(|share| share > 0.2 && share <= 1.0), || text)
}

/// What is chosen in the list beside the pictures.
fn show(browser: &mut Browser, choice: &str) -> Outcome {
    choose(browser, "layer", choice)?;
    browser.until(DRAWN)
}

/// Chooses an entry of a list, by the list's id and the entry's value.
fn choose(browser: &mut Browser, list: &str, value: &str) -> Outcome {
    browser.evaluate(&format!("{{ const list = document.querySelector('#{list}'); list.value = '{value}'; list.dispatchEvent(new Event('change')) }}"))?;
    equals(browser, &format!("document.querySelector('#{list}').value"), value)
}

/// Keeps what the page saves as `saved`, in place of a file.
const KEEP_SAVED: &str = "URL.createObjectURL = (blob) => { window.saved = blob; return '#'; }";

/// What is told of the pixel under the pointer, at a share of the stage's width.
fn readout(browser: &mut Browser, share: f64) -> Result<String, Failed> {
    browser.until(DRAWN)?;
    let [x, y] = on_stage(browser, share)?;
    browser.drag([x, y + 60.0], [x, y + 60.0])?;
    Ok(browser.evaluate("document.querySelector('#readout').textContent")?.as_str().unwrap_or_default().to_owned())
}

/// Whether the stage shows a grey there.
fn close(browser: &mut Browser, share: f64, expected: u8) -> Outcome {
    let found = colour_at(browser, share)?;
    check(found.iter().all(|byte| byte.abs_diff(expected) <= 1), || format!("{found:?}, not {expected}"))
}

/// Light beyond what a screen shows is there.
fn exposure(browser: &mut Browser) -> Outcome {
    let grey = |light: f32| picture(SIZE, move |_, _| [light; 3], 2.0 * light);
    let _page = with(vec![grey(4.0), grey(400.0)], Some(grey(4.0))).open(browser)?;
    // Middle grey, and white.
    close(browser, 0.25, 118)?;
    close(browser, 0.75, 255)?;
    (0..14).try_for_each(|_| browser.key(","))?;
    close(browser, 0.75, 106)?;
    equals(browser, "document.querySelector('#exposure').value", "-7")?;
    choose(browser, "curve", "clipped")?;
    close(browser, 0.75, 110)?;
    choose(browser, "gamma", "1")?;
    close(browser, 0.75, 40)?;
    let text = readout(browser, 0.75)?;
    check(text.ends_with("A 4.001 4.001 4.001   B 400.0 400.0 400.0   W/(m²·sr)"), || text)?;
    show(browser, "shown irradiance")?;
    let text = readout(browser, 0.75)?;
    check(text.ends_with("A 8.001 8.001 8.001   B 799.9 799.9 799.9   W/m²"), || text)
}

fn difference(browser: &mut Browser) -> Outcome {
    // On the left half the second is darker by half, on the right half brighter by a tenth.
    let second = picture(SIZE, |x, _| [if x < SIZE[0] / 2 { 0.5 } else { 1.1 }; 3], 1.0);
    let _page = with(vec![picture(SIZE, |_, _| [1.0; 3], 1.0), second], None).open(browser)?;
    show(browser, "relative picture")?;
    equals(browser, "document.querySelector('#left-label').textContent.includes(' less B')", true)?;
    equals(browser, "document.querySelector('#right-label').hidden && document.querySelector('#slider').hidden", true)?;
    let warm = |[r, _, b]: [u8; 3]| i32::from(r) - i32::from(b);
    let found = [colour_at(browser, 0.25)?, colour_at(browser, 0.75)?];
    check(warm(found[0]) > 60 && warm(found[1]) < -60, || format!("{found:?}"))?;
    let told = [readout(browser, 0.25)?, readout(browser, 0.75)?];
    check(told[0].contains("   +100 %   A 1.000") && told[1].contains("   −9.0"), || format!("{told:?}"))?;
    browser.key("x")?;
    let text = readout(browser, 0.75)?;
    check(text.contains("   +9.96 %   B 1.100"), || text)?;
    // Over the mean of the right one, which is now the first.
    show(browser, "difference picture")?;
    let text = readout(browser, 0.25)?;
    check(text.contains("   −50.0 %   B 0.5001"), || text)
}

fn insets(browser: &mut Browser) -> Outcome {
    let _page = made(3).open(browser)?;
    browser.evaluate(KEEP_SAVED)?;
    browser.key("p")?;
    readout(browser, 0.1)?;
    browser.key("p")?;
    equals(browser, "document.querySelectorAll('#insets li').length", 2)?;
    // Each of the three and the reference.
    equals(browser, "[...document.querySelectorAll('#insets li:first-child figcaption')].map((name) => name.textContent).join()", "A,B,C,reference")?;
    // Browsers complain of canvases that are read often: copies are read.
    browser.begin(
        "window.pixel = (canvas) => { const copy = document.createElement('canvas'); Object.assign(copy, { width: 16, height: 16 }); \
         const context = copy.getContext('2d', { willReadFrequently: true }); context.drawImage(canvas, 0, 0); return [...context.getImageData(9, 9, 1, 1).data]; }",
    )?;
    browser.until("pixel(document.querySelector('#insets li canvas'))[0] > 150")?;
    // A row is made anew as its pictures arrive: a button pressed before the last has come is gone when it is let go.
    browser.until("[...document.querySelectorAll('#insets canvas')].every((canvas) => pixel(canvas)[3] === 255)")?;
    browser.click("#insets li:last-child .save")?;
    browser.until("window.saved?.type === 'image/png'")?;
    browser.click("#insets li .remove")?;
    equals(browser, "document.querySelectorAll('#insets li').length", 1)?;
    equals(browser, "document.querySelector('#insets p').textContent.startsWith('x 5 to 13,')", true)
}

/// Frame 10 of two variants is red and green, 11 green and blue, and so on; each is 10 % brighter than the one before.
fn film(browser: &mut Browser) -> Outcome {
    let still = made(2).open(browser)?;
    equals(browser, "document.querySelector('#frames').hidden && document.querySelector('#course-section').hidden", true)?;
    drop(still);
    const FRAMES: u32 = 4;
    let mut made = made(2);
    for (index, variant) in made.comparison.variants.iter_mut().enumerate() {
        let seconds = |frame: u32| Spread::of(&[0.1 * f64::from(frame + 1) * (index + 1) as f64]);
        let frame = |frame| Some(FrameOfRuns { frame: 10 + frame, seconds: seconds(frame)?, records: Some(100 + 10 * frame), new_records: Some(0) });
        variant.frames = (0..FRAMES).filter_map(frame).collect();
        let errors = |error: f64, flicker| FrameErrors { rmse_over_mean: Some(error), bias_over_mean: Some(0.0), block_p50: None, block_p99: None, flicker };
        let frames: Vec<_> = (0..FRAMES).map(|frame| errors(0.01 * f64::from(frame + 1), (frame > 0).then_some(0.002))).collect();
        let course = Course { frames, mean: errors(0.025, None), flicker: Some(0.002), jumps: 0, lag_p50: None, lag_p99: None, ghost_p99: None };
        variant.courses = [(PICTURE.to_owned(), course)].into();
    }
    let mut gallery = Gallery::new(SIZE, 3 * FRAMES as usize);
    for frame in 0..FRAMES {
        let light = 1.1f32.powi(frame as i32);
        let truth = picture(SIZE, |_, _| [0.4 * light; 3], light);
        for variant in 0..2 {
            gallery.add(&picture(SIZE, |_, _| COLOURS[(variant + frame as usize) % 3].map(|channel| channel * light), light), Some(&truth))?;
        }
        gallery.end_frame(Some(Moment { frame: 10 + frame, seconds: f64::from(frame) / 12.0 }), Some(&truth))?;
    }
    let html = page(&made.report(), &gallery)?;
    let shown = "document.querySelector('#frame-told').value";
    let page = open(&html, browser)?;
    // The last is shown first, whose errors the table has.
    equals(browser, shown, "frame 13, 0.250 s")?;
    shows(browser, 0.25, 0)?;
    shows(browser, 0.75, 1)?;
    browser.key("b")?;
    equals(browser, shown, "frame 12, 0.167 s")?;
    shows(browser, 0.25, 2)?;
    shows(browser, 0.75, 0)?;
    let text = readout(browser, 0.25)?;
    check(text.contains("A 0.02420 0.02420 0.9679"), || text)?;
    // The lines below are of all frames, and lead to them.
    equals(browser, "document.querySelectorAll('#course .line').length", 2)?;
    equals(browser, "[...document.querySelectorAll('#course-legend li')].map((line) => line.textContent.split(': ').at(-1)).join()", "3.00 %,3.00 %")?;
    let [x, y] = browser.middle("#course")?;
    let width = browser.evaluate("document.querySelector('#course').clientWidth")?.as_f64().unwrap_or(0.0);
    browser.drag([x - 0.5 * width + 66.0, y], [x - 0.5 * width + 66.0, y])?;
    equals(browser, shown, "frame 10, 0.000 s")?;
    // Reading a pixel has brought the slider there.
    shows(browser, 0.1, 0)?;
    shows(browser, 0.75, 1)?;
    choose(browser, "course-of", " seconds")?;
    equals(browser, "document.querySelector('#course-legend').textContent.endsWith(': 0.200')", true)?;
    browser.key("e")?;
    equals(browser, "document.querySelector('#scale-text').textContent.startsWith('Too dark')", true)?;
    equals(browser, "location.hash.includes('frame=10')", true)?;
    // Playing comes to the end and begins again.
    browser.key("t")?;
    browser.until(&format!("{shown} === 'frame 13, 0.250 s'"))?;
    browser.until(&format!("{shown} === 'frame 11, 0.083 s'"))?;
    browser.click("#play")?;
    equals(browser, "document.querySelector('#play').textContent", "Play")?;
    browser.begin("location.hash = 'frame=12'")?;
    equals(browser, shown, "frame 12, 0.167 s")?;
    drop(page);
    Ok(())
}

/// Of a wall 2 before the eye that fills the picture, 4 wide: one record in the middle of the left half, three on the right.
fn wall(cache: &str) -> Overlay {
    let field_of_view = FieldOfView::Horizontal(FRAC_PI_2);
    let camera = Camera { name: "wall".into(), eye: Vec3::ZERO, direction: Vec3::Y, up: Vec3::Z, field_of_view, size: None, sample: Sample::default() };
    let rule = Rule {
        weighting: Weighting::Compact,
        accuracy: 0.25,
        spacing: [1.0, 20.0],
        nearest: 0.5,
        change: 1.0,
        overlap: 0.0,
        contrast: 1.0,
        finest_spacing: 1.0,
    };
    let record = |x: f32, z: f32, error: f32, minimum_distance: f32| Record {
        position: Vec3::new(x, 2.0, z),
        radius: 2.0,
        normal: -Vec3::Y,
        minimum_distance,
        irradiance: Vec3::splat(8.0),
        footprint: 0.05,
        error: Vec3::splat(8.0 * error),
        rotation: [Vec3::ZERO; 3],
        translation: [Vec3::ZERO; 3],
        stretch: Vec3::ZERO,
        relative_gradient: 0.0,
        fineness: 1.0,
        confinement: 0.0,
    };
    let right = [-0.5, 0.0, 0.5].map(|z| record(1.0, z, 0.3, 0.2));
    Overlay::new(cache.into(), &rule, &[&[record(-1.0, 0.0, 0.015, 9.0)], &right[..]].concat(), &camera, SIZE)
}

fn records(browser: &mut Browser) -> Outcome {
    let plain = made(2).open(browser)?;
    equals(browser, "document.querySelector('#records').parentElement.hidden", true)?;
    drop(plain);
    let page = Made { records: vec![wall("cache"), wall("glossy_cache")], ..made(2) }.open(browser)?;
    equals(
        browser,
        "[...document.querySelectorAll('#records option')].map(({ value }) => value).join()",
        ",limit cache,error cache,limit glossy_cache,error glossy_cache",
    )?;
    let before = readout(browser, 0.9)?;
    browser.key("r")?;
    equals(browser, "document.querySelector('#records').value", "limit cache")?;
    browser.until("document.querySelector('#rings-text').textContent.includes('A: 4. B has no such records.')")?;
    // Half a unit of 4 around the middle of the left half: the ring's right end is at 3/8. `accuracy` ended it.
    let ring = |browser: &mut Browser, colour: [i32; 3]| {
        browser.until(DRAWN)?;
        let [x, y] = on_stage(browser, 0.375)?;
        let near = |found: [u8; 3]| (0..3).all(|channel| (i32::from(found[channel]) - colour[channel]).abs() < 90);
        let shot = browser.screenshot()?;
        let found: Vec<[u8; 3]> = (-3..=3).map(|step| shot.get_pixel((x as i32 + step) as u32, y as u32).0).collect();
        check(found.iter().any(|colour| near(*colour)), || format!("no ring of {colour:?} in {found:?}"))
    };
    ring(browser, [86, 180, 233])?;
    browser.key("r")?;
    equals(browser, "document.querySelector('#records').value", "error cache")?;
    equals(browser, "document.querySelector('#rings-legend').textContent", "to 1.00 %to 2.00 %to 5.00 %to 10.0 %to 20.0 %above 20.0 %")?;
    ring(browser, [70, 134, 251])?;
    let [x, y] = on_stage(browser, 0.25)?;
    browser.drag([x, y], [x, y])?;
    let text = browser.evaluate("document.querySelector('#readout').textContent")?;
    let told = "record of A: 8.000 W/m² ± 1.50 %, reaches 0.500, limited by accuracy";
    check(text.as_str().is_some_and(|text| text.contains(told)) && !before.contains("record"), || text.to_string())?;
    // The link holds them.
    browser.until("location.hash.includes('records=error.cache')")?;
    let file = page.path().join("page.html");
    browser.open(Path::new("/dev/null"))?;
    browser.open_at(&file, "records=limit.glossy_cache")?;
    equals(browser, "document.querySelector('#records').value", "limit glossy_cache")
}

/// An address that another person opens.
fn link(browser: &mut Browser) -> Outcome {
    let page = made(3).open(browser)?;
    browser.key("]")?;
    browser.key("+")?;
    browser.key(".")?;
    browser.key("v")?;
    browser.key("p")?;
    show(browser, "error irradiance")?;
    browser.key(",")?;
    browser.until("location.hash.includes('scale=0.5')")?;
    let state = "JSON.stringify([...['left', 'right', 'layer', 'exposure', 'zoom'].map((id) => document.getElementById(id).value), document.querySelectorAll('#insets li').length, document.querySelector('#view input:checked').value, document.querySelector('#scale-ticks').textContent])";
    let (hash, before) = (browser.evaluate("location.hash")?, browser.evaluate(state)?);
    browser.open(Path::new("/dev/null"))?;
    let file = page.path().join("page.html");
    browser.open_at(&file, hash.as_str().unwrap_or_default().trim_start_matches('#'))?;
    equals(browser, state, before)?;
    // What makes no sense is as if it were not there.
    browser.open(Path::new("/dev/null"))?;
    browser.open_at(&file, "left=Z&right=__proto__&show=x&view=1&x=1e9&zoom=NaN&pins=a.b_9999.3&stops=%F0&gamma=-1")?;
    equals(browser, "document.querySelector('#left').value + document.querySelector('#right').value", "01")?;
    equals(browser, "document.querySelectorAll('#insets li').length", 0)?;
    shows(browser, 0.75, 1)
}

/// A picture that was saved is the one that the page holds.
fn saved(browser: &mut Browser) -> Outcome {
    let ramp = |x: u32, y: u32| [x as f32, y as f32, 1000.0 * x as f32];
    let made = with(vec![picture(SIZE, ramp, 1.0), picture(SIZE, |_, _| [1.0; 3], 1.0)], None);
    let _page = made.open(browser)?;
    browser.until(DRAWN)?;
    browser.evaluate(KEEP_SAVED)?;
    let base64 = "window.saved.arrayBuffer().then((buffer) => btoa(Array.from(new Uint8Array(buffer), (byte) => String.fromCharCode(byte)).join('')))";
    browser.evaluate("document.querySelector('#save-as').value = 'exr'")?;
    browser.click("#save-left")?;
    let bytes = STANDARD.decode(browser.evaluate(base64)?.as_str().unwrap_or_default())?;
    let file = Layers::from_exr(&bytes)?;
    let (found, held) = (file.rgb(PICTURE)?, made.pictures[0].rgb(PICTURE)?);
    let is_close = |(found, held): (&f32, &f32)| (found - held).abs() <= 0.001 * held;
    check((0..3).all(|channel| found[channel].iter().zip(held[channel]).all(is_close)), || "the light is another".into())?;
    browser.evaluate("document.querySelector('#save-as').value = 'png'")?;
    browser.click("#save-right")?;
    browser.until("window.saved.type === 'image/png'")?;
    let bytes = STANDARD.decode(browser.evaluate(base64)?.as_str().unwrap_or_default())?;
    check(image::load_from_memory(&bytes)?.into_rgb8().dimensions() == (SIZE[0], SIZE[1]), || "of another size".into())
}

/// A table that is wider than its frame shows that it goes on.
fn overflow(browser: &mut Browser) -> Outcome {
    browser.resize(PHONE, true)?;
    let _page = made(4).open(browser)?;
    let classes = "document.querySelector('#table').parentElement.className";
    equals(browser, classes, "scroller beyond")?;
    browser.evaluate("document.querySelector('#table').parentElement.scrollLeft = 1e6")?;
    browser.until(&format!("{classes} === 'scroller before'"))
}

fn glossy(browser: &mut Browser) -> Outcome {
    // A reference that knows of lobes says nothing of variants that do not.
    let lit = |light: f32, colour: [f32; 3]| {
        let pixels: Vec<f32> = (0..SIZE[0] * SIZE[1]).flat_map(|_| colour).collect();
        picture(SIZE, |_, _| [0.4; 3], light).with(GLOSSY, Layer::interleaved(&["R", "G", "B"], &pixels, 3))
    };
    let reference = Some(lit(1.0, [0.4; 3]));
    let options = "[...document.querySelectorAll('#layer option:enabled')].map((option) => option.value).join()";
    let _page = with(made(2).pictures, reference.clone()).open(browser)?;
    const PLAIN: &str = "shown picture,error picture,flip picture,difference picture,relative picture,shown irradiance,error irradiance,difference irradiance,relative irradiance";
    equals(browser, options, PLAIN)?;
    let _page = with(vec![lit(1.0, COLOURS[0]), lit(1.0, COLOURS[2])], reference).open(browser)?;
    equals(browser, options, format!("{PLAIN},shown glossy,error glossy,difference glossy,relative glossy"))?;
    (0..9).try_for_each(|_| browser.key("e"))?;
    equals(browser, "document.querySelector('#layer').value", "shown glossy")?;
    shows(browser, 0.25, 0)?;
    shows(browser, 0.75, 2)?;
    browser.key("]")?;
    equals(browser, "document.querySelector('#right-label').textContent", "Reference")?;
    equals(browser, "document.querySelector('#absent').hidden", true)?;
    browser.key("e")?;
    equals(browser, "document.querySelector('#scale-text').textContent.includes('mean glossy light')", true)?;
    equals(browser, "document.querySelector('#absent').textContent", "The reference has no error of its own")?;
    (0..3).try_for_each(|_| browser.key("e"))?;
    equals(browser, "document.querySelector('#layer').value", "shown picture")
}

fn no_reference(browser: &mut Browser) -> Outcome {
    let pictures = made(2).pictures;
    let _page = with(pictures, None).open(browser)?;
    let says = |browser: &mut Browser, selector: &str| {
        equals(browser, &format!("document.querySelector('{selector}').textContent.includes('o reference was given')"), true)
    };
    says(browser, "#plot")?;
    says(browser, "#table-note")?;
    says(browser, "#layer")?;
    equals(browser, "[...document.querySelectorAll('#layer option')].filter((option) => option.disabled).length", 2)?;
    browser.key("e")?;
    equals(browser, "document.querySelector('#layer').value", "difference picture")?;
    show(browser, "shown picture")?;
    shows(browser, 0.25, 0)
}

fn plot(browser: &mut Browser) -> Outcome {
    let _page = made(5).open(browser)?;
    equals(browser, "document.querySelectorAll('#plot .mark').length", 5)?;
    // The first is right and the fastest: nothing else is on the front.
    equals(browser, "[...document.querySelectorAll('#plot .ring')].map((ring) => ring.closest('.mark')?.dataset.id).join(' ').trim()", "A")?;
    browser.click("#plot .mark[data-variant='2'] .target")?;
    equals(browser, "document.querySelector('#right').value", "2")?;
    shows(browser, 0.75, 2)?;
    equals(browser, "document.querySelector('#stage').getBoundingClientRect().top < innerHeight", true)?;
    browser.evaluate("document.querySelector(\"#plot .mark[data-variant='3']\").focus()")?;
    browser.key("Enter")?;
    equals(browser, "document.querySelector('#right').value", "3")?;
    equals(browser, "document.activeElement.id", "stage")
}

fn cuts(browser: &mut Browser) -> Outcome {
    let mut made = made(2);
    let errors = made.comparison.variants[1].errors.clone();
    made.comparison.variants[0].cuts = [0.25, 0.5].map(|seconds| Cut { within_seconds: seconds, seconds, errors: errors.clone() }).into();
    let _page = made.open(browser)?;
    equals(browser, "document.querySelectorAll('#plot .mark').length", 4)?;
    equals(browser, "[...document.querySelectorAll('#plot [role=button]')].map(({ dataset }) => dataset.id).join()", "A,B")?;
    equals(browser, "document.querySelector('#plot .line').getAttribute('points').split(' ').length", 3)?;
    equals(browser, "document.querySelector('#plot .mark title').textContent.startsWith('A ended after 0.250 s, ')", true)?;
    equals(browser, "document.querySelector('#plot-note').textContent.includes('ended early')", true)
}

/// The same pipeline again: its mark lies below that of the first.
fn covered(browser: &mut Browser) -> Outcome {
    let mut made = made(3);
    made.comparison.variants[2] = VariantReport { id: "C".into(), ..made.comparison.variants[0].clone() };
    let _page = made.open(browser)?;
    browser.click("#plot .mark[data-variant='0'] text")?;
    equals(browser, "document.querySelector('#right').value", "0")?;
    browser.click("#plot .mark[data-variant='2'] text")?;
    equals(browser, "document.querySelector('#right').value", "2")
}

fn sweep(browser: &mut Browser) -> Outcome {
    let made = made(6);
    let mut swept = swept(&made);
    // The irradiance of the first is right, and it is the fastest; to look at, it is the worst.
    if let State::Measured(first) = &mut swept.points[0].outcome {
        first.errors.picture.as_mut().ok_or("no errors")?.flip = Some(0.9);
    }
    let report = swept_report(&made, swept);
    let _page = open(&page(&report, &made.gallery()?)?, browser)?;
    equals(browser, "document.querySelectorAll('#plot .mark').length", 6)?;
    equals(browser, "[...document.querySelectorAll('#plot polyline')].map((line) => line.getAttribute('points').split(' ').length).join()", "2,2,2")?;
    equals(browser, "document.querySelector('#metric').selectedOptions[0].textContent", "Picture, ꟻLIP")?;
    let mut points = report.sweep.points.clone();
    mark_front(&mut points, &"picture.flip".parse()?, &Cost::Seconds);
    let best: Vec<&str> = points.iter().filter(|point| point.pareto).map(|point| point.id.as_str()).collect();
    let ringed = "[...document.querySelectorAll('#plot .mark:has(.ring)')].map((mark) => mark.dataset.id).sort().join()";
    equals(browser, ringed, best.join(","))?;
    check(best.len() > 1, || format!("{best:?}"))?;
    choose(browser, "metric", "1")?;
    equals(browser, ringed, "A")?;
    browser.click("#plot .mark[data-id='F'] .target")?;
    equals(browser, "document.querySelector('#right').value", "5")?;
    equals(browser, "document.querySelector('#right-label').textContent", "F  cache.accuracy=0.2 tiles.resolution=128")?;
    shows(browser, 0.75, 2)?;
    // Values are sorted as numbers.
    browser.click("#table th:nth-child(3) button")?;
    equals(browser, "[...document.querySelectorAll('#table .open')].map((button) => button.textContent).join('')", "ADBECF")?;
    equals(browser, "document.querySelector('#pairs').checkVisibility()", false)
}

fn refused(browser: &mut Browser) -> Outcome {
    let made = made(6);
    let mut sweep = swept(&made);
    sweep.points[1].outcome = State::Refused { because: "plan::tile: too large".into() };
    let mut gallery = Gallery::new(made.comparison.size, 7);
    for (index, picture) in made.pictures.iter().enumerate() {
        if index == 1 { gallery.skip() } else { gallery.add(picture, made.reference.as_ref())? }
    }
    gallery.end_frame(None, made.reference.as_ref())?;
    let _page = open(&page(&swept_report(&made, sweep), &gallery)?, browser)?;
    equals(browser, "document.querySelectorAll('#plot .mark').length", 5)?;
    equals(browser, "document.querySelector('#plot-note').textContent.endsWith('not known: B.')", true)?;
    equals(browser, "document.querySelector('#table').textContent.includes('refused: plan::tile: too large')", true)?;
    equals(browser, "document.querySelector('#absent').textContent", "B  cache.accuracy=0.1 tiles.resolution=16 was refused")?;
    shows(browser, 0.25, 0)?;
    // None of them has a picture.
    let mut sweep = swept(&made);
    sweep.points.iter_mut().for_each(|point| point.outcome = State::Refused { because: "plan::tile: too large".into() });
    let mut gallery = Gallery::new(made.comparison.size, 7);
    (0..6).for_each(|_| gallery.skip());
    gallery.end_frame(None, made.reference.as_ref())?;
    let _page = open(&page(&swept_report(&made, sweep), &gallery)?, browser)?;
    browser.until(DRAWN)?;
    equals(browser, "document.querySelector('#absent').textContent.includes('was refused')", true)?;
    browser.key("f")?;
    browser.key("p")?;
    choose(browser, "right", "6")?;
    close(browser, 0.5, 118)
}

/// So many pictures that each is half as wide and high: the same is to be seen at the same place, also where blocks reach beyond the border.
fn blocks(browser: &mut Browser) -> Outcome {
    const ODD: [u32; 2] = [97, 73];
    let halves = picture(ODD, |x, _| COLOURS[if x < 49 { 0 } else { 1 }], 1.0);
    let mut gallery = Gallery::new(ODD, (1 << 24) / 2000);
    (0..2).try_for_each(|_| gallery.add(&halves, None))?;
    gallery.end_frame(None, None)?;
    let made = with(vec![halves.clone(), halves], None);
    let html = page(&made.report(), &gallery)?;
    check(html.contains("\"width\":49,\"height\":37,\"block\":2"), || "the pictures are whole".into())?;
    let _page = open(&html, browser)?;
    for (share, channel) in [(0.05, 0), (0.48, 0), (0.53, 1), (0.97, 1)] {
        shows(browser, share, channel)?;
    }
    equals(browser, "document.querySelector('#lossless').textContent.includes('means of 2×2 pixels')", true)
}

fn table(browser: &mut Browser) -> Outcome {
    let _page = made(4).open(browser)?;
    let letters = "[...document.querySelectorAll('#table .open')].map((button) => button.textContent).join('')";
    let order = "document.querySelector('#table th:nth-child(3)').ariaSort";
    equals(browser, letters, "ABCD")?;
    browser.click("#table th:nth-child(3) button")?;
    equals(browser, order, "ascending")?;
    browser.key("Enter")?;
    equals(browser, order, "descending")?;
    equals(browser, letters, "DCBA")?;
    browser.click("#table th:nth-child(6) button")?;
    equals(browser, letters, "DCBA")?;
    equals(browser, order, "none")?;
    equals(browser, "document.querySelector('#table tbody tr:last-child td:nth-child(3)').textContent", "1.04")?;
    browser.click("#table tbody tr:first-child .open")?;
    equals(browser, "document.querySelector('#right').value", "3")
}

fn texts(browser: &mut Browser) -> Outcome {
    let _page = made(3).open(browser)?;
    let lines = |class: &str| format!("[...document.querySelectorAll('#text .{class}')].map((line) => line.textContent.trim()).join('|')");
    equals(browser, &lines("removed"), "-         resolution: 8,")?;
    equals(browser, &lines("added"), "+         resolution: 16,")?;
    browser.click("#text-as label:last-of-type span")?;
    equals(browser, "document.querySelectorAll('#text .added').length", 0)?;
    equals(browser, "document.querySelector('#text').textContent.includes('resolution: 16')", true)?;
    equals(browser, "document.querySelectorAll('#pairs li').length", 3)?;
    equals(browser, "document.querySelector('#pairs li.significant').textContent", "B differs from A")?;
    equals(browser, "document.querySelectorAll('.part').length", 9)
}

fn expectations(browser: &mut Browser) -> Outcome {
    let made = made(2);
    let found = |as_expected: Option<bool>, verdict: Option<Verdict>| Found {
        row: "A".into(),
        at: BTreeMap::new(),
        of: "seconds".into(),
        over: None,
        is_share: false,
        value: as_expected.map(|_| 1.0),
        interval: None,
        within: [0.5, 2.0],
        as_expected,
        paper: None,
        verdict,
    };
    let mut report = made.report();
    report.sweep.expected = vec![found(Some(true), Some(Verdict::Better)), found(Some(false), None), found(None, None)];
    let row = |name: &str| ["what", name].map(str::to_owned).to_vec();
    report.expectations = [["what", "verdict"].map(str::to_owned).to_vec(), row("better"), row("<i>no</i>"), row("-")].to_vec();
    let _page = open(&page(&report, &made.gallery()?)?, browser)?;
    let classes = "[...document.querySelectorAll('#expected tbody tr')].map((row) => row.className).join('|')";
    equals(browser, classes, "came|missed|")?;
    equals(browser, "document.querySelector('#expected .missed td:last-child').textContent", "<i>no</i>")?;
    equals(browser, "document.querySelector('#expected thead').textContent", "whatverdict")?;
    equals(browser, "document.querySelector('#expected-note').textContent.startsWith('1 of 3 did not come.')", true)?;
    let _other = made.open(browser)?;
    equals(browser, "document.querySelector('#expected').closest('section').hidden", true)
}

fn hostile_names(browser: &mut Browser) -> Outcome {
    const NAME: &str = "</script><script>window.hit = 1</script><img src=x onerror='window.hit = 1'>&amp;<!--";
    let mut made = made(2);
    made.comparison.scene = NAME.into();
    made.comparison.camera = NAME.into();
    made.comparison.variants[1].name = NAME.into();
    made.comparison.variants[1].passes[0].node = NAME.into();
    made.comparison.variants[1].set = vec![NAME.into()];
    made.pipelines = vec![NAME.into(); 2];
    let mut report = made.report();
    report.warnings = vec![NAME.into()];
    if let Some(differences) = &mut report.differences {
        differences.hint = Some(NAME.into());
        differences.pairs[0].words = NAME.into();
    }
    let _page = open(&page(&report, &made.gallery()?)?, browser)?;
    shows(browser, 0.75, 1)?;
    equals(browser, "window.hit === undefined && document.images.length === 0 && document.scripts.length === 2", true)?;
    equals(browser, "document.title", format!("{NAME}: 2 pipelines compared"))?;
    equals(browser, "document.querySelector('h1').textContent", format!("{NAME}: 2 pipelines compared"))?;
    equals(browser, "document.querySelector('#warnings').textContent", NAME)?;
    equals(browser, "document.querySelector('#right-label').textContent", format!("B  {NAME}"))
}

const PHONE: [u32; 2] = [390, 844];

fn fingers(browser: &mut Browser) -> Outcome {
    browser.resize(PHONE, true)?;
    let _page = made(2).open(browser)?;
    let [from, to] = [on_stage(browser, 0.4)?, on_stage(browser, 0.85)?];
    browser.touch(&[[from, to]])?;
    equals(browser, "document.querySelector('#slider').ariaValueNow", "85")?;
    shows(browser, 0.75, 0)?;
    let scale =
        |browser: &mut Browser| -> Result<f64, Failed> { Ok(browser.evaluate("parseFloat(document.querySelector('#zoom').value)")?.as_f64().unwrap_or(0.0)) };
    let before = scale(browser)?;
    let [x, y] = on_stage(browser, 0.5)?;
    browser.touch(&[[[x - 20.0, y], [x - 80.0, y]], [[x + 20.0, y], [x + 80.0, y]]])?;
    let after = scale(browser)?;
    check((after / before - 4.0).abs() < 0.1, || format!("{before} % before, {after} % after"))?;
    // Zoomed, a finger moves the picture and leaves the slider.
    browser.touch(&[[[x - 60.0, y], [x - 20.0, y]]])?;
    equals(browser, "document.querySelector('#slider').ariaValueNow", "85")
}

fn sizes(browser: &mut Browser) -> Outcome {
    for variants in [1, 2, 20] {
        let _page = made(variants).open(browser)?;
        equals(browser, "document.querySelectorAll('#table tbody tr').length", variants)?;
        for (size, mobile) in [(WINDOW, false), (PHONE, true)] {
            browser.resize(size, mobile)?;
            browser.evaluate("scrollTo(0, 0)")?;
            equals(browser, "document.documentElement.scrollWidth", size[0])?;
            shows(browser, 0.25, 0)?;
            for (scheme, bright) in [("light", true), ("dark", false)] {
                browser.prefer(scheme)?;
                browser.evaluate("scrollTo(0, 0)")?;
                let corner = browser.screenshot()?.get_pixel(3, 3).0;
                check((corner[0] > 128) == bright, || format!("{scheme}: {corner:?}"))?;
            }
        }
        browser.resize(WINDOW, false)?;
    }
    Ok(())
}

fn narrow(browser: &mut Browser) -> Outcome {
    browser.resize(PHONE, true)?;
    let made = made(6);
    let _page = open(&page(&swept_report(&made, swept(&made)), &made.gallery()?)?, browser)?;
    equals(browser, "document.documentElement.scrollWidth", PHONE[0])?;
    // Letters as large as those around the plot.
    equals(browser, "document.querySelector('#plot text:not(.title)').getBoundingClientRect().height > 11", true)?;
    let texts = "[...document.querySelectorAll('#plot text')].map((text) => text.getBoundingClientRect())";
    equals(browser, &format!("{texts}.every((box) => box.left >= 0 && box.right <= innerWidth)"), true)
}

fn heavy(browser: &mut Browser) -> Outcome {
    const LARGE: [u32; 2] = [1000, 1000];
    let pictures: Vec<_> = (0..10).map(|index| textured(LARGE, index, 0.0)).collect();
    let truth = textured(LARGE, 0, 0.06);
    // Their errors are of no interest here, and take a minute to tell.
    let made = Made { reference: Some(truth), ..with(pictures, None) };
    let html = made.html()?;
    check(html.len() < 15 << 20, || format!("{} bytes", html.len()))?;
    let start = Instant::now();
    let _page = open(&html, browser)?;
    browser.until(DRAWN)?;
    let seconds = start.elapsed().as_secs_f64();
    println!("ten pictures of 1000×1000: {:.1} MiB, drawn after {seconds:.2} s", html.len() as f64 / f64::from(1 << 20));
    check(seconds < 2.0, || format!("drawn after {seconds:.2} s"))?;
    check(html.contains("\"from_first\":true"), || "no picture is kept as a difference".into())?;
    // So much noise is shown as means. What is rendered has less, and a few pictures are whole.
    let two = Made { reference: None, ..with(made.pictures[..2].to_vec(), None) };
    let _page = two.open(browser)?;
    exact(browser, &two)
}

/// Four times as many pictures weigh no more than ten do: they are shown as means of blocks.
fn many(browser: &mut Browser) -> Outcome {
    const LARGE: [u32; 2] = [1000, 1000];
    const POINTS: u32 = 40;
    let truth = textured(LARGE, 0, 0.06);
    let mut gallery = Gallery::new(LARGE, POINTS as usize + 1);
    (0..POINTS).try_for_each(|index| gallery.add(&textured(LARGE, index, 0.0), Some(&truth)))?;
    gallery.end_frame(None, Some(&truth))?;
    let mut made = made(POINTS as usize);
    made.comparison.size = LARGE;
    let html = page(&made.report(), &gallery)?;
    println!("forty pictures of 1000×1000: {:.1} MiB", html.len() as f64 / f64::from(1 << 20));
    check(html.len() < 15 << 20, || format!("{} bytes", html.len()))?;
    let _page = open(&html, browser)?;
    browser.until(DRAWN)?;
    equals(browser, "document.querySelector('#lossless').textContent.includes('means of 4×4 pixels')", true)
}

/// What the pointer reads of both sides is what the pictures hold, to the digits that the page tells.
fn exact(browser: &mut Browser, made: &Made) -> Outcome {
    let text = readout(browser, 0.3)?;
    let numbers: Vec<f32> = text.split([' ', ',']).filter_map(|number| number.parse().ok()).collect();
    let told = browser.evaluate("document.querySelector('#lossless').textContent")?;
    let within: f32 = told.as_str().and_then(|told| told.split("right to ").nth(1)?.split(' ').next()?.parse().ok()).ok_or("no precision is told")?;
    let at = numbers[1] as usize * made.comparison.size[0] as usize + numbers[0] as usize;
    let held = made.pictures[..2].iter().map(|picture| Ok(picture.rgb(PICTURE)?.map(|plane| plane[at])));
    let expected = held.collect::<Result<Vec<_>, Failed>>()?.concat();
    let is_close = |(found, held): (&f32, &f32)| (found / held - 1.0).abs() <= 0.0105 * within;
    println!("right to {within} %: {text}");
    check(numbers[2..].len() == 6 && numbers[2..].iter().zip(&expected).all(is_close) && within < 1.0, || format!("{text} for {expected:?}"))
}

fn tracked() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots/page.png")
}

/// The window in blocks so large that fonts hardly matter.
fn looks(browser: &mut Browser) -> Outcome {
    const BLOCKS: [u32; 2] = [50, 45];
    let _page = made(4).open(browser)?;
    shows(browser, 0.75, 1)?;
    browser.evaluate("scrollTo(0, 0)")?;
    let now = image::imageops::resize(&browser.screenshot()?, BLOCKS[0], BLOCKS[1], image::imageops::FilterType::Triangle);
    if env::var_os("HEMISPLAT_UPDATE_GOLDEN").is_some() {
        return Ok(now.save(tracked())?);
    }
    let then = image::open(tracked())?.into_rgb8();
    let apart = apart(&now, &then);
    check(then.dimensions() == now.dimensions() && apart < 6.0, || format!("the page is {apart:.1} of 255 from the tracked one"))
}

/// Mean difference of the channels, of 255.
fn apart(a: &RgbImage, b: &RgbImage) -> f64 {
    let sum: f64 = a.iter().zip(b.iter()).map(|(a, b)| f64::from(a.abs_diff(*b))).sum();
    sum / a.len() as f64
}
