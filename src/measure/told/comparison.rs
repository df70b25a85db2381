//! A comparison as text, as CSV, and as a report for its page.

use crate::measure::compare::{Comparison, ErrorPair, GivenPicture, Pair, PairError, PassSpread, VariantErrors, VariantReport, WORTH_FINDING};
use crate::measure::course::Course;
use crate::measure::criteria::Cost;
use crate::measure::gap::Gap;
use crate::measure::metrics::{Errors, Told as InWords, block_side};
use crate::measure::page::{Beside, Differences, ErrorsTold, Report, Told};
use crate::measure::statistics::{Spread, least_runs};
use std::fmt::Write;

/// Up to so many variants every pair is told; of more, those with the first.
const FEW: usize = 4;

/// Variants beside each other in a table of nodes.
const COLUMNS: usize = 4;

/// Noise of the reference's blocks that no error of interest hides behind.
const BLOCK_NOISE: f64 = 0.003;

/// The report for people.
pub fn text(comparison: &Comparison) -> String {
    let tables = [headline, costs, errors, in_time, error_parts, cuts, nodes, differences];
    tables.map(|table| table(comparison)).concat()
}

/// What a reader must know before trusting the numbers.
pub fn warnings(comparison: &Comparison) -> Vec<String> {
    let mut warnings: Vec<String> = comparison.approximated().iter().map(|what| format!("note: {what}")).collect();
    for variant in &comparison.variants {
        if !variant.complete {
            let gap = Gap::of(variant.uncovered_pixels, None, &variant.unfinished);
            warnings.push(format!("warning: {} {}: {}; its times are those of unfinished pictures", variant.id, variant.name, gap.what));
        }
        if !variant.pictures_repeat {
            warnings.push(format!("warning: {} {}: its runs did not make the same picture to the bit", variant.id, variant.name));
        }
    }
    warnings.extend(noisy_blocks(comparison));
    let timed = comparison.pictures.iter().filter(|picture| picture.given.seconds.is_some());
    warnings.extend(timed.map(|picture| format!("note: {} {}: its time is as stated, not measured here", picture.id, picture.name)));
    let unstated = comparison.pictures.iter().filter(|picture| picture.given.bounces.is_none());
    warnings
        .extend(unstated.map(|picture| format!("note: {} {}: {} does not say of how many bounces its light is", picture.id, picture.name, picture.given.file)));
    warnings
}

/// What the page shows; `pipelines` are the texts of the variants.
pub fn report(comparison: &Comparison, pipelines: Vec<String>) -> Report {
    let beside = |(variant, text): (&VariantReport, String)| {
        let start_up = &variant.start_up;
        let seconds = start_up.plan_seconds + start_up.shaders_seconds + start_up.warm_up_seconds;
        Beside { text, dropped: variant.dropped.clone(), start_up_seconds: Some(seconds) }
    };
    let of_pictures = comparison.pictures.iter().map(|_| Beside::default());
    let beside = comparison.variants.iter().zip(pipelines).map(beside).chain(of_pictures).collect();
    let told = |pair: &Pair| Told { words: sentences(pair, comparison), pair: pair.clone() };
    let errors_told = |pair: &ErrorPair| ErrorsTold {
        first: pair.first.clone(),
        second: pair.second.clone(),
        significant: pair.error.difference.significant,
        words: of_error_pair(pair),
    };
    let errors = comparison.error_pairs.iter().map(errors_told).collect();
    let differences = Differences { pairs: comparison.pairs.iter().map(told).collect(), errors, hint: hint(comparison) };
    let pipelines = match comparison.variants.len() {
        1 => "one pipeline".to_owned(),
        variants => format!("{variants} pipelines"),
    };
    let pictures = match comparison.pictures.len() {
        0 => String::new(),
        1 => " and a picture".to_owned(),
        pictures => format!(" and {pictures} pictures"),
    };
    let done = if comparison.judged().len() == 1 { "measured" } else { "compared" };
    let title = format!("{}: {pipelines}{pictures} {done}", comparison.scene);
    let mut report = Report::new(title, comparison.into(), &comparison.metric(), &Cost::Seconds, beside);
    report.runs_asked = comparison.runs_asked;
    report.warnings = warnings(comparison);
    report.differences = Some(differences);
    report
}

/// Blocks are not corrected for the reference's noise: it must be small beside what they show.
fn noisy_blocks(comparison: &Comparison) -> Option<String> {
    let errors = comparison.judged().into_iter().find_map(|(_, _, errors)| errors.irradiance.as_ref())?;
    let noise = errors.reference_noise_over_mean? / f64::from(block_side(comparison.size.map(|side| side / errors.stride)));
    let samples = comparison.reference.as_ref().and_then(|reference| reference.samples.as_ref()?.parse::<f64>().ok());
    let cure =
        samples.map_or(String::new(), |samples| format!("; {:.0} rays a pixel would leave {}", samples * (noise / BLOCK_NOISE).powi(2), percent(BLOCK_NOISE)));
    (noise > BLOCK_NOISE).then(|| format!("note: block_p50 and block_p99 hold about {} of the reference's own noise{cure}", percent(noise)))
}

fn headline(comparison: &Comparison) -> String {
    let [width, height] = comparison.size;
    let runs = match comparison.runs {
        1 => "1 run".to_owned(),
        runs => format!("{runs} runs"),
    };
    let asked = if comparison.runs == comparison.runs_asked { String::new() } else { format!(" of {} asked for", comparison.runs_asked) };
    let frames = frames(comparison).map_or(String::new(), |[first, last]| format!(", frames {first} to {last}"));
    format!("{}, camera {}, {width}×{height}{frames}, {}: {runs} of each{asked}\n", comparison.scene, comparison.camera, comparison.adapter.name)
}

/// The first and the last frame of a sequence.
fn frames(comparison: &Comparison) -> Option<[u32; 2]> {
    let frames = &comparison.variants.first()?.frames;
    Some([frames.first()?.frame, frames.last()?.frame])
}

/// The width of the longest name.
fn name_width(comparison: &Comparison) -> usize {
    comparison.judged().iter().map(|(_, name, _)| name.chars().count()).max().unwrap_or(0).max("pipeline".len())
}

fn costs(comparison: &Comparison) -> String {
    let width = name_width(comparison);
    let mut text = format!(
        "\n{:<3} {:<width$} {:>9} {:>21} {:>8} {:>9} {:>10} {:>10}\n",
        "", "pipeline", "seconds", "quartiles", "records", "uncovered", "device MiB", "start-up s"
    );
    for variant in &comparison.variants {
        let start_up = &variant.start_up;
        let _ = writeln!(
            text,
            "{:<3} {:<width$} {:>9} {:>21} {:>8} {:>9} {:>10.1} {:>10.2}",
            variant.id,
            variant.name,
            significant(variant.seconds.median),
            format!("{} … {}", significant(variant.seconds.lower_quartile), significant(variant.seconds.upper_quartile)),
            count(variant.records.irradiance),
            count(variant.uncovered_pixels),
            variant.peak_gpu_bytes as f64 / f64::from(1 << 20),
            start_up.plan_seconds + start_up.shaders_seconds + start_up.warm_up_seconds,
        );
    }
    for GivenPicture { id, name, given } in &comparison.pictures {
        let (seconds, how) = given.seconds.map_or(("-".to_owned(), ""), |seconds| (significant(seconds), "as stated"));
        let _ = writeln!(text, "{}", format!("{id:<3} {name:<width$} {seconds:>9} {how:>21}").trim_end());
    }
    text
}

/// Layers with the metrics that the table tells of each, in its order.
const TOLD: [(&str, &[&str]); 4] = [
    ("irradiance", &SHARES),
    ("picture", &["rmse_over_mean", "band_error", "rmse_edges", "rmse_interior", "flip", "hdr_flip"]),
    ("glossy", &SHARES),
    ("direct", &SHARES),
];

const SHARES: [&str; 8] = ["rmse_over_mean", "bias_over_mean", "rms_of_relative", "block_p50", "block_p99", "band_error", "rmse_edges", "rmse_interior"];

fn errors(comparison: &Comparison) -> String {
    let Some(reference) = &comparison.reference else { return String::new() };
    let mut text = format!("\nagainst {}", reference.file.as_deref().unwrap_or("the reference"));
    let judged = comparison.judged();
    if let Some(noise) = judged.iter().find_map(|(_, _, errors)| errors.irradiance.as_ref()?.reference_noise_over_mean) {
        let _ = write!(text, ", noise of its irradiance {:.2} % (taken off)", 100.0 * noise);
    }
    if let Some([_, last]) = frames(comparison) {
        let _ = write!(text, "; of frame {last}");
    }
    text.push_str("; in brackets 95 % intervals\n");
    text + &judged.chunks(COLUMNS).map(errors_of).collect::<Vec<_>>().join("\n")
}

/// How the variants of a sequence differ from the truth in time.
fn in_time(comparison: &Comparison) -> String {
    comparison.variants.chunks(COLUMNS).map(in_time_of).collect()
}

type OfCourse = fn(&Course) -> Option<String>;

/// What the table in time tells of a layer: the words, and what stands beside them.
const IN_TIME: [(&str, OfCourse); 8] = [
    ("rmse_over_mean, mean", |course| course.mean.rmse_over_mean.map(percent)),
    ("bias_over_mean, mean", |course| course.mean.bias_over_mean.map(percent)),
    ("block_p50, mean", |course| course.mean.block_p50.map(percent)),
    ("block_p99, mean", |course| course.mean.block_p99.map(percent)),
    ("flicker", |course| course.flicker.map(percent)),
    ("lag_p50", |course| lag(course, course.lag_p50)),
    ("lag_p99", |course| lag(course, course.lag_p99)),
    ("ghost_p99", |course| course.ghost_p99.map(percent)),
];

/// Frames after a jump, where there was one.
pub(super) fn lag(course: &Course, lag: Option<f64>) -> Option<String> {
    (course.jumps > 0).then(|| lag.map_or("not settled".to_owned(), |lag| format!("{lag} of {} jumps", course.jumps)))
}

fn in_time_of(variants: &[VariantReport]) -> String {
    let frames = variants.first().map_or(0, |variant| variant.frames.len());
    if frames == 0 {
        return String::new();
    }
    let head: String = variants.iter().map(|variant| format!(" {:>27}", variant.id)).collect();
    let mut text = format!("\n{:<27}{head}\n", format!("over {frames} frames"));
    let mut row = |name: String, cells: Vec<Option<String>>| {
        if cells.iter().any(Option::is_some) {
            let cells: String = cells.into_iter().map(|cell| format!(" {:>27}", cell.unwrap_or("-".to_owned()))).collect();
            let _ = writeln!(text, "{name:<27}{cells}");
        }
    };
    let median = |variant: &VariantReport| Spread::of(&variant.frames.iter().map(|frame| frame.seconds.median).collect::<Vec<_>>());
    row("seconds of a frame, median".to_owned(), variants.iter().map(|variant| Some(significant(median(variant)?.median))).collect());
    row("new records".to_owned(), variants.iter().map(|variant| variant.new_records.map(|records| records.to_string())).collect());
    for (layer, _) in TOLD {
        for (name, told) in IN_TIME {
            row(format!("{layer} {name}"), variants.iter().map(|variant| variant.courses.get(layer).and_then(told)).collect());
        }
    }
    text
}

/// What the bounces that variants leave out have of their errors.
fn error_parts(comparison: &Comparison) -> String {
    let mut text = String::new();
    for variant in &comparison.variants {
        let Some(parts) = &variant.error_parts else { continue };
        let bounces = if parts.bounces == "1" { "1 bounce".to_owned() } else { format!("{} bounces", parts.bounces) };
        let _ = writeln!(text, "\n{} makes {bounces}; its errors in two parts", variant.id);
        let head = format!("{:<27} {:>27} {:>27}", "", "light left out", format!("method, against {bounces}"));
        let _ = writeln!(text, "{head}");
        for (layer, metric) in
            [("irradiance", "rmse_over_mean"), ("irradiance", "bias_over_mean"), ("picture", "rmse_over_mean"), ("picture", "bias_over_mean")]
        {
            text.push_str(&metric_row(&[&parts.left_out, &parts.method].map(|errors| errors.layer(layer)), layer, metric));
        }
    }
    text
}

/// What runs have that were ended early, by the error that the comparison is judged by.
fn cuts(comparison: &Comparison) -> String {
    let metric = comparison.metric();
    let told = |errors: &VariantErrors| metric.told(errors).map_or("-".to_owned(), |told| told.sentence());
    let rows = |variant: &VariantReport| {
        let whole = (variant.seconds.median, "whole".to_owned(), &variant.errors);
        let cuts = variant.cuts.iter().map(|cut| (cut.seconds, format!("within {}", significant(cut.within_seconds)), &cut.errors));
        let row =
            |(seconds, how, errors): (f64, String, &VariantErrors)| format!("{:<3} {:>9} {how:>16} {:>27}\n", variant.id, significant(seconds), told(errors));
        cuts.chain([whole]).map(row).collect::<String>()
    };
    let table: String = comparison.variants.iter().filter(|variant| !variant.cuts.is_empty()).map(rows).collect();
    if table.is_empty() { table } else { format!("\n{:<3} {:>9} {:>16} {:>27}\n{table}", "", "seconds", "ended", metric.to_string()) }
}

/// Of what [`Comparison::judged`] tells.
fn errors_of(judged: &[(&str, &str, &VariantErrors)]) -> String {
    let head: String = judged.iter().map(|(id, _, _)| format!(" {id:>27}")).collect();
    let mut text = format!("{:<27}{head}\n", "");
    for (layer, metrics) in TOLD {
        let errors: Vec<Option<&Errors>> = judged.iter().map(|(_, _, errors)| errors.layer(layer)).collect();
        for metric in metrics {
            text.push_str(&metric_row(&errors, layer, metric));
        }
    }
    text
}

/// A metric of several errors of a layer beside each other; nothing where none has it.
fn metric_row(errors: &[Option<&Errors>], layer: &str, metric: &str) -> String {
    let told: Vec<Option<InWords>> = errors.iter().map(|errors| errors.and_then(|errors| errors.told(metric, 2))).collect();
    if told.iter().all(Option::is_none) {
        return String::new();
    }
    let cells: String = told.into_iter().map(|told| format!(" {:>27}", told.map_or("-".to_owned(), |told| told.sentence()))).collect();
    format!("{:<27}{cells}\n", format!("{layer} {metric}"))
}

fn metric(errors: Option<&Errors>, name: &str) -> Option<f64> {
    errors.and_then(|errors| errors.metric(name)).flatten()
}

/// What a viewer sees.
const SEEN: [&str; 2] = ["flip", "hdr_flip"];

/// Who tells that: the picture's errors, or the irradiance's where that is all there is.
fn seen(errors: &VariantErrors) -> Option<&Errors> {
    errors.picture.as_ref().or(errors.irradiance.as_ref())
}

/// Names of nodes with their passes, each once, as the variants run them.
fn node_names(variants: &[VariantReport]) -> Vec<(&str, &'static str)> {
    let mut names: Vec<(&str, &'static str)> = Vec::new();
    for pass in variants.iter().flat_map(|variant| &variant.passes) {
        if !names.contains(&(pass.node.as_str(), pass.pass)) {
            names.push((&pass.node, pass.pass));
        }
    }
    names
}

fn pass_of<'v>(variant: &'v VariantReport, (node, pass): (&str, &str)) -> Option<&'v PassSpread> {
    variant.passes.iter().find(|found| found.node == node && found.pass == pass)
}

fn nodes(comparison: &Comparison) -> String {
    let names = node_names(&comparison.variants);
    comparison.variants.chunks(COLUMNS).map(|variants| nodes_of(variants, &names)).collect()
}

fn nodes_of(variants: &[VariantReport], names: &[(&str, &str)]) -> String {
    let mut text = format!("\n{:<14} {:<16}", "node", "pass");
    variants.iter().for_each(|variant| text += &format!(" {:>21}", format!("{} device + host ms", variant.id)));
    text.push('\n');
    for name in names {
        let passes: Vec<Option<&PassSpread>> = variants.iter().map(|variant| pass_of(variant, *name)).collect();
        if passes.iter().all(Option::is_none) {
            continue;
        }
        text += &format!("{:<14} {:<16}", name.0, name.1);
        passes.iter().for_each(|pass| text += &format!(" {:>21}", pass.map_or(String::new(), times)));
        text.push('\n');
    }
    text
}

fn times(pass: &PassSpread) -> String {
    let milliseconds = |spread: Option<Spread>| spread.map_or("-".to_owned(), |spread| format!("{:.2}", spread.median));
    format!("{} + {:>7}", milliseconds(pass.gpu_ms), milliseconds(pass.cpu_ms))
}

fn differences(comparison: &Comparison) -> String {
    let (judged, first) = (comparison.judged(), comparison.variants.first().map_or("", |variant| &variant.id));
    let is_told = |pair_first: &str| judged.len() <= FEW || pair_first == first;
    let of_variants = comparison.pairs.iter().filter(|pair| is_told(&pair.first)).map(|pair| sentences(pair, comparison));
    let of_pictures = comparison.error_pairs.iter().filter(|pair| is_told(&pair.first)).map(of_error_pair);
    let told: Vec<String> = of_variants.chain(of_pictures).chain(hint(comparison)).collect();
    if told.is_empty() { String::new() } else { format!("\n{}\n", told.join("\n")) }
}

/// One pair in words: its times, then its errors.
fn sentences(pair: &Pair, comparison: &Comparison) -> String {
    let times = sentence(pair, comparison.runs, comparison.pairs.len());
    pair.error.as_ref().map_or(times.clone(), |error| format!("{times}; {}", sentence_of_errors([&pair.first, &pair.second], error)))
}

/// One pair of which errors alone are known, in words.
fn of_error_pair(ErrorPair { first, second, error }: &ErrorPair) -> String {
    let names = if error.difference.significant { String::new() } else { format!("{second} and {first}: ") };
    names + &sentence_of_errors([first, second], error)
}

/// How the errors of a pair differ, the variant with the larger one first.
fn sentence_of_errors([first, second]: [&str; 2], PairError { metric, is_share, difference }: &PairError) -> String {
    let (factor, unit) = if *is_share { (100.0, " %") } else { (1.0, "") };
    let told = |value: f64| format!("{}{unit}", significant(factor * value));
    let [low, high] = difference.interval;
    if !difference.significant {
        return format!("{metric} does not differ by more than chance (±{})", told(low.abs().max(high.abs())));
    }
    let (more, less) = if difference.difference > 0.0 { (second, first) } else { (first, second) };
    let [low, high] = if difference.difference > 0.0 { [low, high] } else { [-high, -low] };
    let confidence = significant(100.0 * difference.confidence);
    let size = told(difference.difference.abs());
    format!("{metric} of {more} is larger than that of {less} by {size} ({} % interval {} … {})", confidence.trim_end_matches(".0"), told(low), told(high))
}

/// The times of one pair in words, the slower variant first.
fn sentence(pair: &Pair, runs: usize, comparisons: usize) -> String {
    let Pair { first, second, difference, .. } = pair;
    let Some([low, high]) = difference.ratio_interval else {
        let least = least_runs(comparisons);
        return format!("{second} and {first}: too few runs to tell a difference from noise, {runs} in place of {least} or more");
    };
    if !difference.significant {
        let noise = (high - 1.0).max(1.0 / low - 1.0).max(0.0);
        return format!("{second} and {first}: no difference larger than the noise (±{})", percent(noise));
    }
    let is_slower = difference.ratio > 1.0;
    let (slow, fast) = if is_slower { (second, first) } else { (first, second) };
    let [ratio, low, high] = if is_slower { [difference.ratio, low, high] } else { [difference.ratio, high, low].map(f64::recip) };
    let p = if difference.p_corrected < 1e-4 { "p < 0.0001".to_owned() } else { format!("p = {}", significant(difference.p_corrected)) };
    let certainty = format!("{p}, {} % interval", significant(100.0 * difference.confidence).trim_end_matches(".0"));
    if ratio < 2.0 {
        format!("{slow} is {} slower than {fast} ({certainty} {} … {})", percent(ratio - 1.0), percent(low - 1.0), percent(high - 1.0))
    } else {
        format!("{slow} takes {} times as long as {fast} ({certainty} {} … {})", significant(ratio), significant(low), significant(high))
    }
}

/// How many runs would settle what these leave open.
fn hint(comparison: &Comparison) -> Option<String> {
    let open = comparison.pairs.iter().filter(|pair| !pair.difference.significant);
    let runs = open.filter_map(|pair| pair.runs_to_find_5_percent).max().filter(|runs| *runs > comparison.runs)?;
    Some(format!("with noise like this, about {runs} runs find a difference of {} nine times of ten", percent(WORTH_FINDING)))
}

pub(super) fn percent(share: f64) -> String {
    format!("{} %", figures(100.0 * share, 2).trim_end_matches(".0"))
}

/// A number of three figures, or all before its point.
pub(super) fn significant(value: f64) -> String {
    figures(value, 3)
}

fn figures(value: f64, figures: i32) -> String {
    let digits = if value == 0.0 { 0 } else { (figures - 1 - value.abs().log10().floor() as i32).clamp(0, 6) };
    format!("{value:.0$}", digits as usize)
}

pub(super) fn count(number: Option<u32>) -> String {
    number.map_or("-".to_owned(), |number| number.to_string())
}

/// A row a variant, headed by names with units; a cell is empty where there is no number. As RFC 4180 has it, with lines that end as in Unix.
pub fn csv(comparison: &Comparison) -> String {
    let names = node_names(&comparison.variants);
    let mut rows: Vec<Vec<Cell>> = comparison.variants.iter().map(|variant| row(comparison, variant, &names)).collect();
    let head: Vec<String> = rows.first().map_or(Vec::new(), |row| row.iter().map(|(name, _)| name.clone()).collect());
    rows.extend(comparison.pictures.iter().map(|picture| row_of_picture(comparison, picture, &head)));
    std::iter::once(line(head.iter())).chain(rows.iter().map(|row| line(row.iter().map(|(_, value)| value)))).collect()
}

/// A row of these columns; those of times that are measured and of what pipelines hold are empty.
fn row_of_picture(comparison: &Comparison, picture: &GivenPicture, head: &[String]) -> Vec<Cell> {
    let mut known = vec![
        cell("id", Some(&picture.id)),
        cell("name", Some(&picture.name)),
        cell("scene", Some(&comparison.scene)),
        cell("camera", Some(&comparison.camera)),
        cell("width", Some(comparison.size[0])),
        cell("height", Some(comparison.size[1])),
        cell("seconds_median", picture.given.seconds),
    ];
    known.extend(of_errors(&picture.given.errors));
    head.iter().map(|name| known.iter().find(|(of, _)| of == name).cloned().unwrap_or_else(|| cell(name, None::<String>))).collect()
}

pub(super) fn line<'c>(cells: impl Iterator<Item = &'c String>) -> String {
    cells.map(|cell| quoted(cell)).collect::<Vec<_>>().join(",") + "\n"
}

fn quoted(cell: &str) -> String {
    if cell.contains([',', '"', '\n', '\r']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.to_owned() }
}

pub(super) type Cell = (String, String);

fn row(comparison: &Comparison, variant: &VariantReport, names: &[(&str, &str)]) -> Vec<Cell> {
    let mut cells = of_costs(comparison, variant);
    cells.extend(of_errors(&variant.errors));
    cells.extend(of_pair(comparison, variant));
    cells.extend(names.iter().flat_map(|name| of_node(*name, pass_of(variant, *name))));
    cells
}

pub(super) fn cell(name: impl Into<String>, value: Option<impl ToString>) -> Cell {
    (name.into(), value.map_or(String::new(), |value| value.to_string()))
}

fn of_costs(comparison: &Comparison, variant: &VariantReport) -> Vec<Cell> {
    let VariantReport { seconds, start_up, .. } = variant;
    vec![
        cell("id", Some(&variant.id)),
        cell("name", Some(&variant.name)),
        cell("pipeline", Some(&variant.pipeline)),
        cell("set", Some(variant.set.join(" "))),
        cell("scene", Some(&comparison.scene)),
        cell("camera", Some(&comparison.camera)),
        cell("width", Some(comparison.size[0])),
        cell("height", Some(comparison.size[1])),
        cell("adapter", Some(&comparison.adapter.name)),
        cell("runs", Some(comparison.runs)),
        cell("seconds_median", Some(seconds.median)),
        cell("seconds_lower_quartile", Some(seconds.lower_quartile)),
        cell("seconds_upper_quartile", Some(seconds.upper_quartile)),
        cell("seconds_least", Some(seconds.least)),
        cell("seconds_most", Some(seconds.most)),
        cell("plan_seconds", Some(start_up.plan_seconds)),
        cell("shaders_seconds", Some(start_up.shaders_seconds)),
        cell("warm_up_seconds", Some(start_up.warm_up_seconds)),
        cell("records", variant.records.irradiance),
        cell("fill_rounds", variant.fill_rounds),
        cell("uncovered_pixels", variant.uncovered_pixels),
        cell("complete", Some(variant.complete)),
        cell("pictures_repeat", Some(variant.pictures_repeat)),
        cell("peak_gpu_bytes", Some(variant.peak_gpu_bytes)),
    ]
}

pub(super) fn of_errors(judged: &VariantErrors) -> Vec<Cell> {
    let of = |layer: &'static str, errors: Option<&Errors>| {
        let metrics = Errors::METRICS.into_iter().filter(|name| !SEEN.contains(name));
        metrics.flat_map(move |name| certain(&format!("{layer}_{name}"), errors, name)).collect::<Vec<_>>()
    };
    let mut cells = of("irradiance", judged.irradiance.as_ref());
    cells.extend(of("picture", judged.picture.as_ref()));
    cells.extend(of("glossy", judged.glossy.as_ref()));
    cells.extend(of("direct", judged.direct.as_ref()));
    cells.extend(SEEN.into_iter().flat_map(|name| certain(name, seen(judged), name)));
    cells
}

/// A metric with its interval, and whether the reference's noise hides it.
fn certain(head: &str, errors: Option<&Errors>, name: &str) -> [Cell; 4] {
    let interval = errors.and_then(|errors| errors.interval(name));
    [
        cell(head, metric(errors, name)),
        cell(format!("{head}_low"), interval.map(|interval| interval.low)),
        cell(format!("{head}_high"), interval.map(|interval| interval.high)),
        cell(format!("{head}_below_noise"), interval.map(|interval| interval.below_noise)),
    ]
}

/// The difference from the first variant.
fn of_pair(comparison: &Comparison, variant: &VariantReport) -> Vec<Cell> {
    let first = comparison.variants.first().map(|first| &first.id);
    let pair = comparison.pairs.iter().find(|pair| Some(&pair.first) == first && pair.second == variant.id).map(|pair| &pair.difference);
    let bound = |index: usize| pair.and_then(|pair| pair.ratio_interval).map(|interval| interval[index]);
    vec![
        cell("seconds_over_first", pair.map(|pair| pair.ratio)),
        cell("seconds_over_first_low", bound(0)),
        cell("seconds_over_first_high", bound(1)),
        cell("p_corrected", pair.map(|pair| pair.p_corrected)),
        cell("significant", pair.map(|pair| pair.significant)),
    ]
}

fn of_node((node, _): (&str, &str), pass: Option<&PassSpread>) -> [Cell; 2] {
    let median = |spread: Option<Spread>| spread.map(|spread| spread.median);
    [cell(format!("{node}_gpu_ms"), pass.and_then(|pass| median(pass.gpu_ms))), cell(format!("{node}_cpu_ms"), pass.and_then(|pass| median(pass.cpu_ms)))]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_quoted_where_they_must_be() {
        let cells = ["a", "Plane(fov: 90, x: 1)", "say \"so\"", "1.5", ""].map(str::to_owned);
        assert_eq!(line(cells.iter()), "a,\"Plane(fov: 90, x: 1)\",\"say \"\"so\"\"\",1.5,\n");
    }

    #[test]
    fn numbers_show_three_figures() {
        assert_eq!([0.0123456, 0.5, 1.0, 12.345, 123.45, 12345.6, 0.0].map(significant), ["0.0123", "0.500", "1.00", "12.3", "123", "12346", "0"]);
    }

    fn pair(first: &[f64], second: &[f64]) -> String {
        let difference = crate::measure::statistics::Difference::between(first, second, 1).unwrap();
        let pair = Pair { first: "A".into(), second: "B".into(), test: "", difference, runs_to_find_5_percent: None, error: None };
        sentence(&pair, first.len(), 1)
    }

    #[test]
    fn differences_in_words() {
        let one = [1.0; 8];
        assert_eq!(pair(&one, &[1.5; 8]), "B is 50 % slower than A (p = 0.00781, 95 % interval 50 % … 50 %)");
        assert_eq!(pair(&[1.5; 8], &one), "A is 50 % slower than B (p = 0.00781, 95 % interval 50 % … 50 %)");
        assert_eq!(pair(&one, &[4.0; 8]), "B takes 4.00 times as long as A (p = 0.00781, 95 % interval 4.00 … 4.00)");
        assert_eq!(pair(&one, &[1.1, 0.9, 1.1, 0.9, 1.1, 0.9, 1.1, 0.9]), "B and A: no difference larger than the noise (±11 %)");
        assert_eq!(pair(&one[..5], &[2.0; 5]), "B and A: too few runs to tell a difference from noise, 5 in place of 6 or more");
    }
}
