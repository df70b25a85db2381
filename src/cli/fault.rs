//! What is left of faults of the program itself: a message in words, and exit status 1.

use super::console::Console;
use super::failure::CommandError;
use crate::gpu::panic_message;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};

/// Runs the program; None where it came upon a fault of its own, which is told.
pub fn guard<T>(console: &Console, run: impl FnOnce() -> T) -> Option<T> {
    let (console, usual) = (*console, take_hook());
    set_hook(Box::new(move |info| {
        let place = info.location().map_or_else(|| "an unknown place".to_owned(), ToString::to_string);
        console.report(&CommandError::Fault { message: panic_message(info.payload()).to_owned(), place });
        if std::env::var_os("RUST_BACKTRACE").is_some() {
            usual(info);
        }
    }));
    catch_unwind(AssertUnwindSafe(run)).ok()
}
