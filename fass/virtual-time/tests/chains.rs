//! End-to-end times in virtual time: those that the events tell are those that the values tell,
//! and no longer than the commit's bounds.
//!
//! More or other sets: `CHAINS=100000 CHAIN_SEED=7 cargo test -p virtual-time --test chains`.

#[path = "../../../sched-dag/tests/support/random.rs"]
mod random;
mod support;

use fass::{
    ConstructionPolicy, Count, Dag, EndToEnd, Latest, Policy, Sample, create_dag,
    finish_create_dags_with,
};
use random::Random;
use support::sharing::{Seen, ms, named, work};
use virtual_time::{InstanceRecord, Report, VirtualTime};

/// The job of the first DAG that a value goes back to.
type Origin = Option<u64>;

/// A DAG that is drawn: its times are in milliseconds.
struct Drawn {
    period: u64,
    offset: u64,
    /// Of its two subtasks: at most, and least.
    wcets: [u64; 2],
    least: [u64; 2],
    seed: u64,
}

impl Drawn {
    fn draw(random: &mut Random) -> Self {
        let wcets = [random.between(1, 4), random.between(1, 4)];
        Self {
            period: random.between(20, 60),
            offset: random.between(0, 30),
            wcets,
            least: wcets.map(|wcet| random.between(0, wcet)),
            seed: random.next(),
        }
    }

    /// Builds it: the first subtask samples, or begins the chain; the second one ends it.
    fn build(&self, name: &str, from: Option<&Latest<Origin>>, seen: &Seen<Origin>) -> Dag {
        let dag = create_dag();
        dag.name(name)
            .offset(ms(self.offset))
            .jobs(3000 / self.period);
        let mut random = Random::new(self.seed);
        let (least, wcets) = (self.least, self.wcets);
        let mut take = move |at: usize| work(random.between(least[at], wcets[at]));
        let mut take_later = take.clone();
        let attributes = |name, at: usize| named(name).wcet(ms(wcets[at]));
        let period = ms(self.period);
        let (into, out_of) = (format!("into {name}"), format!("out of {name}"));
        match from {
            Some(latest) => dag
                .period(period)
                .using(latest.sample())
                .source(move |sample: Option<Sample<'_, Origin>>| {
                    let origin = sample.and_then(|sample| *sample.value);
                    take(0);
                    (origin,)
                })
                .writes(&[&*into])
                .register(attributes("enter", 0)),
            None => {
                let mut job = 0_u64..;
                dag.register_periodic_subtask(
                    move || {
                        take(0);
                        (job.next(),)
                    },
                    vec![&*into],
                    period,
                    attributes("enter", 0),
                )
            }
        };
        let keep = seen.clone();
        dag.register_subtask(
            move |(origin,): (Origin,)| {
                take_later(1);
                keep.add(origin);
                (origin,)
            },
            vec![&*into],
            vec![&*out_of],
            attributes("leave", 1),
        );
        dag.relative_deadline(period);
        dag
    }
}

/// Runs three DAGs in a chain, and returns what its last subtask saw, too.
fn run(random: &mut Random) -> (Report, EndToEnd, Vec<Origin>) {
    let policy = [Policy::StaticPriority, Policy::Edf][random.below(2)];
    let machine = VirtualTime::new()
        .cores(u32::try_from(random.between(1, 2)).expect("small"))
        .policy(policy);
    let construction = ConstructionPolicy {
        sinks: Count::Several,
        ..ConstructionPolicy::paper()
    };
    let (seen, ignored) = (Seen::default(), Seen::default());
    let [first, second, third] = [(); 3].map(|()| Drawn::draw(random));
    let camera = first.build("camera", None, &ignored);
    let out = camera.latest("out of camera");
    let plan = second.build("plan", Some(&out), &ignored);
    let out = plan.latest("out of plan");
    let motor = third.build("motor", Some(&out), &seen);
    let end = motor.latest("out of motor");
    let last = create_dag();
    last.name("log").jobs(1).relative_deadline(ms(4000));
    last.period(ms(4000))
        .using(end.sample())
        .source(|_: Option<Sample<'_, Origin>>| ())
        .register(named("log").wcet(ms(0)));
    let dags = [camera, plan, motor, last];
    let commit = finish_create_dags_with(&dags, construction).expect("a sound set");
    let chains = commit.chains_between("camera/enter", "motor/leave");
    let [chain] = &chains[..] else {
        panic!("{chains:?}");
    };
    (machine.run(), chain.clone(), seen.all())
}

#[test]
fn ages_are_those_that_the_values_tell_and_stay_below_the_bounds() {
    let number = |variable: &str, default: u64| {
        let given = std::env::var(variable).ok();
        given.map_or(default, |text| text.parse().expect("a whole number"))
    };
    let (count, first) = (number("CHAINS", 60), number("CHAIN_SEED", 1));
    let (mut proven, mut equal) = (0, 0);
    for seed in (first..).take(usize::try_from(count).expect("a count")) {
        let mut random = Random::new(seed);
        let (report, chain, seen) = run(&mut random);
        assert_eq!(report.violations(), [], "seed {seed}");
        let latencies = report.latencies(&chain.chain);
        // The last output may come after a DAG of the chain has ended, and does not count then.
        let camera = report.task_set().dag(sched_dag::DagId(0));
        let outputs = report.dag("motor").subtask("leave");
        let of_output = |(output, origin): (&InstanceRecord, &Origin)| {
            Some(output.finish_ns? - camera.grid_ns((*origin)?))
        };
        let told: Vec<u64> = outputs.iter().zip(&seen).filter_map(of_output).collect();
        let found = &latencies.output_age_ns;
        assert_eq!(told[..found.len()], found[..], "seed {seed}");
        assert!(
            found.len() * 2 > seen.len(),
            "seed {seed}: {} of {}",
            found.len(),
            seen.len()
        );

        let most = |times: &[u64]| times.iter().max().copied().unwrap_or(0);
        let (data_age, reaction) = (most(&latencies.data_age_ns), most(&latencies.reaction_ns));
        assert!(reaction <= data_age, "seed {seed}");
        equal += u64::from(reaction == data_age);
        if let (Some(output_age), Some(bound)) = (chain.output_age, chain.reaction) {
            proven += 1;
            assert!(
                u128::from(most(found)) <= output_age.as_nanos(),
                "seed {seed}"
            );
            assert!(u128::from(data_age) <= bound.as_nanos(), "seed {seed}");
        }
    }
    println!("{count} sets: {proven} proven, in {equal} the longest data age is a reaction time");
    assert!(
        proven * 3 > count && equal == count,
        "{proven} and {equal} of {count}"
    );
}
