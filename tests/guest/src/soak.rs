//! Random rounds of scenarios on the machine, as requested by `./scripts/soak`.

use alloc::format;
use core::time::Duration;

use ::scenarios::Scenario;
use kernel::{AppError, Machine, MemoryInUse, Run};

use crate::scenarios::{judged, print};

/// The most bytes of the heap a fault keeps for good: its body, and everything owned by the body.
const KEPT_BYTES: usize = 1024;

/// Runs `rounds` random rounds of `round_ms`, from round `first` of a `seed` on, each twice: after
/// the second run the machine must hold no more memory than after the first, except for
/// [`KEPT_BYTES`] for each fault. Prints the errors of each run.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    let options = machine.options();
    let seed = options.number("seed", 0..=u64::MAX, 1)?;
    let first = options.number("first", 0..=1_000_000, 0)?;
    let rounds = options.number("rounds", 1..=1_000_000, 1)?;
    let length = Duration::from_millis(options.number("round_ms", 1..=10_000, 500)?);
    options.finish(&["test", "seed", "first", "rounds", "round_ms"])?;
    for round in first..first + rounds {
        let scenario = Scenario::random(seed, round, machine.cores(), length);
        let mut faults = 0;
        let mut judge = |run: &Run| {
            let (task_set, record) = (run.task_set(), run.record());
            let mut wrong = scenario.judge_run(run);
            wrong.extend(scenario.judge_accounts(task_set, record, |dag| run.statistics(dag)));
            if run.allocations() > 0 {
                wrong.push(format!("{} allocations", run.allocations()));
            }
            let dags = task_set.dags().iter();
            let of_all: u64 = dags.map(|dag| run.statistics(dag.name()).faults).sum();
            faults = usize::try_from(of_all).unwrap_or(usize::MAX);
            wrong
        };
        let wrong_at_first = judged(machine, &scenario, &mut judge)?;
        let before = machine.resources();
        let mut wrong = judged(machine, &scenario, &mut judge)?;
        let after = machine.resources();
        let most_bytes = before.heap_bytes + faults.saturating_mul(KEPT_BYTES);
        let expected = MemoryInUse {
            // How much a fault keeps to the byte depends on the heap's holes.
            heap_bytes: after.heap_bytes.clamp(before.heap_bytes, most_bytes),
            contexts_free: before.contexts,
            ..before
        };
        if after != expected {
            wrong.push(format!("in use are {after:?}, that should be {expected:?}"));
        }
        print(&scenario, &wrong_at_first);
        print(&scenario, &wrong);
    }
    Ok(())
}
