//! How often a join's sink is made ready, counted in the trace.
//!
//! A system that wakes a sink for each of its inputs makes N wake-ups of a join of N.
//! Here a sink is made ready once, when its last predecessor has finished; the trace
//! has an event for each time.

use std::collections::BTreeMap;

use super::figure::Figure;
use crate::json::Value;
use crate::protocol::Transcript;

/// Counts in all fork-joins of a boot.
pub(super) fn count(transcript: &Transcript, cores: u64) -> Result<Vec<Figure>, String> {
    /// What was counted of one number of branches.
    #[derive(Default)]
    struct Count {
        ready: u64,
        jobs: u64,
    }
    let mut counts: BTreeMap<u64, Count> = BTreeMap::new();
    // The number of branches of the run in hand, if it is a fork-join.
    let mut branches = None;
    for line in &transcript.machine {
        match &*line.kind {
            "trace_dag" => {
                let subtasks = line
                    .value
                    .get("subtasks")
                    .map_or(0, |list| list.elements().len());
                let is_fork_join = line.text_at("name") == Some("fork-join");
                branches = is_fork_join.then_some((subtasks as u64).saturating_sub(2));
            }
            "trace" => {
                let Some(branches) = branches else { continue };
                let count = counts.entry(branches).or_default();
                for event in line.value.get("events").map_or(&[][..], Value::elements) {
                    let [_, what, _, _, _, subtask] = event.elements() else {
                        return Err(format!("serial line {}: an event's form", line.number));
                    };
                    match what.as_text() {
                        Some("ready") if subtask.as_u64() == Some(branches + 1) => count.ready += 1,
                        Some("released") => count.jobs += 1,
                        _ => {}
                    }
                }
            }
            "trace_end" if line.number_at("lost") != Some(0) => {
                return Err("the trace has lost events; measure fewer jobs".into());
            }
            _ => {}
        }
    }
    if counts.values().any(|count| count.jobs == 0) || counts.is_empty() {
        return Err("the trace shows no job of a fork-join".into());
    }
    let figure = |(branches, count): (u64, Count)| Figure {
        cores,
        workload: format!("fork-join-{branches}"),
        figure: "sink_wakeups".into(),
        per: count.jobs,
        median: count.ready,
        p99: count.ready,
        max: count.ready,
    };
    Ok(counts.into_iter().map(figure).collect())
}

#[cfg(test)]
mod tests {
    use super::count;
    use crate::protocol::Transcript;

    const DAG: &str = "{\"kind\":\"trace_dag\",\"dag\":0,\"name\":\"fork-join\",\"period_ns\":1,\
        \"relative_deadline_ns\":1,\"offset_ns\":0,\"in_flight\":1,\"overrun\":\"queue\",\
        \"subtasks\":[[\"a\",0,0,1],[\"b\",1,0,1],[\"c\",2,0,1]],\"edges\":[[0,1],[1,2]]}\n";

    #[test]
    fn counts_the_sinks_events_alone() {
        let events = "{\"kind\":\"trace\",\"events\":[[0,\"released\",0,0,0,-1],\
            [1,\"ready\",0,0,0,1],[2,\"ready\",0,0,0,2],[3,\"start\",0,0,0,2],\
            [4,\"ready\",0,0,0,2]]}\n";
        let figures = count(&Transcript::read(&format!("{DAG}{events}")), 1).unwrap();
        assert_eq!(figures.len(), 1);
        let figure = &figures[0];
        assert_eq!(
            (&*figure.workload, figure.per, figure.median),
            ("fork-join-1", 1, 2)
        );
    }

    #[test]
    fn a_trace_without_jobs_is_no_count() {
        assert!(
            count(&Transcript::read(""), 1)
                .unwrap_err()
                .contains("no job")
        );
    }
}
