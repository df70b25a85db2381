//! The copy of the project that holds all changes which compile.

use crate::{
    Change, Work,
    place::{Place, Written, places},
};
use serde_json::Value;
use std::{
    collections::{BTreeMap, HashMap},
    ops::Range,
    path::Path,
    process::{Command, Stdio},
};

struct Source {
    text: String,
    places: Vec<Place>,
}

/// Where changes and places are in a file as it was written.
type Places = (Vec<(Range<usize>, usize)>, Vec<(Range<usize>, Vec<usize>)>);

/// Writes the copy, leaves out what does not compile, and gives each change that does its number, which names its place too.
pub fn make(work: &Work, changes: &mut [Change]) -> Vec<(usize, usize)> {
    let mut sources = BTreeMap::<String, Source>::new();
    let mut without = Vec::new();
    let of_file: BTreeMap<&str, Vec<(usize, &Change)>> =
        changes.iter().enumerate().filter(|(_, change)| change.left_out.is_none()).fold(BTreeMap::new(), |mut files, (index, change)| {
            files.entry(change.file.as_str()).or_insert_with(Vec::new).push((index, change));
            files
        });
    for (file, changes) in of_file {
        let text = std::fs::read_to_string(work.project.join(file)).expect("a file of the list");
        let (places, left) = places(&text, &changes);
        without.extend(left);
        sources.insert(file.to_owned(), Source { text, places });
    }
    without.into_iter().for_each(|index| changes[index].left_out = Some("no place for a number".into()));
    copy(work, &sources);
    loop {
        let (numbers, files) = rewrite(work, &sources);
        let errors = errors(work);
        if errors.is_empty() {
            return numbers;
        }
        for error in &errors {
            let Some(named) = blame(error, &files) else { panic!("not of a change: {}", error["rendered"].as_str().unwrap_or_default()) };
            let code = error["code"]["code"].as_str().unwrap_or("error");
            for index in named {
                changes[index].left_out.get_or_insert_with(|| format!("{code}: {}", error["message"].as_str().unwrap_or_default()));
            }
        }
        eprintln!("{} errors, {} changes are left", errors.len(), changes.iter().filter(|change| change.left_out.is_none()).count());
        for source in sources.values_mut() {
            source.places.retain_mut(|place| place.keep(|index| changes[index].left_out.is_none()));
        }
    }
}

/// All that git knows or would, but what is rewritten.
fn copy(work: &Work, sources: &BTreeMap<String, Source>) {
    let files = Command::new("git").args(["ls-files", "-co", "--exclude-standard", "-z"]).current_dir(&work.project).output().expect("git");
    let rewritten: Vec<_> = sources.keys().filter_map(|file| work.project.join(file).canonicalize().ok()).collect();
    for file in String::from_utf8_lossy(&files.stdout).split_terminator('\0') {
        let from = work.project.join(file);
        if from.is_file() && !rewritten.contains(&from.canonicalize().unwrap_or_default()) {
            put(&work.copy().join(file), &std::fs::read(from).expect("a file of the project"));
        }
    }
    let root = std::fs::read_to_string(work.project.join("src/lib.rs")).expect("the root of the library");
    let root = format!("#![allow(warnings, arithmetic_overflow, unconditional_panic)]\n{root}\npub mod mutant;\n");
    put(&work.copy().join("src/lib.rs"), root.as_bytes());
    put(&work.copy().join("src/mutant.rs"), include_bytes!("switch.rs"));
}

/// What is the same stays as old as it is, so that it is not built again.
fn put(file: &Path, bytes: &[u8]) {
    if std::fs::read(file).is_ok_and(|old| old == bytes) {
        return;
    }
    std::fs::create_dir_all(file.parent().expect("a folder")).and_then(|()| std::fs::write(file, bytes)).expect("room for the copy");
}

fn rewrite<'a>(work: &Work, sources: &'a BTreeMap<String, Source>) -> (Vec<(usize, usize)>, HashMap<&'a str, Places>) {
    let (mut numbers, mut files) = (Vec::new(), HashMap::new());
    for (file, source) in sources {
        let written = Written::new(&source.text, &source.places, &mut numbers);
        put(&work.copy().join(file), written.text.as_bytes());
        files.insert(file.as_str(), (written.changes, written.places));
    }
    (numbers, files)
}

/// Errors of the library with a place in its files; built with its tests, as these will be, so that crates are built once.
fn errors(work: &Work) -> Vec<Value> {
    let built = work.cargo("test").args(["--no-run", "--lib", "--message-format=json"]).stderr(Stdio::inherit()).output().expect("cargo");
    let messages = String::from_utf8_lossy(&built.stdout).lines().filter_map(|line| serde_json::from_str::<Value>(line).ok()).collect::<Vec<_>>();
    let messages = messages.into_iter().filter(|message| message["reason"] == "compiler-message").map(|mut message| message["message"].take());
    let errors: Vec<_> = messages.filter(|message| message["level"] == "error" && message["spans"].as_array().is_some_and(|spans| !spans.is_empty())).collect();
    assert!(built.status.success() || !errors.is_empty(), "the copy does not build");
    errors
}

/// The change whose text an error names, or else all changes of the innermost place around it.
fn blame(error: &Value, files: &HashMap<&str, Places>) -> Option<Vec<usize>> {
    let mut spans: Vec<&Value> = error["spans"].as_array()?.iter().collect();
    spans.sort_by_key(|span| span["is_primary"] != true);
    // Errors inside of macros are where those are called.
    let spans: Vec<_> = spans.into_iter().flat_map(|span| std::iter::successors(Some(span), |span| span["expansion"].get("span"))).collect();
    let range = |span: &Value| span["byte_start"].as_u64().unwrap_or(0) as usize..span["byte_end"].as_u64().unwrap_or(0) as usize;
    let around = |outer: &Range<usize>, inner: &Range<usize>| outer.start <= inner.start && inner.end <= outer.end;
    let of = |span: &Value| Some((files.get(span["file_name"].as_str()?)?, range(span)));
    let change = |span: &&Value| {
        let ((changes, _), at) = of(span)?;
        changes.iter().filter(|(range, _)| around(range, &at)).min_by_key(|(range, _)| range.len()).map(|(_, index)| vec![*index])
    };
    let place = |span: &&Value| {
        let ((_, places), at) = of(span)?;
        places.iter().filter(|(range, _)| around(range, &at)).min_by_key(|(range, _)| range.len()).map(|(_, indices)| indices.clone())
    };
    // A `match` that lacks an arm names its head alone: the next arm with a number, which has no text of its own, is one of its.
    let arm = |span: &&Value| {
        let ((changes, places), at) = of(span)?;
        let arms = places.iter().filter(|(range, indices)| range.start >= at.end && !changes.iter().any(|(_, index)| indices.contains(index)));
        arms.min_by_key(|(range, _)| range.start).map(|(_, indices)| indices.clone())
    };
    let lacks_arm = error["code"]["code"] == "E0004";
    spans.iter().find_map(change).or_else(|| spans.iter().find_map(|span| if lacks_arm { arm(span) } else { place(span) }))
}
