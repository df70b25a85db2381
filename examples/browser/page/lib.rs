//! A scene drawn by WebGPU, for the script of a page.
#![cfg(target_arch = "wasm32")]

use hemisplat::{
    Engine, Pace, Stage,
    scene::load::{LoadOptions, load},
};
use std::{error::Error, io, path::Path, sync::Arc};
use wasm_bindgen::prelude::*;

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(js_namespace = console, js_name = error)]
    fn complain(text: &str);
}

/// Says what went wrong where the program ends.
#[wasm_bindgen(start)]
fn start() {
    std::panic::set_hook(Box::new(|panic| complain(&panic.to_string())));
}

/// The adapter that a scene was drawn by, and its picture.
#[wasm_bindgen]
pub struct Drawn {
    adapter: String,
    records: u32,
    pixels: Vec<f32>,
}

#[wasm_bindgen]
impl Drawn {
    #[wasm_bindgen(getter)]
    pub fn adapter(&self) -> String {
        self.adapter.clone()
    }

    #[wasm_bindgen(getter)]
    pub fn records(&self) -> u32 {
        self.records
    }

    /// Radiance, red, green and blue of each pixel, row by row from above [W m⁻² sr⁻¹].
    pub fn pixels(&self) -> Vec<f32> {
        self.pixels.clone()
    }
}

/// Draws a scene that ships by a pipeline that ships.
#[wasm_bindgen]
pub async fn draw(scene: String, pipeline: String, width: u32, height: u32) -> Result<Drawn, JsError> {
    drawn(&scene, &pipeline, [width, height]).await.map_err(|error| JsError::new(&told(&*error)))
}

async fn drawn(scene: &str, pipeline: &str, size: [u32; 2]) -> Result<Drawn, Box<dyn Error>> {
    let engine = Engine::open().await?;
    let stage = Arc::new(Stage::new(load(Path::new(scene), &LoadOptions::default())?));
    let pipeline = engine.pipeline(pipeline, &[], &mut |_| Err(io::ErrorKind::NotFound.into()))?;
    let plan = engine.plan(&pipeline, &stage, size)?;
    let mut run = engine.run(&stage, &plan, &stage.scene.cameras[0], size).await?;
    let report = run.frame(&|| Pace::GoOn).await?;
    let picture = run.picture().await?;
    let [red, green, blue] = picture.rgb("picture")?;
    let pixels = red.iter().zip(green).zip(blue).flat_map(|((red, green), blue)| [*red, *green, *blue]).collect();
    Ok(Drawn { adapter: engine.gpu().adapter.name.clone(), records: report.new_records.unwrap_or(0), pixels })
}

/// An error and all that caused it.
fn told(error: &dyn Error) -> String {
    let cause = error.source().map(|cause| format!(": {}", told(cause)));
    format!("{error}{}", cause.unwrap_or_default())
}
