//! How the time that is given to a frame is shared out among its loops.

use crate::schedule::TimeShare;
use web_time::{Duration, Instant};

/// What comes after the loops, as a share of the time before them: to close gaps, divide and add up against G-buffer, shadows and direct light. Without gaps
/// it was 0.2 to 0.3.
const CLOSING: f64 = 0.6;

/// Of a frame.
pub(super) struct Clock {
    start: Instant,
    /// What comes after the loops takes so long, as far as that can be foretold; None before the first loop.
    closing: Option<Duration>,
}

/// Of a loop that runs.
#[derive(Default)]
pub(super) struct Rounds {
    /// When the loop must have ended.
    end: Option<Instant>,
    last: Option<Instant>,
    /// How long a round may take.
    expected: Duration,
}

impl Clock {
    pub fn new() -> Self {
        Self { start: Instant::now(), closing: None }
    }

    /// The part of the time left that a loop may use up.
    fn share(&mut self, left: Duration, time: &TimeShare, now: Instant) -> Duration {
        let closing = *self.closing.get_or_insert_with(|| (now - self.start).mul_f64(CLOSING));
        left.saturating_sub(closing) / time.caches.max(1)
    }
}

impl Rounds {
    /// Asked as a round starts: whether it would end too late.
    pub fn are_over(&mut self, clock: &mut Clock, left: Duration, time: &TimeShare) -> bool {
        let now = Instant::now();
        if let Some(last) = self.last.replace(now) {
            // Rounds that find little to do are short; the one that follows may not be.
            self.expected = (now - last).max(self.expected / 2);
        }
        let end = (*self.end.get_or_insert_with(|| now + clock.share(left, time, now))).min(now + left);
        now + self.expected >= end
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: TimeShare = TimeShare { at_least: 0, records: None, caches: 1 };
    const HOUR: Duration = Duration::from_secs(3600);

    #[test]
    fn a_loop_has_its_share_of_what_is_left_before_the_closing() {
        let now = Instant::now();
        let mut clock = Clock { start: now, closing: Some(Duration::from_secs(2)) };
        assert_eq!(clock.share(Duration::from_secs(10), &ALL, now), Duration::from_secs(8));
        assert_eq!(clock.share(Duration::from_secs(10), &TimeShare { caches: 2, ..ALL }, now), Duration::from_secs(4));
        assert_eq!(clock.share(Duration::from_secs(1), &ALL, now), Duration::ZERO);
    }

    #[test]
    fn a_round_that_would_take_longer_than_is_left_does_not_start() {
        let mut clock = Clock::new();
        assert!(Rounds::default().are_over(&mut clock, Duration::ZERO, &ALL));
        let mut rounds = Rounds::default();
        assert!(!rounds.are_over(&mut clock, HOUR, &ALL));
        assert!(!rounds.are_over(&mut clock, HOUR, &ALL));
        rounds.expected = 4 * HOUR;
        assert!(rounds.are_over(&mut clock, HOUR, &ALL));
    }
}
