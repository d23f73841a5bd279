//! Accusations: questions put to a core that takes no interrupts.
//!
//! Another core opens an accusation and sends a non-maskable interrupt; the accused core answers in
//! its handler. Each accusation concerns one core and stays open until this core has answered, so
//! every such interrupt has an accusation, however late the host lets the core run.
//!
//! Disabled interrupts at an answer prove little: the host may have stopped the core within the
//! kernel's instructions that disable interrupts. Some answers later the core has left these
//! instructions, and has taken an interrupt. The core therefore counts how often it has answered
//! without an interrupt in between.

use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

/// The accusations of one core.
pub(super) struct AccusationBox {
    is_open: AtomicBool,
    /// The time of the core's last interrupt, as of its last answer, in nanoseconds.
    interrupted_ns: AtomicU64,
    /// The number of answers since then.
    answers: AtomicU32,
}

impl AccusationBox {
    pub(super) const fn new() -> Self {
        Self {
            is_open: AtomicBool::new(false),
            interrupted_ns: AtomicU64::new(u64::MAX),
            answers: AtomicU32::new(0),
        }
    }

    /// Opens an accusation, and reports whether none was open.
    pub(super) fn open(&self) -> bool {
        !self.is_open.swap(true, Ordering::AcqRel)
    }

    /// Answers on the accused core, whose last interrupt came at `interrupted_ns`: returns the
    /// number of answers since then; 0 if the core is not accused.
    pub(super) fn answer(&self, interrupted_ns: u64) -> u32 {
        if !self.is_open.swap(false, Ordering::AcqRel) {
            return 0;
        }
        let before = self.interrupted_ns.swap(interrupted_ns, Ordering::Relaxed);
        let answers = match before == interrupted_ns {
            true => self.answers.load(Ordering::Relaxed).saturating_add(1),
            false => 1,
        };
        self.answers.store(answers, Ordering::Relaxed);
        answers
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_core_answers_each_accusation_once() {
        let accusation = AccusationBox::new();
        assert_eq!(accusation.answer(5), 0);
        assert!(accusation.open());
        assert!(!accusation.open(), "one is enough");
        assert_eq!(accusation.answer(5), 1);
        assert_eq!(accusation.answer(5), 0);
    }

    #[test]
    fn answers_count_from_the_last_interrupt() {
        let accusation = AccusationBox::new();
        let answer = |interrupted_ns| {
            accusation.open();
            accusation.answer(interrupted_ns)
        };
        assert_eq!([answer(0), answer(0), answer(0)], [1, 2, 3]);
        assert_eq!([answer(7), answer(7), answer(9)], [1, 2, 1]);
    }
}
