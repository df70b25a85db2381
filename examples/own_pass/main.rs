//! Passes of one's own, outside of hemisplat: two of them with a shader, an output of a kind that hemisplat does not know, and a pipeline that names them.
//!
//! `cargo run --release --example own_pass -- out/inked.exr`

mod ink;

use hemisplat::{
    Engine, Pace, Stage, block_on,
    scene::load::{LoadOptions, load},
};
use std::{error::Error, fs, io, path::Path, sync::Arc};

const SIZE: [u32; 2] = [512, 512];

fn main() -> Result<(), Box<dyn Error>> {
    block_on(draw())
}

async fn draw() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).ok_or("say where the picture goes: own_pass FILE.exr")?;
    let engine = Engine::open().await?.with(&ink::Edges).with(&ink::Ink);
    let stage = Arc::new(Stage::new(load(Path::new("castle"), &LoadOptions::default())?));
    // The pipeline is a text of this program; what it is over ships.
    let mut read = |path: &Path| if path == Path::new("ink.ron") { Ok(include_str!("ink.ron").to_owned()) } else { Err(io::ErrorKind::NotFound.into()) };
    let pipeline = engine.pipeline("ink.ron", &["edges.reach=2".to_owned()], &mut read)?;
    let plan = engine.plan(&pipeline, &stage, SIZE)?;
    let mut run = engine.run(&stage, &plan, &stage.scene.cameras[0], SIZE).await?;
    let report = run.frame(&|| Pace::GoOn).await?;
    fs::write(&output, run.picture().await?.to_exr()?)?;
    println!("{output}: {} records", report.new_records.unwrap_or(0));
    Ok(())
}
