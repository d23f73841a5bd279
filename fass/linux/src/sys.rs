//! Linux's system calls missing from the standard library: the crate's only module for system
//! calls.
//!
//! The symbols belong to the C library, linked by the standard library anyway. Each function checks
//! the results it uses, and is safe to call with any arguments.

use std::ffi::{CStr, c_char};
use std::io;
use std::os::fd::{AsFd, AsRawFd, FromRawFd, OwnedFd};
use std::sync::atomic::AtomicU32;

pub(crate) use end_signals::{wait, wake};

unsafe extern "C" {
    fn clock_gettime(clock: i32, time: *mut Time) -> i32;
    fn epoll_create1(flags: i32) -> i32;
    fn epoll_ctl(epoll: i32, operation: i32, file: i32, event: *const Interest) -> i32;
    fn epoll_wait(epoll: i32, events: *mut Interest, most: i32, timeout_ms: i32) -> i32;
    fn mlockall(flags: i32) -> i32;
    fn mmap(at: *mut u8, bytes: usize, access: i32, flags: i32, file: i32, from: i64) -> *mut u8;
    fn prctl(option: i32, ...) -> i32;
    fn sched_getaffinity(thread: i32, bytes: usize, mask: *mut u64) -> i32;
    fn sched_setaffinity(thread: i32, bytes: usize, mask: *const u64) -> i32;
    fn sched_setscheduler(thread: i32, policy: i32, level: *const i32) -> i32;
    fn setrlimit(resource: i32, limits: *const [u64; 2]) -> i32;
    fn syscall(number: i64, ...) -> i64;
}

/// `struct timespec`.
#[repr(C)]
struct Time {
    s: i64,
    ns: i64,
}

/// `struct epoll_event`.
#[repr(C)]
#[cfg_attr(target_arch = "x86_64", repr(packed))]
struct Interest {
    events: u32,
    data: u64,
}

const CLOCK_MONOTONIC: i32 = 1;
const CLOCK_THREAD: i32 = 3;

#[cfg(target_arch = "x86_64")]
const SYS_GETTID: i64 = 186;
#[cfg(target_arch = "x86_64")]
const SYS_BPF: i64 = 321;
#[cfg(target_arch = "x86_64")]
const SYS_MEMBARRIER: i64 = 324;
#[cfg(not(target_arch = "x86_64"))]
const SYS_MEMBARRIER: i64 = 283;
#[cfg(not(target_arch = "x86_64"))]
const SYS_GETTID: i64 = 178;
#[cfg(not(target_arch = "x86_64"))]
const SYS_BPF: i64 = 280;

/// The kernel's number of a thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ThreadId(pub(crate) i32);

/// A set of processors, with room for Linux's maximum.
type Mask = [u64; 128];

/// Returns the calling thread's number.
pub(crate) fn thread() -> ThreadId {
    // SAFETY: the call takes no arguments and touches no memory.
    let id = unsafe { syscall(SYS_GETTID) };
    ThreadId(i32::try_from(id).expect("thread numbers are below 2^22"))
}

fn time_of(clock: i32) -> Option<u64> {
    let mut time = Time { s: 0, ns: 0 };
    // SAFETY: `time` is a `timespec` that lives through the call.
    let result = unsafe { clock_gettime(clock, &raw mut time) };
    let (s, ns) = (u64::try_from(time.s).ok()?, u64::try_from(time.ns).ok()?);
    (result == 0).then(|| s * 1_000_000_000 + ns)
}

/// Returns the time of CLOCK_MONOTONIC.
pub(crate) fn monotonic_ns() -> u64 {
    time_of(CLOCK_MONOTONIC).expect("every Linux has this clock")
}

/// Returns the processor time taken by the calling thread, in nanoseconds.
pub(crate) fn own_processor_time_ns() -> u64 {
    time_of(CLOCK_THREAD).expect("every thread has this clock")
}

/// Returns the processor time taken by a thread of this program, in nanoseconds; `None` if there is
/// no thread with that number.
pub(crate) fn processor_time_ns(thread: ThreadId) -> Option<u64> {
    // The kernel's numbers of threads' clocks, clock_getcpuclockid(3): bit 2 marks a thread, and 2
    // selects the time counted by the scheduler.
    time_of(!thread.0 << 3 | 4 | 2)
}

/// Returns the processors available to this program.
pub(crate) fn processors() -> Vec<u32> {
    let mut mask: Mask = [0; 128];
    // SAFETY: the kernel writes at most as many bytes as the mask has.
    let bytes = unsafe { sched_getaffinity(0, size_of::<Mask>(), mask.as_mut_ptr()) };
    let is_in = |number: &u32| mask[(number / 64) as usize] >> (number % 64) & 1 == 1;
    (0..128 * 64)
        .filter(|number| bytes >= 0 && is_in(number))
        .collect()
}

/// Lets a thread run on one processor only.
pub(crate) fn pin(thread: ThreadId, processor: u32) -> io::Result<()> {
    confine(thread, &[processor])
}

/// Lets a thread run on these processors only.
pub(crate) fn confine(thread: ThreadId, processors: &[u32]) -> io::Result<()> {
    let mut mask: Mask = [0; 128];
    for processor in processors {
        mask[(processor / 64) as usize % 128] |= 1 << (processor % 64);
    }
    // SAFETY: the kernel reads as many bytes as the mask has.
    let result = unsafe { sched_setaffinity(thread.0, size_of::<Mask>(), mask.as_ptr()) };
    checked(result)
}

/// Puts a thread of this program at a level of SCHED_FIFO. Its child threads begin without a level.
pub(crate) fn set_level(thread: ThreadId, level: i32) -> io::Result<()> {
    const FIFO: i32 = 1;
    const RESET_ON_FORK: i32 = 0x4000_0000;
    // SAFETY: the kernel reads one `sched_param`, which is a number.
    let result = unsafe { sched_setscheduler(thread.0, FIFO | RESET_ON_FORK, &raw const level) };
    checked(result)
}

/// Puts a thread of this program into the default class of all programs.
pub(crate) fn set_normal(thread: ThreadId) -> io::Result<()> {
    let level = 0;
    // SAFETY: the kernel reads one `sched_param`, which is a number.
    let result = unsafe { sched_setscheduler(thread.0, 0, &raw const level) };
    checked(result)
}

/// Makes the calling thread's timers exact, in case its class does not.
pub(crate) fn make_timers_exact() {
    const TIMER_SLACK: i32 = 29;
    // SAFETY: the option takes a number.
    unsafe { prctl(TIMER_SLACK, 1_u64) };
}

/// Prepares for [`barrier`], and reports whether the barrier can be used.
pub(crate) fn register_barrier() -> bool {
    const REGISTER_PRIVATE_EXPEDITED: i32 = 1 << 4;
    // SAFETY: the call takes numbers.
    !cfg!(miri) && unsafe { syscall(SYS_MEMBARRIER, REGISTER_PRIVATE_EXPEDITED, 0, 0) == 0 }
}

/// Makes each running thread of the program pass a full barrier. Their earlier writes are visible
/// after the call, and writes before the call are visible to their later reads.
pub(crate) fn barrier() {
    const PRIVATE_EXPEDITED: i32 = 1 << 3;
    // SAFETY: the call takes numbers.
    let result = unsafe { syscall(SYS_MEMBARRIER, PRIVATE_EXPEDITED, 0, 0) };
    assert!(result == 0, "a program that has registered may call this");
}

/// Keeps all present and future memory of the program from being paged out.
pub(crate) fn lock_memory() -> io::Result<()> {
    const CURRENT_AND_FUTURE: i32 = 3;
    // SAFETY: the call takes flags and changes no contents of memory.
    checked(unsafe { mlockall(CURRENT_AND_FUTURE) })
}

/// Makes the kernel end the program when one of its threads has run at a real-time level for so
/// long without ever waiting.
pub(crate) fn limit_real_time(microseconds: u64) -> io::Result<()> {
    const RLIMIT_RTTIME: i32 = 15;
    let limits = [microseconds; 2];
    // SAFETY: the kernel reads one `rlimit`, which is two numbers.
    checked(unsafe { setrlimit(RLIMIT_RTTIME, &raw const limits) })
}

/// Returns the memory of a BPF table pinned at a place, of at least so many bytes. The memory stays
/// valid until the program ends.
pub(crate) fn pinned_table(place: &CStr, bytes: usize) -> io::Result<&'static [AtomicU32]> {
    /// `union bpf_attr` for this command.
    #[repr(C)]
    struct Pinned {
        place: *const c_char,
        file: u32,
        flags: u32,
    }
    const GET_PINNED: i64 = 7;
    const READ_AND_WRITE: i32 = 3;
    const SHARED: i32 = 1;
    let pinned = Pinned {
        place: place.as_ptr(),
        file: 0,
        flags: 0,
    };
    // SAFETY: the kernel reads the struct, and from it a string that ends with 0.
    let file = unsafe { syscall(SYS_BPF, GET_PINNED, &raw const pinned, size_of::<Pinned>()) };
    let file = i32::try_from(file).unwrap_or(-1);
    checked(file)?;
    // SAFETY: the kernel has just opened the file for us, and nobody else has its number.
    let file = unsafe { OwnedFd::from_raw_fd(file) };
    let none = std::ptr::null_mut();
    // SAFETY: the kernel chooses an unused address, and refuses more bytes than the table has.
    let table = unsafe { mmap(none, bytes, READ_AND_WRITE, SHARED, file.as_raw_fd(), 0) };
    // `MAP_FAILED` is all ones, not null.
    if table.addr() == usize::MAX {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: the memory is on pages of its own and never given back. Any bits are valid numbers,
    // and the kernel's concurrent accesses are atomic, too.
    Ok(unsafe { std::slice::from_raw_parts(table.cast(), bytes / size_of::<AtomicU32>()) })
}

/// A descriptor waiting for new input in a file.
pub(crate) struct Arrivals(OwnedFd);

impl Arrivals {
    /// Begins to watch an open file.
    pub(crate) fn of(file: &impl AsFd) -> io::Result<Self> {
        const CLOSE_ON_EXEC: i32 = 0o200_0000;
        const ADD: i32 = 1;
        // Edge-triggered (EPOLLET): input not read yet must not count again and again.
        const INPUT_ARRIVES: u32 = 1 | 1 << 31;
        // SAFETY: the call takes flags.
        let epoll = unsafe { epoll_create1(CLOSE_ON_EXEC) };
        checked(epoll)?;
        // SAFETY: the kernel has just opened the descriptor for us, and nobody else has its number.
        let arrivals = Self(unsafe { OwnedFd::from_raw_fd(epoll) });
        let interest = Interest {
            events: INPUT_ARRIVES,
            data: 0,
        };
        // SAFETY: the kernel reads one `epoll_event`.
        checked(unsafe { epoll_ctl(epoll, ADD, file.as_fd().as_raw_fd(), &raw const interest) })?;
        Ok(arrivals)
    }

    /// Waits, and reports whether anything has arrived since the last wait.
    pub(crate) fn wait(&self, most_ms: i32) -> bool {
        let mut event = Interest { events: 0, data: 0 };
        // SAFETY: the kernel writes at most one `epoll_event`.
        unsafe { epoll_wait(self.0.as_raw_fd(), &raw mut event, 1, most_ms) == 1 }
    }
}

fn checked(result: i32) -> io::Result<()> {
    match result {
        0.. => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}
