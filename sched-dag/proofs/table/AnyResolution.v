(** * Times between the ticks

    A table is stated in nanoseconds, and what happens on a machine happens between them. Let a tick be 1/N of a nanosecond:
    then all times of the table are N times as many ticks, and releases are late, and time is lost, by any number of
    ticks. *What is accepted in nanoseconds bounds the runs of every such resolution.* *)

From Coq Require Import ZArith List Bool Lia.
From Table Require Import Model Sustainable Checker CheckerProof.
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
  intros R. constructor; [constructor| |]; simpl.
  - intros p Hp. pose proof (wcets _ R p Hp). apply Z.mul_nonneg_nonneg; lia.
  - intros k i Hk. pose proof (sorted _ R k i Hk). nia.
  - intros k x Hk. destruct (family _ R k x Hk) as (m & (Hin & Hfin) & Hsum). exists m. rewrite work_finer.
    split; [split; [exact Hin|cbn [finer finish start]; nia]|cbn [finer finish start wcet]; nia].
  - intros p y Hy Hb. destruct (precedence _ R p y Hy Hb) as (Hp & Hw & Hf & Hs). repeat split; auto; nia.
  - intros k Hk. pose proof (zero _ R k Hk). apply Z.mul_nonneg_nonneg; lia.
  - intros p Hp. pose proof (ready _ R p Hp). nia.
Qed.

End Finer.

(** **The checker's theorem, for runs of any resolution.** *)
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
