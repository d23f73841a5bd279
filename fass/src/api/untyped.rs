//! Subtasks of a graph that is known only at run time.
//!
//! A function's tuples state a graph at compile time, with at most 16 inputs
//! and outputs a subtask. A graph that is read from a file, or generated, has
//! neither: its subtasks are *untyped*. An untyped subtask is a function of the
//! job's number alone, its edges are stated one by one
//! ([`Dag::precede`](crate::Dag::precede)), any number of them, and carry no data.
//!
//! All else is as for typed subtasks. The commit verifies the same graph of the
//! same model. Each edge has its ring of slots, through which a token
//! goes for every job: an instance takes the tokens of *its* job from all
//! predecessors before the function is called (R2), and gives its own only after
//! the function has returned (R3). A platform that starts an instance early is
//! found out here as it is with typed subtasks.

use alloc::rc::Rc;
use core::cell::RefCell;
use core::fmt;

use crate::draft::Draft;

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
