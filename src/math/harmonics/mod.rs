//! Functions of direction as sums of a few basis functions: spherical harmonics Y, and hemispherical harmonics H for what is defined above a
//! surface only (Gautron's thesis, chapter 3).
//!
//! An expansion of order n has the n² functions of the degrees l < n, each with −l ≤ m ≤ l; [`index`] says where. Functions are real, orthonormal,
//! and have no Condon-Shortley sign: Y₁ is proportional to y, z, x.
//!
//! `H(θ, φ) = √2 · Y(θ', φ)` with `cosθ' = 2 cosθ − 1`: the hemisphere stretched over the sphere, equal areas to equal areas. In Cartesian
//! coordinates the stretch has no singular direction ([`stretched`]).

pub mod basis;
pub mod conversion;
pub mod families;
pub mod quadrature;
pub mod reflection;
pub mod rotation;
pub mod sky;
pub mod tilt;

pub use basis::{Basis, stretched};
pub use conversion::Conversion;
pub use rotation::Rotation;
pub use tilt::{Method, Tilting};

/// The highest order that is tested.
pub const MOST: usize = 20;

/// The functions that something over the hemisphere is expanded in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Harmonics {
    Hemispherical,
    /// As 0 below the horizon.
    Spherical,
}

/// How many functions an expansion of `order` has.
pub const fn count(order: usize) -> usize {
    order * order
}

/// Where the function of degree `l` and order `m` stands, −l ≤ m ≤ l.
pub const fn index(l: usize, m: isize) -> usize {
    (l * l + l).wrapping_add_signed(m)
}
