//! The executive: the kernel's lower half, which executes jobs on processors.
//!
//! An app names `kernel`, never this crate. The executive and `kernel` are separate crates because
//! the build optimizes each for a different goal: the executive holds the path from a release to a
//! completion, and the code right below that path, so it is compiled for speed; the code above
//! (bringing a machine up, looking in on a run, reporting on a run afterwards) is compiled for
//! size.
//!
//! # Modules, from top to bottom
//!
//! `interrupts` handles a core's timer and wake-ups; `run` executes committed tasks. `text` serves
//! input and output; `memory` and `machine` (processor, interrupts, time) know nothing of the
//! modules above. `docs/architecture.md` has the table of modules; tests compare the code with that
//! table.
//!
//! # Who holds which lock
//!
//! An arrow leads from an outer lock to an inner lock. "Thread" is a context: an instance, a
//! worker, the app's main function, or core 0's background. "Handler" is an interrupt or exception
//! handler.
//!
//! ```text
//!  SLICED --+--> execution[0] --> execution[1] --> ... ---+--> EDGE
//!  WATCH ---+    (several at once: only `divided::rest`)  +--> STOCK
//!  SLICED --> EDGE     SLICED, WATCH, EDGE, ProtocolPlace::protocol --> BUFFER
//!  Network::receiver --> ProtocolPlace::protocol --> Network::sender
//!  (any lock) --> HEAP       (all other locks: no lock inside but HEAP)
//!
//!  lock            data                       taken in a thread by      taken in a handler by
//!  execution[i]    scheduler, journal, bodies find_work, complete,      timer, wake-up, device,
//!                  and contexts of cluster i  answer, commit,           contained fault
//!                                             main, background
//!  STOCK           free contexts              main, end of `work`       `follow`, contained fault
//!  EDGE            recorded, replayed values  commit, replayed source,  scheduler's step,
//!                                             reading of the clock,     contained fault,
//!                                             completion, background    core 0's heartbeat
//!  BUFFER          text for the port          print, idle core          core 0's heartbeat
//!  WAITING         notes of faults            panic, background         contained fault,
//!                                                                       core 0's heartbeat
//!  HEAP            allocator                  allocation, free          (handlers do not allocate)
//!  MEMORY          frames, page table         boot, commit, drivers     -
//!  RECORD, USED    file of the boot; stacks   main, background          -
//!  Kernel::terms   terms of commits           main, commit              -
//!  CLEARING        DAG being dropped          main, after a run         core 0's heartbeat (tries)
//!  SLICED, WATCH   status, console; progress  core 0's background       core 0's heartbeat (tries)
//!  Network::...,   card, neighbours; a        background                card, bell, heartbeat
//!  ProtocolPlace   node's session
//!  Script::line,   line for the port; entries background                core 0's heartbeat
//!  ...::playing    still to arrive on a wire
//! ```
//!
//! EDGE is held around BUFFER only at a commit whose record goes to the console. An instance may
//! call a commit, which takes `Kernel::terms`, EDGE and `execution[0]` before it is refused.
//!
//! Each lock is a [`SpinLock`](machine::spinlock::SpinLock), whose guard masks interrupts on its
//! core: a handler never waits for the code it has interrupted. A kernel panic, a non-maskable
//! interrupt and a machine check only try a lock. Letters between clusters, and the changing fields
//! of a [`Core`](machine::this_core::Core), are atomics. An app's own lock
//! ([`section`](machine::section)) leaves interrupts enabled; inside a section the app may print or
//! allocate, but no lock of the table is held around a section.

#![cfg_attr(not(test), no_std)]
#![allow(
    rustdoc::private_intra_doc_links,
    reason = "its readers have its source; what apps use is documented in `kernel`, too"
)]

extern crate alloc;

#[allow(unsafe_code, reason = "registers, and memory that devices reach")]
pub mod devices;
pub mod interrupts;
#[allow(unsafe_code, reason = "registers, ports, interrupts, page tables")]
pub mod machine;
#[allow(unsafe_code, reason = "the allocator hands out raw memory")]
pub mod memory;
pub mod run;
pub mod text;

pub use text::console;
