//! The processors: starts the other cores, and reads each core's kind and siblings.
//!
//! *Siblings* are processors sharing one physical core (SMT): each slows down the other. Their APIC
//! ids differ in their lowest bits only. *Efficiency cores* are slower than the others of the same
//! machine. Nothing here schedules by these properties; the kernel reports them, and people choose.

use core::arch::x86_64::{__cpuid, __cpuid_count, CpuidResult};
use core::sync::atomic::{AtomicU32, Ordering};

use super::this_core::{self, Core};
use super::{agreement, avx, clock, cpu, interrupt, local_apic, machine_check};

/// The number of cores arrived in their entry function, not counting the boot processor.
static ARRIVED: AtomicU32 = AtomicU32::new(0);

/// While processors start, QEMU's counted time may jump to the end of the next timer, however far
/// away: a timer of ours keeps the jumps this short, in nanoseconds.
const LONGEST_JUMP_NS: u64 = 2_000;

/// Makes the calling processor the core with APIC id `apic_id`: segments, interrupt stacks,
/// interrupt table and local APIC.
pub fn become_core(apic_id: u32) -> &'static Core {
    let core = this_core::load(apic_id);
    let is_efficient = is_efficiency_core();
    core.is_efficient.store(is_efficient, Ordering::Relaxed);
    // Before the table: its handlers may save by `xsaveopt64`, which needs AVX enabled.
    avx::enable();
    interrupt::load_table();
    machine_check::enable();
    local_apic::enable();
    core
}

/// Reports the arrival of the calling core, `core`, after comparing its counter.
pub fn arrive(core: &Core) {
    agreement::compare_often(core);
    ARRIVED.fetch_add(1, Ordering::Release);
}

/// How long cores may take to arrive, in nanoseconds. The boot processor waits for all, so this
/// costs only if a core does not come; a busy host may let a virtual core wait for long.
pub const PATIENCE_NS: u64 = 5_000_000_000;

/// Starts all other cores at `entry`, through page number `page`, and returns the number of arrived
/// cores (Intel SDM volume 3, 9.4.4: INIT, 10 ms, startup, 200 us, startup).
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
        // To all before the wait: so its 10 ms pass once.
        local_apic::send_init(core.apic_id());
    }
    wait(10_000_000, expected);
    // A processor that has begun ignores the second startup interrupt.
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

/// Waits `ns` nanoseconds, or until `expected` cores have arrived, and reports the latter.
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

/// Returns how many of an APIC id's lowest bits distinguish siblings.
pub fn sibling_bits() -> u32 {
    const TOPOLOGY: u32 = 0xb;
    const AMD_TOPOLOGY: u32 = 0x8000_001e;
    const CACHES: u32 = 4;
    let has = |leaf| __cpuid(leaf & 0x8000_0000).eax >= leaf;
    let read = |leaf| has(leaf).then(|| __cpuid_count(leaf, 0));
    bits_of_topology(read(TOPOLOGY))
        .or_else(|| bits_of_amd(__cpuid(0x8000_0001), read(AMD_TOPOLOGY)))
        .or_else(|| bits_of_caches(__cpuid(1), read(CACHES)))
        .unwrap_or(0)
}

/// Reads CPUID leaf 0xb (Intel's SDM volume 2): the level of the first subleaf, if there is one.
fn bits_of_topology(leaf: Option<CpuidResult>) -> Option<u32> {
    const SIBLINGS: u32 = 1;
    let leaf = leaf.filter(|leaf| leaf.ebx != 0 && leaf.ecx >> 8 & 0xff == SIBLINGS)?;
    Some(leaf.eax & 0x1f)
}

/// Reads the topology leaf (AMD's manual volume 3, E.4.17), if leaf 0x8000_0001 announces the leaf.
fn bits_of_amd(features: CpuidResult, leaf: Option<CpuidResult>) -> Option<u32> {
    const HAS_TOPOLOGY: u32 = 1 << 22;
    let leaf = leaf.filter(|_| features.ecx & HAS_TOPOLOGY != 0)?;
    Some(bits_for((leaf.ebx >> 8 & 0xff) + 1))
}

/// Computes the bits for processors of a package (leaf 1), less the bits for cores (leaf 4), by
/// Intel's SDM volume 3, 9.9.3.
fn bits_of_caches(features: CpuidResult, leaf: Option<CpuidResult>) -> Option<u32> {
    const HAS_SEVERAL: u32 = 1 << 28;
    const A_CACHE: u32 = 0x1f;
    let leaf = leaf.filter(|leaf| features.edx & HAS_SEVERAL != 0 && leaf.eax & A_CACHE != 0)?;
    let (processors, cores) = (features.ebx >> 16 & 0xff, (leaf.eax >> 26) + 1);
    Some(bits_for(processors).saturating_sub(bits_for(cores)))
}

/// Returns the number of bits for distinguishing `count` things.
const fn bits_for(count: u32) -> u32 {
    count.next_power_of_two().trailing_zeros()
}

/// Reports whether the calling processor is an efficiency core (Intel's SDM volume 2, leaves 7 and
/// 0x1a).
fn is_efficiency_core() -> bool {
    const FEATURES: u32 = 7;
    const HYBRID: u32 = 1 << 15;
    const KIND: u32 = 0x1a;
    const ATOM: u32 = 0x20;
    __cpuid(0).eax >= KIND
        && __cpuid_count(FEATURES, 0).edx & HYBRID != 0
        && __cpuid_count(KIND, 0).eax >> 24 == ATOM
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leaf(eax: u32, ebx: u32, ecx: u32, edx: u32) -> CpuidResult {
        CpuidResult { eax, ebx, ecx, edx }
    }

    #[test]
    fn siblings_are_told_apart_by_the_bits_that_each_maker_states() {
        assert_eq!(bits_of_topology(Some(leaf(1, 2, 0x100, 0))), Some(1));
        assert_eq!(bits_of_topology(Some(leaf(0, 1, 0x100, 0))), Some(0));
        assert_eq!(bits_of_topology(Some(leaf(4, 8, 0x200, 0))), None, "cores");
        assert_eq!(bits_of_topology(Some(leaf(0, 0, 0, 0))), None, "no level");
        assert_eq!(bits_of_topology(None), None);

        let (with, without) = (leaf(0, 0, 1 << 22, 0), leaf(0, 0, 0, 0));
        assert_eq!(bits_of_amd(with, Some(leaf(0, 0x100, 0, 0))), Some(1));
        assert_eq!(bits_of_amd(with, Some(leaf(0, 0, 0, 0))), Some(0));
        assert_eq!(bits_of_amd(without, Some(leaf(0, 0x100, 0, 0))), None);

        let of = |processors: u32, cores: u32| {
            let features = leaf(0, processors << 16, 0, 1 << 28);
            bits_of_caches(features, Some(leaf((cores - 1) << 26 | 1, 0, 0, 0)))
        };
        assert_eq!(of(8, 4), Some(1));
        assert_eq!(of(4, 4), Some(0));
        assert_eq!(of(16, 6), Some(1), "ids for eight cores");
        assert_eq!(bits_of_caches(leaf(0, 2 << 16, 0, 0), None), None);
    }
}
