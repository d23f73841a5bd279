//! Loans of runners: the kernel knows the place of each subtask's runner, so a fault loses none.
//!
//! A *loan* is the handle for using a runner. The loan moves between the runner's place and the
//! core running an instance. If a fault ends the instance, the loan is somewhere on the stack of an
//! abandoned context. The commit therefore notes where each runner is, and after a fault the loan
//! is made again.
//!
//! **Loan invariant**: of each runner exactly one loan will ever be used. While the runner belongs
//! to a core's current instance, the loan is on the stack of the context running there.

use alloc::boxed::Box;
use core::ops::{Deref, DerefMut};
use core::ptr::NonNull;

use sched_dag::placement::Placement;

use super::CoreRunner;
use crate::machine::abandoned::AbandonedContext;
use crate::machine::context::Parked;

/// Exclusive access to a runner, until [given back](Self::give_back).
pub struct RunnerLoan(NonNull<CoreRunner>);

// SAFETY: by the loan invariant it is the one way to the runner, which is `Send`.
unsafe impl Send for RunnerLoan where CoreRunner: Send {}

impl RunnerLoan {
    /// Ends the loan and returns the runner.
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

/// The places of all runners, by vertex.
pub(super) struct RunnerTable(Box<[Option<NonNull<CoreRunner>>]>);

// SAFETY: the addresses are used for loans only, which are `Send`.
unsafe impl Send for RunnerTable {}

impl RunnerTable {
    /// Makes room for a number of vertices.
    pub(super) fn new(vertices: usize) -> Self {
        Self((0..vertices).map(|_| None).collect())
    }

    /// Lends a runner, and notes its place.
    pub(super) fn lend(&mut self, runner: CoreRunner) -> RunnerLoan {
        let vertex = runner.vertex.index();
        let place = NonNull::from(Box::leak(Box::new(runner)));
        self.0[vertex] = Some(place);
        RunnerLoan(place)
    }

    /// Recovers the runner of a core's current instance after the core has left the instance's
    /// context, `_left`.
    pub(super) fn recover(
        &self,
        placement: &mut Placement<RunnerLoan, Parked>,
        core: usize,
        _left: &AbandonedContext,
    ) -> Option<RunnerLoan> {
        let vertex = placement.lose(core)?;
        // The other loan lies on a stack that nothing runs on any more, and is never used (loan
        // invariant).
        self.0[vertex.index()].map(RunnerLoan)
    }
}
