//! What a machine suffers: interrupts that come late, and calls that fail.
//!
//! Both are asked for, and follow from what was asked alone, so that a run with them can be
//! repeated.

use std::time::Duration;

use sched_dag::{Instance, TaskSet};

use crate::VirtualTime;
use crate::silent::{mix, share};

/// How late a timer's interrupt is.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Late {
    pub(crate) most_ns: u64,
    seed: u64,
}

/// A call that fails.
#[derive(Debug)]
pub(crate) struct Fault {
    dag: String,
    subtask: String,
    job: u64,
}

impl VirtualTime {
    /// Lets each interrupt of the scheduler's timer come late, by a time from 0 to `most` that
    /// is drawn uniformly. It follows from the seed and the time at which the interrupt is due.
    /// Another event that comes first does what is due.
    ///
    /// ```
    /// use std::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// let ms = Duration::from_millis;
    /// let machine = VirtualTime::new().late(ms(1), 7);
    /// let dag = create_dag();
    /// dag.name("clock").jobs(20).period(ms(10)).relative_deadline(ms(10));
    /// dag.register_untyped_subtask(|_| (), SubtaskAttributes::named("tick").wcet(ms(2)));
    /// finish_create_dags(&[dag]).unwrap();
    ///
    /// let report = machine.run();
    /// let late_ns = |job: &virtual_time::JobRecord| job.released_ns.unwrap() - job.release_ns;
    /// assert!(report.jobs.iter().any(|job| late_ns(job) > 500_000));
    /// assert!(report.jobs.iter().all(|job| late_ns(job) <= 1_000_000));
    /// assert_eq!(report.violations(), []);
    /// ```
    #[must_use = "the machine itself is returned"]
    pub fn late(self, most: Duration, seed: u64) -> Self {
        let most_ns = u64::try_from(most.as_nanos()).unwrap_or(u64::MAX);
        self.machine.surroundings.late.set(Late { most_ns, seed });
        self
    }

    /// Lets one call fail: in place of its function it executes as long as
    /// [`silent`](Self::silent) says, and then has the fault. May be called several times, and
    /// [contains](Self::contain_panics) panics. A commit without such a subtask is refused.
    ///
    /// ```
    /// use std::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// let ms = Duration::from_millis;
    /// let machine = VirtualTime::new().fault("clock", "tick", 3);
    /// let dag = create_dag();
    /// dag.name("clock").jobs(20).period(ms(10)).relative_deadline(ms(10));
    /// dag.register_untyped_subtask(|_| (), SubtaskAttributes::named("tick").wcet(ms(2)));
    /// finish_create_dags(&[dag]).unwrap();
    ///
    /// let report = machine.run();
    /// assert_eq!(report.dag("clock").statistics().completed, 3);
    /// assert_eq!(report.panics[0].instance.job, 3);
    /// assert_eq!(report.end_ns, 32_000_000);
    /// ```
    #[must_use = "the machine itself is returned"]
    pub fn fault(self, dag: &str, subtask: &str, job: u64) -> Self {
        self.machine.surroundings.faults.borrow_mut().push(Fault {
            dag: dag.into(),
            subtask: subtask.into(),
            job,
        });
        self.contain_panics()
    }
}

impl Late {
    /// Returns how late the interrupt is that is due then.
    pub(crate) fn of_interrupt_ns(self, due_ns: u64) -> u64 {
        let drawn = mix(mix(self.seed) ^ due_ns);
        share(drawn, self.most_ns.saturating_add(1))
    }
}

/// Reports whether a call has to fail.
pub(crate) fn fails(faults: &[Fault], instance: Instance, task_set: &TaskSet) -> bool {
    let dag = task_set.dag(instance.dag);
    let subtask = dag.subtask(instance.subtask).name();
    faults.iter().any(|fault| {
        fault.job == instance.job && fault.dag == dag.name() && fault.subtask == subtask
    })
}

/// Returns names of DAG and subtask of a call that is to fail and cannot be there.
pub(crate) fn absent(faults: &[Fault], task_set: &TaskSet) -> Option<(String, String)> {
    let is_there = |fault: &&Fault| {
        let mut dags = task_set.dags().iter().filter(|dag| dag.name() == fault.dag);
        let names = |name: &str| name == fault.subtask;
        dags.any(|dag| dag.subtasks().iter().any(|subtask| names(subtask.name())))
    };
    let absent = faults.iter().find(|fault| !is_there(fault))?;
    Some((absent.dag.clone(), absent.subtask.clone()))
}
