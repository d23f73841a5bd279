//! An untyped subtask: as a typed one, with tokens for values, and no future, since it
//! has nothing to wait for.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::plan::{Body, Subtask};
use super::subtask::MakeBody;
use super::topic::{Publisher, Subscriber, Token};

/// Defers making the subtask until the commit knows the wiring.
pub(crate) fn defer<F: FnMut(u64) + Send + 'static>(f: F) -> MakeBody {
    Box::new(move |wiring, subtask| {
        let (before, after) = wiring.tokens(subtask);
        Body::new(Box::new(Untyped { f, before, after }))
    })
}

struct Untyped<F> {
    f: F,
    before: Vec<Subscriber<Token>>,
    after: Publisher<Token>,
}

impl<F: FnMut(u64) + Send> Subtask for Untyped<F> {
    fn take_turn(&mut self, job: u64) {
        self.before.iter_mut().for_each(|edge| {
            edge.recv(job);
        });
        (self.f)(job);
        self.after.send(job, Token);
    }

    fn discard(&mut self, job: u64) {
        self.before.iter_mut().for_each(|edge| edge.discard(job));
    }

    fn forget(self: Box<Self>) {
        core::mem::forget(self.f);
    }
}
