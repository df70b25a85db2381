//! Where words stand beside the marks of a figure: free of marks, and of each other.

/// Half the side of the square that a mark takes, its ring included.
const MARK: f64 = 9.0;
/// Half the height of a word.
const HALF_HEIGHT: f64 = 7.0;
/// How far a word is moved farther from its mark where nothing nearer is free.
const STEP: f64 = 12.0;
/// After so many steps it stands where it would with nothing in its way.
const STEPS: u32 = 12;
/// Seen from the mark, in the order of preference: nothing is left of and below a mark of the front.
const DIRECTIONS: [[f64; 2]; 8] = [[-0.8, 0.9], [0.0, 1.0], [-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.8, -0.9], [0.8, 0.9], [-0.8, -0.9]];

/// The place of a mark's words.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Label {
    /// Seen from the mark.
    pub middle: [f64; 2],
    /// Whether it stands away from the mark.
    pub is_far: bool,
}

/// What is covered: left, right, top, bottom.
type Area = [f64; 4];

/// A place for the words of each mark that has some, of which the width is given: the nearest within the frame that covers nothing.
pub(super) fn place(marks: &[[f64; 2]], widths: &[Option<f64>], frame: Area) -> Vec<Option<Label>> {
    let mut taken: Vec<Area> = marks.iter().map(|at| around(*at, [MARK; 2])).collect();
    let mut placed = |(at, width): (&[f64; 2], &Option<f64>)| {
        let half = [(*width)? / 2.0, HALF_HEIGHT];
        let label = nearest(*at, half, &taken, frame);
        taken.push(around(from(*at, label.middle), half));
        Some(label)
    };
    marks.iter().zip(widths).map(&mut placed).collect()
}

fn nearest(at: [f64; 2], half: [f64; 2], taken: &[Area], frame: Area) -> Label {
    let candidates = (0..STEPS).flat_map(|step| DIRECTIONS.map(|direction| candidate(direction, half, step)));
    let is_free = |label: &Label| {
        let own = around(from(at, label.middle), half);
        let is_inside = own[0] >= frame[0] && own[1] <= frame[1] && own[2] >= frame[2] && own[3] <= frame[3];
        is_inside && !taken.iter().any(|other| meet(&own, other))
    };
    candidates.into_iter().find(is_free).unwrap_or_else(|| candidate(DIRECTIONS[0], half, 0))
}

fn candidate(direction: [f64; 2], half: [f64; 2], step: u32) -> Label {
    let reach = |axis: usize| direction[axis] * (half[axis] + MARK + 3.0 + STEP * f64::from(step));
    Label { middle: [reach(0), reach(1)], is_far: step > 0 }
}

fn from(at: [f64; 2], middle: [f64; 2]) -> [f64; 2] {
    [at[0] + middle[0], at[1] + middle[1]]
}

fn around(middle: [f64; 2], half: [f64; 2]) -> Area {
    [middle[0] - half[0], middle[0] + half[0], middle[1] - half[1], middle[1] + half[1]]
}

fn meet(a: &Area, b: &Area) -> bool {
    a[0] < b[1] && b[0] < a[1] && a[2] < b[3] && b[2] < a[3]
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Area = [0.0, 800.0, 0.0, 400.0];

    /// Twenty marks at one place, of which each must stay open to a click on its words.
    #[test]
    fn words_of_marks_that_cover_each_other_stand_apart() {
        let labels = place(&[[400.0, 200.0]; 20], &[Some(14.0); 20], FRAME);
        let boxes: Vec<Area> = labels.iter().map(|label| around(from([400.0, 200.0], label.unwrap().middle), [7.0, HALF_HEIGHT])).collect();
        let mark = around([400.0, 200.0], [MARK; 2]);
        for (index, own) in boxes.iter().enumerate() {
            assert!(!meet(own, &mark) && boxes[..index].iter().all(|other| !meet(own, other)), "{index}: {boxes:?}");
        }
        assert!(!labels[0].unwrap().is_far && labels[19].unwrap().is_far);
    }

    #[test]
    fn words_stay_in_the_frame() {
        for at in [[0.0, 0.0], [800.0, 0.0], [0.0, 400.0], [800.0, 400.0]] {
            let label = place(&[at], &[Some(60.0)], FRAME)[0].unwrap();
            let own = around(from(at, label.middle), [30.0, HALF_HEIGHT]);
            assert!(own[0] >= 0.0 && own[1] <= 800.0 && own[2] >= 0.0 && own[3] <= 400.0, "{own:?}");
        }
        assert_eq!(place(&[[9.0, 9.0]], &[None], FRAME), [None]);
    }
}
