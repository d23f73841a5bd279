//! Time slices of computing cores, for machines where instructions are counted.
//!
//! With `-icount` QEMU executes one core at a time. A core's *visit* lasts until the next timer of
//! any core ends, or until the core halts, executes a `pause`, interrupts another core or arms the
//! timer due next. A computing function does none of these. For as long as no timer ends, all other
//! cores wait: the computing ones, the woken ones, and those whose own timer has ended. And where a
//! timer's end cuts a visit short, QEMU 7.2 may skip the core behind
//! ([`counted_time`](super::counted_time)), so timers alone give nobody a fair share.
//!
//! The computing cores therefore take *time slices*, by a rule of the kernel's own:
//!
//! - At most one core has the slice. The slice ends after [`SLICE_NS`], by the core's own timer.
//! - A core without the slice waits, in the interrupt's handler or before calling a function: the
//!   core executes a `pause` at every visit. An interrupt does not wait: the core handles the
//!   interrupt at once, and resumes waiting.
//! - A core that has just got something to compute, after computing nothing, is *fresh*, and goes
//!   before cores that have already had a slice. If other cores are fresh, too, the first slice is
//!   a short one ([`FIRST_SLICE_NS`]): short functions need not wait for long functions.
//! - No slice begins while any core handles an interrupt or wakes others.
//! - A core with the slice that takes no interrupts keeps the slice for some milliseconds only.
//!
//! It follows that at any time all cores but one soon finish a visit, and the remaining core does
//! so after [`SLICE_NS`] at the latest. Then all are visited before the next slice begins. An
//! interrupt, and the start of an instance, therefore wait for little more than a slice, or two,
//! however many cores compute; and each of n computing cores gets an n-th of the clock.
//!
//! The time an instance waits for its slice does not count as execution and uses up no budget. The
//! clock advances meanwhile, for all.
//!
//! Core 0's background computes, too, and has no slice: the background gives way. Every
//! [`FIRST_SLICE_NS`] a timer ends the background's visit, whatever the background does, and the
//! background continues once no core is fresh ([`begin_background`]). With interrupts disabled the
//! background gives way once for each piece of text and each look at the scheduler ([`look_up`]).
//!
//! A core halting for an instance or watching the clock (`occupation`, `Event::wait`) takes no
//! part. The parts of a core, and the changes between them, are in `this_core::TimeSlicePart`. All
//! slices are off unless [`enable`] is called: real cores compute at the same time, and a lone core
//! need not share. The statics here need no order among each other: only one core at a time
//! executes instructions.

use core::panic::Location;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use super::this_core::{self, Core, TimeSlicePart};
use super::timer::{self, Alarm};
use super::{clock, cpu, interrupt_flag, interrupts_off, local_apic, vector};

/// The length of a slice, in nanoseconds. The end of a slice costs some 250 instructions.
const SLICE_NS: u64 = 8_000;

/// The length of a fresh core's first slice, in nanoseconds, if other cores are fresh, too.
const FIRST_SLICE_NS: u64 = 2_000;

/// How often a waiting core looks for the slice before taking over from a core that takes no
/// interrupts, and so never passes the slice on. Some milliseconds.
const MOST_LOOKS: u32 = 100_000;

static IS_ENABLED: AtomicBool = AtomicBool::new(false);

/// No core.
const NONE: u32 = u32::MAX;

/// The core with the slice, or [`NONE`].
static SLICE_HOLDER: AtomicU32 = AtomicU32::new(NONE);

/// The core to get the next slice, if it still waits then and no core is fresh; or [`NONE`].
static NEXT: AtomicU32 = AtomicU32::new(NONE);

/// The number of cores that are fresh, or about to be.
static FRESH: AtomicU32 = AtomicU32::new(0);

/// The number of cores handling an interrupt, or waking others.
static URGENT: AtomicU32 = AtomicU32::new(0);

/// Makes cores take slices from now on, if there are several cores. To be called before the other
/// cores start: a core handling an interrupt during the call would end an urgent section without
/// having begun one, and the count of urgent cores would never be 0 again.
pub fn enable() {
    IS_ENABLED.store(this_core::all().len() > 1, Ordering::Relaxed);
}

fn is_enabled() -> bool {
    IS_ENABLED.load(Ordering::Relaxed)
}

/// Begins an urgent section: no slice may begin before its end.
#[inline]
pub fn begin_urgent() {
    if is_enabled() {
        URGENT.fetch_add(1, Ordering::Relaxed);
    }
}

/// Ends this core's urgent section.
#[inline]
pub fn end_urgent() {
    if is_enabled() {
        URGENT.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Notes in an interrupt that this core continues with an instance afterwards. Until then no core
/// that has already had a slice begins another one, which the instance would have to wait for.
#[inline]
pub fn come(core: &Core) {
    if is_enabled() && core.part() == TimeSlicePart::None {
        set_part(core, TimeSlicePart::Comes);
    }
}

/// Whether core 0's background computes; otherwise the background only halts.
static BACKGROUND: AtomicBool = AtomicBool::new(false);

/// Notes that the background computes from now on, and makes it give way regularly. Interrupts are
/// enabled.
pub fn begin_background() {
    if is_enabled() {
        BACKGROUND.store(true, Ordering::Relaxed);
        interrupt_flag::disable();
        give_way(this_core::get());
        interrupt_flag::enable();
    }
}

/// Notes that the background halts, or has ended.
pub fn end_background() {
    if is_enabled() {
        BACKGROUND.store(false, Ordering::Relaxed);
        // A background that halts gives way without an alarm.
        timer::set(Alarm::Hold, u64::MAX);
    }
}

/// Yields to cores with a new instance, until an interrupt is pending. The background does so again
/// after a short while. Interrupts are disabled.
fn give_way(core: &Core) {
    // One visit for all others, during which a woken core becomes fresh. And one more at the end: a
    // core that begins its slice arms its timer, and arming ends its visit.
    cpu::relax();
    while FRESH.load(Ordering::Relaxed) != 0 && !local_apic::is_interrupt_pending() {
        cpu::relax();
    }
    cpu::relax();
    keep_giving_way(core);
}

/// Sets the timer that makes the background give way.
fn keep_giving_way(core: &Core) {
    if core.index == 0 && BACKGROUND.load(Ordering::Relaxed) {
        timer::set(Alarm::Hold, clock::now_ns().saturating_add(FIRST_SLICE_NS));
    }
}

/// Gives all other cores a visit. Called during work for people, possibly with interrupts disabled.
pub fn look_up() {
    if is_enabled() {
        cpu::relax();
    }
}

/// Makes this core, about to continue with an instance, fresh unless it takes part already.
/// Interrupts are disabled.
#[inline]
pub fn join(core: &Core) {
    if is_enabled() && matches!(core.part(), TimeSlicePart::None | TimeSlicePart::Comes) {
        set_part(core, TimeSlicePart::Fresh);
    }
}

/// Ends this core's part: the core has nothing to compute. Leaves the core's alarm as it is.
/// Interrupts are disabled.
#[inline]
pub fn leave(core: &Core) {
    if is_enabled() {
        set_part(core, TimeSlicePart::None);
    }
}

/// Ends the alarm of an instance's hold. An alarm of the core's slice stays, or the slice would
/// have no end. Interrupts are disabled.
pub fn end_hold(core: &Core) {
    if core.part() != TimeSlicePart::Computes {
        timer::set(Alarm::Hold, u64::MAX);
    }
}

/// Ends this core's part like [`leave`], and prevents an interrupt for a slice's end. Core 0
/// returns to its background.
#[inline]
pub fn rest(core: &Core) {
    if is_enabled() {
        if core.part() != TimeSlicePart::None {
            set_part(core, TimeSlicePart::None);
            timer::set(Alarm::Hold, u64::MAX);
        }
        keep_giving_way(core);
    }
}

/// Returns when the instance may compute, on any core: waits for a slice, and handles interrupts
/// while waiting. Interrupts are disabled before and after.
#[inline]
pub fn enter() {
    if is_enabled() && !this_core::get().context().is_background() {
        enter_slice();
    }
}

#[cold]
fn enter_slice() {
    loop {
        let core = this_core::get();
        join(core);
        if core.part() == TimeSlicePart::Computes {
            return;
        }
        // Not measured as a section without interrupts: the wait ends as soon as an interrupt is
        // pending.
        interrupts_off::note_enabled();
        let has_slice = wait(core);
        interrupts_off::note_disabled(Location::caller());
        if has_slice {
            return;
        }
        interrupt_flag::enable();
        cpu::relax();
        interrupt_flag::disable();
    }
}

/// Waits like [`enter`], for an instance continued outside any interrupt: once interrupts are
/// enabled, the core waits for its slice as after an interrupt.
#[inline]
pub fn enter_by_interrupt(core: &Core) {
    if is_enabled() && core.part() == TimeSlicePart::Fresh {
        local_apic::send(core.apic_id(), vector::WAKE);
    }
}

/// Ends this core's part like [`leave`], for an instance that watches the clock. Interrupts are
/// enabled.
pub fn stand_back() {
    if is_enabled() {
        interrupt_flag::disable();
        leave(this_core::get());
        interrupt_flag::enable();
    }
}

/// Waits for a slice like [`enter`], for the same instance afterwards.
pub fn come_back() {
    if is_enabled() {
        interrupt_flag::disable();
        enter();
        interrupt_flag::enable();
    }
}

/// Ends an interrupt: if this core has to wait, waits for its slice or for another interrupt.
#[inline]
pub(super) fn end_interrupt() {
    if is_enabled() {
        end_interrupt_in_slice();
    }
}

#[cold]
fn end_interrupt_in_slice() {
    URGENT.fetch_sub(1, Ordering::Relaxed);
    let core = this_core::get();
    match core.part() {
        // The alarm that ends the background's visit has fired.
        TimeSlicePart::None if core.context().is_background() && !timer::is_set(Alarm::Hold) => {
            if BACKGROUND.load(Ordering::Relaxed) {
                give_way(core);
            }
            return;
        }
        // A worker that comes enters the slices by itself, before it calls a function.
        TimeSlicePart::None | TimeSlicePart::Comes => return,
        // With the alarm still set, the slice has not ended: another interrupt came.
        TimeSlicePart::Computes if timer::is_set(Alarm::Hold) => return,
        TimeSlicePart::Computes => pass(core),
        TimeSlicePart::Fresh | TimeSlicePart::Waits => {}
    }
    wait(core);
}

/// Ends this core's slice.
// The next waiting core in a circle follows, so that each computing core gets the same share.
fn pass(core: &Core) {
    let (before, from_here) = this_core::all().split_at(core.index as usize);
    let mut others = from_here.iter().skip(1).chain(before);
    let next = others.find(|other| other.part() == TimeSlicePart::Waits);
    NEXT.store(next.map_or(NONE, |next| next.index), Ordering::Relaxed);
    set_part(core, TimeSlicePart::Waits);
}

/// Waits until this core has the slice, or until an interrupt is pending. Reports whether this core
/// has the slice.
fn wait(core: &Core) -> bool {
    let since_ns = clock::now_ns();
    let mut looks = 0;
    let has_slice = loop {
        // One visit for all others, before anything begins.
        cpu::relax();
        looks += 1;
        if let Some(length_ns) = begin_slice(core, looks > MOST_LOOKS) {
            set_part(core, TimeSlicePart::Computes);
            timer::set(Alarm::Hold, clock::now_ns().saturating_add(length_ns));
            break true;
        }
        if local_apic::is_interrupt_pending() {
            break false;
        }
    };
    core.context().note_waited(clock::now_ns() - since_ns);
    has_slice
}

/// Begins this core's slice, if allowed. With `takes_over`, another core's slice is no obstacle.
/// Returns the length of the slice in nanoseconds.
fn begin_slice(core: &Core, takes_over: bool) -> Option<u64> {
    let holder = SLICE_HOLDER.load(Ordering::Relaxed);
    if (holder != NONE && !takes_over) || URGENT.load(Ordering::Relaxed) != 0 {
        return None;
    }
    let length_ns = length_of_slice(core)?;
    let (mine, order) = (core.index, Ordering::Relaxed);
    // QEMU may have ended this core's visit since the look: then another core may have begun a
    // slice.
    let begun = SLICE_HOLDER.compare_exchange(holder, mine, order, order);
    begun.is_ok().then_some(length_ns)
}

/// Returns the length of this core's slice in nanoseconds, if this core has the next slice.
fn length_of_slice(core: &Core) -> Option<u64> {
    let fresh = FRESH.load(Ordering::Relaxed);
    let next = this_core::all().get(NEXT.load(Ordering::Relaxed) as usize);
    // A next core that waits no more must not keep the slice from all others.
    let is_next =
        next.is_none_or(|next| next.index == core.index || next.part() != TimeSlicePart::Waits);
    match core.part() {
        // This core itself is one of the fresh ones.
        TimeSlicePart::Fresh if fresh > 1 => Some(FIRST_SLICE_NS),
        TimeSlicePart::Fresh => Some(SLICE_NS),
        _ => (fresh == 0 && is_next).then_some(SLICE_NS),
    }
}

#[cold]
fn set_part(core: &Core, part: TimeSlicePart) {
    let before = core.part();
    if before == TimeSlicePart::Computes && part != TimeSlicePart::Computes {
        // Fails, as it should, if another core has taken over the slice.
        let (mine, order) = (core.index, Ordering::Relaxed);
        let _ = SLICE_HOLDER.compare_exchange(mine, NONE, order, order);
    }
    let is_fresh = |part| matches!(part, TimeSlicePart::Comes | TimeSlicePart::Fresh);
    match (is_fresh(before), is_fresh(part)) {
        (false, true) => FRESH.fetch_add(1, Ordering::Relaxed),
        (true, false) => FRESH.fetch_sub(1, Ordering::Relaxed),
        _ => 0,
    };
    core.set_part(part);
}
