//! The second form of the multi-path bound, without its excess of 1.
//!
//! A job unfinished at `r` waits for some `X > x = r - length` with `g(X) >= 0`, where
//!
//! `g(X) = B_j + blocking + sum of f_i(X) - (m - j) X`,
//!
//! each `f_i` clipped to `X` in the window `r` (`multi_path`). The published form demands
//! `g(x) <= 0` with `max(1, B_j)`, since `g` may be 0 from 0 to `X` if the sum consists of the
//! `f_i` alone. But `g` is concave and `g(0) = 0`, so `g` is below 0 on all of `(x, infinity)`
//! exactly if
//!
//! `g(x) <= 0`, and to the right of `x` all `f_i` together grow by less than `m - j`.
//!
//! This condition is the bound wherever the sum consists of the `f_i` alone; elsewhere both forms
//! are the same. `X` may be any real number, and nothing is rounded, so runs may change at any
//! fraction of a nanosecond. The forms for whole units that demand `g(x + 1) < 0` instead are then
//! false.
//!
//! Trap: the slope is the slope of `f_i` in `X`, in a fixed window. In `r` the workloads grow by
//! more, or by less at the end of a [`WorkloadSegment`](super::super::workload::WorkloadSegment).
//!
//! Assumes: as `multi_path`. Costs of the platform are not covered: compared with them, 1 ns is no
//! matter.

use super::multiple_paths::write;
use super::{BoundTest, BoundWitness, JobBounds};
use crate::analysis::SchedulabilityTest;
use crate::analysis::case::AnalysisInput;
use crate::analysis::features::covers;
use crate::analysis::interference::InterferenceBound;

pub(super) const TEST: BoundTest = BoundTest {
    names: &[SchedulabilityTest::SharpClip],
    covers: covers!(
        RANKED BY_DEADLINE ANY_ORDER ONE_CORE CORES PREEMPTION ALL_KEEP SOME_KEEP SINK_DEADLINES
        INTERLEAVED WAITS LATE_DEADLINES FEW_IN_FLIGHT SPORADIC
    ),
    jobs,
    ..BoundTest::NONE
};

pub(super) const WITNESS: BoundWitness = BoundWitness {
    job: |case, responses, dag, bound_ns, text| {
        write(case, responses, dag, (bound_ns, InterferenceBound::Sharp), text);
    },
    ..BoundWitness::NONE
};

/// Bounds the DAGs for which no published form is as good.
fn jobs(case: &AnalysisInput<'_>, found: &mut JobBounds) {
    let known = found.bounds.iter().map(|bound| Some((*bound)?.bound_ns));
    let known: alloc::vec::Vec<Option<u64>> = known.collect();
    let may_outrank = |other, dag| case.may_outrank(other, dag);
    let mut set = case.set.clone();
    set.clip = InterferenceBound::Sharp;
    let responses = set.solve(&known, &case.order, &may_outrank).responses;
    for dag in (0..known.len()).filter(|&dag| known[dag].is_none()) {
        let within = responses[dag].filter(|&ns| ns <= case.tasks[dag].period_ns());
        let Some(bound_ns) = within else {
            continue;
        };
        let Ok(delays) = set.delays_of_job(dag, bound_ns, &responses, &may_outrank) else {
            continue;
        };
        let published = case.set.equations(dag);
        let mut forms = published.forms(&delays, bound_ns);
        if forms.all(|form| published.lacks(&delays, bound_ns, &form).is_some()) {
            found.offer(dag, bound_ns, SchedulabilityTest::SharpClip);
        }
    }
}
