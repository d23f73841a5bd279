//! Schedule-abstraction graphs against runs: no sink finishes beyond its bound, with any execution
//! between best case and WCET, and any jitter; and lists that somebody has altered.

use random::Random;
use sched_dag::analysis::{
    AbstractState, AbstractionDag, AbstractionSet, AbstractionSubtask, NotClosed, check_closed,
    explore,
};
use sched_dag::{
    CommitOptions, ConstructionPolicy, Dag, DagSpec, Instance, Policy, Preemption, Priority,
    TaskSet, verify,
};

use super::simulate::{commit, observe, spec};
use crate::support::Script;

const STATES: usize = 150;

pub(super) type Bounds = Vec<Vec<u64>>;

/// A random set whose subtasks keep their cores.
#[derive(Debug)]
pub(super) struct GraphSample {
    pub(super) policy: Policy,
    pub(super) cores: u32,
    pub(super) task_set: TaskSet,
    dags: Vec<AbstractionDag>,
}

/// How long executions and releases take, between their limits.
#[derive(Clone, Copy)]
pub(super) enum Draws {
    Shortest,
    Longest,
    Either,
    Any,
}

impl Draws {
    pub(super) const ALL: [Self; 4] = [Self::Shortest, Self::Longest, Self::Either, Self::Any];

    fn draw(self, random: &mut Random, least: u64, most: u64) -> u64 {
        match self {
            Self::Shortest => least,
            Self::Longest => most,
            Self::Either => random.one_of(&[least, most]),
            Self::Any => random.within(least..=most),
        }
    }
}

impl GraphSample {
    pub(super) fn new(random: &mut Random) -> Option<Self> {
        let policy = random.one_of(&[Policy::StaticPriority, Policy::Edf]);
        let cores = random.within(1..=4);
        let count = random.within(2..=3);
        let mut specs: Vec<DagSpec> = (0..count).map(|_| drawn_spec(random)).collect();
        // The last jobs of all at about one time, of each at a time of its own, or none.
        let (ends, lasts_ns) = (random.within(0..=2), random.within(6..=72));
        for spec in specs.iter_mut().filter(|_| ends > 0) {
            let of_span = lasts_ns / spec.period_ns.unwrap_or(1) + 1;
            spec.jobs = Some([of_span, random.within(1..=9)][ends - 1]);
        }
        let options = CommitOptions::new(policy, cores);
        let options = options.with_construction(ConstructionPolicy::any_graph());
        let task_set = verify(&specs, &options).ok()?.task_set;
        let keeps_nominal = random.chance(50);
        let best_cases = random.within(0..=2);
        let dags = specs.iter().zip(task_set.dags()).map(|(spec, dag)| {
            let jitter_ns = random.within(0..=dag.period_ns() / 3);
            let numbers = policy.numbers(dag).into_iter();
            let subtasks = dag.subtasks().iter().zip(numbers).zip(0..);
            let subtasks = subtasks.map(|((subtask, number), id)| {
                let wcet_ns = subtask.wcet_ns().expect("it has one");
                let is_sink = dag.sinks().iter().any(|sink| sink.0 == id);
                AbstractionSubtask {
                    best_ns: [0, random.within(0..=wcet_ns), wcet_ns][best_cases],
                    wcet_ns,
                    number,
                    deadline_ns: is_sink.then(|| subtask.relative_deadline_ns()),
                }
            });
            AbstractionDag {
                period_ns: dag.period_ns(),
                offset_ns: dag.offset_ns(),
                subtasks: subtasks.collect(),
                jitter_ns: if keeps_nominal { 0 } else { jitter_ns },
                jobs: spec.jobs,
                edges: spec.edges.clone(),
            }
        });
        let dags = dags.collect();
        Some(Self {
            policy,
            cores,
            task_set,
            dags,
        })
    }

    fn set(&self, is_real: bool) -> AbstractionSet {
        let adds_release = self.policy.adds_release();
        let set = AbstractionSet::new(self.cores, &self.dags, adds_release, is_real);
        set.expect("it is small")
    }

    /// Returns the longest responses of a run in virtual time, which releases without jitter.
    pub(super) fn in_virtual_time(
        &self,
        draws: Draws,
        until_ns: u64,
        random: &mut Random,
    ) -> Bounds {
        let script = Script::new(|instance: Instance| {
            let of = self.dags[instance.dag.index()].subtasks[instance.subtask.index()];
            draws.draw(random, of.best_ns, of.wcet_ns)
        });
        let kind = (self.policy, Preemption::Disabled, self.cores);
        observe(&self.task_set, kind, until_ns, script).subtasks
    }

    /// Returns by DAG the releases, each late by up to the jitter. In order, those that were due no
    /// later than one that is seen are seen, too.
    fn releases(
        &self,
        (draws, is_in_order): (Draws, bool),
        until_ns: u64,
        random: &mut Random,
    ) -> Vec<Vec<u64>> {
        let releases = self.dags.iter().map(|dag| {
            let all = (0..).map(|job| dag.offset_ns + job * dag.period_ns);
            let nominal = all.take_while(|&ns| ns < until_ns);
            let last_ns = dag
                .jobs
                .map_or(until_ns, |jobs| dag.offset_ns + jobs * dag.period_ns);
            let nominal = nominal.take_while(|&ns| ns < last_ns);
            nominal
                .map(|ns| (ns, ns + draws.draw(random, 0, dag.jitter_ns)))
                .collect()
        });
        let drawn: Vec<Vec<(u64, u64)>> = releases.collect();
        let seen = |&(nominal_ns, own_ns): &(u64, u64)| {
            let later = drawn.iter().flatten();
            let later = later.filter(|of| is_in_order && of.0 >= nominal_ns);
            later.map(|of| of.1).min().unwrap_or(own_ns)
        };
        let releases = drawn.iter().map(|of_dag| of_dag.iter().map(seen).collect());
        releases.collect()
    }

    /// Returns the longest responses of a run whose releases are late by up to the jitter.
    fn with_jitter(
        &self,
        (draws, is_in_order): (Draws, bool),
        until_ns: u64,
        random: &mut Random,
    ) -> Bounds {
        let releases = self.releases((draws, is_in_order), until_ns, random);
        let none = self.dags.iter().map(|dag| vec![vec![]; dag.subtasks.len()]);
        let mut finishes: Vec<Vec<Vec<u64>>> = none.collect();
        let mut free_ns = vec![0; self.cores as usize];
        for now_ns in 0..until_ns {
            // What executes for no time ends at this instant, and then there is another dispatch.
            let mut again = true;
            while again {
                again = false;
                let ended = finishes.clone();
                for free_ns in free_ns.iter_mut().filter(|free_ns| **free_ns <= now_ns) {
                    let is_over = |ns: Option<&u64>| ns.is_some_and(|&ns| ns <= now_ns);
                    let is_ready = |&(_, dag, job, subtask): &(u64, usize, usize, usize)| {
                        let edges = &self.dags[dag].edges;
                        let mut before = edges.iter().filter(|edge| edge.1 == subtask);
                        is_over(releases[dag].get(job))
                            && (job == 0 || is_over(ended[dag][subtask].get(job - 1)))
                            && before.all(|edge| is_over(ended[dag][edge.0].get(job)))
                    };
                    let all = (0..self.dags.len()).flat_map(|dag| {
                        let subtasks = 0..self.dags[dag].subtasks.len();
                        subtasks.map(move |subtask| (dag, subtask))
                    });
                    let keys = all.map(|(dag, subtask)| {
                        let job = finishes[dag][subtask].len();
                        (self.number(dag, job, subtask), dag, job, subtask)
                    });
                    let Some((_, dag, _, subtask)) = keys.filter(is_ready).min() else {
                        break;
                    };
                    let of = self.dags[dag].subtasks[subtask];
                    *free_ns = now_ns + draws.draw(random, of.best_ns, of.wcet_ns);
                    again |= *free_ns == now_ns;
                    finishes[dag][subtask].push(*free_ns);
                }
            }
        }
        let responses = self.dags.iter().zip(finishes).map(|(dag, finishes)| {
            let longest = finishes.into_iter().map(|finishes| {
                let jobs = (0..).map(|job| dag.offset_ns + job * dag.period_ns);
                finishes
                    .into_iter()
                    .zip(jobs)
                    .map(|(finish_ns, ns)| finish_ns - ns)
                    .max()
            });
            longest.map(Option::unwrap_or_default).collect()
        });
        responses.collect()
    }

    fn number(&self, dag: usize, job: usize, subtask: usize) -> u64 {
        let dag = &self.dags[dag];
        let release_ns = dag.offset_ns + job as u64 * dag.period_ns;
        dag.subtasks[subtask].number
            + if self.policy.adds_release() {
                release_ns
            } else {
                0
            }
    }

    /// Returns the longest responses of sinks in some runs.
    fn seen(&self, is_in_order: bool, random: &mut Random) -> Bounds {
        let offset_ns = self.dags.iter().map(|dag| dag.offset_ns).max();
        let until_ns = offset_ns.unwrap_or(0) + 100;
        let mut worst: Bounds = self
            .dags
            .iter()
            .map(|dag| vec![0; dag.subtasks.len()])
            .collect();
        for draws in [
            Draws::ALL,
            [Draws::Either, Draws::Any, Draws::Either, Draws::Any],
        ]
        .concat()
        {
            let runs = [
                self.in_virtual_time(draws, until_ns, random),
                self.with_jitter((draws, is_in_order), until_ns, random),
            ];
            for run in runs {
                let known = worst.iter_mut().flatten();
                known
                    .zip(run.iter().flatten())
                    .for_each(|(known, ns)| *known = *ns.max(known));
            }
        }
        for (worst, dag) in worst.iter_mut().zip(self.task_set.dags()) {
            for (id, ns) in (0..).zip(worst) {
                *ns = if dag.sinks().iter().any(|sink| sink.0 == id) {
                    *ns
                } else {
                    0
                };
            }
        }
        worst
    }
}

fn drawn_spec(random: &mut Random) -> DagSpec {
    let period_ns = random.one_of(&[6, 8, 12, 24]);
    let deadline_ns = random.within(period_ns / 2..=3 * period_ns);
    let count = random.within(1..=4);
    let longest = period_ns / 4 + 1;
    let wcets: Vec<u64> = (0..count).map(|_| random.within(1..=longest)).collect();
    let edges: Vec<(usize, usize)> = random.edges(count, 40).collect();
    let mut spec = spec(period_ns, deadline_ns, &wcets, &edges, 0);
    spec.offset_ns = random.within(0..=period_ns);
    for (id, subtask) in spec.subtasks.iter_mut().enumerate() {
        subtask.priority = Some(Priority(random.within(0..=3)));
        let is_sink = edges.iter().all(|edge| edge.0 != id);
        if is_sink && random.once_in(4) {
            subtask.relative_deadline_ns = Some(random.within(deadline_ns / 2 + 1..=deadline_ns));
        }
    }
    spec
}

fn is_beyond(seen: &Bounds, bounds: &Bounds) -> bool {
    let mut all = seen.iter().flatten().zip(bounds.iter().flatten());
    all.any(|(seen, bound)| seen > bound)
}

/// Alters a list in one of many ways.
fn altered(states: &[AbstractState], random: &mut Random) -> Vec<Vec<i64>> {
    let mut lines: Vec<Vec<i64>> = states.iter().map(AbstractState::numbers).collect();
    let state = random.index(lines.len());
    let place = random.index(lines[state].len());
    let other = lines[random.index(states.len())].clone();
    let by = i64::from(random.within(1..=6_u8));
    match random.within(0..=8) {
        0 => _ = lines.remove(state),
        1 => lines[state] = other,
        2 => lines[state].truncate(place),
        3 => lines[state][place] = random.one_of(&[i64::MAX, i64::MIN, 1 << 53, 1 << 20]),
        4 => lines[state].extend_from_within(place..),
        5 => lines[state].swap(0, place),
        6 => lines[state][place] += by,
        _ => lines[state][place] -= by,
    }
    lines
}

#[test]
fn no_run_of_a_closed_list_is_beyond_its_bounds_nor_of_an_altered_one() {
    let mut random = Random::new(62);
    let (mut proven, mut ending, mut met, mut sinks) = ([0; 2], 0, 0, 0);
    // Refused by their form, or since they are not closed; of the same bounds, of others.
    let mut lists = [0; 4];
    for number in 0..600 {
        let Some(sample) = GraphSample::new(&mut random) else {
            continue;
        };
        let found = [false, true].map(|is_real| {
            let set = sample.set(is_real);
            let states = explore(&set, STATES).ok()?;
            let bounds = check_closed(&set, &states).expect("an explored list is closed");
            Some((set, states, bounds))
        });
        for (kind, (set, states, bounds)) in found
            .iter()
            .enumerate()
            .filter_map(|(kind, of)| Some((kind, of.as_ref()?)))
        {
            let seen = sample.seen(kind == 1, &mut random);
            proven[kind] += 1;
            ending += u32::from(states.iter().any(|state| state.numbers()[0] > 0));
            assert!(
                !is_beyond(&seen, bounds),
                "{number}: {sample:?} {seen:?} {bounds:?}"
            );
            let all = seen.iter().flatten().zip(bounds.iter().flatten());
            let all = all.filter(|(_, bound)| **bound > 0);
            all.for_each(|(seen, bound)| {
                (sinks, met) = (sinks + 1, met + u32::from(seen == bound))
            });
            for _ in 0..4 {
                let lines = altered(states, &mut random);
                let read: Option<Vec<_>> = lines.iter().map(|line| set.state(line)).collect();
                let Some(read) = read else {
                    lists[0] += 1;
                    continue;
                };
                let Ok(others) = check_closed(set, &read) else {
                    lists[1] += 1;
                    continue;
                };
                assert!(
                    !is_beyond(&seen, &others),
                    "{number}: {sample:?} {lines:?} {others:?}"
                );
                lists[if others == *bounds { 2 } else { 3 }] += 1;
            }
        }
    }
    println!("proven {proven:?}, {ending} with ends, {met} of {sinks} bounds met, lists {lists:?}");
    assert!(
        proven[0] > 150 && ending > 150 && lists[..3].iter().all(|&count| count > 100),
        "{proven:?} {ending} {lists:?}"
    );
}

/// Lists that a check of successors alone would believe.
#[test]
fn a_list_of_another_set_or_with_hidden_entries_is_malformed() {
    let specs = [
        spec(8, 8, &[3, 3, 1], &[(0, 2)], 0),
        spec(8, 8, &[3], &[], 1),
    ];
    let on = |cores| {
        let task_set = commit(&specs, Policy::StaticPriority, cores);
        let subtasks = |spec: &DagSpec, dag: &Dag| {
            let subtasks = dag.subtasks().iter().zip(0..);
            let subtasks = subtasks.map(|(of, id)| AbstractionSubtask {
                best_ns: 0,
                wcet_ns: of.wcet_ns().unwrap_or(0),
                number: of.priority().0.into(),
                deadline_ns: spec.edges.iter().all(|edge| edge.0 != id).then_some(8),
            });
            subtasks.collect()
        };
        let dags = specs
            .iter()
            .zip(task_set.dags())
            .map(|(spec, dag)| AbstractionDag {
                period_ns: 8,
                offset_ns: 0,
                jitter_ns: 0,
                jobs: None,
                subtasks: subtasks(spec, dag),
                edges: spec.edges.clone(),
            });
        AbstractionSet::new(cores, &dags.collect::<Vec<_>>(), false, false).expect("it is small")
    };
    let [one, two] = [on(1), on(2)];
    assert!(matches!(explore(&one, STATES), Err(NotClosed::Late { .. })));
    let states = explore(&two, STATES).expect("two cores suffice");
    let at_first = Err(NotClosed::Malformed { state: 0 });
    assert_eq!(check_closed(&one, &states), at_first);
    assert_eq!(check_closed(&two, &[]), Err(NotClosed::NoFirst));
    let lines: Vec<Vec<i64>> = states.iter().map(AbstractState::numbers).collect();
    let read: Vec<_> = lines.iter().filter_map(|line| two.state(line)).collect();
    assert_eq!(read, states);
    let with_finish = lines
        .iter()
        .find(|line| line.len() > 9)
        .expect("one has a finish");
    let twice = [with_finish, &with_finish[9..13]].concat();
    assert_eq!(two.state(&twice), None);
    let beyond: Vec<i64> = with_finish.iter().map(|_| i64::MAX).collect();
    assert_eq!(two.state(&beyond), None);
}
