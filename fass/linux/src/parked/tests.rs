//! Every order in which a parked instance can end, step by step, without a thread.

use std::sync::{Arc, Mutex, PoisonError};

use fass::{Preemption, SubtaskAttributes, create_dag, finish_create_dags};
use sched_dag::{CoreId, DagId};

use crate::platform::HOST;
use crate::state::Number;
use crate::team::Team;
use crate::{Linux, Mechanism, sys};
use fass::Runner;

/// `low` is read, then thought about; `urgent` preempts that; `first` precedes both.
const DAGS: [&str; 3] = ["low", "urgent", "first"];
const LOW: DagId = DagId(0);
const URGENT: DagId = DagId(1);
const FIRST: DagId = DagId(2);

/// What ran on a core, in the journal's order, as `start low 0`: subtask 0 of `low`.
type Story = Vec<String>;

/// A team whose threads are played by the test.
struct Stage {
    team: Arc<Team>,
    cores: u32,
}

/// An instance that a worker runs.
struct Running {
    worker: Number,
    runner: Box<Runner>,
}

impl Stage {
    fn new(cores: u32, urgent_keeps_its_core: bool) -> Self {
        static RIGHT: Mutex<()> = Mutex::new(());
        let right = RIGHT.lock().unwrap_or_else(PoisonError::into_inner);
        let machine = Linux::sharing(cores, Mechanism::Normal).unwrap();
        HOST.terms().as_mut().unwrap().preemption = Preemption::Enabled;
        let dags = DAGS.map(|name| {
            let dag = create_dag();
            dag.name(name).jobs(1);
            dag.relative_deadline(std::time::Duration::from_secs(100));
            drop(dag.sporadic(std::time::Duration::from_secs(1)));
            dag
        });
        let attributes = |name, priority| SubtaskAttributes::named(name).priority(priority);
        let read = dags[0].register_untyped_subtask(|_| (), attributes("read", 9));
        let think = dags[0].register_untyped_subtask(|_| (), attributes("think", 9));
        dags[0].precede(&read, &think);
        let urgent = attributes("urgent", 1);
        let urgent = match urgent_keeps_its_core {
            true => urgent.non_preemptive(),
            false => urgent,
        };
        dags[1].register_untyped_subtask(|_| (), urgent);
        dags[2].register_untyped_subtask(|_| (), attributes("first", 0));
        finish_create_dags(&dags).unwrap();
        let team = HOST.take_launched().unwrap().teams.remove(0);
        drop((machine, right));
        team.workers.iter().for_each(|worker| worker.begin());
        let mut state = team.lock();
        for core in 0..cores {
            state.pin(core as usize, CoreId(core), &team.workers);
        }
        state.time = crate::state::RunTime::beginning(sys::now_ns());
        drop(state);
        Self { team, cores }
    }

    /// Releases a DAG's job, and has the core that gets it begin with it.
    fn begin(&self, dag: DagId) -> Running {
        let mut state = self.team.lock();
        state.step(&self.team.workers, |moment| moment.signal(dag));
        let mut cores = 0..self.cores as usize;
        let core = cores
            .find(|core| state.engine.placement.is_wanted(*core))
            .unwrap();
        let worker = state.active[core];
        let runner = state.find_work(worker, &self.team.workers).unwrap();
        Running { worker, runner }
    }

    /// A function returns, and its worker reports that. It runs what it gets.
    fn end(&self, running: Running, outcome: Result<(), String>) -> Option<Running> {
        let Running { worker, runner } = running;
        let next = self.team.complete(worker, runner, outcome);
        let runner = next.ok().expect("it is not abandoned")?;
        Some(Running { worker, runner })
    }

    /// Returns the story, after all rules were held against the journal.
    fn story(&self) -> Story {
        let state = self.team.lock();
        assert!(state.left.is_empty());
        let journal = &state.engine.scheduler.log.journal;
        let mut found: Vec<_> = journal.violations(&state.engine.task_set);
        let options = state.engine.scheduler.options();
        let of_dispatch =
            journal.dispatch_violations(&state.engine.task_set, &options, 1_000_000_000);
        found.extend(of_dispatch.unwrap());
        assert!(found.is_empty(), "{found:?}");
        let events = journal.events().filter(|event| event.what.is_of_machine());
        let line = |event: sched_dag::journal::Event| {
            let subtask = event.subtask.unwrap().0;
            format!("{} {} {subtask}", event.what, DAGS[event.dag.index()])
        };
        events.map(line).collect()
    }
}

#[test]
fn one_that_has_returned_ends_before_the_parked_one() {
    for keeps_its_core in [false, true] {
        let stage = Stage::new(1, keeps_its_core);
        let low = stage.begin(LOW);
        let urgent = stage.begin(URGENT);
        // It waits for the scheduler's lock, and the other one is quicker.
        stage.team.workers[urgent.worker].report(None);
        assert!(stage.end(low, Ok(())).is_none());
        let think = stage.end(urgent, Ok(())).unwrap();
        assert!(stage.end(think, Ok(())).is_none());
        let story = stage.story();
        let expected = [
            "start low 0",
            "suspend low 0",
            "start urgent 0",
            "finish urgent 0",
            "resume low 0",
            "finish low 0",
            "start low 1",
            "finish low 1",
        ];
        assert_eq!(story, expected, "{keeps_its_core}");
        assert_eq!(
            stage.team.lock().engine.scheduler.statistics(LOW).completed,
            1
        );
    }
}

#[test]
fn one_that_waits_in_mid_function_loses_its_core_only_if_it_may() {
    for keeps_its_core in [false, true] {
        let stage = Stage::new(1, keeps_its_core);
        let low = stage.begin(LOW);
        let urgent = stage.begin(URGENT);
        assert!(stage.end(low, Ok(())).is_none());
        let think = stage.end(urgent, Ok(())).unwrap();
        assert!(stage.end(think, Ok(())).is_none());
        let story = stage.story();
        let core = match keeps_its_core {
            true => &["finish urgent 0", "resume low 0", "finish low 0"][..],
            false => &[
                "suspend urgent 0",
                "resume low 0",
                "finish low 0",
                "resume urgent 0",
                "finish urgent 0",
            ],
        };
        assert_eq!(story[3..story.len() - 2], *core);
    }
}

#[test]
fn a_parked_one_ends_at_once_while_nothing_has_its_core() {
    let stage = Stage::new(1, true);
    let low = stage.begin(LOW);
    let mut state = stage.team.lock();
    state.step(&stage.team.workers, |moment| {
        moment.signal(URGENT);
    });
    drop(state);
    assert!(stage.end(low, Ok(())).is_none());
    let story = stage.story();
    assert_eq!(
        story[1..],
        ["suspend low 0", "resume low 0", "finish low 0"]
    );
}

#[test]
fn what_was_left_is_reported_where_it_is_wanted_before() {
    let stage = Stage::new(2, true);
    let first = stage.begin(FIRST);
    let low = stage.begin(LOW);
    let parked = low.worker;
    let urgent = stage.begin(URGENT);
    assert!(stage.end(low, Ok(())).is_none());
    let left = stage.team.lock().take_left(parked);
    assert!(left.is_none(), "it has no core yet");
    // The core that becomes free is for the parked one.
    assert!(stage.end(first, Ok(())).is_none());
    let mut state = stage.team.lock();
    let left = state.take_left(parked).expect("it has a core now");
    let next = stage
        .team
        .report(parked, state, left.runner, Ok(()), left.finish_ns);
    let (worker, runner) = (parked, next.unwrap());
    assert!(stage.end(Running { worker, runner }, Ok(())).is_none());
    assert!(stage.end(urgent, Ok(())).is_none());
    let story = stage.story();
    assert_eq!(
        story[4..7],
        ["finish first 0", "resume low 0", "finish low 0"]
    );
}

#[test]
fn a_parked_one_that_fails_takes_no_core_from_any() {
    for keeps_its_core in [false, true] {
        let stage = Stage::new(1, keeps_its_core);
        let low = stage.begin(LOW);
        let urgent = stage.begin(URGENT);
        assert!(stage.end(low, Err("meant".to_owned())).is_none());
        assert!(stage.end(urgent, Ok(())).is_none());
        let story = stage.story();
        assert_eq!(story[3..], ["ended low 0", "finish urgent 0"]);
    }
}

#[test]
fn what_was_left_to_one_that_is_abandoned_is_reported() {
    let stage = Stage::new(1, true);
    let low = stage.begin(LOW);
    let urgent = stage.begin(URGENT);
    assert!(stage.end(low, Ok(())).is_none());
    let mut state = stage.team.lock();
    stage.team.abandon(&mut state, CoreId(0));
    assert_eq!(state.engine.placement.current(0), None);
    let worker = state.active[0];
    let runner = state.find_work(worker, &stage.team.workers).unwrap();
    drop(state);
    assert!(stage.end(Running { worker, runner }, Ok(())).is_none());
    let Running { worker, runner } = urgent;
    assert!(stage.team.complete(worker, runner, Ok(())).is_err());
    let story = stage.story();
    assert_eq!(
        story[3..6],
        ["ended urgent 0", "resume low 0", "finish low 0"]
    );
    assert_eq!(story.last().map(String::as_str), Some("finish low 1"));
}
