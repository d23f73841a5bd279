//! The executive: the kernel's lower half, which executes jobs on processors.
//!
//! An app names `kernel`, never this. The two are crates of their own because they are
//! compiled for different ends: what is here is on the way from a release to a completion,
//! or right below it, and is compiled for speed; what is above (bringing a machine up,
//! looking in on a run, telling of it afterwards) is compiled for size.
//!
//! # Rooms, from top to bottom
//!
//! `interrupts` is what a core's timer and wake-ups do, `run` executes what was committed.
//! `text` serves input and output; `memory` and `machine` (processor, interrupts, time) know
//! nothing of what is above. `docs/architecture.md` has the table that the tests hold this to.

#![cfg_attr(not(test), no_std)]
#![allow(
    rustdoc::private_intra_doc_links,
    reason = "its readers have its source; what apps use is documented in `kernel`, too"
)]

extern crate alloc;

#[allow(unsafe_code, reason = "registers, and memory that devices reach")]
pub mod devices;
pub mod interrupts;
#[allow(unsafe_code, reason = "registers, ports, interrupts, page tables")]
pub mod machine;
#[allow(unsafe_code, reason = "the allocator hands out raw memory")]
pub mod memory;
pub mod run;
pub mod text;

pub use text::console;
