//! `hemisplat diff`

use super::console::Console;
use super::failure::{CommandError, Failure};
use super::input::{NamedFile, read_picture};
use super::output::{Target, expect_distinct};
use super::render::{PIXEL_FILTER, PIXEL_SAMPLES};
use crate::math::bounces::Bounces;
use crate::measure::metrics::{Definition, Told, other_view};
use crate::measure::{Errors, IRRADIANCE, Layers, PICTURE, Selected, compare_layers};
use clap::Args;
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "Example: hemisplat diff out/cornell.exr out/cornell-reference.exr:irradiance --fail-above rmse_over_mean=0.05

Without a name, the layer `irradiance` is compared, or `picture` where one file lacks it. Where a file has one layer without a name, say what it is, or
name the other file's layer: hemisplat diff out.exr:irradiance truth.exr. --help defines each metric.";

/// What stands beside each metric.
const CERTAINTY: &str =
    "Each has a 95 % interval, from 1000 draws of the picture's blocks with the reference's noise in them; `< x` is an error that this noise hides.
rmse_over_mean and bias_over_mean are without that noise; where it is in a metric, the last column tells how much a picture without error would have.";

/// Tell how far a picture is from a reference
#[derive(Args)]
#[command(after_help = EXAMPLE, after_long_help = help())]
pub struct Options {
    /// The picture to judge, and which of its layers
    #[arg(value_name = "A.exr[:LAYER]")]
    test: String,
    /// The reference, which may hold every k-th pixel only
    #[arg(value_name = "B.exr[:LAYER]")]
    reference: String,
    /// The variance of the reference's pixels; the reference's own layer `variance` if not given
    #[arg(long, value_name = "FILE")]
    variance: Option<PathBuf>,
    /// Compare pictures that say that they show another scene, camera or light
    #[arg(long)]
    anyway: bool,
    /// The reference holds so many bounces, N or `all`, and the picture may hold others: what it leaves out counts as its error
    #[arg(long, value_name = "N")]
    bounces: Option<Bounces>,
    /// A reference of as many bounces as the picture has: the error is told in two parts, of the light left out and of the method
    #[arg(long, value_name = "C.exr[:LAYER]", requires = "bounces")]
    own: Option<String>,
    /// Write what was found as JSON; - is standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Fail with status 1 if a metric is larger, signed ones by their size, or may be larger than the reference's noise shows
    #[arg(long, value_name = "METRIC=VALUE", value_parser = threshold)]
    fail_above: Vec<Threshold>,
}

#[derive(Clone)]
struct Threshold {
    metric: String,
    limit: f64,
}

fn threshold(text: &str) -> Result<Threshold, String> {
    let (metric, limit) = text.split_once('=').ok_or("expected METRIC=VALUE")?;
    if !Errors::METRICS.contains(&metric) {
        return Err(format!("no metric `{metric}`; the metrics are {}", Errors::METRICS.join(", ")));
    }
    let limit = limit.parse().ok().filter(|limit: &f64| *limit >= 0.0 && limit.is_finite());
    Ok(Threshold { metric: metric.to_owned(), limit: limit.ok_or("the limit is a number, 0 or more")? })
}

pub fn run(options: &Options, console: &Console) -> Result<(), Failure> {
    let json = options.json.as_deref().map(Target::new).transpose()?;
    let (test, reference) = (Input::read(&options.test)?, Input::read(&options.reference)?);
    let own = options.own.as_deref().map(Input::read).transpose()?;
    let read: Vec<&Path> = [&test.file.path, &reference.file.path]
        .into_iter()
        .chain(own.iter().map(|own| &own.file.path))
        .chain(&options.variance)
        .map(PathBuf::as_path)
        .collect();
    expect_distinct(&options.json.iter().map(PathBuf::as_path).collect::<Vec<_>>(), &read)?;
    let variance = options.variance.as_deref().map(read_picture).transpose()?;
    let judged = |test: &Input, by: &Input, variance: Option<&Layers>| compared(test, by, variance, options.anyway);
    let method = own.as_ref().map(|own| judged(&test, own, None)).transpose()?;
    let left_out = own.map(|own| judged(&own.told_to_hold(options.bounces), &reference, None)).transpose()?;
    let parts = method.zip(left_out).map(|(method, left_out)| Parts { left_out, method });
    let test = test.told_to_hold(options.bounces);
    let errors = judged(&test, &reference, variance.as_ref())?;
    note_samples(&test.picture, &reference.picture, console);
    console.print(&(table(&test.file.path, &reference.file.path, &errors) + &parts.as_ref().map_or_else(String::new, Parts::table)))?;
    if let Some(json) = json {
        let [test, reference] = [&test, &reference].map(|input| input.file.path.display().to_string());
        json.write_json(&Comparison { test, reference, errors: &errors, parts: parts.as_ref() })?;
    }
    judge(&errors, &options.fail_above)
}

/// Pixels of several samples are not the same thing as pixels of one.
fn note_samples(test: &Layers, reference: &Layers, console: &Console) {
    let spread = |picture: &Layers| [PIXEL_SAMPLES, PIXEL_FILTER].map(|name| picture.attributes.get(name).cloned());
    let told = |[samples, filter]: [Option<String>; 2]| match samples {
        Some(samples) => format!("{samples} samples a pixel ({})", filter.unwrap_or_default()),
        None => "one sample a pixel".to_owned(),
    };
    let [own, other] = [test, reference].map(spread);
    if own != other {
        console.note(&format!("note: one picture has {}, the other {}: they differ at edges", told(own), told(other)));
    }
}

/// A picture file and the layer that the user named after it.
struct Input {
    file: NamedFile,
    picture: Layers,
}

impl Input {
    fn read(argument: &str) -> Result<Self, Failure> {
        let file = NamedFile::parse(argument);
        Ok(Self { picture: file.read()?, file })
    }

    /// As if its light had so many bounces, if any number is said: what a reference says is compared with it.
    fn told_to_hold(self, bounces: Option<Bounces>) -> Self {
        match bounces {
            Some(bounces) => Self { picture: self.picture.with_attribute("bounces", bounces), ..self },
            None => self,
        }
    }

    fn layers(&self) -> String {
        self.picture.layers.keys().cloned().collect::<Vec<_>>().join(", ")
    }
}

/// Which layer of each picture: the named one, for both if only one is named; else the irradiance or the picture that both have. A layer without a name is
/// none of these: its meaning is said, or nothing is compared.
fn choose_layers<'a>(test: &'a Input, reference: &'a Input) -> Result<[&'a str; 2], Failure> {
    let both = |name: &&str| [test, reference].iter().all(|input| input.picture.layers.contains_key(*name));
    match (&test.file.layer, &reference.file.layer) {
        (Some(test), Some(reference)) => Ok([test, reference]),
        (Some(layer), None) | (None, Some(layer)) => Ok([layer, layer]),
        (None, None) => {
            [test, reference].into_iter().try_for_each(|input| input.file.expect_meaning(&input.picture))?;
            let layer = [IRRADIANCE, PICTURE].into_iter().find(both);
            layer.map(|layer| [layer; 2]).ok_or_else(|| Failure::input(CommandError::NoCommonLayer { test: test.layers(), reference: reference.layers() }))
        }
    }
}

/// Refuses pictures that say that they show something else.
/// The errors of a picture's layer against that of a reference.
fn compared(test: &Input, reference: &Input, variance: Option<&Layers>, anyway: bool) -> Result<Errors, Failure> {
    let [test_layer, reference_layer] = choose_layers(test, reference)?;
    if !anyway {
        expect_same_view(test, reference)?;
    }
    let [test, reference] = [(test, test_layer), (reference, reference_layer)].map(|(input, layer)| Selected { picture: &input.picture, layer });
    compare_layers(test, reference, variance).map_err(Failure::input)
}

fn expect_same_view(test: &Input, reference: &Input) -> Result<(), Failure> {
    let differences = other_view(&test.picture, &reference.picture);
    if differences.is_empty() {
        return Ok(());
    }
    Err(Failure::input(CommandError::OtherView { reference: reference.file.path.clone(), test: test.file.path.display().to_string(), differences }))
}

fn table(test: &Path, reference: &Path, errors: &Errors) -> String {
    let mut every = if errors.stride == 1 { String::new() } else { format!(", one of {0} in each row and column", errors.stride) };
    if let Some(windows) = errors.windows {
        let _ = write!(every, " in {windows} {}", if windows == 1 { "window" } else { "windows" });
    }
    if let Some(share) = errors.edge_share {
        let _ = write!(every, ", {:.1} % at edges", share * 100.0);
    }
    let mut table = format!(
        "{} of {} against {}\n{} pixels of surface{every}; mean {:.6}",
        errors.layer,
        test.display(),
        reference.display(),
        errors.pixels,
        errors.reference_mean
    );
    if let Some(noise) = errors.reference_noise_over_mean {
        let _ = write!(table, ", noise of the reference {:.2} % (taken off)", noise * 100.0);
    }
    table.push('\n');
    let _ = writeln!(table, "  {:<16}{:>12}   {:<23} noise of the reference in it", "", "", "95 % interval");
    Errors::METRICS.iter().for_each(|metric| table += &row(errors, metric));
    let worst = &errors.largest;
    let _ = writeln!(table, "largest at ({}, {}): {:.6} instead of {:.6}", worst.x, worst.y, worst.test, worst.reference);
    table
}

/// A metric with its interval, and what the reference's noise leaves of it.
fn row(errors: &Errors, metric: &str) -> String {
    let Some(Told { value, interval }) = errors.told(metric, 3) else { return format!("  {metric:<16}{:>12}\n", "not measurable") };
    let unit = if Errors::is_share(metric) { " %" } else { "" };
    let interval = interval.map_or("-".to_owned(), |interval| interval + unit);
    let noise = errors.interval(metric).and_then(|interval| interval.noise_floor);
    let noise = noise.map_or(String::new(), |noise| if unit.is_empty() { format!("{noise:.5}") } else { format!("{:.3} %", 100.0 * noise) });
    format!("{}\n", format!("  {metric:<16}{value:>12}   {interval:<23} {noise}").trim_end())
}

/// The definition of each metric.
fn help() -> String {
    let of = |Definition { metric, formula, meaning }: &Definition| format!("  {metric}\n      {formula}\n      {meaning}\n");
    let definitions: String = Definition::ALL.iter().map(of).collect();
    format!(
        "{EXAMPLE}\n\nMetrics, of the tested luminance x and the reference's r over the pixels where the reference sees a surface; mean is that of r:\n{definitions}\n{CERTAINTY}"
    )
}

#[derive(Serialize)]
struct Comparison<'a> {
    test: String,
    reference: String,
    #[serde(flatten)]
    errors: &'a Errors,
    #[serde(skip_serializing_if = "Option::is_none")]
    parts: Option<&'a Parts>,
}

/// An error in two parts.
#[derive(Serialize)]
struct Parts {
    /// Of a reference of the picture's own bounces, against that of more.
    left_out: Errors,
    /// Of the picture, against that reference.
    method: Errors,
}

impl Parts {
    fn table(&self) -> String {
        let head = |what: &str| format!("{what}\n  {:<16}{:>12}   {:<23} noise of the reference in it\n", "", "", "95 % interval");
        let rows = |errors: &Errors| ["rmse_over_mean", "bias_over_mean"].map(|metric| row(errors, metric)).concat();
        [head("of this the light left out"), rows(&self.left_out), head("and the method, against a reference of its own bounces"), rows(&self.method)].concat()
    }
}

/// What an error that the reference's noise hides is known to be below.
fn hidden(errors: &Errors, metric: &str) -> Option<f64> {
    errors.interval(metric).filter(|interval| interval.below_noise).map(|interval| interval.most())
}

fn judge(errors: &Errors, thresholds: &[Threshold]) -> Result<(), Failure> {
    let over = |Threshold { metric, limit }: &Threshold| match errors.metric(metric).flatten() {
        None => Some(format!("{metric} cannot be measured, its limit is {limit}")),
        Some(value) if value.abs() > *limit => Some(format!("{metric} is {value}, over its limit of {limit}")),
        Some(_) => hidden(errors, metric)
            .filter(|most| most > limit)
            .map(|most| format!("{metric} may be as large as {most}, over its limit of {limit}: the reference's noise hides it, and more rays would show it")),
    };
    let failed: Vec<String> = thresholds.iter().filter_map(over).collect();
    if failed.is_empty() { Ok(()) } else { Err(Failure::work(CommandError::OverThreshold { failed })) }
}
