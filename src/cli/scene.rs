//! The options of every command that takes a scene.

use super::camera::{CameraOptions, to_ron};
use super::console::Console;
use super::daylight::DaylightOptions;
use super::failure::{CommandError, Failure};
use super::lookups::Lookups;
use crate::gpu::expected_adapter;
use crate::gpu::limits::Most;
use crate::measure::cache::fingerprint;
use crate::measure::metrics::SCENE_CHECKSUM;
use crate::scene::animation::Animation;
use crate::scene::load::{LoadOptions, load};
use crate::scene::stage::Stage;
use crate::scene::{Camera, MAX_SIDE, Scene};
use clap::Args;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The size of a picture where neither the user nor the scene says one [pixels].
const DEFAULT_SIZE: [u32; 2] = [512, 512];

#[derive(Args)]
pub struct SceneOptions {
    /// The scene: a file .gltf, .glb, .obj, .ply or .ron, or the name of one that ships
    #[arg(long, value_name = "FILE")]
    scene: PathBuf,
    #[command(flatten)]
    view: ViewOptions,
}

/// What is to be seen of a scene.
#[derive(Args, Clone)]
pub struct ViewOptions {
    /// One of the scene's cameras; its first if not given. `render` takes several, one a frame
    #[arg(long = "camera", value_name = "NAME")]
    cameras: Vec<String>,
    /// The picture's size in pixels; the scene's own if not given
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<[u32; 2]>,
    /// Where else to look for scenes and their files, before the folders of HEMISPLAT_SCENES; may be repeated
    #[arg(long = "scenes", value_name = "DIR")]
    search: Vec<PathBuf>,
    /// A parameter of the scene's generator; may be repeated
    #[arg(long = "scene-set", value_name = "KEY=VALUE", value_parser = key_and_value)]
    set: Vec<(String, String)>,
    /// The moment at which an animated scene is seen; its beginning if not given
    #[arg(long, value_name = "SECONDS", value_parser = moment)]
    moment: Option<f64>,
    #[command(flatten)]
    camera: CameraOptions,
    #[command(flatten)]
    daylight: DaylightOptions,
}

/// A scene that is ready for rays, and the view of it.
pub struct View {
    pub stage: Arc<Stage>,
    /// That of the scene's animation which the stage has [s].
    pub moment: f64,
    pub camera: Camera,
    /// Those that were named, or else all of the scene.
    pub cameras: Vec<Camera>,
    /// Whether they were named.
    pub are_named: bool,
    /// Width and height [pixels].
    pub size: [u32; 2],
}

impl View {
    /// What of the scene moves.
    pub fn animation(&self) -> &Animation {
        &self.stage.scene.animation
    }

    /// The same view at another moment.
    ///
    /// # Errors
    /// Where the scene cannot be so.
    pub fn go_to(&mut self, moment: f64) -> Result<(), Failure> {
        let now = self.animation().at(moment);
        let (changes, camera) = (self.stage.changes_to(&now), now.camera(&self.stage.scene, &self.camera));
        if !changes.is_empty() {
            Arc::make_mut(&mut self.stage).change(&changes).map_err(Failure::input)?;
        }
        (self.camera, self.moment) = (camera, moment);
        Ok(())
    }
}

impl ViewOptions {
    /// Whether the options say anything of what is seen.
    pub fn is_given(&self) -> bool {
        !self.cameras.is_empty() || self.size.is_some() || !self.set.is_empty() || self.moment.is_some() || self.camera.is_given() || self.daylight.is_given()
    }

    /// With this camera and size where the user says none.
    pub fn or(&self, camera: Option<&String>, size: Option<[u32; 2]>) -> Self {
        let cameras = if self.cameras.is_empty() { camera.into_iter().cloned().collect() } else { self.cameras.clone() };
        Self { cameras, size: self.size.or(size), ..self.clone() }
    }
}

impl SceneOptions {
    pub fn new(scene: PathBuf, view: ViewOptions) -> Self {
        Self { scene, view }
    }

    /// Loads the scene, says what loading had to mend, and picks the view.
    pub fn load(&self, console: &Console) -> Result<View, Failure> {
        self.expect_one_camera()?;
        self.load_timeline(&Lookups::default(), console)
    }

    /// The scene as it was named.
    pub fn path(&self) -> &Path {
        &self.scene
    }

    /// How many cameras were named.
    pub fn named_cameras(&self) -> usize {
        self.view.cameras.len()
    }

    /// The same where several cameras may be named; every file that is looked for is noted.
    pub fn load_timeline(&self, lookups: &Lookups, console: &Console) -> Result<View, Failure> {
        self.view(lookups, console, expect_room)
    }

    /// The scene and the one view of it, for work that no device does.
    pub fn load_for_host(&self, console: &Console) -> Result<View, Failure> {
        self.expect_one_camera()?;
        self.view(&Lookups::default(), console, |_| Ok(()))
    }

    fn expect_one_camera(&self) -> Result<(), Failure> {
        if self.view.cameras.len() > 1 {
            return Err(Failure::input(CommandError::SeveralCameras { names: self.view.cameras.join(", ") }));
        }
        Ok(())
    }

    /// `expect` refuses scenes before a hierarchy is built over them.
    fn view(&self, lookups: &Lookups, console: &Console, expect: impl FnOnce(&Scene) -> Result<(), Failure>) -> Result<View, Failure> {
        let options = LoadOptions { search: self.view.search.clone(), overrides: self.view.set.clone(), files: Arc::new(lookups.clone()) }.with_environment();
        let mut scene = load(&self.scene, &options).map_err(Failure::input)?;
        expect(&scene)?;
        scene.notes.iter().for_each(|note| console.note(&format!("note: {note}")));
        self.view.daylight.light(&mut scene, lookups, console)?;
        let mut cameras = self.pick_cameras(&scene)?;
        let mut stage = Stage::animated(scene).map_err(Failure::input)?;
        let moment = self.moment(&stage.scene.animation, console);
        let now = stage.scene.animation.at(moment);
        cameras.iter_mut().for_each(|camera| *camera = now.camera(&stage.scene, camera));
        stage.change(&stage.changes_to(&now)).map_err(Failure::input)?;
        let camera = cameras[0].clone();
        let size = self.view.size.or(camera.size).unwrap_or(DEFAULT_SIZE);
        if self.view.camera.print_camera {
            cameras.iter().try_for_each(|camera| console.print(&to_ron(&stage.scene, camera, size)))?;
        }
        let are_named = !self.view.cameras.is_empty();
        Ok(View { stage: Arc::new(stage), moment, camera, cameras, are_named, size })
    }

    fn moment(&self, animation: &Animation, console: &Console) -> f64 {
        if self.view.moment.is_some() && animation.is_empty() {
            console.note("note: nothing in the scene moves: --moment changes nothing");
        }
        self.view.moment.unwrap_or(0.0)
    }

    /// What is needed to make the view of a scene again as it is at a moment, for a picture's attributes.
    pub fn attributes(&self, view: &View, (scene, moment): (&Scene, f64), camera: &Camera) -> BTreeMap<String, String> {
        let mut attributes = self.lasting_attributes(view, camera);
        attributes.insert(SCENE_CHECKSUM.to_owned(), fingerprint(scene));
        attributes.extend((!view.animation().is_empty()).then(|| ("moment".to_owned(), moment.to_string())));
        attributes
    }

    /// Those of them that are the same at all moments.
    pub fn lasting_attributes(&self, view: &View, camera: &Camera) -> BTreeMap<String, String> {
        let set: Vec<String> = self.view.set.iter().map(|(key, value)| format!("{key}={value}")).collect();
        let [width, height] = view.size;
        let attributes = [
            ("program", format!("hemisplat {}", env!("CARGO_PKG_VERSION"))),
            ("scene", self.scene.display().to_string()),
            ("scene-set", set.join(" ")),
            ("camera", camera.name.clone()),
            ("size", format!("{width}x{height}")),
        ];
        attributes.into_iter().chain(self.view.daylight.attributes()).map(|(name, value)| (name.to_owned(), value)).collect()
    }

    /// Those that are looked through, with what the command line says of them. Never empty.
    fn pick_cameras(&self, scene: &Scene) -> Result<Vec<Camera>, Failure> {
        let cameras = self.named_or_all(scene)?;
        if self.view.camera.is_given() { Ok(vec![self.view.camera.apply(scene, &cameras[0])?]) } else { Ok(cameras) }
    }

    /// Never empty.
    fn named_or_all(&self, scene: &Scene) -> Result<Vec<Camera>, Failure> {
        let unknown = |name: &str| {
            let known = scene.cameras.iter().map(|camera| camera.name.as_str()).collect::<Vec<_>>().join(", ");
            Failure::input(CommandError::UnknownCamera { name: name.to_owned(), known })
        };
        if self.view.cameras.is_empty() {
            let first = scene.camera(None).ok_or_else(|| unknown(""))?;
            return Ok(if scene.cameras.is_empty() { vec![first.clone()] } else { scene.cameras.clone() });
        }
        self.view.cameras.iter().map(|name| scene.camera(Some(name)).cloned().ok_or_else(|| unknown(name))).collect()
    }
}

/// Refuses scenes that the device cannot hold. Adapters are asked only where not every one can.
fn expect_room(scene: &Scene) -> Result<(), Failure> {
    if Most::everywhere().hold(scene).is_ok() {
        return Ok(());
    }
    expected_adapter().map_or(Ok(()), |adapter| Most::of(&adapter.limits).hold(scene).map_err(Failure::work))
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let side = |text: &str| text.parse().ok().filter(|side| (1..=MAX_SIDE).contains(side));
    let both = text.split_once('x').and_then(|(width, height)| Some([side(width)?, side(height)?]));
    both.ok_or_else(|| format!("expected WIDTHxHEIGHT, each 1 to {MAX_SIDE} pixels, such as 640x480"))
}

fn moment(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|moment: &f64| moment.is_finite()).ok_or_else(|| "expected a number of seconds, such as 2.5".to_owned())
}

fn key_and_value(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((key, value)) if !key.is_empty() => Ok((key.to_owned(), value.to_owned())),
        _ => Err("expected KEY=VALUE".to_owned()),
    }
}
