//! Whether what a DAG records suffices for a replay, which calls no recorded source.

use alloc::format;
use alloc::rc::Rc;
use alloc::vec::Vec;
use core::ptr;

use sched_dag::DagId;

use super::Draft;
use super::flaw::WordedFault;
use super::modes::{Drafts, label};
use crate::run::latest::AnyLatest;

/// Reports what the DAGs of a commit do not record that a replay would need: of each DAG a source
/// of which is recorded, all else that its sources write, and what its other subtasks sample.
pub(crate) fn check(drafts: &Drafts, report: &mut dyn FnMut(WordedFault)) {
    let mut add = |code, text| report(WordedFault { code, text });
    for (id, draft) in (0..).map(DagId).zip(drafts) {
        let draft = draft.borrow();
        let dag = label(drafts, id);
        let is_source = |subtask: usize| draft.spec.subtasks[subtask].inputs.is_empty();
        let sources = (0..draft.spec.subtasks.len()).filter(|subtask| is_source(*subtask));
        let written = sources.flat_map(|subtask| {
            let outputs = draft.spec.subtasks[subtask].outputs.iter();
            outputs.map(move |port| (subtask, &*port.topic))
        });
        let (recorded, others): (Vec<_>, Vec<_>) =
            written.partition(|(_, topic)| records(&draft, topic));
        let Some((_, first)) = recorded.first() else {
            continue;
        };
        for (subtask, topic) in others {
            let subtask = draft.label(subtask);
            let text = format!(
                "{subtask} of {dag} writes topic `{topic}`, which is not recorded, and a replay \
                 would not call it, for topic `{first}` of a source is; record all topics of the \
                 sources, or none"
            );
            add("source_partly_recorded", text);
        }
        let samples = draft.samples.iter();
        for (subtask, latest, _) in samples.filter(|(subtask, ..)| !is_source(*subtask)) {
            let (subtask, topic) = (draft.label(*subtask), latest.topic());
            let offers = |other: &Draft| other.latest.iter().any(|own| is_same(own, latest));
            let mut others = drafts.iter().map(|other| other.borrow());
            if others.any(|other| offers(&other) && !records(&other, topic)) {
                let text = format!(
                    "{subtask} of {dag} samples topic `{topic}`, which is not recorded, and a \
                     replay could not give it the same, though topic `{first}` of a source is; \
                     record both, or neither"
                );
                add("sample_not_recorded", text);
            }
        }
    }
}

fn records(draft: &Draft, topic: &str) -> bool {
    let mut recorded = draft.recorded.iter();
    recorded.any(|recorded| recorded.topic() == topic)
}

fn is_same(one: &Rc<dyn AnyLatest>, other: &Rc<dyn AnyLatest>) -> bool {
    ptr::addr_eq(Rc::as_ptr(one), Rc::as_ptr(other))
}
