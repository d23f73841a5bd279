//! The schedulability tests of a commit. Each test is one file, stating the scope of its proof, and
//! a name in the table below.
//!
//! The tests run in the order of the table, each for the DAGs covered by its proof (see
//! [`features`](super::features)). Only this module calls the tests, for jobs, for sinks and for
//! witnesses, and a test's computations are private to its file, so there is no other way to its
//! answer. Of several bounds the smallest counts.

use alloc::vec;
use alloc::vec::Vec;

use super::case::AnalysisInput;
use super::features::Features;
use super::witness_text::WitnessText;
use super::{DagBound, NotProvenReason, SchedulabilityTest};

/// The known bounds of jobs, by DAG.
pub(super) type Responses<'a> = &'a [Option<u64>];

/// A test of schedulability.
struct BoundTest {
    /// The names of its bounds, one for each form; a test for sinks alone has none.
    names: &'static [SchedulabilityTest],
    /// The features covered by its proof.
    covers: Features,
    /// Bounds jobs.
    jobs: fn(&AnalysisInput<'_>, &mut JobBounds),
    /// Bounds sinks, where the bounds of jobs are known.
    sinks: fn(&AnalysisInput<'_>, Responses<'_>, &mut SinkBounds),
}

impl BoundTest {
    /// A test that covers nothing and answers nothing.
    const NONE: Self = Self {
        names: &[],
        covers: Features::NONE,
        jobs: |_, _| (),
        sinks: |_, _, _| (),
    };

    /// Reports whether the test covers all features entering a DAG.
    fn is_for(&self, case: &AnalysisInput<'_>, dag: usize) -> bool {
        self.covers.cover(case.entering[dag])
    }

    /// Records for each DAG whether the test covers it, and reports whether any DAG is covered.
    fn ask(&self, case: &AnalysisInput<'_>, asked: &mut Vec<bool>) -> bool {
        asked.clear();
        asked.extend((0..case.members.len()).map(|dag| self.is_for(case, dag)));
        asked.contains(&true)
    }
}

/// The part of a test that writes its terms. It is separate, so a program that writes no witness
/// need not contain it.
struct BoundWitness {
    /// Writes the lines needed once before all bounds.
    certificate: fn(&AnalysisInput<'_>, &[Option<DagBound>], &mut WitnessText),
    /// Writes the terms of a DAG's bound.
    job: fn(&AnalysisInput<'_>, Responses<'_>, usize, u64, &mut WitnessText),
    /// Writes the terms of those sinks of a DAG whose bounds are below their job's.
    sinks: fn(&AnalysisInput<'_>, Responses<'_>, usize, u64, &mut WitnessText),
}

impl BoundWitness {
    /// Writes nothing.
    const NONE: Self = Self {
        certificate: |_, _, _| (),
        job: |_, _, _, _, _| (),
        sinks: |_, _, _, _, _| (),
    };
}

/// Makes the tables of tests.
macro_rules! tests {
    ($($module:ident)+) => {
        $(mod $module;)+

        static TESTS: &[BoundTest] = &[$($module::TEST),+];

        static WITNESSES: &[BoundWitness] = &[$($module::WITNESS),+];
    };
}

// A test comes after the tests on whose bounds it rests. `multiple_paths` bounds only DAGs without
// a bound, so no earlier test may give a longer bound than `multiple_paths`, except for `windows`.
tests!(
    one_core windows priorities tables members widths sharp_clip multiple_paths demand graph sink_paths
);

/// The bounds of jobs found by the tests so far.
pub(super) struct JobBounds {
    pub(super) bounds: Vec<Option<DagBound>>,
    /// Why a bound is missing.
    pub(super) reasons: Vec<Option<NotProvenReason>>,
    /// The first DAG that has no bound for a reason of its own.
    pub(super) first_failing: Option<usize>,
    /// By DAG, whether the current test covers it.
    asked: Vec<bool>,
}

impl JobBounds {
    /// Takes a bound if the current test covers the DAG and no bound as small is known.
    fn offer(&mut self, dag: usize, bound_ns: u64, test: SchedulabilityTest) {
        let is_less = self.bounds[dag].is_none_or(|known| bound_ns < known.bound_ns);
        if self.asked[dag] && is_less {
            self.bounds[dag] = Some(DagBound { bound_ns, test });
        }
    }
}

/// The bounds of sinks, by DAG and the sink's position among the DAG's sinks.
pub(super) struct SinkBounds {
    bounds_ns: Vec<Vec<Option<u64>>>,
    asked: Vec<bool>,
}

impl SinkBounds {
    /// Takes bounds of a DAG's sinks if the current test covers the DAG.
    fn offer(&mut self, dag: usize, found_ns: impl Iterator<Item = Option<u64>>) {
        if self.asked[dag] {
            for (known, found) in self.bounds_ns[dag].iter_mut().zip(found_ns) {
                *known = [*known, found].into_iter().flatten().min();
            }
        }
    }
}

/// Returns the bounds of the jobs of a case.
pub(super) fn bound_jobs(case: &AnalysisInput<'_>) -> JobBounds {
    let count = case.members.len();
    let mut found = JobBounds {
        bounds: vec![None; count],
        reasons: vec![None; count],
        first_failing: None,
        asked: Vec::new(),
    };
    for test in TESTS {
        if test.ask(case, &mut found.asked) {
            (test.jobs)(case, &mut found);
        }
    }
    for &dag in &case.order {
        if found.bounds[dag].is_some() {
            found.reasons[dag] = None;
            continue;
        }
        let other = match case.entering[dag].cover(Features::TABLE) {
            true => NotProvenReason::BesideTable,
            false => NotProvenReason::NoBound,
        };
        found.reasons[dag].get_or_insert(other);
        found.first_failing.get_or_insert(dag);
    }
    found
}

/// Reports whether the test of graphs covers all DAGs of a case.
pub(super) fn is_graph_asked(case: &AnalysisInput<'_>) -> bool {
    (0..case.members.len()).all(|dag| graph::TEST.is_for(case, dag))
}

/// Returns each DAG's bounds by each test. Each test knows the smallest bounds of the other DAGs
/// found by earlier tests.
pub(super) fn bound_by_each(case: &AnalysisInput<'_>) -> Vec<Vec<DagBound>> {
    let count = case.members.len();
    let (mut by_test, mut best) = (vec![Vec::new(); count], vec![None; count]);
    for test in TESTS {
        let mut found = JobBounds {
            bounds: best.clone(),
            reasons: vec![None; count],
            first_failing: None,
            asked: Vec::new(),
        };
        for (dag, bounds) in by_test.iter_mut().enumerate() {
            if test.ask(case, &mut found.asked) && found.asked[dag] {
                found.bounds.clone_from(&best);
                found.bounds[dag] = None;
                (test.jobs)(case, &mut found);
                bounds.extend(found.bounds[dag]);
            }
        }
        for (best, bounds) in best.iter_mut().zip(&by_test) {
            *best = bounds.iter().copied().min_by_key(|bound| bound.bound_ns);
        }
    }
    by_test
}

/// Returns the bounds of the sinks of a case, by DAG and the sink's position among the DAG's sinks.
pub(super) fn bound_sinks(
    case: &AnalysisInput<'_>,
    responses: Responses<'_>,
) -> Vec<Vec<Option<u64>>> {
    let unknown = (0..case.members.len()).map(|dag| vec![None; case.dag(dag).sinks().len()]);
    let mut found = SinkBounds {
        bounds_ns: unknown.collect(),
        asked: Vec::new(),
    };
    for test in TESTS {
        if test.ask(case, &mut found.asked) {
            (test.sinks)(case, responses, &mut found);
        }
    }
    found.bounds_ns
}

/// Writes the lines needed once before all bounds.
pub(super) fn write_certificates(
    case: &AnalysisInput<'_>,
    bounds: &[Option<DagBound>],
    text: &mut WitnessText,
) {
    for (test, of) in TESTS.iter().zip(WITNESSES) {
        if (0..case.members.len()).any(|dag| test.is_for(case, dag)) {
            (of.certificate)(case, bounds, text);
        }
    }
}

/// Writes the terms of a DAG's bound, and of its sinks' bounds.
pub(super) fn write_terms(
    case: &AnalysisInput<'_>,
    responses: Responses<'_>,
    dag: usize,
    bound: DagBound,
    text: &mut WitnessText,
) {
    let all = || TESTS.iter().zip(WITNESSES);
    let asked = || all().filter(|(test, _)| test.is_for(case, dag));
    for (_, of) in asked().filter(|(test, _)| test.names.contains(&bound.test)) {
        (of.job)(case, responses, dag, bound.bound_ns, text);
    }
    for (_, of) in asked() {
        (of.sinks)(case, responses, dag, bound.bound_ns, text);
    }
}
