//! Where each subtask's runner lies, so that a fault does not cost it.
//!
//! Between its place and the core that runs it a runner moves as a box. If a fault ends the
//! instance, that box is somewhere on the stack of a context that was left for good. So the address
//! of each runner is noted at the commit: boxes move, what is in them does not.
//!
//! **Loan invariant**: the box of a vertex's one runner is in the placement, or, while the vertex is
//! a core's current one, on the stack of the context that runs there.

use alloc::boxed::Box;
use core::ptr;
use core::sync::atomic::{AtomicPtr, Ordering};

use sched_dag::placement::Placement;

use super::Runner;
use crate::machine::context::{Abandoned, Parked};

/// The addresses of all runners, by vertex.
pub(super) struct Loans(Box<[AtomicPtr<Runner>]>);

impl Loans {
    /// Makes room for so many vertices.
    pub(super) fn new(vertices: usize) -> Self {
        Self((0..vertices).map(|_| AtomicPtr::default()).collect())
    }

    /// Puts a runner into its place for the first time.
    pub(super) fn begin(
        &self,
        placement: &mut Placement<Box<Runner>, Parked>,
        mut runner: Box<Runner>,
    ) {
        let vertex = runner.vertex;
        self.0[vertex.index()].store(&raw mut *runner, Ordering::Relaxed);
        placement.replace(vertex, runner);
    }

    /// Takes a core's current runner back, whose context was `_left` there.
    pub(super) fn end(
        &self,
        placement: &mut Placement<Box<Runner>, Parked>,
        core: usize,
        _left: &Abandoned,
    ) -> Option<Box<Runner>> {
        let vertex = placement.lose(core)?;
        let runner = self.0[vertex.index()].swap(ptr::null_mut(), Ordering::Relaxed);
        // SAFETY: it comes from a box, which was on the stack of the context that was left (loan
        // invariant): nothing uses that one any more. The swap sees to it that it is taken once.
        (!runner.is_null()).then(|| unsafe { Box::from_raw(runner) })
    }
}
