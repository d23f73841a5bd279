//! What people ask of the DAGs that an app offers ([`Offers`](crate::Offers)).
//!
//! The console notes it under its lock, and the app does it later, outside of that.

use alloc::vec::Vec;
use core::fmt::Display;

use executive::machine::spinlock::SpinLock;

use super::more::Commands;
use crate::println;

/// What a person wants with a DAG.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wish {
    /// To add it to the run.
    Add,
    /// To remove it.
    Remove,
}

/// The names of the DAGs that are offered, and the latest wish for each.
static ASKED: SpinLock<Vec<(&'static str, Option<Wish>)>> = SpinLock::new(Vec::new());

/// What is asked of the DAGs of this image.
pub(crate) struct Asked;

impl Asked {
    /// Offers nothing any more.
    pub(crate) fn clear(&self) {
        let offered = core::mem::take(&mut *ASKED.lock());
        drop(offered);
    }

    /// Offers one more.
    pub(crate) fn offer(&self, name: &'static str) {
        ASKED.lock().push((name, None));
    }

    /// Takes the wish for the DAG in a place.
    pub(crate) fn take(&self, place: usize) -> Option<Wish> {
        ASKED.lock().get_mut(place)?.1.take()
    }

    /// Returns the name in a place.
    fn name(&self, place: usize) -> Option<&'static str> {
        ASKED.lock().get(place).map(|(name, _)| *name)
    }

    /// Notes a wish, and reports whether there is such a DAG.
    fn note(&self, name: &str, wish: Wish) -> bool {
        let mut offered = ASKED.lock();
        let place = offered.iter_mut().find(|(offered, _)| *offered == name);
        place.map(|(_, place)| *place = Some(wish)).is_some()
    }
}

impl Commands for Asked {
    fn help(&self) -> &'static [(&'static str, &'static str)] {
        &[
            ("offers", "list the DAGs that can be added"),
            ("add DAG", "add one to the run"),
            ("remove DAG", "remove one that was added"),
        ]
    }

    fn answer(&self, name: &str, rest: &str, refuse: &mut dyn FnMut(&dyn Display)) -> bool {
        let wish = match name {
            "offers" if rest.is_empty() => {
                let names = (0..).map_while(|place| self.name(place));
                names.for_each(|name| println!("  {name}"));
                return true;
            }
            "offers" => {
                refuse(&"`offers` wants nothing after it");
                return true;
            }
            "add" => Wish::Add,
            "remove" => Wish::Remove,
            _ => return false,
        };
        if !self.note(rest, wish) {
            refuse(&format_args!(
                "no dag `{rest}` is offered; `offers` lists those that are"
            ));
        }
        true
    }
}
