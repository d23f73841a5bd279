//! What a commit would refuse of DAGs that a file describes, in the words of a file.
//!
//! The commit speaks to an app's author, of attributes and registrations. A person with
//! a file has keys and records, and is not told what follows from something else.

use alloc::format;
use alloc::string::{String, ToString};

use sched_dag::{Fault, Rejected};

/// Returns the faults that a person can mend, and what to say of each.
pub fn of_file(rejected: &Rejected) -> impl Iterator<Item = (&Fault, String)> {
    let faults = rejected.faults();
    let is_cycle = |fault: &Fault| matches!(fault, Fault::Cycle { .. } | Fault::SelfEdge { .. });
    let has_cycle = faults.iter().any(is_cycle);
    // A graph that is one cycle has no ends either; the cycle says all.
    let follows = move |fault: &&Fault| {
        has_cycle && matches!(fault, Fault::NoSource { .. } | Fault::NoSink { .. })
    };
    let news = faults.iter().filter(move |fault| !follows(fault));
    news.map(|fault| (fault, reason(fault)))
}

fn reason(fault: &Fault) -> String {
    match fault {
        Fault::TooManyInstances {
            dag,
            in_flight,
            instances,
            limit,
        } => format!(
            "the jobs in flight need {instances} instances, more than the limit of {limit}, and \
             {dag} with {in_flight} jobs in flight needs most; lower its in-flight"
        ),
        other => other.to_string(),
    }
}
