//! Rule R5: who runs, and for how long someone else should have.
//!
//! The judge is [`sched_dag::law::sweep`], which also judges runs in virtual time and on
//! the machine. Here a trace becomes its changes, and what it finds becomes words.
//!
//! If events were lost, a core takes part from its first known event on. An
//! ended DAG's waiting instances are owed nothing.

use sched_dag::law::sweep::{Blame, Change, Key, Ranking, Sweep, Waits, Wrong};
use sched_dag::{CoreId, Instance};

use super::breach::{Breach, Rule};
use super::model::{Run, What};
use super::view::View;

impl Ranking for Run {
    fn key(&self, instance: Instance) -> Key {
        Run::key(self, instance)
    }

    fn keeps_its_core(&self, instance: Instance) -> bool {
        Run::keeps_its_core(self, instance)
    }
}

/// Judges a run by R5.
pub(super) fn judge(view: &View<'_>, bound_ns: u64, breaches: &mut Vec<Breach>) -> Waits {
    let (wrong, waits) = Sweep::judge(view.run, bound_ns, changes(view), view.end_ns);
    breaches.extend(wrong.iter().map(|wrong| in_words(view.run, wrong)));
    waits
}

fn in_words(run: &Run, wrong: &Wrong) -> Breach {
    let (time_ns, text) = match *wrong {
        Wrong::Waits {
            waiting,
            since_ns,
            length_ns,
            blame,
        } => {
            let name = run.name(waiting);
            let blame = match blame {
                Blame::Runs(running, core) => format!("core {} runs {}", core.0, run.name(running)),
                Blame::Idle(Some(core)) => format!("core {} is idle", core.0),
                Blame::Idle(None) => "a core is idle".into(),
            };
            let text = format!("{name} should run and waits {length_ns} ns while {blame}");
            (since_ns, text)
        }
        Wrong::OutOfTurn {
            started,
            core,
            at_ns,
            first,
            since_ns,
        } => {
            let text = format!(
                "{} starts on core {} and keeps it, although {} waits since {since_ns} ns and \
                 goes first",
                run.name(started),
                core.0,
                run.name(first)
            );
            (at_ns, text)
        }
    };
    Breach {
        rule: Rule::Dispatch,
        time_ns,
        text,
    }
}

/// Returns all changes by time; those of one instance keep their order.
fn changes(view: &View<'_>) -> Vec<(u64, Change)> {
    let mut changes: Vec<(u64, Change)> = Vec::new();
    for core in (0..view.run.cores).map(CoreId) {
        let first = view
            .events
            .iter()
            .find(|(event, _)| event.core == core && event.what.is_of_machine());
        let known_ns = match first {
            _ if !view.is_lossy() => Some(0),
            Some((event, _)) => match event.what {
                What::Start | What::Resume => Some(event.time_ns),
                _ => Some(view.from_ns),
            },
            None => None,
        };
        changes.extend(known_ns.map(|known_ns| (known_ns, Change::CoreIsKnown)));
    }
    let stops = view.stopped.iter();
    changes.extend(stops.map(|(&dag, &time_ns)| (time_ns, Change::Stopped(dag))));
    for (&instance, history) in &view.histories {
        let stages = history.stages.iter();
        changes.extend(stages.map(|&(time_ns, stage)| (time_ns, Change::Stage(instance, stage))));
    }
    changes.sort_by_key(|(time_ns, _)| *time_ns);
    changes
}
