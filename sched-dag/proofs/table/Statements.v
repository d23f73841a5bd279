(** What is proven, and what it says; statements.txt has the answers. Here is all that they name: check looks. *)
From Coq Require Import ZArith List.
From Table Require Import Model Sustainable Conditions Checker CheckerProof Complete Sporadic Losses AnyResolution Exact
  Counterexamples Replay.
Set Printing Width 110. Set Printing Depth 1000.

(** What the theorems are about. *)
Print place. Print table. Print environment. Print state. Print next. Print started. Print finished.
Print set. Print set_place. Print spend. Print room. Print plain. Print due. Print quiet. Print step.
Print run. Print initial. Print punctual. Print work. Print encloses. Print fits. Print right.
Print conditions. Print subtask. Print dag. Print entry. Print witness. Print no_subtask. Print no_dag.
Print dag_of. Print subtask_of. Print cost. Print jobs. Print origin. Print Checker.nominal. Print list_of.
Print entry_at. Print lap_of. Print job_at. Print instance_at. Print waits_for. Print wait_after.
Print wait_of. Print table_of. Print well_formed. Print laps_at. Print losing_run. Print finer. Print settled.
Print exactly_due. Print exactly_quiet. Print exact. Print exact_run.

(** The theorems. *)
Check sustainable. Check never_preempted. Check theorem_t. Check accepted_bounds_hold. Check accepted_alone.
Check check_decides. Check sporadic_bounds_hold. Check losing_bounds_hold.
Check accepted_bounds_hold_in_fractions. Check exact_run_is_run. Check accepted_never_blocks.

(** Examples, and their runs. *)
Print lone. Print always. Print zero. Print nest. Print nominal. Print no_pause. Print waits_of.
Print settled_b. Print finished_b. Print room_b. Print act. Print begin. Print first. Print go. Print replay.
Check a_loss_is_attained. Check replay_is_run. Check zero_is_stuck. Check on_time_by_the_clock_is_not_enough.

(** The programs that judge. Theorems say of a "yes" what it means, whatever is in here. *)
Print later. Print nested. Print core_ok. Print list_ok. Print most_subtasks. Print row. Print rows_of.
Print rows. Print key. Print index. Print find. Print over_by. Print row_ok. Print complete. Print dag_ok.
Print check. Print one_job_a_lap. Print check_sporadic. Print check_losing.

(** And nothing that the theorems rest on is an axiom. *)
Definition all_of_them :=
  (@sustainable, @never_preempted, @theorem_t, @accepted_bounds_hold, @accepted_alone, @check_decides,
   @sporadic_bounds_hold, @losing_bounds_hold, @accepted_bounds_hold_in_fractions, @exact_run_is_run,
   @accepted_never_blocks, @a_loss_is_attained, @replay_is_run, @zero_is_stuck,
   @on_time_by_the_clock_is_not_enough).
Print Assumptions all_of_them.
