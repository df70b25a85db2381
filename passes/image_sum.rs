//! The sum of images, for passes that add several: `shaders/add_images.wgsl`.

use crate::contract::Encoder;
use crate::schedule::*;

/// Adds images two by two; one alone is its own sum, and that of none is black.
pub fn sum(e: &mut Encoder<'_>, member: &'static str, images: &[Resource], size: [u32; 2]) -> Resource {
    let [first, others @ ..] = images else {
        let black = e.image(member, size, Format::Rgba32Float);
        e.clear(black);
        return black;
    };
    others.iter().fold(*first, |left, right| {
        let sum = e.image(member, size, Format::Rgba32Float);
        e.compute_pixels(Program::new("add_images").bind("left", left).bind("right", *right).bind("sum", sum), "add", size);
        sum
    })
}
