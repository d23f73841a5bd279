//! Subtasks of a graph that is known only at run time.
//!
//! A function's tuples state a graph at compile time, with at most 16 inputs
//! and outputs a subtask. A graph that is read from a file, or generated, has
//! neither: its subtasks are *untyped*. An untyped subtask is a function of the
//! job's number alone, its edges are stated one by one
//! ([`Dag::precede`](crate::Dag::precede)), any number of them, and carry no data.
//!
//! All else is as for typed subtasks. The commit verifies the same graph of the
//! same model. Each edge has its ring of slots, through which a [`Signal`]
//! goes for every job: an instance takes the signals of *its* job from all
//! predecessors before the function is called (R2), and gives its own only after
//! the function has returned (R3). A platform that starts an instance early is
//! found out here as it is with typed subtasks.

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::convert::Infallible;
use core::fmt;
use core::pin::Pin;
use core::task::{Context, Poll};

use crate::draft::Draft;
use crate::gate::Gate;
use crate::plan::Body;
use crate::subtask::{MakeBody, SubtaskFuture};
use crate::topic::{Publisher, Subscriber};

/// A subtask without types, by which edges name it. Made by
/// [`Dag::register_untyped_subtask`](crate::Dag::register_untyped_subtask).
///
/// ```
/// use fass::{SubtaskAttributes, Untyped, create_dag};
///
/// let dag = create_dag();
/// let subtasks: Vec<Untyped> = (0..40)
///     .map(|_| dag.register_untyped_subtask(|_job| (), SubtaskAttributes::default()))
///     .collect();
/// for earlier in &subtasks[..39] {
///     dag.precede(earlier, &subtasks[39]); // a join of 39
/// }
/// ```
#[derive(Clone)]
pub struct Untyped {
    pub(crate) draft: Rc<RefCell<Draft>>,
    /// The subtask's position in its DAG.
    pub(crate) subtask: usize,
}

impl fmt::Debug for Untyped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Untyped").field(&self.subtask).finish()
    }
}

/// What an edge between untyped subtasks carries: that the predecessor's
/// instance is complete.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Signal;

/// Defers making the future until the commit knows the wiring.
pub(crate) fn defer<F: FnMut(u64) + Send + 'static>(f: F) -> MakeBody {
    Box::new(move |wiring, subtask| {
        let gate = Gate::new();
        let (before, after) = wiring.signals(subtask);
        let turns = UntypedTurns {
            f,
            before,
            after,
            gate: gate.clone(),
        };
        Body::new(Box::new(turns), gate)
    })
}

/// The loop of an untyped subtask: as that of figure 4, with signals for values.
struct UntypedTurns<F> {
    f: F,
    before: Vec<Subscriber<Signal>>,
    after: Publisher<Signal>,
    gate: Gate,
}

/// Nothing in it is pinned.
impl<F> Unpin for UntypedTurns<F> {}

impl<F: FnMut(u64)> Future for UntypedTurns<F> {
    type Output = Infallible;

    fn poll(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Infallible> {
        let turns = self.get_mut();
        if let Some(job) = turns.gate.pass() {
            turns.before.iter_mut().for_each(|edge| {
                edge.recv(job);
            });
            (turns.f)(job);
            turns.after.send(job, Signal);
            turns.gate.close();
        }
        Poll::Pending
    }
}

impl<F: FnMut(u64) + Send> SubtaskFuture for UntypedTurns<F> {
    fn discard(&mut self, job: u64) {
        self.before.iter_mut().for_each(|edge| edge.discard(job));
    }
}
