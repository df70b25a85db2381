//! Records onto pixels.

use crate::contract::{
    Bodies, Choice, Description, Encoder, Input, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes, port,
};
use crate::math::harmonics::{Method, reflection::quads};
use crate::schedule::*;

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
        Parameter {
            name: "of",
            about: "what is summed of records of irradiance",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Estimate", about: "what they estimate at the pixel", parameters: &[] },
                    Choice { name: "StandardError", about: "how wrong they may be by chance, as if all were wrong in the same way", parameters: &[] },
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
    /// Standard errors in place of estimates.
    of_errors: bool,
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
        let Some(Radiance { visible, coefficients, .. }) = &self.radiance else {
            return program.import("CONTRIBUTION", if self.of_errors { "lib/contribution/standard_error" } else { "lib/contribution/irradiance" });
        };
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

fn radiance(e: &Encoder<'_>, cache: &port::RecordCache) -> Result<Option<Radiance>, Refusal> {
    let Some(visible) = e.visible_lobes("lobes") else { return Ok(None) };
    visible.lobes.expect_hemispherical()?;
    let rotation = match e.arguments.choice("rotation").0 {
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
            "join the input `lobes` of the RecordCache and of the Classify to one LobeCoefficients node",
        )),
    }
}

impl Pass for Splat {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let (Some(cache), Some(gbuffer)) = (e.record_cache("records").copied(), e.g_buffer("gbuffer").copied()) else { return Ok(()) };
        let sums = e.image("sums", gbuffer.size, Format::Rgba32Float);
        let counts = e.arguments.bool("count").then(|| e.image("counts", gbuffer.size, Format::Rgba32Float));
        let first = e.variable("splatted", false);
        let radiance = radiance(e, &cache)?;
        if radiance.is_none() {
            e.idle("rotation", "records hold irradiance alone");
        }
        let of_errors = e.arguments.choice("of").0 == "StandardError";
        if of_errors && radiance.is_some() {
            return Err(Refusal::of_parameter(
                "of",
                "plan::errors_of_radiance",
                "records of radiance have no standard errors",
                "leave `lobes` away, or set `of` to Estimate",
            ));
        }
        let work = Work { gbuffer, cache, sums, counts, first, of_errors, radiance };
        match (place(e, &work)?, &work.radiance) {
            (Place::Host, Some(radiance)) => host_radiance::encode(e, &work, radiance)?,
            (Place::Host, None) => host::encode(e, &work),
            (Place::Device, _) => encode_on_device(e, &work),
        }
        let lobes = work.radiance.map(|radiance| radiance.visible);
        e.output("sums", Port::Splats(port::Splats { sums, counts, lobes, of_errors, cache }));
        Ok(())
    }
}

fn place(e: &mut Encoder<'_>, work: &Work) -> Result<Place, Refusal> {
    let bodies = match &work.radiance {
        Some(radiance) => Bodies::BOTH
            .unless(radiance.visible.lobes.tables.is_none(), "the device projects the lobes")
            .unless_on_device(radiance.rotation.is_some(), "expansions are rotated by the host alone"),
        None => e.over_pixels(work.gbuffer.size),
    };
    let by = e.arguments.choice("by").0;
    e.place(bodies.unless(by != "Auto", format!("{by} is a way of the device")))
}

fn encode_on_device(e: &mut Encoder<'_>, work: &Work) {
    for target in [Some(work.sums), work.counts].into_iter().flatten() {
        at_start(e, Command::Clear(target));
    }
    let blends = e.setting.device.blends;
    match (e.arguments.choice("by").0, &work.radiance) {
        ("Auto", None) if !blends => {
            e.remark("records are splatted in compute, as the device cannot blend 32-bit floats");
            compute_tiles::encode(e, work);
        }
        ("RasterBlend", _) | ("Auto", None) => raster_blend::encode(e, work),
        _ => compute_tiles::encode(e, work),
    }
}

/// Once a frame: before the loop that holds the node, or before its other commands.
fn at_start(e: &mut Encoder<'_>, command: Command) {
    if e.batch.is_some() { e.before_loop(command) } else { e.command(command) }
}
