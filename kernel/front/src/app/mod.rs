//! The app's view of the machine, the verdicts on its runs and its ending, and the options by which
//! an app lets people take part.

pub mod ending;
pub mod endpoint;
pub mod machine;
mod ros;
pub mod terms;
