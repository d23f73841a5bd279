(** What is proven, and what it says; statements.txt has the answers. *)
From Bounds Require Import Sums Model Chains ResponseTime AlongAPath Blocking Workload TaskSet Windows SetBounds Checker AnyResolution
  Laps Examples Commit SinkCommit OneCoreStretch OneCore OneCoreOrder OneCoreCheck OneCoreCommit OneCoreExamples.
Set Printing Width 110.

(** The rules. *)
Print sum. Print count. Print weight. Print chain_cover. Print disjoint_parts.
Print dag. Print precedes. Print path. Print no_path_longer. Print disjoint_chains. Print left_over.
Print run. Print done. Print finished. Print ready. Print busy. Print complete. Print legal. Print within_wcet.
Print alone.
Print task. Print policy. Print set_run. Print job_done. Print job_finished. Print job_complete.
Print instance_ready. Print earlier_complete. Print on_core. Print job_cores. Print task_cores. Print may_delay.
Print has_begun. Print holds_core. Print cores_held. Print may_pass. Print global_run.
Print workload. Print workload_by_deadline. Print clipped. Print blocking. Print first_inequality. Print second_inequality. Print rise. Print on_path. Print full_work. Print Windows.above. Print counts_in_full. Print window_applies. Print path_inequality. Print delays. Print widths_fit. Print part_inequality. Print shown.
Print subtask. Print dag_statement. Print commit. Print vertex. Print vertices_of. Print expand.
Print may_outrank. Print stated. Print claim. Print claim_at. Print stated_task. Print committed. Print committed_by_rank. Print finer.
Print keys. Print urgency. Print job_before. Print goes_before. Print any_order. Print asked. Print keyed_run.
Print above. Print may_count. Print may_block. Print first_release. Print blocking_time. Print jobs_due. Print up.
Print work_of_other. Print own_earlier. Print own_jobs. Print target_work. Print interference. Print completes. Print starts. Print stretch_ends.
Print blocks_at. Print executed_last. Print response_shown. Print response_shown_by_start. Print finer_key.
Print start_order. Print burst. Print lossN. Print losses. Print sink_claim. Print core_run. Print core_statement. Print least_dues. Print subtask_of.
Print keys_by_vertex. Print numbers_by_vertex. Print stated_keys.

(** The theorems. *)
Check graham.
Check multi_path_alone.
Check first_form_in_fractions.
Check multi_path_alone_in_fractions.
Check response_time_equation.
Check second_form.
Check second_form_sharp.
Check first_form_blocked.
Check along_a_path.
Check set_bounds.
Check set_bounds_in_fractions.
Check part_bounds.
Check part_bounds_in_fractions.
Check check_sound_in_fractions.
Check judge_sound.
Check judge_sinks_sound.
Check one_core.
Check one_core_by_start.
Check order_tells_last.
Check one_core_check_sound.
Check sink_check_sound.
Check judge_core_sound.
Check preempted_run_obeys.
Check three_obey_the_rules.
Check two_wait_together.
Check losses_of_any_core.
Check sharp_form_fails_in_fractions.

(** And nothing that they rest on is an axiom. *)
Definition all_of_them :=
  (@graham, @multi_path_alone, @first_form_in_fractions, @multi_path_alone_in_fractions,
  @response_time_equation, @second_form, @second_form_sharp, @first_form_blocked,
  @along_a_path, @set_bounds, @set_bounds_in_fractions, @part_bounds, @part_bounds_in_fractions, @check_sound_in_fractions,
  @judge_sound, @judge_sinks_sound, @one_core, @one_core_by_start, @order_tells_last, @one_core_check_sound, @sink_check_sound,
  @judge_core_sound, @preempted_run_obeys, @three_obey_the_rules, @two_wait_together, @losses_of_any_core, @sharp_form_fails_in_fractions).
Print Assumptions all_of_them.
