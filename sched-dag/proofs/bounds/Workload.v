(** * The work that the jobs of one DAG execute in a window

    The workload of Melani et al. with p cores (docs/bounds.md, "The workload of others"; Lemma 4
    of the hand proof).  Here only numbers: [u n t] is what job n executes in tick t. *)

Require Import Arith Lia Bool.
From Bounds Require Import Sums.

(** At most V a job, on at most p cores at once, within R of its release, releases T apart or more: the work
    in a window of length r. *)
Definition workload (V p R T r : nat) : nat :=
  let V1 := Nat.min V (p * R) in
  let A := p * (r + R) - V1 in
  Nat.min (A / (p * T) * V1 + Nat.min V1 (A mod (p * T))) (p * r).

(** ** Sums over jobs *)

(** Of the jobs with a share c in the window there are a first and a last, and V1 bounds those between. *)
Lemma first_and_last M (c : nat -> nat) V1 :
  (forall n, c n <= V1) ->
  sum M c = 0 \/
  exists a b, a <= b /\ b < M /\ 0 < c a /\ 0 < c b /\
    sum M c <= c a + (b - a - 1) * V1 + (if a =? b then 0 else c b).
Proof.
  intros HV. induction M; simpl; auto.
  destruct (Nat.eq_dec (c M) 0) as [Z|Z].
  - rewrite Z, Nat.add_0_r. destruct IHM as [H|(a & b & H1 & H2 & H3 & H4 & H5)]; auto.
    right. exists a, b. repeat split; auto.
  - right. destruct IHM as [H|(a & b & H1 & H2 & H3 & H4 & H5)].
    + exists M, M. rewrite Nat.eqb_refl. repeat split; auto; lia.
    + exists a, M. destruct (Nat.eqb_spec a M); [lia|]. repeat split; auto; try lia.
      specialize (HV b). destruct (Nat.eqb_spec a b).
      * nia.
      * assert ((b - a - 1) * V1 + V1 <= (M - a - 1) * V1) by nia. lia.
Qed.

Lemma shares_at_most_workload M (c rel : nat -> nat) V p R T a r :
  0 < p -> 0 < T -> R <= T ->
  (forall n, rel n + T <= rel (S n)) ->
  (forall n, c n <= Nat.min V (p * R)) ->
  (forall n, c n <= p * r) ->
  (forall n, c n <= p * (rel n + R - a)) ->
  (forall n, c n <= p * (a + r - rel n)) ->
  let V1 := Nat.min V (p * R) in
  let A := p * (r + R) - V1 in
  sum M c <= A / (p * T) * V1 + Nat.min V1 (A mod (p * T)).
Proof.
  intros Hp HT HR Hrel HV Hr Hl Hh V1 A.
  assert (Apart : forall d n, rel n + d * T <= rel (n + d)).
  { induction d; intros n; [replace (n + 0) with n by lia; lia|].
    rewrite Nat.add_succ_r. specialize (Hrel (n + d)). specialize (IHd n). lia. }
  assert (HP : 0 < p * T) by nia.
  pose proof (Nat.div_mod A (p * T) ltac:(lia)) as Dm.
  pose proof (Nat.mod_upper_bound A (p * T) ltac:(lia)) as Rm.
  set (q := A / (p * T)) in *. set (rho := A mod (p * T)) in *.
  assert (HV1 : V1 <= p * R) by apply Nat.le_min_r.
  assert (HRT : p * R <= p * T) by nia.
  assert (HA : p * r + p * R = A + V1) by (unfold A; rewrite Nat.mul_add_distr_l; lia).
  fold V1 in HV.
  destruct (first_and_last M c V1 HV) as [Z|(n1 & n2 & H12 & _ & C1 & C2 & Sm)]; [lia|].
  pose proof (HV n1) as V_1. pose proof (HV n2) as V_2.
  destruct (Nat.eqb_spec n1 n2) as [->|NE].
  - (* one job *)
    replace (n2 - n2 - 1) with 0 in Sm by lia.
    pose proof (Hr n2) as R2.
    destruct q as [|q'].
    + rewrite Nat.mul_0_r in Dm. lia.
    + rewrite Nat.mul_succ_l. lia.
  - (* N + 1 jobs *)
    set (N := n2 - n1) in *.
    pose proof (Apart N n1) as Ap. replace (n1 + N) with n2 in Ap by (unfold N; lia).
    pose proof (Hl n1) as L1. pose proof (Hh n2) as L2.
    set (z1 := rel n1 + R - a) in *. set (z2 := a + r - rel n2) in *.
    assert (Z1 : 0 < z1) by (destruct z1; lia).
    assert (Z2 : 0 < z2) by (destruct z2; lia).
    assert (Zs : z1 + z2 + N * T <= r + R) by (unfold z1, z2 in *; lia).
    assert (HN : 1 <= N) by (unfold N; lia).
    assert (Ys : p * z1 + p * z2 + N * (p * T) <= A + V1).
    { apply (Nat.mul_le_mono_l _ _ p) in Zs. rewrite !Nat.mul_add_distr_l in Zs.
      rewrite (Nat.mul_comm N (p * T)), <- Nat.mul_assoc, (Nat.mul_comm T N). lia. }
    assert (Y0 : 0 < p * z1) by (apply Nat.mul_pos_pos; auto).
    assert (S' : sum M c + V1 <= N * V1 + c n1 + c n2).
    { fold N in Sm. clear - Sm HN. destruct N as [|N']; [lia|].
      replace (S N' - 1) with N' in Sm by lia. rewrite Nat.mul_succ_l. lia. }
    clearbody N. clear Zs Ap Sm Hrel HV Hr Hl Hh Apart. clearbody z1 z2.
    set (P := p * T) in *. clearbody P.
    destruct (lt_eq_lt_dec N q) as [[Hq|Hq]|Hq].
    + assert ((N + 1) * V1 <= q * V1) by (apply Nat.mul_le_mono_r; lia). lia.
    + subst q. rewrite <- Hq in *.
      assert (A = N * P + rho) by lia. lia.
    + (* N = q + 1, for two jobs more than q do not fit *)
      assert (N = q + 1).
      { destruct (Nat.eq_dec N (q + 1)); auto. exfalso.
        assert ((q + 2) * P <= N * P) by (apply Nat.mul_le_mono_r; lia). lia. }
      subst N. rewrite Nat.mul_add_distr_r, Nat.mul_1_l in Ys, S'. lia.
Qed.

(** ** Shares of one job *)

(** What executes on at most p cores from [lo] on and before [hi]. *)
Lemma share_of_support r (u : nat -> nat) p lo hi :
  (forall t, t < r -> u t <= p) ->
  (forall t, t < r -> 0 < u t -> lo <= t < hi) ->
  sum r u <= p * (Nat.min hi r - lo).
Proof.
  intros Hp Hs.
  induction r; simpl; [lia|].
  assert (IH : sum r u <= p * (Nat.min hi r - lo)) by (apply IHr; intros; auto).
  specialize (Hp r (Nat.lt_succ_diag_r r)). specialize (Hs r (Nat.lt_succ_diag_r r)).
  destruct (Nat.eq_dec (u r) 0) as [Z|Z].
  - assert (p * (Nat.min hi r - lo) <= p * (Nat.min hi (S r) - lo)) by (apply Nat.mul_le_mono_l; lia).
    lia.
  - assert (lo <= r < hi) by (apply Hs; lia).
    replace (Nat.min hi (S r) - lo) with ((Nat.min hi r - lo) + 1) by lia. nia.
Qed.

Lemma window_of_total a r (u : nat -> nat) : sum r (fun t => u (a + t)) <= sum (a + r) u.
Proof.
  induction r; simpl; [lia|]. rewrite Nat.add_succ_r. simpl. lia.
Qed.

(** Jobs that do not overlap execute one at a time. *)
Lemma one_job_at_a_time N (u : nat -> nat) (rel : nat -> nat) p R T t :
  0 < T -> R <= T ->
  (forall n, rel n + T <= rel (S n)) ->
  (forall n, u n <= p) ->
  (forall n, 0 < u n -> rel n <= t < rel n + R) ->
  sum N u <= p.
Proof.
  intros HT HR Hrel Hp Hs.
  assert (Apart : forall d n, rel n + d * T <= rel (n + d)).
  { induction d; intros n; [replace (n + 0) with n by lia; lia|].
    rewrite Nat.add_succ_r. specialize (Hrel (n + d)). specialize (IHd n). lia. }
  assert (One : sum N u <= p /\ (0 < sum N u -> exists n, n < N /\ 0 < u n)).
  { induction N; simpl; [split; [lia|intros; lia]|].
    destruct IHN as (I1 & I2).
    destruct (Nat.eq_dec (u N) 0) as [Z|Z].
    - rewrite Z, Nat.add_0_r. split; auto. intros H. destruct (I2 H) as (n & Hn & E).
      exists n. split; auto.
    - split; [|intros _; exists N; lia].
      destruct (Nat.eq_dec (sum N u) 0) as [Z'|Z'].
      + rewrite Z'. apply Hp.
      + exfalso. destruct I2 as (n & Hn & E); [lia|].
        apply Hs in E. assert (E' : 0 < u N) by lia. apply Hs in E'.
        specialize (Apart (N - n) n). replace (n + (N - n)) with N in Apart by lia.
        destruct (N - n) as [|d] eqn:Ed; [lia|]. rewrite Nat.mul_succ_l in Apart. lia. }
  apply One.
Qed.

(** *The workload of a DAG in the window of length r from a on.* *)
Theorem workload_bound M (u : nat -> nat -> nat) (rel : nat -> nat) V p R T a r :
  0 < T -> R <= T ->
  (forall n, rel n + T <= rel (S n)) ->
  (forall n t, u n t <= p) ->
  (forall n t, 0 < u n t -> rel n <= t < rel n + R) ->
  (forall n l, sum l (u n) <= V) ->
  sum r (fun t => sum M (fun n => u n (a + t))) <= workload V p R T r.
Proof.
  intros HT HR Hrel Hp Hs HV. rewrite sum_swap.
  set (c n := sum r (fun t => u n (a + t))).
  change (sum M c <= workload V p R T r).
  assert (Sup : forall n, c n <= p * (Nat.min (rel n + R - a) r - (rel n - a))).
  { intros n. unfold c. apply (share_of_support r (fun t => u n (a + t))); auto.
    intros t _ H. specialize (Hs n (a + t) H). lia. }
  assert (Mono : forall n k, Nat.min (rel n + R - a) r - (rel n - a) <= k -> c n <= p * k).
  { intros n k H. apply Nat.le_trans with (1 := Sup n). apply Nat.mul_le_mono_l, H. }
  assert (Cr : forall n, c n <= p * r) by (intros; apply Mono; lia).
  unfold workload. apply Nat.min_glb.
  - destruct p as [|p'].
    { rewrite sum_zero; [lia|]. intros n _. specialize (Cr n). lia. }
    apply (shares_at_most_workload M c rel V (S p') R T a r); auto; try lia.
    + intros n. apply Nat.min_glb.
      * apply Nat.le_trans with (sum (a + r) (u n)); auto. apply window_of_total.
      * apply Mono. lia.
    + intros n. apply Mono. lia.
    + intros n. apply Mono. lia.
  - (* one job at a time *)
    unfold c. rewrite <- sum_swap.
    apply Nat.le_trans with (sum r (fun _ => p)).
    + apply sum_le. intros t _. apply (one_job_at_a_time M (fun n => u n (a + t)) rel p R T (a + t)); auto.
    + rewrite sum_const. lia.
Qed.

(** ** Under EDF: only jobs with a deadline no later

    A job with the relative deadline [Dk] is released at a; of the other DAG, with relative deadline [D], only jobs
    due by [a + Dk] count.  Then it matters how far they go back from there, whatever the window's length. *)
Definition workload_by_deadline (V p R T Dk D : nat) : nat :=
  let V1 := Nat.min V (p * R) in
  let N := if D <=? Dk then (Dk - D) / T + 1 else 0 in
  N * V1 + Nat.min V1 (p * (Dk + R - N * T - D)).

Theorem workload_by_deadline_bound M (u : nat -> nat -> nat) (rel : nat -> nat) V p R T a r Dk D :
  0 < T -> R <= T ->
  (forall n, rel n + T <= rel (S n)) ->
  (forall n t, u n t <= p) ->
  (forall n t, 0 < u n t -> rel n <= t < rel n + R) ->
  (forall n t, 0 < u n t -> rel n + D <= a + Dk) ->
  (forall n l, sum l (u n) <= V) ->
  sum r (fun t => sum M (fun n => u n (a + t))) <= workload_by_deadline V p R T Dk D.
Proof.
  intros HT HR Hrel Hp Hs Hd HV. rewrite sum_swap.
  set (c n := sum r (fun t => u n (a + t))).
  change (sum M c <= workload_by_deadline V p R T Dk D).
  assert (Sup : forall n, c n <= p * (Nat.min (rel n + R - a) r - (rel n - a))).
  { intros n. unfold c. apply (share_of_support r (fun t => u n (a + t))); auto.
    intros t _ H. specialize (Hs n (a + t) H). lia. }
  assert (Mono : forall n k, Nat.min (rel n + R - a) r - (rel n - a) <= k -> c n <= p * k).
  { intros n k H. apply Nat.le_trans with (1 := Sup n). apply Nat.mul_le_mono_l, H. }
  set (V1 := Nat.min V (p * R)).
  assert (HV1 : forall n, c n <= V1).
  { intros n. apply Nat.min_glb.
    - apply Nat.le_trans with (sum (a + r) (u n)); auto. apply window_of_total.
    - apply Mono. lia. }
  assert (Due : forall n, 0 < c n -> rel n + D <= a + Dk).
  { intros n H. apply sum_positive in H. destruct H as (t & _ & H). apply (Hd n (a + t) H). }
  unfold workload_by_deadline. cbv zeta. fold V1.
  destruct (first_and_last M c V1 HV1) as [Z|(f & b & Hfb & _ & Cf & Cb & Sm)]; [lia|].
  assert (Apart : rel f + (b - f) * T <= rel b).
  { replace b with (f + (b - f)) at 2 by lia. generalize (b - f). clear - Hrel.
    induction n; [replace (f + 0) with f by lia; lia|].
    rewrite Nat.add_succ_r, Nat.mul_succ_l. specialize (Hrel (f + n)). lia. }
  set (I := b - f) in *.
  assert (S' : sum M c <= I * V1 + c f).
  { pose proof (HV1 b). destruct (Nat.eqb_spec f b).
    - assert (E : I = 0) by (unfold I; lia). rewrite E in *. simpl in *. lia.
    - assert (E : I = S (I - 1)) by (unfold I; lia). rewrite E, Nat.mul_succ_l.
      replace (S (I - 1) - 1) with (I - 1) in * by lia. lia. }
  pose proof (Due b Cb) as Db.
  assert (Cz : c f <= p * (rel f + R - a)) by (apply Mono; lia).
  set (z := rel f + R - a) in *.
  assert (Hz : 0 < z) by (destruct z; lia).
  assert (Span : z + I * T + D <= Dk + R) by (unfold z in *; lia).
  pose proof (HV1 f) as Vf.
  clearbody z I. clear Sm Apart.
  set (N := if D <=? Dk then (Dk - D) / T + 1 else 0).
  assert (HN : Dk < N * T + D).
  { unfold N. destruct (Nat.leb_spec D Dk); [|lia].
    pose proof (Nat.div_mod (Dk - D) T ltac:(lia)). pose proof (Nat.mod_upper_bound (Dk - D) T ltac:(lia)).
    rewrite Nat.mul_add_distr_r, Nat.mul_1_l, (Nat.mul_comm _ T). lia. }
  destruct (lt_eq_lt_dec I N) as [[H|H]|H].
  - assert (I * V1 + V1 <= N * V1).
    { replace (I * V1 + V1) with ((I + 1) * V1) by (rewrite Nat.mul_add_distr_r; lia).
      apply Nat.mul_le_mono_r. lia. }
    lia.
  - subst I. assert (p * z <= p * (Dk + R - N * T - D)) by (apply Nat.mul_le_mono_l; lia). lia.
  - exfalso. assert ((N + 1) * T <= I * T) by (apply Nat.mul_le_mono_r; lia).
    rewrite Nat.mul_add_distr_r, Nat.mul_1_l in *. lia.
Qed.

(** Either bound, or the least of both: [cut] has the two relative deadlines, if only jobs due in time count. *)
Definition window_work (cut : option (nat * nat)) (V p R T r : nat) : nat :=
  match cut with
  | None => workload V p R T r
  | Some (Dk, D) => Nat.min (workload V p R T r) (workload_by_deadline V p R T Dk D)
  end.

(** ** How many jobs are released in a window *)

Lemma jobs_in_window M (rel : nat -> nat) P lo hi c (p : nat -> bool) :
  (forall n, rel n + P <= rel (S n)) -> (forall n, p n = true -> lo <= rel n < hi) ->
  hi <= lo + c * P -> count M p <= c.
Proof.
  intros Apart. revert hi c p. induction M as [|M IH]; intros hi c p H W; [unfold count; simpl; lia|].
  change (count M p + Nat.b2n (p M) <= c). destruct (p M) eqn:E; simpl.
  2:{ specialize (IH hi c p H W). lia. }
  pose proof (H M E) as HM. destruct c as [|c]; [lia|].
  assert (Grow : forall d n, rel n + d * P <= rel (n + d)).
  { induction d; intros n; [replace (n + 0) with n by lia; simpl; lia|].
    rewrite Nat.add_succ_r. specialize (IHd n). specialize (Apart (n + d)). simpl. lia. }
  assert (C : count M p = count M (fun n => p n && (n <? M))).
  { apply sum_ext. intros i Hi. apply Nat.ltb_lt in Hi. rewrite Hi, andb_true_r. reflexivity. }
  rewrite C.
  assert (count M (fun n => p n && (n <? M)) <= c); [|lia].
  apply (IH (hi - P) c); [|simpl in W; lia].
  intros n Hn. apply andb_true_iff in Hn. destruct Hn as (Pn & L). apply Nat.ltb_lt in L.
  pose proof (H n Pn). specialize (Grow (M - n) n). replace (n + (M - n)) with M in Grow by lia. nia.
Qed.

(** Rounded up. *)
Definition up (x y : nat) : nat := (x + (y - 1)) / y.

Lemma up_enough x y : 0 < y -> x <= up x y * y.
Proof.
  intros H. unfold up. pose proof (Nat.div_mod (x + (y - 1)) y ltac:(lia)).
  pose proof (Nat.mod_upper_bound (x + (y - 1)) y ltac:(lia)). nia.
Qed.
