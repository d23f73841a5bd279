//! The stock of contexts in which instances run.
//!
//! A preempted instance keeps its context, stack included. At any time a core runs one context and
//! keeps at most one spare, and each subtask has at most one suspended instance: twice the number
//! of cores plus the number of subtasks is therefore enough. A commit creates that many contexts,
//! and a run creates none. When a fault ends a core's instance, the core has two contexts for a
//! moment: it takes another one, then gives the first back. Contexts are never freed; the next
//! commit uses them again.
//!
//! All stacks have the largest size stated in the first commit, since any context may run any
//! subtask. The cores' first contexts have room to grow to that size.

use alloc::vec::Vec;

use sched_dag::TaskSet;

use crate::machine::context::Parked;
use crate::machine::paging::MapError;
use crate::machine::spinlock::SpinLock;
use crate::machine::{interrupt, this_core};
use crate::memory;

/// The stack size of a context for subtasks that state none, in bytes.
const STACK_BYTES: u64 = 64 * 1024;

/// The stack size of the context for the app's main function, in bytes. The main function evaluates
/// whole runs, also in builds without optimization.
const MAIN_STACK_BYTES: u64 = 256 * 1024;

struct ContextPool {
    free: Vec<Parked>,
    /// The number of contexts, free or not.
    total: usize,
    /// The size of their stacks, in bytes; 0 before the first commit.
    stack_bytes: u64,
}

static STOCK: SpinLock<ContextPool> = SpinLock::new(ContextPool {
    free: Vec::new(),
    total: 0,
    stack_bytes: 0,
});

/// Creates a core's first context.
pub fn create_first(is_background: bool) -> Result<Parked, MapError> {
    let (bytes, room) = match is_background {
        true => (MAIN_STACK_BYTES, 0),
        false => (STACK_BYTES, *sched_dag::STACK_BYTES.end()),
    };
    create(bytes, room, is_background)
}

fn create(bytes: u64, room: u64, is_background: bool) -> Result<Parked, MapError> {
    let top = memory::new_stack(bytes, room)?;
    Ok(Parked::new(top, bytes, is_background))
}

/// Returns the stack size large enough for every subtask of a task set, in bytes.
pub fn stack_bytes(task_set: &TaskSet) -> u64 {
    task_set
        .largest_stack_bytes(STACK_BYTES)
        .next_multiple_of(4096)
}

/// Grows all stacks to the given number of bytes; only the first call has an effect. Returns the
/// size in bytes. To be called while no core runs anything of a DAG.
#[inline(never)]
pub fn settle(bytes: u64) -> Result<u64, MapError> {
    let settled = STOCK.lock().stack_bytes;
    if settled > 0 {
        return Ok(settled);
    }
    // The stock is still empty, so the cores' own contexts are the only ones to grow.
    for core in this_core::all() {
        let (context, own) = (core.context(), core.context().stack_bytes());
        if own < bytes {
            let top = context.stack_top();
            memory::grow_stack(top - own, top - bytes)?;
            context.note_grown(bytes);
        }
    }
    STOCK.lock().stack_bytes = bytes;
    Ok(bytes)
}

/// Ensures that `total` contexts exist, either in the stock or taken from the stock.
pub fn provide(total: usize) -> Result<(), MapError> {
    let stock = STOCK.lock();
    let (existing, bytes) = (stock.total, stock.stack_bytes);
    // Unlocked meanwhile: `create` takes `MEMORY`, and no lock but the heap's is taken inside this.
    drop(stock);
    let missing = total.saturating_sub(existing);
    if missing == 0 {
        return Ok(());
    }
    // Room for every context that can ever be free, so giving back never allocates.
    let mut grown = Vec::with_capacity(total.max(existing));
    for _ in 0..missing {
        grown.push(create(bytes, 0, false)?);
    }
    let mut stock = STOCK.lock();
    grown.append(&mut stock.free);
    // The old vector is freed after the lock: the heap has a lock of its own.
    let old = core::mem::replace(&mut stock.free, grown);
    stock.total += missing;
    drop(stock);
    drop(old);
    Ok(())
}

/// Takes a context out of the stock. Interrupts are disabled.
///
/// # Panics
///
/// If the stock is empty, which [`provide`]'s rule excludes.
fn take_spare() -> Parked {
    STOCK
        .lock_uninterrupted()
        .free
        .pop()
        .expect("contexts are provided at commit")
}

/// Prepares a working context, in place of a suspended or abandoned context. Interrupts are
/// disabled.
pub fn new_worker() -> Parked {
    // The core's own spare first: that one takes no lock.
    let mut context = this_core::take_spare_context().unwrap_or_else(take_spare);
    context.restart(interrupt::work);
    context
}

/// Puts a context without work back into the stock.
pub fn give_back(context: Parked) {
    STOCK.lock().free.push(context);
}

/// Returns how many contexts exist in all for instances, and how many of these are in the stock.
pub fn count() -> (usize, usize) {
    let stock = STOCK.lock();
    (stock.total, stock.free.len())
}
