//! The end of the run: telling QEMU, or another host.

use super::{cpu, non_maskable, port, power, serial, this_core};

/// How a run ended, as the value that QEMU's debug exit device takes. QEMU's
/// own exit status is twice that plus 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// All is well (QEMU exits with 33).
    Success = 0x10,
    /// Something failed (35).
    Failure = 0x11,
    /// The command line was wrong (37).
    Usage = 0x12,
}

/// Ends the run. Without the debug exit device the machine ends as was settled
/// ([`power::set_end`]), or stays halted: all its cores are, or one would look into why
/// this one is silent.
pub fn exit(status: Status) -> ! {
    const DEBUG_EXIT: u16 = 0xf4;
    // SAFETY: the port belongs to QEMU's isa-debug-exit device or to nobody.
    unsafe { port::write_u32(DEBUG_EXIT, status as u32) };
    if this_core::is_ready() {
        non_maskable::stop_others();
    }
    serial::FIRST.drain();
    power::end();
    cpu::halt_forever()
}
