//! hemisplat in a browser: compiles the library for one and writes a page that draws the Cornell box by WebGPU. The page is one file and needs no server.
//!
//! `cargo run --example browser -- out/cornell.html`

mod bundle;

use std::{env, error::Error, fs, path::PathBuf};

fn main() -> Result<(), Box<dyn Error>> {
    let path = PathBuf::from(env::args().nth(1).ok_or("name the page to write: cargo run --example browser -- out/cornell.html")?);
    let compiler = bundle::Compiler::find()
        .ok_or("nothing here compiles for a browser: `rustup target add wasm32-unknown-unknown`, or Debian's rustc-web, cargo-web, rust-web-src and lld")?;
    let page = bundle::page(&compiler)?;
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    fs::write(&path, page)?;
    println!("wrote {}; open it in a browser that has WebGPU", path.display());
    Ok(())
}
