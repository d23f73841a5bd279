//! The machine layer: all code specific to x86_64 and a PC.
//!
//! Besides `memory`, `devices` and the loans of `run`, only this layer of the executive contains
//! `unsafe`. The machine layer names nothing above itself: its users pass in the functions to call.
//! Each module states the invariant cited by its SAFETY comments.

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
pub mod time_slice;
pub mod timer;
pub mod vector;
mod wake;
