//! Fork-join.
#![no_std]
