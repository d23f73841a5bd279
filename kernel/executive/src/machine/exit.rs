//! The end of the run: telling QEMU, or another host.

use front::app::ending::Told;

use super::{cpu, non_maskable, port, power, serial, this_core};

/// Ends the run, and says how: QEMU exits with 33, 35 or 37. Without the debug exit device the machine ends as was settled
/// ([`power::set_end`]), or stays halted: all its cores are, or one would look into why
/// this one is silent.
pub fn exit(told: Told) -> ! {
    const DEBUG_EXIT: u16 = 0xf4;
    // QEMU's own exit status is twice what its device takes, plus 1.
    let status: u32 = match told {
        Told::Success => 0x10,
        Told::Failure => 0x11,
        Told::Usage => 0x12,
    };
    // SAFETY: the port belongs to QEMU's isa-debug-exit device or to nobody.
    unsafe { port::write_u32(DEBUG_EXIT, status) };
    if this_core::is_ready() {
        non_maskable::stop_others();
    }
    serial::FIRST.drain();
    power::end();
    cpu::halt_forever()
}
