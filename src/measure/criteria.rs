//! The two things that points of a sweep are judged by: an error, and what it costs.

use super::compare::{PairError, VariantErrors};
use super::course::Course;
use super::metrics::{Definition, ErrorDifference, Errors, Interval, Told};
use super::sweep::Measured;
use crate::pipeline::Problem;
use crate::pipeline::diagnostics::known;
use crate::pipeline::syntax::{self, Body, Value, ValueKind, Word};
use std::fmt;
use std::str::FromStr;

/// The error that a sweep is judged by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Metric {
    layer: Judged,
    /// One of [`Errors::METRICS`].
    name: &'static str,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Judged {
    Irradiance,
    Picture,
    Glossy,
    Direct,
}

impl Judged {
    const ALL: [Self; 4] = [Self::Irradiance, Self::Picture, Self::Glossy, Self::Direct];

    fn name(self) -> &'static str {
        match self {
            Self::Irradiance => "irradiance",
            Self::Picture => "picture",
            Self::Glossy => "glossy",
            Self::Direct => "direct",
        }
    }
}

impl FromStr for Metric {
    type Err = String;

    /// Reads `NAME` or `LAYER.NAME`; the layer is `irradiance`, `picture`, `glossy` or `direct`, the first where none is said.
    fn from_str(text: &str) -> Result<Self, String> {
        let (layer, name) = text.split_once('.').unwrap_or(("irradiance", text));
        let layer = Judged::ALL.into_iter().find(|known| known.name() == layer);
        let name = Errors::METRICS.into_iter().find(|known| *known == name);
        let expected = || format!("expected a metric, of the irradiance, or as picture.METRIC, glossy.METRIC or direct.METRIC: {}", Errors::METRICS.join(", "));
        layer.zip(name).map(|(layer, name)| Self { layer, name }).ok_or_else(expected)
    }
}

impl fmt::Display for Metric {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.layer.name(), self.name)
    }
}

impl Metric {
    /// Those that a page tells, in words.
    pub const TOLD: [(Self, &str); 19] = [
        (Self::irradiance("rmse_over_mean"), "Irradiance, rmse over mean"),
        (Self::irradiance("bias_over_mean"), "Irradiance, bias over mean"),
        (Self::irradiance("rms_of_relative"), "Irradiance, rms of relative"),
        (Self::irradiance("block_p50"), "Irradiance, blocks, median"),
        (Self::irradiance("block_p99"), "Irradiance, blocks, 99th percentile"),
        (Self::irradiance("band_error"), "Irradiance, bands of 5 to 30 pixels"),
        (Self::irradiance("rmse_edges"), "Irradiance, rmse at edges"),
        (Self::irradiance("rmse_interior"), "Irradiance, rmse inside surfaces"),
        (Self::irradiance("relmse"), "Irradiance, relative MSE"),
        (Self::picture("rmse_over_mean"), "Picture, rmse over mean"),
        (Self::picture("block_p99"), "Picture, blocks, 99th percentile"),
        (Self::picture("band_error"), "Picture, bands of 5 to 30 pixels"),
        (Self::picture("rmse_edges"), "Picture, rmse at edges"),
        (Self::picture("flip"), "Picture, ꟻLIP"),
        (Self::picture("hdr_flip"), "Picture, HDR-ꟻLIP"),
        (Self { layer: Judged::Glossy, name: "rmse_over_mean" }, "Glossy, rmse over mean"),
        (Self { layer: Judged::Glossy, name: "rms_of_relative" }, "Glossy, rms of relative"),
        (Self::direct("rmse_over_mean"), "Direct, rmse over mean"),
        (Self::direct("block_p99"), "Direct, blocks, 99th percentile"),
    ];

    const fn irradiance(name: &'static str) -> Self {
        Self { layer: Judged::Irradiance, name }
    }

    const fn picture(name: &'static str) -> Self {
        Self { layer: Judged::Picture, name }
    }

    const fn direct(name: &'static str) -> Self {
        Self { layer: Judged::Direct, name }
    }

    /// What a comparison is judged by where nobody says: of irradiance, glossy light and direct light the first in which variants differ, or else that is known.
    pub fn that_judges<'e>(variants: impl Iterator<Item = &'e VariantErrors> + Clone) -> Self {
        let light = [Judged::Irradiance, Judged::Glossy, Judged::Direct].map(|layer| Self { layer, name: "rmse_over_mean" });
        let known = |metric: &Self| variants.clone().filter_map(|errors| metric.signed(errors)).collect::<Vec<_>>();
        let differs = |metric: &&Self| known(metric).windows(2).any(|pair| pair[0] != pair[1]);
        let telling = light.iter().find(differs).or_else(|| light.iter().find(|metric| !known(metric).is_empty()));
        telling.copied().unwrap_or_default()
    }

    /// That of the first layer that was judged in all of these.
    pub fn that_all_have(pictures: &[&VariantErrors]) -> Option<Self> {
        let layers = Judged::ALL.map(|layer| Self { layer, name: "rmse_over_mean" });
        layers.into_iter().find(|metric| pictures.iter().all(|errors| metric.errors(errors).is_some()))
    }

    /// Those of its layer.
    pub fn errors<'e>(&self, errors: &'e VariantErrors) -> Option<&'e Errors> {
        match self.layer {
            Judged::Irradiance => &errors.irradiance,
            Judged::Picture => &errors.picture,
            Judged::Glossy => &errors.glossy,
            Judged::Direct => &errors.direct,
        }
        .as_ref()
    }

    /// How its layer goes in a sequence.
    pub fn course<'m>(&self, measured: &'m Measured) -> Option<&'m Course> {
        measured.courses.get(self.layer.name())
    }

    /// The name of its layer.
    pub fn layer(&self) -> &'static str {
        self.layer.name()
    }

    /// The error itself, with its sign. None where it could not be measured.
    pub fn signed(&self, errors: &VariantErrors) -> Option<f64> {
        self.errors(errors)?.metric(self.name).flatten()
    }

    /// Where it lies; None where that is not known.
    pub fn interval(&self, errors: &VariantErrors) -> Option<Interval> {
        self.errors(errors)?.interval(self.name)
    }

    /// Its size in each draw of the picture's blocks; empty where it was not resampled.
    pub fn draws(&self, errors: &VariantErrors) -> Vec<f64> {
        self.errors(errors).map_or(Vec::new(), |errors| errors.draws(self.name))
    }

    /// How it differs between two variants, one of so many comparisons; None where it was not resampled in both.
    pub fn difference(&self, first: &VariantErrors, second: &VariantErrors, comparisons: usize) -> Option<PairError> {
        let difference = ErrorDifference::of(self.errors(first)?, self.errors(second)?, self.name, comparisons)?;
        Some(PairError { metric: self.to_string(), is_share: self.is_share(), difference })
    }

    /// As people read it; None where it could not be measured.
    pub fn told(&self, errors: &VariantErrors) -> Option<Told> {
        self.errors(errors)?.told(self.name, 2)
    }

    /// What it means.
    pub fn definition(&self) -> Option<&'static Definition> {
        Definition::ALL.iter().find(|definition| definition.metric == self.name)
    }

    /// Its size: a signed error counts as it is far from 0. None where it could not be measured.
    pub fn of(&self, errors: &VariantErrors) -> Option<f64> {
        self.signed(errors).map(f64::abs)
    }

    /// Whether it is a share, told in percent.
    pub fn is_share(&self) -> bool {
        Errors::is_share(self.name)
    }
}

impl Default for Metric {
    fn default() -> Self {
        Self::irradiance("rmse_over_mean")
    }
}

/// What an error is held against.
#[derive(Debug, Clone)]
pub enum Cost {
    /// Of a run.
    Seconds,
    /// How many there are in the end.
    Records,
    /// Time of these nodes for each record.
    PerRecord(Vec<Word>),
}

const COSTS: [&str; 3] = ["Seconds", "Records", "PerRecord"];

impl Cost {
    /// Reads what stands behind `option`.
    ///
    /// # Errors
    /// As [`Cost::read`].
    pub fn parse(option: &str, text: &str) -> Result<Self, Problem> {
        let source = syntax::source(option, text);
        Self::read(&syntax::parse(&source, 0..text.len())?)
    }

    /// Reads `Seconds`, `Records` or `PerRecord(["node", …])`; whether pipelines have these nodes is for others to tell.
    ///
    /// # Errors
    /// Anything else.
    pub fn read(value: &Value) -> Result<Self, Problem> {
        let wrong = |message: String| Problem::new("study::cost", message).at(&value.place, "expected a cost");
        let ValueKind::Compound { name: Some(name), body } = &value.kind else {
            return Err(wrong(format!("expected a cost, got {}", value.phrase())).help(format!("the costs: {}", COSTS.join(", "))));
        };
        match (name.text.as_str(), body) {
            ("Seconds", Body::Empty) => Ok(Self::Seconds),
            ("Records", Body::Empty) => Ok(Self::Records),
            ("PerRecord", Body::Positional(values)) => match nodes(values) {
                Some(nodes) => Ok(Self::PerRecord(nodes)),
                None => Err(wrong("`PerRecord` lists the names of nodes".into()).help("write `PerRecord([\"node\", …])`")),
            },
            ("PerRecord", _) => Err(wrong("`PerRecord` lists the names of nodes".into()).help("write `PerRecord([\"node\", …])`")),
            (other, _) => Err(wrong(format!("`{other}` is not a cost")).help(known(other, COSTS, "the costs"))),
        }
    }

    /// In its unit; None where the adapter tells no time of nodes, or nothing was made.
    pub fn of(&self, measured: &Measured) -> Option<f64> {
        match self {
            Self::Seconds => Some(measured.seconds.median),
            Self::Records => measured.records.irradiance.map(f64::from),
            Self::PerRecord(nodes) => {
                let records = measured.records.irradiance.filter(|records| *records > 0)?;
                let times = measured.passes.iter().filter(|pass| nodes.iter().any(|node| node.text == pass.node));
                let sum = times.map(|pass| Some(pass.gpu_ms? + pass.cpu_ms?)).sum::<Option<f64>>()?;
                Some(sum / f64::from(records))
            }
        }
    }

    /// Its quartiles, where they are known.
    pub fn spread(&self, measured: &Measured) -> Option<[f64; 2]> {
        matches!(self, Self::Seconds).then_some([measured.seconds.lower_quartile, measured.seconds.upper_quartile])
    }

    /// The head of a column.
    pub fn unit(&self) -> &'static str {
        match self {
            Self::Seconds => "seconds",
            Self::Records => "records",
            Self::PerRecord(_) => "ms a record",
        }
    }

    /// A value of it with its unit.
    pub fn told(&self, value: f64) -> String {
        match self {
            Self::Seconds => format!("{value:.3} s"),
            Self::Records => format!("{value} records"),
            Self::PerRecord(_) => format!("{value:.4} ms a record"),
        }
    }

    /// The name of an axis.
    pub fn label(&self, runs: usize) -> String {
        match self {
            Self::Seconds => format!("seconds, median of {runs} runs with its quartiles"),
            Self::Records => "records".to_owned(),
            Self::PerRecord(_) => format!("{self}, median of {runs} runs"),
        }
    }
}

fn nodes(values: &[Value]) -> Option<Vec<Word>> {
    match values {
        [Value { kind: ValueKind::List(items), .. }] if !items.is_empty() => items.iter().map(Value::word).collect(),
        _ => None,
    }
}

impl fmt::Display for Cost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PerRecord(nodes) => {
                let nodes: Vec<&str> = nodes.iter().map(|node| node.text.as_str()).collect();
                write!(f, "ms a record in {}", nodes.join(", "))
            }
            other => f.write_str(other.unit()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::metrics::LargestError;

    #[test]
    fn metrics_have_names() {
        for (text, name) in [("flip", "irradiance.flip"), ("picture.relmse", "picture.relmse"), ("irradiance.block_p99", "irradiance.block_p99")] {
            assert_eq!(text.parse::<Metric>().unwrap().to_string(), name);
        }
        for text in ["", "rsme", "depth.relmse", "picture.", "picture"] {
            assert!(text.parse::<Metric>().unwrap_err().contains("rmse_over_mean"), "{text}");
        }
    }

    /// Errors of three layers, by their square error.
    fn variant([irradiance, glossy, direct]: [Option<f64>; 3]) -> VariantErrors {
        let errors = |rmse_over_mean: f64| Errors {
            schema: 1,
            layer: String::new(),
            pixels: 1,
            stride: 1,
            windows: None,
            reference_mean: 1.0,
            reference_noise_over_mean: None,
            rmse_over_mean,
            bias_over_mean: 0.0,
            rms_of_relative: None,
            block_p50: None,
            block_p99: None,
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
        VariantErrors { irradiance: irradiance.map(errors), picture: None, glossy: glossy.map(errors), direct: direct.map(errors) }
    }

    #[test]
    fn variants_are_judged_by_what_differs() {
        let judged = |variants: &[VariantErrors]| Metric::that_judges(variants.iter()).to_string();
        let [sharp, blurred] = [0.1, 0.2].map(|glossy| variant([Some(0.03), Some(glossy), None]));
        assert_eq!(judged(&[sharp.clone(), blurred.clone()]), "glossy.rmse_over_mean");
        assert_eq!(judged(&[sharp.clone(), sharp]), "irradiance.rmse_over_mean");
        assert_eq!(judged(&[blurred, variant([Some(0.04), Some(0.1), None])]), "irradiance.rmse_over_mean");
        assert_eq!(judged(&[variant([None, None, Some(0.1)])]), "direct.rmse_over_mean");
        assert_eq!(judged(&[variant([None; 3])]), Metric::default().to_string());
    }

    #[test]
    fn what_a_page_tells_is_a_metric_each() {
        for (metric, _) in Metric::TOLD {
            assert_eq!(metric.to_string().parse(), Ok(metric));
        }
    }

    #[test]
    fn costs_are_read_and_told() {
        let told = |text: &str| Cost::parse("--cost", text).map(|cost| cost.to_string());
        assert_eq!(["Seconds", "Records", "PerRecord([\"a\", \"b\"])"].map(|text| told(text).unwrap()), ["seconds", "records", "ms a record in a, b"]);
        for text in ["Second", "3", "PerRecord", "PerRecord([])", "PerRecord([1])", "PerRecord(\"a\")", "Seconds(1)"] {
            assert_eq!(told(text).unwrap_err().code, "study::cost", "{text}");
        }
    }
}
