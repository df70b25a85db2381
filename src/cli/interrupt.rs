//! Ctrl-C: ends the program at once, unless there is something to keep. Then the first asks the work to end cleanly, a later one ends it.

use super::failure::{CommandError, Failure};
use std::io::{self, Write};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

static STATE: Mutex<State> = Mutex::new(State { shelters: 0, requested: None, told: "interrupted; nothing was written" });

/// Some wrappers send one interruption twice: to the program and to its group.
const ECHO: Duration = Duration::from_millis(500);

struct State {
    /// How many pieces of work have something to keep.
    shelters: u32,
    requested: Option<Instant>,
    /// What an interruption of work without a shelter says.
    told: &'static str,
}

/// Work that an interruption must not tear apart, while this lives. It has to look at [`requested`], or be short.
pub struct Shelter(());

impl Shelter {
    pub fn new() -> Self {
        state().shelters += 1;
        Self(())
    }
}

impl Drop for Shelter {
    fn drop(&mut self) {
        state().shelters -= 1;
    }
}

fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Listens to Ctrl-C and to the request to terminate, from now on.
pub fn listen() -> Result<(), Failure> {
    ctrlc::set_handler(interrupted).map_err(|error| Failure::work(CommandError::Signal { reason: error.to_string() }))
}

/// The state stays locked to the end: no work starts that would be torn apart.
fn interrupted() {
    let mut state = state();
    if state.shelters == 0 {
        // A closed stderr leaves nobody to tell.
        let _ = writeln!(io::stderr(), "{}", state.told);
        std::process::exit(130);
    }
    if state.requested.get_or_insert_with(Instant::now).elapsed() > ECHO {
        std::process::exit(130);
    }
}

/// From now on, what earlier rounds of the work have written is there.
pub fn keep_earlier() {
    state().told = "interrupted; what earlier rounds wrote is whole";
}

/// Whether the user asked to stop.
pub fn requested() -> bool {
    state().requested.is_some()
}
