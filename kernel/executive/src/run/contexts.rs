//! The stock of contexts that instances run in.
//!
//! A preempted instance keeps its context, stack and all. At any time a core
//! runs one context and keeps at most one to spare, and each subtask has at most
//! one suspended instance: so twice the cores and once the subtasks are enough. That many are
//! made at a commit, never later. A core that ends what it runs, because of a fault, takes
//! another one for that moment, and gives the first one back. Contexts are never freed;
//! the next commit uses them again.
//!
//! All stacks are as large as the largest that the first commit states: any context may run any
//! subtask. Those that the cores begin with have room to grow to that.

use alloc::vec::Vec;

use sched_dag::TaskSet;

use crate::machine::context::Parked;
use crate::machine::paging::MapError;
use crate::machine::spinlock::SpinLock;
use crate::machine::{interrupt, this_core};
use crate::memory;

/// The stack of a context for subtasks that state none, in bytes.
const STACK_BYTES: u64 = 64 * 1024;

/// The stack of the context that runs the app's main function, in bytes. That evaluates
/// whole runs, also in builds without optimization.
const MAIN_STACK_BYTES: u64 = 256 * 1024;

struct ContextPool {
    free: Vec<Parked>,
    /// How many there are, free or not.
    total: usize,
    /// How large their stacks are; 0 before the first commit.
    stack_bytes: u64,
}

static STOCK: SpinLock<ContextPool> = SpinLock::new(ContextPool {
    free: Vec::new(),
    total: 0,
    stack_bytes: 0,
});

/// Makes the context that a core begins with.
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

/// Returns the size of the stacks that these subtasks can all run on.
pub fn stack_bytes(task_set: &TaskSet) -> u64 {
    task_set
        .largest_stack_bytes(STACK_BYTES)
        .next_multiple_of(4096)
}

/// Grows all stacks to so many bytes; only the first call has an effect. Returns how many they
/// have. To be called while no core runs anything of a DAG.
#[inline(never)]
pub fn settle(bytes: u64) -> Result<u64, MapError> {
    let settled = STOCK.lock().stack_bytes;
    if settled > 0 {
        return Ok(settled);
    }
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

/// Makes sure that there are `total` contexts in the stock or in use from it.
pub fn provide(total: usize) -> Result<(), MapError> {
    let stock = STOCK.lock();
    let (existing, bytes) = (stock.total, stock.stack_bytes);
    drop(stock);
    let missing = total.saturating_sub(existing);
    if missing == 0 {
        return Ok(());
    }
    // Room for all that can ever be free, so that giving back never allocates.
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
/// If there is none, which [`provide`]'s rule excludes.
fn take_spare() -> Parked {
    STOCK
        .lock_uninterrupted()
        .free
        .pop()
        .expect("contexts are provided at commit")
}

/// Makes a context that works, in place of one that is suspended or abandoned.
/// Interrupts are disabled.
pub fn new_worker() -> Parked {
    let mut context = this_core::take_spare_context().unwrap_or_else(take_spare);
    context.restart(interrupt::work);
    context
}

/// Puts a context that has nothing to do back into the stock.
pub fn give_back(context: Parked) {
    STOCK.lock().free.push(context);
}

/// Returns how many contexts there are in all for instances, and how many of
/// them are in the stock.
pub fn count() -> (usize, usize) {
    let stock = STOCK.lock();
    (stock.total, stock.free.len())
}
