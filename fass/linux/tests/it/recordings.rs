//! Runs that are recorded, and replayed.

use std::fs::{self, File};
use std::process::Command;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use crate::support::{alone, mechanisms, ms};
use fass::shared::{Asker, DeviceDriver, create_device};
use fass::{Dag, SubtaskAttributes, create_dag, finish_create_dags};
use linux::Mechanism;

/// Results of one job after the other.
type Results = Arc<Mutex<Vec<u64>>>;

/// A DAG that counts in steps of `step`, and squares that; a device adds 1, if it does in time.
fn squaring(step: u64) -> (Dag, Results, DeviceDriver<u64, u64>) {
    let dag = create_dag();
    dag.name("squaring").jobs(20);
    dag.record::<u64>("count").record::<u64>("square");
    let named = SubtaskAttributes::named;
    let mut count = 0;
    let source = move || {
        count += step;
        (count,)
    };
    dag.register_periodic_subtask(source, vec!["count"], ms(2), named("count"));
    let (device, driver) = create_device::<u64, u64>("adder");
    device.record();
    let square = |adder: Asker<u64, u64>, (count,): (u64,)| async move {
        let square = count * count;
        (adder.ask(square).await.unwrap_or(square),)
    };
    let square = dag.using(device.asking()).async_subtask(square);
    let square = square.reads(&["count"]).writes(&["square"]);
    square.register(named("square").wait(Duration::from_micros(300)));
    let results = Results::default();
    let keep = Arc::clone(&results);
    let sink = move |(square,): (u64,)| keep.lock().expect("nobody panics").push(square);
    dag.register_sink_subtask(sink, vec!["square"], ms(2), named("keep"));
    (dag, results, driver)
}

/// Answers questions that are even, as long as there are any.
fn add(mut driver: DeviceDriver<u64, u64>) {
    loop {
        match linux::next_question(&mut driver, ms(1)) {
            // If it is too late, it is.
            Some((ticket, square)) if square % 2 == 0 => _ = driver.answer(ticket, square + 1),
            _ => {}
        }
    }
}

const PART: &str = "FASS_LINUX_PART";

/// One run of this very program, started anew, as a recording is of one commit: its source counts
/// in steps of `step`.
#[test]
fn part() {
    let Ok(part) = std::env::var(PART) else {
        return;
    };
    let [mechanism, step, path] = part.split(' ').collect::<Vec<_>>()[..] else {
        panic!("{part}");
    };
    let mechanism = mechanisms().find(|found| format!("{found:?}") == mechanism);
    let machine = alone(2, mechanism.expect("this computer has it")).machine;
    let replays = step != "1";
    if replays {
        machine.replay(fs::read(path).expect("it is recorded").leak(), None);
    } else {
        machine.keep("recordings", File::create(path).expect("a file"));
    }
    let (dag, results, driver) = squaring(step.parse().expect("a number"));
    finish_create_dags(&[dag]).expect("the DAG is right");
    // A replay is without the device.
    if !replays {
        thread::spawn(|| add(driver));
    }
    machine.run().expect("it is committed");
    let (outcome, _) = machine.end_recording(true);
    linux::Linux::end_record().expect("it is written");
    let objections = fass::platform::objections();
    assert_eq!(objections, [None, None]);
    let compared = outcome.map(|outcome| (outcome.compared, outcome.divergence));
    assert_eq!(compared, replays.then_some((20, None)));
    let results = results.lock().expect("nobody panics");
    assert_eq!(results.len(), 20);
    for (square, count) in results.iter().zip(1_u64..) {
        let least = count * count;
        let is_told = [least, least + (count + 1) % 2].contains(square);
        assert!(is_told, "{square} of {count}");
    }
}

/// Records by one mechanism, and replays by another one. A replay does not call the source, which
/// would count otherwise.
fn record_and_replay(by: [Mechanism; 2]) {
    let name = format!("fass-linux-{}.rec", std::process::id());
    let path = std::env::temp_dir().join(name);
    for (mechanism, step) in by.into_iter().zip([1, 7]) {
        let program = std::env::current_exe().expect("the program is there");
        let mut part = Command::new(program);
        part.args(["--exact", "recordings::part", "--nocapture"])
            .env(PART, format!("{mechanism:?} {step} {}", path.display()));
        let output = part.output().expect("it starts");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{mechanism:?}, {step}: {said}");
    }
    fs::remove_file(path).expect("it is ours");
}

#[test]
fn what_one_mechanism_records_another_one_replays() {
    let all: Vec<_> = mechanisms().collect();
    let others = all.iter().cycle().skip(1);
    (all.iter().zip(others)).for_each(|(one, other)| record_and_replay([*one, *other]));
}
