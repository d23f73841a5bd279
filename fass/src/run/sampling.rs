//! The bodies of subtasks that sample recorded topics.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;

use super::effect::Effect;
use super::plan::{Body, Subtask};
use super::sample::SampleLine;

/// Lets the bodies of sampling subtasks tell their lines which job they run.
pub(super) fn attach(lines: Vec<(usize, Arc<SampleLine>)>, bodies: &mut Vec<Body>) {
    let mut all: Vec<Option<Body>> = core::mem::take(bodies).into_iter().map(Some).collect();
    for (subtask, line) in lines {
        all[subtask] = all[subtask].take().map(|body| {
            let (of, effect) = (Arc::clone(&line), Box::new(line) as Box<dyn Effect>);
            let mut body = body.wrapped(|subtask| Box::new(Sampling { subtask, line: of }));
            body.add_effects([effect]);
            body
        });
    }
    bodies.extend(all.into_iter().flatten());
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
