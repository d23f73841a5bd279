//! The entries of the tables in a run, with the latest time for each to execute.

use sched_dag::{CoreId, Instance, TableEntry};

use crate::view::View;

/// An entry of a table, in one job of the run.
#[derive(Clone, Copy, Debug)]
pub struct PlannedEntry {
    /// The core.
    pub core: CoreId,
    /// The entry's instance.
    pub instance: Instance,
    /// The number of entries around this entry.
    pub depth: u32,
    /// The latest start.
    pub from_ns: u64,
    /// The latest finish.
    pub to_ns: u64,
}

impl PlannedEntry {
    /// Returns whether the entry was late by more than a platform may take for its own work.
    pub fn is_late(&self, view: &View<'_>) -> bool {
        let history = view.histories.get(&self.instance);
        let finish_ns = history.and_then(|history| history.finish_ns);
        let latest_ns = self.to_ns.saturating_add(view.run.usual_bound_ns);
        finish_ns.is_some_and(|finish_ns| finish_ns > latest_ns)
    }
}

/// Returns the entries of a run's released jobs, by start, the outer before the inner. A table
/// without times has no such entries.
pub fn entries(view: &View<'_>) -> Vec<PlannedEntry> {
    let (task_set, mut all) = (&view.run.task_set, Vec::new());
    for table in task_set.tables() {
        let (is_alone, cores) = (table.is_of_one_dag(), view.run.options.cores);
        let first = task_set.cores_of(table.cluster, cores).start;
        let entries = table.lists.iter().flat_map(|list| {
            let of_core = move |entry| (CoreId(first + list.core), entry);
            list.entries.iter().map(of_core)
        });
        for (core, entry) in entries.filter(|(_, entry)| entry.length_ns > 0) {
            let &TableEntry { dag, subtask, .. } = entry;
            let jobs = i128::from(task_set.jobs_in_lap(table, dag));
            let released = view.jobs.range((dag, 0)..=(dag, u64::MAX));
            let released = released.filter(|(_, job)| job.released_ns.is_some());
            for (&(_, job), _) in released {
                let ahead = i128::from(job) - i128::from(entry.job);
                if ahead % jobs != 0 {
                    continue;
                }
                // A lap of one DAG begins with the release of its job in lap 0.
                let lap_ns = i128::from(table.lap_ns);
                let from_ns = match is_alone {
                    true => i128::from(view.release_ns(dag, job)) - i128::from(entry.job) * lap_ns,
                    false => ahead / jobs * lap_ns,
                };
                // Stated by hand, or in a record, times may be of any size.
                let from_ns = u64::try_from(from_ns).unwrap_or(0);
                let from_ns = from_ns.saturating_add(entry.start_ns);
                all.push(PlannedEntry {
                    core,
                    instance: Instance::new(dag, job, subtask),
                    depth: entry.depth,
                    from_ns,
                    to_ns: from_ns.saturating_add(entry.length_ns),
                });
            }
        }
    }
    all.sort_unstable_by_key(|of: &PlannedEntry| (of.from_ns, of.depth, of.core));
    all
}

/// Returns the entry that was the first to be late.
pub fn first_late(view: &View<'_>) -> Option<PlannedEntry> {
    let late = entries(view).into_iter().filter(|of| of.is_late(view));
    late.min_by_key(|of| of.to_ns)
}
