//! Windows: squares of a picture at whose every pixel the truth is traced, spread over the picture by a rule that knows nothing but its size.
//!
//! The picture is parted into as many cells of [`SIDE`] × [`SIDE`] pixels as fit, spread so that the outermost touch the borders. Windows are cells, in
//! the order in which the points of a low-discrepancy sequence first fall into them: the additive recurrence with the inverses of the plastic number and
//! of its square (Roberts 2018), whose points spread over the square from the first one on. So the windows of a smaller number are among those
//! of a larger one, no two overlap, and as whole numbers decide it, every program finds the same ones (`benches/peers/windows.py`).

use std::collections::BTreeSet;
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// Side of a window [pixels].
pub const SIDE: u32 = 64;

/// The steps of the sequence along both axes, as shares of 2³².
const STEP: [u32; 2] = [3_242_174_889, 2_447_445_414];

/// Some windows of a picture, by their corners: first column and first row, in the order of the rule. There is at least one, none twice.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Windows(Vec<[u32; 2]>);

impl Windows {
    /// The first `count` windows of a picture of `size` pixels. None if `count` is 0, or more than fit.
    pub fn spread(size: [u32; 2], count: u32) -> Option<Self> {
        if count == 0 || u64::from(count) > room(size) {
            return None;
        }
        let cells = size.map(|side| side / SIDE);
        let (mut taken, mut corners) = (BTreeSet::new(), Vec::new());
        for index in 0..u32::MAX {
            let cell = [0, 1].map(|axis| ((u64::from(STEP[axis].wrapping_mul(index + 1)) * u64::from(cells[axis])) >> 32) as u32);
            if taken.insert(cell) {
                corners.push([0, 1].map(|axis| first(size[axis], cells[axis], cell[axis])));
            }
            if corners.len() == count as usize {
                break;
            }
        }
        Some(Self(corners))
    }

    /// Their corners: first column and first row.
    pub fn corners(&self) -> &[[u32; 2]] {
        &self.0
    }

    /// Whether all lie within a picture of that size.
    pub fn fit(&self, size: [u32; 2]) -> bool {
        self.0.iter().all(|corner| [0, 1].iter().all(|&axis| corner[axis] <= size[axis].saturating_sub(SIDE) && size[axis] >= SIDE))
    }

    /// Those that others hold too; None if there are none.
    pub fn shared(&self, others: &Self) -> Option<Self> {
        let shared: Vec<_> = self.0.iter().copied().filter(|corner| others.0.contains(corner)).collect();
        (!shared.is_empty()).then_some(Self(shared))
    }

    /// Which pixels of a picture of that size lie in a window, `margin` pixels or more from the window's border; rows from the top.
    pub fn mask(&self, size: [u32; 2], margin: u32) -> Vec<bool> {
        let mut mask = vec![false; size[0] as usize * size[1] as usize];
        let inner = |first: u32| (first + margin) as usize..(first + SIDE - margin) as usize;
        for &[x, y] in &self.0 {
            for row in inner(y) {
                let Range { start, end } = inner(x);
                mask[row * size[0] as usize + start..row * size[0] as usize + end].fill(true);
            }
        }
        mask
    }
}

/// How many windows fit into a picture of that size.
pub fn room(size: [u32; 2]) -> u64 {
    size.map(|side| u64::from(side / SIDE)).iter().product()
}

/// The first pixel of a cell: cells are spread evenly from border to border, a lone one stands in the middle.
fn first(side: u32, cells: u32, cell: u32) -> u32 {
    let spare = side - SIDE;
    if cells == 1 { spare / 2 } else { (u64::from(cell) * u64::from(spare) / u64::from(cells - 1)) as u32 }
}

impl fmt::Display for Windows {
    /// `x,y` of each corner, between blanks.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let corners: Vec<String> = self.0.iter().map(|[x, y]| format!("{x},{y}")).collect();
        f.write_str(&corners.join(" "))
    }
}

impl FromStr for Windows {
    type Err = ();

    /// Reads what [`Windows`] writes.
    fn from_str(text: &str) -> Result<Self, ()> {
        let corner = |text: &str| {
            let (x, y) = text.split_once(',')?;
            Some([x.parse().ok()?, y.parse().ok()?])
        };
        let corners: Vec<[u32; 2]> = text.split_whitespace().map(corner).collect::<Option<_>>().ok_or(())?;
        let unique: BTreeSet<_> = corners.iter().collect();
        if corners.is_empty() || unique.len() < corners.len() { Err(()) } else { Ok(Self(corners)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn covered(windows: &Windows, size: [u32; 2]) -> usize {
        windows.mask(size, 0).into_iter().filter(|covered| *covered).count()
    }

    proptest! {
        #[test]
        fn windows_lie_inside_and_do_not_overlap(width in 64u32..900, height in 64u32..900, share in 0.0f64..=1.0) {
            let size = [width, height];
            let count = ((room(size) as f64 * share) as u32).max(1);
            let windows = Windows::spread(size, count).unwrap();
            prop_assert!(windows.fit(size));
            prop_assert_eq!(covered(&windows, size), (count * SIDE * SIDE) as usize);
            let fewer = Windows::spread(size, count.div_ceil(2)).unwrap();
            prop_assert_eq!(fewer.corners(), &windows.corners()[..count.div_ceil(2) as usize]);
            prop_assert_eq!(windows.to_string().parse(), Ok(windows));
        }
    }

    #[test]
    fn every_cell_is_found_and_no_more() {
        for size in [[64, 64], [65, 127], [128, 64], [1000, 1000], [1920, 1080], [4096, 4096], [64, 16_384]] {
            let all = Windows::spread(size, room(size) as u32).unwrap();
            assert_eq!(all.corners().len() as u64, room(size), "{size:?}");
            assert_eq!((Windows::spread(size, room(size) as u32 + 1), Windows::spread(size, 0)), (None, None));
        }
        for size in [[63, 64], [64, 63], [0, 0], [1, 10_000]] {
            assert_eq!((room(size), Windows::spread(size, 1)), (0, None));
        }
        assert_eq!(Windows::spread([65, 127], 1).unwrap().corners(), [[0, 31]]);
    }

    /// Of 16 windows in a large square each quarter has its four, give or take one, and so has each quarter of the columns and of the rows.
    #[test]
    fn windows_spread_over_the_picture() {
        let windows = Windows::spread([1000, 1000], 16).unwrap();
        let count = |of: &dyn Fn([u32; 2]) -> bool| windows.corners().iter().filter(|corner| of(**corner)).count();
        for quarter in 0..4 {
            let found = count(&|[x, y]| [(x / 468).min(1), (y / 468).min(1)] == [quarter % 2, quarter / 2]);
            assert!((3..=5).contains(&found), "{quarter}: {found}");
        }
        for strip in 0..4 {
            for axis in 0..2 {
                let found = count(&|corner| corner[axis].min(935) / 234 == strip);
                assert!((3..=5).contains(&found), "{axis} {strip}: {found}");
            }
        }
    }

    #[test]
    fn a_margin_leaves_the_middle() {
        let windows: Windows = "1,2 70,2".parse().unwrap();
        let mask = windows.mask([140, 70], 10);
        assert_eq!(mask.iter().filter(|inside| **inside).count(), 2 * 44 * 44);
        assert!(mask[12 * 140 + 11] && !mask[12 * 140 + 10] && !mask[11 * 140 + 11] && mask[55 * 140 + 54] && !mask[55 * 140 + 55]);
    }

    #[test]
    fn only_corners_are_read() {
        for text in ["", "1", "1,2,3", "1,-2", "a,b", "1,2 1,2", "1, 2"] {
            assert!(text.parse::<Windows>().is_err(), "{text}");
        }
        let windows: Windows = "0,0 64,0".parse().unwrap();
        assert!(windows.fit([128, 64]) && !windows.fit([127, 64]) && !windows.fit([128, 63]));
        assert_eq!(windows.shared(&"64,0 0,5".parse().unwrap()), Some("64,0".parse().unwrap()));
        assert_eq!(windows.shared(&"64,1".parse().unwrap()), None);
    }
}
