//! What an app sees of the kernel: the machine, how it may end, and what its instances may
//! share and wait for outside their DAGs.
//!
//! Everything here is offered to apps at the root of the crate, and the app is not trusted:
//! what it says is verified before it goes on to `run`. Text, reports and figures that an app
//! gets back are made below, in `report` and `text`.

mod calibration;
#[cfg(feature = "clusters")]
mod clusters;
pub(crate) mod event;
pub(crate) mod lock;
pub(crate) mod machine_handle;
mod overheads;
mod parameters;
pub(crate) mod resources;
mod topics;
mod wires;
