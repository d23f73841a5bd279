//! Services of the kernel for an app: for its machine, and for what its instances may share and
//! wait for outside their DAGs.
//!
//! The machine as an app sees it is the front's, and the app is not trusted: what it says is
//! verified before it goes on to `run`. Text, reports and figures that an app gets back are made
//! below, in `report` and `text`.

pub(crate) mod bare_machine;
mod calibration;
pub(crate) mod event;
