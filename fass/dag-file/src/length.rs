//! The length of a set's run, and the resulting jobs.

use sched_dag::DagSpec;

use crate::file::Set;

/// How long a set runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Length {
    /// Each DAG releases this number of jobs.
    Jobs(u64),
    /// Each DAG releases the jobs of this time in nanoseconds, at least one.
    Span(u64),
    /// So many times the longest period of the set. So no DAG ends while the others still suffer
    /// its load.
    Periods(u64),
}

impl Length {
    /// Returns the same length, resolved for the DAGs of a set.
    pub fn of(self, set: &Set) -> Self {
        let Self::Periods(count) = self else {
            return self;
        };
        let periods = set.dags.iter().filter_map(|dag| dag.spec.period_ns);
        Self::Span(periods.max().unwrap_or(0).saturating_mul(count))
    }

    /// Returns a DAG's number of jobs: the number in its spec, if there is one.
    pub fn jobs(self, spec: &DagSpec) -> u64 {
        match (spec.jobs, self) {
            (Some(jobs), _) | (None, Self::Jobs(jobs) | Self::Periods(jobs)) => jobs,
            (None, Self::Span(span_ns)) => {
                let period_ns = spec.period_ns.unwrap_or(0).max(1);
                let after_offset_ns = span_ns.saturating_sub(spec.offset_ns);
                after_offset_ns.div_ceil(period_ns).max(1)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Length;
    use crate::parse::parse;

    #[test]
    fn a_span_gives_each_dag_its_jobs() {
        let text = "dag fork period 20ms\nsubtask a wcet 1ms\n\
                    dag pair period 10ms offset 5ms\nsubtask b wcet 1ms\nend";
        let file = parse(text).unwrap();
        let of = |ns, dag: usize| Length::Span(ns).jobs(&file.sets[0].dags[dag].spec);
        assert_eq!((of(100_000_000, 0), of(100_000_000, 1)), (5, 10));
        assert_eq!((of(0, 0), of(15_000_001, 1)), (1, 2));
        // No DAG ends before the slowest one.
        let set = &file.sets[0];
        let jobs = [0, 1].map(|dag| Length::Periods(3).of(set).jobs(&set.dags[dag].spec));
        assert_eq!(jobs, [3, 6]);
    }
}
