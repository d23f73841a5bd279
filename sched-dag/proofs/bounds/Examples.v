(** * Examples: runs that obey the rules, bounds that are attained, forms that are wrong

    The theorems speak of all runs that obey the rules.  Here are some such runs, so that they do not speak
    of nothing; and runs beyond what two tempting forms of the bound would claim. *)

Require Import Arith Lia Bool List NArith.
From Bounds Require Import Sums Model Chains ResponseTime Workload TaskSet SetBounds Checker Laps.
Import ListNotations.

(** ** Runs as tables: by tick the vertices that execute, and the number of cores that others have *)

Definition table_run (e : list nat) (table : list (list nat)) (taken : list nat) : run := {|
  exec := fun v => nth v e 0;
  runs := fun t v => existsb (Nat.eqb v) (nth t table []);
  others := fun t => nth t taken 0
|}.

Definition table_ok (G : dag) (m : nat) (s : run) (h : nat) : bool :=
  let vs := seq 0 (size G) in
  forallb (fun v => (0 <? exec s v) && finished_bool s h v) vs &&
  forallb (fun t =>
    (busy G s t + others s t <=? m) &&
    forallb (fun v => if runs s t v then ready_bool G s t v
                      else negb (ready_bool G s t v) || (busy G s t + others s t =? m)) vs)
    (seq 0 h).

Lemma table_legal G m e table taken :
  table_ok G m (table_run e table taken) (length table) = true ->
  legal G m (table_run e table taken).
Proof.
  set (s := table_run e table taken). set (h := length table). intros Ok.
  unfold table_ok in Ok. cbv zeta in Ok. apply andb_true_iff in Ok. destruct Ok as (O1 & O2).
  rewrite forallb_forall in O1, O2.
  assert (V : forall v, v < size G -> 0 < exec s v /\ finished s h v).
  { intros v Hv. specialize (O1 v). rewrite in_seq, andb_true_iff, Nat.ltb_lt, finished_bool_true in O1.
    apply O1. lia. }
  assert (Late : forall t v, h <= t -> runs s t v = false).
  { intros t v Ht. simpl. rewrite nth_overflow; auto. }
  assert (Idle : forall t v, h <= t -> ~ ready G s t v).
  { intros t v Ht (Hv & N & _). apply N. apply finished_later with h; auto. apply V, Hv. }
  assert (T : forall t, t < h -> busy G s t + others s t <= m /\
    forall v, v < size G -> if runs s t v then ready G s t v
                            else ready G s t v -> busy G s t + others s t = m).
  { intros t Ht. specialize (O2 t). rewrite in_seq, andb_true_iff, Nat.leb_le, forallb_forall in O2.
    destruct O2 as (H1 & H2); [lia|]. split; auto. intros v Hv. specialize (H2 v).
    rewrite in_seq in H2. specialize (H2 ltac:(lia)). destruct (runs s t v).
    - apply ready_bool_true, H2.
    - intros Rd. apply ready_bool_true in Rd. rewrite Rd in H2. simpl in H2. apply Nat.eqb_eq, H2. }
  constructor.
  - intros t v Hv E. destruct (lt_dec t h) as [H|H].
    + destruct (T t H) as (_ & Tv). specialize (Tv v Hv). rewrite E in Tv. exact Tv.
    + rewrite Late in E; [discriminate|lia].
  - intros t v Rd E. destruct (lt_dec t h) as [H|H].
    + destruct (T t H) as (_ & Tv). pose proof Rd as (Hv & _). specialize (Tv v Hv).
      rewrite E in Tv. specialize (Tv Rd). lia.
    + exfalso. apply (Idle t v); auto. lia.
Qed.

Definition independent (n : nat) : dag :=
  {| size := n; edge := fun _ _ => false;
     edges_lead_up := fun u v E => match Bool.diff_false_true E with end |}.

Lemma independent_apart n u v : ~ precedes (independent n) u v.
Proof. intros P. destruct (last_edge _ _ _ P). discriminate. Qed.

(** ** Graham's bound is attained

    Vertices of 1, 1 and 2 ticks on two cores: length 2, volume 4, bound 3; and 3 ticks it may take. *)
Example graham_attained :
  let s := table_run [1; 1; 2] [[0; 1]; [2]; [2]] [] in
  legal (independent 3) 2 s /\ ~ complete (independent 3) s 2 /\ complete (independent 3) s 3.
Proof.
  cbv zeta. split; [apply table_legal; reflexivity|]. split.
  - intros C. specialize (C 2 ltac:(simpl; lia)). unfold finished, done, count in C. simpl in C. lia.
  - intros v Hv. simpl in Hv. destruct v as [|[|[|v]]]; unfold finished, done, count; simpl; lia.
Qed.

(** ** Rounding down is wrong where schedules change within a unit

    Four vertices of 1 ns on two cores: length 1, volume 4, so 2.5 ns by Graham, and 2 rounded down.  With
    two ticks a ns this run takes 5 ticks.  So in ns a division rounds up. *)
Example rounding_down_fails_in_fractions :
  let s := table_run [2; 2; 2; 2] [[0; 1]; [0; 2]; [1; 2]; [3]; [3]] [] in
  legal (independent 4) 2 s /\
  within_wcet (independent 4) s (fun _ => 2 * 1) /\
  ~ complete (independent 4) s (2 * (1 + (4 - 1) / 2)).
Proof.
  cbv zeta. split; [apply table_legal; reflexivity|]. split.
  - intros v Hv. simpl in Hv. destruct v as [|[|[|[|v]]]]; simpl; lia.
  - intros C. specialize (C 3 ltac:(simpl; lia)). unfold finished, done, count in C. simpl in C. lia.
Qed.

(** ** The second form without max(1, .) is wrong

    One vertex of 1 tick on one core, others have the core for the first tick.  Nothing is left over, x is 0,
    and any phi is 0 at 0: r = length = 1 would be "proved". *)
Example max_1_is_needed :
  let s := table_run [1] [[]; [0]] [1] in
  legal (independent 1) 1 s /\
  left_over (independent 1) (fun _ => 1) 0 (fun _ => 0) + clipped 1 1 1 (fun _ => 1) 0 (1 - 1)
    <= (1 - 0) * (1 - 1) /\
  ~ complete (independent 1) s 1.
Proof.
  cbv zeta. split; [apply table_legal; reflexivity|]. split; [vm_compute; lia|].
  intros C. specialize (C 0 ltac:(simpl; lia)). unfold finished, done, count in C. simpl in C. lia.
Qed.

(** ** Nor is the sharp form right in fractions

    [second_form_sharp] holds in ticks.  Its inequality in ns, for the run above in half ticks: *)
Example sharp_form_fails_in_fractions :
  let s := table_run [2; 2; 2; 2] [[0; 1]; [0; 2]; [1; 2]; [3]; [3]] [] in
  legal (independent 4) 2 s /\ within_wcet (independent 4) s (fun _ => 2 * 1) /\
  disjoint_chains (independent 4) 0 (fun v => v) /\
  left_over (independent 4) (fun _ => 1) 0 (fun v => v) + sum 0 (fun _ => 0) < (2 - 0) * (2 - 1 + 1) /\
  ~ complete (independent 4) s (2 * 2).
Proof.
  cbv zeta. destruct rounding_down_fails_in_fractions as (L & W & C).
  split; [exact L|]. split; [exact W|]. split; [intros u v H Hv E; lia|]. split; [vm_compute; lia|exact C].
Qed.

(** ** Runs of sets that obey the rules

    Three DAGs on two cores under EDF, a job of each every 12 ticks: a subtask that waits for a device for up to 2
    ticks between segments of 1 (due after 6); one of 1 tick before two of 2 (after 10); one of 4 (after 12).  All
    cores are lost in tick 4. *)
Definition dag_of (edges : list (nat * nat)) (n : nat) : dag.
Proof.
  refine {| size := n;
    edge := fun u v => (u <? v) && (v <? n) && existsb (fun e => (fst e =? u) && (snd e =? v)) edges |}.
  intros u v. rewrite !andb_true_iff, !Nat.ltb_lt. tauto.
Defined.

Definition simple_task (edges : list (nat * nat)) (wcets wait_list : list nat) (keep : bool) (T D : nat) : task :=
  {| graph := dag_of edges (length wcets); wcet := fun v => nth v wcets 0; head := fun v => v; together := fun v => nth v wcets 0;
     waits := fun v => existsb (Nat.eqb v) wait_list; keeps := fun _ => keep; regular := true; known := true;
     period := T; deadline := D; first_deadline := D |}.

Definition three_dags (k : nat) : task := nth k [
  simple_task [(0, 1); (1, 2)] [1; 2; 1] [1] false 12 6;
  simple_task [(0, 1); (0, 2)] [1; 2; 2] [] false 12 10;
  simple_task [] [4] [] false 12 12] (simple_task [] [] [] false 1 1).

(** DAG 2 begins, is preempted by DAG 1 in tick 1, and DAG 1 in part by DAG 0 in tick 2; from tick 3 on DAG 0 waits. *)
Definition three_at_work : set_run :=
  lap_run (fun k => nth k [2; 0; 0] 0) (fun k v => wcet (three_dags k) v) [
    ([(1, 0); (2, 0)], false); ([(1, 1); (1, 2)], false); ([(0, 0); (1, 1)], false);
    ([(0, 1); (1, 2); (2, 0)], false); ([(0, 1)], true); ([(0, 2); (2, 0)], false); ([(2, 0)], false);
    ([], false); ([], false); ([], false); ([], false); ([], false)].

Example three_obey_the_rules : global_run 3 2 three_dags edf three_at_work.
Proof. apply lap_obeys_the_rules. vm_compute. reflexivity. Qed.

Example three_are_disturbed :
  (forall n, executes three_at_work (12 * n) 2 n 0 = true /\ executes three_at_work (12 * n + 1) 2 n 0 = false) /\
  lost three_at_work 4 = true.
Proof.
  split; [|reflexivity]. intros n. cbn [three_at_work lap_run executes]. unfold lap. cbn [length].
  destruct (Nat.leb_spec (12 * n) (12 * n)), (Nat.leb_spec (12 * n) (12 * n + 1)); try lia.
  replace (12 * n - 12 * n) with 0 by lia. replace (12 * n + 1 - 12 * n) with 1 by lia. auto.
Qed.

(** The same where the device answers at once. *)
Example an_answer_at_once : global_run 3 2 three_dags edf
  (lap_run (fun k => nth k [2; 0; 0] 0) (fun k v => if (k =? 0) && (v =? 1) then 0 else wcet (three_dags k) v) [
    ([(1, 0); (2, 0)], false); ([(1, 1); (1, 2)], false); ([(0, 0); (1, 1)], false);
    ([(0, 2); (1, 2)], false); ([(2, 0)], false); ([(2, 0)], false); ([(2, 0)], false);
    ([], false); ([], false); ([], false); ([], false); ([], false)]).
Proof. apply lap_obeys_the_rules. vm_compute. reflexivity. Qed.

(** The same where DAG 2 has no claim, so that its jobs may be stopped and cut: its only subtask idles in tick 5, and
    is aborted after 3 ticks. *)
Definition third_is_cut (k : nat) : task :=
  if k =? 2 then {| graph := graph (three_dags 2); wcet := wcet (three_dags 2); head := fun v => v;
    together := wcet (three_dags 2); waits := fun _ => false;
    keeps := fun _ => false; regular := false; known := true; period := 12; deadline := 12; first_deadline := 12 |}
  else three_dags k.

Example cut_jobs_obey_the_rules : global_run 3 2 third_is_cut edf
  (lap_run (fun k => nth k [2; 0; 0] 0) (fun k v => if k =? 2 then 3 else wcet (three_dags k) v) [
    ([(1, 0); (2, 0)], false); ([(1, 1); (1, 2)], false); ([(0, 0); (1, 1)], false);
    ([(0, 1); (1, 2); (2, 0)], false); ([(0, 1)], true); ([(0, 2)], false); ([(2, 0)], false);
    ([], false); ([], false); ([], false); ([], false); ([], false)]).
Proof. apply lap_obeys_the_rules. vm_compute. reflexivity. Qed.

(** A run in which a subtask keeps its core.

    One core and static priorities, every 8 ticks.  DAG 1 has a subtask of 3 ticks that keeps its core, and starts it
    a tick before DAG 0, of 1 tick, is released.  So DAG 0 waits for 2 ticks although it is the more urgent one. *)
Definition long_task_keeps (k : nat) : task := simple_task [] [if k =? 0 then 1 else 3] [] true 8 8.

Definition kept_core : set_run :=
  lap_run (fun k => if k =? 0 then 1 else 0) (fun k v => wcet (long_task_keeps k) v) [
    ([(1, 0)], false); ([(1, 0)], false); ([(1, 0)], false); ([(0, 0)], false);
    ([], false); ([], false); ([], false); ([], false)].

Example kept_core_obeys_the_rules : global_run 2 1 long_task_keeps static kept_core.
Proof. apply lap_obeys_the_rules. vm_compute. reflexivity. Qed.

(** The job of DAG 0 is not complete after 2 ticks.  The bound, 1 + 3, is what is approached where DAG 1 starts
    ever later before the release. *)
Example kept_core_blocks : ~ job_complete long_task_keeps kept_core (release kept_core 0 0 + 2) 0 0.
Proof. intros C. specialize (C 0 ltac:(simpl; lia)). vm_compute in C. lia. Qed.

Definition urgent_claim (r : N) : claim :=
  {| wcets := [1]%N; shared := None; wait_list := []; preds := [[]];
     minimum_period := 8; relative_deadline := 8; least_deadline := 8;
     outranked_by := []; keeping := true; known_wcets := true; claimed := true; bound := r; loss := 0;
     width := 1; cover := None; parts := 0; part_of := [0]; free_chains := 0; chain_of := [0];
     first_level := 3; later_level := 3; costless := false |}.

Definition no_claim_of_3 : claim :=
  {| wcets := [3]%N; shared := None; wait_list := []; preds := [[]];
     minimum_period := 8; relative_deadline := 8; least_deadline := 8;
     outranked_by := [0]; keeping := true; known_wcets := true; claimed := false; bound := 0; loss := 0;
     width := 1; cover := None; parts := 0; part_of := [0]; free_chains := 0; chain_of := [0];
     first_level := 0; later_level := 0; costless := false |}.

Example blocking_counts :
  check 1 false [urgent_claim 4; no_claim_of_3] = true /\ check 1 false [urgent_claim 3; no_claim_of_3] = false.
Proof. vm_compute. auto. Qed.

(** ** Claims

    Two DAGs on two cores with static priorities, in ns: a diamond of 1, 2, 2, 1 ms every 10 ms, and a fork of
    1 ms into three of 3 ms, joined by 1 ms, every 20 ms. *)
Definition ms (n : N) : N := (n * 1000000)%N.

Definition diamond : claim :=
  {| wcets := map ms [1; 2; 2; 1]%N; shared := None; wait_list := []; preds := [[]; [0]; [0]; [1; 2]];
     minimum_period := ms 10; relative_deadline := ms 10; least_deadline := ms 10;
     outranked_by := []; keeping := false; known_wcets := true; claimed := true; bound := ms 4; loss := 0;
     width := 2; cover := Some [0; 0; 1; 0]; parts := 2; part_of := [0; 0; 1; 0];
     free_chains := 1; chain_of := [0; 0; 1; 0]; first_level := 0; later_level := 0; costless := false |}.

Definition fork (r : N) : claim :=
  {| wcets := map ms [1; 3; 3; 3; 1]%N; shared := None; wait_list := []; preds := [[]; [0]; [0]; [0]; [1; 2; 3]];
     minimum_period := ms 20; relative_deadline := ms 20; least_deadline := ms 20;
     outranked_by := [0]; keeping := false; known_wcets := true; claimed := true; bound := r; loss := 0;
     width := 3; cover := Some [0; 0; 1; 2; 0]; parts := 3; part_of := [0; 0; 1; 2; 0];
     free_chains := 0; chain_of := [0; 0; 1; 1; 0]; first_level := 0; later_level := 0; costless := false |}.

(** 14 ms, and no less by one ns. *)
Example claims_hold : check 2 false [diamond; fork (ms 14)] = true.
Proof. vm_compute. reflexivity. Qed.

Example less_is_refused : check 2 false [diamond; fork (ms 14 - 1)] = false.
Proof. vm_compute. reflexivity. Qed.

(** What that proves, in full. *)
Example fork_within_14_ms s :
  global_run 2 2 (stated_tasks [diamond; fork (ms 14)])
             (stated_policy false [diamond; fork (ms 14)]) s ->
  no_losses s ->
  forall n, job_complete (stated_tasks [diamond; fork (ms 14)]) s
              (release s 1 n + N.to_nat (ms 14)) 1 n.
Proof.
  intros Rules No n. apply (check_sound 2 false _ claims_hold s Rules); [|simpl; lia|reflexivity].
  intros k a Hk _. simpl in Hk. destruct k as [|[|k]]; try lia; apply no_losses_bound, No.
Qed.

(** ** Waits off the path

    On one core, two subtasks of segments that take 2 together, with a wait of 3 between them.  One wait counts, as
    one path has no more: 4 + 3. *)
Definition two_wait (r : N) : claim :=
  {| wcets := [2; 3; 2; 2; 3; 2]%N; shared := Some ([0; 1; 0; 3; 4; 3], [2; 3; 0; 2; 3; 0]%N); wait_list := [1; 4];
     preds := [[]; [0]; [1]; []; [3]; [4]]; minimum_period := 10; relative_deadline := 10; least_deadline := 10;
     outranked_by := []; keeping := false; known_wcets := true; claimed := true; bound := r; loss := 0; width := 1;
     cover := None; parts := 0; part_of := []; free_chains := 0; chain_of := [0; 0; 0; 1; 1; 1]; first_level := 0;
     later_level := 0; costless := false |}.

Example one_wait_counts : check 1 false [two_wait 7] = true /\ check 1 false [two_wait 6] = false.
Proof. vm_compute. auto. Qed.

Example two_wait_together : global_run 1 1 (stated_tasks [two_wait 7]) (stated_policy false [two_wait 7])
  (lap_run (fun _ => 0) (fun _ v => nth v [1; 3; 1; 1; 3; 1] 0) [([(0, 0)], false); ([(0, 1); (0, 3)], false);
    ([(0, 1); (0, 4)], false); ([(0, 1); (0, 4)], false); ([(0, 2); (0, 4)], false); ([(0, 5)], false);
    ([], false); ([], false); ([], false); ([], false)]).
Proof. apply lap_obeys_the_rules. vm_compute. reflexivity. Qed.

(** Where all keep their cores, something of 5 blocks each of two segments, of 1 and 2 around a wait of 3. *)
Definition waits_and_is_blocked (r : N) : list claim := [
  {| wcets := [1; 3; 2]%N; shared := None; wait_list := [1]; preds := [[]; [0]; [1]]; minimum_period := 20;
     relative_deadline := 20; least_deadline := 20; outranked_by := []; keeping := true; known_wcets := true;
     claimed := true; bound := r; loss := 0; width := 1; cover := None; parts := 0; part_of := []; free_chains := 0;
     chain_of := [0; 0; 0]; first_level := 5; later_level := 0; costless := false |};
  {| wcets := [5]%N; shared := None; wait_list := []; preds := [[]]; minimum_period := 20; relative_deadline := 20;
     least_deadline := 20; outranked_by := [0]; keeping := true; known_wcets := true; claimed := false; bound := 0;
     loss := 0; width := 1; cover := None; parts := 0; part_of := []; free_chains := 0; chain_of := [0];
     first_level := 0; later_level := 0; costless := false |}].

Example each_wait_may_be_blocked : check 1 false (waits_and_is_blocked 16) = true /\
  check 1 false (waits_and_is_blocked 15) = false.
Proof. vm_compute. auto. Qed.

(** ** Losses of all cores together

    Two subtasks of 2 ticks on two cores.  Core 0 is lost in the first tick of 10, core 1 in the second: each core by
    itself loses 1 of any 10 ticks, and yet the job is late for the bound with a loss of 1.  What counts are the ticks
    in which *any* core is lost, 2, and with these the bound is refused. *)
Definition two_subtasks (lost : N) : claim :=
  {| wcets := [2; 2]%N; shared := None; wait_list := []; preds := [[]; []];
     minimum_period := 10; relative_deadline := 10; least_deadline := 10;
     outranked_by := []; keeping := false; known_wcets := true; claimed := true; bound := 3; loss := lost;
     width := 2; cover := Some [0; 1]; parts := 2; part_of := [0; 1];
     free_chains := 1; chain_of := [0; 1]; first_level := 0; later_level := 0; costless := false |}.

Definition both_cores_lost : set_run :=
  lap_run (fun _ => 0) (fun _ _ => 2) [
    ([(0, 0)], true); ([(0, 0)], true); ([(0, 1)], false); ([(0, 1)], false); ([], false);
    ([], false); ([], false); ([], false); ([], false); ([], false)].

Example losses_of_any_core :
  check 2 false [two_subtasks 1] = true /\ check 2 false [two_subtasks 2] = false /\
  global_run 1 2 (stated_tasks [two_subtasks 1]) (stated_policy false [two_subtasks 1]) both_cores_lost /\
  count 3 (lost both_cores_lost) = 2 /\
  ~ job_complete (stated_tasks [two_subtasks 1]) both_cores_lost (release both_cores_lost 0 0 + 3) 0 0.
Proof.
  split; [vm_compute; reflexivity|]. split; [vm_compute; reflexivity|].
  split; [apply lap_obeys_the_rules; vm_compute; reflexivity|]. split; [vm_compute; reflexivity|].
  intros C. specialize (C 1 ltac:(cbn; lia)). vm_compute in C. lia.
Qed.

(** ** Statements that no run obeys are refused *)
Definition small (outranked : list nat) (w D least r : N) : claim :=
  {| wcets := [w]; shared := None; wait_list := []; preds := [[]];
     minimum_period := 10; relative_deadline := D; least_deadline := least;
     outranked_by := outranked; keeping := false; known_wcets := true; claimed := true; bound := r; loss := 0;
     width := 1; cover := None; parts := 0; part_of := [0]; free_chains := 0; chain_of := [0];
     first_level := 0; later_level := 0; costless := false |}.

(** Of two DAGs neither may outrank the other; under EDF not both may; a least deadline above the DAG's; a WCET of 0. *)
Example nothing_is_proven_of_nothing : map (fun c => check 1 (fst c) (snd c)) [
    (false, [small [] 3 10 10 3; small [] 3 10 10 3]); (true, [small [] 3 10 10 3; small [0] 3 10 10 6]);
    (true, [small [1] 3 10 99 3; small [0] 3 10 99 3]); (false, [small [] 0 10 10 1])]
  = [false; false; false; false].
Proof. vm_compute. reflexivity. Qed.

Example and_else_accepted : map (fun c => check 1 (fst c) (snd c)) [
    (false, [small [] 3 10 10 3; small [0] 3 10 10 6]); (true, [small [1] 3 10 10 6; small [0] 3 10 10 6])]
  = [true; true].
Proof. vm_compute. reflexivity. Qed.
