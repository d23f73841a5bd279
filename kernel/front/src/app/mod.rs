//! How an app's runs are judged and how it ends, and the words by which it lets people take part.

pub mod bound_verdict;
pub mod division;
pub mod ending;
pub mod fault_verdict;
pub mod offered;
pub mod terms;
pub mod wcet_notes;
