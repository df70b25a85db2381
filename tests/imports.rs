//! The modules import one way only, and only some of them touch files or threads.

use std::fs;
use std::path::{Path, PathBuf};

/// What each module may name of the crate, beside itself. Mathematics and the scene are ground that all others stand on.
const MAY_NAME: [(&str, &[&str]); 11] = [
    ("math", &[]),
    ("scene", &["math"]),
    ("reference", &["math", "scene"]),
    ("schedule", &["math", "scene"]),
    ("contract", &["schedule", "math", "scene"]),
    ("pipeline", &["contract", "schedule", "math", "scene"]),
    ("passes", &["contract", "schedule", "math", "scene"]),
    ("gpu", &["schedule", "math", "scene"]),
    ("measure", &["pipeline", "contract", "schedule", "gpu", "math", "scene"]),
    ("engine", &["measure", "passes", "pipeline", "contract", "schedule", "gpu", "math", "scene"]),
    ("cli", &["math", "scene", "reference", "schedule", "contract", "pipeline", "passes", "gpu", "measure"]),
];

/// Where files may be read: by the program, and for scenes behind one trait. Shaders in a folder are read while developing only.
const MAY_READ_FILES: [&str; 3] = ["src/cli/", "src/scene/load/disk.rs", "src/gpu/shader.rs"];

/// What files are called.
const FILES: [&str; 8] = ["std::fs", "File::open", "File::create", "tempfile", "fs::", ".canonicalize(", ".is_file()", ".exists()"];

/// Where the work is divided among threads; everything else has to run in a browser too. Images are decoded, shaders are built, tiles of rays
/// cast, summed and projected, records added, aged, asked for, filtered and splatted, their gaps closed, paths walked, misses looked for, skies turned, vertices and triangles moved, photons followed, sorted, gathered and walked through, obstacles looked for, texels cut by walls, chosen, shot at and averaged, blocks of files compressed side by side,
/// where rayon has threads to do it.
const MAY_HAVE_THREADS: [&str; 46] = [
    "src/cli/",
    "src/scene/atlas.rs",
    "src/scene/atlas/walls.rs",
    "src/scene/load/image.rs",
    "src/scene/packets/mod.rs",
    "src/scene/parts.rs",
    "src/scene/shape.rs",
    "src/scene/stage.rs",
    "src/reference/",
    "src/gpu/cores.rs",
    "src/gpu/shaders.rs",
    "src/measure/blocks.rs",
    "passes/add_irradiance.rs",
    "passes/add_records.rs",
    "passes/age_records.rs",
    "passes/average.rs",
    "passes/choose_texel.rs",
    "passes/direct_light/host.rs",
    "passes/direct_light/sky.rs",
    "passes/due_records.rs",
    "passes/environment_light/host.rs",
    "passes/filter_records.rs",
    "passes/find_misses/host_grid.rs",
    "passes/irradiance_sum/host.rs",
    "passes/living_radiance.rs",
    "passes/normalize/coarser.rs",
    "passes/path_vertices.rs",
    "passes/contribution/bands.rs",
    "passes/hemisphere_tiles/host_rays.rs",
    "passes/hemisphere_tiles/steering.rs",
    "passes/gather_near.rs",
    "passes/indirect_light.rs",
    "passes/lightmap.rs",
    "passes/lightmap_field.rs",
    "passes/texels.rs",
    "passes/lobe_rays/mod.rs",
    "passes/photon_map/",
    "passes/photon_tiles.rs",
    "passes/photons/mod.rs",
    "passes/shoot/mod.rs",
    "passes/surroundings.rs",
    "src/math/record_index.rs",
    "src/math/record_tree.rs",
    "src/math/thinning.rs",
    "src/math/walk.rs",
    "passes/radiance_projection/host.rs",
];

/// What threads are called.
const THREADS: [&str; 2] = ["std::thread", "rayon"];

/// Where a thread may wait for the device: the program's own, and one of many that build shaders. A browser's must not.
const MAY_BLOCK: [&str; 6] = ["src/cli/", "src/lib.rs", "src/measure/stability/", "src/gpu/cores.rs", "src/gpu/device.rs", "src/gpu/mod.rs"];

/// How a thread waits.
const BLOCKING: [&str; 4] = ["block_on", "mpsc", "Condvar", "sleep("];

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

/// Names of modules that stand above the one that names them.
fn wrong_imports(sources: &[Source]) -> Vec<String> {
    let known = |name: &str| MAY_NAME.iter().find(|(module, _)| *module == name);
    let mut wrong = Vec::new();
    for source in sources {
        let Some(module) = source.module() else { continue };
        let Some((_, allowed)) = known(module) else {
            wrong.push(format!("{}: module `{module}` has no place in the order", source.path));
            continue;
        };
        let names = names_after(&source.code, "crate::").into_iter();
        let above = names.filter(|name| known(name).is_some() && name != module && !allowed.contains(&name.as_str()));
        wrong.extend(above.map(|name| format!("{}: `{module}` names `{name}`", source.path)));
    }
    wrong
}

/// Passes that name one another.
fn wrong_passes(sources: &[Source]) -> Vec<String> {
    let passes: Vec<&Source> = sources.iter().filter(|source| source.path.starts_with("passes/") && source.path != "passes/mod.rs").collect();
    let stem = |source: &Source| source.path["passes/".len()..].split('/').next().unwrap_or_default().trim_end_matches(".rs").to_owned();
    // What several passes share, such as the layout of records, is no pass.
    let stems: Vec<String> = passes.iter().filter(|source| source.code.contains("impl Pass for ")).map(|source| stem(source)).collect();
    let mut wrong = Vec::new();
    for source in &passes {
        // A folder's own ways name each other by `super::`; only another pass's stem is a fault.
        let named = ["crate::passes::", "super::"].into_iter().flat_map(|prefix| names_after(without_tests(&source.code), prefix));
        wrong.extend(named.filter(|name| stems.contains(name) && *name != stem(source)).map(|name| format!("{} names `{name}`", source.path)));
    }
    wrong
}

/// Files and threads where a browser has none.
fn wrong_system(sources: &[Source]) -> Vec<String> {
    let uses = |allowed: &[&str], names: &[&str]| -> Vec<String> {
        let bound = sources.iter().filter(|source| !source.path.contains("/tests/") && !allowed.iter().any(|place| source.path.starts_with(place)));
        let used = bound.flat_map(|source| {
            let code = without_tests(&source.code);
            names.iter().filter(|name| code.contains(**name)).map(|name| format!("{} uses {name}", source.path)).collect::<Vec<_>>()
        });
        used.collect()
    };
    [uses(&MAY_READ_FILES, &FILES), uses(&MAY_HAVE_THREADS, &THREADS)].concat()
}

/// Threads that wait, and clocks of the system, where a browser has neither. The program may have both.
fn wrong_waiting(sources: &[Source]) -> Vec<String> {
    let mut wrong = Vec::new();
    for source in sources.iter().filter(|source| !source.path.starts_with("src/cli/") && !source.path.contains("/tests/")) {
        let code = without_tests(&source.code);
        if !MAY_BLOCK.iter().any(|place| source.path.starts_with(place)) {
            wrong.extend(BLOCKING.iter().filter(|name| code.contains(**name)).map(|name| format!("{} uses {name}", source.path)));
        }
        if code.contains("Instant") && !code.contains("web_time::") {
            wrong.push(format!("{} uses a clock that is not web_time's", source.path));
        }
    }
    wrong
}

#[test]
fn nothing_waits_where_a_browser_must_not() {
    let wrong = wrong_waiting(&sources());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let source = |path: &str, code: &str| Source { path: path.into(), code: code.into() };
    let broken =
        [source("src/gpu/frame.rs", "block_on(x)"), source("src/gpu/frame.rs", "use std::{io, time::Instant};"), source("src/cli/a.rs", "block_on(x)")];
    assert_eq!(wrong_waiting(&broken).len(), 2);
}

#[test]
fn imports_run_one_way() {
    let wrong = wrong_imports(&sources());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn passes_do_not_name_each_other() {
    let wrong = wrong_passes(&sources());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn files_and_threads_stay_where_they_belong() {
    let wrong = wrong_system(&sources());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Sources that break a rule each: none may pass.
#[test]
fn broken_rules_are_seen() {
    let source = |path: &str, code: &str| Source { path: path.into(), code: code.into() };
    let imports = [
        source("src/math/a.rs", "use crate::scene::Scene;"),
        source("src/scene/a.rs", "use crate::{math, gpu::Gpu};"),
        source("src/contract/a.rs", "fn f() { crate::passes::REGISTRY; }"),
        source("passes/a.rs", "use crate::gpu;"),
        source("src/new/a.rs", ""),
    ];
    assert_eq!(wrong_imports(&imports).len(), imports.len(), "{:?}", wrong_imports(&imports));
    let passes = [
        source("passes/a.rs", "use super::b::B; impl Pass for A {}"),
        source("passes/b/mod.rs", "use crate::passes::a; impl Pass for B {}"),
        source("passes/b/way.rs", "use super::Work;"),
        source("passes/shared.rs", ""),
    ];
    assert_eq!(wrong_passes(&passes).len(), 2, "{:?}", wrong_passes(&passes));
    let system = [source("src/gpu/a.rs", "std::fs::read(x)"), source("passes/a.rs", "use rayon::x;"), source("src/cli/a.rs", "std::fs::read(x)")];
    assert_eq!(wrong_system(&system).iter().filter(|wrong| wrong.contains("src/cli")).count(), 0);
    assert!(["src/gpu", "passes"].iter().all(|place| wrong_system(&system).iter().any(|wrong| wrong.contains(place))));
}

#[test]
fn the_tests_see_what_they_look_for() {
    assert_eq!(names_after("use crate::{scene::{a, b}, math,\n cli::x};", "crate::"), ["scene", "math", "cli"]);
    assert_eq!(names_after("let x = crate::gpu::y; pub(crate) fn z() {}", "crate::"), ["gpu"]);
    assert_eq!(without_comments("a // crate::cli\n/// crate::cli\nb"), "a \n\nb");
    assert!(sources().iter().any(|source| source.module() == Some("cli")));
}

/// A test that leaves something out by itself would be reported as passed.
#[test]
fn only_one_place_leaves_tests_out() {
    let mut found = Vec::new();
    collect(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests"), &mut found);
    let tells = ["\"SKIPPED", "\"skipped:", "\"HEMISPLAT_REQUIRE"];
    let by_themselves = found.iter().filter(|path| !path.ends_with("skips/mod.rs") && !path.ends_with("imports.rs"));
    let by_themselves: Vec<_> = by_themselves.filter(|path| tells.iter().any(|told| leaves_out(&fs::read_to_string(path).unwrap(), told))).collect();
    assert!(by_themselves.is_empty(), "{by_themselves:?} should ask tests/skips");
    assert!(leaves_out("println!(\"SKIPPED: x\")", tells[0]) && !leaves_out("assert!(a.contains(\"SKIPPED\"))", tells[0]));
}

/// Whether a text prints or asks for this, other than in an assertion or for a process of its own.
fn leaves_out(text: &str, told: &str) -> bool {
    text.lines().any(|line| line.contains(told) && (line.contains("print") || line.contains("var(")))
}
