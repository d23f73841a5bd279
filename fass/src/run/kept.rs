//! States that are written down, so that a replay can begin with a later job than the first one.
//!
//! The first subtask that may change a state in a job finds there what all jobs before have left.
//! So much is written down every so many jobs, before its function is called, and goes to the
//! platform as a sample does: when the instance is complete, or has failed.

use recording::{Recordable, Schema};

use super::line::{AnyState, Line};
use super::reset::Resettable;

impl<T: Recordable + Send + Sync> AnyState for Resettable<T> {
    fn schema(&self) -> Schema {
        T::schema()
    }

    fn stage(&self, line: &Line, job: u64) {
        if let Some(value) = self.present().look() {
            line.stage::<T>(job, |out| value.encode(out));
        }
    }

    fn restore(&self, bytes: &[u8]) -> bool {
        let restored = T::from_bytes(bytes).ok().zip(self.present().change());
        let restored = restored.map(|(value, mut place)| *place = value);
        restored.is_some()
    }
}
