//! Records and requests in memory, as `shaders/lib/record.wgsl` and `lib/tile.wgsl` read them.

use crate::contract::{Encoder, port};
use crate::host_struct;
use crate::math::{
    colour::luminance,
    frame::Frame,
    harmonics::reflection::{LobeTable, table_fours},
    hemisphere::{Edge, Table},
    projection::Pinhole,
    radius::{Ellipse, Reach},
    random::{hash, unit},
    record_index::{HEADER, Layout, RecordIndex, RecordLight},
    sum::Summed,
    thinning::Vertex,
    weight::{self, Rule},
};
use crate::schedule::*;
use bytemuck::cast_slice;
use glam::{DVec2, Vec3};
use std::f32::consts::TAU;
use std::sync::Arc;

host_struct! {
    /// One irradiance record; lengths in scene units, irradiance and its standard error in W/m².
    pub struct Record {
        position: [f32; 3],
        /// What the validity radius is in proportion to.
        radius: f32,
        normal: [f32; 3],
        minimum_distance: f32,
        irradiance: [f32; 3],
        /// Width of the pixel that asked for the record.
        footprint: f32,
        /// Gradients of red, green and blue per radian; the fourth numbers are the stretch, see `math::weight::Record`.
        rotation: [[f32; 4]; 3],
        /// Gradients per scene unit; the fourth numbers are the relative gradient, the share of the least spacing, and the confinement.
        translation: [[f32; 4]; 3],
        error: [f32; 3],
        padding: u32,
    }
}

host_struct! {
    /// A place that needs a record.
    pub struct Request {
        position: [f32; 3],
        footprint: f32,
        normal: [f32; 3],
        /// Turn of the hemisphere's frame around the normal [radians].
        turn: f32,
        /// How much farther its record reaches along the frame's first axis, `√(1 − (R₀/R₁)²)`; 0 where the light alone says so.
        stretch: f32,
        /// The share that it reaches of the way to what stands on its surface; 0 where that is not known.
        confinement: f32,
        /// Unit normal of the surface's plane, in signed 16 bits a component; 0 where that of the shading stands for it.
        face: [u32; 2],
    }
}

impl Request {
    /// One whose record reaches as far all around.
    pub fn new(position: Vec3, footprint: f32, normal: Vec3, turn: f32) -> Self {
        Self { position: position.into(), footprint, normal: normal.into(), turn, stretch: 0.0, confinement: 0.0, face: [0; 2] }
    }

    /// The same on a surface whose plane has another unit normal: light that comes from below it is none.
    pub fn on(self, face: Vec3) -> Self {
        let bits = |component: f32| u32::from((component * 32767.0).round() as i16 as u16);
        Self { face: [bits(face.x) | bits(face.y) << 16, bits(face.z)], ..self }
    }

    /// The normal of the surface's plane, if it is not that of the shading.
    pub fn face(&self) -> Option<Vec3> {
        let component = |bits: u32| f32::from(bits as u16 as i16) / 32767.0;
        let [xy, z] = self.face;
        (self.face != [0; 2]).then(|| Vec3::new(component(xy), component(xy >> 16), component(z)))
    }

    /// One whose record reaches as far as `reach` says.
    fn reaching(place: &Vertex, reach: &Reach, turn: f32) -> Self {
        let stretch = reach.stretch.length();
        let round = Self { confinement: reach.confinement, ..Self::new(place.position, reach.radius, place.normal, turn) };
        let along = Frame::new(place.normal).to_local(reach.stretch);
        if stretch == 0.0 { round } else { Self { turn: along.y.atan2(along.x), stretch, ..round } }
    }
}

impl Record {
    /// Its position and normal.
    pub fn place(&self) -> [Vec3; 2] {
        [self.position.into(), self.normal.into()]
    }

    /// Width of the pixel that asked for it [scene units].
    pub fn footprint(&self) -> f32 {
        self.footprint
    }

    /// [W/m²]
    pub fn irradiance(&self) -> Vec3 {
        self.irradiance.into()
    }

    /// With other light, which changes around it as it did.
    pub fn set_irradiance(&mut self, irradiance: Vec3) {
        self.irradiance = irradiance.into();
    }

    /// Goes over to another at the same place by a share of what they differ in, but for their light.
    pub fn approach(&mut self, goal: &Self, share: f32) {
        let approach = |from: &mut [f32], to: &[f32]| from.iter_mut().zip(to).for_each(|(from, to)| *from += share * (to - *from));
        approach(std::slice::from_mut(&mut self.radius), &[goal.radius]);
        approach(std::slice::from_mut(&mut self.minimum_distance), &[goal.minimum_distance]);
        approach(self.rotation.as_flattened_mut(), goal.rotation.as_flattened());
        approach(self.translation.as_flattened_mut(), goal.translation.as_flattened());
        approach(&mut self.error, &goal.error);
    }

    /// As it joins a cache: it knows how finely records stand around it in a picture of so much irradiance.
    pub fn refine(&mut self, rule: &Rule, level: f32) {
        self.translation[1][3] = rule.fineness(&weight::Record::from(&*self), level);
    }
}

/// The first records tell what the picture's irradiance is: they stand far apart.
pub const FIRST: usize = 256;

/// What the picture's irradiance is, by the first of its records [W/m²].
pub fn level<'r>(records: impl Iterator<Item = &'r Record>) -> f32 {
    let (sum, count) = records.take(FIRST).fold((0.0, 0), |(sum, count), record| (sum + luminance(record.irradiance().as_dvec3()), count + 1));
    (sum / f64::from(count.max(1))) as f32
}

host_struct! {
    /// Which records count where, and how much.
    pub struct Weighting {
        accuracy: f32,
        /// Least and most reach in widths of the pixel that asked for the record.
        minimum_spacing: f32,
        maximum_spacing: f32,
        /// 0 Ward, 1 Tabellion and Lamorlette, 2 compact.
        kind: u32,
        /// Most of the validity radius in distances of the nearest thing seen.
        nearest: f32,
        /// Most of the validity radius in lengths over which the irradiance changes by all of itself.
        change: f32,
        /// A point whose weights add up to this or less misses a record.
        overlap: f32,
        /// Most change within the least validity radius, as a share of the picture's irradiance.
        contrast: f32,
        /// How small the least validity radius may become for it, in widths of the pixel.
        finest_spacing: f32,
        padding_a: u32,
        padding_b: u32,
        padding_c: u32,
    }
}

host_struct! {
    pub struct TileSample {
        direction: [f32; 3],
        cosine_weight: f32,
        plain_weight: f32,
        rotation_x: f32,
        rotation_y: f32,
        depth_cosine: f32,
    }
}

host_struct! {
    pub struct TileEdge {
        gradient: [f32; 3],
        a: u32,
        b: u32,
        hessian_xx: f32,
        hessian_xy: f32,
        hessian_yy: f32,
    }
}

host_struct! {
    /// Items of a list that a step works on.
    pub struct Stretch {
        first: u32,
        count: u32,
        padding_a: u32,
        padding_b: u32,
    }
}

impl From<&Rule> for Weighting {
    fn from(rule: &Rule) -> Self {
        Self {
            accuracy: rule.accuracy,
            minimum_spacing: rule.spacing[0],
            maximum_spacing: rule.spacing[1],
            kind: rule.weighting as u32,
            nearest: rule.nearest,
            change: rule.change,
            overlap: rule.overlap,
            contrast: rule.contrast,
            finest_spacing: rule.finest_spacing,
            padding_a: 0,
            padding_b: 0,
            padding_c: 0,
        }
    }
}

pub const LAYOUTS: &[HostLayout] = &[Record::LAYOUT, Request::LAYOUT, Weighting::LAYOUT, TileSample::LAYOUT, TileEdge::LAYOUT, Stretch::LAYOUT];

pub const RECORD_BYTES: u64 = size_of::<Record>() as u64;
pub const REQUEST_BYTES: u64 = size_of::<Request>() as u64;

host_struct! {
    /// Where a lobe's table begins among the fours of all, and the order that it holds.
    pub struct TablePlace {
        first: u32,
        order: u32,
    }
}

/// Of tables one after the other, by their orders and the directions along an edge of their grids.
pub fn table_places(orders: &[u32], edge: usize) -> Vec<TablePlace> {
    let mut end = 0;
    let places = orders.iter().map(|order| {
        let first = end;
        end += table_fours(*order as usize, edge) as u32;
        TablePlace { first, order: *order }
    });
    places.collect()
}

/// Tables of lobes, one after the other.
pub fn lobe_bytes(tables: &[LobeTable]) -> Vec<u8> {
    tables.iter().flat_map(|table| bytemuck::cast_slice::<_, u8>(&table.values).iter().copied()).collect()
}

/// A table's samples in single precision.
pub fn sample_bytes(table: &Table) -> Vec<u8> {
    let single = |v: [f64; 3]| v.map(|x| x as f32);
    let samples: Vec<_> = table
        .samples
        .iter()
        .map(|s| TileSample {
            direction: single(s.direction),
            cosine_weight: s.cosine_weight as f32,
            plain_weight: s.plain_weight as f32,
            rotation_x: s.rotation[0] as f32,
            rotation_y: s.rotation[1] as f32,
            depth_cosine: s.depth_cosine as f32,
        })
        .collect();
    cast_slice(&samples).to_vec()
}

/// Edges of a table in single precision.
pub fn edge_bytes(edges: &[Edge]) -> Vec<u8> {
    let single = |v: [f64; 3]| v.map(|x| x as f32);
    let edges: Vec<_> = edges
        .iter()
        .map(|e| {
            let [hessian_xx, hessian_xy, hessian_yy] = single(e.hessian);
            TileEdge { gradient: single(e.gradient), a: e.a, b: e.b, hessian_xx, hessian_xy, hessian_yy }
        })
        .collect();
    cast_slice(&edges).to_vec()
}

impl From<&Record> for weight::Record {
    fn from(record: &Record) -> Self {
        let gradients = |all: [[f32; 4]; 3]| all.map(|[x, y, z, _]| Vec3::new(x, y, z));
        Self {
            position: record.position.into(),
            radius: record.radius,
            normal: record.normal.into(),
            minimum_distance: record.minimum_distance,
            irradiance: record.irradiance.into(),
            footprint: record.footprint,
            error: record.error.into(),
            rotation: gradients(record.rotation),
            translation: gradients(record.translation),
            relative_gradient: record.translation[0][3],
            fineness: record.translation[1][3],
            confinement: record.translation[2][3],
            stretch: Vec3::from(record.rotation.map(|[_, _, _, w]| w)),
        }
    }
}

impl From<&weight::Record> for Record {
    fn from(record: &weight::Record) -> Self {
        let gradients = |all: [Vec3; 3], fourth: Vec3| [0, 1, 2].map(|i| all[i].extend(fourth[i]).to_array());
        Self {
            position: record.position.into(),
            radius: record.radius,
            normal: record.normal.into(),
            minimum_distance: record.minimum_distance,
            irradiance: record.irradiance.into(),
            footprint: record.footprint,
            rotation: gradients(record.rotation, record.stretch),
            translation: gradients(record.translation, Vec3::new(record.relative_gradient, record.fineness, record.confinement)),
            error: record.error.into(),
            padding: 0,
        }
    }
}

/// What a record's validity radius is in proportion to; the shaders know them by these numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Radius {
    HarmonicMean = 0,
    Curvature = 1,
}

/// The record of a request whose tile was summed on the host: what `record_of` in `shaders/lib/sums.wgsl` makes of it.
/// Distances of nothing but sky are a huge number, as there.
pub fn summed_record(request: &Request, summed: &Summed, gradients: bool, radius: Radius) -> Record {
    let frame = Frame::new(Vec3::from(request.normal)).turned(request.turn);
    let ellipse = match radius {
        Radius::HarmonicMean => Ellipse::disc(summed.harmonic_mean_cosine),
        Radius::Curvature => Ellipse::of_curvature(summed.luminance(), summed.hessian),
    };
    let ellipse = if request.stretch > 0.0 { Ellipse { stretch: DVec2::X * f64::from(request.stretch), ..ellipse } } else { ellipse };
    let record = summed.record(Vec3::from(request.position), &frame, ellipse, request.footprint);
    let record = weight::Record { minimum_distance: summed.min_distance.min(FAR_AWAY) as f32, confinement: request.confinement, ..record };
    let none = [Vec3::ZERO; 3];
    Record::from(&if gradients { record } else { weight::Record { rotation: none, translation: none, relative_gradient: 0.0, ..record } })
}

/// Distance of the sky [scene units].
const FAR_AWAY: f64 = 1e30;

/// Records that a host step reads: those that joined the cache since the last look.
#[derive(Debug, Clone, Copy)]
pub struct Fresh {
    records: Resource,
    count: Variable,
}

impl Fresh {
    /// Copies the records from `first` on out of the cache, `capacity` at most.
    pub fn encode(e: &mut Encoder<'_>, cache: &port::RecordCache, first: Variable, capacity: u32) -> Self {
        let fresh = Self { records: e.buffer("fresh", capacity as u64 * RECORD_BYTES), count: e.variable("fresh_count", false) };
        let stretch = e.buffer("stretch", size_of::<Stretch>() as u64);
        let all = cache.count;
        e.host("stretch", &[], &[stretch], move |host| {
            let first = host.variable(first);
            let count = host.variable(all).saturating_sub(first).min(capacity);
            host.set(fresh.count, count);
            host.write(stretch, 0, bytemuck::bytes_of(&Stretch { first, count, padding_a: 0, padding_b: 0 }));
            Ok(())
        });
        let program = Program::new("copy_records").bind("stretch", stretch).bind("records", cache.records).bind("fresh", fresh.records);
        e.compute(program, "copy", Groups::Counted { count: fresh.count, divisor: 64, per: 1 });
        fresh
    }

    pub fn read(&self) -> Read {
        Read::counted(self.records, RECORD_BYTES, self.count)
    }

    /// The records, in a host step that reads them.
    pub fn records(&self, host: &dyn HostContext) -> Vec<weight::Record> {
        bytemuck::pod_collect_to_vec::<u8, Record>(host.read(self.records)).iter().map(weight::Record::from).collect()
    }
}

/// The records in the bytes of an index.
pub fn indexed(index: &port::RecordIndex, bytes: &[u8]) -> Vec<Record> {
    let header: [u32; HEADER] = bytemuck::pod_read_unaligned(&bytes[..4 * HEADER]);
    let records = &bytes[4 * Layout::of(index.capacity as usize).records..];
    bytemuck::pod_collect_to_vec(&records[..header[3] as usize * RECORD_BYTES as usize])
}

/// The records of an index as points look at them, in a host step that reads it.
pub fn light_of(index: &port::RecordIndex, host: &dyn HostContext) -> RecordLight {
    let records: Vec<weight::Record> = indexed(index, host.read(index.data)).iter().map(weight::Record::from).collect();
    RecordLight::new(&records, &index.rule)
}

/// The index, in a host step that reads it. While records stand where they do, what finds them is made once, for all who ask.
pub fn index_of(index: &port::RecordIndex, host: &mut dyn HostContext) -> Arc<RecordIndex> {
    let known = asked_before(index, host);
    let bytes = host.read(index.data);
    let records: Vec<weight::Record> = indexed(index, bytes).iter().map(weight::Record::from).collect();
    let lit = known.and_then(|known| known.lit(&records));
    let layout = Layout::of(index.capacity as usize);
    let found = Arc::new(lit.unwrap_or_else(|| RecordIndex::new(bytemuck::cast_slice(bytes), layout, records, index.rule)));
    *host.state(index.asked) = Some(Box::new(found.clone()));
    found
}

/// The index as it was asked last.
pub fn asked_before(index: &port::RecordIndex, host: &mut dyn HostContext) -> Option<Arc<RecordIndex>> {
    host.state(index.asked).as_ref()?.downcast_ref::<Arc<RecordIndex>>().cloned()
}

/// Requests of a node that places records without looking at pixels: nothing in them yet.
pub fn requests(e: &mut Encoder<'_>, capacity: u32) -> port::Requests {
    let places = e.buffer("requests", u64::from(capacity) * REQUEST_BYTES);
    let [count, made] = ["count", "made"].map(|name| e.variable(name, false));
    port::Requests { places, count, capacity, made, at_most: u32::MAX, slots: None }
}

/// Makes a request of each place, in a host step that writes them. Its footprint is the radius within which the place stands for others.
pub fn hand_on(host: &mut dyn HostContext, requests: &port::Requests, places: &[(Vertex, Reach)]) {
    let turn = |number: u32| TAU * unit(hash(number + 1));
    let all: Vec<Request> = (0..).zip(places).map(|(number, (place, reach))| Request::reaching(place, reach, turn(number))).collect();
    host.write(requests.places, 0, bytemuck::cast_slice(&all));
    host.set(requests.count, all.len() as u32);
    host.set(requests.made, all.len() as u32);
}

/// Four floats a texel, in a host step that reads an RGBA32F image.
pub fn texels(host: &dyn HostContext, image: Resource) -> &[[f32; 4]] {
    bytemuck::cast_slice(host.read(image))
}

/// The pinhole of the frame's camera.
pub fn pinhole(host: &dyn HostContext) -> Pinhole {
    let (camera, size) = host.camera();
    Pinhole { eye: camera.eye, right: camera.right(), up: camera.up, forward: camera.direction, half_extent: camera.half_extent(size), size }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn tables_begin_where_those_before_them_end() {
        let places: Vec<_> = table_places(&[3, 1, 4], 5).iter().map(|place| (place.first, place.order)).collect();
        let [three, one] = [3, 1].map(|order| table_fours(order, 5) as u32);
        assert_eq!(places, [(0, 3), (three, 1), (three + one, 4)]);
    }

    #[test]
    fn records_come_back_as_they_were() {
        let vectors = |x: f32| [0.0, 10.0, 20.0].map(|more| Vec3::new(x, x + 1.0, x + 2.0) + more);
        let record = weight::Record {
            position: Vec3::new(1.0, 2.0, 3.0),
            radius: 4.0,
            normal: Vec3::new(5.0, 6.0, 7.0),
            minimum_distance: 8.0,
            irradiance: Vec3::new(9.0, 10.0, 11.0),
            footprint: 12.0,
            error: Vec3::new(18.0, 19.0, 20.0),
            rotation: vectors(100.0),
            translation: vectors(200.0),
            stretch: Vec3::new(13.0, 14.0, 15.0),
            relative_gradient: 16.0,
            fineness: 17.0,
            confinement: 0.25,
        };
        assert_eq!(weight::Record::from(&Record::from(&record)), record);
    }

    #[test]
    fn records_of_sums_have_gradients_where_they_are_asked_for() {
        let request = Request::new(Vec3::new(1.0, 2.0, 3.0), 0.25, Vec3::Z, 0.3);
        let summed = Summed {
            irradiance: DVec3::new(1.0, 2.0, 3.0),
            error: DVec3::new(0.1, 0.2, 0.3),
            rotation: [DVec3::X; 3],
            translation: [DVec3::Y; 3],
            hessian: DVec3::new(0.5, 0.0, 0.25),
            harmonic_mean_cosine: 2.0,
            harmonic_mean_plain: 3.0,
            min_distance: f64::INFINITY,
        };
        let with = summed_record(&request, &summed, true, Radius::HarmonicMean);
        let without = summed_record(&request, &summed, false, Radius::HarmonicMean);
        assert_eq!((with.position, with.irradiance, with.footprint, with.radius), (request.position, [1.0, 2.0, 3.0], 0.25, 2.0));
        assert_eq!((with.minimum_distance, with.error), (FAR_AWAY as f32, [0.1, 0.2, 0.3]));
        let [told, left_out] = [&with, &without].map(weight::Record::from);
        assert!(told.rotation[0] != Vec3::ZERO && told.translation[0] != Vec3::ZERO && told.relative_gradient > 0.0);
        assert_eq!((left_out.rotation, left_out.translation, left_out.relative_gradient), ([Vec3::ZERO; 3], [Vec3::ZERO; 3], 0.0));
        assert_eq!((left_out.irradiance, left_out.error, left_out.radius), (told.irradiance, told.error, told.radius));
        assert_ne!(summed_record(&request, &summed, true, Radius::Curvature).radius, with.radius);
    }
}
