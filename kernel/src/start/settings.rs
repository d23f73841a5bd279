//! The kernel's own options of the command line, known to every app.
//!
//! - `policy=static|edf`: the order of ready instances. Default: `static`.
//! - `preemption=on|off`: whether a started instance may lose its core. Default: `on`.
//! - `budget_factor=N`: the budget of a subtask that states only a WCET, in WCETs; 0: no budget.
//!   Default: 10.
//! - `overheads_ns=S,D,I,R,C,E`: the overheads charged by a commit: context switch, dispatch,
//!   interrupt, each instance becoming ready, and a device's interrupt every E ns. Default:
//!   0,0,0,0,0,0.
//! - `wcets=N`: the first N bytes of the loader's module are observed WCETs. Default: 0.
//! - `keep=N`: sends the record of the boot, to QEMU's debug port or in lines: commits, events,
//!   times, and the data crossing the edge of the run, from a buffer of N KiB; 0: no record.
//!   Default: 0.
//! - `events=off|on`: without `keep`, sends commits, events and times after each run. Default:
//!   `off`.
//! - `latest=N`: without `keep` and `replay`, and with a debug port, keeps the inputs of each DAG's
//!   last N jobs, 64 at most, and sends them after a fault; 0: keeps none. Default: 16.
//! - `replay=N`: the next N bytes of the loader's module are a recording to be replayed. Default:
//!   0.
//! - `from=DAG/JOB`: the replay begins with that job, or with the last job before it whose states
//!   are all recorded. Default: all jobs.
//! - `input=N`: the last N bytes of the loader's module are a script of bytes that arrive on wires.
//!   Default: 0.
//! - `trace_events=N`: the most events kept by a run's journal; 0: none. Default: as many as the
//!   run needs, or as fit into a quarter of the free memory.
//! - `bounds=judge|observe`: whether exceeding a proven bound makes a run fail. Default: `judge`.
//! - `log=off|error|warn|info|debug`: the least urgent level of the log still printed. Default:
//!   `info`.
//! - `idle=halt|poll`: whether idle cores halt, or poll for work, and so begin it sooner. Default:
//!   `halt`.
//! - `measure=nothing|interrupts|stacks`: whether to measure sections without interrupts, or each
//!   subtask's use of its stack. Default: `nothing`.
//! - `console=off|stop|on|echo`: whether a person can end a run by ctrl-C (`stop`), and talk to the
//!   kernel (`on`); `echo` also sends back typed bytes. Default: `off`.
//! - `status=N`: the seconds between two status lines of a run; 0: none. Default: 0.
//! - `mode=...`: the host's name for the meaning of time. `deterministic`: timers settle and
//!   computing cores take time slices, see `machine::counted_time` and `machine::time_slice`.
//!   `threads`: no bound is judged.
//! - `probe=off|on`: whether the image runs no app and only tests its machine, see `probe`.
//!   Default: `off`.
//! - `end=halt|off|reset`: the machine's action after the verdict, if no host ends it; takes effect
//!   at the very start. Default: `halt`.
//! - `clock=acpi-pm-timer|hpet|local-apic-1ghz|pit`: the clock used to measure time at the start.
//!   Default: the first of them that counts.
//! - `avx=on|off`: whether functions can use AVX, on a processor with AVX. Default: `on`.
//! - `x2apic=off|on`: whether local APICs are put into x2APIC mode; they are in any case if the
//!   firmware has left them so, or an id requires it. Default: `off`.
//! - `cores=0-3,6`: the processors to become cores, by their numbers. Default: all.
//! - `smt=on|off`: whether all siblings, processors that share a physical core, become cores.
//!   Default: `on`.
//!
//! # The processors that become cores: the options `cores=` and `smt=`
//!
//! A processor's *number* is its place in ACPI's table, except that the boot processor has number
//! 0, and is always a core. Siblings share a physical core; `smt=off` keeps the first of them.

use alloc::vec::Vec;
use core::ops::RangeInclusive;

use executive::machine::interrupts_off;
use executive::run::platform::KERNEL;
use executive::run::{edge, record, stacks, worker};
use fass::edge::EdgeMode;
use front::app::terms::{self, RunTerms};
use front::options::{CommandLine, UsageError, whole_number};

use crate::watch::background::{BackgroundOptions, ConsoleEcho};

/// The settings of runs to come, as stated by the command line; settings for other parts take
/// effect there at once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RunSettings {
    /// The settings shared by all platforms.
    pub(crate) chosen: RunTerms,
    /// The options for people's view of a run, and for their commands.
    pub(crate) wishes: BackgroundOptions,
}

/// Requests a recording or a replay of the runs to come, if the options say so. Returns the rest of
/// the module.
pub(crate) fn set_wish(
    options: &CommandLine<'static>,
    app: &'static str,
    mut module: Option<&'static [u8]>,
) -> Result<Option<&'static [u8]>, UsageError> {
    let replay_bytes = options.number("replay", 0..=1 << 32, 0)?;
    let kib = options.number("keep", 0..=1 << 20, 0)?;
    let jobs = options.number("latest", 0..=64, 16)?;
    if options.choice("events", &[("off", false), ("on", true)])? {
        record::start(false);
    }
    let wish = match (replay_bytes, kib, jobs) {
        (1.., 1.., _) => {
            let line = "`keep` excludes `replay`; give one";
            return Err(UsageError::new(line));
        }
        (1.., 0, _) => {
            let shorter = || UsageError::new("`replay`: the module is shorter than that");
            let (recording, rest) = terms::split(module, replay_bytes).ok_or_else(shorter)?;
            module = rest;
            EdgeMode::Replay {
                bytes: recording,
                from: terms::from(options)?,
            }
        }
        (0, 1.., _) => EdgeMode::Record {
            app,
            bytes: usize::try_from(kib * 1024).unwrap_or(0),
        },
        (0, 0, 1..) => EdgeMode::Latest {
            app,
            jobs: u32::try_from(jobs).unwrap_or(0),
        },
        (0, 0, 0) => return Ok(module),
    };
    if matches!(wish, EdgeMode::Record { .. }) {
        record::start(true);
    }
    edge::set_wish(wish);
    Ok(module)
}

/// Takes the kernel's options and applies them.
///
/// The machine has this many `processors`, cores or not.
pub(crate) fn apply(
    options: &CommandLine<'_>,
    processors: usize,
) -> Result<RunSettings, UsageError> {
    let chosen = RunTerms::read(options)?;
    let most_events = options.number("trace_events", 0..=u64::MAX, u64::MAX)?;
    KERNEL.change(|terms| {
        chosen.apply(terms);
        terms.most_events = most_events;
    });
    if options.choice("idle", &[("halt", false), ("poll", true)])? {
        worker::watch_when_idle();
    }
    let measures: [(_, fn()); 3] = [
        ("nothing", || ()),
        ("interrupts", interrupts_off::enable),
        ("stacks", stacks::enable),
    ];
    options.choice("measure", &measures)?();
    // Already applied at the start, so that a panic ends the machine likewise; here wrong values
    // are refused.
    options.choice("end", &[("halt", ()), ("off", ()), ("reset", ())])?;
    // These were applied at the start, too, where wrong values were refused.
    options.text("clock");
    options.text("mode");
    // These were applied at the start as well; here wrong values are refused.
    options.choice("avx", &[("on", ()), ("off", ())])?;
    options.choice("x2apic", &[("off", ()), ("on", ())])?;
    options.choice("smt", &[("on", ()), ("off", ())])?;
    if let Some(list) = options.text("cores") {
        check(list, processors)?;
    }
    // `on` never gets here: the probe replaces all this.
    options.choice("probe", &[("off", ()), ("on", ())])?;
    let status_s = options.number("status", 0..=86_400, 0)?;
    let consoles = [
        ("off", (None, false)),
        ("stop", (None, true)),
        ("on", (Some(ConsoleEcho::Off), true)),
        ("echo", (Some(ConsoleEcho::On), true)),
    ];
    let (console, stops) = options.choice("console", &consoles)?;
    Ok(RunSettings {
        chosen,
        wishes: BackgroundOptions {
            console,
            stops,
            status_ns: status_s * 1_000_000_000,
        },
    })
}

/// Returns the APIC ids of the processors that become cores, from the ids of all processors in the
/// order of their numbers. The ids of siblings differ in the lowest `sibling_bits` only; with 0
/// bits there are no siblings.
pub(super) fn select(
    ids: impl Iterator<Item = u32>,
    list: Option<&str>,
    sibling_bits: u32,
) -> Vec<u32> {
    let mut selected = Vec::new();
    for (id, number) in ids.zip(0..) {
        let is_listed = list.is_none_or(|list| names(list, number));
        if is_listed && !is_sibling(&selected, id, sibling_bits) {
            selected.push(id);
        }
    }
    selected
}

/// Counts the ids with a sibling before them.
pub(super) fn siblings(ids: &[u32], sibling_bits: u32) -> usize {
    let has_one = |place: &usize| is_sibling(&ids[..*place], ids[*place], sibling_bits);
    (0..ids.len()).filter(has_one).count()
}

fn is_sibling(ids: &[u32], id: u32, sibling_bits: u32) -> bool {
    ids.iter()
        .any(|other| other >> sibling_bits == id >> sibling_bits)
}

/// Checks that a list names some of `processors` processors, the first among them.
pub(super) fn check(list: &str, processors: usize) -> Result<(), UsageError> {
    let last = processors.saturating_sub(1) as u64;
    let is_right = |part: Option<RangeInclusive<u64>>| {
        part.is_some_and(|part| !part.is_empty() && *part.end() <= last)
    };
    if parts(list).all(is_right) && names(list, 0) {
        return Ok(());
    }
    let allowed = "allowed are numbers and ranges such as 0-3,6, with 0, which boots";
    Err(UsageError::new(alloc::format!(
        "`cores={list}`: {allowed}; the last processor is {last}"
    )))
}

fn names(list: &str, number: u64) -> bool {
    parts(list).flatten().any(|part| part.contains(&number))
}

/// Returns the ranges of a list, and `None` in place of each malformed range.
fn parts(list: &str) -> impl Iterator<Item = Option<RangeInclusive<u64>>> {
    list.split(',').map(|part| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        Some(whole_number(first)?..=whole_number(last)?)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four cores with two siblings each, and two without.
    const IDS: [u32; 10] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 10];

    fn processors(list: Option<&str>, bits: u32) -> Vec<u32> {
        select(IDS.into_iter(), list, bits)
    }

    #[test]
    fn a_list_selects_by_numbers() {
        assert_eq!(processors(None, 0), IDS);
        assert_eq!(processors(Some("0-2,9,1"), 0), [0, 1, 2, 10]);
        assert_eq!(processors(Some("0"), 0), [0]);
    }

    #[test]
    fn of_siblings_the_first_that_is_listed_stays() {
        assert_eq!(processors(None, 1), [0, 2, 4, 6, 8, 10]);
        assert_eq!(processors(Some("0,3,5,6,7"), 1), [0, 3, 5, 6]);
        assert_eq!(siblings(&IDS, 1), 4);
        assert_eq!(siblings(&[0, 3, 5, 6], 1), 0);
        assert_eq!(siblings(&IDS, 0), 0);
        assert_eq!(siblings(&[5, 4, 6, 7, 0], 2), 3);
    }

    #[test]
    fn a_list_names_processors_that_there_are_and_the_first() {
        for list in ["0", "0-3", "0-0,2", "3,1,0", "2-3,0-1"] {
            assert_eq!(check(list, 4), Ok(()), "{list}");
        }
        for list in [
            "", "1", "1-3", "0-4", "0,", "0-", "-1", "0-x", "3-1,0", "0 1", "0-1-2",
        ] {
            let message = check(list, 4).unwrap_err().to_string();
            assert!(message.starts_with(&format!("`cores={list}`: allowed are")));
            assert!(message.ends_with("; the last processor is 3"), "{message}");
        }
    }
}
