//! What a test needs of the machine. Where that is missing the test is ignored, so that it counts as such, and a line names it with the reason.
//! `HEMISPLAT_REQUIRE` lists the needs that make it fail instead: gpu, scenes, browser, wasm, peers, tools, adapter. `./check` collects the lines.
#![allow(dead_code, reason = "each file of tests has needs of its own")]

use libtest_mimic::{Failed, Trial};

/// What is not there, and why.
#[derive(Debug, Clone)]
pub struct Missing {
    /// As `HEMISPLAT_REQUIRE` calls it.
    what: &'static str,
    why: String,
}

impl Missing {
    pub fn new(what: &'static str, why: impl Into<String>) -> Self {
        Self { what, why: why.into() }
    }

    /// An adapter on which all of hemisplat runs.
    pub fn gpu() -> Option<Self> {
        let there = hemisplat::block_on(hemisplat::gpu::device::adapters()).iter().any(|adapter| adapter.lacks.is_empty());
        (!there).then(|| Self::new("gpu", "no GPU adapter"))
    }

    /// The scenes that are no part of the project.
    pub fn scenes() -> Option<Self> {
        let there = !hemisplat::scene::load::LoadOptions::default().with_environment().search.is_empty();
        (!there).then(|| Self::new("scenes", "HEMISPLAT_SCENES is not set"))
    }

    fn is_required(&self) -> bool {
        std::env::var("HEMISPLAT_REQUIRE").is_ok_and(|list| list.split(',').any(|item| item.trim() == self.what))
    }
}

/// Whether this is left out, which is told.
pub fn skipped(test: &str, missing: Option<&Missing>) -> bool {
    let Some(missing) = missing.filter(|missing| !missing.is_required()) else { return false };
    println!("SKIPPED: {test}: {} [{}]", missing.why, missing.what);
    true
}

/// A test that is left out, or fails where it is required, if what it needs is missing.
pub fn trial(name: impl Into<String>, missing: Option<&Missing>, test: impl FnOnce() -> Result<(), Failed> + Send + 'static) -> Trial {
    let (name, missing) = (name.into(), missing.cloned());
    let ignored = skipped(&name, missing.as_ref());
    Trial::test(name, move || match missing {
        Some(missing) => Err(format!("{} is required: {}", missing.what, missing.why).into()),
        None => test(),
    })
    .with_ignored_flag(ignored)
}

/// A test that runs in every run, or a long one, which runs with `--ignored` or `--include-ignored`.
pub fn short_or_long(name: impl Into<String>, is_long: bool, missing: Option<&Missing>, test: impl FnOnce() -> Result<(), Failed> + Send + 'static) -> Trial {
    let trial = trial(name, missing, test);
    if is_long { trial.with_ignored_flag(true) } else { trial }
}

/// A test that ends with the first error.
pub fn fallible(name: impl Into<String>, missing: Option<&Missing>, test: fn() -> Result<(), Box<dyn std::error::Error>>) -> Trial {
    trial(name, missing, move || test().map_err(|error| error.to_string().into()))
}

/// A test that panics where something does not hold.
pub fn holds(name: impl Into<String>, missing: Option<&Missing>, test: impl FnOnce() + Send + 'static) -> Trial {
    trial(name, missing, move || {
        test();
        Ok(())
    })
}
