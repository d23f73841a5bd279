//! What looks in on a run, and speaks when it cannot go on.
//!
//! `background` is what core 0 does for people meanwhile: progress, status, the console, and
//! instances that keep the others waiting. `panic` ends a kernel that is broken. Nothing
//! here may be needed for a job to end: `run` goes on without it, and does not name it.

pub(crate) mod background;
pub(crate) mod panic;
