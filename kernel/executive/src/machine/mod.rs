//! The machine layer: everything that is particular to x86_64 and a PC.
//!
//! With `memory` and the `entry!` macro it is the only part of the kernel that
//! contains `unsafe`. It names nothing above it: its users pass it the
//! functions that it is to call. Each module states the invariant that its
//! SAFETY comments cite.

pub mod abandoned;
mod accusation;
pub mod agreement;
pub mod avx;
pub mod backtrace;
pub mod calibration;
pub mod clock;
pub mod context;
pub mod counted_time;
pub mod cpu;
pub mod date;
pub(crate) mod debug_port;
pub(crate) mod descriptors;
pub mod fault;
pub mod interrupt;
pub mod interrupt_flag;
pub mod interrupts_off;
pub mod legacy;
pub mod local_apic;
mod machine_check;
pub mod non_maskable;
pub mod paging;
pub mod paint;
pub(crate) mod port;
pub mod power;
pub mod processors;
pub mod screen;
pub mod section;
pub mod serial;
pub mod spinlock;
pub mod this_core;
pub mod timer;
pub mod turns;
pub mod vector;
mod wake;
