//! The registry: every pass that pipelines may use, one file each.

use crate::contract::Registry;

/// All passes, in the order that `hemisplat passes` lists them.
pub static REGISTRY: &Registry = &[];
