//! The text of faults of what subtasks share: states and latest values.

use core::fmt;

use super::fault::Fault;
use super::fault_text::{list, question};

impl Fault {
    pub(super) fn fmt_shared(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::DuplicateState { dag, state } => {
                write!(f, "{dag} has two states named `{state}`; rename one")
            }
            Self::UnusedState { dag, state } => write!(
                f,
                "no subtask uses state `{state}` of {dag}; register a user or drop the state"
            ),
            Self::StateNeverUpdated { dag, state, reader } => write!(
                f,
                "{reader} of {dag} reads state `{state}`, which no subtask updates; register an \
                 updater or give the function a constant"
            ),
            Self::StateUsedTwice {
                dag,
                state,
                subtask,
            } => write!(
                f,
                "{subtask} of {dag} uses state `{state}` twice; state its strongest use once"
            ),
            Self::StateOverJobs {
                dag,
                state,
                in_flight,
                users,
            } => write!(
                f,
                "{dag} allows {in_flight} jobs in flight, and state `{state}` is shared by {}; \
                 allow 1 job in flight, or let one subtask own the state",
                list(users)
            ),
            Self::LatestUnwritten { dag, topic, meant } => write!(
                f,
                "the latest value of topic `{topic}` of {dag} is asked for, and no subtask writes \
                 that topic; {}register a writer or correct the name",
                question(meant.as_ref())
            ),
            Self::LatestTypeMismatch {
                dag,
                topic,
                writer,
                written,
                read,
            } => write!(
                f,
                "topic `{topic}` of {dag} is written as `{written}` by {writer} and its latest \
                 value read as `{read}`; make both the same type"
            ),
            Self::LatestUnread { dag, topic } => write!(
                f,
                "the latest value of topic `{topic}` of {dag} is used by no subtask; let one \
                 sample it or drop it"
            ),
            Self::LatestOfMoved {
                dag,
                topic,
                type_name,
                readers,
            } => write!(
                f,
                "topic `{topic}` of {dag} carries `{type_name}`, which can only be moved, and has \
                 {readers} readers, those of its latest value included; keep one reader or send a \
                 type that can be shared"
            ),
            _ => f.write_str(self.code()),
        }
    }
}
