//! The rules S1 to S4: sporadic DAGs, released by signals.

mod support;

use std::collections::VecDeque;
use std::sync::Arc;

use sched_dag::analysis::{Overheads, Settings, answer};
use sched_dag::journal::{Event, What};
use sched_dag::law::{Record, Terms, Violation, violations};
use sched_dag::virtual_time::{End, VirtualTime, Workload};
use sched_dag::{
    Activation, CoreId, DagId, DagSpec, DagStatistics, Instance, JobOutcome, Observer,
    OverrunPolicy, Policy, Recorder, Scheduler, SchedulerOptions, TaskSet,
};
use support::random::Random;
use support::{PREEMPTIVE, commit, dag, overrunning};

/// Executes every instance for its WCET or 1 ns, sends signals, records all.
struct Run {
    task_set: Arc<TaskSet>,
    journal: Recorder,
    /// Signals by time.
    signals: VecDeque<(u64, DagId)>,
    /// At which instance's completion which DAG gets a signal.
    chained: Option<(DagId, DagId)>,
    /// What became of each signal.
    arrivals: Vec<(u64, Option<u64>)>,
}

impl Observer for Run {
    fn signalled(&mut self, dag: DagId, job: u64, release_ns: Option<u64>) {
        self.arrivals.push((self.journal.now_ns, release_ns));
        self.journal.signalled(dag, job, release_ns);
    }

    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.journal.released(dag, job, release_ns);
    }

    fn queued(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.journal.queued(dag, job, release_ns);
    }

    fn skipped(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.journal.skipped(dag, job, release_ns);
    }

    fn ready(&mut self, instance: Instance) {
        self.journal.ready(instance);
    }

    fn cancelled(&mut self, instance: Instance) {
        self.journal.cancelled(instance);
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        self.journal.aborted(dag, job);
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, deadline_ns: u64) {
        self.journal.deadline_missed(dag, job, deadline_ns);
    }

    fn job_completed(&mut self, dag: DagId, job: u64, outcome: JobOutcome) {
        self.journal.job_completed(dag, job, outcome);
    }
}

impl Workload for Run {
    fn execute(&mut self, instance: Instance, _now_ns: u64) -> u64 {
        let dag = self.task_set.dag(instance.dag);
        dag.subtask(instance.subtask).wcet_ns().unwrap_or(1)
    }

    fn instant(&mut self, now_ns: u64) {
        self.journal.now_ns = now_ns;
    }

    fn next_signal_ns(&self) -> Option<u64> {
        self.signals.front().map(|&(at_ns, _)| at_ns)
    }

    fn take_signal(&mut self, now_ns: u64) -> Option<DagId> {
        let (_, dag) = self.signals.pop_front_if(|(at_ns, _)| *at_ns <= now_ns)?;
        Some(dag)
    }

    fn started(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.journal.on_core(What::Start, instance, core);
    }

    fn preempted(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.journal.on_core(What::Suspend, instance, core);
    }

    fn resumed(&mut self, instance: Instance, core: CoreId, _now_ns: u64) {
        self.journal.on_core(What::Resume, instance, core);
    }

    fn finished(&mut self, instance: Instance, core: CoreId, now_ns: u64) {
        self.journal.on_core(What::Finish, instance, core);
        if let Some((from, to)) = self.chained
            && instance.dag == from
        {
            self.signals.push_front((now_ns, to));
        }
    }
}

impl Run {
    fn new(task_set: &Arc<TaskSet>, signals: impl Iterator<Item = (u64, DagId)>) -> Self {
        Self {
            task_set: Arc::clone(task_set),
            journal: Recorder::new(Arc::clone(task_set)),
            signals: signals.collect(),
            chained: None,
            arrivals: Vec::new(),
        }
    }

    fn record(&self) -> Record {
        let events = self.journal.events.iter().copied();
        Record::of_events(&self.task_set, true, events).expect("it fits")
    }

    fn releases(&self, dag: u32) -> Vec<u64> {
        let record = self.record();
        let jobs = record.jobs(DagId(dag)).iter();
        jobs.filter_map(|job| job.release_ns).collect()
    }

    fn violations(&self) -> Vec<Violation> {
        let events = self.journal.events.iter().copied();
        violations(&self.task_set, Terms::EXACT, events)
    }
}

fn sporadic(spec: DagSpec) -> DagSpec {
    DagSpec {
        activation: Activation::Sporadic,
        ..spec
    }
}

/// Runs DAGs until nothing happens any more; `signals` are to the last DAG.
fn run(
    specs: &[DagSpec],
    options: SchedulerOptions,
    signals: &[u64],
    chained: Option<(DagId, DagId)>,
) -> (Run, Vec<DagStatistics>) {
    let task_set = commit(specs, options);
    let last = DagId(u32::try_from(specs.len() - 1).expect("few DAGs"));
    let mut run = Run::new(&task_set, signals.iter().map(|&at_ns| (at_ns, last)));
    run.chained = chained;
    let mut driver = VirtualTime::new(Scheduler::new(Arc::clone(&task_set), options));
    assert_eq!(driver.run(&mut run), End::Finished);
    assert_eq!(run.violations(), []);
    let ids = (0..=last.0).map(DagId);
    let statistics = ids
        .map(|dag| *driver.scheduler_of(dag).statistics(dag))
        .collect();
    (run, statistics)
}

#[test]
fn s1_an_early_signal_is_delayed_to_the_minimum_inter_arrival_time() {
    let spec = sporadic(dag(10, 10, 4, &[0], &[]));
    let (run, _) = run(&[spec], PREEMPTIVE, &[3, 5, 40, 50], None);
    assert_eq!(run.releases(0), [3, 13, 40, 50]);
    assert_eq!(run.arrivals[1], (5, Some(13)));
}

#[test]
fn s1_nothing_is_released_before_the_offset_or_without_a_signal() {
    let late = DagSpec {
        offset_ns: 100,
        ..sporadic(dag(10, 10, 4, &[0], &[]))
    };
    let (run, statistics) = run(&[late], PREEMPTIVE, &[7, 205], None);
    assert_eq!(run.releases(0), [100, 205]);
    assert_eq!(statistics[0].released, 2);
}

#[test]
fn s2_one_early_signal_is_kept_and_more_are_dropped_and_counted() {
    let spec = sporadic(dag(10, 10, 9, &[0], &[]));
    let (run, statistics) = run(&[spec], PREEMPTIVE, &[0, 1, 2, 3, 11], None);
    assert_eq!(run.releases(0), [0, 10, 20]);
    assert_eq!(statistics[0].signals, 5);
    assert_eq!(statistics[0].dropped_signals, 2);
}

#[test]
fn s2_a_job_that_waits_for_room_counts_as_the_one_that_is_kept() {
    let mut spec = overrunning(dag(10, 10, 9, &[0], &[]), 1, OverrunPolicy::Queue);
    spec.subtasks[0].wcet_ns = Some(25);
    let spec = sporadic(DagSpec {
        relative_deadline_ns: Some(30),
        ..spec
    });
    let (run, statistics) = run(&[spec], PREEMPTIVE, &[0, 10, 12, 20, 30], None);
    // Job 1 is due at 10 and waits till 25; its nominal release stays.
    assert_eq!(run.releases(0), [0, 10, 30]);
    assert_eq!(run.record().jobs(DagId(0))[1].released_ns, Some(25));
    assert_eq!(statistics[0].dropped_signals, 2);
    assert_eq!(statistics[0].queued, 2);
}

#[test]
fn s3_skip_and_abort_act_on_sporadic_jobs() {
    for (overrun, skips, aborts) in [(OverrunPolicy::Skip, 1, 0), (OverrunPolicy::Abort, 0, 1)] {
        let mut spec = overrunning(dag(10, 30, 9, &[0, 0], &[(0, 1)]), 1, overrun);
        spec.subtasks[0].wcet_ns = Some(15);
        let (_, statistics) = run(&[sporadic(spec)], PREEMPTIVE, &[0, 10, 40], None);
        assert_eq!((statistics[0].skips, statistics[0].aborts), (skips, aborts));
    }
}

#[test]
fn s3_a_completion_may_signal_at_its_own_instant() {
    let mut sender = dag(20, 20, 3, &[0], &[]);
    sender.subtasks[0].wcet_ns = Some(4);
    let receiver = sporadic(dag(5, 5, 3, &[1], &[]));
    let chained = Some((DagId(0), DagId(1)));
    let (run, _) = run(&[sender, receiver], PREEMPTIVE, &[], chained);
    assert_eq!(run.releases(1), [4, 24, 44]);
}

#[test]
fn s3_the_deadline_counts_from_the_nominal_release() {
    let edf = SchedulerOptions {
        policy: Policy::Edf,
        ..PREEMPTIVE
    };
    let mut spec = dag(10, 3, 4, &[0], &[]);
    spec.subtasks[0].wcet_ns = Some(3);
    let mut long = dag(100, 100, 1, &[0], &[]);
    long.subtasks[0].wcet_ns = Some(50);
    let (run, statistics) = run(&[long, sporadic(spec)], edf, &[1, 2], None);
    // Its deadlines are the earlier ones, so it preempts.
    assert_eq!(run.releases(1), [1, 11]);
    assert_eq!((statistics[1].completed, statistics[1].misses), (2, 0));
}

#[test]
fn s4_signals_beyond_the_limit_are_dropped() {
    let spec = sporadic(dag(10, 10, 1, &[0], &[]));
    let (run, statistics) = run(&[spec], PREEMPTIVE, &[0, 30, 60], None);
    assert_eq!(run.releases(0), [0]);
    assert_eq!(statistics[0].dropped_signals, 2);
}

#[test]
fn s4_without_a_limit_it_keeps_no_run_going() {
    let endless = DagSpec {
        jobs: None,
        ..sporadic(dag(10, 10, 2, &[0], &[]))
    };
    let task_set = commit(&[endless], PREEMPTIVE);
    let mut scheduler = Scheduler::new(task_set, PREEMPTIVE);
    assert!(scheduler.is_finished());
    let mut moment = scheduler.at(7);
    moment.signal(DagId(0), &mut ());
    let started = moment.release_due(&mut ()).dispatch()[0].instance();
    assert!(!scheduler.is_finished());
    let mut moment = scheduler.at(9);
    moment.complete(started, &mut ());
    let _ = moment.release_due(&mut ()).dispatch();
    assert!(scheduler.is_finished());
}

#[test]
fn signals_to_an_ended_dag_are_dropped() {
    let task_set = commit(&[sporadic(dag(10, 10, 9, &[0], &[]))], PREEMPTIVE);
    let mut scheduler = Scheduler::new(task_set, PREEMPTIVE);
    let mut moment = scheduler.at(0);
    moment.stop(DagId(0), &mut ());
    moment.signal(DagId(0), &mut ());
    assert_eq!(moment.release_due(&mut ()).dispatch(), []);
    assert_eq!(scheduler.statistics(DagId(0)).dropped_signals, 1);
}

#[test]
fn the_check_finds_releases_that_are_too_close() {
    let task_set = commit(&[sporadic(dag(10, 10, 2, &[0], &[]))], PREEMPTIVE);
    let mut journal = Recorder::new(Arc::clone(&task_set));
    for (job, release_ns) in [(0, 5), (1, 14)] {
        journal.now_ns = release_ns;
        journal.released(DagId(0), job, release_ns);
    }
    let found = |events: &[Event]| {
        let terms = Terms::whole(u64::MAX);
        violations(&task_set, terms, events.iter().copied())
    };
    let expected = Violation::TooSoon {
        dag: DagId(0),
        job: 1,
        release_ns: 14,
        earliest_ns: 15,
    };
    assert_eq!(found(&journal.events), [expected]);
    let undue = found(&journal.events[1..]);
    assert!(matches!(undue[..], [Violation::NotDue { .. }, ..]));
}

/// The analysis takes a sporadic DAG for a periodic one: its bounds hold for any
/// pattern of signals.
#[test]
fn bounds_hold_for_random_signals() {
    let mut bounded = 0;
    for seed in 0..400 {
        let mut random = Random::new(seed);
        let mut specs = Vec::new();
        for level in 0..3_u32 {
            let period_ns = random.between(20, 80);
            let mut spec = dag(
                period_ns,
                period_ns,
                20,
                &[level; 4],
                &[(0, 1), (0, 2), (1, 3), (2, 3)],
            );
            for subtask in &mut spec.subtasks {
                subtask.wcet_ns = Some(random.between(1, 5));
            }
            spec.in_flight = Some(2);
            specs.push(spec);
        }
        let last = specs.pop().map(sporadic).expect("three");
        specs.insert(0, last); // the sporadic one may outrank or be outranked
        if seed % 2 == 0 {
            specs.rotate_left(1);
        }
        let sporadic_at = usize::from(seed % 2 == 0) * 2;
        let options = SchedulerOptions {
            cores: 2,
            ..PREEMPTIVE
        };
        let task_set = commit(&specs, options);
        let mut at_ns = 0;
        let signals = (0..60).map(|_| {
            at_ns += random.between(0, 40);
            (at_ns, DagId(u32::try_from(sporadic_at).expect("small")))
        });
        let mut run = Run::new(&task_set, signals);
        let mut driver = VirtualTime::new(Scheduler::new(Arc::clone(&task_set), options));
        assert_eq!(driver.run(&mut run), End::Finished, "seed {seed}");
        assert_eq!(run.violations(), [], "seed {seed}");
        let record = run.record();
        let period_ns = task_set.dags()[sporadic_at].period_ns();
        let mut earliest_ns = 0;
        for &(at_ns, release_ns) in &run.arrivals {
            if let Some(release_ns) = release_ns {
                assert_eq!(release_ns, at_ns.max(earliest_ns), "seed {seed}");
                earliest_ns = release_ns + period_ns;
            }
        }
        let settings = Settings {
            policy: options.policy,
            preemption: options.preemption,
            cores: options.cores,
            overheads: Overheads::default(),
        };
        let answer = answer(&task_set, &settings);
        for (dag, bound) in (0..).map(DagId).zip(answer.bounds) {
            let Some(bound_ns) = bound.map(|bound| bound.bound_ns) else {
                continue;
            };
            bounded += 1;
            for job in record.jobs(dag) {
                if let (Some(release_ns), Some(ended_ns)) = (job.release_ns, job.ended_ns) {
                    assert!(ended_ns - release_ns <= bound_ns, "seed {seed}");
                }
            }
        }
    }
    assert!(bounded > 400, "{bounded} bounds were compared");
}
