//! What a run's commits have proven, taken from what the guest says of them.
//!
//! A guest that is booted with `graph=dump` tells everything that its bounds follow from:
//! the graphs with WCETs and priorities, the policy, the cores, what each instance was
//! charged, and the bounds. From that [`commits`] makes the model again, and asks the same
//! analysis. What the guest has not room for, such as a [`witness`], the host so has too;
//! where the two disagree about a bound, nothing is written.

pub mod commits;
pub mod witness;
