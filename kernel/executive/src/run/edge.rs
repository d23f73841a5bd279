//! What crosses the edge of a run: recorded for the host, or replayed.
//!
//! All that is known of recordings is behind [`Crossing`], which only an image with a recorded
//! topic has. It is used under the scheduler's lock, or for a moment by a source that is
//! replayed; the drain belongs to core 0's background alone, so sending disturbs nobody.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::{String, ToString};
use core::sync::atomic::{AtomicBool, Ordering};

use fass::edge::{Begin, Crossing, Drain, Outcome, Seen, Wish};
use fass::{Channel, LaunchError, Plan, Recorded};
use sched_dag::{DagId, Instance, Notice};

use crate::machine::debug_port;
use crate::machine::once::Once;
use crate::machine::spinlock::SpinLock;
use front::json;

/// What the command line says.
static WISH: Once<Wish> = Once::new();

/// Whether people can look at what crosses.
static ECHOES: AtomicBool = AtomicBool::new(false);

static CROSSING: SpinLock<Option<Box<dyn Crossing>>> = SpinLock::new(None);

/// Whether a plan has been launched with it, so that events are of interest.
static IS_ON: AtomicBool = AtomicBool::new(false);

/// What sends the recording of the run to come.
static OUTGOING: SpinLock<Outgoing> = SpinLock::new(None);

/// Why the recording, or the app, does not go with the wish.
static REFUSAL: Once<String> = Once::new();

/// What a replay has found.
static OUTCOME: Once<Outcome> = Once::new();

/// What to send, if anything.
pub type Outgoing = Option<Box<dyn Drain>>;

/// Takes what the command line says.
pub fn set_wish(wish: Wish) -> Result<(), &'static str> {
    match wish {
        Wish::Record { .. } if !debug_port::is_there() => {
            return Err(
                "`record`: there is no debug port at 0x402 to send it to; run it in QEMU, by \
                 `./scripts/run --record FILE`",
            );
        }
        // Nobody has asked for it.
        Wish::Latest { .. } if !debug_port::is_there() => return Ok(()),
        _ => {}
    }
    // It is called once.
    let _ = WISH.set(wish);
    Ok(())
}

/// Lets people look at what crosses.
pub fn let_look() {
    ECHOES.store(true, Ordering::Relaxed);
}

/// Reports whether there is a wish.
pub fn is_wished() -> bool {
    WISH.get().is_some() || ECHOES.load(Ordering::Relaxed)
}

/// Reports whether there are results among what crosses.
pub fn has_results() -> bool {
    ECHOES.load(Ordering::Relaxed) || !matches!(WISH.get(), Some(Wish::Latest { .. }))
}

/// Takes the recorded topics of a DAG, and reports whether their values are read where they are
/// written.
pub fn open(dag: DagId, graph: u64, channels: &[Channel], begin: Begin) -> bool {
    let wish = match (WISH.get(), ECHOES.load(Ordering::Relaxed)) {
        (wish, true) => Wish::Echo(wish),
        (Some(wish), false) => *wish,
        (None, false) => return false,
    };
    let mut crossing = CROSSING.lock();
    let crossing = crossing.get_or_insert_with(|| begin(wish));
    crossing.open(dag, graph, channels)
}

/// Makes a plan one that is recorded or replayed, if there is a wish. Reports whether that goes for
/// the times, too, that functions are told.
pub fn launch(plan: &mut Plan) -> Result<bool, LaunchError> {
    let Some(wish) = WISH.get() else {
        let mut place = CROSSING.lock();
        let launched = place.as_mut().map(|crossing| crossing.launch(plan));
        let launched = launched.unwrap_or(Ok(())).map_err(LaunchError::new);
        return launched.map(|()| false);
    };
    let word = match wish {
        Wish::Record { .. } => "record",
        Wish::Replay(_) => "replay",
        Wish::Latest { .. } | Wish::Echo(_) => "latest",
    };
    let is_asked_for = !matches!(wish, Wish::Latest { .. });
    let mut place = CROSSING.lock();
    let launched = match place.as_mut() {
        None if !is_asked_for => return Ok(false),
        None => Err(format!(
            "`{word}`: no topic of the app is recorded; name topics by `Dag::record`"
        )),
        Some(_) if is_asked_for && IS_ON.load(Ordering::Relaxed) => Err(format!(
            "`{word}`: a recording is of one commit, and this is another one; leave the word out"
        )),
        Some(crossing) => crossing.launch(plan).map(|()| crossing.drain()),
    };
    drop(place);
    let mut outgoing = launched.map_err(|why| {
        let _ = REFUSAL.set(why.clone());
        LaunchError::new(why)
    })?;
    if let Some(drain) = &mut outgoing {
        // Not during the run: it takes long where a byte does.
        drain.begin(&mut debug_port::send);
    }
    *OUTGOING.lock() = outgoing;
    IS_ON.store(true, Ordering::Relaxed);
    Ok(is_asked_for)
}

/// Tells the instance that runs here the time, and has it written down; or tells what the recording
/// says that it was. Times are the clock's and the run's.
pub fn tell_time(running: fn() -> Option<Instance>, clock_ns: u64, at_ns: u64) -> u64 {
    let mut crossing = CROSSING.lock();
    // Interrupts are off, so it stays here.
    match (crossing.as_mut(), running()) {
        (Some(crossing), Some(instance)) => crossing.tell_time(instance, clock_ns, at_ns),
        _ => clock_ns,
    }
}

/// Takes what sends the recording of the run that begins, whose time begins then.
pub fn begin(epoch_ns: u64) -> Outgoing {
    let mut outgoing = OUTGOING.lock().take();
    if let Some(drain) = &mut outgoing {
        drain.begin_run(epoch_ns);
    }
    outgoing
}

/// Sends an entry, if there is one; `false`: there was none.
pub fn send(outgoing: &mut Outgoing) -> bool {
    (outgoing.as_mut()).is_some_and(|drain| drain.step(&mut debug_port::send))
}

/// Sends what is left when the run is over, or what is kept of jobs before a fault, and says what
/// came of it.
pub fn end(outgoing: Outgoing, is_over: bool) {
    if let Some(outcome) = outcome(is_over) {
        report(&outcome);
        // Of the one run.
        let _ = OUTCOME.set(outcome);
    }
    let mut outgoing = outgoing.or_else(before_fault);
    while send(&mut outgoing) {}
    let Some(mut drain) = outgoing else {
        return;
    };
    let Some(drained) = drain.end(&mut debug_port::send) else {
        return;
    };
    let is_complete = !drained.is_cut && drained.lost == 0;
    json::emit("recorded", |line| {
        line.number("entries", drained.entries)
            .number("lost", drained.lost)
            .flag("complete", is_complete);
    });
}

/// Begins to send what is kept of the jobs before a fault, if there was one; once, for there is
/// one file.
fn before_fault() -> Outgoing {
    static IS_SENT: AtomicBool = AtomicBool::new(false);
    let mut drain = CROSSING.lock().as_mut()?.drain()?;
    if IS_SENT.swap(true, Ordering::Relaxed) {
        return None;
    }
    drain.begin(&mut debug_port::send);
    Some(drain)
}

/// Takes note that an instance has failed, on the run's time and the clock's. The scheduler's
/// lock is held.
pub fn failed(instance: Instance, at_ns: u64, clock_ns: u64) {
    if IS_ON.load(Ordering::Relaxed)
        && let Some(crossing) = CROSSING.lock_uninterrupted().as_mut()
    {
        crossing.failed(instance, at_ns, clock_ns);
    }
}

/// Takes a value that is not read where it was written, and when that was in the time of the run.
/// The scheduler's lock is held.
pub fn record(value: &Recorded<'_>, at_ns: u64) {
    if let Some(crossing) = CROSSING.lock_uninterrupted().as_mut() {
        crossing.record(value, at_ns);
    }
}

/// Takes what became of a job or an instance, if it is of interest. The scheduler's lock is
/// held.
pub fn happened(notice: &Notice) {
    if IS_ON.load(Ordering::Relaxed)
        && let Some(crossing) = CROSSING.lock_uninterrupted().as_mut()
    {
        crossing.happened(notice);
    }
}

/// Keeps the latest value of a recorded topic from now on, or nothing. Reports whether there is
/// such a topic.
pub fn watch(topic: Option<&str>) -> bool {
    let mut crossing = CROSSING.lock();
    let echo = crossing.as_mut().and_then(|crossing| crossing.echo());
    echo.is_some_and(|echo| echo.watch(topic))
}

/// Takes that value out, if there is one.
pub fn take_seen(into: &mut [u8]) -> Option<Seen> {
    let mut crossing = CROSSING.lock();
    crossing.as_mut()?.echo()?.take(into)
}

/// Reports whether a replay is wished.
pub fn is_replay() -> bool {
    matches!(WISH.get(), Some(Wish::Replay(_)))
}

/// Lends a recorded value.
pub fn lend(channel: u16, job: u64, take: &mut dyn FnMut(&[u8])) {
    if let Some(crossing) = CROSSING.lock().as_ref() {
        crossing.lend(channel, job, take);
    }
}

/// Returns why the wish could not be met, if it could not.
pub fn refusal() -> Option<&'static str> {
    REFUSAL.get().map(String::as_str)
}

/// Returns how a replay differs from its recording, if it does.
pub fn complaint() -> Option<String> {
    let divergence = OUTCOME.get()?.divergence.as_ref()?;
    Some(divergence.to_string())
}

fn outcome(is_over: bool) -> Option<Outcome> {
    if !is_replay() {
        return None;
    }
    CROSSING.lock().as_ref()?.outcome(is_over)
}

fn report(outcome: &Outcome) {
    let (compared, uncompared) = (outcome.compared, outcome.uncompared);
    front::println!(
        "replay: {compared} values were compared, {uncompared} recorded ones were not computed"
    );
    if let Some((dag, first)) = &outcome.lacking {
        front::println!(
            "replay: what functions of dag `{dag}` remember of jobs before {first} is not recorded"
        );
    }
    json::emit("replayed", |line| {
        line.number("compared", outcome.compared)
            .number("uncompared", outcome.uncompared);
        if let Some(divergence) = &outcome.divergence {
            line.text("dag_name", &divergence.dag)
                .text("topic", &divergence.topic)
                .number("job", divergence.job);
            let (recorded, computed) = (&divergence.recorded, &divergence.computed);
            for (name, value) in [("recorded", recorded), ("computed", computed)] {
                if let Some(value) = value {
                    line.text(name, value);
                }
            }
        }
    });
}
