//! Services of the kernel for an app: for its machine, and for state shared between instances, or
//! waited for, outside their DAGs.
//!
//! The front defines the machine as seen by an app. The app is not trusted: all its statements are
//! verified before they reach the executive's module `run`. Text, reports and figures for an app
//! are made below, in `report` and `text`.

pub(crate) mod bare_machine;
mod calibration;
pub(crate) mod event;
