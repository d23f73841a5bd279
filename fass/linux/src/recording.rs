//! Recording and replaying, as a program asks for it.

use std::io::{self, Write};

use fass::edge::{Drained, Outcome, Wish, send_rest};

use crate::edge::{self, FILE, File, LEFT, send, unpoisoned};
use crate::machine::Linux;

/// How much may wait to be sent.
const ROOM_BYTES: usize = 8 << 20;

impl Linux {
    /// Has the run to come recorded, by the name of an app.
    ///
    /// ```no_run
    /// use std::fs::File;
    /// use linux::{Linux, Mechanism};
    ///
    /// let machine = Linux::new(2, Mechanism::Fifo).expect("two processors are there");
    /// machine.record("pump", File::create("pump.rec").expect("a file"));
    /// // build DAGs, name topics by `Dag::record`, commit
    /// machine.run().expect("it is committed");
    /// machine.end_recording(true).expect("the file is written");
    /// ```
    pub fn record(&self, app: &'static str, to: impl Write + Send + 'static) {
        self.record_as(app, true, to);
    }

    /// Works like [`record`](Self::record), and takes also a run of which nothing is recorded.
    pub fn keep(&self, app: &'static str, to: impl Write + Send + 'static) {
        self.record_as(app, false, to);
    }

    fn record_as(&self, app: &'static str, is_needed: bool, to: impl Write + Send + 'static) {
        *unpoisoned(&FILE) = Some(File {
            writer: Box::new(to),
            failure: None,
        });
        let wish = Wish::Record {
            app,
            bytes: ROOM_BYTES,
            is_needed,
        };
        edge::get().set_wish(Box::leak(Box::new(wish)));
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

    /// Writes the end of a recording, and returns what a replay has found, and how complete the
    /// recording is. `is_over`: the run has not been ended before its time.
    ///
    /// # Errors
    ///
    /// Why the recording could not be written.
    pub fn end_recording(&self, is_over: bool) -> io::Result<(Option<Outcome>, Option<Drained>)> {
        let outcome = edge::get().end_run(is_over);
        let drained = send_rest(unpoisoned(&LEFT).take(), &mut send);
        match unpoisoned(&FILE).take() {
            Some(File {
                failure: Some(failure),
                ..
            }) => Err(failure),
            Some(mut file) => file.writer.flush().map(|()| (outcome, drained)),
            None => Ok((outcome, drained)),
        }
    }

    /// Returns why a recording or a replay could not be, and how a replay differed from its
    /// recording, if that is so.
    #[must_use]
    pub fn objections() -> [Option<String>; 2] {
        let edge = edge::get();
        [edge.refusal(), edge.complaint()].map(|text| text.map(str::to_owned))
    }
}
