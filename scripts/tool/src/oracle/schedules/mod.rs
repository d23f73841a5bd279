//! Reference schedules: what runs when, to the unit.
//!
//! A case is a set of DAGs with the execution time of every instance, and the
//! schedule that two independent implementations agree on (`replay::Case` has the
//! format). [`check`] replays the DAGs through the real scheduler in virtual
//! time, and compares each start, finish and number of preemptions, and of each
//! job release, finish, response time and miss.

mod replay;

pub use ::replay::{Case, parse};
pub use replay::check;
