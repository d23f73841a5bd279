(** What is proven, and what it says; statements.txt has the answers. *)
From Coq Require Import ZArith List.
From Table Require Import Model Sustainable Conditions Checker CheckerProof Complete Sporadic Losses AnyResolution Exact
  Counterexamples Replay.
Set Printing Width 110.

(** The rules. *)
Print table. Print environment. Print state. Print room. Print due. Print quiet. Print step. Print run.
Print initial. Print punctual. Print fits. Print right. Print conditions. Print witness. Print table_of. Print laps_at.
Print finer. Print exact. Print losing_run. Print check_losing.

(** The theorems. *)
Check sustainable.
Check never_preempted.
Check theorem_t.
Check accepted_bounds_hold.
Check accepted_alone.
Check check_decides.
Check sporadic_bounds_hold.
Check losing_bounds_hold.
Check accepted_bounds_hold_in_fractions.
Check exact_run_is_run.
Check accepted_never_blocks.
Check a_loss_is_attained.
Check replay_is_run.
Check zero_is_stuck.
Check on_time_by_the_clock_is_not_enough.

(** And nothing that they rest on is an axiom. *)
Definition all_of_them :=
  (@sustainable, @never_preempted, @theorem_t, @accepted_bounds_hold, @accepted_alone, @check_decides,
  @sporadic_bounds_hold, @losing_bounds_hold, @accepted_bounds_hold_in_fractions,
  @exact_run_is_run, @accepted_never_blocks, @a_loss_is_attained, @replay_is_run, @zero_is_stuck,
  @on_time_by_the_clock_is_not_enough).
Print Assumptions all_of_them.
