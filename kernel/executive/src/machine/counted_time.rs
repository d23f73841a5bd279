//! Counted time under QEMU, made repeatable to the nanosecond.
//!
//! With `-icount shift=0,sleep=off` an instruction takes a nanosecond, and when all cores halt QEMU
//! advances the clock to the next timer's end. QEMU makes that jump in its main loop
//! (`main_loop_wait` calls `icount_start_warp_timer`), and executes instructions in another thread.
//! The main loop is also awake for no reason after each timer that has fired. The main loop accepts
//! the halt of the last core as soon as `hlt` has set its flag, but the instructions up to and
//! including `hlt` are counted only at the end of the core's turn (`icount_process_data`). If the
//! main loop looks in between, it jumps to the timer's end, and those few instructions are added on
//! top: the interrupt comes some 9 ns late. The order of the two depends on the host, some 1 halt
//! in 100,000 goes the other way, and everything afterwards is shifted.
//!
//! Interrupts late by less than [`GRACE_NS`] can be made equally late: a timer's interrupt, before
//! any other action or look, waits until exactly that long after its time ([`settle`]). A loop
//! takes longer than a nanosecond to go round, so the interrupt instead executes as many `nop`s as
//! nanoseconds are left. And a core reads the counter right before halting ([`count_before_halt`]),
//! so that QEMU counts all instructions executed so far and no more than a few remain at stake.
//!
//! The jump does more than move the clock: it also marks every core's emulation to leave its next
//! turn (`qemu_timer_notify_cb`, `rr_kick_vcpu_thread`). As a rule QEMU has passed all cores by
//! then, and continues with the first. But if the main loop is so early that QEMU is still passing
//! the halted cores behind the last core (`rr_cpu_thread_fn`), QEMU continues right there, and
//! other cores than usual still have the mark when the timer's core gets its turn. The mark matters
//! if another timer ends in the next few microseconds: QEMU then looks for due timers before a
//! marked core's turn, but within an unmarked core's turn, which then has no instruction left and
//! is lost (`icount_prepare_for_run`). The order of turns would thus depend on the host. A core
//! whose timer has fired therefore passes its turn once, by a `pause`; at its next turn QEMU has
//! passed all cores, and no mark is left ([`settle`]).
//!
//! All of this is off unless [`enable`] is called, and useless where an instruction does not take a
//! nanosecond. Where a timer's interrupt waits for its turn because other cores compute, not all
//! cores had halted, and the clock has not jumped: nothing is done then. One effect remains: of two
//! cores whose timers end at the same time, or within some 100 ns, the first is the core QEMU
//! continues with, and that is the host's choice in the rare cases above. Several cores should
//! therefore not wait for the same time.

use core::arch::asm;
use core::sync::atomic::{AtomicBool, Ordering};

use super::{clock, cpu};

/// How long after its time a timer's interrupt continues, in nanoseconds. Until [`settle`] has read
/// the clock again some 90 instructions pass; from [`count_before_halt`] to the halt, less than 10.
const GRACE_NS: u64 = 128;

static IS_ENABLED: AtomicBool = AtomicBool::new(false);

/// Makes timers' interrupts settle from now on.
pub fn enable() {
    IS_ENABLED.store(true, Ordering::Relaxed);
}

/// Returns [`GRACE_NS`] after `at_ns`, the time of this core's timer; at once if that moment is
/// past, or if the timer is early. Before a wait, all other cores have a turn.
#[inline]
pub(super) fn settle(at_ns: u64) {
    if !IS_ENABLED.load(Ordering::Relaxed) {
        return;
    }
    let Some(late_ns) = clock::now_ns().checked_sub(at_ns) else {
        return;
    };
    if late_ns < GRACE_NS {
        cpu::relax();
        let late_ns = clock::now_ns() - at_ns;
        execute_nops(GRACE_NS.saturating_sub(late_ns));
    }
}

/// Begins the last few instructions before a halt.
#[inline]
pub(super) fn count_before_halt() {
    if IS_ENABLED.load(Ordering::Relaxed) {
        let _ = cpu::time_stamp();
    }
}

/// Executes that many instructions, at most [`GRACE_NS`], and always the same few besides.
fn execute_nops(count: u64) {
    let count = count.min(GRACE_NS);
    // SAFETY: the jump goes to one of the `nop`s, of one byte each, or to the end,
    // since `count` is not larger than their number; no memory is touched.
    unsafe {
        asm!(
            "lea {target}, [rip + 2f]",
            "sub {target}, {count}",
            "jmp {target}",
            ".rept {most}",
            "nop",
            ".endr",
            "2:",
            target = out(reg) _,
            count = in(reg) count,
            most = const GRACE_NS,
            options(nomem, nostack),
        );
    }
}
