//! Converts runs for Perfetto's viewer, into the Trace Event Format of Chrome's tracing.
//!
//! In Perfetto's words a *process* is a group of *tracks* (the format calls them threads), a
//! *slice* a stretch of time on a track, and an *instant* a moment. A run becomes a group of cores,
//! with their executions; a group for each DAG, with its moments, and its jobs on as many *lanes*
//! as overlap; and a group of breaches.
//!
//! Slices of a track never overlap, and appear in the order of time. Each is written as a begin and
//! an end, because viewers round durations, and slices that touch at a nanosecond must still touch
//! there.

use sched_dag::DagId;
use views::findings::check;
use views::json::quoted;
use views::marks;
use views::record::Run;
use views::view::{SliceEnd, View};

/// Converts runs, all from time 0. `bound_ns` is the tolerance for breaches.
pub(super) fn convert(runs: &[Run], bound_ns: u64) -> String {
    let mut output = PerfettoOutput(Vec::new());
    for run in runs {
        let view = View::new(run);
        output.add_cores(&view);
        for dag in (0..).map(DagId).take(run.task_set.dags().len()) {
            output.add_dag(&view, dag);
        }
        // The machines of a joint run are judged separately, so there are no breaches here.
        let group = output.track(None, &format!("run {}: breaches", run.number));
        let track = output.track(Some(group), "rules");
        let of_one = Some(run).filter(|run| run.machines.is_empty());
        for breach in of_one.map_or(Vec::new(), |run| check(run, bound_ns).breaches) {
            let text = breach.with_names(&run.task_set);
            output.instant(track, breach.time_ns(), text.to_string());
        }
    }
    let events = output.0.join(",\n");
    format!("{{\"displayTimeUnit\":\"ns\",\"traceEvents\":[\n{events}\n]}}\n")
}

/// The numbers of a group and of a track in the group. No two are equal, as viewers mix up equal
/// numbers.
type Track = (usize, usize);

/// The events written so far.
struct PerfettoOutput(Vec<String>);

impl PerfettoOutput {
    fn add_cores(&mut self, view: &View<'_>) {
        let mut tracks = Vec::new();
        for (machine, cores) in view.run.cores() {
            let group = format!("run {}: {machine}cores", view.run.number);
            let group = Some(self.track(None, &group));
            let own = cores.clone().map(|core| core - cores.start);
            tracks.extend(own.map(|core| self.track(group, &format!("core {core}"))));
        }
        let mut slices = Vec::new();
        for (instance, history) in &view.histories {
            let all = history.slices.iter().enumerate();
            slices.extend(all.map(|(number, slice)| (*slice, instance, history.end_of(number))));
        }
        slices.sort_by_key(|(slice, ..)| (slice.from_ns, slice.to_ns.unwrap_or(u64::MAX)));
        for (slice, instance, end) in slices {
            let model = view.run.task_set.dag(instance.dag);
            let subtask = model.subtask(instance.subtask).name();
            let name = format!("{}/{subtask} #{}", model.name(), instance.job);
            let track = tracks[slice.core.index()];
            let to_ns = slice.to_ns.unwrap_or(view.end_ns);
            self.slice(track, (slice.from_ns, to_ns), &name);
            if !matches!(end, SliceEnd::Finished | SliceEnd::Open) {
                self.instant(track, to_ns, format!("{end:?}: {name}"));
            }
        }
    }

    fn add_dag(&mut self, view: &View<'_>, dag: DagId) {
        let name = view.run.task_set.dag(dag).name();
        let group = Some(self.track(None, &format!("run {}: {name}", view.run.number)));
        let moments = self.track(group, "releases, deadlines");
        let mut lanes: Vec<(Track, u64)> = Vec::new();
        let jobs = view.jobs.range((dag, 0)..=(dag, u64::MAX));
        // A job that was skipped takes no time.
        let jobs = jobs.filter(|(_, job)| job.released_ns.or(job.completed_ns).is_some());
        for (&(_, job), history) in jobs {
            let released = history.released_ns.map(|ns| ("release", ns));
            let missed = history.missed_ns.map(|ns| ("MISS", ns));
            for (what, time_ns) in released.into_iter().chain(missed) {
                self.instant(moments, time_ns, format!("{what} #{job}"));
            }
            // A job takes the first lane free at its release, so lanes never show overlapping
            // slices.
            let from_ns = view.release_ns(dag, job);
            let free = |(_, until_ns): &(Track, u64)| *until_ns <= from_ns;
            let lane = lanes.iter().position(free).unwrap_or(lanes.len());
            if lane == lanes.len() {
                let name = format!("jobs, lane {}", lane + 1);
                lanes.push((self.track(group, &name), 0));
            }
            lanes[lane].1 = history.completed_ns.unwrap_or(view.end_ns).max(from_ns);
            let (track, to_ns) = lanes[lane];
            self.slice(track, (from_ns, to_ns), &format!("job #{job}"));
        }
        // Marks of the whole run, such as its modes, appear with its first DAG.
        for mark in marks::of(view).filter(|mark| mark.dag.unwrap_or(DagId(0)) == dag) {
            self.instant(moments, mark.time_ns, mark.text);
        }
    }

    /// Adds a track to a group, or a group itself.
    fn track(&mut self, group: Option<Track>, name: &str) -> Track {
        let id = self.0.len() + 1;
        let (what, group) = group.map_or(("process_name", id), |of| ("thread_name", of.0));
        let args = format!(",\"args\":{{\"name\":{}}}", quoted(name));
        self.add('M', (group, id), 0, what, &args);
        (group, id)
    }

    fn slice(&mut self, track: Track, (from_ns, to_ns): (u64, u64), name: &str) {
        self.add('B', track, from_ns, name, "");
        self.add('E', track, to_ns, name, "");
    }

    fn instant(&mut self, track: Track, time_ns: u64, name: String) {
        self.add('i', track, time_ns, &name, ",\"s\":\"t\"");
    }

    fn add(&mut self, phase: char, (pid, tid): Track, time_ns: u64, name: &str, rest: &str) {
        let (us, ns, name) = (time_ns / 1000, time_ns % 1000, quoted(name));
        self.0.push(format!(
            "{{\"ph\":\"{phase}\",\"pid\":{pid},\"tid\":{tid},\"ts\":{us}.{ns:03},\
             \"name\":{name}{rest}}}"
        ));
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::convert;
    use crate::tests::made::{DIAMOND, commit, record_of};
    use views::json::{Value, parse};
    use views::record::Record;

    const DRAWN: &str = "
run 0: cores
core 0: a/s #0 2..90
core 0: a/l #0 92..400
core 1: a/r #0 93..152
core 1: Preempted: a/r #0 152
core 1: b/x #0 152..300
core 1: a/r #0 300..1100
core 0: a/s #1 1001..1300
core 1: a/j #0 1102..1200
core 0: a/l #1 1300..2501
core 1: a/r #1 1301..2501
run 0: a
releases, deadlines: release #0 0
jobs, lane 1: job #0 0..1200
releases, deadlines: release #1 1000
releases, deadlines: MISS #1 2501
jobs, lane 2: job #1 1000..2501
run 0: b
releases, deadlines: release #0 150
releases, deadlines: MISS #0 251
jobs, lane 1: job #0 150..300
releases, deadlines: job 1 of dag `b` is not released 900
";

    /// Returns a conversion: a line for each group, slice and instant.
    fn lines(json: &str) -> String {
        let (mut lines, mut tracks) = (String::new(), BTreeMap::new());
        for line in json.lines().filter(|line| line.starts_with("{\"ph\"")) {
            let event = parse(line.trim_end_matches(',')).expect("an event");
            let text = |path: &[&str]| event.at(path).and_then(Value::as_text).expect(line);
            let track = event.get("tid").and_then(Value::as_u64).expect(line);
            let Some(Value::Decimal(us)) = event.get("ts") else {
                panic!("{line}");
            };
            let (name, ns) = (text(&["name"]), (us * 1000.0).round());
            match text(&["ph"]) {
                "M" => {
                    let of = text(&["args", "name"]);
                    tracks.insert(track, of.to_string());
                    if name == "process_name" {
                        lines += &format!("\n{of}");
                    }
                }
                // Its begin is the line before it.
                "E" => lines += &format!("..{ns}"),
                _ => lines += &format!("\n{}: {name} {ns}", tracks[&track]),
            }
        }
        lines
    }

    #[test]
    fn a_run_is_its_cores_its_jobs_and_its_breaches_and_runs_stand_side_by_side() {
        let record = record_of("", &commit(DIAMOND[0]), DIAMOND[1]);
        let mut runs = Record::read(&record).expect("it is right").runs;
        runs[0].complete = false;
        let json = convert(&runs, 2000);
        parse(&json).expect("JSON");
        let drawn = lines(&json);
        let parts = drawn.split_once("\nrun 0: breaches\n");
        let (all, breaches) = parts.expect("they are last");
        assert_eq!(all, DRAWN.trim_end());
        assert!(breaches.starts_with("rules: "), "{breaches}");
        runs.push(runs[0].clone());
        runs[1].number = 1;
        let both = lines(&convert(&runs, 2000));
        assert_eq!(both, drawn.clone() + &drawn.replace("run 0", "run 1"));
    }
}
