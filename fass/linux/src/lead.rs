//! How much earlier than an instant a thread has to set its alarm, to be awake at that instant.
//!
//! From a timer's interrupt to the thread that waits for it Linux takes some tens of
//! microseconds, in a virtual machine more, and most of it is the same each time. A thread that
//! has nothing else to do can have it pass before the instant: it wakes up a little early, and
//! watches the clock for the rest.

/// The lead that a thread gives itself, learnt from how late it woke up.
///
/// It follows the delay that 19 of 20 do not exceed: a step up after a longer one, a nineteenth
/// of it down after a shorter one. So a rare long delay moves it no further than a usual one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lead {
    ns: u64,
}

impl Default for Lead {
    /// Begins with what it takes where it takes long, so that the first wake-ups are in time, too.
    fn default() -> Self {
        Self { ns: 60_000 }
    }
}

impl Lead {
    /// By how much a shorter delay changes it, and a longer one nineteen times.
    const STEP_NS: u64 = 250;
    /// How much of each period a thread watches the clock at most.
    const MOST_NS: u64 = 100_000;

    /// Returns when to set the alarm for an instant.
    pub(crate) const fn before(self, instant_ns: u64) -> u64 {
        instant_ns.saturating_sub(self.ns)
    }

    /// Notes when a thread woke up, and when its alarm was due.
    pub(crate) fn learn(&mut self, alarm_ns: u64, woke_ns: u64) {
        let late_ns = woke_ns.saturating_sub(alarm_ns);
        self.ns = match late_ns > self.ns {
            true => (self.ns + 19 * Self::STEP_NS).min(Self::MOST_NS),
            false => self.ns.saturating_sub(Self::STEP_NS),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::Lead;

    #[test]
    fn it_follows_the_usual_delays_and_no_single_one() {
        let mut lead = Lead::default();
        for wake in 0..400_u64 {
            let late_ns = if wake % 50 == 0 { 5_000_000 } else { 30_000 };
            lead.learn(0, late_ns);
        }
        assert!((25_000..=35_000).contains(&lead.ns), "{lead:?}");
        for _ in 0..200 {
            lead.learn(0, u64::MAX);
        }
        assert_eq!(lead.before(1_000_000), 1_000_000 - Lead::MOST_NS);
    }
}
