//! The rules C1 to C5: a DAG that comes to its end.

mod support;

use std::fmt::Write;

use sched_dag::{
    Activation, DagId, DagSpec, Decision, Instance, JobOutcome, Moment, Observer, OverrunPolicy,
    Scheduler,
};
use support::{PREEMPTIVE, dag, overrunning, scheduler};

const DAG: DagId = DagId(0);

/// What was reported since it was last asked.
#[derive(Default)]
struct Log(String);

impl Log {
    fn note(&mut self, what: &str, job: u64) {
        // Writing into a `String` cannot fail.
        let _ = write!(self.0, "{what} {job}, ");
    }
}

impl Observer for Log {
    fn released(&mut self, _: DagId, job: u64, _: u64) {
        self.note("released", job);
    }

    fn skipped(&mut self, _: DagId, job: u64, _: u64) {
        self.note("skipped", job);
    }

    fn deadline_missed(&mut self, _: DagId, job: u64, _: u64) {
        self.note("missed", job);
    }

    fn job_completed(&mut self, _: DagId, job: u64, outcome: JobOutcome) {
        self.note(&format!("{outcome:?}"), job);
    }

    fn closed(&mut self, _: DagId) {
        self.0.push_str("closed, ");
    }

    fn ended(&mut self, _: DagId) {
        self.0.push_str("ended, ");
    }

    fn switched_off(&mut self, _: DagId) {
        self.0.push_str("off, ");
    }

    fn switched_on(&mut self, _: DagId) {
        self.0.push_str("on, ");
    }
}

/// A scheduler of one DAG of one subtask on one core.
struct Bench {
    scheduler: Scheduler,
    running: Option<Instance>,
}

impl Bench {
    fn new(spec: DagSpec) -> Bench {
        Bench {
            scheduler: scheduler(&[spec], PREEMPTIVE),
            running: None,
        }
    }

    /// Goes through an instant and returns what was reported.
    fn at(&mut self, now_ns: u64, what: impl FnOnce(&mut Moment<'_>, &mut Log)) -> String {
        let mut log = Log::default();
        let mut moment = self.scheduler.at(now_ns);
        what(&mut moment, &mut log);
        for decision in moment.release_due(&mut log).dispatch() {
            if let Decision::Start { instance, .. } = decision {
                self.running = Some(*instance);
            }
        }
        log.0.trim_end_matches(", ").into()
    }

    fn time(&mut self, now_ns: u64) -> String {
        self.at(now_ns, |_, _| {})
    }

    fn close(&mut self, now_ns: u64) -> String {
        self.at(now_ns, |moment, log| moment.close(DAG, log))
    }

    fn complete(&mut self, now_ns: u64) -> String {
        let instance = self.running.take().expect("an instance runs");
        self.at(now_ns, |moment, log| moment.complete(instance, log))
    }
}

/// A job every 100 ns without end, due within 250 ns, at most one in flight.
fn spec() -> DagSpec {
    let spec = DagSpec {
        jobs: None,
        ..dag(100, 250, 1, &[1], &[])
    };
    overrunning(spec, 1, OverrunPolicy::Queue)
}

fn sporadic() -> DagSpec {
    DagSpec {
        activation: Activation::Sporadic,
        ..spec()
    }
}

#[test]
fn c1_a_closed_dag_releases_nothing_at_the_instant_of_a_release_neither() {
    let mut bench = Bench::new(spec());
    assert_eq!(bench.time(0), "released 0");
    assert_eq!(bench.complete(10), "Met 0");
    assert_eq!(bench.close(100), "closed");
    assert_eq!(bench.scheduler.next_event_ns(), None);
    assert_eq!(bench.time(500), "");
    let statistics = bench.scheduler.statistics(DAG);
    assert_eq!((statistics.released, statistics.skips), (1, 0));
}

#[test]
fn c1_a_kept_signal_is_forgotten() {
    let mut bench = Bench::new(sporadic());
    let signal = |moment: &mut Moment<'_>, log: &mut Log| moment.signal(DAG, log);
    assert_eq!(bench.at(5, signal), "released 0");
    assert_eq!(bench.complete(10), "Met 0");
    assert_eq!(bench.at(20, signal), "", "it is due at 105");
    assert_eq!(bench.close(30), "closed");
    assert_eq!(bench.time(200), "");
    assert!(bench.scheduler.is_finished());
}

#[test]
fn c2_what_waits_is_skipped_at_the_closing() {
    let mut bench = Bench::new(spec());
    bench.time(0);
    bench.time(200);
    assert_eq!(bench.scheduler.waiting(DAG), 2);
    assert_eq!(bench.close(240), "closed, skipped 1, skipped 2");
    assert_eq!(bench.complete(250), "Met 0");
    assert!(bench.scheduler.is_finished());
}

#[test]
fn c3_what_is_in_flight_ends_and_may_be_late() {
    let mut bench = Bench::new(spec());
    bench.time(0);
    assert_eq!(bench.close(50), "closed");
    assert!(!bench.scheduler.is_finished());
    assert_eq!(bench.scheduler.next_event_ns(), Some(251));
    assert_eq!(bench.time(251), "missed 0");
    assert_eq!(bench.complete(260), "Missed 0");
}

#[test]
fn c4_a_closed_dag_is_over_when_nothing_is_in_flight() {
    let mut bench = Bench::new(spec());
    bench.time(0);
    bench.close(50);
    assert!(!bench.scheduler.is_over(DAG));
    bench.complete(60);
    assert!(bench.scheduler.is_over(DAG) && !bench.scheduler.is_ended(DAG));

    let mut bench = Bench::new(sporadic());
    bench.close(5);
    let signal = |moment: &mut Moment<'_>, log: &mut Log| moment.signal(DAG, log);
    assert_eq!(bench.at(7, signal), "");
    let statistics = bench.scheduler.statistics(DAG);
    assert_eq!((statistics.signals, statistics.dropped_signals), (1, 1));
    assert!(bench.scheduler.is_over(DAG));
}

#[test]
fn c5_a_closed_dag_is_neither_paused_nor_resumed_and_faults_end_it() {
    let mut bench = Bench::new(spec());
    bench.time(0);
    let pause = |moment: &mut Moment<'_>, log: &mut Log| moment.pause(DAG, log);
    let resume = |moment: &mut Moment<'_>, log: &mut Log| moment.resume(DAG, log);
    assert_eq!(bench.at(20, pause), "off");
    assert_eq!(bench.close(50), "closed");
    assert_eq!(bench.close(51), "", "once");
    assert_eq!(bench.at(52, pause), "");
    assert_eq!(bench.at(53, resume), "");
    let instance = bench.running.take().expect("job 0 runs");
    let fail = |moment: &mut Moment<'_>, log: &mut Log| moment.fail(instance, log);
    assert_eq!(bench.at(60, fail), "ended, DagEnded 0");
    assert!(bench.scheduler.is_ended(DAG) && bench.scheduler.is_finished());
}
