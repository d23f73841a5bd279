(** * One core: response times under static priorities and under EDF, for DAGs of which all, some or none keep the core

    [one_core]: if for each distance [a] of a release from the begin of a stretch, and each subtask that may block then,
    there is a time that satisfies one inequality, the target, a part of each job or the whole, is complete within R.
    Any such times will do: nothing is said of least ones, and no bound of another DAG is assumed.  R may exceed the
    period and the deadline.  [one_core_by_start]: where the target's last subtask keeps the core, it has to start.

    Numbers are in ns, and ticks may be 1/N of a ns, for any N; under EDF releases are at whole ns then, for ties are
    decided by the DAGs' numbers.

    Against one_core.rs: of a DAG's own earlier jobs those count that are due no later, at whatever distance they are
    released, at multiples of the period or not ([own_earlier]; it differs where deadlines within a DAG differ by more
    than the period).  Jobs that wait for room, or are skipped or cut, are not in the runs. *)

Require Import Arith Lia Bool List.
From Bounds Require Import Sums Model Chains Workload TaskSet AnyResolution OneCoreStretch.

Lemma div_next x y : 0 < y -> x < S (x / y) * y.
Proof.
  intros H. pose proof (Nat.div_mod x y ltac:(lia)). pose proof (Nat.mod_upper_bound x y ltac:(lia)). nia.
Qed.

Lemma regroup M V (p : nat -> nat -> bool) (c : nat -> nat) :
  sum M (fun m => sum V (fun v => if p m v then c v else 0)) = sum V (fun v => c v * count M (fun m => p m v)).
Proof.
  rewrite sum_swap. apply sum_ext. intros v _. unfold count. rewrite <- sum_times. apply sum_ext.
  intros m _. destruct (p m v); simpl; lia.
Qed.

Lemma sum_one_more n f g k c :
  k < n -> (forall i, i < n -> i <> k -> f i <= g i) -> f k <= g k + c -> sum n f <= sum n g + c.
Proof.
  intros Hk H Hc. apply Nat.le_trans with (sum n (fun i => g i + (if i =? k then c else 0))).
  - apply sum_le. intros i Hi. destruct (Nat.eqb_spec i k) as [->|Ne]; [auto|]. specialize (H i Hi Ne). lia.
  - rewrite sum_plus. rewrite (sum_only n (fun i => if i =? k then c else 0) k); auto.
    + rewrite Nat.eqb_refl. lia.
    + intros i _ Ne. apply Nat.eqb_neq in Ne. rewrite Ne. reflexivity.
Qed.

Lemma whole_numbers N x y t : 0 < N -> N * x + t <= N * y -> t <= 1 -> x + t <= y.
Proof.
  intros HN H Ht. destruct (le_lt_dec (x + t) y) as [L|L]; auto. exfalso. destruct t as [|[|]]; [| |lia].
  - assert (N * (y + 1) <= N * x) by (apply Nat.mul_le_mono_l; lia). nia.
  - assert (N * y <= N * x) by (apply Nat.mul_le_mono_l; lia). lia.
Qed.

(** ** What is to be shown of a DAG k, in ns *)

Section statement.
Variables (K : nat) (tau : nat -> task) (edf : bool) (key : keys) (loss : nat -> nat).
Variables (k : nat) (d : nat) (part : nat -> bool).
(* The target: a part of each job of DAG k, of which no key is above d.  The whole job, or what is before a sink and
   the sink, of the key d. *)

(** Subtask w of DAG h is more urgent than DAG k, under static priorities. *)
Definition above (h w : nat) : bool := (key h w <? d) || (key h w =? d) && (h <? k).

Definition may_count (h w : nat) : bool := edf || (h =? k) || above h w.

(** What may keep the core as a stretch begins, in which the job is released after [a]. *)
Definition may_block (a h w : nat) : bool :=
  keeps (tau h) w && negb (waits (tau h) w) &&
  (if h =? k then (if edf then d + Nat.max (S a) (period (tau k)) <? key k w else d <? key k w)
   else if edf then a + d + Nat.b2n (h <? k) <? key h w else negb (above h w)).

(** Under EDF what blocks was released before the stretch and is due after the job, so the next job of its DAG is
    late. *)
Definition first_release (a : nat) (blocking : option (nat * nat)) (h : nat) : nat :=
  match blocking with
  | Some (h', w) => if edf && (h =? h') then a + d + Nat.b2n (h <? k) + period (tau h) - key h w else 0
  | None => 0
  end.

Definition blocking_time (blocking : option (nat * nat)) : nat :=
  match blocking with Some (h, w) => wcet (tau h) w | None => 0 end.

(** So many of a DAG's jobs are due before the job, or with it if their DAG has the smaller number. *)
Definition jobs_due (a first h w : nat) : nat :=
  let least := key h w + Nat.b2n (k <? h) + first in
  if least <=? a + d then S ((a + d - least) / period (tau h)) else 0.

Definition work_of_other (a first x h : nat) : nat :=
  sum (size (graph (tau h))) (fun w => wcet (tau h) w *
    (if edf then Nat.min (up (x - first) (period (tau h))) (jobs_due a first h w)
     else if above h w then up x (period (tau h)) else 0)).

(** The DAG's own earlier jobs: a subtask that is due by more than a period later counts from a greater distance on. *)
Definition own_earlier (a w : nat) : nat :=
  if edf then let least := Nat.max (period (tau k)) (key k w - d) in
    if least <=? a then S ((a - least) / period (tau k)) else 0
  else if key k w <=? d then a / period (tau k) else 0.

(** And of its later ones what is due sooner than the target, or is more urgent. *)
Definition own_jobs (a x : nat) : nat :=
  sum (size (graph (tau k))) (fun w => wcet (tau k) w *
    (own_earlier a w +
     (if edf then Nat.min (up (x - (a + period (tau k))) (period (tau k))) ((d - key k w - 1) / period (tau k))
      else if key k w <? d then up (x - (a + period (tau k))) (period (tau k)) else 0))).

Definition interference (a : nat) (blocking : option (nat * nat)) (x : nat) : nat :=
  sum K (fun h => if h =? k then own_jobs a x else work_of_other a (first_release a blocking h) x h).

Definition target_work : nat := weight (graph (tau k)) (wcet (tau k)) part.

(** The target is complete at X. *)
Definition completes (a : nat) (blocking : option (nat * nat)) (X : nat) : Prop :=
  blocking_time blocking + target_work + interference a blocking X + loss X <= X.

(** Its last subtask, which keeps the core, starts at X at the latest.  Others that are released at X go first; but not
    if something blocks: that ends before. *)
Definition starts (last a : nat) (blocking : option (nat * nat)) (X : nat) : Prop :=
  let before := target_work - wcet (tau k) last in
  Nat.max 1 (blocking_time blocking) + before + interference a blocking X <= X \/
  blocking_time blocking + before + interference a blocking (X + 1) <= X.

(** The core does not execute for as long as L without a break what is blocking, DAG k, and what goes first. *)
Definition stretch_ends (L : nat) : Prop :=
  0 < L /\ exists blocked,
  (forall a h w, h < K -> w < size (graph (tau h)) -> may_block a h w = true -> wcet (tau h) w <= blocked) /\
  blocked + sum K (fun h => sum (size (graph (tau h))) (fun w => wcet (tau h) w *
    (if may_count h w then up L (period (tau h)) else 0))) + loss L <= L.

Definition blocks_at (a : nat) (blocking : option (nat * nat)) : Prop :=
  match blocking with
  | Some (h, w) => h < K /\ w < size (graph (tau h)) /\ may_block a h w = true
  | None => True
  end.

(** In each run, the subtask of DAG k that is executed last. *)
Definition executed_last (s : set_run) (last : nat) : Prop :=
  last < size (graph (tau k)) /\
  forall t n v, executes s t k n last = true -> v < size (graph (tau k)) -> v <> last -> job_finished s t k n v.

Definition response_shown (R : nat) : Prop :=
  exists L, stretch_ends L /\ forall a, a + R < L -> forall blocking, blocks_at a blocking ->
  exists X, completes a blocking X /\ X <= a + R.

Definition response_shown_by_start (R last : nat) : Prop :=
  keeps (tau k) last = true /\ (forall x, loss x = 0) /\
  exists L, stretch_ends L /\ forall a, a + R < L -> forall blocking, blocks_at a blocking ->
  exists X, starts last a blocking X /\ X + wcet (tau k) last <= a + R.

End statement.

(** ** Why this suffices *)

Lemma never_lost N (loss : nat -> nat) (lost : nat -> bool) :
  0 < N -> (forall a x, count (N * x) (fun t => lost (a + t)) <= N * loss x) -> (forall x, loss x = 0) ->
  forall t, lost t = false.
Proof.
  intros HN H Z t. pose proof (H t 1) as L. rewrite Z, Nat.mul_0_r, Nat.mul_1_r in L.
  pose proof (sum_term N (fun i => Nat.b2n (lost (t + i))) 0 HN) as T. cbv beta in T. rewrite Nat.add_0_r in T.
  unfold count in L. destruct (lost t); simpl in T; [lia|reflexivity].
Qed.

(** Keys in ticks of 1/N ns: deadlines are times, and priorities are not. *)
Definition finer_key (N : nat) (edf : bool) (key : keys) : keys :=
  {| urgent := fun k v => if edf then N * key k v else key k v; number := number key |}.

Section proof.
Variables (K N : nat) (tau : nat -> task) (edf : bool) (key : keys) (loss : nat -> nat) (s : set_run).
Variables (k d n : nat) (part : nat -> bool).
Let tau' k := finer N (tau k).
Let key' := finer_key N edf key.

Hypothesis positive : 0 < N.
Hypothesis rules : keyed_run K tau' edf key' s.
Hypothesis whole_releases : edf = true -> forall k n, k < K -> exists q, release s k n = N * q.
Hypothesis losses : forall a x, count (N * x) (fun t => lost s (a + t)) <= N * loss x.
Hypothesis keys_up : forall h u w, h < K -> edge (graph (tau h)) u w = true ->
  if edf then key h u <= key h w else above key k d h w = true -> above key k d h u = true.
Hypothesis in_K : k < K.
Hypothesis greatest : forall v, v < size (graph (tau k)) -> part v = true -> key k v <= d.
Hypothesis lesser : forall v, v < size (graph (tau k)) -> key k v < d -> part v = true.
Hypothesis part_up : forall u w, edge (graph (tau k)) u w = true -> part w = true -> part u = true.
Hypothesis own_up : forall u w, edge (graph (tau k)) u w = true -> key k w <= d -> key k u <= d.
Hypothesis part_first : forall t v w, part v = true ->
  instance_ready (fun k => finer N (tau k)) s t k n v -> instance_ready (fun k => finer N (tau k)) s t k n w ->
  goes_before edf (finer_key N edf key) s k n w k n v = true -> part w = true.
Hypothesis no_waits : forall h w, h < K -> w < size (graph (tau h)) ->
  may_count edf key k d h w = true -> forall v, v < size (graph (tau h)) -> waits (tau h) v = false.
Hypothesis wcets_known : forall h w, h < K -> w < size (graph (tau h)) ->
  may_count edf key k d h w = true -> known (tau h) = true.
Hypothesis blocking_known : forall a h w, h < K -> w < size (graph (tau h)) ->
  may_block tau edf key k d a h w = true -> known (tau h) = true.

Let plain := on_one_core _ _ _ _ _ rules.

(** The first part of the target's key, and what counts: the job, and what goes before all of the job. *)
Let target := if edf then release s k n + N * d else d.
Let counts h m w :=
  if (h =? k) && (m =? n) then part w else job_before (urgency edf key' s h m w) h m target k n.

Lemma period_positive h : h < K -> 0 < period (tau h).
Proof. intros Hh. pose proof (periods_positive _ _ _ _ _ plain h Hh) as P. simpl in P. nia. Qed.

Lemma apart h m : h < K -> release s h m + N * period (tau h) <= release s h (S m).
Proof. intros Hh. apply (sporadic _ _ _ _ _ plain h m Hh). Qed.

Lemma later_releases h m m' : h < K -> m < m' -> release s h m + N * period (tau h) <= release s h m'.
Proof. intros Hh H. apply (releases_grow K tau' edf key' s rules h m m' Hh H). Qed.

Lemma target_urgency v : v < size (graph (tau k)) -> part v = true -> urgency edf key' s k n v <= target.
Proof.
  intros Hv Pv. unfold urgency, target, key', finer_key; cbn [urgent]. pose proof (greatest v Hv Pv).
  destruct edf; [|auto]. nia.
Qed.

(** What is counted of other jobs, and of the target's. *)
Lemma counts_other h m w : ~ (h = k /\ m = n) ->
  counts h m w = job_before (urgency edf key' s h m w) h m target k n.
Proof. intros Ne. unfold counts. destruct (Nat.eqb_spec h k), (Nat.eqb_spec m n); try reflexivity. tauto. Qed.

Lemma counts_target w : counts k n w = part w.
Proof. unfold counts. rewrite !Nat.eqb_refl. reflexivity. Qed.

(** What goes before the target in its own job is due sooner, or more urgent. *)
Lemma own_before w : urgency edf key' s k n w < target -> key k w < d.
Proof. unfold urgency, target, key', finer_key; cbn [urgent]. destruct edf; [nia|auto]. Qed.

Lemma target_or_not h m : (h = k /\ m = n) \/ ~ (h = k /\ m = n).
Proof. destruct (Nat.eq_dec h k), (Nat.eq_dec m n); tauto. Qed.

Lemma counted_is_in h m w : counts h m w = true -> may_count edf key k d h w = true.
Proof.
  intros C. unfold may_count, above. destruct (target_or_not h m) as [(-> & ->)|Ne].
  - rewrite Nat.eqb_refl. destruct edf; reflexivity.
  - rewrite counts_other in C by exact Ne. unfold target, urgency, key', finer_key in C; cbn [urgent] in C.
    destruct edf; [auto|]. by_keys. lia.
Qed.

Lemma counts_by_edges h m u w :
  h < K -> counts h m w = true -> edge (graph (tau' h)) u w = true -> counts h m u = true.
Proof.
  intros Hh C E. destruct (target_or_not h m) as [(-> & ->)|Ne].
  - rewrite counts_target in *. apply (part_up u w E C).
  - rewrite counts_other in * by exact Ne. pose proof (keys_up h u w Hh E) as U.
    destruct (Nat.eq_dec h k) as [->|Nh].
    + pose proof (own_up u w E) as G.
      unfold above, urgency, target, key', finer_key in *; cbn [urgent] in *. destruct edf; by_keys; [nia|].
      destruct C as [C|(C & D)]; [left; lia|]. specialize (G ltac:(lia)). lia.
    + unfold above, urgency, target, key', finer_key in *; cbn [urgent] in *. destruct edf; by_keys; [nia|lia].
Qed.

Lemma counts_by_jobs h m' m w :
  h < K -> w < size (graph (tau' h)) -> m' < m -> counts h m w = true -> counts h m' w = true.
Proof.
  intros Hh Hw Hm C. pose proof (later_releases h m' m Hh Hm) as A. pose proof (period_positive h Hh) as P.
  assert (U : urgency edf key' s h m' w <= urgency edf key' s h m w).
  { unfold urgency. destruct edf; lia. }
  destruct (target_or_not h m) as [(-> & ->)|Ne].
  - rewrite counts_target in C. rewrite counts_other by lia. pose proof (target_urgency w Hw C). by_keys. lia.
  - rewrite counts_other in C by exact Ne. destruct (target_or_not h m') as [(-> & ->)|Ne'].
    + rewrite counts_target. apply (lesser w Hw), own_before. by_keys. lia.
    + rewrite counts_other by exact Ne'. by_keys. lia.
Qed.

Lemma counts_by_keys t h m v h' m' w : h < K -> h' < K -> counts h m v = true ->
  instance_ready tau' s t h m v -> instance_ready tau' s t h' m' w ->
  goes_before edf key' s h' m' w h m v = true -> counts h' m' w = true.
Proof.
  intros Hh Hh' C Rv Rw B. pose proof Rv as (Hv & _). pose proof Rw as (Hw & _).
  destruct (target_or_not h' m') as [(-> & ->)|Ne'].
  - rewrite counts_target. destruct (target_or_not h m) as [(-> & ->)|Ne].
    + rewrite counts_target in C. apply (part_first t v w C Rv Rw B).
    + rewrite counts_other in C by exact Ne. apply (lesser w Hw), own_before. by_keys. lia.
  - rewrite counts_other by exact Ne'. destruct (target_or_not h m) as [(-> & ->)|Ne].
    + rewrite counts_target in C. pose proof (target_urgency v Hv C). by_keys. lia.
    + rewrite counts_other in C by exact Ne. by_keys. lia.
Qed.

Lemma counts_never_wait h m w :
  h < K -> w < size (graph (tau' h)) -> counts h m w = true ->
  forall v, v < size (graph (tau' h)) -> waits (tau' h) v = false.
Proof. intros Hh Hw C. apply (no_waits h w Hh Hw). apply (counted_is_in h m w C). Qed.

Lemma counted_is_known h m w :
  h < K -> w < size (graph (tau' h)) -> counts h m w = true -> known (tau' h) = true.
Proof. intros Hh Hw C. apply (wcets_known h w Hh Hw). apply (counted_is_in h m w C). Qed.

(** *** The stretch *)

Variables (b e : nat).
Let r := release s k n.
Let a := (r - b) / N.
Hypothesis begins : b <= r.
Hypothesis is_clear : clear K tau' s counts b.
Hypothesis goes_on : forall t', b < t' <= r ->
  exists h m w, pending K tau' s counts t' h m w /\ release s h m < t'.
Variable unfinished : nat.
Hypothesis is_unfinished :
  unfinished < size (graph (tau k)) /\ part unfinished = true /\ ~ job_finished s e k n unfinished.

Lemma target_pending t : t <= e -> pending K tau' s counts t k n unfinished.
Proof.
  intros H. destruct is_unfinished as (Hu & Pu & F). apply pending_before with e; [exact H|].
  split; [exact in_K|]. split; [exact Hu|]. split; [rewrite counts_target; exact Pu|exact F].
Qed.

Lemma whole_stretch x : b + x <= e -> stretch K tau' s counts b (b + x).
Proof.
  intros H t Ht. destruct (le_lt_dec r t) as [L|L].
  - exists k, n, unfinished. split; [apply target_pending; lia|exact L].
  - destruct (goes_on (S t) ltac:(lia)) as (h & m & w & P & R). exists h, m, w.
    split; [|lia]. apply pending_before with (S t); [lia|exact P].
Qed.

(** Under EDF the stretch begins at a release. *)
Lemma whole_begin : edf = true -> exists q, b = N * q.
Proof.
  intros E. destruct (Nat.eq_dec b r) as [->|Ne]; [apply whole_releases; auto|].
  destruct (goes_on (S b) ltac:(lia)) as (h & m & w & (Hh & Hw & C & F) & R).
  destruct (Nat.eq_dec (release s h m) b) as [<-|Nr]; [apply whole_releases; auto|].
  exfalso. apply F. apply job_finished_later with b; [lia|]. apply is_clear; auto. lia.
Qed.

Lemma distance : N * a <= r - b /\ (edf = true -> r = b + N * a).
Proof.
  split; [apply Nat.mul_div_le; lia|]. intros E.
  destruct (whole_begin E) as (q & Hq). destruct (whole_releases E k n in_K) as (p & Hp). fold r in Hp.
  unfold a. rewrite Hp, Hq, <- Nat.mul_sub_distr_l, (Nat.mul_comm N (p - q)), Nat.div_mul by lia.
  rewrite Nat.mul_sub_distr_l. lia.
Qed.

(** Instances released in the first y ticks of the stretch, and those of them that count. *)
Let within y h m := (b <=? release s h m) && (release s h m <? b + y).

Lemma work_of_instance y h m v :
  h < K -> v < size (graph (tau h)) ->
  instance_work s counts b y h m v <= if counts h m v && within y h m then N * wcet (tau h) v else 0.
Proof.
  intros Hh Hv. unfold within.
  destruct (counts h m v) eqn:C; simpl; [|rewrite (not_counted s counts); auto].
  destruct (Nat.leb_spec b (release s h m)) as [L|L]; simpl.
  - destruct (Nat.ltb_spec (release s h m) (b + y)) as [L'|L'].
    + apply (work_within_wcet K tau' edf key' s rules counts counted_is_known b y h m v Hh Hv).
    + rewrite (released_later K tau' edf key' s rules counts); auto.
  - rewrite (released_earlier K tau' edf key' s rules counts); auto.
Qed.

Lemma released_in_time y h p c :
  h < K -> y <= c * (N * period (tau h)) ->
  (forall m, p m = true -> within y h m = true) -> forall M, count M p <= c.
Proof.
  intros Hh Hy H M. apply (jobs_in_window M (release s h) (N * period (tau h)) b (b + y)); [|intros m Hm|lia].
  - intros m. apply apart, Hh.
  - specialize (H m Hm). unfold within in H. apply andb_true_iff in H.
    rewrite Nat.leb_le, Nat.ltb_lt in H. exact H.
Qed.

(** *** What blocks *)

Definition holds (blocking : option (nat * nat)) : Prop :=
  match blocking with
  | None => forall h m w, ~ blocker K tau' s counts b h m w
  | Some (h, w) => exists m, blocker K tau' s counts b h m w
  end.

Lemma blocks_by_key h m w : blocker K tau' s counts b h m w ->
  release s h m < b /\
  (h <> k -> (edf = true -> r + N * d + Nat.b2n (h <? k) <= release s h m + N * key h w) /\
             (edf = false -> above key k d h w = false)) /\
  (h = k -> m < n /\ (edf = true -> r + N * d < release s h m + N * key h w) /\ (edf = false -> d < key k w)).
Proof.
  intros (Hh & Hw & _ & _ & C & Bg & _).
  pose proof (begun_is_released K tau' edf key' s rules b h m w Hh Hw Bg) as R.
  split; [exact R|]. split.
  - intros Ne. rewrite counts_other in C by tauto. split; intros E.
    + destruct (le_lt_dec (r + N * d + Nat.b2n (h <? k)) (release s h m + N * key h w)) as [L|L]; auto. exfalso.
      assert (T : job_before (urgency edf key' s h m w) h m target k n = true); [|congruence].
      unfold job_before, target, urgency, key', finer_key; cbn [urgent]. fold r. rewrite E.
      destruct (Nat.ltb_spec h k); simpl in L; by_keys; lia.
    + destruct (above key k d h w) eqn:A; auto. exfalso.
      assert (T : job_before (urgency edf key' s h m w) h m target k n = true); [|congruence].
      unfold above in A. unfold job_before, target, urgency, key', finer_key; cbn [urgent]. rewrite E. by_keys. lia.
  - intros ->. assert (L : m < n).
    { destruct (lt_dec m n); auto. destruct (Nat.eq_dec m n) as [->|Nm]; [fold r in R; lia|].
      pose proof (later_releases k n m in_K ltac:(lia)). fold r in H. lia. }
    split; [exact L|]. rewrite counts_other in C by lia. split; intros E.
    + destruct (le_lt_dec (release s k m + N * key k w) (r + N * d)) as [G|G]; auto. exfalso.
      assert (T : job_before (urgency edf key' s k m w) k m target k n = true); [|congruence].
      unfold job_before, target, urgency, key', finer_key; cbn [urgent]. fold r. rewrite E. by_keys. lia.
    + destruct (le_lt_dec (key k w) d) as [G|G]; auto. exfalso.
      assert (T : job_before (urgency edf key' s k m w) k m target k n = true); [|congruence].
      unfold job_before, target, urgency, key', finer_key; cbn [urgent]. rewrite E. by_keys. lia.
Qed.

Lemma holding_may_block h m w : blocker K tau' s counts b h m w -> may_block tau edf key k d a h w = true.
Proof.
  intros B. destruct (blocks_by_key h m w B) as (R & Other & Own).
  destruct B as (Hh & Hw & W & Kp & _). simpl in W, Kp.
  unfold may_block. rewrite W, Kp. cbn [negb andb].
  pose proof (fun Ed => proj2 distance Ed) as D.
  destruct (Nat.eqb_spec h k) as [->|Ne];
    (destruct (bool_dec edf true) as [Ed|Ed]; [|apply not_true_is_false in Ed]; rewrite Ed).
  - specialize (D Ed). destruct (whole_begin Ed) as (q & Hq). destruct (whole_releases Ed k m Hh) as (p & Hp).
    destruct (Own eq_refl) as (L & E & _). specialize (E Ed). pose proof (later_releases k m n Hh L) as La. fold r in
      La.
    assert (p + 1 <= q) by (apply (whole_numbers N); auto; lia).
    assert (q + a + d + 1 <= p + key k w).
    { apply (whole_numbers N); auto. rewrite !Nat.mul_add_distr_l. lia. }
    assert (p + period (tau k) + 0 <= q + a).
    { apply (whole_numbers N); auto. rewrite !Nat.mul_add_distr_l. lia. }
    apply Nat.ltb_lt. lia.
  - apply Nat.ltb_lt. apply (proj2 (proj2 (Own eq_refl)) Ed).
  - destruct (Other Ne) as (E & _). specialize (E Ed). specialize (D Ed). destruct (whole_begin Ed) as (q & Hq).
    destruct (whole_releases Ed h m Hh) as (p & Hp). apply Nat.ltb_lt.
    assert (p + 1 <= q) by (apply (whole_numbers N); auto; lia).
    assert (q + a + d + Nat.b2n (h <? k) <= p + key h w); [|lia].
    apply (whole_numbers N); [auto| |destruct (h <? k); simpl; lia]. rewrite !Nat.mul_add_distr_l. lia.
  - rewrite (proj2 (Other Ne) Ed). reflexivity.
Qed.

Lemma late_jobs blocking y h m :
  holds blocking -> h < K -> h <> k -> within y h m = true ->
  b + N * first_release tau edf key k d a blocking h <= release s h m.
Proof.
  intros Ho Hh Nk W. unfold within in W. apply andb_true_iff in W. rewrite Nat.leb_le in W. destruct W as (W & _).
  unfold first_release. destruct blocking as [(h', w)|]; [|lia].
  destruct (bool_dec edf true) as [Ed|Ed]; [|apply not_true_is_false in Ed]; rewrite Ed; simpl; [|lia].
  destruct (Nat.eqb_spec h h') as [<-|Ne]; [|lia].
  destruct Ho as (m' & B). destruct (blocks_by_key h m' w B) as (R & E & _).
  destruct (E Nk) as (E' & _). clear E. rename E' into E. specialize (E Ed).
  assert (L : m' < m).
  { destruct (lt_dec m' m); auto. destruct (Nat.eq_dec m m') as [->|Nm]; [lia|].
    pose proof (later_releases h m m' Hh ltac:(lia)). lia. }
  pose proof (later_releases h m' m Hh L) as La.
  destruct (whole_begin Ed) as (q & Hq). destruct (whole_releases Ed h m' Hh) as (p & Hp).
  destruct (whole_releases Ed h m Hh) as (p' & Hp'). pose proof (proj2 distance Ed) as D.
  assert (p + period (tau h) + 0 <= p').
  { apply (whole_numbers N); auto. rewrite Nat.mul_add_distr_l. lia. }
  assert (q + a + d + Nat.b2n (h <? k) <= p + key h w).
  { apply (whole_numbers N); [auto| |destruct (h <? k); simpl; lia]. rewrite !Nat.mul_add_distr_l. lia. }
  assert (q + 0 <= p') by (apply (whole_numbers N); auto; lia).
  rewrite Hp', Hq, <- Nat.mul_add_distr_l. apply Nat.mul_le_mono_l. lia.
Qed.

Lemma full blocking y : holds blocking -> b + y <= e ->
  y + (if blocking then 1 else 0)
  <= count y (fun t => lost s (b + t)) + counted_work K tau' s counts b y + N * blocking_time tau blocking.
Proof.
  intros Ho He. pose proof (whole_stretch y He) as Str.
  destruct blocking as [(h, w)|]; simpl in *.
  - destruct Ho as (m & B).
    pose proof (full_with_blocker K tau' edf key' s rules counts counts_by_edges counts_by_jobs counts_by_keys
      counts_never_wait b y h m w Str B) as F. simpl in F.
    pose proof B as (Hh & Hw & _).
    specialize (F (blocking_known a h w Hh Hw (holding_may_block h m w B))). lia.
  - pose proof (full_without_blocker K tau' edf key' s rules counts counts_by_edges counts_by_jobs counts_by_keys
      counts_never_wait b y Str Ho). lia.
Qed.

(** *** The work that counts *)

Lemma times_up y x first h c :
  h < K -> y <= N * x -> x - first <= c * period (tau h) -> b + y <= b + N * first + c * (N * period (tau h)).
Proof. intros Hh Hy Hc. nia. Qed.

Lemma jobs_of_other y x h w first M :
  h < K -> h <> k -> w < size (graph (tau h)) -> y <= N * x ->
  (edf = true -> forall m, within y h m = true -> b + N * first <= release s h m) ->
  count M (fun m => counts h m w && within y h m)
  <= if edf then Nat.min (up (x - first) (period (tau h))) (jobs_due tau key k d a first h w)
     else if above key k d h w then up x (period (tau h)) else 0.
Proof.
  intros Hh Ne Hw Hy Late. pose proof (period_positive h Hh) as P.
  assert (In : forall m, counts h m w && within y h m = true ->
    b <= release s h m < b + y /\ job_before (urgency edf key' s h m w) h m target k n = true).
  { intros m H. apply andb_true_iff in H. destruct H as (C & W). split.
    - unfold within in W. apply andb_true_iff in W. rewrite Nat.leb_le, Nat.ltb_lt in W. exact W.
    - unfold counts in C. apply Nat.eqb_neq in Ne. rewrite Ne in C. exact C. }
  destruct (bool_dec edf true) as [Ed|Ed]; [|apply not_true_is_false in Ed]; rewrite Ed.
  - specialize (Late Ed). apply Nat.min_glb.
    + apply (jobs_in_window M (release s h) (N * period (tau h)) (b + N * first) (b + y)).
      * intros m. apply apart, Hh.
      * intros m H. destruct (In m H). apply andb_true_iff in H. destruct H as (_ & W). specialize (Late m W). lia.
      * apply times_up with x; auto. apply up_enough, P.
    + pose proof (proj2 distance Ed) as D.
      assert (Due : forall m, counts h m w && within y h m = true ->
        release s h m + N * key h w + Nat.b2n (k <? h) <= b + N * (a + d) /\ b + N * first <= release s h m).
      { intros m H. destruct (In m H) as (_ & B). apply andb_true_iff in H. destruct H as (_ & W).
        split; [|apply Late, W]. unfold urgency, target, key', finer_key in B; cbn [urgent] in B. fold r in B. rewrite
          Ed in B.
        rewrite Nat.mul_add_distr_l. clear In. clear W.
        destruct (Nat.ltb_spec k h); simpl; by_keys; lia. }
      unfold jobs_due. set (least := key h w + Nat.b2n (k <? h) + first).
      destruct (Nat.leb_spec least (a + d)) as [L|L].
      * apply (jobs_in_window M (release s h) (N * period (tau h)) (b + N * first)
          (b + N * (a + d) + 1 - N * key h w - Nat.b2n (k <? h))).
        -- intros m. apply apart, Hh.
        -- intros m H. destruct (Due m H). lia.
        -- pose proof (div_next (a + d - least) (period (tau h)) P) as Q.
           set (c := S ((a + d - least) / period (tau h))) in *.
           assert (N * (a + d + 1) <= N * (least + c * period (tau h))) by (apply Nat.mul_le_mono_l; lia).
           unfold least in *. rewrite !Nat.mul_add_distr_l in *. destruct (k <? h); simpl in *; nia.
      * assert (Z : count M (fun m => counts h m w && within y h m) = 0); [|lia].
        apply sum_zero. intros m _. destruct (counts h m w && within y h m) eqn:E; auto. exfalso.
        destruct (Due m E) as (D1 & D2). destruct (whole_releases Ed h m Hh) as (p & Hp).
        destruct (whole_begin Ed) as (q & Hq). rewrite Hp, Hq in *.
        assert (q + first + 0 <= p) by (apply (whole_numbers N); auto; lia).
        assert (p + key h w + Nat.b2n (k <? h) <= q + (a + d)); [|unfold least in L; lia].
        apply (whole_numbers N); [auto| |destruct (k <? h); simpl; lia]. rewrite !Nat.mul_add_distr_l in *. lia.
  - destruct (above key k d h w) eqn:A.
    + apply (jobs_in_window M (release s h) (N * period (tau h)) b (b + y)).
      * intros m. apply apart, Hh.
      * intros m H. destruct (In m H). lia.
      * pose proof (up_enough x (period (tau h)) P). nia.
    + assert (Z : count M (fun m => counts h m w && within y h m) = 0); [|lia].
      apply sum_zero. intros m _. destruct (counts h m w && within y h m) eqn:E; auto. exfalso.
      destruct (In m E) as (_ & B). unfold urgency, target, key', finer_key in B; cbn [urgent] in B. rewrite Ed in B.
      assert (T : above key k d h w = true); [|congruence]. unfold above. clear In. by_keys. lia.
Qed.

Lemma own_earlier_jobs y v M : v < size (graph (tau k)) ->
  count M (fun m => (m <? n) && (counts k m v && within y k m)) <= own_earlier tau edf key k d a v.
Proof.
  intros Hv. pose proof (period_positive k in_K) as P.
  assert (In : forall m, (m <? n) && (counts k m v && within y k m) = true ->
    b <= release s k m /\ release s k m + N * period (tau k) <= r /\ urgency edf key' s k m v <= target).
  { intros m H. rewrite !andb_true_iff, Nat.ltb_lt in H. destruct H as (L & C & W).
    pose proof (later_releases k m n in_K L) as A. fold r in A. unfold within in W. apply andb_true_iff in W.
    rewrite Nat.leb_le, Nat.ltb_lt in W. split; [lia|]. split; [exact A|].
    rewrite counts_other in C by lia. by_keys. lia. }
  unfold own_earlier. destruct (bool_dec edf true) as [Ed|Ed]; [|apply not_true_is_false in Ed]; rewrite Ed.
  - set (g := Nat.max (period (tau k)) (key k v - d)). pose proof (proj2 distance Ed) as D.
    assert (Far : forall m, (m <? n) && (counts k m v && within y k m) = true ->
      b <= release s k m /\ release s k m + N * g <= b + N * a).
    { intros m H. destruct (In m H) as (A & B & U). split; [exact A|]. rewrite <- D.
      unfold urgency, target, key', finer_key in U; cbn [urgent] in U. rewrite Ed in U. fold r in U.
      unfold g. destruct (Nat.max_spec (period (tau k)) (key k v - d)) as [(_ & ->)|(_ & ->)]; [|exact B].
      rewrite Nat.mul_sub_distr_l. nia. }
    destruct (Nat.leb_spec g a) as [L|L].
    + apply (jobs_in_window M (release s k) (N * period (tau k)) b (b + N * (a - g) + 1)).
      * intros m. apply apart, in_K.
      * intros m H. destruct (Far m H). rewrite Nat.mul_sub_distr_l.
        pose proof (Nat.mul_le_mono_l g a N L). lia.
      * pose proof (div_next (a - g) (period (tau k)) P) as Q. set (c := S ((a - g) / period (tau k))) in *.
        assert (N * (a - g + 1) <= N * (c * period (tau k))) by (apply Nat.mul_le_mono_l; lia).
        rewrite Nat.mul_add_distr_l in *. nia.
    + assert (Z : count M (fun m => (m <? n) && (counts k m v && within y k m)) = 0); [|lia].
      apply sum_zero. intros m _. destruct ((m <? n) && (counts k m v && within y k m)) eqn:E; auto. exfalso.
      destruct (Far m E). assert (N * (a + 1) <= N * g) by (apply Nat.mul_le_mono_l; lia). lia.
  - destruct (Nat.leb_spec (key k v) d) as [L|L].
    + apply (jobs_in_window M (release s k) (N * period (tau k)) b (r + 1 - N * period (tau k))).
      * intros m. apply apart, in_K.
      * intros m H. destruct (In m H) as (A & B & _). lia.
      * pose proof (div_next a (period (tau k)) P) as Q. pose proof (div_next (r - b) N positive) as Q'. fold a in Q'.
        set (c := a / period (tau k)) in *. nia.
    + assert (Z : count M (fun m => (m <? n) && (counts k m v && within y k m)) = 0); [|lia].
      apply sum_zero. intros m _. destruct ((m <? n) && (counts k m v && within y k m)) eqn:E; auto. exfalso.
      destruct (In m E) as (_ & _ & U). unfold urgency, target, key', finer_key in U; cbn [urgent] in U.
      rewrite Ed in U. lia.
Qed.

Lemma own_later_jobs y x v M :
  v < size (graph (tau k)) -> y <= N * x ->
  count M (fun m => (n <? m) && (counts k m v && within y k m))
  <= if edf then Nat.min (up (x - (a + period (tau k))) (period (tau k))) ((d - key k v - 1) / period (tau k))
     else if key k v <? d then up (x - (a + period (tau k))) (period (tau k)) else 0.
Proof.
  intros Hv Hy. pose proof (period_positive k in_K) as P. pose proof (proj1 distance) as Da.
  assert (In : forall m, (n <? m) && (counts k m v && within y k m) = true ->
    r + N * period (tau k) <= release s k m < b + y /\ urgency edf key' s k m v < target).
  { intros m H. rewrite !andb_true_iff, Nat.ltb_lt in H. destruct H as (L & C & W).
    pose proof (later_releases k n m in_K L) as A. fold r in A. unfold within in W. apply andb_true_iff in W.
    rewrite Nat.leb_le, Nat.ltb_lt in W. split; [lia|]. rewrite counts_other in C by lia. by_keys. lia. }
  assert (Window : count M (fun m => (n <? m) && (counts k m v && within y k m))
                   <= up (x - (a + period (tau k))) (period (tau k))).
  { apply (jobs_in_window M (release s k) (N * period (tau k)) (r + N * period (tau k)) (b + y)).
    - intros m. apply apart, in_K.
    - intros m H. apply (In m H).
    - pose proof (up_enough (x - (a + period (tau k))) (period (tau k)) P) as U.
      set (c := up (x - (a + period (tau k))) (period (tau k))) in *.
      assert (N * x <= N * (a + period (tau k) + c * period (tau k))) by (apply Nat.mul_le_mono_l; lia).
      rewrite !Nat.mul_add_distr_l in *. nia. }
  destruct (bool_dec edf true) as [Ed|Ed]; [|apply not_true_is_false in Ed]; rewrite Ed.
  - apply Nat.min_glb; [exact Window|].
    apply (jobs_in_window M (release s k) (N * period (tau k)) (r + N * period (tau k)) (r + N * (d - key k v))).
    + intros m. apply apart, in_K.
    + intros m H. destruct (In m H) as (W & U). split; [lia|]. unfold urgency, target, key', finer_key in U; cbn
      [urgent] in U.
      rewrite Ed in U. fold r in U. rewrite Nat.mul_sub_distr_l. nia.
    + pose proof (div_next (d - key k v - 1) (period (tau k)) P) as Q.
      set (c := (d - key k v - 1) / period (tau k)) in *.
      assert (N * (d - key k v) <= N * (period (tau k) + c * period (tau k))) by (apply Nat.mul_le_mono_l; lia).
      rewrite !Nat.mul_add_distr_l in *. nia.
  - destruct (Nat.ltb_spec (key k v) d) as [L|L]; [exact Window|].
    assert (Z : count M (fun m => (n <? m) && (counts k m v && within y k m)) = 0); [|lia].
    apply sum_zero. intros m _. destruct ((n <? m) && (counts k m v && within y k m)) eqn:E; auto. exfalso.
    destruct (In m E) as (_ & U). unfold urgency, target, key', finer_key in U; cbn [urgent] in U. rewrite Ed in U. lia.
Qed.

(** [own]: what of the job itself executes at most. *)
Definition at_most (y : nat) (own : nat -> nat) (h m v : nat) : nat :=
  if (h =? k) && (m =? n) then N * own v
  else if counts h m v && within y h m then N * wcet (tau h) v else 0.

Lemma total_at_most y x own blocking M :
  holds blocking -> y <= N * x ->
  sum K (fun h => sum M (fun m => sum (size (graph (tau h))) (at_most y own h m)))
  <= N * (interference K tau edf key k d a blocking x + sum (size (graph (tau k))) own).
Proof.
  intros Ho Hy. rewrite Nat.mul_add_distr_l. unfold interference. rewrite <- sum_times.
  apply (sum_one_more K _ _ k); [exact in_K| |].
  - intros h Hh Ne. pose proof (proj2 (Nat.eqb_neq h k) Ne) as Nb. unfold at_most. rewrite Nb. simpl.
    rewrite (regroup M (size (graph (tau h))) (fun m v => counts h m v && within y h m)).
    unfold work_of_other. rewrite <- sum_times. apply sum_le. intros w Hw. rewrite Nat.mul_assoc.
    apply Nat.mul_le_mono_l. apply jobs_of_other; auto.
    intros _ m W. apply (late_jobs blocking y); auto.
  - unfold at_most. rewrite Nat.eqb_refl. simpl andb. cbv iota.
    apply Nat.le_trans with (sum M (fun m =>
      (if m =? n then N * sum (size (graph (tau k))) own else 0) +
      (sum (size (graph (tau k))) (fun v =>
         if (m <? n) && (counts k m v && within y k m) then N * wcet (tau k) v else 0) +
       sum (size (graph (tau k))) (fun v =>
         if (n <? m) && (counts k m v && within y k m) then N * wcet (tau k) v else 0)))).
    + apply sum_le. intros m _. destruct (Nat.eqb_spec m n) as [->|Ne].
      * rewrite sum_times. lia.
      * rewrite <- sum_plus. simpl. apply sum_le. intros v _.
        destruct (Nat.ltb_spec m n), (Nat.ltb_spec n m), (counts k m v), (within y k m); simpl; lia.
    + rewrite !sum_plus.
      rewrite (regroup M _ (fun m v => (m <? n) && (counts k m v && within y k m))).
      rewrite (regroup M _ (fun m v => (n <? m) && (counts k m v && within y k m))).
      assert (J : sum M (fun m => if m =? n then N * sum (size (graph (tau k))) own else 0)
                  <= N * sum (size (graph (tau k))) own).
      { destruct (lt_dec n M) as [L|L].
        - rewrite (sum_only M _ n L); [rewrite Nat.eqb_refl; lia|].
          intros i _ Ni. apply Nat.eqb_neq in Ni. rewrite Ni. reflexivity.
        - rewrite sum_zero; [lia|]. intros i Hi. destruct (Nat.eqb_spec i n); lia. }
      assert (I : sum (size (graph (tau k))) (fun v => N * wcet (tau k) v
            * count M (fun m => (m <? n) && (counts k m v && within y k m)))
        + sum (size (graph (tau k))) (fun v => N * wcet (tau k) v
            * count M (fun m => (n <? m) && (counts k m v && within y k m)))
        <= N * own_jobs tau edf key k d a x); [|lia].
      unfold own_jobs. rewrite <- sum_plus, <- sum_times. apply sum_le. intros v Hv.
      rewrite Nat.mul_assoc, <- Nat.mul_add_distr_l. apply Nat.mul_le_mono_l.
      apply Nat.add_le_mono; [apply own_earlier_jobs; auto|apply own_later_jobs; auto].
Qed.

Lemma work_at_most y own h m v :
  h < K -> v < size (graph (tau h)) ->
  (v < size (graph (tau k)) -> instance_work s counts b y k n v <= N * own v) ->
  instance_work s counts b y h m v <= at_most y own h m v.
Proof.
  intros Hh Hv O. unfold at_most. destruct (Nat.eqb_spec h k) as [->|Nh]; [|apply work_of_instance; auto].
  destruct (Nat.eqb_spec m n) as [->|Nm]; simpl; [apply O, Hv|apply work_of_instance; auto].
Qed.

Lemma work_of_target y v : v < size (graph (tau k)) ->
  instance_work s counts b y k n v <= N * (if part v then wcet (tau k) v else 0).
Proof.
  intros Hv. destruct (part v) eqn:P.
  - apply (work_within_wcet K tau' edf key' s rules counts counted_is_known b y k n v in_K Hv).
  - rewrite (not_counted s counts); [lia|]. rewrite counts_target. exact P.
Qed.

(** No stretch is as long as that. *)
Lemma no_longer_stretch L : stretch_ends K tau edf key loss k d L -> b + N * L <= e -> False.
Proof.
  intros (HL & blocked & Bl & Ineq) He. set (y := N * L) in *.
  assert (Hy : 0 < y) by (unfold y; nia).
  assert (Some : exists h m v, h < K /\ v < size (graph (tau h)) /\ counts h m v = true /\
    within y h m = true /\ ~ job_finished s (b + y) h m v).
  { destruct (le_lt_dec (b + y) r) as [R|R].
    - destruct (goes_on (b + y) ltac:(lia)) as (h & m & v & (Hh & Hv & C & F) & Rel).
      exists h, m, v. split; [auto|]. split; [auto|]. split; [auto|]. split; [|auto].
      unfold within. apply andb_true_iff. rewrite Nat.leb_le, Nat.ltb_lt. split; [|exact Rel].
      destruct (le_lt_dec b (release s h m)); auto. exfalso.
      apply F. apply job_finished_later with b; [lia|]. apply is_clear; auto.
    - exists k, n, unfinished. destruct (target_pending (b + y) He) as (_ & Hu & C & F).
      split; [auto|]. split; [auto|]. split; [auto|]. split; [|auto].
      unfold within. fold r. apply andb_true_iff. rewrite Nat.leb_le, Nat.ltb_lt. lia. }
  destruct Some as (h & m & v & Hh & Hv & C & W & F).
  set (most h m v := if counts h m v && within y h m then N * wcet (tau h) v else 0).
  assert (Rel : m < b + y).
  { pose proof (release_at_least K 1 tau' any_order s plain h m Hh). unfold within in W. apply andb_true_iff in W.
    rewrite Nat.ltb_lt in W. lia. }
  assert (Less : counted_work K tau' s counts b y
                 < sum K (fun h => sum (b + y) (fun m => sum (size (graph (tau' h))) (most h m)))).
  { apply (counted_less K tau' s counts b y most h m v); auto.
    - intros h' m' v' Hh' Hv'. apply work_of_instance; auto.
    - unfold most. rewrite C, W. simpl.
      apply (unfinished_work K tau' edf key' s rules counts counted_is_known b y h m v Hh Hv C F). }
  assert (Total : sum K (fun h => sum (b + y) (fun m => sum (size (graph (tau' h))) (most h m)))
    <= N * sum K (fun h => sum (size (graph (tau h))) (fun w => wcet (tau h) w *
         (if may_count edf key k d h w then up L (period (tau h)) else 0)))).
  { rewrite <- sum_times. apply sum_le. intros h' Hh'. unfold most. simpl.
    rewrite (regroup (b + y) _ (fun m v => counts h' m v && within y h' m)).
    rewrite <- sum_times. apply sum_le. intros w Hw. rewrite Nat.mul_assoc. apply Nat.mul_le_mono_l.
    pose proof (period_positive h' Hh') as P.
    destruct (may_count edf key k d h' w) eqn:Mc.
    - apply (released_in_time y h'); auto.
      + pose proof (up_enough L (period (tau h')) P). unfold y. nia.
      + intros i Hi. apply andb_true_iff in Hi. apply Hi.
    - assert (Z : count (b + y) (fun m => counts h' m w && within y h' m) = 0); [|lia].
      apply sum_zero. intros i _. destruct (counts h' i w) eqn:Ci; auto.
      apply counted_is_in in Ci. congruence. }
  pose proof (losses b L) as Lo. fold y in Lo.
  apply (Nat.mul_le_mono_l _ _ N) in Ineq. rewrite !Nat.mul_add_distr_l in Ineq. fold y in Ineq.
  assert (No : forall h m w, ~ blocker K tau' s counts b h m w).
  { intros h' m' w' B. pose proof (full (Some (h', w')) y) as Fu. simpl in Fu.
    specialize (Fu (ex_intro _ m' B) He).
    pose proof (holding_may_block h' m' w' B) as Mb. destruct B as (Hh' & Hw' & _).
    pose proof (Nat.mul_le_mono_l _ _ N (Bl a h' w' Hh' Hw' Mb)). lia. }
  pose proof (full None y No He) as Fu. simpl in Fu. lia.
Qed.

(** Some blocking holds, or none: each of them ends in a contradiction. *)
Lemma any_blocking :
  (forall blocking, blocks_at K tau edf key k d a blocking -> holds blocking -> False) -> False.
Proof.
  intros H. apply (H None); [exact I|]. intros h m w B.
  apply (H (Some (h, w))); [|exists m; exact B]. pose proof B as (Hh & Hw & _).
  split; [exact Hh|]. split; [exact Hw|]. apply (holding_may_block h m w B).
Qed.

Lemma not_complete_too_late blocking X :
  completes K tau edf key loss k d part a blocking X -> holds blocking -> b + N * X <= e -> False.
Proof.
  intros Co Ho He.
  pose proof (full blocking (N * X) Ho He) as F. pose proof (losses b X) as Lo.
  destruct (target_pending (b + N * X) He) as (_ & Hu & C & Fi).
  assert (Less : counted_work K tau' s counts b (N * X)
    < N * (interference K tau edf key k d a blocking X + target_work tau k part)).
  { destruct (le_lt_dec (b + N * X) n) as [L|L].
    - apply Nat.le_lt_trans
        with (N * (interference K tau edf key k d a blocking X + sum (size (graph (tau k))) (fun _ => 0))).
      + apply Nat.le_trans with (2 := total_at_most (N * X) X (fun _ => 0) blocking (b + N * X) Ho ltac:(lia)).
        apply (counted_at_most K tau' s counts b (N * X)). intros h m v Hh Hv. apply work_at_most; auto. intros Hk.
        rewrite (released_later K tau' edf key' s rules counts b (N * X) k n v in_K Hk); [lia|].
        pose proof (release_at_least K 1 tau' any_order s plain k n in_K). lia.
      + apply Nat.mul_lt_mono_pos_l; [lia|]. rewrite (sum_zero _ (fun _ => 0)) by auto.
        pose proof (executions _ _ _ _ _ plain k n unfinished in_K Hu) as (Ex1 & Ex2).
        specialize (Ex1 (counts_never_wait k n unfinished in_K Hu C unfinished Hu) (all_regular _ _ _ _ _ rules k in_K)).
        specialize (Ex2 (counted_is_known k n unfinished in_K Hu C)). simpl in Ex2. unfold target_work, weight.
        pose proof (sum_term (size (graph (tau k))) (fun v => if part v then wcet (tau k) v else 0) unfinished Hu) as T.
        cbv beta in T. rewrite counts_target in C. rewrite C in T. nia.
    - apply Nat.lt_le_trans with (2 := total_at_most (N * X) X (fun v => if part v then wcet (tau k) v else 0)
      blocking (b + N * X) Ho ltac:(lia)).
      apply (counted_less K tau' s counts b (N * X) _ k n unfinished); auto.
      + intros h m v Hh Hv. apply work_at_most; auto. intros Hk.
        apply work_of_target, Hk.
      + unfold at_most. rewrite !Nat.eqb_refl. cbn [andb]. rewrite <- (counts_target unfinished), C.
        apply (unfinished_work K tau' edf key' s rules counts counted_is_known b (N * X) k n unfinished in_K Hu C Fi). }
  unfold completes in Co. apply (Nat.mul_le_mono_l _ _ N) in Co. rewrite !Nat.mul_add_distr_l in *. lia.
Qed.

(** A subtask that has not begun has no work. *)
Lemma not_begun_too_late last blocking X :
  last < size (graph (tau k)) -> part last = true -> starts K tau edf key k d part last a blocking X -> (forall x,
    loss x = 0) ->
  holds blocking -> b + (N * X + 1) <= e ->
  has_begun s (b + (N * X + 1)) k n last = true.
Proof.
  intros Hl Pl St No Ho He.
  set (own v := if part v && negb (v =? last) then wcet (tau k) v else 0).
  assert (Own : sum (size (graph (tau k))) own + wcet (tau k) last = target_work tau k part).
  { assert (Z : sum (size (graph (tau k))) (fun v => if v =? last then wcet (tau k) v else 0) = wcet (tau k) last).
    { rewrite (sum_only _ _ last Hl); [rewrite Nat.eqb_refl; reflexivity|].
      intros i _ Ni. apply Nat.eqb_neq in Ni. rewrite Ni. reflexivity. }
    rewrite <- Z, <- sum_plus. unfold target_work, weight. apply sum_ext. intros v _. unfold own.
    destruct (Nat.eqb_spec v last) as [->|Ne]; [rewrite Pl; simpl; lia|destruct (part v); simpl; lia]. }
  destruct (has_begun s (b + (N * X + 1)) k n last) eqn:Bg; auto. exfalso.
  assert (Zero : forall y, y <= N * X + 1 -> instance_work s counts b y k n last = 0).
  { intros y Hy. unfold has_begun in Bg. apply Nat.ltb_ge in Bg.
    pose proof (instance_work_done s counts b y k n last).
    pose proof (done_grows s (b + y) (b + (N * X + 1)) k n last ltac:(lia)). lia. }
  assert (Work : forall y x, y <= N * x -> y <= N * X + 1 -> counted_work K tau' s counts b y
    <= N * (interference K tau edf key k d a blocking x + sum (size (graph (tau k))) own)).
  { intros y x Hy Hx. apply Nat.le_trans with (2 := total_at_most y x own blocking (b + y) Ho Hy).
    apply (counted_at_most K tau' s counts b y). intros h m v Hh Hv. apply work_at_most; auto. intros Hk.
    unfold own. destruct (Nat.eqb_spec v last) as [->|Ne]; [rewrite Zero; lia|]. rewrite andb_true_r.
    apply work_of_target, Hk. }
  assert (Never : forall y, count y (fun t => lost s (b + t)) = 0).
  { intros y. apply sum_zero. intros t _. rewrite (never_lost N loss (lost s) positive losses No). reflexivity. }
  assert (Before : target_work tau k part - wcet (tau k) last = sum (size (graph (tau k))) own) by lia.
  unfold starts in St. cbv zeta in St. rewrite Before in St. destruct St as [St|St].
  - pose proof (full blocking (N * X) Ho ltac:(lia)) as F. rewrite Never in F.
    specialize (Work (N * X) X ltac:(lia) ltac:(lia)).
    apply (Nat.mul_le_mono_l _ _ N) in St. rewrite !Nat.mul_add_distr_l in *.
    pose proof (Nat.le_max_l 1 (blocking_time tau blocking)) as M1.
    pose proof (Nat.le_max_r 1 (blocking_time tau blocking)) as M2.
    apply (Nat.mul_le_mono_l _ _ N) in M1, M2. destruct blocking; simpl in *; lia.
  - pose proof (full blocking (N * X + 1) Ho ltac:(lia)) as F. rewrite Never in F.
    specialize (Work (N * X + 1) (X + 1) ltac:(nia) ltac:(lia)).
    apply (Nat.mul_le_mono_l _ _ N) in St. rewrite !Nat.mul_add_distr_l in *. destruct blocking; lia.
Qed.

End proof.

Section theorems.
Variables (K N : nat) (tau : nat -> task) (edf : bool) (key : keys) (loss : nat -> nat) (s : set_run).
Variables (k d R : nat) (part : nat -> bool).

Hypothesis positive : 0 < N.
Hypothesis rules : keyed_run K (fun k => finer N (tau k)) edf (finer_key N edf key) s.
Hypothesis whole_releases : edf = true -> forall k n, k < K -> exists q, release s k n = N * q.
Hypothesis losses : forall a x, count (N * x) (fun t => lost s (a + t)) <= N * loss x.
Hypothesis keys_up : forall h u w, h < K -> edge (graph (tau h)) u w = true ->
  if edf then key h u <= key h w else above key k d h w = true -> above key k d h u = true.
Hypothesis in_K : k < K.
Hypothesis greatest : forall v, v < size (graph (tau k)) -> part v = true -> key k v <= d.
Hypothesis lesser : forall v, v < size (graph (tau k)) -> key k v < d -> part v = true.
Hypothesis part_up : forall u w, edge (graph (tau k)) u w = true -> part w = true -> part u = true.
Hypothesis own_up : forall u w, edge (graph (tau k)) u w = true -> key k w <= d -> key k u <= d.
Hypothesis part_first : forall n t v w, part v = true ->
  instance_ready (fun k => finer N (tau k)) s t k n v -> instance_ready (fun k => finer N (tau k)) s t k n w ->
  goes_before edf (finer_key N edf key) s k n w k n v = true -> part w = true.
Hypothesis no_waits : forall h w, h < K -> w < size (graph (tau h)) ->
  may_count edf key k d h w = true -> forall v, v < size (graph (tau h)) -> waits (tau h) v = false.
Hypothesis wcets_known : forall h w, h < K -> w < size (graph (tau h)) ->
  may_count edf key k d h w = true -> known (tau h) = true.
Hypothesis blocking_known : forall a h w, h < K -> w < size (graph (tau h)) ->
  may_block tau edf key k d a h w = true -> known (tau h) = true.

(** *In each job the target is complete within R.* *)
Theorem one_core :
  response_shown K tau edf key loss k d part R ->
  forall n v, v < size (graph (tau k)) -> part v = true -> job_finished s (release s k n + N * R) k n v.
Proof.
  intros (L & Ends & Points) n v Hv Pv.
  destruct (le_lt_dec (job_exec s k n v) (job_done s (release s k n + N * R) k n v)) as [F|F]; [exact F|exfalso].
  set (e := release s k n + N * R) in *.
  assert (U : v < size (graph (tau k)) /\ part v = true /\ ~ job_finished s e k n v)
    by (unfold job_finished; split; [exact Hv|split; [exact Pv|lia]]).
  pose (target := if edf then release s k n + N * d else d).
  pose (counts h m w := if (h =? k) && (m =? n) then part w
    else job_before (urgency edf (finer_key N edf key) s h m w) h m target k n).
  destruct (last_clear K _ edf _ s rules counts (release s k n)) as (b & Hb & Cl & On).
  set (a := (release s k n - b) / N).
  assert (Da : N * a <= release s k n - b) by (apply Nat.mul_div_le; lia).
  destruct (le_lt_dec L (a + R)) as [Long|Short].
  - apply (no_longer_stretch K N tau edf key loss s k d n part positive rules whole_releases losses keys_up in_K
      greatest lesser part_up own_up (part_first n) no_waits wcets_known blocking_known b e Hb Cl On v U L Ends).
        unfold e. nia.
  - apply (any_blocking K N tau edf key s k d n part positive rules whole_releases in_K b e Hb Cl On v U).
    intros blocking Bl Ho. destruct (Points a Short blocking Bl) as (X & Co & HX).
    apply (not_complete_too_late K N tau edf key loss s k d n part positive rules whole_releases losses keys_up in_K
      greatest lesser part_up own_up (part_first n) no_waits wcets_known blocking_known b e Hb Cl On v U
      blocking X Co Ho). unfold e. nia.
Qed.

Lemma goes_on_until_its_end t n v :
  v < size (graph (tau k)) -> keeps (tau k) v = true -> waits (tau k) v = false -> (forall x, loss x = 0) ->
  has_begun s (S t) k n v = true ->
  forall j, job_finished s (S t + j) k n v \/ S j <= job_done s (S t + j) k n v.
Proof.
  intros Hv Kp Wv No Bg. induction j as [|j [F|IH]].
  - right. rewrite Nat.add_0_r. unfold has_begun in Bg. apply Nat.ltb_lt in Bg. lia.
  - left. apply job_finished_later with (S t + j); [lia|exact F].
  - destruct (le_lt_dec (job_exec s k n v) (job_done s (S t + j) k n v)) as [F|F].
    + left. apply job_finished_later with (S t + j); [lia|exact F].
    + right. assert (E : executes s (S t + j) k n v = true).
      { apply (keeps_core _ _ _ _ _ (on_one_core _ _ _ _ _ rules) (S t + j) k n v in_K Hv Wv Kp).
        - apply (never_lost N loss (lost s) positive losses No).
        - unfold has_begun in *. apply Nat.ltb_lt. apply Nat.ltb_lt in Bg.
          pose proof (done_grows s (S t) (S t + j) k n v ltac:(lia)). lia.
        - unfold job_finished. lia. }
      rewrite Nat.add_succ_r.
      change (S (S j) <= job_done s (S t + j) k n v + Nat.b2n (executes s (S t + j) k n v)).
      rewrite E. change (Nat.b2n true) with 1. lia.
Qed.

(** *The same for the last subtask of the target, if it keeps the core*: it has to start in time. *)
Theorem one_core_by_start last :
  last < size (graph (tau k)) -> part last = true ->
  response_shown_by_start K tau edf key loss k d part R last ->
  forall n, job_finished s (release s k n + N * R) k n last.
Proof.
  intros Hl Pl (Kp & No & L & Ends & Points) n.
  set (e := release s k n + N * R) in *.
  assert (Mc : may_count edf key k d k last = true)
    by (unfold may_count; rewrite Nat.eqb_refl; destruct edf; reflexivity).
  pose proof (no_waits k last in_K Hl Mc last Hl) as Wl.
  pose proof (executions _ _ _ _ _ (on_one_core _ _ _ _ _ rules) k n last in_K Hl) as (Ex1 & Ex2).
  specialize (Ex1 Wl (all_regular _ _ _ _ _ rules k in_K)). specialize (Ex2 (wcets_known k last in_K Hl Mc)). simpl in Ex2.
  destruct (le_lt_dec (job_exec s k n last) (job_done s e k n last)) as [F|F]; [exact F|exfalso].
  assert (U : last < size (graph (tau k)) /\ part last = true /\ ~ job_finished s e k n last)
    by (unfold job_finished; split; [exact Hl|split; [exact Pl|lia]]).
  pose (target := if edf then release s k n + N * d else d).
  pose (counts h m w := if (h =? k) && (m =? n) then part w
    else job_before (urgency edf (finer_key N edf key) s h m w) h m target k n).
  destruct (last_clear K _ edf _ s rules counts (release s k n)) as (b & Hb & Cl & On).
  set (a := (release s k n - b) / N).
  assert (Da : N * a <= release s k n - b) by (apply Nat.mul_div_le; lia).
  destruct (le_lt_dec L (a + R)) as [Long|Short].
  - apply (no_longer_stretch K N tau edf key loss s k d n part positive rules whole_releases losses keys_up in_K
      greatest lesser part_up own_up (part_first n) no_waits wcets_known blocking_known b e Hb Cl On last U L Ends).
        unfold e. nia.
  - apply (any_blocking K N tau edf key s k d n part positive rules whole_releases in_K b e Hb Cl On last U).
    intros blocking Bl Ho. destruct (Points a Short blocking Bl) as (X & St & HX).
    assert (He : b + (N * X + N * wcet (tau k) last) <= e).
    { apply (Nat.mul_le_mono_l _ _ N) in HX. rewrite !Nat.mul_add_distr_l in HX. unfold e. lia. }
    assert (Bg : has_begun s (b + (N * X + 1)) k n last = true).
    { apply (not_begun_too_late K N tau edf key loss s k d n part positive rules whole_releases losses keys_up in_K
      greatest lesser part_up own_up (part_first n) no_waits wcets_known blocking_known b e Hb Cl On last U
        last blocking X Hl Pl St No Ho). lia. }
    replace (b + (N * X + 1)) with (S (b + N * X)) in Bg by lia.
    assert (Up : S (b + N * X) + (N * wcet (tau k) last - 1) <= e) by lia.
    destruct U as (_ & _ & U). apply U.
    apply job_finished_later with (1 := Up).
    destruct (goes_on_until_its_end (b + N * X) n last Hl Kp Wl No Bg (N * wcet (tau k) last - 1)) as [G|G];
      [exact G|]. unfold job_finished. lia.
Qed.

End theorems.
