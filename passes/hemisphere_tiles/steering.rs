//! How many rays each tile has on the host, and where they go: by photons, and by how sure tiles beside it are.

use super::Work;
use super::cells::Cells;
use super::growth::{Growth, Told};
use super::guide::{Guide, MoreRays};
use crate::contract::Encoder;
use crate::math::{colour::REC_709, uncertainty::Uncertainty};
use crate::passes::record::Request;
use crate::scene::packets::RayBundle;
use crate::schedule::*;
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::collections::HashSet;

/// What is asked for the rays of a node's tiles.
pub(super) struct Steering {
    guide: Option<Guide>,
    growth: Option<Growth>,
    /// [`Known`].
    memory: Resource,
    /// How many tiles were finer.
    finer: Variable,
    /// Of each tile, see [`crate::contract::port::Tiles`]; where photons guide rays or tiles may be finer.
    pub sureness: Option<Resource>,
}

/// Edge of a cell to which light comes from about the same places, as a share of how far away photons may be.
const CELL: f32 = 0.5;

/// What the tiles of a loop have found so far.
pub(super) struct Known {
    /// Where light starts, and how much of it; nothing where no stratum stands out.
    origins: Cells<Vec<(Vec3, f32)>>,
    told: Told,
}

/// The rays of a tile.
pub(super) struct TileRays {
    /// How many times as fine it is along an edge.
    times: u32,
    /// Of each stratum how many rays besides one it is worth, or none of them.
    worth: Vec<u32>,
    /// Those that it has not anyway.
    pub more: MoreRays,
}

/// What a tile saw.
pub(super) struct Tile {
    /// Radiance and distance of each stratum.
    pub seen: Vec<Vec4>,
    uncertainty: Uncertainty,
    /// See [`crate::contract::port::Tiles`].
    pub sureness: f32,
}

impl Steering {
    /// With a step before the loop that forgets what was found.
    pub fn new(e: &mut Encoder<'_>, work: &Work, guide: Option<Guide>, growth: Option<Growth>) -> Self {
        let memory = e.state("steering");
        let forget = move |host: &mut dyn HostContext| {
            *host.state(memory) = None;
            Ok(())
        };
        e.before_loop(Command::Host(Host::new("forget", Vec::new(), Vec::new(), forget)));
        let finer = e.variable("finer", false);
        if growth.is_some() {
            e.report_variable("finer_tiles", finer);
        }
        let sureness = (guide.is_some() || growth.is_some()).then(|| e.buffer("sureness", 4 * u64::from(work.requests.capacity)));
        Self { guide, growth, memory, finer, sureness }
    }

    pub fn reads(&self) -> Option<Read> {
        self.guide.as_ref().map(Guide::reads)
    }

    /// Takes what was found so far, with what photons say of places, in a host step that reads these.
    pub fn known(&self, host: &mut dyn HostContext, places: &[Request]) -> Known {
        let extent = host.extent();
        let kept = host.state(self.memory).take().and_then(|kept| kept.downcast::<Known>().ok());
        let cell = self.guide.as_ref().map_or(1.0, |guide| CELL * guide.search_radius * extent);
        let mut known = kept.map_or_else(|| Known { origins: Cells::new(cell), told: Told::nothing(extent) }, |kept| *kept);
        if let Some(guide) = &self.guide {
            known.ask(guide, host, places);
        }
        known
    }

    /// Keeps what was found for what comes, and how sure tiles are for who sums them.
    pub fn keep(&self, host: &mut dyn HostContext, known: Known, sureness: &[f32]) {
        if let Some(buffer) = self.sureness {
            host.write(buffer, 0, bytemuck::cast_slice(sureness));
        }
        host.set(self.finer, known.told.finer);
        *host.state(self.memory) = Some(Box::new(known));
    }

    /// In which order places are looked at, by their numbers: those whose tiles tell others of theirs first.
    pub fn waves(&self, known: &Known, places: &[Request]) -> Vec<Vec<usize>> {
        if self.growth.is_none() { vec![(0..places.len()).collect()] } else { known.told.waves(places) }
    }

    /// Of the tile of each place.
    pub fn rays(&self, known: &Known, places: &[Request]) -> Vec<TileRays> {
        let of = |place: &Request| {
            let times = self.growth.as_ref().map_or(1, |growth| growth.times(&known.told, place));
            let counts = |guide: &Guide| Some(guide.counts(place, known.origins.at(place)?, guide.share));
            let worth = self.guide.as_ref().and_then(counts).unwrap_or_default();
            TileRays { times, more: MoreRays::new(&worth, times * times), worth }
        };
        places.par_iter().map(of).collect()
    }

    /// The rays of a tile besides more of some strata; those of one that is as fine as others are `plain`.
    pub fn bundle<'a>(&'a self, rays: &TileRays, plain: &'a RayBundle) -> &'a RayBundle {
        self.growth.as_ref().map_or(plain, |growth| growth.bundle(rays.times, plain))
    }

    /// What those have seen.
    pub fn tile(&self, rays: &TileRays, seen: Vec<Vec4>) -> Tile {
        let Some(growth) = &self.growth else { return Tile { seen, uncertainty: Uncertainty::UNKNOWN, sureness: 1.0 } };
        let uncertainty = growth.uncertainty(rays.times, &seen, &rays.worth);
        Tile { seen: growth.joined(rays.times, seen), uncertainty, sureness: 1.0 }
    }

    /// Lets tiles tell others.
    pub fn learn(&self, known: &mut Known, places: &[Request], rays: &[TileRays], tiles: &[Tile]) {
        if self.growth.is_some() {
            for ((place, rays), tile) in places.iter().zip(rays).zip(tiles) {
                known.told.learn(place, rays.times, tile.uncertainty);
            }
        }
    }
}

impl TileRays {
    /// Adds what the rays have seen that a tile has more of some strata.
    pub fn join(&self, seen: &[Vec4], tile: &mut Tile) {
        self.more.join(seen, &mut tile.seen);
        let light: Vec<f32> = tile.seen.iter().map(|seen| seen.truncate().dot(REC_709.as_vec3())).collect();
        tile.sureness = tile.uncertainty.over_plain(light.len().isqrt(), &light);
    }
}

impl Known {
    /// Asks photons about cells of which nothing is known, at the first of the places in each.
    fn ask(&mut self, guide: &Guide, host: &dyn HostContext, places: &[Request]) {
        let mut seen = HashSet::new();
        let new: Vec<&Request> = places.iter().filter(|place| self.origins.is_first(place, &mut seen)).collect();
        let lookup = guide.lookup(host);
        let found: Vec<Vec<(Vec3, f32)>> = new.par_iter().map(|place| guide.origins(&lookup, place)).collect();
        for (place, origins) in new.into_iter().zip(found) {
            self.origins.entry(place).or_insert(origins);
        }
    }
}
