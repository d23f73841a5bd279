//! Clusters of cores in virtual time: what is apart, and what crosses.

mod support;

use fass::{ConstructionPolicy, Dag, Latest, Policy, Sample};
use fass::{create_dag, finish_create_dags, finish_create_dags_with};
use support::sharing::{Seen, every, job_numbers, ms, taking, work};
use virtual_time::{CoreId, VirtualTime};

/// A DAG of one subtask that takes `work_ms` in each of `jobs` periods of 10 ms.
fn busy(name: &str, cluster: u32, work_ms: u64, jobs: u64) -> Dag {
    let dag = every(10, name);
    dag.cluster(cluster)
        .jobs(jobs)
        .register_untyped_subtask(move |_job| work(work_ms), taking("work", work_ms));
    dag
}

#[test]
fn an_overload_in_one_cluster_leaves_the_other_alone() {
    let run = |overload_ms| {
        let machine = VirtualTime::new()
            .cores(3)
            .clusters(&[1, 2])
            .policy(Policy::Edf);
        let calm = busy("calm", 0, 6, 20);
        let loads = ["one", "two", "three"].map(|name| busy(name, 1, overload_ms, 20));
        let commit = finish_create_dags(&[&[calm][..], &loads].concat()).unwrap();
        let report = machine.run();
        assert_eq!(report.violations(), []);
        let calm = report.dag("calm").subtask("work");
        assert!(calm.iter().all(|record| record.core == Some(CoreId(0))));
        let misses = report.dags().map(|dag| dag.statistics().misses);
        let answers = commit.answers().iter().map(ToString::to_string);
        let (misses, answers) = (misses.collect::<Vec<_>>(), answers.collect::<Vec<_>>());
        (calm, misses, answers)
    };
    let (calm, misses, answers) = run(5);
    assert_eq!(misses, [0; 4]);
    assert_eq!(
        answers[0],
        "dag `calm` takes at most 6ms, by multiple paths; it runs in cluster 0, on 1 core from \
         core 0 on"
    );
    let (calm_beside_overload, misses, answers) = run(9);
    assert_eq!(calm_beside_overload, calm);
    assert_eq!(misses[0], 0);
    assert!(misses[1..].iter().all(|misses| *misses > 0), "{misses:?}");
    assert!(answers[0].contains("at most 6ms"), "{}", answers[0]);
    assert!(answers[1].contains("is not proven"), "{}", answers[1]);
}

/// Offers its job's number as `count` after 4 ms.
fn counting(cluster: u32) -> (Dag, Latest<u64>) {
    let dag = create_dag();
    dag.name("count").cluster(cluster).jobs(4);
    dag.relative_deadline(ms(10));
    let count = job_numbers(4);
    dag.register_periodic_subtask(count, vec!["count"], ms(10), taking("count", 4));
    let latest = dag.latest("count");
    (dag, latest)
}

#[test]
fn a_latest_value_crosses_at_the_instant_of_its_completion() {
    // Whichever of the two clusters comes first.
    for (writes, reads) in [(0, 1), (1, 0)] {
        let machine = VirtualTime::new().cores(2).clusters(&[1, 1]);
        let (writer, latest) = counting(writes);
        let reader = create_dag();
        reader.name("read").cluster(reads).jobs(20);
        reader.relative_deadline(ms(2));
        let (seen, keep) = Seen::shared();
        reader
            .period(ms(2))
            .using(latest.sample())
            .source(move |count: Option<Sample<'_, u64>>| keep.add(count.map(|count| *count.value)))
            .register(taking("read", 1));
        finish_create_dags(&[writer, reader]).unwrap();
        assert_eq!(machine.run().violations(), []);
        // Sample k is taken at 2k ms, value j shows from 10j + 4 ms on.
        let expected = (0..20_u64).map(|k| (2 * k).checked_sub(4).map(|since| since / 10));
        assert_eq!(seen.all()[..], expected.collect::<Vec<_>>());
    }
}

#[test]
fn the_commit_divides_the_cores_and_says_why() {
    let machine = VirtualTime::new().cores(4).assign_clusters();
    let heavy = every(10, "heavy");
    heavy.jobs(5);
    for name in ["left", "middle", "right"] {
        heavy.register_untyped_subtask(|_job| work(4), taking(name, 4));
    }
    let light = [("a", 7), ("b", 5), ("c", 4)].map(|(name, ms_of_work)| {
        let dag = every(10, name);
        dag.jobs(5)
            .register_untyped_subtask(move |_job| work(ms_of_work), taking("work", ms_of_work));
        dag
    });
    let dags = [&light[..1], &[heavy], &light[1..]].concat();
    let commit = finish_create_dags_with(&dags, ConstructionPolicy::any_graph()).unwrap();
    let places = commit.answers().iter().map(|answer| {
        let place = answer.cluster.as_ref().expect("the cores are divided");
        place.to_string()
    });
    let emptiest = "the emptiest one";
    assert_eq!(
        places.collect::<Vec<_>>(),
        [
            format!("in cluster 1, on 1 core from core 2 on: {emptiest}"),
            "in cluster 0, on 2 cores from core 0 on: its own, as a job is 12ms of work within 10ms"
                .to_owned(),
            format!("in cluster 2, on 1 core from core 3 on: {emptiest}"),
            format!("in cluster 2, on 1 core from core 3 on: {emptiest}"),
        ]
    );
    assert!(commit.first_unproven().is_none());
    let report = machine.run();
    assert_eq!(report.violations(), []);
    assert!(report.dags().all(|dag| dag.statistics().misses == 0));
}

#[test]
fn a_commit_that_divides_the_cores_takes_no_cluster_from_a_dag() {
    let _machine = VirtualTime::new().assign_clusters();
    let error = finish_create_dags(&[busy("calm", 0, 6, 5)]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "dag `calm` gets no cores: it states a cluster, and the commit is to make them; leave its \
         cluster out"
    );
}

#[test]
fn of_two_ways_to_divide_the_cores_the_last_counts() {
    let machine = VirtualTime::new().clusters(&[1]).assign_clusters();
    let dag = busy("calm", 0, 6, 1);
    let stated = finish_create_dags(&[dag]).unwrap_err();
    assert_eq!(stated.faults()[0].code(), "not_assigned");
    drop(machine);
    let _machine = VirtualTime::new().assign_clusters().clusters(&[1]);
    let commit = finish_create_dags(&[busy("calm", 0, 6, 1)]).unwrap();
    let place = commit.answers()[0].cluster.as_ref().unwrap();
    assert_eq!(place.why, None);
}
