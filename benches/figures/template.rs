//! Text with places for what was measured.
//!
//! A template is the text of a page's figures. Its first line, `@data NAME, NAME`, says what it quotes. In it stand
//! - `{NAME/KEY/KEY=VALUE : FORMAT}`: a number or word of the measurement NAME. `KEY=VALUE` is the one entry of a list whose KEY has that value, more than
//!   one with `&` between them, `KEY>KEY` within it, `KEY<=N` the greatest up to N. `PATH over PATH` is a ratio, `PATH plus PATH` a
//!   sum; more of them are taken from left to right;
//! - formats: `.2` digits after the point, `g3` digits in all, `%1` a share in per cent, `+%1` with its sign, `p1` per cent without the word, `*1000 .1` a
//!   factor first, `~` with the interval, or the least and the most of several runs, `or TEXT` in place of what is not there. What is below the
//!   reference's noise is told as `< most`;
//! - `$NAME[a ; b]`: what `@let NAME TEXT` says, with a and b for `$1` and `$2`;
//! - `@each a => b ; c => d : LINE`: the line for each of these, with a and b for `$1` and `$2`; `@each in PATH : LINE` with each entry of a list as `item`;
//! - `@commands NAME`: the commands that measured it;
//! - `@prose`: the text is no table, so that date and machine stand elsewhere.

use crate::{
    Failure,
    data::{Kept, Kind, Lists},
};
use serde_json::Value;
use std::{collections::BTreeMap, path::Path};

/// Keys that hold times: measurements that do not tell times have none.
pub const TIMES: [&str; 9] = ["seconds", "seconds_of_runs", "start_up", "passes", "pairs", "gpu_ms", "cpu_ms", "ms_per_record", "microseconds"];

/// How the remark begins that names the changes which figures do not know.
const BEFORE: &str = "*Measured before: ";

/// What is put in.
struct Renderer<'l> {
    lists: &'l Lists,
    used: BTreeMap<String, Kept>,
    macros: BTreeMap<String, String>,
    is_prose: bool,
}

/// The text of a template with everything put in, and below it what it is of. While a measurement is not kept yet, `before` stands for the text: what the
/// page has of an older one.
pub fn render(root: &Path, lists: &Lists, template: &str, before: &str) -> Result<String, Failure> {
    let (first, template) = template.split_once('\n').unwrap_or((template, ""));
    let names = first.strip_prefix("@data ").ok_or("the first line is not `@data` with what the template quotes")?;
    let mut used = BTreeMap::new();
    for name in names.split(", ") {
        match lists.kept(root, name)? {
            Some(kept) => used.insert(name.to_owned(), kept),
            None => return as_before(name, &lists.all_that_alter(lists.measurement(name)?), before),
        };
    }
    let mut renderer = Renderer { lists, used, macros: BTreeMap::new(), is_prose: false };
    let mut lines = Vec::new();
    for line in template.lines() {
        lines.extend(renderer.line(line).map_err(|error| format!("{line}\n{error}"))?);
    }
    while lines.last().is_some_and(|line| line.is_empty()) {
        lines.pop();
    }
    if let Some(origin) = renderer.origin()? {
        lines.extend([String::new(), origin]);
    }
    Ok(lines.join("\n") + "\n")
}

/// An older text with the changes that it does not know.
fn as_before(name: &str, changes: &[&str], text: &str) -> Result<String, Failure> {
    let text = text.lines().take_while(|line| !line.starts_with(BEFORE)).collect::<Vec<_>>().join("\n");
    if text.trim().is_empty() {
        return Err(format!("nothing is kept of `{name}`: `./bench docs --measure {name}` measures it").into());
    }
    let changes: String = changes.iter().map(|change| format!("; {change}")).collect();
    Ok(format!("{}\n\n{BEFORE}figures were kept{changes}.*\n", text.trim_end()))
}

impl Renderer<'_> {
    fn line(&mut self, line: &str) -> Result<Vec<String>, Failure> {
        let Some(directive) = line.strip_prefix('@') else { return Ok(vec![self.put_in(&self.expand(line)?, None)?]) };
        let (name, rest) = directive.split_once(' ').unwrap_or((directive, ""));
        match name {
            "let" => {
                let (name, text) = rest.split_once(' ').ok_or("`@let` takes a name and a text")?;
                self.macros.insert(name.to_owned(), text.to_owned());
                Ok(Vec::new())
            }
            "each" => self.each(rest),
            "commands" => {
                let commands = self.kept(rest)?.commands().to_vec();
                Ok([vec!["```".to_owned()], commands, vec!["```".to_owned()]].concat())
            }
            "prose" => {
                self.is_prose = true;
                Ok(Vec::new())
            }
            _ => Err(format!("there is no `@{name}`").into()),
        }
    }

    fn each(&self, rest: &str) -> Result<Vec<String>, Failure> {
        let (items, line) = rest.split_once(" : ").ok_or("`@each` takes entries, ` : ` and a line")?;
        if let Some(path) = items.strip_prefix("in ") {
            let list = self.at(&self.expand(path)?, None)?;
            let list = list.as_array().ok_or_else(|| format!("`{path}` is no list"))?;
            return list.iter().map(|item| self.put_in(&self.expand(line)?, Some(item))).collect();
        }
        let lines = items.split(" ; ").map(|item| with_arguments(line, item.split(" => ")));
        lines.map(|line| self.put_in(&self.expand(&line)?, None)).collect()
    }

    /// Replaces `$NAME[…]` until there is none.
    fn expand(&self, line: &str) -> Result<String, Failure> {
        let mut line = line.to_owned();
        for _ in 0..100 {
            let Some((start, name, arguments, end)) = first_call(&line) else { return Ok(line) };
            let text = self.macros.get(name).ok_or_else(|| format!("there is no `@let {name}`"))?;
            let text = with_arguments(text, arguments.split(" ; "));
            line.replace_range(start..end, &text);
        }
        Err("a `@let` uses itself".into())
    }

    /// Replaces every `{…}`.
    fn put_in(&self, line: &str, item: Option<&Value>) -> Result<String, Failure> {
        let mut parts = line.split('{');
        let mut text = parts.next().unwrap_or_default().to_owned();
        for part in parts {
            let (place, after) = part.split_once('}').ok_or("a `{` is not closed")?;
            text += &self.told(place, item).map_err(|error| format!("{{{place}}}: {error}"))?;
            text += after;
        }
        Ok(text)
    }

    fn told(&self, place: &str, item: Option<&Value>) -> Result<String, Failure> {
        let (path, format) = place.split_once(" : ").unwrap_or((place, ""));
        let format = Format::read(format)?;
        if [" over ", " plus "].iter().any(|word| path.contains(word)) {
            return Ok(format.number(self.sum(path, item, &format)?));
        }
        let found = match (self.at(path, item), &format.otherwise) {
            (Err(_), Some(_)) => Value::Null,
            (found, _) => found?,
        };
        match found {
            Value::Number(number) => {
                let number = number.as_f64().ok_or("no number")?;
                let interval = self.interval(path, item)?;
                Ok(format.with_interval(number, interval.as_ref()))
            }
            Value::String(text) => Ok(text),
            Value::Bool(is) => Ok(if is { "yes" } else { "" }.to_owned()),
            Value::Null => format.otherwise.ok_or_else(|| "null, and no `or` says what to tell then".into()),
            Value::Array(words) => Ok(words.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(", ")),
            Value::Object(runs) => format.of_runs(&Value::Object(runs)),
        }
    }

    /// Sums and ratios, from left to right; what is not there counts as the number after `or`.
    fn sum(&self, path: &str, item: Option<&Value>, format: &Format) -> Result<f64, Failure> {
        let number = |path: &str| -> Result<f64, Failure> {
            let otherwise = || format.otherwise.as_ref().and_then(|text| text.parse().ok());
            let found = self.at(path, item).ok().and_then(|value| value.as_f64());
            found.or_else(otherwise).ok_or_else(|| format!("`{path}` is no number").into())
        };
        let words: Vec<&str> = path.split(' ').collect();
        let operators: Vec<usize> = (0..words.len()).filter(|index| ["over", "plus"].contains(&words[*index])).collect();
        let operand = |index: usize| {
            let start = index.checked_sub(1).map_or(0, |before| operators[before] + 1);
            words[start..operators.get(index).copied().unwrap_or(words.len())].join(" ")
        };
        operators.iter().enumerate().try_fold(number(&operand(0))?, |sum, (index, operator)| {
            let next = number(&operand(index + 1))?;
            Ok(if words[*operator] == "over" { sum / next } else { sum + next })
        })
    }

    /// What stands in `intervals` beside a metric.
    fn interval(&self, path: &str, item: Option<&Value>) -> Result<Option<Value>, Failure> {
        let Some((beside, metric)) = path.rsplit_once('/') else { return Ok(None) };
        let beside = self.at(beside, item)?;
        Ok(beside.get("intervals").and_then(|intervals| intervals.get(metric)).filter(|interval| !interval.is_null()).cloned())
    }

    fn at(&self, path: &str, item: Option<&Value>) -> Result<Value, Failure> {
        let mut steps = path.split('/');
        let name = steps.next().unwrap_or_default();
        let mut value = match item.filter(|_| name == "item") {
            Some(item) => item.clone(),
            None => self.kept(name)?.json.clone(),
        };
        for step in steps {
            if TIMES.contains(&step) && !self.tells_times() {
                return Err(format!("`{step}` is a time, and this measurement does not tell times").into());
            }
            value = step_into(&value, step)?;
        }
        Ok(value)
    }

    fn tells_times(&self) -> bool {
        self.used.values().all(|kept| kept.measurement.tells.contains(&Kind::Times))
    }

    fn kept(&self, name: &str) -> Result<&Kept, Failure> {
        self.used.get(name).ok_or_else(|| format!("`@data` does not name `{name}`").into())
    }

    /// Date, commit, machine, and the changes since, of all that was put in.
    fn origin(&self) -> Result<Option<String>, Failure> {
        let sets = |told: &dyn Fn(&Kept) -> Result<Option<String>, Failure>| -> Result<Vec<String>, Failure> {
            let mut all: Vec<String> = self.used.values().map(told).collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
            all.sort();
            all.dedup();
            Ok(all)
        };
        let dates = sets(&|kept| kept.date().map(|date| Some(date.to_owned())))?;
        let commits = sets(&|kept| kept.commit().map(Some))?;
        let machines = sets(&|kept| Ok(kept.machine()))?;
        if machines.len() > 1 {
            return Err(format!("figures of several machines in one table: {}", machines.join("; ")).into());
        }
        let machine = machines.first().map(|machine| format!("; {machine}")).unwrap_or_default();
        let commits = format!("{} {}", if commits.len() == 1 { "commit" } else { "commits" }, commits.join(", "));
        let measured = (!self.is_prose && !dates.is_empty()).then(|| format!("Measured {}, {commits}{machine}.", dates.join(", ")));
        let unknown: Vec<&str> = self.used.values().flat_map(|kept| self.lists.since(kept)).collect();
        let changes: Vec<&str> = self.lists.changes.iter().map(|change| change.change.as_str()).filter(|change| unknown.contains(change)).collect();
        let before = (!changes.is_empty()).then(|| format!("{BEFORE}{}.*", changes.join("; ")));
        let parts: Vec<String> = measured.into_iter().chain(before).collect();
        Ok((!parts.is_empty()).then(|| parts.join(" ")))
    }
}

fn with_arguments<'a>(text: &str, arguments: impl Iterator<Item = &'a str>) -> String {
    arguments.enumerate().fold(text.to_owned(), |text, (index, argument)| text.replace(&format!("${}", index + 1), argument.trim()))
}

/// Start, name, arguments and end of the first `$NAME[…]` that has no other within it.
fn first_call(line: &str) -> Option<(usize, &str, &str, usize)> {
    let starts: Vec<usize> = line.match_indices('$').map(|(start, _)| start).collect();
    starts.into_iter().rev().find_map(|start| {
        let open = start + line[start..].find('[')?;
        let name = &line[start + 1..open];
        let is_name = !name.is_empty() && name.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_');
        let close = open + line[open..].find(']')?;
        is_name.then(|| (start, name, &line[open + 1..close], close + 1))
    })
}

fn step_into(value: &Value, step: &str) -> Result<Value, Failure> {
    let found = match value {
        Value::Object(object) => object.get(step).cloned(),
        Value::Array(list) if step.contains('=') => return one_of(list, step),
        Value::Array(list) => step.parse::<usize>().ok().and_then(|index| list.get(index).cloned()),
        _ => None,
    };
    found.ok_or_else(|| format!("there is no `{step}`").into())
}

/// The one entry that every `KEY=VALUE` fits; with `KEY<=N` that of the greatest number up to N.
fn one_of(list: &[Value], step: &str) -> Result<Value, Failure> {
    let mut fitting: Vec<&Value> = list.iter().filter(|entry| step.split('&').all(|condition| fits(entry, condition))).collect();
    if let Some((key, _)) = step.split('&').find_map(|condition| condition.split_once("<=")) {
        let number = |entry: &&Value| at_key(entry, key).and_then(Value::as_f64).unwrap_or(f64::NEG_INFINITY);
        let greatest = fitting.iter().map(number).fold(f64::NEG_INFINITY, f64::max);
        fitting.retain(|entry| number(entry) == greatest);
    }
    match fitting[..] {
        [entry] => Ok(entry.clone()),
        [] => Err(format!("no entry fits `{step}`").into()),
        _ => Err(format!("more than one entry fits `{step}`").into()),
    }
}

fn at_key<'v>(entry: &'v Value, key: &str) -> Option<&'v Value> {
    key.split('>').try_fold(entry, |entry, key| entry.get(key))
}

fn fits(entry: &Value, condition: &str) -> bool {
    if let Some((key, most)) = condition.split_once("<=") {
        return at_key(entry, key).and_then(Value::as_f64).zip(most.parse().ok()).is_some_and(|(found, most)| found <= most);
    }
    let Some((key, wanted)) = condition.split_once('=') else { return false };
    at_key(entry, key).is_some_and(|found| found.as_str().map_or_else(|| found.to_string(), str::to_owned) == wanted)
}

/// How a number is written.
#[derive(Debug, Clone)]
struct Format {
    digits: Digits,
    factor: f64,
    is_signed: bool,
    unit: &'static str,
    has_interval: bool,
    otherwise: Option<String>,
}

#[derive(Debug, Clone, Copy)]
enum Digits {
    AfterThePoint(usize),
    InAll(i32),
    /// As short as the number allows.
    Shortest,
}

impl Format {
    fn read(text: &str) -> Result<Self, Failure> {
        let mut format = Self { digits: Digits::Shortest, factor: 1.0, is_signed: false, unit: "", has_interval: false, otherwise: None };
        let (text, otherwise) = text.split_once("or ").map_or((text, None), |(text, otherwise)| (text, Some(otherwise.trim().to_owned())));
        format.otherwise = otherwise;
        for word in text.split_whitespace() {
            let word = word.strip_prefix('+').inspect(|_| format.is_signed = true).unwrap_or(word);
            let (kind, rest) = word.split_at(1);
            let count = || rest.parse::<u8>().map_err(|_| format!("`{word}` is no format"));
            match kind {
                "~" => format.has_interval = true,
                "*" => format.factor *= rest.parse::<f64>().map_err(|_| format!("`{word}` is no factor"))?,
                "." => format.digits = Digits::AfterThePoint(count()?.into()),
                "g" => format.digits = Digits::InAll(count()?.into()),
                "%" | "p" => {
                    format.digits = Digits::AfterThePoint(count()?.into());
                    format.factor *= 100.0;
                    format.unit = if kind == "%" { " %" } else { "" };
                }
                _ => return Err(format!("`{word}` is no format").into()),
            }
        }
        Ok(format)
    }

    fn number(&self, number: f64) -> String {
        self.bare(number) + self.unit
    }

    fn bare(&self, number: f64) -> String {
        let number = number * self.factor;
        let digits = match self.digits {
            Digits::AfterThePoint(digits) => Some(digits),
            Digits::InAll(digits) if number != 0.0 => Some((digits - 1 - number.abs().log10().floor() as i32).max(0) as usize),
            _ => None,
        };
        let text = digits.map_or_else(|| number.abs().to_string(), |digits| format!("{:.digits$}", number.abs()));
        let is_zero = text.chars().all(|letter| ['0', '.'].contains(&letter));
        let sign = match number < 0.0 && !is_zero {
            true => "−",
            false if self.is_signed && !is_zero => "+",
            false => "",
        };
        sign.to_owned() + &grouped(&text)
    }

    fn with_interval(&self, number: f64, interval: Option<&Value>) -> String {
        let bound = |key: &str| interval.and_then(|interval| interval.get(key)?.as_f64());
        let is_hidden = interval.is_some_and(|interval| interval.get("below_noise").and_then(Value::as_bool) == Some(true));
        match (bound("low"), bound("high")) {
            (Some(low), Some(high)) if is_hidden => format!("< {}", Self { is_signed: false, ..self.clone() }.number(low.abs().max(high.abs()))),
            (Some(low), Some(high)) if self.has_interval => format!("{} ({} … {})", self.number(number), self.bare(low), self.bare(high)),
            _ => self.number(number),
        }
    }
}

impl Format {
    /// The median of runs, with the least and the most of several.
    fn of_runs(&self, runs: &Value) -> Result<String, Failure> {
        let number = |key: &str| runs.get(key).and_then(Value::as_f64).ok_or_else(|| format!("an object without `{key}` cannot be told"));
        let (median, least, most) = (number("median")?, number("least")?, number("most")?);
        let told = self.number(median);
        Ok(if self.has_interval && least < most { format!("{told} ({} … {})", self.bare(least), self.bare(most)) } else { told })
    }
}

/// With a comma between thousands.
fn grouped(text: &str) -> String {
    let (whole, rest) = text.split_at(text.find('.').unwrap_or(text.len()));
    let groups = whole.as_bytes().rchunks(3).rev().map(|group| String::from_utf8_lossy(group)).collect::<Vec<_>>();
    groups.join(",") + rest
}
