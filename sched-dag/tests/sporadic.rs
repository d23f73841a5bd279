//! The analysis takes a sporadic DAG for a periodic one: its bounds hold for any signals. (The
//! rules S1 to S4 are told by `tests/scenarios/sharing.txt` and `properties`.)

mod support;

use sched_dag::analysis::{Overheads, Settings, answer};
use sched_dag::law::{Tally, Terms, violations};
use sched_dag::lifecycle::Request;
use sched_dag::virtual_time::VirtualTime;
use sched_dag::{DagId, Instance};
use support::random::Random;
use support::{Script, Spec, TWO_CORES, commit, dag};

#[test]
fn bounds_hold_for_random_signals() {
    let settings = Settings {
        policy: TWO_CORES.policy,
        preemption: TWO_CORES.preemption,
        cores: TWO_CORES.cores,
        overheads: Overheads::default(),
    };
    let diamond = [(0, 1), (0, 2), (1, 3), (2, 3)];
    let mut bounded = 0;
    for seed in 0..400 {
        println!("seed {seed}");
        let mut random = Random::new(seed);
        let mut specs = [0, 1, 2].map(|level| {
            let period_ns = random.between(20, 80);
            let wcets_ns = [(); 4].map(|()| random.between(1, 5));
            let spec = dag(period_ns, period_ns, 20, &[level; 4], &diamond).wcets(&wcets_ns);
            spec.with(|spec| spec.in_flight = Some(2))
        });
        // The sporadic one has the least priority and is the first or the last DAG.
        specs[2] = specs[2].clone().sporadic();
        specs.rotate_right(usize::from(seed % 2 == 0));
        let sporadic = DagId(if seed % 2 == 0 { 0 } else { 2 });
        let mut at_ns = 0;
        let signals = [(); 60].map(|()| {
            at_ns += random.between(0, 40);
            (at_ns, Request::Signal(sporadic))
        });
        let task_set = commit(&specs, TWO_CORES);
        let bounds = answer(&task_set, &settings).bounds;
        let wcet_ns = |it: Instance| specs[it.dag.index()].subtasks[it.subtask.index()].wcet_ns;
        let script = Script::new(|it| wcet_ns(it).expect("each has one")).asking(signals);
        let run = script.run(VirtualTime::new(&task_set, TWO_CORES));
        let events = run.events.iter().copied();
        assert_eq!(violations(&run.task_set, Terms::EXACT, events), []);
        let mut tally = Tally::new(&run.task_set, 5);
        run.events.iter().for_each(|event| tally.take(event));
        for (dag, bound) in (0..).map(DagId).zip(bounds) {
            let Some(bound) = bound else { continue };
            bounded += 1;
            let responses = tally.dag(dag).response_time.distribution();
            assert!(responses.max() <= bound.bound_ns);
        }
    }
    assert!(bounded > 400, "{bounded} bounds were compared");
}
