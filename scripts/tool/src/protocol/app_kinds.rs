//! The kinds of machine lines that single apps print, and what each must say; see
//! `docs/app-lines.md`.

/// Each such kind, and its members.
pub(super) const APPS: &[(&str, &str)] = &[
    (
        "autoware",
        "subtasks jobs violations deadline_misses allocations hot_path_ns.max \
         hot_path_bound_ns to_vehicle_ns.max to_vehicle_bound_ns repeated unused",
    ),
    (
        "drone",
        "waypoints landed deadline_misses attitude_misses frames_skipped descents violations \
         allocations",
    ),
    (
        "gait",
        "jobs deadline_misses violations allocations most_udeg digest",
    ),
    ("gait_knee", "from_job angles_udeg"),
    (
        "fork_join",
        "subtasks jobs joins violations deadline_misses allocations first_release_ns \
         join_latency_ns.min join_latency_ns.median join_latency_ns.p99 join_latency_ns.max \
         response_time_ns.min response_time_ns.median response_time_ns.p99 \
         response_time_ns.max release_jitter_ns.min release_jitter_ns.median \
         release_jitter_ns.p99 release_jitter_ns.max",
    ),
    ("replay", "case cores violations allocations"),
    ("replay_instances", "rows"),
    ("replay_jobs", "rows"),
    (
        "dag_run",
        "set dag subtasks released completed deadline_misses skips aborts \
         response_time_ns.min response_time_ns.median response_time_ns.p99 \
         response_time_ns.max",
    ),
    (
        "dag_sink",
        "set dag sink relative_deadline_ns deadline_misses response_time_ns.min \
         response_time_ns.median response_time_ns.p99 response_time_ns.max",
    ),
    ("dag_set", "set dags violations allocations"),
    (
        "soak",
        "round policy load overrun jobs released completed misses skips aborts instances \
         preemptions violations allocations span_ns heap_bytes contexts contexts_free",
    ),
    ("executions", "subtask first times"),
    ("joins", "first times"),
    (
        "join_latency",
        "policy subtasks jobs joins same_index cross_index missing lost_inputs violations \
         allocations join_latency_ns.max cover_delay_ns.max",
    ),
    (
        "hand_off",
        "workload figure per samples value.min value.median value.p99 value.max",
    ),
    (
        "containment",
        "fault on_fault verdict on_time_before on_time_during on_time_after healthy_jobs \
         doomed_jobs lost_jobs",
    ),
    (
        "preemption",
        "instances preemptions diverged violations passed_over cpus",
    ),
    ("storm", "cpus interrupts rounds diverged"),
];
