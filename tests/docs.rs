//! The README and the book say what is so: documents in them are read, checked and planned, commands have the options and
//! parameters that they use, quoted code stands in the file named, links lead somewhere, and no page is missing from the contents.

use hemisplat::{
    cli,
    contract::encoder::Setting,
    gpu::scene::kind,
    measure::{Layer, Layers, PICTURE, criteria::Cost, study},
    passes::REGISTRY,
    pipeline::{self, PerFrame, Values, embedded},
    scene::{load, needs::Needs},
};
use std::{
    collections::BTreeSet,
    fs, io,
    path::{Path, PathBuf},
};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A page, from the root of the project.
struct Page {
    path: PathBuf,
    text: String,
}

/// What stands between two fences.
struct Block {
    language: String,
    text: String,
}

fn pages() -> Vec<Page> {
    let book = fs::read_dir(root().join("docs")).unwrap().map(|entry| Path::new("docs").join(entry.unwrap().file_name()));
    let mut paths: Vec<PathBuf> = book.filter(|path| path.extension().is_some_and(|ending| ending == "md")).collect();
    paths.sort();
    paths.extend(["README.md", "CHANGELOG.md", "CONTRIBUTING.md"].map(PathBuf::from));
    paths.into_iter().map(|path| Page { text: fs::read_to_string(root().join(&path)).unwrap(), path }).collect()
}

impl Page {
    /// Text and blocks in turn, text first.
    fn parts(&self) -> impl Iterator<Item = (usize, &str)> {
        self.text.split("```").enumerate()
    }

    fn blocks(&self) -> Vec<Block> {
        let block = |part: &str| part.split_once('\n').map(|(language, text)| Block { language: language.trim().into(), text: text.into() });
        self.parts().filter(|(index, _)| index % 2 == 1).filter_map(|(_, part)| block(part)).collect()
    }

    fn blocks_in(&self, language: &str) -> Vec<String> {
        self.blocks().into_iter().filter(|block| block.language == language).map(|block| block.text).collect()
    }

    /// What stands between single backquotes, line breaks as blanks.
    fn spans(&self) -> Vec<String> {
        let texts = self.parts().filter(|(index, _)| index % 2 == 0).map(|(_, part)| part);
        let spans = texts.flat_map(|text| text.split('`').enumerate().filter(|(index, _)| index % 2 == 1).map(|(_, span)| span));
        spans.map(|span| span.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
    }

    /// Every `hemisplat …` of blocks and of the text, where a command's name may stand alone: its help will do.
    fn commands(&self) -> Vec<String> {
        let blocks = self.blocks();
        let lines = blocks.iter().flat_map(|block| block.text.lines()).map(str::to_owned);
        let spans = self.spans().into_iter().map(|span| if words(&span).len() == 2 { span + " --help" } else { span });
        lines.chain(spans).filter(|line| line.starts_with("hemisplat ")).collect()
    }
}

/// The words of a line as a shell would split it, without its comment and without the file that its result goes to.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quoted) = (Vec::new(), String::new(), false);
    for letter in line.split(" #").flat_map(|part| part.split(" > ")).next().unwrap_or_default().chars() {
        match letter {
            '\'' => quoted = !quoted,
            ' ' if !quoted => words.push(std::mem::take(&mut word)),
            _ => word.push(letter),
        }
    }
    words.push(word);
    words.retain(|word| !word.is_empty());
    words
}

/// Reads `text` as the file `docs/example.ron`.
fn load_pipeline(text: &str) -> Result<pipeline::Pipeline, pipeline::Problems> {
    let mut read = |path: &Path| if path == Path::new("docs/example.ron") { Ok(text.to_owned()) } else { Err(io::ErrorKind::NotFound.into()) };
    pipeline::load("docs/example.ron", &[], REGISTRY, &mut read)
}

#[track_caller]
fn expect<T>(result: Result<T, impl miette::Diagnostic + Send + Sync + 'static>, of: &str) -> T {
    result.unwrap_or_else(|error| panic!("{of}\n{:?}", miette::Report::new(error)))
}

fn check_pipeline(text: &str) {
    let pipeline = expect(load_pipeline(text), text);
    let scene = expect(load::load(Path::new("corner"), &load::LoadOptions::default()), "corner");
    let needs = Needs::of(&scene);
    let setting = Setting { scene: &scene, needs: &needs, device: hemisplat::schedule::Device::ABLE, size: [32, 24], tables: None };
    expect(pipeline::plan(&pipeline, setting, &[], &kind), text);
}

/// Loads a scene with the page's geometry and a sky beside it.
fn check_scene(page: &Page, text: &str) {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    let sky = Layers::new(2, 1).with(PICTURE, Layer::interleaved(&["R", "G", "B"], &[1.0; 6], 3));
    write("sky.exr", &sky.to_exr().unwrap());
    page.blocks_in("obj").iter().for_each(|obj| write("chair.obj", obj.as_bytes()));
    write("example.ron", text.as_bytes());
    let scene = expect(load::load(&folder.path().join("example.ron"), &load::LoadOptions::default()), text);
    assert!(scene.notes.is_empty(), "{:?}", scene.notes);
}

/// Reads a study and every pipeline that it names.
fn check_study(text: &str) {
    let study = expect(study::read("docs/example.ron", text), text);
    for (row, sets, _) in study.survey.points() {
        expect(pipeline::load_with(&row.pipeline, &sets, REGISTRY, &mut |_| Err(io::ErrorKind::NotFound.into())), text);
    }
}

#[test]
fn documents_are_read_checked_and_planned() {
    let mut kinds = BTreeSet::new();
    for page in pages() {
        for text in page.blocks_in("ron") {
            let kind = text.trim_start().split('(').next().unwrap_or_default().to_owned();
            match kind.as_str() {
                "Scene" => check_scene(&page, &text),
                "Pipeline" | "Variant" => check_pipeline(&text),
                "Study" => check_study(&text),
                _ => panic!("{}: neither a scene, a pipeline nor a study:\n{text}", page.path.display()),
            }
            kinds.insert(kind);
        }
    }
    assert_eq!(kinds.len(), 4, "{kinds:?}");
}

/// The parameters that a command sets, of a pipeline that ships.
fn check_sets(matches: &clap::ArgMatches, line: &str) {
    let all = |id: &str| matches.try_get_many::<String>(id).ok().flatten().into_iter().flatten().cloned().collect::<Vec<_>>();
    let per_frame = all("per_frame").into_iter().map(|text| expect(PerFrame::parse(&text), line).set(0));
    let sets: Vec<String> = all("sets").into_iter().chain(per_frame).collect();
    for name in all("pipeline").iter().chain(&all("pipelines")).filter(|name| embedded::find(name).is_some()) {
        expect(pipeline::load(name, &sets, REGISTRY, &mut |_| Err(io::ErrorKind::NotFound.into())), line);
    }
    all("study").iter().for_each(|name| check_study(study::embedded::find(name).expect(line).1));
    all("cost").iter().for_each(|cost| drop(expect(Cost::parse("--cost", cost), line)));
    let over: Vec<Values> = all("over").iter().map(|text| expect(Values::parse("--over", text), line)).collect();
    let most = over.iter().map(|values| values.values.len()).max().unwrap_or(1);
    let swept = (0..most).map(|index| over.iter().map(move |values| values.set(index)).collect::<Vec<_>>());
    for (variant, swept) in all("variants").into_iter().flat_map(|variant| swept.clone().map(move |swept| (variant.clone(), swept))) {
        let mut parts = variant.split('@').map(str::to_owned);
        let name = parts.next().unwrap_or_default();
        let sets: Vec<String> = sets.iter().cloned().chain(parts).chain(swept).collect();
        expect(pipeline::load(&name, &sets, REGISTRY, &mut |_| Err(io::ErrorKind::NotFound.into())), line);
    }
}

#[test]
fn commands_have_the_options_and_parameters_that_they_use() {
    let mut seen = 0;
    for page in pages() {
        for line in page.commands() {
            match cli::command().try_get_matches_from(words(&line)) {
                Ok(matches) => matches.subcommand().into_iter().for_each(|(_, matches)| check_sets(matches, &line)),
                Err(error) => assert_eq!(error.exit_code(), 0, "{}: {line}\n{error}", page.path.display()),
            }
            seen += 1;
        }
    }
    assert!(seen > 20, "{seen}");
}

#[test]
fn options_that_the_text_names_exist() {
    let program = cli::command();
    let longs = |command: &clap::Command| command.get_arguments().filter_map(|argument| argument.get_long().map(str::to_owned)).collect::<Vec<_>>();
    let known: BTreeSet<String> = program.get_subcommands().chain([&program]).flat_map(longs).collect();
    for page in pages() {
        for span in page.spans() {
            let named = span.split([' ', '=']).next().and_then(|word| word.strip_prefix("--"));
            assert!(named.is_none_or(|name| known.contains(name)), "{}: there is no `{span}`", page.path.display());
        }
    }
}

#[test]
fn quoted_code_stands_in_the_file_named() {
    let mut seen = 0;
    for page in pages() {
        for block in page.blocks().into_iter().filter(|block| ["rust", "wgsl"].contains(&block.language.as_str())) {
            let (path, code) =
                block.text.split_once('\n').and_then(|(first, code)| Some((first.strip_prefix("// ")?, code))).expect("a block begins with its file");
            let text = fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"));
            assert!(text.contains(code), "{}: {path} does not hold\n{code}", page.path.display());
            seen += 1;
        }
    }
    assert!(seen > 0);
}

/// The anchors of a page's headings, as GitHub makes them.
fn anchors(text: &str) -> BTreeSet<String> {
    let lines = text.split("```").step_by(2).flat_map(str::lines).filter(|line| line.starts_with('#'));
    let kept = |letter: &char| letter.is_alphanumeric() || [' ', '-', '_'].contains(letter);
    lines.map(|line| line.trim_start_matches('#').trim().to_lowercase().chars().filter(kept).collect::<String>().replace(' ', "-")).collect()
}

#[test]
fn links_lead_to_headings() {
    for page in pages() {
        for (file, anchor) in page.text.split("](").skip(1).filter_map(|rest| rest.split(')').next()?.split_once('#')) {
            if file.contains("://") || !(file.is_empty() || file.ends_with(".md")) {
                continue;
            }
            let path = if file.is_empty() { page.path.clone() } else { page.path.parent().unwrap().join(file) };
            let text = fs::read_to_string(root().join(&path)).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            assert!(anchors(&text).contains(anchor), "{}: {file} has no heading `{anchor}`", page.path.display());
        }
    }
}

#[test]
fn terms_are_in_alphabetical_order() {
    let page = fs::read_to_string(root().join("docs/terms.md")).unwrap();
    let terms: Vec<String> = page.split("\n- **").skip(1).filter_map(|item| Some(item.split("**").next()?.to_lowercase())).collect();
    assert!(terms.len() > 50);
    assert!(terms.is_sorted(), "{:?}", terms.windows(2).find(|pair| pair[0] > pair[1]));
}

#[test]
fn links_lead_to_files_and_the_contents_name_every_page() {
    let mut listed = BTreeSet::new();
    for page in pages() {
        for target in page.text.split("](").skip(1).filter_map(|rest| rest.split([')', '#']).next()) {
            if target.is_empty() || target.contains("://") {
                continue;
            }
            let file = page.path.parent().unwrap().join(target);
            assert!(root().join(&file).exists(), "{}: {target} leads nowhere", page.path.display());
            if page.path == Path::new("docs/README.md") {
                listed.insert(file);
            }
        }
    }
    let missing: Vec<_> =
        pages().into_iter().map(|page| page.path).filter(|path| path.starts_with("docs") && !path.ends_with("README.md") && !listed.contains(path)).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

/// The words of a text that begin with `scene::`.
fn scene_codes(text: &str, before: char) -> BTreeSet<String> {
    let ends = |code: &str| code.split(|letter: char| !letter.is_alphanumeric() && letter != '_' && letter != ':').next().map(str::to_owned);
    text.split(&format!("{before}scene::")).skip(1).filter_map(ends).collect()
}

#[test]
fn the_codes_of_scenes_are_those_that_the_loader_has() {
    let [page, source] = ["docs/scenes.md", "src/scene/load/error.rs"].map(|path| fs::read_to_string(root().join(path)).unwrap());
    let codes = scene_codes(&page, '`');
    assert!(codes.contains("not_found"));
    assert_eq!(codes, scene_codes(&source, '"'));
}

/// What docs/sources.md has of one source, and the names in bold by which it is cited.
struct Source {
    names: Vec<String>,
    text: String,
}

fn sources() -> Vec<Source> {
    let page = fs::read_to_string(root().join("docs/sources.md")).unwrap();
    let names = |item: &str| item.split("**").skip(1).step_by(2).map(|name| name.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
    page.split("\n- ").skip(1).filter(|item| item.starts_with("**")).map(|item| Source { names: names(item), text: item.into() }).collect()
}

/// What is wrong with the value of a `source`: a part that names no source of the page, or one that the page lacks.
fn unlisted<'t>(source: &'t str, names: &[String]) -> Vec<&'t str> {
    let is_listed = |part: &&str| {
        let rest = names.iter().fold((*part).to_owned(), |rest, name| rest.replace(name, ""));
        let is_own = ["our own", "this project's"].iter().any(|own| part.contains(own));
        let is_unknown = |word: &str| year(word).is_some() || word.len() > 2 && word.chars().all(|letter| letter.is_ascii_uppercase());
        (is_own || rest != *part) && !rest.split(|letter: char| !letter.is_alphanumeric()).any(is_unknown)
    };
    source.split(';').filter(|part| !is_listed(part)).collect()
}

fn year(word: &str) -> Option<&str> {
    let digits = word.trim_matches(|letter: char| !letter.is_alphanumeric());
    (digits.len() == 4 && digits.parse().is_ok_and(|year| (1850..2040).contains(&year))).then_some(digits)
}

/// Every `Author 1234`, `Author and others (1234)` of a text, as the last name and the year.
fn citations(text: &str) -> Vec<[&str; 2]> {
    let words: Vec<&str> = text.split_whitespace().filter(|word| !["//", "///", "//!"].contains(word)).collect();
    let is_link = |word: &&&str| ["and", "others", "et", "al."].contains(&word.trim_end_matches(','));
    let mut found = Vec::new();
    for (index, word) in words.iter().enumerate() {
        let before = words[..index].iter().rev().find(|word| !is_link(word));
        let name = before.and_then(|before| before.trim_matches(|letter: char| !letter.is_alphabetic()).split(['\'', '’']).next());
        let is_name = |name: &&str| name.starts_with(char::is_uppercase) && name.chars().all(|letter| letter.is_alphabetic() || letter == '-');
        found.extend(name.filter(is_name).zip(year(word)).map(|(name, year)| [name, year]));
    }
    found
}

/// Files below a folder of the project, with what they hold.
fn files_below(folder: &Path) -> Vec<(PathBuf, String)> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries
        .flat_map(|path| match path.is_dir() {
            true => files_below(&path),
            false => fs::read_to_string(&path).map(|text| (path, text)).into_iter().collect(),
        })
        .collect()
}

#[test]
fn sources_of_passes_pipelines_and_studies_are_listed() {
    let names: Vec<String> = sources().into_iter().flat_map(|source| source.names).collect();
    let of_passes = REGISTRY.iter().map(|pass| (pass.description().name.to_owned(), pass.description().source.to_owned()));
    let files = ["pipelines", "studies"].iter().flat_map(|folder| files_below(&root().join(folder)));
    let of_files = files.flat_map(|(path, text)| {
        let values = text.split("source: \"").skip(1).filter_map(|rest| rest.split('"').next());
        values.map(|value| (path.display().to_string(), value.to_owned())).collect::<Vec<_>>()
    });
    let all: Vec<(String, String)> = of_passes.chain(of_files).collect();
    assert!(all.len() > REGISTRY.len() + 5, "{}", all.len());
    for (of, source) in all {
        let wrong = unlisted(&source, &names);
        assert!(wrong.is_empty(), "docs/sources.md does not list what {of} cites: {wrong:?}");
    }
}

#[test]
fn sources_that_files_cite_are_listed() {
    let sources = sources();
    let folders = ["docs", "passes", "pipelines", "scenes", "shaders", "src", "studies"];
    let files = folders.iter().flat_map(|folder| files_below(&root().join(folder)));
    let mut seen = 0;
    for (path, text) in files.filter(|(path, _)| !path.ends_with("docs/sources.md")) {
        for [author, year] in citations(&text) {
            let is_listed = sources.iter().any(|source| source.text.contains(author) && source.text.contains(year));
            assert!(is_listed, "docs/sources.md does not list `{author} {year}` of {} (write a number with a comma: 1,900)", path.display());
            seen += 1;
        }
    }
    assert!(seen > 50, "{seen}");
}

#[test]
fn a_source_that_is_not_listed_is_found() {
    let names = ["RCS", "Heitz 2018", "Ward and Heckbert 1992"].map(String::from);
    for good in ["RCS section 4, step 5", "facets: Heitz 2018; RCS 1", "strata: Ward and Heckbert 1992", "the order of records: our own"] {
        assert_eq!(unlisted(good, &names), [""; 0], "{good}");
    }
    for bad in ["PHOTON section 4", "RCS 4 and Heitz 2014", "textbooks", ""] {
        assert_eq!(unlisted(bad, &names), [bad]);
    }
    assert_eq!(unlisted("RCS 4; textbooks", &names), [" textbooks"]);
    let text = "(Heitz 2018), after Mara and\n/// McGuire 2013; Ward et al. 1988, Newell's (1975), from 1900 on, 2048 texels, Gautron and others, 2005";
    assert_eq!(citations(text), [["Heitz", "2018"], ["McGuire", "2013"], ["Ward", "1988"], ["Newell", "1975"], ["Gautron", "2005"]]);
}

#[test]
fn the_citation_and_the_changelog_have_the_version_of_the_package() {
    let version = env!("CARGO_PKG_VERSION");
    let [citation, changelog] = ["CITATION.cff", "CHANGELOG.md"].map(|path| fs::read_to_string(root().join(path)).unwrap());
    assert!(citation.lines().any(|line| line == format!("version: {version}")));
    assert!(changelog.contains(&format!("\n## {version}")));
}

#[test]
fn lines_are_split_as_by_a_shell() {
    assert_eq!(words("a  'b c=1' d   # e"), ["a", "b c=1", "d"]);
    assert_eq!(words("a b > c # d"), ["a", "b"]);
}
