//! What coherence may spend: it never takes more than a hundredth of what `standard` would.

/// The work that may be spent on checking and building, in hundredths of a test.
///
/// Every ray earns a hundredth of the tests that `standard` makes for it at least, and a coherent one all the tests of
/// its partition. What is spent beyond the tests that `standard` would make is paid from here before it is done, so
/// the balance is never negative and the work of a sweep is at most 1.01 of `standard`'s plus the first loan.
#[derive(Debug)]
pub(super) struct Credit {
    balance: u64,
}

/// A test, in the unit of the balance.
const TEST: u64 = 100;

impl Credit {
    /// A first loan, in tests.
    pub(super) fn new(loan: u64) -> Self {
        Self { balance: loan * TEST }
    }

    /// A ray for which `standard` makes at least so many tests.
    #[inline(always)]
    pub(super) fn earn(&mut self, tests: u64) {
        self.balance += tests * TEST / 100;
    }

    /// Tests that `standard` makes for a ray and that were not made.
    #[inline(always)]
    pub(super) fn save(&mut self, tests: u64) {
        self.balance += tests * TEST;
    }

    /// Whether so many tests can be paid for.
    #[inline(always)]
    pub(super) fn covers(&self, tests: u64) -> bool {
        self.balance >= tests * TEST
    }

    /// Pays for tests that are covered.
    #[inline(always)]
    pub(super) fn spend(&mut self, tests: u64) {
        self.balance -= tests * TEST;
    }

    /// Pays for tests; `false` if they cannot be paid for, and must not be made.
    #[inline(always)]
    pub(super) fn pay(&mut self, tests: u64) -> bool {
        let cost = tests * TEST;
        let can = self.balance >= cost;
        if can {
            self.balance -= cost;
        }
        can
    }

    /// Gives back what was paid for and not used.
    #[inline(always)]
    pub(super) fn refund(&mut self, tests: u64) {
        self.balance += tests * TEST;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_spent_that_was_not_earned() {
        let mut credit = Credit::new(2);
        assert!(!credit.pay(3) && credit.pay(2) && !credit.pay(1));
        credit.earn(50);
        assert!(!credit.pay(1));
        credit.earn(50);
        assert!(credit.pay(1) && !credit.pay(1));
        credit.save(7);
        assert!(credit.pay(7) && !credit.pay(1));
        credit.refund(3);
        assert!(credit.pay(3));
    }
}
