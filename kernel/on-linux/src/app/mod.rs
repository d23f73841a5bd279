//! What an app sees: the machine, how it may end, and what its instances may share and wait for
//! outside their DAGs. How a run is judged is the kernel's own.

#[path = "../../../src/app/bound_verdict.rs"]
pub(crate) mod bound_verdict;
mod clusters;
#[path = "../../../src/app/division.rs"]
mod division;
#[path = "../../../src/app/ending.rs"]
pub(crate) mod ending;
pub(crate) mod ends;
pub(crate) mod event;
#[path = "../../../src/app/fault_verdict.rs"]
pub(crate) mod fault_verdict;
pub(crate) mod lock;
pub(crate) mod machine_handle;
#[path = "../../../src/watch/background/offered.rs"]
mod offered;
mod overheads;
mod parameters;
#[path = "../../../src/start/terms.rs"]
pub(crate) mod terms;
#[path = "../../../src/app/wcet_notes.rs"]
mod wcet_notes;
mod wires;
pub(crate) mod words;
