//! The kinds of machine lines, and what each must say; tests compare `docs/serial-protocol.md`,
//! and `docs/app-lines.md` for those of single apps.
//!
//! A row is a kind and the members that its lines have at least; a dot leads into an object.

/// Each known kind, and its members with blanks between.
pub(super) fn kinds() -> impl Iterator<Item = (&'static str, &'static str)> {
    let rows = KERNELS.lines().chain(APPS.lines());
    rows.filter_map(|row| row.split_once(": "))
}

/// Those of the kernel.
const KERNELS: &str = "\
boot: version cpus memory_kib clock app command_line
probe: cpus steps took_ns
progress: done total
status: time_ns done total misses load_permille
stalled: dag dag_name subtask subtask_name job cpu still_ns
console: command accepted
log: level message time_ns fields left_out
wire: name packets bytes lost_packets malformed sent_bytes unsent_bytes
dag_status: dag name state released completed in_flight waiting misses skips aborts faults failed \
    restarts
record: bytes
recorded: entries lost complete
replayed: compared uncompared
memory: heap_peak_bytes heap_bytes allocations
interrupts_off: longest_ns place
stack: dag_name subtask_name used_bytes stack_bytes
commit_fault: fault message
fault: cause dag dag_name subtask subtask_name job cost cpu place message
bound_exceeded: dag dag_name jobs job response_ns bound_ns
wcet_exceeded: dag dag_name subtask subtask_name calls beyond longest_ns wcet_ns
observed: dag hash subtask execution_time_ns execution_histogram
overheads: dispatches owed_ns releases late_ns margin_percent
proof: commit dag longest_ns
panic: cpu place message
exception: cpu place message
backtrace: cpu calls
trace_check: file run events lost judged_from_ns span_ns instances preemptions breaches \
    finish_to_ready_max_ns ready_to_start_ns preemption_latency_ns longest_inversion_ns \
    load_permille
verdict: status
";

/// Those that single apps print.
const APPS: &str = "\
autoware: subtasks jobs violations deadline_misses allocations hot_path_ns.max hot_path_bound_ns \
    to_vehicle_ns.max to_vehicle_bound_ns repeated unused
drone: waypoints landed deadline_misses attitude_misses frames_skipped descents violations \
    allocations
gait: jobs deadline_misses violations allocations most_udeg digest
gait_knee: from_job angles_udeg
fork_join: subtasks jobs joins violations deadline_misses allocations first_release_ns \
    join_latency_ns.min join_latency_ns.median join_latency_ns.p99 join_latency_ns.max \
    response_time_ns.min response_time_ns.median response_time_ns.p99 response_time_ns.max \
    release_jitter_ns.min release_jitter_ns.median release_jitter_ns.p99 release_jitter_ns.max
replay: case cores violations allocations
dag_run: set dag subtasks released completed deadline_misses skips aborts response_time_ns.min \
    response_time_ns.median response_time_ns.p99 response_time_ns.max
dag_sink: set dag sink relative_deadline_ns deadline_misses response_time_ns.min \
    response_time_ns.median response_time_ns.p99 response_time_ns.max
dag_set: set dags violations allocations
executions: subtask first times
joins: first times
join_latency: policy subtasks jobs joins same_index cross_index missing lost_inputs violations \
    allocations join_latency_ns.max cover_delay_ns.max
hand_off: workload figure per samples value.min value.median value.p99 value.max
containment: fault on_fault verdict on_time_before on_time_during on_time_after healthy_jobs \
    doomed_jobs lost_jobs
preemption: instances preemptions diverged violations passed_over cpus
storm: cpus interrupts rounds diverged
";
