//! Parameters that change between frames: `NODE.PARAM=VALUE,VALUE,…`.

use super::diagnostics::Problems;
use super::values::Values;

/// A parameter with a value for each of the first frames.
#[derive(Debug, Clone, PartialEq)]
pub struct PerFrame(Values);

impl PerFrame {
    /// Reads `NODE.PARAM=VALUE,VALUE,…`; whether node, parameter and values are right is for [`super::load`] to tell.
    ///
    /// # Errors
    /// Those of [`Values::parse`].
    pub fn parse(text: &str) -> Result<Self, Problems> {
        Values::parse("--set-frames", text).map(Self)
    }

    /// How many frames have a value of their own.
    pub fn frames(&self) -> usize {
        self.0.values.len()
    }

    /// `NODE.PARAM=VALUE` for a frame: its own value, or the last.
    pub fn set(&self, frame: u32) -> String {
        self.0.set(frame as usize)
    }
}
