//! Which change is on. `benches/mutants` puts this file into the copy of the project that it rewrites.

use std::{
    fs::File,
    io::Write,
    path::Path,
    sync::{
        Mutex, OnceLock,
        atomic::{AtomicBool, AtomicU32, Ordering::Relaxed},
    },
};

/// Not yet read from the environment.
const UNREAD: u32 = u32::MAX;
/// None is on, and what is reached is written down.
const RECORDING: u32 = u32::MAX - 1;
/// None is on.
const NONE: u32 = u32::MAX - 2;

static ON: AtomicU32 = AtomicU32::new(UNREAD);

/// Whether none of `count` changes from `first` on is on.
#[inline(always)]
pub fn off(first: u32, count: u32) -> bool {
    let on = ON.load(Relaxed);
    if on >= RECORDING { rarely(on, first, count) } else { on.wrapping_sub(first) >= count }
}

/// Asked where one change of a place is on, which of them it is.
pub fn on(id: u32) -> bool {
    ON.load(Relaxed) == id
}

#[cold]
#[inline(never)]
fn rarely(on: u32, first: u32, count: u32) -> bool {
    if on == UNREAD {
        let number = std::env::var("MUTANT").ok().and_then(|id| id.parse().ok());
        ON.store(number.unwrap_or(if std::env::var_os("MUTANTS_REACHED").is_some() { RECORDING } else { NONE }), Relaxed);
        return off(first, count);
    }
    record(first);
    true
}

/// Each place once, in a file of this process; written at once, as a test may end in any way.
fn record(first: u32) {
    static SEEN: [AtomicBool; 1 << 14] = [const { AtomicBool::new(false) }; 1 << 14];
    static FILE: OnceLock<Option<Mutex<File>>> = OnceLock::new();
    if SEEN[first as usize].load(Relaxed) || SEEN[first as usize].swap(true, Relaxed) {
        return;
    }
    let open = || {
        let folder = std::env::var_os("MUTANTS_REACHED")?;
        File::create(Path::new(&folder).join(std::process::id().to_string())).ok().map(Mutex::new)
    };
    if let Some(Ok(mut file)) = FILE.get_or_init(open).as_ref().map(Mutex::lock) {
        let _ = file.write_all(format!("{first}\n").as_bytes());
    }
}
