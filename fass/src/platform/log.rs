//! What functions call to say a line of the log.

use super::installed::installed;
use crate::run::log::{Field, Level, Line};

/// Says a line of the [log](mod@crate::log), for people: a level, a text, and up to four fields.
///
/// A field is a number, a truth value, a character or a text that lasts for ever. The line bears
/// the DAG, the subtask and the job of the instance that says it, and the time; outside of subtasks
/// the time only. It is shown soon, and never by the caller, which goes on after a copy of some 300
/// bytes.
///
/// A line is no result of its instance: it is shown although that fails later.
///
/// On the machine and on Linux the word `log=off|error|warn|info|debug` says up to which level
/// lines are said, `info` by default. In virtual time all are, and go to the report. Without a
/// platform they go nowhere.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let dag = create_dag();
/// let period = Duration::from_millis(10);
/// dag.name("front").jobs(2).period(period).relative_deadline(period);
/// let watch = |job| {
///     if job == 1 {
///         fass::log!(Warn, "camera late", by_ns = 300 * job, eye = "left");
///     }
/// };
/// dag.register_untyped_subtask(watch, SubtaskAttributes::named("watch"));
/// finish_create_dags(&[dag]).unwrap();
/// fass::log!(Debug, "committed");
///
/// let said = machine.run().logs;
/// let warns = r#"warn front/watch[1] 10000000 ns: camera late by_ns=300 eye="left""#;
/// assert_eq!(said, ["debug 0 ns: committed", warns]);
/// ```
#[macro_export]
macro_rules! log {
    ($level:ident, $text:expr $(, $key:ident = $value:expr)* $(,)?) => {
        if $crate::log::Level::$level.is_on() {
            const { ::core::assert!(<[&str]>::len(&[$(::core::stringify!($key)),*]) <= $crate::log::FIELDS) };
            let fields = [$((::core::stringify!($key), ::core::convert::From::from($value))),*];
            $crate::say($crate::log::Level::$level, $text, &fields);
        }
    };
}

/// Says a line of a level that is on.
#[cold]
#[inline(never)]
pub fn say(level: Level, text: &'static str, fields: &[Field]) {
    if let Some(platform) = installed() {
        platform.log(Line::new(level, text, fields));
    }
}
