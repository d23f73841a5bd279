//! How busy the cores were, from their rings, also while events are recorded.

use super::{Event, What, all_rings, is_recording};

/// Returns for each core for which part of a time, in thousandths, it had an
/// instance; nothing if events are not recorded. Where a core's ring does not
/// reach back to `from_ns`, the part is of what it holds, or of its latest `most`
/// events.
pub(crate) fn loads_permille(from_ns: u64, to_ns: u64, most: u64) -> impl Iterator<Item = u64> {
    let rings = if is_recording() { all_rings() } else { &[] };
    rings.iter().map(move |ring| {
        let mut events = ring.iter_meanwhile(most).peekable();
        let from_ns = match events.peek() {
            Some(oldest) if !ring.is_whole(most) => from_ns.max(oldest.time_ns),
            _ => from_ns,
        };
        load_permille(events, from_ns, to_ns)
    })
}

/// Computes one core's load from its events, which are in the order of time.
fn load_permille(events: impl Iterator<Item = Event>, from_ns: u64, to_ns: u64) -> u64 {
    // What a ring holds may all have happened since `to_ns` was read.
    let from_ns = from_ns.min(to_ns);
    let mut busy_ns = 0;
    let mut busy_since_ns = None;
    let mut is_first = true;
    for Event { time_ns, what, .. } in events {
        let time_ns = time_ns.clamp(from_ns, to_ns);
        match what {
            What::Start | What::Resume => busy_since_ns = Some(time_ns),
            What::Suspend | What::Finish | What::Ended => {
                // It had begun before the first event that is known.
                let begun_ns = busy_since_ns.take().or(is_first.then_some(from_ns));
                busy_ns += begun_ns.map_or(0, |begun_ns| time_ns.saturating_sub(begun_ns));
            }
            _ => continue,
        }
        is_first = false;
    }
    busy_ns += busy_since_ns.map_or(0, |since_ns| to_ns.saturating_sub(since_ns));
    let span_ns = to_ns.saturating_sub(from_ns).max(1);
    u64::try_from(u128::from(busy_ns) * 1000 / u128::from(span_ns)).unwrap_or(1000)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::Subject;
    use sched_dag::{CoreId, DagId};

    fn load(events: &[(u64, What)], from_ns: u64, to_ns: u64) -> u64 {
        let events = events.iter().map(|&(time_ns, what)| Event {
            time_ns,
            what,
            core: CoreId(0),
            subject: Subject::of_job(DagId(0), 0),
        });
        load_permille(events, from_ns, to_ns)
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
        assert_eq!(load(&events, 0, 200), 275);
        assert_eq!(load(&events, 170, 190), 0);
    }

    #[test]
    fn an_instance_whose_start_is_not_known_counts_from_the_beginning() {
        assert_eq!(load(&[(150, What::Finish)], 100, 200), 500);
        assert_eq!(load(&[], 100, 200), 0);
        assert_eq!(load(&[(50, What::Start)], 100, 200), 1000);
        assert_eq!(load(&[(50, What::Start)], 100, 100), 0);
    }

    #[test]
    fn a_ring_that_begins_after_the_time_has_no_load_in_it() {
        assert_eq!(load(&[(250, What::Finish)], 250, 200), 0);
        assert_eq!(load(&[(250, What::Start)], 250, 200), 0);
    }
}
