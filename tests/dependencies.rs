//! What the program is built from: licences that allow what its own allow, and one graphics library.

use serde_json::Value;
use std::process::Command;

/// As in deny.toml.
const ALLOWED: [&str; 12] = [
    "MIT",
    "MIT-0",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0",
    "ISC",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
];

/// The packages that are built on this machine's platform, from what is already here.
fn packages() -> Vec<Value> {
    let host = run(Command::new("rustc").arg("-vV"));
    let host = host.lines().find_map(|line| line.strip_prefix("host: ")).unwrap().to_owned();
    let metadata = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--offline", "--filter-platform", &host])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output();
    let metadata: Value = serde_json::from_slice(&metadata.unwrap().stdout).unwrap();
    metadata["packages"].as_array().unwrap().clone()
}

fn run(command: &mut Command) -> String {
    String::from_utf8(command.output().unwrap().stdout).unwrap()
}

/// Whether an SPDX expression can be met with allowed licences alone.
fn is_allowed(expression: &str) -> bool {
    let expression = expression.trim();
    let any = split(&expression.replace('/', " OR "), " OR ");
    if any.len() > 1 {
        return any.iter().any(|part| is_allowed(part));
    }
    let all = split(expression, " AND ");
    if all.len() > 1 {
        return all.iter().all(|part| is_allowed(part));
    }
    match expression.strip_prefix('(').and_then(|inner| inner.strip_suffix(')')) {
        Some(inner) => is_allowed(inner),
        None => ALLOWED.contains(&expression),
    }
}

/// Splits at an operator outside of parentheses.
fn split(expression: &str, operator: &str) -> Vec<String> {
    let mut parts = vec![String::new()];
    for part in expression.split(operator) {
        let open = |text: &str| text.matches('(').count() > text.matches(')').count();
        match parts.last_mut() {
            Some(last) if open(last) => last.push_str(&format!("{operator}{part}")),
            Some(last) if last.is_empty() => last.push_str(part),
            _ => parts.push(part.to_owned()),
        }
    }
    parts
}

#[test]
fn every_licence_is_allowed() {
    let text = |package: &Value, key: &str| package[key].as_str().unwrap_or_default().to_owned();
    let refused: Vec<String> = packages()
        .iter()
        .filter(|package| !is_allowed(&text(package, "license")))
        .map(|package| format!("{} {}: `{}`", text(package, "name"), text(package, "version"), text(package, "license")))
        .collect();
    assert!(refused.is_empty(), "{}", refused.join("\n"));
}

#[test]
fn there_is_one_wgpu() {
    let lock = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.lock")).unwrap();
    for name in ["wgpu", "naga", "glam"] {
        assert_eq!(lock.matches(&format!("name = \"{name}\"\n")).count(), 1, "{name}");
    }
}

#[test]
fn every_dependency_is_a_released_version() {
    let own = |package: &&Value| package["name"] == "hemisplat" || package["name"] == "hemisplat-page";
    let packages = packages();
    assert_eq!(packages.iter().filter(own).count(), 2);
    let other: Vec<String> = packages
        .iter()
        .filter(|package| !own(package) && !package["source"].as_str().unwrap_or_default().starts_with("registry+"))
        .map(|package| package["id"].to_string())
        .collect();
    assert!(other.is_empty(), "{other:?}");
}

#[test]
fn cargo_deny_has_the_same_list() {
    let deny = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/deny.toml")).unwrap();
    let list = deny.split_once("allow = [").and_then(|(_, rest)| rest.split_once(']')).unwrap().0;
    let listed: Vec<&str> = list.split('"').skip(1).step_by(2).collect();
    assert_eq!(listed, ALLOWED);
}

#[test]
fn expressions_are_read_as_spdx_means_them() {
    for good in
        ["MIT", "GPL-3.0 OR MIT", "MIT/Apache-2.0", "(MIT OR GPL-2.0) AND Unicode-3.0", "Apache-2.0 WITH LLVM-exception OR MIT", "Zlib OR (GPL-3.0 AND MIT)"]
    {
        assert!(is_allowed(good), "{good}");
    }
    for bad in ["", "GPL-3.0", "MIT AND GPL-3.0", "(MIT OR GPL-2.0) AND GPL-3.0", "LGPL-2.1 OR (GPL-3.0 AND MIT)"] {
        assert!(!is_allowed(bad), "{bad}");
    }
}
