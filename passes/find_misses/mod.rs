//! Where records are missing.

use super::record::{REQUEST_BYTES, Request};
use crate::contract::{Choice, Description, Encoder, Input, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes, port};
use crate::math::random::{hash, unit};
use crate::schedule::*;
use glam::{Vec3, Vec4, Vec4Swizzles};
use grid::Grid;
use std::f32::consts::TAU;

mod device_grid;
pub mod grid;
mod host_grid;
mod host_scan;

pub struct FindMisses;

const CELLS: &[Parameter] = &[
    Parameter {
        name: "coarsest",
        about: "edge of the first cells, a power of two",
        unit: "pixels",
        kind: ParameterKind::Integer { default: 32, min: 1, max: 64 },
    },
    Parameter {
        name: "finest",
        about: "edge of the last cells, a power of two; where it is more than a pixel, cells are looked at once and misses are left to a later loop",
        unit: "pixels",
        kind: ParameterKind::Integer { default: 1, min: 1, max: 64 },
    },
];

static DESCRIPTION: Description = Description {
    name: "FindMisses",
    about: "Finds pixels where no record counts and asks for records there",
    source: "RCS section 4, steps 3 and 4; order by a hierarchy of cells: our own",
    parameters: &[
        Parameter {
            name: "by",
            about: "how misses are found",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Grid", about: "from coarse cells of pixels to fine ones", parameters: CELLS },
                    Choice {
                        name: "Scan",
                        about: "the papers' walk over the splat sums, by the host, pixel by pixel in scan order (RCS)",
                        parameters: &[Parameter {
                            name: "spacing",
                            about: "distance between the records of a batch at first, halved down to 2; a sequential fill needs none",
                            unit: "pixels",
                            kind: ParameterKind::Integer { default: 32, min: 2, max: 256 },
                        }],
                    },
                ],
            },
        },
        Parameter {
            name: "at_most",
            about: "most new records a frame, for interactive use, with those of `after`; 0 for no limit but its",
            unit: "records",
            kind: ParameterKind::Integer { default: 0, min: 0, max: 1_000_000 },
        },
        PLACE,
    ],
    inputs: &[
        Input { name: "gbuffer", about: "the visible surfaces", accepts: PortKind::GBuffer, takes: Takes::One, changes: false },
        Input { name: "splats", about: "what the records so far cover", accepts: PortKind::Splats, takes: Takes::One, changes: false },
        Input {
            name: "after",
            about: "requests of a loop before this one, which count toward the same limit",
            accepts: PortKind::Requests,
            takes: Takes::AtMostOne,
            changes: false,
        },
    ],
    outputs: &[
        Output { name: "requests", about: "places that need a record", kind: PortKind::Requests },
        Output { name: "none", about: "set when no pixel misses a record", kind: PortKind::Flag },
    ],
};

/// Rounds in a row that may cover no pixel of those that they made records for: enough for a search to come from its first cells to
/// single pixels, so that a few such pixels keep no other from its record.
const STALLED_ROUNDS: u32 = 64;

/// What the ways of finding misses share.
#[derive(Clone, Copy)]
struct Work {
    gbuffer: port::GBuffer,
    /// Σ w as the fourth channel.
    sums: Resource,
    cache: port::RecordCache,
    requests: port::Requests,
    none: Variable,
    /// Rounds in a row that covered no pixel of those that they made records for.
    stalled: Variable,
    /// A pixel whose weights add up to this or less misses a record.
    overlap: f32,
    /// Whether shading normals differ from those of planes.
    has_faces: bool,
}

impl Work {
    /// What tells [`Self::face`] of the visible triangles, if anything is to be told.
    fn face_reads(&self) -> Option<Read> {
        self.has_faces.then(|| Read::whole(self.gbuffer.triangles))
    }

    /// The plane's normal of what a pixel sees at a place, on the side that it sees; none where that of the shading is the same.
    fn face(&self, host: &dyn HostContext, pixel: usize, place: Vec4) -> Option<Vec3> {
        if !self.has_faces {
            return None;
        }
        let triangles: &[u32] = bytemuck::cast_slice(host.read(self.gbuffer.triangles));
        let face = host.scene().triangles[triangles[pixel].checked_sub(1)? as usize].face_normal();
        Some(if face.dot(place.xyz() - host.camera().0.eye) <= 0.0 { face } else { -face })
    }

    /// Whether the cache has the records of a picture whose rays were a part of a pixel away.
    fn has_earlier_samples(&self, host: &dyn HostContext) -> bool {
        self.cache.lasts && host.camera().0.sample.number > 0
    }

    /// How many more records there may be: this frame's limit, the cache, the time given to the frame and what the round before has brought
    /// set bounds. Of the pixels that asked for a record then, `uncovered` miss one still. Without room the loop must end.
    fn room(&self, host: &mut dyn HostContext, uncovered: u32) -> u32 {
        let cache = self.cache;
        let unasked = self.requests.at_most.saturating_sub(host.variable(self.requests.made));
        let free = cache.capacity.saturating_sub(host.variable(cache.count));
        self.count_stalled(host, uncovered);
        let shortfall = match () {
            () if host.is_last_round() => None,
            () if host.variable(self.stalled) >= STALLED_ROUNDS => Some(Shortfall::NoProgress),
            () if free == 0 => Some(Shortfall::CacheFull),
            () if unasked == 0 => Some(Shortfall::FrameLimit),
            () => return unasked.min(free),
        };
        shortfall.into_iter().for_each(|because| host.cut_short(self.none, because));
        0
    }

    fn count_stalled(&self, host: &mut dyn HostContext, uncovered: u32) {
        let asked = host.variable(self.requests.count);
        if asked > 0 {
            host.set(self.stalled, if uncovered >= asked { host.variable(self.stalled) + 1 } else { 0 });
        }
    }
}

impl Pass for FindMisses {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let (Some(gbuffer), Some(splats)) = (e.g_buffer("gbuffer").copied(), e.splats("splats")) else { return Ok(()) };
        let capacity = e.batch.unwrap_or(1);
        let limit = match e.arguments.integer("at_most") {
            0 => u32::MAX,
            limit => limit as u32,
        };
        let (made, at_most) = match e.requests("after") {
            Some(after) => (after.made, limit.min(after.at_most)),
            None => (e.variable("made", false), limit),
        };
        let places = e.buffer("requests", u64::from(capacity) * REQUEST_BYTES);
        let requests = port::Requests { places, count: e.variable("count", false), capacity, made, at_most, slots: None };
        let (sums, cache) = (splats.sums, splats.cache);
        let [none, stalled] = ["none", "stalled"].map(|name| e.variable(name, false));
        let needs = e.setting.needs;
        let work = Work { gbuffer, sums, cache, requests, none, stalled, overlap: cache.rule.overlap, has_faces: needs.smooth || needs.normal_maps };
        // A loop that goes on where another has ended may be left out.
        if e.requests("after").is_none() {
            e.run_at_least(first_rounds(e, gbuffer.size, capacity));
        }
        let (by, arguments) = e.arguments.choice("by");
        let place = e.place(e.over_pixels(gbuffer.size).unless_on_device(by == "Scan", "Scan is a walk from pixel to pixel"))?;
        if by == "Scan" {
            host_scan::encode(e, &work, arguments.integer("spacing") as u32);
        } else {
            let grid = Grid::new(e, [arguments.integer("coarsest") as u32, arguments.integer("finest") as u32])?;
            match place {
                Place::Host => host_grid::encode(e, &work, grid),
                Place::Device => device_grid::encode(e, &work, grid),
            }
        }
        e.report_variable("new_records", made);
        e.output("requests", Port::Requests(requests));
        e.output("none", Port::Flag(work.none));
        Ok(())
    }
}

/// Places, spread over the whole picture, that are looked at whatever the time.
const FIRST_PLACES: u32 = 64;

/// Rounds that look at the first places.
fn first_rounds(e: &Encoder<'_>, size: [u32; 2], capacity: u32) -> u32 {
    let places = |apart: u32| size.map(|pixels| pixels.div_ceil(apart)).iter().product::<u32>();
    match e.arguments.choice("by") {
        ("Scan", _) => places(host_scan::widest_spacing(size) as u32).div_ceil(capacity),
        (_, arguments) => {
            // Four phases of cells of each edge, each of every second cell along both axes.
            let phases = (0..).flat_map(|halvings| [places(2 * (arguments.integer("coarsest") as u32 >> halvings).max(1)); 4]);
            let [mut looked_at, mut rounds] = [0, 0];
            for cells in phases {
                looked_at += cells;
                rounds += cells.div_ceil(capacity);
                if looked_at >= FIRST_PLACES.min(size.iter().product()) {
                    break;
                }
            }
            rounds
        }
    }
}

/// The request of a pixel that sees `place`, whose fourth component is the pixel's width there, and faces there like `facing`, on a plane of its own: as `ask` of
/// shaders/find_misses/device_grid.wgsl makes it.
fn request(place: Vec4, facing: Vec4, face: Option<Vec3>, pixel: u32) -> Request {
    let request = Request::new(place.xyz(), place.w, facing.xyz(), TAU * unit(hash(pixel + 1)));
    face.map_or(request, |face| request.on(face))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contract::{Arguments, Value, encoder::Setting};
    use crate::passes::mock::{self, MockHost};
    use crate::scene::needs::Needs;
    use std::collections::BTreeMap;

    /// A batch holds ten requests, a cache 100 records and a frame adds 50.
    pub(super) fn work() -> Work {
        let [position, normal, reflectance, triangles, sums, places] = [2, 3, 4, 5, 6, 7].map(Resource);
        let [count, made, none, stalled] = [1, 2, 3, 4].map(Variable);
        Work {
            gbuffer: port::GBuffer { size: [4, 4], position, normal, reflectance, triangles },
            sums,
            cache: mock::cache(100),
            requests: port::Requests { places, count, capacity: 10, made, at_most: 50, slots: None },
            none,
            stalled,
            overlap: 0.25,
            has_faces: false,
        }
    }

    /// Room for records, and why the loop ends: with so many records in the cache, made in this frame, and rounds that brought nothing.
    fn room(records: u32, made: u32, stalled: u32, is_last_round: bool) -> (u32, Option<Shortfall>) {
        let (work, mut host) = (work(), MockHost::new(Vec::new(), [4, 4]));
        host.is_last_round = is_last_round;
        host.variables.extend([(work.cache.count, records), (work.requests.made, made), (work.stalled, stalled)]);
        let room = work.room(&mut host, 0);
        assert!(host.cut_short.is_none_or(|(until, _)| until == work.none));
        (room, host.cut_short.map(|(_, because)| because))
    }

    #[test]
    fn rounds_have_the_room_that_frame_and_cache_leave() {
        assert_eq!(room(0, 0, 0, false), (50, None));
        assert_eq!(room(30, 20, 0, false), (30, None));
        assert_eq!(room(90, 20, 0, false), (10, None));
        assert_eq!(room(99, 49, STALLED_ROUNDS - 1, false), (1, None));
    }

    #[test]
    fn a_loop_without_room_tells_why() {
        assert_eq!(room(100, 0, 0, false), (0, Some(Shortfall::CacheFull)));
        assert_eq!(room(0, 50, 0, false), (0, Some(Shortfall::FrameLimit)));
        assert_eq!(room(100, 60, 0, false), (0, Some(Shortfall::CacheFull)));
        assert_eq!(room(100, 0, STALLED_ROUNDS, false), (0, Some(Shortfall::NoProgress)));
        // What ends a loop in its last round is not for the step to tell.
        assert_eq!(room(100, 50, STALLED_ROUNDS, true), (0, None));
    }

    #[test]
    fn rounds_that_cover_nothing_are_counted_until_one_does() {
        let (work, mut host) = (work(), MockHost::new(Vec::new(), [4, 4]));
        for (asked, uncovered, stalled) in [(3, 3, 1), (5, 5, 2), (0, 0, 2), (3, 4, 3), (3, 2, 0), (1, 0, 0), (1, 1, 1)] {
            host.set(work.requests.count, asked);
            work.count_stalled(&mut host, uncovered);
            assert_eq!(host.variable(work.stalled), stalled, "{asked} {uncovered}");
        }
    }

    #[test]
    fn a_request_has_what_its_pixel_sees_and_a_turn_of_its_own() {
        let (place, facing) = (Vec4::new(1.0, 2.0, 3.0, 0.5), Vec4::new(0.0, 0.6, 0.8, 7.0));
        let made = request(place, facing, Some(Vec3::Y), 5);
        assert_eq!((made.position, made.footprint, made.normal), ([1.0, 2.0, 3.0], 0.5, [0.0, 0.6, 0.8]));
        let face = |face: Vec3| request(place, facing, Some(face), 5).face();
        assert!(made.face() == Some(Vec3::Y) && request(place, facing, None, 5).face().is_none());
        assert!([Vec3::NEG_Z, Vec3::new(-0.48, 0.6, -0.64)].iter().all(|normal| face(*normal).is_some_and(|face| face.distance(*normal) < 1e-4)));
        let turns: Vec<f32> = (0..64).map(|pixel| request(place, facing, None, pixel).turn).collect();
        let in_part = |part: usize| turns.iter().filter(|turn| (**turn / TAU * 4.0) as usize == part).count();
        assert!(turns.iter().all(|turn| (0.0..TAU).contains(turn)) && (0..4).all(|part| in_part(part) > 6), "{turns:?}");
        assert_eq!(turns[5], TAU * unit(hash(6)));
    }

    /// Rounds that look at the first places of a picture, by a way of finding misses.
    fn first_rounds_of(size: [u32; 2], by: &'static str, more: &'static [Parameter], capacity: u32) -> u32 {
        let (host, needs, inputs, mut schedule) = (MockHost::new(Vec::new(), size), Needs::default(), BTreeMap::new(), Schedule::default());
        let mut arguments = Arguments::defaults(DESCRIPTION.parameters);
        arguments.set("by", Value::Choice(by, Arguments::defaults(more)));
        let setting = Setting { scene: host.scene(), needs: &needs, device: Device::ABLE, size, tables: None };
        first_rounds(&Encoder::new("misses", &arguments, setting, &inputs, &mut schedule), size, capacity)
    }

    #[test]
    fn whatever_the_time_places_all_over_the_picture_are_looked_at() {
        // A grid of 8×6 pixels that are 8 apart.
        assert_eq!([48, 10, 1].map(|capacity| first_rounds_of([64, 48], "Scan", &[], capacity)), [1, 5, 48]);
        // Four phases of one cell, four of 4, and of 12 as many as take 44 places: all four.
        assert_eq!([100, 10, 1].map(|capacity| first_rounds_of([64, 48], "Grid", CELLS, capacity)), [12, 16, 68]);
        // Where there are fewer pixels than that, all of them: four phases of one cell, and two.
        assert_eq!([100, 1].map(|capacity| first_rounds_of([3, 2], "Grid", CELLS, capacity)), [6, 6]);
    }
}
