//! The end of the run: tells QEMU or another host; without a host, powers off, resets, or just
//! halts.

use core::sync::atomic::{AtomicU8, Ordering};

use boot::power::{Off, Power, Register};
use fass::platform::SetOnce;
use front::app::ending::AppExit;

use super::{cpu, non_maskable, port, serial, this_core};

/// The action after the verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PowerAction {
    /// Stay on, with all cores halted.
    Halt = 0,
    /// Power the machine off.
    Off = 1,
    /// Start the machine anew.
    Reset = 2,
}

static END: AtomicU8 = AtomicU8::new(PowerAction::Halt as u8);
static POWER: SetOnce<Power> = SetOnce::new();

/// Chooses the action after the verdict.
pub fn set_end(end: PowerAction) {
    END.store(end as u8, Ordering::Release);
}

/// Sets the registers for that action.
///
/// # Safety
///
/// They are those of the machine's ACPI tables; registers in memory are mapped uncached and
/// writable at their addresses.
pub unsafe fn set_registers(power: Power) {
    // The tables are read once.
    POWER.set(power);
}

/// Does the chosen action. Returns if the action is to halt, or has failed.
fn reset_or_power_off() {
    let end = END.load(Ordering::Acquire);
    let power = POWER.get().copied().unwrap_or_default();
    if end == PowerAction::Off as u8
        && let Some(off) = power.off
    {
        power_off(off);
    }
    if end == PowerAction::Reset as u8 {
        reset(power);
    }
}

fn power_off(off: Off) {
    const TYPE_BIT: u32 = 10;
    const SLEEP: u16 = 1 << 13;
    /// The bit of the first control register that says the operating system controls power.
    const ENABLED: u16 = 1;
    /// Each poll takes a microsecond; firmware takes far less than a second.
    const MOST_POLLS: u32 = 1_000_000;
    match off {
        Off::Sleep(register, kind) => write(register, kind << 2 | 1 << 5),
        Off::Control { registers, enable } => {
            let [first, _] = registers;
            if let (Some((command, value)), Some((control, _))) = (enable, first)
                && read_control(control) & ENABLED == 0
            {
                write(Register::Port(command), value);
                let enabled = |_: &u32| read_control(control) & ENABLED != 0;
                let _ = (0..MOST_POLLS).find(enabled);
            }
            for (control, kind) in registers.into_iter().flatten() {
                let kept = read_control(control) & !(0b111 << TYPE_BIT | SLEEP);
                write_control(control, kept | u16::from(kind) << TYPE_BIT | SLEEP);
            }
        }
    }
}

/// Resets the machine as ACPI says, or else in the way of older PCs.
fn reset(power: Power) {
    if let Some((register, value)) = power.reset {
        write(register, value);
    }
    // The chip set's register: a full reset, begun by setting the second bit.
    write(Register::Port(0xcf9), 0x02);
    write(Register::Port(0xcf9), 0x06);
    // The keyboard controller's line to the processor.
    write(Register::Port(0x64), 0xfe);
}

fn write(register: Register, value: u8) {
    match register {
        // SAFETY: the register ends the machine, by the tables or by what PCs agree on, and
        // all that this kernel guarantees ends with it.
        Register::Port(port) => unsafe { port::write_u8(port, value) },
        // SAFETY: as above; it is mapped (`set_registers`).
        Register::Memory(address) => unsafe { (address as *mut u8).write_volatile(value) },
    }
}

fn read_control(control: u16) -> u16 {
    // SAFETY: by the tables the port is a power management control register, and reading
    // it changes nothing.
    unsafe { port::read_u16(control) }
}

fn write_control(control: u16, value: u16) {
    // SAFETY: as in `write`.
    unsafe { port::write_u16(control, value) };
}

/// Ends the run, and reports the result: QEMU exits with 33, 35 or 37. Without the debug exit
/// device the machine ends by the chosen action ([`set_end`]), or stays halted: all cores halt,
/// because a running core would investigate the silence of a halted core.
pub fn exit(told: AppExit) -> ! {
    const DEBUG_EXIT: u16 = 0xf4;
    // QEMU's own exit status is twice what its device takes, plus 1.
    let status: u32 = match told {
        AppExit::Success => 0x10,
        AppExit::Failure => 0x11,
        AppExit::Usage => 0x12,
    };
    // SAFETY: the port belongs to QEMU's isa-debug-exit device or to nobody.
    unsafe { port::write_u32(DEBUG_EXIT, status) };
    if this_core::is_ready() {
        non_maskable::stop_others();
    }
    // Power off or reset would lose the bytes still in the port's FIFO.
    serial::FIRST.drain();
    reset_or_power_off();
    cpu::halt_forever()
}
