//! Pages and faults held to their word, the baseline to its reference, and a client to its router,
//! without a guest.

mod commit_faults;
mod divided;
mod documentation;
mod published_schedules;
mod workload;
