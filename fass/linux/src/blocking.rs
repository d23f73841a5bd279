//! Calls that may block, for subtasks that wait: a device served by a thread of the host.
//!
//! A function reading a file, or asking another program, would keep its core from more urgent work.
//! An async function asks a device instead, and the device's driver makes the call in its own
//! thread, without a real-time level. So the call may be late while the cores are busy, but delays
//! nobody. The wait ends at its limit, whatever the call does.

use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

use fass::shared::{Device, DeviceDriver, Ticket, create_device};

use crate::{clock, sys};

/// The longest wait of the thread before checking whether the device is still used.
const LOOK: Duration = Duration::from_millis(100);

/// Makes a device from a call that may block. `call` answers the questions one after the other, in
/// a thread lasting as long as the device is used. Among questions asked during a call, only the
/// latest counts.
///
/// # Panics
///
/// If the system has no thread left.
///
/// ```
/// use std::time::Duration;
/// use fass::shared::Asker;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
///
/// let ms = Duration::from_millis;
/// let host = linux::blocking("host", |name: &'static str| std::fs::read_to_string(name).ok());
/// let machine = linux::Linux::new(1, linux::Mechanism::Normal).unwrap();
/// let dag = create_dag();
/// dag.name("load").jobs(2).period(ms(50)).relative_deadline(ms(50));
/// let read = |host: Asker<&'static str, Option<String>>| async move {
///     match host.ask("/proc/loadavg").await {
///         Ok(load) => assert!(load.is_some()),
///         Err(late) => println!("{late}"),
///     }
/// };
/// let read = dag.using(host.asking()).async_source(read);
/// read.register(SubtaskAttributes::named("read").wait(ms(20)));
/// finish_create_dags(&[dag]).unwrap();
/// assert_eq!(machine.run().unwrap().statistics("load").completed, 2);
/// ```
pub fn blocking<Q, A>(name: &str, mut call: impl FnMut(Q) -> A + Send + 'static) -> Device<Q, A>
where
    Q: Send + Sync + 'static,
    A: Send + Sync + 'static,
{
    let (device, mut driver) = create_device(name);
    let serve = move || {
        while driver.is_used() {
            if let Some((ticket, question)) = next_question(&mut driver, LOOK) {
                // An answer that comes too late is of no use to anybody.
                drop(driver.answer(ticket, call(question)));
            }
        }
    };
    let builder = thread::Builder::new().name(format!("fass-{name}"));
    let _ = builder
        .spawn(serve)
        .expect("the system has a thread for each device");
    device
}

/// Waits for the next question of a device, for at most `most`, in a thread of the driver. The
/// worker running the asking instance wakes the thread after giving back the scheduler's lock.
///
/// ```
/// use std::time::Duration;
/// let (_sonar, mut driver) = fass::shared::create_device::<(), u32>("sonar");
/// assert!(linux::next_question(&mut driver, Duration::from_millis(1)).is_none());
/// ```
pub fn next_question<Q, A>(driver: &mut DeviceDriver<Q, A>, most: Duration) -> Option<(Ticket, Q)> {
    let bell = driver.bell();
    let most_ns = u64::try_from(most.as_nanos()).unwrap_or(u64::MAX);
    let until_ns = clock::now_ns().saturating_add(most_ns);
    loop {
        // Read before the look: a later question changes the word.
        let seen = bell.load(Ordering::Acquire);
        let found = driver.question();
        if found.is_some() || clock::now_ns() >= until_ns {
            return found;
        }
        sys::wait(&bell, seen, Some(until_ns));
    }
}
