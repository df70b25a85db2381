//! The picture.

use crate::contract::{Description, Input, Output, Pass, Port, PortKind, Recorder, Refusal, port};
use crate::recording::*;

pub struct Combine;

static DESCRIPTION: Description = Description {
    name: "Combine",
    about: "Adds direct light, indirect light and what surfaces and sky emit toward the camera",
    source: "RCS section 4, step 5",
    parameters: &[],
    inputs: &[
        Input { name: "gbuffer", about: "the visible surfaces", accepts: PortKind::GBuffer, required: true, changes: false },
        Input { name: "direct", about: "reflected direct light", accepts: PortKind::DirectLight, required: false, changes: false },
        Input { name: "indirect", about: "indirect radiance that diffuse parts reflect", accepts: PortKind::Image, required: false, changes: false },
        Input { name: "glossy", about: "indirect radiance that lobes reflect", accepts: PortKind::Image, required: false, changes: false },
    ],
    outputs: &[
        Output { name: "picture", about: "radiance toward the camera", kind: PortKind::Image },
        Output { name: "indirect", about: "indirect light toward the camera, of diffuse parts and lobes", kind: PortKind::Image },
    ],
};

impl Pass for Combine {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    /// A picture of direct light alone lacks nothing.
    fn lacks_lobes(&self, joined: &[&str]) -> bool {
        joined.contains(&"indirect") && !joined.contains(&"glossy")
    }

    fn record(&self, r: &mut Recorder<'_>) -> Result<(), Refusal> {
        let Some(gbuffer) = r.g_buffer("gbuffer").copied() else { return Ok(()) };
        let direct = r.direct_light("direct").map(|d| d.radiance);
        let [indirect, glossy] = ["indirect", "glossy"].map(|part| r.image_port(part).map(|i| i.texture));
        let picture = r.image("picture", Format::Rgba32Float);
        // A part that is absent is bound to any image and never read.
        let program = Program::new("combine")
            .constant("TEXTURES", r.setting.needs.textures as u8)
            .constant("GLOSSY", r.setting.needs.lobes as u8)
            .constant("HAS_DIRECT", direct.is_some() as u8)
            .constant("HAS_INDIRECT", indirect.is_some() as u8)
            .constant("HAS_GLOSSY", glossy.is_some() as u8)
            .bind("triangles", gbuffer.triangles)
            .bind("direct", direct.unwrap_or(gbuffer.position))
            .bind("indirect", indirect.unwrap_or(gbuffer.position))
            .bind("glossy", glossy.unwrap_or(gbuffer.position))
            .bind("picture", picture);
        // One part alone is all of it.
        let all = if let (Some(part), None) | (None, Some(part)) = (indirect, glossy) {
            r.compute_pixels(program, "combine_parts");
            part
        } else {
            let all = r.image("indirect", Format::Rgba32Float);
            r.compute_pixels(program.bind("all_indirect", all), "combine_and_keep_indirect");
            all
        };
        r.output("picture", Port::Image(port::Image { texture: picture, channels: port::Channels::Colour }));
        r.output("indirect", Port::Image(port::Image { texture: all, channels: port::Channels::Colour }));
        Ok(())
    }
}
