//! What crosses the edge of a DAG: a value on its way to the platform, the way there and back,
//! and the room that it is written into.

use recording::Channel;
use sched_dag::DagId;

/// The least room for a value.
const ROOM: usize = 4096;

/// A value that a recorded topic gives to the platform, when its writer's instance is complete.
///
/// ```
/// fn show(value: &fass::Recorded<'_>) {
///     match value.bytes {
///         Some(bytes) => println!("channel {}, job {}: {bytes:?}", value.channel, value.job),
///         None => println!("channel {}, job {} is lost", value.channel, value.job),
///     }
/// }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Recorded<'v> {
    /// The number of the channel ([`Platform::open_channels`](crate::Platform::open_channels)).
    pub channel: u16,
    /// The job.
    pub job: u64,
    /// When the instance was complete, on the clock of [`crate::now_ns`].
    pub completed_ns: u64,
    /// The value; `None` if there was no room for it.
    pub bytes: Option<&'v [u8]>,
}

/// The way from a topic to the platform, and back. What a commit does about recorded topics is
/// reached through them only, so that an image without any has no code for it.
pub(crate) struct Edge {
    /// Reports whether anything is recorded or replayed.
    pub(crate) crosses: fn() -> bool,
    /// Reports whether that is so of what other subtasks than sources write, too.
    pub(crate) has_results: fn() -> bool,
    /// Takes the recorded topics of a DAG, and the hash of its graph. Reports whether the plan's
    /// taker will read the values; else they are given to it.
    pub(crate) open: fn(DagId, u64, &[Channel]) -> bool,
    /// Takes a value.
    pub(crate) record: fn(&Recorded<'_>),
    /// Reports whether there is a replay.
    pub(crate) replays: fn() -> bool,
    /// Lends a value, if there is one.
    pub(crate) replay: Lend,
}

/// Lends the value of a channel and a job.
type Lend = fn(u16, u64, &mut dyn FnMut(&[u8]));

/// Returns the room for a value of at least so many bytes.
pub(crate) const fn room_for(least_bytes: usize) -> usize {
    match 2 * least_bytes {
        room if room > ROOM => room,
        _ => ROOM,
    }
}
