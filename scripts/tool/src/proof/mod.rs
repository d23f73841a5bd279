//! What a run has proven, and what it was observed to take.
//!
//! A guest that is booted with `graph=dump` tells everything that its bounds follow from:
//! the graphs with WCETs and priorities, the policy, the cores, what each instance was
//! charged, and the bounds. From that [`commits`] makes the model again, and asks the same
//! analysis. What the guest has not room for, such as a [`witness`] or where a bound comes
//! from ([`slack`]), the host so has too; where the two disagree about a bound, that is an
//! error.
//!
//! With `times=dump` it also tells what its runs took ([`observed`]). The longest calls,
//! and a margin, are WCETs that a later commit can take ([`wcets`]); the longest responses
//! stand next to the bounds ([`report`]). What the platform itself costs is measured in the
//! trace of such a run ([`overheads`]).

pub mod commits;
pub mod observed;
pub mod overheads;
pub mod report;
pub mod slack;
#[cfg(test)]
mod tests;
pub mod wcets;
pub mod witness;
