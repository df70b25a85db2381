//! Light from the command line: a sky and the sun.

use super::console::Console;
use super::failure::Failure;
use crate::scene::Scene;
use crate::scene::load::{Daylight, FileSystem, Sky, Sun};
use clap::Args;
use std::path::PathBuf;

#[derive(Args, Clone, Default)]
pub struct DaylightOptions {
    /// A sky in place of the scene's own: a latitude-longitude image (.exr, .hdr), clear (with the sun), overcast, white or none. A scene without any light gets overcast
    #[arg(long, value_name = "FILE|clear|overcast|white|none", value_parser = sky)]
    sky: Option<Sky>,
    /// The sun: degrees from -z towards +x, and over the horizon. A scene without a sky gets a clear one with it
    #[arg(long, value_name = "AZIMUTH,ELEVATION", value_parser = sun, allow_hyphen_values = true)]
    sun: Option<Sun>,
}

impl DaylightOptions {
    /// Whether the options say anything of the light.
    pub fn is_given(&self) -> bool {
        self.sky.is_some() || self.sun.is_some()
    }

    /// Lights the scene as the options say, or by default where it has no light at all.
    pub fn light(&self, scene: &mut Scene, files: &dyn FileSystem, console: &Console) -> Result<(), Failure> {
        let given = Daylight { sky: self.sky.clone(), sun: self.sun };
        given.light(scene, files).map_err(Failure::input)?;
        if given != Daylight::default() {
            return Ok(());
        }
        if scene.is_dark() {
            console.note("note: the scene has no light: it gets a white overcast sky; --sky and --sun choose another light, --sky none leaves it dark");
            Daylight::OF_DARK_SCENES.light(scene, files).map_err(Failure::input)?;
        } else if scene.is_dim() {
            console.note(
                "note: the scene's only light is what its own surfaces emit, and that is little: --sky overcast or --sun AZIMUTH,ELEVATION lights all of it",
            );
        }
        Ok(())
    }

    /// What is needed to light the scene so again.
    pub fn attributes(&self) -> impl Iterator<Item = (&'static str, String)> {
        let sky = self.sky.as_ref().map(|sky| match sky {
            Sky::File(path) => path.display().to_string(),
            Sky::Clear => "clear".to_owned(),
            Sky::Overcast => "overcast".to_owned(),
            Sky::White => "white".to_owned(),
            Sky::None => "none".to_owned(),
        });
        let sun = self.sun.map(|sun| format!("{},{}", sun.azimuth, sun.elevation));
        [("sky", sky), ("sun", sun)].into_iter().filter_map(|(name, value)| Some((name, value?)))
    }
}

fn sky(text: &str) -> Result<Sky, String> {
    let path = PathBuf::from(text);
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    match (text, ending.as_deref()) {
        ("clear", _) => Ok(Sky::Clear),
        ("overcast", _) => Ok(Sky::Overcast),
        ("white", _) => Ok(Sky::White),
        ("none", _) => Ok(Sky::None),
        (_, Some("exr" | "hdr")) => Ok(Sky::File(path)),
        _ => Err("expected clear, overcast, white, none, or an image that ends in .exr or .hdr".to_owned()),
    }
}

fn sun(text: &str) -> Result<Sun, String> {
    let numbers = text.split_once(',').and_then(|(a, e)| Some((a.trim().parse().ok()?, e.trim().parse().ok()?)));
    let sun = numbers.map(|(azimuth, elevation)| Sun { azimuth, elevation });
    let sun = sun.filter(|sun| sun.azimuth.abs() <= 360.0 && (0.0..=90.0).contains(&sun.elevation));
    sun.ok_or_else(|| "expected two angles in degrees, such as 135,40; the azimuth is -360 to 360, the elevation 0 to 90".to_owned())
}
