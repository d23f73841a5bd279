//! Requests of one cluster to others: signals, pauses, modes, the end.
//!
//! They are [letters](sched_dag::lifecycle::Mailboxes): the other cluster's first core is woken,
//! which takes them in a step of its own. That takes no lock, so nobody waits.

use alloc::sync::Arc;
use core::sync::atomic::Ordering;

use fass::platform::Request;
use sched_dag::{ClusterId, lifecycle};

use super::cluster::{CoreSet, FIRST_SEAT, nth};

/// Those of a run; all clusters have the same ones. None where cores are not divided.
pub(super) type Letters = Option<Arc<lifecycle::Mailboxes>>;

/// Sends a request to the other clusters that it concerns, adds the cores that have to take it, and
/// reports whether it does not concern the cluster itself.
pub(super) fn send(
    letters: &Letters,
    from: ClusterId,
    request: Request,
    woken: &mut CoreSet,
) -> bool {
    letters.as_ref().is_some_and(|letters| {
        letters.send(Some(from), request, |cluster| {
            let there = nth(cluster.index());
            // What was left before is seen by the core that takes the letters.
            there.has_letters.store(true, Ordering::Release);
            woken.insert(there.core(FIRST_SEAT));
        })
    })
}
