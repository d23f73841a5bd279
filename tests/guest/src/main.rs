//! Runs one boot test in the guest: the one that `test=NAME` names.

#![no_std]
#![no_main]

extern crate alloc;

mod checksum;
mod crimes;
mod preemption;
mod storm;

use alloc::vec;
use core::time::Duration;

use fass::{SubtaskAttributes, create_dag, finish_create_dags};
use kernel::{Ending, Machine, json};

kernel::entry!(main);

/// A test: it prints its findings and fails by its ending, or by a panic.
type Test = fn(&Machine) -> Result<(), Ending>;

const TESTS: [(&str, Test); 9] = [
    ("commit_faults", commit_faults),
    ("panic", |_| panic!("a panic on purpose")),
    ("subtask_panic", subtask_panic),
    ("storm", storm::run),
    ("preemption", preemption::run),
    ("null_write", |_| crimes::write_to_null()),
    ("stack_overflow", |_| crimes::overflow_the_stack()),
    ("write_to_code", |_| crimes::write_to_code()),
    ("undefined_instruction", |_| crimes::execute_undefined()),
];

fn main(machine: &Machine) -> Result<(), Ending> {
    let test: Test = machine.options().choice("test", &TESTS)?;
    test(machine)
}

/// Commits every faulty DAG and prints what the commit says of it.
fn commit_faults(machine: &Machine) -> Result<(), Ending> {
    machine.options().finish(&["test"])?;
    guest_tests::faults::provoke(|case, fault, message| {
        json::emit("commit_fault", |line| {
            line.text("case", case)
                .text("fault", fault)
                .text("message", message);
        });
    });
    Ok(())
}

/// Runs a DAG whose sink panics in its job 2.
fn subtask_panic(machine: &Machine) -> Result<(), Ending> {
    let period = Duration::from_millis(1);
    let dag = create_dag();
    dag.name("doomed").jobs(5);
    let mut job = 0u32;
    let count = move || {
        job += 1;
        (job,)
    };
    dag.register_periodic_subtask(
        count,
        vec!["count"],
        period,
        SubtaskAttributes::named("count"),
    );
    let check = |(count,): (u32,)| assert!(count < 3, "a panic on purpose at count {count}");
    dag.register_sink_subtask(
        check,
        vec!["count"],
        period,
        SubtaskAttributes::named("check"),
    );
    finish_create_dags(&[dag])?;
    machine.run().map(drop)
}
