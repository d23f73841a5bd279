//! What functions call to say a line of the log.

use super::installed::installed;
use crate::run::log::{Line, Site, Value, keep};

/// Says a line of the [log](mod@crate::log), for people: a level, a text, and up to four fields.
///
/// Level and text are constants. A field is a number, a truth value, or a text of which the first
/// [`TEXT_BYTES`](crate::log::TEXT_BYTES) are kept. The line bears the DAG, the subtask and the
/// job of the instance that says it, and the time; outside of subtasks the time only. It is shown
/// soon, and never by the caller, which goes on after a copy of some 200 bytes.
///
/// A line is no result of its instance: it is shown although that fails later, or although its
/// job is cut, and it is in no recording.
///
/// On the machine and on Linux the word `log=off|error|warn|info|debug` says up to which level
/// lines are kept, `info` by default; of another one the fields are not even computed. In virtual
/// time they go to the report. Without a platform they go nowhere.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::log::Level;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let dag = create_dag();
/// let period = Duration::from_millis(10);
/// dag.name("front").jobs(2).relative_deadline(period);
/// let mut late_ns = 0_u64;
/// let watch = move || {
///     if late_ns > 0 {
///         fass::log!(Level::Warn, "camera late", by_ns = late_ns, eye = "left");
///     }
///     fass::log!(Level::Debug, "not shown by default");
///     late_ns += 300;
/// };
/// dag.register_periodic_subtask(watch, vec![], period, SubtaskAttributes::named("watch"));
/// finish_create_dags(&[dag]).unwrap();
///
/// let report = machine.run();
/// assert_eq!(
///     report.logs,
///     [r#"warn front/watch[1] 0.01 s: camera late by_ns=300 eye="left""#]
/// );
/// ```
#[macro_export]
macro_rules! log {
    ($level:expr, $text:expr $(, $key:ident = $value:expr)* $(,)?) => {{
        static SITE: $crate::log::Site =
            $crate::log::Site::new($level, $text, &[$(::core::stringify!($key)),*]);
        if SITE.is_on() {
            $crate::say(&SITE, &[$($crate::log::Value::from($value)),*]);
        }
    }};
}

/// Says a line of a level that is on.
#[cold]
#[inline(never)]
pub fn say(site: &'static Site, values: &[Value]) {
    if let Some(platform) = installed() {
        platform.log(Line::new(site, values), keep);
    }
}
