//! The way from the handover by `boot` to the app's function, and the machine's end.
//!
//! `handover` goes that way. `settings` takes the kernel's own words of the command line, and
//! `selection` those that say which processors become cores; `announcement` says what machine it
//! is, and `probe` is what the image does in place of an app if a word asks for it. All of the
//! kernel but its entry may be named here: this is where it is put together.

#[allow(unsafe_code, reason = "the way up to the first safe state")]
mod handover;
mod probe;
mod settings;

pub(crate) use handover::start;
