//! What is measured: benches/frames.ron.

use serde::{Deserialize, Serialize};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct List {
    /// Of pictures [pixels].
    pub size: [u32; 2],
    /// Rays a pixel of the truth.
    pub truth: u32,
    pub runs: u32,
    /// The share of the processors' time that other processes may have.
    pub others_at_most: f64,
    pub scenes: Vec<Case>,
    pub pipelines: Vec<String>,
    pub denoised: Vec<Denoised>,
}

/// A scene that moves, and how much of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// Of those that ship.
    pub name: String,
    pub frames: u32,
    /// Frames a second.
    pub fps: f64,
}

/// Denoised path tracing.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Denoised {
    /// Of a pixel.
    pub rays: u32,
    /// Of the denoiser: as `mitsuba_frames.py` takes it.
    pub quality: String,
}

impl List {
    pub fn read(text: &str) -> Result<Self, String> {
        let list: Self = ron::from_str(text).map_err(|error| error.to_string())?;
        match list.scenes.iter().find(|case| case.frames == 0 || !(case.fps > 0.0 && case.fps.is_finite())) {
            Some(case) => Err(format!("{} has no frames", case.name)),
            None if list.runs == 0 || list.size.contains(&0) => Err("nothing is to be run".into()),
            None => Ok(list),
        }
    }

    /// With one of its scenes alone, if one is named.
    pub fn only(mut self, scene: Option<&str>) -> Result<Self, String> {
        let Some(scene) = scene else { return Ok(self) };
        let names = self.scenes.iter().map(|case| case.name.as_str()).collect::<Vec<_>>().join(", ");
        self.scenes.retain(|case| case.name == scene);
        if self.scenes.is_empty() { Err(format!("no scene `{scene}`: there are {names}")) } else { Ok(self) }
    }
}
