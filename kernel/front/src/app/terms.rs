//! The words that say how DAGs are scheduled, and what a commit reckons with. They are the same
//! wherever an app runs.

use alloc::format;

use fass::{Overheads, Policy, Preemption};

use crate::options::{Options, UsageError};

const POLICIES: [(&str, Policy); 2] = [("static", Policy::StaticPriority), ("edf", Policy::Edf)];

const PREEMPTIONS: [(&str, Preemption); 2] =
    [("on", Preemption::Enabled), ("off", Preemption::Disabled)];

/// What these words say.
#[derive(Clone, Copy, Debug)]
pub struct Terms {
    /// How ready instances are ordered.
    pub policy: Policy,
    /// Whether a started instance may lose its core.
    pub preemption: Preemption,
    /// The budget of a subtask that has a WCET only, in WCETs; 0 for none.
    pub budget_factor: u64,
    /// What a commit charges.
    pub overheads: Overheads,
}

impl Terms {
    /// Takes the words.
    pub fn read(options: &Options<'_>) -> Result<Self, UsageError> {
        Ok(Self {
            policy: options.choice("policy", &POLICIES)?,
            preemption: options.choice("preemption", &PREEMPTIONS)?,
            budget_factor: options.number("budget_factor", 0..=1_000_000, 10)?,
            overheads: overheads(options)?,
        })
    }
}

fn overheads(options: &Options<'_>) -> Result<Overheads, UsageError> {
    let mut numbers = options.numbers("overheads_ns", 0..=1_000_000_000, &[0, 0, 0])?;
    if numbers.len() == 3 {
        numbers.push(0);
    }
    let [context_switch_ns, dispatch_ns, interrupt_ns, ready_ns] = numbers[..] else {
        return Err(UsageError::new(format!(
            "`overheads_ns` has {} numbers; give three or four: context switch, dispatch, \
             interrupt, readiness",
            numbers.len()
        )));
    };
    Ok(Overheads {
        context_switch_ns,
        dispatch_ns,
        interrupt_ns,
        ready_ns,
    })
}
