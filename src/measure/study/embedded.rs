//! The studies that ship, inside the program.

/// File name and text.
pub static EMBEDDED: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/studies.rs"));

/// Finds a study by "studies/compensation.ron", "compensation.ron" or "compensation".
pub fn find(name: &str) -> Option<(&'static str, &'static str)> {
    let name = name.strip_prefix("studies/").unwrap_or(name);
    let name = name.strip_suffix(".ron").unwrap_or(name);
    EMBEDDED.iter().copied().find(|(file, _)| file.strip_suffix(".ron") == Some(name))
}
