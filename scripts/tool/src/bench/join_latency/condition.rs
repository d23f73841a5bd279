//! One condition: what joins, how many parallel subtasks, which seed.

use std::fmt;

use replay::shown::quoted;

/// What makes the joins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Policy {
    /// The DAG's scheduler.
    Fass,
    /// Equal stamps.
    Exact,
    /// Stamps at most this number of milliseconds apart.
    Approximate(u64),
}

impl Policy {
    /// Reads a list of names with commas between.
    pub(super) fn list(text: &str) -> Result<Vec<Policy>, String> {
        let policy = |name| {
            Policy::from_name(name).ok_or_else(|| {
                format!(
                    "`--policies`: {} is none; there are fass, exact, and approximate-MS with 1 \
                     to 1000000 ms",
                    quoted(name)
                )
            })
        };
        text.split(',').map(policy).collect()
    }

    fn from_name(name: &str) -> Option<Policy> {
        let number = name.strip_prefix("approximate-");
        let max_interval_ms = number.and_then(|number| number.parse().ok());
        let close = max_interval_ms.filter(|ms| (1..=1_000_000).contains(ms));
        let close = close.map(Policy::Approximate);
        let mut all = [Policy::Fass, Policy::Exact].into_iter().chain(close);
        // `+7` would parse too, and be another name for the same.
        all.find(|policy| policy.to_string() == name)
    }

    /// Names it for people.
    pub(super) fn title(self) -> String {
        match self {
            Policy::Fass => "FasS (DAG)".into(),
            Policy::Exact => "ExactTime".into(),
            Policy::Approximate(ms) => format!("ApproximateTime {ms} ms"),
        }
    }
}

impl fmt::Display for Policy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Policy::Fass => f.write_str("fass"),
            Policy::Exact => f.write_str("exact"),
            Policy::Approximate(ms) => write!(f, "approximate-{ms}"),
        }
    }
}

/// What one boot measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Condition {
    pub(super) policy: Policy,
    pub(super) subtasks: usize,
    pub(super) seed: u64,
}

impl Condition {
    /// Returns the name of its file, without the ending.
    pub(super) fn file_stem(&self) -> String {
        format!("{}-n{}-seed{}", self.policy, self.subtasks, self.seed)
    }

    /// Returns its words of the guest's command line.
    pub(super) fn guest_words(&self, jobs: u64, queue: u64) -> String {
        // Inputs of the parallel subtasks must hold their backlog, which grows
        // slower than the jobs.
        let depth = jobs.clamp(1000, 100_000);
        let of_queues = format!("queue={queue} depth={depth}");
        let policy = match self.policy {
            Policy::Approximate(ms) => format!("approximate max_interval_ms={ms} {of_queues}"),
            Policy::Exact => format!("exact {of_queues}"),
            Policy::Fass => "fass".into(),
        };
        let (subtasks, seed) = (self.subtasks, self.seed);
        format!("policy_under_test={policy} subtasks={subtasks} jobs={jobs} seed={seed}")
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (policy, subtasks) = (self.policy.title(), self.subtasks);
        write!(f, "{policy}, N = {subtasks}, seed {}", self.seed)
    }
}

#[cfg(test)]
mod tests {
    use super::{Condition, Policy};

    #[test]
    fn policies_are_read_back() {
        let text = "fass,exact,approximate-10";
        let policies = Policy::list(text).unwrap();
        assert_eq!(
            policies,
            [Policy::Fass, Policy::Exact, Policy::Approximate(10)]
        );
        let names: Vec<String> = policies.iter().map(ToString::to_string).collect();
        assert_eq!(names.join(","), text);
    }

    #[test]
    fn a_wrong_policy_is_named() {
        for wrong in [
            "fas",
            "approximate",
            "approximate-0",
            "approximate-+7",
            "approximate-",
            "",
        ] {
            let message = Policy::list(&format!("fass,{wrong}")).unwrap_err();
            assert!(message.contains(&format!("`{wrong}` is none")), "{message}");
        }
    }

    #[test]
    fn the_guest_is_told_what_matters_to_it() {
        let words = |policy| {
            Condition {
                policy,
                subtasks: 4,
                seed: 9,
            }
            .guest_words(50, 7)
        };
        assert_eq!(
            words(Policy::Fass),
            "policy_under_test=fass subtasks=4 jobs=50 seed=9"
        );
        assert_eq!(
            words(Policy::Approximate(30)),
            "policy_under_test=approximate max_interval_ms=30 queue=7 depth=1000 subtasks=4 \
             jobs=50 seed=9"
        );
    }
}
