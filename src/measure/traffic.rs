//! How many bytes nodes move for each tile, as the schedule has it: no caches, every byte that a command touches once.

use crate::contract::Port;
use crate::gpu::{GpuError, shader_of};
use crate::pipeline::Plan;
use crate::schedule::{Command, Compute, Host, Lifetime, Resource, Schedule};
use serde::Serialize;
use std::ops::Add;

/// Bytes of one tile; what all tiles share, such as tables of weights and the scene, is not counted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Traffic {
    /// By the device.
    pub read_bytes: f64,
    /// By the device, and by the host into its memory.
    pub written_bytes: f64,
    /// By the host, from the device's memory.
    pub read_back_bytes: f64,
}

impl Add for Traffic {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            read_bytes: self.read_bytes + other.read_bytes,
            written_bytes: self.written_bytes + other.written_bytes,
            read_back_bytes: self.read_back_bytes + other.read_back_bytes,
        }
    }
}

/// What these nodes move; None where that is not known beforehand, as for rasters, or there are no tiles.
///
/// # Errors
/// A shader that cannot be read.
pub fn traffic(plan: &Plan, nodes: &[&str]) -> Result<Option<Traffic>, GpuError> {
    let Some(tiles) = tiles(plan) else { return Ok(None) };
    let schedule = &plan.schedule;
    let commands = schedule.nodes().into_iter().filter(|node| nodes.contains(&node.name.as_str())).flat_map(|node| &node.commands);
    let all = commands.map(|command| of_command(schedule, command, tiles)).collect::<Result<Option<Vec<_>>, _>>();
    // None of one is None of all.
    Ok(all?.map(|all| all.into_iter().fold(Traffic::default(), Add::add)))
}

/// Tiles of a batch, by which [`traffic`] divides.
pub fn tiles(plan: &Plan) -> Option<f64> {
    plan.ports.values().find_map(|port| if let Port::Tiles(tiles) = port { Some(f64::from(tiles.requests.capacity)) } else { None })
}

fn of_command(schedule: &Schedule, command: &Command, tiles: f64) -> Result<Option<Traffic>, GpuError> {
    let bytes = |resource: Resource| schedule.resource(resource).kind.bytes() as f64 / tiles;
    Ok(match command {
        Command::Clear(resource) => Some(Traffic { written_bytes: bytes(*resource), ..Traffic::default() }),
        Command::Copy { from, to } | Command::CopyToBuffer { from, to, .. } => {
            Some(Traffic { read_bytes: bytes(*from), written_bytes: bytes(*to), ..Traffic::default() })
        }
        Command::CopyLayer { to, .. } => Some(Traffic { read_bytes: bytes(*to), written_bytes: bytes(*to), ..Traffic::default() }),
        Command::Compute(compute) => Some(of_dispatch(schedule, compute, tiles)?),
        Command::Host(host) => Some(of_host(host, &bytes)),
        Command::Late(_) => Some(Traffic::default()),
        Command::Raster(_) => None,
    })
}

fn of_dispatch(schedule: &Schedule, compute: &Compute, tiles: f64) -> Result<Traffic, GpuError> {
    let program = &compute.program;
    let uses = shader_of(program)?.uses(compute.entry);
    let mut traffic = Traffic::default();
    for (name, resource) in &program.bindings {
        if schedule.resource(*resource).lifetime != Lifetime::Transient {
            continue;
        }
        let part = program.parts.iter().find(|(bound, _)| bound == name).map(|(_, bytes)| *bytes);
        let bytes = part.unwrap_or_else(|| schedule.resource(*resource).kind.bytes()) as f64 / tiles;
        let used = uses.iter().find(|used| used.name == *name);
        traffic.read_bytes += if used.is_some_and(|used| used.reads) { bytes } else { 0.0 };
        traffic.written_bytes += if used.is_some_and(|used| used.writes) { bytes } else { 0.0 };
    }
    Ok(traffic)
}

fn of_host(host: &Host, bytes: &dyn Fn(Resource) -> f64) -> Traffic {
    let read_back = |read: &crate::schedule::Read| read.counted.map_or(bytes(read.resource), |(bytes, _)| bytes as f64);
    Traffic {
        read_bytes: 0.0,
        written_bytes: host.writes.iter().map(|resource| bytes(*resource)).sum(),
        read_back_bytes: host.reads.iter().map(read_back).sum(),
    }
}
