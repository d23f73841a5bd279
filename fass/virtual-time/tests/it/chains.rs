//! End-to-end times in virtual time: those that the events tell are those that the values tell,
//! and no longer than the commit's bounds.
//!
//! More or other sets: `CHAINS=100000 CHAIN_SEED=7 cargo test -p virtual-time --test it chains`.

use crate::support::{Seen, every, ms, taking, work};
use fass::commit::{ConstructionPolicy, EndToEnd, finish_create_dags_with};
use fass::shared::{Latest, Sample};
use fass::{Dag, Policy};
use random::Random;
use virtual_time::{InstanceRecord, Report, VirtualTime};

/// The job of the first DAG that a value goes back to.
type Origin = Option<u64>;

/// Draws a WCET, and what takes up to it.
fn times(random: &mut Random) -> (u64, impl FnMut() + Send + use<>) {
    let wcet = random.within(1..=4);
    let least = random.within(0..=wcet);
    let mut random = Random::new(random.number());
    (wcet, move || work(random.within(least..=wcet)))
}

/// Draws a DAG, of which the first subtask samples, or begins the chain; the second one ends it.
fn draw(
    random: &mut Random,
    name: &str,
    from: Option<&Latest<Origin>>,
    seen: &Seen<Origin>,
) -> (Dag, Latest<Origin>) {
    let period = random.within(20..=60);
    let dag = every(period, name);
    dag.offset(ms(random.within(0..=30))).jobs(3000 / period);
    let (into, out_of) = (format!("into {name}"), format!("out of {name}"));
    let (wcet, mut enter) = times(random);
    let attributes = taking("enter", wcet);
    if let Some(latest) = from {
        let pass = move |sample: Option<Sample<'_, Origin>>| {
            let origin = sample.and_then(|sample| *sample.value);
            enter();
            (origin,)
        };
        let source = dag.using(latest.sample()).source(pass);
        source.writes(&[&into]).register(attributes);
    } else {
        let mut jobs = 0_u64..;
        let begin = move || {
            enter();
            (jobs.next(),)
        };
        dag.source(begin).writes(&[&into]).register(attributes);
    }
    let (wcet, mut leave) = times(random);
    let keep = seen.clone();
    let pass = move |(origin,): (Origin,)| {
        leave();
        keep.add(origin);
        (origin,)
    };
    dag.register_subtask(
        pass,
        [into.as_str()],
        [out_of.as_str()],
        taking("leave", wcet),
    );
    let latest = dag.latest(&out_of);
    (dag, latest)
}

/// Runs three DAGs in a chain, and returns what its last subtask saw, too.
fn run(random: &mut Random) -> (Report, EndToEnd, Vec<Origin>) {
    let policy = random.one_of(&[Policy::StaticPriority, Policy::Edf]);
    let cores = random.within(1..=2);
    let machine = VirtualTime::new().cores(cores).policy(policy);
    let (seen, ignored) = (Seen::default(), Seen::default());
    let (camera, out) = draw(random, "camera", None, &ignored);
    let (plan, out) = draw(random, "plan", Some(&out), &ignored);
    let (motor, end) = draw(random, "motor", Some(&out), &seen);
    let last = every(4000, "log");
    let log = last.jobs(1).using(end.sample());
    let log = log.source(|_: Option<Sample<'_, Origin>>| ());
    log.register(taking("log", 0));
    let dags = [camera, plan, motor, last];
    let commit = finish_create_dags_with(&dags, ConstructionPolicy::any_graph());
    let chains = commit
        .expect("a sound set")
        .chains_between("camera/enter", "motor/leave");
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
        let task_set = report.task_set();
        let camera = task_set.dag(task_set.find("camera"));
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
