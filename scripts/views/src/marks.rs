//! The moments of a run besides executions: faults, modes, pauses, and releases and signals without
//! effect. The fate of each job is in the [`view`](crate::view).

use sched_dag::DagId;
use sched_dag::journal::{Event, EventKind};

use crate::view::View;

/// A moment of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mark {
    /// The time of the moment.
    pub time_ns: u64,
    /// The DAG; `None` for a moment of the whole run.
    pub dag: Option<DagId>,
    /// A word for its kind.
    pub kind: &'static str,
    /// A sentence for people.
    pub text: String,
}

/// Returns the moments of a run, in the order of time.
pub fn of(view: &View<'_>) -> impl Iterator<Item = Mark> {
    view.events.iter().filter_map(|event| mark(view, event))
}

fn mark(view: &View<'_>, event: &Event) -> Option<Mark> {
    let (kind, happened) = match event.what {
        EventKind::Ended => ("fault", "is ended by a fault"),
        EventKind::Restarted => ("fault", "goes on with another function after a fault"),
        EventKind::DagEnded => ("ended", "starts no further instance"),
        EventKind::Off => ("paused", "is paused: it releases no job"),
        EventKind::On => ("resumed", "is resumed"),
        EventKind::Closed => ("closed", "is closed: it releases no further job"),
        EventKind::Entered => ("mode", "entered"),
        EventKind::Queued => ("queued", "waits with its release for an older job"),
        EventKind::Skipped => ("skipped", "is not released"),
        EventKind::Aborted => ("aborted", "is aborted: it starts no further instance"),
        EventKind::Dropped => ("dropped", "takes no further signal, so one is dropped"),
        _ => return None,
    };
    let Event { dag, job, .. } = *event;
    let model = view.run.task_set.dag(dag);
    let of_dag = format!("dag `{}`", model.name());
    let subject = match event.subtask {
        Some(subtask) => {
            let name = model.subtask(subtask).name();
            format!("subtask `{name}` of {of_dag}, job {job},")
        }
        None if event.what == EventKind::Entered => format!("mode {job} is"),
        None if event.what.is_of_dag() => of_dag,
        None => format!("job {job} of {of_dag}"),
    };
    Some(Mark {
        time_ns: event.time_ns,
        dag: (event.what != EventKind::Entered).then_some(dag),
        kind,
        text: format!("{subject} {happened}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::tests::run_of;

    #[test]
    fn what_happens_besides_execution_is_told_in_the_order_of_time() {
        let events = "
5 released c0 1.0
9 entered c0 0.2
7 ended c0 1.0.0
8 dag_ended c0 1.0
8 restarted c0 1.0.0
9 skipped c0 0.4
9 missed c0 0.3";
        let run = run_of("edf 1\nx T=10 D=10 O=0: a/0\ny T=20 D=20 O=0: b/0", events);
        let view = View::new(&run);
        let told = of(&view).map(|mark| {
            let dag = mark.dag.map_or("-".into(), |dag| dag.0.to_string());
            format!("{} {dag} {}: {}\n", mark.time_ns, mark.kind, mark.text)
        });
        let expected = "\
7 1 fault: subtask `b` of dag `y`, job 0, is ended by a fault
8 1 ended: dag `y` starts no further instance
8 1 fault: subtask `b` of dag `y`, job 0, goes on with another function after a fault
9 - mode: mode 2 is entered
9 0 skipped: job 4 of dag `x` is not released
";
        assert_eq!(told.collect::<String>(), expected);
    }
}
