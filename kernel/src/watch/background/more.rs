//! Commands that the console has only where the app has called for them.
//!
//! They are reached through [`Commands`] only, so that another image has no code for them.

use core::fmt::Display;

use executive::machine::once::Once;

/// Some commands of the console.
pub(crate) trait Commands: Sync {
    /// Returns them for people: how each is typed, and what it does.
    fn help(&self) -> &'static [(&'static str, &'static str)];

    /// Does what a line says, of its first word and the rest, or tells why not; `false`: it is
    /// none of these commands. Allocates nothing.
    fn answer(&self, name: &str, rest: &str, refuse: &mut dyn FnMut(&dyn Display)) -> bool;

    /// Does a little of what a command has begun.
    fn step(&self) {}
}

/// Those about parameters.
pub(crate) static PARAMETERS: Once<&'static dyn Commands> = Once::new();

/// Those about topics.
pub(crate) static TOPICS: Once<&'static dyn Commands> = Once::new();

/// Returns all that there are.
pub(super) fn all() -> impl Iterator<Item = &'static dyn Commands> {
    [&PARAMETERS, &TOPICS]
        .into_iter()
        .filter_map(|once| once.get().copied())
}
