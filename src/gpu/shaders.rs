//! The shaders of a schedule, by file and imports.

use super::device::GpuError;
use super::shader::{Shader, Slot};
use crate::schedule::{Command, Program, Schedule};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// A shader file, its text if it does not ship, and what its imports stand for.
pub(super) type Source = (&'static str, Option<&'static str>, Vec<(&'static str, &'static str)>);

/// Every shader that a schedule's commands run, parsed and validated once.
pub(super) struct Shaders(BTreeMap<Source, Shader>);

pub(super) fn source(program: &Program) -> Source {
    (program.shader, program.text, program.imports.clone())
}

impl Shaders {
    /// # Errors
    /// A shader that is not valid.
    pub fn load(schedule: &Schedule) -> Result<Self, GpuError> {
        let commands = schedule.nodes().into_iter().flat_map(|node| &node.commands);
        let sources: BTreeSet<_> = commands.flat_map(Command::programs).map(source).collect();
        let load = |source: Source| {
            let shader = Shader::load_own(source.0, source.1, &source.2)?;
            Ok((source, shader))
        };
        sources.into_par_iter().map(load).collect::<Result<_, _>>().map(Self)
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

    pub fn all(&self) -> &BTreeMap<Source, Shader> {
        &self.0
    }
}
