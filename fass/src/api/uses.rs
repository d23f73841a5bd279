//! Uses of a subtask besides its inputs, declared at registration.
//!
//! Values of the same job come along edges, as arguments. [`Dag::using`] declares access to
//! anything else, such as a [`State`](crate::shared::State) shared by subtasks of the DAG, the
//! [latest value](crate::shared::Latest) of a topic of any DAG, a [signal](crate::shared::Signal)
//! to raise, a [wire](crate::shared::Wire) for bytes, a [parameter](crate::shared::Parameter) set
//! from outside, a DAG to [pause](crate::shared::Switch), a [mode](crate::shared::Modes) to enter,
//! the [end](crate::shared::Shutdown) of the run. The function then gets the declared use as its
//! *first* argument, in front of the inputs:
//!
//! | use | first argument | theory |
//! |---|---|---|
//! | [`State::update`](crate::shared::State::update) | `&mut T` | precedence |
//! | [`State::read`](crate::shared::State::read) | `&T` | precedence |
//! | [`Latest::sample`](crate::shared::Latest::sample) | `Option<Sample<T>>` | bounded staleness |
//! | [`Signal::raising`](crate::shared::Signal::raising) | `Raiser` | sporadic release |
//! | [`Dag::switching`] | `Switch` | pauses (P1 to P5) |
//! | [`Mode::entering`](crate::shared::Mode::entering) | `ModeSwitch` | modes (M1 to M7) |
//! | [`shutting_down`](crate::shared::shutting_down) | `Shutdown` | the end (C1 to C5) |
//! | [`Wire::receiving`](crate::shared::Wire::receiving) | `Received<T>` | input |
//! | [`Wire::sending`](crate::shared::Wire::sending) | `Sender` | output |
//! | [`Wire::reading`](crate::shared::Wire::reading) | `WireReader<T>` | a wait |
//! | [`Wire::writing`](crate::shared::Wire::writing) | `WireWriter` | a wait |
//! | [`Parameter::reading`](crate::shared::Parameter::reading) | `T` | input |
//! | [`WallClock::reading`](crate::shared::WallClock::reading) | `UnixTime` | input |
//! | [`Device::asking`](crate::shared::Device::asking) | `Asker<Q, A>` | a wait |
//! | [`Lock::entering`](crate::shared::Lock::entering) | `()` | blocking |
//!
//! Several uses form a tuple of up to 8, and the function gets a tuple. Since a function borrows
//! most uses for one call only, the function cannot keep them beyond the instance. The ends of
//! devices and of waiting wires belong to an async function's future instead; outside a turn of
//! their subtask, asking by them is a fault.
//!
//! The methods of [`SubtaskBuilder`] are the same as those of [`Dag`]. Each wraps the given
//! function. The wrapper begins the uses, lends them to the function for one call, and ends them.

use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::ptr;

use super::dag::Dag;
use super::subtask::{Subtask, UntypedSubtask};
use crate::draft::SubtaskAttributes;
use crate::draft::fault::Fault;
use crate::draft::part::{CheckedDag, DraftPart};
use crate::run::replaceable::Reset;
use crate::run::subtask::defer;
use crate::run::tuple::{VecToPubs, VecToSubs};

pub(crate) mod sealed {
    /// Keeps the trait to the types of this crate.
    pub trait Sealed {}
}

/// Anything a subtask can use besides its inputs, or a tuple of up to 8 uses.
///
/// Apps do not call the trait's methods; they meet the trait as a bound of [`Dag::using`].
///
/// ```
/// use fass::shared::{State, Uses};
/// use fass::create_dag;
///
/// fn first_argument<U: Uses>(_: &U) -> &'static str {
///     std::any::type_name::<U::Borrowed<'_>>()
/// }
/// let dag = create_dag();
/// let (pose, map): (State<f64>, State<u8>) = (dag.state("pose", 0.0), dag.state("map", 0));
/// assert_eq!(first_argument(&(pose.update(), map.read())), "(&mut f64, &u8)");
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is nothing that a subtask uses",
    label = "should be a use, or a tuple of up to 8 uses",
    note = "uses are `state.update()`, `state.read()`, `latest.sample()`, `signal.raising()`, `dag.switching()`, `mode.entering()`, `shutting_down()`, `wire.receiving(decode)`, `wire.sending()`, `wire.reading(decode)`, `wire.writing()`, `parameter.reading()`, `clock.reading()`, `device.asking()` and `lock.entering(1)`"
)]
pub trait Uses: sealed::Sealed {
    /// The first argument of the function.
    type Borrowed<'a>;
    /// The part kept by the subtask from its registration on.
    #[doc(hidden)]
    type Held: Send + 'static;
    /// The part held during an instance.
    #[doc(hidden)]
    type Guard<'a>;

    /// Reports whether subtasks of this DAG may have the use. Most uses are open to subtasks of any
    /// DAG.
    #[doc(hidden)]
    fn is_of(&self, _dag: &Dag) -> bool {
        true
    }

    /// Records in the draft that a subtask has the use.
    #[doc(hidden)]
    fn hold(self, dag: &Dag, subtask: usize) -> Self::Held;

    /// Begins the use at the start of an instance.
    #[doc(hidden)]
    fn enter(held: &mut Self::Held) -> Self::Guard<'_>;

    /// Lends the use to the function.
    #[doc(hidden)]
    fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> Self::Borrowed<'a>;
}

/// Uses of a subtask whose function can be replaced after a fault: a state, reset after the fault,
/// a lock, or a tuple of such uses.
///
/// Apps do not call the trait's methods; they meet the trait as a bound of
/// [`SubtaskBuilder::restarting`](crate::shared::SubtaskBuilder::restarting).
///
/// ```
/// use fass::shared::ResettableUses;
/// use fass::create_dag;
///
/// fn can_be_reset(_: &impl ResettableUses) {}
/// can_be_reset(&create_dag().state("pose", 0.0).update());
/// ```
#[diagnostic::on_unimplemented(
    message = "a subtask that uses `{Self}` cannot be replaced after a fault",
    label = "can be reset only if all of it are states",
    note = "let another subtask sample the latest value or raise the signal, and send along an edge"
)]
pub trait ResettableUses: Uses {
    /// Returns the part kept by another function of the subtask.
    #[doc(hidden)]
    fn another(held: &Self::Held) -> Self::Held;

    /// Returns the states.
    #[doc(hidden)]
    fn states(held: &Self::Held) -> Vec<Arc<dyn Reset>>;
}

/// Implements a use for requests made by completions. The function borrows a place for its wish,
/// and `$hold` returns that place and registers the request's kind.
macro_rules! implement_asking {
    ($Use:ty, $Borrowed:ident, $hold:expr) => {
        impl sealed::Sealed for $Use {}

        impl Uses for $Use {
            type Borrowed<'a> = $Borrowed<'a>;
            type Held = Wish;
            type Guard<'a> = &'a AtomicU8;

            fn hold(self, dag: &Dag, subtask: usize) -> Wish {
                let hold: fn(Self, &mut DagDraft, usize) -> Wish = $hold;
                hold(self, &mut dag.draft.borrow_mut(), subtask)
            }

            fn enter(held: &mut Wish) -> Self::Guard<'_> {
                held
            }

            fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> Self::Borrowed<'a> {
                $Borrowed { wish: guard }
            }
        }
    };
}

pub(super) use implement_asking;

/// Implements the traits for tuples.
macro_rules! implement_tuple {
    ($(($Use:ident $use_:ident $guard:ident))*) => {
        impl<$($Use: Uses),*> sealed::Sealed for ($($Use,)*) {}

        impl<$($Use: Uses),*> Uses for ($($Use,)*) {
            type Borrowed<'a> = ($($Use::Borrowed<'a>,)*);
            type Held = ($($Use::Held,)*);
            type Guard<'a> = ($($Use::Guard<'a>,)*);

            fn is_of(&self, dag: &Dag) -> bool {
                let ($($use_,)*) = self;
                $($use_.is_of(dag))&&*
            }

            fn hold(self, dag: &Dag, subtask: usize) -> Self::Held {
                let ($($use_,)*) = self;
                ($($use_.hold(dag, subtask),)*)
            }

            fn enter(held: &mut Self::Held) -> Self::Guard<'_> {
                let ($($use_,)*) = held;
                ($($Use::enter($use_),)*)
            }

            fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> Self::Borrowed<'a> {
                let ($($guard,)*) = guard;
                ($($Use::borrow($guard),)*)
            }
        }

        impl<$($Use: ResettableUses),*> ResettableUses for ($($Use,)*) {
            fn another(held: &Self::Held) -> Self::Held {
                let ($($use_,)*) = held;
                ($($Use::another($use_),)*)
            }

            fn states(held: &Self::Held) -> Vec<Arc<dyn Reset>> {
                let ($($use_,)*) = held;
                let mut states = Vec::new();
                $(states.append(&mut $Use::states($use_));)*
                states
            }
        }
    };
}

implement_tuple!((A a a_guard));
implement_tuple!((A a a_guard)(B b b_guard));
implement_tuple!((A a a_guard)(B b b_guard)(C c c_guard));
implement_tuple!((A a a_guard)(B b b_guard)(C c c_guard)(D d d_guard));
implement_tuple!((A a a_guard)(B b b_guard)(C c c_guard)(D d d_guard)(E e e_guard));
implement_tuple!((A a a_guard)(B b b_guard)(C c c_guard)(D d d_guard)(E e e_guard)(F f f_guard));
implement_tuple!((A a a_guard)(B b b_guard)(C c c_guard)(D d d_guard)(E e e_guard)(F f f_guard)(G g g_guard));
implement_tuple!((A a a_guard)(B b b_guard)(C c c_guard)(D d d_guard)(E e e_guard)(F f f_guard)(G g g_guard)(H h h_guard));

/// An input of a subtask from outside, through a use: "reads parameter `gain`". Only sources take
/// such inputs, and each input once, so that a job has one value of the input.
pub(super) struct OutsideInput {
    pub(super) subtask: usize,
    pub(super) takes: String,
}

impl DraftPart for OutsideInput {
    fn check(&self, of: &CheckedDag<'_>) -> Option<Fault> {
        let Self { subtask, takes } = self;
        // A replay supplies the values of sources; outside input of other subtasks could not be
        // repeated.
        if !is_source(of, self) {
            let says = format_args!(
                "is no source and {takes}; let the source do that, and send it along an edge"
            );
            return Some(of.fault("taken_by_no_source", *subtask, says));
        }
        let mut earlier = of.draft.all().take_while(|other| !ptr::eq(*other, self));
        let first = earlier.find(|other| other.takes == *takes && is_source(of, other))?;
        let first = of.draft.label(first.subtask);
        let says = format_args!(
            "{takes}, and so does {first}, but a job has one value of it; let one source do that, \
             once, and send it along edges"
        );
        Some(of.fault("taken_twice", *subtask, says))
    }
}

/// Reports whether nothing precedes the subtask of an input.
fn is_source(of: &CheckedDag<'_>, input: &OutsideInput) -> bool {
    let (spec, subtask) = (&of.draft.spec, input.subtask);
    let follows = |&(_, to): &(usize, usize)| to == subtask;
    spec.subtasks[subtask].inputs.is_empty() && !spec.edges.iter().any(follows)
}

/// A DAG whose next subtask has uses. Made by [`Dag::using`].
///
/// Its methods are the same as those of [`Dag`], for functions with the uses as their first
/// argument.
///
/// See [`State`](crate::shared::State).
#[derive(Debug)]
#[must_use = "register a subtask with it"]
pub struct SubtaskBuilder<'d, U> {
    pub(super) dag: &'d Dag,
    pub(super) uses: U,
}

impl Dag {
    /// Begins the registration of a subtask using something besides its inputs.
    ///
    /// See [`Uses`] for the possible uses, and [`State`](crate::shared::State),
    /// [`Latest`](crate::shared::Latest) and [`Signal`](crate::shared::Signal) for examples.
    ///
    /// # Panics
    ///
    /// Also if a state belongs to another DAG.
    #[track_caller]
    pub fn using<U: Uses>(&self, uses: U) -> SubtaskBuilder<'_, U> {
        assert!(
            uses.is_of(self),
            "a state of another DAG is used; share it between DAGs as a latest value"
        );
        SubtaskBuilder { dag: self, uses }
    }
}

impl<'d, U: Uses + 'd> SubtaskBuilder<'d, U> {
    /// Works like [`Dag::source`].
    ///
    /// See [`Subtask`].
    #[track_caller]
    pub fn source<F, Ret>(self, mut f: F) -> Subtask<'d>
    where
        F: for<'a> FnMut(U::Borrowed<'a>) -> Ret + Send + 'static,
        Ret: VecToPubs,
    {
        self.subtask(move |used: U::Borrowed<'_>, ()| f(used))
    }

    /// Works like [`Dag::subtask`].
    ///
    /// See [`State`](crate::shared::State).
    #[track_caller]
    pub fn subtask<F, Args, Ret>(self, mut f: F) -> Subtask<'d>
    where
        F: for<'a> FnMut(U::Borrowed<'a>, Args) -> Ret + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        Subtask::new::<Args, Ret>(self.dag, move |dag, subtask| {
            let mut held = self.uses.hold(dag, subtask);
            defer(move |args: Args| f(U::borrow(&mut U::enter(&mut held)), args))
        })
    }

    /// Works like [`Dag::register_untyped_subtask`].
    ///
    /// ```
    /// # use fass::{SubtaskAttributes, create_dag};
    /// let dag = create_dag();
    /// let log = dag.state("log", Vec::with_capacity(16));
    /// let append = |log: &mut Vec<u64>, job| log.push(job);
    /// dag.using(log.update())
    ///     .register_untyped_subtask(append, SubtaskAttributes::named("append"));
    /// ```
    #[track_caller]
    pub fn register_untyped_subtask<F>(
        self,
        mut f: F,
        attributes: SubtaskAttributes,
    ) -> UntypedSubtask
    where
        F: for<'a> FnMut(U::Borrowed<'a>, u64) + Send + 'static,
    {
        let subtask = self.dag.open().spec.subtasks.len();
        let mut held = self.uses.hold(self.dag, subtask);
        let f = move |job| f(U::borrow(&mut U::enter(&mut held)), job);
        self.dag.register_untyped_subtask(f, attributes)
    }
}
