//! Random sets: what the analysis accepts, held against simulations.
//!
//! - `responses`: no response of an accepted set is above its bound, on a machine whose own
//!   work takes what is charged for it;
//! - `phasings`: how many small sets are accepted, of those that nothing refutes;
//! - `draw`, `machine`: the sets, and the machine in virtual time.

mod draw;
mod machine;
mod phasings;
mod responses;

pub(super) use phasings::command as phasings;
pub(super) use responses::command as responses;
