//! The kernel's own words of the command line, which every app has.
//!
//! | word | meaning | default |
//! | --- | --- | --- |
//! | `policy=static\|edf` | how ready instances are ordered | `static` |
//! | `preemption=on\|off` | whether a started instance may lose its core | `on` |
//! | `budget_factor=N` | budget of a subtask with a WCET only, in WCETs; 0: none | 10 |
//! | `overheads_ns=S,D,I,R` | what a commit charges: context switch, dispatch, interrupt, and for each instance that becomes ready | 0,0,0,0 |
//! | `wcets=N` | the first N bytes of the loader's module are WCETs that were observed | 0 |
//! | `keep=N` | the record of the boot is sent, to QEMU's debug port or in lines: commits, events, times, and what crosses the edge of the run, from a buffer of N KiB; 0: it is not | 0 |
//! | `record=N` | the same, and it is an error if no topic is recorded | 0 |
//! | `events=off\|on` | if neither is given: commits, events and times are sent, when a run is over | `off` |
//! | `latest=N` | if neither is given and there is a debug port: the inputs of each DAG's last N jobs, 64 at most, are kept, and sent after a fault; 0: none are | 16 |
//! | `replay=N` | the next N bytes of the loader's module are a recording, which is replayed | 0 |
//! | `from=DAG/JOB` | the replay begins with that job, or with the last one before it of which all states are recorded | all jobs |
//! | `trace_events=N` | the most events that a run's journal keeps; 0: none | what the run needs, or a quarter of the free memory |
//! | `bounds=judge\|observe` | whether a run fails that exceeds a proven bound | `judge` |
//! | `log=off\|error\|warn\|info\|debug` | up to which level lines of the log are said | `info` |
//! | `idle=halt\|poll` | whether idle cores halt, or watch for work, which wakes them sooner | `halt` |
//! | `measure=nothing\|interrupts\|stacks` | whether sections without interrupts are measured, or how much each subtask uses of its stack | `nothing` |
//! | `console=off\|stop\|on\|echo` | whether a person can end a run by ctrl-C (`stop`), and talk to the kernel; `echo` sends back what is typed | `off` |
//! | `status=N` | seconds between two lines that say how a run does; 0: none | 0 |
//! | `mode=...` | the host's name for what time means; `deterministic`: timers settle and computing cores take turns, see `machine::counted_time` and `turns`; `threads`: no bound is judged | |
//! | `probe=off\|on` | whether the image runs no app and only shows what its machine does, see `probe` | `off` |
//! | `end=halt\|off\|reset` | what the machine does after the verdict, if no host ends it; it holds from the start on | `halt` |
//! | `clock=acpi-pm-timer\|hpet\|local-apic-1ghz\|pit` | by which clock time is measured at the start | the first of them that counts |
//! | `avx=on\|off` | whether functions can use AVX, where the processor has it | `on` |
//! | `x2apic=off\|on` | whether local APICs are put into x2APIC mode; where the firmware has left them so, or an id asks for it, they are | `off` |
//! | `cores=0-3,6` | which processors become cores, by their numbers, see `selection` | all |
//! | `smt=on\|off` | whether siblings, processors that share a physical core, all become cores | `on` |

use fass::edge::Wish;

use super::selection;
use crate::options::{Options, UsageError};
use crate::watch::background::{Echo, Wishes};
use executive::machine::{counted_time, interrupts_off, turns};
use executive::run::platform::KERNEL;
use executive::run::{edge, record, stacks, worker};
use front::app::terms::{self, Chosen};

/// What the words say about runs to come; all else is set where it belongs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// What they say everywhere.
    pub(crate) chosen: Chosen,
    /// What else people want to see, and say.
    pub(crate) wishes: Wishes,
}

/// Has the runs to come recorded or replayed, if the words say so. Returns what is left of the
/// module.
pub(crate) fn set_wish(
    options: &Options<'static>,
    app: &'static str,
    mut module: Option<&'static [u8]>,
) -> Result<Option<&'static [u8]>, UsageError> {
    let replay_bytes = options.number("replay", 0..=1 << 32, 0)?;
    let record_kib = options.number("record", 0..=1 << 20, 0)?;
    let kib = record_kib.max(options.number("keep", 0..=1 << 20, 0)?);
    let jobs = options.number("latest", 0..=64, 16)?;
    if options.choice("events", &[("off", false), ("on", true)])? {
        record::begin(false);
    }
    let wish = match (replay_bytes, kib, jobs) {
        (1.., 1.., _) => {
            let line = "`record` and `keep` exclude `replay`; give one";
            return Err(UsageError::new(line));
        }
        (1.., 0, _) => {
            let shorter = || UsageError::new("`replay`: the module is shorter than that");
            let (recording, rest) = terms::split(module, replay_bytes).ok_or_else(shorter)?;
            module = rest;
            Wish::Replay {
                bytes: recording,
                from: terms::from(options)?,
            }
        }
        (0, 1.., _) => Wish::Record {
            app,
            bytes: usize::try_from(kib * 1024).unwrap_or(0),
            is_needed: record_kib > 0,
        },
        (0, 0, 1..) => Wish::Latest {
            app,
            jobs: u32::try_from(jobs).unwrap_or(0),
        },
        (0, 0, 0) => return Ok(module),
    };
    if matches!(wish, Wish::Record { .. }) {
        record::begin(true);
    }
    edge::set_wish(wish);
    Ok(module)
}

/// Takes the kernel's words and does what they say.
///
/// The machine has so many `processors`, cores or not.
pub(crate) fn apply(options: &Options<'_>, processors: usize) -> Result<Settings, UsageError> {
    let chosen = Chosen::read(options)?;
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
    // What time means is the host's choice.
    if options.text("mode") == Some("deterministic") {
        counted_time::enable();
        turns::enable();
    }
    // What is right was taken at the start, so that a panic ends likewise.
    options.choice("end", &[("halt", ()), ("off", ()), ("reset", ())])?;
    // So was this, and what is wrong has been refused.
    options.text("clock");
    // As were these; what is wrong is refused here.
    options.choice("avx", &[("on", ()), ("off", ())])?;
    options.choice("x2apic", &[("off", ()), ("on", ())])?;
    options.choice("smt", &[("on", ()), ("off", ())])?;
    if let Some(list) = options.text("cores") {
        selection::check(list, processors)?;
    }
    // `on` never comes here: the probe runs in place of all this.
    options.choice("probe", &[("off", ()), ("on", ())])?;
    let status_s = options.number("status", 0..=86_400, 0)?;
    let consoles = [
        ("off", (None, false)),
        ("stop", (None, true)),
        ("on", (Some(Echo::Off), true)),
        ("echo", (Some(Echo::On), true)),
    ];
    let (console, stops) = options.choice("console", &consoles)?;
    Ok(Settings {
        chosen,
        wishes: Wishes {
            console,
            stops,
            status_ns: status_s * 1_000_000_000,
        },
    })
}
