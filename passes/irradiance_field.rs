//! The irradiance of indirect light at any point and normal, for passes that ask for it: on the device by `#import IRRADIANCE_FIELD`, whose
//! `indirect_irradiance` is one of those in `shaders/lib/irradiance_field`, on the host by [`Field`]. Another kind of field is one more of each.

use super::photons::{PHOTON_BYTES, lookup::Lookup};
use super::record::{asked_before, index_of};
use super::texels::Looks;
use crate::contract::Encoder;
use crate::contract::port::{IrradianceField, PhotonDensity};
use crate::math::record_index::{Layout, RecordIndex};
use crate::math::{frame::Frame, outline::Outline};
use crate::schedule::*;
use fearless_simd::Simd;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;
use std::sync::Arc;

/// Joins a field to a program that asks it.
pub fn bind(program: Program, field: &IrradianceField) -> Program {
    match field {
        IrradianceField::Records(index) => {
            let layout = Layout::of(index.capacity as usize);
            program
                .import("IRRADIANCE_FIELD", "lib/irradiance_field/records")
                .constant("INDEX_ENTRIES", layout.entries as u32)
                .constant("INDEX_RECORDS", layout.records as u32)
                .constant("NEAR_HEADER", layout.near.header as u32)
                .constant("NEAR_ENTRIES", layout.near.entries as u32)
                .constant("INDEX_ACCURACY", index.rule.accuracy)
                .constant("INDEX_MINIMUM_SPACING", index.rule.spacing[0])
                .constant("INDEX_MAXIMUM_SPACING", index.rule.spacing[1])
                .constant("INDEX_NEAREST", index.rule.nearest)
                .constant("INDEX_CHANGE", index.rule.change)
                .bind("record_index", index.data)
        }
        IrradianceField::Photons(density) => program
            .import("IRRADIANCE_FIELD", "lib/irradiance_field/photons")
            .constant("PHOTONS_WANTED", density.wanted)
            .constant("SEARCH_RADIUS", density.search_radius)
            .constant("PHOTONS_EDGES", density.edges as u8)
            .bind("photon_map", density.map.data),
        IrradianceField::Lightmap(light) => program
            .import("IRRADIANCE_FIELD", "lib/irradiance_field/lightmap")
            .constant("LIGHTMAP_EDGE", light.edge)
            .constant("LIGHTMAP_SIDES", light.sides)
            .constant("LIGHTMAP_FIRST", light.first)
            .bind("lightmap", light.data),
    }
}

/// Where a field is asked.
#[derive(Clone, Copy)]
pub struct Point {
    pub position: Vec3,
    /// Unit normal, on the side that is asked about.
    pub normal: Vec3,
    /// The triangle that it is on, + 1; 0 where that is not known, which no lightmap can be asked for.
    pub triangle: u32,
}

/// A field that host steps ask.
#[derive(Clone, Copy)]
pub struct Asked {
    field: IrradianceField,
    /// Whether it is an index over records that is the same in each round of a loop.
    is_steady: bool,
}

impl Asked {
    /// The field that an input is joined to. An index that is the same in each round of the loop is made ready as the loop starts.
    pub fn of(e: &mut Encoder<'_>, input: &str) -> Option<Self> {
        let field = *e.irradiance_field(input)?;
        let IrradianceField::Records(index) = field else { return Some(Self { field, is_steady: false }) };
        let is_steady = e.is_steady(input);
        if is_steady {
            let make = move |host: &mut dyn HostContext| {
                index_of(&index, host);
                Ok(())
            };
            e.before_loop(Command::Host(Host::new("make_ready", vec![Read::whole(index.data)], Vec::new(), make)));
        }
        Some(Self { field, is_steady })
    }

    /// What a host step reads that asks it.
    pub fn reads(&self) -> Vec<Read> {
        match self.field {
            IrradianceField::Records(_) if self.is_steady => Vec::new(),
            IrradianceField::Records(index) => vec![Read::whole(index.data)],
            IrradianceField::Photons(PhotonDensity { map, .. }) => vec![Read::counted(map.data, PHOTON_BYTES, map.slots)],
            IrradianceField::Lightmap(light) => vec![Read::whole(light.data)],
        }
    }

    /// The index over records, if the field is one: [`Self::on_host`] takes it.
    pub fn index(&self, host: &mut dyn HostContext) -> Option<Arc<RecordIndex>> {
        let IrradianceField::Records(index) = self.field else { return None };
        let made = if self.is_steady { asked_before(&index, host) } else { None };
        Some(made.unwrap_or_else(|| index_of(&index, host)))
    }

    /// The field in a host step that reads it.
    pub fn on_host<'a>(&self, host: &'a dyn HostContext, index: Option<&'a RecordIndex>) -> Option<Field<'a>> {
        match self.field {
            IrradianceField::Records(_) => index.map(Field::Records),
            IrradianceField::Photons(density) => Some(Field::Photons(Density { lookup: Lookup::of(&density.map, host), of: density })),
            IrradianceField::Lightmap(light) => Some(Field::Lightmap(Looks::of(&light, host))),
        }
    }
}

/// An irradiance field on the host.
pub enum Field<'a> {
    Records(&'a RecordIndex),
    Photons(Density<'a>),
    Lightmap(Looks<'a>),
}

impl Field<'_> {
    /// Irradiance at a point [W/m²].
    #[inline(always)]
    pub fn irradiance<S: Simd>(&self, simd: S, at: Point) -> Vec3 {
        let Point { position, normal, .. } = at;
        match self {
            Self::Records(index) => index.estimate(simd, position, normal).0,
            Self::Photons(density) => density.irradiance(position, normal),
            Self::Lightmap(looks) => looks.irradiance(at),
        }
    }

    /// That at each of some points.
    #[inline(always)]
    pub fn irradiances<S: Simd, const POINTS: usize>(&self, simd: S, points: &[Option<Point>; POINTS]) -> [Vec3; POINTS] {
        let mut found = [Vec3::ZERO; POINTS];
        match self {
            Self::Records(index) => index.estimates(simd, &points.map(|point| point.map(|point| [point.position, point.normal])), &mut found),
            Self::Photons(density) => {
                for (found, point) in found.iter_mut().zip(points) {
                    *found = point.map_or(Vec3::ZERO, |point| density.irradiance(point.position, point.normal));
                }
            }
            Self::Lightmap(looks) => {
                for (found, point) in found.iter_mut().zip(points) {
                    *found = point.map_or(Vec3::ZERO, |point| looks.irradiance(point));
                }
            }
        }
        found
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
