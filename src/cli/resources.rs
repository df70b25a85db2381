//! What the system lets this process have, looked at before work starts: drivers and allocators end the process, or wait forever, where they are refused.

use super::failure::{CommandError, Failure};
use super::scene::View;
use crate::pipeline::Plan;
use rayon::ThreadPoolBuilder;
use std::fs;
use std::num::NonZero;
use std::sync::{Arc, Mutex};
use std::thread;

/// What a command needs.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Need {
    Little,
    /// All cores.
    Cores,
    /// All cores, and a driver.
    Driver,
}

/// Threads beside one a core for a driver on the cores of the host: those of a queue and of its caches, and the one that opens it.
const OTHER_THREADS: usize = 4;

/// Threads that share work, at most.
const MOST_THREADS: usize = 1024;

/// More cores than these a driver does not use.
const MOST_DRIVER_THREADS: usize = 32;

/// Address space of a small render: the program, a driver on the cores of the host, its compiler [bytes].
const LEAST_MEMORY: u64 = 1 << 30;

/// Stack of a thread that does nothing [bytes].
const SMALL_STACK: usize = 1 << 14;

/// Starts the threads that share work, fewer where the system grants no more. Refuses to go on where a driver would fail.
pub fn prepare(need: Need) -> Result<(), Failure> {
    if need == Need::Little {
        return Ok(());
    }
    let cores = rayon_threads();
    let wanted = if need == Need::Driver { cores + processors().min(MOST_DRIVER_THREADS) + OTHER_THREADS } else { cores };
    let granted = granted_threads(wanted);
    if need == Need::Driver {
        if granted < wanted {
            return Err(Failure::work(CommandError::FewThreads { granted, wanted }));
        }
        expect_limit(LEAST_MEMORY)?;
    }
    let pool = ThreadPoolBuilder::new();
    let pool = match granted {
        _ if granted >= wanted => pool.num_threads(cores),
        // Threads that have just ended may still count.
        2.. => pool.num_threads(granted / 2),
        _ => pool.num_threads(1).use_current_thread(),
    };
    pool.build_global().map_err(|error| Failure::work(CommandError::NoThreads { reason: error.to_string() }))
}

/// Refuses plans that need more memory than a limit leaves. Without a limit, drivers say themselves what they lack.
pub fn expect_memory<'p>(plans: impl IntoIterator<Item = &'p Arc<Plan>>, view: &View) -> Result<(), Failure> {
    let on_device: u64 = plans.into_iter().map(|plan| plan.memory().total()).sum();
    let [width, height] = view.size.map(u64::from);
    expect_limit(LEAST_MEMORY + on_device * 6 / 5 + 200 * width * height + 1000 * view.stage.scene.triangles.len() as u64)
}

fn expect_limit(wanted: u64) -> Result<(), Failure> {
    match address_space() {
        Some(limit) if limit < wanted => Err(Failure::work(CommandError::LittleMemory { limit: limit >> 20, wanted: wanted >> 20 })),
        _ => Ok(()),
    }
}

/// The limit that `ulimit -v` sets [bytes]; None without one, or where the system does not tell.
fn address_space() -> Option<u64> {
    limit(&fs::read_to_string("/proc/self/limits").ok()?, "Max address space")
}

/// The soft limit of this name.
fn limit(limits: &str, name: &str) -> Option<u64> {
    limits.lines().find_map(|line| line.strip_prefix(name))?.split_whitespace().next()?.parse().ok()
}

fn processors() -> usize {
    thread::available_parallelism().map_or(1, NonZero::get)
}

/// How many threads share work unless told otherwise.
fn rayon_threads() -> usize {
    let asked = std::env::var("RAYON_NUM_THREADS").ok().and_then(|threads| threads.parse().ok());
    asked.filter(|threads| *threads > 0).unwrap_or_else(processors).min(MOST_THREADS)
}

/// How many of so many threads the system lets run at once: all that it does wait until the last is there.
fn granted_threads(wanted: usize) -> usize {
    let gate = Mutex::new(());
    thread::scope(|scope| {
        let closed = gate.lock();
        let start = |_| thread::Builder::new().stack_size(SMALL_STACK).spawn_scoped(scope, || drop(gate.lock())).ok();
        let threads: Vec<_> = (0..wanted).map_while(start).collect();
        drop(closed);
        let granted = threads.len();
        threads.into_iter().for_each(|thread| drop(thread.join()));
        granted
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_as_the_system_writes_them() {
        let limits = "Limit                     Soft Limit           Hard Limit           Units     \n\
            Max address space         409600000            unlimited            bytes     \n\
            Max processes             unlimited            unlimited            processes \n";
        assert_eq!(limit(limits, "Max address space"), Some(409_600_000));
        assert_eq!(limit(limits, "Max processes"), None);
        assert_eq!(limit("", "Max address space"), None);
    }

    #[test]
    fn threads_are_granted_and_end() {
        assert_eq!(granted_threads(7), 7);
    }
}
