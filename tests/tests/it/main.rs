//! Pages and faults held to their word, without a guest.

mod commit_faults;
mod documentation;
mod platforms;
