//! What is nearer to texels than the bound of shots, gathered by rays: a few shots would make blots of it along every edge.

use super::texels::{self, NEAREST, Shot, TexelSurface, favour, laid_at, nearest, radiance};
use crate::contract::{
    Bodies, Description, Encoder, Input, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes, encoder::scene_constants, port,
};
use crate::math::{
    colour::luminance,
    frame::Frame,
    hemisphere,
    random::{combine, hash, unit},
};
use crate::scene::{
    Scene,
    packets::{Numbers, RayBundle, View},
};
use crate::schedule::*;
use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::f32::consts::{PI, TAU};

pub struct GatherNear;

static DESCRIPTION: Description = Description {
    name: "GatherNear",
    about: "Gathers by rays what the bound of shots leaves out: the light of surfaces that are near, in the share that the bound takes of it",
    source: "compensation of what is bounded: Kollig and Keller 2004; from the lightmap, now and then: our own",
    parameters: &[
        Parameter { name: "rays", about: "rays of a texel, a square number", unit: "rays", kind: ParameterKind::Integer { default: 9, min: 4, max: 1024 } },
        Parameter {
            name: "every",
            about: "iterations from one gathering to the next",
            unit: "iterations",
            kind: ParameterKind::Integer { default: 3, min: 1, max: 65_536 },
        },
        PLACE,
    ],
    inputs: &[
        Input { name: "from", about: "the shots that are bounded", accepts: PortKind::Shooters, takes: Takes::One, changes: false },
        Input { name: "to", about: "what gathers", accepts: PortKind::Lightmap, takes: Takes::One, changes: true },
    ],
    outputs: &[Output { name: "lightmap", about: "the lightmap with what is near", kind: PortKind::Lightmap }],
};

impl Pass for GatherNear {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn stands_for(&self) -> Option<[&'static str; 2]> {
        Some(["to", "lightmap"])
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let (Some(from), Some(to)) = (e.shooters("from").copied(), e.lightmap("to").copied()) else { return Ok(()) };
        let rays = e.arguments.integer("rays") as u32;
        let edge = rays.isqrt();
        if edge * edge != rays {
            let help = format!("give {} or {}", edge * edge, (edge + 1).pow(2));
            return Err(Refusal::of_parameter("rays", "plan::near_rays", format!("{rays} rays do not make a square"), help));
        }
        let sets = directions(edge);
        let every = e.arguments.integer("every") as u32;
        match e.place(Bodies::BOTH)? {
            Place::Host => gather_on_host(e, (from, to), sets, every),
            Place::Device => gather_on_device(e, (from, to), &sets, every),
        }
        e.output("lightmap", Port::Lightmap(to));
        Ok(())
    }
}

/// Whether texels gather now: at once after the scene has changed, and then again and again.
fn begins(host: &dyn HostContext, of: &port::Lightmap, every: u32) -> bool {
    host.variable(of.iterations).is_multiple_of(every)
}

fn gather_on_device(e: &mut Encoder<'_>, (from, to): (port::Shooters, port::Lightmap), sets: &[Vec<Vec3>], every: u32) {
    let shine = e.buffer("shine", 16 * u64::from(to.places()));
    let gathering = e.variable("gathering", false);
    let round = e.buffer("round", 16);
    e.host("begin", &[], &[round], move |host| {
        let is_due = begins(host, &to, every);
        host.write(round, 0, bytemuck::bytes_of(&[seed(host, &to), 0, 0, 0]));
        host.set(gathering, if is_due { to.places() } else { 0 });
        Ok(())
    });
    let program = Program::new("gather_near/shine")
        .constant("SIDES", to.sides)
        .constant("PLACES", to.places())
        .constant("REACH", from.nearest)
        .constant("SHOOTERS", from.requests.capacity)
        .constant("ROOT", (from.favour == port::Favour::Root) as u8)
        .bind("surfaces", to.surfaces)
        .constant("MEAN", from.sends_mean as u8)
        .bind("direct", to.direct)
        .bind("fresh", to.fresh)
        .bind("near", to.near)
        .bind("mean", to.mean)
        .bind("shots", from.shots)
        .bind("shine", shine);
    let groups = Groups::Counted { count: gathering, divisor: 64, per: 1 };
    e.compute(program, "send_out", groups);
    let program = scene_constants(Program::new("gather_near/gather"), e.setting.needs)
        .constant("SIDES", to.sides)
        .constant("PLACES", to.places())
        .constant("EDGE", to.edge)
        .constant("RAYS", sets[0].len() as u32)
        .constant("SETS", sets.len() as u32)
        .bind("surfaces", to.surfaces)
        .bind("cells", to.cells)
        .bind("atlas_corners", to.corners)
        .bind("shine", shine)
        .bind("gathering", round)
        .bind("near", to.near);
    let mut rays: Vec<Vec4> = sets.iter().flatten().map(|ray| ray.extend(0.0)).collect();
    rays.resize(MOST_RAYS, Vec4::ZERO);
    let rays = e.constant_buffer("rays", bytemuck::cast_slice(&rays));
    e.compute(program.bind("rays", rays), "gather", groups);
}

/// Rays that the shader has room for.
const MOST_RAYS: usize = 1024;

/// Sets of directions by the cosine, in each one from each square of a grid, elsewhere in it from set to set.
fn directions(edge: u32) -> Vec<Vec<Vec3>> {
    let set = |number: u32| (0..edge * edge).map(|cell| hemisphere::ray(edge, [cell % edge, cell / edge], number).as_vec3()).collect();
    (0..MOST_RAYS as u32 / (edge * edge)).map(set).collect()
}

fn gather_on_host(e: &mut Encoder<'_>, (from, to): (port::Shooters, port::Lightmap), sets: Vec<Vec<Vec3>>, every: u32) {
    let bundles: Vec<RayBundle> = sets.iter().map(|directions| RayBundle::of(directions)).collect();
    let shots = Read::counted(from.shots, size_of::<Shot>() as u64, from.requests.count);
    let reads: Vec<Read> = [to.cells, to.corners, to.surfaces, to.direct, to.fresh, to.near, to.mean].map(Read::whole).into_iter().chain([shots]).collect();
    e.host("gather", &reads, &[to.near], move |host| {
        if !begins(host, &to, every) {
            return Ok(());
        }
        let mut near = host.take(to.near);
        let shots: &[Shot] = bytemuck::cast_slice(host.read(from.shots));
        let count = host.variable(from.requests.count) as usize;
        let all = shots[..count.min(shots.len())].first().map_or(0.0, |shot| favours_of_all(shot, from));
        let surfaces: &[TexelSurface] = bytemuck::cast_slice(host.read(to.surfaces));
        let [direct, fresh, mean] = [to.direct, to.fresh, to.mean].map(|resource| bytemuck::cast_slice::<_, Vec4>(host.read(resource)));
        let shine = |place: usize| {
            let light = radiance(direct[place], if from.sends_mean { mean[place] } else { fresh[place] + near[place] });
            let bound = all * from.nearest / favour(luminance(light.as_dvec3()) as f32, from.favour).max(f32::MIN_POSITIVE);
            let is_lit = mean[place].truncate() != Vec3::ZERO || fresh[place].truncate() != Vec3::ZERO;
            light.extend(bound.max(surfaces[place / to.sides as usize].area * NEAREST).copysign(if is_lit { 1.0 } else { -1.0 }))
        };
        let places = to.places() as usize;
        let sends = Sends {
            seed: seed(host, &to),
            scene: host.scene(),
            of: to,
            cells: bytemuck::cast_slice(host.read(to.cells)),
            corners: bytemuck::cast_slice(host.read(to.corners)),
            surfaces,
            shine: (0..places).into_par_iter().map(shine).collect(),
        };
        // Sides that no shot has reached see nothing that shines, most of them for ever: the outsides of walls.
        let lit: Vec<usize> = (0..places).filter(|place| sends.is_lit(*place)).collect();
        near.fill(Vec4::ZERO);
        for places in lit.chunks(AT_ONCE) {
            let views: Vec<View> = places.iter().map(|place| sends.view(*place)).collect();
            let set = |place: &usize| sends.set(*place, sets.len());
            let bundles: Vec<&RayBundle> = places.iter().map(|place| &bundles[set(place)]).collect();
            let packets = host.bvh().packets(host.scene());
            let found = packets.trace_own(host.scene(), &views, &bundles, &Numbers, |at, seen| {
                let directions = &sets[set(&places[at])];
                let rays = seen.iter().zip(directions).filter(|(triangle, _)| **triangle != 0);
                let sum: Vec3 = rays.map(|(triangle, direction)| sends.along(places[at], &views[at], *triangle - 1, *direction)).sum();
                sum * (PI / directions.len() as f32)
            });
            places.iter().zip(found).for_each(|(place, found)| near[*place] = found.extend(0.0));
        }
        host.put(to.near, near, u64::MAX);
        Ok(())
    });
}

/// By what all areas are chosen together: the same by each shot.
fn favours_of_all(shot: &Shot, from: port::Shooters) -> f32 {
    let light = luminance(Vec3::from(shot.flux).as_dvec3()) as f32 * from.requests.capacity as f32 / shot.stands_for.max(f32::MIN_POSITIVE);
    shot.stands_for * favour(light, from.favour)
}

/// Texels whose rays are cast at once.
const AT_ONCE: usize = 16_384;

/// What texels send out, and where they are.
struct Sends<'a> {
    /// Of the gathering.
    seed: u32,
    scene: &'a Scene,
    of: port::Lightmap,
    cells: &'a [[u32; 4]],
    corners: &'a [Vec4],
    surfaces: &'a [TexelSurface],
    /// Of each texel and side what it sends out, and the square of the distance within which shots from it are bounded; below 0 where no shot has come yet.
    shine: Vec<Vec4>,
}

impl Sends<'_> {
    /// Turned by chance, so that neighbours are not wrong alike, nor one gathering as that before.
    fn view(&self, place: usize) -> View {
        let sides = self.of.sides as usize;
        let [position, normal] = self.surfaces[place / sides].place(place % sides);
        View { position, frame: Frame::new(normal).turned(turn(self.seed, place as u32)) }
    }

    /// Which directions a texel looks along.
    fn set(&self, place: usize, sets: usize) -> usize {
        hash(combine(self.seed, place as u32)) as usize % sets
    }

    /// The light along a ray that meets a triangle, in the share that is not shot.
    fn along(&self, place: usize, from: &View, triangle: u32, direction: Vec3) -> Vec3 {
        let direction = from.frame.to_world(direction);
        let own = &self.surfaces[place / self.of.sides as usize];
        let met = &self.scene.triangles[triangle as usize];
        let plane = met.cross();
        let (facing, away) = (plane.dot(direction), plane.dot(met.positions[0] - from.position));
        if facing == 0.0 {
            return Vec3::ZERO;
        }
        let position = from.position + direction * (away / facing);
        let Some(there) = self.texel(triangle, nearest(met, position), facing > 0.0) else { return Vec3::ZERO };
        let bound = self.shine[there].w.abs().max(own.area * NEAREST);
        self.shine[there].truncate() * (1.0 - position.distance_squared(from.position) / bound).max(0.0)
    }

    fn is_lit(&self, place: usize) -> bool {
        self.shine[place].w > 0.0
    }

    /// The side of the texel at a place of a triangle.
    fn texel(&self, triangle: u32, weights: Vec2, from_behind: bool) -> Option<usize> {
        if from_behind && self.of.sides == 1 {
            return None;
        }
        let place = laid_at(self.corners, triangle, weights);
        let at = place.as_uvec2().min(glam::UVec2::splat(self.of.edge - 1));
        let [number, parts @ ..] = self.cells[(at.y * self.of.edge + at.x) as usize];
        let first = number.checked_sub(1)?;
        let side = |part: u32| ((first + part) * self.of.sides) as usize + usize::from(from_behind);
        // What is beneath a wall sees what is there, not what its cell has beside it.
        Some(side(texels::part_at(parts, place - at.as_vec2(), |_| true)))
    }
}

fn seed(host: &dyn HostContext, of: &port::Lightmap) -> u32 {
    hash(host.variable(of.rounds)) ^ 7
}

fn turn(seed: u32, place: u32) -> f32 {
    TAU * unit(combine(seed, place))
}
