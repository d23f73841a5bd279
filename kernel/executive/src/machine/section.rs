//! Sections of apps' code that one core at a time executes, and that are not preempted.
//!
//! Unlike a [`SpinLock`](super::spinlock::SpinLock), this can be given to code that is
//! not trusted. Interrupts stay enabled in a section, so what happens there is the
//! app's: a fault is contained, a budget ends it. Only preemption is put off until the
//! section ends, as a holder that were preempted would block every core that wants the
//! lock. It is put off for [`LONGEST_NS`] at most: the section of a holder that never
//! returns delays other instances for that time, and no longer.
//!
//! **Holder invariant**: `holder` is null, or the context that alone touches `data`, or for good
//! [`LOST`] once a fault has ended a holder.
//!
//! **Section invariant**: from a context's innermost [`CriticalSection`] on, each lies in a frame of
//! [`ContextLock::with`] on that context's stack that has not returned, and names a lock that this
//! frame borrows.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicPtr, Ordering};

use super::context::{Context, CriticalSection, SectionNote};
use super::this_core::{self, Core};
use super::timer::{self, Alarm};
use super::{cpu, interrupt_flag, local_apic, vector};

/// Stands where the holder does, once a fault has ended one.
const LOST: *mut Context = core::ptr::without_provenance_mut(align_of::<Context>());

/// For how long a section may put off its core's preemption.
const LONGEST_NS: u64 = 1_000_000;

/// Data that one context at a time may use.
#[derive(Debug)]
pub struct ContextLock<T> {
    holder: AtomicPtr<Context>,
    data: UnsafeCell<T>,
}

// SAFETY: by the holder invariant one context at a time reaches the data, so sharing
// this moves the data between cores, for which `T: Send` suffices.
unsafe impl<T: Send> Sync for ContextLock<T> {}

/// Why the data cannot be had, now or ever.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LockRefusal {
    /// The caller is in a section of it.
    HeldByCaller,
    /// A fault has ended its holder.
    HolderEnded,
}

impl<T> ContextLock<T> {
    /// Guards `data`.
    pub const fn new(data: T) -> Self {
        Self {
            holder: AtomicPtr::new(core::ptr::null_mut()),
            data: UnsafeCell::new(data),
        }
    }

    /// Waits for the data and lends it to `section`.
    pub fn with<R>(&self, section: impl FnOnce(&mut T) -> R) -> Result<R, LockRefusal> {
        let mut own_section = CriticalSection {
            holder: &raw const self.holder,
            outer: core::ptr::null_mut(),
        };
        let own = loop {
            let own = enter(&mut own_section);
            let place = core::ptr::from_ref(own).cast_mut();
            let free = core::ptr::null_mut();
            let (acquire, relaxed) = (Ordering::Acquire, Ordering::Relaxed);
            let Err(holder) = (self.holder).compare_exchange(free, place, acquire, relaxed) else {
                break own;
            };
            leave(own, &own_section);
            if holder == place {
                return Err(LockRefusal::HeldByCaller);
            }
            if holder == LOST {
                return Err(LockRefusal::HolderEnded);
            }
            cpu::relax();
        };
        // SAFETY: this context is the holder, and no section of it is open (that was
        // refused), so this is the only reference (holder invariant).
        let result = section(unsafe { &mut *self.data.get() });
        self.holder.store(core::ptr::null_mut(), Ordering::Release);
        leave(own, &own_section);
        Ok(result)
    }
}

/// Keeps the caller from being preempted, for [`LONGEST_NS`] at most.
fn enter(section: &mut CriticalSection) -> &'static Context {
    let were_enabled = interrupt_flag::disable();
    let own = this_core::get().context();
    let innermost = &own.sections().innermost;
    section.outer = innermost.load(Ordering::Relaxed);
    innermost.store(section, Ordering::Release);
    if were_enabled {
        interrupt_flag::enable();
    }
    own
}

/// Ends what `enter` has begun, and does what was put off.
fn leave(own: &Context, section: &CriticalSection) {
    let SectionNote {
        innermost,
        put_off_ns,
    } = own.sections();
    innermost.store(section.outer, Ordering::Release);
    if section.outer.is_null() && put_off_ns.swap(0, Ordering::Relaxed) != 0 {
        let were_enabled = interrupt_flag::disable();
        local_apic::send(this_core::get().apic_id(), vector::WAKE);
        if were_enabled {
            interrupt_flag::enable();
        }
    }
}

/// Ends the sections of a context that was abandoned in them: what they guard is lost.
pub(super) fn lose_all(context: &Context) {
    let SectionNote {
        innermost,
        put_off_ns,
    } = context.sections();
    let mut next = innermost.swap(core::ptr::null_mut(), Ordering::Acquire);
    // SAFETY: by the section invariant it lies in a frame, which nothing has used since.
    while let Some(section) = unsafe { next.as_ref() } {
        let own = core::ptr::from_ref(context).cast_mut();
        // SAFETY: by the section invariant the frame borrows the lock.
        let holder = unsafe { &*section.holder };
        let (release, relaxed) = (Ordering::Release, Ordering::Relaxed);
        // A context that was about to enter waits for another one's.
        let _ = holder.compare_exchange(own, LOST, release, relaxed);
        next = section.outer;
    }
    put_off_ns.store(0, Ordering::Relaxed);
}

/// Puts off the preemption of what runs on this core, `core`, if it is in a section.
/// Reports whether it is put off. In an interrupt handler.
pub fn puts_off(core: &Core, now_ns: u64) -> bool {
    let SectionNote {
        innermost,
        put_off_ns,
    } = core.context().sections();
    if innermost.load(Ordering::Relaxed).is_null() {
        return false;
    }
    let first_ns = match put_off_ns.load(Ordering::Relaxed) {
        0 => {
            put_off_ns.store(now_ns.max(1), Ordering::Relaxed);
            now_ns
        }
        first_ns => first_ns,
    };
    let end_ns = first_ns.saturating_add(LONGEST_NS);
    if now_ns < end_ns {
        // Any alarm whose handler looks at the clock again will do.
        timer::set_no_later(core, Alarm::Budget, end_ns);
    }
    now_ns < end_ns
}

/// Reports whether a preemption on this core has been put off. In an interrupt handler.
pub fn has_put_off(core: &Core) -> bool {
    core.context().sections().put_off_ns.load(Ordering::Relaxed) != 0
}
