//! Records onto pixels.

use crate::contract::{Choice, Description, Input, Output, Parameter, ParameterKind, Pass, Port, PortKind, Recorder, Refusal, port};
use crate::recording::*;

mod compute_tiles;
mod host;
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
                    Choice { name: "RasterBlend", about: "a screen rectangle a record, blended additively (RCS)", parameters: &[] },
                    Choice {
                        name: "ComputeTiles",
                        about: "binned over tiles of 16×16 pixels and added in order; needs no blending; masks of 32 MiB at most",
                        parameters: &[],
                    },
                    Choice { name: "Host", about: "plain code on the host, for comparison; reads the surfaces back once a frame", parameters: &[] },
                ],
            },
        },
        Parameter { name: "count", about: "also counts the records of each pixel", unit: "", kind: ParameterKind::Bool { default: false } },
    ],
    inputs: &[
        Input { name: "records", about: "the cache", accepts: PortKind::RecordCache, required: true },
        Input { name: "gbuffer", about: "the visible surfaces", accepts: PortKind::GBuffer, required: true },
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
}

impl Pass for Splat {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn record(&self, r: &mut Recorder<'_>) -> Result<(), Refusal> {
        let (Some(cache), Some(gbuffer)) = (r.record_cache("records").copied(), r.g_buffer("gbuffer").copied()) else { return Ok(()) };
        let sums = r.image("sums", Format::Rgba32Float);
        let counts = r.arguments.bool("count").then(|| r.image("counts", Format::Rgba32Float));
        let first = r.variable("splatted", false);
        let work = Work { gbuffer, cache, sums, counts, first };
        for target in [Some(sums), counts].into_iter().flatten() {
            at_start(r, Command::Clear(target));
        }
        match r.arguments.choice("by").0 {
            "ComputeTiles" => compute_tiles::record(r, &work),
            "Host" => host::record(r, &work),
            _ => raster_blend::record(r, &work),
        }
        // Outside of a fill the sums start anew each time, and all records count again.
        if r.batch.is_some() {
            r.host("splatted", &[], &[], move |host| {
                host.set(first, host.variable(cache.count));
                Ok(())
            });
        }
        r.output("sums", Port::Splats(port::Splats { sums, counts, cache }));
        Ok(())
    }
}

/// Once a frame: before the loop that holds the node, or before its other commands.
fn at_start(r: &mut Recorder<'_>, command: Command) {
    if r.batch.is_some() { r.before_loop(command) } else { r.command(command) }
}
