//! Modes, in virtual time: random sets of DAGs, modes and requests, against a second reading of the
//! rules M1 to M5: sets of bits, told what is released and completed. `tests/scenarios/modes.txt`
//! tells each of M1 to M6 apart.

use std::collections::BTreeSet;

use random::Random;
use sched_dag::journal::{Event, EventKind};
use sched_dag::lifecycle::{Lifecycle, LifecyclePlan, ModeEntry, Request};
use sched_dag::{DagId, DagSpec, ModeId};

use crate::support::{Run, Script, Spec, TWO_CORES, Takes, dag, driver, number};

/// Runs all jobs of DAGs on two cores.
fn run(specs: &[DagSpec], lifecycle: LifecyclePlan, script: Script<'_, impl Takes>) -> Run {
    let in_virtual_time = driver(specs, TWO_CORES);
    let driver = in_virtual_time.with_lifecycle(Some(Box::new(lifecycle)));
    let run = script.run(driver.expect("there is one cluster"));
    assert!(run.driver.is_finished());
    run
}

fn enter(mode: u32, entry: ModeEntry) -> Request {
    Request::Enter(ModeId(mode), entry)
}

#[test]
fn m7_a_dag_that_is_left_alone_is_neither_paused_nor_waited_for() {
    let ticking = || dag(100, 300, 4, &[1], &[]);
    let modes = vec![vec![DagId(0)], vec![DagId(1)]];
    let mut lifecycle = LifecyclePlan::new(2, true).with_modes(modes);
    lifecycle.leave_alone(DagId(0));
    let requests = [
        (110, enter(1, ModeEntry::WhenIdle)),
        (250, Request::ShutDown),
    ];
    let script = Script::new(50).asking(requests);
    run(&[ticking(), ticking()], lifecycle, script).must_be(
        "0 off 1, entered 0, skipped 1.0
         100 skipped 1.1
         110 on 1, entered 1
         released=4, released@1=1",
    );
}

/// A change, and of which DAG or to which mode.
type Change = (EventKind, u32);

struct Rules {
    modes: Vec<u32>,
    is_off: u32,
    in_flight: [u32; 8],
    pending: Option<usize>,
}

impl Rules {
    fn all(&self) -> u32 {
        self.modes.iter().fold(0, |all, mode| all | mode)
    }

    /// Turns those DAGs on or off that are not, and says so.
    fn turn(&mut self, what: EventKind, dags: u32, said: &mut Vec<Change>) {
        let turning = match what {
            EventKind::Off => dags & !self.is_off,
            _ => dags & self.is_off,
        };
        self.is_off ^= turning;
        said.extend(listed(turning).into_iter().map(|dag| (what, dag.0)));
    }

    fn look(&mut self, at_once: bool, said: &mut Vec<Change>) {
        let Some(mode) = self.pending else { return };
        let leaving = self.all() & !self.modes[mode];
        let is_idle = (0..8).all(|dag| leaving & (1 << dag) == 0 || self.in_flight[dag] == 0);
        if at_once || is_idle {
            self.turn(EventKind::Off, leaving, said);
            self.turn(EventKind::On, self.modes[mode], said);
            said.push((EventKind::Entered, u32::try_from(mode).expect("few modes")));
            self.pending = None;
        }
    }

    fn ask(&mut self, request: Request, said: &mut Vec<Change>) {
        match request {
            Request::Enter(mode, entry) => {
                self.pending = Some(mode.index());
                self.turn(EventKind::Off, self.all() & !self.modes[mode.index()], said);
                self.look(entry == ModeEntry::AtOnce, said);
            }
            Request::Pause(dag) => self.turn(EventKind::Off, 1 << dag.0, said),
            Request::Resume(dag) => self.turn(EventKind::On, 1 << dag.0, said),
            _ => unreachable!("not asked for"),
        }
    }
}

/// Holds a run against the rules, instant by instant: what completes comes first, then what is
/// asked for, then what is released.
fn compare(run: &Run, requests: &[(u64, Request)], mut rules: Rules) {
    let is_change = |what| matches!(what, EventKind::Off | EventKind::On | EventKind::Entered);
    let is_release = |what| matches!(what, EventKind::Released | EventKind::Skipped);
    let of_events = run.events.iter().map(|event| event.time_ns);
    let times_ns = of_events.chain(requests.iter().map(|(at_ns, _)| *at_ns));
    let times_ns: BTreeSet<u64> = times_ns.collect();
    let mut expected = Vec::new();
    rules.ask(enter(0, ModeEntry::AtOnce), &mut expected);
    for now_ns in times_ns {
        let here = run.events.iter().filter(|event| event.time_ns == now_ns);
        let is_end = |event: &&Event| event.what == EventKind::Completed;
        let completed = here.clone().filter(is_end);
        completed.for_each(|event| rules.in_flight[event.dag.index()] -= 1);
        let mut from_change = here.clone().skip_while(|event| !is_change(event.what));
        assert!(!from_change.any(|event| is_end(&event)), "at {now_ns}");
        rules.look(false, &mut expected);
        for (_, request) in requests.iter().filter(|(at_ns, _)| *at_ns == now_ns) {
            rules.ask(*request, &mut expected);
        }
        let told = here.filter(|event| is_change(event.what) || is_release(event.what));
        let (changes, releases): (Vec<&Event>, Vec<&Event>) =
            told.clone().partition(|event| is_change(event.what));
        assert!(told.is_sorted_by_key(|event| is_release(event.what)));
        let changed = changes.iter().map(|event| match event.what {
            EventKind::Entered => (event.what, u32::try_from(event.job).expect("few modes")),
            what => (what, event.dag.0),
        });
        let changed: Vec<Change> = changed.collect();
        assert_eq!(changed, std::mem::take(&mut expected), "at {now_ns}");
        for event in releases {
            let is_off = rules.is_off & (1 << event.dag.0) != 0;
            assert_eq!(is_off, event.what == EventKind::Skipped, "{event:?}");
            rules.in_flight[event.dag.index()] += u32::from(!is_off);
        }
    }
}

/// Returns the DAGs whose bits are set.
fn listed(bits: u32) -> Vec<DagId> {
    let is_set = |dag: &u32| bits & (1 << dag) != 0;
    (0..8).filter(is_set).map(DagId).collect()
}

/// Returns requests in the order of their times.
fn requests(random: &mut Random, dags: u32, modes: u32) -> Vec<(u64, Request)> {
    let mut at_ns = 1;
    let mut request = |_| {
        at_ns += random.within(0..=60);
        let mode = random.within(0..=modes - 1);
        let dag = DagId(random.within(0..=dags - 1));
        let request = match random.within(0..=9) {
            0 => Request::Pause(dag),
            1 => Request::Resume(dag),
            2..=4 => enter(mode, ModeEntry::AtOnce),
            _ => enter(mode, ModeEntry::WhenIdle),
        };
        (at_ns, request)
    };
    (0..8).map(&mut request).collect()
}

#[test]
fn random_modes_are_entered_as_the_rules_say() {
    let (sets, first) = (number("SCHED_DAG_SETS", 400), number("SCHED_DAG_SEED", 1));
    let mut entered = 0;
    for seed in first..first + sets {
        println!("SCHED_DAG_SEED={seed}");
        let mut random = Random::new(seed);
        let dags = random.within(1..=5);
        let specs = (0..dags).map(|_| {
            let (period_ns, jobs) = (random.within(20..=60), random.within(1..=20));
            dag(period_ns, 1000, jobs, &[1], &[]).offset(random.within(0..=40))
        });
        let specs: Vec<DagSpec> = specs.collect();
        let count = random.within(1..=4);
        let modes: Vec<u32> = (0..count)
            .map(|_| random.within(1..=(1 << dags) - 1))
            .collect();
        let requests = requests(&mut random, dags, count);
        let lists = modes.iter().copied().map(listed).collect();
        let lifecycle = LifecyclePlan::new(dags, false).with_modes(lists);
        let script = Script::new(|_| random.within(1..=70)).asking(requests.iter().copied());
        let run = run(&specs, lifecycle, script);
        let events = run.events.iter();
        entered += events
            .filter(|event| event.what == EventKind::Entered)
            .count();
        let rules = Rules {
            modes,
            is_off: 0,
            in_flight: [0; 8],
            pending: None,
        };
        compare(&run, &requests, rules);
    }
    assert!(entered as u64 > 2 * sets, "{entered}");
}
