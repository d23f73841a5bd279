//! Small schedules, right and wrong, as text: when each DAG's subtask is ready, and then the
//! stretches of time in which one ran, as `dag@core from-to`.

use super::*;
use crate::ids::{ClusterId, DagId, SubtaskId};
use crate::policies::Policy;
use crate::policy::Preemption;
use crate::{
    CommitOptions, CoreDivision, CoreList, DagSpec, Priority, SubtaskSpec, Table, TableEntry,
    verify,
};

/// DAGs of one subtask each in these clusters, DAG 0 the most urgent; the last one's subtask
/// cannot be preempted if `keeps`.
pub(in crate::law) fn dags(clusters: &[u32], keeps: bool) -> TaskSet {
    listed(clusters, keeps, &[])
}

/// The same, the first DAGs in tables: each core has those in a row that name it.
fn listed(clusters: &[u32], keeps: bool, pins: &[Option<u32>]) -> TaskSet {
    placed(clusters, keeps, pins, &[])
}

/// The same, and the first DAGs with these affinities, if any, on four cores.
fn placed(clusters: &[u32], keeps: bool, pins: &[Option<u32>], affinities: &[&[u32]]) -> TaskSet {
    let spec = |(dag, &cluster): (u32, &u32)| DagSpec {
        period_ns: Some(100),
        relative_deadline_ns: Some(50 + u64::from(dag)),
        cluster: Some(ClusterId(cluster)),
        subtasks: vec![SubtaskSpec {
            priority: Some(Priority(dag)),
            non_preemptive: keeps && dag as usize + 1 == clusters.len(),
            ..SubtaskSpec::default()
        }],
        ..DagSpec::default()
    };
    let specs: Vec<DagSpec> = (0..).zip(clusters).map(spec).collect();
    let cores = if affinities.is_empty() { 2 } else { 4 };
    let options = CommitOptions::new(Policy::StaticPriority, cores);
    let options = match clusters.contains(&1) {
        true => options.with_clusters(CoreDivision::Of(vec![1, 1])),
        false => options,
    };
    let mut task_set = verify(&specs, &options).unwrap().task_set;
    let place = |(cluster, core): (&u32, &Option<u32>)| Some((*cluster, (*core)?));
    let places: Vec<_> = clusters.iter().zip(pins).map(place).collect();
    let tables = places.iter().flatten().copied().collect::<BTreeSet<_>>();
    let table = |(cluster, core)| {
        let is_there = |(_, place): &(u32, &Option<_>)| **place == Some((cluster, core));
        let own = (0..).zip(&places).filter(is_there);
        let own: Vec<(u32, u32)> = own.map(|(dag, _)| (dag, 0)).collect();
        table_of(cluster, core, &own)
    };
    task_set.set_tables(tables.into_iter().map(table).collect());
    for (dag, cores) in (0..).map(DagId).zip(affinities) {
        task_set.confine(dag, cores.to_vec());
    }
    task_set
}

/// A table of one core, by DAGs and depths.
fn table_of(cluster: u32, core: u32, entries: &[(u32, u32)]) -> Table {
    let entry = |&(dag, depth): &(u32, u32)| TableEntry {
        dag: DagId(dag),
        subtask: SubtaskId(0),
        job: 0,
        depth,
        start_ns: 0,
        length_ns: 0,
    };
    let entries = entries.iter().map(entry).collect();
    Table {
        cluster: ClusterId(cluster),
        lap_ns: 100,
        lists: Box::new([CoreList { core, entries }]),
    }
}

fn events(schedule: &str) -> Vec<Event> {
    let numbers = |text: &str| -> Vec<u64> {
        let numbers = text.split([' ', '@', '-']);
        numbers.map(|number| number.parse().unwrap()).collect()
    };
    let event = |time_ns, what, dag: usize, core| Event {
        time_ns,
        what,
        core: CoreId(u32::try_from(core).unwrap()),
        dag: DagId(u32::try_from(dag).unwrap()),
        job: 0,
        subtask: Some(SubtaskId(0)),
    };
    let (ready, ran) = schedule.split_once(": ").unwrap();
    let ready = numbers(ready).into_iter().enumerate();
    let mut events: Vec<Event> = ready
        .map(|(dag, ns)| event(ns, EventKind::Ready, dag, 0))
        .collect();
    let ran: Vec<Vec<u64>> = ran.split(", ").map(numbers).collect();
    for (place, stretch) in ran.iter().enumerate() {
        let [dag, core, from_ns, to_ns] = stretch[..] else {
            panic!("{stretch:?}")
        };
        let is_own = |other: &Vec<u64>| other[0] == dag;
        let begins = match ran[..place].iter().any(is_own) {
            true => EventKind::Resume,
            false => EventKind::Start,
        };
        let ends = match ran[place + 1..].iter().any(is_own) {
            true => EventKind::Suspend,
            false => EventKind::Finish,
        };
        let dag = usize::try_from(dag).unwrap();
        events.push(event(from_ns, begins, dag, core));
        events.push(event(to_ns, ends, dag, core));
    }
    events.sort_by_key(|event| event.time_ns);
    events
}

/// Compares what is found in a schedule with lines.
#[track_caller]
fn must(task_set: &TaskSet, cores: u32, schedule: &str, expected: &str) {
    // The deadlines are in the order of the priorities.
    for policy in [Policy::StaticPriority, Policy::Edf] {
        let options = SchedulerOptions {
            policy,
            preemption: Preemption::Enabled,
            cores,
        };
        let events = events(schedule).into_iter();
        let found = dispatch_violations(task_set, &options, JudgeOptions::EXACT, events);
        let found: Vec<_> = found.iter().map(ToString::to_string).collect();
        assert_eq!(found.join("\n"), expected, "{policy:?}");
    }
}

fn passed_over(at_ns: u64, waiting: u32, length_ns: u64, why: &str) -> String {
    format!(
        "at {at_ns} ns, R5 dispatch: subtask 0 of dag {waiting} job 0 should run and waits \
         {length_ns} ns while {why}"
    )
}

/// Returns the complaint about a DAG's subtask that executes from 0 on where it must not.
fn misplaced(rule: &str, dag: u32, end_ns: u64, why: &str) -> String {
    let does = |at_ns, what| {
        format!("at {at_ns} ns, {rule}: subtask 0 of dag {dag} job 0 {what} on core {why}")
    };
    does(0, "starts") + "\n" + &does(end_ns, "finishes")
}

/// Returns the complaint about an entry, or a member, that is not in the order of the table.
fn out_of_order(does: &str, at_ns: u64, other: &str) -> String {
    format!(
        "at {at_ns} ns, T1 table: subtask 0 of dag {does} and is out of the order that its table \
         has for subtask 0 of dag {other}"
    )
}

/// The last DAG's subtask keeps core 0 from 0 on.
fn chosen(last: u32) -> String {
    format!(
        "at 0 ns, R5 dispatch: subtask 0 of dag {last} job 0 starts on core 0 and keeps it, \
         although subtask 0 of dag 0 job 0 waits since 0 ns and goes first"
    )
}

#[test]
fn r5_accepts_preemption_and_a_full_machine() {
    let two = dags(&[0, 0], false);
    must(&two, 1, "4 0: 1@0 0-4, 0@0 4-9, 1@0 9-12", "");
    must(&two, 2, "2 0: 1@0 0-4, 0@1 2-9", "");
    must(&two, 1, "0 0: 1@0 0-0, 0@0 0-3", "");
}

#[test]
fn r5_finds_an_idle_core_and_a_missing_preemption() {
    let two = dags(&[0, 0], false);
    let idle = passed_over(0, 1, 4, "core 1 is idle");
    must(&two, 2, "0 0: 0@0 0-4, 1@0 4-9", &idle);
    let not_preempted = passed_over(4, 0, 5, "core 0 runs subtask 0 of dag 1 job 0");
    must(&two, 1, "4 0: 1@0 0-9, 0@0 9-12", &not_preempted);
    // Of two, the one with the larger key is preempted.
    let three = dags(&[0, 0, 0], false);
    let wrong_one = passed_over(4, 1, 2, "core 1 runs subtask 0 of dag 2 job 0");
    let ran = "4 0 0: 1@0 0-4, 2@1 0-9, 0@0 4-6, 1@0 6-8";
    must(&three, 2, ran, &wrong_one);
}

#[test]
fn r5_lets_a_started_instance_keep_its_core() {
    let two = dags(&[0, 0], true);
    must(&two, 1, "4 0: 1@0 0-9, 0@0 9-12", "");
    // Chosen at one instant, the smaller key comes first all the same.
    must(&two, 1, "0 0: 1@0 0-9, 0@0 9-12", &chosen(1));
    let lost = "at 6 ns, R5 dispatch: subtask 0 of dag 1 job 0 is resumed on core 0 although it \
                keeps its core until it finishes";
    must(&two, 1, "4 0: 1@0 0-4, 0@0 4-6, 1@0 6-9", lost);
}

#[test]
fn finds_a_core_or_an_instance_in_two_places() {
    let overlap = events("0 2: 0@0 0-4, 1@0 2-6");
    let found = crate::law::violations(&dags(&[0, 0], false), JudgeOptions::EXACT, overlap);
    let found: Vec<_> = found.iter().map(ToString::to_string).collect();
    let not_free = "at 2 ns, one core: core 0 runs subtask 0 of dag 1 job 0 while it still runs \
                    subtask 0 of dag 0 job 0";
    assert!(found.iter().any(|text| text == not_free), "{found:?}");
}

#[test]
fn r5_holds_within_each_cluster() {
    let three = dags(&[0, 0, 1], false);
    // DAG 1 waits for core 0, though core 1 is idle and runs a less urgent one.
    must(&three, 2, "0 0 2: 0@0 0-4, 1@0 4-9, 2@1 2-5", "");
    let idle = passed_over(2, 2, 3, "core 1 is idle");
    must(&three, 2, "0 0 2: 0@0 0-4, 1@0 4-9, 2@1 5-7", &idle);
    let outside = misplaced("R5 dispatch", 1, 5, "1, outside its cluster");
    must(&three, 2, "0 0 5: 0@0 0-4, 1@1 0-5, 2@1 5-7", &outside);
}

#[test]
fn t1_lets_entries_go_first_on_their_core() {
    // DAG 2, the least urgent, takes core 0 from DAG 0, which takes core 1 from DAG 1.
    let last = listed(&[0, 0, 0], false, &[None, None, Some(0)]);
    let right = "0 0 4: 0@0 0-4, 1@1 0-4, 2@0 4-6, 0@1 4-9, 1@0 6-9";
    must(&last, 2, right, "");
    let waits = passed_over(4, 2, 5, "core 0 runs subtask 0 of dag 0 job 0");
    must(&last, 2, "0 0 4: 0@0 0-9, 1@1 0-9, 2@0 9-12", &waits);
    // DAG 1 is the one that has to go.
    let wrong_one = passed_over(4, 0, 2, "core 1 runs subtask 0 of dag 1 job 0");
    let ran = "0 0 4: 0@0 0-4, 1@1 0-9, 2@0 4-6, 0@0 6-9";
    must(&last, 2, ran, &wrong_one);
    // An idle core is not idle for an entry of another core.
    must(&last, 2, "0 9 0: 2@0 0-4, 0@1 0-4, 1@0 9-12", "");
    let both = listed(&[0, 0], false, &[Some(1), Some(1)]);
    must(&both, 2, "0 0: 0@1 0-4, 1@1 4-9", "");
    let order = out_of_order("0 job 0 starts on core 1", 4, "1 job 0");
    must(&both, 2, "0 0: 1@1 0-4, 0@1 4-9", &order);
    let idle = passed_over(0, 0, 2, "core 1 is idle");
    must(&both, 2, "0 0: 0@1 2-4, 1@1 4-9", &idle);
    // While core 1 waits for that, core 0 is idle for what is in no table.
    let one = listed(&[0, 0], false, &[Some(1)]);
    let of_other = passed_over(0, 1, 4, "core 0 is idle");
    must(&one, 2, "0 0: 0@1 0-4, 1@0 4-9", &of_other);
}

#[test]
fn t1_and_t4_judge_cores_and_starts() {
    let one = listed(&[0, 0], false, &[Some(1)]);
    let off = misplaced("T1 table", 0, 4, "0, and its table has it on core 1");
    must(&one, 2, "0 4: 0@0 0-4, 1@1 4-9", &off);
    // A core of its cluster is meant.
    let second = listed(&[0, 0, 1], false, &[None, None, Some(0)]);
    must(&second, 2, "0 0 2: 0@0 0-4, 1@0 4-9, 2@1 2-5", "");
    // What keeps its core keeps it from entries, but starts after them.
    let keeps = listed(&[0, 0], true, &[Some(0)]);
    must(&keeps, 1, "2 0: 1@0 0-4, 0@0 4-9", "");
    let least = listed(&[0, 0], true, &[None, Some(0)]);
    must(&least, 1, "0 0: 1@0 0-4, 0@0 4-9", "");
    must(&keeps, 1, "0 0: 1@0 0-4, 0@0 4-9", &chosen(1));
}

#[test]
fn r5_judges_each_group_of_cores_by_itself() {
    // DAGs 0 and 1 on cores 0 and 2, DAG 2 on core 1, DAG 3 the owner of core 0.
    let pins = [None, None, None, Some(0)];
    let lent = placed(&[0; 4], false, &pins, &[&[0, 2], &[0, 2], &[1], &[]]);
    // DAG 0 gives way to the owner, and DAG 1 to it, though it is more urgent than DAG 2.
    let right = "0 0 0 4: 0@0 0-4, 1@2 0-4, 2@1 0-9, 3@0 4-6, 0@2 4-7, 1@0 6-9";
    must(&lent, 3, right, "");
    let wrong_one = passed_over(4, 0, 2, "core 2 runs subtask 0 of dag 1 job 0");
    let ran = "0 0 0 4: 0@0 0-4, 1@2 0-9, 2@1 0-9, 3@0 4-6, 0@0 6-9";
    must(&lent, 3, ran, &wrong_one);
    // Core 1 is not idle for DAG 1, and core 0 is, whatever runs elsewhere.
    must(&lent, 3, "0 0 0 0: 3@0 0-4, 0@2 0-4, 1@2 4-9, 2@1 0-2", "");
    let inside = passed_over(4, 1, 5, "core 0 is idle");
    let ran = "0 0 0 0: 3@0 0-4, 0@2 0-9, 1@0 9-12, 2@1 0-2";
    must(&lent, 3, ran, &inside);
    let idle = passed_over(0, 2, 2, "core 1 is idle");
    let ran = "0 0 0 9: 0@0 0-9, 1@2 0-9, 2@1 2-4, 3@0 9-12";
    must(&lent, 3, ran, &idle);
    let away = misplaced("T1 table", 1, 4, "3, to which its DAG has no affinity");
    let ran = "0 0 0 4: 0@0 0-4, 1@3 0-4, 2@1 0-4, 3@0 4-9";
    must(&lent, 4, ran, &away);
    // What keeps its core starts after the more urgent of its group, though another core is idle.
    let keeps = placed(&[0; 3], true, &[], &[&[0], &[1], &[0]]);
    must(&keeps, 2, "0 0 0: 0@0 0-4, 2@0 4-9, 1@1 0-9", "");
    must(&keeps, 2, "0 9 0: 2@0 0-4, 0@0 4-9, 1@1 9-12", &chosen(2));
    // Cores of its cluster are meant.
    let second = placed(&[0, 1, 1], false, &[None, None, Some(0)], &[&[], &[], &[]]);
    must(&second, 2, "0 0 2: 0@0 0-4, 1@1 0-2, 2@1 2-5, 1@1 5-6", "");
}

#[test]
fn t3_judges_what_is_nested() {
    let mut three = dags(&[0; 3], false);
    three.set_tables(vec![table_of(0, 0, &[(0, 0), (1, 1)])]);
    // DAG 1 is nested in DAG 0, and DAG 2 is a member.
    must(&three, 1, "0 2 0: 0@0 0-2, 1@0 2-4, 0@0 4-6, 2@0 6-9", "");
    // An inner entry whose outer one is over, or has only given way, is in its place.
    must(&three, 1, "0 6 0: 0@0 0-4, 2@0 4-6, 1@0 6-9, 2@0 9-12", "");
    must(&three, 1, "0 0 0: 1@0 0-4, 0@0 4-6, 2@0 6-9", "");
    // Not before the outer one is ready.
    let early = out_of_order("0 job 0 starts on core 0", 4, "1 job 0");
    must(&three, 1, "4 0 9: 1@0 0-4, 0@0 4-6, 2@0 9-12", &early);
    // It goes on at once, and nothing goes on before it has finished.
    let passed = passed_over(2, 1, 2, "core 0 runs subtask 0 of dag 0 job 0");
    must(&three, 1, "0 2 9: 0@0 0-4, 1@0 4-6, 2@0 9-12", &passed);
    let inner = out_of_order("0 job 0 is resumed on core 0", 4, "1 job 0");
    let owed = passed_over(4, 1, 2, "core 0 runs subtask 0 of dag 0 job 0");
    let ran = "0 2 9: 0@0 0-2, 1@0 2-4, 0@0 4-6, 1@0 6-8, 2@0 9-12";
    must(&three, 1, ran, &format!("{inner}\n{owed}"));
    let member = out_of_order("2 job 0 starts on core 0", 2, "0 job 0");
    let owed = passed_over(2, 0, 2, "core 0 runs subtask 0 of dag 2 job 0");
    let ran = "0 6 0: 0@0 0-2, 2@0 2-4, 0@0 4-6, 1@0 6-9";
    must(&three, 1, ran, &format!("{member}\n{owed}"));
}
