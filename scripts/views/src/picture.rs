//! A run as a picture: each DAG above its schedule, as SVG.
//!
//! At the top stand the graphs: a box for each subtask with its WCET, and an arrow for each edge.
//! Below are the first jobs on a common axis of time. Each core has a row of its executions, in the
//! colours of the subtasks. Above the row are the core's table in thin bars, with the first late
//! entry in red, and below the row is a thin bar for each wait; arrows are messages between
//! machines. Then each DAG has a row with the response time of each job, the proven bound and the
//! deadline.
//!
//! A [`TimeWindow`] says which jobs of which DAGs are drawn. Coordinates are whole pixels, so runs
//! with times that differ by less than a pixel have the same picture, byte by byte. Pages keep such
//! pictures, and tests draw them again.

use std::ops::Range;

use fass_dag_file::time::parse_ns;
use sched_dag::{CoreId, Dag, DagId, SubtaskId, nearest};

use crate::links;
use crate::planned;
use crate::svg::Svg;
use crate::view::View;

const WIDTH: u64 = 820;
/// The least width of the rows' names, at whose end the axis of time begins.
const LEFT: u64 = 84;
/// The room behind the axis, for half a label.
const RIGHT: u64 = 36;
const ROW: u64 = 30;
const BOX: (u64, u64) = (104, 40);
/// The distance between two boxes.
const GAP: (u64, u64) = (44, 12);
/// The approximate width of a letter.
const LETTER: u64 = 7;
/// The colours of subtasks: light enough for black letters, and different without colour, too.
pub const COLOURS: [&str; 10] = [
    "#8ecae6", "#ffb703", "#b7e4c7", "#f4a6a6", "#cdb4db", "#ffe59e", "#a3b8cc", "#d9ae94",
    "#90d5c9", "#e3e3e3",
];

/// The part of a run requested by a person, in the person's words.
#[derive(Clone, Copy, Debug, Default)]
pub struct WindowRequest<'w> {
    /// The first time of release, such as `20ms`; else the time of the first job that sends to
    /// another machine, or 0.
    pub from: Option<&'w str>,
    /// The first time of release that is no longer drawn.
    pub to: Option<&'w str>,
    /// The names of the DAGs, with commas between them; else all DAGs are drawn.
    pub dags: Option<&'w str>,
    /// Without `to`: the length, as a multiple of the longest period of these DAGs; `None`: 1.
    pub periods: Option<u64>,
}

/// The part of a run shown by a picture.
#[derive(Clone, Debug)]
pub struct TimeWindow {
    /// The times of release of the drawn jobs.
    pub released_ns: Range<u64>,
    /// The DAGs.
    pub dags: Vec<DagId>,
}

impl TimeWindow {
    /// Finds the requested part of a run.
    ///
    /// # Errors
    ///
    /// In words: a malformed time, or an unknown DAG.
    pub fn of(view: &View<'_>, asked: &WindowRequest<'_>) -> Result<Self, String> {
        let dags = view.run.task_set.dags();
        let names: Vec<&str> = dags.iter().map(Dag::name).collect();
        let find = |name: &str| {
            let mut known = (0..).map(DagId).zip(&names);
            let found = known.find(|(_, known)| **known == name);
            found.map(|(dag, _)| dag).ok_or_else(|| {
                let near = nearest(name, &names);
                let hint = near.map_or(String::new(), |it| format!("; did you mean `{it}`?"));
                let there = names.join("`, `");
                format!("`--dags`: the run has no dag `{name}`; there are `{there}`{hint}")
            })
        };
        let mut drawn: Vec<DagId> = match asked.dags {
            Some(names) => names.split(',').map(find).collect::<Result<_, _>>()?,
            None => (0..).map(DagId).take(dags.len()).collect(),
        };
        drawn.sort_unstable();
        drawn.dedup();
        let time = |name: &str, word: Option<&str>| {
            let time = word.map(parse_ns).transpose();
            time.map_err(|why| format!("`--{name}`: {why}"))
        };
        let sent = links::messages(view.run, true);
        let sent_ns = sent.filter_map(|(of, _)| view.jobs.get(&(of.dag, of.job))?.released_ns);
        let from_ns = time("from", asked.from)?.or(sent_ns.min()).unwrap_or(0);
        let periods_ns = drawn.iter().map(|dag| dags[dag.index()].period_ns());
        let longest_ns = periods_ns.max().unwrap_or(0);
        let span_ns = longest_ns.saturating_mul(asked.periods.unwrap_or(1));
        let to_ns = time("to", asked.to)?.unwrap_or(from_ns.saturating_add(span_ns));
        Ok(Self {
            released_ns: from_ns..to_ns.max(from_ns),
            dags: drawn,
        })
    }
}

/// Draws the jobs of a window.
///
/// # Errors
///
/// In words: no job of that time is left.
pub fn draw(view: &View<'_>, window: TimeWindow) -> Result<String, String> {
    let mut picture = Picture::new(view, window);
    let jobs = view.jobs.iter();
    let jobs = jobs.filter(|((dag, job), _)| picture.is_drawn(*dag, *job));
    let ends = jobs.map(|(_, job)| job.completed_ns.unwrap_or(0));
    let last_ns = ends.max().ok_or_else(|| {
        format!(
            "run {} keeps no job that was released from {} to {}; name another time by `--from`, \
             or more of it by `--periods` or `--to`",
            view.run.number,
            time(picture.window.released_ns.start),
            time(picture.window.released_ns.end)
        )
    })?;
    picture.end_ns = picture.end_ns.max(last_ns);
    let axis = picture.graphs();
    let mut y = picture.cores(axis);
    for (dag, model) in picture.dags() {
        y = picture.responses(dag, model, y);
    }
    picture.axis(axis, y);
    Ok(picture.svg.into_text((WIDTH, y + 30)))
}

/// Draws the graphs of all DAGs alone.
pub fn graphs(view: &View<'_>) -> String {
    let window = TimeWindow::of(view, &WindowRequest::default())
        .expect("nothing is asked that could be wrong");
    let mut picture = Picture::new(view, window);
    let height = picture.graphs();
    picture.svg.into_text((picture.right, height))
}

/// Shortens a name for a box. The end of the name stays, because generated names differ there.
fn fitted(name: &str) -> String {
    let (count, most) = (name.chars().count(), ((BOX.0 - LETTER) / LETTER) as usize);
    let end: String = name
        .chars()
        .skip((count + 1).saturating_sub(most))
        .collect();
    if count > most {
        format!("…{end}")
    } else {
        name.into()
    }
}

struct Picture<'v> {
    view: &'v View<'v>,
    svg: Svg,
    left: u64,
    /// The end of the widest graph.
    right: u64,
    window: TimeWindow,
    /// The end of the axis of time.
    end_ns: u64,
}

impl<'v> Picture<'v> {
    fn new(view: &'v View<'v>, window: TimeWindow) -> Self {
        let dags = window.dags.iter().map(|dag| view.run.task_set.dag(*dag));
        let names = dags.map(|dag| dag.name().len() as u64);
        Self {
            view,
            left: (16 + 8 * names.max().unwrap_or(0)).clamp(LEFT, WIDTH / 2),
            right: 0,
            svg: Svg::default(),
            end_ns: window.released_ns.end,
            window,
        }
    }

    fn dags(&self) -> Vec<(DagId, &'v Dag)> {
        let model = |dag: &DagId| (*dag, self.view.run.task_set.dag(*dag));
        self.window.dags.iter().map(model).collect()
    }

    fn is_drawn(&self, dag: DagId, job: u64) -> bool {
        let job = self.view.jobs.get(&(dag, job));
        let released_ns = job.and_then(|job| job.released_ns);
        self.window.dags.contains(&dag)
            && released_ns.is_some_and(|at_ns| self.window.released_ns.contains(&at_ns))
    }

    /// Returns the place of an instant on the axis.
    fn x(&self, time_ns: u64) -> u64 {
        let pixels = u128::from(WIDTH - self.left - RIGHT);
        let from_ns = self.window.released_ns.start;
        let span_ns = u128::from((self.end_ns - from_ns).max(1));
        // To the nearest pixel.
        let after_ns = u128::from(time_ns.saturating_sub(from_ns));
        let x = (2 * after_ns * pixels + span_ns) / (2 * span_ns);
        self.left + u64::try_from(x).expect("within the picture")
    }

    /// Returns the colour of a subtask: the next colour for each subtask of all DAGs.
    fn colour(&self, dag: DagId, subtask: SubtaskId) -> &'static str {
        let before = &self.view.run.task_set.dags()[..dag.index()];
        let before: usize = before.iter().map(|model| model.subtasks().len()).sum();
        COLOURS[(before + subtask.0 as usize) % COLOURS.len()]
    }

    /// Draws all graphs, and returns their lower end.
    fn graphs(&mut self) -> u64 {
        let dags = self.dags().into_iter();
        dags.fold(12, |y, (dag, model)| self.graph(dag, model, y) + 18)
    }

    /// Draws a DAG from `y` on, by layers: the longest path to a subtask is the subtask's layer.
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
        self.right = self.right.max(self.left + layers.len() as u64 * width);
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
            let lines = [Some(fitted(model.name())), wcet, waits];
            for (row, line) in (0..).zip(lines.into_iter().flatten()) {
                self.svg
                    .text((x + BOX.0 / 2, y + 17 + 16 * row), "middle", &line);
            }
        }
        y + tallest * height
    }

    /// Draws the executions of each core, from `y` on.
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
            if !self.window.dags.contains(&instance.dag) {
                continue;
            }
            let model = self.view.run.task_set.dag(instance.dag);
            let name = model.subtask(instance.subtask).name();
            // Jobs released before or after the window are drawn, too: a core is never shown idle
            // while it executes one of these DAGs.
            for slice in &history.slices {
                let to_ns = slice.to_ns.unwrap_or(self.end_ns).min(self.end_ns);
                if slice.from_ns >= self.end_ns || to_ns < self.window.released_ns.start {
                    continue;
                }
                let (from, to) = (self.x(slice.from_ns), self.x(to_ns));
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
        self.table(y);
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

    /// Draws the entries of tables above the rows of cores, which begin at `y`.
    fn table(&mut self, y: u64) {
        let late = planned::first_late(self.view).map(|late| late.instance);
        for of in planned::entries(self.view) {
            let is_drawn = self.window.dags.contains(&of.instance.dag);
            let is_after = of.to_ns < self.window.released_ns.start;
            if !is_drawn || is_after || of.from_ns >= self.end_ns {
                continue;
            }
            let (from, to) = (self.x(of.from_ns), self.x(of.to_ns.min(self.end_ns)));
            let top = y + u64::from(of.core.0) * ROW - 2;
            let colour = match late == Some(of.instance) {
                true => "#c1121f",
                false => self.colour(of.instance.dag, of.instance.subtask),
            };
            self.svg.rect((from, top), ((to - from).max(1), 4), colour);
        }
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
            let colour = match history.missed_ns {
                Some(_) => "#f4a6a6",
                None => "#eeeeee",
            };
            self.svg
                .rect((from, y + 8), ((to - from).max(1), 16), colour);
            let response = time(completed_ns.saturating_sub(release_ns));
            if to - from > LETTER * response.len() as u64 {
                self.svg
                    .text((from + (to - from) / 2, y + 21), "middle", &response);
            }
            for (row, (after_ns, colour, name)) in (0_u64..).zip(&marks) {
                let at_ns = release_ns.saturating_add(*after_ns);
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
        let from_ns = self.window.released_ns.start;
        let span_ns = self.end_ns - from_ns;
        let step_ns = steps.take(54).find(|step| span_ns / step <= 12);
        let step_ns = step_ns.unwrap_or(span_ns.max(1));
        let first_ns = from_ns.checked_next_multiple_of(step_ns);
        let first_ns = first_ns.unwrap_or(u64::MAX);
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

/// Formats a time with at most one decimal, in the largest unit not above the time.
fn time(ns: u64) -> String {
    let (unit_ns, unit) = UNITS.into_iter().find(|it| ns >= it.0).unwrap_or((1, "ns"));
    if ns == 0 {
        return "0".into();
    }
    // Of 64 bits there may be no more left.
    let tenths = (u128::from(ns) * 10 + u128::from(unit_ns / 2)) / u128::from(unit_ns);
    match tenths % 10 {
        0 => format!("{} {unit}", tenths / 10),
        tenth => format!("{}.{tenth} {unit}", tenths / 10),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::tests::run_of;
    use crate::made::DIAMOND;

    /// Returns how often each of these parts stands in the picture of what is asked for.
    fn counted<const N: usize>(asked: WindowRequest<'_>, parts: [&str; N]) -> [usize; N] {
        let run = run_of(DIAMOND[0], DIAMOND[1]);
        let view = View::new(&run);
        let window = TimeWindow::of(&view, &asked).expect("it is there");
        let svg = draw(&view, window).expect("it has jobs");
        parts.map(|part| svg.matches(part).count())
    }

    #[test]
    fn a_window_shows_its_jobs_with_their_graphs_executions_and_deadlines() {
        let parts = [
            "<rect",
            "<path",
            ">core 1<",
            ">deadline 1.5 us<",
            ">deadline 100 ns<",
        ];
        let whole = WindowRequest {
            to: Some("1500ns"),
            ..WindowRequest::default()
        };
        // The page, five boxes, five executions in six pieces, three of job 1, two complete jobs;
        // an arrow for each edge.
        assert_eq!(counted(whole, parts), [1 + 5 + 6 + 3 + 2, 4, 1, 1, 1]);
        // There is none, and neither of these is stated.
        assert_eq!(counted(whole, [">core 2<", "WCET", ">bound"]), [0; 3]);
        // Without its end it has the longest period, of which job 1 is a part.
        assert_eq!(
            counted(WindowRequest::default(), parts),
            counted(whole, parts)
        );
        // Of DAG `a` alone once its own one; job 1 only as far as it executes before job 0 ends.
        let of_a = WindowRequest {
            dags: Some("a"),
            ..WindowRequest::default()
        };
        assert_eq!(counted(of_a, parts), [1 + 4 + 5 + 1 + 1, 4, 1, 0, 0]);
        let twice = WindowRequest {
            periods: Some(2),
            ..of_a
        };
        assert_eq!(counted(twice, parts), [1 + 4 + 5 + 3 + 1, 4, 1, 1, 0]);
        // From then on: of `a` job 1, which is not complete, and `b`; and what job 0 still executes.
        let later = WindowRequest {
            from: Some("1ns"),
            dags: Some("b,a"),
            ..whole
        };
        assert_eq!(counted(later, parts), [1 + 5 + 3 + 2 + 5, 4, 1, 0, 1]);
    }

    #[test]
    fn what_is_not_there_is_named() {
        let run = run_of(DIAMOND[0], DIAMOND[1]);
        let view = View::new(&run);
        let refused = |asked: WindowRequest<'_>| {
            let window = TimeWindow::of(&view, &asked);
            window.and_then(|window| draw(&view, window)).unwrap_err()
        };
        let unknown = refused(WindowRequest {
            dags: Some("a,A"),
            ..WindowRequest::default()
        });
        let there = "`--dags`: the run has no dag `A`; there are `a`, `b`; did you mean `a`?";
        assert_eq!(unknown, there);
        let time = refused(WindowRequest {
            to: Some("5"),
            ..WindowRequest::default()
        });
        assert!(time.starts_with("`--to`: `5` has no unit"), "{time}");
        let (from, to) = (
            Some("18446744073709551614ns"),
            Some("18446744073709551615ns"),
        );
        let none = refused(WindowRequest {
            from,
            to,
            ..WindowRequest::default()
        });
        assert!(
            none.contains("keeps no job that was released from 18446744073.7 s"),
            "{none}"
        );
    }

    #[test]
    fn a_wait_is_a_thin_bar_and_graphs_stand_alone() {
        let waits = "
0 released c0 0.0
2 start c0 0.0.0
40 wait c0 0.0.0
61 resume c1 0.0.0
70 wait c1 0.0.0
90 cancelled c0 0.0.0
1001 start c0 0.1.0
1010 wait c0 0.1.0";
        let run = run_of(&format!("{}\nwait 0.0 30\nwait 0.0 20", DIAMOND[0]), waits);
        let view = View::new(&run);
        let window = TimeWindow::of(&view, &WindowRequest::default()).expect("it is there");
        let svg = draw(&view, window).expect("it has a job");
        assert_eq!(svg.matches(">waits 50 ns<").count(), 1, "{svg}");
        // Job 1 has no release, but executes and waits.
        assert_eq!(svg.matches(" height=\"4\"").count(), 3, "{svg}");
        let graphs = graphs(&view);
        let [boxes, arrows, cores] =
            ["<rect", "<path", ">core"].map(|it| graphs.matches(it).count());
        assert_eq!((boxes, arrows, cores), (1 + 5, 4, 0), "{graphs}");
    }
}
