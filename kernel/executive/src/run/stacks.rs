//! Measures how much of its stack each subtask has used, on request (`measure=stacks`).
//!
//! After each instance the kernel inspects the stack and paints it again, so the figure belongs to
//! this subtask, and includes the kernel's own use of the stack. The inspection takes some
//! microseconds for each instance, with interrupts disabled.

use alloc::boxed::Box;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use fass::platform::Plan;

use crate::machine::paint;
use crate::machine::spinlock::SpinLock;

static MEASURES: AtomicBool = AtomicBool::new(false);

/// The largest number of bytes used by each subtask of the last commit, by vertex.
static USED: SpinLock<&[AtomicU64]> = SpinLock::new(&[]);

/// Turns measuring on, from the next commit on.
pub fn enable() {
    MEASURES.store(true, Ordering::Relaxed);
}

/// Measures the subtasks of a plan, if requested.
pub(super) fn watch(plan: &mut Plan) {
    if MEASURES.load(Ordering::Relaxed) {
        measure(plan);
    }
}

#[cold]
#[inline(never)]
fn measure(plan: &mut Plan) {
    // Each measured commit leaks these words: its bodies may outlive the run.
    let used: Box<[AtomicU64]> = (0..plan.task_set.vertices()).map(|_| 0.into()).collect();
    let used: &'static [AtomicU64] = Box::leak(used);
    for (most, body) in used.iter().zip(plan.bodies.iter_mut().flatten()) {
        body.on_completion(Box::new(move || {
            if let Some(bytes) = paint::take_used_bytes() {
                most.fetch_max(bytes, Ordering::Relaxed);
            }
        }));
    }
    *USED.lock() = used;
}

/// Returns the figures of the last commit's subtasks; empty if not requested.
pub fn used() -> &'static [AtomicU64] {
    *USED.lock()
}
