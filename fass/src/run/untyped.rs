//! An untyped subtask as a future: as a typed one, with tokens for values.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::convert::Infallible;
use core::pin::Pin;
use core::task::{Context, Poll};

use super::gate::Gate;
use super::plan::{Body, SubtaskFuture};
use super::subtask::MakeBody;
use super::topic::{Publisher, Subscriber, Token};

/// Defers making the future until the commit knows the wiring.
pub(crate) fn defer<F: FnMut(u64) + Send + 'static>(f: F) -> MakeBody {
    Box::new(move |wiring, subtask| {
        let gate = Gate::new();
        let (before, after) = wiring.tokens(subtask);
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
    before: Vec<Subscriber<Token>>,
    after: Publisher<Token>,
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
            turns.after.send(job, Token);
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
