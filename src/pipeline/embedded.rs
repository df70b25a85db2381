//! The pipelines that ship, inside the program.

/// File name and text, the default of each method first, its variants after it.
pub static EMBEDDED: &[(&str, &str)] = &[
    ("irradiance.ron", include_str!("../../pipelines/irradiance.ron")),
    ("irradiance-compute-splat.ron", include_str!("../../pipelines/irradiance-compute-splat.ron")),
    ("irradiance-cosine.ron", include_str!("../../pipelines/irradiance-cosine.ron")),
    ("irradiance-curvature.ron", include_str!("../../pipelines/irradiance-curvature.ron")),
    ("irradiance-device.ron", include_str!("../../pipelines/irradiance-device.ron")),
    ("irradiance-device-rays.ron", include_str!("../../pipelines/irradiance-device-rays.ron")),
    ("irradiance-emitters-in-records.ron", include_str!("../../pipelines/irradiance-emitters-in-records.ron")),
    ("irradiance-general.ron", include_str!("../../pipelines/irradiance-general.ron")),
    ("irradiance-hemicube.ron", include_str!("../../pipelines/irradiance-hemicube.ron")),
    ("irradiance-hemispherical.ron", include_str!("../../pipelines/irradiance-hemispherical.ron")),
    ("irradiance-host-scan.ron", include_str!("../../pipelines/irradiance-host-scan.ron")),
    ("irradiance-host-splat.ron", include_str!("../../pipelines/irradiance-host-splat.ron")),
    ("irradiance-mipmap.ron", include_str!("../../pipelines/irradiance-mipmap.ron")),
    ("irradiance-no-gradients.ron", include_str!("../../pipelines/irradiance-no-gradients.ron")),
    ("irradiance-one-rate.ron", include_str!("../../pipelines/irradiance-one-rate.ron")),
    ("irradiance-ping-pong.ron", include_str!("../../pipelines/irradiance-ping-pong.ron")),
    ("irradiance-plane.ron", include_str!("../../pipelines/irradiance-plane.ron")),
    ("irradiance-plane-coverage.ron", include_str!("../../pipelines/irradiance-plane-coverage.ron")),
    ("irradiance-plane-open.ron", include_str!("../../pipelines/irradiance-plane-open.ron")),
    ("irradiance-readback.ron", include_str!("../../pipelines/irradiance-readback.ron")),
    ("irradiance-sequential.ron", include_str!("../../pipelines/irradiance-sequential.ron")),
    ("irradiance-tabellion.ron", include_str!("../../pipelines/irradiance-tabellion.ron")),
    ("irradiance-ward.ron", include_str!("../../pipelines/irradiance-ward.ron")),
    ("radiance.ron", include_str!("../../pipelines/radiance.ron")),
    ("radiance-blend.ron", include_str!("../../pipelines/radiance-blend.ron")),
    ("radiance-device.ron", include_str!("../../pipelines/radiance-device.ron")),
    ("radiance-half.ron", include_str!("../../pipelines/radiance-half.ron")),
    ("radiance-no-gradients.ron", include_str!("../../pipelines/radiance-no-gradients.ron")),
    ("radiance-readback.ron", include_str!("../../pipelines/radiance-readback.ron")),
    ("radiance-rotated.ron", include_str!("../../pipelines/radiance-rotated.ron")),
    ("radiance-window.ron", include_str!("../../pipelines/radiance-window.ron")),
    ("environment.ron", include_str!("../../pipelines/environment.ron")),
    ("environment-spherical.ron", include_str!("../../pipelines/environment-spherical.ron")),
];

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
