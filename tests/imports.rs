//! The modules import one way only, and only some of them touch files or threads.

use std::fs;
use std::path::{Path, PathBuf};

/// What each module may name of the crate, beside itself. Mathematics and the scene are ground that all others stand on.
const MAY_NAME: [(&str, &[&str]); 10] = [
    ("math", &[]),
    ("scene", &["math"]),
    ("reference", &["math", "scene"]),
    ("recording", &["math", "scene"]),
    ("contract", &["recording", "math", "scene"]),
    ("pipeline", &["contract", "recording", "math", "scene"]),
    ("passes", &["contract", "recording", "math", "scene"]),
    ("gpu", &["recording", "math", "scene"]),
    ("measure", &["pipeline", "contract", "recording", "gpu", "math", "scene"]),
    ("cli", &["math", "scene", "reference", "recording", "contract", "pipeline", "passes", "gpu", "measure"]),
];

/// Where files may be read and threads be started; everything else has to run in a browser too.
const MAY_TOUCH_THE_SYSTEM: [&str; 3] = ["src/cli/", "src/scene/load", "src/reference/"];

/// What files and threads are called.
const SYSTEM: [&str; 7] = ["std::fs", "std::thread", "rayon", "File::open", "File::create", "tempfile", "fs::"];

struct Source {
    /// From the crate's root, with slashes.
    path: String,
    /// Without comments and, if asked for, tests.
    code: String,
}

impl Source {
    /// The module at the crate's root that the file belongs to; `None` for lib.rs and main.rs, which join the others.
    fn module(&self) -> Option<&str> {
        let mut parts = self.path.split('/');
        match (parts.next()?, parts.next()?) {
            ("passes", _) => Some("passes"),
            (_, "lib.rs" | "main.rs") => None,
            (_, module) => Some(module.trim_end_matches(".rs")),
        }
    }
}

fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = Vec::new();
    for folder in ["src", "passes"] {
        collect(&root.join(folder), &mut found);
    }
    found.sort();
    let relative = |path: &Path| path.strip_prefix(root).unwrap().to_string_lossy().replace('\\', "/");
    found.iter().map(|path| Source { path: relative(path), code: without_comments(&fs::read_to_string(path).unwrap()) }).collect()
}

fn collect(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

fn without_comments(text: &str) -> String {
    text.lines().map(|line| line.split_once("//").map_or(line, |(code, _)| code)).collect::<Vec<_>>().join("\n")
}

/// The code before its tests, which stand at a file's end.
fn without_tests(code: &str) -> &str {
    code.split("#[cfg(test)]").next().unwrap_or(code)
}

/// The first names of all paths that begin with `prefix`, groups in braces included.
fn names_after(code: &str, prefix: &str) -> Vec<String> {
    code.match_indices(prefix).flat_map(|(at, _)| first_names(&code[at + prefix.len()..])).collect()
}

fn first_names(path: &str) -> Vec<String> {
    let identifier = |text: &str| text.chars().take_while(|letter| letter.is_alphanumeric() || *letter == '_').collect::<String>();
    let Some(group) = path.strip_prefix('{') else { return vec![identifier(path)] };
    let (mut depth, mut names, mut expecting) = (1, Vec::new(), true);
    for (at, letter) in group.char_indices() {
        match letter {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 1 => expecting = true,
            letter if expecting && depth == 1 && !letter.is_whitespace() => {
                names.push(identifier(&group[at..]));
                expecting = false;
            }
            _ => {}
        }
        if depth == 0 {
            break;
        }
    }
    names
}

#[test]
fn imports_run_one_way() {
    let known = |name: &str| MAY_NAME.iter().find(|(module, _)| *module == name);
    let mut wrong = Vec::new();
    for source in sources() {
        let Some(module) = source.module() else { continue };
        let (_, allowed) = known(module).unwrap_or_else(|| panic!("{}: module `{module}` has no place in the order", source.path));
        for name in names_after(&source.code, "crate::") {
            if known(&name).is_some() && name != module && !allowed.contains(&name.as_str()) {
                wrong.push(format!("{}: `{module}` names `{name}`", source.path));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn passes_do_not_name_each_other() {
    let passes: Vec<Source> = sources().into_iter().filter(|source| source.path.starts_with("passes/") && source.path != "passes/mod.rs").collect();
    let stem = |source: &Source| source.path["passes/".len()..].split('/').next().unwrap_or_default().trim_end_matches(".rs").to_owned();
    // What several passes share, such as the layout of records, is no pass.
    let stems: Vec<String> = passes.iter().filter(|source| source.code.contains("impl Pass for ")).map(stem).collect();
    assert!(!stems.is_empty());
    let mut wrong = Vec::new();
    for source in &passes {
        // A folder's own ways name each other by `super::`; only another pass's stem is a fault.
        let named = ["crate::passes::", "super::"].into_iter().flat_map(|prefix| names_after(without_tests(&source.code), prefix));
        wrong.extend(named.filter(|name| stems.contains(name) && *name != stem(source)).map(|name| format!("{} names `{name}`", source.path)));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn files_and_threads_stay_where_they_belong() {
    let mut wrong = Vec::new();
    for source in sources() {
        if MAY_TOUCH_THE_SYSTEM.iter().any(|place| source.path.starts_with(place)) {
            continue;
        }
        let code = without_tests(&source.code);
        wrong.extend(SYSTEM.iter().filter(|name| code.contains(**name)).map(|name| format!("{} uses {name}", source.path)));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_tests_see_what_they_look_for() {
    assert_eq!(names_after("use crate::{scene::{a, b}, math,\n cli::x};", "crate::"), ["scene", "math", "cli"]);
    assert_eq!(names_after("let x = crate::gpu::y; pub(crate) fn z() {}", "crate::"), ["gpu"]);
    assert_eq!(without_comments("a // crate::cli\n/// crate::cli\nb"), "a \n\nb");
    assert!(sources().iter().any(|source| source.module() == Some("cli")));
}
