//! The library in a browser: whether one takes all shaders; and compiled for one, drawing by WebGPU, beside the picture that is drawn here.
//!
//! Needs Chromium, and for the picture, a long case that runs with `--ignored` or `--include-ignored`, what compiles for browsers, which takes five minutes at first;
//! `HEMISPLAT_REQUIRE=browser,wasm` makes a failure of their lack.

mod browser;
#[path = "../examples/browser/bundle.rs"]
mod bundle;
mod skips;

use browser::Browser;
use bundle::Compiler;
use hemisplat::{
    Engine, Pace, Scene, Stage, block_on,
    contract::{encoder::Setting, tables::Remembered},
    gpu::{scene::kind, shader::assemble},
    measure::PICTURE,
    passes::REGISTRY,
    pipeline::{embedded::EMBEDDED, plan},
    scene::{
        load::{LoadOptions, load},
        needs::Needs,
    },
    schedule::{Command, Device},
};
use libtest_mimic::{Arguments, Failed};
use serde_json::{Value, json};
use skips::Missing;
use std::{
    collections::{BTreeMap, btree_map::Entry},
    error::Error,
    fs, io,
    path::Path,
    sync::Arc,
};

const SIZE: [u32; 2] = [64, 64];

/// Numbers are alike that differ by no more than this share of the picture's mean.
const ALIKE: f32 = 0.01;
/// Most of the pixels that may not be alike: devices divide those differently whose middle an edge goes through.
const APART: f64 = 0.005;

/// The frames that a window draws while a scene is drawn in it. One whose thread is blocked draws none.
const FRAMES: u64 = 3;

fn main() {
    let no_browser = browser::find().is_none().then(|| Missing::new("browser", "no browser (chromium)"));
    let no_compiler = Compiler::find().is_none().then(|| Missing::new("wasm", "no compiler for wasm32-unknown-unknown"));
    let missing = no_browser.clone().or(no_compiler).or_else(Missing::gpu);
    let trials = vec![
        skips::fallible("a_browser_takes_every_shader", no_browser.as_ref(), shaders),
        // Compiling takes five minutes of two quick cores, and twice that of slow ones.
        skips::fallible("a_browser_draws_what_is_drawn_here", missing.as_ref(), draws).with_ignored_flag(true),
    ];
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

/// Makes a module of each text and tells what the browser says of it, warnings too, as pages show them to whoever looks.
const TAKE: &str = r#"(async () => {
    const device = await (await navigator.gpu.requestAdapter()).requestDevice();
    const told = [];
    for (const [name, code] of texts) {
        device.pushErrorScope("validation");
        const { messages } = await device.createShaderModule({ code }).getCompilationInfo();
        await device.popErrorScope();
        const lines = code.split("\n");
        told.push(...messages.filter(({ type }) => type !== "info").map(({ lineNum, message }) => `${name}: ${message}: ${lines[lineNum - 1].trim()}`));
    }
    return told;
})()"#;

/// What this library's own validation lets pass, as it knows more of the language than the standard, another's may not.
fn shaders() -> Result<(), Box<dyn Error>> {
    let mut texts = BTreeMap::new();
    for scene in ["scenes/cornell.ron", "tests/places/kinds.ron"] {
        collect(&load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(scene), &LoadOptions::default())?, &mut texts)?;
    }
    // What must be refused, so that it is seen that anything is.
    texts.insert("a mistake".into(), "fn f(a: u32) -> u32 { return a >> 1u & 3u; }".into());
    let folder = tempfile::tempdir()?;
    let page = folder.path().join("page.html");
    fs::write(&page, format!("<script>const texts = {};</script>", json!(Vec::from_iter(&texts))))?;
    let told = taken(&page).map_err(told)?;
    let (mistake, others): (Vec<_>, Vec<_>) = told.into_iter().partition(|told| told.starts_with("a mistake: "));
    println!("{} texts", texts.len() - 1);
    match () {
        () if mistake.len() != 1 => Err("the browser takes what is no WGSL".into()),
        () if !others.is_empty() => Err(others.join("\n").into()),
        () => Ok(()),
    }
}

fn taken(page: &Path) -> Result<Vec<String>, Failed> {
    let mut browser = Browser::with_webgpu()?;
    browser.open(page)?;
    let told = browser.evaluate(TAKE)?;
    let lines = told.as_array().ok_or("the browser has no WebGPU")?;
    Ok(lines.iter().map(|line| line.as_str().unwrap_or_default().to_owned()).collect())
}

/// The texts of all shaders that pipelines run in a scene, by name and what their imports stand for.
fn collect(scene: &Scene, texts: &mut BTreeMap<String, String>) -> Result<(), Box<dyn Error>> {
    let (needs, tables) = (Needs::of(scene), Remembered::default());
    for ((file, _), device) in EMBEDDED.iter().flat_map(|ships| [Device::ABLE, Device::SOFTWARE].map(|device| (ships, device))) {
        let pipeline = hemisplat::pipeline::load(file, &[], REGISTRY, &mut |_| Err(io::ErrorKind::NotFound.into()))?;
        let setting = Setting { scene, needs: &needs, device, size: SIZE, tables: Some(&tables) };
        let plan = plan(&pipeline, setting, &[], &kind)?;
        let nodes = plan.schedule.nodes();
        for program in nodes.iter().flat_map(|node| &node.commands).flat_map(Command::programs) {
            if let Entry::Vacant(text) = texts.entry(format!("{} {:?}", program.shader, program.imports)) {
                text.insert(assemble(program.shader, &program.imports)?);
            }
        }
    }
    Ok(())
}

fn draws() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let page = folder.path().join("page.html");
    fs::write(&page, bundle::page(&Compiler::find().ok_or("no compiler")?)?)?;
    for (scene, pipeline) in [("cornell", "irradiance"), ("cornell", "irradiance-device")] {
        let [width, height] = SIZE;
        let result = in_browser(&page, &format!("scene={scene}&pipeline={pipeline}&size={width}x{height}")).map_err(told)?;
        let found: Vec<f32> = result["pixels"].as_array().ok_or("no pixels")?.iter().map(|value| value.as_f64().unwrap_or(f64::NAN) as f32).collect();
        let apart = apart(&found, &block_on(here(scene, pipeline))?);
        println!("{pipeline}: {:.2} % of the pixels apart, {} records, {:.1} s", 100.0 * apart, result["records"], result["seconds"].as_f64().unwrap_or(0.0));
        if apart > APART {
            return Err(format!("{pipeline}: {:.2} % of the pixels are others in the browser", 100.0 * apart).into());
        }
        if result["frames"].as_u64().unwrap_or(0) < FRAMES {
            return Err(format!("{pipeline}: the window was blocked: it drew {} frames in the meantime", result["frames"]).into());
        }
    }
    Ok(())
}

/// The share of pixels that are not alike.
fn apart(found: &[f32], expected: &[f32]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let most = ALIKE * expected.iter().sum::<f32>() / expected.len() as f32;
    // What is no number is not alike.
    let is_apart = |(found, expected): &(&[f32], &[f32])| !found.iter().zip(*expected).all(|(found, expected)| (found - expected).abs() <= most);
    let pixels = || found.chunks(3).zip(expected.chunks(3));
    pixels().filter(is_apart).count() as f64 / pixels().count() as f64
}

/// What the page's script hands on, after which nothing may have complained.
fn in_browser(page: &Path, asked: &str) -> Result<Value, Failed> {
    let mut browser = Browser::with_webgpu()?;
    browser.open_at(page, asked)?;
    browser.begin("window.result.then((drawn) => { window.drawn = drawn; }, (error) => { window.drawn = String(error); })")?;
    browser.until("window.drawn !== undefined")?;
    let result = browser.evaluate("window.drawn")?;
    if let Some(error) = result.as_str() {
        return Err(format!("{error}\n{}", browser.complaints()?.join("\n")).into());
    }
    let complaints = browser.complaints()?;
    if complaints.is_empty() { Ok(result) } else { Err(complaints.join("\n").into()) }
}

/// The same picture by this machine's adapter: red, green and blue of each pixel.
async fn here(scene: &str, pipeline: &str) -> Result<Vec<f32>, Box<dyn Error>> {
    let engine = Engine::open().await?;
    let stage = Arc::new(Stage::new(load(Path::new(scene), &LoadOptions::default())?));
    let pipeline = engine.pipeline(pipeline, &[], &mut |_| Err(io::ErrorKind::NotFound.into()))?;
    let plan = engine.plan(&pipeline, &stage, SIZE)?;
    let mut run = engine.run(&stage, &plan, &stage.scene.cameras[0], SIZE).await?;
    run.frame(&|| Pace::GoOn).await?;
    let picture = run.picture().await?;
    let [red, green, blue] = picture.rgb(PICTURE)?;
    Ok(red.iter().zip(green).zip(blue).flat_map(|((red, green), blue)| [*red, *green, *blue]).collect())
}

fn told(failed: Failed) -> Box<dyn Error> {
    failed.message().unwrap_or("failed").into()
}
