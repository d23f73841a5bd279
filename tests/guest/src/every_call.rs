//! Every call an app's `main` can make of its machine: a single source for the machine and Linux.

use alloc::format;
use core::time::Duration;

use fass::shared::{Parameter, UnixTime, WallClock, Wire};
use fass::{Policy, Preemption, SubtaskAttributes, create_dag, finish_create_dags, now_ns};
use kernel::{AppError, Machine, println};

const PERIOD: Duration = Duration::from_millis(10);

pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    machine.configure(Policy::Edf, Preemption::Enabled);
    machine.offer_clusters()?;
    machine.fix("");
    machine.divide(&[1, machine.cores() - 1]);
    machine.offer_overheads()?;
    machine.set_coincidence(Duration::ZERO);
    machine.accept_faults();
    machine.accept_exceeded_bounds();
    machine.show_topics();
    let (log, gain) = (Wire::new("log"), Parameter::new("gain", 1_u64, 1..=9));
    machine.connect(&log)?;
    let clock = WallClock::new();
    machine.set_clock(&clock)?;
    machine.offer(&[&gain])?;
    let options = machine.options();
    let starts_later = options.number("later", 0..=1, 0)? == 1;
    options.finish(&["test", "later", "output", "clusters", "overheads"])?;

    let dags = [create_dag(), create_dag()];
    let [timed, raised] = &dags;
    timed.name("timed").jobs(20).relative_deadline(PERIOD);
    let named = SubtaskAttributes::named;
    // No clock is before 2000.
    let tick = |time: UnixTime| assert!(time.of(now_ns()) > Some(946_684_800_000_000_000));
    let tick = timed.period(PERIOD).using(clock.reading()).source(tick);
    tick.register(named("tick"));
    raised.name("raised").relative_deadline(PERIOD);
    let signal = raised.sporadic(PERIOD);
    let read = raised.using((gain.reading(), log.sending()));
    read.source(|_| ()).register(named("read"));
    machine.spread(&dags);
    finish_create_dags(&dags)?;

    machine.raise_on_input(&signal);
    println!("{} and {:?}", machine.has_console(), machine.clusters());
    println!("{:?} and {:?}", machine.resources(), machine.module());
    let run = match starts_later {
        true => machine.run_from(fass::now_ns() + 50_000_000)?,
        false => machine.run()?,
    };
    machine.report_memory();
    match run.statistics("timed").completed {
        20 => Ok(()),
        count => Err(AppError::Failure(format!("{count} jobs complete"))),
    }
}
