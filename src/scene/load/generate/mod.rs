//! Geometry made by rule, as large as asked for.

mod castle;
mod hall;
mod masonry;

pub(super) use castle::{CASTLE_MATERIALS, MIN_CASTLE, castle};
pub(super) use hall::{HALL_MATERIALS, MIN_HALL, hall};
