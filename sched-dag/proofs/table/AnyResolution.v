(** * Times between the ticks

    A table is stated in nanoseconds, and what happens on a machine happens between them. Let a tick be 1/N of a nanosecond:
    then all times of the table are N times as many ticks, and releases are late, and time is lost, by any number of
    ticks. *What is accepted in nanoseconds bounds the runs of every such resolution.* *)

From Coq Require Import ZArith List Bool Lia.
From Table Require Import Model Sustainable Checker CheckerProof Sporadic.
Import ListNotations.
Open Scope Z_scope.

Definition finer (n : Z) (tb : table) : table := {|
  cores := cores tb;
  wcet := fun p => n * wcet tb p;
  start := fun p => n * start tb p;
  finish := fun p => n * finish tb p;
  release := fun p => n * release tb p;
  depth := depth tb;
  before := before tb;
  wait := fun p y => n * wait tb p y
|}.

Section Finer.
Variables (n : Z) (tb : table).
Hypothesis positive : 0 < n.

Lemma work_finer : forall k m i, work (finer n tb) k i m = n * work tb k i m.
Proof. intros k m; induction m as [|m IH]; intros i; simpl; [ring|]. rewrite IH. simpl. ring. Qed.

Lemma finer_is_right : right tb -> right (finer n tb).
Proof.
  intros R. constructor; simpl.
  - intros p Hp. pose proof (wcets _ R p Hp). apply Z.mul_nonneg_nonneg; lia.
  - intros k Hk. pose proof (zero _ R k Hk). apply Z.mul_nonneg_nonneg; lia.
  - intros k i Hk. pose proof (sorted _ R k i Hk). nia.
  - intros k x Hk. destruct (family _ R k x Hk) as (m & (Hin & Hfin) & Hsum). exists m. rewrite work_finer.
    split; [split; [exact Hin|cbn [finer finish start]; nia]|cbn [finer finish start wcet]; nia].
  - intros p Hp. pose proof (ready _ R p Hp). nia.
  - intros p y Hy Hb. destruct (precedence _ R p y Hy Hb) as (Hp & Hw & Hf & Hs). repeat split; auto; nia.
Qed.

End Finer.

(** **The checker's theorems, for runs of any resolution.** *)
Theorem accepted_bounds_hold_in_fractions : forall N w env late s, 0 < N -> check w = true ->
  0 <= late -> punctual (finer N (table_of w)) env late -> run (finer N (table_of w)) env initial s ->
  forall d n v, (d < length (w_dags w))%nat -> let g := nth d (w_dags w) no_dag in
  (v < length (d_subtasks g))%nat -> 0 <= n ->
  exists p, (fst p < cores (table_of w))%nat /\ instance_at w p = (d, n + d_offset g / d_period g, v) /\
    (~ finished s p ->
     now s <= N * (d_offset g + n * d_period g + s_bound (nth v (d_subtasks g) no_subtask)) + late + lost s).
Proof.
  intros N w env late s HN A Hl Hpun Hrun d n v Hd g Hv Hn.
  destruct (finish_of_instance w A d n v Hd Hv Hn) as (p & Hp & Hi & Hf). fold g in Hi, Hf.
  exists p. split; auto. split; auto. intros Hnf.
  destruct (sustainable _ (finer_is_right N _ HN (accepted_is_right w A)) env late Hpun Hl s Hrun p Hp) as [_ Hfin].
  specialize (Hfin Hnf). simpl in Hfin, Hf. nia.
Qed.

(** Sporadic laps begin at any tick: [origin_of] counts ticks. *)
Definition finer_at (N : Z) (w : witness) (origin_of : nat -> Z) : table :=
  let lap p := (snd p / length (list_of w (fst p)))%nat in {|
  cores := length (w_lists w);
  wcet := fun p => N * cost w (entry_at w p);
  start := fun p => N * e_start (entry_at w p) + origin_of (lap p);
  finish := fun p => N * e_finish (entry_at w p) + origin_of (lap p);
  release := fun p => origin_of (lap p);
  depth := fun p => e_depth (entry_at w p);
  before := waits_for w;
  wait := fun p y => N * wait_of w p y
|}.

Section Sporadic.
Variables (N : Z) (w : witness) (origin_of : nat -> Z).
Hypothesis positive : 0 < N.
Hypothesis accepted : check_sporadic w = true.
Hypothesis first_origin : 0 <= origin_of O.
Hypothesis apart : forall n, origin_of n + N * w_lap w <= origin_of (S n).

Let lap (p : place) := (snd p / length (list_of w (fst p)))%nat.
Let ahead (n : nat) := origin_of n - Z.of_nat n * (N * w_lap w).

Lemma ahead_grows : forall n m, (n <= m)%nat -> ahead n <= ahead m.
Proof. intros n m H. induction H as [|m H IH]; [lia|]. unfold ahead in *. pose proof (apart m). nia. Qed.

Lemma finer_at_is_right : right (finer_at N w origin_of).
Proof.
  pose proof (accepted_is_right w (checked w accepted)) as R.
  assert (S0 : forall p, start (finer_at N w origin_of) p = N * start (table_of w) p + ahead (lap p)).
  { intros p. unfold ahead, lap. simpl. unfold lap_of. ring. }
  assert (F0 : forall p, finish (finer_at N w origin_of) p = N * finish (table_of w) p + ahead (lap p)).
  { intros p. unfold ahead, lap. simpl. unfold lap_of. ring. }
  constructor.
  - intros p Hp. pose proof (wcets _ R p Hp) as H. simpl in H |- *. nia.
  - intros k Hk. rewrite S0. pose proof (zero _ R k Hk).
    pose proof (ahead_grows 0 (lap (k, O)) ltac:(lia)) as G. unfold ahead in G at 1. simpl in G. nia.
  - intros k i Hk. rewrite !S0. pose proof (sorted _ R k i Hk).
    pose proof (ahead_grows _ _ (lap_grows w accepted k i (S i) Hk ltac:(lia))). unfold lap. nia.
  - intros k x Hk. destruct (family _ R k x Hk) as (n & (Hin & Hfin) & Hsum). exists n.
    unfold encloses. rewrite !S0, F0.
    pose proof (ahead_grows _ _ (lap_grows w accepted k x (S x + n) Hk ltac:(lia))).
    assert (W : forall m i, work (finer_at N w origin_of) k i m = N * work (table_of w) k i m).
    { induction m as [|m IH]; intros i; simpl; [ring|]. rewrite IH. simpl. ring. }
    rewrite W. change (wcet (finer_at N w origin_of) (k, x)) with (N * wcet (table_of w) (k, x)).
    unfold lap. split; [split; [exact Hin|nia]|nia].
  - intros p Hp. pose proof (start_nonneg w accepted p Hp) as H. simpl. nia.
  - intros p y Hy Hb. destruct (precedence _ R p y Hy Hb) as (Hp & Hw & Hf & Hs).
    split; auto. rewrite !S0, F0. change (wait (finer_at N w origin_of) p y) with (N * wait (table_of w) p y).
    assert (Hl : (lap p <= lap y)%nat).
    { destruct Hb as (_ & _ & Hj). rewrite !(job_is_lap w accepted) in Hj by auto.
      unfold lap. destruct Hj as [[Hj _]|[Hj _]]; lia. }
    pose proof (ahead_grows _ _ Hl). repeat split; nia.
Qed.

Theorem sporadic_bounds_hold_in_fractions : forall env late s,
  0 <= late -> punctual (finer_at N w origin_of) env late -> run (finer_at N w origin_of) env initial s ->
  forall d n v, (d < length (w_dags w))%nat -> let g := nth d (w_dags w) no_dag in
  (v < length (d_subtasks g))%nat ->
  exists p, (fst p < cores (table_of w))%nat /\ instance_at w p = (d, Z.of_nat n, v) /\ lap p = n /\
    (~ finished s p -> now s <= origin_of n + N * s_bound (nth v (d_subtasks g) no_subtask) + late + lost s).
Proof.
  intros env late s Hl Hpun Hrun d n v Hd g Hv.
  destruct (finish_in_lap w accepted (fun _ => 0) d n v Hd Hv) as (p & Hp & Hi & Hlap & Hf). fold g in Hf.
  exists p. split; auto. split; auto. split; auto. intros Hnf.
  destruct (sustainable _ finer_at_is_right env late Hpun Hl s Hrun p Hp) as [_ Hfin].
  specialize (Hfin Hnf). simpl in Hfin, Hf. fold (lap p) in Hfin. unfold lap in Hfin. rewrite Hlap in Hfin. nia.
Qed.

End Sporadic.



