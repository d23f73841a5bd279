(** * Runs that repeat: a table of one lap, and a function that says whether it obeys the rules

    The theorems speak of all runs that obey [global_run].  Here such runs are *computed*: each DAG has one job in
    each lap, all laps are alike, and [lap_ok] looks at one of them.  Examples.v has the tables. *)

Require Import Arith Lia Bool List.
From Bounds Require Import Sums Model TaskSet.
Import ListNotations.

(** By tick of a lap: what executes (DAG and vertex), waits that go on among it, and whether cores are lost. *)
Definition lap_table := list (list (nat * nat) * bool).

Section lap.
Variables (K m : nat) (tau : nat -> task) (pol : policy).
Variables (offset : nat -> nat) (ex : nat -> nat -> nat) (table : lap_table).

Definition lap : nat := length table.
Definition on (u k v : nat) : bool :=
  existsb (fun p => (fst p =? k) && (snd p =? v)) (fst (nth u table ([], false))).
Definition lost_in (u : nat) : bool := snd (nth u table ([], false)).

Definition lap_run : set_run := {|
  release := fun k n => lap * n + offset k;
  job_exec := fun k _ v => ex k v;
  executes := fun t k n v => (lap * n <=? t) && on (t - lap * n) k v;
  lost := fun t => lost_in (t mod lap)
|}.

(** ** One lap *)

Definition done_in (u k v : nat) : nat := count u (fun i => on i k v).
Definition over (u k v : nat) : bool := ex k v <=? done_in u k v.
Definition vs (k : nat) : list nat := seq 0 (size (graph (tau k))).
Definition ready_in (u k v : nat) : bool :=
  (offset k <=? u) && negb (over u k v)
  && forallb (fun w => negb (precedes_bool (graph (tau k)) w v) || over u k w) (vs k).
Definition begun_in (u k v : nat) : bool := 0 <? done_in u k v.
Definition held_in (u k v : nat) : bool :=
  on u k v || keeps (tau k) v && begun_in u k v && (done_in u k v <? ex k v).
Definition pass_in (k h : nat) : bool :=
  (h =? k) || outranks pol h k &&
    (negb (by_deadline pol) || (offset h + first_deadline (tau h) <=? offset k + deadline (tau k))).
Definition cores_by (f : nat -> nat -> bool) : nat :=
  sum K (fun k => count (size (graph (tau k))) (fun v => on_core tau k v && f k v)).

(** All that executes on a core in tick u has a property. *)
Definition all_on (u : nat) (p : nat -> nat -> bool) : bool :=
  forallb (fun h => forallb (fun w => waits (tau h) w || negb (on u h w) || p h w) (vs h)) (seq 0 K).

Definition vertex_ok (u k v : nat) : bool :=
  (negb (on u k v) || ready_in u k v) &&
  (negb (regular (tau k)) || negb (ready_in u k v) || on u k v ||
   negb (waits (tau k) v) &&
   (lost_in u || (cores_by (on u) =? m) && all_on u (fun h w => pass_in k h || keeps (tau h) w)) &&
   (begun_in u k v ||
    all_on u (fun h w => negb (keeps (tau h) w) || begun_in u h w || pass_in k h))) &&
  (waits (tau k) v || negb (keeps (tau k) v) || lost_in u || negb (begun_in u k v) || over u k v || on u k v).

Definition dag_ok (k : nat) : bool :=
  (0 <? period (tau k)) && (period (tau k) <=? lap) && (offset k <? lap) &&
  forallb (fun v => (waits (tau k) v || negb (regular (tau k)) || (0 <? ex k v)) && (negb (known (tau k)) || (ex k v <=? wcet (tau k) v))
                    && over lap k v) (vs k) &&
  (negb (known (tau k)) || forallb (fun v =>
     sum (size (graph (tau k))) (fun u => if head (tau k) u =? v then ex k u else 0) <=? together (tau k) v) (vs k)).

Definition lap_ok : bool :=
  forallb dag_ok (seq 0 K) &&
  forallb (fun u => (cores_by (held_in u) <=? m) &&
                    forallb (fun k => forallb (vertex_ok u k) (vs k)) (seq 0 K)) (seq 0 lap).

(** ** All laps *)

Lemma on_late u k v : lap <= u -> on u k v = false.
Proof. intros H. unfold on. rewrite nth_overflow; auto. Qed.

Lemma lap_done t k n v : job_done lap_run t k n v = done_in (t - lap * n) k v.
Proof.
  unfold job_done, done_in, count. cbn [lap_run executes]. destruct (le_lt_dec (lap * n) t) as [H|H].
  - replace t with (lap * n + (t - lap * n)) at 1 by lia. rewrite sum_shift, sum_zero.
    + apply sum_ext. intros i _. destruct (Nat.leb_spec (lap * n) (lap * n + i)); [|lia].
      replace (lap * n + i - lap * n) with i by lia. reflexivity.
    + intros i Hi. destruct (Nat.leb_spec (lap * n) i); [lia|reflexivity].
  - replace (t - lap * n) with 0 by lia. apply sum_zero. intros i Hi.
    destruct (Nat.leb_spec (lap * n) i); [lia|reflexivity].
Qed.

Lemma lap_finished t k n v : job_finished lap_run t k n v <-> over (t - lap * n) k v = true.
Proof. unfold job_finished, over. rewrite lap_done, Nat.leb_le. reflexivity. Qed.

Hypothesis ok : lap_ok = true.

Lemma dags k : k < K -> dag_ok k = true.
Proof.
  intros Hk. unfold lap_ok in ok. apply andb_true_iff in ok. destruct ok as (D & _).
  rewrite forallb_forall in D. apply D, in_seq. lia.
Qed.

Lemma ticks u : u < lap -> cores_by (held_in u) <= m /\
  forall k v, k < K -> v < size (graph (tau k)) -> vertex_ok u k v = true.
Proof.
  intros Hu. unfold lap_ok in ok. apply andb_true_iff in ok. destruct ok as (_ & T).
  rewrite forallb_forall in T. specialize (T u ltac:(apply in_seq; lia)).
  apply andb_true_iff in T. rewrite Nat.leb_le, forallb_forall in T. destruct T as (C & T). split; auto.
  intros k v Hk Hv. specialize (T k ltac:(apply in_seq; lia)). rewrite forallb_forall in T.
  apply T, in_seq. lia.
Qed.

Lemma vertices_of k v : k < K -> v < size (graph (tau k)) ->
  (waits (tau k) v || negb (regular (tau k)) || (0 <? ex k v)) = true /\ (negb (known (tau k)) || (ex k v <=? wcet (tau k) v)) = true /\
  forall u, lap <= u -> over u k v = true.
Proof.
  intros Hk Hv. pose proof (dags k Hk) as D. unfold dag_ok in D. apply andb_true_iff in D. destruct D as (D & _).
  apply andb_true_iff in D. destruct D as (_ & D). rewrite forallb_forall in D. specialize (D v ltac:(apply in_seq; lia)). rewrite !andb_true_iff in D.
  destruct D as ((D1 & D2) & D3). repeat (split; auto). intros u Hu. unfold over in *.
  apply Nat.leb_le in D3. apply Nat.leb_le.
  pose proof (sum_more lap u (fun i => Nat.b2n (on i k v)) Hu). unfold done_in, count in *. lia.
Qed.

(** Tick t of a run is tick [t mod lap] of the lap [t / lap], and only that lap's jobs are there. *)
Lemma the_tick t : 0 < lap -> t mod lap < lap /\ t - lap * (t / lap) = t mod lap /\ lap * (t / lap) <= t /\
  forall n, lap * n <= t -> n <> t / lap -> lap <= t - lap * n.
Proof.
  intros L. pose proof (Nat.div_mod t lap ltac:(lia)) as D. pose proof (Nat.mod_upper_bound t lap ltac:(lia)).
  repeat (split; try lia). intros n Hn Ne. destruct (le_lt_dec (S n) (t / lap)) as [H1|H1]; [nia|].
  assert (S (t / lap) <= n) by lia. nia.
Qed.

Lemma positive k : k < K -> 0 < lap /\ 0 < period (tau k) /\ period (tau k) <= lap.
Proof.
  intros Hk. pose proof (dags k Hk) as D. unfold dag_ok in D. rewrite !andb_true_iff, Nat.ltb_lt, Nat.leb_le in D. lia.
Qed.

Lemma executes_now t k n v : 0 < lap -> executes lap_run t k n v = true ->
  n = t / lap /\ on (t mod lap) k v = true.
Proof.
  intros L E. cbn [lap_run executes] in E. apply andb_true_iff in E. rewrite Nat.leb_le in E. destruct E as (H & E).
  destruct (the_tick t L) as (_ & Eq & _ & Far). destruct (Nat.eq_dec n (t / lap)) as [->|Ne].
  - rewrite Eq in E. auto.
  - rewrite on_late in E; [discriminate|]. apply Far; auto.
Qed.

Lemma executes_in t k v : 0 < lap -> executes lap_run t k (t / lap) v = on (t mod lap) k v.
Proof.
  intros L. destruct (the_tick t L) as (_ & Eq & Le & _). cbn [lap_run executes]. rewrite Eq.
  destruct (Nat.leb_spec (lap * (t / lap)) t); [reflexivity|lia].
Qed.

Lemma earlier t k n v : k < K -> v < size (graph (tau k)) -> n < t / lap -> job_finished lap_run t k n v.
Proof.
  intros Hk Hv Hn. destruct (positive k Hk) as (L & _). destruct (the_tick t L) as (_ & _ & Le & Far).
  apply lap_finished. apply (vertices_of k v Hk Hv). apply Far; nia.
Qed.

Lemma ready_now t k n v : k < K -> instance_ready tau lap_run t k n v ->
  n = t / lap /\ v < size (graph (tau k)) /\ ready_in (t mod lap) k v = true.
Proof.
  intros Hk (Hv & Rel & Nf & P & _). destruct (positive k Hk) as (L & _).
  destruct (the_tick t L) as (_ & Eq & _ & Far). cbn [lap_run release] in Rel.
  assert (n = t / lap) as ->.
  { destruct (Nat.eq_dec n (t / lap)); auto. exfalso. apply Nf, lap_finished, (vertices_of k v Hk Hv).
    apply Far; auto. lia. }
  split; auto. split; auto. rewrite lap_finished, Eq in Nf. unfold ready_in. rewrite !andb_true_iff, Nat.leb_le.
  split; [split; [lia|destruct (over (t mod lap) k v); auto]|].
  apply forallb_forall. intros w _. destruct (precedes_bool (graph (tau k)) w v) eqn:E; auto. simpl.
  apply precedes_bool_true in E. specialize (P w E). rewrite lap_finished, Eq in P. exact P.
Qed.

Lemma begun_now t k v : 0 < lap -> has_begun lap_run t k (t / lap) v = begun_in (t mod lap) k v.
Proof. intros L. unfold has_begun, begun_in. rewrite lap_done. destruct (the_tick t L) as (_ & -> & _). reflexivity. Qed.

Lemma one_job t k f : 0 < lap -> (forall n v, n <> t / lap -> v < size (graph (tau k)) -> f n v = false) ->
  sum (S t) (fun n => count (size (graph (tau k))) (f n)) = count (size (graph (tau k))) (f (t / lap)).
Proof.
  intros L Z. apply (sum_only (S t) (fun n => count (size (graph (tau k))) (f n))).
  - destruct (the_tick t L) as (_ & _ & Le & _). nia.
  - intros n _ Ne. apply sum_zero. intros v Hv. rewrite Z; auto.
Qed.

Lemma cores_now t : 0 < lap -> sum K (task_cores tau lap_run t) = cores_by (on (t mod lap)).
Proof.
  intros L. apply sum_ext. intros k Hk. unfold task_cores, job_cores. rewrite one_job; auto.
  - apply sum_ext. intros v _. rewrite executes_in; auto.
  - intros n v Ne _. destruct (executes lap_run t k n v) eqn:E; [|apply andb_false_r].
    apply executes_now in E; tauto.
Qed.

Lemma held_now t : 0 < lap -> sum K (cores_held tau lap_run t) = cores_by (held_in (t mod lap)).
Proof.
  intros L. apply sum_ext. intros k Hk. destruct (the_tick t L) as (_ & Eq & Le & _).
  unfold cores_held. rewrite one_job; auto.
  - apply sum_ext. intros v _. unfold holds_core, held_in. rewrite executes_in, begun_now, lap_done, Eq; auto.
  - intros n v Ne Hv. unfold holds_core. destruct (executes lap_run t k n v) eqn:E.
    { apply executes_now in E; tauto. }
    unfold has_begun. rewrite lap_done. cbn [lap_run job_exec].
    destruct (le_lt_dec (t / lap) n) as [H|H].
    + replace (t - lap * n) with 0 by (pose proof (Nat.div_mod t lap ltac:(lia));
        pose proof (Nat.mod_upper_bound t lap ltac:(lia)); nia).
      unfold done_in, count. simpl. rewrite !andb_false_r. reflexivity.
    + pose proof (earlier t k n v Hk Hv H) as F. apply lap_finished in F. unfold over in F. apply Nat.leb_le in F.
      destruct (Nat.ltb_spec (done_in (t - lap * n) k v) (ex k v)); [lia|]. rewrite !andb_false_r. reflexivity.
Qed.

Lemma all_on_true u p h w : all_on u p = true -> h < K -> w < size (graph (tau h)) ->
  waits (tau h) w = false -> on u h w = true -> p h w = true.
Proof.
  unfold all_on. rewrite forallb_forall. intros A Hh Hw W O. specialize (A h ltac:(apply in_seq; lia)).
  rewrite forallb_forall in A. specialize (A w ltac:(apply in_seq; lia)). rewrite W, O in A. exact A.
Qed.

Lemma pass_now k h n : pass_in k h = true -> may_pass tau pol lap_run k n h n.
Proof.
  unfold pass_in, may_pass, may_delay. rewrite orb_true_iff, Nat.eqb_eq. intros [->|P]; [auto|right].
  rewrite andb_true_iff in *. destruct P as (O & P). split; auto. apply orb_true_iff in P. apply orb_true_iff.
  destruct P as [P|P]; [auto|right]. apply Nat.leb_le in P. apply Nat.leb_le. cbn [lap_run release]. lia.
Qed.

Theorem lap_obeys_the_rules : global_run K m tau pol lap_run.
Proof.
  constructor.
  - intros k Hk. apply (positive k Hk).
  - intros k n Hk. destruct (positive k Hk) as (_ & _ & P). cbn [lap_run release]. rewrite Nat.mul_succ_r. lia.
  - intros k n v Hk Hv. destruct (vertices_of k v Hk Hv) as (E & W & _). cbn [lap_run job_exec]. split.
    + intros Wt Rg. rewrite Wt, Rg in E. apply Nat.ltb_lt, E.
    + intros Kn. rewrite Kn in W. apply Nat.leb_le, W.
  - intros k n v Hk Hv Kn. pose proof (dags k Hk) as D. unfold dag_ok in D. apply andb_true_iff in D. destruct D as (_ & D).
    rewrite Kn in D. simpl in D. rewrite forallb_forall in D. apply Nat.leb_le, D, in_seq. lia.
  - intros t k n v Hk Hv E. destruct (positive k Hk) as (L & _). destruct (the_tick t L) as (Lt & Eq & Le & _).
    apply executes_now in E; auto. destruct E as (-> & O).
    destruct (ticks (t mod lap) Lt) as (_ & V). specialize (V k v Hk Hv). unfold vertex_ok in V.
    rewrite O in V. rewrite !andb_true_iff in V. destruct V as ((R & _) & _). simpl in R.
    unfold ready_in in R. rewrite !andb_true_iff, Nat.leb_le, negb_true_iff in R. destruct R as ((Rel & Nf) & P).
    split; [exact Hv|]. split; [cbn [lap_run release]; lia|]. split; [rewrite lap_finished, Eq; congruence|]. split.
    + intros w Pw. rewrite lap_finished, Eq. rewrite forallb_forall in P. pose proof (precedes_up _ _ _ Pw).
      specialize (P w ltac:(apply in_seq; lia)). apply precedes_bool_true in Pw. rewrite Pw in P. exact P.
    + intros n' Hn. apply earlier; auto.
  - intros t. destruct K as [|K'] eqn:EK; [simpl; lia|]. destruct (positive 0 ltac:(lia)) as (L & _).
    rewrite <- EK, held_now; auto. apply ticks. apply (the_tick t L).
  - intros t k n v Hk Rg W Lo R _ E. destruct (positive k Hk) as (L & _). destruct (the_tick t L) as (Lt & _).
    destruct (ready_now t k n v Hk R) as (-> & Hv & Ri). rewrite executes_in in E; auto.
    destruct (ticks (t mod lap) Lt) as (_ & V). specialize (V k v Hk Hv). unfold vertex_ok in V.
    change (lost_in (t mod lap) = false) in Lo. rewrite Rg, E, Ri, W, Lo in V. simpl in V.
    apply andb_true_iff in V. destruct V as (V & _). apply andb_true_iff in V. destruct V as (V & _).
    apply andb_true_iff in V. rewrite Nat.eqb_eq in V. destruct V as (C & A).
    rewrite cores_now; auto. split; auto. intros h n' w Hh Hw Ww Ex. apply executes_now in Ex; auto.
    destruct Ex as (-> & O). pose proof (all_on_true _ _ h w A Hh Hw Ww O) as P. cbv beta in P.
    apply orb_true_iff in P. destruct P as [P|P]; [left; apply pass_now, P|auto].
  - intros t k n v Hk Rg W R _ Nb E h n' w Hh Hw Ww Kw Nbw Ex. destruct (positive k Hk) as (L & _).
    destruct (the_tick t L) as (Lt & _). destruct (ready_now t k n v Hk R) as (-> & Hv & Ri).
    rewrite executes_in in E; auto. rewrite begun_now in Nb; auto.
    apply executes_now in Ex; auto. destruct Ex as (-> & O). rewrite begun_now in Nbw; auto.
    destruct (ticks (t mod lap) Lt) as (_ & V). specialize (V k v Hk Hv). unfold vertex_ok in V.
    rewrite Rg, E, Ri, W, Nb in V. simpl in V. apply andb_true_iff in V. destruct V as (V & _). apply andb_true_iff in V. destruct V as (_ & A).
    pose proof (all_on_true _ _ h w A Hh Hw Ww O) as P. cbv beta in P. rewrite Kw, Nbw in P. apply pass_now, P.
  - intros t k n v Hk Hv W Kp Lo B Nf. destruct (positive k Hk) as (L & _).
    destruct (the_tick t L) as (Lt & Eq & Le & _).
    destruct (Nat.eq_dec n (t / lap)) as [->|Ne].
    + rewrite executes_in; auto. rewrite begun_now in B; auto. rewrite lap_finished, Eq in Nf.
      destruct (ticks (t mod lap) Lt) as (_ & V). specialize (V k v Hk Hv). unfold vertex_ok in V.
      change (lost_in (t mod lap) = false) in Lo. rewrite W, Kp, Lo, B in V. simpl in V.
      apply andb_true_iff in V. destruct V as (_ & V). destruct (over (t mod lap) k v); [tauto|exact V].
    + exfalso. destruct (le_lt_dec (t / lap) n) as [H|H]; [|apply Nf, earlier; auto].
      unfold has_begun in B. rewrite lap_done in B.
      replace (t - lap * n) with 0 in B by (pose proof (Nat.div_mod t lap ltac:(lia));
        pose proof (Nat.mod_upper_bound t lap ltac:(lia)); nia).
      discriminate.
  - intros t k n v Hk Rg W R _. destruct (positive k Hk) as (L & _). destruct (the_tick t L) as (Lt & _).
    destruct (ready_now t k n v Hk R) as (-> & Hv & Ri). rewrite executes_in; auto.
    destruct (ticks (t mod lap) Lt) as (_ & V). specialize (V k v Hk Hv). unfold vertex_ok in V.
    rewrite Rg, Ri, W in V. simpl in V. rewrite !orb_false_r in V. rewrite !andb_true_iff in V. tauto.
Qed.

End lap.
