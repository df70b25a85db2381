//! Places that any number of fill evenly.

/// The number-th of pixels that are spread evenly over a picture, which has fewer than 65,536 along each axis: a lattice of rank 1 (its generator is that of
/// Roberts' R2 sequence), in integers, as shaders/path_vertices.wgsl.
pub fn pixel(number: u32, size: [u32; 2]) -> [u32; 2] {
    let along = [3_242_174_889, 2_447_445_414].map(|step: u32| step.wrapping_mul(number).wrapping_add(1 << 31));
    [0, 1].map(|axis| ((along[axis] >> 16) * size[axis]) >> 16)
}

/// The number-th of some that fill the unit square evenly: steps of the golden ratio, moved around both edges by a shift in 0..1.
pub fn golden(number: u32, of: u32, shift: [f32; 2]) -> [f32; 2] {
    let number = number as f32;
    [((number + 0.5) / of as f32 + shift[0]).fract(), (0.618_034 * number + shift[1]).fract()]
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
    #[test]
    fn points_fill_a_square_evenly_wherever_they_are_moved_to() {
        for (of, shift) in [(64, [0.0, 0.0]), (64, [0.7, 0.31]), (1024, [0.25, 0.9])] {
            let all: Vec<[f32; 2]> = (0..of).map(|number| golden(number, of, shift)).collect();
            assert!(all.iter().flatten().all(|along| (0.0..1.0).contains(along)));
            let within = |column: usize, row: usize| all.iter().filter(|[x, y]| (x * 4.0) as usize == column && (y * 4.0) as usize == row).count();
            assert!((0..16).all(|part| within(part % 4, part / 4).abs_diff(of as usize / 16) <= 2), "{of} {shift:?}");
        }
    }
}
