//! The values of one channel, by their type.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;
use core::marker::PhantomData;

use super::entry::What;
use super::read::{Entries, Recording};
use crate::value::recordable::Recordable;

/// The values of a channel with their jobs, in the order in which they were written.
///
/// See [`Recording::values`].
#[derive(Clone, Debug)]
pub struct Values<'b, T> {
    entries: Entries<'b>,
    channel: u16,
    of: PhantomData<fn() -> T>,
}

/// A recording does not have what is wanted of it.
///
/// See [`Recording::values`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mismatch(String);

impl<'b> Recording<'b> {
    /// Returns the values that a DAG's subtask has written to a topic.
    ///
    /// # Errors
    ///
    /// The recording has none of this topic, or of another type.
    ///
    /// ```
    /// use recording::{Header, Recording, Writer};
    ///
    /// let bytes = Writer::new(&Header::default()).end();
    /// let recording = Recording::read(&bytes).unwrap();
    /// let refused = recording.values::<u8>("lidar", "points").unwrap_err();
    /// assert_eq!(
    ///     refused.to_string(),
    ///     "there is nothing of topic `points` of dag `lidar`; there is nothing at all"
    /// );
    /// ```
    pub fn values<T: Recordable>(&self, dag: &str, topic: &str) -> Result<Values<'b, T>, Mismatch> {
        let header = self.header();
        let name_of = |dag: u16| &*header.dags[usize::from(dag)].name;
        let mut channels = (0_u16..).zip(&header.channels);
        let found = channels.find(|(_, channel)| {
            let is_written = channel.role.is_written();
            is_written && channel.topic == topic && name_of(channel.dag) == dag
        });
        let Some((number, channel)) = found else {
            let there = header.channels.iter();
            let there: Vec<String> = there
                .map(|channel| {
                    format!(
                        "topic `{}` of dag `{}`",
                        channel.topic,
                        name_of(channel.dag)
                    )
                })
                .collect();
            let there = match &there[..] {
                [] => "nothing at all".to_string(),
                there => there.join(", "),
            };
            return Err(Mismatch(format!(
                "there is nothing of topic `{topic}` of dag `{dag}`; there is {there}"
            )));
        };
        let wanted = T::schema();
        if channel.schema != wanted {
            let here = &channel.schema;
            return Err(Mismatch(format!(
                "topic `{topic}` of dag `{dag}` has values of type {here}, and {wanted} is \
                 wanted; record it again"
            )));
        }
        Ok(Values {
            entries: self.entries(),
            channel: number,
            of: PhantomData,
        })
    }
}

impl<T: Recordable> Iterator for Values<'_, T> {
    type Item = (u64, T);

    fn next(&mut self) -> Option<(u64, T)> {
        let channel = self.channel;
        let mut of_channel = (self.entries.by_ref())
            .filter(|entry| entry.what == What::Value && entry.place == channel);
        let entry = of_channel.next()?;
        // It is one of the type: the recording was read by the same schema.
        T::from_bytes(entry.value)
            .ok()
            .map(|value| (entry.job, value))
    }
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for Mismatch {}
