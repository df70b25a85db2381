//! Ctrl-C: the first asks the work to end cleanly, the second ends the program at once.

use super::failure::{CommandError, Failure};
use std::sync::atomic::{AtomicBool, Ordering};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Listens to Ctrl-C and to the request to terminate, from now on.
pub fn listen() -> Result<(), Failure> {
    let handler = || {
        if REQUESTED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    };
    ctrlc::set_handler(handler).map_err(|error| Failure::work(CommandError::Signal { reason: error.to_string() }))
}

/// Whether the user asked to stop.
pub fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
