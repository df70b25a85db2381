//! placeholder
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    Plane { fov_degrees: f64 },
    Hemicube,
    Hemispherical,
    Cosine,
}
#[derive(Debug)]
pub struct Table;
