//! The steps from the handover by `boot` to the app's function, and the machine's end.
//!
//! `handover` takes the steps, and describes the machine in the `boot` line. `settings` takes the
//! kernel's own options, among them those that choose the processors to become cores. `probe`
//! replaces the app if an option asks for it. All parts of the kernel but its entry may be named
//! here, because this is where the kernel is put together.

#[allow(unsafe_code, reason = "the way up to the first safe state")]
mod handover;
mod probe;
mod settings;

pub(crate) use handover::start;
