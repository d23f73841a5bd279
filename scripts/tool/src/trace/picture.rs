//! A run as a picture: each DAG above its schedule, as SVG.
//!
//! At the top stands each graph: a box for each subtask with its WCET, and an arrow for each
//! edge. Below are the first jobs on a common axis of time: a row for each core with what it
//! executed, in the colour of its subtask, with arrows of messages between machines, and below that a thin bar for each wait of what has left
//! the core; then a row for each DAG with the response time of each job, its proven bound and its
//! deadline.
//!
//! Coordinates are whole pixels, so that a run whose times differ by less than that has the same
//! picture, byte by byte. Pages keep such pictures, and tests draw them again.

use std::ops::Range;

use sched_dag::{CoreId, Dag, DagId, SubtaskId};

use super::{View, links};
use crate::record::Run;
use crate::svg::Svg;

const WIDTH: u64 = 820;
/// The least width of the rows' names, and where the axis of time begins.
const LEFT: u64 = 84;
/// The room behind the axis, for half a label.
const RIGHT: u64 = 36;
const ROW: u64 = 30;
const BOX: (u64, u64) = (104, 40);
/// The distance of two boxes.
const GAP: (u64, u64) = (44, 12);
/// About how wide a letter is.
const LETTER: u64 = 7;
/// Light enough for black letters, and different without colour, too.
const COLOURS: [&str; 10] = [
    "#8ecae6", "#ffb703", "#b7e4c7", "#f4a6a6", "#cdb4db", "#ffe59e", "#a3b8cc", "#d9ae94",
    "#90d5c9", "#e3e3e3",
];

/// Draws what the jobs did that were released from one time on and before another.
///
/// # Errors
///
/// In words: no job is left of that time.
pub fn draw(run: &Run, released_ns: Range<u64>) -> Result<String, String> {
    let view = View::new(run);
    let names = run
        .task_set
        .dags()
        .iter()
        .map(|dag| dag.name().len() as u64);
    // Those of several machines begin with the machine's.
    let names = names.filter(|_| !run.machines.is_empty());
    let mut picture = Picture {
        view: &view,
        left: LEFT.max(16 + 8 * names.max().unwrap_or(0)),
        svg: Svg::default(),
        end_ns: released_ns.end,
        released_ns,
    };
    let jobs = view
        .jobs
        .iter()
        .filter(|((dag, job), _)| picture.is_drawn(*dag, *job));
    let ends = jobs.map(|(_, job)| job.completed_ns.unwrap_or(0));
    let last_ns = ends.max().ok_or_else(|| {
        format!(
            "run {} keeps no job that was released from {} to {}; name another time by `--from`, \
             or more of it by `--periods` or `--until`",
            run.number,
            time(picture.released_ns.start),
            time(picture.released_ns.end)
        )
    })?;
    picture.end_ns = picture.end_ns.max(last_ns);
    let mut y = 12;
    for (dag, model) in picture.dags() {
        y = picture.graph(dag, model, y) + 18;
    }
    let axis = y;
    y = picture.cores(axis);
    for (dag, model) in picture.dags() {
        y = picture.responses(dag, model, y);
    }
    picture.axis(axis, y);
    Ok(picture.svg.into_text((WIDTH, y + 30)))
}

struct Picture<'v> {
    view: &'v View<'v>,
    svg: Svg,
    left: u64,
    /// Jobs that are released then are drawn.
    released_ns: Range<u64>,
    /// Where the axis of time ends.
    end_ns: u64,
}

impl<'v> Picture<'v> {
    fn dags(&self) -> impl Iterator<Item = (DagId, &'v Dag)> + use<'v> {
        (0..).map(DagId).zip(self.view.run.task_set.dags())
    }

    fn is_drawn(&self, dag: DagId, job: u64) -> bool {
        let released_ns = self
            .view
            .jobs
            .get(&(dag, job))
            .and_then(|job| job.released_ns);
        released_ns.is_some_and(|at_ns| self.released_ns.contains(&at_ns))
    }

    /// Where an instant is on the axis.
    fn x(&self, time_ns: u64) -> u64 {
        let pixels = u128::from(WIDTH - self.left - RIGHT);
        let from_ns = self.released_ns.start;
        let span_ns = u128::from((self.end_ns - from_ns).max(1));
        // To the nearest pixel.
        let after_ns = u128::from(time_ns.saturating_sub(from_ns));
        let x = (2 * after_ns * pixels + span_ns) / (2 * span_ns);
        self.left + u64::try_from(x).expect("within the picture")
    }

    /// The colour of a subtask: the next one for each of all DAGs.
    fn colour(&self, dag: DagId, subtask: SubtaskId) -> &'static str {
        let before = self.dags().take_while(|&(other, _)| other != dag);
        let before: usize = before.map(|(_, model)| model.subtasks().len()).sum();
        COLOURS[(before + subtask.0 as usize) % COLOURS.len()]
    }

    /// Draws a DAG from `y` on, by layers: a subtask's is the longest path to it.
    fn graph(&mut self, dag: DagId, model: &Dag, y: u64) -> u64 {
        let mut layers: Vec<Vec<SubtaskId>> = Vec::new();
        let mut layer_of = vec![0; model.subtasks().len()];
        for &subtask in model.topological_order() {
            let before = model.predecessors(subtask).iter();
            let layer = before.map(|it| layer_of[it.0 as usize] + 1).max();
            let layer = layer.unwrap_or(0);
            layer_of[subtask.0 as usize] = layer;
            layers.resize(layers.len().max(layer + 1), Vec::new());
            layers[layer].push(subtask);
        }
        let tallest = layers.iter().map(Vec::len).max().unwrap_or(0) as u64;
        let waits = model.subtasks().iter().any(|of| of.waiting_ns() > 0);
        let box_height = BOX.1 + if waits { 16 } else { 0 };
        let (width, height) = (BOX.0 + GAP.0, box_height + GAP.1);
        let mut corners = vec![(0, 0); model.subtasks().len()];
        for (x, layer) in (0..).zip(&layers) {
            let above = (tallest - layer.len() as u64) * height / 2;
            for (row, subtask) in (0..).zip(layer) {
                corners[subtask.0 as usize] = (self.left + x * width, y + above + row * height);
            }
        }
        self.svg
            .text((8, y + tallest * height / 2), "start", model.name());
        for (subtask, &from) in (0..).map(SubtaskId).zip(&corners) {
            for successor in model.successors(subtask) {
                let to = corners[successor.0 as usize];
                let style = "stroke=\"#333333\"";
                let end = (to.0, to.1 + box_height / 2);
                self.svg
                    .line((from.0 + BOX.0, from.1 + box_height / 2), end, style);
                let (x, y) = end;
                let arrow = format!("M{x} {y} l-8 -4 v8 z");
                self.svg.path(&arrow, "fill=\"#333333\"");
            }
        }
        for (subtask, &(x, y)) in (0..).map(SubtaskId).zip(&corners) {
            self.svg
                .rect((x, y), (BOX.0, box_height), self.colour(dag, subtask));
            let model = model.subtask(subtask);
            let wcet = model.wcet_ns().map(|ns| format!("WCET {}", time(ns)));
            let waits = Some(model.waiting_ns()).filter(|ns| *ns > 0);
            let waits = waits.map(|ns| format!("waits {}", time(ns)));
            let lines = [Some(model.name().into()), wcet, waits];
            for (row, line) in (0..).zip(lines.into_iter().flatten()) {
                self.svg
                    .text((x + BOX.0 / 2, y + 17 + 16 * row), "middle", &line);
            }
        }
        y + tallest * height
    }

    /// Draws what each core executed, from `y` on.
    fn cores(&mut self, y: u64) -> u64 {
        let cores = u64::from(self.view.run.options.cores);
        for (name, of) in self.view.run.cores() {
            for core in of.clone() {
                let middle = y + u64::from(core) * ROW + 20;
                let name = format!("{name}core {}", core - of.start);
                self.svg.text((8, middle), "start", &name);
            }
        }
        for (&instance, history) in &self.view.histories {
            if !self.is_drawn(instance.dag, instance.job) {
                continue;
            }
            let model = self.view.run.task_set.dag(instance.dag);
            let name = model.subtask(instance.subtask).name();
            for slice in &history.slices {
                let from = self.x(slice.from_ns.min(self.end_ns));
                let to = self.x(slice.to_ns.unwrap_or(self.end_ns).min(self.end_ns));
                let (top, width) = (y + u64::from(slice.core.0) * ROW + 3, (to - from).max(1));
                let colour = self.colour(instance.dag, instance.subtask);
                self.svg.rect((from, top), (width, ROW - 6), colour);
                if width > LETTER * name.len() as u64 {
                    self.svg.text((from + width / 2, top + 17), "middle", name);
                }
                if let Some((_, until_ns)) = history.wait_after(*slice) {
                    let until = self.x(until_ns.unwrap_or(self.end_ns).min(self.end_ns));
                    self.svg
                        .rect((to, top + ROW - 7), ((until - to).max(1), 4), colour);
                }
            }
        }
        for (writer, reader) in links::messages(self.view.run, true) {
            let slices = [(writer, true), (reader, false)].map(|(of, is_last)| {
                let slices = &self.view.histories.get(&of)?.slices;
                let slice = if is_last {
                    slices.last()
                } else {
                    slices.first()
                };
                slice.filter(|_| self.is_drawn(of.dag, of.job))
            });
            if let [Some(from), Some(to)] = slices {
                let row = |core: CoreId| y + u64::from(core.0) * ROW + ROW / 2;
                let sent_ns = from.to_ns.unwrap_or(self.end_ns);
                let end = (self.x(to.from_ns), row(to.core));
                let style = "stroke=\"#333333\" stroke-dasharray=\"3\"";
                self.svg.line((self.x(sent_ns), row(from.core)), end, style);
                let arrow = format!("M{} {} l-8 -4 v8 z", end.0, end.1);
                self.svg.path(&arrow, "fill=\"#333333\"");
            }
        }
        y + cores * ROW
    }

    /// Draws the response time of each job of a DAG, from `y` on, with bound and deadline.
    fn responses(&mut self, dag: DagId, model: &Dag, y: u64) -> u64 {
        let bound_ns = self.view.run.bounds_ns.get(dag.0 as usize);
        let own = model.sinks().iter().map(|sink| model.subtask(*sink));
        let own = own.filter(|sink| sink.relative_deadline_ns() != model.relative_deadline_ns());
        // Of two rows of labels the later mark's is the upper one: its line ends above the other.
        let mut marks = vec![(model.relative_deadline_ns(), "#c1121f", "deadline".into())];
        marks.extend(own.map(|sink| {
            let name = format!("deadline of {}", sink.name());
            (sink.relative_deadline_ns(), "#c1121f", name)
        }));
        let bound_ns = bound_ns.copied().flatten();
        marks.extend(bound_ns.map(|bound_ns| (bound_ns, "#1a7f37", "bound".into())));
        self.svg.text((8, y + 20), "start", model.name());
        let view = self.view;
        let mut is_first = true;
        for (&(_, job), history) in view.jobs.iter().filter(|((of, _), _)| *of == dag) {
            let Some(completed_ns) = history.completed_ns.filter(|_| self.is_drawn(dag, job))
            else {
                continue;
            };
            // A sporadic job counts from its signal, which its grid does not tell.
            let release_ns = view.due_ns.get(&(dag, job)).copied();
            let release_ns = release_ns.unwrap_or_else(|| model.grid_ns(job));
            let (from, to) = (self.x(release_ns), self.x(completed_ns));
            self.svg
                .rect((from, y + 8), ((to - from).max(1), 16), "#eeeeee");
            let response = time(completed_ns - release_ns);
            if to - from > LETTER * response.len() as u64 {
                self.svg
                    .text((from + (to - from) / 2, y + 21), "middle", &response);
            }
            for (row, (after_ns, colour, name)) in (0_u64..).zip(&marks) {
                let at_ns = release_ns + after_ns;
                if at_ns > self.end_ns {
                    continue;
                }
                let (x, label_y) = (self.x(at_ns), y + 38 + 16 * row);
                let style = format!("stroke=\"{colour}\" stroke-width=\"2\"");
                let end_y = if is_first { label_y } else { y + 28 };
                self.svg.line((x, y + 2), (x, end_y), &style);
                if is_first {
                    let label = format!("{name} {}", time(at_ns - release_ns));
                    let is_wide = x + LETTER * label.len() as u64 > WIDTH - 8;
                    let (x, anchor) = if is_wide {
                        (x - 4, "end")
                    } else {
                        (x + 4, "start")
                    };
                    self.svg.text((x, label_y), anchor, &label);
                }
            }
            is_first = false;
        }
        y + 2 * ROW + 16 * (marks.len() as u64).saturating_sub(2)
    }

    /// Draws the axis between two heights, with some ten marks.
    fn axis(&mut self, top: u64, bottom: u64) {
        let steps = (0..).flat_map(|power| [1, 2, 5].map(|step| step * 10_u64.pow(power)));
        let from_ns = self.released_ns.start;
        let span_ns = self.end_ns - from_ns;
        let step_ns = steps.take(54).find(|step| span_ns / step <= 12);
        let step_ns = step_ns.unwrap_or(span_ns.max(1));
        let first_ns = from_ns.next_multiple_of(step_ns);
        let by = usize::try_from(step_ns).unwrap_or(usize::MAX);
        for time_ns in (first_ns..=self.end_ns).step_by(by) {
            let x = self.x(time_ns);
            self.svg.line(
                (x, top),
                (x, bottom),
                "stroke=\"#333333\" stroke-opacity=\"0.12\"",
            );
            // Far from 0 a decimal does not tell marks apart.
            let unit = UNITS.into_iter().find(|it| step_ns >= it.0);
            let label = match unit.filter(|_| from_ns > 0) {
                Some((unit_ns, unit)) => format!("{} {unit}", time_ns / unit_ns),
                None => time(time_ns),
            };
            self.svg.text((x, bottom + 16), "middle", &label);
        }
    }
}

const UNITS: [(u64, &str); 3] = [(1_000_000_000, "s"), (1_000_000, "ms"), (1000, "us")];

/// Writes a time with at most one decimal, in the largest unit that makes it 1 or more.
fn time(ns: u64) -> String {
    let (unit_ns, unit) = UNITS.into_iter().find(|it| ns >= it.0).unwrap_or((1, "ns"));
    if ns == 0 {
        return "0".into();
    }
    let tenths = (ns * 10 + unit_ns / 2) / unit_ns;
    match tenths % 10 {
        0 => format!("{} {unit}", tenths / 10),
        tenth => format!("{}.{tenth} {unit}", tenths / 10),
    }
}
