//! What the boot tests run in the guest, as far as it needs no machine: the
//! same code is tested on the host, in virtual time.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

pub mod faults;
