//! What the mipmap chain and the ping-pong share: images of seven parts a sample, and averages of 2×2 texels.

use super::Work;
use crate::contract::{Arguments, Choice, Encoder, Parameter, ParameterKind};
use crate::math::hemisphere::Table;
use crate::passes::record::{edge_bytes, sample_bytes};
use crate::schedule::*;

/// Vectors that a tile adds up to: layers of the images.
pub(super) const PARTS: u32 = 7;

pub(super) const STORAGE: Parameter = Parameter {
    name: "storage",
    about: "numbers of the images between the steps",
    unit: "",
    kind: ParameterKind::Choice {
        choices: &[
            Choice { name: "F32", about: "single precision, seven times the tiles' memory and a third more", parameters: &[] },
            Choice {
                name: "F16",
                about: "half precision, half of it; each tile exposed by its brightest sample, gradients of what is very near cut",
                parameters: &[],
            },
        ],
    },
};

/// Entry points and format of a way of storing.
pub(super) struct Storage {
    contribute: &'static str,
    average: &'static str,
    coarse: &'static str,
    pub(super) finish: &'static str,
    pub(super) format: Format,
    /// Of half floats: what each tile's light is multiplied by, a float a tile.
    pub(super) exposures: Option<Resource>,
}

impl Storage {
    pub(super) fn of(e: &mut Encoder<'_>, work: &Work<'_>, arguments: &Arguments) -> Self {
        if arguments.choice("storage").0 == "F16" {
            e.remark("half floats hold three digits beside the brightest sample of a tile: the sums are as accurate as that");
            let exposures = Some(e.buffer("exposures", u64::from(work.weighted.tiles.requests.capacity) * 4));
            let [contribute, average, coarse, finish] = ["contribute_f16", "average_f16", "coarse_f16", "finish_f16"];
            return Self { contribute, average, coarse, finish, format: Format::Rgba16Float, exposures };
        }
        let [contribute, average, coarse, finish] = ["contribute_f32", "average_f32", "coarse_f32", "finish_f32"];
        Self { contribute, average, coarse, finish, format: Format::Rgba32Float, exposures: None }
    }
}

impl Work<'_> {
    /// Width and height of a tile at a level.
    pub(super) fn level_size(&self, level: u32) -> [u32; 2] {
        let table = &self.weighted.table;
        [table.width >> level, table.height >> level]
    }

    /// An image that holds the tiles at a level.
    pub(super) fn level_image(&self, e: &mut Encoder<'_>, name: &str, level: u32, format: Format) -> Resource {
        let tiles = &self.weighted.tiles;
        let rows = tiles.requests.capacity.div_ceil(tiles.tiles_per_row);
        let [width, height] = self.level_size(level);
        e.texture(name, [tiles.tiles_per_row * width, rows * height], PARTS, format)
    }

    /// Bytes of the tiles of a full batch at a level.
    pub(super) fn level_bytes(&self, level: u32, format: Format) -> u64 {
        let [width, height] = self.level_size(level).map(u64::from);
        u64::from(self.weighted.tiles.requests.capacity) * width * height * u64::from(PARTS) * format.bytes()
    }

    /// One workgroup of 64 lanes for every 64 texels of a level, for each tile.
    pub(super) fn groups(&self, level: u32) -> Groups {
        let [width, height] = self.level_size(level);
        Groups::Counted { count: self.weighted.tiles.requests.count, divisor: 1, per: (width * height).div_ceil(64) }
    }

    /// A program that works on a level.
    pub(super) fn at_level(&self, shader: &'static str, level: u32) -> Program {
        let [width, height] = self.level_size(level);
        self.layout(Program::new(shader)).constant("LEVEL_WIDTH", width).constant("LEVEL_HEIGHT", height)
    }

    /// What each tile's light is multiplied by, where it is.
    fn expose(&self, e: &mut Encoder<'_>, exposures: Resource, weights: Resource) {
        let tiles = &self.weighted.tiles;
        let program = self.at_level("irradiance_sum/reduce", 0).bind("weights", weights).bind("radiance", tiles.samples).bind("exposures", exposures);
        e.compute(program, "expose", Groups::Counted { count: tiles.requests.count, divisor: 1, per: 1 });
    }

    /// Every sample's parts.
    pub(super) fn contribute(&self, e: &mut Encoder<'_>, storage: &Storage, into: Resource) {
        let table = &self.weighted.table;
        let starts: Vec<u32> = (0..=table.samples.len()).map(|i| table.edges.partition_point(|e| e.a < i as u32) as u32).collect();
        let [weights, edges] = [("weights", sample_bytes(table)), ("edges", edge_bytes(&table.edges))].map(|(name, bytes)| e.constant_buffer(name, &bytes));
        let starts = e.constant_buffer("edge_starts", bytemuck::cast_slice(&starts));
        let block_weights = e.constant_buffer("block_weights", bytemuck::cast_slice(&block_weights(table)));
        let tiles = &self.weighted.tiles;
        storage.exposures.into_iter().for_each(|exposures| self.expose(e, exposures, weights));
        let mut program = self
            .at_level("irradiance_sum/reduce", 0)
            .bind("requests", tiles.requests.places)
            .bind("weights", weights)
            .bind("edges", edges)
            .bind("edge_starts", starts)
            .bind("block_weights", block_weights)
            .bind("radiance", tiles.samples)
            .bind_part(storage.coarse, into, self.level_bytes(0, storage.format));
        if let Some(exposures) = storage.exposures {
            program = program.bind("exposures", exposures);
        }
        e.compute(program, storage.contribute, self.groups(0));
    }

    /// Averages of 2×2 texels, the maximum where a maximum is wanted.
    pub(super) fn average(&self, e: &mut Encoder<'_>, storage: &Storage, level: u32, from: Resource, into: Resource) {
        let program = self.at_level("irradiance_sum/reduce", level).bind_part("fine", from, self.level_bytes(level - 1, storage.format)).bind_part(
            storage.coarse,
            into,
            self.level_bytes(level, storage.format),
        );
        e.compute(program, storage.average, self.groups(level));
    }

    /// How often a tile can be halved until it is no larger than `enough` along each side.
    pub(super) fn levels(&self, enough: u32) -> u32 {
        let can = |level: u32| {
            let [width, height] = self.level_size(level);
            width.max(height) > enough && width % 2 == 0 && height % 2 == 0
        };
        (0..).find(|level| !can(*level)).unwrap_or(0)
    }
}

/// Of the block of four whose last sample each is, the weight; 0 where there is none.
fn block_weights(table: &Table) -> Vec<f32> {
    let mut weights = vec![0.0; table.samples.len()];
    table.blocks.iter().for_each(|last| weights[*last as usize] = table.samples[*last as usize].cosine_weight as f32);
    weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contract::{Place, port};
    use crate::math::hemisphere::{Method, Shape};
    use crate::passes::record::Radius;
    use std::sync::Arc;

    /// Five tiles.
    fn tiles(shape: Shape, resolution: u32) -> port::WeightedTiles {
        let table = Arc::new(Table::new(shape, resolution, Method::None).unwrap());
        let requests = port::Requests { places: Resource(0), count: Variable(0), capacity: 5, made: Variable(1), at_most: 100, slots: None };
        let tiles = port::Tiles {
            samples: Resource(1),
            sureness: None,
            place: Place::Device,
            is_steady: false,
            sees_emission: true,
            requests,
            shape,
            resolution,
            table: table.clone(),
            tiles_per_row: 2,
        };
        port::WeightedTiles { tiles, table }
    }

    fn work(weighted: &port::WeightedTiles) -> Work<'_> {
        Work { weighted, records: Resource(2), gradients: true, radius: Radius::HarmonicMean }
    }

    #[test]
    fn tiles_are_halved_while_both_sides_are_even_and_one_is_too_large() {
        let halved = |resolution: u32| [1, 16].map(|enough| work(&tiles(Shape::Cosine, resolution)).levels(enough));
        assert_eq!([64, 48, 32, 16, 15].map(halved), [[6, 2], [4, 2], [5, 1], [4, 0], [0, 0]]);
        let cube = tiles(Shape::Hemicube, 16);
        assert_ne!(cube.table.width, cube.table.height);
        assert_eq!(work(&cube).levels(cube.table.width.max(cube.table.height) - 1), 1);
        assert_eq!(work(&cube).levels(cube.table.width.max(cube.table.height)), 0);
    }

    #[test]
    fn levels_have_a_quarter_of_the_texels_each() {
        let weighted = tiles(Shape::Cosine, 48);
        let work = work(&weighted);
        assert_eq!([0, 1, 4].map(|level| work.level_size(level)), [[48, 48], [24, 24], [3, 3]]);
        assert_eq!(work.level_bytes(1, Format::Rgba32Float), 5 * 24 * 24 * 7 * 16);
        assert_eq!(work.level_bytes(1, Format::Rgba16Float), 5 * 24 * 24 * 7 * 8);
        let groups = |level| work.groups(level);
        assert_eq!([0, 4].map(groups), [36, 1].map(|per| Groups::Counted { count: Variable(0), divisor: 1, per }));
    }
}
