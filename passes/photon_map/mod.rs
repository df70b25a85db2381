//! Photons: light that sources send out, followed from surface to surface, and kept where it arrives.

use super::photons::{PHOTON_BYTES, SLOTS_BEFORE};
use crate::contract::{
    Arguments, Bodies, Choice, Description, Encoder, Need, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, port,
};
use crate::math::bounces::Bounces;
use crate::scene::needs::Needs;
use crate::schedule::{HostContext, Resource, Variable};

mod device;
mod guide;
mod host;
mod trace;

pub struct PhotonMap;

static DESCRIPTION: Description = Description {
    name: "PhotonMap",
    about: "Photons from all sources of light, followed through any number of reflections and kept where they arrive after the first, in a grid",
    source: "THESIS 6.2; Jensen 1996",
    parameters: &[
        Parameter {
            name: "photons",
            about: "photons that the sources send out",
            unit: "photons",
            kind: ParameterKind::Integer { default: 500_000, min: 0, max: 10_000_000 },
        },
        Parameter {
            name: "kept",
            about: "most places of photons that are kept; when there are so many, no more are sent out",
            unit: "photons",
            kind: ParameterKind::Integer { default: 1 << 20, min: 1 << 10, max: (1 << 22) - (1 << 16) },
        },
        Parameter {
            name: "light",
            about: "which light is followed",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "All", about: "of any reflections", parameters: &[] },
                    Choice { name: "Caustics", about: "that narrow lobes alone have reflected since it left its source", parameters: &[] },
                ],
            },
        },
        Parameter { name: "legs", about: "most surfaces that a photon meets", unit: "", kind: ParameterKind::Integer { default: ALL_LEGS, min: 2, max: 1024 } },
        PLACE,
    ],
    inputs: &[],
    outputs: &[Output { name: "map", about: "the photons, sorted by where they are", kind: PortKind::PhotonMap }],
};

/// Surfaces after which hardly any photon is left, but where surfaces reflect all light.
const ALL_LEGS: i64 = 64;

fn is_caustics(arguments: &Arguments) -> bool {
    arguments.choice("light").0 == "Caustics"
}

/// What both sides need.
#[derive(Clone, Copy)]
struct Work {
    data: Resource,
    /// Paths, photons kept at most, and surfaces that a path meets at most.
    most: u32,
    capacity: u32,
    legs: u32,
    reflects: Reflects,
    emitted: Variable,
    count: Variable,
    slots: Variable,
    cut_off: Variable,
}

/// What reflects photons.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Reflects {
    /// Surfaces as they would be by their albedo.
    Albedo,
    /// Diffuse parts and lobes.
    All,
    /// Narrow lobes: photons are caustics, which end at whatever else they meet.
    NarrowLobes,
}

impl Work {
    fn tell(&self, host: &mut dyn HostContext, [emitted, count, cut_off]: [u32; 3]) {
        host.set(self.emitted, emitted);
        host.set(self.count, count);
        host.set(self.slots, SLOTS_BEFORE as u32 + count);
        host.set(self.cut_off, cut_off);
    }
}

/// Surfaces that a path may meet before a driver on the processor has counted too many rounds.
const MOST_BY_SOFTWARE: u32 = 64;

impl Pass for PhotonMap {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn need(&self, arguments: &Arguments, needs: &Needs) -> Need {
        let has_caustics = needs.narrow_lobes && needs.renders_lobes();
        if is_caustics(arguments) && !has_caustics { Need::Dropped("no surface has a narrow lobe that is rendered") } else { Need::Kept }
    }

    fn reflections(&self, arguments: &Arguments) -> Option<Bounces> {
        let legs = arguments.integer("legs");
        let reflections = u32::try_from(legs).unwrap_or(u32::MAX).saturating_sub(1);
        Some(if legs < ALL_LEGS { Bounces::Count(reflections) } else { Bounces::All })
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let [most, capacity, legs] = ["photons", "kept", "legs"].map(|name| e.arguments.integer(name) as u32);
        let data = e.history_buffer("data", PHOTON_BYTES * (SLOTS_BEFORE + u64::from(capacity)));
        let [emitted, count, slots, cut_off] = ["emitted", "count", "slots", "cut_off"].map(|name| e.variable(name, true));
        e.remakes(&[data], &[emitted, count, slots, cut_off]);
        let reflects = match (e.setting.needs.renders_lobes(), is_caustics(e.arguments)) {
            (false, _) => Reflects::Albedo,
            (true, false) => Reflects::All,
            (true, true) => Reflects::NarrowLobes,
        };
        let work = Work { data, most, capacity, legs, reflects, emitted, count, slots, cut_off };
        let is_long = e.setting.device.is_software && legs > MOST_BY_SOFTWARE;
        match e.place(Bodies::BOTH.unless_on_device(is_long, "a driver on the cores of the host ends loops after 65,536 rounds"))? {
            Place::Host => host::encode(e, work),
            Place::Device => device::encode(e, work),
        }
        e.report_variable("photons_emitted", emitted);
        e.report_variable("photons", count);
        // Those that were to go no farther are not missed.
        if self.reflections(e.arguments) == Some(Bounces::All) {
            e.report_variable("photons_cut_off", cut_off);
        }
        e.output("map", Port::PhotonMap(port::PhotonMap { data, slots }));
        Ok(())
    }
}
