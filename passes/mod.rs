//! The registry: every pass that pipelines may use, one file each.

use crate::contract::Registry;

pub mod add_images;
pub mod add_irradiance;
pub mod add_records;
pub mod age_records;
pub mod average;
pub mod choose_texel;
pub mod classify;
pub mod compensation;
pub mod composite;
pub mod contribution;
pub mod direct_light;
pub mod draw_points;
pub mod due_records;
pub mod environment_light;
pub mod filter_records;
pub mod find_misses;
pub mod gather_near;
pub mod gbuffer;
pub mod hemisphere_tiles;
pub mod image_sum;
pub mod indirect_light;
pub mod irradiance_field;
pub mod irradiance_sum;
pub mod lightmap;
pub mod lightmap_field;
pub mod lit_surfaces;
pub mod lives;
pub mod living_radiance;
pub mod lobe_coefficients;
pub mod lobe_rays;
#[cfg(test)]
mod mock;
pub mod motion;
pub mod normalize;
pub mod path_vertices;
pub mod photon_density;
pub mod photon_map;
pub mod photon_places;
pub mod photon_tiles;
pub mod photons;
pub mod prefix_sum;
pub mod radiance_projection;
pub mod radix_sort;
pub mod record;
pub mod record_cache;
pub mod record_index;
pub mod record_lists;
pub mod renew_records;
pub mod seen_light;
pub mod shadow_map;
pub mod shoot;
pub mod splat;
pub mod surroundings;
pub mod texels;

/// All passes, in the order that `hemisplat passes` lists them.
pub static REGISTRY: &Registry = &[
    &gbuffer::GBuffer,
    &motion::Motion,
    &lobe_coefficients::LobeCoefficients,
    &classify::Classify,
    &shadow_map::ShadowMap,
    &environment_light::EnvironmentLight,
    &direct_light::DirectLight,
    &record_cache::RecordCache,
    &age_records::AgeRecords,
    &due_records::DueRecords,
    &renew_records::RenewRecords,
    &path_vertices::PathVertices,
    &record_index::RecordIndex,
    &photon_map::PhotonMap,
    &photon_places::PhotonPlaces,
    &photon_tiles::PhotonTiles,
    &photon_density::PhotonDensity,
    &lightmap::Lightmap,
    &draw_points::DrawPoints,
    &choose_texel::ChooseTexel,
    &hemisphere_tiles::shooter_view::ShooterView,
    &shoot::Shoot,
    &gather_near::GatherNear,
    &average::Average,
    &lightmap_field::LightmapField,
    &splat::Splat,
    &find_misses::FindMisses,
    &hemisphere_tiles::HemisphereTiles,
    &compensation::Compensation,
    &irradiance_sum::IrradianceSum,
    &add_irradiance::AddIrradiance,
    &radiance_projection::RadianceProjection,
    &add_records::AddRecords,
    &filter_records::FilterRecords,
    &normalize::Normalize,
    &lobe_rays::LobeRays,
    &indirect_light::IndirectLight,
    &add_images::AddImages,
    &composite::Composite,
];
