//! Records that can be asked for the irradiance anywhere, not at pixels alone.

use super::record::{RECORD_BYTES, Record, Weighting};
use super::record_lists::make_lists;
use crate::contract::{Bodies, Description, Encoder, Input, Output, PLACE, Parameter, ParameterKind, Pass, Place, Port, PortKind, Refusal, Takes, port};
use crate::math::{
    colour::luminance,
    record_index::{Cells, HEADER, Layout, Levels, Lists, RECORD_WORDS},
    record_tree::steepest,
    weight,
};
use crate::schedule::*;
use glam::Vec3;

pub struct RecordIndex;

static DESCRIPTION: Description = Description {
    name: "RecordIndex",
    about: "An index over records: estimates the irradiance at any point, by the weights of the splat and only from records level with it",
    source: "Ward 1988; cells of several sizes found by a hash: our own",
    parameters: &[
        Parameter {
            name: "spacing",
            about: "how far a record reaches, in radii of what it was placed for",
            unit: "",
            kind: ParameterKind::Float { default: 1.0, min: 0.1, max: 1000.0 },
        },
        Parameter {
            name: "accuracy",
            about: "a: how much normals may differ, sqrt(1 - n·n_k)",
            unit: "",
            kind: ParameterKind::Float { default: 0.5, min: 0.001, max: 10.0 },
        },
        Parameter {
            name: "remaining",
            about: "`settled` is set where the rounds to come would add less than this share of the light, as far as the last two tell",
            unit: "",
            kind: ParameterKind::Float { default: 0.005, min: 0.0, max: 1.0 },
        },
        Parameter {
            name: "coarser",
            about: "where no record counts, take those that would if they reached three times as far, those past an obstacle last; otherwise there is no light",
            unit: "",
            kind: ParameterKind::Bool { default: true },
        },
        PLACE,
    ],
    inputs: &[Input { name: "of", about: "the records", accepts: PortKind::Records, takes: Takes::One, changes: false }],
    outputs: &[
        Output { name: "index", about: "the index, with the records in it", kind: PortKind::IrradianceField },
        Output { name: "settled", about: "set when another round would not change the records any more", kind: PortKind::Flag },
    ],
};

impl Pass for RecordIndex {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn encode(&self, e: &mut Encoder<'_>) -> Result<(), Refusal> {
        let Some(new) = e.records("of").copied() else { return Ok(()) };
        if new.sees_emission {
            return Err(Refusal::new(
                "plan::emission_twice",
                "the records saw emitters and the sky themselves, whose light the surfaces that are asked about have already",
                "set `emission` of the HemisphereTiles to Never",
            ));
        }
        let rule = rule(e);
        let layout = Layout::of(new.capacity as usize);
        let data = e.buffer("data", 4 * layout.words as u64);
        let index = port::RecordIndex { data, rule, capacity: new.capacity, asked: e.state("asked") };
        let growth = Growth { settled: e.variable("settled", false), sums: e.state("sums"), remaining: e.arguments.float("remaining") };
        let forget = move |host: &mut dyn HostContext| {
            *host.state(growth.sums) = None;
            Ok(())
        };
        e.before_loop(Command::Host(Host::new("forget", Vec::new(), Vec::new(), forget)));
        match e.place(Bodies::BOTH)? {
            Place::Host => build_on_host(e, new, index, growth),
            Place::Device => build_on_device(e, new, index, growth),
        }
        e.output("index", Port::IrradianceField(port::IrradianceField::Records(index)));
        e.output("settled", Port::Flag(growth.settled));
        Ok(())
    }
}

/// Records that stay where they are keep the lists of the first round; each round brings its light.
fn build_on_host(e: &mut Encoder<'_>, new: port::Records, index: port::RecordIndex, growth: Growth) {
    let (layout, coarser) = (Layout::of(index.capacity as usize), e.arguments.bool("coarser"));
    e.host("build", &[Read::counted(new.records, RECORD_BYTES, new.count)], &[index.data], move |host| {
        let records: Vec<Record> = bytemuck::pod_collect_to_vec(host.read(new.records));
        if !new.is_steady || growth.is_first(host) {
            let all: Vec<weight::Record> = records.iter().map(weight::Record::from).collect();
            let reaching: Vec<_> = all.iter().map(|record| index.rule.reaching(record)).collect();
            let far = Lists::of(if coarser { &reaching } else { &[] }, Cells::Far, layout.hashes);
            let near = Lists::of(&reaching, Cells::Near { accuracy: index.rule.accuracy }, layout.near.hashes);
            for (lists, first) in [(far, 0), (near, layout.near.header)] {
                host.write(index.data, 4 * first as u64, bytemuck::cast_slice(&lists.words(records.len())));
            }
        }
        host.write(index.data, 4 * layout.records as u64, bytemuck::cast_slice(&records));
        let light = records.iter().map(|record| luminance(Vec3::from(record.irradiance).as_dvec3())).sum();
        growth.judge(host, light);
        Ok(())
    });
}

/// As shaders/record_index.wgsl does it. Lists are kept as on the host.
fn build_on_device(e: &mut Encoder<'_>, new: port::Records, index: port::RecordIndex, growth: Growth) {
    let layout = Layout::of(index.capacity as usize);
    let weighting = e.constant_buffer("weighting", bytemuck::bytes_of(&Weighting::from(&index.rule)));
    let light = e.buffer("light", 16);
    let [lists, listed] = ["lists", "listed"].map(|name| e.variable(name, false));
    if new.is_steady {
        e.before_loop(Command::Clear(index.data))
    } else {
        e.clear(index.data)
    }
    e.host("begin", &[], &[index.data], move |host| {
        let (count, is_new) = (host.variable(new.count), !new.is_steady || growth.is_first(host));
        host.set(lists, u32::from(is_new));
        host.set(listed, if is_new { count } else { 0 });
        for (first, hashes) in [(0, layout.hashes), (layout.near.header, layout.near.hashes)].into_iter().filter(|_| is_new) {
            host.write(index.data, 4 * first as u64, bytemuck::cast_slice(&Levels::NONE.header(hashes, count)));
        }
        Ok(())
    });
    let program = Program::new("record_index")
        .constant("INDEX_RECORDS", layout.records as u32)
        .constant("STEEPEST", steepest(index.rule.accuracy))
        .bind("weighting", weighting)
        .bind("records", new.records)
        .bind("words", index.data)
        .bind("light", light);
    let far = program.clone().constant("INDEX_ENTRIES", layout.entries as u32);
    let near = program.clone().constant("INDEX_LISTS", layout.near.header as u32).constant("INDEX_ENTRIES", layout.near.entries as u32).constant("NEAR", 1);
    if e.arguments.bool("coarser") {
        make_lists(e, far, (index.data, HEADER, layout.hashes), [lists, listed]);
    }
    make_lists(e, near, (index.data, layout.near.header + HEADER, layout.near.hashes), [lists, listed]);
    e.compute(program.clone(), "keep_records", Groups::Counted { count: new.count, divisor: 64, per: 1 });
    e.compute(program, "add_light", Groups::ONE);
    e.host("judge", &[Read::whole(light)], &[], move |host| {
        let light = bytemuck::pod_read_unaligned::<f32>(&host.read(light)[..4]);
        growth.judge(host, light.into());
        Ok(())
    });
}

const _: () = assert!(RECORD_BYTES == 4 * RECORD_WORDS as u64);

/// How the light of the records grows from round to round, and the flag that is set when it does not any more.
#[derive(Clone, Copy)]
struct Growth {
    settled: Variable,
    /// Sums over the records, of each round so far.
    sums: Resource,
    remaining: f64,
}

impl Growth {
    /// Whether no round has been judged yet.
    fn is_first(&self, host: &mut dyn HostContext) -> bool {
        host.state(self.sums).is_none()
    }

    fn judge(&self, host: &mut dyn HostContext, light: f64) {
        let before = host.state(self.sums).take().and_then(|sums| sums.downcast::<Vec<f64>>().ok()).map_or_else(Vec::new, |sums| *sums);
        let sums: Vec<f64> = before.into_iter().chain([light]).collect();
        host.set(self.settled, u32::from(to_come(&sums) <= self.remaining * light));
        *host.state(self.sums) = Some(Box::new(sums));
    }
}

/// Whatever is seen from a record, it stands for the places that it was put there for.
fn rule(e: &Encoder<'_>) -> port::Rule {
    let spacing = e.arguments.float("spacing") as f32;
    port::Rule {
        weighting: port::Weighting::Compact,
        accuracy: e.arguments.float("accuracy") as f32,
        spacing: [spacing; 2],
        nearest: 1e6,
        change: 1e6,
        overlap: 0.0,
        contrast: 1e6,
        finest_spacing: spacing,
    }
}

/// What the rounds to come would add to the last of these sums: a geometric series, as each round adds what surfaces reflect of what the round before has added.
fn to_come(sums: &[f64]) -> f64 {
    match sums {
        [.., before, last, now] if now > last => {
            let [earlier, later] = [last - before, now - last];
            let ratio = if earlier > 0.0 { later / earlier } else { 1.0 };
            if ratio < 1.0 { later * ratio / (1.0 - ratio) } else { f64::INFINITY }
        }
        [.., last, now] if now <= last => 0.0,
        [.., 0.0] => 0.0,
        _ => f64::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_to_come_is_a_geometric_series() {
        let sums: Vec<f64> = (1..=6)
            .scan(0.0, |sum, round| {
                *sum += 3.0 * 0.5f64.powi(round);
                Some(*sum)
            })
            .collect();
        for rounds in 3..=6 {
            assert!((sums[rounds - 1] + to_come(&sums[..rounds]) - 3.0).abs() < 1e-12);
        }
        assert_eq!([to_come(&[]), to_come(&[1.0]), to_come(&[1.0, 2.0])], [f64::INFINITY; 3]);
        // In the dark, at rest, and where each round brings as much as the one before.
        assert_eq!([to_come(&[0.0]), to_come(&[2.0, 2.0]), to_come(&[1.0, 2.0, 2.0])], [0.0; 3]);
        assert_eq!(to_come(&[1.0, 2.0, 3.0]), f64::INFINITY);
    }
}
