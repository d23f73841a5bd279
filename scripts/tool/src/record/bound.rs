//! The longest time for which an instance may wait for a core that the rules owe it.
//!
//! A decision takes effect only after an interrupt, and where a run's time is real, the host may do
//! something else meanwhile. In mode `deterministic` that cannot happen, so such a log is judged
//! more strictly: its first line has the mode.

use super::Run;
use crate::options::Parsed;
use crate::protocol::MachineLine;
use crate::qemu::Mode;

/// In counted time: covers time slices and the kernel's steps, which grow with the number of
/// simultaneous events.
pub const COUNTED_NS: u64 = 50_000;

/// Where time is real.
pub const REAL_NS: u64 = 1_000_000;

/// On Linux by SCHED_FIFO, where interrupts and a hypervisor take time, too.
pub const FIFO_NS: u64 = 5_000_000;

/// On Linux by `sched_ext`, where all real-time programs take precedence, too.
pub const SCHED_EXT_NS: u64 = 10_000_000;

/// On Linux by ordinary threads, which every program delays.
pub const NORMAL_NS: u64 = 100_000_000;

/// Returns the bound that a person has chosen, or else the usual one of the run.
pub fn tolerance_ns(run: &Run, options: &Parsed) -> u64 {
    let chosen = options.number("bound-us");
    chosen.map_or(run.usual_bound_ns, |bound_us| bound_us.saturating_mul(1000))
}

/// Returns the usual bound of a boot's runs from its line of kind `boot`: the tool passes each
/// guest its mode, and a program on Linux says whether it can preempt, and by which mechanism.
pub(crate) fn usual_ns(boot: &MachineLine) -> u64 {
    let words = boot.text_at("command_line").unwrap_or_default();
    let word = |name: &str| words.split(' ').find_map(|word| word.strip_prefix(name));
    match word("mode=").and_then(Mode::from_name) {
        Some(Mode::Deterministic) => COUNTED_NS,
        _ if boot.text_at("clock") != Some("linux") => REAL_NS,
        // Without preemption an instance waits for others' whole executions.
        _ if !boot.text.contains("\"preemptive\":true") => NORMAL_NS,
        _ if word("mechanism=") == Some("sched_ext") => SCHED_EXT_NS,
        _ => FIFO_NS,
    }
}
