//! The studies that ship, inside the program.

/// File name and text.
pub static EMBEDDED: &[(&str, &str)] = &[
    ("compensation.ron", include_str!("../../../studies/compensation.ron")),
    ("harmonics.ron", include_str!("../../../studies/harmonics.ron")),
    ("means.ron", include_str!("../../../studies/means.ron")),
    ("summation.ron", include_str!("../../../studies/summation.ron")),
    ("weights.ron", include_str!("../../../studies/weights.ron")),
];

/// Finds a study by "studies/compensation.ron", "compensation.ron" or "compensation".
pub fn find(name: &str) -> Option<(&'static str, &'static str)> {
    let name = name.strip_prefix("studies/").unwrap_or(name);
    let name = name.strip_suffix(".ron").unwrap_or(name);
    EMBEDDED.iter().copied().find(|(file, _)| file.strip_suffix(".ron") == Some(name))
}
