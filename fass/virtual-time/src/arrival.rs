//! Something that comes from outside at an instant.

use fass::Wire;
use sched_dag::lifecycle::Request;

/// What comes from outside of the scheduler.
#[derive(Debug)]
pub(crate) enum Arrival {
    Request(Request),
    Bytes(Wire, Vec<u8>),
}
