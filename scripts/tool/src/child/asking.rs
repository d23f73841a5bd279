//! When a child that can end in order is asked to, and when it is killed all the same.
//!
//! It is asked at its limit, and when a *signal* asks us to end, such as ctrl-C. After its limit it
//! has for as long as it prints, and 10 s; the next signal kills it at once. Before it has
//! printed anything it does not listen, and is not asked.

use std::time::Duration;

/// For how long a child that was asked at its limit may print nothing.
const GRACE: Duration = Duration::from_secs(10);

/// Why a child was asked to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// A person has pressed ctrl-C, or this program was asked to end.
    ByPerson,
    /// This limit was over.
    ByLimit(Duration),
}

/// The next step after a look at the child.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// To look again.
    Wait,
    /// To ask it.
    Ask(Asked),
    /// To kill it, as a person wants.
    Kill,
    /// To kill it, for its time is over.
    TimeOut,
}

/// The state of a child as seen so far.
#[derive(Debug)]
pub(super) struct Asking {
    limit: Duration,
    /// Why, and how many signals there had been then.
    why: Option<(Asked, u32)>,
    is_asked: bool,
    printed_bytes: u64,
    quiet_since: Duration,
}

impl Asking {
    /// Begins at the child's start.
    pub(super) const fn new(limit: Duration) -> Asking {
        Asking {
            limit,
            why: None,
            is_asked: false,
            printed_bytes: 0,
            quiet_since: Duration::ZERO,
        }
    }

    /// Returns why the child was asked, if it was.
    pub(super) fn why(&self) -> Option<Asked> {
        self.why.map(|(why, _)| why)
    }

    /// Takes a look: so much time, so many signals and so many bytes since the start.
    pub(super) fn step(&mut self, elapsed: Duration, signals: u32, printed_bytes: u64) -> Step {
        let is_over = elapsed >= self.limit;
        if printed_bytes > self.printed_bytes {
            self.printed_bytes = printed_bytes;
            self.quiet_since = elapsed;
        }
        match self.why {
            Some((_, before)) if signals > before => return Step::Kill,
            None if signals > 0 => self.why = Some((Asked::ByPerson, signals)),
            None if is_over => self.why = Some((Asked::ByLimit(self.limit), signals)),
            _ => {}
        }
        match self.why {
            Some((why, _)) if !self.is_asked && printed_bytes > 0 => {
                self.is_asked = true;
                self.quiet_since = elapsed;
                Step::Ask(why)
            }
            _ if is_over && elapsed.saturating_sub(self.quiet_since) >= GRACE => Step::TimeOut,
            _ => Step::Wait,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Asked, Asking, Step};
    use std::time::Duration;

    const LIMIT: Duration = Duration::from_secs(60);

    #[test]
    fn the_first_signal_or_the_limit_asks_and_the_second_or_silence_kills() {
        let (person, limit) = (Step::Ask(Asked::ByPerson), Step::Ask(Asked::ByLimit(LIMIT)));
        // Looks: seconds, signals, bytes. Of the steps, those that do not wait.
        for (looks, expected) in [
            (
                &[(1, 0, 9), (2, 1, 9), (3, 1, 9), (4, 2, 9)][..],
                &[(2, person), (4, Step::Kill)][..],
            ),
            // Two at once are one, and nobody is asked who cannot hear.
            (&[(1, 2, 0), (2, 2, 0), (3, 2, 1)], &[(3, person)]),
            (&[(1, 1, 0), (2, 2, 0)], &[(2, Step::Kill)]),
            // After the limit it has as long as it prints.
            (
                &[
                    (59, 0, 9),
                    (60, 0, 9),
                    (69, 0, 10),
                    (78, 0, 10),
                    (79, 0, 10),
                ],
                &[(60, limit), (79, Step::TimeOut)],
            ),
            (&[(60, 0, 9), (61, 1, 9)], &[(60, limit), (61, Step::Kill)]),
            (&[(60, 0, 0)], &[(60, Step::TimeOut)]),
        ] {
            let mut asking = Asking::new(LIMIT);
            let steps = looks.iter().map(|&(seconds, signals, bytes)| {
                let elapsed = Duration::from_secs(seconds);
                (seconds, asking.step(elapsed, signals, bytes))
            });
            let steps: Vec<_> = steps.filter(|(_, step)| *step != Step::Wait).collect();
            assert_eq!(steps, expected);
        }
    }
}
