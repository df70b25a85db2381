//! Lists what ships from its folders: shaders, pipelines, scenes and studies, each by name with its text.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    for (folder, ending, keeps_ending) in [("shaders", "wgsl", false), ("pipelines", "ron", true), ("scenes", "ron", true), ("studies", "ron", true)] {
        let folder_path = root.join(folder);
        println!("cargo:rerun-if-changed={}", folder_path.display());
        let mut files = Vec::new();
        find(&folder_path, ending, &mut files)?;
        let mut named: Vec<_> = files.iter().map(|file| (stem(file, &folder_path), file)).collect();
        // By stem, so that a method comes before its variants: `irradiance`, `irradiance-ward`.
        named.sort();
        let mut list = String::from("&[\n");
        for (stem, file) in named {
            let name = if keeps_ending { format!("{stem}.{ending}") } else { stem };
            // Debug quotes a string as Rust reads it.
            let _ = writeln!(list, "    ({name:?}, include_str!({:?})),", file.to_string_lossy());
        }
        fs::write(out.join(format!("{folder}.rs")), list + "]\n")?;
    }
    Ok(())
}

fn find(folder: &Path, ending: &str, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            find(&path, ending, files)?;
        } else if path.extension().is_some_and(|found| found == ending) {
            files.push(path);
        }
    }
    Ok(())
}

/// The path below the folder, with slashes and without its ending.
fn stem(file: &Path, folder: &Path) -> String {
    file.strip_prefix(folder).unwrap_or(file).with_extension("").to_string_lossy().replace('\\', "/")
}
