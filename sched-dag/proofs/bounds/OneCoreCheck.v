(** * A checker of the form [core] of witnesses, and the proof that it is right

    [core_claim_ok k] computes with binary numbers; [one_core_check_sound] says that what it accepts of DAG k is true of
    all runs by keys, whatever of the other DAGs it accepts.  For some distances of the release from the begin of a
      stretch
    times are listed, and each must satisfy an inequality; any that do are right. *)

Require Import Arith Lia Bool List NArith.
From Bounds Require Import Sums Model Workload TaskSet Checker AnyResolution OneCoreStretch OneCore OneCoreOrder.
Import ListNotations.

(** A DAG, its keys, and what shows its bound.  Of [of_dag] the fields of the task, and [claimed] and [bound] are
  used. *)
Record sink_claim := { sink : nat; sink_bound : N; sink_stretch : N; sink_points : list (N * list N) }.

Record core_claim := {
  of_dag : claim;
  key_at : nat -> N;               (* by vertex: the relative deadline under EDF (the least of the sinks that it
                                      reaches), else the priority *)
  number_at : nat -> nat;          (* by vertex: its subtask's number, which decides ties within a job *)
  keeps_at : nat -> bool;          (* by vertex: whether it keeps the core until it ends *)
  least_urgent : N;                (* static: what has a smaller key counts; or the DAG's greatest key, if that is
    more *)
  longest_stretch : N;             (* the core is never busy for longer with the DAG and what counts for it *)
  points : list (N * list N);      (* distances of a release from the begin of a stretch, and finishes *)
  sinks : list sink_claim          (* bounds of its sinks, or of other vertices *)
}.

Definition no_core_claim : core_claim :=
  {| of_dag := no_claim; key_at := fun _ => 0%N; number_at := fun v => v; keeps_at := fun _ => false; least_urgent :=
    0; longest_stretch := 0; points := []; sinks := [] |}.

Definition core_task (c : core_claim) : task :=
  {| graph := stated_dag (of_dag c);
     wcet := fun v => N.to_nat (wcetN (of_dag c) v);
     head := head_of (of_dag c);
     together := fun v => N.to_nat (togetherN (of_dag c) v);
     waits := fun v => existsb (Nat.eqb v) (wait_list (of_dag c));
     keeps := keeps_at c;
     regular := true;
     known := known_wcets (of_dag c);
     period := N.to_nat (minimum_period (of_dag c));
     deadline := N.to_nat (relative_deadline (of_dag c));
     first_deadline := N.to_nat (least_deadline (of_dag c)) |}.

(** *** Numbers *)

Lemma ltb_ok x y : (N.to_nat x <? N.to_nat y) = (x <? y)%N.
Proof. destruct (N.ltb_spec x y), (Nat.ltb_spec (N.to_nat x) (N.to_nat y)); lia. Qed.

Lemma leb_ok x y : (N.to_nat x <=? N.to_nat y) = (x <=? y)%N.
Proof. destruct (N.leb_spec x y), (Nat.leb_spec (N.to_nat x) (N.to_nat y)); lia. Qed.

Lemma eqb_ok x y : (N.to_nat x =? N.to_nat y) = (x =? y)%N.
Proof. destruct (N.eqb_spec x y), (Nat.eqb_spec (N.to_nat x) (N.to_nat y)); lia. Qed.

Definition tieN (b : bool) : N := if b then 1%N else 0%N.

Lemma tie_ok b : N.to_nat (tieN b) = Nat.b2n b.
Proof. destruct b; reflexivity. Qed.

Definition upN (x y : N) : N := ((x + (y - 1)) / y)%N.

Lemma up_ok x y : N.to_nat (upN x y) = up (N.to_nat x) (N.to_nat y).
Proof. unfold upN, up. to_nat. reflexivity. Qed.

Lemma if_ok (b : bool) x y : N.to_nat (if b then x else y) = if b then N.to_nat x else N.to_nat y.
Proof. destruct b; reflexivity. Qed.

(** The least of some numbers. *)
Fixpoint minN (n : nat) (f : nat -> N) (start : N) : N :=
  match n with 0 => start | S k => N.min (f k) (minN k f start) end.

Lemma minN_le n f start : (minN n f start <= start)%N /\ forall i, i < n -> (minN n f start <= f i)%N.
Proof.
  induction n as [|n (A & B)]; cbn [minN]; split; [lia|lia|lia|].
  intros i Hi. destruct (Nat.eq_dec i n) as [->|Ne]; [lia|]. specialize (B i ltac:(lia)). lia.
Qed.

Fixpoint maxN (n : nat) (f : nat -> N) : N := match n with 0 => 0%N | S k => N.max (f k) (maxN k f) end.

Lemma maxN_ge n f i : i < n -> (f i <= maxN n f)%N.
Proof.
  induction n; cbn [maxN]; intros H; [lia|]. destruct (Nat.eq_dec i n) as [->|Ne]; [lia|].
  specialize (IHn ltac:(lia)). lia.
Qed.

Definition every (n : nat) (p : nat -> bool) : bool := forallb p (seq 0 n).

Lemma every_true n p : every n p = true -> forall i, i < n -> p i = true.
Proof. unfold every. rewrite forallb_forall. intros H i Hi. apply H, in_seq. lia. Qed.

(** *** What long steps and interrupts take in a window: each burst once more than its period fits in *)

Record burst := { carried : N; apart : N; taken : N }.

Definition lossN (bursts : list burst) (x : N) : N :=
  fold_right (fun b sum => (((x + carried b) / apart b + 1) * taken b + sum)%N) 0%N bursts.

Definition losses (bursts : list burst) (x : nat) : nat := N.to_nat (lossN bursts (N.of_nat x)).

(** *** From some distances to all: between two of these all that counts stays *)

Section between.
Variables (K : nat) (tau : nat -> task) (edf : bool) (key : keys) (loss : nat -> nat) (k d : nat).
Variable part : nat -> bool.

Definition counts_alike (c a : nat) : Prop :=
  (forall w, w < size (graph (tau k)) -> own_earlier tau edf key k d a w <= own_earlier tau edf key k d c w) /\
  (edf = true -> forall h w, h < K -> h <> k -> w < size (graph (tau h)) ->
     jobs_due tau key k d a 0 h w <= jobs_due tau key k d c 0 h w).

Lemma up_grows x y z : x <= y -> up x z <= up y z.
Proof. intros H. unfold up. destruct z as [|z]; [reflexivity|]. apply Nat.div_le_mono; lia. Qed.

Lemma may_block_earlier c a h w :
  c <= a -> may_block tau edf key k d a h w = true -> may_block tau edf key k d c h w = true.
Proof.
  intros L. unfold may_block. rewrite !andb_true_iff. intros (A & B). split; [exact A|].
  destruct (h =? k), edf; auto; apply Nat.ltb_lt; apply Nat.ltb_lt in B; lia.
Qed.

Lemma blocks_at_earlier c a blocking :
  c <= a -> blocks_at K tau edf key k d a blocking -> blocks_at K tau edf key k d c blocking.
Proof.
  destruct blocking as [(h, w)|]; [|auto]. intros L (Hh & Hw & B). split; [auto|]. split; [auto|].
  apply (may_block_earlier c a); auto.
Qed.

Lemma jobs_due_late a first h w : jobs_due tau key k d a first h w <= jobs_due tau key k d a 0 h w.
Proof.
  unfold jobs_due. cbv zeta. destruct (Nat.leb_spec (key h w + Nat.b2n (k <? h) + first) (a + d)); [|lia].
  destruct (Nat.leb_spec (key h w + Nat.b2n (k <? h) + 0) (a + d)); [|lia]. apply le_n_S.
  destruct (period (tau h)) as [|p]; [reflexivity|]. apply Nat.div_le_mono; lia.
Qed.

Lemma work_between c a blocking x h : h < K -> h <> k -> c <= a -> counts_alike c a ->
  work_of_other tau edf key k d a (first_release tau edf key k d a blocking h) x h
  <= work_of_other tau edf key k d c (first_release tau edf key k d c blocking h) x h.
Proof.
  intros Hh Ne L (_ & Due). unfold work_of_other. apply sum_le. intros w Hw. apply Nat.mul_le_mono_l.
  unfold first_release.
  destruct (bool_dec edf true) as [Ed|Ed]; [|apply not_true_is_false in Ed]; rewrite Ed; [|lia].
  specialize (Due Ed h w Hh Ne Hw). cbn [andb].
  assert (Zero : Nat.min (up (x - 0) (period (tau h))) (jobs_due tau key k d a 0 h w)
                 <= Nat.min (up (x - 0) (period (tau h))) (jobs_due tau key k d c 0 h w)) by lia.
  destruct blocking as [(h', v)|]; [|exact Zero]. destruct (h =? h'); [|exact Zero].
  set (f y := y + d + Nat.b2n (h <? k) + period (tau h) - key h v).
  change (Nat.min (up (x - f a) (period (tau h))) (jobs_due tau key k d a (f a) h w)
          <= Nat.min (up (x - f c) (period (tau h))) (jobs_due tau key k d c (f c) h w)).
  assert (Fa : f c <= f a) by (unfold f; lia).
  apply Nat.min_le_compat; [apply up_grows; lia|].
  destruct (Nat.eq_dec (f c) 0) as [Z|Z]; [rewrite Z; pose proof (jobs_due_late a (f a) h w); lia|].
  assert (Fe : f a = f c + (a - c)) by (unfold f in *; lia). unfold jobs_due. cbv zeta. rewrite Fe.
  destruct (Nat.leb_spec (key h w + Nat.b2n (k <? h) + (f c + (a - c))) (a + d)); [|lia].
  destruct (Nat.leb_spec (key h w + Nat.b2n (k <? h) + f c) (c + d)); [|lia].
  replace (a + d - (key h w + Nat.b2n (k <? h) + (f c + (a - c))))
    with (c + d - (key h w + Nat.b2n (k <? h) + f c)) by lia. lia.
Qed.

Lemma interference_between c a blocking x : c <= a -> counts_alike c a ->
  interference K tau edf key k d a blocking x <= interference K tau edf key k d c blocking x.
Proof.
  intros L Al. apply sum_le. intros h Hh. destruct (Nat.eqb_spec h k) as [->|Ne]; [|apply work_between; auto].
  destruct Al as (Own & _). unfold own_jobs. apply sum_le. intros w Hw. apply Nat.mul_le_mono_l.
  apply Nat.add_le_mono; [apply Own, Hw|].
  pose proof (up_grows (x - (a + period (tau k))) (x - (c + period (tau k))) (period (tau k)) ltac:(lia)).
  destruct edf; [lia|]. destruct (key k w <? d); lia.
Qed.

Lemma completes_between c a blocking X : c <= a -> counts_alike c a ->
  completes K tau edf key loss k d part c blocking X -> completes K tau edf key loss k d part a blocking X.
Proof. intros L Al. unfold completes. pose proof (interference_between c a blocking X L Al). lia. Qed.

Lemma starts_between last c a blocking X : c <= a -> counts_alike c a ->
  starts K tau edf key k d part last c blocking X -> starts K tau edf key k d part last a blocking X.
Proof.
  intros L Al. unfold starts. cbv zeta. pose proof (interference_between c a blocking X L Al).
  pose proof (interference_between c a blocking (X + 1) L Al). intros [H1|H1]; [left|right]; lia.
Qed.

End between.

Section check.
Variables (edf : bool) (bursts : list burst) (cs : list core_claim).

Definition core_at (k : nat) : core_claim := nth k cs no_core_claim.
Definition core_tasks (k : nat) : task := core_task (core_at k).
Definition core_keys : keys :=
  {| urgent := fun k v => N.to_nat (key_at (core_at k) v); number := fun k => number_at (core_at k) |}.
Definition dag_of (k : nat) : claim := of_dag (core_at k).
Definition is_wait (h w : nat) : bool := existsb (Nat.eqb w) (wait_list (dag_of h)).

Section dag.
Variables (k : nat) (d : N) (part : nat -> bool).  (* the target *)

Definition aboveN (h w : nat) : bool :=
  (key_at (core_at h) w <? d)%N || (key_at (core_at h) w =? d)%N && (h <? k).

Definition may_countN (h w : nat) : bool := edf || (h =? k) || aboveN h w.

Definition may_blockN (a : N) (h w : nat) : bool :=
  keeps_at (core_at h) w && negb (is_wait h w) &&
  (if h =? k then
     (if edf then (d + N.max (N.succ a) (minimum_period (dag_of k)) <? key_at (core_at k) w)%N
      else (d <? key_at (core_at k) w)%N)
   else if edf then (a + d + tieN (h <? k)%nat <? key_at (core_at h) w)%N else negb (aboveN h w)).

Definition first_releaseN (a : N) (blocking : option (nat * nat)) (h : nat) : N :=
  match blocking with
  | Some (h', w) => if edf && (h =? h')
      then (a + d + tieN (h <? k)%nat + minimum_period (dag_of h) - key_at (core_at h) w)%N else 0%N
  | None => 0%N
  end.

Definition blocking_timeN (blocking : option (nat * nat)) : N :=
  match blocking with Some (h, w) => wcetN (dag_of h) w | None => 0%N end.

Definition jobs_dueN (a first : N) (h w : nat) : N :=
  let least := (key_at (core_at h) w + tieN (k <? h)%nat + first)%N in
  if (least <=? a + d)%N then ((a + d - least) / minimum_period (dag_of h) + 1)%N else 0%N.

Definition work_of_otherN (a first x : N) (h : nat) : N :=
  let jobs := upN (if edf then x - first else x) (minimum_period (dag_of h)) in
  sumN (vertices (dag_of h)) (fun w => wcetN (dag_of h) w *
    (if edf then N.min jobs (jobs_dueN a first h w) else if aboveN h w then jobs else 0))%N.

Definition own_earlierN (a : N) (w : nat) : N :=
  let t := minimum_period (dag_of k) in
  if edf then
    let least := N.max t (key_at (core_at k) w - d) in
    if (least <=? a)%N then ((a - least) / t + 1)%N else 0%N
  else if (key_at (core_at k) w <=? d)%N then (a / t)%N else 0%N.

Definition own_jobsN (a x : N) : N :=
  let t := minimum_period (dag_of k) in
  let later := upN (x - (a + t)) t in
  sumN (vertices (dag_of k)) (fun w => wcetN (dag_of k) w *
    (own_earlierN a w + (if edf then N.min later ((d - key_at (core_at k) w - 1) / t)
               else if (key_at (core_at k) w <? d) then later else 0)))%N.

Definition interferenceN (a : N) (blocking : option (nat * nat)) (x : N) : N :=
  sumN (length cs) (fun h =>
    if h =? k then own_jobsN a x else work_of_otherN a (first_releaseN a blocking h) x h).

Definition target_workN : N := weightN (dag_of k) (wcetN (dag_of k)) part.

Definition completesN (a : N) (blocking : option (nat * nat)) (X : N) : bool :=
  (blocking_timeN blocking + target_workN + interferenceN a blocking X + lossN bursts X <=? X)%N.

Definition startsN (last : nat) (a : N) (blocking : option (nat * nat)) (X : N) : bool :=
  let before := (target_workN - wcetN (dag_of k) last)%N in
  (N.max 1 (blocking_timeN blocking) + before + interferenceN a blocking X <=? X)%N ||
  (blocking_timeN blocking + before + interferenceN a blocking (X + 1) <=? X)%N.

(** The next distance at which something else counts. *)
Definition followingN (a : N) : N :=
  let t := minimum_period (dag_of k) in
  let own := ((a / t + 1) * t)%N in
  if edf then
    minN (length cs) (fun h => if h =? k then
        minN (vertices (dag_of k)) (fun w =>
          let least := N.max t (key_at (core_at k) w - d) in
          if (a <? least)%N then least else (least + ((a - least) / t + 1) * t)%N) own
      else
      minN (vertices (dag_of h)) (fun w =>
        let least := (key_at (core_at h) w + tieN (k <? h)%nat)%N in
        let u := minimum_period (dag_of h) in
        if (a + d <? least)%N then (least - d)%N else (least + ((a + d - least) / u + 1) * u - d)%N) own) own
  else own.

(** *** They are what OneCore.v states *)

Notation nat_of := N.to_nat.

Lemma above_ok h w : above core_keys k (nat_of d) h w = aboveN h w.
Proof. unfold above, aboveN, core_keys; cbn [urgent number]. rewrite ltb_ok, eqb_ok. reflexivity. Qed.

Lemma may_count_ok h w : may_count edf core_keys k (nat_of d) h w = may_countN h w.
Proof. unfold may_count, may_countN. rewrite above_ok. reflexivity. Qed.

Lemma may_block_ok a h w : may_block core_tasks edf core_keys k (nat_of d) (nat_of a) h w = may_blockN a h w.
Proof.
  unfold may_block, may_blockN. rewrite above_ok. change (keeps (core_tasks h) w) with (keeps_at (core_at h) w).
  change (waits (core_tasks h) w) with (is_wait h w). f_equal.
  change (period (core_tasks k)) with (nat_of (minimum_period (dag_of k))).
  rewrite <- tie_ok, <- N2Nat.inj_succ, <- N2Nat.inj_max, <- !N2Nat.inj_add. unfold core_keys; cbn [urgent number].
  rewrite !ltb_ok. reflexivity.
Qed.

Lemma first_release_ok a blocking h :
  first_release core_tasks edf core_keys k (nat_of d) (nat_of a) blocking h = nat_of (first_releaseN a blocking h).
Proof.
  unfold first_release, first_releaseN. destruct blocking as [(h', w)|]; [|reflexivity].
  rewrite if_ok. to_nat. rewrite tie_ok. reflexivity.
Qed.

Lemma jobs_due_ok a first h w :
  jobs_due core_tasks core_keys k (nat_of d) (nat_of a) (nat_of first) h w = nat_of (jobs_dueN a first h w).
Proof.
  unfold jobs_due, jobs_dueN. cbv zeta. rewrite if_ok. unfold core_keys; cbn [urgent number].
  rewrite <- tie_ok, <- !N2Nat.inj_add, leb_ok. to_nat. rewrite Nat.add_1_r. reflexivity.
Qed.

Lemma work_of_other_ok a first x h :
  work_of_other core_tasks edf core_keys k (nat_of d) (nat_of a) (nat_of first) (nat_of x) h
  = nat_of (work_of_otherN a first x h).
Proof.
  symmetry. unfold work_of_other, work_of_otherN. cbv zeta. apply sumN_ok. intros w _.
  rewrite N2Nat.inj_mul. change (wcet (core_tasks h) w) with (nat_of (wcetN (dag_of h) w)). f_equal.
  change (period (core_tasks h)) with (nat_of (minimum_period (dag_of h))).
  rewrite above_ok, jobs_due_ok, <- N2Nat.inj_sub, <- !up_ok.
  destruct edf; [rewrite N2Nat.inj_min; reflexivity|]. rewrite if_ok. reflexivity.
Qed.

Lemma own_earlier_ok a w : own_earlier core_tasks edf core_keys k (nat_of d) (nat_of a) w = nat_of (own_earlierN a w).
Proof.
  unfold own_earlier, own_earlierN. cbv zeta.
  change (period (core_tasks k)) with (nat_of (minimum_period (dag_of k))). unfold core_keys; cbn [urgent number].
  rewrite <- N2Nat.inj_sub, <- N2Nat.inj_max, !leb_ok, !if_ok. to_nat. rewrite Nat.add_1_r. reflexivity.
Qed.

Lemma own_jobs_ok a x :
  own_jobs core_tasks edf core_keys k (nat_of d) (nat_of a) (nat_of x) = nat_of (own_jobsN a x).
Proof.
  symmetry. unfold own_jobs, own_jobsN. cbv zeta. apply sumN_ok. intros w _.
  rewrite N2Nat.inj_mul. change (wcet (core_tasks k) w) with (nat_of (wcetN (dag_of k) w)). f_equal.
  rewrite own_earlier_ok. change (period (core_tasks k)) with (nat_of (minimum_period (dag_of k))).
  unfold core_keys; cbn [urgent number].
  set (c := minimum_period (dag_of k)).
  replace (nat_of x - (nat_of a + nat_of c)) with (nat_of (x - (a + c))) by lia.
  rewrite <- up_ok, ltb_ok, N2Nat.inj_add. f_equal.
  rewrite !if_ok. rewrite N2Nat.inj_min, N2Nat.inj_div, !N2Nat.inj_sub. reflexivity.
Qed.

Lemma interference_ok a blocking x :
  interference (length cs) core_tasks edf core_keys k (nat_of d) (nat_of a) blocking (nat_of x)
  = nat_of (interferenceN a blocking x).
Proof.
  symmetry. apply sumN_ok. intros h _. rewrite if_ok, first_release_ok, work_of_other_ok, own_jobs_ok. reflexivity.
Qed.

Lemma blocking_time_ok blocking : blocking_time core_tasks blocking = nat_of (blocking_timeN blocking).
Proof. destruct blocking as [(h, w)|]; reflexivity. Qed.

Lemma target_work_ok : target_work core_tasks k part = nat_of target_workN.
Proof. symmetry. apply weightN_ok. Qed.

Lemma loss_ok x : losses bursts (nat_of x) = nat_of (lossN bursts x).
Proof. unfold losses. rewrite N2Nat.id. reflexivity. Qed.

Lemma completes_ok a blocking X : completesN a blocking X = true ->
  completes (length cs) core_tasks edf core_keys (losses bursts) k (nat_of d) part (nat_of a) blocking (nat_of X).
Proof.
  unfold completesN, completes. intros H. apply N.leb_le in H.
  rewrite blocking_time_ok, target_work_ok, interference_ok, loss_ok. lia.
Qed.

Lemma starts_ok last a blocking X : startsN last a blocking X = true ->
  starts (length cs) core_tasks edf core_keys k (nat_of d) part last (nat_of a) blocking (nat_of X).
Proof.
  unfold startsN, starts. cbv zeta. intros H. apply orb_true_iff in H. rewrite !N.leb_le in H.
  change (wcet (core_tasks k) last) with (nat_of (wcetN (dag_of k) last)).
  rewrite blocking_time_ok, target_work_ok.
  replace (nat_of X + 1) with (nat_of (X + 1)) by lia. rewrite !interference_ok. destruct H; [left|right]; lia.
Qed.

Lemma following_ok (c a : N) : k < length cs -> (0 < minimum_period (dag_of k))%N ->
  (forall h, h < length cs -> (0 < minimum_period (dag_of h))%N) -> (a < followingN c)%N -> (c <= a)%N ->
  counts_alike (length cs) core_tasks edf core_keys k (nat_of d) (nat_of c) (nat_of a).
Proof.
  intros Hk Pk P F L.
  assert (Own : (followingN c <= (c / minimum_period (dag_of k) + 1) * minimum_period (dag_of k))%N).
  { unfold followingN. destruct edf; [|lia]. apply minN_le. }
  assert (Own' : (a < (c / minimum_period (dag_of k) + 1) * minimum_period (dag_of k))%N) by lia.
  set (t := minimum_period (dag_of k)) in *.
  split.
  - intros w Hw. change (w < vertices (dag_of k)) in Hw. rewrite !own_earlier_ok. unfold own_earlierN. cbv zeta. fold t.
    destruct (bool_dec edf true) as [Ed|Ed]; [|apply not_true_is_false in Ed]; rewrite Ed.
    + unfold followingN in F. rewrite Ed in F. cbv zeta in F. fold t in F.
      set (g h := if h =? k then _ else _) in F.
      pose proof (proj2 (minN_le (length cs) g ((c / t + 1) * t)%N) k Hk) as G.
      unfold g in G at 2. rewrite Nat.eqb_refl in G.
      pose proof (proj2 (minN_le (vertices (dag_of k)) (fun w =>
          let least := N.max t (key_at (core_at k) w - d) in
          if (c <? least)%N then least else (least + ((c - least) / t + 1) * t)%N) ((c / t + 1) * t)%N) w Hw) as V.
      cbv beta zeta in V. set (least := N.max t (key_at (core_at k) w - d)) in *.
      assert (A : (a < if (c <? least)%N then least else least + ((c - least) / t + 1) * t)%N).
      { apply N.lt_le_trans with (1 := F). apply N.le_trans with (1 := G). exact V. }
      destruct (N.ltb_spec c least) as [H|H].
      * destruct (N.leb_spec least a); [lia|]. simpl. lia.
      * destruct (N.leb_spec least a); [|lia]. destruct (N.leb_spec least c); [|lia].
        assert (((a - least) / t < (c - least) / t + 1)%N); [|lia]. apply N.div_lt_upper_bound; lia.
    + destruct (key_at (core_at k) w <=? d)%N; [|simpl; lia].
      assert ((a / t < c / t + 1)%N); [|lia]. apply N.div_lt_upper_bound; lia.
  - intros Ed h w Hh Ne Hw. change (w < vertices (dag_of h)) in Hw. change 0 with (nat_of 0).
    rewrite !jobs_due_ok. unfold jobs_dueN. cbv zeta. rewrite !N.add_0_r.
    unfold followingN in F. rewrite Ed in F.
    set (g h := if h =? k then _ else _) in F.
    pose proof (proj2 (minN_le (length cs) g ((c / t + 1) * t)%N) h Hh) as G.
    apply Nat.eqb_neq in Ne. unfold g in G at 2. rewrite Ne in G.
    pose proof (proj2 (minN_le (vertices (dag_of h)) (fun w =>
        let least := (key_at (core_at h) w + tieN (k <? h)%nat)%N in
        let u := minimum_period (dag_of h) in
        if (c + d <? least)%N then (least - d)%N else (least + ((c + d - least) / u + 1) * u - d)%N)
        ((c / t + 1) * t)%N) w Hw) as V. cbv beta zeta in V.
    set (least := (key_at (core_at h) w + tieN (k <? h)%nat)%N) in *.
    set (u := minimum_period (dag_of h)) in *. specialize (P h Hh). fold u in P.
    assert (A : (a < if (c + d <? least)%N then least - d else least + ((c + d - least) / u + 1) * u - d)%N).
    { apply N.lt_le_trans with (1 := F). apply N.le_trans with (1 := G). exact V. }
    destruct (N.ltb_spec (c + d) least) as [H|H].
    + destruct (N.leb_spec least (a + d)); [lia|]. simpl. lia.
    + destruct (N.leb_spec least (a + d)); [|lia]. destruct (N.leb_spec least (c + d)); [|lia].
      assert (((a + d - least) / u < (c + d - least) / u + 1)%N); [|lia].
      apply N.div_lt_upper_bound; lia.
Qed.

(** ** What is checked *)

(** A DAG that some run can have: WCETs and periods of 0 are refused, as all would be true then. *)
Definition dag_fine (h : nat) : bool :=
  (0 <? minimum_period (dag_of h))%N && edges_ok (dag_of h) &&
  (negb (known_wcets (dag_of h)) || every (vertices (dag_of h)) (fun v => is_wait h v || (0 <? wcetN (dag_of h) v)%N)).

Definition no_waits_in (h : nat) : bool := match wait_list (dag_of h) with [] => true | _ => false end.

(** What counts has WCETs and no waits, and what precedes it counts; what may block has WCETs. *)
Definition counting_fine (h : nat) : bool :=
  every (vertices (dag_of h)) (fun w =>
    (negb (may_countN h w) || no_waits_in h && known_wcets (dag_of h)) &&
    forallb (fun u => if edf then (key_at (core_at h) u <=? key_at (core_at h) w)%N else negb (aboveN h w) || aboveN h
      u)
      (nth w (preds (dag_of h)) []) &&
    (negb (may_blockN 0 h w) || known_wcets (dag_of h))).

Definition most_blocking : N :=
  maxN (length cs) (fun h => maxN (vertices (dag_of h)) (fun w => if may_blockN 0 h w then wcetN (dag_of h) w else
    0%N)).

Definition stretch_ok (L : N) : bool :=
  (0 <? L)%N &&
  (most_blocking + sumN (length cs) (fun h => sumN (vertices (dag_of h)) (fun w => wcetN (dag_of h) w *
     (if may_countN h w then upN L (minimum_period (dag_of h)) else 0))) + lossN bursts L <=? L)%N.

(** *** The order in which a job's subtasks start.  How it is found does not matter. *)

Definition next_start (started : list nat) : option nat :=
  fold_left (fun found v =>
    if existsb (Nat.eqb v) started then found else
    if forallb (fun u => existsb (Nat.eqb u) started) (nth v (preds (dag_of k)) [])
    then match found with
      | Some u => if (key_at (core_at k) v <? key_at (core_at k) u)%N ||
                     (key_at (core_at k) v =? key_at (core_at k) u)%N && (number_at (core_at k) v <? number_at
                       (core_at k) u)
                  then Some v else found
      | None => Some v
      end
    else found) (seq 0 (vertices (dag_of k))) None.

(** The last one comes first. *)
Fixpoint start_sequence (n : nat) (started : list nat) : list nat :=
  match n with
  | 0 => started
  | S n => match next_start started with Some v => start_sequence n (v :: started) | None => started end
  end.

Fixpoint place_in (l : list nat) (v : nat) : nat :=
  match l with [] => 0 | u :: l => if u =? v then length l else place_in l v end.

Definition order_ok (place : nat -> nat) (last : nat) : bool :=
  let n := vertices (dag_of k) in
  (last <? n) &&
  every n (fun v => forallb (fun u => (place u <? place v) && (key_at (core_at k) u <=? key_at (core_at k) v)%N)
                      (nth v (preds (dag_of k)) []) &&
                    ((v =? last) || (place v <? place last))) &&
  every n (fun x => every n (fun y =>
    if place y <? place x then
      (key_at (core_at k) y <? key_at (core_at k) x)%N ||
      (key_at (core_at k) y =? key_at (core_at k) x)%N && (number_at (core_at k) y <? number_at (core_at k) x) ||
      existsb (fun u => (u =? y) || (place y <? place u)) (nth x (preds (dag_of k)) [])
    else true)).

(** What holds of the target: no key in it is above d, what has a lesser key is in it, and so is what precedes it. *)
Definition part_ok : bool :=
  every (vertices (dag_of k)) (fun v =>
    (if part v then (key_at (core_at k) v <=? d)%N else negb (key_at (core_at k) v <? d)%N) &&
    forallb (fun u => (if part v then part u else true) &&
                      (if (key_at (core_at k) v <=? d)%N then (key_at (core_at k) u <=? d)%N else true))
      (nth v (preds (dag_of k)) [])).

(** *** The times.  [last]: the target's last subtask, if it keeps the core and so only has to start; [R]: the bound. *)

Definition fits (R : N) (last : option nat) (a : N) (blocking : option (nat * nat)) (finish : N) : bool :=
  (finish <=? a + R)%N &&
  match last with
  | None => completesN a blocking finish
  | Some v => (wcetN (dag_of k) v <=? finish)%N && startsN v a blocking (finish - wcetN (dag_of k) v)
  end.

Definition point_ok (R : N) (last : option nat) (a : N) (times : list N) : bool :=
  let ts := times ++ [(a + R)%N] in
  existsb (fits R last a None) ts &&
  every (length cs) (fun h => every (vertices (dag_of h)) (fun w =>
    if may_blockN a h w then existsb (fits R last a (Some (h, w))) ts else true)).

(** All distances from [wanted] on, up to where the stretch ends within the bound. *)
Fixpoint points_ok (R : N) (last : option nat) (L wanted : N) (ps : list (N * list N)) : bool :=
  match ps with
  | [] => (L <=? wanted + R)%N
  | (a, times) :: ps => (a <=? wanted)%N && point_ok R last a times && points_ok R last L (followingN a) ps
  end.

Definition shown (R : N) (last : option nat) (L : N) (ps : list (N * list N)) : bool :=
  (k <? length cs) && every (length cs) dag_fine && every (length cs) counting_fine && stretch_ok L && part_ok &&
  points_ok R last L 0 ps.

End dag.

(** *The checker.*  A sink's target is what starts before it in its job, or all that is due no later.  The whole job's
  last subtask has to start only, if it keeps the core. *)
Definition no_bursts : bool := match bursts with [] => true | _ => false end.

Definition counted_key (k : nat) : N :=
  N.max (least_urgent (core_at k)) (maxN (vertices (dag_of k)) (key_at (core_at k))).

Definition job_ok (k : nat) (order : nat -> nat) (last : nat) : bool :=
  let c := core_at k in
  let mode := if keeps_at c last && no_bursts then if order_ok k order last then Some last else None else None in
  shown k (counted_key k) (fun _ => true) (bound (dag_of k)) mode (longest_stretch c) (points c).

Definition sink_ok (k : nat) (order : nat -> nat) (last : nat) (of : sink_claim) : bool :=
  let c := core_at k in
  let v := sink of in
  let d := key_at c v in
  (v <? vertices (dag_of k)) &&
  if order_ok k order last
  then shown k d (fun w => order w <=? order v) (sink_bound of) (if keeps_at c v && no_bursts then Some v else None)
         (sink_stretch of) (sink_points of)
  else shown k d (fun w => (key_at c w <=? d)%N) (sink_bound of) None (sink_stretch of) (sink_points of).

(** By subtask its place in the order in which they start, and the last one. *)
Definition places_of (k : nat) : list nat * nat :=
  let sequence := start_sequence k (vertices (dag_of k)) [] in
  (map (place_in sequence) (seq 0 (vertices (dag_of k))), hd 0 sequence).

Definition core_claim_ok (k : nat) : bool :=
  let (places, last) := places_of k in job_ok k (fun v => nth v places 0) last.

Definition core_sinks_ok (k : nat) : list bool :=
  let (places, last) := places_of k in map (sink_ok k (fun v => nth v places 0) last) (sinks (core_at k)).

Definition one_core_check : bool :=
  every (length cs) (fun k =>
    (if claimed (dag_of k) then core_claim_ok k else true) && forallb (fun b => b) (core_sinks_ok k)).

(** ** It is right *)

Lemma no_waits_sound h v : no_waits_in h = true -> waits (core_tasks h) v = false.
Proof.
  unfold no_waits_in. change (waits (core_tasks h) v) with (existsb (Nat.eqb v) (wait_list (dag_of h))).
  destruct (wait_list (dag_of h)); [reflexivity|discriminate].
Qed.

Lemma points_cover k d part R last L ps : forall wanted, points_ok k d part R last L wanted ps = true ->
  forall a, (wanted <= a)%N -> (a + R < L)%N ->
  exists c times, point_ok k d part R last c times = true /\ (c <= a)%N /\ (a < followingN k d c)%N.
Proof.
  induction ps as [|(c, times) ps IH]; intros wanted H a Ha HL; cbn [points_ok] in H.
  - apply N.leb_le in H. lia.
  - rewrite !andb_true_iff in H. destruct H as ((H1 & H2) & H3). apply N.leb_le in H1.
    destruct (N.lt_ge_cases a (followingN k d c)) as [L'|L'].
    + exists c, times. split; [exact H2|]. split; [lia|exact L'].
    + apply (IH _ H3 a L' HL).
Qed.

Lemma point_fits k d part R last a times blocking : point_ok k d part R last a times = true ->
  blocks_at (length cs) core_tasks edf core_keys k (N.to_nat d) (N.to_nat a) blocking ->
  exists finish, fits k d part R last a blocking finish = true.
Proof.
  intros H B. unfold point_ok in H. cbv zeta in H. apply andb_true_iff in H. destruct H as (H1 & H2).
  destruct blocking as [(h, w)|].
  - destruct B as (Hh & Hw & B). rewrite may_block_ok in B.
    pose proof (every_true _ _ (every_true _ _ H2 h Hh) w Hw) as E. cbv beta in E. rewrite B in E.
    apply existsb_exists in E. destruct E as (f & _ & F). eauto.
  - apply existsb_exists in H1. destruct H1 as (f & _ & F). eauto.
Qed.

Lemma may_block_any a k d h w :
  may_block core_tasks edf core_keys k (N.to_nat d) a h w = true -> may_blockN k d 0 h w = true.
Proof.
  intros B. rewrite <- may_block_ok. apply (may_block_earlier core_tasks edf core_keys k (N.to_nat d) 0 a); [lia|exact
    B].
Qed.

Lemma in_preds h u w : edge (graph (core_tasks h)) u w = true ->
  w < vertices (dag_of h) /\ In u (nth w (preds (dag_of h)) []).
Proof.
  intros E. change (stated_edge (dag_of h) u w = true) in E. unfold stated_edge in E.
  pose proof (listed_edges_lead_up _ _ _ _ E) as L. split; [apply L|].
  unfold listed_edge in E. apply andb_true_iff in E. destruct E as (_ & E).
  apply existsb_exists in E. destruct E as (x & Hx & Ex). apply Nat.eqb_eq in Ex. subst. exact Hx.
Qed.

Lemma no_bursts_nil : no_bursts = true -> bursts = [].
Proof. unfold no_bursts. destruct bursts; [reflexivity|discriminate]. Qed.

(** A run of the stated DAGs, at N ticks a ns. *)
Record core_run (N : nat) (s : set_run) : Prop := {
  some_ticks : 0 < N;
  in_key_order : keyed_run (length cs) (fun h => finer N (core_tasks h)) edf (finer_key N edf core_keys) s;
  whole_times : edf = true -> forall h n, h < length cs -> exists q, release s h n = N * q;
  lost_at_most : forall a x, count (N * x) (fun t => lost s (a + t)) <= N * losses bursts x
}.

Section sound.
Variables (N : nat) (s : set_run).
Hypothesis runs : core_run N s.

Let HN := some_ticks _ _ runs.
Let Rules := in_key_order _ _ runs.
Let Whole := whole_times _ _ runs.
Let Losses := lost_at_most _ _ runs.

Lemma shown_sound k d part R last L ps :
  shown k d part R last L ps = true ->
  (forall n t v w, part v = true ->
     instance_ready (fun h => finer N (core_tasks h)) s t k n v ->
     instance_ready (fun h => finer N (core_tasks h)) s t k n w ->
     goes_before edf (finer_key N edf core_keys) s k n w k n v = true -> part w = true) ->
  match last with
  | None => forall n v, v < vertices (dag_of k) -> part v = true ->
      job_finished s (release s k n + N * N.to_nat R) k n v
  | Some v => v < vertices (dag_of k) -> part v = true -> keeps_at (core_at k) v = true -> bursts = [] ->
      forall n, job_finished s (release s k n + N * N.to_nat R) k n v
  end.
Proof.
  unfold shown. rewrite !andb_true_iff. intros (((((Hk & Fine) & Counting) & Stretch) & Part) & Points) First.
  apply Nat.ltb_lt in Hk.
  assert (PartOk : forall v, v < vertices (dag_of k) ->
    (if part v then (key_at (core_at k) v <= d)%N else (d <= key_at (core_at k) v)%N) /\
    forall u, In u (nth v (preds (dag_of k)) []) -> (part v = true -> part u = true) /\
      ((key_at (core_at k) v <= d)%N -> (key_at (core_at k) u <= d)%N)).
  { intros v Hv. pose proof (every_true _ _ Part v Hv) as E. cbv beta in E. apply andb_true_iff in E.
    destruct E as (E1 & E2). split.
    - destruct (part v); [apply N.leb_le, E1|]. apply negb_true_iff, N.ltb_ge in E1. exact E1.
    - intros u Hu. rewrite forallb_forall in E2. specialize (E2 u Hu). apply andb_true_iff in E2. destruct E2 as (E2 &
      E3).
      split; intros H; [rewrite H in E2; exact E2|]. apply N.leb_le in H. rewrite H in E3. apply N.leb_le, E3. }
  assert (Greatest : forall v, v < size (graph (core_tasks k)) -> part v = true -> core_keys k v <= N.to_nat d).
  { intros v Hv Pv. destruct (PartOk v Hv) as (E & _). rewrite Pv in E. unfold core_keys; cbn [urgent number]. lia. }
  assert (Lesser : forall v, v < size (graph (core_tasks k)) -> core_keys k v < N.to_nat d -> part v = true).
  { intros v Hv H. destruct (PartOk v Hv) as (E & _). unfold core_keys in H; cbn [urgent number] in H.
    destruct (part v); [reflexivity|lia]. }
  assert (PartUp : forall u w, edge (graph (core_tasks k)) u w = true -> part w = true -> part u = true).
  { intros u w E Pw. apply in_preds in E. destruct E as (Hw & I). apply (proj1 (proj2 (PartOk w Hw) u I) Pw). }
  assert (OwnUp : forall u w, edge (graph (core_tasks k)) u w = true ->
    core_keys k w <= N.to_nat d -> core_keys k u <= N.to_nat d).
  { intros u w E H. apply in_preds in E. destruct E as (Hw & I). unfold core_keys in *; cbn [urgent number] in *.
    pose proof (proj2 (proj2 (PartOk w Hw) u I) ltac:(lia)). lia. }
  assert (Counts : forall h w, h < length cs -> w < size (graph (core_tasks h)) ->
    may_count edf core_keys k (N.to_nat d) h w = true ->
    (forall v, v < size (graph (core_tasks h)) -> waits (core_tasks h) v = false) /\ known (core_tasks h) = true).
  { intros h w Hh Hw C. rewrite may_count_ok in C.
    pose proof (every_true _ _ (every_true _ _ Counting h Hh) w Hw) as E. cbv beta in E. rewrite C in E. simpl negb in
      E.
    rewrite orb_false_l, !andb_true_iff in E. destruct E as (((E1 & E2) & _) & _). split; [|exact E2].
    intros v _. apply no_waits_sound, E1. }
  assert (Periods : forall h, h < length cs -> (0 < minimum_period (dag_of h))%N).
  { intros h Hh. pose proof (every_true _ _ Fine h Hh) as E. unfold dag_fine in E. rewrite !andb_true_iff in E.
    apply N.ltb_lt, E. }
  assert (Blocking : forall a h w, h < length cs -> w < size (graph (core_tasks h)) ->
    may_block core_tasks edf core_keys k (N.to_nat d) a h w = true -> known (core_tasks h) = true).
  { intros a h w Hh Hw B. apply may_block_any in B.
    pose proof (every_true _ _ (every_true _ _ Counting h Hh) w Hw) as E. cbv beta in E.
    apply andb_true_iff in E. destruct E as (_ & E). rewrite B in E. exact E. }
  assert (Ends : stretch_ends (length cs) core_tasks edf core_keys (losses bursts) k (N.to_nat d) (N.to_nat L)).
  { unfold stretch_ok in Stretch. apply andb_true_iff in Stretch. rewrite N.ltb_lt, N.leb_le in Stretch.
    destruct Stretch as (S1 & S2). split; [lia|]. exists (N.to_nat (most_blocking k d)). split.
    - intros a h w Hh Hw B. apply may_block_any in B. change (w < vertices (dag_of h)) in Hw.
      pose proof (maxN_ge (length cs) (fun h => maxN (vertices (dag_of h))
        (fun w => if may_blockN k d 0 h w then wcetN (dag_of h) w else 0%N)) h Hh) as M1.
      pose proof (maxN_ge (vertices (dag_of h))
        (fun w => if may_blockN k d 0 h w then wcetN (dag_of h) w else 0%N) w Hw) as M2.
      cbv beta in M1, M2. rewrite B in M2. unfold most_blocking.
      change (N.to_nat (wcetN (dag_of h) w) <= N.to_nat (maxN (length cs) (fun h => maxN (vertices (dag_of h))
        (fun w => if may_blockN k d 0 h w then wcetN (dag_of h) w else 0%N)))). lia.
    - rewrite loss_ok.
      rewrite <- (sumN_ok (length cs) (fun h => sumN (vertices (dag_of h)) (fun w => wcetN (dag_of h) w *
        (if may_countN k d h w then upN L (minimum_period (dag_of h)) else 0))%N)).
      + lia.
      + intros h _. apply sumN_ok. intros w _. rewrite N2Nat.inj_mul, if_ok, up_ok, may_count_ok. reflexivity. }
  assert (Cover : forall a, a + N.to_nat R < N.to_nat L ->
    forall blocking, blocks_at (length cs) core_tasks edf core_keys k (N.to_nat d) a blocking ->
    exists c finish, fits k d part R last c blocking finish = true /\ N.to_nat c <= a /\
      counts_alike (length cs) core_tasks edf core_keys k (N.to_nat d) (N.to_nat c) a).
  { intros a Ha blocking B.
    destruct (points_cover k d part R last L ps 0%N Points (N.of_nat a) ltac:(lia) ltac:(lia))
      as (c & times & Ok & Le & F).
    assert (Lc : N.to_nat c <= a) by lia.
    destruct (point_fits k d part R last c times blocking Ok (blocks_at_earlier _ _ _ _ _ _ _ _ _ Lc B)) as (finish &
      Fi).
    exists c, finish. split; [exact Fi|]. split; [exact Lc|].
    rewrite <- (Nat2N.id a). apply following_ok; auto. }
  assert (Up : forall h u w, h < length cs -> edge (graph (core_tasks h)) u w = true ->
    if edf then core_keys h u <= core_keys h w
    else above core_keys k (N.to_nat d) h w = true -> above core_keys k (N.to_nat d) h u = true).
  { intros h u w Hh E. apply in_preds in E. destruct E as (Hw & I).
    pose proof (every_true _ _ (every_true _ _ Counting h Hh) w Hw) as C. cbv beta in C.
    rewrite !andb_true_iff, forallb_forall in C. destruct C as ((_ & C) & _). specialize (C u I).
    rewrite !above_ok. unfold core_keys; cbn [urgent number].
    destruct (bool_dec edf true) as [Ed|Ed]; [|apply not_true_is_false in Ed]; rewrite Ed in C |- *.
    - apply N.leb_le in C. lia.
    - intros A. rewrite A in C. exact C. }
  destruct last as [last|].
  - intros Hl Pl Kp Nob.
    apply (one_core_by_start (length cs) N core_tasks edf core_keys (losses bursts) s k (N.to_nat d) _ part HN Rules
      Whole
      Losses Up Hk Greatest Lesser PartUp OwnUp First); auto.
    + intros h w Hh Hw C. apply (Counts h w Hh Hw C).
    + intros h w Hh Hw C. apply (Counts h w Hh Hw C).
    + split; [exact Kp|]. split; [intros x; rewrite Nob; reflexivity|]. exists (N.to_nat L). split; [exact Ends|].
      intros a Ha blocking B. destruct (Cover a Ha blocking B) as (c & finish & F & Le & Al).
      unfold fits in F. rewrite !andb_true_iff, !N.leb_le in F. destruct F as (F1 & F2 & F3).
      exists (N.to_nat (finish - wcetN (dag_of k) last)). split.
      * apply (starts_between _ _ _ _ _ _ _ _ (N.to_nat c)); auto. apply starts_ok, F3.
      * change (wcet (core_tasks k) last) with (N.to_nat (wcetN (dag_of k) last)). lia.
  - apply (one_core (length cs) N core_tasks edf core_keys (losses bursts) s k (N.to_nat d) _ part HN Rules Whole Losses
      Up Hk Greatest Lesser PartUp OwnUp First).
    + intros h w Hh Hw C. apply (Counts h w Hh Hw C).
    + intros h w Hh Hw C. apply (Counts h w Hh Hw C).
    + exact Blocking.
    + exists (N.to_nat L). split; [exact Ends|].
      intros a Ha blocking B. destruct (Cover a Ha blocking B) as (c & finish & F & Le & Al).
      unfold fits in F. rewrite andb_true_iff, N.leb_le in F. destruct F as (F1 & F2).
      exists (N.to_nat finish). split; [|lia].
      apply (completes_between _ _ _ _ _ _ _ _ (N.to_nat c)); auto. apply completes_ok, F2.
Qed.

Lemma shown_facts k d part R last L ps : shown k d part R last L ps = true ->
  k < length cs /\ edges_ok (dag_of k) = true /\ forall w, w < vertices (dag_of k) -> waits (core_tasks k) w = false.
Proof.
  unfold shown. rewrite !andb_true_iff. intros (((((Hk & Fine) & Counting) & _) & _) & _).
  apply Nat.ltb_lt in Hk. split; [exact Hk|]. split.
  - pose proof (every_true _ _ Fine k Hk) as E. unfold dag_fine in E. rewrite !andb_true_iff in E. apply E.
  - intros w Hw. pose proof (every_true _ _ (every_true _ _ Counting k Hk) w Hw) as E. cbv beta in E.
    unfold may_countN in E. rewrite Nat.eqb_refl, orb_true_r in E. simpl negb in E.
    rewrite orb_false_l, !andb_true_iff in E. apply no_waits_sound, E.
Qed.

Lemma order_facts k order last : edges_ok (dag_of k) = true -> order_ok k order last = true ->
  start_order core_tasks core_keys k order /\ last < vertices (dag_of k) /\
  (forall u w, edge (graph (core_tasks k)) u w = true -> core_keys k u <= core_keys k w) /\
  forall v, v < vertices (dag_of k) -> v <> last -> order v < order last.
Proof.
  intros Ed Or. unfold order_ok in Or. cbv zeta in Or. rewrite !andb_true_iff, Nat.ltb_lt in Or.
  destruct Or as ((Hl & Or1) & Or2).
  assert (Each : forall u w, edge (graph (core_tasks k)) u w = true ->
    order u < order w /\ core_keys k u <= core_keys k w).
  { intros u w E. apply in_preds in E. destruct E as (Hw & E). pose proof (every_true _ _ Or1 w Hw) as O.
    apply andb_true_iff in O. destruct O as (O & _). rewrite forallb_forall in O. specialize (O u E).
    apply andb_true_iff in O. rewrite Nat.ltb_lt, N.leb_le in O. unfold core_keys; cbn [urgent number]. lia. }
  split; [split|split; [exact Hl|split]].
  - intros u w E. apply (Each u w E).
  - intros x y Hx Hy L. pose proof (every_true _ _ (every_true _ _ Or2 x Hx) y Hy) as O. cbv beta in O.
    apply Nat.ltb_lt in L. rewrite L in O. rewrite !orb_true_iff, andb_true_iff, N.ltb_lt, N.eqb_eq, Nat.ltb_lt in O.
    unfold core_keys; cbn [urgent number].
    destruct O as [[O|O]|O]; [left; lia|right; left; split; [rewrite (proj1 O); reflexivity|apply O]|].
    right; right. apply existsb_exists in O. destruct O as (u & Iu & O). exists u. split.
    + apply (stated_edge_of_pred (dag_of k) u x Ed Hx Iu).
    + apply orb_true_iff in O. rewrite Nat.eqb_eq, Nat.ltb_lt in O. exact O.
  - intros u w E. apply (Each u w E).
  - intros v Hv Ne. pose proof (every_true _ _ Or1 v Hv) as O. apply andb_true_iff in O. destruct O as (_ & O).
    apply Nat.eqb_neq in Ne. rewrite Ne in O. apply Nat.ltb_lt, O.
Qed.

(** *What [core_claim_ok] accepts is true: in every run that obeys the rules of one core, for the stated DAGs and keys,
    at any resolution N of time, each job of DAG k is complete within the claimed bound.* *)
Theorem one_core_check_sound k : core_claim_ok k = true ->
  forall n, job_complete (fun h => finer N (core_tasks h)) s (release s k n + N * N.to_nat (bound (dag_of k))) k n.
Proof.
  unfold core_claim_ok. destruct (places_of k) as (places, last). unfold job_ok. cbv zeta.
  set (order := fun v => nth v places 0). intros Ok n.
  set (mode := if keeps_at (core_at k) last && no_bursts then if order_ok k order last then Some last else None else
    None)
    in *.
  pose proof (shown_sound k _ _ _ _ _ _ Ok ltac:(auto)) as Fin.
  destruct (shown_facts k _ _ _ _ _ _ Ok) as (Hk & Ed & W).
  destruct mode as [last'|] eqn:Mode; [|intros v Hv; apply (Fin n v Hv eq_refl)].
  unfold mode in Mode. destruct (keeps_at (core_at k) last && no_bursts) eqn:Kept; [|discriminate].
  destruct (order_ok k order last) eqn:Or; [|discriminate]. injection Mode as <-.
  apply andb_true_iff in Kept. destruct Kept as (Kp & Nob).
  assert (Nil : bursts = []) by (apply no_bursts_nil, Nob).
  destruct (order_facts k order last Ed Or) as (So & Hl & Up & Last).
  specialize (Fin Hl eq_refl Kp Nil n).
  assert (EL : executed_last core_tasks k s last).
  { apply (order_tells_last (length cs) N core_tasks edf core_keys s k last order HN Rules);
      [exact Hk|exact Up|exact W|exact So|exact Hl|exact Last]. }
  destruct EL as (_ & EL). intros v Hv. destruct (Nat.eq_dec v last) as [->|Ne]; [exact Fin|].
  assert (Pos : 0 < job_done s (release s k n + N * N.to_nat (bound (dag_of k))) k n last).
  { pose proof (proj1 (executions _ _ _ _ _ (on_one_core _ _ _ _ _ Rules) k n last Hk Hl) (W last Hl) eq_refl).
    unfold job_finished in Fin. lia. }
  apply sum_positive in Pos. destruct Pos as (i & Hi & Ei).
  destruct (executes s i k n last) eqn:E; [|simpl in Ei; lia].
  apply job_finished_later with i; [lia|]. apply (EL i n v E Hv Ne).
Qed.

(** *And so of a sink within its own.* *)
Theorem sink_check_sound k order last of : sink_ok k order last of = true ->
  forall n, job_finished s (release s k n + N * N.to_nat (sink_bound of)) k n (sink of).
Proof.
  unfold sink_ok. cbv zeta. rewrite andb_true_iff, Nat.ltb_lt. intros (Hv & Ok) n.
  destruct (order_ok k order last) eqn:Known.
  - destruct (shown_facts k _ _ _ _ _ _ Ok) as (Hk & Ed & W).
    destruct (order_facts k order last Ed Known) as (So & _ & Up & _).
    assert (Self : (order (sink of) <=? order (sink of)) = true) by apply Nat.leb_refl.
    pose proof (shown_sound k _ _ _ _ _ _ Ok) as Fin.
    assert (First : forall n t v w, (order v <=? order (sink of)) = true ->
      instance_ready (fun h => finer N (core_tasks h)) s t k n v ->
      instance_ready (fun h => finer N (core_tasks h)) s t k n w ->
      goes_before edf (finer_key N edf core_keys) s k n w k n v = true -> (order w <=? order (sink of)) = true).
    { intros n' t v w L Rv Rw B. apply Nat.leb_le in L. apply Nat.leb_le.
      assert (order w <= order v); [|lia].
      apply (first_is_earlier (length cs) _ edf (finer_key N edf core_keys) s k order Rules Hk) with (n := n') (t :=
        t); auto.
      - intros u x E. specialize (Up u x E). unfold finer_key; cbn [urgent].
        destruct (bool_dec edf true) as [Ee|Ee]; [|apply not_true_is_false in Ee]; rewrite Ee; [|exact Up].
        apply Nat.mul_le_mono_l, Up.
      - apply finer_order; [exact HN|exact So]. }
    specialize (Fin First). destruct (keeps_at (core_at k) (sink of) && no_bursts) eqn:Kp.
    + apply andb_true_iff in Kp. apply (Fin Hv Self (proj1 Kp) (no_bursts_nil (proj2 Kp)) n).
    + apply (Fin n (sink of) Hv Self).
  - apply (shown_sound k _ _ _ _ _ _ Ok) with (v := sink of); [|exact Hv|apply N.leb_refl].
    intros n' t v w L _ _ B. apply N.leb_le in L. apply N.leb_le.
    unfold goes_before, urgency, finer_key, core_keys in B; cbn [urgent number] in B.
    assert (N.to_nat (key_at (core_at k) w) <= N.to_nat (key_at (core_at k) v)); [|lia].
    assert (P : 0 < N) by exact HN. clear -B P. destruct edf; by_keys; [|lia].
    destruct (le_lt_dec (N.to_nat (key_at (core_at k) w)) (N.to_nat (key_at (core_at k) v))) as [G|G]; [exact
      G|exfalso].
    assert (N * N.to_nat (key_at (core_at k) v) < N * N.to_nat (key_at (core_at k) w))
      by (apply Nat.mul_lt_mono_pos_l; lia). lia.
Qed.

End sound.
End check.
