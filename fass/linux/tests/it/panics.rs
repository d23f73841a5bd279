//! Panics that no stack can be unwound from, and those that are raised with values of the app's.

use std::panic::panic_any;
use std::process::Command;
use std::sync::mpsc;
use std::thread;

use crate::locks;
use crate::support::{alone, breaches, chain, every, mechanisms, ms};
use fass::{SubtaskAttributes, finish_create_dags, sleep};
use linux::Control;

/// Panics when it is dropped.
struct Bomb;

impl Drop for Bomb {
    fn drop(&mut self) {
        panic!("in a destructor");
    }
}

/// Fails in one of the ways that a destructor of its own makes worse.
fn fail(how: usize) {
    match how {
        0 => {
            let _bomb = Bomb;
            panic!("with a bomb in scope");
        }
        1 => panic_any(Bomb),
        _ => drop(Bomb),
    }
}

/// The program's end is a part of what is tested, so it is this very test program, started anew.
#[test]
fn a_panic_that_cannot_unwind_costs_its_dag_alone() {
    let program = std::env::current_exe().expect("the program is there");
    let mut command = Command::new(program);
    command.args(["--exact", "panics::part", "--nocapture"]);
    let output = command.env(PART, "panics").output().expect("it starts");
    assert!(output.status.success(), "{output:?}");
}

const PART: &str = "FASS_LINUX_PART";

#[test]
fn part() {
    if std::env::var(PART).as_deref() == Ok("panics") {
        run_all();
        locks::lose(|| fail(0), "panic in a destructor during cleanup");
        // The harness would change the panic hook, in which threads sleep from now on.
        std::process::exit(0);
    }
}

fn run_all() {
    let causes = [
        "panic in a destructor during cleanup",
        "a panic without a message",
        "in a destructor",
    ];
    for mechanism in mechanisms() {
        for (how, cause) in (0..).zip(causes) {
            let alone = alone(2, mechanism);
            let [plain, waits] = ["plain", "waits"].map(|name| every(ms(2), name).jobs(4).clone());
            let plainly = move |job| {
                if job == 2 {
                    fail(how);
                }
            };
            plain.register_untyped_subtask(plainly, SubtaskAttributes::named("fails"));
            let mut jobs = 0..;
            let in_a_future = move || {
                let job = jobs.next();
                async move {
                    sleep(ms(0)).await;
                    if job == Some(2) {
                        fail(how);
                    }
                }
            };
            let in_a_future = waits.async_source(in_a_future);
            in_a_future.register(SubtaskAttributes::named("fails").wait(ms(1)));
            let healthy = chain("healthy", 3, 20, ms(1), 20);
            finish_create_dags(&[plain, waits, healthy]).expect("they are right");
            let run = alone.machine.run().expect("it is committed");
            assert_eq!(breaches(&run), []);
            let faults = run.faults().iter();
            let mut faults: Vec<_> = faults
                .map(|of| (of.instance.dag.0, of.instance.job, &*of.cause))
                .collect();
            faults.sort_unstable();
            assert_eq!(faults, [(0, 2, cause), (1, 2, cause)]);
            let completed = ["plain", "waits", "healthy"].map(|dag| run.statistics(dag).completed);
            assert_eq!(completed, [2, 2, 20]);
        }
    }
}

/// Looks for the run in another thread, where it is dropped.
struct Asks(mpsc::Sender<()>);

impl Drop for Asks {
    fn drop(&mut self) {
        let (told, tell) = mpsc::channel();
        thread::spawn(move || told.send(Control::get().is_none()));
        if tell.recv_timeout(ms(5_000)) == Ok(true) {
            let _ = self.0.send(());
        }
    }
}

#[test]
fn what_a_run_leaves_is_dropped_under_no_lock() {
    for mechanism in mechanisms() {
        let alone = alone(1, mechanism);
        let (told, tell) = mpsc::channel();
        let (dag, asks) = (every(ms(2), "asks"), Asks(told));
        dag.jobs(1);
        let own = move |_| _ = &asks;
        dag.register_untyped_subtask(own, SubtaskAttributes::named("owns"));
        finish_create_dags(&[dag]).unwrap();
        alone.machine.run().unwrap();
        assert_eq!(tell.try_recv(), Ok(()));
    }
}
