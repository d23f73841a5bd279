//! Settings of a machine, made by the builder's methods before the commit: also the duration of
//! calls that state none, and disturbances: late interrupts and failing calls.
//!
//! Everything follows from the given settings alone, so a run can be repeated.

use std::time::Duration;

use fass::platform::RunConfig;
use random::{nth, scale};
use sched_dag::{Dag, Instance, Subtask, TaskSet};

use crate::{VirtualTime, nanoseconds};

/// Settings of a machine.
#[derive(Clone, Debug, Default)]
pub(crate) struct Settings {
    /// The terms of the commits to come.
    pub(crate) terms: RunConfig,
    /// The duration of calls that do not state one.
    pub(crate) silent: Silent,
    /// How late interrupts are.
    pub(crate) late: Late,
    /// The failing calls.
    pub(crate) faults: Vec<Fault>,
    /// Whether a panic of a function ends only its DAG, or costs one of its jobs.
    pub(crate) contains_panics: bool,
    /// The number of jobs whose inputs are kept, unless everything is kept.
    pub(crate) most_jobs: Option<u32>,
}

/// How late a timer's interrupt is.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Late {
    pub(crate) most_ns: u64,
    seed: u64,
}

/// A failing call.
#[derive(Clone, Debug)]
pub(crate) struct Fault {
    dag: String,
    subtask: String,
    job: u64,
}

impl VirtualTime {
    /// Delays each interrupt of the scheduler's timer by a time drawn uniformly from 0 to `most`.
    /// The delay depends on the seed and the interrupt's due time. If another event comes first,
    /// the scheduler handles the due work at that event.
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
    /// let late_ns = |job: &virtual_time::JobRecord| job.released_ns.zip(job.release_ns).map_or(0, |(at, due)| at - due);
    /// assert!(report.jobs.iter().any(|job| late_ns(job) > 500_000));
    /// assert!(report.jobs.iter().all(|job| late_ns(job) <= 1_000_000));
    /// assert_eq!(report.violations(), []);
    /// ```
    pub fn late(self, most: Duration, seed: u64) -> Self {
        let most_ns = nanoseconds(most);
        self.set(|settings| settings.late = Late { most_ns, seed })
    }

    /// Makes one call fail: instead of its function, the call executes as long as
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
    pub fn fault(self, dag: &str, subtask: &str, job: u64) -> Self {
        let fault = Fault {
            dag: dag.into(),
            subtask: subtask.into(),
            job,
        };
        self.set(|settings| settings.faults.push(fault))
            .contain_panics()
    }
}

impl Late {
    /// Returns how late the interrupt due at `due_ns` is.
    pub(crate) fn of_interrupt_ns(self, due_ns: u64) -> u64 {
        // By the due time, not by a count of draws: an interrupt forestalled by another event does
        // not change the delays of later ones.
        scale(nth(nth(self.seed, 0) ^ due_ns, 0), 0..=self.most_ns)
    }
}

impl Fault {
    fn is_of(&self, dag: &Dag, subtask: &Subtask) -> bool {
        self.dag == dag.name() && self.subtask == subtask.name()
    }

    /// Reports whether this call has to fail.
    pub(crate) fn is(&self, instance: Instance, task_set: &TaskSet) -> bool {
        let dag = task_set.dag(instance.dag);
        self.job == instance.job && self.is_of(dag, dag.subtask(instance.subtask))
    }

    /// Returns the names of DAG and subtask if there is no such call.
    pub(crate) fn absent(&self, task_set: &TaskSet) -> Option<(&str, &str)> {
        let is_in = |dag: &Dag| {
            dag.subtasks()
                .iter()
                .any(|subtask| self.is_of(dag, subtask))
        };
        let is_there = task_set.dags().iter().any(is_in);
        (!is_there).then_some((&self.dag, &self.subtask))
    }
}

/// The duration of a call if its function executes nothing by `fass::execute_for`, and the subtask
/// has a WCET. Without a WCET, the call takes no time.
///
/// ```
/// use std::time::Duration;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::{Silent, VirtualTime};
///
/// let response_ns = |silent| {
///     let machine = VirtualTime::new().silent(silent);
///     let (dag, period) = (create_dag(), Duration::from_millis(10));
///     dag.period(period).relative_deadline(period).jobs(1);
///     let tick = SubtaskAttributes::named("tick").wcet(Duration::from_millis(2));
///     dag.register_untyped_subtask(|_| (), tick);
///     finish_create_dags(&[dag]).unwrap();
///     let report = machine.run();
///     assert_eq!(report.took_no_time(), silent == Silent::NoTime);
///     report.jobs[0].response_time_ns().unwrap()
/// };
/// assert_eq!(response_ns(Silent::NoTime), 0);
/// assert_eq!(response_ns(Silent::Wcet), 2_000_000);
/// assert!((1..=2_000_000).contains(&response_ns(Silent::Drawn { seed: 7 })));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Silent {
    /// No time.
    NoTime,
    /// The WCET: stated, or observed ([`VirtualTime::wcets`](crate::VirtualTime::wcets)).
    #[default]
    Wcet,
    /// A time from 1 ns to the WCET, drawn uniformly. The time depends only on the seed and the
    /// instance.
    Drawn {
        /// The seed.
        seed: u64,
    },
}

impl Silent {
    /// Returns the duration of a segment of a call, in nanoseconds. If a subtask's WCET is only
    /// known as a whole, the first segment takes the whole time.
    pub(crate) fn of_call_ns(self, instance: Instance, segment: usize, subtask: &Subtask) -> u64 {
        let wcet_ns = match subtask.segments_ns() {
            Some(segments_ns) => segments_ns.get(segment).copied(),
            None => subtask.wcet_ns().filter(|_| segment == 0),
        };
        let wcet_ns = wcet_ns.unwrap_or(0);
        match self {
            Self::NoTime => 0,
            Self::Wcet => wcet_ns,
            Self::Drawn { seed } => {
                let Instance { dag, subtask, job } = instance;
                let numbers = [dag.0.into(), subtask.0.into(), job].into_iter();
                let numbers = numbers.chain((1..).take(segment));
                let drawn = numbers.fold(nth(seed, 0), |drawn, n| nth(drawn ^ n, 0));
                // At least 1 ns, so a call with a WCET takes time; without a WCET the result is 0.
                scale(drawn, wcet_ns.min(1)..=wcet_ns)
            }
        }
    }
}

impl VirtualTime {
    /// Sets the duration of calls whose functions state none by `fass::execute_for`. The default is
    /// the WCET. The time counts from the call's start, and is added after the function has
    /// returned, so `fass::now_ns` in the function does not show it.
    ///
    /// See [`Silent`].
    pub fn silent(self, silent: Silent) -> Self {
        self.set(|settings| settings.silent = silent)
    }
}

impl VirtualTime {
    /// Returns the terms of the commits to come, for a program that takes them from words.
    #[doc(hidden)]
    #[must_use]
    pub fn terms(&self) -> RunConfig {
        self.machine.settings.borrow().terms.clone()
    }

    /// Changes the terms of the commits to come.
    #[doc(hidden)]
    pub fn change(&self, change: impl FnOnce(&mut RunConfig)) {
        change(&mut self.machine.settings.borrow_mut().terms);
    }
}
