//! The sky turned on the host: where the device is a driver on the same cores, its loads from places that differ between lanes take longer than the
//! sums themselves.

use super::{Lobes, Work};
use crate::contract::Encoder;
use crate::math::{
    frame::Frame,
    harmonics::{
        count,
        reflection::quads,
        sky::{LANES, Lanes, Sky},
    },
};
use crate::passes::record::texels;
use crate::schedule::*;
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::f32::consts::TAU;

/// Pixels that are computed as one: rows of a picture would be of any length.
const PIXELS: usize = 4096;

/// What is seen at a pixel.
#[derive(Clone, Copy)]
struct Seen {
    frame: Frame,
    /// To the viewer, in the frame.
    outgoing: Vec3,
    specular: Vec3,
    /// Of the lobe, where there is one.
    table: Option<usize>,
}

pub(super) fn encode(e: &mut Encoder<'_>, work: Work) {
    let [width, height] = work.gbuffer.size;
    let bytes = u64::from(width) * u64::from(height) * 16;
    let [irradiance, glossy] = ["irradiance", "glossy"].map(|name| e.buffer(name, bytes));
    let sky = Sky::new(work.order, &work.sky);
    let (gbuffer, order, lobes) = (work.gbuffer, work.order, work.lobes);
    let mut reads = vec![Read::whole(gbuffer.position), Read::whole(gbuffer.normal)];
    reads.extend(lobes.as_ref().map(|lobes| Read::whole(lobes.seen)));
    e.host("turn", &reads, &[irradiance, glossy], move |host| {
        let eye = host.camera().0.eye;
        let (position, normal) = (texels(host, gbuffer.position), texels(host, gbuffer.normal));
        let seen = lobes.as_ref().map(|lobes| texels(host, lobes.seen));
        let seen_at = |pixel: usize| {
            let [x, y, z, footprint] = position[pixel];
            let [a, b, c, _] = normal[pixel];
            let [red, green, blue, table] = seen.as_ref().map_or([0.0, 0.0, 0.0, -1.0], |seen| seen[pixel]);
            let frame = Frame::new(Vec3::new(a, b, c)).turned(table.fract() * TAU);
            let toward = (eye - Vec3::new(x, y, z)).normalize_or(frame.normal);
            let seen = Seen { frame, outgoing: frame.to_local(toward), specular: Vec3::new(red, green, blue), table: (table >= 0.0).then_some(table as usize) };
            (footprint > 0.0).then_some((pixel, seen))
        };
        let mut sums = vec![[Vec4::ZERO; 2]; position.len()];
        sums.par_chunks_mut(PIXELS).enumerate().for_each(|(chunk, sums)| {
            let first = chunk * PIXELS;
            let surfaces: Vec<(usize, Seen)> = (first..first + sums.len()).filter_map(seen_at).collect();
            let mut room = Room::new(lobes.as_ref(), order);
            for some in surfaces.chunks(LANES) {
                let light = room.light(&sky, lobes.as_ref(), some);
                some.iter().zip(light).for_each(|((pixel, _), light)| sums[pixel - first] = light);
            }
        });
        for (part, buffer) in [irradiance, glossy].into_iter().enumerate() {
            let values: Vec<Vec4> = sums.iter().map(|sums| sums[part]).collect();
            host.write(buffer, 0, bytemuck::cast_slice(&values));
        }
        Ok(())
    });
    let program = Program::new("environment_light")
        .bind("irradiance", irradiance)
        .bind("glossy", glossy)
        .bind("reflectance", gbuffer.reflectance)
        .bind("radiance", work.radiance);
    e.compute_pixels(program, "store", gbuffer.size);
}

/// Memory for the lobes of some places.
struct Room {
    /// Of one place, both parts.
    parts: [Vec<Vec4>; 2],
    flat: Vec<Lanes>,
    rise: Vec<Lanes>,
}

impl Room {
    fn new(lobes: Option<&Lobes>, order: usize) -> Self {
        let length = |is_there: bool| if is_there { count(order) } else { 0 };
        let lanes = |is_there: bool| vec![[0.0; LANES]; length(is_there)];
        Self {
            parts: [vec![Vec4::ZERO; quads(order)], vec![Vec4::ZERO; quads(order)]],
            flat: lanes(lobes.is_some()),
            rise: lanes(lobes.is_some_and(|l| l.rise)),
        }
    }

    /// Irradiance, and what lobes reflect, at up to [`LANES`] places.
    fn light(&mut self, sky: &Sky, lobes: Option<&Lobes>, places: &[(usize, Seen)]) -> [[Vec4; 2]; LANES] {
        // Lanes without a place do as the last one does.
        let places: [Seen; LANES] = std::array::from_fn(|lane| places[lane.min(places.len() - 1)].1);
        if let Some(lobes) = lobes {
            for (lane, place) in places.iter().enumerate() {
                self.look_up(lobes, lane, place);
            }
        }
        let arriving = sky.arriving(&places.map(|place| place.frame), &self.flat, &self.rise);
        let colour = |colours: &[Lanes; 3], lane: usize| Vec3::new(colours[0][lane], colours[1][lane], colours[2][lane]);
        std::array::from_fn(|lane| {
            let glossy = places[lane].specular * colour(&arriving.flat, lane) + colour(&arriving.rise, lane);
            // What the sum makes negative, as sharp things ring, is no light.
            [colour(&arriving.irradiance, lane), glossy].map(|light| light.max(Vec3::ZERO).extend(1.0))
        })
    }

    fn look_up(&mut self, lobes: &Lobes, lane: usize, place: &Seen) {
        let [flat, rise] = &mut self.parts;
        match place.table {
            Some(table) => lobes.tables[table].lookup(place.outgoing, [&mut flat[..], &mut rise[..]]),
            None => [&mut *flat, &mut *rise].into_iter().for_each(|part| part.fill(Vec4::ZERO)),
        }
        for (lanes, part) in [(&mut self.flat, flat), (&mut self.rise, rise)] {
            lanes.iter_mut().zip(part.iter().flat_map(|four| four.to_array())).for_each(|(lanes, value)| lanes[lane] = value);
        }
    }
}
