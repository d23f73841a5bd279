//! The echo of a recorded topic: shows people the latest value while the run goes on.
//!
//! At each completion, the value of the watched topic is copied into a single room, where it
//! replaces the value before: a person reads slower than a DAG writes. The console takes the value
//! out, and formats it in the console's own time.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;

use recording::{Channel, Schema, Shown};

use super::{Echoing, WatchedValue};
use crate::run::line::RecordedValue;

/// The greatest length of a shown value, in bytes.
const ROOM: usize = 512;

/// Keeps the latest value of a topic.
pub(super) struct TopicEcho {
    /// The topic and its type, by channel; `None` for samples.
    topics: Vec<Option<(String, Arc<Schema>)>>,
    /// Whether the topics belong to a launched plan.
    is_launched: bool,
    watched: Option<u16>,
    room: Box<[u8]>,
    /// The value in the room: its job, and its length if it fits.
    kept: Option<(u64, Option<usize>)>,
    left_out: u64,
}

impl TopicEcho {
    pub(super) fn new() -> Self {
        Self {
            topics: Vec::new(),
            is_launched: false,
            watched: None,
            room: vec![0; ROOM].into(),
            kept: None,
            left_out: 0,
        }
    }
}

impl Echoing for TopicEcho {
    fn open(&mut self, channels: &[Channel]) {
        // The first DAG of another commit: the channels are numbered anew.
        if core::mem::take(&mut self.is_launched) {
            self.topics.clear();
            self.watch(None);
        }
        self.topics.extend(channels.iter().map(|channel| {
            let schema = || Arc::new(channel.schema.clone());
            channel
                .role
                .is_written()
                .then(|| (channel.topic.clone(), schema()))
        }));
    }

    fn launch(&mut self) {
        self.is_launched = true;
    }

    fn record(&mut self, value: &RecordedValue<'_>) {
        if self.watched == Some(value.channel) {
            // Nobody took the value before in time.
            self.left_out += u64::from(self.kept.is_some());
            let length = value.bytes.and_then(|bytes| {
                // A value that does not fit is reported by its job alone.
                let room = self.room.get_mut(..bytes.len())?;
                room.copy_from_slice(bytes);
                Some(bytes.len())
            });
            self.kept = Some((value.job, length));
        }
    }

    fn watch(&mut self, topic: Option<&str>) -> bool {
        let named = |of: &Option<(String, _)>| {
            let name = of.as_ref().map(|(name, _)| name.as_str());
            topic.is_some() && name == topic
        };
        let place = self.topics.iter().position(named);
        self.watched = place.and_then(|place| u16::try_from(place).ok());
        // Another topic begins without a value.
        (self.kept, self.left_out) = (None, 0);
        self.watched.is_some()
    }

    fn take(&mut self, into: &mut [u8]) -> Option<WatchedValue> {
        let watched = usize::from(self.watched?);
        let (_, schema) = self.topics.get(watched)?.as_ref()?;
        let (job, length) = self.kept.take()?;
        let length = length.and_then(|length| {
            into.get_mut(..length)?
                .copy_from_slice(self.room.get(..length)?);
            Some(length)
        });
        Some(WatchedValue {
            job,
            length,
            left_out: core::mem::take(&mut self.left_out),
            schema: Arc::clone(schema),
            write: |schema, bytes, f| fmt::Display::fmt(&Shown { schema, bytes }, f),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;
    use recording::{Recordable, Role};

    fn open(echo: &mut TopicEcho, topics: &[(&str, Role)]) {
        let channels = topics.iter().map(|(topic, role)| Channel {
            dag: 0,
            subtask: 0,
            role: *role,
            topic: (*topic).into(),
            schema: u32::schema(),
        });
        echo.open(&channels.collect::<Vec<_>>());
    }

    fn record(echo: &mut TopicEcho, channel: u16, job: u64, bytes: &[u8]) {
        let value = RecordedValue {
            channel,
            job,
            completed_ns: 0,
            bytes: Some(bytes),
        };
        echo.record(&value);
    }

    /// The job, the value as text, and how many were left out.
    fn take(echo: &mut TopicEcho) -> Option<(u64, String, u64)> {
        let mut buffer = [0; ROOM];
        let seen = echo.take(&mut buffer)?;
        let text = seen.shown(&buffer).to_string();
        Some((seen.job, text, seen.left_out))
    }

    #[test]
    fn the_latest_value_is_seen_and_others_are_counted() {
        let mut echo = TopicEcho::new();
        let speed = ("speed", Role::Source);
        let topics = [("pose", Role::Sample), speed, ("pose", Role::Result)];
        open(&mut echo, &topics);
        record(&mut echo, 2, 0, &[1, 0, 0, 0]);
        assert!(!echo.watch(Some("poes")) && echo.watch(Some("pose")));
        assert_eq!(take(&mut echo), None, "what was complete before");
        for job in 1..=3_u8 {
            record(&mut echo, 1, job.into(), &[9, 0, 0, 0]);
            record(&mut echo, 2, job.into(), &[job, 0, 0, 0]);
        }
        assert_eq!(take(&mut echo), Some((3, "3".into(), 2)));
        assert_eq!(take(&mut echo), None);
        record(&mut echo, 2, 4, &[7; ROOM + 1]);
        let (job, text, left_out) = take(&mut echo).expect("a value");
        assert_eq!((job, &*text, left_out), (4, "(more than 512 bytes)", 0));
        echo.watch(None);
        record(&mut echo, 2, 5, &[5, 0, 0, 0]);
        assert_eq!(take(&mut echo), None);

        // Topics of another commit take the place of those before.
        echo.is_launched = true;
        open(&mut echo, &[("new", Role::Source)]);
        assert!(!echo.watch(Some("pose")) && echo.watch(Some("new")));
        record(&mut echo, 0, 1, &[1, 0, 0, 0]);
        assert_eq!(take(&mut echo), Some((1, "1".into(), 0)));
    }
}
