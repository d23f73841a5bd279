(** * The judge of sinks with bounds of their own

    For commits of Commit.v.  A sink is shown with all that precedes it, as a part of its job, where the job's own
    bound is shown. *)

Require Import Arith Lia Bool List NArith.
From Bounds Require Import Sums Model TaskSet SetBounds Checker AnyResolution Commit.
Import ListNotations.

(** [own_loss]: if in so many ticks of a window as long as its bound, at most, any core is lost. *)
Record own_claim := { subtask_number : nat; own_bound : N; own_loss : N }.

(** The last segment of a subtask, as a vertex. *)
Definition last_segment (d : dag_statement) (v : nat) : nat :=
  pred (list_sum (map (fun u => length (times u)) (firstn (S v) (subtasks d)))).

Section commit.
Variables (c : commit) (own : list (list own_claim)).  (* by DAG *)

Definition owns (k : nat) : list own_claim := nth k own [].

Definition own_claim_ok (k : nat) (o : own_claim) : bool :=
  let v := last_segment (dag_at c k) (subtask_number o) in
  let ancestors := ancestors (claim_at c true k) in
  let m := machine_cores c in
  (v <? vertices (claim_at c true k)) && (own_bound o <=? claimed_bound (dag_at c k))%N && (0 <? m) &&
  part_ok m (by_due c) (claims_with c (settled c)) k (fun u => (u =? v) || is_ancestor ancestors u v) 0 (fun _ => 1)
    (level c k m) (level c k (m - 1)) (own_bound o) (own_loss o).

(** By DAG whether its bound is shown, and those of all its sinks. *)
Definition judge_sinks : list bool :=
  map (fun k => nth k (judge c) false && forallb (own_claim_ok k) (owns k)) (seq 0 (number c)).

(** *What [judge_sinks] accepts is true: in every run that obeys the rules, the last segment of each such subtask ends
    within the claimed bound,* at any resolution N of time, if losses are no more than charged. *)
Theorem judge_sinks_sound N s : 0 < N ->
  global_run (number c) (machine_cores c) (fun k => finer N (committed c k)) (stated c) s ->
  (forall k a, k < number c -> nth k (judge c) false = true -> count (N * N.to_nat (claimed_bound (dag_at c k)))
     (fun t => lost s (a + t)) <= N * N.to_nat (claimed_loss (dag_at c k))) ->
  (forall k o a, k < number c -> In o (owns k) ->
     count (N * N.to_nat (own_bound o)) (fun t => lost s (a + t)) <= N * N.to_nat (own_loss o)) ->
  forall k, k < number c -> nth k judge_sinks false = true ->
  forall o, In o (owns k) -> forall n,
    job_finished s (release s k n + N * N.to_nat (own_bound o)) k n (last_segment (dag_at c k) (subtask_number o)).
Proof.
  intros HN R L Lo k Hk J o Ho n. unfold judge_sinks in J.
  set (f := fun k => _) in J. rewrite (nth_indep _ false (f 0)) in J by (rewrite map_length, seq_length; exact Hk).
  rewrite map_nth, seq_nth in J by exact Hk. rewrite Nat.add_0_l in J. unfold f in J. clear f.
  apply andb_true_iff in J. destruct J as (J & Ok). rewrite forallb_forall in Ok. specialize (Ok o Ho).
  destruct (judged c N s k J) as (Len & Eq & Ck & R'). specialize (R' R). rewrite Eq in *.
  pose proof (claims_length c (settled c) Len) as K0. rewrite <- K0 in *.
  unfold own_claim_ok in Ok. cbv zeta in Ok. rewrite !andb_true_iff, !Nat.ltb_lt, N.leb_le in Ok.
  destruct Ok as (((Hv & Le) & Hm) & Ok).
  set (claims := claims_with c (settled c)) in *. set (m := machine_cores c) in *.
  assert (Of : claim_of claims k = claim_at c true k) by (unfold claims; rewrite claim_of_commit, J by lia; reflexivity).
  pose proof (check_each m (by_due c) claims Ck) as Each.
  assert (Fine : edges_ok (claim_at c true k) = true /\ ancestors_ok (claim_at c true k) (ancestors (claim_at c true k)) = true /\
    width_ok (claim_at c true k) (ancestors (claim_at c true k)) m = true).
  { specialize (Each k Hk). unfold claim_ok in Each. cbv zeta in Each. rewrite Of in Each.
    rewrite !andb_true_iff in Each. destruct Each as (_ & Each). simpl negb in Each. rewrite orb_false_l in Each.
    rewrite !andb_true_iff in Each. tauto. }
  destruct Fine as (E & A & W). rewrite <- Of in E, A, W.
  apply (part_bounds_in_fractions N HN (length claims) m (stated_tasks claims) (stated_policy (by_due c) claims)
    (fun k => claimed (claim_of claims k)) (fun k => N.to_nat (bound (claim_of claims k)))
    (fun k => N.to_nat (loss (claim_of claims k))) (fun k => width (claim_of claims k))
    (fun k => parts (claim_of claims k)) (fun k => label (part_of (claim_of claims k))) s R')
    with (q := fun u => (u =? last_segment (dag_at c k) (subtask_number o)) || is_ancestor (ancestors (claim_at c true k)) u
                          (last_segment (dag_at c k) (subtask_number o))) (x := N.to_nat (own_loss o)).
  - intros k' a Hk'. unfold claims. rewrite claim_of_commit by lia. intros C. apply L; auto.
  - intros k' Hk'. apply claim_ok_shown, Each, Hk'.
  - exact Hk.
  - rewrite Of. reflexivity.
  - rewrite Of. change (N.to_nat (own_bound o) <= N.to_nat (claimed_bound (dag_at c k))). lia.
  - apply (part_ok_sound m (by_due c) claims k _ 0 (fun _ => 1) (level c k m) (level c k (m - 1))); auto.
    intros u v _ _ _ H. lia.
  - intros a. apply (Lo k o a Hk Ho).
  - unfold stated_tasks. rewrite Of. exact Hv.
  - rewrite Nat.eqb_refl. reflexivity.
Qed.

End commit.
