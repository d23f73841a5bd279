//! The machine as an app sees it, how its runs are judged and how it ends, and the words by which
//! it lets people take part.

pub mod ending;
pub mod endpoint;
pub mod machine;
mod ros;
pub mod terms;
