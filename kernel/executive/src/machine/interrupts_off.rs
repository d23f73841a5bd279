//! Measures how long interrupts stay disabled at a stretch.
//!
//! While interrupts are disabled, no decision of the scheduler can take effect on that core; every
//! latency therefore includes up to the longest such section. The kernel measures on request only
//! (`measure=interrupts`): the two readings of the clock cost more than many of the measured
//! sections.
//!
//! A section begins where code or an interrupt disables interrupts and ends where interrupts are
//! enabled again; a section may lead through several contexts.

use core::panic::Location;
use core::sync::atomic::{AtomicBool, Ordering};

use super::{cpu, this_core};

static ENABLED: AtomicBool = AtomicBool::new(false);

/// Begins to measure, once all cores are up.
pub fn enable() {
    ENABLED.store(true, Ordering::Relaxed);
}

/// Notes that interrupts have just been disabled here, at `place`.
pub(super) fn note_disabled(place: &'static Location<'static>) {
    if ENABLED.load(Ordering::Relaxed) {
        measure_from(place);
    }
}

/// Notes that interrupts are about to be enabled.
pub(super) fn note_enabled() {
    if ENABLED.load(Ordering::Relaxed) {
        measure_to_here();
    }
}

// Not inlined into each place that disables interrupts: few runs measure, and an image has many
// such places and little room.

#[cold]
#[inline(never)]
fn measure_from(place: &'static Location<'static>) {
    let meter = this_core::get().meter();
    meter
        .began_at
        .store(core::ptr::from_ref(place).cast_mut(), Ordering::Relaxed);
    meter.began.store(cpu::time_stamp(), Ordering::Relaxed);
}

#[cold]
#[inline(never)]
fn measure_to_here() {
    let meter = this_core::get().meter();
    // 0 if interrupts were disabled before the measurement began.
    let began = meter.began.swap(0, Ordering::Relaxed);
    let ticks = cpu::time_stamp().saturating_sub(began);
    if began != 0 && ticks > meter.longest.load(Ordering::Relaxed) {
        meter.longest.store(ticks, Ordering::Relaxed);
        meter
            .longest_at
            .store(meter.began_at.load(Ordering::Relaxed), Ordering::Relaxed);
    }
}

/// Returns the longest section of all cores so far, in ticks of the time stamp counter, and its
/// place of origin; then starts over.
pub fn take_longest() -> Option<(u64, &'static Location<'static>)> {
    let sections = this_core::all().iter().map(|core| {
        let meter = core.meter();
        let place = meter.longest_at.load(Ordering::Relaxed);
        (meter.longest.swap(0, Ordering::Relaxed), place)
    });
    let (ticks, place) = sections.max_by_key(|(ticks, _)| *ticks)?;
    // SAFETY: a pointer that is not null comes from a `&'static` in `measure_from`.
    Some((ticks, unsafe { place.as_ref() }?))
}
