//! The irradiance of indirect light at any point and normal, for passes that ask for it: on the device by `#import IRRADIANCE_FIELD`, whose
//! `indirect_irradiance` is one of those in `shaders/lib/irradiance_field`, on the host by [`Field`]. Another kind of field is one more of each.

use super::photons::{PHOTON_BYTES, lookup::Lookup};
use super::record::{index_of, indexed_records};
use crate::contract::port::{IrradianceField, PhotonDensity};
use crate::math::record_index::{Layout, RecordIndex};
use crate::math::{frame::Frame, outline::Outline, weight};
use crate::schedule::*;
use fearless_simd::Simd;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Joins a field to a program that asks it.
pub fn bind(program: Program, field: &IrradianceField) -> Program {
    match field {
        IrradianceField::Records(index) => {
            let layout = Layout::of(index.capacity as usize);
            program
                .import("IRRADIANCE_FIELD", "lib/irradiance_field/records")
                .constant("INDEX_ENTRIES", layout.entries as u32)
                .constant("INDEX_RECORDS", layout.records as u32)
                .bind("record_index", index.data)
                .bind("index_weighting", index.weighting)
        }
        IrradianceField::Photons(density) => program
            .import("IRRADIANCE_FIELD", "lib/irradiance_field/photons")
            .constant("PHOTONS_WANTED", density.wanted)
            .constant("SEARCH_RADIUS", density.search_radius)
            .constant("PHOTONS_EDGES", density.edges as u8)
            .bind("photon_map", density.map.data),
    }
}

/// What a host step reads that asks a field.
pub fn reads(field: &IrradianceField) -> Vec<Read> {
    match field {
        IrradianceField::Records(index) => vec![Read::whole(index.data)],
        IrradianceField::Photons(PhotonDensity { map, .. }) => vec![Read::counted(map.data, PHOTON_BYTES, map.slots)],
    }
}

/// The records of a field that has some, as [`on_host`] takes them.
pub fn records(field: &IrradianceField, host: &dyn HostContext) -> Vec<weight::Record> {
    match field {
        IrradianceField::Records(index) => indexed_records(index, host),
        IrradianceField::Photons(_) => Vec::new(),
    }
}

/// A field in a host step that reads it, with its records.
pub fn on_host<'a>(field: &IrradianceField, host: &'a dyn HostContext, records: &'a [weight::Record]) -> Field<'a> {
    match field {
        IrradianceField::Records(index) => Field::Records(index_of(index, host, records)),
        IrradianceField::Photons(density) => Field::Photons(Density { lookup: Lookup::of(&density.map, host), of: *density }),
    }
}

/// An irradiance field on the host.
pub enum Field<'a> {
    Records(RecordIndex<'a>),
    Photons(Density<'a>),
}

impl Field<'_> {
    /// Irradiance at a point [W/m²].
    #[inline(always)]
    pub fn irradiance<S: Simd>(&self, simd: S, position: Vec3, normal: Vec3) -> Vec3 {
        match self {
            Self::Records(index) => index.estimate(simd, position, normal).0,
            Self::Photons(density) => density.irradiance(position, normal),
        }
    }
}

/// The photons near a point, and the area that they stand for: as `shaders/lib/irradiance_field/photons.wgsl`.
pub struct Density<'a> {
    lookup: Lookup<'a>,
    of: PhotonDensity,
}

impl Density<'_> {
    fn irradiance(&self, position: Vec3, normal: Vec3) -> Vec3 {
        let zone = self.lookup.zone(position, normal, self.of.wanted, self.of.search_radius);
        let frame = Frame::new(normal);
        let (mut flux, mut count, mut outline) = (Vec3::ZERO, 0, Outline::new());
        self.lookup.for_each(position, normal, zone, |photon, _| {
            flux += Vec3::from(photon.flux);
            count += 1;
            if self.of.edges {
                let way = Vec3::from(photon.position) - position;
                outline.add(Vec2::new(way.dot(frame.tangent), way.dot(frame.bitangent)));
            }
        });
        let area = if self.of.edges { outline.stands_for(zone.radius) } else { PI * zone.radius * zone.radius };
        flux * (zone.fair_share(count) / area.max(f32::MIN_POSITIVE))
    }
}
