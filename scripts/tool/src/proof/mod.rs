//! What a run has proven, and what it was observed to take.
//!
//! A record tells everything that bounds follow from: the graphs with WCETs and priorities, the
//! policy, the cores, what each instance was charged, and the bounds. From that the host asks the
//! same analysis. What the guest has not room for, such as a witness, or where a bound comes
//! from ([`report`]), the host so has too; where the two disagree about a bound, that is an
//! error.
//!
//! It also tells what the runs took and what the platform itself costs
//! ([`observed`]). The longest calls, and a margin, are WCETs
//! that a later commit can take; the longest responses stand next to the bounds
//! ([`report`]).

pub mod observed;
pub mod report;

#[cfg(test)]
mod tests;
