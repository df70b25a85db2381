//! Which points nothing beats: the Pareto front of error over cost, in which only differences that hold count.

use super::metrics::ErrorDifference;
use std::cmp::Ordering;

/// What is known of a point; less is better.
#[derive(Debug, Clone, PartialEq)]
pub struct Standing {
    /// Quartiles of its cost, or the cost twice where it is no matter of chance.
    pub cost: [f64; 2],
    /// The size of its error.
    pub error: f64,
    /// The same in each draw of the picture's blocks; empty where it was not resampled.
    pub draws: Vec<f64>,
}

impl Standing {
    /// Of a cost and an error that are known without doubt.
    pub fn certain(cost: f64, error: f64) -> Self {
        Self { cost: [cost; 2], error, draws: Vec::new() }
    }

    /// Apart where the quartiles are.
    fn cost_beside(&self, other: &Self) -> Ordering {
        if self.cost[1] < other.cost[0] {
            Ordering::Less
        } else if other.cost[1] < self.cost[0] {
            Ordering::Greater
        } else {
            Ordering::Equal
        }
    }

    /// Apart where the difference holds among so many comparisons; by their sizes where nothing is known of that.
    fn error_beside(&self, other: &Self, comparisons: usize) -> Ordering {
        let sizes = self.error.total_cmp(&other.error);
        match ErrorDifference::between([other.error, self.error], [&other.draws, &self.draws], comparisons) {
            Some(difference) if !difference.significant => Ordering::Equal,
            _ => sizes,
        }
    }

    /// Whether it is better in one of the two beyond doubt, and in none worse beyond doubt.
    fn beats(&self, other: &Self, comparisons: usize) -> bool {
        match self.cost_beside(other) {
            Ordering::Greater => false,
            Ordering::Less => self.error_beside(other, comparisons) != Ordering::Greater,
            Ordering::Equal => self.error_beside(other, comparisons) == Ordering::Less,
        }
    }
}

/// Which of these are on the front: nothing of the front beats them. The cheapest come first, and what the front beats beats nothing itself: along a chain of
/// points, each of which is better than the one before by no more than chance, those stay that are better beyond doubt than the last that stayed.
pub fn front(standings: &[Standing]) -> Vec<bool> {
    let comparisons = standings.len().saturating_sub(1);
    let beats = |one: &usize, other: &usize| standings[*one].beats(&standings[*other], comparisons);
    let mut cheapest: Vec<usize> = (0..standings.len()).collect();
    cheapest.sort_by(|a, b| {
        let [a, b] = [a, b].map(|index| &standings[*index]);
        a.cost[0].total_cmp(&b.cost[0]).then(a.error.total_cmp(&b.error))
    });
    let mut staying: Vec<usize> = Vec::new();
    for one in cheapest {
        if !staying.iter().any(|other| beats(other, &one)) {
            staying.push(one);
        }
    }
    // Of what costs about the same, a dearer one may be the better.
    let is_beaten = |one: &usize| staying.iter().any(|other| beats(other, one));
    let mut found = vec![false; standings.len()];
    staying.iter().filter(|one| !is_beaten(one)).for_each(|one| found[*one] = true);
    // Differences that hold need not be transitive: three may beat each other in turn. Then sizes decide.
    if standings.is_empty() || found.contains(&true) { found } else { front_of_sizes(standings) }
}

/// The front as if every number were certain.
fn front_of_sizes(standings: &[Standing]) -> Vec<bool> {
    front(&standings.iter().map(|one| Standing::certain(one.cost[0], one.error)).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn certain([cost, error]: [f64; 2]) -> Standing {
        Standing::certain(cost, error)
    }

    /// Draws that spread by `spread` to both sides.
    fn drawn(cost: [f64; 2], error: f64, spread: f64) -> Standing {
        Standing { cost, error, draws: (0..100).map(|draw| error + spread * f64::from(draw * 37 % 100 - 50) / 50.0).collect() }
    }

    #[test]
    fn a_front_by_hand() {
        let costs = [[1.0, 9.0], [2.0, 9.0], [2.0, 4.0], [3.0, 4.0], [4.0, 1.0], [4.0, 1.0], [4.0, 2.0], [0.5, 9.5]];
        assert_eq!(front(&costs.map(certain)), [true, false, true, false, true, true, false, true]);
        assert_eq!(front(&[]), Vec::<bool>::new());
    }

    #[test]
    fn an_error_that_is_smaller_by_chance_is_not_worth_its_cost() {
        // The draws go together, as those of blocks do, but for a part that is the picture's own.
        let own = |error: f64| Standing { draws: (0..100).map(|draw| error + 0.3 * f64::from(draw * draw % 7 - 3)).collect(), ..drawn([8.0; 2], error, 0.0) };
        let cheap = drawn([1.0; 2], 2.0, 0.1);
        assert_eq!(front(&[cheap.clone(), own(1.9)]), [true, false]);
        assert_eq!(front(&[cheap, own(0.5)]), [true, true]);
    }

    /// Each is better than the one before by as much as chance makes, the last by far than the first.
    #[test]
    fn a_chain_of_small_gains_is_followed_to_its_end() {
        let own = |cost: f64, error: f64, turn: i32| Standing {
            draws: (0..100).map(|draw| error + 0.3 * f64::from((draw * draw + turn * draw) % 7 - 3)).collect(),
            ..Standing::certain(cost, error)
        };
        let chain: Vec<Standing> = (0..6).map(|step| own(f64::from(step + 1), 5.0 - 0.7 * f64::from(step), step)).collect();
        let found = front(&chain);
        assert!(found[0] && !found[1], "{found:?}: the second is better by no more than chance");
        assert!(found[2..].contains(&true), "{found:?}: the last has a third of the first one's error");
    }

    #[test]
    fn times_count_where_their_quartiles_are_apart() {
        let (one, other) = (drawn([1.0, 1.2], 2.0, 0.0), drawn([1.1, 1.3], 2.0, 0.0));
        assert_eq!(front(&[one.clone(), other]), [true, true]);
        assert_eq!(front(&[one.clone(), drawn([1.3, 1.4], 2.0, 0.0)]), [true, false]);
        assert_eq!(front(&[one, drawn([1.1, 1.3], 1.0, 0.0)]), [false, true], "of the same cost, the one with the smaller error");
    }

    #[test]
    fn a_front_is_never_empty() {
        // Each is cheaper than the one before, and none of their errors differ, but for the first and the last.
        let wide = |from: f64| Standing { cost: [from, from + 1.0], error: from, draws: Vec::new() };
        let standings = [wide(1.0), wide(1.5), wide(2.5)];
        assert!(front(&standings).contains(&true));
        assert!(front_of_sizes(&standings).contains(&true));
    }

    proptest! {
        /// Few different costs, so that many are equal.
        #[test]
        fn no_point_of_the_front_is_dominated_and_each_other_point_is(costs in prop::collection::vec([0u8..8, 0u8..8], 0..40)) {
            let costs: Vec<[f64; 2]> = costs.iter().map(|cost| cost.map(f64::from)).collect();
            let dominates = |a: &[f64; 2], b: &[f64; 2]| a[0] <= b[0] && a[1] <= b[1] && a != b;
            let standings: Vec<Standing> = costs.iter().copied().map(certain).collect();
            for (cost, is_on_front) in costs.iter().zip(front(&standings)) {
                prop_assert_eq!(is_on_front, !costs.iter().any(|other| dominates(other, cost)));
            }
        }
    }
}
