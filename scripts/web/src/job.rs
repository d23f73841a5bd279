//! A job's recorded values.
//!
//! Each value is given with the subtask that took or gave the value; a sampled value also with the
//! job of its origin.

use recording::{CommittedDag, Decoder, Entry, EntryKind, Recordable, Recording, Role, Shown};
use sched_dag::{DagId, SubtaskId};
use views::json::Object;

use crate::opened::OpenedRecords;
use crate::request::{Faults, Request};
use crate::tables::framed;

/// Answers with the values taken and given by the subtasks of a job.
pub(crate) fn job(opened: &OpenedRecords<'_>, request: &Request<'_>) -> Result<Vec<u8>, Faults> {
    let run = opened.run(request)?;
    let wanted = request.number("dag", 0..=u32::MAX, 0)?;
    let job = request.number("job", 0..=u64::MAX, 0)?;
    let found = opened.commits(run).find_map(|(bytes, commit, dags)| {
        let own = wanted.checked_sub(dags.start)?;
        let dag = commit.told.dags.get(DagId(own).index())?;
        Some((bytes, &commit.told.dags, dag, own))
    });
    let count = run.task_set.dags().len();
    let absent = || format!("dag: there is no dag {wanted} in it; there are {count}, from 0 on");
    let (bytes, dags, dag, own) = found.ok_or_else(absent)?;
    let recording = Recording::read(bytes).map_err(|malformed| malformed.to_string())?;
    let mut values = Vec::new();
    for entry in recording.entries() {
        if (u32::from(entry.dag), entry.job) == (own, job) {
            add(&entry, &recording, dag, dags, &mut values);
        }
    }
    // Each subtask took before it gave.
    values.sort_by_key(|(subtask, gives, _)| (*subtask, *gives));
    let values = values.into_iter().map(|(.., value)| value);
    let head = Object::new().list("values", values);
    Ok(framed(&head.into_text(), &[]))
}

/// Adds a value, once for each subtask that took or gave the value.
fn add(
    entry: &Entry<'_>,
    recording: &Recording<'_>,
    dag: &CommittedDag,
    dags: &[CommittedDag],
    values: &mut Vec<(u32, bool, String)>,
) {
    let (place, bytes) = (usize::from(entry.place), entry.value);
    let channel = match entry.what {
        EntryKind::Value | EntryKind::Lost => recording.header().channels.get(place),
        EntryKind::Clock => None,
        _ => return,
    };
    let clock = Vec::<u64>::schema();
    let (topic, schema) = channel.map_or(("the time", &clock), |it| (&it.topic, &it.schema));
    let text = match entry.what {
        EntryKind::Lost => "lost: there was no room for it".into(),
        _ => Shown { schema, bytes }.to_string(),
    };
    let of_topic = |dag: &&CommittedDag| dag.topics.iter().any(|it| it.name == topic);
    let origin = channel.filter(|it| it.role == Role::Sample).and_then(|_| {
        let (is_there, job) = <(bool, u64)>::decode(&mut Decoder::new(bytes)).ok()?;
        let writer = dags.iter().find(of_topic).filter(|_| is_there)?;
        Some(format!("{} #{job}", writer.name))
    });
    let mut told = |subtask: u32, gives| {
        let name = dag.subtasks.get(SubtaskId(subtask).index());
        let value = Object::new()
            .text("subtask", name.map_or("", |it| &it.name))
            .text("way", if gives { "gave" } else { "took" })
            .text("topic", topic)
            .text("of", origin.as_deref().unwrap_or_default());
        values.push((subtask, gives, value.text("text", &text).into_text()));
    };
    let subtask = u32::from(channel.map_or(entry.place, |it| it.subtask));
    if channel.is_some_and(|it| it.role.is_written()) {
        told(subtask, true);
        let readers = dag.topics.iter().filter(|it| it.name == topic);
        let readers = readers.flat_map(|it| &it.readers);
        readers.for_each(|reader| told(*reader, false));
    } else {
        told(subtask, false);
    }
}
