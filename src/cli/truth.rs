//! The reference that pictures are judged by: a file that the user gives, or one traced here and kept for the next time.
//!
//! A kept reference is an EXR file as `hemisplat reference` writes it, sealed by its checksum. Its name is made from everything that it depends on. Several processes may write the same one at once: it appears whole.

use super::console::Console;
use super::failure::{CommandError, Failure};
use super::input::read_picture;
use super::output::Target;
use super::pipeline::BOUNCES;
use super::progress::Progress;
use super::scene::View;
use super::sealed::{self, Unusable};
use crate::gpu::scene::camera;
use crate::measure::cache::{Checksum, fingerprint};
use crate::measure::compare::{ReferenceReport, VariantErrors, checksum, judged};
use crate::measure::{DIRECT, Errors, GLOSSY, IRRADIANCE, Layer, Layers, MetricsError, PICTURE, PictureError, compare};
use crate::reference::{Bounces, Pixels, Settings, Stop, VERSION, check, render};
use clap::Args;
use etcetera::BaseStrategy;
use std::path::{Path, PathBuf};

#[derive(Args)]
pub struct TruthOptions {
    /// What to judge the pictures by; if not given, it is traced and kept for the next time
    #[arg(long, value_name = "FILE.exr")]
    reference: Option<PathBuf>,
    /// The variance of the reference's irradiance; the reference's own layer `variance` if not given
    #[arg(long, value_name = "FILE", requires = "reference")]
    reference_variance: Option<PathBuf>,
    /// Measure times alone
    #[arg(long, conflicts_with = "reference")]
    no_reference: bool,
    /// Rays per pixel of a reference that is traced, rounded up to whole rounds of strata
    #[arg(long, value_name = "N", default_value_t = 256, conflicts_with_all = ["reference", "no_reference"])]
    reference_spp: u32,
    /// Trace only every K-th pixel of each row and column; without every pixel there is no `flip` and no `band_error`
    #[arg(long, value_name = "K", default_value_t = 1, conflicts_with_all = ["reference", "no_reference"])]
    reference_stride: u32,
    /// Trace only N squares of 64×64 pixels, spread over the picture, at full resolution: errors of all kinds at the cost of a stride
    #[arg(long, value_name = "N", conflicts_with_all = ["reference", "no_reference", "reference_stride"])]
    reference_windows: Option<u32>,
    /// Where references that are traced are kept; the user's cache folder if not given
    #[arg(long, value_name = "DIR", conflicts_with_all = ["reference", "no_reference"])]
    reference_cache: Option<PathBuf>,
}

/// A reference whose size and bounces fit the pictures that it is to judge.
pub struct Truth {
    path: PathBuf,
    picture: Layers,
    variance: Option<Layers>,
    own: bool,
}

impl TruthOptions {
    /// A reference that is traced; `cache` is where it is kept, the user's cache folder if not given.
    pub fn traced(spp: u32, pixels: Pixels, cache: Option<PathBuf>) -> Self {
        let (stride, windows) = match pixels {
            Pixels::Every(stride) => (stride, None),
            Pixels::Windows(count) => (1, Some(count)),
        };
        let own = Self { reference_spp: spp, reference_stride: stride, reference_windows: windows, reference_cache: cache, ..Self::none() };
        Self { no_reference: false, ..own }
    }

    /// No reference from outside.
    pub fn none() -> Self {
        Self {
            reference: None,
            reference_variance: None,
            no_reference: true,
            reference_spp: 0,
            reference_stride: 1,
            reference_windows: None,
            reference_cache: None,
        }
    }

    /// The files that are read.
    pub fn files(&self) -> Vec<&Path> {
        self.reference.iter().chain(&self.reference_variance).map(PathBuf::as_path).collect()
    }

    /// Reads what the user gives; None where it is to be traced, or none is wanted.
    pub fn given(&self, view: &View) -> Result<Option<Truth>, Failure> {
        let Some(path) = &self.reference else { return Ok(None) };
        let truth =
            Truth { picture: read_picture(path)?, variance: self.reference_variance.as_deref().map(read_picture).transpose()?, path: path.clone(), own: false };
        truth.fits(view)?;
        Ok(Some(truth))
    }

    /// Whether a reference has to be traced where none is given; then there is a place to keep it.
    pub fn keeper(&self, view: &View) -> Result<Option<Keeper>, Failure> {
        if self.reference.is_some() || self.no_reference {
            return Ok(None);
        }
        let folder = self.reference_cache.clone().or_else(cache_folder).ok_or_else(|| Failure::input(CommandError::NoReferenceCache))?;
        let pixels = self.reference_windows.map_or(Pixels::Every(self.reference_stride), Pixels::Windows);
        let settings = Settings { size: view.size, pixels, bounces: Bounces::Count(BOUNCES), stop: Stop::Samples(self.reference_spp), seed: 0 };
        check(&view.camera, &settings).map_err(Failure::input)?;
        let key = key(view, &settings, self.reference_spp);
        let target = Target::new(&folder.join(format!("reference-{}.exr", Checksum::of(key.as_bytes()))))?;
        Ok(Some(Keeper { target, settings, key }))
    }
}

/// Where the user's system keeps what programs can make again.
pub fn cache_folder() -> Option<PathBuf> {
    etcetera::choose_base_strategy().ok().map(|folders| folders.cache_dir().join("hemisplat"))
}

/// Everything that a reference depends on.
fn key(view: &View, settings: &Settings, spp: u32) -> String {
    let Settings { pixels, bounces, seed, .. } = settings;
    format!("tracer {VERSION}, {}, {pixels}, bounces {bounces}, spp {spp}, seed {seed}", content(view))
}

/// What a view shows, whatever its files are called: scene, camera and size.
pub fn content(view: &View) -> String {
    let [width, height] = view.size;
    let camera = Checksum::of(bytemuck::bytes_of(&camera(&view.camera, view.size, view.scene.extent(), 0)));
    let scene = fingerprint(&view.scene, &view.bvh);
    format!("scene {scene}, camera {camera}, size {width}x{height}")
}

/// Where a reference is kept, and how it is made.
pub struct Keeper {
    target: Target,
    settings: Settings,
    key: String,
}

impl Keeper {
    /// The reference that was kept, or else a new one.
    pub fn obtain(&self, view: &View, console: &Console) -> Result<Truth, Failure> {
        let picture = match self.kept(console) {
            Some(picture) => picture,
            None => self.trace(view, console)?,
        };
        let truth = Truth { path: self.target.path().to_owned(), picture, variance: None, own: true };
        truth.fits(view)?;
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

    fn trace(&self, view: &View, console: &Console) -> Result<Layers, Failure> {
        console.note(&format!("tracing the reference, which is kept in {}", self.target.path().display()));
        let result = {
            let progress = Progress::new(console, "tracing the reference");
            render(&view.scene, &view.bvh, &view.camera, &self.settings, &|share| progress.report(share))
        };
        let reference = result.map_err(Failure::input)?;
        let attributes = [
            ("program", format!("hemisplat {}", env!("CARGO_PKG_VERSION"))),
            ("scene", view.scene.name.clone()),
            ("camera", view.camera.name.clone()),
            ("bounces", reference.bounces.to_string()),
            ("stride", reference.stride.to_string()),
            ("samples", reference.samples.to_string()),
            ("seed", self.settings.seed.to_string()),
        ];
        let picture = super::reference::layers(&reference, attributes.map(|(name, value)| (name.to_owned(), value)).into());
        sealed::write(&self.target, picture.clone(), &self.key)?;
        Ok(picture)
    }
}

impl Truth {
    /// The picture of a row of a study, which others are judged by.
    pub fn of_row(name: &str, picture: Layers) -> Self {
        Self { path: PathBuf::from(name), picture: picture.with_attribute("bounces", BOUNCES), variance: None, own: true }
    }

    /// Refuses what cannot judge pictures of this view, before work is done for them.
    fn fits(&self, view: &View) -> Result<(), Failure> {
        if let Some(found) = self.picture.attributes.get("camera").filter(|found| **found != view.camera.name) {
            let (found, expected) = (found.clone(), view.camera.name.clone());
            return Err(Failure::input(CommandError::OtherCamera { path: self.path.clone(), found, expected }));
        }
        let [width, height] = view.size;
        let black = || Layer::value(vec![0.0; width as usize * height as usize]);
        let names = [IRRADIANCE, PICTURE].into_iter().filter(|name| self.picture.layers.contains_key(*name));
        let blank = names.fold(Layers::new(width, height), |blank, name| blank.with(name, black()));
        if blank.layers.is_empty() {
            return Err(self.refuse(MetricsError::Picture { which: "reference", error: self.lacks(IRRADIANCE) }));
        }
        self.judge(blank).map(|_| ())
    }

    /// The errors of a pipeline's picture.
    pub fn judge(&self, picture: Layers) -> Result<VariantErrors, Failure> {
        let picture = picture.with_attribute("bounces", BOUNCES);
        Ok(VariantErrors {
            irradiance: self.errors(&picture, IRRADIANCE, self.variance.as_ref())?,
            picture: self.errors(&picture, PICTURE, None)?,
            glossy: self.errors(&picture, GLOSSY, None)?,
            direct: self.errors(&picture, DIRECT, None)?,
        })
    }

    fn errors(&self, picture: &Layers, layer: &str, variance: Option<&Layers>) -> Result<Option<Errors>, Failure> {
        let both = judged(picture).any(|judged| judged == layer) && self.picture.layers.contains_key(layer);
        match both.then(|| compare(picture, &self.picture, layer, variance)) {
            // Where every surface is a metal the truth has no irradiance; it judges by the picture and by what lobes reflect.
            Some(Err(MetricsError::NoSurface)) if layer == IRRADIANCE && self.picture.layers.contains_key(GLOSSY) => Ok(None),
            judged => judged.transpose().map_err(|error| self.refuse(error)),
        }
    }

    fn lacks(&self, layer: &str) -> PictureError {
        PictureError::UnknownLayer { name: layer.to_owned(), held: self.picture.layers.keys().cloned().collect::<Vec<_>>().join(", ") }
    }

    fn refuse(&self, error: MetricsError) -> Failure {
        Failure::input(CommandError::BadReference { path: self.path.clone(), error })
    }

    /// What it judges by, whatever its files are called.
    pub fn content(&self) -> String {
        [Some(&self.picture), self.variance.as_ref()].into_iter().flatten().map(checksum).collect::<Vec<_>>().join(" with variance ")
    }

    pub fn report(&self) -> ReferenceReport {
        let attribute = |name: &str| self.picture.attributes.get(name).cloned();
        ReferenceReport {
            file: Some(self.path.display().to_string()),
            row: None,
            own: self.own,
            bounces: attribute("bounces"),
            samples: attribute("samples"),
            stride: attribute("stride"),
            windows: self.picture.windows().ok().flatten().map(|windows| windows.corners().len()),
        }
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
