//! What records add to pixels, on the host: the twin of `shaders/lib/contribution`.

pub mod bands;
pub mod irradiance;
pub mod radiance;
