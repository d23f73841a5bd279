//! Turns of computing cores, where instructions are counted.
//!
//! With `-icount` QEMU executes one core at a time, and a core's *visit* lasts until the
//! next timer of any core ends, or until the core halts, executes a `pause`, interrupts
//! another core or arms the timer that is the next to end. A function that computes does
//! nothing of that. For as long as no timer ends, all others wait: those that compute,
//! those that have been woken, and those whose own timer has ended. And where a timer's end
//! cuts a visit short, QEMU 7.2 may pass over the core behind it
//! ([`counted_time`](super::counted_time)), so timers alone give nobody a fair share.
//!
//! So the cores that compute take *turns*, by a rule of the kernel's own:
//!
//! - At most one core has the turn. It ends after [`TURN_NS`], by the core's own timer.
//! - A core without it waits for it, in the interrupt's handler or before it calls a
//!   function: it executes a `pause` whenever it is visited. An interrupt does not wait:
//!   the core handles it at once, and goes on waiting.
//! - A core that has just got something to compute is *fresh*, and goes before those that
//!   have had a turn. If others are fresh, too, its first turn is a short one
//!   ([`FIRST_TURN_NS`]): what takes no longer need not wait for what does.
//! - No turn begins while any core handles an interrupt or wakes others.
//! - A core that has the turn and takes no interrupts keeps it for some milliseconds only.
//!
//! It follows that at any time all cores but one are soon through with a visit, and that one
//! is after [`TURN_NS`] at the latest. Then all are visited before the next turn begins. So
//! an interrupt, and the start of an instance, wait for little more than a turn, or two,
//! however many cores compute; and each of n that compute gets an n-th of the clock.
//!
//! The time for which an instance waits for its turn does not count as its execution: it
//! uses up no budget. It does pass on the clock, for all.
//!
//! Core 0's background computes, too, and has no turn: it gives way. Every [`FIRST_TURN_NS`] a
//! timer ends its visit, whatever it does, and it goes on once no core is fresh
//! ([`begin_background`]). Where it has interrupts disabled it gives way once for each piece of
//! text and each look at the scheduler ([`look_up`]).
//!
//! A core that halts for an instance or watches the clock (`occupation`, `Event::wait`)
//! takes no part. All this is off unless [`enable`] is called: real cores compute at the
//! same time, and a core that is alone need not share. The statics here need no order
//! among each other: instructions of one core at a time are executed.

use core::panic::Location;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use super::this_core::{self, Core, TimeSlicePart};
use super::timer::{self, Alarm};
use super::{clock, cpu, interrupt_flag, interrupts_off, local_apic, vector};

/// How long a turn is. Its end costs some 250 instructions.
const TURN_NS: u64 = 8_000;

/// How long the first turn of a fresh core is, if others are fresh, too.
const FIRST_TURN_NS: u64 = 2_000;

/// How often a core that waits looks for the turn before it takes it from a core that
/// has it and does not pass it: one that takes no interrupts. Some milliseconds.
const MOST_LOOKS: u32 = 100_000;

static IS_ENABLED: AtomicBool = AtomicBool::new(false);

/// No core.
const NONE: u32 = u32::MAX;

/// The core that has the turn.
static HAS_TURN: AtomicU32 = AtomicU32::new(NONE);

/// The core that has it next, if that waits and none is fresh.
static NEXT: AtomicU32 = AtomicU32::new(NONE);

/// How many cores are fresh, or about to be.
static FRESH: AtomicU32 = AtomicU32::new(0);

/// How many cores handle an interrupt, or wake others.
static URGENT: AtomicU32 = AtomicU32::new(0);

/// Makes cores take turns from now on, if there are several. To be called before the others have
/// started: one that handles an interrupt meanwhile would end what it has not begun, and the count of
/// those that do would never be 0 again.
pub fn enable() {
    IS_ENABLED.store(this_core::all().len() > 1, Ordering::Relaxed);
}

fn is_enabled() -> bool {
    IS_ENABLED.load(Ordering::Relaxed)
}

/// Notes that this core does what no turn may come before.
#[inline]
pub fn begin_urgent() {
    if is_enabled() {
        URGENT.fetch_add(1, Ordering::Relaxed);
    }
}

/// Notes that it has done it.
#[inline]
pub fn end_urgent() {
    if is_enabled() {
        URGENT.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Notes in an interrupt that this core goes on with an instance after it. Until then no turn
/// of another core begins, which the instance would have to wait for.
#[inline]
pub fn come(core: &Core) {
    if is_enabled() && core.part() == TimeSlicePart::None {
        set_part(core, TimeSlicePart::Comes);
    }
}

/// Whether core 0's background computes; it does nothing else while it halts.
static BACKGROUND: AtomicBool = AtomicBool::new(false);

/// Notes that the background computes from now on, and has it give way, by and by. Interrupts are
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
        timer::set(Alarm::Hold, u64::MAX);
    }
}

/// Yields to cores that were just given an instance, until an interrupt is pending. The background
/// does so again in a short while. Interrupts are disabled.
fn give_way(core: &Core) {
    // One visit for all others: one that has been woken becomes fresh in it. And one more behind:
    // a core that begins its turn arms its timer, which ends its visit.
    cpu::relax();
    while FRESH.load(Ordering::Relaxed) != 0 && !local_apic::is_interrupt_pending() {
        cpu::relax();
    }
    cpu::relax();
    keep_giving_way(core);
}

/// Sets the timer by which the background gives way.
fn keep_giving_way(core: &Core) {
    if core.index == 0 && BACKGROUND.load(Ordering::Relaxed) {
        timer::set(Alarm::Hold, clock::now_ns().saturating_add(FIRST_TURN_NS));
    }
}

/// Gives all other cores a visit, in work for people that may have interrupts disabled.
pub fn look_up() {
    if is_enabled() {
        cpu::relax();
    }
}

/// Makes this core fresh unless it takes part already: it goes on with an instance.
/// Interrupts are disabled.
#[inline]
pub fn join(core: &Core) {
    if is_enabled() && matches!(core.part(), TimeSlicePart::None | TimeSlicePart::Comes) {
        set_part(core, TimeSlicePart::Fresh);
    }
}

/// Ends this core's part: it has nothing to compute. Its alarm is left as it is.
/// Interrupts are disabled.
#[inline]
pub fn leave(core: &Core) {
    if is_enabled() {
        set_part(core, TimeSlicePart::None);
    }
}

/// Ends the alarm of an instance's hold. One of the core's turn stays, or that would have no end.
/// Interrupts are disabled.
pub fn end_hold(core: &Core) {
    if core.part() != TimeSlicePart::Computes {
        timer::set(Alarm::Hold, u64::MAX);
    }
}

/// Like [`leave`], and sees to it that the core is not interrupted for a turn's end. Core 0 goes
/// back to its background.
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

/// Returns when the instance may compute, on any core: waits for a turn, and handles the
/// interrupts that come meanwhile. Interrupts are disabled before and after.
#[inline]
pub fn enter() {
    if is_enabled() && !this_core::get().context().is_background() {
        enter_in_turn();
    }
}

#[cold]
fn enter_in_turn() {
    loop {
        let core = this_core::get();
        join(core);
        if core.part() == TimeSlicePart::Computes {
            return;
        }
        interrupts_off::note_enabled();
        let has_turn = wait(core);
        interrupts_off::note_disabled(Location::caller());
        if has_turn {
            return;
        }
        interrupt_flag::enable();
        cpu::relax();
        interrupt_flag::disable();
    }
}

/// Like [`enter`], for an instance that this core goes on with outside any interrupt: as
/// soon as interrupts are enabled, it waits for its turn as after one.
#[inline]
pub fn enter_by_interrupt(core: &Core) {
    if is_enabled() && core.part() == TimeSlicePart::Fresh {
        local_apic::send(core.apic_id(), vector::WAKE);
    }
}

/// Like [`leave`], for an instance that watches the clock. Interrupts are enabled.
pub fn stand_back() {
    if is_enabled() {
        interrupt_flag::disable();
        leave(this_core::get());
        interrupt_flag::enable();
    }
}

/// Like [`enter`], for that instance afterwards.
pub fn come_back() {
    if is_enabled() {
        interrupt_flag::disable();
        enter();
        interrupt_flag::enable();
    }
}

/// Ends an interrupt: if this core has to wait for its turn, waits, for that or for
/// another interrupt.
#[inline]
pub(super) fn end_interrupt() {
    if is_enabled() {
        end_interrupt_in_turn();
    }
}

#[cold]
fn end_interrupt_in_turn() {
    URGENT.fetch_sub(1, Ordering::Relaxed);
    let core = this_core::get();
    match core.part() {
        TimeSlicePart::None if core.context().is_background() && !timer::is_set(Alarm::Hold) => {
            if BACKGROUND.load(Ordering::Relaxed) {
                give_way(core);
            }
            return;
        }
        TimeSlicePart::None | TimeSlicePart::Comes => return,
        TimeSlicePart::Computes if timer::is_set(Alarm::Hold) => return,
        TimeSlicePart::Computes => pass(core),
        TimeSlicePart::Fresh | TimeSlicePart::Waits => {}
    }
    wait(core);
}

/// Ends this core's turn.
fn pass(core: &Core) {
    let (before, from_here) = this_core::all().split_at(core.index as usize);
    let mut others = from_here.iter().skip(1).chain(before);
    let next = others.find(|other| other.part() == TimeSlicePart::Waits);
    NEXT.store(next.map_or(NONE, |next| next.index), Ordering::Relaxed);
    set_part(core, TimeSlicePart::Waits);
}

/// Waits until this core has the turn, or until an interrupt is pending. Reports whether
/// it has the turn.
fn wait(core: &Core) -> bool {
    let since_ns = clock::now_ns();
    let mut looks = 0;
    let has_turn = loop {
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
    has_turn
}

/// Begins this core's turn, if it may, or if it `takes_over` that of another. Returns how
/// long it is.
fn begin_slice(core: &Core, takes_over: bool) -> Option<u64> {
    let holder = HAS_TURN.load(Ordering::Relaxed);
    if (holder != NONE && !takes_over) || URGENT.load(Ordering::Relaxed) != 0 {
        return None;
    }
    let length_ns = length_of_turn(core)?;
    let (mine, order) = (core.index, Ordering::Relaxed);
    let begun = HAS_TURN.compare_exchange(holder, mine, order, order);
    begun.is_ok().then_some(length_ns)
}

/// Returns how long this core's turn is, if it has the next one.
fn length_of_turn(core: &Core) -> Option<u64> {
    let fresh = FRESH.load(Ordering::Relaxed);
    let next = this_core::all().get(NEXT.load(Ordering::Relaxed) as usize);
    let is_next =
        next.is_none_or(|next| next.index == core.index || next.part() != TimeSlicePart::Waits);
    match core.part() {
        TimeSlicePart::Fresh if fresh > 1 => Some(FIRST_TURN_NS),
        TimeSlicePart::Fresh => Some(TURN_NS),
        _ => (fresh == 0 && is_next).then_some(TURN_NS),
    }
}

#[cold]
fn set_part(core: &Core, part: TimeSlicePart) {
    let before = core.part();
    if before == TimeSlicePart::Computes && part != TimeSlicePart::Computes {
        // Unless the turn has been taken over.
        let (mine, order) = (core.index, Ordering::Relaxed);
        let _ = HAS_TURN.compare_exchange(mine, NONE, order, order);
    }
    let is_fresh = |part| matches!(part, TimeSlicePart::Comes | TimeSlicePart::Fresh);
    match (is_fresh(before), is_fresh(part)) {
        (false, true) => FRESH.fetch_add(1, Ordering::Relaxed),
        (true, false) => FRESH.fetch_sub(1, Ordering::Relaxed),
        _ => 0,
    };
    core.set_part(part);
}
