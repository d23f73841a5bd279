//! States: what several subtasks of one DAG share from job to job.
//!
//! A closure may keep what it alone needs. A value that *several* functions need, such as
//! a pose that one estimates and another corrects, is a [`State`]: declared with
//! [`Dag::state`], and used by the subtasks that say so at registration
//! ([`Dag::using`]). So the flow is in the model, where a mutex hides it.
//!
//! # What is guaranteed
//!
//! - In each job the users take turns in one order, the same in every run: that of
//!   the DAG's paths and, where there is none, that of registration. Readers
//!   between two updates may run at the same time. The commit adds the precedence
//!   edges that this takes, and the analysis sees them
//!   (`sched-dag/src/verify/topics.rs` has the rule).
//! - Job k + 1 finds what job k left: a DAG whose subtasks share a state has one job
//!   in flight. A `Dag::in_flight` beyond 1 is then refused.
//! - Nobody waits for a state in mid-function, so there is no blocking to account
//!   for, and no priority is inverted.
//!
//! # What is not
//!
//! - A subtask that is registered before the updater sees what the job before left.
//! - A recording has nothing of a state unless that is asked for ([`State::record`]).
//! - Jobs do not overlap as in a pipeline. Where they must, let one subtask own the
//!   state and send what others need along an edge.
//! - A state does not leave its DAG. Between DAGs there is the [latest
//!   value](crate::shared::Latest).

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::RefCell;

use recording::Recordable;
use sched_dag::{OnFault, StateSpec, StateUser};

use super::dag::Dag;
use super::replaceable::Replaceable;
use super::uses::{ResettableUses, Uses, sealed};
use crate::draft::fault::Fault;
use crate::draft::part::{CheckedDag, DraftPart, PartKind, TiedDag};
use crate::run::cell::{ReadClaim, WriteClaim};
use crate::run::line::KeptState;
use crate::run::replaceable::{Reset, ResettableState};

/// A value that can be a state: of any type that several cores may use in turn.
///
/// Apps need not implement it; they meet it in [`Dag::state`].
///
/// ```
/// fn is_state<T: fass::shared::StateValue>() {}
/// is_state::<Vec<f64>>();
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be a state",
    label = "is not `Send + Sync + 'static`",
    note = "subtasks use a state on any core, and readers at the same time: do without `Rc`, `Cell` and borrowed data",
    note = "what is not shared needs no state: let the one function capture it"
)]
pub trait StateValue: Send + Sync + 'static {}

#[diagnostic::do_not_recommend]
impl<T: Send + Sync + 'static> StateValue for T {}

/// A state that subtasks of one DAG share. Made by [`Dag::state`].
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let dag = create_dag();
/// dag.name("odometry").jobs(3);
/// let period = Duration::from_millis(10);
/// let distance = dag.state("distance", 0_u32);
///
/// dag.register_periodic_subtask(|| (5_u32,), ["step"], period, SubtaskAttributes::named("wheel"));
/// dag.using(distance.update())
///     .subtask(|distance: &mut u32, (step,): (u32,)| {
///         *distance += step;
///         (step,)
///     })
///     .reads(&["step"])
///     .writes(&["moved"])
///     .register(SubtaskAttributes::named("add"));
/// dag.using(distance.read())
///     .subtask(|distance: &u32, (moved,): (u32,)| assert_eq!(distance % moved, 0))
///     .reads(&["moved"])
///     .due(period)
///     .register(SubtaskAttributes::named("show"));
/// finish_create_dags(&[dag]).unwrap();
/// machine.run();
/// ```
pub struct State<T> {
    dag: Dag,
    options: Rc<StateOptions>,
    value: Arc<ResettableState<T>>,
}

/// Provides so many values of a state for after faults.
type ProvideResets = Box<dyn FnOnce(u32)>;

/// The statements about a state: its values for after faults, and that it is recorded.
#[derive(Default)]
pub(super) struct StateOptions {
    /// The position among the DAG's states.
    pub(super) position: usize,
    provide: RefCell<Option<ProvideResets>>,
    pub(super) kept: RefCell<Option<Arc<KeptState>>>,
}

impl DraftPart for Rc<StateOptions> {
    fn check(&self, of: &CheckedDag<'_>) -> Option<Fault> {
        let state = &of.draft.spec.states[self.position];
        let is_replaceable = |user: &usize| of.draft.all().any(|Replaceable(other)| other == user);
        let mut users = state.users.iter().map(|user| user.subtask);
        let user = users.find(is_replaceable)?;
        // A fault may leave the state half changed, so somebody has to say what it begins with
        // again.
        self.provide.borrow().is_none().then(|| {
            let says = format_args!(
                "has another function for after a fault, and the state `{}`, which it uses, no other \
                 value; give it one by `reset_to`",
                state.name
            );
            of.fault("state_without_reset", user, says)
        })
    }

    fn tie(self: Box<Self>, dag: &mut TiedDag<'_>) {
        if let Some(provide) = self.provide.take() {
            provide(match dag.verified.on_fault() {
                OnFault::EndDag => 0,
                OnFault::DropJob(limit) => limit.in_all,
            });
        }
    }
}

/// The use of a [`State`] that may change it: the function gets a `&mut T`. Made
/// by [`State::update`].
///
/// See [`State`].
#[derive(Debug)]
pub struct StateUpdate<T>(State<T>);

/// The use of a [`State`] that only reads it: the function gets a `&T`. Made by
/// [`State::read`].
///
/// See [`State`].
#[derive(Debug)]
pub struct StateRead<T>(State<T>);

impl<T: StateValue> State<T> {
    /// Returns the use of a subtask that may change the state.
    #[must_use = "a use has no effect until a subtask is registered with it"]
    pub fn update(&self) -> StateUpdate<T> {
        StateUpdate(self.clone())
    }

    /// Returns the use of a subtask that only reads the state. Readers between two
    /// updates may run at the same time.
    #[must_use = "a use has no effect until a subtask is registered with it"]
    pub fn read(&self) -> StateRead<T> {
        StateRead(self.clone())
    }

    /// States what the state is reset to after a fault of a subtask that uses it, where the
    /// DAG goes on ([`Dag::survive_faults`]). The commit makes a value for each fault that is
    /// survived.
    ///
    /// See [`Dag::restarting`](crate::Dag::restarting).
    ///
    /// # Panics
    ///
    /// If the DAG is committed.
    #[track_caller]
    pub fn reset_to(&self, mut make: impl FnMut() -> T + 'static) -> &Self {
        let value = Arc::clone(&self.value);
        let provide = move |faults| value.provide((0..faults).map(|_| make()));
        let _open = self.dag.open();
        self.options.provide.replace(Some(Box::new(provide)));
        self
    }

    /// Records the state every 64 jobs, where the platform records: before the first function is
    /// called that may change it in such a job. It does so if topics of the DAG are recorded
    /// ([`Dag::record`]), too; then a replay can begin there.
    ///
    /// A value that a closure keeps for itself is not recorded, so what shall be is to be a state.
    /// A value
    /// that takes more than 4 KiB, or twice the least of its type if that is more, is lost, as one
    /// of a topic is.
    ///
    /// ```
    /// use core::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use virtual_time::VirtualTime;
    ///
    /// fn commit() {
    ///     let (dag, period) = (create_dag(), Duration::from_millis(10));
    ///     dag.name("odometry").jobs(1_000).record::<u32>("step").record::<u64>("moved");
    ///     let distance = dag.state("distance", 0_u64);
    ///     distance.record();
    ///     let wheel = SubtaskAttributes::named("wheel");
    ///     dag.register_periodic_subtask(|| (5_u32,), ["step"], period, wheel);
    ///     let add = |distance: &mut u64, (step,): (u32,)| {
    ///         *distance += u64::from(step);
    ///         (*distance,)
    ///     };
    ///     let add = dag.using(distance.update()).subtask(add).reads(&["step"]);
    ///     add.writes(&["moved"]).due(period).register(SubtaskAttributes::named("add"));
    ///     finish_create_dags(&[dag]).unwrap();
    /// }
    ///
    /// let machine = VirtualTime::new();
    /// commit();
    /// machine.run();
    /// let recording = machine.recording();
    ///
    /// let machine = VirtualTime::new().replay(&recording).unwrap().from("odometry", 900);
    /// commit();
    /// let report = machine.run();
    /// assert_eq!(report.dag("odometry").jobs().count(), 1_000 - 896); // 14 times 64
    /// assert_eq!((report.divergence, report.lacking), (None, None));
    /// ```
    ///
    /// # Panics
    ///
    /// If the DAG is committed.
    #[track_caller]
    pub fn record(&self) -> &Self
    where
        T: Recordable,
    {
        self.record_every(64)
    }

    /// Records the state every so many jobs.
    ///
    /// See [`record`](Self::record).
    ///
    /// # Panics
    ///
    /// If the DAG is committed.
    #[track_caller]
    pub fn record_every(&self, jobs: u32) -> &Self
    where
        T: Recordable,
    {
        let value = Arc::<ResettableState<T>>::clone(&self.value);
        let _open = self.dag.open();
        let kept = Arc::new(KeptState::new(value, jobs));
        self.options.kept.replace(Some(kept));
        self
    }

    /// Notes a use, and returns the value that the subtask will claim.
    fn note(&self, dag: &Dag, subtask: usize, updates: bool) -> Arc<ResettableState<T>> {
        let user = StateUser { subtask, updates };
        dag.draft.borrow_mut().spec.states[self.options.position]
            .users
            .push(user);
        Arc::clone(&self.value)
    }
}

impl<T> Clone for State<T> {
    fn clone(&self) -> Self {
        Self {
            dag: self.dag.clone(),
            options: Rc::clone(&self.options),
            value: Arc::clone(&self.value),
        }
    }
}

impl Dag {
    /// Adds a state that subtasks of this DAG share, with its value before job 0.
    ///
    /// A subtask uses it by [`using`](Self::using). See [`State`] for what is
    /// guaranteed.
    #[track_caller]
    #[must_use = "a state that no subtask uses is a fault at commit"]
    pub fn state<T: StateValue>(&self, name: &str, initial: T) -> State<T> {
        let mut draft = self.open();
        let position = draft.spec.states.len();
        draft.spec.states.push(StateSpec {
            name: name.into(),
            users: Default::default(),
        });
        let options = Rc::new(StateOptions {
            position,
            ..StateOptions::default()
        });
        draft.add(PartKind::State, Rc::clone(&options));
        State {
            dag: self.clone(),
            options,
            value: Arc::new(ResettableState::new(initial)),
        }
    }
}

/// Implements a use of a state: what a function borrows, whether it updates that, and how the value
/// is claimed.
macro_rules! implement_use {
    ($Use:ident: $Borrowed:ty, $updates:literal, $claim:ident -> $Guard:ident) => {
        impl<T> sealed::Sealed for $Use<T> {}

        impl<T: StateValue> Uses for $Use<T> {
            type Borrowed<'a> = $Borrowed;
            type Held = Arc<ResettableState<T>>;
            type Guard<'a> = $Guard<'a, T>;

            fn is_of(&self, dag: &Dag) -> bool {
                Rc::ptr_eq(&self.0.dag.draft, &dag.draft)
            }

            fn hold(self, dag: &Dag, subtask: usize) -> Self::Held {
                self.0.note(dag, subtask, $updates)
            }

            fn enter(held: &mut Self::Held) -> Self::Guard<'_> {
                held.present().$claim().unwrap_or_else(|| refuse())
            }

            fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> Self::Borrowed<'a> {
                guard
            }
        }

        impl<T: StateValue> ResettableUses for $Use<T> {
            fn another(held: &Self::Held) -> Self::Held {
                Arc::clone(held)
            }

            fn states(held: &Self::Held) -> Vec<Arc<dyn Reset>> {
                vec![Arc::<ResettableState<T>>::clone(held)]
            }
        }
    };
}

implement_use!(StateUpdate: &'a mut T, true, change -> WriteClaim);
implement_use!(StateRead: &'a T, false, look -> ReadClaim);

fn refuse() -> ! {
    panic!(
        "a state is in use by another subtask: the platform started the instance before \
         all its predecessors were complete"
    )
}

shown_as!(State<T>, |of| of.options.position);
