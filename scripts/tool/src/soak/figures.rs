//! The figures of a soak run, added up over rounds.

use crate::protocol::MachineLine;
use crate::trace::Findings;

/// Sums over rounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Figures {
    /// Rounds that left figures.
    pub rounds: u64,
    /// From the first release to the last completion of each.
    pub guest_ns: u64,
    /// Jobs that were due.
    pub jobs: u64,
    /// Jobs complete.
    pub completed: u64,
    /// Deadlines missed.
    pub misses: u64,
    /// Jobs not released.
    pub skips: u64,
    /// Jobs aborted.
    pub aborts: u64,
    /// Instances that ran.
    pub instances: u64,
    /// How often one lost its core.
    pub preemptions: u64,
    /// Events of the traces.
    pub events: u64,
    /// Breaches of the rules that the guest found in its record.
    pub violations: u64,
    /// Breaches of the rules that the host found in the traces.
    pub breaches: u64,
    /// The longest time for which an instance waited that should have run.
    pub longest_inversion_ns: u64,
}

impl Figures {
    /// Adds a round's machine line.
    pub(super) fn add_line(&mut self, line: &MachineLine) {
        let number = |name| line.number_at(name).unwrap_or(0);
        self.add(&Figures {
            rounds: 1,
            guest_ns: number("span_ns"),
            jobs: number("jobs"),
            completed: number("completed"),
            misses: number("misses"),
            skips: number("skips"),
            aborts: number("aborts"),
            instances: number("instances"),
            preemptions: number("preemptions"),
            violations: number("violations"),
            ..Figures::default()
        });
    }

    /// Adds what a round's trace shows.
    pub(super) fn add_trace(&mut self, findings: &Findings) {
        self.add(&Figures {
            events: findings.figures.events as u64,
            breaches: findings.breaches.len() as u64,
            longest_inversion_ns: findings.figures.longest_inversion_ns,
            ..Figures::default()
        });
    }

    /// Adds other figures.
    pub fn add(&mut self, other: &Figures) {
        self.rounds += other.rounds;
        self.guest_ns += other.guest_ns;
        self.jobs += other.jobs;
        self.completed += other.completed;
        self.misses += other.misses;
        self.skips += other.skips;
        self.aborts += other.aborts;
        self.instances += other.instances;
        self.preemptions += other.preemptions;
        self.events += other.events;
        self.violations += other.violations;
        self.breaches += other.breaches;
        self.longest_inversion_ns = self.longest_inversion_ns.max(other.longest_inversion_ns);
    }

    /// Returns the head of the table whose rows [`row`](Self::row) makes.
    #[must_use]
    pub fn head() -> String {
        format!(
            "{:<18}{:>7}{:>9}{:>9}{:>10}{:>9}{:>8}{:>8}{:>11}{:>12}{:>11}{:>9}{:>11}",
            "part",
            "rounds",
            "guest s",
            "jobs",
            "completed",
            "misses",
            "skips",
            "aborts",
            "instances",
            "preemptions",
            "events",
            "breaches",
            "waits us"
        )
    }

    /// Returns a row of the table.
    #[must_use]
    pub fn row(&self, name: &str) -> String {
        format!(
            "{name:<18}{:>7}{:>9}{:>9}{:>10}{:>9}{:>8}{:>8}{:>11}{:>12}{:>11}{:>9}{:>11}",
            self.rounds,
            self.guest_ns / 1_000_000_000,
            self.jobs,
            self.completed,
            self.misses,
            self.skips,
            self.aborts,
            self.instances,
            self.preemptions,
            self.events,
            self.violations + self.breaches,
            self.longest_inversion_ns.div_ceil(1000)
        )
    }
}
