//! The scheduler, its analysis and its law from outside: each rule by itself, random walks against
//! all of them, and bounds against what is observed.

mod allocation;
mod analysis;
mod by_hand;
mod chains;
mod clusters;
mod counting;
mod faults;
mod journal;
mod large;
mod letters;
mod modes;
mod priorities;
mod properties;
mod states;
mod support;
