//! Crimes: acts forbidden to every subtask, done on purpose. The machine must stop each.
//!
//! If a crime returned, the protection under test would be missing; the caller can tell by
//! [`Unpunished`].

use core::arch::asm;
use core::hint::black_box;
use core::time::Duration;

use fass::Occupation::{self, Hold as HOLD, Spin as SPIN};
use kernel::{Event, Lock};

/// The result of a crime without any consequence: its protection has failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unpunished;

/// An act that must end its subtask.
pub type Crime = fn() -> Unpunished;

/// Every crime, by name.
pub const CRIMES: [(&str, Crime); 19] = [
    ("panic", panic),
    ("panic_in_message", panic_twice),
    ("null_write", write_to_null),
    ("wild_read", read_wildly),
    ("non_canonical", read_non_canonical),
    ("write_to_code", write_to_code),
    ("write_to_constant", write_to_constant),
    ("execute_data", execute_data),
    ("division", divide_by_zero),
    ("undefined_instruction", execute_undefined),
    ("stack_overflow", overflow_the_stack),
    ("overflow_in_hold", || overflow_in(&|| execute(HOLD))),
    ("overflow_in_spin", || overflow_in(&|| execute(SPIN))),
    ("overflow_in_wait", || overflow_in(&wait)),
    ("overflow_in_lock", || overflow_in(&lock)),
    ("panic_in_section", panic_in_section),
    ("unstated_section", enter_unstated),
    ("endless_loop", loop_for_ever),
    ("endless_wait", wait_for_ever),
];

/// The crimes committed one after the other where faults come thick and fast.
pub const RECURRING: [Crime; 7] = [
    panic,
    write_to_null,
    read_non_canonical,
    divide_by_zero,
    execute_undefined,
    overflow_the_stack,
    wait_for_ever,
];

fn panic() -> Unpunished {
    panic!("a panic on purpose")
}

/// Panics with a message whose formatting panics, too.
fn panic_twice() -> Unpunished {
    struct Unspeakable;
    impl core::fmt::Display for Unspeakable {
        fn fmt(&self, _: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
            panic!("a panic within a panic")
        }
    }
    panic!("{Unspeakable}")
}

/// Writes to address 8, on the page that must be absent.
fn write_to_null() -> Unpunished {
    write(8)
}

/// Writes over a function's code, on a page that must not be writable.
fn write_to_code() -> Unpunished {
    write(write as fn(usize) -> Unpunished as usize)
}

/// Writes over a constant, on a page that must not be writable.
fn write_to_constant() -> Unpunished {
    static CONSTANT: u64 = 7;
    write(core::ptr::from_ref(black_box(&CONSTANT)) as usize)
}

fn write(address: usize) -> Unpunished {
    // SAFETY: none; the page table has to prevent it (see the module).
    unsafe { asm!("mov byte ptr [{}], 0x90", in(reg) address) };
    Unpunished
}

/// Reads an address at which nothing is mapped.
fn read_wildly() -> Unpunished {
    read(0x7fff_dead_b000)
}

/// Reads a non-canonical address: its upper bits do not repeat bit 47.
fn read_non_canonical() -> Unpunished {
    read(0x8000_0000_0000_0000)
}

fn read(address: usize) -> Unpunished {
    // SAFETY: none; the page table has to prevent it (see the module).
    unsafe { asm!("mov {0:l}, byte ptr [{0}]", inout(reg) address => _) };
    Unpunished
}

/// Calls a return instruction on the stack, on a page that must not execute.
fn execute_data() -> Unpunished {
    let code = black_box([0xc3u8; 16]);
    // SAFETY: none; the page table has to prevent it (see the module).
    unsafe { asm!("call {}", in(reg) code.as_ptr(), clobber_abi("C")) };
    Unpunished
}

/// Divides by zero in a machine instruction, because a division in Rust would panic.
fn divide_by_zero() -> Unpunished {
    // SAFETY: none; the processor has to refuse it (see the module).
    unsafe { asm!("div ecx", inout("eax") 1 => _, inout("edx") 0 => _, in("ecx") 0) };
    Unpunished
}

/// Executes an instruction defined as undefined.
fn execute_undefined() -> Unpunished {
    // SAFETY: none; the processor has to refuse it (see the module).
    unsafe { asm!("ud2") };
    Unpunished
}

/// Recurses until the stack's guard page is hit.
fn overflow_the_stack() -> Unpunished {
    black_box(sum_down(black_box(u64::MAX)));
    Unpunished
}

#[expect(unconditional_recursion, reason = "that is the crime")]
fn sum_down(number: u64) -> u64 {
    let frame = black_box([number; 64]);
    frame[0].wrapping_add(sum_down(number.wrapping_sub(1)))
}

/// Recurses, with a call into the kernel on each level: sooner or later the kernel's own frames hit
/// the guard page.
fn overflow_in(call: &dyn Fn()) -> Unpunished {
    descend(call, black_box(u64::MAX));
    Unpunished
}

#[expect(unconditional_recursion, reason = "that is the crime")]
fn descend(call: &dyn Fn(), levels: u64) {
    // Smaller than the kernel's frames, so an overflow happens in the kernel.
    let frame = black_box([levels; 2]);
    call();
    descend(call, levels.wrapping_sub(1));
    black_box(frame);
}

fn execute(how: Occupation) {
    fass::execute_for(Duration::from_micros(1), how);
}

fn wait() {
    static EVENT: Event = Event::new();
    EVENT.wait(EVENT.version(), fass::now_ns() + 1_000);
}

/// The locks stated by the middle subtask of the doomed DAG. A fault in a section loses the lock,
/// so each crime has a lock of its own.
pub static LOCKS: [Lock<u32>; 4] = [
    Lock::new("free", 0),
    Lock::new("shared", 0),
    Lock::new("taken twice", 0),
    Lock::new("held", 0),
];

fn lock() {
    LOCKS[0].with(|free| *free = free.wrapping_add(1));
}

/// Enters a section of a lock not stated by the calling subtask.
fn enter_unstated() -> Unpunished {
    static UNSTATED: Lock<u32> = Lock::new("unstated", 0);
    UNSTATED.with(|_| Unpunished)
}

/// Panics while holding a lock, and so loses the lock; or panics because the lock is already lost.
fn panic_in_section() -> Unpunished {
    LOCKS[1].with(|_| panic!("a panic in a section"))
}

/// Computes without end.
fn loop_for_ever() -> Unpunished {
    while black_box(true) {
        core::hint::spin_loop();
    }
    Unpunished
}

/// Never returns, and hardly computes.
fn wait_for_ever() -> Unpunished {
    fass::execute_for(Duration::MAX, HOLD);
    Unpunished
}
