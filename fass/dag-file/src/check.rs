//! Finds the commit's faults in advance, and reports them with the lines of the file.
//!
//! The commit names DAGs and subtasks. The author of a file looks for a line, so each fault gets
//! the line of its edge, subtask or DAG.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use sched_dag::{
    CommitOptions, ConstructionPolicy, DagFault, DagSpec, MOST_FAULTS, RejectedDags, SubtaskId,
    SubtaskLabel, VerifiedDags, sorted_by_key, verify,
};
use text::Malformed;
use text::of_file;

use crate::file::{FileDag, Set};
use crate::length::Length;

/// Verifies a set as its commit on a machine will, with any shape of graph allowed.
///
/// # Errors
///
/// Every fault, with its line; of very many faults only the first, and their number.
pub fn check(set: &Set, machine: &CommitOptions, length: Length) -> Result<(), Vec<Malformed>> {
    let Err(rejected) = verified(set, machine, length) else {
        return Ok(());
    };
    let faults = of_file(&rejected);
    let found: Vec<(usize, String)> = faults
        .map(|(fault, reason)| (line_of(set, fault), reason))
        .collect();
    let order = sorted_by_key(found.len(), |fault| found[fault].0);
    let more = found.len().saturating_sub(MOST_FAULTS);
    let told = order.iter().zip(0..=MOST_FAULTS).map(|(&fault, rank)| {
        let (line, reason) = &found[fault];
        let reason = match rank {
            MOST_FAULTS => format!("and {more} more faults from this line on"),
            _ => reason.clone(),
        };
        Malformed {
            line: *line,
            reason,
        }
    });
    Err(told.collect())
}

/// Verifies a set as [`check`] does, and returns its model.
///
/// # Errors
///
/// Every fault.
pub fn verified(
    set: &Set,
    machine: &CommitOptions,
    length: Length,
) -> Result<VerifiedDags, RejectedDags> {
    let length = length.of(set);
    let specs = set.dags.iter().map(|dag| DagSpec {
        jobs: Some(length.jobs(&dag.spec)),
        ..dag.spec.clone()
    });
    let specs: Vec<DagSpec> = specs.collect();
    let options = machine
        .clone()
        .with_construction(ConstructionPolicy::any_graph())
        .with_lists(&set.core_lists());
    verify(&specs, &options)
}

/// Returns the line of a fault; 1 if the fault concerns no particular line.
fn line_of(set: &Set, fault: &DagFault) -> usize {
    let line = match fault {
        DagFault::Cycle { dag, hops } => set.dags.get(dag.id.index()).map(|dag| {
            let ends = (hops.last(), hops.first());
            edge_line(dag, ends).unwrap_or(dag.line)
        }),
        DagFault::SelfEdge { dag, subtask, .. } => set.dags.get(dag.id.index()).map(|dag| {
            let ends = (Some(subtask), Some(subtask));
            edge_line(dag, ends).unwrap_or(dag.line)
        }),
        DagFault::WcetExceedsDeadline { dag, subtask, .. }
        | DagFault::TooManyWaits { dag, subtask, .. }
        | DagFault::ZeroSinkDeadline { dag, sink: subtask }
        | DagFault::SinkDeadlineBeyondDag {
            dag, sink: subtask, ..
        }
        | DagFault::DeadlineOfNoSink { dag, subtask, .. } => set
            .dags
            .get(dag.id.index())
            .map(|dag| subtask_line(dag, subtask.id).unwrap_or(dag.line)),
        DagFault::PrioritiesPartlyGiven { dag, without } => {
            set.dags.get(dag.id.index()).map(|dag| {
                let first = without.first();
                let line = first.and_then(|subtask| subtask_line(dag, subtask.id));
                line.unwrap_or(dag.line)
            })
        }
        DagFault::TooManyInstances { dag, .. }
        | DagFault::NoSubtasks { dag }
        | DagFault::NoSource { dag }
        | DagFault::NoSink { dag }
        | DagFault::TooManySubtasks { dag, .. }
        | DagFault::ZeroPeriod { dag }
        | DagFault::ZeroDeadline { dag }
        | DagFault::ZeroInFlight { dag }
        | DagFault::ZeroJobs { dag }
        | DagFault::TimeOverflow { dag, .. }
        | DagFault::NoCluster { dag, .. }
        | DagFault::UnknownCluster { dag, .. }
        | DagFault::AffinityOutOfRange { dag, .. }
        | DagFault::AffinitiesOverlap { dag, .. }
        | DagFault::PrioritiesExhausted { dag } => set.dags.get(dag.id.index()).map(|dag| dag.line),
        DagFault::CoreList { list, .. } => {
            let mut lists = set.lists.iter();
            let is_it = |text: &str| text.split(':').next() == Some(list);
            // Of two lists for one core the later list is the surplus one.
            let found = lists.rfind(|(_, text)| is_it(text));
            found.map(|(line, _)| *line)
        }
        _ => None,
    };
    line.unwrap_or(1)
}

fn subtask_line(dag: &FileDag, subtask: SubtaskId) -> Option<usize> {
    Some(dag.subtasks.get(subtask.index())?.line)
}

/// Returns the line of the edge between two subtasks.
fn edge_line(dag: &FileDag, ends: (Option<&SubtaskLabel>, Option<&SubtaskLabel>)) -> Option<usize> {
    let ends = (ends.0?.id.index(), ends.1?.id.index());
    let position = dag.spec.edges.iter().position(|edge| *edge == ends)?;
    dag.edge_lines.get(position).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parse::parse;
    use sched_dag::{CoreDivision, Policy};

    fn faults_on(clusters: CoreDivision, text: &str, length: Length) -> Vec<String> {
        let machine = CommitOptions::new(Policy::StaticPriority, 2).with_clusters(clusters);
        let file = parse(text).unwrap();
        let faults = check(&file.sets[0], &machine, length).unwrap_err();
        faults.iter().map(ToString::to_string).collect()
    }

    /// A file of one DAG, and how the faults begin that are found in it.
    const FAULTS: &str = r"
period 1s\nsubtask a wcet 1ms\nsubtask b wcet 1ms\nedge a -> b\nedge b -> a
  line 5: dag `x` has a cycle: subtask `a` -> subtask `b` -> subtask `a`; remove
period 1s\nsubtask a wcet 1ms\nedge a -> a
  line 3:
period 0s deadline 1ms in-flight 0\n# no\nsubtask a wcet 2ms priority 1\nsubtask b wcet 1ms
  line 1:
  line 1:
  line 3:
  line 4:
period 9ms\nsubtask a wcet 1ms deadline 5ms\nsubtask b wcet 1ms deadline 0ns\nedge a -> b
  line 2: subtask `a` of dag `x` has a relative deadline and is no sink, for subtask `b`
  line 3: subtask `b` of dag `x` has a relative deadline of 0; give it at least 1 ns
  line 3: subtask `b` of dag `x` has a WCET of 1ms, longer than the relative deadline of 0ns;
period 9ms\nsubtask c wcet 1ms deadline 10ms
  line 2: subtask `c` of dag `x` has a relative deadline of 10ms, longer than its DAG's
period 9ms affinity 0,2\nsubtask a wcet 1ms
  line 1: dag `x` has an affinity to core 2, and its cluster has 2, counted from 0; state one
period 9ms\nsubtask a wcet 1ms\nsubtask b wcet 1ms\ncore 0: x.a x.b\ncore 1: x.b
  line 4: the list of core 0: `x.b#0` stands twice
period 9ms affinity 0\nsubtask a wcet 1ms\ndag y period 9ms\nsubtask a wcet 1ms
  line 3: dag `x` and dag `y` share core 0 and not all others
period 9ms\nsubtask a wcet 1ms\ndag y period 9ms jobs 0\nsubtask a wcet 1ms
  line 3: dag `y` has a limit of 0 jobs; give at least 1
period 584000s\nsubtask a wcet 1ms
  line 1:";

    #[test]
    fn every_fault_has_its_line() {
        for case in FAULTS.split("\nperiod ").skip(1) {
            let mut rows = case.lines();
            let text = rows.next().expect("a file").replace(r"\n", "\n");
            let text = format!("dag x period {text}\nend");
            let jobs = Length::Jobs(if text.contains("584000s") {
                1_000_000
            } else {
                1
            });
            let found = faults_on(CoreDivision::Undivided, &text, jobs);
            let rows: Vec<&str> = rows.map(str::trim_start).collect();
            let pairs = || found.iter().zip(&rows);
            assert!(
                pairs().all(|(found, row)| found.starts_with(row)),
                "{found:#?}"
            );
            assert_eq!(found.len(), rows.len(), "{found:#?}");
        }
    }

    #[test]
    fn too_many_waits_are_told_with_the_line_of_their_subtask() {
        let waits = " wait 1ns wcet 1ns".repeat(255);
        let text = format!("dag x period 9ms\nsubtask a wcet 1ms\nsubtask b wcet 1ms{waits}\nend");
        let found = faults_on(CoreDivision::Undivided, &text, Length::Jobs(1));
        let told = "line 3: subtask `b` of dag `x` states 255 waits, more than 254; split it";
        assert_eq!(found, [told]);
        // The limits of all waits of a DAG are summed up.
        let text = "dag x period 9ms\nsubtask a wcet 1ms wait 10000000000s wcet 1ms wait \
                    10000000000s wcet 1ms\nend";
        let found = faults_on(CoreDivision::Undivided, text, Length::Jobs(1));
        assert!(
            found[0].starts_with("line 1: the sum of the limits"),
            "{found:?}"
        );
    }

    #[test]
    fn a_cluster_that_is_not_is_told_with_the_line_of_its_dag() {
        let text = "dag x period 9ms cluster 0\nsubtask a wcet 1ms\n\
                    dag y period 9ms cluster 2\nsubtask a wcet 1ms\n\
                    dag z period 9ms\nsubtask a wcet 1ms\nend";
        let divided = CoreDivision::Of(alloc::vec![1, 1]);
        let found = faults_on(divided, text, Length::Jobs(1));
        assert!(
            found[0].starts_with("line 3: dag `y` is in cluster 2"),
            "{}",
            found[0]
        );
        assert!(
            found[1].starts_with("line 5: dag `z` is in no cluster"),
            "{}",
            found[1]
        );
        let found = faults_on(CoreDivision::Undivided, text, Length::Jobs(1));
        assert!(found[0].ends_with("leave its cluster out"), "{}", found[0]);
    }

    #[test]
    fn the_remedy_is_in_the_words_of_the_file() {
        let text =
            "dag x period 1s in-flight 4294967295\nsubtask a wcet 1ms\nsubtask b wcet 1ms\nend";
        let found = faults_on(CoreDivision::Undivided, text, Length::Jobs(u64::MAX));
        assert!(
            found[0].ends_with("needs most; lower its in-flight"),
            "{}",
            found[0]
        );
    }
}
