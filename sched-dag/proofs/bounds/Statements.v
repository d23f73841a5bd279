(** What is proven, and what it says; statements.txt has the answers. Here is all that they name: check looks. *)
From Bounds Require Import Sums Model Chains ResponseTime AlongAPath Blocking Workload TaskSet Windows
  SetBounds Checker AnyResolution Laps Examples Commit SinkCommit OneCoreStretch OneCore OneCoreOrder
  OneCoreCheck OneCoreCommit OneCoreExamples.
Set Printing Width 110. Set Printing Depth 1000.

(** What the theorems are about. *)
Print sum. Print count. Print dag. Print precedes. Print path. Print path_length. Print no_path_longer.
Print volume. Print disjoint_chains. Print chain_cover. Print disjoint_parts. Print left_over. Print run.
Print done. Print finished. Print ready. Print busy. Print complete. Print legal. Print within_wcet.
Print alone. Print finished_bool. Print ready_bool. Print somebody_waits. Print weight.
Print Shares.heads_first. Print clipped. Print rise. Print largest. Print has_predecessor.
Print waits_to_begin. Print low. Print own_cores. Print keeps_cores. Print Blocking.all_on. Print after_wait.
Print Blocking.blocking. Print workload. Print workload_by_deadline. Print window_work. Print up. Print task.
Print policy. Print set_run. Print job_done. Print job_finished. Print job_complete. Print instance_ready.
Print earlier_complete. Print on_core. Print job_cores. Print task_cores. Print may_delay. Print has_begun.
Print holds_core. Print cores_held. Print may_pass. Print global_run. Print enough_cores. Print Windows.above.
Print counts_in_full. Print full_work. Print work_of. Print cores_used. Print whole_work. Print clipped_work.
Print rising_work. Print sum_over_others. Print SetBounds.may_block. Print blocks. Print largest_blocking.
Print blocking. Print unblocked. Print blockers_known. Print SetBounds.all_keep. Print without_waits.
Print each_counts. Print first_inequality. Print second_inequality. Print outside. Print on_path.
Print window_applies. Print path_inequality. Print delays. Print widths_fit. Print part_inequality.
Print SetBounds.shown. Print edf. Print claim. Print vertices. Print listed_edge. Print stated_edge.
Print stated_dag. Print wcetN. Print head_of. Print togetherN. Print stated_task. Print claim_of.
Print stated_tasks. Print stated_policy. Print has_some. Print finer. Print subtask. Print dag_statement.
Print order. Print commit. Print vertex. Print vertices_of. Print expand. Print dag_at. Print Commit.number.
Print most_urgent. Print Commit.least_urgent. Print may_outrank. Print is_edf. Print stated.
Print all_vertices_of. Print all_kept. Print none_kept. Print exact_order. Print by_due. Print outranking.
Print insert. Print level. Print claim_at. Print with_keeps. Print kept_at. Print committed. Print own_claim.
Print last_segment. Print owns. Print keys. Print urgency. Print job_before. Print goes_before.
Print any_order. Print asked. Print keyed_run. Print above. Print may_count. Print may_block.
Print first_release. Print blocking_time. Print jobs_due. Print work_of_other. Print own_earlier.
Print own_jobs. Print interference. Print target_work. Print completes. Print starts. Print stretch_ends.
Print blocks_at. Print executed_last. Print response_shown. Print response_shown_by_start. Print finer_key.
Print start_order. Print sink_claim. Print core_claim. Print core_task. Print dag_of. Print every. Print burst.
Print lossN. Print losses. Print core_at. Print core_tasks. Print core_keys. Print core_run. Print core_statement.
Print least_dues. Print subtask_of. Print more_of. Print keys_by_vertex. Print numbers_by_vertex.
Print stated_keys. Print committed_by_rank.

(** The theorems. *)
Check graham. Check multi_path_alone. Check first_form_in_ticks. Check first_form_in_fractions.
Check multi_path_alone_in_fractions. Check response_time_equation. Check second_form. Check second_form_sharp.
Check first_form_blocked. Check along_a_path. Check set_bounds. Check set_bounds_in_fractions.
Check part_bounds. Check part_bounds_in_fractions. Check check_sound_in_fractions. Check judge_sound.
Check judge_sinks_sound. Check one_core. Check one_core_by_start. Check order_tells_last.
Check one_core_check_sound. Check sink_check_sound. Check judge_core_sound.

(** Examples, and their runs. *)
Print lap_table. Print lap. Print on. Print lost_in. Print lap_run. Print table_run. Print independent.
Print Examples.dag_of. Print simple_task. Print three_dags. Print three_at_work. Print two_wait.
Print two_subtasks. Print both_cores_lost. Print by_deadlines. Print three_on_one. Print one_is_preempted.
Print vs.
Check preempted_run_obeys. Check three_obey_the_rules. Check two_wait_together. Check losses_of_any_core.
Check sharp_form_fails_in_fractions.

(** The programs that judge. Theorems say of a "yes" what it means, whatever is in here. *)
Print precedes_within. Print precedes_bool. Print sumN. Print workloadN. Print workload_by_deadlineN.
Print window_workN. Print weightN. Print left_overN. Print ancestors_from. Print ancestors. Print level_from.
Print levels. Print all_vertices. Print edges_ok. Print ancestors_ok. Print levels_ok. Print is_ancestor.
Print label. Print chains_ok. Print width_ok. Print heads_ok. Print followers. Print work_ofN.
Print full_workN. Print cores_usedN. Print whole_workN. Print clipped_workN. Print rising_workN.
Print sum_over_othersN. Print blocksN. Print largest_blockingN. Print blockingN. Print no_blocking.
Print outsideN. Print on_pathN. Print most_of. Print most_ok. Print path_ok. Print in_fullN. Print window_ok.
Print delaysN. Print fits_ok. Print Checker.part_ok. Print inequality_ok. Print outrankers_ok. Print wcets_ok.
Print policy_ok. Print blockers_ok. Print claim_ok. Print check. Print subtasks_ok. 
Print claims_with. Print settle. Print settled. Print judge. Print own_claim_ok. Print judge_sinks.
Print tieN. Print upN. Print maxN. Print minN. Print is_wait. Print aboveN. Print may_countN.
Print may_blockN. Print first_releaseN. Print blocking_timeN. Print jobs_dueN. Print work_of_otherN.
Print own_earlierN. Print own_jobsN. Print interferenceN. Print target_workN. Print completesN. Print startsN.
Print followingN. Print dag_fine. Print no_waits_in. Print counting_fine. Print most_blocking.
Print stretch_ok. Print next_start. Print start_sequence. Print place_in. Print order_ok. Print part_ok.
Print fits. Print point_ok. Print points_ok. Print shown. Print no_bursts. Print counted_key. Print job_ok.
Print sink_ok. Print places_of. Print core_claim_ok. Print core_sinks_ok. Print with_bound.
Print core_claim_at. Print core_claims. Print judge_core.

(** And nothing that the theorems rest on is an axiom. *)
Definition all_of_them :=
  (@graham, @multi_path_alone, @first_form_in_ticks, @first_form_in_fractions,
   @multi_path_alone_in_fractions, @response_time_equation, @second_form, @second_form_sharp,
   @first_form_blocked, @along_a_path, @set_bounds,
   @set_bounds_in_fractions, @part_bounds, @part_bounds_in_fractions, @check_sound_in_fractions,
   @judge_sound, @judge_sinks_sound, @one_core, @one_core_by_start, @order_tells_last,
   @one_core_check_sound, @sink_check_sound, @judge_core_sound, @preempted_run_obeys,
   @three_obey_the_rules, @two_wait_together, @losses_of_any_core, @sharp_form_fails_in_fractions).
Print Assumptions all_of_them.
