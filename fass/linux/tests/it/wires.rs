//! Bytes that come from a pipe, and go into one.

use std::fmt::Write as _;
use std::io::{self, BufRead, BufReader, Read as _, Write as _};
use std::thread;
use std::time::Duration;

use crate::support::{alone, mechanisms, ms};
use fass::shared::{Received, Sender, TimedOut, Wire, WireOptions, WireReader, WireWriter};
use fass::{Dag, SubtaskAttributes, create_dag, finish_create_dags};
use linux::Mechanism;

fn number(line: &[u8]) -> Option<u64> {
    str::from_utf8(line).ok()?.parse().ok()
}

/// A DAG that sends the squares of the numbers that it receives, each when it comes or all of a
/// period.
fn squaring(wire: &Wire, period: Option<Duration>, jobs: u64) -> Dag {
    let dag = create_dag();
    dag.jobs(jobs).relative_deadline(ms(50));
    match period {
        Some(period) => _ = dag.period(period),
        None => _ = dag.sporadic(ms(1)),
    }
    let square = |(numbers, mut wire): (Received<'_, u64>, Sender<'_>)| {
        for number in numbers.map(|packet| packet.value) {
            let _ = writeln!(wire, "{}", number * number);
        }
    };
    let using = dag.using((wire.receiving(number), wire.sending()));
    let named = SubtaskAttributes::named("square");
    using.source(square).register(named);
    dag
}

#[test]
fn each_packet_is_answered_once_and_in_order() {
    for mechanism in mechanisms() {
        let alone = alone(2, mechanism);
        let wire = Wire::new("squares");
        let dag = squaring(&wire, None, 3);
        finish_create_dags(std::slice::from_ref(&dag)).expect("it is sound");
        let (input, mut questions) = io::pipe().expect("a pipe");
        let (answers, output) = io::pipe().expect("a pipe");
        let connection = alone
            .machine
            .connect(&wire, input, output)
            .expect("threads");
        let again = alone.machine.connect(&wire, io::empty(), io::sink());
        assert_eq!(again.unwrap_err().kind(), io::ErrorKind::AlreadyExists);
        // The next question comes when the answer is there, so each has a job.
        let asker = thread::spawn(move || {
            let mut answers = BufReader::new(answers).lines();
            for question in [7_u64, 8, 9] {
                writeln!(questions, "{question}").expect("it is read");
                let answer = answers.next().expect("there is one").expect("it is text");
                assert_eq!(answer, (question * question).to_string());
            }
        });
        let run = alone.machine.run().expect("it is committed");
        drop(connection);
        asker.join().expect("all answers are right");
        assert_eq!(run.statistics(&dag).completed, 3);
        assert_eq!(run.violations().count(), 0);
        assert_eq!((wire.counts().packets, wire.counts().sent_bytes), (3, 9));
    }
}

#[test]
fn what_is_sent_last_goes_when_the_connection_ends_and_losses_are_counted() {
    let alone = alone(1, Mechanism::Normal);
    let options = WireOptions {
        room: 4,
        ..WireOptions::default()
    };
    let wire = Wire::with("squares", options);
    finish_create_dags(&[squaring(&wire, Some(ms(2)), 20)]).expect("it is sound");
    let (mut answers, output) = io::pipe().expect("a pipe");
    // More than there is room for, whenever the jobs are.
    let input = "1\nx\n".repeat(2_000).into_bytes();
    let connection = (alone.machine)
        .connect(&wire, io::Cursor::new(input), output)
        .expect("threads");
    alone.machine.run().expect("it is committed");
    // The reader goes on after the run.
    while wire.counts().packets + wire.counts().lost_packets < 4_000 {
        thread::sleep(ms(1));
    }
    drop(connection);
    let mut sent = String::new();
    answers.read_to_string(&mut sent).expect("it is text");
    let counts = wire.counts();
    assert!(counts.lost_packets > 0, "{counts:?}");
    assert_eq!(sent.len() as u64, counts.sent_bytes);
    assert!(sent.lines().all(|line| line == "1"), "{sent}");
}

/// A DAG that writes a question, and reads the answer, which to each third one does not come.
fn asking(wire: &Wire, jobs: u64) -> Dag {
    let dag = create_dag();
    dag.name("modem").jobs(jobs).in_flight(1);
    let mut questions = 0_u64..;
    let ask = move |(input, output): (WireReader<Option<u64>>, WireWriter)| {
        let question = questions.next().expect("they have no end");
        async move {
            let line = format!("{question}\n");
            assert_eq!(output.write(line.as_bytes()).await, Ok(()));
            if question % 3 == 2 {
                let answer = input.read().within(ms(20)).await;
                assert_eq!(answer, Err(TimedOut));
            } else {
                let answer = input.read().await;
                assert_eq!(answer, Ok(Some(question * question)));
            }
        }
    };
    dag.period(ms(2)).relative_deadline(ms(2));
    let uses = dag.using((wire.reading(number), wire.writing()));
    // However busy the host is.
    let minute = Duration::from_secs(60);
    let named = SubtaskAttributes::named("ask").wait(minute).wait(minute);
    uses.async_source(ask).register(named);
    dag
}

#[test]
fn a_function_waits_until_its_question_has_gone_and_for_the_answer() {
    for mechanism in mechanisms() {
        let alone = alone(1, mechanism);
        let wire = Wire::new("modem");
        finish_create_dags(&[asking(&wire, 12)]).expect("it is sound");
        let (input, mut answers) = io::pipe().expect("a pipe");
        let (questions, output) = io::pipe().expect("a pipe");
        let connection = (alone.machine)
            .connect(&wire, input, output)
            .expect("threads");
        let modem = thread::spawn(move || {
            for question in BufReader::new(questions).lines() {
                let question: u64 = question.expect("it is text").parse().expect("a number");
                if question % 3 != 2 {
                    writeln!(answers, "{}", question * question).expect("it is read");
                }
            }
        });
        let run = alone.machine.run().expect("it is committed");
        drop(connection);
        modem.join().expect("all questions are right");
        assert_eq!(run.faults(), []);
        assert_eq!(run.statistics("modem").completed, 12);
        assert_eq!(run.violations().count(), 0);
        assert_eq!(wire.counts().packets, 8);
    }
}
