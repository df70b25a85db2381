//! Light of chosen texels, brought to all texels that they see.

use self::range::{Range, TOGETHER};
use self::views::Views;
use super::texels::{BLOCK, NEAREST, Shot, TexelSurface};
use crate::contract::{
    Bodies, Description, Encoder, Input, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes, encoder::scene_constants, port,
};
use crate::math::{colour::luminance, frame::Frame, hemisphere::Shape, random::hash};
use crate::scene::packets::ToDo;
use crate::schedule::*;
use glam::{Vec3, Vec4};
use rayon::prelude::*;

mod eight;
mod range;
mod views;

pub struct Shoot;

static DESCRIPTION: Description = Description {
    name: "Shoot",
    about: "Brings what chosen texels send out to every texel that they see: one iteration of the transport of light",
    source: "STOCH sections 3 and 3.2; by shadow rays, of which one stands for many shots that bring little: our own",
    parameters: &[
        Parameter {
            name: "rays",
            about: "shadow rays of a texel in the mean: shots that would bring it much are all asked, of others one for each part of all light",
            unit: "rays",
            kind: ParameterKind::Integer { default: 8, min: 1, max: 65_536 },
        },
        PLACE,
    ],
    inputs: &[
        Input { name: "from", about: "what sends light out", accepts: PortKind::Shooters, takes: Takes::One, changes: false },
        Input {
            name: "views",
            about: "what is seen from there: shadow rays go only where that does not tell what is hidden; without it they go everywhere",
            accepts: PortKind::ShooterViews,
            takes: Takes::AtMostOne,
            changes: false,
        },
        Input { name: "to", about: "what receives it", accepts: PortKind::Lightmap, takes: Takes::One, changes: true },
    ],
    outputs: &[Output { name: "lightmap", about: "the lightmap with the irradiance of this iteration", kind: PortKind::Lightmap }],
};

impl Pass for Shoot {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn stands_for(&self) -> Option<[&'static str; 2]> {
        Some(["to", "lightmap"])
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let (Some(from), Some(to)) = (e.shooters("from").copied(), e.lightmap("to").copied()) else { return Ok(()) };
        let rays = e.arguments.integer("rays") as f32;
        let has_views = e.shooter_views("views").is_some();
        if has_views {
            e.idle("rays", "views tell what most texels see");
        }
        // Views tell of most shots, and rays of all others; few shots are all asked.
        let rays = (!has_views && from.requests.capacity as f32 > rays).then_some(rays);
        let parts = parts(e, &to, rays);
        match e.place(Bodies::BOTH)? {
            Place::Host => shoot_on_host(e, from, to, (rays, parts)),
            Place::Device => shoot_on_device(e, from, to, (rays, parts)),
        }
        e.output("lightmap", Port::Lightmap(to));
        Ok(())
    }
}

/// Rays a luminance, of each side of a texel, as the last iteration has found them to be as many as they should: 0 where that is not known.
fn parts(e: &mut Encoder<'_>, to: &port::Lightmap, rays: Option<f32>) -> Resource {
    let parts = e.history_buffer("parts", rays.map_or(0, |_| 4 * u64::from(to.places())));
    e.accumulates(&[parts], &[]);
    if to.remembers > 0 {
        e.survives_with(to.cells, &[parts], &[]);
    }
    parts
}

fn shoot_on_device(e: &mut Encoder<'_>, from: port::Shooters, to: port::Lightmap, (rays, parts): (Option<f32>, Resource)) {
    let iteration = e.buffer("iteration", 16);
    e.host("begin", &[], &[iteration], move |host| {
        host.write(iteration, 0, bytemuck::bytes_of(&[seed(host, &to), 0, 0, 0]));
        Ok(())
    });
    let program = bind_views(scene_constants(Program::new("shoot"), e.setting.needs), e.shooter_views("views"), to.surfaces)
        .constant("SIDES", to.sides)
        .constant("TEXELS", to.texels)
        .constant("SHOOTERS", from.requests.capacity)
        .constant("RAYS", rays.unwrap_or(0.0))
        .bind("iteration", iteration)
        .bind("surfaces", to.surfaces)
        .bind("shots", from.shots)
        .bind("parts", parts)
        .bind("fresh", to.fresh);
    e.compute(program, "shoot", Groups::linear(to.texels.div_ceil(BLOCK as u32)));
}

/// Of the choices of an iteration.
fn seed(host: &dyn HostContext, to: &port::Lightmap) -> u32 {
    hash(host.variable(to.rounds).wrapping_mul(2))
}

/// Views that are absent are bound to any buffer and never read.
fn bind_views(program: Program, views: Option<&port::ShooterViews>, any: Resource) -> Program {
    let Some(views) = views else { return program.constant("HAS_VIEWS", 0).bind("seen", any) };
    program
        .constant("HAS_VIEWS", 1)
        .constant("HEMICUBE", (views.shape == Shape::Hemicube) as u8)
        .constant("VIEW_RESOLUTION", views.resolution)
        .constant("TILE_WIDTH", views.size[0])
        .constant("TILE_HEIGHT", views.size[1])
        .constant("TILES_PER_ROW", views.tiles_per_row)
        .constant("ATLAS_PITCH", views.pitch)
        .bind("seen", views.seen)
}

fn shoot_on_host(e: &mut Encoder<'_>, from: port::Shooters, to: port::Lightmap, (rays, parts): (Option<f32>, Resource)) {
    let views = e.shooter_views("views").copied();
    let seen = views.map(|views| Read::whole(views.seen));
    let shots = Read::counted(from.shots, size_of::<Shot>() as u64, from.requests.count);
    let reads: Vec<Read> = [shots, Read::whole(to.surfaces), Read::whole(parts)].into_iter().chain(seen).collect();
    e.host("shoot", &reads, &[to.fresh, parts], move |host| {
        let [mut fresh, mut found] = [to.fresh, parts].map(|resource| host.take(resource));
        let shots: &[Shot] = bytemuck::cast_slice(host.read(from.shots));
        let texels: &[TexelSurface] = bytemuck::cast_slice(host.read(to.surfaces));
        let count = host.variable(from.requests.count) as usize;
        let seed = seed(host, &to);
        let views = views.map(|of| Views { of, seen: bytemuck::cast_slice(host.read(of.seen)), scene: host.scene() });
        let sender = |(shot, number): (&Shot, u32)| Sender {
            number,
            frame: Frame::new(shot.normal.into()),
            position: shot.position.into(),
            flux: shot.flux.into(),
            luminance: luminance(Vec3::from(shot.flux).as_dvec3()) as f32,
            nearest: shot.nearest,
        };
        let senders: Vec<Sender> = shots.iter().take(count).zip(0..).map(sender).collect();
        let range = Range { scene: host.scene(), bvh: host.bvh(), extent: host.extent(), sides: to.sides as usize, senders: &senders, views, rays, seed };
        let mut parts_now = bytemuck::cast_slice_mut::<_, f32>(&mut found).chunks_mut(TOGETHER * range.sides);
        let texels = texels[..to.texels as usize].chunks(TOGETHER);
        let ranges = fresh.chunks_mut(TOGETHER * range.sides).zip(texels).map(|(light, texels)| (light, texels, parts_now.next().unwrap_or_default()));
        let ranges: Vec<_> = ranges.collect();
        ranges.into_par_iter().enumerate().for_each_init(ToDo::default, |to_do, (number, (light, texels, parts))| {
            light.fill(Vec4::ZERO);
            range.light((number * TOGETHER, texels), parts, light, to_do);
        });
        host.put(to.fresh, fresh, u64::MAX);
        host.put(parts, found, u64::MAX);
        Ok(())
    });
}

/// A texel that sends light out.
struct Sender {
    number: u32,
    position: Vec3,
    /// Around its normal.
    frame: Frame,
    flux: Vec3,
    /// Of the flux.
    luminance: f32,
    nearest: f32,
}

/// Of what is sent out, the share that a texel receives, and that which it would receive without a bound [1/scene units²].
#[derive(Clone, Copy)]
struct Share {
    bounded: f32,
    whole: f32,
}

impl Sender {
    /// What a texel receives that sees it. No texel takes more than all that is sent out.
    fn share(&self, texel: &TexelSurface) -> Share {
        let way = Vec3::from(texel.position) - self.position;
        let inverse = 1.0 / way.length_squared();
        let whole = way.dot(self.frame.normal).abs() * inverse * (way.dot(texel.normal.into()).abs() * inverse);
        Share { whole, bounded: whole * (1.0 / (inverse * self.nearest.max(texel.area * NEAREST))).min(1.0) }
    }

    /// Irradiance [W/m²], and the luminance of what the bound takes.
    fn brings(&self, share: Share) -> Vec4 {
        (self.flux * share.bounded).extend(self.luminance * (share.whole - share.bounded))
    }
}
