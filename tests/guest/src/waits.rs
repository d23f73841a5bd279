//! Instances that wait: for a time, for a device that another DAG stands for, for bytes of a wire,
//! and at the moment of a fault or of an end.

use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use alloc::{format, vec};
use core::future::pending;
use core::pin::pin;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use fass::shared::{
    Asker, DeviceDriver, Shutdown, Switch, Wire, WireReader, WireWriter, create_device,
    shutting_down,
};
use fass::{
    Dag, Occupation, OverrunPolicy, SubtaskAttributes, Unique, create_dag, execute_for,
    finish_create_dags, sleep,
};
use kernel::{AppError, Machine, Run, json};

use crate::single::{named, single_every};

const PERIOD: Duration = Duration::from_millis(20);

/// For how long the device computes for each question; the second answer comes too late.
const COMPUTES_MS: [u64; 4] = [2, 7, 0, 3];

/// The outcomes of the questions.
#[derive(Default)]
struct Answers {
    right: AtomicU64,
    timed_out: AtomicU64,
    /// Answers that were given back.
    returned: AtomicU64,
}

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn hold(ms: u64) {
    execute_for(Duration::from_millis(ms), Occupation::Hold);
}

fn count(counter: &AtomicU64) {
    counter.fetch_add(1, Ordering::Relaxed);
}

/// Runs a camera that asks an accelerator, next to a control loop; in several clusters the
/// accelerator is in the last one.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    machine.offer_clusters()?;
    machine.options().finish(&["test", "clusters"])?;
    let answers = Arc::new(Answers::default());
    let (device, driver) = create_device("accelerator");

    let camera = create_dag();
    (camera.name("camera").jobs(4).period(PERIOD)).relative_deadline(PERIOD);
    let (tally, mut job) = (Arc::clone(&answers), 0_u64);
    let ask = move |accelerator: Asker<u64, u64>| {
        let (tally, question) = (Arc::clone(&tally), job);
        job += 1;
        async move {
            hold(1);
            match accelerator.ask(question).await {
                Ok(answer) => {
                    assert_eq!(answer, question * 10);
                    count(&tally.right);
                }
                Err(_) => count(&tally.timed_out),
            }
            hold(1);
            sleep(ms(2)).await;
            hold(1);
        }
    };
    let ask = camera.using(device.asking()).async_source(ask);
    ask.register(named("ask").priority(1).wait(ms(5)).wait(ms(3)));

    let control = || execute_for(Duration::from_micros(300), Occupation::Hold);
    let attributes = named("control").priority(0);
    let control = single_every(PERIOD / 2, "control", 8, attributes, control);
    control.offset(Duration::from_micros(4_500));
    let accelerator = accelerator(driver, &answers);
    let clusters = machine.clusters().sizes().len();
    if let Some(last) = u32::try_from(clusters)
        .ok()
        .and_then(|count| count.checked_sub(1))
    {
        camera.cluster(0);
        control.cluster(0);
        accelerator.cluster(last);
    }
    finish_create_dags(&[control, camera, accelerator])?;
    let run = machine.run()?;
    json::emit("waits", |line| {
        line.number("right", answers.right.load(Ordering::Relaxed))
            .number("timed_out", answers.timed_out.load(Ordering::Relaxed))
            .number("returned", answers.returned.load(Ordering::Relaxed))
            .number("allocations", run.allocations())
            .number("violations", run.violations().count() as u64);
    });
    Ok(())
}

/// Builds the DAG that stands for the device, which gives each answer twice.
fn accelerator(mut driver: DeviceDriver<u64, u64>, answers: &Arc<Answers>) -> Dag {
    let (tally, mut times_ms) = (Arc::clone(answers), COMPUTES_MS.into_iter());
    let serve = move || {
        let Some((ticket, question)) = driver.question() else {
            return;
        };
        hold(times_ms.next().unwrap_or(0));
        for _ in 0..2 {
            if driver.answer(ticket, question * 10).is_err() {
                count(&tally.returned);
            }
        }
    };
    let attributes = named("serve").priority(2);
    let dag = single_every(PERIOD, "accelerator", 4, attributes, serve);
    dag.offset(ms(2));
    dag
}

/// Runs a modem, which is written a question and read for an answer, and says what came: the sum of
/// it, and how often there was nothing. In two clusters it is not in that of the port.
pub(crate) fn wire(machine: &Machine) -> Result<(), AppError> {
    let modem = Wire::new("modem");
    machine.connect(&modem)?;
    machine.offer_clusters()?;
    machine.options().finish(&["test", "input", "clusters"])?;
    let (answers, mut job) = (Arc::new(Answers::default()), 0_u64);
    let tally = Arc::clone(&answers);
    let ask = move |(input, output): (WireReader<u64>, WireWriter)| {
        let (tally, question) = (Arc::clone(&tally), job);
        job += 1;
        async move {
            hold(1);
            let line = [b'0' + (question % 10) as u8, b'\n'];
            if output.write(&line).await.is_err() {
                count(&tally.returned);
            }
            match input.read().await {
                Ok(answer) => _ = tally.right.fetch_add(answer, Ordering::Relaxed),
                Err(_) => count(&tally.timed_out),
            }
            hold(1);
        }
    };
    let decode = |line: &[u8]| {
        line.iter()
            .fold(0, |sum, byte| sum * 10 + u64::from(byte - b'0'))
    };
    let uses = (modem.reading(decode), modem.writing());
    let dag = create_dag();
    (dag.name("modem").jobs(4).period(PERIOD)).relative_deadline(PERIOD);
    let attributes = named("ask").wait(ms(10)).wait(ms(5));
    dag.using(uses).async_source(ask).register(attributes);
    if machine.clusters().sizes().len() > 1 {
        dag.cluster(1);
    }
    finish_create_dags(&[dag])?;
    let run = machine.run()?;
    json::emit("waits_wire", |line| {
        line.number("sum", answers.right.load(Ordering::Relaxed))
            .number("timed_out", answers.timed_out.load(Ordering::Relaxed))
            .number("unsent", answers.returned.load(Ordering::Relaxed))
            .number("allocations", run.allocations())
            .number("violations", run.violations().count() as u64);
    });
    Ok(())
}

/// How many waits [`cost`] takes one after the other.
const NAPS: u32 = 32;

/// Counts what a wait and its wake add to an instance that has the machine for itself: of no time,
/// and of a millisecond beyond that.
pub(crate) fn cost(machine: &Machine) -> Result<(), AppError> {
    machine.options().finish(&["test"])?;
    for (word, time) in [("at_once", Duration::ZERO), ("later", ms(1))] {
        let longest = Arc::new(AtomicU64::new(0));
        let found = Arc::clone(&longest);
        let naps = move || {
            let found = Arc::clone(&found);
            async move {
                let from_ns = fass::now_ns();
                for _ in 0..NAPS {
                    sleep(time).await;
                }
                found.fetch_max(fass::now_ns() - from_ns, Ordering::Relaxed);
            }
        };
        let attributes = (0..NAPS).fold(named("naps"), |naps, _| naps.wait(time));
        let terms = (Some(3), ms(100));
        finish_create_dags(&[waiting("naps", terms, attributes, naps)])?;
        let run = machine.run()?;
        let waited_ns = u64::try_from((time * NAPS).as_nanos()).unwrap_or(u64::MAX);
        let added_ns = longest.load(Ordering::Relaxed).saturating_sub(waited_ns);
        json::emit("waits_cost", |line| {
            line.text("wait", word)
                .number("instructions", added_ns / u64::from(NAPS))
                .number("allocations", run.allocations());
        });
    }
    Ok(())
}

/// A DAG of one subtask that waits.
fn waiting<Fut>(
    name: &str,
    (jobs, period): (Option<u64>, Duration),
    attributes: SubtaskAttributes,
    function: impl FnMut() -> Fut + Send + 'static,
) -> Dag
where
    Fut: Future<Output = ()> + Send + 'static,
{
    let dag = create_dag();
    dag.name(name).relative_deadline(period);
    jobs.into_iter().for_each(|jobs| _ = dag.jobs(jobs));
    dag.register_periodic_async_subtask(function, vec![], period, attributes);
    dag
}

/// Calls a function with the number of each job.
fn numbered<Fut>(mut function: impl FnMut(u64) -> Fut) -> impl FnMut() -> Fut {
    let mut jobs = 0..;
    move || function(jobs.next().unwrap_or(0))
}

/// Counts what is dropped.
struct Dropped(Arc<AtomicU64>);

impl Drop for Dropped {
    fn drop(&mut self) {
        count(&self.0);
    }
}

/// Runs one DAG after the other that is at fault, or is ended, when an instance of it has waited, or
/// waits.
pub(crate) fn faults(machine: &Machine) -> Result<(), AppError> {
    machine.options().finish(&["test"])?;
    machine.accept_faults();
    run_one(machine, "panics", &panics())?;
    run_one(machine, "overruns", &overruns())?;
    run_one(machine, "foreign", &foreign())?;
    run_one(machine, "ended", &ended())?;
    run_one(machine, "paused", &paused())?;
    run_one(machine, "shut down", &shut_down())?;
    run_one(machine, "left out", &left_out())?;
    run_one(machine, "again", &again())?;
    run_one(machine, "passed on", &passed_on())?;
    let dropped = Arc::new(AtomicU64::new(0));
    run_one(machine, "aborted", &[aborted(&dropped)])?;
    json::emit("waits_dropped", |line| {
        line.number("futures", dropped.load(Ordering::Relaxed));
    });
    Ok(())
}

fn run_one(machine: &Machine, title: &str, dags: &[Dag]) -> Result<(), AppError> {
    finish_create_dags(dags)?;
    let run: Run = machine.run()?;
    let violations: Vec<String> = run.violations().map(|it| format!("{it}")).collect();
    json::emit("waits_run", |line| {
        line.text("title", title)
            .text("violations", violations.join("; "))
            .number("allocations", run.allocations());
    });
    Ok(())
}

/// One that panics after a wait in job 1, next to a healthy one.
fn panics() -> Vec<Dag> {
    let panics = numbered(|job| async move {
        sleep(ms(2)).await;
        assert_eq!(job, 0, "after a wait");
    });
    let healthy = || async {
        sleep(ms(3)).await;
    };
    let terms = (Some(3), ms(10));
    vec![
        waiting("panics", terms, named("panics").wait(ms(2)), panics),
        waiting("healthy", terms, named("rests").wait(ms(3)), healthy),
    ]
}

/// One with a budget of 3 ms that does not count a wait of 10 ms, and is exceeded after that in job
/// 1.
fn overruns() -> Vec<Dag> {
    let computes = numbered(|job| async move {
        hold(2);
        sleep(ms(10)).await;
        hold(job * 5);
    });
    let attributes = named("computes").wait(ms(10)).budget(ms(3));
    vec![waiting("overruns", (Some(3), PERIOD), attributes, computes)]
}

/// One that awaits what nobody will ever end.
fn foreign() -> Vec<Dag> {
    let awaits = || async {
        pending::<()>().await;
    };
    let attributes = named("awaits").wait(ms(1));
    vec![waiting("foreign", (Some(2), PERIOD), attributes, awaits)]
}

/// One that polls a wait after its end.
fn again() -> Vec<Dag> {
    let polls = || async {
        let mut nap = pin!(sleep(ms(1)));
        nap.as_mut().await;
        nap.await;
    };
    let attributes = named("polls").wait(ms(1)).wait(ms(1));
    vec![waiting("again", (Some(2), PERIOD), attributes, polls)]
}

/// One whose second subtask asks by what the first one was lent.
fn passed_on() -> Vec<Dag> {
    let (device, _) = create_device::<u8, u8>("silent");
    let dag = create_dag();
    (dag.name("passed on").jobs(2).period(PERIOD)).relative_deadline(PERIOD);
    let lends = |asker: Asker<u8, u8>| async move {
        let _ = asker.ask(1).await;
        (Unique::new(asker),)
    };
    let lends = dag.using(device.asking()).async_source(lends);
    (lends.writes(&["asker"])).register(named("lends").wait(ms(1)));
    let asks =
        |(asker,): (Unique<Asker<u8, u8>>,)| async move { _ = asker.into_inner().ask(2).await };
    (dag.async_subtask(asks).reads(&["asker"])).register(named("asks").wait(ms(1)));
    vec![dag]
}

/// One that returns without its wait.
fn left_out() -> Vec<Dag> {
    let attributes = named("returns").wait(ms(1));
    vec![waiting(
        "left out",
        (Some(2), PERIOD),
        attributes,
        || async {},
    )]
}

/// One that is ended, as a subtask panics, while the other waits.
fn ended() -> Vec<Dag> {
    let dag = create_dag();
    (dag.name("ended").jobs(2)).in_flight(2);
    dag.register_periodic_subtask(|| (0_u8, 0_u8), ["a", "b"], PERIOD, named("forks"));
    let waits = |(_,): (u8,)| async {
        sleep(ms(10)).await;
        (0_u8,)
    };
    dag.register_async_subtask(waits, ["a"], ["c"], named("waits").wait(ms(15)));
    let panics = |(_,): (u8,)| -> (u8,) {
        hold(3);
        panic!("while the other waits");
    };
    dag.register_subtask(panics, ["b"], ["d"], named("panics"));
    dag.register_sink_subtask(|_: (u8, u8)| (), ["c", "d"], PERIOD, named("joins"));
    vec![dag]
}

/// One that is paused while it waits.
fn paused() -> Vec<Dag> {
    let rests = || async {
        sleep(ms(20)).await;
    };
    let rests = waiting(
        "rests",
        (Some(2), ms(30)),
        named("rests").wait(ms(20)),
        rests,
    );
    let pauses = create_dag();
    (pauses.name("pauses").jobs(1).period(PERIOD)).relative_deadline(PERIOD);
    pauses.offset(ms(10));
    let pause = |mut rests: Switch<'_>| rests.pause();
    let pause = pauses.using(rests.switching()).source(pause);
    pause.register(named("pauses"));
    vec![rests, pauses]
}

/// One without a last job, in a run that is ended while it waits.
fn shut_down() -> Vec<Dag> {
    let rests = || async {
        sleep(ms(20)).await;
    };
    let rests = waiting(
        "endless",
        (None, ms(30)),
        named("rests").wait(ms(25)),
        rests,
    );
    let ends = create_dag();
    (ends.name("ends").jobs(1).period(PERIOD)).relative_deadline(PERIOD);
    ends.offset(ms(10));
    let end = |mut run: Shutdown<'_>| run.request();
    ends.using(shutting_down())
        .source(end)
        .register(named("ends"));
    vec![rests, ends]
}

/// One whose jobs 0 and 1 are aborted by the next one while they wait.
fn aborted(dropped: &Arc<AtomicU64>) -> Dag {
    let dropped = Arc::clone(dropped);
    let rests = move || {
        let owned = Dropped(Arc::clone(&dropped));
        async move {
            sleep(ms(15)).await;
            drop(owned);
        }
    };
    let dag = waiting(
        "aborted",
        (Some(3), ms(10)),
        named("rests").wait(ms(15)),
        rests,
    );
    dag.in_flight(1).overrun(OverrunPolicy::Abort);
    dag
}
