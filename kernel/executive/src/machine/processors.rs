//! Starting the other cores.

use core::sync::atomic::{AtomicU32, Ordering};

use super::this_core::{self, Core};
use super::{agreement, avx, clock, cpu, interrupt, local_apic, machine_check, topology};

/// Cores that have arrived in their entry function, the boot processor not
/// counted.
static ARRIVED: AtomicU32 = AtomicU32::new(0);

/// While processors start, QEMU's counted time may jump to the end of the next
/// timer, wherever that is: a timer of ours keeps the jumps this short.
const LONGEST_JUMP_NS: u64 = 2_000;

/// Makes the processor that executes this the core with APIC id `apic_id`:
/// segments, interrupt stacks, interrupt table and local APIC.
pub fn become_core(apic_id: u32) -> &'static Core {
    let core = this_core::load(apic_id);
    let is_efficient = topology::is_efficiency_core();
    core.is_efficient.store(is_efficient, Ordering::Relaxed);
    avx::begin();
    interrupt::load_table();
    machine_check::begin();
    local_apic::enable();
    core
}

/// Says that the core which executes this, `core`, has arrived, once it has compared its counter.
pub fn arrive(core: &Core) {
    agreement::compare_often(core);
    ARRIVED.fetch_add(1, Ordering::Release);
}

/// For how long cores may take to arrive. All are waited for, so this costs only where
/// one does not come; a host that is busy may let a virtual one wait for long.
pub const PATIENCE_NS: u64 = 5_000_000_000;

/// Starts all other cores at `entry`, by way of the page number `page`, and returns how
/// many have arrived (Intel SDM volume 3, 9.4.4: INIT, 10 ms, startup, 200 us, startup).
///
/// # Safety
///
/// As for [`boot_entry::processors::prepare`].
pub unsafe fn start_others(root_table: u64, page: u8, entry: boot_entry::processors::Entry) -> u32 {
    let others = || this_core::all().iter().skip(1);
    // SAFETY: passed on from the caller.
    unsafe { boot_entry::processors::prepare(root_table, page, entry) };
    for (place, core) in others().enumerate() {
        boot_entry::processors::set_stack(place, core.apic_id(), core.context().stack_top());
    }
    let expected = u32::try_from(others().count()).unwrap_or(u32::MAX);
    if expected == 0 {
        return 0;
    }
    for core in others() {
        local_apic::send_init(core.apic_id());
    }
    wait(10_000_000, expected);
    for attempt_ns in [200_000, PATIENCE_NS] {
        for core in others() {
            local_apic::start_timer(clock::apic_ticks(LONGEST_JUMP_NS));
            local_apic::send_startup(core.apic_id(), page);
        }
        if wait(attempt_ns, expected) {
            break;
        }
    }
    ARRIVED.load(Ordering::Acquire)
}

/// Waits `ns`, or until `expected` cores have arrived, and reports the latter.
fn wait(ns: u64, expected: u32) -> bool {
    let end_ns = clock::now_ns().saturating_add(ns);
    let core = this_core::get();
    loop {
        agreement::compare(core);
        let all_here = ARRIVED.load(Ordering::Acquire) >= expected;
        if all_here || clock::now_ns() >= end_ns {
            local_apic::start_timer(0);
            return all_here;
        }
        if local_apic::timer_count() == 0 {
            local_apic::start_timer(clock::apic_ticks(LONGEST_JUMP_NS));
        }
        cpu::relax();
    }
}
