//! Services of the kernel for an app: for its machine, and for state that instances may share and
//! wait for outside their DAGs.
//!
//! The front defines the machine as an app sees it. The app is not trusted: all that it states is
//! verified before it reaches `run`. Text, reports and figures for an app are made below, in
//! `report` and `text`.

pub(crate) mod bare_machine;
mod calibration;
pub(crate) mod event;
