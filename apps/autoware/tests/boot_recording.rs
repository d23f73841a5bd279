//! The system on the machine: a run that it recorded is replayed there and on the host.

use std::fs;
use std::time::Duration;

use autoware::Workload;
use fass::{ConstructionPolicy, Count, Occupation, Policy, finish_create_dags_with};
use harness::Guest;
use tool::outcome::Outcome;
use tool::{recordings, system};
use virtual_time::VirtualTime;

#[test]
fn a_run_that_the_machine_recorded_is_replayed_on_the_machine_and_on_the_host() {
    let file = system::new_log("autoware").expect("a folder for logs");
    let file = file.with_extension("rec");
    let guest = Guest::new("autoware").word("jobs=20");
    let recorded = guest.clone().cores(4).records(&file, 1024).succeed();
    let bytes = recordings::received(&file).expect("the guest has sent it");
    fs::write(&file, &bytes).expect("it is our file");
    let replayed = guest.cores(2).replays(&file).word("policy=edf").succeed();
    let _ = fs::remove_file(&file);

    let number = |outcome: &Outcome, kind: &str, name: &str| {
        let line = outcome.transcript.of_kind(kind).next();
        line.and_then(|line| line.number_at(name)).expect(name)
    };
    let wanted = number(&recorded, "autoware", "digest");
    let compared = number(&replayed, "replayed", "compared");
    assert_eq!(number(&replayed, "autoware", "digest"), wanted);
    assert_eq!(number(&replayed, "replayed", "uncompared"), 0);
    assert!(compared > 100, "{compared}");

    for policy in [Policy::StaticPriority, Policy::Edf] {
        let machine = VirtualTime::new().cores(8).policy(policy);
        let machine = machine.replay(&bytes).expect("it is whole");
        let system = Workload {
            jobs: 20,
            crunch: Duration::from_millis(4),
            least_percent: 50,
            seed: 1,
            occupation: Occupation::Hold,
        }
        .build();
        system.record();
        let construction = ConstructionPolicy {
            sources: Count::Several,
            sinks: Count::Several,
            ..ConstructionPolicy::paper()
        };
        finish_create_dags_with(&system.dags, construction).expect("it is what was recorded");
        let report = machine.run();
        assert_eq!((report.compared, report.divergence), (compared, None));
        assert_eq!(system.digest(), wanted);
    }
}
