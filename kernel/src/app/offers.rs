//! DAGs that people can add to a run at the console, and remove.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt::Display;

use executive::text::json;
use fass::{Commit, Dag};

use crate::report::Ns;
use crate::watch::background::asked::{Asked, Wish};
use crate::watch::background::more;

/// DAGs that an app offers: at the console `offers` lists them, `add DAG` adds one to the run and
/// `remove DAG` removes it.
///
/// ```no_run
/// use fass::{Commit, Dag};
/// use kernel::{Ending, Machine, Offers};
///
/// fn run(machine: &Machine, mut commit: Commit, photo: fn() -> Dag) -> Result<(), Ending> {
///     let mut offers = Offers::new();
///     offers.dag("photo", photo); // built anew each time that it is added
///     machine.run_with(|| offers.serve(&mut commit))?;
///     Ok(())
/// }
/// ```
#[derive(Default)]
pub struct Offers {
    /// In the order of the names in [`Asked`].
    offers: Vec<Offer>,
}

struct Offer {
    name: &'static str,
    build: Box<dyn FnMut() -> Dag>,
    /// What was added, until it is removed.
    added: Option<Dag>,
}

impl core::fmt::Debug for Offers {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let names = self.offers.iter().map(|offer| offer.name);
        f.debug_list().entries(names).finish()
    }
}

impl Offers {
    /// Begins without any, in place of what was offered before.
    ///
    /// See [`Offers`].
    #[must_use]
    pub fn new() -> Self {
        Asked.clear();
        // Once is enough.
        let _ = more::OFFERS.set(&Asked);
        Self::default()
    }

    /// Offers a DAG, which `build` makes whenever it is to be added. People call it by this name,
    /// which should be the DAG's own.
    ///
    /// See [`Offers`].
    pub fn dag(&mut self, name: &'static str, build: impl FnMut() -> Dag + 'static) -> &mut Self {
        Asked.offer(name);
        self.offers.push(Offer {
            name,
            build: Box::new(build),
            added: None,
        });
        self
    }

    /// Does what people have asked for, and prints what came of it, also as machine lines of kind
    /// `offer`. To be called in the function that [`Machine::run_with`](crate::Machine::run_with)
    /// calls.
    ///
    /// See [`Offers`].
    pub fn serve(&mut self, commit: &mut Commit) {
        for (place, offer) in self.offers.iter_mut().enumerate() {
            match Asked.take(place) {
                None => {}
                Some(Wish::Add) => offer.add(commit),
                Some(Wish::Remove) => offer.remove(commit),
            }
        }
    }
}

impl Offer {
    fn add(&mut self, commit: &mut Commit) {
        let dag = (self.build)();
        match commit.add(core::slice::from_ref(&dag)) {
            Ok(from) => {
                let from_ns = u64::try_from(from.as_nanos()).unwrap_or(u64::MAX);
                let (name, from) = (self.name, Ns(from_ns));
                crate::println!("dag `{name}` is added; its time begins at {from} of the run");
                self.added = Some(dag);
                self.tell("add", Ok(Some(from_ns)));
            }
            Err(error) => self.tell("add", Err(&error)),
        }
    }

    fn remove(&mut self, commit: &mut Commit) {
        let Some(dag) = self.added.take() else {
            let why = "it is not in the run; `add` adds it";
            return self.tell("remove", Err(&why));
        };
        match commit.remove(&dag) {
            Ok(()) => {
                crate::println!("dag `{}` releases no more jobs, and goes", self.name);
                self.tell("remove", Ok(None));
            }
            Err(error) => self.tell("remove", Err(&error)),
        }
    }

    /// Prints what came of a wish: when the DAG's time begins, or why nothing was done.
    fn tell(&self, wish: &str, result: Result<Option<u64>, &dyn Display>) {
        if let Err(why) = result {
            crate::println!("dag `{}`: {why}", self.name);
        }
        json::emit("offer", |line| {
            line.text("dag_name", self.name)
                .text("wish", wish)
                .flag("done", result.is_ok());
            match result {
                Ok(Some(from_ns)) => {
                    line.number("from_ns", from_ns);
                }
                Ok(None) => {}
                Err(why) => {
                    line.text("reason", why);
                }
            }
        });
    }
}
