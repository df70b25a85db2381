//! `hemisplat reference`

use super::console::Console;
use super::exposure::{Exposure, ExposureOptions};
use super::failure::Failure;
use super::interrupt::{self, Shelter};
use super::output::{PictureTarget, expect_distinct, exposed, warn_of_nothing};
use super::progress::Progress;
use super::scene::{SceneOptions, View};
use crate::measure::{Layer, Layers, PICTURE, WINDOWS};
use crate::reference::{Bounces, MAX_SAMPLES, Pixels, Reference, Settings, Stop, render};
use clap::Args;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Trace the ground truth of a scene's view
#[derive(Args)]
#[command(after_help = "Example: hemisplat reference --scene scenes/cornell.ron --bounces 1 --spp 4096 -o out/cornell-reference.exr

An EXR file holds the layers picture, direct, indirect, irradiance and its variance, direct_irradiance, depth, normal.
Of windows it has the full size, is 0 outside of them, and tells their corners in its attribute `windows`.")]
pub struct Options {
    #[command(flatten)]
    scene: SceneOptions,
    /// How many surfaces indirect light touches: 1 is the papers' first bounce
    #[arg(long, value_name = "1|N|all", default_value = "1")]
    bounces: Bounces,
    /// Rays per pixel
    #[arg(long, value_name = "N", default_value_t = 1024, conflicts_with = "error")]
    spp: u32,
    /// Stop when the noise of irradiance, glossy light and picture is below this share of their means, instead of after so many rays
    #[arg(long, value_name = "E")]
    error: Option<f32>,
    /// Only every K-th pixel of each row and column, from pixel K/2 on
    #[arg(long, value_name = "K", default_value_t = 1)]
    stride: u32,
    /// Only N squares of 64×64 pixels, spread over the picture: what blocks, bands and ꟻLIP are measured in at full resolution
    #[arg(long, value_name = "N", conflicts_with = "stride")]
    windows: Option<u32>,
    /// Another seed is an independent estimate
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    exposure: ExposureOptions,
    /// Where to write: .exr, .png or .hdr; may be repeated
    #[arg(long, short, value_name = "FILE", required = true)]
    output: Vec<PathBuf>,
}

pub fn run(options: &Options, console: &Console) -> Result<(), Failure> {
    expect_distinct(&options.output.iter().map(PathBuf::as_path).collect::<Vec<_>>(), &[options.scene.path()])?;
    let targets = options.output.iter().map(|path| PictureTarget::new(path)).collect::<Result<Vec<_>, _>>()?;
    let view = options.scene.load_for_host(console)?;
    let stop = options.error.map_or(Stop::Samples(options.spp), |error| Stop::RelativeError { error, at_most: MAX_SAMPLES });
    let pixels = options.windows.map_or(Pixels::Every(options.stride), Pixels::Windows);
    let settings = Settings { size: view.size, pixels, bounces: options.bounces, stop, seed: options.seed };
    let _shelter = Shelter::new();
    let result = {
        let progress = Progress::new(console, "tracing paths");
        render(&view.stage.scene, &view.stage.bvh, &view.camera, &settings, &|share| progress.report(share))
    };
    if interrupt::requested() && result.is_err() {
        return Err(Failure::interrupted(&[]));
    }
    let reference = result.map_err(Failure::input)?;
    let picture = layers(&reference, attributes(options, &view, &reference)).seen_through(&view.camera, &view.stage.scene, view.size);
    let exposure = Exposure::new(&options.exposure, console).of(&picture, exposed(&targets))?;
    targets.iter().try_for_each(|target| target.write(&picture, exposure))?;
    warn_of_nothing(&picture, console);
    if interrupt::requested() {
        return Err(Failure::interrupted(&targets.iter().map(PictureTarget::path).collect::<Vec<_>>()));
    }
    console.note(&format!("{} rays a pixel in {:.1} s, noise {:.2} %", reference.samples, reference.seconds, 100.0 * reference.noise));
    if let Some(error) = options.error.filter(|error| reference.noise > f64::from(*error)) {
        console.note(&format!("warning: {MAX_SAMPLES} rays a pixel are the bound, and a noise of {:.2} % was asked for", 100.0 * error));
    }
    Ok(())
}

fn attributes(options: &Options, view: &View, reference: &Reference) -> BTreeMap<String, String> {
    let mut attributes = options.scene.attributes(view, (&view.stage.scene, view.moment), &view.camera);
    let stop = options.error.map_or(("spp", options.spp.to_string()), |error| ("error", error.to_string()));
    let own = [
        ("command", "reference".to_owned()),
        ("bounces", reference.bounces.to_string()),
        ("stride", reference.stride.to_string()),
        ("samples", reference.samples.to_string()),
        ("noise", reference.noise.to_string()),
        ("seed", options.seed.to_string()),
        stop,
    ];
    attributes.extend(own.map(|(name, value)| (name.to_owned(), value)));
    attributes
}

/// The reference's layers under the names that pictures of pipelines have, so that each finds its counterpart.
pub(super) fn layers(reference: &Reference, attributes: BTreeMap<String, String>) -> Layers {
    let planes = |names: &[&str], data: &[glam::Vec3]| Layer::interleaved(names, bytemuck::cast_slice(data), 3);
    let colour = |data: &[glam::Vec3]| planes(&["R", "G", "B"], data);
    let value = |data: &[f32]| Layer::value(data.to_owned());
    let noise = &reference.luminance_variance;
    let picture = Layers::new(reference.width, reference.height)
        .with(PICTURE, colour(&reference.picture))
        .with("direct", colour(&reference.direct))
        .with("indirect", colour(&reference.indirect))
        .with("irradiance", colour(&reference.irradiance))
        .with("direct_irradiance", colour(&reference.direct_irradiance))
        .with("variance", colour(&reference.variance))
        .with("irradiance_luminance_variance", value(&noise.irradiance))
        .with("direct_luminance_variance", value(&noise.direct))
        .with("indirect_luminance_variance", value(&noise.indirect))
        .with("picture_luminance_variance", value(&noise.picture))
        .with("depth", Layer::value(reference.depth.clone()))
        .with("normal", planes(&["X", "Y", "Z"], &reference.normal));
    let picture = match &reference.glossy {
        Some(glossy) => picture
            .with("glossy", colour(&glossy.radiance))
            .with("glossy_variance", colour(&glossy.variance))
            .with("glossy_luminance_variance", value(&noise.glossy)),
        None => picture,
    };
    let windows = reference.windows.iter().map(|windows| (WINDOWS.to_owned(), windows.to_string()));
    Layers { attributes: attributes.into_iter().chain(windows).collect(), ..picture }
}
