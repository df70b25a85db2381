//! One of several, in proportion to their weights.

/// A discrete distribution that is sampled by inversion.
pub struct Choice {
    cumulative: Vec<f64>,
}

impl Choice {
    pub fn new(weights: impl Iterator<Item = f64>) -> Self {
        Self {
            cumulative: weights
                .scan(0.0, |sum, weight| {
                    *sum += weight;
                    Some(*sum)
                })
                .collect(),
        }
    }

    /// Sum of the weights.
    pub fn total(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// Weight of one entry.
    pub fn weight(&self, index: usize) -> f64 {
        self.cumulative[index] - self.below(index)
    }

    /// The entry at `number` of 0..1, and how far into it `number` lies, 0..1 again, to be used once more.
    pub fn pick(&self, number: f64) -> (usize, f64) {
        let at = number * self.total();
        let index = self.cumulative.partition_point(|&sum| sum <= at).min(self.cumulative.len() - 1);
        (index, ((at - self.below(index)) / self.weight(index)).clamp(0.0, 1.0))
    }

    /// Where an entry's share ends, were all of them 2³² long: an entry is picked by the numbers below that, from the end of the one before on.
    pub fn end(&self, index: usize) -> u32 {
        if index + 1 == self.cumulative.len() { u32::MAX } else { (self.cumulative[index] / self.total() * 4_294_967_296.0) as u32 }
    }

    fn below(&self, index: usize) -> f64 {
        if index == 0 { 0.0 } else { self.cumulative[index - 1] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_choice_follows_its_weights() {
        let choice = Choice::new([1.0, 0.0, 3.0].into_iter());
        assert_eq!(choice.pick(0.0), (0, 0.0));
        assert_eq!(choice.pick(0.25), (2, 0.0));
        assert_eq!(choice.pick(0.625), (2, 0.5));
        assert_eq!((choice.weight(1), choice.total()), (0.0, 4.0));
    }
}
