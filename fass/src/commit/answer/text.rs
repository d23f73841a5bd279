//! What the commit answers, in words.

use core::fmt;
use core::time::Duration;

use sched_dag::analysis::{OverheadSource, Reason, TaskError};
use sched_dag::wcets::WcetSource;

use super::{Answer, Placement, Unproven, Verdict};
use crate::commit::count::Count;

/// So many subtasks without WCET are named, and the rest counted.
const MOST_NAMED: usize = 8;

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let dag = &self.dag;
        match &self.verdict {
            Verdict::Proven { bound, test } => {
                write!(f, "{dag} takes at most {bound:?}, by {test}")
            }
            Verdict::NotProven(unproven) => {
                write!(f, "{dag} is not proven to meet its deadlines: {unproven}")
            }
        }?;
        if let Some(placement) = &self.cluster {
            write!(f, "; it runs {placement}")?;
        }
        // What is observed is never called proven.
        let observed = self.wcets.iter().filter_map(|source| match source {
            WcetSource::Observed { margin_percent } => Some(margin_percent),
            _ => None,
        });
        if let Some(margin) = observed.clone().next() {
            let (count, all) = (observed.count(), self.wcets.len());
            write!(
                f,
                "; {count} of {all} WCETs are observed ones and {margin} %"
            )?;
        }
        match self.overheads {
            OverheadSource::Stated => Ok(()),
            OverheadSource::Measured {
                dispatches,
                margin_percent,
            } => write!(
                f,
                "; overheads are the longest of {dispatches} measured and {margin_percent} %"
            ),
        }
    }
}

impl fmt::Display for Placement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            cluster,
            cores,
            why,
        } = self;
        let (count, first) = (Count(cores.len(), "core"), cores.start);
        let cluster = cluster.0;
        write!(f, "in cluster {cluster}, on {count} from core {first} on")?;
        why.map_or(Ok(()), |why| write!(f, ": {why}"))
    }
}

impl fmt::Display for Unproven {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.reason, &self.subtasks[..], &self.other) {
            (Reason::Unknown(TaskError::MissingWcet { .. }), [first, others @ ..], _) => {
                write!(f, "no WCET above 0 is given for {first}")?;
                let (named, more) = others.split_at(others.len().min(MOST_NAMED - 1));
                named.iter().try_for_each(|other| write!(f, ", {other}"))?;
                if !more.is_empty() {
                    write!(f, " and {} more", more.len())?;
                }
                f.write_str("; give every subtask one to have the DAG analysed")
            }
            (Reason::SubtaskBeyondPeriod { .. }, [subtask, ..], _) => write!(
                f,
                "{subtask} alone takes more than a period; split it or lengthen the period"
            ),
            (Reason::PathBeyondDeadline { length_ns, .. }, [sink, ..], _) => write!(
                f,
                "the longest path to {sink} alone takes {:?}, which is more than the relative \
                 deadline of that sink; shorten the path or relax the deadline",
                Duration::from_nanos(*length_ns)
            ),
            (Reason::NoSinkBound { .. }, [sink, ..], _) => write!(
                f,
                "no test bounds the response time of {sink} by the relative deadline of that sink \
                 (it may still meet it); add cores or relax the deadline"
            ),
            (Reason::DelayedBy { .. }, _, Some(other)) => write!(
                f,
                "{other}, which may delay it, is not proven itself; see to that one first"
            ),
            (reason, _, _) => reason.fmt(f),
        }
    }
}
