//! Wires on Linux: bytes from whatever can be read, and to whatever can be written.
//!
//! Each wire has two threads of no level, which wait where the run's threads never do: one in a
//! read, one for a millisecond whenever nothing is to go. So bytes may arrive and go late where
//! the cores are busy, and delay nobody.

use std::io::{self, ErrorKind, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use fass::{Platform as _, Wire};

use crate::machine::Linux;
use crate::platform::HOST;

/// The time between two looks for bytes that are to go.
const PERIOD: Duration = Duration::from_millis(1);

/// A wire that is connected, until this is dropped, which sends what is left to go.
///
/// See [`Linux::connect`].
#[derive(Debug)]
pub struct Connection {
    has_ended: Arc<AtomicBool>,
    writer: Option<JoinHandle<()>>,
}

impl Linux {
    /// Connects a wire: what is read from `input` arrives, until its end, and what is sent goes
    /// to `output`, as long as that takes it. To be called after the commit and once a wire.
    ///
    /// ```
    /// use std::time::Duration;
    /// use fass::{Received, SubtaskAttributes, Wire, create_dag, finish_create_dags};
    /// use linux::{Linux, Mechanism};
    ///
    /// let machine = Linux::new(1, Mechanism::Normal).expect("one processor is there");
    /// let (wire, dag, period) = (Wire::new("keys"), create_dag(), Duration::from_millis(2));
    /// dag.jobs(3).relative_deadline(period);
    /// let hear = |lines: Received<'_, u8>| println!("{} lines", lines.count());
    /// dag.period(period)
    ///     .using(wire.receiving(|line| line.first().copied()))
    ///     .source(hear)
    ///     .register(SubtaskAttributes::named("hear"));
    /// finish_create_dags(&[dag]).unwrap();
    /// let connection = machine.connect(&wire, &b"one\ntwo\n"[..], std::io::sink()).unwrap();
    /// machine.run().unwrap();
    /// drop(connection);
    /// ```
    ///
    /// # Errors
    ///
    /// The system has no more threads.
    pub fn connect(
        &self,
        wire: &Wire,
        input: impl Read + Send + 'static,
        output: impl Write + Send + 'static,
    ) -> io::Result<Connection> {
        let has_ended = Arc::new(AtomicBool::new(false));
        let (own, ended) = (wire.clone(), Arc::clone(&has_ended));
        let writer = thread::Builder::new().spawn(move || write(&own, output, &ended))?;
        let (own, ended) = (wire.clone(), Arc::clone(&has_ended));
        let connection = Connection {
            has_ended,
            writer: Some(writer),
        };
        // It may stand in a read for ever, and so nobody waits for it.
        thread::Builder::new().spawn(move || read(&own, input, &ended))?;
        Ok(connection)
    }
}

/// Lets arrive what can be read.
fn read(wire: &Wire, mut input: impl Read, has_ended: &AtomicBool) {
    let mut bytes = [0; 4096];
    while !has_ended.load(Ordering::Relaxed) {
        match input.read(&mut bytes) {
            Ok(count @ 1..) => {
                if let Some((plan, dag)) = wire.arrive(&bytes[..count], fass::now_ns()) {
                    HOST.raise(plan, dag);
                }
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Ok(0) | Err(_) => return,
        }
    }
}

/// Writes what is to go, and ends when nothing is left.
fn write(wire: &Wire, mut output: impl Write, has_ended: &AtomicBool) {
    let mut bytes = Vec::new();
    loop {
        let is_last = has_ended.load(Ordering::Acquire);
        bytes.extend(std::iter::from_fn(|| wire.depart()));
        if bytes.is_empty() {
            if is_last {
                return;
            }
            thread::sleep(PERIOD);
            continue;
        }
        if output
            .write_all(&bytes)
            .and_then(|()| output.flush())
            .is_err()
        {
            // What is sent from now on finds no room in the end, and is counted.
            return;
        }
        bytes.clear();
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.has_ended.store(true, Ordering::Release);
        // A panic in a writer of the app's own is told on its thread.
        let _ = self.writer.take().map(JoinHandle::join);
    }
}
