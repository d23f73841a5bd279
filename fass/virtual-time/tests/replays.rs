//! Random sets of DAGs that sample each other, raise signals, ask for the time, overrun and
//! fail: what is recorded on one machine is computed on others to the byte.
//!
//! Each case has its seed; a failure prints it, and `case(SEED)` repeats it.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::time::Duration;

use fass::{
    ConstructionPolicy, Count, Dag, FaultLimit, Latest, Occupation, OverrunPolicy, Policy, Raiser,
    Sample, Signal, SubtaskAttributes, create_dag, execute_for, finish_create_dags_with,
};
use recording::{Recording, What};
use virtual_time::VirtualTime;

const CASES: u64 = 80;

/// A generator of pseudo-random numbers, the step of SplitMix64 (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.0) % limit
    }

    fn pick<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[usize::try_from(self.below(choices.len() as u64)).expect("small")]
    }

    fn micros(&mut self, from: u64, limit: u64) -> Duration {
        Duration::from_micros(from + self.below(limit - from))
    }
}

fn mix(state: u64) -> u64 {
    let z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Computes something of what a function got, which takes a time that follows from it.
fn work(state: &mut u64, got: &[u64], longest_us: u64) -> (u64,) {
    *state = got.iter().fold(*state, |state, part| mix(state ^ part));
    let time = Duration::from_micros(*state % longest_us);
    execute_for(time, Occupation::Hold);
    (*state,)
}

fn of_sample(sample: Option<Sample<'_, u64>>) -> u64 {
    sample.map_or(1, |sample| {
        mix(*sample.value ^ sample.job) ^ sample.age_ns()
    })
}

/// What a subtask does besides computing.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Plain,
    Samples,
    AsksForTheTime,
    FailsAtTimes,
    EndsItsDag,
    Signals,
    HasAState,
}

struct Set {
    dags: Vec<Dag>,
    signals: Vec<Signal>,
}

/// Builds a set of DAGs, whose sources return something else for each salt.
fn build(seed: u64, salt: u64) -> Set {
    let mut random = Random(seed);
    let count = 2 + random.below(3);
    let mut set = Set {
        dags: Vec::new(),
        signals: Vec::new(),
    };
    for number in 0..count {
        let dag = create_dag();
        let policies = [
            OverrunPolicy::Queue,
            OverrunPolicy::Skip,
            OverrunPolicy::Abort,
        ];
        dag.name(&format!("dag {number}"))
            .overrun(random.pick(&policies))
            .in_flight(u32::try_from(1 + random.below(3)).expect("small"))
            .relative_deadline(Duration::from_millis(3));
        let topic = format!("s{number}");
        dag.record::<u64>(&topic);
        let (period, longest) = (random.micros(500, 2_000), 1 + random.below(600));
        let mut state = salt ^ seed;
        let source = move || work(&mut state, &[number], longest);
        let named = SubtaskAttributes::named("source");
        if random.below(3) == 0 {
            let signal = dag.sporadic(period);
            dag.source(source).writes(&[&topic]).register(named);
            set.signals.push(signal);
        } else {
            dag.jobs(20);
            dag.register_periodic_subtask(source, vec![&topic], period, named);
        }
        set.dags.push(dag);
    }
    for number in 0..set.dags.len() {
        let inner = 1 + random.below(4);
        let mut topics = vec![format!("s{number}")];
        for of_dag in 0..inner {
            let output = format!("m{number} {of_dag}");
            let input =
                topics[usize::try_from(random.below(topics.len() as u64)).expect("small")].clone();
            register(&set, number, (&input, &output), &mut random);
            topics.push(output);
        }
        let ignore = |_: (u64,)| ();
        // The last one is read by the sink, the others by what records them.
        let last = topics.last().map_or("", String::as_str);
        let deadline = Duration::from_millis(3);
        let named = SubtaskAttributes::named("sink");
        set.dags[number].register_sink_subtask(ignore, vec![last], deadline, named);
    }
    set
}

/// Registers a subtask that does something at random.
fn register(set: &Set, number: usize, (input, output): (&str, &str), random: &mut Random) {
    use Kind::{AsksForTheTime, EndsItsDag, FailsAtTimes, HasAState, Plain, Samples, Signals};
    let dag = &set.dags[number];
    dag.record::<u64>(output);
    let (ins, outs, named) = (vec![input], vec![output], SubtaskAttributes::named(output));
    let longest = 1 + random.below(800);
    let mut state = random.below(u64::MAX);
    let kinds = [
        Plain,
        Samples,
        Samples,
        AsksForTheTime,
        FailsAtTimes,
        EndsItsDag,
        Signals,
        HasAState,
    ];
    let other = (number + 1) % set.dags.len();
    match random.pick(&kinds) {
        Samples => {
            let latest: Latest<u64> = set.dags[other].latest(&format!("s{other}"));
            let f = move |sample: Option<Sample<'_, u64>>, (value,): (u64,)| {
                work(&mut state, &[value, of_sample(sample)], longest)
            };
            dag.using(latest.sample())
                .subtask(f)
                .reads(&ins)
                .writes(&outs)
                .register(named);
        }
        AsksForTheTime => {
            let f = move |(value,): (u64,)| {
                let before_ns = fass::now_ns();
                let (value,) = work(&mut state, &[value, before_ns], longest);
                (value ^ fass::now_ns(),)
            };
            dag.register_subtask(f, ins, outs, named);
        }
        FailsAtTimes => {
            let make = move || {
                let mut state = state;
                move |(value,): (u64,)| {
                    let (value,) = work(&mut state, &[value], longest);
                    assert!(!value.is_multiple_of(5), "unlucky");
                    (value,)
                }
            };
            dag.survive_faults(FaultLimit {
                faults: 1,
                window: 1,
                in_all: 40,
            });
            dag.restarting(make)
                .reads(&ins)
                .writes(&outs)
                .register(named);
        }
        EndsItsDag => {
            let latest: Latest<u64> = set.dags[other].latest(&format!("s{other}"));
            let f = move |sample: Option<Sample<'_, u64>>, (value,): (u64,)| {
                let sampled = of_sample(sample);
                assert!(!sampled.is_multiple_of(40), "for good");
                work(&mut state, &[value, sampled], longest)
            };
            dag.using(latest.sample())
                .subtask(f)
                .reads(&ins)
                .writes(&outs)
                .register(named);
        }
        Signals if !set.signals.is_empty() => {
            let signal = random.below(set.signals.len() as u64);
            let signal = &set.signals[usize::try_from(signal).expect("small")];
            let f = move |mut raiser: Raiser<'_>, (value,): (u64,)| {
                if value.is_multiple_of(2) {
                    raiser.raise();
                }
                work(&mut state, &[value], longest)
            };
            dag.using(signal.raising())
                .subtask(f)
                .reads(&ins)
                .writes(&outs)
                .register(named);
        }
        HasAState => {
            let shared = dag.state(output, state);
            let f = move |state: &mut u64, (value,): (u64,)| work(state, &[value], longest);
            dag.using(shared.update())
                .subtask(f)
                .reads(&ins)
                .writes(&outs)
                .register(named);
        }
        _ => {
            let f = move |(value,): (u64,)| work(&mut state, &[value], longest);
            dag.register_subtask(f, ins, outs, named);
        }
    }
}

fn commit(set: &Set) {
    let construction = ConstructionPolicy {
        sinks: Count::Several,
        ..ConstructionPolicy::paper()
    };
    let commit = finish_create_dags_with(&set.dags, construction);
    commit.unwrap_or_else(|error| panic!("{error}"));
}

/// Returns all that a recording says but the times.
fn entries(bytes: &[u8]) -> Vec<(&'static str, u16, u16, u64, Vec<u8>)> {
    let recording = Recording::read(bytes).expect("whole");
    let mut entries: Vec<_> = recording
        .entries()
        .map(|entry| {
            let what = entry.what.name();
            (
                what,
                entry.dag,
                entry.place,
                entry.job,
                entry.value.to_vec(),
            )
        })
        .collect();
    entries.sort();
    entries
}

/// Runs a case, and returns how much of what there was.
fn case(seed: u64) -> [usize; 5] {
    let mut random = Random(!seed);
    let set = build(seed, 1);
    let cores = random.pick(&[1, 2, 3]);
    let machine = VirtualTime::new().cores(cores).contain_panics();
    commit(&set);
    for signal in &set.signals {
        for _ in 0..random.below(25) {
            machine.raise_at(signal, random.micros(0, 30_000));
        }
    }
    let report = machine.run();
    assert_eq!(report.violations(), []);
    let recording = machine.recording();
    let wanted = entries(&recording);
    for cores in [1, 2, 4] {
        for policy in [Policy::Edf, Policy::StaticPriority] {
            let machine = VirtualTime::new()
                .cores(cores)
                .policy(policy)
                .contain_panics();
            let machine = machine.replay(&recording).expect("whole");
            commit(&build(seed, 2));
            let again = machine.run();
            assert_eq!(again.violations(), []);
            assert_eq!(again.divergence, None);
            assert_eq!(again.uncompared, 0);
            let panicked = |report: &virtual_time::Report| {
                let mut panics = report.panics.clone();
                panics.sort_by_key(|panic| panic.instance);
                panics
            };
            assert_eq!(panicked(&again), panicked(&report));
            assert!(entries(&machine.recording()) == wanted);
        }
    }
    let count = |what: What| wanted.iter().filter(|entry| entry.0 == what.name()).count();
    [
        count(What::Clock),
        count(What::Skip),
        count(What::Cut),
        count(What::Restart),
        count(What::Signal),
    ]
}

#[test]
fn what_is_recorded_is_computed_to_the_byte_on_other_machines() {
    let mut sums = [0; 5];
    for seed in 0..CASES {
        let counts = catch_unwind(AssertUnwindSafe(|| case(seed))).unwrap_or_else(|payload| {
            eprintln!("the case with seed {seed} failed");
            resume_unwind(payload)
        });
        sums.iter_mut()
            .zip(counts)
            .for_each(|(sum, count)| *sum += count);
    }
    println!("{sums:?}");
    assert!(sums.iter().all(|sum| *sum > 50), "{sums:?}");
}

/// Where the subtask of a cancelled instance runs an older one, its inputs are given up when that has
/// ended: before their places are needed, which else would be a fault of who sends.
#[test]
fn nothing_fails_but_what_is_unlucky() {
    for seed in 0..CASES {
        let mut random = Random(!seed);
        let set = build(seed, 1);
        let late = Duration::from_micros(seed % 3 * 50);
        let machine = VirtualTime::new().contain_panics().late(late, seed);
        commit(&set);
        for signal in &set.signals {
            for _ in 0..random.below(25) {
                machine.raise_at(signal, random.micros(0, 30_000));
            }
        }
        for panic in machine.run().panics {
            let is_meant = ["unlucky", "for good"].contains(&&*panic.message);
            assert!(is_meant, "seed {seed}: {}", panic.message);
        }
    }
}
