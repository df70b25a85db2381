//! Loops that the device drives: rounds are encoded ahead, and what is in them is sized where it is counted.

use super::Loop;
use crate::host_struct;
use crate::schedule::*;

host_struct! {
    /// A loop, as `shaders/rounds.wgsl` has it.
    pub struct Rounds {
        /// Where the variable stands that ends the loop, and the one that counts its rounds.
        until: u32,
        round: u32,
        at_most: u32,
        /// Sizes to compute.
        sizes: u32,
        variables: u32,
        padding_a: u32,
        padding_b: u32,
        padding_c: u32,
    }
}

host_struct! {
    /// What a dispatch or a draw is sized by.
    pub struct Sizing {
        /// Workgroups, where nothing counts them.
        groups: [u32; 3],
        /// Where the variable stands that counts, or `UNCOUNTED`.
        count: u32,
        divisor: u32,
        per: u32,
        /// Of a draw; 0 for a dispatch.
        vertices: u32,
        padding: u32,
    }
}

const UNCOUNTED: u32 = u32::MAX;

/// Most dispatches and draws of a round: one lane sizes each.
const MOST_SIZES: usize = 64;

/// Lets the device drive the loops that it can, where that is worth it: waiting for a driver on the cores of the host costs nothing. Returns, by loop, why
/// the host has to drive it.
pub fn drive(schedule: &mut Schedule, device: Device) -> Vec<(String, String)> {
    let (mut steps, mut remarks) = (std::mem::take(&mut schedule.steps), Vec::new());
    drive_level(&mut steps, schedule, device, &mut remarks);
    schedule.steps = steps;
    if schedule.steps.iter().any(is_driven_by_device) {
        // What each variable was last stands behind all of them.
        let words = VARIABLES_BEFORE as usize + 2 * schedule.variables.len();
        let kind = ResourceKind::Buffer { bytes: 4 * words.next_multiple_of(4) as u64 };
        schedule.resources.push(ResourceDescription { name: VARIABLES.into(), kind, lifetime: Lifetime::Variables });
    }
    remarks
}

fn is_driven_by_device(step: &Step) -> bool {
    matches!(step, Step::Repeat(repeat) if repeat.driver != Driver::Host || repeat.steps.iter().any(is_driven_by_device))
}

fn drive_level(steps: &mut [Step], schedule: &mut Schedule, device: Device, remarks: &mut Vec<(String, String)>) {
    for step in steps {
        let repeat = match step {
            // What does not run is not compiled.
            Step::Node(node) => {
                node.commands.iter_mut().for_each(Command::drop_twin);
                continue;
            }
            Step::Repeat(repeat) => repeat,
        };
        let is_worth_it = !device.is_software;
        let obstacle = obstacle(repeat);
        if is_worth_it && obstacle.is_none() {
            drive_by_device(repeat, schedule);
        } else {
            remarks.extend(obstacle.filter(|_| is_worth_it).map(|obstacle| (repeat.name.clone(), format!("the host decides on each round, as {obstacle}"))));
            drive_level(&mut repeat.steps, schedule, device, remarks);
        }
    }
}

/// What keeps the device from driving a loop.
fn obstacle(repeat: &Repeat) -> Option<String> {
    let of_step = |step: &Step| match step {
        Step::Repeat(inner) => Some(format!("`{}` is a loop inside it", inner.name)),
        Step::Node(node) => (!node.commands.iter().all(is_sized_on_device)).then(|| format!("`{}` has a step that the host alone can do", node.name)),
    };
    let is_unended = || repeat.until.is_none().then(|| "nothing there ends it early".to_owned());
    let has_many = || (sizings(repeat).len() > MOST_SIZES).then(|| format!("its rounds have more than {MOST_SIZES} steps"));
    repeat.steps.iter().find_map(of_step).or_else(is_unended).or_else(has_many)
}

/// Whether a command can be sized on the device, so that it does nothing in rounds that are not needed.
fn is_sized_on_device(command: &Command) -> bool {
    match command {
        Command::Compute(_) => true,
        Command::Raster(raster) => {
            matches!(raster.draws, Draws::Instances { .. }) && raster.colours.iter().all(|target| target.clear.is_none()) && raster.depth.is_none()
        }
        Command::Host(host) => host.twin.is_some(),
        Command::Clear(_) | Command::Copy { .. } | Command::CopyToBuffer { .. } | Command::CopyLayer { .. } | Command::Late(_) => false,
    }
}

fn drive_by_device(repeat: &mut Repeat, schedule: &mut Schedule) {
    let Some(until) = repeat.until else { return };
    let sizings = sizings(repeat);
    let place = |variable: Variable| VARIABLES_BEFORE + variable.0;
    let rounds = Rounds {
        until: place(until),
        round: place(repeat.round),
        at_most: repeat.at_most,
        sizes: sizings.len() as u32,
        variables: schedule.variables.len() as u32,
        padding_a: 0,
        padding_b: 0,
        padding_c: 0,
    };
    let mut declare = |member: &str, bytes: u64, lifetime| {
        let name = format!("{}{member}", repeat.name);
        schedule.resources.push(ResourceDescription { name, kind: ResourceKind::Buffer { bytes }, lifetime });
        Resource(schedule.resources.len() as u32 - 1)
    };
    let mut constant = |member: &str, contents: &[u8]| declare(member, contents.len() as u64, Lifetime::Constant(contents.into()));
    let (rounds, sized_by) = (constant(".rounds", bytemuck::bytes_of(&rounds)), constant(".sized_by", bytemuck::cast_slice(&sizings)));
    let sizes = declare(".sizes", 16 * sizings.len() as u64, Lifetime::Transient);
    let program = Program::new("rounds").bind("rounds", rounds).bind("sized_by", sized_by).bind("sizes", sizes);
    let compute = |entry| Command::Compute(Compute { program: program.clone(), entry, groups: Groups::ONE });
    repeat.steps.insert(
        0,
        Step::Node(Node {
            name: repeat.name.clone(),
            pass: Loop::Fill.description().name,
            commands: ["begin", "size", "open", "close"].map(compute).into(),
            keys: Keys::default(),
        }),
    );
    repeat.driver = Driver::Device { sizes };
}

/// Of a round's dispatches and draws, in order.
fn sizings(repeat: &Repeat) -> Vec<Sizing> {
    let commands = repeat.steps.iter().flat_map(|step| if let Step::Node(node) = step { &node.commands[..] } else { &[] });
    commands.flat_map(sizings_of).collect()
}

fn sizings_of(command: &Command) -> Vec<Sizing> {
    let fixed = Sizing { groups: [1; 3], count: UNCOUNTED, divisor: 1, per: 1, vertices: 0, padding: 0 };
    let counted = |count: Variable| Sizing { count: VARIABLES_BEFORE + count.0, ..fixed };
    match command {
        Command::Raster(Raster { draws: Draws::Instances { vertices, count }, .. }) => vec![Sizing { vertices: *vertices, ..counted(*count) }],
        _ => command
            .computes()
            .iter()
            .map(|compute| match compute.groups {
                Groups::Fixed(groups) => Sizing { groups, ..fixed },
                Groups::Counted { count, divisor, per } => Sizing { divisor, per, ..counted(count) },
            })
            .collect(),
    }
}
