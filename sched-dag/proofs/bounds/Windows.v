(** * One core: windows that begin before a job's release

    Of a DAG whose jobs all win over the job, and that no other may delay, jobs from before a window need not count: the
    window begins where none of them is left.  From there on to the release the core executes nothing less urgent. *)

Require Import Arith Lia Bool List.
From Bounds Require Import Sums Model Chains Shares Workload TaskSet.

Section windows.
Variables (K : nat) (tau : nat -> task) (pol : policy) (s : set_run).
Hypothesis rules : global_run K 1 tau pol s.
Hypothesis nothing_keeps : forall h w, h < K -> keeps (tau h) w = false.
Hypothesis by_rank : by_deadline pol = false.
Variables (k : nat) (full : nat -> bool).

Definition above (h : nat) : bool := negb (h =? k) && outranks pol h k.

(** Jobs of DAG h count from the window's begin on. *)
Definition counts_in_full (h : nat) : Prop :=
  above h = true /\ (forall w, w < size (graph (tau h)) -> waits (tau h) w = false) /\
  forall g, g < K -> g <> h -> outranks pol g h = true -> above g = true.
Hypothesis counted : forall h, h < K -> full h = true -> counts_in_full h /\ regular (tau h) = true.

Definition cores_above (t : nat) : nat := sum K (fun h => if above h then task_cores tau s t h else 0).

Definition left_from_before (t h n w : nat) : Prop :=
  h < K /\ full h = true /\ w < size (graph (tau h)) /\ release s h n < t /\ ~ job_finished s t h n w.

Definition quiet (t : nat) : Prop := forall h n w,
  h < K -> full h = true -> w < size (graph (tau h)) -> release s h n < t -> job_finished s t h n w.

Lemma quiet_or_not t : quiet t \/ exists h n w, left_from_before t h n w.
Proof.
  set (late h n w := full h && (release s h n <? t) && negb (job_exec s h n w <=? job_done s t h n w)).
  destruct (some_or_none K (fun h => existsb (fun n => existsb (late h n) (seq 0 (size (graph (tau h))))) (seq 0 t)))
    as [(h & Hh & E)|N].
  - right. apply existsb_exists in E. destruct E as (n & _ & E).
    apply existsb_exists in E. destruct E as (w & Hw & E). apply in_seq in Hw. unfold late in E.
    rewrite !andb_true_iff, Nat.ltb_lt, negb_true_iff, Nat.leb_gt in E.
    exists h, n, w. unfold left_from_before, job_finished. repeat split; try tauto; lia.
  - left. intros h n w Hh F Hw R. specialize (N h Hh).
    destruct (le_lt_dec (job_exec s h n w) (job_done s t h n w)) as [D|D]; [exact D|]. exfalso.
    assert (E : existsb (fun n => existsb (late h n) (seq 0 (size (graph (tau h))))) (seq 0 t) = true); [|congruence].
    apply existsb_exists. exists n. split.
    { apply in_seq. pose proof (release_at_least K 1 tau pol s rules h n Hh). lia. }
    apply existsb_exists. exists w. split; [apply in_seq; lia|]. unfold late.
    apply Nat.ltb_lt in R. apply Nat.leb_gt in D. rewrite F, R, D. reflexivity.
Qed.

Lemma last_quiet t : exists b, b <= t /\ quiet b /\ forall i, b <= i < t -> exists h n w, left_from_before (S i) h n w.
Proof.
  induction t as [|t (b & Hb & C & P)].
  - exists 0. split; [lia|]. split; [|intros; lia]. intros h n w _ _ _ H. lia.
  - destruct (quiet_or_not (S t)) as [C'|P'].
    + exists (S t). split; [lia|]. split; [exact C'|intros; lia].
    + exists b. split; [lia|]. split; [exact C|]. intros i H.
      destruct (Nat.eq_dec i t) as [->|]; [exact P'|apply P; lia].
Qed.

(** While something is left, the core executes what is above, or the tick is lost. *)
Lemma executes_above t h n w : left_from_before (S t) h n w -> lost s t = false -> 0 < cores_above t.
Proof.
  intros (Hh & F & Hw & Rl & Nf) Lo. destruct (counted h Hh F) as ((Ab & Nw & Closed) & Rg).
  set (open n v := (release s h n <=? t) && negb (job_exec s h n v <=? job_done s t h n v)).
  assert (N0 : exists m, m < S n /\ existsb (open m) (seq 0 (size (graph (tau h)))) = true).
  { exists n. split; [lia|]. apply existsb_exists. exists w. split; [apply in_seq; lia|]. unfold open.
    destruct (Nat.leb_spec (release s h n) t); [|lia].
    destruct (Nat.leb_spec (job_exec s h n w) (job_done s t h n w)) as [D|]; [|reflexivity]. exfalso. apply Nf.
    apply job_finished_later with t; [lia|exact D]. }
  destruct (least (S n) _ N0) as (m & _ & Om & Least).
  apply existsb_exists in Om. destruct Om as (u & Iu & Ou). apply in_seq in Iu.
  destruct (least (size (graph (tau h))) (open m)) as (v & Hv & Ov & First); [exists u; split; [lia|exact Ou]|].
  unfold open in Ov. rewrite andb_true_iff, Nat.leb_le, negb_true_iff, Nat.leb_gt in Ov. destruct Ov as (Rm & Dv).
  assert (Shut : forall m' v', release s h m' <= t -> open m' v' = false -> job_finished s t h m' v').
  { intros m' v' R E. unfold open in E. destruct (Nat.leb_spec (release s h m') t); [|lia].
    apply negb_false_iff, Nat.leb_le in E. exact E. }
  assert (Early : earlier_complete tau s t h m).
  { intros m' Hm v' Hv'. pose proof (releases_apart K 1 tau pol s rules h m' (m - m') Hh) as Ap.
    replace (m' + (m - m')) with m in Ap by lia. apply Shut; [nia|]. specialize (Least m' Hm).
    destruct (open m' v') eqn:E; auto. rewrite <- Least. symmetry. apply existsb_exists. exists v'. split; [apply in_seq; lia|exact E]. }
  assert (Rd : instance_ready tau s t h m v).
  { split; [exact Hv|]. split; [exact Rm|]. split; [unfold job_finished; lia|]. split.
    - intros z Ez. apply precedes_up in Ez. apply Shut; [exact Rm|apply First; lia].
    - intros m' Hm. apply (Early m' Hm v Hv). }
  assert (Core : forall g m' v', g < K -> above g = true -> v' < size (graph (tau g)) -> waits (tau g) v' = false ->
    executes s t g m' v' = true -> 0 < cores_above t).
  { intros g m' v' Hg Ag Hv' Wv Ex.
    assert (Hm : m' <= t).
    { pose proof (release_at_least K 1 tau pol s rules g m' Hg). apply (only_ready_execute _ _ _ _ _ rules) in Ex; auto.
      destruct Ex as (_ & R & _). lia. }
    pose proof (sum_term K (fun h => if above h then task_cores tau s t h else 0) g Hg) as T1. cbv beta in T1. rewrite Ag in T1.
    pose proof (sum_term (S t) (job_cores tau s t g) m' ltac:(lia)) as T2.
    pose proof (sum_term (size (graph (tau g))) (fun v => Nat.b2n (on_core tau g v && executes s t g m' v)) v' Hv') as T3.
    cbv beta in T3. unfold on_core at 1 in T3. rewrite Wv, Ex in T3. simpl in T3.
    unfold cores_above, task_cores, job_cores, count in *. lia. }
  destruct (executes s t h m v) eqn:Ex; [apply (Core h m v); auto|].
  destruct (dispatch _ _ _ _ _ rules t h m v Hh Rg (Nw v Hv) Lo Rd Early Ex) as (All & Ord).
  assert (Pos : 0 < sum K (task_cores tau s t)) by lia.
  apply sum_positive in Pos. destruct Pos as (g & Hg & Pos). apply sum_positive in Pos. destruct Pos as (m' & _ & Pos).
  apply sum_positive in Pos. destruct Pos as (v' & Hv' & Pos).
  destruct (on_core tau g v') eqn:On; [|simpl in Pos; lia]. destruct (executes s t g m' v') eqn:Ex'; [|simpl in Pos; lia].
  apply negb_true_iff in On. destruct (Ord g m' v' Hg Hv' On Ex') as [[->|P]|Kp].
  - apply (Core h m' v'); auto.
  - unfold may_delay in P. apply andb_true_iff in P. destruct P as (P & _).
    destruct (Nat.eq_dec g h) as [->|Ne]; [apply (Core h m' v'); auto|]. apply (Core g m' v'); auto.
  - rewrite nothing_keeps in Kp by exact Hg. discriminate.
Qed.

(** Jobs that count in full, in a window that begins where none is left. *)
Definition full_work (h r : nat) : nat := up r (period (tau h)) * weight (graph (tau h)) (together (tau h)) (on_core tau h).

Lemma window_of_full b r h : h < K -> full h = true -> quiet b -> known (tau h) = true ->
  heads_first (graph (tau h)) (head (tau h)) ->
  (forall v, v < size (graph (tau h)) -> on_core tau h (head (tau h) v) = on_core tau h v) ->
  sum r (fun i => task_cores tau s (b + i) h) <= full_work h r.
Proof.
  intros Hh F Q Kn Heads On. set (p n := (b <=? release s h n) && (release s h n <? b + r)).
  assert (Zero : forall n i, i < r -> p n = false -> job_cores tau s (b + i) h n = 0).
  { intros n i Hi E. apply sum_zero. intros v Hv. destruct (executes s (b + i) h n v) eqn:Ex; [|rewrite andb_false_r; auto].
    exfalso. apply (only_ready_execute _ _ _ _ _ rules) in Ex; auto. destruct Ex as (_ & R & Nf & _). unfold p in E.
    destruct (Nat.leb_spec b (release s h n)).
    - destruct (Nat.ltb_spec (release s h n) (b + r)); [discriminate|lia].
    - apply Nf. apply job_finished_later with b; [lia|]. apply (Q h n v Hh F Hv). lia. }
  apply Nat.le_trans with (sum r (fun i => sum (b + r) (fun n => if p n then job_cores tau s (b + i) h n else 0))).
  { apply sum_le. intros i Hi. apply Nat.le_trans with (sum (b + r) (job_cores tau s (b + i) h)); [apply sum_more; lia|].
    apply sum_le. intros n _. destruct (p n) eqn:E; [lia|]. rewrite Zero; auto. }
  rewrite sum_swap.
  apply Nat.le_trans with (sum (b + r) (fun n => weight (graph (tau h)) (together (tau h)) (on_core tau h) * Nat.b2n (p n))).
  - apply sum_le. intros n _. destruct (p n); simpl Nat.b2n; [|rewrite sum_zero; [lia|auto]]. rewrite Nat.mul_1_r.
    apply Nat.le_trans with (1 := window_of_total b r (fun t => job_cores tau s t h n)).
    apply (work_of_part K 1 tau pol s rules h 0 Hh Kn Heads (Nat.le_0_l _) (fun _ => true) n (b + r) (on_core tau h)).
    intros v Hv. rewrite On; auto.
  - rewrite sum_times. fold (count (b + r) p). unfold full_work. rewrite Nat.mul_comm. apply Nat.mul_le_mono_r.
    pose proof (periods_positive _ _ _ _ _ rules h Hh).
    apply (jobs_in_window (b + r) (release s h) (period (tau h)) b (b + r)).
    + intros n. apply (sporadic _ _ _ _ _ rules h n Hh).
    + intros n E. unfold p in E. rewrite andb_true_iff, Nat.leb_le, Nat.ltb_lt in E. exact E.
    + pose proof (up_enough r (period (tau h)) ltac:(lia)). lia.
Qed.

End windows.
