//! Making a failing set small: as long as it still fails, DAGs, jobs, subtasks,
//! edges and times are dropped or lowered, one after the other.

use crate::set::{Dag, Set};

/// One step.
type Change<'a> = dyn Fn(&mut Set) + 'a;

/// Returns a set for which `fails` holds and holds for no set one step smaller.
pub(crate) fn shrink(mut set: Set, fails: impl Fn(&Set) -> bool) -> Set {
    while let Some(smaller) = steps(&set).into_iter().find(|smaller| fails(smaller)) {
        set = smaller;
    }
    set
}

/// Returns all sets that are one step smaller, the largest steps first.
fn steps(set: &Set) -> Vec<Set> {
    let mut smaller = Vec::new();
    let mut add = |change: &Change<'_>| {
        let mut set = set.clone();
        change(&mut set);
        smaller.push(set);
    };
    for dag in 0..set.dags.len() {
        if set.dags.len() > 1 {
            add(&|set| drop(set.dags.remove(dag)));
        }
    }
    for dag in 0..set.dags.len() {
        let Dag {
            subtasks, edges, ..
        } = &set.dags[dag];
        if set.dags[dag].jobs > 1 {
            add(&|set| drop_job(&mut set.dags[dag]));
        }
        for subtask in 0..subtasks.len() {
            if subtasks.len() > 1 {
                add(&|set| drop_subtask(&mut set.dags[dag], subtask));
            }
        }
        for edge in 0..edges.len() {
            add(&|set| {
                set.dags[dag].edges.remove(edge);
            });
        }
    }
    if set.options.cores > 1 {
        add(&|set| set.options.cores -= 1);
    }
    for dag in 0..set.dags.len() {
        for signal in 0..set.dags[dag].signals_ns.as_ref().map_or(0, Vec::len) {
            add(&|set| {
                let signals_ns = set.dags[dag].signals_ns.as_mut();
                signals_ns.expect("it has signals").remove(signal);
            });
        }
        for pause in 0..set.dags[dag].pauses_ns.len() {
            add(&|set| {
                set.dags[dag].pauses_ns.remove(pause);
            });
        }
        if set.dags[dag].fault_limit.is_some() {
            add(&|set| set.dags[dag].fault_limit = None);
        }
        if set.dags[dag].stop_ns.is_some() {
            add(&|set| set.dags[dag].stop_ns = None);
        }
    }
    for dag in 0..set.dags.len() {
        lower(&mut add, set.dags[dag].offset_ns, 0, |set, to| {
            set.dags[dag].offset_ns = to
        });
        lower(&mut add, set.dags[dag].period_ns, 1, |set, to| {
            set.dags[dag].period_ns = to
        });
        for subtask in 0..set.dags[dag].subtasks.len() {
            if set.dags[dag].subtasks[subtask].deadline_ns.is_some() {
                add(&|set| set.dags[dag].subtasks[subtask].deadline_ns = None);
            }
            if set.dags[dag].subtasks[subtask].fails_in.is_some() {
                add(&|set| set.dags[dag].subtasks[subtask].fails_in = None);
            }
            for (job, &execution_ns) in set.dags[dag].subtasks[subtask]
                .executions_ns
                .iter()
                .enumerate()
            {
                lower(&mut add, execution_ns, 1, |set, to| {
                    set.dags[dag].subtasks[subtask].executions_ns[job] = to;
                });
            }
        }
    }
    smaller
}

/// Adds the steps from a value to the least one and to one less.
fn lower(add: &mut dyn FnMut(&Change<'_>), value: u64, least: u64, set_to: impl Fn(&mut Set, u64)) {
    if value > least {
        add(&|set| set_to(set, least));
        add(&|set| set_to(set, value - 1));
    }
}

fn drop_job(dag: &mut Dag) {
    dag.jobs -= 1;
    dag.in_flight = dag.in_flight.min(dag.jobs);
    for subtask in &mut dag.subtasks {
        subtask.executions_ns.pop();
    }
}

fn drop_subtask(dag: &mut Dag, dropped: usize) {
    dag.subtasks.remove(dropped);
    dag.edges
        .retain(|&(from, to)| from != dropped && to != dropped);
    for (from, to) in &mut dag.edges {
        *from -= usize::from(*from > dropped);
        *to -= usize::from(*to > dropped);
    }
}

#[cfg(test)]
mod tests {
    use crate::random::Random;
    use crate::set::{Overruns, draw};

    #[test]
    fn what_does_not_matter_is_dropped() {
        let fails = |set: &crate::set::Set| {
            let edges = set.dags.iter().map(|dag| dag.edges.len());
            edges.sum::<usize>() > 0 && set.options.cores > 1
        };
        let mut random = Random::new(1);
        let set = std::iter::repeat_with(|| draw(&mut random, Overruns::Often))
            .find(fails)
            .expect("some set has two cores and an edge");
        let smallest = super::shrink(set, fails);
        assert_eq!(smallest.options.cores, 2);
        assert_eq!(smallest.dags.len(), 1);
        let dag = &smallest.dags[0];
        assert_eq!((dag.subtasks.len(), dag.edges.len(), dag.jobs), (2, 1, 1));
        assert_eq!((dag.period_ns, dag.offset_ns), (1, 0));
    }
}
