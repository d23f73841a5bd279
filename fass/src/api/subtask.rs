//! Registering a subtask step by step: its function, the topics that it reads and writes, and its
//! deadline.
//!
//! The paper's three functions ([`Dag::register_periodic_subtask`], [`Dag::register_subtask`],
//! [`Dag::register_sink_subtask`]) say the same in a line. This way takes what they cannot: a
//! subtask that *uses* something besides its inputs ([`Dag::using`]), one whose function is
//! *replaced* after a fault ([`Dag::restarting`]), the source of a *sporadic* DAG
//! ([`Dag::sporadic`]).

use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use sched_dag::SubtaskLabel;

use super::dag::Dag;
use crate::draft::Ends;
use crate::draft::attributes::SubtaskAttributes;
use crate::run::message::MessageType;
use crate::run::subtask::{MakeBody, defer};
use crate::run::tuple::{VecToPubs, VecToSubs};

/// A subtask whose function is known, to be registered by [`register`](Self::register).
///
/// Made by [`Dag::subtask`], [`Dag::source`], [`Dag::restarting`] and [`Dag::falling_back`], and
/// those of [`Using`](crate::Using).
///
/// ```
/// use core::time::Duration;
/// use fass::{SubtaskAttributes, create_dag};
///
/// let named = SubtaskAttributes::named;
/// let dag = create_dag();
/// let count = dag.period(Duration::from_millis(10)).state("count", 0_u64);
/// dag.using(count.update())
///     .source(|count: &mut u64| {
///         *count += 1;
///         (*count,)
///     })
///     .writes(&["count"])
///     .register(named("counter"));
/// dag.subtask(|(count,): (u64,)| println!("{count}"))
///     .reads(&["count"])
///     .due(Duration::from_millis(5))
///     .register(named("print"));
/// ```
#[must_use = "it is a subtask of the DAG once it is registered"]
pub struct Subtask<'d> {
    dag: &'d Dag,
    body: MakeBody,
    is_replaceable: bool,
    reads: &'d [&'d str],
    writes: &'d [&'d str],
    /// The types of its inputs and of its outputs, by functions: an image has little room.
    types: [fn() -> Vec<MessageType>; 2],
    due: Option<Duration>,
}

impl Dag {
    /// Begins the registration of a source: a function without inputs, which every release
    /// starts. What releases the DAG is its own statement: [`period`](Self::period) or
    /// [`sporadic`](Self::sporadic).
    ///
    /// See [`Subtask`].
    pub fn source<F, Ret>(&self, mut f: F) -> Subtask<'_>
    where
        F: FnMut() -> Ret + Send + 'static,
        Ret: VecToPubs,
    {
        self.subtask(move |()| f())
    }

    /// Begins the registration of a subtask: a function from a tuple of inputs to a tuple of
    /// outputs.
    ///
    /// See [`Subtask`].
    pub fn subtask<F, Args, Ret>(&self, f: F) -> Subtask<'_>
    where
        F: FnMut(Args) -> Ret + Send + 'static,
        Args: VecToSubs,
        Ret: VecToPubs,
    {
        Subtask::new::<Args, Ret>(self, defer(f))
    }
}

impl<'d> Subtask<'d> {
    pub(super) fn new<Args: VecToSubs, Ret: VecToPubs>(dag: &'d Dag, body: MakeBody) -> Self {
        Self {
            dag,
            body,
            is_replaceable: false,
            reads: &[],
            writes: &[],
            types: [Args::input_types, Ret::output_types],
            due: None,
        }
    }

    pub(super) fn replaceable(self) -> Self {
        Self {
            is_replaceable: true,
            ..self
        }
    }

    /// Names the topics of its inputs, one for each element of the function's argument.
    ///
    /// See [`Subtask`].
    pub fn reads(self, topics: &'d [&'d str]) -> Self {
        Self {
            reads: topics,
            ..self
        }
    }

    /// Names the topics of its outputs, one for each element that the function returns.
    ///
    /// See [`Subtask`].
    pub fn writes(self, topics: &'d [&'d str]) -> Self {
        Self {
            writes: topics,
            ..self
        }
    }

    /// States the time after a release by which it shall have finished, as a sink, where that is
    /// not its DAG's [`relative_deadline`](Dag::relative_deadline).
    ///
    /// See [`Subtask`].
    pub fn due(self, relative_deadline: Duration) -> Self {
        Self {
            due: Some(relative_deadline),
            ..self
        }
    }

    /// Registers it.
    ///
    /// See [`Subtask`]. What is wrong with it is reported at the commit.
    #[track_caller]
    pub fn register(self, attributes: SubtaskAttributes) {
        let _ = self.register_labelled(attributes);
    }

    /// Registers it, and returns how messages call it.
    #[inline(never)]
    #[track_caller]
    pub(super) fn register_labelled(self, attributes: SubtaskAttributes) -> SubtaskLabel {
        let mut draft = self.dag.open();
        if self.is_replaceable {
            let subtask = draft.spec.subtasks.len();
            draft.replaceable.push(subtask);
        }
        let [inputs, outputs] = self.types.map(|types| types());
        let ends = Ends {
            inputs: (self.reads, &inputs),
            outputs: (self.writes, &outputs),
        };
        let subtask = draft.register(self.body, ends, attributes);
        if let Some(due) = self.due {
            draft.set_sink_deadline(due, &subtask);
        }
        subtask
    }
}

impl fmt::Debug for Subtask<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Subtask").finish_non_exhaustive()
    }
}
