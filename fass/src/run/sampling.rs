//! The bodies of subtasks whose findings are recorded: samples of recorded topics, and states.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;

use super::effect::Effect;
use super::line::Found;
use super::plan::{Body, Subtask};
use super::sample::SampleLine;

/// Puts something around a body.
pub(crate) type Around = Box<dyn FnOnce(Body) -> Body>;

/// Puts these around the bodies of the subtasks with these numbers.
pub(super) fn attach(around: Vec<(usize, Around)>, bodies: &mut Vec<Body>) {
    let mut all: Vec<Option<Body>> = core::mem::take(bodies).into_iter().map(Some).collect();
    for (subtask, around) in around {
        all[subtask] = all[subtask].take().map(around);
    }
    bodies.extend(all.into_iter().flatten());
}

/// Returns what lets the body of a sampling subtask tell its line which job it runs.
pub(super) fn around(line: Arc<SampleLine>) -> Around {
    Box::new(|body| {
        let effect: Box<dyn Effect> = Box::new(Found(Arc::clone(&line.way)));
        let mut body = body.wrapped(|subtask| Box::new(Sampling { subtask, line }));
        body.add_effects([effect]);
        body
    })
}

/// A subtask that samples recorded topics. (None such can be replaced after a fault.)
struct Sampling {
    subtask: Box<dyn Subtask>,
    line: Arc<SampleLine>,
}

impl Subtask for Sampling {
    fn take_turn(&mut self, job: u64) {
        self.line.begin(job);
        self.subtask.take_turn(job);
    }

    fn discard(&mut self, job: u64) {
        self.subtask.discard(job);
    }

    fn forget(self: Box<Self>) {
        self.subtask.forget();
    }
}
