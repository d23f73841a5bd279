//! The rules M1 to M7: modes, in virtual time. `reading.rs` holds random ones against the rules.

mod reading;
#[path = "../support/mod.rs"]
mod support;

use sched_dag::journal::What;
use sched_dag::lifecycle::{Changes, Entry, Lifecycle, Request};
use sched_dag::virtual_time::VirtualTime;
use sched_dag::{DagId, DagSpec, ModeId};
use support::{Run, Script, TWO_CORES, Takes, dag, line, scheduler, told};

/// Runs all jobs of DAGs on two cores.
fn run(specs: &[DagSpec], lifecycle: Changes, script: Script<'_, impl Takes>) -> Run {
    let driver = VirtualTime::new(scheduler(specs, TWO_CORES));
    let run = script.run(driver.with_lifecycle(Some(Box::new(lifecycle))));
    assert!(run.driver.is_finished());
    run
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

/// Two DAGs, each a mode of its own.
fn of_two() -> Changes {
    Changes::new(2, false).with_modes(modes(&[&[0], &[1]]))
}

/// Runs two DAGs of four jobs, whose jobs take so long, and holds against the text what is released
/// and changed from its first instant to its last one.
#[track_caller]
fn two(requests: &[(u64, Request)], takes_ns: u64, expected: &str) {
    let script = Script::new(takes_ns).asking(requests.iter().copied());
    must_be(&run(&[ticking(4), ticking(4)], of_two(), script), expected);
}

#[track_caller]
fn must_be(run: &Run, text: &str) {
    let lines = text.lines().map(line);
    let timed = |(time_ns, _, events): (Option<u64>, _, Vec<_>)| {
        let time_ns = time_ns.expect("each line has a time");
        events
            .into_iter()
            .map(move |event: &str| (time_ns, event.to_owned()))
    };
    let expected: Vec<_> = lines.flat_map(timed).collect();
    let is_meant = |what| {
        use What::{Entered, Off, On, Released, Skipped};
        [Released, Skipped, Off, On, Entered].contains(&what)
    };
    let mut happened = told(run.events.iter().filter(|event| is_meant(event.what)));
    let time = |text: Option<&str>| text.and_then(|text| line(text).0).expect("a time");
    let (first, last) = (time(text.lines().next()), time(text.lines().last()));
    happened.retain(|(time_ns, _)| (first..=last).contains(time_ns));
    // In which order the scheduler releases what is due at one instant means nothing.
    let release = |event: &str| event.split_once("ed ").map(|(_, job)| job.to_owned());
    let is_release = |event: &str| release(event).is_some() && !event.starts_with("entered");
    let at_once = happened.chunk_by_mut(|a, b| a.0 == b.0 && is_release(&a.1) && is_release(&b.1));
    at_once.for_each(|releases| releases.sort_by_key(|(_, event)| release(event)));
    assert_eq!(happened, expected);
}

#[test]
fn m1_of_a_mode_its_dags_are_on_and_those_in_no_mode_always() {
    let lifecycle = Changes::new(4, false).with_modes(modes(&[&[0, 1], &[1, 2]]));
    let script = Script::new(10).asking([(150, enter(1, Entry::AtOnce))]);
    must_be(
        &run(&[const { 3 }; 4].map(ticking), lifecycle, script),
        "0 off 2, entered 0, released 0.0, released 1.0, skipped 2.0, released 3.0
         100 released 0.1, released 1.1, skipped 2.1, released 3.1
         150 off 0, on 2, entered 1
         200 skipped 0.2, released 1.2, released 2.2, released 3.2",
    );
}

#[test]
fn m2_at_once_means_at_the_request_and_at_its_releases() {
    // Job 1 is in flight until 300, next to job 2 of the other DAG.
    let request = [(200, enter(1, Entry::AtOnce))];
    two(
        &request,
        150,
        "200 off 0, on 1, entered 1, skipped 0.2, released 1.2",
    );
}

#[test]
fn m3_when_idle_waits_for_what_leaves_and_comes_before_the_releases_of_the_instant() {
    let request = [(130, enter(1, Entry::WhenIdle))];
    // Job 1 of DAG 0 begins after job 0 and ends at 260, when nothing else happens.
    let expected = "130 off 0
         200 skipped 0.2, skipped 1.2
         260 on 1, entered 1
         300 skipped 0.3, released 1.3";
    two(&request, 130, expected);
    // It ends at 200, at the very release of job 2.
    two(
        &request,
        100,
        "130 off 0\n200 on 1, entered 1, skipped 0.2, released 1.2",
    );
    // None is in flight.
    two(
        &request,
        20,
        "130 off 0, on 1, entered 1\n200 skipped 0.2, released 1.2",
    );
}

#[test]
fn m4_the_last_request_counts() {
    let (back, away) = (enter(0, Entry::WhenIdle), enter(1, Entry::WhenIdle));
    // Nothing of DAG 1 is in flight, so DAG 0 is on again at once.
    let expected = "130 off 0\n140 on 0, entered 0\n200 released 0.2, skipped 1.2";
    two(&[(130, away), (140, back)], 130, expected);
    let at_once = enter(1, Entry::AtOnce);
    let expected = "130 off 0\n140 on 1, entered 1\n200 skipped 0.2, released 1.2";
    two(&[(130, away), (140, at_once)], 130, expected);
    // The mode that is there.
    two(
        &[(130, back)],
        130,
        "130 entered 0\n200 released 0.2, skipped 1.2",
    );
}

#[test]
fn m5_a_persons_changes_last_until_a_mode_is_entered() {
    let requests = [
        (110, Request::Pause(DagId(0))),
        (120, Request::Resume(DagId(1))),
        (210, enter(0, Entry::AtOnce)),
    ];
    let expected = "110 off 0
         120 on 1
         200 skipped 0.2, released 1.2
         210 off 1, on 0, entered 0
         300 released 0.3, skipped 1.3";
    two(&requests, 10, expected);
    // Also one that is resumed while the mode waits.
    let requests = [
        (130, enter(1, Entry::WhenIdle)),
        (140, Request::Resume(DagId(0))),
    ];
    two(
        &requests,
        60,
        "130 off 0\n140 on 0\n160 off 0, on 1, entered 1",
    );
}

#[test]
fn m6_an_ended_dag_keeps_no_mode_waiting_and_after_a_shutdown_none_is_entered() {
    let script = Script::new(50).asking([(110, enter(1, Entry::WhenIdle))]);
    let script = script.failing(|it| it == support::instance(0, 1, 0));
    let run = run(&[ticking(4), ticking(4)], of_two(), script);
    must_be(&run, "110 off 0\n150 on 1, entered 1\n200 released 1.2");
    for entry in [Entry::WhenIdle, Entry::AtOnce] {
        let requests = [
            (110, enter(1, Entry::WhenIdle)),
            (120, Request::ShutDown),
            (130, enter(1, entry)),
        ];
        two(&requests, 50, "110 off 0\n400");
    }
}

#[test]
fn m7_a_dag_that_is_left_alone_is_neither_paused_nor_waited_for() {
    let mut lifecycle = Changes::new(2, true).with_modes(modes(&[&[0], &[1]]));
    lifecycle.leave_alone(DagId(0));
    let requests = [(110, enter(1, Entry::WhenIdle)), (250, Request::ShutDown)];
    let script = Script::new(50).asking(requests);
    must_be(
        &run(&[ticking(4), ticking(4)], lifecycle, script),
        "0 off 1, entered 0, released 0.0, skipped 1.0
         100 released 0.1, skipped 1.1
         110 on 1, entered 1
         200 released 0.2, released 1.2
         300 released 0.3",
    );
}
