//! Points that texels stand for, in turn.

use super::texels::{self, BLOCK, TexelPlace};
use crate::contract::{Bodies, Description, Encoder, Input, Output, PLACE, Pass, Place, Port, PortKind, Refusal, Takes, encoder::scene_constants, port};
use crate::schedule::*;

pub struct DrawPoints;

static DESCRIPTION: Description = Description {
    name: "DrawPoints",
    about: "Lets each texel stand for another point of its surface in each iteration, so that what it has is the mean over that surface",
    source: "our own",
    parameters: &[PLACE],
    inputs: &[Input { name: "of", about: "the lightmap, as an iteration begins", accepts: PortKind::Lightmap, takes: Takes::One, changes: true }],
    outputs: &[Output { name: "lightmap", about: "the lightmap, its texels elsewhere", kind: PortKind::Lightmap }],
};

impl Pass for DrawPoints {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn stands_for(&self) -> Option<[&'static str; 2]> {
        Some(["of", "lightmap"])
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(of) = e.lightmap("of").copied() else { return Ok(()) };
        match e.place(Bodies::BOTH)? {
            Place::Host => draw_on_host(e, of),
            Place::Device => draw_on_device(e, of),
        }
        e.output("lightmap", Port::Lightmap(of));
        Ok(())
    }
}

/// Whose turn it is.
fn point(host: &dyn HostContext, of: &port::Lightmap) -> u32 {
    host.variable(of.rounds) % of.points
}

fn draw_on_host(e: &mut Encoder<'_>, of: port::Lightmap) {
    e.host("draw", &[Read::whole(of.places)], &[of.surfaces], move |host| {
        let mut surfaces = host.take(of.surfaces);
        let places: &[TexelPlace] = bytemuck::cast_slice(host.read(of.places));
        let first = (point(host, &of) * of.texels) as usize;
        texels::place(host.scene(), &places[first..first + of.texels as usize], bytemuck::cast_slice_mut(&mut surfaces));
        host.put(of.surfaces, surfaces, u64::MAX);
        Ok(())
    });
}

fn draw_on_device(e: &mut Encoder<'_>, of: port::Lightmap) {
    let turn = e.buffer("turn", 16);
    e.host("begin", &[], &[turn], move |host| {
        host.write(turn, 0, bytemuck::bytes_of(&[point(host, &of) * of.texels, 0, 0, 0]));
        Ok(())
    });
    let program = scene_constants(Program::new("draw_points"), e.setting.needs)
        .constant("TEXELS", of.texels)
        .bind("turn", turn)
        .bind("texels", of.places)
        .bind("surfaces", of.surfaces);
    e.compute(program, "draw", Groups::linear(of.texels.div_ceil(BLOCK as u32)));
}
