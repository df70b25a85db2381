//! Where records made of photons stand: where photons are.

use super::photon_map::{PHOTON_BYTES, Photon, lookup::Lookup, unpacked_ways};
use super::record::{hand_on, requests};
use crate::contract::{Choice, Description, Input, Output, Parameter, ParameterKind, Pass, Port, PortKind, Recorder, Refusal};
use crate::math::{
    thinning::{Vertex, thinned},
    walk::{spread, walked},
};
use crate::recording::*;

pub struct PhotonPlaces;

static DESCRIPTION: Description = Description {
    name: "PhotonPlaces",
    about: "Places for records among photons, thinned to one for each group of neighbours: dense where light is, whatever the camera sees; by the host",
    source: "THESIS 6.3; the order of places: our own",
    parameters: &[
        Parameter { name: "records", about: "most places", unit: "records", kind: ParameterKind::Integer { default: 65_536, min: 1, max: 1 << 20 } },
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
                                name: "reach",
                                about: "how far a place reaches, as a share of the harmonic mean of how far the photons next to it have come",
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
                                kind: ParameterKind::Integer { default: 16, min: 1, max: 4096 },
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
    inputs: &[Input { name: "map", about: "the photons", accepts: PortKind::PhotonMap, required: true, changes: false }],
    outputs: &[Output { name: "requests", about: "places for records", kind: PortKind::Requests }],
};

impl Pass for PhotonPlaces {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn record(&self, r: &mut Recorder<'_>) -> Result<(), Refusal> {
        let Some(map) = r.photon_map("map").copied() else { return Ok(()) };
        let capacity = r.arguments.integer("records") as u32;
        let by = By::of(r);
        let requests = requests(r, capacity);
        let reads = [Read::whole(map.codes), Read::counted(map.photons, PHOTON_BYTES, map.count)];
        r.host("place", &reads, &[requests.places], move |host| {
            let places = by.places(&Lookup::of(&map, host), capacity as usize, host.extent());
            hand_on(host, &requests, places);
            Ok(())
        });
        r.report_variable("photon_records", requests.made);
        r.output("requests", Port::Requests(requests));
        Ok(())
    }
}

/// The parameter `by`.
#[derive(Clone, Copy)]
enum By {
    Walk { reach: f32, accuracy: f32, photons: u32 },
    Thinned { of: usize },
}

/// How far away photons may be that tell how far a place reaches, as a share of the scene's extent.
const FARTHEST: f32 = 0.05;

impl By {
    fn of(r: &Recorder<'_>) -> Self {
        match r.arguments.choice("by") {
            ("Thinned", arguments) => Self::Thinned { of: arguments.integer("of") as usize },
            (_, arguments) => {
                let [reach, accuracy] = ["reach", "accuracy"].map(|name| arguments.float(name) as f32);
                Self::Walk { reach, accuracy, photons: arguments.integer("photons") as u32 }
            }
        }
    }

    fn places(self, lookup: &Lookup<'_>, most: usize, extent: f32) -> Vec<(Vertex, f32)> {
        let photons = lookup.photons();
        let vertex = |photon: &Photon| Vertex { position: photon.position.into(), normal: unpacked_ways(photon.ways)[0] };
        match self {
            Self::Walk { reach, accuracy, photons: least } => {
                let reaches = |place: &Vertex| {
                    let zone = lookup.zone(place.position, place.normal, least, FARTHEST * extent);
                    let (mut count, mut inverse) = (0.0, 0.0);
                    lookup.for_each(place.position, place.normal, zone, |photon, _| (count, inverse) = (count + 1.0, inverse + 1.0 / photon.leg));
                    (reach * count / inverse).max(zone.radius).min(FARTHEST * extent)
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
