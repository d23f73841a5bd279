//! The faults of modes, and of topics that are recorded: asked only where there are some, so
//! that no other image has the code.

use alloc::vec::Vec;

use super::fault::Fault;
use super::tie::drafts;
use crate::api::dag::Dag;
use crate::draft::Draft;
use crate::draft::modes::Check;

/// Adds what is wrong with the modes of a commit, and with what it records.
#[inline(never)]
pub(super) fn check(dags: &[Dag], faults: &mut Vec<Fault>) {
    let checks: [fn(&Draft) -> Option<Check>; 2] = [|of| of.check_modes, |of| of.check_recorded];
    for pick in checks {
        if let Some(check) = dags.iter().find_map(|dag| pick(&dag.draft.borrow())) {
            check(&drafts(dags), &mut |fault| {
                faults.push(Fault::Worded(fault));
            });
        }
    }
}
