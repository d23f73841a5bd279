//! States: values shared by several subtasks of one DAG, and kept from job to job.
//!
//! A closure may keep data for itself alone. A value needed by *several* functions, such as a pose
//! estimated by one function and corrected by another, is a [`State`]. [`Dag::state`] declares a
//! state, and subtasks declare their access at registration ([`Dag::using`]). So the data flow is
//! in the model, where a mutex would hide it.
//!
//! # Guarantees
//!
//! - In each job the users take turns in the same order in every run: the order of the DAG's paths
//!   or, between subtasks without a path, the order of registration. Readers between two updates
//!   may run at the same time. The commit adds the necessary precedence edges, and the analysis
//!   sees them (`sched-dag/src/verify/topics.rs` has the rule).
//! - Each job finds the value left by the jobs before, unless a survived fault has
//!   [reset](State::reset_to) the value: a DAG whose subtasks share a state has one job in flight.
//!   The commit then refuses a `Dag::in_flight` beyond 1.
//! - No function waits for a state, so there is no blocking to account for, and no priority
//!   inversion.
//!
//! # Limits
//!
//! - A subtask registered before the updater, with no path from the updater to it, sees the value
//!   left by the jobs before.
//! - A recording contains a state only on request ([`State::record`]).
//! - Jobs do not overlap as in a pipeline. Where they must, let one subtask own the state and send
//!   the needed data along an edge.
//! - A state does not leave its DAG. Between DAGs use the [latest value](crate::shared::Latest).

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

/// A type usable as a state: safe to use from several cores in turn.
///
/// Apps need not implement the trait; they meet it as a bound of [`Dag::state`].
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

/// A value shared by subtasks of one DAG and kept from job to job. Made by [`Dag::state`].
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

/// Provides the given number of values of a state, for resets after faults.
type ProvideResets = Box<dyn FnOnce(u32)>;

/// The options of a state: its values for resets after faults, and its recording.
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
        // A fault may leave the state half changed, so the app has to provide a value for starting
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
                // No fault is survived, so the first value is the only one used.
                OnFault::EndDag => 0,
                OnFault::DropJob(limit) => limit.in_all,
            });
        }
    }
}

/// The declaration that a subtask may change a [`State`]: the function gets a `&mut T`. Made by
/// [`State::update`].
///
/// See [`State`].
#[derive(Debug)]
pub struct StateUpdate<T>(State<T>);

/// The declaration that a subtask only reads a [`State`]: the function gets a `&T`. Made by
/// [`State::read`].
///
/// See [`State`].
#[derive(Debug)]
pub struct StateRead<T>(State<T>);

impl<T: StateValue> State<T> {
    /// Returns the declaration that a subtask may change the state, for [`Dag::using`].
    #[must_use = "a use has no effect until a subtask is registered with it"]
    pub fn update(&self) -> StateUpdate<T> {
        StateUpdate(self.clone())
    }

    /// Returns the declaration that a subtask only reads the state, for [`Dag::using`]. Readers
    /// between two updates may run at the same time.
    #[must_use = "a use has no effect until a subtask is registered with it"]
    pub fn read(&self) -> StateRead<T> {
        StateRead(self.clone())
    }

    /// Sets the function providing the state's value after a fault. Such a reset follows the fault
    /// of a replaceable subtask using the state, where the DAG goes on ([`Dag::survive_faults`]).
    /// The commit calls `make` once for each fault that the DAG may survive.
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
        // For its check: after the commit, nobody would ask for the values.
        let _open = self.dag.open();
        self.options.provide.replace(Some(Box::new(provide)));
        self
    }

    /// Records the state every 64 jobs, where the platform records: before the first function that
    /// may change the state in such a job. States are recorded along with topics, so record topics
    /// of the DAG, too ([`Dag::record`]); a replay can then begin at a recorded state.
    ///
    /// A recording does not contain values kept in a closure, so make such a value a state to have
    /// the value recorded. A value of more than 4 KiB, or of more than twice the least size of its
    /// type if that is larger, is lost, as for a topic.
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

    /// Records the state every `jobs` jobs; 0 counts as 1.
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
        // For its check: the commit takes the recording of states, so later the call has no effect.
        let _open = self.dag.open();
        let kept = Arc::new(KeptState::new(value, jobs));
        self.options.kept.replace(Some(kept));
        self
    }

    /// Registers a use, and returns the value for the subtask to claim.
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
    /// Adds a state shared by subtasks of this DAG, with the given name and value before job 0.
    ///
    /// A subtask gets access by [`using`](Self::using). See [`State`] for the guarantees.
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

/// Implements a use of a state, given the borrowed type, whether the use updates the value, and how
/// the value is claimed.
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
