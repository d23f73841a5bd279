//! Linux as the platform that `fass` runs on: one for the program.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use fass::edge::Begin;
use fass::log::Line;
use fass::{Channel, LaunchError, Occupation, Plan, Platform, Recorded, Runner, Terms};
use sched_dag::lifecycle::{self, Parts, Request, Requests};
use sched_dag::{DagId, Journal, Scheduler, TaskSet};

use crate::control::{self, Control};
use crate::edge;
use crate::office::Office;
use crate::run::{Launched, Threads};
use crate::state::State;
use crate::sys;
use crate::team::{Team, with_own_worker};

/// The platform of the program.
pub(crate) struct Host {
    threads: Mutex<Option<Threads>>,
    launched: Mutex<Option<Launched>>,
}

pub(crate) static HOST: Host = Host {
    threads: Mutex::new(None),
    launched: Mutex::new(None),
};

/// How much memory a journal may take its quarter of.
const JOURNAL_BYTES: usize = 1 << 30;

impl Host {
    /// Returns what the next commit runs on; `None` before there is a machine.
    pub(crate) fn threads(&self) -> MutexGuard<'_, Option<Threads>> {
        self.threads.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes what was committed last.
    pub(crate) fn take_launched(&self) -> Option<Launched> {
        let mut launched = self.launched.lock();
        let launched = launched.as_deref_mut();
        launched.map_or(None, Option::take)
    }
}

impl Platform for Host {
    fn terms(&self) -> Terms {
        let threads = self.threads();
        // Without a machine, those of none.
        threads
            .as_ref()
            .map_or(Terms::of_cores(1), |of| of.terms.clone())
    }

    fn assign(&self, task_set: &mut TaskSet) -> Result<(), LaunchError> {
        fass::assign_clusters(self, task_set)
    }

    #[inline]
    fn now_ns(&self) -> u64 {
        sys::now_ns()
    }

    fn execute_for(&self, duration: Duration, how: Occupation) {
        let ns = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
        if how == Occupation::Hold && with_own_worker(|worker| worker.hold(ns)).is_some() {
            return;
        }
        let end_ns = sys::own_processor_time_ns().saturating_add(ns);
        while sys::own_processor_time_ns() < end_ns {
            std::hint::spin_loop();
        }
    }

    fn raise(&self, plan: u64, dag: DagId) {
        assert!(
            with_own_worker(|_| ()).is_none(),
            "a subtask raises a signal that it was not registered with; register it by \
             `dag.using(signal.raising())`"
        );
        let is_its = |control: &Control| control.office.plan == plan;
        if let Some(control) = control::latest().filter(is_its) {
            control.office.send(None, Request::Signal(dag));
        }
    }

    fn crosses(&self) -> bool {
        edge::get().is_wished()
    }

    fn results_cross(&self) -> bool {
        edge::get().has_results()
    }

    fn open_channels(&self, dag: DagId, graph: u64, channels: &[Channel], begin: Begin) -> bool {
        edge::get().open(dag, graph, channels, begin)
    }

    fn record(&self, value: &Recorded<'_>) {
        edge::record(value);
    }

    fn replays(&self) -> bool {
        edge::get().is_replay()
    }

    fn replay(&self, channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
        edge::get().lend(channel, job, take);
    }

    fn log(&self, mut line: Line) {
        (line.instance, line.at_ns) = edge::here();
        line.keep();
    }

    fn launch(&self, mut plan: Plan) -> Result<(), LaunchError> {
        let Some(threads) = self.threads().clone() else {
            let line = "there is no `Linux` yet; make one before the commit";
            return Err(LaunchError::new(line));
        };
        if control::latest().is_some() {
            let line =
                "other DAGs are committed already; run them first, or commit all in one call";
            return Err(LaunchError::new(line));
        }
        edge::launch(&mut plan)?;
        edge::commit(&plan, &threads.terms);
        let divided = lifecycle::divide(&plan.task_set, plan.lifecycle.as_deref());
        let (letters, parts) = divided.map_err(LaunchError::new)?;
        let office = Office::new(plan.number, &plan.task_set, letters, threads.levels);
        let office = Arc::new(office);
        let proven = plan.proven.clone();
        let control = Control {
            teams: teams(plan, parts, &threads, &office),
            office,
        };
        control::set(Some(control.clone()));
        let launched = Launched {
            control,
            proven,
            threads,
        };
        let mut place = self.launched.lock().unwrap_or_else(PoisonError::into_inner);
        *place = Some(launched);
        Ok(())
    }
}

/// Makes what the threads of each cluster share.
fn teams(plan: Plan, parts: Parts, threads: &Threads, office: &Arc<Office>) -> Arc<[Arc<Team>]> {
    let (task_set, options) = (&plan.task_set, threads.terms.scheduler);
    let dags = task_set.dags().len();
    let mut runners: Vec<Vec<Runner>> = task_set.clusters().map(|_| Vec::new()).collect();
    for runner in Runner::all(task_set, plan.bodies) {
        let cluster = task_set.dag(runner.instance.dag).cluster();
        runners[cluster.index()].push(runner);
    }
    let share = JOURNAL_BYTES / runners.len();
    let most_events = threads.terms.most_events / runners.len() as u64;
    let clusters = task_set.clusters().zip(runners).zip(parts);
    let team = |((cluster, runners), lifecycle)| {
        let cores = task_set.cores_of(cluster, options.cores);
        let requests = Requests::new(dags, lifecycle);
        let state = State::new(
            (cluster, office),
            Scheduler::of_cluster(Arc::clone(task_set), options, cluster),
            runners,
            (requests, plan.after_fault.clone()),
            Journal::of_cluster(task_set, cluster, share, most_events),
            threads.processors[cores.start as usize..cores.end as usize].into(),
            threads.levels,
        );
        Arc::new(Team::new(
            state,
            office,
            (threads.polls, threads.skips_idle),
        ))
    };
    clusters.map(team).collect()
}
