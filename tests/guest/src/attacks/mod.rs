//! What safe code can do to harm others, next to a DAG that must not notice.
//!
//! As in the app `faults`, a healthy DAG runs next to a doomed one, whose middle
//! subtask commits a *crime* in one of its jobs. These crimes are against what all
//! share: the heap, the serial line, locks. Each is committed in a boot of its own,
//! since what it uses up stays so. (`test=attack attack=NAME`.)

mod heap;
mod locks;
mod output;

use fass::finish_create_dags;
use faults::crimes::Crime;
use faults::{JOBS, Policy, doomed, doomed_at_leisure, healthy};
use kernel::{Ending, Machine, json};

/// Whether the crime has a budget.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Time {
    /// It is ended after 6 ms.
    Limited,
    /// It may take as long as it wants.
    Unlimited,
}

/// Every attack, by name.
const ATTACKS: [(&str, (Crime, Time)); 15] = [
    ("leak_strings", (heap::leak_strings, Time::Unlimited)),
    ("keep_boxes", (heap::keep_boxes, Time::Unlimited)),
    (
        "allocator_stack",
        (heap::overflow_in_the_allocator, Time::Limited),
    ),
    ("display_panics", (output::display_panics, Time::Limited)),
    ("display_prints", (output::display_prints, Time::Limited)),
    ("display_loops", (output::display_loops, Time::Limited)),
    ("message_1_mb", (output::message_1_mb, Time::Unlimited)),
    ("message_10_mb", (output::message_10_mb, Time::Unlimited)),
    ("flood", (output::flood, Time::Unlimited)),
    ("forge_lines", (output::forge_lines, Time::Limited)),
    ("forge_message", (output::forge_message, Time::Limited)),
    ("forge_list", (output::forge_list, Time::Limited)),
    ("forge_kind", (output::forge_kind, Time::Limited)),
    ("lock_twice", (locks::lock_twice, Time::Limited)),
    ("lock_loop", (locks::loop_in_section, Time::Limited)),
];

/// Commits the attack that the command line names, and prints what came of it.
pub(crate) fn run(machine: &Machine) -> Result<(), Ending> {
    let (crime, time) = machine.options().choice("attack", &ATTACKS)?;
    machine.options().finish(&["test", "attack"])?;
    machine.accept_faults(); // here they are what is wanted
    let attacker = match time {
        Time::Limited => doomed(crime, Policy::End),
        Time::Unlimited => doomed_at_leisure(crime),
    };
    finish_create_dags(&[healthy(), attacker])?;
    let run = machine.run()?;
    let of_healthy = run.statistics("healthy");
    let of_doomed = run.statistics("doomed");
    json::emit("attack", |line| {
        line.number("jobs", JOBS)
            .number("healthy_jobs", of_healthy.completed)
            .number("healthy_misses", of_healthy.misses)
            .number("healthy_faults", of_healthy.faults)
            .number("doomed_jobs", of_doomed.completed)
            .number("doomed_faults", of_doomed.faults);
    });
    Ok(())
}
