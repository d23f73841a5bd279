(** * The bounds of a set of sporadic DAGs *)

Require Import Arith Lia Bool List.
From Bounds Require Import Sums Model Chains Shares OneTick Account ResponseTime AlongAPath Blocking Workload
  TaskSet Windows.

(** ** What has to be shown of each DAG: an inequality between numbers

    [R k] is the bound claimed for DAG k.  A job of it executes on at most [width k] cores.  [part k] divides
    it into [parts k] disjoint chains and a rest.  [f] is j + 1 disjoint chains of DAG k besides which
    [left] is left over, and [len] is its length.

    Of a DAG that is not [bounded] nothing is claimed.  It may be there if it outranks none of those that are, and
    its subtasks that keep their cores block them. *)

Section inequalities.
Variables (K m : nat) (tau : nat -> task) (pol : policy).
Variables (bounded : nat -> bool) (R loss width parts : nat -> nat) (part : nat -> nat -> nat).

(** The work of some vertices of DAG h, without its waits, in a window of length r that begins at a release of
    DAG k, on at most p cores at once. *)
Definition work_of (k h : nat) (vertices : nat -> bool) (p r : nat) : nat :=
  window_work (if by_deadline pol then Some (deadline (tau k), first_deadline (tau h)) else None)
              (weight (graph (tau h)) (together (tau h)) (fun v => vertices v && on_core tau h v))
              p (R h) (period (tau h)) r.

(** Cores that count: m - j at most, and no more than the DAG can use. *)
Definition cores_used (j h : nat) : nat := Nat.min (m - j) (width h).

Definition whole_work (k j h r : nat) : nat := work_of k h (fun _ => true) (cores_used j h) r.

(** The work of DAG h in any x ticks of such a window. *)
Definition clipped_work (k j h r x : nat) : nat :=
  clipped (whole_work k j h r) (cores_used j h)
          (parts h) (fun i => work_of k h (fun v => part h v =? i) 1 r)
          (work_of k h (fun v => parts h <=? part h v) (cores_used j h) r) x.

(** How fast that grows. *)
Definition rising_work (k j h r x : nat) : nat :=
  rise (whole_work k j h r) (cores_used j h)
       (parts h) (fun i => work_of k h (fun v => part h v =? i) 1 r)
       (work_of k h (fun v => parts h <=? part h v) (cores_used j h) r) x.

(** The sum over all other DAGs that may outrank DAG k. *)
Definition sum_over_others (k : nat) (g : nat -> nat) : nat :=
  sum K (fun h => if negb (h =? k) && outranks pol h k then g h else 0).

(** *** Blocking

    Some job of DAG h might not delay jobs of DAG k: its subtasks that keep their cores block. *)
Definition may_block (k h : nat) : bool := negb (h =? k) && (by_deadline pol || negb (outranks pol h k)).

Definition blocks (k h v : nat) : bool := may_block k h && on_core tau h v && keeps (tau h) v.

(** The sum of the q largest that block, or more; see [largest]. *)
Definition largest_blocking (k q level : nat) : nat :=
  q * level + sum K (fun h => sum (size (graph (tau h))) (fun v =>
    (if blocks k h v then wcet (tau h) v else 0) - level)).

(** They block once, from the release on, by the m - j largest, and then [again] times by the m - max(j, 1) largest. *)
Definition blocking (k j again level0 level1 : nat) : nat :=
  largest_blocking k (m - j) level0 + again * largest_blocking k (Nat.min (m - j) (m - 1)) level1.

(** No subtask of another DAG blocks DAG k. *)
Definition unblocked (k : nat) : Prop :=
  forall h v, h < K -> v < size (graph (tau h)) -> blocks k h v = false.

(** The WCETs of what blocks DAG k are known. *)
Definition blockers_known (k : nat) : Prop :=
  forall h v, h < K -> v < size (graph (tau h)) -> blocks k h v = true -> known (tau h) = true.

(** All segments of DAG k keep their cores; none waits for a device. *)
Definition all_keep (k : nat) : Prop :=
  forall v, v < size (graph (tau k)) -> waits (tau k) v = false -> keeps (tau k) v = true.

Definition without_waits (k : nat) : Prop := forall v, v < size (graph (tau k)) -> waits (tau k) v = false.

(** As often as there are subtasks with a predecessor. *)
Definition each_counts (k again : nat) : Prop :=
  count (size (graph (tau k))) (has_predecessor (graph (tau k))) <= again.

(** *** The inequalities *)

Definition first_inequality (k j len left blocked : nat) : Prop :=
  left + blocked + sum_over_others k (fun h => whole_work k j h (R k)) + (m - j) * loss k
  <= (m - j) * (R k - len).

Definition second_inequality (k j len left blocked : nat) : Prop :=
  let others := sum_over_others k (fun h => clipped_work k j h (R k) (R k - len)) in
  Nat.max 1 left + blocked + others + (m - j) * loss k <= (m - j) * (R k - len) \/
  left + blocked + others + (m - j) * loss k <= (m - j) * (R k - len) /\
  sum_over_others k (fun h => rising_work k j h (R k) (R k - len)) < m - j.

(** *** Along a path

    Off the path and j chains, m - j cores execute the DAG's segments; waits there are no work.  What keeps its core
    blocks each segment of the path: by the m - 1 largest, but by the m largest at the release and after a wait. *)
Definition outside (k j : nat) (f : nat -> nat) (v : nat) : bool := on_core tau k v && (j <=? f v).

Definition on_path (k j : nat) (f : nat -> nat) (level0 level1 v : nat) : nat :=
  (m - j) * together (tau k) v - (if outside k j f v then together (tau k) v else 0)
  + (if on_core tau k v
     then if after_wait (graph (tau k)) (on_core tau k) v then largest_blocking k m level0
          else largest_blocking k (m - 1) level1
     else 0).

(** On one core, where nothing keeps it, the jobs of some more urgent DAGs count in [full] from the begin of a window that
    may precede the release; see Windows.v. *)
Definition window_applies (k : nat) (left : nat) (h : nat) : Prop :=
  m = 1 /\ by_deadline pol = false /\ 0 < left /\ (forall g w, g < K -> keeps (tau g) w = false) /\
  counts_in_full K tau pol k h.

Definition path_inequality (k : nat) (piece : nat -> bool) (r x : nat) : Prop :=
  exists j f level0 level1 most full,
    let left := weight (graph (tau k)) (together (tau k)) (outside k j f) in
    j < m /\ disjoint_chains (graph (tau k)) j f /\ (forall v, v < size (graph (tau k)) -> f (head (tau k) v) = f v) /\
    no_path_longer (graph (tau k)) (fun v => if piece v then on_path k j f level0 level1 v else 0) most /\
    (forall h, h < K -> full h = true -> window_applies k left h) /\
    left + (largest_blocking k m level0 - largest_blocking k (m - 1) level1)
    + sum_over_others k (fun h => if full h then full_work tau h r else whole_work k j h r) + (m - j) * x + most
    <= (m - j) * r.

(** *** Widths that fit

    DAG k and all that may delay it are no wider than there are cores. *)
Definition delays (h k : nat) : bool :=
  negb (h =? k) && (outranks pol h k || existsb (blocks k h) (seq 0 (size (graph (tau h))))).

Definition widths_fit (k : nat) : Prop :=
  (exists f, chain_cover (graph (tau k)) (width k) f) /\
  (forall h, h < K -> delays h k = true -> bounded h = true) /\
  width k + sum K (fun h => if delays h k then width h else 0) <= m.

(** *** What shows that a part of DAG k is complete after r, with all that precedes it

    [x]: in so many ticks of such a window, at most, any core is lost. *)
Definition part_inequality (k : nat) (piece : nat -> bool) (r x : nat) : Prop :=
  (forall u v, edge (graph (tau k)) u v = true -> piece v = true -> piece u = true) /\
  (path_inequality k piece r x \/
   widths_fit k /\ exists len, no_path_longer (graph (tau k)) (fun v => if piece v then together (tau k) v else 0) len /\ len + x <= r).

Definition shown (k : nat) : Prop :=
  known (tau k) = true /\ regular (tau k) = true /\ blockers_known k /\
  enough_cores m tau k (width k) /\
  disjoint_parts (graph (tau k)) (parts k) (part k) /\
  heads_first (graph (tau k)) (head (tau k)) /\
  (forall v, v < size (graph (tau k)) ->
     on_core tau k (head (tau k) v) = on_core tau k v /\ part k (head (tau k) v) = part k v) /\
  (forall h, h < K -> h <> k -> outranks pol h k = true -> bounded h = true) /\
  (unblocked k \/ all_keep k) /\
  exists j f len again level0 level1,
    j < m /\
    no_path_longer (graph (tau k)) (together (tau k)) len /\
    disjoint_chains (graph (tau k)) j f /\ (forall v, v < size (graph (tau k)) -> f (head (tau k) v) = f v) /\
    len <= R k <= period (tau k) /\
    let left := left_over (graph (tau k)) (together (tau k)) j f in
    let blocked := blocking k j again level0 level1 in
    (unblocked k \/ without_waits k) /\ each_counts k again /\
    (first_inequality k j len left blocked \/ second_inequality k j len left blocked) \/
    part_inequality k (fun _ => true) (R k) (loss k).

End inequalities.

Section proof.
Variables (K m : nat) (tau : nat -> task) (pol : policy) (s : set_run).
Variables (bounded : nat -> bool) (R loss width parts : nat -> nat) (part : nat -> nat -> nat).
Hypothesis rules : global_run K m tau pol s.
Hypothesis losses : forall k a, k < K -> bounded k = true ->
  count (R k) (fun t => lost s (a + t)) <= loss k.

Lemma outranked_only k n h t :
  outranks pol h k = false -> cores_of_jobs tau s (may_delay tau pol s k n h) t h = 0.
Proof. intros H. apply sum_zero. intros n' _. unfold may_delay. rewrite H. reflexivity. Qed.

(** ** What blocks a job

    Lower-ranked subtasks are numbered: subtask w of DAG h has the number h Z + w. *)

Definition Z : nat := S (sum K (fun h => size (graph (tau h)))).

Lemma few_vertices h : h < K -> size (graph (tau h)) <= Z.
Proof. intros Hh. pose proof (sum_term K (fun h => size (graph (tau h))) h Hh). unfold Z. lia. Qed.

Lemma sum_of_pairs n f : sum (n * Z) f = sum n (fun h => sum Z (fun w => f (h * Z + w))).
Proof.
  induction n; [reflexivity|]. replace (S n * Z) with (n * Z + Z) by lia. rewrite sum_shift, IHn. reflexivity.
Qed.

Lemma of_pair h w : w < Z -> (h * Z + w) / Z = h /\ (h * Z + w) mod Z = w.
Proof.
  intros Hw. assert (Z <> 0) by (unfold Z; lia). split.
  - rewrite Nat.div_add_l, Nat.div_small; lia.
  - rewrite Nat.add_comm, Nat.mod_add, Nat.mod_small; auto.
Qed.

(** Subtask w of DAG h has a core in tick b that it keeps, for a job that may not delay job n of DAG k. *)
Definition holds_low (k n b h w : nat) : bool :=
  (w <? size (graph (tau h))) && blocks tau pol k h w &&
  existsb (fun n' => negb (may_delay tau pol s k n h n') && holds_core tau s b h n' w) (seq 0 (S b)).

Definition low_holds (k n t l : nat) : bool := holds_low k n (release s k n + t) (l / Z) (l mod Z).

Definition longest_low (k l : nat) : nat :=
  if (l mod Z <? size (graph (tau (l / Z)))) && blocks tau pol k (l / Z) (l mod Z)
  then wcet (tau (l / Z)) (l mod Z) else 0.

Lemma blocks_true k h w : blocks tau pol k h w = true ->
  h <> k /\ waits (tau h) w = false /\ keeps (tau h) w = true.
Proof.
  unfold blocks, may_block, on_core. rewrite !andb_true_iff, !negb_true_iff, Nat.eqb_neq. tauto.
Qed.

Lemma holds_low_true k n b h w : holds_low k n b h w = true ->
  w < size (graph (tau h)) /\ blocks tau pol k h w = true /\
  exists n', may_delay tau pol s k n h n' = false /\ holds_core tau s b h n' w = true.
Proof.
  unfold holds_low. rewrite !andb_true_iff, Nat.ltb_lt, existsb_exists.
  intros ((W & B) & (n' & _ & E)). apply andb_true_iff in E. rewrite negb_true_iff in E.
  split; [auto|]. split; [auto|]. exists n'. tauto.
Qed.

Lemma held_is_released b h n' w : h < K -> w < size (graph (tau h)) -> holds_core tau s b h n' w = true -> n' <= b.
Proof.
  intros Hh W E. pose proof (release_at_least K m tau pol s rules h n' Hh) as Rl.
  assert (Ex : forall i, i <= b -> executes s i h n' w = true -> n' <= b).
  { intros i Hi Ei. apply (only_ready_execute _ _ _ _ _ rules) in Ei; auto. destruct Ei as (_ & Rel & _). lia. }
  unfold holds_core in E. apply orb_true_iff in E. destruct E as [E|E]; [apply (Ex b); auto|].
  rewrite !andb_true_iff in E. destruct E as ((_ & E) & _). apply Nat.ltb_lt, sum_positive in E.
  destruct E as (i & Hi & E). apply (Ex i); [lia|]. destruct (executes s i h n' w); auto. simpl in E. lia.
Qed.

Lemma low_holds_core k n b h w n' : h < K -> w < size (graph (tau h)) -> blocks tau pol k h w = true ->
  may_delay tau pol s k n h n' = false -> holds_core tau s b h n' w = true -> holds_low k n b h w = true.
Proof.
  intros Hh W C M E. unfold holds_low. rewrite !andb_true_iff, Nat.ltb_lt, existsb_exists.
  repeat (split; auto). exists n'. rewrite M, E. split; [|auto].
  apply in_seq. pose proof (held_is_released b h n' w Hh W E). lia.
Qed.

Lemma may_block_of_low k n h n' : h <> k -> may_delay tau pol s k n h n' = false -> may_block pol k h = true.
Proof.
  unfold may_delay, may_block. intros N M. apply Nat.eqb_neq in N. rewrite N. simpl.
  destruct (outranks pol h k), (by_deadline pol); auto.
Qed.

(** If what executes may delay job n of DAG k or keeps its core, cores with others' jobs execute what may delay it,
    or are held by what blocks it. *)
Lemma cores_split k n b h : h < K -> h <> k ->
  (forall n' w, w < size (graph (tau h)) -> waits (tau h) w = false -> executes s b h n' w = true ->
     may_pass tau pol s k n h n' \/ keeps (tau h) w = true) ->
  task_cores tau s b h
  <= cores_of_jobs tau s (may_delay tau pol s k n h) b h + count Z (holds_low k n b h).
Proof.
  intros Hh N Ord. unfold task_cores, cores_of_jobs.
  rewrite (sum_ext _ (job_cores tau s b h) (fun n' =>
    (if may_delay tau pol s k n h n' then job_cores tau s b h n' else 0)
    + (if may_delay tau pol s k n h n' then 0 else job_cores tau s b h n')))
    by (intros n' _; destruct (may_delay tau pol s k n h n'); lia).
  rewrite sum_plus. apply Nat.add_le_mono_l. unfold job_cores, count.
  rewrite (sum_ext (S b) _ (fun n' => sum (size (graph (tau h))) (fun w =>
    Nat.b2n (negb (may_delay tau pol s k n h n') && (on_core tau h w && executes s b h n' w)))))
    by (intros n' _; destruct (may_delay tau pol s k n h n'); [rewrite sum_zero|]; auto).
  rewrite sum_swap. apply Nat.le_trans with (2 := sum_more _ _ _ (few_vertices h Hh)).
  apply sum_le. intros w Hw.
  destruct (holds_low k n b h w) eqn:E.
  - apply (count_at_most_one (S b) (fun n' =>
      negb (may_delay tau pol s k n h n') && (on_core tau h w && executes s b h n' w))).
    intros u v _ _ Hu Hv. rewrite !andb_true_iff in Hu, Hv.
    apply (one_job_executes K m tau pol s rules h w u v b); tauto.
  - rewrite sum_zero; auto. intros n' _.
    destruct (negb (may_delay tau pol s k n h n') && (on_core tau h w && executes s b h n' w)) eqn:B; auto.
    rewrite !andb_true_iff, negb_true_iff in B. destruct B as (B1 & B2 & B3).
    assert (C : waits (tau h) w = false) by (apply negb_true_iff, B2).
    destruct (Ord n' w Hw C B3) as [[P|P]|Kp]; [tauto|congruence|].
    rewrite (low_holds_core k n b h w n' Hh Hw) in E; auto; [discriminate| |].
    + unfold blocks. rewrite (may_block_of_low k n h n' N B1), B2, Kp. reflexivity.
    + unfold holds_core. rewrite B3. reflexivity.
Qed.

Lemma count_low k n b : low (K * Z) (low_holds k n) b
  = sum K (fun h => count Z (holds_low k n (release s k n + b) h)).
Proof.
  unfold low, count. rewrite sum_of_pairs. apply sum_ext. intros h _. apply sum_ext. intros w Hw.
  unfold low_holds. destruct (of_pair h w Hw) as (-> & ->). reflexivity.
Qed.

Lemma largest_low k q level :
  largest q level (K * Z) (longest_low k) = largest_blocking K tau pol k q level.
Proof.
  unfold largest, largest_blocking. f_equal. rewrite sum_of_pairs. apply sum_ext. intros h Hh.
  pose proof (few_vertices h Hh) as F. replace Z with (size (graph (tau h)) + (Z - size (graph (tau h)))) by lia.
  rewrite sum_shift.
  assert (P : forall w, w < Z -> longest_low k (h * Z + w)
    = if (w <? size (graph (tau h))) && blocks tau pol k h w then wcet (tau h) w else 0).
  { intros w Hw. unfold longest_low. destruct (of_pair h w Hw) as (-> & ->). reflexivity. }
  replace (size (graph (tau h)) + (Z - size (graph (tau h)))) with Z by lia.
  rewrite (sum_zero (Z - size (graph (tau h)))).
  - rewrite Nat.add_0_r. apply sum_ext. intros w Hw. rewrite P by lia.
    destruct (Nat.ltb_spec w (size (graph (tau h)))); [reflexivity|lia].
  - intros w Hw. rewrite P by lia.
    destruct (Nat.ltb_spec (size (graph (tau h)) + w) (size (graph (tau h)))); [lia|reflexivity].
Qed.

Section one.
Variables (k n : nat).
Hypothesis in_K : k < K.
Hypothesis is_regular : regular (tau k) = true.
Hypothesis before : forall n', n' < n -> job_complete tau s (release s k n) k n'.
Hypothesis blockers : blockers_known K tau pol k.
Notation run := (job_run K m tau s k n).
Notation G := (graph (tau k)).

Lemma run_legal : legal G m run.
Proof. apply (job_run_legal K m tau pol s rules k n in_K is_regular before). Qed.

Lemma earlier_at t : earlier_complete tau s (release s k n + t) k n.
Proof. apply (earlier_complete_later tau s (release s k n)); [lia|exact before]. Qed.

Lemma waiting_instance t v : ready G run t v -> executes s (release s k n + t) k n v = false ->
  waits (tau k) v = false /\ instance_ready tau s (release s k n + t) k n v.
Proof.
  intros (Hv & Nf & P) Ex.
  assert (Ri : instance_ready tau s (release s k n + t) k n v).
  { split; [auto|]. split; [lia|]. split; [rewrite <- (job_finished_in_run K m tau pol s rules); auto|]. split.
    - intros u Eu. pose proof (precedes_up _ _ _ Eu).
      apply (job_finished_in_run K m tau pol s rules); auto. lia.
    - intros p Hp. apply job_finished_later with (release s k n); [lia|]. apply before; auto. }
  split; [|auto]. destruct (waits (tau k) v) eqn:Wv; auto.
  rewrite (waits_go_on _ _ _ _ _ rules _ k n v in_K is_regular Wv Ri (earlier_at t)) in Ex. discriminate.
Qed.

(** While a vertex waits to begin, what is low has begun. *)
Lemma low_kept t h w n' : waits_to_begin G run (S t) = true ->
  h < K -> w < size (graph (tau h)) -> blocks tau pol k h w = true ->
  may_delay tau pol s k n h n' = false -> holds_core tau s (release s k n + S t) h n' w = true ->
  holds_core tau s (release s k n + t) h n' w = true.
Proof.
  intros W Hh Hw Bl M E. destruct (blocks_true k h w Bl) as (N & C & Kp).
  apply waits_to_begin_true in W. destruct W as (v & Rd & D & Ex). simpl in Ex.
  pose proof Rd as (Hv & _ & _).
  rewrite (job_done_in_run K m tau pol s rules _ k n v in_K Hv) in D.
  destruct (waiting_instance (S t) v Rd Ex) as (Wv & Ri). pose proof (earlier_at (S t)) as Ea.
  rewrite Nat.add_succ_r in *. set (b := release s k n + t) in *.
  assert (Nf : job_done s (S b) h n' w < job_exec s h n' w).
  { unfold holds_core in E. apply orb_true_iff in E. destruct E as [E|E].
    - apply (only_ready_execute _ _ _ _ _ rules) in E; auto. destruct E as (_ & _ & F & _).
      unfold job_finished in F. lia.
    - rewrite !andb_true_iff, Nat.ltb_lt in E. tauto. }
  assert (Bg : has_begun s (S b) h n' w = true).
  { unfold holds_core in E. apply orb_true_iff in E. destruct E as [E|E].
    - destruct (has_begun s (S b) h n' w) eqn:Hb; auto. exfalso.
      destruct (begin_in_order _ _ _ _ _ rules (S b) k n v in_K is_regular Wv Ri Ea) with (h := h) (n' := n') (w := w)
        as [P|P]; auto; [|congruence].
      unfold has_begun. rewrite D. reflexivity.
    - rewrite !andb_true_iff in E. tauto. }
  unfold has_begun in Bg. apply Nat.ltb_lt in Bg.
  change (job_done s (S b) h n' w) with (job_done s b h n' w + Nat.b2n (executes s b h n' w)) in Bg, Nf.
  unfold holds_core. destruct (executes s b h n' w) eqn:Eb; [reflexivity|]. simpl in Bg, Nf. rewrite Kp.
  unfold has_begun. destruct (Nat.ltb_spec 0 (job_done s b h n' w)), (Nat.ltb_spec (job_done s b h n' w) (job_exec s h n' w));
    simpl; auto; lia.
Qed.

Lemma low_in_reach t l : l < K * Z -> low_holds k n t l = true -> exists h w, l = h * Z + w /\
  h < K /\ w < Z /\ holds_low k n (release s k n + t) h w = true.
Proof.
  intros Hl E. exists (l / Z), (l mod Z). assert (Z <> 0) by (unfold Z; lia).
  split; [rewrite Nat.mul_comm; apply Nat.div_mod; auto|].
  split; [apply Nat.div_lt_upper_bound; auto; lia|]. split; [apply Nat.mod_upper_bound; auto|exact E].
Qed.

Lemma low_held_before t l : l < K * Z ->
  waits_to_begin G run (S t) = true -> low_holds k n (S t) l = true -> low_holds k n t l = true.
Proof.
  intros Hl W E. destruct (low_in_reach _ l Hl E) as (h & w & -> & Hh & Hw & Ex).
  destruct (holds_low_true k n _ h w Ex) as (Hw' & Bl & n' & M & Ei).
  unfold low_holds. destruct (of_pair h w Hw) as (-> & ->).
  apply (low_holds_core k n _ h w n'); auto. apply (low_kept t h w n' W); auto.
Qed.

Lemma job_done_at_most h n' w t : h < K -> w < size (graph (tau h)) -> known (tau h) = true -> job_done s t h n' w <= wcet (tau h) w.
Proof.
  intros Hh Hw Kn. apply Nat.le_trans with (job_exec s h n' w); [|apply (executions _ _ _ _ _ rules); auto].
  induction t; [unfold job_done, count; simpl; lia|].
  change (job_done s t h n' w + Nat.b2n (executes s t h n' w) <= job_exec s h n' w).
  destruct (executes s t h n' w) eqn:E; simpl; [|lia].
  apply (only_ready_execute _ _ _ _ _ rules) in E; auto. destruct E as (_ & _ & Nf & _).
  unfold job_finished in Nf. lia.
Qed.

Lemma low_ends b c l : l < K * Z ->
  (forall i, i < c -> waits_to_begin G run (b + i) = true /\ low_holds k n (b + i) l = true) ->
  count c (fun i => negb (lost s (release s k n + (b + i)))) <= longest_low k l.
Proof.
  intros Hl H. destruct c as [|c]; [unfold count; simpl; lia|].
  destruct (H c ltac:(lia)) as (W & E).
  destruct (low_in_reach _ l Hl E) as (h & w & -> & Hh & Hw & Ex).
  destruct (holds_low_true k n _ h w Ex) as (Hw' & Bl & n' & M & Ei).
  destruct (blocks_true k h w Bl) as (N & C & Kp).
  assert (All : forall d, d <= c -> holds_core tau s (release s k n + (b + (c - d))) h n' w = true).
  { induction d; intros Hd.
    - replace (c - 0) with c by lia. exact Ei.
    - specialize (IHd ltac:(lia)). destruct (H (c - d) ltac:(lia)) as (Wd & _).
      replace (b + (c - d)) with (S (b + (c - S d))) in IHd, Wd by lia.
      apply (low_kept _ h w n' Wd Hh Hw' Bl M IHd). }
  unfold longest_low. destruct (of_pair h w Hw) as (-> & ->).
  rewrite Bl. destruct (Nat.ltb_spec w (size (graph (tau h)))); [simpl|lia].
  apply Nat.le_trans with (2 := job_done_at_most h n' w (release s k n + b + S c) Hh Hw' (blockers h w Hh Hw' Bl)).
  unfold job_done, count. rewrite sum_shift.
  apply Nat.le_trans with (sum (S c) (fun i => Nat.b2n (executes s (release s k n + b + i) h n' w))); [|lia].
  apply sum_le. intros i Hi.
  specialize (All (c - i) ltac:(lia)). replace (c - (c - i)) with i in All by lia.
  rewrite Nat.add_assoc in *. destruct (lost s (release s k n + b + i)) eqn:Lo; [simpl; lia|].
  assert (Ee : executes s (release s k n + b + i) h n' w = true); [|rewrite Ee; simpl; lia].
  unfold holds_core in All. apply orb_true_iff in All. destruct All as [A|A]; auto.
  rewrite !andb_true_iff, Nat.ltb_lt in A. apply (keeps_core _ _ _ _ _ rules); auto; [tauto|].
  unfold job_finished. lia.
Qed.

(** Until its next release, only other DAGs and losses are others to job n of DAG k. *)
Definition higher (t : nat) : nat :=
  sum_over_others K pol k
    (fun h => cores_of_jobs tau s (may_delay tau pol s k n h) (release s k n + t) h)
  + (if lost s (release s k n + t) then m else 0).

Definition lost_tick (t : nat) : bool := lost s (release s k n + t).

(** Until the next release it is the only job of its DAG. *)
Lemma only_this_job t : t < period (tau k) ->
  task_cores tau s (release s k n + t) k = job_cores tau s (release s k n + t) k n.
Proof.
  intros Ht. set (b := release s k n + t).
  unfold task_cores. apply (sum_only _ (job_cores tau s b k)).
  - pose proof (release_at_least K m tau pol s rules k n in_K). unfold b. lia.
  - intros n' _ Ne. apply sum_zero. intros v Hv.
    destruct (executes s b k n' v) eqn:E; [|rewrite andb_false_r; auto]. exfalso.
    apply (only_ready_execute _ _ _ _ _ rules) in E; auto. destruct E as (_ & Rel & N & _).
    destruct (lt_eq_lt_dec n' n) as [[H|H]|H]; [|lia|].
    + apply N. apply job_finished_later with (release s k n); [unfold b; lia|]. apply before; auto.
    + pose proof (releases_apart K m tau pol s rules k n (n' - n) in_K) as Ap.
      replace (n + (n' - n)) with n' in Ap by lia.
      destruct (n' - n) as [|d] eqn:Ed; [lia|]. rewrite Nat.mul_succ_l in Ap. unfold b in Rel. lia.
Qed.

Lemma others_are_other_dags t : t < period (tau k) ->
  others run t <= higher t + (if somebody_waits G run t && negb (lost_tick t)
                              then low (K * Z) (low_holds k n) t else 0).
Proof.
  intros Ht. set (b := release s k n + t).
  change (others run t) with (if somebody_waits G run t
    then if lost s b then m else sum K (task_cores tau s b) - job_cores tau s b k n else 0).
  unfold higher, lost_tick. fold b.
  destruct (somebody_waits G run t) eqn:W; [|lia]. destruct (lost s b) eqn:Lo; [simpl; lia|]. simpl andb. cbv iota.
  apply somebody_waits_true in W. destruct W as (x & Rd & Ex). simpl in Ex.
  destruct (waiting_instance t x Rd Ex) as (Wv & Ri).
  destruct (dispatch _ _ _ _ _ rules b k n x in_K is_regular Wv Lo Ri (earlier_at t) Ex) as (_ & Ord).
  pose proof (only_this_job t Ht) as Own. fold b in Own.
  assert (Split : sum K (task_cores tau s b) <= job_cores tau s b k n
    + sum_over_others K pol k (fun h => cores_of_jobs tau s (may_delay tau pol s k n h) b h)
    + low (K * Z) (low_holds k n) t).
  { rewrite count_low. fold b. unfold sum_over_others.
    assert (One : sum K (fun h => if h =? k then job_cores tau s b k n else 0) = job_cores tau s b k n).
    { rewrite (sum_only K (fun h => if h =? k then job_cores tau s b k n else 0) k in_K).
      - rewrite Nat.eqb_refl. reflexivity.
      - intros h _ Ne. destruct (Nat.eqb_spec h k); [lia|auto]. }
    rewrite <- One, <- !sum_plus. apply sum_le. intros h Hh.
    destruct (Nat.eqb_spec h k) as [->|Ne]; [rewrite Own; simpl; lia|]. simpl.
    pose proof (cores_split k n b h Hh Ne (fun n' w => Ord h n' w Hh)).
    destruct (outranks pol h k) eqn:O; [lia|]. rewrite (outranked_only k n h b O) in *. lia. }
  lia.
Qed.

Lemma nothing_low t : unblocked K tau pol k -> low (K * Z) (low_holds k n) t = 0.
Proof.
  intros U. apply sum_zero. intros l Hl. destruct (low_holds k n t l) eqn:E; auto. exfalso.
  destruct (low_in_reach _ l Hl E) as (h & w & -> & Hh & Hw & Ex).
  destruct (holds_low_true k n _ h w Ex) as (Hw' & Bl & _). rewrite U in Bl; auto. discriminate.
Qed.

(** While it waits, its segments and others have all cores. *)
Lemma cores_conserved t : somebody_waits G run t = true ->
  m <= own_cores G run (on_core tau k) t + others run t.
Proof.
  intros W. set (b := release s k n + t).
  change (others run t) with (if somebody_waits G run t
    then if lost s b then m else sum K (task_cores tau s b) - job_cores tau s b k n else 0).
  change (own_cores G run (on_core tau k) t) with (job_cores tau s b k n). rewrite W.
  apply somebody_waits_true in W. destruct W as (x & Rd & Ex). destruct (waiting_instance t x Rd Ex) as (Wv & Ri).
  destruct (lost s b) eqn:Lo; [lia|].
  destruct (dispatch _ _ _ _ _ rules b k n x in_K is_regular Wv Lo Ri (earlier_at t) Ex) as (All & _). lia.
Qed.

Section keeping.
Hypothesis own : all_keep tau k.

Lemma run_keeps_cores : keeps_cores G m run (on_core tau k) (K * Z) (low_holds k n) (longest_low k)
  (fun t => if t <? period (tau k) then higher t else others run t) lost_tick.
Proof.
  constructor.
  - exact run_legal.
  - intros t. rewrite count_low. set (b := release s k n + t).
    apply Nat.le_trans with (2 := cores _ _ _ _ _ rules b).
    assert (B : own_cores G run (on_core tau k) t <= cores_held tau s b k).
    { apply Nat.le_trans with (2 := executing_is_held tau s b k). apply (sum_term (S b) (job_cores tau s b k)).
      pose proof (release_at_least K m tau pol s rules k n in_K). unfold b. lia. }
    apply Nat.le_trans with (sum K (fun h => (if h =? k then cores_held tau s b k else 0)
      + count Z (holds_low k n b h))).
    + rewrite sum_plus. apply Nat.add_le_mono_r.
      rewrite (sum_only K (fun h => if h =? k then cores_held tau s b k else 0) k in_K).
      * rewrite Nat.eqb_refl. exact B.
      * intros h _ Ne. destruct (Nat.eqb_spec h k); [lia|auto].
    + apply sum_le. intros h Hh. destruct (Nat.eqb_spec h k) as [->|Ne].
      * assert (E : count Z (holds_low k n b k) = 0); [|lia].
        apply sum_zero. intros w _. unfold holds_low, blocks, may_block. rewrite Nat.eqb_refl. simpl.
        rewrite andb_false_r. reflexivity.
      * unfold cores_held, count. rewrite (sum_swap (S b)). cbv iota. rewrite Nat.add_0_l.
        pose proof (few_vertices h Hh) as F.
        replace Z with (size (graph (tau h)) + (Z - size (graph (tau h)))) by lia. rewrite sum_shift.
        rewrite (sum_zero (Z - size (graph (tau h)))).
        -- rewrite Nat.add_0_r. apply sum_le. intros w Hw. destruct (holds_low k n b h w) eqn:E; [|simpl; lia].
           destruct (holds_low_true k n b h w E) as (_ & Bl & n' & _ & Ei).
           destruct (blocks_true k h w Bl) as (_ & C & _).
           pose proof (held_is_released b h n' w Hh Hw Ei) as Hn'.
           pose proof (sum_term (S b) (fun n' => Nat.b2n (on_core tau h w && holds_core tau s b h n' w)) n' ltac:(lia)) as T.
           cbv beta in T. unfold on_core in *. rewrite C, Ei in T. simpl in T. rewrite C. simpl in T |- *. exact T.
        -- intros w _. unfold holds_low.
           destruct (Nat.ltb_spec (size (graph (tau h)) + w) (size (graph (tau h)))); [lia|reflexivity].
  - intros t. destruct (Nat.ltb_spec t (period (tau k))); [|lia].
    pose proof (others_are_other_dags t H). destruct (somebody_waits G run t), (lost_tick t); simpl in *; lia.
  - intros t v Hv C Lo D N. simpl. apply negb_true_iff in C.
    rewrite (job_done_in_run K m tau pol s rules _ k n v in_K Hv) in D.
    apply (keeps_core _ _ _ _ _ rules); auto.
    + apply Nat.ltb_lt, D.
    + intros F. apply N. apply (job_finished_in_run K m tau pol s rules); auto.
  - intros v Hv C. apply (executions _ _ _ _ _ rules k n v in_K Hv); auto. apply negb_true_iff, C.
  - intros t v C Rd. destruct (runs run t v) eqn:E; auto. destruct (waiting_instance t v Rd E) as (W & _).
    unfold on_core in C. rewrite W in C. discriminate.
  - intros t l Hl W E. apply low_held_before; auto.
  - intros b c l Hl H. apply (low_ends b c l Hl H).
Qed.

End keeping.

Lemma blocked_at_most_in_set j again level0 level1 r :
  unblocked K tau pol k \/ all_keep tau k -> unblocked K tau pol k \/ without_waits tau k -> each_counts tau k again ->
  sum r (fun t => if somebody_waits G run t && negb (lost_tick t)
                  then Nat.min (low (K * Z) (low_holds k n) t) (m - j) else 0)
  <= blocking K m tau pol k j again level0 level1.
Proof.
  intros Own Waits Often.
  assert (Cases : unblocked K tau pol k \/ all_keep tau k /\ without_waits tau k) by tauto.
  destruct Cases as [U|(A & On)].
  - rewrite sum_zero; [lia|]. intros t _. rewrite nothing_low by auto.
    destruct (somebody_waits G run t && negb (lost_tick t)); auto.
  - pose proof (run_keeps_cores A) as Rk.
    pose proof (blocked_at_most _ _ _ _ _ _ _ _ _ Rk
      ltac:(intros v Hv; apply negb_true_iff; apply On; auto) j level0 level1 r) as B.
    unfold Blocking.blocking in B. rewrite !largest_low in B.
    match type of B with _ <= ?most => apply Nat.le_trans with most end;
      [|unfold blocking; apply Nat.add_le_mono_l, Nat.mul_le_mono_r, Often].
    apply Nat.le_trans with (2 := B). apply sum_le. intros t _.
    destruct (somebody_waits G run t) eqn:W; [|simpl; lia]. destruct (lost_tick t) eqn:Lo; [simpl; lia|].
    rewrite (waits_or_skip _ _ _ _ _ _ _ _ _ Rk t W Lo). simpl. lia.
Qed.

Lemma bounded_along_a_path piece j f level0 level1 most I r :
  j < m -> disjoint_chains G j f -> (forall v, v < size G -> f (head (tau k) v) = f v) ->
  heads_first G (head (tau k)) -> (forall v, v < size G -> on_core tau k (head (tau k) v) = on_core tau k v) ->
  known (tau k) = true -> unblocked K tau pol k \/ all_keep tau k ->
  r <= period (tau k) -> sum r (fun t => Nat.min (higher t) (m - j)) <= I ->
  (forall u v, edge G u v = true -> piece v = true -> piece u = true) ->
  no_path_longer G (fun v => if piece v then on_path K m tau pol k j f level0 level1 v else 0) most ->
  weight G (together (tau k)) (outside tau k j f)
  + (largest_blocking K tau pol k m level0 - largest_blocking K tau pol k (m - 1) level1) + I + most <= (m - j) * r ->
  forall v, v < size G -> piece v = true -> finished run r v.
Proof.
  intros Hj D F Heads On Kn Own Hr HI Closed Most H. rewrite <- !largest_low in H.
  assert (Sums : forall b, b < size G -> sum (size G) (fun v => if head (tau k) v =? b then job_exec s k n v else 0)
    <= together (tau k) b) by (intros b Hb; apply (shared_executions _ _ _ _ _ rules); auto).
  assert (Out : forall v, v < size G -> outside tau k j f (head (tau k) v) = outside tau k j f v)
    by (intros v Hv; unfold outside; rewrite F, On; auto).
  pose proof (shared_weight G (head (tau k)) Heads _ _ Sums (outside tau k j f)
    ltac:(intros v Hv E; rewrite Out; auto)) as Less.
  set (counts := counted m (K * Z) (low_holds k n) lost_tick).
  assert (None : unblocked K tau pol k -> forall t, counts t = 0).
  { intros U t. unfold counts, counted. rewrite nothing_low by auto. destruct (lost_tick t); auto. }
  assert (Zero : unblocked K tau pol k -> forall a d v, sum d (fun i => if runs run (a + i) v then 0 else counts (a + i)) = 0).
  { intros U a d v. apply sum_zero. intros i _. rewrite None by auto. destruct (runs run (a + i) v); auto. }
  refine (along_a_path G m run run_legal counts
    (blocked_at G m (on_core tau k) (K * Z) (longest_low k) level0 level1)
    (largest m level0 (K * Z) (longest_low k) - largest (m - 1) level1 (K * Z) (longest_low k)) _ _
    (job_exec s k n) (m - j) piece (outside tau k j f) higher r I most _ (fun v _ => le_n _) Closed _ HI _ _);
    [| |lia| | |lia].
  - intros d v Hv Rd. destruct Own as [U|A]; [rewrite Zero by auto; lia|].
    apply (blocked_at_release _ _ _ _ _ _ _ _ _ (run_keeps_cores A)); auto.
  - intros p d v Hv Rd Np. destruct Own as [U|A]; [rewrite Zero by auto; lia|].
    apply (blocked_later _ _ _ _ _ _ _ _ _ (run_keeps_cores A)); auto.
  - intros t Ht Wt. pose proof (cores_conserved t Wt) as C. pose proof (others_are_other_dags t ltac:(lia)) as O.
    rewrite Wt in O. unfold counts, counted.
    assert (Own_cores : own_cores G run (on_core tau k) t <= count (size G) (fun v => (f v <? j) && runs run t v)
      + count (size G) (fun v => outside tau k j f v && runs run t v)).
    { unfold own_cores, outside, count. rewrite <- sum_plus. apply sum_le. intros v _.
      destruct (on_core tau k v), (runs run t v), (Nat.ltb_spec (f v) j), (Nat.leb_spec j (f v)); simpl; lia. }
    rewrite by_chains in Own_cores.
    assert (J : sum j (fun z => count (size G) (fun v => (f v =? z) && runs run t v)) <= j).
    { apply Nat.le_trans with (sum j (fun _ => 1)); [|rewrite sum_const; lia]. apply sum_le. intros z Hz.
      apply (one_of_a_part G m run run_legal t j f z); auto. intros u v Huv Hv E L. apply D; auto. lia. }
    destruct (lost_tick t); simpl andb in O; cbv iota in O; lia.
  - unfold on_path in Most. rewrite <- !largest_low in Most.
    set (weigh z v := (m - j) * z v - (if outside tau k j f v then z v else 0)) in *.
    assert (Split : forall z e v, (if piece v then z v else 0) + (if piece v then e v else 0)
      = if piece v then z v + e v else 0) by (intros z e v; destruct (piece v); reflexivity).
    refine (no_path_longer_ext G _ _ most (Split (weigh (job_exec s k n)) _) _).
    apply (shared_paths G (head (tau k)) Heads _ (fun v => if piece v then weigh (together (tau k)) v else 0)).
    2: { refine (no_path_longer_ext G _ _ most (fun v => eq_sym (Split (weigh (together (tau k))) _ v)) _). exact Most. }
    apply (sums_of_part G (head (tau k)) piece).
    { intros v Hv. apply (heads_closed G (head (tau k)) Heads piece Closed v Hv). }
    intros b Hb. pose (q := m - j - (if outside tau k j f b then 1 else 0)).
    apply Nat.le_trans with (sum (size G) (fun v => q * (if head (tau k) v =? b then job_exec s k n v else 0))).
    + apply sum_le. intros v Hv. destruct (Nat.eqb_spec (head (tau k) v) b) as [E|]; [|lia].
      unfold q, weigh. rewrite <- E, Out by auto. destruct (outside tau k j f v); nia.
    + rewrite sum_times. specialize (Sums b Hb). apply (Nat.mul_le_mono_l _ _ q) in Sums.
      unfold q, weigh in *. destruct (outside tau k j f b); nia.
Qed.

(** *** Among DAGs that have kept their bounds so far *)

Section kept.
Variable now : nat.
Hypothesis shown_all : forall h, h < K -> bounded h = true -> shown K m tau pol bounded R loss width parts part h.
Hypothesis outranking : forall h, h < K -> h <> k -> outranks pol h k = true -> bounded h = true.
Hypothesis kept : forall h, h < K -> bounded h = true -> kept_before tau s now h (R h).

Definition facts_of (h : nat) : Prop :=
  known (tau h) = true /\ regular (tau h) = true /\ heads_first (graph (tau h)) (head (tau h)) /\
  (forall v, v < size (graph (tau h)) -> on_core tau h (head (tau h) v) = on_core tau h v) /\
  kept_before tau s now h (R h) /\ R h <= period (tau h) /\ enough_cores m tau h (width h) /\
  disjoint_parts (graph (tau h)) (parts h) (part h) /\
  (forall v, v < size (graph (tau h)) -> part h (head (tau h) v) = part h v).

Lemma facts_of_bounded h : h < K -> bounded h = true -> facts_of h.
Proof.
  intros Hh Bh. destruct (shown_all h Hh Bh) as (H0 & H4 & _ & H1 & H2 & H5 & H6 & _ & _ & ? & ? & ? & ? & ? & ? &
    _ & _ & _ & _ & (_ & H3) & _).
  repeat (split; auto); apply H6; auto.
Qed.

Lemma facts h : h < K -> negb (h =? k) && outranks pol h k = true -> facts_of h.
Proof.
  intros Hh O. apply andb_true_iff in O. destruct O as (N & O). apply negb_true_iff, Nat.eqb_neq in N.
  apply facts_of_bounded; auto.
Qed.

Lemma due h : match (if by_deadline pol then Some (deadline (tau k), first_deadline (tau h)) else None) with
  None => True
  | Some (Dk, D) => forall n', may_delay tau pol s k n h n' = true -> release s h n' + D <= release s k n + Dk end.
Proof.
  unfold may_delay. destruct (by_deadline pol); auto. intros n' M.
  apply andb_true_iff in M. destruct M as (_ & M). apply Nat.leb_le, M.
Qed.

Lemma higher_at_most j r x : release s k n + r <= now -> count r (fun t => lost s (release s k n + t)) <= x ->
  sum r (fun t => Nat.min (higher t) (m - j))
  <= sum_over_others K pol k (fun h => whole_work m tau pol R width k j h r) + (m - j) * x.
Proof.
  intros Hr Lo.
  apply Nat.le_trans with (sum r (fun t => sum_over_others K pol k (fun h =>
    Nat.min (cores_of_jobs tau s (may_delay tau pol s k n h) (release s k n + t) h) (m - j))
    + (m - j) * Nat.b2n (lost s (release s k n + t)))).
  - apply sum_le. intros t Ht. unfold higher.
    assert (sum_over_others K pol k (fun h => Nat.min
        (cores_of_jobs tau s (may_delay tau pol s k n h) (release s k n + t) h) (m - j))
      >= Nat.min (sum_over_others K pol k (fun h =>
        cores_of_jobs tau s (may_delay tau pol s k n h) (release s k n + t) h)) (m - j)).
    { apply Nat.le_trans with (1 := min_sum _ _ _). apply sum_le. intros h _.
      destruct (negb (h =? k) && outranks pol h k); lia. }
    destruct (lost s (release s k n + t)); simpl Nat.b2n; lia.
  - rewrite sum_plus, sum_times. apply Nat.add_le_mono; [|apply Nat.mul_le_mono_l, Lo].
    unfold sum_over_others. rewrite sum_swap. apply sum_le. intros h Hh.
    destruct (negb (h =? k) && outranks pol h k) eqn:O; [|rewrite sum_zero; auto].
    destruct (facts h Hh O) as (Fk & Fr & Fh & Fo & F0 & F1 & F2 & F3 & F4).
    apply (kept_workload K m tau pol s rules now h (R h) Hh Fk Fr Fh Fo F0 F1 _ (release s k n) _
             (due h) (m - j) (width h) r); auto.
Qed.

(** *** On one core, with a window that begins earlier, by [d] *)
Lemma window_before full j r x : m = 1 -> j < m -> by_deadline pol = false -> (forall g w, g < K -> keeps (tau g) w = false) ->
  (forall h, h < K -> full h = true -> counts_in_full K tau pol k h) ->
  release s k n + r <= now -> (forall a, count r (fun t => lost s (a + t)) <= x) ->
  let most := sum_over_others K pol k (fun h => if full h then full_work tau h r else whole_work m tau pol R width k j h r)
              + (m - j) * x in
  exists d, Nat.min d r <= most /\ (d < r -> sum (r - d) (fun t => Nat.min (higher t) (m - j)) <= most - d).
Proof.
  intros M1 Hj Rank Keep Full Hr Lo most.
  assert (rules1 : global_run K 1 tau pol s) by (rewrite <- M1; exact rules).
  assert (J0 : j = 0) by lia. assert (One : m - j = 1) by lia.
  assert (Regular : forall h, h < K -> full h = true -> counts_in_full K tau pol k h /\ regular (tau h) = true).
  { intros h Hh Fh. pose proof (Full h Hh Fh) as C. split; [exact C|]. apply (facts h Hh (proj1 C)). }
  destruct (last_quiet K tau pol s rules1 full (release s k n)) as (b & Hb & Q & On).
  set (tick i := Nat.min (cores_above K tau pol s k i + Nat.b2n (lost s i)) 1).
  assert (Total : sum r (fun i => tick (b + i)) <= most).
  { apply Nat.le_trans with (sum r (fun i => sum_over_others K pol k (fun h => Nat.min (task_cores tau s (b + i) h) 1)
      + Nat.b2n (lost s (b + i)))).
    - apply sum_le. intros i _. unfold tick, cores_above, above, sum_over_others.
      pose proof (min_sum K (fun h => if negb (h =? k) && outranks pol h k then task_cores tau s (b + i) h else 0) 1) as Mn.
      assert (sum K (fun h => Nat.min (if negb (h =? k) && outranks pol h k then task_cores tau s (b + i) h else 0) 1)
        = sum K (fun h => if negb (h =? k) && outranks pol h k then Nat.min (task_cores tau s (b + i) h) 1 else 0))
        by (apply sum_ext; intros h _; destruct (negb (h =? k) && outranks pol h k); reflexivity).
      lia.
    - rewrite sum_plus. unfold most. rewrite One, Nat.mul_1_l. apply Nat.add_le_mono; [|apply (Lo b)].
      unfold sum_over_others. rewrite sum_swap. apply sum_le. intros h Hh.
      destruct (negb (h =? k) && outranks pol h k) eqn:O; [|rewrite sum_zero; auto].
      destruct (facts h Hh O) as (Fk & Fr & Fh & Fo & F0 & F1 & F2 & _). destruct (full h) eqn:Fl.
      + apply Nat.le_trans with (2 := window_of_full K tau pol s rules1 full b r h Hh Fl Q Fk Fh Fo).
        apply sum_le. intros i _. lia.
      + pose proof (kept_workload K m tau pol s rules now h (R h) Hh Fk Fr Fh Fo F0 F1 (fun _ => true) b None I
          (m - j) (width h) r ltac:(lia) F2) as Wk.
        unfold whole_work, work_of. rewrite Rank. rewrite One in Wk. unfold cores_used. rewrite One. exact Wk. }
  assert (Before : forall i, b + i < release s k n -> tick (b + i) = 1).
  { intros i Hi. destruct (On (b + i) ltac:(lia)) as (h & n' & w & Lf). unfold tick.
    destruct (lost s (b + i)) eqn:L; [simpl; lia|].
    pose proof (executes_above K tau pol s rules1 Keep k full Regular (b + i) h n' w Lf L). simpl. lia. }
  exists (release s k n - b). split.
  - apply Nat.le_trans with (2 := Total). rewrite <- (Nat.mul_1_r (Nat.min _ _)), <- sum_const.
    apply Nat.le_trans with (sum (Nat.min (release s k n - b) r) (fun i => tick (b + i))); [|apply sum_more; lia].
    apply sum_le. intros i Hi. rewrite Before; lia.
  - intros Hd. set (d := release s k n - b) in *. replace r with (d + (r - d)) in Total at 1 by lia.
    rewrite sum_shift in Total.
    assert (Ed : sum d (fun i => tick (b + i)) = d).
    { rewrite <- (Nat.mul_1_r d) at 2. rewrite <- sum_const. apply sum_ext. intros i Hi. apply Before. lia. }
    apply Nat.le_trans with (sum (r - d) (fun i => tick (b + (d + i)))); [|lia]. apply sum_le. intros i _.
    replace (b + (d + i)) with (release s k n + i) by lia. unfold tick, higher, cores_above, sum_over_others, above.
    assert (sum K (fun h => if negb (h =? k) && outranks pol h k
        then cores_of_jobs tau s (may_delay tau pol s k n h) (release s k n + i) h else 0)
      <= sum K (fun h => if negb (h =? k) && outranks pol h k then task_cores tau s (release s k n + i) h else 0)).
    { apply sum_le. intros h _. destruct (negb (h =? k) && outranks pol h k); [apply some_jobs|lia]. }
    destruct (lost s (release s k n + i)); simpl Nat.b2n; lia.
Qed.

(** Where widths fit, an instance waits in no tick that is not lost. *)
Lemma nobody_waits t : widths_fit K m tau pol bounded width k -> t < period (tau k) -> release s k n + t < now ->
  lost_tick t = false -> somebody_waits G run t = false.
Proof.
  intros ((f & Cover) & Bd & Room) Ht Hn Lo. destruct (somebody_waits G run t) eqn:W; auto. exfalso.
  apply somebody_waits_true in W. destruct W as (v & Rd & Ex). destruct (waiting_instance t v Rd Ex) as (Wv & Ri).
  set (b := release s k n + t) in *.
  destruct (dispatch _ _ _ _ _ rules b k n v in_K is_regular Wv Lo Ri (earlier_at t) Ex) as (All & Ord).
  assert (Own : task_cores tau s b k < width k).
  { unfold b. rewrite only_this_job by auto. apply Nat.le_lt_trans with (1 := job_cores_in_run K m tau s t k n).
    apply (busy_below_width G m run run_legal t _ f v Cover Rd Ex). }
  assert (Le : sum K (fun h => if h =? k then 0 else task_cores tau s b h)
    <= sum K (fun h => if delays tau pol h k then width h else 0)).
  { apply sum_le. intros h Hh. destruct (Nat.eqb_spec h k) as [->|Ne]; [lia|].
    destruct (delays tau pol h k) eqn:De.
    - destruct (facts_of_bounded h Hh (Bd h Hh De)) as (Fk & Fr & _ & _ & F0 & F1 & F2 & _).
      apply (kept_part_width K m tau pol s rules now h (R h) Hh F0 F1 (fun _ => true)
               b (on_core tau h) (width h) Hn
               (fun n' => kept_width K m tau pol s rules now h (R h) Hh Fr F0 F1 b n' (width h) Hn F2)).
    - apply Nat.eq_le_incl, sum_zero. intros n' _. apply sum_zero. intros w Hw.
      destruct (on_core tau h w && executes s b h n' w) eqn:E; auto. exfalso.
      apply andb_true_iff in E. destruct E as (Ow & Ew). pose proof Ow as Ww. apply negb_true_iff in Ww.
      unfold delays in De. apply Nat.eqb_neq in Ne. rewrite Ne in De. simpl in De. apply orb_false_iff in De.
      destruct De as (O & Bl). apply Nat.eqb_neq in Ne.
      destruct (Ord h n' w Hh Hw Ww Ew) as [[P|P]|Kp]; [tauto| |].
      + unfold may_delay in P. rewrite O in P. discriminate.
      + assert (existsb (blocks tau pol k h) (seq 0 (size (graph (tau h)))) = true); [|congruence].
        apply existsb_exists. exists w. split; [apply in_seq; lia|]. unfold blocks, may_block.
        apply Nat.eqb_neq in Ne. rewrite Ne, O, Ow, Kp, orb_true_r. reflexivity. }
  assert (Split : sum K (task_cores tau s b) = task_cores tau s b k + sum K (fun h => if h =? k then 0 else task_cores tau s b h)).
  { pose proof (sum_only K (fun h => if h =? k then task_cores tau s b h else 0) k in_K
      ltac:(intros h _ Ne; cbv beta; destruct (Nat.eqb_spec h k); [lia|auto])) as P.
    cbv beta in P. rewrite Nat.eqb_refl in P. rewrite <- P, <- sum_plus.
    apply sum_ext. intros h _. destruct (h =? k); lia. }
  lia.
Qed.

(** *What is shown of a part of a job is true of it.* *)
Lemma part_in_time q r x : known (tau k) = true -> heads_first G (head (tau k)) ->
  (forall v, v < size G -> on_core tau k (head (tau k) v) = on_core tau k v) -> unblocked K tau pol k \/ all_keep tau k ->
  r <= period (tau k) -> release s k n + r <= now -> (forall a, count r (fun t => lost s (a + t)) <= x) ->
  part_inequality K m tau pol bounded R width k q r x ->
  forall v, v < size G -> q v = true -> finished run r v.
Proof.
  intros Kn Heads On Own Hr Hn Lo
    (Closed & [(j & f & level0 & level1 & most & full & Hj & D & F & Most & Full & H)|(F & len & Len & H)]).
  - destruct (some_or_none K full) as [(h0 & Hh0 & F0)|None].
    + destruct (Full h0 Hh0 F0) as (M1 & Rank & Pos & Keep & _).
      destruct (window_before full j r x M1 Hj Rank Keep ltac:(intros h Hh Fh; apply (Full h Hh Fh)) Hn Lo) as (d & Hd & Early).
      destruct (le_lt_dec r d) as [Ld|Ld]; [nia|]. intros v Hv Qv. apply finished_later with (r - d); [lia|].
      apply (bounded_along_a_path q j f level0 level1 most
        (sum_over_others K pol k (fun h => if full h then full_work tau h r else whole_work m tau pol R width k j h r)
         + (m - j) * x - d) (r - d)); auto; [lia|]. nia.
    + pose proof (higher_at_most j r x Hn (Lo _)) as Higher.
      apply (bounded_along_a_path q j f level0 level1 most
        (sum_over_others K pol k (fun h => whole_work m tau pol R width k j h r) + (m - j) * x) r); auto.
      assert (E : sum_over_others K pol k (fun h => if full h then full_work tau h r else whole_work m tau pol R width k j h r)
        = sum_over_others K pol k (fun h => whole_work m tau pol R width k j h r))
        by (apply sum_ext; intros h Hh; rewrite (None h Hh); reflexivity).
      lia.
  - assert (LenX : no_path_longer G (fun v => if q v then job_exec s k n v else 0) len).
    { apply (shared_length G (head (tau k)) Heads _ (fun v => if q v then together (tau k) v else 0)); [|exact Len].
      apply (sums_of_part G (head (tau k)) q).
      - intros v Hv. apply (heads_closed G (head (tau k)) Heads q Closed v Hv).
      - intros b Hb. apply (shared_executions _ _ _ _ _ rules); auto. }
    refine (along_a_path G m run run_legal (fun _ => 0) (fun _ => 0) 0 _ _ (job_exec s k n) 1 q (fun _ => false)
      (fun t => Nat.b2n (lost_tick t)) r x len ltac:(lia) (fun v _ => le_n _) Closed _ _ _ _).
    + intros d v _ _. rewrite sum_zero; [lia|]. intros i _. destruct (runs run (0 + i) v); auto.
    + intros p d v _ _ _. rewrite sum_zero; [lia|]. intros i _. destruct (runs run (S p + i) v); auto.
    + intros t Ht Wt. destruct (lost_tick t) eqn:L; [simpl; lia|].
      rewrite (nobody_waits t F ltac:(lia) ltac:(lia) L) in Wt. discriminate.
    + apply Nat.le_trans with (2 := Lo (release s k n)). apply sum_le. intros t _. unfold lost_tick.
      destruct (lost s (release s k n + t)); simpl; lia.
    + apply (no_path_longer_ext G _ _ len) with (2 := LenX). intros v. destruct (q v); lia.
    + unfold weight. rewrite sum_zero by auto. lia.
Qed.

End kept.
End one.

(** ** The theorem

    *If the inequality of each bounded DAG holds, then in every run that obeys the rules, with any sporadic releases
    and any executions up to the WCETs, each job of each bounded DAG is complete within its bound.*

    The inequality of a DAG uses the bounds of others, and theirs may use its own.  That is no circle:
    the proof looks at a job all of whose competitors' bounds that end earlier are kept. *)
Theorem set_bounds :
  (forall k, k < K -> bounded k = true -> shown K m tau pol bounded R loss width parts part k) ->
  forall k n, k < K -> bounded k = true -> job_complete tau s (release s k n + R k) k n.
Proof.
  intros Shown.
  assert (Main : forall now k n, k < K -> bounded k = true -> release s k n + R k = now ->
            job_complete tau s (release s k n + R k) k n).
  { induction now as [now IH] using (well_founded_induction lt_wf). intros k n Hk Bk Now.
    assert (Kept : forall h, h < K -> bounded h = true -> kept_before tau s now h (R h)).
    { intros h Hh Bh n' Hn. apply (IH (release s h n' + R h) Hn h n' Hh Bh eq_refl). }
    destruct (Shown k Hk Bk) as (Kn & Reg & Bkn & _ & _ & Heads & Same & Outrank & Own & j & f & len & again & level0 &
      level1 & Hj & Len & D & F & (Hr & HR) & Ineq).
    simpl in Ineq.
    pose proof (periods_positive _ _ _ _ _ rules k Hk) as HT.
    assert (Apart : forall n', n' < n -> release s k n' + period (tau k) <= release s k n).
    { intros n' Hn. pose proof (releases_apart K m tau pol s rules k n' (n - n') Hk) as Ap.
      replace (n' + (n - n')) with n in Ap by lia.
      destruct (n - n') as [|d] eqn:Ed; [lia|]. rewrite Nat.mul_succ_l in Ap. lia. }
    assert (Before : forall n', n' < n -> job_complete tau s (release s k n) k n').
    { intros n' Hn. specialize (Apart n' Hn).
      apply (job_complete_later tau s (release s k n' + R k)); [lia|].
      apply (IH (release s k n' + R k)); auto. lia. }
    pose proof (run_legal k n Hk Reg Before) as L.
    (* what the job executes, and its sums *)
    set (x := job_exec s k n).
    assert (W : within_wcet (graph (tau k)) (job_run K m tau s k n) x) by (intros v _; apply le_n).
    assert (Sums : forall b, b < size (graph (tau k)) ->
      sum (size (graph (tau k))) (fun v => if head (tau k) v =? b then x v else 0) <= together (tau k) b)
      by (intros b Hb; apply (shared_executions _ _ _ _ _ rules); auto).
    pose proof (shared_length _ _ Heads x _ Sums len Len) as LenX.
    pose proof (shared_left_over _ _ Heads x _ Sums j f F) as LeftX.
    pose proof (facts k now Shown Outrank Kept) as Facts. pose proof (due k n) as Due.
    pose proof (higher_at_most k n Hk now Shown Outrank Kept j (R k) (loss k) ltac:(lia) (losses k _ Hk Bk)) as Higher.
    assert (C : complete (graph (tau k)) (job_run K m tau s k n) (R k)).
    { destruct Ineq as [(Waits & Often & [I1|I2])|I3].
      - apply (first_form _ m _ x len j f (R k)
                 (sum_over_others K pol k (fun h => whole_work m tau pol R width k j h (R k))
                  + (m - j) * loss k + blocking K m tau pol k j again level0 level1)); auto;
          [|unfold first_inequality in I1; lia].
        pose proof (blocked_at_most_in_set k n Hk Reg Before Bkn j again level0 level1 (R k) Own Waits Often) as B.
        apply Nat.le_trans with (sum (R k) (fun t => Nat.min (higher k n t) (m - j))
          + sum (R k) (fun t => if somebody_waits (graph (tau k)) (job_run K m tau s k n) t && negb (lost_tick k n t)
                                then Nat.min (low (K * Z) (low_holds k n) t) (m - j) else 0)); [|lia].
        rewrite <- sum_plus. apply sum_le. intros t Ht.
        pose proof (others_are_other_dags k n Hk Reg Before t ltac:(lia)) as O.
        destruct (somebody_waits (graph (tau k)) (job_run K m tau s k n) t && negb (lost_tick k n t)); lia.
      - set (others_of h t := if negb (h =? k) && outranks pol h k
               then cores_of_jobs tau s (may_delay tau pol s k n h) (release s k n + t) h else 0).
        set (phi h x := if negb (h =? k) && outranks pol h k
               then clipped_work m tau pol R width parts part k j h (R k) x else 0).
        set (blocked := blocking K m tau pol k j again level0 level1) in *.
        set (low_of t := if somebody_waits (graph (tau k)) (job_run K m tau s k n) t && negb (lost_tick k n t)
                         then low (K * Z) (low_holds k n) t else 0).
        set (Fn h x := if h <? K then phi h x else if h =? K then (m - j) * loss k else blocked).
        assert (Sum : forall x, sum (S (S K)) (fun h => Fn h x) = sum K (fun h => phi h x) + (m - j) * loss k + blocked).
        { intros y. unfold Fn. cbn [sum]. destruct (Nat.ltb_spec K K); [lia|]. destruct (Nat.ltb_spec (S K) K); [lia|].
          rewrite Nat.eqb_refl. destruct (Nat.eqb_spec (S K) K); [lia|]. do 2 f_equal.
          apply sum_ext. intros h Hh. destruct (Nat.ltb_spec h K); [auto|lia]. }
        assert (Prop' : forall h a b, h < S (S K) -> a <= b -> a * Fn h b <= b * Fn h a).
        { intros h a b Hh Hab. unfold Fn. destruct (Nat.ltb_spec h K).
          * unfold phi. destruct (negb (h =? k) && outranks pol h k); [|lia].
            apply clipped_in_proportion; auto.
          * destruct (h =? K); apply Nat.mul_le_mono_r, Hab. }
        apply (second_form_sharp _ m _ x len j f (R k) (S (S K))
                 (fun h t => if h <? K then others_of h t
                             else if h =? K then (if lost s (release s k n + t) then m else 0) else low_of t)
                 Fn); auto.
        + intros t Ht. pose proof (others_are_other_dags k n Hk Reg Before t ltac:(lia)) as O. cbn [sum].
          destruct (Nat.ltb_spec K K); [lia|]. destruct (Nat.ltb_spec (S K) K); [lia|].
          rewrite Nat.eqb_refl. destruct (Nat.eqb_spec (S K) K); [lia|].
          apply Nat.le_trans with (1 := O). unfold higher. apply Nat.add_le_mono_r, Nat.add_le_mono_r.
          apply sum_le. intros h Hh. destruct (Nat.ltb_spec h K); [auto|lia].
        + intros h w Hh. unfold Fn. destruct (Nat.ltb_spec h K).
          * unfold others_of, phi. destruct (negb (h =? k) && outranks pol h k) eqn:O.
            -- destruct (Facts h H O) as (Fk & Fr & Fh & Fo & F0 & F1 & F2 & F3 & F4).
               apply (kept_clipped K m tau pol s rules now h (R h) H Fk Fr Fh Fo F0 F1 _ (release s k n) _
                        (Due h) (m - j) (width h) (parts h) (part h) (R k) w); auto. lia.
            -- rewrite sum_zero; [lia|]. intros t _. destruct (w t); auto.
          * destruct (Nat.eqb_spec h K).
            -- apply Nat.le_trans with (2 := Nat.mul_le_mono_l _ _ (m - j) (losses k (release s k n) Hk Bk)).
               unfold count. rewrite <- sum_times. apply sum_le. intros t _.
               destruct (w t), (lost s (release s k n + t)); simpl Nat.b2n; lia.
            -- apply Nat.le_trans
                 with (2 := blocked_at_most_in_set k n Hk Reg Before Bkn j again level0 level1 (R k) Own Waits Often).
               apply sum_le. intros t _. unfold low_of.
               destruct (w t), (somebody_waits (graph (tau k)) (job_run K m tau s k n) t && negb (lost_tick k n t)); simpl; lia.
        + unfold second_inequality, sum_over_others in I2. cbv zeta in I2. destruct I2 as [I2|(I2 & Up)].
          * apply one_tick_further; [exact Prop'|]. rewrite Sum. unfold phi. lia.
          * rewrite Sum, Nat.mul_add_distr_l, Nat.mul_1_r.
            assert (Further : sum K (fun h => phi h (R k - len + 1)) <= sum K (fun h => phi h (R k - len))
              + sum K (fun h => if negb (h =? k) && outranks pol h k
                                then rising_work m tau pol R width parts part k j h (R k) (R k - len) else 0)).
            { rewrite <- sum_plus. apply sum_le. intros h _. unfold phi.
              destruct (negb (h =? k) && outranks pol h k); [apply clipped_further|lia]. }
            unfold phi in *. lia.
      - intros v Hv. apply (part_in_time k n Hk Reg Before Bkn now Shown Outrank Kept (fun _ => true) (R k) (loss k)); auto;
          [|lia]. intros u Hu. apply Same, Hu. }
    intros v Hv. apply (job_finished_in_run K m tau pol s rules); auto. }
  intros k n Hk Bk. apply (Main (release s k n + R k)); auto.
Qed.

(** *And a part of a job, such as a sink with all that precedes it, within its own bound.* *)
Theorem part_bounds :
  (forall k, k < K -> bounded k = true -> shown K m tau pol bounded R loss width parts part k) ->
  forall k q r x, k < K -> bounded k = true -> r <= R k -> part_inequality K m tau pol bounded R width k q r x ->
  (forall a, count r (fun t => lost s (a + t)) <= x) ->
  forall n v, v < size (graph (tau k)) -> q v = true -> job_finished s (release s k n + r) k n v.
Proof.
  intros Shown k q r x Hk Bk Hr I Lo n v Hv Qv. pose proof (set_bounds Shown) as Fin.
  destruct (Shown k Hk Bk) as (Kn & Reg & Bkn & _ & _ & Heads & Same & Outrank & Own & ? & ? & ? & ? & ? & ? & _ & _ & _ & _ & (_ & HR) & _).
  assert (Before : forall n', n' < n -> job_complete tau s (release s k n) k n').
  { intros n' Hn. pose proof (releases_apart K m tau pol s rules k n' (n - n') Hk) as Ap.
    replace (n' + (n - n')) with n in Ap by lia. destruct (n - n') as [|d] eqn:Ed; [lia|]. rewrite Nat.mul_succ_l in Ap.
    apply (job_complete_later tau s (release s k n' + R k)); [lia|auto]. }
  apply (job_finished_in_run K m tau pol s rules); auto.
  apply (part_in_time k n Hk Reg Before Bkn (release s k n + r) Shown Outrank
    ltac:(intros h Hh Bh n' _; auto) q r x); auto; [|lia].
  intros u Hu. apply Same, Hu.
Qed.

End proof.

(** ** Policies

    [no_losses]: the platform takes no time of its own, besides what is in WCETs. *)
Definition no_losses (s : set_run) : Prop := forall t, lost s t = false.

Lemma no_losses_bound s r a : no_losses s -> count r (fun t => lost s (a + t)) <= 0.
Proof. intros H. apply Nat.eq_le_incl, sum_zero. intros t _. rewrite H. reflexivity. Qed.

(** Static priorities, DAG 0 the most urgent: only DAGs before it count. *)
Definition static : policy := {| by_deadline := false; outranks := Nat.ltb |}.

(** EDF: of all other DAGs the jobs that are due no later count. *)
Definition edf : policy := {| by_deadline := true; outranks := fun _ _ => true |}.

(** Any work-conserving policy, with or without preemption: all others count. *)
Definition any_order : policy := {| by_deadline := false; outranks := fun _ _ => true |}.

(** All DAGs are bounded, and the platform takes no time of its own. *)
Corollary set_bounds_without_losses K m tau pol s R width parts part :
  global_run K m tau pol s -> no_losses s ->
  (forall k, k < K -> shown K m tau pol (fun _ => true) R (fun _ => 0) width parts part k) ->
  forall k n, k < K -> job_complete tau s (release s k n + R k) k n.
Proof.
  intros Rules No H k n Hk.
  apply (set_bounds K m tau pol s (fun _ => true) R (fun _ => 0) width parts part Rules); auto.
  intros. apply no_losses_bound, No.
Qed.


