//! How much of its stack each subtask has used, on request (`measure=stacks`).
//!
//! After each instance its stack is looked at, and painted again, so the figure is this
//! subtask's, with what the kernel itself does on that stack. It takes some microseconds an
//! instance, with interrupts disabled.

use alloc::boxed::Box;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use fass::platform::Plan;

use crate::machine::paint;
use crate::machine::spinlock::SpinLock;

static MEASURES: AtomicBool = AtomicBool::new(false);

/// The most that each subtask of the last commit has used, by vertex.
static USED: SpinLock<&[AtomicU64]> = SpinLock::new(&[]);

/// Has stacks measured from the next commit on.
pub fn enable() {
    MEASURES.store(true, Ordering::Relaxed);
}

/// Has the subtasks of a plan measured, if that is wished.
pub(super) fn watch(plan: &mut Plan) {
    if MEASURES.load(Ordering::Relaxed) {
        measure(plan);
    }
}

#[cold]
#[inline(never)]
fn measure(plan: &mut Plan) {
    // Of each commit that is measured these words stay: its bodies may outlive the run.
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

/// Returns what was found of the last commit's subtasks; nothing if it was not wished.
pub fn used() -> &'static [AtomicU64] {
    *USED.lock()
}
