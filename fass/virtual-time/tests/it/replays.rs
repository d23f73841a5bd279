//! Random sets of DAGs that join, sample each other, raise signals, ask for the time, overrun and
//! fail, with interrupts that are late: they keep the rules, and what is recorded on one machine is
//! computed on others to the byte.
//!
//! Each case has its seed; a failure prints it, and `case(SEED)` repeats it.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::time::Duration;

use crate::support::{ms, named, one_in};
use fass::commit::{ConstructionPolicy, finish_create_dags_with};
use fass::shared::{Raiser, Sample, Signal, Uses};
use fass::{Dag, Occupation, OverrunPolicy, Policy, Preemption, create_dag, execute_for};
use random::{Random, nth};
use recording::{Entry, EntryKind, Recording, Role};
use virtual_time::{PanicRecord, Report, VirtualTime};

const CASES: u64 = 80;

fn micros(random: &mut Random, least: u64, most: u64) -> Duration {
    Duration::from_micros(random.within(least..=most))
}

/// Computes something of what a function got, which takes a time that follows from it.
fn work(state: &mut u64, got: &[u64], longest_us: u64) -> u64 {
    *state = got.iter().fold(*state, |state, part| nth(state ^ part, 0));
    let time = Duration::from_micros(*state % longest_us);
    execute_for(time, Occupation::Hold);
    *state
}

fn of_sample(sample: Option<Sample<'_, u64>>) -> u64 {
    sample.map_or(1, |sample| {
        nth(*sample.value ^ sample.job, 0) ^ sample.age_ns()
    })
}

struct Set {
    dags: Vec<Dag>,
    signals: Vec<Signal>,
}

/// Builds a set of DAGs, whose sources return something else for each salt.
fn build(seed: u64, salt: u64) -> Set {
    let mut random = Random::new(seed);
    let mut set = Set {
        dags: Vec::new(),
        signals: Vec::new(),
    };
    for number in 0..random.within(2..=4) {
        let dag = create_dag();
        let policies = [
            OverrunPolicy::Queue,
            OverrunPolicy::Skip,
            OverrunPolicy::Abort,
        ];
        dag.name(&format!("dag {number}")).relative_deadline(ms(3));
        dag.overrun(random.one_of(&policies));
        dag.in_flight(random.one_of(&[1, 2, 3]));
        let topic = format!("s{number}");
        dag.record::<u64>(&topic);
        let (period, longest) = (micros(&mut random, 500, 2_000), random.within(1..=600));
        if random.chance(33) {
            set.signals.push(dag.sporadic(period));
        } else {
            dag.jobs(20).period(period);
        }
        let mut state = salt ^ seed;
        let source = dag.source(move || (work(&mut state, &[number], longest),));
        source.writes(&[&topic]).register(named("source"));
        set.dags.push(dag);
    }
    for number in 0..set.dags.len() {
        let mut topics = vec![format!("s{number}")];
        for of_dag in 0..random.within(1..=4) {
            let output = format!("m{number} {of_dag}");
            let inputs = [0; 2].map(|_| &*topics[random.index(topics.len())]);
            register(&set, number, inputs, &output, &mut random);
            topics.push(output);
        }
        // The last one is read by the sink, the others by what records them.
        let last = topics.last().map_or("", String::as_str);
        set.dags[number].register_subtask(|_: (u64,)| (), vec![last], vec![], named("sink"));
    }
    set
}

/// Registers a subtask that does something at random, and remembers something, which is recorded.
#[allow(clippy::too_many_lines, reason = "one arm for each use")]
fn register(set: &Set, number: usize, inputs: [&str; 2], output: &str, random: &mut Random) {
    let (dag, names) = (&set.dags[number], [inputs[0], output]);
    dag.record::<u64>(output);
    let (longest, first) = (random.within(1..=800), random.number());
    let state = dag.state(output, first);
    state.record_every(random.one_of(&[1, 2, 5]));
    state.reset_to(move || first);
    let state = state.update();
    let other = (number + 1) % set.dags.len();
    let what = random.index(8);
    match what {
        0..=2 => {
            let latest = set.dags[other].latest::<u64>(&format!("s{other}"));
            using(dag, (latest.sample(), state), names, move |used, value| {
                let (sample, state) = used;
                let sampled = of_sample(sample);
                let is_last = what == 2 && sampled.is_multiple_of(40);
                assert!(!is_last, "for good");
                work(state, &[value, sampled], longest)
            });
        }
        3 if !set.signals.is_empty() => {
            let raising = set.signals[random.index(set.signals.len())].raising();
            using(dag, (raising, state), names, move |used, value| {
                let (mut raiser, state): (Raiser<'_>, _) = used;
                if value.is_multiple_of(2) {
                    raiser.raise();
                }
                work(state, &[value], longest)
            });
        }
        4 => using(dag, state, names, move |state, value| {
            let before_ns = fass::now_ns();
            work(state, &[value, before_ns], longest) ^ fass::now_ns()
        }),
        5 => {
            let make = move || {
                move |state: &mut u64, (value,): (u64,)| {
                    let value = work(state, &[value], longest);
                    assert!(!value.is_multiple_of(5), "unlucky");
                    (value,)
                }
            };
            dag.survive_faults(one_in(1, 40));
            let subtask = dag.using(state).restarting(make).reads(&names[..1]);
            subtask.writes(&names[1..]).register(named(output));
        }
        _ if inputs[0] == inputs[1] => using(dag, state, names, move |state, value| {
            work(state, &[value], longest)
        }),
        _ => {
            let join = move |state: &mut u64, (one, other): (u64, u64)| {
                (work(state, &[one, other], longest),)
            };
            let subtask = dag.using(state).subtask(join).reads(&inputs);
            subtask.writes(&names[1..]).register(named(output));
        }
    }
}

/// Registers a subtask that uses something.
fn using<U: Uses + 'static>(
    dag: &Dag,
    uses: U,
    names: [&str; 2],
    mut f: impl for<'a> FnMut(U::Borrowed<'a>, u64) -> u64 + Send + 'static,
) {
    let call = move |used: U::Borrowed<'_>, (value,): (u64,)| (f(used, value),);
    let subtask = dag.using(uses).subtask(call).reads(&names[..1]);
    subtask.writes(&names[1..]).register(named(names[1]));
}

/// Commits a set, runs it by the rules, and returns also what a recording says but the times.
fn run(machine: &VirtualTime, set: &Set, raises: &[(usize, Duration)]) -> (Report, Vec<Said>) {
    let commit = finish_create_dags_with(&set.dags, ConstructionPolicy::any_graph());
    commit.unwrap_or_else(|error| panic!("{error}"));
    for (signal, time) in raises {
        machine.raise_at(&set.signals[*signal], *time);
    }
    let report = machine.run();
    assert_eq!(report.violations(), []);
    let bytes = machine.recording();
    let recording = Recording::read(&bytes).expect("whole");
    // A replay looks at states in more jobs, and compares what is recorded of them.
    let is_state = |entry: &Entry<'_>| {
        let channel = recording.header().channels.get(usize::from(entry.place));
        entry.what == EntryKind::Value && channel.is_some_and(|it| it.role == Role::State)
    };
    let others = recording.entries().filter(|entry| !is_state(entry));
    let said = others.map(|entry| {
        let of = (entry.dag, entry.place, entry.job);
        (entry.what.name(), of, entry.value.to_vec())
    });
    let mut said: Vec<Said> = said.collect();
    said.sort();
    (report, said)
}

/// An event, the place of a DAG and the job that it happened to, and the value.
type Said = (&'static str, (u16, u16, u64), Vec<u8>);

/// Runs a case, and returns how much of what there was.
#[allow(clippy::too_many_lines, reason = "one case, from set to comparison")]
fn case(seed: u64) -> [usize; 6] {
    let mut later = 0;
    let mut random = Random::new(!seed);
    let set = build(seed, 1);
    let preemptions = [Preemption::Enabled, Preemption::Disabled];
    let machine = VirtualTime::new()
        .cores(random.one_of(&[1, 2, 3]))
        .preemption(random.one_of(&preemptions))
        .late(Duration::from_micros(seed % 3 * 50), seed)
        .contain_panics();
    let mut raises = Vec::new();
    for signal in 0..set.signals.len() {
        let times = (0..random.index(25)).map(|_| (signal, micros(&mut random, 0, 30_000)));
        raises.extend(times);
    }
    let (report, said) = run(&machine, &set, &raises);
    // Where the subtask of a cancelled instance runs an older one, its inputs are given up when
    // that has ended: before their places are needed, which else would be a fault of who sends.
    for PanicRecord { message, .. } in &report.panics {
        assert!(["unlucky", "for good"].contains(&&**message), "{message}");
    }
    let recording = machine.recording();
    for cores in [1, 2, 4] {
        for policy in [Policy::Edf, Policy::StaticPriority] {
            let machine = VirtualTime::new().cores(cores).policy(policy);
            let machine = machine.contain_panics().replay(&recording);
            // What is raised now comes from nowhere.
            let (again, repeated) = run(&machine.expect("whole"), &build(seed, 2), &raises);
            assert_eq!((again.divergence, again.uncompared), (None, 0));
            let sorted = |panics: &[PanicRecord]| {
                let mut panics = panics.to_vec();
                panics.sort_by_key(|panic| panic.instance);
                panics
            };
            assert_eq!(sorted(&again.panics), sorted(&report.panics));
            assert!(repeated == said);
        }
        // One that begins later computes the same from there on.
        let (dag, job) = (random.index(set.dags.len()), random.within(0..=19));
        let machine = VirtualTime::new().cores(cores).contain_panics();
        let machine = machine.replay(&recording).expect("whole");
        let set = build(seed, 3);
        let (again, repeated) = run(&machine.from(&format!("dag {dag}"), job), &set, &[]);
        assert_eq!((again.divergence.clone(), again.uncompared), (None, 0));
        let firsts: Vec<u64> = again
            .task_set()
            .dags()
            .iter()
            .map(|dag| dag.first_job())
            .collect();
        assert!(firsts[dag] <= job);
        let is_after = |(_, (dag, _, job), _): &&Said| *job >= firsts[usize::from(*dag)];
        assert!(
            said.iter().filter(is_after).eq(&repeated),
            "from {firsts:?}"
        );
        later += usize::from(firsts[dag] > 0);
    }
    let counted = [
        EntryKind::Clock,
        EntryKind::Skip,
        EntryKind::Cut,
        EntryKind::Restart,
        EntryKind::Signal,
    ];
    let [clock, skip, cut, restart, signal] =
        counted.map(|what| said.iter().filter(|it| it.0 == what.name()).count());
    [clock, skip, cut, restart, signal, later]
}

#[test]
fn what_is_recorded_is_computed_to_the_byte_on_other_machines() {
    let mut sums = [0; 6];
    for seed in 0..CASES {
        let counts = catch_unwind(AssertUnwindSafe(|| case(seed))).unwrap_or_else(|payload| {
            eprintln!("the case with seed {seed} failed");
            resume_unwind(payload)
        });
        let counts = sums.iter_mut().zip(counts);
        counts.for_each(|(sum, count)| *sum += count);
    }
    println!("{sums:?}");
    assert!(sums.iter().all(|sum| *sum > 50), "{sums:?}");
}
