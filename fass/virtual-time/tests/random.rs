//! Random DAGs through real functions: whatever graph, times, cores, policy and
//! overrun, rules R1-R5 hold, every join meets the values of one job, and jobs
//! keep the bounds that the commit has answered.
//!
//! Each case has its seed; a failure prints it, and `case(SEED)` repeats it.

#[path = "../../../sched-dag/tests/support/random.rs"]
mod random;
mod support;

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::time::Duration;

use fass::{
    Commit, Dag, OverrunPolicy, Policy, Preemption, SubtaskAttributes, create_dag,
    finish_create_dags,
};
use random::Random;
use support::execute;
use virtual_time::{Report, VirtualTime};

const CASES: u64 = 400;

impl Random {
    fn pick<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())]
    }

    fn micros(&mut self, limit: usize) -> Duration {
        Duration::from_micros(u64::try_from(self.below(limit)).expect("small"))
    }

    /// Returns an execution time, often enough none.
    fn time(&mut self, limit: usize) -> Duration {
        let time = self.micros(limit);
        self.pick(&[time, time, time, time, Duration::ZERO])
    }

    /// Returns the attributes of a subtask that takes `time`: a WCET, unless the commit
    /// would refuse that, and now and then that it keeps its core. A WCET is never 0, or
    /// nothing would be proven.
    fn attributes(&mut self, name: &str, time: Duration, deadline: Duration) -> SubtaskAttributes {
        let mut attributes = SubtaskAttributes::named(name);
        if time <= deadline {
            attributes = attributes.wcet(time.max(Duration::from_nanos(1)));
        }
        if self.below(6) == 0 {
            attributes = attributes.non_preemptive();
        }
        attributes
    }
}

/// Registers a subtask of 1 to 3 inputs and, unless it is the sink, one output.
fn register(
    dag: &Dag,
    inputs: &[String],
    output: Option<&str>,
    deadline: Duration,
    (time, attributes): (Duration, SubtaskAttributes),
) {
    macro_rules! register {
        ($($value:ident: $Type:ty),*) => {{
            let inputs = inputs.iter().map(String::as_str).collect();
            let meet = move |($($value,)*): ($($Type,)*)| {
                execute(time);
                let values = [$($value),*];
                assert!(values.iter().all(|value| *value == values[0]), "{values:?}");
                values[0]
            };
            match output {
                Some(topic) => dag.register_subtask(
                    move |values: ($($Type,)*)| (meet(values),), inputs, vec![topic], attributes),
                None => dag.register_sink_subtask(
                    move |values: ($($Type,)*)| { meet(values); }, inputs, deadline, attributes),
            }
        }};
    }
    match inputs.len() {
        1 => register!(a: u64),
        2 => register!(a: u64, b: u64),
        _ => register!(a: u64, b: u64, c: u64),
    }
}

fn random_dag(random: &mut Random, name: &str) -> Dag {
    let dag = create_dag();
    let period = Duration::from_micros(500) + random.micros(1_500);
    let deadline = period.mul_f64(random.pick(&[0.5, 1.0, 2.5]));
    let policies = [
        OverrunPolicy::Queue,
        OverrunPolicy::Skip,
        OverrunPolicy::Abort,
    ];
    dag.name(name).offset(random.micros(1_000)).jobs(25);
    dag.overrun(random.pick(&policies));
    dag.in_flight(random.pick(&[1, 2, 3, 5]));
    let mut runs = 0_u64;
    let time = random.time(200);
    let attributes = random.attributes("source", time, deadline);
    let source = move || {
        execute(time);
        runs += 1;
        (runs,)
    };
    let topic = |number: usize| format!("{name} {number}");
    dag.register_periodic_subtask(source, vec![&topic(0)], period, attributes);
    let mut topics = vec![topic(0)];
    let mut unread = topics.clone();
    let inner = random.below(7);
    while topics.len() <= inner || unread.len() > 3 {
        // Beyond the wanted number, subtasks only join what nobody has read.
        let from = if topics.len() <= inner {
            &topics
        } else {
            &unread
        };
        let mut inputs: Vec<String> = Vec::new();
        for _ in 0..=random.below(3).max(usize::from(topics.len() > inner)) {
            let input = from[random.below(from.len())].clone();
            if !inputs.contains(&input) {
                inputs.push(input);
            }
        }
        unread.retain(|topic| !inputs.contains(topic));
        let output = topic(topics.len());
        let time = random.time(600);
        let attributes = random.attributes(&output, time, deadline);
        register(&dag, &inputs, Some(&output), deadline, (time, attributes));
        topics.push(output.clone());
        unread.push(output);
    }
    let time = random.time(300);
    let attributes = random.attributes("sink", time, deadline);
    register(&dag, &unread, None, deadline, (time, attributes));
    dag
}

/// Runs a case, with interrupts that are late by up to so many nanoseconds.
fn run(seed: u64, late_ns: u64) -> (Commit, Report) {
    let mut random = Random::new(seed);
    let machine = VirtualTime::new()
        .cores(random.pick(&[1, 2, 3, 4, 8]))
        .policy(random.pick(&[Policy::Edf, Policy::StaticPriority]))
        .preemption(random.pick(&[Preemption::Enabled, Preemption::Disabled]))
        .late(Duration::from_nanos(late_ns), seed);
    let names = ["first", "second", "third"];
    let count = 1 + random.below(names.len());
    let dags: Vec<Dag> = (names[..count].iter())
        .map(|name| random_dag(&mut random, name))
        .collect();
    let commit = finish_create_dags(&dags).unwrap_or_else(|error| panic!("{error}"));
    let report = machine.run();
    let violations = report.violations();
    assert!(violations.is_empty(), "{}", violations[0]);
    for statistics in report.dags().map(|dag| dag.statistics()) {
        let ended = statistics.completed + statistics.aborts + statistics.skips;
        assert_eq!(ended, 25, "{statistics:?}");
    }
    (commit, report)
}

/// Runs a case without late interrupts and returns how many of its DAGs were proven, and how many
/// jobs were queued, skipped and aborted.
fn case(seed: u64) -> (usize, [u64; 3]) {
    let (commit, report) = run(seed, 0);
    let (mut proven, mut overruns) = (0, [0; 3]);
    let statistics = report.dags().map(|dag| dag.statistics());
    for (statistics, answer) in statistics.zip(commit.answers()) {
        overruns[0] += statistics.queued;
        overruns[1] += statistics.skips;
        overruns[2] += statistics.aborts;
        let Some(bound) = answer.verdict.bound() else {
            continue;
        };
        proven += 1;
        assert_eq!(statistics.completed - statistics.misses, 25, "{answer}");
        let of_dag = report.jobs.iter().filter(|job| job.dag == answer.dag.id);
        for job in of_dag {
            let taken = job.response_time_ns().map(Duration::from_nanos);
            assert!(taken <= Some(bound), "{answer}, but {taken:?}");
        }
    }
    (proven, overruns)
}

#[test]
fn random_dags_keep_the_rules_and_the_bounds() {
    let (mut proven, mut overruns) = (0, [0; 3]);
    for seed in 0..CASES {
        match catch_unwind(AssertUnwindSafe(|| case(seed))) {
            Ok((of_case, of_policies)) => {
                proven += of_case;
                overruns = [0, 1, 2].map(|policy| overruns[policy] + of_policies[policy]);
            }
            Err(panic) => {
                eprintln!("the failing case is `case({seed})`");
                resume_unwind(panic);
            }
        }
    }
    assert!(overruns.iter().all(|jobs| *jobs > 100), "{overruns:?}");
    println!("{proven} DAGs of {CASES} commits were proven");
    assert!(proven > 50, "only {proven} bounds were put to the test");
}

#[test]
fn random_dags_keep_the_rules_where_interrupts_are_late() {
    let mut latest_ns = 0;
    for seed in 0..CASES / 4 {
        let (_, report) = run(seed, 100_000);
        let late_ns = report
            .jobs
            .iter()
            .map(|job| job.released_ns.unwrap() - job.release_ns);
        latest_ns = late_ns.max().unwrap_or(0).max(latest_ns);
    }
    assert!(latest_ns > 50_000, "{latest_ns} ns at most");
}
