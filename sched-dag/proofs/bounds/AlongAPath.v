(** * A path, and the cores meanwhile

    From a vertex that is ready at r go back to one of its predecessors that finished last, and so on to the
    release.  In each tick one of this path executes, or one is ready and waits.  So time that passes on no core
    counts on the path only, and what is off the path need not be executed at the same time as anything. *)

Require Import Arith Lia Bool List.
From Bounds Require Import Sums Model Chains.

Section path.
Variables (G : dag) (m : nat) (s : run).
Hypothesis rules : legal G m s.

Lemma ready_since t v : ready G s t v -> exists a, a <= t /\ (forall i, a <= i <= t -> ready G s i v) /\
  (a = 0 \/ exists p, a = S p /\ ~ ready G s p v).
Proof.
  induction t; intros Rd.
  - exists 0. split; [lia|]. split; [|auto]. intros i Hi. replace i with 0 by lia. auto.
  - destruct (ready_bool G s t v) eqn:B.
    + apply ready_bool_true in B. destruct (IHt B) as (a & Ha & R & Z). exists a. split; [lia|].
      split; [|auto]. intros i Hi. destruct (Nat.eq_dec i (S t)) as [->|]; auto. apply R. lia.
    + exists (S t). split; [lia|]. split.
      * intros i Hi. replace i with (S t) by lia. auto.
      * right. exists t. split; auto. intros Rt. apply ready_bool_true in Rt. congruence.
Qed.

Lemma unfinished_before p v : v < size G -> ~ (forall u, precedes G u v -> finished s p u) ->
  exists u, u < size G /\ precedes G u v /\ ~ finished s p u.
Proof.
  intros Hv N. destruct (some_or_none (size G) (fun u => precedes_bool G u v && negb (finished_bool s p u)))
    as [(u & Hu & H)|A].
  - apply andb_true_iff in H. rewrite negb_true_iff, finished_bool_false, precedes_bool_true in H. exists u. tauto.
  - exfalso. apply N. intros u Eu. pose proof (precedes_up _ _ _ Eu). specialize (A u ltac:(lia)). cbv beta in A.
    apply precedes_bool_true in Eu. rewrite Eu in A. simpl in A. apply finished_bool_true, negb_false_iff, A.
Qed.

(** A vertex becomes ready as one that precedes it ends. *)
Lemma becomes_ready_after p v : ready G s (S p) v -> ~ ready G s p v ->
  exists u, u < size G /\ precedes G u v /\ ~ finished s p u /\ runs s p u = true.
Proof.
  intros (Hv & Nv & Pv) Np.
  assert (U : exists u, u < size G /\ precedes G u v /\ ~ finished s p u).
  { apply unfinished_before; auto. intros P. apply Np. split; [auto|]. split; auto.
    intros F. apply Nv, finished_later with p; auto. }
  destruct U as (u & Hu & Eu & Nu). exists u. repeat split; auto.
  specialize (Pv u Eu). unfold finished in Pv, Nu. rewrite done_next in Pv.
  destruct (runs s p u); simpl in Pv; [auto|lia].
Qed.

(** A vertex has not executed yet while one before it is unfinished. *)
Lemma not_begun p u v : v < size G -> precedes G u v -> ~ finished s p u -> done s (S p) v = 0.
Proof.
  intros Hv Eu Nu. destruct (Nat.eq_dec (done s (S p) v) 0); auto. exfalso. apply Nu.
  assert (P : 0 < done s (S p) v) by lia. apply sum_positive in P. destruct P as (i & Hi & R).
  destruct (runs s i v) eqn:Er; simpl in R; [|lia].
  apply (only_ready_run _ _ _ rules) in Er; auto. destruct Er as (_ & _ & P).
  apply finished_later with i; [lia|auto].
Qed.

(** [counted t]: cores with lower-ranked work.  A vertex of the path waits for it for [extra v] at most, in all,
    and the first one for [at_release] more. *)
Variables (counted extra : nat -> nat) (at_release : nat).
Let waited_for a d v := sum d (fun i => if runs s (a + i) v then 0 else counted (a + i)).
Hypothesis first_waits : forall d v, v < size G -> (forall i, i <= d -> ready G s i v) ->
  waited_for 0 d v <= at_release + extra v.
Hypothesis later_waits : forall p d v, v < size G -> (forall i, i <= d -> ready G s (S p + i) v) ->
  ~ ready G s p v -> waited_for (S p) d v <= extra v.

Lemma path_account t : forall v, ready G s t v ->
  exists K w : nat -> bool,
    chain G K /\ K v = true /\
    (forall x, K x = true -> x = v \/ precedes G x v) /\
    (forall i, i < t -> w i = true ->
       somebody_waits G s i = true /\ forall x, x < size G -> K x = true -> runs s i x = false) /\
    (forall i, i < t -> w i = false -> exists x, x < size G /\ K x = true /\ runs s i x = true) /\
    sum t (fun i => if w i then counted i else 0) <= at_release + weight G extra K.
Proof.
  induction t as [t IH] using (well_founded_induction lt_wf). intros v Rd.
  pose proof Rd as (Hv & _ & _).
  destruct (ready_since t v Rd) as (a & Ha & Since & D).
  assert (Waiting : forall i, a <= i <= t -> runs s i v = false -> somebody_waits G s i = true).
  { intros i Hi E. apply somebody_waits_true. eauto. }
  destruct D as [->|(p & -> & Np)].
  - exists (fun x => x =? v), (fun i => negb (runs s i v)).
    split; [apply chain_single|]. split; [apply Nat.eqb_refl|].
    split; [intros x E; left; apply Nat.eqb_eq, E|].
    split; [|split].
    + intros i Hi E. apply negb_true_iff in E. split; [apply Waiting; auto; lia|].
      intros x _ Ex. apply Nat.eqb_eq in Ex. subst. auto.
    + intros i Hi E. apply negb_false_iff in E. exists v. rewrite Nat.eqb_refl. auto.
    + unfold weight. rewrite (sum_only _ _ v Hv).
      2: { intros x _ Ne. destruct (Nat.eqb_spec x v); [lia|auto]. }
      rewrite Nat.eqb_refl. apply Nat.le_trans with (2 := first_waits t v Hv ltac:(intros; apply Since; lia)).
      apply sum_le. intros i _. simpl. destruct (runs s i v); simpl; lia.
  - pose proof (Since (S p) ltac:(lia)) as (_ & _ & Pv).
    destruct (becomes_ready_after p v (Since (S p) ltac:(lia)) Np) as (u & Hu & Eu & Nu & Ru).
    assert (Rdu : ready G s p u) by (apply (only_ready_run _ _ _ rules); auto).
    destruct (IH p ltac:(lia) u Rdu) as (K & w & CK & Ku & Kp & Kw & Kr & Kb).
    assert (Kless : forall x, K x = true -> x < v /\ precedes G x v).
    { intros x Kx. pose proof (precedes_up _ _ _ Eu). destruct (Kp x Kx) as [->|H']; [split; [lia|auto]|].
      split; [|apply precedes_trans with u; auto].
      apply precedes_up in H'. lia. }
    assert (Kv : K v = false).
    { destruct (K v) eqn:E; auto. destruct (Kless v E). lia. }
    exists (fun x => (x =? v) || K x),
      (fun i => if i <? p then w i else if i =? p then false else negb (runs s i v)).
    split; [|split; [|split; [|split; [|split]]]].
    + intros x y Hxy Hy Kx Ky.
      destruct (Nat.eqb_spec y v) as [->|Ny].
      * destruct (Nat.eqb_spec x v) as [->|Nx]; [lia|]. simpl in Kx. apply Kless, Kx.
      * simpl in Ky. destruct (Kless y Ky) as (Ly & _).
        destruct (Nat.eqb_spec x v) as [->|Nx]; [lia|]. simpl in Kx. apply CK; auto.
    + rewrite Nat.eqb_refl. reflexivity.
    + intros x Kx. destruct (Nat.eqb_spec x v); [auto|]. right. apply Kless, Kx.
    + intros i Hi E. destruct (Nat.ltb_spec i p) as [Lp|Lp].
      * destruct (Kw i Lp E) as (W1 & W2). split; auto. intros x Hx Kx.
        destruct (Nat.eqb_spec x v) as [->|Ne]; [|apply W2; auto].
        destruct (runs s i v) eqn:Er; auto. exfalso.
        apply (only_ready_run _ _ _ rules) in Er; auto. destruct Er as (_ & _ & P).
        apply Nu. apply finished_later with i; [lia|auto].
      * destruct (Nat.eqb_spec i p) as [->|Ne]; [discriminate|]. apply negb_true_iff in E.
        assert (Ri : ready G s i v) by (apply Since; lia).
        split; [apply Waiting; auto; lia|]. intros x Hx Kx.
        destruct (Nat.eqb_spec x v) as [->|Nx]; [auto|]. simpl in Kx.
        destruct (runs s i x) eqn:Er; auto. exfalso.
        apply (only_ready_run _ _ _ rules) in Er; auto. destruct Er as (_ & F & _).
        apply F. apply (ready_after_ancestors G s i x v); [apply Kless, Kx|auto].
    + intros i Hi E. destruct (Nat.ltb_spec i p) as [Lp|Lp].
      * destruct (Kr i Lp E) as (x & Hx & Kx & Rx). exists x. rewrite Kx, orb_true_r. auto.
      * destruct (Nat.eqb_spec i p) as [->|Ne].
        -- exists u. rewrite Ku, orb_true_r. auto.
        -- apply negb_false_iff in E. exists v. rewrite Nat.eqb_refl. auto.
    + assert (Wt : weight G extra (fun x => (x =? v) || K x) = weight G extra K + extra v).
      { replace (extra v) with (sum (size G) (fun x => if x =? v then extra x else 0)).
        - unfold weight. rewrite <- sum_plus. apply sum_ext. intros x _.
          destruct (Nat.eqb_spec x v); [subst; rewrite Kv|]; simpl; lia.
        - rewrite (sum_only _ _ v Hv); [rewrite Nat.eqb_refl; reflexivity|].
          intros x _ Ne. destruct (Nat.eqb_spec x v); [lia|auto]. }
      rewrite Wt. replace t with (S p + (t - S p)) by lia. rewrite sum_shift. cbn [sum].
      destruct (Nat.ltb_spec p p); [lia|]. rewrite Nat.eqb_refl, Nat.add_0_r, Nat.add_assoc.
      apply Nat.add_le_mono.
      * apply Nat.le_trans with (2 := Kb). apply sum_le. intros i Hi. destruct (Nat.ltb_spec i p); [auto|lia].
      * apply Nat.le_trans with (2 := later_waits p (t - S p) v Hv ltac:(intros; apply Since; lia) Np).
        apply sum_le. intros i _. destruct (Nat.ltb_spec (S p + i) p); [lia|].
        destruct (Nat.eqb_spec (S p + i) p); [lia|]. destruct (runs s (S p + i) v); simpl; lia.
Qed.

(** *The bound along a path.*  While a vertex of the job waits, q cores at least execute vertices of the job that are
    [outside], higher-ranked work, or lower-ranked.  No path is heavier than [most] if each vertex weighs q times
    its execution, less what it executes outside, and more what it waits for lower-ranked work.  If it is to be shown of
    a [part] of the job, with all that precedes it, only the part of a path counts. *)
Theorem along_a_path c q part outside high r I most :
  0 < q -> within_wcet G s c ->
  (forall u v, edge G u v = true -> part v = true -> part u = true) ->
  (forall t, t < r -> somebody_waits G s t = true ->
     q <= count (size G) (fun v => outside v && runs s t v) + Nat.min (high t) q + counted t) ->
  sum r (fun t => Nat.min (high t) q) <= I ->
  no_path_longer G (fun v => if part v then q * c v - (if outside v then c v else 0) + extra v else 0) most ->
  weight G c outside + at_release + I + most <= q * r ->
  forall v, v < size G -> part v = true -> finished s r v.
Proof.
  intros Hq W Closed Full HI Most H v0 Hv0 Pv0. apply finished_bool_true.
  destruct (finished_bool s r v0) eqn:F0; auto. exfalso.
  assert (Up : forall u v, precedes G u v -> part v = true -> part u = true).
  { induction 1 as [v E|v w P IH E]; intros Pv; [apply (Closed u v E Pv)|apply IH, (Closed v w E Pv)]. }
  destruct (least (size G) (fun v => part v && negb (finished_bool s r v))) as (v & Hv & F & Fl).
  { exists v0. split; auto. rewrite Pv0, F0. reflexivity. }
  apply andb_true_iff in F. destruct F as (Pv & F). apply negb_true_iff, finished_bool_false in F.
  assert (Rd : ready G s r v).
  { split; [auto|]. split; [auto|]. intros u Eu. pose proof (Up u v Eu Pv) as Pu. apply precedes_up in Eu.
    specialize (Fl u ltac:(lia)). cbv beta in Fl. rewrite Pu in Fl. apply negb_false_iff, finished_bool_true in Fl. auto. }
  destruct (path_account r v Rd) as (K & w & CK & Kv & Kp & Kw & Kr & Kb).
  assert (Done : forall t x, x < size G -> done s t x <= c x).
  { intros t x Hx. pose proof (done_at_most_exec G m s rules t x Hx). specialize (W x Hx). lia. }
  pose proof (chain_at_most_length G _ _ K Most CK) as WK.
  unfold weight in WK. rewrite (sum_ext (size G) _ (fun v => if K v
    then q * c v - (if outside v then c v else 0) + extra v else 0)) in WK.
  2: { intros x _. destruct (K x) eqn:E; auto. destruct (Kp x E) as [->|P]; [rewrite Pv|rewrite (Up x v P Pv)]; auto. }
  fold (weight G (fun v => q * c v - (if outside v then c v else 0) + extra v) K) in WK.
  set (both := fun x => K x && outside x).
  assert (EK : weight G (fun v => q * c v - (if outside v then c v else 0) + extra v) K + weight G c both
    = q * weight G c K + weight G extra K).
  { unfold weight, both. rewrite <- sum_times, <- !sum_plus. apply sum_ext. intros x _.
    assert (c x <= q * c x) by nia. destruct (K x), (outside x); simpl; lia. }
  (* the ticks in which the path executes *)
  assert (T1 : r + 1 <= count r w + weight G c K).
  { assert (r <= count r w + sum (size G) (fun x => if K x then done s r x else 0)).
    { rewrite <- (Nat.mul_1_r r) at 1. rewrite <- sum_const. unfold count.
      rewrite (sum_ext (size G) _ (fun x => sum r (fun i => if K x then Nat.b2n (runs s i x) else 0))).
      - rewrite <- sum_swap, <- sum_plus. apply sum_le. intros i Hi. destruct (w i) eqn:E; simpl; [lia|].
        destruct (Kr i Hi E) as (x & Hx & Kx & Rx).
        pose proof (sum_term (size G) (fun x => if K x then Nat.b2n (runs s i x) else 0) x Hx) as T.
        cbv beta in T. rewrite Kx, Rx in T. simpl in T. lia.
      - intros x _. destruct (K x); [reflexivity|]. rewrite sum_zero; auto. }
    assert (sum (size G) (fun x => if K x then done s r x else 0) + 1 <= weight G c K); [|lia].
    unfold weight.
    assert (One : sum (size G) (fun x => Nat.b2n (x =? v)) = 1).
    { rewrite (sum_only _ _ v Hv); [rewrite Nat.eqb_refl; auto|].
      intros x _ Ne. destruct (Nat.eqb_spec x v); [lia|auto]. }
    rewrite <- One, <- sum_plus. apply sum_le. intros x Hx. destruct (Nat.eqb_spec x v) as [->|Ne].
    - rewrite Kv. specialize (W v Hv). unfold finished in F. simpl. lia.
    - destruct (K x); simpl; [|lia]. specialize (Done r x Hx). lia. }
  (* the others: q cores execute what is not on it *)
  assert (T2 : q * count r w + weight G c both
    <= weight G c outside + I + sum r (fun i => if w i then counted i else 0)).
  { assert (B : sum r (fun i => if w i then count (size G) (fun x => outside x && runs s i x) else 0)
      + weight G c both <= weight G c outside).
    { unfold weight, both, count.
      rewrite (sum_ext r _ (fun i => sum (size G) (fun x => if w i then Nat.b2n (outside x && runs s i x) else 0)))
        by (intros i _; destruct (w i); [reflexivity|rewrite sum_zero; auto]).
      rewrite sum_swap, <- sum_plus. apply sum_le. intros x Hx.
      destruct (outside x); [|rewrite andb_false_r, sum_zero; [lia|intros; destruct (w i); auto]].
      rewrite andb_true_r. cbn [andb]. destruct (K x) eqn:Kx.
      - rewrite sum_zero; [lia|]. intros i Hi. destruct (w i) eqn:E; auto.
        destruct (Kw i Hi E) as (_ & N). rewrite N; auto.
      - specialize (Done r x Hx). apply Nat.le_trans with (done s r x); [|lia].
        rewrite Nat.add_0_r. apply sum_le. intros i _. destruct (w i); lia. }
    assert (A : q * count r w <= sum r (fun i => if w i then count (size G) (fun x => outside x && runs s i x) else 0)
      + sum r (fun t => Nat.min (high t) q) + sum r (fun i => if w i then counted i else 0)).
    { unfold count at 1. rewrite <- sum_times, <- !sum_plus. apply sum_le. intros i Hi.
      destruct (w i) eqn:E; simpl Nat.b2n; [|lia]. destruct (Kw i Hi E) as (Wi & _).
      specialize (Full i Hi Wi). lia. }
    lia. }
  nia.
Qed.

End path.
