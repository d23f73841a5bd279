//! What completions ask of the run as a whole.

use alloc::sync::Arc;
use core::sync::atomic::{AtomicU8, Ordering};

use sched_dag::lifecycle::Request;

use super::effect::Effect;
use super::signal::Target;

/// No wish.
const NOTHING: u8 = 0;
/// The wish that a DAG is paused, or the run ends.
pub(crate) const STOP: u8 = 1;
/// The wish that a DAG is resumed.
pub(crate) const GO: u8 = 2;

/// What an instance wishes; the last word counts.
pub(crate) type Wish = Arc<AtomicU8>;

/// Makes a place for wishes.
pub(crate) fn wish() -> Wish {
    Arc::new(AtomicU8::new(NOTHING))
}

/// What an instance may ask for.
pub(crate) struct Asked {
    wish: Wish,
    /// The DAG that is meant; `None`: the run.
    target: Option<Arc<Target>>,
}

impl Asked {
    pub(crate) const fn new(wish: Wish, target: Option<Arc<Target>>) -> Self {
        Self { wish, target }
    }
}

impl Effect for Asked {
    fn happen(&mut self, _completed_ns: u64, ask: &mut dyn FnMut(Request)) {
        let wish = self.wish.load(Ordering::Relaxed);
        if wish == NOTHING {
            return;
        }
        self.wish.store(NOTHING, Ordering::Relaxed);
        ask(match &self.target {
            None => Request::ShutDown,
            Some(target) if wish == STOP => Request::Pause(target.dag()),
            Some(target) => Request::Resume(target.dag()),
        });
    }
}
