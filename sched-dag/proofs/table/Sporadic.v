(** * A lap at each release: a sporadic DAG (an owner), or several that are released together

    TABLE.md, section 6: for one DAG the origin of the lap is each release, not a grid, so it may be sporadic. Here each lap has
    its own origin; two origins are at least a lap apart. All DAGs of the table have the lap as their period, no offset, and
    one job a lap. *)

From Coq Require Import ZArith List Bool Lia.
From Table Require Import Model Sustainable Checker CheckerProof.
Import ListNotations.
Open Scope Z_scope.

(** The table of [w], with lap [n] at [origin_of n]. *)
Definition table_at (w : witness) (origin_of : nat -> Z) : table :=
  let lap p := (snd p / length (list_of w (fst p)))%nat in {|
  cores := length (w_lists w);
  wcet := fun p => cost w (entry_at w p);
  start := fun p => e_start (entry_at w p) + origin_of (lap p);
  finish := fun p => e_finish (entry_at w p) + origin_of (lap p);
  release := fun p => origin_of (lap p);
  depth := fun p => e_depth (entry_at w p);
  before := waits_for w;
  wait := wait_of w
|}.

(** One job of each DAG in a lap. *)
Definition one_job_a_lap (w : witness) : bool :=
  forallb (fun d => (d_period d =? w_lap w) && (d_offset d =? 0)) (w_dags w)
  && forallb (forallb (fun e => e_job e =? 0)) (w_lists w).

Definition check_sporadic (w : witness) : bool := check w && one_job_a_lap w.

Section Sporadic.
Variable w : witness.
Hypothesis accepted : check_sporadic w = true.
Variable origin_of : nat -> Z.
Hypothesis first_origin : 0 <= origin_of O.
Hypothesis apart : forall n, origin_of n + w_lap w <= origin_of (S n).

Let tb := table_at w origin_of.
Let lap (p : place) := (snd p / length (list_of w (fst p)))%nat.

Lemma checked : check w = true.
Proof. pose proof accepted as A. unfold check_sporadic in A. apply andb_prop in A. tauto. Qed.

(** By how much lap [n] is later than in the periodic table. *)
Let gap (n : nat) : Z := origin_of n - Z.of_nat n * w_lap w.

Lemma gap_grows : forall n m, (n <= m)%nat -> gap n <= gap m.
Proof.
  intros n m Hnm. induction Hnm as [|m Hnm IH]; [lia|].
  pose proof (apart m). unfold gap in *. lia.
Qed.

Lemma start_at : forall p, start tb p = start (table_of w) p + gap (lap p).
Proof. intros p. unfold tb, table_at, table_of, gap, lap, lap_of; simpl. lia. Qed.

Lemma finish_at : forall p, finish tb p = finish (table_of w) p + gap (lap p).
Proof. intros p. unfold tb, table_at, table_of, gap, lap, lap_of; simpl. lia. Qed.

Lemma list_not_empty : forall k, (k < length (w_lists w))%nat -> length (list_of w k) <> O.
Proof.
  intros k Hk. destruct (parts w checked) as (_ & _ & Hl & _). rewrite forallb_forall in Hl.
  specialize (Hl (list_of w k) ltac:(apply nth_In; auto)). destruct (list_of w k); simpl; [discriminate|lia].
Qed.

Lemma lap_grows : forall k i j, (k < length (w_lists w))%nat -> (i <= j)%nat -> (lap (k, i) <= lap (k, j))%nat.
Proof. intros k i j Hk Hij. unfold lap; simpl. apply Nat.div_le_mono; auto. apply list_not_empty; auto. Qed.

Lemma start_nonneg : forall p, (fst p < length (w_lists w))%nat -> 0 <= e_start (entry_at w p).
Proof.
  intros [k n] Hk; simpl in Hk. pose proof (accepted_is_right w checked) as R. pose proof (list_not_empty k Hk) as Hlen.
  pose proof (sorted_from _ R k 0 (n mod length (list_of w k)) Hk) as Hm. pose proof (zero _ R k Hk) as Hz.
  rewrite Nat.add_0_l in Hm.
  assert (E : start (table_of w) (k, (n mod length (list_of w k))%nat) = e_start (entry_at w (k, n))).
  { simpl. unfold entry_at, lap_of; simpl. rewrite Nat.mod_mod by auto.
    rewrite (Nat.div_small (n mod _)) by (apply Nat.mod_upper_bound; auto). simpl. lia. }
  lia.
Qed.

Lemma in_list : forall p, (fst p < length (w_lists w))%nat -> In (entry_at w p) (list_of w (fst p)).
Proof.
  intros p Hp. unfold entry_at. apply nth_In. apply Nat.mod_upper_bound. apply list_not_empty; auto.
Qed.

Lemma job_is_lap : forall p, (fst p < length (w_lists w))%nat -> job_at w p = Z.of_nat (lap p).
Proof.
  intros p Hp. destruct (row_at w checked p Hp) as (Hd & _). destruct (lap_is_jobs w checked _ Hd) as (HT & _ & _ & Hq).
  pose proof accepted as A. unfold check_sporadic, one_job_a_lap in A. rewrite !andb_true_iff, !forallb_forall in A.
  destruct A as (_ & Hdags & Hlists).
  specialize (Hdags _ Hd). rewrite andb_true_iff, !Z.eqb_eq in Hdags.
  specialize (Hlists (list_of w (fst p)) ltac:(apply nth_In; auto)). rewrite forallb_forall in Hlists.
  specialize (Hlists _ (in_list p Hp)). apply Z.eqb_eq in Hlists.
  unfold job_at. rewrite Hlists. unfold lap_of. fold (lap p). nia.
Qed.

Lemma table_at_is_right : right tb.
Proof.
  pose proof (accepted_is_right w checked) as R. constructor.
  - apply (wcets _ R).
  - intros k Hk. rewrite start_at. pose proof (zero _ R k Hk). pose proof (gap_grows 0 (lap (k, O)) ltac:(lia)) as G.
    unfold gap in G at 1. simpl in G. lia.
  - intros k i Hk. rewrite !start_at. pose proof (sorted _ R k i Hk).
    pose proof (gap_grows _ _ (lap_grows k i (S i) Hk ltac:(lia))). lia.
  - intros k x Hk. destruct (family _ R k x Hk) as (n & (Hin & Hfin) & Hsum). exists n.
    rewrite work_is_sum in *. unfold encloses. rewrite !start_at, finish_at.
    pose proof (gap_grows _ _ (lap_grows k x (S x + n) Hk ltac:(lia))).
    split; [split; [exact Hin|lia]|].
    change (sum (fun j => wcet tb (k, j)) (S x) n) with (sum (fun j => wcet (table_of w) (k, j)) (S x) n).
    change (wcet tb (k, x)) with (wcet (table_of w) (k, x)). lia.
  - intros p Hp. pose proof (start_nonneg p Hp). unfold tb; simpl. lia.
  - intros p y Hy Hb. destruct (precedence _ R p y Hy Hb) as (Hp & Hw & Hf & Hs).
    split; auto. split; [exact Hw|]. rewrite !start_at, finish_at. change (wait tb p y) with (wait (table_of w) p y).
    assert (Hl : (lap p <= lap y)%nat).
    { destruct Hb as (_ & _ & Hj). rewrite !job_is_lap in Hj by auto. destruct Hj as [[Hj _]|[Hj _]]; lia. }
    pose proof (gap_grows _ _ Hl). lia.
Qed.

(** Each instance has a place, and is finished in the table within its stated bound. *)
Lemma finish_in_lap : forall d n v, (d < length (w_dags w))%nat -> let g := nth d (w_dags w) no_dag in
  (v < length (d_subtasks g))%nat ->
  exists p, (fst p < cores tb)%nat /\ instance_at w p = (d, Z.of_nat n, v) /\ lap p = n /\
    finish tb p <= origin_of n + s_bound (nth v (d_subtasks g) no_subtask).
Proof.
  intros d n v Hd g Hv.
  destruct (instance_has_place w checked d (Z.of_nat n) v Hd Hv ltac:(lia)) as (p & Hp & Hi).
  exists p. split; auto. split; auto. pose proof (job_is_lap p Hp) as Hj.
  unfold instance_at in Hi. injection Hi as Hi1 Hi2 Hi3. assert (Hlap : lap p = n) by lia. split; auto.
  destruct (row_at w checked p Hp) as (Hin & _ & _ & _ & _ & Hb & _).
  pose proof accepted as A. unfold check_sporadic, one_job_a_lap in A. rewrite !andb_true_iff, !forallb_forall in A.
  destruct A as (_ & Hdags & Hlists). specialize (Hdags _ Hin). rewrite andb_true_iff, !Z.eqb_eq in Hdags.
  specialize (Hlists (list_of w (fst p)) ltac:(apply nth_In; auto)). rewrite forallb_forall in Hlists.
  specialize (Hlists _ (in_list p Hp)). apply Z.eqb_eq in Hlists.
  assert (Hg : dag_of w (entry_at w p) = g) by (unfold dag_of; rewrite Hi1; reflexivity).
  unfold nominal, origin, subtask_of in Hb. rewrite Hlists, (proj2 Hdags), Zmod_0_l in Hb. rewrite Hg, Hi3 in Hb.
  unfold tb, table_at; simpl. fold (lap p). rewrite Hlap. lia.
Qed.

(** **The checker's theorem for sporadic DAGs.** If [check_sporadic] accepts, then wherever the laps begin, a lap apart at least, in
    every run that obeys the rules, with releases at most [late] after the origins of their laps: subtask [v] of DAG [d] in lap
    [n] is finished (or passed, as void) at the latest the stated bound, [late], and what was lost after the lap's origin. *)
Theorem sporadic_bounds_hold : forall env late s,
  0 <= late -> punctual tb env late -> run tb env initial s ->
  forall d n v, (d < length (w_dags w))%nat -> let g := nth d (w_dags w) no_dag in
  (v < length (d_subtasks g))%nat ->
  exists p, (fst p < cores tb)%nat /\ instance_at w p = (d, Z.of_nat n, v) /\ lap p = n /\
    (~ finished s p -> now s <= origin_of n + s_bound (nth v (d_subtasks g) no_subtask) + late + lost s).
Proof.
  intros env late s Hl Hpun Hrun d n v Hd g Hv.
  destruct (finish_in_lap d n v Hd Hv) as (p & Hp & Hi & Hlap & Hf). fold g in Hf.
  exists p. split; auto. split; auto. split; auto. intros Hnf.
  destruct (sustainable tb table_at_is_right env late Hpun Hl s Hrun p Hp) as [_ Hfin]. specialize (Hfin Hnf). lia.
Qed.

End Sporadic.


