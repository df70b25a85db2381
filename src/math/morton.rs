//! Cells of a cube in the order of a curve that keeps neighbours together: those of a cell of any larger size follow each other.

use glam::{UVec3, Vec3};

/// Cells along an edge of the cube, as a power of two.
pub const BITS: u32 = 10;

/// Where a cell is on the curve, from the least size of cells: the bits of its coordinates in turns.
pub fn code(cell: UVec3) -> u32 {
    spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2
}

/// Moves the ten lowest bits three apart.
fn spread(bits: u32) -> u32 {
    let bits = (bits | bits << 16) & 0x0300_00ff;
    let bits = (bits | bits << 8) & 0x0300_f00f;
    let bits = (bits | bits << 4) & 0x030c_30c3;
    (bits | bits << 2) & 0x0924_9249
}

/// The cube that a scene is in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cube {
    pub corner: Vec3,
    /// Least cells a scene unit.
    pub cells_per_unit: f32,
}

impl Cube {
    /// Around bounds; of any size where they are empty.
    pub fn around(min: Vec3, max: Vec3) -> Self {
        let edge = (max - min).max_element();
        if edge.is_finite() && edge > 0.0 {
            Self { corner: min, cells_per_unit: (1 << BITS) as f32 / edge }
        } else {
            Self { corner: if min.is_finite() { min } else { Vec3::ZERO }, cells_per_unit: 1.0 }
        }
    }

    /// Where a point is, in least cells from the corner.
    pub fn place(&self, position: Vec3) -> Vec3 {
        (position - self.corner) * self.cells_per_unit
    }

    /// The code of the least cell that holds a point, or is next to it.
    pub fn code(&self, position: Vec3) -> u32 {
        code(self.place(position).clamp(Vec3::ZERO, Vec3::splat(((1 << BITS) - 1) as f32)).as_uvec3())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_a_larger_cell_follow_each_other() {
        assert_eq!([UVec3::X, UVec3::Y, UVec3::Z, UVec3::splat(1023)].map(code), [1, 2, 4, (1 << 30) - 1]);
        for level in 0..5 {
            let parent = UVec3::new(5, 17, 30) << level;
            for at in 0..1 << (3 * level).min(9) {
                let within = UVec3::new(at % 8, at / 8 % 8, at / 64) % (1 << level);
                assert_eq!(code(parent + within) >> (3 * level), code(UVec3::new(5, 17, 30)));
            }
        }
    }

    #[test]
    fn points_are_in_their_cells() {
        let cube = Cube::around(Vec3::new(-1.0, 2.0, 3.0), Vec3::new(7.0, 4.0, 5.0));
        assert_eq!(cube.place(Vec3::new(0.0, 2.0, 4.0)), Vec3::new(128.0, 0.0, 128.0));
        assert_eq!(cube.code(Vec3::new(7.0, 2.0, 3.0)), code(UVec3::new(1023, 0, 0)));
        assert_eq!(cube.code(Vec3::splat(-9.0)), 0);
        for empty in [Cube::around(Vec3::INFINITY, Vec3::NEG_INFINITY), Cube::around(Vec3::ONE, Vec3::ONE)] {
            assert!(empty.place(Vec3::ZERO).is_finite());
        }
    }
}
