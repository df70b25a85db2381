//! The pipelines that ship, inside the program.

/// File name and text, the default of each method first, its variants after it.
pub static EMBEDDED: &[(&str, &str)] = &[("irradiance.ron", include_str!("../../pipelines/irradiance.ron"))];

/// Finds a pipeline by "pipelines/irradiance.ron", "irradiance.ron" or "irradiance".
pub fn find(name: &str) -> Option<(&'static str, &'static str)> {
    let name = name.strip_prefix("pipelines/").unwrap_or(name);
    let name = name.strip_suffix(".ron").unwrap_or(name);
    EMBEDDED.iter().copied().find(|(file, _)| file.strip_suffix(".ron") == Some(name))
}
