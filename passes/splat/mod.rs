//! Records onto pixels.

use crate::contract::{
    Bodies, Choice, Description, Input, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Recorder, Refusal, Takes, port,
};
use crate::math::harmonics::{Method, reflection::quads};
use crate::recording::*;

mod compute_tiles;
mod fresh;
mod host;
mod host_radiance;
mod raster_blend;

pub struct Splat;

static DESCRIPTION: Description = Description {
    name: "Splat",
    about: "Adds the weighted estimate of every record to the pixels that it covers; in a fill, of those added since the last round",
    source: "RCS section 4, steps 2 and 5; SLIDES 38",
    parameters: &[
        Parameter {
            name: "by",
            about: "how records find their pixels",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice {
                        name: "Auto",
                        about: "by the device `RasterBlend` for irradiance if it blends 32-bit floats, `ComputeTiles` if not, and for radiance; by the host its cores share the records of bands of pixels",
                        parameters: &[],
                    },
                    Choice { name: "RasterBlend", about: "a screen rectangle a record, blended additively, by the device (RCS)", parameters: &[] },
                    Choice {
                        name: "ComputeTiles",
                        about: "binned over tiles of 16×16 pixels and added in order, by the device; needs no blending; masks of 32 MiB at most",
                        parameters: &[],
                    },
                ],
            },
        },
        Parameter {
            name: "rotation",
            about: "how what a record knows is brought into the frame of a pixel with another normal, for radiance",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "MovedViewer", about: "not at all: the viewer is moved to where the record's plane mirrors the same", parameters: &[] },
                    Choice { name: "Precomputed", about: "matrices for angles in a table (THESIS 3.4.4), on the host", parameters: &[] },
                    Choice {
                        name: "Conversion",
                        about: "spherical harmonics of four bands more, rotated and converted back (THESIS 3.4.1), on the host",
                        parameters: &[],
                    },
                    Choice { name: "DigonDeletion", about: "what sinks below the horizon is deleted first (THESIS 3.4.2), on the host", parameters: &[] },
                ],
            },
        },
        Parameter { name: "count", about: "also counts the records of each pixel", unit: "", kind: ParameterKind::Bool { default: false } },
        PLACE,
    ],
    inputs: &[
        Input { name: "records", about: "the cache", accepts: PortKind::RecordCache, takes: Takes::One, changes: false },
        Input { name: "gbuffer", about: "the visible surfaces", accepts: PortKind::GBuffer, takes: Takes::One, changes: false },
        Input {
            name: "lobes",
            about: "the lobes of these surfaces: then the sums are of the radiance that they reflect toward the camera, and all records count each time",
            accepts: PortKind::VisibleLobes,
            takes: Takes::AtMostOne,
            changes: false,
        },
    ],
    outputs: &[Output { name: "sums", about: "weighted sums", kind: PortKind::Splats }],
};

/// What the ways of splatting share.
struct Work {
    gbuffer: port::GBuffer,
    cache: port::RecordCache,
    sums: Resource,
    counts: Option<Resource>,
    /// Records already splatted this frame.
    first: Variable,
    radiance: Option<Radiance>,
}

/// What turns records into radiance toward the camera.
struct Radiance {
    visible: port::VisibleLobes,
    /// Of the records.
    coefficients: port::Coefficients,
    /// None where the viewer is moved in place of it.
    rotation: Option<Method>,
}

impl Work {
    /// What a record adds to a pixel.
    fn contribution(&self, program: Program) -> Program {
        let Some(Radiance { visible, coefficients, .. }) = &self.radiance else { return program.import("CONTRIBUTION", "lib/contribution/irradiance") };
        program
            .import("CONTRIBUTION", "lib/contribution/radiance")
            .import(
                "COEFFICIENTS",
                match coefficients.precision {
                    port::Precision::Single => "lib/coefficients/single",
                    port::Precision::Half => "lib/coefficients/half",
                },
            )
            .constant("QUADS", quads(coefficients.order as usize) as u32)
            .constant("GRID", visible.lobes.edge)
            .bind("coefficients", coefficients.values)
            .bind("lobes", visible.lobes.values)
            .bind("lobe_places", visible.lobes.places)
            .bind("seen", visible.seen)
    }
}

fn radiance(r: &Recorder<'_>, cache: &port::RecordCache) -> Result<Option<Radiance>, Refusal> {
    let Some(visible) = r.visible_lobes("lobes") else { return Ok(None) };
    visible.lobes.expect_hemispherical()?;
    let rotation = match r.arguments.choice("rotation").0 {
        "Precomputed" => Some(Method::Precomputed),
        "Conversion" => Some(Method::Conversion { spherical: visible.lobes.order() as usize + 4 }),
        "DigonDeletion" => Some(Method::DigonDeletion),
        _ => None,
    };
    match cache.coefficients {
        Some(coefficients) if coefficients.order == visible.lobes.order() => Ok(Some(Radiance { visible: visible.clone(), coefficients, rotation })),
        _ => Err(Refusal::new(
            "plan::coefficients",
            "the records hold no coefficients for these lobes",
            "join the input `lobes` of the RecordCache and of the Surfaces to one LobeCoefficients node",
        )),
    }
}

impl Pass for Splat {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn record(&self, r: &mut Recorder<'_>) -> Result<(), Refusal> {
        let (Some(cache), Some(gbuffer)) = (r.record_cache("records").copied(), r.g_buffer("gbuffer").copied()) else { return Ok(()) };
        let sums = r.image("sums", gbuffer.size, Format::Rgba32Float);
        let counts = r.arguments.bool("count").then(|| r.image("counts", gbuffer.size, Format::Rgba32Float));
        let first = r.variable("splatted", false);
        let radiance = radiance(r, &cache)?;
        if radiance.is_none() {
            r.idle("rotation", "records hold irradiance alone");
        }
        let work = Work { gbuffer, cache, sums, counts, first, radiance };
        match (place(r, &work)?, &work.radiance) {
            (Place::Host, Some(radiance)) => host_radiance::record(r, &work, radiance)?,
            (Place::Host, None) => host::record(r, &work),
            (Place::Device, _) => record_on_device(r, &work),
        }
        let lobes = work.radiance.map(|radiance| radiance.visible);
        r.output("sums", Port::Splats(port::Splats { sums, counts, lobes, cache }));
        Ok(())
    }
}

fn place(r: &mut Recorder<'_>, work: &Work) -> Result<Place, Refusal> {
    let bodies = match &work.radiance {
        Some(radiance) => Bodies::BOTH
            .unless(radiance.visible.lobes.tables.is_none(), "the device projects the lobes")
            .unless_on_device(radiance.rotation.is_some(), "expansions are rotated by the host alone"),
        None => r.over_pixels(work.gbuffer.size),
    };
    let by = r.arguments.choice("by").0;
    r.place(bodies.unless(by != "Auto", format!("{by} is a way of the device")))
}

fn record_on_device(r: &mut Recorder<'_>, work: &Work) {
    for target in [Some(work.sums), work.counts].into_iter().flatten() {
        at_start(r, Command::Clear(target));
    }
    let blends = r.setting.device.blends;
    match (r.arguments.choice("by").0, &work.radiance) {
        ("Auto", None) if !blends => {
            r.remark("records are splatted in compute, as the device cannot blend 32-bit floats");
            compute_tiles::record(r, work);
        }
        ("RasterBlend", _) | ("Auto", None) => raster_blend::record(r, work),
        _ => compute_tiles::record(r, work),
    }
}

/// Once a frame: before the loop that holds the node, or before its other commands.
fn at_start(r: &mut Recorder<'_>, command: Command) {
    if r.batch.is_some() { r.before_loop(command) } else { r.command(command) }
}
