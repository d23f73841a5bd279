//! The modes that are stated before the commit, and what may be wrong with them.

use alloc::format;
use alloc::rc::{Rc, Weak};
use alloc::string::String;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::fmt;

use sched_dag::DagId;

use super::Draft;

/// The modes of one handle.
#[derive(Default)]
pub(crate) struct ModesDraft(pub(crate) Vec<ModeDraft>);

/// A mode as stated so far.
pub(crate) struct ModeDraft {
    pub(crate) name: String,
    pub(crate) dags: Vec<Named>,
}

/// A DAG that a mode names.
pub(crate) struct Named {
    pub(crate) draft: Weak<RefCell<Draft>>,
}

/// What modes a commit has.
pub(crate) type Modes = Rc<RefCell<ModesDraft>>;

/// All drafts of a commit.
type Drafts = [Rc<RefCell<Draft>>];

/// Something that is wrong with modes.
///
/// ```
/// use fass::{Modes, SubtaskAttributes, create_dag, finish_create_dags};
///
/// # let machine = virtual_time::VirtualTime::new();
/// # let period = core::time::Duration::from_millis(10);
/// let lander = create_dag();
/// lander.name("lander").period(period).relative_deadline(period);
/// lander.register_untyped_subtask(|_job| (), SubtaskAttributes::named("descend"));
/// let modes = Modes::new();
/// modes.mode("flight", &[]);
/// modes.mode("landing", &[&lander]);
/// let error = finish_create_dags(&[lander]).unwrap_err();
/// assert_eq!(error.to_string(), "mode `flight` has no dag; name those that run in it");
/// assert_eq!(error.faults()[0].code(), "empty_mode");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModeFault {
    kind: &'static str,
    text: String,
}

impl ModeFault {
    pub(crate) const fn code(&self) -> &'static str {
        self.kind
    }
}

impl fmt::Display for ModeFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// Returns the modes that a commit names, each handle once.
pub(crate) fn of_commit(drafts: &Drafts) -> Vec<Modes> {
    let mut found: Vec<Modes> = Vec::new();
    for draft in drafts {
        for modes in &draft.borrow().modes {
            if !found.iter().any(|other| Rc::ptr_eq(other, modes)) {
                found.push(Rc::clone(modes));
            }
        }
    }
    found
}

/// Returns the DAGs of each mode of a commit.
pub(crate) fn dags_of_modes(drafts: &Drafts) -> Vec<Vec<DagId>> {
    let found = of_commit(drafts);
    let Some(modes) = found.first() else {
        return Vec::new();
    };
    let modes = modes.borrow();
    let number = |named: &Named| (0..).map(DagId).nth(place(drafts, named)?);
    let dags = |mode: &ModeDraft| mode.dags.iter().filter_map(number).collect();
    modes.0.iter().map(dags).collect()
}

/// Returns the place of a DAG in the commit.
fn place(drafts: &Drafts, named: &Named) -> Option<usize> {
    let is_it = |draft: &Rc<RefCell<Draft>>| core::ptr::eq(Rc::as_ptr(draft), named.draft.as_ptr());
    drafts.iter().position(is_it)
}

/// Returns all that is wrong with the modes of a commit.
pub(crate) fn check(drafts: &Drafts) -> Vec<ModeFault> {
    let mut faults = Vec::new();
    let mut add = |kind, text| faults.push(ModeFault { kind, text });
    let found = of_commit(drafts);
    if let [first, other, ..] = &found[..] {
        let name = |modes: &Modes| {
            let modes = modes.borrow();
            modes.0.first().map(|mode| mode.name.clone()).unwrap_or_default()
        };
        let text = format!(
            "the commit has modes of two `Modes`, that of mode `{}` and that of mode `{}`; make all \
             modes by one",
            name(first),
            name(other)
        );
        add("several_sets_of_modes", text);
    }
    for modes in &found {
        let modes = modes.borrow();
        for (number, mode) in modes.0.iter().enumerate() {
            let name = &mode.name;
            if mode.dags.is_empty() {
                add("empty_mode", format!("mode `{name}` has no dag; name those that run in it"));
            }
            if modes.0[..number].iter().any(|other| other.name == *name) {
                let text = format!("two modes are called `{name}`; give each a name of its own");
                add("duplicate_mode", text);
            }
            let unknown = mode.dags.iter().filter(|named| place(drafts, named).is_none());
            for named in unknown {
                let of_dag = named.draft.upgrade().map(|draft| draft.borrow().spec.name.clone());
                let text = format!(
                    "mode `{name}` has dag `{}`, which is not in the commit; commit all dags of its \
                     modes in one call",
                    of_dag.unwrap_or_default()
                );
                add("mode_not_committed", text);
            }
        }
    }
    let modes = dags_of_modes(drafts);
    let in_some = |dag: DagId| modes.iter().any(|mode| mode.contains(&dag));
    for (dag, draft) in (0..).map(DagId).zip(drafts) {
        let draft = draft.borrow();
        let name = &draft.spec.name;
        if draft.starts_paused && in_some(dag) {
            let text = format!(
                "dag `{name}` starts paused and is in a mode, and the first mode says what is paused \
                 at the start; drop `starts_paused`"
            );
            add("mode_starts_paused", text);
        }
        let switched = |target| {
            let is_it = |other: &Rc<RefCell<Draft>>| {
                let other = other.borrow();
                other.target.as_ref().is_some_and(|own| alloc::sync::Arc::ptr_eq(own, target))
            };
            drafts.iter().position(is_it)
        };
        for (subtask, target) in &draft.switches {
            if let Some(other) = switched(target)
                && in_some(DagId(u32::try_from(other).unwrap_or(u32::MAX)))
            {
                let text = format!(
                    "{} of dag `{name}` may pause dag `{}`, which is in a mode; let it enter a mode \
                     instead",
                    draft.label(*subtask),
                    drafts[other].borrow().spec.name
                );
                add("mode_switched", text);
            }
        }
        // What brings about a safe state runs wherever the DAG does that may need it.
        let handler = draft.on_fault.as_ref().and_then(switched);
        if let Some(handler) = handler {
            let id = DagId(u32::try_from(handler).unwrap_or(u32::MAX));
            let is_off = |mode: &&(usize, &Vec<DagId>)| {
                (mode.1.contains(&dag) || !in_some(dag)) && !mode.1.contains(&id)
            };
            let numbered: Vec<(usize, &Vec<DagId>)> = modes.iter().enumerate().collect();
            if in_some(id) && let Some((number, _)) = numbered.iter().find(is_off) {
                let text = format!(
                    "a fault of dag `{name}` releases dag `{}`, which is off in mode `{}`; add it to \
                     that mode, or to none",
                    drafts[handler].borrow().spec.name,
                    found[0].borrow().0[*number].name
                );
                add("mode_without_handler", text);
            }
        }
    }
    faults
}
