//! The reference that pictures are judged by: a file that the user gives, or one traced here and kept for the next time.
//!
//! A kept reference is an EXR file as `hemisplat reference` writes it, sealed by its checksum. Its name is made from everything that it depends on. Several processes may write the same one at once: it appears whole.

use super::console::Console;
use super::failure::{CommandError, Failure};
use super::given::{JUDGED, only};
use super::input::{NamedFile, read_picture};
use super::interrupt;
use super::output::Target;
use super::pipeline::judged_bounces;
use super::progress::Progress;
use super::scene::View;
use super::sealed::{self, Unusable};
use crate::gpu::scene::{OF_PICTURE, camera};
use crate::math::windows::SIDE;
use crate::measure::cache::{Checksum, fingerprint};
use crate::measure::compare::{ErrorParts, ReferenceReport, VariantErrors, checksum, judged};
use crate::measure::metrics::{SCENE_CHECKSUM, other_view};
use crate::measure::projection::Projection;
use crate::measure::{DIRECT, Errors, GLOSSY, IRRADIANCE, Layer, Layers, MetricsError, PICTURE, PictureError, compare};
use crate::pipeline::Plan;
use crate::reference::{Bounces, MAX_SAMPLES, Pixels, Settings, Stop, VERSION, check, render};
use clap::{ArgGroup, Args};
use etcetera::BaseStrategy;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The noise down to which a reference is traced where nobody says: a third of the smallest `rmse_over_mean` that the pipelines of this project usually
/// have, and less than the difference of 5 % of it that runs are recommended for, once some thousand pixels average it.
const ENOUGH: f32 = 0.01;

/// Paths that such a reference may take, over all pixels: about a minute on two cores in a room.
const MOST_PATHS: u64 = 1 << 26;

/// Rays a pixel that it takes at the least, however large the picture is.
const FEWEST_RAYS: u32 = 32;

/// The options that name pictures to read.
pub const FILES: &str = "files";

#[derive(Args)]
#[command(group = ArgGroup::new(FILES).multiple(true))]
pub struct TruthOptions {
    /// What to judge the pictures by, and what its layer is if that has no name; if not given, it is traced and kept for the next time
    #[arg(long, group = FILES, value_name = "FILE.exr[:LAYER]", value_parser = |text: &str| Ok::<_, std::convert::Infallible>(NamedFile::parse(text)))]
    reference: Option<NamedFile>,
    /// The variance of the reference's irradiance; the reference's own if not given
    #[arg(long, value_name = "FILE", requires = "reference")]
    reference_variance: Option<PathBuf>,
    /// Take files that say that they show another scene, camera or light
    #[arg(long, requires = FILES)]
    pub anyway: bool,
    /// Measure times alone
    #[arg(long, conflicts_with = "reference")]
    no_reference: bool,
    /// Trace a reference until its noise is this share of its mean; 0.01 if nothing is said, with at most 2^26 paths in all
    #[arg(long, value_name = "E", conflicts_with_all = ["reference", "no_reference", "reference_spp"])]
    reference_error: Option<f32>,
    /// Trace a reference of so many rays per pixel
    #[arg(long, value_name = "N", conflicts_with_all = ["reference", "no_reference"])]
    reference_spp: Option<u32>,
    /// Trace only every K-th pixel of each row and column; without every pixel there is no `flip` and no `band_error`
    #[arg(long, value_name = "K", default_value_t = 1, conflicts_with_all = ["reference", "no_reference"])]
    reference_stride: u32,
    /// Trace only N squares of 64×64 pixels, spread over the picture, at full resolution: errors of all kinds at the cost of a stride
    #[arg(long, value_name = "N", conflicts_with_all = ["reference", "no_reference", "reference_stride"])]
    reference_windows: Option<u32>,
    /// How many bounces of indirect light the reference holds, N or `all`: what a pipeline leaves out of them counts as its error; those that the pipelines make if not given
    #[arg(long, value_name = "N", conflicts_with = "no_reference")]
    bounces: Option<Bounces>,
    /// Where references that are traced are kept; the user's cache folder if not given
    #[arg(long, value_name = "DIR", conflicts_with_all = ["reference", "no_reference"])]
    reference_cache: Option<PathBuf>,
}

/// A reference whose size and bounces fit the pictures that it is to judge.
pub struct Truth {
    path: PathBuf,
    /// Whether it stands there: not where the disk was full.
    is_kept: bool,
    picture: Layers,
    variance: Option<Layers>,
    own: bool,
    bounces: Judged,
}

/// A truth of fewer bounces than the reference's, and what it lacks of those.
pub struct Shorter {
    truth: Truth,
    left_out: VariantErrors,
}

impl Shorter {
    fn new(truth: Truth, whole: &Truth) -> Result<Self, Failure> {
        Ok(Self { left_out: whole.judge(truth.picture.clone())?, truth })
    }

    /// Of each of these that the truth is longer than.
    pub fn all(keepers: &[Keeper], whole: Option<&Truth>, view: &View, console: &Console) -> Result<Vec<Self>, Failure> {
        let Some(whole) = whole else { return Ok(Vec::new()) };
        keepers.iter().map(|keeper| Self::new(keeper.obtain(view, console)?, whole)).collect()
    }

    /// The error of a plan's picture in two parts, if one of these holds as many bounces as the plan makes.
    pub fn parts(all: &[Self], plan: &Plan, picture: &Layers) -> Result<Option<ErrorParts>, Failure> {
        let Some(own) = all.iter().find(|shorter| shorter.truth.bounces() == judged_bounces(plan)) else { return Ok(None) };
        let bounces = own.truth.bounces().to_string();
        Ok(Some(ErrorParts { bounces, left_out: own.left_out.clone(), method: own.truth.judge(picture.clone())? }))
    }

    /// Everything that numbers by it depend on.
    pub fn content(&self) -> String {
        self.truth.content()
    }
}

/// What a reference holds, and judges.
#[derive(Clone, Copy)]
pub struct Judged {
    bounces: Bounces,
    /// Whether pictures of any bounces are judged by it.
    any: bool,
    /// Whether a picture without light has no errors, in place of one that tells so.
    may_be_dark: bool,
}

impl Judged {
    /// For the frames of a sequence, some of which may have no light.
    pub fn of_frames(self) -> Self {
        Self { may_be_dark: true, ..self }
    }
}

impl TruthOptions {
    /// A reference that is traced; `cache` is where it is kept, the user's cache folder if not given.
    pub fn traced(spp: u32, pixels: Pixels, cache: Option<PathBuf>) -> Self {
        let (stride, windows) = match pixels {
            Pixels::Every(stride) => (stride, None),
            Pixels::Windows(count) => (1, Some(count)),
        };
        let own = Self { reference_spp: Some(spp), reference_stride: stride, reference_windows: windows, reference_cache: cache, ..Self::none() };
        Self { no_reference: false, ..own }
    }

    /// No reference from outside.
    pub fn none() -> Self {
        Self {
            reference: None,
            reference_variance: None,
            anyway: false,
            no_reference: true,
            reference_error: None,
            reference_spp: None,
            reference_stride: 1,
            reference_windows: None,
            bounces: None,
            reference_cache: None,
        }
    }

    /// The files that are read.
    pub fn files(&self) -> Vec<&Path> {
        self.reference.iter().map(|named| &named.path).chain(&self.reference_variance).map(PathBuf::as_path).collect()
    }

    /// What pictures of these plans are judged by: the bounces that are asked for, or that all plans make.
    ///
    /// # Errors
    /// Where plans make different ones and none are asked for.
    pub fn judged<'p>(&self, plans: impl Iterator<Item = &'p Arc<Plan>>) -> Result<Judged, Failure> {
        if let Some(bounces) = self.bounces {
            return Ok(Judged { bounces, any: true, may_be_dark: false });
        }
        let mut made: Vec<Bounces> = Vec::new();
        plans.filter(|_| !self.no_reference).for_each(|plan| made.extend(Some(judged_bounces(plan)).filter(|bounces| !made.contains(bounces))));
        match made[..] {
            [] => Ok(Judged { bounces: Bounces::Count(1), any: false, may_be_dark: false }),
            [bounces] => Ok(Judged { bounces, any: false, may_be_dark: false }),
            _ => Err(Failure::input(CommandError::SeveralBounces { made: made.iter().map(Bounces::to_string).collect::<Vec<_>>().join(", ") })),
        }
    }

    /// Reads what the user gives; None where it is to be traced, or none is wanted.
    pub fn given(&self, view: &View, bounces: Judged) -> Result<Option<Truth>, Failure> {
        let Some(named) = &self.reference else { return Ok(None) };
        let picture = named.read()?;
        named.expect_meaning(&picture)?;
        let picture = only(picture, named.layer.as_deref());
        let variance = self.reference_variance.as_deref().map(read_picture).transpose()?;
        let truth = Truth { picture, variance, path: named.path.clone(), is_kept: true, own: false, bounces };
        if !self.anyway {
            expect_shown(view, &truth.picture, &truth.path)?;
        }
        truth.fits(view)?;
        Ok(Some(truth))
    }

    /// Whether a reference has to be traced where none is given; then there is a place to keep it.
    pub fn keeper(&self, view: &View, judged: Judged) -> Result<Option<Keeper>, Failure> {
        if self.reference.is_some() || self.no_reference {
            return Ok(None);
        }
        let folder = self.reference_cache.clone().or_else(cache_folder).ok_or_else(|| Failure::input(CommandError::NoReferenceCache))?;
        let stop = self.stop(view);
        let pixels = self.reference_windows.map_or(Pixels::Every(self.reference_stride), Pixels::Windows);
        let settings = Settings { size: view.size, pixels, bounces: judged.bounces, stop, seed: 0 };
        check(&view.camera, &settings).map_err(Failure::input)?;
        let key = key(view, &settings);
        let target = Target::probed(&folder.join(format!("reference-{}.exr", Checksum::of(key.as_bytes()))));
        let target = target.map_err(|source| Failure::work(CommandError::UnusableCache { folder, source }))?;
        Ok(Some(Keeper { target, settings, key, judged }))
    }

    /// What tells the error of a method from that of the bounces which it leaves out: the truth of each number of bounces that plans make and that is less than
    /// asked for. None where the reference is read from a file, of which there is no other.
    pub fn shorter_keepers<'p>(&self, view: &View, plans: impl Iterator<Item = &'p Arc<Plan>>, judged: Judged) -> Result<Vec<Keeper>, Failure> {
        let mut made: Vec<Bounces> = Vec::new();
        plans.map(|plan| judged_bounces(plan)).filter(|bounces| bounces.are_fewer_than(judged.bounces)).for_each(|bounces| {
            made.extend(Some(bounces).filter(|bounces| !made.contains(bounces)));
        });
        let keepers = made.into_iter().map(|bounces| self.keeper(view, Judged { bounces, any: true, ..judged }));
        keepers.filter_map(Result::transpose).collect()
    }

    fn stop(&self, view: &View) -> Stop {
        match (self.reference_spp, self.reference_error) {
            (Some(rays), _) => Stop::Samples(rays),
            (None, Some(error)) => Stop::RelativeError { error, at_most: MAX_SAMPLES },
            (None, None) => {
                let [columns, rows] = view.size.map(|side| u64::from(side.div_ceil(self.reference_stride.max(1)).max(1)));
                let pixels = self.reference_windows.map_or(columns * rows, |count| (u64::from(count) * u64::from(SIDE * SIDE)).max(1));
                let at_most = (MOST_PATHS / pixels).clamp(u64::from(FEWEST_RAYS), u64::from(MAX_SAMPLES)) as u32;
                Stop::RelativeError { error: ENOUGH, at_most }
            }
        }
    }
}

/// Where the user's system keeps what programs can make again.
pub fn cache_folder() -> Option<PathBuf> {
    etcetera::choose_base_strategy().ok().map(|folders| folders.cache_dir().join("hemisplat"))
}

/// Refuses a picture that says that it shows another scene, camera or light.
pub fn expect_shown(view: &View, picture: &Layers, path: &Path) -> Result<(), Failure> {
    let own = Layers { projection: Some(Projection::of(&view.camera, view.stage.scene.origin, view.size)), ..Layers::default() }
        .with_attribute("scene", &view.stage.scene.name)
        .with_attribute(SCENE_CHECKSUM, fingerprint(&view.stage.scene))
        .with_attribute("camera", &view.camera.name);
    let differences = other_view(&own, picture);
    if differences.is_empty() {
        return Ok(());
    }
    let test = "what is compared".to_owned();
    Err(Failure::input(CommandError::OtherView { reference: path.to_owned(), test, differences }))
}

/// Everything that a reference depends on.
fn key(view: &View, settings: &Settings) -> String {
    let Settings { pixels, bounces, seed, stop, .. } = settings;
    let stop = match stop {
        Stop::Samples(rays) => format!("spp {rays}"),
        Stop::RelativeError { error, at_most } => format!("error {error} at most {at_most}"),
    };
    format!("tracer {VERSION}, {}, {pixels}, bounces {bounces}, {stop}, seed {seed}", content(view))
}

/// What a view shows, whatever its files are called: scene, camera and size.
pub fn content(view: &View) -> String {
    let [width, height] = view.size;
    let camera = Checksum::of(&bytemuck::bytes_of(&camera((&view.camera, &view.camera), view.size, &view.stage, 0))[..OF_PICTURE]);
    let scene = fingerprint(&view.stage.scene);
    format!("scene {scene}, camera {camera}, size {width}x{height}")
}

/// Where a reference is kept, and how it is made.
pub struct Keeper {
    target: Target,
    settings: Settings,
    key: String,
    judged: Judged,
}

impl Keeper {
    /// Everything that the reference depends on.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// The reference that was kept, or else a new one.
    pub fn obtain(&self, view: &View, console: &Console) -> Result<Truth, Failure> {
        let (picture, is_kept) = match self.kept(console) {
            Some(picture) => (picture, true),
            None => self.traced(view, console)?,
        };
        let truth = Truth { path: self.target.path().to_owned(), is_kept, picture, variance: None, own: true, bounces: self.judged };
        truth.fits(view)?;
        if let Some(told) = truth.bound_told() {
            console.note(&told);
        }
        Ok(truth)
    }

    /// None where there is none, or one that is damaged.
    fn kept(&self, console: &Console) -> Option<Layers> {
        let picture = sealed::read(self.target.path(), &self.key);
        if picture == Err(Unusable::Damaged) {
            console.note(&format!("the reference kept in {} is damaged: it is traced anew", self.target.path().display()));
        }
        picture.ok()
    }

    /// A new reference, and whether it is kept: what it took long to trace is not lost for want of room.
    fn traced(&self, view: &View, console: &Console) -> Result<(Layers, bool), Failure> {
        let picture = self.trace(view, console)?;
        let kept = sealed::write(&self.target, picture.clone(), &self.key);
        if let Err(failure) = &kept {
            console.warn(&CommandError::NotKept { path: self.target.path().to_owned(), reason: failure.cause() });
        }
        Ok((picture, kept.is_ok()))
    }

    fn trace(&self, view: &View, console: &Console) -> Result<Layers, Failure> {
        console.note(&format!("tracing the reference, which is kept in {}", self.target.path().display()));
        let result = {
            let progress = Progress::new(console, "tracing the reference");
            render(&view.stage.scene, &view.stage.bvh, &view.camera, &self.settings, &|share| progress.report(share))
        };
        if interrupt::requested() {
            return Err(Failure::interrupted(&[]));
        }
        let reference = result.map_err(Failure::input)?;
        let asked = match self.settings.stop {
            Stop::Samples(rays) => ("spp", rays.to_string()),
            Stop::RelativeError { error, .. } => ("error", error.to_string()),
        };
        let attributes = [
            asked,
            ("noise", reference.noise.to_string()),
            ("program", format!("hemisplat {}", env!("CARGO_PKG_VERSION"))),
            ("scene", view.stage.scene.name.clone()),
            ("camera", view.camera.name.clone()),
            ("bounces", reference.bounces.to_string()),
            ("stride", reference.stride.to_string()),
            ("samples", reference.samples.to_string()),
            ("seed", self.settings.seed.to_string()),
        ];
        Ok(super::reference::layers(&reference, attributes.map(|(name, value)| (name.to_owned(), value)).into()))
    }
}

impl Truth {
    /// The picture of a row of a study, which others are judged by.
    pub fn of_row(name: &str, picture: Layers) -> Self {
        // What a row lacks of another's bounces is its error against it.
        Self {
            path: PathBuf::from(name),
            is_kept: true,
            picture,
            variance: None,
            own: true,
            bounces: Judged { bounces: Bounces::All, any: true, may_be_dark: false },
        }
    }

    /// Says so where a reference ended before its noise was as small as it was to be.
    fn bound_told(&self) -> Option<String> {
        let [noise, asked] = ["noise", "error"].map(|name| self.picture.attributes.get(name).and_then(|value| value.parse::<f64>().ok()));
        let (noise, asked) = noise.zip(asked).filter(|(noise, asked)| noise > asked)?;
        let samples = self.picture.attributes.get("samples").map_or("?", String::as_str);
        Some(format!(
            "note: the reference ended at its bound of {samples} rays a pixel with a noise of {:.2} %, not {:.2} %: --reference-error {asked} goes on to it",
            100.0 * noise,
            100.0 * asked
        ))
    }

    /// Refuses what cannot judge pictures of this view, before work is done for them.
    fn fits(&self, view: &View) -> Result<(), Failure> {
        let [width, height] = view.size;
        let black = || Layer::value(vec![0.0; width as usize * height as usize]);
        let names = JUDGED.into_iter().filter(|name| self.picture.layers.contains_key(*name));
        let blank = names.fold(Layers::new(width, height), |blank, name| blank.with(name, black()));
        if blank.layers.is_empty() {
            return Err(self.refuse(MetricsError::Picture { which: "reference", error: self.lacks(IRRADIANCE) }));
        }
        self.judge(blank).map(|_| ())
    }

    /// The errors of a pipeline's picture.
    pub fn judge(&self, picture: Layers) -> Result<VariantErrors, Failure> {
        self.errors(&picture.with_attribute("bounces", self.bounces.bounces)).map_err(|error| self.refuse(error))
    }

    /// The errors of a picture that was read from this file; a reference that does not state its bounces is taken to have those that were asked for, or those of the pipelines.
    pub fn judge_given(&self, picture: &Layers, path: &Path) -> Result<VariantErrors, Failure> {
        let own = self.bounces.bounces.to_string();
        let errors = match picture.attributes.get("bounces").filter(|bounces| **bounces != own) {
            Some(_) if self.bounces.any => self.errors(&picture.clone().with_attribute("bounces", own)),
            Some(bounces) => Err(MetricsError::BouncesDiffer { test: bounces.clone(), reference: own }),
            None => self.errors(picture),
        };
        let errors = errors.map_err(|error| Failure::input(CommandError::BadGiven { path: path.to_owned(), error }))?;
        if errors.layers().iter().all(|(_, errors)| errors.is_none()) {
            let held = |picture: &Layers| picture.layers.keys().cloned().collect::<Vec<_>>().join(", ");
            return Err(Failure::input(CommandError::NoCommonLayer { test: held(picture), reference: held(&self.picture) }));
        }
        Ok(errors)
    }

    fn errors(&self, picture: &Layers) -> Result<VariantErrors, MetricsError> {
        let of = |layer, variance| match self.errors_of(picture, layer, variance) {
            Err(error) if self.bounces.may_be_dark && error.is_dark() => Ok(None),
            judged => judged,
        };
        Ok(VariantErrors {
            irradiance: of(IRRADIANCE, self.variance.as_ref())?,
            picture: of(PICTURE, None)?,
            glossy: of(GLOSSY, None)?,
            direct: of(DIRECT, None)?,
        })
    }

    fn errors_of(&self, picture: &Layers, layer: &str, variance: Option<&Layers>) -> Result<Option<Errors>, MetricsError> {
        let both = judged(picture).any(|judged| judged == layer) && self.picture.layers.contains_key(layer);
        match both.then(|| compare(picture, &self.picture, layer, variance)) {
            // Where every surface is a metal the truth has no irradiance; it judges by the picture and by what lobes reflect.
            Some(Err(MetricsError::NoSurface)) if layer == IRRADIANCE && self.picture.layers.contains_key(GLOSSY) => Ok(None),
            judged => judged.transpose(),
        }
    }

    fn lacks(&self, layer: &str) -> PictureError {
        PictureError::UnknownLayer { name: layer.to_owned(), held: self.picture.layers.keys().cloned().collect::<Vec<_>>().join(", ") }
    }

    pub fn refuse(&self, error: MetricsError) -> Failure {
        Failure::input(CommandError::BadReference { path: self.path.clone(), error })
    }

    /// What it judges by, whatever its files are called.
    pub fn content(&self) -> String {
        [Some(&self.picture), self.variance.as_ref()].into_iter().flatten().map(checksum).collect::<Vec<_>>().join(" with variance ")
    }

    pub fn report(&self) -> ReferenceReport {
        let attribute = |name: &str| self.picture.attributes.get(name).cloned();
        ReferenceReport {
            file: self.is_kept.then(|| self.path.display().to_string()),
            row: None,
            own: self.own,
            bounces: attribute("bounces"),
            samples: attribute("samples"),
            noise_over_mean: attribute("noise").and_then(|noise| noise.parse().ok()),
            error_asked: attribute("error").and_then(|error| error.parse().ok()),
            stride: attribute("stride"),
            windows: self.picture.windows().ok().flatten().map(|windows| windows.corners().len()),
        }
    }

    /// Of the light that it holds.
    pub fn bounces(&self) -> Bounces {
        self.bounces.bounces
    }

    /// Whether the file says how often its light was reflected.
    pub fn states_bounces(&self) -> bool {
        self.picture.attributes.contains_key("bounces")
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn picture(&self) -> &Layers {
        &self.picture
    }
}
