//! `hemisplat new`

use super::console::Console;
use super::failure::{CommandError, Failure};
use super::output::Target;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

/// Write a commented start of a scene, a pipeline or a pass
#[derive(Args)]
#[command(after_help = "Example: hemisplat new scene room

  scene room       room.ron: a room, a lamp and a camera
  pipeline quick   quick.ron: direct light and one bounce, node by node
  pass Tint        in a checkout of hemisplat: passes/tint.rs, shaders/tint.wgsl, pipelines/tint.ron

Files that are there already stay as they are.")]
pub struct Options {
    /// What it is to be
    #[arg(value_enum)]
    kind: Kind,
    /// What it is called; of a scene or a pipeline, the file, with or without `.ron`
    name: String,
}

#[derive(Clone, Copy, ValueEnum)]
enum Kind {
    Scene,
    Pipeline,
    Pass,
}

/// A file to be written, and its text.
struct Start {
    path: PathBuf,
    text: String,
}

pub fn run(options: &Options, console: &Console) -> Result<(), Failure> {
    let (starts, next) = match options.kind {
        Kind::Scene => of_document(&options.name, include_str!("scene.ron"))?,
        Kind::Pipeline => of_document(&options.name, include_str!("pipeline.ron"))?,
        Kind::Pass => of_pass(&options.name)?,
    };
    if let Some(start) = starts.iter().find(|start| start.path.symlink_metadata().is_ok()) {
        return Err(Failure::input(CommandError::Exists { path: start.path.clone() }));
    }
    let targets: Vec<Target> = starts.iter().map(|start| Target::new(&start.path)).collect::<Result<_, _>>()?;
    for (target, start) in targets.iter().zip(&starts) {
        target.write(start.text.as_bytes())?;
    }
    let names: Vec<String> = starts.iter().map(|start| start.path.display().to_string()).collect();
    console.print(&format!("{}\n{next}\n", names.join("\n")))
}

/// What stands for the file's own name in templates of documents.
const DOCUMENT: &str = "START";

fn of_document(name: &str, template: &str) -> Result<(Vec<Start>, String), Failure> {
    let given = Path::new(name);
    let is_shown = !name.ends_with(['/', '\\']) && !name.contains(char::is_control);
    let file_name = given.file_name().and_then(|name| name.to_str()).filter(|_| is_shown);
    let stem = file_name.map(|name| name.strip_suffix(".ron").unwrap_or(name)).filter(|stem| is_plain(stem));
    let Some(stem) = stem else {
        let help = "letters, digits, `_`, `-` and spaces between them make one, folders may stand before it: rooms/attic";
        return Err(Failure::input(CommandError::BadName { name: name.into(), what: "a file", help }));
    };
    let path = given.with_file_name(format!("{stem}.ron"));
    let shown = path.display().to_string();
    let quoted = if shown.contains(' ') { format!("'{shown}'") } else { shown };
    let text = template.replace(&format!("{DOCUMENT}.ron"), &quoted).replace(DOCUMENT, stem);
    Ok((vec![Start { path, text }], "its first lines say what to do with it".into()))
}

/// Whether a name is one in file names, RON strings and shells.
fn is_plain(stem: &str) -> bool {
    let is_inner = |c: char| c.is_alphanumeric() || "_- ".contains(c);
    stem.starts_with(|c: char| c.is_alphanumeric()) && !stem.ends_with(' ') && stem.chars().all(is_inner)
}

/// What the template of a pass is called, as a type and as a file.
const PASS: [&str; 2] = ["Brighten", "brighten"];

fn of_pass(name: &str) -> Result<(Vec<Start>, String), Failure> {
    let is_type = name.starts_with(|c: char| c.is_ascii_uppercase()) && name.chars().all(|c| c.is_ascii_alphanumeric()) && name.len() <= MOST_LETTERS;
    if !is_type {
        let help = "passes are called like types, in letters and digits, a capital first: Tint, BlurAlong";
        return Err(Failure::input(CommandError::BadName { name: name.into(), what: "a pass", help }));
    }
    if !Path::new("passes/mod.rs").is_file() {
        return Err(Failure::input(CommandError::NoCheckout));
    }
    let file = snake(name);
    let folder = Path::new("passes").join(&file);
    if folder.is_dir() {
        return Err(Failure::input(CommandError::Exists { path: folder }));
    }
    let named = |template: &str| template.replace(PASS[0], name).replace(PASS[1], &file);
    let starts = [
        (format!("passes/{file}.rs"), include_str!("brighten.rs")),
        (format!("shaders/{file}.wgsl"), include_str!("brighten.wgsl")),
        (format!("pipelines/{file}.ron"), include_str!("brighten.ron")),
    ];
    let starts = starts.map(|(path, template)| Start { path: path.into(), text: named(template) });
    let next = format!(
        "list it in passes/mod.rs: `pub mod {file};` among the modules, `&{file}::{name},` in the REGISTRY;\nthen `cargo run --release -- render {file} --scene cornell -o out.png`; docs/passes.md tells the rest"
    );
    Ok((starts.into(), next))
}

/// Of a pass's name: as a file of it may be called everywhere.
const MOST_LETTERS: usize = 60;

/// `BlurAlong` as `blur_along`.
fn snake(name: &str) -> String {
    let mut snake = String::new();
    let mut follows_small = false;
    for letter in name.chars() {
        if letter.is_ascii_uppercase() && follows_small {
            snake.push('_');
        }
        follows_small = !letter.is_ascii_uppercase();
        snake.push(letter.to_ascii_lowercase());
    }
    snake
}

#[cfg(test)]
#[path = "brighten.rs"]
mod brighten;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contract::Pass;

    #[test]
    fn passes_are_called_like_types_and_their_files_like_modules() {
        for (name, file) in [("Tint", "tint"), ("BlurAlong", "blur_along"), ("HSHSum", "hshsum"), ("Sum2D", "sum2_d")] {
            assert_eq!(snake(name), file);
        }
        for bad in ["", "tint", "Blur Along", "Blur-Along", "../Tint", "1st", "Über"] {
            assert_eq!(of_pass(bad).err().map(|failure| failure.status), Some(2), "{bad}");
        }
    }

    #[test]
    fn documents_are_called_as_files_may_be() {
        let path = |name: &str| of_document(name, "START in START.ron").map(|(starts, _)| (starts[0].path.clone(), starts[0].text.clone())).ok();
        for (name, file, text) in [
            ("room", "room.ron", "room in room.ron"),
            ("room.ron", "room.ron", "room in room.ron"),
            ("rooms/an attic", "rooms/an attic.ron", "an attic in 'rooms/an attic.ron'"),
        ] {
            assert_eq!(path(name), Some((file.into(), text.into())));
        }
        for bad in ["", ".", "..", "rooms/", "a\"b", "-o", "a\nb", "a\nb/room", ".ron", "room.gltf", "a "] {
            assert_eq!(path(bad), None, "{bad:?}");
        }
    }

    /// That it compiles is seen by this test's being there.
    #[test]
    fn the_pass_is_called_as_its_shader_and_its_pipeline_have_it() {
        let description = brighten::Brighten.description();
        let [by_type, by_file] = PASS;
        assert_eq!(description.name, by_type);
        assert_eq!(snake(by_type), by_file);
        assert!(include_str!("brighten.rs").contains(&format!("Program::new(\"{by_file}\")")));
        assert!(include_str!("brighten.ron").contains(&format!("pass: {by_type}(")));
        let shader = naga::front::wgsl::parse_str(include_str!("brighten.wgsl")).unwrap();
        let mut validator = naga::valid::Validator::new(Default::default(), Default::default());
        validator.validate(&shader).unwrap();
    }
}
