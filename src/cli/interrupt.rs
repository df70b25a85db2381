//! Ctrl-C: the first asks the work to end cleanly, a later one ends the program at once.

use super::failure::{CommandError, Failure};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

static REQUESTED: OnceLock<Instant> = OnceLock::new();

/// Some wrappers send one interruption twice: to the program and to its group.
const ECHO: Duration = Duration::from_millis(500);

/// Listens to Ctrl-C and to the request to terminate, from now on.
pub fn listen() -> Result<(), Failure> {
    let handler = || {
        if REQUESTED.get_or_init(Instant::now).elapsed() > ECHO {
            std::process::exit(130);
        }
    };
    ctrlc::set_handler(handler).map_err(|error| Failure::work(CommandError::Signal { reason: error.to_string() }))
}

/// Whether the user asked to stop.
pub fn requested() -> bool {
    REQUESTED.get().is_some()
}
