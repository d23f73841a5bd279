//! The rule *one core*: a core runs one instance at a time.
//!
//! A core's machine events are all in its own ring, so their order is known
//! even within one nanosecond. What is left over from one instance is its
//! *occupant*: it must be gone before the next one starts or is resumed.

use std::collections::BTreeMap;

use sched_dag::{CoreId, Instance};

use super::breach::{Breach, Rule};
use super::model::What;
use super::view::View;

/// Judges all cores.
pub(super) fn judge(view: &View<'_>, breaches: &mut Vec<Breach>) {
    let mut occupants: BTreeMap<CoreId, Instance> = BTreeMap::new();
    for (event, _) in &view.events {
        let Some(instance) = event.instance() else {
            continue;
        };
        match event.what {
            What::Start | What::Resume => {
                let occupant = occupants.insert(event.core, instance);
                let stays =
                    |occupant: &Instance| !ends_now(view, *occupant, instance, event.time_ns);
                if let Some(occupant) = occupant.filter(stays) {
                    breaches.push(Breach {
                        rule: Rule::OneCore,
                        time_ns: event.time_ns,
                        text: format!(
                            "core {} runs {} while it still runs {}",
                            event.core.0,
                            view.run.name(instance),
                            view.run.name(occupant)
                        ),
                    });
                }
            }
            What::Suspend | What::Finish if occupants.get(&event.core) == Some(&instance) => {
                occupants.remove(&event.core);
            }
            // Another core may have ended it.
            What::Ended => occupants.retain(|_, occupant| *occupant != instance),
            _ => {}
        }
    }
}

/// Reports whether the occupant is ended at this instant: the event may be in
/// another ring, and so come later.
fn ends_now(view: &View<'_>, occupant: Instance, next: Instance, time_ns: u64) -> bool {
    let dropped = view.histories.get(&occupant).and_then(|it| it.dropped);
    occupant != next && dropped.is_some_and(|dropped| dropped.time_ns == time_ns)
}
