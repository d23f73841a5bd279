//! Reasons for rejecting a commit, one row per kind; and oddities that its author may not have
//! meant, but that prevent nothing.
//!
//! A fault names everything needed by a message or a tool: the DAG, the subtasks, the topic, the
//! numbers. Its text states the fact, the offender and the remedy in one line. Times are printed
//! like a `Duration`, in a readable unit and with every digit: `20ms`, `6.000001ms`.

use alloc::string::String;
use alloc::vec::Vec;

use super::label::{
    DagLabel, SubtaskLabel, counted_from_0, list, members, ns, one_up_to, own_input, question,
    ring, undivided,
};
use crate::ids::ClusterId;
use crate::policy::Priority;
use crate::spec::{MOST_WAITS, STACK_BYTES};
use crate::table::ENTRY_LIMIT;
use crate::worded::texts;
use crate::{MAX_ARITY, worded};

worded! {
    /// One reason why DAGs cannot be scheduled as described.
    ///
    /// In every variant, `dag` is the DAG and `subtask` the subtask at fault; `meant` is the topic
    /// probably meant.
    pub enum DagFault {
        /// There is no DAG to schedule.
        NoDags = "no_dags",
            "the commit has no dag; create one and register its subtasks";
        /// There is no core to schedule on.
        NoCores = "no_cores", "the commit is for 0 cores; give the scheduler at least 1";
        /// A cluster of 0 cores.
        ClusterWithoutCores { cluster: ClusterId } = "cluster_without_cores",
            "cluster {} has no cores; give it one", cluster.0;
        /// The clusters have more cores than the machine.
        ClustersBeyondCores { wanted: u64, cores: u32 } = "clusters_beyond_cores",
            "the clusters have {wanted} cores, and the machine has {cores}; give them fewer";
        /// The cores are divided, and a DAG states no cluster.
        NoCluster { dag: DagLabel, clusters: usize } = "no_cluster",
            "{dag} is in no cluster, and the cores are divided; {}", one_up_to(*clusters);
        /// The stated cluster does not exist. If the cores are not divided, there are 0 clusters.
        UnknownCluster { dag: DagLabel, cluster: ClusterId, clusters: usize } = "unknown_cluster",
            "{dag} is in cluster {}, and {}", cluster.0, undivided(*clusters);
        /// More DAGs than a `u32` counts.
        TooManyDags { count: usize } = "too_many_dags",
            "the commit has {count} DAGs, more than {}; merge some", u32::MAX;
        /// A DAG without subtasks.
        NoSubtasks { dag: DagLabel } = "no_subtasks",
            "{dag} has no subtask; register one or drop the DAG";
        /// More subtasks than a `u32` counts.
        TooManySubtasks { dag: DagLabel, count: usize } = "too_many_subtasks",
            "{dag} has {count} subtasks, more than {}; split it", u32::MAX;
        /// The jobs in flight of all DAGs have more instances than the options allow; `dag` has the
        /// most.
        TooManyInstances { dag: DagLabel, in_flight: u64, instances: u128, limit: u32 } =
            "too_many_instances",
            "the jobs in flight need {instances} instances, more than the limit of {limit}, and \
             {dag} with {in_flight} jobs in flight needs most; lower its in_flight or raise the \
             instance limit";
        /// Two subtasks of a DAG with one name.
        DuplicateSubtask { dag: DagLabel, first: SubtaskLabel, second: SubtaskLabel } =
            "duplicate_subtask",
            "{dag} has two subtasks named `{}` (registered as number {} and {}); rename one",
            first.name, first.id.0, second.id.0;
        /// A cycle of two or more subtasks, from the smallest index on; the last subtask precedes
        /// the first.
        Cycle { dag: DagLabel, hops: Vec<SubtaskLabel> } = "cycle",
            "{dag} has a cycle: {}; remove one of these edges", ring(hops);
        /// A subtask that precedes itself, by a topic or by an edge without one.
        SelfEdge { dag: DagLabel, subtask: SubtaskLabel, topic: Option<String> } = "self_edge",
            "{subtask} of {dag} {}", own_input(topic.as_ref());
        /// An edge to or from a subtask that does not exist.
        EdgeOutOfRange { dag: DagLabel, edge: (usize, usize), subtasks: usize } =
            "edge_out_of_range",
            "{dag} has an edge from {} to {}, but its {subtasks} subtasks are counted from 0; \
             correct the edge or register the subtask", edge.0, edge.1;
        /// Two parts of a DAG without any edge between them.
        NotConnected { dag: DagLabel, parts: usize, one: SubtaskLabel, other: SubtaskLabel } =
            "not_connected",
            "{dag} falls into {parts} parts: no edge leads from the part of {one} to the part of \
             {other}; connect them or make them dags of their own";
        /// Every subtask has a predecessor or an input.
        NoSource { dag: DagLabel } = "no_source",
            "{dag} has no source: every subtask has an input; register a periodic subtask";
        /// Several subtasks without predecessor, where the policy allows only a single source.
        SeveralSources { dag: DagLabel, sources: Vec<SubtaskLabel> } = "several_sources",
            "{dag} has {} sources: {}; keep one, or choose a construction policy with several",
            sources.len(), list(sources);
        /// Every subtask has a successor.
        NoSink { dag: DagLabel } = "no_sink",
            "{dag} has no sink: every subtask has a successor; register a sink subtask";
        /// Several subtasks without successor, where the policy allows only a single sink.
        SeveralSinks { dag: DagLabel, sinks: Vec<SubtaskLabel> } = "several_sinks",
            "{dag} has {} sinks: {}; keep one, or choose a construction policy with several",
            sinks.len(), list(sinks);
        /// A topic with a writer and no reader.
        UnreadTopic {
            dag: DagLabel, topic: String, writer: SubtaskLabel, meant: Option<String>
        } = "unread_topic",
            "{writer} of {dag} writes topic `{topic}`, which no subtask reads; {}register a reader \
             or drop the output", question(meant.as_ref());
        /// A topic with a reader and no writer.
        UnwrittenTopic {
            dag: DagLabel, topic: String, reader: SubtaskLabel, meant: Option<String>
        } = "unwritten_topic",
            "{reader} of {dag} reads topic `{topic}`, which no subtask writes; {}register a writer \
             or drop the input", question(meant.as_ref());
        /// A reader expects another type than the writer's.
        TypeMismatch {
            dag: DagLabel, topic: String, writer: SubtaskLabel, written: &'static str,
            reader: SubtaskLabel, read: &'static str
        } = "type_mismatch",
            "topic `{topic}` of {dag} is written as `{written}` by {writer} and read as `{read}` \
             by {reader}; make both the same type";
        /// Several writers of one topic, where the policy allows only a single writer.
        SeveralWriters { dag: DagLabel, topic: String, writers: Vec<SubtaskLabel> } =
            "several_writers",
            "topic `{topic}` of {dag} has {} writers: {}; give each a topic of its own",
            writers.len(), list(writers);
        /// Several readers of a message that can only be moved.
        SeveralReaders {
            dag: DagLabel, topic: String, type_name: &'static str, readers: Vec<SubtaskLabel>
        } = "several_readers",
            "topic `{topic}` of {dag} carries `{type_name}`, which can only be moved, and has {} \
             readers: {}; keep one reader or send a type that can be shared",
            readers.len(), list(readers);
        /// One topic in several DAGs.
        TopicInSeveralDags { topic: String, dags: Vec<DagLabel> } = "topic_in_several_dags",
            "topic `{topic}` is used by {} DAGs: {}; a topic stays inside one dag, so rename it in \
             the others", dags.len(), list(dags);
        /// One topic twice among the inputs or twice among the outputs of a subtask.
        DuplicateTopic {
            dag: DagLabel, subtask: SubtaskLabel, topic: String, direction: TopicSide
        } = "duplicate_topic",
            "{subtask} of {dag} {} topic `{topic}` twice; drop one of the {}",
            direction.verb_and_noun()[0], direction.verb_and_noun()[1];
        /// More inputs or more outputs than [`MAX_ARITY`].
        ArityTooLarge {
            dag: DagLabel, subtask: SubtaskLabel, direction: TopicSide, arity: usize
        } = "arity_too_large",
            "{subtask} of {dag} has {arity} {}, more than {MAX_ARITY}; bundle some into one \
             message", direction.verb_and_noun()[1];
        /// A DAG without period.
        MissingPeriod { dag: DagLabel } = "missing_period",
            "{dag} has no period; register its source as a periodic subtask";
        /// A period of 0.
        ZeroPeriod { dag: DagLabel } = "zero_period",
            "{dag} has a period of 0; give it at least 1 ns";
        /// A DAG without relative deadline.
        MissingDeadline { dag: DagLabel } = "missing_deadline",
            "{dag} has no relative deadline; register its sink as a sink subtask with one";
        /// A relative deadline of 0.
        ZeroDeadline { dag: DagLabel } = "zero_deadline",
            "{dag} has a relative deadline of 0; give it at least 1 ns";
        /// A sink with a relative deadline of 0.
        ZeroSinkDeadline { dag: DagLabel, sink: SubtaskLabel } = "zero_sink_deadline",
            "{sink} of {dag} has a relative deadline of 0; give it at least 1 ns";
        /// A sink with a longer relative deadline than its DAG.
        SinkDeadlineBeyondDag {
            dag: DagLabel, sink: SubtaskLabel, relative_deadline_ns: u64, of_dag_ns: u64
        } = "sink_deadline_beyond_dag",
            "{sink} of {dag} has a relative deadline of {:?}, longer than its DAG's of {:?}; \
             shorten it, or extend the DAG's", ns(*relative_deadline_ns), ns(*of_dag_ns);
        /// A subtask with a relative deadline and a successor.
        DeadlineOfNoSink { dag: DagLabel, subtask: SubtaskLabel, successor: SubtaskLabel } =
            "deadline_of_no_sink",
            "{subtask} of {dag} has a relative deadline and is no sink, for {successor} follows \
             it; give the deadline to a sink";
        /// A subtask that cannot meet the deadline even alone.
        WcetExceedsDeadline {
            dag: DagLabel, subtask: SubtaskLabel, wcet_ns: u64, relative_deadline_ns: u64
        } = "wcet_exceeds_deadline",
            "{subtask} of {dag} has a WCET of {:?}, longer than the relative deadline of {:?}; \
             shorten it or extend the deadline", ns(*wcet_ns), ns(*relative_deadline_ns);
        /// A subtask with a budget smaller than its stated WCET: the budget would end it too early.
        WcetExceedsBudget {
            dag: DagLabel, subtask: SubtaskLabel, wcet_ns: u64, budget_ns: u64
        } = "wcet_exceeds_budget",
            "{subtask} of {dag} has a WCET of {:?}, longer than its budget of {:?}, beyond which it \
             is ended; give it a longer budget, or correct the WCET", ns(*wcet_ns), ns(*budget_ns);
        /// A waiting subtask where only some segments have a WCET, or a segment has a WCET of 0.
        SegmentsPartlyGiven { dag: DagLabel, subtask: SubtaskLabel } = "segments_partly_given",
            "{subtask} of {dag} waits, and not each of its segments has a WCET above 0; give one to \
             each, or to none";
        /// A subtask with more waits than can be told apart.
        TooManyWaits { dag: DagLabel, subtask: SubtaskLabel, count: usize } = "too_many_waits",
            "{subtask} of {dag} states {count} waits, more than {MOST_WAITS}; split it";
        /// A list of a core cannot be enforced; `list` names the core.
        CoreList { list: String, why: ListFault } = "core_list", "the list of {list}: {why}";
        /// A DAG with an affinity to a core outside its cluster, or numbered 65,534 or higher.
        AffinityOutOfRange { dag: DagLabel, core: u32, cores: u32 } = "affinity_out_of_range",
            "{dag} has an affinity to core {core}, and {}", counted_from_0(*cores);
        /// Two DAGs of a cluster, both without a table, share some of their cores, but not all.
        AffinitiesOverlap { dag: DagLabel, other: DagLabel, core: u32 } = "affinities_overlap",
            "{other} and {dag} share core {core} and not all others (without an affinity a DAG has \
             every core); give both the same affinity, or no core in common";
        /// A stack that is too small or too large.
        StackOutOfRange { dag: DagLabel, subtask: SubtaskLabel, bytes: u64 } =
            "stack_out_of_range",
            "{subtask} of {dag} states a stack of {bytes} bytes; give it {} to {}, or leave it out",
            STACK_BYTES.start(), STACK_BYTES.end();
        /// A DAG with a limit of 0 jobs.
        ZeroJobs { dag: DagLabel } = "zero_jobs",
            "{dag} has a limit of 0 jobs; give at least 1, or no limit";
        /// A DAG with room for 0 jobs in flight.
        ZeroInFlight { dag: DagLabel } = "zero_in_flight",
            "{dag} has room for 0 jobs in flight; give at least 1, or leave it out";
        /// A DAG drops jobs at faults, but at most 0 times.
        ZeroFaults { dag: DagLabel } = "zero_faults",
            "{dag} survives 0 faults; let it survive at least 1, or end it by a fault";
        /// A DAG survives faults within a window of 0 jobs.
        ZeroWindow { dag: DagLabel } = "zero_window",
            "{dag} survives faults within a window of 0 jobs; give the window at least 1";
        /// A time too large for 64 bits of nanoseconds.
        TimeOverflow { dag: DagLabel, time: OverflowingTime } = "time_overflow",
            "{} of {dag} exceeds {} ns, the last time there is; {}",
            time.noun_and_remedy()[0], u64::MAX, time.noun_and_remedy()[1];
        /// Under static priority: some subtasks of a DAG have a priority, these do not.
        PrioritiesPartlyGiven { dag: DagLabel, without: Vec<SubtaskLabel> } =
            "priorities_partly_given",
            "{dag} has subtasks with and {} without priority: {}; give each a priority, or none",
            without.len(), list(without);
        /// Derived priorities must come after the priorities given in other DAGs, but the numbers
        /// up to `u32::MAX` do not suffice.
        PrioritiesExhausted { dag: DagLabel } = "priorities_exhausted",
            "the priorities of {dag}, which follow those given to other dags, exceed {}; give \
             smaller numbers there", u32::MAX;
        /// Two states of a DAG with one name.
        DuplicateState { dag: DagLabel, state: String } = "duplicate_state",
            "{dag} has two states named `{state}`; rename one";
        /// A state that no subtask uses.
        UnusedState { dag: DagLabel, state: String } = "unused_state",
            "no subtask uses state `{state}` of {dag}; register a user or drop the state";
        /// A state with readers and no updater.
        StateNeverUpdated { dag: DagLabel, state: String, reader: SubtaskLabel } =
            "state_never_updated",
            "{reader} of {dag} reads state `{state}`, which no subtask updates; register an \
             updater or give the function a constant";
        /// A subtask that uses a state twice.
        StateUsedTwice { dag: DagLabel, state: String, subtask: SubtaskLabel } =
            "state_used_twice",
            "{subtask} of {dag} uses state `{state}` twice; state its strongest use once";
        /// Subtasks share a state, and several jobs may be in flight.
        StateOverJobs {
            dag: DagLabel, state: String, in_flight: u32, users: Vec<SubtaskLabel>
        } = "state_over_jobs",
            "{dag} allows {in_flight} jobs in flight, and state `{state}` is shared by {}; allow 1 \
             job in flight, or let one subtask own the state", list(users);
        /// The latest value of a topic without a writer.
        LatestUnwritten { dag: DagLabel, topic: String, meant: Option<String> } =
            "latest_unwritten",
            "the latest value of topic `{topic}` of {dag} is asked for, and no subtask writes that \
             topic; {}register a writer or correct the name", question(meant.as_ref());
        /// The latest value of a topic is read as a type other than the written type.
        LatestTypeMismatch {
            dag: DagLabel, topic: String, writer: SubtaskLabel, written: &'static str,
            read: &'static str
        } = "latest_type_mismatch",
            "topic `{topic}` of {dag} is written as `{written}` by {writer} and its latest value \
             read as `{read}`; make both the same type";
        /// The latest value of a topic without any reader.
        LatestUnread { dag: DagLabel, topic: String } = "latest_unread",
            "the latest value of topic `{topic}` of {dag} is used by no subtask; let one sample it \
             or drop it";
        /// The latest value of a message that can only be moved, with further readers.
        LatestOfMoved {
            dag: DagLabel, topic: String, type_name: &'static str, readers: usize
        } = "latest_of_moved",
            "topic `{topic}` of {dag} carries `{type_name}`, which can only be moved, and has \
             {readers} readers, those of its latest value included; keep one reader or send a type \
             that can be shared";
    }
}

worded! {
    /// One oddity that does not prevent scheduling.
    pub enum Warning {
        /// A WCET of 0; no bound can rest on it.
        ZeroWcet { dag: DagLabel, subtask: SubtaskLabel } = "zero_wcet",
            "{subtask} of {dag} has a WCET of 0 ns; measure it, or leave the WCET out";
        /// Under static priority: subtasks with the same priority. The order of registration
        /// decides.
        EqualPriorities { priority: Priority, subtasks: Vec<(DagLabel, SubtaskLabel)> } =
            "equal_priorities",
            "priority {} is given {} times: to {}; the order of registration decides between them",
            priority.0, subtasks.len(), list(&members(subtasks));
        /// A sink writes a topic without a reader.
        UnreadSinkValue {
            dag: DagLabel,
            subtask: SubtaskLabel,
            topic: String,
            meant: Option<String>
        } = "unread_sink_value",
            "{subtask}, a sink of {dag}, writes topic `{topic}`, which no subtask reads; {}drop the \
             output", question(meant.as_ref());
        /// Two DAGs with one name.
        DuplicateDagName { first: DagLabel, second: DagLabel } = "duplicate_dag_name",
            "two DAGs are named `{}` (number {} and {}); rename one",
            first.name, first.id.0, second.id.0;
        /// The analysis is certain that the DAG cannot keep its deadlines when every instance takes
        /// its WCET, overheads included; `reason` says why, with the remedy. Comes from callers
        /// with an analysis, not from [`verify`](crate::verify()), which has none.
        CertainMiss { dag: DagLabel, reason: String } = "certain_miss",
            "{dag} cannot keep its deadlines at its WCETs: {reason}";
    }
}

texts! {
    /// The reason why a list of a core cannot be enforced. `word` is a subtask, as in lists.
    #[derive(Clone, Debug, PartialEq, Eq)]
    pub enum ListFault {
        /// The text is no list.
        Malformed { word: String } =
            "`{word}` has no place there; write `core 2: dag.a ( dag.b#1 ) dag.a#1`, with blanks \
             between words and parentheses";
        /// No subtask has this name.
        UnknownWord { word: String, meant: Option<String> } =
            "`{word}` is no subtask; {}write DAG.SUBTASK, by names or numbers",
            question(meant.as_ref());
        /// Several subtasks may be meant.
        AmbiguousWord { word: String } =
            "`{word}` may be several subtasks; name one by numbers, as 0.1, or rename one";
        /// Another list is for the same core.
        CoreTwice = "another one is of that core; join both";
        /// The core is not in the DAG's cluster.
        OutOfRange { dag: DagLabel, first: u32, cores: u32 } =
            "{dag} has {cores} cores, from core {first} on; state one of these";
        /// A subtask of the list waits.
        Waits { word: String, dag: DagLabel } =
            "`{word}` waits, and a list does not go on meanwhile; leave {dag} out of the lists, and \
             state an affinity";
        /// A DAG of the list states an affinity.
        HasAffinity { dag: DagLabel } =
            "{dag} has an affinity, and its lists say on which cores it executes; leave one out";
        /// A sporadic DAG shares lists with other DAGs.
        Sporadic { dag: DagLabel } =
            "{dag} is sporadic, and other DAGs are in its lists; give it cores of its own, or no \
             list";
        /// The least common multiple of the periods is too long.
        LapTooLong { dag: DagLabel } =
            "a lap is the least common multiple of all periods, and that of {dag} makes it too \
             long; choose periods on a grid";
        /// A lap has too many entries.
        TooManyEntries { count: u64 } =
            "a lap of its DAGs has {count} entries, more than {ENTRY_LIMIT}; choose periods on a \
             grid";
        /// An entry names no job of the lap.
        UnknownJob { word: String, job: i64, jobs: i64 } =
            "`{word}#{job}` is of no job, as a lap has {jobs}, counted from 0; correct the number";
        /// An entry appears a second time.
        EntryTwice { word: String, job: i64 } =
            "`{word}#{job}` stands twice in a lap; leave one out, or correct a number";
        /// A subtask has no entry for a job.
        EntryMissing { dag: DagLabel, word: String, job: usize } =
            "`{word}#{job}` is in none; add it, or leave all of {dag} out of the lists";
        /// Entries of a subtask without a job number are on several cores.
        NotNumbered { word: String } =
            "`{word}` stands on several cores; number its jobs, as in `{word}#1`";
        /// Some entries have times, others have none.
        PartlyTimed =
            "some of its entries have times within the lap, and others not; give times to all, or \
             to none";
        /// An entry would never start.
        Blocked { word: String } =
            "`{word}` would wait for ever, for what comes after it; change the order, or allow more \
             jobs in flight";
    }
}

/// The side of a subtask where a topic is connected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TopicSide {
    /// The subtask reads the topic.
    Input,
    /// The subtask writes the topic.
    Output,
}

/// A time of a DAG that may overflow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum OverflowingTime {
    /// The absolute deadline of job 0.
    FirstDeadline,
    /// The absolute deadline of the last job.
    LastDeadline,
    /// The sum of the WCETs of all subtasks.
    Volume,
    /// The sum of the limits of all waits.
    Waits,
}

impl TopicSide {
    const fn verb_and_noun(self) -> [&'static str; 2] {
        match self {
            Self::Input => ["reads", "inputs"],
            Self::Output => ["writes", "outputs"],
        }
    }
}

impl OverflowingTime {
    const fn noun_and_remedy(self) -> [&'static str; 2] {
        match self {
            Self::FirstDeadline => [
                "the deadline of the first job",
                "lower the offset or the relative deadline",
            ],
            Self::LastDeadline => [
                "the deadline of the last job",
                "lower the number of jobs, the period or the offset",
            ],
            Self::Volume => ["the sum of the WCETs", "lower the WCETs"],
            Self::Waits => ["the sum of the limits of waits", "lower the limits"],
        }
    }
}
