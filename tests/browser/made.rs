//! Comparisons and sweeps that nothing measured, with pictures of plain colours: so pages are made without a GPU.

use super::Browser;
use hemisplat::measure::compare::{
    AdapterReport, Comparison, PassSpread, ReferenceReport, StartUp, VariantErrors, VariantReport, VariantStartUp, letters, pairs,
};
use hemisplat::measure::criteria::{Cost, Metric};
use hemisplat::measure::page::{Beside, Differences, Gallery, Overlay, Report, Told, page};
use hemisplat::measure::run::Records;
use hemisplat::measure::statistics::Spread;
use hemisplat::measure::sweep::{Axis, Sweep};
use hemisplat::measure::{GLOSSY, Layer, Layers, PICTURE, compare};
use libtest_mimic::Failed;
use std::fs;
use tempfile::TempDir;

pub const SIZE: [u32; 2] = [96, 72];
pub const COLOURS: [[f32; 3]; 3] = [[0.8, 0.02, 0.02], [0.02, 0.8, 0.02], [0.02, 0.02, 0.8]];

/// A comparison and what it is of.
pub struct Made {
    pub comparison: Comparison,
    /// As text.
    pub pipelines: Vec<String>,
    pub pictures: Vec<Layers>,
    pub reference: Option<Layers>,
    /// Over the first picture.
    pub records: Vec<Overlay>,
}

/// A picture whose pixels have a colour by their place, and an irradiance that is `light` everywhere.
pub fn picture(size: [u32; 2], colour: impl Fn(u32, u32) -> [f32; 3], light: f32) -> Layers {
    let [width, height] = size;
    let pixels: Vec<f32> = (0..width * height).flat_map(|at| colour(at % width, at / width)).collect();
    let irradiance = Layer::value(vec![light; (width * height) as usize]);
    Layers::new(width, height).with(PICTURE, Layer::interleaved(&["R", "G", "B"], &pixels, 3)).with("irradiance", irradiance)
}

/// Red, green, blue and so on; each is 10 % brighter and half as slow again as the one before.
pub fn made(variants: usize) -> Made {
    let light = |index: usize| 1.0 + 0.1 * index as f32;
    let pictures = (0..variants).map(|index| picture(SIZE, |_, _| COLOURS[index % 3], light(index))).collect();
    with(pictures, Some(picture(SIZE, |_, _| [0.4; 3], 1.0)))
}

pub fn with(pictures: Vec<Layers>, reference: Option<Layers>) -> Made {
    let size = [pictures[0].width, pictures[0].height];
    let variants: Vec<_> = pictures.iter().enumerate().map(|(index, picture)| variant(index, picture, reference.as_ref())).collect();
    let comparison = Comparison {
        schema: 1,
        scene: "cornell".into(),
        triangles: 36,
        camera: "main".into(),
        size,
        adapter: AdapterReport { name: "an adapter".into(), backend: "vulkan".into(), driver: "a driver".into() },
        runs_asked: 8,
        runs: 8,
        complete: true,
        start_up: StartUp { load_seconds: 0.1, device_seconds: 0.2, reference_seconds: 0.0 },
        peak_host_bytes: Some(1 << 28),
        reference: reference.as_ref().map(|_| ReferenceReport {
            file: None,
            row: None,
            own: true,
            bounces: Some("1".into()),
            samples: Some("256".into()),
            noise_over_mean: Some(0.01),
            error_asked: None,
            stride: None,
            windows: None,
        }),
        pairs: pairs(&variants, 0),
        pictures: vec![],
        error_pairs: vec![],
        variants,
    };
    let pipelines = comparison
        .variants
        .iter()
        .enumerate()
        .map(|(index, _)| format!("Pipeline(\n    nodes: [\n        resolution: {},\n    ],\n)\n", 8 << (index % 12)))
        .collect();
    Made { comparison, pipelines, pictures, reference, records: vec![] }
}

pub fn variant(index: usize, picture: &Layers, reference: Option<&Layers>) -> VariantReport {
    let seconds: Vec<f64> = (0..8).map(|run| 1.5f64.powi(index as i32 % 12) * (1.0 + 0.01 * f64::from(run))).collect();
    let spread = |scale: f64| Spread::of(&seconds.iter().map(|seconds| seconds * scale).collect::<Vec<_>>());
    let pass = |node: &str, pass, share: f64| PassSpread { node: node.into(), pass, runs: 3, gpu_ms: spread(900.0 * share), cpu_ms: spread(20.0 * share) };
    let errors = |layer: &str| reference.and_then(|reference| compare(picture, reference, layer, None).ok());
    VariantReport {
        id: letters(index),
        name: format!("irradiance@tiles.resolution={}", 8 << (index % 12)),
        pipeline: "pipelines/irradiance.ron".into(),
        set: vec![],
        dropped: vec![],
        approximated: vec![],
        start_up: VariantStartUp { plan_seconds: 0.01, shaders_seconds: 0.1, warm_up_seconds: 0.5 },
        seconds: Spread::of(&seconds).unwrap(),
        seconds_of_runs: seconds.clone(),
        records: Records { irradiance: Some(1000 - 7 * index as u32), radiance: None },
        new_records: None,
        surplus_records: None,
        fill_rounds: Some(3),
        uncovered_pixels: Some(0),
        complete: true,
        unfinished: vec![],
        pictures_repeat: true,
        peak_gpu_bytes: 50 << 20,
        passes: vec![pass("gbuffer", "GBuffer", 0.05), pass("tiles", "HemisphereTiles", 0.7), pass("splats", "Splat", 0.25)],
        errors: VariantErrors { irradiance: errors("irradiance"), picture: errors(PICTURE), glossy: errors(GLOSSY), direct: None },
        error_parts: None,
        cuts: vec![],
        frames: vec![],
        courses: Default::default(),
    }
}

impl Made {
    pub fn beside(&self) -> Vec<Beside> {
        self.pipelines.iter().map(|text| Beside { text: text.clone(), ..Beside::default() }).collect()
    }

    pub fn report(&self) -> Report {
        let title = format!("{}: {} pipelines compared", self.comparison.scene, self.pictures.len());
        let told = self.comparison.pairs.iter().map(|pair| Told { words: format!("{} differs from {}", pair.second, pair.first), pair: pair.clone() });
        let differences = Differences { pairs: told.collect(), errors: vec![], hint: None };
        let mut report = Report::new(title, (&self.comparison).into(), &Metric::default(), &Cost::Seconds, self.beside());
        report.runs_asked = self.comparison.runs_asked;
        report.differences = Some(differences);
        report
    }

    pub fn gallery(&self) -> Result<Gallery, Failed> {
        let mut gallery = Gallery::new(self.comparison.size, self.pictures.len() + usize::from(self.reference.is_some()));
        for (index, picture) in self.pictures.iter().enumerate() {
            gallery.add(picture, self.reference.as_ref())?;
            if index == 0 {
                gallery.overlay(self.records.clone());
            }
        }
        gallery.end_frame(None, self.reference.as_ref())?;
        Ok(gallery)
    }

    pub fn html(&self) -> Result<String, Failed> {
        Ok(page(&self.report(), &self.gallery()?)?)
    }

    /// Writes the page and opens it. The folder keeps it.
    pub fn open(&self, browser: &mut Browser) -> Result<TempDir, Failed> {
        open(&self.html()?, browser)
    }
}

pub fn open(html: &str, browser: &mut Browser) -> Result<TempDir, Failed> {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("page.html");
    fs::write(&file, html)?;
    browser.open(&file)?;
    Ok(folder)
}

/// Of six points: two values of one parameter for each of three of another.
pub fn swept(made: &Made) -> Sweep {
    let axis = |parameter: &str, values: &[&str]| Axis { parameter: parameter.into(), values: values.iter().map(|value| value.to_string()).collect() };
    let mut sweep = Sweep::from(&made.comparison);
    sweep.over = vec![axis("cache.accuracy", &["0.1", "0.2"]), axis("tiles.resolution", &["8", "16", "128"])];
    for (index, point) in sweep.points.iter_mut().enumerate() {
        let places = [index / 3, index % 3];
        point.row = "irradiance".into();
        point.values = sweep.over.iter().zip(places).map(|(axis, at)| (axis.parameter.clone(), axis.values[at].clone())).collect();
    }
    sweep
}

pub fn swept_report(made: &Made, sweep: Sweep) -> Report {
    Report::new("cornell: 6 points swept".into(), sweep, &"picture.flip".parse().unwrap_or_default(), &Cost::Seconds, made.beside())
}

/// Noise of 16 bits from a place.
pub fn noise(x: u32, y: u32, seed: u32) -> f32 {
    let mut bits = (x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b) ^ seed.wrapping_mul(0xc2b2_ae35)).wrapping_mul(0x27d4_eb2f);
    bits = (bits ^ (bits >> 15)).wrapping_mul(0x2c1b_3c6d);
    ((bits ^ (bits >> 12)) & 0xffff) as f32 / 65536.0
}

/// Textures of noise, lit a little differently at each index, with noise of their own: harder to pack than what is rendered.
pub fn textured(size: [u32; 2], index: u32, own_noise: f32) -> Layers {
    let lit = |x: u32, y: u32| 0.5 + 0.3 * (x as f32 / 83.0 + index as f32 * 0.1).sin() * (y as f32 / 61.0).cos();
    let texture = |x: u32, y: u32| lit(x, y) * (0.7 + 0.3 * noise(x / 2, y / 2, 0)) * (1.0 + own_noise * (noise(x, y, 1) - 0.5));
    picture(size, |x, y| [0.9, 0.8, 0.6].map(|channel: f32| channel * texture(x, y)), 1.0)
}
