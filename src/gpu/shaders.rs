//! The shaders of a schedule, by file and imports.

use super::device::GpuError;
use super::shader::{self, Shader, Slot};
use crate::schedule::{Command, Program, Schedule};
use lru::LruCache;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

/// A shader file, its text if it does not ship, and what its imports stand for.
pub(super) type Source = (&'static str, Option<&'static str>, Vec<(&'static str, &'static str)>);

/// Every shader that a schedule's commands run, parsed and validated once.
pub(super) struct Shaders(BTreeMap<Source, Arc<Shader>>);

pub(super) fn source(program: &Program) -> Source {
    (program.shader, program.text, program.imports.clone())
}

/// How many shaders are kept: more than the largest pipeline has.
const KEPT: NonZeroUsize = NonZeroUsize::new(256).unwrap();

/// Those of earlier schedules, whatever device they were for: a plan that is made anew for a change of the scene has most of them.
static EARLIER: LazyLock<Mutex<LruCache<Source, Arc<Shader>>>> = LazyLock::new(|| Mutex::new(LruCache::new(KEPT)));

fn load(source: &Source) -> Result<Arc<Shader>, GpuError> {
    let earlier = || EARLIER.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(shader) = earlier().get(source).filter(|_| !shader::may_change()) {
        return Ok(shader.clone());
    }
    let shader = Arc::new(Shader::load_own(source.0, source.1, &source.2)?);
    earlier().put(source.clone(), shader.clone());
    Ok(shader)
}

/// The shader of a program.
///
/// # Errors
/// One that is not valid.
pub(crate) fn shader_of(program: &Program) -> Result<Arc<Shader>, GpuError> {
    load(&source(program))
}

impl Shaders {
    /// # Errors
    /// A shader that is not valid.
    pub fn load(schedule: &Schedule) -> Result<Self, GpuError> {
        let commands = schedule.nodes().into_iter().flat_map(|node| &node.commands);
        let sources: BTreeSet<_> = commands.flat_map(Command::programs).map(source).collect();
        let loaded = |source: Source| load(&source).map(|shader| (source, shader));
        sources.into_par_iter().map(loaded).collect::<Result<_, _>>().map(Self)
    }

    pub fn of(&self, program: &Program) -> &Shader {
        &self.0[&source(program)]
    }

    /// What entry points of a program's shader want to be bound.
    ///
    /// # Errors
    /// An entry point that is not there; a binding of a kind that passes do not use.
    pub fn slots(&self, program: &Program, entries: &[&str]) -> Result<Vec<Slot>, GpuError> {
        self.of(program).slots(entries).map_err(|reason| GpuError::Shader { shader: program.shader.into(), reason })
    }

    pub fn all(&self) -> &BTreeMap<Source, Arc<Shader>> {
        &self.0
    }
}
