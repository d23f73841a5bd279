//! What an app sees: the machine, how it may end, and what its instances may share and wait for
//! outside their DAGs. How a run is judged is the front's.

mod clusters;
pub(crate) mod ends;
pub(crate) mod event;
pub(crate) mod lock;
pub(crate) mod machine_handle;
mod overheads;
mod parameters;
mod wires;
pub(crate) mod words;
