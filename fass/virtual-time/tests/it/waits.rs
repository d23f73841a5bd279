//! Subtasks that wait: limits and shapes of the API, each fault of a wait, and replays. (The schedules,
//! the scenarios tell.)

use std::time::Duration;

use crate::support::{MS, Seen, commit, every, job_numbers, ms, named, run, taking};
use fass::shared::{Asker, DeviceDriver, TimedOut, create_device};
use fass::{Dag, SubtaskAttributes, WaitFault, sleep, until};
use random::Random;
use virtual_time::{Report, VirtualTime};

/// A DAG of one subtask of that name, whose segments take so long, with sleeps between: in
/// milliseconds, first a segment, then each sleep with the segment behind it.
fn sleeper(name: &str, priority: u32, first: u64, rest: &'static [(u64, u64)]) -> Dag {
    let dag = every(100, name);
    dag.jobs(1);
    let stated = rest.iter().fold(taking(name, first), |stated, of| {
        stated.wait(ms(of.0)).wcet(ms(of.1))
    });
    let f = move || async move {
        for (time, _) in rest {
            sleep(ms(*time)).await;
        }
    };
    dag.async_source(f).register(stated.priority(priority));
    dag
}

fn responses_ms(report: &Report, dag: &str) -> Vec<u64> {
    let jobs = report.dag(dag).jobs();
    jobs.filter_map(|job| Some(job.response_time_ns()? / MS))
        .collect()
}

#[test]
fn an_instant_of_the_job_counts_from_its_release() {
    let urgent = sleeper("b", 0, 3, &[]);
    let dag = every(20, "a");
    dag.jobs(2);
    let f = || async {
        until(ms(5)).await;
        until(ms(5)).await; // which is past
        until(ms(9)).await;
    };
    let attributes = taking("a", 1).priority(1);
    let attributes = attributes.wait(ms(5)).wcet(ms(1)).wait(ms(0)).wcet(ms(1));
    dag.async_source(f)
        .register(attributes.wait(ms(4)).wcet(ms(1)));
    let report = run(&VirtualTime::new(), &[urgent, dag]);
    // It starts 3 ms late in its first job, and that changes nothing.
    assert_eq!(responses_ms(&report, "a"), [10, 10]);
}

#[test]
fn a_wait_to_its_limit_is_no_breach_where_timers_are_late() {
    let machine = VirtualTime::new().late(ms(1), 7);
    let report = run(&machine, &[sleeper("a", 0, 1, &[(5, 1)])]);
    // The release and the end of the wait are late, by 1 ms together.
    assert_eq!(responses_ms(&report, "a"), [8]);
}

/// Returns the message of the panic of an async source in its first job.
fn fault<Fut>(stated: SubtaskAttributes, f: impl FnMut() -> Fut + Send + 'static) -> String
where
    Fut: Future<Output = ()> + Send + 'static,
{
    let machine = VirtualTime::new().contain_panics();
    let dag = every(20, "faulty");
    dag.jobs(2).async_source(f).register(stated);
    let report = run(&machine, &[dag]);
    let [panic] = &report.panics[..] else {
        panic!("{:?}", report.panics);
    };
    assert_eq!(report.dag("faulty").statistics().completed, 0);
    panic.message.clone()
}

/// Polls a future once, and drops it.
async fn poll_once(future: impl Future<Output = ()>) {
    let mut future = Some(Box::pin(future));
    std::future::poll_fn(|context| {
        let future = future.take().expect("once");
        _ = { future }.as_mut().poll(context);
        std::task::Poll::Ready(())
    })
    .await;
}

/// Passes a clone of the waker on.
async fn by_another_waker(future: impl Future<Output = ()>) {
    let mut future = Box::pin(future);
    std::future::poll_fn(|context| {
        let waker = context.waker().clone();
        waker.wake_by_ref();
        future
            .as_mut()
            .poll(&mut std::task::Context::from_waker(&waker))
    })
    .await;
}

#[test]
fn each_wait_that_is_not_as_stated_is_a_fault_with_a_name() {
    let stated = || named("faulty").wait(ms(3));
    let cases = [
        (
            fault(stated(), || async {
                sleep(ms(1)).await;
                sleep(ms(1)).await;
            }),
            WaitFault::TooMany { stated: 1 },
        ),
        (
            fault(stated().wait(ms(1)), || sleep(ms(1))),
            WaitFault::LeftOut {
                taken: 1,
                stated: 2,
            },
        ),
        (
            fault(stated(), || sleep(ms(4))),
            WaitFault::TooLong {
                number: 0,
                asked: ms(4),
                limit: ms(3),
            },
        ),
        (
            fault(stated().wait(ms(3)), || async {
                until(ms(2)).await;
                until(ms(6)).await;
            }),
            WaitFault::TooLong {
                number: 1,
                asked: ms(4),
                limit: ms(3),
            },
        ),
        (
            fault(stated().wait(ms(3)), || async {
                poll_once(sleep(ms(1))).await;
                sleep(ms(1)).await;
            }),
            WaitFault::TwoAtOnce,
        ),
        (
            fault(stated(), || poll_once(sleep(ms(1)))),
            WaitFault::NotAwaited,
        ),
        (fault(stated(), std::future::pending), WaitFault::Foreign),
        (
            fault(stated(), || by_another_waker(sleep(ms(1)))),
            WaitFault::Outside,
        ),
    ];
    let mut codes = Vec::new();
    for (message, expected) in cases {
        assert_eq!(message, expected.to_string());
        codes.push(expected.code());
    }
    codes.dedup();
    assert_eq!(codes, WaitFault::CODES);
}

#[test]
fn an_async_function_may_do_without_waits() {
    let dag = every(10, "plain");
    dag.jobs(2);
    let source = dag.async_source(|| async { (3,) }).writes(&["three"]);
    source.register(taking("source", 1));
    let sink = |(three,): (i32,)| async move { assert_eq!(three, 3) };
    let sink = dag.async_subtask(sink).reads(&["three"]);
    sink.register(taking("sink", 1));
    let report = run(&VirtualTime::new(), &[dag]);
    assert_eq!(responses_ms(&report, "plain"), [2, 2]);
}

#[test]
fn an_untyped_subtask_waits_between_its_edges() {
    let dag = every(20, "untyped");
    dag.jobs(3);
    let (kept, keep) = Seen::shared();
    let said = keep.clone();
    let first = dag.register_untyped_async_subtask(
        move |job| {
            let keep = keep.clone();
            async move {
                sleep(ms(job)).await;
                keep.add((job, "first"));
            }
        },
        taking("first", 1).wait(ms(5)).wcet(ms(1)),
    );
    let second = move |job| said.add((job, "second"));
    let second = dag.register_untyped_subtask(second, taking("second", 1));
    dag.precede(&first, &second);
    let report = run(&VirtualTime::new(), &[dag]);
    assert_eq!(responses_ms(&report, "untyped"), [3, 4, 5]);
    let expected = (0..3).flat_map(|job| [(job, "first"), (job, "second")]);
    assert_eq!(kept.all(), expected.collect::<Vec<_>>());
}

#[test]
fn segments_take_their_own_wcets_or_less() {
    let report = |silent| {
        let machine = VirtualTime::new().silent(silent);
        run(&machine, &[sleeper("a", 0, 4, &[(3, 1), (2, 5)])])
    };
    let full = report(virtual_time::Silent::Wcet);
    assert_eq!(responses_ms(&full, "a"), [15]);
    let drawn = report(virtual_time::Silent::Drawn { seed: 5 });
    let executed_ns = drawn.instances[0].execution_ns;
    assert!((3..10 * MS).contains(&executed_ns), "{executed_ns}");
    // A new draw for each segment, and the same again.
    let again = report(virtual_time::Silent::Drawn { seed: 5 });
    assert_eq!(again.events, drawn.events);
}

/// Commits a camera that asks an accelerator twice in a job, and asks for the time between its
/// waits; and returns the driver's end. The function fails at an answer of 13.
fn camera() -> DeviceDriver<u64, u64> {
    let (device, driver) = create_device::<u64, u64>("accelerator");
    device.record();
    let dag = every(20, "camera");
    dag.jobs(40).record::<u64>("frame").record::<u64>("found");
    let source = dag.source(job_numbers(1)).writes(&["frame"]);
    source.register(named("take"));
    let ask = |device: Asker<u64, u64>, (frame,): (u64,)| async move {
        let first = device.ask(frame).within(ms(3)).await;
        let between_ns = fass::now_ns();
        sleep(Duration::from_micros(frame * 10)).await;
        let second = device.ask(frame + 1).await;
        let of = |answer: Result<u64, TimedOut>| answer.unwrap_or(99);
        assert!(frame != 30 || first != Ok(13), "worn out");
        (of(first) + 1_000 * of(second) + 1_000_000 * (between_ns + fass::now_ns()),)
    };
    let ask = dag.using(device.asking()).async_subtask(ask);
    let stated = taking("ask", 1).wait(ms(4)).wcet(ms(1));
    let stated = stated.wait(ms(1)).wcet(ms(1)).wait(ms(4)).wcet(ms(1));
    let ask = ask.reads(&["frame"]).writes(&["found"]);
    ask.register(stated);
    let sink = dag.subtask(|_: (u64,)| ()).reads(&["found"]);
    sink.register(named("sink"));
    commit(&[dag]);
    driver
}

#[test]
fn a_replay_computes_the_same_without_the_device_in_the_same_time() {
    for last in [40, 30] {
        let machine = VirtualTime::new().contain_panics();
        let driver = camera();
        let mut random = Random::new(last);
        machine.answers(driver, move |question, job| {
            let number = if job == last {
                13
            } else {
                question + random.within(0..=90)
            };
            let after = Duration::from_micros(random.within(0..=6_000));
            let after = if job == last { ms(1) } else { after };
            random.chance(90).then_some((after, number))
        });
        let recorded = machine.run();
        assert_eq!(recorded.violations(), []);
        let recording = machine.recording();
        let replaying = VirtualTime::new().contain_panics();
        let machine = replaying.replay(&recording).expect("it is whole");
        let mut driver = camera();
        let report = machine.run();
        assert_eq!(report.violations(), []);
        assert!(driver.question().is_none());
        assert_eq!((report.divergence.as_ref(), report.uncompared), (None, 0));
        assert_eq!(report.compared, last);
        // The source takes no time now, and what failed is cut by the recording.
        let of_both = [&recorded, &report].map(|report| {
            let all = report.dag("camera").subtask("ask").into_iter();
            let all = all.filter(|of| of.instance.job < last);
            let times = all.filter_map(|of| Some(of.finish_ns? - of.start_ns?));
            times.collect::<Vec<_>>()
        });
        assert_eq!(of_both[0], of_both[1]);
        assert_eq!(report.panics.len(), usize::from(last == 30));
    }
}

#[test]
fn an_answer_is_shown_among_what_its_subtask_takes() {
    let machine = VirtualTime::new();
    let driver = camera();
    machine.answers(driver, |question, _| {
        (question % 2 == 0).then_some((ms(2), 5))
    });
    let shown = machine.until("camera", 1).expect("it ends");
    let shown = shown.to_string();
    let expected = r"takes `accelerator`: [[0,0,null],[2,2000000,5]]";
    assert!(shown.contains(expected), "{shown}");
}

#[test]
fn a_recorded_source_that_waits_is_replayed() {
    let commit_source = |salt: u64| {
        let dag = every(10, "slow");
        dag.jobs(5).record::<u64>("number").record::<u64>("twice");
        let mut number = salt;
        let source = move || {
            number += 1;
            async move {
                sleep(ms(3)).await;
                (number,)
            }
        };
        let source = dag.async_source(source).writes(&["number"]);
        source.register(taking("source", 1).wait(ms(3)).wcet(ms(1)));
        let twice = |(number,): (u64,)| (2 * number,);
        let twice = dag.subtask(twice).reads(&["number"]).writes(&["twice"]);
        twice.register(named("twice"));
        let sink = dag.subtask(|_: (u64,)| ()).reads(&["twice"]);
        sink.register(named("sink"));
        commit(&[dag]);
    };
    let machine = VirtualTime::new();
    commit_source(7);
    machine.run();
    let recording = machine.recording();
    let machine = VirtualTime::new().replay(&recording).expect("it is whole");
    commit_source(70);
    let report = machine.run();
    assert_eq!((report.compared, report.divergence.as_ref()), (5, None));
    assert_eq!(report.violations(), []);
}
