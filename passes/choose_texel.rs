//! Texels that send their light out, chosen by chance: the brighter and the larger, the more often.
//!
//! What a texel would send out becomes a whole number, so that sums over texels are exact in whatever order: a running sum on the host, a descent through sums of four
//! and a search among sums of all before find the same texel by the same number. A texel that shines at all counts 1 at least, and whatever a texel counts, its light is
//! divided by how often it is chosen: nothing is lost by rounding.

use super::texels::{self, NEAREST, Shot, TexelSurface, radiance};
use super::{prefix_sum, record};
use crate::contract::{
    Bodies, Choice, Description, Encoder, Input, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes, port,
};
use crate::host_struct;
use crate::math::{
    colour::luminance,
    random::{combine, hash},
};
use crate::passes::record::Request;
use crate::schedule::*;
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::f32::consts::PI;

pub struct ChooseTexel;

static DESCRIPTION: Description = Description {
    name: "ChooseTexel",
    about: "Chooses texels of a lightmap by chance, by the luminance of what they reflect times their area",
    source: "STOCH section 3.1; sums of whole numbers, and one choice from each part of the light: our own",
    parameters: &[
        Parameter {
            name: "shooters",
            about: "texels of an iteration, each from another part of all light; the paper has 1",
            unit: "texels",
            kind: ParameterKind::Integer { default: 512, min: 1, max: 4096 },
        },
        Parameter {
            name: "by",
            about: "how the texel is found that a number stands for; all find the same",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Auto", about: "a running sum where the host keeps the light, otherwise a descent through mipmaps", parameters: &[] },
                    Choice { name: "RunningSum", about: "what texels count is read back, and added up on the host", parameters: &[] },
                    Choice { name: "Mipmap", about: "the device adds each four texels up to one, and goes down from the last", parameters: &[] },
                    Choice { name: "PrefixSum", about: "the device adds up all before each texel, and halves the list until it is found", parameters: &[] },
                ],
            },
        },
        Parameter {
            name: "sends",
            about: "which light the texels send out, beside direct light",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Last", about: "what the last iteration brought", parameters: &[] },
                    Choice {
                        name: "Mean",
                        about: "the mean of all, as formula (2) of the paper has it: that comes near the light as a power of the iterations",
                        parameters: &[],
                    },
                ],
            },
        },
        Parameter {
            name: "favours",
            about: "by what texels are chosen, times their area",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice {
                        name: "Root",
                        about: "the root of the luminance that they reflect: a dark room beside a bright one is chosen as well",
                        parameters: &[],
                    },
                    Choice { name: "Light", about: "that luminance, as the paper has it", parameters: &[] },
                ],
            },
        },
        Parameter {
            name: "bound",
            about: "how much of all light of a hemisphere one shot of all may bring a surface at most: 1 for as much as its texel has; what that takes, GatherNear brings",
            unit: "",
            kind: ParameterKind::Float { default: 0.1, min: 1e-3, max: 1e6 },
        },
        PLACE,
    ],
    inputs: &[Input { name: "of", about: "the lightmap", accepts: PortKind::Lightmap, takes: Takes::One, changes: false }],
    outputs: &[Output { name: "shooters", about: "where they are, and what they send out", kind: PortKind::Shooters }],
};

host_struct! {
    /// A texel that was chosen on the host.
    pub struct Pick {
        place: u32,
        /// What it counts, and what all do.
        number: u32,
        total: u32,
        padding: u32,
    }
}

host_struct! {
    /// What an iteration is made by.
    pub struct Iteration {
        /// Of its numbers.
        seed: u32,
        padding_a: u32,
        padding_b: u32,
        padding_c: u32,
    }
}

impl Pass for ChooseTexel {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(of) = e.lightmap("of").copied() else { return Ok(()) };
        let count = e.arguments.integer("shooters") as u32;
        let requests = record::requests(e, count);
        let shots = e.buffer("shots", size_of::<Shot>() as u64 * u64::from(count));
        let sends_mean = e.arguments.choice("sends").0 == "Mean";
        let light = if sends_mean { of.mean } else { of.fresh };
        // Of all shots that there are to be.
        let nearest = e.arguments.float("bound").recip() as f32 / (PI * count as f32 * of.wanted as f32);
        let favour = if e.arguments.choice("favours").0 == "Light" { port::Favour::Light } else { port::Favour::Root };
        let shooters = port::Shooters { requests, shots, nearest, favour, sends_mean };
        let choosing = Choosing { of, light, shooters };
        let by = e.arguments.choice("by").0;
        let on_device = matches!(by, "Mipmap" | "PrefixSum");
        let place = e.place(Bodies::BOTH.unless(on_device, "the device is to find the texels"))?;
        match (by, place) {
            ("Auto" | "RunningSum", Place::Host) => choosing.encode_on_host(e),
            _ => choosing.encode_on_device(e, by),
        }
        e.output("shooters", Port::Shooters(shooters));
        Ok(())
    }
}

#[derive(Clone, Copy)]
struct Choosing {
    of: port::Lightmap,
    /// What the texels send out of indirect light.
    light: Resource,
    shooters: port::Shooters,
}

impl Choosing {
    fn encode_on_host(self, e: &mut Encoder<'_>) {
        let (shooters, count) = (self.shooters, self.shooters.requests.capacity);
        let port::Lightmap { surfaces, direct, .. } = self.of;
        let reads = [surfaces, direct, self.light].map(Read::whole);
        e.host("choose", &reads, &[shooters.requests.places, shooters.shots], move |host| {
            let texels: &[TexelSurface] = bytemuck::cast_slice(host.read(surfaces));
            let [direct, light]: [&[Vec4]; 2] = [direct, self.light].map(|resource| bytemuck::cast_slice(host.read(resource)));
            let sides = self.of.sides as usize;
            let weights: Vec<f32> = texels
                .par_iter()
                .enumerate()
                .flat_map_iter(|(at, texel)| (at * sides..(at + 1) * sides).map(move |place| weight(direct[place], light[place], texel.area, shooters.favour)))
                .collect();
            let numbers = counted(&weights);
            let picks = picked(&numbers, count, seed(host.variable(self.of.rounds)));
            let chosen = picks.iter().map(|pick| {
                let place = pick.place as usize;
                let texel = &texels[place / sides];
                let position = Vec3::from(texel.position);
                let face = host.scene().triangles[texel.triangle as usize].face_normal();
                let normal = if place.is_multiple_of(sides) { face } else { -face };
                let stands_for = texel.area * (pick.total as f32 / pick.number as f32);
                let flux = radiance(direct[place], light[place]) * (stands_for / count as f32);
                (
                    Request::new(position, texel.area.sqrt(), normal, 0.0),
                    Shot {
                        position: texel.position,
                        nearest: (stands_for * shooters.nearest).max(texel.area * NEAREST),
                        normal: normal.into(),
                        stands_for,
                        flux: flux.into(),
                        padding: 0,
                    },
                )
            });
            let (places, shots): (Vec<Request>, Vec<Shot>) = chosen.unzip();
            host.write(shooters.requests.places, 0, bytemuck::cast_slice(&places));
            host.write(shooters.shots, 0, bytemuck::cast_slice(&shots));
            host.set(shooters.requests.count, places.len() as u32);
            host.set(shooters.requests.made, places.len() as u32);
            Ok(())
        });
    }

    fn encode_on_device(self, e: &mut Encoder<'_>, by: &str) {
        let (of, shooters) = (self.of, self.shooters);
        let (places, count) = (of.places(), shooters.requests.capacity);
        let groups = places.div_ceil(GROUP);
        let levels = Levels::of(places);
        let numbers = e.buffer("numbers", 4 * u64::from(levels.all()));
        let weights = e.buffer("weights", 4 * u64::from(places));
        let sums = e.buffer("sums", 4 * u64::from(groups + 1));
        let iteration = e.buffer("iteration", size_of::<Iteration>() as u64);
        e.host("begin", &[], &[iteration], move |host| {
            let iteration_now = Iteration { seed: seed(host.variable(of.rounds)), padding_a: 0, padding_b: 0, padding_c: 0 };
            host.write(iteration, 0, bytemuck::bytes_of(&iteration_now));
            host.set(shooters.requests.count, count);
            host.set(shooters.requests.made, count);
            Ok(())
        });
        let program = Program::new("choose_texel")
            .constant("SIDES", of.sides)
            .constant("PLACES", places)
            .constant("SHOOTERS", count)
            .constant("NEAREST", shooters.nearest)
            .constant("ROOT", (shooters.favour == port::Favour::Root) as u8)
            .bind("surfaces", of.surfaces)
            .bind("direct", of.direct)
            .bind("light", self.light)
            .bind("weights", weights)
            .bind("sums", sums)
            .bind("numbers", numbers)
            .bind("iteration", iteration)
            .bind("requests", shooters.requests.places)
            .bind("shots", shooters.shots);
        e.compute(program.clone(), "weigh", Groups::linear(groups));
        e.compute(program.clone(), "scale", Groups::ONE);
        e.compute(program.clone(), "count", Groups::linear(groups));
        let each = Groups::linear(count.div_ceil(GROUP));
        match by {
            "PrefixSum" => {
                prefix_sum::encode(e, numbers, 0, places + 1, None);
                e.compute(program, "search", each);
            }
            "RunningSum" => {
                let picks = e.buffer("picks", size_of::<Pick>() as u64 * u64::from(count));
                e.host("add_up", &[Read::whole(numbers)], &[picks], move |host| {
                    let numbers: &[u32] = &bytemuck::cast_slice(host.read(numbers))[..places as usize];
                    let mut found = picked(numbers, count, seed(host.variable(of.rounds)));
                    found.resize(count as usize, Pick { place: 0, number: 0, total: 0, padding: 0 });
                    host.write(picks, 0, bytemuck::cast_slice(&found));
                    Ok(())
                });
                e.compute(program.bind("picks", picks), "take", each);
            }
            _ => {
                for [start, below, above] in levels.steps() {
                    let program = program.clone().constant("START", start).constant("BELOW", below).constant("ABOVE", above);
                    e.compute(program, "add_four", Groups::linear(above.div_ceil(GROUP)));
                }
                e.compute(program.constant("LEVELS", levels.count()), "descend", each);
            }
        }
    }
}

/// Invocations of a group: `GROUP` of the shader.
const GROUP: u32 = 256;

/// Sums of four over places, and of four of these, up to one: how many each level has, each behind the one below it.
struct Levels(Vec<u32>);

impl Levels {
    fn of(places: u32) -> Self {
        let above = |size: &u32| (*size > 1).then(|| size.div_ceil(4));
        Self(std::iter::successors(Some(places), above).collect())
    }

    /// Above the places.
    fn count(&self) -> u32 {
        self.0.len() as u32 - 1
    }

    /// Of all levels, and one more for sums of all before a place.
    fn all(&self) -> u32 {
        self.0.iter().sum::<u32>() + 1
    }

    /// Where each level's numbers start, how many they are, and how many they become.
    fn steps(&self) -> impl Iterator<Item = [u32; 3]> {
        let starts = self.0.iter().scan(0, |start, size| Some(std::mem::replace(start, *start + size)));
        starts.zip(self.0.windows(2)).map(|(start, sizes)| [start, sizes[0], sizes[1]])
    }
}

/// Of the choices of an iteration, which have nothing to do with those before: what texels send out depends on these.
fn seed(iteration: u32) -> u32 {
    hash(iteration.wrapping_mul(2) + 1)
}

/// By what a texel is chosen.
fn weight(direct: Vec4, light: Vec4, area: f32, favour: port::Favour) -> f32 {
    texels::favour(luminance(radiance(direct, light).as_dvec3()) as f32, favour) * area
}

/// What each texel counts: all together less than 2³¹.
fn counted(weights: &[f32]) -> Vec<u32> {
    let sum: f64 = weights.par_chunks(4096).map(|weights| weights.iter().map(|weight| f64::from(*weight)).sum::<f64>()).collect::<Vec<_>>().iter().sum();
    let scale = if sum > 0.0 { (29.0 - sum.log2().floor()).exp2() as f32 } else { 0.0 };
    weights.par_iter().map(|weight| if *weight > 0.0 { ((weight * scale) as u32).max(1) } else { 0 }).collect()
}

/// One place from each of so many equal parts of all that places count; none where nothing counts.
fn picked(numbers: &[u32], parts: u32, seed: u32) -> Vec<Pick> {
    let sums = running_sums(numbers);
    let total = sums.last().copied().unwrap_or(0);
    let pick = |part| {
        let place = place_of(&sums, number_in(part, parts, total, seed));
        Pick { place: place as u32, number: numbers[place], total, padding: 0 }
    };
    if total == 0 { Vec::new() } else { (0..parts).map(pick).collect() }
}

/// Of all up to each.
fn running_sums(numbers: &[u32]) -> Vec<u32> {
    let add = |sum: &mut u32, number: &u32| {
        *sum += number;
        Some(*sum)
    };
    numbers.iter().scan(0, add).collect()
}

/// Where the sum goes beyond a number.
fn place_of(sums: &[u32], number: u32) -> usize {
    sums.partition_point(|sum| *sum <= number)
}

/// A whole number below `total` by chance, from one of so many equal parts.
fn number_in(part: u32, parts: u32, total: u32, seed: u32) -> u32 {
    let (each, rest) = (total / parts, total % parts);
    let width = each + u32::from(part < rest);
    let within = (u64::from(combine(seed, part)) * u64::from(width)) >> 32;
    part * each + part.min(rest) + within as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_all_levels_have_room() {
        assert_eq!(Levels::of(1).steps().count(), 0);
        for places in [2, 4, 5, 1000, 1 << 22] {
            let levels = Levels::of(places);
            let [start, below, above] = levels.steps().last().unwrap();
            assert_eq!((above, start + below + above + 1), (1, levels.all()));
            assert_eq!(levels.steps().count() as u32, levels.count());
        }
    }

    #[test]
    fn what_shines_counts_and_what_does_not_counts_nothing() {
        let mut weights = vec![1e-12f32; 1 << 20];
        weights[77] = 0.0;
        weights[99] = 3.0;
        let numbers = counted(&weights);
        assert_eq!((numbers[77], numbers[0]), (0, 1));
        let total: u64 = numbers.iter().map(|number| u64::from(*number)).sum();
        assert!((1 << 29..1u64 << 31).contains(&total), "{total}");
        assert!(counted(&[0.0; 16]).iter().all(|number| *number == 0));
        assert!(picked(&[0; 16], 4, 7).is_empty());
    }

    /// The sum of squares of what bins are off by over what they should hold, as standard deviations from its mean.
    fn off(found: &[f64], wanted: &[f64]) -> f64 {
        let squares: f64 = found.iter().zip(wanted).filter(|(_, wanted)| **wanted > 0.0).map(|(found, wanted)| (found - wanted).powi(2) / wanted).sum();
        let freedom = wanted.iter().filter(|wanted| **wanted > 0.0).count() as f64 - 1.0;
        // Wilson and Hilferty: its cube root is nearly normal.
        let spread = 2.0 / (9.0 * freedom);
        ((squares / freedom).cbrt() - (1.0 - spread)) / spread.sqrt()
    }

    const TEXELS: usize = 1_000_000;

    /// Alike, with one that has half of all, and with some that have nothing.
    fn maps() -> [Vec<f32>; 3] {
        let alike = vec![0.25; TEXELS];
        let mut peaked = vec![0.001; TEXELS];
        peaked[600_000] = 0.001 * TEXELS as f32;
        let mut holes: Vec<f32> = (0..TEXELS).map(|at| at as f32).collect();
        (0..TEXELS / 2).for_each(|at| holes[2 * at] = 0.0);
        [alike, peaked, holes]
    }

    #[test]
    fn texels_are_chosen_as_often_as_they_shine() {
        const DRAWS: u32 = 1_000_000;
        const BINS: usize = 1000;
        let bin = |place: usize| place * BINS / TEXELS;
        for weights in maps() {
            let sums = running_sums(&counted(&weights));
            let total = *sums.last().unwrap();
            let sum: f64 = weights.iter().map(|power| f64::from(*power)).sum();
            let mut wanted = vec![0.0; BINS];
            (0..).zip(&weights).for_each(|(place, power)| wanted[bin(place)] += f64::from(DRAWS) * f64::from(*power) / sum);
            (0..20).into_par_iter().for_each(|first| {
                let mut found = vec![0.0; BINS];
                let places = (0..DRAWS).map(|draw| place_of(&sums, number_in(0, 1, total, hash(first * DRAWS + draw))));
                places.for_each(|place| {
                    assert!(weights[place] > 0.0);
                    found[bin(place)] += 1.0;
                });
                let off = off(&found, &wanted);
                // p within 0.0005 and 0.9995.
                assert!(off.abs() < 3.3, "{off}");
            });
        }
    }

    #[test]
    fn each_part_of_the_light_is_chosen_once() {
        let numbers = [10, 0, 30, 20, 40];
        for seed in 0..100 {
            let picks: Vec<u32> = picked(&numbers, 10, seed).iter().map(|pick| pick.place).collect();
            assert_eq!(picks, [0, 2, 2, 2, 3, 3, 4, 4, 4, 4]);
        }
        // Seven parts of a hundred: two of 15, then five of 14.
        let ends = [15, 30, 44, 58, 72, 86, 100];
        for (part, end) in (0..).zip(ends) {
            let found = number_in(part, 7, 100, 3);
            assert!((end - 15..end).contains(&found), "{part}: {found}");
        }
    }
}
