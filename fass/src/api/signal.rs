//! Signals: events releasing sporadic DAGs.
//!
//! A *sporadic* DAG has no period. Each job is released by a *signal*, and never earlier than one
//! *minimum inter-arrival time* after the job before. The scheduler enforces this distance,
//! whatever happens outside, so the DAG can be analysed like a periodic DAG with that period. One
//! signal waits until its job can be released; further signals meanwhile are dropped and counted. A
//! paused DAG skips the job of a signal, and an ended DAG drops its signals
//! (`sched-dag/src/scheduler/signals.rs` has the rules).
//!
//! Signals come from five places:
//!
//! - a subtask, of any DAG of the commit, with the signal declared at registration
//!   ([`Signal::raising`]). The signal takes effect when the subtask's instance is complete (R3),
//!   not in mid-function, and not if the instance fails;
//! - a question to a device served by the DAG
//!   ([`Device::served_by`](crate::shared::Device::served_by)), as the wait for its answer begins;
//! - a fault that ends a DAG ([`Dag::on_fault`]);
//! - the platform: a byte from a serial port or a packet, for example, or a test in virtual time;
//! - the app's code outside subtasks ([`Signal::raise`]).

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::sync::atomic::{AtomicU8, Ordering};
use core::time::Duration;

use sched_dag::DagId;

use super::dag::Dag;
use super::uses::{Uses, implement_asking, sealed};
use crate::draft::DagDraft;
use crate::draft::fault::Fault;
use crate::draft::part::{CheckedDag, DraftPart, PartKind, TiedDag, dag_of};
use crate::platform;
use crate::run::effect::RequestTarget;
use crate::run::effect::{GO, RequestKind, Wish};

/// An event that releases a job of a sporadic DAG. Clones are handles of the same signal.
///
/// # Examples
///
/// A brake DAG, released when an obstacle was seen, at most every 50 ms:
///
/// ```
/// use core::time::Duration;
/// use fass::shared::Raiser;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let named = SubtaskAttributes::named;
/// let period = Duration::from_millis(10);
///
/// let brakes = create_dag();
/// brakes.name("brakes").relative_deadline(Duration::from_millis(5));
/// let at_most_every = Duration::from_millis(50);
/// let obstacle = brakes.sporadic(at_most_every);
/// brakes.source(|| ()).register(named("brake"));
///
/// let vision = create_dag();
/// vision.name("vision").jobs(20);
/// vision.register_periodic_subtask(|| (1,), ["frame"], period, named("camera"));
/// vision
///     .using(obstacle.raising())
///     .subtask(|mut obstacle: Raiser<'_>, (frame,): (i32,)| {
///         if frame > 0 {
///             obstacle.raise(); // takes effect when this instance is complete
///         }
///     })
///     .reads(&["frame"])
///     .due(period)
///     .register(named("detect"));
/// finish_create_dags(&[brakes, vision]).unwrap();
/// let report = machine.run();
/// assert_eq!(report.dag("brakes").statistics().released, 5); // at 0, 50, 100, 150 and 200 ms
/// assert_eq!(report.dag("brakes").statistics().signals, 20);
/// ```
#[derive(Clone)]
pub struct Signal {
    pub(super) target: Arc<RequestTarget>,
}

/// The declaration that a subtask may raise a [`Signal`]: the function gets a [`Raiser`]. Made by
/// [`Signal::raising`].
///
/// See [`Signal`].
#[derive(Debug)]
pub struct SignalUse(Signal);

/// The handle with which a function raises a signal. See [`Signal`].
#[derive(Debug)]
pub struct Raiser<'a> {
    wish: &'a AtomicU8,
}

impl Raiser<'_> {
    /// Raises the signal: it takes effect once, when this instance is complete. A failing instance
    /// raises nothing.
    ///
    /// See [`Signal`].
    pub fn raise(&mut self) {
        self.wish.store(GO, Ordering::Relaxed);
    }
}

impl Signal {
    /// Returns the declaration that a subtask may raise the signal, for [`Dag::using`].
    ///
    /// The commit must have the signal's DAG, too.
    #[must_use = "a use has no effect until a subtask is registered with it"]
    pub fn raising(&self) -> SignalUse {
        SignalUse(self.clone())
    }

    /// Raises the signal now, from outside all subtasks. After the end of the DAG's run the call
    /// does nothing, and neither in a replay: there the recording has the signals.
    ///
    /// # Panics
    ///
    /// If the signal's DAG is not committed, or if a subtask's function makes the call: a subtask
    /// has to declare its effects on other DAGs at registration ([`raising`](Self::raising)).
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    ///
    /// # let machine = virtual_time::VirtualTime::new();
    /// let dag = create_dag();
    /// dag.jobs(1).relative_deadline(Duration::from_millis(5));
    /// let attributes = SubtaskAttributes::named("answer");
    /// let button = dag.sporadic(Duration::from_millis(50));
    /// dag.source(|| ()).register(attributes);
    /// finish_create_dags(&[dag]).unwrap();
    /// button.raise();
    /// assert_eq!(machine.run().jobs.len(), 1);
    /// ```
    #[track_caller]
    pub fn raise(&self) {
        let Some((plan, dag)) = self.target() else {
            panic!("a signal is raised before its DAG is committed; commit that first");
        };
        platform::expect_installed().raise(plan, dag);
    }

    /// Returns the arguments of [`Platform::raise`](crate::platform::Platform::raise): the number
    /// of the plan and the DAG. Returns `None` before the DAG's commit.
    ///
    /// For platforms that raise signals.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag};
    ///
    /// let minimum = Duration::from_millis(50);
    /// let button = create_dag().sporadic(minimum);
    /// assert_eq!(button.target(), None);
    /// ```
    pub fn target(&self) -> Option<(u64, DagId)> {
        self.target.get()
    }
}

impl Dag {
    /// Makes the DAG sporadic, with the least time between two releases, and returns its signal.
    /// Subtasks of all DAGs of the commit can raise the signal, and so can code outside.
    ///
    /// See [`Signal`]. Without a limit of [`jobs`](Self::jobs) the DAG does not keep a run going:
    /// the run can end when all other DAGs have ended, this DAG has no job in flight, and no signal
    /// waits.
    #[track_caller]
    pub fn sporadic(&self, min_inter_arrival: Duration) -> Signal {
        self.open().set_sporadic(min_inter_arrival);
        self.signal()
    }

    /// Sets a signal to be raised when a fault ends the DAG: a panic, an exception, an exceeded
    /// budget. The DAG released by the signal brings the system into a safe state; as a DAG it has
    /// its place in the schedule, and a bound. The signal is raised in the step that ends the
    /// faulty DAG; where clusters share no instant, it reaches another cluster as a letter.
    /// Survived faults raise nothing; the release keeps its least distance from the release before.
    /// The released DAG should sample nothing written by the faulty DAG, since nobody renews those
    /// values any more.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// let machine = VirtualTime::new().contain_panics();
    /// let ms = Duration::from_millis;
    /// let brakes = create_dag();
    /// brakes.name("brakes").relative_deadline(ms(5));
    /// let hold = SubtaskAttributes::named("hold");
    /// let stop = brakes.sporadic(ms(50));
    /// brakes.source(|| ()).register(hold);
    ///
    /// let steering = create_dag();
    /// steering.name("steering").jobs(10).relative_deadline(ms(10)).on_fault(&stop);
    /// let mut angles = vec![1, 2, 3].into_iter();
    /// let steer = move || _ = angles.next().unwrap(); // panics in job 3
    /// steering.register_periodic_subtask(steer, [], ms(10), SubtaskAttributes::named("steer"));
    ///
    /// finish_create_dags(&[brakes, steering]).unwrap();
    /// let report = machine.run();
    /// assert_eq!(report.panics.len(), 1);
    /// assert_eq!(report.jobs.last().unwrap().release_ns, Some(30_000_000)); // at the fault
    /// assert_eq!(report.dag("brakes").statistics().completed, 1);
    /// ```
    #[track_caller]
    pub fn on_fault(&self, signal: &Signal) -> &Self {
        let mut draft = self.open();
        // The last call counts.
        draft.parts.retain(|(kind, _)| *kind != PartKind::OnFault);
        draft.add(PartKind::OnFault, FaultSignal(Arc::clone(&signal.target)));
        drop(draft);
        self
    }

    #[track_caller]
    pub(super) fn signal(&self) -> Signal {
        let draft = self.open();
        Signal {
            target: Arc::clone(&draft.target),
        }
    }
}

implement_asking!(SignalUse, Raiser, |raising, draft, subtask| {
    let target = raising.0.target;
    let asked = Arc::clone(&target);
    let unknown = move |of: &CheckedDag<'_>| unknown_signal(of, subtask, &asked);
    draft.add(PartKind::Raise, unknown);
    draft.ask(subtask, RequestKind::Signal(target))
});

/// The signal to be raised when a fault ends the DAG.
pub(super) struct FaultSignal(pub(super) Arc<RequestTarget>);

impl DraftPart for FaultSignal {
    fn check(&self, of: &CheckedDag<'_>) -> Option<Fault> {
        // A fault of any subtask raises the signal; the check names the first subtask for all of
        // them.
        let first = (0..of.draft.spec.subtasks.len()).next()?;
        unknown_signal(of, first, &self.0)
    }

    fn tie(self: Box<Self>, dag: &mut TiedDag<'_>) {
        *dag.after_fault = self.0.get().map(|(_, handler)| handler);
    }
}

/// Returns a fault if a subtask may raise a signal whose DAG is not in the commit.
pub(super) fn unknown_signal(
    of: &CheckedDag<'_>,
    subtask: usize,
    signal: &Arc<RequestTarget>,
) -> Option<Fault> {
    let says =
        "may raise the signal of a dag that is not in the commit; commit both dags in one call";
    dag_of(of.drafts, signal)
        .is_none()
        .then(|| of.fault("signal_not_committed", subtask, says))
}

shown_as!(Signal, |of| of.target());
