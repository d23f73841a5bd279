//! A run in the form drawn by the page: a head in JSON, and columns of slices and jobs.
//!
//! A *slice* is a stretch of execution on one core. Slices are ordered by core and time, jobs by
//! DAG and number, so the page finds the slices and jobs of an interval by halving. Times are
//! nanoseconds from the begin of the run.

use std::collections::{BTreeMap, BTreeSet};

use recording::{EntryKind, Recording};
use sched_dag::law::{self, Distribution};
use sched_dag::{Dag, DagId, Instance, Preemption, SubtaskId};
use views::chains::{self, MeasuredChain};
use views::json::{Object, quoted};
use views::planned::{self, PlannedEntry};
use views::record::CommittedDags;
use views::view::{ExecutionSlice, View};
use views::{links, marks, notes, picture};

use crate::opened::OpenedRecords;
use crate::request::{Faults, Request};
use crate::tables::TypedColumns;

/// The most breaches in an answer; all breaches are counted.
const MOST_BREACHES: usize = 100;

/// The most marks in an answer.
const MOST_MARKS: usize = 10_000;

/// Answers a request for the whole picture of a run.
pub(crate) fn picture(
    opened: &OpenedRecords<'_>,
    request: &Request<'_>,
) -> Result<Vec<u8>, Faults> {
    let run = opened.run(request)?;
    let (view, options) = (View::new(run), run.options);
    let mut columns = TypedColumns::default();
    let firsts = slices(&view, &mut columns);
    jobs(&view, opened, &mut columns);
    plan(&view, &mut columns);
    let is_preemptive = options.preemption == Preemption::Enabled;
    let commits = opened.commits(run);
    let clusters = commits.flat_map(|(_, commit, _)| &commit.told.clusters);
    let mut warnings = opened.warnings.clone().unwrap_or_default();
    if !run.complete && request.text("live") != Some("yes") {
        warnings.push("the record ends before its run; what is not there is not judged".into());
    }
    let marks = marks(&view, &mut warnings);
    let cores = run.cores().into_iter().flat_map(|(name, cores)| {
        let own = 0..cores.end - cores.start;
        own.map(move |core| quoted(&format!("{name}core {core}")))
    });
    let head = Object::new()
        .number("runs", opened.records[0].1.runs.len() as u64)
        .number("run", run.number)
        .number("cores", options.cores)
        .text("policy", options.policy.word())
        .text("preemption", if is_preemptive { "on" } else { "off" })
        .number("events", run.events.len() as u64)
        .number("lost", run.lost)
        .number("end_ns", view.end_ns)
        .list("warnings", all_quoted(warnings))
        .list("marks", marks)
        .list("clusters", clusters)
        .list("colours", picture::COLOURS.map(quoted))
        .list("core_names", cores)
        .list("first_of_core", firsts)
        .list("dags", dags(&view, opened))
        .text("graph", &picture::graphs(&view));
    // Judging takes more than half of the time, so the page asks for it once the picture is there.
    let is_judged = request.choice("judge", &[("yes", true), ("no", false)])?;
    let tolerance_ns = match opened.warnings {
        Some(_) => 0,
        None => run.usual_bound_ns,
    };
    let by_rules = (is_judged && run.machines.is_empty()).to_string();
    let head = head.json("is_judged", &by_rules);
    let head = head.number("tolerance_ns", tolerance_ns);
    Ok(columns.under(match is_judged {
        true => judged(head, &view, tolerance_ns),
        false => head,
    }))
}

/// Adds the breaches of the rules, as `check-trace` does, and the times of chains and links.
fn judged(head: Object, view: &View<'_>, tolerance_ns: u64) -> Object {
    let (run, terms) = (view.run, view.run.terms(tolerance_ns));
    let (mut breaches, mut told) = (Vec::new(), String::new());
    // Each machine of several is judged alone, by its own clock.
    if run.machines.is_empty() {
        breaches = law::violations(&run.task_set, terms, view.in_the_order_of_the_log());
        let by_time = view.events.iter().copied();
        let dispatch = law::dispatch_violations(&run.task_set, &run.options, terms, by_time);
        breaches.extend(dispatch);
        breaches.sort_by_key(|breach| (breach.time_ns(), breach.rule()));
    } else {
        told = links::told("records", run).0;
    }
    let chains = match &chains::of(run, None)[..] {
        [] => Vec::new(),
        chains => chains::measured(view, chains),
    };
    let first = breaches.iter().take(MOST_BREACHES).map(|breach| {
        let text = breach.with_names(&run.task_set).to_string();
        let object = Object::new().number("ns", breach.time_ns());
        object.text("what", &text).into_text()
    });
    head.number("breach_count", breaches.len() as u64)
        .list("breaches", first)
        .list("chains", chains.iter().map(chain))
        .list("links", told.lines().skip(1).map(quoted))
}

fn chain(of: &MeasuredChain) -> String {
    let mut object = Object::new().list("names", of.names.iter().map(|name| quoted(name)));
    let kinds = ["output_age", "data_age", "reaction"];
    for (kind, (times, bound_ns)) in kinds.into_iter().zip(&of.times) {
        let time = Object::new()
            .number("max_ns", times.max())
            .number("median_ns", times.median())
            .json("bound_ns", &or_null(bound_ns.ok()));
        object = object.json(kind, &time.into_text());
    }
    object.into_text()
}

fn all_quoted(texts: Vec<String>) -> impl Iterator<Item = String> {
    texts.into_iter().map(|text| quoted(&text))
}

fn or_null(number: Option<u64>) -> String {
    number.map_or("null".into(), |number| number.to_string())
}

/// Returns the DAGs with their bounds and their observed times.
fn dags(view: &View<'_>, opened: &OpenedRecords<'_>) -> Vec<String> {
    let told = opened.commits(view.run).flat_map(|(_, commit, _)| {
        let own = (0..).map(DagId).zip(&commit.told.dags);
        own.map(move |(dag, _)| (commit, dag))
    });
    let models = (0..).map(DagId).zip(view.run.task_set.dags());
    let all = models.zip(told);
    all.map(|(model, told)| dag(view, model, told)).collect()
}

fn dag(view: &View<'_>, (id, model): (DagId, &Dag), told: (&CommittedDags, DagId)) -> String {
    let jobs = || view.jobs.range((id, 0)..=(id, u64::MAX));
    let responses = Distribution::new(jobs().filter_map(|(&(_, job), history)| {
        let release_ns = view.release_ns(id, job);
        Some(history.completed_ns?.saturating_sub(release_ns))
    }));
    let misses = jobs().filter(|(_, job)| job.missed_ns.is_some()).count();
    let subtasks = (0..).map(SubtaskId).zip(model.subtasks());
    let subtasks = subtasks.map(|(id, subtask)| {
        Object::new()
            .text("name", subtask.name())
            .list("next", model.successors(id).iter().map(|next| next.0))
            .list("notes", all_quoted(notes::of_subtask(told.0, told.1, id)))
            .into_text()
    });
    let bound_ns = view.run.bounds_ns.get(id.index()).copied().flatten();
    // By the words of the commit, which older records lack.
    let answer = told.0.told.answers.get(told.1.index());
    let behind = |mark| answer.and_then(|answer| answer.split_once(mark));
    let (test, why) = match (bound_ns, behind(", by "), behind(": ")) {
        (Some(_), Some((_, test)), _) => (test.split(';').next().unwrap_or(test), ""),
        (None, _, Some((_, why))) => ("", why),
        _ => ("", ""),
    };
    Object::new()
        .text("name", model.name())
        .number("period_ns", model.period_ns())
        .number("deadline_ns", model.relative_deadline_ns())
        .json("is_sporadic", &model.is_sporadic().to_string())
        .json("bound_ns", &or_null(bound_ns))
        .text("test", test)
        .text("why", why)
        .number("jobs", jobs().count() as u64)
        .number("completed", responses.count())
        .number("misses", misses as u64)
        .number("min_ns", responses.min())
        .number("median_ns", responses.median())
        .number("p99_ns", responses.p99())
        .number("max_ns", responses.max())
        .list("subtasks", subtasks)
        .list("notes", all_quoted(notes::of_dag(told.0, told.1)))
        .into_text()
}

/// Returns the first moments of the run besides executions.
fn marks(view: &View<'_>, warnings: &mut Vec<String>) -> Vec<String> {
    let mut all = marks::of(view);
    let told = all.by_ref().take(MOST_MARKS).map(|mark| {
        let dag = or_null(mark.dag.map(|dag| dag.0.into()));
        let object = Object::new().number("ns", mark.time_ns).json("dag", &dag);
        let object = object.text("kind", mark.kind).text("what", &mark.text);
        object.into_text()
    });
    let told = told.collect();
    let more = all.count();
    if more > 0 {
        warnings.push(format!(
            "{more} more faults, skipped jobs and the like are not shown"
        ));
    }
    told
}

/// Adds the entries of tables.
fn plan(view: &View<'_>, columns: &mut TypedColumns) {
    let all = planned::entries(view);
    let late = planned::first_late(view).map(|late| late.instance);
    let before = first_subtasks(view);
    let each = || all.iter();
    columns.times("plan_from", each().map(|of| Some(of.from_ns)));
    columns.times("plan_to", each().map(|of| Some(of.to_ns)));
    let subtask = |of: Instance| before[of.dag.index()] + u64::from(of.subtask.0);
    columns.numbers("plan_subtask", each().map(|of| subtask(of.instance)));
    columns.numbers("plan_core", each().map(|of| of.core.0.into()));
    let is_late = |of: &PlannedEntry| u8::from(late == Some(of.instance));
    columns.bytes("plan_late", each().map(is_late));
}

/// Returns the number of subtasks in the DAGs before each DAG.
fn first_subtasks(view: &View<'_>) -> Vec<u64> {
    let mut before = vec![0];
    for dag in view.run.task_set.dags() {
        before.push(before[before.len() - 1] + dag.subtasks().len() as u64);
    }
    before
}

/// Adds the slices; returns the begin of each core's slices, and the end of the last.
fn slices(view: &View<'_>, columns: &mut TypedColumns) -> Vec<usize> {
    let before = first_subtasks(view);
    let mut all = Vec::new();
    for (&instance, history) in &view.histories {
        let slices = history.slices.iter().enumerate();
        all.extend(slices.map(|(number, slice)| (*slice, instance, history, number)));
    }
    let to_ns = |slice: ExecutionSlice| slice.to_ns.unwrap_or(view.end_ns);
    all.sort_unstable_by_key(|it| (it.0.core, it.0.from_ns, to_ns(it.0), it.1));
    let each = || all.iter();
    columns.times("from", each().map(|it| Some(it.0.from_ns)));
    columns.times("to", each().map(|it| Some(to_ns(it.0))));
    let ready = each().map(|it| it.2.ready_ns.filter(|_| it.3 == 0));
    columns.times("ready", ready);
    columns.times("woken", each().map(|it| it.2.wait_after(it.0)?.1));
    let subtask = |of: Instance| before[of.dag.index()] + u64::from(of.subtask.0);
    columns.numbers("subtask", each().map(|it| subtask(it.1)));
    columns.numbers("job", each().map(|it| it.1.job));
    columns.bytes("end", each().map(|it| it.2.end_of(it.3) as u8));
    // The messages between machines: from the last slice of each writer to the reader's first.
    let mut ends = BTreeMap::<Instance, [u64; 2]>::new();
    if !view.run.links.is_empty() {
        for (place, (_, instance, _, number)) in (0..).zip(&all) {
            ends.entry(*instance).or_insert([place; 2])[usize::from(*number > 0)] = place;
        }
    }
    let hop = |of: (Instance, Instance)| Some((ends.get(&of.0)?[1], ends.get(&of.1)?[0]));
    let hops: Vec<(u64, u64)> = links::messages(view.run, true).filter_map(hop).collect();
    columns.numbers("hop_from", hops.iter().map(|hop| hop.0));
    columns.numbers("hop_to", hops.iter().map(|hop| hop.1));
    let first = |core| all.partition_point(|it| it.0.core.0 < core);
    (0..=view.run.options.cores).map(first).collect()
}

/// Adds the jobs.
fn jobs(view: &View<'_>, opened: &OpenedRecords<'_>, columns: &mut TypedColumns) {
    let mut valued = BTreeSet::new();
    for (bytes, _, dags) in opened.commits(view.run) {
        let recording = Recording::read(bytes);
        let entries = recording.iter().flat_map(Recording::entries);
        let values = entries.filter(|entry| entry.what == EntryKind::Value);
        valued.extend(values.map(|it| (DagId(dags.start + u32::from(it.dag)), it.job)));
    }
    let all = || view.jobs.iter();
    columns.numbers("job_dag", all().map(|(of, _)| of.0.0.into()));
    columns.numbers("job_number", all().map(|(of, _)| of.1));
    let releases = all().map(|(of, _)| Some(view.release_ns(of.0, of.1)));
    columns.times("job_release", releases);
    let deadlines = all().map(|(of, _)| Some(view.deadline_ns(of.0, of.1)));
    columns.times("job_deadline", deadlines);
    columns.times("job_end", all().map(|(_, job)| job.completed_ns));
    let flags = all().map(|(of, job)| {
        u8::from(job.missed_ns.is_some())
            + 2 * u8::from(job.aborted_ns.is_some())
            + 4 * u8::from(job.released_ns.is_none())
            + 8 * u8::from(valued.contains(of))
    });
    columns.bytes("job_flags", flags);
}
