//! How busy the cores were, from the journal, also while a run goes on.
//!
//! The events of the time in question are read from the latest one back, a few at a
//! time: only while they are copied is the scheduler's lock held.

use sched_dag::journal::{Event, What};

use executive::machine::this_core;
use executive::run::execution;
use front::shell::look_back;

use super::live_run::KernelRun;

/// The most cores.
const CORES: usize = 64;

/// Returns for each core for which part of a time, in thousandths, it had an
/// instance; nothing if events are not recorded. Where the journal, or its latest
/// `most` events, do not reach back to `from_ns`, the part is of what they reach.
pub(crate) fn loads_permille(
    from_ns: u64,
    to_ns: u64,
    most: u64,
) -> impl Iterator<Item = u64> + Clone {
    let mut permille = [0; CORES];
    let mut is_recorded = true;
    for cluster in 0..execution::clusters() {
        match of_cluster(cluster, Loads::new(from_ns, to_ns), most) {
            Some(loads) => {
                let first = execution::first_core(cluster) as usize;
                let its = permille.iter_mut().skip(first).zip(0..);
                // Beyond the cluster's cores it is 0, until the next one is looked at.
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

/// Takes the events of a cluster's journal; nothing if they are not recorded.
fn of_cluster(cluster: usize, mut loads: Loads, most: u64) -> Option<Loads> {
    let is_on =
        execution::with_scheduler(cluster, |scheduler| scheduler.log.journal.is_recording());
    is_on.filter(|is_on| *is_on)?;
    look_back::<KernelRun>(cluster, most, &mut |event| {
        loads.take(event);
        !loads.is_over
    });
    Some(loads)
}

/// The loads, while events are taken from the latest one back.
#[derive(Clone, Debug)]
struct Loads {
    from_ns: u64,
    to_ns: u64,
    /// The time of the oldest event taken.
    oldest_ns: u64,
    busy_ns: [u64; CORES],
    /// When each core stopped running an instance of which it is not known yet when it
    /// began; first the end of the time, for one that may still run.
    stopped_ns: [Option<u64>; CORES],
    /// Whether anything is known of each core.
    is_known: [bool; CORES],
    /// Whether an event from before `from_ns` was taken.
    is_over: bool,
}

impl Loads {
    fn new(from_ns: u64, to_ns: u64) -> Self {
        Self {
            // What the journal holds may all have happened since `to_ns` was read.
            from_ns: from_ns.min(to_ns),
            to_ns,
            oldest_ns: to_ns,
            busy_ns: [0; CORES],
            stopped_ns: [Some(to_ns); CORES],
            is_known: [false; CORES],
            is_over: false,
        }
    }

    fn take(&mut self, event: &Event) {
        let core = event.core.index();
        let time_ns = event.time_ns.clamp(self.from_ns, self.to_ns);
        self.oldest_ns = self.oldest_ns.min(time_ns);
        if core >= CORES || self.is_over {
            return;
        }
        match event.what {
            What::Start | What::Resume => {
                let to_ns = self.stopped_ns[core].take().unwrap_or(time_ns);
                self.busy_ns[core] += to_ns.saturating_sub(time_ns);
            }
            What::Suspend | What::Finish | What::Ended => {
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
        // It had begun before the first event that is known.
        let begun_before = self.stopped_ns[core];
        let before_ns = begun_before.map_or(0, |stopped_ns| stopped_ns.saturating_sub(from_ns));
        let busy_ns = self.busy_ns[core] + before_ns;
        let span_ns = self.to_ns.saturating_sub(from_ns).max(1);
        u64::try_from(u128::from(busy_ns) * 1000 / u128::from(span_ns)).unwrap_or(1000)
    }
}

#[cfg(test)]
mod tests {
    use sched_dag::{CoreId, DagId, SubtaskId};

    use super::*;

    /// The load of core 0 by events in the order of time.
    fn load(events: &[(u64, What)], from_ns: u64, to_ns: u64) -> u64 {
        let mut loads = Loads::new(from_ns, to_ns);
        for &(time_ns, what) in events.iter().rev() {
            loads.take(&Event {
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
            (10, What::Start),
            (20, What::Finish),
            (90, What::Start),
            (120, What::Suspend),
            (120, What::Ready),
            (150, What::Resume),
            (160, What::Ended),
            (195, What::Start),
        ];
        // 90..120 from 100 on, 150..160, and 195 up to the end.
        assert_eq!(load(&events, 100, 200), 350);
        // From 10 on, where the journal begins.
        assert_eq!(load(&events, 0, 200), 55_000 / 190);
        assert_eq!(load(&events, 170, 190), 0);
    }

    #[test]
    fn an_instance_whose_start_is_not_known_counts_from_the_oldest_event() {
        let events = [(100, What::Ready), (150, What::Finish)];
        assert_eq!(load(&events, 100, 200), 500);
        assert_eq!(load(&[], 100, 200), 0);
        assert_eq!(load(&[(50, What::Start)], 100, 200), 1000);
        assert_eq!(load(&[(50, What::Start)], 100, 100), 0);
    }

    #[test]
    fn what_happens_after_the_time_is_not_in_it() {
        assert_eq!(load(&[(250, What::Finish)], 250, 200), 0);
        assert_eq!(load(&[(250, What::Start)], 250, 200), 0);
    }
}
