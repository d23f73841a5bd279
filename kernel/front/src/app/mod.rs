//! The machine as an app sees it, how its runs are judged and how it ends, and the words by which
//! it lets people take part.

pub mod bound_verdict;
pub mod division;
pub mod ending;
pub mod fault_verdict;
pub mod machine;
pub mod offered;
mod services;
pub mod terms;
mod wcet_notes;
