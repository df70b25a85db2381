//! Loading scenes: glTF, OBJ, PLY and this project's own RON documents.
//!
//! Every loader gathers a draft in double precision and the file's own coordinates; one place turns it into a
//! [`Scene`]: recentred, cleaned and in single precision.

mod compose;
mod daylight;
#[cfg(not(target_arch = "wasm32"))]
mod disk;
pub(super) mod draft;
mod error;
mod file_system;
mod files;
mod generate;
mod gltf;
mod image;
mod obj;
mod ply;
mod polygon;
mod primitives;
mod ron;
mod sky;
mod teapot;

pub use self::ron::about;
pub use daylight::{Daylight, Sky, Sun};
#[cfg(not(target_arch = "wasm32"))]
pub use disk::Disk;
pub use draft::MAX_TRIANGLES;
pub use error::{Problem, SceneError};
pub use file_system::{FileSystem, Memory, Stamp};

use super::model::Scene;
use draft::{Draft, Normals};
use error::suggestion;
use files::Files;
use std::{
    cell::Cell,
    collections::BTreeMap,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    sync::{Arc, Once},
};

/// The variable that names folders with scenes, separated as in PATH.
pub const SEARCH_VARIABLE: &str = "HEMISPLAT_SCENES";

/// Reflectance of surfaces whose material the files do not describe.
const PLAIN: f32 = 0.7;

/// The longest scene document that is read [bytes].
const MAX_DOCUMENT: u64 = 256 << 20;

/// The scenes that ship, by file name.
const EMBEDDED: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/scenes.rs"));

/// Where to look for files, and what to change in a scene.
#[derive(Debug, Clone)]
pub struct LoadOptions {
    /// Folders in which scenes and the files that they name are looked up, in this order.
    pub search: Vec<PathBuf>,
    /// Parameters of generators to override: key and value in RON.
    pub overrides: Vec<(String, String)>,
    /// What all files are read from.
    pub files: Arc<dyn FileSystem>,
}

impl Default for LoadOptions {
    /// Files of the system; none in a browser, which has no such.
    fn default() -> Self {
        #[cfg(not(target_arch = "wasm32"))]
        let files = Arc::new(Disk);
        #[cfg(target_arch = "wasm32")]
        let files = Arc::new(Memory::default());
        Self { search: Vec::new(), overrides: Vec::new(), files }
    }
}

impl LoadOptions {
    /// Adds the folders of `HEMISPLAT_SCENES` after those already given.
    pub fn with_environment(mut self) -> Self {
        if let Some(folders) = std::env::var_os(SEARCH_VARIABLE) {
            self.search.extend(std::env::split_paths(&folders).filter(|folder| !folder.as_os_str().is_empty()));
        }
        self
    }
}

/// The names of the scenes that ship inside the program.
pub fn embedded_scenes() -> impl Iterator<Item = &'static str> {
    EMBEDDED.iter().map(|(name, _)| *name)
}

/// Loads a scene from a `.gltf`, `.glb`, `.obj`, `.ply` or `.ron` file. A path is looked up as it stands, then among the
/// scenes that ship (`scenes/cornell.ron`, `cornell.ron` or `cornell`), then in the search folders.
///
/// # Errors
/// A file that is missing, broken, or beyond the stated limits; [`SceneError::problem`] says which. No input panics.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    let files = Files::of(&*options.files);
    if files.is_there(path) {
        return load_file(path, &files, options);
    }
    if let Some((name, text)) = find_embedded(path) {
        return load_document(Path::new(name), text, None, &files, options);
    }
    match options.search.iter().map(|folder| folder.join(path)).find(|candidate| files.is_there(candidate)) {
        Some(found) => load_file(&found, &files, options),
        None if options.files.canonical(path).is_ok() => Err(files::unreadable(path, &std::io::ErrorKind::InvalidInput.into())),
        None => Err(scene_not_found(path, options)),
    }
}

/// Loads a scene document that is not in a file; `name` is what errors and reports call it. Files that it names are looked up in the
/// working folder.
///
/// # Errors
/// As those of [`load`].
pub fn load_text(name: &str, text: &str) -> Result<Scene, SceneError> {
    let options = LoadOptions::default();
    load_document(Path::new(name), text, None, &Files::of(&*options.files), &options)
}

fn load_file(path: &Path, files: &Files, options: &LoadOptions) -> Result<Scene, SceneError> {
    if extension(path) == "ron" {
        expect_document(path, options)?;
        return load_document(path, &files.read_text(path)?, path.parent(), files, options);
    }
    refuse_overrides(options, &[])?;
    let mut draft = Draft::default();
    load_geometry(path, files, &mut draft, &|_| true)?;
    draft.finish(&stem(path), Normals::File, files)
}

/// Refuses a document before it is read that only a program can have written: a document names its geometry.
fn expect_document(path: &Path, options: &LoadOptions) -> Result<(), SceneError> {
    if options.files.stamp(path).is_none_or(|(bytes, _)| bytes <= MAX_DOCUMENT) {
        return Ok(());
    }
    let message = format!("the document `{}` is larger than {} MiB, the limit for one", path.display(), MAX_DOCUMENT >> 20);
    Err(SceneError::new(Problem::TooLarge, message).help("put its triangles into an .obj, .ply, .gltf or .glb file, and name that with File(…)"))
}

fn load_document(path: &Path, text: &str, folder: Option<&Path>, files: &Files, options: &LoadOptions) -> Result<Scene, SceneError> {
    let (draft, normals) = ron::read(path, text, folder, files, options)?;
    draft.finish(&stem(path), normals, files)
}

/// Adds what a geometry file holds to a draft; `wanted` says which of its materials need their textures.
fn load_geometry(path: &Path, files: &Files, draft: &mut Draft, wanted: &dyn Fn(&str) -> bool) -> Result<(), SceneError> {
    match extension(path).as_str() {
        "obj" => obj::read(path, files, draft, wanted),
        "ply" => ply::read(path, files, draft),
        "gltf" | "glb" => gltf::read(path, files, draft, wanted),
        "ron" => Err(SceneError::new(Problem::Format, format!("`{}` is a document, and a document cannot hold another", path.display()))
            .help("`File` takes .gltf, .glb, .obj and .ply files; copy the other document's geometry")),
        other => Err(SceneError::new(Problem::Format, format!("`{}`: no scene format has the extension `{other}`", path.display()))
            .help("scenes are read from .gltf, .glb, .obj, .ply and .ron files")),
    }
}

/// The file name and the text of a scene that ships.
pub fn find_embedded(path: &Path) -> Option<(&'static str, &'static str)> {
    let name = path.strip_prefix("scenes").unwrap_or(path).to_str()?;
    EMBEDDED.iter().copied().find(|(known, _)| *known == name || known.strip_suffix(".ron") == Some(name))
}

fn scene_not_found(path: &Path, options: &LoadOptions) -> SceneError {
    let asked = stem(path);
    let help = suggestion(&asked, embedded_scenes().map(|name| name.trim_end_matches(".ron")));
    SceneError::new(Problem::NotFound, format!("there is no scene `{}`{}", path.display(), tried(&options.search))).help(help)
}

fn tried(folders: &[PathBuf]) -> String {
    if folders.is_empty() {
        return String::new();
    }
    let folders: Vec<String> = folders.iter().map(|folder| folder.display().to_string()).collect();
    format!("; looked in {}", list(&folders))
}

/// Refuses overrides whose key is not among `known`.
fn refuse_overrides(options: &LoadOptions, known: &[&str]) -> Result<(), SceneError> {
    match options.overrides.iter().find(|(key, _)| !known.contains(&key.as_str())) {
        None => Ok(()),
        Some((key, _)) => {
            Err(SceneError::new(Problem::UnknownKey, format!("the scene has no parameter `{key}` to set")).help(suggestion(key, known.iter().copied())))
        }
    }
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// The first few of many, separated by commas.
fn list(items: &[String]) -> String {
    const SHOWN: usize = 4;
    let shown = items.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join(", ");
    if items.len() > SHOWN { format!("{shown} and {} more", items.len() - SHOWN) } else { shown }
}

/// What was met, in alphabetical order, and how often where that was more than once.
fn count_up(met: &BTreeMap<String, usize>) -> String {
    let count_one = |(what, &count): (&String, &usize)| if count > 1 { format!("{what} ({count})") } else { what.clone() };
    met.iter().map(count_one).collect::<Vec<_>>().join(", ")
}

/// Runs a decoder that others wrote; `None` where it panics, without a word on the terminal.
fn guard<T>(decode: impl FnOnce() -> T) -> Option<T> {
    thread_local!(static QUIET: Cell<bool> = const { Cell::new(false) });
    static INSTALL: Once = Once::new();
    INSTALL.call_once(|| {
        let previous = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if !QUIET.get() {
                previous(info);
            }
        }));
    });
    let before = QUIET.replace(true);
    let result = catch_unwind(AssertUnwindSafe(decode)).ok();
    QUIET.set(before);
    result
}

#[cfg(test)]
mod tests;
