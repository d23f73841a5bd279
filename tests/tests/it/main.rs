//! Pages and faults compared with the code, the baseline with its reference, and a client with its
//! router, without a guest.

mod commit_faults;
mod divided;
mod documentation;
mod published_schedules;
mod workload;
