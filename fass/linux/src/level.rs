//! The levels of SCHED_FIFO used by the program's threads.
//!
//! | level | threads |
//! |---|---|
//! | top | the release threads, and threads after `Control::raise` |
//! | top - 1 | a worker reporting an end after its demotion |
//! | top - 2 | workers running the scheduler's choice |
//! | top - 3 | demoted workers: their instances were preempted |
//! | none | abandoned workers: their instances have exceeded their budgets or cannot unwind |
//!
//! The four levels are neighbours, below the level 50 of Linux's threaded interrupt handlers. Our
//! `sched_ext` policy has the same four.
//!
//! # The policy
//!
//! `bpf/seats.bpf.c` contains the policy. For this program, the policy is a table of threads: on
//! the same processor, a thread with a higher entry goes before a thread with a lower entry.
//!
//! A privileged person loads the policy; then this program owns the policy until the program ends.
//! A store moves a thread within the order. No system call is necessary, since Linux asks the
//! policy in the steps that follow anyway: a preemption wakes the worker taking the core over, and
//! where a demoted worker goes on, the worker that had the core goes to sleep.

use std::fs;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

use crate::sys;
use crate::sys::ThreadId;

/// The top level, unless set otherwise.
pub(crate) const USUAL_TOP: i32 = 49;

/// The levels of a run's threads, and the mechanism behind them.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Levels {
    /// SCHED_FIFO up to this level.
    Fifo(i32),
    /// Our `sched_ext` policy.
    SchedExt(Seats),
}

/// The role deciding a thread's level, lowest level first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Role {
    /// The thread's instance was ended: the thread must not delay anybody any more, not even other
    /// programs.
    Abandoned,
    /// The thread has lost its core.
    Demoted,
    /// The thread runs the instance its core should run.
    Run,
    /// The thread needs the scheduler's lock at once, whatever its core computes.
    Report,
    /// The thread releases jobs.
    Release,
}

impl Levels {
    /// Takes the four levels of SCHED_FIFO up to `top`, if this program may.
    ///
    /// # Errors
    ///
    /// The kernel's reason for refusing.
    pub(crate) fn of_fifo(top: i32) -> std::io::Result<Self> {
        let probe = move || {
            let me = sys::thread();
            sys::set_level(me, top)?;
            sys::set_normal(me)
        };
        // In a thread of its own: the caller keeps its level, whatever comes of the probe.
        let answer = std::thread::spawn(probe).join();
        answer
            .expect("the probe does not panic")
            .map(|()| Self::Fifo(top))
    }

    /// Brings a thread to its role's level.
    pub(crate) fn bring(self, thread: ThreadId, role: Role) {
        // 0 for threads without a level.
        let rank = role as u8;
        // The probe has succeeded before, and a thread that has ended needs no level.
        let _ = match self {
            Self::Fifo(_) if rank == 0 => sys::set_normal(thread),
            // `Release`, rank 4, has the top.
            Self::Fifo(top) => sys::set_level(thread, top - 4 + i32::from(rank)),
            Self::SchedExt(seats) => {
                seats.put(thread, rank);
                Ok(())
            }
        };
    }
}

/// The policy's name.
const NAME: &str = "fass_seats";
/// The path at which the policy's table is pinned.
const PLACE: &std::ffi::CStr = c"/sys/fs/bpf/fass_seats";
/// How many threads the table has a byte for: Linux's thread numbers never exceed this.
const THREADS: usize = 1 << 22;
/// Linux's name of the host's thread numbering, outside of containers.
const FIRST_NUMBERING: &str = "pid:[4026531836]";

/// The policy's table: a byte for each thread, then the number of the owning program.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seats(&'static [AtomicU32]);

impl Seats {
    const OWNER: usize = THREADS / size_of::<AtomicU32>();

    /// Takes the policy for this program.
    ///
    /// # Errors
    ///
    /// Fact and remedy, in a line.
    pub(crate) fn acquire() -> Result<Self, String> {
        let read = |name: &str| {
            let text = fs::read_to_string(format!("/sys/kernel/sched_ext/{name}"));
            text.map(|text| text.trim().to_owned())
        };
        check(
            read("state").ok().as_deref(),
            read("root/ops").ok().as_deref(),
        )?;
        let numbering = fs::read_link("/proc/self/ns/pid");
        if numbering.is_ok_and(|name| name.as_os_str() != FIRST_NUMBERING) {
            return Err(
                "this program is in a container that numbers threads anew, and the policy \
                 `fass_seats` knows them by number; do run it outside, or with the host's \
                 numbers (`--pid=host`)"
                    .to_owned(),
            );
        }
        static TABLE: OnceLock<Result<Seats, String>> = OnceLock::new();
        let table = TABLE.get_or_init(|| {
            let bytes = THREADS + size_of::<AtomicU32>();
            let table = sys::pinned_table(PLACE, bytes).map(Self);
            table.map_err(|why| {
                format!(
                    "the table of the policy `{NAME}`, {}, is refused ({why}); do run it as \
                     root, or `setcap cap_bpf+ep PROGRAM`",
                    PLACE.to_string_lossy()
                )
            })
        });
        let seats = table.clone()?;
        seats.own()?;
        Ok(seats)
    }

    /// Makes this program the owner of the policy. The policy is unloaded when its owner ends.
    fn own(self) -> Result<(), String> {
        let (me, owner) = (std::process::id(), &self.0[Self::OWNER]);
        let taken = owner.compare_exchange(0, me, Ordering::AcqRel, Ordering::Acquire);
        match taken {
            Err(other) if other != me => Err(format!(
                "program {other} has the policy `{NAME}`; do end that one first"
            )),
            _ => Ok(()),
        }
    }

    /// Gives a thread a place in the order; 0 is the place of ordinary programs.
    pub(crate) fn put(self, thread: ThreadId, rank: u8) {
        let Ok(number) = usize::try_from(thread.0) else {
            return;
        };
        // The remainder keeps a number beyond the table off the owner's word.
        let (word, shift) = (&self.0[number / 4 % Self::OWNER], number % 4 * 8);
        // Another thread's byte in the same word may be changed at the same time.
        let _ = word.fetch_update(Ordering::AcqRel, Ordering::Relaxed, |word| {
            Some(word & !(0xff << shift) | u32::from(rank) << shift)
        });
    }
}

/// Checks the kernel's report on `sched_ext`: its state, and the loaded policy's name.
fn check(state: Option<&str>, policy: Option<&str>) -> Result<(), String> {
    const LOAD: &str = "do load it, as root: `bpftool struct_ops register seats.bpf.o`";
    match (state, policy) {
        (None, _) => Err(
            "this kernel has no sched_ext; do use Linux 6.13 or later with \
             CONFIG_SCHED_CLASS_EXT, or `./scripts/linux`, which boots one in QEMU"
                .to_owned(),
        ),
        (Some("enabled"), Some(NAME)) => Ok(()),
        (Some("enabled"), Some(other)) => Err(format!(
            "the policy `{other}` of sched_ext is loaded, and Linux has one at a time; do end it, \
             and {LOAD}"
        )),
        _ => Err(format!("the policy `{NAME}` is not loaded; {LOAD}")),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;
    use crate::sys::ThreadId;

    #[test]
    fn each_refusal_has_its_remedy_in_one_line() {
        for (state, policy, says) in [
            (None, None, "this kernel has no sched_ext; do "),
            (
                Some("disabled"),
                None,
                "the policy `fass_seats` is not loaded; do load it, ",
            ),
            (
                Some("enabled"),
                Some("simple"),
                "the policy `simple` of sched_ext is loaded, ",
            ),
        ] {
            let why = check(state, policy).expect_err("it is refused");
            assert!(why.starts_with(says) && !why.contains('\n'), "{why}");
        }
        assert_eq!(check(Some("enabled"), Some("fass_seats")), Ok(()));
    }

    #[test]
    fn a_thread_is_put_where_the_policy_looks_and_no_other_is_moved() {
        let words: Vec<AtomicU32> = (0..=Seats::OWNER).map(|_| AtomicU32::new(0)).collect();
        let seats = Seats(Vec::leak(words));
        for (thread, rank) in [(4, 1), (5, 2), (7, 4), (5, 3), (i32::MAX, 9), (-1, 9)] {
            seats.put(ThreadId(thread), rank);
        }
        assert_eq!(
            seats.0[1].load(Ordering::Relaxed).to_le_bytes(),
            [1, 3, 0, 4]
        );
        assert_eq!(seats.0[Seats::OWNER].load(Ordering::Relaxed), 0);
        assert!(seats.own().is_ok() && seats.own().is_ok(), "it has it");
        seats.0[Seats::OWNER].store(1, Ordering::Relaxed);
        let why = seats.own().expect_err("another one has it");
        assert!(why.starts_with("program 1 has the policy"), "{why}");
    }
}
