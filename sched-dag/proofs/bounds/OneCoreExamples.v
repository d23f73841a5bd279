(** * Examples for one core: runs by keys, and bounds that the checker takes and refuses *)

Require Import Arith Lia Bool List NArith.
From Bounds Require Import Sums Model TaskSet Checker AnyResolution Laps Examples OneCoreStretch OneCore OneCoreOrder
  OneCoreCheck.
Import ListNotations.

(** ** Runs of one lap after the other that obey the keys *)

Section keyed_lap.
Variables (K : nat) (tau : nat -> task) (edf : bool) (key : keys).
Variables (offset : nat -> nat) (ex : nat -> nat -> nat) (table : lap_table).

Definition lap_urgency (k v : nat) : nat := if edf then offset k + key k v else key k v.

Definition lap_before (h w k v : nat) : bool :=
  (lap_urgency h w <? lap_urgency k v) ||
  (lap_urgency h w =? lap_urgency k v) && ((h <? k) || (h =? k) && (number key h w <? number key k v)).

Definition keyed_vertex_ok (u k v : nat) : bool :=
  if ready_in tau offset ex table u k v && negb (on table u k v) && negb (waits (tau k) v) then
    (lost_in table u ||
     existsb (fun h => existsb (fun w => on table u h w && negb (waits (tau h) w) &&
       (lap_before h w k v || keeps (tau h) w && begun_in table u h w)) (vs tau h)) (seq 0 K)) &&
    all_on K tau table u (fun h w => begun_in table u h w || lap_before h w k v)
  else true.

Definition keyed_lap_ok : bool :=
  lap_ok K 1 tau any_order offset ex table &&
  forallb (fun u => forallb (fun k => forallb (keyed_vertex_ok u k) (vs tau k)) (seq 0 K)) (seq 0 (lap table)).

Lemma lap_before_goes t h w k v : lap_before h w k v = true ->
  goes_before edf key (lap_run offset ex table) h (t / lap table) w k (t / lap table) v = true.
Proof.
  unfold lap_before, lap_urgency, goes_before, job_before, urgency. cbn [lap_run release]. cbv zeta.
  destruct edf; repeat first [rewrite orb_true_iff | rewrite andb_true_iff | rewrite Nat.ltb_lt | rewrite Nat.eqb_eq];
    lia.
Qed.

Lemma keyed_lap_obeys : (forall k, k < K -> regular (tau k) = true) -> keyed_lap_ok = true -> keyed_run K tau edf key (lap_run offset ex table).
Proof.
  intros Reg. unfold keyed_lap_ok. rewrite andb_true_iff. intros (Ok & Keys).
  pose proof (lap_obeys_the_rules K 1 tau any_order offset ex table Ok) as Plain.
  assert (At : forall t k n v, k < K -> waits (tau k) v = false ->
    instance_ready tau (lap_run offset ex table) t k n v -> executes (lap_run offset ex table) t k n v = false ->
    0 < lap table /\ n = t / lap table /\
    (lost_in table (t mod lap table) ||
     existsb (fun h => existsb (fun w => on table (t mod lap table) h w && negb (waits (tau h) w) &&
       (lap_before h w k v || keeps (tau h) w && begun_in table (t mod lap table) h w)) (vs tau h)) (seq 0 K)) = true /\
    all_on K tau table (t mod lap table)
      (fun h w => begun_in table (t mod lap table) h w || lap_before h w k v) = true).
  { intros t k n v Hk W Rd Nx. destruct (positive K 1 tau any_order offset ex table Ok k Hk) as (L & _).
    destruct (ready_now K 1 tau any_order offset ex table Ok t k n v Hk Rd) as (-> & Hv & Ri).
    destruct (the_tick table t L) as (Lt & _).
    rewrite forallb_forall in Keys. specialize (Keys (t mod lap table) ltac:(apply in_seq; lia)).
    rewrite forallb_forall in Keys. specialize (Keys k ltac:(apply in_seq; lia)).
    rewrite forallb_forall in Keys. specialize (Keys v ltac:(apply in_seq; lia)).
    rewrite executes_in in Nx by exact L.
    unfold keyed_vertex_ok in Keys. rewrite Ri, Nx, W in Keys. cbn [negb andb] in Keys.
    apply andb_true_iff in Keys. auto. }
  constructor; [exact Plain|exact Reg| |].
  - intros t k n v Hk W _ Lo Rd Nx. destruct (At t k n v Hk W Rd Nx) as (L & -> & A & _).
    cbn [lap_run lost] in Lo. rewrite Lo in A. cbn [orb] in A.
    apply existsb_exists in A. destruct A as (h & Hh & A). apply in_seq in Hh.
    apply existsb_exists in A. destruct A as (w & Hw & A). apply in_seq in Hw.
    rewrite !andb_true_iff, negb_true_iff, orb_true_iff in A. destruct A as ((On & Ww) & B).
    exists h, (t / lap table), w. split; [lia|]. split; [lia|]. split; [exact Ww|].
    split; [rewrite executes_in by exact L; exact On|].
    destruct B as [B|B]; [left; apply lap_before_goes, B|right].
    apply andb_true_iff in B. rewrite begun_now by exact L. exact B.
  - intros t k n v Hk W _ Rd Nx h n' w Hh Hw Ww Bg Ex. destruct (At t k n v Hk W Rd Nx) as (L & -> & _ & A).
    destruct (executes_now offset ex table t h n' w L Ex) as (-> & On).
    rewrite begun_now in Bg by exact L.
    pose proof (all_on_true K tau table (t mod lap table) _ h w A Hh Hw Ww On) as B. cbv beta in B.
    rewrite Bg in B. apply lap_before_goes, B.
Qed.

End keyed_lap.

(** Every 12 ticks under EDF: DAG 2, 3 ticks and due after 12, begins and keeps the core; a tick later DAG 0, a fork of
    three subtasks due after 6, and DAG 1, 2 ticks due after 10, are released. *)
Definition by_deadlines : keys := {| urgent := fun k _ => nth k [6; 10; 12] 0; number := fun _ v => v |}.

Definition three_on_one (k : nat) : task := nth k [
  simple_task [(0, 1); (0, 2)] [1; 1; 1] [] false 12 6;
  simple_task [] [2] [] false 12 10;
  simple_task [] [3] [] true 12 12] (simple_task [] [] [] false 1 1).

Definition one_is_blocked : set_run :=
  lap_run (fun k => nth k [1; 1; 0] 0) (fun k v => wcet (three_on_one k) v) [
    ([(2, 0)], false); ([(2, 0)], false); ([(2, 0)], false); ([(0, 0)], false); ([(0, 1)], false);
    ([(0, 2)], false); ([(1, 0)], false); ([(1, 0)], false); ([], false); ([], false); ([], false); ([], false)].

Example blocked_run_obeys : keyed_run 3 three_on_one true by_deadlines one_is_blocked.
Proof. apply keyed_lap_obeys; [intros [|[|[|k]]] Hk; [reflexivity..|lia]|vm_compute; reflexivity]. Qed.

(** DAG 1 begins, is preempted by DAG 0, which loses a tick, and goes on after it; DAG 2 is last. *)
Definition one_is_preempted : set_run :=
  lap_run (fun k => nth k [1; 0; 1] 0) (fun k v => wcet (three_on_one k) v) [
    ([(1, 0)], false); ([(0, 0)], false); ([], true); ([(0, 1)], false); ([(0, 2)], false); ([(1, 0)], false);
    ([(2, 0)], false); ([(2, 0)], false); ([(2, 0)], false); ([], false); ([], false); ([], false)].

Example preempted_run_obeys : keyed_run 3 three_on_one true by_deadlines one_is_preempted.
Proof. apply keyed_lap_obeys; [intros [|[|[|k]]] Hk; [reflexivity..|lia]|vm_compute; reflexivity]. Qed.

(** With the two subtasks of the fork exchanged, or DAG 2 let in before DAG 0, a run does not obey. *)
Example wrong_orders_are_told :
  keyed_lap_ok 3 three_on_one true by_deadlines (fun k => nth k [1; 0; 1] 0) (fun k v => wcet (three_on_one k) v) [
    ([(1, 0)], false); ([(0, 0)], false); ([], true); ([(0, 2)], false); ([(0, 1)], false); ([(1, 0)], false);
    ([(2, 0)], false); ([(2, 0)], false); ([(2, 0)], false); ([], false); ([], false); ([], false)] = false /\
  keyed_lap_ok 3 three_on_one true by_deadlines (fun k => nth k [1; 0; 1] 0) (fun k v => wcet (three_on_one k) v) [
    ([(1, 0)], false); ([(2, 0)], false); ([(2, 0)], false); ([(2, 0)], false); ([(0, 0)], false); ([(0, 1)], false);
    ([(0, 2)], false); ([(1, 0)], false); ([], false); ([], false); ([], false); ([], false)] = false.
Proof. vm_compute. auto. Qed.

(** ** Bounds *)

Definition core_dag (works : list N) (before : list (list nat)) (key : N) (keep : bool) (gap : N)
  (r busy : N) (ps : list (N * list N)) : core_claim :=
  {| of_dag :=
       {| wcets := works; shared := None; wait_list := []; preds := before; minimum_period := gap; relative_deadline := key;
          least_deadline := key; outranked_by := []; keeping := keep; known_wcets := true; claimed := true; bound := r;
          loss := 0; width := 1; cover := None; parts := 0; part_of := []; free_chains := 0; chain_of := [];
          first_level := 0; later_level := 0; costless := false |};
     key_at := fun _ => key; number_at := fun v => v; keeps_at := fun _ => keep; least_urgent := 0;
     longest_stretch := busy; points := ps; sinks := [] |}.

(** The DAGs of the runs: DAG 0 is blocked for 3 at most, by what has begun before it.  Its job in
    [one_is_blocked] takes 5 ticks, and 6 - 1/N if a tick is 1/N. *)
Definition of_three (r0 r1 r2 : N) : list core_claim := [
  core_dag [1; 1; 1]%N [[]; [0]; [0]] 6 false 12 r0 11 [(0, [3; 6]); (5, [5; 8])]%N;
  core_dag [2]%N [[]] 10 false 12 r1 11 [(0, [5; 8]); (3, [8])]%N;
  core_dag [3]%N [[]] 12 true 12 r2 8 [(0, [8])]%N].

Example three_hold : one_core_check true [] (of_three 6 8 8) = true.
Proof. vm_compute. reflexivity. Qed.

Example each_is_the_least :
  one_core_check true [] (of_three 5 8 8) = false /\ one_core_check true [] (of_three 6 7 8) = false /\
  one_core_check true [] (of_three 6 8 7) = false.
Proof. vm_compute. auto. Qed.

Example five_ticks :
  ~ job_complete three_on_one one_is_blocked (release one_is_blocked 0 0 + 4) 0 0 /\
  job_complete three_on_one one_is_blocked (release one_is_blocked 0 0 + 5) 0 0.
Proof.
  split.
  - intros C. specialize (C 2 ltac:(simpl; lia)). vm_compute in C. lia.
  - intros [|[|[|v]]] Hv; [vm_compute; lia..|simpl in Hv; lia].
Qed.

(** [edf 4,49,24 2,7,6 5,15,10 -> 13 2 7] of the oracle's `one_core_lines.txt`: where ties counted against the DAG
    with the smaller number, the second bound would be 3. *)
Definition tie (r : N) : list core_claim := [
  core_dag [4]%N [[]] 24 false 49 13 13 [(0, [13])]%N;
  core_dag [2]%N [[]] 6 false 7 r 13 [(0, [2]); (5, [7]); (7, [9])]%N;
  core_dag [5]%N [[]] 10 false 15 7 13 [(0, [7]); (3, [7])]%N].

Example tie_holds : one_core_check true [] (tie 2) = true /\ one_core_check true [] (tie 1) = false.
Proof. vm_compute. auto. Qed.

(** [npfp 2,6 1,7 3,14 2,18]: static priorities, and all keep the core.  In ns, times 10^6. *)
Definition all_keep (r : N) : list core_claim := [
  core_dag (map ms [2]%N) [[]] 0 true (ms 6) (ms 5) (ms 5) [(0%N, map ms [5]%N)];
  core_dag (map ms [1]%N) [[]] 1 true (ms 7) (ms 6) (ms 6) [(0%N, map ms [6]%N)];
  core_dag (map ms [3]%N) [[]] 2 true (ms 14) r (ms 11) [(0%N, map ms [8]%N)];
  core_dag (map ms [2]%N) [[]] 3 true (ms 18) (ms 11) (ms 11) [(0%N, map ms [11]%N)]].

Example all_keep_hold :
  one_core_check false [] (all_keep (ms 8)) = true /\ one_core_check false [] (all_keep (ms 8 - 1)) = false.
Proof. vm_compute. auto. Qed.

(** What that proves, in full. *)
Example third_within_8_ms : forall N s, 0 < N ->
  keyed_run 4 (fun k => finer N (core_tasks (all_keep (ms 8)) k)) false
    (finer_key N false (core_keys (all_keep (ms 8)))) s ->
  (forall a x, count (N * x) (fun t => lost s (a + t)) <= N * losses [] x) ->
  forall n, job_complete (fun k => finer N (core_tasks (all_keep (ms 8)) k)) s
    (release s 2 n + N * N.to_nat 8000000) 2 n.
Proof.
  intros N s HN Rules Losses.
  apply (one_core_check_sound false [] (all_keep (ms 8)) N s); [|vm_compute; reflexivity].
  constructor; auto. discriminate.
Qed.

(** The second job of a stretch may be the worst one (R. Davis et al. 2007): of DAG 2 the first one takes 5, the next
    one 6.  So no distance may be left out. *)
Definition second_is_worst (r : N) (ps : list (N * list N)) : list core_claim := [
  core_dag [1]%N [[]] 0 true 7 3 12 [(0, [3])]%N;
  core_dag [2]%N [[]] 1 true 4 5 12 [(0, [5])]%N;
  core_dag [2]%N [[]] 2 true 6 r 12 ps].

Example second_job_counts :
  core_claim_ok false [] (second_is_worst 6 [(0, [5]); (6, [12])]%N) 2 = true /\
  core_claim_ok false [] (second_is_worst 5 [(0, [5]); (6, [12])]%N) 2 = false /\
  core_claim_ok false [] (second_is_worst 5 [(0, [5])]%N) 2 = false.
Proof. vm_compute. auto. Qed.

(** Sporadic releases, and sinks whose deadlines differ by more than the period.  DAG 0 has a sink of 1 due after 5
  and one
    of 4 due after 22, every 10; DAG 1 takes 16, due after 21.  DAG 0 is released at 0 and 17, DAG 1 at 0: at 17
    the second sink of the first job waits, is due at 22, as the first sink of the next job is, and goes first, till 21.
    So that takes 5.  Where earlier jobs are counted at multiples of the period only, the bound is 3. *)
Definition far_deadlines (r : N) : list core_claim := [
  {| of_dag := of_dag (core_dag [1; 4]%N [[]; []] 22 false 10 22 36 []);
     key_at := fun v => nth v [5; 22]%N 0%N; number_at := fun v => v; keeps_at := fun _ => false; least_urgent := 0;
     longest_stretch := 36; points := [];
     sinks := [{| sink := 0; sink_bound := r; sink_stretch := 36;
       sink_points := [(0, [1]); (10, [2]); (17, [22]); (20, [23]); (27, [28]); (30, [29])]%N |}] |};
  core_dag [16]%N [[]] 21 false 1000 21 36 []].

Example far_deadlines_count :
  core_sinks_ok true [] (far_deadlines 5) 0 = [true] /\ core_sinks_ok true [] (far_deadlines 4) 0 = [false].
Proof. vm_compute. auto. Qed.
