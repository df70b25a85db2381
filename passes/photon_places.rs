//! Where records made of photons stand: where photons are.

use super::photons::{PHOTON_BYTES, Photon, lookup::Lookup, unpacked_ways};
use super::record::{hand_on, requests};
use super::surroundings::Surroundings;
use crate::contract::{Choice, Description, Encoder, Input, Output, Parameter, ParameterKind, Pass, Port, PortKind, Refusal, Takes};
use crate::math::{
    radius::Reach,
    thinning::{Vertex, thinned},
    walk::{spread, walked},
};
use crate::schedule::*;

pub struct PhotonPlaces;

static DESCRIPTION: Description = Description {
    name: "PhotonPlaces",
    about: "Places for records among photons: close together where light is, whatever the camera sees; by the host",
    source: "THESIS 6.3; the order of places: our own",
    parameters: &[
        Parameter { name: "records", about: "most places", unit: "records", kind: ParameterKind::Integer { default: 131_072, min: 1, max: 1 << 20 } },
        Parameter {
            name: "by",
            about: "how they are found",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice {
                        name: "Walk",
                        about: "a photon after the other: where no place reaches it, it becomes one",
                        parameters: &[
                            Parameter {
                                name: "radius",
                                about: "validity radius of a place, as a share of the harmonic mean of how far the photons next to it have come",
                                unit: "",
                                kind: ParameterKind::Float { default: 0.2, min: 0.001, max: 10.0 },
                            },
                            Parameter {
                                name: "accuracy",
                                about: "how much normals may differ, sqrt(1 - n·n_k)",
                                unit: "",
                                kind: ParameterKind::Float { default: 0.3, min: 0.001, max: 10.0 },
                            },
                            Parameter {
                                name: "photons",
                                about: "photons that a place reaches at least, however near they have come from",
                                unit: "photons",
                                kind: ParameterKind::Integer { default: 32, min: 1, max: 4096 },
                            },
                        ],
                    },
                    Choice {
                        name: "Thinned",
                        about: "as many as `records`, one for each group of neighbours",
                        parameters: &[Parameter {
                            name: "of",
                            about: "photons that are looked at for each place, where there are so many",
                            unit: "photons",
                            kind: ParameterKind::Integer { default: 32, min: 4, max: 4096 },
                        }],
                    },
                ],
            },
        },
    ],
    inputs: &[Input { name: "map", about: "the photons", accepts: PortKind::PhotonMap, takes: Takes::One, changes: false }],
    outputs: &[Output { name: "requests", about: "places for records", kind: PortKind::Requests }],
};

impl Pass for PhotonPlaces {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(map) = e.photon_map("map").copied() else { return Ok(()) };
        let capacity = e.arguments.integer("records") as u32;
        let by = By::of(e);
        let requests = requests(e, capacity);
        let reads = [Read::counted(map.data, PHOTON_BYTES, map.slots)];
        e.host("place", &reads, &[requests.places], move |host| {
            let around = Surroundings::of(host);
            let places = by.places(&Lookup::of(&map, host), capacity as usize, around);
            hand_on(host, &requests, &places);
            Ok(())
        });
        e.report_variable("photon_records", requests.made);
        e.output("requests", Port::Requests(requests));
        Ok(())
    }
}

/// The parameter `by`.
#[derive(Clone, Copy)]
enum By {
    Walk { radius: f32, accuracy: f32, photons: u32 },
    Thinned { of: usize },
}

/// How far away photons may be that tell how far a place reaches, as a share of the scene's extent.
const FARTHEST: f32 = 0.05;

/// A place reaches no farther than this share of the way to what stands next to it, lest its light come out on the other side of a wall: records count to one and
/// a half times as far.
const BEFORE: f32 = 0.65;

/// How far it reaches at least, as a share of the radius that so many photons are within: a tenth of how far they are apart.
const LEAST: f32 = 1.0 / 32.0;

impl By {
    fn of(e: &Encoder<'_>) -> Self {
        match e.arguments.choice("by") {
            ("Thinned", arguments) => Self::Thinned { of: arguments.integer("of") as usize },
            (_, arguments) => {
                let [radius, accuracy] = ["radius", "accuracy"].map(|name| arguments.float(name) as f32);
                Self::Walk { radius, accuracy, photons: arguments.integer("photons") as u32 }
            }
        }
    }

    fn places(self, lookup: &Lookup<'_>, most: usize, around: Surroundings<'_>) -> Vec<(Vertex, Reach)> {
        let photons = lookup.photons();
        let vertex = |photon: &Photon| Vertex { position: photon.position.into(), normal: unpacked_ways(photon.ways)[0] };
        match self {
            Self::Walk { radius, accuracy, photons: least } => {
                let reaches = |place: &Vertex| {
                    let zone = lookup.zone(place.position, place.normal, least, FARTHEST * around.extent);
                    let (mut count, mut inverse) = (0.0, 0.0);
                    lookup.for_each(place.position, place.normal, zone, |photon, _| (count, inverse) = (count + 1.0, inverse + 1.0 / photon.leg));
                    let wished = (radius * count / inverse).min(FARTHEST * around.extent).max(zone.radius);
                    around.reach(place, [wished, wished / BEFORE], BEFORE, LEAST * zone.radius)
                };
                let all: Vec<Vertex> = spread(photons.len()).map(|at| vertex(&photons[at])).collect();
                walked(&all, accuracy, most, reaches)
            }
            Self::Thinned { of } => {
                let step = (photons.len() / (most * of)).max(1);
                thinned(photons.iter().step_by(step).map(vertex).collect(), most)
            }
        }
    }
}
