//! Traces of runs as pictures: JSON for Perfetto's viewer.
//!
//! The format is the Trace Event Format of Chrome's tracing, which
//! <https://ui.perfetto.dev>, `chrome://tracing` and speedscope read. In its
//! words: a *process* is a group of *tracks* (it calls them threads); a *slice*
//! is a stretch of time on a track, an *instant* a moment, a *flow* an arrow from
//! one slice to another. For each run there are
//!
//! - a group `cores` with a track for each core: a slice is one uninterrupted
//!   piece of an instance's execution, an instant a preemption, or the request
//!   for one;
//! - a group for each DAG: its releases, deadlines and misses as instants, a slice for each job
//!   from its nominal release to its completion, and for each subtask the slices of its instances
//!   from readiness to their end, with their executions and waits inside;
//! - if the trace breaks a rule, a group `breaches` with an instant for each breach.
//!
//! Flows lead along each edge of the graph from an instance's finish to the start of its successor
//! in the same job, and from an instance's finish to the start of each one that samples its value.
//! Each flow is drawn twice, between cores and between subtasks, under two numbers. In a joint run
//! of several machines each has its own cores, and a flow leads from the sender of a message to its
//! receiver; breaches are left out.
//!
//! Slices of one track always nest, and each flow has both its ends. Each time is the trace's, in
//! microseconds with three decimals. All runs begin at 0, side by side. Where events were lost,
//! only the part after the last gap is shown.
//!
//! Jobs overlap, and slices of one track must not, so jobs lie on as many *lanes*
//! as overlap at most. A subtask needs one track only: by R2 its instance of a job
//! is not ready before the one of the job before has finished.
//!
//! Slices are written as a begin and an end (`B`, `E`) rather than as one event with a duration:
//! viewers round times to numbers of their own, and so two slices that touch at one nanosecond also
//! touch there. Each track's events are written in the order of time, and at equal times in the
//! order in which they were drawn, which viewers keep.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt::Write;
use std::fs;
use std::process::ExitCode;

use fass_dag_file::time::parse_ns;
use sched_dag::chains::SampledJobs;
use sched_dag::journal::EventKind;
use sched_dag::law::Violation;
use sched_dag::{CoreId, Dag, DagId, Instance, SubtaskId};

use super::{JobHistory, Slice, View, links, picture};
use super::{check, read_files};
use crate::files::{self, Named};
use crate::json::{Object, quoted};
use crate::options::{Command, Name, Parsed, Refusal, Takes, options};
use crate::output::briefly;
use crate::record::{Run, tolerance_ns};

/// Converts runs to JSON. `bound_ns` is the tolerance for breaches, as of [`check`].
pub fn convert(runs: &[Run], bound_ns: u64) -> String {
    let (mut output, mut next_flow) = (Output::default(), 0);
    for run in runs {
        let view = View::new(run);
        let breaches = match run.machines[..] {
            [] => check(run, bound_ns).breaches,
            // Each machine is judged alone.
            _ => Vec::new(),
        };
        let prefix = match runs {
            [_] => String::new(),
            _ => format!("run {} ", run.number),
        };
        let mut flows = Flows::new(&view, next_flow);
        draw_cores(&view, &prefix, &flows, &mut output);
        draw_dags(&view, &prefix, &mut flows, &mut output);
        draw_breaches(run, &breaches, &prefix, &mut output);
        next_flow = flows.next();
    }
    output.into_text()
}

fn draw_breaches(run: &Run, breaches: &[Violation], prefix: &str, output: &mut Output) {
    if breaches.is_empty() {
        return;
    }
    let group = output.group(&format!("{prefix}breaches"), "");
    let mut track = output.track(group, "rules");
    for breach in breaches {
        let what = breach.with_names(&run.task_set).to_string();
        let args = Object::new().text("what", &what).into_text();
        track.instant(breach.time_ns(), &breach.rule().to_string(), &args);
    }
    output.add(track);
}

/// The name of an instance on a track that shows all DAGs.
fn instance_name(run: &Run, instance: Instance) -> String {
    let Instance { dag, job, subtask } = instance;
    let model = run.task_set.dag(dag);
    let subtask = name_or(model.subtask(subtask).name(), subtask.0);
    format!("{}/{subtask} #{job}", name_or(model.name(), dag.0))
}

fn name_or(name: &str, number: u32) -> String {
    match name {
        "" => number.to_string(),
        name => name.to_string(),
    }
}

/// Returns the arguments that all slices of an instance have.
fn instance_args(instance: Instance) -> Object {
    let Instance { dag, job, subtask } = instance;
    Object::new()
        .number("dag", dag.0)
        .number("job", job)
        .number("subtask", subtask.0)
}

/// Draws a piece of an instance's execution, with the arrows into its start and out of its finish.
fn draw_piece(
    view: &View<'_>,
    (instance, piece): Piece,
    (name, args): (&str, &str),
    flows: &Flows,
    track: &mut TrackWriter,
) {
    let history = &view.histories[&instance];
    let slice = history.slices[piece];
    track.begin_slice(slice.from_ns, name, args);
    // A first piece without a start continues one before the trace: no arrow leads into it.
    if piece == 0 && history.start_ns.is_some() {
        flows.into(instance).for_each(|flow| track.flow_in(flow));
    }
    let to_ns = slice.to_ns.unwrap_or(view.end_ns);
    track.advance(to_ns);
    // An instance that was ended by a fault hands nothing on.
    if piece + 1 == history.slices.len() && history.finish_ns.is_some() {
        flows.out(instance).for_each(|flow| track.flow_out(flow));
    }
    track.end_slice(to_ns);
}

/// The table of `trace`.
pub static TRACE: Command = Command {
    invocation: "./scripts/trace",
    about: "Draws the traces of runs: for Perfetto's viewer, or as one picture.",
    positional: Some((
        Takes::File("FILE..."),
        "A record of runs, as `./scripts/run --trace FILE` and --keep write it, or a serial log; or \
         records of machines that send each other messages.",
    )),
    options: OPTIONS,
    notes: "\
Open the file at https://ui.perfetto.dev (it stays on your machine), in Chromium at
chrome://tracing, or at https://www.speedscope.app. docs/watching.md explains the picture.

exit codes: 0 all is well; 1 the output cannot be written; 2 a refused command
line, or a file without a well-formed trace with events
",
};

options! {
    /// Write to this file; else to standard output.
    OUT 'o': Takes::File("FILE");
    /// Draw one run as an SVG instead: its DAGs above their schedule, with bounds and deadlines.
    SVG: Takes::Nothing;
    /// How many times the longest period the picture shows.
    PERIODS: Takes::Number(1, 1000), or "1";
    /// The picture begins at this time of the run, such as 20ms; else at 0, or where
    /// machines first hear of each other.
    FROM: Takes::Text("TIME");
    /// It shows the jobs that are released before this time, whatever --periods says.
    UNTIL: Takes::Text("TIME");
    /// Only the run of this number; else all of them, side by side from time 0.
    RUN: Takes::Number(0, u64::MAX);
    /// As for ./scripts/check-trace, whose breaches are shown as markers.
    BOUND_US: Takes::Number(0, 1_000_000_000);
}

/// Runs the subcommand with the words after its name.
pub fn trace(words: &[OsString]) -> ExitCode {
    TRACE.carry_out(words, |options| {
        let text = draw(options).map_err(Refusal::Usage)?;
        match options.path(name::OUT) {
            None => print!("{text}"),
            Some(out) => {
                let place = files::shown_path(out);
                fs::write(out, text).map_err(|error| format!("cannot write {place}: {error}"))?;
                let by = match options.is_given(name::SVG) {
                    true => "in a browser",
                    false => "at https://ui.perfetto.dev",
                };
                eprintln!("{place}: open it {by}");
            }
        }
        Ok(ExitCode::SUCCESS)
    })
}

/// Converts the runs that the options name.
fn draw(options: &Parsed) -> Result<String, String> {
    options.file("which file? name a record of a run")?;
    let inputs = options.files().map(|path| Named { option: "", path });
    files::check(&inputs.collect::<Vec<_>>(), &options.named(&[name::OUT]))?;
    let mut records = read_files(options)?;
    let joint = links::join(&records)?;
    let (file, first) = records.swap_remove(0);
    let mut runs = match joint {
        Some(run) => vec![run],
        None if records.is_empty() => first.runs,
        None => return Err("no messages connect these records; draw each alone".into()),
    };
    if let Some(number) = options.number(name::RUN) {
        let there: Vec<String> = runs.iter().map(|run| run.number.to_string()).collect();
        runs.retain(|run| run.number == number);
        if runs.is_empty() {
            let there = there.join(", ");
            return Err(format!(
                "`--run {number}`: {file} has no such run; its runs are {there}"
            ));
        }
    }
    if options.is_given(name::SVG) {
        // Without `--run` the first one: a picture has one axis of time.
        let run = runs.first().ok_or("the file has no run")?;
        let time = |name: Name| {
            let time = options.text(name).map(parse_ns).transpose();
            time.map_err(|why| format!("`--{name}`: {why}"))
        };
        let view = View::new(run);
        let sent = links::messages(run, true);
        let sent_ns = sent.filter_map(|(of, _)| view.jobs.get(&(of.dag, of.job))?.released_ns);
        let from_ns = time(name::FROM)?.or(sent_ns.min()).unwrap_or(0);
        let periods = run.task_set.dags().iter().map(Dag::period_ns);
        let longest_ns = periods.max().unwrap_or(0);
        let span_ns = longest_ns.saturating_mul(options.number(name::PERIODS).unwrap_or(1));
        let until_ns = time(name::UNTIL)?.unwrap_or(from_ns.saturating_add(span_ns));
        return picture::draw(run, from_ns..until_ns.max(from_ns));
    }
    // All runs of a file come from one boot, so one bound holds for all.
    let bound_ns = runs
        .first()
        .map_or(0, |run| tolerance_ns(run, options.number(name::BOUND_US)));
    Ok(convert(&runs, bound_ns))
}

/// A stretch of an instance's execution: its number within the instance, from 0.
type Piece = (Instance, usize);

/// Draws the cores of a run.
fn draw_cores(view: &View<'_>, prefix: &str, flows: &Flows, output: &mut Output) {
    let pieces = pieces(view);
    for (machine, cores) in view.run.cores() {
        let group = output.group(&format!("{prefix}{machine}cores"), "");
        for core in cores.clone().map(CoreId) {
            let mut track = output.track(group, &format!("core {}", core.0 - cores.start));
            for &(slice, piece) in pieces.iter().filter(|(slice, _)| slice.core == core) {
                draw_one(view, slice, piece, flows, &mut track);
            }
            draw_preemptions(view, core, &mut track);
            output.add(track);
        }
    }
}

/// Returns all stretches of execution in the order of time.
fn pieces(view: &View<'_>) -> Vec<(Slice, Piece)> {
    let mut pieces = Vec::new();
    for (&instance, history) in &view.histories {
        let slices = history.slices.iter().zip(0..);
        pieces.extend(slices.map(|(&slice, number)| (slice, (instance, number))));
    }
    pieces.sort_by_key(|(slice, _)| (slice.from_ns, slice.to_ns.unwrap_or(u64::MAX)));
    pieces
}

fn draw_one(
    view: &View<'_>,
    slice: Slice,
    (instance, number): Piece,
    flows: &Flows,
    track: &mut TrackWriter,
) {
    let history = &view.histories[&instance];
    let is_last = number + 1 == history.slices.len();
    let begins = if number > 0 {
        "resume"
    } else if history.start_ns.is_some() {
        "start"
    } else {
        "before the trace"
    };
    let ends = match slice.to_ns {
        None => "after the trace",
        Some(_) if history.wait_after(slice).is_some() => "wait",
        Some(_) if !is_last => "suspend",
        Some(_) if history.finish_ns.is_some() => "finish",
        Some(_) if history.dropped_ns.is_some() => "fault",
        // The instance was suspended, and has not resumed when the trace ends.
        Some(_) => "suspend",
    };
    let args = instance_args(instance)
        .number("piece", number as u64 + 1)
        .text("begins", begins)
        .text("ends", ends);
    let name = instance_name(view.run, instance);
    draw_piece(
        view,
        (instance, number),
        (&name, &args.into_text()),
        flows,
        track,
    );
}

fn draw_preemptions(view: &View<'_>, core: CoreId, track: &mut TrackWriter) {
    for event in &view.events {
        let what = match event.what {
            EventKind::Request => "preempt for",
            EventKind::Suspend => "preempted",
            EventKind::Ended => "fault in",
            EventKind::Restarted => "goes on without",
            _ => continue,
        };
        if let Some(instance) = event.instance()
            && event.core == core
        {
            let name = format!("{what} {}", instance_name(view.run, instance));
            track.instant(event.time_ns, &name, &instance_args(instance).into_text());
        }
    }
}

/// Draws all DAGs of a run.
fn draw_dags(view: &View<'_>, prefix: &str, flows: &mut Flows, output: &mut Output) {
    flows.draw_again();
    for (dag, model) in (0..).map(DagId).zip(view.run.task_set.dags()) {
        let label = format!(
            "{}T = {}, D = {}",
            if model.is_sporadic() {
                "sporadic, "
            } else {
                ""
            },
            briefly(model.period_ns()),
            briefly(model.relative_deadline_ns())
        );
        let name = format!("{prefix}dag {}", name_or(model.name(), dag.0));
        let group = output.group(&name, &label);
        draw_moments(view, dag, group, output);
        draw_jobs(view, dag, group, output);
        for (subtask, of) in (0..).map(SubtaskId).zip(model.subtasks()) {
            let mut track = output.track(group, &name_or(of.name(), subtask.0));
            draw_subtask(view, dag, subtask, flows, &mut track);
            output.add(track);
        }
    }
}

/// Draws the events of jobs, and their deadlines, as instants.
fn draw_moments(view: &View<'_>, dag: DagId, group: Group, output: &mut Output) {
    let mut track = output.track(group, "releases, deadlines");
    let args = |job: u64| Object::new().number("job", job).into_text();
    for event in view.events.iter().filter(|event| event.dag == dag) {
        let what = match event.what {
            EventKind::Released => "release",
            EventKind::Queued => "release waits",
            EventKind::Skipped => "skip",
            EventKind::Aborted => "abort",
            EventKind::Missed => "MISS",
            EventKind::Signalled => "signal for",
            EventKind::Dropped => "signal dropped,",
            _ => continue,
        };
        let name = format!("{what} #{}", event.job);
        track.instant(event.time_ns, &name, &args(event.job));
    }
    // Of all jobs, also those whose deadline is no event of the trace.
    for (&(_, job), history) in jobs_of(view, dag) {
        let deadline_ns = view.deadline_ns(dag, job);
        // A deadline after the trace would only make the picture longer.
        if history.released_ns.is_some() && deadline_ns <= view.end_ns {
            track.instant(deadline_ns, &format!("deadline #{job}"), &args(job));
        }
    }
    output.add(track);
}

/// Draws each job from its nominal release to its completion.
fn draw_jobs(view: &View<'_>, dag: DagId, group: Group, output: &mut Output) {
    let mut lanes: Vec<TrackWriter> = Vec::new();
    let mut busy_until_ns: Vec<u64> = Vec::new();
    for (&(_, job), history) in jobs_of(view, dag) {
        // Such as a skipped job, which has no duration.
        if history.released_ns.is_none() && history.completed_ns.is_none() {
            continue;
        }
        let nominal_ns = view.release_ns(dag, job);
        let end_ns = history.completed_ns;
        let to_ns = end_ns.unwrap_or(view.end_ns).max(nominal_ns);
        // A lane that is free again is used before a new one is opened.
        let is_free = |until_ns: &u64| *until_ns <= nominal_ns;
        let lane = busy_until_ns.iter().position(is_free);
        let lane = lane.unwrap_or_else(|| {
            lanes.push(output.track(group, &format!("jobs, lane {}", lanes.len() + 1)));
            busy_until_ns.push(0);
            lanes.len() - 1
        });
        busy_until_ns[lane] = to_ns;
        let name = format!("job #{job}{}", what_became_of(history));
        let args = job_args(view, dag, job, history);
        lanes[lane].begin_slice(nominal_ns, &name, &args);
        lanes[lane].end_slice(to_ns);
    }
    lanes.into_iter().for_each(|lane| output.add(lane));
}

fn what_became_of(history: &JobHistory) -> &'static str {
    match history {
        job if job.aborted_ns.is_some() => ", aborted",
        job if job.missed_ns.is_some() => ", missed",
        job if job.completed_ns.is_none() => ", not completed",
        _ => "",
    }
}

fn job_args(view: &View<'_>, dag: DagId, job: u64, history: &JobHistory) -> String {
    let release_ns = view.release_ns(dag, job);
    let mut args = Object::new()
        .number("job", job)
        .number("release_ns", release_ns)
        .number("deadline_ns", view.deadline_ns(dag, job));
    if let Some(released_ns) = history.released_ns {
        args = args.number("released_ns", released_ns);
    }
    if let Some(completed_ns) = history.completed_ns {
        let response_ns = completed_ns.saturating_sub(release_ns);
        args = args.number("response_time_ns", response_ns);
    }
    args.into_text()
}

/// Draws a subtask's instances from readiness to their end.
fn draw_subtask(
    view: &View<'_>,
    dag: DagId,
    subtask: SubtaskId,
    flows: &Flows,
    track: &mut TrackWriter,
) {
    let of_dag = Instance {
        dag,
        job: 0,
        subtask: SubtaskId(0),
    }..=Instance {
        dag,
        job: u64::MAX,
        subtask: SubtaskId(u32::MAX),
    };
    let instances = view.histories.range(of_dag);
    for (&instance, history) in instances.filter(|(instance, _)| instance.subtask == subtask) {
        let first = history.slices.first();
        let Some(begin_ns) = history.ready_ns.or(first.map(|slice| slice.from_ns)) else {
            continue;
        };
        let over_ns = history.over_ns();
        let was_cancelled = over_ns.is_some() && first.is_none();
        let name = match was_cancelled {
            true => format!("#{}, cancelled", instance.job),
            false => format!("#{}", instance.job),
        };
        if let Some(ready_ns) = history.ready_ns {
            let name = format!("ready #{}", instance.job);
            track.instant(ready_ns, &name, &instance_args(instance).into_text());
        }
        let args = instance_args(instance).number("suspensions", history.suspensions);
        track.begin_slice(begin_ns, &name, &args.into_text());
        for (index, slice) in history.slices.iter().enumerate() {
            let args = Object::new().number("core", slice.core.0).into_text();
            let name = format!("on core {}", slice.core.0);
            draw_piece(view, (instance, index), (&name, &args), flows, track);
            if let Some((from_ns, to_ns)) = history.wait_after(*slice) {
                track.begin_slice(from_ns, "waits", "{}");
                track.end_slice(to_ns.unwrap_or(view.end_ns));
            }
        }
        track.end_slice(over_ns.unwrap_or(view.end_ns));
    }
}

fn jobs_of<'v>(
    view: &'v View<'_>,
    dag: DagId,
) -> impl Iterator<Item = (&'v (DagId, u64), &'v JobHistory)> {
    view.jobs.range((dag, 0)..=(dag, u64::MAX))
}

/// An arrow in one of its two drawings.
#[derive(Clone, Copy, Debug)]
struct Flow {
    number: u64,
    /// Its name and category.
    kind: (&'static str, &'static str),
}

/// The arrows of a run.
struct Flows {
    /// For each instance, the arrows that leave it.
    out: BTreeMap<Instance, Vec<Flow>>,
    /// For each instance, the arrows that lead to it.
    into: BTreeMap<Instance, Vec<Flow>>,
    count: u64,
    first: u64,
    /// The offset from the numbers of the first drawing to those of the second.
    shift: u64,
}

impl Flows {
    /// Finds all arrows and numbers them from `first` on.
    fn new(view: &View<'_>, first: u64) -> Flows {
        let mut flows = Flows {
            out: BTreeMap::new(),
            into: BTreeMap::new(),
            count: 0,
            first,
            shift: 0,
        };
        for (&later, history) in &view.histories {
            // An instance that never started has no slice for the arrow's end.
            if history.start_ns.is_none() {
                continue;
            }
            let model = view.run.task_set.dag(later.dag);
            for &subtask in model.predecessors(later.subtask) {
                let earlier = Instance { subtask, ..later };
                let finish = view.histories.get(&earlier).and_then(|it| it.finish_ns);
                if finish.is_some() {
                    flows.add(earlier, later, ("precedes", "precedence"));
                }
            }
        }
        let samplings = &view.run.samplings;
        let sampled = SampledJobs::new(samplings, view.in_the_order_of_the_log());
        for (reader, writer) in sampled.all() {
            flows.add(writer, reader, ("sampled by", "sample"));
        }
        for (writer, reader) in links::messages(view.run, true) {
            let reads = view.histories.get(&reader).and_then(|it| it.start_ns);
            if view.histories.contains_key(&writer) && reads.is_some() {
                flows.add(writer, reader, ("heard by", "message"));
            }
        }
        flows
    }

    fn add(&mut self, from: Instance, to: Instance, kind: (&'static str, &'static str)) {
        let number = self.first + self.count;
        let flow = Flow { number, kind };
        self.out.entry(from).or_default().push(flow);
        self.into.entry(to).or_default().push(flow);
        self.count += 1;
    }

    /// Switches to the second drawing of all arrows.
    fn draw_again(&mut self) {
        self.shift = self.count;
    }

    /// Returns the arrows that leave an instance.
    fn out(&self, instance: Instance) -> impl Iterator<Item = Flow> {
        self.drawn(self.out.get(&instance))
    }

    /// Returns the arrows that lead to an instance.
    fn into(&self, instance: Instance) -> impl Iterator<Item = Flow> {
        self.drawn(self.into.get(&instance))
    }

    /// Returns the first number that no arrow has.
    const fn next(&self) -> u64 {
        // Each arrow has a number in both drawings.
        self.first + 2 * self.count
    }

    fn drawn<'f>(&'f self, of: Option<&'f Vec<Flow>>) -> impl Iterator<Item = Flow> + 'f {
        of.into_iter().flatten().map(|flow| Flow {
            number: flow.number + self.shift,
            ..*flow
        })
    }
}

/// The JSON that is being written.
#[derive(Debug, Default)]
struct Output {
    events: String,
    /// The last number given to a group or a track. No two share one, as viewers mix up a process
    /// and a thread of the same number.
    last_id: u64,
}

/// A group of tracks.
#[derive(Clone, Copy, Debug)]
struct Group(u64);

/// A track that is being drawn.
struct TrackWriter {
    group: Group,
    id: u64,
    drawn: Vec<(u64, String)>,
    /// The time of the latest begin or end.
    latest_ns: u64,
    open: u64,
}

impl Output {
    /// Adds a group below the present ones.
    fn group(&mut self, name: &str, label: &str) -> Group {
        self.last_id += 1;
        let id = self.last_id;
        self.describe("process_name", id, id, Object::new().text("name", name));
        if !label.is_empty() {
            let label = Object::new().text("labels", label);
            self.describe("process_labels", id, id, label);
        }
        let place = Object::new().number("sort_index", id);
        self.describe("process_sort_index", id, id, place);
        Group(id)
    }

    /// Adds a track below those of the group.
    fn track(&mut self, group: Group, name: &str) -> TrackWriter {
        self.last_id += 1;
        let id = self.last_id;
        self.describe("thread_name", group.0, id, Object::new().text("name", name));
        let place = Object::new().number("sort_index", id);
        self.describe("thread_sort_index", group.0, id, place);
        TrackWriter {
            group,
            id,
            drawn: Vec::new(),
            latest_ns: 0,
            open: 0,
        }
    }

    /// Writes a track that has been drawn.
    ///
    /// # Panics
    ///
    /// Panics if a slice of it was not ended.
    fn add(&mut self, mut track: TrackWriter) {
        assert_eq!(track.open, 0, "each slice of a track is ended");
        // Stable: at one time a slice must end before the next begins.
        track.drawn.sort_by_key(|(time_ns, _)| *time_ns);
        for (_, event) in track.drawn {
            self.push(&event);
        }
    }

    /// Returns the whole text.
    fn into_text(self) -> String {
        format!(
            "{{\"displayTimeUnit\":\"ns\",\"traceEvents\":[\n{}\n]}}\n",
            self.events
        )
    }

    fn describe(&mut self, what: &str, group: u64, track: u64, args: Object) {
        let event = Object::new()
            .text("ph", "M")
            .text("name", what)
            .number("pid", group)
            .number("tid", track)
            .json("args", &args.into_text());
        self.push(&event.into_text());
    }

    fn push(&mut self, event: &str) {
        let separator = if self.events.is_empty() { "" } else { ",\n" };
        // Writing into a `String` cannot fail.
        let _ = write!(self.events, "{separator}{event}");
    }
}

impl TrackWriter {
    /// Begins a slice, inside the open one if there is one. `args` is a JSON object. It does not
    /// begin before the last slice has ended.
    fn begin_slice(&mut self, time_ns: u64, name: &str, args: &str) {
        self.latest_ns = self.latest_ns.max(time_ns);
        self.open += 1;
        let rest = format!(",\"name\":{},\"args\":{args}", quoted(name));
        self.draw('B', self.latest_ns, &rest);
    }

    /// Ends the slice that was begun last.
    fn end_slice(&mut self, time_ns: u64) {
        self.latest_ns = self.latest_ns.max(time_ns);
        self.open = self.open.saturating_sub(1);
        self.draw('E', self.latest_ns, "");
    }

    /// Draws an instant, at any time.
    fn instant(&mut self, time_ns: u64, name: &str, args: &str) {
        let rest = format!(",\"s\":\"t\",\"name\":{},\"args\":{args}", quoted(name));
        self.draw('i', time_ns, &rest);
    }

    /// Draws the start of a flow at the open slice, at the time drawn last.
    fn flow_out(&mut self, flow: Flow) {
        self.draw('s', self.latest_ns, &described(flow));
    }

    /// Draws the end of a flow at the open slice, at the time drawn last.
    fn flow_in(&mut self, flow: Flow) {
        let rest = format!("{},\"bp\":\"e\"", described(flow));
        self.draw('f', self.latest_ns, &rest);
    }

    /// Sets the time of the next flows.
    fn advance(&mut self, time_ns: u64) {
        self.latest_ns = self.latest_ns.max(time_ns);
    }

    fn draw(&mut self, phase: char, time_ns: u64, rest: &str) {
        let (group, id) = (self.group.0, self.id);
        let (us, ns) = (time_ns / 1000, time_ns % 1000);
        let event = format!(
            "{{\"ph\":\"{phase}\",\"pid\":{group},\"tid\":{id},\"ts\":{us}.{ns:03}{rest}}}"
        );
        self.drawn.push((time_ns, event));
    }
}

/// Returns the members that both ends of a flow share.
fn described(flow: Flow) -> String {
    let number = flow.number;
    let (name, category) = flow.kind;
    format!(",\"name\":\"{name}\",\"cat\":\"{category}\",\"id\":{number}")
}

#[cfg(test)]
mod tests;
