(** * No resolution of time breaks a bound

    Numbers are stated in ns, and schedules of a machine change between.  Let a tick be 1/N of a ns: then WCETs,
    periods and deadlines are N times as many ticks.  [set_bounds_in_fractions]: *what is shown in ns bounds all
    runs of any resolution N.*  So ticks lose no schedule that changes at fractions of a ns, whatever the
    denominator.  (The inequalities only grow by N; the form that rounds down does not have that property,
    see Examples.v.) *)

Require Import Arith Lia Bool List.
From Bounds Require Import Sums Model Chains Shares ResponseTime Blocking Workload TaskSet Windows SetBounds Checker.

Section scale.
Variable N : nat.
Hypothesis positive : 0 < N.

Definition finer (t : task) : task := {|
  graph := graph t;
  wcet := fun v => N * wcet t v;
  head := head t;
  together := fun v => N * together t v;
  waits := waits t;
  keeps := keeps t;
  regular := regular t;
  known := known t;
  period := N * period t;
  deadline := N * deadline t;
  first_deadline := N * first_deadline t
|}.

Lemma weight_finer G c p : weight G (fun v => N * c v) p = N * weight G c p.
Proof. unfold weight. rewrite <- sum_times. apply sum_ext. intros v _. destruct (p v); lia. Qed.

Lemma left_over_finer G c j f : left_over G (fun v => N * c v) j f = N * left_over G c j f.
Proof. unfold left_over. rewrite <- sum_times. apply sum_ext. intros v _. destruct (f v <=? j); lia. Qed.

Lemma no_path_longer_finer G c len :
  no_path_longer G c len -> no_path_longer G (fun v => N * c v) (N * len).
Proof.
  intros H l P. specialize (H l P). unfold path_length in *.
  assert (E : list_sum (map (fun v => N * c v) l) = N * list_sum (map c l)).
  { clear. induction l; simpl; [lia|]. rewrite IHl. lia. }
  rewrite E. apply Nat.mul_le_mono_l, H.
Qed.

Lemma div_finer a b : (N * a) / (N * b) = a / b.
Proof.
  destruct (Nat.eq_dec b 0) as [->|Hb]; [rewrite Nat.mul_0_r; reflexivity|].
  apply Nat.div_mul_cancel_l; lia.
Qed.

Lemma mod_finer a b : (N * a) mod (N * b) = N * (a mod b).
Proof.
  destruct (Nat.eq_dec b 0) as [->|Hb]; [rewrite Nat.mul_0_r; simpl; lia|].
  apply Nat.mul_mod_distr_l; lia.
Qed.

Lemma up_finer a b : up (N * a) (N * b) = up a b.
Proof.
  unfold up. destruct (Nat.eq_dec b 0) as [->|Hb]; [rewrite Nat.mul_0_r; reflexivity|]. symmetry.
  pose proof (Nat.div_mod (a + (b - 1)) b Hb) as E. pose proof (Nat.mod_upper_bound (a + (b - 1)) b Hb) as L.
  apply (Nat.div_unique _ _ _ (N * ((a + (b - 1)) mod b + 1) - 1)); nia.
Qed.

Lemma swap_factor a b : a * (N * b) = N * (a * b).
Proof. rewrite !Nat.mul_assoc, (Nat.mul_comm a N). reflexivity. Qed.

Lemma workload_finer V p R T r : workload (N * V) p (N * R) (N * T) (N * r) = N * workload V p R T r.
Proof.
  unfold workload. cbv zeta.
  rewrite <- Nat.mul_add_distr_l, !swap_factor, Nat.mul_min_distr_l, <- Nat.mul_sub_distr_l.
  rewrite div_finer, mod_finer, Nat.mul_min_distr_l, !swap_factor, <- Nat.mul_add_distr_l.
  apply Nat.mul_min_distr_l.
Qed.

Lemma workload_by_deadline_finer V p R T Dk D :
  workload_by_deadline (N * V) p (N * R) (N * T) (N * Dk) (N * D) = N * workload_by_deadline V p R T Dk D.
Proof.
  unfold workload_by_deadline. cbv zeta.
  replace (N * D <=? N * Dk) with (D <=? Dk)
    by (destruct (Nat.leb_spec D Dk), (Nat.leb_spec (N * D) (N * Dk)); auto; nia).
  rewrite <- Nat.mul_sub_distr_l, div_finer, swap_factor, Nat.mul_min_distr_l.
  set (n := if D <=? Dk then (Dk - D) / T + 1 else 0).
  rewrite !swap_factor, <- Nat.mul_add_distr_l, <- !Nat.mul_sub_distr_l, swap_factor,
    Nat.mul_min_distr_l.
  rewrite <- Nat.mul_add_distr_l. reflexivity.
Qed.

Lemma clipped_finer W p n Wc Wr x :
  clipped (N * W) p n (fun i => N * Wc i) (N * Wr) (N * x) = N * clipped W p n Wc Wr x.
Proof.
  unfold clipped. rewrite swap_factor.
  assert (E : sum n (fun i => Nat.min (N * Wc i) (N * x)) = N * sum n (fun i => Nat.min (Wc i) x)).
  { rewrite <- sum_times. apply sum_ext. intros i _. apply Nat.mul_min_distr_l. }
  rewrite E, !Nat.mul_min_distr_l, <- Nat.mul_add_distr_l, !Nat.mul_min_distr_l. reflexivity.
Qed.

Lemma clipped_ext W p n Wc Wc' Wr x :
  (forall i, Wc i = Wc' i) -> clipped W p n Wc Wr x = clipped W p n Wc' Wr x.
Proof.
  intros H. unfold clipped. do 3 f_equal. apply sum_ext. intros i _. rewrite H. reflexivity.
Qed.

Lemma rise_finer W p n Wc Wr x :
  rise (N * W) p n (fun i => N * Wc i) (N * Wr) (N * x) = rise W p n Wc Wr x.
Proof.
  assert (Lt : forall a b, (N * a <? N * b) = (a <? b))
    by (intros a b; destruct (Nat.ltb_spec a b), (Nat.ltb_spec (N * a) (N * b)); auto; nia).
  assert (Le : forall a b, (N * a <=? N * b) = (a <=? b))
    by (intros a b; destruct (Nat.leb_spec a b), (Nat.leb_spec (N * a) (N * b)); auto; nia).
  assert (E : sum n (fun i => Nat.min (N * Wc i) (N * x)) = N * sum n (fun i => Nat.min (Wc i) x)).
  { rewrite <- sum_times. apply sum_ext. intros i _. apply Nat.mul_min_distr_l. }
  unfold rise. cbv zeta.
  rewrite E, swap_factor, !Nat.mul_min_distr_l, <- !Nat.mul_add_distr_l, !Nat.mul_min_distr_l, !Lt, Le.
  rewrite (sum_ext n (fun i => if N * x <? N * Wc i then 1 else 0) (fun i => if x <? Wc i then 1 else 0))
    by (intros i _; rewrite Lt; reflexivity).
  reflexivity.
Qed.

Lemma rise_ext W p n Wc Wc' Wr x : (forall i, Wc i = Wc' i) -> rise W p n Wc Wr x = rise W p n Wc' Wr x.
Proof.
  intros H. unfold rise. cbv zeta.
  rewrite (sum_ext n (fun i => Nat.min (Wc i) x) (fun i => Nat.min (Wc' i) x)) by (intros; rewrite H; auto).
  rewrite (sum_ext n (fun i => if x <? Wc i then 1 else 0) (fun i => if x <? Wc' i then 1 else 0))
    by (intros; rewrite H; auto).
  reflexivity.
Qed.

Section set.
Variables (K m : nat) (tau : nat -> task) (pol : policy).
Variables (bounded : nat -> bool) (R loss width parts : nat -> nat) (part : nat -> nat -> nat).

Let tau' k := finer (tau k).
Let R' k := N * R k.
Let loss' k := N * loss k.

Lemma work_of_finer k h p c r :
  work_of tau' pol R' k h p c (N * r) = N * work_of tau pol R k h p c r.
Proof.
  unfold work_of, window_work, tau', R', finer. simpl. rewrite weight_finer.
  destruct (by_deadline pol).
  - rewrite workload_finer, workload_by_deadline_finer, Nat.mul_min_distr_l. reflexivity.
  - apply workload_finer.
Qed.

Lemma sum_over_others_finer k g g' :
  (forall h, g' h = N * g h) -> sum_over_others K pol k g' = N * sum_over_others K pol k g.
Proof.
  intros H. unfold sum_over_others. rewrite <- sum_times. apply sum_ext. intros h _.
  destruct (negb (h =? k) && outranks pol h k); [apply H|lia].
Qed.

Lemma largest_blocking_finer k q level :
  largest_blocking K tau' pol k q (N * level) = N * largest_blocking K tau pol k q level.
Proof.
  unfold largest_blocking. rewrite swap_factor, Nat.mul_add_distr_l. f_equal.
  rewrite <- sum_times. apply sum_ext. intros h _. rewrite <- sum_times. apply sum_ext. intros v _.
  change (blocks tau' pol k h v) with (blocks tau pol k h v).
  rewrite Nat.mul_sub_distr_l. simpl. destruct (blocks tau pol k h v); lia.
Qed.

Lemma blocking_finer k j again level0 level1 :
  blocking K m tau' pol k j again (N * level0) (N * level1) = N * blocking K m tau pol k j again level0 level1.
Proof.
  unfold blocking. rewrite !largest_blocking_finer, swap_factor, <- Nat.mul_add_distr_l. reflexivity.
Qed.

Lemma part_inequality_finer k q r x :
  part_inequality K m tau pol bounded R width k q r x ->
  part_inequality K m tau' pol bounded R' width k q (N * r) (N * x).
Proof.
  intros (C & [(j & f & level0 & level1 & most & full & Hj & D & F & Most & Full & I)|(F & len & Len & I)]); (split; [exact C|]).
  - left. exists j, f, (N * level0), (N * level1), (N * most), full. cbv zeta in *.
    change (together (tau' k)) with (fun v => N * together (tau k) v). rewrite weight_finer, !largest_blocking_finer.
    split; [exact Hj|]. split; [exact D|]. split; [exact F|]. split; [|split].
    + apply (no_path_longer_ext _ (fun v => N * (if q v then on_path K m tau pol k j f level0 level1 v else 0)));
        [|apply no_path_longer_finer, Most].
      intros v. destruct (q v); [|lia]. unfold on_path. rewrite !largest_blocking_finer. simpl.
      rewrite swap_factor, Nat.mul_add_distr_l, Nat.mul_sub_distr_l. unfold outside, on_core. simpl.
      destruct (waits (tau k) v), (j <=? f v), (after_wait (graph (tau k)) (fun v => negb (waits (tau k) v)) v); simpl; lia.
    + intros h Hh Fh. destruct (Full h Hh Fh) as (M1 & Rank & Pos & Rest). split; [exact M1|]. split; [exact Rank|].
      split; [|exact Rest]. apply Nat.mul_pos_pos; [exact positive|exact Pos].
    + rewrite (sum_over_others_finer k (fun h => if full h then full_work tau h r else whole_work m tau pol R width k j h r)).
      * rewrite <- Nat.mul_sub_distr_l, !swap_factor, <- !Nat.mul_add_distr_l. apply Nat.mul_le_mono_l, I.
      * intros h. destruct (full h); [|apply work_of_finer]. unfold full_work. simpl. rewrite up_finer, weight_finer, swap_factor.
        reflexivity.
  - right. split; [exact F|]. exists (N * len). split; [|rewrite <- Nat.mul_add_distr_l; apply Nat.mul_le_mono_l, I].
    apply (no_path_longer_ext _ (fun v => N * (if q v then together (tau k) v else 0))); [|apply no_path_longer_finer, Len].
    intros v. simpl. destruct (q v); lia.
Qed.

Lemma shown_finer k :
  shown K m tau pol bounded R loss width parts part k ->
  shown K m tau' pol bounded R' loss' width parts part k.
Proof.
  intros (Kn & Rg & Bk & W & P & Hd & Sm & O & B & j & f & len & again & level0 & level1 & Hj & Len & D & F & (H1 & H2) & Ineq).
  do 9 (split; [assumption|]).
  exists j, f, (N * len), again, (N * level0), (N * level1).
  split; [auto|]. split; [apply no_path_longer_finer, Len|]. split; [exact D|]. split; [exact F|].
  split; [split; apply Nat.mul_le_mono_l; auto|].
  cbv zeta in *. destruct Ineq as [(Waits & Of & I)|Ineq]; [left|right; apply part_inequality_finer, Ineq].
  unfold first_inequality, second_inequality in *.
  rewrite !(sum_over_others_finer k (fun h => whole_work m tau pol R width k j h (R k)))
    by (intros; apply work_of_finer).
  change (together (tau' k)) with (fun v => N * together (tau k) v).
  change (graph (tau' k)) with (graph (tau k)). rewrite left_over_finer, blocking_finer.
  unfold R', loss'. rewrite <- !Nat.mul_sub_distr_l, !swap_factor.
  split; [exact Waits|]. split; [exact Of|]. destruct I as [I|I]; [left|right].
  - rewrite <- !Nat.mul_add_distr_l. apply Nat.mul_le_mono_l, I.
  - rewrite (sum_over_others_finer k
      (fun h => clipped_work m tau pol R width parts part k j h (R k) (R k - len))).
    2: { intros h. unfold clipped_work, whole_work. rewrite <- clipped_finer. fold R'.
         rewrite !work_of_finer. apply clipped_ext. intros i. apply work_of_finer. }
    destruct I as [I|(I & Up)]; [left|right; split].
    * apply (Nat.mul_le_mono_l _ _ N) in I. rewrite !Nat.mul_add_distr_l in I.
      assert (Nat.max 1 (N * left_over (graph (tau k)) (together (tau k)) j f)
              <= N * Nat.max 1 (left_over (graph (tau k)) (together (tau k)) j f)).
      { rewrite <- Nat.mul_max_distr_l. lia. }
      lia.
    * apply (Nat.mul_le_mono_l _ _ N) in I. rewrite !Nat.mul_add_distr_l in I. exact I.
    * apply Nat.le_lt_trans with (2 := Up). apply sum_le. intros h _.
      destruct (negb (h =? k) && outranks pol h k); [|lia]. unfold rising_work, whole_work.
      fold R'. rewrite !work_of_finer. apply Nat.eq_le_incl. rewrite <- (rise_finer (work_of _ _ _ _ _ _ _ _)).
      apply rise_ext. intros i. apply work_of_finer.
Qed.

Theorem set_bounds_in_fractions s :
  global_run K m tau' pol s ->
  (forall k a, k < K -> bounded k = true -> count (N * R k) (fun t => lost s (a + t)) <= N * loss k) ->
  (forall k, k < K -> bounded k = true -> shown K m tau pol bounded R loss width parts part k) ->
  forall k n, k < K -> bounded k = true -> job_complete tau' s (release s k n + N * R k) k n.
Proof.
  intros Rules Losses Shown.
  apply (set_bounds K m tau' pol s bounded R' loss' width parts part Rules Losses).
  intros k Hk Bk. apply shown_finer, Shown; auto.
Qed.

Theorem part_bounds_in_fractions s :
  global_run K m tau' pol s ->
  (forall k a, k < K -> bounded k = true -> count (N * R k) (fun t => lost s (a + t)) <= N * loss k) ->
  (forall k, k < K -> bounded k = true -> shown K m tau pol bounded R loss width parts part k) ->
  forall k q r x, k < K -> bounded k = true -> r <= R k -> part_inequality K m tau pol bounded R width k q r x ->
  (forall a, count (N * r) (fun t => lost s (a + t)) <= N * x) ->
  forall n v, v < size (graph (tau k)) -> q v = true -> job_finished s (release s k n + N * r) k n v.
Proof.
  intros Rules Losses Shown k q r x Hk Bk Hr I Lo n v Hv Qv.
  apply (part_bounds K m tau' pol s bounded R' loss' width parts part Rules Losses
    (fun k Hk Bk => shown_finer k (Shown k Hk Bk)) k q (N * r) (N * x) Hk Bk); auto.
  - apply Nat.mul_le_mono_l, Hr.
  - apply part_inequality_finer, I.
Qed.

End set.

(** *What [check] accepts, for runs of any resolution.* *)
Theorem check_sound_in_fractions m due_no_later claims :
  check m due_no_later claims = true ->
  forall s,
  global_run (length claims) m (fun k => finer (stated_tasks claims k))
             (stated_policy due_no_later claims) s ->
  (forall k a, k < length claims -> claimed (claim_of claims k) = true ->
     count (N * BinNat.N.to_nat (bound (claim_of claims k))) (fun t => lost s (a + t))
     <= N * BinNat.N.to_nat (loss (claim_of claims k))) ->
  forall k n, k < length claims -> claimed (claim_of claims k) = true ->
    job_complete (fun k => finer (stated_tasks claims k)) s
      (release s k n + N * BinNat.N.to_nat (bound (claim_of claims k))) k n.
Proof.
  intros Ck s Rules Losses.
  apply (set_bounds_in_fractions (length claims) m (stated_tasks claims)
    (stated_policy due_no_later claims) (fun k => claimed (claim_of claims k)) _ _ _ _ _ s Rules Losses
    (fun k Hk => claim_ok_shown m due_no_later claims k (check_each m due_no_later claims Ck k Hk))).
Qed.

End scale.


