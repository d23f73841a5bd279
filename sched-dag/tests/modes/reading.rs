//! Random sets of DAGs, modes and requests, against a second reading of the rules: sets of bits,
//! told what is released and completed.

use std::collections::VecDeque;

use sched_dag::lifecycle::{Changes, Entry, Request};
use sched_dag::{DagId, DagSpec};

use super::support::dag;
use super::support::random::Random;
use super::{Said, Script, enter};

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

    fn off(&mut self, dags: u32, said: &mut Vec<Said>) {
        let news = (0..8).filter(|dag| dags & !self.is_off & (1 << dag) != 0);
        said.extend(news.map(Said::Off));
        self.is_off |= dags;
    }

    fn on(&mut self, dags: u32, said: &mut Vec<Said>) {
        let news = (0..8).filter(|dag| dags & self.is_off & (1 << dag) != 0);
        said.extend(news.map(Said::On));
        self.is_off &= !dags;
    }

    fn look(&mut self, at_once: bool, said: &mut Vec<Said>) {
        let Some(mode) = self.pending else { return };
        let leaving = self.all() & !self.modes[mode];
        let is_idle = (0..8).all(|dag| leaving & (1 << dag) == 0 || self.in_flight[dag] == 0);
        if at_once || is_idle {
            self.off(leaving, said);
            self.on(self.modes[mode], said);
            said.push(Said::Entered(u32::try_from(mode).expect("few modes")));
            self.pending = None;
        }
    }

    fn ask(&mut self, request: Request, said: &mut Vec<Said>) {
        match request {
            Request::Enter(mode, entry) => {
                self.pending = Some(mode.index());
                self.off(self.all() & !self.modes[mode.index()], said);
                self.look(entry == Entry::AtOnce, said);
            }
            Request::Pause(dag) => self.off(1 << dag.0, said),
            Request::Resume(dag) => self.on(1 << dag.0, said),
            _ => unreachable!("not asked for"),
        }
    }
}

/// Holds what was said against the rules.
fn compare(said: &[(u64, Said)], mut rules: Rules) {
    let mut expected: VecDeque<Said> = VecDeque::new();
    let mut is_first = true;
    for &(time_ns, said) in said {
        let mut news = Vec::new();
        match said {
            Said::Off(_) | Said::On(_) | Said::Entered(_) => {
                if std::mem::take(&mut is_first) {
                    rules.ask(enter(0, Entry::AtOnce), &mut news);
                    expected.extend(news.drain(..));
                }
                assert_eq!(expected.pop_front(), Some(said), "at {time_ns}");
                continue;
            }
            Said::Asked(request) => rules.ask(request, &mut news),
            Said::Completed(dag) => {
                rules.in_flight[dag as usize] -= 1;
                rules.look(false, &mut news);
            }
            Said::Released(dag) | Said::Skipped(dag) => {
                assert_eq!(expected, [], "before the releases at {time_ns}");
                let is_off = rules.is_off & (1 << dag) != 0;
                assert_eq!(is_off, said == Said::Skipped(dag), "{said:?} at {time_ns}");
                rules.in_flight[dag as usize] += u32::from(!is_off);
            }
        }
        expected.extend(news);
    }
    assert_eq!(expected, []);
}

/// Returns the DAGs whose bits are set.
fn listed(bits: u32) -> Vec<DagId> {
    let is_set = |dag: &u32| bits & (1 << dag) != 0;
    (0..8).filter(is_set).map(DagId).collect()
}

/// Returns requests in the order of their times.
fn requests(random: &mut Random, dags: u32, modes: usize) -> Vec<(u64, Request)> {
    let mut at_ns = 1;
    let mut request = |_| {
        at_ns += random.between(0, 60);
        let mode = u32::try_from(random.below(modes)).expect("few");
        let dag = DagId(u32::try_from(random.below(dags as usize)).expect("few"));
        let request = match random.between(0, 9) {
            0 => Request::Pause(dag),
            1 => Request::Resume(dag),
            2..=4 => enter(mode, Entry::AtOnce),
            _ => enter(mode, Entry::WhenIdle),
        };
        (at_ns, request)
    };
    (0..8).map(&mut request).collect()
}

#[test]
fn random_modes_are_entered_as_the_rules_say() {
    let sets = std::env::var("SCHED_DAG_SETS").map_or(400, |sets| sets.parse().expect("a number"));
    let first = std::env::var("SCHED_DAG_SEED").map_or(1, |seed| seed.parse().expect("a number"));
    let mut entered = 0;
    for seed in first..first + sets {
        println!("SCHED_DAG_SEED={seed}");
        let mut random = Random::new(seed);
        let dags = u32::try_from(random.between(1, 5)).expect("few");
        let specs = (0..dags).map(|_| DagSpec {
            offset_ns: random.between(0, 40),
            in_flight: Some(40),
            ..dag(
                random.between(20, 60),
                1000,
                random.between(1, 20),
                &[1],
                &[],
            )
        });
        let specs: Vec<DagSpec> = specs.collect();
        let modes: Vec<u32> = (0..random.between(1, 4))
            .map(|_| u32::try_from(random.between(1, (1 << dags) - 1)).expect("few"))
            .collect();
        let requests = requests(&mut random, dags, modes.len());
        let mut script = Script::new(&requests, move |_| random.between(1, 70));
        let lists = modes.iter().copied().map(listed).collect();
        script.run(&specs, Changes::new(dags, false).with_modes(lists));
        let of_modes = script
            .said
            .iter()
            .filter(|(_, said)| matches!(said, Said::Entered(_)));
        entered += of_modes.count();
        let rules = Rules {
            modes,
            is_off: 0,
            in_flight: [0; 8],
            pending: None,
        };
        compare(&script.said, rules);
    }
    assert!(
        entered > 2 * usize::try_from(sets).expect("few"),
        "{entered}"
    );
}
