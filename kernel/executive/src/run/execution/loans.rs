//! Loans of runners: where that of each subtask is, so that a fault does not lose it.
//!
//! A *loan* is what one uses a runner by. It moves between the runner's place and the core that
//! runs an instance. If a fault ends that, the loan is somewhere on the stack of a context that
//! was left for good. So it is noted at the commit where each runner is, and the loan is made
//! again.
//!
//! **Loan invariant**: of each runner there is one loan that anything will ever use. While the
//! runner is of a core's current instance, it is on the stack of the context that runs there.

use alloc::boxed::Box;
use core::ops::{Deref, DerefMut};
use core::ptr::NonNull;

use sched_dag::placement::Placement;

use super::CoreRunner;
use crate::machine::abandoned::AbandonedContext;
use crate::machine::context::Parked;

/// A runner that is to be [given back](Self::give_back).
pub struct RunnerLoan(NonNull<CoreRunner>);

// SAFETY: by the loan invariant it is the one way to the runner, which is `Send`.
unsafe impl Send for RunnerLoan where CoreRunner: Send {}

impl RunnerLoan {
    /// Returns the runner itself.
    pub(super) fn give_back(self) -> CoreRunner {
        // SAFETY: `lend` has leaked a box, and by the loan invariant this ends its one loan.
        *unsafe { Box::from_raw(self.0.as_ptr()) }
    }
}

impl Deref for RunnerLoan {
    type Target = CoreRunner;

    #[inline]
    fn deref(&self) -> &CoreRunner {
        // SAFETY: by the loan invariant nothing else reaches the runner.
        unsafe { self.0.as_ref() }
    }
}

impl DerefMut for RunnerLoan {
    #[inline]
    fn deref_mut(&mut self) -> &mut CoreRunner {
        // SAFETY: by the loan invariant nothing else reaches the runner.
        unsafe { self.0.as_mut() }
    }
}

/// Where all runners are, by vertex.
pub(super) struct RunnerTable(Box<[Option<NonNull<CoreRunner>>]>);

// SAFETY: the addresses are used for loans only, which are `Send`.
unsafe impl Send for RunnerTable {}

impl RunnerTable {
    /// Makes room for so many vertices.
    pub(super) fn new(vertices: usize) -> Self {
        Self((0..vertices).map(|_| None).collect())
    }

    /// Lends a runner, and notes where it is.
    pub(super) fn lend(&mut self, runner: CoreRunner) -> RunnerLoan {
        let vertex = runner.vertex.index();
        let place = NonNull::from(Box::leak(Box::new(runner)));
        self.0[vertex] = Some(place);
        RunnerLoan(place)
    }

    /// Takes the runner of a core's current instance back, whose context was `_left` there.
    pub(super) fn recover(
        &self,
        placement: &mut Placement<RunnerLoan, Parked>,
        core: usize,
        _left: &AbandonedContext,
    ) -> Option<RunnerLoan> {
        let vertex = placement.lose(core)?;
        // By the loan invariant the other loan lies on the stack that nothing runs on any more.
        self.0[vertex.index()].map(RunnerLoan)
    }
}
