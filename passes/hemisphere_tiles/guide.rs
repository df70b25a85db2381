//! More rays for those strata of a tile that photons say most light comes from: what one ray a stratum would make blots of.
//!
//! No stratum has less than its own ray, and what its rays see is averaged, so that nothing is biased: photons only say where rays are worth while.

use super::{Seen, Work, each_sample};
use crate::contract::{Encoder, encoder::scene_constants, port};
use crate::math::{
    colour::luminance,
    frame::Frame,
    hemisphere::{ray, square},
};
use crate::passes::photons::{PHOTON_BYTES, lookup::Lookup, unpacked_ways};
use crate::passes::record::Request;
use crate::scene::packets::RayBundle;
use crate::schedule::*;
use glam::{Vec2, Vec3, Vec4};

/// What tells where light comes from.
#[derive(Clone, Copy)]
pub(super) struct Guide {
    map: port::PhotonMap,
    /// Photons that are looked at for each place, and how far away they may be, as a share of the scene's extent.
    photons: u32,
    pub search_radius: f32,
    /// A stratum with this share of a tile's light has two rays; with twice the share five.
    pub share: f32,
    resolution: u32,
    /// Of the scene [scene units].
    extent: f32,
}

/// Fewer rays than these are not worth their cost: here and there a ray takes as long as some neighbours together.
const FEWEST: f32 = 2.0;

/// Light is soft, all over a cell, where no stratum of one place has this part of the share that would be worth a ray.
const SOFT: f32 = 0.7;

/// Most rays of a stratum besides its own, and those of a tile in rays that it has anyway.
const MOST: f32 = 63.0;
const MOST_OF_ALL: f32 = 1.0;

/// How a photon's light is spread over the strata next to the one that it came from, along either side: a few photons stand for light from all around them.
const SPREAD: [f32; 3] = [0.25, 0.5, 0.25];

impl Guide {
    pub fn of(e: &Encoder<'_>, work: &Work) -> Option<Self> {
        let map = *e.photon_map("guide")?;
        let search_radius = e.arguments.float("search_radius") as f32;
        let (photons, share) = (e.arguments.integer("photons") as u32, e.arguments.float("share") as f32);
        Some(Self { map, photons, search_radius, share, resolution: work.table.width, extent: e.setting.needs.extent })
    }

    /// Encodes steps that list the rays that strata are worth, cast them, see what they meet as `see` does of such a list and of what they met, and join that
    /// to tiles.
    pub fn encode(&self, e: &mut Encoder<'_>, work: &Work, radiance: Resource, see: impl FnOnce(&mut Encoder<'_>, Seen) -> Resource) {
        let places = u64::from(work.requests.capacity);
        let strata = u64::from(work.samples_per_tile());
        let [more, light] = [("more_rays", 4 * places * (strata + 1)), ("light", 4 * places * strata)].map(|(name, bytes)| e.buffer(name, bytes));
        let triangles = e.buffer("also_met", 4 * places * strata);
        let list = work
            .layout(scene_constants(Program::new("hemisphere_tiles/guide"), e.setting.needs))
            .constant("WANTED", self.photons)
            .constant("SEARCH_RADIUS", self.search_radius)
            .constant("SHARE", self.share)
            .bind("requests", work.requests.places)
            .bind("more_rays", more)
            .bind("light", light)
            .bind("photon_map", self.map.data);
        e.compute(list, "list_rays", Groups::Counted { count: work.requests.count, divisor: 64, per: 1 });
        let trace = work
            .layout(scene_constants(Program::new("hemisphere_tiles/trace_more"), e.setting.needs))
            .bind("requests", work.requests.places)
            .bind("more_rays", more)
            .bind("seen", triangles);
        e.compute(trace, "trace_more", each_sample(work));
        let seen = see(e, Seen::More { rays: more, triangles });
        let join = work.layout(Program::new("hemisphere_tiles/join_more")).bind("more_rays", more).bind("also_seen", seen).bind("radiance", radiance);
        e.compute(join, "join_more", each_sample(work));
    }

    /// What a host step reads of it.
    pub fn reads(&self) -> Read {
        Read::counted(self.map.data, PHOTON_BYTES, self.map.slots)
    }

    /// The photons, in a host step that reads them.
    pub fn lookup<'a>(&self, host: &'a dyn HostContext) -> Lookup<'a> {
        Lookup::of(&self.map, host)
    }

    /// Where photons that arrive near a place have come from; nothing where no stratum stands out.
    pub fn origins(&self, lookup: &Lookup<'_>, place: &Request) -> Vec<(Vec3, f32)> {
        let (position, normal) = (Vec3::from(place.position), Vec3::from(place.normal));
        let mut origins = Vec::with_capacity(2 * self.photons as usize);
        let zone = lookup.zone(position, normal, self.photons, self.search_radius * self.extent);
        lookup.for_each(position, normal, zone, |photon, _| {
            let origin = Vec3::from(photon.position) + unpacked_ways(photon.ways)[1] * photon.leg;
            origins.push((origin, luminance(Vec3::from(photon.flux).as_dvec3()) as f32));
        });
        let is_soft = self.counts(place, &origins, SOFT * self.share).iter().all(|count| *count == 0);
        if is_soft { Vec::new() } else { origins }
    }

    /// How many more rays each stratum of a tile is worth, if one with such a share of the light is worth one.
    pub fn counts(&self, place: &Request, origins: &[(Vec3, f32)], share: f32) -> Vec<u32> {
        if origins.is_empty() {
            return Vec::new();
        }
        let strata = self.light(place, origins);
        let all: f32 = strata.iter().sum();
        if all <= 0.0 {
            return Vec::new();
        }
        let wished = |light: &f32| Some((light / (all * share)).powi(2)).filter(|rays| *rays >= FEWEST).map_or(0.0, |rays| rays.min(MOST));
        let together: f32 = strata.iter().map(wished).sum();
        let scale = (MOST_OF_ALL * strata.len() as f32 / together).min(1.0);
        strata.iter().map(|light| (scale * wished(light) + 0.5) as u32).collect()
    }

    /// How much light comes from each stratum, in any unit.
    fn light(&self, place: &Request, origins: &[(Vec3, f32)]) -> Vec<f32> {
        let frame = Frame::new(place.normal.into()).turned(place.turn);
        let edge = self.resolution as i32;
        let mut strata = vec![0.0; (edge * edge) as usize];
        for (origin, flux) in origins {
            let way = frame.to_local((origin - Vec3::from(place.position)).normalize_or_zero());
            if way.z <= 0.0 {
                continue;
            }
            let [column, row] = square(self.resolution, Vec2::new(way.x, way.y)).map(|at| at as i32);
            for (y, down) in (row - 1..).zip(SPREAD).filter(|(y, _)| (0..edge).contains(y)) {
                for (x, across) in (column - 1..).zip(SPREAD).filter(|(x, _)| (0..edge).contains(x)) {
                    strata[(y * edge + x) as usize] += flux * down * across;
                }
            }
        }
        strata
    }
}

/// Rays of a tile besides one a stratum.
pub(super) struct MoreRays {
    pub bundle: RayBundle,
    /// Of each ray, in order.
    strata: Vec<u32>,
    /// Rays of each stratum besides these.
    own: u32,
}

impl MoreRays {
    /// As many rays as `counts` tells, besides one a stratum; fewer where it has `own` ones.
    pub fn new(counts: &[u32], own: u32) -> Self {
        let resolution = counts.len().isqrt() as u32;
        let each = (0..).zip(counts).flat_map(|(stratum, count)| (own..=*count).map(move |number| (stratum, number)));
        let (strata, directions): (Vec<u32>, Vec<Vec3>) =
            each.take(counts.len()).map(|(stratum, number)| (stratum, ray(resolution, [stratum % resolution, stratum / resolution], number).as_vec3())).unzip();
        Self { bundle: RayBundle::of(&directions), strata, own }
    }

    /// Of all rays of a stratum the mean radiance, and the harmonic mean of how far they went.
    pub fn join(&self, seen: &[Vec4], tile: &mut [Vec4]) {
        let inverse = |sight: &Vec4| sight.truncate().extend(sight.w.recip());
        let mut seen = seen.iter();
        for strata in self.strata.chunk_by(|a, b| a == b) {
            let sample = &mut tile[strata[0] as usize];
            let own = self.own as f32;
            let sum = seen.by_ref().take(strata.len()).map(inverse).sum::<Vec4>() + own * inverse(sample);
            let mean = sum / (strata.len() as f32 + own);
            *sample = mean.truncate().extend(mean.w.recip());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strata_have_the_mean_of_all_their_rays() {
        // Of 3×3 strata one is worth two more rays, one seven; the list holds nine at most.
        let mut counts = [0; 9];
        (counts[2], counts[7]) = (2, 7);
        for (own, strata) in [(1, vec![2, 2, 7, 7, 7, 7, 7, 7, 7]), (4, vec![7; 4])] {
            let more = MoreRays::new(&counts, own);
            assert_eq!(more.strata, strata);
            assert_eq!(more.bundle.samples, strata.len());
            let mut tile = [Vec4::new(1.0, 2.0, 3.0, 1.0); 9];
            more.join(&vec![Vec4::new(9.0, 2.0, 3.0, 2.0); strata.len()], &mut tile);
            for (stratum, seen) in tile.iter().enumerate() {
                let rays = strata.iter().filter(|other| **other as usize == stratum).count() as f32;
                let share = rays / (rays + own as f32);
                let expected = Vec4::new(1.0 + 8.0 * share, 2.0, 3.0, 1.0 / (1.0 - 0.5 * share));
                assert!((*seen - expected).abs().max_element() < 1e-5, "{stratum} with {own}: {seen}, not {expected}");
            }
        }
        assert_eq!(MoreRays::new(&[], 4).bundle.samples, 0);
    }
}
