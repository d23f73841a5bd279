//! Which combinations of what can happen to a DAG a soak run has come across.
//!
//! A rule may hold for each policy, for each fault and for each pause, and break where two of them
//! meet. So a run tells what it has not tried: for each policy and overrun policy, with the cores
//! undivided and in clusters, how many DAGs had which of a fault, a restart after a fault, and a
//! pause. It is counted from the traces, that is from what has happened, and a combination that
//! no DAG had is printed as `never`.

use std::fmt::Write as _;

use sched_dag::journal::What;
use sched_dag::{DagId, OverrunPolicy, Policy};

use crate::trace::model::Run;

const POLICIES: [(Policy, &str); 2] = [(Policy::StaticPriority, "static"), (Policy::Edf, "edf")];

const OVERRUNS: [(OverrunPolicy, &str); 3] = [
    (OverrunPolicy::Queue, "queue"),
    (OverrunPolicy::Skip, "skip"),
    (OverrunPolicy::Abort, "abort"),
];

/// Whether the cores are divided into clusters.
const CORES: [&str; 2] = ["together", "clusters"];

/// What can happen to a DAG. A restart follows a fault.
const HAPPENED: [&str; 6] = [
    "nothing",
    "fault",
    "restart",
    "pause",
    "pause+fault",
    "pause+restart",
];

const ROWS: usize = POLICIES.len() * OVERRUNS.len() * CORES.len();

/// How many DAGs of a round had each combination.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Coverage([[u64; HAPPENED.len()]; ROWS]);

impl Coverage {
    /// Counts each DAG of a run.
    pub(super) fn add_run(&mut self, run: &Run) {
        let policy = POLICIES
            .iter()
            .position(|(it, _)| *it == run.options.policy);
        let cores = usize::from(run.task_set.is_divided());
        for (dag, model) in (0..).map(DagId).zip(run.task_set.dags()) {
            let overrun = OVERRUNS.iter().position(|(it, _)| *it == model.overrun());
            let had = |what| (run.events.iter()).any(|it| it.dag == dag && it.what == what);
            let fault = match had(What::Ended) {
                true => 1 + usize::from(had(What::Restarted)),
                false => 0,
            };
            let happened = fault + 3 * usize::from(had(What::Off));
            if let (Some(policy), Some(overrun)) = (policy, overrun) {
                let row = (policy * OVERRUNS.len() + overrun) * CORES.len() + cores;
                self.0[row][happened] += 1;
            }
        }
    }

    /// Adds what another one has counted.
    pub(super) fn add(&mut self, other: &Self) {
        let counts = self.0.as_flattened_mut().iter_mut();
        for (count, more) in counts.zip(other.0.as_flattened()) {
            *count += more;
        }
    }

    /// Returns how many combinations at least one DAG had.
    #[must_use]
    pub fn hit(&self) -> usize {
        let counts = self.0.as_flattened().iter();
        counts.filter(|count| **count > 0).count()
    }

    /// Returns the table, and how many combinations there were.
    #[must_use]
    pub fn table(&self) -> String {
        let mut text = format!("{:<8}{:<9}{:<10}", "policy", "overrun", "cores");
        for name in HAPPENED {
            let _ = write!(text, "{name:>14}");
        }
        let names = POLICIES.iter().flat_map(|(_, policy)| {
            let cores = move |overrun| CORES.iter().map(move |cores| (policy, overrun, cores));
            OVERRUNS.iter().flat_map(move |(_, overrun)| cores(overrun))
        });
        for ((policy, overrun, cores), counts) in names.zip(&self.0) {
            let _ = write!(text, "\n{policy:<8}{overrun:<9}{cores:<10}");
            for count in counts {
                let count = match count {
                    0 => "never".to_owned(),
                    count => count.to_string(),
                };
                let _ = write!(text, "{count:>14}");
            }
        }
        let (hit, all) = (self.hit(), self.0.as_flattened().len());
        let _ = write!(text, "\n{hit} of {all} combinations were hit");
        text
    }
}

#[cfg(test)]
mod tests {
    use sched_dag::CoreId;
    use sched_dag::journal::Event;

    use super::*;
    use crate::made::{commit, record_of};
    use crate::record::Record;

    const TWO: &str = "static 2\nx T=9 D=9 O=0: a/0\ny T=9 D=9 O=0: a/0";

    /// A run of two DAGs, to which this happened.
    fn of_run(policy: Policy, events: &[(u32, What)]) -> Coverage {
        let mut run = Record::read(&record_of("", &commit(TWO), ""))
            .expect("it is a trace")
            .runs
            .remove(0);
        run.options.policy = policy;
        let event = |(dag, what): &(u32, What)| Event {
            time_ns: 0,
            what: *what,
            core: CoreId(0),
            dag: DagId(*dag),
            job: 0,
            subtask: None,
        };
        run.events = events.iter().map(event).collect();
        let mut coverage = Coverage::default();
        coverage.add_run(&run);
        coverage
    }

    #[test]
    fn a_combination_that_no_dag_had_is_printed_as_such() {
        let mut coverage = of_run(Policy::StaticPriority, &[]);
        coverage.add(&of_run(Policy::Edf, &[(0, What::Ended), (1, What::Off)]));
        let happened = [(0, What::Ended), (0, What::Restarted), (0, What::Off)];
        coverage.add(&of_run(Policy::Edf, &happened));
        let table = coverage.table();
        let rows: Vec<String> = table
            .lines()
            .map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "))
            .collect();
        for row in [
            "policy overrun cores nothing fault restart pause pause+fault pause+restart",
            "static queue together 2 never never never never never",
            "edf queue together 1 1 never 1 never 1",
            "edf queue clusters never never never never never never",
        ] {
            assert!(rows.iter().any(|it| it == row), "{table}\n  not: {row}");
        }
        assert!(
            table.ends_with("\n5 of 72 combinations were hit"),
            "{table}"
        );
    }
}
