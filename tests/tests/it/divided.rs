//! A set divided by the commit, with owners and members, from its record: a replay divides the set
//! again in the same way, and the host judges by the cores in the record.

use std::time::Duration;

use fass::commit::{ConstructionPolicy, finish_create_dags_with};
use fass::{Dag, Occupation, SubtaskAttributes, create_dag, execute_for};
use recording::Commit;
use views::record::{CommittedDags, Record};
use virtual_time::VirtualTime;

const PERIOD: Duration = Duration::from_millis(10);

/// Each DAG, the times of its subtasks behind the source, which takes a millisecond, and its bound
/// in milliseconds. The commit makes the heavy DAG an owner of two cores, and `light` executes in
/// the time left on core 1.
const DAGS: [(&str, &[u64], u64); 4] = [
    ("heavy", &[4, 4, 4], 9),
    ("light", &[3], 8),
    ("lighter", &[2], 3),
    ("lightest", &[1], 5),
];

/// Builds the DAGs. Sources count from `from`, and the other subtasks pass the number on.
fn build(from: u64, demands_proof: bool) -> Vec<Dag> {
    let taking = |ms| {
        let time = Duration::from_millis(ms);
        let work = move || execute_for(time, Occupation::Hold);
        (work, SubtaskAttributes::default().wcet(time))
    };
    let dags = DAGS.map(|(name, times, _)| {
        let dag = create_dag();
        dag.name(name).jobs(5).relative_deadline(PERIOD);
        let (work, attributes) = taking(1);
        let mut counter = from;
        let count = move || {
            work();
            counter += 1;
            (counter,)
        };
        dag.record::<u64>(name);
        dag.register_periodic_subtask(count, vec![name], PERIOD, attributes);
        for (number, ms) in times.iter().enumerate() {
            let output = format!("{name} {number}");
            let (work, attributes) = taking(*ms);
            let pass = move |passed: (u64,)| {
                work();
                passed
            };
            dag.record::<u64>(&output);
            dag.register_subtask(pass, vec![name], vec![&*output], attributes);
        }
        if demands_proof {
            dag.demand_proof();
        }
        dag
    });
    dags.into()
}

/// Commits and runs DAGs, and returns the recording's bytes, and the host's reading of them.
fn record(machine: &VirtualTime, dags: &[Dag]) -> (Vec<u8>, Record) {
    let commit = finish_create_dags_with(dags, ConstructionPolicy::any_graph());
    assert!(commit.expect("nothing is wrong").first_unproven().is_none());
    let report = machine.run();
    assert_eq!(report.violations(), []);
    assert_eq!((report.divergence, report.uncompared), (None, 0));
    for job in &report.jobs {
        let bound_ns = DAGS[job.dag.index()].2 * 1_000_000;
        assert!(job.response_time_ns() <= Some(bound_ns), "{job:?}");
    }
    let bytes = machine.recording();
    let record = Record::read(&bytes).expect("whole");
    (bytes, record)
}

#[test]
fn a_divided_set_is_recorded_replayed_and_judged() {
    for demands_proof in [false, true] {
        // Where a proof is demanded, cores are divided without that word.
        let machine = || match demands_proof {
            false => VirtualTime::new().cores(3).assign_clusters(),
            true => VirtualTime::new().cores(3),
        };
        let (bytes, recorded) = record(&machine(), &build(0, demands_proof));
        let [committed] = recorded.proven().expect("the same bounds") else {
            panic!("one commit")
        };
        let told = &committed.told;
        assert_eq!((&told.clusters[..], told.lists.len()), (&[2, 1][..], 2));
        assert_eq!(told.affinities, [(1, 1)]);
        let bounds = told.dags.iter().map(|dag| dag.bound_ns);
        let expected = DAGS.map(|(_, _, ms)| Some(ms * 1_000_000));
        assert_eq!(bounds.collect::<Vec<_>>(), expected);
        assert_eq!(views::findings::check(&recorded.runs[0], 0).breaches, []);

        let machine = machine().replay(&bytes).expect("whole");
        let (_, replayed) = record(&machine, &build(7, demands_proof));
        assert_eq!(replayed.commits[0].told, *told);
        assert_eq!(replayed.runs[0].events, recorded.runs[0].events);

        // By another affinity the same run is wrong, and the bound another one.
        let told = Commit {
            affinities: vec![(1, 0)],
            ..told.clone()
        };
        let other = CommittedDags::new(0, told).expect("it is sound");
        assert!(other.check_bounds().is_err());
        let mut run = recorded.runs[0].clone();
        run.task_set = other.task_set;
        assert_ne!(views::findings::check(&run, 0).breaches, []);
    }
}
