//! What functions are told that ask for the time: noted, or as it was noted.

use std::cell::{Cell, RefCell};

/// The answers of the running instance.
#[derive(Debug, Default)]
pub(super) struct Clock {
    /// Whether they are noted.
    is_noted: Cell<bool>,
    answers: RefCell<Vec<u64>>,
    /// Those of the recorded run.
    recorded: RefCell<Vec<u64>>,
}

impl Clock {
    pub(super) fn begin(&self, is_noted: bool, recorded: Option<Vec<u64>>) {
        self.is_noted.set(is_noted);
        self.recorded.replace(recorded.unwrap_or_default());
    }

    /// Returns the recorded answer, as long as there is one, and notes it.
    pub(super) fn answer_ns(&self, now_ns: u64) -> u64 {
        if !self.is_noted.get() {
            return now_ns;
        }
        let mut answers = self.answers.borrow_mut();
        let recorded = self.recorded.borrow().get(answers.len()).copied();
        answers.push(recorded.unwrap_or(now_ns));
        recorded.unwrap_or(now_ns)
    }

    /// Returns the answers as bytes, if there are any.
    pub(super) fn end(&self) -> Option<Vec<u8>> {
        self.is_noted.set(false);
        let answers = self.answers.take();
        (!answers.is_empty()).then(|| recording::to_bytes(&answers))
    }
}
