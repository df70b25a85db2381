//! Light of chosen texels, brought to all texels that they see.

use super::record::{REQUEST_BYTES, Request};
use super::texels::{BLOCK, NEAREST, Shot, TexelSurface};
use crate::contract::{Bodies, Description, Encoder, Input, Output, PLACE, Pass, Place, Port, PortKind, Refusal, Takes, encoder::scene_constants, port};
use crate::math::{colour::luminance, frame::Frame, hemisphere::Shape};
use crate::scene::{
    LightKind, Scene,
    bvh::Bvh,
    packets::{RAYS, ShadowRays, ToDo},
    surface_offset,
};
use crate::schedule::*;
use glam::{Vec3, Vec4};
use rayon::prelude::*;

pub struct Shoot;

static DESCRIPTION: Description = Description {
    name: "Shoot",
    about: "Brings what chosen texels send out to every texel that they see: one iteration of the transport of light",
    source: "STOCH sections 3 and 3.2; by shadow rays: our own",
    parameters: &[PLACE],
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

/// Texels that are shot at together: rays for those of which views tell nothing are cast side by side.
const TOGETHER: usize = 1024;

impl Pass for Shoot {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn stands_for(&self) -> Option<[&'static str; 2]> {
        Some(["to", "lightmap"])
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let (Some(from), Some(to)) = (e.shooters("from").copied(), e.lightmap("to").copied()) else { return Ok(()) };
        match e.place(Bodies::BOTH)? {
            Place::Host => shoot_on_host(e, from, to),
            Place::Device => shoot_on_device(e, from, to),
        }
        e.output("lightmap", Port::Lightmap(to));
        Ok(())
    }
}

fn shoot_on_device(e: &mut Encoder<'_>, from: port::Shooters, to: port::Lightmap) {
    let program = bind_views(scene_constants(Program::new("shoot"), e.setting.needs), e.shooter_views("views"), to.surfaces)
        .constant("SIDES", to.sides)
        .constant("TEXELS", to.texels)
        .constant("SHOOTERS", from.requests.capacity)
        .bind("surfaces", to.surfaces)
        .bind("requests", from.requests.places)
        .bind("shots", from.shots)
        .bind("fresh", to.fresh);
    e.compute(program, "shoot", Groups::linear(to.texels.div_ceil(BLOCK as u32)));
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

fn shoot_on_host(e: &mut Encoder<'_>, from: port::Shooters, to: port::Lightmap) {
    let counted = |resource, bytes| Read::counted(resource, bytes, from.requests.count);
    let views = e.shooter_views("views").copied();
    let seen = views.map(|views| Read::whole(views.seen));
    let places = [counted(from.requests.places, REQUEST_BYTES), counted(from.shots, size_of::<Shot>() as u64), Read::whole(to.surfaces)];
    let reads: Vec<Read> = places.into_iter().chain(seen).collect();
    e.host("shoot", &reads, &[to.fresh], move |host| {
        let mut fresh = host.take(to.fresh);
        let places: &[Request] = bytemuck::cast_slice(host.read(from.requests.places));
        let shots: &[Shot] = bytemuck::cast_slice(host.read(from.shots));
        let texels: &[TexelSurface] = bytemuck::cast_slice(host.read(to.surfaces));
        let count = host.variable(from.requests.count) as usize;
        let views = views.map(|of| Views { of, seen: bytemuck::cast_slice(host.read(of.seen)), scene: host.scene() });
        let sender = |((place, shot), number): ((&Request, &Shot), u32)| Sender {
            number,
            frame: Frame::new(place.normal.into()).turned(place.turn),
            position: place.position.into(),
            flux: shot.flux.into(),
            luminance: luminance(Vec3::from(shot.flux).as_dvec3()) as f32,
            nearest: shot.nearest,
        };
        let senders: Vec<Sender> = places.iter().zip(shots).take(count).zip(0..).map(sender).collect();
        let range = Range { scene: host.scene(), bvh: host.bvh(), extent: host.extent(), sides: to.sides as usize, senders: &senders, views };
        let blocks = fresh.par_chunks_mut(TOGETHER * range.sides).zip(texels.par_chunks(TOGETHER));
        blocks.for_each_init(ToDo::default, |to_do, (light, texels)| range.light(texels, light, to_do));
        host.put(to.fresh, fresh, u64::MAX);
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

impl Sender {
    /// What it brings to a texel that it sees, and to which of its sides: irradiance [W/m²], and the luminance of what its bound takes; none where that is turned away. No
    /// texel takes more than all that is sent out.
    #[inline(always)]
    fn brings(&self, texel: &TexelSurface, sides: usize) -> Option<(usize, Vec4)> {
        let way = Vec3::from(texel.position) - self.position;
        let leaving = way.dot(self.frame.normal);
        if leaving.is_nan() || leaving <= 0.0 {
            return None;
        }
        let along = -way.dot(texel.normal.into());
        let side = usize::from(along < 0.0);
        if side >= sides || along == 0.0 {
            return None;
        }
        let inverse = 1.0 / way.length_squared();
        let share = leaving * inverse * (along.abs() * inverse);
        let bounded = share * (1.0 / (inverse * self.nearest.max(texel.area * NEAREST))).min(1.0);
        Some((side, (self.flux * bounded).extend(self.luminance * (share - bounded))))
    }
}

/// Whether something is between two points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Between {
    Nothing,
    Something,
    /// A ray has to tell.
    Unknown,
}

/// What shooters see.
struct Views<'a> {
    of: port::ShooterViews,
    seen: &'a [u32],
    scene: &'a Scene,
}

/// How much nearer than a point, as a share of the way, the plane of the triangle seen beside it may be, and be on its surface.
const LEVEL: f32 = 1e-3;

impl Views<'_> {
    /// By the triangle that the nearest sample sees: the point's own, one that the way to the point meets before its end, or one in whose plane it is. Any other tells nothing.
    fn between(&self, sender: &Sender, texel: &TexelSurface) -> Between {
        let way = Vec3::from(texel.position) - sender.position;
        let Some(at) = self.of.shape.sample_at(self.of.resolution, sender.frame.to_local(way)) else { return Between::Unknown };
        let Some(number) = self.seen[self.of.place(sender.number, at)].checked_sub(1) else { return Between::Unknown };
        if number == texel.triangle {
            return Between::Nothing;
        }
        let triangle = &self.scene.triangles[number as usize];
        if self.scene.materials[triangle.material as usize].alpha_cutoff.is_some() {
            return Between::Unknown;
        }
        let [a, b, c] = triangle.positions;
        let (e1, e2, s) = (b - a, c - a, sender.position - a);
        let p = way.cross(e2);
        let determinant = e1.dot(p);
        if determinant == 0.0 {
            return Between::Unknown;
        }
        let q = s.cross(e1);
        let (distance, u, v) = (e2.dot(q) / determinant, s.dot(p) / determinant, way.dot(q) / determinant);
        if (distance - 1.0).abs() < LEVEL {
            Between::Nothing
        } else if distance > LEVEL && distance < 1.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
            Between::Something
        } else {
            Between::Unknown
        }
    }
}

/// What sends light where.
struct Range<'a> {
    scene: &'a Scene,
    bvh: &'a Bvh,
    extent: f32,
    sides: usize,
    senders: &'a [Sender],
    views: Option<Views<'a>>,
}

impl Range<'_> {
    /// The light of all senders at neighbours.
    fn light(&self, texels: &[TexelSurface], light: &mut [Vec4], to_do: &mut ToDo) {
        light.fill(Vec4::ZERO);
        for sender in self.senders {
            self.add(sender, texels, light, to_do);
        }
    }

    fn add(&self, sender: &Sender, texels: &[TexelSurface], light: &mut [Vec4], to_do: &mut ToDo) {
        let mut asked = Asked::NONE;
        for (number, texel) in texels.iter().enumerate() {
            let Some((side, brought)) = sender.brings(texel, self.sides) else { continue };
            let place = number * self.sides + side;
            match self.views.as_ref().map_or(Between::Unknown, |views| views.between(sender, texel)) {
                Between::Nothing => light[place] += brought,
                Between::Something => {}
                Between::Unknown => {
                    let [position, normal] = texel.place(side);
                    asked.push((place, brought), position + normal * surface_offset(self.extent, position));
                    if asked.count == RAYS {
                        self.settle(sender, &mut asked, light, to_do);
                    }
                }
            }
        }
        self.settle(sender, &mut asked, light, to_do);
    }

    /// Adds what rays tell that nothing is before.
    fn settle(&self, sender: &Sender, asked: &mut Asked, light: &mut [Vec4], to_do: &mut ToDo) {
        if asked.count == 0 {
            return;
        }
        asked.rays.all = u64::MAX >> (RAYS - asked.count);
        let from = LightKind::Point { position: sender.position, intensity: Vec3::ONE };
        let hidden = self.bvh.hidden_from(self.scene, self.extent, &from, &mut asked.rays, to_do);
        let free = (0..asked.count).filter(|ray| hidden & 1 << ray == 0);
        free.for_each(|ray| light[asked.places[ray]] += asked.brought[ray]);
        asked.count = 0;
    }
}

/// Texels that rays have to tell of.
struct Asked {
    count: usize,
    rays: ShadowRays,
    places: [usize; RAYS],
    brought: [Vec4; RAYS],
}

impl Asked {
    const NONE: Self = Self { count: 0, rays: ShadowRays { directions: [Vec3::ZERO; RAYS], all: 0 }, places: [0; RAYS], brought: [Vec4::ZERO; RAYS] };

    fn push(&mut self, (place, brought): (usize, Vec4), start: Vec3) {
        self.rays.directions[self.count] = start;
        self.places[self.count] = place;
        self.brought[self.count] = brought;
        self.count += 1;
    }
}
