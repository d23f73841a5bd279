//! A client of a Zenoh router, over UDP.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
