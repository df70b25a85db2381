//! The mean of what iterations have brought.

use crate::contract::{
    Bodies, Choice, Description, Encoder, Input, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes, port,
};
use crate::host_struct;
use crate::schedule::*;
use glam::Vec4;
use rayon::prelude::*;

pub struct Average;

static DESCRIPTION: Description = Description {
    name: "Average",
    about: "Adds an iteration, with what is near, to the mean of all: the light that shots bring by chance becomes the light that there is",
    source: "STOCH formula (2); iterations that are left out or count less: our own",
    parameters: &[
        Parameter {
            name: "warm_up",
            about: "iterations that count no more once there are others: each carries light on by one reflection, and the first have too few",
            unit: "iterations",
            kind: ParameterKind::Integer { default: 8, min: 0, max: 65_536 },
        },
        Parameter {
            name: "weights",
            about: "what iterations count in the mean",
            unit: "",
            kind: ParameterKind::Choice {
                choices: &[
                    Choice { name: "Rising", about: "each more than the one before, as 1, 2, 3: late ones have light of more bounces", parameters: &[] },
                    Choice { name: "Alike", about: "all the same, as formula (2) of the paper has it", parameters: &[] },
                ],
            },
        },
        PLACE,
    ],
    inputs: &[Input { name: "of", about: "the lightmap after an iteration", accepts: PortKind::Lightmap, takes: Takes::One, changes: true }],
    outputs: &[
        Output { name: "lightmap", about: "the lightmap with the mean", kind: PortKind::Lightmap },
        Output { name: "settled", about: "set when there have been as many iterations as the Lightmap asks for", kind: PortKind::Flag },
    ],
};

host_struct! {
    /// What an iteration counts.
    pub struct Share {
        /// Of the mean.
        share: f32,
        padding_a: f32,
        padding_b: f32,
        padding_c: f32,
    }
}

impl Pass for Average {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn stands_for(&self) -> Option<[&'static str; 2]> {
        Some(["of", "lightmap"])
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(of) = e.lightmap("of").copied() else { return Ok(()) };
        let warm_up = e.arguments.integer("warm_up") as u32;
        let rising = e.arguments.choice("weights").0 == "Rising";
        let settled = e.variable("settled", false);
        e.persist("texels", of.mean, size_of::<Vec4>() as u64, of.known);
        e.accumulates(&[of.surfaces, of.direct, of.fresh, of.near, of.mean], &[of.iterations, of.counted, of.rounds, of.known]);
        let count = move |host: &mut dyn HostContext| {
            let [iterations, rounds] = [of.iterations, of.rounds].map(|variable| host.variable(variable).saturating_add(1));
            // What is left of the light of a scene before.
            let remembered = if iterations == 1 { of.remembers } else { u32::MAX };
            let counted = counted(host.variable(of.counted).min(remembered), iterations, warm_up);
            host.set(of.iterations, iterations);
            host.set(of.rounds, rounds);
            host.set(of.counted, counted);
            host.set(of.known, of.places());
            host.set(settled, u32::from(is_settled([iterations, counted], of.wanted, warm_up)));
            share(counted, rising)
        };
        match e.place(Bodies::BOTH)? {
            Place::Host => average_on_host(e, of, count),
            Place::Device => average_on_device(e, of, count),
        }
        e.output("lightmap", Port::Lightmap(of));
        e.output("settled", Port::Flag(settled));
        Ok(())
    }
}

/// As how many iterations the mean counts with one more, of so many since the scene changed: the first count nothing unless there is a mean from before.
fn counted(before: u32, iterations: u32, warm_up: u32) -> u32 {
    if before == 0 && iterations <= warm_up { 0 } else { before.saturating_add(1) }
}

/// Whether so many iterations since the scene changed, or a mean that counts as so many, are as many as are wanted.
fn is_settled([iterations, counted]: [u32; 2], wanted: u32, warm_up: u32) -> bool {
    iterations >= wanted || (counted > 0 && counted.saturating_add(warm_up) >= wanted)
}

/// What the last of so many iterations counts of their mean.
fn share(iterations: u32, rising: bool) -> f32 {
    let iterations = iterations.max(1) as f32;
    if rising { 2.0 / (iterations + 1.0) } else { 1.0 / iterations }
}

fn average_on_host(e: &mut Encoder<'_>, of: port::Lightmap, count: impl Fn(&mut dyn HostContext) -> f32 + Send + Sync + 'static) {
    e.host("average", &[of.fresh, of.near, of.mean].map(Read::whole), &[of.fresh, of.mean], move |host| {
        let share = count(host);
        let [mut fresh, mut mean] = [of.fresh, of.mean].map(|resource| host.take(resource));
        let near: &[Vec4] = bytemuck::cast_slice(host.read(of.near));
        mean.par_iter_mut().zip(&mut fresh).zip(near).for_each(|((mean, fresh), near)| {
            *fresh += *near;
            *mean += (*fresh - *mean) * share;
        });
        host.put(of.fresh, fresh, u64::MAX);
        host.put(of.mean, mean, u64::MAX);
        Ok(())
    });
}

fn average_on_device(e: &mut Encoder<'_>, of: port::Lightmap, count: impl Fn(&mut dyn HostContext) -> f32 + Send + Sync + 'static) {
    let buffer = e.buffer("share", size_of::<Share>() as u64);
    e.host("count", &[], &[buffer], move |host| {
        let share = Share { share: count(host), padding_a: 0.0, padding_b: 0.0, padding_c: 0.0 };
        host.write(buffer, 0, bytemuck::bytes_of(&share));
        Ok(())
    });
    let program = Program::new("average")
        .constant("PLACES", of.places())
        .bind("share_of_mean", buffer)
        .bind("fresh", of.fresh)
        .bind("near", of.near)
        .bind("mean", of.mean);
    e.compute(program, "average", Groups::linear(of.places().div_ceil(64)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_remembered_needs_no_warm_up() {
        let after = |before: u32| (1..=12).fold(before, |counted_before, iterations| counted(counted_before, iterations, 8));
        assert_eq!([after(0), after(4)], [4, 16]);
    }

    #[test]
    fn fewer_iterations_than_warm_up_are_all_made() {
        let made = |wanted: u32| (1..).find(|iterations| is_settled([*iterations, counted(0, *iterations, 8)], wanted, 8));
        assert_eq!([1, 4, 8, 9, 64].map(made), [1, 4, 8, 9, 64].map(Some));
    }

    #[test]
    fn iterations_count_alike_or_as_their_numbers() {
        let mean = |rising| (1..=10).fold(0.0, |mean, iteration| mean + (iteration as f32 - mean) * share(iteration, rising));
        assert!((mean(false) - 5.5).abs() < 1e-5);
        // 385 over 55.
        assert!((mean(true) - 7.0).abs() < 1e-5);
        assert_eq!([share(0, false), share(0, true)], [1.0; 2]);
    }
}
