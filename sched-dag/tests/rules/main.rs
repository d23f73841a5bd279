//! Each rule by itself: of a commit, of a run that a test drives by hand, of clusters and modes, and
//! of the law. (Random walks against all of them are in `properties`.)

mod by_hand;
mod chains;
mod clusters;
mod faults;
mod journal;
mod large;
mod modes;
mod priorities;
#[allow(dead_code, reason = "`properties` uses all of it")]
#[path = "../properties/set.rs"]
mod set;
mod states;
#[path = "../support/mod.rs"]
mod support;
