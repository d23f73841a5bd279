//! Attacks by safe code on others, next to a DAG that must not notice.
//!
//! As in the app `faults`, a healthy DAG runs next to a doomed DAG, whose middle subtask commits a
//! *crime* in one of its jobs. These crimes are directed against shared things: the heap, the
//! serial line, locks. The attacks of a boot run one after the other. An attack using up its
//! target, or making the whole run fail, has a boot of its own (`test=attack attack=NAME`).

mod heap;
mod locks;
mod output;

use alloc::vec::Vec;

use fass::{SubtaskAttributes, create_dag, finish_create_dags};
use faults::crimes::{Crime, Unpunished};
use faults::{FaultPolicy, JOBS, PERIOD, doomed, doomed_at_leisure, healthy};
use kernel::{AppError, Machine, json};

/// An attack: its name, the crime, and whether a budget of 6 ms limits it.
type Attack = (&'static str, Crime, bool);

/// The attacks leaving their target usable for the next attack.
const TOGETHER: [Attack; 12] = [
    ("allocator_stack", heap::overflow_in_the_allocator, true),
    ("display_panics", output::display_panics, true),
    ("display_prints", output::display_prints, true),
    ("display_loops", output::display_loops, true),
    ("message_1_mb", || output::panic_with(1_000_000), false),
    ("message_10_mb", || output::panic_with(10_000_000), false),
    ("forge_lines", output::forge_lines, true),
    ("forge_message", output::forge_message, true),
    ("forge_kind", output::forge_kind, true),
    ("lock_twice", locks::lock_twice, true),
    ("lock_loop", locks::loop_in_section, true),
    ("flood", output::flood, false),
];

/// The attacks in need of their own boots.
const ALONE: [Attack; 4] = [
    ("commit", commit, false),
    ("leak_strings", heap::leak_strings, false),
    ("keep_boxes", heap::keep_boxes, false),
    ("forge_list", output::forge_list, true),
];

/// Commits DAGs while others run; the kernel refuses them.
fn commit() -> Unpunished {
    let dag = create_dag();
    dag.period(PERIOD).relative_deadline(PERIOD);
    dag.register_untyped_subtask(|_| (), SubtaskAttributes::named("second"));
    let refused = finish_create_dags(&[dag]).expect_err("others run");
    panic!("{refused}")
}

/// Runs the attack named by the command line, or all of [`TOGETHER`] one after the other, and
/// prints the result of each.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    let named = machine.options().text("attack");
    machine.options().finish(&["test", "attack"])?;
    let attacks: Vec<Attack> = match named {
        None => TOGETHER.to_vec(),
        Some(name) => ALONE.into_iter().filter(|it| it.0 == name).collect(),
    };
    machine.accept_faults(); // here they are what is wanted
    for (name, crime, is_limited) in attacks {
        let attacker = match is_limited {
            true => doomed(crime, FaultPolicy::End),
            false => doomed_at_leisure(crime),
        };
        finish_create_dags(&[healthy(), attacker])?;
        let run = machine.run()?;
        let of_healthy = run.statistics("healthy");
        let of_doomed = run.statistics("doomed");
        json::emit("attack", |line| {
            line.text("name", name)
                .number("lost_jobs", JOBS - of_healthy.completed)
                .number("misses", of_healthy.misses + of_healthy.faults)
                .number("faults", of_doomed.faults);
        });
    }
    Ok(())
}
