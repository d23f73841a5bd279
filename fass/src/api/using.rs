//! Registering a subtask that uses something besides its inputs.
//!
//! The methods are those of [`Dag`]. Each wraps the function in one that begins the
//! uses, lends them to the function for one call, and ends them.

use alloc::vec::Vec;
use core::time::Duration;

use super::dag::Dag;
use super::signal::Signal;
use super::untyped::Untyped;
use super::uses::Uses;
use crate::draft::attributes::SubtaskAttributes;
use crate::run::tuple::{VecToPubs, VecToSubs};

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
    /// Begins the registration of a subtask that uses something besides its inputs.
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
            "a state of another DAG is used; share it between DAGs as a latest value"
        );
        Using { dag: self, uses }
    }
}

impl<'d, U: Uses> Using<'d, U> {
    /// Works like [`Dag::register_periodic_subtask`].
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

    /// Works like [`Dag::register_sporadic_subtask`].
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
        U::begins(&held, dag);
        let f = move || f(U::borrow(&mut U::enter(&mut held)));
        dag.register_sporadic_subtask(f, output_topics, min_inter_arrival, attributes)
    }

    /// Works like [`Dag::register_subtask`]. See [`State`](crate::State).
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

    /// Works like [`Dag::register_sink_subtask`]. See [`State`](crate::State).
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
    pub(super) fn hold(self) -> (&'d Dag, U::Held) {
        let subtask = self.dag.open().spec.subtasks.len();
        (self.dag, self.uses.hold(self.dag, subtask))
    }
}
