//! A lightmap asked for the irradiance anywhere.

use super::texels::{CORNERS, TexelSurface, link};
use crate::contract::{
    Bodies, Description, Encoder, Input, MOST_BYTES, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes, port,
};
use crate::math::{beside::is_beside, colour::luminance};
use crate::schedule::*;
use glam::{IVec2, UVec4, Vec3, Vec4};
use rayon::prelude::*;

pub struct LightmapField;

static DESCRIPTION: Description = Description {
    name: "LightmapField",
    about: "The irradiance at any point of a surface, from a lightmap: between the four texels around it",
    source: "STOCH sections 3.3 and 4",
    parameters: &[
        Parameter {
            name: "smooth",
            about: "how far away texels of the same surface are whose mean each becomes",
            unit: "texels",
            kind: ParameterKind::Integer { default: 1, min: 0, max: 8 },
        },
        PLACE,
    ],
    inputs: &[Input { name: "of", about: "the lightmap", accepts: PortKind::Lightmap, takes: Takes::One, changes: false }],
    outputs: &[Output { name: "field", about: "the irradiance at any point", kind: PortKind::IrradianceField }],
};

impl Pass for LightmapField {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(of) = e.lightmap("of").copied() else { return Ok(()) };
        let first = CORNERS * e.setting.needs.triangles.max(1);
        let bytes = 16 * (u64::from(first) + u64::from(of.edge).pow(2) + u64::from(of.places()));
        if bytes > MOST_BYTES {
            let texels = of.places();
            let told =
                format!("the light of {texels} texels and the corners of {} triangles do not fit into {} MiB", e.setting.needs.triangles, MOST_BYTES >> 20);
            return Err(Refusal::new("plan::lightmap_bytes", told, "halve the `resolution` of the Lightmap"));
        }
        let field = port::LightmapField { data: e.buffer("data", bytes), first, edge: of.edge, sides: of.sides };
        let smooth = e.arguments.integer("smooth") as u32;
        let told = e.buffer("told", 16);
        match e.place(Bodies::BOTH)? {
            Place::Host => lay_out_on_host(e, of, (field, told), smooth),
            Place::Device => lay_out_on_device(e, of, (field, told), smooth),
        }
        e.report("bound_ppm", told, 0);
        e.output("field", Port::IrradianceField(port::IrradianceField::Lightmap(field)));
        Ok(())
    }
}

/// Texels whose light is added up together: `GROUP` of the shader.
const GROUP: u32 = 256;

fn lay_out_on_device(e: &mut Encoder<'_>, of: port::Lightmap, (field, told): (port::LightmapField, Resource), smooth: u32) {
    let groups = of.places().div_ceil(GROUP);
    let sums = e.buffer("sums", 8 * u64::from(groups));
    let program = Program::new("lightmap_field")
        .constant("EDGE", of.edge)
        .constant("SIDES", of.sides)
        .constant("TRIANGLES", e.setting.needs.triangles)
        .constant("FIRST", field.first)
        .constant("SMOOTH", smooth)
        .bind("cells", of.cells)
        .bind("links", of.links)
        .bind("corners", of.corners)
        .bind("surfaces", of.surfaces)
        .bind("mean", of.mean)
        .constant("PLACES", of.places())
        .bind("data", field.data)
        .bind("sums", sums)
        .bind("told", told);
    e.compute(program.clone(), "lay_out_corners", Groups::linear(e.setting.needs.triangles.max(1).div_ceil(64)));
    e.compute(program.clone(), "lay_out_cells", Groups::linear((of.edge * of.edge).div_ceil(64)));
    e.compute(program.clone(), "sum_bound", Groups::linear(groups));
    e.compute(program.clone(), "tell_bound", Groups::ONE);
    e.compute(program, "lay_out_light", Groups::linear(of.places().max(1).div_ceil(64)));
}

fn lay_out_on_host(e: &mut Encoder<'_>, of: port::Lightmap, (field, told): (port::LightmapField, Resource), smooth: u32) {
    let reads = [of.cells, of.links, of.corners, of.surfaces, of.mean].map(Read::whole);
    e.host("lay_out", &reads, &[field.data, told], move |host| {
        let mut data = host.take(field.data);
        let cells: &[[u32; 4]] = bytemuck::cast_slice(host.read(of.cells));
        let corners: &[Vec4] = bytemuck::cast_slice(host.read(of.corners));
        let surfaces: &[TexelSurface] = bytemuck::cast_slice(host.read(of.surfaces));
        let mean: &[Vec4] = bytemuck::cast_slice(host.read(of.mean));
        let (of_triangles, rest) = data.split_at_mut(field.first as usize);
        let (of_cells, light) = rest.split_at_mut(field.lights() - field.first as usize);
        of_triangles.iter_mut().zip(corners).for_each(|(into, corners)| *into = *corners);
        of_cells.iter_mut().zip(cells).for_each(|(into, cell)| *into = UVec4::from(*cell).as_vec4());
        let around =
            Around { cells, links: bytemuck::cast_slice(host.read(of.links)), surfaces, mean, edge: of.edge, sides: of.sides as usize, smooth: smooth as i32 };
        // What lay in its memory before may have been longer.
        light[..of.places() as usize].par_iter_mut().enumerate().for_each(|(place, light)| *light = around.mean_at(place));
        let bound = taken_by_bound(surfaces, mean, of.sides as usize);
        host.put(field.data, data, u64::MAX);
        host.write(told, 0, bytemuck::bytes_of(&bound));
        Ok(())
    });
}

/// What the bound of shots has taken of all light that they would have brought, in millionths of it.
fn taken_by_bound(surfaces: &[TexelSurface], mean: &[Vec4], sides: usize) -> u32 {
    let of_texel = |(surface, light): (&TexelSurface, &[Vec4])| {
        let sum = light.iter().fold([0.0, 0.0], |[brought, taken], light| [brought + luminance(light.truncate().as_dvec3()), taken + f64::from(light.w)]);
        sum.map(|light| light * f64::from(surface.area))
    };
    let [brought, taken] = surfaces.iter().zip(mean.chunks(sides)).map(of_texel).fold([0.0, 0.0], |[a, b], [c, d]| [a + c, b + d]);
    if taken > 0.0 { (1e6 * taken / (brought + taken)).round() as u32 } else { 0 }
}

/// Texels around each other.
struct Around<'a> {
    cells: &'a [[u32; 4]],
    /// Of each texel and side, and the cell.
    links: &'a [[u32; 2]],
    surfaces: &'a [TexelSurface],
    mean: &'a [Vec4],
    edge: u32,
    sides: usize,
    smooth: i32,
}

impl Around<'_> {
    /// The mean irradiance of the texels around one that are on its surface, by their area, and its links; −1 less those where no light has come.
    fn mean_at(&self, place: usize) -> Vec4 {
        let (texel, side) = (place / self.sides, place % self.sides);
        let own = &self.surfaces[texel];
        let (mut sum, mut lit) = (Vec4::ZERO, 0.0);
        for y in -self.smooth..=self.smooth {
            for x in -self.smooth..=self.smooth {
                let Some(other) = self.reached(texel, side, IVec2::new(x, y)) else { continue };
                let surface = &self.surfaces[other];
                if other == texel || is_beside(own.place(side), surface.place(side)) {
                    let (light, area) = (self.mean[other * self.sides + side].truncate(), surface.area);
                    sum += light.extend(1.0) * area;
                    lit += if light == Vec3::ZERO { 0.0 } else { area };
                }
            }
        }
        let links = self.links[place][0] as f32;
        // Rays may have missed by chance what those around have found. What is within something solid has an area of 0.
        if lit > 0.0 { (sum.truncate() / sum.w).extend(links) } else { Vec4::W * (-1.0 - links) }
    }

    /// The texel so many cells away, if nothing is between on the way there, which goes askew first.
    fn reached(&self, mut texel: usize, side: usize, mut way: IVec2) -> Option<usize> {
        while way != IVec2::ZERO {
            let step = way.signum();
            let [links, cell] = self.links[texel * self.sides + side];
            let part = link(links, step.to_array()).checked_sub(1)?;
            let cell = cell as i32 + step.y * self.edge as i32 + step.x;
            texel = (self.cells[cell as usize][0] - 1 + part) as usize;
            way -= step;
        }
        Some(texel)
    }
}
