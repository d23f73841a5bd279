//! The kinds of machine lines, and what each must say; tests compare `docs/serial-protocol.md`,
//! and `docs/app-lines.md` for those of single apps.

/// A kind, and the members that its lines have at least, in words; a dot leads into an object.
type Kind = (&'static str, &'static str);

/// Each known kind.
pub(super) fn kinds() -> impl Iterator<Item = &'static Kind> {
    KERNELS.iter().chain(super::app_kinds::APPS)
}

/// Those of the kernel.
const KERNELS: &[Kind] = &[
    ("boot", "version cpus memory_kib clock app command_line"),
    ("probe", "cpus steps took_ns"),
    ("progress", "done total"),
    ("status", "time_ns done total misses load_permille"),
    (
        "stalled",
        "dag dag_name subtask subtask_name job cpu still_ns",
    ),
    ("console", "command accepted"),
    (
        "wire",
        "name packets bytes lost_packets malformed sent_bytes unsent_bytes",
    ),
    (
        "dag_status",
        "dag name state released completed in_flight waiting misses skips aborts faults \
         failed restarts",
    ),
    (
        "graph",
        "commit policy preemption cores overhead_ns bound_ns dag name period_ns \
         relative_deadline_ns offset_ns in_flight overrun subtasks edges hash sporadic jobs \
         topics states",
    ),
    ("recorded", "entries lost complete"),
    ("replayed", "compared uncompared"),
    ("memory", "heap_peak_bytes heap_bytes allocations"),
    ("interrupts_off", "longest_ns place"),
    ("stack", "dag_name subtask_name used_bytes stack_bytes"),
    ("commit_fault", "fault message"),
    (
        "fault",
        "cause dag dag_name subtask subtask_name job cost cpu place message",
    ),
    (
        "bound_exceeded",
        "dag dag_name jobs job response_ns bound_ns",
    ),
    (
        "wcet_exceeded",
        "dag dag_name subtask subtask_name calls beyond longest_ns wcet_ns",
    ),
    (
        "observed",
        "dag hash subtask execution_time_ns execution_histogram",
    ),
    (
        "overheads",
        "dispatches owed_ns releases late_ns margin_percent",
    ),
    ("proof", "commit dag longest_ns"),
    ("panic", "cpu place message"),
    ("exception", "cpu place message"),
    ("backtrace", "cpu calls"),
    (
        "times_dag",
        "dag name first_recorded_job response_time_ns release_jitter_ns",
    ),
    (
        "times_subtask",
        "dag subtask name join_latency_ns execution_time_ns execution_histogram",
    ),
    (
        "times_sink",
        "dag subtask name relative_deadline_ns misses response_time_ns",
    ),
    ("trace_begin", "policy preemption cores run"),
    (
        "trace_dag",
        "dag name period_ns relative_deadline_ns offset_ns in_flight overrun subtasks edges",
    ),
    ("trace", "events"),
    ("trace_end", "events lost"),
    (
        "trace_check",
        "file run events lost judged_from_ns span_ns instances preemptions breaches \
         finish_to_ready_max_ns ready_to_start_ns preemption_latency_ns longest_inversion_ns \
         load_permille",
    ),
    ("verdict", "status"),
];
