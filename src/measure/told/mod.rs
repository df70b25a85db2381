//! What was measured, as people read it: text, tables, CSV, and the reports of pages.

pub mod comparison;
mod expectations;
pub mod sweep;
pub mod tables;

pub use expectations::missed;
