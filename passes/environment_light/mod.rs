//! Light of the sky, by harmonics.

mod host;

use crate::contract::{
    Arguments, Bodies, Description, Encoder, Input, Need, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes, port,
};
use crate::math::harmonics::{
    MOST,
    reflection::{LobeTable, PARTS, quads},
    sky,
};
use crate::passes::record::{lobe_bytes, table_places};
use crate::scene::{Environment, needs::Needs};
use crate::schedule::*;
use glam::{DVec3, Vec4};

pub struct EnvironmentLight;

static DESCRIPTION: Description = Description {
    name: "EnvironmentLight",
    about: "Light of the sky that the visible surfaces reflect, as if nothing stood in its way: the dot product of expansions in harmonics",
    source: "THESIS 3.5.3",
    parameters: &[
        Parameter {
            name: "order",
            about: "how many degrees of the sky's spherical harmonics are kept: n take n² coefficients",
            unit: "",
            kind: ParameterKind::Integer { default: 10, min: 1, max: MOST as i64 },
        },
        PLACE,
    ],
    inputs: &[
        Input { name: "gbuffer", about: "the visible surfaces", accepts: PortKind::GBuffer, takes: Takes::One, changes: false },
        Input { name: "lobes", about: "the lobes of the glossy ones among them", accepts: PortKind::VisibleLobes, takes: Takes::AtMostOne, changes: false },
    ],
    outputs: &[Output { name: "radiance", about: "radiance of the sky that is reflected toward the camera", kind: PortKind::Image }],
};

/// What both ways start from.
struct Work {
    gbuffer: port::GBuffer,
    order: usize,
    /// The sky in red, green and blue.
    sky: [Vec<f64>; 3],
    lobes: Option<Lobes>,
    radiance: Resource,
}

struct Lobes {
    /// [`port::VisibleLobes::seen`].
    seen: Resource,
    /// In spherical harmonics of the sky's order: to convert the sky's to those of a lobe is linear, so it is done to the lobes, once.
    tables: Vec<LobeTable>,
    /// Whether any of them has a second part.
    rise: bool,
}

impl Lobes {
    fn new(visible: &port::VisibleLobes, order: usize) -> Result<Self, Refusal> {
        let tables: Vec<LobeTable> = visible.lobes.on_host()?.iter().map(|table| table.in_spherical(order)).collect();
        let mut second = tables.iter().flat_map(|table| table.values.chunks(quads(order)).skip(1).step_by(PARTS).flatten());
        let rise = second.any(|four| *four != Vec4::ZERO);
        Ok(Self { seen: visible.seen, tables, rise })
    }
}

impl Pass for EnvironmentLight {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn need(&self, _arguments: &Arguments, needs: &Needs) -> Need {
        if needs.environment { Need::Kept } else { Need::Dropped("the scene has no sky") }
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(gbuffer) = e.g_buffer("gbuffer").copied() else { return Ok(()) };
        let order = e.arguments.integer("order") as usize;
        let lobes = e.visible_lobes("lobes").map(|visible| Lobes::new(visible, order)).transpose()?;
        if lobes.is_none() && e.setting.needs.lobes {
            return Err(port::Lobes::missing());
        }
        let radiance = e.image("radiance", gbuffer.size, Format::Rgba32Float);
        let work = Work { gbuffer, order, sky: expansion(&e.setting.scene.environment, order), lobes, radiance };
        match e.place(Bodies::BOTH)? {
            Place::Host => host::encode(e, work),
            Place::Device => encode_on_device(e, &work),
        }
        e.output("radiance", Port::Image(port::Image { texture: radiance, channels: port::Channels::Colour }));
        Ok(())
    }
}

fn encode_on_device(e: &mut Encoder<'_>, work: &Work) {
    let order = work.order;
    let numbers = |values: &[f64]| values.iter().map(|value| *value as f32).collect::<Vec<_>>();
    let [red, green, blue] = work.sky.each_ref().map(|values| numbers(values));
    let sky: Vec<Vec4> = red.into_iter().zip(green).zip(blue).map(|((r, g), b)| Vec4::new(r, g, b, 0.0)).collect();
    let sky = e.constant_buffer("sky", bytemuck::cast_slice(&sky));
    let cosine_lobe = e.constant_buffer("cosine_lobe", bytemuck::cast_slice(&numbers(&sky::cosine_lobe(order))));
    let quarter_turns = e.constant_buffer("quarter_turns", bytemuck::cast_slice(&numbers(&sky::quarter_turn(order))));
    let tables: &[LobeTable] = work.lobes.as_ref().map_or(&[], |lobes| &lobes.tables);
    let values = e.constant_buffer("lobes", &lobe_bytes(tables));
    let edge = tables.first().map_or(1, |table| table.edge);
    let places = e.constant_buffer("lobe_places", bytemuck::cast_slice(&table_places(&vec![order as u32; tables.len()], edge)));
    // Lobes that are absent are bound to any image and never read.
    let program = Program::new("environment_light")
        .constant("GLOSSY", work.lobes.is_some() as u8)
        .constant("ORDER", order as u32)
        .constant("GRID", edge as u32)
        .constant("RISE", work.lobes.as_ref().is_some_and(|lobes| lobes.rise) as u8)
        .bind("position", work.gbuffer.position)
        .bind("normal", work.gbuffer.normal)
        .bind("reflectance", work.gbuffer.reflectance)
        .bind("seen", work.lobes.as_ref().map_or(work.gbuffer.position, |lobes| lobes.seen))
        .bind("sky", sky)
        .bind("cosine_lobe", cosine_lobe)
        .bind("quarter_turns", quarter_turns)
        .bind("lobes", values)
        .bind("lobe_places", places)
        .bind("radiance", work.radiance);
    e.compute_pixels(program, "shade", work.gbuffer.size);
}

/// Cells along the meridian and the equator at least: what lies between them is met by neighbours that are nearly alike.
const LEAST_CELLS: usize = 256;

/// The sky in red, green and blue; the pole of the harmonics is up, their azimuth goes from z to x.
fn expansion(environment: &Environment, order: usize) -> [Vec<f64>; 3] {
    let size = match environment {
        Environment::Constant(_) => [LEAST_CELLS; 2],
        Environment::LatLong { width, height, .. } => [*height, *width].map(|side| LEAST_CELLS.max(side as usize)),
    };
    sky::project(order, size, |polar, azimuth| {
        let direction = DVec3::new(polar.sin() * azimuth.sin(), polar.cos(), polar.sin() * azimuth.cos());
        environment.radiance(direction.as_vec3()).as_dvec3()
    })
}
