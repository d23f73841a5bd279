//! The messages of QEMU's device `edu`: each releases a DAG on the core receiving the message.

use alloc::boxed::Box;
use alloc::format;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use executive::machine::spinlock::SpinLock;
use executive::machine::this_core;
use fass::shared::{Asker, DeviceDriver, Signal, create_device};
use fass::{Occupation, create_dag, execute_for, finish_create_dags};
use kernel::devices::{self, DeviceLine, Function, LineError, Registers, tie};
use kernel::{AppError, Machine, json};

use crate::single::named;

const MESSAGES: u64 = 500;

/// Registers of the device: the reason of a message, the request to send a message, and the
/// acknowledgement.
const WHY: u64 = 0x24;
const RAISE: u64 = 0x60;
const ACKNOWLEDGE: u64 = 0x64;

/// The numbers of messages received on each of two cores, and of messages without a reason.
static CAME: [AtomicU64; 3] = [const { AtomicU64::new(0) }; 3];
/// The timer interrupts during the messages.
static TIMER: AtomicU64 = AtomicU64::new(0);

struct Driver(Registers, Signal);

impl DeviceLine for Driver {
    fn interrupt(&self, _now_ns: u64) {
        let why = self.0.read32(WHY);
        self.0.write32(ACKNOWLEDGE, why);
        let core = this_core::get().index as usize;
        CAME[if why == 0 { 2 } else { core }].fetch_add(1, Ordering::Relaxed);
        self.1.raise();
    }
}

/// Sends the messages to each core in turn, with a run for each core, and prints the counts.
pub(crate) fn run(machine: &Machine) -> Result<(), AppError> {
    machine.options().finish(&["test"])?;
    let edu = devices::find(0x1234, 0x11e8)?;
    let registers = Registers::of(&edu, 0).map_err(|why| devices::refusal(&edu, why))?;
    // SAFETY: it is told no address.
    unsafe { edu.enable_reach() };
    for (core, came) in (0..).zip(&CAME).take(this_core::all().len()) {
        let releases = run_on(machine, &edu, registers, core)?;
        let came = came.swap(0, Ordering::Relaxed);
        let others = CAME.iter().map(|count| count.load(Ordering::Relaxed));
        let elsewhere: u64 = others.sum();
        json::emit("devices", |line| {
            line.number("core", core)
                .number("came", came)
                .number("elsewhere", elsewhere)
                .number("releases", releases)
                .number("timer_interrupts", TIMER.load(Ordering::Relaxed));
        });
    }
    refuse_more(&edu, registers)
}

/// Runs a DAG requesting messages from the device, and the DAG released by them. Returns the number
/// of completed jobs of the second DAG.
fn run_on(
    machine: &Machine,
    edu: &Function<'_>,
    registers: Registers,
    core: u32,
) -> Result<u64, AppError> {
    let (answers, asks) = (create_dag(), create_dag());
    let ms = Duration::from_millis;
    answers.name("answers").relative_deadline(ms(1));
    let signal = answers.sporadic(Duration::from_micros(20));
    answers.source(|| ()).register(named("answer"));
    asks.name("asks")
        .jobs(1)
        .period(ms(100))
        .relative_deadline(ms(100));
    let ask = move || {
        let before = kernel::timer_interrupts();
        for _ in 0..MESSAGES {
            registers.write32(RAISE, 1);
            execute_for(Duration::from_micros(40), Occupation::Spin);
        }
        TIMER.store(kernel::timer_interrupts() - before, Ordering::Relaxed);
    };
    asks.source(ask).register(named("ask"));
    let refused = |why: LineError| devices::refusal(edu, why);
    let driver = Box::leak(Box::new(Driver(registers, signal)));
    let line = tie(edu, 0, driver, 0).map_err(refused)?;
    line.route(core).map_err(refused)?;
    finish_create_dags(&[answers, asks])?;
    let run = machine.run()?;
    match run.allocations() {
        0 => Ok(run.statistics("answers").completed),
        count => Err(AppError::Failure(format!(
            "{count} allocations while jobs ran"
        ))),
    }
}

/// Ties a missing message, names a missing core, ties the only message too often, and prints the
/// refusals.
fn refuse_more(edu: &Function<'_>, registers: Registers) -> Result<(), AppError> {
    let signal = create_dag().sporadic(Duration::from_millis(1));
    let driver: &Driver = Box::leak(Box::new(Driver(registers, signal)));
    for (number, core) in [(1, 0), (0, 9)] {
        if let Err(why) = tie(edu, number, driver, core) {
            kernel::println!("{}", devices::refusal(edu, why));
        }
    }
    let refused = (0..10).find_map(|_| tie(edu, 0, driver, 0).err());
    refused.map_or(Ok(()), |why| {
        kernel::println!("{}", devices::refusal(edu, why));
        Ok(())
    })
}

/// A driver answering in the interrupt itself.
struct Answerer(Registers, SpinLock<DeviceDriver<(), u32>>);

impl DeviceLine for Answerer {
    fn interrupt(&self, _now_ns: u64) {
        self.0.write32(ACKNOWLEDGE, self.0.read32(WHY));
        let mut questions = self.1.lock();
        if let Some((ticket, ())) = questions.question() {
            let _ = questions.answer(ticket, 7);
        }
    }
}

/// Asks the device from a waiting subtask, on each core in turn. Each question makes the device
/// send a message.
pub(crate) fn ask(machine: &Machine) -> Result<(), AppError> {
    machine.options().finish(&["test"])?;
    let edu = devices::find(0x1234, 0x11e8)?;
    let registers = Registers::of(&edu, 0).map_err(|why| devices::refusal(&edu, why))?;
    // SAFETY: it is told no address.
    unsafe { edu.enable_reach() };
    let ms = Duration::from_millis;
    for (core, _) in (0..).zip(this_core::all()) {
        let (device, questions) = create_device::<(), u32>("edu");
        let driver = Box::leak(Box::new(Answerer(registers, SpinLock::new(questions))));
        tie(&edu, 0, driver, core).map_err(|why| devices::refusal(&edu, why))?;
        let (starts, asks) = (create_dag(), create_dag());
        starts.name("starts").relative_deadline(ms(1));
        device.served_by(&starts.sporadic(Duration::from_micros(20)));
        let start = move || registers.write32(RAISE, 1);
        starts.source(start).register(named("start"));
        asks.name("asks")
            .jobs(20)
            .period(ms(1))
            .relative_deadline(ms(1));
        let ask = |edu: Asker<(), u32>| async move { assert_eq!(edu.ask(()).await, Ok(7)) };
        let ask = asks.using(device.asking()).async_source(ask);
        ask.register(named("ask").wait(Duration::from_micros(500)));
        finish_create_dags(&[starts, asks])?;
        let answered = machine.run()?.statistics("asks").completed;
        json::emit("answered", |line| {
            line.number("core", core).number("answered", answered);
        });
    }
    Ok(())
}
