//! Places that any number of fill evenly.

/// The number-th of pixels that are spread evenly over a picture, which has fewer than 65,536 along each axis: a lattice of rank 1 (its generator is that of
/// Roberts' R2 sequence), in integers, as shaders/path_vertices.wgsl.
pub fn pixel(number: u32, size: [u32; 2]) -> [u32; 2] {
    let along = [3_242_174_889, 2_447_445_414].map(|step: u32| step.wrapping_mul(number).wrapping_add(1 << 31));
    [0, 1].map(|axis| ((along[axis] >> 16) * size[axis]) >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn pixels_are_spread_evenly() {
        let size = [640, 480];
        let all: BTreeSet<[u32; 2]> = (0..10_000).map(|number| pixel(number, size)).collect();
        assert!(all.len() > 9_900 && all.iter().all(|[x, y]| *x < size[0] && *y < size[1]));
        // In each part of a hundred as many as in any other, but for a few.
        let in_part = |column: u32, row: u32| all.iter().filter(|[x, y]| x / 64 == column && y / 48 == row).count();
        assert!((0..100).all(|part| (90..=110).contains(&in_part(part % 10, part / 10))));
        assert_eq!([pixel(0, size), pixel(7, [65_535, 1])], [[320, 240], [pixel(7, [65_535, 1])[0], 0]]);
    }
}
