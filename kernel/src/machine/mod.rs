//! The machine layer: everything that is particular to x86_64 and a PC.
//!
//! With `memory` and the `entry!` macro it is the only part of the kernel that
//! contains `unsafe`. It names nothing above it: its users pass it the
//! functions that it is to call. Each module states the invariant that its
//! SAFETY comments cite.

pub(crate) mod agreement;
pub(crate) mod calibration;
pub(crate) mod clock;
pub(crate) mod context;
pub(crate) mod counted_time;
pub(crate) mod cpu;
pub(crate) mod descriptors;
pub(crate) mod exit;
pub(crate) mod fault;
pub(crate) mod interrupt;
pub(crate) mod interrupt_flag;
pub(crate) mod interrupts_off;
pub(crate) mod io_apic;
pub(crate) mod known_clock;
pub(crate) mod legacy;
pub(crate) mod local_apic;
mod meter;
pub(crate) mod non_maskable;
pub(crate) mod once;
pub(crate) mod paging;
pub(crate) mod port;
pub(crate) mod power;
pub(crate) mod processors;
pub(crate) mod screen;
pub(crate) mod section;
pub(crate) mod serial;
pub(crate) mod spinlock;
pub(crate) mod this_core;
pub(crate) mod timer;
pub(crate) mod turns;
pub(crate) mod vector;
mod wake;
