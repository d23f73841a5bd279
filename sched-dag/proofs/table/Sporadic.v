(** * A lap at each release: a sporadic DAG (an owner), or several that are released together

    For one DAG the origin of the lap is each release, not a grid, so it may be sporadic (docs/bounds.md, "Tables").
    Here each lap has its own origin; two origins are at least a lap apart. All DAGs of the table have the lap as their period, no offset, and
    one job a lap. As in AnyResolution.v a tick is 1/N of a nanosecond; laps begin at any tick. *)

From Coq Require Import ZArith List Bool Lia.
From Table Require Import Model Sustainable Checker CheckerProof.
Import ListNotations.
Open Scope Z_scope.

(** The table of [w], in ticks, with lap [n] at [origin_of n], and its release at [release_of n]. *)
Definition laps_at (N : Z) (w : witness) (origin_of release_of : nat -> Z) : table :=
  let lap p := (snd p / length (list_of w (fst p)))%nat in {|
  cores := length (w_lists w);
  wcet := fun p => N * cost w (entry_at w p);
  start := fun p => N * e_start (entry_at w p) + origin_of (lap p);
  finish := fun p => N * e_finish (entry_at w p) + origin_of (lap p);
  release := fun p => release_of (lap p);
  depth := fun p => e_depth (entry_at w p);
  before := waits_for w;
  wait := fun p y => N * wait_of w p y
|}.

(** One job of each DAG in a lap. *)
Definition one_job_a_lap (w : witness) : bool :=
  forallb (fun d => (d_period d =? w_lap w) && (d_offset d =? 0)) (w_dags w)
  && forallb (forallb (fun e => e_job e =? 0)) (w_lists w).

Definition check_sporadic (w : witness) : bool := check w && one_job_a_lap w.

Section Sporadic.
Variables (N : Z) (w : witness).
Hypothesis positive : 0 < N.
Hypothesis accepted : check_sporadic w = true.

Let lap (p : place) := (snd p / length (list_of w (fst p)))%nat.

Lemma checked : check w = true.
Proof. pose proof accepted as A. unfold check_sporadic in A. apply andb_prop in A. tauto. Qed.

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

(** Each instance has a place, and is finished in the table within its stated bound. *)
Lemma finish_in_lap : forall d n v, (d < length (w_dags w))%nat -> let g := nth d (w_dags w) no_dag in
  (v < length (d_subtasks g))%nat ->
  exists p, (fst p < length (w_lists w))%nat /\ instance_at w p = (d, Z.of_nat n, v) /\ lap p = n /\
    e_finish (entry_at w p) <= s_bound (nth v (d_subtasks g) no_subtask).
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
  lia.
Qed.

Section Origins.
Variables origin_of release_of : nat -> Z.
Hypothesis apart : forall n, origin_of n + N * w_lap w <= origin_of (S n).

Let tb := laps_at N w origin_of release_of.
Let ahead (n : nat) := origin_of n - Z.of_nat n * (N * w_lap w).

Lemma ahead_grows : forall n m, (n <= m)%nat -> ahead n <= ahead m.
Proof. intros n m H. induction H as [|m H IH]; [lia|]. unfold ahead in *. pose proof (apart m). nia. Qed.

Lemma laps_fit : fits tb.
Proof.
  pose proof (accepted_is_right w checked) as R.
  assert (S0 : forall p, start tb p = N * start (table_of w) p + ahead (lap p)).
  { intros p. unfold ahead, lap. simpl. unfold lap_of. ring. }
  assert (F0 : forall p, finish tb p = N * finish (table_of w) p + ahead (lap p)).
  { intros p. unfold ahead, lap. simpl. unfold lap_of. ring. }
  constructor.
  - intros p Hp. pose proof (wcets _ R p Hp) as H. simpl in H |- *. nia.
  - intros k i Hk. rewrite !S0. pose proof (sorted _ R k i Hk).
    pose proof (ahead_grows _ _ (lap_grows k i (S i) Hk ltac:(lia))). nia.
  - intros k x Hk. destruct (family _ R k x Hk) as (n & (Hin & Hfin) & Hsum). exists n.
    unfold encloses. rewrite !S0, F0.
    pose proof (ahead_grows _ _ (lap_grows k x (S x + n) Hk ltac:(lia))).
    assert (W : forall m i, work tb k i m = N * work (table_of w) k i m).
    { induction m as [|m IH]; intros i; simpl; [ring|]. rewrite IH. simpl. ring. }
    rewrite W. change (wcet tb (k, x)) with (N * wcet (table_of w) (k, x)).
    split; [split; [exact Hin|nia]|nia].
  - intros p y Hy Hb. destruct (precedence _ R p y Hy Hb) as (Hp & Hw & Hf & Hs).
    split; auto. rewrite !S0, F0. change (wait tb p y) with (N * wait (table_of w) p y).
    assert (Hl : (lap p <= lap y)%nat).
    { destruct Hb as (_ & _ & Hj). rewrite !job_is_lap in Hj by auto.
      destruct Hj as [[Hj _]|[Hj _]]; lia. }
    pose proof (ahead_grows _ _ Hl). repeat split; nia.
Qed.

End Origins.

(** **The checker's theorem for sporadic DAGs.** If [check_sporadic] accepts, then wherever the laps begin, a lap apart at least, in
    every run that obeys the rules, with releases at most [late] after the origins of their laps: subtask [v] of DAG [d] in lap
    [n] is finished (or passed, as void) at the latest the stated bound, [late], and what was lost after the lap's origin. *)
Theorem sporadic_bounds_hold : forall origin_of env late s,
  0 <= origin_of O -> (forall n, origin_of n + N * w_lap w <= origin_of (S n)) ->
  let tb := laps_at N w origin_of origin_of in
  0 <= late -> punctual tb env late -> run tb env initial s ->
  forall d n v, (d < length (w_dags w))%nat -> let g := nth d (w_dags w) no_dag in
  (v < length (d_subtasks g))%nat ->
  exists p, (fst p < cores tb)%nat /\ instance_at w p = (d, Z.of_nat n, v) /\ lap p = n /\
    (~ finished s p -> now s <= origin_of n + N * s_bound (nth v (d_subtasks g) no_subtask) + late + lost s).
Proof.
  intros origin_of env late s First Apart tb Hl Hpun Hrun d n v Hd g Hv.
  destruct (finish_in_lap d n v Hd Hv) as (p & Hp & Hi & Hlap & Hf). fold g in Hf.
  exists p. split; auto. split; auto. split; auto. intros Hnf.
  assert (R : right tb).
  { constructor; [apply laps_fit, Apart| |].
    - intros k Hk. pose proof (start_nonneg (k, O) Hk). simpl. rewrite Nat.div_0_l by (apply list_not_empty, Hk). nia.
    - intros q Hq. pose proof (start_nonneg q Hq). simpl. nia. }
  destruct (sustainable tb R env late Hpun Hl s Hrun p Hp) as [_ Hfin].
  specialize (Hfin Hnf). simpl in Hfin. fold (lap p) in Hfin. rewrite Hlap in Hfin. nia.
Qed.

End Sporadic.
