//! Status lines: the state of a run, now and then.
//!
//! The load of each core is computed from the journal, so counting costs nothing between two lines.
//! If the journal does not reach back to the previous line, or more than 2,048 events have happened
//! since, the load covers the latest events only. Without recorded events there is no load.
//!
//! # The load of the cores
//!
//! The events in question are read from the latest one backwards, a few at a time; the scheduler's
//! lock is held only while they are copied.
//!
//! # The time of printing a due line: when nothing else is due, or after a long wait
//!
//! Printing takes core 0 some microseconds, a few of them with interrupts disabled, and delays a
//! release during that time. So a line waits until the scheduler's next event leaves time for
//! printing. With events in dense succession that wait would never end. In such a run the line is
//! printed after [`PATIENCE_NS`] all the same, and may delay a release by those microseconds.

use executive::machine::{clock, this_core};
use executive::run::execution;
use front::json;
use front::shell::{look_back, snapshot};
use sched_dag::DagId;
use sched_dag::journal::{Event, EventKind};

use super::KernelRun;

/// The most events read if time is short.
const FEW_EVENTS: u64 = 128;

/// The most events read otherwise: some tens of microseconds during which core 0 takes no
/// interrupt.
const MOST_EVENTS: u64 = 2048;

/// The printer of status lines: when to print, and what.
pub(super) struct StatusPrinter {
    period_ns: u64,
    total: u64,
    /// The time of the last line.
    last_ns: u64,
    patience: LinePatience,
}

impl StatusPrinter {
    /// Creates a printer whose first line is due after `period_ns`.
    pub(super) fn every(period_ns: u64, total: u64) -> Self {
        Self {
            period_ns,
            total,
            last_ns: clock::now_ns(),
            patience: LinePatience::new(),
        }
    }

    /// Prints a line if one is due and need not wait.
    pub(super) fn print_when_due(&mut self, is_starved: bool) {
        let now_ns = clock::now_ns();
        let is_due = now_ns >= self.last_ns.saturating_add(self.period_ns);
        if !is_due || !(is_starved || self.patience.is_over()) {
            return;
        }
        let [from_ns, to_ns] = [self.last_ns, now_ns].map(execution::since_epoch);
        self.last_ns = now_ns;
        let Some(task_set) = execution::task_set() else {
            return;
        };
        let misses = (0..)
            .map(DagId)
            .take(task_set.dags().len())
            .filter_map(|dag| snapshot::<KernelRun>(&task_set, dag))
            .map(|dag| dag.statistics.misses)
            .sum::<u64>();
        // In an interrupt's handler there is no time to read many events.
        let most = if is_starved { FEW_EVENTS } else { MOST_EVENTS };
        let loads = || loads_permille(from_ns, to_ns, most);
        json::emit("status", |line| {
            line.number("time_ns", to_ns)
                .number("done", execution::jobs_ended())
                .number("total", self.total)
                .number("misses", misses)
                .list("load_permille", loads());
            if let Some(end_ns) = execution::nominal_end_ns() {
                line.number("left_ns", end_ns.saturating_sub(to_ns));
            }
        });
    }
}

/// The progress of a run.
pub(super) struct RunProgress {
    total: u64,
    printed: u64,
    patience: LinePatience,
}

impl RunProgress {
    /// Begins with none of `total` jobs ended; 0: the run has no end to approach.
    pub(super) const fn new(total: u64) -> Self {
        Self {
            total,
            printed: 0,
            patience: LinePatience::new(),
        }
    }

    /// Prints the number of ended jobs, if it has grown by a step, and the line need not wait.
    pub(super) fn print_when_due(&mut self) {
        if self.total == 0 {
            return;
        }
        let done = execution::jobs_ended();
        let step = (self.total / 20).max(1);
        if done >= self.printed + step && self.patience.is_over() {
            self.printed = done;
            json::emit("progress", |line| {
                line.number("done", done).number("total", self.total);
            });
        }
    }
}

/// The most cores.
const CORES: usize = 64;

/// Returns each core's load between `from_ns` and `to_ns`, the time with an instance, in
/// thousandths; nothing if events are not recorded. If the journal, or its latest `most` events, do
/// not reach back to `from_ns`, the load is that of the time they cover.
pub(crate) fn loads_permille(
    from_ns: u64,
    to_ns: u64,
    most: u64,
) -> impl Iterator<Item = u64> + Clone {
    let mut permille = [0; CORES];
    let mut is_recorded = true;
    for cluster in 0..execution::clusters() {
        match of_cluster(cluster, CoreLoads::new(from_ns, to_ns), most) {
            Some(loads) => {
                let first = execution::first_core(cluster) as usize;
                let its = permille.iter_mut().skip(first).zip(0..);
                // Beyond the cluster's cores this stores 0, until the next cluster is read.
                its.for_each(|(place, core)| *place = loads.permille(core));
            }
            None => is_recorded = false,
        }
    }
    let cores = if is_recorded {
        this_core::all().len()
    } else {
        0
    };
    permille.into_iter().take(cores)
}

/// Takes the events of a cluster's journal; `None` if they are not recorded.
fn of_cluster(cluster: usize, mut loads: CoreLoads, most: u64) -> Option<CoreLoads> {
    let is_on =
        execution::with_scheduler(cluster, |scheduler| scheduler.log.journal.is_recording());
    is_on.filter(|is_on| *is_on)?;
    look_back::<KernelRun>(cluster, most, &mut |event| {
        loads.on_event(event);
        !loads.is_over
    });
    Some(loads)
}

/// The loads, while events are taken from the latest one backwards.
#[derive(Clone, Debug)]
struct CoreLoads {
    from_ns: u64,
    to_ns: u64,
    /// The time of the oldest event taken.
    oldest_ns: u64,
    busy_ns: [u64; CORES],
    /// For each core, the end of an instance whose start has not been found yet; initially `to_ns`,
    /// for an instance that may still run.
    stopped_ns: [Option<u64>; CORES],
    /// Whether anything is known of each core.
    is_known: [bool; CORES],
    /// Whether an event from before `from_ns` was taken.
    is_over: bool,
}

impl CoreLoads {
    fn new(from_ns: u64, to_ns: u64) -> Self {
        Self {
            // All events in the journal may have happened since `to_ns` was read.
            from_ns: from_ns.min(to_ns),
            to_ns,
            oldest_ns: to_ns,
            busy_ns: [0; CORES],
            stopped_ns: [Some(to_ns); CORES],
            is_known: [false; CORES],
            is_over: false,
        }
    }

    fn on_event(&mut self, event: &Event) {
        let core = event.core.index();
        let time_ns = event.time_ns.clamp(self.from_ns, self.to_ns);
        self.oldest_ns = self.oldest_ns.min(time_ns);
        if core >= CORES || self.is_over {
            return;
        }
        match event.what {
            EventKind::Start | EventKind::Resume => {
                let to_ns = self.stopped_ns[core].take().unwrap_or(time_ns);
                self.busy_ns[core] += to_ns.saturating_sub(time_ns);
            }
            EventKind::Suspend | EventKind::Wait | EventKind::Finish | EventKind::Ended => {
                self.stopped_ns[core] = Some(time_ns);
            }
            _ => return,
        }
        self.is_known[core] = true;
        self.is_over = event.time_ns < self.from_ns;
    }

    fn permille(&self, core: usize) -> u64 {
        let from_ns = if self.is_over {
            self.from_ns
        } else {
            self.oldest_ns
        };
        if !self.is_known.get(core).is_some_and(|is_known| *is_known) {
            return 0;
        }
        // The instance had begun before the first known event.
        let begun_before = self.stopped_ns[core];
        let before_ns = begun_before.map_or(0, |stopped_ns| stopped_ns.saturating_sub(from_ns));
        let busy_ns = self.busy_ns[core] + before_ns;
        let span_ns = self.to_ns.saturating_sub(from_ns).max(1);
        u64::try_from(u128::from(busy_ns) * 1000 / u128::from(span_ns)).unwrap_or(1000)
    }
}

/// The time to print a line, with a margin.
const TIME_TO_PRINT_NS: u64 = 100_000;

/// The longest wait of a line.
const PATIENCE_NS: u64 = 100_000_000;

/// The time since when a line has waited.
pub(super) struct LinePatience {
    since_ns: Option<u64>,
}

impl LinePatience {
    pub(super) const fn new() -> Self {
        Self { since_ns: None }
    }

    /// Reports whether the due line is to be printed now; if so, starts over for the next line.
    fn is_over(&mut self) -> bool {
        self.ends(clock::now_ns(), execution::next_event_ns())
    }

    fn ends(&mut self, now_ns: u64, next_event_ns: u64) -> bool {
        let waited_ns = now_ns.saturating_sub(*self.since_ns.get_or_insert(now_ns));
        let is_quiet = next_event_ns.saturating_sub(now_ns) > TIME_TO_PRINT_NS;
        let ends = is_quiet || waited_ns >= PATIENCE_NS;
        if ends {
            self.since_ns = None;
        }
        ends
    }
}

#[cfg(test)]
mod tests {
    use sched_dag::{CoreId, DagId, SubtaskId};

    use super::{LinePatience, PATIENCE_NS, *};

    /// The load of core 0 by events in the order of time.
    fn load(events: &[(u64, EventKind)], from_ns: u64, to_ns: u64) -> u64 {
        let mut loads = CoreLoads::new(from_ns, to_ns);
        for &(time_ns, what) in events.iter().rev() {
            loads.on_event(&Event {
                time_ns,
                what,
                core: CoreId(0),
                dag: DagId(0),
                job: 0,
                subtask: Some(SubtaskId(0)),
            });
        }
        assert_eq!(loads.permille(1), 0);
        loads.permille(0)
    }

    #[test]
    fn only_what_lies_in_the_time_counts() {
        let events = [
            (10, EventKind::Start),
            (20, EventKind::Finish),
            (90, EventKind::Start),
            (120, EventKind::Suspend),
            (120, EventKind::Ready),
            (150, EventKind::Resume),
            (160, EventKind::Wait),
            (165, EventKind::Wake),
            (166, EventKind::Resume),
            (170, EventKind::Ended),
            (195, EventKind::Start),
        ];
        // 90..120 from 100 on, 150..160, 166..170, and 195 up to the end.
        assert_eq!(load(&events, 100, 200), 390);
        // From 10 on, where the journal begins.
        assert_eq!(load(&events, 0, 200), 59_000 / 190);
        assert_eq!(load(&events, 170, 190), 0);
    }

    #[test]
    fn an_instance_whose_start_is_not_known_counts_from_the_oldest_event() {
        let events = [(100, EventKind::Ready), (150, EventKind::Finish)];
        assert_eq!(load(&events, 100, 200), 500);
        assert_eq!(load(&[], 100, 200), 0);
        assert_eq!(load(&[(50, EventKind::Start)], 100, 200), 1000);
        assert_eq!(load(&[(50, EventKind::Start)], 100, 100), 0);
    }

    #[test]
    fn what_happens_after_the_time_is_not_in_it() {
        assert_eq!(load(&[(250, EventKind::Finish)], 250, 200), 0);
        assert_eq!(load(&[(250, EventKind::Start)], 250, 200), 0);
    }

    #[test]
    fn a_line_waits_for_a_gap_but_not_for_ever() {
        let mut patience = LinePatience::new();
        assert!(patience.ends(1_000, u64::MAX));
        assert!(!patience.ends(2_000, 3_000));
        // The gaps of a DAG of 1 kHz do.
        assert!(patience.ends(3_000, 1_003_000));
        // Events without a gap, every 10 us.
        let waits = (0..).take_while(|step| {
            let now_ns = 5_000 + step * 10_000;
            !patience.ends(now_ns, now_ns + 10_000)
        });
        assert_eq!(waits.count() as u64, PATIENCE_NS / 10_000);
        assert!(!patience.ends(9_000, 10_000), "the next line waits anew");
    }
}
