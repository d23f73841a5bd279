//! When a line is printed that is due: if nothing else is, or when it has waited long.
//!
//! To print takes core 0 some microseconds, of which a few have interrupts disabled,
//! and a release that falls on these is late. So a line waits until the scheduler's next
//! event leaves time for it. Where events come without a gap it would never be over:
//! then it is printed all the same, and may cost a release those microseconds.

use executive::machine::clock;
use executive::run::execution;

/// The time that a line takes, with room.
const TIME_TO_PRINT_NS: u64 = 100_000;

/// For how long a line waits at most.
const PATIENCE_NS: u64 = 100_000_000;

/// Since when a line has waited.
#[derive(Debug)]
pub(super) struct Patience {
    since_ns: Option<u64>,
}

impl Patience {
    pub(super) const fn new() -> Self {
        Self { since_ns: None }
    }

    /// Reports whether the line that is due is to be printed now, and if so begins
    /// anew for the next one.
    pub(super) fn is_over(&mut self) -> bool {
        self.ends(clock::now_ns(), execution::next_event_ns())
    }

    fn ends(&mut self, now_ns: u64, next_event_ns: u64) -> bool {
        let waited_ns = now_ns.saturating_sub(*self.since_ns.get_or_insert(now_ns));
        let is_quiet = next_event_ns.saturating_sub(now_ns) > TIME_TO_PRINT_NS;
        let ends = is_quiet || waited_ns >= PATIENCE_NS;
        if ends {
            self.since_ns = None;
        }
        ends
    }
}

#[cfg(test)]
mod tests {
    use super::{PATIENCE_NS, Patience};

    #[test]
    fn a_line_waits_for_a_gap_but_not_for_ever() {
        let mut patience = Patience::new();
        assert!(patience.ends(1_000, u64::MAX));
        assert!(!patience.ends(2_000, 3_000));
        assert!(
            patience.ends(3_000, 1_003_000),
            "the gaps of a DAG of 1 kHz do"
        );
        // Events without a gap, every 10 us.
        let waits = (0..).take_while(|step| {
            let now_ns = 5_000 + step * 10_000;
            !patience.ends(now_ns, now_ns + 10_000)
        });
        assert_eq!(waits.count() as u64, PATIENCE_NS / 10_000);
        assert!(!patience.ends(9_000, 10_000), "the next line waits anew");
    }
}
