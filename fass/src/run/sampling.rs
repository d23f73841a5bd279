//! The bodies of subtasks whose findings are recorded: samples of recorded topics, and states.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;

use super::effect::Effect;
use super::line::{Found, Line};
use super::plan::Body;

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

/// Has a subtask look for something before each turn, and the line give away what it has found.
pub(super) fn around(line: Arc<Line>, look: impl Fn(u64) + Send + 'static) -> Around {
    let found: Box<dyn Effect> = Box::new(Found(line));
    let look = move |job| {
        look(job);
        true
    };
    Box::new(|body| {
        let mut body = body.before(look);
        body.add_effects([found]);
        body
    })
}
