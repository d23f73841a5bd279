//! Pages and faults held to their word, and the baseline to its reference, without a guest.

mod commit_faults;
mod divided;
mod documentation;
mod published_schedules;
mod workload;
