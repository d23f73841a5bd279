//! What a subtask uses beside its inputs, stated at registration.
//!
//! Values of the same job come along edges, as arguments. What comes from elsewhere
//! is stated with [`Dag::using`]: a [`State`](crate::State) that subtasks of the DAG
//! share, the [latest value](crate::Latest) of a topic of any DAG, a
//! [signal](crate::Signal) that the subtask may raise. The function then gets what
//! it uses as its *first* argument, in front of the inputs:
//!
//! | use | first argument | theory |
//! |---|---|---|
//! | [`State::update`](crate::State::update) | `&mut T` | precedence |
//! | [`State::read`](crate::State::read) | `&T` | precedence |
//! | [`Latest::sample`](crate::Latest::sample) | `Option<Sample<T>>` | bounded staleness |
//! | [`Signal::raising`](crate::Signal::raising) | `Raiser` | sporadic release |
//!
//! Several uses are a tuple of up to 8, and give a tuple. Since the function borrows
//! all of them for one call only, nothing can be kept beyond the instance.

use alloc::vec::Vec;
use core::time::Duration;

use crate::attributes::SubtaskAttributes;
use crate::dag::Dag;
use crate::signal::Signal;
use crate::tuple::{VecToPubs, VecToSubs};
use crate::untyped::Untyped;

pub(crate) mod sealed {
    /// Keeps the trait to the types of this crate.
    pub trait Sealed {}
}

/// One thing that a subtask uses, or a tuple of up to 8.
///
/// Apps do not call its methods; they meet the trait in [`Dag::using`].
///
/// ```
/// use fass::{State, Uses, create_dag};
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
    note = "uses are `state.update()`, `state.read()`, `latest.sample()` and `signal.raising()`"
)]
pub trait Uses: sealed::Sealed {
    /// What the function gets.
    type Borrowed<'a>;
    /// What the subtask keeps from its registration on.
    #[doc(hidden)]
    type Held: Send + 'static;
    /// What it has for the time of an instance.
    #[doc(hidden)]
    type Guard<'a>;

    /// Reports whether it may be used by subtasks of this DAG.
    #[doc(hidden)]
    fn is_of(&self, dag: &Dag) -> bool;

    /// Notes that a subtask uses it.
    #[doc(hidden)]
    fn hold(self, dag: &Dag, subtask: usize) -> Self::Held;

    /// Begins the use at the start of an instance.
    #[doc(hidden)]
    fn enter(held: &mut Self::Held) -> Self::Guard<'_>;

    /// Lends it to the function.
    #[doc(hidden)]
    fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> Self::Borrowed<'a>;
}

/// A DAG whose next subtask uses something. Made by [`Dag::using`].
///
/// Its methods are those of [`Dag`], for functions that get what they use as their
/// first argument.
///
/// See [`State`](crate::State).
#[derive(Debug)]
#[must_use = "register a subtask with it"]
pub struct Using<'d, U> {
    dag: &'d Dag,
    uses: U,
}

impl Dag {
    /// Begins the registration of a subtask that uses something beside its inputs.
    ///
    /// See [`Uses`] for what there is, and [`State`](crate::State),
    /// [`Latest`](crate::Latest) and [`Signal`] for examples.
    ///
    /// # Panics
    ///
    /// Also if a state is another DAG's.
    #[track_caller]
    pub fn using<U: Uses>(&self, uses: U) -> Using<'_, U> {
        assert!(
            uses.is_of(self),
            "a state of another dag is used; share it between dags as a latest value"
        );
        Using { dag: self, uses }
    }
}

impl<U: Uses> Using<'_, U> {
    /// Does as [`Dag::register_periodic_subtask`].
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fass::{SubtaskAttributes, create_dag};
    /// let dag = create_dag();
    /// let count = dag.state("count", 0_u64);
    /// dag.using(count.update()).register_periodic_subtask(
    ///     |count: &mut u64| {
    ///         *count += 1;
    ///         (*count,)
    ///     },
    ///     vec!["count"],
    ///     Duration::from_millis(10),
    ///     SubtaskAttributes::named("counter"),
    /// );
    /// ```
    #[track_caller]
    pub fn register_periodic_subtask<F, Ret>(
        self,
        mut f: F,
        output_topics: Vec<&str>,
        period: Duration,
        attributes: SubtaskAttributes,
    ) where
        F: for<'a> FnMut(U::Borrowed<'a>) -> Ret + Send + 'static,
        Ret: VecToPubs,
    {
        let (dag, mut held) = self.hold();
        let f = move || f(U::borrow(&mut U::enter(&mut held)));
        dag.register_periodic_subtask(f, output_topics, period, attributes);
    }

    /// Does as [`Dag::register_sporadic_subtask`].
    ///
    /// ```
    /// # use core::time::Duration;
    /// # use fass::{SubtaskAttributes, create_dag};
    /// let dag = create_dag();
    /// let presses = dag.state("presses", 0_u64);
    /// let button = dag.using(presses.update()).register_sporadic_subtask(
    ///     |presses: &mut u64| {
    ///         *presses += 1;
    ///         (*presses,)
    ///     },
    ///     vec!["presses"],
    ///     Duration::from_millis(50),
    ///     SubtaskAttributes::named("button"),
    /// );
    /// ```
    #[track_caller]
    pub fn register_sporadic_subtask<F, Ret>(
        self,
        mut f: F,
        output_topics: Vec<&str>,
        min_inter_arrival: Duration,
        attributes: SubtaskAttributes,
    ) -> Signal
    where
        F: for<'a> FnMut(U::Borrowed<'a>) -> Ret + Send + 'static,
        Ret: VecToPubs,
    {
        let (dag, mut held) = self.hold();
        let f = move || f(U::borrow(&mut U::enter(&mut held)));
        dag.register_sporadic_subtask(f, output_topics, min_inter_arrival, attributes)
    }

    /// Does as [`Dag::register_subtask`]. See [`State`](crate::State).
    #[track_caller]
    pub fn register_subtask<F, Args, Ret>(
        self,
        mut f: F,
        input_topics: Vec<&str>,
        output_topics: Vec<&str>,
        attributes: SubtaskAttributes,
    ) where
        F: for<'a> FnMut(U::Borrowed<'a>, Args) -> Ret + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        let (dag, mut held) = self.hold();
        let f = move |args: Args| f(U::borrow(&mut U::enter(&mut held)), args);
        dag.register_subtask(f, input_topics, output_topics, attributes);
    }

    /// Does as [`Dag::register_sink_subtask`]. See [`State`](crate::State).
    #[track_caller]
    pub fn register_sink_subtask<F, Args>(
        self,
        mut f: F,
        input_topics: Vec<&str>,
        relative_deadline: Duration,
        attributes: SubtaskAttributes,
    ) where
        F: for<'a> FnMut(U::Borrowed<'a>, Args) + Send + 'static,
        Args: VecToSubs,
    {
        let (dag, mut held) = self.hold();
        let f = move |args: Args| f(U::borrow(&mut U::enter(&mut held)), args);
        dag.register_sink_subtask(f, input_topics, relative_deadline, attributes);
    }

    /// Does as [`Dag::register_untyped_subtask`].
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
    pub fn register_untyped_subtask<F>(self, mut f: F, attributes: SubtaskAttributes) -> Untyped
    where
        F: for<'a> FnMut(U::Borrowed<'a>, u64) + Send + 'static,
    {
        let (dag, mut held) = self.hold();
        let f = move |job| f(U::borrow(&mut U::enter(&mut held)), job);
        dag.register_untyped_subtask(f, attributes)
    }

    /// Notes the uses of the subtask that is registered next.
    #[track_caller]
    fn hold<'d>(self) -> (&'d Dag, U::Held)
    where
        Self: 'd,
    {
        let subtask = self.dag.open().spec.subtasks.len();
        (self.dag, self.uses.hold(self.dag, subtask))
    }
}

/// Implements the trait for tuples.
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
