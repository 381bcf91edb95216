//! Whether a kind of shaft is worth trying: found out by counters, never by a clock.

/// After how many shafts at most one is tried again.
const LONGEST_WAIT: usize = 128;

/// Whether a kind of shaft is worth trying.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trial {
    /// How many are not tried.
    wait: usize,
    /// How many will not be tried after the next loss.
    next_wait: usize,
    /// Steps spent and saved of late.
    spent: u64,
    saved: u64,
}

impl Trial {
    pub(crate) const NEW: Self = Self { wait: 1, next_wait: 1, spent: 0, saved: 0 };

    /// Whether to try the next.
    pub(crate) fn is_due(&mut self) -> bool {
        self.wait = self.wait.saturating_sub(1);
        self.wait == 0
    }

    /// Whether one of the next `n` is to be tried.
    pub(crate) fn is_due_within(&self, n: usize) -> bool {
        self.wait <= n
    }

    /// Leaves the next `n` untried.
    pub(crate) fn pass(&mut self, n: usize) {
        self.wait = self.wait.saturating_sub(n).max(1);
    }

    /// Whether it has saved of late what it has spent.
    pub(crate) fn pays(&self) -> bool {
        self.saved >= self.spent
    }

    /// Takes in what a shaft took, and what its rays would have taken otherwise if it has answered them.
    pub(crate) fn end(&mut self, spent: u64, saved: u64) {
        self.end_within(spent, saved, LONGEST_WAIT);
    }

    /// The same, of something that is tried again after so many at most.
    pub(crate) fn end_within(&mut self, spent: u64, saved: u64, longest_wait: usize) {
        // What is long ago counts less and less.
        self.spent = self.spent / 8 * 7 + spent;
        self.saved = self.saved / 8 * 7 + saved;
        if self.pays() {
            (self.wait, self.next_wait) = (1, 1);
        } else if saved >= spent {
            (self.wait, self.next_wait) = (1, (self.next_wait / 2).max(1));
        } else {
            self.wait = self.next_wait;
            self.next_wait = (2 * self.next_wait).min(longest_wait);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shafts_that_do_not_pay_are_tried_less_and_less() {
        let mut trial = Trial::NEW;
        let mut tried = Vec::new();
        for shaft in 0..600 {
            if trial.is_due() {
                tried.push(shaft);
                trial.end(10, 0);
            }
        }
        assert_eq!(tried, [0, 1, 3, 7, 15, 31, 63, 127, 255, 383, 511]);
    }

    #[test]
    fn one_that_pays_is_followed_by_another_whatever_was_lost_before() {
        let mut trial = Trial::NEW;
        for _ in 0..10 {
            trial.end(100, 0);
        }
        assert_eq!((trial.wait, trial.next_wait), (128, 128));
        trial.end(10, 12);
        assert!(!trial.pays(), "what was lost is not forgotten at once");
        assert_eq!((trial.wait, trial.next_wait), (1, 64));
        trial.end(10, 0);
        assert_eq!((trial.wait, trial.next_wait), (64, 128));
        trial.end(0, 1000);
        assert_eq!((trial.wait, trial.next_wait), (1, 1), "all is made up for");
    }
}
