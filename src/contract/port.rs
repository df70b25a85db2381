//! What flows along the edges of a pipeline.

use crate::math::hemisphere::Table;
use crate::recording::{Resource, Variable};
use std::sync::Arc;

/// The kind of a port: an edge joins an output to an input of the same kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PortKind {
    GBuffer,
    ShadowMaps,
    Image,
    Splats,
    Requests,
    Tiles,
    WeightedTiles,
    Records,
    RecordCache,
    Flag,
}

impl PortKind {
    /// With its article, for messages: "an atlas of tiles".
    pub fn phrase(self) -> &'static str {
        match self {
            Self::GBuffer => "a G-buffer",
            Self::ShadowMaps => "shadow maps",
            Self::Image => "an image",
            Self::Splats => "a splat buffer",
            Self::Requests => "requests for records",
            Self::Tiles => "an atlas of tiles",
            Self::WeightedTiles => "an atlas of tiles with weights",
            Self::Records => "new records",
            Self::RecordCache => "a record cache",
            Self::Flag => "a flag",
        }
    }
}

/// What a node hands on.
#[derive(Debug, Clone)]
pub enum Port {
    GBuffer(GBuffer),
    ShadowMaps(ShadowMaps),
    Image(Image),
    Splats(Splats),
    Requests(Requests),
    Tiles(Tiles),
    WeightedTiles(WeightedTiles),
    Records(Records),
    RecordCache(RecordCache),
    Flag(Variable),
}

/// The visible surfaces, one texel a pixel.
#[derive(Debug, Clone, Copy)]
pub struct GBuffer {
    /// RGBA32F: position [scene units]; the width of a pixel there [scene units], 0 where nothing is seen.
    pub position: Resource,
    /// RGBA32F: unit shading normal, facing the viewer; depth along the camera's axis [scene units].
    pub normal: Resource,
    /// RGBA32F: diffuse reflectance; 1 where a surface is seen.
    pub reflectance: Resource,
    /// RGBA32F: emitted radiance or sky; material index.
    pub emission: Resource,
}

/// Depth from the lights that cast shadows.
#[derive(Debug, Clone, Copy)]
pub struct ShadowMaps {
    /// R32F-depth array: six layers a point light, one a spot or directional light, reverse Z.
    pub depth: Resource,
    /// Buffer of one view (matrix, light index) a layer.
    pub views: Resource,
    /// Edge of a map [texels].
    pub resolution: u32,
    /// Percentage-closer taps a lookup.
    pub taps: u32,
}

/// RGBA32F, one texel a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Image {
    pub texture: Resource,
    pub channels: Channels,
}

/// How an image's channels are named in a layered EXR.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channels {
    /// R, G, B.
    Colour,
    /// The first channel alone.
    Single,
    /// X, Y, Z.
    Vector,
}

/// Weighted sums over the records that count at each pixel.
#[derive(Debug, Clone, Copy)]
pub struct Splats {
    /// RGBA32F: Σ w E_k(p) per channel, Σ w.
    pub sums: Resource,
    /// Number of records that count, as f32 in the first channel; absent unless asked for.
    pub counts: Option<Resource>,
    pub weighting: Weighting,
    pub cache: RecordCache,
}

/// Which records count at a point and how much.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weighting {
    /// Ward 1988, RCS 2 and 3.
    Ward,
    /// Tabellion and Lamorlette 2004: falls to 0 at the rim.
    TabellionLamorlette,
}

/// Places that need a record: at most `capacity` a round.
#[derive(Debug, Clone, Copy)]
pub struct Requests {
    /// Buffer of requests: position, footprint, normal, turn of the frame.
    pub places: Resource,
    /// How many there are this round.
    pub count: Variable,
    pub capacity: u32,
}

/// One hemisphere a request.
#[derive(Debug, Clone)]
pub struct Tiles {
    /// Buffer of vec4, `tile · samples + sample`: radiance seen, distance (a huge number for sky).
    pub samples: Resource,
    pub requests: Requests,
    pub shape: crate::math::hemisphere::Shape,
    /// Samples along a tile's edge, N.
    pub resolution: u32,
    /// The shape without compensation: directions and raw weights.
    pub table: Arc<Table>,
}

/// Tiles with what each sample stands for.
#[derive(Debug, Clone)]
pub struct WeightedTiles {
    pub tiles: Tiles,
    /// The weights after compensation.
    pub table: Arc<Table>,
    /// The table's samples as a buffer.
    pub weights: Resource,
    /// The table's edges as a buffer.
    pub edges: Resource,
}

/// New records, in the requests' order.
#[derive(Debug, Clone, Copy)]
pub struct Records {
    pub records: Resource,
    pub count: Variable,
    pub capacity: u32,
}

/// All records so far; a history.
#[derive(Debug, Clone, Copy)]
pub struct RecordCache {
    pub records: Resource,
    /// Records in the cache.
    pub count: Variable,
    pub capacity: u32,
    /// The accuracy parameter a: a record reaches a·R.
    pub accuracy: f32,
}
