//! The options for scheduling, for a commit's assumptions and for the printed lines of a run. They
//! are the same on every platform.

use alloc::format;

use fass::commit::Overheads;
use fass::edge::job_of;
use fass::log::Level::{Debug, Error, Info, Warn};
use fass::log::{Level, set_level};
use fass::platform::RunConfig;
use fass::{Policy, Preemption};

use crate::options::{CommandLine, UsageError};

const PREEMPTIONS: [(&str, Preemption); 2] =
    [("on", Preemption::Enabled), ("off", Preemption::Disabled)];

/// The configuration of a run stated by the command line.
#[derive(Clone, Copy, Debug)]
pub struct RunTerms {
    policy: Policy,
    preemption: Preemption,
    budget_factor: u64,
    overheads: Overheads,
    /// Whether a response time beyond its bound makes the app fail.
    pub judges_bounds: bool,
}

impl RunTerms {
    /// Takes the options, and sets the level of the log at once.
    pub fn read(options: &CommandLine<'_>) -> Result<Self, UsageError> {
        let levels = [Some(Info), None, Some(Error), Some(Warn), Some(Debug)];
        let levels = levels.map(|most| (most.map_or("off", Level::word), most));
        set_level(options.choice("log", &levels)?);
        let policies = Policy::ALL.map(|policy| (policy.word(), policy));
        Ok(Self {
            policy: options.choice("policy", &policies)?,
            preemption: options.choice("preemption", &PREEMPTIONS)?,
            budget_factor: options.number("budget_factor", 0..=1_000_000, 10)?,
            overheads: overheads(options)?,
            judges_bounds: options.choice("bounds", &[("judge", true), ("observe", false)])?,
        })
    }

    /// Copies the terms of commits into a platform's configuration.
    pub const fn apply(&self, terms: &mut RunConfig) {
        terms.scheduler.policy = self.policy;
        terms.scheduler.preemption = self.preemption;
        terms.budget_factor = self.budget_factor;
        terms.overheads = self.overheads;
    }
}

/// Takes the option `from`: a replay begins with the named job of a DAG, or before that job.
pub fn from<'a>(options: &CommandLine<'a>) -> Result<Option<(&'a str, u64)>, UsageError> {
    let Some(text) = options.text("from") else {
        return Ok(None);
    };
    let refused = || UsageError::new(format!("`from={text}`: DAG/JOB is wanted"));
    job_of(text).map(Some).ok_or_else(refused)
}

/// Takes the WCETs at the beginning of the app's file, as declared by the option `wcets`. Returns
/// the WCETs, if any, and the rest of the file.
pub fn split_wcets<'a>(
    options: &CommandLine<'_>,
    module: Option<&'a [u8]>,
) -> Result<(Option<&'a str>, Option<&'a [u8]>), UsageError> {
    let bytes = options.number("wcets", 0..=1 << 32, 0)?;
    if bytes == 0 {
        return Ok((None, module));
    }
    let parts =
        split(module, bytes).and_then(|(wcets, rest)| Some((str::from_utf8(wcets).ok()?, rest)));
    let (wcets, rest) =
        parts.ok_or_else(|| UsageError::new("`wcets`: the module is no such text"))?;
    Ok((Some(wcets), rest))
}

/// Returns the first `bytes` of an app's file, and any rest; `None` if the file is shorter.
pub fn split(module: Option<&[u8]>, bytes: u64) -> Option<(&[u8], Option<&[u8]>)> {
    let (first, rest) = module?.split_at_checked(usize::try_from(bytes).ok()?)?;
    Some((first, Some(rest).filter(|rest| !rest.is_empty())))
}

fn overheads(options: &CommandLine<'_>) -> Result<Overheads, UsageError> {
    /// The fewest numbers a user has to state.
    const LEAST: usize = 3;
    let numbers = options.numbers("overheads_ns", 0..=1_000_000_000, &[0; LEAST])?;
    let mut terms_ns = [0; Overheads::WORDS.len()];
    match terms_ns.get_mut(..numbers.len()) {
        Some(stated) if stated.len() >= LEAST => stated.copy_from_slice(&numbers),
        _ => {
            return Err(UsageError::new(format!(
                "`overheads_ns` has {} numbers; give {LEAST} to {}: {}",
                numbers.len(),
                Overheads::WORDS.len(),
                Overheads::WORDS.join(", ")
            )));
        }
    }
    let overheads = Overheads::of_terms_ns(terms_ns);
    if !overheads.device_leaves_time() {
        return Err(UsageError::new(
            "`overheads_ns` has a device interrupt as long as its distance, which leaves a core no \
             time; state a longer distance",
        ));
    }
    Ok(overheads)
}
