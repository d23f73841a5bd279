//! Recording and replaying, as a program asks for it.

use std::io::{self, Write};
use std::sync::atomic::Ordering;

use fass::edge::{Drained, Kept, Outcome, Wish};

use crate::edge::{self, FILE, File, IS_LIVE, LEFT, unpoisoned};
use crate::machine::Linux;

/// How much may wait to be sent.
const ROOM_BYTES: usize = 8 << 20;

impl Linux {
    /// Keeps a record of the commits and runs to come, with the values that are recorded, by the
    /// name of an app. What is there is written while a run goes on, too.
    ///
    /// ```no_run
    /// use std::fs::File;
    /// use linux::{Linux, Mechanism};
    ///
    /// let machine = Linux::new(2, Mechanism::Fifo).expect("two processors are there");
    /// machine.record("pump", File::create("pump.rec").expect("a file"));
    /// // build DAGs, name topics by `Dag::record`, commit
    /// machine.run().expect("it is committed");
    /// machine.end_recording(true);
    /// Linux::end_record().expect("the file is written");
    /// ```
    pub fn record(&self, app: &'static str, to: impl Write + Send + 'static) {
        self.record_as(app, true, to);
    }

    /// Works like [`record`](Self::record), and takes also a run of which no value is recorded.
    pub fn keep(&self, app: &'static str, to: impl Write + Send + 'static) {
        self.record_as(app, false, to);
    }

    fn record_as(&self, app: &'static str, is_needed: bool, to: impl Write + Send + 'static) {
        self.keep_events(to);
        IS_LIVE.store(true, Ordering::Relaxed);
        let wish = Wish::Record {
            app,
            bytes: ROOM_BYTES,
            is_needed,
        };
        edge::get().set_wish(Box::leak(Box::new(wish)));
    }

    /// Keeps a record without values, each run of it when that is over.
    ///
    /// See [`record`](Self::record).
    pub fn keep_events(&self, to: impl Write + Send + 'static) {
        *unpoisoned(&FILE) = Some(Kept::new(File {
            writer: Box::new(to),
            failure: None,
        }));
    }

    /// Has the run to come replay a recording, which may begin with this job of a DAG, or before.
    pub fn replay(&self, recording: &'static [u8], from: Option<(&'static str, u64)>) {
        let bytes = recording;
        edge::get().set_wish(Box::leak(Box::new(Wish::Replay { bytes, from })));
    }

    /// Lets people look at what crosses, by [`watch`](fass::edge::Edge::watch).
    pub fn let_look(&self) {
        edge::get().let_look();
    }

    /// Writes the rest of what a run has recorded. Returns what a replay has found, and how
    /// complete the recording is. `is_over`: the run has not been ended before its time.
    ///
    /// See [`record`](Self::record).
    pub fn end_recording(&self, is_over: bool) -> (Option<Outcome>, Option<Drained>) {
        let outcome = edge::get().end_run(is_over);
        let left = unpoisoned(&LEFT).take();
        let end = |file: &mut Kept<File>| file.end_recording(left);
        (outcome, unpoisoned(&FILE).as_mut().and_then(end))
    }

    /// Writes the end of the record.
    ///
    /// # Errors
    ///
    /// Why it could not be written.
    ///
    /// See [`record`](Self::record).
    pub fn end_record() -> io::Result<()> {
        let Some(file) = unpoisoned(&FILE).take() else {
            return Ok(());
        };
        let mut file = file.end();
        file.flush();
        file.failure.map_or(Ok(()), Err)
    }

    /// Returns why a recording or a replay could not be, and how a replay differed from its
    /// recording, if that is so.
    #[must_use]
    pub fn objections() -> [Option<String>; 2] {
        let edge = edge::get();
        [edge.refusal(), edge.complaint()].map(|text| text.map(str::to_owned))
    }
}
