//! Every order in which a parked instance can end, step by step, without a thread.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use fass::{Preemption, SubtaskAttributes, create_dag, finish_create_dags};
use sched_dag::journal::EventKind;
use sched_dag::law::{self, JudgeOptions};
use sched_dag::lifecycle::Request;
use sched_dag::{CoreId, DagId};

use crate::platform::HOST;
use crate::state::{FaultCause, Number};
use crate::team::Team;
use crate::{Linux, Mechanism, clock};
use fass::platform::SubtaskRunner;

/// `low` is read, then thought about; `urgent` preempts that; `first` precedes both.
const DAGS: [&str; 3] = ["low", "urgent", "first"];

/// A program has one machine at a time.
pub(crate) static MACHINE: Mutex<()> = Mutex::new(());

/// A team whose threads are played by the test.
struct Stage {
    team: Arc<Team>,
    /// Running instances, by their DAG's name, with the worker that runs each.
    running: BTreeMap<&'static str, (Number, Box<SubtaskRunner>)>,
    /// By DAG, the worker that began with its job.
    began: BTreeMap<&'static str, Number>,
}

impl Stage {
    fn new(cores: u32, urgent_keeps_its_core: bool) -> Self {
        let _one = MACHINE.lock();
        let machine = Linux::sharing(cores, Mechanism::Normal).unwrap();
        HOST.threads().as_mut().unwrap().terms.scheduler.preemption = Preemption::Enabled;
        let dags = DAGS.map(|name| {
            let dag = create_dag();
            dag.name(name).jobs(1);
            dag.relative_deadline(Duration::from_secs(100));
            drop(dag.sporadic(Duration::from_secs(1)));
            dag
        });
        let priority = |priority| SubtaskAttributes::default().priority(priority);
        let [read, think] =
            [9, 9].map(|low| dags[0].register_untyped_subtask(|_| (), priority(low)));
        dags[0].precede(&read, &think);
        let urgent = match urgent_keeps_its_core {
            true => priority(1).non_preemptive(),
            false => priority(1),
        };
        dags[1].register_untyped_subtask(|_| (), urgent);
        dags[2].register_untyped_subtask(|_| (), priority(0));
        finish_create_dags(&dags).unwrap();
        let team = Arc::clone(&HOST.take_launched().unwrap().control.teams[0]);
        drop(machine);
        team.workers
            .iter()
            .for_each(|worker| worker.register_thread());
        let mut state = team.lock();
        for core in 0..cores {
            state.pin(core as usize, CoreId(core), &team.workers);
        }
        state.port.time = crate::state::RunTime::beginning(clock::now_ns());
        drop(state);
        Self {
            team,
            running: BTreeMap::new(),
            began: BTreeMap::new(),
        }
    }

    /// Plays a step: what happens, and to which DAG's instance.
    fn play(&mut self, step: &str) {
        let (what, name) = step.split_once(' ').unwrap();
        let mut dags = DAGS.into_iter().zip((0..).map(DagId));
        let (name, dag) = dags.find(|(of_dag, _)| *of_dag == name).unwrap();
        let team = Arc::clone(&self.team);
        match what {
            // Its job is released, and the core that gets it begins with it, if it does.
            "signal" | "begin" => {
                let mut state = team.lock();
                state.step(&team.workers, |moment| moment.serve(Request::Signal(dag)));
                let is_wanted = |core: &usize| state.engine.placement.is_wanted(*core);
                if what == "begin" {
                    let worker = state.port.active[(0..2).find(is_wanted).unwrap()];
                    self.began.insert(name, worker);
                    let now_ns = state.now_ns();
                    let runner = state.find_work(worker, &team.workers, now_ns);
                    self.running.insert(name, (worker, runner.unwrap()));
                }
            }
            // Its function has returned, and its worker waits for the scheduler's lock.
            "return" => _ = team.workers[self.began[name]].report(None),
            // Its worker reports that, and runs what it gets.
            "end" | "fail" | "end-in-vain" => {
                let (worker, runner) = self.running.remove(name).unwrap();
                let outcome = match what {
                    "fail" => Err(FaultCause::Panic("meant".to_owned())),
                    _ => Ok(()),
                };
                let next = team.complete(worker, runner, outcome);
                assert_eq!(next.is_err(), what == "end-in-vain", "{step}");
                self.go_on(worker, next.ok().flatten());
            }
            // Its worker reports that, behind another thread that has had the lock.
            "end-behind-signal" | "end-behind-fault" => {
                let (worker, runner) = self.running.remove(name).unwrap();
                let finish_ns = clock::now_ns();
                team.workers[worker].report(None);
                self.play(match what {
                    "end-behind-signal" => "signal urgent",
                    _ => "fail low",
                });
                let next = team.report(worker, team.lock(), runner, Ok(()), finish_ns);
                self.go_on(worker, next);
            }
            // Its worker looks whether it reports what it has left, which it does with a core.
            "look" => {
                let worker = self.began[name];
                let mut state = team.lock();
                if let Some(left) = state.take_left(worker) {
                    let (runner, finish_ns) = (left.runner, left.finish_ns);
                    let next = team.report(worker, state, runner, Ok(()), finish_ns);
                    self.go_on(worker, next);
                }
            }
            // Its budget is exceeded.
            "abandon" => {
                let mut state = team.lock();
                team.abandon(&mut state, CoreId(0));
                assert_eq!(state.engine.placement.current(0), None);
                let worker = state.port.active[0];
                let now_ns = state.now_ns();
                let next = state.find_work(worker, &team.workers, now_ns);
                drop(state);
                self.go_on(worker, next);
            }
            _ => panic!("{step}"),
        }
    }

    fn go_on(&mut self, worker: Number, next: Option<Box<SubtaskRunner>>) {
        if let Some(runner) = next {
            let name = DAGS[runner.instance.dag.index()];
            self.running.insert(name, (worker, runner));
        }
    }

    /// Returns the story, after all rules were held against the journal.
    fn story(&self) -> String {
        let state = self.team.lock();
        assert!(state.left.is_empty());
        let journal = &state.engine.scheduler.log.journal;
        assert!(journal.is_whole());
        let (task_set, options) = (&state.engine.task_set, state.engine.scheduler.options());
        let mut found = law::violations(task_set, JudgeOptions::whole(u64::MAX), journal.events());
        let terms = JudgeOptions::whole(1_000_000_000);
        found.extend(law::dispatch_violations(
            task_set,
            &options,
            terms,
            journal.events(),
        ));
        assert!(found.is_empty(), "{found:?}");
        for core in (0..options.cores).map(CoreId) {
            let times = journal.events().filter(|event| event.core == core);
            let in_order = times.filter(|event| event.what != EventKind::Request);
            assert!(in_order.is_sorted_by_key(|event| event.time_ns));
        }
        let events = journal.events().filter(|event| event.what.is_of_machine());
        let line = |event: sched_dag::journal::Event| {
            let subtask = event.subtask.unwrap().0;
            format!("{} {} {subtask}", event.what, DAGS[event.dag.index()])
        };
        events.map(line).collect::<Vec<_>>().join(", ")
    }
}

/// Cores; whether `urgent` keeps its core, or both; the steps; the story.
type Case = (u32, &'static [bool], &'static str, &'static str);

const CASES: [Case; 9] = [
    // One that has returned, and waits for the scheduler's lock, ends before the parked one.
    (
        1,
        &[false, true],
        "begin low, begin urgent, return urgent, end low, end urgent, end low",
        "start low 0, suspend low 0, start urgent 0, finish urgent 0, resume low 0, \
         finish low 0, start low 1, finish low 1",
    ),
    // One that waits in mid-function loses its core, but only if it may.
    (
        1,
        &[false],
        "begin low, begin urgent, end low, end urgent, end low",
        "start low 0, suspend low 0, start urgent 0, suspend urgent 0, resume low 0, \
         finish low 0, resume urgent 0, finish urgent 0, start low 1, finish low 1",
    ),
    (
        1,
        &[true],
        "begin low, begin urgent, end low, end urgent, end low",
        "start low 0, suspend low 0, start urgent 0, finish urgent 0, resume low 0, \
         finish low 0, start low 1, finish low 1",
    ),
    // A parked one ends at once while nothing has its core.
    (
        1,
        &[true],
        "begin low, signal urgent, end low",
        "start low 0, suspend low 0, resume low 0, finish low 0",
    ),
    // What was left is reported where it is wanted before: the core that becomes free is for it.
    (
        2,
        &[true],
        "begin first, begin low, begin urgent, end low, look low, end first, look low, \
         end low, end urgent",
        "start first 0, start low 0, suspend low 0, start urgent 0, finish first 0, \
         resume low 0, finish low 0, start low 1, finish low 1, finish urgent 0",
    ),
    // A step before its report is not behind its end.
    (
        2,
        &[false, true],
        "begin low, end-behind-signal low, end low",
        "start low 0, finish low 0, start low 1, finish low 1",
    ),
    // A parked one that fails takes no core from any.
    (
        1,
        &[false, true],
        "begin low, begin urgent, fail low, end urgent",
        "start low 0, suspend low 0, start urgent 0, ended low 0, finish urgent 0",
    ),
    // Nor is that fault behind the end of what has returned before.
    (
        1,
        &[false, true],
        "begin low, begin urgent, end-behind-fault urgent",
        "start low 0, suspend low 0, start urgent 0, ended low 0, finish urgent 0",
    ),
    // What was left to one that is abandoned is reported.
    (
        1,
        &[true],
        "begin low, begin urgent, end low, abandon urgent, end low, end-in-vain urgent",
        "start low 0, suspend low 0, start urgent 0, ended urgent 0, resume low 0, \
         finish low 0, start low 1, finish low 1",
    ),
];

#[test]
fn a_parked_one_ends_in_any_order() {
    for (cores, keeps, steps, story) in CASES {
        for keeps_its_core in keeps {
            let mut stage = Stage::new(cores, *keeps_its_core);
            steps.split(", ").for_each(|step| stage.play(step));
            assert_eq!(stage.story(), story, "{keeps_its_core}: {steps}");
        }
    }
}

/// The release thread settles when it looks while a worker makes the next event an earlier one: it
/// is rung for, or looks in time.
#[test]
fn an_earlier_event_is_not_missed() {
    const PATIENCE_NS: u64 = 30_000;
    let team = Stage::new(2, false).team;
    let alarm = team.office.alarm(team.cluster);
    let rounds = if cfg!(miri) { 5 } else { 2_000 };
    for round in 0..rounds {
        // In the far future, so that none is due while it is settled.
        let event_ns = clock::now_ns() + 1_000_000_000_000;
        let before_ns = if round % 2 == 0 {
            u64::MAX
        } else {
            2 * event_ns
        };
        team.look_out.announce(before_ns);
        team.looks_at_ns.store(0, Ordering::SeqCst);
        let seen = alarm.load(Ordering::Acquire);
        let looks_at_ns = thread::scope(|scope| {
            scope.spawn(|| {
                team.look_out.leave(CoreId(0));
                team.announce_at(event_ns);
                team.look_out.rest(CoreId(0));
                team.announce_at(event_ns - 100_000);
            });
            team.settle_look(u64::MAX)
        });
        let is_rung = alarm.load(Ordering::Acquire) != seen;
        let is_in_time = looks_at_ns <= event_ns - 100_000 + PATIENCE_NS;
        assert!(
            is_rung || is_in_time,
            "it looks at {looks_at_ns} for an event at {event_ns}"
        );
    }
}
