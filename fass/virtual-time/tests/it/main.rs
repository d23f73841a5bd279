//! The machine in virtual time: what runs on it, what it answers, records and replays.

mod answers;
mod chains;
mod devices;
mod faults;
mod latest;
mod lifecycle;
mod link;
mod locks;
mod machine;
mod parameters;
mod recordings;
mod replays;
mod support;
mod waits;
mod wires;
