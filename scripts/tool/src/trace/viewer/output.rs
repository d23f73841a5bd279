//! The text itself: groups, tracks and events of the Trace Event Format.
//!
//! Slices are written as a begin and an end (`B`, `E`) rather than as one event
//! with a duration: viewers keep times in numbers of their own, and so two
//! slices that touch at one nanosecond touch there, too. Each track's events are
//! written in the order of time, and at one time in the order in which they were
//! drawn, which viewers keep.

use std::fmt::Write;

use super::flows::Flow;
use crate::json::{Object, quoted};

/// All that is shown.
#[derive(Debug, Default)]
pub(super) struct Output {
    events: String,
    /// The last number given to a group or a track; no two share one, as viewers
    /// mix up a process and a thread of the same number.
    last_id: u64,
}

/// A group of tracks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group(u64);

/// A track that is being drawn.
#[derive(Debug)]
pub(super) struct Track {
    group: Group,
    id: u64,
    drawn: Vec<(u64, String)>,
    /// The time of the latest begin or end.
    latest_ns: u64,
    open: u64,
}

impl Output {
    /// Adds a group below those that there are.
    pub(super) fn group(&mut self, name: &str, label: &str) -> Group {
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

    /// Begins a track below those that the group has.
    pub(super) fn track(&mut self, group: Group, name: &str) -> Track {
        self.last_id += 1;
        let id = self.last_id;
        self.describe("thread_name", group.0, id, Object::new().text("name", name));
        let place = Object::new().number("sort_index", id);
        self.describe("thread_sort_index", group.0, id, place);
        Track {
            group,
            id,
            drawn: Vec::new(),
            latest_ns: 0,
            open: 0,
        }
    }

    /// Adds a track that has been drawn.
    ///
    /// # Panics
    ///
    /// If a slice of it was not ended.
    pub(super) fn add(&mut self, mut track: Track) {
        assert_eq!(track.open, 0, "each slice of a track is ended");
        track.drawn.sort_by_key(|(time_ns, _)| *time_ns);
        for (_, event) in track.drawn {
            self.push(&event);
        }
    }

    /// Returns the whole text.
    pub(super) fn end(self) -> String {
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
            .json("args", &args.end());
        self.push(&event.end());
    }

    fn push(&mut self, event: &str) {
        let separator = if self.events.is_empty() { "" } else { ",\n" };
        // Writing into a `String` cannot fail.
        let _ = write!(self.events, "{separator}{event}");
    }
}

impl Track {
    /// Begins a slice, inside the one that is open if there is one. `args` is an
    /// object of JSON. It does not begin before the last one has ended.
    pub(super) fn begin(&mut self, time_ns: u64, name: &str, args: &str) {
        self.latest_ns = self.latest_ns.max(time_ns);
        self.open += 1;
        let rest = format!(",\"name\":{},\"args\":{args}", quoted(name));
        self.draw('B', self.latest_ns, &rest);
    }

    /// Ends the slice that was begun last.
    pub(super) fn end(&mut self, time_ns: u64) {
        self.latest_ns = self.latest_ns.max(time_ns);
        self.open = self.open.saturating_sub(1);
        self.draw('E', self.latest_ns, "");
    }

    /// Draws a moment, at any time.
    pub(super) fn instant(&mut self, time_ns: u64, name: &str, args: &str) {
        let rest = format!(",\"s\":\"t\",\"name\":{},\"args\":{args}", quoted(name));
        self.draw('i', time_ns, &rest);
    }

    /// Lets a flow leave the slice that is open, at the time drawn last.
    pub(super) fn flow_out(&mut self, flow: Flow) {
        self.draw('s', self.latest_ns, &described(flow));
    }

    /// Lets a flow arrive at the slice that is open, at the time drawn last.
    pub(super) fn flow_in(&mut self, flow: Flow) {
        let rest = format!("{},\"bp\":\"e\"", described(flow));
        self.draw('f', self.latest_ns, &rest);
    }

    /// Sets the time of the flows to come.
    pub(super) fn advance(&mut self, time_ns: u64) {
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

/// The members that both ends of a flow have.
fn described(flow: Flow) -> String {
    let Flow { number, is_sample } = flow;
    let (name, category) = match is_sample {
        true => ("sampled by", "sample"),
        false => ("precedes", "precedence"),
    };
    format!(",\"name\":\"{name}\",\"cat\":\"{category}\",\"id\":{number}")
}
