//! Every table of figures in README and the book is what is kept of its measurement, and says which changes of the program it does not know.

// Only parts of the program's modules are tested.
#![allow(dead_code)]

type Failure = Box<dyn std::error::Error>;

#[path = "../benches/figures/data.rs"]
mod data;
#[path = "../benches/figures/pages.rs"]
mod pages;
#[path = "../benches/figures/template.rs"]
mod template;

use data::{Kind, Lists};
use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn texts() -> Vec<(PathBuf, String)> {
    pages::pages(root()).unwrap().into_iter().map(|page| (page.clone(), fs::read_to_string(root().join(page)).unwrap())).collect()
}

#[test]
fn pages_have_the_figures_that_are_kept() {
    let lists = Lists::read(root()).unwrap();
    let mut used = BTreeSet::new();
    for (page, text) in texts() {
        let renewed = pages::renewed(root(), &lists, &text, &mut used).unwrap_or_else(|error| panic!("{}: {error}", page.display()));
        let differing = text.lines().zip(renewed.lines()).find(|(had, has)| had != has);
        assert!(text == renewed, "{}: run `./bench docs`; the first line that differs has and should have\n{differing:#?}", page.display());
    }
    let templates = fs::read_dir(root().join(pages::TEMPLATES)).unwrap().map(|entry| entry.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned());
    let templates: BTreeSet<String> = templates.collect();
    assert_eq!(used, templates, "templates that no page uses");
    assert!(used.len() > 20, "{used:?}");
}

/// The heads of tables that stand outside of the marks and hold figures: a cell with a point between digits or a unit after them.
fn tables_by_hand(text: &str) -> Vec<String> {
    let outside: String = text
        .split(pages::START)
        .enumerate()
        .map(|(index, part)| if index == 0 { part } else { part.split_once(pages::END).map_or("", |(_, after)| after) })
        .collect();
    let lines: Vec<&str> = outside.split("```").step_by(2).flat_map(str::lines).collect();
    let mut heads = Vec::new();
    for index in (0..lines.len()).filter(|index| is_rule(lines[*index])) {
        let rows = lines[index + 1..].iter().take_while(|line| line.starts_with('|'));
        let (cells, figures) = rows
            .flat_map(|row| row.split('|'))
            .fold((0, 0), |(cells, figures), cell| (cells + usize::from(!cell.trim().is_empty()), figures + usize::from(is_figure(cell))));
        if figures * 3 > cells {
            heads.push(lines[index.max(1) - 1].to_owned());
        }
    }
    heads
}

fn is_rule(line: &str) -> bool {
    line.starts_with('|') && line.contains("---") && line.chars().all(|letter| "|-: ".contains(letter))
}

/// Whether a cell is a number, perhaps with a unit or an interval.
fn is_figure(cell: &str) -> bool {
    let cell = cell.trim().trim_matches('*');
    cell.starts_with(|letter: char| letter.is_ascii_digit() || "+−-<".contains(letter)) && cell.chars().any(|letter| letter.is_ascii_digit())
}

#[test]
fn tables_of_figures_come_from_data() {
    let by_hand: Vec<(String, String, String)> = data::read_list(root(), "benches/figures/by_hand.ron").unwrap();
    let found: BTreeSet<(String, String)> =
        texts().iter().flat_map(|(page, text)| tables_by_hand(text).into_iter().map(|head| (page.display().to_string(), head))).collect();
    let listed: BTreeSet<(String, String)> = by_hand.into_iter().map(|(page, head, _)| (page, head)).collect();
    let (new, gone) = (found.difference(&listed).collect::<Vec<_>>(), listed.difference(&found).collect::<Vec<_>>());
    assert!(new.is_empty(), "tables of figures without data, which belong between `<!-- figures: NAME -->` and its end: {new:#?}");
    assert!(gone.is_empty(), "benches/figures/by_hand.ron lists tables that are not there: {gone:#?}");
}

#[test]
fn what_is_kept_tells_its_program_and_machine() {
    let lists = Lists::read(root()).unwrap();
    let names: BTreeSet<&str> = lists.measurements.iter().map(|measurement| measurement.name.as_str()).collect();
    assert_eq!(names.len(), lists.measurements.len(), "two measurements of one name");
    for measurement in &lists.measurements {
        for path in &measurement.measures {
            assert!(root().join(path).exists(), "{} measures {path}, which is not there", measurement.name);
        }
        let Some(kept) = lists.kept(root(), &measurement.name).unwrap() else { continue };
        assert_eq!(kept.date().unwrap().len(), 10);
        let commit = kept.commit().unwrap();
        // Those of before figures were kept in this way.
        let is_old = kept.date().unwrap() <= "2026-11-23";
        assert!(is_old || !commit.ends_with("-dirty"), "{}: figures of no commit: {commit}", measurement.name);
        assert!(is_old || kept.json.get("changes").is_some(), "{} does not tell which changes it knows", measurement.name);
        for change in kept.changes() {
            assert!(
                lists.changes.iter().any(|listed| listed.change == change),
                "{} knows a change that {} does not list: {change}",
                measurement.name,
                data::CHANGES
            );
        }
        if matches!(measurement.keeps, data::Keeps::Files(_)) {
            assert_eq!(kept.json["commands"], serde_json::json!(measurement.commands), "{}: measured by other commands", measurement.name);
            assert_eq!(kept.json["measures"], serde_json::json!(measurement.measures), "{}", measurement.name);
        }
    }
}

#[test]
fn changes_name_what_is_there() {
    let lists = Lists::read(root()).unwrap();
    let names: BTreeSet<&str> = lists.changes.iter().map(|change| change.change.as_str()).collect();
    assert_eq!(names.len(), lists.changes.len(), "two changes of one name");
    for change in &lists.changes {
        assert_eq!(change.alters.is_empty(), change.touches.is_empty(), "{}", change.change);
        assert!(!change.alters.is_empty() || !change.renames.is_empty() || !change.respells.is_empty(), "{} does nothing", change.change);
        for path in &change.touches {
            assert!(root().join(path).exists(), "`{}` touches {path}, which is not there", change.change);
        }
    }
}

/// A project of its own with one measurement and one change, which `knows` says whether the measurement knows.
struct Project {
    folder: tempfile::TempDir,
}

const CHANGE: &str = "rays are bent";

impl Project {
    fn new(measures: &str, tells: &str, kept: Option<&str>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let write = |path: &str, text: String| {
            let path = folder.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        let list = format!(r#"[(name: "light", tells: [{tells}], measures: ["{measures}"], commands: ["hemisplat adapters"], keeps: Files({{}}))]"#);
        write(data::MEASUREMENTS, list);
        let names = r#"{ "one": "two", "two": "three" }"#;
        write(data::CHANGES, format!(r#"[(change: "{CHANGE}", touches: ["src/rays"], alters: [Times], renames: {names})]"#));
        if let Some(kept) = kept {
            write("benches/results/light.json", kept.to_owned());
        }
        Self { folder }
    }

    fn render(&self, template: &str) -> Result<String, Failure> {
        let lists = Lists::read(self.folder.path())?;
        template::render(self.folder.path(), &lists, &format!("@data light\n{template}"), "| as it was |\n")
    }
}

fn kept(changes: &str) -> String {
    let rmse = r#""rmse": { "low": 0.027, "high": 0.031, "below_noise": false }"#;
    let hidden = r#""hidden": { "low": 0.0, "high": 0.004, "below_noise": true }"#;
    let errors = format!(r#"{{ "rmse": 0.0286, "bias": -0.00004, "hidden": 0.001, "intervals": {{ {rmse}, {hidden} }} }}"#);
    let points = r#"[{ "row": "a, b", "set": { "x.y": "1" }, "n": 12345.6 }, { "row": "a, b", "set": { "x.y": "2" }, "n": 0.5, "none": null }]"#;
    format!(
        r#"{{ "date": "2026-11-24", "commit": "0123456789abcdef", "machine": {{ "cores": 2, "cpu": "one", "adapter": "A (software, vulkan, llvm Mesa 1 (B))" }},
        "changes": [{changes}], "errors": {errors}, "points": {points}, "seconds": {{ "median": 2.0, "least": 1.5, "most": 4.0 }} }}"#
    )
}

const ORIGIN: &str = "\n\nMeasured 2026-11-24, commit 01234567; 2 cores (one), llvm Mesa 1.";

#[test]
fn figures_older_than_a_change_say_so() {
    let of = |measures: &str, tells: &str, changes: &str| Project::new(measures, tells, Some(&kept(changes))).render("{light/errors/rmse : %1}").unwrap();
    let old = format!("2.9 %{ORIGIN} *Measured before: {CHANGE}.*\n");
    assert_eq!(of("src", "Times", ""), old);
    assert_eq!(of("src/rays/walk.rs", "Errors, Times", ""), old);
    let new = format!("2.9 %{ORIGIN}\n");
    assert_eq!(of("src", "Times", &format!("{CHANGE:?}")), new, "it knows the change");
    assert_eq!(of("src/raysome", "Times", ""), new, "the change touches something else");
    assert_eq!(of("src", "Errors", ""), new, "the change alters something else");
    let nothing = Project::new("src", "Times", None).render("{light/errors/rmse : %1}").unwrap();
    assert_eq!(nothing, format!("| as it was |\n\n*Measured before: figures were kept; {CHANGE}.*\n"));
}

#[test]
fn figures_older_than_a_name_have_it() {
    let points = r#"[{ "name": "one a=1" }, { "row": "two" }, { "row": "two words" }, { "text": "one" }]"#;
    let named = format!(r#"{{ "date": "2026-11-24", "commit": "0", "changes": [CHANGES], "points": {points} }}"#);
    let of = |changes: &str| {
        let project = Project::new("src", "Errors", Some(&named.replace("CHANGES", changes)));
        project.render("@prose\n{light/points/0/name}; {light/points/1/row}; {light/points/2/row}; {light/points/3/text}").unwrap()
    };
    assert_eq!(of(""), "two a=1; three; three words; one\n");
    assert_eq!(of(&format!("{CHANGE:?}")), "one a=1; two; two words; one\n");
}

#[test]
fn templates_tell_numbers() {
    let project = Project::new("src", "Errors, Times", Some(&kept(&format!("{CHANGE:?}"))));
    let told = |template: &str| project.render(template).unwrap().strip_suffix(&format!("{ORIGIN}\n")).unwrap_or_else(|| panic!("{template}")).to_owned();
    for (template, expected) in [
        ("{light/errors/rmse : %2}, {light/errors/rmse : p1}, {light/errors/rmse : *10 .1}", "2.86 %, 2.9, 0.3"),
        ("{light/errors/rmse : +%1} {light/errors/bias : +%2} {light/errors/bias : +%3}", "+2.9 % 0.00 % −0.004 %"),
        ("{light/errors/rmse : %1 ~}, {light/errors/hidden : %1}", "2.9 % (2.7 … 3.1), < 0.4 %"),
        ("{light/points/0/n : g3} {light/points/0/n : g2} {light/points/0/n : .1}", "12,346 12,346 12,345.6"),
        ("{light/points/row=a, b&set>x.y=2/n}, {light/points/1/none : or –}, {light/points/1/other : .1 or none}", "0.5, –, none"),
        ("{light/points/n<=1/n}, {light/points/row=a, b&n<=20000/n : .0}", "0.5, 12,346"),
        ("{light/points/0/n over light/points/1/n : .0} {light/points/1/n plus light/points/1/n}", "24,691 1"),
        ("{light/points/1/n plus light/points/1/n plus light/none over light/points/1/n : .0 or 0}", "2"),
        ("{light/seconds : .1 ~} {light/seconds : .0}", "2.0 (1.5 … 4.0) 2"),
        ("@let n {light/points/$1/n : $2}\n@each 0 => .1 ; 1 => .0 : | $n[$1 ; $2] |", "| 12,345.6 |\n| 0 |"),
        ("@each in light/points : {item/row}: {item/n : .1}", "a, b: 12,345.6\na, b: 0.5"),
        ("@commands light", "```\nhemisplat adapters\n```"),
    ] {
        assert_eq!(told(template), expected, "{template}");
    }
    assert_eq!(project.render("@prose\n{light/points/1/n}").unwrap(), "0.5\n");
}

#[test]
fn templates_that_cannot_be_told_are_refused() {
    let project = Project::new("src", "Errors", Some(&kept("")));
    for (template, reason) in [
        ("{light/errors/none}", "there is no `none`"),
        ("{light/points/row=a, b/n}", "more than one entry fits"),
        ("{light/points/row=c/n}", "no entry fits"),
        ("{light/points/1/none}", "null"),
        ("{light/seconds/median}", "`seconds` is a time"),
        ("{dark/errors/rmse}", "`@data` does not name `dark`"),
        ("{light/errors/rmse : q2}", "is no format"),
        ("$n[1]", "there is no `@let n`"),
        ("@let n $n[1]\n$n[1]", "uses itself"),
        ("@nothing", "there is no `@nothing`"),
    ] {
        let error = project.render(template).unwrap_err().to_string();
        assert!(error.contains(reason), "{template}: {error}");
    }
    let empty = Project::new("src", "Errors", None);
    let lists = Lists::read(empty.folder.path()).unwrap();
    let before = "\n*Measured before: figures were kept.*\n";
    let error = template::render(empty.folder.path(), &lists, "@data light\n{light/errors/rmse}", before).unwrap_err().to_string();
    assert!(error.contains("nothing is kept of `light`"), "{error}");
    assert!(template::render(project.folder.path(), &lists, "{light/errors/rmse}", "").is_err(), "no `@data`");
    assert!(lists.measurements[0].tells == [Kind::Errors]);
}

#[test]
fn figures_of_two_machines_do_not_share_a_table() {
    let project = Project::new("src", "Errors", Some(&kept("")));
    let list = fs::read_to_string(project.folder.path().join(data::MEASUREMENTS)).unwrap();
    let two = format!("{},{}]", list.trim_end_matches(']'), list.trim_start_matches('[').trim_end_matches(']').replace("\"light\"", "\"shade\""));
    fs::write(project.folder.path().join(data::MEASUREMENTS), two).unwrap();
    fs::write(project.folder.path().join("benches/results/shade.json"), kept("").replace("\"one\"", "\"other\"")).unwrap();
    let lists = Lists::read(project.folder.path()).unwrap();
    let error = template::render(project.folder.path(), &lists, "@data light, shade\n{shade/errors/rmse}", "").unwrap_err().to_string();
    assert!(error.contains("several machines"), "{error}");
}

#[test]
fn tables_by_hand_are_found() {
    let table = "| | error |\n|---|---|\n| a | 2.9 % |\n| b | < 1 % |\n";
    let words = "| key | holds |\n|---|---|\n| `a` | a number up to 10 |\n";
    assert_eq!(tables_by_hand(&format!("text\n\n{words}\n{table}\ntext\n")), ["| | error |"]);
    assert_eq!(tables_by_hand(&format!("text\n<!-- figures: x -->\n{table}<!-- end of figures -->\n{words}")), [""; 0]);
}
