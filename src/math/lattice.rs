//! Places that any number of fill evenly.

/// The number-th of pixels that are spread evenly over a picture: a lattice of rank 1 (its generator is that of Roberts' R2 sequence).
pub fn pixel(number: u32, size: [u32; 2]) -> [u32; 2] {
    let along = [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (0.5 + step * f64::from(number)).fract());
    [0, 1].map(|axis| ((along[axis] * f64::from(size[axis])) as u32).min(size[axis] - 1))
}
