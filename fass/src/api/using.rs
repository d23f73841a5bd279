//! Registering a subtask that uses something besides its inputs.
//!
//! The methods are those of [`Dag`]. Each wraps the function in one that begins the
//! uses, lends them to the function for one call, and ends them.

use super::dag::Dag;
use super::subtask::Subtask;
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
    /// [`Latest`](crate::Latest) and [`Signal`](crate::Signal) for examples.
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
    /// Works like [`Dag::source`].
    ///
    /// See [`Subtask`].
    #[track_caller]
    pub fn source<F, Ret>(self, mut f: F) -> Subtask<'d>
    where
        F: for<'a> FnMut(U::Borrowed<'a>) -> Ret + Send + 'static,
        Ret: VecToPubs,
    {
        let (dag, mut held) = self.hold();
        dag.source(move || f(U::borrow(&mut U::enter(&mut held))))
    }

    /// Works like [`Dag::subtask`].
    ///
    /// See [`State`](crate::State).
    #[track_caller]
    pub fn subtask<F, Args, Ret>(self, mut f: F) -> Subtask<'d>
    where
        F: for<'a> FnMut(U::Borrowed<'a>, Args) -> Ret + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        let (dag, mut held) = self.hold();
        dag.subtask(move |args: Args| f(U::borrow(&mut U::enter(&mut held)), args))
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
