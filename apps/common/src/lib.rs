//! What several apps need and none of them owns.
//!
//! - [`random`]: numbers that are the same for a seed, everywhere;
//! - [`each_arity`]: one row for each number of values that a join can have.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

mod arity;
pub mod random;
