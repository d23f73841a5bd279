//! The rules M1 to M7: modes, in virtual time. `reading.rs` holds random ones against the rules.

mod reading;
#[path = "../support/mod.rs"]
mod support;

use std::collections::VecDeque;

use sched_dag::lifecycle::{Changes, Entry, Lifecycle, Request};
use sched_dag::virtual_time::{End, VirtualTime, Workload};
use sched_dag::{DagId, DagSpec, Instance, JobOutcome, ModeId, Observer};
use support::{TWO_CORES, dag, scheduler};

/// What is reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Said {
    Released(u32),
    Skipped(u32),
    Completed(u32),
    Off(u32),
    On(u32),
    Entered(u32),
    /// A request is served.
    Asked(Request),
}

/// Requests at their times, and what comes of them.
struct Script {
    requests: VecDeque<(u64, Request)>,
    /// How long each job takes, in turn.
    execution_ns: Box<dyn FnMut(Instance) -> u64>,
    fails: Option<Instance>,
    now_ns: u64,
    said: Vec<(u64, Said)>,
}

impl Script {
    fn new(
        requests: &[(u64, Request)],
        execution_ns: impl FnMut(Instance) -> u64 + 'static,
    ) -> Self {
        Self {
            requests: requests.iter().copied().collect(),
            execution_ns: Box::new(execution_ns),
            fails: None,
            now_ns: 0,
            said: Vec::new(),
        }
    }

    fn say(&mut self, said: Said) {
        self.said.push((self.now_ns, said));
    }

    /// Runs all jobs of DAGs on two cores.
    fn run(&mut self, specs: &[DagSpec], lifecycle: Changes) {
        let driver = VirtualTime::new(scheduler(specs, TWO_CORES));
        let mut driver = driver.with_lifecycle(Some(Box::new(lifecycle)));
        assert_eq!(driver.run(self), End::Finished);
        assert!(driver.is_finished());
    }

    /// What was said of changes and releases, in words.
    fn words(&self) -> Vec<String> {
        let is_told = |(_, said): &&_| !matches!(said, Said::Completed(_) | Said::Asked(_));
        let mut told: Vec<(u64, Said)> = self.said.iter().filter(is_told).copied().collect();
        // In which order the scheduler releases what is due at one instant means nothing.
        let dag = |said| match said {
            Said::Released(dag) | Said::Skipped(dag) => Some(dag),
            _ => None,
        };
        let are_of_one = |a: &(u64, Said), b: &(u64, Said)| {
            a.0 == b.0 && dag(a.1).is_some() && dag(b.1).is_some()
        };
        let of_one = told.chunk_by_mut(are_of_one);
        of_one.for_each(|releases| releases.sort_by_key(|(_, said)| dag(*said)));
        let words = told
            .iter()
            .map(|(time_ns, said)| format!("{time_ns} {said:?}"));
        words.collect()
    }
}

impl Observer for Script {
    fn released(&mut self, dag: DagId, _: u64, _: u64) {
        self.say(Said::Released(dag.0));
    }

    fn skipped(&mut self, dag: DagId, _: u64, _: u64) {
        self.say(Said::Skipped(dag.0));
    }

    fn job_completed(&mut self, dag: DagId, _: u64, _: JobOutcome) {
        self.say(Said::Completed(dag.0));
    }

    fn switched_off(&mut self, dag: DagId) {
        self.say(Said::Off(dag.0));
    }

    fn switched_on(&mut self, dag: DagId) {
        self.say(Said::On(dag.0));
    }

    fn entered(&mut self, mode: ModeId) {
        self.say(Said::Entered(mode.0));
    }
}

impl Workload for Script {
    const WANTED: &'static [sched_dag::journal::What] = sched_dag::told::ALL;

    fn heard(&mut self, news: &sched_dag::News) {
        sched_dag::told::tell(news, self);
    }

    fn execute(&mut self, instance: Instance, _: u64) -> u64 {
        (self.execution_ns)(instance)
    }

    fn fails(&mut self, instance: Instance) -> bool {
        self.fails == Some(instance)
    }

    fn instant(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
    }

    fn next_signal_ns(&self) -> Option<u64> {
        self.requests.front().map(|(at_ns, _)| *at_ns)
    }

    fn take_request(&mut self, now_ns: u64) -> Option<Request> {
        self.next_signal_ns().filter(|at_ns| *at_ns <= now_ns)?;
        let (_, request) = self.requests.pop_front()?;
        self.say(Said::Asked(request));
        Some(request)
    }
}

/// A DAG of one subtask every 100 ns, of so many jobs.
fn ticking(jobs: u64) -> DagSpec {
    dag(100, 300, jobs, &[1], &[])
}

fn modes(of: &[&[u32]]) -> Vec<Vec<DagId>> {
    let ids = |dags: &&[u32]| dags.iter().copied().map(DagId).collect();
    of.iter().map(ids).collect()
}

fn enter(mode: u32, entry: Entry) -> Request {
    Request::Enter(ModeId(mode), entry)
}

/// Runs two DAGs of four jobs, each a mode of its own, whose jobs take so long, and returns what
/// happens from a time on.
fn two(requests: &[(u64, Request)], takes_ns: u64, from_ns: u64) -> Vec<String> {
    let mut script = Script::new(requests, move |_| takes_ns);
    let lifecycle = Changes::new(2, false).with_modes(modes(&[&[0], &[1]]));
    script.run(&[ticking(4), ticking(4)], lifecycle);
    script.said.retain(|(time_ns, _)| *time_ns >= from_ns);
    script.words()
}

#[test]
fn m1_of_a_mode_its_dags_are_on_and_those_in_no_mode_always() {
    let requests = [(150, enter(1, Entry::AtOnce))];
    let mut script = Script::new(&requests, |_| 10);
    let lifecycle = Changes::new(4, false).with_modes(modes(&[&[0, 1], &[1, 2]]));
    script.run(&[const { 3 }; 4].map(ticking), lifecycle);
    assert_eq!(
        script.words(),
        [
            "0 Off(2)",
            "0 Entered(0)",
            "0 Released(0)",
            "0 Released(1)",
            "0 Skipped(2)",
            "0 Released(3)",
            "100 Released(0)",
            "100 Released(1)",
            "100 Skipped(2)",
            "100 Released(3)",
            "150 Off(0)",
            "150 On(2)",
            "150 Entered(1)",
            "200 Skipped(0)",
            "200 Released(1)",
            "200 Released(2)",
            "200 Released(3)"
        ]
    );
}

#[test]
fn m2_at_once_means_at_the_request_and_at_its_releases() {
    let expected = [
        "200 Off(0)",
        "200 On(1)",
        "200 Entered(1)",
        "200 Skipped(0)",
        "200 Released(1)",
    ];
    let request = [(200, enter(1, Entry::AtOnce))];
    // Job 1 is in flight until 300, next to job 2 of the other DAG.
    assert_eq!(two(&request, 150, 200)[..5], expected);
}

#[test]
fn m3_when_idle_waits_for_what_leaves_and_comes_before_the_releases_of_the_instant() {
    let request = [(130, enter(1, Entry::WhenIdle))];
    // Job 1 of DAG 0 begins after job 0 and ends at 260, when nothing else happens.
    let expected = [
        "130 Off(0)",
        "200 Skipped(0)",
        "200 Skipped(1)",
        "260 On(1)",
        "260 Entered(1)",
        "300 Skipped(0)",
        "300 Released(1)",
    ];
    assert_eq!(two(&request, 130, 130), expected);
    // It ends at 200, at the very release of job 2.
    let expected = [
        "130 Off(0)",
        "200 On(1)",
        "200 Entered(1)",
        "200 Skipped(0)",
        "200 Released(1)",
    ];
    assert_eq!(two(&request, 100, 130)[..5], expected);
    // None is in flight.
    let expected = [
        "130 Off(0)",
        "130 On(1)",
        "130 Entered(1)",
        "200 Skipped(0)",
        "200 Released(1)",
    ];
    assert_eq!(two(&request, 20, 130)[..5], expected);
}

#[test]
fn m4_the_last_request_counts() {
    let (back, away) = (enter(0, Entry::WhenIdle), enter(1, Entry::WhenIdle));
    // Nothing of DAG 1 is in flight, so DAG 0 is on again at once.
    let expected = [
        "130 Off(0)",
        "140 On(0)",
        "140 Entered(0)",
        "200 Released(0)",
    ];
    assert_eq!(two(&[(130, away), (140, back)], 130, 130)[..4], expected);
    let at_once = enter(1, Entry::AtOnce);
    let expected = [
        "130 Off(0)",
        "140 On(1)",
        "140 Entered(1)",
        "200 Skipped(0)",
    ];
    assert_eq!(two(&[(130, away), (140, at_once)], 130, 130)[..4], expected);
    // The mode that is there.
    let expected = ["130 Entered(0)", "200 Released(0)"];
    assert_eq!(two(&[(130, back)], 130, 130)[..2], expected);
}

#[test]
fn m5_a_persons_changes_last_until_a_mode_is_entered() {
    let requests = [
        (110, Request::Pause(DagId(0))),
        (120, Request::Resume(DagId(1))),
        (210, enter(0, Entry::AtOnce)),
    ];
    let expected = [
        "110 Off(0)",
        "120 On(1)",
        "200 Skipped(0)",
        "200 Released(1)",
        "210 Off(1)",
        "210 On(0)",
        "210 Entered(0)",
        "300 Released(0)",
        "300 Skipped(1)",
    ];
    assert_eq!(two(&requests, 10, 110), expected);

    // Also one that is resumed while the mode waits.
    let requests = [
        (130, enter(1, Entry::WhenIdle)),
        (140, Request::Resume(DagId(0))),
    ];
    let expected = [
        "130 Off(0)",
        "140 On(0)",
        "160 Off(0)",
        "160 On(1)",
        "160 Entered(1)",
    ];
    assert_eq!(two(&requests, 60, 130)[..5], expected);
}

#[test]
fn m6_an_ended_dag_keeps_no_mode_waiting_and_after_a_shutdown_none_is_entered() {
    let mut script = Script::new(&[(110, enter(1, Entry::WhenIdle))], |_| 50);
    script.fails = Some(support::instance(0, 1, 0));
    let lifecycle = Changes::new(2, false).with_modes(modes(&[&[0], &[1]]));
    script.run(&[ticking(4), ticking(4)], lifecycle);
    let words = script.words();
    let entered = [
        "110 Off(0)",
        "150 On(1)",
        "150 Entered(1)",
        "200 Released(1)",
    ];
    assert_eq!(words[words.len() - 5..][..4], entered);

    for entry in [Entry::WhenIdle, Entry::AtOnce] {
        let requests = [
            (110, enter(1, Entry::WhenIdle)),
            (120, Request::ShutDown),
            (130, enter(1, entry)),
        ];
        assert_eq!(two(&requests, 50, 110), ["110 Off(0)"]);
    }
}

#[test]
fn m7_a_dag_that_is_left_alone_is_neither_paused_nor_waited_for() {
    let mut lifecycle = Changes::new(2, true).with_modes(modes(&[&[0], &[1]]));
    lifecycle.leave_alone(DagId(0));
    let requests = [(110, enter(1, Entry::WhenIdle)), (250, Request::ShutDown)];
    let mut script = Script::new(&requests, |_| 50);
    script.run(&[ticking(4), ticking(4)], lifecycle);
    let of_0 = script.words();
    let of_0 = of_0
        .iter()
        .filter(|word| word.ends_with("(0)") && !word.contains("Entered"));
    let expected = [
        "0 Released(0)",
        "100 Released(0)",
        "200 Released(0)",
        "300 Released(0)",
    ];
    assert_eq!(of_0.collect::<Vec<_>>(), expected);
    assert!(script.words().contains(&"110 Entered(1)".into()));
}
