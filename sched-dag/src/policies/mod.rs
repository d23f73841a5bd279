//! Policies: the orders of ready instances (R5). Each policy is a file of the folder and a row of
//! the table at the end.
//!
//! A policy gives each subtask of a DAG a *number* and says whether the job's nominal release is
//! added to it. The smallest sum goes first; among equal sums DAG, job and subtask decide. So the
//! place of an instance is fixed at the release of its job. Scheduler, law, analysis and witness
//! know nothing else of a policy; options, scenarios, recordings and pages take its word and its
//! row from the table.
//!
//! An order is no policy in this sense if it changes while an instance waits (least laxity at each
//! instant, time slices), or depends on the job's number.

use alloc::vec::Vec;

use crate::policy::Preemption;
use crate::task_set::Dag;

/// All properties of a policy.
struct PolicyRule {
    /// The policy's word in options, scenarios and traces.
    word: &'static str,
    /// Returns the number of each subtask of a DAG. If the release is added, a number is capped at
    /// the relative deadline.
    numbers: fn(&Dag) -> Vec<u64>,
    /// Whether the job's nominal release is added.
    adds_release: bool,
    /// Whether priorities count, so that each subtask of a DAG has to state one, or none.
    reads_priorities: bool,
}

impl Policy {
    /// Returns the word of options, scenarios and traces.
    pub const fn word(self) -> &'static str {
        Self::WORDS[self as usize]
    }

    /// Returns the policy with this word.
    pub fn of_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|policy| policy.word() == word)
    }

    /// Returns the number of each subtask of a DAG; the smaller number goes first.
    pub fn numbers(self, dag: &Dag) -> Vec<u64> {
        let mut numbers = (Self::RULES[self as usize].numbers)(dag);
        if self.adds_release() {
            // Capped, so that the sum is a valid time, like each deadline.
            let most_ns = dag.relative_deadline_ns();
            numbers
                .iter_mut()
                .for_each(|number| *number = most_ns.min(*number));
        }
        numbers
    }

    /// Reports whether the nominal release of a job is added to the numbers of its subtasks.
    pub const fn adds_release(self) -> bool {
        Self::RULES[self as usize].adds_release
    }

    /// Reports whether priorities count.
    pub(crate) const fn reads_priorities(self) -> bool {
        Self::RULES[self as usize].reads_priorities
    }
}

/// The scheduler's order of instances, and the number of cores.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SchedulerOptions {
    /// The order of the ready instances.
    pub policy: Policy,
    /// Whether a started instance may lose its core. With [`Preemption::Enabled`], non-preemptive
    /// subtasks still keep theirs.
    pub preemption: Preemption,
    /// The number of cores, at least 1: of the whole machine, or of one cluster where a
    /// [scheduler](crate::Scheduler::options) returns the options.
    pub cores: u32,
}

/// Makes the table of policies.
macro_rules! policies {
    ($($(#[doc = $doc:literal])+ $Name:ident = $module:ident;)+) => {
        $(mod $module;)+

        /// The order of the ready instances.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum Policy {
            $($(#[doc = $doc])+ $Name,)+
        }

        impl Policy {
            const RULES: &[PolicyRule] = &[$($module::RULE),+];

            /// All policies. Recordings store places in this list, so a new policy comes last.
            pub const ALL: [Self; Self::WORDS.len()] = [$(Self::$Name),+];

            /// The words of all policies.
            pub const WORDS: &[&str] = &[$($module::RULE.word),+];
        }
    };
}

policies! {
    /// By the subtask's [`Priority`](crate::Priority), the same for every job.
    StaticPriority = static_priority;
    /// By the job's absolute deadline, the earliest first.
    Edf = edf;
    /// By the job's release, the earliest first.
    Fifo = fifo;
    /// By the latest start at which the deadline can still be met at WCETs, the earliest first.
    LeastSlack = least_slack;
}

#[cfg(test)]
mod tests {
    use alloc::sync::Arc;
    use alloc::vec::Vec;

    use super::{Policy, SchedulerOptions};
    use crate::virtual_time::{ExecutionTimes, VirtualTime};
    use crate::{
        CommitOptions, ConstructionPolicy, DagId, DagSpec, Preemption, SubtaskSpec, verify,
    };

    /// Makes a DAG of one job with these WCETs.
    pub(super) fn dag(deadline_ns: u64, wcets_ns: &[u64], edges: &[(usize, usize)]) -> DagSpec {
        let subtask = |&wcet_ns: &u64| SubtaskSpec {
            wcet_ns: Some(wcet_ns),
            ..SubtaskSpec::default()
        };
        DagSpec {
            period_ns: Some(deadline_ns),
            relative_deadline_ns: Some(deadline_ns),
            jobs: Some(1),
            subtasks: wcets_ns.iter().map(subtask).collect(),
            edges: edges.to_vec(),
            ..DagSpec::default()
        }
    }

    /// Runs a job of each DAG on two cores, released together, with WCETs. Returns the last finish,
    /// and the late DAGs.
    pub(super) fn run(word: &str, specs: &[DagSpec]) -> (u64, Vec<u32>) {
        let policy = Policy::of_word(word).unwrap();
        let options = CommitOptions::new(policy, 2);
        let options = options.with_construction(ConstructionPolicy::any_graph());
        let task_set = Arc::new(verify(specs, &options).unwrap().task_set);
        let options = SchedulerOptions {
            policy,
            preemption: Preemption::Enabled,
            cores: 2,
        };
        let mut run = VirtualTime::new(&task_set, options);
        let wcets = |of: crate::Instance| task_set.dag(of.dag).subtask(of.subtask).wcet_ns();
        let _ = run.run(&mut ExecutionTimes(|of| wcets(of).unwrap()));
        let dags = (0..).take(specs.len()).filter(|&dag| {
            let dag = DagId(dag);
            run.scheduler_of(dag).statistics(dag).misses > 0
        });
        (run.now_ns(), dags.collect())
    }

    #[test]
    fn the_least_slack_saves_a_path_that_deadlines_start_late() {
        let specs = [
            dag(9, &[2], &[]),
            dag(9, &[2], &[]),
            dag(10, &[1, 9], &[(0, 1)]),
        ];
        assert_eq!(run("edf", &specs), (12, alloc::vec![2]));
        assert_eq!(run("slack", &specs), (10, alloc::vec![]));
    }

    #[test]
    fn each_policy_is_that_of_its_word_and_numbers_each_subtask() {
        let spec = DagSpec {
            period_ns: Some(9),
            relative_deadline_ns: Some(9),
            subtasks: alloc::vec![SubtaskSpec::default(); 3],
            edges: alloc::vec![(0, 1), (1, 2)],
            ..DagSpec::default()
        };
        for policy in Policy::ALL {
            let word = policy.word();
            assert_eq!(Policy::of_word(word), Some(policy), "{word} is of two");
            let options = CommitOptions::new(policy, 1);
            let task_set = verify(core::slice::from_ref(&spec), &options)
                .unwrap()
                .task_set;
            assert_eq!(policy.numbers(&task_set.dags()[0]).len(), 3, "{word}");
        }
    }
}
