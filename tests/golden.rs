//! One golden picture a pipeline file: the Cornell box, small, with a glossy wall for the pipelines of glossy light; and larger ones of what a box has not: two lights
//! with shadow maps, and glossy balls, which are seen by records of other normals. All layers are compared. A change of the light that a viewer would not see passes; a wrong
//! weight, sign or bias does not, which small mistakes made on purpose prove. Records, rounds and bytes may not grow by a tenth.
//! The small pictures are drawn by SwiftShader as well, a driver of other limits, where Chromium is there to bring it.
//! `HEMISPLAT_UPDATE_GOLDEN=1 cargo test --test golden` draws the pictures anew and prints how far
//! old and new are from the truth; a picture that is farther from it than the old one also needs `HEMISPLAT_ACCEPT_WORSE=1`. `HEMISPLAT_UPDATE_GOLDEN=counts` writes the counts alone.

mod broken;
mod skips;

use broken::Broken;
use hemisplat::block_on;
use hemisplat::measure::{DIRECT, Errors, Layer, Layers, PICTURE, compare};
use libtest_mimic::{Arguments, Failed, Trial};
use skips::Missing;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Edge of the pictures [pixels].
const SIZE: &str = "48x48";
/// What suits so small a picture: the least spacing of the papers' pipelines is an eighth of it.
const SPACING: &str = "cache.minimum_spacing=4";
/// What a picture may be off at most.
#[derive(Clone, Copy)]
struct Limits {
    /// Metrics of light in which records are.
    light: [(&'static str, f64); 4],
    /// The same of light that rays and shadow maps find: no records are in it, so that adapters differ by rounding alone.
    direct: [(&'static str, f64); 4],
    /// The mean of weights [share of it].
    weight: f64,
    /// The mean of uncertainties. Tiles on the host know more of theirs than those on the device: twice as much passes.
    uncertainty: f64,
}

const DIRECT_LIMITS: [(&str, f64); 4] = [("rmse_over_mean", 0.01), ("bias_over_mean", 0.003), ("block_p50", 0.003), ("block_p99", 0.02)];

/// One adapter draws the same bits again; others round differently, so that a few records come to lie elsewhere: measured by a change of the spacing by
/// a thousandth, 1.5 %, 0.1 %, 0 and 6 %.
const LIMITS: Limits = Limits {
    light: [("rmse_over_mean", 0.03), ("bias_over_mean", 0.005), ("block_p50", 0.005), ("block_p99", 0.08)],
    direct: DIRECT_LIMITS,
    weight: 0.05,
    uncertainty: 1.0,
};

/// Where the adapter is the one that drew the kept pictures, larger ones notice more: the same change of the hall, of its accuracy or of its largest
/// spacing makes 0.07 %, 0.002 %, 0.002 % and 0.1 %.
const HALL_LIMITS: Limits = Limits {
    light: [("rmse_over_mean", 0.0025), ("bias_over_mean", 0.0004), ("block_p50", 0.0002), ("block_p99", 0.006)],
    direct: [("rmse_over_mean", 0.003), ("bias_over_mean", 0.0004), ("block_p50", 0.0002), ("block_p99", 0.006)],
    weight: 0.005,
    uncertainty: 0.005,
};

/// The same of the balls makes 0.4 %, 0.03 %, 0.003 % and 2 %.
const BALLS_LIMITS: Limits = Limits {
    light: [("rmse_over_mean", 0.012), ("bias_over_mean", 0.001), ("block_p50", 0.0005), ("block_p99", 0.04)],
    direct: [("rmse_over_mean", 0.003), ("bias_over_mean", 0.0004), ("block_p50", 0.0002), ("block_p99", 0.006)],
    weight: 0.005,
    uncertainty: 0.005,
};

/// Pipelines that rasterise hemispheres in perspective. In corners SwiftShader's raster loses part of what stands beside the eye: 1 % of the light; by rays
/// these pipelines agree to 0.6 %.
const PERSPECTIVE: [&str; 4] = ["irradiance-hemicube", "irradiance-plane", "irradiance-plane-coverage", "irradiance-plane-open"];
const PERSPECTIVE_LIMITS: Limits = Limits {
    light: [("rmse_over_mean", 0.12), ("bias_over_mean", 0.02), ("block_p50", 0.03), ("block_p99", 0.2)],
    direct: DIRECT_LIMITS,
    weight: 0.05,
    uncertainty: 1.0,
};

/// Pipelines whose records are of photons themselves: one photon of a thousand that another device sends elsewhere has the walk choose other places, whose
/// zones hold other photons. An H200 makes 4 %, 0.1 %, 0.5 % and 11 % of it; both are as far from the truth.
const OF_PHOTONS: [&str; 2] = ["photon", "photon-radiance"];
const PHOTON_LIMITS: Limits = Limits {
    light: [("rmse_over_mean", 0.06), ("bias_over_mean", 0.01), ("block_p50", 0.012), ("block_p99", 0.16)],
    direct: DIRECT_LIMITS,
    weight: 0.05,
    uncertainty: 1.0,
};

/// What is shot in an iteration depends on what the one before has brought: where rounding has chosen another texel once, all that follow differ by chance:
/// what is wrong with them `--test places` and `--test closed_forms` notice.
const FEW_TEXELS: &[&str] = &["--set", "lightmap.resolution=64", "--set", "lightmap.iterations=32"];
const SHOT_LIMITS: Limits = Limits {
    light: [("rmse_over_mean", 0.3), ("bias_over_mean", 0.1), ("block_p50", 0.15), ("block_p99", 1.2)],
    direct: DIRECT_LIMITS,
    weight: 0.05,
    uncertainty: 1.0,
};

/// How far distances and normals may be off [share of their root mean square]; files hold them in half floats.
const GEOMETRY_LIMIT: f64 = 1e-3;
/// What a count may be of the kept one: a tenth more, and two that a small one may be off.
const COUNT_LIMIT: (f64, f64) = (1.1, 2.0);

/// As many rays for all tiles, as the device has them.
const EVEN: &[&str] = &["--set", "tiles.quality=1e6", "--set", "detail_tiles.quality=1e6"];

/// Beside those of all pipelines: pipeline, what is set, scene, pixels, and whose golden picture it has to match.
const LARGE: [(&str, &[&str], &str, &str, &str); 9] = [
    ("irradiance", EVEN, "hall", "224x224", "irradiance"),
    ("irradiance-device", &[], "hall", "224x224", "irradiance"),
    ("irradiance-one-rate", &[], "hall", "224x224", "irradiance-one-rate"),
    ("irradiance", EVEN, "balls", "240x200", "irradiance"),
    ("irradiance-device", &[], "balls", "240x200", "irradiance"),
    ("radiance", &[], "balls", "240x200", "radiance"),
    ("radiance-bounces", &[], "ring", "192x128", "radiance-bounces"),
    // A driver on the CPU takes half a minute for the tables of these lobes.
    ("radiance-device", &["--set", "lobes.place=Host"], "balls", "240x200", "radiance"),
    ("radiance-rotated", &[], "balls", "240x200", "radiance-rotated"),
];

type Outcome = Result<(), Failed>;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn pipelines() -> Vec<PathBuf> {
    let mut files: Vec<_> = std::fs::read_dir(root().join("pipelines")).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|ending| ending == "ron"));
    files.sort();
    files
}

/// What it prints.
fn hemisplat(arguments: &[&str]) -> Result<String, Failed> {
    hemisplat_in(arguments, &[])
}

/// The same with these variables in its environment.
fn hemisplat_in(arguments: &[&str], environment: &[(&str, &Path)]) -> Result<String, Failed> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hemisplat"));
    command.current_dir(root()).args(arguments).envs(environment.iter().copied());
    let done = command.output().map_err(|e| e.to_string())?;
    if done.status.success() { Ok(String::from_utf8_lossy(&done.stdout).into_owned()) } else { Err(String::from_utf8_lossy(&done.stderr).into_owned().into()) }
}

/// A picture that is kept.
#[derive(Clone)]
struct Golden {
    pipeline: String,
    sets: &'static [&'static str],
    scene: &'static str,
    size: &'static str,
    /// The pipeline whose picture it has to match; most often itself.
    like: String,
    /// Where shaders of other texts are.
    shaders: Option<PathBuf>,
    /// The file of another driver than the one that is found first.
    driver: Option<PathBuf>,
}

impl Golden {
    /// The small picture of a pipeline.
    fn small(pipeline: &str) -> Self {
        let scene = match pipeline.split('-').next() {
            _ if pipeline.split('-').any(|part| part == "radiance") => "cornell-glossy",
            Some("environment") => "teapot-noon",
            _ => "cornell",
        };
        // Records of photons stand where photons are.
        let stands_by_pixels = scene.starts_with("cornell") && !["photon", "photon-density", "photon-radiance"].contains(&pipeline);
        let is_of_texels = pipeline.starts_with("radiosity") && pipeline != "radiosity-gather";
        let sets: &[&str] = match (is_of_texels, stands_by_pixels) {
            (true, _) => FEW_TEXELS,
            (_, true) => &["--set", SPACING],
            _ => &[],
        };
        Self { pipeline: pipeline.into(), sets, scene, size: SIZE, like: pipeline.into(), shaders: None, driver: None }
    }

    /// Of its test.
    fn name(&self) -> String {
        if self.is_small() { self.pipeline.clone() } else { format!("{} of {}", self.pipeline, self.scene) }
    }

    fn is_small(&self) -> bool {
        self.size == SIZE
    }

    fn limits(&self, on_drawing_adapter: bool) -> Limits {
        match self.scene {
            "hall" if on_drawing_adapter => HALL_LIMITS,
            "balls" if on_drawing_adapter => BALLS_LIMITS,
            // By chance, where another processor rounds otherwise under the same name of an adapter.
            _ if self.pipeline == "radiosity-gather" => PHOTON_LIMITS,
            _ if self.pipeline.starts_with("radiosity") => SHOT_LIMITS,
            _ if !on_drawing_adapter && OF_PHOTONS.contains(&self.pipeline.as_str()) => PHOTON_LIMITS,
            _ if self.driver.is_some() && PERSPECTIVE.contains(&self.pipeline.as_str()) => PERSPECTIVE_LIMITS,
            _ => LIMITS,
        }
    }

    fn file(&self, ending: &str) -> PathBuf {
        root().join("tests/golden").join(&self.like).join(format!("{}.{ending}", self.scene))
    }

    /// What it takes; each pipeline has its own.
    fn counts(&self) -> PathBuf {
        root().join("tests/golden").join(&self.pipeline).join(format!("{}.json", self.scene))
    }

    /// Named from the project's root, so that the file keeps no path of the machine.
    fn render(&self, options: &[&str], into: &Path) -> Outcome {
        let (pipeline, into) = (format!("pipelines/{}.ron", self.pipeline), into.to_string_lossy());
        let arguments = ["render", &pipeline, "--scene", self.scene, "--size", self.size, "--quiet", "-o", &into];
        let variables = [("HEMISPLAT_SHADERS", &self.shaders), ("VK_DRIVER_FILES", &self.driver)];
        let environment: Vec<_> = variables.into_iter().filter_map(|(name, path)| Some((name, path.as_deref()?))).collect();
        hemisplat_in(&[&arguments, self.sets, options].concat(), &environment).map(drop)
    }
}

fn render(pipeline: &str, options: &[&str], into: &Path) -> Outcome {
    Golden::small(pipeline).render(options, into)
}

fn picture(path: &Path) -> Result<Layers, Failed> {
    let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    Layers::read(&bytes).map_err(|e| e.to_string().into())
}

fn metrics(test: &Layers, reference: &Layers, layer: &str) -> Result<Errors, Failed> {
    compare(test, reference, layer, None).map_err(|e| e.to_string().into())
}

/// One channel of a layer alone, and what tells where surfaces are.
fn channel(picture: &Layers, layer: &str, index: usize) -> Result<Layers, Failed> {
    let plane = picture.rgb(layer).map_err(|e| e.to_string())?[index].to_vec();
    let depth = picture.layer("depth").map_err(|e| e.to_string())?.clone();
    Ok(Layers::new(picture.width, picture.height).with(layer, Layer::value(plane)).with("depth", depth))
}

/// Refuses a picture that is beyond the limits, in luminance or in one of the colours; the worst blocks of a colour, where
/// it is next to none, tell nothing.
fn expect_alike(made: &Layers, golden: &Layers) -> Outcome {
    expect_layer_alike(made, golden, "irradiance", &LIMITS)
}

/// The same of every layer that either has.
fn expect_all_alike(made: &Layers, golden: &Layers, limits: &Limits) -> Outcome {
    if !made.layers.keys().eq(golden.layers.keys()) {
        return Err(format!("the layers are {:?}, not {:?}", made.layers.keys(), golden.layers.keys()).into());
    }
    let layers = golden.layers.keys().map(|layer| expect_layer_alike(made, golden, layer, limits));
    let outcomes = layers.chain([expect_sky_alike(made, golden)]);
    let wrong: Vec<String> = outcomes.filter_map(|outcome| outcome.err()?.message().map(str::to_owned)).collect();
    if wrong.is_empty() { Ok(()) } else { Err(wrong.join("; ").into()) }
}

/// Metrics look at surfaces alone: what pixels beside them show, in half floats.
fn expect_sky_alike(made: &Layers, golden: &Layers) -> Outcome {
    let (Ok(depth), Ok(made), Ok(golden)) = (golden.layer("depth"), made.rgb(PICTURE), golden.rgb(PICTURE)) else { return Ok(()) };
    let beyond: Vec<bool> = depth.channels.values().flatten().map(|depth| *depth == 0.0).collect();
    let differ =
        |made: &[f32], golden: &[f32]| made.iter().zip(golden).zip(&beyond).filter(|((a, b), sky)| **sky && (**a - **b).abs() > 0.02 * b.abs()).count();
    match made.iter().zip(golden).map(|(made, golden)| differ(made, golden)).sum::<usize>() {
        0 => Ok(()),
        pixels => Err(format!("the sky differs in {pixels} values of pixels that see no surface").into()),
    }
}

fn expect_layer_alike(made: &Layers, golden: &Layers, layer: &str, limits: &Limits) -> Outcome {
    let limits = match layer {
        "depth" | "normal" => return expect_geometry_alike(made, golden, layer),
        "weight" | "glossy_weight" => return expect_weights_alike(made, golden, layer, limits.weight),
        "uncertainty" => return expect_weights_alike(made, golden, layer, limits.uncertainty),
        _ if is_black(golden, layer)? => return if is_black(made, layer)? { Ok(()) } else { Err(format!("{layer} is not black").into()) },
        DIRECT => &limits.direct,
        _ => &limits.light,
    };
    let mut wrong = beyond("luminance", &metrics(made, golden, layer)?, limits);
    for (index, name) in ["red", "green", "blue"].into_iter().enumerate() {
        wrong.extend(beyond(name, &metrics(&channel(made, layer, index)?, &channel(golden, layer, index)?, layer)?, &limits[..3]));
    }
    let wrong: Vec<String> = wrong.into_iter().map(|wrong| format!("{layer}: {wrong}")).collect();
    if wrong.is_empty() { Ok(()) } else { Err(wrong.join("; ").into()) }
}

/// As light is that a pipeline leaves to its records.
fn is_black(picture: &Layers, layer: &str) -> Result<bool, Failed> {
    let planes = picture.rgb(layer).map_err(|e| e.to_string())?;
    Ok(planes.iter().all(|plane| plane.iter().all(|value| *value == 0.0)))
}

/// How far ways of rotation may be from that by spherical harmonics [share of the mean].
const ROTATIONS: [(&str, f64); 3] = [("Precomputed", 0.0077), ("DigonDeletion", 0.0525), ("MovedViewer", 0.04)];

/// Pairs of values of all planes of a layer.
fn pairs(made: &Layers, golden: &Layers, layer: &str) -> Result<Vec<(f64, f64)>, Failed> {
    let planes =
        |picture: &Layers| -> Result<Vec<f32>, Failed> { Ok(picture.layer(layer).map_err(|e| e.to_string())?.channels.values().flatten().copied().collect()) };
    let (made, golden) = (planes(made)?, planes(golden)?);
    if made.len() != golden.len() {
        return Err(format!("{layer}: {} values instead of {}", made.len(), golden.len()).into());
    }
    Ok(made.into_iter().zip(golden).map(|(a, b)| (a.into(), b.into())).collect())
}

fn expect_geometry_alike(made: &Layers, golden: &Layers, layer: &str) -> Outcome {
    let pairs = pairs(made, golden, layer)?;
    let [off, all] = pairs.iter().fold([0.0; 2], |[off, all], (a, b)| [off + (a - b) * (a - b), all + b * b]);
    let off = (off / all.max(f64::MIN_POSITIVE)).sqrt();
    if off <= GEOMETRY_LIMIT { Ok(()) } else { Err(format!("{layer} is {:.3} % off", 100.0 * off).into()) }
}

fn expect_weights_alike(made: &Layers, golden: &Layers, layer: &str, limit: f64) -> Outcome {
    let [made, golden] = pairs(made, golden, layer)?.iter().fold([0.0; 2], |[made, golden], (a, b)| [made + a, golden + b]);
    let off = (made - golden).abs() / golden.max(f64::MIN_POSITIVE);
    if off <= limit { Ok(()) } else { Err(format!("the mean of {layer} is {:.2} % off", 100.0 * off).into()) }
}

fn beyond(of: &str, errors: &Errors, limits: &[(&str, f64)]) -> Vec<String> {
    let found = |name: &str| errors.metric(name).flatten().unwrap_or(f64::INFINITY).abs();
    let over = limits.iter().filter(|(name, limit)| found(name) > *limit);
    over.map(|(name, limit)| format!("{name} of {of} is {:.2} %, {:.2} % are allowed", 100.0 * found(name), 100.0 * limit)).collect()
}

fn check(of: &Golden) -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let [made, stats] = ["made.exr", "stats.json"].map(|name| folder.path().join(name));
    of.render(&["--stats", &stats.to_string_lossy()], &made)?;
    let counts = Counts::of(&stats)?;
    if let Ok(what) = std::env::var("HEMISPLAT_UPDATE_GOLDEN") {
        if what != "counts" && of.like == of.pipeline {
            update(&made, &of.file("exr"), folder.path(), of)?;
        }
        return counts.write(&of.counts());
    }
    let (made, kept) = (picture(&made)?, picture(&of.file("exr"))?);
    let made = if counts.is_of_drawing_adapter() { made } else { with_same_edges(made, &kept)? };
    expect_all_alike(&made, &kept, &of.limits(counts.is_of_drawing_adapter()))?;
    counts.expect_at_most(&of.counts())
}

/// Most pixels that may see another surface on another driver [share of all]: rasters round edges as they like.
const EDGES: f64 = 0.015;

/// The picture with the kept pixels where it sees another surface than the kept one does, which may be few.
fn with_same_edges(made: Layers, kept: &Layers) -> Result<Layers, Failed> {
    let values = |picture: &Layers, layer: &str| picture.layer(layer).map(|layer| layer.channels.clone()).map_err(|e| e.to_string());
    let mut differs = vec![false; (kept.width * kept.height) as usize];
    for layer in ["depth", "normal"] {
        for (made, kept) in values(&made, layer)?.values().zip(values(kept, layer)?.values()) {
            differs.iter_mut().zip(made.iter().zip(kept)).for_each(|(differs, (a, b))| *differs |= (a - b).abs() > 0.01 * b.abs().max(1.0));
        }
    }
    let share = differs.iter().filter(|differs| **differs).count() as f64 / differs.len() as f64;
    if share > EDGES {
        return Err(format!("{:.1} % of the pixels see another surface, {:.1} % may", 100.0 * share, 100.0 * EDGES).into());
    }
    let mut layers = made.layers;
    for (name, layer) in layers.iter_mut() {
        for (channel, plane) in &mut layer.channels {
            let kept = kept.layers.get(name).and_then(|layer| layer.channels.get(channel)).ok_or("a layer is not kept")?;
            plane.iter_mut().zip(kept).zip(&differs).filter(|(_, differs)| **differs).for_each(|((value, kept), _)| *value = *kept);
        }
    }
    Ok(Layers { layers, ..made })
}

/// What a picture took, on Mesa's software driver: for others plans differ.
#[derive(serde::Serialize, serde::Deserialize)]
struct Counts {
    records: u64,
    glossy_records: u64,
    rounds: u64,
    gpu_bytes: u64,
    #[serde(skip)]
    adapter: String,
}

/// Whether an adapter of this name is that on which the kept pictures were drawn.
fn has_drawn(adapter: &str) -> bool {
    adapter.starts_with("llvmpipe")
}

impl Counts {
    fn of(stats: &Path) -> Result<Self, Failed> {
        let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(stats)?)?;
        let number = |pointer: &str| stats.pointer(pointer).and_then(serde_json::Value::as_u64).unwrap_or(0);
        Ok(Self {
            records: number("/frames/0/records/irradiance"),
            glossy_records: number("/frames/0/records/radiance"),
            rounds: number("/frames/0/fill_rounds"),
            gpu_bytes: number("/peak_gpu_bytes"),
            adapter: stats.pointer("/adapter/name").and_then(serde_json::Value::as_str).unwrap_or_default().to_owned(),
        })
    }

    /// Whether the adapter is that on which the kept pictures were drawn.
    fn is_of_drawing_adapter(&self) -> bool {
        has_drawn(&self.adapter)
    }

    fn write(&self, into: &Path) -> Outcome {
        std::fs::write(into, serde_json::to_string(self)? + "\n")?;
        Ok(())
    }

    fn expect_at_most(&self, kept: &Path) -> Outcome {
        if !self.is_of_drawing_adapter() {
            return Ok(());
        }
        let kept: Self = serde_json::from_slice(&std::fs::read(kept).map_err(|e| format!("{}: {e}", kept.display()))?)?;
        let counts = [
            ("records", self.records, kept.records),
            ("glossy records", self.glossy_records, kept.glossy_records),
            ("rounds", self.rounds, kept.rounds),
            ("bytes on the device", self.gpu_bytes, kept.gpu_bytes),
        ];
        let grown = counts.iter().filter(|(_, now, before)| *now as f64 > *before as f64 * COUNT_LIMIT.0 + COUNT_LIMIT.1);
        let grown: Vec<String> = grown.map(|(what, now, before)| format!("{now} {what} instead of {before}")).collect();
        if grown.is_empty() { Ok(()) } else { Err(grown.join("; ").into()) }
    }
}

/// As files hold large pictures: in half floats, but for weights, which these may not hold.
fn shortened(picture: Layers) -> Layers {
    let layers = picture.layers.into_iter().map(|(name, layer)| if name.ends_with("weight") { (name, layer) } else { (name, layer.as_half()) }).collect();
    Layers { layers, ..picture }
}

fn update(made: &Path, golden: &Path, folder: &Path, of: &Golden) -> Outcome {
    let truth = folder.join("truth.exr");
    let stride = if of.is_small() { "1" } else { "2" };
    let bounces = picture(made)?.attributes.get("bounces").cloned().ok_or("the picture does not say how many bounces it has")?;
    hemisplat(&[
        "reference",
        "--bounces",
        &bounces,
        "--scene",
        of.scene,
        "--size",
        of.size,
        "--spp",
        "1024",
        "--stride",
        stride,
        "--quiet",
        "-o",
        &truth.to_string_lossy(),
    ])?;
    let truth = picture(&truth)?;
    for layer in ["irradiance", "glossy", "direct", PICTURE].into_iter().filter(|layer| truth.layers.contains_key(*layer)) {
        if !picture(made)?.layers.contains_key(layer) {
            continue;
        }
        let after = metrics(&picture(made)?, &truth, layer)?.rmse_over_mean;
        let before = if golden.exists() { Some(metrics(&picture(golden)?, &truth, layer)?.rmse_over_mean) } else { None };
        println!("{}: rmse_over_mean of {layer} against the truth {before:?} -> {after:.4}", golden.display());
        if before.is_some_and(|before| after > before * 1.02) && std::env::var_os("HEMISPLAT_ACCEPT_WORSE").is_none() {
            return Err("the new picture is farther from the truth; HEMISPLAT_ACCEPT_WORSE=1 takes it all the same".into());
        }
    }
    std::fs::create_dir_all(golden.parent().unwrap_or(golden)).map_err(|e| e.to_string())?;
    if of.is_small() {
        return std::fs::copy(made, golden).map(|_| ()).map_err(|e| e.to_string().into());
    }
    let bytes = shortened(picture(made)?).to_exr().map_err(|e| e.to_string())?;
    Ok(std::fs::write(golden, bytes)?)
}

/// The same files on the same adapter: the same bits, whatever ran in between.
fn pictures_repeat_to_the_bit() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let drawn = |name: &str| -> Result<Vec<u8>, Failed> {
        let made = folder.path().join(name);
        render("irradiance", &[], &made)?;
        Ok(std::fs::read(&made).map_err(|e| e.to_string())?)
    };
    let first = drawn("first.exr")?;
    for name in ["second.exr", "third.exr"] {
        if drawn(name)? != first {
            return Err(format!("{name} differs from the first").into());
        }
    }
    Ok(())
}

/// A lamp, then a light with shadow maps: what a scene does not need takes no part in its picture.
fn specialisation_changes_no_picture() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    for scene in ["cornell", "corner"] {
        let drawn = |pipeline: &str| -> Result<Layers, Failed> {
            let made = folder.path().join("made.exr");
            hemisplat(&["render", pipeline, "--scene", scene, "--size", "24x18", "--set", "tiles.resolution=8", "--quiet", "-o", &made.to_string_lossy()])?;
            picture(&made)
        };
        let (special, general) = (drawn("irradiance")?, drawn("irradiance-general")?);
        for layer in ["irradiance", PICTURE] {
            let largest = compare(&general, &special, layer, None).map_err(|e| e.to_string())?.largest;
            if largest.over_mean.abs() > 1e-3 {
                return Err(format!("{scene}, {layer}: {largest:?}").into());
            }
        }
    }
    Ok(())
}

/// Another value for each parameter that a plan may call idle, by how it ends.
const OTHER_VALUES: [(&str, &str); 14] = [
    (".taps", "4"),
    (".coefficients", "Half"),
    (".rotation", "DigonDeletion"),
    (".method", "None"),
    (".emitters.area_samples", "3"),
    (".emitters.sky_samples", "3"),
    (".emitters.tolerance", "3"),
    (".emitters", "Records"),
    (".place", "Device"),
    (".highlights", "Wide"),
    (".photons", "9"),
    (".search_radius", "0.2"),
    (".share", "0.001"),
    (".finest", "8"),
];

/// A room with a lamp at a wall: most light comes from one bright spot.
const LAMP_AT_A_WALL: &str = r#"Scene(version: 1, geometry: [Box(min: (0, 0, 0), max: (8, 4, 6))],
    materials: { "*": Diffuse(reflectance: (0.7, 0.65, 0.6)) }, normals: Face,
    lights: [Point(position: (7.9, 1.2, 3), intensity: (20, 19, 17))],
    cameras: { "main": (eye: (0.5, 1.7, 5.5), target: (6, 1.2, 0), fov: 65) })"#;

/// With photons that guide rays, on host and device, a picture has half the error at most.
fn photons_guide_rays_to_what_is_bright() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let [scene, made] = ["lamp.ron", "made.exr"].map(|name| folder.path().join(name).to_string_lossy().into_owned());
    std::fs::write(&scene, LAMP_AT_A_WALL).map_err(|e| e.to_string())?;
    let drawn = |sets: &[&str]| -> Result<Layers, Failed> {
        let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
        hemisplat(&[&["render", "irradiance", "--scene", &scene, "--size", "64x48", "--quiet", "-o", &made], &sets[..]].concat())?;
        picture(Path::new(&made))
    };
    let truth = drawn(&["tiles.resolution=256", "detail_tiles.resolution=256", "tiles.share=1", "detail_tiles.share=1"])?;
    let blind = apart(&drawn(&["tiles.share=1", "detail_tiles.share=1"])?, &truth, "irradiance")?;
    for place in ["Host", "Device"] {
        let ways = ["tiles", "detail_tiles"].map(|node| format!("{node}.place={place}"));
        let guided = apart(&drawn(&ways.each_ref().map(String::as_str))?, &truth, "irradiance")?;
        println!("{place}: {:.2} % for {:.2} %", 100.0 * guided, 100.0 * blind);
        if guided > 0.5 * blind {
            return Err(format!("{place}: {:.2} % of error guided, {:.2} % not", 100.0 * guided, 100.0 * blind).into());
        }
    }
    Ok(())
}

/// What `explain` calls without effect has none: not on one bit of the picture.
fn parameters_without_effect_have_none() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    for (pipeline, scene) in [("irradiance", "cornell"), ("irradiance", "hall"), ("irradiance", "teapot-noon"), ("radiance", "cornell-glossy")] {
        let told = hemisplat(&["explain", pipeline, "--scene", scene, "--size", "24x18", "--quiet"])?;
        let idle = told.lines().filter_map(|line| line.strip_prefix("no effect of ")?.split_once(',')).map(|(parameter, _)| parameter);
        let others = idle.map(|parameter| match OTHER_VALUES.iter().find(|(end, _)| parameter.ends_with(end)) {
            Some((_, value)) => Ok(format!("{parameter}={value}")),
            None => Err(Failed::from(format!("no other value is known for {parameter}"))),
        });
        let others = others.collect::<Result<Vec<_>, _>>()?;
        let drawn = |sets: &[&str]| -> Result<Layers, Failed> {
            let made = folder.path().join("made.exr");
            hemisplat(&[&["render", pipeline, "--scene", scene, "--size", "24x18", "--quiet", "-o", &made.to_string_lossy()], sets].concat())?;
            picture(&made)
        };
        let plain = drawn(&[])?.layers;
        let sets: Vec<&str> = others.iter().flat_map(|set| ["--set", set]).collect();
        if others.is_empty() || drawn(&sets)?.layers != plain {
            return Err(format!("{pipeline} of {scene} changes with {others:?}").into());
        }
    }
    Ok(())
}

// Mistakes on purpose

fn counts_may_not_grow() -> Outcome {
    let folder = tempfile::tempdir()?;
    let kept = folder.path().join("kept.json");
    let counts = |records, rounds, gpu_bytes| Counts { records, glossy_records: 0, rounds, gpu_bytes, adapter: "llvmpipe (LLVM)".into() };
    counts(1000, 40, 1_000_000).write(&kept)?;
    counts(1100, 46, 900_000).expect_at_most(&kept)?;
    for grown in [counts(1103, 40, 1_000_000), counts(1000, 47, 1_000_000), counts(1000, 40, 1_100_003)] {
        grown.expect_at_most(&kept).err().ok_or("a count that grew passes")?;
    }
    Ok(())
}

fn golden(name: &str) -> Result<Layers, Failed> {
    picture(&root().join("tests/golden").join(name).join("cornell.exr"))
}

/// The picture with its irradiance changed: red, green, blue by column and row.
fn changed(picture: &Layers, change: impl Fn([f32; 3], usize, usize) -> [f32; 3]) -> Result<Layers, Failed> {
    let [r, g, b] = picture.rgb("irradiance").map_err(|e| e.to_string())?;
    let width = picture.width as usize;
    let pixels: Vec<f32> = (0..r.len()).flat_map(|i| change([r[i], g[i], b[i]], i % width, i / width)).collect();
    Ok(picture.clone().with("irradiance", Layer::interleaved(&["R", "G", "B"], &pixels, 3)))
}

/// What a mistake makes of a picture: red, green, blue by column and row.
type Mistake<'a> = Box<dyn Fn([f32; 3], usize, usize) -> [f32; 3] + 'a>;

/// A record on the floor of twice its irradiance, alone in the middle of its reach [pixels], fading to the rim as its weight does.
fn doubled(reach: f32) -> Mistake<'static> {
    Box::new(move |colour, x, y| {
        let distance = (x as f32 - 24.0).hypot(y as f32 - 44.0);
        colour.map(|c| c * (1.0 + (1.0 - distance / reach).max(0.0)))
    })
}

fn small_mistakes_are_refused() -> Outcome {
    let right = golden("irradiance")?;
    expect_alike(&right, &right)?;
    let width = right.width as usize;
    let planes = right.rgb("irradiance").map_err(|e| e.to_string())?;
    let mistakes: [(&str, Mistake); 7] = [
        ("5 % too bright", Box::new(|colour, _, _| colour.map(|c| c * 1.05))),
        ("1 % too dark", Box::new(|colour, _, _| colour.map(|c| c * 0.99))),
        ("one record doubled, of 4 pixels", doubled(4.0)),
        ("one record doubled, of 3 pixels", doubled(3.0)),
        ("a pixel to the right", Box::new(|_, x, y| planes.map(|plane| plane[y * width + x.saturating_sub(1)]))),
        ("a wall's bleeding in the other's colour", Box::new(|[r, g, b], x, _| if x < width / 4 { [g, r, b] } else { [r, g, b] })),
        ("red and blue exchanged", Box::new(|[r, g, b], _, _| [b, g, r])),
    ];
    for (name, mistake) in mistakes {
        expect_alike(&changed(&right, mistake)?, &right).err().ok_or(format!("{name} passes"))?;
    }
    Ok(())
}

/// Of a hall with two lights: each layer by itself, and one light for the other.
fn small_mistakes_of_every_layer_are_refused() -> Outcome {
    let right = picture(&root().join("tests/golden/irradiance/hall.exr"))?;
    expect_all_alike(&right, &right, &HALL_LIMITS)?;
    let scaled = |layer: &str, by: f32| -> Result<Layers, Failed> {
        let mut wrong = right.clone();
        let planes = &mut wrong.layers.get_mut(layer).ok_or(format!("there is no {layer}"))?.channels;
        planes.values_mut().flatten().for_each(|value| *value *= by);
        Ok(wrong)
    };
    for layer in right.layers.keys() {
        let (by, limits) = match layer.as_str() {
            "weight" => (1.1, &LIMITS),
            "uncertainty" => (1.01, &HALL_LIMITS),
            _ => (1.02, &LIMITS),
        };
        for by in [by, 1.0 / by] {
            expect_all_alike(&scaled(layer, by)?, &right, limits).err().ok_or(format!("{layer} × {by} passes"))?;
        }
        let mut less = right.clone();
        less.layers.remove(layer);
        expect_all_alike(&less, &right, &LIMITS).err().ok_or(format!("no {layer} passes"))?;
    }
    Ok(())
}

/// With the plain measure in place of the cosine-weighted one a furnace is 1.17 π in place of π, of which the window holds
/// 0.83 π: what the border adds counts twice.
fn a_border_in_the_wrong_measure_is_refused() -> Outcome {
    let (right, open) = (golden("irradiance-plane")?, golden("irradiance-plane-open")?);
    let window = open.rgb("irradiance").map_err(|e| e.to_string())?;
    let twice = |colour: [f32; 3], x: usize, y: usize| {
        let seen = window.map(|plane| plane[y * open.width as usize + x]);
        std::array::from_fn(|c| colour[c] + (colour[c] - seen[c]))
    };
    expect_alike(&changed(&right, twice)?, &right).err().ok_or("it passes")?;
    Ok(())
}

/// Drawn with what a slip of the hand could make of a parameter.
fn wrong_parameters_are_refused() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let made = folder.path().join("made.exr");
    let right = golden("irradiance")?;
    for set in ["cache.accuracy=0.3", "records.gradients=false", "tiles.resolution=16", "cache.overlap=0", "tiles.shape=Plane"] {
        render("irradiance", &["--set", set], &made)?;
        expect_alike(&picture(&made)?, &right).err().ok_or(format!("{set} passes"))?;
    }
    Ok(())
}

/// The error of a layer against the truth, or against another picture.
fn apart(made: &Layers, truth: &Layers, layer: &str) -> Result<f64, Failed> {
    Ok(metrics(made, truth, layer)?.rmse_over_mean)
}

/// Projected and splatted on the device, on the host, and in double precision.
fn ways_of_glossy_light_agree() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let drawn = |name: &str| -> Result<Layers, Failed> {
        let made = folder.path().join("made.exr");
        render(name, &[], &made)?;
        picture(&made)
    };
    let right = drawn("radiance")?;
    for name in ["radiance-device", "radiance-blend", "radiance-readback", "radiance-half"] {
        let error = apart(&drawn(name)?, &right, "glossy")?;
        if error > 1e-3 {
            return Err(format!("{name} is {:.3} % from radiance", 100.0 * error).into());
        }
    }
    Ok(())
}

/// Rays of sharp lobes by host and device, beside a lobe that records reflect: each lobe is lit once, whether or not the sharp one has a table, too.
fn sharp_lobes_are_lit_alike() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let (scene, made) = (folder.path().join("metals.ron"), folder.path().join("made.exr"));
    std::fs::write(&scene, include_str!("../scenes/metal.ron").replace("roughness: 0.2", "roughness: 0.6"))?;
    let drawn = |set: &str| -> Result<Layers, Failed> {
        let [scene, into] = [&scene, &made].map(|path| path.to_string_lossy());
        hemisplat(&["render", "radiance", "--scene", &scene, "--size", "96x96", "--set", set, "--quiet", "-o", &into])?;
        picture(&made)
    };
    let right = drawn("sharp_light.place=Host")?;
    for (set, limit) in [("sharp_light.place=Device", 0.01), ("lobes.too_sharp=Blur", 1e-4)] {
        let error = apart(&drawn(set)?, &right, "glossy")?;
        if error > limit {
            return Err(format!("{set}: {:.3} % apart", 100.0 * error).into());
        }
    }
    Ok(())
}

/// Balls, whose pixels are seen by records of other normals: what these know, rotated in three ways, and the viewer moved instead. A rotation that is left out or
/// turns the wrong way is 12 % from the others and more.
fn ways_of_rotation_agree() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let drawn = |rotation: &str| -> Result<Layers, Failed> {
        let made = folder.path().join("made.exr");
        let set = format!("reflections.rotation={rotation}");
        let arguments = ["render", "radiance", "--scene", "balls", "--size", "120x100", "--set", "reflections.place=Host", "--set", &set, "--quiet", "-o"];
        hemisplat(&[&arguments[..], &[&made.to_string_lossy()]].concat())?;
        picture(&made)
    };
    let right = drawn("Conversion")?;
    for (rotation, limit) in ROTATIONS {
        let error = apart(&drawn(rotation)?, &right, "glossy")?;
        if error > limit {
            return Err(format!("{rotation} is {:.2} % from Conversion", 100.0 * error).into());
        }
    }
    Ok(())
}

/// Lobes of several orders in one picture, one of them turned around the normal: added by the host and by the device, tables made by either.
fn lobes_have_their_own_orders() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let [pair, host, device] = ["pair.ron", "host.exr", "device.exr"].map(|name| folder.path().join(name).to_string_lossy().into_owned());
    let text = "Scene(version: 1, geometry: [Sphere(centre: (-1.1, 1, 0), radius: 1, subdivisions: 3, material: \"broad\"),
        Sphere(centre: (1.1, 1, 0), radius: 1, subdivisions: 3, material: \"sharp\"),
        Quad(corners: ((-4, 0, -4), (-4, 0, 4), (4, 0, 4), (4, 0, -4)), material: \"floor\"), Quad(corners: ((-2, 3, -2), (-1, 3, -2), (-1, 3, -1), (-2, 3, -1)), material: \"lamp\")],
        materials: { \"broad\": Phong(reflectance: (0.2, 0.2, 0.2), specular: (0.6, 0.6, 0.6), exponent: 3), \"sharp\": MetallicRoughness(base: (0.9, 0.7, 0.3), metallic: 0.5, roughness: 0.6),
        \"floor\": Diffuse(reflectance: (0.5, 0.5, 0.5)), \"lamp\": Emitter(radiance: (30, 30, 30)) }, normals: Smooth(degrees: 40),
        cameras: { \"main\": (eye: (0, 2, 6), target: (0, 0.8, 0), fov: 36) })";
    std::fs::write(&pair, text).map_err(|e| e.to_string())?;
    let order = "lobes.order=Enough(lost:0.02,at_most:20)";
    for (scene, told, by) in [
        ("balls", "order 8 for gold and plastic, order 7 for phong, order 5 for brushed", "lobes.place=Host"),
        (&pair, "order 5 for sharp, order 3 for broad", "lobes.place=Device"),
    ] {
        let explained = hemisplat(&["explain", "radiance", "--scene", scene, "--set", order])?;
        let found: Vec<&str> = explained.lines().filter_map(|line| line.strip_prefix("remark lobes: ")).collect();
        if !found.contains(&told) {
            return Err(format!("{scene} is explained by {found:?}, not by {told:?}").into());
        }
        for (pipeline, by, made) in [("radiance", "lobes.place=Host", &host), ("radiance-device", by, &device)] {
            hemisplat(&["render", pipeline, "--scene", scene, "--size", "96x64", "--set", order, "--set", by, "--quiet", "-o", made])?;
        }
        let error = apart(&picture(Path::new(&device))?, &picture(Path::new(&host))?, "glossy")?;
        if error > 1e-3 {
            return Err(format!("{scene}: the device's is {:.3} % from the host's", 100.0 * error).into());
        }
    }
    Ok(())
}

/// What tiles see, lit by each kind of punctual light with maps for a cube, for a cone and for all of the scene, or without; smooth and one-sided
/// surfaces, and holes in a texture.
fn shading_by_host_and_device_agrees() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let [scene, host, device, checks] =
        ["lights.ron", "host.exr", "device.exr", "checks.png"].map(|name| folder.path().join(name).to_string_lossy().into_owned());
    let text = "Scene(version: 1, geometry: [Sphere(centre: (0, 1, 0), radius: 1, subdivisions: 3, material: \"ball\"), File(\"lace.obj\"),
        Quad(corners: ((-4, 0, -4), (-4, 0, 4), (4, 0, 4), (4, 0, -4)), material: \"floor\"), Quad(corners: ((-4, 0, -2), (4, 0, -2), (4, 4, -2), (-4, 4, -2)), material: \"wall\")],
        materials: { \"ball\": Diffuse(reflectance: (0.8, 0.7, 0.2)), \"floor\": Diffuse(reflectance: (0.5, 0.5, 0.5)), \"wall\": Diffuse(reflectance: (0.3, 0.4, 0.7)) },
        normals: Smooth(degrees: 40),
        lights: [Point(position: (-2, 3, 2), intensity: (30, 28, 25)), Spot(position: (3, 3, 1), direction: (-1, -1, -0.3), intensity: (40, 20, 20), inner: 10, outer: 30),
            Spot(position: (2, 3, 2), direction: (-1, -1, -1), intensity: (5, 9, 5), inner: 20, outer: 80), Directional(direction: (1, -3, -1), irradiance: (2, 2, 1.8)),
            Point(position: (0, 3.5, -1), intensity: (3, 3, 9), shadows: false)],
        cameras: { \"main\": (eye: (0, 2, 6), target: (0, 0.8, 0), fov: 36) })";
    let lace = "mtllib lace.mtl\nv -1.8 0 1\nv -0.8 0 1\nv -0.8 2 0.5\nv -1.8 2 0.5\nvt 0 0\nvt 3 0\nvt 3 6\nvt 0 6\nusemtl lace\nf 1/1 2/2 3/3 4/4\n";
    let pixels = image::RgbaImage::from_fn(8, 8, |x, y| image::Rgba([255, 40 * (x as u8 % 4), 200, if (x + y) % 2 == 0 { 255 } else { 0 }]));
    pixels.save(&checks).map_err(|e| e.to_string())?;
    for (name, text) in [("lights.ron", text), ("lace.obj", lace), ("lace.mtl", "newmtl lace\nKd 0.9 0.9 0.9\nmap_Kd checks.png\nmap_d checks.png\n")] {
        std::fs::write(folder.path().join(name), text).map_err(|e| e.to_string())?;
    }
    for taps in ["tiles.taps=1", "tiles.taps=9"] {
        for (way, made) in [("Host", &host), ("Device", &device)] {
            let ways = ["--set", taps, "--set", "tiles.quality=1e6", "--set", &format!("tiles.place={way}")];
            hemisplat(&[&["render", "irradiance", "--scene", &scene, "--size", "96x64", "--quiet", "-o", made][..], &ways].concat())?;
        }
        let error = apart(&picture(Path::new(&host))?, &picture(Path::new(&device))?, "irradiance")?;
        // A tap that rounding puts into the next texel is one of thousands.
        if error > 5e-4 {
            return Err(format!("{taps}: the host's is {:.3} % from the device's", 100.0 * error).into());
        }
    }
    Ok(())
}

/// What tiles see, lit by lamps, a sky and punctual lights together, of glossy things with and without their lobes; where the direct pass lights from emitters, and
/// where records see them.
fn shading_of_lamps_skies_and_lobes_by_host_and_device_agrees() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let [host, device] = ["host.exr", "device.exr"].map(|name| folder.path().join(name).to_string_lossy().into_owned());
    let scene = root().join("tests/places/kinds.ron").to_string_lossy().into_owned();
    for (pipeline, emitters, layers) in [
        ("irradiance-one-rate", "Sampled", &["irradiance"][..]),
        ("irradiance-one-rate", "Records", &["irradiance"]),
        ("radiance", "Sampled", &["irradiance", "glossy"]),
        ("radiance", "Records", &["irradiance", "glossy"]),
    ] {
        for (way, made) in [("Host", &host), ("Device", &device)] {
            let emitters = format!("direct.emitters={emitters}");
            let nodes: &[&str] = if pipeline == "radiance" { &["tiles", "detail_tiles", "glossy_tiles"] } else { &["tiles"] };
            // One ray a stratum: places on the host share what they know of where more are worth while.
            let unguided = nodes.iter().filter(|node| !node.starts_with("glossy")).flat_map(|node| [format!("{node}.share=1"), format!("{node}.quality=1e6")]);
            let ways: Vec<String> = nodes.iter().map(|node| format!("{node}.place={way}")).chain(unguided).chain([emitters]).collect();
            let sets: Vec<&str> = ways.iter().flat_map(|way| ["--set", way]).collect();
            hemisplat(&[&["render", pipeline, "--scene", &scene, "--size", "64x48", "--quiet", "-o", made], &sets[..]].concat())?;
        }
        for layer in layers {
            let error = apart(&picture(Path::new(&host))?, &picture(Path::new(&device))?, layer)?;
            // A shadow ray along an edge is one of thousands.
            if error > 2e-3 {
                return Err(format!("{pipeline}, emitters {emitters}: {layer} of the host is {:.3} % from the device's", 100.0 * error).into());
            }
        }
    }
    Ok(())
}

/// Lamps, a sky, and lobes that look for it, each with other numbers of rays than make whole packets.
fn light_by_host_and_device_agrees() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let [pipeline, ball, host, device] =
        ["direct.ron", "ball.ron", "host.exr", "device.exr"].map(|name| folder.path().join(name).to_string_lossy().into_owned());
    let text = "Pipeline(version: 1, about: \"direct light\", outputs: { \"direct\": \"direct\" }, nodes: [
        (name: \"gbuffer\", pass: GBuffer()), (name: \"direct\", pass: DirectLight(gbuffer: \"gbuffer\"))])";
    std::fs::write(&pipeline, text).map_err(|e| e.to_string())?;
    let brushed = "Scene(version: 1, geometry: [Sphere(centre: (0, 1, 0), radius: 1, subdivisions: 4, material: \"ball\"),
        Quad(corners: ((-4, 0, -4), (-4, 0, 4), (4, 0, 4), (4, 0, -4)), material: \"floor\"), Quad(corners: ((-2, 3, -2), (-1, 3, -2), (-1, 3, -1), (-2, 3, -1)), material: \"lamp\")],
        materials: { \"ball\": Ward(reflectance: (0.1, 0.1, 0.1), specular: (0.7, 0.7, 0.8), alpha: (0.1, 0.6)), \"floor\": Diffuse(reflectance: (0.5, 0.5, 0.5)),
        \"lamp\": Emitter(radiance: (9, 9, 9)) }, normals: Smooth(degrees: 40), environment: Clear(sun: (azimuth: 60, elevation: 35), turbidity: 3),
        cameras: { \"main\": (eye: (0, 2, 6), target: (0, 0.8, 0), fov: 36) })";
    std::fs::write(&ball, brushed).map_err(|e| e.to_string())?;
    let sunny = folder.path().join("sunny.ron").to_string_lossy().into_owned();
    std::fs::write(&sunny, brushed.replace("Clear(sun: (azimuth: 60, elevation: 35), turbidity: 3)", "LatLong(file: \"sky.hdr\")"))
        .map_err(|e| e.to_string())?;
    sky_with_a_sun(&folder.path().join("sky.hdr"), [256, 128], [0.5, 0.7, 1.0])?;
    for (scene, sets) in [
        ("cornell-glossy", ["direct.emitters.area_samples=33", "direct.emitters.sky_samples=1"]),
        ("balls", ["direct.emitters.area_samples=64", "direct.emitters.sky_samples=70"]),
        (&ball, ["direct.emitters.area_samples=65", "direct.emitters.sky_samples=33"]),
        (&sunny, ["direct.emitters.area_samples=8", "direct.emitters.sky_samples=32"]),
    ] {
        for (way, made) in [("Host", &host), ("Device", &device)] {
            let way = format!("direct.place={way}");
            hemisplat(&["render", &pipeline, "--scene", scene, "--size", "96x64", "--set", sets[0], "--set", sets[1], "--set", &way, "--quiet", "-o", made])?;
        }
        let error = apart(&picture(Path::new(&host))?, &picture(Path::new(&device))?, "direct")?;
        // Whether a ray along an edge meets it is for either to say.
        if error > 5e-3 {
            return Err(format!("{scene}: the host's is {:.3} % from the device's", 100.0 * error).into());
        }
    }
    Ok(())
}

/// The texel of a sky that is its sun, and how bright it is [W m⁻² sr⁻¹].
const SUN: ([u32; 2], f32) = ([180, 40], 65_536.0);

/// A sky of one colour with a sun of one texel.
fn sky_with_a_sun(path: &Path, [width, height]: [u32; 2], sky: [f32; 3]) -> Outcome {
    let texel = |x: u32, y: u32| if [x, y] == [SUN.0[0] * width / 256, SUN.0[1] * height / 128] { [SUN.1; 3] } else { sky };
    let shared = |[red, green, blue]: [f32; 3]| {
        let exponent = red.max(green).max(blue).log2().floor() + 1.0;
        let byte = |value: f32| (value / 2f32.powf(exponent) * 256.0) as u8;
        [byte(red), byte(green), byte(blue), (exponent + 128.0) as u8]
    };
    let mut file = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    file.extend((0..height).flat_map(|y| (0..width).map(move |x| [x, y])).flat_map(|[x, y]| shared(texel(x, y))));
    std::fs::write(path, file).map_err(|e| e.to_string().into())
}

/// The sun of a sky lights a scene as a directional light does of its irradiance, directly and by way of what it shines on.
fn a_sun_in_a_sky_is_as_a_light_of_its_own() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let [by_sky, by_light, made, other] = ["sky.ron", "light.ron", "sky.exr", "light.exr"].map(|name| folder.path().join(name).to_string_lossy().into_owned());
    let (width, height) = (1024u32, 512u32);
    sky_with_a_sun(&folder.path().join("sky.hdr"), [width, height], [0.5; 3])?;
    let [column, row] = [SUN.0[0] * width / 256, SUN.0[1] * height / 128].map(|at| f64::from(at) + 0.5);
    let (azimuth, polar) = ((column / f64::from(width) - 0.5) * std::f64::consts::TAU, row / f64::from(height) * std::f64::consts::PI);
    let toward = [polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos()].map(|way| -way);
    let irradiance = f64::from(SUN.1 - 0.5) * (std::f64::consts::TAU / f64::from(width)) * (std::f64::consts::PI / f64::from(height)) * polar.sin();
    let room = "Scene(version: 1, geometry: [Quad(corners: ((-4, 0, -4), (-4, 0, 4), (4, 0, 4), (4, 0, -4))), Box(min: (-1, 0, -1), max: (0.5, 1.5, 0.5)),
        Quad(corners: ((-4, 0, -3), (4, 0, -3), (4, 3, -3), (-4, 3, -3)))], materials: { \"*\": Diffuse(reflectance: (0.6, 0.6, 0.6)) }, normals: Face,
        cameras: { \"main\": (eye: (1, 2, 6), target: (0, 0.8, 0), fov: 50) }, ";
    let sun = format!(
        "lights: [Directional(direction: ({}, {}, {}), irradiance: ({irradiance}, {irradiance}, {irradiance}))], environment: Constant((0.5, 0.5, 0.5)))",
        toward[0], toward[1], toward[2]
    );
    std::fs::write(&by_sky, format!("{room} environment: LatLong(file: \"sky.hdr\"))")).map_err(|e| e.to_string())?;
    std::fs::write(&by_light, format!("{room} {sun}")).map_err(|e| e.to_string())?;
    for way in ["Host", "Device"] {
        let place =
            ["--set", &format!("direct.place={way}"), "--set", &format!("tiles.place={way}"), "--set", &format!("detail_tiles.place={way}")].map(str::to_owned);
        for (scene, made) in [(&by_sky, &made), (&by_light, &other)] {
            let place: Vec<&str> = place.iter().map(String::as_str).collect();
            hemisplat(&[&["render", "irradiance", "--scene", scene, "--size", "96x64", "--quiet", "-o", made], &place[..]].concat())?;
        }
        // The sun of the sky is a texel wide: its shadows are soft.
        for (layer, limit) in [("direct", 0.05), ("irradiance", 0.03)] {
            let found = metrics(&picture(Path::new(&made))?, &picture(Path::new(&other))?, layer)?;
            if found.rmse_over_mean > limit || found.bias_over_mean.abs() > 0.01 {
                let [error, bias] = [found.rmse_over_mean, found.bias_over_mean].map(|share| 100.0 * share);
                return Err(format!("by the {way}, {layer} is {error:.2} % from that of a directional light, {bias:.2} % in the mean").into());
            }
        }
    }
    Ok(())
}

/// A ball, which hides nothing of the sky from itself: what harmonics make of the sky is what the path tracer finds, whoever turns them.
fn skies_by_harmonics_are_those_of_the_reference() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let [made, truth, scene] = ["made.exr", "truth.exr", "ball.ron"].map(|name| folder.path().join(name).to_string_lossy().into_owned());
    for material in [
        "Diffuse(reflectance: (0.6, 0.4, 0.2))",
        "Phong(reflectance: (0.2, 0.2, 0.2), specular: (0.7, 0.7, 0.7), exponent: 20)",
        "Ward(reflectance: (0.1, 0.1, 0.1), specular: (0.7, 0.7, 0.8), alpha: (0.3, 0.6))",
        "MetallicRoughness(base: (0.1, 0.25, 0.6), metallic: 0, roughness: 0.6)",
    ] {
        let text = format!(
            "Scene(version: 1, geometry: [Sphere(centre: (0, 0, 0), radius: 1, subdivisions: 4, material: \"ball\")], materials: {{ \"ball\": {material} }}, \
             normals: Smooth(degrees: 40), environment: Clear(sun: (azimuth: 60, elevation: 35), turbidity: 3), cameras: {{ \"main\": (eye: (0, 1, 5), target: (0, 0, 0), fov: 26) }})"
        );
        std::fs::write(&scene, text).map_err(|e| e.to_string())?;
        let of = ["--scene", &scene, "--size", "32x32", "--quiet"];
        hemisplat(&[&["reference", "--spp", "1024", "-o", &truth][..], &of].concat())?;
        for (pipeline, way) in [("environment", "Host"), ("environment", "Device"), ("environment-spherical", "Host")] {
            hemisplat(&[&["render", pipeline, "--set", &format!("sky.place={way}"), "-o", &made][..], &of].concat())?;
            let errors = metrics(&picture(Path::new(&made))?, &picture(Path::new(&truth))?, "direct")?;
            if errors.rmse_over_mean > 0.03 || errors.bias_over_mean.abs() > 0.005 {
                return Err(
                    format!("{pipeline} by {way}, {material}: {:.2} %, bias {:.2} %", 100.0 * errors.rmse_over_mean, 100.0 * errors.bias_over_mean).into()
                );
            }
        }
    }
    Ok(())
}

/// Balls of every kind of lobe, curved and smooth: the light that the device computes is what the path tracer finds.
fn lobes_on_the_device_are_those_of_the_reference() -> Outcome {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let [made, truth] = ["made.exr", "truth.exr"].map(|name| folder.path().join(name).to_string_lossy().into_owned());
    let scene = ["--scene", "balls", "--size", "160x90", "--quiet"];
    hemisplat(&[&["reference", "--spp", "1024", "--stride", "2", "-o", &truth][..], &scene].concat())?;
    hemisplat(&[&["render", "radiance", "--set", "direct.place=Device", "--set", "glossy_cache.minimum_spacing=3", "-o", &made][..], &scene].concat())?;
    let (made, truth) = (picture(Path::new(&made))?, picture(Path::new(&truth))?);
    // Edges of shadows and of balls; a lobe twice as wide, or around another direction, is 30 % and more.
    for (layer, limit) in [("direct", 0.08), ("glossy", 0.12), (PICTURE, 0.08)] {
        let error = apart(&made, &truth, layer)?;
        let bias = metrics(&made, &truth, layer)?.bias_over_mean;
        if error > limit || bias.abs() > 0.04 {
            return Err(format!("{layer}: {:.2} % from the truth, {:.2} % of bias", 100.0 * error, 100.0 * bias).into());
        }
    }
    Ok(())
}

fn main() {
    let missing = Missing::gpu();
    let drawn = |name: &str, test: Box<dyn FnOnce() -> Outcome + Send>| skips::trial(name, missing.as_ref(), test);
    let mut trials = vec![
        Trial::test("small_mistakes_are_refused", small_mistakes_are_refused),
        Trial::test("a_border_in_the_wrong_measure_is_refused", a_border_in_the_wrong_measure_is_refused),
        Trial::test("small_mistakes_of_every_layer_are_refused", small_mistakes_of_every_layer_are_refused),
        Trial::test("counts_may_not_grow_by_a_tenth", counts_may_not_grow),
        skips::short_or_long("ways_of_rotation_agree", true, missing.as_ref(), ways_of_rotation_agree),
        drawn("pictures_repeat_to_the_bit", Box::new(pictures_repeat_to_the_bit)),
        drawn("specialisation_changes_no_picture", Box::new(specialisation_changes_no_picture)),
        drawn("parameters_without_effect_have_none", Box::new(parameters_without_effect_have_none)),
        drawn("photons_guide_rays_to_what_is_bright", Box::new(photons_guide_rays_to_what_is_bright)),
        drawn("wrong_parameters_are_refused", Box::new(wrong_parameters_are_refused)),
        drawn("ways_of_glossy_light_agree", Box::new(ways_of_glossy_light_agree)),
        drawn("sharp_lobes_are_lit_alike", Box::new(sharp_lobes_are_lit_alike)),
        drawn("lobes_have_their_own_orders", Box::new(lobes_have_their_own_orders)),
        drawn("shading_by_host_and_device_agrees", Box::new(shading_by_host_and_device_agrees)),
        drawn("shading_of_lamps_skies_and_lobes_by_host_and_device_agrees", Box::new(shading_of_lamps_skies_and_lobes_by_host_and_device_agrees)),
        drawn("light_by_host_and_device_agrees", Box::new(light_by_host_and_device_agrees)),
        drawn("a_sun_in_a_sky_is_as_a_light_of_its_own", Box::new(a_sun_in_a_sky_is_as_a_light_of_its_own)),
        drawn("skies_by_harmonics_are_those_of_the_reference", Box::new(skies_by_harmonics_are_those_of_the_reference)),
        drawn("lobes_on_the_device_are_those_of_the_reference", Box::new(lobes_on_the_device_are_those_of_the_reference)),
    ];
    let goldens = goldens();
    trials.extend(goldens.iter().cloned().map(|golden| drawn(&golden.name(), Box::new(move || check(&golden)))));
    let (swiftshader, missing_driver) = swiftshader();
    trials.extend(goldens.iter().filter(|golden| golden.is_small()).cloned().enumerate().map(|(number, golden)| {
        let golden = Golden { driver: swiftshader.clone(), ..golden };
        let is_long = number % 4 != 0 && golden.pipeline.contains('-');
        skips::short_or_long(format!("{} on SwiftShader", golden.name()), is_long, missing_driver.as_ref(), move || check(&golden))
    }));
    let list = broken::list(root()).unwrap_or_else(|failed| panic!("{}", failed.message().unwrap_or_default()));
    trials.extend(list.iter().map(|broken| notices(broken, &goldens, missing.as_ref())));
    trials.push(Trial::test("what_is_broken_fits_and_is_told", move || what_is_broken_fits_and_is_told(&list, &goldens)));
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

/// The file of a second driver, which grants hardly more than WebGPU does, or why there is none. It comes with Chromium.
fn swiftshader() -> (Option<PathBuf>, Option<Missing>) {
    let folders = ["/usr/lib/chromium", "/usr/lib/chromium-browser", "/opt/google/chrome"];
    let found = folders.into_iter().map(|folder| Path::new(folder).join("vk_swiftshader_icd.json")).find(|file| file.exists());
    let missing = found.is_none().then(|| Missing::new("browser", "no Chromium, which brings SwiftShader"));
    (found, missing)
}

/// All pictures that are kept.
fn goldens() -> Vec<Golden> {
    let names = pipelines().into_iter().map(|pipeline| pipeline.file_stem().unwrap_or_default().to_string_lossy().into_owned());
    let large = LARGE.map(|(pipeline, sets, scene, size, like)| Golden {
        pipeline: pipeline.into(),
        sets,
        scene,
        size,
        like: like.into(),
        shaders: None,
        driver: None,
    });
    names.map(|name| Golden::small(&name)).chain(large).collect()
}

/// Whether a mistake is noticed. Debug builds alone read shaders from a folder.
fn notices(broken: &Broken, goldens: &[Golden], missing: Option<&Missing>) -> Trial {
    let name = format!("broken: {}", broken.what);
    let (broken, golden) = (broken.clone(), goldens.iter().find(|golden| golden.name() == broken.falls).cloned());
    let is_quick = broken.always && broken.is_shader() && cfg!(debug_assertions);
    let is_of_large = golden.as_ref().is_some_and(|golden| ["hall", "balls"].contains(&golden.scene));
    let is_drawn_anew = block_on(hemisplat::gpu::device::adapters()).first().is_some_and(|adapter| !has_drawn(&adapter.name));
    let other = (is_of_large && is_drawn_anew).then(|| Missing::new("adapter", "limits that notice this hold where the kept pictures were drawn"));
    let missing = missing.or(other.as_ref());
    let test = move || match golden {
        _ if !broken.is_shader() => broken.falls_in_a_copy(root()),
        None => broken.falls_with_shaders(root()),
        Some(golden) => {
            let shaders = broken.shaders(root())?;
            let fallen = check(&Golden { shaders: Some(shaders.path().to_owned()), ..golden });
            let failed = fallen.err().ok_or(format!("{} does not notice", broken.falls))?;
            println!("{}: {}", broken.what, failed.message().unwrap_or_default());
            Ok(())
        }
    };
    skips::short_or_long(name, !is_quick, missing, test)
}

/// Each mistake can be made, falls to a picture that is kept or to another test, and stands in the book.
fn what_is_broken_fits_and_is_told(list: &[Broken], goldens: &[Golden]) -> Outcome {
    for broken in list {
        broken.text(root())?;
        if broken.falls_to_a_picture() && !goldens.iter().any(|golden| golden.name() == broken.falls) {
            return Err(format!("{}: there is no golden picture {}", broken.what, broken.falls).into());
        }
    }
    let table = broken::table(list);
    let page = std::fs::read_to_string(root().join("docs/guards.md"))?;
    if page.contains(&table) { Ok(()) } else { Err(format!("docs/guards.md should hold this table:\n{table}").into()) }
}
