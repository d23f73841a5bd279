//! Sections of app code, executed by one core at a time, with preemption postponed.
//!
//! Unlike a [`SpinLock`](super::spinlock::SpinLock), a section lock can be given to untrusted code.
//! Interrupts stay enabled in a section, so events there are the app's: a fault is contained, a
//! budget ends the section. Only preemption is postponed until the section ends, since a preempted
//! holder would block every core waiting for the lock. The delay is [`LONGEST_SECTION`] at most: a
//! holder that never returns delays other instances for that time, and no longer.
//!
//! Waiting cores take turns in a circle: a leaving core gives the turn to the next in line. As a
//! rule, each other core therefore enters at most once before a waiting core. A waiting context can
//! be preempted; the context then gives up its turn with its core, and any core may enter.
//!
//! **Section invariant**: while the lock of a context's `SectionNote` is not null, the lock belongs
//! to, and is borrowed by, a frame of [`with`] on the context's stack that has not returned.

use core::sync::atomic::Ordering::{Acquire, Relaxed, Release};

use fass::platform::LockWords;
use fass::shared::LONGEST_SECTION;

use super::context::Context;
use super::this_core::{self, Core};
use super::timer::{self, Alarm};
use super::{clock, cpu, interrupt_flag, local_apic, vector};

/// The bit of a lock's state for a held lock.
const IS_HELD: u32 = 1;

const LONGEST_NS: u64 = LONGEST_SECTION.subsec_nanos() as u64;

/// Waits for a lock, and calls `section` with the lock held. Returns the duration of the call in
/// nanoseconds; `None`, without a call, if the caller is in a section already.
pub fn with(lock: &LockWords, section: &mut dyn FnMut()) -> Option<u64> {
    if with_core(|core| is_in_section(core.context())) {
        return None;
    }
    // Each try reads the core anew: between two tries the context may be preempted, and move.
    while !with_core(|core| enter(lock, core)) {
        cpu::relax();
    }
    let entered_ns = clock::now_ns();
    section();
    let took_ns = clock::now_ns().saturating_sub(entered_ns);
    with_core(|core| leave(lock, core));
    Some(took_ns)
}

/// Does `work` on the current core, with interrupts disabled.
fn with_core<R>(work: impl FnOnce(&'static Core) -> R) -> R {
    let were_enabled = interrupt_flag::disable();
    let result = work(this_core::get());
    interrupt_flag::restore(were_enabled);
    result
}

fn is_in_section(context: &Context) -> bool {
    !context.sections().lock.load(Relaxed).is_null()
}

/// Enters a section, or queues the core for its turn. Interrupts are disabled. Reports whether the
/// section was entered.
fn enter(lock: &LockWords, core: &Core) -> bool {
    // Counted from 1, as the turn in the lock's word is: 0 is no core.
    let here = core.index + 1;
    let state = lock.state.load(Relaxed);
    let turn = state >> 1;
    // The turn of a core that waits no more is void: `stop_waiting` leaves the word as it is.
    let is_anothers = turn != 0 && turn != here && waits(lock, turn - 1);
    let taken = state | IS_HELD;
    // The turn is in the word, so that no release comes in between.
    let enters = state != taken
        && !is_anothers
        && (lock.state.compare_exchange(state, taken, Acquire, Relaxed)).is_ok();
    let (word, bit) = bit_of(core.index);
    match enters {
        true => lock.waiting[word].fetch_and(!bit, Relaxed),
        // The cache line is left to the holder while nothing changes.
        false if waits(lock, core.index) => 0,
        false => lock.waiting[word].fetch_or(bit, Relaxed),
    };
    let note = core.context().sections();
    note.waits_on.store(if enters { 0 } else { here }, Relaxed);
    (note.lock).store(core::ptr::from_ref(lock).cast_mut(), Release);
    enters
}

/// Ends a section, and does any postponed preemption. Interrupts are disabled.
fn leave(lock: &LockWords, core: &Core) {
    release(lock, core.index);
    let note = core.context().sections();
    note.lock.store(core::ptr::null_mut(), Release);
    if note.put_off_ns.swap(0, Relaxed) != 0 {
        // By an interrupt to this core: only a handler can exchange contexts.
        local_apic::send(core.apic_id(), vector::WAKE);
    }
}

/// Releases the lock, and passes the turn to the next waiting core.
fn release(lock: &LockWords, here: u32) {
    let cores = u32::try_from(this_core::all().len()).unwrap_or(u32::MAX);
    let mut others = (here + 1..cores).chain(0..here);
    let next = others.find(|&core| waits(lock, core));
    let turn = next.map_or(0, |core| core + 1);
    // One store for both: were the lock free before its turn is known, any core could enter.
    lock.state.store(turn << 1, Release);
}

fn waits(lock: &LockWords, core: u32) -> bool {
    let (word, bit) = bit_of(core);
    lock.waiting[word].load(Relaxed) & bit != 0
}

const fn bit_of(core: u32) -> (usize, u64) {
    ((core / 64) as usize, 1 << (core % 64))
}

/// Gives up the turn of a context about to lose its core, if the context waits. Interrupts are
/// disabled.
pub fn stop_waiting(context: &Context) {
    let note = context.sections();
    let Some(core) = note.waits_on.load(Relaxed).checked_sub(1) else {
        return;
    };
    note.waits_on.store(0, Relaxed);
    // SAFETY: by the section invariant a frame borrows it.
    if let Some(lock) = unsafe { note.lock.swap(core::ptr::null_mut(), Acquire).as_ref() } {
        let (word, bit) = bit_of(core);
        lock.waiting[word].fetch_and(!bit, Relaxed);
    }
}

/// Ends the section of an abandoned context. Interrupts are disabled.
pub(super) fn end(context: &Context) {
    stop_waiting(context);
    let note = context.sections();
    // SAFETY: by the section invariant a frame of the abandoned context borrows the lock, and
    // nothing has used the frame since.
    if let Some(lock) = unsafe { note.lock.swap(core::ptr::null_mut(), Acquire).as_ref() } {
        release(lock, this_core::get().index);
    }
    note.put_off_ns.store(0, Relaxed);
}

/// Postpones the preemption of the context running on this core, `core`, if the context is in a
/// section. Reports whether the preemption is postponed. Called in an interrupt handler.
pub fn puts_off(core: &Core, now_ns: u64) -> bool {
    let note = core.context().sections();
    if !is_in_section(core.context()) || note.waits_on.load(Relaxed) != 0 {
        return false;
    }
    let put_off_ns = &note.put_off_ns;
    let first_ns = match put_off_ns.load(Relaxed) {
        0 => {
            // 0 is taken: it says that nothing was postponed.
            put_off_ns.store(now_ns.max(1), Relaxed);
            now_ns
        }
        first_ns => first_ns,
    };
    let end_ns = first_ns.saturating_add(LONGEST_NS);
    if now_ns < end_ns {
        // The budget's alarm will do: its handler looks at the clock again, and the timer's
        // interrupt then retries every postponed preemption.
        timer::set_no_later(core, Alarm::Budget, end_ns);
    }
    now_ns < end_ns
}

/// Reports whether a preemption on this core has been postponed. Called in an interrupt handler.
pub fn has_put_off(core: &Core) -> bool {
    core.context().sections().put_off_ns.load(Relaxed) != 0
}
