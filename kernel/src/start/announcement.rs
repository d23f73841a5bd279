//! The line of kind `boot`, which says what machine this is, and warnings of what in it harms
//! real time.
//!
//! A hypervisor hides what the processor states of itself, so on one nothing is said of that but
//! in the line.

use alloc::vec::Vec;

use boot::BootInfo;

use super::selection;
use crate::println;
use executive::machine::calibration::Rate;
use executive::machine::this_core::{self, Core};
use executive::machine::{agreement, avx, clock, cpu, interrupt_flag, local_apic, processors};
use front::json;

/// Says what machine this is, and of what an app has to beware.
pub(super) fn announce(info: &BootInfo, app: &str, memory_bytes: u64, rate: &Rate) {
    let all = this_core::all();
    let cores = all.len();
    let ids: Vec<u32> = all.iter().map(Core::apic_id).collect();
    let siblings = selection::siblings(&ids, processors::sibling_bits());
    let efficiency_cores = all.iter().filter(|core| core.is_efficient()).count();
    let command_line = info.command_line().unwrap_or("(not UTF-8)");
    json::report("boot", |line| {
        line.text("version", env!("CARGO_PKG_VERSION"))
            .text("app", app)
            .number("cpus", cores as u64)
            .number("siblings", siblings as u64)
            .number("efficiency_cores", efficiency_cores as u64)
            .number("memory_kib", memory_bytes / 1024)
            .text("clock", rate.clock)
            .number("counter_khz", rate.khz)
            .flag("counter_invariant", cpu::has_invariant_counter())
            .flag("timer_in_halt", cpu::has_timer_in_halt())
            .flag("x2apic", local_apic::is_x2apic())
            .flag("avx", avx::is_on())
            .flag("clock_undisputed", rate.is_undisputed());
        if let Some((clock, khz)) = rate.check {
            line.text("clock_check", clock)
                .number("clock_check_khz", khz);
        }
        line.number("skew_ns", agreement::skew_ns())
            .number("ready_ns", clock::now_ns())
            .text("command_line", command_line);
    });
    if siblings > 0 {
        println!(
            "warning: {siblings} of {cores} cores share a physical core with another, and slow it \
             down; `smt=off` leaves them out"
        );
    }
    if efficiency_cores > 0 {
        println!(
            "warning: {efficiency_cores} of {cores} cores are efficiency cores, slower than the \
             others; `cores=` chooses"
        );
    }
    if cpu::hypervisor().is_none() && !cpu::has_invariant_counter() {
        println!(
            "warning: the processor does not state that its counter keeps one rate; if its \
             frequency changes, times are wrong"
        );
    }
    if interrupt_flag::stays_awake() {
        println!(
            "warning: halting may stop the processor's timer, so idle cores stay awake; \
             `idle=halt` lets them halt"
        );
    }
}
