//! What completions ask of the run as a whole.

use alloc::sync::Arc;
use core::sync::atomic::{AtomicU8, Ordering};

use sched_dag::ModeId;
use sched_dag::lifecycle::{Entry, Request};

use super::effect::Effect;
use super::signal::Target;

/// No wish.
const NOTHING: u8 = 0;
/// The wish that a DAG is paused, or that the run ends.
pub(crate) const STOP: u8 = 1;
/// The wish that a DAG is resumed, or released by its signal.
pub(crate) const GO: u8 = 2;
/// The wish that a mode is entered at once.
pub(crate) const AT_ONCE: u8 = 1;
/// The wish that a mode is entered when what leaves is idle.
pub(crate) const WHEN_IDLE: u8 = 2;

/// What an instance wishes; the last word counts.
pub(crate) type Wish = Arc<AtomicU8>;

/// Makes a place for wishes.
pub(crate) fn wish() -> Wish {
    Arc::new(AtomicU8::new(NOTHING))
}

/// What a wish is about.
pub(crate) enum Of {
    Run,
    Signal(Arc<Target>),
    Dag(Arc<Target>),
    Mode(ModeId),
}

/// What an instance may ask for.
pub(crate) struct Asked {
    wish: Wish,
    of: Of,
}

impl Asked {
    pub(crate) const fn new(wish: Wish, of: Of) -> Self {
        Self { wish, of }
    }
}

impl Effect for Asked {
    fn happen(&mut self, _completed_ns: u64, ask: &mut dyn FnMut(Request)) {
        let wish = self.wish.load(Ordering::Relaxed);
        if wish == NOTHING {
            return;
        }
        self.wish.store(NOTHING, Ordering::Relaxed);
        ask(match &self.of {
            Of::Run => Request::ShutDown,
            Of::Signal(target) => Request::Signal(target.dag()),
            Of::Dag(target) if wish == STOP => Request::Pause(target.dag()),
            Of::Dag(target) => Request::Resume(target.dag()),
            Of::Mode(mode) if wish == AT_ONCE => Request::Enter(*mode, Entry::AtOnce),
            Of::Mode(mode) => Request::Enter(*mode, Entry::WhenIdle),
        });
    }
}
