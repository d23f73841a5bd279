//! Topics at the console: `echo TOPIC` shows values as they are completed, `hz TOPIC` the rate of a
//! topic.
//!
//! Only topics recorded by the app (`Dag::record`) have values to show. The latest value is shown,
//! at most every [`BETWEEN_NS`], with the number of values left out. The rate of any topic comes
//! from the journal.

use core::fmt::{self, Display};
use core::marker::PhantomData;
use core::sync::atomic::{AtomicU64, Ordering};

use sched_dag::journal::{Event, EventKind};
use sched_dag::{DagId, SubtaskId, TaskSet, Topic, nearest_of};

use fass::edge::Excerpt;

use super::{Commands, LiveRun, Refuse, look_back};
use crate::println;
use crate::text::json;

/// The least time between two shown values.
const BETWEEN_NS: u64 = 100_000_000;

/// The longest value shown, in bytes.
const MOST_BYTES: usize = 512;

/// The most bytes of a value's text shown.
const MOST_TEXT_BYTES: usize = 200;

/// The most events of the journal searched for a rate.
const MOST_EVENTS: u64 = 2048;

/// Stands for no topic.
const NONE: u64 = u64::MAX;

/// The commands, and the echoed topic. Only the session uses this, a slice at a time.
pub struct TopicCommands<R> {
    /// The topic: its DAG in the upper half, its index there in the lower half; or [`NONE`].
    echoed: AtomicU64,
    /// The time of the latest shown value.
    shown_ns: AtomicU64,
    run: PhantomData<fn() -> R>,
}

impl<R: LiveRun> TopicCommands<R> {
    /// Makes the commands, with no echoed topic.
    #[allow(clippy::new_without_default, reason = "it is for a static")]
    pub const fn new() -> Self {
        Self {
            echoed: AtomicU64::new(NONE),
            shown_ns: AtomicU64::new(0),
            run: PhantomData,
        }
    }

    /// Begins to echo a topic, or explains why not.
    fn echo(&self, name: &str, task_set: &TaskSet, refuse: Refuse<'_>) {
        let Some((dag, place)) = find(name, task_set, refuse) else {
            return;
        };
        if !R::watch(Some(name)) {
            return refuse(&format_args!(
                "topic `{name}` is not recorded; let the app name it by `Dag::record`"
            ));
        }
        println!("`{name}` is shown as it is completed; `echo off` ends that");
        let echoed = u64::from(dag.0) << 32 | place as u64;
        self.echoed.store(echoed, Ordering::Relaxed);
        self.shown_ns.store(0, Ordering::Relaxed);
    }

    /// Shows the latest value of a topic, if it is new and [`BETWEEN_NS`] have passed.
    fn show(&self, topic: &Topic) {
        let now_ns = R::now_ns();
        let shown_ns = self.shown_ns.load(Ordering::Relaxed);
        if now_ns.saturating_sub(shown_ns) < BETWEEN_NS {
            return;
        }
        let mut buffer = [0; MOST_BYTES];
        let Some(seen) = R::take_seen(&mut buffer) else {
            return;
        };
        self.shown_ns.store(now_ns, Ordering::Relaxed);
        let (name, shown) = (
            &topic.name,
            Excerpt::<MOST_TEXT_BYTES>::of(seen.shown(&buffer)),
        );
        match seen.left_out {
            0 => println!("  {name}[{}] = {shown}", seen.job),
            count => println!("  {name}[{}] = {shown} ({count} left out)", seen.job),
        }
        json::emit("echo", |line| {
            line.text("topic", name)
                .number("job", seen.job)
                .text("value", &shown)
                .number("left_out", seen.left_out);
        });
    }
}

impl<R: LiveRun> Commands for TopicCommands<R> {
    fn help(&self) -> &'static [(&'static str, &'static str)] {
        &[
            (
                "echo TOPIC",
                "show values of a recorded topic as they are completed",
            ),
            ("echo off", "show them no more"),
            ("hz TOPIC", "say how often a topic was written lately"),
        ]
    }

    fn answer(&self, name: &str, rest: &str, refuse: Refuse<'_>) -> bool {
        let Some(task_set) = R::task_set() else {
            return false;
        };
        match (name, rest) {
            ("echo", "") => refuse(&"`echo` wants the name of a topic, or `off`"),
            ("echo", "off") => {
                R::watch(None);
                self.echoed.store(NONE, Ordering::Relaxed);
            }
            ("echo", topic) => self.echo(topic, &task_set, refuse),
            ("hz", "") => refuse(&"`hz` wants the name of a topic"),
            ("hz", topic) => hz::<R>(topic, &task_set, refuse),
            _ => return false,
        }
        true
    }

    fn step(&self) {
        let echoed = self.echoed.load(Ordering::Relaxed);
        if echoed == NONE {
            return;
        }
        let Some(task_set) = R::task_set() else {
            return;
        };
        let (dag, place) = (echoed >> 32, echoed & u64::from(u32::MAX));
        let at = |number| usize::try_from(number).unwrap_or(usize::MAX);
        let model = task_set.dags().get(at(dag));
        if let Some(topic) = model.and_then(|model| model.topics().get(at(place))) {
            self.show(topic);
        }
    }
}

/// Prints how often a topic was written lately, or explains why not.
fn hz<R: LiveRun>(name: &str, task_set: &TaskSet, refuse: Refuse<'_>) {
    let Some((dag, topic)) = find(name, task_set, refuse) else {
        return;
    };
    let writer = task_set.dag(dag).topics()[topic].writer;
    let rate = CompletionRate::look::<R>(task_set, dag, writer);
    let Some(mean_ns) = rate.mean_ns() else {
        return refuse(&format_args!(
            "of topic `{name}` there are {} values among the latest {MOST_EVENTS} events; \
             a rate takes two",
            rate.values
        ));
    };
    let millihertz = 1_000_000_000_000 / mean_ns;
    println!(
        "  {name}: {}.{:03} Hz of {} values; from one to the next {} to {}, jitter {}",
        millihertz / 1000,
        millihertz % 1000,
        rate.values,
        microseconds(rate.least_ns),
        microseconds(rate.most_ns),
        microseconds(rate.most_ns - rate.least_ns)
    );
    json::emit("hz", |line| {
        line.text("topic", name)
            .number("values", rate.values)
            .number("mean_ns", mean_ns)
            .number("least_ns", rate.least_ns)
            .number("most_ns", rate.most_ns);
    });
}

/// Writes a time in microseconds; nothing is allocated.
fn microseconds(ns: u64) -> impl Display {
    fmt::from_fn(move |f| write!(f, "{}.{:03} us", ns / 1000, ns % 1000))
}

/// The completions of a subtask, taken from the latest one backwards.
#[derive(Clone, Copy, Debug, Default)]
struct CompletionRate {
    values: u64,
    last_ns: u64,
    first_ns: u64,
    /// The least and the most time between consecutive completions.
    least_ns: u64,
    most_ns: u64,
}

impl CompletionRate {
    /// Takes the completions among the latest events of the journal.
    fn look<R: LiveRun>(task_set: &TaskSet, dag: DagId, writer: SubtaskId) -> Self {
        let mut rate = Self::default();
        look_back::<R>(
            task_set.dag(dag).cluster().index(),
            MOST_EVENTS,
            &mut |event| {
                rate.on_event(event, dag, writer);
                true
            },
        );
        rate
    }

    fn on_event(&mut self, event: &Event, dag: DagId, writer: SubtaskId) {
        if (event.what, event.dag, event.subtask) != (EventKind::Finish, dag, Some(writer)) {
            return;
        }
        let between_ns = self.first_ns.saturating_sub(event.time_ns);
        match self.values {
            0 => self.last_ns = event.time_ns,
            1 => (self.least_ns, self.most_ns) = (between_ns, between_ns),
            _ => {
                self.least_ns = self.least_ns.min(between_ns);
                self.most_ns = self.most_ns.max(between_ns);
            }
        }
        self.first_ns = event.time_ns;
        self.values += 1;
    }

    /// Returns the mean time between two values, if there are two with different times.
    fn mean_ns(&self) -> Option<u64> {
        let span_ns = self.last_ns - self.first_ns;
        span_ns
            .checked_div(self.values.checked_sub(1)?)
            .filter(|mean_ns| *mean_ns > 0)
    }
}

/// Finds a topic of any DAG: its DAG, and its index there. Otherwise says so, and suggests a
/// similar name or lists some topics.
fn find(name: &str, task_set: &TaskSet, refuse: Refuse<'_>) -> Option<(DagId, usize)> {
    let dags = || (0..).map(DagId).zip(task_set.dags());
    let found = dags().find_map(|(dag, model)| {
        let place = model.topics().iter().position(|topic| topic.name == name)?;
        Some((dag, place))
    });
    if found.is_none() {
        let topics = || dags().flat_map(|(_, model)| model.topics());
        refuse(&fmt::from_fn(|f| {
            write!(f, "there is no topic `{name}`")?;
            let names = &mut topics().map(|topic| topic.name.as_str());
            match nearest_of(name, names) {
                Some(near) => write!(f, "; did you mean `{near}`?"),
                None => {
                    f.write_str("; there are")?;
                    let mut topics = topics().take(16);
                    topics.try_for_each(|topic| write!(f, " `{}`", topic.name))
                }
            }
        }));
    }
    found
}

#[cfg(test)]
mod tests {
    use sched_dag::CoreId;

    use super::*;

    #[test]
    fn a_rate_is_that_of_the_completions_of_the_writer() {
        let mut rate = CompletionRate::default();
        let finish = |time_ns, subtask| Event {
            time_ns,
            what: EventKind::Finish,
            core: CoreId(0),
            dag: DagId(1),
            job: 0,
            subtask: Some(SubtaskId(subtask)),
        };
        // From the latest one back; another subtask writes between.
        for (time_ns, subtask) in [(1040, 2), (1035, 0), (1030, 2), (1018, 2), (1010, 2)] {
            rate.on_event(&finish(time_ns, subtask), DagId(1), SubtaskId(2));
        }
        assert_eq!((rate.values, rate.mean_ns()), (4, Some(10)));
        assert_eq!((rate.least_ns, rate.most_ns), (8, 12));
        let mut one = CompletionRate::default();
        one.on_event(&finish(7, 2), DagId(1), SubtaskId(2));
        assert_eq!((one.values, one.mean_ns()), (1, None));
        assert_eq!(CompletionRate::default().mean_ns(), None);
    }
}
