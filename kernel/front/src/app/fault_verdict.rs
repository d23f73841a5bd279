//! Whether a fault makes the app fail.
//!
//! An app that ignores a fault in one of its DAGs has failed, and so says its verdict. An
//! app to which faults belong says so
//! (`Machine::accept_faults`) and judges them by itself.

use alloc::format;
use alloc::string::String;
use core::cell::{Cell, RefCell};

use sched_dag::{DagId, TaskSet};

use super::ending::Ending;

/// What is known of faults in the runs so far.
#[derive(Debug, Default)]
pub struct FaultVerdict {
    are_accepted: Cell<bool>,
    /// Why the app fails, if it does.
    complaint: RefCell<Option<String>>,
}

impl FaultVerdict {
    /// Leaves the faults of all runs to the app.
    pub fn accept(&self) {
        self.are_accepted.set(true);
    }

    /// Notes which DAGs of a run have been ended by faults. Allocates only if there
    /// are any.
    pub fn note(&self, task_set: &TaskSet, faults: impl Fn(DagId) -> u64) {
        let dags = (0..).map(DagId).zip(task_set.dags());
        let mut ended = dags.filter(|(dag, _)| faults(*dag) > 0);
        let mut complaint = self.complaint.borrow_mut();
        if complaint.is_some() {
            return;
        }
        *complaint = ended.next().map(|(_, dag)| {
            let others = match ended.count() {
                0 => String::new(),
                count => format!(", and {count} more"),
            };
            format!(
                "a fault ended dag `{}`{others}; the line that begins with `fault:` says which",
                dag.name()
            )
        });
    }

    /// Returns how an app ends whose function has returned `result`.
    pub fn judge(&self, result: Result<(), Ending>) -> Result<(), Ending> {
        let complaint = self.complaint.take().filter(|_| !self.are_accepted.get());
        Ending::or_complaint(result, complaint)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fass::Policy;
    use sched_dag::{CommitOptions, DagSpec, SubtaskSpec, verify};

    /// Judges an app that had one run of the DAGs `a`, `b` and `c`.
    fn judged(faults: [u64; 3], accepts: bool, result: Result<(), Ending>) -> String {
        let dags = ["a", "b", "c"].map(|name| DagSpec {
            name: name.into(),
            period_ns: Some(10),
            relative_deadline_ns: Some(10),
            subtasks: alloc::vec![SubtaskSpec::default()],
            ..DagSpec::default()
        });
        let options = CommitOptions::new(Policy::Edf, 1);
        let task_set = verify(&dags, &options).expect("sound DAGs").task_set;
        let verdict = FaultVerdict::default();
        verdict.note(&task_set, |dag| faults[dag.index()]);
        if accepts {
            verdict.accept();
        }
        match verdict.judge(result) {
            Ok(()) => "success".into(),
            Err(ending) => format!("{ending}"),
        }
    }

    #[test]
    fn faults_that_nobody_has_accepted_are_a_failure() {
        assert_eq!(judged([0; 3], false, Ok(())), "success");
        let one = "a fault ended dag `b`; the line that begins with `fault:` says which";
        assert_eq!(judged([0, 2, 0], false, Ok(())), one);
        assert_eq!(judged([0, 2, 0], false, Err(Ending::Shutdown)), one);
        assert_eq!(
            judged([1, 0, 1], false, Ok(())),
            "a fault ended dag `a`, and 1 more; the line that begins with `fault:` says which"
        );
    }

    #[test]
    fn the_app_has_the_last_word() {
        assert_eq!(judged([1; 3], true, Ok(())), "success");
        let own = || Err(Ending::Failure("late".into()));
        assert_eq!(judged([1; 3], false, own()), "late");
    }
}
