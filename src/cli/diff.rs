//! `hemisplat diff`

use super::console::Console;
use super::failure::{CommandError, Failure};
use super::input::read_picture;
use super::output::{Target, expect_distinct};
use crate::measure::{Errors, Layers, PICTURE, Selected, compare_layers};
use clap::Args;
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Tell how far a picture is from a reference
#[derive(Args)]
#[command(after_help = "Example: hemisplat diff out/cornell.exr out/cornell-reference.exr:irradiance --fail-above rmse_over_mean=0.05

Without a name, the layer `irradiance` is compared, or `picture` where one file lacks it. Where a file has one layer without a name, say which layer of the other it is.")]
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
    /// Write what was found as JSON; - is standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Fail with status 1 if a metric is larger, signed ones by their size
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
    let read: Vec<&Path> = [&test.path, &reference.path].into_iter().chain(&options.variance).map(PathBuf::as_path).collect();
    expect_distinct(&options.json.iter().map(PathBuf::as_path).collect::<Vec<_>>(), &read)?;
    let variance = options.variance.as_deref().map(read_picture).transpose()?;
    let [test_layer, reference_layer] = choose_layers(&test, &reference)?;
    let errors = compare_layers(
        Selected { picture: &test.picture, layer: test_layer },
        Selected { picture: &reference.picture, layer: reference_layer },
        variance.as_ref(),
    )
    .map_err(Failure::input)?;
    console.print(&table(&test.path, &reference.path, &errors))?;
    if let Some(json) = json {
        json.write_json(&Comparison { test: test.path.display().to_string(), reference: reference.path.display().to_string(), errors: &errors })?;
    }
    judge(&errors, &options.fail_above)
}

/// A picture file and the layer that the user named after it.
struct Input {
    path: PathBuf,
    picture: Layers,
    layer: Option<String>,
}

impl Input {
    /// Reads `FILE` or `FILE:LAYER`; a file whose name holds the colon comes first.
    fn read(argument: &str) -> Result<Self, Failure> {
        let (path, layer) = match argument.rsplit_once(':') {
            Some((path, layer)) if !Path::new(argument).exists() && !layer.contains(['/', '\\']) => (path, Some(layer.to_owned())),
            _ => (argument, None),
        };
        let path = PathBuf::from(path);
        let picture = read_picture(&path)?;
        if let Some(layer) = &layer {
            picture.rgb(layer).map_err(|error| Failure::input(CommandError::BadPicture { path: path.clone(), error }))?;
        }
        Ok(Self { path, picture, layer })
    }

    /// Whether the file holds one colour and does not say of what, as many programs write it.
    fn is_nameless(&self) -> bool {
        self.picture.layers.len() == 1 && self.picture.layers.contains_key(PICTURE)
    }

    fn layers(&self) -> String {
        self.picture.layers.keys().cloned().collect::<Vec<_>>().join(", ")
    }
}

/// Which layer of each picture: the named one, for both if only one is named; else the irradiance or the picture that both have.
fn choose_layers<'a>(test: &'a Input, reference: &'a Input) -> Result<[&'a str; 2], Failure> {
    let both = |name: &&str| [test, reference].iter().all(|input| input.picture.layers.contains_key(*name));
    match (&test.layer, &reference.layer) {
        (Some(test), Some(reference)) => Ok([test, reference]),
        (Some(layer), None) | (None, Some(layer)) => Ok([layer, layer]),
        (None, None) => match ["irradiance", PICTURE].into_iter().find(both) {
            Some(PICTURE) if test.is_nameless() != reference.is_nameless() => Err(ambiguous(test, reference)),
            Some(layer) => Ok([layer, layer]),
            None => Err(Failure::input(CommandError::NoCommonLayer { test: test.layers(), reference: reference.layers() })),
        },
    }
}

/// One of the files does not say what its only layer is, and the other has several that it could be.
fn ambiguous(test: &Input, reference: &Input) -> Failure {
    let (nameless, named) = if test.is_nameless() { (test, reference) } else { (reference, test) };
    Failure::input(CommandError::NamelessLayer { nameless: nameless.path.clone(), named: named.path.clone(), held: named.layers() })
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
    let percent = |value: Option<f64>| value.map_or_else(|| "not measurable".to_owned(), |value| format!("{:>10.3} %", value * 100.0));
    let number = |value: Option<f64>| value.map_or_else(|| "not measurable".to_owned(), |value| format!("{value:>10.5}"));
    for metric in Errors::METRICS {
        let value = errors.metric(metric).flatten();
        let value = if Errors::is_share(metric) { percent(value) } else { number(value) };
        let _ = writeln!(table, "  {metric:<16}{value}");
    }
    let worst = &errors.largest;
    let _ = writeln!(table, "largest at ({}, {}): {:.6} instead of {:.6}", worst.x, worst.y, worst.test, worst.reference);
    table
}

#[derive(Serialize)]
struct Comparison<'a> {
    test: String,
    reference: String,
    #[serde(flatten)]
    errors: &'a Errors,
}

fn judge(errors: &Errors, thresholds: &[Threshold]) -> Result<(), Failure> {
    let over = |Threshold { metric, limit }: &Threshold| match errors.metric(metric).flatten() {
        None => Some(format!("{metric} cannot be measured, its limit is {limit}")),
        Some(value) if value.abs() > *limit => Some(format!("{metric} is {value}, over its limit of {limit}")),
        Some(_) => None,
    };
    let failed: Vec<String> = thresholds.iter().filter_map(over).collect();
    if failed.is_empty() { Ok(()) } else { Err(Failure::work(CommandError::OverThreshold { failed })) }
}
