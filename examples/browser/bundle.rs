//! The library, compiled for a browser and packed into one page that needs nothing else.

use base64::{Engine, engine::general_purpose::STANDARD};
use std::{
    env,
    error::Error,
    fs,
    path::{Path, PathBuf},
    process::Command,
};
use wasm_bindgen_cli_support::Bindgen;

const TARGET: &str = "wasm32-unknown-unknown";
const PAGE: &str = include_str!("page/page.html");

/// What can compile for a browser.
pub enum Compiler {
    /// The toolchain in use has the target.
    Own,
    /// Debian's beside it, which builds the standard library from its source.
    Debian,
}

impl Compiler {
    /// None where there is none; `rustup target add wasm32-unknown-unknown` or Debian's rustc-web, cargo-web, rust-web-src and lld of the version that its
    /// rust-lld names make one.
    pub fn find() -> Option<Self> {
        let root = Command::new("rustc").args(["--print", "sysroot"]).output().ok()?;
        let root = PathBuf::from(String::from_utf8(root.stdout).ok()?.trim());
        let is_there = |parts: &[&str]| parts.iter().all(|part| Path::new(part).exists());
        match () {
            () if root.join("lib/rustlib").join(TARGET).is_dir() => Some(Self::Own),
            () if is_there(&["/usr/bin/cargo", "/usr/bin/rustc", "/usr/bin/rust-lld", "/usr/lib/rustlib/src/rust/library"]) => Some(Self::Debian),
            () => None,
        }
    }

    fn command(&self) -> Command {
        match self {
            Self::Own => Command::new("cargo"),
            Self::Debian => {
                let mut command = Command::new("/usr/bin/cargo");
                // Only what is told that it may builds the standard library.
                command.env("RUSTC", "/usr/bin/rustc").env("RUSTC_BOOTSTRAP", "1").env_remove("LD_LIBRARY_PATH");
                command
            }
        }
    }

    /// Compiles the page's program: the file that it lies in.
    fn compile(&self) -> Result<PathBuf, Box<dyn Error>> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let target = env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from).join("browsers");
        let mut command = self.command();
        command.current_dir(root).args(["build", "--locked", "--package", "hemisplat-page", "--profile", "browser", "--target", TARGET]);
        command.arg("--target-dir").arg(&target);
        // Every browser with WebGPU has them. Without, each vector of rays becomes scalars, which takes far longer to compile and to run.
        command.args(["--config", "target.wasm32-unknown-unknown.rustflags = ['-Ctarget-feature=+simd128']"]);
        if matches!(self, Self::Debian) {
            command.arg("-Zbuild-std=std,panic_abort");
        }
        let status = command.status()?;
        if !status.success() {
            return Err("the library does not compile for a browser".into());
        }
        Ok(target.join(TARGET).join("browser/hemisplat_page.wasm"))
    }
}

/// A page that draws the scene that its address names: `#scene=cornell&pipeline=irradiance&size=256x256`.
pub fn page(compiler: &Compiler) -> Result<String, Box<dyn Error>> {
    let bound = tempfile::tempdir()?;
    Bindgen::new().input_path(compiler.compile()?).no_modules(true)?.typescript(false).generate(bound.path())?;
    let glue = fs::read_to_string(bound.path().join("hemisplat_page.js"))?;
    let program = STANDARD.encode(fs::read(bound.path().join("hemisplat_page_bg.wasm"))?);
    Ok(PAGE.replace("/*GLUE*/", &glue).replace("/*PROGRAM*/", &program))
}
