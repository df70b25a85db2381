//! What flows along the edges of a pipeline.

use super::{Place, Refusal};
use crate::math::harmonics::{
    Harmonics,
    reflection::{LobeTable, quads},
};
use crate::math::hemisphere::Table;
use crate::math::radiance::PLANES;
pub use crate::math::weight::{Rule, Weighting};
use crate::schedule::{Resource, Variable};
use std::sync::Arc;

/// The kind of a port: an edge joins an output to an input of the same kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PortKind {
    /// The visible surfaces.
    GBuffer,
    /// Depth from the lights.
    ShadowMaps,
    /// Reflected direct light.
    DirectLight,
    /// One texel a pixel.
    Image,
    /// Weighted sums over records.
    Splats,
    /// Places that need a record.
    Requests,
    /// One hemisphere a request.
    Tiles,
    /// The same with what each sample stands for.
    WeightedTiles,
    /// Those of this round.
    Records,
    /// All so far.
    RecordCache,
    /// What can be asked for the irradiance at any point.
    IrradianceField,
    /// Photons where they arrived.
    PhotonMap,
    /// Light kept in the surfaces' own texture.
    Lightmap,
    /// Texels that send their light out.
    Shooters,
    /// What they see.
    ShooterViews,
    /// Lobes of materials, projected on harmonics.
    Lobes,
    /// The lobe that each pixel sees.
    VisibleLobes,
    /// Whether a loop has come to its end: a number that is not 0.
    Flag,
    /// Of passes of another program: what flows between them, with its article, such as "a map of edges".
    Own(&'static str),
}

impl PortKind {
    /// With its article, for messages: "an atlas of tiles".
    pub fn phrase(self) -> &'static str {
        match self {
            Self::GBuffer => "a G-buffer",
            Self::ShadowMaps => "shadow maps",
            Self::DirectLight => "direct light",
            Self::Image => "an image",
            Self::Splats => "a splat buffer",
            Self::Requests => "requests for records",
            Self::Tiles => "an atlas of tiles",
            Self::WeightedTiles => "an atlas of tiles with weights",
            Self::Records => "new records",
            Self::RecordCache => "a record cache",
            Self::IrradianceField => "an irradiance field",
            Self::PhotonMap => "a photon map",
            Self::Lightmap => "a lightmap",
            Self::Shooters => "texels that shoot",
            Self::ShooterViews => "views from texels that shoot",
            Self::Lobes => "coefficients of lobes",
            Self::VisibleLobes => "the lobes of visible surfaces",
            Self::Flag => "a flag",
            Self::Own(phrase) => phrase,
        }
    }
}

/// What a node hands on.
#[derive(Debug, Clone, PartialEq)]
pub enum Port {
    /// The visible surfaces.
    GBuffer(GBuffer),
    /// Depth from the lights.
    ShadowMaps(ShadowMaps),
    /// Reflected direct light.
    DirectLight(DirectLight),
    /// One texel a pixel.
    Image(Image),
    /// Weighted sums over records.
    Splats(Splats),
    /// Places that need a record.
    Requests(Requests),
    /// One hemisphere a request.
    Tiles(Tiles),
    /// The same with what each sample stands for.
    WeightedTiles(WeightedTiles),
    /// Those of this round.
    Records(Records),
    /// All so far.
    RecordCache(RecordCache),
    /// What can be asked for the irradiance at any point.
    IrradianceField(IrradianceField),
    /// Photons where they arrived.
    PhotonMap(PhotonMap),
    /// Light kept in the surfaces' own texture.
    Lightmap(Lightmap),
    /// Texels that send their light out.
    Shooters(Shooters),
    /// What they see.
    ShooterViews(ShooterViews),
    /// Lobes of materials, projected on harmonics.
    Lobes(Lobes),
    /// The lobe that each pixel sees.
    VisibleLobes(VisibleLobes),
    /// Whether a loop has come to its end: a number that is not 0.
    Flag(Variable),
    /// Of passes of another program.
    Own(Own),
}

impl Port {
    /// What inputs it fits.
    pub fn kind(&self) -> PortKind {
        match self {
            Self::GBuffer(_) => PortKind::GBuffer,
            Self::ShadowMaps(_) => PortKind::ShadowMaps,
            Self::DirectLight(_) => PortKind::DirectLight,
            Self::Image(_) => PortKind::Image,
            Self::Splats(_) => PortKind::Splats,
            Self::Requests(_) => PortKind::Requests,
            Self::Tiles(_) => PortKind::Tiles,
            Self::WeightedTiles(_) => PortKind::WeightedTiles,
            Self::Records(_) => PortKind::Records,
            Self::RecordCache(_) => PortKind::RecordCache,
            Self::IrradianceField(_) => PortKind::IrradianceField,
            Self::PhotonMap(_) => PortKind::PhotonMap,
            Self::Lightmap(_) => PortKind::Lightmap,
            Self::Shooters(_) => PortKind::Shooters,
            Self::ShooterViews(_) => PortKind::ShooterViews,
            Self::Lobes(_) => PortKind::Lobes,
            Self::VisibleLobes(_) => PortKind::VisibleLobes,
            Self::Flag(_) => PortKind::Flag,
            Self::Own(own) => PortKind::Own(own.kind),
        }
    }

    /// The memory behind the port: what has to be whole where the port is looked at.
    pub fn resources(&self) -> Vec<Resource> {
        match self {
            Self::GBuffer(p) => vec![p.position, p.normal, p.reflectance, p.triangles],
            Self::ShadowMaps(p) => vec![p.depth],
            Self::DirectLight(p) => vec![p.radiance],
            Self::Image(p) => vec![p.texture],
            Self::Splats(p) => [p.sums, p.cache.records].into_iter().chain(p.counts).chain(p.lobes.iter().flat_map(VisibleLobes::resources)).collect(),
            Self::Requests(p) => [p.places].into_iter().chain(p.slots).collect(),
            Self::Tiles(p) => p.resources(),
            Self::WeightedTiles(p) => p.tiles.resources(),
            Self::Records(p) => [p.records].into_iter().chain(p.coefficients.map(|c| c.values)).collect(),
            Self::RecordCache(p) => [p.records].into_iter().chain(p.coefficients.map(|c| c.values)).collect(),
            Self::IrradianceField(p) => p.resources(),
            Self::PhotonMap(p) => p.resources(),
            Self::Lightmap(p) => p.resources().to_vec(),
            Self::Shooters(p) => vec![p.requests.places, p.shots],
            Self::ShooterViews(p) => vec![p.seen],
            Self::Lobes(p) => vec![p.values],
            Self::VisibleLobes(p) => p.resources().to_vec(),
            Self::Flag(_) => Vec::new(),
            Self::Own(own) => own.resources.clone(),
        }
    }

    /// The same over other memory; every resource and variable is asked for in an order that the kind of port fixes.
    pub fn over(&self, memory: &mut dyn Memory) -> Self {
        let mut port = self.clone();
        match &mut port {
            Self::GBuffer(p) => [&mut p.position, &mut p.normal, &mut p.reflectance, &mut p.triangles].into_iter().for_each(|r| replace(r, memory)),
            Self::ShadowMaps(p) => replace(&mut p.depth, memory),
            Self::DirectLight(p) => replace(&mut p.radiance, memory),
            Self::Image(p) => replace(&mut p.texture, memory),
            Self::Splats(p) => {
                replace(&mut p.sums, memory);
                p.counts.iter_mut().for_each(|r| replace(r, memory));
                p.lobes.iter_mut().for_each(|lobes| lobes.over(memory));
                p.cache.over(memory);
            }
            Self::Requests(p) => p.over(memory),
            Self::Tiles(p) => p.over(memory),
            Self::WeightedTiles(p) => p.tiles.over(memory),
            Self::Records(p) => {
                replace(&mut p.records, memory);
                p.coefficients.iter_mut().for_each(|c| replace(&mut c.values, memory));
                p.count = memory.variable(p.count);
            }
            Self::RecordCache(p) => p.over(memory),
            Self::IrradianceField(p) => p.over(memory),
            Self::PhotonMap(p) => p.over(memory),
            Self::Lightmap(p) => p.over(memory),
            Self::Shooters(p) => {
                p.requests.over(memory);
                replace(&mut p.shots, memory);
            }
            Self::ShooterViews(p) => replace(&mut p.seen, memory),
            Self::Lobes(p) => p.over(memory),
            Self::VisibleLobes(p) => p.over(memory),
            Self::Flag(variable) => *variable = memory.variable(*variable),
            Self::Own(own) => {
                own.resources.iter_mut().for_each(|r| replace(r, memory));
                own.variables.iter_mut().for_each(|variable| *variable = memory.variable(*variable));
            }
        }
        port
    }
}

/// What passes of another program hand to each other: the kind says what it is, and which resource and variable is what.
#[derive(Debug, Clone, PartialEq)]
pub struct Own {
    /// As in [`PortKind::Own`].
    pub kind: &'static str,
    /// In an order that the passes know.
    pub resources: Vec<Resource>,
    /// In an order that the passes know.
    pub variables: Vec<Variable>,
}

/// Other memory for a port: see [`Port::over`].
pub trait Memory {
    /// The one in the place of another.
    fn resource(&mut self, resource: Resource) -> Resource;
    /// The one in the place of another.
    fn variable(&mut self, variable: Variable) -> Variable;
}

fn replace(resource: &mut Resource, memory: &mut dyn Memory) {
    *resource = memory.resource(*resource);
}

/// The visible surfaces, one texel a pixel: their extent is that of all that is made of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GBuffer {
    /// Width and height [pixels].
    pub size: [u32; 2],
    /// RGBA32F: position [scene units]; the width of a pixel there [scene units], 0 where nothing is seen.
    pub position: Resource,
    /// RGBA32F: unit shading normal, facing the viewer; depth along the camera's axis [scene units].
    pub normal: Resource,
    /// RGBA16F: diffuse reflectance; 1 where a surface is seen.
    pub reflectance: Resource,
    /// R32U: index of the triangle + 1, 0 where nothing is seen.
    pub triangles: Resource,
}

/// Reflected direct light, and who lights from emitters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectLight {
    /// RGBA32F: radiance toward the camera.
    pub radiance: Resource,
    /// Whether the direct pass lights surfaces from emitters and the sky, so that records must leave emission out.
    pub lights_from_emitters: bool,
}

/// Depth from the lights that cast shadows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadowMaps {
    /// Buffer of f32 or depth texture: six layers a point light, one a spot or directional light, reverse Z.
    pub depth: Resource,
    /// From a row of the buffer to the next [texels]; None for a texture.
    pub pitch: Option<u32>,
    /// Edge of a map [texels].
    pub resolution: u32,
    /// Percentage-closer taps a lookup.
    pub taps: u32,
}

/// RGBA32F, one texel a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Image {
    /// As large as the picture.
    pub texture: Resource,
    /// How they are named in files.
    pub channels: Channels,
}

/// How an image's channels are named in a layered EXR.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channels {
    /// R, G, B.
    Colour,
    /// The first channel alone.
    Single,
    /// The fourth channel alone.
    Fourth,
    /// X, Y, Z.
    Vector,
}

/// Weighted sums over the records that count at each pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Splats {
    /// RGBA32F: Σ w E_k(p) per channel, Σ w.
    pub sums: Resource,
    /// Number of records that count, as f32 in the first channel; absent unless asked for.
    pub counts: Option<Resource>,
    /// Whether the sums are of standard errors in place of irradiance.
    pub of_errors: bool,
    /// The lobes that turn records into radiance toward the camera, which the sums are of then in place of irradiance.
    pub lobes: Option<VisibleLobes>,
    /// What was splatted.
    pub cache: RecordCache,
}

/// Places that need a record: at most `capacity` a round.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Requests {
    /// Buffer of requests: position, footprint, normal, turn of the frame.
    pub places: Resource,
    /// How many there are this round.
    pub count: Variable,
    /// Most a round.
    pub capacity: u32,
    /// How many there have been this frame, and may be.
    pub made: Variable,
    /// Most a frame.
    pub at_most: u32,
    /// Buffer of u32: which records of a cache these are the places of, where they are of records that are there already.
    pub slots: Option<Resource>,
}

/// One hemisphere a request.
#[derive(Debug, Clone, PartialEq)]
pub struct Tiles {
    /// Buffer of vec4, `tile · samples + sample`: radiance seen, distance (a huge number for sky).
    pub samples: Resource,
    /// Buffer of a float a tile: the standard error of its sum, over what it would be were there one ray a stratum. None where there is, or where that is not known.
    pub sureness: Option<Resource>,
    /// Where they were shaded.
    pub place: Place,
    /// Whether each round of their loop has them at the same places: they see the same, but for its light.
    pub is_steady: bool,
    /// Whether emitters and the sky are in them; otherwise the direct pass lights from these.
    pub sees_emission: bool,
    /// What asked for them.
    pub requests: Requests,
    /// Which directions are where in a tile.
    pub shape: crate::math::hemisphere::Shape,
    /// Samples along a tile's edge, N.
    pub resolution: u32,
    /// Tiles along a row of the atlas.
    pub tiles_per_row: u32,
    /// The shape without compensation: directions and raw weights.
    pub table: Arc<Table>,
}

/// Tiles with what each sample stands for.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightedTiles {
    /// What was seen.
    pub tiles: Tiles,
    /// The weights after compensation.
    pub table: Arc<Table>,
}

/// New records, in the requests' order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Records {
    /// Buffer of [`crate::passes::record::Record`].
    pub records: Resource,
    /// What arrives from where, for records of radiance.
    pub coefficients: Option<Coefficients>,
    /// How many there are this round.
    pub count: Variable,
    /// Most a round.
    pub capacity: u32,
    /// Whether each round of their loop has them at the same places and reaching as far, with other light.
    pub is_steady: bool,
    /// Whether light that comes straight from emitters and the sky is in them: see [`Tiles::sees_emission`].
    pub sees_emission: bool,
}

/// All records so far; a history.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordCache {
    /// Buffer of [`crate::passes::record::Record`].
    pub records: Resource,
    /// What arrives from where, for records of radiance.
    pub coefficients: Option<Coefficients>,
    /// Records in the cache.
    pub count: Variable,
    /// Most records.
    pub capacity: u32,
    /// The rule as a uniform buffer.
    pub weighting: Resource,
    /// How records weigh.
    pub rule: Rule,
    /// Whether records of earlier frames, and of earlier samples of this one, are there.
    pub lasts: bool,
    /// What is known of each besides, where records live on while the scene changes.
    pub lives: Option<Lives>,
}

/// How records live on while the scene changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lives {
    /// Buffer of [`crate::math::life::Life`], in the records' order; a history.
    pub items: Resource,
    /// How many records had a life as the frame before began to add more.
    pub known: Variable,
    /// None where none are sampled ahead.
    pub ahead: Option<Ahead>,
    /// Of records of radiance: a buffer as that of their coefficients, what these go over to; a history.
    pub expansions: Option<Resource>,
}

/// How records are sampled ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ahead {
    /// Buffer of records, in the order of those that go over to them; a history.
    pub goals: Resource,
    /// How many were sampled in the last frame ahead whose light was known to change, how many of them turn too fast for its window, and how many would for one
    /// twice as long.
    pub judged: [Variable; 3],
}

/// What can be asked for the irradiance of indirect light at any point and normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum IrradianceField {
    /// Records that are looked up by place.
    Records(RecordIndex),
    /// Photons that are gathered around a point.
    Photons(PhotonDensity),
    /// Light kept in the surfaces' own texture.
    Lightmap(LightmapField),
}

/// Records that can be asked for the irradiance at any point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordIndex {
    /// Buffer of words, laid out as [`crate::math::record_index::Layout`] of the capacity says.
    pub data: Resource,
    /// How records weigh.
    pub rule: Rule,
    /// Most records.
    pub capacity: u32,
    /// Host state: the index as host steps have asked it last.
    pub asked: Resource,
}

/// Photons where they arrived after a reflection or more, sorted by the cells that they are in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhotonMap {
    /// Buffer of a head, of the cells' first photons and of the photons, as [`crate::passes::photons`] has them.
    pub data: Resource,
    /// How many photons there would be room for in what is used of it.
    pub slots: Variable,
}

/// Photons that can be asked for the irradiance at any point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhotonDensity {
    /// The photons.
    pub map: PhotonMap,
    /// Photons of a point, where there are so many near.
    pub wanted: u32,
    /// How far away they may be [scene units].
    pub search_radius: f32,
    /// Whether their outline tells the area that they stand for; otherwise all of the disc does.
    pub edges: bool,
}

/// Light kept in the surfaces' own texture: of the texels that stand for something, neighbours in space after each other, one side after the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lightmap {
    /// Cells along an edge of the texture.
    pub edge: u32,
    /// How many texels there are: one in each cell that surfaces lie in, more in those that walls go through.
    pub texels: u32,
    /// 2 where surfaces are seen from both sides, the front first; otherwise 1.
    pub sides: u32,
    /// Buffer of [`crate::scene::atlas::Cell`], row by row.
    pub cells: Resource,
    /// Buffer of two u32, of each texel and side: [`crate::scene::atlas::Atlas::links`], and the number of its cell.
    pub links: Resource,
    /// Buffer of vec4, two a triangle, as [`LightmapField::data`] begins with: where its corners lie [cells].
    pub corners: Resource,
    /// Buffer of [`crate::passes::texels::TexelPlace`], without regard to sides: a point of each texel, then another of each, and so on.
    pub places: Resource,
    /// How many points of each there are.
    pub points: u32,
    /// Buffer of [`crate::passes::texels::TexelSurface`], without regard to sides: by the point whose turn it is; a history.
    pub surfaces: Resource,
    /// Buffer of vec4: direct light that is reflected [W m⁻² sr⁻¹], and the reflectance as the bits of the fourth.
    pub direct: Resource,
    /// Buffer of vec4: indirect irradiance that the last iteration brought [W/m²], and the luminance that its bound has taken; a history.
    pub fresh: Resource,
    /// Buffer of vec4: what is nearer than the bound of shots brings [W/m²], where rays gather it; a history.
    pub near: Resource,
    /// Buffer of vec4: mean indirect irradiance of the iterations [W/m²]; a history.
    pub mean: Resource,
    /// How many iterations there have been since the scene changed last; a history.
    pub iterations: Variable,
    /// As how many iterations the mean counts; a history.
    pub counted: Variable,
    /// How many iterations there have been in all; a history.
    pub rounds: Variable,
    /// Texels of all sides once there is a mean, for what is kept of it between runs; a history.
    pub known: Variable,
    /// How many iterations there are to be.
    pub wanted: u32,
    /// As how many the mean counts at most once the scene has changed.
    pub remembers: u32,
}

/// Texels that send their light out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shooters {
    /// Where they are.
    pub requests: Requests,
    /// Buffer of [`crate::passes::texels::Shot`]: what each sends out.
    pub shots: Resource,
    /// The square of the distance below which a texel that stands for an area of 1 brings no more.
    pub nearest: f32,
    /// By what they are chosen.
    pub favour: Favour,
    /// Whether they send out what the mean of iterations has, otherwise what the last one has.
    pub sends_mean: bool,
}

/// What texels are chosen by that shoot, times their area.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Favour {
    /// The luminance of what they reflect.
    Light,
    /// Its root.
    Root,
}

/// Which triangles texels see that send their light out, a tile each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShooterViews {
    /// Buffer of u32: the number of the triangle that each sample sees + 1; 0 where it sees none, or is none.
    pub seen: Resource,
    /// Hemispherical or Hemicube.
    pub shape: crate::math::hemisphere::Shape,
    /// Samples along an edge of the shape.
    pub resolution: u32,
    /// Of a tile [samples].
    pub size: [u32; 2],
    /// Tiles along a row.
    pub tiles_per_row: u32,
    /// From a row of samples to the next.
    pub pitch: u32,
}

impl ShooterViews {
    /// Where a sample of a tile stands.
    pub fn place(&self, tile: u32, [x, y]: [u32; 2]) -> usize {
        let [column, row] = [tile % self.tiles_per_row, tile / self.tiles_per_row];
        ((row * self.size[1] + y) * self.pitch + column * self.size[0] + x) as usize
    }
}

/// A lightmap that can be asked for the irradiance at any point of a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightmapField {
    /// Buffer of vec4: of each triangle two, whose first six numbers tell where its corners lie; then [`crate::scene::atlas::Cell`]s row by row, as floats; then of each texel and side
    /// indirect irradiance [W/m²], and its links as a float, or −1 less those where no light has come.
    pub data: Resource,
    /// Where the cells start [vec4].
    pub first: u32,
    /// Cells along an edge.
    pub edge: u32,
    /// As those of the lightmap.
    pub sides: u32,
}

/// Radiance that arrives at records, projected on hemispherical harmonics in `Frame::new` of their normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficients {
    /// Buffer of vec4: of each record [`crate::math::radiance::PLANES`] expansions of `quads(order)`.
    pub values: Resource,
    /// Of the expansions.
    pub order: u32,
    /// What their numbers are stored in.
    pub precision: Precision,
}

/// What a number is stored in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// Floats of 32 bits.
    Single,
    /// Up to 65504, eleven bits.
    Half,
}

impl Coefficients {
    /// Fours of numbers that a record takes.
    pub const fn fours(order: u32) -> u64 {
        (PLANES * quads(order as usize)) as u64
    }

    /// Bytes that a record takes.
    pub const fn bytes(order: u32, precision: Precision) -> u64 {
        match precision {
            Precision::Single => 16 * Self::fours(order),
            Precision::Half => 8 * Self::fours(order),
        }
    }
}

/// Lobes projected on harmonics.
#[derive(Debug, Clone, PartialEq)]
pub struct Lobes {
    /// Buffer of vec4: the tables, one after the other.
    pub values: Resource,
    /// Buffer of `TablePlace`: where each begins, and its order.
    pub places: Resource,
    /// Buffer of `MaterialTables`.
    pub of_material: Resource,
    /// The same on the host, where it was projected there.
    pub tables: Option<Arc<Vec<LobeTable>>>,
    /// Whether sharp lobes have no table.
    pub leaves_sharp: bool,
    /// What they are projected on.
    pub harmonics: Harmonics,
    /// Of each table.
    pub orders: Vec<u32>,
    /// Directions along an edge of the grid.
    pub edge: u32,
}

/// The lobe that each pixel sees.
#[derive(Debug, Clone, PartialEq)]
pub struct VisibleLobes {
    /// Their tables.
    pub lobes: Lobes,
    /// RGBA32F: reflectance along the normal; index of the table, and as its fraction the azimuth of the lobe's first axis in
    /// `Frame::new` of the normal [turns]; −1 where there is no lobe.
    pub seen: Resource,
}

impl Lobes {
    /// Says that a pass is to render glossy surfaces and does not know their lobes.
    pub fn missing() -> Refusal {
        Refusal::new("plan::lobes", "glossy surfaces are asked for without their lobes", "join the input `lobes` to a LobeCoefficients node")
    }

    /// The highest, which expansions of what arrives have.
    pub fn order(&self) -> u32 {
        self.orders.iter().copied().max().unwrap_or(1)
    }

    /// The tables, for passes that look lobes up on the host.
    pub fn on_host(&self) -> Result<&Arc<Vec<LobeTable>>, Refusal> {
        self.tables.as_ref().ok_or_else(|| {
            Refusal::new(
                "plan::lobes_on_device",
                "the host is to look up lobes that the device projects",
                "set `place` of the LobeCoefficients node to Auto or Host",
            )
        })
    }

    /// Refuses lobes that the expansions of records cannot be multiplied with.
    pub fn expect_hemispherical(&self) -> Result<(), Refusal> {
        if self.harmonics == Harmonics::Hemispherical {
            return Ok(());
        }
        Err(Refusal::new(
            "plan::harmonics",
            "records hold hemispherical harmonics, the lobes spherical ones",
            "set `harmonics` of the LobeCoefficients node to Hemispherical",
        ))
    }

    fn over(&mut self, memory: &mut dyn Memory) {
        replace(&mut self.values, memory);
        replace(&mut self.places, memory);
        replace(&mut self.of_material, memory);
    }
}

impl VisibleLobes {
    fn resources(&self) -> [Resource; 2] {
        [self.seen, self.lobes.values]
    }

    fn over(&mut self, memory: &mut dyn Memory) {
        replace(&mut self.seen, memory);
        self.lobes.over(memory);
    }
}

impl IrradianceField {
    fn resources(&self) -> Vec<Resource> {
        match self {
            Self::Records(index) => vec![index.data],
            Self::Photons(density) => density.map.resources(),
            Self::Lightmap(light) => vec![light.data],
        }
    }

    fn over(&mut self, memory: &mut dyn Memory) {
        match self {
            Self::Records(index) => replace(&mut index.data, memory),
            Self::Photons(density) => density.map.over(memory),
            Self::Lightmap(light) => replace(&mut light.data, memory),
        }
    }
}

impl PhotonMap {
    fn resources(&self) -> Vec<Resource> {
        vec![self.data]
    }

    fn over(&mut self, memory: &mut dyn Memory) {
        replace(&mut self.data, memory);
        self.slots = memory.variable(self.slots);
    }
}

impl LightmapField {
    /// Where the light of texels starts in its data [vec4].
    pub fn lights(&self) -> usize {
        (self.first + self.edge * self.edge) as usize
    }
}

impl Lightmap {
    fn resources(&self) -> [Resource; 8] {
        [self.cells, self.links, self.corners, self.surfaces, self.direct, self.fresh, self.near, self.mean]
    }

    fn over(&mut self, memory: &mut dyn Memory) {
        let resources =
            [&mut self.cells, &mut self.links, &mut self.corners, &mut self.surfaces, &mut self.direct, &mut self.fresh, &mut self.near, &mut self.mean];
        resources.into_iter().for_each(|r| replace(r, memory));
        self.iterations = memory.variable(self.iterations);
    }

    /// Texels of all sides.
    pub fn places(&self) -> u32 {
        self.texels * self.sides
    }
}

impl Records {
    /// Their coefficients, where those that a cache keeps are of the same order; None where it keeps none.
    ///
    /// # Errors
    /// A cache that keeps coefficients which they do not have.
    pub fn coefficients_for(&self, kept: Option<Coefficients>) -> Result<Option<Coefficients>, Refusal> {
        let Some(kept) = kept else { return Ok(None) };
        let own = self.coefficients.filter(|own| own.order == kept.order);
        own.map(Some).ok_or_else(|| {
            Refusal::new(
                "plan::coefficients",
                "the cache keeps coefficients of radiance that the new records do not have",
                "project the tiles with a RadianceProjection of the same lobes before the records join this cache",
            )
        })
    }
}

impl Requests {
    fn over(&mut self, memory: &mut dyn Memory) {
        replace(&mut self.places, memory);
        self.count = memory.variable(self.count);
        self.made = memory.variable(self.made);
        self.slots.iter_mut().for_each(|r| replace(r, memory));
    }
}

impl Tiles {
    fn resources(&self) -> Vec<Resource> {
        [self.samples, self.requests.places].into_iter().chain(self.sureness).collect()
    }

    fn over(&mut self, memory: &mut dyn Memory) {
        replace(&mut self.samples, memory);
        self.sureness.iter_mut().for_each(|r| replace(r, memory));
        self.requests.over(memory);
    }
}

impl RecordCache {
    fn over(&mut self, memory: &mut dyn Memory) {
        let coefficients = self.coefficients.iter_mut().map(|c| &mut c.values);
        [&mut self.records, &mut self.weighting].into_iter().chain(coefficients).for_each(|r| replace(r, memory));
        self.count = memory.variable(self.count);
        if let Some(lives) = &mut self.lives {
            replace(&mut lives.items, memory);
            lives.expansions.iter_mut().for_each(|goals| replace(goals, memory));
            if let Some(ahead) = &mut lives.ahead {
                replace(&mut ahead.goals, memory);
                ahead.judged = ahead.judged.map(|variable| memory.variable(variable));
            }
            lives.known = memory.variable(lives.known);
        }
    }
}
