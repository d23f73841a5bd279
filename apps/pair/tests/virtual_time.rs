//! The pair in virtual time: what each side does over a link that delays, loses and reorders.

use std::time::Duration;

use fass::commit::Commit;
use fass::finish_create_dags;
use fass::shared::Wire;
use pair::{PERIOD, Role, build};
use ros::{Node, NodeOptions};
use virtual_time::{Link, LinkOptions, Report, Silent, VirtualTime};

const fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// How much later the right machine begins.
const OFFSET: Duration = ms(7);

/// The delay that the app states: the link's 2 ms, a jitter of 1 ms, and the sending subtask.
const STATED: Duration = Duration::from_micros(3_100);

fn side(role: Role, jobs: u64) -> ([Wire; 2], Commit) {
    let options = NodeOptions {
        identity: 1 + role as u128,
        ..NodeOptions::default()
    };
    let (dags, wires) = build(
        &mut Node::new("side", options),
        role,
        STATED,
        (jobs, PERIOD),
    );
    (wires, finish_create_dags(&dags).expect("it is sound"))
}

const LINK: LinkOptions = LinkOptions {
    delay: ms(2),
    jitter: ms(1),
    keeps_order: false,
    lost_of: 10,
    offset: OFFSET,
    seed: 7,
};

/// Runs the pair, with a link that is cut from 1001 to 2001 ms or is not, and returns reports,
/// recordings and the bounds of the DAGs `sense` and `act`.
fn run(options: LinkOptions, is_cut: bool) -> ([Report; 2], [Vec<u8>; 2], [Duration; 2]) {
    let machine = || VirtualTime::new().silent(Silent::Wcet);
    let left = machine();
    let (sensing, answers) = side(Role::Left, 300);
    let right = machine();
    let (acting, others) = side(Role::Right, 299);
    let mut link = Link::new([&left, &right], options);
    link.carry(0, &sensing[0], &acting[0]);
    link.carry(1, &acting[1], &sensing[1]);
    link.run_for(ms(1_001));
    link.set_up(!is_cut);
    link.run_for(ms(1_000));
    link.set_up(true);
    let reports = link.run_for(ms(1_019));
    let bounds = [answers.answer("sense"), others.answer("act")];
    let bounds = bounds.map(|answer| answer.verdict.bound().expect("it has one"));
    (reports, [left.recording(), right.recording()], bounds)
}

/// Returns a number of the last line that says how the peer does.
fn told(report: &Report, name: &str) -> i64 {
    let line = report.logs.last().expect("it says so");
    let (_, rest) = line.split_once(&format!("{name}=")).expect(line);
    let number = rest.split_whitespace().next().expect("a number");
    number.parse().expect(number)
}

#[test]
fn bounds_hold_with_the_stated_delay_and_each_side_replays_to_the_same_bytes() {
    let (reports, recordings, [sense, act]) = run(LINK, false);
    for report in &reports {
        assert_eq!(report.violations(), []);
    }
    let counts = reports[1].statistics("act");
    assert!((250..290).contains(&counts.completed), "{counts:?}");
    for job in reports[1].dag("act").jobs() {
        let ends = [job.release_ns, job.ended_ns].map(|at_ns| at_ns.expect("it is complete"));
        // On the left machine's time, since a measurement was due.
        let ages =
            ends.map(|at_ns| (Duration::from_nanos(at_ns) + OFFSET).as_nanos() % PERIOD.as_nanos());
        let most = [sense + STATED, sense + STATED + act].map(|most| most.as_nanos());
        assert!(ages[0] >= ms(2).as_nanos() && ages[0] <= most[0] && ages[1] <= most[1]);
    }
    assert_eq!(told(&reports[0], "exceeded"), 0);
    // The clocks are known up to half of the way there and back.
    let offset_ns = told(&reports[0], "offset_ns");
    assert!((offset_ns + 7_000_000).abs() <= 3_100_000, "{offset_ns}");
    assert_eq!(run(LINK, false).1, recordings);
    for (role, recording) in [(Role::Left, 300), (Role::Right, 299)]
        .into_iter()
        .zip(&recordings)
    {
        let machine = VirtualTime::new().silent(Silent::Wcet);
        let machine = machine.replay(recording).expect("it is whole");
        side(role.0, role.1);
        let report = machine.run();
        assert!(report.divergence.is_none() && report.compared > 250);
        assert_eq!(report.uncompared, 0);
    }
}

#[test]
fn a_link_slower_than_stated_is_counted_and_one_that_is_cut_leaves_the_left_its_own_wish() {
    let slow = LinkOptions {
        jitter: ms(40),
        ..LINK
    };
    assert!(told(&run(slow, false).0[0], "exceeded") > 20);
    let exact = LinkOptions {
        delay: ms(2),
        ..LinkOptions::default()
    };
    let ([report, _], ..) = run(exact, true);
    // Jobs 1 to 100 and 202 to 299 hear a wish: what is sent at 2000 ms is lost, too. Before them job 0
    // has none, and those from 105 on one that is older than 50 ms.
    assert_eq!(told(&report, "exchanges"), 100 + 98);
    assert_eq!(told(&report, "own"), 1 + (202 - 105));
}
