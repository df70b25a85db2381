//! The pipelines that ship, inside the program.

/// File name and text, a method before its variants.
pub static EMBEDDED: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/pipelines.rs"));

/// Names that pipelines had before, and what stands in their place.
static REPLACED: &[(&str, &str)] = &[("irradiance-two-rates", "irradiance")];

/// Finds a pipeline by "pipelines/irradiance.ron", "irradiance.ron" or "irradiance", also by a name that it had before.
pub fn find(name: &str) -> Option<(&'static str, &'static str)> {
    let stem = replaced(name).unwrap_or(stem(name));
    EMBEDDED.iter().copied().find(|(file, _)| file.strip_suffix(".ron") == Some(stem))
}

/// The pipeline that stands in the place of one of this name, if there is none of it any more.
pub fn replaced(name: &str) -> Option<&'static str> {
    REPLACED.iter().find(|(old, _)| *old == stem(name)).map(|(_, new)| *new)
}

fn stem(name: &str) -> &str {
    let name = name.strip_prefix("pipelines/").unwrap_or(name);
    name.strip_suffix(".ron").unwrap_or(name)
}
