//! Calls whose functions do not say how long they take.

use common::random::{nth, scale};
use sched_dag::Instance;

use crate::VirtualTime;

/// The time that a call takes if its function executes nothing by `fass::execute_for`, and
/// the subtask has a WCET. Without one it takes none.
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
    /// None.
    NoTime,
    /// Its WCET: stated, or observed ([`VirtualTime::wcets`](crate::VirtualTime::wcets)).
    #[default]
    Wcet,
    /// A time from 1 ns to the WCET, drawn uniformly. It follows from the seed and the
    /// instance alone.
    Drawn {
        /// The seed.
        seed: u64,
    },
}

impl Silent {
    /// Returns how long a call takes, in nanoseconds.
    pub(crate) fn of_call_ns(self, instance: Instance, wcet_ns: Option<u64>) -> u64 {
        let wcet_ns = wcet_ns.unwrap_or(0);
        match self {
            Self::NoTime => 0,
            Self::Wcet => wcet_ns,
            Self::Drawn { seed } => {
                let Instance { dag, subtask, job } = instance;
                let numbers = [dag.0.into(), subtask.0.into(), job].into_iter();
                let drawn = numbers.fold(nth(seed, 0), |drawn, n| nth(drawn ^ n, 0));
                scale(drawn, wcet_ns.min(1)..=wcet_ns)
            }
        }
    }
}

impl VirtualTime {
    /// Sets how long a call takes whose function does not say so by `fass::execute_for`: its
    /// WCET, unless this says otherwise. What executes counts from the call's start, so
    /// `fass::now_ns` in the function does not show it.
    ///
    /// See [`Silent`].
    #[must_use = "the machine itself is returned"]
    pub fn silent(self, silent: Silent) -> Self {
        self.set(|settings| settings.silent = silent)
    }
}
