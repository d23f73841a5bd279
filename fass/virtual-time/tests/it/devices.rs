//! Answers of devices: which of them are taken, and which are given back.

use crate::support::{Seen, commit, every, ms, taking};
use fass::Dag;
use fass::shared::{Asker, DeviceDriver, TimedOut, create_device};
use virtual_time::VirtualTime;

type OneQuestion = (Dag, DeviceDriver<(), u32>);

/// A DAG of a subtask that asks a device of its name once, with that limit, and keeps what it gets.
fn asking_once(name: &str, limit: u64, keep: &Seen<Result<u32, TimedOut>>) -> OneQuestion {
    let (device, driver) = create_device(name);
    let dag = every(20, name);
    dag.jobs(1);
    let keep = keep.clone();
    let ask = dag.using(device.asking());
    let ask = ask.async_source(move |device: Asker<(), u32>| {
        let keep = keep.clone();
        async move { keep.add(device.ask(()).await) }
    });
    let stated = taking(name, 1).wait(ms(limit)).wcet(ms(1));
    ask.register(stated.priority(1));
    (dag, driver)
}

#[test]
fn a_device_answers_its_own_questions_only() {
    let machine = VirtualTime::new().cores(2);
    let (kept, keep) = Seen::shared();
    let [(a, mut of_a), (b, mut of_b)] = ["a", "b"].map(|name| asking_once(name, 5, &keep));
    commit(&[a, b]);
    machine.run_for(ms(2));
    let (ticket, ()) = of_a.question().expect("a asks");
    assert!(of_b.question().is_some());
    assert_eq!(of_b.answer(ticket, 3), Err(3));
    assert_eq!(of_a.answer(ticket, 4), Ok(()));
    assert_eq!(machine.run().violations(), []);
    assert_eq!(kept.all(), [Ok(4), Err(TimedOut)]);
}
