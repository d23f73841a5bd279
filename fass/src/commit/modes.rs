//! What is wrong with modes: asked only where there are some, so that no other image has the code.

use alloc::vec::Vec;

use super::fault::Fault;
use super::tie::drafts;
use crate::api::dag::Dag;

/// Adds what is wrong with the modes of a commit.
#[inline(never)]
pub(super) fn check(dags: &[Dag], faults: &mut Vec<Fault>) {
    if let Some(check) = dags.iter().find_map(|dag| dag.draft.borrow().check_modes) {
        check(&drafts(dags), &mut |fault| {
            faults.push(Fault::Worded(fault))
        });
    }
}
